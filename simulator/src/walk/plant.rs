//! The mechanics of the whole robot: a trunk that nothing holds, twelve joints, four feet on the ground.
//!
//! From (q, v) over h it is the implicit midpoint rule in all that is smooth, the ground among it, and takes the side of dry friction
//! at its end ([`dry::hold`]), as a pinned leg's:
//!
//! ```text
//! H(q̄) (v' − v) = h [τ − b(q̄, v̄) − effects(q̄, v̄) + Jᵀ f(q̄, v̄) − |friction| sign(v')],   v̄ = (v + v')/2
//! ```
//!
//! v is the trunk's twist in its own axes, angular part first, then the joints' velocities; the trunk turns by v̄ over the step.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector2, Vector3};
use proprio_core::go2::{FOOT_SPHERE, JOINTS, JOINTS_PER_LEG, LEGS};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Joint, Kinematics, Tree};

use super::super::dry;
use super::super::effect::{Effect, JointState, MEMORIES, with_slots};
use super::super::plant::pairs;
use super::ground::{Ground, Meeting};

/// Bodies and velocity coordinates.
pub(super) const BODIES: usize = 13;
pub(super) const COORDINATES: usize = 18;
/// The trunk's coordinates, before those of the joints.
const TRUNK: usize = 6;
/// Passes of a step at most, and the change of v̄ (rad/s, m/s) that ends them.
const PASSES: usize = 12;
const SETTLED: f64 = 1e-6;
/// The same of transmitted torques, N m, where dry friction depends on them.
const SETTLED_TORQUE: f64 = 1e-3;

pub(super) type Coordinates = SVector<f64, COORDINATES>;
pub(super) type Torques = SVector<f64, JOINTS>;
type FreeTree = Tree<f64, BODIES, COORDINATES>;

/// Where the robot is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct State {
    /// s.
    pub(super) t: f64,
    /// The trunk's frame in the world, m.
    pub(super) position: Vector3<f64>,
    pub(super) orientation: UnitQuaternion<f64>,
    /// Joints, rad.
    pub(super) q: Torques,
    pub(super) v: Coordinates,
    /// How far each foot's bristle is bent, m.
    pub(super) bent: [Vector2<f64>; LEGS],
    /// Of the joints' effects.
    memory: [[f64; MEMORIES]; JOINTS],
}

impl State {
    /// At rest.
    pub(super) fn new(t: f64, height: f64, q: Torques) -> Self {
        Self {
            t,
            position: Vector3::new(0.0, 0.0, height),
            orientation: UnitQuaternion::identity(),
            q,
            v: Coordinates::zeros(),
            bent: [Vector2::zeros(); LEGS],
            memory: [[0.0; MEMORIES]; JOINTS],
        }
    }

    /// The trunk in the world.
    pub(super) fn base(&self) -> Transform<f64> {
        Transform {
            rotation: *self.orientation.to_rotation_matrix().matrix(),
            translation: self.position,
        }
    }

    /// The joints' velocities, rad/s.
    pub(super) fn dq(&self) -> Torques {
        self.v.fixed_rows::<JOINTS>(TRUNK).into_owned()
    }

