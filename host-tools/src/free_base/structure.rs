//! What a model of a walking robot has: its effects, and its bodies with how well they are known.

use std::sync::Arc;

use proprio_core::effect::{EffectKind, Form};
use proprio_core::inertia::InertialParameters;

use super::columns::{EffectSite, WalkColumns, all_places, body_of, is_judged};
use super::error::FreeBaseError;
use super::legged::Legged;
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
    pub(crate) robot: Arc<Legged>,
    /// The base first, then each joint's body.
    pub(crate) bodies: Vec<BodyPrior>,
    /// Its effects.
    pub(crate) effects: Vec<EffectSite>,
    pub(crate) constraint: Constraint,
    /// Standard deviations of all bodies' mass and centre of mass together, where the model states them.
    pub(crate) total_std: Option<[f64; 4]>,
    /// Whether bodies that the data would carry farther than bodies are from the model's are held: a load that the model lacks must
    /// show in the residual.
    pub(crate) hold_bodies: bool,
}

impl ModelStructure {
    /// The CAD's bodies, the trunk with what its owner put on it, and the effects that the model names, or if it names none all four of a plain
    /// drive at every joint. The model's priors count, its values do not.
    ///
    /// # Errors
    /// [`FreeBaseError`] for a model without feet, or with an effect that walks are not judged with.
    pub(crate) fn whole(model: &Model, constraint: Constraint) -> Result<Self, FreeBaseError> {
        let robot = Legged::of(model)?;
        let body = |(b, inertia): (usize, InertialParameters<f64>)| BodyPrior {
            inertia,
            relative: match b.checked_sub(1) {
                None => LOADED_TRUNK,
                Some(joint) => model.cad_uncertainty(joint),
            },
            loaded: carries(model, b),
        };
        let cad = robot.tree.bodies().iter().map(|body| body.inertia);
        let bodies = cad.enumerate().map(body).collect();
        let plain = (0..robot.joints()).flat_map(|j| EffectKind::PLAIN.map(|effect| (effect, j)));
        let named = model.effects().iter();
        let named = named.filter(|own| own.effect.description().form != Form::Inertia);
        let places: Vec<Place> = match model.effects() {
            [] => plain.collect(),
            _ => named.map(|own| (own.effect, own.joint)).collect(),
        };
        for place in &places {
            judged(model, *place)?;
        }
        let of = |place| EffectSite::of((model, &robot), place, constraint);
        Ok(Self {
            effects: places.into_iter().map(of).collect(),
            bodies,
            robot,
            constraint,
            total_std: None,
            hold_bodies: false,
        })
    }

    /// What a model file has.
    ///
    /// # Errors
    /// [`FreeBaseError`] for a model without feet, or with an effect that walks are not judged with.
    pub(crate) fn of(model: &Model) -> Result<Self, FreeBaseError> {
        let robot = Legged::of(model)?;
        let mut bodies = known(model);
        let mut effects = Vec::new();
        for own in model.effects() {
            let place = (own.effect, own.joint);
            let is_load = own.effect.description().form == Form::Inertia;
            judged(model, place)?;
            // A load is in what its body is found to be.
            if is_load {
                bodies[body_of(own.joint)].loaded = true;
                continue;
            }
            let site = EffectSite::of((model, &robot), place, Constraint::Physical);
            effects.push(site);
        }
        Ok(Self {
            robot,
            bodies,
            effects,
            constraint: Constraint::Physical,
            total_std: model.total_std().copied(),
            hold_bodies: true,
        })
    }

    /// The same, but for a load that body `b`, counted from the base, may carry or may not.
    pub(crate) fn with_load(mut self, b: usize, loaded: bool) -> Self {
        self.bodies[b].loaded = loaded;
        self
    }

    /// The same with a load on every body, or on none.
    pub(crate) fn with_loads(&self, loaded: bool) -> Self {
        let mut all = self.clone();
        all.bodies.iter_mut().for_each(|body| body.loaded = loaded);
        all
    }

    /// All that it might lack.
    pub(crate) fn candidates(&self, model: &Model) -> Vec<EffectSite> {
        let lacking = all_places(model, &self.robot)
            .into_iter()
            .filter(|place| !self.has(*place));
        lacking
            .map(|place| EffectSite::of((model, &self.robot), place, self.constraint))
            .map(EffectSite::into_candidate)
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
                *own = own.clone().with_shapes(site.shapes);
            }
        }
        self
    }

    /// The columns of its parameters: bodies', sensors', effects'.
    pub(super) fn active(&self, columns: &WalkColumns) -> Vec<usize> {
        let effects = columns.effects();
        let own = effects.filter(|(_, n, _)| self.has(columns.sites[*n].place));
        (0..columns.fixed()).chain(own.map(|(k, ..)| k)).collect()
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
        let sensors = self.robot.sensor_std.map(|std| Bounded {
            mean: 0.0,
            std,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        });
        sensors.into_iter().chain(self.effects(columns)).collect()
    }

    /// The columns of its own effects.
    pub(crate) fn columns(&self) -> WalkColumns {
        self.columns_of(self.effects.clone())
    }

    /// Columns of these effects.
    pub(crate) fn columns_of(&self, sites: Vec<EffectSite>) -> WalkColumns {
        WalkColumns {
            robot: self.robot.clone(),
            sites,
        }
    }
}

/// Whether a model lets a body, counted from the base, carry a load.
fn carries(model: &Model, b: usize) -> bool {
    let loads = model.effects().iter();
    let mut loads = loads.filter(|own| own.effect.description().form == Form::Inertia);
    loads.any(|own| body_of(own.joint) == b)
}

/// That walks are judged with an effect.
fn judged(model: &Model, (effect, joint): Place) -> Result<(), FreeBaseError> {
    match is_judged(effect) && joint != BASE {
        true => Ok(()),
        false => Err(FreeBaseError::Effect {
            effect: effect.name(),
            place: model.joint_name(joint).to_owned(),
        }),
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
    let bodies = std::iter::once(BASE).chain(0..robot.bodies().len());
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
