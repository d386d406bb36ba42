//! A Go2's bodies and velocity coordinates, six of the base before those of the joints, and how the equations of these are scaled.

use proprio_core::go2::{JOINTS, JOINTS_PER_LEG};

/// Bodies, the base first.
pub(crate) const BODIES: usize = JOINTS + 1;
/// Velocity coordinates.
pub(crate) const COORDINATES: usize = JOINTS + 6;
/// The coordinate of the first joint.
pub(super) const FIRST_JOINT: usize = COORDINATES - JOINTS;

/// A number for each coordinate's equation.
pub(crate) type Equations = [f64; COORDINATES];

/// What the equations are multiplied by, so that their noise is alike: moments on the base (1), forces on it (m), joints' torques (1).
pub(crate) const SCALE: [f64; COORDINATES] = {
    let mut scale = [1.0; COORDINATES];
    let mut c = 0;
    while c < 6 {
        scale[c] = if c < 3 { 0.3 } else { 0.06 };
        c += 1;
    }
    scale
};

/// What equations are multiplied by: nothing where a joint may rest.
pub(super) fn scale(resting: &[bool; JOINTS]) -> Equations {
    std::array::from_fn(|c| match c.checked_sub(FIRST_JOINT) {
        Some(joint) if resting[joint] => 0.0,
        _ => SCALE[c],
    })
}

/// Whether the joint has one that carries it in its leg.
pub(crate) fn is_carried(joint: usize) -> bool {
    !joint.is_multiple_of(JOINTS_PER_LEG)
}
