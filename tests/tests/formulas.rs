//! Effects as formulas, through the commands: in model files, in comparisons, and found by a diagnosis.

use std::path::Path;

use proprio_tests::command::{done, folder, proprio, refusal, simulated, stderr};
use serde_json::Value;

fn json(folder: &Path, arguments: &[&str]) -> Value {
    proprio_tests::command::json(&done(folder, &[arguments, &["--json"]].concat()))
}

const DRIVE: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];

/// A model file of a drive's effects.
fn drive(folder: &Path, file: &str) {
    done(folder, &[&["add"], &DRIVE[..], &["-m", file]].concat());
}

/// Each command of the page's gallery is one that `add` takes, and its file comes back.
#[test]
fn the_gallery_runs_as_printed() {
    let folder = folder();
    let page = include_str!("../../docs/effects.md");
    let gallery = page.split("## Gallery").nth(1).unwrap();
    let gallery = gallery.split("## ").next().unwrap();
    let commands = gallery.lines().filter_map(|line| line.split('`').nth(1));
    let mut count = 0;
    for command in commands {
        let formula = command.split('\'').nth(1).unwrap();
        done(folder.path(), &["add", formula, "-m", "go2.toml"]);
        count += 1;
    }
    assert_eq!(count, 10);
    let shown = done(folder.path(), &["show", "go2.toml", "--verbose"]);
    assert!(shown.contains("formula_10"), "{shown}");
}

