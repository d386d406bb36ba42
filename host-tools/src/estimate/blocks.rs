//! One factor per block of time and joint: from here on the data are not needed (design.md §3).

use super::factor::HeapFactor;
use crate::equation::column::Columns;

/// Of each block of time, or of each fold, a factor of whitened rows per joint.
pub(crate) struct BlockFactors {
    pub(crate) blocks: Vec<Vec<HeapFactor>>,
}

/// Empty factors of all joints.
fn nothing(columns: &Columns) -> Vec<HeapFactor> {
    let of = |own: &Vec<_>| HeapFactor::new(own.len());
    columns.of_joint.iter().map(of).collect()
}

/// Folds factors of the same columns into others.
fn merge(sums: &mut [HeapFactor], factors: &[HeapFactor]) {
    for (sum, factor) in sums.iter_mut().zip(factors) {
        sum.merge(factor);
    }
}

impl BlockFactors {
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
            let mut factor = HeapFactor::new(width);
            for k in (0..rows.len()).filter(|&k| chosen(k % 5)) {
                factor.fold(&mut rows[k].clone());
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
