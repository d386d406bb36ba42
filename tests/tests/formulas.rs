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
