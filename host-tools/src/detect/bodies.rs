//! Bodies far from the CAD's: another body, or what a model lacks.
//!
//! Data carry a body far from the CAD's for two reasons. It is another one: then the prior is wrong, would bias its value and make its error too small, and
//! is to be released. Or the model lacks an effect, and an absurd mass stands in for it. What tells them apart is the log's noise floor, which no model can
//! go below and few that lack something reach: a soft gear's elasticity may be within a tenth of it, and such a body is then released too. Of a log too
//! short to have a floor, a model of other effects may say what is to be reached.

use super::floor;
use crate::equation::values::{Place, Values};
use crate::estimate::fit::{FarBodies, How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot::{self, Shared};
use crate::parallel::by_number;

/// Held-out squares up to so many times those of the noise floor leave nothing to explain: the floor of one log is known to 10 % of its root mean
/// square, whatever model the log is held against.
pub(super) const AT_FLOOR: f64 = 1.21;

/// Fits the effects `places` of each limb. A body that the data carry far from the CAD is released where the limb then leaves no more than its joints' noise
/// floors of what it has not seen; else the prior and the data share it.
pub(crate) fn fit<'a>(
    data: &'a [LimbData<'a>],
    places: &[Vec<Place>],
    how: &How,
) -> (Vec<LimbFit<'a>>, Vec<Shared>) {
    fit_from(data, places, how, &vec![None; data.len()], &|n| {
        at_floor(&data[n])
    })
}

/// The same from the limbs' own values, where they have any, and where the limb leaves no more than `most` says, (N m)².
pub(crate) fn fit_from<'a>(
    data: &'a [LimbData<'a>],
    places: &[Vec<Place>],
    how: &How,
    start: &[Option<Values>],
    most: &(dyn Fn(usize) -> Option<f64> + Sync),
) -> (Vec<LimbFit<'a>>, Vec<Shared>) {
    let (fits, shared) = robot::fit_from(data, places, how, start);
    if fits.len() < data.len() {
        return (fits, shared);
    }
    let released = by_number(0..fits.len(), |n| {
        released(&fits[n], &places[n], how, &shared, &|| most(n))
    });
    let both = released.into_iter().zip(fits);
    let fits = both.map(|(released, fit)| released.unwrap_or(fit));
    (fits.collect(), shared)
}

/// The limb with its far bodies released, if there are any and it then leaves no more than `most`; what limbs share stays.
fn released<'a>(
    fit: &LimbFit<'a>,
    places: &[Place],
    how: &How,
    shared: &[Shared],
    most: &dyn Fn() -> Option<f64>,
) -> Option<LimbFit<'a>> {
    if !fit.has_far_body() {
        return None;
    }
    let places_held = shared.iter().map(Shared::place);
    let how = How {
        far_bodies: FarBodies::Released,
        start: Some(fit.values.clone()),
        held: places_held.chain(how.held.iter().copied()).collect(),
        known: shared.iter().map(Shared::known).collect(),
        ..how.clone()
    };
    let released = LimbFit::of(fit.data, places, &how)?;
    let left = released.data.squares(&released.predicted_held_out()?);
    (left.total() <= most()?).then_some(released)
}

/// Most that a fit leaves of a limb's torque that it has not seen where it leaves noise alone, (N m)²; none where a joint's floor is unknown.
pub(crate) fn at_floor(data: &LimbData) -> Option<f64> {
    let floors = floor::of(data, &data.predicted_by_cad());
    let joints = floors.into_iter().zip(data.windows());
    let judged = joints.filter(|(_, windows)| *windows > 0.0);
    let squares = judged.map(|(floor, windows)| Some(windows * floor?.rms.powi(2)));
    let squares: Option<f64> = squares.sum();
    squares.map(|squares| AT_FLOOR * squares)
}
