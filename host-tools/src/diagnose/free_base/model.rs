//! A model of a walking robot fitted to walks, as a search compares it with others.

use std::sync::{Arc, OnceLock, Weak};

use nalgebra::DVector;
use proprio_core::effect::Form;
use proprio_core::inertia::INERTIAL;

use super::{centre, is_load};
use crate::equation::values::Place;
use crate::estimate::Constraint;
use crate::free_base::Walks;
use crate::free_base::columns::{EffectSite, body_of};
use crate::free_base::data::Data;
use crate::free_base::fit::{Deviations, Fit, HeldOut};
use crate::free_base::shapes;
use crate::free_base::structure::ModelStructure;
use crate::model::Model;
use crate::select::candidate::{Candidate, Member};
use crate::select::criteria::step;
use crate::select::fitted::Fitted;

/// A value and its standard deviation.
pub(super) type Value = (f64, f64);

/// See the module.
#[derive(Clone)]
pub(super) struct WalkModel {
    pub(super) structure: ModelStructure,
    /// The rows, with its nonlinear parameters.
    pub(super) data: Arc<Data>,
    pub(super) fit: Arc<Fit>,
    /// Each part of the time by the fit to the others.
    held_out: Arc<Vec<HeldOut>>,
    deviations: Arc<OnceLock<Deviations>>,
}

impl WalkModel {
    /// The fit of a structure; none if numbers overflow.
    pub(super) fn of(data: &Arc<Data>, structure: &ModelStructure) -> Option<Self> {
        let (fit, held_out) = (data.fit(structure)?, data.held_out(structure)?);
        Some(Self::made(data.clone(), structure.clone(), fit, held_out))
    }

    fn made(data: Arc<Data>, structure: ModelStructure, fit: Fit, held_out: Vec<HeldOut>) -> Self {
        Self {
            structure,
            data,
            fit: Arc::new(fit),
            held_out: Arc::new(held_out),
            deviations: Arc::default(),
        }
    }

    /// Another one, fitted from this one; none if numbers overflow.
    pub(super) fn refitted(&self, data: Arc<Data>, structure: ModelStructure) -> Option<Self> {
        let fit = data.fit_from(&structure, &self.fit)?;
        let held_out = data.held_out_from(&structure, &self.held_out)?;
        Some(Self::made(data, structure, fit, held_out))
    }

    /// The same with nonlinear parameters that explain more of what it leaves; none if they do already, or numbers overflow.
    pub(super) fn with_better_shapes(&self, walks: &Walks) -> Option<Self> {
        let sites = shapes::better(walks, &self.data, &self.fit)?;
        let structure = self.structure.clone().with_shapes(&sites);
        let data = self.data.with_sites(walks, sites).ok()?;
        self.refitted(Arc::new(data), structure)
    }

    /// The same with a formula that neither it nor the rows have, its nonlinear parameter near this one; none if numbers overflow.
    pub(super) fn with_formula(
        &self,
        (walks, model): (&Walks, &Model),
        place: Place,
        shape: Option<f64>,
    ) -> Option<Self> {
        let site = EffectSite::of((model, &walks.robot), place, Constraint::Physical);
        let site = match shape {
            Some(shape) => site.with_shape(shape),
            None => site,
        };
        let mut sites = self.data.columns().sites.clone();
        sites.retain(|own| own.place != place);
        sites.push(site.clone());
        let data = Arc::new(self.data.with_sites(walks, sites).ok()?);
        let after = Self::of(&data, &self.structure.clone().with_effect(site))?;
        after.with_better_shapes(walks).or(Some(after))
    }

    /// Its effects with these among them, as likely as `model` says.
    pub(super) fn structure_with(&self, model: &Model, members: &[Member]) -> ModelStructure {
        let mut structure = self.structure.clone();
        for &(_, place) in members {
            structure = match place.0.description().form {
                Form::Inertia => structure.with_load(body_of(place.1), true),
                _ => {
                    let robot = structure.robot.clone();
                    let site = EffectSite::of((model, &robot), place, Constraint::Physical);
                    let shape = self.data.columns().site(place).map(|site| site.shape);
                    structure.with_effect(site.with_shape(shape.unwrap_or(1.0)))
                }
            };
        }
        structure
    }

    /// Its effects without one.
    pub(super) fn structure_without(&self, place: Place) -> ModelStructure {
        let structure = self.structure.clone();
        match place.0.description().form {
            Form::Inertia => structure.with_load(body_of(place.1), false),
            _ => structure.without_effect(place),
        }
    }

    pub(super) fn squares(&self) -> f64 {
        squares(&self.held_out)
    }

