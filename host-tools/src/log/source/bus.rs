//! Captures of a motor bus: one leg's polling cycles, by the device's own listener, as rows.
//!
//! A motor counts its rotor's turns from its power-up on, so a capture is a log only if it says which leg its bus is of and where the
//! joints were as it began ([`Facts`]), or that its positions are angles, as a simulator's are. From where a motor is silent for
//! 0.1 s or jumps, its zero is none, and what follows is left out.

use std::fs::File;
use std::path::Path;

use proprio_core::app::Alignment;
use proprio_core::bus::{Cycle, Listener, Queue, position_counts};
use proprio_core::go2::{ACTUATORS, Go2, JOINTS_PER_LEG, Leg};
use proprio_core::robot::{Robot, places};
use proprio_core::window::Settings;

use super::input::Input;
use super::table::take;
use super::{Fault, Source, Wanted};
use crate::capture::{CaptureError, CaptureReader, Facts, LATE_US, Told};
use crate::log::error::{LogError, Problem, Unit};
use crate::log::warning::Warning;

/// Bytes given to the listener at once: what its queue always has room for.
const PART: usize = 256;
/// Cells of a row: the time, and each joint's position, velocity, torque and temperature.
const CELLS: usize = 1 + 4 * JOINTS_PER_LEG;

/// A capture as rows.
struct Bus {
    capture: CaptureReader<File>,
    size: u64,
    read: u64,
    names: Vec<String>,
    told: Told,
    queue: Queue,
    listener: Listener,
    alignment: Alignment<f64, Go2, JOINTS_PER_LEG>,
    /// What is left of the record under way, and when its last byte came, µs.
    record: (Vec<u8>, usize, u64),
    rows: u64,
    /// Samples that have no zero any more.
    unplaced: u64,
    broken: bool,
}

/// Opens a capture.
pub(super) fn open(path: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let refused = |what, way| LogError::new(path, Problem::NotALog { what, way });
    let capture = CaptureReader::new(input.file, path.display().to_string());
    let capture = capture.map_err(|error| LogError::new(path, problem(error)))?;
    let Facts { leg, told } = capture.facts().clone();
    let name = path
        .file_name()
        .and_then(|name| name.to_str())
        .unwrap_or("");
    let by_name = Leg::ALL
        .into_iter()
        .find(|leg| name.starts_with(leg.name()));
    let Some(leg) = leg.or(by_name) else {
        return Err(refused(
            "a bus capture that does not say of which leg it is",
            "call it by its leg, such as FR.cap, or record it with --leg FR",
        ));
    };
    if told == Told::Nothing {
        return Err(refused(
            "a bus capture that does not say where the joints' zeros are",
            "record it while the joints rest where you know, and say so: proprio capture PORT -o FR.cap --at FR_hip=0.1 --at FR_thigh=0.8 --at FR_calf=-1.5",
        ));
    }
    let names = ["q", "dq", "tau", "temp"].into_iter().flat_map(|signal| {
        let joints = leg.joint_names();
        joints.map(|joint| format!("{signal}/{joint}"))
    });
    Ok(Box::new(Bus {
        size: input.size,
        read: 0,
        names: ["t".to_owned()].into_iter().chain(names).collect(),
        told,
        queue: Queue::of_adapter(LATE_US),
        listener: Listener::new(),
        alignment: Alignment::new(),
        record: (Vec::new(), 0, 0),
        rows: 0,
        unplaced: 0,
        broken: false,
        capture,
    }))
}

fn problem(error: CaptureError) -> Problem {
    match error {
        CaptureError::Read { source, .. } => Problem::Read(source),
        error => Problem::Damaged(error.to_string()),
    }
}

impl Bus {
    /// The next polling cycle; none at the end.
    fn cycle(&mut self) -> Result<Option<Cycle>, Fault> {
        loop {
            if let Some(cycle) = self.listener.next(&mut self.queue, &mut { usize::MAX }) {
                return Ok(Some(*cycle));
            }
            let (bytes, from, end_us) = &mut self.record;
            if *from >= bytes.len() {
                let record = self.capture.next_record();
                let record = record.map_err(|error| Fault::new(self.rows + 1, problem(error)))?;
                let Some(record) = record else {
                    return Ok(None);
                };
                self.read += record.bytes.len() as u64;
                self.record = (record.bytes, 0, record.time_us);
                continue;
            }
            let to = (*from + PART).min(bytes.len());
            let byte_ns = self.capture.byte_ns();
            let after_us = (bytes.len() - to) as u64 * u64::from(byte_ns) / 1000;
            let part = &bytes[*from..to];
            self.queue
                .push(part, end_us.saturating_sub(after_us), byte_ns);
            *from = to;
        }
    }

    /// Takes the joints to be where the capture says as its first cycle comes.
    fn place(&mut self, cycle: &Cycle) {
        let Told::At(angles) = self.told else {
            return;
        };
        let motors = places(<Go2 as Robot<JOINTS_PER_LEG>>::MOTOR_IDS);
        for (joint, (angle, reversed)) in angles.into_iter().enumerate() {
            let turned = if reversed { -angle } else { angle };
            // The reader of the first line has seen to it that it fits.
            let counts = position_counts(ACTUATORS[joint].gear, turned).unwrap_or_default();
            let position = cycle[motors[joint]].reply.position;
            let zero = position.wrapping_sub(counts);
            self.alignment.set_zero(joint, zero, reversed);
        }
    }
}

impl Source for Bus {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self) -> Unit {
        Unit::Cycle
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        loop {
            let Some(cycle) = self.cycle()? else {
                return Ok(None);
            };
            if self.rows == 0 {
                self.place(&cycle);
                self.listener.take_breaks();
            }
            self.rows += 1;
            // Where positions are angles a jump is a robot's affair, as in any log.
            let sample = self.alignment.sample(&cycle, Settings::DEFAULT.max_gap_us);
            let broken = self.listener.is_broken() || self.alignment.take_silence();
            self.broken |= broken && self.told != Told::Angles;
            if self.broken {
                self.unplaced += 1;
                continue;
            }
            let motors = places(<Go2 as Robot<JOINTS_PER_LEG>>::MOTOR_IDS);
            let mut cells = [0.0; CELLS];
            cells[0] = sample.time_us as f64 * 1e-6;
            for joint in 0..JOINTS_PER_LEG {
                let temperature = cycle[motors[joint]].reply.temperature;
                let signals = [
                    sample.q[joint],
                    sample.dq[joint],
                    sample.tau[joint],
                    f64::from(temperature),
                ];
                for (n, signal) in signals.into_iter().enumerate() {
                    cells[1 + n * JOINTS_PER_LEG + joint] = signal;
                }
            }
            if take(wanted, values, self.rows, |cell| cells[cell])? {
                return Ok(Some(self.rows));
            }
        }
    }

    fn progress(&self) -> (u64, u64) {
        (self.read.min(self.size), self.size)
    }

    fn warnings(&self) -> Vec<Warning> {
        let unplaced = (self.unplaced > 0).then_some(Warning::Unplaced {
            count: self.unplaced,
            of: self.rows,
        });
        unplaced.into_iter().collect()
    }
}
