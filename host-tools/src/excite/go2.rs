//! The Go2's shapes, as capsules: what a leg must stay clear of.
//!
//! Figures from the collision shapes of its URDF (unitree_ros `go2_description`): trunk a box of 0.376 × 0.094 × 0.114 m, the
//! head a cylinder of radius 0.05 m, a hip's motor one of radius 0.046 m, thigh 0.0245 × 0.034 m thick, calf of radius up to
//! 0.0155 m beside a leg's axis by up to 0.02 m, foot a ball of radius 0.022 m.

use nalgebra::Vector3;
use proprio_core::go2::{FOOT, Leg};

use super::clearance::{Capsule, Clearance, Plane};

/// Hip, thigh and calf as bodies of a leg.
const BODIES: [usize; 3] = [0, 1, 2];
/// Where the planes between front and rear and between left and right lie, m from the robot's middle: two legs that keep to
/// their own quarter cannot meet. A leg that moves alone may go beyond the middle, for the others hang beside it: thighs 0.14 m
/// from the middle, and 0.19 m from it lengthwise.
const QUARTER: f64 = 0.005;
const ALONE: [f64; 2] = [-0.05, -0.06];

/// What `leg` must stay clear of, `alone` or while other legs move; `ground` is the height of the base's origin above the
/// floor, m, if there is one below.
pub(super) fn clearance(leg: Leg, alone: bool, ground: Option<f64>) -> Clearance {
    let [lengthwise, sideways] = if alone { ALONE } else { [QUARTER; 2] };
    let front = if matches!(leg, Leg::FR | Leg::FL) {
        1.0
    } else {
        -1.0
    };
    let left = if matches!(leg, Leg::FL | Leg::RL) {
        1.0
    } else {
        -1.0
    };
    let v = Vector3::new;
    let capsule = |name: &str, body, ends, radius| Capsule {
        name: name.to_owned(),
        body,
        ends,
        radius,
    };
    let [hip, thigh, calf] = BODIES.map(Some);
    let foot = Vector3::from(FOOT);
    let capsules = vec![
        // Around the box's cross-section: √(0.047² + 0.057²).
        capsule(
            "trunk",
            None,
            [v(-0.188, 0.0, 0.0), v(0.188, 0.0, 0.0)],
            0.074,
        ),
        capsule(
            "head",
            None,
            [v(0.285, 0.0, 0.055), v(0.293, 0.0, -0.06)],
            0.05,
        ),
        capsule(
            "hip",
            hip,
            [v(0.0, 0.06 * left, 0.0), v(0.0, 0.1 * left, 0.0)],
            0.046,
        ),
        capsule(
            "thigh",
            thigh,
            [v(0.0, 0.0, -0.03), v(0.0, 0.0, -0.213)],
            0.025,
        ),
        capsule(
            "calf",
            calf,
            [v(0.0, 0.0, -0.02), v(0.01, 0.0, -0.15)],
            0.027,
        ),
        capsule(
            "foot",
            calf,
            [v(0.015, 0.0, -0.15), foot + v(-0.002, 0.0, 0.0)],
            0.022,
        ),
    ];
    let plane = |name: &str, normal, offset| Plane {
        name: name.to_owned(),
        normal,
        offset,
    };
    let mut planes = vec![
        (
            plane(
                "the middle between front and rear",
                v(front, 0.0, 0.0),
                lengthwise,
            ),
            vec![3, 5],
        ),
        (
            plane(
                "the middle between left and right",
                v(0.0, left, 0.0),
                sideways,
            ),
            vec![3, 5],
        ),
    ];
    if let Some(height) = ground {
        planes.push((plane("the ground", v(0.0, 0.0, 1.0), -height), vec![3, 5]));
    }
    Clearance {
        capsules,
        pairs: vec![
            [0, 3],
            [0, 4],
            [0, 5],
            [1, 3],
            [1, 4],
            [1, 5],
            [2, 4],
            [2, 5],
        ],
        planes,
    }
}