    /// `h` seconds on at the velocities `v`; these themselves stay.
    fn moved(&self, v: &Coordinates, h: f64) -> Self {
        let part = |first| v.fixed_rows::<3>(first) * h;
        let turn = part(0);
        // The trunk's own axes turn meanwhile: those of the middle hold for the whole.
        let middle = self.orientation * UnitQuaternion::from_scaled_axis(turn / 2.0);
        let mut orientation = self.orientation * UnitQuaternion::from_scaled_axis(turn);
        orientation.renormalize();
        Self {
            t: self.t + h,
            position: self.position + middle * part(3),
            orientation,
            q: self.q + v.fixed_rows::<JOINTS>(TRUNK) * h,
            ..*self
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        let all = self.v.iter().chain(&self.q).chain(&self.position);
        all.into_iter().all(|x| x.is_finite())
    }
}

/// The robot's mechanics.
pub(super) struct Plant {
    pub(super) tree: FreeTree,
    /// What each joint has beyond the rigid bodies.
    pub(super) effects: [Vec<Box<dyn Effect>>; JOINTS],
    pub(super) ground: Ground,
    /// What rotors add to the inertia.
    rotors: SMatrix<f64, JOINTS, JOINTS>,
    /// Whether some dry friction depends on the transmitted torque.
    load_matters: bool,
    /// Torques that the gears hand to the links in the last step, N m.
    transmitted: Torques,
    /// Accelerations of the last step, rad/s² and m/s²: where the next one's passes begin.
    last: Coordinates,
    /// Forces on the feet in the world in the last step, N.
    forces: [Vector3<f64>; LEGS],
}

/// Inertia and forces at one instant.
struct Loads {
    inertia: SMatrix<f64, COORDINATES, COORDINATES>,
    /// All smooth forces but the motors', N m and N.
    smooth: Coordinates,
    /// The part of these that is not the joints' effects.
    rigid: Coordinates,
    /// Sizes of dry friction in positive and negative motion, N m.
    dry: [[f64; 2]; COORDINATES],
    /// Of the feet.
    forces: [Vector3<f64>; LEGS],
    bending: [Vector2<f64>; LEGS],
}

impl Plant {
    pub(super) fn new(
        tree: FreeTree,
        effects: [Vec<Box<dyn Effect>>; JOINTS],
        ground: Ground,
    ) -> Self {
        let all = || effects.iter().flatten();
        Self {
            rotors: rotors(&effects),
            load_matters: all().any(|effect| effect.depends_on_load()),
            transmitted: Torques::zeros(),
            tree,
            effects,
            ground,
            last: Coordinates::zeros(),
            forces: [Vector3::zeros(); LEGS],
        }
    }

    /// The mean acceleration over the last step, rad/s² and m/s²: the derivative of [`State::v`].
    pub(super) fn acceleration(&self) -> &Coordinates {
        &self.last
    }

    /// Torques that the gears hand to the links in the last step, N m.
    #[cfg(test)]
    pub(super) fn transmitted(&self) -> &Torques {
        &self.transmitted
    }

    /// Forces on the feet in the world in the middle of the last step, N.
    pub(super) fn forces(&self) -> &[Vector3<f64>; LEGS] {
        &self.forces
    }

    /// Moves `state` by `h` seconds under the motors' true torques (N m). `None` if the inertia is not positive definite.
    pub(super) fn step(&mut self, state: &mut State, tau: &Torques, h: f64) -> Option<()> {
        let before = state.v;
        let mut after = before + self.last * h;
        let mut bending = [Vector2::zeros(); LEGS];
        for _ in 0..PASSES {
            let loads = self.loads(state, &((before + after) / 2.0), h);
            let mut inertia = loads.inertia;
            let mut own = inertia.fixed_view_mut::<JOINTS, JOINTS>(TRUNK, TRUNK);
            own += self.rotors;
            let mut forces = loads.smooth;
            let mut motors = forces.fixed_rows_mut::<JOINTS>(TRUNK);
            motors += tau;
            let right = inertia * before + forces * h;
            let sizes = loads.dry.map(|sizes| sizes.map(|size| size * h));
            let found = dry::hold(&inertia, &right, &sizes, &after)?;
            let change = (found - after).amax() / 2.0;
            (after, bending, self.forces) = (found, loads.bending, loads.forces);
            // What moves the links, but for the ground and the bodies' own forces, the gears hand to them.
            let links = loads.inertia * ((after - before) / h) - loads.rigid;
            let transmitted: Torques = links.fixed_rows::<JOINTS>(TRUNK).into();
            let shift = (transmitted - self.transmitted).amax();
            self.transmitted = transmitted;
            if change < SETTLED && (!self.load_matters || shift < SETTLED_TORQUE) {
                break;
            }
        }
        self.last = (after - before) / h;
        let mean = (before + after) / 2.0;
        let memory = self.remembered(state, &mean, h, 1.0);
        *state = state.moved(&mean, h);
        (state.v, state.memory) = (after, memory);
        for (bent, rate) in state.bent.iter_mut().zip(bending) {
            *bent += rate * h;
        }
        Some(())
    }

