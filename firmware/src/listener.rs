//! The loop around an application, the same on all boards: it takes what the board's buses, IMU and host have brought, with its times, and does one
//! step at the board's time.

use crate::application::Application;
use crate::board::Board;
use crate::stack::HighWater;
use crate::{GIT, VERSION, crash};
use proprio_core::app::{Identity, Start};
use proprio_core::wire::{DeviceMessage, HostMessage, Losses, MAX_FRAME, Receiver, Reset, Sender};
use static_cell::{ConstStaticCell, StaticCell};

/// Bytes of the host that are looked at together: static, as the budget of the stack has no room for more.
static FROM_HOST: ConstStaticCell<[u8; 64]> = ConstStaticCell::new([0; 64]);
/// A frame to the host, and what is known of those from it; static for the same reason.
static FRAME: ConstStaticCell<[u8; MAX_FRAME]> = ConstStaticCell::new([0; MAX_FRAME]);
static RECEIVER: StaticCell<Receiver<HostMessage>> = StaticCell::new();

/// The board, the application, and what is between them.
struct Listener<B, A> {
    board: B,
    app: A,
    receiver: &'static mut Receiver<HostMessage>,
    sender: Sender,
    frame: &'static mut [u8; MAX_FRAME],
    stack: HighWater,
}

/// Runs an application for good.
pub async fn run<B: Board, A: Application>(board: B, app: A) -> ! {
    let crash = crash::take();
    let reset = board.reset(!crash.is_empty());
    let identity = Identity {
        firmware: VERSION,
        board: B::NAME,
        start: Start {
            git: GIT,
            reset,
            brown_out_level: board.brown_out_level(),
            clock: board.clock(),
            crash,
            setup: board.setup(),
        },
        load_unit: B::LOAD_UNIT,
        budget: board.budget(),
        byte_ns: board.byte_ns(),
        positions: B::POSITIONS,
    };
    defmt::info!("proprio {} on {}", identity.firmware, identity.board);
    if !crash.is_empty() {
        defmt::error!("the run before ended: {}", crash);
    }
    let mut listener = Listener {
        board,
        app,
        receiver: RECEIVER.init_with(Receiver::default),
        sender: Sender::default(),
        frame: FRAME.take(),
        stack: HighWater::new(),
    };
    let from_host = FROM_HOST.take();
    listener.board.beginning();
    listener.app.begin(identity, listener.board.flash());
    listener
        .board
        .begun(!crash.is_empty() || reset == Reset::Watchdog);
    loop {
        listener.board.wait().await;
        listener.obey(from_host);
        listener.step();
        let Listener { board, app, .. } = &mut listener;
        board.stepped(|| app.health());
    }
}

impl<B: Board, A: Application> Listener<B, A> {
    /// Takes what the host sent, until the step is due.
    fn obey(&mut self, buffer: &mut [u8]) {
        loop {
            let bytes = self.board.read_host(buffer);
            if bytes.is_empty() {
                break;
            }
            for &byte in bytes {
                match self.receiver.push(byte) {
                    None => {}
                    Some(Ok(message)) => {
                        self.app.handle(&message);
                        self.board.heard(&message);
                    }
                    Some(Err(_)) => defmt::warn!("damaged frame from the host"),
                }
            }
        }
        self.app.record_losses(Losses {
            host_frames_bad: self.receiver.bad(),
            host_frames_missed: self.receiver.missed(),
            ..self.board.losses()
        });
    }

    /// One step of the application and of its snapshot, its message made a frame; all are counted, with the taking of what came. Sending is not.
    fn step(&mut self) {
        let Self {
            board,
            app,
            sender,
            frame,
            ..
        } = self;
        let now_us = board.now_us();
        let mut told = 0;
        let begin = board.begin_cost();
        board.hear(|leg, bytes, end_us| app.hear(leg, bytes, end_us));
        board.feel(|imu, time_us| app.feel(imu, time_us));
        app.step(now_us, &mut |message| {
            told = sender.encode(message, frame).len();
        });
        app.keep(board.flash(), now_us);
        let cost = board.cost_since(begin);
        app.record_cost(cost, self.stack.bytes());
        // Nothing at all where nothing was told: a frame is never empty.
        if told > 0 {
            self.board.send(&self.frame[..told]);
        }
        if let Some(answer) = self.board.answer() {
            self.tell(&answer);
        }
    }

    /// Says what the board itself has to say.
    fn tell(&mut self, message: &DeviceMessage) {
        self.board.send(self.sender.encode(message, self.frame));
    }
}
