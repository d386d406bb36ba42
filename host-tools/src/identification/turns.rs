//! Rows of windows in which a joint turns round: they say less than others.
//!
//! Where a joint reverses, its dry friction jumps, and where friction holds it up for a moment runs from one limit to the
//! other. No sample says when, and a column that assumes it is wrong by a share of the friction, the same way at reversal
//! after reversal. Velocities there are told by fewer samples, too. In a row that is little, but rows are whitened for the
//! edges that neighbours share, so that what is slow counts for much: with reversals in the chain, a minute of a simulated
//! Go2 has its viscous friction wrong by 1.4 standard deviations on average, and 95 % intervals cover 86 %.
//!
//! So a row in doubt has beside the noise σ of all rows one of its own, d, and stands alone: it is divided by √(1 + d²/σ²),
//! and the chain of correlated rows ends before it and starts anew after it.

use proprio_core::effect::JointState;

use crate::criticism::blocks::BlockFactors;
use crate::criticism::column::Column;
use crate::criticism::limb::LimbCriticism;
use crate::criticism::windows::Window;

/// A joint slower than this may be held by its friction, rad/s: that of the windows which the criticism leaves out.
const REST: f64 = 0.02;
/// Share of a window for which a joint may be held: windows in which it rests longer are left out already.
const MOST_REST: f64 = 0.125;

/// The windows as factors of whitened rows, block by block of time.
pub(super) fn block_factors(criticism: &mut LimbCriticism) -> BlockFactors {
    let theta = criticism.columns.combined(&criticism.fit.theta);
    let columns = &criticism.columns.of_joint;
    if !columns.iter().any(|columns| can_jump(columns)) {
        return criticism.block_factors();
    }
    // Columns that are made of the model itself follow its fit.
    let mut windows = std::mem::take(&mut criticism.windows);
    windows.follow(&criticism.rows());
    let mut factors = BlockFactors::none(&criticism.columns, criticism.blocks.count());
    let mut chains = vec![Chain::default(); theta.len()];
    let mut row = Vec::new();
    for window in windows.iter() {
        for (joint, chain) in chains.iter_mut().enumerate() {
            if window.moves[joint] {
                let doubt = doubt(criticism, &window, joint, &theta[joint]);
                row.clear();
                row.extend_from_slice(window.row(joint));
                match doubt {
                    Some(doubt) => chain.alone(doubt / criticism.fit.noise[joint], &mut row),
                    None => chain.next(window.samples, criticism.correlation[joint], &mut row),
                }
                // A recording's numbers are finite; a row that overflows is left out.
                let _ = factors.blocks[window.block][joint].update(&mut row);
            }
        }
    }
    criticism.windows = windows;
    factors
}

/// Where a joint turns round in a window, the standard deviation of what is not known of its friction, N m: it may point
/// either way for any part of the time that the joint may be held.
fn doubt(criticism: &LimbCriticism, window: &Window, joint: usize, theta: &[f64]) -> Option<f64> {
    let n = criticism.recording.joints;
    let state = |k: usize| &criticism.motion.states[k * n + joint];
    let [first, last] = window.samples;
    let slow = (first..=last).find(|&k| state(k).speed.abs() < REST);
    let turn = || (first..last).find(|&k| state(k).speed * state(k + 1).speed <= 0.0);
    let at = slow.or_else(turn)?;
    let jump = jump(&criticism.columns.of_joint[joint], theta, state(at));
    // Evenly likely between the two limits.
    (jump > 0.0).then_some(jump * MOST_REST / 3f64.sqrt())
}

/// Whether a joint's model has dry friction.
fn can_jump(columns: &[Column]) -> bool {
    let state = JointState {
        speed_noise: 1.0,
        ..JointState::reported(0.0, 0.0, 1.0)
    };
    jump(columns, &vec![1.0; columns.len()], &state) > 0.0
}

/// Half of what a joint's torque jumps by when it turns round, N m: its dry friction, whichever effects make it.
fn jump(columns: &[Column], theta: &[f64], state: &JointState<f64>) -> f64 {
    let towards = |sign: f64| {
        let state = JointState {
            speed: sign * state.speed_noise,
            ..*state
        };
        let rate = |(column, value): (&Column, &f64)| match *column {
            Column::Own {
                effect, shape, n, ..
            } => value * effect.terms(&state, shape)[n].rate,
            _ => 0.0,
        };
        columns.iter().zip(theta).map(rate).sum::<f64>()
    };
    (0.5 * (towards(1.0) - towards(-1.0))).abs()
}

/// Whitens one joint's rows: the band Cholesky factor of a tridiagonal covariance, row by row (Golub & Van Loan §4.3).
#[derive(Debug, Clone, Default)]
struct Chain {
    /// Where the row before ended.
    end: Option<usize>,
    pivot: f64,
    row: Vec<f64>,
}

impl Chain {
    /// Makes of the row of a window from sample `first` to `last` one whose noise is independent of those before.
    fn next(&mut self, [first, last]: [usize; 2], correlation: f64, row: &mut [f64]) {
        let mut pivot = 1.0;
        if self.end == Some(first) {
            let share = correlation / self.pivot;
            pivot -= correlation * share;
            for (x, before) in row.iter_mut().zip(&self.row) {
                *x -= share * before;
            }
        }
        (self.end, self.pivot) = (Some(last), pivot);
        self.row.clear();
        self.row.extend_from_slice(row);
        let scale = pivot.sqrt().recip();
        row.iter_mut().for_each(|x| *x *= scale);
    }

    /// Weighs a row whose own doubt is so many times the noise.
    fn alone(&mut self, doubt: f64, row: &mut [f64]) {
        self.end = None;
        let scale = doubt.hypot(1.0).recip();
        row.iter_mut().for_each(|x| *x *= scale);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Σ (whitened row)ᵀ (whitened row) must be Xᵀ C⁻¹ X, C that of rows of which some turn round, with a gap in time.
    #[test]
    fn whitened_rows_have_the_information_of_generalised_least_squares() {
        const ROWS: usize = 30;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let rho = -0.43;
        let x = DMatrix::from_fn(ROWS, 3, |_, _| random.random_range(-1.0..1.0));
        let turns = |k: usize| k % 7 == 3;
        let covariance = DMatrix::from_fn(ROWS, ROWS, |i: usize, j: usize| match i.abs_diff(j) {
            0 if turns(i) => 1.0 + 1.5 * 1.5,
            0 => 1.0,
            1 if i.max(j) != 16 && !turns(i) && !turns(j) => rho,
            _ => 0.0,
        });
        let wanted = x.transpose() * covariance.try_inverse().unwrap() * &x;
        let (mut chain, mut sum) = (Chain::default(), DMatrix::zeros(3, 3));
        for k in 0..ROWS {
            let gap = usize::from(k >= 16);
            let mut row: Vec<f64> = x.row(k).iter().copied().collect();
            match turns(k) {
                true => chain.alone(1.5, &mut row),
                false => chain.next([10 * k + gap, 10 * (k + 1) + gap], rho, &mut row),
            }
            let row = DVector::from_vec(row);
            sum += &row * row.transpose();
        }
        assert!((sum - wanted).amax() < 1e-10);
    }
}
