//! A log, of files or arrays.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::arrays::Numbers;
use crate::model::{Model, or_go2};
use crate::work;

/// What was recorded of a robot, from files or arrays; SI units, joint side.
///
/// `Log("chirp.csv")`, `Log("a.mcap", "b.csv")`: files of any format that the command reads, together.
/// `Log(frame)`: a pandas or Polars DataFrame, an Arrow table or a dictionary with columns `t`, `q/<joint>`, `dq/<joint>`, `tau/<joint>`.
/// `Log(t=t, q=q, dq=dq, tau=tau, joints=["FR_hip", ...])`: arrays of shape (samples,) and (samples, joints); `temp` and `q_des` are optional.
#[pyclass(module = "proprio", frozen)]
pub(crate) struct Log(pub(crate) Arc<Source>);

/// Where the samples are, and the last reading of them.
pub(crate) struct Source {
    paths: Vec<PathBuf>,
    /// What of it lies in memory, for as long as the log is used.
    _memory: Vec<proprio::MemoryLog>,
    read: Mutex<Option<(proprio::Model, Arc<proprio::Recording>)>>,
}

impl Source {
    /// The samples of `model`'s joints; read once for the same model.
    pub(crate) fn recording(
        &self,
        model: &proprio::Model,
    ) -> Result<Arc<proprio::Recording>, proprio::Error> {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, recording)) = &*read
            && of == model
        {
            return Ok(Arc::clone(recording));
        }
        let recording = Arc::new(proprio::read(&self.paths, model)?);
        *read = Some((model.clone(), Arc::clone(&recording)));
        Ok(recording)
    }

    pub(crate) fn name(&self) -> String {
        let names = self.paths.iter().map(|path| path.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }
}

type Column = (String, Vec<usize>, Vec<f64>);

#[pymethods]
impl Log {
    #[new]
    #[pyo3(signature = (*sources, joints = vec![], name = "log", **arrays))]
    fn new(
        sources: &Bound<'_, PyTuple>,
        joints: Vec<String>,
        name: &str,
        arrays: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        // Pages and model files say what made them.
        proprio_host::log::set_command_line("import proprio".to_owned());
        let (mut paths, mut memory) = (Vec::new(), Vec::new());
        for source in sources {
            match path(&source) {
                Some(path) => paths.push(path),
                None => memory.push(proprio::MemoryLog::new(name, table(&source)?, &joints)),
            }
        }
        if let Some(arrays) = arrays {
            let column = |(name, array): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
                column(name.extract()?, &array)
            };
            let present = arrays.iter().filter(|(_, array)| !array.is_none());
            let columns = present.map(column).collect::<PyResult<Vec<Column>>>()?;
            memory.push(proprio::MemoryLog::new(name, columns, &joints));
        }
        paths.extend(memory.iter().map(|log| log.as_ref().to_owned()));
        if paths.is_empty() {
            return Err(PyValueError::new_err(
                "a log is of files, a table, or arrays: Log('chirp.csv'), Log(frame), Log(t=t, q=q, dq=dq, tau=tau, joints=[...])",
            ));
        }
        Ok(Self(Arc::new(Source {
            paths,
            _memory: memory,
            read: Mutex::new(None),
        })))
    }

    /// What is wrong with the samples, a sentence each: jitter, gaps, repeats, saturation, velocities that positions contradict.
    #[pyo3(signature = (model = None))]
    fn findings(&self, py: Python<'_>, model: Option<&Model>) -> PyResult<Vec<String>> {
        let (source, model) = (Arc::clone(&self.0), or_go2(model));
        work::run(py, move |_| {
            Ok(source.recording(&model)?.findings().to_vec())
        })
    }

    /// Length of all logs together, s.
    #[pyo3(signature = (model = None))]
    fn duration(&self, py: Python<'_>, model: Option<&Model>) -> PyResult<f64> {
        let (source, model) = (Arc::clone(&self.0), or_go2(model));
        work::run(py, move |_| Ok(source.recording(&model)?.duration()))
    }

    fn __repr__(&self) -> String {
        format!("<proprio.Log {}>", self.0.name())
    }
}

/// The file that is meant, if one is.
fn path(source: &Bound<'_, PyAny>) -> Option<PathBuf> {
    source.extract::<PathBuf>().ok()
}

/// A table's columns: a dictionary's, or those of a data frame or an Arrow table.
fn table(source: &Bound<'_, PyAny>) -> PyResult<Vec<Column>> {
    let names = if let Ok(dictionary) = source.cast::<PyDict>() {
        dictionary.keys().into_any()
    } else if let Ok(names) = source.getattr("column_names") {
        names
    } else if let Ok(names) = source.getattr("columns") {
        names
    } else {
        let kind = source.get_type();
        let text = format!("a log is a path, a dictionary or a data frame, not {kind}");
        return Err(PyTypeError::new_err(text));
    };
    let names: Vec<String> =
        PyList::new(names.py(), names.try_iter()?.collect::<PyResult<Vec<_>>>()?)?
            .iter()
            .map(|name| Ok(name.str()?.to_string()))
            .collect::<PyResult<_>>()?;
    let column = |name: String| {
        let array = source.get_item(&name)?;
        column(name, &array)
    };
    names.into_iter().map(column).collect()
}

fn column(name: String, array: &Bound<'_, PyAny>) -> PyResult<Column> {
    let numbers = Numbers::of(array).map_err(|error| {
        PyValueError::new_err(format!("column `{name}` is not numbers: {error}"))
    })?;
    let values = numbers.values().into_owned();
    Ok((name, numbers.shape, values))
}
