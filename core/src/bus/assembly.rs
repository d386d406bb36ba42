//! Motors' replies to polling cycles.
//!
//! The master polls the motors of a leg in turn; a [`Cycle`] is the replies of one turn of all and never of two. Where a
//! cycle begins is not written on the bus, and frames are lost, so time tells: with what is known of the [`Schedule`], each
//! reply says when its cycle began, and two replies belong together if these beginnings are less than half a period apart.
//! The commands are not needed: a tap may carry replies alone.
//!
//! A reply that cannot be trusted stays out, and with it its cycle. Everything left out is counted.

use super::MOTORS;
use super::encoder::{Counting, Encoder, MotorState};
use super::frame::Reply;
use super::schedule::{Learner, Schedule};

/// A reply, and when its last byte came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Heard {
    /// What the motor said.
    pub reply: Reply,
    /// When, µs.
    pub time_us: u64,
}

/// The replies of one polling cycle, by ascending id.
pub type Cycle<const M: usize = MOTORS> = [Heard; M];

/// What became of good replies that are in no [`Cycle`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AssemblyCounters {
    /// Good replies in no cycle, for any of the reasons below or because another reply of the cycle was.
    pub unused_replies: u32,
    /// Cycles in which a motor was not heard.
    pub incomplete: u32,
    /// Replies in which the motor reports a fault other than heat.
    pub motor_faults: u32,
    /// Replies in which the motor says that it is too hot.
    pub overheated: u32,
    /// Replies of a motor whose encoder is stuck.
    pub stuck: u32,
}

/// Motors that no longer count their positions from where they did, bit n for the n-th by ascending id: what was their zero is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Breaks {
    /// Positions elsewhere than their speeds have taken them: turns that were lost, or a motor that began anew.
    pub jumped: u8,
    /// Positions where those of another motor were: ids that were exchanged.
    pub exchanged: u8,
}

impl Breaks {
    const NONE: Self = Self {
        jumped: 0,
        exchanged: 0,
    };
}

/// The cycle under way.
#[derive(Clone, Debug)]
pub(super) struct Assembler<const M: usize> {
    learner: Learner<M>,
    encoders: [Encoder; M],
    cycle: Cycle<M>,
    /// Which motors have answered, bit by bit, and of which of them the answer is to be used.
    answered: u8,
    trusted: u8,
    /// When the cycle under way began, by the first of its replies.
    began_us: u64,
    counters: AssemblyCounters,
    breaks: Breaks,
    is_broken: bool,
}

/// Counts of position, rotor side, within which a motor that has jumped is where another was: what that one moves in two polling cycles.
const SAME_PLACE: u32 = 600;

/// The error code of a motor that is too hot.
const OVERHEAT: u8 = 1;

impl<const M: usize> Assembler<M> {
    /// All motors: eight at most.
    const ALL: u8 = {
        assert!(M > 0 && M <= 8);
        u8::MAX >> (8 - M)
    };

    /// Nothing heard yet.
    pub(super) const fn new() -> Self {
        const NOTHING: Heard = Heard {
            reply: Reply::ZERO,
            time_us: 0,
        };
        Self {
            learner: Learner::new(),
            encoders: [Encoder::new(); M],
            cycle: [NOTHING; M],
            answered: 0,
            trusted: 0,
            began_us: 0,
            counters: AssemblyCounters {
                unused_replies: 0,
                incomplete: 0,
                motor_faults: 0,
                overheated: 0,
                stuck: 0,
            },
            breaks: Breaks::NONE,
            is_broken: false,
        }
    }

    /// Whether a motor no longer counts from where it did, since the last [`Self::take_breaks`].
    #[inline]
    pub(super) fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// Which motors no longer count from where they did, once.
    pub(super) fn take_breaks(&mut self) -> Breaks {
        self.is_broken = false;
        core::mem::replace(&mut self.breaks, Breaks::NONE)
    }

    /// What a motor has said last, by its place among the ids.
    pub(super) fn motor(&self, motor: usize) -> Option<MotorState> {
        self.encoders.get(motor)?.state()
    }

