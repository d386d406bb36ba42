//! Reported torque as a function of a model and the motion alone.
//!
//! ŷ(t) = `predict(model, motion)`: what a drive would report, in its own scale and as late as it does, from positions, velocities,
//! temperatures and times. The input has no torque, by type. Every score, floor, baseline, ladder and plot is of these numbers,
//! and a fit is the least-squares solution over their derivatives ([`crate::equation::rows`]).
//!
//! Over a window of length T from t₀ to t₁, with p = H q̇ and r = g − Cᵀ q̇ of the links' motion and each effect's share of momentum
//! b and of torque e,
//!
//! ```text
//! ŷ = (p + b |t₁ − p + b |t₀ + ∫ (r + e) dt) / (T · torque gain)
//! ```

use std::sync::Arc;

use proprio_core::effect::JointState;
use proprio_core::spatial::Transform;

use crate::equation::body::LimbBody;
use crate::equation::column::{Column, Columns, Entry, columns_of};
use crate::equation::contribution::{Contribution, contributions};
use crate::equation::joint_states::States;
use crate::equation::motion::Motion;
use crate::equation::rigid_body::RigidBody;
use crate::equation::transmitted_torque_cache::Load;
use crate::equation::values::{Place, Values};

/// Mean reported torque of each chosen window and joint (N m), window by window; zero for windows that are not chosen.
pub(crate) fn predict(
    body: &LimbBody,
    motion: &Motion,
    values: &Values,
    subtree_end: &[usize],
    chosen: &dyn Fn(usize) -> bool,
) -> Vec<f64> {
    let columns = columns(values, subtree_end);
    let mut torque = vec![0.0; motion.joints * motion.windows.len()];
    let asked = motion.asked(values, chosen);
    let made: Vec<&Column> = columns.of_joint.iter().flatten().collect();
    for (delay, joints) in delays(values, motion.joints) {
        let pass = Pass {
            motion,
            rigid: body.loaded(values),
            base: body.base(values),
            states: motion.states_of(body, values, (&columns, &made), (delay, &asked), true),
            effects: contributions(&columns, values),
            joints,
        };
        pass.run(values, chosen, &mut torque);
    }
    torque
}

/// Each delay of a model and the joints that report so late.
fn delays(values: &Values, joints: usize) -> Vec<(f64, Vec<usize>)> {
    let mut all: Vec<(f64, Vec<usize>)> = Vec::new();
    for j in 0..joints {
        let delay = values.delay(j);
        match all.iter_mut().find(|(known, _)| *known == delay) {
            Some((_, joints)) => joints.push(j),
            None => all.push((delay, vec![j])),
        }
    }
    all
}

/// Predictions of a model with one of its links looser or less loose.
///
/// Its effects see the motor's motion and the bodies' load, neither of which the link changes: their share of the torque is made once.
pub(crate) struct LooseLink<'a> {
    motion: &'a Motion,
    /// The model without the play or the spring in question, and where that is.
    values: Values,
    place: Place,
    chosen: &'a (dyn Fn(usize) -> bool + Sync),
    /// The rigid body's share of each delay's joints, and the load that moves the link.
    passes: Vec<(Pass<'a>, Arc<Load>)>,
    /// All but the rigid body's share, N m.
    rest: Vec<f64>,
}

impl<'a> LooseLink<'a> {
    pub(crate) fn of(
        body: &LimbBody,
        motion: &'a Motion,
        (values, place): (&Values, Place),
        subtree_end: &[usize],
        chosen: &'a (dyn Fn(usize) -> bool + Sync),
    ) -> Self {
        let mut values = values.clone();
        values.remove(place);
        let nothing = Columns::new(subtree_end.to_vec(), Vec::new());
        let pass = |(delay, joints)| {
            let states = motion.states_of(body, &values, (&nothing, &[]), (delay, &None), true);
            let pass = Pass {
                motion,
                rigid: body.loaded(&values),
                base: body.base(&values),
                states,
                effects: vec![Vec::new(); motion.joints],
                joints,
            };
            (pass, motion.load(body, &values, (true, delay)))
        };
        let passes = delays(&values, motion.joints).into_iter().map(pass);
        let mut own = Self {
            motion,
            passes: passes.collect(),
            rest: vec![0.0; motion.joints * motion.windows.len()],
            chosen,
            place,
            values: values.clone(),
        };
        let rigid = own.predicted(0.0);
        let whole = predict(body, motion, &values, subtree_end, chosen);
        let rest = whole.iter().zip(rigid).map(|(all, rigid)| all - rigid);
        own.rest = rest.collect();
        own
    }

    /// As [`predict`] has it, with a gap (rad) or a compliance (rad/(N m)) of this size.
    pub(crate) fn predicted(&self, size: f64) -> Vec<f64> {
        let mut torque = vec![0.0; self.rest.len()];
        for (pass, load) in &self.passes {
            // The link's side is all that the rigid body asks for.
            let mut states = pass.states.links();
            self.motion
                .loosen(load, &self.values, (self.place, size), &mut states);
            pass.run_on(&states, &self.values, self.chosen, &mut torque);
        }
        torque
            .iter_mut()
            .zip(&self.rest)
            .for_each(|(all, rest)| *all += rest);
        torque
    }
}

