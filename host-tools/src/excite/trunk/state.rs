//! The whole robot at an instant, and what it asks of joints and feet.

use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};
use proprio_core::go2::{self, JOINTS, JOINTS_PER_LEG, LEGS};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;
use proprio_core::tree::{Kinematics, Tree};

use super::super::columns::sign;
use crate::free_base::legged::SCALE_OF_BASE;

/// Bodies of a Go2, the base first.
pub(super) const BODIES: usize = JOINTS + 1;
/// Velocity coordinates, six of the base before those of the joints.
pub(super) const COORDINATES: usize = JOINTS + 6;
/// What the equations of a walk are multiplied by, so that their noise is alike.
pub(super) const SCALE: [f64; COORDINATES] = {
    let mut scale = [1.0; COORDINATES];
    let mut c = 0;
    while c < 6 {
        scale[c] = SCALE_OF_BASE[c / 3];
        c += 1;
    }
    scale
};

/// The free Go2.
pub(super) type Robot = Tree<f64, BODIES, COORDINATES>;

/// Base and joints at an instant. The base's velocity itself is left out: dynamics is the same in every frame that moves uniformly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    /// From the base's axes to the world's.
    pub(super) rotation: Matrix3<f64>,
    /// The base's angular velocity in its own axes, rad/s.
    pub(super) turning: Vector3<f64>,
    /// Its rate, rad/s².
    pub(super) turning_rate: Vector3<f64>,
    /// The acceleration of the base's origin in its axes, without gravity, m/s².
    pub(super) acceleration: Vector3<f64>,
    /// Joint positions, rad.
    pub(super) q: [f64; JOINTS],
    /// rad/s.
    pub(super) dq: [f64; JOINTS],
    /// rad/s².
    pub(super) ddq: [f64; JOINTS],
}

impl State {
    /// The joints of a leg.
    pub(super) fn leg(of: &[f64; JOINTS], leg: usize) -> [f64; 3] {
        std::array::from_fn(|n| of[JOINTS_PER_LEG * leg + n])
    }

    /// Unit vector along gravity in the base's axes.
    pub(super) fn down(&self) -> Vector3<f64> {
        -self.rotation.row(2).transpose()
    }

    /// Velocities and accelerations in the tree's coordinates.
    pub(super) fn rates(&self) -> [SVector<f64, COORDINATES>; 2] {
        let of = |angular: &Vector3<f64>, linear: &Vector3<f64>, joints: &[f64; JOINTS]| {
            SVector::from_fn(|k, _| match k {
                0..3 => angular[k],
                3..6 => linear[k - 3],
                _ => joints[k - 6],
            })
        };
        [
            of(&self.turning, &Vector3::zeros(), &self.dq),
            of(&self.turning_rate, &self.acceleration, &self.ddq),
        ]
    }

    pub(super) fn kinematics(&self, robot: &Robot) -> Kinematics<f64, BODIES, COORDINATES> {
        let base = Transform {
            rotation: self.rotation,
            translation: Vector3::zeros(),
        };
        let q = SVector::from_fn(|k, _| if k < 6 { 0.0 } else { self.q[k - 6] });
        robot.kinematics(&base, &q, &self.rates()[0])
    }

    /// What the IMU reads: angular velocity (rad/s) and specific force (m/s²).
    pub(super) fn imu(&self, robot: &Robot) -> [Vector3<f64>; 2] {
        let at = Vector3::from(go2::IMU);
        let force = self.acceleration - self.down() * robot.gravity().norm()
            + self.turning_rate.cross(&at)
            + self.turning.cross(&self.turning.cross(&at));
        [self.turning, force]
    }
}

/// Friction and rotor of a joint, as the model states them or as they are expected of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Drive {
    /// N m s/rad.
    pub(super) viscous: f64,
    /// N m.
    pub(super) coulomb: f64,
    /// kg m².
    pub(super) armature: f64,
    /// N m.
    pub(super) bias: f64,
}

impl Drive {
    /// The torque that it takes, N m.
    pub(super) fn torque(&self, dq: f64, ddq: f64) -> f64 {
        self.viscous * dq + self.coulomb * sign(dq).0 + self.armature * ddq + self.bias
    }
}

/// Forces at the feet and torques of the joints that move the robot so.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Needed {
    /// On each foot, N, in the world's axes.
    pub(super) feet: [Vector3<f64>; LEGS],
    /// Of each joint, N m, with friction.
    pub(super) torque: [f64; JOINTS],
}

