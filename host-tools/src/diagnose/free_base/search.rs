//! Forward selection with a backward pass at its end over walks: the candidate that is the best by the rules of every diagnosis
//! ([`crate::select::criteria`]) is fitted, judged on time that the fit has not seen, and added; as long as anything is there beyond chance.

use nalgebra::DVector;
use proprio_core::effect::{Form, Varies};
use proprio_core::go2::JOINTS_PER_LEG;
use proprio_core::inertia::INERTIAL;

use super::screen::{WalkScreen, possible};
use super::shapes;
use crate::equation::motion::is_shared;
use crate::equation::values::Place;
use crate::estimate::Constraint;
use crate::free_base::Walks;
use crate::free_base::columns::{EffectSite, body_of};
use crate::free_base::data::Data;
use crate::free_base::fit::{Fit, HeldOut, rms};
use crate::free_base::structure::ModelStructure;
use crate::model::Model;
use crate::select::candidate::Candidate;
use crate::select::criteria::choice::{Look, RIVAL};
use crate::select::criteria::{LEAST_SHARE, LEAST_VALUE, SAME, Squared, least_z, sum_and_error};
use crate::select::enumerate::of_joints;
use crate::select::ranking::{Judged, judge};
use crate::select::trial_factors::ScoreTest;

/// Most steps of a search.
const MOST_STEPS: usize = 24;
/// Most candidates that are refused one after the other before a search ends.
const MOST_REFUSED: usize = 12;
/// What a load has: a mass, its place, and one more for its size.
const LOAD_FREEDOM: f64 = 5.0;

/// A value and its standard deviation.
pub(super) type Value = (f64, f64);

/// One step of the search.
pub(super) struct Step {
    pub(super) places: Vec<Place>,
    pub(super) removed: bool,
    /// Held-out error after it, N m.
    pub(super) rms: f64,
}

/// What a search found.
pub(super) struct Found {
    /// Held-out error of the model as it was given, N m.
    pub(super) start_rms: f64,
    /// Held-out sum of squares of the model as it was given, N² m².
    pub(super) start: f64,
    /// What was tried on the model as it was given, best first; of a load that was fitted its mass (kg) and its place from the body's origin (x, y, z,
    /// m).
    pub(super) first: Vec<FirstLook>,
    pub(super) path: Vec<Step>,
    /// The model at the end, and the data with its nonlinear parameters.
    pub(super) structure: ModelStructure,
    pub(super) fit: Fit,
    pub(super) data: Data,
}

/// A model with a candidate, fitted.
struct Tried {
    structure: ModelStructure,
    held_out: Vec<HeldOut>,
    /// Of an effect's first member its parameters, of a load as [`Found::first`].
    values: Vec<Value>,
    /// Whether it keeps what it promised.
    holds: bool,
}

/// A candidate of the first look, and its values where it was fitted.
pub(super) type FirstLook = (Judged, Option<Vec<Value>>);

