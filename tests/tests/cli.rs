//! The command line as its user meets it: the real binary, its texts, its files, its exit status.

use std::fs;
use std::path::Path;

use proprio_tests::command::{
    done, folder, json, parameter, proprio, recorded_logs, simulated, stderr, stdout,
};

#[test]
fn help_tells_each_command_with_an_example() {
    let folder = folder();
    let mut texts = String::new();
    for command in [
        &["--help"][..],
        &["add", "--help"],
        &["compare", "--help"],
        &["completions", "--help"],
        &["demo", "--help"],
        &["diagnose", "--help"],
        &["capture", "--help"],
        &["effects", "--help"],
        &["export", "--help"],
        &["flash", "--help"],
        &["identify", "--help"],
        &["import", "--help"],
        &["man", "--help"],
        &["monitor", "--help"],
        &["ports", "--help"],
        &["record", "--help"],
        &["remove", "--help"],
        &["show", "--help"],
        &["simulate", "--help"],
        &["replay", "--help"],
        &["zero", "--help"],
    ] {
        let text = done(folder.path(), command);
        if command.len() > 1 {
            assert!(text.contains("Examples:\n  proprio "), "{text}");
        }
        texts += &format!("$ proprio {}\n{text}\n", command.join(" "));
    }
    insta::assert_snapshot!(texts);
}

