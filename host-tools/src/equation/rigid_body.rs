//! A limb's rigid body behind one interface, whatever its number of joints.
//!
//! The core's trees have their size at compile time. Each size takes half a second to compile, so not every one is there: a limb of another
//! number of joints is filled up with bodies without mass at its end, which change nothing of the joints before them.

use proprio_core::dynamics::MomentumDerivatives;
use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::regressor::RegressorRows;
use proprio_core::spatial::Transform;
use proprio_core::tree::{Kinematics, Placements, Tree};

use nalgebra::{SMatrix, SVector};

use crate::model::{Limb, Model};
#[cfg(doc)]
use crate::recording::MAX_JOINTS;

/// The momentum equation's parts for a limb of n joints on a fixed base, at one instant.
///
/// Matrices are row-major, n × 10 n: joint by joint, the ten parameters of each body.
pub(crate) trait RigidBody: Send + Sync {
    /// W_m and W_g − W_c at a position (rad) and velocity (rad/s); N m s and N m per unit of each parameter. And the slopes there, where they are asked for.
    fn regressors(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 2],
        momentum: Option<&mut [f64]>,
        rate: &mut [f64],
        slopes: Option<&mut Slopes>,
    );

    /// How momentum and rate change with the motion, at the current inertias.
    fn slopes(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], slopes: &mut Slopes);

    /// H q̇ (N m s) and g − Cᵀ q̇ (N m) at a position and velocity, at the current inertias.
    fn momentum_and_rate(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 2],
        momentum: &mut [f64],
        rate: &mut [f64],
    );

    /// W with W θ = H q̈ + C q̇ + g (N m per unit of each parameter) at a position, velocity and acceleration, row-major.
    fn torque_regressor(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]);

    /// τ = H q̈ + C q̇ + g (N m) at a position, velocity and acceleration, at the current inertias.
    fn inverse_dynamics(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]);

    /// The same, and the inertia that each joint turns at this position, H_jj (kg m²).
    fn torque_and_inertia(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 3],
        torque: &mut [f64],
        inertia: &mut [f64],
    );

    /// H (kg m²) at a position, row-major.
    fn inertia_matrix(&self, base: &Transform<f64>, q: &[f64], inertia: &mut [f64]);

    /// q̈ (rad/s²) of (H + diag(`armature`)) q̈ = τ − C q̇ − g at a position, velocity and torque; `armature` in kg m². False, and then
    /// `acceleration` is unspecified, if a joint has no inertia to move.
    #[must_use]
    fn forward_dynamics(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 3],
        armature: &[f64],
        acceleration: &mut [f64],
    ) -> bool;

    /// The row h with h θ = kinetic and potential energy (J per unit of each parameter).
    fn energy_regressor(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], energy: &mut [f64]);

    /// The same limb with other inertial parameters, one set per body.
    fn with_inertia(&self, bodies: &[InertialParameters<f64>]) -> Box<dyn RigidBody>;
}

/// Derivatives of a limb's momentum H q̇ and rate g − Cᵀ q̇ by position, by velocity and by the base's attitude.
#[derive(Debug, Clone)]
pub(crate) struct Slopes {
    joints: usize,
    /// Of momentum and rate by \[position, velocity\]: row j, column i is joint j's by joint i's, row-major.
    momentum: [Vec<f64>; 2],
    rate: [Vec<f64>; 2],
    /// Of the rate by the base's turning about its x, y and z axis: three numbers per joint.
    base: Vec<f64>,
}

impl Slopes {
    /// Room for a limb of so many joints.
    pub(crate) fn of(joints: usize) -> Self {
        let square = || vec![0.0; joints * joints];
        Self {
            joints,
            momentum: [square(), square()],
            rate: [square(), square()],
            base: vec![0.0; 3 * joints],
        }
    }

    /// Derivative of joint j's momentum and rate as joint `moved`'s link moves by \[position, velocity\].
    #[inline]
    pub(crate) fn along(
        &self,
        moved: usize,
        [position, velocity]: [f64; 2],
        j: usize,
    ) -> (f64, f64) {
        let at = j * self.joints + moved;
        (
            position * self.momentum[0][at] + velocity * self.momentum[1][at],
            position * self.rate[0][at] + velocity * self.rate[1][at],
        )
    }

    /// Derivative of joint j's rate by the base's turning about its own axis, N m/rad.
    pub(crate) fn by_base(&self, axis: usize, j: usize) -> f64 {
        self.base[3 * j + axis]
    }

    fn set<const B: usize>(&mut self, d: &MomentumDerivatives<f64, B>) {
        for j in 0..self.joints {
            for i in 0..self.joints {
                let at = j * self.joints + i;
                self.momentum[0][at] = d.momentum_by_position[(j, i)];
                self.momentum[1][at] = d.momentum_by_velocity[(j, i)];
                self.rate[0][at] = d.rate_by_position[(j, i)];
                self.rate[1][at] = -d.momentum_by_position[(i, j)];
            }
            for axis in 0..3 {
                self.base[3 * j + axis] = d.rate_by_base[(j, axis)];
            }
        }
    }
}

