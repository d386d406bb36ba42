//! The built-in robot against the core's.

use super::*;

#[test]
fn the_go2_falls_apart_into_its_legs() {
    let robot = Robot::go2();
    let limbs = robot.limbs();
    assert_eq!(limbs.len(), 4);
    for (limb, leg) in limbs.iter().zip(Leg::ALL) {
        assert_eq!(limb.name, leg.name());
        let cad = |b: usize| (robot.bodies()[b].placement, robot.bodies()[b].inertia);
        assert_eq!(robot.limb_tree::<3>(limb, cad), Some(go2::leg(leg)));
        assert_eq!(robot.limb_tree::<4>(limb, cad), None);
    }
    assert_eq!(robot.subtree(4), 4..6);
    assert_eq!(
        robot.joint("FR_knee").unwrap_err().nearest(),
        Some("FR_calf")
    );
}
