//! What a model of a walking Go2 has: its effects, and its bodies with how well they are known.

use proprio_core::effect::EffectKind;
use proprio_core::estimator::CAD_UNCERTAINTY;
use proprio_core::go2::{self, ACTUATORS, JOINT_NAMES, JOINTS, JOINTS_PER_LEG};
use proprio_core::inertia::{INERTIAL, InertialParameters};

use super::FreeBaseError;
use super::rows::{BODIES, EFFECTS};
use super::sensors;
use crate::estimate::Constraint;
use crate::estimate::bounded::Bounded;
use crate::model::{BASE, Model};
use crate::parameter::name_at;

/// Relative standard deviation of the CAD's trunk where it is to be identified: a trunk carries what its owner put on it.
const LOADED_TRUNK: f64 = 0.3;
/// The same where a load is to be told from the CAD's errors: Go2s are weighed with 15.0 to 16.1 kg, and half of that is the trunk.
const BARE_TRUNK: f64 = 0.05;
/// No body is known better than this: a quantum of torque more or less on all joints.
const BEST_KNOWN: f64 = 0.002;
/// Relative standard deviation of a body that may carry a load: it may weigh twice as much.
const LOADED: f64 = 1.0;

/// A body before any data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BodyPrior {
    /// About the origin of its joint, or the base's.
    pub(crate) inertia: InertialParameters<f64>,
    /// How well it is known, as [`InertialParameters::prior`] takes it.
    pub(crate) relative: f64,
    /// Whether it may carry a load that the model does not have.
    pub(crate) loaded: bool,
}

/// Which parameters are fitted, and what is known of them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ModelStructure {
    /// The base first, then each joint's body.
    pub(crate) bodies: Vec<BodyPrior>,
    /// Which of [`EFFECTS`] each joint has.
    pub(crate) effects: [[bool; EFFECTS.len()]; JOINTS],
    pub(crate) constraint: Constraint,
    /// Whether bodies that the data would carry farther than bodies are from the model's are held: a load that the model lacks must
    /// show in the residual.
    pub(crate) hold_bodies: bool,
}

impl ModelStructure {
    /// The CAD's bodies, the trunk with what its owner put on it, and all four effects at every joint.
    pub(crate) fn whole(constraint: Constraint) -> Self {
        let cad = go2::free::<f64>();
        let body = |(b, inertia)| BodyPrior {
            inertia,
            relative: if b == 0 {
                LOADED_TRUNK
            } else {
                CAD_UNCERTAINTY
            },
            loaded: false,
        };
        let bodies = cad.bodies().iter().map(|body| body.inertia);
        Self {
            bodies: bodies.enumerate().map(body).collect(),
            effects: [[true; EFFECTS.len()]; JOINTS],
            constraint,
            hold_bodies: false,
        }
    }

    /// What a model file has.
    ///
    /// # Errors
    /// [`FreeBaseError::NotAGo2`], or [`FreeBaseError::Effect`] for an effect that walks are not judged with.
    pub(crate) fn of(model: &Model) -> Result<Self, FreeBaseError> {
        let names = model.robot().bodies().iter().map(|body| &*body.name);
        if !names.eq(JOINT_NAMES) {
            return Err(FreeBaseError::NotAGo2);
        }
        let mut effects = [[false; EFFECTS.len()]; JOINTS];
        for own in model.effects() {
            let known = EFFECTS.iter().position(|e| *e == own.effect);
            match known {
                Some(e) if own.joint != BASE => effects[own.joint][e] = true,
                _ => {
                    return Err(FreeBaseError::Effect {
                        effect: own.effect.name(),
                        place: model.joint_name(own.joint).to_owned(),
                    });
                }
            }
        }
        let bodies = std::iter::once(BASE).chain(0..JOINTS);
        Ok(Self {
            bodies: bodies.map(|body| known(model, body)).collect(),
            effects,
            constraint: Constraint::Physical,
            hold_bodies: true,
        })
    }

    /// The same, but for a load that body `b`, counted from the base, may carry or may not.
    pub(crate) fn with_load(mut self, b: usize, loaded: bool) -> Self {
        self.bodies[b].loaded = loaded;
        self
    }

    /// All effects at every joint, and a load on every body: what is left then no candidate explains.
    pub(crate) fn with_everything(&self) -> Self {
        let mut all = self.clone();
        all.effects = [[true; EFFECTS.len()]; JOINTS];
        all.bodies.iter_mut().for_each(|body| body.loaded = true);
        all
    }

    /// Whether it has the effect of that name, such as `coulomb:FR_calf`.
    pub(crate) fn has(&self, name: &str) -> bool {
        let own = |(j, e): (usize, usize)| {
            self.effects[j][e] && name_at(EFFECTS[e].name(), JOINT_NAMES[j]) == name
        };
        (0..JOINTS).any(|j| (0..EFFECTS.len()).any(|e| own((j, e))))
    }

    /// The same with effect `e` at these joints, or without it.
    pub(crate) fn with_effect(mut self, e: usize, joints: &[usize], there: bool) -> Self {
        joints.iter().for_each(|j| self.effects[*j][e] = there);
        self
    }

    /// Each body and how far the data may carry it.
    pub(super) fn body_priors(&self) -> Vec<(InertialParameters<f64>, f64)> {
        let relative = |body: &BodyPrior| if body.loaded { LOADED } else { body.relative };
        let bodies = self.bodies.iter();
        bodies.map(|body| (body.inertia, relative(body))).collect()
    }

    /// Priors and bounds of the effects, joint after joint, and of what sensors get wrong. An effect that a joint does not have is
    /// zero.
    pub(crate) fn others(&self) -> Vec<Bounded> {
        let effects = (0..JOINTS).flat_map(|j| (0..EFFECTS.len()).map(move |e| (j, e)));
        let effects = effects.map(|(j, e)| match self.effects[j][e] {
            true => self.effect(j, EFFECTS[e]),
            false => Bounded {
                mean: 0.0,
                std: 1.0,
                lower: 0.0,
                upper: 0.0,
            },
        });
        let sensors = sensors::STD.map(|std| Bounded {
            mean: 0.0,
            std,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        });
        effects.chain(sensors).collect()
    }

    fn effect(&self, joint: usize, effect: EffectKind) -> Bounded {
        let prior = effect.prior_of(&ACTUATORS[joint % JOINTS_PER_LEG], 0);
        let described = &effect.description().parameters[0];
        let [lower, upper] = match self.constraint {
            Constraint::Free => [f64::NEG_INFINITY, f64::INFINITY],
            Constraint::Physical => [described.lower, described.upper],
        };
        Bounded {
            mean: prior.mean,
            std: prior.std,
            lower,
            upper,
        }
    }
}

/// The column of effect `e` at a joint.
pub(crate) fn effect_column(joint: usize, e: usize) -> usize {
    INERTIAL * BODIES + EFFECTS.len() * joint + e
}

/// What a model knows of a body.
fn known(model: &Model, body: usize) -> BodyPrior {
    let cad = match body {
        BASE => BARE_TRUNK,
        _ => model.cad_uncertainty(body),
    };
    let inertia = *model.inertia(body);
    let identified = model.inertia_std(body).map(|std| std[0] / inertia.0[0]);
    BodyPrior {
        inertia,
        relative: identified.map_or(cad, |relative| relative.min(cad).max(BEST_KNOWN)),
        loaded: false,
    }
}
