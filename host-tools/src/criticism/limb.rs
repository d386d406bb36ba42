//! One limb under criticism: its data as factors, its model so far, and what each effect of the catalogue would add.

use nalgebra::Vector3;
use proprio_core::effect::{EffectKind, Form, Parameter};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::blocks::{BlockFactors, HeapFactor};
use super::column::{BASE, Columns, Entry, columns_of};
use super::diagnosis::ParameterReport;
use super::motion::{Corrections, Motion};
use super::recording::LimbRecording;
use super::rigid_body::{self, RigidBody};
use super::rows::{self, Blocks};
use super::triangle::{Prior, Triangle, misfit};
use super::velocity::VelocityGain;
use crate::model::{Limb, Model};

/// Folds of the held-out error: contiguous stretches of time, so that what is held out is not just like its neighbours.
pub(crate) const FOLDS: usize = 8;

/// Times that noise and the hold on bodies are found again from the fit that they give.
const ITERATIONS: usize = 5;

/// An effect at a joint of a limb; [`BASE`] for the base's.
pub(crate) type Place = (EffectKind, usize);

/// A limb's data and its model.
pub(crate) struct LimbCriticism<'a> {
    model: &'a Model,
    pub(crate) with_candidates: bool,
    pub(crate) limb: &'a Limb,
    pub(crate) recording: &'a LimbRecording,
    pub(crate) blocks: Blocks,
    body: Box<dyn RigidBody>,
    base: Transform<f64>,
    prior: Prior,
    /// The effects that the model has.
    pub(crate) active: Vec<Place>,
    pub(crate) corrections: Corrections,
    /// Values of shape parameters that are not the catalogue's.
    shapes: Vec<(Place, f64)>,
    pub(crate) columns: Columns,
    pub(crate) motion: Motion,
    /// The CAD's centres of mass, m.
    coms: Vec<Vector3<f64>>,
    /// How many neighbouring windows of each joint say the same thing.
    pub(crate) memory: Vec<f64>,
    /// Each fold's own data, and the data of all others.
    pub(crate) tests: Vec<Vec<HeapFactor>>,
    trains: Vec<Vec<HeapFactor>>,
    pub(crate) all: Vec<HeapFactor>,
    pub(crate) fit: Fit,
}

/// The model fitted.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fit {
    /// θ by all data.
    pub(crate) theta: Vec<f64>,
    /// Standard deviations of the active entries, if residuals are independent; zero for the others.
    pub(crate) std: Vec<f64>,
    /// Noise of each joint: root mean square of its residuals, N m.
    pub(crate) noise: Vec<f64>,
    /// θ of each fold by the data of all others.
    pub(crate) held_out: Vec<Vec<f64>>,
    /// Sum of squared residuals \[fold\] \[joint\] of the fold's own data under that θ, (N m)².
    pub(crate) rss: Vec<Vec<f64>>,
}

/// What an effect would add.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) place: Place,
    /// Its parameters' entries.
    pub(crate) entries: Vec<usize>,
    /// How much the held-out sum of squares, in units of the joints' noise, falls in each fold.
    pub(crate) gains: Vec<f64>,
    /// Sum of squared residuals \[fold\] \[joint\] with it, (N m)².
    pub(crate) rss: Vec<Vec<f64>>,
    /// Its linear parameters (beyond neutral and correction) by all data.
    pub(crate) value: Vec<f64>,
    /// Their standard deviations: the larger of what independent residuals give and of the spread over folds.
    pub(crate) std: Vec<f64>,
    /// Size in units of its standard deviation, all parameters together.
    pub(crate) z: f64,
}

impl Candidate {
    /// The gain over all folds, and its error from their spread.
    pub(crate) fn gain(&self) -> (f64, f64) {
        sum_and_error(&self.gains)
    }
}

