//! All answers, of what is kept of a fleet's blocks: the last part of the work, done once. `final` is a word of Rust's own, so it is
//! [`final_answers`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::drift::{by_differences, judge, own_part};
use super::memory::{Memory, mean_and_variance, moderated, widened};
use super::missing::{Candidate, OfRobot, candidates};
use super::partial::Kept;
use super::population::{Common, LEAST_ROBOTS, common};
use super::solve::{JointSolution, LimbSolution, solve};
use crate::robust;
use crate::table::Table;

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
}

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

/// A robot that differs from the others in a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlier {
    /// The robot.
    pub robot: String,
    /// The parameter, which is the cause: other parameters of the joint are fitted beside it.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The robot's value less the fleet's median.
    pub difference: f64,
    /// Standard deviation of that, with the spread between robots.
    pub std: f64,
}

/// A parameter of a robot that drifts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drifting {
    /// The robot.
    pub robot: String,
    /// The parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Between the middles of these two blocks it changes, s.
    pub between: [f64; 2],
    /// Mean after less mean before.
    pub size: f64,
    /// Standard deviation of that.
    pub std: f64,
    /// Whether what temperature explains was taken out before.
    pub temperature: bool,
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
    /// How values of each kind remember from block to block.
    pub memory: BTreeMap<String, Memory>,
    /// How many series were judged for drift.
    pub series: usize,
}

/// A limb of a robot with its solution.
struct Solved<'a> {
    kept: &'a Kept,
    solution: LimbSolution,
}

/// A robot's series of one parameter.
struct Series<'a> {
    of: &'a Solved<'a>,
    joint: usize,
    /// Its place among the joint's own columns.
    n: usize,
    /// (block, value)
    told: Vec<(usize, f64)>,
}

impl<'a> Series<'a> {
    fn column(&self) -> &'a super::KeptColumn {
        let columns = &self.of.kept.columns.columns;
        &columns[self.solution().columns[self.n]]
    }

    fn solution(&self) -> &'a JointSolution {
        &self.of.solution.joints[self.joint]
    }

    fn values(&self) -> Vec<f64> {
        self.told.iter().map(|(_, value)| *value).collect()
    }
}

/// All answers that kept blocks give: the same, to the bit, for any order in which they came.
pub fn final_answers(kept: &[Kept]) -> Answers {
    let solved: Vec<Solved> = kept
        .par_iter()
        .filter_map(|kept| Some(Solved { solution: solve(kept)?, kept }))
        .collect();
    let all: Vec<Series> = solved.iter().flat_map(all_series).collect();
    let memory = memories(&all);
    let values = robot_values(&all, &memory);
    let commons = commons(&values);
    let (drifts, series) = drifts(&solved, &all);
    let robots: BTreeSet<&str> = kept.iter().map(|kept| kept.robot.as_str()).collect();
    let blocks: BTreeSet<(&str, &str, u64)> = kept
        .iter()
        .flat_map(|kept| kept.blocks.iter().map(|b| (kept.robot.as_str(), b.log.as_str(), b.time[0].to_bits())))
        .collect();
    Answers {
        robots: robots.len(),
        blocks: blocks.len(),
        outliers: outliers(&values, &commons),
        missing: missing(&all, &values),
        population: commons
            .iter()
            .map(|((name, unit), common)| Population {
                name: name.clone(),
                unit: unit.clone(),
                robots: common.robots,
                value: common.centre,
                std: common.std,
                spread: common.spread,
            })
            .collect(),
        drifts,
        series,
        memory,
        values,
    }
}

fn all_series<'a>(of: &'a Solved<'a>) -> Vec<Series<'a>> {
    let joints = of.solution.joints.iter().enumerate();
    joints
        .flat_map(|(joint, solution)| {
            (0..solution.columns.len()).map(move |n| Series {
                of,
                joint,
                n,
                told: solution.series(n),
            })
        })
        .filter(|series| !series.told.is_empty())
        .collect()
}

/// How values of each kind remember.
fn memories(all: &[Series]) -> BTreeMap<String, Memory> {
    let mut kinds: BTreeMap<String, Vec<Vec<f64>>> = BTreeMap::new();
    for series in all {
        let kind = series.column().kind().to_owned();
        kinds.entry(kind).or_default().push(series.values());
    }
    kinds.into_par_iter().map(|(kind, series)| (kind, Memory::of(&series))).collect()
}

