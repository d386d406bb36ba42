//! A limb's data as an estimator takes them: its motion, and apart from it the torque that was measured.

use std::sync::Arc;

use proprio_core::effect::{Enters, Form, Input, Moved, Shapes, Transmission};
use proprio_core::inertia::InertialParameters;

use super::directions::Directions;
use crate::equation::body::LimbBody;
use crate::equation::column::{Columns, Entry, columns_of};
use crate::equation::contribution::{Contribution, contributions};
use crate::equation::coupled_springs;
use crate::equation::folds::Blocks;
use crate::equation::integrals::Integrals;
use crate::equation::motion::{Motion, Window};
use crate::equation::recoil::Recoil;
use crate::equation::rows::Rows;
use crate::equation::values::{Place, Values, places};
use crate::equation::velocity::VelocityGain;
use crate::model::{BASE, JointKind, Limb, Model};
use crate::parallel::by_number;
use crate::parameter::{INERTIAL_NAMES, name_at, of_effect};
use crate::predict::{self, LooseLink, predict};
use crate::recording::LimbRecording;
use crate::signs::Signs;

/// How long links swing that these values' springs and dampers hold, s; nothing where no damper is known.
fn settling(motion: &Motion, body: &LimbBody, values: &Values) -> f64 {
    let of = |joint: usize| {
        let damping = values.damper(joint)?;
        let swings = values.transmission(Transmission::Spring, joint, 0) > 0.0
            && motion.link(joint).is_none();
        let inertia = motion.usual_inertia(body, values)[(joint, joint)];
        swings.then(|| coupled_springs::settling(inertia, damping))
    };
    (0..motion.joints).filter_map(of).fold(0.0, f64::max)
}

/// A limb's data. Made once; fits read them. A copy shares them.
#[derive(Clone)]
pub(crate) struct LimbData<'a> {
    /// The robot and what is known of it before these data.
    pub(crate) model: &'a Model,
    pub(crate) limb: &'a Limb,
    pub(crate) recording: &'a LimbRecording,
    pub(crate) blocks: Blocks,
    pub(crate) body: Arc<LimbBody<'a>>,
    pub(crate) motion: Arc<Motion>,
    /// Mean measured torque of each window's joints, N m.
    pub(crate) torque: Arc<Vec<f64>>,
    /// Windows that are left out, ground contact among them.
    pub(crate) left_out: Vec<bool>,
    /// How long after a gap links swing that the model's springs and dampers hold, s: what they did before is not known.
    settling: f64,
    /// Whether joints are judged also while they rest.
    at_rest: bool,
    /// Reported over true velocity of each joint, as the motion was made with.
    pub(crate) velocity_gain: Vec<f64>,
    /// How many times less certain each body is than the model states.
    less_certain: Vec<f64>,
    subtree_end: Vec<usize>,
    /// What of rows the motion alone makes.
    integrals: Arc<Integrals>,
    /// What of scans the motion and the windows that count make.
    pub(super) directions: Arc<Directions>,
}

impl<'a> LimbData<'a> {
    /// The data of a limb; `None` if it is too large or was not recorded. The velocity gains of a model that names them are taken
    /// out of the motion.
    pub(crate) fn of(
        model: &'a Model,
        limb: &'a Limb,
        recording: &'a LimbRecording,
    ) -> Option<Self> {
        let blocks = Blocks::of(recording)?;
        let velocity_gain = gains(model, limb, recording, &blocks);
        let motion = Motion::of(recording, &blocks, &velocity_gain);
        Self::cut(model, limb, recording, velocity_gain, motion)
    }

    /// The same with these velocity gains.
    pub(crate) fn with_gains(&self, velocity_gain: Vec<f64>) -> Self {
        if velocity_gain == self.velocity_gain {
            return self.clone();
        }
        Self {
            motion: Arc::new(self.felt(Motion::of(self.recording, &self.blocks, &velocity_gain))),
            velocity_gain,
            integrals: Arc::default(),
            directions: Arc::default(),
            ..self.clone()
        }
    }