#[test]
fn version_is_the_packages() {
    let folder = folder();
    assert_eq!(
        done(folder.path(), &["--version"]),
        format!("proprio {}\n", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn wrong_usage_has_status_2_and_says_what_would_be_right() {
    let folder = folder();
    let wrong: [&[&str]; 16] = [
        &["frobnicate"],
        &["identify"],
        &["identify", "log.csv", "--jsno"],
        &["replay", "log.csv"],
        &["replay", "log.csv", "--to", "qemu", "--leg", "FR"],
        &["simulate", "--legs", "FX"],
        &["simulate", "--hide", "coulom=0.3"],
        &["simulate", "--hide", "coulomb:FR_knee=0.3"],
        &["simulate", "--hide", "viscous=-1"],
        &["simulate", "--hide", "coulomb:FR_calf"],
        &["simulate", "--hide", "stribeck:FR_calf=0.3,vx=0.1"],
        &["simulate", "--hide", "stribeck:FR_calf=0.3,vs=0"],
        &["simulate", "--hide", "base_tilt:FR_hip=0.1"],
        &["simulate", "--hide", "contact:FR_hip=5"],
        &["simulate", "--duration", "soon"],
        &["simulate", "--legs", "FR", "--hide", "bias:RL_hip=1"],
    ];
    let mut texts = String::new();
    for arguments in wrong {
        let output = proprio(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(stdout(&output), "");
        texts += &format!("$ proprio {}\n{}\n", arguments.join(" "), stderr(&output));
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    insta::assert_snapshot!(texts);
}

/// What is no number, or beyond what the option can mean, is refused before any work.
#[test]
fn numbers_that_cannot_be_are_refused() {
    let folder = folder();
    let factors = "factors log.csv --robot one -o one.parquet";
    let options = [
        (factors, "--begin"),
        (factors, "--block"),
        ("capture sim -o FR.cap", "--seconds"),
        ("record sim -o log.csv", "--seconds"),
        ("monitor sim", "--seconds"),
        ("monitor sim", "--speed"),
        ("excite -o motion.csv", "--velocity-share"),
        ("excite -o motion.csv", "--torque-share"),
        ("excite -o motion.csv", "--duration"),
        ("excite -o motion.csv", "--kp"),
        ("simulate -o log.csv", "--noise"),
        ("simulate -o log.csv", "--rate"),
    ];
    for (command, option) in options {
        for number in ["nan", "inf", "-inf", "-1", "1e300"] {
            let given = format!("{option}={number}");
            let words: Vec<&str> = command.split(' ').chain([given.as_str()]).collect();
            let output = proprio(folder.path(), &words);
            assert_eq!(output.status.code(), Some(2), "{words:?}");
            let said = stderr(&output);
            assert!(said.contains("must lie between"), "{words:?}: {said}");
        }
    }
    // Unix time in ms.
    let words: Vec<&str> = factors.split(' ').collect();
    let output = proprio(
        folder.path(),
        &[&words[..], &["--begin", "1790000000000"]].concat(),
    );
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_demo_finds_what_it_hid() {
    let folder = folder();
    let report = json(&done(folder.path(), &["demo", "--json"]));
    assert_eq!(report["passed"], true, "{report}");
    assert_eq!(report["found"], report["hidden"]["name"]);
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let off = number(&report["value"]) - number(&report["hidden"]["value"]);
    assert!(off.abs() < 3.0 * number(&report["std"]), "{report}");
    assert!(number(&report["error"]["after"]) < 0.2 * number(&report["error"]["before"]));

    // What it left is what its own commands take, and give the same.
    let made = folder.path().join("proprio-demo");
    let comparison = json(&done(
        &made,
        &["compare", "log.csv", "-m", "model.toml", "--json"],
    ));
    assert_eq!(comparison["rms"], report["error"]["after"]);
    // There the effect is left out of a model, here it was not yet in: sums in another order.
    let before = number(&comparison["before_rms"]) / number(&report["error"]["before"]);
    assert!((before - 1.0).abs() < 1e-12, "{before}");
    assert!(
        fs::read_to_string(made.join("report.html"))
            .unwrap()
            .contains("proprio demo")
    );
    let text = done(folder.path(), &["demo"]);
    assert!(text.contains("✓ Hidden was"), "{text}");
    let tour = fs::read_to_string(made.join("tour.txt")).unwrap();
    assert!(tour.contains("✓ Hidden was"), "{tour}");
    assert!(tour.contains("$ proprio diagnose"), "{tour}");
}

#[test]
fn the_demo_overwrites_nothing_of_others() {
    let folder = folder();
    let theirs = folder.path().join("theirs");
    fs::create_dir(&theirs).unwrap();
    fs::write(theirs.join("log.csv"), "precious").unwrap();
    let output = proprio(folder.path(), &["demo", "-o", "theirs"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("hint: name another directory"));
    assert_eq!(fs::read_dir(&theirs).unwrap().count(), 1);
    assert_eq!(
        fs::read_to_string(theirs.join("log.csv")).unwrap(),
        "precious"
    );
}

#[test]
fn a_simulated_robot_is_identified() {
    let folder = folder();
    done(
        folder.path(),
        &[
            "simulate",
            "--typical",
            "--hide",
            "coulomb:RL_calf=1.1",
            "-o",
            "log.csv.gz",
        ],
    );
    let truth = json(&fs::read_to_string(folder.path().join("log.truth.json")).unwrap());
    let result = json(&done(folder.path(), &["identify", "log.csv.gz", "--json"]));
    assert_eq!(parameter(&truth, "coulomb:RL_calf")["value"], 1.1);

    let named = result["parameters"].as_array().unwrap();
    assert_eq!(named.len(), 4 * 42);
    let mut identified = 0;
    for estimate in named {
        let name = estimate["name"].as_str().unwrap();
        let number = |key: &str| {
            estimate[key]
                .as_f64()
                .unwrap_or_else(|| panic!("{name}: {key}"))
        };
        let error = number("value") - parameter(&truth, name)["value"].as_f64().unwrap();
        assert!(
            error.abs() < 4.0 * number("std"),
            "{name}: off by {error}, std {}",
            number("std")
        );
        assert!(number("std") <= number("prior_std") * 1.001, "{name}");
        identified += usize::from(estimate["status"] == "identified");
    }
    assert!(identified >= 48, "{identified} identified");
    let rms = |key: &str| result[key].as_f64().unwrap();
    // On unseen blocks the error grows by a share p/n, and an rms of n rows has a relative deviation of 1/√(2n): three of
    // that for the windows that the guards between blocks leave out. 3.3 % in all.
    let joints = result["joints"].as_array().unwrap().iter();
    let windows: f64 = joints.map(|joint| joint["windows"].as_f64().unwrap()).sum();
    let (p, n) = (named.len() as f64, windows);
    let ratio = rms("held_out_rms") / rms("rms");
    assert!(
        (ratio - 1.0).abs() < p / n + 3.0 / (2.0 * n).sqrt(),
        "{ratio}"
    );
    assert!(rms("held_out_rms") < 0.2 * rms("cad_rms"));
}

#[test]
fn every_hidden_parameter_is_in_the_truth() {
    let folder = folder();
    let arguments = "simulate --legs FR --duration 1 --inertia-error 0.06 --motion moves \
        --hide thermal_viscous:FR_thigh=0.005 --hide payload:FR_calf=0.2,z=-0.1 \
        --hide base_tilt=0.03,pitch=-0.02 --hide contact=5 -o log.csv";
    done(
        folder.path(),
        &arguments.split_whitespace().collect::<Vec<_>>(),
    );
    let truth = json(&fs::read_to_string(folder.path().join("log.truth.json")).unwrap());
    for (name, value) in [
        ("thermal_viscous:FR_thigh", 0.005),
        ("T0:thermal_viscous:FR_thigh", 40.0),
        ("payload:FR_calf", 0.2),
        ("z:payload:FR_calf", -0.1),
        ("base_tilt", 0.03),
        ("pitch:base_tilt", -0.02),
        ("contact:FR_calf", 5.0),
        ("coulomb:FR_calf", 0.0),
    ] {
        assert_eq!(parameter(&truth, name)["value"], value, "{name}");
    }
    let mass = parameter(&truth, "m:FR_thigh")["value"].as_f64().unwrap();
    assert!(mass != 1.241 && (mass / 1.241 - 1.0).abs() < 0.3, "{mass}");
    let log = fs::read_to_string(folder.path().join("log.csv")).unwrap();
    assert!(
        log.lines()
            .next()
            .unwrap()
            .ends_with("temp/FR_hip,temp/FR_thigh,temp/FR_calf")
    );
}

#[test]
fn a_rigid_robot_without_hidden_effects_shows_none() {
    let folder = simulated("--legs FL --noise 0 --unquantised");
    let free = ["identify", "log.csv", "--free", "--json"];
    let result = json(&done(folder.path(), &free));
    // There is no noise; what is left of an effect is what the prior pulls, mean × (std / prior's std)², and what the trapezoids of a window
    // lack. Largest of three seeds, in N m, N m s/rad, kg m² and N m: 7.4e-5, 3.3e-5, 5.6e-6 and 3.4e-4.
    for (effect, most) in [
        ("coulomb", 1.2e-4),
        ("viscous", 6e-5),
        ("armature", 1e-5),
        ("bias", 6e-4),
    ] {
        for joint in ["FL_hip", "FL_thigh", "FL_calf"] {
            let estimate = parameter(&result, &format!("{effect}:{joint}"));
            let number = |key: &str| estimate[key].as_f64().unwrap();
            let pull = number("prior") * (number("std") / number("prior_std")).powi(2);
            let off = number("value") - pull;
            assert!(off.abs() < most, "{effect} of {joint}: {off}");
        }
    }
}

#[test]
fn a_joint_that_does_not_move_is_said_to_be_unexcited() {
    let folder = folder();
    done(
        folder.path(),
        &[
            "simulate",
            "--legs",
            "FR",
            "-o",
            "moving.csv",
            "--duration",
            "4",
        ],
    );
    let moving = fs::read_to_string(folder.path().join("moving.csv")).unwrap();
    let mut lines = moving.lines();
    let mut still = lines.next().unwrap().to_owned() + "\n";
    let first: Vec<&str> = lines.next().unwrap().split(',').collect();
    for k in 0..2000 {
        // One torque quantum to and fro, so that no sample repeats the one before.
        let tau = f64::from(k % 2) * 0.02474;
        still += &format!(
            "{:.3},{},0,0,0,{tau},{tau},{tau}\n",
            f64::from(k) * 0.002,
            first[1..4].join(",")
        );
    }
    fs::write(folder.path().join("still.csv"), still).unwrap();
    // Where no joint moves there is nothing to fit.
    let output = proprio(folder.path(), &["identify", "still.csv"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("no joint moves"),
        "{}",
        stderr(&output)
    );
    // One joint of three stands still.
    let mut one = String::new();
    for (n, line) in moving.lines().enumerate() {
        let mut cells: Vec<&str> = line.split(',').collect();
        if n > 0 {
            (cells[1], cells[4]) = (first[1], "0");
        }
        one += &(cells.join(",") + "\n");
    }
    fs::write(folder.path().join("one.csv"), one).unwrap();
    let result = json(&done(folder.path(), &["identify", "one.csv", "--json"]));
    for effect in ["armature", "viscous"] {
        let of = |joint: &str| parameter(&result, &format!("{effect}:{joint}"))["status"].clone();
        assert_eq!(of("FR_hip"), "unexcited", "{effect}");
        assert_ne!(of("FR_calf"), "unexcited", "{effect}");
    }
}

#[test]
fn several_logs_are_one_data_set() {
    let folder = folder();
    for (log, legs, seed) in [("a.csv", "FR", "1"), ("b.csv", "FR,RL", "2")] {
        let arguments = [
            "simulate",
            "--typical",
            "--duration",
            "5",
            "--legs",
            legs,
            "--seed",
            seed,
            "-o",
            log,
        ];
        done(folder.path(), &arguments);
    }
    let std = |logs: &[&str]| {
        let result = json(&done(
            folder.path(),
            &[&["identify", "--json"], logs].concat(),
        ));
        parameter(&result, "coulomb:FR_calf")["std"]
            .as_f64()
            .unwrap()
    };
    let (a, both) = (std(&["a.csv"]), std(&["a.csv", "b.csv"]));
    assert!(both < 0.85 * a, "{both} against {a}");
    let text = done(folder.path(), &["identify", "a.csv", "b.csv", "--verbose"]);
    assert!(
        text.contains("RL_calf") && !text.contains("FL_calf"),
        "{text}"
    );
}

#[test]
fn hearing_the_log_over_the_bus_changes_less_than_its_error() {
    let folder = simulated("--typical --legs RR --unquantised");
    let [exact, heard] = [
        &["identify", "log.csv", "--json"][..],
        &["identify", "log.csv", "--json", "--bus"],
    ]
    .map(|arguments| json(&done(folder.path(), arguments)));
    let mut differ = false;
    for estimate in exact["parameters"].as_array().unwrap() {
        let name = estimate["name"].as_str().unwrap();
        let number =
            |file: &serde_json::Value, key: &str| parameter(file, name)[key].as_f64().unwrap();
        let [difference, error] = [
            number(&exact, "value") - number(&heard, "value"),
            // Rounding is noise of its own: each states its own error.
            number(&exact, "std").hypot(number(&heard, "std")),
        ];
        assert!(difference.abs() < error, "{name}: {difference}");
        differ |= difference != 0.0;
    }
    assert!(differ, "--bus has no effect");
}

#[test]
fn every_recorded_chirp_gives_all_joints() {
    let Some(logs) = recorded_logs() else { return };
    let mut seen = 0;
    for entry in fs::read_dir(&logs).unwrap() {
        let path = entry.unwrap().path();
        if !path
            .file_name()
            .unwrap()
            .to_string_lossy()
            .starts_with("go2_air_chirp_")
        {
            continue;
        }
        seen += 1;
        let path = path.to_str().unwrap();
        let result = json(&done(Path::new("."), &["identify", path, "--json"]));
        assert_eq!(result["joints"].as_array().unwrap().len(), 12);
        for joint in result["joints"].as_array().unwrap() {
            let name = joint["joint"].as_str().unwrap();
            for effect in ["coulomb", "viscous", "armature", "bias"] {
                let std = parameter(&result, &format!("{effect}:{name}"))["std"]
                    .as_f64()
                    .unwrap();
                assert!(std > 0.0 && std < 0.5, "{path}: {effect} of {name} ±{std}");
            }
            let rms = |key: &str| joint[key].as_f64().unwrap();
            assert!(rms("rms") < 0.8 * rms("cad_rms"), "{path}: {name}");
        }
        let text = done(Path::new("."), &["identify", path, "--verbose"]);
        assert!(text.contains("RL_calf"), "{text}");
    }
    assert!(seen > 0, "no chirp in {}", logs.display());
}
