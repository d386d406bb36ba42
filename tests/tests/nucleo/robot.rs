//! A minute of the board's time in which each leg has a fault of its robot, has its zeros set anew, and may have another fault (docs/which-leg.md,
//! docs/board.md, "Where zero is").
//!
//! | leg | first | then |
//! |---|---|---|
//! | FR | its thigh loses a turn of the rotor; some of its frames lose a byte before | its calf's velocity becomes 8 % high |
//! | FL | the ids of hip and thigh are exchanged | its calf's torque changes its sign |
//! | RR | its calf's motor restarts, and counts from where it is | its calf's position becomes 0 from one reply to the next |
//! | RL | its calf's velocity reads 8 % high, from the start | it is the leg of the other side |

use super::*;
use proprio_core::estimator::LEG_INERTIAL;
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG};
use proprio_core::window::Sample;
use proprio_core::wire;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// Cycles, and those that a leg rests while its zeros are set.
const CYCLES: u64 = 28_500;
const RESTING: u64 = 250;
/// Cycle at which the first fault begins: legs that are right are known to be by then.
const FIRST: u64 = 11_000;
/// From when on a leg rests again, once its hip is out.
const AGAIN: u64 = 13_000;
/// Cycle at which the second begins.
const SECOND: u64 = 23_500;
/// A motor that restarts is off for 0.3 s.
const OFF: u64 = 150;
/// One frame of FR in so many loses its last byte, which the next frame's first byte completes.
const CUT: usize = 97;
/// White noise of a torque, N m, as `ExactRobot` has it: without any an estimate's error is a zero's, which is set to a count.
const NOISE: f64 = 0.1;
/// How long a fault may take to be named, µs.
const NAMED_US: u64 = 10_000_000;

const fn time_us(n: u64) -> u64 {
    FIRST_US + n * motion::SAMPLE_US
}

/// How a leg moves: cycles at which it rests a second time, and samples of the motion between.
struct Course {
    begins: u64,
    again: u64,
}

impl Course {
    fn new(which: Leg) -> Self {
        let begins = motion::hip_out(which);
        let out = |n: &u64| motion::sample(which, begins + n - RESTING).q[0].abs() > 0.3;
        let again = (AGAIN..).find(out).unwrap();
        Self { begins, again }
    }

    /// The motion's sample in a cycle, and whether the leg rests there.
    fn at(&self, n: u64) -> (u64, bool) {
        let rests = n < RESTING || (self.again..self.again + RESTING).contains(&n);
        let rested = RESTING + n.saturating_sub(self.again).min(RESTING);
        (
            self.begins + n.max(RESTING).saturating_sub(rested.max(RESTING)),
            rests,
        )
    }
}

/// The buses and the host's words; `faulty`: with the faults.
fn minute(faulty: bool) -> Vec<Event> {
    let (mut events, mut sender) = (Vec::new(), Sender::default());
    let mut asked_us = Vec::new();
    for (leg, which) in (0..).zip(Leg::ALL) {
        let mut random = ChaCha8Rng::seed_from_u64(u64::from(leg));
        let mut course = Course::new(which);
        if !faulty {
            // Its zeros hold: it need not rest, with torques that are of its motion.
            course.again = 2 * CYCLES;
        }
        let other = match which {
            Leg::RL => Leg::RR,
            same => same,
        };
        // Whose leg is in the socket in a cycle.
        let whose = |n: u64| if n >= FIRST && faulty { other } else { which };
        for rest in [0, course.again].into_iter().filter(|n| *n < CYCLES) {
            let (m, _) = course.at(rest);
            let joints = motion::sample(whose(rest), m).q;
            let placed = (0..).zip(joints).map(|(joint, q)| {
                Action::SetZero(SetZero {
                    leg,
                    joint,
                    angle: q as f32,
                    reversed: false,
                })
            });
            asked_us.push((time_us(rest) + 300_000, placed.collect::<Vec<_>>()));
        }
        let calf = |n: u64| motion::sample(which, course.at(n).0).q[2];
        let [restarted, rebooted] = [FIRST, SECOND].map(calf);
        for n in 0..CYCLES {
            let (m, rests) = course.at(n);
            let mut sample = motion::sample(whose(n), m);
            if rests {
                sample.dq = [0.0; JOINTS_PER_LEG];
            }
            // At rest, where positions do not change, an encoder would be taken to be stuck.
            for tau in sample.tau.iter_mut().filter(|_| !rests) {
                let noise: f64 = random.sample(StandardNormal);
                *tau += NOISE * noise;
            }
            if faulty {
                spoil(which, n, &course, &mut sample);
                match which {
                    Leg::RR if n >= SECOND => sample.q[2] -= rebooted,
                    Leg::RR if n >= FIRST => sample.q[2] -= restarted,
                    _ => {}
                }
            }
            let bytes = cycle(which, &sample).unwrap();
            let begin_us = time_us(n) + 37 * which.index() as u64;
            let mut frames = frames(which.index(), &bytes, begin_us);
            if which == Leg::RR && faulty && (FIRST..FIRST + OFF).contains(&n) {
                frames.truncate(4);
            }
            for (k, Event(.., bytes)) in (6 * n as usize..).zip(&mut frames) {
                if which == Leg::FR && faulty && n < FIRST && k % CUT == 0 {
                    bytes.pop();
                }
            }
            events.extend(frames);
        }
    }
    asked_us.sort_by_key(|(time_us, _)| *time_us);
    for (id, (time_us, placed)) in (1..).step_by(JOINTS_PER_LEG).zip(asked_us) {
        events.push(asked(time_us, &mut sender, id, &placed));
    }
    events.sort_by_key(|event| event.0);
    events
}