    /// Adds what its joints feel of a base that all limbs move: of data of which there is no copy yet.
    pub(super) fn feel(&mut self, recoil: Recoil) {
        if let Some(motion) = Arc::get_mut(&mut self.motion) {
            motion.recoil = Some(Arc::new(recoil));
        }
    }

    /// Another motion of the same samples, with what these data's has of the base.
    fn felt(&self, mut motion: Motion) -> Motion {
        motion.recoil.clone_from(&self.motion.recoil);
        motion
    }

    /// The same with velocities as they were reported.
    pub(crate) fn as_reported(&self) -> Self {
        self.with_gains(vec![1.0; self.joints()])
    }

    /// The same with a window around each sample ([`Motion::at_samples`]), none left out, also where joints rest.
    pub(crate) fn at_samples(&self) -> Option<Self> {
        let (recording, gains) = (self.recording, &self.velocity_gain);
        let motion = self.felt(Motion::at_samples(recording, &self.blocks, gains));
        Some(Self::cut(self.model, self.limb, recording, gains.clone(), motion)?.also_at_rest())
    }

    /// The same with every third of those windows: no two have a sample in common, so that their noise has none.
    #[cfg(feature = "mcap")]
    pub(crate) fn at_samples_apart(&self) -> Option<Self> {
        let (recording, gains) = (self.recording, &self.velocity_gain);
        let mut motion = self.felt(Motion::at_samples(recording, &self.blocks, gains));
        motion.windows = motion.windows.into_iter().step_by(3).collect();
        Some(Self::cut(self.model, self.limb, recording, gains.clone(), motion)?.also_at_rest())
    }

    /// Made of a motion that is cut into windows already.
    fn cut(
        model: &'a Model,
        limb: &'a Limb,
        recording: &'a LimbRecording,
        velocity_gain: Vec<f64>,
        motion: Motion,
    ) -> Option<Self> {
        let blocks = Blocks::of(recording)?;
        let motion = Arc::new(motion);
        let n = recording.joints;
        let torque: Vec<f64> = (motion.windows.iter())
            .flat_map(|window| {
                let mean = |j: usize| motion.mean(window, |k| recording.tau[k * n + j]);
                (0..n).map(mean).collect::<Vec<_>>()
            })
            .collect();
        let first = limb.bodies.start;
        let end = |b: usize| model.robot().subtree(b).end - first;
        let body = Arc::new(LimbBody::of(model, limb)?);
        let settling = settling(&motion, &body, &Values::given(model, limb));
        let mut own = Self {
            body,
            settling,
            left_out: Vec::new(),
            at_rest: false,
            less_certain: vec![1.0; n],
            subtree_end: limb.bodies.clone().map(end).collect(),
            model,
            limb,
            recording,
            blocks,
            motion,
            torque: Arc::new(torque),
            velocity_gain,
            integrals: Arc::default(),
            directions: Arc::default(),
        };
        own.left_out = (own.motion.windows.iter())
            .map(|window| own.is_never_judged(window))
            .collect();
        Some(own)
    }

    /// Whether nothing is judged in a window: it is not asked for, or its links swing still from what was before a gap.
    fn is_never_judged(&self, window: &Window) -> bool {
        is_not_asked(self.recording, window.samples)
            || self.settling > 0.0 && self.motion.seen_before(window) < self.settling
    }

    /// The same without windows in which a joint rests.
    pub(crate) fn in_motion(mut self) -> Self {
        self.at_rest = false;
        self.directions = Arc::default();
        self
    }

    /// The same with windows in which a joint rests: a prediction can be judged there, but no friction fitted that does not know
    /// how the joint came to rest.
    pub(crate) fn also_at_rest(mut self) -> Self {
        self.at_rest = true;
        self.directions = Arc::default();
        self
    }

