//! Output files that are whole or not there.
//!
//! A file is written beside its destination under a temporary name and renamed over it when complete. An error removes
//! it; so does Ctrl-C, once [`remove_on_interrupt`] is called. A symbolic link stays one: what it points to is replaced. What is no
//! regular file (a device, a FIFO, an open descriptor such as /dev/stdout) has no whole: it receives bytes as they come.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use tempfile::{Builder, NamedTempFile};

/// Temporary files now open.
static OPEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file that comes into being all at once, or a stream that is no regular file.
#[derive(Debug)]
pub struct AtomicFile {
    destination: PathBuf,
    sink: Sink,
}

#[derive(Debug)]
enum Sink {
    /// A file under a temporary name, which becomes `target`: the destination behind its links.
    Replacement {
        target: PathBuf,
        file: BufWriter<NamedTempFile>,
        registration: Registration,
    },
    /// A device, a FIFO or an open descriptor.
    Stream(BufWriter<File>),
}

/// What bytes for a path meet.
enum Meets {
    /// No file, or a regular file: it is made, or replaced, at this path, which is no link.
    File(PathBuf),
    /// What cannot be replaced, only written to.
    Stream(PathBuf),
}

/// Keeps a temporary file in [`OPEN`].
#[derive(Debug)]
struct Registration(PathBuf);

impl Drop for Registration {
    fn drop(&mut self) {
        forget(&self.0);
    }
}

/// A format whose writer was left out of this build, for a [`WriteError`].
#[cfg(not(all(feature = "mcap", feature = "parquet")))]
pub(crate) fn not_built(format: &str, feature: &str) -> io::Error {
    let words = format!("this build has no {format}; build it with `--features {feature}`");
    io::Error::new(io::ErrorKind::Unsupported, words)
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
    /// Begins a file that will appear at `destination`, replacing what is there; a FIFO is opened once it has a reader.
    ///
    /// # Errors
    /// If the directory does not exist or cannot be written, or what is there may not be.
    pub fn create(destination: &Path) -> Result<Self, WriteError> {
        let error = |source| WriteError {
            path: destination.to_owned(),
            source,
        };
        if destination.is_dir() {
            return Err(error(io::ErrorKind::IsADirectory.into()));
        }
        let sink = match meets(destination).map_err(error)? {
            Meets::Stream(path) => Sink::Stream(BufWriter::new(open_stream(&path).map_err(error)?)),
            Meets::File(target) => replacement(target).map_err(error)?,
        };
        Ok(Self {
            destination: destination.to_owned(),
            sink,
        })
    }

    /// Makes the file appear.
    ///
    /// # Errors
    /// If the disk is full or the destination cannot be replaced.
    pub fn commit(self) -> Result<(), WriteError> {
        let Self { destination, sink } = self;
        let error = |source| WriteError {
            path: destination.clone(),
            source,
        };
        match sink {
            Sink::Stream(mut stream) => stream.flush().map_err(error),
            Sink::Replacement {
                target,
                file,
                registration: _until_renamed,
            } => {
                let file = file.into_inner().map_err(|e| error(e.into_error()))?;
                file.persist(&target).map_err(|e| error(e.error))?;
                Ok(())
            }
        }
    }
}

/// Whether bytes for `path` go to what is no regular file: nothing is replaced there, and no file lies beside it.
pub fn is_stream(path: &Path) -> bool {
    matches!(meets(path), Ok(Meets::Stream(_)))
}

/// Follows the links of `path` as far as a file's own name, or an open descriptor.
///
/// # Errors
/// The operating system's: links in a circle, a folder that may not be entered.
fn meets(path: &Path) -> io::Result<Meets> {
    let is_file = match fs::metadata(path) {
        Ok(there) => there.is_file(),
        // A new file, perhaps at the end of a link.
        Err(error) if error.kind() == io::ErrorKind::NotFound => true,
        Err(error) => return Err(error),
    };
    let mut path = path.to_owned();
    loop {
        // Even of a file: its reader holds it open and would not see another one under its name.
        if is_descriptor(&path) {
            return Ok(Meets::Stream(path));
        }
        match fs::read_link(&path) {
            // A target is relative to its link's folder.
            Ok(target) => path = folder(&path).join(target),
            Err(_) if is_file => return Ok(Meets::File(path)),
            Err(_) => return Ok(Meets::Stream(path)),
        }
    }
}

