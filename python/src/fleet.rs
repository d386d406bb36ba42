//! Blocks of many robots, as an engine that spreads the work passes them: `proprio/fleet.py` makes Arrow tables of the Parquet here.

use std::path::PathBuf;

use proprio_host::fleet::table::{Table, encode, read_bytes};
use proprio_host::fleet::{Block, Fault, admit_all, final_answers, partial, read};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// What a table that is no file is called in words.
const NAME: &str = "table";

/// Where blocks are: a file, or a table's Parquet.
#[derive(FromPyObject)]
pub(crate) enum Source {
    Memory(Vec<u8>),
    File(PathBuf),
}

impl Source {
    /// The blocks that are let in, in one order, and why the others are not.
    fn admitted(self) -> (Vec<Block>, Vec<String>) {
        let Table { blocks, faults } = match self {
            Self::Memory(bytes) => read_bytes(NAME, bytes),
            Self::File(path) => read(&path),
        };
        let (admitted, refused) = admit_all(blocks);
        let words = |fault: &Fault| format!("{}: {fault}; {}", fault.kind(), fault.fix());
        (admitted, faults.iter().chain(&refused).map(words).collect())
    }
}

fn parquet(blocks: &[Block]) -> PyResult<Vec<u8>> {
    encode(blocks).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// An empty table's Parquet: names and types of its columns.
#[pyfunction]
pub(crate) fn fleet_schema() -> PyResult<Vec<u8>> {
    parquet(&[])
}

/// The Parquet of the blocks that are let in, in one order, and why others are not.
#[pyfunction]
pub(crate) fn fleet_partial(py: Python<'_>, source: Source) -> PyResult<(Vec<u8>, Vec<String>)> {
    py.detach(|| {
        let (admitted, refused) = source.admitted();
        Ok((parquet(&admitted)?, refused))
    })
}

/// All answers as JSON, and why blocks are not among them.
#[pyfunction]
pub(crate) fn fleet_final(py: Python<'_>, source: Source) -> (String, Vec<String>) {
    py.detach(|| {
        let (admitted, refused) = source.admitted();
        (
            final_answers(partial(admitted)).object().to_string(),
            refused,
        )
    })
}
