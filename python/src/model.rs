//! A robot and what is known of it.

use std::path::PathBuf;

use pyo3::prelude::*;

use crate::error::exception;
use crate::work;

/// A robot: its bodies, its effects (friction, springs, delays, ...) with their values, and how sure these are.
///
/// A model never changes: what adds effects or values returns a new one.
#[pyclass(module = "proprio", frozen, eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct Model(pub(crate) proprio::Model);

/// The model that is meant: a Go2's rigid body where none is named.
pub(crate) fn or_go2(model: Option<&Model>) -> proprio::Model {
    model.map_or_else(proprio::Model::go2, |model| model.0.clone())
}

#[pymethods]
impl Model {
    /// A Unitree Go2 that is suspended or held, level: the bodies of its URDF, and no effect.
    #[staticmethod]
    fn go2() -> Self {
        Self(proprio::Model::go2())
    }

    /// Any robot on a fixed base: the bodies of its URDF, and no effect.
    #[staticmethod]
    fn from_urdf(path: PathBuf) -> PyResult<Self> {
        let model = proprio::Model::from_urdf(path);
        model.map(Self).map_err(|error| exception(&error))
    }

    /// Reads a model file, as the commands write it.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let model = proprio::Model::load(path);
        model.map(Self).map_err(|error| exception(&error))
    }

    /// Writes the model file, whole or not at all. The same model gives the same bytes.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let model = self.0.clone();
        work::run(py, move |_| model.save(path))
    }

    /// The joints' names, in the model's order.
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.0.joints().map(str::to_owned).collect()
    }

    /// The effects, in the order in which they were added: `coulomb:FR_hip`.
    #[getter]
    fn effects(&self) -> Vec<String> {
        self.0.effects().collect()
    }

    /// This model with an effect more: `coulomb:FR_hip`, `coulomb` at all joints, or a torque of your own, `FR_calf: c*sin(3*q)`.
    fn add(&self, effect: &str) -> PyResult<Self> {
        add(self, effect)
    }

    fn __repr__(&self) -> String {
        let joints = self.0.joints().count();
        format!(
            "<proprio.Model of {joints} joints, {} effects>",
            self.0.effects().count()
        )
    }
}

/// The model with an effect more: `coulomb:FR_hip`, `coulomb` at all joints, or a torque of your own, `FR_calf: c*sin(3*q)`.
///
/// It has no value until `identify` gives it one.
#[pyfunction]
pub(crate) fn add(model: &Model, effect: &str) -> PyResult<Model> {
    let model = proprio::add(&model.0, effect);
    model.map(Model).map_err(|error| exception(&error))
}
