//! How often `diagnose` names what was hidden: `cargo run --release -p proprio-tests --bin battery`.
//!
//! Prints the table of all cases, and ends with status 1 if a case did not go as `tests/battery/cases.csv` says. `-- --accept`
//! writes both, of the cases run; `-- --quick` runs every eleventh case; `-- --case coulomb:FR_calf:2:1` shows one; `-- --only TEXT` those whose
//! name has TEXT.

use std::process::ExitCode;
use std::time::Instant;

use proprio::criticism::diagnose;
use proprio_tests::battery::case::{self, Case};
use proprio_tests::battery::outcome::{self, Bench, Outcome};
use proprio_tests::battery::{self, mujoco, record, table};

/// Of how many cases --quick runs one.
const QUICK: usize = 11;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |name: &str| arguments.iter().any(|a| a == name);
    let after = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)
    };
    if let Some(name) = after("--case") {
        return show(name);
    }
    let mut cases = case::all();
    if let Some(text) = after("--only") {
        cases.retain(|case| case.to_string().contains(text.as_str()));
    }
    if has("--quick") {
        cases = cases.into_iter().step_by(QUICK).collect();
    }
    let outcomes = run(&cases);
    let mujoco = if after("--only").is_none() {
        mujoco::run()
    } else {
        Vec::new()
    };
    println!("{}", table::text(&outcomes, &mujoco));
    let all: Vec<Outcome> = outcomes.iter().chain(&mujoco).cloned().collect();
    if has("--accept") {
        let written = std::fs::write(record::path(), record::text(&all))
            .and_then(|()| std::fs::write(table::path(), table::text(&outcomes, &mujoco)));
        if let Err(error) = written {
            eprintln!("battery: {error}");
            return ExitCode::FAILURE;
        }
        return ExitCode::SUCCESS;
    }
    let committed = std::fs::read_to_string(record::path()).unwrap_or_default();
    let differences = record::differences(&all, &committed);
    for difference in &differences {
        println!("{difference}");
    }
    if differences.is_empty() {
        println!("as {}", record::path().display());
        ExitCode::SUCCESS
    } else {
        eprintln!("battery: {} cases are not as committed", differences.len());
        ExitCode::FAILURE
    }
}

fn run(cases: &[Case]) -> Vec<Outcome> {
    let start = Instant::now();
    let outcomes = battery::run(cases, |done| {
        let seconds = start.elapsed().as_secs_f64();
        eprint!("\r{done} of {} cases, {seconds:.0} s", cases.len());
    });
    eprintln!();
    outcomes
}

/// Everything about one case.
fn show(name: &str) -> ExitCode {
    let case: Case = match name.parse() {
        Ok(case) => case,
        Err(error) => {
            eprintln!("battery: {error}");
            return ExitCode::from(2);
        }
    };
    for effect in &case.hidden {
        println!("hidden {} = {:?}", effect.place(), effect.values());
    }
    match diagnose(&outcome::record(&case), &case.model()) {
        Ok(diagnosis) => {
            println!("{diagnosis}\n{}", diagnosis.ladder());
            for candidate in diagnosis.candidates.iter().take(12) {
                println!("{candidate:?}");
            }
            for line in &diagnosis.outside_catalogue {
                println!("outside: {line}");
            }
        }
        Err(error) => println!("{error}"),
    }
    println!("{:#?}", Bench::default().run(&case));
    ExitCode::SUCCESS
}