    /// The effects' memories after a `share` of what a step of `h` at velocities `v` changes them.
    fn remembered(
        &self,
        state: &State,
        v: &Coordinates,
        h: f64,
        share: f64,
    ) -> [[f64; MEMORIES]; JOINTS] {
        let mut all = state.memory;
        for (j, own) in all.iter_mut().enumerate() {
            let remembering = with_slots(&self.effects[j]).filter(|(e, _)| e.has_memory());
            for (effect, slot) in remembering {
                let after = effect.remember(own[slot], v[TRUNK + j], h);
                own[slot] += share * (after - own[slot]);
            }
        }
        all
    }

    /// What acts half a step on from `state` at the velocities `mean`.
    fn loads(&self, state: &State, mean: &Coordinates, h: f64) -> Loads {
        let middle = State {
            memory: self.remembered(state, mean, h, 0.5),
            ..state.moved(mean, h / 2.0)
        };
        let base = middle.base();
        let k = self.tree.kinematics(&base, &positions(&middle.q), mean);
        let bias = self.tree.inverse_dynamics(&k, mean, &Coordinates::zeros());
        let mut loads = Loads {
            inertia: self.tree.inertia_matrix(&k),
            smooth: Coordinates::zeros(),
            rigid: -bias,
            dry: [[0.0; 2]; COORDINATES],
            forces: [Vector3::zeros(); LEGS],
            bending: [Vector2::zeros(); LEGS],
        };
        self.stand(&mut loads, &k, &state.bent, h);
        loads.smooth = loads.rigid;
        for j in 0..JOINTS {
            let carrier = (!j.is_multiple_of(JOINTS_PER_LEG)).then(|| j - 1);
            for (effect, slot) in with_slots(&self.effects[j]) {
                let seen = JointState {
                    transmitted: self.transmitted[j],
                    memory: middle.memory[j][slot],
                    ..seen(middle.t, middle.q[j], mean[TRUNK + j])
                };
                loads.smooth[TRUNK + j] -= effect.motor_torque(&seen) + effect.link_torque(&seen);
                if let Some(carrier) = carrier {
                    let both = [j, carrier].map(|j| [middle.q[j], mean[TRUNK + j]]);
                    let [own, other] = effect.coupled_torque(both[0], both[1]);
                    loads.smooth[TRUNK + j] -= own;
                    loads.smooth[TRUNK + carrier] -= other;
                }
                let sizes = effect.dry_friction(&seen);
                for (sum, size) in loads.dry[TRUNK + j].iter_mut().zip(sizes) {
                    *sum += size;
                }
            }
        }
        loads
    }

    /// Adds what the ground does to the feet.
    fn stand(
        &self,
        loads: &mut Loads,
        k: &Kinematics<f64, BODIES, COORDINATES>,
        bent: &[Vector2<f64>; LEGS],
        h: f64,
    ) {
        let frames = frames(k);
        for leg in 0..LEGS {
            let (point, mut meeting) = self.meeting(k, &frames, leg);
            meeting.bent = bent[leg];
            let answer = self.ground.answer(&meeting, h);
            loads.forces[leg] = answer.force;
            loads.bending[leg] = answer.bending;
            if answer.force != Vector3::zeros() {
                loads.rigid += generalised(&self.tree, &frames, leg, &point, &answer.force);
            }
        }
    }

