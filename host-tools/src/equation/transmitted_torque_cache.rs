//! What gears transmit, and the motion that it is made of, as they are kept of a limb: what was asked for last.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::DMatrix;
use realfft::RealFftPlanner;

use super::body::LimbBody;
use super::values::Values;
use crate::trajectory::Trajectory;

/// Most numbers that are kept of a limb's loads, and of its late motion: 8 MB each.
pub(super) const MOST: usize = 1_000_000;
/// The same of what bristles have transmitted: 2 MB.
pub(super) const MOST_OF_BRISTLES: usize = 250_000;

/// What the gears transmit.
pub(crate) struct Load {
    /// Sample by sample, joint by joint, N m.
    pub(super) torque: Vec<f64>,
    /// What it is in the mean from the sample before each to it beyond the mean of both, N m ([`Motion::beyond_samples`](super::motion::Motion)). Nothing
    /// where no link may move.
    pub(super) beyond: Vec<f64>,
    /// The inertia that each joint turns, kg m²; sample by sample, joint by joint. Nothing where no link may move.
    pub(super) inertia: Vec<f64>,
    /// The inertia matrix, the mean over some poses, kg m². Nothing where no link may move.
    pub(super) usual: DMatrix<f64>,
    /// The motors' motion that it is made of, and the samples that were asked for.
    pub(super) motors: Arc<Vec<Trajectory>>,
    pub(super) asked: Vec<bool>,
    // Each costs as much as the load itself. Filters are for joints whose links move, straight lines for effects that see the load: each is made when it
    // is asked for.
    /// Of each joint, [`Motion::filtered`](super::motion::Motion).
    pub(super) filtered: Vec<OnceLock<Vec<f64>>>,
    /// [`Motion::smooth`](super::motion::Motion).
    pub(super) smooth: OnceLock<Vec<f64>>,
}

/// Of what a load is: bits of the bodies' numbers, of the base's tilt, of the encoders' offsets and of the delay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Key(Vec<u64>);

impl Key {
    pub(super) fn of(body: &LimbBody, values: &Values, delay: f64) -> Self {
        let bodies = values.loaded(&body.coms);
        let numbers = bodies.iter().flat_map(|body| body.0.iter().copied());
        let all = numbers.chain(values.tilt());
        let all = all.chain(values.encoders().flat_map(|encoder| encoder.numbers()));
        Self(all.chain([delay]).map(f64::to_bits).collect())
    }
}

/// Loads of a limb and its motion as it was some time before, what was asked for last at the end.
#[derive(Default)]
pub(crate) struct Loads {
    loads: Mutex<Vec<(Key, Arc<Load>)>>,
    pub(super) late: Mutex<Option<(f64, Arc<Vec<Trajectory>>)>>,
    pub(super) bristles: Mutex<Vec<(Bristles, Arc<Vec<f64>>)>>,
    /// Plans of the transforms that filter loads: a plan takes as long as a transform, and all loads are of the same lengths.
    pub(super) plans: Mutex<RealFftPlanner<f64>>,
}

/// Which bristles' impulse is kept: bits of the delay and of their displacement, and the joint.
pub(super) type Bristles = (u64, u64, usize);

impl Loads {
    pub(super) fn get(&self, key: &Key, loose: bool) -> Option<Arc<Load>> {
        let mut all = self.loads.lock().unwrap_or_else(PoisonError::into_inner);
        let n = all.iter().position(|(known, load)| {
            known == key && (!loose || load.inertia.len() == load.torque.len())
        })?;
        all[n..].rotate_left(1);
        all.last().map(|(_, load)| load.clone())
    }

    pub(super) fn put(&self, key: Key, load: &Arc<Load>) {
        let size = |load: &Load| 3 * load.torque.len() + 3 * load.inertia.len();
        if size(load) > MOST {
            return;
        }
        let mut all = self.loads.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|(known, _)| *known != key);
        all.push((key, load.clone()));
        let mut total: usize = all.iter().map(|(_, load)| size(load)).sum();
        while total > MOST {
            total -= size(&all.remove(0).1);
        }
    }
}
