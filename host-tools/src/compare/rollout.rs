//! A model run forward under the measured torque, or by what the drives were asked to do, against the measured motion: the error that a policy or a
//! simulator sees.
//!
//! Rollouts of a horizon's length follow one another and start anew from the measured state ([`crate::rollout`]); the error is that of the
//! position at the end. Values are those of the torque's comparison, fitted ones of the fold that a rollout lies in.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::asked::{Asked, names};
use super::{From, ValuesFrom, asked, check, feet, fits};
use crate::detect::contact::leave_out_contact;
use crate::equation::values::{Values, places};
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot;
use crate::model::{JointKind, Model, ModelEffect};
use crate::parallel::side_by_side;
use crate::recording::{LogGates, Recording, RecordingError};
pub use crate::rollout::Gains;
use crate::rollout::{Commands, Missing, Rollouts, Span, is_included, spans};
use crate::summary::{ErrorRange, Summary, typed};
use crate::table::Table;

/// Lengths of rollouts, s: from a few periods of a policy to the time in which a walking robot takes two steps.
const HORIZONS: [f64; 4] = [0.1, 0.2, 0.5, 1.0];
/// The horizon that pages show in time: some periods of a swing, and errors that can be seen.
const SHOWN: f64 = 0.5;
/// Most rollouts of a limb and horizon; of more, so many spread over the log. Their rms is then known to 1/√(2 × 200) = 5 %.
const MOST: usize = 200;

/// What moves the model.
#[derive(Debug, Clone, PartialEq)]
pub enum Under {
    /// The torque that the motors reported.
    Measured,
    /// What the drives were asked to do, with gains that the logs do not state; of a recording with commands ([`Recording::read_commanded`]).
    Commanded(Gains),
}

/// What `proprio compare --rollout` says.
#[derive(Debug, Clone, Serialize)]
pub struct Rollout {
    /// What the samples of each log are worth.
    pub data: Vec<LogGates>,
    /// Which torque moves the model: `measured` or `commanded`.
    pub torque: &'static str,
    /// rad; m where no joint turns.
    pub unit: &'static str,
    /// Each horizon, over all joints of that unit.
    pub horizons: Vec<HorizonError>,
    /// Each joint.
    pub joints: Vec<JointRollout>,
    /// As [`Comparison::added`](super::Comparison::added).
    pub added: Vec<String>,
    /// As [`Comparison::left_out`](super::Comparison::left_out).
    pub left_out: Vec<String>,
    /// Whether values were fitted to the other stretches of time rather than taken from the model file.
    pub fitted: bool,
    /// Effects of the model that a rollout lacks, `elasticity:FR_calf`.
    pub not_included: Vec<String>,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    /// Positions in time; for plots.
    #[serde(skip)]
    pub series: Vec<RolledJoint>,
}

/// The error after a time, of all joints or of one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HorizonError {
    /// Length of the rollouts, s.
    pub seconds: f64,
    /// Root mean square of measured less simulated position at their ends, rad or m; none where no rollout fits in the log or none ends.
    pub rms: Option<f64>,
    /// The same of the model without what was added, or with what was left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before_rms: Option<f64>,
    /// The same of the CAD's rigid bodies alone.
    pub cad_rms: Option<f64>,
    /// Root mean square of how far joints move in that time.
    pub displacement_rms: Option<f64>,
    /// Rollouts of the joint's limb; over all joints, of all limbs.
    pub rollouts: usize,
    /// Those of them that left what a robot can do, and are in no error.
    pub diverged: usize,
}

/// A joint's errors.
#[derive(Debug, Clone, Serialize)]
pub struct JointRollout {
    /// Which.
    pub joint: String,
    /// rad, or m.
    pub unit: &'static str,
    /// Each horizon.
    pub horizons: Vec<HorizonError>,
}

