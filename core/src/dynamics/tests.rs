//! Identities that hold for any tree, state and parameters, on the Go2's leg, the pinned and the free robot.

use crate::go2::{self, Leg};
use crate::inertia::tests::physical;
use crate::spatial::Transform;
use crate::spatial::tests::transform;
use crate::tree::{Joint, Kinematics, Tree};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};
use proptest::prelude::*;
use std::prelude::rust_2024::*;

/// A state and accelerations of any tree of up to 18 coordinates and 13 bodies.
#[derive(Clone, Debug)]
struct Case {
    base: Transform<f64>,
    numbers: [[f64; 18]; 3],
    inertia: Vec<crate::inertia::InertialParameters<f64>>,
}

fn case() -> impl Strategy<Value = Case> {
    let numbers = prop::array::uniform3(prop::array::uniform18(-2.0..2.0f64));
    (transform(), numbers, prop::collection::vec(physical(), 13)).prop_map(
        |(base, numbers, inertia)| Case {
            base,
            numbers,
            inertia,
        },
    )
}

struct Moving<const B: usize, const V: usize> {
    tree: Tree<f64, B, V>,
    base: Transform<f64>,
    q: SVector<f64, V>,
    v: SVector<f64, V>,
    a: SVector<f64, V>,
}

impl<const B: usize, const V: usize> Moving<B, V> {
    fn new(tree: Tree<f64, B, V>, case: &Case) -> Self {
        let part = |n: usize| SVector::from_fn(|r, _| case.numbers[n][r]);
        let tree = tree.with_inertia(&core::array::from_fn(|b| case.inertia[b]));
        Self {
            tree,
            base: case.base,
            q: part(0),
            v: part(1),
            a: part(2),
        }
    }

    fn kinematics(&self) -> Kinematics<f64, B, V> {
        self.tree.kinematics(&self.base, &self.q, &self.v)
    }

    /// The state `dt` later, along constant acceleration: exact to second order in `dt`.
    fn after(&self, dt: f64) -> Self {
        let middle = self.v + self.a * (dt / 2.0);
        let mut base = self.base;
        if self.tree.bodies()[0].joint == Joint::Free {
            let turn = Rotation3::from_scaled_axis(middle.fixed_rows::<3>(0) * dt);
            let half = Rotation3::from_scaled_axis(middle.fixed_rows::<3>(0) * (dt / 2.0));
            base.translation += base.rotation * half.matrix() * middle.fixed_rows::<3>(3) * dt;
            base.rotation *= Matrix3::from(turn);
        }
        Self {
            tree: self.tree,
            base,
            q: self.q + middle * dt,
            v: self.v + self.a * dt,
            a: self.a,
        }
    }

    /// Central difference of `f` along the motion.
    fn rate<M>(&self, f: impl Fn(&Self) -> M) -> M
    where
        M: core::ops::Sub<Output = M> + core::ops::Div<f64, Output = M>,
    {
        let dt = 1e-5;
        (f(&self.after(dt)) - f(&self.after(-dt))) / (2.0 * dt)
    }
}

fn check<const B: usize, const V: usize, const P: usize>(
    m: &Moving<B, V>,
) -> Result<(), TestCaseError> {
    let k = m.kinematics();
    let theta = m.tree.parameters::<P>();
    let torque = m.tree.inverse_dynamics(&k, &m.v, &m.a);
    let (h, c) = (m.tree.inertia_matrix(&k), m.tree.coriolis_matrix(&k));
    let g = m.tree.gravity_torque(&k);
    let size = 1.0 + torque.norm() + h.norm() * m.v.norm() + (c * m.v).norm();
    let close = |a: SVector<f64, V>, b: SVector<f64, V>| (a - b).norm() < 1e-10 * size;

    // The equation, and every regressor against what it stands for.
    prop_assert!(close(h * m.a + c * m.v + g, torque));
    prop_assert!(close(c * m.v, m.tree.coriolis_torque(&k, &m.v)));
    prop_assert!(close(
        m.tree.inverse_dynamics_regressor::<P>(&k, &m.v, &m.a) * theta,
        torque
    ));
    prop_assert!(close(m.tree.momentum_regressor::<P>(&k) * theta, h * m.v));
    prop_assert!(close(
        m.tree.coriolis_transpose_regressor::<P>(&k) * theta,
        c.transpose() * m.v
    ));
    prop_assert!(close(m.tree.gravity_regressor::<P>(&k) * theta, g));
    let (momentum, rate) = m.tree.momentum_and_rate(&k);
    prop_assert!(close(momentum, h * m.v));
    prop_assert!(close(rate, g - c.transpose() * m.v));
    let (kinetic, potential) = m.tree.energy(&k, &m.base);
    let (w_kinetic, w_potential) = m.tree.energy_regressor::<P>(&k, &m.base);
    prop_assert!((w_kinetic.dot(&theta) - kinetic).abs() < 1e-10 * size);
    prop_assert!((w_potential.dot(&theta) - potential).abs() < 1e-9 * size);
    prop_assert!((kinetic - 0.5 * m.v.dot(&(h * m.v))).abs() < 1e-10 * size);

    // Ḣ = C + Cᵀ, hence Ḣ − 2C is skew.
    let rate: SMatrix<f64, V, V> = m.rate(|m| m.tree.inertia_matrix(&m.kinematics()));
    let fast = 1e-6 * (1.0 + h.norm() * (1.0 + m.v.norm() + m.a.norm()).powi(3));
    prop_assert!((rate - c - c.transpose()).norm() < fast);

    // Momentum form: d/dt(H q̇) = Cᵀ q̇ + τ − g. Power: d/dt(energy) = τᵀ q̇.
    let momentum_rate = m.rate(|m| m.tree.inertia_matrix(&m.kinematics()) * m.v);
    prop_assert!((momentum_rate - (c.transpose() * m.v + torque - g)).norm() < fast);
    let power = m.rate(|m| {
        let (kinetic, potential) = m.tree.energy(&m.kinematics(), &m.base);
        kinetic + potential
    });
    prop_assert!((power - torque.dot(&m.v)).abs() < fast);

    // Forward dynamics inverts inverse dynamics, and armature is inertia on the diagonal.
    let armature = SVector::from_element(0.01);
    let driven = torque + m.a.component_mul(&armature);
    let a = m
        .tree
        .forward_dynamics(&k, &m.v, &driven, &armature)
        .expect("physical bodies");
    prop_assert!(
        (a - m.a).norm() < 1e-5 * (1.0 + m.a.norm()),
        "{} {}",
        a,
        m.a
    );
    Ok(())
}

