//! Logs of which a part was drawn: what models make of every window of them, minute by minute, in the memory of a minute.
//!
//! A long log is thinned to a part that the search can go over again and again ([`crate::recording`]). What it finds there is held against all of the
//! log here: no window but the drawn ones had a say in the model.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::contact::leave_out_contact;
use super::ladder::over_all;
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot;
use crate::model::Model;
use crate::parallel::side_by_side;
use crate::recording::{Recording, RecordingError, Slab};
use crate::summary::{from_standard_input, torque};

/// s.
const MINUTE: f64 = 60.0;
/// A minute stands out if its mean square error is so many times that of the logs: what it has that others lack is then most of its error.
const STANDS_OUT: f64 = 2.0;

/// Errors over every window of the logs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EveryWindow {
    /// How long the logs are, s.
    pub seconds: f64,
    /// Windows in which a joint is judged, of all joints.
    pub windows: f64,
    /// Root mean square of measured − predicted mean torque over them, of the model file as it is given, N m.
    pub before_rms: f64,
    /// Of the result, N m.
    pub after_rms: f64,
    /// Each joint.
    pub joints: Vec<JointErrors>,
    /// Each minute in which something is judged.
    pub minutes: Vec<MinuteErrors>,
    /// The place among them of the one whose error is largest.
    pub worst_minute: usize,
}

/// A joint's errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointErrors {
    /// Which.
    pub joint: String,
    /// Windows in which it is judged.
    pub windows: f64,
    /// As [`EveryWindow::before_rms`].
    pub before_rms: f64,
    /// As [`EveryWindow::after_rms`].
    pub after_rms: f64,
}

/// A minute's errors, over all joints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MinuteErrors {
    /// The log.
    pub log: PathBuf,
    /// When it begins, s since the log's start.
    pub start: f64,
    /// When it begins in the time of all logs together, as `--only` and formulas have it, s.
    pub t: f64,
    /// Windows in which a joint is judged, of all joints.
    pub windows: f64,
    /// As [`EveryWindow::before_rms`].
    pub before_rms: f64,
    /// As [`EveryWindow::after_rms`].
    pub after_rms: f64,
    /// The joint whose error is largest.
    pub worst_joint: String,
    /// Its error, N m.
    pub worst_joint_rms: f64,
}

/// Windows, and sums of squares before and after, (N m)².
type Sums = [f64; 3];

/// Sums of a minute, joint by joint of the robot.
struct Minute {
    log: usize,
    block: u64,
    joints: Vec<Sums>,
}

/// What the models make of every window of a recording's logs, if they are longer than it: `given` as the file has it, and `found` with the values that
/// it has now. Windows in which a foot carries a force are left out where the recording has such. `progress` receives the bytes read of a log and how
/// many it has in all.
///
/// # Errors
/// [`RecordingError`] if a log that could be read cannot be read again.
pub fn every_window(
    recording: &Recording,
    [given, found]: [&Model; 2],
    on_feet: bool,
    progress: impl FnMut(u64, u64),
) -> Result<Option<EveryWindow>, RecordingError> {
    // Standard input is read once.
    if !recording.is_drawn || from_standard_input(&recording.logs) {
        return Ok(None);
    }
    let names = found.robot().bodies().iter();
    let names: Vec<&str> = names.map(|body| body.name.as_str()).collect();
    let mut minutes: Vec<Minute> = Vec::new();
    let mut each = |slab: Slab| {
        let (log, block) = (slab.log, slab.block);
        let slab = slab.only(&recording.only, found);
        let limbs = robot::data_of(&slab.limbs, found);
        let of = |data: &LimbData| {
            (
                data.limb.bodies.start,
                sums(data.clone(), [given, found], on_feet),
            )
        };
        for (first, sums) in side_by_side(&limbs, of) {
            let known = minutes
                .last()
                .is_some_and(|last| (last.log, last.block) == (log, block));
            if !known {
                minutes.push(Minute {
                    log,
                    block,
                    joints: vec![Sums::default(); names.len()],
                });
            }
            if let Some(minute) = minutes.last_mut() {
                let joints = minute.joints.iter_mut().skip(first);
                joints.zip(sums).for_each(|(to, own)| add(to, &own));
            }
        }
    };
    Recording::in_slabs(&recording.logs, found, MINUTE, &mut each, progress)?;
    Ok(told(recording, &names, &minutes))
}

