//! `proprio simulate --walk`: a log of the whole robot on its feet.

use std::path::Path;
use std::sync::Arc;

use clap::ValueEnum;
use serde::Serialize;

use super::super::{Error, json};
use super::{DURATION, Report, Simulate, written};
use crate::free_base::legged::{Legged, LeggedFoot};
use crate::log::WalkWriter;
use crate::model::{BASE, Model};
use crate::output;
use crate::progress::Progress;
use proprio_core::tree::Body;
use proprio_simulator::TrueValue;
use proprio_simulator::walk::{Gait, JointFacts, Quantity, Walk, WalkFoot, WalkRobot};

/// How the robot goes; [`Gait`] on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum GaitName {
    /// Two diagonal feet at a time on the ground; of six feet three
    Trot,
    /// A trot with a flight after each step
    Flying,
    /// Off the ground with all feet at once
    Hop,
    /// All feet planted, and a trunk that moves above them
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
        let robot = match &self.model {
            Some(path) => of_model(&Model::load(path)?)?,
            None => WalkRobot::go2(),
        };
        let begin = match self.typical {
            true => robot.typical(),
            false => Vec::new(),
        };
        let joints = robot.joints();
        let effects = self.effects(begin, &joints, |hide| hide.on_walker(&joints));
        let usual = Walk::new(gait);
        let walk = Walk {
            robot: Arc::new(robot),
            ground_friction: self.ground_friction.unwrap_or(usual.ground_friction),
            duration: self.duration.unwrap_or(DURATION),
            rate: self.rate,
            effects,
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
            legs: walk
                .robot
                .feet()
                .iter()
                .map(|foot| foot.name.clone())
                .collect(),
            samples,
            duration: walk.duration,
            poses: None,
            slow: None,
            seed: walk.seed,
        })
    }
}

/// The robot of a model file: its bodies, feet and IMU.
fn of_model(model: &Model) -> Result<WalkRobot, Error> {
    let legged = Legged::of(model)?;
    let of_base = std::iter::once(BASE).chain(0..legged.joints());
    let bodies = legged.tree.bodies().iter().zip(of_base);
    let bodies = bodies.map(|(body, own)| Body {
        inertia: *model.inertia(own),
        ..*body
    });
    let facts = model.robot().bodies().iter().zip(&legged.gears);
    let facts = facts.zip(&legged.standing);
    let joints = facts.map(|((body, &gear), &standing)| JointFacts {
        name: body.name.clone(),
        limits: body.limits,
        // A description that states no effort often says 0.
        effort: if body.effort > 0.0 {
            body.effort
        } else {
            f64::INFINITY
        },
        gear,
        standing,
    });
    // Logs have one column a limb.
    let alone = |foot: &LeggedFoot| {
        let same = legged.feet.iter().filter(|other| other.limb == foot.limb);
        same.count() == 1
    };
    let feet = legged.feet.iter().filter_map(|foot| {
        let first = foot.points.first()?;
        Some(WalkFoot {
            name: legged.limbs[foot.limb].name.clone(),
            body: first.body,
            points: foot.points.iter().map(|point| point.centre).collect(),
            radius: first.radius,
            sensor: foot.sensor && alone(foot),
        })
    });
    let robot = WalkRobot::new(
        bodies.collect(),
        joints.collect(),
        feet.collect(),
        legged.imu,
    );
    Ok(robot?)
}

/// Writes the log of `walk` to `path` and counts its samples.
fn record(walk: &Walk, path: &Path) -> Result<u64, Error> {
    written(path, |out, unwritable| {
        let mut progress = Progress::new("Simulating");
        let joints: Vec<String> = walk
            .robot
            .joints()
            .iter()
            .map(ToString::to_string)
            .collect();
        let felt = |foot: &&WalkFoot| foot.sensor;
        let feet = walk.robot.feet();
        let named: Vec<&str> = (feet.iter().filter(felt))
            .map(|foot| foot.name.as_str())
            .collect();
        let mut log = WalkWriter::new(out, &joints, &named).map_err(unwritable)?;
        let mut samples = 0;
        for sample in walk.samples() {
            let sample = sample?;
            let joints = &sample.joints;
            let motion: [&[f64]; 3] = [&joints.q, &joints.dq, &joints.tau];
            let counts = feet
                .iter()
                .zip(&sample.foot)
                .filter(|(foot, _)| foot.sensor);
            let counts = counts.map(|(_, count)| *count);
            log.row(joints.t, motion, [sample.gyro, sample.acc], counts)
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