/// The feet's forces and the joints' torques by inverse dynamics with all feet on level ground; none where the legs cannot push.
///
/// Twelve numbers for six equations: of all that move the robot so, the forces of the least Σ |tangential|²/μ² + normal², which
/// leans to the inside of the friction cones (Kuindersma et al. 2016 weigh contact forces alike).
pub(super) fn needed(
    robot: &Robot,
    drives: &[Drive; JOINTS],
    state: &State,
    friction: f64,
) -> Option<Needed> {
    let k = state.kinematics(robot);
    let [v, a] = state.rates();
    let whole = robot.inverse_dynamics(&k, &v, &a);
    let down = state.down();
    let jacobians = go2::feet().map(|foot| {
        let own = robot.contact_jacobian(&k.placements, &foot, &down);
        state.rotation * own
    });
    let weight = Vector3::new(friction * friction, friction * friction, 1.0);
    let base = |j: &SMatrix<f64, 3, COORDINATES>| j.fixed_columns::<6>(0).into_owned();
    let mut grasp = Matrix6::zeros();
    for j in &jacobians {
        let own = base(j);
        grasp += own.transpose() * Matrix3::from_diagonal(&weight) * own;
    }
    let wrench: Vector6<f64> = whole.fixed_rows::<6>(0).into_owned();
    let shared = grasp.cholesky()?.solve(&wrench);
    let feet = jacobians.map(|j| weight.component_mul(&(base(&j) * shared)));
    let mut left = whole;
    for (j, force) in jacobians.iter().zip(&feet) {
        left -= j.tr_mul(force);
    }
    let torque = std::array::from_fn(|j| left[6 + j] + drives[j].torque(state.dq[j], state.ddq[j]));
    Some(Needed { feet, torque })
}

/// An orthonormal basis of the equations that no force at the feet reaches, in rows that are scaled by `scale`: its columns.
///
/// Motions v of base and joints that move no foot, J v = 0, taken as combinations of equations: vᵀ Jᵀλ = 0 for every λ.
pub(super) fn beside_feet(
    robot: &Robot,
    state: &State,
    scale: &[f64; COORDINATES],
) -> Option<DMatrix<f64>> {
    let k = state.kinematics(robot);
    let down = state.down();
    let mut free = DMatrix::zeros(COORDINATES, 6);
    for c in 0..6 {
        free[(c, c)] = 1.0;
    }
    for (leg, foot) in go2::feet().iter().enumerate() {
        let own = robot.contact_jacobian(&k.placements, foot, &down);
        let first = 6 + JOINTS_PER_LEG * leg;
        let joints = own.fixed_columns::<3>(first).into_owned();
        let follow = joints.try_inverse()? * own.fixed_columns::<6>(0);
        for r in 0..3 {
            for c in 0..6 {
                free[(first + r, c)] = -follow[(r, c)];
            }
        }
    }
    Some(orthonormal(free, scale))
}

/// The columns of `free` over `scale`, made orthonormal.
pub(super) fn orthonormal(mut free: DMatrix<f64>, scale: &[f64; COORDINATES]) -> DMatrix<f64> {
    for (r, scale) in scale.iter().enumerate() {
        free.row_mut(r).unscale_mut(*scale);
    }
    free.qr().q()
}

/// Rows of all bodies, of the joints' four effects and of the accelerometer's bias, one for each coordinate: what of the equations
/// each parameter makes.
pub(super) fn whole_rows(robot: &Robot, state: &State) -> SMatrix<f64, COORDINATES, COLUMNS> {
    let mut all = SMatrix::zeros();
    let k = state.kinematics(robot);
    let [v, a] = state.rates();
    let mut own = [[[0.0; INERTIAL]; BODIES]; COORDINATES];
    robot.write_inverse_dynamics_regressor(&k.placements, &v, &a, &mut own);
    for (c, bodies) in own.iter().enumerate() {
        for (n, x) in bodies.iter().flatten().enumerate() {
            all[(c, n)] = *x;
        }
    }
    for j in 0..JOINTS {
        let (dq, ddq) = (state.dq[j], state.ddq[j]);
        for (e, x) in [dq, sign(dq).0, ddq, 1.0].into_iter().enumerate() {
            all[(6 + j, INERTIAL * BODIES + 4 * j + e)] = x;
        }
    }
    // A bias is taken for an acceleration of the base.
    let inertia = robot.inertia_matrix(&k);
    for axis in 0..3 {
        for c in 0..COORDINATES {
            all[(c, COLUMNS - 3 + axis)] = -inertia[(c, 3 + axis)];
        }
    }
    all
}

/// Columns of [`whole_rows`].
pub(super) const COLUMNS: usize = INERTIAL * BODIES + 4 * JOINTS + 3;
