//! What every effect would add to a model of a walking robot, read off the factors of its data: as [`crate::select::score_test`] of a limb, of rows that
//! have all columns.

use std::sync::Arc;

use nalgebra::DVector;
use proprio_core::effect::Form;
use proprio_core::inertia::INERTIAL;

use crate::equation::column::{Column, Columns, Entry, couples};
use crate::equation::free_tree::OF_BASE;
use crate::equation::values::Place;
use crate::estimate::factor::HeapFactor;
use crate::estimate::r_factor::{Prior, RFactor, prior_of_body};
use crate::free_base::Walks;
use crate::free_base::columns::{all_places, prior};
use crate::free_base::data::Data;
use crate::free_base::fit::Fit;
use crate::free_base::legged::Legged;
use crate::free_base::structure::ModelStructure;
use crate::model::{BASE, Model};
use crate::parallel::side_by_side;
use crate::select::candidate::{Felt, Finding, Trial};
use crate::select::criteria::presence;
use crate::select::criteria::statistics::autocorrelation_time;
use crate::select::score_test::is_beyond_its_parts;
use crate::select::trial_factors::{ScoreTest, TrialFactors};

/// The data of walks beside a fit, over the columns of the model and of all that it might lack.
pub(super) struct WalkScreen<'a> {
    data: Arc<Data>,
    model: &'a Model,
    factors: TrialFactors,
    /// By which feet may carry a force, what is left of each coordinate's equations.
    stances: Vec<(Vec<bool>, Sums)>,
    /// How many neighbouring windows of each coordinate say the same thing.
    memory: Vec<f64>,
    period: f64,
}

/// Sums of squares of each coordinate's equations: what the model leaves of those that it has not seen, in units of the noise, and the torques that were
/// measured, N² m².
type Sums = Vec<[f64; 2]>;

