//! What every result of walks is held against: parameters of no model, of the CAD and of the model file as it is given.

use nalgebra::DVector;

use super::FreeBaseError;
use super::data::Data;
use super::fit::bare;
use super::structure::ModelStructure;
use crate::model::Model;

/// Those of no model, of the CAD without any effect and of the `file` as it is given; what sensors get wrong is no model's, and is fitted to the latter two.
///
/// # Errors
/// As [`ModelStructure::of`].
pub(crate) fn rungs(data: &Data, file: &Model) -> Result<[DVector<f64>; 3], FreeBaseError> {
    let cad = ModelStructure::of(&file.bare())?;
    let as_given = given(data, file, &ModelStructure::of(file)?);
    Ok([
        DVector::zeros(data.columns().len()),
        data.with_sensors(&bare(data, &cad)),
        data.with_sensors(&as_given),
    ])
}

/// The parameters that a model file gives; what has no value does nothing.
pub(crate) fn given(data: &Data, model: &Model, structure: &ModelStructure) -> DVector<f64> {
    let mut theta = bare(data, structure);
    for (k, n, linear) in data.columns().effects() {
        let place = data.columns().sites[n].place;
        // A load is in its body.
        let own = model
            .effect(place.0, place.1)
            .filter(|_| structure.has(place));
        let value = own.and_then(|own| own.estimates[linear.parameter]);
        theta[k] = value.map_or(0.0, |own| own.value - linear.neutral);
    }
    theta
}
