//! How often `diagnose` is right on logs with a truth beside them: `cargo run --release -p proprio-studies --bin battery_logged`.
//!
//! Logs that MuJoCo makes (`tests/oracle/mujoco_cases.py`), or the simulator in every noise (`--simulated`), or torques that have
//! nothing to do with the motion (`--nonsense`). Makes the logs in `target/` where they are not there yet, runs the `proprio`
//! command on each, and prints the table; ends with status 1 if a figure misses its target.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use proprio_studies::battery::{self, logged_table as table};
use proprio_tests::battery::logged::nonsense::{self, Nonsense};
use proprio_tests::battery::logged::{self, judgement::Judgement, simulated, truth};

/// Of how many cases --quick runs one: a number that shares no factor with that of an effect's cases.
const QUICK: usize = 7;
const COMMAND: &str = "cargo run --release -p proprio-studies --bin battery_logged";

/// How often `diagnose` is right on logs whose truth is known
#[derive(Debug, Parser)]
struct Arguments {
    /// Run every seventh case
    #[arg(long)]
    quick: bool,
    /// Run the cases whose name has TEXT
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Write the table to battery/: of all cases only
    #[arg(long, conflicts_with_all = ["quick", "only", "folder"])]
    accept: bool,
    /// The simulator's logs, in every noise
    #[arg(long)]
    simulated: bool,
    /// Torques that have nothing to do with the motion: what does each effect explain of them?
    #[arg(long, conflicts_with_all = ["quick", "only", "folder", "accept", "simulated", "make"])]
    nonsense: bool,
    /// The cases of this folder
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// Make the logs anew
    #[arg(long, conflicts_with = "folder")]
    make: bool,
    /// The command to be judged [default: the one of this repository, built]
    #[arg(long, value_name = "FILE")]
    proprio: Option<PathBuf>,
}

fn main() -> ExitCode {
    match judged(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("battery_logged: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all targets are met.
fn judged(arguments: &Arguments) -> Result<bool, String> {
    let program = match &arguments.proprio {
        Some(program) => program.clone(),
        None => battery::built()?,
    };
    if arguments.nonsense {
        return explains_nothing(&program);
    }
    let folder = made(arguments)?;
    let is_full = !arguments.quick && arguments.only.is_none();
    let mut cases = truth::cases(&folder)?;
    if arguments.accept {
        all_there(&cases, &listed(arguments)?)?;
    }
    if let Some(text) = &arguments.only {
        cases.retain(|case| case.truth.name.contains(text.as_str()));
    }
    if arguments.quick {
        cases = cases.into_iter().step_by(QUICK).collect();
    }
    if cases.is_empty() {
        return Err(format!("no such case in {}", folder.display()));
    }
    let judgements = run(&program, &cases);
    let (title, command, file) = if arguments.simulated {
        (
            "Simulated logs in noise",
            format!("{COMMAND} -- --simulated"),
            "simulated_table.md",
        )
    } else {
        ("Logs by MuJoCo", COMMAND.to_owned(), "mujoco_table.md")
    };
    let text = table::text(title, &command, &judgements);
    println!("{text}");
    if arguments.accept {
        let path = battery::folder().join(file);
        std::fs::write(&path, &text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let missed: Vec<table::Figure> = table::figures(&judgements)
        .into_iter()
        .filter(|figure| !figure.is_met())
        .collect();
    for figure in &missed {
        eprintln!("battery_logged: missed: {}", figure.what);
    }
    if !is_full {
        eprintln!("battery_logged: {} cases of the list only", cases.len());
    }
    Ok(missed.is_empty())
}

/// The folder of the logs, which are made if need be.
fn made(arguments: &Arguments) -> Result<PathBuf, String> {
    if let Some(folder) = &arguments.folder {
        return Ok(folder.clone());
    }
    if !arguments.simulated {
        let folder = logged::mujoco_folder();
        if arguments.make || !folder.is_dir() {
            let to = [
                "-o".as_ref(),
                folder.as_os_str(),
                "--jobs".as_ref(),
                "2".as_ref(),
            ];
            logged::generate("mujoco_cases.py", &to)?;
        }
        return Ok(folder);
    }
    let folder = logged::simulated_folder();
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut cases = simulated::all();
    cases.retain(|case| {
        let name = case.name();
        let is_asked = (arguments.only.as_ref()).is_none_or(|text| name.contains(text.as_str()));
        let is_there = folder.join(format!("{name}.json")).exists();
        is_asked && (arguments.make || !is_there)
    });
    if arguments.quick {
        cases = cases.into_iter().step_by(QUICK).collect();
    }
    simulated::write(&cases, &folder, |done| {
        eprint!("\r{done} of {} logs made", cases.len());
    })?;
    Ok(folder)
}

/// The names of the whole list.
fn listed(arguments: &Arguments) -> Result<Vec<String>, String> {
    #[derive(serde::Deserialize)]
    struct Named {
        name: String,
    }
    if arguments.simulated {
        return Ok(simulated::all()
            .iter()
            .map(simulated::NoisyCase::name)
            .collect());
    }
    let path = proprio_tests::battery::folder().join("mujoco_cases.json");
    let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let text = std::fs::read_to_string(&path).map_err(|e| wrong(&e))?;
    let list: Vec<Named> = serde_json::from_str(&text).map_err(|e| wrong(&e))?;
    Ok(list.into_iter().map(|case| case.name).collect())
}

/// The table stands for the whole list and nothing else.
fn all_there(cases: &[truth::LoggedCase], listed: &[String]) -> Result<(), String> {
    let made: BTreeSet<&str> = cases.iter().map(|case| case.truth.name.as_str()).collect();
    let listed: BTreeSet<&str> = listed.iter().map(String::as_str).collect();
    if made == listed {
        return Ok(());
    }
    let (made, listed) = (made.len(), listed.len());
    Err(format!(
        "{made} logs are made, {listed} listed: --make makes them anew"
    ))
}

/// Whether no effect explains more than [`nonsense::MOST`] of a torque that has nothing to do with the motion.
fn explains_nothing(program: &Path) -> Result<bool, String> {
    let mut honest = true;
    println!("| torque | joint | effect | R², % |\n|---|---|---|---|");
    for of in Nonsense::ALL {
        for place in 0..3 {
            for explained in nonsense::explained(program, of, place, 1 + place as u64)? {
                honest &= explained.r2 <= nonsense::MOST;
                let effect = explained.effect.unwrap_or("the plain four");
                let r2 = 100.0 * explained.r2;
                println!("| {of:?} | {} | {effect} | {r2:.1} |", explained.joint);
            }
        }
    }
    Ok(honest)
}

fn run(program: &Path, cases: &[truth::LoggedCase]) -> Vec<Judgement> {
    let start = Instant::now();
    let judgements = logged::run(program, cases, |done| {
        let seconds = start.elapsed().as_secs_f64();
        eprint!("\r{done} of {} cases, {seconds:.0} s", cases.len());
    });
    eprintln!();
    judgements
}
