//! Logs in memory, limb by limb: what the criticism goes over more than once.
//!
//! Files beside:
//!
//! - `error`: what can be wrong with a recording
//! - `only`: a part that is judged, where conditions on the motion hold
//! - `pieces`: long recordings, thinned to pieces that are spread evenly over time, so that memory does not grow with their length
//! - `slabs`: a log of any length, cut into recordings that follow one another
//! - `second_encoder`: what a user should know of second encoders: where they are not used, and where they do not count as the motors' do

mod error;
mod limb;
mod only;
mod pieces;
mod second_encoder;
mod slabs;

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::equation::velocity::VelocityGain;
use crate::formula::Condition;
use crate::gate::{DataGates, Gate, GateReport, Joint, Reading};
use crate::log::{LEAST_DURATION, LogReader, Row, Selection, Warning};
use crate::model::{Limb, Model};
pub use error::RecordingError;
pub use limb::LimbRecording;
pub use only::ConditionProblem;
use pieces::Pieces;
use proprio_simulator::SimulatedSample;
use slabs::Cutter;
pub(crate) use slabs::{SHORTEST as SHORTEST_SLAB, Slab};

/// Most joints of a limb that can be judged.
pub(crate) const MAX_JOINTS: usize = 16;

/// Most samples of a limb that are kept, a hundred seconds at 500 Hz and five chirps whole. Of a longer log at least half as many are,
/// 2 600 windows of a joint: what takes away as much as a step asks for, 1 % of the error, takes 26 times its variance there, and a value
/// of four standard deviations takes 16.
const MOST_SAMPLES: usize = 52_000;
/// Length of the pieces that a longer recording is thinned to, µs: much longer than what residuals remember.
pub(crate) const PIECE_US: u64 = 2_000_000;

/// Logs of one robot.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// The limbs recorded, each with its place among the robot's bodies.
    pub limbs: Vec<(Limb, LimbRecording)>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    /// Length of all logs together, s.
    pub duration: f64,
    /// What the samples of each log are worth.
    pub gates: Vec<LogGates>,
    /// The conditions under which it is judged ([`Recording::only`]).
    pub only: Vec<String>,
    /// Whether it is a part of the logs, drawn because they are long.
    pub is_drawn: bool,
}

/// What the samples of a log are worth, before a model is blamed.
#[derive(Debug, Clone, Serialize)]
pub struct LogGates {
    /// The log.
    pub log: PathBuf,
    /// When it begins in the recording's time, s.
    pub start: f64,
    /// What is wrong with it.
    #[serde(flatten)]
    pub report: GateReport,
}

/// Silence put between two logs, µs: no stretch, block or guard reaches across it.
const BETWEEN_LOGS_US: u64 = 1_000_000;

