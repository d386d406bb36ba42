//! One limb under criticism: its data as factors, its model so far, and what each effect of the catalogue would add.

mod candidate;
mod fit;

use nalgebra::Vector3;
use proprio_core::effect::{EffectKind, Form};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::blocks::{BlockFactors, HeapFactor};
use super::column::{BASE, Columns, Entry, columns_of};
use super::dot::dot;
use super::motion::{Corrections, Motion, MotorSide};
use super::recording::LimbRecording;
use super::rigid_body::{self, RigidBody};
use super::rows::{self, Blocks};
use super::triangle::Prior;
use super::velocity::VelocityGain;
use super::whitening::Whitening;
use super::windows::Windows;
pub(crate) use candidate::{Candidate, sum_and_error};
pub(crate) use fit::Fit;

use crate::model::{Limb, Model};

/// Folds of the held-out error: contiguous stretches of time, so that what is held out is not just like its neighbours.
pub(crate) const FOLDS: usize = 8;

/// Times that the noise's kind and the shapes are found from the fit that they give.
const NOISE_ROUNDS: usize = 2;

/// A load lighter than this is nowhere in particular, kg.
const LEAST_LOAD: f64 = 0.01;

/// An effect at a joint of a limb; [`BASE`] for the base's.
pub(crate) type Place = (EffectKind, usize);

