//! The NUCLEO's own image, that which `proprio flash` writes, under Unicorn (`tests/board/nucleo.py`): what its buses bring becomes what the
//! application makes of the same bytes in this process; it starts without its crystal; a zero that is void is told; faults of its lines, its power and its
//! flash are survived, and counted; what it is set up for is kept (`setup`); faults of a robot are named (`robot`).

mod robot;
mod setup;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use proprio_core::app::{App, Identity, Memory, Start};
use proprio_core::go2::Leg;
use proprio_core::wire::{
    Action, Clock, Counters, DeviceMessage, Estimate, Hello, HostMessage, Kept, MAX_FRAME,
    Positions, Receiver, Request, Reset, Sender, SetZero, Wiring, Zero,
};
use proprio_host::device::image;
use proprio_host::device::replay::cycle;
use proprio_tests::motion;
use serde_json::Value;

/// When the host asks for what is to be known before the first byte comes, µs: after the start, which takes 30 ms.
const ASKED_US: u64 = 70_000;
/// When the first byte comes, µs: what was asked for is done and kept in the flash, so that the board's windows begin where those of the
/// application in this process do.
const FIRST_US: u64 = 400_000;
/// Starts of the application in this process that are compared with the board's, a period apart: as long as a few windows.
const LATER: u64 = 45;
/// Lines of the harness: the buses, and the host.
const HOST: usize = 4;

/// What comes on a line until a time, µs.
struct Event(u64, usize, Vec<u8>);

/// A fault at a time, µs, on a line, as `nucleo.py` names it.
struct Fault(u64, usize, &'static str);

/// The frames of a polling cycle that begins at `time_us`, with the times of their last bytes.
fn frames(line: usize, bytes: &[u8], mut time_us: u64) -> Vec<Event> {
    let mut events = Vec::new();
    for pair in bytes.chunks(33) {
        let (command, reply) = pair.split_at(17);
        for (frame, takes_us) in [(command, 53), (reply, 60)] {
            time_us += takes_us;
            events.push(Event(time_us, line, frame.to_vec()));
        }
    }
    events
}

/// Python with Unicorn, where `tests/run` or the user has installed it.
fn python() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/recordings/bin/python");
    let named = std::env::var_os("PROPRIO_PYTHON").map(PathBuf::from);
    let python = named.unwrap_or(own);
    let has = Command::new(&python)
        .args(["-c", "import unicorn, elftools"])
        .output();
    has.is_ok_and(|output| output.status.success())
        .then_some(python)
}

/// What a run of the image gave.
struct Run {
    messages: Vec<DeviceMessage>,
    report: Value,
    /// Frames that were damaged, and that never came.
    losses: (u32, u32),
}

impl Run {
    /// Runs the image, which does not start anew and loses nothing; none where Unicorn is not installed.
    fn new(seconds: f64, events: &[Event], extra: &[&str]) -> Option<Self> {
        let run = Self::with(seconds, events, &[], extra)?;
        assert_eq!(run.losses, (0, 0));
        assert_eq!(run.starts_us().len(), 1, "{}", run.report);
        Some(run)
    }

