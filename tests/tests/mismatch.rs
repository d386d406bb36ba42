//! A log that is not what the model says is told as what it is, with exit status 1, before any effect has to explain it.

use std::fs;
use std::path::Path;

use proprio_host::detect::mismatch::mismatches;
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_tests::command::{done, proprio, recorded_chirps, recorded_logs, simulated, stderr};

/// A log's cells, heads first.
type Cells = Vec<Vec<String>>;

fn cells(path: &Path) -> Cells {
    let text = fs::read_to_string(path).unwrap();
    let row = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(row)
        .collect()
}

fn write(path: &Path, cells: &Cells) {
    let lines: Vec<String> = cells.iter().map(|row| row.join(",")).collect();
    fs::write(path, lines.join("\n") + "\n").unwrap();
}

/// Heads changed.
fn renamed(log: &Cells, name: impl Fn(&str) -> String) -> Cells {
    let mut log = log.clone();
    log[0].iter_mut().for_each(|head| *head = name(head));
    log
}

/// Torques changed, of joints whose names hold `of`; `f` is given the sample's number.
fn torques(log: &Cells, of: &str, f: impl Fn(usize, &dyn Fn(usize) -> f64) -> f64) -> Cells {
    let mut changed = log.clone();
    for column in 0..log[0].len() {
        let head = &log[0][column];
        if !head.starts_with("tau/") || !head.contains(of) {
            continue;
        }
        let at = |n: usize| log[1 + n.min(log.len() - 2)][column].parse().unwrap();
        for n in 0..log.len() - 1 {
            changed[1 + n][column] = format!("{:.4}", f(n, &at));
        }
    }
    changed
}

fn exchanged(name: &str, a: &str, b: &str) -> String {
    name.replace(a, "\u{1}").replace(b, a).replace('\u{1}', b)
}

/// Changes of a log and what is said of it.
fn changes(log: &Cells) -> Vec<(&'static str, Cells, &'static str)> {
    vec![
        (
            "legs",
            renamed(log, |name| exchanged(name, "FR_", "FL_")),
            "limbs look exchanged, the log fits far better if FR's columns are FL's, FL's columns are FR's",
        ),
        (
            "joints",
            renamed(log, |name| exchanged(name, "_hip", "_thigh")),
            "joints look exchanged in each limb, the log fits far better if FR_thigh's columns are FR_hip's",
        ),
        (
            "sign",
            torques(log, "", |n, at| -at(n)),
            "the torque of all joints has the other sign",
        ),
        (
            "one sign",
            torques(log, "FL_thigh", |n, at| -at(n)),
            "the torque of FL_thigh has the other sign",
        ),
        (
            "zero",
            torques(log, "", |_, _| 0.0),
            "the torque of all joints is zero",
        ),
        (
            "dead",
            torques(log, "FL_calf", |_, _| 0.0),
            "the torque of FL_calf is zero",
        ),
        (
            "placeholder",
            torques(log, "FL_calf", |_, _| 1.5),
            "the torque of FL_calf is 1.5 N m whenever the joint moves",
        ),
        (
            "rotor side",
            torques(log, "", |n, at| at(n) / 9.0),
            "times the model's at all joints: it is to be in N m",
        ),
        (
            "late",
            torques(log, "", |n, at| at(n.saturating_sub(50))),
            "100 ms later than their motion",
        ),
        (
            "a little late",
            torques(log, "", |n, at| at(n.saturating_sub(5))),
            "later than their motion",
        ),
        (
            "early",
            torques(log, "", |n, at| at(n + 25)),
            "50 ms ahead of their motion",
        ),
    ]
}

fn refused(folder: &Path, arguments: &[&str], words: &str) {
    let output = proprio(folder, arguments);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{words}: {said}");
    assert!(said.contains("not what the model says"), "{said}");
    assert!(said.contains(words), "{words}: {said}");
    assert!(said.contains("--anyway"), "{said}");
}

/// Two legs whose bodies are off the CAD and whose friction nobody knows.
#[test]
fn what_a_person_would_see_at_once_is_told() {
    let folder = simulated("--typical --legs FR,FL --duration 10 --inertia-error 0.1 --seed 3");
    let log = cells(&folder.path().join("log.csv"));
    done(folder.path(), &["diagnose", "log.csv"]);
    for (name, changed, words) in changes(&log) {
        write(&folder.path().join("changed.csv"), &changed);
        println!("{name}");
        // What the catalogue can tell is no reason to stop.
        if name == "a little late" {
            let said = done(folder.path(), &["diagnose", "changed.csv"]);
            assert!(said.contains("delay"), "{said}");
        } else {
            refused(folder.path(), &["diagnose", "changed.csv"], words);
        }
        let compared = proprio(folder.path(), &["compare", "changed.csv"]);
        assert!(compared.status.success(), "{name}: compare goes on");
        assert!(
            stderr(&compared).contains(words),
            "{name}: {}",
            stderr(&compared)
        );
    }
    refused(
        folder.path(),
        &["diagnose", "log.csv", "log.csv"],
        "are the same log",
    );
}

