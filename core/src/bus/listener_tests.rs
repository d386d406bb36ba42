//! A simulated bus, whose every reply carries its cycle's number: which cycles become whole, and that none is mixed.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::println;
use std::vec::Vec;

use proptest::prelude::*;

use super::crc::{SEED_GO2, SEED_STANDALONE};
use super::*;

const BYTE_NS: u32 = 2500;
const TICK_US: u64 = 2000;
const ENDLESS: usize = usize::MAX;

/// SplitMix64: the same bus in every run.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number in 0..1.
    pub(super) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// How a leg is polled.
#[derive(Clone, Copy, Debug)]
struct Polling {
    /// Ids in the order of polling.
    order: [u8; 3],
    period_us: f64,
    /// Each cycle begins up to this much later than its turn, and so does each motor's answer to the others', µs.
    jitter_us: f64,
    answer_jitter_us: f64,
    /// From the end of one motor's reply to the next command, µs.
    pause_us: f64,
    commands: bool,
    seeds: [u16; 3],
}

impl Polling {
    const USUAL: Self = Self {
        order: [0, 1, 2],
        period_us: 2000.0,
        jitter_us: 0.0,
        answer_jitter_us: 0.0,
        pause_us: 10.0,
        commands: true,
        seeds: [SEED_STANDALONE; 3],
    };

    /// The pieces of cycle `n`, each with the time of its last byte, µs. Replies say `n` as their position.
    fn cycle(&self, n: u64, random: &mut Random) -> Vec<(f64, Vec<u8>, bool)> {
        let mut pieces = Vec::new();
        let byte_us = f64::from(BYTE_NS) * 1e-3;
        let mut time = 500.0 + n as f64 * self.period_us + self.jitter_us * random.share();
        for (place, &id) in self.order.iter().enumerate() {
            let mode = Mode::foc(id);
            time += Command::LEN as f64 * byte_us;
            if self.commands {
                let command = Command {
                    mode,
                    ..Command::default()
                };
                pieces.push((time, command.encode(SEED_GO2).to_vec(), false));
            }
            time += 20.0 + self.answer_jitter_us * random.share() + Reply::LEN as f64 * byte_us;
            let reply = Reply {
                mode,
                position: n as i32,
                torque: (random.next() % 64) as i16,
                ..Reply::default()
            };
            pieces.push((time, reply.encode(self.seeds[place]).to_vec(), true));
            time += self.pause_us;
        }
        pieces
    }
}

/// Plays `cycles` of a bus through a listener that looks every [`TICK_US`]; the cycles that it gives, by number, and itself.
/// `damage` may change or drop pieces.
fn play(
    polling: &Polling,
    cycles: u64,
    damage: impl FnMut(u64, &mut Vec<u8>, &mut Random),
) -> (BTreeMap<i32, Cycle>, Listener) {
    let mut heard = BTreeMap::new();
    let listener = listen(polling, cycles, damage, |cycle| {
        let numbers = cycle.map(|heard| heard.reply.position);
        assert!(
            numbers.iter().all(|n| *n == numbers[0]),
            "{polling:?}: mixed {cycle:?}"
        );
        assert!(
            heard.insert(numbers[0], *cycle).is_none(),
            "{} twice",
            numbers[0]
        );
    });
    (heard, listener)
}

/// The same, each cycle that the listener gives to `hear`.
fn listen(
    polling: &Polling,
    cycles: u64,
    mut damage: impl FnMut(u64, &mut Vec<u8>, &mut Random),
    mut hear: impl FnMut(&Cycle),
) -> Listener {
    let (mut random, mut queue, mut listener) = (Random(7), Queue::new(), Listener::new());
    let mut tick = TICK_US;
    let mut drain = |queue: &mut Queue, listener: &mut Listener| {
        while let Some(cycle) = listener.next(queue, &mut { ENDLESS }) {
            hear(cycle);
        }
    };
    for n in 0..cycles {
        for (time, mut bytes, _) in polling.cycle(n, &mut random) {
            damage(n, &mut bytes, &mut random);
            while time > tick as f64 {
                drain(&mut queue, &mut listener);
                tick += TICK_US;
            }
            queue.push(&bytes, time.round() as u64, BYTE_NS);
        }
    }
    drain(&mut queue, &mut listener);
    assert_eq!(queue.lost(), 0);
    listener
}

