//! `proprio factors` and `identify --blocks`: what a user types, of one robot and of files that do not belong together.

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, folder, json, recorded_logs, refusal};
use serde_json::Value;

/// Logs of one simulated Go2: the same robot, other motions.
fn logs(folder: &Path, seeds: &[&str]) {
    for seed in seeds {
        let log = format!("{seed}.csv");
        let robot = [
            "simulate",
            "--typical",
            "--duration",
            "24",
            "--hide",
            "spring:FL_thigh=4",
        ];
        done(
            folder,
            &[&robot[..], &["--seed", seed, "-o", &log]].concat(),
        );
        let table = format!("{seed}.parquet");
        let words = [
            "factors", &log, "--robot", "one", "--block", "10", "-o", &table,
        ];
        done(folder, &words);
    }
}

fn value<'a>(printed: &'a Value, name: &str) -> &'a Value {
    let values = printed["values"].as_array().unwrap();
    values.iter().find(|own| own["name"] == name).unwrap()
}

#[test]
fn blocks_of_a_log_hold_what_the_log_says_of_effects_that_nobody_asked_for() {
    let folder = folder();
    let folder = folder.path();
    logs(folder, &["1", "2"]);
    let printed = json(&done(
        folder,
        &["identify", "--blocks", "1.parquet", "2.parquet", "--json"],
    ));
    assert_eq!(
        (&printed["robot"], &printed["count"]),
        (&Value::from("one"), &Value::from(6))
    );
    let screen = done(folder, &["identify", "--blocks", "1.parquet", "2.parquet"]);
    assert!(screen.starts_with("one: 6 blocks, 48 values of a plain drive\n"));
    let is_narrow = |line: &str| line.chars().count() <= 80;
    assert!(screen.lines().count() <= 15 && screen.lines().all(is_narrow));
    let words = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in ["hips", "by chance): spring (FL_thigh)", "More: --verbose"] {
        assert!(words.contains(part), "{part}: {screen}");
    }
    assert!(
        screen.contains("\nNext: proprio effects spring\n"),
        "{screen}"
    );
    done(folder, &["effects", "spring"]);
    let words = [
        "identify",
        "--blocks",
        "1.parquet",
        "2.parquet",
        "--verbose",
    ];
    let whole = done(folder, &words);
    assert!(whole.contains("\n+ spring:FL_thigh"), "{whole}");
    // The spring that no model named: its column is there.
    let spring = value(&printed, "spring:FL_thigh");
    let [value, std] = ["value", "std"].map(|key| spring[key].as_f64().unwrap());
    assert!((value - 4.0).abs() < 4.0 * std && std < 0.4, "{spring}");
    let truth = json(&fs::read_to_string(folder.join("1.truth.json")).unwrap());
    let (mut inside, mut all) = (0, 0);
    for own in truth["parameters"].as_array().unwrap() {
        let name = own["name"].as_str().unwrap();
        // A plain drive lacks the spring: its values there stand for it in part.
        if name.ends_with(":FL_thigh") {
            continue;
        }
        let found = printed["values"]
            .as_array()
            .unwrap()
            .iter()
            .find(|x| x["name"] == *name);
        if let Some(found) = found {
            let [value, std] = ["value", "std"].map(|key| found[key].as_f64().unwrap());
            let away = (value - own["value"].as_f64().unwrap()) / std;
            inside += u32::from(away.abs() < 2.0);
            all += 1;
            println!("{name} {value} ± {std}: {away:.1}");
        }
    }
    assert!(all >= 44 && 10 * inside >= 9 * all, "{inside} of {all}");
}