impl Recording {
    /// Reads `logs` of the robot of `model`, joints by the model's names. `progress` hears of bytes read and of how many in
    /// all. Limbs that are not recorded are left out, and so, with a warning, are those of more than sixteen joints.
    ///
    /// # Errors
    /// The first log that is bad; [`RecordingError::LimbTooLarge`] if no limb is left; [`RecordingError::TooShort`].
    pub fn read(
        logs: &[PathBuf],
        model: &Model,
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Self, RecordingError> {
        Self::read_near(logs, model, (Vec::new(), false), &mut progress)
    }

    /// Reads only the time in which all conditions `near` nearly hold, with what the drives were asked to do where `commanded`.
    fn read_near(
        logs: &[PathBuf],
        model: &Model,
        (near, commanded): (Vec<Condition>, bool),
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Self, RecordingError> {
        let mut pass = Pass {
            near,
            commanded,
            ..Pass::new(logs, model)
        };
        for log in logs {
            pass.read(log, &mut progress)?;
        }
        let Pass {
            mut recording,
            pieces,
            too_large,
            ..
        } = pass;
        if recording.limbs.is_empty() {
            return Err(RecordingError::LimbTooLarge {
                logs: logs.to_vec(),
                limbs: too_large,
            });
        }
        // Silences are no motion; a joint that rests is recorded though its samples repeat.
        let recorded = |(_, limb): &(Limb, LimbRecording)| {
            (limb.len() as u64 + limb.repeated) as f64 * limb.period()
        };
        let recorded = recording.limbs.iter().map(recorded).fold(0.0, f64::max);
        if recording.duration.min(recorded) < LEAST_DURATION {
            return Err(RecordingError::too_short(&recording, LEAST_DURATION));
        }
        let limbs = recording.limbs.iter_mut();
        limbs.for_each(|(_, limb)| limb.shrink());
        let thinned = pieces.warning(recording.duration);
        recording.is_drawn = thinned.is_some();
        let encoders = second_encoder::warnings(&recording, model);
        let left_out = too_large.iter().map(left_out);
        recording
            .warnings
            .extend(thinned.into_iter().chain(left_out).chain(encoders));
        Ok(recording)
    }

    /// Nothing of these logs yet.
    fn of_logs(logs: &[PathBuf]) -> Self {
        Self {
            logs: logs.to_vec(),
            limbs: Vec::new(),
            warnings: Vec::new(),
            duration: 0.0,
            gates: Vec::new(),
            only: Vec::new(),
            is_drawn: false,
        }
    }

    /// The log that a moment of the recording lies in, and the time since that log's start, s.
    pub fn moment(&self, t: f64) -> (&PathBuf, f64) {
        let later = self.gates.partition_point(|gates| gates.start <= t);
        let gates = &self.gates[later.max(1) - 1];
        (&gates.log, t - gates.start)
    }

    /// What of it is of its log `n`, in the order in which they were given; times stay the recording's.
    pub fn of_log(&self, n: usize) -> Self {
        let start_us = |n: usize| (self.gates[n].start * 1e6).round() as u64;
        let end_us = match n + 1 < self.gates.len() {
            true => start_us(n + 1),
            false => u64::MAX,
        };
        let time = start_us(n)..end_us;
        let limbs = self.limbs.iter().filter_map(|(limb, samples)| {
            let mut samples = samples.clone();
            samples.keep(|time_us| time.contains(&time_us));
            samples.log_starts.retain(|time_us| time.contains(time_us));
            (!samples.is_empty()).then(|| (limb.clone(), samples))
        });
        let limbs: Vec<_> = limbs.collect();
        let last = limbs.iter().filter_map(|(_, limb)| limb.time_us.last());
        let length_us = last.max().map_or(0, |last| last - time.start);
        Self {
            logs: vec![self.gates[n].log.clone()],
            limbs,
            warnings: Vec::new(),
            duration: length_us as f64 * 1e-6,
            gates: vec![self.gates[n].clone()],
            only: self.only.clone(),
            is_drawn: self.is_drawn,
        }
    }

    /// Samples that a simulation gives, without a file between: `joints` names those of a sample in their order. A limb of
    /// which a joint is not among them, or of more than sixteen joints, is left out.
    pub fn from_samples<'a>(
        model: &Model,
        joints: &[&str],
        samples: impl IntoIterator<Item = &'a SimulatedSample>,
    ) -> Self {
        let mut recording = Self::of_logs(&[]);
        let recorded: Vec<_> = joints.iter().enumerate().map(|(n, j)| (*j, n)).collect();
        let limbs = recording.limbs_of(model, &recorded);
        let mut gates = Gates::new(model, &recording.limbs, &limbs);
        let mut start = None;
        for sample in samples {
            let t = sample.t - *start.get_or_insert(sample.t);
            let time_us = (t * 1e6).round() as u64;
            recording.duration = t;
            let temperatures = sample.temp.as_deref().unwrap_or(&[]);
            gates.push(time_us, [&sample.q, &sample.dq, &sample.tau, temperatures]);
            for (place, own) in &limbs {
                let of = |channel: &[f64]| own.iter().map(|&j| channel[j]).collect::<Vec<_>>();
                let unknown = || vec![f64::NAN; own.len()];
                let temperature = sample.temp.as_deref().map_or_else(unknown, of);
                let (q, dq, tau) = (of(&sample.q), of(&sample.dq), of(&sample.tau));
                let q_link = sample.q_link.as_deref().map_or_else(Vec::new, of);
                let channels = [&q[..], &dq[..], &tau[..], &temperature[..], &q_link[..]];
                let limb = &mut recording.limbs[*place].1;
                limb.push(time_us, channels, f64::NAN, false);
            }
        }
        recording.gates.push(LogGates {
            log: PathBuf::from("simulation"),
            start: 0.0,
            report: unless_known(gates.gates.report(), model),
        });
        recording
    }

    /// The limbs that a log has of whose joints name and index are `recorded`: their place here, and the log's indices of
    /// their joints.
    fn limbs_of(&mut self, model: &Model, recorded: &[(&str, usize)]) -> Vec<(usize, Vec<usize>)> {
        let mut found = Vec::new();
        for limb in model.robot().limbs() {
            if is_too_large(&limb) {
                continue;
            }
            let names = limb.bodies.clone().map(|b| &model.robot().bodies()[b].name);
            let joints: Option<Vec<usize>> = names
                .map(|name| {
                    recorded
                        .iter()
                        .find(|(known, _)| *known == name.as_str())
                        .map(|(_, index)| *index)
                })
                .collect();
            let Some(joints) = joints else { continue };
            let place = self
                .limbs
                .iter()
                .position(|(known, _)| *known == limb)
                .unwrap_or_else(|| {
                    let recording = LimbRecording {
                        joints: joints.len(),
                        ..LimbRecording::default()
                    };
                    self.limbs.push((limb, recording));
                    self.limbs.len() - 1
                });
            found.push((place, joints));
        }
        found
    }
}

/// How long before and after the time that is judged the motion is known, s: much longer than a smoother looks.
const MARGIN: f64 = 1.0;

/// Torques above so many times an actuator's limit are of another unit or another joint, where most are.
const MOST_TORQUE: f64 = 2.0;

/// Logs as they are read, one after the other.
struct Pass<'a> {
    model: &'a Model,
    recording: Recording,
    pieces: Pieces,
    /// When the next log begins in the recording's time, µs.
    offset_us: u64,
    /// Limbs recorded that have too many joints.
    too_large: Vec<Limb>,
    /// Conditions of time: what is not near a moment in which they hold is not taken, so that a part of a long log is not thinned as the
    /// whole of it is.
    near: Vec<Condition>,
    /// Whether what the drives were asked to do is taken too: most of a log's numbers, which one command wants.
    commanded: bool,
    /// Takes each slab as soon as it is whole, where nothing is to be kept.
    cutter: Option<Cutter<'a>>,
}

