//! Columns of text: CSV of proprio's own, of PlotJuggler, of ROS 1's `rostopic echo -p`, of a spreadsheet.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;
use std::rc::Rc;

use flate2::bufread::MultiGzDecoder;

use super::decimal::decimal;
use super::input::Input;
use super::records::Records;
use super::{Empty, Fault, Source, Wanted};
use crate::log::error::{LogError, Place, Problem, Unit};
use crate::log::slots::TIME;

/// Longer than any header; what has no line end by then is no text.
const LONGEST_HEADER: u64 = 1 << 22;

/// What some spreadsheets begin UTF-8 with.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";
/// Rows whose stamps lie no farther apart, s, are parts of one message: PlotJuggler exports a row per stamp, and stamps of one message's
/// fields differ by rounding; the fastest logs have 200 µs between messages.
const ONE_MESSAGE: f64 = 1e-5;

/// What separates columns where commas do not.
const SEPARATORS: [u8; 2] = [b';', b'\t'];

struct Text {
    records: Records,
    names: Vec<String>,
    /// The header's line.
    header: u64,
    /// The first row, where it was looked at for names.
    looked_at: bool,
    separator: u8,
    /// The wanted cells of rows before that are parts of a message.
    part: Option<Vec<f64>>,
    /// Whether each wanted cell has held a number, and how many rows there were, until one is whole.
    filled: Vec<bool>,
    rows: u64,
    has_whole: bool,
    read: Rc<Cell<u64>>,
    size: u64,
}

