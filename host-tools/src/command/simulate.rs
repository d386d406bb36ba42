//! `proprio simulate`: a log whose truth is known.

mod formula;
mod frf;
mod help;
mod poses;
mod walk;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::log::{Channel, LogWriter};
use crate::name::{self, leg_named};
use crate::output::{self, AtomicFile, WriteError};
use clap::error::ErrorKind;
use clap::{Args, ValueEnum};
use flate2::Compression;
use flate2::write::GzEncoder;
use proprio_core::go2::{JointId, Leg};
use proprio_simulator::hidden::typical;
use proprio_simulator::{
    Followed, HiddenEffect, HiddenError, HiddenJoint, Hide, Motion, Sensors, Simulation, TrueValue,
};
use serde::Serialize;

use super::result::result;
use super::{Error, json};
use crate::progress::Progress;
use help::{EXAMPLES, long_help};

/// Make a log of a robot whose parameters are known
///
/// Its legs are the Go2's rigid bodies on a fixed base, driven by a controller that follows a rich reference. With --walk the whole
/// Go2, or any robot of three feet or more (-m), walks on compliant ground, and the log has the columns of its IMU and of its feet.
/// What --hide adds, and what --inertia-error changes, is unknown to the model. The truth goes to a file beside the log.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
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
    /// Let the whole robot walk instead: a log for `identify --free-base`
    #[arg(long, value_name = "GAIT", value_enum, conflicts_with_all = ["legs", "motion", "follow", "temperature", "second_encoder"])]
    walk: Option<walk::GaitName>,
    /// Coulomb friction between its feet and the ground [default: 0.9]
    #[arg(long, value_name = "MU", requires = "walk", value_parser = within(0.05, 2.0))]
    ground_friction: Option<f64>,
    /// Measure an arm of any robot (-m) at so many poses instead: a file for `calibrate`
    #[arg(long, value_name = "N", requires = "model", conflicts_with_all = ["legs", "motion", "walk", "temperature", "second_encoder", "typical"], value_parser = clap::value_parser!(u32).range(1..100_000))]
    poses: Option<u32>,
    /// Excite a robot (-m) with elastic joints by multisines instead: a log for `frf`
    #[arg(long, requires = "model", conflicts_with_all = ["legs", "motion", "walk", "poses", "temperature", "typical", "duration"])]
    frf: bool,
    #[command(flatten)]
    experiments: super::experiments::ExperimentArguments,
    /// Length of a period, of --frf [default: 4]
    #[arg(long, value_name = "S", requires = "frf", value_parser = within(0.1, 100.0))]
    period: Option<f64>,
    /// Also write a log of slow motion of the same robot: for `identify`, whose friction and masses `frf` needs
    #[arg(long, value_name = "LOG", requires = "frf")]
    slow: Option<PathBuf>,
    /// The robot of --poses, --frf or --walk
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// How far joint frames are off, of --poses: standard deviations of each coordinate and angle
    #[arg(long, value_name = "MM,MRAD", requires = "poses", value_parser = parse_two, default_value = "0.5,0.7")]
    geometry_error: Two,
    /// Measure the target's orientation too, with so much noise, of --poses
    #[arg(long, value_name = "MRAD", requires = "poses", value_parser = within(0.0, 100.0))]
    orientation_noise: Option<f64>,
    /// An effect to add, at one joint or, without JOINT, at all; replaces an earlier one. Or a torque by a formula, `JOINT: FORMULA`
    #[arg(long, value_name = "EFFECT[:JOINT]=VALUE[,NAME=VALUE...]")]
    hide: Vec<String>,
    /// Take formulas over the time `t` in --hide: a robot that changes within the log
    #[arg(long)]
    with_time: bool,
    /// How far the bodies are off the CAD: relative standard deviation of a mass
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0, 1.0))]
    inertia_error: f64,
    /// Log motor temperatures; they are always logged if an effect depends on them
    #[arg(long)]
    temperature: bool,
    /// Give each joint a second encoder, at its link: q_link/ columns
    #[arg(long)]
    second_encoder: bool,
    /// Begin with a Go2's typical friction, rotor inertia and torque offsets instead of a rigid body
    #[arg(long)]
    typical: bool,
    /// What the joints are asked to do
    #[arg(long, value_enum, default_value_t = MotionName::Multisine)]
    motion: MotionName,
    /// Follow a motion of `proprio excite` instead: its legs, its feed-forward torques, its gains; with --frf a plan of `excite --frf`
    #[arg(long, value_name = "MOTION", conflicts_with_all = ["motion", "legs"])]
    follow: Option<PathBuf>,
    /// Length, s [default: 20, or the motion's]
    #[arg(long, value_name = "S", value_parser = within(0.1, 86400.0))]
    duration: Option<f64>,
    /// Samples per second, Hz
    #[arg(long, value_name = "HZ", default_value_t = 500.0, value_parser = within(10.0, 5000.0))]
    rate: f64,
    /// Noise of velocity and torque, and noise and biases of an IMU, as a multiple of a standing Go2's
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = within(0.0, 100.0))]
    noise: f64,
    /// Further noise of the torque: its standard deviation
    #[arg(long, value_name = "N_M", default_value_t = 0.0, value_parser = within(0.0, 100.0))]
    torque_noise: f64,
    /// For how long that noise remembers itself; 0: white
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = within(0.0, 10.0))]
    torque_memory: f64,
    /// Further white noise of the velocity: its standard deviation
    #[arg(long, value_name = "RAD/S", default_value_t = 0.0, value_parser = within(0.0, 100.0))]
    velocity_noise: f64,
    /// Do not round values to the steps of the motor bus
    #[arg(long)]
    unquantised: bool,
    /// Greatest shift of a sampling instant, as a share of the period
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0, 0.49))]
    jitter: f64,
    /// Share of samples that repeat the one before
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0, 0.9))]
    repeats: f64,
    /// Seed of the reference, of the noise and of the bodies of --inertia-error
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Length of a log, s, if none is given.
const DURATION: f64 = 20.0;

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MotionName {
    /// Sums of sines, no frequency shared by two joints
    Multisine,
    /// A sweep from 0.1 to 9 Hz, all joints in phase
    Chirp,
    /// Moves at constant speeds, slow and fast, with rests between
    Moves,
}

