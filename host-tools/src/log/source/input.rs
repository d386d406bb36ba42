//! Bytes: of a file, of a folder's files, or of standard input.

use std::fs::{self, File};
use std::io::{self, IsTerminal, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use tempfile::NamedTempFile;

/// So many bytes tell what a file is.
const START: usize = 4096;

/// Standard input, kept: a command may go over a log more than once.
static STDIN: Mutex<Option<NamedTempFile>> = Mutex::new(None);

/// A file that has been opened and looked at.
pub(crate) struct Input {
    /// At its beginning.
    pub(crate) file: File,
    /// Length, bytes.
    pub(crate) size: u64,
    start: Vec<u8>,
}

impl Input {
    /// Its first bytes.
    pub(super) fn start(&self) -> &[u8] {
        &self.start
    }
}

/// Opens a file, or standard input for `-`.
pub(crate) fn open(path: &Path) -> io::Result<Input> {
    let mut file = if path == Path::new("-") {
        stdin()?
    } else {
        File::open(path)?
    };
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let mut start = Vec::with_capacity(START);
    (&mut file).take(START as u64).read_to_end(&mut start)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(Input {
        file,
        size: metadata.len(),
        start,
    })
}

/// Where a file's bytes lie: its path, or that of what was kept of standard input.
#[cfg(feature = "db3")]
pub(super) fn path(path: &Path) -> io::Result<PathBuf> {
    if path != Path::new("-") {
        return Ok(path.to_owned());
    }
    stdin()?;
    let kept = STDIN.lock().unwrap_or_else(|e| e.into_inner());
    let kept = kept.as_ref().ok_or(io::ErrorKind::NotFound)?;
    Ok(kept.path().to_owned())
}

/// All of standard input, as a file that can be read again.
fn stdin() -> io::Result<File> {
    let mut kept = STDIN.lock().unwrap_or_else(|e| e.into_inner());
    if let Some(file) = &*kept {
        return file.reopen();
    }
    if io::stdin().is_terminal() {
        let message = "nothing is piped into the command";
        return Err(io::Error::new(io::ErrorKind::NotFound, message));
    }
    let mut file = NamedTempFile::new()?;
    io::copy(&mut io::stdin().lock(), &mut file)?;
    kept.insert(file).reopen()
}

/// The files that a log consists of: itself, or those of the recording that a folder holds (a rosbag2 or a LeRobot data
/// set), in the order in which they were recorded.
///
/// # Errors
/// If the folder cannot be read or holds no recording.
pub fn files(path: &Path) -> io::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let own = with_extension(path, &["mcap", "db3"])?;
    if !own.is_empty() {
        return Ok(own);
    }
    let mut found = Vec::new();
    let data = path.join("data");
    if data.is_dir() {
        let mut chunks: Vec<PathBuf> = entries(&data)?;
        chunks.retain(|chunk| chunk.is_dir());
        chunks.sort();
        for chunk in chunks {
            found.extend(with_extension(&chunk, &["parquet"])?);
        }
    }
    if found.is_empty() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    Ok(found)
}

fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?;
    entries.map(|entry| Ok(entry?.path())).collect()
}

/// A folder's files with one of these extensions, in the order of the numbers in their names.
fn with_extension(folder: &Path, extensions: &[&str]) -> io::Result<Vec<PathBuf>> {
    let mut found = entries(folder)?;
    found.retain(|file| {
        let extension = file.extension().and_then(|e| e.to_str());
        file.is_file() && extension.is_some_and(|e| extensions.contains(&e))
    });
    // rosbag2 counts without leading zeros: `bag_2` comes before `bag_10`.
    found.sort_by_key(|file| {
        let name = file.to_string_lossy().into_owned();
        (name.len(), name)
    });
    Ok(found)
}
