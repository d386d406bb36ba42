//! A model of a walking robot fitted to walks, as a search compares it with others.

use std::sync::{Arc, OnceLock, Weak};

use nalgebra::{DVector, Matrix4, Matrix4xX, Vector4};
use proprio_core::effect::Form;
use proprio_core::inertia::INERTIAL;

use super::{centre, is_load};
use crate::equation::values::{NO_SHAPES, Place};
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

/// Mass and first moment of a body about its origin without its load: a value, what of it depends on the fit's parameters, and its covariance.
struct WithoutLoad {
    value: Vector4<f64>,
    by_others: Matrix4xX<f64>,
    covariance: Matrix4<f64>,
}

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

    /// The same with a formula that neither it nor the rows have, its nonlinear parameters near these; none if numbers overflow.
    pub(super) fn with_formula(
        &self,
        (walks, model): (&Walks, &Model),
        place: Place,
        shapes: &[f64],
    ) -> Option<Self> {
        let site = EffectSite::of((model, &walks.robot), place, Constraint::Physical);
        let mut near = site.shapes;
        near.iter_mut()
            .zip(shapes)
            .for_each(|(own, near)| *own = *near);
        let site = site.with_shapes(near);
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
                    let shapes = self.data.columns().site(place).map(|site| site.shapes);
                    structure.with_effect(site.with_shapes(shapes.unwrap_or(NO_SHAPES)))
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

    /// What a body has more than the model's of a combination of its mass and first moment.
    fn more(&self, body: usize, entries: &[(usize, f64)]) -> Value {
        let (first, theta) = (INERTIAL * body, self.fit.theta());
        let bare = self.without_load(body);
        let mut own = Vector4::zeros();
        entries.iter().for_each(|(k, x)| own[*k] = *x);
        let mut combination: DVector<f64> = -bare.by_others.tr_mul(&own);
        (0..4).for_each(|k| combination[first + k] += own[k]);
        let value = combination.dot(theta) - own.dot(&bare.value);
        let std = self.deviations().of_combination(&combination);
        (
            value,
            std.hypot(own.dot(&(bare.covariance * own)).max(0.0).sqrt()),
        )
    }

    /// What is known of a body without its load: by what the model says of it, and, where the model knows of all bodies together, by that less the other bodies
    /// as they are here. A walk tells the sum ten times as well as its parts: what the trunk is taken to be too heavy by, the legs are too light by, in both walks.
    fn without_load(&self, body: usize) -> WithoutLoad {
        // No body is known better than the model says, without its load.
        let bare = self.structure.with_loads(false);
        let problem = self.data.problem(&bare, self.fit.noise);
        let root = problem.prior_root(&problem.start());
        let prior = |b: usize| -> Matrix4<f64> {
            let own = root.fixed_rows::<4>(INERTIAL * b);
            own * own.transpose()
        };
        let stated = |b: usize| bare.bodies[b].inertia.0.fixed_rows::<4>(0).into_owned();
        let mut by_others = Matrix4xX::zeros(self.fit.theta().len());
        let (value, covariance) = (stated(body), prior(body));
        let alone = WithoutLoad {
            value,
            by_others: by_others.clone(),
            covariance,
        };
        let shares = bare.robot.shares_of_total();
        let (Some(std), Some(inverse)) = (bare.total_std, shares[body].try_inverse()) else {
            return alone;
        };
        let count = shares.len();
        let total: Vector4<f64> = (0..count).map(|b| shares[b] * stated(b)).sum();
        // Mass and centre of mass are known independently of each other; the first moment is their product.
        let mut known = Matrix4::from_diagonal_element(total[0]);
        known.set_column(0, &(total / total[0]));
        known *= Matrix4::from_diagonal(&Vector4::from(std));
        let mut of_total = known * known.transpose();
        let mut rest = total;
        for b in (0..count).filter(|&b| b != body) {
            if self.structure.bodies[b].loaded {
                // What it weighs here is not what it weighed.
                rest -= shares[b] * stated(b);
                of_total += shares[b] * prior(b) * shares[b].transpose();
            } else {
                let mut own = by_others.fixed_view_mut::<4, 4>(0, INERTIAL * b);
                own.copy_from(&(-inverse * shares[b]));
            }
        }
        let of_rest = inverse * of_total * inverse.transpose();
        let Some(both) = (covariance + of_rest).try_inverse() else {
            return alone;
        };
        let weight = covariance * both;
        WithoutLoad {
            value: value + weight * (inverse * rest - value),
            by_others: weight * by_others,
            covariance: covariance - weight * covariance,
        }
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
                None => (columns.site(place).map_or(1.0, |site| site.shape(n)), 0.0),
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
