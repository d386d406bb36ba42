//! From blocks to what is kept of each robot's limb: the part of the work that engines spread over machines.
//!
//! Blocks stay blocks: nothing is added up but the folds of one. What comes out stands in one order, whatever the order in which blocks came and
//! whichever parts they came in, so that answers are the same to the bit.

use std::collections::BTreeMap;
use std::sync::Arc;

use proprio_solve::factor::HeapFactor;

use super::block::{Block, Key};
use super::columns::BlockColumns;

/// A robot's limb: all its blocks with the same columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// The robot.
    pub robot: String,
    /// What its numbers belong to.
    pub columns: Arc<BlockColumns>,
    /// Their hash.
    pub hash: Arc<str>,
    /// Its blocks, in order of time.
    pub blocks: Vec<KeptBlock>,
}

/// A limb in a block of time.
#[derive(Debug, Clone, PartialEq)]
pub struct KeptBlock {
    /// SHA-256 of the log.
    pub log: String,
    /// From when to when, s.
    pub time: [f64; 2],
    /// Of each joint its factors, fold by fold; empty where it has none.
    pub joints: Vec<Vec<(u32, HeapFactor)>>,
    /// Mean temperature of each joint's motor, °C, where recorded.
    pub temperature: Vec<Option<f64>>,
    /// Of each joint the root mean square that no value explains, N m.
    pub rms: Vec<f64>,
}

/// Robot, limb, hash.
type Group = (String, String, Arc<str>);

/// What is kept of admitted blocks ([`super::Gate`]), in any order; a block whose numbers do not fit its columns is left out.
pub fn partial(blocks: impl IntoIterator<Item = Block>) -> Vec<Kept> {
    let mut rows: Vec<(Key, Block)> = blocks.into_iter().map(|b| (b.key(), b)).collect();
    rows.sort_by(|(a, _), (b, _)| a.cmp(b));
    let mut groups: BTreeMap<Group, Kept> = BTreeMap::new();
    let mut places: BTreeMap<(Group, i64, String), usize> = BTreeMap::new();
    for (key, block) in rows {
        let Some(factor) = block.heap_factor() else {
            continue;
        };
        let group = (key.robot, key.limb, block.hash.clone());
        let kept = groups.entry(group.clone()).or_insert_with(|| Kept {
            robot: block.robot.clone(),
            columns: block.columns.clone(),
            hash: block.hash.clone(),
            blocks: Vec::new(),
        });
        let joints = kept.columns.joints.len();
        let at = *places.entry((group, key.t0, key.log)).or_insert_with(|| {
            kept.blocks.push(KeptBlock {
                log: block.log.clone(),
                time: [block.t0, block.t1],
                joints: vec![Vec::new(); joints],
                temperature: vec![None; joints],
                rms: vec![0.0; joints],
            });
            kept.blocks.len() - 1
        });
        let own = &mut kept.blocks[at];
        own.time[1] = own.time[1].max(block.t1);
        own.joints[key.joint].push((block.fold, factor));
        own.temperature[key.joint] = block.temperature;
        own.rms[key.joint] = block.rms;
    }
    let mut all: Vec<Kept> = groups.into_values().collect();
    all.iter_mut().for_each(Kept::sort);
    all
}

/// Puts parts together that were made elsewhere, in any order. Of a block of which both parts have joints or folds each is kept once.
pub fn merge(parts: impl IntoIterator<Item = Vec<Kept>>) -> Vec<Kept> {
    let mut groups: BTreeMap<Group, Kept> = BTreeMap::new();
    for kept in parts.into_iter().flatten() {
        let group = (
            kept.robot.clone(),
            kept.columns.limb.clone(),
            kept.hash.clone(),
        );
        match groups.get_mut(&group) {
            Some(known) => known.take(kept),
            None => {
                groups.insert(group, kept);
            }
        }
    }
    let mut all: Vec<Kept> = groups.into_values().collect();
    all.iter_mut().for_each(Kept::sort);
    all
}

impl Kept {
    fn take(&mut self, other: Self) {
        for block in other.blocks {
            let same = |own: &KeptBlock| {
                own.time[0].to_bits() == block.time[0].to_bits() && own.log == block.log
            };
            match self.blocks.iter().position(same) {
                None => self.blocks.push(block),
                Some(at) => {
                    let own = &mut self.blocks[at];
                    own.time[1] = own.time[1].max(block.time[1]);
                    for (j, factors) in block.joints.into_iter().enumerate() {
                        if own.joints[j].is_empty() {
                            own.temperature[j] = block.temperature[j];
                            own.rms[j] = block.rms[j];
                        }
                        own.joints[j].extend(factors);
                    }
                }
            }
        }
    }

    /// The one order: blocks by time and log, factors by fold, each fold once.
    fn sort(&mut self) {
        self.blocks.sort_by(|a, b| {
            a.time[0]
                .total_cmp(&b.time[0])
                .then_with(|| a.log.cmp(&b.log))
        });
        for block in &mut self.blocks {
            for joint in &mut block.joints {
                joint.sort_by_key(|(fold, _)| *fold);
                joint.dedup_by_key(|(fold, _)| *fold);
            }
        }
    }
}

impl KeptBlock {
    /// A joint's factor, its folds together; `None` where it has no data.
    pub fn joint(&self, joint: usize) -> Option<HeapFactor> {
        let mut folds = self.joints[joint].iter();
        let mut sum = folds.next()?.1.clone();
        folds.for_each(|(_, factor)| sum.merge(factor));
        Some(sum)
    }

    /// The middle of its time, s.
    pub fn middle(&self) -> f64 {
        0.5 * (self.time[0] + self.time[1])
    }
}
