//! `proprio simulate --poses`: what a tracker measures of an arm whose kinematics is known to be wrong.

use std::path::Path;

use clap::error::ErrorKind;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use proprio_simulator::TrueValue;
use proprio_simulator::poses::{PoseHidden, PoseJoint, PoseKind, PoseSimulation, SimulatedPose};
use serde::Serialize;

use super::super::{Error, json, usage_error};
use super::{Report, Simulate, suggest, written};
use crate::kinematics::joint_positions;
use crate::model::{JointKind, Model};
use crate::name;
use crate::output;

/// Noise of a laser tracker's coordinate, m.
const NOISE: f64 = 0.03e-3;
/// What a target is called.
const TARGET: &str = "target";

/// What the truth file holds; parameters are named as `calibrate` names them.
#[derive(Debug, Serialize)]
struct Truth {
    seed: u64,
    parameters: Vec<TrueValue>,
    /// Where the target truly was at each pose, m.
    places: Vec<[f64; 3]>,
}

impl Simulate {
    /// An arm at rest, pose after pose.
    pub(super) fn measure(self, count: usize) -> Result<Report, Error> {
        let Some(model) = &self.model else {
            let message = "--poses needs the robot: -m MODEL".to_owned();
            usage_error("simulate", ErrorKind::MissingRequiredArgument, message)
        };
        let model = Model::load(model)?;
        let (mut simulation, moving) = self.simulation(&model, count);
        if let Some(path) = &self.follow {
            let positions = joint_positions(path, &model)?;
            simulation.at = (positions.iter())
                .map(|q| moving.iter().map(|&joint| q[joint]).collect())
                .collect();
        }
        let (poses, parameters) = simulation.run();
        let truth = self.truth_path();
        write_poses(&self.output, &simulation, &poses)?;
        if let Some(truth) = &truth {
            let places = poses.iter().map(|pose| pose.truth.into()).collect();
            let all = Truth {
                seed: self.seed,
                parameters,
                places,
            };
            output::write(truth, &json(&all))?;
        }
        Ok(Report {
            log: self.output,
            truth,
            gait: None,
            legs: Vec::new(),
            samples: poses.len() as u64,
            duration: 0.0,
            poses: Some(poses.len()),
            slow: None,
            seed: self.seed,
        })
    }

    /// The arm from the base to its last joint, and which of the robot's joints are its.
    fn simulation(&self, model: &Model, count: usize) -> (PoseSimulation, Vec<usize>) {
        let bodies = model.robot().bodies();
        let depth = |b: &usize| std::iter::successors(Some(*b), |&b| bodies[b].parent).count();
        let tip = (0..bodies.len()).rev().max_by_key(depth).unwrap_or(0);
        let mut moving: Vec<usize> =
            std::iter::successors(Some(tip), |&b| bodies[b].parent).collect();
        moving.reverse();
        let joints = moving.iter().enumerate().map(|(n, &b)| {
            let body = &bodies[b];
            let rotation = Rotation3::from_matrix_unchecked(body.placement.rotation);
            let phi = model.inertia(b).0;
            PoseJoint {
                name: body.name.clone(),
                parent: n.checked_sub(1),
                placement: Isometry3::from_parts(
                    Translation3::from(body.placement.translation),
                    UnitQuaternion::from_rotation_matrix(&rotation),
                ),
                axis: body.axis,
                slides: body.kind == JointKind::Prismatic,
                limits: body.limits,
                mass: phi[0],
                com: Vector3::new(phi[1], phi[2], phi[3]) / phi[0].max(1e-9),
            }
        });
        let simulation = PoseSimulation {
            tip: moving.len() - 1,
            joints: joints.collect(),
            down: model.base().rotation.tr_mul(&-Vector3::z()),
            poses: count,
            at: Vec::new(),
            geometry: [self.geometry_error[0] * 1e-3, self.geometry_error[1] * 1e-3],
            hidden: self.pose_hidden(model),
            noise: [
                Some(NOISE * self.noise),
                self.orientation_noise.map(|mrad| 1e-3 * mrad),
            ],
            seed: self.seed,
        };
        (simulation, moving)
    }

    fn pose_hidden(&self, model: &Model) -> Vec<PoseHidden> {
        let refuse =
            |message: String| -> ! { usage_error("simulate", ErrorKind::ValueValidation, message) };
        let of = |text: &String| {
            let hidden = parse(text).unwrap_or_else(|message| refuse(message));
            if let Some(joint) = &hidden.joint
                && let Err(unknown) = model.robot().joint(joint)
            {
                refuse(suggest(&unknown, unknown.nearest()));
            }
            hidden
        };
        self.hide.iter().map(of).collect()
    }
}

/// `NAME[:JOINT]=VALUE`.
fn parse(text: &str) -> Result<PoseHidden, String> {
    let (place, value) = text.split_once('=').ok_or("expected NAME[:JOINT]=VALUE")?;
    let (name, joint) = match place.split_once(':') {
        Some((name, joint)) => (name, Some(joint.to_owned())),
        None => (place, None),
    };
    let kinds = || PoseKind::ALL.iter().map(|(name, _)| *name);
    let kind = PoseKind::ALL.iter().find(|(known, _)| *known == name);
    let Some((_, kind)) = kind else {
        let known: Vec<&str> = kinds().collect();
        let unknown = format!("with --poses, `{name}` is not one of {}", known.join(", "));
        return Err(suggest(&unknown, name::nearest(name, kinds())));
    };
    let value: f64 = value
        .parse()
        .map_err(|_| format!("`{value}` is not a number"))?;
    if !value.is_finite() {
        return Err(format!("`{value}` is not a finite number"));
    }
    Ok(PoseHidden {
        kind: *kind,
        joint,
        value,
    })
}

fn write_poses(
    path: &Path,
    simulation: &PoseSimulation,
    poses: &[SimulatedPose],
) -> Result<(), Error> {
    let oriented = poses.iter().any(|pose| pose.orientation.is_some());
    let has_sides = simulation
        .hidden
        .iter()
        .any(|h| h.kind == PoseKind::Backlash);
    written(path, |out, unwritable| {
        let mut header: Vec<String> = simulation
            .joints
            .iter()
            .map(|joint| format!("q/{}", joint.name))
            .collect();
        if has_sides {
            header.extend(
                simulation
                    .joints
                    .iter()
                    .map(|joint| format!("side/{}", joint.name)),
            );
        }
        header.extend(["x", "y", "z"].map(|axis| format!("{axis}/{TARGET}")));
        if oriented {
            header.extend(["qw", "qx", "qy", "qz"].map(|part| format!("{part}/{TARGET}")));
        }
        writeln!(out, "{}", header.join(",")).map_err(unwritable)?;
        for pose in poses {
            let mut cells: Vec<f64> = pose.q.clone();
            if has_sides {
                cells.extend(&pose.side);
            }
            cells.extend(pose.place.iter());
            if let Some(turned) = pose.orientation {
                cells.extend([turned.w, turned.i, turned.j, turned.k]);
            }
            let cells: Vec<String> = cells.iter().map(|x| format!("{x:?}")).collect();
            writeln!(out, "{}", cells.join(",")).map_err(unwritable)?;
        }
        Ok(())
    })
}