/// A joint's position in time.
#[derive(Debug, Clone, PartialEq)]
pub struct RolledJoint {
    /// Which.
    pub joint: String,
    /// rad, or m.
    pub unit: &'static str,
    /// Length of the rollouts, s.
    pub seconds: f64,
    /// s since the recording's start.
    pub t: Vec<f64>,
    /// Measured position.
    pub measured: Vec<f64>,
    /// The rollouts' position, by what to call the model, the model itself last.
    pub simulated: Vec<(&'static str, Vec<f64>)>,
}

/// Runs `model`, without the effects `left_out`, forward over a recording.
///
/// # Errors
/// [`RecordingError`] if no limb can be judged, no stretch of time is as long as the shortest horizon, or a command is asked for that no log has.
pub fn rollout(
    recording: &Recording,
    model: &Model,
    left_out: &[ModelEffect],
    values: ValuesFrom,
    under: &Under,
) -> Result<Rollout, RecordingError> {
    let Asked {
        fitted,
        added,
        before,
        ..
    } = asked(recording, model, left_out, values);
    let from = if fitted { From::HeldOut } else { From::File };
    let (data, feet) = leave_out_contact(robot::data(recording, model));
    check(recording, &data, &feet, fitted)?;
    let commands = commands(recording, &data, under)?;
    let commanded = *under != Under::Measured;
    let before = before.as_ref().map(|before| robot::data(recording, before));
    let own = values_of(&data, from);
    let before = before.map(|data| {
        let values = values_of(&data, from);
        (data, values)
    });
    let mut limbs = Vec::new();
    for (n, limb) in data.iter().enumerate() {
        let cad = (limb.as_reported(), vec![Values::cad(model, limb.limb)]);
        let commands = commands[n].as_ref();
        let models = Models {
            own: Rollouts::of(limb, &own[n], commands),
            before: before
                .as_ref()
                .map(|(data, own)| Rollouts::of(&data[n], &own[n], commands)),
            cad: Rollouts::of(&cad.0, &cad.1, commands),
        };
        limbs.push(models.run(limb, fitted));
    }
    if limbs.iter().all(|limb| limb.sums[0][0].rollouts == 0) {
        return Err(RecordingError::too_short(recording, HORIZONS[0]));
    }
    let (contact, words) = feet::told(&feet, recording, model);
    let contact = contact
        .iter()
        .map(|foot| format!("Contact, not simulated: {foot}."));
    let joints: Vec<JointRollout> = limbs.iter().flat_map(Limb::joints).collect();
    let turns = joints.iter().any(|joint| joint.unit == RAD);
    let unit = if turns { RAD } else { METRE };
    let over_all = |h: usize| {
        let all = limbs.iter().map(|limb| limb.over_all(h, unit));
        HorizonError::of(HORIZONS[h], &all.fold(Sums::default(), Sums::and))
    };
    Ok(Rollout {
        data: recording.gates.clone(),
        torque: if commanded { COMMANDED } else { "measured" },
        unit,
        horizons: (0..HORIZONS.len()).map(over_all).collect(),
        joints,
        added: names(model, &added),
        left_out: names(model, left_out),
        fitted,
        not_included: not_included(&data, commanded),
        logs: recording.logs.clone(),
        warnings: (recording.warnings.iter().cloned())
            .chain(words)
            .chain(contact)
            .collect(),
        series: limbs.into_iter().flat_map(|limb| limb.series).collect(),
    })
}

/// Of each limb what its drives were asked to do, where the model is to follow that.
fn commands(
    recording: &Recording,
    data: &[LimbData],
    under: &Under,
) -> Result<Vec<Option<Commands>>, RecordingError> {
    let Under::Commanded(gains) = under else {
        return Ok(vec![None; data.len()]);
    };
    let of = |limb: &LimbData| {
        Commands::of(limb, gains)
            .map(Some)
            .map_err(|missing| match missing {
                Missing::Column(channel, joint) => {
                    let joint = limb.joint_names().swap_remove(joint);
                    RecordingError::NoCommand {
                        logs: recording.logs.clone(),
                        column: channel.column(&joint),
                        joint,
                    }
                }
                Missing::Gains(joint) => RecordingError::NoGains {
                    logs: recording.logs.clone(),
                    joint: limb.joint_names().swap_remove(joint),
                },
            })
    };
    data.iter().map(of).collect()
}

const COMMANDED: &str = "commanded";
const RAD: &str = "rad";
const METRE: &str = "m";

/// Each limb's values: one model, or one for each fold.
fn values_of(data: &[LimbData], from: From) -> Vec<Vec<Values>> {
    match fits(data, from) {
        Some(fits) => (fits.iter())
            .map(|fit| fit.held_out().unwrap_or_else(|| vec![fit.values.clone()]))
            .collect(),
        None => (data.iter())
            .map(|data| vec![Values::given(data.model, data.limb)])
            .collect(),
    }
}

/// The models' effects with a value that no rollout has.
fn not_included(data: &[LimbData], commanded: bool) -> Vec<String> {
    let of = |limb: &LimbData| {
        let all = places(limb.model, limb.limb).map(|(_, effect)| *effect);
        let lacks = |e: &ModelEffect| e.estimate().is_some() && !is_included(e.effect, commanded);
        names(limb.model, &all.filter(lacks).collect::<Vec<_>>())
    };
    let mut names: Vec<String> = data.iter().flat_map(of).collect();
    names.dedup();
    names
}

/// What is run over a limb.
struct Models<'a> {
    own: Rollouts<'a>,
    before: Option<Rollouts<'a>>,
    cad: Rollouts<'a>,
}

