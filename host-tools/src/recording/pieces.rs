//! Long recordings, thinned to pieces that are spread evenly over time, so that memory does not grow with their length.

use super::{LimbRecording, MOST_SAMPLES, PIECE_US};
use crate::model::Limb;

/// Which pieces of time are kept: one in so many.
pub(super) struct Pieces {
    every: u64,
}

impl Pieces {
    pub(super) fn all() -> Self {
        Self { every: 1 }
    }

    /// Whether a moment of the recording lies in a piece that is kept.
    pub(super) fn keep(&self, time_us: u64) -> bool {
        (time_us / PIECE_US).is_multiple_of(self.every)
    }

    /// Keeps every other piece where more is held than may be.
    pub(super) fn thin(&mut self, limbs: &mut [(Limb, LimbRecording)]) {
        if limbs.iter().any(|(_, limb)| limb.len() > MOST_SAMPLES) {
            self.every *= 2;
            limbs
                .iter_mut()
                .for_each(|(_, limb)| limb.keep(|time_us| self.keep(time_us)));
        }
    }

    /// What a user should know of it.
    pub(super) fn warning(&self, duration: f64) -> Option<String> {
        let piece = PIECE_US as f64 * 1e-6;
        (self.every > 1).then(|| {
            format!(
                "of {duration:.0} s, {piece:.0} s in every {:.0} s are judged, spread evenly over time; for all of it, cut \
                 the log into parts",
                piece * self.every as f64
            )
        })
    }
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
        // A piece is a stretch, and one follows another in equal steps.
        let starts: Vec<u64> = held.starts.iter().map(|&k| held.time_us[k]).collect();
        let steps: Vec<u64> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.iter().all(|step| *step == pieces.every * PIECE_US));
        assert!(held.time_us[held.len() - 1] + pieces.every * PIECE_US >= samples * step);
        assert!(pieces.warning(1e3).is_some() && Pieces::all().warning(1e3).is_none());
    }
}
