//! What `diagnose --free-base` names of what a simulated robot that walks hides: `cargo run --release -p proprio-studies --bin walk_battery -- --accept`.
//!
//! Ten kinds of hidden effect and complete robots, each on robots of their own seeds, places and gaits, through the `proprio` command, from the CAD and
//! twenty seconds of log. A minute of one core a robot, two where the machine is busy. Prints the table; `--accept` keeps it in
//! `studies/battery/walk_table.md`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use proprio_core::go2::JOINT_NAMES;
use proprio_studies::battery::{self, run};
use serde_json::Value;

/// A kind of hidden effect: its name here, what `--hide` calls it, its value, and the ends of the names of joints that may have it.
type Kind = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
);

const ALL: &[&str] = &["_hip", "_thigh", "_calf"];
const CARRIED: &[&str] = &["_thigh", "_calf"];
/// Sizes are of a drive in need of repair: of ten deviations or more on most joints (a Stribeck torque acts where equations are left out for stiction).
const KINDS: [Kind; 11] = [
    ("load friction", "load_friction", "0.12", CARRIED),
    ("quadratic drag", "quadratic_drag", "0.03", ALL),
    ("Stribeck friction", "stribeck", "0.8", ALL),
    ("presliding", "presliding", "0.8,zs=0.08", ALL),
    ("spring", "spring", "4", ALL),
    ("torque gain", "torque_gain", "1.15", ALL),
    ("encoder offset", "encoder_offset", "0.06", ALL),
    ("delay of one joint", "delay", "0.006", ALL),
    ("payload", "payload", "0.4", CARRIED),
    ("coupling", "coupled_armature", "0.01", CARRIED),
    ("nothing", "", "", ALL),
];
const GAITS: [&str; 4] = ["trot", "trot", "flying", "hop"];
/// Effects of every drive, which a model from the CAD lacks.
const DRIVE: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];

/// What `diagnose --free-base` names of what a robot that walks hides
#[derive(Parser)]
struct Arguments {
    /// Robots of each kind
    #[arg(long, default_value_t = 10)]
    robots: u64,
    /// The first one's seed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep the table
    #[arg(long)]
    accept: bool,
    /// Where the logs are made
    #[arg(long, default_value = "target/walk_battery")]
    folder: PathBuf,
    /// The command to be judged [default: the one of this repository, built]
    #[arg(long, value_name = "FILE")]
    proprio: Option<PathBuf>,
}

/// What was named of one robot.
#[derive(Default)]
struct Named {
    /// The hidden effect at its joint before all others beyond the drive's, and at the end; a payload there also as a body heavier than the CAD's.
    first: bool,
    at_end: bool,
    /// Effects at the end that are not hidden, and payloads among them.
    false_names: usize,
    false_loads: usize,
}

fn main() -> ExitCode {
    battery::ended("walk_battery", table(&Arguments::parse()))
}

fn table(arguments: &Arguments) -> Result<(), String> {
    let program = battery::ready(arguments.proprio.as_deref(), &arguments.folder)?;
    let mut text = format!(
        "# Robots that walk\n\nSimulated Go2s whose bodies are 3 % off the CAD and whose drives have usual friction, rotors and offsets; 20 s of \
         trots, flying trots and hops; one effect hidden. A payload counts at the end as a body heavier than the CAD's too. Made by `cargo run --release -p proprio-studies --bin walk_battery -- --robots {} \
         --accept`.\n\n| hidden | size | robots | named first | at the end | false effects | false payloads |\n|---|---|---|---|---|---|---|\n",
        arguments.robots
    );
    for kind in KINDS {
        let mut all = Vec::new();
        for seed in arguments.seed..arguments.seed + arguments.robots {
            let one = of_robot(&program, &arguments.folder, kind, seed)?;
            eprintln!(
                "{} {seed}: first {}, at the end {}, {} false, {} false payloads",
                kind.0, one.first, one.at_end, one.false_names, one.false_loads
            );
            all.push(one);
        }
        let count = |is: &dyn Fn(&Named) -> bool| all.iter().filter(|own| is(own)).count();
        let (first, end) = match kind.1 {
            "" => ("–".to_owned(), "–".to_owned()),
            _ => (
                count(&|own| own.first).to_string(),
                count(&|own| own.at_end).to_string(),
            ),
        };
        text += &format!(
            "| {} | {} | {} | {first} | {end} | {} | {} |\n",
            kind.0,
            kind.2,
            all.len(),
            all.iter().map(|own| own.false_names).sum::<usize>(),
            all.iter().map(|own| own.false_loads).sum::<usize>(),
        );
    }
    println!("{text}");
    if arguments.accept {
        let path = battery::folder().join("walk_table.md");
        std::fs::write(&path, &text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

fn of_robot(program: &Path, folder: &Path, kind: Kind, seed: u64) -> Result<Named, String> {
    let (name, effect, value, ends) = kind;
    let joints = JOINT_NAMES
        .iter()
        .filter(|joint| ends.iter().any(|end| joint.ends_with(end)));
    let joints: Vec<&str> = joints.copied().collect();
    let joint = joints[(7 * seed as usize + 3) % joints.len()];
    let log = folder.join(format!("{}_{seed}.csv", name.replace(' ', "_")));
    let (seed_text, hidden) = (seed.to_string(), format!("{effect}:{joint}={value}"));
    let mut simulate = vec![
        "simulate",
        "--walk",
        GAITS[seed as usize % GAITS.len()],
        "--seed",
        &seed_text,
    ];
    simulate.extend(["--typical", "--inertia-error", "0.03", "--duration", "20"]);
    if !effect.is_empty() {
        simulate.extend(["--hide", &hidden]);
    }
    let path = log.to_str().ok_or("a folder that is no text")?;
    run(program, &[&simulate[..], &["-o", path]].concat())?;
    let found = run(program, &["diagnose", "--free-base", "--json", path])?;
    let found: Value = serde_json::from_str(&found).map_err(|e| e.to_string())?;
    let mut at_end: Vec<(String, String)> = Vec::new();
    let mut first = None;
    for step in found["path"].as_array().into_iter().flatten() {
        let own = step["effect"].as_str().unwrap_or_default();
        if own.is_empty() || DRIVE.contains(&own) {
            continue;
        }
        for at in step["joints"].as_array().into_iter().flatten() {
            let place = (own.to_owned(), at.as_str().unwrap_or_default().to_owned());
            if step["step"] == "remove" {
                at_end.retain(|known| *known != place);
            } else {
                first.get_or_insert(place.clone());
                at_end.push(place);
            }
        }
    }
    let is_it = |(e, at): &(String, String)| e == effect && at == joint;
    // A load may be said of the body that it makes heavier.
    let bodies = found["bodies"].as_array().into_iter().flatten();
    let mut heavier = bodies.filter_map(|body| body.as_str()?.split_once(": mass "));
    let is_heavier = effect == "payload" && heavier.any(|(link, _)| link == joint);
    Ok(Named {
        first: first.as_ref().is_some_and(is_it),
        at_end: is_heavier || at_end.iter().any(is_it),
        false_names: at_end.iter().filter(|own| !is_it(own)).count(),
        false_loads: at_end
            .iter()
            .filter(|own| own.0 == "payload" && !is_it(own))
            .count(),
    })
}
