//! A leg whose zeros are unknown is counted and no more; what a host says holds until a motor says otherwise.

use std::{boxed::Box, vec, vec::Vec};

use super::tests::{DESKTOP, Whole, bytes, motion};
use super::*;
use crate::bus::Reply;
use crate::go2::ACTUATORS;
use crate::storage::{RamFlash, SECTOR};
use crate::wire::{Action, Outcome, Positions, Request, SetZero, Zero};

const STEP_US: u64 = 2000;
/// Counts of a turn of the rotor.
const TURN: i32 = 32768;

/// What makes a motor's count another than its joint's angle: from where it counts, and whether it turns against the joint.
type PowerUp = [(i32, bool); 3];

/// A robot of one leg (FR) whose motors count from elsewhere, on a device that is told nothing but what its user says.
struct Robot {
    device: Box<Whole<f64>>,
    power_up: PowerUp,
    step: u64,
    /// How far its motion is, in steps: it rests where it is.
    phase: u64,
    asked: u32,
    messages: Vec<DeviceMessage>,
}

/// A reply of a motor that counts from `zero`, and turns against its joint if it is reversed.
fn counted(reply: &Reply, (zero, reversed): (i32, bool)) -> Reply {
    let sign = if reversed { -1 } else { 1 };
    Reply {
        position: (sign * reply.position).wrapping_add(zero),
        speed: sign as i16 * reply.speed,
        torque: sign as i16 * reply.torque,
        ..*reply
    }
}

impl Robot {
    fn new(power_up: PowerUp) -> Self {
        Self {
            device: Whole::new(Identity {
                positions: Positions::FromPowerUp,
                ..DESKTOP
            }),
            power_up,
            step: 0,
            phase: 0,
            asked: 0,
            messages: Vec::new(),
        }
    }

    fn hear(&mut self, replies: &[Reply; 3]) {
        self.step += 1;
        let said = core::array::from_fn(|j| counted(&replies[j], self.power_up[j]));
        self.say(&bytes(&said, true));
    }

    fn say(&mut self, bytes: &[u8]) {
        let messages = &mut self.messages;
        let now_us = 1 + self.step * STEP_US;
        self.device.step(now_us, [bytes, &[], &[], &[]], &mut |m| {
            messages.push(m.clone())
        });
    }

    fn rest(&mut self, steps: u64) {
        let at = motion(self.phase, 0).map(|reply| Reply { speed: 0, ..reply });
        (0..steps).for_each(|_| self.hear(&at));
    }

    fn move_on(&mut self, steps: u64) {
        for _ in 0..steps {
            self.phase += 1;
            self.hear(&motion(self.phase, 0));
        }
    }

    /// A joint's angle, rad.
    fn angle(&self, joint: usize) -> f64 {
        motion(self.phase, 0)[joint].joint_position(ACTUATORS[joint].gear)
    }

    fn silence(&mut self, steps: u64) {
        for _ in 0..steps {
            self.step += 1;
            self.say(&[]);
        }
    }

    fn ask(&mut self, action: Action) -> Outcome {
        self.asked += 1;
        let id = self.asked;
        self.device
            .handle(&HostMessage::Request(Request { id, action }));
        // Two steps: what is told in a step is one message.
        self.rest(2);
        let answers = self
            .messages
            .iter()
            .rev()
            .find_map(|message| match message {
                DeviceMessage::Answer(answer) if answer.id == id => Some(answer.outcome),
                _ => None,
            });
        answers.expect("it is answered")
    }

    fn set(&mut self, joint: usize, angle: f64) -> Outcome {
        let reversed = self.power_up[joint].1;
        self.ask(Action::SetZero(SetZero {
            leg: 0,
            joint: joint as u8,
            angle: angle as f32,
            reversed,
        }))
    }

    /// Rests, and has the user say where the joints are.
    fn place(&mut self) {
        self.rest(20);
        for joint in 0..3 {
            assert_eq!(self.set(joint, self.angle(joint)), Outcome::Accepted);
        }
        // Trials have tests of their own.
        assert_eq!(self.ask(Action::TrustWiring), Outcome::Accepted);
    }

    fn zeros(&self) -> [Zero; 3] {
        self.device.app.legs[0].zeros()
    }

    /// What the last hello said of the leg.
    fn told(&self) -> [Zero; 3] {
        let hellos = self.messages.iter().rev();
        let mut zeros = hellos.filter_map(|message| match message {
            DeviceMessage::Hello(hello) => Some(hello.zeros[0]),
            _ => None,
        });
        zeros.next().unwrap()
    }

    fn counters(&self) -> crate::wire::LegCounters {
        self.device.app.counters(&self.device.memory, 0).legs[0]
    }