/// Each robot's value: the mean of its blocks, with the ± that blocks which remember give it.
fn robot_values(all: &[Series], memory: &BTreeMap<String, Memory>) -> Vec<RobotValue> {
    // Variances of the same parameter of like robots are like.
    let mut like: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (k, series) in all.iter().enumerate() {
        like.entry(&series.column().name).or_default().push(k);
    }
    let mut found: Vec<Option<RobotValue>> = vec![None; all.len()];
    for places in like.values() {
        let own: Vec<(f64, f64)> = places.iter().map(|&k| mean_and_variance(&all[k].values())).collect();
        let memory = memory.get(all[places[0]].column().kind()).copied().unwrap_or_default();
        let lengths = places.iter().map(|&k| all[k].told.len() as f64);
        let usual = robust::median(lengths).unwrap_or(1.0) as usize;
        let freedom = memory.freedom(usual.max(2));
        let variances: Vec<f64> = own.iter().map(|(_, variance)| *variance).collect();
        let shared = moderated(&variances, freedom);
        for ((&k, (value, _)), (variance, freedom)) in places.iter().zip(own).zip(shared) {
            found[k] = Some(robot_value(&all[k], value, (variance, freedom), memory));
        }
    }
    found.into_iter().flatten().collect()
}

fn robot_value(series: &Series, value: f64, (variance, freedom): (f64, f64), memory: Memory) -> RobotValue {
    let (column, solution) = (series.column(), series.solution());
    let n = series.told.len();
    let of_bodies = solution.std_of_bodies[series.n];
    let (std, effective, between) = match n >= LEAST_BLOCKS {
        true => {
            let about_truth = memory.about_truth(variance, n);
            let std = (about_truth * memory.inflation(n) / n as f64).sqrt() * widened(freedom);
            (std, memory.effective(n), about_truth.sqrt())
        }
        false => {
            let own = solution.blocks.iter().find(|block| block.block == series.told[0].0);
            (own.map_or(f64::INFINITY, |block| block.std[series.n]), 1.0, f64::NAN)
        }
    };
    RobotValue {
        robot: series.of.kept.robot.clone(),
        name: column.name.clone(),
        unit: column.unit.clone(),
        value,
        std: std.hypot(of_bodies),
        blocks: n,
        effective,
        between: if between.is_nan() { 0.0 } else { between },
    }
}

type Commons = BTreeMap<(String, String), Common>;

fn commons(values: &[RobotValue]) -> Commons {
    let mut same: BTreeMap<(String, String), Vec<(f64, f64)>> = BTreeMap::new();
    for own in values {
        let name = (own.name.clone(), own.unit.clone());
        same.entry(name).or_default().push((own.value, own.std));
    }
    let of = |(name, values): (_, Vec<(f64, f64)>)| Some((name, common(&values)?));
    same.into_iter().filter_map(of).collect()
}

/// Robots that differ: of one joint of a robot the parameter that is farthest away is the cause.
fn outliers(values: &[RobotValue], commons: &Commons) -> Vec<Outlier> {
    let tests = values.len();
    let mut found: Vec<(f64, Outlier)> = Vec::new();
    for own in values {
        let Some(common) = commons.get(&(own.name.clone(), own.unit.clone())) else {
            continue;
        };
        let away = common.away((own.value, own.std));
        if common.robots >= LEAST_ROBOTS && away.abs() > common.threshold(tests) {
            let difference = own.value - common.centre;
            found.push((
                away.abs(),
                Outlier {
                    robot: own.robot.clone(),
                    name: own.name.clone(),
                    unit: own.unit.clone(),
                    difference,
                    std: (difference / away).abs(),
                },
            ));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, outlier)| outlier).collect()
}

/// The series of one kind of a robot, aligned: blocks that all of its joints tell.
struct Aligned<'a> {
    series: Vec<&'a Series<'a>>,
    /// Middle of each block, s.
    times: Vec<f64>,
    /// What of each series is the joint's own.
    own: Vec<Vec<f64>>,
    temperature: Vec<bool>,
}