/// Searches from `structure`; none if the walks are too short, or numbers overflow.
pub(super) fn search(
    walks: &Walks,
    mut data: Data,
    model: &Model,
    structure: &ModelStructure,
) -> Option<Found> {
    let mut structure = structure.clone();
    let mut held_out = data.held_out(&structure)?;
    let (start_rms, start) = (rms(&held_out), squares(&held_out));
    let (mut first, mut path) = (Vec::<FirstLook>::new(), Vec::<Step>::new());
    while path.len() < MOST_STEPS {
        let mut fit = data.fit(&structure)?;
        if let Some(sites) = shapes::better(walks, &data, &fit) {
            structure = structure.with_shapes(&sites);
            data = data.with_sites(walks, sites).ok()?;
            fit = data.fit_from(&structure, &fit)?;
            held_out = data.held_out_from(&structure, &held_out)?;
        }
        let screen = WalkScreen::of(walks, (&data, model), &structure, &fit)?;
        // Trunk and legs are one limb; the trunk is like no joint.
        let kind = |joint: usize| match is_shared(joint) {
            true => JOINTS_PER_LEG,
            false => joint % JOINTS_PER_LEG,
        };
        let trial = |_: usize, places: &[Place]| screen.trial(places);
        let (mut candidates, _) = of_joints(&trial, &[possible(walks, &structure)], &kind);
        // Gains at many joints are another mass of the robot: all torques times one factor are those of bodies so many times as heavy.
        candidates.retain(|c| c.effect.description().form != Form::Scale || c.members.len() == 1);
        let look = Look {
            all: &candidates,
            windows: screen.equations(),
            beside: &|candidate, other| screen.beside(candidate, other),
        };
        let least = 0.5 * LEAST_SHARE * screen.error();
        let mut open: Vec<&Candidate> = candidates.iter().filter(|c| c.gain().0 > least).collect();
        let trial = Trial {
            data: &data,
            model,
            structure: &structure,
            now: &fit,
            held_out: &held_out,
        };
        // The first that is tried is what a reader is told of if none is taken.
        let (mut best, mut taken) = (None, None);
        for _ in 0..MOST_REFUSED {
            let Some(next) = next(&look, &open) else {
                break;
            };
            let tried = trial.of(next)?;
            if tried.holds {
                best = Some((next, tried.values.clone()));
                taken = Some((next, tried));
                break;
            }
            best = best.or(Some((next, tried.values)));
            open.retain(|c| !c.is_same(next));
        }
        if first.is_empty() {
            first = told_first(&look, best, taken.is_some());
        }
        let Some((best, tried)) = taken else { break };
        path.push(Step {
            places: best.members.iter().map(|(_, place)| *place).collect(),
            removed: false,
            rms: rms(&tried.held_out),
        });
        (structure, held_out) = (tried.structure, tried.held_out);
    }
    backward(&data, &mut structure, &mut path, rms(&held_out))?;
    let fit = data.fit(&structure)?;
    Some(Found {
        start_rms,
        start,
        first,
        path,
        structure,
        fit,
        data,
    })
}

/// The candidate to be tried next: the best, but what every drive has before what looks like it at the speeds of a gait (drag like viscous friction). A
/// constant torque is not before a load.
fn next<'c>(look: &Look, open: &[&'c Candidate]) -> Option<&'c Candidate> {
    let best = look.best(open)?;
    let plain = open.iter().copied().filter(|c| {
        let facts = c.effect.description();
        facts.is_plain()
            && facts.varies == Varies::Fast
            && c.torque_error_taken() >= RIVAL * best.torque_error_taken()
    });
    Some(look.best(&plain.collect::<Vec<_>>()).unwrap_or(best))
}

/// All candidates, the `best` first with the values of its fit, which was `taken` or refused.
fn told_first(look: &Look, best: Option<(&Candidate, Vec<Value>)>, taken: bool) -> Vec<FirstLook> {
    let judged = judge(look, best.as_ref().map(|(best, _)| *best));
    let mut all: Vec<_> = judged.into_iter().map(|judged| (judged, None)).collect();
    if let (Some((judged, load)), Some((_, values))) = (all.first_mut(), best) {
        judged.significant &= taken;
        match judged.candidate.effect.description().form {
            Form::Inertia => *load = Some(values),
            _ => judged.parameters[0] = values,
        }
    }
    all
}

fn squares(parts: &[HeldOut]) -> f64 {
    parts.iter().map(|part| part.squares).sum()
}

/// Takes out again what does not raise the held-out error when it is missing.
fn backward(
    data: &Data,
    structure: &mut ModelStructure,
    path: &mut Vec<Step>,
    mut now: f64,
) -> Option<()> {
    let added: Vec<Vec<Place>> = path.iter().map(|step| step.places.clone()).collect();
    // The last one was just found to be there.
    for places in added.into_iter().rev().skip(1) {
        let mut without = structure.clone();
        for &(effect, joint) in &places {
            without = match effect.description().form {
                Form::Inertia => without.with_load(body_of(joint), false),
                _ => without.without_effect((effect, joint)),
            };
        }
        let after = rms(&data.held_out(&without)?);
        if after <= SAME * now {
            *structure = without;
            now = after;
            path.push(Step {
                places,
                removed: true,
                rms: after,
            });
        }
    }
    Some(())
}

/// What candidates are tried on.
struct Trial<'a> {
    data: &'a Data,
    model: &'a Model,
    structure: &'a ModelStructure,
    now: &'a Fit,
    held_out: &'a [HeldOut],
}

