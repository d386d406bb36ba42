//! Which effect the model of the whole fleet lacks: one that predicts robots it was not fitted to.
//!
//! The model is that of a plain drive. A candidate is one kept effect at all joints where a robot tells it; of each robot its value at a joint is what the
//! *other* robots say, their median. What that takes away of the robot's squared residual, the plain drive fitted anew beside it, is the gain. It is
//! negative where robots do not agree.

use std::collections::BTreeMap;

use nalgebra::DVector;
use proprio_solve::factor::HeapFactor;
use serde::Serialize;

use super::columns::BlockColumns;
use super::solve::JointSolution;
use crate::robust;

/// A candidate is missing if its mean gain over robots is so many of its standard errors, and …
const SURE: f64 = 4.0;
/// … at least this share of the plain drive's squared residual beyond noise.
const LEAST_GAIN: f64 = 0.01;

/// What an effect would explain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// The effect's parameter: `spring`, `quadratic_drag`.
    pub effect: String,
    /// Share of the plain drive's squared residual beyond noise that it takes away at robots it was not fitted to, mean of all robots.
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
    /// Its values, one for each of its own columns; NaN where not told.
    pub values: Vec<f64>,
}

/// What each kept effect beyond a plain drive would explain; the largest gain first.
pub fn candidates(joints: &[OfRobot<'_>]) -> Vec<Candidate> {
    let mut values: BTreeMap<&str, Vec<(&str, f64)>> = BTreeMap::new();
    for of in joints {
        for (&k, value) in of.joint.columns.iter().zip(&of.values) {
            let name = of.columns.columns[k].name.as_str();
            if value.is_finite() {
                values.entry(name).or_default().push((of.robot, *value));
            }
        }
    }
    let mut left: BTreeMap<&str, f64> = BTreeMap::new();
    let mut gains: BTreeMap<&str, BTreeMap<&str, f64>> = BTreeMap::new();
    for of in joints {
        let before = residual(of, None);
        *left.entry(of.robot).or_default() += before;
        for (n, &k) in of.joint.columns.iter().enumerate() {
            let column = &of.columns.columns[k];
            let is_plain = |effect: proprio_core::effect::EffectKind| effect.description().is_plain();
            if column.effect().is_none_or(is_plain) {
                continue;
            }
            let others = values.get(column.name.as_str()).into_iter().flatten();
            let others = others.filter(|(robot, _)| *robot != of.robot).map(|(_, x)| *x);
            if let Some(value) = robust::median(others) {
                let gain = before - residual(of, Some((n, value)));
                *gains.entry(column.kind()).or_default().entry(of.robot).or_default() += gain;
            }
        }
    }
    let mut all: Vec<Candidate> = gains.into_iter().map(|(effect, gains)| candidate(effect, &gains, &left)).collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    all
}

fn candidate(effect: &str, gains: &BTreeMap<&str, f64>, left: &BTreeMap<&str, f64>) -> Candidate {
    let share = |(robot, gain): (&&str, &f64)| {
        let all = left.get(robot).copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
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
        is_missing: n >= super::population::LEAST_ROBOTS as f64 && gain > SURE * std && gain > LEAST_GAIN,
        robots,
    }
}

/// What a plain drive fitted to each block leaves of a joint's own equations, in units of the noise, squared: with one more column at a value.
fn residual(of: &OfRobot<'_>, with: Option<(usize, f64)>) -> f64 {
    let is_plain = |k: &usize| {
        let effect = of.columns.columns[*k].effect();
        effect.is_some_and(|effect| effect.description().is_plain())
    };
    let own = &of.joint.columns;
    let plain: Vec<usize> = (0..own.len()).filter(|&n| is_plain(&own[n])).collect();
    let width = plain.len() + 1;
    let blocks = of.joint.blocks.iter().map(|block| {
        let mut right: DVector<f64> = block.right.clone();
        if let Some((n, value)) = with {
            right -= block.rows.column(n) * value;
        }
        let mut rows = vec![0.0; own.len() * width];
        for (r, row) in rows.chunks_exact_mut(width).enumerate() {
            for (c, &n) in plain.iter().enumerate() {
                row[c] = block.rows[(r, n)];
            }
            row[width - 1] = right[r];
        }
        let mut factor = HeapFactor::new(plain.len());
        factor.fold(&mut rows);
        // The last number is what is left, whatever the values.
        factor.row(plain.len())[0].powi(2)
    });
    blocks.sum()
}
