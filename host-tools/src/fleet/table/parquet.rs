//! Tables of blocks: Parquet, schema `proprio.blocks/1`, a row group for each block of time, so that damage costs what it hits.
//!
//! The columns that a hash stands for are in the file's metadata, under `proprio.columns.HASH`. Numbers of factors are `f32`: a column's information
//! is then known to 1e-7 of it, four orders below its ±. They are split into bytes (BYTE_STREAM_SPLIT) and packed with zstd.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, Type as Physical, ZstdLevel};
use parquet::column::reader::{get_column_reader, get_typed_column_reader};
use parquet::data_type::{
    ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use parquet::schema::types::ColumnPath;

use super::{SCHEMA, Table};
use crate::fleet::block::Block;
use crate::fleet::columns::BlockColumns;
use crate::fleet::gate::Fault;

/// Before a hash in the metadata.
const COLUMNS: &str = "proprio.columns.";
/// The columns of the table.
pub(in crate::fleet) const MESSAGE: &str = "message blocks {
  required binary robot (UTF8);
  optional binary site (UTF8);
  optional binary firmware (UTF8);
  required binary log (UTF8);
  required double t0;
  required double t1;
  required double received;
  required binary limb (UTF8);
  required binary joint (UTF8);
  required int32 fold;
  required binary columns (UTF8);
  required double windows;
  required double rms;
  optional double temperature;
  required group factor (LIST) { repeated group list { required float element; } }
  required int64 crc32c;
  required binary program (UTF8);
}";
/// The first bytes of a Parquet file (its format's specification).
const MAGIC: &[u8] = b"PAR1";
/// How hard zstd tries: higher levels gain less than 1 % of such bytes.
const LEVEL: i32 = 9;
/// Most rows of a row group, and most numbers of one, that are read: what a damaged count asks for is not reserved.
const MOST_ROWS: usize = 1 << 16;
const MOST_NUMBERS: usize = 1 << 26;

/// A table's bytes.
///
/// # Errors
/// None that plain data and memory can cause.
pub fn encode(blocks: &[Block]) -> Result<Vec<u8>, ParquetError> {
    let mut known: BTreeMap<&str, &BlockColumns> = BTreeMap::new();
    for block in blocks {
        known.insert(&block.hash, &block.columns);
    }
    let mut metadata = vec![KeyValue::new("schema".to_owned(), SCHEMA.to_owned())];
    metadata.extend(
        (known.iter())
            .map(|(hash, columns)| KeyValue::new(format!("{COLUMNS}{hash}"), columns.text())),
    );
    let numbers = ColumnPath::new(vec!["factor".into(), "list".into(), "element".into()]);
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(LEVEL)?))
        .set_statistics_enabled(EnabledStatistics::None)
        .set_column_dictionary_enabled(numbers.clone(), false)
        .set_column_encoding(numbers, Encoding::BYTE_STREAM_SPLIT)
        .set_key_value_metadata(Some(metadata))
        .build();
    let schema = Arc::new(parse_message_type(MESSAGE)?);
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let same = |a: &Block, b: &Block| (&a.log, a.t0.to_bits()) == (&b.log, b.t0.to_bits());
    for group in blocks.chunk_by(same) {
        let mut rows = writer.next_row_group()?;
        put_group(&mut rows, group)?;
        rows.close()?;
    }
    writer.into_inner()
}

