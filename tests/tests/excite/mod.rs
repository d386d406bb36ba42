//! The line from a designed motion to a judged model: `excite`, `simulate --follow`, `advise`, `validate`.

mod limbs;
mod refused;
mod trunk;

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, folder};
use serde_json::Value;

/// A motion that takes little time to find: the limits are kept whatever the number of starts.
const QUICK: [&str; 8] = [
    "--legs",
    "FR",
    "--starts",
    "1",
    "--harmonics",
    "5",
    "--duration",
    "6",
];

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn excite(folder: &Path, more: &[&str]) -> Value {
    json(&done(
        folder,
        &[&["excite", "--json"], &QUICK[..], more].concat(),
    ))
}

#[test]
fn a_motion_is_designed_followed_judged_and_a_model_validated_on_it() {
    let folder = folder();
    let here = folder.path();
    design(here);
    follow(here);
    advise(here);
    fit(here);
    validate(here);
}

/// `motion.csv`: 500 rows a second that begin and end at rest in one pose.
fn design(here: &Path) {
    let design = excite(here, &["-o", "motion.csv", "--html", "motion.html"]);
    assert_eq!(
        (design["violations"].as_u64(), design["rank"].as_u64()),
        (Some(0), Some(17))
    );
    assert!(
        design["condition_number"].as_f64().unwrap() < 100.0,
        "{design}"
    );
    assert!(design["log_det"].is_f64() && design["seconds"].is_f64());

    let text = fs::read_to_string(here.join("motion.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows.len(), rows[0].len()), (1 + 3001, 1 + 6 * 3));
    assert_eq!(rows[0][..2], ["t", "q/FR_hip"]);
    assert_eq!(rows[1][1..4], rows[3001][1..4]);
    assert!(
        rows[1][4..7]
            .iter()
            .all(|dq| dq.parse::<f64>().unwrap() == 0.0)
    );
    let coefficients = json(&fs::read_to_string(here.join("motion.json")).unwrap());
    assert_eq!(coefficients["joints"].as_array().unwrap().len(), 3);
    let page = fs::read_to_string(here.join("motion.html")).unwrap();
    assert!(page.contains("<svg class=\"stick\"") && !page.contains("http-equiv=\"refresh\""));
}

/// `log.csv`: the simulated robot follows the motion closely, and the log is one that every command reads.
fn follow(here: &Path) {
    let text = fs::read_to_string(here.join("motion.csv")).unwrap();
    done(
        here,
        &[
            "simulate",
            "--follow",
            "motion.csv",
            "--typical",
            "--inertia-error",
            "0.06",
            "-o",
            "log.csv",
        ],
    );
    let log = fs::read_to_string(here.join("log.csv")).unwrap();
    assert_eq!(log.lines().count(), 1 + 3001);
    let cell = |line: &str, n: usize| line.split(',').nth(n).unwrap().parse::<f64>().unwrap();
    for (asked, made) in text.lines().zip(log.lines()).skip(1).step_by(50) {
        for joint in 1..=3 {
            assert!(
                (cell(asked, joint) - cell(made, joint)).abs() < 0.15,
                "{asked} {made}"
            );
        }
    }
}

/// What the log tells and what it does not.
fn advise(here: &Path) {
    let advised = json(&done(
        here,
        &["advise", "log.csv", "--legs", "FR", "--json"],
    ));
    let parameters = advised["limbs"][0]["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 42);
    let learned = |name: &str| {
        let found = parameters.iter().find(|p| p["parameter"] == name).unwrap();
        found["learned"].as_str().unwrap().to_owned()
    };
    assert_eq!(learned("coulomb:FR_calf"), "identified");
    // A pinned hip turns about one axis: its mass is never felt.
    assert_eq!(learned("m:FR_hip"), "not_identifiable");
}

/// `fit.toml`: friction in the model leaves less to feedback.
fn fit(here: &Path) {
    for effect in ["viscous", "coulomb", "armature", "bias"] {
        done(here, &["add", effect, "-m", "fit.toml"]);
    }
    let told = done(
        here,
        &[
            "identify",
            "log.csv",
            "--model",
            "fit.toml",
            "-o",
            "fit.toml",
            "--base",
            "--verbose",
        ],
    );
    // What the log does not identify closes the words, with the command for the motion that would.
    assert!(
        told.contains("Not identified by these logs")
            && told.contains("proprio excite -m fit.toml --legs FR --for "),
        "{told}"
    );
    let told = done(
        here,
        &["diagnose", "log.csv", "--model", "fit.toml", "--verbose"],
    );
    assert!(told.contains("Not identified by these logs"), "{told}");
}

/// The fitted model beside the CAD's, on another motion and on the log.
fn validate(here: &Path) {
    excite(here, &["-o", "other.csv", "--seed", "7"]);
    let robot = ["--typical", "--inertia-error", "0.06"];
    let judged = [
        &[
            "validate",
            "--motion",
            "other.csv",
            "-m",
            "fit.toml",
            "--html",
            "feedback.html",
            "--json",
        ],
        &robot[..],
    ];
    let judged = json(&done(here, &judged.concat()));
    let models = judged["logs"][0]["models"].as_array().unwrap();
    let rms = |name: &str| {
        models.iter().find(|m| m["model"] == name).unwrap()["rms"]
            .as_f64()
            .unwrap()
    };
    assert!(rms("fit.toml") < 0.5 * rms("URDF"), "{models:?}");
    assert!(
        rms("fit.toml") <= rms("fit.toml, friction only") + 1e-3,
        "{models:?}"
    );
    assert!(here.join("feedback.html").exists());
    let recorded = json(&done(
        here,
        &["validate", "log.csv", "-m", "fit.toml", "--json"],
    ));
    let models = recorded["logs"][0]["models"].as_array().unwrap();
    assert!(
        models.last().unwrap()["rms"].as_f64() < models[0]["rms"].as_f64(),
        "{models:?}"
    );
}