/// A limb in a log.
struct LimbInLog {
    /// Its place in the recording.
    place: usize,
    /// The log's indices of its joints.
    joints: Vec<usize>,
    /// The log's index of its foot.
    foot: usize,
    /// Whether nothing of the log has been taken yet.
    is_new: bool,
}

impl<'a> Pass<'a> {
    /// Before anything is read: all of it is to be taken.
    fn new(logs: &[PathBuf], model: &'a Model) -> Self {
        Self {
            model,
            recording: Recording::of_logs(logs),
            pieces: Pieces::all(),
            offset_us: 0,
            too_large: Vec::new(),
            near: Vec::new(),
            commanded: false,
            cutter: None,
        }
    }

    /// Whether a moment is to be taken.
    fn takes(&self, time_us: u64) -> bool {
        self.pieces.keep(time_us)
            && self
                .near
                .iter()
                .all(|of| of.holds_near(1e-6 * time_us as f64, MARGIN))
    }

    /// Reads the next log.
    fn read(
        &mut self,
        log: &Path,
        progress: &mut impl FnMut(u64, u64),
    ) -> Result<(), RecordingError> {
        let mut reader = LogReader::open_of(log, Selection::Everything, self.model.robot())?;
        let joints = reader.columns().joints();
        let joints: Vec<_> = joints.map(|j| (self.model.joint_name(j), j)).collect();
        let found = self.recording.limbs_of(self.model, &joints);
        self.note_too_large(reader.columns().limbs());
        let mut gates = Gates::new(self.model, &self.recording.limbs, &found);
        let mut limbs = self.in_log(found);
        let (mut first, mut last_us, mut rows) = (None, 0, 0u64);
        let mut buffer = [const { Vec::new() }; 5];
        let efforts: Vec<f64> = joints.iter().map(|(name, _)| self.effort(name)).collect();
        let indices: Vec<usize> = joints.iter().map(|(_, j)| *j).collect();
        let mut beyond = vec![0u64; efforts.len()];
        while let Some(row) = reader.next_row()? {
            for ((count, effort), &j) in beyond.iter_mut().zip(&efforts).zip(&indices) {
                *count += u64::from(row.tau()[j].abs() > MOST_TORQUE * effort);
            }
            let start_us = *first.get_or_insert(row.time_us);
            last_us = row.time_us.saturating_sub(start_us);
            gates.push(last_us, [row.q(), row.dq(), row.tau(), row.temp()]);
            if let Some(cutter) = &mut self.cutter
                && cutter.cut(last_us, &mut self.recording.limbs)
            {
                limbs.iter_mut().for_each(|limb| limb.is_new = true);
            }
            if self.takes(self.offset_us + last_us) {
                for limb in &mut limbs {
                    self.take(row, self.offset_us + last_us, limb, &mut buffer);
                }
            }
            rows += 1;
            if rows.is_multiple_of(1024) {
                self.pieces.thin(&mut self.recording.limbs);
                let (done, total) = reader.progress();
                progress(done, total);
            }
        }
        for (n, &count) in beyond.iter().enumerate() {
            if 2 * count > rows {
                return Err(RecordingError::Impossible {
                    log: log.to_owned(),
                    joint: joints[n].0.to_owned(),
                    percent: 100.0 * count as f64 / rows as f64,
                    effort: efforts[n],
                });
            }
        }
        if let Some(cutter) = &mut self.cutter {
            cutter.end_log(reader.first(), &mut self.recording.limbs);
        }
        let told: Vec<Warning> = reader.finish()?;
        let told = told.iter().map(|w| format!("{}: {w}", log.display()));
        self.recording.warnings.extend(told);
        self.recording.gates.push(LogGates {
            log: log.to_owned(),
            start: self.offset_us as f64 * 1e-6,
            report: unless_known(gates.gates.report(), self.model),
        });
        self.recording.duration += last_us as f64 * 1e-6;
        self.offset_us += last_us + BETWEEN_LOGS_US;
        Ok(())
    }

