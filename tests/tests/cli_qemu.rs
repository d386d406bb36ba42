//! `monitor qemu` and `capture qemu`: from nothing but a clone to the emulated board's live estimates, and to its bus's bytes.
//!
//! Without the emulator these tests fail, unless `PROPRIO_SKIP_QEMU` is set; then they say that they were skipped.

use proprio_tests::command::{done, folder, json, parameter};
use proprio_tests::emulator;

#[test]
fn the_emulated_boards_estimates_are_live_and_its_factors_can_be_read() {
    if !emulator::is_there() {
        return;
    }
    let folder = folder();
    let watch = [
        "monitor",
        "qemu",
        "--speed",
        "0",
        "--seconds",
        "10",
        "--json",
    ];
    let report = json(&done(folder.path(), &watch));
    assert_eq!(report["board"], "mps2-an500");
    assert_eq!(report["legs"].as_array().unwrap().len(), 4);
    assert_eq!(
        (&report["messages_missed"], &report["frames_bad"]),
        (&0.into(), &0.into())
    );
    let coulomb = parameter(&report, "coulomb:FR_calf");
    let (value, std) = (
        coulomb["value"].as_f64().unwrap(),
        coulomb["std"].as_f64().unwrap(),
    );
    assert!(std < 0.1 && value > 5.0 * std, "{coulomb}");
    let counters = &report["counters"];
    assert_eq!(counters["load"]["over_budget"], 0, "{counters}");
    for leg in 0..4 {
        assert_eq!(counters["legs"][leg]["skipped_bytes"], 0, "{counters}");
    }

    done(
        folder.path(),
        &[
            "simulate",
            "--typical",
            "--legs",
            "FR",
            "--duration",
            "4",
            "-o",
            "log.csv",
        ],
    );
    for (to, factors) in [("qemu", "board.bin"), ("desktop", "desktop.bin")] {
        done(
            folder.path(),
            &["replay", "log.csv", "--to", to, "--factors", factors],
        );
    }
    let [board, desktop] = ["board.bin", "desktop.bin"].map(|file| {
        json(&done(
            folder.path(),
            &["identify", "--json", "--factor", file],
        ))["parameters"]
            .clone()
    });
    assert_eq!(board, desktop);
}

#[test]
fn what_the_emulated_board_hears_is_captured_and_explained() {
    if !emulator::is_there() {
        return;
    }
    let folder = folder();
    let recorded = json(&done(
        folder.path(),
        &[
            "capture",
            "qemu",
            "-o",
            "sim.cap",
            "--seconds",
            "4",
            "--json",
        ],
    ));
    let said = json(&done(
        folder.path(),
        &["capture", "--explain", "sim.cap", "--json"],
    ));
    assert_eq!(recorded["bytes"], said["bytes"]);
    // The board's own count of the same bytes.
    assert_eq!(recorded["board"][0], said["commands"]);
    assert_eq!(recorded["board"][1], said["replies"]);
    assert_eq!(said["order"], serde_json::json!([0, 1, 2]));
    assert_eq!(said["period_us"], 2000);
    assert!(said["used"].as_f64().unwrap() > 0.999, "{said}");
    assert_eq!(said["warnings"].as_array().unwrap().len(), 0, "{said}");
}
