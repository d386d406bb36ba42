//! What is kept comes back, whole, wherever the power fails.

use std::boxed::Box;
use std::collections::BTreeSet;
use std::vec;
use std::vec::Vec;

use super::super::setup::SETUP_SECTORS;
use super::super::tests::{DESKTOP, Whole, last_estimate, motion, play};
use super::super::{App, Memory};
use super::*;
use crate::estimator::{DeviceFolds, LEG_INERTIAL};
use crate::storage::{RamFlash, SECTOR};
use crate::wire::{
    Action, Belief, DeviceMessage, EffectAt, HostMessage, Outcome, Positions, Request,
};
use embedded_storage::nor_flash::{ErrorType, ReadNorFlash};

const STEP_US: u64 = 2_000;
/// More steps than it takes to see that a leg rests, and to write all four.
const LONG: u64 = 8_000;

type Flash = RamFlash<Vec<u8>>;

/// Flash with room for so many snapshots.
fn erased(slots: usize) -> Flash {
    RamFlash::new(vec![0xFF; (slots + SETUP_SECTORS) * SECTOR])
}

/// A device with flash, and its clock in steps.
struct Keeping<F> {
    device: Box<Whole<f64>>,
    flash: F,
    step: u64,
    asked: u32,
}

impl<F: NorFlash> Keeping<F> {
    /// A device that starts with what is in `flash`.
    fn start(mut flash: F) -> Self {
        let mut device = Whole::new(DESKTOP);
        let Whole { app, memory } = &mut *device;
        app.restore(memory, &mut flash);
        Self {
            device,
            flash,
            step: 0,
            asked: 0,
        }
    }

    fn run(&mut self, steps: u64) -> Vec<DeviceMessage> {
        let mut messages = Vec::new();
        for _ in 0..steps {
            let step = self.step..self.step + 1;
            messages.extend(play(&mut self.device, step, motion));
            self.keep();
        }
        messages
    }

    /// A step in which nothing comes.
    fn keep(&mut self) {
        self.step += 1;
        let Whole { app, memory } = &mut *self.device;
        app.keep(memory, &mut self.flash, self.step * STEP_US);
    }

    fn rest(&mut self, steps: u64) {
        for _ in 0..steps {
            self.device
                .step(1 + self.step * STEP_US, [&[]; LEGS], &mut |_| ());
            self.keep();
        }
    }

    fn ask(&mut self, action: Action) {
        self.asked += 1;
        let id = self.asked;
        self.device
            .handle(&HostMessage::Request(Request { id, action }));
    }

    /// Snapshots written and given up.
    fn counts(&self) -> [u32; 2] {
        self.device.app.snapshots.counts()
    }

    fn status(&self) -> Kept {
        self.device.app.snapshots.status()
    }

    /// All that a snapshot of the present moment has.
    fn numbers(&self) -> Vec<u64> {
        let lines = self.device.app.legs.iter().zip(&self.device.memory.0);
        let numbers = lines
            .flat_map(|(line, data)| (0..NUMBERS).map(move |n| number(line, data, n).to_bits()));
        numbers.collect()
    }
}

const VISCOUS: EffectAt = EffectAt {
    leg: 2,
    joint: 1,
    effect: 0,
};
const STRIBECK: EffectAt = EffectAt {
    leg: 3,
    joint: 2,
    effect: 5,
};