    /// What a joint's actuator can do, N m; without a limit if the model does not say.
    fn effort(&self, joint: &str) -> f64 {
        let bodies = self.model.robot().bodies().iter();
        let known = bodies
            .clone()
            .find(|body| body.name == joint)
            .map(|body| body.effort);
        known
            .filter(|effort| *effort > 0.0)
            .unwrap_or(f64::INFINITY)
    }

    /// Takes a limb's sample, if it is whole.
    fn take(&mut self, row: &Row, time_us: u64, limb: &mut LimbInLog, buffer: &mut [Vec<f64>; 5]) {
        let channels = [row.q(), row.dq(), row.tau(), row.temp(), row.q_link()];
        for (to, from) in buffer.iter_mut().zip(channels) {
            to.clear();
            to.extend(limb.joints.iter().map(|&j| from[j]));
        }
        if buffer[4].iter().all(|q| q.is_nan()) {
            buffer[4].clear();
        }
        let sample = buffer.each_ref().map(Vec::as_slice);
        if sample[..3].iter().all(|x| x.iter().all(|x| x.is_finite())) {
            let is_new = std::mem::take(&mut limb.is_new);
            let foot = row.foot()[limb.foot];
            let recording = &mut self.recording.limbs[limb.place].1;
            let known = recording.len();
            recording.push(time_us, sample, foot, is_new);
            if self.commanded && recording.len() > known {
                let command = row.command();
                let of = |&j: &usize| command.map(|channel| channel[j]);
                recording.command.extend(limb.joints.iter().map(of));
            }
        }
    }

