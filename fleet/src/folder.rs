//! The table: a folder. `blocks/SHA256.parquet` are the admitted blocks of each file that was added, by the file's content, so that adding it again
//! adds nothing; `quarantine/SHA256.json` says what of it was refused and why, and `quarantine/SHA256.parquet` holds the file as it came.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use proprio_host::fleet::{Block, Gate, TableError, read, write};
use proprio_host::output::{self, WriteError};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Most folders that lie in one another.
const MOST_DEPTH: usize = 16;

/// Why a table cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FolderError {
    /// A folder or file cannot be read.
    #[error("{}: {source}", .path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// There is no table.
    #[error("{}: no table; make one: proprio-fleet add DIR --to {}", .0.display(), .0.display())]
    NoTable(PathBuf),
    /// A file of the table cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The same, of blocks.
    #[error(transparent)]
    Blocks(#[from] TableError),
}

/// A table's folder.
pub(crate) struct Table(PathBuf);

/// What was refused, and why.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Refusal {
    file: String,
    kind: String,
    reason: String,
    fix: String,
}

/// What was added.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Added {
    files: usize,
    known: usize,
    rows: usize,
    late: usize,
    refused: usize,
    /// How many of each kind.
    kinds: BTreeMap<String, usize>,
}

/// What a table has.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Status {
    robots: usize,
    blocks: usize,
    rows: usize,
    files: usize,
    bytes: u64,
    first: f64,
    last: f64,
    refused: BTreeMap<String, usize>,
}

impl Table {
    /// In this folder.
    pub(crate) fn at(path: &Path) -> Self {
        Self(path.to_owned())
    }

    fn blocks(&self) -> PathBuf {
        self.0.join("blocks")
    }

    fn quarantine(&self) -> PathBuf {
        self.0.join("quarantine")
    }

    /// The files of admitted blocks, in the order of their names.
    ///
    /// # Errors
    /// [`FolderError`].
    pub(crate) fn files(&self) -> Result<Vec<PathBuf>, FolderError> {
        if !self.blocks().is_dir() {
            return Err(FolderError::NoTable(self.0.clone()));
        }
        files_in(&self.blocks(), "parquet", 1)
    }

    /// Adds the files of a folder, in the order of their names.
    ///
    /// # Errors
    /// [`FolderError`]; what was added before stays, whole.
    pub(crate) fn add(&self, from: &Path) -> Result<Added, FolderError> {
        for folder in [self.blocks(), self.quarantine()] {
            fs::create_dir_all(&folder).map_err(|source| FolderError::Read {
                path: folder,
                source,
            })?;
        }
        let mut gate = Gate::default();
        for file in self.files()? {
            for block in read(&file).blocks {
                // What is damaged where it lies is told by `report`.
                let _ = gate.admit(block);
            }
        }
        gate.late = 0;
        let mut added = Added::default();
        for file in files_in(from, "parquet", MOST_DEPTH)? {
            added.files += 1;
            self.add_file(&file, &mut gate, &mut added)?;
        }
        added.late = gate.late;
        Ok(added)
    }

    fn add_file(&self, file: &Path, gate: &mut Gate, added: &mut Added) -> Result<(), FolderError> {
        let unreadable = |source| FolderError::Read {
            path: file.to_owned(),
            source,
        };
        let bytes = fs::read(file).map_err(unreadable)?;
        let hash: String = Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        let blocks = self.blocks().join(format!("{hash}.parquet"));
        let reasons = self.quarantine().join(format!("{hash}.json"));
        if blocks.exists() {
            added.known += 1;
            return Ok(());
        }
        let table = read(file);
        let name = file.display().to_string();
        let mut refusals: Vec<Refusal> = table
            .faults
            .iter()
            .map(|fault| refusal(&name, fault))
            .collect();
        let mut admitted: Vec<Block> = Vec::new();
        for block in table.blocks {
            match gate.admit(block) {
                Ok(block) => admitted.push(block),
                Err(fault) => refusals.push(refusal(&name, &fault)),
            }
        }
        added.rows += admitted.len();
        added.refused += refusals.len();
        for one in &refusals {
            *added.kinds.entry(one.kind.clone()).or_default() += 1;
        }
        if !refusals.is_empty() {
            let copy = self.quarantine().join(format!("{hash}.parquet"));
            fs::write(&copy, &bytes).map_err(|source| FolderError::Read { path: copy, source })?;
        }
        if !refusals.is_empty() {
            let text = serde_json::to_string_pretty(&refusals).unwrap_or_default();
            output::write(&reasons, &text)?;
        }
        // Last, and also without rows: the file is then known. A run that is cut before does it again.
        Ok(write(&blocks, &admitted)?)
    }

