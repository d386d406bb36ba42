//! All that came from a device, in a file.
//!
//! A line of text, `proprio messages 1 schema=…`, and entries after it: milliseconds since the beginning as a u64, the entry's
//! length as a u16, the entry in postcard. Numbers are little-endian. A file that was cut short keeps its whole entries. The schema
//! is the link's: what another one wrote is refused, not misread.

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use proprio_core::wire::{DeviceMessage, Request, SCHEMA};
use serde::{Deserialize, Serialize};

const TITLE: &str = "proprio messages 1 schema=";
/// Longest first line that is looked at.
const LINE: u64 = 128;

/// One thing that came, or that the device was asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)] // as long as most entries are
pub enum Entry {
    /// The device said this.
    Message(DeviceMessage),
    /// So many of its frames were damaged, so many never came, by now.
    Losses(u32, u32),
    /// The device was asked this.
    Request(Request),
}

/// Why a recording of messages cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Its name.
        path: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{0}: no recording of a device's messages")]
    NotMessages(String),
    /// The messages are of another schema.
    #[error("{path}: recorded under schema {theirs}, this program reads {ours}")]
    Schema {
        /// Its name.
        path: String,
        /// What the file says.
        theirs: String,
        /// What this program speaks.
        ours: String,
    },
}

fn schema() -> String {
    format!("{:016x}", u64::from_be_bytes(SCHEMA))
}

/// Writes entries; each is in the file once [`flush`](Self::flush)ed.
#[derive(Debug)]
pub struct JournalWriter(BufWriter<File>);

impl JournalWriter {
    /// Begins a file.
    ///
    /// # Errors
    /// The operating system's.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "{TITLE}{}", schema())?;
        Ok(Self(file))
    }

    /// Adds an entry of the time `at` since the beginning.
    ///
    /// # Errors
    /// The operating system's.
    pub fn write(&mut self, at: Duration, entry: &Entry) -> io::Result<()> {
        let content = postcard::to_allocvec(entry).map_err(io::Error::other)?;
        let length = u16::try_from(content.len()).map_err(io::Error::other)?;
        self.0.write_all(&(at.as_millis() as u64).to_le_bytes())?;
        self.0.write_all(&length.to_le_bytes())?;
        self.0.write_all(&content)
    }

    /// Puts what was written into the file.
    ///
    /// # Errors
    /// The operating system's.
    pub fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Reads entries.
#[derive(Debug)]
pub struct JournalReader {
    input: BufReader<File>,
    path: String,
}

impl JournalReader {
    /// Opens a file.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let name = path.display().to_string();
        let failed = |source| JournalError::Read {
            path: name.clone(),
            source,
        };
        let mut input = BufReader::new(File::open(path).map_err(failed)?);
        let mut line = Vec::new();
        let mut start = Read::by_ref(&mut input).take(LINE);
        start.read_until(b'\n', &mut line).map_err(failed)?;
        let line = String::from_utf8_lossy(&line);
        match line.trim_end().strip_prefix(TITLE) {
            None => Err(JournalError::NotMessages(name)),
            Some(theirs) if theirs != schema() => Err(JournalError::Schema {
                path: name,
                theirs: theirs.to_owned(),
                ours: schema(),
            }),
            Some(_) => Ok(Self { input, path: name }),
        }
    }

    /// The next whole entry and its time; none at the end, and from the first damage on.
    ///
    /// # Errors
    /// [`JournalError::Read`].
    pub fn next_entry(&mut self) -> Result<Option<(Duration, Entry)>, JournalError> {
        let mut head = [0; 10];
        if !self.fill(&mut head)? {
            return Ok(None);
        }
        let [time @ .., low, high] = head;
        let mut content = vec![0; usize::from(u16::from_le_bytes([low, high]))];
        if !self.fill(&mut content)? {
            return Ok(None);
        }
        let at = Duration::from_millis(u64::from_le_bytes(time));
        let entry = postcard::from_bytes(&content).ok();
        Ok(entry.map(|entry| (at, entry)))
    }

    fn fill(&mut self, buffer: &mut [u8]) -> Result<bool, JournalError> {
        match self.input.read_exact(buffer) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
            Err(source) => Err(JournalError::Read {
                path: self.path.clone(),
                source,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::wire::{Action, Change, ChangeKind};

    #[test]
    fn what_was_written_is_read_and_a_cut_file_keeps_its_whole_entries() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.messages");
        let entries = [
            Entry::Message(DeviceMessage::Change(Change {
                leg: 1,
                joint: 2,
                kind: ChangeKind::Load,
                size: 0.5,
                since_us: 58_000_000,
                time_us: 60_000_000,
            })),
            Entry::Losses(1, 2),
            Entry::Request(Request {
                id: 3,
                action: Action::Reset,
            }),
        ];
        let mut writer = JournalWriter::create(&path).unwrap();
        for (n, entry) in (0..).zip(&entries) {
            writer.write(Duration::from_millis(n), entry).unwrap();
        }
        writer.flush().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for cut in [0, 1, 5] {
            std::fs::write(&path, &bytes[..bytes.len() - cut]).unwrap();
            let mut reader = JournalReader::open(&path).unwrap();
            let mut read = Vec::new();
            while let Some((_, entry)) = reader.next_entry().unwrap() {
                read.push(entry);
            }
            assert_eq!(read, entries[..if cut == 0 { 3 } else { 2 }]);
        }
        let other = String::from_utf8_lossy(&bytes).replacen("schema=", "schema=0", 1);
        std::fs::write(&path, other).unwrap();
        let refused = JournalReader::open(&path).unwrap_err();
        assert!(
            matches!(refused, JournalError::Schema { .. }),
            "{refused:?}"
        );
    }
}
