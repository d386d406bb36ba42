//! From a table to answers.

use std::collections::BTreeMap;

use proprio_host::fleet::answers::Answers;
use proprio_host::fleet::{Gate, final_answers, merge, partial, place_in_model};
use proprio_host::model::Model;
use rayon::prelude::*;

use crate::folder::{FolderError, Table};

/// All answers of a table. The gate lets each block in once more: a file may have been damaged where it lies.
///
/// # Errors
/// [`FolderError`].
pub(crate) fn of(table: &Table) -> Result<Answers, FolderError> {
    let files = table.files()?;
    let parts = files.par_iter().map(|file| {
        let mut gate = Gate::default();
        let read = proprio_host::fleet::read(file);
        for fault in &read.faults {
            eprintln!("warning: {fault}; {}", fault.fix());
        }
        let admit = |block| {
            let told = |fault: proprio_host::fleet::Fault| {
                eprintln!("warning: {}: {fault}; {}", file.display(), fault.fix())
            };
            gate.admit(block).map_err(told).ok()
        };
        partial(
            read.blocks
                .into_iter()
                .filter_map(admit)
                .collect::<Vec<_>>(),
        )
    });
    Ok(final_answers(&merge(parts.collect::<Vec<_>>())))
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