#[derive(Debug, Clone)]
struct Legs(Vec<Leg>);

/// What `simulate` reports.
#[derive(Debug, Serialize)]
struct Report {
    log: PathBuf,
    /// None where the log is a stream, unless --truth names one.
    truth: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gait: Option<&'static str>,
    legs: Vec<String>,
    samples: u64,
    duration: f64,
    /// The slow log of the same robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    slow: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    poses: Option<usize>,
    seed: u64,
}

/// Two numbers: mm and mrad.
type Two = [f64; 2];

/// What the truth file holds; parameters are named as `identify` names them.
#[derive(Debug, Serialize)]
struct Truth {
    seed: u64,
    inertia_error: f64,
    parameters: Vec<TrueValue>,
}

impl Simulate {
    pub(crate) fn run(self) -> Result<String, Error> {
        let as_json = self.json;
        if self.model.is_some() && self.poses.is_none() && !self.frf && self.walk.is_none() {
            let message = "-m is the robot of --poses, --frf or --walk".to_owned();
            super::usage_error("simulate", ErrorKind::MissingRequiredArgument, message);
        }
        let report = match (self.poses, self.walk) {
            _ if self.frf => self.excite()?,
            (Some(count), _) => self.measure(count as usize)?,
            (None, Some(gait)) => self.walk(gait.into())?,
            (None, None) => self.hang()?,
        };
        Ok(if as_json {
            result("simulate", &report)
        } else {
            report.to_string()
        })
    }

    /// Legs on a fixed base.
    fn hang(mut self) -> Result<Report, Error> {
        let follow = self.follow.as_deref().map(Followed::read).transpose()?;
        if let Some(motion) = &follow {
            self.legs = Legs(motion.legs().to_vec());
        }
        let length = follow.as_ref().map_or(DURATION, Followed::duration);
        let simulation = Simulation {
            follow: follow.map(Arc::new),
            motion: match self.motion {
                MotionName::Multisine => Motion::Multisine,
                MotionName::Chirp => Motion::Chirp,
                MotionName::Moves => Motion::Moves,
            },
            duration: self.duration.unwrap_or(length),
            rate: self.rate,
            effects: self.effects_on_legs(),
            inertia_error: self.inertia_error,
            temperature: self.temperature,
            second_encoder: self.second_encoder,
            sensors: self.sensors(),
            seed: self.seed,
            ..Simulation::new(&self.legs.0)
        };
        let truth = self.truth_path();
        let samples = record_with_truth(&simulation, &self.output, truth.as_deref())?;
        Ok(Report {
            log: self.output,
            truth,
            gait: None,
            legs: (simulation.legs.iter())
                .map(|leg| leg.name().to_owned())
                .collect(),
            samples,
            duration: simulation.duration,
            poses: None,
            slow: None,
            seed: simulation.seed,
        })
    }

