//! `proprio simulate`: a log whose truth is known.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{Args, ValueEnum};
use flate2::Compression;
use flate2::write::GzEncoder;
use proprio::log::{JointId, LogWriter, UnknownName, leg_named};
use proprio::output::{self, AtomicFile, WriteError};
use proprio::parameter::{self, JointEffect, typical_effects};
use proprio::simulator::{Motion, Sensors, Simulation};
use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;
use serde::Serialize;

use super::{Error, json};
use crate::progress::Progress;

/// Make a log of pinned legs whose parameters are known
///
/// The legs are the Go2's rigid bodies on a fixed base, driven by a controller that follows a rich reference. What --hide
/// adds is what the model does not know. The truth goes to a file beside the log.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio simulate --typical -o leg.csv
  proprio simulate --legs FR --hide coulomb:FR_calf=0.8 --hide viscous=0.05 -o hidden.csv.gz")]
pub(crate) struct Simulate {
    /// Where the log goes; compressed if the name ends in .gz
    #[arg(short, long, value_name = "LOG", default_value = "simulated.csv")]
    output: PathBuf,
    /// Where the truth goes [default: the log's name with .truth.json]
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Which legs, such as FR,RL; or all
    #[arg(long, value_name = "LEGS", default_value = "all", value_parser = parse_legs)]
    legs: Legs,
    /// An effect to add, at one joint or, without JOINT, at all; replaces an earlier value
    #[arg(long, value_name = "EFFECT[:JOINT]=VALUE", value_parser = parse_hidden)]
    hide: Vec<Hidden>,
    /// Begin with a Go2's typical friction, rotor inertia and torque offsets instead of a rigid body
    #[arg(long)]
    typical: bool,
    /// What the joints are asked to do
    #[arg(long, value_enum, default_value_t = MotionName::Multisine)]
    motion: MotionName,
    /// Length, s
    #[arg(long, value_name = "S", default_value_t = 20.0, value_parser = within(0.1, 86400.0))]
    duration: f64,
    /// Samples per second, Hz
    #[arg(long, value_name = "HZ", default_value_t = 500.0, value_parser = within(10.0, 5000.0))]
    rate: f64,
    /// Velocity noise, as a multiple of a standing Go2's
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = within(0.0, 100.0))]
    noise: f64,
    /// Do not round values to the steps of the motor bus
    #[arg(long)]
    unquantised: bool,
    /// Greatest shift of a sampling instant, as a share of the period
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0, 0.49))]
    jitter: f64,
    /// Share of samples that repeat the one before
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0, 0.9))]
    repeats: f64,
    /// Seed of the reference and of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MotionName {
    /// Sums of sines, no frequency shared by two joints
    Multisine,
    /// A sweep from 0.1 to 9 Hz, all joints in phase
    Chirp,
}

#[derive(Debug, Clone)]
struct Legs(Vec<Leg>);

/// `EFFECT[:JOINT]=VALUE`.
#[derive(Debug, Clone, Copy)]
struct Hidden {
    effect: EffectKind,
    joint: Option<JointId>,
    value: f64,
}

/// What `simulate` reports.
#[derive(Debug, Serialize)]
struct Report {
    log: PathBuf,
    truth: PathBuf,
    legs: Vec<&'static str>,
    samples: u64,
    duration: f64,
    seed: u64,
}

/// What the truth file holds; parameters are named as `identify` names them.
#[derive(Debug, Serialize)]
struct Truth {
    seed: u64,
    parameters: Vec<parameter::Parameter>,
}

impl Simulate {
    pub(crate) fn run(self) -> Result<String, Error> {
        let simulation = Simulation {
            motion: match self.motion {
                MotionName::Multisine => Motion::Multisine,
                MotionName::Chirp => Motion::Chirp,
            },
            duration: self.duration,
            rate: self.rate,
            effects: self.effects(),
            sensors: Sensors {
                noise: self.noise,
                quantised: !self.unquantised,
                jitter: self.jitter,
                repeats: self.repeats,
            },
            seed: self.seed,
            ..Simulation::new(&self.legs.0)
        };
        let truth = self.truth.clone().unwrap_or_else(|| beside(&self.output));
        let samples = record(&simulation, &self.output)?;
        output::write(&truth, &json(&truth_of(&simulation)))?;
        let report = Report {
            log: self.output,
            truth,
            legs: simulation.legs.iter().map(|leg| leg.name()).collect(),
            samples,
            duration: simulation.duration,
            seed: simulation.seed,
        };
        Ok(if self.json {
            json(&report)
        } else {
            report.to_string()
        })
    }