    /// Runs the image with faults; none where Unicorn is not installed.
    fn with(seconds: f64, events: &[Event], faults: &[Fault], extra: &[&str]) -> Option<Self> {
        let Some(python) = python() else {
            println!("skipped: pip install -r tests/board/requirements.txt");
            return None;
        };
        let image = image::build_nucleo(false).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let events = events.iter().map(|Event(time_us, line, bytes)| {
            let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            format!("{time_us} {line} {hex}\n")
        });
        let faults = faults.iter();
        let faults = faults.map(|Fault(time_us, line, what)| format!("{time_us} {line} {what}\n"));
        let lines: String = events.chain(faults).collect();
        let file = folder.path().join("events");
        fs::write(&file, lines).unwrap();
        let harness = Path::new(env!("CARGO_MANIFEST_DIR")).join("board/nucleo.py");
        let output = Command::new(python)
            .arg(harness)
            .arg(image)
            .arg(seconds.to_string())
            .arg(file)
            .args(extra)
            .output()
            .unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let (lines, report) = said.trim_end().rsplit_once('\n').unwrap();
        let mut receiver = Receiver::<DeviceMessage>::default();
        let mut messages = Vec::new();
        for line in lines.lines() {
            let (_, hex) = line.split_once(' ').unwrap();
            for pair in hex.as_bytes().chunks(2) {
                let byte = u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
                // A frame that the power has cut is counted.
                if let Some(Ok(message)) = receiver.push(byte) {
                    messages.push(message);
                }
            }
        }
        let losses = (receiver.bad(), receiver.missed());
        let report: Value = serde_json::from_str(report).unwrap();
        assert_eq!(report["ended"], Value::Null);
        assert_eq!(report["watchdog_before_clocks"], true);
        assert!(
            report["longest_pause_ms"].as_f64().unwrap() < 100.0,
            "{report}"
        );
        Some(Self {
            messages,
            report,
            losses,
        })
    }

    /// When the image was started, µs.
    fn starts_us(&self) -> Vec<u64> {
        let starts = self.report["starts"].as_array().unwrap();
        starts
            .iter()
            .map(|start| start[0].as_u64().unwrap())
            .collect()
    }

    /// Checks that the lights show each stage of the start in its order, and then that steps are done.
    fn shows_its_start(&self) {
        let shown: Vec<(u64, Vec<String>)> =
            serde_json::from_value(self.report["lights"].clone()).unwrap();
        let mut states = shown.iter();
        // The drivers; the legs' analysis and the flash; none; a step, the first of which changes the green light, and the next half a second later.
        let stages: [&[&str]; 5] = [
            &["red", "yellow"],
            &["green", "red"],
            &[],
            &["green"],
            &["yellow"],
        ];
        let begun = stages.map(|stage| states.find(|(_, lit)| *lit == *stage).map(|(at, _)| *at));
        let [drivers, memory, done, green, off] = begun.map(|at| at.expect("a stage is not shown"));
        assert!(
            drivers < memory && memory < done && done < green,
            "{shown:?}"
        );
        assert!((499_000..502_500).contains(&(off - green)), "{shown:?}");
    }

    fn hellos(&self) -> Vec<&Hello> {
        hellos_of(&self.messages)
    }

    fn counters(&self) -> Counters {
        let counters = self
            .messages
            .iter()
            .rev()
            .find_map(|message| match message {
                DeviceMessage::Counters(counters) => Some(*counters),
                _ => None,
            });
        counters.unwrap()
    }
}

fn hellos_of(messages: &[DeviceMessage]) -> Vec<&Hello> {
    let hellos = messages.iter().filter_map(|message| match message {
        DeviceMessage::Hello(hello) => Some(hello),
        _ => None,
    });
    hellos.collect()
}

/// A host's requests as one piece of its line.
fn asked(time_us: u64, sender: &mut Sender, first: u32, actions: &[Action]) -> Event {
    let mut bytes = Vec::new();
    for (id, action) in (first..).zip(actions) {
        let request = HostMessage::Request(Request {
            id,
            action: *action,
        });
        bytes.extend(sender.encode(&request, &mut [0; MAX_FRAME]));
    }
    Event(time_us, HOST, bytes)
}

/// A leg's estimates that have data.
fn estimates_of(messages: &[DeviceMessage], leg: u8) -> impl Iterator<Item = &Estimate> {
    messages.iter().filter_map(move |message| match message {
        DeviceMessage::Estimate(e) if e.leg == leg && e.windows > 0 => Some(e),
        _ => None,
    })
}

