//! Which logs a model's values come from: known by what is in them.

use std::collections::BTreeSet;
use std::io;
use std::path::Path;
use std::sync::OnceLock;

use sha2::{Digest, Sha256};

use super::source::memory;
use crate::model::{LogRecord, Provenance};

impl Provenance {
    /// This version, this process' command line, and these logs as they are now.
    ///
    /// # Errors
    /// The path of a log that cannot be read, and why.
    pub fn of(logs: &[impl AsRef<Path>]) -> Result<Self, (String, io::Error)> {
        let record = |log: &Path| {
            let path = log.display().to_string();
            match sha256(log) {
                Ok(sha256) => Ok(LogRecord { path, sha256 }),
                Err(error) => Err((path, error)),
            }
        };
        Ok(Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: command_line(),
            logs: logs
                .iter()
                .map(|log| record(log.as_ref()))
                .collect::<Result<_, _>>()?,
            only: Vec::new(),
        })
    }

    /// The same, where the logs are judged under conditions `only`.
    pub fn under(self, only: &[String]) -> Self {
        Self {
            only: only.to_vec(),
            ..self
        }
    }

    /// Whether these logs, as they are now, are all those that the values come from, whatever their names and order, and judged under the
    /// same conditions.
    ///
    /// # Errors
    /// The path of a log that cannot be read, and why.
    pub fn is_of(
        &self,
        logs: &[impl AsRef<Path>],
        only: &[String],
    ) -> Result<bool, (String, io::Error)> {
        let hashes = |logs: &[LogRecord]| -> BTreeSet<String> {
            logs.iter().map(|log| log.sha256.clone()).collect()
        };
        let now = Self::of(logs)?.logs;
        Ok(!now.is_empty() && self.only == only && hashes(&self.logs) == hashes(&now))
    }
}

/// What runs in this process, where it is not the program's own command line.
static COMMAND_LINE: OnceLock<String> = OnceLock::new();

/// States what runs in this process, for the files and pages that it writes; the first call counts. A process that is not the program
/// `proprio` has arguments of its own.
pub fn set_command_line(words: String) {
    COMMAND_LINE.get_or_init(|| words);
}

/// The command line that files and pages name.
fn command_line() -> String {
    // The program's path differs between machines and says nothing.
    let own = || {
        let arguments = std::env::args_os().skip(1);
        let words = arguments.map(|word| word.to_string_lossy().into_owned());
        let all: Vec<_> = std::iter::once("proprio".to_owned()).chain(words).collect();
        all.join(" ")
    };
    COMMAND_LINE.get().cloned().unwrap_or_else(own)
}

/// SHA-256 of a log's bytes, in hexadecimal: of a file, of a log in memory, of standard input (`-`), of a folder's files one after the other.
///
/// # Errors
/// If the file cannot be read.
pub fn sha256(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut files = super::files(path)?;
    if memory::write_bytes(path, &mut HashWriter(&mut hash))? {
        files.clear();
    }
    for file in files {
        io::copy(
            &mut super::open_bytes(&file)?.file,
            &mut HashWriter(&mut hash),
        )?;
    }
    let digest = hash.finalize();
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Feeds what is written to a hash.
struct HashWriter<'a>(&'a mut Sha256);

impl io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_are_known_by_what_is_in_them() {
        let folder = tempfile::tempdir().unwrap();
        let log = |name: &str, bytes: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let [a, b, copy] = [log("a", "1"), log("b", "2"), log("copy", "1")];
        let of_both = Provenance::of(&[&a, &b]).unwrap();
        assert!(of_both.is_of(&[&b, &copy], &[]).unwrap());
        assert!(!of_both.is_of(&[&a], &[]).unwrap());
        let part = ["t < 60".to_owned()];
        assert!(!of_both.is_of(&[&a, &b], &part).unwrap());
        assert!(
            of_both
                .clone()
                .under(&part)
                .is_of(&[&a, &b], &part)
                .unwrap()
        );
        log("b", "3");
        assert!(!of_both.is_of(&[&a, &b], &[]).unwrap());
        assert!(of_both.is_of(&[folder.path().join("none")], &[]).is_err());
    }

    #[test]
    fn the_hash_is_the_standards() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "abc").unwrap();
        // FIPS 180-4, example of one block.
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(file.path()).unwrap(), known);
    }
}
