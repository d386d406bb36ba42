//! All answers, of what is kept of a fleet's blocks: the last part of the work, done once. `final` is a word of Rust's own, so it is
//! [`final_answers`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::Serialize;

use super::columns::KeptColumn;
pub use super::drifting::Drifting;
use super::drifting::drifts;
use super::memory::Memory;
use super::missing::{Candidate, OfRobot, candidates};
pub use super::outliers::Outlier;
use super::outliers::{Commons, Tested, outliers};
use super::partial::Kept;
use super::population::common;
pub use super::values::RobotValue;
use super::values::{Series, memories, model_of, robot_values, series_of};
pub use super::values::{Solved, solved};
use crate::parallel::{each_part, side_by_side};
use crate::table::Table;

/// Name of the schema of answers as JSON.
const SCHEMA: &str = "proprio-fleet.report/1";

/// A parameter over all robots.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Population {
    /// The parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// How many robots tell it.
    pub robots: usize,
    /// Their median.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Standard deviation between robots.
    pub spread: f64,
}

/// The answers.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Answers {
    /// How many robots.
    pub robots: usize,
    /// How many blocks of time.
    pub blocks: usize,
    /// Each robot's values.
    pub values: Vec<RobotValue>,
    /// What robots have in common; its median and spread are a new robot's prior.
    pub population: Vec<Population>,
    /// Robots that differ, the farthest first.
    pub outliers: Vec<Outlier>,
    /// What drifts, by robot.
    pub drifts: Vec<Drifting>,
    /// What a fleet's model might lack, the largest gain first.
    pub missing: Vec<Candidate>,
    /// Kinds of parameters that the fleet's model has: a plain drive's, and what was missing.
    pub model: Vec<String>,
    /// How values of each parameter remember from block to block.
    pub memory: BTreeMap<String, Memory>,
    /// How many series were judged for drift.
    pub series: usize,
}

/// The kinds of parameters that a model has.
type Kinds = BTreeSet<String>;

/// Whether every drive has it: friction, rotor, offset.
pub(super) fn is_plain(column: &KeptColumn) -> bool {
    column
        .effect()
        .is_some_and(|effect| effect.description().is_plain())
}

/// All answers that kept blocks give: the same, to the bit, for any order in which they came.
pub fn final_answers(kept: Vec<Kept>) -> Answers {
    let mut limbs: Vec<Option<Solved>> = Vec::new();
    limbs.resize_with(kept.len(), || None);
    each_part(limbs.iter_mut().zip(kept), |_, (limb, kept)| {
        *limb = solved(kept)
    });
    answers_of(limbs.into_iter().flatten().collect())
}

/// All answers of limbs that were solved one by one, so that no more than one robot's factors are in memory; in any order.
pub fn answers_of(mut solved: Vec<Solved>) -> Answers {
    let order = |of: &Solved| {
        (
            of.kept.robot.clone(),
            of.kept.columns.limb.clone(),
            of.kept.hash.clone(),
        )
    };
    solved.sort_by_cached_key(order);
    let (model, missing) = model(&solved);
    let all = all_series(&solved, &model);
    let memory = memories(&all);
    let values = robot_values(&all, &memory);
    let commons = commons(&values);
    let tested = tested(&solved, &model, &all, &values);
    let in_model: Vec<Series> = all.into_iter().filter(|series| series.in_model).collect();
    let (drifts, series) = drifts(&in_model);
    let robots: BTreeSet<&str> = (solved.iter()).map(|of| of.kept.robot.as_str()).collect();
    let blocks = solved.iter().flat_map(|of| {
        let blocks = of.kept.blocks.iter();
        blocks.map(|block| (&of.kept.robot, &block.log, block.time[0].to_bits()))
    });
    let blocks: BTreeSet<_> = blocks.collect();
    Answers {
        robots: robots.len(),
        blocks: blocks.len(),
        outliers: outliers(&tested, &commons, &memory),
        population: populations(&commons),
        model: model.into_iter().collect(),
        missing,
        drifts,
        series,
        memory,
        values,
    }
}

/// The fleet's model, a plain drive with what it lacks: the candidate that explains most of robots it was not fitted to joins, one after the other. With
/// the candidates of the last round, those that joined before them.
fn model(solved: &[Solved]) -> (Kinds, Vec<Candidate>) {
    let columns = solved.iter().flat_map(|of| &of.kept.columns.columns);
    let all: Kinds = columns
        .clone()
        .map(|column| column.kind().to_owned())
        .collect();
    let mut model: Kinds = columns
        .filter(|column| is_plain(column))
        .map(|column| column.kind().to_owned())
        .collect();
    let mut joined = Vec::new();
    for _ in 0..=all.len() {
        let found = missing(solved, &model);
        match found.first() {
            Some(best) if best.is_missing => {
                model.insert(best.effect.clone());
                joined.push(best.clone());
            }
            _ => {
                // What is no gain beside what has joined is not missing.
                joined.extend(found.into_iter().map(|one| Candidate {
                    is_missing: false,
                    ..one
                }));
                break;
            }
        }
    }
    (model, joined)
}

/// Each joint of each robot.
fn joints<'a>(solved: &'a [Solved]) -> Vec<(&'a Solved, usize)> {
    let of = |of: &'a Solved| (0..of.solution.joints.len()).map(move |joint| (of, joint));
    solved.iter().flat_map(of).collect()
}

