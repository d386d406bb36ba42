//! Walking robots of which all is known, judged as a user would: `cargo run --release -p proprio-studies --bin walk_study -- FOLDER --write`.
//!
//! FOLDER holds a folder for each robot and gait, as this makes them (ten seconds of work each, with the packages of
//! `tests/oracle/requirements-export.txt`):
//!
//! ```sh
//! for robot in $(seq 401 420); do for gait in trot load flying hop sway swung; do
//!     python tests/oracle/mujoco_walk.py -o FOLDER/$robot/$gait --seconds 20 --seed $robot $gait
//! done; done
//! ```
//!
//! Prints `studies/walks.md`, and with `--write` keeps it. `--only identified` and `--only diagnosed` make one of its two parts anew, which take
//! a quarter of an hour and an hour on two cores.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use proprio_core::effect::EffectKind;
use proprio_core::go2::{JOINT_NAMES, JOINTS};
use proprio_host::diagnose::{FreeBaseDiagnosis, Verdict, diagnose_free_base};
use proprio_host::estimate::{Constraint, Status};
use proprio_host::identify::{FreeBaseIdentification, identify_free_base};
use proprio_host::model::Model;
use serde_json::Value;

const GAITS: [&str; 6] = ["trot", "load", "flying", "hop", "sway", "swung"];
const EFFECTS: [EffectKind; 4] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Armature,
    EffectKind::Bias,
];

