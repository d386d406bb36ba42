//! `diagnose` as its user meets it: its words, its steps, its report, and bad input.

use std::fs;
use std::path::Path;

use proprio_host::model::{Model, ModelEffect};
use proprio_tests::command::{done, json, refusal, simulated, steps};
use proprio_tests::rows::{Rows, with_noisy_encoders};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StudentT};
use tempfile::TempDir;

/// A robot whose joints no log has.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
</robot>"#;

fn simulate(folder: &Path, arguments: &[&str]) {
    done(
        folder,
        &[&["simulate", "--legs", "FR"][..], arguments].concat(),
    );
}

/// A folder with `log.csv` of a leg that hides friction of two kinds at two joints.
fn with_two_frictions() -> TempDir {
    simulated("--legs FR --hide coulomb:FR_calf=0.5 --hide viscous:FR_hip=0.2")
}

/// Status 1, nothing on standard output, a hint; the message.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let message = refusal(folder, arguments);
    assert!(message.contains("\nhint: "), "{message}");
    format!("$ proprio {}\n{message}\n", arguments.join(" "))
}

/// One snapshot of what cannot be compared, diagnosed or added, and of what changes nothing.
#[test]
fn what_cannot_be_judged_is_refused_with_the_fix() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, &["--duration", "1", "-o", "short.csv"]);
    simulate(folder, &["--duration", "5", "-o", "good.csv"]);
    fs::write(folder.join("arm.urdf"), ARM).unwrap();
    done(
        folder,
        &["add", "viscous", "-m", "arm.toml", "--urdf", "arm.urdf"],
    );
    let mut texts = String::new();
    for arguments in [
        &["add", "colomb", "-m", "new.toml"][..],
        &["add", "coulomb:FR_knee", "-m", "new.toml"],
        &["add", "base_tilt:FR_hip", "-m", "new.toml"],
        &["compare", "short.csv", "--fit"],
        &["diagnose", "short.csv"],
        &["compare", "good.csv", "-m", "arm.toml"],
        &["diagnose", "good.csv", "-m", "arm.toml"],
        &["diagnose", "good.csv", "-m", "missing.toml"],
        &["compare", "missing.csv"],
    ] {
        texts += &refused(folder, arguments);
    }
    assert!(!folder.join("new.toml").exists());

    let twice = ["add", "coulomb:FR_calf", "-m", "twice.toml"];
    done(folder, &twice);
    let file = fs::read(folder.join("twice.toml")).unwrap();
    texts += &format!("$ proprio {}\n{}\n", twice.join(" "), done(folder, &twice));
    assert_eq!(fs::read(folder.join("twice.toml")).unwrap(), file);
    insta::assert_snapshot!(texts);
}

#[test]
fn a_log_that_freezes_is_refused_with_how_much_of_it_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let arguments = ["--duration", "6", "-o", "log.csv"];
    simulate(folder, &arguments);
    let text = fs::read_to_string(folder.join("log.csv")).unwrap();
    let mut frozen = String::new();
    let (mut rows, mut last) = (0, "");
    for line in text.lines() {
        match line.split_once(',') {
            Some((t, rest)) if t.parse::<f64>().is_ok() => {
                rows += 1;
                if rows <= 1500 {
                    last = rest;
                }
                frozen += &format!(
                    "{t},{last}
"
                );
            }
            _ => {
                frozen += &format!(
                    "{line}
"
                )
            }
        }
    }
    fs::write(folder.join("log.csv"), frozen).unwrap();
    let refused = refused(folder, &["diagnose", "log.csv"]);
    assert!(
        refused.contains("samples repeat the one before and do not count"),
        "{refused}"
    );
}

/// A joint that never moves is named first, and nothing is claimed of it.
#[test]
fn a_joint_that_never_moves_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let stuck = [
        "--typical",
        "--hide",
        "coulomb:FR_hip=40",
        "-o",
        "still.csv",
    ];
    simulate(folder, &stuck);
    for command in ["compare", "diagnose"] {
        let text = done(folder, &[command, "still.csv"]);
        let first = text.lines().next().unwrap();
        assert!(
            first.starts_with("Data: FR_hip: hardly moves"),
            "{command}: {first}"
        );
        let report = json(&done(folder, &[command, "still.csv", "--json"]));
        let finding = &report["data"][0]["findings"][0];
        assert_eq!(finding["joints"], serde_json::json!(["FR_hip"]));
        if command == "diagnose" {
            let all = report["candidates"].as_array().unwrap();
            let of_hip = all
                .iter()
                .filter(|c| c["joints"] == serde_json::json!(["FR_hip"]));
            let told = of_hip.filter(|c| c["significant"] == true);
            assert_eq!(told.count(), 0);
        }
    }
}

