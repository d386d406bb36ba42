//! What is kept of a leg, as numbers: so many at a time are written, whatever they mean.

use super::super::leg::{LegData, LegLine, ZERO_NUMBERS};
use crate::Real;
use crate::estimator::{Beliefs, DeviceFolds};
use crate::go2::JOINTS_PER_LEG;
use crate::scalar::real;

/// Numbers of a leg: what its folds say, how well bodies are known, which effects are active, what is believed of effects, the joints' noise, how
/// long data are remembered, where the zeros are.
const FOLDS: usize = DeviceFolds::<f64>::SETTLED;
const BODIES: usize = FOLDS + JOINTS_PER_LEG;
const ACTIVE: usize = BODIES + JOINTS_PER_LEG;
const BELIEFS: usize = ACTIVE + Beliefs::NUMBERS;
const NOISE: usize = BELIEFS + JOINTS_PER_LEG;

const MEMORY: usize = NOISE + 1;

/// How many numbers are kept of a leg.
pub(super) const NUMBERS: usize = MEMORY + ZERO_NUMBERS;

/// The n-th number of a leg.
pub(super) fn number<T: Real>(line: &LegLine<T>, data: &LegData<T>, n: usize) -> f64 {
    let number = match n {
        n if n < FOLDS => data.folds().settled(n).map(double),
        n if n < BODIES => line.uncertainty(n - FOLDS).map(double),
        n if n < ACTIVE => line.active().0.get(n - BODIES).map(|mask| f64::from(*mask)),
        n if n < BELIEFS => line.beliefs().number(n - ACTIVE).map(f64::from),
        n if n < NOISE => line.noise().get(n - BELIEFS).copied().map(double),
        n if n < MEMORY => Some(f64::from(line.memory_s())),
        _ => line.zero_number(n - MEMORY),
    };
    number.unwrap_or(0.0)
}

/// Takes the n-th number of a leg that was reset; after the last one the leg is what it was.
pub(super) fn set_number<T: Real>(
    line: &mut LegLine<T>,
    data: &mut LegData<T>,
    n: usize,
    number: f64,
) {
    match n {
        n if n < FOLDS => data.folds_mut().settle(n, real(number)),
        n if n < BODIES => line.restore_uncertainty(n - FOLDS, real(number)),
        n if n < ACTIVE => line.restore_active(n - BODIES, number as u32),
        n if n < BELIEFS => line.restore_belief(n - ACTIVE, number as f32),
        n if n < NOISE => line.restore_noise(n - BELIEFS, real(number)),
        n if n < MEMORY => line.set_memory(number as u32),
        _ => line.restore_zero(n - MEMORY, number),
    }
}

/// As `f64`, which is kept whatever the device computes with.
fn double<T: Real>(value: T) -> f64 {
    nalgebra::try_convert(value).unwrap_or(f64::NAN)
}
