//! One step of a leg's motion.
//!
//! From (q, v) over h it is the implicit midpoint rule in all that is smooth, and takes the sign of dry friction at its end ([`dry`]):
//!
//! ```text
//! H(q̄) (v' − v) = h [τ − b(q̄, v̄) − effects(q̄, v̄) − |friction|(q̄, v̄) sign(v')],   v̄ = (v + v')/2,   q̄ = q + h/2 v̄
//! ```
//!
//! Springs between motor and link are implicit too, so that no stiffness asks for a small step. v̄ inside H, b and the
//! effects comes from fixed-point passes: one where the motion is smooth, more at a reversal.

use nalgebra::{SMatrix, SVector, Vector3};
use proprio_core::go2::JOINTS_PER_LEG as JOINTS;

use super::super::dry;
use super::{Last, Loads, Plant, State, pairs};

/// Passes of a step at most, and the change of v̄ (rad/s) and of dry friction (N m) that ends them.
const PASSES: usize = 8;
const SETTLED: (f64, f64) = (2e-4, 1e-4);
/// Heating by the motor's torque squared, K/s per (N m)², at a gear of 6.333, its time constant of cooling, s, and the
/// temperature it cools to, °C.
const HEATING: (f64, f64) = (0.5, 6.333);
const COOLING: f64 = 60.0;
const AMBIENT: f64 = 25.0;

impl Plant {
    /// Moves `state` by `h` seconds under the motors' true torques. False if the inertia is not positive definite.
    pub(crate) fn step(&mut self, state: &mut State, tau: &Vector3<f64>, h: f64) -> bool {
        let moved = if self.is_rigid {
            self.step_with::<JOINTS>(state, tau, h)
        } else {
            self.step_with::<{ 2 * JOINTS }>(state, tau, h)
        };
        moved.is_some()
    }

    /// A step with `N` unknown velocities: the links', then the motors' unless all gears are rigid.
    fn step_with<const N: usize>(
        &mut self,
        state: &mut State,
        tau: &Vector3<f64>,
        h: f64,
    ) -> Option<()> {
        let mut last = self.last;
        let mut middle = self.middle(state, h, &last);
        let mut loads = self.loads(&middle, &last.transmitted);
        for pass in 0..PASSES {
            let (a, r, sizes) = self.assemble::<N>(state, &middle, &loads, tau, h);
            let guess = stacked::<N>(
                &(state.dq + last.link * h),
                &(state.motor_dq + last.motor * h),
            );
            let w = dry::solve(&a, &r, &sizes, &guess)?;
            let link = (w.fixed_rows::<JOINTS>(0) - state.dq) / h;
            let motor = Vector3::from_fn(|j, _| match self.joints[j].transmission {
                Some(_) => (w[N - JOINTS + j] - state.motor_dq[j]) / h,
                None => link[j],
            });
            let change = ((link - last.link).amax()).max((motor - last.motor).amax()) * h / 2.0;
            last = Last {
                link,
                motor,
                transmitted: loads.inertia * link + loads.link,
            };
            middle = self.middle(state, h, &last);
            if pass + 1 == PASSES || (change < SETTLED.0 && !self.load_matters) {
                break;
            }
            let next = self.loads(&middle, &last.transmitted);
            let pairs = next.dry.as_flattened().iter().zip(loads.dry.as_flattened());
            let shift = pairs.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
            loads = next;
            if change < SETTLED.0 && shift < SETTLED.1 {
                break;
            }
        }
        self.last = last;
        self.commit(state, &middle, &last, tau, h);
        Some(())
    }

    /// Half a step on from `state` at these accelerations.
    fn middle(&self, state: &State, h: f64, last: &Last) -> State {
        let mut middle = *state;
        middle.t += h / 2.0;
        middle.dq += last.link * (h / 2.0);
        middle.motor_dq += last.motor * (h / 2.0);
        middle.q += middle.dq * (h / 2.0);
        middle.motor_q += middle.motor_dq * (h / 2.0);
        let dq = middle.motor_dq;
        self.remember(&mut middle, state, &dq, h, 0.5);
        self.slide(&mut middle, state);
        middle
    }

