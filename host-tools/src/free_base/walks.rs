//! Logs of walks as they are read: gravity's direction, velocities with less noise, joints at rest, and which feet may carry a force; and what a user
//! should know about them.

use std::path::PathBuf;
use std::sync::Arc;

use super::error::FreeBaseError;
use super::gravity;
use super::imu;
use super::legged::Legged;
use super::speed;
use super::stance::{FootEpisode, Stance, StanceShares};
use super::stiction::Rest;
use super::walk::Walk;
use crate::log::Samples;
use crate::model::Model;

/// Logs of a robot that walks, and which of its feet may carry a force.
pub(crate) struct Walks {
    pub(crate) robot: Arc<Legged>,
    pub(crate) walks: Vec<(Walk, Stance)>,
    /// What a user should know about the logs.
    pub(crate) warnings: Vec<String>,
}

impl Walks {
    /// The largest sampling period of the logs, s.
    pub(crate) fn period(&self) -> f64 {
        let periods = self.walks.iter().map(|(walk, _)| walk.period);
        periods.fold(0.0, f64::max)
    }

    /// Reads logs. `progress` hears of logs read, and of how many in all.
    pub(crate) fn read(
        logs: &[PathBuf],
        (model, robot): (&Model, &Arc<Legged>),
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Self, FreeBaseError> {
        let (mut walks, mut warnings) = (Vec::new(), robot.notes.clone());
        for (n, path) in logs.iter().enumerate() {
            let (mut walk, told) = Walk::read(path, (model.robot(), robot))?;
            warnings.extend(told);
            imu::judge(&walk, robot)?;
            walk.down = gravity::down(&walk);
            speed::quieten(&mut walk);
            walk.rest = Arc::new(Rest::of(&walk.dq, walk.period));
            let stance = Stance::of(&walk, robot);
            speed::quieten_turning(&mut walk, &stance.strikes);
            walks.push((walk, stance));
            progress(n as u64 + 1, logs.len() as u64);
        }
        for (walk, stance) in &walks {
            warnings.extend(doubts(walk, stance));
        }
        Ok(Self {
            robot: robot.clone(),
            walks,
            warnings,
        })
    }

    /// What became of the samples; one sample is all of the robot's.
    pub(crate) fn samples(&self) -> Samples {
        let samples = self.walks.iter().map(|(walk, _)| &walk.samples);
        samples.fold(Samples::default(), |sum, one| sum.plus(one))
    }

    /// Whether an IMU says in all logs how the trunk moves.
    pub(crate) fn know_the_trunk(&self) -> bool {
        self.walks.iter().all(|(walk, _)| walk.imu)
    }

    /// Root mean square of each joint's torque, N m.
    pub(crate) fn torque_rms(&self) -> Vec<f64> {
        let samples = || self.walks.iter().flat_map(|(walk, _)| walk.tau.iter());
        let count = samples().count().max(1) as f64;
        let of = |j: usize| (samples().map(|tau| tau[j] * tau[j]).sum::<f64>() / count).sqrt();
        (0..self.robot.joints()).map(of).collect()
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
        let shares = self.walks.iter().map(|(_, stance)| &stance.shares);
        shares.cloned().collect()
    }
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
    if stance.overturned {
        told.push(format!(
            "{path}: by their torques the legs pull at the ground, which no foot can: the IMU is mounted upside down (state its rpy under [imu] in the \
             model file), or the torques have the other sign; neither the trunk nor the total mass follows"
        ));
    } else if held > 0.0 {
        told.push(format!(
            "{path}: for {:.0} % of the time something beyond its feet carries the robot (a hand, a rope, a stand), with forces that nothing \
             tells: the trunk's equations are left out there, which leaves legs in the air; neither the trunk nor the total mass follows from them",
            100.0 * held
        ));
    }
    let air: f64 = stance.shares.air.iter().sum();
    if air == 0.0 {
        told.push(format!(
            "{path}: no foot is ever in swing: few equations remain, and the legs' bodies are hardly identified"
        ));
    }
    told
}
