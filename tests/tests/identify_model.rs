//! `identify --model` as its user meets it: values written with where they come from, several logs, a report, bad input.

use std::fs;
use std::path::Path;

use proprio_host::model::{Model, Provenance};
use proprio_tests::command::{done, json, parameter, proprio, refusal, simulated, stderr, stdout};
use serde_json::Value;

/// What each motor of a simulated leg has.
const TYPICAL: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];

fn add_typical(folder: &Path, model: &str) {
    done(folder, &[&["add", "-m", model][..], &TYPICAL].concat());
}

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key}: {value}"))
}

/// Everything in a folder, to be compared with later.
fn contents(folder: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut all: Vec<_> = entries.map(|p| (p.clone(), fs::read(p).unwrap())).collect();
    all.sort();
    all
}

/// The message of a command that must refuse and leave the folder as it was.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let before = contents(folder);
    let message = refusal(folder, arguments);
    assert!(
        contents(folder) == before,
        "{arguments:?}: a file has changed"
    );
    assert!(message.contains("\nhint: "), "{message}");
    message
}

/// Values, errors and priors as they are told are those in the file, the file says whence, and `compare` takes it.
#[test]
fn a_fit_becomes_a_model_that_says_where_it_comes_from() {
    let folder = simulated("--legs FR --typical --inertia-error 0.06 --hide coulomb:FR_calf=0.9");
    let folder = folder.path();
    add_typical(folder, "model.toml");
    // A prior that the user states survives the fit.
    let path = folder.join("model.toml");
    let text = fs::read_to_string(&path).unwrap();
    let stated = "[prior.effect.coulomb]\nmean = 0.4\nstd = 0.9\n\n[[effect]]";
    fs::write(&path, text.replacen("[[effect]]", stated, 1)).unwrap();
    let before = fs::read(&path).unwrap();

    let fit = [
        "identify",
        "log.csv",
        "-m",
        "model.toml",
        "-o",
        "fitted.toml",
    ];
    let told = json(&done(folder, &[&fit[..], &["--json"]].concat()));
    assert_eq!(fs::read(&path).unwrap(), before);

    let model = Model::load(&folder.join("fitted.toml")).unwrap();
    let truth = json(&fs::read_to_string(folder.join("log.truth.json")).unwrap());
    for (joint, name) in ["FR_hip", "FR_thigh", "FR_calf"].into_iter().enumerate() {
        for effect in TYPICAL {
            let parameter_name = format!("{effect}:{name}");
            let estimate = parameter(&told, &parameter_name);
            let kind = proprio_core::effect::EffectKind::from_name(effect).unwrap();
            let written = model.effect(kind, joint).unwrap().estimate().unwrap();
            // The file has nine digits.
            let same = |a: f64, b: f64| (a - b).abs() <= 1e-8 * b.abs();
            assert!(same(written.value, number(estimate, "value")));
            assert!(same(written.std.unwrap(), number(estimate, "std")));
        }
        assert!(model.is_identified(joint) && model.inertia(joint).is_physical());
    }
    let coulomb = parameter(&told, "coulomb:FR_calf");
    assert_eq!(coulomb["status"], "identified");
    // Solved from a triangle: rounding, no more.
    assert!((number(coulomb, "prior") - 0.4).abs() < 1e-9);
    assert!((number(coulomb, "prior_std") - 0.9).abs() < 1e-9);
    let off = number(coulomb, "value") - number(parameter(&truth, "coulomb:FR_calf"), "value");
    // studies/coverage.md: within 3 σ in 99 % where dry friction's reversals bias the calf; 5 σ is beyond chance.
    assert!(off.abs() < 5.0 * number(coulomb, "std"), "{coulomb}");
    assert!(number(&told, "held_out_rms") < 0.2 * number(&told, "cad_rms"));

    let Provenance {
        version,
        command,
        logs,
        ..
    } = model.provenance().unwrap();
    assert_eq!(version, env!("CARGO_PKG_VERSION"));
    assert_eq!(*command, format!("proprio {} --json", fit.join(" ")));
    let sha256 = proprio_host::log::sha256(&folder.join("log.csv")).unwrap();
    assert_eq!(logs.len(), 1);
    assert_eq!(
        (logs[0].path.as_str(), &logs[0].sha256),
        ("log.csv", &sha256)
    );

    let given = [
        "compare",
        "log.csv",
        "-m",
        "fitted.toml",
        "--given",
        "--json",
    ];
    let given = json(&done(folder, &given));
    // The same values on the same windows: what differs is the file's ninth digit.
    assert!((number(&given, "rms") / number(&told, "rms") - 1.0).abs() < 1e-6);

    // In place, and again: values do not count, so that the fit is the same.
    let again = [
        "identify",
        "log.csv",
        "-m",
        "fitted.toml",
        "-o",
        "fitted.toml",
        "--json",
    ];
    assert_eq!(
        json(&done(folder, &again))["parameters"],
        told["parameters"]
    );
}

