//! The core's contact projector against Pinocchio's Jacobians and numpy's pseudo-inverse (`tests/oracle/contact.py`): no foot to four,
//! straight knees too, and the equations of motion that are left without the feet's forces.

use std::path::Path;

use nalgebra::{Quaternion, SVector, UnitQuaternion, Vector3};
use proprio_core::contact::Projector;
use proprio_core::go2;
use proprio_core::spatial::Transform;

/// Numbers of a record: quaternion, q, v, a, loaded, torque, lower triangle.
const LENGTH: usize = 4 + 12 + 18 + 18 + 4 + 18 + 171;

fn records() -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/contact.f64");
    let bytes = std::fs::read(path).unwrap();
    let numbers: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
        .collect();
    assert!(numbers.len().is_multiple_of(LENGTH) && numbers.len() >= 40 * LENGTH);
    numbers.chunks_exact(LENGTH).map(<[f64]>::to_vec).collect()
}

#[test]
fn the_projector_is_pinocchios() {
    let tree = go2::free::<f64>();
    let (mut worst, mut feet_seen) = ([0.0f64; 2], [0; 5]);
    for record in records() {
        let (turn, rest) = record.split_at(4);
        let (joints, rest) = rest.split_at(12);
        let (v, rest) = rest.split_at(18);
        let (a, rest) = rest.split_at(18);
        let (on, rest) = rest.split_at(4);
        let (without_contact, lower) = rest.split_at(18);
        let quaternion = Quaternion::new(turn[0], turn[1], turn[2], turn[3]);
        let rotation = UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix();
        let base = Transform {
            rotation: *rotation.matrix(),
            translation: Vector3::zeros(),
        };
        let q = SVector::from_fn(|k, _| if k < 6 { 0.0 } else { joints[k - 6] });
        let (v, a) = (SVector::from_column_slice(v), SVector::from_column_slice(a));
        let loaded: [bool; 4] = std::array::from_fn(|f| on[f] == 1.0);
        let k = tree.kinematics(&base, &q, &v);
        let down = base.rotation.tr_mul(&-Vector3::z());
        let mut projector = Projector::<f64, 18, 12>::new();
        projector.update(
            &tree,
            &k.placements,
            &go2::feet(),
            loaded,
            &down,
            &[1.0; 18],
        );
        let feet = loaded.iter().filter(|x| **x).count();
        assert_eq!(projector.rank(), 3 * feet);
        feet_seen[feet] += 1;
        for c in 0..18 {
            let column = projector.apply(&SVector::from_fn(|r, _| f64::from(u8::from(r == c))));
            for r in c..18 {
                worst[0] = worst[0].max((column[r] - lower[r * (r + 1) / 2 + c]).abs());
            }
        }
        // What motion needs, less what the feet are given: what is left of the difference is nothing.
        let needed = tree.inverse_dynamics_regressor::<130>(&k, &v, &a) * tree.parameters::<130>();
        let left =
            projector.apply(&(needed - SVector::<f64, 18>::from_column_slice(without_contact)));
        worst[1] = worst[1].max(left.amax() / needed.amax());
    }
    println!(
        "projector off by {:.1e}, what is left of the feet's forces {:.1e} of the torque; states with 0 to 4 feet: {feet_seen:?}",
        worst[0], worst[1]
    );
    assert!(feet_seen.iter().all(|n| *n > 0));
    assert!(worst[0] < 1e-9 && worst[1] < 1e-10, "{worst:?}");
}
