//! `proprio simulate --frf`: a robot with elastic joints whose springs are known, excited by multisines.

use std::path::Path;

use clap::error::ErrorKind;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use proprio_core::inertia::InertialParameters;
use proprio_simulator::TrueValue;
use proprio_simulator::frf::{ElasticJoint, FrfCommand, FrfSample, FrfSimulation};
use serde::Serialize;

use super::super::{Error, json, usage_error};
use super::{Report, Simulate, suggest, written};
use crate::excite::Command;
use crate::excite::frf::{FrfPlan, USUAL_EFFORT, design};
use crate::model::{JointKind, LINK_ELASTICITY, Model};
use crate::name;
use crate::output::{self, WriteError};
use crate::progress::Progress;

/// What may be hidden.
pub(super) const HIDDEN: [&str; 5] = [
    "elasticity",
    LINK_ELASTICITY,
    "armature",
    "viscous",
    "coulomb",
];
/// Length of the slow log, s.
const SLOW: f64 = 60.0;
/// Damping of a spring for which none is said, as a share of its stiffness, s.
const DAMPING: f64 = 1e-3;

/// What the truth file holds; parameters are named as `frf` and `identify` name them.
#[derive(Debug, Serialize)]
struct Truth {
    seed: u64,
    inertia_error: f64,
    parameters: Vec<TrueValue>,
}

impl Simulate {
    /// Points, blocks and experiments, one after the other: as they are planned here, or in a file.
    pub(super) fn excite(self) -> Result<Report, Error> {
        let Some(model) = &self.model else {
            let message = "--frf needs the robot: -m MODEL".to_owned();
            usage_error("simulate", ErrorKind::MissingRequiredArgument, message)
        };
        let model = Model::load(model)?;
        let (plan, violation) = self.plan(&model)?;
        let simulation = self.excited(&model, plan.rate);
        if let Some((joint, f)) = simulation.too_fast() {
            let message = format!(
                "the spring or damper of {joint} is too stiff to simulate: its resonance is at {f:.0} Hz, and joints without `elasticity` are at 120 Hz"
            );
            usage_error("simulate", ErrorKind::ValueValidation, message);
        }
        if let Some(violation) = violation {
            return Err(Error::NotWithinLimits(violation));
        }
        let second = self.second_encoder;
        let duration = plan.commands.len() as f64 / plan.rate;
        let commands = plan.commands.into_iter().map(|(command, reference)| {
            let Command { q, dq, tau, .. } = command;
            FrfCommand {
                q,
                dq,
                tau,
                reference,
            }
        });
        let samples = write_log(
            &self.output,
            &simulation,
            [second, true],
            duration,
            |sample| simulation.play(&plan.gains, commands, sample),
        )?;
        if let Some(slow) = &self.slow {
            write_log(slow, &simulation, [second, false], SLOW, |sample| {
                simulation.record_slow(SLOW, sample)
            })?;
        }
        let truth = self.truth_path();
        if let Some(truth) = &truth {
            let all = Truth {
                seed: self.seed,
                inertia_error: self.inertia_error,
                parameters: simulation.truth(),
            };
            output::write(truth, &json(&all))?;
        }
        Ok(Report {
            log: self.output,
            truth,
            gait: Some("multisines in closed loop"),
            legs: Vec::new(),
            samples,
            duration,
            slow: self.slow,
            poses: None,
            seed: self.seed,
        })
    }

    /// What is played, and the first limit that it does not keep. A plan that is read was proved when it was made.
    fn plan(&self, model: &Model) -> Result<(FrfPlan, Option<String>), Error> {
        if let Some(path) = &self.follow {
            if self.experiments.any() || self.period.is_some() {
                let message =
                    "--follow plays a plan as it is: leave out --points, --blocks, --experiments, --periods, --period, --band, --excitation"
                        .to_owned();
                usage_error("simulate", ErrorKind::ArgumentConflict, message);
            }
            return Ok((FrfPlan::read(path, model)?, None));
        }
        let settings = self.experiments.settings(self.period, self.rate, self.seed);
        let limbs = model.robot().limbs();
        let own = design(model, &limbs, &settings)?;
        let violation = own.violations.first().cloned();
        let plan = FrfPlan {
            rate: own.rate,
            gains: own.gains.clone(),
            commands: own.commands().collect(),
        };
        Ok((plan, violation))
    }

    /// The robot of the model with what is hidden.
    fn excited(&self, model: &Model, rate: f64) -> FrfSimulation {
        let joints = model.robot().bodies().iter().enumerate().map(|(b, body)| {
            let rotation = Rotation3::from_matrix_unchecked(body.placement.rotation);
            let phi = model.inertia(b);
            let (com, inertia) = about_com(phi);
            ElasticJoint {
                name: body.name.clone(),
                parent: body.parent,
                placement: Isometry3::from_parts(
                    Translation3::from(body.placement.translation),
                    UnitQuaternion::from_rotation_matrix(&rotation),
                ),
                axis: body.axis,
                slides: body.kind == JointKind::Prismatic,
                limits: body.limits,
                effort: if body.effort.is_finite() && body.effort > 0.0 {
                    body.effort
                } else {
                    USUAL_EFFORT
                },
                mass: phi.mass(),
                com,
                inertia,
                armature: None,
                viscous: 0.0,
                coulomb: 0.0,
                spring: None,
                bends: [None; 2],
            }
        });
        let mut joints: Vec<ElasticJoint> = joints.collect();
        self.hide_in(model, &mut joints);
        FrfSimulation {
            joints,
            down: model.base().rotation.tr_mul(&-Vector3::z()),
            rate,
            inertia_error: self.inertia_error,
            noise: self.noise,
            seed: self.seed,
        }
    }

