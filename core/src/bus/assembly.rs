//! Motors' replies to polling cycles.
//!
//! The master polls the motors of a leg in turn; a [`Cycle`] is the replies of one turn of all and never of two. Where a
//! cycle begins is not written on the bus, and frames are lost, so time tells: with what is known of the [`Schedule`], each
//! reply says when its cycle began, and two replies belong together if these beginnings are less than half a period apart.
//! The commands are not needed: a tap may carry replies alone.
//!
//! A reply that cannot be trusted stays out, and with it its cycle. Everything left out is counted.

use super::MOTORS;
use super::encoder::Encoder;
use super::frame::Reply;
use super::schedule::{Learner, Schedule};

/// A reply, and when its last byte came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// What the motor said.
    pub reply: Reply,
    /// When, µs.
    pub time_us: u64,
}

/// The replies of one polling cycle, by ascending id: hip, thigh, calf.
pub type Cycle = [Heard; MOTORS];

/// What became of good replies that are in no [`Cycle`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

/// The cycle under way.
#[derive(Clone, Debug)]
pub(super) struct Assembler {
    learner: Learner,
    encoders: [Encoder; MOTORS],
    turns: [Turn; MOTORS],
    /// When the cycle under way began, by the first of its replies.
    began_us: u64,
    counters: AssemblyCounters,
}

/// One motor's turn.
#[derive(Clone, Copy, Debug)]
enum Turn {
    Silent,
    /// It answered, and the answer is not to be used.
    Excluded,
    Answered(Heard),
}

/// The error code of a motor that is too hot.
const OVERHEAT: u8 = 1;

impl Assembler {
    /// Nothing heard yet.
    pub(super) const fn new() -> Self {
        Self {
            learner: Learner::new(),
            encoders: [Encoder::new(); MOTORS],
            turns: [Turn::Silent; MOTORS],
            began_us: 0,
            counters: AssemblyCounters {
                unused_replies: 0,
                incomplete: 0,
                motor_faults: 0,
                overheated: 0,
                stuck: 0,
            },
        }
    }

    pub(super) fn counters(&self) -> AssemblyCounters {
        self.counters
    }

    pub(super) fn schedule(&self) -> &Schedule {
        self.learner.schedule()
    }

    /// Counts a cycle that its receiver cannot use.
    pub(super) fn discard(&mut self) {
        add(&mut self.counters.unused_replies, MOTORS as u32);
    }

    /// Takes the next reply; gives the cycle that it completes.
    pub(super) fn push(&mut self, heard: Heard) -> Option<Cycle> {
        let Some(motor) = self.learner.hear(heard.reply.mode.id(), heard.time_us) else {
            add(&mut self.counters.unused_replies, 1);
            return None;
        };
        let schedule = self.learner.schedule();
        let offset = schedule.offsets_us.get(motor).copied().unwrap_or_default();
        let began_us = heard.time_us.wrapping_sub(u64::from(offset));
        let apart = began_us.wrapping_sub(self.began_us) as i64;
        let elsewhere = apart.unsigned_abs() >= u64::from(schedule.period_us / 2);
        let again = !matches!(self.turns.get(motor), Some(Turn::Silent));
        if elsewhere || again {
            self.end();
            self.began_us = began_us;
        }
        let turn = match self.trusted(motor, &heard) {
            true => Turn::Answered(heard),
            false => Turn::Excluded,
        };
        if let Some(place) = self.turns.get_mut(motor) {
            *place = turn;
        }
        if self.turns.iter().any(|turn| matches!(turn, Turn::Silent)) {
            return None;
        }
        if let [
            Turn::Answered(hip),
            Turn::Answered(thigh),
            Turn::Answered(calf),
        ] = self.turns
        {
            self.turns = [Turn::Silent; MOTORS];
            return Some([hip, thigh, calf]);
        }
        self.end();
        None
    }

    /// Whether what a motor says of itself allows to believe the rest.
    fn trusted(&mut self, motor: usize, heard: &Heard) -> bool {
        let encoder = self.encoders.get_mut(motor);
        let stuck = encoder.is_some_and(|encoder| encoder.is_stuck(heard));
        let counters = &mut self.counters;
        match heard.reply.error() {
            0 if !stuck => return true,
            0 => add(&mut counters.stuck, 1),
            OVERHEAT => add(&mut counters.overheated, 1),
            _ => add(&mut counters.motor_faults, 1),
        }
        false
    }

    /// Ends the cycle under way, whose replies are of no use.
    fn end(&mut self) {
        let count =
            |wanted: fn(&Turn) -> bool| self.turns.iter().filter(|turn| wanted(turn)).count();
        let silent = count(|turn| matches!(turn, Turn::Silent));
        if silent == MOTORS {
            return;
        }
        add(&mut self.counters.incomplete, u32::from(silent > 0));
        add(&mut self.counters.unused_replies, (MOTORS - silent) as u32);
        self.turns = [Turn::Silent; MOTORS];
    }
}

fn add(counter: &mut u32, n: u32) {
    *counter = counter.wrapping_add(n);
}
