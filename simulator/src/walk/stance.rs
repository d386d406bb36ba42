//! How a robot stands of which nothing is known but its tree: where its feet are to be under a level trunk, and the angles that put them there.
//!
//! As drawn, with all joints at zero, most robots' legs are straight and below the trunk; the trunk sinks from there by a share of the legs'
//! length; feet that are too near to each other's side for that height move apart, and all together until their middle is below the centre of mass. Angles are found by damped least squares along the way
//! from the trunk to each foot, from many starts: nothing is assumed of a leg but that its joints can put its foot there within their stops.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector2, Vector3};
use proprio_core::spatial::Transform;
use proprio_core::tree::Joint;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::WalkError;
use super::robot::{WalkRobot, placed};

/// How deep a foot is below its first joint as the robot stands, as a share of the depth as drawn: a Go2's gaits, lifts and sways need 0.63 to 0.7.
const DEPTH: f64 = 0.7;
/// Least distance of feet from the middle between left and right, as a share of the trunk's height, a Go2's: on two diagonal feet a trunk topples towards
/// a third, the sooner the nearer that is to their line. HyQ's are 0.37 as drawn, where its trot falls after 5 to 13 s in 5 of 5; with a tenth of its mass on
/// the trunk it falls in 2 of 5 at 0.42, and in none of 5 at 0.45, 0.49 and 0.55.
const ASIDE: f64 = 0.49;
/// Fewer feet than these carry a robot only if it balances, which the controller of joints here does not.
const LEAST_FEET: usize = 3;
/// Starts of the search for a foot's angles, and the most steps of each: of 300 random angles of a leg of three joints a third converge.
const STARTS: usize = 300;
const STEPS: usize = 60;
/// A foot is where it was asked for to this, m and rad: a hundredth of what sensors resolve.
const FOUND: f64 = 1e-7;
/// Damping of a step, as a share of the squared lengths in it: it keeps straight legs from leaping.
const DAMPING: f64 = 1e-6;
/// Longest change of a joint in a step, rad or m: within it a leg is nearly linear.
const LONGEST: f64 = 0.3;
/// Angles are looked for this far, rad, where stops are farther or none: beyond it a leg is wound up.
const FARTHEST: f64 = 2.7;
/// Room that a standing joint keeps to its stops, rad: a gait moves it to both sides.
const ROOM: f64 = 0.05;
/// Two postures are equally near to the drawn one within this, rad: the mirror images of a leg without a knee's stop.
const ALIKE: f64 = 0.02;

/// How a robot stands.
#[derive(Debug, Clone)]
pub(super) struct Stance {
    /// Height of the trunk above the ground, m.
    pub(super) height: f64,
    /// Where each foot is under a level trunk, m.
    pub(super) home: Vec<Vector2<f64>>,
    /// All joints, rad or m.
    pub(super) q: DVector<f64>,
    /// The way to each foot.
    pub(super) chains: Vec<Chain>,
}

/// The way from the trunk to a foot.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Bodies, that on the trunk first.
    bodies: Vec<usize>,
    /// The foot's middle in its body, m.
    middle: Vector3<f64>,
    /// How a flat foot is turned under a level trunk.
    level: Option<Matrix3<f64>>,
}

/// Where a chain's foot is, how it is turned, and how these move with the chain's joints.
struct Foot {
    place: Vector3<f64>,
    rotation: Matrix3<f64>,
    /// Of each joint: velocity of the place, and of the turn.
    columns: Vec<[Vector3<f64>; 2]>,
}

impl Chain {
    fn new(robot: &WalkRobot, foot: usize) -> Self {
        let foot = &robot.feet[foot];
        let mut bodies: Vec<usize> = robot.way(foot.body).collect();
        bodies.reverse();
        let mut chain = Self {
            bodies,
            middle: foot.middle(),
            level: None,
        };
        if foot.is_flat() {
            let drawn = chain.foot(robot, &DVector::zeros(robot.facts().len()));
            // The plane of its points, turned the least way level.
            let [a, b] = [1, 2].map(|n| foot.points[n] - foot.points[0]);
            let normal = drawn.rotation * a.cross(&b);
            let up = normal * normal.z.signum();
            let levelled = Rotation3::rotation_between(&up, &Vector3::z());
            chain.level = levelled.map(|turn| turn.matrix() * drawn.rotation);
        }
        chain
    }

    /// Its joints' numbers.
    pub(super) fn joints(&self) -> impl Iterator<Item = usize> {
        self.bodies.iter().map(|b| b - 1)
    }

