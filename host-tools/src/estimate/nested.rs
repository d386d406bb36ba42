//! A limb's fit as factors over its effects and over others that it might have: what a report's page solves again.

use proprio_core::effect::Form;
use proprio_core::inertia::INERTIAL;
use proprio_solve::nested::{NestedJoint, NestedLimb};

use super::accumulate::Weights;
use super::factor::HeapFactor;
use super::fit::{How, LimbFit, others};
use super::limb_data::LimbData;
use super::parameter_estimate::Constraint;
use crate::equation::column::Columns;
use crate::equation::column::depends_on_values;
use crate::equation::dot::dot;
use crate::equation::rows::Rows;
use crate::equation::values::{Place, is_shared};

/// Windows of a joint that are drawn, spread evenly over time.
const DRAWN: usize = 400;

/// A limb of which every choice among `effects` can be fitted.
pub(crate) struct Nested {
    pub(crate) limb: NestedLimb,
    /// The effects that can be left out, in the order in which the limb counts them.
    pub(crate) effects: Vec<Place>,
    /// Of each joint, windows to draw.
    pub(crate) drawn: Vec<Vec<Drawn>>,
}

/// A window of a joint.
pub(crate) struct Drawn {
    pub(crate) q: f64,
    pub(crate) dq: f64,
    /// Torque of the fit's bodies alone, N m.
    pub(crate) load: f64,
    pub(crate) fold: usize,
    /// Measured mean torque, N m.
    pub(crate) torque: f64,
    /// The joint's columns.
    pub(crate) row: Vec<f64>,
}

/// Whether a model with an effect left out is the same model with its columns dropped: its torque is linear in its parameters, and
/// what the columns are made of does not depend on any other.
pub(crate) fn can_be_left_out(place: &Place) -> bool {
    matches!(place.0.description().form, Form::Columns | Form::Coupled)
        && !is_shared(place.1)
        && !depends_on_values(place.0)
}

/// Whether an effect can be put in without a search: one that can be left out, and no shape to find.
pub(crate) fn can_be_put_in(place: &Place) -> bool {
    can_be_left_out(place) && !place.0.description().has_shape()
}

impl Nested {
    /// The fit's effects and `more`, which it has not; a fit that leaves no more than `at_floor` of what it has not seen, (N m)², leaves noise alone.
    pub(crate) fn of(fit: &LimbFit, more: &[Place], at_floor: f64) -> Self {
        let data = fit.data;
        let all: Vec<Place> = fit.places.iter().chain(more).copied().collect();
        let columns = data.columns(&fit.at, &all, &[]);
        let rows = data.rows(&fit.at, &columns);
        let train = by_fold(data, &columns, &rows, &fit.weights);
        let test = by_fold(data, &columns, &rows, &Weights::none(data));
        let effects: Vec<Place> = all.into_iter().filter(can_be_left_out).collect();
        let own = columns.entries.iter().filter_map(|entry| {
            let place = (entry.effect?, entry.joint);
            Some(effects.iter().position(|effect| *effect == place))
        });
        let how = How {
            constraint: Constraint::Physical,
            ..How::default()
        };
        let places = |j: usize| (0..columns.entries.len()).map(move |e| (j, e));
        let joint = |(j, (train, test)): (usize, (Vec<HeapFactor>, Vec<HeapFactor>))| NestedJoint {
            places: places(j).map(|(j, e)| columns.place(j, e)).collect(),
            train,
            test,
        };
        Self {
            limb: NestedLimb {
                bodies: data.bodies_before(),
                at_floor,
                others: others(&columns, &fit.at, &how),
                effect: own.collect(),
                joints: train.into_iter().zip(test).enumerate().map(joint).collect(),
            },
            drawn: (0..data.joints())
                .map(|j| drawn(fit, &columns, &rows, j))
                .collect(),
            effects,
        }
    }
}

/// Of each joint the factors of its folds.
fn by_fold(
    data: &LimbData,
    columns: &Columns,
    rows: &Rows,
    weights: &Weights,
) -> Vec<Vec<HeapFactor>> {
    let folds = weights.folds(data, columns, rows, &|_| true);
    (0..data.joints())
        .map(|j| folds.blocks.iter().map(|fold| fold[j].clone()).collect())
        .collect()
}

fn drawn(fit: &LimbFit, columns: &Columns, rows: &Rows, j: usize) -> Vec<Drawn> {
    let data = fit.data;
    let mut bodies = vec![0.0; columns.entries.len()];
    let count = INERTIAL * fit.problem.bodies.len();
    bodies[..count].copy_from_slice(&fit.solution.theta.as_slice()[..count]);
    let bodies = &columns.combined(&bodies)[j];
    let judged: Vec<usize> = (0..data.motion.windows.len())
        .filter(|&w| data.counts(w, j))
        .collect();
    let step = judged.len().div_ceil(DRAWN).max(1);
    let of = |&w: &usize| {
        let (window, row) = (&data.motion.windows[w], rows.row(w, j));
        let mean = |n: usize| {
            data.motion
                .mean(window, |k| data.motion.joint[j].state[k][n])
        };
        Drawn {
            q: mean(0),
            dq: mean(1),
            load: dot(bodies, row),
            fold: data.fold(w),
            torque: data.torque[w * data.joints() + j],
            row: row.to_vec(),
        }
    };
    judged.iter().step_by(step).map(of).collect()
}