/// Sums of squares over rollouts.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    own: Sum,
    before: Option<Sum>,
    cad: Sum,
    displacement: Sum,
    rollouts: usize,
    diverged: usize,
}

/// A sum of squares, and of how many.
#[derive(Debug, Clone, Copy, Default)]
struct Sum(f64, usize);

impl Sum {
    fn add(&mut self, error: Option<f64>) {
        if let Some(error) = error {
            *self = Self(self.0 + error * error, self.1 + 1);
        }
    }

    fn and(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }

    fn rms(self) -> Option<f64> {
        (self.1 > 0).then(|| (self.0 / self.1 as f64).sqrt())
    }
}

impl Sums {
    fn and(self, other: Self) -> Self {
        Self {
            own: self.own.and(other.own),
            before: other.before.map_or(self.before, |b| {
                Some(self.before.unwrap_or_default().and(b))
            }),
            cad: self.cad.and(other.cad),
            displacement: self.displacement.and(other.displacement),
            rollouts: self.rollouts + other.rollouts,
            diverged: self.diverged + other.diverged,
        }
    }
}

impl HorizonError {
    fn of(seconds: f64, sums: &Sums) -> Self {
        Self {
            seconds,
            rms: sums.own.rms(),
            before_rms: sums.before.and_then(Sum::rms),
            cad_rms: sums.cad.rms(),
            displacement_rms: sums.displacement.rms(),
            rollouts: sums.rollouts,
            diverged: sums.diverged,
        }
    }
}

/// A limb's rollouts.
struct Limb {
    names: Vec<String>,
    units: Vec<&'static str>,
    /// Of each horizon, each joint's.
    sums: Vec<Vec<Sums>>,
    series: Vec<RolledJoint>,
}

