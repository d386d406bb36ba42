//! Nothing is lost silently: a bus whose bytes are corrupted, dropped, duplicated and whose frames are cut short.
//!
//! What reached the listener is known byte by byte, so every count has an exact value: the frames, the bytes between them
//! and the false headers that a scan of the whole stream finds, the cycles of which all three replies came through, and the
//! samples made of them.

use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE, checksum};
use proprio_core::bus::{Command, Reply};
use proprio_core::go2::{LEGS, Leg};
use proprio_core::wire::{Counters, DeviceMessage, Estimate, LegCounters};
use proprio_host::device::replay::cycle;
use proprio_host::device::{BusStep, Desktop, Device};
use proprio_tests::motion;

/// Samples before the noise, in it, and after it.
const QUIET: u64 = 500;
const NOISY: u64 = 500;
const AFTER: u64 = 5_000;

/// SplitMix64: the same noise on every machine.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn happens(&mut self, share: f64) -> bool {
        (self.next() >> 11) as f64 / ((1u64 << 53) as f64) < share
    }

    /// `frame` after a bus that spoils each byte with probability `share`.
    fn spoil(&mut self, frame: &[u8], share: f64) -> Vec<u8> {
        let mut out = Vec::new();
        for &byte in frame {
            if !self.happens(share) {
                out.push(byte);
                continue;
            }
            match self.next() % 8 {
                0..=2 => out.push(byte ^ (1 + self.next() % 255) as u8),
                3..=4 => {}
                5..=6 => out.extend([byte, byte]),
                _ => break,
            }
        }
        out
    }
}

/// What a scan of all that was delivered finds.
#[derive(Default, Debug, PartialEq, Eq)]
struct Found {
    commands: u32,
    replies: u32,
    false_headers: u32,
    skipped_bytes: u32,
}

/// The frames with a good CRC, first come, first served.
fn scan(stream: &[u8]) -> (Found, Vec<(usize, usize)>) {
    let (mut found, mut spans, mut at) = (Found::default(), Vec::new(), 0);
    while at < stream.len() {
        let (length, seed) = match stream[at..] {
            [0xFE, 0xEE, ..] => (Command::LEN, SEED_GO2),
            [0xFD, 0xEE, ..] => (Reply::LEN, SEED_STANDALONE),
            _ => (0, 0),
        };
        let frame = stream.get(at..at + length).unwrap_or_default();
        match frame.split_last_chunk() {
            Some((body, crc)) if checksum(seed, body) == u16::from_le_bytes(*crc) => {
                let kind = if length == Reply::LEN {
                    &mut found.replies
                } else {
                    &mut found.commands
                };
                *kind += 1;
                spans.push((at, at + length));
                at += length;
                continue;
            }
            Some(_) => found.false_headers += 1,
            None => {}
        }
        found.skipped_bytes += 1;
        at += 1;
    }
    (found, spans)
}

/// One leg's bus: all that was delivered, step by step, and which cycles' replies all came through.
struct Bus {
    steps: Vec<Vec<u8>>,
    /// Where each undamaged frame lies in the whole stream.
    intact: Vec<(usize, usize)>,
    whole_cycles: u32,
}

fn bus(leg: Leg, share: f64) -> Bus {
    let mut noise = Noise(leg.index() as u64 + 1);
    let mut bus = Bus {
        steps: Vec::new(),
        intact: Vec::new(),
        whole_cycles: 0,
    };
    let mut at = 0;
    for n in 1..=QUIET + NOISY + AFTER {
        let share = if (QUIET..QUIET + NOISY).contains(&n) {
            share
        } else {
            0.0
        };
        let (mut step, mut replies, bytes) =
            (Vec::new(), 0, cycle(leg, &motion::sample(leg, n)).unwrap());
        let mut rest = bytes.as_slice();
        while !rest.is_empty() {
            let length = if rest.starts_with(&Reply::HEADER) {
                Reply::LEN
            } else {
                Command::LEN
            };
            let (frame, after) = rest.split_at(length);
            rest = after;
            let delivered = noise.spoil(frame, share);
            if let Some(offset) = delivered.windows(length).position(|w| w == frame) {
                bus.intact
                    .push((at + step.len() + offset, at + step.len() + offset + length));
                replies += u32::from(length == Reply::LEN);
            }
            step.extend(delivered);
        }
        at += step.len();
        bus.whole_cycles += u32::from(replies == 3);
        bus.steps.push(step);
    }
    // Bytes that open nothing, so that no false header waits for more.
    bus.steps.push(vec![0; 18]);
    bus
}

