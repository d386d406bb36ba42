//! `proprio zero` as its user meets it, and what `monitor` says while a zero is unknown.

use proprio_tests::command::{done, folder, json, proprio, stderr};

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
    assert!(
        text.contains("unknown: nobody has said where it is"),
        "{text}"
    );
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
        "not where it is",
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
    assert!(
        events.contains("unknown: nobody has said where it is"),
        "{events}"
    );
    let lines = done(folder.path(), &[&words[..], &["--lines"]].concat());
    assert!(lines.contains("FR zero unknown, 500 samples/s"), "{lines}");
}
