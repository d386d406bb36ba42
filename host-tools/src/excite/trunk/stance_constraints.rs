//! The robot over four planted feet: where the trunk is tells all joints.

use nalgebra::{Rotation3, Vector3};
use proprio_core::go2::{self, JOINTS, LEGS};

use super::leg::LegGeometry;
use super::state::State;

/// Names of the trunk's coordinates and their units, in the order of a motion's series.
pub const TRUNK_COORDINATES: [(&str, &str); 6] = [
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("roll", "rad"),
    ("pitch", "rad"),
    ("yaw", "rad"),
];

/// A coordinate with its rate and the rate of that.
pub(super) type Coordinate = [f64; 3];

/// Where the feet are. They stand below their thighs in the middle of the motion.
///
/// A foot's centre stays where it is, a radius above the floor. On a floor that does not let it slip the ball rolls instead, by its radius
/// times the angle that the calf turns ([`StanceConstraints::rolling`]): a foot then stands that much beside where this says, all feet to the same
/// side where the calves turn alike.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StanceConstraints {
    pub(super) legs: [LegGeometry; LEGS],
    /// The feet's centres in the world, m; the base's origin is at the world's in the middle of the motion, but for its height.
    centres: [Vector3<f64>; LEGS],
    /// Height of the base's origin above the floor in the middle of the motion, m.
    pub(super) height: f64,
}

impl StanceConstraints {
    pub(super) fn new(height: f64) -> Self {
        let legs = std::array::from_fn(LegGeometry::of);
        let feet = go2::feet::<f64>();
        let centres = std::array::from_fn(|leg: usize| {
            let straight = legs[leg].foot(&[0.0; 3]);
            let x = legs[leg].hip.x;
            Vector3::new(x, straight.y, feet[leg].radius)
        });
        Self {
            legs,
            centres,
            height,
        }
    }

    /// The robot with its trunk there: x, y and z from the middle of the motion (m), roll, pitch and yaw (rad; rotation
    /// R_z(yaw) R_y(pitch) R_x(roll)), each with its rate and the rate of that. None where a leg does not reach.
    pub(super) fn state(&self, trunk: &[Coordinate; 6]) -> Option<State> {
        let part = |d: usize, first: usize| {
            Vector3::new(trunk[first][d], trunk[first + 1][d], trunk[first + 2][d])
        };
        let [roll, pitch, yaw] = [trunk[3], trunk[4], trunk[5]];
        let rotation = *Rotation3::from_euler_angles(roll[0], pitch[0], yaw[0]).matrix();
        let (turning, turning_rate) = turning(roll, pitch, yaw);
        let place = part(0, 0) + Vector3::z() * self.height;
        let velocity = rotation.tr_mul(&part(1, 0));
        let acceleration = rotation.tr_mul(&part(2, 0));
        let mut state = State {
            rotation,
            turning,
            turning_rate,
            acceleration,
            q: [0.0; JOINTS],
            dq: [0.0; JOINTS],
            ddq: [0.0; JOINTS],
        };
        for (n, leg) in self.legs.iter().enumerate() {
            // The foot seen from the base, which moves away from it.
            let at = rotation.tr_mul(&(self.centres[n] - place));
            let speed = -turning.cross(&at) - velocity;
            let rate = -turning_rate.cross(&at) - turning.cross(&speed) - acceleration
                + turning.cross(&velocity);
            let q = leg.angles(&at)?;
            let inverse = leg.jacobian(&q).try_inverse()?;
            let dq = inverse * speed;
            let ddq = inverse * (rate - leg.bias(&q, &dq.into()));
            for j in 0..3 {
                (
                    state.q[3 * n + j],
                    state.dq[3 * n + j],
                    state.ddq[3 * n + j],
                ) = (q[j], dq[j], ddq[j]);
            }
        }
        Some(state)
    }

    /// How far a foot's ball has rolled along the floor since `before`, in the world's axes, m: the radius times the angle that its calf
    /// has turned about the floor's axes, for small angles.
    pub(super) fn rolling(&self, before: &State, now: &State, leg: usize) -> f64 {
        let calf = |state: &State| {
            let [hip, thigh, knee] = State::leg(&state.q, leg);
            state.rotation
                * Rotation3::from_axis_angle(&Vector3::x_axis(), hip).matrix()
                * Rotation3::from_axis_angle(&Vector3::y_axis(), thigh + knee).matrix()
        };
        let turned = Rotation3::from_matrix_unchecked(calf(now) * calf(before).transpose());
        let axis = turned.scaled_axis();
        go2::feet::<f64>()[leg].radius * axis.x.hypot(axis.y)
    }

    /// Heights above the floor of what may touch it beside the feet, m, with what it is: knees, and the trunk's and the head's ends.
    pub(super) fn heights(
        &self,
        trunk: &[Coordinate; 6],
        state: &State,
    ) -> impl Iterator<Item = (&'static str, f64)> {
        let up = -state.down();
        let base = self.height + trunk[2][0];
        let above = move |point: Vector3<f64>, radius: f64| base + up.dot(&point) - radius;
        let knees: Vec<Vector3<f64>> = (0..LEGS)
            .map(|leg| self.legs[leg].knee(&State::leg(&state.q, leg)))
            .collect();
        let body = BODY.map(|(point, radius)| ("the trunk", above(point.into(), radius)));
        let knees = knees
            .into_iter()
            .map(move |knee| ("a knee", above(knee, KNEE)));
        body.into_iter().chain(knees)
    }
}

/// Balls at the ends of the capsules of trunk and head, as [`super::super::go2`] has them: place in the base's frame, and radius, m.
const BODY: [([f64; 3], f64); 3] = [
    ([-0.188, 0.0, 0.0], 0.074),
    ([0.188, 0.0, 0.0], 0.074),
    ([0.293, 0.0, -0.06], 0.05),
];
/// Radius of a knee, m.
const KNEE: f64 = 0.03;

/// Angular velocity and its rate in the body's axes from roll, pitch and yaw with their rates (Siciliano et al. 2009, §3.6, for the axes
/// of the body).
fn turning(roll: Coordinate, pitch: Coordinate, yaw: Coordinate) -> (Vector3<f64>, Vector3<f64>) {
    let [(sr, cr), (sp, cp)] = [roll[0].sin_cos(), pitch[0].sin_cos()];
    let [r, p, y] = [roll, pitch, yaw].map(|c| c[1]);
    let [ra, pa, ya] = [roll, pitch, yaw].map(|c| c[2]);
    let velocity = Vector3::new(r - y * sp, p * cr + y * sr * cp, -p * sr + y * cr * cp);
    let rate = Vector3::new(
        ra - ya * sp - y * p * cp,
        pa * cr - p * r * sr + ya * sr * cp + y * r * cr * cp - y * p * sr * sp,
        -pa * sr - p * r * cr + ya * cr * cp - y * r * sr * cp - y * p * cr * sp,
    );
    (velocity, rate)
}
