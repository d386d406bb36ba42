//! How time is cut: into blocks, whose spread tells how well something is known, and blocks into folds, each of which is held out
//! in turn.
//!
//! A fold is a contiguous stretch, so that what is held out is not just like its neighbours. With several logs it is a log: what
//! one log asks for and another does not bear out is no effect of the robot's.

use crate::recording::LimbRecording;

/// Folds of a single log.
const FOLDS: usize = 8;
/// From so many logs on, each is a fold: with fewer the spread over them says little.
const LEAST_LOGS: usize = 4;
/// Most blocks, but for one for each log.
const MOST: u64 = 32;
/// Shortest block, µs.
const SHORTEST_US: u64 = 500_000;
/// The time that a log needs to be cut into folds, s.
pub(crate) const LEAST_HELD_OUT: f64 = 1e-6 * FOLDS as f64 * SHORTEST_US as f64;
/// Windows this soon after a block's start belong to none, µs: residuals remember that long.
const GUARD_US: u64 = 40_000;

/// The blocks of a limb's recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Blocks {
    blocks: Vec<Block>,
    /// How many folds there are.
    pub(crate) folds: usize,
    /// Whether each fold is a log.
    pub(crate) by_log: bool,
}

/// A stretch of time, µs since the recording's start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Block {
    start: u64,
    length: u64,
    /// Nothing goes on from before.
    is_first: bool,
    fold: usize,
}

impl Blocks {
    /// Cuts a recording; `None` if there is nothing in it.
    pub(crate) fn of(recording: &LimbRecording) -> Option<Self> {
        let begin = *recording.time_us.first()?;
        let end = *recording.time_us.last()?;
        let duration = end - begin;
        let by_log = recording.log_starts.len() >= LEAST_LOGS;
        let mut starts = vec![begin];
        if by_log {
            starts = (recording.log_starts.iter())
                .map(|t| *t.max(&begin))
                .collect();
        }
        let ends = starts.iter().skip(1).copied().chain([end]);
        let mut blocks = Vec::new();
        for (log, (&start, end)) in starts.iter().zip(ends).enumerate() {
            let share = (MOST * (end - start)).div_ceil(duration.max(1));
            let count = ((end - start) / SHORTEST_US).clamp(1, share.max(1));
            let length = (end - start) / count + 1;
            blocks.extend((0..count).map(|n| Block {
                start: start + n * length,
                length,
                is_first: n == 0,
                fold: log,
            }));
        }
        let count = blocks.len();
        let mut folds = starts.len();
        if !by_log {
            folds = FOLDS.min(count);
            for (n, block) in blocks.iter_mut().enumerate() {
                block.fold = n * folds / count;
            }
        }
        Some(Self {
            blocks,
            folds,
            by_log,
        })
    }

    /// How many blocks there are.
    pub(crate) fn count(&self) -> usize {
        self.blocks.len()
    }

    /// Whether there are folds enough to hold one out and judge what is said of it.
    pub(crate) fn can_hold_out(&self) -> bool {
        self.by_log || self.folds == FOLDS
    }

    /// Length of a block, s.
    pub(crate) fn length(&self) -> f64 {
        1e-6 * self.blocks.first().map_or(0, |block| block.length) as f64
    }

    /// The fold that a block belongs to.
    pub(crate) fn fold(&self, block: usize) -> usize {
        self.blocks[block].fold
    }

    /// The block of a window, if it has one; `start_us` and `end_us` since the recording's start.
    pub(crate) fn of_window(&self, start_us: u64, end_us: u64) -> Option<usize> {
        let after = self.blocks.partition_point(|block| block.start <= start_us);
        let block = self.blocks.get(after.checked_sub(1)?)?;
        let inside = block.is_first || start_us - block.start >= GUARD_US;
        (inside && end_us < block.start + block.length).then_some(after - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Logs of so many seconds, with a gap of one between them.
    fn recording(seconds: &[u64]) -> LimbRecording {
        let mut limb = LimbRecording::default();
        let mut start = 0;
        for length in seconds {
            limb.log_starts.push(start);
            limb.time_us
                .extend((0..=500 * length).map(|k| start + 2_000 * k));
            start += 1_000_000 * (length + 1);
        }
        limb
    }

    #[test]
    fn a_single_log_has_eight_folds_of_four_blocks() {
        let blocks = Blocks::of(&recording(&[20])).unwrap();
        assert_eq!(
            (blocks.count(), blocks.folds, blocks.by_log),
            (32, 8, false)
        );
        assert_eq!((blocks.fold(3), blocks.fold(4), blocks.fold(31)), (0, 1, 7));
        assert_eq!(blocks.of_window(0, 20_000), Some(0));
        assert_eq!(blocks.of_window(615_000, 635_000), None);
        assert_eq!(
            blocks.of_window(640_000, 660_000),
            None,
            "just after a block's start"
        );
        assert_eq!(blocks.of_window(670_000, 690_000), Some(1));
        assert!(blocks.can_hold_out());
        assert!(!Blocks::of(&recording(&[3])).unwrap().can_hold_out());
        assert_eq!(Blocks::of(&LimbRecording::default()), None);
    }

    #[test]
    fn each_of_several_logs_is_a_fold() {
        assert!(!Blocks::of(&recording(&[20, 20, 20])).unwrap().by_log);
        let blocks = Blocks::of(&recording(&[20, 1, 20, 40])).unwrap();
        assert!(blocks.by_log && blocks.can_hold_out());
        assert_eq!(blocks.folds, 4);
        let folds: Vec<usize> = (0..blocks.count())
            .map(|block| blocks.fold(block))
            .collect();
        assert!(folds.is_sorted());
        let of = |fold| folds.iter().filter(|f| **f == fold).count();
        assert!(of(0) >= 7 && of(1) == 1 && of(3) >= 14, "{folds:?}");
        // No guard where a log begins.
        let block = blocks.of_window(21_000_000, 21_020_000).unwrap();
        assert_eq!(blocks.fold(block), 1);
    }
}
