//! Bags of ROS 2 give what their CSV gives.

use std::path::Path;
use std::process::Command;

use proprio_tests::command::{done, folder, json, proprio, recorded_logs, stderr, stdout};

use super::recordings;

/// Nothing but where the log lies differs between what is found in a bag and in its CSV.
#[test]
fn a_bag_gives_the_estimates_of_its_csv() {
    let of = |log: &str| {
        let path = recordings().join(log);
        let mut result = json(&done(
            Path::new("."),
            &["identify", path.to_str().unwrap(), "--json"],
        ));
        result.as_object_mut().unwrap().remove("logs");
        result["warnings"].take();
        result
    };
    let expected = of("low_state.csv.gz");
    assert!(expected["parameters"].as_array().unwrap().len() > 100);
    for bag in ["go_mcap", "go_mcap_zstd", "go_lz4.mcap", "go_db3"] {
        assert_eq!(of(bag), expected, "{bag}");
    }
}

/// In a rollout drives follow the commands that a bag has beside its states as they do those of its CSV.
#[test]
fn drives_follow_the_commands_of_a_bag() {
    let of = |log: &str| {
        let path = recordings().join(log);
        let words = ["compare", path.to_str().unwrap(), "--rollout=commanded"];
        let found = json(&done(Path::new("."), &[&words[..], &["--json"]].concat()));
        assert_eq!(found["torque"], "commanded");
        found["horizons"].clone()
    };
    assert_eq!(of("commanded_db3"), of("commanded.csv.gz"));
}

/// The same with a real chirp, where one is at hand and Python has the writers.
#[test]
fn a_bag_of_a_real_chirp_gives_the_estimates_of_its_csv() {
    let Some(logs) = recorded_logs() else { return };
    let python = std::env::var("PROPRIO_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let folder = folder();
    let made = Command::new(&python)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/recordings.py"))
        .arg(folder.path())
        .args(["--seconds", "5", "--log"])
        .arg(logs.join("go2_air_chirp_7.0hz_p25d5.0.csv"))
        .output();
    if !made.is_ok_and(|made| made.status.success()) {
        println!("skipped: {python} lacks what tests/oracle/requirements-recordings.txt names");
        return;
    }
    for (bag, csv) in [
        ("go_mcap_zstd", "low_state.csv.gz"),
        ("go_db3", "low_state.csv.gz"),
        ("joint_mcap", "joint_state.csv.gz"),
    ] {
        let of = |log: &str| {
            let mut result = json(&done(folder.path(), &["identify", log, "--json"]));
            result.as_object_mut().unwrap().remove("logs");
            result["warnings"].take();
            result
        };
        assert_eq!(of(bag), of(csv), "{bag}");
    }
}

/// Of a bag with two topics of joint states the fuller one is read, and the other told.
#[test]
fn the_other_topics_are_told() {
    let bag = recordings().join("go_mcap");
    let folder = folder();
    let output = proprio(
        folder.path(),
        &["import", bag.to_str().unwrap(), "-o", "log.csv"],
    );
    insta::assert_snapshot!(stderr(&output));
    let report = stdout(&output);
    assert!(
        report.contains("120 samples of 12 joints") && report.contains("500 Hz"),
        "{report}"
    );
}
