//! The line from a designed motion to a judged model: `excite`, `simulate --follow`, `advise`, `validate`.

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, folder, proprio, stderr};
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

    // 500 rows a second that begin and end at rest in one pose.
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

    // The simulated robot follows it closely, and the log is one that every command reads.
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
    assert_eq!(learned("coulomb:FR_calf"), "told");
    // A pinned hip turns about one axis: its mass is never felt.
    assert_eq!(learned("m:FR_hip"), "never");

    // Friction in the model leaves less to feedback.
    for effect in ["viscous", "coulomb", "armature", "bias"] {
        done(here, &["add", effect, "-m", "fit.toml"]);
    }
    let told = done(
        here,
        &[
            "identify", "log.csv", "--model", "fit.toml", "-o", "fit.toml",
        ],
    );
    // What the log could not tell closes the words, with the command for the motion that would.
    assert!(
        told.contains("What these logs could not tell")
            && told.contains("proprio excite -m fit.toml --legs FR --for "),
        "{told}"
    );
    let told = done(here, &["diagnose", "log.csv", "--model", "fit.toml"]);
    assert!(told.contains("What these logs could not tell"), "{told}");
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

#[test]
fn bad_input_is_named_and_leaves_no_file() {
    let folder = folder();
    let here = folder.path();
    fs::write(here.join("short.csv"), "t,q/FR_hip\n0,0\n").unwrap();
    fs::write(
        here.join("wall.toml"),
        "[[plane]]\nname = \"the wall\"\nnormal = [0, 0, 1]\noffset = 0.5\n",
    )
    .unwrap();
    fs::write(here.join("bad.toml"), "[[cylinder]]\n").unwrap();
    bad_motions(here);
    let files = fs::read_dir(here).unwrap().count();
    let cases: [(&[&str], i32, &str); 42] = [
        (
            &["excite", "--pose", "FR_calf=-3"],
            1,
            "position of FR_calf",
        ),
        (&["excite", "--position-margin", "1.5"], 1, "cannot move"),
        (&["excite", "--legs", "FX"], 1, "no leg `FX`"),
        (&["excite", "--pose", "FR_knee=0"], 1, "FR_knee"),
        (
            &["excite", "--duration", "0"],
            1,
            "the duration must be a positive number",
        ),
        (
            &["excite", "--acceleration", "nan"],
            1,
            "the greatest acceleration",
        ),
        (
            &["excite", "--separate", "stribeck,stribek:FR_hip"],
            2,
            "did you mean `stribeck`",
        ),
        (
            &["excite", "--separate", "contact,viscous:FR_hip"],
            1,
            "contact",
        ),
        (
            &["simulate", "--follow", "short.csv"],
            1,
            "no column `q/FR_thigh`",
        ),
        (&["validate"], 2, "--motion"),
        (
            &["excite", "--velocity-share", "nan"],
            1,
            "the share of the speed",
        ),
        (&["excite", "--duration", "inf"], 1, "the duration"),
        (
            &["excite", "--pose", "FR_calf=nan"],
            1,
            "the pose of FR_calf",
        ),
        (&["excite", "--torque-share", "0.01"], 1, "torque of FR_"),
        (&["excite", "--starts", "0"], 1, "the number of starts"),
        (
            &["excite", "--legs", "FR", "--for", "m:FR_foot"],
            1,
            "m:FR_foot",
        ),
        (
            &[
                "excite",
                "--legs",
                "FR",
                "--separate",
                "viscous,coulomb:FR_knee",
            ],
            1,
            "FR_knee",
        ),
        (&["excite", "--shapes", "none.toml"], 1, "none.toml"),
        (&["excite", "--shapes", "bad.toml"], 1, "cylinder"),
        // Where the leg hangs the wall stands already.
        (
            &["excite", "--legs", "FR", "--shapes", "wall.toml"],
            1,
            "to the wall is beyond its limit",
        ),
        (
            &["excite", "--legs", "FR", "--from", "short.csv"],
            1,
            "short.csv",
        ),
        (
            &["excite", "--ground", "nan"],
            1,
            "the height above the ground",
        ),
        (
            &["excite", "--period", "0"],
            1,
            "the period must be a positive number",
        ),
        (
            &["excite", "--uncertainty", "nan"],
            1,
            "the uncertainty of the parameters",
        ),
        (
            &["excite", "--power-share", "nan"],
            1,
            "the share of the power",
        ),
        (&["excite", "--kp", "nan"], 2, "must lie between"),
        (&["excite", "--kd=-1"], 2, "must lie between"),
        // The floor is where the foot is.
        (
            &["excite", "--legs", "FR", "--ground", "0.05"],
            1,
            "foot to the ground is beyond its limit",
        ),
        (&["simulate", "--follow", "none.csv"], 1, "none.csv"),
        (&["simulate", "--follow", "still.csv"], 1, "no motion"),
        (
            &["simulate", "--follow", "instant.csv"],
            1,
            "instant.csv:3: the time",
        ),
        (
            &["simulate", "--follow", "nan.csv"],
            1,
            "nan.csv:3: `nan` in column `q/FR_thigh`",
        ),
        (
            &["simulate", "--follow", "stops.csv"],
            1,
            "stops.csv:3: FR_thigh is asked to be at 9 rad",
        ),
        (
            &["simulate", "--follow", "knee.csv"],
            1,
            "there is no joint `FR_knee`",
        ),
        (
            &["simulate", "--follow", "path.csv", "--duration", "0"],
            2,
            "--duration",
        ),
        (
            &["validate", "--motion", "nan.csv", "--html", "page.html"],
            1,
            "nan.csv:3",
        ),
        (
            &["validate", "--motion", "stops.csv", "--html", "page.html"],
            1,
            "stops.csv:3",
        ),
        (
            &["validate", "none.csv", "--html", "page.html"],
            1,
            "none.csv",
        ),
        (
            &["validate", "--motion", "path.csv", "-m", "none.toml"],
            1,
            "none.toml",
        ),
        (&["advise", "none.csv"], 1, "none.csv"),
        (&["advise", "path.csv", "--legs", "FX"], 1, "no leg `FX`"),
        (&["advise", "short.csv"], 1, "short.csv"),
    ];
    for (arguments, status, words) in cases {
        let output = proprio(here, arguments);
        assert_eq!(
            output.status.code(),
            Some(status),
            "{arguments:?}: {}",
            stderr(&output)
        );
        assert!(
            stderr(&output).contains(words),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
    let left: Vec<_> = fs::read_dir(here)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), files, "{left:?}");
}