/// Faults that need nothing else.
fn spoil(which: Leg, n: u64, course: &Course, sample: &mut Sample<f64, JOINTS_PER_LEG>) {
    match which {
        Leg::FR if n >= FIRST => {
            sample.q[1] -= TAU / ACTUATORS[1].gear;
            if n >= SECOND {
                sample.dq[2] *= 1.08;
            }
        }
        Leg::FL if (FIRST..course.again).contains(&n) => {
            for values in [&mut sample.q, &mut sample.dq, &mut sample.tau] {
                values.swap(0, 1);
            }
        }
        Leg::FL if n >= SECOND => sample.tau[2] = -sample.tau[2],
        Leg::RL if n < FIRST => sample.dq[2] *= 1.08,
        _ => {}
    }
}

/// What the hellos say of a leg's zeros and wiring, one after the other; of a velocity's gain not how large, which depends on when it was looked at.
fn states_of(messages: &[DeviceMessage], leg: usize) -> Vec<([Zero; 3], Wiring)> {
    let hellos = hellos_of(messages).into_iter();
    let mut states: Vec<_> = hellos
        .map(|hello| match hello.wiring[leg] {
            Wiring::Fault(wire::Fault::Velocity { joint, .. }) => {
                let per_mille = 0;
                let fault = wire::Fault::Velocity { joint, per_mille };
                (hello.zeros[leg], Wiring::Fault(fault))
            }
            wiring => (hello.zeros[leg], wiring),
        })
        .collect();
    states.dedup();
    states
}

/// Viscous and Coulomb friction, armature and bias of each joint that an estimate has, with their errors.
fn effects_of(estimate: &Estimate) -> Vec<[f64; 2]> {
    let numbers = estimate.values.iter().zip(&estimate.std);
    let effects = numbers.skip(LEG_INERTIAL);
    effects
        .map(|(x, std)| [x, std].map(|x| f64::from(*x)))
        .collect()
}

/// The same of the simulated legs.
fn truth() -> Vec<f64> {
    let joints = motion::FRICTION.iter().zip(&ACTUATORS);
    joints
        .flat_map(|([viscous, coulomb, bias], actuator)| {
            [*viscous, *coulomb, actuator.armature(), *bias]
        })
        .collect()
}

/// Checks that what is told of a leg without a fault is true within its errors, and that after zeros were set anew a leg's estimates are those of a robot
/// without faults, until its second fault.
fn tell_what_is_true(messages: &[DeviceMessage], clean: &[DeviceMessage]) {
    let right = ([Zero::Set; 3], Wiring::Right);
    // Of each effect at each joint: how often it is told, and how often it is more than three of its errors off: while nothing is wrong, and while a
    // fault is not named yet. By effect: how far at most; and from a robot without faults; in standard deviations.
    let (mut told, mut off) = ([0; 2], [0; 2]);
    let (mut worst, mut apart) = ([[0.0_f64; 4]; 2], [0.0_f64; 4]);
    for leg in 0..3 {
        let states = states_of(messages, leg);
        let times = states.iter().filter(|state| **state == right).count();
        assert_eq!(times, 2, "{states:?}");
        let again = Course::new(Leg::ALL[leg]).again;
        for estimate in estimates_of(messages, leg as u8) {
            let faults = [FIRST..again, SECOND..CYCLES];
            let has_fault = faults.map(|cycles| {
                (time_us(cycles.start)..time_us(cycles.end)).contains(&estimate.time_us)
            });
            let fault = usize::from(has_fault.contains(&true));
            for (n, ([value, std], truth)) in
                effects_of(estimate).into_iter().zip(truth()).enumerate()
            {
                let by = (value - truth).abs() / std;
                worst[fault][n % 4] = worst[fault][n % 4].max(by);
                told[fault] += 1;
                off[fault] += u32::from(by > 3.0);
            }
        }
        let before = |messages: &[DeviceMessage]| {
            let told = estimates_of(messages, leg as u8);
            effects_of(told.filter(|e| e.time_us < time_us(SECOND)).last().unwrap())
        };
        let pairs = before(messages).into_iter().zip(before(clean));
        for (n, ([value, std], [clean, other])) in pairs.enumerate() {
            apart[n % 4] = apart[n % 4].max((value - clean).abs() / std.hypot(other));
        }
    }
    println!(
        "{off:?} of {told:?} numbers off by more than three of their errors, while nothing is wrong and before a fault is named; viscous, coulomb, armature, bias by {worst:.2?} at most, {apart:.2?} from a robot without faults"
    );
    // What is told between a fault and its name may have data of it: of a block of time whose end has not judged it yet.
    assert!(100 * off[0] <= told[0], "{off:?} of {told:?}");
    assert!(apart.iter().all(|off| *off < 3.0), "{apart:?}");
    // One that never was right has none.
    assert_eq!(estimates_of(messages, 3).count(), 0);
}

