//! Spatial vectors and transforms (Featherstone, *Rigid Body Dynamics Algorithms*, ch. 2).
//!
//! A [`Motion`] (twist) and a [`Force`] (wrench) are six-vectors, angular part first, written in some frame about that
//! frame's origin. A [`Transform`] is the placement of a child frame in its parent; `act` carries from child to parent and
//! `act_inverse` from parent to child, as Pinocchio's `act` and `actInv` do.

use crate::Real;
use nalgebra::{Matrix3, Vector3};

/// A motion vector: angular velocity (rad/s) and the linear velocity (m/s) of the point at the frame's origin; or the
/// spatial acceleration in the same layout.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion<T: Real> {
    /// Angular part, rad/s.
    pub angular: Vector3<T>,
    /// Linear part, m/s.
    pub linear: Vector3<T>,
}

/// A force vector: couple about the frame's origin (N m) and force (N); or a momentum (N m s, N s).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Force<T: Real> {
    /// Couple about the origin, N m.
    pub angular: Vector3<T>,
    /// Force, N.
    pub linear: Vector3<T>,
}

impl<T: Real> Motion<T> {
    /// The motion from its parts.
    pub fn new(angular: Vector3<T>, linear: Vector3<T>) -> Self {
        Self { angular, linear }
    }

    /// No motion.
    pub fn zero() -> Self {
        Self::new(Vector3::zeros(), Vector3::zeros())
    }

    /// The k-th unit motion, 0–2 angular, 3–5 linear; zero for any other k.
    pub fn unit(k: usize) -> Self {
        let axis =
            |n: usize| Vector3::from_fn(|row, _| if row == n { T::one() } else { T::zero() });
        if k < 3 {
            Self::new(axis(k), Vector3::zeros())
        } else {
            Self::new(Vector3::zeros(), axis(k - 3))
        }
    }

    /// Rate of change of `other` if it moves with `self`: v × m (Featherstone eq. 2.31).
    pub fn cross(&self, other: &Self) -> Self {
        Self::new(
            self.angular.cross(&other.angular),
            self.linear.cross(&other.angular) + self.angular.cross(&other.linear),
        )
    }

    /// Rate of change of a force that moves with `self`: v ×* f (Featherstone eq. 2.32).
    pub fn cross_force(&self, force: &Force<T>) -> Force<T> {
        Force::new(
            self.angular.cross(&force.angular) + self.linear.cross(&force.linear),
            self.angular.cross(&force.linear),
        )
    }

    /// Power (W) of `force` along this motion: the scalar product of the two spaces.
    pub fn dot(&self, force: &Force<T>) -> T {
        self.angular.dot(&force.angular) + self.linear.dot(&force.linear)
    }

    /// `self` times a number.
    pub fn scale(&self, factor: T) -> Self {
        Self::new(self.angular * factor, self.linear * factor)
    }
}

impl<T: Real> core::ops::Add for Motion<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.angular + other.angular, self.linear + other.linear)
    }
}

impl<T: Real> core::ops::Sub for Motion<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.angular - other.angular, self.linear - other.linear)
    }
}

impl<T: Real> Force<T> {
    /// The force from its parts.
    pub fn new(angular: Vector3<T>, linear: Vector3<T>) -> Self {
        Self { angular, linear }
    }

    /// No force.
    pub fn zero() -> Self {
        Self::new(Vector3::zeros(), Vector3::zeros())
    }
}

impl<T: Real> core::ops::Add for Force<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.angular + other.angular, self.linear + other.linear)
    }
}

/// The placement of a child frame in its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Transform<T: Real> {
    /// Turns child coordinates into parent coordinates.
    pub rotation: Matrix3<T>,
    /// The child's origin in parent coordinates, m.
    pub translation: Vector3<T>,
}

impl<T: Real> Transform<T> {
    /// The same frame.
    pub fn identity() -> Self {
        Self {
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
        }
    }

    /// A frame parallel to its parent, its origin at `translation` (m).
    pub fn from_translation(translation: Vector3<T>) -> Self {
        Self {
            rotation: Matrix3::identity(),
            translation,
        }
    }

    /// `self` after `child`: the placement of the grandchild.
    pub fn compose(&self, child: &Self) -> Self {
        Self {
            rotation: self.rotation * child.rotation,
            translation: self.translation + self.rotation * child.translation,
        }
    }

    /// A child's motion in the parent's coordinates, about the parent's origin.
    pub fn act(&self, motion: &Motion<T>) -> Motion<T> {
        let angular = self.rotation * motion.angular;
        Motion::new(
            angular,
            self.rotation * motion.linear + self.translation.cross(&angular),
        )
    }

    /// A parent's motion in the child's coordinates, about the child's origin.
    pub fn act_inverse(&self, motion: &Motion<T>) -> Motion<T> {
        let linear = motion.linear + motion.angular.cross(&self.translation);
        Motion::new(
            self.rotation.tr_mul(&motion.angular),
            self.rotation.tr_mul(&linear),
        )
    }

    /// A force on the child in the parent's coordinates, about the parent's origin.
    pub fn act_force(&self, force: &Force<T>) -> Force<T> {
        let linear = self.rotation * force.linear;
        Force::new(
            self.rotation * force.angular + self.translation.cross(&linear),
            linear,
        )
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn vector() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-2.0..2.0f64).prop_map(Vector3::from)
    }

    pub(crate) fn motion() -> impl Strategy<Value = Motion<f64>> {
        (vector(), vector()).prop_map(|(angular, linear)| Motion::new(angular, linear))
    }

    pub(crate) fn transform() -> impl Strategy<Value = Transform<f64>> {
        (vector(), vector()).prop_map(|(turn, translation)| Transform {
            rotation: *nalgebra::Rotation3::from_scaled_axis(turn).matrix(),
            translation,
        })
    }

    fn gap(a: &Motion<f64>, b: &Motion<f64>) -> f64 {
        (a.angular - b.angular).norm() + (a.linear - b.linear).norm()
    }

    proptest! {
        #[test]
        fn act_inverse_undoes_act(x in transform(), m in motion()) {
            prop_assert!(gap(&x.act_inverse(&x.act(&m)), &m) < 1e-12);
        }

        #[test]
        fn composition_is_one_action_after_the_other(x in transform(), y in transform(), m in motion()) {
            prop_assert!(gap(&x.compose(&y).act(&m), &x.act(&y.act(&m))) < 1e-12);
        }

        #[test]
        fn power_does_not_depend_on_the_frame(x in transform(), m in motion(), f in motion()) {
            let force = Force::new(f.angular, f.linear);
            prop_assert!((x.act(&m).dot(&x.act_force(&force)) - m.dot(&force)).abs() < 1e-11);
        }

        #[test]
        fn the_two_cross_products_are_adjoint(v in motion(), m in motion(), f in motion()) {
            let force = Force::new(f.angular, f.linear);
            prop_assert!((v.cross(&m).dot(&force) + m.dot(&v.cross_force(&force))).abs() < 1e-12);
        }

        #[test]
        fn transforms_keep_cross_products(x in transform(), v in motion(), m in motion()) {
            prop_assert!(gap(&x.act(&v.cross(&m)), &x.act(&v).cross(&x.act(&m))) < 1e-11);
        }
    }
}
