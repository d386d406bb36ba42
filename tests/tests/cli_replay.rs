//! `proprio replay` into a device in its own process, and into ports that are not there.

use proprio_tests::command::{done, json, parameter, proprio, stderr};

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn a_device_in_this_process_says_what_identify_says() {
    let folder = folder();
    let simulate = [
        "simulate",
        "--typical",
        "--legs",
        "FR,RL",
        "--duration",
        "6",
        "--repeats",
        "0.05",
    ];
    done(folder.path(), &[&simulate[..], &["-o", "log.csv"]].concat());
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
            // A device tells f32.
            assert!(
                (a - b).abs() <= 1e-7 * b.abs(),
                "{key} of {name}: {a} there, {b} here"
            );
        }
    }
    let counters = &there["counters"]["legs"][0];
    assert_eq!(
        (counters["samples"].as_u64(), counters["bad_crc"].as_u64()),
        (Some(3001), Some(0))
    );
    let text = done(
        folder.path(),
        &["replay", "log.csv", "--to", "desktop", "--scalar", "f32"],
    );
    assert!(
        text.starts_with("desktop, firmware ") && text.contains("32-bit"),
        "{text}"
    );
}

#[test]
fn a_port_that_is_not_there_is_told_and_a_board_needs_bus_adapters() {
    let folder = folder();
    done(
        folder.path(),
        &[
            "simulate",
            "--legs",
            "FR",
            "--duration",
            "2",
            "-o",
            "log.csv",
        ],
    );
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
