//! Tables of blocks in files: Parquet, schema `proprio.blocks/1`. `parquet`, beside, is the format; a build without it says so.

#[cfg(feature = "parquet")]
mod parquet;

use std::collections::BTreeSet;
use std::path::Path;

use super::block::Block;
use super::gate::Fault;
use crate::output::WriteError;

#[cfg(all(feature = "parquet", test))]
pub(super) use parquet::MESSAGE;
#[cfg(feature = "parquet")]
pub use parquet::{encode, read_from};

/// Name of the schema, in the file's metadata under `schema`.
pub const SCHEMA: &str = "proprio.blocks/1";

/// Why a table cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be written, or this build has no Parquet.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The format's own writer failed.
    #[error("{path}: {problem}")]
    Format {
        /// The file.
        path: String,
        /// Why.
        problem: String,
    },
}

/// What was read of a file: its blocks, and what is wrong with the others.
#[derive(Debug, Default)]
pub struct Table {
    /// Blocks as they stand there, not yet admitted by a [`super::Gate`].
    pub blocks: Vec<Block>,
    /// Parts that cannot be read.
    pub faults: Vec<Fault>,
}

impl Table {
    fn none(fault: Fault) -> Self {
        Self {
            blocks: Vec::new(),
            faults: vec![fault],
        }
    }

    /// A file that cannot be read at all, and why.
    fn unreadable(path: &Path, cause: impl ToString) -> Self {
        Self::none(Fault::Unreadable {
            file: path.display().to_string(),
            cause: cause.to_string(),
        })
    }
}

/// Writes blocks, whole or not at all.
///
/// # Errors
/// [`TableError`].
#[cfg(feature = "parquet")]
pub fn write(path: &Path, blocks: &[Block]) -> Result<(), TableError> {
    use std::io::Write;

    let bytes = encode(blocks).map_err(|error| TableError::Format {
        path: path.display().to_string(),
        problem: error.to_string(),
    })?;
    let mut file = crate::output::AtomicFile::create(path)?;
    file.write_all(&bytes).map_err(|source| WriteError {
        path: path.to_owned(),
        source,
    })?;
    Ok(file.commit()?)
}

/// Writes nothing.
///
/// # Errors
/// Always: this build has no Parquet.
#[cfg(not(feature = "parquet"))]
pub fn write(path: &Path, _: &[Block]) -> Result<(), TableError> {
    Err(TableError::Write(WriteError {
        path: path.to_owned(),
        source: crate::output::not_built("Parquet", "parquet"),
    }))
}

/// Reads a file; what of it cannot be read is a fault, and the rest stands.
#[cfg(feature = "parquet")]
pub fn read(path: &Path) -> Table {
    match std::fs::File::open(path) {
        Ok(file) => read_from(&path.display().to_string(), file),
        Err(error) => Table::unreadable(path, error),
    }
}

/// The robots of which a file has blocks, without the blocks; none of what cannot be read.
#[cfg(feature = "parquet")]
pub fn robots_in(path: &Path) -> BTreeSet<String> {
    std::fs::File::open(path).map_or_else(|_| BTreeSet::new(), parquet::robots_from)
}

/// Of no robot: this build has no Parquet.
#[cfg(not(feature = "parquet"))]
pub fn robots_in(_: &Path) -> BTreeSet<String> {
    BTreeSet::new()
}

/// Reads a table in memory, named so.
#[cfg(feature = "parquet")]
pub fn read_bytes(name: &str, bytes: Vec<u8>) -> Table {
    read_from(name, bytes::Bytes::from(bytes))
}

/// Reads nothing: the fault is that this build has no Parquet.
#[cfg(not(feature = "parquet"))]
pub fn read(path: &Path) -> Table {
    Table::unreadable(path, crate::output::not_built("Parquet", "parquet"))
}

/// Whether a file is a table of blocks.
pub fn is_ours(path: &Path) -> bool {
    let table = read(path);
    table.faults.is_empty() && !table.blocks.is_empty()
}