/// `--apply` writes the path's effects into the model file, with values; doing it again changes nothing.
#[test]
fn applying_walks_to_a_model_that_lacks_nothing() {
    let folder = with_two_frictions();
    let folder = folder.path();
    let apply = ["diagnose", "log.csv", "--apply", "-m", "model.toml"];
    let ladder = done(folder, &apply);
    let steps = done(folder, &["diagnose", "log.csv", "--verbose"]);
    assert!(steps.contains("+ coulomb FR_calf"), "{steps}");
    assert!(steps.contains("+ viscous FR_hip"), "{steps}");
    assert!(
        ladder.contains("Wrote model.toml: 3 of 3 effects with values, 3 bodies"),
        "{ladder}"
    );
    let file = fs::read(folder.join("model.toml")).unwrap();
    let model = Model::load(&folder.join("model.toml")).unwrap();
    assert!((0..3).all(|body| model.is_identified(body)));
    let valued = |e: &ModelEffect| e.estimate().is_some_and(|value| value.std.is_some());
    assert!(model.effects().iter().all(valued), "{:?}", model.effects());
    let again = json(&done(folder, &[&apply[..], &["--json"]].concat()));
    assert_eq!(again["verdict"], "complete");
    assert_eq!(fs::read(folder.join("model.toml")).unwrap(), file);
    let comparison = json(&done(
        folder,
        &["compare", "log.csv", "-m", "model.toml", "--json"],
    ));
    assert!(comparison["rms"].as_f64() < comparison["before_rms"].as_f64());
}

/// The values that `--apply` writes are what `identify` finds, and the file predicts what is said of it. Values of another log stay.
#[test]
fn applied_values_are_the_logs_own() {
    let folder = with_two_frictions();
    let folder = folder.path();
    let run = |arguments: &[&str]| json(&done(folder, &[arguments, &["--json"]].concat()));
    let said = run(&["diagnose", "log.csv", "--apply", "-m", "model.toml"]);
    let given = run(&["compare", "log.csv", "-m", "model.toml", "--given"]);
    let rms = said["written"]["rms"].as_f64().unwrap();
    assert_eq!(said["written"]["values"], said["written"]["effects"]);
    assert_eq!(said["written"]["bodies"], 3);
    assert!(
        (given["rms"].as_f64().unwrap() - rms).abs() < 1e-9 * rms.max(1.0),
        "{given}"
    );
    let own = Model::load(&folder.join("model.toml")).unwrap();
    done(
        folder,
        &[
            "identify",
            "log.csv",
            "-m",
            "model.toml",
            "-o",
            "fitted.toml",
        ],
    );
    let fitted = Model::load(&folder.join("fitted.toml")).unwrap();
    for e in own.effects() {
        let same = fitted.effect(e.effect, e.joint).unwrap();
        assert_eq!(e.estimates, same.estimates);
    }
    let other =
        "simulate --typical --legs FR --duration 10 --seed 9 -o other.csv --hide spring:FR_thigh=4";
    done(folder, &other.split(' ').collect::<Vec<_>>());
    let said = run(&["diagnose", "other.csv", "--apply", "-m", "model.toml"]);
    let now = Model::load(&folder.join("model.toml")).unwrap();
    assert!(now.effects().len() > own.effects().len(), "{said}");
    assert_eq!(said["written"]["values"], own.effects().len());
    assert!(said["written"]["rms"].is_null());
    assert_eq!(now.inertia(0), own.inertia(0));
}

/// One screen: the fall of the error and what is missing, three points, and a command that runs.
#[test]
fn the_first_screen_ends_with_a_command_that_runs() {
    let folder = with_two_frictions();
    let folder = folder.path();
    let screen = done(folder, &["diagnose", "log.csv"]);
    let headline = screen
        .lines()
        .find(|line| line.starts_with("Missing: "))
        .unwrap();
    assert!(
        headline.contains("Held-out error") && screen.contains("(noise floor "),
        "{screen}"
    );
    assert!(headline.contains("coulomb (FR_calf)"), "{screen}");
    let points = screen
        .lines()
        .filter(|line| line.starts_with("  • "))
        .count();
    assert!((1..=3).contains(&points), "{screen}");
    let command = screen
        .lines()
        .find_map(|line| line.strip_prefix("Next: proprio "))
        .unwrap();
    assert!(
        command.starts_with("add ") && command.ends_with(" -m go2.toml"),
        "{screen}"
    );
    done(folder, &command.split(' ').collect::<Vec<_>>());
    let compared = done(folder, &["compare", "log.csv", "-m", "go2.toml", "--json"]);
    let compared = json(&compared);
    assert!(compared["rms"].as_f64() < compared["before_rms"].as_f64());
    assert!(done(folder, &["diagnose", "log.csv", "--verbose"]).contains("held-out gain %"));
}

/// Eleven samples in a period of the fastest motion are enough: what the trapezoid rule is wrong by is no drag.
#[test]
fn few_samples_a_period_are_no_effect() {
    let folder = simulated(
        "--typical --legs FR --duration 20 --motion chirp --rate 100 --inertia-error 0.05",
    );
    let found = json(&done(folder.path(), &["diagnose", "log.csv", "--json"]));
    let path = &steps(&found);
    let last = path.last().unwrap();
    println!("{last}");
    assert!(path.iter().all(|step| step["effect"] != "quadratic_drag"));
    assert!(last["error"].as_f64().unwrap() < 0.04);
}

