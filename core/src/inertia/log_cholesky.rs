//! Coordinates η in which every body is physical (Rucker & Wensing 2022, *Smooth Parameterization of Rigid-Body Inertia*).
//!
//! The pseudo-inertia is P = U Uᵀ with the upper triangle
//!
//! ```text
//!           ⎡ e^d1  s12   s13   t1 ⎤
//! U = e^α   ⎢  0    e^d2  s23   t2 ⎥        η = (α, d1, d2, d3, s12, s23, s13, t1, t2, t3)
//!           ⎢  0     0    e^d3  t3 ⎥
//!           ⎣  0     0     0    1  ⎦
//! ```
//!
//! Any ten numbers make a body of positive density, and each such body has one η: e^2α is its mass, (t1, t2, t3) its centre
//! of mass (m), e^d and s the size and shape of its spread about it (m).

use super::{INERTIAL, InertialParameters};
use crate::Real;
use nalgebra::{Matrix4, SMatrix, SVector};

/// Names of the ten coordinates, in order.
pub const NAMES: [&str; INERTIAL] = [
    "alpha", "d1", "d2", "d3", "s12", "s23", "s13", "t1", "t2", "t3",
];

/// Row and column in U of the coordinates after α.
const PLACES: [(usize, usize); INERTIAL - 1] = [
    (0, 0),
    (1, 1),
    (2, 2),
    (0, 1),
    (1, 2),
    (0, 2),
    (0, 3),
    (1, 3),
    (2, 3),
];

/// The log-Cholesky coordinates η of one body; order as in [`NAMES`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LogCholesky<T: Real>(pub SVector<T, INERTIAL>);

/// Why no body of positive density has some parameters, so that they have no coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotPhysical {
    /// The mass is not a positive number.
    Mass,
    /// The mass does not spread about its centre along this axis (0 x, 1 y, 2 z), what the later axes carry taken out:
    /// the inertia breaks the triangle inequality, or is too small for where the centre of mass is.
    Spread(usize),
}

impl core::fmt::Display for NotPhysical {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Mass => write!(f, "the mass is not positive"),
            Self::Spread(axis) => {
                let axis = ["x", "y", "z"].get(*axis).unwrap_or(&"?");
                write!(
                    f,
                    "no positive density has this inertia: its spread along {axis} is not positive"
                )
            }
        }
    }
}

impl core::error::Error for NotPhysical {}

impl<T: Real> LogCholesky<T> {
    /// The coordinates of a body.
    ///
    /// # Errors
    /// [`NotPhysical`] says what no body of positive density could have.
    pub fn from_parameters(body: &InertialParameters<T>) -> Result<Self, NotPhysical> {
        let u = upper_factor(&body.pseudo_inertia())?;
        let scale = u[(3, 3)];
        let mut eta = SVector::zeros();
        eta[0] = scale.ln();
        for (n, &(row, column)) in PLACES.iter().enumerate() {
            let entry = u[(row, column)] / scale;
            eta[n + 1] = if row == column { entry.ln() } else { entry };
        }
        Ok(Self(eta))
    }

    /// The body's inertial parameters.
    pub fn parameters(&self) -> InertialParameters<T> {
        let u = self.factor();
        InertialParameters::from_pseudo_inertia(&(u * u.transpose()))
    }

    /// The upper triangle U.
    pub fn factor(&self) -> Matrix4<T> {
        let scale = self.0[0].exp();
        let mut u = Matrix4::identity() * scale;
        for (n, &(row, column)) in PLACES.iter().enumerate() {
            let entry = self.0[n + 1];
            u[(row, column)] = scale * if row == column { entry.exp() } else { entry };
        }
        u
    }

    /// ∂φ/∂η, whose rows are the ten inertial parameters: from dP = dU Uᵀ + U dUᵀ, in which φ is linear.
    pub fn jacobian(&self) -> SMatrix<T, INERTIAL, INERTIAL> {
        let u = self.factor();
        let scale = u[(3, 3)];
        let mut jacobian = SMatrix::<T, INERTIAL, INERTIAL>::zeros();
        for n in 0..INERTIAL {
            let mut change = u;
            if let Some((row, column)) = n.checked_sub(1).map(|n| PLACES[n]) {
                change = Matrix4::zeros();
                change[(row, column)] = if row == column { u[(row, row)] } else { scale };
            }
            let half = change * u.transpose();
            let column = InertialParameters::from_pseudo_inertia(&(half + half.transpose()));
            jacobian.set_column(n, &column.0);
        }
        jacobian
    }
}

