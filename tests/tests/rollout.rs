//! `compare --rollout`: a model run forward under the measured torque, or by what its drives were asked to do.

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

const JOINTS: [&str; 3] = ["FR_hip", "FR_thigh", "FR_calf"];
/// Rows a second of the motion and of the log: a command holds for one, and a controller of 4 kHz sees it between two.
const RATE: f64 = 2000.0;
const GAINS: [f64; 2] = [40.0, 1.5];

/// A leg that follows sines, with a Go2's typical drives: `log.csv` has what they were asked to do, `motion.csv` too.
fn followed(folder: &Path) {
    let centre = [0.0, 0.9, -1.7];
    let channels = ["q", "dq", "ddq", "tau", "kp", "kd"];
    let names = channels
        .iter()
        .flat_map(|c| JOINTS.map(|joint| format!(",{c}/{joint}")));
    let mut motion = format!("t{}\n", names.collect::<String>());
    let rows = (6.0 * RATE) as usize;
    for k in 0..=rows {
        let t = k as f64 / RATE;
        let part = |of: &dyn Fn(f64, f64) -> f64| -> String {
            let joint = |j: usize| {
                let (w, v) = (3.0 + 2.1 * j as f64, 11.0 - 3.3 * j as f64);
                format!(",{}", of(w, 0.3) + of(v, 0.05) + of(0.0, centre[j]))
            };
            (0..3).map(joint).collect()
        };
        motion += &format!("{t}");
        // A sine that begins at rest in the middle, and its derivatives; of no frequency a constant.
        motion += &part(&|w, a| {
            if w == 0.0 {
                a
            } else {
                a * (1.0 - (w * t).cos())
            }
        });
        motion += &part(&|w, a| a * w * (w * t).sin());
        motion += &part(&|w, a| a * w * w * (w * t).cos());
        for number in [0.0, GAINS[0], GAINS[1]] {
            motion += &format!(",{number}").repeat(3);
        }
        motion.push('\n');
    }
    fs::write(folder.join("motion.csv"), &motion).unwrap();
    let rate = RATE.to_string();
    let words = [
        "simulate",
        "--follow",
        "motion.csv",
        "--typical",
        "--rate",
        &rate,
        "-o",
        "bare.csv",
    ];
    done(folder, &words);
    let bare = fs::read_to_string(folder.join("bare.csv")).unwrap();
    assert_eq!(bare.lines().count(), motion.lines().count());
    let joined = bare
        .lines()
        .zip(motion.lines())
        .enumerate()
        .map(|(n, (log, motion))| {
            let cells: Vec<&str> = motion.split(',').collect();
            let command = match n {
                0 => ["q_des", "dq_des", "tau_des", "kp", "kd"]
                    .map(|channel| JOINTS.map(|joint| format!("{channel}/{joint}")).join(","))
                    .join(","),
                _ => [&cells[1..7], &cells[10..]].concat().join(","),
            };
            format!("{log},{command}\n")
        });
    fs::write(folder.join("log.csv"), joined.collect::<String>()).unwrap();
}

/// `log.csv` without some of its channels.
fn without(folder: &Path, channels: &[&str], name: &str) {
    let log = fs::read_to_string(folder.join("log.csv")).unwrap();
    let header: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let channel = |column: &str| column.split('/').next().unwrap().to_owned();
    let kept: Vec<bool> = (header.iter())
        .map(|column| !channels.contains(&channel(column).as_str()))
        .collect();
    let line = |line: &str| -> String {
        let cells = line.split(',').zip(&kept).filter(|(_, kept)| **kept);
        cells.map(|(cell, _)| cell).collect::<Vec<_>>().join(",") + "\n"
    };
    fs::write(folder.join(name), log.lines().map(line).collect::<String>()).unwrap();
}

/// Drives that follow the log's commands stay with the motion where the model is right, and the CAD without friction does not. Gains may be the log's, or
/// stated; what is missing is refused.
#[test]
fn drives_follow_what_they_were_asked_to_do() {
    let folder = folder();
    let folder = folder.path();
    followed(folder);
    done(folder, &["identify", "log.csv", "-o", "fitted.toml"]);
    let commanded = ["--rollout=commanded", "--given"];
    let run = |log: &str, more: &[&str]| {
        let words = [
            &["compare", log, "-m", "fitted.toml", "--json"],
            &commanded[..],
            more,
        ];
        json(&done(folder, &words.concat()))
    };
    let found = run("log.csv", &[]);
    assert_eq!(found["torque"], "commanded");
    let (own, cad) = (errors(&found, "rms"), errors(&found, "cad_rms"));
    println!("{own:?} {cad:?}");
    for (own, cad) in own.iter().zip(&cad) {
        assert!(*own < 1.5e-3 && *own < 0.2 * cad, "{own} {cad}");
    }

    without(folder, &["kp", "kd", "tau_des"], "gains.csv");
    let stated = run(
        "gains.csv",
        &["--kp", "1,FR_hip=40,FR_thigh=40,FR_calf=40", "--kd", "1.5"],
    );
    assert_eq!(stated["horizons"], found["horizons"]);
    let softer = run("log.csv", &["--kp", "20"]);
    assert!(errors(&softer, "rms")[2] > 5.0 * own[2]);

    let refused = |log: &str, words: [&str; 2]| {
        let asked = [&["compare", log, "-m", "fitted.toml"], &commanded[..]].concat();
        let output = proprio(folder, &asked);
        assert_eq!(output.status.code(), Some(1), "{log}");
        for words in words {
            assert!(stderr(&output).contains(words), "{}", stderr(&output));
        }
    };
    refused(
        "gains.csv",
        ["FR_hip has a commanded position", "--kp 25 --kd 0.5"],
    );
    refused("bare.csv", ["no column `q_des/FR_hip`", "tau_des/JOINT"]);

    // Without gains the commanded torque is all: here the measured one.
    let log = fs::read_to_string(folder.join("bare.csv")).unwrap();
    let (header, rows) = log.split_once('\n').unwrap();
    let names = JOINTS.map(|joint| format!("tau_des/{joint}")).join(",");
    let rows = rows.lines().map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        format!("{row},{}\n", cells[7..10].join(","))
    });
    let text = format!("{header},{names}\n{}", rows.collect::<String>());
    fs::write(folder.join("torque.csv"), text).unwrap();
    let alone = errors(&run("torque.csv", &[]), "rms");
    let measured = rollout(folder, "fitted.toml", &["--given"]);
    let measured = errors(&measured, "rms");
    assert!(
        (alone[0] / measured[0] - 1.0).abs() < 0.2,
        "{alone:?} {measured:?}"
    );
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
    let words = ["compare", "log.csv", "--rollout", "--kp", "25"];
    let output = proprio(folder.path(), &words);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("are of --rollout=commanded"));
}
