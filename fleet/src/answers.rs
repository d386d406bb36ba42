//! From a table to answers.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proprio_host::fleet::answers::{Answers, Solved};
use proprio_host::fleet::{
    Fault, Gate, Kept, answers_of, merge, partial, place_in_model, read, robots_in, solved,
};
use proprio_host::model::Model;
use rayon::prelude::*;

use crate::folder::{FolderError, Table};

/// All answers of a table, a robot after the other on each processor: no more than theirs of factors is in memory.
///
/// # Errors
/// [`FolderError`].
pub(crate) fn of(table: &Table) -> Result<Answers, FolderError> {
    let groups = by_robot(table.files()?);
    let limbs = groups.into_par_iter().map(|files| -> Vec<Solved> {
        let parts = files.iter().map(|file| kept_in(file));
        merge(parts).into_iter().filter_map(solved).collect()
    });
    Ok(answers_of(limbs.flatten().collect()))
}

/// Files in groups that have no robot in common. One robot's are one, unless a file of several robots joins them.
fn by_robot(files: Vec<PathBuf>) -> Vec<Vec<PathBuf>> {
    let robots: Vec<BTreeSet<String>> = files.par_iter().map(|file| robots_in(file)).collect();
    let mut groups: Vec<Vec<PathBuf>> = Vec::new();
    let mut group_of: BTreeMap<String, usize> = BTreeMap::new();
    for (file, robots) in files.into_iter().zip(robots) {
        let met: BTreeSet<usize> = robots
            .iter()
            .filter_map(|robot| group_of.get(robot).copied())
            .collect();
        let group = met.first().copied().unwrap_or(groups.len());
        groups.resize_with(groups.len().max(group + 1), Vec::new);
        for other in met.into_iter().skip(1) {
            let joined = std::mem::take(&mut groups[other]);
            groups[group].extend(joined);
            group_of
                .values_mut()
                .filter(|own| **own == other)
                .for_each(|own| *own = group);
        }
        groups[group].push(file);
        group_of.extend(robots.into_iter().map(|robot| (robot, group)));
    }
    groups
}

/// What is kept of a file. The gate lets each block in once more: it may have been damaged where it lies.
fn kept_in(file: &Path) -> Vec<Kept> {
    let mut gate = Gate::default();
    let read = read(file);
    for fault in &read.faults {
        eprintln!("warning: {fault}; {}", fault.fix());
    }
    let admit = |block| {
        let refused =
            |fault: Fault| eprintln!("warning: {}: {fault}; {}", file.display(), fault.fix());
        gate.admit(block).map_err(refused).ok()
    };
    partial(
        read.blocks
            .into_iter()
            .filter_map(admit)
            .collect::<Vec<_>>(),
    )
}

/// A model file of each robot, by its name: the values of the fleet's model.
pub(crate) fn models(robot: &Model, answers: &Answers) -> BTreeMap<String, Model> {
    let mut models: BTreeMap<String, Model> = BTreeMap::new();
    for own in answers.values.iter().filter(|own| own.in_model) {
        let Some((effect, joint, place)) = place_in_model(&own.name, robot.robot()) else {
            continue;
        };
        let bounds = &effect.description().parameters[place];
        let value = own.value.clamp(bounds.lower, bounds.upper);
        let model = models
            .entry(own.robot.clone())
            .or_insert_with(|| Model::new(robot.robot().clone()));
        // Within the bounds; a standard deviation is positive, or there is none.
        let std = Some(own.std).filter(|std| std.is_finite() && *std > 0.0);
        let _ = model.set_parameter(effect, joint, place, value, std);
    }
    models
}
