//! `proprio replay` into a device in its own process, and into ports that are not there.

use proprio_tests::command::{done, json, parameter, proprio, simulated, stderr};

#[test]
fn a_device_in_this_process_says_what_identify_says() {
    let folder = simulated("--typical --legs FR,RL --duration 6 --repeats 0.05");
    let here = json(&done(
        folder.path(),
        &["identify", "log.csv", "--json", "--bus"],
    ));
    let there = json(&done(
        folder.path(),
        &["replay", "log.csv", "--json", "--to", "desktop"],
    ));
    assert_eq!(there["parameters"].as_array().unwrap().len(), 2 * 42);
    for estimate in there["parameters"].as_array().unwrap() {
        let name = estimate["name"].as_str().unwrap();
        for key in ["value", "std"] {
            let (a, b) = (
                estimate[key].as_f64().unwrap(),
                parameter(&here, name)[key].as_f64().unwrap(),
            );
            // A device tells f32, and folds base columns in two folds: the same up to the rounding of f64, in sigmas.
            let sigma = parameter(&here, name)["std"].as_f64().unwrap();
            assert!(
                (a - b).abs() <= 1e-7 * b.abs() + 1e-7 * sigma,
                "{key} of {name}: {a} there, {b} here"
            );
        }
    }
    // A bus never says what it measured twice: rows that repeat the one before are not played.
    let counters = &there["counters"]["legs"][0];
    let played = &there["legs"][0];
    let (samples, repeated) = (
        counters["samples"].as_u64().unwrap(),
        played["repeated"].as_u64().unwrap(),
    );
    assert_eq!(
        (samples + repeated, counters["bad_crc"].as_u64()),
        (3001, Some(0))
    );
    assert!(repeated < 300, "{repeated}");
    let text = done(
        folder.path(),
        &["replay", "log.csv", "--to", "desktop", "--scalar", "f32"],
    );
    assert!(
        text.starts_with("desktop, firmware ") && text.contains("32-bit"),
        "{text}"
    );
}

/// A hidden effect, found by the device, added on the running device, and then in its estimate.
#[test]
fn a_hidden_effect_is_named_by_the_device_and_added_to_it() {
    let folder = simulated("--typical --legs FR --duration 24 --hide quadratic_drag:FR_calf=0.05");
    let replay = ["replay", "log.csv", "--json", "--to", "desktop"];
    let before = json(&done(folder.path(), &replay));
    let best = before["diagnoses"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|found| found["active"] == false)
        .max_by(|a, b| {
            let gain = |found: &serde_json::Value| found["held_out_gain"].as_f64().unwrap();
            gain(a).total_cmp(&gain(b))
        })
        .unwrap();
    assert_eq!(
        (best["joint"].as_str(), best["effect"].as_str()),
        (Some("FR_calf"), Some("quadratic_drag")),
        "{best}"
    );
    let after = json(&done(
        folder.path(),
        &[
            &replay[..],
            &["--add", "quadratic_drag:FR_calf", "--drop", "bias:FR_hip"],
        ]
        .concat(),
    ));
    for change in after["changes"].as_array().unwrap() {
        assert_eq!(change["outcome"], "accepted", "{change}");
    }
    let drag = parameter(&after, "quadratic_drag:FR_calf");
    let (value, std) = (
        drag["value"].as_f64().unwrap(),
        drag["std"].as_f64().unwrap(),
    );
    assert!((value - 0.05).abs() < 0.2 * 0.05 + 3.0 * std, "{drag}");
    let names = |report: &serde_json::Value| report.to_string().contains("\"bias:FR_hip\"");
    assert!(names(&before) && !names(&after));
    let noise = |report: &serde_json::Value| report["legs"][0]["noise"][2].as_f64().unwrap();
    assert!(noise(&after) < noise(&before));

    let text = done(folder.path(), &["replay", "log.csv", "--to", "desktop"]);
    assert!(
        text.contains("held-out gain") && text.contains("quadratic_drag"),
        "{text}"
    );
}

#[test]
fn an_effect_that_is_not_on_the_device_is_refused_with_those_that_are() {
    let folder = simulated("--legs FR --duration 2");
    for (wish, expected) in [
        ("cogging", "it has viscous, coulomb"),
        ("colomb", "coulomb"),
        ("coulomb:FL_hip", "FL_hip"),
    ] {
        let arguments = ["replay", "log.csv", "--to", "desktop", "--add", wish];
        let output = proprio(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(1));
        let said = stderr(&output);
        assert!(said.contains(expected) && said.contains("hint: "), "{said}");
    }
}

#[test]
fn a_port_that_is_not_there_is_told_and_a_board_needs_bus_adapters() {
    let folder = simulated("--legs FR --duration 2");
    let output = proprio(
        folder.path(),
        &["replay", "log.csv", "--to", "/dev/no-such-port"],
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("--leg FR=PORT"),
        "{}",
        stderr(&output)
    );

    let arguments = [
        "replay",
        "log.csv",
        "--to",
        "/dev/no-such-port",
        "--leg",
        "FR=/dev/no-such-bus",
    ];
    let output = proprio(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("/dev/no-such-port") && stderr(&output).contains("\nhint: "));
}