/// A tree of `B` bodies, of which the first `joints` are the limb's.
struct Dynamics<const B: usize, const P: usize> {
    tree: Tree<f64, B, B>,
    joints: usize,
}

impl<const B: usize, const P: usize> Dynamics<B, P> {
    fn of(model: &Model, limb: &Limb) -> Option<Box<dyn RigidBody>> {
        let (tree, joints) = (model.filled_limb_tree(limb)?, limb.bodies.len());
        Some(Box::new(Self { tree, joints }))
    }

    #[inline]
    fn kinematics(&self, base: &Transform<f64>, q: &[f64], dq: &[f64]) -> Kinematics<f64, B, B> {
        // In place: it is large, and asked for at every sample.
        let mut k = Kinematics::new();
        let [q, dq] = [q, dq].map(filled);
        self.tree.update_kinematics(&mut k, base, &q, &dq);
        k
    }

    /// Row by row.
    fn copy(&self, to: &mut [f64], from: &RegressorRows<f64, B, B>) {
        let rows = to.chunks_exact_mut(self.joints * INERTIAL);
        for (row, from) in rows.zip(from) {
            row.copy_from_slice(from[..self.joints].as_flattened());
        }
    }
}

/// What the limb's joints do, the others at rest.
fn filled<const B: usize>(of_limb: &[f64]) -> SVector<f64, B> {
    SVector::from_fn(|j, _| of_limb.get(j).copied().unwrap_or(0.0))
}

impl<const B: usize, const P: usize> RigidBody for Dynamics<B, P> {
    fn regressors(
        &self,
        base: &Transform<f64>,
        [q, dq]: [&[f64]; 2],
        momentum: Option<&mut [f64]>,
        rate: &mut [f64],
        slopes: Option<&mut Slopes>,
    ) {
        let k = self.kinematics(base, q, dq);
        let mut rows = [[[0.0; INERTIAL]; B]; B];
        self.tree.write_momentum_rate_regressor(&k, &mut rows);
        self.copy(rate, &rows);
        if let Some(momentum) = momentum {
            self.tree.write_momentum_regressor(&k, &mut rows);
            self.copy(momentum, &rows);
        }
        if let Some(slopes) = slopes {
            slopes.set(&self.tree.momentum_derivatives(&k));
        }
    }

    fn slopes(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], slopes: &mut Slopes) {
        let k = self.kinematics(base, q, dq);
        slopes.set(&self.tree.momentum_derivatives(&k));
    }

    fn momentum_and_rate(
        &self,
        base: &Transform<f64>,
        [q, dq]: [&[f64]; 2],
        momentum: &mut [f64],
        rate: &mut [f64],
    ) {
        let (p, r) = self.tree.momentum_and_rate(&self.kinematics(base, q, dq));
        momentum.copy_from_slice(&p.as_slice()[..self.joints]);
        rate.copy_from_slice(&r.as_slice()[..self.joints]);
    }

    fn torque_regressor(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]) {
        let [q, dq, ddq] = motion.map(filled);
        let placements = self.tree.placements(base, &q);
        let mut rows = [[[0.0; INERTIAL]; B]; B];
        self.tree
            .write_inverse_dynamics_regressor(&placements, &dq, &ddq, &mut rows);
        self.copy(torque, &rows);
    }

    fn inverse_dynamics(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]) {
        let [q, dq, ddq] = motion.map(filled);
        let mut placements = Placements::new();
        self.tree.update_placements(&mut placements, base, &q);
        let mut all = SVector::zeros();
        self.tree
            .write_inverse_dynamics(&placements, &dq, &ddq, &mut all);
        torque.copy_from_slice(&all.as_slice()[..self.joints]);
    }

    fn torque_and_inertia(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 3],
        torque: &mut [f64],
        inertia: &mut [f64],
    ) {
        let [q, dq, ddq] = motion.map(filled);
        let mut placements = Placements::new();
        self.tree.update_placements(&mut placements, base, &q);
        let (mut all, mut matrix) = (SVector::zeros(), SMatrix::zeros());
        self.tree
            .write_inverse_dynamics(&placements, &dq, &ddq, &mut all);
        self.tree.write_inertia_matrix(&placements, &mut matrix);
        torque.copy_from_slice(&all.as_slice()[..self.joints]);
        inertia
            .iter_mut()
            .enumerate()
            .for_each(|(j, own)| *own = matrix[(j, j)]);
    }

    fn inertia_matrix(&self, base: &Transform<f64>, q: &[f64], inertia: &mut [f64]) {
        let placements = self.tree.placements(base, &filled(q));
        let mut matrix = SMatrix::zeros();
        self.tree.write_inertia_matrix(&placements, &mut matrix);
        for (i, row) in inertia.chunks_exact_mut(self.joints).enumerate() {
            row.iter_mut()
                .enumerate()
                .for_each(|(j, own)| *own = matrix[(i, j)]);
        }
    }

    fn forward_dynamics(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 3],
        armature: &[f64],
        acceleration: &mut [f64],
    ) -> bool {
        let [q, dq, torque] = motion.map(filled);
        let placements = self.tree.placements(base, &q);
        // Bodies without mass that fill the tree up have nothing else to move.
        let armature = SVector::from_fn(|j, _| armature.get(j).copied().unwrap_or(1.0));
        let mut all = SVector::zeros();
        let tree = &self.tree;
        let moves = tree.write_forward_dynamics(&placements, &dq, &torque, &armature, &mut all);
        acceleration.copy_from_slice(&all.as_slice()[..self.joints]);
        moves
    }

    fn energy_regressor(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], energy: &mut [f64]) {
        let k = self.kinematics(base, q, dq);
        let (kinetic, potential) = self.tree.energy_regressor::<P>(&k, base);
        let energies = kinetic + potential;
        energy.copy_from_slice(&energies.as_slice()[..energy.len()]);
    }

    fn with_inertia(&self, bodies: &[InertialParameters<f64>]) -> Box<dyn RigidBody> {
        let nothing = InertialParameters::zero();
        let all = std::array::from_fn(|b| *bodies.get(b).unwrap_or(&nothing));
        Box::new(Self {
            tree: self.tree.with_inertia(&all),
            ..*self
        })
    }
}

