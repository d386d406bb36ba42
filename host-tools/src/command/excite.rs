//! `proprio excite`: the motion that tells.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use clap::{Args, ValueEnum};
use proprio::excite::output::{Coefficients, Gains, write_csv};
use proprio::excite::{self, Goal, LimbDesign, Margins, Settings, Supervisor, earlier};
use proprio::model::{Limb, Model, UnknownName};
use proprio::output::{self, AtomicFile, WriteError};
use proprio_core::effect::EffectKind;
use serde::Serialize;

use super::{Error, json, model_or_default};
use crate::progress::Progress;

/// Design a motion that excites what can be identified, within the robot's limits
///
/// Each joint follows a Fourier series that begins and ends at rest in one pose. Limits of position, velocity, acceleration,
/// torque and power hold at every instant, for parameters off by --uncertainty, and no shape comes nearer than --distance to
/// another. Ctrl-C ends the search with the best motion so far; a second one ends the program.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Excite {
    /// Where the motion goes: 500 rows a second of q, dq, ddq, tau (feed-forward), kp and kd of each joint
    #[arg(short, long, value_name = "MOTION", default_value = "motion.csv")]
    output: PathBuf,
    /// Where the series' coefficients go [default: the motion's name with .json]
    #[arg(long, value_name = "FILE")]
    coefficients: Option<PathBuf>,
    /// A page with plots and the moving leg
    #[arg(long, value_name = "PAGE")]
    html: Option<PathBuf>,
    /// The robot and what is known of it [default: the Go2's CAD]
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Which legs (limbs of another robot), such as FR,RL [default: all]
    #[arg(long, value_name = "LEGS", value_delimiter = ',')]
    legs: Vec<String>,
    /// Length, s
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    duration: f64,
    /// Length of the period that is repeated, s; about [default: a third of the duration, 3.3 s at most]
    #[arg(long, value_name = "S")]
    period: Option<f64>,
    /// Waves of a series: the fastest is this many in a period
    #[arg(long, value_name = "N", default_value_t = 10)]
    harmonics: usize,
    /// What the motion is to be good for
    #[arg(long, value_enum, default_value_t = Cost::Condition)]
    cost: Cost,
    /// Parameters to be told best, such as m:FR_calf,coulomb:FR_hip; instead of --cost
    #[arg(
        long = "for",
        value_name = "PARAMETERS",
        value_delimiter = ',',
        conflicts_with = "cost"
    )]
    parameters: Vec<String>,
    /// Two effects to tell apart, at a joint or at all: stribeck,quadratic_drag:FR_thigh; instead of --cost
    #[arg(long, value_name = "A,B[:JOINT]", value_parser = parse_separation, conflicts_with_all = ["cost", "parameters"])]
    separate: Option<Separation>,
    /// Logs whose knowledge the motion is to complete
    #[arg(long, value_name = "LOG", num_args = 1.., conflicts_with = "separate")]
    from: Vec<PathBuf>,
    /// Where to begin and end, rad: FR_hip=0.1,FR_calf=-1.8 [default: a bent leg]
    #[arg(long, value_name = "JOINT=RAD", value_delimiter = ',', value_parser = parse_pose)]
    pose: Vec<(String, f64)>,
    #[command(flatten)]
    limits: LimitArguments,
    /// Feedback gains written with the motion, N m/rad
    #[arg(long, value_name = "KP", default_value_t = 40.0)]
    kp: f64,
    /// N m s/rad
    #[arg(long, value_name = "KD", default_value_t = 1.5)]
    kd: f64,
    /// Starts of the search per leg, on all processors
    #[arg(long, value_name = "N", default_value_t = 16)]
    starts: usize,
    /// Seed of the starts: the same gives the same motion
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What is kept back from the robot's limits.
#[derive(Debug, Args)]
struct LimitArguments {
    /// Distance from the stops, rad
    #[arg(long, value_name = "RAD", default_value_t = Margins::default().position)]
    position_margin: f64,
    /// Share of the greatest speed
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().velocity)]
    velocity_share: f64,
    /// Greatest acceleration, rad/s²
    #[arg(long, value_name = "RAD/S2", default_value_t = Margins::default().acceleration)]
    acceleration: f64,
    /// Share of the greatest torque
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().torque)]
    torque_share: f64,
    /// Share of the greatest power, a quarter of torque times speed
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().power)]
    power_share: f64,
    /// By how much each parameter may be off while the torque limits still hold, as a share
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().uncertainty)]
    uncertainty: f64,
    /// Distance of shapes, m
    #[arg(long, value_name = "M", default_value_t = Margins::default().distance)]
    distance: f64,
    /// Height of the base above a floor that feet and knees must stay clear of, m
    #[arg(long, value_name = "M")]
    ground: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Cost {
    /// Condition number of the identifiable inertias: every combination about equally well
    Condition,
    /// What is told of inertias, friction, rotors and offsets beyond what is known (D-optimal)
    Determinant,
}

