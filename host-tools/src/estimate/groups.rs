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
        // What comes after each fold and what comes before it: none is merged more than twice.
        let both = |a: &[Group], b: &[Group]| -> Vec<Group> {
            let pairs = a.iter().zip(b);
            let sum = |(a, b): (&Group, &Group)| {
                let told = [a, b].into_iter().filter(|rows| rows.count() > 0.0);
                Group::sum(told).unwrap_or_else(|| a.without_rows())
            };
            pairs.map(sum).collect()
        };
        let nothing = || own.iter().take(1).flatten().map(Group::without_rows);
        let mut after: Vec<Vec<Group>> = vec![nothing().collect()];
        for fold in own.iter().skip(1).rev() {
            after.push(both(&after[after.len() - 1], fold));
        }
        let mut before: Vec<Group> = nothing().collect();
        let mut without = Vec::new();
        for (fold, rest) in own.iter().zip(after.iter().rev()) {
            without.push(both(rest, &before));
            before = both(&before, fold);
        }
        without
    }
}
