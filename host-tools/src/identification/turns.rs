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
use crate::criticism::rows::{MOST_REST, REST};
use crate::criticism::whitening::Whitening;
use crate::criticism::windows::Window;

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
    let mut chains = Whitening::of_joints(&criticism.correlation);
    let mut row = Vec::new();
    for window in windows.iter() {
        for (joint, chain) in chains.iter_mut().enumerate() {
            if window.moves[joint] {
                let doubt = doubt(criticism, &window, joint, &theta[joint]);
                row.clear();
                row.extend_from_slice(window.row(joint));
                match doubt {
                    Some(doubt) => chain.alone(doubt / criticism.fit.noise[joint], &mut row),
                    None => chain.whiten(window.samples, &mut row),
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
