//! What is known outlives the power: snapshots in flash.
//!
//! A snapshot is written in bounded steps, a few words each, while the application goes on, to one *slot* of the flash after the other. Its
//! last word says that it is whole; a slot without that word, or whose checksum is another, is none. So whenever the power fails, the
//! newest whole snapshot is the one before or this one, and never a mixture ([`slots`]).
//!
//! A leg is kept as it was before its present block of 2 s, which has not been judged yet
//! ([`DeviceFolds::settled`](crate::estimator::DeviceFolds)): those numbers stay what they are while the block lasts, so that they need no
//! copy. A leg is written within a block; if it changes meanwhile, or the host changes its settings, the snapshot begins anew.
//!
//! The flash is anything with the traits of `embedded-storage`. One that cannot erase or write at once returns an error and is asked the
//! same in the next step: the slot stays as it is meanwhile, and the application is never kept waiting.
//!
//! A log-structured store of keys and values (`sequential-storage`) would search the pages for every number that is written and
//! move items when one is full: work that grows with what is kept, in the middle of a step.

mod record;
pub(super) mod slots;
#[cfg(test)]
mod tests;

use crc::Digest;
use embedded_storage::nor_flash::NorFlash;

use super::leg::{LegData, LegLine};
use super::setup::{Progress, SetupRecord, TRIES};
use crate::Real;
use crate::go2::LEGS;
use crate::slot::Slot;
use crate::wire::{Kept, Outcome, Setup};
use record::{NUMBERS, number, set_number};
use slots::{CRC, Head, NUMBERS_PER_WORD, WORD, Word};

/// Time between two snapshots that nobody asks for, µs: with six slots that bear ten thousand erasures each, a year.
pub const SNAPSHOT_US: u64 = 600_000_000;

/// Words that a step writes at most: what a leg takes is then written within a block of 2 s even where steps are 10 ms.
const STEP_WORDS: usize = 4;

/// Words of a leg.
const LEG_WORDS: usize = NUMBERS.div_ceil(NUMBERS_PER_WORD);
/// Words between the first and the last.
const WORDS: usize = LEGS * LEG_WORDS;
/// Bytes of a snapshot.
pub(super) const SNAPSHOT_LEN: usize = (WORDS + 2) * WORD;

const _: () = assert!(SNAPSHOT_LEN <= crate::storage::SECTOR);

/// A leg whose blocks do not end within this time is one of which nothing comes, µs.
const WAIT_US: u64 = 2_500_000;

/// Times that a snapshot begins anew before it is given up.
const ATTEMPTS: u32 = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    // First, so that what has done nothing is all zeros.
    Idle,
    Erase,
    /// Write this word of the slot.
    Write(usize),
    /// What the board is set up for comes first.
    SetUp,
}

/// The snapshot under way, and what became of those before.
pub(super) struct Snapshots {
    status: Kept,
    /// What the numbers mean: hash of robot and model.
    model: u64,
    slots: u32,
    /// The newest whole snapshot's slot and number.
    newest: Slot<(u32, u32)>,
    stage: Stage,
    digest: Slot<Digest<'static, u32>>,
    /// What is to be written: [`SNAPSHOT`], [`SETUP`]. One number, for each step looks at it.
    wanted: u8,
    due_us: u64,
    tries: u32,
    attempts: u32,
    /// The settings' revision when the snapshot began.
    settings: u32,
    /// The present leg's revision when it was reached or begun, when that was, and whether it is begun.
    revision: u32,
    since_us: u64,
    begun: bool,
    /// What is kept was so often another when the last snapshot began.
    learnt: u32,
    done: u32,
    failed: u32,
    setup: SetupRecord,
}

/// Bits of what is wanted.
const SNAPSHOT: u8 = 1;
const SETUP: u8 = 2;

/// All that is kept.
pub(super) struct Source<'a, T: Real> {
    pub(super) lines: &'a [LegLine<T>; LEGS],
    pub(super) data: &'a [LegData<T>; LEGS],
    /// Another number after each change that the host has made.
    pub(super) settings: u32,
}