    /// Where the truth goes; nowhere of itself where the log goes to a stream, which nothing lies beside.
    fn truth_path(&self) -> Option<PathBuf> {
        let beside = || (!output::is_stream(&self.output)).then(|| beside(&self.output));
        self.truth.clone().or_else(beside)
    }

    fn sensors(&self) -> Sensors {
        Sensors {
            noise: self.noise,
            quantised: !self.unquantised,
            jitter: self.jitter,
            repeats: self.repeats,
            torque_noise: self.torque_noise,
            torque_memory: self.torque_memory,
            velocity_noise: self.velocity_noise,
        }
    }

    /// The effects of legs on a fixed base.
    fn effects_on_legs(&self) -> Vec<HiddenEffect> {
        let legs = &self.legs.0;
        let begin = if self.typical {
            typical(legs)
        } else {
            Vec::new()
        };
        let joints: Vec<JointId> = JointId::all().collect();
        let effects = self.effects(begin, &joints, |hide| hide.on(legs));
        let mut places = effects.iter().filter_map(HiddenEffect::joint);
        if let Some(joint) = places.find(|joint| !legs.contains(&joint.leg())) {
            let message = format!("--hide names {joint}, but --legs leaves its leg out");
            super::usage_error("simulate", ErrorKind::ArgumentConflict, message);
        }
        effects
    }

    /// `effects` and those that --hide asks for of a robot with these joints, as `on` has it; a later one replaces an earlier one.
    fn effects<J: HiddenJoint>(
        &self,
        mut effects: Vec<HiddenEffect<J>>,
        joints: &[J],
        on: impl Fn(&Hide<J>) -> Result<Vec<HiddenEffect<J>>, HiddenError>,
    ) -> Vec<HiddenEffect<J>> {
        let refuse = |kind, message: String| -> ! { super::usage_error("simulate", kind, message) };
        for text in &self.hide {
            let hidden = formula::parse(text, joints).unwrap_or_else(|message| {
                let message = format!(
                    "invalid value '{text}' for '--hide <EFFECT[:JOINT]=VALUE[,NAME=VALUE...]>': {message}"
                );
                refuse(ErrorKind::ValueValidation, message)
            });
            if let Some(at) = hidden.over_time().filter(|_| !self.with_time) {
                let message = format!("{at}\n\nA robot that changes within the log: --with-time");
                refuse(ErrorKind::MissingRequiredArgument, message);
            }
            let hidden = hidden
                .on(&on)
                .unwrap_or_else(|error| refuse(ErrorKind::ValueValidation, error.to_string()));
            for effect in hidden {
                let place = |e: &HiddenEffect<J>| (e.kind(), e.joint());
                effects.retain(|e| place(e) != place(&effect));
                effects.push(effect);
            }
        }
        effects
    }
}

/// Writes the log and the truth of `simulation`; counts its samples.
pub(super) fn record_with_truth(
    simulation: &Simulation,
    log: &Path,
    truth: Option<&Path>,
) -> Result<u64, Error> {
    let samples = record(simulation, log)?;
    if let Some(truth) = truth {
        output::write(truth, &json(&truth_of(simulation)))?;
    }
    Ok(samples)
}

