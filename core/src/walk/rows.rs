//! The rows of a walking robot's window, and how joints' and bodies' shares come into them.

use super::columns::{ACC, COLUMNS, EFFECTS, OWN, TRUNK};
use super::leg::{INERTIA, KEPT, Momenta};
use crate::factor::ROWS;
use crate::go2::{JOINTS, JOINTS_PER_LEG};
use crate::{Real, scalar::real};
use nalgebra::{Matrix3, Vector3};

/// The inverse of the noise of the base's equations beside a joint's torque: of moments (1), of forces (m).
pub(super) const SCALE: [f64; 2] = [0.3, 0.06];

/// What a joint's row has: its leg's inertial columns, its own effects, the accelerometer's, the right-hand side.
pub(super) const JOINT_ROW: usize = INERTIA + EFFECTS + 4;
/// One joint's.
pub(super) type JointRow<T> = [T; JOINT_ROW];

/// The rows of a closed window: mean forces and torques over it per unit of the parameters.
#[derive(Clone, Debug)]
pub(super) struct WalkRows<T> {
    /// The base's six, column by column, divided by their noise's.
    pub(super) base: [[T; ROWS]; COLUMNS + 1],
    /// Each joint's; zero of a loaded leg.
    pub(super) joints: [JointRow<T>; JOINTS],
    /// How many equations that are.
    pub(super) equations: usize,
}

impl<T: Real> WalkRows<T> {
    /// No rows: all zeros.
    pub(super) const fn zero() -> Self {
        Self {
            base: [[T::ZERO; ROWS]; COLUMNS + 1],
            joints: [[T::ZERO; JOINT_ROW]; JOINTS],
            equations: 0,
        }
    }

    pub(super) fn clear(&mut self) {
        self.base.as_flattened_mut().fill(T::zero());
        self.joints.as_flattened_mut().fill(T::zero());
    }

    /// Adds a leg's body's momenta.
    pub(super) fn add_momenta(&mut self, column: usize, momenta: &Momenta<T>, sign: T) {
        let columns = self.base.get_mut(column..).unwrap_or(&mut []);
        for (n, (to, couple)) in columns.iter_mut().zip(&momenta.couple).enumerate() {
            for k in 0..3 {
                to[k] += couple[k] * sign;
            }
            if let Some(force) = momenta.force.get(n) {
                for k in 0..3 {
                    to[3 + k] += force[k] * sign;
                }
            }
        }
    }

    /// Adds the trunk's.
    pub(super) fn add_trunk(
        &mut self,
        w: &Vector3<T>,
        v: &Vector3<T>,
        rotation: &Matrix3<T>,
        place: &Vector3<T>,
        sign: T,
    ) {
        let o = T::zero();
        let mut columns = self.base.iter_mut().skip(TRUNK);
        let mut add = |couple: Vector3<T>, force: Vector3<T>| {
            let force = rotation * force;
            let couple = rotation * couple + place.cross(&force);
            if let Some(to) = columns.next() {
                for k in 0..3 {
                    to[k] += couple[k] * sign;
                    to[3 + k] += force[k] * sign;
                }
            }
        };
        add(Vector3::zeros(), *v);
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            add(axis.cross(v), w.cross(&axis));
        }
        for couple in [
            Vector3::new(w.x, o, o),
            Vector3::new(w.y, w.x, o),
            Vector3::new(w.z, o, w.x),
            Vector3::new(o, w.y, o),
            Vector3::new(o, w.z, w.y),
            Vector3::new(o, o, w.z),
        ] {
            add(couple, Vector3::zeros());
        }
    }

    /// Adds a joint's share to its own row and, by what it turns with the base, to the base's.
    pub(super) fn add_share(&mut self, joint: usize, share: &JointRow<T>, planted: &[T; 6]) {
        if let Some(own) = self.joints.get_mut(joint) {
            for (sum, x) in own.iter_mut().zip(share) {
                *sum += *x;
            }
        }
        let (leg, own) = (joint / JOINTS_PER_LEG, joint % JOINTS_PER_LEG);
        let mut add = |column: usize, numbers: &[T]| {
            let columns = self.base.get_mut(column..).unwrap_or(&mut []);
            for (to, x) in columns.iter_mut().zip(numbers) {
                for (to, along) in to.iter_mut().zip(planted) {
                    *to += *along * *x;
                }
            }
        };
        let (inertia, rest) = share.split_at(INERTIA);
        let (effects, rest) = rest.split_at(EFFECTS);
        // What the joint does not move it does not feel.
        add(OWN * leg + KEPT * own, &inertia[KEPT * own..]);
        add(OWN * leg + INERTIA + EFFECTS * own, effects);
        add(ACC, rest);
    }
}

/// The root L of the base rows' covariance, lower triangle, its diagonal inverted: that of the base's own noise and of the loaded joints'.
pub(super) fn noise_root<'a, T: Real>(
    planted: impl Iterator<Item = &'a [T; 6]> + Clone,
) -> [[T; 6]; 6] {
    let mut l = [[T::zero(); 6]; 6];
    for r in 0..6 {
        for c in 0..=r {
            let own = match r == c {
                true => real(1.0 / (SCALE[r / 3] * SCALE[r / 3])),
                false => T::zero(),
            };
            l[r][c] = planted
                .clone()
                .fold(own, |sum, along| sum + along[r] * along[c]);
        }
    }
    for c in 0..6 {
        for k in 0..c {
            for r in c..6 {
                let product = l[r][k] * l[c][k];
                l[r][c] -= product;
            }
        }
        let inverse = l[c][c].inverse_sqrt();
        for r in c + 1..6 {
            l[r][c] *= inverse;
        }
        l[c][c] = inverse;
    }
    l
}

/// L⁻¹ x.
pub(super) fn solve_lower<T: Real>(l: &[[T; 6]; 6], x: &[T; 6]) -> [T; 6] {
    let mut y = *x;
    for r in 0..6 {
        for c in 0..r {
            let known = l[r][c] * y[c];
            y[r] -= known;
        }
        y[r] *= l[r][r];
    }
    y
}