impl Snapshots {
    /// No storage: all zeros.
    pub(super) const fn new() -> Self {
        Self {
            status: Kept::NoStorage,
            model: 0,
            slots: 0,
            newest: Slot::Empty,
            stage: Stage::Idle,
            digest: Slot::Empty,
            wanted: 0,
            due_us: 0,
            tries: 0,
            attempts: 0,
            settings: 0,
            revision: 0,
            since_us: 0,
            begun: false,
            learnt: 0,
            done: 0,
            failed: 0,
            setup: SetupRecord::new(),
        }
    }

    /// What became of what was kept.
    pub(super) fn status(&self) -> Kept {
        self.status
    }

    /// Snapshots that were written, and that were given up.
    pub(super) fn counts(&self) -> [u32; 2] {
        [self.done, self.failed]
    }

    /// Has a snapshot begin with the next step; false if there is nowhere to keep it.
    pub(super) fn want(&mut self) -> bool {
        let has_storage = self.status != Kept::NoStorage;
        if has_storage {
            self.wanted |= SNAPSHOT;
        }
        has_storage
    }

    /// Has what the board is set up for be written, if it is another.
    pub(super) fn set_up(&mut self, setup: Setup) -> Outcome {
        let outcome = self.setup.want(setup);
        if self.setup.is_wanted() {
            self.wanted |= SETUP;
        }
        outcome
    }

    /// What the board is set up for from the next start on; `otherwise` where there is no flash.
    pub(super) fn setup(&self, otherwise: Setup) -> Setup {
        self.setup.kept(otherwise)
    }

    /// Looks for the newest whole snapshot, and has `lines`, which were reset, become what they were.
    ///
    /// Takes as long as reading all flash twice: for the start, before there are steps.
    pub(super) fn open<T: Real, F: NorFlash>(
        &mut self,
        flash: &mut F,
        setup: Setup,
        lines: &mut [LegLine<T>; LEGS],
        data: &mut [LegData<T>; LEGS],
    ) {
        self.setup.open(flash, setup);
        self.slots = slots::count(flash);
        // With one slot there would be a time without any snapshot.
        if self.slots < 2 {
            return;
        }
        self.model = slots::model(data);
        self.status = Kept::Nothing;
        for slot in 0..self.slots {
            let newer = |n: u32| {
                let newest = self.newest.get().copied();
                newest.is_none_or(|(_, newest)| n.wrapping_sub(newest) as i32 > 0)
            };
            if let Some(head) = slots::whole(flash, slot)
                && newer(head.generation)
            {
                self.newest = Slot::Full((slot, head.generation));
                self.status = match head.is_of(self.model) {
                    true => Kept::Restored,
                    false => Kept::OfAnother,
                };
            }
        }
        if let (Kept::Restored, Slot::Full((slot, _))) = (self.status, self.newest) {
            restore(flash, slot, lines, data);
        }
        self.learnt = learnt_of(data, 0);
    }

    /// Does a step of the snapshot that is due.
    pub(super) fn advance<T: Real, F: NorFlash>(
        &mut self,
        flash: &mut F,
        source: &Source<T>,
        now_us: u64,
    ) {
        if self.stage == Stage::Idle && !self.begin(source, now_us) {
            return;
        }
        for _ in 0..STEP_WORDS {
            match self.stage {
                Stage::Idle => return,
                Stage::SetUp => {
                    self.write_setup(flash);
                    return;
                }
                Stage::Erase => {
                    if self.erase(flash, source, now_us) {
                        self.start_leg(source, 0, now_us);
                    }
                    return;
                }
                Stage::Write(word) => {
                    if !self.may_write(word, source, now_us) {
                        return;
                    }
                    self.write(flash, word, source, now_us);
                }
            }
        }
    }

