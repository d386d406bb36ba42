//! Numbers from and to NumPy, pandas, Polars and Arrow. NumPy is imported where arrays are used, and nowhere else.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyDict};

/// An array of Python's, as binary64, row by row.
pub(crate) struct Numbers<'py> {
    pub(crate) shape: Vec<usize>,
    bytes: Bound<'py, PyBytes>,
}

impl<'py> Numbers<'py> {
    /// Of whatever NumPy makes an array of: lists, columns of pandas, Polars and Arrow too.
    pub(crate) fn of(from: &Bound<'py, PyAny>) -> PyResult<Self> {
        let numpy = from.py().import("numpy")?;
        let array = numpy.call_method1("asarray", (from, "float64"))?;
        let bytes = array.call_method0("tobytes")?;
        Ok(Self {
            shape: array.getattr("shape")?.extract()?,
            bytes: bytes.cast_into::<PyBytes>()?,
        })
    }

    /// The numbers, where Python keeps them, or copied if they lie askew there.
    pub(crate) fn values(&self) -> std::borrow::Cow<'_, [f64]> {
        let bytes = self.bytes.as_bytes();
        match bytemuck::try_cast_slice(bytes) {
            Ok(values) => values.into(),
            Err(_) => {
                let eights = bytes.as_chunks().0.iter();
                eights
                    .map(|eight| f64::from_ne_bytes(*eight))
                    .collect::<Vec<_>>()
                    .into()
            }
        }
    }
}

/// A NumPy array of this shape, which `fill` fills without the interpreter's lock; zero at first.
pub(crate) fn filled<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> PyResult<()> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let size = shape.iter().try_fold(8usize, |all, n| all.checked_mul(*n));
    let size = size.ok_or_else(|| PyValueError::new_err("the result is too large"))?;
    let bytes = PyByteArray::new_with(py, size, |bytes| {
        py.detach(|| match bytemuck::try_cast_slice_mut(bytes) {
            Ok(numbers) => fill(numbers),
            Err(error) => Err(PyValueError::new_err(error.to_string())),
        })
    })?;
    let numpy = py.import("numpy")?;
    let flat = numpy.call_method1("frombuffer", (bytes, "float64"))?;
    flat.call_method1("reshape", (shape.to_vec(),))
}

/// A NumPy array of one dimension.
pub(crate) fn array<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    filled(py, &[values.len()], |to| {
        to.copy_from_slice(values);
        Ok(())
    })
}

/// A table: `pandas` or `polars` `DataFrame` of a dictionary of columns.
pub(crate) fn frame<'py>(
    columns: &Bound<'py, PyDict>,
    library: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let library = columns.py().import(library)?;
    library.call_method1("DataFrame", (columns,))
}

/// Python's own objects of a text in JSON.
pub(crate) fn parsed<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// A page in a notebook's cell: a frame of its own, so that its styles and scripts stay there.
pub(crate) fn in_cell(page: &str) -> String {
    let page = page.replace('&', "&amp;").replace('"', "&quot;");
    format!("<iframe srcdoc=\"{page}\" style=\"width: 100%; height: 800px; border: 0\"></iframe>")
}
