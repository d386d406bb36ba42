//! One leg's bus: bytes with times in, polling cycles out.

use super::MOTORS;
use super::assembly::{Assembler, AssemblyCounters, Breaks, Cycle, Heard};
use super::decoder::{Decoder, DecoderCounters, Frame};
use super::encoder::MotorState;
use super::frame::Reply;
use super::queue::Queue;
use super::schedule::Schedule;

/// What listens to one leg's bus of `M` motors, eight at most. It assumes nothing that the frames do not say: seeds, ids, order and period of polling
/// are learnt from them.
#[derive(Clone, Debug)]
pub struct Listener<const M: usize = MOTORS> {
    decoder: Decoder,
    assembler: Assembler<M>,
}

impl<const M: usize> Default for Listener<M> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const M: usize> Listener<M> {
    /// A listener that has heard nothing.
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            assembler: Assembler::new(),
        }
    }

    /// Takes bytes off `queue` until they complete a cycle; `None` where they do not, or where nothing is left of `effort`
    /// ([`Decoder::next`]): then the rest waits in the queue.
    pub fn next(&mut self, queue: &mut Queue, effort: &mut usize) -> Option<&Cycle<M>> {
        loop {
            let waiting = queue.waiting();
            let mut bytes = waiting;
            // Commands are passed over: replies alone say what was polled, and when.
            let reply = loop {
                match self.decoder.next(&mut bytes, effort) {
                    Some(Frame::Reply(reply)) => break Some(reply),
                    Some(Frame::Command(_)) => {}
                    None => break None,
                }
            };
            let taken = waiting.len() - bytes.len();
            queue.take(taken);
            let (reply, time_us) = (reply?, queue.taken_us());
            // A reply that lacked its end, and the begin of what came after it: its checksum fits by chance.
            if queue.spans_pause(Reply::LEN as u32) {
                self.assembler.refuse();
                continue;
            }
            if self.assembler.push(Heard { reply, time_us }) {
                return Some(self.assembler.cycle());
            }
        }
    }

    /// Counts a cycle that its receiver cannot use: its replies are in no sample.
    pub fn discard(&mut self) {
        self.assembler.discard();
    }

    /// Whether a motor no longer counts its position from where it did, since the last [`Self::take_breaks`].
    #[inline]
    pub fn is_broken(&self) -> bool {
        self.assembler.is_broken()
    }

    /// Which motors no longer count their positions from where they did, told once.
    pub fn take_breaks(&mut self) -> Breaks {
        self.assembler.take_breaks()
    }

    /// What a motor has said last, by its place among the ids; nothing of one that was not heard.
    pub fn motor(&self, motor: usize) -> Option<MotorState> {
        self.assembler.motor(motor)
    }

    /// The temperature that a motor has said last, °C, by its place among the ids; zero of one that was not heard. At
    /// [`Reply::TOP_TEMPERATURE`] it is none.
    pub fn temperature(&self, motor: usize) -> i8 {
        self.assembler.temperature(motor)
    }

    /// What is known of the polling.
    pub fn schedule(&self) -> &Schedule<M> {
        self.assembler.schedule()
    }

    /// The frames and their seeds.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Frames and bytes.
    pub fn frames(&self) -> DecoderCounters {
        self.decoder.counters()
    }

    /// Replies and cycles.
    pub fn cycles(&self) -> AssemblyCounters {
        self.assembler.counters()
    }
}