/// A device that has heard a moving robot, been told this and that, and kept it.
fn kept() -> Keeping<Flash> {
    let mut device = Keeping::start(erased(4));
    assert_eq!(device.status(), Kept::Nothing);
    device.ask(Action::AddEffect(STRIBECK));
    device.ask(Action::SetMemory(600));
    let belief = Belief {
        mean: 0.04,
        std: 0.01,
    };
    device.ask(Action::SetEffectPrior(VISCOUS, belief));
    device.run(3_000);
    device.ask(Action::Keep);
    device.rest(LONG);
    assert_eq!(device.counts(), [1, 0]);
    device
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_kept_comes_back_and_goes_on() {
    let mut before = kept();
    let mut after = Keeping::start(before.flash.clone());
    assert_eq!(after.status(), Kept::Restored);
    assert!(after.numbers() == before.numbers());
    let told = after.run(2_500);
    let hello = told.iter().find_map(|message| match message {
        DeviceMessage::Hello(hello) => Some(hello.kept),
        _ => None,
    });
    assert_eq!(hello, Some(Kept::Restored));
    let (old, new) = (before.run(1_000), last_estimate(&told, 3).clone());
    let old = last_estimate(&old, 3);
    assert_eq!(old.effects, new.effects);
    // The block that was not judged yet is not kept; as many windows came since.
    assert!(new.windows > 350, "{}", new.windows);
    let place = LEG_INERTIAL + 4;
    let told = last_estimate(&told, 2);
    assert!(
        (told.values[place] - 0.04).abs() < 0.05,
        "{}",
        told.values[place]
    );
}

/// Wherever the power fails while a snapshot is written, what comes back is the one before or this one.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_power_cut_at_any_byte_leaves_the_old_or_the_new() {
    let mut device = kept();
    let old = Keeping::start(device.flash.clone()).numbers();
    device.run(2_000);
    device.rest(1_500);
    // What rests is the same at all times, so that each cut is of the same snapshot.
    device.rest(LONG);
    let new = device.numbers();
    assert!(old != new);
    let bytes = device.flash.clone().into_inner();
    let all = (SECTOR + SNAPSHOT_LEN) as u64;
    let edges = SECTOR as u64;
    // Every byte of the first words and the last, and of all others one in 53, which is prime to the words' length.
    let near = |n: u64| n.abs_diff(edges) < 96 || n + 96 > all || n < 96;
    let cuts = (0..=all + 1).filter(|n| near(*n) || n % 53 == 0);
    let mut started = Keeping::start(erased(2));
    let (mut olds, mut news) = (0, 0);
    for cut in cuts {
        let mut flash = RamFlash::new(bytes.clone());
        flash.fail_after(cut);
        let (newest, number) = match device.device.app.snapshots.newest {
            Slot::Full(newest) => newest,
            Slot::Empty => panic!("there is one"),
        };
        device.flash = flash;
        device.ask(Action::Keep);
        device.rest(1);
        let counts = device.counts();
        for n in 0..600 {
            let Whole { app, memory } = &mut *device.device;
            // A leg that rests is waited for once.
            app.keep(
                memory,
                &mut device.flash,
                device.step * STEP_US + n * 3_000_000,
            );
        }
        let whole = device.counts()[0] > counts[0];
        assert_eq!(whole, cut >= all, "{cut}");
        // The device of the next cut knows nothing of this one.
        let snapshots = &mut device.device.app.snapshots;
        snapshots.newest = Slot::Full((newest, number));
        snapshots.stage = Stage::Idle;

        let power = core::mem::replace(&mut device.flash, erased(2)).into_inner();
        started.flash = RamFlash::new(power);
        let Whole { app, memory } = &mut *started.device;
        app.reset(memory);
        app.snapshots = Snapshots::new();
        app.restore(memory, &mut started.flash);
        assert_eq!(started.status(), Kept::Restored, "{cut}");
        let numbers = started.numbers();
        assert!(numbers == if whole { &new[..] } else { &old[..] }, "{cut}");
        *if whole { &mut news } else { &mut olds } += 1;
    }
    assert!(olds > 2_000 && news >= 2, "{olds} {news}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_a_cut_has_left_is_written_over() {
    let device = kept();
    let old = device.numbers();
    for cut in [0, 1, SECTOR / 2, SECTOR + 5, SECTOR + SNAPSHOT_LEN - 1] {
        let mut cut_off = Keeping::start(device.flash.clone());
        cut_off.flash.fail_after(cut as u64);
        cut_off.ask(Action::Keep);
        cut_off.rest(LONG);
        let mut again = Keeping::start(RamFlash::new(cut_off.flash.into_inner()));
        assert_eq!(again.status(), Kept::Restored);
        assert!(again.numbers() == old);
        again.run(1_500);
        again.ask(Action::Keep);
        again.rest(LONG);
        assert_eq!(again.counts(), [1, 0]);
        let numbers = again.numbers();
        assert!(numbers != old);
        assert!(Keeping::start(again.flash).numbers() == numbers);
    }
}

/// Of a robot that moves, each leg is kept as it was at one time.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_leg_is_of_one_time_though_its_data_grow() {
    let mut device = Keeping::start(erased(2));
    device.run(2_100);
    let mut held = BTreeSet::new();
    device.ask(Action::Keep);
    for _ in 0..30 {
        device.run(200);
        let settled = device.device.memory.0.each_ref();
        held.extend(settled.map(|data| triangles(data.folds())));
        if device.counts()[0] > 0 {
            break;
        }
    }
    assert_eq!(device.counts(), [1, 0]);
    let after = Keeping::start(device.flash);
    for data in &after.device.memory.0 {
        assert!(data.folds().windows() > 150.0);
        assert!(held.contains(&triangles(data.folds())), "of no one time");
    }
}