/// Writes the columns of a group in the order of [`MESSAGE`].
fn put_group(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    blocks: &[Block],
) -> Result<(), ParquetError> {
    let text = |of: fn(&Block) -> &str| -> Vec<ByteArray> {
        blocks
            .iter()
            .map(|block| ByteArray::from(of(block)))
            .collect()
    };
    let number = |of: fn(&Block) -> f64| -> Vec<f64> { blocks.iter().map(of).collect() };
    put::<ByteArrayType>(rows, &text(|b| &b.robot), None)?;
    for of in [
        |b: &Block| b.site.as_deref(),
        |b: &Block| b.firmware.as_deref(),
    ] as [fn(&Block) -> Option<&str>; 2]
    {
        let told: Vec<ByteArray> = blocks.iter().filter_map(of).map(ByteArray::from).collect();
        let levels = blocks.iter().map(|b| i16::from(of(b).is_some()));
        put::<ByteArrayType>(rows, &told, Some(levels.collect()))?;
    }
    put::<ByteArrayType>(rows, &text(|b| &b.log), None)?;
    put::<DoubleType>(rows, &number(|b| b.t0), None)?;
    put::<DoubleType>(rows, &number(|b| b.t1), None)?;
    put::<DoubleType>(rows, &number(|b| b.received), None)?;
    put::<ByteArrayType>(rows, &text(|b| &b.limb), None)?;
    put::<ByteArrayType>(rows, &text(|b| &b.joint), None)?;
    let folds: Vec<i32> = blocks.iter().map(|b| b.fold as i32).collect();
    put::<Int32Type>(rows, &folds, None)?;
    put::<ByteArrayType>(rows, &text(|b| &b.hash), None)?;
    put::<DoubleType>(rows, &number(|b| b.windows), None)?;
    put::<DoubleType>(rows, &number(|b| b.rms), None)?;
    let told: Vec<f64> = blocks.iter().filter_map(|b| b.temperature).collect();
    let levels = blocks.iter().map(|b| i16::from(b.temperature.is_some()));
    put::<DoubleType>(rows, &told, Some(levels.collect()))?;
    put_factors(rows, blocks)?;
    let sums: Vec<i64> = blocks.iter().map(|b| i64::from(b.crc32c)).collect();
    put::<Int64Type>(rows, &sums, None)?;
    put::<ByteArrayType>(rows, &text(|b| &b.program), None)
}

/// Writes a column, with the levels of one that may be absent.
fn put<T: DataType>(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: &[T::T],
    levels: Option<Vec<i16>>,
) -> Result<(), ParquetError> {
    if let Some(mut column) = rows.next_column()? {
        column
            .typed::<T>()
            .write_batch(values, levels.as_deref(), None)?;
        column.close()?;
    }
    Ok(())
}

fn put_factors(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    blocks: &[Block],
) -> Result<(), ParquetError> {
    let numbers: Vec<f32> = blocks
        .iter()
        .flat_map(|b| b.factor.iter().copied())
        .collect();
    // An empty list has one level and no number.
    let of = |b: &Block| match b.factor.len() {
        0 => vec![(0, 0)],
        n => (0..n).map(|k| (1, i16::from(k > 0))).collect(),
    };
    let (definition, repetition): (Vec<i16>, Vec<i16>) = blocks.iter().flat_map(of).unzip();
    if let Some(mut column) = rows.next_column()? {
        let typed = column.typed::<FloatType>();
        typed.write_batch(&numbers, Some(&definition), Some(&repetition))?;
        column.close()?;
    }
    Ok(())
}

/// [`super::read`] of an open file, or of bytes, under a name.
pub fn read_from<R: parquet::file::reader::ChunkReader + 'static>(name: &str, file: R) -> Table {
    // Bytes from outside: a decoder that panics is a damaged file.
    let read = catch_unwind(AssertUnwindSafe(|| Reading::of(name, file)));
    match read {
        Ok(Ok(table)) => table,
        Ok(Err(fault)) => Table::none(fault),
        Err(_) => Table::none(damaged(name, "its decoder failed")),
    }
}

/// The robots of an open file's blocks, of those row groups that can be read.
pub(super) fn robots_from<R: parquet::file::reader::ChunkReader + 'static>(
    file: R,
) -> BTreeSet<String> {
    let robots = || -> Result<BTreeSet<String>, ParquetError> {
        let reader = SerializedFileReader::new(file)?;
        let of = |group: usize| {
            let rows = reader.get_row_group(group)?;
            // The schema's first.
            Ok(column::<ByteArrayType>(&*rows, 0)?.0)
        };
        let groups = (0..reader.num_row_groups()).map(of);
        let names = groups.filter_map(Result::<Vec<ByteArray>, ParquetError>::ok);
        let names = names
            .flatten()
            .filter_map(|name| Some(name.as_utf8().ok()?.to_owned()));
        Ok(names.collect())
    };
    let read = catch_unwind(AssertUnwindSafe(robots));
    read.ok().and_then(Result::ok).unwrap_or_default()
}

fn damaged(file: &str, cause: impl ToString) -> Fault {
    Fault::Damaged {
        file: file.to_owned(),
        cause: cause.to_string(),
    }
}

/// What a file's columns are known by.
type Known = BTreeMap<String, (Arc<BlockColumns>, Arc<str>)>;