/// Whether `path` names a descriptor that this process holds open: /dev/stdout does by way of /proc/self/fd/1.
fn is_descriptor(path: &Path) -> bool {
    let folder = folder(path).canonicalize();
    let is = |known: &str| matches!((&folder, Path::new(known).canonicalize()), (Ok(a), Ok(b)) if *a == b);
    descriptor(path).is_some() && (is("/proc/self/fd") || is("/dev/fd"))
}

/// The number that `path` ends in.
fn descriptor(path: &Path) -> Option<u32> {
    path.file_name()?.to_str()?.parse().ok()
}

/// Opens what is no regular file to be written.
fn open_stream(path: &Path) -> io::Result<File> {
    // The process's own streams share their place in a file with what the command prints.
    #[cfg(unix)]
    if is_descriptor(path) {
        use std::os::fd::AsFd;
        match descriptor(path) {
            Some(1) => return Ok(io::stdout().as_fd().try_clone_to_owned()?.into()),
            Some(2) => return Ok(io::stderr().as_fd().try_clone_to_owned()?.into()),
            _ => {}
        }
    }
    OpenOptions::new().append(true).open(path)
}

/// Begins the file that will replace `target`.
fn replacement(target: PathBuf) -> io::Result<Sink> {
    // A file that may not be written is not replaced either, though its folder would allow it.
    let replaced = match OpenOptions::new().write(true).open(&target) {
        Ok(file) => Some(file.metadata()?),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    // Registered before it exists: an interrupt in between must not leave it behind.
    let file =
        Builder::new()
            .prefix(".proprio-")
            .suffix(".tmp")
            .make_in(folder(&target), |path| {
                open_files().push(path.to_owned());
                File::create_new(path).inspect_err(|_| forget(path))
            })?;
    let registration = Registration(file.path().to_owned());
    if let Some(replaced) = replaced {
        keep_owner(file.path(), &replaced);
        fs::set_permissions(file.path(), replaced.permissions())?;
    }
    Ok(Sink::Replacement {
        target,
        file: BufWriter::new(file),
        registration,
    })
}

/// Gives the file at `path` the owner and group of the one that it replaces, as far as this user may.
#[cfg(unix)]
fn keep_owner(path: &Path, replaced: &fs::Metadata) {
    use std::os::unix::fs::{MetadataExt, chown};
    // Only root gives files away; whoever may not has a file that he can write at least.
    let _ = chown(path, None, Some(replaced.gid()));
    let _ = chown(path, Some(replaced.uid()), None);
}

#[cfg(not(unix))]
fn keep_owner(_: &Path, _: &fs::Metadata) {}

/// The folder that `path` lies in.
fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.sink {
            Sink::Replacement { file, .. } => file.write(bytes),
            Sink::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.sink {
            Sink::Replacement { file, .. } => file.flush(),
            Sink::Stream(stream) => stream.flush(),
        }
    }
}

/// Writes `contents` to `path`: a file whole or not at all.
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

/// How long a search may go on after a request to terminate: with the motion written after it, less than the second that whoever asks waits.
#[cfg(unix)]
const GRACE: std::time::Duration = std::time::Duration::from_millis(700);

/// As [`finish_on_interrupt`], for a search that may have nothing to keep yet: a request to terminate (SIGTERM) ends the process after
/// 0.7 s even so, and no file stays. Ctrl-C is by hand, and may be pressed twice.
pub fn finish_search_on_interrupt() {
    finish_on_interrupt();
    #[cfg(unix)]
    if let Ok(mut signals) = signal_hook::iterator::Signals::new([signal_hook::consts::SIGTERM]) {
        std::thread::spawn(move || {
            if signals.forever().next().is_some() {
                std::thread::sleep(GRACE);
                end();
            }
        });
    }
}