impl Models<'_> {
    fn run(&self, data: &LimbData, fitted: bool) -> Limb {
        let unit = |body: usize| match data.model.robot().bodies()[body].kind {
            JointKind::Prismatic => METRE,
            JointKind::Revolute | JointKind::Continuous => RAD,
        };
        let units: Vec<&str> = data.limb.bodies.clone().map(unit).collect();
        let all = HORIZONS.map(|seconds| spans(data, seconds, fitted));
        let sums = all
            .each_ref()
            .map(|spans| self.sums(data.joints(), spread(spans)));
        let mut horizons = HORIZONS.iter().zip(&all);
        let shown = horizons.rfind(|(seconds, of)| **seconds <= SHOWN && !of.is_empty());
        let series = shown.map_or_else(Vec::new, |(seconds, spans)| {
            self.series(data, *seconds, spread(spans).collect(), &units)
        });
        Limb {
            names: data.joint_names(),
            units,
            sums: sums.to_vec(),
            series,
        }
    }

    /// Of each joint.
    fn sums<'s>(&self, joints: usize, spans: impl Iterator<Item = &'s Span>) -> Vec<Sums> {
        let of = |span: &&Span| {
            let [start, end] = span.samples;
            let error = |of: &Rollouts| {
                let simulated = of.run(span, |_, _| ())?;
                Some(difference(&of.measured(span, end), &simulated))
            };
            let displacement = difference(
                &self.own.measured(span, end),
                &self.own.measured(span, start),
            );
            let before = self.before.as_ref().map(error);
            (error(&self.own), before, error(&self.cad), displacement)
        };
        let spans: Vec<&Span> = spans.collect();
        let all: Vec<_> = side_by_side(&spans, of);
        let mut sums = vec![Sums::default(); joints];
        for (own, before, cad, displacement) in &all {
            for (j, sums) in sums.iter_mut().enumerate() {
                let at = |errors: &Option<Vec<f64>>| errors.as_ref().map(|errors| errors[j]);
                sums.own.add(at(own));
                sums.cad.add(at(cad));
                sums.displacement.add(Some(displacement[j]));
                if let Some(before) = before {
                    sums.before.get_or_insert_default().add(at(before));
                }
                sums.rollouts += 1;
                sums.diverged += usize::from(own.is_none());
            }
        }
        sums
    }

    fn series(
        &self,
        data: &LimbData,
        seconds: f64,
        spans: Vec<&Span>,
        units: &[&'static str],
    ) -> Vec<RolledJoint> {
        let models = [
            Some(("CAD", &self.cad)),
            self.before.as_ref().map(|before| ("before", before)),
            Some(("model", &self.own)),
        ];
        let models: Vec<_> = models.into_iter().flatten().collect();
        let (n, samples) = (data.joints(), data.motion.time.len());
        // What no rollout reaches leaves a hole.
        let hole = vec![f64::NAN; samples];
        let mut measured = vec![hole.clone(); n];
        let mut simulated = vec![vec![hole; models.len()]; n];
        for span in spans {
            let [first, last] = span.samples;
            for sample in first..=last {
                let own = self.own.measured(span, sample);
                (measured.iter_mut().zip(own)).for_each(|(to, q)| to[sample] = q);
            }
            for (m, (_, model)) in models.iter().enumerate() {
                let _ = model.run(span, |sample, q| {
                    (simulated.iter_mut().zip(q)).for_each(|(to, q)| to[m][sample] = *q);
                });
            }
        }
        let joints = data
            .joint_names()
            .into_iter()
            .zip(units)
            .zip(measured.into_iter().zip(simulated));
        let joint = |((joint, unit), (measured, simulated)): ((_, &&'static str), (_, Vec<_>))| {
            RolledJoint {
                joint,
                unit,
                seconds,
                t: data.motion.time.to_vec(),
                measured,
                simulated: models
                    .iter()
                    .map(|(name, _)| *name)
                    .zip(simulated)
                    .collect(),
            }
        };
        joints.map(joint).collect()
    }
}

impl Limb {
    fn joints(&self) -> impl Iterator<Item = JointRollout> + '_ {
        let of = |j: usize| JointRollout {
            joint: self.names[j].clone(),
            unit: self.units[j],
            horizons: (HORIZONS.iter().zip(&self.sums))
                .map(|(seconds, joints)| HorizonError::of(*seconds, &joints[j]))
                .collect(),
        };
        (0..self.names.len()).map(of)
    }

    /// Over the joints of a unit; rollouts are the limb's.
    fn over_all(&self, horizon: usize, unit: &str) -> Sums {
        let joints = self.sums[horizon].iter().zip(&self.units);
        let own = joints
            .filter(|(_, own)| **own == unit)
            .map(|(sums, _)| *sums);
        let (rollouts, diverged) =
            (self.sums[horizon].first()).map_or((0, 0), |s| (s.rollouts, s.diverged));
        Sums {
            rollouts,
            diverged,
            ..own.fold(Sums::default(), Sums::and)
        }
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// At most [`MOST`] of them, evenly.
fn spread(spans: &[Span]) -> impl Iterator<Item = &Span> {
    let count = spans.len().min(MOST);
    (0..count).map(move |n| &spans[n * spans.len() / count])
}

impl Rollout {
    /// The error after the shortest horizon.
    pub fn error(&self) -> ErrorRange {
        let first = self.horizons.first();
        ErrorRange {
            before: first.and_then(|h| h.before_rms.or(h.cad_rms)),
            after: first.and_then(|h| h.rms),
            floor: None,
            floor_unknown: None,
            unit: self.unit,
        }
    }

    /// The first screen: the error, how it grows, what no rollout has.
    pub fn summary(&self, model: Option<&Path>) -> Summary {
        let mut points: Vec<String> = self.worst().into_iter().collect();
        if !self.not_included.is_empty() {
            let not = self.not_included.join(", ");
            let drives = match self.torque {
                COMMANDED => ", drives immediate",
                _ => "",
            };
            points.push(format!(
                "Not in the rollouts, whose gears are rigid, feet free{drives}: {not}"
            ));
        }
        let diverged: usize = self.horizons.iter().map(|h| h.diverged).sum();
        if diverged > 0 {
            let all: usize = self.horizons.iter().map(|h| h.rollouts).sum();
            points.push(format!(
                "{diverged} of {all} rollouts diverged and are in no error"
            ));
        }
        let table = self.table().to_string();
        Summary {
            headline: self.headline(),
            rows: table.lines().map(|line| format!("  {line}")).collect(),
            points,
            next: vec![format!("proprio diagnose {}", typed(&self.logs, model))],
        }
    }

    /// The joint of the largest error after the shortest horizon.
    fn worst(&self) -> Option<String> {
        let rms = |joint: &&JointRollout| joint.horizons.first().and_then(|h| h.rms);
        let own = self.joints.iter().filter(|joint| joint.unit == self.unit);
        let known = own.filter_map(|joint| Some((rms(&joint)?, joint)));
        let (rms, joint) = known.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let first = joint.horizons.first()?;
        Some(format!(
            "Largest after {} s: {}, {} {}",
            first.seconds,
            joint.joint,
            digits(Some(rms)),
            joint.unit
        ))
    }

    /// The error after the shortest horizon, and before.
    pub fn headline(&self) -> String {
        let Some(first) = self.horizons.first() else {
            return String::new();
        };
        let mut text = match first.before_rms {
            Some(before) => format!("Rollout error {} → ", digits(Some(before))),
            None => "Rollout error ".to_owned(),
        };
        if self.torque == COMMANDED {
            text = text.replacen("Rollout error", "Commanded rollout error", 1);
        }
        text += &format!(
            "{} {} rms after {} s",
            digits(first.rms),
            self.unit,
            first.seconds
        );
        for (word, changed) in [("with", &self.added), ("without", &self.left_out)] {
            if !changed.is_empty() {
                text += &format!(" {word} {}", super::text::named(changed));
            }
        }
        format!("{text} (CAD alone {})", digits(first.cad_rms))
    }

    /// A row for each model, a column for each horizon.
    fn table(&self) -> Table {
        let mut table = Table::default();
        table.row(self.head(&format!("{} rms after", self.unit)));
        let mut row = |name: &str, of: &dyn Fn(&HorizonError) -> String| {
            let cells = self.horizons.iter().map(of);
            table.row([name.to_owned()].into_iter().chain(cells));
        };
        row("model", &|h| digits(h.rms));
        if self.horizons.iter().any(|h| h.before_rms.is_some()) {
            row("before", &|h| digits(h.before_rms));
        }
        row("CAD alone", &|h| digits(h.cad_rms));
        row("joints' displacement", &|h| digits(h.displacement_rms));
        row("rollouts", &|h| h.rollouts.to_string());
        table
    }

    fn head(&self, title: &str) -> impl Iterator<Item = String> {
        let cells = self.horizons.iter().map(|h| format!("{} s", h.seconds));
        [title.to_owned()]
            .into_iter()
            .chain(cells.collect::<Vec<_>>())
    }

    /// The errors of each joint.
    pub fn text(&self) -> String {
        let mut table = Table::default();
        table.row(self.head("rms after"));
        for joint in &self.joints {
            let name = format!("{}, {}", joint.joint, joint.unit);
            let cells = joint.horizons.iter().map(|h| digits(h.rms));
            table.row([name].into_iter().chain(cells));
        }
        format!("{}\n{}\n{table}", self.headline(), self.table())
    }
}

/// An error to two digits that count.
fn digits(rms: Option<f64>) -> String {
    match rms {
        Some(rms) if rms > 0.0 => {
            let decimals = (1.0 - rms.log10().floor()).clamp(1.0, 7.0) as usize;
            format!("{rms:.decimals$}")
        }
        Some(_) => "0".to_owned(),
        None => "–".to_owned(),
    }
}
