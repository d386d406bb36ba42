//! One pinned leg under a PD controller, integrated by the classical Runge-Kutta method.

use nalgebra::{SVector, Vector3};
use proprio_core::effect::{EffectKind, JointState};
use proprio_core::go2::{self, ACTUATORS, JOINTS_PER_LEG, Leg};
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use rand_chacha::ChaCha8Rng;

use super::motion::Reference;
use super::{Diverged, Simulation};

/// Longest integration step, s: 5 kHz. Coulomb friction of 1.5 N m is a damper of 43 N m s/rad near standstill, on
/// a calf without armature a time constant of 0.1 ms.
const STEP: f64 = 2e-4;
/// Controller gains, N m/rad and N m s/rad.
const GAIN_P: f64 = 40.0;
const GAIN_D: f64 = 1.5;

/// Position and velocity.
type State = SVector<f64, { 2 * JOINTS_PER_LEG }>;

pub(super) struct SimulatedLeg {
    leg: Leg,
    tree: Tree<f64, JOINTS_PER_LEG, JOINTS_PER_LEG>,
    effects: Vec<(EffectKind, usize, f64)>,
    reference: Reference,
    t: f64,
    state: State,
}

impl SimulatedLeg {
    pub(super) fn new(leg: Leg, simulation: &Simulation, rng: &mut ChaCha8Rng) -> Self {
        let reference = Reference::new(simulation.motion, leg, rng);
        let own = simulation.effects.iter().filter(|e| e.joint.leg() == leg);
        let (q, dq) = reference.at(0.0);
        let mut state = State::zeros();
        state.as_mut_slice()[..JOINTS_PER_LEG].copy_from_slice(&q);
        state.as_mut_slice()[JOINTS_PER_LEG..].copy_from_slice(&dq);
        Self {
            leg,
            tree: go2::leg(leg),
            effects: own.map(|e| (e.effect, e.joint.place(), e.value)).collect(),
            reference,
            t: 0.0,
            state,
        }
    }

    pub(super) fn q(&self) -> Vector3<f64> {
        self.state.fixed_rows::<JOINTS_PER_LEG>(0).into()
    }

    pub(super) fn dq(&self) -> Vector3<f64> {
        self.state
            .fixed_rows::<JOINTS_PER_LEG>(JOINTS_PER_LEG)
            .into()
    }

    /// The motors' torque now, N m.
    pub(super) fn torque(&self) -> Vector3<f64> {
        self.control(self.t, &self.q(), &self.dq())
    }

    /// Integrates up to time `t`, s.
    pub(super) fn advance_to(&mut self, t: f64) -> Result<(), Diverged> {
        let steps = ((t - self.t) / STEP).ceil().max(1.0);
        let h = (t - self.t) / steps;
        for _ in 0..steps as u64 {
            let (now, x) = (self.t, self.state);
            let k1 = self.derivative(now, &x);
            let k2 = self.derivative(now + h / 2.0, &(x + k1 * (h / 2.0)));
            let k3 = self.derivative(now + h / 2.0, &(x + k2 * (h / 2.0)));
            let k4 = self.derivative(now + h, &(x + k3 * h));
            self.state = x + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
            self.t = now + h;
        }
        self.t = t;
        let finite = self.state.iter().all(|value| value.is_finite());
        if finite {
            Ok(())
        } else {
            Err(Diverged { leg: self.leg, t })
        }
    }

    /// PD on the reference, within what the motor can give.
    fn control(&self, t: f64, q: &Vector3<f64>, dq: &Vector3<f64>) -> Vector3<f64> {
        let (wanted, rate) = self.reference.at(t);
        Vector3::from_fn(|j, _| {
            let torque = GAIN_P * (wanted[j] - q[j]) + GAIN_D * (rate[j] - dq[j]);
            torque.clamp(-ACTUATORS[j].effort, ACTUATORS[j].effort)
        })
    }

    fn derivative(&self, t: f64, state: &State) -> State {
        let q: Vector3<f64> = state.fixed_rows::<JOINTS_PER_LEG>(0).into();
        let dq: Vector3<f64> = state.fixed_rows::<JOINTS_PER_LEG>(JOINTS_PER_LEG).into();
        let tau = self.control(t, &q, &dq);
        let (lost, armature) = self.added(&q, &dq, &tau);
        let kinematics = self.tree.kinematics(&Transform::identity(), &q, &dq);
        let ddq = self
            .tree
            .forward_dynamics(&kinematics, &dq, &(tau - lost), &armature)
            .unwrap_or_else(|| Vector3::repeat(f64::NAN));
        let mut derivative = State::zeros();
        derivative
            .fixed_rows_mut::<JOINTS_PER_LEG>(0)
            .copy_from(&dq);
        derivative
            .fixed_rows_mut::<JOINTS_PER_LEG>(JOINTS_PER_LEG)
            .copy_from(&ddq);
        derivative
    }

    /// The effects' torque without acceleration (N m) and what they add to the inertia (kg m²).
    ///
    /// The torque is rate + ∂boundary/∂q q̇ + ∂boundary/∂q̇ q̈.
    fn added(
        &self,
        q: &Vector3<f64>,
        dq: &Vector3<f64>,
        tau: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let mut torque = Vector3::zeros();
        let mut inertia = Vector3::zeros();
        for &(effect, j, value) in &self.effects {
            let boundary = |q, dq| effect.term(&JointState::reported(q, dq, tau[j])).boundary;
            let rate = effect.term(&JointState::reported(q[j], dq[j], tau[j])).rate;
            let by_q = slope(|d| boundary(q[j] + d, dq[j]));
            let by_dq = slope(|d| boundary(q[j], dq[j] + d));
            torque[j] += value * (rate + by_q * dq[j]);
            inertia[j] += value * by_dq;
        }
        (torque, inertia)
    }
}

/// Slope of a function at zero by central difference; exact to 1e-10 where it is linear.
fn slope(f: impl Fn(f64) -> f64) -> f64 {
    const H: f64 = 1e-4;
    (f(H) - f(-H)) / (2.0 * H)
}
