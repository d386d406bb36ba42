//! Files and streams of the command line: whole or not there, the same for the same seed.

use std::fs;
use std::process::Stdio;
use std::time::{Duration, Instant};

use proprio_tests::command::{binary, done, folder, proprio, simulated, stderr};

#[test]
fn output_files_hold_what_json_prints() {
    let folder = simulated("--legs FR --duration 3");
    let printed = done(
        folder.path(),
        &["identify", "log.csv", "--json", "-o", "robot.json"],
    );
    assert_eq!(
        fs::read_to_string(folder.path().join("robot.json")).unwrap(),
        printed
    );

    let output = proprio(
        folder.path(),
        &["identify", "log.csv", "-o", "no/such/folder.json"],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("hint: create the directory first"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_seed_makes_the_same_files_twice() {
    let folder = folder();
    let file = |name: &str| fs::read(folder.path().join(name)).unwrap();
    for log in ["a.csv", "b.csv"] {
        let faults = ["--jitter", "0.3", "--repeats", "0.1", "--motion", "chirp"];
        done(
            folder.path(),
            &[&["simulate", "--duration", "2", "-o", log], &faults[..]].concat(),
        );
    }
    assert_eq!(file("a.csv"), file("b.csv"));
    assert_eq!(file("a.truth.json"), file("b.truth.json"));
}

#[test]
fn a_reader_that_stops_early_is_no_error() {
    let folder = simulated("--legs FR --duration 3");
    let mut child = std::process::Command::new(binary())
        .args(["identify", "log.csv", "--json"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        (output.status.code(), stderr(&output).as_str()),
        (Some(0), "")
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_no_half_file() {
    let folder = folder();
    let mut child = std::process::Command::new(binary())
        .args(["simulate", "--duration", "80000", "-o", "log.csv"])
        .current_dir(folder.path())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(20);
    while fs::read_dir(folder.path()).unwrap().next().is_none() {
        assert!(
            Instant::now() < deadline,
            "the simulation does not begin its file"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    let interrupt = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A rigid robot has no friction, so that half of the free estimates are negative: no model holds those.
#[test]
fn a_physical_fit_becomes_a_model_that_exports() {
    let folder = simulated("--duration 4");
    let free = ["identify", "log.csv", "--free", "-o", "go2.toml"];
    let free = proprio(folder.path(), &free);
    assert_eq!(free.status.code(), Some(1));
    assert!(
        stderr(&free).contains("leave out --free"),
        "{}",
        stderr(&free)
    );
    assert!(!folder.path().join("go2.toml").exists());

    done(
        folder.path(),
        &["identify", "log.csv", "--physical", "-o", "go2.toml"],
    );
    let model = fs::read_to_string(folder.path().join("go2.toml")).unwrap();
    assert!(
        model.contains("log.csv") && model.contains("--physical"),
        "{model}"
    );
    let xml = done(
        folder.path(),
        &["export", "-m", "go2.toml", "--mjcf", "-o", "go2.xml"],
    );
    let written = fs::read_to_string(folder.path().join("go2.xml")).unwrap();
    assert!(
        written.contains("frictionloss") && written.contains("armature"),
        "{xml}"
    );
}
