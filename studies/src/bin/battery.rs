//! How often `diagnose` names what was hidden: `cargo run --release -p proprio-studies --bin battery`.
//!
//! Prints the table of all cases, and ends with status 1 if a case did not go as `tests/battery/cases.csv` says.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use proprio_host::diagnose::diagnose;
use proprio_studies::battery::{mujoco, table};
use proprio_tests::battery::case::{self, Case};
use proprio_tests::battery::outcome::{self, Bench, Outcome};
use proprio_tests::battery::{self, record};

/// Of how many cases --quick runs one.
const QUICK: usize = 11;

/// How often `diagnose` names what was hidden
#[derive(Debug, Parser)]
struct Arguments {
    /// Run every eleventh case
    #[arg(long)]
    quick: bool,
    /// Run the cases whose name has TEXT
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Write the table, and tests/battery/cases.csv of the cases run, instead of comparing with them
    #[arg(long)]
    accept: bool,
    /// Other robots, motions and noise: N is added to every seed, and nothing is compared
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "accept")]
    fresh: u64,
    /// Show everything about one case, such as coulomb:FR_calf:2:1
    #[arg(long, value_name = "NAME", exclusive = true)]
    case: Option<Case>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some(case) = arguments.case {
        return show(&case);
    }
    let mut cases = case::all();
    if let Some(text) = &arguments.only {
        cases.retain(|case| case.to_string().contains(text.as_str()));
    }
    if arguments.quick {
        cases = cases.into_iter().step_by(QUICK).collect();
    }
    cases
        .iter_mut()
        .for_each(|case| case.seed += arguments.fresh);
    let outcomes = run(&cases);
    if arguments.fresh > 0 {
        println!("{}", table::text(&outcomes, &[]));
        return ExitCode::SUCCESS;
    }
    let mujoco = if arguments.only.is_none() {
        mujoco::run()
    } else {
        Vec::new()
    };
    println!("{}", table::text(&outcomes, &mujoco));
    let all: Vec<Outcome> = outcomes.iter().chain(&mujoco).cloned().collect();
    if arguments.accept {
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
fn show(case: &Case) -> ExitCode {
    for effect in &case.hidden {
        println!("hidden {} = {:?}", effect.place(), effect.values());
    }
    match diagnose(&outcome::record(case), &case.model()) {
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
    println!("{:#?}", Bench::default().run(case));
    ExitCode::SUCCESS
}
