//! Parquet tables: columns as of CSV, or lists of numbers whose elements a LeRobot data set names.

use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Repetition, Type as Physical};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::reader::RowIter;
use parquet::record::{Field, Row};
use parquet::schema::types::Type;

use super::input::Input;
use super::lerobot::Info;
use super::table::take;
use super::{Fault, Source, Wanted};
use crate::log::error::{LogError, Problem, Unit};

struct Parquet {
    rows: RowIter<'static>,
    /// The first row, which tells how long the lists are.
    first: Option<Row>,
    names: Vec<String>,
    /// Length of each column's list; one of a number.
    lengths: Vec<usize>,
    /// The present row, its lists laid out one after the other.
    cells: Vec<f64>,
    row: u64,
    count: u64,
    /// The cells of time and episode of a LeRobot data set, whose time starts again with each episode.
    episodes: Option<Episodes>,
}

struct Episodes {
    time: usize,
    episode: usize,
    last: Option<(f64, f64)>,
    /// What is added to the present episode's time, s.
    shift: f64,
}

/// Silence between two episodes, s: no window reaches across it.
const BETWEEN: f64 = 1.0;

/// Opens a table and reads its first row.
pub(super) fn open(path: &Path, file: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let failed = |problem| LogError::new(path, problem);
    let info = Info::beside(file).map_err(failed)?;
    let mut table = read(input).map_err(|error| failed(damaged(&error)))?;
    let row = table.rows.next();
    let Some(row) = row else {
        return Err(failed(Problem::Empty));
    };
    let row = row.map_err(|error| failed(damaged(&error)))?;
    for (name, field) in row.get_column_iter() {
        let elements = match field {
            Field::ListInternal(list) => Some(list.len()),
            _ => None,
        };
        table.lengths.push(elements.unwrap_or(1));
        match (elements, &info) {
            (None, _) => table.names.push(name.clone()),
            (Some(n), Some(info)) => table.names.extend(info.names(name, n)),
            (Some(n), None) => table.names.extend((0..n).map(|k| format!("{name}[{k}]"))),
        }
    }
    let place = |name: &str| table.names.iter().position(|n| n == name);
    if let (Some(time), Some(episode)) = (place("timestamp"), place("episode_index")) {
        table.episodes = Some(Episodes {
            time,
            episode,
            last: None,
            shift: 0.0,
        });
        // Which it now is, whatever the column is called.
        "t".clone_into(&mut table.names[time]);
    }
    table.first = Some(row);
    Ok(Box::new(table))
}

fn read(input: Input) -> Result<Parquet, ParquetError> {
    let reader = SerializedFileReader::new(input.file)?;
    let metadata = reader.metadata().file_metadata();
    let count = u64::try_from(metadata.num_rows()).unwrap_or(0);
    let schema = numbers_of(metadata.schema())?;
    let rows = RowIter::from_file_into(Box::new(reader)).project(Some(schema))?;
    Ok(Parquet {
        rows,
        first: None,
        names: Vec::new(),
        lengths: Vec::new(),
        cells: Vec::new(),
        row: 0,
        count,
        episodes: None,
    })
}

/// The columns that hold numbers or lists of them: pictures and texts are not even decoded.
fn numbers_of(schema: &Type) -> Result<Type, ParquetError> {
    let fields = schema
        .get_fields()
        .iter()
        .filter(|field| is_numbers(field, 0));
    Type::group_type_builder(schema.name())
        .with_fields(fields.map(Arc::clone).collect())
        .build()
}

fn is_numbers(field: &Type, depth: usize) -> bool {
    // A list is a group of a repeated group of its elements.
    let once = !field.is_group() || field.get_fields().len() == 1;
    let repeated = field.get_basic_info().has_repetition()
        && field.get_basic_info().repetition() == Repetition::REPEATED;
    let is_number = |physical| {
        matches!(
            physical,
            Physical::INT32 | Physical::INT64 | Physical::FLOAT | Physical::DOUBLE
        )
    };
    if field.is_primitive() {
        return is_number(field.get_physical_type()) && (depth > 0 || !repeated);
    }
    once && depth < 3 && field.get_fields().iter().all(|f| is_numbers(f, depth + 1))
}

impl Parquet {
    /// Lays a row out; false at the end.
    fn read_row(&mut self) -> Result<bool, Fault> {
        let row = match self.first.take() {
            Some(row) => row,
            None => match self.rows.next() {
                None => return Ok(false),
                Some(Ok(row)) => row,
                Some(Err(error)) => return Err(Fault::new(self.row + 1, damaged(&error))),
            },
        };
        self.row += 1;
        self.cells.clear();
        for ((_, field), &length) in row.get_column_iter().zip(&self.lengths) {
            match field {
                Field::ListInternal(list) if list.len() == length => {
                    self.cells.extend(list.elements().iter().map(number));
                }
                Field::ListInternal(list) => {
                    let (found, expected) = (list.len(), length);
                    return Err(Fault::new(self.row, Problem::Ragged { found, expected }));
                }
                // An empty list is a null one.
                field => self
                    .cells
                    .extend(std::iter::repeat_n(number(field), length)),
            }
        }
        if let Some(episodes) = &mut self.episodes {
            episodes.run_on(&mut self.cells);
        }
        Ok(true)
    }
}

impl Episodes {
    /// Lets time run on where an episode begins.
    fn run_on(&mut self, cells: &mut [f64]) {
        let (t, episode) = (cells[self.time], cells[self.episode]);
        if let Some((end, before)) = self.last
            && episode != before
        {
            self.shift = end + BETWEEN - t;
        }
        cells[self.time] = t + self.shift;
        self.last = Some((cells[self.time], episode));
    }
}

impl Source for Parquet {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self) -> Unit {
        Unit::Row
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        while self.read_row()? {
            let cell = |cell: usize| self.cells.get(cell).copied().unwrap_or(f64::NAN);
            if take(wanted, values, self.row, cell)? {
                return Ok(Some(self.row));
            }
        }
        Ok(None)
    }

    fn progress(&self) -> (u64, u64) {
        (self.row, self.count)
    }
}

fn number(field: &Field) -> f64 {
    match *field {
        Field::Byte(x) => x.into(),
        Field::Short(x) => x.into(),
        Field::Int(x) => x.into(),
        Field::Long(x) => x as f64,
        Field::UByte(x) => x.into(),
        Field::UShort(x) => x.into(),
        Field::UInt(x) => x.into(),
        Field::ULong(x) => x as f64,
        Field::Float(x) => x.into(),
        Field::Double(x) => x,
        Field::TimestampMillis(x) => x as f64 / 1e3,
        Field::TimestampMicros(x) => x as f64 / 1e6,
        _ => f64::NAN,
    }
}

fn damaged(error: &ParquetError) -> Problem {
    Problem::Damaged(error.to_string())
}
