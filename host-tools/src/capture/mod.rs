//! Raw bytes of a motor bus in a file, each with the time at which it came, and what they say.
//!
//! A capture is a line of text, `proprio capture 1 baud=4000000`, and records after it. The line may go on with what is known of the bus
//! ([`Facts`]): `leg=FR`; `positions=angles`, of a simulator; `at=0.1,0.8,-1.5`, where hip, thigh and calf were as it began, rad, with `r` behind
//! the number if the motor turns against the joint. A record is: the time at which the record's last
//! byte came, µs since the capture began, as a u64; how many bytes it has, as a u16 that is not 0; the bytes. Numbers are
//! little-endian. A record is what the bus brought without a pause, as far as the adapter tells; within it the bytes followed
//! each other at the rate of the line, 8N1. A file that was cut short keeps its whole records.
//!
//! Files beside:
//!
//! - `facts`: what is known of a bus that is not on it: which leg, where its joints were
//! - `explain`: what a capture says of the bus: by the device's own listener, and what only a desktop has room for
//! - `shapes`: frames by header and length, whatever their checksum
//! - `stamps`: whether the records' times are those of their frames
//! - `checksums`: senders whose frames are whole and fail only by their checksum

mod checksums;
mod explain;
mod facts;
mod shapes;
mod stamps;
#[cfg(test)]
mod tests;

pub use explain::{Explanation, MotorExplanation, OtherChecksum, Turnaround, explain};
pub use facts::{Facts, Told};
pub use stamps::Grouped;
pub(crate) use stamps::{SET_LATENCY_TIMER, Stamps};

use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Instant;

/// How late an adapter may say that bytes came, µs: the latency timer of a USB adapter, which is to be set to 1 ms.
pub(crate) const LATE_US: u64 = 1_500;

/// What a capture begins with.
pub const TITLE: &str = "proprio capture ";
/// The version of the format.
const VERSION: u32 = 1;
/// Longest first line that is looked at.
const HEADER_LENGTH: u64 = 256;

/// Why a capture cannot be made or read.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Its name.
        path: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// The first line is no capture's.
    #[error("{0}: no capture of a motor bus")]
    NotACapture(String),
    /// The capture is of another version.
    #[error("{path}: a capture of version {version}; this program reads version {VERSION}")]
    Version {
        /// Its name.
        path: String,
        /// What the first line says.
        version: u32,
    },
    /// The port stopped working.
    #[error("the port: {0}")]
    Port(io::Error),
    /// The capture cannot be written.
    #[error("the capture cannot be written: {0}")]
    Write(io::Error),
}

/// Bytes that came without a pause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// When the last of them came, µs since the capture began.
    pub time_us: u64,
    /// The bytes, one at least.
    pub bytes: Vec<u8>,
}

/// Writes a capture.
pub struct CaptureWriter<W>(W);

impl<W: Write> CaptureWriter<W> {
    /// Begins a capture of a bus of this baud rate.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, baud: u32) -> io::Result<Self> {
        Self::of(out, baud, &Facts::default())
    }

    /// The same of a bus of which something is known.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn of(mut out: W, baud: u32, facts: &Facts) -> io::Result<Self> {
        writeln!(out, "{TITLE}{VERSION} baud={baud}{facts}")?;
        Ok(Self(out))
    }

    /// Goes on with a capture whose first line `out` has.
    pub(crate) fn resume(out: W) -> Self {
        Self(out)
    }

    /// Adds bytes of which the last came at `time_us`.
    ///
    /// # Errors
    /// Those of the file.
    pub fn record(&mut self, time_us: u64, bytes: &[u8]) -> io::Result<()> {
        for part in bytes.chunks(usize::from(u16::MAX)) {
            let length = (part.len() as u16).to_le_bytes();
            // At once: whoever reads what is still being made finds whole records.
            self.0
                .write_all(&[&time_us.to_le_bytes(), &length[..], part].concat())?;
        }
        Ok(())
    }

    /// Ends the capture.
    ///
    /// # Errors
    /// Those of the file.
    pub fn finish(mut self) -> io::Result<W> {
        self.0.flush()?;
        Ok(self.0)
    }
}

/// Reads a capture, record by record.
pub struct CaptureReader<R> {
    input: BufReader<R>,
    path: String,
    baud: u32,
    facts: Facts,
}