/// All the ways of polling that a listener must not depend on.
fn pollings() -> Vec<Polling> {
    let mut all = Vec::new();
    for period_us in [1000.0, 2000.0, 1e6 / 333.0, 5000.0] {
        for jitter_us in [0.0, 50.0, 200.0] {
            for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0], [1, 2, 3], [3, 1, 2]] {
                for commands in [true, false] {
                    all.push(Polling {
                        order,
                        // Not a divisor of the tick: polling straddles it everywhere.
                        period_us: period_us * 1.000_37,
                        jitter_us,
                        commands,
                        ..Polling::USUAL
                    });
                }
            }
        }
    }
    let usual = Polling::USUAL;
    all.extend([
        Polling {
            seeds: [SEED_STANDALONE, SEED_GO2, SEED_STANDALONE],
            ..usual
        },
        Polling {
            seeds: [0xBEEF, SEED_STANDALONE, SEED_STANDALONE],
            ..usual
        },
        Polling {
            seeds: [0xBEEF, 0x1234, 0xFFFF],
            ..usual
        },
        Polling {
            answer_jitter_us: 200.0,
            ..usual
        },
        // Evenly spread over the cycle, and nearly.
        Polling {
            pause_us: 2000.0 / 3.0 - 102.5,
            ..usual
        },
        Polling {
            pause_us: 500.0,
            jitter_us: 50.0,
            ..usual
        },
        Polling {
            pause_us: 1200.0,
            jitter_us: 100.0,
            period_us: 5000.0,
            ..usual
        },
    ]);
    all
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn whole_cycles_are_found_however_they_are_polled_and_none_is_mixed() {
    let cycles = 5_000;
    for polling in pollings() {
        let (heard, listener) = play(&polling, cycles, |_, _, _| {});
        let share = heard.len() as f64 / cycles as f64;
        // Slow polling that is spread out is not what is likely: it has to be learnt first.
        let least = if polling.pause_us > 400.0 {
            0.99
        } else {
            0.999
        };
        assert!(share >= least, "{polling:?}: {share}");
        let schedule = listener.schedule();
        let mut ids = polling.order;
        ids.sort_unstable();
        assert_eq!((schedule.ids, schedule.learnt), (ids, true), "{polling:?}");
        let period = f64::from(schedule.period_us);
        assert!(
            (period / polling.period_us - 1.0).abs() < 0.02,
            "{polling:?}: {schedule:?}"
        );
        if polling.pause_us < 400.0 {
            let order = schedule.order().map(|motor| ids[motor]);
            assert_eq!(order, polling.order, "{polling:?}: {schedule:?}");
        }
        for (place, id) in polling.order.into_iter().enumerate() {
            assert_eq!(
                listener.decoder().reply_seed(id),
                Some(polling.seeds[place])
            );
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn replies_bear_the_time_at_which_they_came() {
    let polling = Polling {
        jitter_us: 200.0,
        ..Polling::USUAL
    };
    let (heard, _) = play(&polling, 1000, |_, _, _| {});
    let mut random = Random(7);
    for n in 0..1000 {
        let sent = polling.cycle(n, &mut random);
        let sent = sent
            .iter()
            .filter(|(_, _, reply)| *reply)
            .map(|(time, _, _)| *time);
        for (heard, sent) in heard[&(n as i32)].iter().zip(sent) {
            assert!((heard.time_us as f64 - sent).abs() <= 1.0);
        }
    }
}

#[test]
fn bytes_of_one_piece_bear_their_own_times() {
    // Six frames without a pause: the time of each follows from that of the last byte.
    let mode = |id| Mode::foc(id);
    let frames: Vec<u8> = (0..3)
        .flat_map(|id| {
            Reply {
                mode: mode(id),
                ..Reply::default()
            }
            .encode(0)
        })
        .collect();
    let (mut queue, mut listener) = (Queue::new(), Listener::new());
    queue.push(&frames, 1_000_000, BYTE_NS);
    let cycle = *listener.next(&mut queue, &mut { ENDLESS }).unwrap();
    assert_eq!(
        cycle.map(|heard| heard.time_us),
        [999_920, 999_960, 1_000_000]
    );
}

/// Lost bytes at every rate: what is whole on the wire is found, and nothing else.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn lost_and_damaged_bytes_mix_no_cycles() {
    for polling in pollings().into_iter().step_by(7) {
        for share in [0.001, 0.01, 0.05, 0.2] {
            let mut intact = BTreeMap::<u64, u32>::new();
            let cycles = 3000;
            let (heard, _) = play(&polling, cycles, |n, bytes, random| {
                let reply = bytes.starts_with(&Reply::HEADER);
                let before = bytes.clone();
                // A quiet beginning, for the seeds.
                let spoilt = |random: &mut Random| n > 100 && random.share() < share;
                bytes.retain_mut(|byte| {
                    if spoilt(random) {
                        *byte ^= 1 << (random.next() % 8);
                        return random.share() < 0.5;
                    }
                    true
                });
                if reply && *bytes == before {
                    *intact.entry(n).or_default() += 1;
                }
            });
            let whole = intact.values().filter(|replies| **replies == 3).count();
            assert!(heard.len() <= whole, "{polling:?} at {share}");
            // Beside the first cycles, from which ids are learnt, and when the motors are polled.
            let learning = if polling.pause_us > 400.0 { 40 } else { 4 };
            let (least, found) = (0.985, heard.len() + learning);
            assert!(
                found as f64 >= least * whole as f64,
                "{polling:?} at {share}: {} of {whole}",
                heard.len()
            );
        }
    }
}

/// Changes or drops a frame.
type Damage = fn(&mut Vec<u8>, &mut Random);

/// What may happen to a frame.
const DAMAGES: [(&str, Damage); 8] = [
    ("its last byte is lost", |bytes, _| {
        bytes.pop();
    }),
    ("it is cut short", |bytes, random| {
        bytes.truncate(place(bytes, random));
    }),
    ("it is lost", |bytes, _| bytes.clear()),
    ("a byte in it is lost", |bytes, random| {
        bytes.remove(place(bytes, random));
    }),
    ("a byte of it comes twice", |bytes, random| {
        let at = place(bytes, random);
        bytes.insert(at, bytes[at]);
    }),
    ("a byte of it is another", |bytes, random| {
        let at = place(bytes, random);
        bytes[at] ^= 1 + (random.next() % 255) as u8;
    }),
    ("four bytes of it are others", |bytes, random| {
        for _ in 0..4 {
            let at = place(bytes, random);
            bytes[at] ^= 1 + (random.next() % 255) as u8;
        }
    }),
    ("any of these", |bytes, random| {
        let others = DAMAGES.len() as u64 - 1;
        DAMAGES[(random.next() % others) as usize].1(bytes, random);
    }),
];

fn place(bytes: &[u8], random: &mut Random) -> usize {
    (random.next() % bytes.len() as u64) as usize
}

/// What becomes of polling cycles of which a fifth of the frames are damaged.
#[derive(Debug, Default)]
struct Damaged {
    /// Cycles of which all three replies came as they were sent.
    whole: u64,
    samples: u64,
    /// Samples of replies that were sent, in two cycles.
    mixed: u64,
    /// Samples with a reply that was never sent, whose checksum is right by chance: of many wrong bytes one frame in 65536 has such.
    never_sent: u64,
}

impl Damaged {
    /// Plays `cycles` of this polling, damaged from the first on.
    fn play(&mut self, polling: &Polling, cycles: u64, damage: Damage) {
        // What was sent last, by cycle and id, and how many replies of it came whole.
        const KEPT: usize = 64;
        let sent = RefCell::new([[Reply::default(); 16]; KEPT]);
        let (mut whole, mut intact) = (0, 0);
        let spoil = |n: u64, bytes: &mut Vec<u8>, random: &mut Random| {
            let reply = bytes
                .first_chunk()
                .filter(|bytes| bytes.starts_with(&Reply::HEADER));
            let reply = reply.map(Reply::parse);
            if let Some(reply) = reply {
                let id = usize::from(reply.mode.id());
                sent.borrow_mut()[n as usize % KEPT][id] = reply;
            }
            let spoilt = random.share() < 0.2;
            if reply.is_some_and(|reply| reply.mode.id() == polling.order[0]) {
                intact = 0;
            }
            if spoilt {
                damage(bytes, random);
            } else if reply.is_some() {
                intact += 1;
                whole += u64::from(intact == 3);
            }
        };
        listen(polling, cycles, spoil, |cycle| {
            let sent = sent.borrow();
            let is_sent = |Heard { reply, .. }: &Heard| {
                let of = reply.position.rem_euclid(KEPT as i32) as usize;
                sent[of][usize::from(reply.mode.id())] == *reply
            };
            let first = cycle[0].reply.position;
            self.samples += 1;
            if !cycle.iter().all(is_sent) {
                self.never_sent += 1;
            } else if cycle.iter().any(|heard| heard.reply.position != first) {
                self.mixed += 1;
            }
        });
        self.whole += whole;
    }
}

/// Of so many cycles for each kind of damage, polled in all ways: none is mixed, and most that are whole on the wire become samples.
fn mixes_nothing(cycles: u64) {
    let pollings = pollings();
    for (what, damage) in DAMAGES {
        let mut all = Damaged::default();
        for polling in &pollings {
            all.play(polling, cycles.div_ceil(pollings.len() as u64), damage);
        }
        let Damaged {
            whole,
            samples,
            mixed,
            never_sent,
        } = all;
        println!("| {what} | {cycles} | {whole} | {samples} | {mixed} | {never_sent} |");
        assert_eq!(mixed, 0, "{what}: {all:?}");
        assert!(samples as f64 > 0.95 * whole as f64, "{what}: {all:?}");
        assert!(
            never_sent as f64 <= 3.0 + 1e-5 * cycles as f64,
            "{what}: {all:?}"
        );
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn damaged_frames_mix_no_cycles() {
    mixes_nothing(25_000);
}

/// Ten million cycles: the table of `studies/board.md`, "Mixed samples".
#[test]
#[ignore = "15 s: cargo test -p proprio-core --lib -- --ignored --nocapture ten_million"]
fn ten_million_damaged_cycles_mix_none() {
    mixes_nothing(1_250_000);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_change_of_rate_is_noticed() {
    let (mut queue, mut listener, mut random) = (Queue::new(), <Listener>::new(), Random(3));
    let mut start = 0.0;
    for period_us in [2000.0, 4000.0, 1000.0] {
        let polling = Polling {
            period_us,
            ..Polling::USUAL
        };
        for n in 0..2000 {
            for (time, bytes, _) in polling.cycle(n, &mut random) {
                queue.push(&bytes, (start + time) as u64, BYTE_NS);
            }
            while listener.next(&mut queue, &mut { ENDLESS }).is_some() {}
        }
        start += 2000.0 * period_us;
        assert!(
            f64::from(listener.schedule().period_us)
                .mul_add(1.0, -period_us)
                .abs()
                < 20.0
        );
    }
    assert!(listener.cycles().incomplete <= 2);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_motor_that_vanishes_and_returns_is_counted() {
    let (heard, listener) = play(&Polling::USUAL, 3000, |n, bytes, _| {
        let motor_1 = bytes.starts_with(&Reply::HEADER) && bytes[2] & 0x0F == 1;
        if (1000..2000).contains(&n) && motor_1 {
            bytes.clear();
        }
    });
    assert_eq!(heard.len(), 2000);
    let counters = listener.cycles();
    assert_eq!((counters.incomplete, counters.unused_replies), (1000, 2000));
}

/// The same replies through a listener, changed by `change`; what it counts, and the cycles that it gives.
fn altered(change: impl Fn(u64, &mut Reply)) -> (usize, AssemblyCounters) {
    let (mut queue, mut listener) = (Queue::new(), <Listener>::new());
    let mut cycles = 0;
    for n in 0..1000u64 {
        for id in 0..3 {
            // A motor that turns, and tells so.
            let mut reply = Reply {
                mode: Mode::foc(id),
                position: 200 * n as i32,
                speed: 781 + (n % 3) as i16,
                torque: (n % 40) as i16,
                ..Reply::default()
            };
            if id == 1 {
                change(n, &mut reply);
            }
            queue.push(
                &reply.encode(0),
                1 + 2000 * n + 100 * u64::from(id),
                BYTE_NS,
            );
        }
        cycles +=
            core::iter::from_fn(|| listener.next(&mut queue, &mut { ENDLESS }).copied()).count();
    }
    (cycles, listener.cycles())
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_a_motor_says_is_wrong_with_it_leaves_its_cycles_out() {
    let during = 300..500;
    for (error, count) in [
        (1, [0, 200]),
        (2, [200, 0]),
        (3, [200, 0]),
        (4, [200, 0]),
        (7, [200, 0]),
    ] {
        let (cycles, counters) = altered(|n, reply| {
            if during.contains(&n) {
                reply.flags = error | 0x1F8;
            }
        });
        assert_eq!(
            (cycles, counters.unused_replies, counters.incomplete),
            (800, 600, 0)
        );
        assert_eq!([counters.motor_faults, counters.overheated], count);
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_stuck_encoder_is_noticed_and_a_motor_at_rest_is_none() {
    let position = |n: u64| 200 * n.min(300) as i32;
    let after = |n: u64| n >= 300;
    // The position stays, the speed goes on: out after 10 ms.
    let (cycles, counters) = altered(|n, reply| reply.position = position(n));
    assert!((690..700).contains(&counters.stuck), "{counters:?}");
    assert_eq!(
        (cycles + counters.stuck as usize, counters.unused_replies),
        (1000, 3 * counters.stuck)
    );
    // Position and speed stay, the torque changes: out after 100 ms.
    let (_, counters) = altered(|n, reply| {
        reply.position = position(n);
        reply.speed = if after(n) { 0 } else { reply.speed };
    });
    assert!((640..652).contains(&counters.stuck), "{counters:?}");
    // Held by friction: the speed is noise about zero.
    let mut random = Random(1);
    let noise: Vec<i16> = (0..1000)
        .map(|_| (18.0 * (random.share() - 0.5)) as i16)
        .collect();
    let (cycles, _) = altered(|n, reply| {
        reply.position = position(n);
        reply.speed = if after(n) {
            noise[n as usize]
        } else {
            reply.speed
        };
    });
    assert_eq!(cycles, 1000);
    // At rest, and nothing pushes.
    let (cycles, _) = altered(|_, reply| (reply.position, reply.speed, reply.torque) = (5, 0, 9));
    assert_eq!(cycles, 1000);
}

#[test]
fn what_finds_no_room_is_lost_and_counted_and_the_rest_is_found() {
    let (mut queue, mut listener) = (Queue::new(), Listener::new());
    let polling = Polling::USUAL;
    let (mut random, mut pushed) = (Random(1), 0);
    for n in 0..200 {
        for (time, bytes, _) in polling.cycle(n, &mut random) {
            pushed += bytes.len() as u32;
            queue.push(&bytes, time as u64, BYTE_NS);
        }
    }
    let waiting = queue.waiting().len() as u32;
    assert_eq!(pushed - waiting, queue.lost());
    let cycles = core::iter::from_fn(|| listener.next(&mut queue, &mut { ENDLESS }).copied());
    for (n, cycle) in cycles.enumerate() {
        assert_eq!(cycle.map(|heard| heard.reply.position), [n as i32; 3]);
    }
    assert_eq!(listener.frames().commands + listener.frames().replies, 124);
}

proptest! {
    /// Whatever comes, at whatever time: nothing panics, every byte and every reply is accounted for, no effort is exceeded.
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn no_bytes_and_no_times_panic(
        pieces in proptest::collection::vec((
            prop_oneof![
                proptest::collection::vec(prop_oneof![any::<u8>(), Just(0xFE), Just(0xFD), Just(0xEE)], 0..400),
                (any::<u8>(), any::<i32>(), any::<u16>()).prop_map(|(mode, position, flags)| {
                    Reply { mode: Mode(mode), position, flags, ..Reply::default() }.encode(0).to_vec()
                }),
            ],
            prop_oneof![any::<u64>(), 0..100_000u64],
            any::<u32>(),
            0..2000usize,
        ), 1..60)
    ) {
        let (mut queue, mut listener) = (Queue::new(), <Listener>::new());
        let (mut pushed, mut cycles) = (0, 0);
        for (bytes, time_us, byte_ns, effort) in &pieces {
            pushed += bytes.len() as u32;
            queue.push(bytes, *time_us, *byte_ns);
            let mut effort = *effort;
            cycles += core::iter::from_fn(|| listener.next(&mut queue, &mut effort).copied()).count() as u32;
        }
        let frames = listener.frames();
        let taken = 17 * frames.commands + 16 * frames.replies + frames.skipped_bytes;
        prop_assert_eq!(pushed, taken + queue.lost() + queue.waiting().len() as u32);
        let under_way = frames.replies - 3 * cycles - listener.cycles().unused_replies;
        prop_assert!(under_way <= 2);
    }
}

/// A reply's checksum ends with the byte that a command begins with: by chance one in 256 does.
fn ends_like_a_command(n: i32, id: u8) -> Reply {
    let replies = (0..i16::MAX).map(|torque| Reply {
        mode: Mode::foc(id),
        torque,
        position: n,
        ..Reply::default()
    });
    let mut fitting = replies.filter(|r| r.encode(SEED_STANDALONE)[15] == Command::HEADER[0]);
    fitting.next().unwrap()
}

#[test]
fn a_reply_that_lacks_its_last_byte_is_not_completed_by_the_next_command() {
    let piece = |bytes: &[u8], queue: &mut Queue, end_us: u64| queue.push(bytes, end_us, BYTE_NS);
    for (late_us, next_us, bridged) in [
        (0, 2_000, false),
        (0, 43, true),
        (1_500, 1_000, true),
        (1_500, 2_000, false),
    ] {
        let (mut queue, mut listener) = (Queue::of_adapter(late_us), <Listener>::new());
        let (mut time_us, mut cycles) = (1_000, Vec::new());
        for n in 0..100 {
            for id in 0..3 {
                let mode = Mode::foc(id);
                let command = Command {
                    mode,
                    ..Command::default()
                };
                time_us += 43;
                piece(&command.encode(SEED_GO2), &mut queue, time_us);
                let reply = match n {
                    99 => ends_like_a_command(n, id),
                    _ => Reply {
                        mode,
                        position: n,
                        ..Reply::default()
                    },
                };
                let bytes = reply.encode(SEED_STANDALONE);
                time_us += 60;
                let lacks = n == 99 && id == 2;
                piece(&bytes[..if lacks { 15 } else { 16 }], &mut queue, time_us);
            }
            time_us += 2_000 - 309;
            while let Some(cycle) = listener.next(&mut queue, &mut { ENDLESS }) {
                cycles.push(cycle[2].reply.position);
            }
        }
        // The next command, whose first byte fits: so soon that there is no pause, or not.
        let end_us = time_us - (2_000 - 309) + next_us;
        let command = Command {
            mode: Mode::foc(0),
            ..Command::default()
        };
        piece(&command.encode(SEED_GO2), &mut queue, end_us);
        while let Some(cycle) = listener.next(&mut queue, &mut { ENDLESS }) {
            cycles.push(cycle[2].reply.position);
        }
        assert_eq!(cycles.contains(&99), bridged, "{late_us} {next_us}");
        let (frames, counters) = (listener.frames(), listener.cycles());
        assert_eq!(
            frames.replies,
            3 * cycles.len() as u32 + counters.unused_replies + if bridged { 0 } else { 2 }
        );
    }
}

#[test]
fn a_queue_holds_the_bytes_of_pieces_of_any_length() {
    for length in 0..200_u8 {
        let mut queue = Queue::new();
        // The second piece begins at any place.
        let pieces: [Vec<u8>; 2] = [(0..length / 3).collect(), (7..7 + length).collect()];
        pieces.iter().for_each(|piece| queue.push(piece, 1_000, 0));
        assert_eq!(queue.waiting(), pieces.concat(), "{length}");
    }
}