/// The sums of a limb's joints.
fn sums(mut data: LimbData, [given, found]: [&Model; 2], on_feet: bool) -> Vec<Sums> {
    if on_feet {
        let (mut limbs, _) = leave_out_contact(vec![data]);
        data = limbs.swap_remove(0);
    }
    let squares = |model| data.squares(&data.predicted_as_given(model)).by_joint();
    let (before, after) = (squares(given), squares(found));
    let both = before.into_iter().zip(after).zip(data.windows());
    both.map(|((before, after), windows)| [windows, before, after])
        .collect()
}

fn add(to: &mut Sums, own: &Sums) {
    to.iter_mut().zip(own).for_each(|(to, own)| *to += own);
}

/// Root mean squares before and after.
fn errors(sums: &Sums) -> [f64; 2] {
    [sums[1], sums[2]].map(|square| (square / sums[0].max(1.0)).sqrt())
}

fn told(recording: &Recording, names: &[&str], minutes: &[Minute]) -> Option<EveryWindow> {
    let of_joint = |j: usize| {
        let own = minutes.iter().map(|minute| minute.joints[j]);
        own.fold(Sums::default(), |mut sum, own| {
            add(&mut sum, &own);
            sum
        })
    };
    let joints = names.iter().enumerate().map(|(j, joint)| {
        let sums = of_joint(j);
        let [before_rms, after_rms] = errors(&sums);
        JointErrors {
            joint: (*joint).to_owned(),
            windows: sums[0],
            before_rms,
            after_rms,
        }
    });
    let joints: Vec<JointErrors> = joints.filter(|joint| joint.windows > 0.0).collect();
    let over = |of: &dyn Fn(&JointErrors) -> f64| {
        over_all(joints.iter().map(|joint| (joint.windows, of(joint))))
    };
    let minutes: Vec<MinuteErrors> = (minutes.iter())
        .filter_map(|minute| minute.told(recording, names))
        .collect();
    let worst = minutes.iter().enumerate();
    let worst = worst.max_by(|a, b| a.1.after_rms.total_cmp(&b.1.after_rms))?;
    Some(EveryWindow {
        seconds: recording.duration,
        windows: joints.iter().map(|joint| joint.windows).sum(),
        before_rms: over(&|joint| joint.before_rms),
        after_rms: over(&|joint| joint.after_rms),
        worst_minute: worst.0,
        joints,
        minutes,
    })
}

impl Minute {
    fn told(&self, recording: &Recording, names: &[&str]) -> Option<MinuteErrors> {
        let mut all = Sums::default();
        self.joints.iter().for_each(|own| add(&mut all, own));
        if all[0] == 0.0 {
            return None;
        }
        let [before_rms, after_rms] = errors(&all);
        let own = self.joints.iter().map(|own| errors(own)[1]).enumerate();
        let (worst, worst_joint_rms) = own.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let gates = recording.gates.get(self.log)?;
        let start = MINUTE * self.block as f64;
        Some(MinuteErrors {
            log: gates.log.clone(),
            start,
            t: gates.start + start,
            windows: all[0],
            before_rms,
            after_rms,
            worst_joint: names[worst].to_owned(),
            worst_joint_rms,
        })
    }
}

impl EveryWindow {
    /// The minute whose error is largest.
    pub fn worst(&self) -> &MinuteErrors {
        &self.minutes[self.worst_minute]
    }

    /// Conditions for --only that judge the worst minute alone, if it stands out.
    pub(crate) fn stands_out(&self) -> Option<[String; 2]> {
        let worst = self.worst();
        let [from, to] = [worst.t, worst.t + MINUTE];
        (worst.after_rms.powi(2) > STANDS_OUT * self.after_rms.powi(2))
            .then(|| [format!("t > {from:.0}"), format!("t < {to:.0}")])
    }
}