impl CaptureReader<std::fs::File> {
    /// Opens a capture.
    ///
    /// # Errors
    /// [`CaptureError`].
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let name = path.display().to_string();
        match std::fs::File::open(path) {
            Ok(file) => Self::new(file, name),
            Err(source) => Err(CaptureError::Read { path: name, source }),
        }
    }
}

impl<R: Read> CaptureReader<R> {
    /// Reads the first line of what is called `path`.
    ///
    /// # Errors
    /// [`CaptureError`].
    pub fn new(input: R, path: String) -> Result<Self, CaptureError> {
        let mut input = BufReader::new(input);
        let mut line = Vec::new();
        let read = input
            .by_ref()
            .take(HEADER_LENGTH)
            .read_until(b'\n', &mut line);
        if let Err(source) = read {
            return Err(CaptureError::Read { path, source });
        }
        let line = String::from_utf8_lossy(&line);
        let rest = line
            .strip_prefix(TITLE)
            .and_then(|rest| rest.strip_suffix('\n'));
        let fields = rest.and_then(|rest| rest.split_once(" baud="));
        let numbers = fields.and_then(|(version, rest)| {
            let (baud, facts) = rest.split_once(' ').unwrap_or((rest, ""));
            Some((
                version.parse().ok()?,
                baud.parse().ok()?,
                facts.parse().ok()?,
            ))
        });
        match numbers {
            Some((VERSION, baud, facts)) if baud > 0 => Ok(Self {
                input,
                path,
                baud,
                facts,
            }),
            Some((version, ..)) if version != VERSION => {
                Err(CaptureError::Version { path, version })
            }
            _ => Err(CaptureError::NotACapture(path)),
        }
    }

    /// Bits per second on the line.
    pub fn baud(&self) -> u32 {
        self.baud
    }

    /// What is known of the bus that is not on it.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Time of a byte on the line, ns: eight data bits between a start and a stop bit.
    pub fn byte_ns(&self) -> u32 {
        (10_000_000_000 / u64::from(self.baud)).min(u32::MAX.into()) as u32
    }

    /// The next whole record; `None` at the end, and where the file was cut.
    ///
    /// # Errors
    /// [`CaptureError::Read`].
    pub fn next_record(&mut self) -> Result<Option<Record>, CaptureError> {
        let mut head = [0; 10];
        if !self.fill(&mut head)? {
            return Ok(None);
        }
        let [time @ .., low, high] = head;
        let mut bytes = vec![0; usize::from(u16::from_le_bytes([low, high]))];
        let whole = self.fill(&mut bytes)?;
        let time_us = u64::from_le_bytes(time);
        Ok(whole.then_some(Record { time_us, bytes }))
    }

    /// Fills `buffer`; false where the file ends before.
    fn fill(&mut self, buffer: &mut [u8]) -> Result<bool, CaptureError> {
        match self.input.read_exact(buffer) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
            Err(source) => Err(CaptureError::Read {
                path: self.path.clone(),
                source,
            }),
        }
    }
}

/// What a capture holds by now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Captured {
    /// Bytes.
    pub bytes: u64,
    /// Records.
    pub records: u64,
    /// Time since the capture began, µs.
    pub time_us: u64,
}

/// Records what `port`, whose reads time out, brings until `goes_on` says no; it is asked after each read. Times count from `start`, which the
/// captures of several buses share.
///
/// # Errors
/// [`CaptureError::Port`], [`CaptureError::Write`].
pub fn record<W: Write>(
    port: &mut impl Read,
    capture: &mut CaptureWriter<W>,
    start: Instant,
    mut goes_on: impl FnMut(&Captured) -> bool,
) -> Result<Captured, CaptureError> {
    let mut captured = Captured::default();
    let mut buffer = [0; 4096];
    while goes_on(&captured) {
        let read = port.read(&mut buffer);
        captured.time_us = start.elapsed().as_micros() as u64;
        let length = match read {
            Ok(0) => return Err(CaptureError::Port(ErrorKind::UnexpectedEof.into())),
            Ok(length) => length,
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => continue,
                _ => return Err(CaptureError::Port(error)),
            },
        };
        let bytes = buffer.get(..length).unwrap_or_default();
        capture
            .record(captured.time_us, bytes)
            .map_err(CaptureError::Write)?;
        captured.bytes += length as u64;
        captured.records += 1;
    }
    Ok(captured)
}