/// A search is over: from now on Ctrl-C ends the process again, for what is half written is of no use.
pub fn end_on_interrupt() {
    FINISHES.store(false, Ordering::Relaxed);
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
    let installed = ctrlc::set_handler(|| {
        if FINISHES.load(Ordering::Relaxed) && !ASKED.swap(true, Ordering::Relaxed) {
            return;
        }
        end();
    });
    match installed {
        // A process that runs several commands has it already.
        Err(ctrlc::Error::MultipleHandlers) => Ok(()),
        installed => installed,
    }
}

/// Removes unfinished files and ends the process.
fn end() -> ! {
    // Held until the process has ended, so that no new file comes after the sweep.
    let open = open_files();
    for path in open.iter() {
        // It may be gone, or renamed, by now: both are fine.
        let _ = fs::remove_file(path);
    }
    std::process::exit(130);
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
    /// Links of every kind, and what is at their ends.
    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_it_points_to_is_replaced() {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
        let directory = tempfile::tempdir().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::create_dir(path("far")).unwrap();
        fs::write(path("far/there"), "old").unwrap();
        fs::set_permissions(path("far/there"), fs::Permissions::from_mode(0o640)).unwrap();
        symlink("there", path("far/relative")).unwrap();
        symlink("new", path("far/dangling")).unwrap();
        let table = [
            ("link", "far/there", "far/there"),
            ("twice", "far/relative", "far/there"),
            ("new", "far/dangling", "far/new"),
        ];
        for (link, to, end) in table {
            symlink(to, path(link)).unwrap();
            let mut file = AtomicFile::create(&path(link)).unwrap();
            file.write_all(link.as_bytes()).unwrap();
            // Its temporary file lies where it can be renamed: in the folder of the end.
            let temporary = fs::read_dir(path("far"))
                .unwrap()
                .filter(|entry| entry.as_ref().unwrap().path().extension() == Some("tmp".as_ref()));
            assert_eq!(temporary.count(), 1, "{link}");
            file.commit().unwrap();
            assert_eq!(fs::read_link(path(link)).unwrap(), Path::new(to));
            assert_eq!(fs::read_to_string(path(end)).unwrap(), link);
        }
        assert_eq!(
            fs::metadata(path("far/there")).unwrap().mode() & 0o777,
            0o640
        );

        symlink("circle", path("circle")).unwrap();
        assert!(write(&path("circle"), "").is_err());
        symlink("no/such/file", path("nowhere")).unwrap();
        assert!(write(&path("nowhere"), "").is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_and_descriptors_are_streams() {
        use std::os::unix::fs::FileTypeExt;
        let directory = tempfile::tempdir().unwrap();
        let link = directory.path().join("link");
        std::os::unix::fs::symlink("/dev/null", &link).unwrap();
        for path in [Path::new("/dev/null"), &link] {
            assert!(is_stream(path));
            write(path, "lost").unwrap();
            assert!(fs::metadata(path).unwrap().file_type().is_char_device());
        }
        // A regular file that is open: by descriptor it is written to, by name it is replaced.
        let open = File::create(directory.path().join("open")).unwrap();
        let by_descriptor = PathBuf::from(format!(
            "/dev/fd/{}",
            std::os::fd::AsRawFd::as_raw_fd(&open)
        ));
        assert!(is_stream(&by_descriptor));
        assert!(!is_stream(&directory.path().join("open")));
        write(&by_descriptor, "one ").unwrap();
        write(&by_descriptor, "two").unwrap();
        assert_eq!(
            fs::read_to_string(directory.path().join("open")).unwrap(),
            "one two"
        );
        assert!(!is_stream(&directory.path().join("1")));
    }
}