impl<'a> LimbCriticism<'a> {
    /// A limb with the effects of `model`; `None` if the limb is too large or the recording too short for folds.
    /// `with_candidates` also makes the columns of all that the model might lack.
    pub(crate) fn new(
        model: &'a Model,
        limb: &'a Limb,
        recording: &'a LimbRecording,
        with_candidates: bool,
    ) -> Option<Self> {
        let duration = recording.time_us.last()? - recording.time_us.first()?;
        let blocks = Blocks::of(duration);
        let mut criticism = Self {
            model,
            with_candidates,
            limb,
            recording,
            blocks,
            body: rigid_body::of_limb(model, limb)?,
            base: model.base(),
            prior: cad_prior(model, limb)?,
            active: Vec::new(),
            corrections: Corrections::none(recording.joints),
            shapes: Vec::new(),
            columns: Columns::default(),
            motion: Motion {
                states: Vec::new(),
                q: Vec::new(),
                dq: Vec::new(),
            },
            coms: coms(model, limb),
            memory: vec![1.0; recording.joints],
            tests: Vec::new(),
            trains: Vec::new(),
            all: Vec::new(),
            fit: Fit::default(),
        };
        criticism.take_effects();
        criticism.rebuild();
        if criticism.scan_shapes() {
            criticism.rebuild();
        }
        Some(criticism)
    }

    /// The model's effects at this limb, with the values that are not estimated from columns.
    fn take_effects(&mut self) {
        let first = self.limb.bodies.start;
        for e in self.model.effects() {
            let joint = match e.joint {
                BASE => BASE,
                joint if self.limb.bodies.contains(&joint) => joint - first,
                _ => continue,
            };
            self.active.push((e.effect, joint));
            let description = e.effect.description();
            if e.effect == EffectKind::VelocityGain
                && let Some(gain) = VelocityGain::of(self.recording, joint, self.blocks)
            {
                self.corrections.velocity_gain[joint] = gain.value;
            }
            for (n, estimate) in e.estimates.iter().enumerate() {
                let Some(estimate) = estimate else { continue };
                if description.parameters[n].shape {
                    self.set_shape((e.effect, joint), estimate.value);
                } else if let Some(correction) = self.corrections.get_mut(e.effect, joint, n) {
                    let is_gain = e.effect == EffectKind::TorqueGain;
                    *correction = if is_gain {
                        1.0 / estimate.value
                    } else {
                        estimate.value
                    };
                }
            }
        }
    }

    /// The value of an effect's shape parameter at a joint; one where it has none.
    pub(crate) fn shape(&self, place: Place) -> f64 {
        if let Some((_, shape)) = self.shapes.iter().find(|(known, _)| *known == place) {
            return *shape;
        }
        let parameters = place.0.description().parameters;
        let shape = parameters.iter().position(|p| p.shape);
        shape.map_or(1.0, |n| self.catalogue_prior(place, n).0)
    }

    /// Whether the model file gives the shape.
    pub(crate) fn is_shape_given(&self, (effect, joint): Place) -> bool {
        let Some(n) = effect.description().parameters.iter().position(|p| p.shape) else {
            return true;
        };
        let model = self.model.effect(effect, self.limb.bodies.start + joint);
        model.is_some_and(|e| e.estimates[n].is_some())
    }

    /// A joint's gear ratio; one where the motor is not known.
    pub(crate) fn gear(&self, joint: usize) -> f64 {
        let body = &self.model.robot().bodies()[self.limb.bodies.start + joint];
        body.motor.map_or(1.0, |motor| motor.gear)
    }

    pub(crate) fn set_shape(&mut self, place: Place, shape: f64) {
        self.shapes.retain(|(known, _)| *known != place);
        self.shapes.push((place, shape));
    }

    /// Mean and standard deviation of a parameter before any data.
    fn catalogue_prior(&self, (effect, joint): Place, parameter: usize) -> (f64, f64) {
        let body = if joint == BASE {
            self.limb.bodies.start
        } else {
            self.limb.bodies.start + joint
        };
        let prior = match parameter {
            0 => self.model.effect_prior(effect, body).prior,
            n => self.model.robot().parameter_prior(effect, body, n),
        };
        (prior.mean, prior.std)
    }

    /// Whether the recording can tell an effect at all.
    fn observable(&self, effect: EffectKind) -> bool {
        match effect {
            EffectKind::ThermalViscous => self.recording.temperature.iter().all(|t| t.is_finite()),
            // Positions tell the velocity's gain: see `super::velocity`.
            EffectKind::VelocityGain => false,
            _ => effect.description().form != Form::Force,
        }
    }

