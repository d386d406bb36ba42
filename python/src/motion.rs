//! The motion that `excite` designs.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, filled, frame};
use crate::model::{Model, or_go2};
use crate::work;

/// A motion within the robot's limits, at 500 Hz.
#[pyclass(module = "proprio", frozen)]
pub(crate) struct Motion(proprio::Motion);

impl Motion {
    /// A row per sample, a column per joint.
    fn matrix<'py>(&self, py: Python<'py>, of: &[Vec<f64>]) -> PyResult<Bound<'py, PyAny>> {
        let joints = of.len();
        filled(py, &[self.0.t.len(), joints], |to| {
            for (joint, channel) in of.iter().enumerate() {
                let column = to.iter_mut().skip(joint).step_by(joints);
                column.zip(channel).for_each(|(to, x)| *to = *x);
            }
            Ok(())
        })
    }
}

#[pymethods]
impl Motion {
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.0.joints.clone()
    }

    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.t)
    }

    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.matrix(py, &self.0.q)
    }

    #[getter]
    fn dq<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.matrix(py, &self.0.dq)
    }

    #[getter]
    fn ddq<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.matrix(py, &self.0.ddq)
    }

    #[getter]
    fn tau<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.matrix(py, &self.0.tau)
    }

    #[getter]
    fn condition_number(&self) -> f64 {
        self.0.condition_number
    }

    #[getter]
    fn rank(&self) -> usize {
        self.0.rank
    }

    #[getter]
    fn log_det(&self) -> f64 {
        self.0.log_det
    }

    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        for (channel, unit) in [
            ("t", "s"),
            ("q", "rad"),
            ("dq", "rad/s"),
            ("ddq", "rad/s^2"),
            ("tau", "N m"),
        ] {
            units.set_item(channel, unit)?;
        }
        Ok(units)
    }

    /// Writes the motion as the CSV that `proprio excite` writes, with feedback gains (N m/rad, N m s/rad).
    #[pyo3(signature = (path, kp = 40.0, kd = 1.5))]
    fn save(&self, py: Python<'_>, path: PathBuf, kp: f64, kd: f64) -> PyResult<()> {
        let motion = self.0.clone();
        work::run(py, move |_| motion.save(path, kp, kd))
    }

    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&self.columns(py)?, "pandas")
    }

    fn to_polars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        frame(&self.columns(py)?, "polars")
    }

    fn __repr__(&self) -> String {
        let last = self.0.t.last().copied().unwrap_or(0.0);
        format!(
            "<proprio.Motion of {} joints, {last:.1} s, condition number {:.1}>",
            self.0.joints.len(),
            self.0.condition_number
        )
    }
}

impl Motion {
    /// As in the CSV: `t`, `q/<joint>` and so on.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        columns.set_item("t", array(py, &self.0.t)?)?;
        for (channel, of) in [
            ("q", &self.0.q),
            ("dq", &self.0.dq),
            ("ddq", &self.0.ddq),
            ("tau", &self.0.tau),
        ] {
            for (joint, values) in self.0.joints.iter().zip(of) {
                columns.set_item(format!("{channel}/{joint}"), array(py, values)?)?;
            }
        }
        Ok(columns)
    }
}

/// Designs a motion that excites what can be identified, within the robot's limits.
#[pyfunction]
#[pyo3(signature = (model = None, *, limbs = vec![], duration = None, cost = "condition", parameters = vec![], seed = None, starts = None))]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn excite(
    py: Python<'_>,
    model: Option<&Model>,
    limbs: Vec<String>,
    duration: Option<f64>,
    cost: &str,
    parameters: Vec<String>,
    seed: Option<u64>,
    starts: Option<usize>,
) -> PyResult<Motion> {
    let mut asked = proprio::Excitation::default();
    asked.cost = match (parameters.is_empty(), cost) {
        (false, _) => proprio::Cost::Variance(parameters),
        (true, "condition") => proprio::Cost::Condition,
        (true, "condition-si") => proprio::Cost::ConditionSi,
        (true, "determinant") => proprio::Cost::Determinant,
        (true, other) => {
            let text =
                format!("cost is 'condition', 'condition-si' or 'determinant', not {other:?}");
            return Err(PyValueError::new_err(text));
        }
    };
    asked.limbs = limbs;
    asked.duration = duration.unwrap_or(asked.duration);
    asked.seed = seed.unwrap_or(asked.seed);
    asked.starts = starts.unwrap_or(asked.starts);
    let model = or_go2(model);
    let stopped = move |stop: &std::sync::atomic::AtomicBool| {
        proprio::excite(&model, &asked, &|| stop.load(Ordering::Relaxed))
    };
    work::run(py, stopped).map(Motion)
}