/// Several logs are fitted together and each on its own.
#[test]
fn runs_of_several_logs_are_told_beside_the_fit_of_all() {
    let folder = simulated("--legs FR --typical --duration 8");
    let folder = folder.path();
    for (log, seed, friction) in [("b.csv", "2", "0.6"), ("c.csv", "3", "0.9")] {
        let hide = format!("coulomb:FR_calf={friction}");
        let fixed = ["simulate", "--legs", "FR", "--typical", "--duration", "8"];
        let own = ["--seed", seed, "--hide", &hide, "-o", log];
        done(folder, &[&fixed[..], &own].concat());
    }
    add_typical(folder, "model.toml");
    let fit = |logs: &[&str]| {
        let fixed = ["identify", "-m", "model.toml", "--json"];
        json(&done(folder, &[&fixed[..], logs].concat()))
    };
    let (one, two) = (fit(&["log.csv"]), fit(&["log.csv", "b.csv"]));
    let std = |report: &Value| number(parameter(report, "viscous:FR_calf"), "std_independent");
    // Twice the data: 1/√2, and two motions are not equally rich.
    let ratio = std(&two) / std(&one);
    assert!((0.6..0.85).contains(&ratio), "{ratio}");
    assert_eq!(one["runs"], Value::Null);
    let runs = two["runs"].as_array().unwrap();
    assert_eq!(runs[0]["rms"], one["rms"]);
    assert!(runs.iter().all(|run| run["disagreements"] == 0), "{runs:?}");

    let three = fit(&["log.csv", "b.csv", "c.csv"]);
    let worst = &three["consistency"][0];
    assert_eq!(worst["parameter"], "coulomb:FR_calf");
    assert_eq!(
        (&worst["differs"], &worst["consistent"]),
        (&2.into(), &false.into())
    );

    let text = done(
        folder,
        &["identify", "log.csv", "b.csv", "c.csv", "-m", "model.toml"],
    );
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("The logs disagree beyond chance"), "{text}");
    done(
        folder,
        &[
            "identify",
            "log.csv",
            "b.csv",
            "-m",
            "model.toml",
            "-o",
            "two.toml",
        ],
    );
    let model = Model::load(&folder.join("two.toml")).unwrap();
    let logs = model.provenance().unwrap().logs.iter();
    let logs: Vec<&str> = logs.map(|log| log.path.as_str()).collect();
    assert_eq!(logs, ["log.csv", "b.csv"]);
}

