//! `proprio capture`: what a capture says, and what is refused.

use std::fs;
use std::io::Write;

use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE, checksum};
use proprio_core::bus::{Command, Mode, Reply};
use proprio_core::go2::Leg;
use proprio_host::capture::{CaptureWriter, Facts, Told};
use proprio_host::device::Robot;
use proprio_host::device::power_up::PowerUp;
use proprio_host::device::serial::BUS_BAUD;
use proprio_simulator::hidden::typical;
use proprio_tests::command::{done, folder, json, parameter, proprio, stderr, stdout};

/// A capture of a leg that is polled 500 times a second, motor 2 first.
fn capture() -> Vec<u8> {
    let mut writer = CaptureWriter::new(Vec::new(), BUS_BAUD).unwrap();
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
    // What carries no bytes is recorded, not captured.
    for source in ["dds:eth0/lowstate", "-"] {
        let way = format!("proprio record {source} -o LOG");
        refused(&["capture", source, "-o", "a.cap"], 2, &way);
    }
    // A capture cannot be made again.
    let mut file = fs::File::create(folder.path().join("FR.cap")).unwrap();
    file.write_all(&capture()).unwrap();
    refused(
        &["capture", "/dev/no-such-port", "-o", "FR.cap"],
        1,
        "would be replaced",
    );
}

/// The simulated robot's bus is a log as it stands, of the leg that is asked for.
#[test]
fn a_simulated_bus_is_captured_in_real_time() {
    let folder = folder();
    let at = folder.path();
    for (leg, more) in [("FR", &[][..]), ("RL", &["--leg", "RL"])] {
        let name = format!("{leg}.cap");
        let words = ["capture", "sim", "-o", &name, "--seconds", "2", "--json"];
        let said = json(&done(at, &[&words[..], more].concat()));
        let records = said["records"].as_u64().unwrap();
        assert!((990..=1_001).contains(&records), "{said}");
        assert!(said.get("board").is_none(), "{said}");
        let explained = json(&done(at, &["capture", "--explain", &name, "--json"]));
        assert!(
            explained["cycles"].as_u64().unwrap() + 2 >= records,
            "{explained}"
        );
        let imported = ["import", &name, "-o", "log.csv", "--force", "--json"];
        let imported = json(&done(at, &imported));
        let joints = imported["joints"].as_array().unwrap();
        assert_eq!(joints.len(), 3);
        assert!(
            joints
                .iter()
                .all(|joint| joint.as_str().unwrap().starts_with(leg))
        );
    }
}