fn triangles(folds: &DeviceFolds<f64>) -> Vec<u64> {
    let numbers = (0..DeviceFolds::<f64>::SETTLED).filter_map(|n| folds.settled(n));
    numbers.map(f64::to_bits).collect()
}

/// What the host sets while a snapshot is written is in all of it, or not at all.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn settings_are_of_one_time() {
    let mut device = Keeping::start(erased(2));
    device.run(1_000);
    device.ask(Action::Keep);
    device.rest(1_000);
    while !matches!(device.device.app.snapshots.stage, Stage::Write(word) if word > LEG_WORDS) {
        device.rest(1);
    }
    device.ask(Action::SetMemory(60));
    device.rest(2 * LONG);
    assert_eq!(device.counts(), [1, 0]);
    let after = Keeping::start(device.flash);
    let memories = after.device.app.legs.each_ref().map(LegLine::memory_s);
    assert_eq!(memories, [60; LEGS]);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_reset_is_kept_too() {
    let mut device = kept();
    device.ask(Action::Reset);
    device.rest(LONG);
    assert_eq!(device.counts(), [2, 0]);
    let after = Keeping::start(device.flash);
    assert_eq!(after.status(), Kept::Restored);
    assert!(
        after
            .device
            .memory
            .0
            .iter()
            .all(|data| data.folds().windows() == 0.0)
    );
    let anew = Keeping::start(erased(2));
    for (after, anew) in after.device.memory.0.iter().zip(&anew.device.memory.0) {
        assert!(triangles(after.folds()) == triangles(anew.folds()));
    }
    for (after, anew) in after.device.app.legs.iter().zip(&anew.device.app.legs) {
        assert_eq!(after.active(), anew.active());
        assert_eq!(after.beliefs(), anew.beliefs());
        assert_eq!(after.memory_s(), 0);
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_of_another_robot_or_schema_is_left() {
    let device = kept();
    let Some(head) = slots::whole(&mut device.flash.clone(), 0) else {
        panic!("it is whole")
    };
    for byte in [8, 16] {
        let mut bytes = device.flash.clone().into_inner();
        bytes[byte] ^= 1;
        // With a good checksum.
        let end = SNAPSHOT_LEN - WORD;
        let last = slots::last_word(head.generation, CRC.checksum(&bytes[..end]));
        bytes[end..SNAPSHOT_LEN].copy_from_slice(&last);
        let after = Keeping::start(RamFlash::new(bytes));
        assert_eq!(after.status(), Kept::OfAnother);
        assert!(after.numbers() == Keeping::start(erased(2)).numbers());
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn slots_take_turns_and_the_newest_whole_one_counts() {
    let mut device = kept();
    for n in 2..=6 {
        device.run(1_200);
        device.ask(Action::Keep);
        device.rest(LONG);
        assert_eq!(device.counts(), [n, 0]);
    }
    // Six in four slots: the second has the sixth.
    let newest = device.numbers();
    let bytes = device.flash.into_inner();
    assert!(Keeping::start(RamFlash::new(bytes.clone())).numbers() == newest);
    // Any byte of it that is another one makes it none.
    for place in [0, 9, 20, 24, WORD, SNAPSHOT_LEN / 2, SNAPSHOT_LEN - 1] {
        let mut bytes = bytes.clone();
        bytes[SECTOR + place] ^= 0x10;
        let after = Keeping::start(RamFlash::new(bytes));
        assert_eq!(after.status(), Kept::Restored);
        assert!(after.numbers() != newest, "{place}");
        let number = after.device.app.snapshots.newest.get().copied();
        assert_eq!(number, Some((0, 5)), "{place}");
    }
}

/// Flash wears: a bus that is silent, or of which nothing is learnt, is a reason for no snapshot, however long the power is on, and no more is a
/// start.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn nothing_is_written_where_nothing_was_learnt() {
    // So many periods of snapshots: a day.
    const DAY: u64 = 144;
    let silent = |device: &mut Keeping<Flash>| {
        let (bytes, written) = (device.flash.clone().into_inner(), device.counts());
        for _ in 0..DAY {
            device.step += SNAPSHOT_US / STEP_US;
            // More than the steps in which a snapshot would begin, and erase.
            device.rest(10);
        }
        assert_eq!(device.counts(), written);
        assert!(device.flash.clone().into_inner() == bytes);
    };
    silent(&mut Keeping::start(erased(4)));
    let mut device = kept();
    silent(&mut device);
    // What was learnt since is written once.
    device.run(1_200);
    device.step += SNAPSHOT_US / STEP_US;
    device.rest(LONG);
    assert_eq!(device.counts(), [2, 0]);
    silent(&mut device);
    let mut again = Keeping::start(device.flash);
    assert_eq!(again.status(), Kept::Restored);
    silent(&mut again);
    // What a host asks that changes nothing of what is kept.
    let beyond = EffectAt { leg: 9, ..VISCOUS };
    for action in [
        Action::SetPositions(Positions::Absolute),
        Action::SetLegs(0b0101),
        Action::SetLegs(0b1111),
        Action::DropEffect(beyond),
        Action::AddEffect(STRIBECK),
        Action::TrustZeros,
    ] {
        again.ask(action);
        again.rest(10);
    }
    silent(&mut again);
    // Motors that are polled, of which it is unknown from where they count: that is kept once.
    again.ask(Action::SetPositions(Positions::FromPowerUp));
    again.rest(LONG);
    assert_eq!(again.counts(), [1, 0]);
    for _ in 0..5 {
        again.step += SNAPSHOT_US / STEP_US;
        again.run(1_000);
        assert_eq!(again.counts(), [1, 0]);
    }
    let counters = again.device.app.counters(&again.device.memory, 0);
    assert!(counters.legs.iter().all(|leg| leg.unplaced > 4_000));
}

/// Flash that refuses most of what it is asked, or all.
struct Busy {
    flash: Flash,
    asked: u32,
    every: u32,
}

impl ErrorType for Busy {
    type Error = <Flash as ErrorType>::Error;
}

impl ReadNorFlash for Busy {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl Busy {
    fn turn(&mut self) -> Result<(), <Flash as ErrorType>::Error> {
        self.asked += 1;
        match self.asked.is_multiple_of(self.every) {
            true => Ok(()),
            false => Err(crate::storage::RamFlashError::NoPower),
        }
    }
}

impl NorFlash for Busy {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.turn()?;
        self.flash.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.turn()?;
        self.flash.write(offset, bytes)
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_flash_that_is_busy_is_asked_again_and_one_that_refuses_is_given_up() {
    for (every, counts) in [(3, [1, 0]), (u32::MAX, [0, 1])] {
        let mut device = Keeping::start(Busy {
            flash: erased(2),
            asked: 0,
            every,
        });
        device.run(1_500);
        device.ask(Action::Keep);
        device.rest(2 * LONG);
        assert_eq!(device.counts(), counts);
        let after = Keeping::start(device.flash.flash.clone());
        if counts[0] > 0 {
            assert!(after.numbers() == device.numbers());
        }
        // Listening went on.
        assert!(device.device.memory.0[0].folds().windows() > 100.0);
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn without_flash_there_is_nothing_to_ask_for() {
    let mut app = Box::new(App::<f64>::new(DESKTOP));
    let mut memory = Box::new(Memory::new());
    // One slot would be no snapshot at all while it is written.
    app.restore(&mut memory, &mut erased(1));
    let (id, action) = (1, Action::Keep);
    app.handle(&mut memory, &HostMessage::Request(Request { id, action }));
    let mut outcomes = Vec::new();
    for n in 0..10 {
        app.step(&mut memory, n * STEP_US, &mut |message| {
            if let DeviceMessage::Answer(answer) = message {
                outcomes.push(answer.outcome);
            }
        });
    }
    assert_eq!(outcomes, [Outcome::NoStorage]);
}
