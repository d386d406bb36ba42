//! `proprio replay` into a device in its own process, and into ports that are not there.

use proprio_core::go2::Leg;
use proprio_host::parameter::names_of_leg;
use proprio_tests::command::{done, json, parameter, proprio, simulated, stderr};
use proprio_tests::device_fit::estimate_over_bus;

/// A device folds base columns in two folds and solves a step at a time: the same as core's estimator over all columns at once.
#[test]
fn a_device_in_this_process_says_what_cores_estimator_says() {
    let folder = simulated("--typical --legs FR,RL --duration 6 --repeats 0.05");
    let there = json(&done(
        folder.path(),
        &["replay", "log.csv", "--json", "--to", "desktop"],
    ));
    assert_eq!(there["parameters"].as_array().unwrap().len(), 2 * 42);
    for leg in [Leg::FR, Leg::RL] {
        let [values, std] = estimate_over_bus(&folder.path().join("log.csv"), leg).unwrap();
        for (k, (name, _)) in names_of_leg(leg).into_iter().enumerate() {
            let estimate = parameter(&there, &name);
            for (key, here) in [("value", values[k]), ("std", std[k])] {
                // A device tells f32: the same up to the rounding of f64, in sigmas.
                let said = estimate[key].as_f64().unwrap();
                assert!(
                    (said - here).abs() <= 1e-7 * here.abs() + 1e-7 * std[k],
                    "{key} of {name}: {said} there, {here} here"
                );
            }
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

/// Where the model lacks nothing, the device's bounded estimator and the desktop's agree within the errors that they state.
#[test]
fn a_devices_values_are_those_of_identify_within_their_errors() {
    let folder = simulated("--typical --legs FR,RL --duration 12");
    let run = |command: &[&str]| json(&done(folder.path(), command));
    let here = run(&["identify", "log.csv", "--bus", "--json"]);
    let there = run(&["replay", "log.csv", "--json", "--to", "desktop"]);
    let number = |of: &serde_json::Value, key: &str| of[key].as_f64().unwrap();
    let mut far = 0;
    for estimate in there["parameters"].as_array().unwrap() {
        let name = estimate["name"].as_str().unwrap();
        let other = parameter(&here, name);
        let std = number(estimate, "std").hypot(number(other, "std"));
        let apart = (number(estimate, "value") - number(other, "value")).abs() / std;
        // The same data: what they weigh differently is less than what noise makes of them.
        assert!(apart < 3.0, "{name}: {apart} of both errors apart");
        far += usize::from(apart > 2.0);
    }
    // Of 84 values that were independent, 4 would be beyond two standard deviations by chance.
    assert!(
        far <= 4,
        "{far} of 84 values are more than two errors apart"
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