    fn estimates(&self) -> usize {
        let told = self.messages.iter();
        told.filter(|m| matches!(m, DeviceMessage::Estimate(_) | DeviceMessage::Diagnosis(_)))
            .count()
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_leg_that_is_nowhere_is_counted_and_no_more() {
    let mut robot = Robot::new([(0, false); 3]);
    robot.move_on(2000);
    let counters = robot.counters();
    assert!(counters.samples > 1900);
    assert_eq!(counters.unplaced, counters.samples);
    assert_eq!((counters.used, counters.windows), (0, 0));
    assert_eq!((robot.estimates(), robot.told()), (0, [Zero::Unknown; 3]));
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_robot_that_was_placed_is_identified_as_one_whose_positions_are_angles() {
    let power_up = [
        (-3 * TURN + 777, false),
        (5 * TURN - 12_345, true),
        (9_876_543, false),
    ];
    let mut robot = Robot::new(power_up);
    // Else it would be solved more often than one of four, and its changes be judged by other solutions.
    robot.ask(Action::SetLegs(1));
    robot.place();
    assert_eq!(robot.told(), [Zero::Set; 3]);
    robot.move_on(3000);
    let mut plain = Robot::new([(0, false); 3]);
    plain.ask(Action::SetLegs(1));
    plain.rest(20);
    plain.ask(Action::SetMemory(0));
    plain.ask(Action::SetMemory(0));
    plain.ask(Action::SetPositions(Positions::Absolute));
    plain.ask(Action::SetMemory(0));
    assert_eq!(plain.told(), [Zero::Absolute; 3]);
    plain.move_on(3000);
    assert!(robot.estimates() > 10);
    for (fold, joint) in (0..2).flat_map(|fold| (0..3).map(move |joint| (fold, joint))) {
        let [one, other] = [&robot, &plain].map(|r| r.device.memory.0[0].factor(fold, joint));
        assert!(one.rows() > 50.0 && one.rows() == other.rows());
        let largest = other
            .packed()
            .iter()
            .fold(0.0_f64, |most, x| most.max(x.abs()));
        for (a, b) in one.packed().iter().zip(other.packed()) {
            // A zero is known to a count: of an angle in single precision.
            assert!(
                (a.abs() - b.abs()).abs() < 1e-3 * largest,
                "{a} {b} of {largest}"
            );
        }
    }
}

#[test]
fn a_hundred_power_ups_are_known_or_unknown() {
    let mut state = 1_u64;
    let mut random = move |below: u64| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) % below
    };
    for _ in 0..100 {
        let power_up = core::array::from_fn(|_| {
            let count = random(20 * TURN as u64) as i32 - 10 * TURN;
            (count, random(2) == 1)
        });
        let mut robot = Robot::new(power_up);
        robot.rest(5);
        assert_eq!(robot.zeros(), [Zero::Unknown; 3]);
        for joint in 0..3 {
            assert_eq!(robot.set(joint, robot.angle(joint)), Outcome::Accepted);
            let (count, reversed) = robot.device.app.legs[0].zero_of(joint);
            // Of the angle's single precision.
            assert!(
                count.abs_diff(power_up[joint].0) <= 1,
                "{count} {power_up:?}"
            );
            assert_eq!(reversed, power_up[joint].1);
        }
        assert_eq!(robot.zeros(), [Zero::Set; 3]);
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let mut robot = Robot::new([(0, false); 3]);
    robot.rest(5);
    assert_eq!(robot.set(0, 0.1), Outcome::Accepted);
    assert_eq!(robot.set(0, 1.2), Outcome::OutOfRange);
    assert_eq!(robot.set(2, -0.2), Outcome::OutOfRange);
    assert_eq!(robot.set(1, f64::NAN), Outcome::OutOfRange);
    let at = |leg, joint| {
        Action::SetZero(SetZero {
            leg,
            joint,
            angle: 0.0,
            reversed: false,
        })
    };
    assert_eq!(robot.ask(at(4, 0)), Outcome::NoSuchLeg);
    assert_eq!(robot.ask(at(0, 3)), Outcome::NoSuchJoint);
    // The other legs' buses are silent.
    assert_eq!(robot.ask(at(1, 0)), Outcome::NotHeard);
    assert_eq!(robot.ask(Action::TrustZeros), Outcome::NoZero);
    robot.asked += 1;
    robot.move_on(20);
    let id = robot.asked;
    robot.device.handle(&HostMessage::Request(Request {
        id,
        action: at(0, 0),
    }));
    robot.move_on(3);
    let moves = |m: &DeviceMessage| matches!(m, DeviceMessage::Answer(a) if a.id == id && a.outcome == Outcome::Moves);
    assert!(robot.messages.iter().any(moves));
}

/// Each with what the motors do, and what is told of which joint within 10 ms of the fault.
#[test]
fn what_voids_a_zero_is_named_and_nothing_is_learnt_after_it() {
    type Change = fn(&mut Robot);
    let faults: [(&str, Change, [Zero; 3]); 5] = [
        (
            "a turn lost",
            |r| r.power_up[1].0 -= TURN,
            [Zero::Set, Zero::Jumped, Zero::Set],
        ),
        (
            "a calf begins anew",
            |r| r.power_up[2].0 -= 90_000,
            [Zero::Set, Zero::Set, Zero::Jumped],
        ),
        ("a silence", |r| r.silence(60), [Zero::Silent; 3]),
        (
            "a tenth of a turn and more",
            |r| r.power_up[0].0 += TURN / 8,
            [Zero::Jumped, Zero::Set, Zero::Set],
        ),
        (
            "a clock that is set back",
            |r| r.step -= 30,
            [Zero::Silent; 3],
        ),
    ];
    for (what, change, told) in faults {
        let mut robot = Robot::new([(4 * TURN, false), (-TURN / 3, false), (70_000, false)]);
        robot.place();
        robot.move_on(600);
        let before = robot.counters();
        assert!(before.windows > 0, "{what}");
        change(&mut robot);
        robot.move_on(5);
        assert_eq!((robot.told(), robot.zeros()), (told, told), "{what}");
        let heard = robot.messages.len();
        robot.move_on(1500);
        let after = robot.counters();
        assert!(
            after.used <= before.used + 1,
            "{what}: {before:?} {after:?}"
        );
        assert!(after.unplaced > 1400, "{what}");
        let later = &robot.messages[heard..];
        let estimates = later
            .iter()
            .filter(|m| matches!(m, DeviceMessage::Estimate(_)));
        assert_eq!(estimates.count(), 0, "{what}");
        // Told anew where it is, the leg is identified again.
        robot.place();
        robot.move_on(300);
        assert_eq!(robot.told(), [Zero::Set; 3], "{what}");
        assert!(robot.counters().used > after.used + 250, "{what}");
    }
}

#[test]
fn motors_that_exchange_their_ids_are_named() {
    let mut robot = Robot::new([(0, false); 3]);
    robot.place();
    robot.move_on(100);
    for _ in 0..5 {
        robot.step += 1;
        robot.phase += 1;
        let [hip, thigh, calf] = motion(robot.phase, 0);
        let exchanged = [
            Reply {
                mode: thigh.mode,
                ..hip
            },
            Reply {
                mode: hip.mode,
                ..thigh
            },
            calf,
        ];
        robot.say(&bytes(&exchanged, true));
    }
    let told = robot.told();
    assert!(told[..2].contains(&Zero::Exchanged), "{told:?}");
    assert!(
        !told[0].is_known() && !told[1].is_known() && told[2] == Zero::Set,
        "{told:?}"
    );
}

#[test]
fn motion_and_lost_cycles_are_no_jumps() {
    let mut robot = Robot::new([(123_456, false), (0, true), (0, false)]);
    robot.place();
    robot.move_on(50);
    for n in 1..=20 {
        robot.silence(n);
        robot.phase += n;
        robot.move_on(10);
        assert_eq!(robot.zeros(), [Zero::Set; 3], "after {n} lost cycles");
    }
}

#[test]
fn a_zero_set_anew_elsewhere_forgets_what_was_learnt() {
    let mut robot = Robot::new([(0, false); 3]);
    robot.place();
    robot.move_on(600);
    robot.rest(20);
    assert_eq!(robot.set(1, robot.angle(1)), Outcome::Accepted);
    let before = robot.device.memory.0[0].factor(0, 0).rows();
    assert!(before > 0.0);
    assert_eq!(robot.set(1, robot.angle(1) + 0.2), Outcome::Accepted);
    assert_eq!(robot.device.memory.0[0].factor(0, 0).rows(), 0.0);
}

#[test]
fn zeros_outlive_the_board_and_are_trusted_only_when_the_host_says_so() {
    let mut flash = RamFlash::new(vec![0xFF; (2 + SETUP_SECTORS) * SECTOR]);
    let mut robot = Robot::new([(4 * TURN, false), (-TURN / 3, true), (70_000, false)]);
    let Whole { app, memory } = &mut *robot.device;
    app.restore(memory, &mut flash);
    robot.place();
    let kept: [_; 3] = core::array::from_fn(|joint| robot.device.app.legs[0].zero_of(joint));
    // A zero that is set is written without being asked.
    for step in 0..20_000 {
        let now_us = (robot.step + step) * STEP_US;
        let Whole { app, memory } = &mut *robot.device;
        app.keep(memory, &mut flash, now_us);
    }
    assert_eq!(robot.device.app.snapshots.counts(), [1, 0]);
    let mut restarted = Robot::new(robot.power_up);
    let Whole { app, memory } = &mut *restarted.device;
    app.restore(memory, &mut flash);
    assert_eq!(restarted.zeros(), [Zero::Restarted; 3]);
    restarted.rest(5);
    restarted.move_on(200);
    assert_eq!(restarted.counters().used, 0);
    restarted.rest(30);
    assert_eq!(restarted.ask(Action::TrustZeros), Outcome::Accepted);
    assert_eq!(restarted.zeros(), [Zero::Set; 3]);
    for (joint, kept) in kept.iter().enumerate() {
        assert_eq!(restarted.device.app.legs[0].zero_of(joint), *kept);
    }
    // Where a motor was silent since, nothing is trusted.
    let mut silent = Robot::new(robot.power_up);
    let Whole { app, memory } = &mut *silent.device;
    app.restore(memory, &mut flash);
    silent.rest(5);
    silent.silence(60);
    silent.rest(5);
    assert_eq!(silent.ask(Action::TrustZeros), Outcome::NoZero);
    assert_eq!(silent.zeros(), [Zero::Silent; 3]);
}