/// A limb of `model` with the model's inertial parameters; `None` for more than [`MAX_JOINTS`].
pub(crate) fn of_limb(model: &Model, limb: &Limb) -> Option<Box<dyn RigidBody>> {
    macro_rules! sizes {
        ($($numbers:pat => $n:literal)*) => {
            match limb.bodies.len() {
                $($numbers => Dynamics::<$n, { $n * INERTIAL }>::of(model, limb),)*
                _ => None,
            }
        };
    }
    sizes!(1 => 1 2 => 2 3 => 3 4 => 4 5..=6 => 6 7 => 7 8 => 8 9..=12 => 12 13..=16 => 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Robot;

    /// A leg of three bodies as it is, and filled up to five.
    #[test]
    fn bodies_without_mass_at_the_end_change_nothing() {
        let model = Model::new(Robot::go2());
        let limb = &model.robot().limbs()[0];
        let (own, more) = (
            Dynamics::<3, 30>::of(&model, limb).unwrap(),
            Dynamics::<5, 50>::of(&model, limb).unwrap(),
        );
        let base = model.base();
        let [q, dq, ddq] =
            [0.3, -1.1, 2.7].map(|x| (1..4).map(|j| (x * f64::from(j)).sin()).collect::<Vec<_>>());
        let told = |body: &dyn RigidBody| {
            let [mut momentum, mut rate, mut torque] = [(); 3].map(|()| vec![0.0; 90]);
            body.regressors(&base, [&q, &dq], Some(&mut momentum), &mut rate, None);
            body.torque_regressor(&base, [&q, &dq, &ddq], &mut torque);
            let [mut p, mut r, mut forces, mut inertia] = [(); 4].map(|()| vec![0.0; 3]);
            body.momentum_and_rate(&base, [&q, &dq], &mut p, &mut r);
            body.torque_and_inertia(&base, [&q, &dq, &ddq], &mut forces, &mut inertia);
            let mut energy = vec![0.0; 30];
            body.energy_regressor(&base, &q, &dq, &mut energy);
            let (mut matrix, mut acceleration) = (vec![0.0; 9], vec![0.0; 3]);
            body.inertia_matrix(&base, &q, &mut matrix);
            assert!(body.forward_dynamics(&base, [&q, &dq, &forces], &[0.0; 3], &mut acceleration));
            for (own, given) in acceleration.iter().zip(&ddq) {
                assert!(
                    (own - given).abs() < 1e-9,
                    "forward dynamics of inverse dynamics"
                );
            }
            let mut slopes = Slopes::of(3);
            body.slopes(&base, &q, &dq, &mut slopes);
            let [position, velocity] = slopes.momentum;
            [
                momentum, rate, torque, p, r, forces, inertia, energy, position, velocity, matrix,
            ]
            .concat()
        };
        let inertia: Vec<_> = limb.bodies.clone().map(|b| *model.inertia(b)).collect();
        let (own, more) = (told(&*own), told(&*more.with_inertia(&inertia)));
        assert!(own.iter().filter(|x| **x != 0.0).count() > 100);
        for (own, more) in own.iter().zip(&more) {
            assert!(
                (own - more).abs() < 1e-12 * (1.0 + own.abs()),
                "{own} {more}"
            );
        }
    }
}