    /// The temperature that a motor has said last, °C, by its place among the ids; zero of one that was not heard.
    pub(super) fn temperature(&self, motor: usize) -> i8 {
        self.cycle
            .get(motor)
            .map_or(0, |heard| heard.reply.temperature)
    }

    pub(super) fn counters(&self) -> AssemblyCounters {
        self.counters
    }

    pub(super) fn schedule(&self) -> &Schedule<M> {
        self.learner.schedule()
    }

    /// Counts a reply that is none.
    #[cold]
    pub(super) fn refuse(&mut self) {
        add(&mut self.counters.unused_replies, 1);
    }

    /// Counts a cycle that its receiver cannot use.
    pub(super) fn discard(&mut self) {
        add(&mut self.counters.unused_replies, M as u32);
    }

    /// The cycle that the last [`Self::push`] completed.
    pub(super) fn cycle(&self) -> &Cycle<M> {
        &self.cycle
    }

    /// Takes the next reply; whether it completes a cycle.
    pub(super) fn push(&mut self, heard: Heard) -> bool {
        let Some(motor) = self.learner.hear(heard.reply.mode.id(), heard.time_us) else {
            add(&mut self.counters.unused_replies, 1);
            return false;
        };
        let schedule = self.learner.schedule();
        let offset = schedule.offsets_us.get(motor).copied().unwrap_or_default();
        let began_us = heard.time_us.wrapping_sub(u64::from(offset));
        let motor_bit = 1 << motor;
        if self.answered != 0 {
            let apart = began_us.wrapping_sub(self.began_us) as i64;
            let elsewhere = apart.unsigned_abs() >= u64::from(schedule.period_us / 2);
            if elsewhere || self.answered & motor_bit != 0 {
                self.end();
            }
        }
        if self.answered == 0 {
            (self.began_us, self.trusted) = (began_us, 0);
        }
        self.answered |= motor_bit;
        if self.is_trusted(motor, &heard) {
            self.trusted |= motor_bit;
        }
        if let Some(place) = self.cycle.get_mut(motor) {
            *place = heard;
        }
        if self.answered != Self::ALL {
            return false;
        }
        if self.trusted != Self::ALL {
            self.end();
            return false;
        }
        self.answered = 0;
        true
    }

    /// Whether what a motor says of itself allows to believe the rest.
    fn is_trusted(&mut self, motor: usize, heard: &Heard) -> bool {
        let Some(encoder) = self.encoders.get_mut(motor) else {
            return false;
        };
        let counting = encoder.counting(&heard.reply, heard.time_us);
        let stuck = encoder.is_stuck(&heard.reply, heard.time_us);
        if counting != Counting::GoesOn {
            self.note_break(motor, heard.reply.position);
        }
        let error = heard.reply.error();
        let fault = stuck || error != 0;
        if fault {
            self.count_fault(error);
        }
        !fault
    }

    /// Takes note of a motor that no longer counts from where it did.
    #[cold]
    #[inline(never)]
    fn note_break(&mut self, motor: usize, position: i32) {
        let others = self.encoders.iter().enumerate();
        let is_other = others.filter(|(n, _)| *n != motor).any(|(_, other)| {
            let there = other.state().map(|state| state.position);
            there.is_some_and(|there| there.wrapping_sub(position).unsigned_abs() < SAME_PLACE)
        });
        let bits = match is_other {
            true => &mut self.breaks.exchanged,
            false => &mut self.breaks.jumped,
        };
        *bits |= 1 << motor;
        self.is_broken = true;
    }

    /// Counts a reply that is not to be used, for the motor's error or else for its encoder.
    #[cold]
    fn count_fault(&mut self, error: u8) {
        let counters = &mut self.counters;
        let counter = match error {
            0 => &mut counters.stuck,
            OVERHEAT => &mut counters.overheated,
            _ => &mut counters.motor_faults,
        };
        add(counter, 1);
    }

    /// Ends the cycle under way, whose replies are of no use.
    #[cold]
    fn end(&mut self) {
        add(
            &mut self.counters.incomplete,
            u32::from(self.answered != Self::ALL),
        );
        add(
            &mut self.counters.unused_replies,
            self.answered.count_ones(),
        );
        self.answered = 0;
    }
}

fn add(counter: &mut u32, n: u32) {
    *counter = counter.wrapping_add(n);
}