    /// Begins a snapshot if one is due; false if none is.
    fn begin<T: Real>(&mut self, source: &Source<T>, now_us: u64) -> bool {
        // As it nearly always is, and each step asks: the next is due within its time.
        let ahead = self.due_us.wrapping_sub(now_us);
        if self.wanted == 0 && ahead != 0 && ahead <= SNAPSHOT_US {
            return false;
        }
        // A clock may go back, and begins somewhere.
        self.due_us = self.due_us.min(now_us.saturating_add(SNAPSHOT_US));
        if self.due_us == 0 {
            self.due_us = now_us.saturating_add(SNAPSHOT_US);
        }
        if self.wanted == 0 && now_us < self.due_us {
            return false;
        }
        if self.wanted & SETUP != 0 {
            self.stage = Stage::SetUp;
            return true;
        }
        if self.status == Kept::NoStorage {
            return false;
        }
        // Flash wears: what has not changed is not written again.
        let learnt = learnt(source);
        if self.wanted == 0 && learnt == self.learnt {
            self.due_us = now_us.saturating_add(SNAPSHOT_US);
            return false;
        }
        (self.wanted, self.attempts, self.learnt) = (0, 0, learnt);
        self.start(source);
        true
    }

    /// Does a step of writing what the board is set up for.
    fn write_setup<F: NorFlash>(&mut self, flash: &mut F) {
        let progress = self.setup.advance(flash);
        if progress != Progress::Busy {
            self.wanted &= !SETUP;
            self.stage = Stage::Idle;
            self.failed = self
                .failed
                .wrapping_add((progress == Progress::GivenUp).into());
        }
    }

    fn start<T: Real>(&mut self, source: &Source<T>) {
        self.stage = Stage::Erase;
        self.settings = source.settings;
        self.tries = 0;
        self.digest = Slot::Full(CRC.digest());
    }

    /// The slot that is written, and its snapshot's number.
    fn place(&self) -> (u32, u32) {
        match self.newest {
            Slot::Full((slot, generation)) => {
                let next = slot.saturating_add(1);
                let next = if next < self.slots { next } else { 0 };
                (next, generation.wrapping_add(1))
            }
            Slot::Empty => (0, 1),
        }
    }

    fn erase<T: Real, F: NorFlash>(
        &mut self,
        flash: &mut F,
        source: &Source<T>,
        now_us: u64,
    ) -> bool {
        let (from, to) = slots::span::<F>(self.place().0);
        let done = flash.erase(from, to);
        let done = self.did(done.is_ok(), now_us);
        // Settings that change before anything is written do no harm.
        self.settings = source.settings;
        done
    }

    /// Takes note of whether the flash did what it was asked; gives up if it has refused too often.
    fn did(&mut self, done: bool, now_us: u64) -> bool {
        self.tries = if done { 0 } else { self.tries + 1 };
        if self.tries >= TRIES {
            self.end(now_us);
            self.failed = self.failed.wrapping_add(1);
        }
        done
    }

    fn end(&mut self, now_us: u64) {
        self.stage = Stage::Idle;
        self.due_us = now_us.saturating_add(SNAPSHOT_US);
    }

    /// Goes on with word `word`, and waits for the next block of the leg if that is a leg's first.
    fn start_leg<T: Real>(&mut self, source: &Source<T>, word: usize, now_us: u64) {
        self.stage = Stage::Write(word);
        self.begun = false;
        self.revision = revision(source, leg_of(word));
        self.since_us = now_us;
    }

    /// Whether a word can be written now; begins anew where the leg has changed since its first word was.
    fn may_write<T: Real>(&mut self, word: usize, source: &Source<T>, now_us: u64) -> bool {
        if self.settings != source.settings {
            return self.begin_anew(source, now_us);
        }
        // The first and the last word are of no leg.
        if word == 0 || word > WORDS {
            return true;
        }
        let leg = leg_of(word);
        let forgetting = source.lines.get(leg).is_some_and(LegLine::is_forgetting);
        let same = revision(source, leg) == self.revision;
        if self.begun {
            return same && !forgetting || self.begin_anew(source, now_us);
        }
        self.since_us = self.since_us.min(now_us);
        let fresh = !same || now_us - self.since_us >= WAIT_US;
        self.begun = fresh && !forgetting;
        self.revision = revision(source, leg);
        self.begun
    }

