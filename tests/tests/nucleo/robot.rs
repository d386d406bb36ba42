//! A minute of the board's time, in which each leg has a fault of its robot.

use super::*;
use proprio_core::go2::ACTUATORS;
use proprio_core::wire;

/// What the hellos say of a leg's zeros and wiring, one after the other.
fn states_of(messages: &[DeviceMessage], leg: usize) -> Vec<([Zero; 3], Wiring)> {
    let mut states: Vec<_> = hellos_of(messages)
        .iter()
        .map(|hello| (hello.zeros[leg], hello.wiring[leg]))
        .collect();
    states.dedup();
    states
}

/// The buses of a minute: legs that rest while their zeros are set, then move, each with a fault of its own.
fn a_minute(events: &mut Vec<Event>) {
    const CYCLES: u64 = 30_000;
    const RESTING: u64 = 250;
    // All legs are known to be right by then.
    const FAULT: u64 = 15_000;
    // The calf's motor is off for 0.3 s.
    const OFF: u64 = 150;
    // One frame of FR in so many loses its last byte, which the next frame's first byte completes.
    const CUT: usize = 97;
    let mut sender = Sender::default();
    let mut placed = Vec::new();
    for (leg, which) in (0..).zip(Leg::ALL) {
        let begins = motion::hip_out(which);
        let rest = motion::sample(which, begins);
        placed.extend((0..).zip(rest.q).map(|(joint, q)| {
            let angle = q as f32;
            Action::SetZero(SetZero {
                leg,
                joint,
                angle,
                reversed: false,
            })
        }));
        for n in 0..CYCLES {
            let mut sample = motion::sample(which, begins + n.saturating_sub(RESTING));
            if n < RESTING {
                sample.dq = [0.0; 3];
            }
            let faulty = n >= FAULT;
            match which {
                // The thigh loses a turn of its rotor.
                Leg::FR if faulty => sample.q[1] -= std::f64::consts::TAU / ACTUATORS[1].gear,
                // The motors of hip and thigh answer in each other's place.
                Leg::FL if faulty => {
                    for values in [&mut sample.q, &mut sample.dq, &mut sample.tau] {
                        values.swap(0, 1);
                    }
                }
                // The calf's motor restarts, and counts from where it is.
                Leg::RR if faulty => {
                    sample.q[2] -= motion::sample(which, begins + FAULT - RESTING).q[2]
                }
                // The thigh's motor turns against its joint.
                Leg::RL => {
                    sample.q[1] = 2.0 * rest.q[1] - sample.q[1];
                    sample.dq[1] = -sample.dq[1];
                    sample.tau[1] = -sample.tau[1];
                }
                _ => {}
            }
            let bytes = cycle(which, &sample).unwrap();
            let begin_us = FIRST_US + n * motion::SAMPLE_US + 37 * which.index() as u64;
            let mut frames = frames(which.index(), &bytes, begin_us);
            if which == Leg::RR && (FAULT..FAULT + OFF).contains(&n) {
                frames.truncate(4);
            }
            for (k, Event(.., bytes)) in (6 * n as usize..).zip(&mut frames) {
                if which == Leg::FR && !faulty && k % CUT == 0 {
                    bytes.pop();
                }
            }
            events.extend(frames);
        }
    }
    events.push(asked(FIRST_US + 300_000, &mut sender, 1, &placed));
    events.sort_by_key(|event| event.0);
}

/// A minute of the board's time, in which each leg has a fault of its robot: the board names what the application in this process does.
#[test]
fn a_minute_of_the_nucleos_image_names_the_faults_of_four_legs() {
    let mut events = Vec::new();
    a_minute(&mut events);
    let end_us = events.last().unwrap().0 + 1_000_000;
    let Some(run) = Run::new(end_us as f64 * 1e-6, &events, &[]) else {
        return;
    };
    let plain = in_process(&events, 30_000, end_us);
    let right = ([Zero::Set; 3], Wiring::Right);
    for messages in [&run.messages, &plain] {
        let [fr, fl, rr, rl] = [0, 1, 2, 3].map(|leg| states_of(messages, leg));
        for (leg, zero) in [
            (&fr, Zero::Jumped),
            (&fl, Zero::Exchanged),
            (&rr, Zero::Silent),
        ] {
            assert!(leg.contains(&right), "{leg:?}");
            assert!(leg.last().unwrap().0.contains(&zero), "{leg:?}");
        }
        let reversed = Wiring::Fault(wire::Fault::Reversed { joint: 1 });
        assert_eq!(rl.last(), Some(&([Zero::Set; 3], reversed)), "{rl:?}");
        // A leg's estimates end with its fault; one that never was right has none.
        assert_eq!(estimates_of(messages, 3).count(), 0);
    }
    for leg in 0..4 {
        assert_eq!(
            states_of(&run.messages, leg),
            states_of(&plain, leg),
            "leg {leg}"
        );
    }
    let counters = run.counters();
    assert_eq!(counters.load.over_budget, 0);
    assert_eq!(counters.frames_dropped, 0);
    println!("{:?}", counters.load);
}
