//! Forward dynamics: the articulated-body algorithm (Featherstone 1983; ch. 7), at a cost that grows with the number of bodies.
//!
//! What velocity and gravity ask for is inverse dynamics without joint acceleration; the rest solves H q̈ = τ − that at rest.
//! An articulated body answers a motion (α, a) of its frame, in which its joints are free, by
//!
//! ```text
//! n = I α + H a + pₙ,     f = Hᵀ α + M a + p_f
//! ```
//!
//! with symmetric I and M. Its joint, of axis s, takes U = (I s, Hᵀ s) and D = s·I s + armature out of it (U = (H s, M s) if
//! it slides): what is left, moved to the parent's frame, is what the parent carries.

use crate::Real;
use crate::inertia::InertialParameters;
use crate::spatial::{Force, Motion};
use crate::tree::joint_frame::{JointFrame, by_joint};
use crate::tree::{Joint, Placements, Tree};
use nalgebra::{Cholesky, Const, Matrix3, Matrix6, SVector, Vector3, Vector6};

/// An articulated body in its own frame; symmetric matrices as (xx, xy, xz, yy, yz, zz).
#[derive(Clone, Copy)]
struct Articulated<T: Real> {
    /// I, kg m².
    rotational: [T; 6],
    /// H, kg m.
    coupling: Matrix3<T>,
    /// M, kg.
    mass: [T; 6],
    /// p.
    bias: Force<T>,
}

/// What a joint took out of its articulated body.
#[derive(Clone, Copy)]
struct Taken<T: Real> {
    /// U.
    force: Force<T>,
    /// 1 / D.
    inverse: T,
    /// (τ − s·p) / D.
    acceleration: T,
}

impl<T: Real> Articulated<T> {
    fn rigid(inertia: &InertialParameters<T>) -> Self {
        let (m, zero) = (inertia.mass(), T::zero());
        Self {
            rotational: inertia.inertia_entries(),
            coupling: inertia.first_moment().cross_matrix(),
            mass: [m, zero, zero, m, zero, m],
            bias: Force::zero(),
        }
    }

    /// Takes the joint out.
    #[inline(always)]
    fn reduce(&mut self, u: &Force<T>, inverse: T, acceleration: T) {
        let (n, f) = (&u.angular, &u.linear);
        let (scaled_n, scaled_f) = (n * inverse, f * inverse);
        subtract_product(&mut self.rotational, n, &scaled_n);
        subtract_product(&mut self.mass, f, &scaled_f);
        self.coupling -= n * scaled_f.transpose();
        self.bias.angular += n * acceleration;
        self.bias.linear += f * acceleration;
    }

    /// Adds a child, its axes turned already, whose frame's origin is at `p`.
    #[inline(always)]
    fn add(&mut self, child: &Self, p: &Vector3<T>) {
        let mass = matrix(&child.mass);
        let coupling = child.coupling + cross_columns(p, &mass);
        // I' = I + (p× Hᵀ)ᵀ + p× H'ᵀ.
        let (before, after) = (
            cross_columns(p, &child.coupling.transpose()),
            cross_columns(p, &coupling.transpose()),
        );
        for (n, (i, j)) in ENTRIES.into_iter().enumerate() {
            self.rotational[n] += child.rotational[n] + before[(j, i)] + after[(i, j)];
            self.mass[n] += child.mass[n];
        }
        self.coupling += coupling;
        self.bias.angular += child.bias.angular + p.cross(&child.bias.linear);
        self.bias.linear += child.bias.linear;
    }
}

/// Rows and columns of a symmetric matrix's six numbers.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

fn matrix<T: Real>(i: &[T; 6]) -> Matrix3<T> {
    Matrix3::new(i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5])
}

