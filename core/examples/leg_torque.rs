//! The torque of a Go2's leg, and the same as a matrix times its inertial parameters: `cargo run -p proprio-core --example
//! leg_torque`.

use nalgebra::{SMatrix, SVector, Vector3};
use proprio_core::go2::{self, Leg};
use proprio_core::spatial::Transform;

/// Ten parameters of each of three bodies.
const PARAMETERS: usize = 30;

fn main() {
    let leg = go2::leg::<f64>(Leg::FR);
    // Position (rad), velocity (rad/s) and acceleration (rad/s²) of hip, thigh and calf.
    let q = Vector3::new(0.1, 0.8, -1.6);
    let v = Vector3::new(1.0, -2.0, 3.0);
    let a = Vector3::new(5.0, 0.0, -20.0);
    let kinematics = leg.kinematics(&Transform::identity(), &q, &v);
    let torque = leg.inverse_dynamics(&kinematics, &v, &a);
    let parameters: SVector<f64, PARAMETERS> = leg.parameters();
    let regressor: SMatrix<f64, 3, PARAMETERS> =
        leg.inverse_dynamics_regressor(&kinematics, &v, &a);
    let same = regressor * parameters;
    for (joint, (x, y)) in ["hip", "thigh", "calf"]
        .iter()
        .zip(torque.iter().zip(&same))
    {
        println!("{joint}: {x:.6} N m, by the regressor {y:.6} N m");
        assert!((x - y).abs() < 1e-12);
    }
}
