//! Captures of motor buses, whole or still being made: polling cycles, by the device's own listener, as rows.
//!
//! A motor counts its rotor's turns from its power-up on, so a capture is a log only if it says which leg its bus is of and where the
//! joints were as it began ([`Facts`]), or that its positions are angles, as a simulator's are. From where a motor is silent for
//! 0.1 s or jumps, its zero is none, and what follows is left out. Where an adapter hands over several cycles at once their times are not in the
//! capture, and accelerations would be another motion's: it is refused ([`Stamps`]).
//!
//! Of several buses on one clock a row is a cycle of the first, and the others' signals lie on the line between the cycles before and after it:
//! buses are polled on their own, and what was measured 2 ms before is another velocity.

use std::io::Read;
use std::path::Path;

use proprio_core::app::Alignment;
use proprio_core::bus::{Command, Cycle, Listener, MOTORS, Queue, Reply, position_counts};
use proprio_core::go2::{ACTUATORS, Go2, JOINTS_PER_LEG, Leg};
use proprio_core::robot::{Robot, places};
use proprio_core::window::Settings;

use super::input::Input;
use super::table::take;
use super::{Fault, Source, Wanted};
use crate::capture::{
    CaptureError, CaptureReader, Facts, LATE_US, SET_LATENCY_TIMER, Stamps, Told,
};
use crate::log::error::{LogError, Problem, Unit};
use crate::log::warning::Warning;

/// Bytes given to the listener at once: what its queue always has room for.
const PART: usize = 256;
/// A leg's signals in a row.
const SIGNALS: [&str; 4] = ["q", "dq", "tau", "temp"];
/// Cells of a leg in a row.
const CELLS: usize = SIGNALS.len() * JOINTS_PER_LEG;
/// Ten cycles of a leg, bytes: who has so many and no cycle is not helped by a longer capture.
const FEW_BYTES: u64 = 10 * (MOTORS * (Command::LEN + Reply::LEN)) as u64;
/// Cycles of a bus further apart than this have no line between them, µs: as windows, which bridge no longer silence.
const APART_US: u64 = Settings::DEFAULT.max_gap_us;

/// Opens a capture.
pub(super) fn open(path: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let size = input.size;
    begin(path, vec![input.file], size)
}

/// Reads captures that are still being made, all on one clock.
pub(super) fn open_live(
    name: &Path,
    captures: Vec<Box<dyn Read>>,
) -> Result<Box<dyn Source>, LogError> {
    begin(name, captures, 0)
}

fn begin<R: Read + 'static>(
    path: &Path,
    captures: Vec<R>,
    size: u64,
) -> Result<Box<dyn Source>, LogError> {
    let lines = captures.into_iter().map(|capture| Line::new(path, capture));
    let lines = lines.collect::<Result<Vec<Line<R>>, LogError>>()?;
    let names = lines.iter().flat_map(|line| {
        let joints = line.leg.joint_names();
        SIGNALS.map(move |signal| joints.map(|joint| format!("{signal}/{joint}")))
    });
    Ok(Box::new(Buses {
        size,
        names: ["t".to_owned()]
            .into_iter()
            .chain(names.flatten())
            .collect(),
        cells: vec![0.0; 1 + CELLS * lines.len()],
        lines,
        begun: false,
        alone: 0,
    }))
}

fn problem(error: CaptureError) -> Problem {
    match error {
        CaptureError::Read { source, .. } => Problem::Read(source),
        error => Problem::Damaged(error.to_string()),
    }
}

/// A cycle of a leg as cells of a row.
#[derive(Clone, Copy)]
struct Measured {
    time_us: u64,
    cells: [f64; CELLS],
}

/// One leg's bus.
struct Line<R> {
    capture: CaptureReader<R>,
    leg: Leg,
    read: u64,
    told: Told,
    queue: Queue,
    listener: Listener,
    stamps: Stamps,
    alignment: Alignment<f64, Go2, JOINTS_PER_LEG>,
    /// What is left of the record under way, and when its last byte came, µs.
    record: (Vec<u8>, usize, u64),
    cycles: u64,
    /// Samples that have no zero any more.
    unplaced: u64,
    broken: bool,
    /// When the last cycle came, whether its joints have zeros or not, µs.
    heard_us: Option<u64>,
    /// The last two samples.
    last: [Option<Measured>; 2],
}