/// A hip whose drive reports a third of its torque, beside a constant one that takes what gravity asks of it; and one of which that is all.
#[test]
fn one_joint_that_is_told_worse_than_by_nothing_is_no_other_robot() {
    let folder = simulated("--typical --legs FR --duration 10 --seed 3");
    let log = cells(&folder.path().join("log.csv"));
    let column = log[0].iter().position(|head| head == "tau/FR_hip").unwrap();
    let torque = |row: &Vec<String>| row[column].parse::<f64>().unwrap();
    let mean = log[1..].iter().map(torque).sum::<f64>() / (log.len() - 1) as f64;
    for (scale, held) in [(0.3, 0.97), (1.0, 1.0), (1.0, 1.05)] {
        let changed = torques(&log, "FR_hip", |n, at| scale * (at(n) - held * mean));
        write(&folder.path().join("changed.csv"), &changed);
        let said = done(folder.path(), &["diagnose", "changed.csv"]);
        assert!(said.contains("bias"), "{scale} {held}: {said}");
    }
}

/// One log of three is of a robot whose legs' columns were exchanged: it is the one that is named.
#[test]
fn of_several_logs_the_wrong_one_is_named() {
    let folder = simulated("--typical --legs FR,FL --duration 10 --inertia-error 0.1 --seed 3");
    let log = cells(&folder.path().join("log.csv"));
    let halves = [
        [&log[..1], &log[1..2501]].concat(),
        [&log[..1], &log[2501..]].concat(),
    ];
    write(&folder.path().join("first.csv"), &halves[0]);
    write(&folder.path().join("second.csv"), &halves[1]);
    done(folder.path(), &["diagnose", "first.csv", "second.csv"]);
    let wrong = renamed(&halves[1], |name| exchanged(name, "FR_", "FL_"));
    write(&folder.path().join("second.csv"), &wrong);
    refused(
        folder.path(),
        &["diagnose", "first.csv", "second.csv", "log.csv"],
        "says: second.csv: limbs look exchanged",
    );
    // Where all are, no log has to be named.
    write(
        &folder.path().join("first.csv"),
        &renamed(&halves[0], |name| exchanged(name, "FR_", "FL_")),
    );
    refused(
        folder.path(),
        &["diagnose", "first.csv", "second.csv"],
        "says: limbs look exchanged",
    );
}

/// The same of a recorded robot, all its legs and all that nobody knows of it.
#[test]
fn what_a_person_would_see_at_once_is_told_of_a_real_log() {
    let Some(logs) = recorded_logs() else { return };
    let folder = tempfile::tempdir().unwrap();
    let log = cells(&logs.join("go2_air_chirp_7.0hz_p25d5.0.csv"));
    let model = Model::default();
    for (name, changed, words) in changes(&log) {
        write(&folder.path().join("changed.csv"), &changed);
        println!("{name}");
        // The recorded torque is 2 ms ahead of the motion itself.
        let words = if words.contains(" ms ") {
            "their motion"
        } else {
            words
        };
        let recording = Recording::read(&[folder.path().join("changed.csv")], &model, |_, _| ());
        let said: Vec<String> = mismatches(&recording.unwrap(), &model)
            .iter()
            .map(ToString::to_string)
            .collect();
        assert!(
            said.len() == 1 && said[0].contains(words),
            "{name}: {said:?}"
        );
    }
}

/// Torque that a program computed from the commanded positions, whatever the gains and however late.
#[test]
fn torque_that_was_computed_from_commands_is_told() {
    let Some(logs) = recorded_logs() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut log = cells(&logs.join("go2_air_chirp_7.0hz_p25d5.0.csv"));
    let heads = log[0].clone();
    let column = |name: String| heads.iter().position(|head| *head == name).unwrap();
    for head in heads.iter().filter(|head| head.starts_with("tau/")) {
        let joint = head.trim_start_matches("tau/");
        let [q, dq, asked, tau] =
            ["q", "dq", "q_des", "tau"].map(|c| column(format!("{c}/{joint}")));
        let number = |row: &Vec<String>, column: usize| row[column].parse::<f64>().unwrap();
        let computed = |row: &Vec<String>| {
            25.0 * (number(row, asked) - number(row, q)) - 5.0 * number(row, dq)
        };
        let torque: Vec<f64> = log[1..].iter().map(computed).collect();
        for (n, row) in log[1..].iter_mut().enumerate() {
            row[tau] = format!("{:.3}", torque[n.saturating_sub(5)]);
        }
    }
    write(&folder.path().join("changed.csv"), &log);
    refused(
        folder.path(),
        &["diagnose", "changed.csv"],
        "is what was commanded",
    );
}

/// Walks: the base moves. Where the log has an IMU the way on is named.
#[test]
fn a_robot_that_walks_is_not_judged_as_if_it_hung() {
    let Some(logs) = recorded_logs() else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "go2_walk_1",
        "go2_walk_gaps",
        "go2_walk_imu_standard-replay-position",
    ] {
        let log = logs.join(format!("{name}.csv")).display().to_string();
        refused(
            folder.path(),
            &["diagnose", &log],
            "or a robot that stands or walks",
        );
        let said = stderr(&proprio(folder.path(), &["diagnose", &log]));
        assert_eq!(
            said.contains("proprio diagnose --free-base"),
            name.contains("imu"),
            "{said}"
        );
        let anyway = proprio(folder.path(), &["diagnose", &log, "--anyway"]);
        assert!(anyway.status.success());
        let said = stderr(&anyway);
        assert!(said.contains("warning: what the model gives"), "{said}");
    }
}

/// Robots on which nothing is wrong; of every case of the battery a test of its own asks.
#[test]
fn real_logs_of_hung_robots_are_not_doubted() {
    let model = Model::default();
    for log in recorded_chirps() {
        let recording = Recording::read(&[log], &model, |_, _| ()).unwrap();
        assert_eq!(mismatches(&recording, &model), [], "{:?}", recording.logs);
    }
}
