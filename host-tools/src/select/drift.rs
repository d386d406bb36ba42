//! What changes with time: a parameter that differs from fold to fold is no parameter.
//!
//! Effects of the catalogue are constant in time, or follow the temperature. A motor whose torque constant drifts, a joint
//! whose friction has changed after a blow or a drop of grease, leave residuals without a shape in position or velocity. With all
//! else as fitted to the other folds, each parameter of a joint is fitted again to each fold alone; what that takes from the
//! sum of squares is χ² with as many degrees of freedom as there are folds if nothing changes.

use proprio_core::effect::EffectKind;

use super::criteria::presence::is_change;
use super::score_test::Screen;
use crate::catalogue;

/// A parameter that changes with time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drift {
    /// Which joint of the limb.
    pub(crate) joint: usize,
    /// The effect whose first parameter it is.
    pub(crate) effect: EffectKind,
    /// Its smallest and largest difference from its value in the other folds.
    pub(crate) range: [f64; 2],
}

/// What changes most at each joint, if anything does.
pub(crate) fn drifts(limb: &Screen) -> Vec<Drift> {
    let joints = 0..limb.fit.data.joints();
    joints.filter_map(|joint| drift(limb, joint)).collect()
}

fn drift(limb: &Screen, joint: usize) -> Option<Drift> {
    // Of what residuals remember only their noise's part counts: what changes makes them remember longer.
    let square = limb.fit.noise[joint].powi(2) * limb.noise_memory[joint];
    let left: f64 = limb.factors.base.iter().map(|fold| fold[joint]).sum();
    let watched = catalogue::effects().filter(|effect| effect.description().drifts);
    let judged = watched.filter_map(|effect| {
        let entry = *limb.factors.columns.of_effect(effect, joint).first()?;
        let changes: Vec<(f64, f64)> = (0..limb.factors.theta.len())
            .map(|fold| change(limb, joint, fold, entry))
            .collect();
        let fall: f64 = changes.iter().map(|(_, fall)| fall).sum();
        let values = changes.iter().map(|(value, _)| *value);
        let range = [
            values.clone().fold(f64::INFINITY, f64::min),
            values.fold(f64::NEG_INFINITY, f64::max),
        ];
        Some((
            fall,
            Drift {
                joint,
                effect,
                range,
            },
        ))
    });
    let (fall, drift) = judged.max_by(|a, b| a.0.total_cmp(&b.0))?;
    is_change(fall, square, left).then_some(drift)
}

/// By how much an entry of θ differs in a fold, and what that takes from the fold's sum of squares, (N m)².
fn change(limb: &Screen, joint: usize, fold: usize, entry: usize) -> (f64, f64) {
    let mut theta = limb.factors.theta[fold].clone();
    let at = theta[entry];
    let mut squares = |by: f64| {
        theta[entry] = at + by;
        limb.factors.left_of((joint, fold), &theta)
    };
    // A parabola: three points are exact.
    let [here, ahead, behind] = [0.0, 1.0, -1.0].map(&mut squares);
    let curvature = 0.5 * (ahead + behind) - here;
    if curvature <= 0.0 {
        return (0.0, 0.0);
    }
    let slope = 0.5 * (behind - ahead);
    (0.5 * slope / curvature, 0.25 * slope * slope / curvature)
}
