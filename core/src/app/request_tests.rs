//! The host's requests are done once, answered alike, and cost a step a bounded amount; factors come whole.

use std::boxed::Box;
use std::vec::Vec;

use super::tests::{DESKTOP, Whole, last_estimate, motion, play};
use super::*;
use crate::estimator::{DeviceFolds, FOLDS, LEG_INERTIAL};
use crate::factor::{Factor, packed_len};
use crate::go2::JOINTS_PER_LEG;
use crate::wire::{
    Action, Belief, BodyPrior, EffectAt, Estimate, FactorPart, Outcome, ReadFactor, Request,
};

/// An application that moves, and its clock in steps.
struct Moving {
    app: Box<Whole<f64>>,
    step: u64,
}

impl Moving {
    fn new() -> Self {
        Self {
            app: Whole::new(DESKTOP),
            step: 0,
        }
    }

    fn run(&mut self, steps: u64) -> Vec<DeviceMessage> {
        let range = self.step..self.step + steps;
        self.step = range.end;
        play(&mut self.app, range, motion)
    }

    fn ask(&mut self, id: u32, action: Action) {
        let request = Request { id, action };
        self.app.handle(&HostMessage::Request(request));
    }

    fn windows(&self) -> u32 {
        self.app.app.counters(&self.app.memory, 0).legs[0].windows
    }
}

/// The answers of `steps` steps, by id.
fn answers(app: &mut Moving, steps: u64) -> Vec<(u32, Outcome)> {
    let messages = app.run(steps);
    let answers = messages.iter().filter_map(|message| match message {
        DeviceMessage::Answer(answer) => Some((answer.id, answer.outcome)),
        _ => None,
    });
    answers.collect()
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_repeated_request_is_answered_alike_and_not_done_twice() {
    let mut app = Moving::new();
    let at = EffectAt {
        leg: 0,
        joint: 0,
        effect: 4,
    };
    for id in [5, 5, 6] {
        app.ask(id, Action::AddEffect(at));
    }
    app.ask(5, Action::AddEffect(at));
    assert_eq!(
        answers(&mut app, 20),
        [
            (5, Outcome::Accepted),
            (5, Outcome::Accepted),
            (6, Outcome::AlreadyActive),
            (5, Outcome::Accepted)
        ]
    );

    app.run(400);
    let before = app.windows();
    app.ask(9, Action::Reset);
    assert_eq!(answers(&mut app, 100), [(9, Outcome::Accepted)]);
    let windows = app.windows();
    assert!(0 < windows && windows < before, "{windows} {before}");
    app.ask(9, Action::Reset);
    assert_eq!(answers(&mut app, 5), [(9, Outcome::Accepted)]);
    assert!(app.windows() >= windows);
}

/// A host that floods is obeyed one request a step; what finds no room is answered when it is asked again.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_flood_of_requests_waits_and_none_is_done_unanswered() {
    let mut app = Moving::new();
    let at = |id: u32| EffectAt {
        leg: 0,
        joint: 0,
        effect: (id % 10) as u8,
    };
    for id in 0..500 {
        app.ask(id, Action::DropEffect(at(id)));
    }
    let first = answers(&mut app, 400);
    assert_eq!(first.len(), 144);
    for id in 140..200 {
        app.ask(id, Action::DropEffect(at(id)));
    }
    let again = answers(&mut app, 200);
    assert_eq!(again.len(), 60);
    assert_eq!(again[..4], first[140..]);
}

