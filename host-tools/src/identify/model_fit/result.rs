//! What a fit of a model says, for machines, for humans and for the model file.

use std::path::PathBuf;

use nalgebra::SVector;
use proprio_core::effect::{EffectKind, Prior};
use proprio_core::inertia::{INERTIAL, InertialParameters};
use serde::Serialize;

use crate::detect::every_window::EveryWindow;
use crate::detect::ladder::{self, JointLadder, Yardsticks};
use crate::estimate::fit::LimbFit;
use crate::estimate::robot::Shared;
use crate::estimate::stages::Stage;
use crate::estimate::{ParameterEstimate, Status};
use crate::identifiability::{BaseParameter, Identifiability, NullDirection};
use crate::identify::bodies::{Released, released};
use crate::identify::runs::{self, Consistency, Run};
use crate::identify::to_model::NotAModel;
use crate::model::{BASE, Model, Provenance};
use crate::recording::Recording;
use crate::summary::ErrorRange;

/// A model's parameters with what is known of their errors.
#[derive(Debug, Clone, Serialize)]
pub struct Fitted {
    /// Every parameter of every limb in the logs.
    pub parameters: Vec<FittedParameter>,
    /// How well each joint's torque is explained.
    pub joints: Vec<FittedJoint>,
    /// Root mean square of the fit's residuals over all joints: mean torque over a window, N m.
    pub rms: f64,
    /// What an error is to be measured against.
    #[serde(flatten)]
    pub yardsticks: Yardsticks,
    /// The same on contiguous stretches of time that the fit has not seen, N m.
    pub held_out_rms: Option<f64>,
    /// What motion can tell, and what these data say of it.
    pub base_parameters: Vec<BaseParameter>,
    /// What these data do not tell.
    pub null_directions: Vec<NullDirection>,
    /// The steps, where the fit went by steps.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<Stage>,
    /// Each log on its own, where there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub runs: Vec<Run>,
    /// Where the runs agree and where not, the worst first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub consistency: Vec<Consistency>,
    /// Of long logs, of which all the rest here is of a drawn part: the errors over every window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every_window: Option<EveryWindow>,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    /// The bodies that were released from the CAD's.
    #[serde(skip)]
    pub(in crate::identify) released: Vec<Released>,
}

/// A parameter and where it belongs in the model.
#[derive(Debug, Clone, Serialize)]
pub struct FittedParameter {
    /// Value, standard deviation (the larger of the two ways, and what values differ between stretches), prior, status.
    #[serde(flatten)]
    pub estimate: ParameterEstimate,
    /// Standard deviation if residuals were independent.
    pub std_independent: f64,
    /// By how much the value differs from stretch to stretch of the log, or from log to log, beyond chance (standard deviation); 0 if it does not.
    pub std_between: f64,
    /// Where the model holds it.
    #[serde(skip)]
    pub place: Where,
}

impl FittedParameter {
    /// What is told of parameter `n` of an effect without a column: value and standard deviation.
    pub(super) fn of_effect(
        model: &Model,
        (effect, joint, n): (EffectKind, usize, usize),
        (value, std): (f64, f64),
        prior: Prior,
    ) -> Self {
        Self {
            estimate: ParameterEstimate {
                name: crate::parameter::of_effect(effect, n, model.joint_name(joint)),
                unit: model.unit(effect, joint, n),
                value,
                std,
                prior: prior.mean,
                prior_std: prior.std,
                status: Status::of(std, prior.std),
                at_bound: false,
            }
            .unless_absent(effect, n),
            std_independent: std,
            std_between: 0.0,
            place: Where::Effect(effect, joint, n),
        }
    }
}

/// Where a model holds a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Where {
    /// Parameter of a body.
    Body(usize, usize),
    /// Parameter of an effect at a joint.
    Effect(EffectKind, usize, usize),
    /// The same, in which the torque is not linear: scanned, without a standard deviation.
    Shape(EffectKind, usize, usize),
}

/// How well a joint's torque is explained; N m, mean torque over a window. By energy: a limb's power, W.
#[derive(Debug, Clone, Serialize)]
pub struct FittedJoint {
    /// Which joint; by energy, which limb.
    pub joint: String,
    /// Windows in which it moves.
    pub windows: u64,
    /// Root mean square of the fit's residuals.
    pub rms: f64,
    /// The same on stretches of time that the fit has not seen.
    pub held_out_rms: Option<f64>,
    /// As [`Fitted::error`].
    #[serde(flatten)]
    pub error: ErrorRange,
    /// What an error is to be measured against.
    #[serde(flatten)]
    pub yardsticks: Yardsticks,
}

impl Fitted {
    pub(super) fn new(
        (recording, model): (&Recording, &Model),
        fits: &[LimbFit],
        mut parameters: Vec<FittedParameter>,
        shared: &[Shared],
        (ladder, stages): (&[JointLadder], Vec<Stage>),
    ) -> Self {
        let mut joints: Vec<FittedJoint> = Vec::new();
        let mut identifiability = Identifiability::default();
        for fit in fits {
            identifiability.extend(Identifiability::of(fit));
            let ladder = ladder.get(joints.len()..).unwrap_or_default();
            joints.extend(joint_fits(fit, ladder));
        }
        parameters.extend(shared.iter().map(|one| of_shared(model, one)));
        let rms = |of: &dyn Fn(&FittedJoint) -> f64| {
            ladder::over_all(joints.iter().map(|j| (j.windows as f64, of(j))))
        };
        let yardsticks: Vec<_> = (joints.iter())
            .map(|j| (j.windows as f64, j.yardsticks))
            .collect();
        let held_out = joints
            .iter()
            .all(|j| j.held_out_rms.is_some() || j.windows == 0);
        Self {
            rms: rms(&|j| j.rms),
            yardsticks: Yardsticks::over_all(&yardsticks),
            held_out_rms: held_out.then(|| rms(&|j| j.held_out_rms.unwrap_or(0.0))),
            parameters,
            joints,
            base_parameters: identifiability.base_parameters,
            null_directions: identifiability.null_directions,
            stages,
            runs: Vec::new(),
            consistency: Vec::new(),
            logs: recording.logs.clone(),
            every_window: None,
            warnings: recording.warnings.clone(),
            released: released(fits),
        }
    }