/// The same pieces, heard by the application in this process, whose steps from `from_us` on are a period apart.
fn in_process(events: &[Event], from_us: u64, until_us: u64) -> Vec<DeviceMessage> {
    let identity = Identity {
        firmware: "test",
        board: "desktop",
        start: Start::UNKNOWN,
        load_unit: "nothing",
        budget: u32::MAX,
        byte_ns: 2500,
        positions: Positions::FromPowerUp,
    };
    let mut receiver = Receiver::<HostMessage>::default();
    let (mut app, mut memory) = (
        Box::new(App::<f64>::new(identity)),
        Box::new(Memory::<f64>::new()),
    );
    let (mut messages, mut heard) = (Vec::new(), events.iter().peekable());
    for now_us in (from_us..=until_us).step_by(2_000) {
        while let Some(Event(time_us, line, bytes)) = heard.next_if(|event| event.0 <= now_us) {
            if *line < HOST {
                app.hear(&mut memory, *line, bytes, *time_us);
                continue;
            }
            for byte in bytes {
                if let Some(message) = receiver.push(*byte) {
                    app.handle(&mut memory, &message.unwrap());
                }
            }
        }
        app.step(&mut memory, now_us, &mut |m| messages.push(m.clone()));
    }
    messages
}

#[test]
fn the_nucleos_image_hears_four_buses_and_finds_what_the_application_does() {
    let mut sender = Sender::default();
    let positions = Action::SetPositions(Positions::Absolute);
    let mut events = vec![asked(ASKED_US, &mut sender, 1, &[positions])];
    const CYCLES: u64 = 2_500;
    for n in 0..CYCLES {
        for leg in Leg::ALL {
            let begin_us = FIRST_US + n * motion::SAMPLE_US + 37 * leg.index() as u64;
            let bytes = cycle(leg, &motion::sample(leg, n)).unwrap();
            events.extend(frames(leg.index(), &bytes, begin_us));
        }
    }
    events.sort_by_key(|event| event.0);
    let end_us = FIRST_US + CYCLES * motion::SAMPLE_US + 100_000;
    let Some(run) = Run::new(end_us as f64 * 1e-6, &events, &[]) else {
        return;
    };
    run.shows_its_start();
    let hellos = run.hellos();
    assert_eq!(hellos[0].clock, Clock::Crystal);
    assert_eq!(hellos[0].reset, Reset::Power);
    assert_eq!(hellos[0].zeros, [[Zero::Unknown; 3]; 4]);
    assert_eq!(hellos.last().unwrap().zeros, [[Zero::Absolute; 3]; 4]);
    let counters = run.counters();
    for leg in counters.legs {
        // Until the schedule is learnt some cycles are none.
        assert!(leg.samples as u64 + 8 > CYCLES, "{leg:?}");
        assert_eq!(
            (leg.bad_crc, leg.short, leg.rejected, leg.unplaced),
            (0, 0, 0, 0)
        );
    }
    assert_eq!(counters.load.over_budget, 0);
    // When a solution begins depends on when the application has started: of all windows' data one of these is near.
    let phase_us = counters.time_us % motion::SAMPLE_US;
    let starts = (0..LATER).map(|n| phase_us + (1 + n) * motion::SAMPLE_US);
    let plain: Vec<_> = starts
        .flat_map(|from_us| in_process(&events, from_us, end_us))
        .collect();
    let (mut compared, mut squares) = (0, Vec::new());
    for leg in 0..4 {
        for board in estimates_of(&run.messages, leg) {
            let apart = |e: &&Estimate| e.windows.abs_diff(board.windows);
            let nearest = estimates_of(&plain, leg).min_by_key(apart);
            let Some(desktop) = nearest.filter(|e| 10 * apart(e) <= board.windows) else {
                continue;
            };
            compared += 1;
            for ((a, b), std) in board.values.iter().zip(&desktop.values).zip(&desktop.std) {
                squares.push(((a - b) / std).powi(2));
            }
        }
    }
    let apart = (squares.iter().sum::<f32>() / squares.len() as f32).sqrt();
    println!("{compared} estimates, {apart} standard deviations apart");
    assert!(
        compared >= 12,
        "{compared} estimates of nearly as many windows: {}",
        run.report
    );
    // Ten samples are a window of 20 ms; where the board heard the tenth some µs early it takes eleven, so that its windows are others of the same
    // motion. Those of another motion would put the values √2 standard deviations apart, root mean square.
    assert!(apart < 0.25 * 2.0_f32.sqrt(), "{apart}");
}

