//! The mechanics of the whole robot: a trunk that nothing holds, its joints, its feet on the ground.
//!
//! From (q, v) over h it is the implicit midpoint rule in all that is smooth, the ground among it, and takes the side of dry friction
//! at its end ([`dry::hold`]), as a pinned leg's:
//!
//! ```text
//! H(q̄) (v' − v) = h [τ − b(q̄, v̄) − effects(q̄, v̄) + Jᵀ f(q̄, v̄) − |friction| sign(v')],   v̄ = (v + v')/2
//! ```
//!
//! v is the trunk's twist in its own axes, angular part first, then the joints' velocities; the trunk turns by v̄ over the step.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector2, Vector3};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Body, Joint};

use super::super::dry;
use super::super::effect::{Effect, JointState, MEMORIES, with_slots};
use super::super::plant::pairs;
use super::ground::{Ground, Meeting};
use super::mechanics::{Instant, Mechanics, TRUNK, mechanics};
use super::robot::WalkRobot;

/// Passes of a step at most, and the change of v̄ (rad/s, m/s) that ends them.
const PASSES: usize = 12;
const SETTLED: f64 = 1e-6;
/// The same of transmitted torques, N m, where dry friction depends on them.
const SETTLED_TORQUE: f64 = 1e-3;

/// One number of each velocity coordinate, and of each joint.
pub(super) type Coordinates = DVector<f64>;
pub(super) type Torques = DVector<f64>;

/// Where the robot is and how it moves.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    /// s.
    pub(super) t: f64,
    /// The trunk's frame in the world, m.
    pub(super) position: Vector3<f64>,
    pub(super) orientation: UnitQuaternion<f64>,
    /// Joints, rad.
    pub(super) q: Torques,
    pub(super) v: Coordinates,
    /// How far the bristle of each point that touches the ground is bent, m.
    pub(super) bent: Vec<Vector2<f64>>,
    /// Of the joints' effects.
    memory: Vec<[f64; MEMORIES]>,
}

impl State {
    /// At rest, on so many points.
    pub(super) fn new(t: f64, height: f64, q: Torques, points: usize) -> Self {
        Self {
            t,
            position: Vector3::new(0.0, 0.0, height),
            orientation: UnitQuaternion::identity(),
            v: Coordinates::zeros(TRUNK + q.len()),
            bent: vec![Vector2::zeros(); points],
            memory: vec![[0.0; MEMORIES]; q.len()],
            q,
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
        of_joints(&self.v)
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
            q: &self.q + v.rows(TRUNK, self.q.len()) * h,
            ..self.clone()
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        let all = self.v.iter().chain(&self.q).chain(&self.position);
        all.into_iter().all(|x| x.is_finite())
    }
}

/// A sphere that touches the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    body: usize,
    /// In its body, m.
    centre: Vector3<f64>,
    radius: f64,
}

/// The robot's mechanics.
pub(super) struct Plant {
    pub(super) robot: Arc<WalkRobot>,
    pub(super) mechanics: Box<dyn Mechanics>,
    /// What each joint has beyond the rigid bodies.
    pub(super) effects: Vec<Vec<Box<dyn Effect>>>,
    pub(super) ground: Ground,
    /// What touches the ground, foot by foot.
    points: Vec<Point>,
    /// What rotors add to the inertia.
    rotors: DMatrix<f64>,
    /// Whether some dry friction depends on the transmitted torque.
    load_matters: bool,
    /// Torques that the gears hand to the links in the last step, N m.
    transmitted: Torques,
    /// Accelerations of the last step, rad/s² and m/s²: where the next one's passes begin.
    last: Coordinates,
    /// Forces on the points in the world in the last step, N.
    forces: Vec<Vector3<f64>>,
}

/// Inertia and forces at one instant.
struct Loads {
    inertia: DMatrix<f64>,
    /// All smooth forces but the motors', N m and N.
    smooth: Coordinates,
    /// The part of these that is not the joints' effects.
    rigid: Coordinates,
    /// Sizes of dry friction in positive and negative motion, N m.
    dry: Vec<[f64; 2]>,
    /// Of the points.
    forces: Vec<Vector3<f64>>,
    bending: Vec<Vector2<f64>>,
}

