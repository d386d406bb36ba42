//! What a LeRobot data set says of its tables: `meta/info.json`, two folders above them.

use std::path::Path;

use serde_json::Value;

use crate::log::error::Problem;
use crate::log::names::SUFFIXES;

/// The names of the elements of a data set's lists.
pub(super) struct Info {
    info: Value,
}

/// Lists of a number per joint, and what they hold, as columns are called.
const LISTS: [(&str, &str); 8] = [
    ("observation.state", "position"),
    ("observation.position", "position"),
    ("observation.qpos", "position"),
    ("observation.velocity", "velocity"),
    ("observation.qvel", "velocity"),
    ("observation.effort", "effort"),
    ("observation.torque", "effort"),
    ("action", "command"),
];

impl Info {
    /// That of the data set to which a table belongs; none if it belongs to none.
    pub(super) fn beside(table: &Path) -> Result<Option<Self>, Problem> {
        let folders = table.ancestors().skip(1).take(4);
        let mut files = folders.map(|folder| folder.join("meta").join("info.json"));
        let Some(file) = files.find(|file| file.is_file()) else {
            return Ok(None);
        };
        let text = std::fs::read_to_string(&file).map_err(Problem::Read)?;
        let info = serde_json::from_str(&text)
            .map_err(|error| Problem::Damaged(format!("{}: {error}", file.display())))?;
        Ok(Some(Self { info }))
    }

    /// What the elements of a list are called: `<joint>/position`, where the data set names them.
    pub(super) fn names(&self, list: &str, count: usize) -> Vec<String> {
        let names = &self.info["features"][list]["names"];
        // A list of names, or one under a heading: `{"motors": [...]}`.
        let names = names
            .as_array()
            .or_else(|| names.as_object()?.values().next()?.as_array());
        let names = names.filter(|names| names.len() == count);
        let holds = LISTS
            .iter()
            .find(|(name, _)| *name == list)
            .map(|(_, holds)| *holds);
        let element = |n: usize| {
            let plain = || format!("{list}[{n}]");
            let Some(name) = names.and_then(|names| names[n].as_str()) else {
                return plain();
            };
            let suffix = SUFFIXES.iter().find(|(suffix, _)| name.ends_with(suffix));
            let (joint, said) = match suffix {
                Some((suffix, said)) => (&name[..name.len() - suffix.len()], Some(*said)),
                None => (name, None),
            };
            // An action's positions are what was asked for.
            let quantity = match holds {
                Some("command") => Some("command"),
                holds => said.or(holds),
            };
            quantity.map_or_else(plain, |quantity| format!("{joint}/{quantity}"))
        };
        (0..count).map(element).collect()
    }
}
