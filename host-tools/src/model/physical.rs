//! Which inertial parameters a body can have, and what is wrong with those it cannot.

use std::fmt;

use nalgebra::Matrix3;
use proprio_core::inertia::InertialParameters;

use super::rounding::significant;

/// Why no body of positive density has these inertial parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unphysical {
    /// A parameter is not a number, or infinite.
    NotFinite,
    /// The mass, kg, is not positive.
    Mass(f64),
    /// The principal moments of inertia about the centre of mass, kg m², ascending, of which two do not exceed the third.
    Moments([f64; 3]),
}

impl Unphysical {
    /// What is wrong with φ, if anything.
    ///
    /// The pseudo-inertia is positive definite exactly when the mass is positive and, about the centre of mass, the two
    /// smaller principal moments exceed the greatest (Wensing, Kim & Slotine 2018, §III): what a user can check against
    /// the CAD.
    pub fn of(phi: &InertialParameters<f64>) -> Option<Self> {
        if phi.0.iter().any(|x| !x.is_finite()) {
            return Some(Self::NotFinite);
        }
        if phi.mass() <= 0.0 {
            return Some(Self::Mass(phi.mass()));
        }
        if phi.is_physical() {
            return None;
        }
        let (_, _, inertia) = about_com(phi);
        let mut moments = <[f64; 3]>::from(inertia.symmetric_eigenvalues());
        moments.sort_by(f64::total_cmp);
        Some(Self::Moments(moments))
    }
}

/// No link's mass lies farther from its centre than this on the mean, m: what does is stated in g and mm. Booms of cranes have 5 m.
const LARGEST_RADIUS: f64 = 10.0;

/// Mass (kg) and radius of gyration (m) of a body whose moments of inertia are in another unit than its mass.
pub(crate) fn other_unit(phi: &InertialParameters<f64>) -> Option<[f64; 2]> {
    let (mass, _, inertia) = about_com(phi);
    let radius = (0.5 * inertia.trace() / mass).sqrt();
    (mass > 0.0 && radius > LARGEST_RADIUS).then_some([mass, radius])
}

impl fmt::Display for Unphysical {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotFinite => f.write_str("a parameter is not a finite number"),
            Self::Mass(mass) => {
                write!(f, "the mass is {} kg, not positive", significant(mass, 6))
            }
            Self::Moments([a, b, c]) if a < 0.0 => write!(
                f,
                "the principal moments of inertia about the centre of mass are {a:.3e}, {b:.3e}, {c:.3e} kg m^2: the \
                 first is negative"
            ),
            Self::Moments([a, b, c]) => write!(
                f,
                "the principal moments of inertia about the centre of mass are {a:.3e}, {b:.3e}, {c:.3e} kg m^2: the \
                 greatest must be less than the sum of the others and exceeds it by {:.3e}",
                (c - a - b).max(0.0)
            ),
        }
    }
}

impl std::error::Error for Unphysical {}

/// Mass (kg), centre of mass (m) and inertia about it (kg m²), as URDF and MJCF state them.
///
/// Without mass the centre is the origin.
pub fn about_com(phi: &InertialParameters<f64>) -> (f64, nalgebra::Vector3<f64>, Matrix3<f64>) {
    let (mass, h) = (phi.mass(), phi.first_moment());
    let com = if mass > 0.0 { h / mass } else { h * 0.0 };
    let shift = Matrix3::identity() * com.dot(&h) - com * h.transpose();
    (mass, com, phi.rotational_inertia() - shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn body(mass: f64, moments: [f64; 3]) -> InertialParameters<f64> {
        let com = Vector3::new(0.1, -0.2, 0.3);
        InertialParameters::from_com(mass, com, Matrix3::from_diagonal(&moments.into()))
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert_eq!(Unphysical::of(&body(1.0, [0.1, 0.1, 0.15])), None);
        assert_eq!(
            Unphysical::of(&body(-1.0, [0.1; 3])),
            Some(Unphysical::Mass(-1.0))
        );
        assert_eq!(
            Unphysical::of(&body(f64::NAN, [0.1; 3])),
            Some(Unphysical::NotFinite)
        );
        let text = |moments| Unphysical::of(&body(1.0, moments)).unwrap().to_string();
        assert!(text([0.1, 0.3, 0.1]).ends_with("exceeds it by 1.000e-1"));
        assert!(text([0.1, 0.1, -0.01]).ends_with("the first is negative"));
    }
}