/// What cannot be fitted, or is no model, is refused, and what is there stays.
#[test]
fn bad_input_overwrites_nothing() {
    let folder = simulated("--legs FR --duration 4");
    let folder = folder.path();
    add_typical(folder, "model.toml");
    fs::write(folder.join("out.toml"), "precious").unwrap();
    fs::write(folder.join("report.html"), "precious").unwrap();
    let model = fs::read_to_string(folder.join("model.toml")).unwrap();
    let log = fs::read_to_string(folder.join("log.csv")).unwrap();
    let fit = [
        "identify",
        "log.csv",
        "-m",
        "model.toml",
        "-o",
        "out.toml",
        "--html",
        "report.html",
        "--force",
    ];

    // A rigid robot has no friction, so that some free estimates are negative.
    let message = refused(folder, &[&fit[..], &["--free"]].concat());
    assert!(message.contains("leave out --free"), "{message}");

    for (what, bad, expected) in [
        (
            "newer",
            model.replace("format = 1", "format = 2"),
            "reads up to format 1",
        ),
        (
            "unphysical prior",
            model.replacen(
                "name = \"coulomb\"",
                "name = \"coulomb\"\nprior = { mean = -0.2, std = 0.1 }",
                1,
            ),
            "the prior of coulomb:FR_hip",
        ),
        (
            "unknown effect",
            model.replacen("\"coulomb\"", "\"coulumb\"", 1),
            "did you mean `coulomb`?",
        ),
    ] {
        assert_ne!(bad, model, "{what}");
        fs::write(folder.join("model.toml"), bad).unwrap();
        let message = refused(folder, &fit);
        assert!(
            message.starts_with("error: model.toml"),
            "{what}: {message}"
        );
        assert!(message.contains(expected), "{what}: {message}");
    }
    fs::write(folder.join("model.toml"), &model).unwrap();

    let lines: Vec<&str> = log.lines().collect();
    // A leg at rest, its torque one quantum to and fro, so that no sample repeats the one before.
    let first: Vec<&str> = lines[1].split(',').collect();
    let row = |k: i32| {
        let (t, tau) = (0.002 * f64::from(k), 0.02474 * f64::from(k % 2));
        format!("{t:.3},{},0,0,0,{tau},{tau},{tau}\n", first[1..4].join(","))
    };
    let still: String = (0..3000).map(row).collect();
    fs::write(folder.join("log.csv"), format!("{}\n{still}", lines[0])).unwrap();
    for command in [
        &fit[..],
        &[
            "compare",
            "log.csv",
            "-m",
            "model.toml",
            "--html",
            "report.html",
            "--force",
        ],
        &["diagnose", "log.csv", "-m", "model.toml", "--apply"],
    ] {
        let message = refused(folder, command);
        assert!(
            message.starts_with("error: log.csv: no joint moves\n"),
            "{message}"
        );
    }
    // Beside one that moves it is named too.
    fs::write(folder.join("good.csv"), log).unwrap();
    let message = refused(
        folder,
        &["identify", "good.csv", "log.csv", "-m", "model.toml"],
    );
    assert!(
        message.starts_with("error: log.csv: no joint moves\n"),
        "{message}"
    );
}

/// A model of a robot that cannot be: its URDF is named, with the place.
#[test]
fn a_bad_urdf_under_a_model_is_named() {
    let folder = simulated("--legs FR --duration 4");
    let folder = folder.path();
    let oracle = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/go2.urdf");
    let urdf = fs::read_to_string(oracle).unwrap();
    fs::write(folder.join("go2.urdf"), &urdf).unwrap();
    let add = ["add", "coulomb", "-m", "model.toml", "--urdf", "go2.urdf"];
    done(folder, &add);
    fs::write(folder.join("out.toml"), "precious").unwrap();
    let fit = [
        "identify",
        "log.csv",
        "-m",
        "model.toml",
        "-o",
        "out.toml",
        "--force",
    ];
    // A rotor is fixed to the hip, whose mass would hide that the hip has none.
    let light = urdf.replace("<mass value=\"0.089\"/>", "<mass value=\"0\"/>");
    for (from, to, expected) in [
        (
            "type=\"revolute\"",
            "type=\"revolut\"",
            "did you mean `revolute`?",
        ),
        (
            "<child link=\"FL_calf\"",
            "<child link=\"FL_hip\"",
            "form a loop",
        ),
        (
            "<mass value=\"0.678\"",
            "<mass value=\"0\"",
            "link `FL_hip`, moved by joint `FL_hip_joint`, has no mass",
        ),
    ] {
        assert!(light.contains(from), "{from}");
        fs::write(folder.join("go2.urdf"), light.replacen(from, to, 1)).unwrap();
        let message = refused(folder, &fit);
        assert!(
            message.starts_with("error: model.toml, line 4: go2.urdf"),
            "{message}"
        );
        assert!(message.contains(expected), "{to}: {message}");
    }
}

