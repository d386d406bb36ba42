//! Which parameters of which robots drift: series of one kind of a robot side by side, each judged by [`super::drift`].

use std::collections::BTreeMap;

use serde::Serialize;

use super::drift::{by_differences, judge, own_part};
use super::memory::Memory;
use super::values::Series;
use crate::robust;

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
pub(super) fn drifts(all: &[Series]) -> (Vec<Drifting>, usize) {
    let mut groups: BTreeMap<(&str, &str), Vec<&Series>> = BTreeMap::new();
    for series in all {
        let group = (series.of.kept.robot.as_str(), series.column().kind());
        groups.entry(group).or_default().push(series);
    }
    let groups: Vec<Aligned> = groups.into_values().filter_map(aligned).collect();
    let mut kinds: BTreeMap<&str, Vec<(String, Vec<f64>)>> = BTreeMap::new();
    let mut like: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (series, own) in groups
        .iter()
        .flat_map(|group| group.series.iter().zip(&group.own))
    {
        let column = series.column();
        // Each by its own scale: one that drifts far must not be what all remember by.
        let name = format!("{} {}", series.of.kept.robot, column.name);
        kinds
            .entry(column.kind())
            .or_default()
            .push((name, own.clone()));
        like.entry(&column.name)
            .or_default()
            .push(by_differences(own));
    }
    let of = |(kind, own): (&'_ str, Vec<(String, Vec<f64>)>)| {
        let named = own.iter().map(|(name, x)| (name.as_str(), x.clone()));
        (kind.to_owned(), Memory::of_kind(&named.collect::<Vec<_>>()))
    };
    let memory: BTreeMap<String, Memory> = kinds.into_iter().map(of).collect();
    let usual: BTreeMap<&str, f64> = like
        .into_iter()
        .filter_map(|(name, x)| Some((name, robust::median(x)?)))
        .collect();
    let (mut found, mut judged) = (Vec::new(), 0);
    for group in &groups {
        for ((series, own), temperature) in
            group.series.iter().zip(&group.own).zip(&group.temperature)
        {
            judged += 1;
            let column = series.column();
            // No series is quieter than the same parameter of other robots is.
            let variance =
                by_differences(own).max(usual.get(column.name.as_str()).copied().unwrap_or(0.0));
            let memory = memory.get(column.kind()).copied().unwrap_or_default();
            if let Some(drift) = judge(own, variance, memory) {
                found.push(Drifting {
                    robot: series.of.kept.robot.clone(),
                    name: column.name.clone(),
                    unit: column.unit.clone(),
                    between: [
                        group.times[drift.last_before],
                        group.times[drift.last_before + 1],
                    ],
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
            (
                t.round().max(0.0) as u64,
                (t, value, kept.temperature[series.joint]),
            )
        });
        told.collect()
    };
    let maps: Vec<_> = series.iter().map(of).collect();
    let most = maps.iter().map(BTreeMap::len).max()?;
    // A joint that hardly tells it does not take the others' blocks away.
    let whole: Vec<usize> = (0..series.len())
        .filter(|&k| 2 * maps[k].len() >= most)
        .collect();
    let first = whole.first()?;
    let shared = maps[*first]
        .keys()
        .filter(|t| whole.iter().all(|&k| maps[k].contains_key(t)));
    let shared: Vec<u64> = shared.copied().collect();
    let times = shared.iter().map(|t| maps[*first][t].0).collect();
    let values: Vec<Vec<f64>> = whole
        .iter()
        .map(|&k| shared.iter().map(|t| maps[k][t].1).collect())
        .collect();
    let temperatures: Vec<Option<Vec<f64>>> = whole
        .iter()
        .map(|&k| shared.iter().map(|t| maps[k][t].2).collect())
        .collect();
    (!shared.is_empty()).then(|| Aligned {
        own: own_part(&values, &temperatures),
        temperature: temperatures.iter().map(Option::is_some).collect(),
        series: whole.iter().map(|&k| series[k]).collect(),
        times,
    })
}
