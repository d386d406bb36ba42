//! `--only`: a part of a log is judged, by a condition on the motion.

use std::path::Path;

use proprio_tests::command::{done, folder, json, refusal};
use proprio_tests::rows::Rows;

const PLAIN: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];

/// A leg with this hidden, and the model of a plain drive.
fn simulated(folder: &Path, hide: &str) {
    let simulate = ["simulate", "--legs", "FR", "--typical", "--duration", "10"];
    let hide = ["-o", "log.csv", "--with-time", "--hide", hide];
    done(folder, &[&simulate[..], &hide].concat());
    done(folder, &[&["add", "-m", "plain.toml"][..], &PLAIN].concat());
}

fn error(folder: &Path, model: &str, only: &str) -> f64 {
    let compare = [
        "compare", "log.csv", "-m", model, "--given", "--json", "--only", only,
    ];
    json(&done(folder, &compare))["error"]["after"]
        .as_f64()
        .unwrap()
}

/// What is fitted to the half in which all is well predicts that half to its noise, and shows the other.
#[test]
fn a_fault_half_way_is_set_apart() {
    let folder = folder();
    let folder = folder.path();
    simulated(folder, "FR_calf: 0.4*step(t - 5)*sign(dq)");
    let clean = [
        "identify",
        "log.csv",
        "-m",
        "plain.toml",
        "--only",
        "t < 5",
        "-o",
        "clean.toml",
    ];
    done(folder, &clean);
    let [before, after] = ["t < 5", "t > 5"].map(|only| error(folder, "clean.toml", only));
    assert!(before < 0.012, "{before}");
    assert!(after > 0.1, "{after}");
    let found = done(
        folder,
        &["diagnose", "log.csv", "-m", "clean.toml", "--only", "t < 5"],
    );
    assert!(found.starts_with("Missing: nothing"), "{found}");
}

/// A stop beyond an angle is in bodies and friction of the whole log, and not in those of the part before it.
#[test]
fn the_part_before_a_stop_is_unbiased() {
    let folder = folder();
    let folder = folder.path();
    simulated(folder, "FR_thigh: 20*max(q - 1.0, 0)");
    let before_it = "FR_thigh: q < 1";
    let fitted = |model: &str, only: &[&str]| {
        let identify = ["identify", "log.csv", "-m", "plain.toml", "-o", model];
        done(folder, &[&identify[..], only].concat());
        error(folder, model, before_it)
    };
    let whole = fitted("whole.toml", &[]);
    let part = fitted("part.toml", &["--only", before_it]);
    assert!(part < 0.012, "{part}");
    assert!(whole > 2.0 * part, "{whole}, {part}");
}

/// All limbs are restricted by time, one by its joint; the others stay whole.
#[test]
fn limbs_of_other_joints_stay_whole() {
    let folder = folder();
    let folder = folder.path();
    let simulate = [
        "simulate",
        "--legs",
        "FR,RL",
        "--typical",
        "--duration",
        "6",
        "-o",
        "log.csv",
    ];
    done(folder, &simulate);
    let windows = |only: &[&str]| {
        let compare = ["compare", "log.csv", "--json"];
        let compared = json(&done(folder, &[&compare[..], only].concat()));
        let joints = compared["joints"].as_array().unwrap().iter();
        joints
            .map(|joint| joint["n"].as_u64().unwrap())
            .collect::<Vec<_>>()
    };
    let all = windows(&[]);
    let half = windows(&["--only", "t < 3"]);
    let bent = windows(&["--only", "FR_calf: q < -1.6"]);
    for joint in 0..6 {
        let share = half[joint] as f64 / all[joint] as f64;
        assert!((0.4..0.6).contains(&share), "{share}");
        assert_eq!(bent[joint] == all[joint], joint >= 3, "{bent:?} {all:?}");
    }
    let both = windows(&["--only", "t < 3", "--only", "FR_calf: q < -1.6"]);
    assert!(both[0] < bent[0] && both[0] < half[0], "{both:?}");
}

/// Each refusal says what is wrong with the condition, and nothing is written.
#[test]
fn what_is_no_condition_is_refused() {
    let folder = folder();
    let folder = folder.path();
    let simulate = [
        "simulate",
        "--legs",
        "FR",
        "--typical",
        "--duration",
        "4",
        "-o",
        "log.csv",
    ];
    done(folder, &simulate);
    for (only, said) in [
        ("q > 1", "of which joint? Write `FR_hip: q > 1`"),
        (
            "FR_knee: q > 1",
            "no joint `FR_knee` in these logs; there are FR_hip",
        ),
        ("FR_calf: q", "compares two sums"),
        ("FR_calf: q > limit", "`limit` is no signal"),
        ("FR_calf: tau > 1", "measured torque"),
        (
            "FR_calf: q > 70",
            "holds for 0 s of FR_calf, whose q goes from -",
        ),
        ("t > 3.95", "holds for 0.0"),
    ] {
        let identify = ["identify", "log.csv", "-o", "out.toml", "--only", only];
        let words = refusal(folder, &identify);
        assert!(words.contains(said), "{only}: {words}");
        assert!(words.contains("--only"), "{words}");
        assert!(!folder.join("out.toml").exists());
    }
}

/// A load that a calf takes up within the log: one cause of what is left at every joint that carries it, told with its time and mass; the commands that the
/// screen prints set the parts apart, of which the first lacks nothing.
#[test]
fn a_load_that_comes_is_told_with_its_time_and_mass() {
    for (seed, from, mass) in [(1, 6.3, 0.25), (2, 13.1, 0.4)] {
        let folder = folder();
        let folder = folder.path();
        let leg = format!("--legs FR --typical --inertia-error 0.04 --seed {seed}");
        let hidden = format!("payload:FR_calf={mass}");
        for (name, hide) in [("log.csv", None), ("loaded.csv", Some(&*hidden))] {
            let simulate = ["simulate", "-o", name].into_iter().chain(leg.split(' '));
            let hide = hide.iter().flat_map(|hide| ["--hide", hide]);
            done(folder, &simulate.chain(hide).collect::<Vec<_>>());
        }
        // While it is taken up nothing is recorded.
        let loaded = Rows::read(&folder.join("loaded.csv"));
        let mut log = Rows::read(&folder.join("log.csv"));
        log.rows.retain(|row| row[0] < from);
        let later = loaded.rows.into_iter().filter(|row| row[0] > from + 0.4);
        log.rows.extend(later);
        log.write(&folder.join("log.csv"));
        let found = json(&done(folder, &["diagnose", "log.csv", "--json"]));
        let (loads, left) = (&found["load_changes"], &found["outside_catalogue"]);
        assert_eq!(
            [loads, left].map(|all| all.as_array().unwrap().len()),
            [1, 1],
            "{left}"
        );
        let number = |name: &str| loads[0][name].as_f64().unwrap();
        assert_eq!(loads[0]["joint"], "FR_calf");
        assert!(
            (number("mass") - mass).abs() < 3.0 * number("std"),
            "{loads}"
        );
        assert!(number("std") < 0.1 * mass, "{loads}");
        assert!((from..from + 0.6).contains(&number("from")), "{loads}");
        let screen = done(folder, &["diagnose", "log.csv"]);
        assert!(screen.contains("Missing: a load that comes at"), "{screen}");
        let (_, only) = screen
            .split_once("Next: proprio diagnose log.csv --only '")
            .unwrap();
        let (first, _) = only.split_once('\'').unwrap();
        let screen = done(folder, &["diagnose", "log.csv", "--only", first]);
        let screen = screen.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            screen.contains("Missing: the drive's 4 effects."),
            "{screen}"
        );
    }
}