    /// By how much less it leaves of each part of the time than another one, N² m².
    pub(super) fn gains(&self, before: &Self) -> Vec<f64> {
        let parts = before.held_out.iter().zip(&*self.held_out);
        parts.map(|(a, b)| a.squares - b.squares).collect()
    }

    fn deviations(&self) -> &Deviations {
        self.deviations
            .get_or_init(|| self.data.deviations(&self.fit))
    }

    fn std(&self, k: usize) -> f64 {
        let both = self.deviations().of_parameter(k);
        both.into_iter().fold(0.0, f64::max)
    }

    /// What a body has more than the model's of a combination of its parameters.
    fn more(&self, body: usize, entries: &[(usize, f64)]) -> Value {
        let (theta, model) = (self.fit.theta(), &self.structure.bodies[body]);
        let first = INERTIAL * body;
        // The model's body is not known better than it says, without its load.
        let bare = self.structure.clone().with_load(body, false);
        let problem = self.data.problem(&bare, self.fit.noise);
        let prior = problem.prior_root(&problem.start());
        let combination = |len: usize| {
            let mut all = DVector::zeros(len);
            entries.iter().for_each(|(k, x)| all[first + k] = *x);
            all
        };
        // Bodies come first in what the structure has.
        let own = prior.tr_mul(&combination(prior.nrows())).norm();
        let std = self.deviations().of_combination(&combination(theta.len()));
        let more = |k: usize| theta[first + k] - model.inertia.0[k];
        let value = entries.iter().map(|(k, x)| x * more(*k)).sum();
        (value, std.hypot(own))
    }

    /// Mass and place, from its body's origin, of a load: what the body is more than the model's, and where.
    pub(super) fn load(&self, joint: usize) -> Vec<Value> {
        let body = body_of(joint);
        let (mass, std) = self.more(body, &[(0, 1.0)]);
        let place = (1..4).map(|axis| {
            let at = self.more(body, &[(axis, 1.0)]).0 / mass;
            let (_, std) = self.more(body, &[(0, -at / mass), (axis, 1.0 / mass)]);
            (at, std)
        });
        std::iter::once((mass, std)).chain(place).collect()
    }
}

fn squares(parts: &[HeldOut]) -> f64 {
    parts.iter().map(|part| part.squares).sum()
}

impl Fitted for WalkModel {
    type Fit = Fit;
    /// Of each part of the time.
    type Errors = Arc<Vec<HeldOut>>;

    fn errors(&self) -> &Arc<Vec<HeldOut>> {
        &self.held_out
    }

    fn total(errors: &Arc<Vec<HeldOut>>) -> f64 {
        squares(errors)
    }

    fn held_out(&self, noise: &Self) -> step::HeldOut {
        step::HeldOut {
            weighted: self.squares() / (noise.fit.noise * noise.fit.noise),
            by_log: vec![self.squares()],
            is_by_log: false,
        }
    }

    /// Trunk and legs are one.
    fn fits_of(&self, _: &Candidate) -> Vec<Weak<Fit>> {
        vec![Arc::downgrade(&self.fit)]
    }

    fn has(&self, &(_, place): &Member) -> bool {
        self.structure.has_or_carries(place)
    }

    /// Of a load its mass and its first moment about its body's centre of mass.
    fn parameters(&self, &(_, place): &Member) -> Vec<Value> {
        let (effect, joint) = place;
        if is_load(effect) {
            let (body, com) = (body_of(joint), centre(&self.structure.robot, joint));
            let moment = (0..3).map(|n| self.more(body, &[(1 + n, 1.0), (0, -com[n])]));
            let mass = std::iter::once(self.more(body, &[(0, 1.0)]));
            return mass.chain(moment).collect();
        }
        let columns = self.data.columns();
        let parameter = |n: usize| {
            let own = columns.effects().find(|(_, site, linear)| {
                columns.sites[*site].place == place && linear.parameter == n
            });
            match own {
                Some((k, _, linear)) => (self.fit.theta()[k] + linear.neutral, self.std(k)),
                // A scan finds a shape and not how surely.
                None => (columns.site(place).map_or(1.0, |site| site.shape), 0.0),
            }
        };
        (0..effect.description().parameters.len())
            .map(parameter)
            .collect()
    }

    fn size(&self, &(_, place): &Member) -> f64 {
        if is_load(place.0) {
            let (mass, std) = self.more(body_of(place.1), &[(0, 1.0)]);
            return mass.abs() / std;
        }
        let own = self.data.columns().of(place).into_iter();
        own.map(|k| self.fit.theta()[k].abs() / self.std(k))
            .fold(0.0, f64::max)
    }
}
