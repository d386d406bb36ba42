//! One limb under criticism: its data as factors, its model so far, and what each effect of the catalogue would add.

mod candidate;
mod fit;
mod gap;
mod parameters;

use nalgebra::Vector3;
use proprio_core::effect::EffectKind;
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::blocks::{BlockFactors, HeapFactor};
use super::column::{BASE, Columns};
use super::folds::Blocks;
use super::motion::{Corrections, Motion};
use super::recording::LimbRecording;
use super::rigid_body::{self, RigidBody};
use super::rows;
use super::triangle::Prior;
use super::velocity::VelocityGain;
use super::whitening::Whitening;
use super::windows::Windows;
pub(crate) use candidate::{Candidate, sum_and_error};
pub(crate) use fit::{Fit, Squares, weighted};
use parameters::LEAST_LOAD;

use crate::model::{Limb, Model};

/// Times that the noise's kind and the shapes are found from the fit that they give.
const NOISE_ROUNDS: usize = 2;

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
    /// What the gaps that were found are uncertain by, rad.
    gap_std: Vec<f64>,
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
        Self::without(model, limb, recording, with_candidates, Vec::new())
    }

    /// The same but for what is in contact, ranges of samples \[first, last\], ascending.
    pub(crate) fn without(
        model: &'a Model,
        limb: &'a Limb,
        recording: &'a LimbRecording,
        with_candidates: bool,
        in_contact: Vec<[usize; 2]>,
    ) -> Option<Self> {
        let blocks = Blocks::of(recording)?;
        let mut criticism = Self {
            model,
            with_candidates,
            limb,
            recording,
            blocks,
            body: rigid_body::of_limb(model, limb)?,
            base: model.base(),
            prior: cad_prior(model, limb)?,
            in_contact,
            active: Vec::new(),
            corrections: Corrections::none(recording.joints),
            gap_std: vec![0.0; recording.joints],
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
        criticism.find_gaps();
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
                && let Some(gain) = VelocityGain::of(self.recording, joint, &self.blocks)
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
                if e.effect == EffectKind::Backlash {
                    self.gap_std[joint] = estimate.std.unwrap_or(0.0);
                }
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
        let follow = self.torque_to_follow();
        self.motion = Motion::new(self.recording, &self.corrections, &self.motors(), &follow);
        self.windows = Windows::of(&self.rows());
        self.refold();
    }

    /// Makes the factors of the windows anew: after the noise is known better.
    pub(crate) fn refold(&mut self) {
        self.follow();
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
        let mut factors = BlockFactors::none(&self.columns, self.blocks.folds);
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

    /// The windows as factors of whitened rows, block by block of time, with the present columns and corrections.
    pub(crate) fn block_factors(&mut self) -> BlockFactors {
        self.follow();
        let mut factors = BlockFactors::none(&self.columns, self.blocks.count());
        let mut whitening = Whitening::of_joints(&self.correlation);
        let mut buffer = Vec::new();
        for window in self.windows.iter() {
            factors.fold(&window, window.block, &mut whitening, &mut buffer);
        }
        factors
    }

    /// Writes those columns of the windows anew that are made of the model itself.
    fn follow(&mut self) {
        let mut windows = std::mem::take(&mut self.windows);
        windows.follow(&self.rows());
        self.windows = windows;
    }

    /// The fold that a block of time belongs to.
    pub(crate) fn fold(&self, block: usize) -> usize {
        self.blocks.fold(block)
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
            blocks: &self.blocks,
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
