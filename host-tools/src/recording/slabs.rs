//! A log of any length, cut into recordings that follow one another: what is made of each is kept, the samples are not.
//!
//! Memory is that of one slab. Nothing is thinned: all of a log counts.

use std::path::Path;

use super::{LimbRecording, MOST_SAMPLES, Pass, Pieces, Recording, RecordingError};
use crate::model::{Limb, Model};

/// Shortest slab, s: a shorter rest of a log has too few windows to weigh its rows by.
pub(crate) const SHORTEST: f64 = 2.0;

/// A part of a log.
pub(crate) struct Slab {
    /// The block of time that it lies in, counted from the log's start.
    pub(crate) block: u64,
    /// Its samples, limb by limb; times are those since the log's start, µs.
    pub(crate) limbs: Vec<(Limb, LimbRecording)>,
}

/// Cuts what a pass has read.
pub(super) struct Cutter<'a> {
    /// Length of a block of time, µs; no slab reaches across its end.
    block_us: u64,
    /// The present block.
    block: u64,
    /// Stamp of the log's first row, s.
    pub(super) first: f64,
    each: &'a mut dyn FnMut(Slab),
}

impl Cutter<'_> {
    /// Gives away the slab that a row at `time_us` does not belong to; whether there was one to end.
    pub(super) fn cut(&mut self, time_us: u64, limbs: &mut [(Limb, LimbRecording)]) -> bool {
        let block = time_us / self.block_us;
        let is_full = limbs.iter().any(|(_, limb)| limb.len() >= MOST_SAMPLES);
        if block == self.block && !is_full {
            return false;
        }
        self.end(limbs);
        self.block = block;
        true
    }

    /// Gives away what is there.
    pub(super) fn end(&mut self, limbs: &mut [(Limb, LimbRecording)]) {
        let whole = limbs.iter_mut().map(|(limb, samples)| {
            let empty = LimbRecording {
                joints: samples.joints,
                ..LimbRecording::default()
            };
            (limb.clone(), std::mem::replace(samples, empty))
        });
        let is_long = |samples: &LimbRecording| {
            let ends = samples.time_us.first().zip(samples.time_us.last());
            ends.is_some_and(|(first, last)| 1e-6 * (last - first) as f64 >= SHORTEST)
        };
        let limbs: Vec<_> = whole.filter(|(_, samples)| is_long(samples)).collect();
        if !limbs.is_empty() {
            let block = self.block;
            (self.each)(Slab { block, limbs });
        }
    }
}

impl Recording {
    /// Reads a log of the robot of `model` and hands it on slab by slab, none longer than [`MOST_SAMPLES`] or than what is left of a block of
    /// `block` seconds. `progress` receives the bytes read and how many there are in all. The result is the stamp of the log's first row, s, and
    /// the recording without samples: its length, gates and warnings.
    ///
    /// # Errors
    /// As [`read`](Self::read)'s, but for a log that is too short: that has no slab.
    pub(crate) fn in_slabs(
        log: &Path,
        model: &Model,
        block: f64,
        each: &mut dyn FnMut(Slab),
        mut progress: impl FnMut(u64, u64),
    ) -> Result<(f64, Self), RecordingError> {
        let mut pass = Pass {
            model,
            recording: Self::of_logs(&[log.to_owned()]),
            pieces: Pieces::all(),
            offset_us: 0,
            too_large: Vec::new(),
            cutter: Some(Cutter {
                block_us: ((1e6 * block) as u64).max(1),
                block: 0,
                first: 0.0,
                each,
            }),
        };
        pass.read(log, &mut progress)?;
        let first = pass.cutter.map_or(0.0, |cutter| cutter.first);
        let left_out = pass.too_large.iter().map(super::left_out);
        let mut recording = pass.recording;
        recording.warnings.extend(left_out);
        Ok((first, recording))
    }
}