/// U of P = U Uᵀ: the Cholesky factorisation begun at the last row.
fn upper_factor<T: Real>(p: &Matrix4<T>) -> Result<Matrix4<T>, NotPhysical> {
    let mut u = Matrix4::zeros();
    for column in (0..4).rev() {
        let known = |a: usize, u: &Matrix4<T>| {
            (column + 1..4).fold(T::zero(), |sum, k| sum + u[(a, k)] * u[(column, k)])
        };
        let pivot = p[(column, column)] - known(column, &u);
        // What rounding leaves of a spread of nothing is not a spread.
        let least = p[(column, column)] * T::default_epsilon();
        if !(pivot > least && pivot.is_finite()) {
            return Err(if column == 3 {
                NotPhysical::Mass
            } else {
                NotPhysical::Spread(column)
            });
        }
        let root = pivot.sqrt();
        u[(column, column)] = root;
        for row in 0..column {
            u[(row, column)] = (p[(row, column)] - known(row, &u)) / root;
        }
    }
    Ok(u)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inertia::tests::physical;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_body_comes_back(phi in physical()) {
            let eta = LogCholesky::from_parameters(&phi).unwrap();
            prop_assert!((eta.parameters().0 - phi.0).norm() < 1e-10 * phi.0.norm());
            prop_assert!((eta.0[0].exp().powi(2) / phi.mass() - 1.0).abs() < 1e-12);
            let com = phi.first_moment() / phi.mass();
            prop_assert!((eta.0.fixed_rows::<3>(7) - com).norm() < 1e-10 * (1.0 + com.norm()));
        }

        #[test]
        fn ten_numbers_are_a_body(eta in prop::array::uniform10(-1.5..1.5f64)) {
            let eta = LogCholesky(SVector::from(eta));
            let phi = eta.parameters();
            prop_assert!(phi.is_physical());
            let back = LogCholesky::from_parameters(&phi).unwrap();
            prop_assert!((back.0 - eta.0).norm() < 1e-9, "{} {}", back.0, eta.0);
        }

        #[test]
        fn the_jacobian_is_the_slope(eta in prop::array::uniform10(-1.5..1.5f64)) {
            let eta = SVector::from(eta);
            let (jacobian, h) = (LogCholesky(eta).jacobian(), 1e-5);
            for n in 0..INERTIAL {
                let mut step = SVector::<f64, INERTIAL>::zeros();
                step[n] = h;
                let ahead = LogCholesky(eta + step).parameters().0;
                let behind = LogCholesky(eta - step).parameters().0;
                let slope = (ahead - behind) / (2.0 * h);
                let error = (jacobian.column(n) - slope).norm();
                prop_assert!(error < 1e-7 * (1.0 + slope.norm()), "{}: {error}", NAMES[n]);
            }
        }
    }

    #[test]
    fn what_is_not_physical_is_said() {
        let body = InertialParameters::from_com(1.0, Vector3::zeros(), Matrix3::identity());
        let spoilt = |n: usize, value: f64| {
            let mut phi = body;
            phi.0[n] = value;
            LogCholesky::from_parameters(&phi).unwrap_err()
        };
        assert_eq!(spoilt(0, -1.0), NotPhysical::Mass);
        assert_eq!(spoilt(0, f64::NAN), NotPhysical::Mass);
        // An inertia about z greater than the two others together leaves no spread along z.
        assert_eq!(spoilt(9, 2.5), NotPhysical::Spread(2));
        assert_eq!(spoilt(7, 2.5), NotPhysical::Spread(1));
        assert_eq!(spoilt(4, 2.5), NotPhysical::Spread(0));
        let point = InertialParameters::from_com(1.0, Vector3::x(), Matrix3::zeros());
        assert_eq!(
            LogCholesky::from_parameters(&point),
            Err(NotPhysical::Spread(2))
        );
    }
}
