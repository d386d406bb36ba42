//! Motions of hung legs whose torques obey the model exactly, for what has to be recovered from them.

use nalgebra::{Matrix3, SVector, Vector3};
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG, Leg, leg};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use proprio_core::window::Sample;

/// Viscous (N m s/rad) and Coulomb (N m) friction and bias (N m) of hip, thigh and calf.
pub const FRICTION: [[f64; 3]; JOINTS_PER_LEG] =
    [[0.03, 0.15, -0.13], [0.04, 0.12, 0.09], [0.03, 1.2, -0.11]];
/// Time between samples, µs.
pub const SAMPLE_US: u64 = 2_000;

/// The n-th sample of a leg: the CAD's rigid body, the rotors' inertia and [`FRICTION`]. Each joint swings with two
/// incommensurate frequencies; the legs differ in phase.
pub fn sample(which: Leg, n: u64) -> Sample<f64, JOINTS_PER_LEG> {
    sample_of(&leg::<f64>(which), which, n)
}

/// [`sample`] of a leg with these bodies.
pub fn sample_of(
    tree: &Tree<f64, JOINTS_PER_LEG, JOINTS_PER_LEG>,
    which: Leg,
    n: u64,
) -> Sample<f64, JOINTS_PER_LEG> {
    let t = (n * SAMPLE_US) as f64 * 1e-6;
    let (mut q, mut v, mut a) = (SVector::zeros(), SVector::zeros(), SVector::zeros());
    for j in 0..JOINTS_PER_LEG {
        q[j] = [0.0, 0.8, -1.7][j];
        for (amplitude, rate) in [(0.3, [5.1, 7.3, 9.7][j]), (0.12, [17.9, 15.1, 20.3][j])] {
            let (sin, cos) = (rate * t + which.index() as f64 + j as f64).sin_cos();
            q[j] += amplitude * sin;
            v[j] += amplitude * rate * cos;
            a[j] -= amplitude * rate * rate * sin;
        }
    }
    let kinematics = tree.kinematics(&Transform::identity(), &q, &v);
    let mut tau = tree.inverse_dynamics(&kinematics, &v, &a);
    for j in 0..JOINTS_PER_LEG {
        let [viscous, coulomb, bias] = FRICTION[j];
        tau[j] += viscous * v[j] + coulomb * v[j].signum() + bias + ACTUATORS[j].armature() * a[j];
    }
    Sample {
        time_us: n * SAMPLE_US,
        q: q.into(),
        dq: v.into(),
        tau: tau.into(),
    }
}

/// The first sample at which a leg's hip is out, where its zero is to be set (docs/which-leg.md): at a hip's 0 the leg of the other side is the same as
/// a hip that counts the other way.
pub fn hip_out(which: Leg) -> u64 {
    // Of swings of 0.42 rad; within 4 s each hip has been there.
    const OUT: f64 = 0.3;
    let out = |n: &u64| sample(which, *n).q[0].abs() > OUT;
    (0..2_000).find(out).unwrap_or_default()
}

/// The n-th sample of a leg that cannot be: friction drives its joints, and its calf is pulled up by more than it weighs.
pub fn impossible(which: Leg, n: u64) -> Sample<f64, JOINTS_PER_LEG> {
    let leg = leg::<f64>(which);
    let mut bodies = leg.bodies().map(|body| body.inertia);
    let below = Vector3::new(0.02, 0.0, -0.12);
    bodies[JOINTS_PER_LEG - 1] =
        bodies[JOINTS_PER_LEG - 1] + InertialParameters::from_com(-0.6, below, Matrix3::zeros());
    let mut sample = sample_of(&leg.with_inertia(&bodies), which, n);
    for (tau, (dq, [_, coulomb, _])) in sample.tau.iter_mut().zip(sample.dq.iter().zip(FRICTION)) {
        *tau -= 1.5 * coulomb * dq.signum();
    }
    sample
}