    /// The limbs found in a log whose reading begins.
    fn in_log(&self, found: Vec<(usize, Vec<usize>)>) -> Vec<LimbInLog> {
        let all = self.model.robot().limbs();
        let limb = |(place, joints): (usize, Vec<usize>)| {
            let own = &self.recording.limbs[place].0;
            LimbInLog {
                place,
                joints,
                foot: all.iter().position(|limb| limb == own).unwrap_or_default(),
                is_new: true,
            }
        };
        found.into_iter().map(limb).collect()
    }

    fn note_too_large<'l>(&mut self, recorded: impl Iterator<Item = &'l Limb>) {
        for limb in recorded.filter(|limb| is_too_large(limb)) {
            if !self.too_large.contains(limb) {
                self.too_large.push(limb.clone());
            }
        }
    }
}

/// The data gates of one log.
struct Gates {
    gates: DataGates,
    /// The log's indices of their joints.
    joints: Vec<usize>,
    readings: Vec<Reading>,
}

impl Gates {
    fn new(
        model: &Model,
        limbs: &[(Limb, LimbRecording)],
        recorded: &[(usize, Vec<usize>)],
    ) -> Self {
        let bodies = recorded
            .iter()
            .flat_map(|(place, _)| limbs[*place].0.bodies.clone());
        let joint = |b: usize| Joint {
            name: model.robot().bodies()[b].name.clone(),
            effort: model.robot().bodies()[b].effort,
        };
        Self {
            gates: DataGates::new(bodies.map(joint)),
            joints: recorded
                .iter()
                .flat_map(|(_, joints)| joints.clone())
                .collect(),
            readings: Vec::new(),
        }
    }

    /// Positions, velocities, torques and temperatures of all joints of the log; there may be no temperatures.
    fn push(&mut self, time_us: u64, [q, dq, tau, temperature]: [&[f64]; 4]) {
        let reading = |&j: &usize| Reading {
            q: q[j],
            dq: dq[j],
            tau: tau[j],
            temperature: temperature.get(j).copied().filter(|t| t.is_finite()),
        };
        self.readings.clear();
        self.readings.extend(self.joints.iter().map(reading));
        self.gates.push(time_us, &self.readings);
    }
}

fn is_too_large(limb: &Limb) -> bool {
    limb.bodies.len() > MAX_JOINTS
}

fn left_out(limb: &Limb) -> String {
    format!(
        "limb {} is left out: it has {} joints, and at most {MAX_JOINTS} can be judged",
        limb.name,
        limb.bodies.len()
    )
}

/// What is found of a log without the velocities whose gain the model has already: its remedy is in use.
fn unless_known(mut report: GateReport, model: &Model) -> GateReport {
    let has_gain = |joint: &String| {
        let mut effects = model.effects().iter();
        effects
            .any(|own| own.effect == VelocityGain::EFFECT && model.joint_name(own.joint) == joint)
    };
    report.findings.retain(|finding| {
        let is_known = !finding.joints.is_empty() && finding.joints.iter().all(has_gain);
        !(finding.gate == Gate::VelocityGain && is_known)
    });
    report
}

/// What is wrong with the samples, for a first screen: the first finding, and how many more there are; nothing if nothing is wrong.
pub fn first_gate_words(gates: &[LogGates]) -> String {
    let mut all = gates.iter().flat_map(|one| &one.report.findings);
    let Some(first) = all.next() else {
        return String::new();
    };
    let more = match all.count() {
        0 => String::new(),
        more => format!(" (and {more} more)"),
    };
    format!("Data: {first}{more}")
}

/// What is wrong with the samples, a line each; that nothing is, if so.
pub fn gate_words(gates: &[LogGates]) -> String {
    let mut text = String::new();
    for one in gates {
        let log = if gates.len() > 1 {
            format!("{}: ", one.log.display())
        } else {
            String::new()
        };
        for finding in &one.report.findings {
            text += &format!("Data: {log}{finding}\n");
        }
    }
    if text.is_empty() {
        text += "Data: nothing wrong with the samples\n";
    }
    text.push('\n');
    text
}