/// Walking robots of which all is known, judged as a user would
#[derive(Parser)]
struct Arguments {
    /// Folders ROBOT/GAIT with a log and its truth.json
    folder: PathBuf,
    /// Keep the table in studies/walks.md
    #[arg(long)]
    write: bool,
    /// Make this part alone anew
    #[arg(long)]
    only: Option<Part>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Part {
    Identified,
    Diagnosed,
}

/// A log and what is true of it.
struct Walk {
    log: PathBuf,
    truth: Value,
    gait: &'static str,
    robot: usize,
}

fn walks(folder: &Path, gait: &'static str) -> Vec<Walk> {
    let mut robots: Vec<PathBuf> = std::fs::read_dir(folder)
        .map(|entries| entries.flatten().map(|entry| entry.path()).collect())
        .unwrap_or_default();
    robots.sort();
    let of = |(robot, path): (usize, &PathBuf)| {
        let folder = path.join(gait);
        let text = std::fs::read_to_string(folder.join("truth.json")).ok()?;
        let truth: Value = serde_json::from_str(&text).ok()?;
        Some(Walk {
            log: folder.join(format!("{gait}.csv.gz")),
            truth: truth["logs"][gait].clone(),
            gait,
            robot,
        })
    };
    robots.iter().enumerate().filter_map(of).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// Errors of one gait's robots.
#[derive(Default)]
struct Errors {
    robots: usize,
    /// Of the total mass, relative; and in standard deviations.
    mass: Vec<f64>,
    mass_std: Vec<f64>,
    /// Of the trunk's centre of mass along each axis, m, and in standard deviations.
    com: [Vec<f64>; 3],
    com_std: Vec<f64>,
    /// Of the whole robot's, the same.
    robot: [Vec<f64>; 3],
    robot_std: Vec<f64>,
    /// Of parameters identified beyond the CAD, and of friction and rotors, in standard deviations.
    identified: Vec<f64>,
    friction: Vec<f64>,
}

impl Errors {
    fn add(&mut self, found: &FreeBaseIdentification, truth: &Value) {
        self.robots += 1;
        // What a hand bears is told by nothing.
        let carried = found.windows.held == found.windows.used;
        let quantity = |name: &str| found.quantity(name).copied().filter(|_| !carried);
        if let Some(total) = quantity("total_mass") {
            let error = total.value - number(&truth["mass"]);
            self.mass.push(error / number(&truth["mass"]));
            self.mass_std.push(error / total.std);
        }
        let base = &truth["bodies"]["base"];
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let com = number(&base[format!("h{name}")]) / number(&base["m"]);
            if let Some(found) = quantity(&format!("trunk_com_{name}")) {
                self.com[axis].push(found.value - com);
                self.com_std.push((found.value - com) / found.std);
            }
            if let Some(found) = quantity(&format!("robot_com_{name}")) {
                let error = found.value - number(&truth["com"][axis]);
                self.robot[axis].push(error);
                self.robot_std.push(error / found.std);
            }
        }
        for parameter in &found.parameters {
            let Some((what, of)) = parameter.name.split_once(':') else {
                continue;
            };
            let known = match parameter.is_inertial() {
                true => truth["bodies"][of][what].as_f64(),
                false => truth["effects"][&parameter.name].as_f64(),
            };
            let Some(known) = known.filter(|_| !parameter.at_bound) else {
                continue;
            };
            let error = (parameter.value - known) / parameter.std;
            match (parameter.is_inertial(), parameter.status) {
                (true, Status::Identified) => self.identified.push(error),
                (true, _) => {}
                (false, _) => self.friction.push(error),
            }
        }
    }

    fn row(&self, gait: &str) -> String {
        let within = |errors: &[f64], most: f64| share(errors, |x| x.abs() <= most);
        let worst = |errors: &[f64]| errors.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let places = |of: &[Vec<f64>; 3]| {
            if of[0].is_empty() {
                return "not told".to_owned();
            }
            of.each_ref()
                .map(|errors| format!("{:.1}", 1e3 * worst(errors)))
                .join(", ")
        };
        format!(
            "| {gait} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            self.robots,
            within(&self.mass, 0.01),
            if self.mass.is_empty() {
                "not told".to_owned()
            } else {
                format!("{:.2}", 100.0 * worst(&self.mass))
            },
            within(&self.mass_std, 2.0),
            places(&self.com),
            within(&self.com_std, 2.0),
            places(&self.robot),
            within(&self.robot_std, 2.0),
            within(&self.identified, 2.0),
            within(&self.identified, 3.0),
            within(&self.friction, 2.0),
            within(&self.friction, 3.0),
        )
    }
}

/// `12 of 12 (100 %)`.
fn share<T>(all: &[T], right: impl Fn(&T) -> bool) -> String {
    if all.is_empty() {
        return "not told".to_owned();
    }
    let count = all.iter().filter(|x| right(x)).count();
    let percent = 100.0 * count as f64 / all.len().max(1) as f64;
    format!("{count} of {} ({percent:.0} %)", all.len())
}

/// The Go2 with four effects everywhere, but for one at one joint.
fn model(missing: Option<(EffectKind, usize)>) -> Model {
    let mut model = Model::default();
    for joint in 0..JOINTS {
        for effect in EFFECTS.into_iter().filter(|e| Some((*e, joint)) != missing) {
            model.add_effect(effect, joint);
        }
    }
    model
}

/// One diagnosis: whether it says what is true, and how far its first value is off.
struct Told {
    right: bool,
    words: String,
    /// The value's error, relative, and in standard deviations; of a load the largest error of its place, m.
    error: f64,
    deviations: f64,
    place: f64,
}

fn told(walk: &Walk, model: &Model, expected: Option<(&str, &str, &[f64])>) -> Option<Told> {
    let found: FreeBaseDiagnosis =
        diagnose_free_base(std::slice::from_ref(&walk.log), model, false, |_, _| ()).ok()?;
    let found = found.diagnosis;
    let path: Vec<String> = found.path.iter().map(ToString::to_string).collect();
    let words = path.join(", ") + &found.outside_catalogue.join(", ");
    let Some((effect, place, truth)) = expected else {
        return Some(Told {
            right: found.verdict == Verdict::Complete,
            words,
            error: 0.0,
            deviations: 0.0,
            place: 0.0,
        });
    };
    let first = found.path.first();
    let right = first.is_some_and(|step| step.effect == effect && step.joints == [place]);
    let is =
        |c: &&proprio_host::diagnose::CandidateReport| c.effect == effect && c.joints == [place];
    let parameters = &found.candidates.iter().find(is)?.parameters;
    let off = |n: usize| parameters[n].value - truth[n];
    Some(Told {
        right: right && found.path.len() == 1,
        words,
        error: off(0) / truth[0],
        deviations: off(0) / parameters[0].std,
        place: (1..truth.len()).map(|n| off(n).abs()).fold(0.0, f64::max),
    })
}

fn identified(folder: &Path) -> String {
    let mut table = "| gait | robots | total mass within 1 % | worst, % | within 2 std | trunk's centre of mass, worst, mm (x, y, z) | within 2 std | \
                     the whole robot's, worst, mm | within 2 std | identified parameters within 2 std | 3 std | friction and rotors within 2 std | \
                     3 std |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for gait in GAITS {
        let mut errors = Errors::default();
        for walk in walks(folder, gait) {
            match identify_free_base(
                std::slice::from_ref(&walk.log),
                &Model::default(),
                Constraint::Physical,
                |_, _| (),
            ) {
                Ok(found) => errors.add(&found, &walk.truth),
                Err(error) => eprintln!("{}: {error}", walk.log.display()),
            }
        }
        eprintln!("{gait}: {} robots identified", errors.robots);
        table += &errors.row(gait);
    }
    table
}

