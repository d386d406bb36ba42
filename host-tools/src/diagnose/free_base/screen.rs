//! What every effect would add to a model of a walking robot, read off the factors of its data: as [`crate::select::score_test`] of a limb, of rows that
//! have all columns.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use nalgebra::DVector;
use proprio_core::effect::Form;
use proprio_core::go2::{JOINTS, JOINTS_PER_LEG};
use proprio_core::inertia::INERTIAL;

use crate::equation::column::{Column, Columns, Entry};
use crate::equation::values::Place;
use crate::estimate::factor::HeapFactor;
use crate::estimate::robot::side_by_side;
use crate::estimate::triangle::{Prior, Triangle, misfit};
use crate::free_base::Walks;
use crate::free_base::columns::{ACC, FIXED, Linear, all_places, body_of, prior};
use crate::free_base::data::Data;
use crate::free_base::fit::Fit;
use crate::free_base::projection::is_carried;
use crate::free_base::rows::{BODIES, COORDINATES};
use crate::free_base::sensors::STD;
use crate::free_base::structure::ModelStructure;
use crate::model::{BASE, Model};
use crate::select::candidate::{Candidate, Finding, Scores, Trial};
use crate::select::criteria::statistics::autocorrelation_time;
use crate::select::score_test::is_beyond_its_parts;

/// Coordinates of the base, before those of the joints.
const OF_BASE: usize = COORDINATES - JOINTS;
/// A joint moves where it is faster than three times the noise of a Go2's velocity, rad/s; of one that does for less than this share of the time
/// nothing is claimed.
const AT_REST: f64 = 0.1;
const LEAST_MOVING: f64 = 0.1;

/// The data of walks beside a fit, over the columns of the model and of all that it might lack.
pub(super) struct WalkScreen<'a> {
    data: &'a Data,
    model: &'a Model,
    columns: Columns,
    /// Of each column of the data its entry.
    entry: Vec<usize>,
    active: usize,
    noise: f64,
    all: Triangle,
    /// By the data of all parts of the time but each.
    trains: Vec<Triangle>,
    /// Each part's own sum of squares under the model fitted to the others, N² m².
    base: Vec<f64>,
    /// Of each coordinate's equations: what the model leaves, the torques that were measured, both sums of squares, N² m²; and how many neighbouring
    /// windows say the same thing.
    left: Vec<f64>,
    torque: Vec<f64>,
    memory: Vec<f64>,
    period: f64,
    trials: Mutex<HashMap<Vec<Place>, Option<Trial>>>,
}

impl<'a> WalkScreen<'a> {
    /// Beside a fit of `structure`; `None` if numbers overflow.
    pub(super) fn of(
        walks: &Walks,
        (data, model): (&'a Data, &'a Model),
        structure: &ModelStructure,
        fit: &Fit,
    ) -> Option<Self> {
        let (columns, entry) = ordered(data, fit);
        let body = |(body, relative): &(proprio_core::inertia::InertialParameters<f64>, f64)| {
            let factor = body.prior(*relative);
            let row = |k: usize| {
                let mut row = [0.0; INERTIAL + 1];
                if let Some(factor) = &factor {
                    row[k..].copy_from_slice(factor.row(k));
                }
                row
            };
            (0..INERTIAL).map(row).collect()
        };
        // As the fit holds them.
        let bodies = fit.problem.bodies.iter().map(body).collect();
        let prior = Prior {
            bodies,
            tightness: vec![1.0; structure.bodies.len()],
        };
        let active = fit.active.len();
        let triangle = |sum: &HeapFactor| {
            let mut rows = sum.clone();
            // What gravity's length tells, in units of the noise as the others are.
            let gravity = (&data.gravity * fit.noise).transpose();
            rows.fold(gravity.as_slice().to_vec().as_mut_slice());
            Triangle::new(&columns, &prior, &[rows], &[fit.noise], active)
        };
        let others = data.parts.iter().map(|part| &part.others.factor);
        let sums: Vec<&HeapFactor> = std::iter::once(&data.all.factor).chain(others).collect();
        let mut made = side_by_side(&sums, |sum| triangle(sum)).into_iter();
        let all = made.next()?;
        let trains: Vec<Triangle> = made.collect();
        let base = data.parts.iter().zip(&trains).map(|(part, train)| {
            let own = (0, &part.own.factor);
            misfit(&columns, own, &train.solve(&[]), active)
        });
        let base = base.collect();
        // Of what kind the noise is, what all effects together leave tells best: what the model lacks is no noise.
        let memory = by_coordinate(walks, data, &data.with_all(structure)?.0);
        let model_left = by_coordinate(walks, data, fit.theta());
        let squares = |own: &Vec<[f64; 2]>, n: usize| own.iter().map(|x| x[n] * x[n]).sum();
        let time = |own: &Vec<[f64; 2]>| {
            let left: Vec<f64> = own.iter().map(|x| x[0]).collect();
            autocorrelation_time(&left)
        };
        let periods = walks.walks.iter().map(|(walk, _)| walk.period);
        Some(Self {
            left: model_left.iter().map(|own| squares(own, 0)).collect(),
            torque: model_left.iter().map(|own| squares(own, 1)).collect(),
            memory: memory.iter().map(time).collect(),
            period: periods.fold(0.0, f64::max),
            noise: fit.noise,
            trials: Mutex::default(),
            data,
            model,
            columns,
            entry,
            active,
            all,
            trains,
            base,
        })
    }