/// One estimator: `identify` without a model is the model of what every drive has, to the last digit.
#[test]
fn without_a_model_the_plain_drive_is_fitted() {
    let folder = simulated("--legs FR,RL --typical --duration 8 --inertia-error 0.06");
    let folder = folder.path();
    add_typical(folder, "four.toml");
    let of = |more: &[&str]| done(folder, &[&["identify", "log.csv", "--json"], more].concat());
    let plain = of(&[]);
    assert_eq!(plain, of(&["-m", "four.toml"]));
    assert_eq!(plain, of(&["--physical"]));
    assert_eq!(json(&plain)["schema"], "proprio.identify/1");
    let truth = json(&fs::read_to_string(folder.join("log.truth.json")).unwrap());
    let plain = json(&plain);
    // What the least drive of the field needs: a few thousandths of its friction.
    for (effect, most) in [("coulomb", 0.001), ("viscous", 0.0006)] {
        let joints = plain["joints"].as_array().unwrap();
        let squares = joints.iter().map(|joint| {
            let name = format!("{effect}:{}", joint["joint"].as_str().unwrap());
            let [found, true_one] =
                [&plain, &truth].map(|of| number(parameter(of, &name), "value"));
            (found - true_one).powi(2)
        });
        let rms = (squares.sum::<f64>() / joints.len() as f64).sqrt();
        assert!(rms < most, "{effect}: {rms}");
    }
}

/// At its bound, or within two standard deviations of an effect that is absent, a value is not called identified.
#[test]
fn what_may_be_absent_is_not_identified() {
    let folder = simulated("--legs FR --duration 6 --hide viscous:FR_calf=0.05");
    let found = json(&done(folder.path(), &["identify", "log.csv", "--json"]));
    for estimate in found["parameters"].as_array().unwrap() {
        let name = estimate["name"].as_str().unwrap();
        let is_effect = TYPICAL.iter().any(|effect| name.starts_with(effect));
        let near = number(estimate, "value").abs() < 2.0 * number(estimate, "std");
        if is_effect && (near || estimate["at_bound"] == true) {
            assert_ne!(estimate["status"], "identified", "{estimate}");
        }
    }
    assert_eq!(parameter(&found, "viscous:FR_calf")["status"], "identified");
}

/// A spring's offset is a bias: a joint with both has one torque twice, and the fit says so and keeps one.
#[test]
fn one_torque_has_one_value() {
    let folder = simulated("--legs FR --typical --hide spring:FR_thigh=4 --duration 8");
    let run = |command: &str| proprio(folder.path(), &command.split(' ').collect::<Vec<_>>());
    run("add viscous coulomb armature bias spring:FR_thigh -m model.toml");
    let output = run("identify log.csv -m model.toml -o fitted.toml --json");
    let said = stderr(&output);
    assert!(
        said.contains("warning: bias:FR_thigh is the same torque as spring.c:FR_thigh"),
        "{said}"
    );
    let fitted = json(&stdout(&output));
    let names: Vec<&str> = fitted["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["name"].as_str().unwrap())
        .collect();
    assert!(names.contains(&"spring.c:FR_thigh") && names.contains(&"bias:FR_hip"));
    assert!(!names.contains(&"bias:FR_thigh"));
    let shown = json(&stdout(&run("show fitted.toml --json")));
    let effects = shown["effects"].as_array().unwrap();
    let at_thigh = |e: &&Value| e["joint"] == "FR_thigh" && e["effect"] == "bias";
    assert_eq!(effects.iter().filter(at_thigh).count(), 0);
    let compared = json(&stdout(&run(
        "compare log.csv -m fitted.toml --given --json",
    )));
    let [rms, fit] = [&compared["rms"], &fitted["rms"]].map(|x| x.as_f64().unwrap());
    assert!((rms / fit - 1.0).abs() < 0.05, "{rms} {fit}");
}
