//! A Go2's leg in closed form: the foot from the joints, the joints from the foot, and how both move.
//!
//! With u = (X, S, Z) the foot's centre in the frame that turns with the hip, S the thigh's offset to the side,
//!
//! ```text
//! (X, Z) = R(q₂) ((0, −L) + R(q₃) (x_f, z_f)),   R(θ) (x, z) = (x cos θ + z sin θ, −x sin θ + z cos θ)
//! foot   = hip + R_x(q₁) u
//! ```
//!
//! The hip follows from y and z, the knee from the distance, the thigh from the direction (Siciliano et al. 2009, §2.12.2: a planar
//! arm behind a shoulder). Of the two knees the Go2's is taken: the one that bends backwards, q₃ < 0.

use nalgebra::{Matrix3, Rotation3, Vector3};
use proprio_core::go2::{self, JOINTS_PER_LEG};

/// One leg's lengths, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LegGeometry {
    /// The hip's origin in the base's frame.
    pub(super) hip: Vector3<f64>,
    /// From the hip to the thigh's plane, along y.
    side: f64,
    /// From thigh to calf.
    thigh: f64,
    /// The foot's centre in the calf's frame, x and z.
    foot: [f64; 2],
}

/// Parts of the foot's place in the plane of the leg: whole, and of the calf alone.
struct InPlane {
    whole: [f64; 2],
    calf: [f64; 2],
}

impl LegGeometry {
    /// Those of the Go2's leg of this number, in SDK order.
    pub(super) fn of(leg: usize) -> Self {
        let tree = go2::free::<f64>();
        let first = 1 + JOINTS_PER_LEG * leg;
        let origin = |body: usize| tree.bodies()[body].placement.translation;
        let centre = go2::feet::<f64>()[leg].centre;
        Self {
            hip: origin(first),
            side: origin(first + 1).y,
            thigh: -origin(first + 2).z,
            foot: [centre.x, centre.z],
        }
    }

    fn in_plane(&self, q: &[f64; 3]) -> InPlane {
        let calf = turned(self.foot, q[1] + q[2]);
        let thigh = turned([0.0, -self.thigh], q[1]);
        InPlane {
            whole: [thigh[0] + calf[0], thigh[1] + calf[1]],
            calf,
        }
    }

    /// The foot's centre in the base's frame, m.
    pub(super) fn foot(&self, q: &[f64; 3]) -> Vector3<f64> {
        let [x, z] = self.in_plane(q).whole;
        self.hip + about_x(q[0]) * Vector3::new(x, self.side, z)
    }

    /// Its velocity (m/s) per unit of each joint's.
    pub(super) fn jacobian(&self, q: &[f64; 3]) -> Matrix3<f64> {
        let InPlane { whole, calf } = self.in_plane(q);
        let turn = about_x(q[0]);
        let from_hip = turn * Vector3::new(whole[0], self.side, whole[1]);
        // A turn by θ moves (x, z) by (z, −x).
        Matrix3::from_columns(&[
            Vector3::x().cross(&from_hip),
            turn * Vector3::new(whole[1], 0.0, -whole[0]),
            turn * Vector3::new(calf[1], 0.0, -calf[0]),
        ])
    }

    /// Its acceleration (m/s²) where the joints move at `dq` (rad/s) and are not accelerated.
    pub(super) fn bias(&self, q: &[f64; 3], dq: &[f64; 3]) -> Vector3<f64> {
        let InPlane { whole, calf } = self.in_plane(q);
        let turn = about_x(q[0]);
        let (thigh, both) = (dq[1], dq[1] + dq[2]);
        // Each part of the leg in its plane turns at its own rate: its centripetal acceleration.
        let upper = [whole[0] - calf[0], whole[1] - calf[1]];
        let part = |k: usize| -(upper[k] * thigh * thigh + calf[k] * both * both);
        let speed = turn
            * Vector3::new(
                upper[1] * thigh + calf[1] * both,
                0.0,
                -upper[0] * thigh - calf[0] * both,
            );
        let from_hip = turn * Vector3::new(whole[0], self.side, whole[1]);
        let axis = Vector3::x() * dq[0];
        axis.cross(&axis.cross(&from_hip))
            + 2.0 * axis.cross(&speed)
            + turn * Vector3::new(part(0), 0.0, part(1))
    }

    /// The joint angles (rad) that put the foot's centre there (m, in the base's frame); none where the leg does not reach.
    pub(super) fn angles(&self, foot: &Vector3<f64>) -> Option<[f64; 3]> {
        let at = foot - self.hip;
        let below = at.y * at.y + at.z * at.z - self.side * self.side;
        if below <= 0.0 {
            return None;
        }
        let z = -below.sqrt();
        let hip = at.z.atan2(at.y) - z.atan2(self.side);
        let calf = self.foot[0].hypot(self.foot[1]);
        let cos = (at.x * at.x + z * z - self.thigh * self.thigh - calf * calf)
            / (2.0 * self.thigh * calf);
        if cos.abs() >= 1.0 {
            return None;
        }
        let knee = self.foot[0].atan2(-self.foot[1]) - cos.acos();
        let bent = turned(self.foot, knee);
        let thigh = at.x.atan2(z) - bent[0].atan2(bent[1] - self.thigh);
        Some([wrapped(hip), wrapped(thigh), knee])
    }

    /// The knee: the calf's origin in the base's frame, m.
    pub(super) fn knee(&self, q: &[f64; 3]) -> Vector3<f64> {
        let [x, z] = turned([0.0, -self.thigh], q[1]);
        self.hip + about_x(q[0]) * Vector3::new(x, self.side, z)
    }
}

/// (x, z) turned about y by θ.
fn turned([x, z]: [f64; 2], angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [cos * x + sin * z, cos * z - sin * x]
}

fn about_x(angle: f64) -> Matrix3<f64> {
    *Rotation3::from_axis_angle(&Vector3::x_axis(), angle).matrix()
}

/// The same angle between −π and π.
fn wrapped(angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    sin.atan2(cos)
}
