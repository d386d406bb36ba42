//! The data of a limb as triangles, per block of time: one for each group of rows that share a noise.

use std::sync::Arc;

pub(crate) use proprio_solve::group::{Group, stacked, weighed};

use super::blocks::BlockFactors;
use super::factor::HeapFactor;
use crate::equation::column::Columns;

/// \[block\] \[group\].
#[derive(Debug, Clone)]
pub(crate) struct Groups {
    pub(crate) blocks: Vec<Vec<Group>>,
}

impl Groups {
    /// The momentum equation's: a group per joint.
    pub(crate) fn of_factors(columns: &Columns, factors: BlockFactors) -> Self {
        let places = |joint: usize| {
            let place = |entry: usize| columns.place(joint, entry);
            Arc::new((0..columns.entries.len()).map(place).collect::<Vec<_>>())
        };
        let places: Vec<_> = (0..columns.joints()).map(places).collect();
        let group =
            |(factor, places): (HeapFactor, &Arc<Vec<_>>)| Group::new(factor, places.clone());
        let block = |block: Vec<HeapFactor>| {
            block
                .into_iter()
                .zip(&places)
                .map(group)
                .collect::<Vec<_>>()
        };
        Self {
            blocks: factors.blocks.into_iter().map(block).collect(),
        }
    }

    /// The groups of all chosen blocks together.
    pub(crate) fn sum(&self, chosen: impl Fn(usize) -> bool) -> Vec<Group> {
        let groups = self.blocks.first().map_or(0, Vec::len);
        let of = |group: usize| {
            let parts = (0..self.blocks.len()).filter(|&b| chosen(b));
            let sum = Group::sum(parts.map(|b| &self.blocks[b][group]));
            sum.unwrap_or_else(|| self.blocks[0][group].without_rows())
        };
        (0..groups).map(of).collect()
    }

    /// Of each of so many folds the groups of all others' blocks.
    pub(crate) fn without_each(
        &self,
        folds: usize,
        fold: impl Fn(usize) -> usize,
    ) -> Vec<Vec<Group>> {
        let own: Vec<Vec<Group>> = (0..folds).map(|f| self.sum(|b| fold(b) == f)).collect();
        let own = Self { blocks: own };
        (0..folds).map(|f| own.sum(|other| other != f)).collect()
    }
}