    /// The held-out sum of squares of the model, in units of the noise.
    pub(super) fn error(&self) -> f64 {
        self.base.iter().sum::<f64>() / (self.noise * self.noise)
    }

    fn entries(&self, places: &[Place]) -> Vec<usize> {
        let columns = places
            .iter()
            .flat_map(|place| self.data.columns().of(*place));
        columns.map(|k| self.entry[k]).collect()
    }

    fn new_trial(&self, places: &[Place]) -> Option<Trial> {
        let entries = self.entries(places);
        let all = self.all.trial(&entries)?;
        let own: Option<Vec<_>> = (self.trains.iter())
            .map(|train| train.trial(&entries))
            .collect();
        let own = own?;
        let values: Vec<Vec<f64>> = own.iter().map(|trial| trial.value.clone()).collect();
        let parts = self.data.parts.iter().zip(&self.trains).zip(&self.base);
        let falls: Vec<f64> = parts
            .zip(&values)
            .map(|(((part, train), base), value)| {
                let with: Vec<(usize, f64)> =
                    entries.iter().copied().zip(value.iter().copied()).collect();
                let theta = train.solve(&with);
                base - misfit(&self.columns, (0, &part.own.factor), &theta, self.active)
            })
            .collect();
        let felt: Vec<usize> = (0..COORDINATES)
            .filter(|c| places.iter().any(|place| feels(*c, *place)))
            .collect();
        let square = self.noise * self.noise;
        let sum = |of: &[f64]| felt.iter().map(|c| of[*c]).sum::<f64>();
        let scores = Scores {
            gains: falls.iter().map(|fall| fall / square).collect(),
            felt: sum(&self.left) / square,
            torque: sum(&self.torque),
            memory: felt.iter().map(|c| self.memory[*c]).fold(1.0, f64::max),
            falls,
        };
        let mut trial = Trial::of((places, entries), all, &values, &own, scores);
        let findings = places.iter().map(|place| self.finding(&trial, *place));
        trial.findings = findings.collect();
        Some(trial)
    }
}

impl WalkScreen<'_> {
    /// What the effects at `places` would add together; `None` if nothing determines them.
    pub(super) fn trial(&self, places: &[Place]) -> Option<Trial> {
        let known = || self.trials.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(trial) = known().get(places) {
            return trial.clone();
        }
        let trial = self.new_trial(places);
        known().insert(places.to_vec(), trial.clone());
        trial
    }

    /// What a candidate adds to the model with another one in it.
    pub(super) fn beside(&self, candidate: &Candidate, other: &Candidate) -> Option<Candidate> {
        candidate.beside(other, &|_, places, others| {
            let before = self.trial(others)?;
            Some(self.trial(&[others, places].concat())?.beside(&before))
        })
    }

    /// Equations that the candidates are judged by.
    pub(super) fn equations(&self) -> f64 {
        self.data.all.equations
    }

    /// What a trial says of the parameters at one of its places, as the catalogue means them.
    fn finding(&self, trial: &Trial, place: Place) -> Finding {
        let columns = self.data.columns();
        let told = |n: usize| {
            let is = |(_, site, linear): &(usize, usize, &Linear)| {
                columns.sites[*site].place == place && linear.parameter == n
            };
            let (k, _, linear) = columns.effects().find(is)?;
            let at = trial.entries.iter().position(|e| *e == self.entry[k])?;
            Some((trial.value[at] + linear.neutral, trial.std[at]))
        };
        let parameters = 0..place.0.description().parameters.len();
        Finding {
            place,
            parameters: parameters.clone().map(told).collect(),
            prior: parameters.map(|n| prior(self.model, place, n)).collect(),
            nonlinear: columns.site(place).map_or(0.0, |site| site.shape),
            period: self.period,
            beyond_limit: None,
        }
    }
}

