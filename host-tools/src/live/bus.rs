//! Motor buses as captures that are still being made: those that adapters listen to, and a simulated robot's.
//!
//! Nothing here writes to a port.

use std::io::{self, Cursor, Read};
use std::thread;
use std::time::{Duration, Instant};

use proprio_core::go2::{LEGS, Leg};
use proprio_simulator::hidden::typical;

use super::address::Adapter;
use super::error::LiveError;
use super::pieces::{PieceWriter, Pieces, Sender};
use super::until::Until;
use crate::capture::{CaptureError, CaptureWriter, Facts, Told, record};
use crate::device::Robot;
use crate::device::serial::{BUS_BAUD, open};

/// What is known of motor buses that is not on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BusFacts {
    /// Bits per second.
    pub baud: u32,
    /// Where each leg's joints are as it is heard first.
    pub told: [Told; LEGS],
}

impl Default for BusFacts {
    fn default() -> Self {
        Self {
            baud: BUS_BAUD,
            told: [Told::Nothing; LEGS],
        }
    }
}

/// A capture that is still being made.
pub type LiveCapture = Box<dyn Read + Send>;

/// A capture whose first line is known, and where its records go.
fn capture(leg: Leg, told: Told, baud: u32, until: &Until) -> (LiveCapture, Sender) {
    let leg = Some(leg);
    let (send, records) = Pieces::new(until.clone());
    let first = CaptureWriter::of(Vec::new(), baud, &Facts { leg, told });
    // Of memory.
    let first = first.and_then(CaptureWriter::finish).unwrap_or_default();
    (Box::new(Cursor::new(first).chain(records)), send)
}

/// Listens to each adapter's bus, on one clock.
///
/// # Errors
/// [`LiveError::NoZeros`], [`LiveError::Port`], [`LiveError::Thread`].
pub(super) fn listen(
    adapters: &[Adapter],
    facts: &BusFacts,
    until: &Until,
) -> Result<Vec<LiveCapture>, LiveError> {
    if let Some(adapter) = adapters
        .iter()
        .find(|adapter| facts.told[adapter.leg.index()] == Told::Nothing)
    {
        return Err(LiveError::NoZeros { leg: adapter.leg });
    }
    let start = Instant::now();
    let mut captures = Vec::new();
    for Adapter { leg, port } in adapters {
        let mut opened = open(port, facts.baud)?;
        let (capture, send) = capture(*leg, facts.told[leg.index()], facts.baud, until);
        captures.push(capture);
        let until = until.clone();
        let named = thread::Builder::new().name(leg.name().to_owned());
        let port = port.clone();
        let read = move || {
            let mut records = CaptureWriter::resume(PieceWriter(send.clone()));
            let ended = record(&mut opened, &mut records, start, |_| !until.is_over(None));
            // Where nobody takes the records any more, nobody wants to know why there are none.
            if let Err(CaptureError::Port(error)) = ended {
                let error = io::Error::new(error.kind(), format!("{port}: {error}"));
                let _ = send.send(Err(error));
            }
        };
        named.spawn(read).map_err(LiveError::Thread)?;
    }
    Ok(captures)
}

/// All four buses of a Go2 that hangs and swings its legs, in real time.
///
/// # Errors
/// [`LiveError::Thread`].
pub(super) fn simulate(until: &Until) -> Result<Vec<LiveCapture>, LiveError> {
    let legs = Leg::ALL.map(|leg| capture(leg, Told::Angles, BUS_BAUD, until));
    let (captures, sends): (Vec<_>, Vec<_>) = legs.into_iter().unzip();
    let until = until.clone();
    let named = thread::Builder::new().name("sim".to_owned());
    let play = move || {
        let send = |send: &Sender| CaptureWriter::resume(PieceWriter(send.clone()));
        let mut writers: Vec<_> = sends.iter().map(send).collect();
        let start = Instant::now();
        for step in Robot::new(&Leg::ALL, typical(&Leg::ALL), 1).steps() {
            let step = match step {
                Ok(step) => step,
                Err(error) => {
                    let error = || Err(io::Error::other(error.to_string()));
                    sends.iter().for_each(|send| drop(send.send(error())));
                    return;
                }
            };
            thread::sleep(Duration::from_micros(step.time_us).saturating_sub(start.elapsed()));
            let mut buses = writers.iter_mut().zip(&step.buses);
            let written = buses.try_for_each(|(writer, bytes)| writer.record(step.time_us, bytes));
            if written.is_err() || until.is_over(None) {
                return;
            }
        }
    };
    named.spawn(play).map_err(LiveError::Thread)?;
    Ok(captures)
}
