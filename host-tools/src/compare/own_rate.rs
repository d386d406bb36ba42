//! A model's torque at the log's own rate, where the comparison takes windows of 20 ms.

#[cfg(feature = "mcap")]
use std::collections::BTreeMap;

use crate::detect::JointSeries;
#[cfg(feature = "mcap")]
use crate::detect::floor;
use crate::equation::values::Values;
use crate::estimate::robot::data;
use crate::model::Model;
use crate::parallel::side_by_side;
use crate::recording::Recording;

/// Measured and predicted torque of every joint at every sample, each a mean over the two sample periods around it: from the values that
/// `model` has (an effect without one does nothing), by the predictor of [`compare`](super::compare()), also where the joint rests. Repeated
/// samples, and those next to a gap, have none.
pub fn own_rate(recording: &Recording, model: &Model) -> Vec<JointSeries> {
    let limbs = data(recording, model);
    let series = side_by_side(&limbs, |limb| {
        let limb = limb.at_samples()?;
        let given = Values::given(limb.model, limb.limb);
        let torque = limb.predicted(&given, &|_| true);
        Some(JointSeries::of(&limb, &torque))
    });
    series.into_iter().flatten().flatten().collect()
}

/// The noise of each joint's torque at that rate, N m, by the joint's name: of the log, whatever the model; none for too few samples.
#[cfg(feature = "mcap")]
pub(crate) fn own_rate_floors(
    recording: &Recording,
    model: &Model,
) -> BTreeMap<String, Option<f64>> {
    let limbs = data(recording, model);
    let floors = side_by_side(&limbs, |limb| {
        let limb = limb.at_samples_apart()?;
        let floors = floor::of(&limb, &limb.predicted_by_cad());
        let floors = floors.into_iter().map(|noise| noise.map(|noise| noise.rms));
        Some(
            limb.joint_names()
                .into_iter()
                .zip(floors)
                .collect::<Vec<_>>(),
        )
    });
    floors.into_iter().flatten().flatten().collect()
}
