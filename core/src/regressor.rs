//! The dynamics as matrices that multiply the inertial parameters θ (n × 10 B, body after body).
//!
//! With u a column of a body's Jacobian and r(u, v) the row of [`momentum_row`] (r·φ = uᵀ I(φ) v), every regressor is
//! made of the same bilinear form, entry by entry for the pairs (coordinate, body) in which the one moves the other:
//!
//! | regressor | W θ | row of body b for coordinate c |
//! |---|---|---|
//! | momentum | H q̇ | r(S, v) |
//! | Coriolis-transpose | Cᵀ q̇ | r(Ṡ, v), Ṡ = v_c × S |
//! | gravity | g | r(S, −γ), γ gravity as a spatial acceleration |
//! | inverse dynamics | H q̈ + C q̇ + g | r(S, a − γ) − r(v × S, v) |
//!
//! The second line holds since J̇ = Ṡ − v × S in body coordinates and the part of v × S cancels against that of C; it
//! was first given as the "indirect" regressor of Slotine & Li (1987); for spatial vectors see Wensing, Niemeyer & Slotine
//! (2023). `P` must be 10 `B`.

use crate::Real;
use crate::inertia::{INERTIAL, momentum_row};
use crate::scalar::real;
use crate::spatial::{Motion, Transform};
use crate::tree::{Kinematics, Tree};
use nalgebra::{SMatrix, SVector, Vector3};

/// Gravity's pull as the upward acceleration that feels the same.
fn lift<T: Real>(gravity: &Vector3<T>) -> Motion<T> {
    Motion::new(Vector3::zeros(), -*gravity)
}

/// r(S, −γ): no rotational part, for gravity has none.
fn gravity_row<T: Real>(subspace: &Motion<T>, gravity: &Vector3<T>) -> SVector<T, INERTIAL> {
    let h = subspace.angular.cross(gravity);
    let zero = T::zero();
    let m = -subspace.linear.dot(gravity);
    SVector::from([m, h.x, h.y, h.z, zero, zero, zero, zero, zero, zero])
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    fn assemble<const P: usize>(
        &self,
        row: impl Fn(usize, usize) -> SVector<T, INERTIAL>,
    ) -> SMatrix<T, V, P> {
        let mut regressor = SMatrix::zeros();
        self.write(&mut regressor, row);
        regressor
    }

    /// Writes the entries that a tree can have; the others are not touched.
    fn write<const P: usize>(
        &self,
        regressor: &mut SMatrix<T, V, P>,
        row: impl Fn(usize, usize) -> SVector<T, INERTIAL>,
    ) {
        const { assert!(P == INERTIAL * B) }
        self.for_each_pair(|b, c| {
            let entries = row(b, c);
            for n in 0..INERTIAL {
                regressor[(c, INERTIAL * b + n)] = entries[n];
            }
        });
    }

    /// W_m with W_m θ = H q̇, the generalised momentum (N m s).
    pub fn momentum_regressor<const P: usize>(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, P> {
        let mut regressor = SMatrix::zeros();
        self.write_momentum_regressor(k, &mut regressor);
        regressor
    }

    /// [`momentum_regressor`](Self::momentum_regressor) in place: `regressor` is of this tree, or zero.
    pub(crate) fn write_momentum_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
        regressor: &mut SMatrix<T, V, P>,
    ) {
        self.write(regressor, |b, c| {
            momentum_row(&k.subspace[b][c], &k.velocity[b])
        });
    }

    /// W_c with W_c θ = Cᵀ q̇ (N m).
    pub fn coriolis_transpose_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
    ) -> SMatrix<T, V, P> {
        self.assemble(|b, c| momentum_row(&k.subspace_rate[b][c], &k.velocity[b]))
    }

    /// W_g with W_g θ = g(q) (N m).
    pub fn gravity_regressor<const P: usize>(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, P> {
        self.assemble(|b, c| gravity_row(&k.subspace[b][c], &k.gravity[b]))
    }

    /// W_g − W_c, the integrand of the momentum equation (N m), in one pass.
    pub fn momentum_rate_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
    ) -> SMatrix<T, V, P> {
        let mut regressor = SMatrix::zeros();
        self.write_momentum_rate_regressor(k, &mut regressor);
        regressor
    }

    /// [`momentum_rate_regressor`](Self::momentum_rate_regressor) in place: `regressor` is of this tree, or zero.
    pub(crate) fn write_momentum_rate_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
        regressor: &mut SMatrix<T, V, P>,
    ) {
        self.write(regressor, |b, c| {
            gravity_row(&k.subspace[b][c], &k.gravity[b])
                - momentum_row(&k.subspace_rate[b][c], &k.velocity[b])
        });
    }

    /// W with W θ = H a + C v + g = τ (N m): the joint torque regressor (Atkeson, An & Hollerbach 1986).
    pub fn inverse_dynamics_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
    ) -> SMatrix<T, V, P> {
        let mut felt = [Motion::zero(); B];
        for b in 0..B {
            if let Some(parent) = self.bodies()[b].parent {
                felt[b] = k.from_parent[b].act_inverse(&felt[parent]);
            }
            for c in self.coordinates(b) {
                let s = &k.subspace[b][c];
                felt[b] = felt[b] + s.scale(a[c]) + k.velocity[b].cross(s).scale(v[c]);
            }
        }
        for b in 0..B {
            felt[b] = felt[b] + lift(&k.gravity[b]);
        }
        self.assemble(|b, c| {
            let (s, velocity) = (&k.subspace[b][c], &k.velocity[b]);
            momentum_row(s, &felt[b]) - momentum_row(&velocity.cross(s), velocity)
        })
    }

    /// Rows w_k, w_p with w_k θ = kinetic and w_p θ = potential energy (J), zero potential at the world's origin.
    ///
    /// `base` is the argument given to [`kinematics`](Tree::kinematics).
    pub fn energy_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
        base: &Transform<T>,
    ) -> (SVector<T, P>, SVector<T, P>) {
        const { assert!(P == INERTIAL * B) }
        let (mut kinetic, mut potential) = (SVector::zeros(), SVector::zeros());
        for (b, origin) in self.origins(k, base).iter().enumerate() {
            let row = momentum_row(&k.velocity[b], &k.velocity[b]) * real::<T>(0.5);
            for n in 0..INERTIAL {
                kinetic[INERTIAL * b + n] = row[n];
            }
            potential[INERTIAL * b] = -self.gravity().dot(origin);
            for n in 0..3 {
                potential[INERTIAL * b + 1 + n] = -k.gravity[b][n];
            }
        }
        (kinetic, potential)
    }
}
