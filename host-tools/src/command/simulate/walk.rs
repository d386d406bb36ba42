//! `proprio simulate --walk`: a log of the whole robot on its feet.

use std::path::Path;

use clap::ValueEnum;
use proprio_core::go2::Leg;
use serde::Serialize;

use super::super::{Error, json};
use super::{DURATION, Report, Simulate, written};
use crate::log::WalkWriter;
use crate::output;
use crate::progress::Progress;
use proprio_simulator::TrueValue;
use proprio_simulator::walk::{Gait, Quantity, Walk};

/// How the robot goes; [`Gait`] on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum GaitName {
    /// Two diagonal feet at a time on the ground
    Trot,
    /// A trot with a flight after each step
    Flying,
    /// Off the ground with all four feet at once
    Hop,
    /// Four planted feet, and a trunk that moves above them
    Sway,
}

impl From<GaitName> for Gait {
    fn from(name: GaitName) -> Self {
        match name {
            GaitName::Trot => Self::Trot,
            GaitName::Flying => Self::Flying,
            GaitName::Hop => Self::Hop,
            GaitName::Sway => Self::Sway,
        }
    }
}

/// What the truth file holds; parameters and quantities are named as `identify --free-base` names them.
#[derive(Debug, Serialize)]
struct Truth {
    seed: u64,
    inertia_error: f64,
    gait: &'static str,
    parameters: Vec<TrueValue>,
    quantities: Vec<Quantity>,
}

impl Simulate {
    /// The whole robot on its feet.
    pub(super) fn walk(self, gait: Gait) -> Result<Report, Error> {
        let usual = Walk::new(gait);
        let walk = Walk {
            ground_friction: self.ground_friction.unwrap_or(usual.ground_friction),
            duration: self.duration.unwrap_or(DURATION),
            rate: self.rate,
            effects: self.effects(),
            inertia_error: self.inertia_error,
            sensors: self.sensors(),
            seed: self.seed,
            ..usual
        };
        let truth = self.truth_path();
        let samples = record(&walk, &self.output)?;
        if let Some(truth) = &truth {
            output::write(truth, &json(&truth_of(&walk)))?;
        }
        Ok(Report {
            log: self.output,
            truth,
            gait: Some(gait.name()),
            legs: Leg::ALL.map(Leg::name).to_vec(),
            samples,
            duration: walk.duration,
            poses: None,
            slow: None,
            seed: walk.seed,
        })
    }
}

/// Writes the log of `walk` to `path` and counts its samples.
fn record(walk: &Walk, path: &Path) -> Result<u64, Error> {
    written(path, |out, unwritable| {
        let mut progress = Progress::new("Simulating");
        let mut log = WalkWriter::new(out).map_err(unwritable)?;
        let mut samples = 0;
        for sample in walk.samples() {
            let sample = sample?;
            let joints = &sample.joints;
            let motion: [&[f64]; 3] = [&joints.q, &joints.dq, &joints.tau];
            log.row(joints.t, motion, [sample.gyro, sample.acc], sample.foot)
                .map_err(unwritable)?;
            samples += 1;
            progress.set((joints.t * 1e3) as u64, (walk.duration * 1e3) as u64);
        }
        log.finish().map_err(unwritable)?;
        Ok(samples)
    })
}

fn truth_of(walk: &Walk) -> Truth {
    Truth {
        seed: walk.seed,
        inertia_error: walk.inertia_error,
        gait: walk.gait.name(),
        parameters: walk.truth(),
        quantities: walk.quantities(),
    }
}