    /// The effects to simulate; a later --hide replaces an earlier value.
    fn effects(&self) -> Vec<JointEffect> {
        let legs = &self.legs.0;
        let mut effects = if self.typical {
            typical_effects(legs)
        } else {
            Vec::new()
        };
        let every: Vec<JointId> = legs.iter().flat_map(|&leg| JointId::of(leg)).collect();
        for hidden in &self.hide {
            let joints = hidden
                .joint
                .map_or_else(|| every.clone(), |joint| vec![joint]);
            for joint in joints {
                if !every.contains(&joint) {
                    let message = format!("--hide names {joint}, but --legs leaves its leg out");
                    super::usage_error("simulate", ErrorKind::ArgumentConflict, message);
                }
                effects.retain(|e| (e.effect, e.joint) != (hidden.effect, joint));
                effects.push(JointEffect {
                    effect: hidden.effect,
                    joint,
                    value: hidden.value,
                });
            }
        }
        effects
    }
}

/// Writes the log of `simulation` to `path` and counts its samples.
pub(super) fn record(simulation: &Simulation, path: &Path) -> Result<u64, Error> {
    let unwritable = |source| WriteError {
        path: path.to_owned(),
        source,
    };
    let file = AtomicFile::create(path)?;
    if path.extension().is_some_and(|extension| extension == "gz") {
        let gzip = GzEncoder::new(file, Compression::default());
        let (gzip, samples) = record_to(gzip, simulation, unwritable)?;
        gzip.finish().map_err(unwritable)?.commit()?;
        Ok(samples)
    } else {
        let (file, samples) = record_to(file, simulation, unwritable)?;
        file.commit()?;
        Ok(samples)
    }
}

fn record_to<W: Write>(
    out: W,
    simulation: &Simulation,
    unwritable: impl Fn(io::Error) -> WriteError + Copy,
) -> Result<(W, u64), Error> {
    let mut progress = Progress::new("Simulating");
    let mut log = LogWriter::new(out, &simulation.legs).map_err(unwritable)?;
    let mut samples = 0;
    for sample in simulation.samples() {
        let sample = sample?;
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
            .map_err(unwritable)?;
        samples += 1;
        progress.set((sample.t * 1e3) as u64, (simulation.duration * 1e3) as u64);
    }
    Ok((log.finish().map_err(unwritable)?, samples))
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (log, truth) = (self.log.display(), self.truth.display());
        let legs = self.legs.join(", ");
        writeln!(
            f,
            "{log}: {} samples, {} s of {legs}, seed {}",
            self.samples, self.duration, self.seed
        )?;
        writeln!(f, "{truth}: the truth")
    }
}

/// `walk.csv.gz` → `walk.truth.json`.
fn beside(log: &Path) -> PathBuf {
    let mut stem = log.to_owned();
    if stem.extension().is_some_and(|extension| extension == "gz") {
        stem.set_extension("");
    }
    stem.with_extension("truth.json")
}

fn truth_of(simulation: &Simulation) -> Truth {
    let of = |&leg: &Leg| parameter::truth_of_leg(leg, &simulation.effects);
    Truth {
        seed: simulation.seed,
        parameters: simulation.legs.iter().flat_map(of).collect(),
    }
}

fn parse_legs(text: &str) -> Result<Legs, String> {
    if text == "all" {
        return Ok(Legs(Leg::ALL.to_vec()));
    }
    let mut legs = Vec::new();
    for name in text.split(',') {
        legs.push(leg_named(name.trim()).map_err(suggest)?);
    }
    legs.sort_by_key(|leg| leg.index());
    legs.dedup();
    Ok(Legs(legs))
}

fn parse_hidden(text: &str) -> Result<Hidden, String> {
    let (place, value) = text
        .split_once('=')
        .ok_or("expected EFFECT[:JOINT]=VALUE")?;
    let (effect, joint) = match place.split_once(':') {
        Some((effect, joint)) => (effect, Some(joint.parse().map_err(suggest)?)),
        None => (place, None),
    };
    let names = || EffectKind::ALL.iter().map(|effect| effect.name());
    let effect =
        EffectKind::from_name(effect).ok_or_else(|| suggest(UnknownName::new(effect, names())))?;
    let parameter = effect.description().parameters[0];
    let value: f64 = value
        .parse()
        .map_err(|_| format!("`{value}` is not a number"))?;
    if !value.is_finite() || !(parameter.lower..=parameter.upper).contains(&value) {
        let (lower, upper) = (parameter.lower, parameter.upper);
        return Err(format!(
            "{} must lie between {lower} and {upper}",
            effect.name()
        ));
    }
    Ok(Hidden {
        effect,
        joint,
        value,
    })
}

fn suggest(unknown: UnknownName) -> String {
    match unknown.nearest() {
        Some(nearest) => format!("{unknown}; did you mean `{nearest}`?"),
        None => unknown.to_string(),
    }
}

/// A parser of numbers within bounds.
fn within(least: f64, most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let value: f64 = text
            .parse()
            .map_err(|_| format!("`{text}` is not a number"))?;
        if (least..=most).contains(&value) {
            Ok(value)
        } else {
            Err(format!("must lie between {least} and {most}"))
        }
    }
}
