//! A limb's rigid body behind one interface, whatever its number of joints.

use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Kinematics, Tree};

use nalgebra::{SMatrix, SVector};

use crate::model::{Limb, Model};

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

    /// H q̇ (N m s) and g − Cᵀ q̇ (N m) for the current inertias.
    fn momentum_and_rate(
        &self,
        base: &Transform<f64>,
        q: &[f64],
        dq: &[f64],
        momentum: &mut [f64],
        rate: &mut [f64],
    );

    /// W with W θ = H q̈ + C q̇ + g (N m per unit of each parameter) at a position, velocity and acceleration.
    fn torque_regressor(&self, base: &Transform<f64>, motion: [&[f64]; 3], torque: &mut [f64]);

    /// The row h with h θ = kinetic and potential energy (J per unit of each parameter).
    fn energy_regressor(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], energy: &mut [f64]);

    /// Takes inertial parameters, ten per body.
    fn set_inertia(&mut self, theta: &[f64]);
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

    fn momentum_and_rate(
        &self,
        base: &Transform<f64>,
        q: &[f64],
        dq: &[f64],
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

    fn energy_regressor(&self, base: &Transform<f64>, q: &[f64], dq: &[f64], energy: &mut [f64]) {
        let k = self.kinematics(base, q, dq);
        let (kinetic, potential) = self.0.energy_regressor::<P>(&k, base);
        energy.copy_from_slice((kinetic + potential).as_slice());
    }

    fn set_inertia(&mut self, theta: &[f64]) {
        let body = |b: usize| {
            InertialParameters(SVector::from_column_slice(
                &theta[INERTIAL * b..INERTIAL * (b + 1)],
            ))
        };
        self.0 = self.0.with_inertia(&std::array::from_fn(body));
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

/// A limb of `model` with the model's inertial parameters; `None` for more than eight joints.
pub(crate) fn of_limb(model: &Model, limb: &Limb) -> Option<Box<dyn RigidBody>> {
    sizes!(model, limb: 1 2 3 4 5 6 7 8)
}
