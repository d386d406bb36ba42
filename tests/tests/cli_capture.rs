//! `proprio capture`: what a capture says, and what is refused.

use std::fs;
use std::io::Write;

use proprio_core::bus::crc::SEED_GO2;
use proprio_core::bus::{Command, Mode, Reply};
use proprio_host::capture::CaptureWriter;
use proprio_tests::command::{done, folder, json, proprio, stderr};

/// A capture of a leg that is polled 500 times a second, motor 2 first.
fn capture() -> Vec<u8> {
    let mut writer = CaptureWriter::new(Vec::new(), 4_000_000).unwrap();
    for n in 0..2000u64 {
        let mut time_us = 1_000 + 2_000 * n;
        for id in [2, 0, 1] {
            let mode = Mode::foc(id);
            let command = Command {
                mode,
                ..Command::default()
            };
            time_us += 43;
            writer.record(time_us, &command.encode(SEED_GO2)).unwrap();
            let reply = Reply {
                mode,
                position: n as i32,
                ..Reply::default()
            };
            time_us += 65;
            writer.record(time_us, &reply.encode(0)).unwrap();
        }
    }
    writer.finish().unwrap()
}

#[test]
fn a_capture_is_explained_in_words_and_in_json() {
    let folder = folder();
    fs::write(folder.path().join("FR.cap"), capture()).unwrap();
    let said = json(&done(
        folder.path(),
        &["capture", "--explain", "FR.cap", "--json"],
    ));
    assert_eq!(said["order"], serde_json::json!([2, 0, 1]));
    assert_eq!(
        (&said["period_us"], &said["cycles"]),
        (&2000.into(), &2000.into())
    );
    assert_eq!(said["motors"][1]["turnaround"]["median"], 25);
    let text = done(folder.path(), &["capture", "--explain", "FR.cap"]);
    assert!(
        text.contains("Polled in the order 2, 0, 1, every 2000 µs (500 Hz)"),
        "{text}"
    );
    assert!(
        text.contains("2000 cycles become samples: 100.00 %"),
        "{text}"
    );
}

#[test]
fn what_is_no_capture_no_port_and_no_file_of_ones_own_is_refused() {
    let folder = folder();
    let refused = |arguments: &[&str], status: i32, part: &str| {
        let output = proprio(folder.path(), arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        assert!(said.contains(part), "{said}");
    };
    fs::write(folder.path().join("log.csv"), "t,q/FR_hip\n0,0\n").unwrap();
    refused(
        &["capture", "--explain", "log.csv"],
        1,
        "no capture of a motor bus",
    );
    refused(
        &["capture", "--explain", "none.cap"],
        1,
        "hint: check the path",
    );
    refused(
        &["capture", "/dev/no-such-port", "-o", "a.cap"],
        1,
        "/dev/no-such-port",
    );
    assert!(!folder.path().join("a.cap").exists());
    refused(&["capture"], 2, "PORT");
    refused(&["capture", "/dev/no-such-port"], 2, "--output");
    // A capture cannot be made again.
    let mut file = fs::File::create(folder.path().join("FR.cap")).unwrap();
    file.write_all(&capture()).unwrap();
    refused(
        &["capture", "/dev/no-such-port", "-o", "FR.cap"],
        1,
        "would be replaced",
    );
}
