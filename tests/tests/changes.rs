//! A simulated robot that changes while it moves: real friction, real sensors, forward dynamics that share nothing with the
//! estimator. What is announced, how soon, and what is known afterwards.

use proprio_core::estimator::LEG_INERTIAL;
use proprio_core::go2::{self, Leg};
use proprio_core::wire::ChangeKind;
use proprio_tests::changing::{Listener, robot};

/// Seconds before the change.
const BEFORE: u64 = 60;

fn changed(hide: &str) -> Listener {
    let mut listener = Listener::new();
    listener.hear_change(&robot("", 1), BEFORE, &robot(hide, 1), 22);
    for change in &listener.changes {
        println!("{hide}: {change:?}");
    }
    listener
}

#[test]
fn a_load_on_a_calf_is_announced_within_five_seconds_and_weighed_within_twenty() {
    let mut unchanged = Listener::new();
    unchanged.hear_change(&robot("", 1), BEFORE, &robot("", 1), 0);
    let listener = changed("payload:RR_calf=0.5,z=-0.12");
    let [change] = listener.changes[..] else {
        panic!("{:?}", listener.changes)
    };
    assert_eq!(
        (change.leg, change.joint, change.kind),
        (2, 2, ChangeKind::Load)
    );
    assert!(change.time_us <= (BEFORE + 5) * 1_000_000);
    let now = listener.estimate(Leg::RR);
    let cad = go2::leg::<f64>(Leg::RR).parameters::<LEG_INERTIAL>();
    let (mass, std) = (f64::from(now.values[20]), f64::from(now.std[20]));
    println!("{mass} ± {std} kg, truth {}", cad[20] + 0.5);
    assert!((mass - cad[20] - 0.5).abs() < 2.0 * std, "{mass} ± {std}");
    assert!(std < 0.1, "{std}");
    for leg in [Leg::FR, Leg::FL, Leg::RL] {
        let (before, now) = (unchanged.estimate(leg), listener.estimate(leg));
        for (before, now) in before.std.iter().zip(&now.std).take(LEG_INERTIAL) {
            assert!(*now <= 1.02 * before, "{}: {now} {before}", leg.name());
        }
    }
}

#[test]
fn a_joint_that_binds_and_a_bias_that_steps_are_told_apart() {
    let listener = changed("bias:FL_thigh=1.0");
    let [change] = listener.changes[..] else {
        panic!("{:?}", listener.changes)
    };
    assert_eq!(
        (change.leg, change.joint, change.kind),
        (1, 1, ChangeKind::Bias)
    );
    let listener = changed("coulomb:RL_calf=1.3");
    let [change] = listener.changes[..] else {
        panic!("{:?}", listener.changes)
    };
    assert_eq!(
        (change.leg, change.joint, change.kind),
        (3, 2, ChangeKind::Friction)
    );
}

#[test]
fn ten_minutes_of_an_unchanged_robot_bring_no_event() {
    let mut listener = Listener::new();
    for step in robot("", 2).steps() {
        let step = step.unwrap();
        if step.time_us > 600_000_000 {
            break;
        }
        listener.hear(&step);
    }
    assert_eq!(listener.changes, []);
    let forgotten = listener.counters.legs.map(|leg| leg.forgotten);
    assert_eq!(forgotten, [0; 4], "no block is doubtful either");
}
