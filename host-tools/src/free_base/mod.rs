//! Trunk and legs of a robot that walks, from encoders, motor torques, gyro and accelerometer alone: what `identify --free-base`,
//! `diagnose --free-base` and `compare --free-base` share.
//!
//! 1. `walk`: the log, what gravity's length tells of the accelerometer. `gravity`: its direction. `speed`: joint velocities from the quieter of
//!    two channels, a quieter gyro. `rest`: joints that friction may hold.
//! 2. `stance`: which feet may carry a force; those are projected out.
//!    `held`: whether something beyond them carries the robot.
//! 3. `columns`: which column is what. `rows`: the core's windows ([`proprio_core::window::FreeBaseWindow`]), row by row.
//!    `projection`: columns of any effect's torque in them.
//!    `sensors`: what these get wrong, in columns of their own. `residual`: what windows leave at known parameters, which these are differences of.
//! 4. `data`: the rows as one factor per block of time.
//!    `outside`: windows that no model of the catalogue explains. `unseen`: those of a foot that is taken to be in the air and is not.
//! 5. `structure`: which effects a model has, and how well its bodies are known. `fit`: its 13 bodies, their joints' effects and what
//!    sensors get wrong. `expected`: what a motion would tell before it is played.

pub(crate) mod columns;
pub(crate) mod data;
pub(crate) mod expected;
pub(crate) mod fit;
mod gravity;
mod held;
mod outside;
pub(crate) mod projection;
mod residual;
mod rest;
pub(crate) mod rows;
pub(crate) mod sensors;
mod speed;
mod stance;
pub(crate) mod structure;
mod unseen;
pub(crate) mod walk;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use proprio_core::go2::{self, JOINTS};
use proprio_core::spatial::Transform;

use crate::log::{Log, LogError, Samples};
use rest::Rest;
pub use rows::Windows;
use stance::Stance;
pub use stance::{FootEpisode, Reason, StanceShares};
pub use unseen::UnseenFoot;
use walk::Walk;

/// Why no parameters come out of a walk.
#[derive(Debug, thiserror::Error)]
pub enum FreeBaseError {
    /// A log is bad.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log lacks what a moving base needs.
    #[error("{}: a free base needs {what}, and the log does not have it", .path.display())]
    Missing {
        /// The log.
        path: PathBuf,
        /// What it lacks.
        what: &'static str,
    },
    /// Nothing is left between gaps, touch-downs and faults.
    #[error(
        "no window is left: {} were cut by touch-downs and lift-offs, {} lost to impacts, {} to gaps, {} left out because the robot \
         stands still; {} samples cannot be true",
        .0.cut, .0.impact, .0.gap, .0.still, .0.rejected
    )]
    NoWindows(Box<Windows>),
    /// Walks are of a Go2.
    #[error("--free-base knows a Go2 alone, and the model is another robot's")]
    NotAGo2,
    /// An effect that walks are not judged with.
    #[error(
        "a walk does not tell {effect} at {place}: it would need the transmitted torque, which contact forces leave open, or another sensor; \
         `proprio remove {effect}:{place}` takes it out"
    )]
    Effect {
        /// Which.
        effect: &'static str,
        /// Its joint, or the base.
        place: String,
    },
    /// A log too short to be told apart from itself.
    #[error("too short to hold a part of the time out: walk for ten seconds at least")]
    TooShort,
    /// The linear algebra refused; the data passed every check before it.
    #[error("the parameters cannot be solved for: the logs' numbers overflow")]
    Unsolvable,
}

/// Logs of a robot that walks, and which of its feet may carry a force.
pub(crate) struct Walks {
    pub(crate) walks: Vec<(Walk, Stance)>,
    /// What a user should know about the logs.
    pub(crate) warnings: Vec<String>,
}