impl Plant {
    /// Of a robot whose bodies are these; none if they make no tree.
    pub(super) fn new(
        robot: &Arc<WalkRobot>,
        bodies: &[Body<f64>],
        effects: Vec<Vec<Box<dyn Effect>>>,
        ground: Ground,
    ) -> Option<Self> {
        let all = || effects.iter().flatten();
        let joints = effects.len();
        let points: Vec<Point> = (robot.feet.iter())
            .flat_map(|foot| {
                foot.points.iter().map(|&centre| Point {
                    body: foot.body,
                    centre,
                    radius: foot.radius,
                })
            })
            .collect();
        Some(Self {
            rotors: rotors(robot, &effects),
            load_matters: all().any(|effect| effect.depends_on_load()),
            transmitted: Torques::zeros(joints),
            mechanics: mechanics(bodies)?,
            robot: Arc::clone(robot),
            effects,
            ground,
            last: Coordinates::zeros(TRUNK + joints),
            forces: vec![Vector3::zeros(); points.len()],
            points,
        })
    }

    /// How many points touch the ground.
    pub(super) fn points(&self) -> usize {
        self.points.len()
    }

    /// The force on each foot along the ground's normal, of those on its points, N.
    pub(super) fn on_feet(&self, forces: &[Vector3<f64>]) -> Vec<f64> {
        let mut next = forces.iter();
        let feet = self.robot.feet.iter();
        feet.map(|foot| next.by_ref().take(foot.points.len()).map(|f| f.z).sum())
            .collect()
    }