impl<'a> WalkScreen<'a> {
    /// Beside a fit of `structure`; `None` if numbers overflow.
    pub(super) fn of(
        walks: &Walks,
        (data, model): (Arc<Data>, &'a Model),
        structure: &ModelStructure,
        fit: &Fit,
    ) -> Option<Self> {
        let (columns, entry) = ordered(&data, fit);
        // As the fit holds them.
        let bodies = fit.problem.bodies.iter();
        let bodies = bodies.map(|(body, relative)| prior_of_body(body, *relative));
        let prior = Prior {
            bodies: bodies.collect(),
            tightness: vec![1.0; structure.bodies.len()],
        };
        let active = fit.active.len();
        let triangle = |sum: &HeapFactor| {
            let mut rows = sum.clone();
            // What gravity's length tells, in units of the noise as the others are.
            let gravity = (&data.gravity * fit.noise).transpose();
            rows.fold(gravity.as_slice().to_vec().as_mut_slice());
            RFactor::new(&columns, &prior, &[rows], &[fit.noise], active)
        };
        let others = data.parts.iter().map(|part| &part.others.factor);
        let sums: Vec<&HeapFactor> = std::iter::once(&data.all.factor).chain(others).collect();
        let mut made = side_by_side(&sums, |sum| triangle(sum)).into_iter();
        let all = made.next()?;
        let tests = data.parts.iter().map(|part| vec![part.own.factor.clone()]);
        let (tests, kinds) = (tests.collect(), (columns, active));
        let factors = TrialFactors::new(kinds, vec![fit.noise], all, made.collect(), tests);
        let theta =
            |own: &Vec<f64>| DVector::from_iterator(entry.len(), entry.iter().map(|e| own[*e]));
        let held_out: Vec<_> = factors.theta.iter().map(theta).collect();
        // Of what kind the noise is, what all effects together leave tells best: what the model lacks is no noise.
        let together = data.with_all(structure, &[&data.all])?;
        let thetas = [held_out.iter().collect(), together.iter().collect()];
        let scale = &structure.robot.scale;
        let (mut stances, mut left) = (Vec::new(), vec![Vec::new(); scale.len()]);
        data.each_equation(walks, &thetas, |equation| {
            let c = equation.coordinate;
            let [held_out, together] =
                [0, 1].map(|n| scale[c] * (equation.measured - equation.predicted[n]));
            left[c].push(together);
            let sums = of_stance(&mut stances, equation.loaded, scale.len());
            sums[c][0] += (held_out / fit.noise).powi(2);
            sums[c][1] += (scale[c] * equation.measured).powi(2);
        });
        Some(Self {
            memory: left.iter().map(|own| autocorrelation_time(own)).collect(),
            period: walks.period(),
            data,
            model,
            factors,
            stances,
        })
    }

    /// Equations that the candidates are judged by.
    pub(super) fn equations(&self) -> f64 {
        self.data.all.equations
    }

    /// Sum of squares of all torques that were measured, N² m².
    pub(super) fn torque(&self) -> f64 {
        let stances = self.stances.iter();
        stances
            .flat_map(|(_, sums)| sums.iter().map(|own| own[1]))
            .sum()
    }

    /// What a trial says of the parameters at one of its places, as the catalogue means them.
    fn finding(&self, trial: &Trial, place: Place) -> Finding {
        let columns = self.data.columns();
        let told = |n: usize| {
            let entries = &self.factors.columns.entries;
            let is = |e: &usize| {
                let entry = &entries[*e];
                (entry.effect, entry.joint, entry.parameter) == (Some(place.0), place.1, n)
            };
            let at = trial.entries.iter().position(is)?;
            let neutral = place.0.description().parameters[n].neutral;
            Some((trial.value[at] + neutral, trial.std[at]))
        };
        let parameters = 0..place.0.description().parameters.len();
        Finding {
            place,
            parameters: parameters.clone().map(told).collect(),
            prior: parameters
                .map(|n| prior((self.model, &columns.robot), place, n))
                .collect(),
            nonlinear: columns.site(place).map_or(0.0, |site| site.shapes[0]),
            period: self.period,
            beyond_limit: None,
        }
    }
}

impl ScoreTest for WalkScreen<'_> {
    fn factors(&self) -> &TrialFactors {
        &self.factors
    }

    /// Where contact forces are projected out, what acts on one of the equations that they enter acts on all of them.
    fn felt(&self, places: &[Place], _: &[usize]) -> Felt {
        let robot = &self.data.columns().robot;
        let feels = |c: usize| places.iter().any(|place| feels(robot, c, *place));
        let own: Vec<bool> = (0..robot.coordinates()).map(feels).collect();
        let [mut squares, mut torque] = [0.0; 2];
        for (loaded, sums) in &self.stances {
            let projected = |c: usize| match c.checked_sub(OF_BASE) {
                Some(joint) => robot.limb_is_loaded(joint, loaded),
                None => loaded.contains(&true),
            };
            let is_mixed = (0..own.len()).any(|c| own[c] && projected(c));
            for c in (0..own.len()).filter(|&c| own[c] || is_mixed && projected(c)) {
                squares += sums[c][0];
                torque += sums[c][1];
            }
        }
        let memory = self.memory.iter().zip(own).filter(|(_, own)| *own);
        Felt {
            squares,
            torque,
            memory: memory.map(|(memory, _)| *memory).fold(1.0, f64::max),
        }
    }

    fn findings(&self, trial: &Trial) -> Vec<Finding> {
        let places = trial.places.iter();
        places.map(|place| self.finding(trial, *place)).collect()
    }
}

/// The sums of a stance, which are zero of one that is new.
fn of_stance<'a>(
    stances: &'a mut Vec<(Vec<bool>, Sums)>,
    loaded: &[bool],
    coordinates: usize,
) -> &'a mut Sums {
    let known = stances.iter().position(|(own, _)| *own == loaded);
    let at = known.unwrap_or_else(|| {
        stances.push((loaded.to_vec(), vec![[0.0; 2]; coordinates]));
        stances.len() - 1
    });
    &mut stances[at].1
}