/// Derivatives against central differences of the regressors' products.
fn check_derivatives<const N: usize, const P: usize>(
    m: &Moving<N, N>,
) -> Result<(), TestCaseError> {
    const STEP: f64 = 1e-5;
    let theta = m.tree.parameters::<P>();
    let at = |base: &Transform<f64>, q: SVector<f64, N>, v: SVector<f64, N>| {
        let k = m.tree.kinematics(base, &q, &v);
        (
            m.tree.momentum_regressor::<P>(&k) * theta,
            m.tree.momentum_rate_regressor::<P>(&k) * theta,
        )
    };
    let d = m.tree.momentum_derivatives(&m.kinematics());
    let (p, r) = at(&m.base, m.q, m.v);
    let close = 1e-6 * (1.0 + p.norm() + r.norm() + d.rate_by_position.norm());
    let check = |ahead: (SVector<f64, N>, SVector<f64, N>),
                 behind: (SVector<f64, N>, SVector<f64, N>),
                 p: SVector<f64, N>,
                 r: SVector<f64, N>| {
        let (by_p, by_r) = (
            (ahead.0 - behind.0) / (2.0 * STEP),
            (ahead.1 - behind.1) / (2.0 * STEP),
        );
        prop_assert!((by_p - p).norm() < close, "{by_p} {p}");
        prop_assert!((by_r - r).norm() < close, "{by_r} {r}");
        Ok(())
    };
    for c in 0..N {
        let step = SVector::from_fn(|row, _| if row == c { STEP } else { 0.0 });
        check(
            at(&m.base, m.q + step, m.v),
            at(&m.base, m.q - step, m.v),
            d.momentum_by_position.column(c).into_owned(),
            d.rate_by_position.column(c).into_owned(),
        )?;
        check(
            at(&m.base, m.q, m.v + step),
            at(&m.base, m.q, m.v - step),
            d.momentum_by_velocity.column(c).into_owned(),
            -d.momentum_by_position.row(c).transpose(),
        )?;
    }
    for axis in 0..3 {
        let turned = |by: f64| Transform {
            rotation: m.base.rotation * Rotation3::new(Vector3::ith(axis, by)).matrix(),
            ..m.base
        };
        check(
            at(&turned(STEP), m.q, m.v),
            at(&turned(-STEP), m.q, m.v),
            SVector::zeros(),
            d.rate_by_base.column(axis).into_owned(),
        )?;
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn derivatives_of_a_pinned_leg(case in case()) {
        check_derivatives::<3, 30>(&Moving::new(go2::leg(Leg::FL), &case))?;
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn derivatives_of_the_pinned_robot(case in case()) {
        check_derivatives::<12, 120>(&Moving::new(go2::pinned(), &case))?;
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn derivatives_with_a_sliding_joint(case in case()) {
        let mut bodies = *go2::leg::<f64>(Leg::FL).bodies();
        bodies[1].joint = Joint::Prismatic(Vector3::new(0.6, 0.0, 0.8));
        check_derivatives::<3, 30>(&Moving::new(Tree::new(bodies).unwrap(), &case))?;
    }

    #[test]
    fn identities_of_a_pinned_leg(case in case()) {
        check::<3, 3, 30>(&Moving::new(go2::leg(Leg::RL), &case))?;
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn identities_of_the_pinned_robot(case in case()) {
        check::<12, 12, 120>(&Moving::new(go2::pinned(), &case))?;
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn identities_of_the_free_robot(case in case()) {
        check::<13, 18, 130>(&Moving::new(go2::free(), &case))?;
    }
}