/// Pieces of eight cycles, as a latency timer of 16 ms makes them of 500 Hz: there is no rate, and no log.
#[test]
fn a_capture_of_an_adapter_that_waits_says_what_to_set() {
    let folder = folder();
    let leg = Leg::FR;
    let facts = Facts {
        leg: Some(leg),
        told: Told::Angles,
    };
    let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
    let robot = Robot::new(&[leg], typical(&[leg]), 5);
    let steps: Vec<_> = robot.steps().take(400).map(Result::unwrap).collect();
    for piece in steps.chunks(8) {
        let bytes = piece
            .iter()
            .flat_map(|step| step.buses[leg.index()].to_vec());
        let bytes: Vec<u8> = bytes.collect();
        writer
            .record(piece[piece.len() - 1].time_us, &bytes)
            .unwrap();
    }
    fs::write(folder.path().join("FR.cap"), writer.finish().unwrap()).unwrap();
    let explain = ["capture", "--explain", "FR.cap"];
    let said = json(&done(folder.path(), &[&explain[..], &["--json"]].concat()));
    assert_eq!(
        said["grouped"],
        serde_json::json!({"cycles": 8.0, "every_ms": 16})
    );
    assert!(said["period_us"].is_null(), "{said}");
    let output = proprio(folder.path(), &explain);
    assert!(
        stderr(&output).contains("latency_timer"),
        "{}",
        stderr(&output)
    );
    assert!(stdout(&output).contains("Order, rate and turn-around are unknown"));
    let output = proprio(folder.path(), &["identify", "FR.cap"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("latency_timer"),
        "{}",
        stderr(&output)
    );
}

/// A capture is a log: of which leg and from where its motors count is in it, and what is missing is said.
#[test]
fn a_capture_that_says_where_the_joints_were_is_a_log_whatever_the_power_up() {
    let folder = folder();
    let leg = Leg::FL;
    let write = |name: &str, power_up: PowerUp, facts: &Facts, silent: std::ops::Range<usize>| {
        let robot = Robot::new(&[leg], typical(&[leg]), 5).after(power_up);
        let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, facts).unwrap();
        for (n, step) in robot.steps().take(4_000).enumerate() {
            let step = step.unwrap();
            if !silent.contains(&n) {
                writer
                    .record(step.time_us, &step.buses[leg.index()])
                    .unwrap();
            }
        }
        fs::write(folder.path().join(name), writer.finish().unwrap()).unwrap();
    };
    let angles = Facts {
        leg: Some(leg),
        told: Told::Angles,
    };
    write("plain.cap", PowerUp::NONE, &angles, 0..0);
    // Where the joints were as the capture began is in the first row of the log of angles.
    done(folder.path(), &["import", "plain.cap", "-o", "plain.csv"]);
    let text = fs::read_to_string(folder.path().join("plain.csv")).unwrap();
    let mut rows = text.lines();
    let names: Vec<&str> = rows.next().unwrap().split(',').collect();
    let first: Vec<f64> = rows
        .next()
        .unwrap()
        .split(',')
        .map(|x| x.parse().unwrap())
        .collect();
    let of = |name: &str| first[names.iter().position(|known| *known == name).unwrap()];
    let power_up = PowerUp::random(3);
    let at = [0, 1, 2].map(|joint| {
        let angle = of(&format!("q/{}", leg.joint_names()[joint]));
        (angle, power_up.is_reversed(leg, joint))
    });
    let placed = Facts {
        leg: Some(leg),
        told: Told::At(at),
    };
    write("FL.cap", power_up, &placed, 0..0);
    done(folder.path(), &["import", "FL.cap", "-o", "placed.csv"]);
    let placed_text = fs::read_to_string(folder.path().join("placed.csv")).unwrap();
    for (one, other) in text.lines().zip(placed_text.lines()).skip(1) {
        for (a, b) in one.split(',').zip(other.split(',')) {
            let [a, b]: [f64; 2] = [a, b].map(|x| x.parse().unwrap());
            // A count of the motor.
            assert!((a - b).abs() < 5e-5, "{one}\n{other}");
        }
    }
    assert_eq!(text.lines().count(), placed_text.lines().count());
    let identified = |file: &str| {
        json(&done(folder.path(), &["identify", file, "--json"]))["parameters"].clone()
    };
    let [one, other] = [identified("plain.csv"), identified("FL.cap")];
    for (a, b) in one
        .as_array()
        .unwrap()
        .iter()
        .zip(other.as_array().unwrap())
    {
        assert_eq!(a["name"], b["name"]);
        let [x, y] = [a, b].map(|p| p["value"].as_f64().unwrap());
        let std = a["std"].as_f64().unwrap();
        assert!((x - y).abs() <= 0.3 * std + 1e-6, "{a} {b}");
    }
    let text = done(folder.path(), &["capture", "--explain", "FL.cap"]);
    assert!(
        text.contains("calf") && text.contains("-2.723…-0.838"),
        "{text}"
    );

    // What is not in it is asked for; what a silence has made unknown is left out.
    let refused = |file: &str, part: &str| {
        let output = proprio(folder.path(), &["diagnose", file]);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    };
    write("FR.cap", power_up, &Facts::default(), 0..0);
    refused("FR.cap", "does not say where the joints' zeros are");
    write("bus.cap", power_up, &Facts::default(), 0..0);
    refused("bus.cap", "does not say of which leg");
    let output = proprio(folder.path(), &["capture", "--explain", "FR.cap"]);
    assert!(stderr(&output).contains("counts from elsewhere than the joint's zero"));
    write("silent.cap", power_up, &placed, 2_000..2_060);
    let output = proprio(folder.path(), &["import", "silent.cap", "-o", "cut.csv"]);
    assert!(
        stderr(&output).contains("1940 of 3940 polling cycles of FL are left out"),
        "{}",
        stderr(&output)
    );
    let rows = fs::read_to_string(folder.path().join("cut.csv"))
        .unwrap()
        .lines()
        .count();
    assert_eq!(rows, 2_001);
}

