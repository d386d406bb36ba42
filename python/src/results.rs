//! What the steps of the loop return.

use std::path::PathBuf;
use std::sync::Arc;

use proprio::Recording;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{array, frame, in_cell, parsed};
use crate::log::{Log, Source};
use crate::model::{Model, or_go2};
use crate::work;

/// What a result is of: its recording, and the log, which stays in memory as long as pages can be asked for.
#[derive(Clone)]
struct Origin {
    recording: Arc<Recording>,
    _source: Arc<Source>,
}

/// Reads a log for a model and does `work` with it.
fn with_recording<T: Send + 'static>(
    py: Python<'_>,
    log: &Log,
    model: proprio::Model,
    work: impl FnOnce(&Recording, &proprio::Model) -> Result<T, proprio::Error> + Send + 'static,
) -> PyResult<(T, Origin)> {
    let source = Arc::clone(&log.0);
    work::run(py, move |_| {
        let recording = source.recording(&model)?;
        let done = work(&recording, &model)?;
        let origin = Origin {
            recording,
            _source: source,
        };
        Ok((done, origin))
    })
}

/// A parameter with what the logs say of it.
#[pyclass(module = "proprio", frozen, get_all)]
pub(crate) struct Parameter {
    name: String,
    unit: &'static str,
    value: f64,
    std: f64,
    identified: bool,
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        format!(
            "<{} = {:.4} ± {:.4} {}>",
            self.name, self.value, self.std, self.unit
        )
    }
}

impl Parameter {
    fn of(parameter: &proprio::Parameter) -> Self {
        Self {
            name: parameter.name.clone(),
            unit: parameter.unit,
            value: parameter.value,
            std: parameter.std,
            identified: parameter.identified,
        }
    }
}

/// A model fitted to a log.
#[pyclass(module = "proprio", frozen)]
pub(crate) struct Fitted {
    fitted: Arc<proprio::Fitted>,
    origin: Origin,
}

#[pymethods]
impl Fitted {
    #[getter]
    fn model(&self) -> Model {
        Model(self.fitted.model.clone())
    }

    #[getter]
    fn parameters(&self) -> Vec<Parameter> {
        self.fitted.parameters.iter().map(Parameter::of).collect()
    }

    /// The parameter of that name, or None.
    fn parameter(&self, name: &str) -> Option<Parameter> {
        self.fitted.parameter(name).map(Parameter::of)
    }

    #[getter]
    fn rms(&self) -> f64 {
        self.fitted.rms
    }

    #[getter]
    fn held_out_rms(&self) -> Option<f64> {
        self.fitted.held_out_rms
    }

    #[getter]
    fn cad_rms(&self) -> f64 {
        self.fitted.cad_rms
    }

    /// What `proprio identify --json` prints, as Python's own objects.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parsed(py, &self.fitted.json())
    }

    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&self.columns(py)?, "pandas")
    }

    fn to_polars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&self.columns(py)?, "polars")
    }

    /// The page of `proprio identify --html`.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let (fitted, origin) = (Arc::clone(&self.fitted), self.origin.clone());
        work::run(py, move |_| fitted.page(&origin.recording))
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        Ok(in_cell(&self.page(py)?))
    }

    fn __str__(&self) -> String {
        self.fitted.to_string()
    }

    fn __repr__(&self) -> String {
        self.fitted.to_string()
    }
}

impl Fitted {
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = &self.fitted.parameters;
        let columns = PyDict::new(py);
        let names: Vec<&str> = all.iter().map(|p| p.name.as_str()).collect();
        let units: Vec<&str> = all.iter().map(|p| p.unit).collect();
        let identified: Vec<bool> = all.iter().map(|p| p.identified).collect();
        columns.set_item("name", names)?;
        columns.set_item("unit", units)?;
        columns.set_item("value", all.iter().map(|p| p.value).collect::<Vec<_>>())?;
        columns.set_item("std", all.iter().map(|p| p.std).collect::<Vec<_>>())?;
        columns.set_item("identified", identified)?;
        Ok(columns)
    }
}

