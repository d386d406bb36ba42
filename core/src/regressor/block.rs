//! The force and couple that one body needs, as 6 × 10 numbers that multiply its inertial parameters.

use crate::Real;
use crate::dynamics::Acceleration;
use crate::inertia::INERTIAL;
use nalgebra::{Matrix3, Vector3};

/// What one body needs to move as it does: in its own coordinates, with its frame's classical acceleration a less gravity,
///
/// ```text
/// f = m a + A h,     n = −[a]× h + N Ī,     A = [α]× + [ω]×²,     N = L(α) + [ω]× L(ω)
/// ```
///
/// with L(ω) Ī = I ω. The couple's part of h is what the force's part of m is, so it is not kept.
#[derive(Clone, Copy)]
pub(super) struct Block<T> {
    /// \[a | A\], rows x, y, z: the force's columns m, hx, hy, hz.
    force: [[T; 4]; 3],
    /// N: the couple's columns Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
    couple: [[T; 6]; 3],
}

impl<T: Real> Block<T> {
    pub(super) const ZERO: Self = Self {
        force: [[T::ZERO; 4]; 3],
        couple: [[T::ZERO; 6]; 3],
    };

    #[inline(always)]
    pub(super) fn new(moved: &Acceleration<T>) -> Self {
        let (w, alpha, a) = (&moved.velocity, &moved.angular, &moved.linear);
        let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
        let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
        Self {
            force: [
                [a.x, -(yy + zz), xy - alpha.z, xz + alpha.y],
                [a.y, xy + alpha.z, -(xx + zz), yz - alpha.x],
                [a.z, xz - alpha.y, yz + alpha.x, -(xx + yy)],
            ],
            couple: [
                [alpha.x, alpha.y - xz, alpha.z + xy, -yz, yy - zz, yz],
                [xz, alpha.x + yz, zz - xx, alpha.y, alpha.z - xy, -xz],
                [-xy, xx - yy, alpha.x - yz, xy, alpha.y + xz, alpha.z],
            ],
        }
    }

    #[inline(always)]
    pub(super) fn force(&self) -> &[[T; 4]; 3] {
        &self.force
    }

    #[inline(always)]
    pub(super) fn couple(&self) -> &[[T; 6]; 3] {
        &self.couple
    }

    /// a.
    #[inline(always)]
    pub(super) fn acceleration(&self) -> Vector3<T> {
        Vector3::new(self.force[0][0], self.force[1][0], self.force[2][0])
    }

    /// s·n + l·f: what a coordinate feels that moves the body's frame by the twist (s, l).
    #[inline(always)]
    pub(super) fn along(&self, s: &Vector3<T>, l: &Vector3<T>) -> [T; INERTIAL] {
        // s·(−[a]× h) = h·(a × s).
        let h = self.acceleration().cross(s);
        let f = combine(&self.force, l);
        let n = combine(&self.couple, s);
        [
            f[0],
            f[1] + h.x,
            f[2] + h.y,
            f[3] + h.z,
            n[0],
            n[1],
            n[2],
            n[3],
            n[4],
            n[5],
        ]
    }

    /// Six rows: the couple about the origin of the frame in which the body is turned by `rotation` and placed at `p`, and
    /// the force, in that frame's axes.
    #[inline(always)]
    pub(super) fn rows(&self, rotation: &Matrix3<T>, p: &Vector3<T>) -> [[T; INERTIAL]; 6] {
        let a = self.acceleration();
        let zero = T::zero();
        let axes: [Vector3<T>; 3] = core::array::from_fn(|n| rotation.row(n).transpose());
        let f: [[T; 4]; 3] = core::array::from_fn(|n| combine(&self.force, &axes[n]));
        let couple = |n: usize| {
            let (j, k) = ((n + 1) % 3, (n + 2) % 3);
            let h = a.cross(&axes[n]);
            let i = combine(&self.couple, &axes[n]);
            let lever: [T; 4] = core::array::from_fn(|c| p[j] * f[k][c] - p[k] * f[j][c]);
            [
                lever[0],
                lever[1] + h.x,
                lever[2] + h.y,
                lever[3] + h.z,
                i[0],
                i[1],
                i[2],
                i[3],
                i[4],
                i[5],
            ]
        };
        let force = |n: usize| {
            let [m, x, y, z] = f[n];
            [m, x, y, z, zero, zero, zero, zero, zero, zero]
        };
        [
            couple(0),
            couple(1),
            couple(2),
            force(0),
            force(1),
            force(2),
        ]
    }
}

/// Σ by_i rows_i.
#[inline(always)]
fn combine<T: Real, const N: usize>(rows: &[[T; N]; 3], by: &Vector3<T>) -> [T; N] {
    core::array::from_fn(|n| rows[0][n] * by.x + rows[1][n] * by.y + rows[2][n] * by.z)
}
