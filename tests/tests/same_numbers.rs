//! A recorded log through the real firmware image on the emulated Cortex-M7, and through the same application on the desktop: the same
//! numbers. `cli_replay` holds the application to core's estimator over all columns at once, and that to `identify`.

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, json, parameter, recorded_logs};
use proprio_tests::emulator;

/// The first `rows` samples of a recorded log, only the columns whose joint is one of `legs`' (all of them if empty).
fn excerpt(log: &Path, rows: usize, legs: &[&str]) -> String {
    let text = fs::read_to_string(log).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let keep: Vec<usize> = (0..header.len())
        .filter(|&column| {
            let joint = header[column].split('/').nth(1);
            legs.is_empty()
                || joint.is_none_or(|joint| legs.iter().any(|leg| joint.starts_with(leg)))
        })
        .collect();
    let lines = text.lines().take(rows + 1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        keep.iter()
            .map(|&column| cells[column])
            .collect::<Vec<_>>()
            .join(",")
            + "\n"
    });
    lines.collect()
}

#[test]
fn the_board_and_the_desktop_agree_on_a_recorded_log() {
    let Some(logs) = recorded_logs() else { return };
    if !emulator::is_there() {
        return;
    }
    let log = logs.join("go2_air_chirp_9.0hz_p25d5.0.csv");
    for (what, legs, rows, least) in [
        ("one leg", &["RL"][..], 3000, 4),
        ("four legs", &[], 1500, 16),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("log.csv"), excerpt(&log, rows, legs)).unwrap();
        let replay = |to: &str| {
            json(&done(
                folder.path(),
                &["replay", "log.csv", "--to", to, "--json"],
            ))
        };
        let (board, desktop) = (replay("qemu"), replay("desktop"));
        let consistent = |report: &serde_json::Value| {
            let legs = report["legs"].as_array().unwrap().iter();
            legs.map(|leg| leg["consistent"].clone())
                .collect::<Vec<_>>()
        };
        // Where least squares has a body that cannot exist, both report the physically consistent solution.
        assert_eq!(consistent(&board), consistent(&desktop), "{what}");
        let mut identified = 0;
        let mut worst = 0.0_f64;
        for there in board["parameters"].as_array().unwrap() {
            let name = there["name"].as_str().unwrap();
            let here = parameter(&desktop, name);
            assert_eq!(there["status"], here["status"], "{what}: {name}");
            let value = |from: &serde_json::Value| from["value"].as_f64().unwrap();
            let difference = (value(there) - value(here)).abs();
            // The wire's f32 rounds to 6e-8 of a value. The rest is the rounding of two ways to fold the same rows, which the
            // worst direction of so short a log magnifies: to 1e-5 standard deviations.
            let sigma = here["std"].as_f64().unwrap();
            assert!(
                difference <= 1e-7 * value(here).abs() + 1e-5 * sigma,
                "{what}: {name} differs by {:e} standard deviations",
                difference / sigma
            );
            assert_eq!(there["at_bound"], here["at_bound"], "{what}: {name}");
            // One at its bound is there to the last bit, and has no size to be compared with.
            if here["status"] != "identified" || here["at_bound"] == true {
                continue;
            }
            identified += 1;
            // Of its own size, or of its standard deviation where a bias is nearly nothing.
            let difference = difference / value(here).abs().max(sigma);
            assert!(
                difference <= 1e-5,
                "{what}: {name} differs by {difference:e}"
            );
            worst = worst.max(difference);
        }
        println!("{what}: {identified} identified parameters differ by at most {worst:.1e}");
        assert!(
            identified >= least,
            "{what}: {identified} identified parameters"
        );
    }
}