/// What is asked of each gait: the model's gap and what is to be said.
fn asked(walk: &Walk) -> Vec<(&'static str, Option<Told>)> {
    let mut asked = Vec::new();
    if walk.gait == "load" {
        let load: Vec<f64> = (0..4).map(|n| number(&walk.truth["load"][n])).collect();
        // As its owner has it: identified before the load came.
        let before = walk.log.with_file_name("").join("../trot/trot.csv.gz");
        let of_trot = identify_free_base(
            &[before],
            &Model::default(),
            Constraint::Physical,
            |_, _| (),
        )
        .ok();
        let known = of_trot.and_then(|found| {
            let provenance =
                proprio_host::model::Provenance::of(std::slice::from_ref(&walk.log)).ok()?;
            found.to_model(&Model::default(), provenance).ok()
        });
        asked.push((
            "2 kg on the trunk, CAD's bodies",
            told(walk, &model(None), Some(("payload", "base", &load))),
        ));
        if let Some(known) = known {
            asked.push((
                "2 kg on the trunk, bodies identified without it",
                told(walk, &known, Some(("payload", "base", &load))),
            ));
        }
        return asked;
    }
    asked.push(("nothing", told(walk, &model(None), None)));
    let joint = walk.robot % JOINTS;
    let name = JOINT_NAMES[joint];
    let friction = number(&walk.truth["effects"][format!("coulomb:{name}")]);
    let lacks = model(Some((EffectKind::Coulomb, joint)));
    asked.push((
        "coulomb at one joint",
        told(walk, &lacks, Some(("coulomb", name, &[friction]))),
    ));
    asked
}

fn diagnosed(folder: &Path) -> String {
    let mut table = "| gait | missing | robots | named, and nothing else | value's error, rms % | within 2 std | place, worst, mm |\n|---|---|---|---|---|---|---|\n".to_owned();
    for gait in GAITS {
        let mut rows: Vec<(&str, Vec<Told>)> = Vec::new();
        for walk in walks(folder, gait) {
            for (missing, told) in asked(&walk) {
                let Some(told) = told else { continue };
                if !told.right {
                    eprintln!("{}: {missing}: {}", walk.log.display(), told.words);
                }
                match rows.iter_mut().find(|(name, _)| *name == missing) {
                    Some((_, own)) => own.push(told),
                    None => rows.push((missing, vec![told])),
                }
            }
        }
        for (missing, told) in rows {
            let named: Vec<&Told> = told.iter().filter(|t| t.right).collect();
            let rms = (named.iter().map(|t| t.error * t.error).sum::<f64>()
                / named.len().max(1) as f64)
                .sqrt();
            let place = named.iter().map(|t| t.place).fold(0.0, f64::max);
            table += &match missing {
                "nothing" => format!(
                    "| {gait} | {missing} | {} | {} | | | |\n",
                    told.len(),
                    share(&told, |t| t.right)
                ),
                _ => format!(
                    "| {gait} | {missing} | {} | {} | {:.1} | {} | {} |\n",
                    told.len(),
                    share(&told, |t| t.right),
                    100.0 * rms,
                    share(&named, |t| t.deviations.abs() <= 2.0),
                    if missing.contains("trunk") {
                        format!("{:.1}", 1e3 * place)
                    } else {
                        String::new()
                    },
                ),
            };
        }
        eprintln!("{gait}: diagnosed");
    }
    table
}

/// The part's text, made anew or as it is in the file.
fn part(arguments: &Arguments, part: Part, before: &str) -> String {
    let (head, words, table): (_, _, fn(&Path) -> String) = match part {
        Part::Identified => (
            "## Identified\n",
            "`proprio identify --free-base --physical`, each log alone.",
            identified,
        ),
        Part::Diagnosed => (
            "## Diagnosed\n",
            "`proprio diagnose --free-base` with viscous, Coulomb, armature and bias at every joint but for what is missing.",
            diagnosed,
        ),
    };
    if arguments.only.is_none_or(|only| only == part) {
        return format!("{head}\n{words}\n\n{}\n", table(&arguments.folder));
    }
    let own = before.find(head).map_or("", |at| &before[at..]);
    let end = own[1.min(own.len())..]
        .find("\n## ")
        .map_or(own.len(), |at| at + 2);
    format!("{}\n\n", own[..end].trim_end())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("walks.md");
    let before = std::fs::read_to_string(&path).unwrap_or_default();
    let parts = [Part::Identified, Part::Diagnosed].map(|of| part(&arguments, of, &before));
    let text = format!(
        "# Robots that walk, judged\n\n\
         Made by `cargo run --release -p proprio-studies --bin walk_study -- FOLDER --write` of logs of 20 s that MuJoCo made \
         (`tests/oracle/mujoco_walk.py`): a Go2's quanta and noise, IMU noise, biases and scales that are off, ground that gives way; each robot with other masses, centres of \
         mass, gait and noise, where gravity is 9.78 to 9.83 m/s².\n\n{}\n",
        parts.concat().trim_end()
    );
    println!("{text}");
    if arguments.write
        && let Err(error) = std::fs::write(&path, text)
    {
        eprintln!("{}: {error}", path.display());
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
