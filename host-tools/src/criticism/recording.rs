//! Logs in memory, limb by limb: what the criticism goes over more than once.

mod limb;
mod pieces;

use std::path::PathBuf;

use serde::Serialize;

use super::CriticismError;
use super::gate::{DataGates, GateReport, Joint, Reading};
use super::rigid_body::MAX_JOINTS;
use crate::log::{LogReader, Selection, Warning};
use crate::model::{Limb, Model};
use crate::simulator::SimulatedSample;
pub use limb::{LimbRecording, MAX_GAP_US};
use pieces::Pieces;

/// Most samples of a limb that are kept, about four minutes at 500 Hz: a diagnosis then fits in 200 MB.
const MOST_SAMPLES: usize = 130_000;
/// Length of the pieces that a longer recording is thinned to, µs: much longer than what residuals remember.
const PIECE_US: u64 = 2_000_000;

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
    /// all. Limbs that are not recorded are left out, and so, with a warning, are those of more than eight joints.
    ///
    /// # Errors
    /// The first log that is bad; [`CriticismError::LimbTooLarge`] if no limb is left.
    pub fn read(
        logs: &[PathBuf],
        model: &Model,
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Self, CriticismError> {
        let mut recording = Self {
            logs: logs.to_vec(),
            limbs: Vec::new(),
            warnings: Vec::new(),
            duration: 0.0,
            gates: Vec::new(),
        };
        let (mut offset_us, mut pieces) = (0, Pieces::all());
        let mut too_large: Vec<Limb> = Vec::new();
        for path in logs {
            let mut reader = LogReader::open_of(path, Selection::Everything, model.robot())?;
            let recorded = reader.columns().joints();
            let recorded: Vec<_> = recorded.map(|j| (model.joint_name(j), j)).collect();
            let limbs = recording.limbs_of(model, &recorded);
            for limb in reader.columns().limbs().filter(|limb| is_too_large(limb)) {
                if !too_large.contains(limb) {
                    too_large.push(limb.clone());
                }
            }
            let feet = recording.feet(model, &limbs);
            let mut gates = Gates::new(model, &recording.limbs, &limbs);
            let (mut first, mut last_us) = (None, 0);
            let mut new_log = vec![true; limbs.len()];
            let (mut buffer, mut rows) = ([const { Vec::new() }; 4], 0u64);
            while let Some(row) = reader.next_row()? {
                let start_us = *first.get_or_insert(row.time_us);
                last_us = row.time_us.saturating_sub(start_us);
                gates.push(last_us, [row.q(), row.dq(), row.tau(), row.temp()]);
                let kept = pieces.keep(offset_us + last_us);
                for (n, (place, joints)) in limbs.iter().enumerate().filter(|_| kept) {
                    let channels = [row.q(), row.dq(), row.tau(), row.temp()];
                    for (to, from) in buffer.iter_mut().zip(channels) {
                        to.clear();
                        to.extend(joints.iter().map(|&j| from[j]));
                    }
                    let foot = row.foot()[feet[n]];
                    let sample = buffer.each_ref().map(Vec::as_slice);
                    if sample[..3].iter().all(|x| x.iter().all(|x| x.is_finite())) {
                        let limb = &mut recording.limbs[*place].1;
                        limb.push(
                            offset_us + last_us,
                            sample,
                            foot,
                            std::mem::take(&mut new_log[n]),
                        );
                    }
                }
                rows += 1;
                if rows.is_multiple_of(1024) {
                    pieces.thin(&mut recording.limbs);
                    let (done, total) = reader.progress();
                    progress(done, total);
                }
            }
            let told: Vec<Warning> = reader.finish()?;
            recording
                .warnings
                .extend(told.iter().map(|w| format!("{}: {w}", path.display())));
            recording.gates.push(LogGates {
                log: path.clone(),
                start: offset_us as f64 * 1e-6,
                report: gates.gates.report(),
            });
            recording.duration += last_us as f64 * 1e-6;
            offset_us += last_us + BETWEEN_LOGS_US;
        }
        let warning = pieces.warning(recording.duration);
        recording.warnings.extend(warning);
        if recording.limbs.is_empty() {
            return Err(CriticismError::LimbTooLarge {
                logs: logs.to_vec(),
                limbs: too_large,
            });
        }
        recording.warnings.extend(too_large.iter().map(left_out));
        Ok(recording)
    }

    /// The log that a moment of the recording lies in, and the time since that log's start, s.
    pub fn moment(&self, t: f64) -> (&PathBuf, f64) {
        let later = self.gates.partition_point(|gates| gates.start <= t);
        let gates = &self.gates[later.max(1) - 1];
        (&gates.log, t - gates.start)
    }

    /// Samples that a simulation gives, without a file between: `joints` names those of a sample in their order. A limb of
    /// which a joint is not among them, or of more than eight joints, is left out.
    pub fn from_samples<'a>(
        model: &Model,
        joints: &[&str],
        samples: impl IntoIterator<Item = &'a SimulatedSample>,
    ) -> Self {
        let mut recording = Self {
            logs: Vec::new(),
            limbs: Vec::new(),
            warnings: Vec::new(),
            duration: 0.0,
            gates: Vec::new(),
        };
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
                let channels = [&q[..], &dq[..], &tau[..], &temperature[..]];
                let limb = &mut recording.limbs[*place].1;
                limb.push(time_us, channels, f64::NAN, false);
            }
        }
        recording.gates.push(LogGates {
            log: PathBuf::from("simulation"),
            start: 0.0,
            report: gates.gates.report(),
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

    /// The number of each of `limbs`, by their places here, among the robot's.
    fn feet(&self, model: &Model, limbs: &[(usize, Vec<usize>)]) -> Vec<usize> {
        let all = model.robot().limbs();
        let number = |(place, _): &(usize, Vec<usize>)| {
            let own = &self.limbs[*place].0;
            all.iter().position(|limb| limb == own).unwrap_or_default()
        };
        limbs.iter().map(number).collect()
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