impl<R: Read> Line<R> {
    fn new(path: &Path, capture: R) -> Result<Self, LogError> {
        let refused = |what, way| LogError::new(path, Problem::NotALog { what, way });
        let capture = CaptureReader::new(capture, path.display().to_string());
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
        Ok(Self {
            leg,
            read: 0,
            told,
            queue: Queue::of_adapter(LATE_US),
            listener: Listener::new(),
            stamps: Stamps::new(capture.byte_ns()),
            alignment: Alignment::new(),
            record: (Vec::new(), 0, 0),
            cycles: 0,
            unplaced: 0,
            broken: false,
            heard_us: None,
            last: [None; 2],
            capture,
        })
    }

    /// The next polling cycle; none at the end.
    fn cycle(&mut self) -> Result<Option<Cycle>, Fault> {
        loop {
            if let Some(cycle) = self.listener.next(&mut self.queue, &mut { usize::MAX }) {
                return Ok(Some(*cycle));
            }
            let (bytes, from, end_us) = &mut self.record;
            if *from >= bytes.len() {
                let record = self.capture.next_record();
                let record = record.map_err(|error| Fault::new(self.cycles + 1, problem(error)))?;
                let grouped = match &record {
                    Some(record) => {
                        self.stamps.push(record, |_| {});
                        self.stamps.grouped_so_far()
                    }
                    None => self.stamps.grouped(),
                };
                let refused =
                    |what, way| Fault::new(self.cycles + 1, Problem::NotALog { what, way });
                if grouped.is_some() {
                    return Err(refused(
                        "a bus capture with several polling cycles in one piece, and without their times",
                        SET_LATENCY_TIMER,
                    ));
                }
                let Some(record) = record else {
                    return match self.cycles {
                        0 if self.read >= FEW_BYTES => Err(refused(
                            "a bus capture in which no polling cycle is whole",
                            "proprio capture --explain FILE says what is wrong with the bus",
                        )),
                        _ => Ok(None),
                    };
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

    /// The next cycle, in place of the first of the last two; where its joints have no zeros there are none. False at the end.
    fn advance(&mut self) -> Result<bool, Fault> {
        let Some(cycle) = self.cycle()? else {
            return Ok(false);
        };
        if self.cycles == 0 {
            self.place(&cycle);
            self.listener.take_breaks();
        }
        self.cycles += 1;
        // Where positions are angles a jump is a robot's affair, as in any log.
        let sample = self.alignment.sample(&cycle, APART_US);
        let time_us = sample.time_us;
        self.heard_us = Some(time_us);
        let broken = self.listener.is_broken() || self.alignment.take_silence();
        self.broken |= broken && self.told != Told::Angles;
        if self.broken {
            self.unplaced += 1;
            self.last = [None; 2];
            return Ok(true);
        }
        let motors = places(<Go2 as Robot<JOINTS_PER_LEG>>::MOTOR_IDS);
        let mut cells = [0.0; CELLS];
        for joint in 0..JOINTS_PER_LEG {
            let temperature = cycle[motors[joint]].reply.temperature;
            let signals = [
                sample.q[joint],
                sample.dq[joint],
                sample.tau[joint],
                f64::from(temperature),
            ];
            for (n, signal) in signals.into_iter().enumerate() {
                cells[n * JOINTS_PER_LEG + joint] = signal;
            }
        }
        self.last = [self.last[1], Some(Measured { time_us, cells })];
        Ok(true)
    }

    /// Reads on to the first cycle that is no earlier than `time_us`; false at the end.
    fn reach(&mut self, time_us: u64) -> Result<bool, Fault> {
        while self.heard_us.is_none_or(|heard| heard < time_us) {
            if !self.advance()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// What the leg's signals were then: of a cycle of that time, or on the line between the two about it.
    fn at(&self, time_us: u64) -> Option<[f64; CELLS]> {
        let after = self.last[1]?;
        if after.time_us == time_us {
            return Some(after.cells);
        }
        let before = self.last[0]?;
        let apart = after.time_us.saturating_sub(before.time_us);
        if time_us < before.time_us || time_us > after.time_us || apart > APART_US {
            return None;
        }
        let share = (time_us - before.time_us) as f64 / apart as f64;
        let cells = before.cells.iter().zip(&after.cells);
        let mut between = [0.0; CELLS];
        for (place, (before, after)) in between.iter_mut().zip(cells) {
            *place = before + (after - before) * share;
        }
        Some(between)
    }
}

/// Captures as rows.
struct Buses<R> {
    size: u64,
    names: Vec<String>,
    lines: Vec<Line<R>>,
    /// The present row.
    cells: Vec<f64>,
    /// All have been heard.
    begun: bool,
    /// Cycles of the first bus since about which another has none.
    alone: u64,
}

impl<R: Read> Buses<R> {
    /// The row of the next cycle of the first bus, with its number; none at the end.
    fn row(&mut self) -> Result<Option<u64>, Fault> {
        let Some((first, others)) = self.lines.split_first_mut() else {
            return Ok(None);
        };
        'cycles: while first.advance()? {
            // Also where the first has no zeros any more: an adapter that nobody reads waits, and then loses what comes.
            let heard_us = first.heard_us.unwrap_or_default();
            for line in &mut *others {
                if !line.reach(heard_us)? {
                    return Ok(None);
                }
            }
            let Some(Measured { time_us, cells }) = first.last[1] else {
                continue;
            };
            self.cells[0] = time_us as f64 * 1e-6;
            self.cells[1..=CELLS].copy_from_slice(&cells);
            let places = self.cells[1 + CELLS..].chunks_exact_mut(CELLS);
            for (line, place) in others.iter().zip(places) {
                let Some(cells) = line.at(time_us) else {
                    self.alone += u64::from(self.begun);
                    continue 'cycles;
                };
                place.copy_from_slice(&cells);
            }
            self.begun = true;
            return Ok(Some(first.cycles));
        }
        Ok(None)
    }
}

impl<R: Read> Source for Buses<R> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self) -> Unit {
        Unit::Cycle
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        while let Some(number) = self.row()? {
            if take(wanted, values, number, |cell| self.cells[cell])? {
                return Ok(Some(number));
            }
        }
        Ok(None)
    }

    fn progress(&self) -> (u64, u64) {
        let read: u64 = self.lines.iter().map(|line| line.read).sum();
        (read.min(self.size), self.size)
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        for line in self.lines.iter().filter(|line| line.unplaced > 0) {
            warnings.push(Warning::Unplaced {
                leg: line.leg,
                count: line.unplaced,
                of: line.cycles,
            });
        }
        if self.alone > 0 {
            warnings.push(Warning::Alone {
                count: self.alone,
                of: self.lines.first().map_or(0, |line| line.cycles),
            });
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{CaptureWriter, Record};
    use crate::device::power_up::PowerUp;
    use crate::device::replay::bus_step;
    use crate::device::serial::BUS_BAUD;
    use crate::log::{LiveInput, LiveRows, LogReader, Selection};
    use crate::model::Robot as Model;
    use proprio_core::window::Sample;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// When a leg's first cycle is, µs.
    const FIRST_US: u64 = 5_000;

    /// Where each joint of a leg is: a swing that no leg shares with another.
    fn q(leg: Leg, joint: usize, t: f64) -> [f64; 2] {
        let pace = 9.0 + leg.index() as f64 + joint as f64;
        let (middle, reach) = ([0.1, 0.8, -1.5][joint], 0.3);
        let (sin, cos) = (pace * t).sin_cos();
        [middle + reach * sin, reach * pace * cos]
    }

    /// A capture of `cycles` cycles of 2 ms of a leg's bus, `late_us` later than those of a bus that is not; none while it `is_silent`.
    fn capture(leg: Leg, cycles: u64, late_us: u64, is_silent: impl Fn(u64) -> bool) -> Vec<u8> {
        let facts = Facts {
            leg: Some(leg),
            told: Told::Angles,
        };
        let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
        for n in (0..cycles).filter(|n| !is_silent(*n)) {
            let time_us = FIRST_US + 2_000 * n + late_us;
            let state = [0, 1, 2].map(|joint| q(leg, joint, time_us as f64 * 1e-6));
            let mut instant = [None; 4];
            instant[leg.index()] = Some(Sample {
                time_us,
                q: state.map(|[q, _]| q),
                dq: state.map(|[_, dq]| dq),
                tau: [1.0, 2.0, 3.0],
            });
            let step = bus_step(time_us, &instant).unwrap();
            writer.record(time_us, &step.buses[leg.index()]).unwrap();
        }
        writer.finish().unwrap()
    }

    fn follow(captures: Vec<Vec<u8>>) -> LiveRows {
        let captures = captures.into_iter().map(|bytes| {
            let bytes: Box<dyn Read> = Box::new(std::io::Cursor::new(bytes));
            bytes
        });
        let input = LiveInput::Buses(captures.collect());
        LiveRows::follow(Path::new("buses"), input, &Model::go2()).unwrap()
    }

    /// Time, positions and velocities of all rows.
    fn rows(live: &mut LiveRows) -> Vec<(f64, Vec<f64>, Vec<f64>)> {
        let mut rows = Vec::new();
        while let Some(row) = live.next_row().unwrap() {
            rows.push((row.t(), row.q().to_vec(), row.dq().to_vec()));
        }
        rows
    }

    #[test]
    fn a_bus_that_is_listened_to_has_the_rows_of_its_capture() {
        let bytes = capture(Leg::FL, 500, 0, |_| false);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("FL.cap");
        std::fs::write(&path, &bytes).unwrap();
        let mut file = LogReader::open(&path, Selection::Everything).unwrap();
        let live = rows(&mut follow(vec![bytes]));
        let mut count = 0;
        while let Some(row) = file.next_row().unwrap() {
            let (_, q, dq) = &live[count];
            assert_eq!((&row.q()[3..6], &row.dq()[3..6]), (&q[3..6], &dq[3..6]));
            count += 1;
        }
        assert_eq!(count, live.len());
        assert!(count > 490, "{count}");
    }

    /// Whatever the phase between two buses, both legs are where they were at the row's time.
    #[test]
    fn rows_of_several_buses_are_of_one_time() {
        for late_us in [0, 300, 1_000, 1_900] {
            let legs = [Leg::RR, Leg::FR];
            let captures = [(legs[0], 0), (legs[1], late_us)];
            let captures = captures.map(|(leg, late_us)| capture(leg, 1_000, late_us, |_| false));
            let mut live = follow(captures.to_vec());
            let rows = rows(&mut live);
            assert!(rows.len() > 990, "{}", rows.len());
            assert_eq!(live.warnings(), []);
            // The bytes of a cycle are 247 µs on the line, and the row is of its first reply.
            let shift = FIRST_US as f64 * 1e-6 - rows[0].0;
            assert!(shift.abs() < 3e-3);
            for (t, all_q, all_dq) in rows.iter().skip(5) {
                for leg in legs {
                    for joint in 0..JOINTS_PER_LEG {
                        // What a cycle's bytes say is of the time of its last one.
                        let near = (0..60).map(|n| q(leg, joint, t + 5e-6 * f64::from(n)));
                        let place = JOINTS_PER_LEG * leg.index() + joint;
                        let off = |[q, dq]: [f64; 2]| {
                            (all_q[place] - q)
                                .abs()
                                .max(0.03 * (all_dq[place] - dq).abs())
                        };
                        let nearest = near.map(off).fold(f64::INFINITY, f64::min);
                        assert!(
                            nearest < 1.5e-3,
                            "{late_us} {} {joint} {t} {nearest}",
                            leg.name()
                        );
                    }
                }
            }
        }
    }

    /// An adapter's timer that ends every 16 ms hands over eight cycles at once: a file is refused at its end, a bus within a second or so.
    #[test]
    fn cycles_without_times_of_their_own_are_no_rows() {
        for cycles in [40, 5_000] {
            let timed = capture(Leg::FL, cycles, 0, |_| false);
            let mut reader = CaptureReader::new(timed.as_slice(), "FL".to_owned()).unwrap();
            let facts = reader.facts().clone();
            let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
            let mut waiting = Vec::new();
            while let Some(record) = reader.next_record().unwrap() {
                waiting.extend(record.bytes);
                if waiting.len() >= 8 * 99 {
                    writer.record(record.time_us, &waiting).unwrap();
                    waiting.clear();
                }
            }
            let mut live = follow(vec![writer.finish().unwrap()]);
            let mut count = 0;
            let error = loop {
                match live.next_row() {
                    Ok(row) => count += usize::from(row.expect("refused before").t() > 0.0),
                    Err(error) => break error,
                }
            };
            let is_refused =
                matches!(*error.problem, Problem::NotALog { way, .. } if way == SET_LATENCY_TIMER);
            assert!(is_refused, "{error}");
            assert!(count < 600, "{count}");
        }
    }

    /// Replies whose last byte is another: not one cycle, and no longer capture helps.
    #[test]
    fn a_bus_without_a_whole_cycle_is_said_to_be_none() {
        let timed = capture(Leg::FL, 500, 0, |_| false);
        let mut reader = CaptureReader::new(timed.as_slice(), "FL".to_owned()).unwrap();
        let facts = reader.facts().clone();
        let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
        while let Some(Record { time_us, mut bytes }) = reader.next_record().unwrap() {
            for pair in bytes.chunks_mut(Command::LEN + Reply::LEN) {
                *pair.last_mut().unwrap() = 0x55;
            }
            writer.record(time_us, &bytes).unwrap();
        }
        let mut live = follow(vec![writer.finish().unwrap()]);
        let error = live.next_row().map(|row| row.is_some()).unwrap_err();
        let is_refused =
            matches!(*error.problem, Problem::NotALog { way, .. } if way.contains("--explain"));
        assert!(is_refused, "{error}");
    }

    /// No line is drawn across a silence of another bus, and the rows that lack are counted.
    #[test]
    fn a_bus_that_is_silent_for_a_while_costs_those_rows() {
        let silent = |n: u64| (300..330).contains(&n);
        let mut live = follow(vec![
            capture(Leg::FR, 1_000, 0, |_| false),
            capture(Leg::FL, 1_000, 700, silent),
        ]);
        let times: Vec<f64> = rows(&mut live).iter().map(|row| row.0).collect();
        let longest = times.windows(2).map(|pair| pair[1] - pair[0]);
        let longest = longest.fold(0.0, f64::max);
        assert!((0.060..0.066).contains(&longest), "{longest}");
        let warnings = live.warnings();
        assert!(
            matches!(warnings[..], [Warning::Alone { count: 29..=32, .. }]),
            "{warnings:?}"
        );
    }

    /// A robot's bus of so many cycles of 2 ms whose motors are switched off for 0.2 s from the 400th on: their zeros are none then.
    fn switched_off(leg: Leg) -> Vec<u8> {
        let robot = crate::device::Robot::new(&[leg], Vec::new(), 3).after(PowerUp::random(4));
        let facts = Facts {
            leg: Some(leg),
            told: Told::At([(0.1, false), (0.8, false), (-1.5, false)]),
        };
        let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
        let steps = robot.steps().take(1_000).enumerate();
        for (n, step) in steps.filter(|(n, _)| !(400..500).contains(n)) {
            let step = step.unwrap();
            let bytes = &step.buses[leg.index()];
            writer.record(step.time_us, bytes).unwrap();
            assert!(!bytes.is_empty(), "{n}");
        }
        writer.finish().unwrap()
    }

    #[test]
    fn a_motor_that_was_switched_off_has_no_zero_any_more() {
        let mut live = follow(vec![switched_off(Leg::FR)]);
        let count = rows(&mut live).len() as u64;
        let warnings = live.warnings();
        assert!((390..=400).contains(&count), "{count}");
        assert!(
            matches!(warnings[..], [Warning::Unplaced { leg: Leg::FR, count, .. }] if count >= 490),
            "{warnings:?}"
        );
    }

    /// Bytes, of which it is known how many nobody has read.
    struct Unread(std::io::Cursor<Vec<u8>>, Arc<AtomicUsize>);

    impl Read for Unread {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let count = self.0.read(buffer)?;
            self.1.fetch_sub(count, Ordering::Relaxed);
            Ok(count)
        }
    }

    /// Where one leg has no zeros any more there are no rows, and the other adapters' bytes are read on: nobody waits to hand them over.
    #[test]
    fn a_bus_without_zeros_does_not_keep_the_others_waiting() {
        let legs = [Leg::RL, Leg::RR];
        for which in 0..=legs.len() {
            let mut captures: Vec<Vec<u8>> =
                legs.map(|leg| capture(leg, 1_000, 0, |_| false)).into();
            captures.insert(which, switched_off(Leg::FR));
            let left: Vec<_> = (captures.iter())
                .map(|bytes| Arc::new(AtomicUsize::new(bytes.len())))
                .collect();
            let readers = captures.into_iter().zip(&left).map(|(bytes, left)| {
                let reader: Box<dyn Read> =
                    Box::new(Unread(std::io::Cursor::new(bytes), left.clone()));
                reader
            });
            let input = LiveInput::Buses(readers.collect());
            let mut live = LiveRows::follow(Path::new("buses"), input, &Model::go2()).unwrap();
            let count = rows(&mut live).len();
            assert!((380..=400).contains(&count), "{which}: {count}");
            for left in left {
                let left = left.load(Ordering::Relaxed);
                assert!(left < 20_000, "{which}: {left} bytes");
            }
        }
    }
}
