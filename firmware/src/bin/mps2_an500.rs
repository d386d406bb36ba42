//! The listener on the emulated board. The host decides what time it is: arrival times through a socket mean nothing.
//!
//! For each [`Advance`] the board takes as many bytes from its buses as the host says it sent, does one step at the time
//! the host gives, and answers. Bytes wait in the host's sockets until they are taken, so none is lost.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt_semihosting as _;
use proprio_core::app::{App, Identity, Memory, Start};
use proprio_core::wire::{
    Advance, Advanced, DeviceMessage, HostMessage, LEGS, Losses, MAX_FRAME, Receiver, Reset, Sender,
};
use proprio_firmware::board::mps2_an500::Board;
use proprio_firmware::{GIT, Scalar, VERSION, crash, stack::HighWater};
use static_cell::ConstStaticCell;

/// Who this is, but for its start.
const IDENTITY: Identity = Identity {
    firmware: VERSION,
    board: "mps2-an500",
    start: Start::UNKNOWN,
    load_unit: "instructions",
    budget: 120_000,
    byte_ns: 0,
};

/// Bytes of one bus that one step takes; a longer stretch is several steps at the same time.
const BUS_BUFFER: usize = 1024;

// All zeros at first: no copies of them lie in flash.
static APP: ConstStaticCell<App<Scalar>> = ConstStaticCell::new(App::unset());
static MEMORY: ConstStaticCell<Memory<Scalar>> = ConstStaticCell::new(Memory::new());
static BUFFERS: ConstStaticCell<[[u8; BUS_BUFFER]; LEGS]> =
    ConstStaticCell::new([[0; BUS_BUFFER]; LEGS]);

struct Listener {
    board: Board,
    app: &'static mut App<Scalar>,
    memory: &'static mut Memory<Scalar>,
    buffers: &'static mut [[u8; BUS_BUFFER]; LEGS],
    sender: Sender,
    frame: [u8; MAX_FRAME],
    stack: HighWater,
    /// Time of the last step.
    time_us: u64,
}

#[entry]
fn main() -> ! {
    let Some(board) = Board::take() else {
        panic!("the board is taken once")
    };
    defmt::info!("proprio {} on {}", IDENTITY.firmware, IDENTITY.board);
    let mut listener = Listener {
        board,
        app: APP.take(),
        memory: MEMORY.take(),
        buffers: BUFFERS.take(),
        sender: Sender::default(),
        frame: [0; MAX_FRAME],
        stack: HighWater::new(),
        time_us: 0,
    };
    let mut receiver = Receiver::<HostMessage>::default();
    let crash = crash::take();
    let start = Start {
        git: GIT,
        // The emulator's reset begins with the power.
        reset: if crash.is_empty() {
            Reset::Power
        } else {
            Reset::Software
        },
        crash,
    };
    let identity = Identity { start, ..IDENTITY };
    listener.app.begin(listener.memory, identity);
    let flash = &mut listener.board.flash;
    listener.app.restore(listener.memory, flash);
    listener.step(0, [0; LEGS]);
    loop {
        let Some(byte) = listener.board.host.read() else {
            continue;
        };
        match receiver.push(byte) {
            None => {}
            Some(Ok(HostMessage::Advance(advance))) => listener.advance(advance),
            Some(Ok(message)) => {
                listener.app.handle(listener.memory, &message);
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

impl Listener {
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
            app,
            memory,
            sender,
            frame,
            ..
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
                app.hear(memory, leg, bytes, time_us);
            }
            app.step(memory, time_us, &mut |message| {
                told = sender.encode(message, frame).len()
            });
            app.keep(memory, flash, time_us);
        });
        self.app.record_cost(instructions, self.stack.bytes());
        self.board.host.write(&self.frame[..told]);
    }
}