    /// Every effect that the model does not have, where it could be.
    fn possible(&self) -> Vec<Place> {
        if !self.with_candidates {
            return Vec::new();
        }
        let joints = self.recording.joints;
        let all = EffectKind::ALL
            .iter()
            .filter(|e| self.observable(**e))
            .flat_map(|&effect| {
                let places = if effect.description().form == Form::Gravity {
                    BASE..=BASE
                } else {
                    0..=joints - 1
                };
                places.map(move |joint| (effect, joint))
            });
        all.filter(|place| !self.active.contains(place)).collect()
    }

    fn entries_of(&self, place: Place, candidate: bool) -> Vec<Entry> {
        let (effect, joint) = place;
        if effect == EffectKind::VelocityGain {
            // Known from positions and taken out of the data.
            return Vec::new();
        }
        let parameters = effect.description().parameters;
        columns_of(effect, joint, self.shape(place))
            .into_iter()
            .map(|(parameter, column)| {
                let (mean, std) = self.catalogue_prior(place, parameter);
                let neutral = parameters[parameter].neutral;
                let none = Corrections::none(self.recording.joints);
                let correction = self.corrections.get(effect, joint, parameter)
                    - none.get(effect, joint, parameter);
                let (mean, std) = if candidate {
                    (0.0, std.max((mean - neutral).abs()))
                } else {
                    (mean - neutral - correction, std)
                };
                Entry {
                    effect: Some(effect),
                    joint,
                    parameter,
                    mean,
                    std,
                    column,
                }
            })
            .collect()
    }

    /// The present θ in the order of other columns; before there is one, the CAD.
    fn carried(&self, columns: &Columns) -> Vec<f64> {
        let same = |a: &Entry, b: &Entry| {
            (a.effect, a.joint, a.parameter) == (b.effect, b.joint, b.parameter)
        };
        let value = |entry: &Entry| {
            let known = self.columns.entries.iter().position(|old| same(old, entry));
            match (known.and_then(|k| self.fit.theta.get(k)), entry.effect) {
                (Some(value), _) => *value,
                (None, None) => {
                    self.model.inertia(self.limb.bodies.start + entry.joint).0[entry.parameter]
                }
                (None, Some(_)) => 0.0,
            }
        };
        columns.entries.iter().map(value).collect()
    }

    /// Moves what the fit says of corrections into them.
    fn absorb(&mut self) {
        for k in 0..self.fit.theta.len() {
            let entry = &self.columns.entries[k];
            let Some(effect) = entry.effect else { continue };
            if let Some(correction) = self
                .corrections
                .get_mut(effect, entry.joint, entry.parameter)
            {
                *correction += std::mem::take(&mut self.fit.theta[k]);
            }
        }
    }

    /// Goes over the data again: after a correction or a shape has changed.
    pub(crate) fn rebuild(&mut self) {
        self.absorb();
        let model = self
            .active
            .iter()
            .flat_map(|&place| self.entries_of(place, false));
        let rest = self
            .possible()
            .into_iter()
            .flat_map(|place| self.entries_of(place, true))
            .collect::<Vec<_>>();
        let ends = self
            .limb
            .bodies
            .clone()
            .map(|b| self.model.robot().subtree(b).end - self.limb.bodies.start);
        let columns = Columns::new(ends.collect(), model.chain(rest).collect());
        self.fit.theta = self.carried(&columns);
        self.columns = columns;
        self.motion = Motion::new(self.recording, &self.corrections);
        self.body.set_inertia(&self.fit.theta);
        let factors = BlockFactors::of(&self.rows());
        let folds = FOLDS.min(self.blocks.count);
        let fold = |b: usize| self.fold(b);
        self.tests = (0..folds)
            .map(|f| factors.sum(&self.columns, |b| fold(b) == f))
            .collect();
        let tests = BlockFactors {
            blocks: std::mem::take(&mut self.tests),
        };
        self.trains = (0..folds)
            .map(|f| tests.sum(&self.columns, |other| other != f))
            .collect();
        self.all = tests.sum(&self.columns, |_| true);
        self.tests = tests.blocks;
        self.refit();
    }

    /// The fold that a block of time belongs to.
    pub(crate) fn fold(&self, block: usize) -> usize {
        block * FOLDS.min(self.blocks.count) / self.blocks.count
    }

