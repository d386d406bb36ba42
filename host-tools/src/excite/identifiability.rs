//! What a triangle of rows tells of each parameter, beside what was known before and what any motion could tell.

use nalgebra::DMatrix;
use proprio_core::effect::EffectKind;
use proprio_core::estimator::EFFECTS;
use proprio_core::inertia::INERTIAL;

use super::ExciteError;
use super::cost::triangle;
use super::settings::Earlier;
use super::setup::{Information, window_weights};
use super::space::{Space, by_kind};
use super::spectrum::spectrum;
use crate::model::{self, Model};

/// One parameter's standard deviations, in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Identifiability {
    /// `m:FR_calf`, `coulomb:FR_hip`.
    pub parameter: String,
    /// Before any data.
    pub prior_std: f64,
    /// After the logs.
    pub std: f64,
    /// After the best and longest of motions: what it shares with others in every motion stays unknown.
    pub best_std: f64,
    /// Torque that `std` leaves open on the logs' motion: rms over windows, of all the limb's joints together, N m (sliding joints: N).
    pub torque: f64,
}

/// What logs tell of a limb.
#[derive(Debug, Clone, PartialEq)]
pub struct LimbIdentifiability {
    /// Parameter by parameter: ten per body, then each joint's default effects.
    pub parameters: Vec<Identifiability>,
    /// Condition number of the identifiable inertias, scaled as a design's is.
    pub condition_number: f64,
}

/// What `earlier` tells of `limb`.
///
/// # Errors
/// [`ExciteError`] for a limb that is too large or whose bodies are not physical.
pub fn told(
    model: &Model,
    limb: &model::Limb,
    earlier: &Earlier,
) -> Result<LimbIdentifiability, ExciteError> {
    let Information {
        body,
        theta,
        columns,
        root,
        names,
    } = Information::of(model, limb)?;
    let p = root.ncols();
    let rows = &earlier.triangle * &root;
    let after = triangle(&rows, Some(&DMatrix::identity(p, p)));
    // Rows of root · after⁻¹, whose lengths are the standard deviations.
    let spread = after
        .tr_solve_upper_triangular(&root.transpose())
        .map_or_else(|| root.clone(), |x| x.transpose());
    let whole = Space::new(body.as_ref(), &theta, &columns, &root);
    let torques = torques(model, limb, earlier);
    let parameters = names
        .into_iter()
        .enumerate()
        .map(|(n, parameter)| {
            let prior_std = root.row(n).norm();
            let open = prior_std * prior_std - whole.scale.row(n).norm_squared();
            Identifiability {
                parameter,
                prior_std,
                std: spread.row(n).norm(),
                best_std: open.max(0.0).sqrt(),
                torque: spread.row(n).norm() * torques[n],
            }
        })
        .collect();
    let bodies = limb.bodies.len();
    let inertial = INERTIAL * bodies;
    let kind = by_kind(
        &root.view((0, 0), (inertial, inertial)).into_owned(),
        bodies,
    );
    let space = Space::new(body.as_ref(), &theta, &[], &kind);
    let rows = &earlier.inertial * &space.scale;
    let values = spectrum(&triangle(&rows, None)).map(|(values, _)| values);
    Ok(LimbIdentifiability {
        parameters,
        condition_number: values.map_or(f64::INFINITY, |v| v.max() / v.min()),
    })
}

/// Torque that a unit of each parameter makes on the logs' motion: rms over windows, of all joints together. An offset of 1 N m makes 1 N m,
/// so its column says how long the windows are together.
fn torques(model: &Model, limb: &model::Limb, earlier: &Earlier) -> Vec<f64> {
    let weights = window_weights(model, limb);
    let inertial = INERTIAL * limb.bodies.len();
    let of_effect = |joint: usize, n: usize| {
        let column = earlier
            .triangle
            .column(inertial + EFFECTS.len() * joint + n);
        column.norm() / weights[joint]
    };
    let offset = EFFECTS
        .iter()
        .position(|effect| *effect == EffectKind::Bias);
    let time = offset.map_or(f64::INFINITY, |n| of_effect(0, n));
    let bodies = (0..inertial).map(|k| earlier.inertial.column(k).norm());
    let joints = 0..limb.bodies.len();
    let effects = joints.flat_map(|joint| (0..EFFECTS.len()).map(move |n| (joint, n)));
    bodies
        .chain(effects.map(|(joint, n)| of_effect(joint, n)))
        .map(|norm| if time > 0.0 { norm / time } else { 0.0 })
        .collect()
}