    fn hide_in(&self, model: &Model, joints: &mut [ElasticJoint]) {
        let refuse =
            |message: String| -> ! { usage_error("simulate", ErrorKind::ValueValidation, message) };
        for asked in &self.hide {
            let Hidden {
                what,
                joint,
                value,
                damping,
                axis,
            } = parse(asked).unwrap_or_else(|message| refuse(message));
            let places = match &joint {
                Some(joint) => match model.robot().joint(joint) {
                    Ok(joint) => joint..joint + 1,
                    Err(unknown) => refuse(suggest(&unknown, unknown.nearest())),
                },
                None => 0..joints.len(),
            };
            for joint in &mut joints[places] {
                match what {
                    "elasticity" => joint.spring = Some([value, damping]),
                    LINK_ELASTICITY => {
                        for (n, bend) in joint.bends.iter_mut().enumerate() {
                            if axis.is_none_or(|axis| axis == n + 1) {
                                *bend = Some([value, damping]);
                            }
                        }
                    }
                    "armature" => joint.armature = Some(value),
                    "viscous" => joint.viscous = value,
                    _ => joint.coulomb = value,
                }
            }
        }
    }
}

/// Centre of mass and inertia about it.
fn about_com(phi: &InertialParameters<f64>) -> (Vector3<f64>, nalgebra::Matrix3<f64>) {
    let mass = phi.mass().max(1e-9);
    let com = phi.first_moment() / mass;
    let square = com.dot(&com);
    let moved = mass * (nalgebra::Matrix3::identity() * square - com * com.transpose());
    (com, phi.rotational_inertia() - moved)
}

/// What is hidden at a joint, or at all.
struct Hidden {
    what: &'static str,
    joint: Option<String>,
    value: f64,
    damping: f64,
    /// Which axis across the joint's bends, 1 or 2; both if none is named.
    axis: Option<usize>,
}

/// `NAME[:JOINT]=VALUE[,damping=VALUE][,axis=1|2]`.
fn parse(text: &str) -> Result<Hidden, String> {
    let (place, values) = text.split_once('=').ok_or("expected NAME[:JOINT]=VALUE")?;
    let (name, joint) = match place.split_once(':') {
        Some((name, joint)) => (name, Some(joint.to_owned())),
        None => (place, None),
    };
    let Some(known) = HIDDEN.iter().find(|known| **known == name) else {
        let unknown = format!("with --frf, `{name}` is not one of {}", HIDDEN.join(", "));
        return Err(suggest(
            &unknown,
            name::nearest(name, HIDDEN.iter().copied()),
        ));
    };
    let number = |text: &str| match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err(format!("`{text}` is not a number of 0 or more")),
    };
    let mut parts = values.split(',');
    let value = number(parts.next().unwrap_or_default())?;
    let mut own = Hidden {
        what: known,
        joint,
        value,
        damping: DAMPING * value,
        axis: None,
    };
    let is_bend = name == LINK_ELASTICITY;
    let is_spring = name == "elasticity" || is_bend;
    for part in parts {
        match part.split_once('=') {
            Some(("damping", damping)) if is_spring => own.damping = number(damping)?,
            Some(("axis", "1")) if is_bend => own.axis = Some(1),
            Some(("axis", "2")) if is_bend => own.axis = Some(2),
            _ => return Err(format!("`{part}` is no part of `{name}`")),
        }
    }
    if value == 0.0 && (is_spring || name == "armature") {
        return Err(format!("`{name}` must be greater than 0"));
    }
    Ok(own)
}

/// Writes what `record` gives; counts the samples.
fn write_log(
    path: &Path,
    simulation: &FrfSimulation,
    [second_encoder, reference]: [bool; 2],
    seconds: f64,
    record: impl FnOnce(&mut dyn FnMut(&FrfSample) -> Result<(), WriteError>) -> Result<(), WriteError>,
) -> Result<u64, Error> {
    let mut channels = vec!["q", "dq", "tau"];
    if reference {
        channels.push("ref");
    }
    if second_encoder {
        channels.push("q_link");
    }
    written(path, |out, unwritable| {
        let mut progress = Progress::new("Simulating");
        let joints = || simulation.joints.iter().map(|joint| joint.name.as_str());
        let mut header = "t".to_owned();
        for channel in &channels {
            header.extend(joints().map(|joint| format!(",{channel}/{joint}")));
        }
        writeln!(out, "{header}").map_err(unwritable)?;
        let mut samples = 0;
        record(&mut |sample| {
            write!(out, "{:.6}", sample.t).map_err(unwritable)?;
            for channel in &channels {
                let values = match *channel {
                    "q" => &sample.q,
                    "dq" => &sample.dq,
                    "tau" => &sample.tau,
                    "ref" => &sample.reference,
                    _ => &sample.q_link,
                };
                for value in values {
                    write!(out, ",{value:.8}").map_err(unwritable)?;
                }
            }
            writeln!(out).map_err(unwritable)?;
            samples += 1;
            progress.set((sample.t * 1e3) as u64, (seconds * 1e3) as u64);
            Ok(())
        })?;
        Ok(samples)
    })
}