    /// θ as the model file gives it: the CAD where it gives no body, zero where an effect has no value.
    pub(crate) fn given(&self) -> Vec<f64> {
        let first = self.limb.bodies.start;
        let value = |entry: &Entry| {
            let Some(effect) = entry.effect else {
                return self.model.inertia(first + entry.joint).0[entry.parameter];
            };
            let joint = if entry.joint == BASE {
                BASE
            } else {
                first + entry.joint
            };
            let estimate = self
                .model
                .effect(effect, joint)
                .and_then(|e| e.estimates[entry.parameter]);
            let is_column = self
                .corrections
                .clone()
                .get_mut(effect, entry.joint, entry.parameter)
                .is_none();
            match estimate {
                Some(estimate) if is_column => {
                    estimate.value - effect.description().parameters[entry.parameter].neutral
                }
                // A correction has been taken out of the data.
                _ => 0.0,
            }
        };
        self.columns.entries.iter().map(value).collect()
    }

    /// The limb as rows are made of it.
    pub(crate) fn rows(&self) -> rows::Limb<'_> {
        let [roll, pitch] = self.corrections.tilt;
        let base = rows::turned(&self.base, &Vector3::new(roll, 0.0, 0.0));
        rows::Limb {
            recording: self.recording,
            motion: &self.motion,
            body: &*self.body,
            base: rows::turned(&base, &Vector3::new(0.0, pitch, 0.0)),
            columns: &self.columns,
            blocks: self.blocks,
            coms: &self.coms,
            model: self.columns.combined(&self.fit.theta),
            torque_scale: &self.corrections.torque_scale,
        }
    }

    /// The entries of the model: all inertial ones, then its effects'.
    pub(crate) fn active_entries(&self) -> Vec<usize> {
        self.entries_with(&self.active)
    }

    fn entries_with(&self, active: &[Place]) -> Vec<usize> {
        let is_active = |e: &Entry| {
            e.effect
                .is_none_or(|effect| active.contains(&(effect, e.joint)))
        };
        (0..self.columns.entries.len())
            .filter(|&k| is_active(&self.columns.entries[k]))
            .collect()
    }

    /// Fits the model: to all data and to the data of all folds but one. Each joint's noise is its own residual's.
    pub(crate) fn refit(&mut self) {
        let active = self.active_entries();
        let entries = self.columns.entries.len();
        let mut noise: Vec<f64> = self.all.iter().map(torque_size).collect();
        if self.fit.noise.len() == noise.len() {
            noise.clone_from(&self.fit.noise);
        }
        let mut fit = Fit::default();
        self.prior.relax();
        for _ in 0..ITERATIONS {
            let triangle =
                Triangle::new(&self.columns, &self.prior, &self.all, &noise, &active, &[]);
            fit.theta = triangle.solve(entries, &[]);
            fit.std = vec![0.0; entries];
            active
                .iter()
                .zip(triangle.std())
                .for_each(|(&k, std)| fit.std[k] = std);
            noise = self.residuals(&fit.theta, active.len());
            self.prior.hold(&fit.theta);
        }
        fit.held_out = self.solve_folds(&active, &noise);
        fit.rss = self.score(&fit.held_out);
        fit.noise = noise;
        self.fit = fit;
    }

    /// Root mean square of each joint's residuals under θ, of which so many entries were fitted, N m.
    fn residuals(&self, theta: &[f64], fitted: usize) -> Vec<f64> {
        let of = |(joint, factor): (usize, &HeapFactor)| {
            let square = misfit(&self.columns, joint, factor, theta);
            let freedom = (factor.rows() - fitted as f64 / self.recording.joints as f64).max(1.0);
            (square / freedom).sqrt().max(1e-3 * torque_size(factor))
        };
        self.all.iter().enumerate().map(of).collect()
    }

    /// Each joint's noise floor: what even all effects of the catalogue together, each within its prior, leave of its
    /// torque, N m.
    pub(crate) fn floor(&self) -> Vec<f64> {
        self.residuals(&self.saturated(), self.columns.entries.len())
    }

    /// θ with all effects of the catalogue in the model.
    pub(crate) fn saturated(&self) -> Vec<f64> {
        let all: Vec<usize> = (0..self.columns.entries.len()).collect();
        let triangle = Triangle::new(
            &self.columns,
            &self.prior,
            &self.all,
            &self.fit.noise,
            &all,
            &[],
        );
        triangle.solve(all.len(), &[])
    }

    fn solve_folds(&self, active: &[usize], noise: &[f64]) -> Vec<Vec<f64>> {
        let entries = self.columns.entries.len();
        let solve = |train: &Vec<HeapFactor>| {
            Triangle::new(&self.columns, &self.prior, train, noise, active, &[]).solve(entries, &[])
        };
        self.trains.iter().map(solve).collect()
    }

    /// Each fold's sum of squares, joint by joint, under its θ.
    fn score(&self, theta: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let of = |(test, theta): (&Vec<HeapFactor>, &Vec<f64>)| self.score_fold(test, theta);
        self.tests.iter().zip(theta).map(of).collect()
    }

    fn score_fold(&self, test: &[HeapFactor], theta: &[f64]) -> Vec<f64> {
        test.iter()
            .enumerate()
            .map(|(joint, factor)| misfit(&self.columns, joint, factor, theta))
            .collect()
    }

    /// Whether an effect of the model does nothing: the held-out error does not rise without it or, for one that is taken out
    /// of the data before, its value is within twice its error of none.
    pub(crate) fn is_superfluous(&self, place: Place) -> bool {
        let entries = self.columns.of_effect(place.0, place.1);
        let none = Corrections::none(self.recording.joints);
        let is_correction = none.clone().get_mut(place.0, place.1, 0).is_some();
        if is_correction {
            return entries.iter().all(|&k| {
                let parameter = self.columns.entries[k].parameter;
                let now = self.corrections.get(place.0, place.1, parameter) + self.fit.theta[k];
                (now - none.get(place.0, place.1, parameter)).abs() < 2.0 * self.fit.std[k]
            });
        }
        let rest: Vec<Place> = self
            .active
            .iter()
            .copied()
            .filter(|p| *p != place)
            .collect();
        let held_out = self.solve_folds(&self.entries_with(&rest), &self.fit.noise);
        let rss = self.score(&held_out);
        let rises = rss.iter().zip(&self.fit.rss);
        rises
            .map(|(without, with)| self.weighted_fall(without, with))
            .sum::<f64>()
            <= 0.0
    }

    fn weighted_fall(&self, before: &[f64], after: &[f64]) -> f64 {
        let falls = before.iter().zip(after).zip(&self.fit.noise);
        falls
            .map(|((before, after), noise)| (before - after) / (noise * noise))
            .sum()
    }

    /// What every effect that the model does not have would add, best first; `with` is taken to be in the model already.
    pub(crate) fn candidates(&self, with: Option<Place>) -> Vec<Candidate> {
        let mut active_places = self.active.clone();
        active_places.extend(with);
        let active = self.entries_with(&active_places);
        let places: Vec<Place> = self
            .possible()
            .into_iter()
            .filter(|p| Some(*p) != with)
            .collect();
        let groups: Vec<Vec<usize>> = places
            .iter()
            .map(|&(effect, joint)| self.columns.of_effect(effect, joint))
            .collect();
        let rest: Vec<usize> = groups.iter().flatten().copied().collect();
        let triangle = |data: &[HeapFactor]| {
            Triangle::new(
                &self.columns,
                &self.prior,
                data,
                &self.fit.noise,
                &active,
                &rest,
            )
        };
        let all = triangle(&self.all);
        let trains: Vec<Triangle> = self.trains.iter().map(|train| triangle(train)).collect();
        let base: Vec<Vec<f64>> = match with {
            None => self.fit.rss.clone(),
            Some(_) => {
                let theta: Vec<_> = trains
                    .iter()
                    .map(|t| t.solve(self.columns.entries.len(), &[]))
                    .collect();
                self.score(&theta)
            }
        };
        let mut candidates: Vec<Candidate> = places
            .iter()
            .zip(&groups)
            .filter_map(|(&place, group)| self.candidate(place, group, &all, &trains, &base))
            .collect();
        candidates.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
        candidates
    }

    fn candidate(
        &self,
        place: Place,
        group: &[usize],
        all: &Triangle,
        trains: &[Triangle],
        base: &[Vec<f64>],
    ) -> Option<Candidate> {
        let trial = all.trial(group)?;
        let (mut gains, mut rss, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for (fold, train) in trains.iter().enumerate() {
            let value = train.trial(group)?.value;
            let pairs: Vec<(usize, f64)> =
                group.iter().copied().zip(value.iter().copied()).collect();
            let theta = train.solve(self.columns.entries.len(), &pairs);
            let with = self.score_fold(&self.tests[fold], &theta);
            gains.push(self.weighted_fall(&base[fold], &with));
            rss.push(with);
            values.push(value);
        }
        let felt = (0..self.recording.joints)
            .filter(|&joint| self.columns.place(joint, group[0]).is_some());
        let memory = match place.1 {
            BASE => felt.map(|joint| self.memory[joint]).fold(1.0, f64::max),
            joint => self.memory[joint],
        };
        let (mut std, mut inflation) = (Vec::new(), 1.0f64);
        for (n, (value, independent)) in trial.value.iter().zip(&trial.std).enumerate() {
            let spread = jackknife(values.iter().map(|v| v[n]), *value);
            let independent = independent * memory.sqrt();
            inflation = inflation.max(spread / independent);
            std.push(independent.max(spread));
        }
        let freedom = group.len() as f64;
        let z = (trial.fall / memory - (freedom - 1.0)).max(0.0).sqrt() / inflation;
        Some(Candidate {
            place,
            entries: group.to_vec(),
            gains,
            rss,
            value: trial.value,
            std,
            z,
        })
    }

    /// The value of an effect's parameter, as the catalogue means it, where its entry has this value.
    pub(crate) fn value(&self, entry: usize, value: f64) -> f64 {
        let entry = &self.columns.entries[entry];
        let Some(effect) = entry.effect else {
            return value;
        };
        let neutral = effect.description().parameters[entry.parameter].neutral;
        let correction = self.corrections.get(effect, entry.joint, entry.parameter);
        match effect {
            // Corrections that start at their own neutral value; the second stands for its inverse.
            EffectKind::VelocityGain => correction + value,
            EffectKind::TorqueGain => 1.0 / (correction + value),
            _ => neutral + correction + value,
        }
    }

    /// A candidate's parameters as the catalogue means them, shapes included.
    pub(crate) fn parameters(&self, candidate: &Candidate) -> Vec<ParameterReport> {
        let report = |(n, parameter): (usize, &'static Parameter)| {
            let entry = candidate
                .entries
                .iter()
                .position(|&k| self.columns.entries[k].parameter == n);
            let (value, std) = match entry {
                None => (self.shape(candidate.place), 0.0),
                Some(k) => {
                    let (entry, value) = (candidate.entries[k], candidate.value[k]);
                    let span = self.value(entry, value + 1e-6) - self.value(entry, value - 1e-6);
                    (
                        self.value(entry, value),
                        candidate.std[k] * (span / 2e-6).abs(),
                    )
                }
            };
            ParameterReport {
                symbol: parameter.symbol,
                unit: parameter.unit,
                value,
                std,
            }
        };
        candidate
            .place
            .0
            .description()
            .parameters
            .iter()
            .enumerate()
            .map(report)
            .collect()
    }

    /// 1 − the held-out sum of squares with a candidate over that without, of the joints that feel it, and its error from
    /// the spread over folds.
    pub(crate) fn held_out_gain(&self, candidate: &Candidate) -> (f64, f64) {
        let feels = |joint: usize| self.columns.place(joint, candidate.entries[0]).is_some();
        let weighted = |rss: &[f64]| -> f64 {
            let felt = rss
                .iter()
                .zip(&self.fit.noise)
                .enumerate()
                .filter(|(joint, _)| feels(*joint));
            felt.map(|(_, (square, noise))| square / (noise * noise))
                .sum()
        };
        let without: f64 = self.fit.rss.iter().map(|rss| weighted(rss)).sum();
        let falls: Vec<f64> = self
            .fit
            .rss
            .iter()
            .zip(&candidate.rss)
            .map(|(a, b)| weighted(a) - weighted(b))
            .collect();
        let (fall, error) = sum_and_error(&falls);
        (fall / without, error / without)
    }

    /// Whether a candidate's value is physical within twice its error.
    pub(crate) fn in_bounds(&self, candidate: &Candidate) -> bool {
        self.within(
            candidate.place,
            &candidate.entries,
            &candidate.value,
            &candidate.std,
        )
    }

    fn within(&self, place: Place, entries: &[usize], value: &[f64], std: &[f64]) -> bool {
        let parameters = place.0.description().parameters;
        if place.0.description().form == Form::Inertia && value[0] < 2.0 * std[0] {
            // A first moment without a mass is no load.
            return false;
        }
        entries
            .iter()
            .zip(value.iter().zip(std))
            .all(|(&entry, (value, std))| {
                let parameter = &parameters[self.columns.entries[entry].parameter];
                let (lower, upper) = (
                    self.value(entry, value - 2.0 * std),
                    self.value(entry, value + 2.0 * std),
                );
                // One of them may be an inverse.
                lower.max(upper) >= parameter.lower && lower.min(upper) <= parameter.upper
            })
    }

    /// Takes an effect into the model.
    pub(crate) fn add(&mut self, place: Place) {
        self.active.push(place);
        self.refit();
    }

    /// Whether the model has an effect whose column is only a derivative, so that [`rebuild`](Self::rebuild) makes it better.
    pub(crate) fn is_linearised(&self) -> bool {
        self.active.iter().any(|&place| self.is_correction(place))
    }

    /// Whether an effect is taken out of the data before, and only its derivative is a column.
    pub(crate) fn is_correction(&self, (effect, joint): Place) -> bool {
        let mut none = Corrections::none(self.recording.joints);
        effect != EffectKind::VelocityGain && none.get_mut(effect, joint, 0).is_some()
    }

    /// Whether the fitted value of an effect of the model is physical within twice its error.
    pub(crate) fn is_physical(&self, place: Place) -> bool {
        let entries = self.columns.of_effect(place.0, place.1);
        let value = entries
            .iter()
            .map(|&k| self.fit.theta[k])
            .collect::<Vec<_>>();
        let std = entries.iter().map(|&k| self.fit.std[k]).collect::<Vec<_>>();
        self.within(place, &entries, &value, &std)
    }

    /// Takes an effect out of the model.
    pub(crate) fn remove(&mut self, place: Place) {
        self.active.retain(|p| *p != place);
        let none = Corrections::none(self.recording.joints);
        let mut corrected = false;
        for parameter in 0..place.0.description().parameters.len() {
            let neutral = none.get(place.0, place.1, parameter);
            if let Some(correction) = self.corrections.get_mut(place.0, place.1, parameter) {
                *correction = neutral;
                corrected = true;
            }
        }
        if corrected {
            self.rebuild();
        } else {
            self.refit();
        }
    }
}