/// A reader that counts what is read from it.
struct Counted<R> {
    inner: R,
    read: Rc<Cell<u64>>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

/// Opens a table and reads its header.
pub(super) fn open(path: &Path, input: Input, gzip: bool) -> Result<Box<dyn Source>, LogError> {
    let size = input.size;
    begin(path, Box::new(input.file), size, gzip)
}

/// Reads a table whose rows come while it is read, from its header on.
pub(super) fn open_live(path: &Path, text: Box<dyn Read>) -> Result<Box<dyn Source>, LogError> {
    begin(path, text, 0, false)
}

fn begin(
    path: &Path,
    inner: Box<dyn Read>,
    size: u64,
    gzip: bool,
) -> Result<Box<dyn Source>, LogError> {
    let read = Rc::new(Cell::new(0));
    let counted = Counted {
        inner,
        read: Rc::clone(&read),
    };
    let file = BufReader::with_capacity(1 << 16, counted);
    let mut bytes: Box<dyn BufRead> = if gzip {
        Box::new(BufReader::with_capacity(1 << 16, MultiGzDecoder::new(file)))
    } else {
        Box::new(file)
    };
    let start = header(&mut bytes).map_err(|error| fault(path, 1, Problem::Read(error)))?;
    let separator = separator(&start);
    let start = match start.strip_prefix(BYTE_ORDER_MARK) {
        Some(start) => start.to_vec(),
        None => start,
    };
    let mut records = Records::new(Box::new(Cursor::new(start).chain(bytes)), separator);
    let found = records.read();
    if !found.map_err(|error| fault(path, 1, Problem::Read(error)))? {
        return Err(fault(path, 1, Problem::Empty));
    }
    let names = (0..records.len()).filter_map(|cell| records.get(cell));
    let names: Vec<String> = names
        .map(|name| String::from_utf8_lossy(name).trim().to_owned())
        .collect();
    check_header(&names).map_err(|problem| fault(path, records.line(), problem))?;
    let mut text = Text {
        header: records.line(),
        records,
        names,
        looked_at: false,
        separator,
        part: None,
        filled: Vec::new(),
        rows: 0,
        has_whole: false,
        read,
        size,
    };
    text.name_joints()
        .map_err(|f| f.error(path, Unit::Line, &text.names))?;
    Ok(Box::new(text))
}

/// The lines up to the first that says something, with it.
fn header(bytes: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    let mut bytes = bytes.take(LONGEST_HEADER);
    while bytes.read_until(b'\n', &mut start)? > 0 && start.trim_ascii().is_empty() {}
    Ok(start)
}

/// Commas, unless the header has none and another separator.
fn separator(header: &[u8]) -> u8 {
    let others = || SEPARATORS.into_iter().find(|s| header.contains(s));
    if header.contains(&b',') {
        return b',';
    }
    others().unwrap_or(b',')
}

/// A header has names, and separators between them.
fn check_header(names: &[String]) -> Result<(), Problem> {
    let is_number = |name: &String| fast_float2::parse::<f64, _>(name.replace(',', ".")).is_ok();
    if is_echoed(names) {
        return Err(Problem::EchoedCsv);
    }
    if names.iter().all(is_number) {
        return Err(Problem::NoHeader);
    }
    if let [only] = names
        && let Some(separator) = only.chars().find(|c| [' ', '|'].contains(c))
    {
        return Err(Problem::Separator(separator));
    }
    Ok(())
}

/// Whether the first line is a message as `ros2 topic echo --csv` prints it: a stamp's seconds and nanoseconds, the frame's name, and the values of
/// all other fields; or a LowState, which begins with the robot's mark (unitree_sdk2, `head`: FE EF).
fn is_echoed(names: &[String]) -> bool {
    let [first, second, third, .., last] = names else {
        return false;
    };
    let is_value = |name: &String| name.parse::<f64>().is_ok();
    let nanoseconds = second.parse::<u32>().is_ok_and(|ns| ns < 1_000_000_000);
    let is_stamp = first.parse::<i32>().is_ok() && nanoseconds && !is_value(third);
    let is_low_state = (first.as_str(), second.as_str()) == ("254", "239") && is_value(third);
    (is_stamp || is_low_state) && is_value(last)
}

impl Text {
    /// In the CSV that ROS 1 prints of joint states the names are cells of each row: `field.name0`, `field.position0`.
    fn name_joints(&mut self) -> Result<(), Fault> {
        let Some(prefix) = self.names.iter().find_map(|n| n.strip_suffix("name0")) else {
            return Ok(());
        };
        let prefix = prefix.to_owned();
        if !self.read_record()? {
            return Ok(());
        }
        self.looked_at = true;
        let cell = |text: &Self, name: String| {
            let place = text.names.iter().position(|n| *n == name)?;
            let cell = String::from_utf8_lossy(text.records.get(place)?);
            Some(cell.trim().to_owned())
        };
        for index in 0.. {
            let Some(joint) = cell(self, format!("{prefix}name{index}")) else {
                break;
            };
            for quantity in ["position", "velocity", "effort"] {
                let old = format!("{prefix}{quantity}{index}");
                if let Some(name) = self.names.iter_mut().find(|name| **name == old) {
                    *name = format!("{joint}/{quantity}");
                }
            }
        }
        Ok(())
    }

    /// What is wrong with a table none of whose rows is whole: the first column without a number.
    fn never_filled(&mut self, wanted: &[Wanted]) -> Option<Fault> {
        let rows = std::mem::take(&mut self.rows);
        if self.has_whole || rows == 0 || self.filled.len() != wanted.len() {
            return None;
        }
        let must = wanted.iter().zip(&self.filled);
        let mut never = must.filter(|(w, filled)| w.empty == Empty::Skip && !**filled);
        let (w, _) = never.next()?;
        Some(Fault::at(self.header, w.cell, Problem::NoNumbers { rows }))
    }

    fn read_record(&mut self) -> Result<bool, Fault> {
        let here = self.records.next_line();
        let more = self.records.read();
        more.map_err(|error| Fault::new(here, Problem::Read(error)))
    }

