//! One factor per block of time and joint: from here on the data are not needed (design.md §3).

use proprio_core::factor::{Factor, packed_len};

use super::column::Columns;
use super::rows::Limb;
use super::whitening::Whitening;

/// A factor whose numbers lie on the heap.
pub(crate) type HeapFactor = Factor<f64, Vec<f64>>;

/// Of each block of time, a factor per joint.
pub(crate) struct BlockFactors {
    /// Of whitened rows: what fits and tests are made with.
    pub(crate) blocks: Vec<Vec<HeapFactor>>,
    /// Of the rows as they are: their sums of squares are errors in N m.
    pub(crate) plain: Vec<Vec<HeapFactor>>,
}

/// An empty factor.
pub(crate) fn empty(columns: usize) -> HeapFactor {
    Factor::in_storage(columns, vec![0.0; packed_len(columns)])
        .expect("the storage has the length asked for")
}

impl BlockFactors {
    /// Folds in the windows of a limb, the noise of whose joints has this correlation from window to window.
    pub(crate) fn of(limb: &Limb, correlation: &[f64]) -> Self {
        let none = || {
            limb.columns
                .of_joint
                .iter()
                .map(|c| empty(c.len()))
                .collect()
        };
        let mut blocks: Vec<Vec<HeapFactor>> = (0..limb.blocks.count).map(|_| none()).collect();
        let mut plain = blocks.clone();
        let mut whitening: Vec<Whitening> =
            correlation.iter().map(|&c| Whitening::new(c)).collect();
        let mut buffer = Vec::new();
        limb.for_each_window(|window| {
            let Some(block) = window.block else { return };
            for joint in 0..window.rows.len() {
                if !window.moves[joint] {
                    continue;
                }
                // A recording's numbers are finite; a row that overflows is left out.
                buffer.clone_from(&window.rows[joint]);
                let _ = plain[block][joint].update(&mut buffer);
                buffer.clone_from(&window.rows[joint]);
                whitening[joint].whiten(window.samples, &mut buffer);
                let _ = blocks[block][joint].update(&mut buffer);
            }
        });
        Self { blocks, plain }
    }
}

/// The sum of some blocks' factors.
pub(crate) fn sum(
    blocks: &[Vec<HeapFactor>],
    columns: &Columns,
    chosen: impl Fn(usize) -> bool,
) -> Vec<HeapFactor> {
    let mut sums: Vec<HeapFactor> = columns.of_joint.iter().map(|c| empty(c.len())).collect();
    for (_, block) in blocks.iter().enumerate().filter(|(b, _)| chosen(*b)) {
        for (sum, factor) in sums.iter_mut().zip(block) {
            let mut scratch = vec![0.0; factor.columns() + 1];
            // Same columns and finite numbers: cannot fail.
            let _ = sum.merge(factor, |c| c, 1.0, &mut scratch);
        }
    }
    sums
}
