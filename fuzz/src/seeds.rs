//! What a fuzzer begins with: good input of every kind, made by the program itself, so that it stays good when formats change.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE};
use proprio_core::bus::{Command, Mode, Reply};
use proprio_core::go2::{ACTUATORS, Leg};
use proprio_core::wire::{
    Action, Advance, DeviceMessage, EffectAt, HostMessage, MAX_FRAME, Message, Request, Sender,
};
use proprio_host::capture::CaptureWriter;
use proprio_host::device::pull::Pull;
use proprio_host::device::serial::BUS_BAUD;
use proprio_host::device::{BusStep, Desktop, Device};
use proprio_host::factors::Factors;
use proprio_host::fleet::{self, Block, BlockColumns, KeptColumn};
use proprio_host::model::Model;
use proprio_host::monitor::{Entry, JournalWriter};

/// Recordings of others, and robots, that the tests have: of these no seed is made here.
const FILES: [(&str, &str); 10] = [
    ("log", "oracle/recordings/columns.npz"),
    ("log", "oracle/recordings/log_compressed.npz"),
    ("log", "oracle/recordings/go_lz4.mcap"),
    ("log", "oracle/recordings/joint_mcap/joint_mcap.mcap"),
    ("log", "oracle/recordings/joint_db3/joint_db3.db3"),
    ("log", "oracle/recordings/log.parquet"),
    ("log", "oracle/recordings/hg.csv.gz"),
    ("model", "oracle/model.toml"),
    ("model", "robots/arm.urdf"),
    ("model", "robots/biped.urdf"),
];

/// The seeds of a target.
///
/// # Panics
/// If the tests' files are not there.
pub fn of(target: &str) -> Vec<Vec<u8>> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests");
    let files = FILES.iter().filter(|(of, _)| *of == target);
    let files = files.map(|(_, path)| fs::read(tests.join(path)).expect("a file of the tests"));
    let mut seeds: Vec<_> = files.collect();
    match target {
        "bus" => seeds.push(pieces(20, |_| Vec::new())),
        "step" => seeds.push(pieces(20, |n| vec![n % 4])),
        "wire" => seeds.extend([frames(&asked()), frames(&told())]),
        "log" => seeds.extend([csv(','), csv(';')]),
        "model" => seeds.push(written(|path| {
            Model::default().save(path).expect("it can be written");
        })),
        "dynamics" => seeds.extend(crate::dynamics::seeds()),
        "recording" => seeds.extend([messages(), capture(), factors(), blocks()]),
        _ => {}
    }
    seeds
}

/// The replies of a cycle, each after its command, of motors that swing.
fn cycle(n: u32) -> Vec<Vec<u8>> {
    let t = 0.002 * f64::from(n);
    let motors = ACTUATORS.iter().enumerate().flat_map(|(j, actuator)| {
        let mode = Mode::foc(j as u8);
        let q = [0.0, 0.8, -1.7][j] + 0.3 * (9.0 * t).sin();
        let (dq, tau) = (2.7 * (9.0 * t).cos(), (7.0 * t).sin());
        let reply = Reply::from_joint(mode, actuator.gear, q, dq, tau, 30);
        let reply = reply.expect("it fits a frame");
        let command = Command {
            mode,
            ..Command::default()
        };
        [
            command.encode(SEED_GO2).to_vec(),
            reply.encode(SEED_STANDALONE).to_vec(),
        ]
    });
    motors.collect()
}

/// Cycles in pieces of a frame, 50 µs apart, as the targets `bus` and `step` read them; before each stands `head`.
fn pieces(cycles: u32, head: impl Fn(u8) -> Vec<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for n in 0..cycles {
        for (place, frame) in cycle(n).into_iter().enumerate() {
            // In units of 8 µs; the next cycle comes 2 ms after this one.
            let elapsed: i16 = if place == 0 { 220 } else { 6 };
            bytes.extend(head(n as u8));
            bytes.push(frame.len() as u8);
            bytes.extend(elapsed.to_le_bytes());
            bytes.extend(frame);
        }
    }
    bytes
}

fn frames<M: Message>(messages: &[M]) -> Vec<u8> {
    let mut sender = Sender::default();
    let frames = messages.iter().flat_map(|message| {
        let mut buffer = [0; MAX_FRAME];
        sender.encode(message, &mut buffer).to_vec()
    });
    frames.collect()
}

fn asked() -> Vec<HostMessage> {
    let at = EffectAt {
        leg: 0,
        joint: 2,
        effect: 7,
    };
    let actions = [
        Action::Reset,
        Action::AddEffect(at),
        Action::DropEffect(at),
        Action::SetMemory(60),
    ];
    let requests = (1..).zip(actions);
    let requests = requests.map(|(id, action)| HostMessage::Request(Request { id, action }));
    let advance = Advance {
        time_us: 2_000,
        bytes: [99; 4],
    };
    let others = [HostMessage::RequestHello, HostMessage::Advance(advance)];
    requests.chain(others).collect()
}

