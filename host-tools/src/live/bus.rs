//! Motor buses as captures that are still being made: those that adapters listen to, and a simulated robot's.
//!
//! Nothing here can write to a port: it is opened as what is read from.

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
use crate::device::serial::{self, BUS_BAUD};

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
fn capture(facts: &Facts, baud: u32, until: &Until) -> (LiveCapture, Sender) {
    let (send, records) = Pieces::new(until.clone());
    let first = CaptureWriter::of(Vec::new(), baud, facts);
    // Of memory.
    let first = first.and_then(CaptureWriter::finish).unwrap_or_default();
    (Box::new(Cursor::new(first).chain(records)), send)
}

/// Listens to the bus of one port, of which `facts` are known; times count from `start`.
///
/// # Errors
/// [`LiveError::Port`], [`LiveError::Thread`].
fn adapter(
    port: &str,
    facts: &Facts,
    baud: u32,
    start: Instant,
    until: &Until,
) -> Result<LiveCapture, LiveError> {
    let mut opened = serial::listen(port, baud)?;
    let (capture, send) = capture(facts, baud, until);
    let (until, port) = (until.clone(), port.to_owned());
    let name = facts.leg.map_or("bus", Leg::name);
    let read = move || {
        let mut records = CaptureWriter::resume(PieceWriter(send.clone()));
        let ended = record(&mut opened, &mut records, start, |_| !until.is_over(None));
        // Where nobody takes the records any more, nobody wants to know why there are none.
        if let Err(CaptureError::Port(error)) = ended {
            let error = io::Error::new(error.kind(), format!("{port}: {error}"));
            let _ = send.send(Err(error));
        }
    };
    let named = thread::Builder::new().name(name.to_owned());
    named.spawn(read).map_err(LiveError::Thread)?;
    Ok(capture)
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
    let captures = adapters.iter().map(|Adapter { leg, port }| {
        let told = facts.told[leg.index()];
        let facts_of_leg = Facts {
            leg: Some(*leg),
            told,
        };
        adapter(port, &facts_of_leg, facts.baud, start, until)
    });
    captures.collect()
}

/// The bytes of one bus as a capture: of the adapter at a port, whether its zeros are known or not; without a port, of `facts`' leg of a simulated
/// robot. It ends as `until` says.
///
/// # Errors
/// [`LiveError::Port`], [`LiveError::Thread`].
pub fn bytes(
    port: Option<&str>,
    facts: &Facts,
    baud: u32,
    until: &Until,
) -> Result<LiveCapture, LiveError> {
    match port {
        Some(port) => adapter(port, facts, baud, Instant::now(), until),
        None => {
            let [capture] = simulate([facts.leg.unwrap_or(Leg::FR)], until)?;
            Ok(capture)
        }
    }
}

/// The buses of these legs of a Go2 that hangs and swings its legs, in real time.
///
/// # Errors
/// [`LiveError::Thread`].
pub(super) fn simulate<const N: usize>(
    legs: [Leg; N],
    until: &Until,
) -> Result<[LiveCapture; N], LiveError> {
    let told = Told::Angles;
    let facts = legs.map(|leg| Facts {
        leg: Some(leg),
        told,
    });
    let mut sends = Vec::new();
    let captures = facts.map(|facts| {
        let (capture, send) = capture(&facts, BUS_BAUD, until);
        sends.push(send);
        capture
    });
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
            let mut buses = writers.iter_mut().zip(legs);
            let written = buses.try_for_each(|(writer, leg)| {
                writer.record(step.time_us, &step.buses[leg.index()])
            });
            if written.is_err() || until.is_over(None) {
                return;
            }
        }
    };
    named.spawn(play).map_err(LiveError::Thread)?;
    Ok(captures)
}