/// \[p\]× M.
#[inline(always)]
fn cross_columns<T: Real>(p: &Vector3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    let column = |n: usize| p.cross(&m.column(n).into_owned());
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

/// M − a bᵀ where that is symmetric.
#[inline(always)]
fn subtract_product<T: Real>(m: &mut [T; 6], a: &Vector3<T>, b: &Vector3<T>) {
    for (n, (i, j)) in ENTRIES.into_iter().enumerate() {
        m[n] -= a[i] * b[j];
    }
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// Forward dynamics: the acceleration that solves (H + diag(`armature`)) a = τ − C v − g, into `acceleration`.
    ///
    /// `armature` is the rotor inertia seen from the joint, kg m²; zero on a free base's coordinates. False, and then
    /// `acceleration` is unspecified, if a joint or the base has no inertia to move, as with massless bodies.
    #[must_use]
    pub fn write_forward_dynamics(
        &self,
        placements: &Placements<T, B>,
        v: &SVector<T, V>,
        torque: &SVector<T, V>,
        armature: &SVector<T, V>,
        acceleration: &mut SVector<T, V>,
    ) -> bool {
        let mut bias = SVector::zeros();
        self.write_inverse_dynamics(placements, v, &SVector::zeros(), &mut bias);
        self.solve_inertia(placements, &(torque - bias), armature, acceleration)
    }

    /// Solves (H + diag(`armature`)) a = τ into `acceleration`; false if that matrix is not positive definite.
    fn solve_inertia(
        &self,
        placements: &Placements<T, B>,
        torque: &SVector<T, V>,
        armature: &SVector<T, V>,
        acceleration: &mut SVector<T, V>,
    ) -> bool {
        let bodies = self.bodies().each_ref();
        let mut articulated = bodies.map(|body| Articulated::rigid(&body.inertia));
        let mut taken = [Taken {
            force: Force::zero(),
            inverse: T::zero(),
            acceleration: T::zero(),
        }; B];
        let mut positive = true;
        for b in (0..B).rev() {
            by_joint!(
                self.take_joint(b, placements, torque, armature, &mut articulated, &mut taken),
                free: {}
            );
            // A free base is checked by its own solution below.
            positive &= taken[b].inverse > T::zero() || self.bodies()[b].joint == Joint::Free;
        }
        let mut moved = [Motion::zero(); B];
        for b in 0..B {
            by_joint!(
                self.release(b, placements, &taken, &mut moved, acceleration),
                free: match solve_free(&articulated[b], torque, armature) {
                    Some(motion) => {
                        moved[b] = motion;
                        for n in 0..3 {
                            acceleration[n] = motion.angular[n];
                            acceleration[3 + n] = motion.linear[n];
                        }
                    }
                    None => positive = false,
                }
            );
        }
        positive
    }

    /// Takes body b's joint out of its articulated body and gives the rest to the body that carries it.
    #[inline(always)]
    fn take_joint<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        torque: &SVector<T, V>,
        armature: &SVector<T, V>,
        articulated: &mut [Articulated<T>; B],
        taken: &mut [Taken<T>; B],
    ) {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let own = &mut articulated[b];
        let s = joint.axis();
        let (force, inertia, bias) = if J::SLIDES {
            let force = Force::new(own.coupling * s, matrix(&own.mass) * s);
            (
                force,
                joint.along(&force.linear),
                joint.along(&own.bias.linear),
            )
        } else {
            let force = Force::new(matrix(&own.rotational) * s, own.coupling.tr_mul(&s));
            (
                force,
                joint.along(&force.angular),
                joint.along(&own.bias.angular),
            )
        };
        let c = self.coordinates(b).start;
        let inverse = T::one() / (inertia + armature[c]);
        let acceleration = (torque[c] - bias) * inverse;
        taken[b] = Taken {
            force,
            inverse,
            acceleration,
        };
        let Some(parent) = self.bodies()[b].parent else {
            return;
        };
        own.reduce(&force, inverse, acceleration);
        let turned = Articulated {
            rotational: joint.symmetric_to_parent(&own.rotational),
            coupling: joint.matrix_to_parent(&own.coupling),
            mass: joint.symmetric_to_parent(&own.mass),
            bias: Force::new(
                joint.to_parent(&own.bias.angular),
                joint.to_parent(&own.bias.linear),
            ),
        };
        articulated[parent].add(&turned, &placement.translation);
    }

    /// How body b's joint accelerates, its parent's motion known.
    #[inline(always)]
    fn release<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        taken: &[Taken<T>; B],
        moved: &mut [Motion<T>; B],
        acceleration: &mut SVector<T, V>,
    ) {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let above = match self.bodies()[b].parent {
            Some(parent) => {
                let above = &moved[parent];
                let linear = above.linear + above.angular.cross(&placement.translation);
                Motion::new(joint.to_child(&above.angular), joint.to_child(&linear))
            }
            None => Motion::zero(),
        };
        let Taken {
            force,
            inverse,
            acceleration: free,
        } = &taken[b];
        let own = *free - above.dot(force) * *inverse;
        acceleration[self.coordinates(b).start] = own;
        moved[b] = if J::SLIDES {
            Motion::new(above.angular, joint.plus_along(&above.linear, own))
        } else {
            Motion::new(joint.plus_along(&above.angular, own), above.linear)
        };
    }
}

/// How a free base accelerates under the wrench on it.
fn solve_free<T: Real, const V: usize>(
    base: &Articulated<T>,
    torque: &SVector<T, V>,
    armature: &SVector<T, V>,
) -> Option<Motion<T>> {
    let mut inertia = Matrix6::zeros();
    let (rotational, mass) = (matrix(&base.rotational), matrix(&base.mass));
    inertia.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotational);
    inertia
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&base.coupling);
    inertia
        .fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&base.coupling.transpose());
    inertia.fixed_view_mut::<3, 3>(3, 3).copy_from(&mass);
    let bias = &base.bias;
    let force = Vector6::from_fn(|n, _| {
        let bias = if n < 3 {
            bias.angular[n]
        } else {
            bias.linear[n - 3]
        };
        torque[n] - bias
    });
    for n in 0..6 {
        inertia[(n, n)] += armature[n];
    }
    let moved = Cholesky::<T, Const<6>>::new(inertia)?.solve(&force);
    Some(Motion::new(
        Vector3::new(moved[0], moved[1], moved[2]),
        Vector3::new(moved[3], moved[4], moved[5]),
    ))
}
