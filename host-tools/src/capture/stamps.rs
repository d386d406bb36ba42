//! Whether a capture's times are those of its frames. An adapter that waits for its latency timer, or a program that reads seldom, hands over
//! several polling cycles as one record: then the time between two cycles is not in the capture.

use serde::Serialize;

use super::Record;
use super::shapes::Shapes;

/// What a user does about records of several polling cycles.
pub(crate) const SET_LATENCY_TIMER: &str = "set the adapter's latency timer to 1 ms and capture again. Linux: write 1 to /sys/bus/usb-serial/devices/ttyUSB0/latency_timer, or setserial /dev/ttyUSB0 low_latency. Windows: the port's advanced settings in the device manager";

/// Frames from which on a whole capture is judged: ten cycles of a leg, three commands and three replies each.
const FEW_FRAMES: u64 = 60;
/// Frames from which on a capture is judged that goes on: 500 cycles of a leg, a second of a Go2. A reader that waits once hands over fewer.
const MANY_FRAMES: u64 = 3_000;
/// Share of the time that a bus without pauses is busy. There the rate of the line says when each byte came, to 5 % of a period.
const WITHOUT_PAUSES: f64 = 0.95;
/// Longest latency timer of an adapter, ms (FTDI AN232B-04; other makers' are no longer).
const LONGEST_MS: usize = 255;
/// Share of the records that come at one interval where a timer hands them over: all but those that a full buffer ends early.
const REGULAR: f64 = 0.8;

/// Kinds of frames in a record: commands to and replies of each id.
const KINDS: usize = 32;

/// Records of several polling cycles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Grouped {
    /// Polling cycles in such a record, mean.
    pub cycles: f64,
    /// Time from one record to the next, ms; none where there is no regular one.
    pub every_ms: Option<u32>,
}

/// Looks at records and their times.
pub(crate) struct Stamps {
    byte_ns: u32,
    shapes: Shapes,
    /// When the first and the last record ended, µs, and the bytes of all but the first.
    span_us: Option<[u64; 2]>,
    bytes: u64,
    /// Frames, and those of which their record holds another of the same kind.
    frames: u64,
    shared: u64,
    /// Records of several cycles, their cycles, and how many came after each time, ms.
    records: u64,
    cycles: u64,
    intervals: [u64; LONGEST_MS + 1],
}

impl Stamps {
    /// Of a bus whose bytes last `byte_ns`.
    pub(crate) fn new(byte_ns: u32) -> Self {
        Self {
            byte_ns,
            shapes: Shapes::default(),
            span_us: None,
            bytes: 0,
            frames: 0,
            shared: 0,
            records: 0,
            cycles: 0,
            intervals: [0; LONGEST_MS + 1],
        }
    }

    /// From the first record to the last, s.
    pub(crate) fn seconds(&self) -> f64 {
        self.span_us.map_or(0.0, |[first, last]| {
            last.saturating_sub(first) as f64 * 1e-6
        })
    }

    /// Goes on with a record, and gives `each` frame in it.
    pub(crate) fn push(&mut self, record: &Record, mut each: impl FnMut(&[u8])) {
        let mut counts = [0u64; KINDS];
        self.shapes.push(&record.bytes, |frame| {
            if let [head, _, mode, ..] = frame {
                counts[usize::from(head & 1) << 4 | usize::from(mode & 0x0F)] += 1;
            }
            each(frame);
        });
        self.frames += counts.iter().sum::<u64>();
        let most = counts.into_iter().max().unwrap_or_default();
        let before_us = self.span_us.map(|[_, last]| last);
        self.bytes += before_us.map_or(0, |_| record.bytes.len() as u64);
        self.span_us.get_or_insert([record.time_us; 2])[1] = record.time_us;
        if most < 2 {
            return;
        }
        self.shared += counts.iter().filter(|count| **count > 1).sum::<u64>();
        self.records += 1;
        self.cycles += most;
        let interval_us = before_us.map(|before| record.time_us.saturating_sub(before));
        let interval_ms = interval_us.map(|interval| ((interval + 500) / 1000) as usize);
        if let Some(count) = interval_ms.and_then(|ms| self.intervals.get_mut(ms)) {
            *count += 1;
        }
    }

    /// How the records of a whole capture hold several cycles; none where most frames have a time of their own.
    pub(crate) fn grouped(&self) -> Option<Grouped> {
        self.judge(FEW_FRAMES)
    }

    /// The same of a capture that goes on.
    pub(crate) fn grouped_so_far(&self) -> Option<Grouped> {
        self.judge(MANY_FRAMES)
    }

    fn judge(&self, least: u64) -> Option<Grouped> {
        let busy_s = self.bytes as f64 * f64::from(self.byte_ns) * 1e-9;
        let seconds = self.seconds();
        let is_busy = seconds > 0.0 && busy_s >= WITHOUT_PAUSES * seconds;
        if self.frames < least || 2 * self.shared <= self.frames || is_busy {
            return None;
        }
        Some(Grouped {
            cycles: self.cycles as f64 / self.records as f64,
            every_ms: self.interval_ms(),
        })
    }

    /// The interval of most records, to a tenth, ms.
    fn interval_ms(&self) -> Option<u32> {
        let near = |ms: usize| {
            let off = (ms / 10).max(1);
            let about = self
                .intervals
                .get(ms.saturating_sub(off)..=(ms + off).min(LONGEST_MS));
            about.unwrap_or_default().iter().sum::<u64>()
        };
        let (ms, _) = self
            .intervals
            .iter()
            .enumerate()
            .skip(1)
            .max_by_key(|(_, count)| **count)?;
        // The first record comes after no other.
        let all = self.records.saturating_sub(1);
        (all > 1 && near(ms) as f64 >= REGULAR * all as f64).then_some(ms as u32)
    }
}
