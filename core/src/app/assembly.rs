//! Three motors' replies to one sample.
//!
//! The master polls the motors of a leg in turn; a sample is the three replies of one cycle and never of two. Where a cycle
//! begins is not written on the bus. A new one has begun when
//!
//! - motor 0 is asked, or answers while a later one's reply waits: it is polled first;
//! - a motor is asked, or answers, for the second time: its first turn belongs to the cycle before;
//! - the cycle under way is older than a cycle can be.
//!
//! The commands are a help and not needed: a tap may carry replies alone. An incomplete cycle is discarded and counted.

use crate::bus::{Frame, Reply};
use crate::go2::JOINTS_PER_LEG;

/// The replies of the cycle under way.
#[derive(Clone, Debug)]
pub(super) struct Assembler {
    turns: [Turn; JOINTS_PER_LEG],
    /// Time of the step in which the cycle began.
    since_us: u64,
    unused: u32,
}

/// What was heard of one motor's turn.
#[derive(Clone, Copy, Debug)]
struct Turn {
    asked: bool,
    reply: Option<Reply>,
}

impl Turn {
    const SILENT: Self = Self {
        asked: false,
        reply: None,
    };
}

impl Assembler {
    /// Nothing heard yet.
    pub(super) const fn new() -> Self {
        Self {
            turns: [Turn::SILENT; JOINTS_PER_LEG],
            since_us: 0,
            unused: 0,
        }
    }

    /// Replies that became part of no sample.
    pub(super) fn unused(&self) -> u32 {
        self.unused
    }

    /// Counts `replies` as part of no sample.
    pub(super) fn discard(&mut self, replies: u32) {
        self.unused = self.unused.wrapping_add(replies);
    }

    /// Takes the next good frame; gives the replies of hip, thigh and calf that it completes.
    pub(super) fn push(
        &mut self,
        frame: &Frame,
        now_us: u64,
        cycle_us: u64,
    ) -> Option<[Reply; JOINTS_PER_LEG]> {
        let motor = match frame {
            Frame::Command(command) => usize::from(command.mode.id()),
            Frame::Reply(reply) => usize::from(reply.mode.id()),
        };
        let Some(turn) = self.turns.get(motor) else {
            self.discard(u32::from(matches!(frame, Frame::Reply(_))));
            return None;
        };
        let stale = now_us.saturating_sub(self.since_us) > cycle_us;
        let again = match frame {
            Frame::Command(_) => motor == 0 || turn.asked || turn.reply.is_some(),
            Frame::Reply(_) => (motor == 0 && !turn.asked) || turn.reply.is_some(),
        };
        let out_of_turn = motor == 0 && self.turns.iter().any(|turn| turn.reply.is_some());
        if stale || again || out_of_turn {
            self.begin(now_us);
        }
        let turn = self.turns.get_mut(motor)?;
        match frame {
            Frame::Command(_) => turn.asked = true,
            Frame::Reply(reply) => turn.reply = Some(*reply),
        }
        let [Some(hip), Some(thigh), Some(calf)] = self.turns.each_ref().map(|turn| turn.reply)
        else {
            return None;
        };
        self.turns = [Turn::SILENT; JOINTS_PER_LEG];
        Some([hip, thigh, calf])
    }

    /// Begins a cycle.
    fn begin(&mut self, now_us: u64) {
        let waiting = self
            .turns
            .iter()
            .filter(|turn| turn.reply.is_some())
            .count();
        self.discard(waiting as u32);
        self.turns = [Turn::SILENT; JOINTS_PER_LEG];
        self.since_us = now_us;
    }
}
