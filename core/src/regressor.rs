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
//! (2023). The last line is evaluated body by body: a body's force and couple are 6 × 10 numbers, computed once, and each
//! coordinate that moves the body takes its part of them (`block`).
//!
//! Regressors are written in place, row-major: [`RegressorRows`] holds a run of ten numbers for each coordinate and body.
//! Where a coordinate does not move a body nothing is written, so rows that start as zeros stay right from call to call.
//! Beside each there is a function that returns a matrix; its `P` must be 10 `B`.
//!
//! # Example
//!
//! The torque of a Go2's leg is its regressor times its parameters:
//!
//! ```
//! use nalgebra::{SMatrix, SVector, Vector3};
//! use proprio_core::go2::{self, Leg};
//! use proprio_core::spatial::Transform;
//!
//! let leg = go2::leg::<f64>(Leg::FR);
//! let (q, v) = (Vector3::new(0.1, 0.8, -1.6), Vector3::new(1.0, -2.0, 3.0));
//! let a = Vector3::new(5.0, 0.0, -20.0);
//! let moving = leg.kinematics(&Transform::identity(), &q, &v);
//!
//! let regressor: SMatrix<f64, 3, 30> = leg.inverse_dynamics_regressor(&moving, &v, &a);
//! let theta: SVector<f64, 30> = leg.parameters();
//! let torque = leg.inverse_dynamics(&moving, &v, &a);
//! assert!((regressor * theta - torque).norm() < 1e-12);
//! ```

mod block;
pub(crate) mod leg;

use crate::Real;
use crate::dynamics::{Acceleration, accelerate_free};
use crate::inertia::{INERTIAL, momentum_row};
use crate::scalar::real;
use crate::spatial::{Motion, Transform};
use crate::tree::joint_frame::{JointFrame, JointKind, by_joint};
use crate::tree::{Kinematics, Placements, Tree};
use block::Block;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A regressor, row-major: `rows[c][b]` is coordinate c's row of body b's ten parameters.
pub type RegressorRows<T, const B: usize, const V: usize> = [[[T; INERTIAL]; B]; V];

/// Writes what coordinate c feels of body b.
#[inline(always)]
fn put<T, const B: usize, const V: usize>(
    rows: &mut RegressorRows<T, B, V>,
    c: usize,
    b: usize,
    run: [T; INERTIAL],
) {
    if let Some(to) = rows.get_mut(c).and_then(|row| row.get_mut(b)) {
        *to = run;
    }
}

/// r(S, −γ): no rotational part, for gravity has none.
#[inline(always)]
fn gravity_row<T: Real>(subspace: &Motion<T>, gravity: &Vector3<T>) -> [T; INERTIAL] {
    let h = subspace.angular.cross(gravity);
    let zero = T::zero();
    let m = -subspace.linear.dot(gravity);
    [m, h.x, h.y, h.z, zero, zero, zero, zero, zero, zero]
}

