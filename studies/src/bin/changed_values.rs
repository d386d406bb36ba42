//! What `diagnose` says of a value that is no longer the file's: `cargo run --release -p proprio-studies --bin changed_values -- --accept`.
//!
//! Each robot is identified on one motion; then it makes another motion, once as it was and once with one value of its drives changed by some standard
//! deviations of the difference between both logs' values. All through the `proprio` command. Two minutes of one core for ten robots. Prints the table;
//! `--accept` keeps it in `studies/battery/changed_values.md`.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use proprio_core::go2::JOINT_NAMES;
use proprio_studies::battery::{self, run};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

const KINDS: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];
const SIZES: [f64; 5] = [3.0, 5.0, 8.0, 15.0, 50.0];
const RATES: [&str; 3] = ["250", "500", "1000"];
const MOTIONS: [&str; 3] = ["multisine", "chirp", "moves"];

/// What `diagnose` says of a value that is no longer the file's
#[derive(Parser)]
struct Arguments {
    /// Robots
    #[arg(long, default_value_t = 40)]
    robots: u64,
    /// The first one's seed
    #[arg(long, default_value_t = 100)]
    seed: u64,
    /// Keep the table
    #[arg(long)]
    accept: bool,
    /// Where the logs are made
    #[arg(long, default_value = "target/changed_values")]
    folder: PathBuf,
    /// The command to be judged [default: the one of this repository, built]
    #[arg(long, value_name = "FILE")]
    proprio: Option<PathBuf>,
}

/// Of a robot.
struct Judged {
    /// By how many standard deviations a value was changed.
    size: f64,
    /// The value is named, and before all others.
    named: bool,
    first: bool,
    /// Other values that are named of the changed robot, and any of the one as it was.
    others: usize,
    of_unchanged: usize,
    /// Effects that are named of the one as it was.
    effects: usize,
}

fn main() -> ExitCode {
    battery::ended("changed_values", table(&Arguments::parse()))
}

fn table(arguments: &Arguments) -> Result<(), String> {
    let program = battery::ready(arguments.proprio.as_deref(), &arguments.folder)?;
    let mut all = Vec::new();
    for seed in arguments.seed..arguments.seed + arguments.robots {
        let own = of_robot(&program, &arguments.folder, seed)?;
        eprintln!(
            "{seed}: {} σ, named {}, {} others; unchanged: {} values, {} effects",
            own.size, own.named, own.others, own.of_unchanged, own.effects
        );
        all.push(own);
    }
    let mut text = format!(
        "# Values that have changed\n\nSimulated Go2s whose bodies are 3 % off the CAD, identified on one motion of 20 s and diagnosed on another, 250 to 1000 Hz; one value of one \
         joint's drive (viscous, Coulomb, armature, bias) changed by so many standard deviations of the difference of both logs' values. The last column is of \
         the same robots as they were. Made by `cargo run --release -p proprio-studies --bin changed_values -- --robots {} --seed {} --accept`.\n\n\
         | changed by | robots | named | named first | other values named | named of the unchanged robot: values, effects |\n|---|---|---|---|---|---|\n",
        arguments.robots, arguments.seed
    );
    for size in SIZES {
        let own: Vec<&Judged> = all.iter().filter(|one| one.size == size).collect();
        let count = |of: &dyn Fn(&Judged) -> usize| own.iter().map(|one| of(one)).sum::<usize>();
        let _ = writeln!(
            text,
            "| {size} σ | {} | {} | {} | {} | {}, {} |",
            own.len(),
            count(&|one| usize::from(one.named)),
            count(&|one| usize::from(one.first)),
            count(&|one| one.others),
            count(&|one| one.of_unchanged),
            count(&|one| one.effects),
        );
    }
    println!("{text}");
    if arguments.accept {
        let path = battery::folder().join("changed_values.md");
        std::fs::write(&path, &text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

fn of_robot(program: &Path, folder: &Path, seed: u64) -> Result<Judged, String> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |all: &[&'static str]| all.choose(&mut random).copied().unwrap_or_default();
    let (kind, joint, rate) = (draw(&KINDS), draw(&JOINT_NAMES), draw(&RATES));
    let first = draw(&MOTIONS);
    let others: Vec<&str> = MOTIONS.into_iter().filter(|own| *own != first).collect();
    let second = draw(&others);
    let size = SIZES.choose(&mut random).copied().unwrap_or_default();
    let way = if random.random_bool(0.3) { -1.0 } else { 1.0 };
    let name = format!("{kind}:{joint}");

    let path = |name: &str| folder.join(format!("{seed}_{name}")).display().to_string();
    let [before, after, plain, model] =
        ["before.csv", "after.csv", "plain.toml", "model.toml"].map(path);
    let seed = seed.to_string();
    let simulate = |motion: &str, to: &str, hide: &[&str]| {
        let robot = [
            "simulate",
            "--typical",
            "--inertia-error",
            "0.03",
            "--force",
        ];
        let log = [
            "--seed", &seed, "--rate", rate, "--motion", motion, "-o", to,
        ];
        run(program, &[&robot[..], &log, hide].concat())
    };
    let identified = |log: &str| -> Result<[f64; 2], String> {
        let arguments = [
            "identify", log, "-m", &plain, "-o", &model, "--force", "--json",
        ];
        let fitted = parsed(&run(program, &arguments)?)?;
        let mut all = fitted["parameters"].as_array().into_iter().flatten();
        let own = all.rfind(|own| own["name"] == *name);
        let own = own.ok_or_else(|| format!("no {name} in {log}"))?;
        Ok(["value", "std"].map(|key| own[key].as_f64().unwrap_or_default()))
    };
    let _ = std::fs::remove_file(&plain);
    run(program, &[&["add"], &KINDS[..], &["-m", &plain]].concat())?;
    simulate(second, &after, &[])?;
    let [_, std_after] = identified(&after)?;
    simulate(first, &before, &[])?;
    let [value, std] = identified(&before)?;
    let diagnose = [
        "diagnose",
        &after,
        "-m",
        &model,
        "--catalogue-only",
        "--json",
    ];
    let unchanged = parsed(&run(program, &diagnose)?)?;

    let step = size * std.hypot(std_after);
    let is_possible = kind == "bias" || value + way * step >= 0.0;
    let changed = value + if is_possible { way * step } else { step };
    simulate(second, &after, &["--hide", &format!("{name}={changed}")])?;
    let found = parsed(&run(program, &diagnose)?)?;
    let moved = |of: &Value| -> Vec<String> {
        let all = of["moved"].as_array().into_iter().flatten();
        all.filter_map(|own| Some(own["name"].as_str()?.to_owned()))
            .collect()
    };
    let is_added = |step: &&Value| step["step"] == "add";
    let named = moved(&found);
    Ok(Judged {
        size,
        named: named.contains(&name),
        first: named.first() == Some(&name),
        others: named.iter().filter(|own| **own != name).count(),
        of_unchanged: moved(&unchanged).len(),
        effects: (unchanged["path"].as_array().into_iter().flatten())
            .filter(is_added)
            .count(),
    })
}

fn parsed(text: &str) -> Result<Value, String> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}