impl Trial<'_> {
    fn of(&self, candidate: &Candidate) -> Option<Tried> {
        let mut structure = self.structure.clone();
        for &(_, place) in &candidate.members {
            structure = match place.0.description().form {
                Form::Inertia => structure.with_load(body_of(place.1), true),
                _ => {
                    let site = EffectSite::of(self.model, place, Constraint::Physical);
                    let shape = self.data.columns().site(place).map(|site| site.shape);
                    structure.with_effect(site.with_shape(shape.unwrap_or(1.0)))
                }
            };
        }
        let fit = self.data.fit_from(&structure, self.now)?;
        let held_out = self.data.held_out_from(&structure, self.held_out)?;
        let parts = self.held_out.iter().zip(&held_out);
        let parts: Vec<f64> = parts.map(|(a, b)| a.squares - b.squares).collect();
        let (gain, error) = sum_and_error(&parts);
        let (values, is_told) = match candidate.members[..] {
            [(_, (effect, body))] if effect.description().form == Form::Inertia => {
                self.load(body_of(body), candidate.tried, &structure, &fit)?
            }
            _ => self.effect(candidate, &fit),
        };
        Some(Tried {
            holds: is_told && gain > error && gain >= LEAST_SHARE * squares(self.held_out),
            structure,
            held_out,
            values,
        })
    }

    /// Parameters of the first member; and whether most members are told to be something.
    fn effect(&self, candidate: &Candidate, fit: &Fit) -> (Vec<Value>, bool) {
        let (columns, deviations) = (self.data.columns(), self.data.deviations(fit));
        let std = |k: usize| deviations.of_parameter(k).into_iter().fold(0.0, f64::max);
        let size = |place: Place| {
            let own = columns.of(place).into_iter();
            own.map(|k| fit.theta()[k].abs() / std(k))
                .fold(0.0, f64::max)
        };
        let members = candidate.members.iter().map(|(_, place)| *place);
        let there = members.filter(|place| size(*place) >= LEAST_VALUE).count();
        let first = candidate.members[0].1;
        let parameters = first.0.description().parameters;
        let values = (0..parameters.len()).map(|n| {
            let own = columns.effects().find(|(_, site, linear)| {
                columns.sites[*site].place == first && linear.parameter == n
            });
            match own {
                Some((k, _, linear)) => (fit.theta()[k] + linear.neutral, std(k)),
                // A scan finds a shape and not how surely.
                None => (columns.site(first).map_or(1.0, |site| site.shape), 0.0),
            }
        });
        (values.collect(), 2 * there > candidate.members.len())
    }

    /// A load is what a body has beyond what the model's uncertainty leaves open: judged by how much the cost falls once that no longer
    /// binds.
    fn load(
        &self,
        body: usize,
        tried: usize,
        structure: &ModelStructure,
        fit: &Fit,
    ) -> Option<(Vec<Value>, bool)> {
        let free = |structure: &ModelStructure| {
            let mut structure = structure.clone();
            structure.hold_bodies = false;
            self.data.fit_from(&structure, fit)
        };
        let (without, with) = (free(self.structure)?, free(structure)?);
        let fallen = without.cost(self.data, without.noise) - with.cost(self.data, without.noise);
        let size = Squared {
            size: fallen,
            freedom: LOAD_FREEDOM,
            tried: 1.0,
        };
        let values = self.load_values(body, fit);
        let (mass, std) = values[0];
        // A body whose mass is elsewhere carries no load.
        let is_told = mass > 0.0 && mass > LEAST_VALUE * std && size.z() >= least_z(tried);
        Some((values, is_told))
    }

    /// Mass and place: what the body is more than the model's, and where.
    fn load_values(&self, body: usize, fit: &Fit) -> Vec<Value> {
        let deviations = self.data.deviations(fit);
        let model = &self.structure.bodies[body];
        let theta = fit.theta();
        let first = INERTIAL * body;
        let more = |k: usize| theta[first + k] - model.inertia.0[k];
        // The model's body is not known better than it says.
        let problem = self.data.problem(self.structure, fit.noise);
        let prior = problem.prior_root(&problem.start());
        let std = |entries: &[(usize, f64)]| {
            let combination = |len: usize| {
                let mut all = DVector::zeros(len);
                entries.iter().for_each(|(k, x)| all[first + k] = *x);
                all
            };
            // Bodies come first in what the structure has.
            let own = prior.tr_mul(&combination(prior.nrows())).norm();
            deviations
                .of_combination(&combination(theta.len()))
                .hypot(own)
        };
        let mass = more(0);
        let place = (1..4).map(|axis| {
            let at = more(axis) / mass;
            (at, std(&[(0, -at / mass), (axis, 1.0 / mass)]))
        });
        std::iter::once((mass, std(&[(0, 1.0)])))
            .chain(place)
            .collect()
    }
}
