//! The ten inertial parameters of a body, in which momentum, torque and energy are linear.
//!
//! φ = (m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz): mass (kg), first moment h = m c (kg m) and the inertia (kg m²)
//! **about the joint frame's origin**, not about the centre of mass: only then is everything linear in φ
//! (Atkeson, An & Hollerbach 1986). The same numbers as a 4 × 4 matrix, the *pseudo-inertia* (Wensing, Kim & Slotine 2018),
//! are positive definite exactly when a body of positive density could have them; [`log_cholesky`] are coordinates in which
//! every body is one.

pub(crate) mod barrier;
pub mod log_cholesky;

use crate::factor::{Factor, packed_len};
use crate::spatial::{Force, Motion, Transform};
use crate::{Real, scalar::real};
use nalgebra::{ArrayStorage, Cholesky, Matrix3, Matrix4, SMatrix, SVector, Vector3};

/// How many inertial parameters a body has.
pub const INERTIAL: usize = 10;

/// Names of the ten parameters, in order.
pub const NAMES: [&str; INERTIAL] = [
    "m", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz",
];

/// Units of the ten parameters, in order.
pub const UNITS: [&str; INERTIAL] = [
    "kg", "kg m", "kg m", "kg m", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2",
];

/// What is known of one body's ten inertial parameters.
pub type BodyFactor<T> = Factor<T, [T; packed_len(INERTIAL)]>;

/// The inertial parameters φ of one body about its joint frame's origin; order and units as in [`NAMES`] and [`UNITS`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InertialParameters<T: Real>(pub SVector<T, INERTIAL>);

impl<T: Real> InertialParameters<T> {
    /// No mass at all, a constant.
    pub(crate) const NONE: Self = Self(SVector::from_array_storage(ArrayStorage(
        [[T::ZERO; INERTIAL]; 1],
    )));

    /// No mass at all.
    pub fn zero() -> Self {
        Self(SVector::zeros())
    }

    /// From mass (kg), centre of mass (m) and the inertia about the centre of mass (kg m²), as a URDF states them.
    pub fn from_com(mass: T, com: Vector3<T>, inertia: Matrix3<T>) -> Self {
        let about_origin =
            inertia + (Matrix3::identity() * com.dot(&com) - com * com.transpose()) * mass;
        Self::from_parts(mass, com * mass, about_origin)
    }

