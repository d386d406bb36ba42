//! The mechanics of one pinned leg: rigid links, what their joints have beyond them, and the step that moves them.
//!
//! Link and motor of a joint are one mass, or two where something gives between them. A step from (q, v) over h is the
//! implicit midpoint rule in all that is smooth, and takes the sign of dry friction at its end ([`super::dry`]):
//!
//! ```text
//! H(q̄) (v' − v) = h [τ − b(q̄, v̄) − effects(q̄, v̄) − |friction|(q̄, v̄) sign(v')],   v̄ = (v + v')/2,   q̄ = q + h/2 v̄
//! ```
//!
//! Springs between motor and link are implicit too, so that no stiffness asks for a small step. v̄ inside H, b and the
//! effects comes from fixed-point passes: one where the motion is smooth, more at a reversal.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use proprio_core::go2::JOINTS_PER_LEG as JOINTS;
use proprio_core::spatial::{Motion, Transform};
use proprio_core::tree::{Kinematics, Tree};

use super::dry;
use super::effect::{Effect, JointState, Transmission};

/// Passes of a step at most, and the change of v̄ (rad/s) and of dry friction (N m) that ends them.
const PASSES: usize = 8;
const SETTLED: (f64, f64) = (2e-4, 1e-4);
/// The foot in the calf's frame, m (go2.md).
const FOOT: Vector3<f64> = Vector3::new(0.0, 0.0, -0.213);
/// Heating by the motor's torque squared, K/s per (N m)², at a gear of 6.333, its time constant of cooling, s, and the
/// temperature it cools to, °C.
const HEATING: (f64, f64) = (0.5, 6.333);
const COOLING: f64 = 60.0;
const AMBIENT: f64 = 25.0;

/// Most effects of one joint that have a memory: as many as there are such effects.
const MEMORIES: usize = 2;

/// What one joint has beyond the rigid bodies.
pub(super) struct PlantJoint {
    /// At most one of a kind.
    pub(super) effects: Vec<Box<dyn Effect>>,
    /// Rotor inertia as the joint feels it, kg m².
    pub(super) armature: f64,
    /// What lies between motor and link; `None` is a rigid gear.
    pub(super) transmission: Option<Transmission>,
    /// Motor turns per joint turn.
    pub(super) gear: f64,
}

/// Where a leg is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct State {
    pub(super) t: f64,
    /// Links.
    pub(super) q: Vector3<f64>,
    pub(super) dq: Vector3<f64>,
    /// Motors; the links' where the gear is rigid.
    pub(super) motor_q: Vector3<f64>,
    pub(super) motor_dq: Vector3<f64>,
    /// Motor temperatures, °C.
    pub(super) temperature: Vector3<f64>,
    /// Memories of the effects that have one, joint by joint.
    pub(super) memory: [[f64; MEMORIES]; JOINTS],
}

impl State {
    /// At time zero.
    pub(super) fn new(q: Vector3<f64>, dq: Vector3<f64>, temperature: Vector3<f64>) -> Self {
        Self {
            t: 0.0,
            q,
            dq,
            motor_q: q,
            motor_dq: dq,
            temperature,
            memory: [[0.0; MEMORIES]; JOINTS],
        }
    }
}

/// A leg's mechanics.
pub(super) struct Plant {
    pub(super) tree: Tree<f64, JOINTS, JOINTS>,
    /// The base in the world.
    pub(super) base: Transform<f64>,
    pub(super) joints: [PlantJoint; JOINTS],
    /// Accelerations of links and motors in the last step and the transmitted torques: where the next step's passes begin.
    last: Last,
    is_rigid: bool,
    /// Whether some dry friction depends on the accelerations.
    load_matters: bool,
    has_memory: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Last {
    link: Vector3<f64>,
    motor: Vector3<f64>,
    transmitted: Vector3<f64>,
}

/// Inertia and torques at one instant.
struct Loads {
    inertia: Matrix3<f64>,
    /// C q̇ + g plus what acts on the links, N m.
    link: Vector3<f64>,
    /// Smooth torques on the motors, N m.
    motor: Vector3<f64>,
    /// Sizes of dry friction in positive and negative motion, N m.
    dry: [[f64; 2]; JOINTS],
}

/// What the leg does at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Accelerations {
    /// Of the links, rad/s².
    pub(super) link: Vector3<f64>,
    /// Of the motors, rad/s².
    pub(super) motor: Vector3<f64>,
}

impl Plant {
    pub(super) fn new(
        tree: Tree<f64, JOINTS, JOINTS>,
        base: Transform<f64>,
        joints: [PlantJoint; JOINTS],
    ) -> Self {
        let last = Last {
            link: Vector3::zeros(),
            motor: Vector3::zeros(),
            transmitted: Vector3::zeros(),
        };
        let effects = || joints.iter().flat_map(|joint| &joint.effects);
        Self {
            is_rigid: joints.iter().all(|joint| joint.transmission.is_none()),
            load_matters: effects().any(|effect| effect.depends_on_load()),
            has_memory: effects().any(|effect| effect.has_memory()),
            tree,
            base,
            joints,
            last,
        }
    }

    /// Lets the first step begin at the accelerations of `state`.
    pub(super) fn begin(&mut self, state: &State, tau: &Vector3<f64>) {
        if let Some(a) = self.accelerations(state, tau) {
            self.last = Last {
                link: a.link,
                motor: a.motor,
                transmitted: self.transmitted(state, &a),
            };
        }
    }

