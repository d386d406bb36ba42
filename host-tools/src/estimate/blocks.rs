//! One factor per block of time and joint: from here on the data are not needed (design.md §3).

use proprio_core::factor::{Factor, packed_len};

use crate::equation::column::Columns;

/// A factor whose numbers lie on the heap.
pub(crate) type HeapFactor = Factor<f64, Vec<f64>>;

/// Of each block of time, or of each fold, a factor of whitened rows per joint.
pub(crate) struct BlockFactors {
    pub(crate) blocks: Vec<Vec<HeapFactor>>,
}

/// An empty factor.
pub(crate) fn empty(columns: usize) -> HeapFactor {
    Factor::in_storage(columns, vec![0.0; packed_len(columns)])
        .expect("the storage has the length asked for")
}

/// Empty factors of all joints.
fn nothing(columns: &Columns) -> Vec<HeapFactor> {
    columns.of_joint.iter().map(|c| empty(c.len())).collect()
}

/// Folds factors of the same columns into others.
fn merge(sums: &mut [HeapFactor], factors: &[HeapFactor]) {
    for (sum, factor) in sums.iter_mut().zip(factors) {
        let mut scratch = vec![0.0; factor.columns() + 1];
        // Same columns and finite numbers: cannot fail.
        let _ = sum.merge(factor, |c| c, 1.0, &mut scratch);
    }
}

impl BlockFactors {
    /// `count` blocks without data.
    pub(crate) fn none(columns: &Columns, count: usize) -> Self {
        Self {
            blocks: (0..count).map(|_| nothing(columns)).collect(),
        }
    }

    /// Folds a row, the right-hand side last, into a joint's factor of a block; the row is used up.
    pub(crate) fn fold(&mut self, block: usize, joint: usize, row: &mut [f64]) {
        // A recording's numbers are finite; a row that overflows is left out.
        let _ = self.blocks[block][joint].update(row);
    }

    /// Merges factors of the same columns into a block.
    pub(crate) fn merge(&mut self, block: usize, factors: &[HeapFactor]) {
        merge(&mut self.blocks[block], factors);
    }

    /// Of each block, the sum of all others; and the sum of all.
    pub(crate) fn without_each(
        &self,
        columns: &Columns,
    ) -> (Vec<Vec<HeapFactor>>, Vec<HeapFactor>) {
        // What comes after each block and what comes before it: no block is merged more than twice.
        let mut after = vec![nothing(columns)];
        for block in self.blocks.iter().skip(1).rev() {
            let mut sum = after[after.len() - 1].clone();
            merge(&mut sum, block);
            after.push(sum);
        }
        let (mut before, mut without) = (nothing(columns), Vec::new());
        for (block, mut rest) in self.blocks.iter().zip(after.into_iter().rev()) {
            merge(&mut rest, &before);
            without.push(rest);
            merge(&mut before, block);
        }
        (without, before)
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn the_sum_without_a_block_is_that_of_all_others_rows() {
        let columns = Columns::new(vec![1], Vec::new());
        let width = columns.of_joint[0].len();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut row = || -> Vec<f64> {
            let number = |_| f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5;
            (0..=width).map(number).collect()
        };
        let rows: Vec<Vec<f64>> = (0..100).map(|_| row()).collect();
        let theta = row();
        let fold = |chosen: &dyn Fn(usize) -> bool| {
            let mut factor = empty(width);
            for k in (0..rows.len()).filter(|&k| chosen(k % 5)) {
                factor.update(&mut rows[k].clone()).unwrap();
            }
            factor
        };
        let factors = BlockFactors {
            blocks: (0..5).map(|b| vec![fold(&|of| of == b)]).collect(),
        };
        let (without, all) = factors.without_each(&columns);
        let same = |a: &HeapFactor, b: &HeapFactor| {
            let (x, y) = (a.sum_of_squares(&theta), b.sum_of_squares(&theta));
            assert!((x - y).abs() < 1e-10 * y && a.rows() == b.rows(), "{x} {y}");
        };
        same(&all[0], &fold(&|_| true));
        for (b, sum) in without.iter().enumerate() {
            same(&sum[0], &fold(&|of| of != b));
        }
        assert_eq!(without.len(), 5);
    }
}