/// Writes the log of `simulation` to `path` and counts its samples.
fn record(simulation: &Simulation, path: &Path) -> Result<u64, Error> {
    written(path, |out, unwritable| {
        let mut progress = Progress::new("Simulating");
        let temperature = (simulation.logs_temperature()).then_some(Channel::Temp);
        let q_link = simulation.second_encoder.then_some(Channel::QLink);
        let more: Vec<Channel> = temperature.into_iter().chain(q_link).collect();
        let mut log = LogWriter::with(out, &simulation.legs, &more).map_err(unwritable)?;
        let mut samples = 0;
        for sample in simulation.samples() {
            let sample = sample?;
            let more = [&sample.temp, &sample.q_link].into_iter().flatten();
            let more: Vec<&[f64]> = more.map(Vec::as_slice).collect();
            log.row_with(sample.t, [&sample.q, &sample.dq, &sample.tau], &more)
                .map_err(unwritable)?;
            samples += 1;
            progress.set((sample.t * 1e3) as u64, (simulation.duration * 1e3) as u64);
        }
        log.finish().map_err(unwritable)?;
        Ok(samples)
    })
}

/// Makes the file at `path`, compressed if its name says so, of what `write` writes; it appears once that is whole. `write` is told
/// how to say that it cannot be written.
fn written<T>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write, &dyn Fn(io::Error) -> WriteError) -> Result<T, Error>,
) -> Result<T, Error> {
    let unwritable = |source| WriteError {
        path: path.to_owned(),
        source,
    };
    let mut file = AtomicFile::create(path)?;
    let result = if path.extension().is_some_and(|extension| extension == "gz") {
        let mut gzip = GzEncoder::new(&mut file, Compression::default());
        let result = write(&mut gzip, &unwritable)?;
        gzip.finish().map_err(unwritable)?;
        result
    } else {
        write(&mut file, &unwritable)?
    };
    file.commit()?;
    Ok(result)
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let log = self.log.display();
        if let Some(poses) = self.poses {
            writeln!(f, "{log}: {poses} poses, seed {}", self.seed)?;
            return match &self.truth {
                Some(truth) => writeln!(f, "{}: the truth", truth.display()),
                None => Ok(()),
            };
        }
        if let Some(slow) = &self.slow {
            writeln!(
                f,
                "{}: slow motion of the same robot, for `identify`",
                slow.display()
            )?;
        }
        let legs = self.legs.join(", ");
        let what = self.gait.map_or(legs, |gait| format!("a robot: {gait}"));
        writeln!(
            f,
            "{log}: {} samples, {} s of {what}, seed {}",
            self.samples, self.duration, self.seed
        )?;
        match &self.truth {
            Some(truth) => writeln!(f, "{}: the truth", truth.display()),
            None => Ok(()),
        }
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
    Truth {
        seed: simulation.seed,
        inertia_error: simulation.inertia_error,
        parameters: simulation.truth(),
    }
}

fn parse_legs(text: &str) -> Result<Legs, String> {
    if text == "all" {
        return Ok(Legs(Leg::ALL.to_vec()));
    }
    let mut legs = Vec::new();
    for name in text.split(',') {
        legs.push(leg_named(name.trim()).map_err(|unknown| suggest(&unknown, unknown.nearest()))?);
    }
    legs.sort_by_key(|leg| leg.index());
    legs.dedup();
    Ok(Legs(legs))
}

/// `MM,MRAD`.
fn parse_two(text: &str) -> Result<Two, String> {
    let parse = |text: &str| within(0.0, 1000.0)(text.trim());
    let (a, b) = text.split_once(',').ok_or("expected MM,MRAD")?;
    Ok([parse(a)?, parse(b)?])
}

/// What `--hide` says of a Go2.
pub(super) fn parse_hide(text: &str) -> Result<Hide, String> {
    hide_on(text, &JointId::all().collect::<Vec<_>>())
}

/// The same of a robot with these joints.
fn hide_on<J: HiddenJoint>(text: &str, joints: &[J]) -> Result<Hide<J>, String> {
    Hide::parse(text, joints).map_err(|error| match &error {
        HiddenError::Name { name, known } => suggest(
            &error,
            name::nearest(name, known.iter().map(String::as_str)),
        ),
        _ => error.to_string(),
    })
}

fn suggest(unknown: &dyn std::fmt::Display, nearest: Option<&str>) -> String {
    match nearest {
        Some(nearest) => format!("{unknown}; did you mean `{nearest}`?"),
        None => unknown.to_string(),
    }
}

/// A parser of numbers within bounds.
pub(super) fn within(least: f64, most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
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