    fn from_parts(mass: T, h: Vector3<T>, i: Matrix3<T>) -> Self {
        Self(SVector::from([
            mass,
            h.x,
            h.y,
            h.z,
            i[(0, 0)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 1)],
            i[(1, 2)],
            i[(2, 2)],
        ]))
    }

    /// Mass, kg.
    pub fn mass(&self) -> T {
        self.0[0]
    }

    /// First moment h = m c, kg m.
    pub fn first_moment(&self) -> Vector3<T> {
        self.0.fixed_rows::<3>(1).into_owned()
    }

    /// Inertia about the frame's origin, kg m².
    pub fn rotational_inertia(&self) -> Matrix3<T> {
        let p = &self.0;
        Matrix3::new(p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9])
    }

    /// The six inertias about the frame's origin, kg m², in their order: xx, xy, xz, yy, yz, zz.
    pub(crate) fn inertia_entries(&self) -> [T; 6] {
        let p = &self.0;
        [p[4], p[5], p[6], p[7], p[8], p[9]]
    }

    /// I ω with the inertia about the frame's origin.
    #[inline(always)]
    pub(crate) fn turned(&self, omega: &Vector3<T>) -> Vector3<T> {
        let p = &self.0;
        Vector3::new(
            p[4] * omega.x + p[5] * omega.y + p[6] * omega.z,
            p[5] * omega.x + p[7] * omega.y + p[8] * omega.z,
            p[6] * omega.x + p[8] * omega.y + p[9] * omega.z,
        )
    }

    /// The body in its parent's frame, from its inertia and first moment in the parent's axes and where its origin is there.
    ///
    /// With r = p + x: Σ + (p·h + p·g) 1 − p gᵀ − h pᵀ, g = h + m p the first moment there (the theorem of parallel axes).
    #[inline(always)]
    pub(crate) fn carried(&self, inertia: &[T; 6], h: &Vector3<T>, p: &Vector3<T>) -> Self {
        let g = h + p * self.mass();
        let trace = p.dot(h) + p.dot(&g);
        Self(SVector::from([
            self.mass(),
            g.x,
            g.y,
            g.z,
            inertia[0] + trace - p.x * g.x - h.x * p.x,
            inertia[1] - p.x * g.y - h.x * p.y,
            inertia[2] - p.x * g.z - h.x * p.z,
            inertia[3] + trace - p.y * g.y - h.y * p.y,
            inertia[4] - p.y * g.z - h.y * p.z,
            inertia[5] + trace - p.z * g.z - h.z * p.z,
        ]))
    }

    /// Momentum I v of the body moving with `velocity`: N m s and N s.
    pub fn momentum(&self, velocity: &Motion<T>) -> Force<T> {
        let h = self.first_moment();
        Force::new(
            self.rotational_inertia() * velocity.angular + h.cross(&velocity.linear),
            velocity.linear * self.mass() - h.cross(&velocity.angular),
        )
    }

    /// The same body described in the parent frame of `placement`.
    pub fn in_parent(&self, placement: &Transform<T>) -> Self {
        let pseudo = self.pseudo_inertia();
        let mut homogeneous = Matrix4::identity();
        homogeneous
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&placement.rotation);
        homogeneous
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&placement.translation);
        Self::from_pseudo_inertia(&(homogeneous * pseudo * homogeneous.transpose()))
    }

    /// The pseudo-inertia [[Σ, h], [hᵀ, m]] with Σ = ½ tr(I) 1 − I (Wensing, Kim & Slotine 2018, eq. 5).
    pub fn pseudo_inertia(&self) -> Matrix4<T> {
        let inertia = self.rotational_inertia();
        let second_moment = Matrix3::identity() * (inertia.trace() * real(0.5)) - inertia;
        let mut pseudo = Matrix4::zeros();
        pseudo
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&second_moment);
        let h = self.first_moment();
        pseudo.fixed_view_mut::<3, 1>(0, 3).copy_from(&h);
        pseudo
            .fixed_view_mut::<1, 3>(3, 0)
            .copy_from(&h.transpose());
        pseudo[(3, 3)] = self.mass();
        pseudo
    }

    /// The parameters of a pseudo-inertia; the inverse of [`pseudo_inertia`](Self::pseudo_inertia).
    pub fn from_pseudo_inertia(pseudo: &Matrix4<T>) -> Self {
        let second_moment = pseudo.fixed_view::<3, 3>(0, 0).into_owned();
        let inertia = Matrix3::identity() * second_moment.trace() - second_moment;
        Self::from_parts(
            pseudo[(3, 3)],
            pseudo.fixed_view::<3, 1>(0, 3).into_owned(),
            inertia,
        )
    }

    /// The CAD prior: the knowledge that a body is this one up to a relative uncertainty, as a triangle of ten rows.
    ///
    /// With P₀ = L Lᵀ this body's pseudo-inertia, the squared distance of another is ‖L⁻¹ (P − P₀) L⁻ᵀ‖² / `relative`²: the
    /// second-order part of the affine-invariant distance between pseudo-inertias (Lee, Wensing & Park 2020). It is the same
    /// in every frame and every unit, which a table of standard deviations per number is not. `relative` is the standard
    /// deviation of the mass over the mass; that of the centre of mass is `relative`/√2 times the radius of gyration.
    ///
    /// `None` if this body is not physical.
    pub fn prior(&self, relative: T) -> Option<BodyFactor<T>> {
        self.divergence_near(self, relative)
    }

    /// The second-order expansion, about `self`, of the prior that keeps a body near `cad` *and* physical.
    ///
    /// That prior is the Bregman divergence of −log det (Lee & Park 2018),
    /// (2 / `relative`²) (tr(P₀⁻¹ P) − log det(P₀⁻¹ P) − 4): convex in φ, infinite at the edge of the physical bodies, and
    /// equal to [`prior`](Self::prior) to second order about the CAD's P₀. About P = L Lᵀ it is, up to a constant,
    /// ‖W − (1 − Lᵀ P₀⁻¹ L)‖² / `relative`² with W = L⁻¹ δP L⁻ᵀ linear in δφ: ten rows again.
    ///
    /// `None` if one of the two bodies is not physical.
    pub fn divergence_near(&self, cad: &Self, relative: T) -> Option<BodyFactor<T>> {
        let l = Cholesky::new(self.pseudo_inertia())?.l();
        let inverse = l.try_inverse()?;
        let pull = Matrix4::identity() - l.tr_mul(&Cholesky::new(cad.pseudo_inertia())?.solve(&l));
        let mut distance = SMatrix::<T, INERTIAL, INERTIAL>::zeros();
        for c in 0..INERTIAL {
            let unit = Self(SVector::from_fn(
                |r, _| if r == c { T::one() } else { T::zero() },
            ));
            let whitened = inverse * unit.pseudo_inertia() * inverse.transpose();
            distance.set_column(c, &(lower_triangle(&whitened) / relative));
        }
        let right = distance * self.0 + lower_triangle(&pull) / relative;
        let mut factor = BodyFactor::new::<INERTIAL>();
        for r in 0..INERTIAL {
            let mut row = [T::zero(); INERTIAL + 1];
            row.iter_mut()
                .zip(distance.row(r).iter())
                .for_each(|(to, from)| *to = *from);
            row[INERTIAL] = right[r];
            factor.update(&mut row).ok()?;
        }
        Some(factor)
    }

    /// The divergence itself, tr(P₀⁻¹ P) − log det(P₀⁻¹ P) − 4 ≥ 0; `None` if one of the two bodies is not physical.
    pub fn divergence(&self, cad: &Self) -> Option<T> {
        let p = self.pseudo_inertia();
        let (here, there) = (Cholesky::new(p)?, Cholesky::new(cad.pseudo_inertia())?);
        let ratio = (0..4).fold(T::one(), |ratio, k| {
            ratio * here.l()[(k, k)] / there.l()[(k, k)]
        });
        Some(there.solve(&p).trace() - real::<T>(2.0) * ratio.ln() - real(4.0))
    }

    /// Whether a body of positive density could have these parameters: the pseudo-inertia is positive definite.
    pub fn is_physical(&self) -> bool {
        Cholesky::new(self.pseudo_inertia()).is_some()
    }
}