/// Fits bodies and effects of a model to a log, within their priors.
#[pyfunction]
#[pyo3(signature = (log, model = None))]
pub(crate) fn identify(py: Python<'_>, log: &Log, model: Option<&Model>) -> PyResult<Fitted> {
    let plain = model.is_none();
    let (fitted, origin) =
        with_recording(
            py,
            log,
            or_go2(model),
            move |recording, model| match plain {
                true => proprio::identify(recording, &proprio::plain(recording)),
                false => proprio::identify(recording, model),
            },
        )?;
    let fitted = Arc::new(fitted);
    Ok(Fitted { fitted, origin })
}

/// Measured and predicted torque of a joint over time.
#[pyclass(module = "proprio", frozen)]
#[derive(Clone)]
pub(crate) struct JointSeries(proprio::JointSeries);

/// A column of a series: its name, its unit, and where it is.
type SeriesColumn = (
    &'static str,
    &'static str,
    fn(&proprio::JointSeries) -> Vec<f64>,
);

/// The columns of a series.
const SERIES: [SeriesColumn; 6] = [
    ("t", "s", |s| s.t.clone()),
    ("q", "rad", |s| s.q.clone()),
    ("dq", "rad/s", |s| s.dq.clone()),
    ("tau", "N m", |s| s.tau.clone()),
    ("predicted", "N m", |s| s.predicted.clone()),
    ("residual", "N m", proprio::JointSeries::residual),
];

#[pymethods]
impl JointSeries {
    #[getter]
    fn joint(&self) -> &str {
        &self.0.joint
    }

    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.t)
    }

    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.q)
    }

    #[getter]
    fn dq<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.dq)
    }

    #[getter]
    fn tau<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.tau)
    }

    #[getter]
    fn predicted<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.predicted)
    }

    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.residual())
    }

    #[getter]
    fn rms(&self) -> f64 {
        self.0.rms()
    }

    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        for (name, unit, _) in SERIES {
            units.set_item(name, unit)?;
        }
        Ok(units)
    }

    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&columns(py, std::slice::from_ref(&self.0))?, "pandas")
    }

    fn to_polars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&columns(py, std::slice::from_ref(&self.0))?, "polars")
    }

    fn __repr__(&self) -> String {
        let (joint, samples) = (&self.0.joint, self.0.t.len());
        format!(
            "<proprio.JointSeries {joint}, {samples} samples, rms {:.4} N m>",
            self.0.rms()
        )
    }
}

/// Series one below the other, with the joint's name in each row.
fn columns<'py>(py: Python<'py>, all: &[proprio::JointSeries]) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let names = all
        .iter()
        .flat_map(|s| s.t.iter().map(|_| s.joint.as_str()));
    columns.set_item("joint", PyList::new(py, names.collect::<Vec<_>>())?)?;
    for (name, _, of) in SERIES {
        let values: Vec<f64> = all.iter().flat_map(of).collect();
        columns.set_item(name, array(py, &values)?)?;
    }
    Ok(columns)
}

/// The torque that a model's drives would report, at the log's own samples, from the motion alone.
#[pyfunction]
#[pyo3(signature = (log, model = None))]
pub(crate) fn predict(
    py: Python<'_>,
    log: &Log,
    model: Option<&Model>,
) -> PyResult<Vec<JointSeries>> {
    let (series, _) = with_recording(py, log, or_go2(model), |recording, model| {
        Ok(proprio::predict(recording, model))
    })?;
    Ok(series.into_iter().map(JointSeries).collect())
}

/// A model held against a log.
#[pyclass(module = "proprio", frozen)]
pub(crate) struct Comparison {
    comparison: Arc<proprio::Comparison>,
    model: proprio::Model,
    origin: Origin,
}

#[pymethods]
impl Comparison {
    #[getter]
    fn rms(&self) -> f64 {
        self.comparison.rms
    }

    #[getter]
    fn zero_rms(&self) -> f64 {
        self.comparison.zero_rms
    }

    #[getter]
    fn cad_rms(&self) -> f64 {
        self.comparison.cad_rms
    }

    #[getter]
    fn noise_floor_rms(&self) -> Option<f64> {
        self.comparison.noise_floor_rms
    }

    #[getter]
    fn fitted(&self) -> bool {
        self.comparison.fitted
    }

    #[getter]
    fn joints(&self) -> Vec<JointSeries> {
        let joints = self.comparison.joints.iter().cloned();
        joints.map(JointSeries).collect()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.comparison.warnings.clone()
    }