    /// What each joint's motor has to turn with the trunk held: all it carries, and its rotor, kg m².
    pub(super) fn inertia_of_joints(&self, state: &State) -> Torques {
        let instant = self.mechanics.at(&state.base(), &state.q, &state.v);
        of_joints(&instant.inertia.diagonal()) + self.rotors.diagonal()
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

    /// Forces on the points in the world in the middle of the last step, N.
    pub(super) fn forces(&self) -> &[Vector3<f64>] {
        &self.forces
    }

    /// Moves `state` by `h` seconds under the motors' true torques (N m). `None` if the inertia is not positive definite.
    pub(super) fn step(&mut self, state: &mut State, tau: &Torques, h: f64) -> Option<()> {
        let before = state.v.clone();
        let joints = state.q.len();
        let mut after = &before + &self.last * h;
        let mut bending = Vec::new();
        for _ in 0..PASSES {
            let loads = self.loads(state, &((&before + &after) / 2.0), h);
            let mut inertia = loads.inertia.clone();
            let mut own = inertia.view_mut((TRUNK, TRUNK), (joints, joints));
            own += &self.rotors;
            let mut forces = loads.smooth;
            let mut motors = forces.rows_mut(TRUNK, joints);
            motors += tau;
            let right = &inertia * &before + forces * h;
            let sizes: Vec<[f64; 2]> = (loads.dry.iter())
                .map(|sizes| sizes.map(|size| size * h))
                .collect();
            let found = dry::hold(&inertia, &right, &sizes, &after)?;
            let change = (&found - &after).amax() / 2.0;
            (after, bending, self.forces) = (found, loads.bending, loads.forces);
            // What moves the links, but for the ground and the bodies' own forces, the gears hand to them.
            let links = loads.inertia * ((&after - &before) / h) - loads.rigid;
            let transmitted = of_joints(&links);
            let shift = (&transmitted - &self.transmitted).amax();
            self.transmitted = transmitted;
            if change < SETTLED && (!self.load_matters || shift < SETTLED_TORQUE) {
                break;
            }
        }
        self.last = (&after - &before) / h;
        let mean = (&before + &after) / 2.0;
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
    ) -> Vec<[f64; MEMORIES]> {
        let mut all = state.memory.clone();
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
        let instant = self.mechanics.at(&middle.base(), &middle.q, mean);
        let mut loads = Loads {
            smooth: Coordinates::zeros(mean.len()),
            rigid: -&instant.bias,
            dry: vec![[0.0; 2]; mean.len()],
            forces: Vec::with_capacity(self.points.len()),
            bending: Vec::with_capacity(self.points.len()),
            inertia: DMatrix::zeros(0, 0),
        };
        self.stand(&mut loads, &instant, &state.bent, h);
        loads.inertia = instant.inertia;
        loads.smooth.copy_from(&loads.rigid);
        for j in 0..self.effects.len() {
            let carrier = self.robot.carrier(j);
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
    fn stand(&self, loads: &mut Loads, instant: &Instant, bent: &[Vector2<f64>], h: f64) {
        for (n, own) in self.points.iter().enumerate() {
            let (place, mut meeting) = own.meeting(instant);
            meeting.bent = bent[n];
            let answer = self.ground.answer(&meeting, h);
            loads.forces.push(answer.force);
            loads.bending.push(answer.bending);
            if answer.force != Vector3::zeros() {
                loads.rigid += generalised(
                    &self.robot,
                    &instant.frames,
                    own.body,
                    &place,
                    &answer.force,
                );
            }
        }
    }

    /// Where the force on a point acts, in the world, and how the point meets the ground; its bristle straight.
    #[cfg(test)]
    pub(super) fn meeting(&self, instant: &Instant, point: usize) -> (Vector3<f64>, Meeting) {
        self.points[point].meeting(instant)
    }
}

impl Point {
    /// See [`Plant::meeting`].
    fn meeting(&self, instant: &Instant) -> (Vector3<f64>, Meeting) {
        let (frame, twist) = (&instant.frames[self.body], &instant.velocity[self.body]);
        let lowest = lowest(frame, &self.centre, self.radius);
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

/// The joints' part of all coordinates.
pub(super) fn of_joints(all: &Coordinates) -> Torques {
    all.rows(TRUNK, all.len() - TRUNK).into_owned()
}

/// What rotors add to the joints' inertia: each to its own, and those that turn with the sum of two joints to both, kg m².
fn rotors(robot: &WalkRobot, effects: &[Vec<Box<dyn Effect>>]) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(effects.len(), effects.len());
    for (j, own) in effects.iter().enumerate() {
        for effect in own {
            all[(j, j)] += effect.armature();
            let coupled = effect.coupled_inertia();
            if coupled == 0.0 {
                continue;
            }
            if let Some(carrier) = robot.carrier(j) {
                pairs(carrier, j)
                    .into_iter()
                    .for_each(|at| all[at] += coupled);
            }
        }
    }
    all
}

/// The lowest point of a sphere of this radius about a body's point, in the world, m.
pub(super) fn lowest(frame: &Transform<f64>, centre: &Vector3<f64>, radius: f64) -> Vector3<f64> {
    frame.translation + frame.rotation * centre - Vector3::z() * radius
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

/// Jᵀ f of a `force` on a body at `point`, both in the world.
pub(super) fn generalised(
    robot: &WalkRobot,
    frames: &[Transform<f64>],
    body: usize,
    point: &Vector3<f64>,
    force: &Vector3<f64>,
) -> Coordinates {
    let mut all = Coordinates::zeros(TRUNK + robot.bodies.len() - 1);
    let base = &frames[0];
    let moment = (point - base.translation).cross(force);
    all.fixed_rows_mut::<3>(0)
        .copy_from(&base.rotation.tr_mul(&moment));
    all.fixed_rows_mut::<3>(3)
        .copy_from(&base.rotation.tr_mul(force));
    for b in robot.way(body) {
        all[TRUNK + b - 1] = match robot.bodies[b].joint {
            Joint::Revolute(axis) => {
                let moment = (point - frames[b].translation).cross(force);
                (frames[b].rotation * axis).dot(&moment)
            }
            Joint::Prismatic(axis) => (frames[b].rotation * axis).dot(force),
            Joint::Free => 0.0,
        };
    }
    all
}