    /// Moves the friction inside springs on from what it was at `from`: dz = (sgn dx − z) |dx| / displacement.
    fn slide(&self, state: &mut State, from: &State) {
        for (j, joint) in self.joints.iter().enumerate() {
            let Some(between) = joint.transmission.filter(|between| between.friction > 0.0) else {
                continue;
            };
            let gone = (state.motor_q[j] - state.q[j]) - (from.motor_q[j] - from.q[j]);
            let left = (-gone.abs() / between.displacement).exp();
            state.inside[j] = gone.signum() - (gone.signum() - from.inside[j]) * left;
        }
    }

    /// Moves the effects' memories by a `share` of what a step of `h` at motor velocities `dq` changes them.
    fn remember(&self, state: &mut State, from: &State, dq: &Vector3<f64>, h: f64, share: f64) {
        if !self.has_memory {
            return;
        }
        for j in 0..JOINTS {
            for (effect, slot) in self.effects(j).filter(|(effect, _)| effect.has_memory()) {
                let before = from.memory[j][slot];
                let after = effect.remember(before, dq[j], h);
                state.memory[j][slot] = before + share * (after - before);
            }
        }
    }

    /// A, r and the friction of A w + h F(w) = r.
    #[allow(clippy::type_complexity)] // the three parts of one equation
    fn assemble<const N: usize>(
        &self,
        state: &State,
        middle: &State,
        loads: &Loads,
        tau: &Vector3<f64>,
        h: f64,
    ) -> (SMatrix<f64, N, N>, SVector<f64, N>, [[f64; 2]; N]) {
        let mut a = SMatrix::<f64, N, N>::identity();
        a.fixed_view_mut::<JOINTS, JOINTS>(0, 0)
            .copy_from(&loads.inertia);
        let mut r = SVector::<f64, N>::zeros();
        let mut sizes = [[0.0; 2]; N];
        let momentum = loads.inertia * state.dq;
        for j in 0..JOINTS {
            let joint = &self.joints[j];
            r[j] = momentum[j] - h * loads.link[j];
            let m = N - JOINTS + j;
            let own = if joint.transmission.is_some() { m } else { j };
            sizes[own] = loads.dry[j].map(|size| h * size);
            let free = h * (tau[j] - loads.motor[j]);
            if joint.transmission.is_none() {
                a[(j, j)] += joint.armature;
                r[j] += joint.armature * state.dq[j] + free;
                continue;
            }
            a[(m, m)] = joint.armature;
            r[m] = joint.armature * state.motor_dq[j] + free;
            // The spring at the midpoint of the step: half of it known, half in the unknown velocities.
            let (torque, k, d) = self.spring(j, middle);
            let implicit = h * (k * h / 4.0 + d / 2.0);
            let guessed =
                2.0 * (middle.motor_dq[j] - middle.dq[j]) - (state.motor_dq[j] - state.dq[j]);
            let known = h * torque - implicit * guessed;
            r[j] += known;
            r[m] -= known;
            for (row, column, sign) in [(j, j, 1.0), (m, m, 1.0), (j, m, -1.0), (m, j, -1.0)] {
                a[(row, column)] += sign * implicit;
            }
        }
        let motor = |j: usize| match self.joints[j].transmission {
            Some(_) => N - JOINTS + j,
            None => j,
        };
        for j in 1..JOINTS {
            let inertia = self.joints[j].coupled_inertia;
            for (row, column) in pairs(j - 1, j) {
                a[(motor(row), motor(column))] += inertia;
                r[motor(row)] += inertia * state.motor_dq[column];
            }
        }
        (a, r, sizes)
    }

    /// Ends a step with the velocities that the passes have found.
    fn commit(&self, state: &mut State, middle: &State, last: &Last, tau: &Vector3<f64>, h: f64) {
        let before = *state;
        state.t += h;
        state.q += middle.dq * h;
        state.motor_q += middle.motor_dq * h;
        state.dq += last.link * h;
        state.motor_dq += last.motor * h;
        self.remember(state, &before, &middle.motor_dq, h, 1.0);
        self.slide(state, &before);
        for (j, joint) in self.joints.iter().enumerate() {
            let share = HEATING.1 / joint.gear;
            let heat = HEATING.0 * share * share * tau[j] * tau[j];
            state.temperature[j] += h * (heat - (state.temperature[j] - AMBIENT) / COOLING);
        }
    }
}

/// Link velocities, then motor velocities where there is room.
fn stacked<const N: usize>(link: &Vector3<f64>, motor: &Vector3<f64>) -> SVector<f64, N> {
    SVector::from_fn(|n, _| {
        if n < JOINTS {
            link[n]
        } else {
            motor[n - JOINTS]
        }
    })
}