/// The entries, those of the fit first; and of each column of the data its entry.
fn ordered(data: &Data, fit: &Fit) -> (Columns, Vec<usize>) {
    let own = data.columns();
    let (acc, fixed) = (own.acc(), own.fixed());
    let candidates = (fixed..own.len()).filter(|k| fit.active.binary_search(k).is_err());
    let places: Vec<usize> = fit.active.iter().copied().chain(candidates).collect();
    let effects: Vec<_> = own.effects().collect();
    let entries = places.iter().enumerate().map(|(at, &k)| {
        // What is known of the model's own effects the fit has.
        let known = (at.checked_sub(acc)).and_then(|n| fit.problem.others.get(n));
        match k {
            _ if k < acc => Entry {
                effect: None,
                joint: k / INERTIAL,
                parameter: k % INERTIAL,
                mean: 0.0,
                std: f64::INFINITY,
                column: Column::Inertial(k / INERTIAL, k % INERTIAL),
            },
            _ if k < fixed => Entry {
                effect: None,
                joint: BASE,
                parameter: k - acc,
                mean: 0.0,
                std: own.robot.sensor_std[k - acc],
                column: Column::Sensor(k - acc),
            },
            _ => {
                let (_, n, linear) = effects[k - fixed];
                let place = own.sites[n].place;
                let prior = known.copied().unwrap_or(linear.prior);
                Entry {
                    effect: Some(place.0),
                    joint: place.1,
                    parameter: linear.parameter,
                    mean: prior.mean,
                    std: prior.std,
                    column: linear.column,
                }
            }
        }
    });
    let entries = entries.collect();
    let mut entry = vec![0; places.len()];
    places.iter().enumerate().for_each(|(e, k)| entry[*k] = e);
    (Columns::of_all(entries, &places), entry)
}

/// Whether the equation of a coordinate is one that an effect acts on where no foot carries a force.
fn feels(robot: &Legged, coordinate: usize, place: Place) -> bool {
    let (effect, at) = place;
    let Some(joint) = coordinate.checked_sub(OF_BASE) else {
        let form = effect.description().form;
        return matches!(form, Form::Inertia | Form::Motion(_));
    };
    let same_leg = at != BASE && robot.limb_of(joint) == robot.limb_of(at);
    match effect.description().form {
        Form::Inertia => same_leg && robot.carries(joint, at),
        Form::Motion(_) => same_leg,
        Form::Coupled => same_leg && couples(effect, [at, joint], robot.parents[at]),
        _ => joint == at,
    }
}

/// Every effect that a model does not have, where it could be.
pub(super) fn possible(walks: &Walks, model: &Model, structure: &ModelStructure) -> Vec<Place> {
    let has = |place: &Place| structure.has_or_carries(*place);
    let still: Vec<bool> = (0..structure.robot.joints())
        .map(|joint| !moves(walks, model, joint))
        .collect();
    let all = all_places(model, &structure.robot)
        .into_iter()
        .filter(|place| !has(place));
    let moving = all.filter(|place| place.1 == BASE || !still[place.1]);
    moving
        .filter(|place| {
            let parent = structure.robot.parents.get(place.1).copied().flatten();
            is_beyond_its_parts(*place, parent, &has)
        })
        .collect()
}

/// Whether a joint moves for long enough to claim anything of it.
fn moves(walks: &Walks, model: &Model, joint: usize) -> bool {
    let samples = walks.walks.iter().flat_map(|(walk, _)| walk.dq.iter());
    let speeds: Vec<f64> = samples.map(|dq| dq[joint]).collect();
    let limit = model.robot().bodies()[joint].velocity;
    presence::moves(speeds.into_iter(), limit)
}