    /// Where a foot's force acts, in the world, and how the foot meets the ground; its bristle straight.
    pub(super) fn meeting(
        &self,
        k: &Kinematics<f64, BODIES, COORDINATES>,
        frames: &[Transform<f64>; BODIES],
        leg: usize,
    ) -> (Vector3<f64>, Meeting) {
        let (frame, twist) = (&frames[calf(leg)], &k.velocity[calf(leg)]);
        let lowest = lowest(frames, leg);
        let depth = -lowest.z;
        // Rubber and ground give way alike: the force acts half-way between the sphere's lowest and the ground as it was.
        let point = lowest + Vector3::z() * (depth.max(0.0) / 2.0);
        let local = frame.rotation.tr_mul(&(point - frame.translation));
        let velocity = frame.rotation * (twist.linear + twist.angular.cross(&local));
        let meeting = Meeting {
            depth,
            rate: -velocity.z,
            sliding: velocity.xy(),
            bent: Vector2::zeros(),
        };
        (point, meeting)
    }
}

/// What rotors add to the joints' inertia: each to its own, and those that turn with the sum of two joints to both, kg m².
fn rotors(effects: &[Vec<Box<dyn Effect>>; JOINTS]) -> SMatrix<f64, JOINTS, JOINTS> {
    let mut all = SMatrix::zeros();
    for (j, own) in effects.iter().enumerate() {
        for effect in own {
            all[(j, j)] += effect.armature();
            let coupled = effect.coupled_inertia();
            if coupled != 0.0 {
                pairs(j - 1, j)
                    .into_iter()
                    .for_each(|at| all[at] += coupled);
            }
        }
    }
    all
}

/// The body that carries a leg's foot.
fn calf(leg: usize) -> usize {
    JOINTS_PER_LEG * (leg + 1)
}

/// The lowest point of a foot's sphere in the world, m.
pub(super) fn lowest(frames: &[Transform<f64>; BODIES], leg: usize) -> Vector3<f64> {
    let (frame, (centre, radius)) = (&frames[calf(leg)], FOOT_SPHERE);
    frame.translation + frame.rotation * Vector3::from(centre) - Vector3::z() * radius
}

/// What an effect sees of a joint whose gear is rigid.
pub(super) fn seen(t: f64, q: f64, dq: f64) -> JointState {
    JointState {
        t,
        q,
        dq,
        link_q: q,
        link_dq: dq,
        transmitted: 0.0,
        temperature: 0.0,
        memory: 0.0,
    }
}

/// Positions of all coordinates: the tree does not read the trunk's.
pub(super) fn positions(q: &Torques) -> Coordinates {
    let mut all = Coordinates::zeros();
    all.fixed_rows_mut::<JOINTS>(TRUNK).copy_from(q);
    all
}

/// The bodies in the world.
pub(super) fn frames(k: &Kinematics<f64, BODIES, COORDINATES>) -> [Transform<f64>; BODIES] {
    let from_parent = &k.placements.from_parent;
    let mut frames = *from_parent;
    for b in 1..BODIES {
        let first_of_leg = (b - 1).is_multiple_of(JOINTS_PER_LEG);
        let parent = if first_of_leg { 0 } else { b - 1 };
        frames[b] = frames[parent].compose(&from_parent[b]);
    }
    frames
}

/// Jᵀ f of a `force` on a leg's foot at `point`, both in the world.
pub(super) fn generalised(
    tree: &FreeTree,
    frames: &[Transform<f64>; BODIES],
    leg: usize,
    point: &Vector3<f64>,
    force: &Vector3<f64>,
) -> Coordinates {
    let mut all = Coordinates::zeros();
    let base = &frames[0];
    let moment = (point - base.translation).cross(force);
    all.fixed_rows_mut::<3>(0)
        .copy_from(&base.rotation.tr_mul(&moment));
    all.fixed_rows_mut::<3>(3)
        .copy_from(&base.rotation.tr_mul(force));
    for b in calf(leg) + 1 - JOINTS_PER_LEG..=calf(leg) {
        if let Joint::Revolute(axis) = tree.bodies()[b].joint {
            let moment = (point - frames[b].translation).cross(force);
            all[TRUNK + b - 1] = (frames[b].rotation * axis).dot(&moment);
        }
    }
    all
}