/// The entries, those of the fit first; and of each column of the data its entry.
fn ordered(data: &Data, fit: &Fit) -> (Columns, Vec<usize>) {
    let own = data.columns();
    let candidates = (FIXED..own.len()).filter(|k| fit.active.binary_search(k).is_err());
    let places: Vec<usize> = fit.active.iter().copied().chain(candidates).collect();
    let effects: Vec<_> = own.effects().collect();
    let entries = places.iter().enumerate().map(|(at, &k)| {
        // What is known of the model's own effects the fit has.
        let known = (at.checked_sub(ACC)).and_then(|n| fit.problem.others.get(n));
        match k {
            0..ACC => Entry {
                effect: None,
                joint: k / INERTIAL,
                parameter: k % INERTIAL,
                mean: 0.0,
                std: f64::INFINITY,
                column: Column::Inertial(k / INERTIAL, k % INERTIAL),
            },
            ACC..FIXED => Entry {
                effect: None,
                joint: BASE,
                parameter: k - ACC,
                mean: 0.0,
                std: STD[k - ACC],
                column: Column::Sensor(k - ACC),
            },
            _ => {
                let (_, n, linear) = effects[k - FIXED];
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

/// Of each coordinate, in the order of time, what parameters leave of each of its equations and what was measured.
fn by_coordinate(walks: &Walks, data: &Data, theta: &DVector<f64>) -> Vec<Vec<[f64; 2]>> {
    let mut all = vec![Vec::new(); COORDINATES];
    for window in data.left(walks, theta).iter().flatten() {
        for (c, own) in all.iter_mut().enumerate() {
            if window.left[c].is_finite() {
                own.push([window.left[c], window.measured[c]]);
            }
        }
    }
    all
}

/// Whether the equation of a coordinate is one that an effect acts on where no foot carries a force.
fn feels(coordinate: usize, place: Place) -> bool {
    let (effect, at) = place;
    let Some(joint) = coordinate.checked_sub(OF_BASE) else {
        let form = effect.description().form;
        return matches!(form, Form::Inertia | Form::Motion(_));
    };
    let same_leg = at != BASE && joint / JOINTS_PER_LEG == at / JOINTS_PER_LEG;
    match effect.description().form {
        Form::Inertia => same_leg && joint <= at,
        Form::Motion(_) => same_leg,
        Form::Coupled => same_leg && (joint == at || joint + 1 == at),
        _ => joint == at,
    }
}

/// Every effect that a model does not have, where it could be.
pub(super) fn possible(walks: &Walks, structure: &ModelStructure) -> Vec<Place> {
    let has = |place: &Place| match place.0.description().form {
        Form::Inertia => structure.bodies[body_of(place.1)].loaded,
        _ => structure.has(*place),
    };
    let still: Vec<bool> = (0..JOINTS).map(|joint| !moves(walks, joint)).collect();
    let all = all_places().into_iter().filter(|place| !has(place));
    let moving = all.filter(|place| place.1 == BASE || !still[place.1]);
    moving
        .filter(|place| {
            let parent = (place.1 != BASE && is_carried(place.1)).then(|| place.1 - 1);
            is_beyond_its_parts(*place, parent, &has)
        })
        .collect()
}

/// Whether a joint moves for long enough to claim anything of it.
fn moves(walks: &Walks, joint: usize) -> bool {
    let samples = || walks.walks.iter().flat_map(|(walk, _)| &walk.dq);
    let moving = samples().filter(|dq| dq[joint].abs() > AT_REST).count();
    moving as f64 >= LEAST_MOVING * samples().count() as f64
}

const _: () = assert!(ACC == INERTIAL * BODIES);