/// A capture is a log in every command; a device in this process makes the same of it whether `replay` plays it or `monitor` does.
#[test]
fn every_command_takes_a_capture() {
    let folder = folder();
    let at = folder.path();
    let leg = Leg::RR;
    let robot = Robot::new(&[leg], typical(&[leg]), 8);
    let facts = Facts {
        leg: Some(leg),
        told: Told::Angles,
    };
    for (name, skipped) in [("RR.cap", 0), ("later.cap", 5_000)] {
        let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
        for step in robot.steps().skip(skipped).take(5_000) {
            let step = step.unwrap();
            let bytes = &step.buses[leg.index()];
            writer.record(step.time_us, bytes).unwrap();
        }
        fs::write(at.join(name), writer.finish().unwrap()).unwrap();
    }
    let said = |words: &str| json(&done(at, &words.split_whitespace().collect::<Vec<_>>()));
    let value = |said: &serde_json::Value, name: &str| parameter(said, name)["value"].as_f64();
    let replayed = said("replay RR.cap --to desktop --json");
    let watched = said("monitor RR.cap --speed 0 --json");
    for known in replayed["parameters"].as_array().unwrap() {
        let name = known["name"].as_str().unwrap();
        let [one, std] = ["value", "std"].map(|key| known[key].as_f64().unwrap());
        let other = value(&watched, name).unwrap();
        assert!(
            (one - other).abs() < 1e-3 * std,
            "{name}: {one} {other} ± {std}"
        );
    }
    let counted = &watched["counters"]["legs"][leg.index()];
    assert_eq!(counted["samples"], replayed["legs"][0]["played"]);
    let identified = said("identify RR.cap --json");
    for name in ["viscous:RR_hip", "coulomb:RR_thigh", "armature:RR_calf"] {
        let number = |said: &serde_json::Value, key: &str| parameter(said, name)[key].as_f64();
        let [[one, std], [other, of_other]] = [&identified, &watched]
            .map(|said| ["value", "std"].map(|key| number(said, key).unwrap()));
        let std = std.hypot(of_other);
        assert!(
            (one - other).abs() < 3.0 * std,
            "{name}: {one} {other} ± {std}"
        );
    }
    said("diagnose RR.cap --json");
    said("identify RR.cap -o RR.toml --json");
    said("compare later.cap -m RR.toml --json");
    // At the pace of its time, until the user has seen enough.
    let begun = std::time::Instant::now();
    let part = said("monitor RR.cap --speed 5 --seconds 4 --json");
    assert!(begun.elapsed().as_secs_f64() > 0.7);
    let samples = &part["counters"]["legs"][leg.index()]["samples"];
    assert!(
        (1_900..2_100).contains(&samples.as_u64().unwrap()),
        "{samples}"
    );
    // What is known of a bus has to be in it for any of them.
    fs::write(at.join("unknown.cap"), capture()).unwrap();
    for command in ["monitor", "identify", "diagnose"] {
        let said = stderr(&proprio(at, &[command, "unknown.cap"]));
        assert!(said.contains("does not say of which leg"), "{said}");
    }
}

/// A motor at the end of its temperature's scale is named, and a log has no temperature of it.
#[test]
fn a_motor_at_the_end_of_its_temperature_scale_is_named() {
    let folder = folder();
    let at = folder.path();
    let facts = Facts {
        leg: Some(Leg::FR),
        told: Told::Angles,
    };
    let mut writer = CaptureWriter::of(Vec::new(), BUS_BAUD, &facts).unwrap();
    for (n, step) in Robot::new(&[Leg::FR], typical(&[Leg::FR]), 2)
        .steps()
        .take(2_000)
        .enumerate()
    {
        let step = step.unwrap();
        let mut bytes = step.buses[0].clone();
        // The thigh's reply: the second of three pairs.
        let reply = Command::LEN + (Command::LEN + Reply::LEN);
        let hot = if n < 500 { 60 } else { Reply::TOP_TEMPERATURE };
        let thigh = &mut bytes[reply..reply + Reply::LEN];
        thigh[11] = hot.to_le_bytes()[0];
        let crc = checksum(SEED_STANDALONE, &thigh[..14]);
        thigh[14..].copy_from_slice(&crc.to_le_bytes());
        writer.record(step.time_us, &bytes).unwrap();
    }
    fs::write(at.join("FR.cap"), writer.finish().unwrap()).unwrap();
    let explained = proprio(at, &["capture", "--explain", "FR.cap"]);
    let said = stderr(&explained);
    assert!(said.contains("motor 1: reports 127 °C"), "{said}");
    let imported = proprio(at, &["import", "FR.cap", "-o", "log.csv"]);
    let said = stderr(&imported);
    assert!(said.contains("temp/FR_thigh is 127 °C at cycle"), "{said}");
    assert!(said.contains("of 1 joint are unknown in up to"), "{said}");
    let log = fs::read_to_string(at.join("log.csv")).unwrap();
    let mut rows = log.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let thigh = names.iter().position(|name| *name == "temp/FR_thigh");
    let temperatures: Vec<&str> = rows.map(|row| row[thigh.unwrap()]).collect();
    assert_eq!((temperatures[0], temperatures[600]), ("60", "NaN"));
    assert!(!temperatures.contains(&"127"));
}
