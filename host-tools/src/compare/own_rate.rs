//! A model's torque at the log's own rate, where the comparison takes windows of 20 ms.

use crate::detect::JointSeries;
use crate::equation::values::Values;
use crate::estimate::robot::{data, side_by_side};
use crate::model::Model;
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
