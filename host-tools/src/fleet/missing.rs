//! Which effect the model of the whole fleet lacks: one that predicts robots it was not fitted to.
//!
//! A candidate is one kept effect at all joints where a robot tells it, beside the model; of each robot its value at a joint is what the
//! *other* robots say, their median. What that takes away of the robot's squared residual, the model fitted anew beside it, is the gain. It is
//! negative where robots do not agree.

use std::collections::BTreeMap;

use serde::Serialize;

use super::columns::BlockColumns;
use super::solve::JointSolution;
use crate::robust;

/// A candidate is missing if its mean gain over robots is so many of its standard errors, and …
const SURE: f64 = 4.0;
/// … at least this share of the model's squared residual.
const LEAST_GAIN: f64 = 0.01;

/// What an effect would explain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// The effect's parameter: `spring`, `quadratic_drag`.
    pub effect: String,
    /// Share of the model's squared residual that it takes away at robots it was not fitted to, mean of all robots.
    pub gain: f64,
    /// Standard error of that mean.
    pub std: f64,
    /// Gain of each robot, by name.
    pub robots: BTreeMap<String, f64>,
    /// Whether the fleet's model lacks it.
    pub is_missing: bool,
}

/// A joint of a robot.
pub struct OfRobot<'a> {
    /// The robot.
    pub robot: &'a str,
    /// What its numbers belong to.
    pub columns: &'a BlockColumns,
    /// Its solution.
    pub joint: &'a JointSolution,
    /// The model's columns, by place among its own.
    pub model: &'a [usize],
    /// Value of each other own column, added to the model alone: (place, value).
    pub values: Vec<(usize, f64)>,
}

/// What each kept effect beyond the model would explain; the largest gain first.
pub fn candidates(joints: &[OfRobot<'_>]) -> Vec<Candidate> {
    let column = |of: &OfRobot<'_>, n: usize| of.joint.columns[n];
    let mut values: BTreeMap<&str, Vec<(&str, f64)>> = BTreeMap::new();
    for of in joints {
        for &(n, value) in &of.values {
            let name = of.columns.columns[column(of, n)].name.as_str();
            values.entry(name).or_default().push((of.robot, value));
        }
    }
    let mut left: BTreeMap<&str, f64> = BTreeMap::new();
    let mut gains: BTreeMap<&str, BTreeMap<&str, f64>> = BTreeMap::new();
    for of in joints {
        let residual = |with| of.joint.residual(of.model, with);
        let before = residual(None);
        *left.entry(of.robot).or_default() += before;
        for &(n, _) in &of.values {
            let own = &of.columns.columns[column(of, n)];
            let others = values.get(own.name.as_str()).into_iter().flatten();
            let others = others
                .filter(|(robot, _)| *robot != of.robot)
                .map(|(_, x)| *x);
            if let Some(value) = robust::median(others) {
                let gain = before - residual(Some((n, value)));
                *gains
                    .entry(own.kind())
                    .or_default()
                    .entry(of.robot)
                    .or_default() += gain;
            }
        }
    }
    let all = gains
        .into_iter()
        .map(|(effect, gains)| candidate(effect, &gains, &left));
    let mut all: Vec<Candidate> = all.collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    all
}

fn candidate(effect: &str, gains: &BTreeMap<&str, f64>, left: &BTreeMap<&str, f64>) -> Candidate {
    let share = |(robot, gain): (&&str, &f64)| {
        let all = left
            .get(robot)
            .copied()
            .unwrap_or(0.0)
            .max(f64::MIN_POSITIVE);
        ((*robot).to_owned(), gain / all)
    };
    let robots: BTreeMap<String, f64> = gains.iter().map(share).collect();
    let n = robots.len() as f64;
    let gain = robots.values().sum::<f64>() / n;
    let square: f64 = robots.values().map(|x| (x - gain).powi(2)).sum();
    let std = (square / (n - 1.0) / n).sqrt();
    Candidate {
        effect: effect.to_owned(),
        gain,
        std,
        is_missing: n >= super::population::LEAST_ROBOTS as f64
            && gain > SURE * std
            && gain > LEAST_GAIN,
        robots,
    }
}