/// The joints whose torque is reported with one delay.
struct Pass<'a> {
    motion: &'a Motion,
    rigid: Box<dyn RigidBody>,
    base: Transform<f64>,
    states: States,
    effects: Vec<Vec<Contribution>>,
    joints: Vec<usize>,
}

/// What enters by its difference, and what is integrated, joint by joint.
#[derive(Clone)]
struct Instant {
    momentum: Vec<f64>,
    rate: Vec<f64>,
    /// What the joints' effects see.
    seen: Vec<JointState<f64>>,
}

impl Pass<'_> {
    /// Writes the joints' mean torques of all chosen windows.
    fn run(&self, values: &Values, chosen: &dyn Fn(usize) -> bool, torque: &mut [f64]) {
        self.run_on(&self.states, values, chosen, torque);
    }

    /// The same on other states.
    fn run_on(
        &self,
        states: &States,
        values: &Values,
        chosen: &dyn Fn(usize) -> bool,
        torque: &mut [f64],
    ) {
        let n = self.motion.joints;
        let gains: Vec<f64> = (0..n).map(|j| values.torque_gain(j)).collect();
        let mut now = Instant {
            momentum: vec![0.0; n],
            rate: vec![0.0; n],
            seen: Vec::with_capacity(n),
        };
        let (mut before, mut near) = (now.clone(), now.clone());
        let mut last_sample = None;
        let windows = self.motion.windows.iter().enumerate();
        for (w, window) in windows.filter(|(w, _)| chosen(*w)) {
            let [first, last] = window.samples;
            // A window that begins where the last one ended need not look at that sample again.
            if last_sample != Some(first) {
                self.measure(states, first, &mut now);
            }
            let own = &mut torque[w * n..(w + 1) * n];
            self.joints.iter().for_each(|&j| own[j] = 0.0);
            self.add_momentum(states, (first, -1.0), (&now, &mut near), own);
            for k in first + 1..=last {
                std::mem::swap(&mut before, &mut now);
                self.measure(states, k, &mut now);
                let half = 0.5 * (self.motion.time[k] - self.motion.time[k - 1]);
                for &j in &self.joints {
                    own[j] += half * (before.rate[j] + now.rate[j]);
                }
            }
            self.add_momentum(states, (last, 1.0), (&now, &mut near), own);
            for &j in &self.joints {
                own[j] /= window.length * gains[j];
            }
            last_sample = Some(last);
        }
    }

    /// Adds so many times the momentum at a window's end, which is sample k and measured `now`; `near` is room for the samples next to it.
    fn add_momentum(
        &self,
        states: &States,
        (k, times): (usize, f64),
        (now, near): (&Instant, &mut Instant),
        to: &mut [f64],
    ) {
        let mut add = |weight: f64, momentum: &[f64]| {
            for &j in &self.joints {
                to[j] += times * weight * momentum[j];
            }
        };
        let Some([before, at, after]) = self.motion.end_weights(k) else {
            return add(1.0, &now.momentum);
        };
        add(at, &now.momentum);
        for (k, weight) in [(k - 1, before), (k + 1, after)] {
            self.measure(states, k, near);
            add(weight, &near.momentum);
        }
    }

    /// All that sample k has.
    fn measure(&self, states: &States, k: usize, out: &mut Instant) {
        let n = self.motion.joints;
        let first = (k - states.first) * n;
        let at = first..first + n;
        let links = [&states.q[at.clone()], &states.dq[at.clone()]];
        (self.rigid).momentum_and_rate(&self.base, links, &mut out.momentum, &mut out.rate);
        if self.joints.iter().all(|&j| self.effects[j].is_empty()) {
            return;
        }
        states.all(k, &mut out.seen);
        for &j in &self.joints {
            for share in &self.effects[j] {
                let sums = [&mut out.momentum[j], &mut out.rate[j]];
                share.add(j, &out.seen, sums);
            }
        }
    }
}

/// The columns of the effects that add to a model's torque.
pub(crate) fn columns(values: &Values, subtree_end: &[usize]) -> Columns {
    Columns::new(subtree_end.to_vec(), entries(values))
}

/// The parameters that are multiples of columns: of what is a derivative, the motion has it already.
fn entries(values: &Values) -> Vec<Entry> {
    let linear = values
        .places()
        .filter(|(effect, _)| !effect.description().is_derivative());
    let of = |place: Place| {
        let columns = columns_of(place, values.shapes(place)).into_iter();
        columns.map(move |(parameter, column)| Entry {
            effect: Some(place.0),
            joint: place.1,
            parameter,
            mean: 0.0,
            std: f64::INFINITY,
            column,
        })
    };
    linear.flat_map(of).collect()
}
