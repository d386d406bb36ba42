//! A log of any length, cut into recordings that follow one another: what is made of each is kept, the samples are not.
//!
//! Memory is that of one slab. Nothing is thinned: all of a log counts.

use std::path::PathBuf;
use std::sync::mpsc;

use super::{LimbRecording, MOST_SAMPLES, Pass, Recording, RecordingError};
use crate::model::{Limb, Model};

/// Shortest slab, s: a shorter rest of a log has too few windows to weigh its rows by.
pub(crate) const SHORTEST: f64 = 2.0;

/// A part of a log.
pub(crate) struct Slab {
    /// Which of the logs.
    pub(crate) log: usize,
    /// The block of time that it lies in, counted from the log's start.
    pub(crate) block: u64,
    /// Its samples, limb by limb; times are those of the recording of all logs, µs.
    pub(crate) limbs: Vec<(Limb, LimbRecording)>,
}

/// Cuts what a pass has read.
pub(super) struct Cutter<'a> {
    /// Length of a block of time, µs; no slab reaches across its end.
    block_us: u64,
    /// The present log.
    log: usize,
    /// Its present block.
    block: u64,
    /// Stamp of each log's first row, s.
    pub(super) firsts: Vec<f64>,
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

    /// The end of a log, whose first row is of `first`, s.
    pub(super) fn end_log(&mut self, first: f64, limbs: &mut [(Limb, LimbRecording)]) {
        self.end(limbs);
        self.firsts.push(first);
        self.log += 1;
        self.block = 0;
    }

    /// Gives away what is there.
    fn end(&mut self, limbs: &mut [(Limb, LimbRecording)]) {
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
            let (log, block) = (self.log, self.block);
            (self.each)(Slab { log, block, limbs });
        }
    }
}

impl Recording {
    /// Reads logs of the robot of `model`, one after the other, and hands them on slab by slab, none longer than [`MOST_SAMPLES`] or than what is
    /// left of a block of `block` seconds; the next one is read while `each` works. `progress` receives the bytes read of a log and how many it has
    /// in all. The result is the stamp of each log's first row, s, and the recording without samples: its length, gates and warnings.
    ///
    /// # Errors
    /// As [`read`](Self::read)'s, but for a log that is too short: that has no slab.
    pub(crate) fn in_slabs(
        logs: &[PathBuf],
        model: &Model,
        block: f64,
        each: &mut (dyn FnMut(Slab) + Send),
        mut progress: impl FnMut(u64, u64),
    ) -> Result<(Vec<f64>, Self), RecordingError> {
        let (firsts, mut recording, too_large) = std::thread::scope(|scope| {
            // Nothing waits between the two, so that memory is that of a slab which is read and of one that is worked on.
            let (whole, slabs) = mpsc::sync_channel(0);
            scope.spawn(move || slabs.into_iter().for_each(each));
            let mut hand_on = |slab| {
                // Where nobody takes it `each` has panicked, which the scope passes on.
                let _ = whole.send(slab);
            };
            let mut pass = Pass {
                cutter: Some(Cutter {
                    block_us: ((1e6 * block) as u64).max(1),
                    log: 0,
                    block: 0,
                    firsts: Vec::new(),
                    each: &mut hand_on,
                }),
                ..Pass::new(logs, model)
            };
            for log in logs {
                pass.read(log, &mut progress)?;
            }
            let firsts = pass.cutter.map_or(Vec::new(), |cutter| cutter.firsts);
            Ok::<_, RecordingError>((firsts, pass.recording, pass.too_large))
        })?;
        recording
            .warnings
            .extend(too_large.iter().map(super::left_out));
        Ok((firsts, recording))
    }
}