    /// Reads the wanted cells of the present row; false if one is empty that every message has: the row holds a part of a message, or
    /// another one.
    fn cells(&self, wanted: &[Wanted], values: &mut [f64]) -> Result<bool, Fault> {
        let mut is_whole = true;
        for w in wanted {
            // A row has as many cells as the header.
            let text = self.records.get(w.cell).unwrap_or_default();
            let at = |problem| Fault::at(self.records.line(), w.cell, problem);
            values[w.slot] = match (self.number(text), w.empty) {
                (Ok(value), _) if value.is_finite() => value * w.scale,
                (Ok(value), Empty::Refuse) => return Err(at(Problem::NotFinite(value))),
                (Err(()), empty) if empty == Empty::Refuse || !text.trim_ascii().is_empty() => {
                    let text = String::from_utf8_lossy(text).into_owned();
                    return Err(at(Problem::NotANumber(text)));
                }
                (_, empty) => {
                    is_whole &= empty != Empty::Skip;
                    f64::NAN
                }
            };
        }
        Ok(is_whole)
    }

    /// Adds the present row's cells to those of the rows before that are of the same message; true if it is whole then.
    fn join(&mut self, wanted: &[Wanted], values: &mut [f64]) -> bool {
        self.filled.resize(wanted.len(), false);
        for (filled, w) in self.filled.iter_mut().zip(wanted) {
            *filled |= !values[w.slot].is_nan();
        }
        self.rows += 1;
        let joins = |part: &&Vec<f64>| (values[TIME] - part[TIME]).abs() <= ONE_MESSAGE;
        if let Some(part) = self.part.as_ref().filter(joins) {
            let cells = wanted.iter().map(|w| w.slot);
            for slot in cells.filter(|slot| *slot != TIME) {
                if values[slot].is_nan() {
                    values[slot] = part[slot];
                }
            }
            // The message is that of its first row.
            values[TIME] = part[TIME];
        }
        let must = wanted.iter().filter(|w| w.empty == Empty::Skip);
        let is_whole = must.clone().all(|w| !values[w.slot].is_nan());
        let says = must
            .filter(|w| w.slot != TIME)
            .any(|w| !values[w.slot].is_nan());
        self.part = (says && !is_whole && !values[TIME].is_nan()).then(|| values.to_vec());
        is_whole
    }

    fn number(&self, text: &[u8]) -> Result<f64, ()> {
        if let Some(value) = decimal(text) {
            return Ok(value);
        }
        if let Ok(value) = fast_float2::parse(text) {
            return Ok(value);
        }
        // The slow path: only here are blanks around the number, or a decimal comma, worth a look.
        let text = text.trim_ascii();
        let text = if self.separator != b',' && text.contains(&b',') {
            let point = |b: &u8| if *b == b',' { b'.' } else { *b };
            Cow::Owned(text.iter().map(point).collect())
        } else {
            Cow::Borrowed(text)
        };
        fast_float2::parse(&text).map_err(drop)
    }
}

impl Source for Text {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self) -> Unit {
        Unit::Line
    }

    fn header(&self) -> Option<Place> {
        Some(Place {
            unit: Unit::Line,
            number: self.header,
        })
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        loop {
            if !std::mem::take(&mut self.looked_at) && !self.read_record()? {
                return match self.never_filled(wanted) {
                    Some(fault) => Err(fault),
                    None => Ok(None),
                };
            }
            let line = self.records.line();
            let (found, expected) = (self.records.len(), self.names.len());
            if found != expected {
                return Err(Fault::new(line, Problem::Ragged { found, expected }));
            }
            let is_whole = self.cells(wanted, values)?;
            if is_whole || self.join(wanted, values) {
                self.part = None;
                self.has_whole = true;
                return Ok(Some(line));
            }
        }
    }

    fn progress(&self) -> (u64, u64) {
        (self.read.get(), self.size)
    }
}

fn fault(path: &Path, line: u64, problem: Problem) -> LogError {
    Fault::new(line, problem).error(path, Unit::Line, &[])
}
