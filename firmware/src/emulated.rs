//! The loop around an application on the emulated board. The host decides what time it is: arrival times through a socket mean
//! nothing.
//!
//! For each [`Advance`] the board takes as many bytes from its buses as the host says it sent, does one step at the time
//! the host gives, and answers. Bytes wait in the host's sockets until they are taken, so none is lost.

use crate::application::Application;
use crate::board::mps2_an500::Board;
use crate::stack::HighWater;
use proprio_core::app::{Identity, Start};
use proprio_core::wire::{
    Advance, Advanced, Clock, DeviceMessage, HostMessage, LEGS, Losses, MAX_FRAME, Positions,
    Receiver, Reset, Sender,
};
use static_cell::ConstStaticCell;

/// Bytes of one bus that one step takes; a longer stretch is several steps at the same time.
const BUS_BUFFER: usize = 1024;

/// What the buses bring.
type Buffers = [[u8; BUS_BUFFER]; LEGS];
static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new([[0; BUS_BUFFER]; LEGS]);

/// The board, the application, and what is between them.
struct Listener<A> {
    board: Board,
    app: A,
    buffers: &'static mut Buffers,
    sender: Sender,
    frame: [u8; MAX_FRAME],
    stack: HighWater,
    /// Time of the last step.
    time_us: u64,
}

/// Runs an application for good; a step that costs more than `budget` instructions is counted.
pub fn run(app: impl Application, budget: u32) -> ! {
    let Some(board) = Board::take() else {
        panic!("the board is taken once")
    };
    let crash = crate::crash::take();
    let identity = Identity {
        firmware: crate::VERSION,
        board: "mps2-an500",
        start: Start {
            git: crate::GIT,
            clock: Clock::Unknown,
            // The emulator's reset begins with the power.
            reset: if crash.is_empty() {
                Reset::Power
            } else {
                Reset::Software
            },
            crash,
        },
        load_unit: "instructions",
        budget,
        byte_ns: 0,
        // What its host plays is a log's or a simulator's.
        positions: Positions::Absolute,
    };
    defmt::info!("proprio {} on {}", identity.firmware, identity.board);
    let mut listener = Listener {
        board,
        app,
        buffers: BUFFERS.take(),
        sender: Sender::default(),
        frame: [0; MAX_FRAME],
        stack: HighWater::new(),
        time_us: 0,
    };
    let mut receiver = Receiver::<HostMessage>::default();
    listener.app.begin(identity, &mut listener.board.flash);
    listener.step(0, [0; LEGS]);
    loop {
        let Some(byte) = listener.board.host.read() else {
            continue;
        };
        match receiver.push(byte) {
            None => {}
            Some(Ok(HostMessage::Advance(advance))) => listener.advance(advance),
            // What the IMU says is for the next step.
            Some(Ok(message @ HostMessage::Imu(_))) => listener.app.handle(&message),
            Some(Ok(message)) => {
                listener.app.handle(&message);
                listener.step(listener.time_us, [0; LEGS]);
            }
            Some(Err(_)) => defmt::warn!("damaged frame from the host"),
        }
        listener.app.record_losses(Losses {
            host_frames_bad: receiver.bad(),
            host_frames_missed: receiver.missed(),
            ..Losses::ZERO
        });
    }
}

impl<A: Application> Listener<A> {
    fn advance(&mut self, advance: Advance) {
        let mut left = advance.bytes;
        loop {
            let lengths = left.map(|bytes| bytes.min(BUS_BUFFER as u32));
            self.fill(lengths);
            self.step(advance.time_us, lengths);
            for (left, length) in left.iter_mut().zip(lengths) {
                *left -= length;
            }
            if left == [0; LEGS] {
                break;
            }
        }
        let done = DeviceMessage::Advanced(Advanced {
            time_us: advance.time_us,
        });
        self.board
            .host
            .write(self.sender.encode(&done, &mut self.frame));
    }

    /// Waits until each bus has brought its number of bytes.
    fn fill(&mut self, lengths: [u32; LEGS]) {
        let mut filled = [0; LEGS];
        let mut idle = false;
        while filled != lengths {
            let before = filled;
            for leg in 0..LEGS {
                while filled[leg] < lengths[leg]
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

    /// One step of the application and of its snapshot, its message made a frame; all are counted, the waiting for the UART is not.
    fn step(&mut self, time_us: u64, lengths: [u32; LEGS]) {
        self.time_us = time_us;
        let Self {
            app, sender, frame, ..
        } = self;
        let mut lengths = lengths.iter();
        let buses = self.buffers.each_ref().map(|buffer| {
            let length = lengths.next().map_or(0, |&length| length as usize);
            &buffer[..length]
        });
        let mut told = 0;
        let flash = &mut self.board.flash;
        let ((), instructions) = self.board.counter.count(|| {
            for (leg, bytes) in buses.into_iter().enumerate() {
                app.hear(leg, bytes, time_us);
            }
            app.step(time_us, &mut |message| {
                told = sender.encode(message, frame).len()
            });
            app.keep(flash, time_us);
        });
        self.app.record_cost(instructions, self.stack.bytes());
        self.board.host.write(&self.frame[..told]);
    }
}
