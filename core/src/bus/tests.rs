//! Captured frames, noise, arbitrary bytes.

use std::vec::Vec;

use proptest::prelude::*;

use super::crc::{SEED_GO2, SEED_STANDALONE, checksum};
use super::*;

/// The frames in `bytes`, and how many bytes at its end may still become one.
fn decode_and_wait(decoder: &mut Decoder, bytes: &[u8]) -> (Vec<Frame>, usize) {
    let mut rest = bytes;
    let frames = core::iter::from_fn(|| decoder.next(&mut rest, &mut { usize::MAX }));
    let frames = frames.collect();
    (frames, rest.len())
}

fn decode(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Frame> {
    decode_and_wait(decoder, bytes).0
}

fn command(bytes: [u8; 17]) -> Command {
    match decode(&mut Decoder::new(), &bytes)[..] {
        [Frame::Command(command)] => command,
        ref other => panic!("{other:?}"),
    }
}

/// The captured frames of go2.md.
#[test]
fn captured_commands() {
    let bytes = [
        0xFE, 0xEE, 0x11, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xB4, 0, 0x37, 0xC1,
    ];
    let go2 = command(bytes);
    assert_eq!(
        (go2.mode.id(), go2.mode.status(), go2.k_spd),
        (1, Status::Foc, 180)
    );
    assert_eq!(go2.encode(SEED_GO2), bytes);

    let zeros = [
        0xFE, 0xEE, 0x10, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xB5, 0x79,
    ];
    assert_eq!(
        command(zeros),
        Command {
            mode: Mode::foc(0),
            ..Command::default()
        }
    );
    assert_eq!(command(zeros).encode(SEED_STANDALONE), zeros);

    let speed = [
        0xFE, 0xEE, 0x10, 0, 0, 0xAD, 0xF9, 0, 0, 0, 0, 0, 0, 0x0C, 0, 0xEA, 0x33,
    ];
    assert_eq!((command(speed).speed, command(speed).k_spd), (-1619, 12));
    assert_eq!(command(speed).encode(SEED_STANDALONE), speed);

    let torque = [
        0xFE, 0xEE, 0x11, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xD8, 0xD2,
    ];
    assert_eq!(
        (command(torque).mode.id(), command(torque).torque),
        (1, 128)
    );
    assert_eq!(command(torque).encode(SEED_STANDALONE), torque);
}

#[test]
fn captured_reply() {
    let bytes = [
        0xFD, 0xEE, 0x11, 0x9A, 0xFF, 0xAD, 0xF9, 0, 0xC0, 0xFF, 0xFF, 0x1E, 0xA1, 0x1F, 0x51, 0x9D,
    ];
    let [Frame::Reply(reply)] = decode(&mut Decoder::new(), &bytes)[..] else {
        panic!()
    };
    assert_eq!((reply.mode.id(), reply.temperature), (1, 30));
    assert_eq!((reply.error(), reply.foot_pressure()), (1, 1012));
    assert!((reply.joint_torque(1.0) + 0.3984).abs() < 1e-4);
    assert!((reply.joint_velocity(1.0) + 39.736).abs() < 1e-3);
    assert!((reply.joint_position(1.0) + core::f64::consts::PI).abs() < 1e-4);
    assert_eq!(reply.encode(SEED_STANDALONE), bytes);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_frame_cut_short_hides_nothing() {
    let whole = Reply {
        mode: Mode::foc(2),
        position: 1234,
        ..Reply::default()
    };
    for cut in 1..Reply::LEN {
        let mut bytes = whole.encode(SEED_STANDALONE)[..cut].to_vec();
        bytes.extend(whole.encode(SEED_STANDALONE));
        let mut decoder = Decoder::new();
        assert_eq!(
            decode(&mut decoder, &bytes),
            [Frame::Reply(whole)],
            "cut at {cut}"
        );
        let counters = decoder.counters();
        assert_eq!(counters.skipped_bytes as usize, cut);
        assert_eq!(counters.short + counters.bad_crc, u32::from(cut > 1));
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_byte_lost_from_the_end_is_a_short_frame() {
    let frame = Reply {
        mode: Mode::foc(0),
        ..Reply::default()
    }
    .encode(SEED_STANDALONE);
    let mut decoder = Decoder::new();
    let cut = &frame[..Reply::LEN - 1];
    decode(&mut decoder, &[&frame, cut, &frame].concat());
    let counters = decoder.counters();
    assert_eq!(
        (counters.replies, counters.short, counters.bad_crc),
        (2, 1, 0)
    );
}

#[test]
fn quantities_that_do_not_fit_are_refused() {
    use super::EncodeError::{NotFinite, OutOfRange};
    let reply = |q, dq, tau| Reply::from_joint(Mode::foc(0), 6.333, q, dq, tau, 25);
    assert_eq!(reply(f64::NAN, 0.0, 0.0), Err(NotFinite));
    assert_eq!(reply(0.0, 1e3, 0.0), Err(OutOfRange));
    assert_eq!(reply(0.0, 0.0, -1e3), Err(OutOfRange));
    assert_eq!(reply(1e9, 0.0, 0.0), Err(OutOfRange));
}

fn any_command() -> impl Strategy<Value = Command> {
    any::<(u8, i16, i16, i32, u16, u16)>().prop_map(
        |(mode, torque, speed, position, k_pos, k_spd)| Command {
            mode: Mode(mode),
            torque,
            speed,
            position,
            k_pos,
            k_spd,
        },
    )
}

fn any_reply() -> impl Strategy<Value = Reply> {
    any::<(u8, i16, i16, i32, i8, u16)>().prop_map(
        |(mode, torque, speed, position, temperature, flags)| Reply {
            mode: Mode(mode),
            torque,
            speed,
            position,
            temperature,
            flags,
        },
    )
}

/// Either frame, as itself and as bytes.
fn any_frame(seed: u16) -> impl Strategy<Value = (Frame, Vec<u8>)> {
    prop_oneof![
        any_command().prop_map(move |c| (Frame::Command(c), c.encode(seed).to_vec())),
        any_reply().prop_map(move |r| (Frame::Reply(r), r.encode(seed).to_vec())),
    ]
}

/// Bytes between frames, with more headers in them than chance gives.
fn garbage() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(
        prop_oneof![any::<u8>(), Just(0xFE), Just(0xFD), Just(0xEE)],
        0..16,
    )
}

/// Whether noise made a frame with a good CRC at `at`; one false header in 65536 does.
fn chance_frame(bytes: &[u8], at: usize) -> bool {
    let length = match bytes[at..] {
        [0xFE, 0xEE, ..] => Command::LEN,
        [0xFD, 0xEE, ..] => Reply::LEN,
        _ => return false,
    };
    let Some((body, crc)) = bytes
        .get(at..at + length)
        .and_then(|b| b.split_last_chunk())
    else {
        return false;
    };
    checksum(SEED_GO2, body) == u16::from_le_bytes(*crc)
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn every_good_frame_in_garbage_is_found(
        parts in proptest::collection::vec((garbage(), any_frame(SEED_GO2)), 1..20)
    ) {
        let mut decoder = Decoder::new();
        // One clean frame of each sender fixes the seeds.
        decode(&mut decoder, &Command::default().encode(SEED_GO2));
        for id in 0..16 {
            decode(&mut decoder, &Reply { mode: Mode(id), ..Reply::default() }.encode(SEED_GO2));
        }
        let before = decoder.counters();
        prop_assert_eq!((before.commands, before.replies, before.skipped_bytes), (1, 16, 0));

        let (mut stream, mut sent, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for (garbage, (frame, bytes)) in &parts {
            stream.extend(garbage);
            starts.push(stream.len());
            stream.extend(bytes);
            sent.push(*frame);
        }
        // A false header just before the end waits for bytes that open nothing.
        stream.extend([0; 18]);
        prop_assume!((0..stream.len()).all(|at| starts.contains(&at) || !chance_frame(&stream, at)));
        let (found, waiting) = decode_and_wait(&mut decoder, &stream);
        prop_assert_eq!(found, sent);
        let after = decoder.counters();
        let good = 17 * (after.commands - 1) + 16 * (after.replies - 16);
        prop_assert_eq!(stream.len(), (good + after.skipped_bytes) as usize + waiting);
    }

    #[test]
    fn pieces_give_what_the_whole_gives(
        parts in proptest::collection::vec((garbage(), any_frame(SEED_GO2), 0..3usize), 1..20),
        cuts in proptest::collection::vec(1..60usize, 1..30),
        efforts in proptest::collection::vec(1..60usize, 1..30),
    ) {
        let mut stream = Vec::new();
        for (garbage, (_, bytes), keep) in &parts {
            // A third of the frames undisturbed, a third after garbage, a third cut short.
            stream.extend(garbage.iter().filter(|_| *keep == 1));
            stream.extend(&bytes[..bytes.len() - usize::from(*keep == 2)]);
        }
        let (mut whole, mut pieces) = (Decoder::new(), Decoder::new());
        let (mut frames, mut waiting, mut arrived) = (Vec::new(), 0, 0);
        for (cut, effort) in cuts.iter().cycle().zip(efforts.iter().cycle()) {
            arrived = stream.len().min(arrived + cut);
            let mut rest = &stream[waiting..arrived];
            let mut effort = *effort;
            frames.extend(core::iter::from_fn(|| pieces.next(&mut rest, &mut effort)));
            let taken = arrived - waiting - rest.len();
            waiting += taken;
            if arrived == stream.len() && taken == 0 {
                break;
            }
        }
        prop_assert_eq!((frames, stream.len() - waiting), decode_and_wait(&mut whole, &stream));
        prop_assert_eq!(whole.counters(), pieces.counters());
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn no_bytes_panic_and_every_byte_is_accounted_for(
        bytes in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0xFE), Just(0xFD), Just(0xEE)], 0..400)
    ) {
        let mut decoder = Decoder::new();
        let (_, waiting) = decode_and_wait(&mut decoder, &bytes);
        let counters = decoder.counters();
        let good = 17 * counters.commands + 16 * counters.replies;
        prop_assert_eq!(bytes.len(), (good + counters.skipped_bytes) as usize + waiting);
        prop_assert!(waiting <= 17);
    }

    #[test]
    fn joint_side_quantities_survive_to_half_a_quantum(
        q in -4.0..4.0, dq in -20.0..20.0, tau in -40.0..40.0, calf: bool
    ) {
        let gear = if calf { 12.13825 } else { 6.333 };
        let reply = Reply::from_joint(Mode::foc(1), gear, q, dq, tau, 30)?;
        prop_assert!((reply.joint_position(gear) - q).abs() <= 0.5001 * POSITION_QUANTUM / gear);
        prop_assert!((reply.joint_velocity(gear) - dq).abs() <= 0.5001 * VELOCITY_QUANTUM / gear);
        prop_assert!((reply.joint_torque(gear) - tau).abs() <= 0.5001 * gear / 256.0);
    }
}

const POSITION_QUANTUM: f64 = core::f64::consts::TAU / 32768.0;
const VELOCITY_QUANTUM: f64 = core::f64::consts::TAU / 256.0;