impl Walks {
    /// Reads logs. `progress` hears of logs read, and of how many in all.
    pub(crate) fn read(
        logs: &[PathBuf],
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Self, FreeBaseError> {
        let (mut walks, mut warnings) = (Vec::new(), Vec::new());
        for (n, path) in logs.iter().enumerate() {
            let (mut walk, told) = Walk::read(path)?;
            warnings.extend(told);
            walk.down = gravity::down(&walk);
            speed::quieten(&mut walk);
            walk.rest = Rest::of(&walk.dq, walk.period);
            let stance = Stance::of(&walk, &imu());
            speed::quieten_turning(&mut walk, &stance.strikes);
            walks.push((walk, stance));
            progress(n as u64 + 1, logs.len() as u64);
        }
        for (walk, stance) in &walks {
            warnings.extend(doubts(walk, stance));
        }
        Ok(Self { walks, warnings })
    }

    /// What became of the samples; one sample is all of the robot's.
    pub(crate) fn samples(&self) -> Samples {
        let samples = self.walks.iter().map(|(walk, _)| &walk.samples);
        samples.fold(Samples::default(), |sum, one| sum.plus(one))
    }

    /// Root mean square of each joint's torque, N m.
    pub(crate) fn torque_rms(&self) -> [f64; JOINTS] {
        let samples = || self.walks.iter().flat_map(|(walk, _)| &walk.tau);
        let count = samples().count().max(1) as f64;
        std::array::from_fn(|j| (samples().map(|tau| tau[j] * tau[j]).sum::<f64>() / count).sqrt())
    }

    /// What is said of each foot when, log after log, as [`Walks::starts`] puts them.
    pub(crate) fn episodes(&self) -> Vec<FootEpisode> {
        let later = |(own, start): (&(Walk, Stance), f64)| {
            let at = move |episode: &FootEpisode| FootEpisode {
                time: episode.time.map(|t| t + start),
                ..*episode
            };
            own.1.episodes.iter().map(at).collect::<Vec<_>>()
        };
        self.walks
            .iter()
            .zip(self.starts())
            .flat_map(later)
            .collect()
    }

    /// When each log begins if they are put one after the other, a second apart, s.
    pub(crate) fn starts(&self) -> Vec<f64> {
        let mut next = 0.0;
        let start = |(walk, _): &(Walk, Stance)| {
            let start = next;
            next += walk.duration() + 1.0;
            start
        };
        self.walks.iter().map(start).collect()
    }

    /// Why feet were projected out, log by log.
    pub(crate) fn stance(&self) -> Vec<StanceShares> {
        self.walks.iter().map(|(_, stance)| stance.shares).collect()
    }
}

/// Whether a Go2's log has `gyro/` and `acc/` columns, which a moving base needs; no of one that cannot be read.
pub fn has_imu(log: &Path) -> bool {
    Log::read(log).is_ok_and(|log| log.imu.gyro.is_some() && log.imu.acc.is_some())
}

/// The IMU in the base.
fn imu() -> Transform<f64> {
    Transform::from_translation(Vector3::from(go2::IMU))
}

/// The rate below which a sampled step of a gait is not what happened in between, Hz.
const LEAST_RATE: f64 = 250.0;

/// Why what follows may be worth less than its errors say.
fn doubts(walk: &Walk, stance: &Stance) -> Vec<String> {
    let (mut told, path) = (Vec::new(), walk.path.display());
    let rate = 1.0 / walk.period.max(1e-6);
    if rate < LEAST_RATE {
        told.push(format!(
            "{path}: {rate:.0} samples a second: between two of them a foot takes up the robot's weight, and the accelerometer \
             shows what was at one instant; what follows is worth less than its errors say"
        ));
    }
    if !walk.imu {
        told.push(format!(
            "{path}: no gyro/ and acc/ columns: legs in swing alone are judged, as if the trunk were level and not accelerated; neither the trunk nor \
             the total mass follows, and what the trunk does is taken for noise"
        ));
        return told;
    }
    let held = stance.held.iter().filter(|held| **held).count() as f64 / walk.len().max(1) as f64;
    if held > 0.0 {
        told.push(format!(
            "{path}: for {:.0} % of the time something beyond its feet carries the robot (a hand, a rope, a stand), with forces that nothing \
             tells: the trunk's equations are left out there, which leaves legs in the air; neither the trunk nor the total mass follows from them",
            100.0 * held
        ));
    }
    let air: f64 = stance.shares.air.iter().sum();
    if air == 0.0 {
        told.push(format!(
            "{path}: no foot is ever surely in the air: six equations of eighteen are left, and the legs' bodies are hardly told"
        ));
    }
    told
}

#[cfg(test)]
mod tests;