/// What has moved since the file was written is named with both values, before any effect; where nothing has, nothing is.
#[test]
fn values_that_have_changed_are_named() {
    let folder = simulated("--typical --legs FR");
    let folder = folder.path();
    let run = |arguments: &str| done(folder, &arguments.split(' ').collect::<Vec<_>>());
    run("add viscous coulomb armature bias -m monday.toml");
    run("identify log.csv -m monday.toml -o monday.toml");
    let truth = fs::read_to_string(folder.join("log.truth.json")).unwrap();
    let truth = json(&truth);
    let mut all = truth["parameters"].as_array().unwrap().iter();
    let own = all.find(|p| p["name"] == "coulomb:FR_thigh").unwrap();
    let was = own["value"].as_f64().unwrap();
    for (seed, grown) in [(3, 0.0), (4, 0.0), (5, 0.05), (6, 0.3)] {
        let is = was + grown;
        let log = format!("{seed}.csv");
        run(&format!(
            "simulate --typical --legs FR --seed {seed} --hide coulomb:FR_thigh={is} -o {log}"
        ));
        let said = json(&run(&format!("diagnose {log} -m monday.toml --json")));
        assert_eq!(said["verdict"], "complete", "{said}");
        let changed = said["moved"].as_array().unwrap();
        let names: Vec<&str> = changed
            .iter()
            .map(|c| c["name"].as_str().unwrap())
            .collect();
        let screen = run(&format!("diagnose {log} -m monday.toml"));
        // The same error as `compare` has of the file as it is given.
        let compared = json(&run(&format!("compare {log} -m monday.toml --json")));
        let [given, rms] = [&said["given_rms"], &compared["rms"]].map(|x| x.as_f64().unwrap());
        assert!((given / rms - 1.0).abs() < 1e-9, "{given} {rms}");
        if grown == 0.0 {
            assert!(names.is_empty(), "{changed:?}");
            assert!(!screen.contains("hanged"), "{screen}");
            continue;
        }
        assert_eq!(names, ["coulomb:FR_thigh"], "{changed:?}");
        let value = |key: &str| changed[0][key].as_f64().unwrap();
        assert!(
            (value("now") - is).abs() < 3.0 * value("std"),
            "{changed:?}"
        );
        assert!(
            (value("was") - was).abs() < 3.0 * value("was_std"),
            "{changed:?}"
        );
        assert!(screen.contains("Changed: 1 value of the file"), "{screen}");
        assert!(screen.contains("changed: coulomb:FR_thigh is "), "{screen}");
        // What is proposed writes a file that holds.
        run(&format!("identify {log} -m monday.toml -o {seed}.toml"));
        let after = json(&run(&format!("compare {log} -m {seed}.toml --json")));
        assert!(after["rms"].as_f64().unwrap() < given);
    }
}

/// Encoders with noise of 0.2 mrad and 0.03 rad/s on complete legs: after a turn the joint moves faster than they tell, which is no effect.
#[test]
fn noise_of_encoders_is_no_effect() {
    for seed in [3, 9, 11, 14, 18] {
        let folder = with_noisy_encoders(seed);
        let add = "add viscous coulomb armature bias -m model.toml";
        done(folder.path(), &add.split(' ').collect::<Vec<_>>());
        let diagnose = ["diagnose", "log.csv", "-m", "model.toml", "--json"];
        let found = json(&done(folder.path(), &diagnose));
        assert_eq!(
            found["verdict"], "complete",
            "{seed}: {}",
            found["outside_catalogue"]
        );
    }
}

/// A torque whose noise has heavy tails, or grows with it: what is large at some moments and follows nothing. The floor is known.
#[test]
fn noise_of_torque_is_no_effect() {
    let heavy: fn(&mut ChaCha8Rng, f64) -> f64 = |random, tau| {
        let tails = StudentT::new(2.5).expect("degrees of freedom");
        tau + 0.02 * tails.sample(random)
    };
    let grows: fn(&mut ChaCha8Rng, f64) -> f64 = |random, tau| {
        let normal: f64 = StandardNormal.sample(random);
        tau * (1.0 + 0.06 * normal)
    };
    for (seed, noise) in [(1, grows), (2, heavy), (3, grows), (4, heavy)] {
        let folder = simulated(&format!(
            "--legs FR --typical --inertia-error 0.05 --seed {seed}"
        ));
        let path = folder.path().join("log.csv");
        let mut log = Rows::read(&path);
        log.change("tau", seed, noise);
        log.write(&path);
        let add = "add viscous coulomb armature bias -m model.toml";
        done(folder.path(), &add.split(' ').collect::<Vec<_>>());
        let diagnose = ["diagnose", "log.csv", "-m", "model.toml", "--json"];
        let found = json(&done(folder.path(), &diagnose));
        assert_eq!(
            found["verdict"], "complete",
            "{seed}: {}",
            found["outside_catalogue"]
        );
        assert!(found["error"]["floor"].is_number(), "{}", found["error"]);
    }
}