#[test]
fn the_nucleos_image_starts_without_its_crystal_and_tells_a_zero_that_is_void() {
    let mut sender = Sender::default();
    let mut events = Vec::new();
    let rest = motion::sample(Leg::FR, 0);
    let placed = [0, 1, 2].map(|joint: u8| {
        Action::SetZero(SetZero {
            leg: 0,
            joint,
            angle: rest.q[usize::from(joint)] as f32,
            reversed: false,
        })
    });
    for n in 0..250 {
        let mut sample = rest;
        sample.dq = [0.0; 3];
        // One turn of the thigh's rotor, on the joint's side.
        if n >= 200 {
            sample.q[1] -= std::f64::consts::TAU / 6.333;
        }
        let bytes = cycle(Leg::FR, &sample).unwrap();
        events.extend(frames(0, &bytes, FIRST_US + n * motion::SAMPLE_US));
    }
    events.push(asked(FIRST_US + 200_000, &mut sender, 1, &placed));
    events.sort_by_key(|event| event.0);
    let Some(run) = Run::new(1.0, &events, &["no-hse"]) else {
        return;
    };
    run.shows_its_start();
    let hellos = run.hellos();
    assert_eq!(hellos[0].clock, Clock::Internal);
    let zeros: Vec<_> = hellos.iter().map(|hello| hello.zeros[0]).collect();
    assert!(zeros.contains(&[Zero::Set; 3]), "{zeros:?}");
    assert_eq!(
        zeros.last(),
        Some(&[Zero::Set, Zero::Jumped, Zero::Set]),
        "{zeros:?}"
    );
}

