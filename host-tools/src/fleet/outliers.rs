//! Robots that differ, each with the parameter that is the cause.
//!
//! Every kept column of every joint is tested: the model's in the model, each other one added to it alone. What is missing at a joint moves the model's own values
//! too. So where another column is the farthest away it joins the model of that joint, and the rest is tested again beside it: a robot with a spring is named by its
//! spring, and not by the offset that stood for it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::memory::Memory;
use super::population::{Common, LEAST_ROBOTS};
use super::values::{RobotValue, Series, Solved, alone, series_of};

/// Most columns that join a joint's model.
const MOST_JOINED: usize = 3;

/// What robots have in common, by a parameter's name and unit.
pub(super) type Commons = BTreeMap<(String, String), Common>;

/// A robot that differs from the others in a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlier {
    /// The robot.
    pub robot: String,
    /// The parameter, which is the cause: others of the joint are fitted beside it.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The robot's value less the fleet's median.
    pub difference: f64,
    /// Standard deviation of that, with the spread between robots.
    pub std: f64,
}

/// What is tested at a joint of a robot.
pub(super) struct Tested<'a> {
    pub(super) of: &'a Solved,
    pub(super) joint: usize,
    /// The model's columns, by place among the joint's own.
    pub(super) model: Vec<usize>,
    /// Values of the model's columns and of each other one.
    pub(super) values: Vec<(usize, RobotValue)>,
}

/// The robots that differ, the farthest first.
pub(super) fn outliers(
    all: &[Tested],
    commons: &Commons,
    memory: &BTreeMap<String, Memory>,
) -> Vec<Outlier> {
    let tests = all.iter().map(|tested| tested.values.len()).sum();
    let mut found: Vec<(f64, Outlier)> = Vec::new();
    for tested in all {
        found.extend(of_joint(tested, commons, memory, tests));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, outlier)| outlier).collect()
}

fn of_joint(
    tested: &Tested,
    commons: &Commons,
    memory: &BTreeMap<String, Memory>,
    tests: usize,
) -> Vec<(f64, Outlier)> {
    let away = |own: &RobotValue| -> Option<f64> {
        let common = commons.get(&(own.name.clone(), own.unit.clone()))?;
        let away = common.away((own.value, own.std)).abs();
        (common.robots >= LEAST_ROBOTS && away > common.threshold(tests)).then_some(away)
    };
    let far = |values: &[(usize, RobotValue)]| -> Vec<(f64, usize, RobotValue)> {
        let far = values
            .iter()
            .filter_map(|(n, own)| Some((away(own)?, *n, own.clone())));
        let mut far: Vec<_> = far.collect();
        far.sort_by(|a, b| b.0.total_cmp(&a.0));
        far
    };
    let mut model = tested.model.clone();
    let mut left = far(&tested.values);
    let mut found = Vec::new();
    for _ in 0..MOST_JOINED {
        let Some(first) = left.iter().find(|(_, n, _)| !model.contains(n)).cloned() else {
            break;
        };
        // The model's own value is farther away: that is the cause.
        if left[0].0 > first.0 {
            left.retain(|(_, n, _)| model.contains(n));
            break;
        }
        found.push((first.0, first.2));
        model.push(first.1);
        left = far(&beside(tested, &model, &left, memory));
    }
    found.extend(
        left.into_iter()
            .filter(|(_, n, _)| tested.model.contains(n))
            .map(|(away, _, own)| (away, own)),
    );
    found
        .into_iter()
        .filter_map(|(away, own)| Some((away, outlier(&own, commons)?)))
        .collect()
}

/// The values of the model's columns, and of each other one that was far away, with what has joined the model beside them.
fn beside(
    tested: &Tested,
    model: &[usize],
    left: &[(f64, usize, RobotValue)],
    memory: &BTreeMap<String, Memory>,
) -> Vec<(usize, RobotValue)> {
    let mut series: Vec<Series> = series_of(tested.of, tested.joint, model, None);
    series.retain(|series| tested.model.contains(&series.n));
    let others = left
        .iter()
        .map(|(_, n, _)| *n)
        .filter(|n| !model.contains(n));
    series.extend(others.flat_map(|n| series_of(tested.of, tested.joint, model, Some(n))));
    series
        .iter()
        .map(|series| (series.n, alone(series, memory)))
        .collect()
}

fn outlier(own: &RobotValue, commons: &Commons) -> Option<Outlier> {
    let common = commons.get(&(own.name.clone(), own.unit.clone()))?;
    let difference = own.value - common.centre;
    let away = common.away((own.value, own.std));
    Some(Outlier {
        robot: own.robot.clone(),
        name: own.name.clone(),
        unit: own.unit.clone(),
        difference,
        std: (difference / away).abs(),
    })
}