    /// Begins the snapshot anew, or gives it up; false.
    fn begin_anew<T: Real>(&mut self, source: &Source<T>, now_us: u64) -> bool {
        self.attempts += 1;
        if self.attempts < ATTEMPTS {
            self.start(source);
        } else {
            self.end(now_us);
            self.failed = self.failed.wrapping_add(1);
        }
        false
    }

    fn write<T: Real, F: NorFlash>(
        &mut self,
        flash: &mut F,
        word: usize,
        source: &Source<T>,
        now_us: u64,
    ) {
        let (slot, generation) = self.place();
        let Some(digest) = self.digest.get() else {
            return;
        };
        let bytes = match word {
            0 => Head::new(self.model, generation).encode(),
            n if n > WORDS => slots::last_word(generation, digest.clone().finalize()),
            n => numbers(source, n - 1),
        };
        let offset = slots::span::<F>(slot)
            .0
            .saturating_add((word * WORD) as u32);
        let written = flash.write(offset, &bytes).is_ok();
        if !self.did(written, now_us) {
            return;
        }
        if let Some(digest) = self.digest.get_mut() {
            digest.update(&bytes);
        }
        if word > WORDS {
            self.newest = Slot::Full((slot, generation));
            self.done = self.done.wrapping_add(1);
            self.end(now_us);
        } else if word.is_multiple_of(LEG_WORDS) && word > 0 {
            self.start_leg(source, word + 1, now_us);
        } else {
            self.stage = Stage::Write(word + 1);
        }
    }
}

/// The leg that a word is of.
fn leg_of(word: usize) -> usize {
    word.saturating_sub(1) / LEG_WORDS
}

/// Another number after anything that changes what is kept of a leg.
fn revision<T: Real>(source: &Source<T>, leg: usize) -> u32 {
    source
        .data
        .get(leg)
        .map_or(0, |data| data.folds().revision())
}

/// Another number after anything that changes what is kept of any leg.
fn learnt<T: Real>(source: &Source<T>) -> u32 {
    learnt_of(source.data, source.settings)
}

fn learnt_of<T: Real>(data: &[LegData<T>; LEGS], settings: u32) -> u32 {
    let legs = data.iter().map(|data| data.folds().revision());
    legs.fold(settings, u32::wrapping_add)
}

/// The numbers of a word, counted from the first leg's first.
fn numbers<T: Real>(source: &Source<T>, word: usize) -> Word {
    let (leg, first) = (word / LEG_WORDS, word % LEG_WORDS * NUMBERS_PER_WORD);
    let mut bytes = [0; WORD];
    if let (Some(line), Some(data)) = (source.lines.get(leg), source.data.get(leg)) {
        let (places, _) = bytes.as_chunks_mut();
        for (n, place) in (first..).zip(places) {
            *place = number(line, data, n).to_le_bytes();
        }
    }
    bytes
}

/// Has the legs become what a whole snapshot says.
fn restore<T: Real, F: NorFlash>(
    flash: &mut F,
    slot: u32,
    lines: &mut [LegLine<T>; LEGS],
    data: &mut [LegData<T>; LEGS],
) {
    for (leg, (line, data)) in lines.iter_mut().zip(data).enumerate() {
        for word in 0..LEG_WORDS {
            let bytes = slots::read(flash, slot, 1 + leg * LEG_WORDS + word);
            let (numbers, _) = bytes.as_chunks();
            for (n, bytes) in (word * NUMBERS_PER_WORD..).zip(numbers) {
                set_number(line, data, n, f64::from_le_bytes(*bytes));
            }
        }
        line.restored(data);
    }
}
