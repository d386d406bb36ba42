//! The mechanics of one pinned leg: rigid links, and what their joints have beyond them.
//!
//! Link and motor of a joint are one mass, or two where something gives between them. [`step`] moves them.

mod step;

use nalgebra::{Matrix3, Vector3};
use proprio_core::go2::JOINTS_PER_LEG as JOINTS;
use proprio_core::spatial::{Motion, Transform};
use proprio_core::tree::{Kinematics, Tree};

use super::dry;
use super::effect::{Effect, JointState, MEMORIES, Transmission, with_slots};

/// The foot in the calf's frame, m (go2.md).
const FOOT: Vector3<f64> = Vector3::new(0.0, 0.0, -0.213);

/// What one joint has beyond the rigid bodies.
pub(super) struct PlantJoint {
    /// At most one of a kind.
    pub(super) effects: Vec<Box<dyn Effect>>,
    /// Rotor inertia as the joint feels it, kg m².
    pub(super) armature: f64,
    /// Inertia of what turns with the sum of this joint and the one before, kg m².
    pub(super) coupled_inertia: f64,
    /// What lies between motor and link; `None` is a rigid gear.
    pub(super) transmission: Option<Transmission>,
    /// Motor turns per joint turn.
    pub(super) gear: f64,
}

/// The four entries of a matrix that a rotor adds to which turns with the sum of two coordinates.
pub(super) fn pairs(a: usize, b: usize) -> [(usize, usize); 4] {
    [(a, a), (b, b), (a, b), (b, a)]
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
    /// State of the friction inside each joint's spring, from −1 to 1.
    pub(super) inside: [f64; JOINTS],
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
            inside: [0.0; JOINTS],
        }
    }
}

/// A leg's mechanics.
pub(super) struct Plant {
    pub(super) tree: Tree<f64, JOINTS, JOINTS>,
    /// The base in the world.
    pub(super) base: Transform<f64>,
    /// What the joints feel of a base that moves, N m.
    pub(super) recoil: Vector3<f64>,
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
            recoil: Vector3::zeros(),
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

    /// Accelerations of the links in the last step, rad/s².
    pub(super) fn last_acceleration(&self) -> Vector3<f64> {
        self.last.link
    }

    /// The effects of joint `j`, each with the place of its memory.
    fn effects(&self, j: usize) -> impl Iterator<Item = (&dyn Effect, usize)> {
        with_slots(&self.joints[j].effects)
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
            link: self.tree.inverse_dynamics(&k, &state.dq, &zero) + self.recoil
                - self.foot_torque(&k, state.t),
            motor: zero,
            dry: [[0.0; 2]; JOINTS],
        };
        for j in 0..JOINTS {
            for (effect, slot) in self.effects(j) {
                let seen = self.seen(j, slot, state, transmitted[j]);
                loads.link[j] += effect.link_torque(&seen);
                loads.motor[j] += effect.motor_torque(&seen);
                if let Some(before) = j.checked_sub(1) {
                    let both = [j, before].map(|j| [state.motor_q[j], state.motor_dq[j]]);
                    let [own, carrier] = effect.coupled_torque(both[0], both[1]);
                    loads.motor[j] += own;
                    loads.motor[before] += carrier;
                }
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
            .placements
            .from_parent
            .iter()
            .fold(Matrix3::identity(), |r, x| r * x.rotation);
        let here = in_base.tr_mul(&force);
        let jacobians = self.tree.jacobians(k);
        Vector3::from_fn(|c, _| {
            let s: &Motion<f64> = &jacobians.subspace[JOINTS - 1][c];
            (s.linear + s.angular.cross(&FOOT)).dot(&here)
        })
    }

    /// Torque of the spring between motor and link of joint `j`, N m, with its stiffness and damping; zero within the play.
    fn spring(&self, j: usize, state: &State) -> (f64, f64, f64) {
        let stretch = state.motor_q[j] - state.q[j];
        let rate = state.motor_dq[j] - state.dq[j];
        let Some(between) = self.joints[j].transmission else {
            return (0.0, 0.0, 0.0);
        };
        let slack = between.gap / 2.0;
        if between.gap > 0.0 && stretch.abs() <= slack {
            return (0.0, 0.0, 0.0);
        }
        let (k, d) = (between.stiffness, between.damping);
        let taut = stretch - slack * stretch.signum();
        (
            k * taut + d * rate + between.friction * state.inside[j],
            k,
            d,
        )
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
                    let (spring, _, _) = self.spring(j, state);
                    torque[j] += spring;
                    motor[j] = (free - spring) / joint.armature;
                } else {
                    inertia[(j, j)] += joint.armature;
                    torque[j] += free;
                }
            }
            for j in 1..JOINTS {
                // Where a gear gives way the coupled rotor is left out: a first step begins here, no more.
                if [j - 1, j]
                    .iter()
                    .all(|&j| self.joints[j].transmission.is_none())
                {
                    for (row, column) in pairs(j - 1, j) {
                        inertia[(row, column)] += self.joints[j].coupled_inertia;
                    }
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
}