/// Whether a leg's state is that of its fault.
type IsNamed = fn(&[Zero; 3], &Wiring) -> bool;

/// Whether a calf's velocity is said to read 8 % high.
fn is_velocity(_: &[Zero; 3], wiring: &Wiring) -> bool {
    matches!(wiring, Wiring::Fault(wire::Fault::Velocity { joint: 2, per_mille }) if (75..=85).contains(per_mille))
}

/// Each fault: its leg, its first cycle, and what is said of it. RL's first is there from the start, and its second from when its zeros are set.
fn faults() -> [(usize, u64, IsNamed); 8] {
    let rl = Course::new(Leg::RL).again;
    [
        (0, FIRST, |zeros, _| zeros[1] == Zero::Jumped),
        (1, FIRST, |zeros, _| zeros[..2] == [Zero::Exchanged; 2]),
        (2, FIRST, |zeros, _| zeros[2] == Zero::Silent),
        (3, RESTING, is_velocity),
        (0, SECOND, is_velocity),
        (1, SECOND, |_, wiring| {
            *wiring == Wiring::Fault(wire::Fault::TorqueSign { joint: 2 })
        }),
        (2, SECOND, |zeros, _| zeros[2] == Zero::Jumped),
        (3, rl, |_, wiring| {
            *wiring == Wiring::Fault(wire::Fault::OtherSide)
        }),
    ]
}

/// The board names each fault within ten seconds, says what the application in this process does, and tells what is true within its errors; after the zeros
/// were set anew its estimates are those of a robot without faults.
#[test]
fn a_minute_of_the_nucleos_image_names_the_faults_of_four_legs() {
    let events = minute(true);
    let end_us = events.last().unwrap().0 + 1_000_000;
    let plain = in_process(&events, 30_000, end_us);
    for leg in 0..4 {
        println!("leg {leg}: {:?}", states_of(&plain, leg));
    }
    let clean = in_process(&minute(false), 30_000, end_us);
    tell_what_is_true(&plain, &clean);
    let Some(run) = Run::new(end_us as f64 * 1e-6, &events, &[]) else {
        return;
    };
    let said = || run.times_us.iter().zip(&run.messages);
    let hellos = || {
        said().filter_map(|(at_us, message)| match message {
            DeviceMessage::Hello(hello) => Some((*at_us, hello)),
            _ => None,
        })
    };
    for (n, (leg, begins, is_named)) in faults().into_iter().enumerate() {
        let begin_us = time_us(begins);
        let named = hellos().find(|(at_us, hello)| {
            *at_us >= begin_us && is_named(&hello.zeros[leg], &hello.wiring[leg])
        });
        let (at_us, _) = named.unwrap_or_else(|| panic!("fault {n} is not named"));
        let after_us = at_us - begin_us;
        println!(
            "fault {n} of leg {leg}: named after {:.2} s",
            after_us as f64 * 1e-6
        );
        assert!(after_us <= NAMED_US, "fault {n}");
    }
    for leg in 0..4 {
        assert_eq!(
            states_of(&run.messages, leg),
            states_of(&plain, leg),
            "leg {leg}"
        );
    }
    tell_what_is_true(&run.messages, &clean);
    let counters = run.counters();
    assert_eq!(counters.load.over_budget, 0);
    assert_eq!(counters.frames_dropped, 0);
    println!("{:?}", counters.load);
}
