//! A limb's bodies and what its effects do to them, moved by small steps.
//!
//! A step is the explicit midpoint rule, and takes dry friction at its end ([`friction`]): with M = H + what effects add to the inertia,
//!
//! ```text
//! M(q̄) (v' − v) = h [τ − C q̇ − g − effects](q̄, v̄) − h friction(v'),   q' = q + h (v + v')/2
//! ```
//!
//! where (q̄, v̄) is half a step on by the same rule. What an effect does is read from its window terms, whatever it is: the torque is the
//! boundary's derivative and the rate. A boundary that grows with velocities is inertia; a rate whose value differs between a joint's two
//! directions is dry friction at rest.

use nalgebra::{DMatrix, DVector};
use proprio_core::effect::{Input, JointState};
use proprio_core::spatial::Transform;

use super::{drive, friction};
use crate::equation::contribution::Contribution;
use crate::equation::presliding::slid;
use crate::equation::rigid_body::RigidBody;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;

/// Speed below which a joint has no direction, rad/s: a step at 1 g of a metre's arm ends ten million times faster.
const NO_SPEED: f64 = 1e-9;
/// Half the step of the differences along the motion, s: boundaries are nearly straight over it, and rounding is 1e-10 of them.
const ALONG: f64 = 1e-6;
/// No joint of a robot is faster, rad/s (or m/s): 160 turns a second.
const FASTEST: f64 = 1e3;

/// A limb under a model.
pub(super) struct Plant {
    rigid: Box<dyn RigidBody>,
    base: Transform<f64>,
    /// Of each joint, the effects on the link's side of the motor's torque.
    effects: Vec<Vec<Contribution>>,
    /// The displacement of each joint's bristles, rad, where it has any.
    pub(super) displacements: Vec<Option<f64>>,
}

/// What the joints do.
#[derive(Debug, Clone)]
pub(super) struct State {
    /// rad.
    pub(super) q: Vec<f64>,
    /// rad/s.
    pub(super) dq: Vec<f64>,
    /// How far bristles are bent, of their most.
    pub(super) bent: Vec<f64>,
    /// What gears transmit, N m, as of half a step ago.
    pub(super) load: Vec<f64>,
}

impl State {
    /// Whether a joint has stopped or turned round on the way to another state, or begins to move.
    pub(super) fn turns(&self, to: &Self) -> bool {
        let mut both = self.dq.iter().zip(&to.dq);
        both.any(|(from, to)| from * to <= 0.0 && from != to)
    }
}

/// What the motors give in a state.
#[derive(Debug, Clone)]
pub(super) struct Given {
    /// N m.
    pub(super) torque: Vec<f64>,
    /// How much less of it there is per velocity beyond the state's, N m s/rad.
    pub(super) damping: Vec<f64>,
}

/// What else effects see.
pub(super) struct Instant<'a> {
    /// s since the recording's start.
    pub(super) time: f64,
    /// °C.
    pub(super) temperature: &'a [f64],
}

impl Plant {
    pub(super) fn of(data: &LimbData, values: &Values, effects: &[Vec<Contribution>]) -> Self {
        let on_link = |own: &Vec<Contribution>| {
            let own = own.iter().filter(|effect| !drive::is_of_drive(effect));
            own.cloned().collect::<Vec<_>>()
        };
        let effects: Vec<Vec<_>> = effects.iter().map(on_link).collect();
        let displacement = |own: &Vec<Contribution>| {
            let mut bristles = own.iter();
            let bent = |e: &&Contribution| e.effect.description().input == Input::Bristles;
            bristles.find(bent).map(|e| e.shapes[0])
        };
        Self {
            displacements: effects.iter().map(displacement).collect(),
            rigid: data.body.loaded(values),
            base: data.body.base(values),
            effects,
        }
    }

    /// Moves `state` by `h` seconds under what the motors give at its begin and in its middle. None if it moves as no robot can, or if a joint
    /// has no inertia to move.
    pub(super) fn step(
        &self,
        state: &mut State,
        [given, in_middle]: [&dyn Fn(&State) -> Given; 2],
        now: &Instant,
        h: f64,
    ) -> Option<()> {
        let half = self.pushed((state, 1.0), &state.dq, &given(state), now, 0.5 * h)?;
        let middle = self.moved(state, half, 0.5 * h);
        let whole = self.pushed((&middle, 0.5), &state.dq, &in_middle(&middle), now, h)?;
        *state = self.moved(state, whole, h);
        let is_possible = |x: &f64| x.is_finite() && x.abs() < FASTEST;
        (state.dq.iter().all(is_possible) && state.q.iter().all(|q| q.is_finite())).then_some(())
    }