    /// What was refused: file, kind, reason.
    ///
    /// # Errors
    /// [`FolderError`].
    pub(crate) fn refused(&self) -> Result<Vec<[String; 3]>, FolderError> {
        let mut all = Vec::new();
        for path in files_in(&self.quarantine(), "json", 1)? {
            let text =
                fs::read_to_string(&path).map_err(|source| FolderError::Read { path, source })?;
            let refusals: Vec<Refusal> = serde_json::from_str(&text).unwrap_or_default();
            all.extend(
                refusals
                    .into_iter()
                    .map(|one| [one.file, one.kind, format!("{}; {}", one.reason, one.fix)]),
            );
        }
        Ok(all)
    }

    /// What the table has.
    ///
    /// # Errors
    /// [`FolderError`].
    pub(crate) fn status(&self) -> Result<Status, FolderError> {
        let mut status = Status {
            first: f64::INFINITY,
            last: f64::NEG_INFINITY,
            ..Status::default()
        };
        let (mut robots, mut blocks) = (BTreeSet::new(), BTreeSet::new());
        for file in self.files()? {
            status.files += 1;
            status.bytes += fs::metadata(&file).map_or(0, |file| file.len());
            for block in read(&file).blocks {
                status.rows += 1;
                status.first = status.first.min(block.t0);
                status.last = status.last.max(block.t1);
                blocks.insert((block.log, block.t0.to_bits()));
                robots.insert(block.robot);
            }
        }
        (status.robots, status.blocks) = (robots.len(), blocks.len());
        for [_, kind, _] in self.refused()? {
            *status.refused.entry(kind).or_default() += 1;
        }
        Ok(status)
    }
}

fn refusal(file: &str, fault: &proprio_host::fleet::Fault) -> Refusal {
    Refusal {
        file: file.to_owned(),
        kind: fault.kind().to_owned(),
        reason: fault.to_string(),
        fix: fault.fix().to_owned(),
    }
}

/// The files of a folder, and of those in it, whose names end so; in the order of their paths.
fn files_in(folder: &Path, ending: &str, depth: usize) -> Result<Vec<PathBuf>, FolderError> {
    let failed = |source| FolderError::Read {
        path: folder.to_owned(),
        source,
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() && depth > 1 {
            found.extend(files_in(&path, ending, depth - 1)?);
        } else if path.is_file() && path.extension().is_some_and(|own| own == ending) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// A robot's name as a file's.
pub(crate) fn file_name(robot: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_".contains(c) {
            c
        } else {
            '_'
        }
    };
    robot.chars().map(plain).collect()
}

impl fmt::Display for Added {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            files,
            known,
            rows,
            late,
            refused,
            kinds,
        } = self;
        writeln!(
            f,
            "{files} files, {known} of them there already; {rows} rows added, {late} of them late; {refused} refused"
        )?;
        for (kind, count) in kinds {
            writeln!(f, "  {count} {kind}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            robots,
            blocks,
            rows,
            files,
            bytes,
            first,
            last,
            refused,
        } = self;
        writeln!(
            f,
            "{robots} robots, {blocks} blocks, {rows} rows in {files} files, {:.1} MB",
            1e-6 * *bytes as f64
        )?;
        if *rows > 0 {
            writeln!(f, "from {first:.0} s to {last:.0} s")?;
        }
        for (kind, count) in refused {
            writeln!(f, "refused: {count} {kind}")?;
        }
        Ok(())
    }
}
