//! Series of values, block by block, and what a robot's value is by them.

use std::collections::BTreeMap;

use serde::Serialize;

use super::columns::KeptColumn;
use super::memory::{Memory, mean_and_variance, moderated, widened};
use super::partial::Kept;
use super::solve::{JointSolution, LimbSolution, solve};
use crate::robust;

/// Fewest blocks between which a value's ± is taken.
const LEAST_BLOCKS: usize = 2;

/// A parameter of one robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RobotValue {
    /// The robot.
    pub robot: String,
    /// The parameter: `coulomb:FR_hip`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Mean of its blocks.
    pub value: f64,
    /// Standard deviation: from between blocks that remember, and of the bodies' errors. Two of it hold 95 %. Of a single block that by the noise within it.
    pub std: f64,
    /// How many blocks tell it.
    pub blocks: usize,
    /// How many independent ones they are worth.
    pub effective: f64,
    /// Standard deviation of a block's value about the mean.
    pub between: f64,
    /// Whether the fleet's model has it; others are added to that model alone, one at a time.
    pub in_model: bool,
}

/// A limb of a robot with its solution.
pub struct Solved {
    pub(super) kept: Kept,
    pub(super) solution: LimbSolution,
}

/// Solves a limb, and forgets its factors: what is kept of a block is then a twentieth of it. `None` without data.
pub fn solved(mut kept: Kept) -> Option<Solved> {
    let solution = solve(&kept)?;
    for block in &mut kept.blocks {
        block.joints = Vec::new();
    }
    Some(Solved { kept, solution })
}

/// A robot's series of one parameter.
pub(super) struct Series<'a> {
    pub(super) of: &'a Solved,
    pub(super) joint: usize,
    /// Its place among the joint's own columns.
    pub(super) n: usize,
    pub(super) in_model: bool,
    /// (block, value)
    pub(super) told: Vec<(usize, f64)>,
    /// Its ± of a single block, by the noise within it.
    within: f64,
    /// The part of its ± that bodies make.
    of_bodies: f64,
}

impl<'a> Series<'a> {
    pub(super) fn column(&self) -> &'a KeptColumn {
        let columns = &self.of.kept.columns.columns;
        &columns[self.solution().columns[self.n]]
    }

    pub(super) fn solution(&self) -> &'a JointSolution {
        &self.of.solution.joints[self.joint]
    }

    pub(super) fn values(&self) -> Vec<f64> {
        self.told.iter().map(|(_, value)| *value).collect()
    }
}

/// The own columns of a joint that a model of these kinds has.
pub(super) fn model_of(
    of: &Solved,
    joint: usize,
    is_in: &dyn Fn(&KeptColumn) -> bool,
) -> Vec<usize> {
    let own = &of.solution.joints[joint].columns;
    (0..own.len())
        .filter(|&n| is_in(&of.kept.columns.columns[own[n]]))
        .collect()
}

/// The series of a model's columns at a joint; of one that is added to it, that one's alone.
pub(super) fn series_of<'a>(
    of: &'a Solved,
    joint: usize,
    model: &[usize],
    added: Option<usize>,
) -> Vec<Series<'a>> {
    let all: Vec<usize> = model.iter().copied().chain(added).collect();
    let values = of.solution.joints[joint].values(&all);
    let wanted = all
        .iter()
        .enumerate()
        .filter(|(_, n)| added.is_none_or(|added| added == **n));
    let made = wanted.map(|(at, &n)| Series {
        of,
        joint,
        n,
        in_model: added.is_none(),
        told: values
            .blocks
            .iter()
            .map(|(block, values, _)| (*block, values[at]))
            .collect(),
        within: values
            .blocks
            .first()
            .map_or(f64::INFINITY, |(_, _, std)| std[at]),
        of_bodies: values.std_of_bodies[at],
    });
    made.filter(|series| !series.told.is_empty()).collect()
}

/// How values of each parameter remember.
pub(super) fn memories(all: &[Series]) -> BTreeMap<String, Memory> {
    let named = all
        .iter()
        .map(|series| (series.column().name.as_str(), series.values()));
    Memory::by_name(&named.collect::<Vec<_>>())
}

/// Each robot's value: the mean of its blocks, with the ± that blocks which remember give it.
pub(super) fn robot_values(all: &[Series], memory: &BTreeMap<String, Memory>) -> Vec<RobotValue> {
    // Variances of the same parameter of like robots are like.
    let mut like: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (k, series) in all.iter().enumerate() {
        like.entry(&series.column().name).or_default().push(k);
    }
    let mut found: Vec<Option<RobotValue>> = vec![None; all.len()];
    for places in like.values() {
        let own: Vec<(f64, f64)> = places
            .iter()
            .map(|&k| mean_and_variance(&all[k].values()))
            .collect();
        let memory = memory
            .get(&all[places[0]].column().name)
            .copied()
            .unwrap_or_default();
        let lengths = places.iter().map(|&k| all[k].told.len() as f64);
        let usual = robust::median(lengths).unwrap_or(1.0) as usize;
        let freedom = memory.freedom(usual.max(2));
        let variances: Vec<f64> = own.iter().map(|(_, variance)| *variance).collect();
        let shared = moderated(&variances, freedom);
        for ((&k, (value, _)), of) in places.iter().zip(own).zip(shared) {
            found[k] = Some(robot_value(&all[k], value, of, memory));
        }
    }
    found.into_iter().flatten().collect()
}

/// A series' value on its own.
pub(super) fn alone(series: &Series, memory: &BTreeMap<String, Memory>) -> RobotValue {
    let memory = memory
        .get(&series.column().name)
        .copied()
        .unwrap_or_default();
    let (value, variance) = mean_and_variance(&series.values());
    let freedom = memory.freedom(series.told.len().max(2));
    robot_value(series, value, (variance, freedom), memory)
}

fn robot_value(
    series: &Series,
    value: f64,
    (variance, freedom): (f64, f64),
    memory: Memory,
) -> RobotValue {
    let (column, n) = (series.column(), series.told.len());
    let (std, effective, between) = match n >= LEAST_BLOCKS {
        true => {
            let about_truth = memory.about_truth(variance, n);
            let std = (about_truth * memory.inflation(n) / n as f64).sqrt() * widened(freedom);
            (std, memory.effective(n), about_truth.sqrt())
        }
        false => (series.within, 1.0, 0.0),
    };
    RobotValue {
        robot: series.of.kept.robot.clone(),
        name: column.name.clone(),
        unit: column.unit.clone(),
        value,
        std: std.hypot(series.of_bodies),
        blocks: n,
        effective,
        between,
        in_model: series.in_model,
    }
}
