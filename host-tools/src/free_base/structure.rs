//! What a model of a walking Go2 has: its effects, and its bodies with how well they are known.

use proprio_core::effect::{EffectKind, Form};
use proprio_core::estimator::CAD_UNCERTAINTY;
use proprio_core::go2::{self, JOINT_NAMES, JOINTS};
use proprio_core::inertia::InertialParameters;

use super::columns::{EffectSite, FIXED, WalkColumns, all_places, body_of, is_judged};
use super::error::FreeBaseError;
use super::sensors;
use crate::equation::values::{Place, Values};
use crate::estimate::Constraint;
use crate::estimate::bounded::Bounded;
use crate::model::{BASE, Model};

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
    /// Its effects.
    pub(crate) effects: Vec<EffectSite>,
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
            effects: (0..JOINTS)
                .flat_map(|j| EffectKind::PLAIN.map(|effect| (effect, j)))
                .map(|place| EffectSite::of(&Model::default(), place, constraint))
                .collect(),
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
        let mut bodies = known(model);
        let mut effects = Vec::new();
        for own in model.effects() {
            let place = (own.effect, own.joint);
            let is_load = own.effect.description().form == Form::Inertia;
            if !is_judged(own.effect) || own.joint == BASE {
                return Err(FreeBaseError::Effect {
                    effect: own.effect.name(),
                    place: model.joint_name(own.joint).to_owned(),
                });
            }
            // A load is in what its body is found to be.
            if is_load {
                bodies[body_of(own.joint)].loaded = true;
                continue;
            }
            effects.push(EffectSite::of(model, place, Constraint::Physical));
        }
        Ok(Self {
            bodies,
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

    /// The same with a load on every body.
    pub(crate) fn with_loads(&self) -> Self {
        let mut all = self.clone();
        all.bodies.iter_mut().for_each(|body| body.loaded = true);
        all
    }

    /// All that it might lack.
    pub(crate) fn candidates(&self, model: &Model) -> Vec<EffectSite> {
        let lacking = all_places().into_iter().filter(|place| !self.has(*place));
        lacking
            .map(|place| EffectSite::of(model, place, self.constraint).into_candidate())
            .collect()
    }

    /// Whether it has an effect at a joint.
    pub(crate) fn has(&self, place: Place) -> bool {
        self.effects.iter().any(|site| site.place == place)
    }

    /// Whether it has an effect at a joint, or lets its body carry a load.
    pub(crate) fn has_or_carries(&self, place: Place) -> bool {
        match place.0.description().form {
            Form::Inertia => self.bodies[body_of(place.1)].loaded,
            _ => self.has(place),
        }
    }

    /// The same with an effect that it does not have.
    pub(crate) fn with_effect(mut self, site: EffectSite) -> Self {
        self.effects.push(site);
        self
    }

    /// The same without an effect.
    pub(crate) fn without_effect(mut self, place: Place) -> Self {
        self.effects.retain(|site| site.place != place);
        self
    }

    /// The same with the nonlinear parameters of `sites`.
    pub(crate) fn with_shapes(mut self, sites: &[EffectSite]) -> Self {
        for own in &mut self.effects {
            if let Some(site) = sites.iter().find(|site| site.place == own.place) {
                *own = own.clone().with_shape(site.shape);
            }
        }
        self
    }

    /// The columns of its parameters: bodies', sensors', effects'.
    pub(super) fn active(&self, columns: &WalkColumns) -> Vec<usize> {
        let effects = columns.effects();
        let own = effects.filter(|(_, n, _)| self.has(columns.sites[*n].place));
        (0..FIXED).chain(own.map(|(k, ..)| k)).collect()
    }

    /// Each body and how far the data may carry it.
    pub(super) fn body_priors(&self) -> Vec<(InertialParameters<f64>, f64)> {
        let relative = |body: &BodyPrior| if body.loaded { LOADED } else { body.relative };
        let bodies = self.bodies.iter();
        bodies.map(|body| (body.inertia, relative(body))).collect()
    }

    /// Priors and bounds of its effects, in the order in which `columns` have them.
    pub(crate) fn effects(&self, columns: &WalkColumns) -> Vec<Bounded> {
        let sites = columns.sites.iter();
        let own = sites.filter_map(|site| self.effects.iter().find(|own| own.place == site.place));
        own.flat_map(|site| site.linear.iter().map(|linear| linear.prior))
            .collect()
    }

    /// The same of what sensors get wrong, and then of its effects.
    pub(super) fn others(&self, columns: &WalkColumns) -> Vec<Bounded> {
        let sensors = sensors::STD.map(|std| Bounded {
            mean: 0.0,
            std,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        });
        sensors.into_iter().chain(self.effects(columns)).collect()
    }

    /// The columns of its own effects.
    pub(crate) fn columns(&self) -> WalkColumns {
        WalkColumns {
            sites: self.effects.clone(),
        }
    }
}

/// What a model knows of the bodies, the base first, with the loads that it gives them.
fn known(model: &Model) -> Vec<BodyPrior> {
    let robot = model.robot();
    let loaded = robot.limbs().into_iter().flat_map(|limb| {
        let com = |b: usize| {
            let cad = &robot.bodies()[b].inertia;
            cad.first_moment() / cad.mass()
        };
        let coms: Vec<_> = limb.bodies.clone().map(com).collect();
        Values::given(model, &limb).loaded(&coms)
    });
    let bodies = std::iter::once(BASE).chain(0..JOINTS);
    let inertias = std::iter::once(*model.inertia(BASE)).chain(loaded);
    let of = |(body, inertia): (usize, InertialParameters<f64>)| {
        let cad = match body {
            BASE => BARE_TRUNK,
            _ => model.cad_uncertainty(body),
        };
        let mass = model.inertia(body).mass();
        let identified = model.inertia_std(body).map(|std| std[0] / mass);
        BodyPrior {
            inertia,
            relative: identified.map_or(cad, |relative| relative.min(cad).max(BEST_KNOWN)),
            loaded: false,
        }
    };
    bodies.zip(inertias).map(of).collect()
}