/// Reads a triangle as a host does, two parts of three lost; the triangle must be one that the device held at one time.
fn read(app: &mut Moving, place: ReadFactor) -> (f64, Vec<f64>) {
    let mut numbers = Vec::new();
    let mut held = Vec::new();
    for attempt in 0..200 {
        let first = numbers.len() as u16;
        app.app
            .handle(&HostMessage::ReadFactor(ReadFactor { first, ..place }));
        // The data go on growing: a part comes when nothing else is to be told.
        for _ in 0..10 {
            let factor =
                app.app.memory.0[1].factor(usize::from(place.fold), usize::from(place.joint));
            held.push(factor.packed().to_vec());
            for message in app.run(1) {
                let DeviceMessage::FactorPart(part) = message else {
                    continue;
                };
                if attempt % 3 == 2 {
                    assert_eq!((part.read.first, part.read.copy), (first, place.copy));
                    numbers.extend(&part.numbers);
                    if numbers.len() == usize::from(part.length) {
                        assert!(held.contains(&numbers), "torn: {place:?}");
                        return (part.windows, numbers);
                    }
                }
            }
        }
    }
    panic!("the factor never came");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_factor_comes_whole_though_its_data_grow_and_parts_are_lost() {
    let mut app = Moving::new();
    app.run(2_500);
    let mut folds = Box::new(DeviceFolds::<f64>::empty());
    folds.clear();
    let mut held = Vec::new();
    for (copy, (fold, joint)) in (0..FOLDS)
        .flat_map(|fold| (0..JOINTS_PER_LEG).map(move |joint| (fold, joint)))
        .enumerate()
    {
        let place = ReadFactor {
            copy: copy as u32 + 11,
            leg: 1,
            fold: fold as u8,
            joint: joint as u8,
            first: 0,
        };
        let (windows, numbers) = read(&mut app, place);
        let columns = (0..).find(|&p| packed_len(p) == numbers.len()).unwrap();
        let factor = Factor::from_packed(columns, windows, &numbers[..]).unwrap();
        folds.merge_joint(fold, joint, &factor).unwrap();
        held.push(windows);
    }
    assert!(held.iter().sum::<f64>() > 100.0, "{held:?}");
    assert_eq!(folds.joint(1, 2).rows(), held[5]);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_no_factor_or_no_copy_has_no_numbers() {
    let mut app = Moving::new();
    let place = ReadFactor {
        copy: 1,
        leg: 0,
        fold: 0,
        joint: 0,
        first: 0,
    };
    for read in [
        ReadFactor { leg: 4, ..place },
        ReadFactor { fold: 2, ..place },
        ReadFactor { joint: 3, ..place },
        ReadFactor { first: 64, ..place },
        ReadFactor {
            first: u16::MAX,
            ..place
        },
    ] {
        app.app.handle(&HostMessage::ReadFactor(read));
        let messages = app.run(10);
        let expected = DeviceMessage::FactorPart(FactorPart {
            read,
            windows: 0.0,
            length: 0,
            numbers: heapless::Vec::new(),
        });
        assert!(messages.contains(&expected), "{read:?}");
    }
}

/// Viscous friction of FR's hip, whose prior is tried.
const VISCOUS: EffectAt = EffectAt {
    leg: 0,
    joint: 0,
    effect: 0,
};

/// Value and standard deviation of that friction, and FR's, as told last of a second and a half.
fn viscous(app: &mut Moving) -> (f32, f32, Estimate) {
    let messages = app.run(750);
    let estimate = last_estimate(&messages, 0).clone();
    let place = LEG_INERTIAL;
    (estimate.values[place], estimate.std[place], estimate)
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_prior_that_the_host_sets_holds_until_a_reset() {
    let mut app = Moving::new();
    let (free, _, _) = viscous(&mut app);
    assert!((free - 0.08).abs() > 0.01, "the data say {free}");
    let belief = Belief {
        mean: 0.08,
        std: 1e-5,
    };
    app.ask(1, Action::SetEffectPrior(VISCOUS, belief));
    app.ask(1, Action::SetEffectPrior(VISCOUS, belief));
    let accepted = (1, Outcome::Accepted);
    assert_eq!(answers(&mut app, 20), [accepted, accepted]);
    let (held, std, _) = viscous(&mut app);
    assert!((held - 0.08).abs() < 1e-4 && std < 1.1e-5, "{held} {std}");
    // Dropping the effect and adding it does not take it back.
    app.ask(2, Action::DropEffect(VISCOUS));
    app.ask(3, Action::AddEffect(VISCOUS));
    assert_eq!(answers(&mut app, 20).len(), 2);
    let (held, ..) = viscous(&mut app);
    assert!((held - 0.08).abs() < 1e-4, "{held}");
    app.ask(4, Action::Reset);
    let (free, ..) = viscous(&mut app);
    assert!((free - 0.08).abs() > 0.01, "the data say {free}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_body_is_known_as_well_as_the_host_says() {
    let mut app = Moving::new();
    let (.., loose) = viscous(&mut app);
    let known = BodyPrior {
        leg: 0,
        body: 2,
        uncertainty: 1e-3,
    };
    app.ask(1, Action::SetBodyPrior(known));
    let (.., tight) = viscous(&mut app);
    let mass = 2 * crate::inertia::INERTIAL;
    let cad = leg_masses()[2] as f32;
    assert!(loose.std[mass] > 5e-3 * cad, "{}", loose.std[mass]);
    assert!(tight.std[mass] <= 1e-3 * cad * 1.001, "{}", tight.std[mass]);
    assert!((tight.values[mass] - cad).abs() < 5e-3 * cad);
    // And as little.
    let unknown = BodyPrior {
        uncertainty: 10.0,
        ..known
    };
    app.ask(2, Action::SetBodyPrior(unknown));
    let (.., vague) = viscous(&mut app);
    assert!(vague.std[mass] > loose.std[mass], "{}", vague.std[mass]);
}

fn leg_masses() -> [f64; JOINTS_PER_LEG] {
    let leg = crate::go2::leg::<f64>(Leg::FR);
    leg.bodies().map(|body| body.inertia.mass())
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_prior_that_cannot_be_is_refused_and_changes_nothing() {
    let mut app = Moving::new();
    let (before, ..) = viscous(&mut app);
    let beliefs = [
        (f32::NAN, 1.0),
        (f32::INFINITY, 1.0),
        (0.1, f32::NAN),
        (0.1, f32::INFINITY),
        (0.1, 0.0),
        (0.1, -1.0),
        // Viscous friction that drives.
        (-0.1, 1.0),
    ];
    for (id, (mean, std)) in (1..).zip(beliefs) {
        app.ask(id, Action::SetEffectPrior(VISCOUS, Belief { mean, std }));
    }
    for (id, uncertainty) in (8..).zip([f32::NAN, 0.0, -0.1, f32::INFINITY]) {
        let prior = BodyPrior {
            leg: 0,
            body: 0,
            uncertainty,
        };
        app.ask(id, Action::SetBodyPrior(prior));
    }
    let answers = answers(&mut app, 40);
    assert_eq!(answers.len(), 11);
    let refused = |(_, outcome): &(u32, Outcome)| *outcome == Outcome::OutOfRange;
    assert!(answers.iter().all(refused), "{answers:?}");
    let (after, ..) = viscous(&mut app);
    assert!((after - before).abs() < 0.05, "{before} {after}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_asked_of_no_leg_joint_or_body_is_refused() {
    let mut app = Moving::new();
    let belief = Belief {
        mean: 0.1,
        std: 0.1,
    };
    let body = |leg, body| {
        Action::SetBodyPrior(BodyPrior {
            leg,
            body,
            uncertainty: 0.1,
        })
    };
    let at = |leg, joint, effect| EffectAt { leg, joint, effect };
    let asked = [
        (
            Action::SetEffectPrior(at(4, 0, 0), belief),
            Outcome::NoSuchLeg,
        ),
        (
            Action::SetEffectPrior(at(0, 3, 0), belief),
            Outcome::NoSuchJoint,
        ),
        (
            Action::SetEffectPrior(at(0, 0, 10), belief),
            Outcome::NoSuchEffect,
        ),
        (body(4, 0), Outcome::NoSuchLeg),
        (body(0, 3), Outcome::NoSuchJoint),
        (Action::SetLegs(16), Outcome::NoSuchLeg),
        (Action::AddEffect(at(4, 0, 0)), Outcome::NoSuchLeg),
    ];
    for (id, (action, outcome)) in (1..).zip(asked) {
        app.ask(id, action);
        assert_eq!(answers(&mut app, 3), [(id, outcome)], "{action:?}");
    }
}

/// Legs that the messages' estimates and diagnoses are of.
fn spoken_of(messages: &[DeviceMessage]) -> (Vec<u8>, Vec<u8>) {
    let (mut estimates, mut diagnoses) = (Vec::new(), Vec::new());
    for message in messages {
        match message {
            DeviceMessage::Estimate(estimate) => estimates.push(estimate.leg),
            DeviceMessage::Diagnosis(diagnosis) => diagnoses.push(diagnosis.at.leg),
            _ => {}
        }
    }
    (estimates, diagnoses)
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn legs_that_are_not_listened_to_are_kept_as_they_are() {
    let mut app = Moving::new();
    app.run(3_000);
    // What waits is heard and folded in, what is under way is told.
    app.ask(1, Action::SetLegs(0b0010));
    let messages = app.run(300);
    let hello = messages.iter().find_map(|message| match message {
        DeviceMessage::Hello(hello) => Some(hello.listens_to),
        _ => None,
    });
    assert_eq!(hello, Some(0b0010));
    let counters = |app: &Moving| app.app.app.counters(&app.app.memory, 0).legs;
    let triangle = |app: &Moving| app.app.memory.0[0].factor(0, 0).packed().to_vec();
    let (before, held) = (counters(&app), triangle(&app));
    let (estimates, diagnoses) = spoken_of(&app.run(2_000));
    let after = counters(&app);
    // Four seconds, four a second.
    assert!((15..=16).contains(&estimates.len()), "{estimates:?}");
    assert!(!diagnoses.is_empty());
    assert!(estimates.iter().chain(&diagnoses).all(|leg| *leg == 1));
    for leg in [0, 2, 3] {
        assert_eq!(before[leg].samples, after[leg].samples);
        // Three replies a cycle.
        assert_eq!(
            after[leg].unheard_bytes,
            before[leg].unheard_bytes + 2_000 * 48
        );
    }
    assert_eq!(after[1].samples, before[1].samples + 2_000);
    assert_eq!(held, triangle(&app));

    app.ask(2, Action::SetLegs(0b1111));
    let (estimates, _) = spoken_of(&app.run(1_000));
    assert!((0..4).all(|leg| estimates.contains(&leg)), "{estimates:?}");
    let [fr, ..] = counters(&app);
    assert_eq!(fr.used, fr.samples);
    assert_eq!((fr.gaps, fr.late), (1, 0));
    // Nobody at all.
    app.ask(3, Action::SetLegs(0));
    app.run(300);
    assert_eq!(spoken_of(&app.run(1_000)), (Vec::new(), Vec::new()));
}