/// A limb's data and its model.
pub(crate) struct LimbCriticism<'a> {
    pub(crate) model: &'a Model,
    pub(crate) with_candidates: bool,
    pub(crate) limb: &'a Limb,
    pub(crate) recording: &'a LimbRecording,
    pub(crate) blocks: Blocks,
    body: Box<dyn RigidBody>,
    base: Transform<f64>,
    pub(crate) prior: Prior,
    /// Samples in contact with the ground, as ranges \[first, last\]: their windows are left out.
    pub(crate) in_contact: Vec<[usize; 2]>,
    /// The effects that the model has.
    pub(crate) active: Vec<Place>,
    pub(crate) corrections: Corrections,
    /// Values of shape parameters that are not the catalogue's.
    shapes: Vec<(Place, f64)>,
    pub(crate) columns: Columns,
    pub(crate) motion: Motion,
    /// The windows' rows, as they were when the data were last gone over.
    pub(crate) windows: Windows,
    /// The CAD's centres of mass, m.
    coms: Vec<Vector3<f64>>,
    /// Where a load on each body is taken to be, m: at its centre of mass until it is known better.
    loads: Vec<Vector3<f64>>,
    /// How many neighbouring windows of each joint say the same thing.
    pub(crate) memory: Vec<f64>,
    /// Of each joint, the correlation of the noise of neighbouring windows.
    pub(crate) correlation: Vec<f64>,
    /// Each fold's own data as whitened rows, and the data of all others.
    pub(crate) tests: Vec<Vec<HeapFactor>>,
    trains: Vec<Vec<HeapFactor>>,
    pub(crate) all: Vec<HeapFactor>,
    pub(crate) fit: Fit,
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
            in_contact: Vec::new(),
            active: Vec::new(),
            corrections: Corrections::none(recording.joints),
            shapes: Vec::new(),
            columns: Columns::default(),
            motion: Motion::default(),
            windows: Windows::default(),
            coms: coms(model, limb),
            loads: coms(model, limb),
            memory: vec![1.0; recording.joints],
            correlation: vec![0.0; recording.joints],
            tests: Vec::new(),
            trains: Vec::new(),
            all: Vec::new(),
            fit: Fit::default(),
        };
        criticism.take_effects();
        criticism.rebuild();
        for _ in 0..NOISE_ROUNDS {
            if !criticism.scan_shapes() {
                break;
            }
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
            if let (EffectKind::Payload, [Some(mass), moment @ ..]) = (e.effect, &e.estimates)
                && mass.value >= LEAST_LOAD
            {
                for (axis, h) in moment.iter().enumerate().take(3) {
                    self.loads[joint][axis] += h.map_or(0.0, |h| h.value) / mass.value;
                }
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
        // Beside Coulomb friction it is a bias but at rest, with one parameter more.
        let twice = |(effect, joint): &Place| {
            *effect == EffectKind::AsymmetricCoulomb
                && self.active.contains(&(EffectKind::Coulomb, *joint))
        };
        all.filter(|place| !self.active.contains(place) && !twice(place))
            .collect()
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
        for body in 0..self.loads.len() {
            if self.active.contains(&(EffectKind::Payload, body)) {
                self.move_load(body);
            }
        }
    }

    /// Takes a load to be where the fit has its centre: from there on its first moment is zero.
    fn move_load(&mut self, body: usize) {
        let entries = self.columns.of_effect(EffectKind::Payload, body);
        let [mass, moment @ ..] = &entries[..] else {
            return;
        };
        let mass = self.fit.theta[*mass];
        if mass < LEAST_LOAD {
            return;
        }
        for (axis, entry) in moment.iter().enumerate().take(3) {
            self.loads[body][axis] += std::mem::take(&mut self.fit.theta[*entry]) / mass;
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
        // Before new ones come: memory need not hold both.
        self.forget_windows();
        self.body.set_inertia(&self.fit.theta);
        self.motion = Motion::new(self.recording, &self.corrections, &self.motors());
        self.windows = Windows::of(&self.rows());
        self.refold();
    }

    /// Makes the factors of the windows anew: after the noise is known better.
    pub(crate) fn refold(&mut self) {
        let mut windows = std::mem::take(&mut self.windows);
        windows.follow(&self.rows());
        self.windows = windows;
        let tests = self.fold_windows(|_| true);
        (self.trains, self.all) = tests.without_each(&self.columns);
        self.tests = tests.blocks;
        self.refit();
    }

    /// Forgets what grows with the recording's length; the factors stay.
    pub(crate) fn forget_windows(&mut self) {
        (self.motion, self.windows) = Default::default();
    }

    /// The factors of each fold's chosen windows, which are told by their place in time.
    pub(crate) fn fold_windows(&self, chosen: impl Fn(usize) -> bool) -> BlockFactors {
        let mut factors = BlockFactors::none(&self.columns, FOLDS.min(self.blocks.count));
        let mut whitening = Whitening::of_joints(&self.correlation);
        let mut buffer = Vec::new();
        for (_, window) in (self.windows.iter().enumerate()).filter(|(w, _)| chosen(*w)) {
            factors.fold(
                &window,
                self.fold(window.block),
                &mut whitening,
                &mut buffer,
            );
        }
        factors
    }

    /// What the motors take up, as far as the model knows: as fitted, and before there is a fit as the catalogue expects it.
    fn motors(&self) -> Vec<MotorSide> {
        let value = |effect: EffectKind, joint: usize| {
            if !self.active.contains(&(effect, joint)) {
                return 0.0;
            }
            let (mean, _) = self.catalogue_prior((effect, joint), 0);
            let fitted = self.columns.of_effect(effect, joint);
            let fitted = fitted.first().and_then(|&k| self.fit.theta.get(k));
            match fitted {
                Some(value) if !self.fit.noise.is_empty() => *value,
                _ => mean,
            }
        };
        let of = |joint: usize| MotorSide {
            armature: value(EffectKind::Armature, joint),
            viscous: value(EffectKind::Viscous, joint),
            coulomb: value(EffectKind::Coulomb, joint),
            bias: value(EffectKind::Bias, joint),
            link: self.inertia_at(joint),
        };
        (0..self.recording.joints).map(of).collect()
    }

    /// The inertia that a joint turns with the others at rest, in the middle of its range in this recording, kg m².
    fn inertia_at(&self, joint: usize) -> f64 {
        let n = self.recording.joints;
        let count = self.recording.len().max(1) as f64;
        let mean = |j: usize| self.recording.q.iter().skip(j).step_by(n).sum::<f64>() / count;
        let q: Vec<f64> = (0..n).map(mean).collect();
        let torque = |acceleration: f64| -> f64 {
            let mut ddq = vec![0.0; n];
            ddq[joint] = acceleration;
            let width = INERTIAL * n;
            let mut rows = vec![0.0; n * width];
            self.body
                .torque_regressor(&self.base, [&q, &vec![0.0; n], &ddq], &mut rows);
            dot(
                &rows[joint * width..(joint + 1) * width],
                &self.fit.theta[..width],
            )
        };
        (torque(1.0) - torque(0.0)).max(1e-4)
    }

    /// The recording as factors of blocks of time, with the present columns and corrections.
    pub(crate) fn block_factors(&self) -> BlockFactors {
        BlockFactors::of(&self.rows(), &self.correlation)
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
                // The load is where its first moment is zero.
                _ if effect == EffectKind::Payload && (1..=3).contains(&entry.parameter) => 0.0,
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
            loads: &self.loads,
            model: self.columns.combined(&self.fit.theta),
            torque_scale: &self.corrections.torque_scale,
            left_out: &self.in_contact,
        }
    }
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