#[derive(Debug, Clone)]
struct Separation {
    effects: [EffectKind; 2],
    joint: Option<String>,
}

/// What `excite` reports.
#[derive(Debug, Serialize)]
struct Report {
    motion: PathBuf,
    coefficients: PathBuf,
    condition_number: f64,
    condition_number_si: f64,
    rank: usize,
    log_det: f64,
    violations: usize,
    seconds: f64,
    duration: f64,
    seed: u64,
    interrupted: bool,
    limbs: Vec<LimbReport>,
}

#[derive(Debug, Serialize)]
struct LimbReport {
    limb: String,
    #[serde(flatten)]
    measures: excite::Measures,
    violations: Vec<String>,
}

impl Excite {
    pub(crate) fn run(self) -> Result<String, Error> {
        let begun = Instant::now();
        let model = model_or_default(self.model.as_deref(), false)?;
        let limbs = chosen(&model, &self.legs)?;
        let settings = self.settings(&model, &limbs)?;
        output::finish_on_interrupt();
        let designs = excite::design(&model, &limbs, &settings, &Shown::new())?;
        let coefficients = self
            .coefficients
            .clone()
            .unwrap_or_else(|| self.output.with_extension("json"));
        let gains = Gains {
            p: self.kp,
            d: self.kd,
        };
        write_motion(&self.output, &model, &designs, gains)?;
        output::write(
            &coefficients,
            &json(&Coefficients::of(&model, &designs, &settings)),
        )?;
        if let Some(page) = &self.html {
            proprio::report::pages::excite::motion(&model, &designs).write(page)?;
        }
        let report = self.report(
            &model,
            &designs,
            coefficients,
            begun.elapsed().as_secs_f64(),
        );
        if report.violations > 0 {
            let first = report.limbs.iter().flat_map(|limb| &limb.violations).next();
            return Err(Error::NotWithinLimits(first.cloned().unwrap_or_default()));
        }
        Ok(if self.json {
            json(&report)
        } else {
            report.to_string()
        })
    }

    fn settings(&self, model: &Model, limbs: &[Limb]) -> Result<Settings, Error> {
        let goal = match (&self.separate, self.parameters.is_empty(), self.cost) {
            (Some(separation), ..) => Goal::Separation {
                effects: separation.effects,
                joint: separation.joint.clone(),
            },
            (None, false, _) => Goal::Variance(self.parameters.clone()),
            // What is known already says nothing of a condition number.
            (None, true, Cost::Condition) if self.from.is_empty() => Goal::Condition,
            (None, true, _) => Goal::Determinant,
        };
        let earlier = if self.from.is_empty() {
            Vec::new()
        } else {
            let mut progress = Progress::new("Reading");
            earlier::read(model, limbs, &self.from, |done, total| {
                progress.set(done, total)
            })?
        };
        let limits = &self.limits;
        Ok(Settings {
            earlier,
            goal,
            duration: self.duration,
            period: self.period.unwrap_or_else(|| usual_period(self.duration)),
            harmonics: self.harmonics,
            pose: self.pose.clone(),
            margins: Margins {
                position: limits.position_margin,
                velocity: limits.velocity_share,
                acceleration: limits.acceleration,
                torque: limits.torque_share,
                power: limits.power_share,
                uncertainty: limits.uncertainty,
                distance: limits.distance,
                ground: limits.ground,
            },
            seed: self.seed,
            starts: self.starts,
            ..Settings::default()
        })
    }

