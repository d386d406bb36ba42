//! A robot that is put on its feet: its windows are left out, and it goes on as it was when it hangs again.

use std::vec::Vec;

use super::change_tests::{Extra, Robot};
use super::*;

fn standing(_: f64) -> Extra {
    Extra {
        ground: 37.0,
        ..Extra::default()
    }
}

fn hanging(_: f64) -> Extra {
    Extra::default()
}

fn hellos(told: &[DeviceMessage]) -> Vec<bool> {
    let hellos = told.iter().filter_map(|message| match message {
        DeviceMessage::Hello(hello) => Some(hello.carried),
        _ => None,
    });
    hellos.collect()
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_robot_that_stands_for_a_while_is_left_out() {
    let mut robot = Robot::new();
    assert!(!hellos(robot.run(20, hanging)).contains(&true));
    let before = Leg::ALL.map(|leg| (robot.counters(leg), robot.estimate(leg).clone()));
    let told = hellos(robot.run(10, standing));
    assert!(
        told.iter().filter(|carried| **carried).count() >= 9,
        "{told:?}"
    );
    for (leg, (before, _)) in Leg::ALL.into_iter().zip(&before) {
        let now = robot.counters(leg);
        // Ten seconds, and what is taken out again of the block in which it began.
        assert!((495..=610).contains(&now.carried), "{now:?}");
        assert!(now.windows <= before.windows + 18, "{now:?}");
        assert_eq!((before.carried, now.changes), (0, 0));
    }
    let told = hellos(robot.run(20, hanging));
    assert_eq!(told.last(), Some(&false));
    for (leg, (_, before)) in Leg::ALL.into_iter().zip(&before) {
        let (now, after) = (robot.counters(leg), robot.estimate(leg));
        assert_eq!(now.changes, 0);
        // Two seconds more, until it counts as hanging.
        assert!(now.carried <= 720, "{now:?}");
        let numbers = after.values.iter().zip(&before.values).zip(&before.std);
        for (k, ((after, before), std)) in numbers.enumerate() {
            assert!(
                (after - before).abs() < 4.0 * std,
                "{leg:?} {k}: {after} {before} {std}"
            );
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_robot_that_stands_from_the_first_on_gives_nothing() {
    let mut robot = Robot::new();
    robot.run(10, standing);
    for leg in Leg::ALL {
        let now = robot.counters(leg);
        assert!(now.windows <= 12, "{now:?}");
        assert!(robot.estimate(leg).windows == 0);
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn loads_friction_and_bias_of_a_hanging_robot_are_none() {
    let mut robot = Robot::new();
    robot.run(10, |_| Extra {
        bias: 3.0,
        coulomb: 3.0,
        load: 1.0,
        ..Extra::default()
    });
    assert!(Leg::ALL.iter().all(|leg| robot.counters(*leg).carried == 0));
}
