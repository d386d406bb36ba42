//! Simulated captures, whose content is known.

use proprio_core::bus::crc::SEED_GO2;
use proprio_core::bus::{Command, Mode, Reply, position_counts};
use proprio_core::go2::ACTUATORS;

use super::*;
use crate::device::serial::BUS_BAUD;

/// Counts at which a leg's third motor is bent by what a calf can be.
fn calf(id: u8) -> i32 {
    match id {
        2 => position_counts(ACTUATORS[2].gear, -1.5).unwrap(),
        _ => 0,
    }
}

/// A capture of `cycles` cycles of 2 ms, motors 3, 1 and 2 in this order; motor 2 has another seed and 30 µs turn-around, the
/// others 20 µs. `change` may change a reply's bytes.
fn capture(cycles: u64, change: impl Fn(u64, u8, &mut Vec<u8>)) -> Vec<u8> {
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    for n in 0..cycles {
        let mut time_us = 5_000 + 2_000 * n;
        for (id, seed, turnaround_us) in [(3, 0, 20), (1, 0, 20), (2, 0xBEEF, 30)] {
            let mode = Mode::foc(id);
            let command = Command {
                mode,
                ..Command::default()
            };
            time_us += 43;
            writer.record(time_us, &command.encode(SEED_GO2)).unwrap();
            let reply = Reply {
                mode,
                position: calf(id) + n as i32,
                temperature: 30 + id as i8,
                ..Reply::default()
            };
            let mut bytes = reply.encode(seed).to_vec();
            change(n, id, &mut bytes);
            time_us += turnaround_us + 40;
            // Of no bytes there is no record.
            writer.record(time_us, &bytes).unwrap();
        }
    }
    writer.finish().unwrap()
}

fn explained(bytes: &[u8]) -> Explanation {
    explain(&mut CaptureReader::new(bytes, "test".to_owned()).unwrap()).unwrap()
}

#[test]
fn ids_order_rate_turnaround_and_seeds_are_told() {
    let said = explained(&capture(1000, |_, _, _| {}));
    // Of an unknown seed the fourth reply is the first that is believed.
    assert_eq!((said.commands, said.replies), (3000, 2997));
    assert_eq!((said.bad_crc, said.skipped_bytes), (3, 48));
    assert_eq!(
        (said.order.as_slice(), said.period_us),
        (&[3, 1, 2][..], Some(2000))
    );
    assert_eq!(said.command_seed, Some(SEED_GO2));
    let seeds: Vec<_> = said
        .motors
        .iter()
        .map(|motor| (motor.id, motor.seed))
        .collect();
    assert_eq!(seeds, [(1, Some(0)), (2, Some(0xBEEF)), (3, Some(0))]);
    for (motor, turnaround) in said.motors.iter().zip([20, 30, 20]) {
        let times = motor.turnaround.unwrap();
        assert_eq!(
            (times.least, times.median, times.greatest),
            (turnaround, turnaround, turnaround)
        );
        assert_eq!(motor.temperature, [30 + motor.id as i8; 2]);
        assert_eq!(motor.errors[1..], [0; 7]);
    }
    let offsets: Vec<_> = said.motors.iter().map(|motor| motor.offset_us).collect();
    assert_eq!(offsets, [Some(103), Some(216), Some(0)]);
    // The first three of an unknown seed, and the first cycles of unknown ids.
    assert!((993..=997).contains(&said.cycles), "{}", said.cycles);
    assert!(
        said.used > 0.99 && said.warnings.is_empty(),
        "{:?}",
        said.warnings
    );
    assert!((said.busy - 99.0 * 2.5e-6 / 2e-3).abs() < 1e-3);
}

#[test]
fn faults_and_damage_are_told() {
    let said = explained(&capture(1000, |n, id, bytes| match (n % 10, id) {
        (5, 1) => {
            let reply = Reply {
                mode: Mode::foc(1),
                flags: 4,
                ..Reply::default()
            };
            *bytes = reply.encode(0).to_vec();
        }
        (7, 3) => bytes[5] ^= 0x40,
        _ => {}
    }));
    assert_eq!((said.bad_crc + said.short, said.motor_faults), (103, 100));
    assert_eq!(said.motors[0].errors, [900, 0, 0, 0, 100, 0, 0, 0]);
    assert!((790..800).contains(&said.cycles), "{}", said.cycles);
    let warned = |part: &str| said.warnings.iter().any(|warning| warning.contains(part));
    assert!(
        warned("% of the replies") && warned("% of the bytes"),
        "{:?}",
        said.warnings
    );
}

