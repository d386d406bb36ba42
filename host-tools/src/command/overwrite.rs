//! What a command would write over, looked at before it begins.
//!
//! A file that proprio made of the same kind is replaced, and that is said. Anything else that would be lost stays, unless
//! --force is given; a log that the command reads stays in any case. The model of `-m` is the command's own to update.
//!
//! The rule is one for all commands: it goes by the names of arguments, of which each that names a file is either read or
//! written.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::model::Model;
use crate::output;
use clap::ArgMatches;

use super::Error;

/// Arguments that name a file to write.
const WRITTEN: [&str; 7] = [
    "output",
    "html",
    "truth",
    "coefficients",
    "factors",
    "record",
    "slow",
];
/// Arguments that name a file which may be written again on purpose.
const UPDATED: [&str; 3] = ["model", "urdf", "mjcf"];
/// Arguments that name logs, motions and models that are read.
const LOGS: [&str; 11] = [
    "logs", "log", "blocks", "from", "motion", "follow", "models", "explain", "factor", "image",
    "shapes",
];

/// What stands where a file is to go.
enum Standing {
    /// Nothing that could be lost.
    Free,
    /// A result of proprio's that can be made again.
    Own(&'static str),
    /// Something else.
    Foreign(String),
}

/// Refuses a command that would lose a file; else what to say, once the command has done its work, of those that it replaces.
pub(super) fn check(command: &ArgMatches, force: bool) -> Result<Vec<String>, Error> {
    let kept = paths(command, &UPDATED);
    let logs = paths(command, &LOGS);
    let mut notes = Vec::new();
    for output in paths(command, &WRITTEN) {
        // A device or a pipe holds nothing that writing would replace.
        if output::is_stream(&output) {
            continue;
        }
        if logs.iter().any(|log| is_same(log, &output)) {
            return Err(Error::WouldReplaceLog(output));
        }
        if kept.iter().any(|kept| is_same(kept, &output)) {
            continue;
        }
        match standing(&output) {
            Standing::Free => {}
            Standing::Own(what) => notes.push(note(&output, what)),
            Standing::Foreign(what) if force => notes.push(note(&output, &what)),
            Standing::Foreign(what) => return Err(Error::WouldReplace { path: output, what }),
        }
    }
    Ok(notes)
}

fn note(path: &Path, what: &str) -> String {
    format!("note: {}, {what}, was replaced", path.display())
}

/// The paths that arguments of these names hold.
fn paths(command: &ArgMatches, names: &[&str]) -> Vec<PathBuf> {
    let known = names
        .iter()
        .filter(|name| command.ids().any(|id| id == **name));
    let paths = known.filter_map(|name| command.try_get_many::<PathBuf>(name).ok().flatten());
    paths.flatten().cloned().collect()
}

fn is_same(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

/// Length of a file that may be a model, bytes: one of a hundred joints takes a tenth.
const LONGEST_MODEL: u64 = 1 << 20;

fn standing(path: &Path) -> Standing {
    let Ok(metadata) = fs::metadata(path) else {
        return Standing::Free;
    };
    if !metadata.is_file() || metadata.len() == 0 {
        return Standing::Free;
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(4096).read_to_end(&mut start));
    let start = String::from_utf8_lossy(&start);
    if read.is_err() {
        return Standing::Foreign("which cannot be read".to_owned());
    }
    if start.contains("<meta name=\"generator\" content=\"proprio") {
        return Standing::Own("a report of proprio");
    }
    if start.starts_with('{') && is_result(path) {
        return Standing::Own("a result of proprio");
    }
    if start.starts_with("PAR1") && crate::fleet::table::is_ours(path) {
        return Standing::Own("a table of blocks");
    }
    // The columns of `excite` alone.
    let header = start.lines().next().unwrap_or_default();
    if header.starts_with("t,") && ["ddq/", "kp/", "kd/"].iter().all(|of| header.contains(of)) {
        return Standing::Own("a designed motion");
    }
    // Those of `excite --poses`: positions and nothing measured.
    if !header.is_empty() && header.split(',').all(|name| name.starts_with("q/")) {
        return Standing::Own("a list of poses");
    }
    // Beside `log.truth.json` only the log itself is simulated, not a capture `log.cap` of a bus, which nothing makes again.
    let is_log = header.split(',').any(|name| name.starts_with("q/"));
    if is_log && path.with_extension("truth.json").exists() {
        return Standing::Own("a simulated log");
    }
    // A longer one is a log, of which a reader of TOML would take many times the length in memory.
    if metadata.len() <= LONGEST_MODEL
        && let Ok(model) = Model::load(path)
    {
        let effects = model.effects().len();
        let logs = model
            .provenance()
            .map_or(0, |provenance| provenance.logs.len());
        return Standing::Foreign(format!(
            "a model of {effects} effects, identified from {logs} logs"
        ));
    }
    Standing::Foreign("which proprio did not make".to_owned())
}

/// Whether a file holds what a command prints with --json, or the truth of a simulation.
fn is_result(path: &Path) -> bool {
    let text = fs::read_to_string(path).unwrap_or_default();
    let value: Option<serde_json::Value> = serde_json::from_str(&text).ok();
    let of = |key| value.as_ref().and_then(|value| value.get(key));
    let schema = of("schema").and_then(serde_json::Value::as_str);
    let is_truth = of("parameters").is_some() && of("seed").is_some();
    schema.is_some_and(|schema| schema.starts_with("proprio.")) || is_truth
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// A new argument that names a file must be put on one of the lists, or on this one.
    #[test]
    fn every_argument_that_names_a_file_is_known() {
        let path = clap::value_parser!(PathBuf).type_id();
        for command in super::super::Arguments::command().get_subcommands() {
            for argument in command.get_arguments() {
                let id = argument.get_id().as_str();
                let lists = [&WRITTEN[..], &UPDATED, &LOGS];
                let known = lists.iter().any(|list| list.contains(&id));
                let is_path = argument.get_value_parser().type_id() == path;
                assert!(known || !is_path, "{} {id}", command.get_name());
            }
        }
    }

    /// A log that is simulated may be made again; a capture of a bus that lies beside its truth may not.
    #[test]
    fn only_the_log_of_a_truth_is_simulated() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("log.truth.json"), "{}").unwrap();
        for (name, text, own) in [
            ("log.csv", "t,q/hip,dq/hip\n0,0,0\n", true),
            ("log.csv", "q/hip,x/hand,y/hand,z/hand\n0,0,0,0\n", true),
            ("log.cap", "\u{1}capture of a bus", false),
        ] {
            fs::write(at(name), text).unwrap();
            let found = standing(&at(name));
            assert_eq!(matches!(found, Standing::Own(_)), own, "{name}");
        }
    }
}
