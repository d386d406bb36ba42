//! Data of what cannot be: what is told could be all the same, and how long it takes.

use std::vec::Vec;

use super::change_tests::{Extra, Robot};
use super::*;
use crate::consistent::body;
use crate::estimator::LEG_INERTIAL;
use crate::go2::JOINTS_PER_LEG;
use crate::wire::{Action, EffectAt, Estimate};

/// A thigh whose joint is driven by its friction, a calf that is pulled up by more than it weighs, from the first sample on.
fn impossible(_: f64) -> Extra {
    Extra {
        coulomb: -0.3,
        load: -0.6,
        ..Extra::default()
    }
}

fn estimates(messages: &[DeviceMessage]) -> impl Iterator<Item = &Estimate> {
    messages.iter().filter_map(|message| match message {
        DeviceMessage::Estimate(estimate) => Some(estimate),
        _ => None,
    })
}

/// Whether each body of an estimate could exist, and each effect but the biases is not below zero.
fn could_be(estimate: &Estimate) -> bool {
    let values: Vec<f64> = estimate.values.iter().map(|&x| f64::from(x)).collect();
    let mut effects = values[LEG_INERTIAL..].iter().enumerate();
    (0..JOINTS_PER_LEG).all(|b| body(&values, b).is_physical())
        && effects.all(|(n, value)| n % 4 == 3 || *value >= 0.0)
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_told_could_be_whatever_the_data() {
    let mut robot = Robot::new();
    let told = robot.run(30, impossible).to_vec();
    for estimate in estimates(&told) {
        assert!(could_be(estimate), "{estimate:?}");
        let shape = (estimate.values.len(), estimate.std.len());
        assert_eq!(shape, (42, 42));
        assert!(estimate.std.iter().all(|std| *std > 0.0 && std.is_finite()));
    }
    let last = |leg| robot.estimate(leg);
    assert_eq!(last(Leg::FR).solution, Solution::Free);
    for leg in [Leg::RL, Leg::RR] {
        assert_eq!(last(leg).solution, Solution::Consistent);
        assert_eq!(robot.counters(leg).unsolved, 0);
    }
    // The friction that would be negative is held at zero: thigh of RL, coulomb.
    let (value, std) = robot.effect(Leg::RL, 1, 1);
    assert!(value == 0.0 && std < 0.1, "{value} {std}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_others_and_the_diagnosis_go_on_meanwhile() {
    let mut robot = Robot::new();
    robot.run(20, impossible);
    let told = robot.run(20, impossible).to_vec();
    let of = |leg: Leg| {
        let own = estimates(&told).filter(|e| usize::from(e.leg) == leg.index());
        own.count()
    };
    // A second each where all can be; two that cannot take a second more.
    assert!(
        Leg::ALL.iter().all(|leg| of(*leg) >= 9),
        "{:?}",
        Leg::ALL.map(of)
    );
    let verdicts = told
        .iter()
        .filter(|m| matches!(m, DeviceMessage::Diagnosis(_)));
    assert!(verdicts.count() > 100);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_the_host_sets_meanwhile_voids_it() {
    let mut robot = Robot::new();
    robot.run(10, impossible);
    // Another model at every turn of the legs' solutions.
    for n in 0..40 {
        let at = EffectAt {
            leg: 2,
            joint: 1,
            effect: 5,
        };
        let action = match n % 2 {
            0 => Action::AddEffect(at),
            _ => Action::DropEffect(at),
        };
        robot.ask(n, action);
        robot.run_steps(41 + u64::from(n), impossible);
    }
    let told = robot.run(10, impossible).to_vec();
    assert!(estimates(&told).all(|e| could_be(e) && e.values.len() == 42));
    assert_eq!(robot.counters(Leg::RL).unsolved, 0);
}