struct Reading;

impl Reading {
    fn of<R: parquet::file::reader::ChunkReader + 'static>(
        name: &str,
        file: R,
    ) -> Result<Table, Fault> {
        // A log or a text has other first bytes; a table that is cut keeps its own.
        let begin = file.get_bytes(0, MAGIC.len().min(file.len() as usize));
        if begin.is_ok_and(|begin| !MAGIC.starts_with(&begin)) {
            return Err(Fault::NotBlocks {
                file: name.to_owned(),
                found: None,
            });
        }
        let reader = SerializedFileReader::new(file).map_err(|error| damaged(name, error))?;
        let metadata = reader.metadata().file_metadata();
        let pairs = metadata.key_value_metadata().map_or(&[][..], Vec::as_slice);
        let schema = pairs.iter().find(|pair| pair.key == "schema");
        let found = schema.and_then(|pair| pair.value.clone());
        if found.as_deref() != Some(SCHEMA) {
            return Err(Fault::NotBlocks {
                file: name.to_owned(),
                found,
            });
        }
        check_schema(name, metadata.schema_descr())?;
        let mut table = Table::default();
        let mut known = Known::new();
        for pair in pairs {
            if let (Some(hash), Some(text)) = (pair.key.strip_prefix(COLUMNS), &pair.value) {
                match serde_json::from_str::<BlockColumns>(text) {
                    Ok(columns) if columns.hash() == hash => {
                        known.insert(hash.to_owned(), (Arc::new(columns), Arc::from(hash)));
                    }
                    _ => table.faults.push(Fault::Columns {
                        file: name.to_owned(),
                        hash: hash.to_owned(),
                    }),
                }
            }
        }
        for group in 0..reader.num_row_groups() {
            let rows = AssertUnwindSafe(|| {
                reader
                    .get_row_group(group)
                    .and_then(|rows| blocks_of(&*rows, &known))
            });
            match catch_unwind(rows) {
                Ok(Ok((blocks, unknown))) => {
                    table.blocks.extend(blocks);
                    table
                        .faults
                        .extend(unknown.into_iter().map(|hash| Fault::Columns {
                            file: name.to_owned(),
                            hash,
                        }));
                }
                Ok(Err(error)) => table
                    .faults
                    .push(damaged(name, format!("row group {group}: {error}"))),
                Err(_) => table.faults.push(damaged(
                    name,
                    format!("row group {group}: its decoder failed"),
                )),
            }
        }
        Ok(table)
    }
}

/// Whether a file's columns are those of the schema, in name, order and type.
fn check_schema(name: &str, found: &parquet::schema::types::SchemaDescriptor) -> Result<(), Fault> {
    let wrong = |column: String, found: String| Fault::Schema {
        file: name.to_owned(),
        column,
        found,
    };
    let parsed = parse_message_type(MESSAGE).map_err(|error| damaged(name, error))?;
    let asked = parquet::schema::types::SchemaDescriptor::new(Arc::new(parsed));
    for (k, column) in asked.columns().iter().enumerate() {
        let path = column.path().string();
        let Some(own) = found.columns().get(k) else {
            return Err(wrong(path, "nothing".to_owned()));
        };
        let type_of = |physical: Physical| format!("{physical}").to_lowercase();
        let levels =
            |c: &parquet::schema::types::ColumnDescriptor| (c.max_def_level(), c.max_rep_level());
        if own.path().string() != path {
            return Err(wrong(path, own.path().string()));
        }
        if own.physical_type() != column.physical_type() || levels(own) != levels(column) {
            return Err(wrong(path, type_of(own.physical_type())));
        }
    }
    Ok(())
}

/// Values of a column, with its definition and repetition levels.
type Levelled<T> = (Vec<<T as DataType>::T>, Vec<i16>, Vec<i16>);

/// A column of a row group.
fn column<T: DataType>(rows: &dyn RowGroupReader, k: usize) -> Result<Levelled<T>, ParquetError> {
    let descriptor = rows.metadata().column(k).column_descr_ptr();
    let reader = get_column_reader(descriptor, rows.get_column_page_reader(k)?);
    let mut reader = get_typed_column_reader::<T>(reader);
    let (mut values, mut definition, mut repetition) = (Vec::new(), Vec::new(), Vec::new());
    reader.read_records(
        MOST_ROWS,
        Some(&mut definition),
        Some(&mut repetition),
        &mut values,
    )?;
    if values.len() > MOST_NUMBERS {
        return Err(ParquetError::General("too many numbers".to_owned()));
    }
    Ok((values, definition, repetition))
}

