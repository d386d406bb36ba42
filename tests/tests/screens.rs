//! Every command that a first screen prints runs as it is printed, and so does every one that it prints in turn.

use std::collections::{BTreeSet, VecDeque};
use std::process::{Command, Output};

use proprio_tests::command::{binary, simulated, stderr, stdout};
use tempfile::TempDir;

/// Where a user begins: with a log, with a model file of it, with the log of another day.
const BEGINNINGS: &str = "\
proprio compare log.csv
proprio diagnose log.csv
proprio identify log.csv
proprio advise log.csv
proprio identify log.csv -m model.toml -o fitted.toml
proprio compare other.csv -m fitted.toml
proprio diagnose other.csv -m fitted.toml
proprio show fitted.toml";

/// Long enough for a search to have a motion, s: Ctrl-C ends it with the best so far.
const PATIENCE: &str = "6";

/// Runs a line as a shell does.
fn typed(folder: &TempDir, line: &str) -> Output {
    let path = std::env::var("PATH").unwrap_or_default();
    let ours = binary().parent().unwrap().display().to_string();
    let patient = [
        "--foreground",
        "--preserve-status",
        "--signal=INT",
        PATIENCE,
        "sh",
        "-c",
    ];
    Command::new("timeout")
        .args(patient)
        // Without `exec` the interrupt ends the shell alone.
        .arg(format!("exec {line}"))
        .env("PATH", format!("{ours}:{path}"))
        .env_remove("COLUMNS")
        .current_dir(folder.path())
        .output()
        .unwrap()
}

/// The commands in a screen: each ends its line.
fn printed(screen: &str) -> impl Iterator<Item = String> + '_ {
    let command = |line: &str| line.find("proprio ").map(|at| line[at..].to_owned());
    screen
        .lines()
        .filter(|line| !line.starts_with("More:"))
        .filter_map(command)
}

#[cfg(unix)]
#[test]
fn every_command_that_a_screen_prints_runs() {
    let folder = simulated("--legs FR --typical --duration 8");
    let other = "proprio simulate --legs FR --typical --hide spring:FR_thigh=4 --seed 2 --duration 8 -o other.csv";
    let model = "proprio add viscous coulomb armature bias -m model.toml";
    let mut waiting: VecDeque<String> = [other, model].map(str::to_owned).into();
    waiting.extend(BEGINNINGS.lines().map(str::to_owned));
    let mut seen: BTreeSet<String> = waiting.iter().cloned().collect();
    let begun = seen.len();
    while let Some(line) = waiting.pop_front() {
        let output = typed(&folder, &line);
        assert_eq!(output.status.code(), Some(0), "{line}: {}", stderr(&output));
        for next in printed(&stdout(&output)) {
            if seen.insert(next.clone()) {
                waiting.push_back(next);
            }
        }
    }
    let found = seen.len() - begun;
    assert!(found >= 5, "{seen:#?}");
    for kind in ["diagnose", "compare", "advise", "excite"] {
        let is_kind = |line: &String| line.starts_with(&format!("proprio {kind} "));
        assert!(
            seen.iter().any(is_kind),
            "no screen prints {kind}: {seen:#?}"
        );
    }
}
