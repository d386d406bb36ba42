//! What is given any bytes at all, and must neither panic nor lose count.
//!
//! The programs in `fuzz_targets/` have libFuzzer find inputs for these functions; `tests/corpus.rs` replays those that are
//! committed. With a nightly compiler and `cargo install cargo-fuzz`, from the root:
//!
//! ```sh
//! cargo +nightly fuzz run --features libfuzzer --sanitizer none bus -- -max_total_time=600 -max_len=4096
//! ```
#![forbid(unsafe_code)]

pub mod dynamics;
pub mod seeds;

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use proprio_core::app::{App, Identity, Memory, Start};
use proprio_core::bus::{Command, Listener, Queue, Reply};
use proprio_core::wire::{DeviceMessage, HostMessage, MAX_FRAME, Message, Receiver, Sender};
use proprio_host::capture::{CaptureReader, explain};
use proprio_host::factors::Factors;
use proprio_host::fleet::{self, Gate};
use proprio_host::log::{LogReader, Selection};
use proprio_host::model::{Model, Robot};
use proprio_host::monitor::{Entry, JournalReader, View};
use proprio_host::recording::Recording;

/// What takes any bytes.
pub type Target = fn(&[u8]);

/// What is fuzzed: its name, which is that of its corpus, and what takes the bytes.
pub const TARGETS: [(&str, Target); 7] = [
    ("bus", bus),
    ("step", step),
    ("wire", wire),
    ("log", log),
    ("model", model),
    ("recording", recording),
    ("dynamics", dynamics::dynamics),
];

/// What a bus brings in pieces: a length and a time for each.
///
/// # Panics
/// If a byte is counted twice, or a reply.
pub fn bus(bytes: &[u8]) {
    let (mut queue, mut listener) = (Queue::new(), <Listener>::new());
    let (mut rest, mut time_us, mut brought, mut cycles) = (bytes, 0_u64, 0, 0);
    while let Some(([length, time @ ..], after)) = rest.split_first_chunk::<3>() {
        let (piece, after) = after.split_at(after.len().min(usize::from(*length)));
        rest = after;
        // The clock may go back.
        let elapsed = i16::from_le_bytes(*time);
        time_us = time_us.saturating_add_signed(8 * i64::from(elapsed));
        queue.push(piece, time_us, 2500);
        brought += piece.len() as u32;
        while listener.next(&mut queue, &mut 700).is_some() {
            cycles += 1;
        }
    }
    let frames = listener.frames();
    let framed = Command::LEN as u32 * frames.commands + Reply::LEN as u32 * frames.replies;
    let counted = framed + frames.skipped_bytes + queue.lost();
    assert!(counted <= brought, "{counted} of {brought} bytes");
    let replies = 3 * cycles + listener.cycles().unused_replies;
    assert!((replies..replies + 3).contains(&frames.replies));
}

/// Steps of the whole application: a bus or the host's line, a length and a time for each.
///
/// # Panics
/// If what it tells is not finite, or a count does not add up.
pub fn step(bytes: &[u8]) {
    let identity = Identity {
        firmware: "fuzz",
        board: "desktop",
        start: Start::UNKNOWN,
        load_unit: "nothing",
        budget: u32::MAX,
        byte_ns: 2500,
        positions: proprio_core::wire::Positions::Absolute,
    };
    let (mut app, mut memory) = (Box::new(App::<f64>::new(identity)), Box::new(Memory::new()));
    let mut host = Receiver::<HostMessage>::default();
    let (mut rest, mut time_us) = (bytes, 0_u64);
    while let Some(([line, length, time @ ..], after)) = rest.split_first_chunk::<4>() {
        let (piece, after) = after.split_at(after.len().min(usize::from(*length)));
        rest = after;
        let elapsed = i16::from_le_bytes(*time);
        time_us = time_us.saturating_add_signed(8 * i64::from(elapsed));
        match line % 5 {
            4 => {
                for byte in piece {
                    if let Some(Ok(message)) = host.push(*byte) {
                        app.handle(&mut memory, &message);
                    }
                }
            }
            leg => app.hear(&mut memory, usize::from(leg), piece, time_us),
        }
        app.step(&mut memory, time_us, &mut |message| {
            if let DeviceMessage::Estimate(told) = message {
                let mut numbers = told.values.iter().chain(&told.std).chain(&told.noise);
                assert!(numbers.all(|x| x.is_finite()), "{told:?}");
            }
        });
    }
    for leg in app.counters(&memory, time_us).legs {
        assert_eq!(leg.samples, leg.used + leg.late + leg.rejected);
        assert!(leg.replies >= 3 * leg.samples + leg.unused_replies);
    }
}

