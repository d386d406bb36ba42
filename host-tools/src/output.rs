//! Output files that are whole or not there.
//!
//! A file is written beside its destination under a temporary name and renamed over it when complete. An error removes
//! it; so does Ctrl-C, once [`remove_on_interrupt`] is called.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use tempfile::{Builder, NamedTempFile};

/// Temporary files now open.
static OPEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file that comes into being all at once.
#[derive(Debug)]
pub struct AtomicFile {
    destination: PathBuf,
    file: BufWriter<NamedTempFile>,
    registration: Registration,
}

/// Keeps a temporary file in [`OPEN`].
#[derive(Debug)]
struct Registration(PathBuf);

impl Drop for Registration {
    fn drop(&mut self) {
        forget(&self.0);
    }
}

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", .path.display())]
pub struct WriteError {
    /// Where it should have gone.
    pub path: PathBuf,
    /// Why not.
    pub source: io::Error,
}

impl AtomicFile {
    /// Begins a file that will appear at `destination`, replacing what is there.
    ///
    /// # Errors
    /// If the directory does not exist or cannot be written.
    pub fn create(destination: &Path) -> Result<Self, WriteError> {
        let error = |source| WriteError {
            path: destination.to_owned(),
            source,
        };
        if destination.is_dir() {
            return Err(error(io::ErrorKind::IsADirectory.into()));
        }
        let directory = match destination.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        // Registered before it exists: an interrupt in between must not leave it behind.
        let file = Builder::new()
            .prefix(".proprio-")
            .suffix(".tmp")
            .make_in(directory, |path| {
                open_files().push(path.to_owned());
                File::create_new(path).inspect_err(|_| forget(path))
            })
            .map_err(error)?;
        let registration = Registration(file.path().to_owned());
        Ok(Self {
            destination: destination.to_owned(),
            file: BufWriter::new(file),
            registration,
        })
    }

    /// Makes the file appear.
    ///
    /// # Errors
    /// If the disk is full or the destination cannot be replaced.
    pub fn commit(self) -> Result<(), WriteError> {
        let Self {
            destination,
            file,
            registration: _until_renamed,
        } = self;
        let error = |source| WriteError {
            path: destination.clone(),
            source,
        };
        let file = file.into_inner().map_err(|e| error(e.into_error()))?;
        file.persist(&destination).map_err(|e| error(e.error))?;
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Writes `contents` to `path`, whole or not at all.
///
/// # Errors
/// As [`AtomicFile`]'s.
pub fn write(path: &Path, contents: &str) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(contents.as_bytes())
        .map_err(|source| WriteError {
            path: path.to_owned(),
            source,
        })?;
    file.commit()
}

/// Whether the first Ctrl-C asks a search to end with what it has, and whether it was pressed.
static FINISHES: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on the first Ctrl-C does not end the process: [`asked_to_finish`] says that it was pressed. A second one does.
pub fn finish_on_interrupt() {
    FINISHES.store(true, Ordering::Relaxed);
}

/// Whether Ctrl-C was pressed since [`finish_on_interrupt`].
pub fn asked_to_finish() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// From now on Ctrl-C, and a request to terminate, removes unfinished files and ends the process with status 130; after
/// [`finish_on_interrupt`] the second one does.
///
/// # Errors
/// If the handler cannot be installed.
pub fn remove_on_interrupt() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if FINISHES.load(Ordering::Relaxed) && !ASKED.swap(true, Ordering::Relaxed) {
            return;
        }
        // Held until the process has ended, so that no new file comes after the sweep.
        let open = open_files();
        for path in open.iter() {
            // It may be gone, or renamed, by now: both are fine.
            let _ = fs::remove_file(path);
        }
        std::process::exit(130);
    })
}

fn open_files() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    OPEN.lock().unwrap_or_else(PoisonError::into_inner)
}

fn forget(path: &Path) {
    open_files().retain(|open| open != path);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_when_committed_and_not_before() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out.json");
        let entries = || fs::read_dir(directory.path()).unwrap().count();

        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(entries(), 0);

        write(&path, "whole").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "whole");
        assert_eq!(entries(), 1);
        assert!(open_files().is_empty());
    }
}