/// What the catalogue has, written as a formula with the same prior, is the same fit.
#[test]
fn a_formula_of_the_catalogue_is_the_same_fit() {
    let folder = simulated("--legs FR --typical --duration 10 --hide quadratic_drag:FR_thigh=0.02");
    drive(folder.path(), "plain.toml");
    let plain = std::fs::read_to_string(folder.path().join("plain.toml")).unwrap();
    let own = [
        ("quadratic_drag", ""),
        (
            "drag",
            "torque = \"c*dq*abs(dq)\"\nc = { prior = [0.01, 0.05], min = 0.0 }\n",
        ),
    ];
    let fits = own.map(|(name, formula)| {
        let file = format!("{name}.toml");
        let text =
            format!("{plain}\n[[effect]]\nname = \"{name}\"\njoint = \"FR_thigh\"\n{formula}");
        std::fs::write(folder.path().join(&file), text).unwrap();
        json(folder.path(), &["identify", "log.csv", "-m", &file])
    });
    let values = |fit: &Value, own: &str| -> Vec<(f64, f64)> {
        let parameters = fit["parameters"].as_array().unwrap().iter();
        let pair = |p: &Value| (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
        let (mine, others): (Vec<&Value>, Vec<&Value>) =
            parameters.partition(|p| p["name"].as_str().unwrap().starts_with(own));
        assert_eq!(mine.len(), 1);
        mine.into_iter().chain(others).map(pair).collect()
    };
    let [catalogue, formula] = [values(&fits[0], "quadratic_drag"), values(&fits[1], "drag")];
    assert_eq!(catalogue.len(), formula.len());
    for ((a, da), (b, db)) in catalogue.into_iter().zip(formula) {
        assert!((a - b).abs() <= 1e-9 * a.abs().max(da), "{a} {b}");
        assert!((da - db).abs() <= 1e-6 * da, "{da} {db}");
    }
}

#[test]
fn a_bad_formula_is_refused_with_its_place() {
    let folder = folder();
    for (formula, place, word) in [
        ("FR_calf: c*tau", "    c*tau\n      ^^^", "measured torque"),
        (
            "FR_calf: c*sine(q)",
            "    c*sine(q)\n      ^^^^",
            "no function `sine`",
        ),
        (
            "FR_calf: c*(q + dq)",
            "    c*(q + dq)\n       ^^^^^^",
            "cannot be added",
        ),
        ("FR_calf: c/(q + 1.8)", "^", "not finite"),
        ("FR_calf: 3*sign(dq)", "^", "no parameter multiplies"),
        (
            "FR_calf: c*q.RL_hip",
            "RL_hip",
            "no joint `RL_hip` in the same limb",
        ),
        ("FR_knee: c*sin(q)", "", "FR_calf"),
        (
            "viscous = FR_calf: c*q",
            "",
            "another effect is called `viscous`",
        ),
    ] {
        let args = ["add", formula, "-m", "bad.toml"];
        let output = proprio(folder.path(), &args);
        assert_eq!(output.status.code(), Some(1), "{formula}");
        let told = stderr(&output);
        assert!(
            told.contains(place) && told.contains(word),
            "{formula}: {told}"
        );
        assert!(!folder.path().join("bad.toml").exists());
    }
    let long = format!("FR_calf: {}c", "c*q + ".repeat(2000));
    let args = ["add", &long, "-m", "bad.toml", "--json"];
    assert!(refusal(folder.path(), &args).contains("500 characters"));
}

/// A torque over time holds for one log: it is simulated and exported where it is asked for, and else refused with its place.
#[test]
fn a_formula_over_time_is_of_one_log() {
    let folder = folder();
    let folder = folder.path();
    let formula = "FR_thigh: 0.3*step(t - 7.3)*sign(dq)";
    let simulate = [
        "simulate",
        "--legs",
        "FR",
        "--duration",
        "1",
        "--hide",
        formula,
        "-o",
        "log.csv",
    ];
    let output = proprio(folder, &simulate);
    let told = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{told}");
    let place = "    0.3*step(t - 7.3)*sign(dq)\n             ^\n";
    for said in ["`t` is the time of one log", place, "--with-time"] {
        assert!(told.contains(said), "{said}: {told}");
    }
    assert!(!folder.join("log.csv").exists());
    done(folder, &[&simulate[..], &["--with-time"]].concat());
    // A model that has one is fitted, compared and diagnosed, and no robot of a simulator.
    drive(folder, "change.toml");
    done(
        folder,
        &[
            "add",
            "change = FR_thigh: c*step(t - 0.4)*sign(dq)",
            "-m",
            "change.toml",
        ],
    );
    for format in ["--mjcf", "--urdf"] {
        let export = ["export", "-m", "change.toml", format, "-o", "robot.xml"];
        let output = proprio(folder, &export);
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{told}");
        let place = "    c*step(t - 0.4)*sign(dq)\n           ^\n";
        for said in [
            "change:FR_thigh: `t` is the time of one log",
            place,
            "hint:",
            "--with-time",
        ] {
            assert!(told.contains(said), "{said}: {told}");
        }
        assert!(refusal(folder, &[&export[..], &["--json"]].concat()).contains("change:FR_thigh"));
        assert!(!folder.join("robot.xml").exists());
        done(folder, &[&export[..], &["--with-time"]].concat());
        std::fs::remove_file(folder.join("robot.xml")).unwrap();
    }
    done(
        folder,
        &[
            "identify",
            "log.csv",
            "-m",
            "change.toml",
            "-o",
            "fitted.toml",
        ],
    );
}

/// A log in which this is hidden, of a robot with a typical drive.
fn hiding(folder: &Path, of: &str, hidden: &str, seed: &str, log: &str) {
    let of: Vec<&str> = of.split(' ').collect();
    let hide = ["--typical", "--hide", hidden, "--seed", seed, "-o", log];
    done(folder, &[&["simulate"], &of[..], &hide].concat());
}

/// The error of a model on a log that its values have not seen.
fn given(folder: &Path, command: &[&str]) -> f64 {
    let error = &json(folder, &[command, &["--given"]].concat())["error"];
    error["after"].as_f64().unwrap()
}

/// A cable between two joints: one potential, one value for both torques. A file that has it at another leg makes it a candidate, and both of its
/// numbers come back.
#[test]
fn one_potential_moves_two_joints() {
    let folder = folder();
    let folder = folder.path();
    let hidden = "FR_calf: potential(0.5*3*(q - 0.5*q.FR_thigh + 2)^2)";
    for (seed, log) in [("5", "one.csv"), ("6", "other.csv")] {
        hiding(folder, "--legs FR,FL --duration 12", hidden, seed, log);
    }
    for (file, cable) in [
        (
            "candidate.toml",
            "cable = FL_calf: potential(0.5*k*(q - 0.5*q.FL_thigh + 2)^2)",
        ),
        (
            "cable.toml",
            "cable = FR_calf: potential(0.5*k*(q - r*q.FR_thigh + 2)^2)",
        ),
    ] {
        drive(folder, file);
        done(folder, &["add", cable, "-m", file]);
    }
    let found = json(folder, &["diagnose", "one.csv", "-m", "candidate.toml"]);
    let steps = proprio_tests::command::steps(&found);
    let is_cable = |step: &Value| {
        step["step"] == "add" && step["effect"] == "cable" && step["joints"][0] == "FR_calf"
    };
    assert!(steps.iter().any(is_cable), "{steps:?}");
    let fit = json(
        folder,
        &[
            "identify",
            "one.csv",
            "-m",
            "cable.toml",
            "-o",
            "fitted.toml",
        ],
    );
    for (name, truth, most) in [("cable:FR_calf", 3.0, 0.1), ("cable.r:FR_calf", 0.5, 0.02)] {
        let own = proprio_tests::command::parameter(&fit, name);
        let [value, std] = ["value", "std"].map(|key| own[key].as_f64().unwrap());
        let error = (value - truth).abs();
        assert!(error < 4.0 * std && std < most, "{name}: {value} ± {std}");
    }
    let other = ["compare", "other.csv", "-m", "fitted.toml"];
    let with = given(folder, &other);
    let without = given(folder, &[&other[..], &["--without", "cable"]].concat());
    assert!(with < 0.3 * without, "{with} {without}");
}

/// A robot on its feet with a formula in its file, and one of which a walk shows that it lacks a torque outside the catalogue.
#[test]
fn walks_have_formulas_too() {
    let folder = folder();
    let folder = folder.path();
    let hidden = "FR_thigh: 60*max(q - 1.0, 0)";
    for (seed, log) in [("11", "one.csv"), ("12", "other.csv")] {
        hiding(
            folder,
            "--walk trot --inertia-error 0.03",
            hidden,
            seed,
            log,
        );
    }
    for file in ["plain.toml", "stop.toml"] {
        drive(folder, file);
    }
    let stop = "stop = FR_thigh: k*max(q - q0, 0)";
    done(folder, &["add", stop, "-m", "stop.toml"]);
    let walk = |command: &'static str, file: &'static str| {
        vec![command, "--free-base", "one.csv", "-m", file]
    };
    let fit = json(
        folder,
        &[walk("identify", "stop.toml"), vec!["-o", "fitted.toml"]].concat(),
    );
    for (name, truth, most) in [
        ("stop:FR_thigh", 60.0, 3.0),
        ("stop.q0:FR_thigh", 1.0, 0.01),
    ] {
        let own = proprio_tests::command::parameter(&fit, name);
        let [value, std] = ["value", "std"].map(|key| own[key].as_f64().unwrap());
        let error = (value - truth).abs();
        assert!(error < 4.0 * std && std < most, "{name}: {value} ± {std}");
    }
    let other = ["compare", "--free-base", "other.csv", "-m", "fitted.toml"];
    let with = given(folder, &other);
    let without = given(folder, &[&other[..], &["--without", "stop"]].concat());
    // Bodies of one walk leave more on another than noise: with the file's formula still less than half.
    assert!(with < 0.5 * without, "{with} {without}");
    // Found where the file does not have it, and written.
    let found = json(folder, &walk("diagnose", "plain.toml"));
    let formulas = found["formulas"].as_array().unwrap();
    let own = formulas
        .iter()
        .find(|own| own["joint"] == "FR_thigh")
        .unwrap();
    assert_eq!(own["torque"], "c*max(q - p, 0)", "{own}");
    let only = [walk("diagnose", "plain.toml"), vec!["--catalogue-only"]].concat();
    assert!(json(folder, &only)["formulas"].is_null());
    done(
        folder,
        &[walk("diagnose", "plain.toml"), vec!["--apply"]].concat(),
    );
    let applied = given(
        folder,
        &["compare", "--free-base", "other.csv", "-m", "plain.toml"],
    );
    assert!(applied < 1.3 * with, "{applied} {with}");
}

/// Friction that grows with the position is no effect of the catalogue: the diagnosis finds its formula, `--apply` writes it, and the file
/// predicts the log of another motion.
#[test]
fn a_diagnosis_finds_a_formula() {
    let hidden = "FR_calf: 0.3*q*sign(dq)";
    let folder = simulated("--legs FR --typical --duration 12");
    for (seed, log) in [("5", "one.csv"), ("6", "other.csv")] {
        let args = [
            "simulate",
            "--legs",
            "FR",
            "--typical",
            "--duration",
            "12",
            "--hide",
            hidden,
            "--seed",
            seed,
            "-o",
            log,
        ];
        done(folder.path(), &args);
    }
    drive(folder.path(), "plain.toml");
    let found = json(folder.path(), &["diagnose", "one.csv", "-m", "plain.toml"]);
    let formulas = found["formulas"].as_array().unwrap();
    assert_eq!(formulas.len(), 1, "{formulas:?}");
    let one = &formulas[0];
    assert_eq!(
        (one["joint"].as_str(), one["torque"].as_str()),
        (Some("FR_calf"), Some("c*q*sign(dq)"))
    );
    let [value, std] = ["value", "std"].map(|key| one["parameters"][0][key].as_f64().unwrap());
    assert!(
        (value - 0.3).abs() < 3.0 * std && std < 0.01,
        "{value} ± {std}"
    );
    done(
        folder.path(),
        &["diagnose", "one.csv", "-m", "plain.toml", "--apply"],
    );
    let error = |args: &[&str]| {
        json(folder.path(), args)["error"]["after"]
            .as_f64()
            .unwrap()
    };
    let with = error(&["compare", "other.csv", "-m", "plain.toml", "--given"]);
    let without = error(&[
        "compare",
        "other.csv",
        "-m",
        "plain.toml",
        "--without",
        "q_sign_dq",
    ]);
    assert!(with < 0.3 * without, "{with} {without}");
    // A robot that lacks nothing has no formula.
    let complete = json(folder.path(), &["diagnose", "log.csv", "-m", "plain.toml"]);
    assert!(complete["formulas"].is_null(), "{}", complete["formulas"]);
}

/// Friction that is larger at a place, of a width that nobody has told: both come out of a fit with their deviations, of a file's formula and of the
/// one that a diagnosis finds, and predict the log of another motion as the one does whose width is known.
#[test]
fn a_place_and_a_width_are_fitted() {
    let folder = folder();
    let folder = folder.path();
    let hidden = "FR_thigh: 1.5*exp(-((q-0.9)/0.17)^2)*sign(dq)";
    for (seed, log) in [("5", "one.csv"), ("6", "other.csv")] {
        hiding(folder, "--legs FR --duration 20", hidden, seed, log);
    }
    let files = ["found.toml", "free.toml", "known.toml"];
    files.iter().for_each(|file| drive(folder, file));
    let worn = |width: &str| format!("worn = FR_thigh: c*exp(-((q - q0)/{width})^2)*sign(dq)");
    done(folder, &["add", &worn("w"), "-m", "free.toml"]);
    done(folder, &["add", &worn("0.17"), "-m", "known.toml"]);
    done(
        folder,
        &["diagnose", "one.csv", "-m", "found.toml", "--apply"],
    );
    let fits = files.map(|file| json(folder, &["identify", "one.csv", "-m", file, "-o", file]));
    let own = [
        ("exp_q_p_w_2_sign_dq", [".p", ".w"], &fits[0]),
        ("worn", [".q0", ".w"], &fits[1]),
    ];
    for (name, shapes, fit) in own {
        for (symbol, truth) in ["", shapes[0], shapes[1]].into_iter().zip([1.5, 0.9, 0.17]) {
            let own = proprio_tests::command::parameter(fit, &format!("{name}{symbol}:FR_thigh"));
            let [value, std] = ["value", "std"].map(|key| own[key].as_f64().unwrap());
            let error = (value - truth).abs();
            assert!(
                error < 0.005 * truth && std < 0.005 * truth,
                "{name}{symbol}: {value} ± {std}"
            );
        }
    }
    let [found, free, known] =
        files.map(|file| given(folder, &["compare", "other.csv", "-m", file]));
    assert!(
        found < 1.02 * known && free < 1.02 * known,
        "{found} {free} {known}"
    );
}
