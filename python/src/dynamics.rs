//! Regressors, torques, mass matrices over many samples.

use std::time::Instant;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{Numbers, filled};
use crate::error::exception;
use crate::model::Model;

/// A motion of a robot, or of a limb, from arrays of shape (..., n).
struct Asked<'py, const K: usize> {
    dynamics: proprio::Dynamics,
    arrays: [Numbers<'py>; K],
}

impl<'py, const K: usize> Asked<'py, K> {
    fn new(model: &Model, limb: Option<&str>, arrays: [&Bound<'py, PyAny>; K]) -> PyResult<Self> {
        let dynamics = proprio::Dynamics::new(&model.0, limb);
        let dynamics = dynamics.map_err(|error| exception(&error))?;
        let joints = dynamics.joints().len();
        let mut all = Vec::with_capacity(K);
        for array in arrays {
            let numbers = Numbers::of(array)?;
            let first = all.first().map(|first: &Numbers<'_>| first.shape.clone());
            if numbers.shape.last() != Some(&joints) {
                let text = format!(
                    "arrays of shape (..., {joints}) are needed, a number per joint of {:?}; this one is {:?}",
                    dynamics.joints(),
                    numbers.shape
                );
                return Err(PyValueError::new_err(text));
            }
            if let Some(first) = first.filter(|first| *first != numbers.shape) {
                let text = format!(
                    "arrays of one shape are needed, not {first:?} and {:?}",
                    numbers.shape
                );
                return Err(PyValueError::new_err(text));
            }
            all.push(numbers);
        }
        let arrays = all.try_into().ok();
        Ok(Self {
            dynamics,
            arrays: arrays.ok_or_else(|| PyValueError::new_err("arrays are missing"))?,
        })
    }

    /// The shape of the samples, with `more` after it.
    fn shape(&self, more: &[usize]) -> Vec<usize> {
        [&self.arrays[0].shape, more].concat()
    }
}

/// The rigid body's torque as a matrix times its inertial parameters, at each sample.
#[pyfunction]
#[pyo3(signature = (model, q, dq, ddq, limb = None))]
pub(crate) fn torque_regressor<'py>(
    py: Python<'py>,
    model: &Model,
    q: &Bound<'py, PyAny>,
    dq: &Bound<'py, PyAny>,
    ddq: &Bound<'py, PyAny>,
    limb: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let asked = Asked::new(model, limb, [q, dq, ddq])?;
    let columns = asked.dynamics.parameters().len();
    let motion = asked.arrays.each_ref().map(Numbers::values);
    filled(py, &asked.shape(&[columns]), |rows| {
        let [q, dq, ddq] = &motion;
        let done = asked.dynamics.torque_regressor([q, dq, ddq], rows);
        done.map_err(|error| exception(&error))
    })
}

/// How long the library itself takes for [`torque_regressor`], s: for the benchmark.
#[pyfunction]
#[pyo3(signature = (model, q, dq, ddq, limb = None))]
pub(crate) fn regressor_seconds<'py>(
    model: &Model,
    q: &Bound<'py, PyAny>,
    dq: &Bound<'py, PyAny>,
    ddq: &Bound<'py, PyAny>,
    limb: Option<&str>,
) -> PyResult<f64> {
    let asked = Asked::new(model, limb, [q, dq, ddq])?;
    let columns = asked.dynamics.parameters().len();
    let motion = asked.arrays.each_ref().map(Numbers::values);
    let [q, dq, ddq] = &motion;
    let begun = Instant::now();
    let mut rows = vec![0.0; q.len() * columns];
    let done = asked.dynamics.torque_regressor([q, dq, ddq], &mut rows);
    done.map_err(|error| exception(&error))?;
    std::hint::black_box(&rows);
    Ok(begun.elapsed().as_secs_f64())
}

/// What a regressor's columns multiply.
#[pyfunction]
#[pyo3(signature = (model, limb = None))]
pub(crate) fn regressor_parameters(model: &Model, limb: Option<&str>) -> PyResult<Vec<String>> {
    let dynamics = proprio::Dynamics::new(&model.0, limb);
    Ok(dynamics.map_err(|error| exception(&error))?.parameters())
}

/// The rigid body's torque at each sample, N m.
#[pyfunction]
#[pyo3(signature = (model, q, dq, ddq, limb = None))]
pub(crate) fn inverse_dynamics<'py>(
    py: Python<'py>,
    model: &Model,
    q: &Bound<'py, PyAny>,
    dq: &Bound<'py, PyAny>,
    ddq: &Bound<'py, PyAny>,
    limb: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let asked = Asked::new(model, limb, [q, dq, ddq])?;
    let motion = asked.arrays.each_ref().map(Numbers::values);
    filled(py, &asked.shape(&[]), |torque| {
        let [q, dq, ddq] = &motion;
        let done = asked.dynamics.inverse_dynamics([q, dq, ddq], torque);
        done.map_err(|error| exception(&error))
    })
}

/// The joint-space inertia matrix at each position, kg m².
#[pyfunction]
#[pyo3(signature = (model, q, limb = None))]
pub(crate) fn mass_matrix<'py>(
    py: Python<'py>,
    model: &Model,
    q: &Bound<'py, PyAny>,
    limb: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let asked = Asked::new(model, limb, [q])?;
    let joints = asked.dynamics.joints().len();
    let [q] = asked.arrays.each_ref().map(Numbers::values);
    filled(py, &asked.shape(&[joints]), |inertia| {
        let done = asked.dynamics.mass_matrix(&q, inertia);
        done.map_err(|error| exception(&error))
    })
}

/// The rigid body's acceleration under a torque at each sample, rad/s².
#[pyfunction]
#[pyo3(signature = (model, q, dq, tau, armature = None, limb = None))]
pub(crate) fn forward_dynamics<'py>(
    py: Python<'py>,
    model: &Model,
    q: &Bound<'py, PyAny>,
    dq: &Bound<'py, PyAny>,
    tau: &Bound<'py, PyAny>,
    armature: Option<Vec<f64>>,
    limb: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let asked = Asked::new(model, limb, [q, dq, tau])?;
    let none = || vec![0.0; asked.dynamics.joints().len()];
    let armature = armature.unwrap_or_else(none);
    let motion = asked.arrays.each_ref().map(Numbers::values);
    filled(py, &asked.shape(&[]), |acceleration| {
        let [q, dq, tau] = &motion;
        let done = (asked.dynamics).forward_dynamics([q, dq, tau], &armature, acceleration);
        done.map_err(|error| exception(&error))
    })
}