/// The levels of a line that carries a capture's bytes, bit by bit: high where it is idle, start bit low, bits from the lowest, stop bit high.
fn levels(capture: &[u8]) -> Vec<bool> {
    let mut reader = CaptureReader::new(capture, "test".to_owned()).unwrap();
    let bits_of = |us: u64| us as usize * BUS_BAUD as usize / 1_000_000;
    let mut line = Vec::new();
    while let Some(record) = reader.next_record().unwrap() {
        let begin = bits_of(record.time_us) - 10 * record.bytes.len();
        line.resize(begin, true);
        for byte in record.bytes {
            line.push(false);
            line.extend((0..8).map(|bit| byte >> bit & 1 == 1));
            line.push(true);
        }
    }
    line.resize(line.len() + 100, true);
    line
}

/// What a UART makes of a line, as a capture: it waits for a falling edge and looks at the middle of each bit, which it takes to be `bit` of the
/// line's long. A byte whose stop bit is low is kept, as Linux keeps it of a raw port, and the next may begin with that bit.
fn received(line: &[bool], bit: f64) -> Vec<u8> {
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    let mut at = 1;
    while at < line.len() {
        if !line[at - 1] || line[at] {
            at += 1;
            continue;
        }
        let middle = |n: u8| at + ((f64::from(n) + 0.5) * bit) as usize;
        let level = |n: u8| line.get(middle(n)).copied().unwrap_or(true);
        let byte = (0..8).fold(0, |byte, n| byte | u8::from(level(1 + n)) << n);
        at = middle(9);
        let time_us = at as u64 * 1_000_000 / u64::from(BUS_BAUD);
        writer.record(time_us, &[byte]).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn a_and_b_that_are_swapped_are_told() {
    let cycles = 100;
    // A leg at rest, and one whose numbers are all but arbitrary.
    let changes: [fn(u64, u8, &mut Vec<u8>); 2] = [
        |_, _, _| {},
        |n, id, bytes| {
            let some = (n * 0x9E37_79B9 + u64::from(id) * 0x85EB_CA6B).to_le_bytes();
            bytes[3..11].copy_from_slice(&some);
        },
    ];
    for change in changes {
        let right = levels(&capture(cycles, change));
        let said = explained(&received(&right, 1.0));
        assert_eq!(u64::from(said.commands), 3 * cycles);
        assert!(said.swapped_headers < 10, "{}", said.swapped_headers);
        // Swapped, a receiver takes a line that nobody drives for low or, being fail-safe, for high.
        let low: Vec<bool> = right.iter().map(|level| !level).collect();
        let mut high = low.clone();
        for idle in high
            .chunk_by_mut(|a, b| a == b)
            .filter(|run| run.len() > 10)
        {
            idle.fill(true);
        }
        for swapped in [low, high] {
            let said = explained(&received(&swapped, 1.0));
            let warned = &said.warnings[0];
            assert!(warned.contains("A and B are swapped"), "{warned}");
            assert!(
                said.swapped_headers >= 3 * cycles,
                "{}",
                said.swapped_headers
            );
        }
        // Nor is another baud rate taken for that.
        for bit in [0.25, 0.5, 0.75, 4.0 / 3.0, 2.0] {
            let said = explained(&received(&right, bit));
            let warned = &said.warnings[0];
            assert!(warned.contains("check the baud rate"), "{bit}: {warned}");
        }
    }
}

#[test]
fn a_wrong_baud_rate_and_silence_are_told() {
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    let garbage: Vec<u8> = (0..5000u32).map(|n| ((n * n * 31) >> 3) as u8).collect();
    writer.record(1000, &garbage).unwrap();
    let said = explained(&writer.finish().unwrap());
    assert!(
        said.warnings[0].contains("check the baud rate"),
        "{:?}",
        said.warnings
    );
    let said = explained(
        &CaptureWriter::new(Vec::new(), BUS_BAUD)
            .unwrap()
            .finish()
            .unwrap(),
    );
    assert!(
        said.warnings[0].contains("nothing was captured"),
        "{:?}",
        said.warnings
    );
}

#[test]
fn a_capture_that_was_cut_gives_its_whole_records() {
    let whole = capture(20, |_, _, _| {});
    for cut in (0..whole.len()).step_by(7) {
        match CaptureReader::new(&whole[..cut], "test".to_owned()) {
            Ok(mut reader) => {
                let mut records = 0;
                while let Some(record) = reader.next_record().unwrap() {
                    assert!(!record.bytes.is_empty());
                    records += 1;
                }
                assert!(records <= 120);
            }
            Err(error) => assert!(matches!(error, CaptureError::NotACapture(_)) && cut < 40),
        }
    }
}

#[test]
fn other_files_and_versions_are_refused() {
    let refused = |text: &str| {
        CaptureReader::new(text.as_bytes(), "test".to_owned())
            .err()
            .unwrap()
    };
    for text in [
        "",
        "t,q/FR_hip\n0,0\n",
        "proprio capture 1 baud=0\n",
        "proprio capture one baud=4\n",
    ] {
        assert!(
            matches!(refused(text), CaptureError::NotACapture(_)),
            "{text}"
        );
    }
    let newer = refused("proprio capture 2 baud=4000000\n");
    assert!(
        matches!(newer, CaptureError::Version { version: 2, .. }),
        "{newer}"
    );
}

/// Through a real serial line of the operating system, a pair of pseudo-terminals.
#[cfg(unix)]
#[test]
fn what_a_port_brings_is_recorded() {
    use serialport::{SerialPort, TTYPort};
    let (mut master, mut slave) = TTYPort::pair().unwrap();
    slave
        .set_timeout(std::time::Duration::from_millis(1))
        .unwrap();
    let sent: Vec<u8> = (0..=255).collect();
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    master.write_all(&sent).unwrap();
    let captured = record(&mut slave, &mut writer, Instant::now(), |captured| {
        captured.bytes < 256
    })
    .unwrap();
    assert_eq!(captured.bytes, 256);
    let bytes = writer.finish().unwrap();
    let mut reader = CaptureReader::new(bytes.as_slice(), "test".to_owned()).unwrap();
    let mut heard = Vec::new();
    let mut last_us = 0;
    while let Some(record) = reader.next_record().unwrap() {
        assert!(record.time_us >= last_us);
        last_us = record.time_us;
        heard.extend(record.bytes);
    }
    assert_eq!(heard, sent);
}

/// A capture as an adapter hands it over whose timer ends each `timer_us`, or whose buffer holds `full` bytes.
fn handed_over(capture: &[u8], timer_us: u64, full: usize) -> Vec<u8> {
    let mut reader = CaptureReader::new(capture, "test".to_owned()).unwrap();
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    let (mut waiting, mut ends_us) = (Vec::new(), timer_us);
    while let Some(record) = reader.next_record().unwrap() {
        while record.time_us > ends_us {
            if !waiting.is_empty() {
                writer.record(ends_us, &waiting).unwrap();
                waiting.clear();
            }
            ends_us += timer_us;
        }
        waiting.extend(record.bytes);
        while waiting.len() >= full {
            let early: Vec<u8> = waiting.drain(..full).collect();
            writer.record(record.time_us, &early).unwrap();
            ends_us = record.time_us + timer_us;
        }
    }
    writer.record(ends_us, &waiting).unwrap();
    writer.finish().unwrap()
}

#[test]
fn an_adapter_that_waits_gives_no_rate_and_its_timer_is_named() {
    let whole = capture(1000, |_, _, _| {});
    for timer_ms in [5, 8, 16, 40, 100, 255] {
        for full in [usize::MAX, 4096, 510, 62 * 10] {
            let said = explained(&handed_over(&whole, 1000 * timer_ms, full));
            let grouped = said.grouped.unwrap_or_else(|| panic!("{timer_ms} {full}"));
            if full == usize::MAX {
                assert_eq!(grouped.every_ms, Some(timer_ms as u32));
                // The first and the last piece are shorter.
                let share = grouped.cycles / (timer_ms as f64 / 2.0);
                assert!((0.9..1.1).contains(&share), "{timer_ms} ms: {share}");
            }
            assert_eq!((said.period_us, said.cycles, said.used), (None, 0, 0.0));
            assert!(said.order.is_empty());
            for motor in &said.motors {
                assert_eq!((motor.turnaround, motor.offset_us), (None, None));
            }
            // That is all that is wrong.
            let [warning] = said.warnings.as_slice() else {
                panic!("{timer_ms} {full}: {:?}", said.warnings);
            };
            assert!(warning.contains("latency_timer"), "{warning}");
        }
    }
}

#[test]
fn pieces_that_have_the_times_of_their_frames_are_not_taken_for_an_adapters() {
    let whole = capture(1000, |_, _, _| {});
    let timed = |bytes: &[u8], period_us: std::ops::RangeInclusive<u32>, what: &str| {
        let said = explained(bytes);
        assert_eq!(said.grouped, None, "{what}");
        assert!(
            said.period_us
                .is_some_and(|period| period_us.contains(&period)),
            "{what}"
        );
        let has_timer = |warning: &String| warning.contains("latency_timer");
        assert!(!said.warnings.iter().any(has_timer), "{what}");
    };
    // Each frame on its own, a timer of 1 ms, and packets of 62 bytes.
    timed(&whole, 1999..=2001, "frames");
    timed(&handed_over(&whole, 1000, usize::MAX), 1990..=2010, "1 ms");
    timed(&handed_over(&whole, 1000, 62), 1950..=2050, "62 bytes");
    // A reader that waited once for 0.3 s.
    let (mut stalled, mut waiting) = (
        CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap(),
        Vec::new(),
    );
    let mut reader = CaptureReader::new(whole.as_slice(), "test".to_owned()).unwrap();
    while let Some(record) = reader.next_record().unwrap() {
        waiting.extend(record.bytes);
        if !(600_000..900_000).contains(&record.time_us) {
            for part in waiting.chunks(4096) {
                stalled.record(record.time_us, part).unwrap();
            }
            waiting.clear();
        }
    }
    timed(&stalled.finish().unwrap(), 1990..=2010, "stalled");
    // A bus without pauses that is read 4096 bytes at a time: the rate of the line says when each byte came.
    let mut reader = CaptureReader::new(whole.as_slice(), "test".to_owned()).unwrap();
    let mut bytes = Vec::new();
    while let Some(record) = reader.next_record().unwrap() {
        bytes.extend(record.bytes);
    }
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    let mut sent = 0;
    for part in bytes.chunks(4096) {
        sent += part.len() as u64;
        writer.record(1_000 + sent * 5 / 2, part).unwrap();
    }
    timed(&writer.finish().unwrap(), 246..=249, "without pauses");
}

/// Numbers that follow no rule.
fn any(n: u64, id: u8, k: u64) -> u64 {
    let mut x = n.wrapping_mul(64).wrapping_add(u64::from(id) * 16 + k + 1);
    // SplitMix64 (Steele, Lea & Flood 2014).
    x = x.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ x >> 31
}

/// What seals a body, of a cycle and an id.
type Seal = fn(u64, u8, &[u8]) -> u16;
/// What becomes of a reply, of a cycle and an id.
type Damage = fn(u64, u8, &mut Vec<u8>);

#[test]
fn another_checksum_is_no_damage_and_damage_no_other_checksum() {
    use proprio_core::bus::crc::checksum;
    let reseal = |bytes: &mut Vec<u8>, crc: u16| bytes[14..].copy_from_slice(&crc.to_le_bytes());
    // A seed of each frame's own, one that changes every fifth, a sum, and an exclusive or of all bytes.
    let kinds: [Seal; 4] = [
        |n, id, body| checksum(any(n, id, 0) as u16, body),
        |n, id, body| checksum(any(n / 5, id, 0) as u16, body),
        |n, _, body| {
            let sum = body.iter().map(|byte| u16::from(*byte));
            sum.sum::<u16>().wrapping_mul(251) ^ (n as u16) << 7
        },
        |_, id, body| checksum(checksum(0x1234, body), &[&body[3..], &[id]].concat()),
    ];
    for (kind, seal) in kinds.into_iter().enumerate() {
        for ids in [&[1, 2, 3][..], &[3][..]] {
            let said = explained(&capture(1000, |n, id, bytes| {
                if ids.contains(&id) {
                    let crc = seal(n, id, &bytes[..14]);
                    reseal(bytes, crc);
                }
            }));
            let found: Vec<u8> = said
                .other_checksum_motors
                .iter()
                .map(|other| other.id)
                .collect();
            assert_eq!(found, ids, "{kind}");
            assert_eq!(said.other_checksum_commands, None);
            let [warning] = said.warnings.as_slice() else {
                panic!("{kind} {ids:?}: {:?}", said.warnings);
            };
            assert!(
                warning.contains("replies carry another checksum"),
                "{warning}"
            );
        }
    }
    // Damage: of one bit in a share of the replies or in all, of all bits, of a frame's end, of a frame's length; and a robot at rest.
    let damages: [(&str, Damage); 11] = [
        ("none", |_, _, _| {}),
        ("1 %", |n, id, bytes| flip(n, id, bytes, 1)),
        ("20 %", |n, id, bytes| flip(n, id, bytes, 20)),
        ("60 %", |n, id, bytes| flip(n, id, bytes, 60)),
        ("100 %", |n, id, bytes| flip(n, id, bytes, 100)),
        ("noise", |n, id, bytes| {
            for (k, byte) in bytes.iter_mut().enumerate() {
                let hit = any(n, id, k as u64);
                *byte ^= if hit.is_multiple_of(4) {
                    1 << (hit >> 8 & 7)
                } else {
                    0
                };
            }
        }),
        ("last byte high", |_, _, bytes| bytes[15] = 0xFF),
        ("last byte any", |n, id, bytes| {
            bytes[15] = any(n, id, 0) as u8
        }),
        ("last bytes low", |_, _, bytes| bytes[14..].fill(0)),
        ("last byte lost", |_, _, bytes| bytes.truncate(15)),
        ("silent", |_, id, bytes| {
            if id != 1 {
                bytes.clear();
            }
        }),
    ];
    for (what, damage) in damages {
        let said = explained(&capture(1000, damage));
        assert!(said.other_checksum_motors.is_empty(), "{what}");
        assert_eq!(said.other_checksum_commands, None, "{what}");
        let warned = said
            .warnings
            .iter()
            .any(|warning| warning.contains("check ground and termination"));
        assert_eq!(
            warned,
            !["none", "1 %", "silent"].contains(&what),
            "{what}: {:?}",
            said.warnings
        );
    }
}

/// Changes a bit of so many replies in a hundred.
fn flip(n: u64, id: u8, bytes: &mut [u8], percent: u64) {
    if any(n, id, 0) % 100 < percent {
        let bit = (any(n, id, 1) % 128) as usize;
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

#[test]
fn commands_of_another_checksum_are_no_wrong_baud_rate() {
    let whole = capture(1000, |_, _, _| {});
    let mut reader = CaptureReader::new(whole.as_slice(), "test".to_owned()).unwrap();
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
    let mut n = 0;
    while let Some(mut record) = reader.next_record().unwrap() {
        n += 1;
        let end = record.bytes.len() - 2;
        record.bytes[end..].copy_from_slice(&(any(n, 0, 0) as u16).to_le_bytes());
        writer.record(record.time_us, &record.bytes).unwrap();
    }
    let said = explained(&writer.finish().unwrap());
    assert_eq!(said.other_checksum_commands, Some(3000));
    assert_eq!(said.other_checksum_motors.len(), 3);
    let [commands, replies] = said.warnings.as_slice() else {
        panic!("{:?}", said.warnings);
    };
    assert!(
        commands.contains("commands carry another checksum"),
        "{commands}"
    );
    assert!(
        replies.contains("replies carry another checksum"),
        "{replies}"
    );
}