    /// `state` after `h` seconds at whose end the velocities and loads are these.
    fn moved(&self, state: &State, [dq, load]: [Vec<f64>; 2], h: f64) -> State {
        let way: Vec<f64> = (state.dq.iter().zip(&dq))
            .map(|(from, to)| 0.5 * h * (from + to))
            .collect();
        let bristles = state.bent.iter().zip(&way).zip(&self.displacements);
        let bent = bristles.map(|((bent, way), zs)| zs.map_or(0.0, |zs| slid(*bent, way / zs).1));
        State {
            bent: bent.collect(),
            q: state.q.iter().zip(&way).map(|(q, way)| q + way).collect(),
            dq,
            load,
        }
    }

    /// The velocities `dq` after `h` seconds of what acts in the state `at`, and what the gears transmit meanwhile. What the motors damp is taken at the
    /// velocity of a share `when` of that time, by the linear rule that is stable however stiff their gains are.
    fn pushed(
        &self,
        (at, when): (&State, f64),
        dq: &[f64],
        given: &Given,
        now: &Instant,
        h: f64,
    ) -> Option<[Vec<f64>; 2]> {
        let n = dq.len();
        let (mut inertia, mut bias) = (vec![0.0; n * n], vec![0.0; n]);
        (self.rigid).inertia_matrix(&self.base, &at.q, &mut inertia);
        let still = vec![0.0; n];
        (self.rigid).inverse_dynamics(&self.base, [&at.q, &at.dq, &still], &mut bias);
        let (inertia, rigid) = (DMatrix::from_row_slice(n, n, &inertia), bias.clone());
        let (mut mass, mut resists) = (inertia.clone(), vec![[0.0; 2]; n]);
        self.add_effects(at, now, (&mut mass, &mut bias, &mut resists));
        let from = DVector::from_column_slice(dq);
        let mut torque = DVector::from_column_slice(&given.torque);
        for (j, damping) in given.damping.iter().enumerate() {
            mass[(j, j)] += when * h * damping;
            torque[j] += damping * (at.dq[j] - dq[j]);
        }
        let right = &mass * &from + h * (torque - DVector::from_column_slice(&bias));
        resists
            .iter_mut()
            .for_each(|sides| *sides = sides.map(|side| h * side));
        let to = friction::solve(&mass, &right, &resists, &at.dq)?;
        let load = inertia * (&to - from) / h + DVector::from_vec(rigid);
        Some([to, load].map(|x| x.iter().copied().collect()))
    }

    /// Adds what effects add to the inertia, to the torque against which the motors work, and of each joint to what resists it forwards and
    /// backwards.
    fn add_effects(
        &self,
        at: &State,
        now: &Instant,
        (mass, bias, resists): (&mut DMatrix<f64>, &mut [f64], &mut [[f64; 2]]),
    ) {
        let n = at.q.len();
        if self.effects.iter().all(Vec::is_empty) {
            return;
        }
        let [before, mut here, after] = [-ALONG, 0.0, ALONG].map(|t| states(at, now, t));
        for j in (0..n).filter(|&j| !self.effects[j].is_empty()) {
            let boundary = |states: &[JointState<f64>]| self.terms(j, states)[0];
            bias[j] += (boundary(&after) - boundary(&before)) / (2.0 * ALONG);
            let known = boundary(&here);
            for i in 0..n {
                let dq = here[i].dq;
                // Boundaries are straight in velocities.
                here[i].dq = dq + 1.0;
                mass[(j, i)] += self.terms(j, &here)[0] - known;
                here[i].dq = dq;
            }
            let (dq, speed) = (at.dq[j], here[j].speed);
            resists[j] = [dq.max(NO_SPEED), dq.min(-NO_SPEED)].map(|speed| {
                (here[j].speed, here[j].dq) = (speed, speed);
                self.terms(j, &here)[1]
            });
            (here[j].speed, here[j].dq) = (speed, dq);
        }
    }

    /// What the effects at a joint make in these states of all: what is to be derived by time (N m s), and the rest (N m).
    fn terms(&self, j: usize, states: &[JointState<f64>]) -> [f64; 2] {
        let (mut boundary, mut rate) = (0.0, 0.0);
        for effect in &self.effects[j] {
            effect.add(j, states, [&mut boundary, &mut rate]);
        }
        [boundary, rate]
    }
}

/// What effects see so many seconds after a state, its velocities and deflections as they are.
fn states(at: &State, now: &Instant, seconds: f64) -> Vec<JointState<f64>> {
    let joint = |j: usize| JointState {
        speed_noise: NO_SPEED,
        load: at.load[j],
        presliding: seconds * at.bent[j],
        temperature: now.temperature[j],
        time: now.time,
        ..JointState::reported(at.q[j] + seconds * at.dq[j], at.dq[j], 0.0)
    };
    (0..at.q.len()).map(joint).collect()
}