/// The series of the model's columns, and of each other column added to it alone.
fn all_series<'a>(solved: &'a [Solved], model: &Kinds) -> Vec<Series<'a>> {
    let of = |&(of, joint): &(&'a Solved, usize)| {
        let own = model_of(of, joint, &|column| model.contains(column.kind()));
        let mut series = series_of(of, joint, &own, None);
        for n in (0..of.solution.joints[joint].columns.len()).filter(|n| !own.contains(n)) {
            series.extend(series_of(of, joint, &own, Some(n)));
        }
        series
    };
    let joints = joints(solved);
    side_by_side(&joints, of).into_iter().flatten().collect()
}

fn missing(solved: &[Solved], model: &Kinds) -> Vec<Candidate> {
    let of = |&(of, joint): &(&Solved, usize)| {
        let own = model_of(of, joint, &|column| model.contains(column.kind()));
        let others = (0..of.solution.joints[joint].columns.len()).filter(|n| !own.contains(n));
        let mean = |n: usize| {
            let series = series_of(of, joint, &own, Some(n));
            let values = series.first()?.values();
            Some((n, values.iter().sum::<f64>() / values.len() as f64))
        };
        let values: Vec<(usize, f64)> = others.filter_map(mean).collect();
        (own, values)
    };
    let joints = joints(solved);
    let told: Vec<_> = side_by_side(&joints, of);
    let robots = joints
        .iter()
        .zip(&told)
        .map(|((of, joint), (model, values))| OfRobot {
            robot: &of.kept.robot,
            columns: &of.kept.columns,
            joint: &of.solution.joints[*joint],
            model,
            values: values.clone(),
        });
    candidates(&robots.collect::<Vec<_>>())
}

fn commons(values: &[RobotValue]) -> Commons {
    let mut same: BTreeMap<(String, String), Vec<(f64, f64)>> = BTreeMap::new();
    for own in values {
        let name = (own.name.clone(), own.unit.clone());
        same.entry(name).or_default().push((own.value, own.std));
    }
    let of = |(name, values): (_, Vec<(f64, f64)>)| Some((name, common(&values)?));
    same.into_iter().filter_map(of).collect()
}

fn populations(commons: &Commons) -> Vec<Population> {
    let of = |((name, unit), common): (&(String, String), &super::population::Common)| Population {
        name: name.clone(),
        unit: unit.clone(),
        robots: common.robots,
        value: common.centre,
        std: common.std,
        spread: common.spread,
    };
    commons.iter().map(of).collect()
}

/// Values joint by joint; series of a joint follow one another.
fn tested<'a>(
    solved: &'a [Solved],
    model: &Kinds,
    all: &[Series],
    values: &[RobotValue],
) -> Vec<Tested<'a>> {
    let mut pairs = all.iter().zip(values).peekable();
    let of = |(of, joint): (&'a Solved, usize)| {
        let mut own = Vec::new();
        let is_own = |series: &Series| std::ptr::eq(series.of, of) && series.joint == joint;
        while let Some((series, value)) = pairs.next_if(|(series, _)| is_own(series)) {
            own.push((series.n, value.clone()));
        }
        Tested {
            of,
            joint,
            model: model_of(of, joint, &|column| model.contains(column.kind())),
            values: own,
        }
    };
    joints(solved).into_iter().map(of).collect()
}

impl Answers {
    /// As one JSON object that names its schema.
    pub fn object(&self) -> serde_json::Value {
        // Plain data with string keys.
        let mut object = serde_json::to_value(self).unwrap_or_default();
        object["schema"] = SCHEMA.into();
        object
    }
}

impl fmt::Display for Answers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} robots, {} blocks", self.robots, self.blocks)?;
        let mut table = Table::default();
        table.row(["", "unit", "median", "± of it", "between robots", "robots"].map(str::to_owned));
        for own in &self.population {
            table.row([
                own.name.clone(),
                own.unit.clone(),
                format!("{:.4}", own.value),
                format!("{:.4}", own.std),
                format!("{:.4}", own.spread),
                own.robots.to_string(),
            ]);
        }
        write!(f, "{table}")?;
        for own in &self.outliers {
            let Outlier {
                robot,
                name,
                unit,
                difference,
                std,
            } = own;
            writeln!(
                f,
                "{robot} differs: {name} {difference:+.4} ± {std:.4} {unit}"
            )?;
        }
        for own in &self.drifts {
            let Drifting {
                robot,
                name,
                unit,
                between,
                size,
                std,
                ..
            } = own;
            writeln!(
                f,
                "{robot} drifts: {name} {size:+.4} ± {std:.4} {unit} between {:.0} s and {:.0} s",
                between[0], between[1]
            )?;
        }
        let mut missing = self.missing.iter().filter(|own| own.is_missing).peekable();
        if missing.peek().is_none() {
            return writeln!(
                f,
                "A plain drive lacks no kept effect: none explains robots that it was not fitted to"
            );
        }
        for own in missing {
            writeln!(
                f,
                "A plain drive lacks {}: it explains {:.1} ± {:.1} % of the squared residual of robots that it was not fitted to",
                own.effect,
                100.0 * own.gain,
                100.0 * own.std
            )?;
        }
        Ok(())
    }
}
