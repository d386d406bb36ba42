//! `compare --rollout`: a model run forward under the measured torque.

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, folder, json, proprio, simulated, stderr};
use serde_json::Value;

/// Of a rollout's JSON, the error after each horizon, rad.
fn errors(found: &Value, of: &str) -> Vec<f64> {
    let horizons = found["horizons"].as_array().unwrap();
    let seconds: Vec<f64> = (horizons.iter())
        .map(|h| h["seconds"].as_f64().unwrap())
        .collect();
    assert_eq!(seconds, [0.1, 0.2, 0.5, 1.0]);
    horizons.iter().map(|h| h[of].as_f64().unwrap()).collect()
}

fn rollout(folder: &Path, model: &str, more: &[&str]) -> Value {
    let arguments = [
        &["compare", "log.csv", "-m", model, "--rollout", "--json"],
        more,
    ]
    .concat();
    json(&done(folder, &arguments))
}

/// A leg with a spring that the model lacks: its rollouts leave the motion. With the spring they stay, whether it was fitted before, or is added
/// and fitted to the other blocks of time.
#[test]
fn the_error_falls_with_the_missing_spring() {
    let folder = simulated("--legs FR --typical --duration 20 --hide spring:FR_thigh=2");
    let folder = folder.path();
    let plain = ["add", "viscous", "coulomb", "armature", "bias", "-m"];
    done(folder, &[&plain[..], &["plain.toml"]].concat());
    done(
        folder,
        &[
            "identify",
            "log.csv",
            "-m",
            "plain.toml",
            "-o",
            "wrong.toml",
        ],
    );
    done(folder, &[&plain[..], &["spring.toml"]].concat());
    done(folder, &["add", "spring:FR_thigh", "-m", "spring.toml"]);
    done(
        folder,
        &[
            "identify",
            "log.csv",
            "-m",
            "spring.toml",
            "-o",
            "right.toml",
        ],
    );

    let wrong = rollout(folder, "wrong.toml", &[]);
    let right = rollout(folder, "right.toml", &["--given"]);
    let [wrong, right] = [&wrong, &right].map(|found| errors(found, "rms"));
    // Of the sensors' noise: 0.5 and 2.6 mrad were measured.
    assert!(right[0] < 1.5e-3 && right[3] < 8e-3, "{right:?}");
    for (right, wrong) in right.iter().zip(&wrong) {
        assert!(*right < 0.05 * wrong, "{right} {wrong}");
    }

    done(folder, &["add", "spring:FR_thigh", "-m", "wrong.toml"]);
    let added = rollout(folder, "wrong.toml", &[]);
    assert_eq!(added["added"], json(r#"["spring:FR_thigh"]"#));
    assert_eq!(added["fitted"], true);
    let [before, after] = ["before_rms", "rms"].map(|of| errors(&added, of));
    assert!(after[0] < 0.05 * before[0], "{after:?} {before:?}");
    assert_eq!(added["error"]["after"], after[0]);
    assert_eq!(added["error"]["before"], before[0]);
    assert_eq!(added["error"]["unit"], "rad");
}

/// The page has a plot for each joint; the screen fits a terminal; the effects that no rollout has are named.
#[test]
fn the_screen_and_the_page_have_all() {
    let folder = simulated("--legs FR --typical --duration 6");
    let folder = folder.path();
    done(
        folder,
        &[
            "add",
            "viscous",
            "coulomb",
            "armature",
            "bias",
            "elasticity:FR_calf",
            "-m",
            "model.toml",
        ],
    );
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
    let arguments = [
        "compare",
        "log.csv",
        "-m",
        "fitted.toml",
        "--rollout",
        "--html",
        "page.html",
    ];
    let screen = done(folder, &arguments);
    assert!(screen.lines().count() <= 15, "{screen}");
    assert!(
        screen.lines().all(|line| line.chars().count() <= 80),
        "{screen}"
    );
    for words in [
        "Rollout error",
        "0.1 s",
        "CAD alone",
        "Next: proprio diagnose",
        "elasticity:FR_calf",
    ] {
        assert!(screen.contains(words), "{screen}");
    }
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    for words in [
        "position (rad)",
        "FR_hip",
        "FR_thigh",
        "FR_calf",
        "Error after a time",
    ] {
        assert!(page.contains(words), "{words}");
    }
    let all = done(folder, &[&arguments[..5], &["--verbose"]].concat());
    assert!(all.contains("FR_thigh, rad"), "{all}");
    // A condition leaves no second of the log whole.
    let part = rollout(folder, "fitted.toml", &["--only", "FR_calf: dq > 0"]);
    assert_eq!(part["horizons"][3]["rollouts"], 0);
    assert_eq!(part["horizons"][3]["rms"], Value::Null);
}

#[test]
fn what_is_no_rollout_is_refused_with_words() {
    let folder = folder();
    for (more, words) in [
        (
            &["--free-base"][..],
            "contact forces move a robot on its feet",
        ),
        (&["--at-rest"], "rollouts include rest"),
        (&["-o", "torque.csv"], "--html plots positions"),
        (
            &["-m", "one.toml", "-m", "two.toml"],
            "run it for each model",
        ),
    ] {
        let output = proprio(
            folder.path(),
            &[&["compare", "log.csv", "--rollout"], more].concat(),
        );
        assert_eq!(output.status.code(), Some(2), "{more:?}");
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
}