/// What a device says in its first seconds.
fn told() -> Vec<DeviceMessage> {
    let mut device = Desktop::<f64>::new();
    let mut told = vec![DeviceMessage::Hello(device.hello().clone())];
    hear(&mut device, 500, &mut |message| told.push(message));
    told.truncate(24);
    told
}

/// Has a device hear cycles on all buses.
fn hear(device: &mut Desktop<f64>, cycles: u32, told: &mut dyn FnMut(DeviceMessage)) {
    for n in 1..=cycles {
        let step = BusStep {
            time_us: 2_000 * u64::from(n),
            buses: Leg::ALL.map(|_| cycle(n).concat()),
        };
        device.play(&step, told).expect("it is in this process");
    }
}

/// 2 s of a leg, as a recorder that separates by `separator` has it.
fn csv(separator: char) -> Vec<u8> {
    let joints = Leg::FR.joint_names();
    let names = ["q", "dq", "tau"].map(|kind| joints.map(|joint| format!("{kind}/{joint}")));
    let mut lines = vec![[vec!["t".to_owned()], names.concat()].concat()];
    for n in 0..200 {
        let t = 0.01 * f64::from(n);
        let place = |j: usize| [0.0, 0.8, -1.7][j] + 0.3 * (9.0 * t).sin();
        let q = (0..3).map(place);
        let dq = (0..3).map(|_| 2.7 * (9.0 * t).cos());
        let tau = (0..3).map(|_| (7.0 * t).sin());
        let numbers = [t].into_iter().chain(q).chain(dq).chain(tau);
        lines.push(numbers.map(|x| format!("{x:.4}")).collect());
    }
    let separator = separator.to_string();
    let lines = lines.iter().map(|line| line.join(&separator) + "\n");
    lines.collect::<String>().into_bytes()
}

fn messages() -> Vec<u8> {
    written(|path| {
        let mut journal = JournalWriter::create(path).expect("it can be written");
        let messages = told().into_iter().map(Entry::Message);
        let others = [
            Entry::Losses(1, 2),
            Entry::Request(Request {
                id: 1,
                action: Action::Reset,
            }),
        ];
        for (n, entry) in (0..).zip(messages.chain(others)) {
            let at = Duration::from_millis(n);
            journal.write(at, &entry).expect("it can be written");
        }
        journal.flush().expect("it can be written");
    })
}

fn capture() -> Vec<u8> {
    let mut capture = CaptureWriter::new(Vec::new(), BUS_BAUD).expect("a vector grows");
    for n in 0..40 {
        for (place, frame) in (0..).zip(cycle(n)) {
            let time_us = 2_000 * u64::from(n) + 50 * place;
            capture.record(time_us, &frame).expect("a vector grows");
        }
    }
    capture.finish().expect("a vector grows")
}

fn factors() -> Vec<u8> {
    let mut device = Desktop::<f64>::new();
    hear(&mut device, 500, &mut |_| ());
    let mut pull = Pull::new(&[Leg::FR], Factors::of_device(device.hello()));
    let mut time_us = 1_000_000;
    loop {
        if let Some(message) = pull.ask(Instant::now()) {
            device.command(&message).expect("it is in this process");
        }
        time_us += 2_000;
        let silent = BusStep {
            time_us,
            ..BusStep::default()
        };
        let mut parts = Vec::new();
        let mut told = |message| {
            if let DeviceMessage::FactorPart(part) = message {
                parts.push(part);
            }
        };
        device
            .play(&silent, &mut told)
            .expect("it is in this process");
        for part in parts {
            pull.hear(&part).expect("the parts are the device's");
        }
        if let Some(factors) = pull.finished() {
            return written(|path| factors.write(path).expect("it can be written"));
        }
    }
}

/// Blocks of one joint with one column.
fn blocks() -> Vec<u8> {
    let columns = BlockColumns {
        limb: "FR".to_owned(),
        joints: vec!["FR_hip".to_owned()],
        window_us: 20_000,
        cad: "0".to_owned(),
        columns: vec![KeptColumn {
            name: "bias:FR_hip".to_owned(),
            unit: "N m".to_owned(),
            mean: 0.0,
            std: 1.0,
            joints: vec![0],
        }],
    };
    let (hash, columns) = (Arc::from(columns.hash()), Arc::new(columns));
    let block = |n: u32| {
        Block {
            robot: "one".to_owned(),
            site: None,
            firmware: Some("1".to_owned()),
            log: format!("log {n}"),
            t0: f64::from(n),
            t1: f64::from(n) + 0.5,
            received: 9.0,
            limb: "FR".to_owned(),
            joint: "FR_hip".to_owned(),
            fold: 0,
            columns: Arc::clone(&columns),
            hash: Arc::clone(&hash),
            windows: 100.0,
            rms: 0.1,
            temperature: Some(40.0),
            factor: vec![10.0, 2.0 + 0.1 * n as f32, 1.0],
            crc32c: 0,
            program: "seed".to_owned(),
        }
        .sealed()
    };
    let blocks: Vec<Block> = (0..9).map(block).collect();
    written(|path| fleet::write(path, &blocks).expect("it can be written"))
}

/// What `write` writes into a file.
fn written(write: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("seed");
    write(&path);
    fs::read(&path).expect("it was written")
}