    /// The same without the windows that overlap a range of samples \[first, last\], ascending.
    pub(crate) fn without(mut self, ranges: &[[usize; 2]]) -> Self {
        let is_out = |window: &Window| {
            let [first, last] = window.samples;
            let next = ranges.partition_point(|range| range[1] <= first);
            let own = ranges.get(next).is_some_and(|range| range[0] < last);
            own || self.is_never_judged(window)
        };
        self.left_out = self.motion.windows.iter().map(is_out).collect();
        self.directions = Arc::default();
        self
    }

    /// The same with windows left out as another one's of the same recording are.
    pub(crate) fn leaving_out(mut self, left_out: &[bool]) -> Self {
        if left_out.len() == self.left_out.len() {
            self.left_out.copy_from_slice(left_out);
            self.directions = Arc::default();
        }
        self
    }

    /// The same in the windows in which `other` data of the same recording are judged.
    pub(crate) fn judged_as(self, other: &Self) -> Self {
        Self {
            at_rest: other.at_rest,
            ..self.leaving_out(&other.left_out)
        }
    }

    /// The same without one fold's windows.
    pub(crate) fn without_fold(&self, fold: usize) -> Self {
        let mut data = self.clone();
        for w in 0..data.left_out.len() {
            data.left_out[w] |= self.fold(w) == fold;
        }
        data.directions = Arc::default();
        data
    }

    /// How many joints.
    pub(crate) fn joints(&self) -> usize {
        self.recording.joints
    }

    /// Whether a joint's torque is judged in a window: it moves, or rest counts too, and nothing is known to spoil it.
    pub(crate) fn counts(&self, window: usize, joint: usize) -> bool {
        !self.left_out[window] && (self.at_rest || self.motion.windows[window].judged[joint])
    }

    /// The fold that a window belongs to.
    pub(crate) fn fold(&self, window: usize) -> usize {
        self.blocks.fold(self.motion.windows[window].block)
    }

    /// Windows in which each joint is judged.
    pub(crate) fn windows(&self) -> Vec<f64> {
        let count = |j: usize| {
            (0..self.motion.windows.len())
                .filter(|&w| self.counts(w, j))
                .count()
        };
        (0..self.joints()).map(|j| count(j) as f64).collect()
    }

    /// What a model predicts in each window, joint by joint, N m; zero for windows that are not chosen.
    pub(crate) fn predicted(&self, values: &Values, chosen: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let chosen = |w: usize| chosen(w) && !self.left_out[w];
        predict(&self.body, &self.motion, values, &self.subtree_end, &chosen)
    }

    /// What a complete model of these values would have left of the same motion, measured once more: the torque is what the model says, with what is left
    /// of the measured one as noise, each window's with a sign that is drawn and so much of it that no more is left than was. Beside it what the model
    /// then predicts, and how far that is off for the motion alone, N m.
    pub(crate) fn as_if_complete(&self, values: &Values) -> (Self, [Vec<f64>; 2]) {
        let n = self.joints();
        let motion = self
            .motion
            .measured_again(self.recording, &self.velocity_gain);
        let mut again = Self {
            motion: Arc::new(motion),
            integrals: Arc::default(),
            directions: Arc::default(),
            ..self.clone()
        };
        let (once, twice) = (
            self.predicted(values, &|_| true),
            again.predicted(values, &|_| true),
        );
        let squares = |of: &dyn Fn(usize) -> f64, joint: usize| -> f64 {
            let counting = (0..self.left_out.len()).filter(|&w| self.counts(w, joint));
            counting.map(|w| of(w * n + joint).powi(2)).sum()
        };
        let left = |k: usize| self.torque[k] - once[k];
        let share = |joint: usize| {
            let by_motion = squares(&|k| twice[k] - once[k], joint);
            let all = squares(&left, joint).max(f64::MIN_POSITIVE);
            (1.0 - by_motion / all).max(0.0).sqrt()
        };
        let shares: Vec<f64> = (0..n).map(share).collect();
        let mut signs = Signs::new();
        let torque = (0..once.len()).map(|k| once[k] + shares[k % n] * signs.of(left(k)));
        again.torque = Arc::new(torque.collect());
        let off = once.iter().zip(&twice).map(|(once, twice)| once - twice);
        let off = off.collect();
        (again, [twice, off])
    }