#[test]
fn what_does_not_belong_together_is_refused_with_name_and_fix() {
    let folder = folder();
    let folder = folder.path();
    logs(folder, &["1"]);
    let twice = refusal(
        folder,
        &["identify", "--blocks", "1.parquet", "1.parquet", "--json"],
    );
    assert!(
        twice.contains("1.parquet: one FR_hip") && twice.contains("there already"),
        "{twice}"
    );
    assert!(
        twice.contains("hint: nothing is lost; leave the second copy out"),
        "{twice}"
    );
    done(
        folder,
        &["factors", "1.csv", "--robot", "two", "-o", "two.parquet"],
    );
    let other = refusal(
        folder,
        &["identify", "--blocks", "1.parquet", "two.parquet"],
    );
    assert!(
        other.contains("two.parquet: two FR_hip")
            && other.contains("the same log is one's already"),
        "{other}"
    );
    done(
        folder,
        &["simulate", "--duration", "12", "--seed", "7", "-o", "7.csv"],
    );
    done(
        folder,
        &["factors", "7.csv", "--robot", "two", "-o", "7.parquet"],
    );
    let other = refusal(folder, &["identify", "--blocks", "1.parquet", "7.parquet"]);
    assert!(
        other.contains("7.parquet: blocks of robot two; those of the files before are one's"),
        "{other}"
    );
    let log = refusal(
        folder,
        &[
            "factors",
            "1.csv",
            "1.csv",
            "--robot",
            "one",
            "-o",
            "new.parquet",
        ],
    );
    assert!(
        log.contains("1.csv: one FR_hip") && log.contains("there already"),
        "{log}"
    );
    assert!(!folder.join("new.parquet").exists());
    let bytes = fs::read(folder.join("1.parquet")).unwrap();
    fs::write(folder.join("cut.parquet"), &bytes[..bytes.len() / 2]).unwrap();
    let cut = refusal(folder, &["identify", "--blocks", "cut.parquet"]);
    assert!(
        cut.contains("cut.parquet: cut or damaged") && cut.contains("hint: copy the file again"),
        "{cut}"
    );
    let none = refusal(folder, &["identify", "--blocks", "1.csv"]);
    assert!(
        none.contains("1.csv: no table of blocks (proprio.blocks/1)")
            && none.contains("hint: make the table from a log: proprio factors LOG --robot"),
        "{none}"
    );
    let none = refusal(folder, &["identify", "--blocks", "none.parquet"]);
    assert!(none.contains("none.parquet: No such file"), "{none}");
}

/// The five recorded chirps as one robot: what differs from chirp to chirp is in the ±.
#[test]
fn the_recorded_chirps_are_one_robots_blocks() {
    let Some(shared) = recorded_logs() else {
        return;
    };
    let folder = folder();
    let folder = folder.path();
    let chirps = [
        "2.0hz_p25d3.0",
        "7.0hz_p25d5.0",
        "9.0hz_p25d1.2",
        "9.0hz_p25d2.0",
        "9.0hz_p25d5.0",
    ];
    let mut logs: Vec<String> = Vec::new();
    for chirp in chirps {
        logs.push(
            shared
                .join(format!("go2_air_chirp_{chirp}.csv"))
                .display()
                .to_string(),
        );
    }
    let mut words = vec!["factors"];
    words.extend(logs.iter().map(String::as_str));
    words.extend(["--robot", "go2", "-o", "go2.parquet", "--json"]);
    let made = json(&done(folder, &words));
    assert_eq!(made["blocks"], 5);
    // The columns' names and priors are in the file once.
    let columns = 15_000;
    let bytes = made["bytes"].as_u64().unwrap();
    assert!(bytes < columns + 5 * 30_000, "{bytes}");
    let printed = json(&done(
        folder,
        &["identify", "--blocks", "go2.parquet", "--json"],
    ));
    for joint in ["FR_hip", "FL_thigh", "RR_calf"] {
        let coulomb = value(&printed, &format!("coulomb:{joint}"));
        let [value, std] = ["value", "std"].map(|key| coulomb[key].as_f64().unwrap());
        assert!(value > 0.0 && std > 0.0 && std < 0.5, "{coulomb}");
    }
}

/// The README's first build does not build the fleet's workspace.
#[test]
fn the_fleets_workspace_is_its_own() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = |path: &str| fs::read_to_string(root.join(path)).unwrap();
    assert!(
        text("fleet/Cargo.toml")
            .lines()
            .any(|line| line == "[workspace]")
    );
    let own = text("Cargo.toml");
    let members = own.lines().filter(|line| line.contains("members = "));
    assert!(members.clone().count() == 2 && members.clone().all(|line| !line.contains("fleet")));
    assert!(!text("Cargo.lock").contains("proprio-fleet"));
}
