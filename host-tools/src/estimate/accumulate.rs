//! A limb's rows, weighed as their noise is and folded into factors.
//!
//! Neighbours are whitened for the edge that they share ([`super::whitening`]), and those in which a joint turns round are weighed by
//! what is not known of its friction meanwhile. Evenly likely between the two limits for the share of a window in which nothing is known of it
//! ([`Motion::turning`]), the friction's standard deviation is jump × share / √3; such a row stands alone, and the chain of correlated
//! rows starts anew after it.

use super::blocks::BlockFactors;
use super::factor::{BATCH, HeapFactor};
use super::limb_data::LimbData;
use super::whitening::Whitening;
use crate::equation::column::{Column, Columns};
use crate::equation::motion::Motion;
use crate::equation::reversal::DryFriction;
use crate::equation::rows::Rows;
use crate::parallel::by_number;

/// What is folded, and what is known of its noise.
pub(crate) struct Folding<'a> {
    pub(crate) data: &'a LimbData<'a>,
    pub(crate) columns: &'a Columns,
    pub(crate) rows: &'a Rows,
    /// Tells the friction that jumps where a joint turns.
    pub(crate) theta: &'a [f64],
    /// Of each joint's neighbouring windows.
    pub(crate) correlation: &'a [f64],
    /// Of each joint, N m.
    pub(crate) noise: &'a [f64],
}

/// How rows are weighed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Weights {
    /// Of each joint, the correlation of the noise of neighbouring windows.
    pub(crate) correlation: Vec<f64>,
    /// Of each window and joint, by how many times its noise more a row is in doubt.
    doubt: Vec<f64>,
}

impl Folding<'_> {
    /// Fold by fold, of the windows that are chosen.
    pub(crate) fn folds(&self, chosen: &(dyn Fn(usize) -> bool + Sync)) -> BlockFactors {
        let (columns, rows) = (self.columns, self.rows);
        self.weights().folds(self.data, columns, rows, chosen)
    }

    /// What is known of the noise, as weights.
    pub(crate) fn weights(&self) -> Weights {
        let (data, n) = (self.data, self.data.joints());
        let own = self.columns.combined(self.theta);
        let friction = DryFriction {
            motion: &data.motion,
            columns: self.columns,
            numbers: &own,
        };
        let mut doubt = vec![0.0; n * data.motion.windows.len()];
        for (w, window) in data.motion.windows.iter().enumerate() {
            for j in (0..n).filter(|&j| data.counts(w, j)) {
                let (columns, own) = (&self.columns.of_joint[j], &own[j]);
                let rest = friction.jump(window, j) * Motion::turning(window) / 3f64.sqrt();
                let excess = excess(columns, own, self.rows.row(w, j));
                doubt[w * n + j] = rest.max(excess) / self.noise[j];
            }
        }
        Weights {
            correlation: self.correlation.to_vec(),
            doubt,
        }
    }
}

impl Weights {
    /// Rows as they are.
    pub(crate) fn none(data: &LimbData) -> Self {
        Self {
            correlation: vec![0.0; data.joints()],
            doubt: vec![0.0; data.torque.len()],
        }
    }

    /// By how many times its noise more each of a joint's windows that count is in doubt, in their order.
    pub(crate) fn doubt(&self, data: &LimbData, joint: usize) -> Vec<f64> {
        let windows = (0..data.motion.windows.len()).filter(|w| data.counts(*w, joint));
        windows
            .map(|w| self.doubt[w * data.joints() + joint])
            .collect()
    }

    /// Rows block by block of time.
    pub(crate) fn blocks(&self, data: &LimbData, columns: &Columns, rows: &Rows) -> BlockFactors {
        let windows = &data.motion.windows;
        let part = |w: usize| windows[w].block;
        self.parts(data, columns, rows, data.blocks.count(), &part, &|_| true)
    }

    /// Rows fold by fold, of the windows that are chosen.
    pub(crate) fn folds(
        &self,
        data: &LimbData,
        columns: &Columns,
        rows: &Rows,
        chosen: &(dyn Fn(usize) -> bool + Sync),
    ) -> BlockFactors {
        let part = |w: usize| data.fold(w);
        self.parts(data, columns, rows, data.blocks.folds, &part, chosen)
    }

    /// All rows.
    pub(crate) fn together(
        &self,
        data: &LimbData,
        columns: &Columns,
        rows: &Rows,
    ) -> Vec<HeapFactor> {
        let all = self.parts(data, columns, rows, 1, &|_| 0, &|_| true);
        all.blocks.into_iter().flatten().collect()
    }

    fn parts(
        &self,
        data: &LimbData,
        columns: &Columns,
        rows: &Rows,
        count: usize,
        part: &(dyn Fn(usize) -> usize + Sync),
        chosen: &(dyn Fn(usize) -> bool + Sync),
    ) -> BlockFactors {
        let of = |j: usize| self.joint(data, (columns, rows, j), count, part, chosen);
        let joints: Vec<Vec<HeapFactor>> = by_number(0..data.joints(), of);
        let mut blocks: Vec<Vec<HeapFactor>> = vec![Vec::new(); count];
        for factors in joints {
            for (block, factor) in blocks.iter_mut().zip(factors) {
                block.push(factor);
            }
        }
        BlockFactors { blocks }
    }

    /// A joint's factor of each part.
    fn joint(
        &self,
        data: &LimbData,
        (columns, rows, j): (&Columns, &Rows, usize),
        count: usize,
        part: &dyn Fn(usize) -> usize,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Vec<HeapFactor> {
        let width = columns.of_joint[j].len() + 1;
        let mut factors = vec![HeapFactor::new(width - 1); count];
        let mut chain = Whitening::new(self.correlation[j]);
        // Parts are stretches of time: their rows come one after the other.
        let (mut batch, mut of): (Vec<f64>, usize) = (Vec::new(), 0);
        for (w, window) in data.motion.windows.iter().enumerate() {
            if !data.counts(w, j) || !chosen(w) {
                continue;
            }
            if batch.len() >= BATCH * width || part(w) != of {
                factors[of].fold(&mut batch);
                batch.clear();
                of = part(w);
            }
            let first = batch.len();
            batch.extend_from_slice(rows.row(w, j));
            batch.push(data.torque[w * data.joints() + j]);
            let row = &mut batch[first..];
            match self.doubt[w * data.joints() + j] {
                doubt if doubt > 0.0 => chain.alone(doubt, row),
                _ => chain.whiten(window.samples, row),
            }
            // A recording's numbers are finite; a row that overflows is left out.
            if !row.iter().all(|x| x.is_finite()) {
                batch.truncate(first);
            }
        }
        if let Some(last) = factors.get_mut(of) {
            last.fold(&mut batch);
        }
        factors
    }
}

/// What a drive at its limit is told to give beyond it, N m: on average known, in one window anything (an exponential variable's deviation
/// is its mean).
fn excess(columns: &[Column], numbers: &[f64], row: &[f64]) -> f64 {
    let of = |((column, value), x): ((&Column, &f64), &f64)| match column {
        Column::Own { effect, .. } if effect.description().is_limit() => (value * x).abs(),
        _ => 0.0,
    };
    columns.iter().zip(numbers).zip(row).map(of).sum()
}