    fn report(
        &self,
        model: &Model,
        designs: &[LimbDesign],
        coefficients: PathBuf,
        seconds: f64,
    ) -> Report {
        let most = |of: fn(&excite::Measures) -> f64| {
            designs
                .iter()
                .map(|design| of(&design.measures))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let limbs = designs.iter().map(|design| LimbReport {
            limb: design.limb.clone(),
            measures: design.measures,
            violations: design
                .violations
                .iter()
                .map(|v| told(model, design, v))
                .collect(),
        });
        Report {
            motion: self.output.clone(),
            coefficients,
            condition_number: most(|m| m.condition_number),
            condition_number_si: most(|m| m.condition_number_si),
            rank: designs.iter().map(|design| design.measures.rank).sum(),
            log_det: designs.iter().map(|design| design.measures.log_det).sum(),
            violations: designs.iter().map(|design| design.violations.len()).sum(),
            seconds,
            duration: self.duration,
            seed: self.seed,
            interrupted: output::asked_to_finish(),
            limbs: limbs.collect(),
        }
    }
}

/// A third of the duration, so that there are periods to compare; of a longer one as many as make periods of 3.3 s.
fn usual_period(duration: f64) -> f64 {
    let usual = Settings::default().period;
    duration / (duration / usual).round().max(3.0)
}

fn told(model: &Model, design: &LimbDesign, v: &excite::Violation) -> String {
    let joint = v.joint.map_or(String::new(), |j| {
        format!(" of {}", model.joint_name(design.joints[j]))
    });
    format!(
        "{}{joint} at {:.3} s, by {:.2} %",
        v.what,
        v.t,
        100.0 * v.beyond
    )
}

/// The limbs that are asked for.
pub(super) fn chosen(model: &Model, names: &[String]) -> Result<Vec<Limb>, Error> {
    let all = model.robot().limbs();
    if names.is_empty() || (names.len() == 1 && names[0] == "all") {
        return Ok(all);
    }
    for name in names {
        if !all.iter().any(|limb| limb.name == *name) {
            let known = all.iter().map(|limb| limb.name.as_str());
            return Err(UnknownName::new("leg", name, known).into());
        }
    }
    Ok(all
        .into_iter()
        .filter(|limb| names.contains(&limb.name))
        .collect())
}

fn write_motion(
    path: &Path,
    model: &Model,
    designs: &[LimbDesign],
    gains: Gains,
) -> Result<(), Error> {
    let unwritable = |source| WriteError {
        path: path.to_owned(),
        source,
    };
    let mut file = AtomicFile::create(path)?;
    write_csv(&mut file, model, designs, gains).map_err(unwritable)?;
    file.flush().map_err(unwritable)?;
    file.commit()?;
    Ok(())
}

/// Shows how far the search is and the best cost.
struct Shown(Mutex<Progress>);

impl Shown {
    fn new() -> Self {
        Self(Mutex::new(Progress::new("Searching")))
    }
}

impl Supervisor for Shown {
    fn stop(&self) -> bool {
        output::asked_to_finish()
    }

    fn progress(&self, done: usize, of: usize, best: Option<f64>) {
        let mut bar = self
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        bar.set(done as u64, of as u64);
        if let Some(best) = best {
            bar.say(format!("Searching, best cost {best:.3}"));
        }
    }
}

fn parse_separation(text: &str) -> Result<Separation, String> {
    let (effects, joint) = match text.split_once(':') {
        Some((effects, joint)) => (effects, Some(joint.to_owned())),
        None => (text, None),
    };
    let (a, b) = effects
        .split_once(',')
        .ok_or("expected A,B[:JOINT], such as stribeck,viscous:FR_hip")?;
    let effect = |name: &str| {
        let names = EffectKind::ALL.iter().map(|kind| kind.name());
        EffectKind::from_name(name).ok_or_else(|| {
            let unknown = UnknownName::new("effect", name, names);
            match unknown.nearest() {
                Some(nearest) => format!("no effect `{name}`; did you mean `{nearest}`?"),
                None => unknown.to_string(),
            }
        })
    };
    let effects = [effect(a.trim())?, effect(b.trim())?];
    if effects[0] == effects[1] {
        return Err("the two effects are the same".to_owned());
    }
    Ok(Separation { effects, joint })
}

fn parse_pose(text: &str) -> Result<(String, f64), String> {
    let (joint, value) = text.split_once('=').ok_or("expected JOINT=RAD")?;
    let value = value
        .parse()
        .map_err(|_| format!("`{value}` is not a number"))?;
    Ok((joint.to_owned(), value))
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "leg        condition number     in SI   rank   log det")?;
        for limb in &self.limbs {
            let m = &limb.measures;
            writeln!(
                f,
                "{:<10} {:>16.2} {:>9.2} {:>6} {:>9.1}",
                limb.limb, m.condition_number, m.condition_number_si, m.rank, m.log_det
            )?;
        }
        writeln!(
            f,
            "\nCondition number of the identifiable inertias, masses, first moments and inertias each scaled by the prior; in SI, \
             columns are per kg, kg m and kg m^2."
        )?;
        writeln!(
            f,
            "Within all limits at every instant, for parameters off by the stated uncertainty."
        )?;
        if self.interrupted {
            writeln!(f, "Interrupted: the best motion until then.")?;
        }
        writeln!(
            f,
            "{}: {} s at 500 Hz, seed {}, found in {:.1} s\n{}: its coefficients",
            self.motion.display(),
            self.duration,
            self.seed,
            self.seconds,
            self.coefficients.display()
        )
    }
}

const EXAMPLES: &str = "Examples:
  proprio excite --legs FR -o fr.csv --html fr.html
  proprio excite --cost determinant --duration 20 --seed 3
  proprio excite --legs FR --for m:FR_calf,coulomb:FR_calf
  proprio excite --legs FR --separate stribeck,quadratic_drag:FR_thigh -o next.csv
  proprio excite --legs FR --from fr_log.csv -o next.csv";