/// Standard deviation of an estimate from its values without each fold in turn (Efron & Tibshirani 1993, ch. 11).
fn jackknife(values: impl ExactSizeIterator<Item = f64>, centre: f64) -> f64 {
    let n = values.len() as f64;
    let squares: f64 = values.map(|value| (value - centre).powi(2)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

/// Root mean square of a joint's torque, N m.
fn torque_size(factor: &HeapFactor) -> f64 {
    (factor.sum_of_squares(&[]) / factor.rows().max(1.0))
        .sqrt()
        .max(1e-9)
}

/// A sum over folds, and its standard error from their spread.
pub(crate) fn sum_and_error(folds: &[f64]) -> (f64, f64) {
    let n = folds.len() as f64;
    let sum: f64 = folds.iter().sum();
    let spread: f64 = folds.iter().map(|x| (x - sum / n).powi(2)).sum();
    (sum, (spread * n / (n - 1.0)).sqrt())
}

fn coms(model: &Model, limb: &Limb) -> Vec<Vector3<f64>> {
    let of = |b: usize| {
        let phi = &model.robot().bodies()[b].inertia;
        phi.first_moment() / phi.mass()
    };
    limb.bodies.clone().map(of).collect()
}

/// The CAD's bodies within the model's uncertainty.
fn cad_prior(model: &Model, limb: &Limb) -> Option<Prior> {
    let body = |b: usize| {
        let factor = model.robot().bodies()[b]
            .inertia
            .prior(model.cad_uncertainty(b))?;
        let rows = (0..INERTIAL).map(|k| {
            let mut row = [0.0; INERTIAL + 1];
            row[k..].copy_from_slice(factor.row(k));
            row
        });
        Some(rows.collect())
    };
    let bodies: Vec<_> = limb.bodies.clone().map(body).collect::<Option<_>>()?;
    Some(Prior {
        tightness: vec![1.0; bodies.len()],
        bodies,
    })
}