/// One sentence.
impl fmt::Display for EveryWindow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let worst = self.worst();
        write!(f, "Every window of {:.0} s: ", self.seconds)?;
        if self.before_rms != self.after_rms {
            write!(f, "{} → ", torque(self.before_rms))?;
        }
        write!(f, "{} N m rms; ", torque(self.after_rms))?;
        if self.stands_out().is_none() {
            return write!(f, "no minute above {}", torque(worst.after_rms));
        }
        let log = worst.log.file_name().unwrap_or_default().to_string_lossy();
        write!(
            f,
            "{} in the minute from {:.0} s of {log} on, mostly at {}",
            torque(worst.after_rms),
            worst.start,
            worst.worst_joint,
        )
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::path::Path;

    use proprio_core::go2::Leg;
    use proprio_simulator::Simulation;

    use super::*;
    use crate::detect::ladder;
    use crate::estimate::robot;
    use crate::log::LogWriter;

    /// A leg as the CAD has it, with `push` N m more at its calf in the second minute.
    fn write(path: &Path, duration: f64, push: f64) {
        let legs = [Leg::FR];
        let simulation = Simulation {
            duration,
            ..Simulation::new(&legs)
        };
        let mut log = LogWriter::new(File::create(path).unwrap(), &legs).unwrap();
        for sample in simulation.samples() {
            let mut sample = sample.unwrap();
            if (60.0..120.0).contains(&sample.t) {
                sample.tau[2] += push;
            }
            log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
                .unwrap();
        }
        log.finish().unwrap();
    }

    /// Nine of ten seconds of the log are not in the part that is drawn.
    #[test]
    fn a_bad_minute_of_a_long_log_is_found_and_can_be_judged_alone() {
        let folder = tempfile::tempdir().unwrap();
        let logs = [folder.path().join("long.csv")];
        write(&logs[0], 150.0, 1.0);
        let model = Model::default();
        let recording = Recording::read(&logs, &model, |_, _| ()).unwrap();
        assert!(recording.is_drawn);
        let found = every_window(&recording, [&model; 2], false, |_, _| ()).unwrap();
        let found = found.unwrap();
        assert_eq!(found.minutes.len(), 3);
        let minutes: f64 = found.minutes.iter().map(|minute| minute.windows).sum();
        assert_eq!(minutes, found.windows);
        assert!(
            found.windows > 0.9 * 3.0 * 150.0 / 0.02,
            "{}",
            found.windows
        );
        let worst = found.worst();
        assert_eq!((worst.start, &*worst.worst_joint), (60.0, "FR_calf"));
        assert!((worst.worst_joint_rms - 1.0).abs() < 0.1, "{worst:?}");
        let only = found.stands_out().unwrap();
        assert_eq!(only, ["t > 60", "t < 120"]);
        let alone = Recording::read_only(&logs, &only, &model, |_, _| ()).unwrap();
        assert!(!alone.is_drawn);
        let samples = alone.limbs[0].1.len() as f64 * alone.limbs[0].1.period();
        assert!((61.0..63.0).contains(&samples), "{samples} s");
    }

    #[test]
    fn it_is_the_error_of_the_ladder() {
        let folder = tempfile::tempdir().unwrap();
        let logs = [folder.path().join("short.csv")];
        write(&logs[0], 20.0, 0.0);
        let model = Model::default();
        let mut recording = Recording::read(&logs, &model, |_, _| ()).unwrap();
        assert_eq!(
            every_window(&recording, [&model; 2], false, |_, _| ()).unwrap(),
            None
        );
        recording.is_drawn = true;
        let found = every_window(&recording, [&model; 2], false, |_, _| ()).unwrap();
        let found = found.unwrap();
        let data = robot::data(&recording, &model);
        let joints = ladder::of(&data[0], &model);
        for (own, joint) in joints.iter().zip(&found.joints) {
            assert_eq!(own.windows, joint.windows);
            assert!((own.errors.given_rms - joint.before_rms).abs() < 1e-9);
        }
    }
}
