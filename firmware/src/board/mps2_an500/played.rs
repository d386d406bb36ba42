//! The board as a listener: the host decides what time it is, for arrival times through a socket mean nothing.
//!
//! For each [`Advance`] the board takes as many bytes from its buses as the host says it sent, does one step at the time
//! the host gives, and answers. Bytes wait in the host's sockets until they are taken, so none is lost. Any other message leads to a step as well, at
//! the time of the one before, except the IMU's, which is for the next step.

use core::future::ready;
use core::pin::pin;
use core::task::{Context, Waker};

use super::{Flash, Mps2An500};
use crate::application::Application;
use crate::board::Board;
use crate::listener;
use proprio_core::app::setup_in;
use proprio_core::wire::{
    Advance, Advanced, Clock, DeviceMessage, HostMessage, LEGS, Positions, Reset, Setup,
};
use static_cell::ConstStaticCell;

/// Bytes of one bus that one step takes; a longer stretch is several steps at the same time.
const BUS_BUFFER: usize = 1024;

/// What the buses bring.
type Buffers = [[u8; BUS_BUFFER]; LEGS];
static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new([[0; BUS_BUFFER]; LEGS]);

/// What is due.
#[derive(Clone, Copy, PartialEq)]
enum Due {
    /// Nothing until the host says so.
    Nothing,
    /// A step.
    Step,
    /// Steps of what is left of an [`Advance`], and its answer.
    Advance([u32; LEGS]),
}

/// The board, and where its host's time is.
struct Played {
    board: Mps2An500,
    buffers: &'static mut Buffers,
    budget: u32,
    setup: Setup,
    due: Due,
    /// Bytes in the buffers.
    lengths: [u32; LEGS],
    /// Time of the last step.
    time_us: u64,
}

/// Runs an application for good; a step that costs more than `budget` instructions is counted.
pub fn run(app: impl Application, budget: u32) -> ! {
    let Some(mut board) = Mps2An500::take() else {
        panic!("the board is taken once")
    };
    // The Go2's own IMU, whose readings come over the link.
    let setup = setup_in(&mut board.flash, Setup::GO2);
    let board = Played {
        board,
        setup,
        buffers: BUFFERS.take(),
        budget,
        due: Due::Step,
        lengths: [0; LEGS],
        time_us: 0,
    };
    let mut listening = pin!(listener::run(board, app));
    // Whatever waits on this board sleeps in its own place: there is no other task, and nobody to wake this one.
    let mut context = Context::from_waker(Waker::noop());
    loop {
        let _ = listening.as_mut().poll(&mut context);
    }
}

impl Played {
    /// Waits until each bus has brought as many bytes as are to be taken.
    fn fill(&mut self) {
        let mut filled = [0; LEGS];
        let mut idle = false;
        while filled != self.lengths {
            let before = filled;
            for leg in 0..LEGS {
                while filled[leg] < self.lengths[leg]
                    && let Some(byte) = self.board.buses[leg].read()
                {
                    self.buffers[leg][filled[leg] as usize] = byte;
                    filled[leg] += 1;
                }
            }
            match (filled == before, idle) {
                (false, _) => idle = false,
                (true, false) => {
                    self.board.clear();
                    idle = true;
                }
                (true, true) => {
                    self.board.sleep();
                    idle = false;
                }
            }
        }
    }
}

impl Board for Played {
    const NAME: &'static str = "mps2-an500";
    const LOAD_UNIT: &'static str = "instructions";
    // What its host plays is a log's or a simulator's.
    const POSITIONS: Positions = Positions::Absolute;

    type Flash = Flash;

    fn budget(&self) -> u32 {
        self.budget
    }

    fn reset(&self, crashed: bool) -> Reset {
        // The emulator's reset begins with the power.
        match crashed {
            true => Reset::Software,
            false => Reset::Power,
        }
    }

    fn clock(&self) -> Clock {
        Clock::Unknown
    }

    fn setup(&self) -> Setup {
        self.setup
    }

    fn byte_ns(&self) -> u32 {
        0
    }

    fn wait(&mut self) -> impl Future<Output = ()> {
        ready(())
    }

    fn read_host<'a>(&mut self, buffer: &'a mut [u8]) -> &'a [u8] {
        let Some((place, _)) = buffer.split_first_mut() else {
            return &[];
        };
        while self.due == Due::Nothing {
            if let Some(byte) = self.board.host.read() {
                *place = byte;
                return core::slice::from_ref(place);
            }
        }
        if let Due::Advance(left) = &mut self.due {
            self.lengths = left.map(|bytes| bytes.min(BUS_BUFFER as u32));
            for (left, length) in left.iter_mut().zip(self.lengths) {
                *left -= length;
            }
            self.fill();
        }
        &[]
    }

    fn heard(&mut self, message: &HostMessage) {
        match *message {
            HostMessage::Advance(Advance { time_us, bytes }) => {
                self.time_us = time_us;
                self.due = Due::Advance(bytes);
            }
            HostMessage::Imu(_) => {}
            _ => self.due = Due::Step,
        }
    }

    fn now_us(&self) -> u64 {
        self.time_us
    }

    fn hear(&mut self, mut take: impl FnMut(usize, &[u8], u64)) {
        let lengths = self.lengths.iter();
        for (leg, (buffer, &length)) in self.buffers.iter().zip(lengths).enumerate() {
            take(leg, &buffer[..length as usize], self.time_us);
        }
    }

    fn flash(&mut self) -> &mut Flash {
        &mut self.board.flash
    }

    fn send(&mut self, frame: &[u8]) {
        self.board.host.write(frame);
    }

    fn answer(&mut self) -> Option<DeviceMessage> {
        const DONE: Due = Due::Advance([0; LEGS]);
        self.lengths = [0; LEGS];
        let done = self.due == DONE;
        if done || self.due == Due::Step {
            self.due = Due::Nothing;
        }
        let time_us = self.time_us;
        done.then_some(DeviceMessage::Advanced(Advanced { time_us }))
    }

    fn begin_cost(&self) -> u32 {
        self.board.counter.begin()
    }

    fn cost_since(&self, begin: u32) -> u32 {
        self.board.counter.since(begin)
    }
}
