//! The joint-space inertia matrix: the composite-rigid-body algorithm (Walker & Orin 1982; Featherstone ch. 6).
//!
//! From the leaves inwards each body becomes the composite of all it carries; column c of H is the force that moves the
//! composite of c's body at unit acceleration, as the joints between it and the base feel it.

use crate::Real;
use crate::inertia::InertialParameters;
use crate::spatial::Force;
use crate::tree::joint_frame::{JointFrame, by_joint};
use crate::tree::{Placements, Tree};
use nalgebra::{SMatrix, Vector3};

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// The joint-space inertia matrix H(q) into `inertia`, which is of this tree already, or zero: what no tree of this
    /// shape can have is not touched.
    pub fn write_inertia_matrix(
        &self,
        placements: &Placements<T, B>,
        inertia: &mut SMatrix<T, V, V>,
    ) {
        let mut composite = self.bodies().each_ref().map(|body| body.inertia);
        for b in (0..B).rev() {
            by_joint!(
                self.gather_inertia(b, placements, &mut composite, inertia),
                free: write_free(&composite[b], inertia)
            );
        }
    }

    /// The columns of body b's joint; then the composite goes to the body that carries it.
    #[inline(always)]
    fn gather_inertia<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        composite: &mut [InertialParameters<T>; B],
        inertia: &mut SMatrix<T, V, V>,
    ) {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let own = composite[b];
        let h = own.first_moment();
        let axis = joint.axis();
        let (mut force, felt) = if J::SLIDES {
            (
                Force::new(joint.cross_axis(&h), axis * own.mass()),
                own.mass(),
            )
        } else {
            let couple = own.turned(&axis);
            let felt = joint.along(&couple);
            (Force::new(couple, -joint.cross_axis(&h)), felt)
        };
        let c = self.coordinates(b).start;
        inertia[(c, c)] = felt;
        let Some(parent) = self.bodies()[b].parent else {
            return;
        };
        let carried = own.carried(
            &joint.symmetric_to_parent(&own.inertia_entries()),
            &joint.to_parent(&h),
            &placement.translation,
        );
        composite[parent] = composite[parent] + carried;
        let linear = joint.to_parent(&force.linear);
        let lever = placement.translation.cross(&linear);
        force = Force::new(joint.to_parent(&force.angular) + lever, linear);
        let mut ancestor = parent;
        loop {
            let last = by_joint!(
                self.feel(ancestor, placements, c, &mut force, inertia),
                free: feel_free(c, &force, inertia)
            );
            match last {
                Some(above) => ancestor = above,
                None => break,
            }
        }
    }

    /// What the joint of body `a` feels of column c's force; then the force goes to the body that carries it, which is told.
    #[inline(always)]
    fn feel<J: JointFrame<T>>(
        &self,
        a: usize,
        placements: &Placements<T, B>,
        c: usize,
        force: &mut Force<T>,
        inertia: &mut SMatrix<T, V, V>,
    ) -> Option<usize> {
        let placement = &placements.from_parent[a];
        let joint = J::new(placement, &self.bodies()[a].joint);
        let part = if J::SLIDES {
            &force.linear
        } else {
            &force.angular
        };
        let (felt, row) = (joint.along(part), self.coordinates(a).start);
        inertia[(row, c)] = felt;
        inertia[(c, row)] = felt;
        let parent = self.bodies()[a].parent?;
        let linear = joint.to_parent(&force.linear);
        let lever = placement.translation.cross(&linear);
        *force = Force::new(joint.to_parent(&force.angular) + lever, linear);
        Some(parent)
    }
}

/// What a free base feels of column c's force.
#[inline(always)]
fn feel_free<T: Real, const V: usize>(
    c: usize,
    force: &Force<T>,
    inertia: &mut SMatrix<T, V, V>,
) -> Option<usize> {
    for n in 0..3 {
        inertia[(n, c)] = force.angular[n];
        inertia[(c, n)] = force.angular[n];
        inertia[(3 + n, c)] = force.linear[n];
        inertia[(c, 3 + n)] = force.linear[n];
    }
    None
}

/// A free base's own block: the whole tree as one body, \[I, \[h\]×; −\[h\]×, m 1\].
#[inline(always)]
fn write_free<T: Real, const V: usize>(
    whole: &InertialParameters<T>,
    inertia: &mut SMatrix<T, V, V>,
) {
    let (rotational, h) = (whole.rotational_inertia(), whole.first_moment());
    for column in 0..3 {
        let lever = h.cross(&Vector3::ith(column, T::one()));
        for row in 0..3 {
            inertia[(row, column)] = rotational[(row, column)];
            inertia[(row, 3 + column)] = lever[row];
            inertia[(3 + column, row)] = lever[row];
            let mass = if row == column {
                whole.mass()
            } else {
                T::zero()
            };
            inertia[(3 + row, 3 + column)] = mass;
        }
    }
}