    /// What the CAD's rigid body alone predicts, from velocities as they were reported, N m.
    pub(crate) fn predicted_by_cad(&self) -> Vec<f64> {
        let cad = Values::cad(self.model, self.limb);
        self.as_reported().predicted(&cad, &|_| true)
    }

    /// What a model predicts with the values that its file gives, N m: an effect without one does nothing.
    pub(crate) fn predicted_as_given(&self, model: &Model) -> Vec<f64> {
        let gains = gains(model, self.limb, self.recording, &self.blocks);
        let values = Values::given(model, self.limb);
        self.with_gains(gains).predicted(&values, &|_| true)
    }

    /// What a model of these values predicts, with what it lacks of the motion put back: of each joint, so much of what smoothing has regained
    /// ([`crate::equation::motion::Motion::unfollowed`]) as leaves least. What both have in common is motion that the channels do not tell, and no effect.
    pub(crate) fn with_unfollowed(&self, values: &Values, mut predicted: Vec<f64>) -> Vec<f64> {
        let n = self.joints();
        for joint in 0..n {
            let unfollowed = self.motion.unfollowed(&self.body, values, joint);
            let counting = || (0..unfollowed.len()).filter(|&w| self.counts(w, joint));
            let left = |w: usize| self.torque[w * n + joint] - predicted[w * n + joint];
            let product: f64 = counting().map(|w| unfollowed[w] * left(w)).sum();
            let square: f64 = counting().map(|w| unfollowed[w].powi(2)).sum();
            // Regained of a motion, that motion is lacking, and up to the smoother's cutoff no more of it than was regained: what is to the other side
            // or larger is something else.
            let share = (product / square.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            for (w, unfollowed) in unfollowed.iter().enumerate() {
                predicted[w * n + joint] += share * unfollowed;
            }
        }
        predicted
    }

    /// Of each joint the effects of a model that add to its torque.
    pub(crate) fn contributions(&self, values: &Values) -> Vec<Vec<Contribution>> {
        contributions(&predict::columns(values, &self.subtree_end), values)
    }

    /// The predictor of a model with one of its links looser or less loose, of the windows that are chosen.
    pub(crate) fn loose_link<'b>(
        &'b self,
        values: &Values,
        place: Place,
        chosen: &'b (dyn Fn(usize) -> bool + Sync),
    ) -> LooseLink<'b> {
        let of = (values, place);
        LooseLink::of(&self.body, &self.motion, of, &self.subtree_end, chosen)
    }

    /// The rows of columns at a model's values, of all windows that are not left out.
    pub(crate) fn rows(&self, values: &Values, columns: &Columns) -> Rows {
        self.rows_of(values, columns, &|_| true)
    }

    /// The same of the windows that are chosen.
    pub(crate) fn rows_of(
        &self,
        values: &Values,
        columns: &Columns,
        chosen: &(dyn Fn(usize) -> bool + Sync),
    ) -> Rows {
        let chosen = |w: usize| chosen(w) && !self.left_out[w];
        let (body, motion) = (&self.body, &self.motion);
        Rows::of(motion, body, &self.integrals, values, columns, &chosen)
    }

    /// Each body as the model states it, and its relative uncertainty.
    pub(crate) fn bodies_stated(&self) -> Vec<(InertialParameters<f64>, f64)> {
        let of = |b: usize| {
            let body = &self.model.robot().bodies()[b];
            (body.inertia, self.model.cad_uncertainty(b))
        };
        self.limb.bodies.clone().map(of).collect()
    }

    /// The same as a fit begins with it: of bodies that are released, less certain.
    pub(crate) fn bodies_before(&self) -> Vec<(InertialParameters<f64>, f64)> {
        let stated = self.bodies_stated().into_iter().zip(&self.less_certain);
        stated
            .map(|((cad, relative), times)| (cad, times * relative))
            .collect()
    }

    /// The same data, each body as many times less certain than the model states.
    pub(crate) fn with_bodies(&self, less_certain: Vec<f64>) -> Self {
        Self {
            less_certain,
            ..self.clone()
        }
    }

    /// The same data under the same model, some of its joints elsewhere.
    pub(crate) fn with_geometry<'b>(&self, model: &'b Model) -> Option<LimbData<'b>>
    where
        'a: 'b,
    {
        Some(LimbData {
            model,
            body: Arc::new(LimbBody::of(model, self.limb)?),
            integrals: Arc::default(),
            directions: Arc::default(),
            ..self.clone()
        })
    }

    /// What models predict, each of the windows of its own fold, N m.
    pub(crate) fn predicted_by_fold(&self, values: &[Values]) -> Vec<f64> {
        let parts = by_number(0..values.len(), |fold| {
            self.predicted(&values[fold], &|w| self.fold(w) == fold)
        });
        let mut torque = vec![0.0; self.torque.len()];
        for part in parts {
            // Windows of other folds are zero.
            torque
                .iter_mut()
                .zip(part)
                .for_each(|(to, from)| *to += from);
        }
        torque
    }

    /// Noise of each joint's windows before there is a fit, N m: a twentieth of its torque, as well as models of drives do. It is for
    /// weighing doubts in the first pass alone.
    pub(super) fn typical_noise(&self) -> Vec<f64> {
        const SHARE: f64 = 0.05;
        let zero = vec![0.0; self.torque.len()];
        let squares = self.squares(&zero).by_joint();
        let rms = squares
            .iter()
            .zip(self.windows())
            .map(|(square, n)| (square / n.max(1.0)).sqrt());
        rms.map(|rms| (SHARE * rms).max(1e-9)).collect()
    }

    /// Sums of the squared differences of measured and predicted torque, (N m)².
    pub(crate) fn squares(&self, predicted: &[f64]) -> Squares {
        let n = self.joints();
        let mut squares = Squares {
            cells: vec![vec![0.0; n]; self.blocks.folds],
        };
        for w in 0..self.motion.windows.len() {
            for j in (0..n).filter(|&j| self.counts(w, j)) {
                let at = w * n + j;
                squares.cells[self.fold(w)][j] += (self.torque[at] - predicted[at]).powi(2);
            }
        }
        squares
    }

    /// The columns of a model's effects `of` and of `candidates` that it might lack, at its values.
    pub(crate) fn columns(&self, values: &Values, of: &[Place], candidates: &[Place]) -> Columns {
        let own = of
            .iter()
            .flat_map(|&place| self.entries(place, values, false));
        let more = candidates
            .iter()
            .flat_map(|&place| self.entries(place, values, true));
        Columns::new(self.subtree_end.clone(), own.chain(more).collect())
    }

    /// The columns of one effect, without the bodies.
    pub(super) fn columns_of_effect(&self, place: Place, values: &Values) -> Columns {
        let own = self.entries(place, values, false);
        Columns::of_effects(self.subtree_end.clone(), own)
    }

    /// Mean and standard deviation of an effect's parameter before any data.
    pub(crate) fn prior(&self, (effect, joint): Place, parameter: usize) -> (f64, f64) {
        let first = self.limb.bodies.start;
        let [site, body] = match joint {
            BASE => [BASE, first],
            joint => [first + joint; 2],
        };
        let prior = match parameter {
            0 => self.model.effect_prior_at(effect, site, body).prior,
            n => self.model.robot().parameter_prior(effect, body, n),
        };
        (prior.mean, prior.std)
    }

    /// Whether the model has an effect at a joint.
    pub(crate) fn has(&self, place: Place) -> bool {
        places(self.model, self.limb).any(|(known, _)| known == place)
    }

    /// Whether a joint slides.
    pub(crate) fn slides(&self, joint: usize) -> bool {
        self.model.robot().bodies()[self.body_of(joint)].kind == JointKind::Prismatic
    }

    /// Whether the recorded torque can tell an effect at a joint at all.
    pub(crate) fn can_tell(&self, (effect, joint): Place) -> bool {
        let description = effect.description();
        let senses = match description.input {
            Input::Temperature => self.motion.temperature.iter().all(|t| t.is_finite()),
            Input::Base => self.motion.recoil.is_some(),
            _ => true,
        };
        senses
            && (description.form != Form::Motion(Moved::OncePerTurn) || !self.slides(joint))
            && !matches!(description.enters, Enters::Positions | Enters::Direction)
            // With a second encoder positions determine what lies between motor and link.
            && !(description.is_compliant() && self.motion.link(joint).is_some())
    }

    /// Whether an effect is as the model gives it, whatever the torque: what hardly shows in one.
    pub(crate) fn is_given(&self, (effect, joint): Place) -> bool {
        let is_inside = effect.description().transmission() == Some(Transmission::SpringFriction);
        is_inside && self.motion.link(joint).is_none()
    }

    /// An effect's parameter where a fit begins: as given where the torque does not tell it, else as expected.
    pub(crate) fn begins_at(&self, place: Place, n: usize) -> f64 {
        let known = places(self.model, self.limb).find(|(known, _)| *known == place);
        let given = known.and_then(|(_, e)| e.estimates[n]);
        let given = given.filter(|_| self.is_given(place));
        given.map_or_else(|| self.prior(place, n).0, |given| given.value)
    }

    /// The entries of an effect. What a candidate might be is as likely on either side of nothing.
    fn entries(&self, place: Place, values: &Values, candidate: bool) -> Vec<Entry> {
        let (effect, joint) = place;
        let mut shapes = values.shapes(place);
        if !values.has(place) {
            for (shape, n) in shapes.iter_mut().zip(effect.description().shapes()) {
                *shape = self.prior(place, n).0;
            }
        }
        self.entries_of_shapes(place, shapes)
            .into_iter()
            .map(|entry| {
                let (mean, std) = self.prior(place, entry.parameter);
                let neutral = effect.description().parameters[entry.parameter].neutral;
                let (mean, std) = match (candidate, effect.description().is_derivative()) {
                    (true, _) => (0.0, std.max((mean - neutral).abs())),
                    (false, true) => (mean - values.get((effect, joint), entry.parameter), std),
                    (false, false) => (mean, std),
                };
                Entry { mean, std, ..entry }
            })
            .collect()
    }

    /// The entries of an effect with these shapes, without a prior.
    fn entries_of_shapes(&self, place: Place, shapes: Shapes) -> Vec<Entry> {
        let entry = |(parameter, column)| Entry {
            effect: Some(place.0),
            joint: place.1,
            parameter,
            mean: 0.0,
            std: f64::INFINITY,
            column,
        };
        columns_of(place, shapes).into_iter().map(entry).collect()
    }

    /// The name of an entry: `m:FR_hip`, `coulomb:FR_hip`, `stribeck.vs:FR_hip`.
    pub(crate) fn name(&self, entry: &Entry) -> String {
        let joint = self.model.joint_name(self.body_of(entry.joint));
        match entry.effect {
            None => name_at(INERTIAL_NAMES[entry.parameter].0, joint),
            Some(effect) => of_effect(effect, entry.parameter, joint),
        }
    }

    /// The robot's index of a joint of the limb; [`BASE`] stays.
    pub(crate) fn body_of(&self, joint: usize) -> usize {
        if joint == BASE {
            BASE
        } else {
            self.limb.bodies.start + joint
        }
    }

    /// The joints' names.
    pub(crate) fn joint_names(&self) -> Vec<String> {
        self.limb
            .bodies
            .clone()
            .map(|b| self.model.joint_name(b).to_owned())
            .collect()
    }

    /// The model that θ over columns made at `values` stands for; it has the effects that `values` has.
    pub(crate) fn moved(&self, values: &Values, columns: &Columns, theta: &[f64]) -> Values {
        let mut to = values.clone();
        for (k, entry) in columns.entries.iter().enumerate() {
            match entry.effect {
                None => to.bodies[entry.joint][entry.parameter] = theta[k],
                Some(effect) => {
                    let value = self.value(values, columns, k, theta);
                    to.set((effect, entry.joint), entry.parameter, value);
                }
            }
        }
        to
    }

    /// What θ's entry k says of its parameter, as the catalogue means it.
    pub(crate) fn value(&self, values: &Values, columns: &Columns, k: usize, theta: &[f64]) -> f64 {
        let (entry, number) = (&columns.entries[k], theta[k]);
        let Some(effect) = entry.effect else {
            return number;
        };
        let place = (effect, entry.joint);
        let description = effect.description();
        if description.is_derivative() {
            let p = &description.parameters[entry.parameter];
            // A scale of nothing is none.
            let lower = if description.form == Form::Scale {
                0.05
            } else {
                p.lower
            };
            return (values.get(place, entry.parameter) + number).clamp(lower, p.upper);
        }
        if description.form == Form::Inertia && (1..=3).contains(&entry.parameter) {
            let mass = columns.of_effect(effect, entry.joint)[0];
            let away = values.load_at(entry.joint, &self.body.coms[entry.joint])
                - self.body.coms[entry.joint];
            return number + theta[mass] * away[entry.parameter - 1];
        }
        number
    }
}

