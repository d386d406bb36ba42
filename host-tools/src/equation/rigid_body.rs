//! A limb's rigid body behind one interface, whatever its number of joints.

use proprio_core::dynamics::MomentumDerivatives;
use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Kinematics, Tree};

use nalgebra::{SMatrix, SVector};

use crate::model::{Limb, Model};
#[cfg(doc)]
use crate::recording::MAX_JOINTS;

/// The momentum equation's parts for a limb of n joints on a fixed base, at one instant.
///
/// Matrices are row-major, n × 10 n: joint by joint, the ten parameters of each body.
pub(crate) trait RigidBody: Send + Sync {
    /// W_m and W_g − W_c at a position (rad) and velocity (rad/s); N m s and N m per unit of each parameter.
    fn regressors(
        &self,
        base: &Transform<f64>,
        q: &[f64],
        dq: &[f64],
        momentum: Option<&mut [f64]>,
        rate: &mut [f64],
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
        for j in 0..B {
            for i in 0..B {
                let at = j * B + i;
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

struct Dynamics<const B: usize, const P: usize>(Tree<f64, B, B>);

impl<const B: usize, const P: usize> Dynamics<B, P> {
    fn kinematics(&self, base: &Transform<f64>, q: &[f64], dq: &[f64]) -> Kinematics<f64, B, B> {
        let [q, dq] = [q, dq].map(SVector::from_column_slice);
        self.0.kinematics(base, &q, &dq)
    }
}

/// Row by row.
fn copy<const B: usize, const P: usize>(to: &mut [f64], from: &SMatrix<f64, B, P>) {
    for (j, row) in to.chunks_exact_mut(P).enumerate() {
        row.iter_mut()
            .zip(from.row(j).iter())
            .for_each(|(to, from)| *to = *from);
    }
}

impl<const B: usize, const P: usize> RigidBody for Dynamics<B, P> {
    fn regressors(
        &self,
        base: &Transform<f64>,
        q: &[f64],
        dq: &[f64],
        momentum: Option<&mut [f64]>,
        rate: &mut [f64],
    ) {
        let k = self.kinematics(base, q, dq);
        copy(rate, &self.0.momentum_rate_regressor::<P>(&k));
        if let Some(momentum) = momentum {
            copy(momentum, &self.0.momentum_regressor::<P>(&k));
        }
    }

    fn slopes(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], slopes: &mut Slopes) {
        let k = self.kinematics(base, q, dq);
        slopes.set(&self.0.momentum_derivatives(&k));
    }

    fn momentum_and_rate(
        &self,
        base: &Transform<f64>,
        [q, dq]: [&[f64]; 2],
        momentum: &mut [f64],
        rate: &mut [f64],
    ) {
        let (p, r) = self.0.momentum_and_rate(&self.kinematics(base, q, dq));
        momentum.copy_from_slice(p.as_slice());
        rate.copy_from_slice(r.as_slice());
    }

    fn torque_regressor(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]) {
        let [q, dq, ddq] = motion.map(SVector::from_column_slice);
        let k = self.0.kinematics(base, &q, &dq);
        let regressor = self.0.inverse_dynamics_regressor::<P>(&k, &dq, &ddq);
        copy(torque, &regressor);
    }

    fn inverse_dynamics(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]) {
        let [q, dq, ddq] = motion.map(SVector::from_column_slice);
        let placements = self.0.placements(base, &q);
        let mut all = SVector::zeros();
        (self.0).write_inverse_dynamics(&placements, &dq, &ddq, &mut all);
        torque.copy_from_slice(all.as_slice());
    }

    fn torque_and_inertia(
        &self,
        base: &Transform<f64>,
        motion: [&[f64]; 3],
        torque: &mut [f64],
        inertia: &mut [f64],
    ) {
        let [q, dq, ddq] = motion.map(SVector::from_column_slice);
        let placements = self.0.placements(base, &q);
        let (mut all, mut matrix) = (SVector::zeros(), SMatrix::zeros());
        (self.0).write_inverse_dynamics(&placements, &dq, &ddq, &mut all);
        self.0.write_inertia_matrix(&placements, &mut matrix);
        torque.copy_from_slice(all.as_slice());
        inertia
            .iter_mut()
            .enumerate()
            .for_each(|(j, own)| *own = matrix[(j, j)]);
    }

    fn energy_regressor(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], energy: &mut [f64]) {
        let k = self.kinematics(base, q, dq);
        let (kinetic, potential) = self.0.energy_regressor::<P>(&k, base);
        energy.copy_from_slice((kinetic + potential).as_slice());
    }

    fn with_inertia(&self, bodies: &[InertialParameters<f64>]) -> Box<dyn RigidBody> {
        let all = std::array::from_fn(|b| bodies[b]);
        Box::new(Self(self.0.with_inertia(&all)))
    }
}

macro_rules! sizes {
    ($model:ident, $limb:ident: $($n:literal)*) => {
        match $limb.bodies.len() {
            $($n => $model
                .limb_tree::<$n>($limb)
                .map(|tree| Box::new(Dynamics::<$n, { $n * INERTIAL }>(tree)) as Box<dyn RigidBody>),)*
            _ => None,
        }
    };
}

/// A limb of `model` with the model's inertial parameters; `None` for more than [`MAX_JOINTS`].
pub(crate) fn of_limb(model: &Model, limb: &Limb) -> Option<Box<dyn RigidBody>> {
    sizes!(model, limb: 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16)
}
