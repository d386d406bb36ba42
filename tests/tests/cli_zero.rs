//! `proprio zero` as its user meets it, and what `monitor` says while a zero is unknown.

use std::fmt::Write;
use std::fs;

use proprio_core::go2::{JointId, Leg, position_limits};
use proprio_tests::command::{done, folder, json, piped, proprio, stderr, stdout};

#[test]
#[allow(clippy::approx_constant)] // the URDF's rounding, not ours
fn a_device_is_told_where_the_joints_are_whatever_the_power_up() {
    let folder = folder();
    for seed in ["1", "2", "3"] {
        let words =
            "zero sim --legs FR --pose calves-folded --pose hips-out --at FR_thigh=0.8 --json";
        let words: Vec<&str> = words.split(' ').chain(["--seed", seed]).collect();
        let told = json(&done(folder.path(), &words));
        let joints = told["joints"].as_array().unwrap();
        assert_eq!(joints.len(), 3, "{told}");
        for (joint, angle) in joints.iter().zip([-1.0472, 0.8, -2.7227]) {
            assert_eq!(joint["angle"], angle, "{told}");
            assert_eq!(
                (&joint["answer"], &joint["known"]),
                (&"accepted".into(), &true.into())
            );
        }
    }
    // What is known of a device that was told nothing.
    let told = json(&done(folder.path(), &["zero", "sim", "--json"]));
    let joints = told["joints"].as_array().unwrap();
    assert!(
        joints.len() == 12 && joints.iter().all(|joint| joint["known"] == false),
        "{told}"
    );
    let text = done(folder.path(), &["zero", "sim"]);
    assert!(text.contains("unknown: not set"), "{text}");
}

/// Rows of joints that rest at `angles`, as a driver prints them, at 100 Hz: every third row off by less than the bus can tell apart, and at one joint
/// and from one row on by `moved`.
fn resting(legs: &[Leg], seconds: f64, moved: f64) -> String {
    let joints: Vec<JointId> = legs.iter().flat_map(|leg| JointId::of(*leg)).collect();
    let names = |prefix: &str| -> String {
        let names = joints
            .iter()
            .map(|joint| format!(",{prefix}/{}", joint.name()));
        names.collect()
    };
    let mut text = format!("t{}{}{}\n", names("q"), names("dq"), names("tau"));
    for row in 0..=(100.0 * seconds) as usize {
        write!(text, "{:.2}", row as f64 / 100.0).unwrap();
        for (n, joint) in joints.iter().enumerate() {
            let off = if row % 3 == 0 { 1e-5 } else { 0.0 };
            let off = off + if n == 1 && row >= 60 { moved } else { 0.0 };
            write!(text, ",{:.6}", rests_at(*joint) + off).unwrap();
        }
        joints.iter().for_each(|_| text.push_str(",0.01"));
        joints.iter().for_each(|_| text.push_str(",0.5"));
        text.push('\n');
    }
    text
}

/// Where they rest: somewhere within the limits, each elsewhere.
fn rests_at(joint: JointId) -> f64 {
    let [lower, upper] = position_limits(joint.leg())[joint.place()];
    let share = 0.3 + 0.1 * joint.leg().index() as f64;
    1e-4 * (1e4 * (lower + share * (upper - lower))).round()
}

#[test]
fn a_device_is_told_where_the_robot_itself_says_that_its_joints_rest() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("rest.csv"), resting(&Leg::ALL, 1.5, 0.0)).unwrap();
    let told = |more: &[&str]| {
        let words = [&["zero", "sim", "--from", "-", "--json"], more].concat();
        let output = piped(at, "rest.csv", &words);
        assert!(output.status.success(), "{}", stderr(&output));
        json(&stdout(&output))["joints"].as_array().unwrap().clone()
    };
    let all = told(&["--seed", "3", "--reversed", "RL_calf"]);
    assert_eq!(all.len(), 12);
    for (said, joint) in all.iter().zip(JointId::all()) {
        assert_eq!(said["joint"], joint.name());
        let angle = said["angle"].as_f64().unwrap();
        assert!((angle - rests_at(joint)).abs() < 1e-9, "{said}");
        assert_eq!(
            (&said["answer"], &said["known"]),
            (&"accepted".into(), &true.into())
        );
        assert_eq!(said["reversed"], joint.name() == "RL_calf");
    }
    // Of one leg, and of a joint told twice what --at says.
    let some = told(&["--legs", "FL", "--at", "FL_hip=0.1"]);
    let angles = some.iter().map(|said| said["angle"].as_f64().unwrap());
    let [_, thigh, calf] = JointId::of(Leg::FL).map(rests_at);
    assert_eq!(some.len(), 3);
    for (angle, expected) in angles.zip([0.1, thigh, calf]) {
        assert!((angle - expected).abs() < 1e-9, "{angle} {expected}");
    }
}

