//! Windows with their rows, and all of a limb's, kept so that they are made but once.

use super::dot::dot;
use super::rows::Limb;

/// One closed window of a limb, within a block.
pub(crate) struct Window<'a> {
    /// Its middle, s since the recording's start.
    pub(crate) t: f64,
    /// Its block.
    pub(crate) block: usize,
    /// Whether each joint moves: rows of one at rest say nothing of friction.
    pub(crate) moves: &'a [bool],
    /// First and last sample.
    pub(crate) samples: [usize; 2],
    /// All joints' rows, one after the other.
    pub(super) rows: &'a [f64],
    /// Where each joint's row starts.
    pub(super) starts: &'a [usize],
}

impl Window<'_> {
    /// A joint's row: its columns, then the mean torque, N m.
    pub(crate) fn row(&self, joint: usize) -> &[f64] {
        &self.rows[self.starts[joint]..self.starts[joint + 1]]
    }

    /// A joint's columns and its mean torque, N m.
    pub(crate) fn equation(&self, joint: usize) -> (&[f64], f64) {
        match self.row(joint).split_last() {
            Some((torque, columns)) => (columns, *torque),
            None => (&[], 0.0),
        }
    }

    /// A joint's mean torque less what its columns times `theta` make of it, N m.
    pub(crate) fn residual(&self, joint: usize, theta: &[f64]) -> f64 {
        let (columns, torque) = self.equation(joint);
        torque - dot(columns, theta)
    }
}

/// The windows of a limb with their rows, so that they are made but once.
#[derive(Default)]
pub(crate) struct Windows {
    starts: Vec<usize>,
    rows: Vec<f64>,
    moves: Vec<bool>,
    /// Middle, block and samples.
    list: Vec<(f64, usize, [usize; 2])>,
}

impl Windows {
    pub(crate) fn of(limb: &Limb) -> Self {
        let mut windows = Self {
            starts: limb.starts(),
            ..Self::default()
        };
        limb.for_each_window(|window| {
            windows.rows.extend_from_slice(window.rows);
            windows.moves.extend_from_slice(window.moves);
            windows.list.push((window.t, window.block, window.samples));
        });
        windows
    }

    /// Writes what depends on the model so far anew: the columns of the torques' scales.
    pub(crate) fn follow(&mut self, limb: &Limb) {
        let joints = self.starts.len().saturating_sub(1);
        let width = self.starts.last().copied().unwrap_or(0);
        for rows in self.rows.chunks_exact_mut(width.max(1)) {
            for j in 0..joints {
                limb.write_scale(j, &mut rows[self.starts[j]..self.starts[j + 1]]);
            }
        }
    }

    /// How many.
    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    /// Window w, in the order of time.
    pub(crate) fn get(&self, w: usize) -> Window<'_> {
        let joints = self.starts.len().saturating_sub(1);
        let width = self.starts.last().copied().unwrap_or(0);
        let (t, block, samples) = self.list[w];
        Window {
            t,
            block,
            samples,
            moves: &self.moves[w * joints..(w + 1) * joints],
            rows: &self.rows[w * width..(w + 1) * width],
            starts: &self.starts,
        }
    }

    /// All, in the order of time.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Window<'_>> {
        (0..self.len()).map(|w| self.get(w))
    }
}