    fn foot(&self, robot: &WalkRobot, q: &DVector<f64>) -> Foot {
        let mut frame = Transform::identity();
        let mut joints = Vec::with_capacity(self.bodies.len());
        for &b in &self.bodies {
            let body = &robot.bodies[b];
            frame = frame.compose(&placed(body, q[b - 1]));
            joints.push((frame, body.joint));
        }
        let place = frame.rotation * self.middle + frame.translation;
        let column = |(frame, joint): &(Transform<f64>, Joint<f64>)| match joint {
            Joint::Revolute(axis) => {
                let axis = frame.rotation * axis;
                [axis.cross(&(place - frame.translation)), axis]
            }
            Joint::Prismatic(axis) => [frame.rotation * axis, Vector3::zeros()],
            Joint::Free => [Vector3::zeros(); 2],
        };
        Foot {
            place,
            rotation: frame.rotation,
            columns: joints.iter().map(column).collect(),
        }
    }

    /// Moves its joints in `q` until the foot is at `place` in the trunk, and a flat one level above ground that is turned by `ground`; tells how far it
    /// stays off, m and rad.
    pub(super) fn reach(
        &self,
        robot: &WalkRobot,
        q: &mut DVector<f64>,
        place: &Vector3<f64>,
        ground: &Rotation3<f64>,
    ) -> f64 {
        let joints = self.bodies.len();
        // A leg of five joints cannot turn its foot about the vertical, one of fewer cannot keep it level either.
        let turned = match (self.level.is_some(), joints) {
            (true, 6..) => 3,
            (true, 5) => 2,
            _ => 0,
        };
        let mut off = f64::INFINITY;
        for _ in 0..STEPS {
            let foot = self.foot(robot, q);
            let back = ground.inverse();
            let mut error = DVector::zeros(3 + turned);
            let mut rows = DMatrix::zeros(3 + turned, joints);
            error
                .fixed_rows_mut::<3>(0)
                .copy_from(&(place - foot.place));
            let mut axis = Vector3::zeros();
            if let Some(level) = self.level.filter(|_| turned > 0) {
                let wanted = Rotation3::from_matrix_unchecked(ground.matrix() * level);
                let is = Rotation3::from_matrix_unchecked(foot.rotation);
                axis = back * (wanted * is.inverse()).scaled_axis();
            }
            error.rows_mut(3, turned).copy_from(&axis.rows(0, turned));
            for (c, [moves, turns]) in foot.columns.iter().enumerate() {
                rows.fixed_view_mut::<3, 1>(0, c).copy_from(moves);
                let turns = back * turns;
                rows.view_mut((3, c), (turned, 1))
                    .copy_from(&turns.rows(0, turned));
            }
            off = error.norm();
            if off < FOUND {
                break;
            }
            let mut square = &rows * rows.transpose();
            let damping = DAMPING * robot.longer * robot.longer;
            for n in 0..square.nrows() {
                square[(n, n)] += damping;
            }
            let Some(root) = square.cholesky() else { break };
            let step = rows.transpose() * root.solve(&error);
            let shorter = (LONGEST / step.amax()).min(1.0);
            for (joint, step) in self.joints().zip(step.iter()) {
                q[joint] += step * shorter;
            }
        }
        off
    }

    /// The angles nearest to the drawn ones that put the foot there, into `q`.
    fn find(&self, robot: &WalkRobot, q: &mut DVector<f64>, place: &Vector3<f64>) -> Option<()> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let facts = robot.facts();
        let within = |j: usize| {
            let [lower, upper] = facts[j].limits;
            [lower.max(-FARTHEST), upper.min(FARTHEST)]
        };
        let mut best: Option<(f64, f64, DVector<f64>)> = None;
        for _ in 0..STARTS {
            let mut own = q.clone();
            for j in self.joints() {
                let [lower, upper] = within(j);
                own[j] = lower + (upper - lower) * rng.random_range(0.0..1.0);
            }
            if self.reach(robot, &mut own, place, &Rotation3::identity()) > FOUND {
                continue;
            }
            let beyond = |j: usize| {
                let [lower, upper] = within(j);
                own[j] < lower + ROOM || own[j] > upper - ROOM
            };
            if self.joints().any(beyond) {
                continue;
            }
            let far = self.joints().map(|j| own[j] * own[j]).sum::<f64>().sqrt();
            // Of mirror images that whose last joint is farther behind: knees bend as a Go2's do.
            let knee = self.knee(robot, &own);
            let better = best.as_ref().is_none_or(|(least, behind, _)| {
                far < least - ALIKE || (far < least + ALIKE && knee < *behind)
            });
            if better {
                best = Some((far, knee, own));
            }
        }
        *q = best?.2;
        Some(())
    }

    /// How far the joint that its last body turns about is ahead, m.
    fn knee(&self, robot: &WalkRobot, q: &DVector<f64>) -> f64 {
        let mut frame = Transform::identity();
        for &b in &self.bodies {
            frame = frame.compose(&placed(&robot.bodies[b], q[b - 1]));
        }
        frame.translation.x
    }
}