/// Plays the buses; all estimates, and the last counters.
fn play(buses: &[Bus; LEGS]) -> (Vec<Estimate>, Counters) {
    let mut device = Desktop::<f64>::new();
    let (mut estimates, mut counters) = (Vec::new(), Counters::default());
    let silence = 300;
    for n in 0..buses[0].steps.len() + silence {
        let brought = buses
            .each_ref()
            .map(|bus| bus.steps.get(n).cloned().unwrap_or_default());
        let step = BusStep {
            time_us: (n as u64 + 1) * motion::SAMPLE_US,
            buses: brought,
        };
        let mut told = |message| match message {
            DeviceMessage::Estimate(estimate) => estimates.push(estimate),
            DeviceMessage::Counters(latest) => counters = latest,
            _ => {}
        };
        device.play(&step, &mut told).unwrap();
    }
    (estimates, counters)
}

fn check_counts(leg: Leg, bus: &Bus, counted: &LegCounters, share: f64) {
    let stream = bus.steps.concat();
    let (found, spans) = scan(&stream);
    let counted_frames = Found {
        commands: counted.commands,
        replies: counted.replies,
        false_headers: counted.bad_crc + counted.short,
        skipped_bytes: counted.skipped_bytes,
    };
    assert_eq!(counted_frames, found, "{leg:?} at {share}");
    for &(start, end) in &bus.intact {
        let used = spans.binary_search(&(start, end)).is_ok();
        // Bytes of a damaged frame and of the next one may make a good frame by chance.
        let overlapped = || spans.iter().any(|&(s, e)| s < end && start < e);
        assert!(
            used || overlapped(),
            "{leg:?} at {share}: a good frame at {start} was not used"
        );
    }
    let lost = bus.intact.len() as i64 - i64::from(found.commands + found.replies);
    assert!(
        lost.abs() <= 3,
        "{leg:?} at {share}: {lost} frames by chance"
    );
    assert!(
        (counted.samples as i64 - bus.whole_cycles as i64).abs() <= 3,
        "{leg:?} at {share}"
    );
    let waiting = counted.replies - 3 * counted.samples - counted.unused_replies;
    assert!(
        waiting <= 2,
        "{leg:?} at {share}: {waiting} replies unaccounted for"
    );
    assert_eq!(
        counted.samples,
        counted.used + counted.late + counted.rejected
    );
    assert_eq!((counted.unfolded, counted.unsolved), (0, 0));
}

fn last(estimates: &[Estimate], leg: Leg) -> &Estimate {
    estimates
        .iter()
        .rfind(|estimate| usize::from(estimate.leg) == leg.index())
        .unwrap()
}

#[test]
fn noise_is_counted_and_survived() {
    let mut clean: Option<Vec<Estimate>> = None;
    for share in [0.0, 0.01, 0.05, 0.1, 0.2] {
        let buses = Leg::ALL.map(|leg| bus(leg, share));
        let (estimates, counters) = play(&buses);
        for leg in Leg::ALL {
            check_counts(leg, &buses[leg.index()], &counters.legs[leg.index()], share);
        }
        for estimate in &estimates {
            assert!(estimate.values.iter().all(|v| v.is_finite()), "at {share}");
            assert!(
                estimate.std.iter().all(|s| s.is_finite() && *s > 0.0),
                "at {share}"
            );
        }
        let clean = clean.get_or_insert_with(|| estimates.clone());
        for leg in Leg::ALL {
            let (noisy, clean) = (last(&estimates, leg), last(clean, leg));
            let rows = noisy.values.iter().zip(&clean.values).zip(&clean.std);
            for (n, ((value, right), std)) in rows.enumerate() {
                let off = (value - right).abs();
                // What the clean data themselves do not know to 2 %: within what they do know.
                let close = off <= 0.02 * right.abs() || off <= *std;
                assert!(
                    close,
                    "{leg:?} at {share}, parameter {n}: {value} instead of {right} ± {std}"
                );
            }
        }
    }
}