#[test]
fn what_does_not_say_where_joints_rest_is_refused_and_nothing_is_set() {
    let folder = folder();
    let at = folder.path();
    let refused = |text: &str, more: &[&str], parts: &[&str]| {
        fs::write(at.join("rows.csv"), text).unwrap();
        // No port is opened: there is none of this name.
        let words = [&["zero", "none", "--from", "-"], more].concat();
        let output = piped(at, "rows.csv", &words);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        parts
            .iter()
            .for_each(|part| assert!(said.contains(part), "{said}"));
    };
    let rest = |seconds| resting(&[Leg::FR], seconds, 0.0);
    let moves = resting(&[Leg::FR], 1.5, 0.02);
    refused(
        &moves,
        &[],
        &[
            "FR_thigh moves",
            "0.0200 rad from its median",
            "until its joints rest",
        ],
    );
    let fast = rest(1.5).replacen(",0.01,0.01,0.01,", ",0.01,0.01,0.15,", 1);
    refused(
        &fast,
        &[],
        &["FR_calf moves: 0.15 rad/s", "at most 0.105 rad/s"],
    );
    refused(
        &rest(0.5),
        &[],
        &["51 rows of 0.50 s", "give a second of it"],
    );
    refused(
        &rest(1.5),
        &["--legs", "FR,RL"],
        &["nothing of RL", "--legs"],
    );
    let header = rest(0.0).lines().next().unwrap().to_owned();
    refused(&header, &[], &["0 rows", "give a second of it"]);
    refused(
        &rest(1.5).replace("tau/FR_calf", "x"),
        &[],
        &["tau/FR_calf"],
    );
    let beyond = |line: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if line.starts_with(|c: char| c.is_ascii_digit()) {
            cells[3] = "0.5";
        }
        cells.join(",") + "\n"
    };
    let beyond: String = rest(1.5).lines().map(beyond).collect();
    refused(&beyond, &[], &["FR_calf is at 0.5", "beyond its limits"]);
    // A motor bus does not say it, whatever listens to it.
    for bus in ["sim", "FR=/dev/ttyUSB0", "qemu"] {
        let output = proprio(at, &["zero", "none", "--from", bus]);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains("dds[:IFACE][/TOPIC] or -"));
    }
}

#[test]
fn what_cannot_be_is_refused_before_a_device_hears_of_it() {
    let folder = folder();
    let refused = |arguments: &[&str], status: i32, part: &str| {
        let output = proprio(folder.path(), arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        assert!(said.contains(part), "{said}");
    };
    refused(
        &["zero", "none", "--at", "FR_calf=0.5"],
        2,
        "is between -2.7227 and -0.83776 rad",
    );
    refused(
        &["zero", "none", "--at", "FR_tail=0.5"],
        2,
        "no joint is called FR_tail",
    );
    refused(&["zero", "none", "--pose", "sitting"], 2, "calves-folded");
    refused(
        &["zero", "none", "--reversed", "FR_hip"],
        2,
        "without its angle",
    );
    refused(&["zero", "none", "--pose", "hips-out"], 1, "none");
    refused(&["zero", "sim", "--same-power-up"], 1, "kept no zeros");
    // No port is opened for what is only asked about.
    let told = done(
        folder.path(),
        &["zero", "none", "--pose", "hips-out", "--dry-run"],
    );
    assert!(told.contains("FL_hip     1.0472  would be set"), "{told}");
}

#[test]
fn a_monitor_says_that_a_zero_is_unknown_and_shows_no_estimate() {
    let folder = folder();
    let words = [
        "monitor",
        "sim",
        "--power-up",
        "7",
        "--speed",
        "0",
        "--seconds",
        "12",
    ];
    let report = json(&done(folder.path(), &[&words[..], &["--json"]].concat()));
    assert_eq!(
        report["zero_unknown"],
        serde_json::json!(["FR", "FL", "RR", "RL"])
    );
    assert_eq!(report["parameters"], serde_json::json!([]));
    let legs = report["counters"]["legs"].as_array().unwrap();
    for leg in legs {
        assert!(
            leg["samples"].as_u64().unwrap() > 4000 && leg["windows"] == 0,
            "{leg}"
        );
        assert_eq!(leg["unplaced"], leg["samples"]);
    }
    let events = report["events"].to_string();
    assert!(events.contains("unknown: not set"), "{events}");
    let lines = done(folder.path(), &[&words[..], &["--lines"]].concat());
    assert!(lines.contains("FR zero unknown, 500 samples/s"), "{lines}");
}
