//! The host's requests are done once, answered alike, and cost a step a bounded amount; factors come whole.

use std::boxed::Box;
use std::vec::Vec;

use super::tests::{DESKTOP, Whole, motion, play};
use super::*;
use crate::estimator::{DeviceFolds, FOLDS};
use crate::factor::{Factor, packed_len};
use crate::wire::{FactorPart, ReadFactor, Request};

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