    /// Takes in what each log gives on its own, of which `fits` are the fits: where they disagree beyond chance.
    pub(in crate::identify) fn compare_runs(&mut self, mut runs: Vec<Run>, fits: &[Self]) {
        let estimates: Vec<_> = fits.iter().map(Self::estimates).collect();
        self.consistency = runs::compare(&estimates);
        for disagreement in self.consistency.iter().filter(|c| !c.consistent) {
            runs[disagreement.differs].disagreements += 1;
        }
        self.runs = runs;
    }

    /// Every estimate with by how much its value differs within the logs (standard deviation).
    pub(in crate::identify) fn estimates(&self) -> Vec<(&ParameterEstimate, f64)> {
        let all = self.parameters.iter();
        all.map(|p| (&p.estimate, p.std_between)).collect()
    }

    /// The error of the file as it is given, and that of the fit on time it has not seen.
    pub fn error(&self) -> ErrorRange {
        self.yardsticks.error(self.held_out_rms)
    }

    /// The estimate of the parameter of that name, such as `coulomb:FR_hip`.
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        let mut all = self.parameters.iter().map(|p| &p.estimate);
        all.find(|estimate| estimate.name == name)
    }

    /// `model` with these values and `provenance`, each torque once.
    ///
    /// # Errors
    /// [`NotAModel`] if a value is unphysical, as those of a fit without constraints may be.
    pub fn to_model(&self, model: &Model, provenance: Provenance) -> Result<Model, NotAModel> {
        let mut to = self.filled(model)?;
        to.set_provenance(provenance);
        Ok(to)
    }

    /// `model` with these values, each torque once.
    pub(crate) fn filled(&self, model: &Model) -> Result<Model, NotAModel> {
        let mut to = model.clone();
        to.take_out_repeated();
        let mut bodies = vec![[None; INERTIAL]; model.robot().bodies().len()];
        for FittedParameter {
            estimate, place, ..
        } in &self.parameters
        {
            let fault = |joint: usize| {
                let of = model.joint_name(joint).to_owned();
                move |fault| NotAModel { of, fault }
            };
            match *place {
                Where::Body(body, n) => bodies[body][n] = Some((estimate.value, estimate.std)),
                Where::Effect(effect, joint, n) => to
                    .set_parameter(effect, joint, n, estimate.value, Some(estimate.std))
                    .map_err(fault(joint))?,
                Where::Shape(effect, joint, n) => {
                    to.set_parameter(effect, joint, n, estimate.value, None)
                        .map_err(fault(joint))?;
                }
            }
        }
        for (body, numbers) in bodies.iter().enumerate() {
            if numbers.iter().all(Option::is_some) {
                let (value, std) = (
                    numbers.map(|n| n.map_or(0.0, |(value, _)| value)),
                    numbers.map(|n| n.map_or(0.0, |(_, std)| std)),
                );
                to.set_body(body, &InertialParameters(SVector::from(value)), Some(&std))
                    .map_err(|fault| NotAModel {
                        of: model.joint_name(body).to_owned(),
                        fault,
                    })?;
            }
        }
        Ok(to)
    }
}

/// How well a limb's joints are explained; by energy, the limb. Without a `ladder` the errors are of another equation, under the CAD alone.
fn joint_fits(fit: &LimbFit, ladder: &[JointLadder]) -> Vec<FittedJoint> {
    let (own, held_out) = (fit.squares(), fit.held_out_squares());
    let cad = ladder.is_empty().then(|| fit.cad_squares());
    let names = match own.len() == fit.data.joints() {
        true => fit.data.joint_names(),
        false => vec![fit.data.limb.name.clone()],
    };
    let of = |(g, joint): (usize, String)| {
        let windows = fit.all[g].count();
        let rms = |square: f64| (square / windows.max(1.0)).sqrt();
        let yardsticks = match &cad {
            None => ladder[g].errors,
            Some(cad) => Yardsticks::of_other_equation(rms(cad[g])),
        };
        let held_out_rms = (held_out.as_ref())
            .filter(|_| windows > 0.0)
            .map(|squares| rms(squares[g]));
        FittedJoint {
            joint,
            windows: windows as u64,
            rms: rms(own[g]),
            held_out_rms,
            error: yardsticks.error(held_out_rms),
            yardsticks,
        }
    };
    names.into_iter().enumerate().map(of).collect()
}

/// A value that all limbs share.
fn of_shared(model: &Model, one: &Shared) -> FittedParameter {
    let known = model.robot().parameter_prior(one.effect, 0, one.parameter);
    FittedParameter::of_effect(
        model,
        (one.effect, BASE, one.parameter),
        (one.value, one.std),
        known,
    )
}