/// What drifts, and how many series were judged.
fn drifts(solved: &[Solved], all: &[Series]) -> (Vec<Drifting>, usize) {
    let mut groups: BTreeMap<(&str, &str), Vec<&Series>> = BTreeMap::new();
    for series in all {
        let group = (series.of.kept.robot.as_str(), series.column().kind());
        groups.entry(group).or_default().push(series);
    }
    debug_assert!(!groups.is_empty() || solved.is_empty());
    let groups: Vec<Aligned> = groups.into_values().filter_map(aligned).collect();
    let mut kinds: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    let mut like: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (series, own) in groups.iter().flat_map(|group| group.series.iter().zip(&group.own)) {
        kinds.entry(series.column().kind()).or_default().push(own.clone());
        like.entry(&series.column().name).or_default().push(by_differences(own));
    }
    let memory: BTreeMap<&str, Memory> = kinds.iter().map(|(kind, x)| (*kind, Memory::of(x))).collect();
    let usual: BTreeMap<&str, f64> =
        like.into_iter().filter_map(|(name, x)| Some((name, robust::median(x)?))).collect();
    let (mut found, mut judged) = (Vec::new(), 0);
    for group in &groups {
        for ((series, own), temperature) in group.series.iter().zip(&group.own).zip(&group.temperature) {
            judged += 1;
            let column = series.column();
            // No series is quieter than the same parameter of other robots is.
            let variance = by_differences(own).max(usual.get(column.name.as_str()).copied().unwrap_or(0.0));
            let memory = memory.get(column.kind()).copied().unwrap_or_default();
            if let Some(drift) = judge(own, variance, memory) {
                found.push(Drifting {
                    robot: series.of.kept.robot.clone(),
                    name: column.name.clone(),
                    unit: column.unit.clone(),
                    between: [group.times[drift.last_before], group.times[drift.last_before + 1]],
                    size: drift.size,
                    std: drift.std,
                    temperature: *temperature,
                });
            }
        }
    }
    (found, judged)
}

/// Aligns series of one robot and kind by the times of their blocks; `None` if no block is in all.
fn aligned<'a>(series: Vec<&'a Series<'a>>) -> Option<Aligned<'a>> {
    let time = |series: &Series, block: usize| series.of.kept.blocks[block].middle();
    let of = |series: &&Series| -> BTreeMap<u64, (f64, f64, Option<f64>)> {
        let told = series.told.iter().map(|&(block, value)| {
            let kept = &series.of.kept.blocks[block];
            let t = time(series, block);
            // Limbs of a block differ by samples that one of them lacks: the second.
            (t.round().max(0.0) as u64, (t, value, kept.temperature[series.joint]))
        });
        told.collect()
    };
    let maps: Vec<_> = series.iter().map(of).collect();
    let most = maps.iter().map(BTreeMap::len).max()?;
    // A joint that hardly tells it does not take the others' blocks away.
    let whole: Vec<usize> = (0..series.len()).filter(|&k| 2 * maps[k].len() >= most).collect();
    let first = whole.first()?;
    let shared = maps[*first].keys().filter(|t| whole.iter().all(|&k| maps[k].contains_key(t)));
    let shared: Vec<u64> = shared.copied().collect();
    let times = shared.iter().map(|t| maps[*first][t].0).collect();
    let values: Vec<Vec<f64>> =
        whole.iter().map(|&k| shared.iter().map(|t| maps[k][t].1).collect()).collect();
    let temperatures: Vec<Option<Vec<f64>>> =
        whole.iter().map(|&k| shared.iter().map(|t| maps[k][t].2).collect()).collect();
    (!shared.is_empty()).then(|| Aligned {
        own: own_part(&values, &temperatures),
        temperature: temperatures.iter().map(Option::is_some).collect(),
        series: whole.iter().map(|&k| series[k]).collect(),
        times,
    })
}

fn missing(all: &[Series], values: &[RobotValue]) -> Vec<Candidate> {
    let known: BTreeMap<(&str, &str), f64> =
        values.iter().map(|own| ((own.robot.as_str(), own.name.as_str()), own.value)).collect();
    let firsts = all.iter().enumerate().filter(|(k, series)| {
        let before = k.checked_sub(1).map(|k| &all[k]);
        before.is_none_or(|before| !std::ptr::eq(before.solution(), series.solution()))
    });
    let joints = firsts.map(|(_, series)| {
        let (kept, joint) = (series.of.kept, series.solution());
        let value = |&k: &usize| {
            let name = kept.columns.columns[k].name.as_str();
            known.get(&(kept.robot.as_str(), name)).copied().unwrap_or(f64::NAN)
        };
        OfRobot {
            robot: &kept.robot,
            columns: &kept.columns,
            values: joint.columns.iter().map(value).collect(),
            joint,
        }
    });
    candidates(&joints.collect::<Vec<_>>())
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
            let Outlier { robot, name, unit, difference, std } = own;
            writeln!(f, "{robot} differs: {name} {difference:+.4} ± {std:.4} {unit}")?;
        }
        for own in &self.drifts {
            let Drifting { robot, name, unit, between, size, std, .. } = own;
            writeln!(f, "{robot} drifts: {name} {size:+.4} ± {std:.4} {unit} between {:.0} s and {:.0} s", between[0], between[1])?;
        }
        match self.missing.iter().find(|own| own.is_missing) {
            Some(own) => writeln!(
                f,
                "The fleet's model lacks {}: it explains {:.1} ± {:.1} % at robots it was not fitted to",
                own.effect,
                100.0 * own.gain,
                100.0 * own.std
            ),
            None => writeln!(f, "No kept effect explains robots that it was not fitted to"),
        }
    }
}
