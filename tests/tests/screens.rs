//! First screens: each fits a terminal, and every command that one prints runs as it is printed, and so does every one that it prints in turn.

use std::collections::{BTreeSet, VecDeque};
use std::process::{Command, Output};

use proprio_host::model::Limb;
use proprio_tests::command::{binary, simulated, stderr, stdout};
use proprio_tests::recorder::Recorder;
use tempfile::TempDir;

use crate::other_robot::{ARM, TYPICAL, robot, with_model};

/// Where a user begins: with a log, with a model file of it, with the log of another day.
const BEGINNINGS: &str = "\
proprio compare log.csv
proprio diagnose log.csv
proprio identify log.csv
proprio advise log.csv
proprio identify log.csv -m model.toml -o fitted.toml
proprio compare other.csv -m fitted.toml
proprio compare other.csv -m fitted.toml --rollout
proprio diagnose other.csv -m fitted.toml
proprio diagnose log.csv --apply -m applied.toml
proprio show fitted.toml
proprio effects
proprio validate other.csv
proprio demo";

/// The same of an arm and of a robot that walks.
const OTHERS: &str = "\
proprio identify log.csv -m model.toml -o fitted.toml
proprio compare log.csv -m fitted.toml
proprio diagnose log.csv -m model.toml
proprio advise log.csv -m model.toml
proprio show fitted.toml
proprio simulate --walk trot --typical --inertia-error 0.03 -o walk.csv
proprio compare walk.csv
proprio identify --free-base walk.csv -o walked.toml
proprio compare --free-base walk.csv -m walked.toml
proprio diagnose --free-base walk.csv
proprio diagnose --free-base walk.csv -m go2.toml --apply";

/// Lines and columns of a first screen.
const SCREEN: [usize; 2] = [15, 80];

/// Long enough for a search to have a motion, s: Ctrl-C ends it with the best so far.
const PATIENCE: u32 = 6;

/// Runs a line as a shell does.
fn typed(folder: &TempDir, line: &str, patience: u32) -> Output {
    let path = std::env::var("PATH").unwrap_or_default();
    let ours = binary().parent().unwrap().display().to_string();
    let patient = [
        "--foreground",
        "--preserve-status",
        "--signal=INT",
        &patience.to_string(),
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

/// Whether a first screen fits a terminal; a command is as long as its logs' names.
fn fits(line: &str, screen: &str) {
    let [lines, columns] = SCREEN;
    assert!(screen.lines().count() <= lines, "{line}:\n{screen}");
    let is_command = |line: &&str| line.starts_with("Next: ");
    let widest = (screen.lines().filter(|line| !is_command(line)))
        .map(|line| line.chars().count())
        .max();
    assert!(widest <= Some(columns), "{line}:\n{screen}");
    println!("$ {line}\n{screen}");
}

/// Runs lines, and what their screens print, and what those print; all of them fit. What was run.
fn run_all(folder: &TempDir, lines: impl Iterator<Item = String>) -> BTreeSet<String> {
    let mut waiting: VecDeque<String> = lines.collect();
    let mut seen: BTreeSet<String> = waiting.iter().cloned().collect();
    while let Some(line) = waiting.pop_front() {
        let patience = if line.contains("excite") {
            PATIENCE
        } else {
            300
        };
        let output = typed(folder, &line, patience);
        assert_eq!(output.status.code(), Some(0), "{line}: {}", stderr(&output));
        fits(&line, &stdout(&output));
        for next in printed(&stdout(&output)) {
            if seen.insert(next.clone()) {
                waiting.push_back(next);
            }
        }
    }
    seen
}

#[cfg(unix)]
#[test]
fn every_command_that_a_screen_of_an_arm_or_of_a_walk_prints_runs() {
    let folder = with_model(ARM, &TYPICAL);
    let recorder = Recorder::new(robot(folder.path()));
    let limbs = recorder.model.robot().limbs();
    let limbs: Vec<&Limb> = limbs.iter().collect();
    std::fs::write(folder.path().join("log.csv"), recorder.log::<4>(&limbs)).unwrap();
    let seen = run_all(&folder, OTHERS.lines().map(str::to_owned));
    assert!(seen.len() > OTHERS.lines().count(), "{seen:#?}");
    // A walk that is taken for a suspended robot is sent where it belongs.
    assert!(
        seen.contains("proprio compare --free-base walk.csv"),
        "{seen:#?}"
    );
    let watched = typed(
        &folder,
        "proprio monitor walk.csv --speed 0 --lines",
        PATIENCE,
    );
    let said = stdout(&watched);
    assert!(said.contains("a robot that walks: --free-base"), "{said}");
}

#[cfg(unix)]
#[test]
fn every_command_that_a_screen_prints_runs() {
    let folder = simulated("--legs FR --typical --duration 8");
    let other = "proprio simulate --legs FR --typical --hide spring:FR_thigh=4 --seed 2 --duration 8 -o other.csv";
    let model = "proprio add viscous coulomb armature bias -m model.toml";
    let lines = [other, model].into_iter().chain(BEGINNINGS.lines());
    let begun = lines.clone().count();
    let seen = run_all(&folder, lines.map(str::to_owned));
    assert!(seen.len() >= begun + 5, "{seen:#?}");
    // A fit that was written goes to where it is used: its own logs do not judge it.
    assert!(
        seen.contains("proprio export -m fitted.toml --mjcf -o fitted.xml"),
        "{seen:#?}"
    );
    for kind in ["diagnose", "compare", "advise", "excite"] {
        let is_kind = |line: &String| line.starts_with(&format!("proprio {kind} "));
        assert!(
            seen.iter().any(is_kind),
            "no screen prints {kind}: {seen:#?}"
        );
    }
}