impl Stance {
    /// Looks for it.
    ///
    /// # Errors
    /// [`WalkError::Stance`] tells which foot cannot be where it has to.
    pub(super) fn new(robot: &WalkRobot) -> Result<Self, WalkError> {
        let chains: Vec<Chain> = (0..robot.feet.len())
            .map(|n| Chain::new(robot, n))
            .collect();
        let cannot = |foot: usize, why: &str| WalkError::Stance {
            foot: robot.feet[foot].name.clone(),
            why: why.to_owned(),
        };
        let drawn = DVector::zeros(robot.facts().len());
        if robot.feet.len() < LEAST_FEET {
            return Err(cannot(
                0,
                "a robot on one or two feet has to balance, which is not simulated: take one of three feet or more",
            ));
        }
        let mut home = Vec::new();
        let mut height = f64::INFINITY;
        for (n, chain) in chains.iter().enumerate() {
            let place = chain.foot(robot, &drawn).place;
            let Some(hip) = chain
                .bodies
                .first()
                .map(|b| robot.bodies[*b].placement.translation)
            else {
                return Err(cannot(n, "it is fixed to the trunk"));
            };
            let depth = hip.z - place.z;
            if depth <= 0.2 * (place - hip).norm() {
                return Err(cannot(
                    n,
                    "as drawn, with all joints at zero, it is not below its leg's first joint",
                ));
            }
            height = height.min(DEPTH * depth - hip.z + robot.feet[n].radius);
            home.push(place.xy());
        }
        let mut stance = Self {
            height,
            home: apart(&home, height),
            q: robot.standing(),
            chains,
        };
        if stance.settle(robot).is_err() {
            // Stops may keep feet from going apart: as drawn, then.
            (stance.home, stance.q) = (home, robot.standing());
            let found = stance.settle(robot);
            let why = "no angles within the joints' stops put it below the trunk";
            found.map_err(|foot| cannot(foot, why))?;
        }
        Ok(stance)
    }

    /// Finds the angles for where the feet are, and moves these below the centre of mass; fails with the number of a foot that has none.
    fn settle(&mut self, robot: &WalkRobot) -> Result<(), usize> {
        // The centre of mass moves a little with the legs.
        for round in 0..4 {
            let mut q = self.q.clone();
            for (n, chain) in self.chains.iter().enumerate() {
                let place = self.home[n].push(robot.feet[n].radius - self.height);
                let found = match round {
                    0 => chain.find(robot, &mut q, &place),
                    _ => (chain.reach(robot, &mut q, &place, &Rotation3::identity()) < FOUND)
                        .then_some(()),
                };
                found.ok_or(n)?;
            }
            self.q = q;
            let middle = self.home.iter().sum::<Vector2<f64>>() / self.home.len() as f64;
            let off = centre_of_mass(robot, &self.q).xy() - middle;
            self.home.iter_mut().for_each(|home| *home += off);
        }
        Ok(())
    }

    /// The joints that no foot hangs on, with the middle of their motion, rad or m: as far from their stops as `swing` needs, if they can.
    pub(super) fn idle(&self, robot: &WalkRobot, swing: f64) -> Vec<(usize, f64)> {
        let busy = |j: &usize| {
            self.chains
                .iter()
                .any(|chain| chain.joints().any(|own| own == *j))
        };
        let all = 0..robot.facts().len();
        let middle = |j: usize| {
            let [lower, upper] = robot.facts()[j].limits;
            (j, 0f64.max(lower + swing).min(upper - swing))
        };
        all.filter(|j| !busy(j)).map(middle).collect()
    }
}

/// The feet as far apart as a trunk of this height (m) needs, by [`ASIDE`].
fn apart(home: &[Vector2<f64>], height: f64) -> Vec<Vector2<f64>> {
    let count = home.len() as f64;
    let middle = home.iter().map(|home| home.y).sum::<f64>() / count;
    let aside = home.iter().map(|home| (home.y - middle).abs()).sum::<f64>() / count;
    // Feet on one line have no sides to go to.
    let wider = if aside > 0.0 {
        (ASIDE * height / aside).max(1.0)
    } else {
        1.0
    };
    let moved = |home: &Vector2<f64>| Vector2::new(home.x, middle + (home.y - middle) * wider);
    home.iter().map(moved).collect()
}

/// Of the whole robot under a level trunk, m.
fn centre_of_mass(robot: &WalkRobot, q: &DVector<f64>) -> Vector3<f64> {
    let mut frames: Vec<Transform<f64>> = vec![Transform::identity()];
    let (mut moment, mut mass) = (Vector3::zeros(), 0.0);
    for (b, body) in robot.bodies.iter().enumerate() {
        if let Some(parent) = body.parent {
            let frame = frames[parent].compose(&placed(body, q[b - 1]));
            frames.push(frame);
        }
        let own = body.inertia;
        moment += frames[b].rotation * own.first_moment() + frames[b].translation * own.mass();
        mass += own.mass();
    }
    moment / mass
}