/// r(S, −γ) − r(Ṡ, v).
#[inline(always)]
fn rate_row<T: Real>(
    subspace: &Motion<T>,
    rate: &Motion<T>,
    velocity: &Motion<T>,
    gravity: &Vector3<T>,
) -> [T; INERTIAL] {
    let (weight, momentum) = (gravity_row(subspace, gravity), momentum_row(rate, velocity));
    core::array::from_fn(|n| weight[n] - momentum[n])
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// The matrix of what `write` writes.
    fn assemble<const P: usize>(
        &self,
        write: impl FnOnce(&mut dyn FnMut(usize, usize, [T; INERTIAL])),
    ) -> SMatrix<T, V, P> {
        const { assert!(P == INERTIAL * B) }
        let mut regressor = SMatrix::<T, V, P>::zeros();
        write(&mut |c, b, run| {
            for (n, entry) in run.into_iter().enumerate() {
                if let Some(to) = regressor.get_mut((c, INERTIAL * b + n)) {
                    *to = entry;
                }
            }
        });
        regressor
    }

    /// Calls `visit(c, b, S, Ṡ)` for each coordinate c that moves body b: the coordinate's column of the body's Jacobian and
    /// how fast that turns, in the body's coordinates. Each is carried down the subtree of its joint. Without `OWN` the one
    /// coordinate of a body's own joint is left out: what it sees of its body costs less by [`own_run`](Self::own_run).
    #[inline(always)]
    fn for_each_subspace<const OWN: bool>(
        &self,
        k: &Kinematics<T, B, V>,
        mut visit: impl FnMut(usize, usize, &Motion<T>, &Motion<T>),
    ) {
        let mut carried = [(Motion::zero(), Motion::zero()); B];
        for a in 0..B {
            for (n, c) in self.coordinates(a).enumerate() {
                carried[a] = by_joint!(self.own_carried(a, k), free: {
                    let own = self.own_subspace(a, n);
                    (own, k.velocity[a].cross(&own))
                });
                if OWN || self.kind(a) == JointKind::Free {
                    visit(c, a, &carried[a].0, &carried[a].1);
                }
                for b in self.subtree(a).skip(1) {
                    // Its parent is in the subtree as well, and comes before.
                    let Some(body) = self.bodies().get(b) else {
                        break;
                    };
                    let Some(&above) = carried.get(body.parent.unwrap_or(a)) else {
                        break;
                    };
                    let moved = by_joint!(
                        self.carry_down(b, &k.placements, &above),
                        free: above
                    );
                    visit(c, b, &moved.0, &moved.1);
                    carried[b] = moved;
                }
            }
        }
    }

    /// S and Ṡ of a joint's coordinate in its own body.
    #[inline(always)]
    fn own_carried<J: JointFrame<T>>(
        &self,
        b: usize,
        k: &Kinematics<T, B, V>,
    ) -> (Motion<T>, Motion<T>) {
        let v = &k.velocity[b];
        let own = self.own_subspace(b, 0);
        if J::SLIDES {
            return (own, v.cross(&own));
        }
        let joint = J::new(&k.placements.from_parent[b], &self.bodies()[b].joint);
        let rate = Motion::new(joint.cross_axis(&v.angular), joint.cross_axis(&v.linear));
        (Motion::new(joint.axis(), Vector3::zeros()), rate)
    }

    #[inline(always)]
    fn carry_down<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        (s, rate): &(Motion<T>, Motion<T>),
    ) -> (Motion<T>, Motion<T>) {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        (
            lowered(&joint, &placement.translation, s),
            lowered(&joint, &placement.translation, rate),
        )
    }

    /// W_m with W_m θ = H q̇, the generalised momentum (N m s), into `rows`.
    pub fn write_momentum_regressor(
        &self,
        k: &Kinematics<T, B, V>,
        rows: &mut RegressorRows<T, B, V>,
    ) {
        for b in 0..B {
            let c = self.coordinates(b).start;
            put(
                rows,
                c,
                b,
                by_joint!(self.own_momentum(b, k), free: [T::zero(); INERTIAL]),
            );
        }
        self.for_each_subspace::<false>(k, |c, b, s, _| {
            put(rows, c, b, momentum_row(s, &k.velocity[b]).into());
        });
    }

    /// r(S, v) of a joint and its own body.
    #[inline(always)]
    fn own_momentum<J: JointFrame<T>>(&self, b: usize, k: &Kinematics<T, B, V>) -> [T; INERTIAL] {
        let v = &k.velocity[b];
        if J::SLIDES {
            return momentum_row(&self.own_subspace(b, 0), v).into();
        }
        let joint = J::new(&k.placements.from_parent[b], &self.bodies()[b].joint);
        let (w, zero) = (&v.angular, T::zero());
        let h = joint.cross_axis(&v.linear);
        let [xx, xy, xz, yy, yz, zz] = joint.combine(&[
            [w.x, w.y, w.z, zero, zero, zero],
            [zero, w.x, zero, w.y, w.z, zero],
            [zero, zero, w.x, zero, w.y, w.z],
        ]);
        [zero, h.x, h.y, h.z, xx, xy, xz, yy, yz, zz]
    }

    /// [`write_momentum_regressor`](Self::write_momentum_regressor) as a matrix.
    pub fn momentum_regressor<const P: usize>(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, P> {
        self.assemble(|write| {
            self.for_each_subspace::<true>(k, |c, b, s, _| {
                write(c, b, momentum_row(s, &k.velocity[b]).into());
            });
        })
    }

    /// W_c with W_c θ = Cᵀ q̇ (N m), into `rows`.
    pub fn write_coriolis_transpose_regressor(
        &self,
        k: &Kinematics<T, B, V>,
        rows: &mut RegressorRows<T, B, V>,
    ) {
        self.for_each_subspace::<true>(k, |c, b, _, rate| {
            put(rows, c, b, momentum_row(rate, &k.velocity[b]).into());
        });
    }

    /// [`write_coriolis_transpose_regressor`](Self::write_coriolis_transpose_regressor) as a matrix.
    pub fn coriolis_transpose_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
    ) -> SMatrix<T, V, P> {
        self.assemble(|write| {
            self.for_each_subspace::<true>(k, |c, b, _, rate| {
                write(c, b, momentum_row(rate, &k.velocity[b]).into());
            });
        })
    }

    /// W_g with W_g θ = g(q) (N m), into `rows`.
    pub fn write_gravity_regressor(
        &self,
        k: &Kinematics<T, B, V>,
        rows: &mut RegressorRows<T, B, V>,
    ) {
        self.for_each_subspace::<true>(k, |c, b, s, _| {
            put(rows, c, b, gravity_row(s, &k.gravity[b]))
        });
    }

    /// [`write_gravity_regressor`](Self::write_gravity_regressor) as a matrix.
    pub fn gravity_regressor<const P: usize>(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, P> {
        self.assemble(|write| {
            self.for_each_subspace::<true>(k, |c, b, s, _| {
                write(c, b, gravity_row(s, &k.gravity[b]))
            });
        })
    }

    /// W_g − W_c, the integrand of the momentum equation (N m), in one pass, into `rows`.
    pub fn write_momentum_rate_regressor(
        &self,
        k: &Kinematics<T, B, V>,
        rows: &mut RegressorRows<T, B, V>,
    ) {
        for b in 0..B {
            // What a joint feels of its own body is the same as without acceleration: Ṡ is then how S changes in the body.
            let v = &k.velocity[b];
            let block = Block::new(&Acceleration {
                velocity: v.angular,
                angular: Vector3::zeros(),
                linear: v.angular.cross(&v.linear) - k.gravity[b],
            });
            let c = self.coordinates(b).start;
            let own = by_joint!(
                self.own_run(b, &k.placements, &block),
                free: [T::zero(); INERTIAL]
            );
            put(rows, c, b, own);
        }
        self.for_each_subspace::<false>(k, |c, b, s, rate| {
            put(rows, c, b, rate_row(s, rate, &k.velocity[b], &k.gravity[b]));
        });
    }

    /// [`write_momentum_rate_regressor`](Self::write_momentum_rate_regressor) as a matrix.
    pub fn momentum_rate_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
    ) -> SMatrix<T, V, P> {
        self.assemble(|write| {
            self.for_each_subspace::<true>(k, |c, b, s, rate| {
                write(c, b, rate_row(s, rate, &k.velocity[b], &k.gravity[b]));
            });
        })
    }

    /// W with W θ = H a + C v + g = τ (N m), the joint torque regressor (Atkeson, An & Hollerbach 1986), into `rows`.
    pub fn write_inverse_dynamics_regressor(
        &self,
        placements: &Placements<T, B>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
        rows: &mut RegressorRows<T, B, V>,
    ) {
        self.for_each_torque_run(placements, v, a, |c, b, run| put(rows, c, b, run));
    }

    /// [`write_inverse_dynamics_regressor`](Self::write_inverse_dynamics_regressor) as a matrix.
    pub fn inverse_dynamics_regressor<const P: usize>(
        &self,
        k: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
    ) -> SMatrix<T, V, P> {
        self.assemble(|write| self.for_each_torque_run(&k.placements, v, a, write))
    }

    /// Calls `write(c, b, run)` with what coordinate c feels of body b.
    #[inline(always)]
    fn for_each_torque_run(
        &self,
        placements: &Placements<T, B>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
        mut write: impl FnMut(usize, usize, [T; INERTIAL]),
    ) {
        let mut moved = [Acceleration::zero(); B];
        let mut blocks = [Block::ZERO; B];
        // On a free base: where the bodies are in it.
        let mut in_base = [(Matrix3::identity(), Vector3::zeros()); B];
        let free = B > 0 && self.coordinates(0).len() == 6;
        for b in 0..B {
            moved[b] = by_joint!(
                self.accelerate(b, placements, v, a, &placements.gravity, &moved),
                free: accelerate_free(v, a, &placements.gravity)
            );
            blocks[b] = Block::new(&moved[b]);
            if free {
                if b > 0 {
                    in_base[b] = by_joint!(
                        self.place_in_base(b, placements, &in_base),
                        free: (Matrix3::identity(), Vector3::zeros())
                    );
                }
                let rows = blocks[b].rows(&in_base[b].0, &in_base[b].1);
                for (c, run) in rows.into_iter().enumerate() {
                    write(c, b, run);
                }
            }
        }
        let mut carried = [Motion::zero(); B];
        for a in usize::from(free)..B {
            let c = self.coordinates(a).start;
            let own = by_joint!(
                self.own_run(a, placements, &blocks[a]),
                free: [T::zero(); INERTIAL]
            );
            write(c, a, own);
            carried[a] = self.own_subspace(a, 0);
            for b in self.subtree(a).skip(1) {
                // Its parent is in the subtree as well, and comes before.
                let Some(body) = self.bodies().get(b) else {
                    break;
                };
                let Some(&above) = carried.get(body.parent.unwrap_or(a)) else {
                    break;
                };
                carried[b] = by_joint!(self.lower(b, placements, &above), free: above);
                write(
                    c,
                    b,
                    blocks[b].along(&carried[b].angular, &carried[b].linear),
                );
            }
        }
    }

    /// What a joint feels of its own body.
    #[inline(always)]
    fn own_run<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        block: &Block<T>,
    ) -> [T; INERTIAL] {
        let joint = J::new(&placements.from_parent[b], &self.bodies()[b].joint);
        let zero = T::zero();
        if J::SLIDES {
            let [m, x, y, z] = joint.combine(block.force());
            [m, x, y, z, zero, zero, zero, zero, zero, zero]
        } else {
            let h = joint.cross_axis(&block.acceleration());
            let [xx, xy, xz, yy, yz, zz] = joint.combine(block.couple());
            [zero, h.x, h.y, h.z, xx, xy, xz, yy, yz, zz]
        }
    }

    #[inline(always)]
    fn lower<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        s: &Motion<T>,
    ) -> Motion<T> {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        lowered(&joint, &placement.translation, s)
    }

    #[inline(always)]
    fn place_in_base<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        in_base: &[(Matrix3<T>, Vector3<T>); B],
    ) -> (Matrix3<T>, Vector3<T>) {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let parent = self.bodies()[b].parent.unwrap_or(0);
        let Some((rotation, p)) = in_base.get(parent) else {
            return (Matrix3::identity(), Vector3::zeros());
        };
        (joint.after(rotation), p + rotation * placement.translation)
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

/// A twist of the parent's frame, felt at a child's frame whose origin is at `p`, in the child's axes.
#[inline(always)]
fn lowered<T: Real, J: JointFrame<T>>(joint: &J, p: &Vector3<T>, s: &Motion<T>) -> Motion<T> {
    Motion::new(
        joint.to_child(&s.angular),
        joint.to_child(&(s.linear + s.angular.cross(p))),
    )
}