    /// The effects of joint `j`, each with the place of its memory.
    fn effects(&self, j: usize) -> impl Iterator<Item = (&dyn Effect, usize)> {
        let mut next = 0;
        self.joints[j].effects.iter().map(move |effect| {
            let slot = next;
            next += usize::from(effect.has_memory());
            (effect.as_ref(), slot.min(MEMORIES - 1))
        })
    }

    /// What an effect at joint `j` sees.
    pub(super) fn seen(
        &self,
        j: usize,
        slot: usize,
        state: &State,
        transmitted: f64,
    ) -> JointState {
        JointState {
            t: state.t,
            q: state.motor_q[j],
            dq: state.motor_dq[j],
            link_q: state.q[j],
            link_dq: state.dq[j],
            transmitted,
            temperature: state.temperature[j],
            memory: state.memory[j][slot],
        }
    }

    fn loads(&self, state: &State, transmitted: &Vector3<f64>) -> Loads {
        let k = self.tree.kinematics(&self.base, &state.q, &state.dq);
        let zero = Vector3::zeros();
        let mut loads = Loads {
            inertia: self.tree.inertia_matrix(&k),
            link: self.tree.inverse_dynamics(&k, &state.dq, &zero) - self.foot_torque(&k, state.t),
            motor: zero,
            dry: [[0.0; 2]; JOINTS],
        };
        for j in 0..JOINTS {
            for (effect, slot) in self.effects(j) {
                let seen = self.seen(j, slot, state, transmitted[j]);
                loads.link[j] += effect.link_torque(&seen);
                loads.motor[j] += effect.motor_torque(&seen);
                let [positive, negative] = effect.dry_friction(&seen);
                loads.dry[j][0] += positive;
                loads.dry[j][1] += negative;
            }
        }
        loads
    }

    /// Jᵀ f of the force on the foot, N m.
    fn foot_torque(&self, k: &Kinematics<f64, JOINTS, JOINTS>, t: f64) -> Vector3<f64> {
        let effects = self.joints.iter().flat_map(|joint| &joint.effects);
        let force = effects.fold(Vector3::zeros(), |sum, e| sum + e.foot_force(t));
        if force == Vector3::zeros() {
            return force;
        }
        let in_base = k
            .from_parent
            .iter()
            .fold(Matrix3::identity(), |r, x| r * x.rotation);
        let here = in_base.tr_mul(&force);
        Vector3::from_fn(|c, _| {
            let s: &Motion<f64> = &k.subspace[JOINTS - 1][c];
            (s.linear + s.angular.cross(&FOOT)).dot(&here)
        })
    }

    /// Torque of the spring between motor and link of joint `j`, N m, with its stiffness and damping; zero within the play.
    fn spring(&self, j: usize, stretch: f64, rate: f64) -> (f64, f64, f64) {
        let Some(between) = self.joints[j].transmission else {
            return (0.0, 0.0, 0.0);
        };
        let slack = between.gap / 2.0;
        if between.gap > 0.0 && stretch.abs() <= slack {
            return (0.0, 0.0, 0.0);
        }
        let (k, d) = (between.stiffness, between.damping);
        let taut = stretch - slack * stretch.signum();
        (k * taut + d * rate, k, d)
    }

    /// Accelerations at `state` under the motors' true torques: the right-hand side of the equations of motion.
    ///
    /// `None` if the inertia is not positive definite.
    pub(super) fn accelerations(&self, state: &State, tau: &Vector3<f64>) -> Option<Accelerations> {
        let mut transmitted = self.last.transmitted;
        let mut found = None;
        // Friction by load depends on the accelerations; μ < 1 makes this a contraction.
        for _ in 0..200 {
            let loads = self.loads(state, &transmitted);
            let mut inertia = loads.inertia;
            let mut torque = -loads.link;
            let mut motor = Vector3::zeros();
            for j in 0..JOINTS {
                let joint = &self.joints[j];
                let free = tau[j] - loads.motor[j] - dry::friction(loads.dry[j], state.motor_dq[j]);
                if joint.transmission.is_some() {
                    let stretch = state.motor_q[j] - state.q[j];
                    let rate = state.motor_dq[j] - state.dq[j];
                    let (spring, _, _) = self.spring(j, stretch, rate);
                    torque[j] += spring;
                    motor[j] = (free - spring) / joint.armature;
                } else {
                    inertia[(j, j)] += joint.armature;
                    torque[j] += free;
                }
            }
            let link = inertia.cholesky()?.solve(&torque);
            for j in 0..JOINTS {
                if self.joints[j].transmission.is_none() {
                    motor[j] = link[j];
                }
            }
            let next = loads.inertia * link + loads.link;
            let settled = (next - transmitted).amax() < 1e-13 * (1.0 + next.amax());
            transmitted = next;
            found = Some(Accelerations { link, motor });
            if settled {
                break;
            }
        }
        found
    }

    /// The torques that the gears hand to the links at `state`, N m.
    pub(super) fn transmitted(&self, state: &State, a: &Accelerations) -> Vector3<f64> {
        let loads = self.loads(state, &Vector3::zeros());
        loads.inertia * a.link + loads.link
    }

    /// Moves `state` by `h` seconds under the motors' true torques. False if the inertia is not positive definite.
    pub(super) fn step(&mut self, state: &mut State, tau: &Vector3<f64>, h: f64) -> bool {
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
        middle
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
            let stretch = middle.motor_q[j] - middle.q[j];
            let (torque, k, d) = self.spring(j, stretch, middle.motor_dq[j] - middle.dq[j]);
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