    /// What `proprio compare --json --verbose` prints, as Python's own objects.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parsed(py, &self.comparison.json())
    }

    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&columns(py, &self.comparison.joints)?, "pandas")
    }

    fn to_polars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&columns(py, &self.comparison.joints)?, "polars")
    }

    /// The report: one HTML document.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let (comparison, model) = (Arc::clone(&self.comparison), self.model.clone());
        let origin = self.origin.clone();
        work::run(py, move |_| comparison.page(&origin.recording, &model))
    }

    /// Writes measured and predicted torque: `.mcap` at the log's rate for Foxglove, PlotJuggler and Rerun, else CSV.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let (comparison, model) = (Arc::clone(&self.comparison), self.model.clone());
        let origin = self.origin.clone();
        work::run(py, move |_| {
            comparison.save(&origin.recording, &model, path)
        })
    }

    /// Writes the report to a file, whole or not at all.
    fn report(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let (comparison, model) = (Arc::clone(&self.comparison), self.model.clone());
        let origin = self.origin.clone();
        work::run(py, move |_| {
            proprio::report(&comparison, &origin.recording, &model, path)
        })
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        Ok(in_cell(&self.page(py)?))
    }

    fn __str__(&self) -> String {
        self.comparison.to_string()
    }

    fn __repr__(&self) -> String {
        self.comparison.to_string()
    }
}

/// Holds a model against a log: how far its torque is from the measured one.
#[pyfunction]
#[pyo3(signature = (log, model = None))]
pub(crate) fn compare(py: Python<'_>, log: &Log, model: Option<&Model>) -> PyResult<Comparison> {
    let model = or_go2(model);
    let (comparison, origin) = with_recording(py, log, model.clone(), proprio::compare)?;
    Ok(Comparison {
        comparison: Arc::new(comparison),
        model,
        origin,
    })
}

/// Which effects a model lacks.
#[pyclass(module = "proprio", frozen)]
pub(crate) struct Diagnosis {
    diagnosis: Arc<proprio::Diagnosis>,
    origin: Origin,
}

#[pymethods]
impl Diagnosis {
    #[getter]
    fn missing(&self) -> Vec<String> {
        self.diagnosis.missing.clone()
    }

    #[getter]
    fn model(&self) -> Model {
        Model(self.diagnosis.model.clone())
    }

    #[getter]
    fn before(&self) -> f64 {
        self.diagnosis.before
    }

    #[getter]
    fn after(&self) -> f64 {
        self.diagnosis.after
    }

    #[getter]
    fn noise_floor_rms(&self) -> Option<f64> {
        self.diagnosis.noise_floor_rms
    }

    #[getter]
    fn outside_catalogue(&self) -> Vec<String> {
        self.diagnosis.outside_catalogue.clone()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.diagnosis.warnings.clone()
    }

    /// What `proprio diagnose --json` prints, as Python's own objects.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        parsed(py, &self.diagnosis.json(&self.origin.recording))
    }

    /// The ladder: a row per step, with the effect, its joints and the held-out error after it, N m.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let path = self.to_dict(py)?.get_item("path")?;
        py.import("pandas")?.call_method1("DataFrame", (path,))
    }

    fn to_polars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let path = self.to_dict(py)?.get_item("path")?;
        py.import("polars")?.call_method1("DataFrame", (path,))
    }

    /// The page of `proprio diagnose --html`.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let (diagnosis, origin) = (Arc::clone(&self.diagnosis), self.origin.clone());
        work::run(py, move |_| diagnosis.page(&origin.recording))
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        Ok(in_cell(&self.page(py)?))
    }

    fn __str__(&self) -> String {
        self.diagnosis.to_string()
    }

    fn __repr__(&self) -> String {
        self.diagnosis.to_string()
    }
}

/// Looks for what a model lacks.
#[pyfunction]
#[pyo3(signature = (log, model = None))]
pub(crate) fn diagnose(py: Python<'_>, log: &Log, model: Option<&Model>) -> PyResult<Diagnosis> {
    let (diagnosis, origin) = with_recording(py, log, or_go2(model), proprio::diagnose)?;
    Ok(Diagnosis {
        diagnosis: Arc::new(diagnosis),
        origin,
    })
}
