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

use proprio_core::effect::{EffectKind, JointState};
use proprio_core::spatial::Transform;

use crate::equation::body::LimbBody;
use crate::equation::column::{Column, Columns, Entry, columns_of};
use crate::equation::motion::{Load, Motion, States, is_derivative};
use crate::equation::rigid_body::RigidBody;
use crate::equation::values::{Place, Values};

/// Mean reported torque of each chosen window and joint (N m), window by window; zero for windows that are not chosen.
pub(crate) fn predict(
    body: &LimbBody,
    motion: &Motion,
    values: &Values,
    subtree_end: &[usize],
    chosen: &dyn Fn(usize) -> bool,
) -> Vec<f64> {
    predict_under(None, body, motion, values, subtree_end, chosen)
}

/// The same where the load of the gears is known: that of the model's bodies without any delay.
pub(crate) fn predict_under(
    load: Option<&Load>,
    body: &LimbBody,
    motion: &Motion,
    values: &Values,
    subtree_end: &[usize],
    chosen: &dyn Fn(usize) -> bool,
) -> Vec<f64> {
    let columns = Columns::new(subtree_end.to_vec(), entries(values));
    let mut torque = vec![0.0; motion.joints * motion.windows.len()];
    let delays: Vec<f64> = (0..motion.joints).map(|j| values.delay(j)).collect();
    let asked = motion.asked(values, chosen);
    let made: Vec<&Column> = columns.of_joint.iter().flatten().collect();
    let mut done: Vec<f64> = Vec::new();
    for &delay in &delays {
        if done.contains(&delay) {
            continue;
        }
        done.push(delay);
        let pass = Pass {
            motion,
            rigid: body.loaded(values),
            base: body.base(values),
            states: motion.states_under(load, body, values, (&columns, &made), (delay, &asked)),
            effects: effects(&columns, values),
            joints: (0..motion.joints).filter(|&j| delays[j] == delay).collect(),
        };
        pass.run(values, chosen, &mut torque);
    }
    torque
}

/// An effect at a joint: its shape and what its columns are times.
struct Own {
    effect: EffectKind,
    shape: f64,
    /// The other joint, of an effect that couples two.
    other: Option<usize>,
    numbers: Vec<(usize, f64)>,
}

/// Of each joint the effects that add to its torque.
fn effects(columns: &Columns, values: &Values) -> Vec<Vec<Own>> {
    let numbers = columns.numbers(values);
    let of = |(at, numbers): (usize, &Vec<f64>)| {
        let mut all: Vec<Own> = Vec::new();
        for (column, &number) in columns.of_joint[at].iter().zip(numbers) {
            let (effect, shape, other, n) = match *column {
                Column::Own {
                    effect, shape, n, ..
                } => (effect, shape, None, n),
                Column::Coupled { joint, effect, n } => match columns.coupled(joint, at) {
                    other @ Some(_) => (effect, 1.0, other, n),
                    None => continue,
                },
                _ => continue,
            };
            match all
                .iter_mut()
                .find(|own| (own.effect, own.shape, own.other) == (effect, shape, other))
            {
                Some(own) => own.numbers.push((n, number)),
                None => all.push(Own {
                    effect,
                    shape,
                    other,
                    numbers: vec![(n, number)],
                }),
            }
        }
        all
    };
    numbers.iter().enumerate().map(of).collect()
}

/// The joints whose torque is reported with one delay.
struct Pass<'a> {
    motion: &'a Motion,
    rigid: Box<dyn RigidBody>,
    base: Transform<f64>,
    states: States,
    effects: Vec<Vec<Own>>,
    joints: Vec<usize>,
}

/// What enters by its difference, and what is integrated, joint by joint.
#[derive(Clone)]
struct Instant {
    momentum: Vec<f64>,
    rate: Vec<f64>,
}

impl Pass<'_> {
    /// Writes the joints' mean torques of all chosen windows.
    fn run(&self, values: &Values, chosen: &dyn Fn(usize) -> bool, torque: &mut [f64]) {
        let n = self.motion.joints;
        let gain = |j: usize| values.get((EffectKind::TorqueGain, j), 0);
        let mut now = Instant {
            momentum: vec![0.0; n],
            rate: vec![0.0; n],
        };
        let mut before = now.clone();
        let mut last_sample = None;
        let windows = self.motion.windows.iter().enumerate();
        for (w, window) in windows.filter(|(w, _)| chosen(*w)) {
            let [first, last] = window.samples;
            // A window that begins where the last one ended need not look at that sample again.
            if last_sample != Some(first) {
                self.measure(first, &mut now);
            }
            let own = &mut torque[w * n..(w + 1) * n];
            for &j in &self.joints {
                own[j] = -now.momentum[j];
            }
            for k in first + 1..=last {
                std::mem::swap(&mut before, &mut now);
                self.measure(k, &mut now);
                let half = 0.5 * (self.motion.time[k] - self.motion.time[k - 1]);
                for &j in &self.joints {
                    own[j] += half * (before.rate[j] + now.rate[j]);
                }
            }
            for &j in &self.joints {
                own[j] = (own[j] + now.momentum[j]) / (window.length * gain(j));
            }
            last_sample = Some(last);
        }
    }

    /// All that sample k has.
    fn measure(&self, k: usize, out: &mut Instant) {
        let n = self.motion.joints;
        let at = k * n..(k + 1) * n;
        let states = &self.states;
        let links = [&states.q[at.clone()], &states.dq[at.clone()]];
        (self.rigid).momentum_and_rate(&self.base, links, &mut out.momentum, &mut out.rate);
        for &j in &self.joints {
            let state = |j: usize| -> &JointState<f64> { &states.states[k * n + j] };
            for own in &self.effects[j] {
                let terms = match own.other {
                    Some(other) => own.effect.coupled(state(j), state(other)),
                    None => own.effect.terms(state(j), own.shape),
                };
                for &(n, number) in &own.numbers {
                    out.momentum[j] += number * terms[n].boundary;
                    out.rate[j] += number * terms[n].rate;
                }
            }
        }
    }
}

/// The parameters that are multiples of columns: of what is a derivative, the motion has it already.
fn entries(values: &Values) -> Vec<Entry> {
    let linear = values
        .places()
        .filter(|(effect, _)| !is_derivative(*effect));
    let of = |place: Place| {
        let columns = columns_of(place, values.shape(place)).into_iter();
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