/// Motions that no leg can follow, and `path.csv` that one can.
fn bad_motions(folder: &Path) {
    let columns = ["q", "dq", "ddq"].map(|c| format!("{c}/FR_hip,{c}/FR_thigh,{c}/FR_calf"));
    let header = format!("t,{}\n", columns.join(","));
    let row = |t: &str, thigh: &str| format!("{t},0,{thigh},-1.7,0,0,0,0,0,0\n");
    let start = row("0", "0.9");
    let write = |name: &str, text: String| fs::write(folder.join(name), text).unwrap();
    write("path.csv", format!("{header}{start}{}", row("1", "0.9")));
    write("still.csv", format!("{header}{start}"));
    write("instant.csv", format!("{header}{start}{start}"));
    write("nan.csv", format!("{header}{start}{}", row("1", "nan")));
    write("stops.csv", format!("{header}{start}{}", row("1", "9")));
    write(
        "knee.csv",
        format!("{}{start}", header.replace("q/FR_calf", "q/FR_knee")),
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

/// The trunk's motion over planted feet, quick to find and as long as the committed walks.
const STANDING: [&str; 8] = [
    "excite",
    "--standing",
    "--starts",
    "1",
    "--harmonics",
    "4",
    "--duration",
    "4.5",
];

#[test]
fn a_motion_of_the_trunk_over_planted_feet_is_designed_and_told() {
    let folder = folder();
    let here = folder.path();
    let design = json(&done(
        here,
        &[&STANDING[..], &["--json", "-o", "sway.csv"]].concat(),
    ));
    for key in ["condition_number", "log_det", "seconds"] {
        assert!(design[key].is_f64(), "{key}: {design}");
    }
    assert_eq!(
        (design["violations"].as_u64(), design["rank"].as_u64()),
        (Some(0), Some(10))
    );
    assert!(design["cone"].as_f64().unwrap() <= 1.0);
    assert!(design["least_load"].as_f64().unwrap() >= 10.0);
    let trunk = design["trunk"].as_array().unwrap();
    let names: Vec<&str> = trunk.iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names[..4], ["m:base", "hx:base", "hy:base", "hz:base"]);
    assert_eq!(names.len(), 10);
    for parameter in trunk {
        let of = |key: &str| parameter[key].as_f64().unwrap();
        assert!(
            of("std") > 0.0 && of("std") <= of("prior_std"),
            "{parameter}"
        );
    }
    assert_eq!(trunk[0]["status"], "identified");

    // The same columns as of a limb's motion, all twelve joints, at rest at both ends; velocities are the positions' slopes.
    let text = fs::read_to_string(here.join("sway.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows.len(), rows[0].len()), (1 + 2251, 1 + 6 * 12));
    assert_eq!(
        [
            rows[0][1],
            rows[0][13],
            rows[0][25],
            rows[0][37],
            rows[0][49],
            rows[0][61]
        ],
        [
            "q/FR_hip",
            "dq/FR_hip",
            "ddq/FR_hip",
            "tau/FR_hip",
            "kp/FR_hip",
            "kd/FR_hip"
        ]
    );
    let cell = |row: usize, column: usize| rows[row][column].parse::<f64>().unwrap();
    assert!((1..=12).all(|joint| (cell(1, joint) - cell(2251, joint)).abs() < 1e-6));
    for row in (2..2250).step_by(7) {
        for joint in 1..=12 {
            // Simpson's rule: positions move by what velocities add up to.
            let moved = cell(row + 1, joint) - cell(row - 1, joint);
            let dq = |row: usize| cell(row, joint + 12);
            let integral = (dq(row - 1) + 4.0 * dq(row) + dq(row + 1)) * 0.004 / 6.0;
            assert!((moved - integral).abs() < 1e-6, "{row} {joint}");
        }
    }
    let coefficients = json(&fs::read_to_string(here.join("sway.json")).unwrap());
    assert_eq!(coefficients["coordinates"].as_array().unwrap().len(), 6);

    // For humans: a table, and what was assumed. The same seed gives the same motion.
    let told = done(here, &[&STANDING[..], &["-o", "again.csv"]].concat());
    for word in ["m:base", "identified", "friction cone", "0.1 N m", "rolls"] {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert_eq!(fs::read_to_string(here.join("again.csv")).unwrap(), text);
}

#[test]
fn a_stance_that_cannot_be_is_refused_with_the_fix() {
    let folder = folder();
    for (more, status, words) in [
        (&["--height", "0.6"][..], 1, "--height"),
        (&["--friction", "0"], 1, "positive"),
        (&["--legs", "FR"], 2, "--legs"),
    ] {
        let run = proprio(
            folder.path(),
            &[&STANDING[..], &["-o", "sway.csv"], more].concat(),
        );
        assert_eq!(
            run.status.code(),
            Some(status),
            "{more:?}: {}",
            stderr(&run)
        );
        assert!(stderr(&run).contains(words), "{more:?}: {}", stderr(&run));
        assert!(!folder.path().join("sway.csv").exists());
    }
}

#[test]
fn a_motion_of_a_robot_that_hangs_is_chosen_and_told() {
    let folder = folder();
    let quick = [
        "excite",
        "--suspended",
        "--starts",
        "1",
        "--harmonics",
        "4",
        "--duration",
        "5",
    ];
    let design = json(&done(
        folder.path(),
        &[&quick[..], &["--json", "-o", "swing.csv"]].concat(),
    ));
    assert_eq!(design["violations"].as_u64(), Some(0));
    for key in ["condition_number", "log_det", "seconds", "tilt"] {
        assert!(design[key].is_f64(), "{key}: {design}");
    }
    let trunk = design["trunk"].as_array().unwrap();
    assert_eq!(trunk.len(), 10);
    let of = |name: &str| trunk.iter().find(|p| p["name"] == name).unwrap();
    let left =
        |name: &str| of(name)["std"].as_f64().unwrap() / of(name)["prior_std"].as_f64().unwrap();
    assert!(left("m:base") < 1.0 && left("hx:base") < 0.5, "{design}");
    let text = fs::read_to_string(folder.path().join("swing.csv")).unwrap();
    assert_eq!(text.lines().count(), 1 + 2501);
    let told = done(folder.path(), &[&quick[..], &["-o", "again.csv"]].concat());
    assert!(told.contains("rope") && told.contains("m:base"), "{told}");
    assert_eq!(
        fs::read_to_string(folder.path().join("again.csv")).unwrap(),
        text
    );
}