/// The blocks of a row group, and the hashes of columns that the file does not have.
fn blocks_of(
    rows: &dyn RowGroupReader,
    known: &Known,
) -> Result<(Vec<Block>, Vec<String>), ParquetError> {
    let count = usize::try_from(rows.metadata().num_rows()).unwrap_or(0);
    let short = || ParquetError::General("a column is shorter than the others".to_owned());
    let mut next = 0..;
    let mut place = || next.next().unwrap_or(0);
    let text = |k: usize| -> Result<Vec<Option<String>>, ParquetError> {
        let (values, definition, _) = column::<ByteArrayType>(rows, k)?;
        let strings = values
            .iter()
            .map(|bytes| bytes.as_utf8().map(str::to_owned));
        let strings: Vec<String> = strings.collect::<Result<_, _>>()?;
        spread(strings, &definition, count).ok_or_else(short)
    };
    let number = |k: usize| -> Result<Vec<Option<f64>>, ParquetError> {
        let (values, definition, _) = column::<DoubleType>(rows, k)?;
        spread(values, &definition, count).ok_or_else(short)
    };
    let (robot, site, firmware, log) = (
        text(place())?,
        text(place())?,
        text(place())?,
        text(place())?,
    );
    let (t0, t1, received) = (number(place())?, number(place())?, number(place())?);
    let (limb, joint) = (text(place())?, text(place())?);
    let folds = column::<Int32Type>(rows, place())?.0;
    let hashes = text(place())?;
    let (windows, rms, temperature) = (number(place())?, number(place())?, number(place())?);
    let (numbers, definition, repetition) = column::<FloatType>(rows, place())?;
    let factors = lists(numbers, &definition, &repetition, count).ok_or_else(short)?;
    let sums = column::<Int64Type>(rows, place())?.0;
    let programs = text(place())?;
    if folds.len() != count || sums.len() != count {
        return Err(short());
    }
    let (mut blocks, mut unknown) = (Vec::new(), Vec::new());
    for (n, factor) in factors.into_iter().enumerate() {
        let own = |x: &[Option<String>]| x[n].clone().unwrap_or_default();
        let value = |x: &[Option<f64>]| x[n].unwrap_or(f64::NAN);
        let Some((columns, hash)) = known.get(&own(&hashes)) else {
            unknown.push(own(&hashes));
            continue;
        };
        blocks.push(Block {
            robot: own(&robot),
            site: site[n].clone(),
            firmware: firmware[n].clone(),
            log: own(&log),
            t0: value(&t0),
            t1: value(&t1),
            received: value(&received),
            limb: own(&limb),
            joint: own(&joint),
            fold: folds[n] as u32,
            columns: columns.clone(),
            hash: hash.clone(),
            windows: value(&windows),
            rms: value(&rms),
            temperature: temperature[n],
            factor,
            crc32c: sums[n] as u32,
            program: own(&programs),
        });
    }
    unknown.dedup();
    Ok((blocks, unknown))
}

/// Values where the levels say that there is one; `None` if they are not as many as rows.
fn spread<T>(values: Vec<T>, definition: &[i16], rows: usize) -> Option<Vec<Option<T>>> {
    let mut values = values.into_iter();
    let all: Vec<Option<T>> = match definition.is_empty() {
        true => values.map(Some).collect(),
        false => {
            let of = |level: &i16| (*level > 0).then(|| values.next()).flatten();
            definition.iter().map(of).collect()
        }
    };
    (all.len() == rows).then_some(all)
}

/// The lists of a column of them.
fn lists(
    numbers: Vec<f32>,
    definition: &[i16],
    repetition: &[i16],
    rows: usize,
) -> Option<Vec<Vec<f32>>> {
    let mut lists: Vec<Vec<f32>> = Vec::new();
    let mut numbers = numbers.into_iter();
    for (defined, repeated) in definition.iter().zip(repetition) {
        if *repeated == 0 {
            lists.push(Vec::new());
        }
        if *defined > 0 {
            lists.last_mut()?.push(numbers.next()?);
        }
    }
    (lists.len() == rows).then_some(lists)
}
