//! How surely a fit's values are known: by the data, beside what shapes and the model leave open, and what values differ by from stretch to
//! stretch.

use proprio_core::effect::{EffectKind, Transmission};

use super::between_blocks::Spread;
use super::deviation::{BlockScore, Deviations};
use super::fit::{LimbFit, found_by_trying};
use crate::once::made_once;

/// Standard deviation of a gap, as a share of it, for not knowing how a link bounces within it: on six simulated logs with gaps
/// of 2 to 15 mrad the gaps found were 9 to 25 % off, 17 % rms, of which samples' share is apart; on fourteen by MuJoCo of 250 to 1000 Hz, with
/// gaps of 2 to 44 mrad, 2 to 50 %, 20 % rms. Hips with 20 mrad, 52 and 68 %, this does not cover.
const BOUNCE: f64 = 0.15;

/// The same of a compliance, for not knowing how a link's swing dies away: on nine simulated logs with springs of 40 to 1000 N m/rad the
/// compliances found were 1 to 20 % off, 9 % rms.
const SWING: f64 = 0.09;

impl LimbFit<'_> {
    /// How surely the parameters are known by the data.
    pub(crate) fn deviations(&self) -> &Deviations {
        let made = || {
            let scores: Vec<BlockScore> = self.block_scores().map(|(_, score)| score).collect();
            Deviations::of(&self.problem, &self.solution, &scores)
        };
        made_once(&self.deviations, made)
    }

    /// By how much the parameters differ from stretch to stretch.
    pub(crate) fn spread(&self) -> &Spread {
        let made = || {
            let solved = (&self.problem, &self.solution);
            let (blocks, scores) = (&self.data.blocks, self.block_scores());
            Spread::of(solved, blocks, scores, self.deviations())
        };
        made_once(&self.spread, made)
    }

    /// Standard deviation of entry k's value, as the catalogue means it, all told.
    pub(crate) fn std(&self, entry: usize) -> f64 {
        let [independent, blocks] = self.deviations().of_parameter(entry);
        let known = independent.max(blocks).hypot(self.unknown(entry));
        known.hypot(self.spread().of_parameter(entry))
    }

    /// Whether entry k is a gap: a torque is too far from linear in it for a column to tell more than how surely it is known.
    pub(crate) fn is_found_by_trying(&self, entry: usize) -> bool {
        let entry = &self.columns.entries[entry];
        (entry.effect).is_some_and(|effect| found_by_trying(effect, entry.joint, &self.at))
    }

    /// What of entry k's value is open however well the others are known, one standard deviation: what the model leaves to chance, and
    /// what shapes that are not known exactly make of it.
    ///
    /// A spring or a play that comes out as none is as open as before the data: what noise of the motion does on a spring, or behind a play,
    /// grows with either, so that a log whose motion is noisy asks for none whatever is there.
    fn unknown(&self, entry: usize) -> f64 {
        let value = self.value(entry);
        let column = &self.columns.entries[entry];
        let transmission =
            |effect: EffectKind| Some((effect, effect.description().transmission()?));
        let own = match column.effect.and_then(transmission) {
            Some((effect, _)) if value <= 0.0 => {
                self.data.prior((effect, column.joint), column.parameter).1
            }
            Some((_, Transmission::Spring)) => SWING * value,
            Some((_, Transmission::Backlash)) => {
                (BOUNCE * value).hypot(self.landing(column.joint, value))
            }
            _ => 0.0,
        };
        own.hypot(self.moved_by_shapes(entry))
    }

    /// How surely samples tell a gap (rad) by when the link has crossed it: to period/√12, at the speed √(2 a gap) that the joint's usual
    /// acceleration a gives it on the way.
    fn landing(&self, joint: usize, gap: f64) -> f64 {
        let state = &self.data.motion.joint[joint].state;
        let square: f64 = state.iter().map(|state| state[2] * state[2]).sum();
        let acceleration = (square / (state.len().max(1) as f64)).sqrt();
        (2.0 * acceleration * gap).sqrt() * self.data.recording.period() / 12f64.sqrt()
    }
}
