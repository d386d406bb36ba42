//! Motions of limbs whose base is held.

use std::fs;

use proprio_tests::command::{done, folder, stderr};
use serde_json::Value;

use super::{QUICK, excite, json};

#[test]
fn other_goals_are_designed_for_too() {
    let folder = folder();
    let here = folder.path();
    excite(
        here,
        &[
            "--separate",
            "stribeck,quadratic_drag:FR_thigh",
            "-o",
            "separate.csv",
        ],
    );
    done(
        here,
        &[
            "simulate",
            "--legs",
            "FR",
            "--motion",
            "chirp",
            "--typical",
            "--duration",
            "5",
            "-o",
            "chirp.csv",
        ],
    );
    let blind = excite(
        here,
        &["--for", "Ixx:FR_hip,hx:FR_thigh", "-o", "blind.csv"],
    );
    let completing = excite(
        here,
        &[
            "--for",
            "Ixx:FR_hip,hx:FR_thigh",
            "--from",
            "chirp.csv",
            "-o",
            "next.csv",
        ],
    );
    assert_eq!(
        (&blind["violations"], &completing["violations"]),
        (&Value::from(0), &Value::from(0))
    );
}

#[test]
fn a_pair_of_legs_moves_at_once() {
    let folder = folder();
    let legs = ["excite", "--json", "--legs", "FR,RL", "-o", "pair.csv"];
    let design = json(&done(folder.path(), &[&legs[..], &QUICK[2..]].concat()));
    assert_eq!(
        (design["violations"].as_u64(), design["rank"].as_u64()),
        (Some(0), Some(2 * 17))
    );
    let rows = fs::read_to_string(folder.path().join("pair.csv")).unwrap();
    let header = rows.lines().next().unwrap();
    assert_eq!(header.split(',').count(), 1 + 6 * 6);
    assert!(header.contains("q/RL_calf") && !header.contains("FL_"));
}

#[test]
fn four_legs_move_at_once_each_in_its_quarter() {
    let folder = folder();
    let design = json(&done(
        folder.path(),
        &[&["excite", "--json", "-o", "all.csv"], &QUICK[2..]].concat(),
    ));
    assert_eq!(
        (design["violations"].as_u64(), design["rank"].as_u64()),
        (Some(0), Some(4 * 17))
    );
    let header = fs::read_to_string(folder.path().join("all.csv")).unwrap();
    assert_eq!(
        header.lines().next().unwrap().split(',').count(),
        1 + 6 * 12
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_best_motion() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let folder = folder();
    let mut child = Command::new(proprio_tests::command::binary())
        .args([
            "excite", "--legs", "FR", "--starts", "100000", "--json", "-o", "best.csv",
        ])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Long enough for a first motion within the limits even on a busy machine.
    std::thread::sleep(Duration::from_secs(30));
    let pid = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &pid])
            .status()
            .unwrap()
            .success()
    );
    let asked = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(asked.elapsed() < Duration::from_secs(60), "does not end");
        std::thread::sleep(Duration::from_millis(50));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = json(&String::from_utf8_lossy(&output.stdout));
    assert_eq!(
        (&report["interrupted"], &report["violations"]),
        (&Value::from(true), &Value::from(0))
    );
    assert!(folder.path().join("best.csv").exists());
}

/// Of a hundred waves no motion is within the limits after two seconds: there is nothing to keep.
#[cfg(unix)]
#[test]
fn a_request_to_terminate_ends_a_search_within_a_second() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let folder = folder();
    let mut child = Command::new(proprio_tests::command::binary())
        .args(["excite", "--harmonics", "100", "--duration", "3600"])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(2));
    let pid = child.id().to_string();
    let asked = Instant::now();
    let sent = Command::new("kill").args(["-TERM", &pid]).status();
    assert!(sent.unwrap().success());
    let status = child.wait().unwrap();
    assert!(
        asked.elapsed() < Duration::from_secs(1),
        "{:?}",
        asked.elapsed()
    );
    assert_eq!(status.code(), Some(130));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