/// A UART, its pins with their alternate functions (data sheet DS12110, tables of ports D and E), and its interrupt (RM0433, table of the NVIC).
struct Uart(&'static str, &'static [(&'static str, u64)], u64);

/// Of the four buses and the host. A bus has no pin that transmits.
const UARTS: [Uart; 5] = [
    Uart("USART2", &[("PD6", 7)], 38),
    Uart("UART4", &[("PD0", 8)], 52),
    Uart("UART5", &[("PD2", 8)], 53),
    Uart("UART7", &[("PE7", 7)], 82),
    Uart("USART3", &[("PD8", 7), ("PD9", 7)], 39),
];

/// The pins that the image gives to peripherals are those of the part's table and of the wiring guide, and no other; its vectors are where the part
/// looks for them; no bus is transmitted on.
#[test]
fn the_nucleos_image_listens_where_the_part_and_the_guide_say() {
    let Some(run) = Run::new(0.1, &[], &[]) else {
        return;
    };
    let pins = UARTS.iter().flat_map(|Uart(_, pins, _)| *pins);
    let pins: serde_json::Map<_, _> = pins
        .map(|(pin, function)| (pin.to_string(), Value::from(*function)))
        .collect();
    assert_eq!(run.report["pins"], Value::Object(pins));
    assert_eq!(
        run.report["transmits"],
        Value::from(vec![false, false, false, false, true])
    );
    let handled = run.report["handled"].as_array().unwrap();
    let numbers = INTERRUPTS.iter().flat_map(|(_, numbers)| *numbers);
    let numbers = numbers.map(|number| u64::from(*number));
    for number in numbers.chain(UARTS.map(|Uart(.., number)| number)) {
        assert!(
            handled.contains(&Value::from(number)),
            "{number}: {handled:?}"
        );
    }
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/wiring.md");
    let guide = fs::read_to_string(guide).unwrap();
    for (line, Uart(uart, pins, _)) in ["FR", "FL", "RR", "RL", "host"].into_iter().zip(UARTS) {
        let pins = pins.iter().map(|(pin, _)| *pin);
        let row = format!("| {line} | {uart} | ");
        let row = guide.lines().find_map(|text| text.strip_prefix(&row));
        let row = row.unwrap_or_else(|| panic!("{line} at {uart} is not in the guide"));
        assert!(pins.into_iter().all(|pin| row.contains(pin)), "{row}");
    }
}

/// RCC_RSR after each kind of reset (RM0433, RCC_RSR), all of which pull the pin and reset the core.
#[test]
fn the_nucleos_image_tells_why_it_started() {
    const EACH: u32 = 1 << 22 | 1 << 17;
    // Bits of PORRSTF, BORRSTF, SFTRSTF, IWDG1RSTF.
    let [por, bor, software, watchdog] = [23, 21, 24, 26].map(|bit| 1 << bit);
    for (flags, level, reset) in [
        (por | bor, 0, Reset::Power),
        (bor, 3, Reset::BrownOut),
        (0, 1, Reset::Pin),
        (software, 0, Reset::Software),
        (watchdog, 2, Reset::Watchdog),
        // A brown-out while the flags of a watchdog's reset were not read.
        (watchdog | bor, 3, Reset::Watchdog),
    ] {
        let [rsr, bor] = [format!("rsr={:x}", EACH | flags), format!("bor={level}")];
        let Some(run) = Run::new(0.1, &[], &[&rsr, &bor]) else {
            return;
        };
        let hello = run.hellos()[0];
        assert_eq!(
            (hello.reset, hello.brown_out_level),
            (reset, Some(level)),
            "{rsr}"
        );
    }
}

/// Interrupts that the board uses, by name: the buses' UARTs, DMA1's streams, the clock.
const INTERRUPTS: [(&str, &[u32]); 3] = [
    ("interrupt_uart", &[38, 52, 53, 82]),
    ("interrupt_dma", &[11, 12, 13, 14, 15, 16]),
    ("interrupt_clock", &[50]),
];

/// Framing errors of one bus, overruns of the next, a storm of single bytes on the third, garbage from the host: each is counted, none touches the bus
/// that has none, and no interrupt costs more than its budget.
#[test]
fn faults_of_lines_stay_with_their_lines_and_are_counted() {
    const CYCLES: u64 = 800;
    const FAULTS: u64 = 20;
    // A storm for 0.2 s, in which that bus has no cycles.
    const STORM: std::ops::Range<u64> = 500..600;
    const STORM_BYTE_US: u64 = 10;
    let mut sender = Sender::default();
    let positions = Action::SetPositions(Positions::Absolute);
    let mut events = vec![asked(ASKED_US, &mut sender, 1, &[positions])];
    for n in 0..CYCLES {
        for leg in Leg::ALL {
            if leg == Leg::RL && STORM.contains(&n) {
                continue;
            }
            let begin_us = FIRST_US + n * motion::SAMPLE_US + 37 * leg.index() as u64;
            let bytes = cycle(leg, &motion::sample(leg, n)).unwrap();
            events.extend(frames(leg.index(), &bytes, begin_us));
        }
    }
    let storm_us = STORM.map(|n| FIRST_US + n * motion::SAMPLE_US);
    let storm_us: Vec<u64> = storm_us
        .flat_map(|us| (us..us + motion::SAMPLE_US).step_by(STORM_BYTE_US as usize))
        .collect();
    events.extend(
        storm_us
            .iter()
            .map(|us| Event(*us, Leg::RL.index(), vec![0xFE])),
    );
    let garbage: Vec<u8> = (0..600u32).map(|n| (n * n % 251) as u8).collect();
    events.push(Event(FIRST_US + 700_000, HOST, garbage));
    let each = |line: usize, what| {
        (0..FAULTS).map(move |n| Fault(FIRST_US + 300_000 + n * 20_000 + 900, line, what))
    };
    let faults: Vec<Fault> = each(1, "!2").chain(each(2, "!8")).collect();
    let end_us = FIRST_US + CYCLES * motion::SAMPLE_US + 100_000;
    let Some(run) = Run::with(end_us as f64 * 1e-6, &events, &faults, &["count"]) else {
        return;
    };
    assert_eq!(run.losses, (0, 0));
    assert_eq!(run.starts_us().len(), 1, "{}", run.report);
    let counters = run.counters();
    println!("{:?} {:?}", counters.buses, counters.legs);
    let [fr, fl, rr, rl] = counters.legs;
    // Until the schedule is learnt some cycles are none.
    assert!(u64::from(fr.samples) + 8 > CYCLES, "{fr:?}");
    assert_eq!(
        (fr.bad_crc, fr.short, fr.skipped_bytes, fr.rejected),
        (0, 0, 0, 0)
    );
    // The bytes of a tick, of three frames at most, are lost with an error.
    for leg in [fl, rr] {
        assert!(u64::from(leg.samples) + 8 + 3 * FAULTS > CYCLES, "{leg:?}");
    }
    assert!(u64::from(rl.samples) + 16 + 100 > CYCLES, "{rl:?}");
    let stray = rl.skipped_bytes + rl.lost_bytes;
    assert!(u64::from(stray) + 64 >= storm_us.len() as u64, "{rl:?}");
    let [fr, fl, rr, rl] = counters.buses;
    assert_eq!(
        (fr.errors, fr.overruns, fl.overruns, rr.errors),
        (0, 0, 0, 0)
    );
    assert_eq!(
        (u64::from(fl.errors), u64::from(rr.overruns)),
        (FAULTS, FAULTS)
    );
    assert_eq!((rl.errors, rl.overruns), (0, 0));
    assert!(counters.host_frames_bad > 0);
    assert_eq!(counters.load.over_budget, 0);
    let budgets = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../budgets.toml"));
    let budgets: toml::Table = budgets.unwrap().parse().unwrap();
    for (name, numbers) in INTERRUPTS {
        let costs =
            |number: &u32| run.report["interrupt_instructions"][number.to_string()][2].as_u64();
        let worst = numbers
            .iter()
            .filter_map(costs)
            .max()
            .expect("it was taken");
        let target = budgets["target"][name].as_integer().unwrap() as u64;
        println!("{name}: {worst} instructions at most, {target} allowed");
        assert!(
            worst <= target,
            "{name}: {worst} instructions, {target} allowed"
        );
    }
}

/// What was kept comes back after the power was off, also where it failed while a word of the next snapshot was written, which reading makes a bus fault;
/// an error of DMA, which nothing can mend, starts the board anew.
#[test]
fn the_nucleos_image_survives_its_power_and_its_flash() {
    // A leg at rest is waited for 2.5 s, then its words take 0.25 s.
    const KEPT_US: u64 = 14_000_000;
    const TORN_US: u64 = KEPT_US + 2_750_000;
    const DMA_US: u64 = TORN_US + 250_000;
    let positions = Action::SetPositions(Positions::Absolute);
    let events = [
        asked(ASKED_US, &mut Sender::default(), 1, &[positions]),
        asked(
            KEPT_US + 100_000,
            &mut Sender::default(),
            2,
            &[Action::SetMemory(60), Action::Keep],
        ),
    ];
    let faults = [
        Fault(KEPT_US, HOST, "power"),
        Fault(TORN_US, HOST, "torn"),
        Fault(DMA_US, 1, "dma"),
    ];
    let Some(run) = Run::with(17.4, &events, &faults, &[]) else {
        return;
    };
    let starts = run.starts_us();
    assert_eq!(starts.len(), 4, "{}", run.report);
    assert!(starts[3] < DMA_US + 1_000, "{starts:?}");
    // The sector of the first snapshot, and that of the second.
    assert_eq!(run.report["sectors_erased"], 2);
    let hellos = run.hellos();
    let mut starts = hellos
        .iter()
        .map(|hello| (hello.reset, hello.kept, !hello.crash.is_empty()))
        .collect::<Vec<_>>();
    starts.dedup();
    assert_eq!(
        starts,
        [
            (Reset::Power, Kept::Nothing, false),
            (Reset::Power, Kept::Restored, false),
            (Reset::Software, Kept::Restored, true),
        ]
    );
    assert_eq!(
        hellos.last().unwrap().crash,
        "DMA transfer error, stream 1: FL's bus"
    );
    // That positions are angles is the host's word at each start.
    assert_eq!(hellos.last().unwrap().zeros, [[Zero::Unknown; 3]; 4]);
}