impl<T: Real> core::ops::Add for InertialParameters<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

/// The ten numbers of a symmetric matrix, those off the diagonal times √2: their norm is the matrix's (Frobenius).
fn lower_triangle<T: Real>(matrix: &Matrix4<T>) -> SVector<T, INERTIAL> {
    let mut entries = (0..4).flat_map(|i| (0..=i).map(move |j| (i, j)));
    SVector::from_fn(|_, _| match entries.next() {
        Some((i, j)) if i == j => matrix[(i, j)],
        Some((i, j)) => matrix[(i, j)] * real::<T>(2.0).sqrt(),
        None => T::zero(),
    })
}

/// The row r(u, v) for which r·φ = uᵀ I(φ) v: the momentum of a body with velocity `velocity`, felt along `along`.
///
/// The form is symmetric and bilinear, and every regressor of this crate is made of it ([`crate::regressor`]):
/// uᵀ I v = m (u_l·v_l) + h·(v_l × u_a + u_l × v_a) + u_a·(Ī v_a), where a and l are the angular and linear parts.
pub fn momentum_row<T: Real>(along: &Motion<T>, velocity: &Motion<T>) -> SVector<T, INERTIAL> {
    let (u, v) = (along, velocity);
    let h = v.linear.cross(&u.angular) + u.linear.cross(&v.angular);
    let (a, b) = (&u.angular, &v.angular);
    SVector::from([
        u.linear.dot(&v.linear),
        h.x,
        h.y,
        h.z,
        a.x * b.x,
        a.x * b.y + a.y * b.x,
        a.x * b.z + a.z * b.x,
        a.y * b.y,
        a.y * b.z + a.z * b.y,
        a.z * b.z,
    ])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::spatial::tests::{motion, transform, vector};
    use proptest::prelude::*;

    /// Parameters of a physical body, from the Cholesky factor of its pseudo-inertia.
    pub(crate) fn physical() -> impl Strategy<Value = InertialParameters<f64>> {
        prop::array::uniform10(-1.0..1.0f64).prop_map(|x| {
            let (a, b, c, d) = (1.1 + x[0], 1.1 + x[1], 1.1 + x[2], 1.1 + x[3]);
            #[rustfmt::skip]
            let l = Matrix4::new(
                a,    0.0,  0.0,  0.0,
                x[4], b,    0.0,  0.0,
                x[5], x[6], c,    0.0,
                x[7], x[8], x[9], d,
            );
            InertialParameters::from_pseudo_inertia(&(l * l.transpose()))
        })
    }

    proptest! {
        #[test]
        fn pseudo_inertia_round_trip(phi in physical()) {
            let back = InertialParameters::from_pseudo_inertia(&phi.pseudo_inertia());
            prop_assert!((back.0 - phi.0).norm() < 1e-12);
            prop_assert!(phi.is_physical());
        }

        #[test]
        fn momentum_row_is_the_bilinear_form(phi in physical(), u in motion(), v in motion()) {
            let expected = u.dot(&phi.momentum(&v));
            prop_assert!((momentum_row(&u, &v).dot(&phi.0) - expected).abs() < 1e-10);
        }

        #[test]
        fn kinetic_energy_does_not_depend_on_the_frame(phi in physical(), x in transform(), v in motion()) {
            let parent = x.act(&v);
            let there = parent.dot(&phi.in_parent(&x).momentum(&parent));
            let here = v.dot(&phi.momentum(&v));
            prop_assert!((there - here).abs() < 1e-9 * (1.0 + here.abs()));
        }

        #[test]
        fn inertia_about_the_com_is_the_steiner_theorem(com in vector()) {
            let body = InertialParameters::from_com(2.0, com, Matrix3::identity());
            let there = InertialParameters::from_com(2.0, Vector3::zeros(), Matrix3::identity())
                .in_parent(&Transform::from_translation(com));
            prop_assert!((body.0 - there.0).norm() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn the_prior_does_not_depend_on_the_frame(phi in physical(), other in physical(), x in transform()) {
            let here = phi.prior(0.1).unwrap().sum_of_squares(other.0.as_slice());
            let there = phi.in_parent(&x).prior(0.1).unwrap().sum_of_squares(other.in_parent(&x).0.as_slice());
            prop_assert!((here - there).abs() < 1e-6 * here, "{here} {there}");
        }

        #[test]
        fn the_prior_states_the_relative_uncertainty_of_the_mass(phi in physical()) {
            let (mut variance, mut scratch) = ([0.0; 10], [0.0; 10]);
            phi.prior(0.1).unwrap().variances(&mut variance, &mut scratch).unwrap();
            prop_assert!((variance[0].sqrt() / phi.mass() - 0.1).abs() < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn the_expansion_has_the_divergence_slope_and_curvature(
            phi in physical(), cad in physical(), step in prop::array::uniform10(-1.0..1.0f64),
        ) {
            let (near, h) = (phi.divergence_near(&cad, 0.5).unwrap(), 1e-3 * phi.mass().min(0.1));
            let at = |x: f64| InertialParameters(phi.0 + SVector::from(step) * x);
            prop_assume!(at(20.0 * h).is_physical() && at(-20.0 * h).is_physical());
            // Differences of the quadratic's values are exact; of the divergence's, to fourth order.
            let quadratic = |x: f64| near.sum_of_squares(at(x).0.as_slice());
            let exact = |x: f64| at(x).divergence(&cad).unwrap() * 2.0 / 0.25;
            let slope = |f: &dyn Fn(f64) -> f64| (f(-2.0 * h) - 8.0 * f(-h) + 8.0 * f(h) - f(2.0 * h)) / (12.0 * h);
            let (a, b) = (slope(&quadratic), slope(&exact));
            prop_assert!((a - b).abs() < 1e-4 * (1.0 + a.abs()), "{a} {b}");
        }

        #[test]
        fn the_divergence_is_zero_only_at_the_cad(phi in physical(), cad in physical()) {
            prop_assert!(phi.divergence(&phi).unwrap().abs() < 1e-9);
            prop_assert!(phi.divergence(&cad).unwrap() > 0.0);
        }
    }

    #[test]
    fn a_point_mass_with_negative_inertia_is_not_physical() {
        let mut phi = InertialParameters::from_com(1.0, Vector3::zeros(), Matrix3::identity());
        phi.0[4] = -0.1;
        assert!(!phi.is_physical());
    }
}
