//! Long recordings, thinned to pieces that are spread evenly over time, so that memory does not grow with their length.
//!
//! Of every 2ⁿ pieces that follow one another one is kept, which one is drawn: a log that repeats its motion, as designed ones do, would
//! show the same part of it again and again to pieces in equal steps (a chirp of 20 s in steps of 128 s five parts of ten). Two groups that
//! become one keep the piece of one of them: as a log grows nothing is read again.

use super::{LimbRecording, MOST_SAMPLES, PIECE_US};
use crate::model::Limb;

/// Which pieces of time are kept: one of 2ⁿ.
pub(super) struct Pieces {
    halvings: u32,
}

impl Pieces {
    pub(super) fn all() -> Self {
        Self { halvings: 0 }
    }

    /// Whether a moment of the recording lies in a piece that is kept.
    pub(super) fn keep(&self, time_us: u64) -> bool {
        let piece = time_us / PIECE_US;
        (1..=self.halvings).all(|n| (piece >> (n - 1)) & 1 == coin(piece >> n, n))
    }

    /// Keeps one of two pieces where more is held than may be.
    pub(super) fn thin(&mut self, limbs: &mut [(Limb, LimbRecording)]) {
        if limbs.iter().any(|(_, limb)| limb.len() > MOST_SAMPLES) {
            self.halvings += 1;
            limbs
                .iter_mut()
                .for_each(|(_, limb)| limb.keep(|time_us| self.keep(time_us)));
        }
    }

    /// What a user should know of it.
    pub(super) fn warning(&self, duration: f64) -> Option<String> {
        let piece = PIECE_US as f64 * 1e-6;
        (self.halvings > 0).then(|| {
            format!(
                "of {duration:.0} s, {piece:.0} s in every {:.0} s are used for fits and plots, spread evenly over time; --only 't < 60' uses all of a part",
                piece * 2f64.powi(self.halvings as i32)
            )
        })
    }
}

/// Which half of a group of 2ⁿ pieces keeps its piece, 0 or 1: a bit of the group's number, mixed (the finaliser of SplitMix64: Steele, Lea &
/// Flood 2014, *Fast splittable pseudorandom number generators*, section 4), so that the same log is always thinned to the same.
fn coin(group: u64, n: u32) -> u64 {
    let mut x = (group ^ (u64::from(n) << 58)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 31)) & 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    #[test]
    fn what_is_held_is_bounded_and_spread_evenly() {
        let mut pieces = Pieces::all();
        let limb = Model::default().robot().limbs().swap_remove(0);
        let recording = LimbRecording {
            joints: 1,
            ..LimbRecording::default()
        };
        let mut limbs = [(limb, recording)];
        let (samples, step) = (4 * MOST_SAMPLES as u64, 2_000);
        for k in 0..samples {
            if pieces.keep(k * step) {
                let x = [k as f64];
                limbs[0]
                    .1
                    .push(k * step, [&x, &x, &x, &x, &[]], x[0], false);
            }
            pieces.thin(&mut limbs);
        }
        let held = &limbs[0].1;
        assert!(held.len() > MOST_SAMPLES / 2 && held.len() <= MOST_SAMPLES);
        // One piece of each group is held, whole.
        let group = PIECE_US << pieces.halvings;
        let groups = (samples * step).div_ceil(group);
        for n in 0..groups {
            let of_group = || held.time_us.iter().filter(|&&t| t / group == n);
            let piece = of_group().next().unwrap() / PIECE_US;
            assert_eq!(of_group().count() as u64, PIECE_US / step);
            assert!(of_group().all(|t| t / PIECE_US == piece));
        }
        assert!(pieces.warning(1e3).is_some() && Pieces::all().warning(1e3).is_none());
    }

    /// A motion of so many pieces, repeated for hours: each part of it is kept about as often as any other.
    #[test]
    fn all_parts_of_a_motion_that_repeats_are_kept() {
        for period in [2, 3, 4, 8, 10, 16, 30] {
            for halvings in 1..=6 {
                let pieces = Pieces { halvings };
                let mut kept = vec![0.0; period];
                let all = (0..64 * 100).filter(|piece| pieces.keep(piece * PIECE_US));
                all.for_each(|piece| kept[piece as usize % period] += 1.0);
                let expected = kept.iter().sum::<f64>() / period as f64;
                let far = 5.0 * expected.sqrt();
                assert!(
                    kept.iter().all(|n| (n - expected).abs() < far),
                    "{period} {halvings} {kept:?}"
                );
            }
        }
    }
}