/// What comes over the link, to a board and to a host.
///
/// # Panics
/// If a message that was read is not the same once more.
pub fn wire(bytes: &[u8]) {
    receive::<HostMessage>(bytes);
    receive::<DeviceMessage>(bytes);
}

/// A frame is compared with a frame: numbers that are not a number equal nothing, their bytes do.
fn receive<M: Message>(bytes: &[u8]) {
    let mut receiver = Receiver::<M>::default();
    for &byte in bytes {
        let Some(Ok(message)) = receiver.push(byte) else {
            continue;
        };
        let mut frame = [0; MAX_FRAME];
        let frame = Sender::default().encode(&message, &mut frame);
        let mut again = Receiver::<M>::default();
        let mut heard = frame.iter().filter_map(|&byte| again.push(byte));
        let Some(Ok(heard)) = heard.next() else {
            panic!("a message that was read cannot be said")
        };
        let mut buffer = [0; MAX_FRAME];
        assert_eq!(Sender::default().encode(&heard, &mut buffer), frame);
    }
}

/// A log of any format: rows one by one, then the whole.
pub fn log(bytes: &[u8]) {
    let path = file("log", bytes);
    let Ok(mut reader) = LogReader::open(&path, Selection::Everything) else {
        return;
    };
    while let Ok(Some(row)) = reader.next_row() {
        std::hint::black_box(row.q());
    }
    if reader.finish().is_ok() {
        // Whatever is wrong with it is an error of its own.
        let _ = Recording::read(&[path], &Model::default(), |_, _| ());
    }
}

/// A model file, or a URDF.
///
/// # Panics
/// If a model that was read does not come back.
pub fn model(bytes: &[u8]) {
    let path = file("model.toml", bytes);
    if bytes.starts_with(b"<") {
        if let Ok(robot) = Robot::from_urdf(&path) {
            std::hint::black_box(robot.limbs());
        }
        return;
    }
    let Ok(model) = Model::load(&path) else {
        return;
    };
    let save = |model: &Model, name: &str| {
        let path = path.with_file_name(name);
        model.save(&path).expect("it can be written");
        path
    };
    let first = save(&model, "first.toml");
    let again = Model::load(&first).expect("what was written can be read");
    let second = save(&again, "second.toml");
    let text = |path: &Path| std::fs::read_to_string(path).expect("it is text");
    assert_eq!(text(&first), text(&second));
}

/// What proprio records: messages, a motor bus's bytes, factors, blocks.
pub fn recording(bytes: &[u8]) {
    let path = file("recording", bytes);
    if let Ok(mut reader) = JournalReader::open(&path) {
        let mut view = View::default();
        while let Ok(Some((_, entry))) = reader.next_entry() {
            match entry {
                Entry::Message(message) => view.hear(&message),
                Entry::Losses(bad, missed) => view.lose(bad, missed),
                Entry::Request(request) => view.ask(request.id, request.action),
            }
        }
        std::hint::black_box(view.ranking());
    }
    if let Ok(mut capture) = CaptureReader::new(bytes, "capture".to_owned()) {
        let _ = explain(&mut capture);
    }
    if let Ok(factors) = Factors::read(&path) {
        for leg in factors.legs() {
            let _ = factors.solve(leg);
        }
        let _ = factors.clone().merge(&factors);
    }
    let mut gate = Gate::default();
    let blocks = fleet::read(&path).blocks.into_iter();
    let admitted: Vec<_> = blocks.filter_map(|block| gate.admit(block).ok()).collect();
    std::hint::black_box(fleet::final_answers(fleet::partial(admitted)));
}

thread_local! {
    /// One folder for all that a thread writes.
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// A file of these bytes.
pub(crate) fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder"));
        folder.path().join(name)
    });
    std::fs::write(&path, bytes).expect("it can be written");
    path
}