/// Whether a window, by its first and last sample, is one that is not asked for.
fn is_not_asked(recording: &LimbRecording, samples: [usize; 2]) -> bool {
    recording.is_left_out(samples.map(|k| recording.time_us[k]))
}

/// Reported over true velocity of each of a limb's joints: as the model gives it, else as positions tell it where the model names it.
fn gains(model: &Model, limb: &Limb, recording: &LimbRecording, blocks: &Blocks) -> Vec<f64> {
    let mut gains = vec![1.0; recording.joints];
    for (place, e) in places(model, limb) {
        if place.0.description().form == Form::Motion(Moved::Velocity) {
            let measured = || VelocityGain::of(recording, place.1, blocks).map(|gain| gain.value);
            let given = e.estimate().map(|estimate| estimate.value);
            gains[place.1] = given.or_else(measured).unwrap_or(1.0);
        }
    }
    gains
}

/// Sums of squared residuals \[fold\] \[joint\], (N m)².
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Squares {
    pub(crate) cells: Vec<Vec<f64>>,
}

impl Squares {
    /// Of each joint, over all folds.
    pub(crate) fn by_joint(&self) -> Vec<f64> {
        let joints = self.cells.first().map_or(0, Vec::len);
        (0..joints)
            .map(|j| self.cells.iter().map(|fold| fold[j]).sum())
            .collect()
    }

    /// Of each fold, over all joints.
    pub(crate) fn by_fold(&self) -> Vec<f64> {
        self.cells.iter().map(|fold| fold.iter().sum()).collect()
    }

    /// Over all.
    pub(crate) fn total(&self) -> f64 {
        self.by_fold().iter().sum()
    }

    /// So many times as much.
    pub(crate) fn times(&self, factor: f64) -> Self {
        let scaled = |joints: &Vec<f64>| joints.iter().map(|square| factor * square).collect();
        Self {
            cells: self.cells.iter().map(scaled).collect(),
        }
    }

    /// Over all in units of the joints' noise (N m).
    pub(crate) fn weighted(&self, noise: &[f64]) -> f64 {
        let joints = self.by_joint();
        joints
            .iter()
            .zip(noise)
            .map(|(square, noise)| square / (noise * noise))
            .sum()
    }
}

#[cfg(test)]
pub(crate) mod tests;
