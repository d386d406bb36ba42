//! What is missing from the model of a robot that walks: `diagnose`, and the page of `compare`.

use std::fs;
use std::path::Path;

use proprio_host::compare::{ValuesFrom, compare_free_base};
use proprio_host::free_base::Reason;
use proprio_host::model::Model;
use proprio_tests::command::{
    done, folder as empty_folder, json, proprio, recorded_logs, stderr, steps,
};
use serde_json::Value;

use super::{com, log, number, text, truth};

/// The Go2 with all four effects at every joint but for one.
fn all_but(folder: &Path, missing: Option<&str>) {
    let add = [
        "add", "viscous", "coulomb", "armature", "bias", "-m", "go2.toml",
    ];
    done(folder, &add);
    if let Some(missing) = missing {
        done(folder, &["remove", missing, "-m", "go2.toml"]);
    }
}

fn diagnosed(folder: &Path, name: &str) -> Value {
    let log = log(name).display().to_string();
    json(&done(
        folder,
        &["diagnose", "--free-base", &log, "-m", "go2.toml", "--json"],
    ))
}

/// Two kilograms on the trunk of a robot that was identified without them: named alone, mass within 3 %, place within 1 cm, and known so well, for
/// both walks weigh the whole robot; and with them in the file the error is what is left. Of 30 s, as is asked.
#[test]
fn a_load_on_the_trunk_is_named_and_its_model_predicts() {
    let folder = empty_folder();
    let [without, with] = ["trot_30s", "load_30s"].map(|name| log(name).display().to_string());
    let file = ["-m", "go2.toml"];
    done(
        folder.path(),
        &[
            "identify",
            "--free-base",
            "--physical",
            &without,
            "-o",
            "go2.toml",
        ],
    );
    let compared = |model: &str| {
        let of = ["compare", "--free-base", "--json", &with, "-m", model];
        number(&json(&done(folder.path(), &of))["rms"])
    };
    let before = compared("go2.toml");
    let found = diagnosed(folder.path(), "load_30s");
    assert_eq!(found["verdict"], "missing");
    let path = &steps(&found);
    assert_eq!(path.len(), 1, "{path:?}");
    assert_eq!(
        (&path[0]["effect"], &path[0]["joints"][0]),
        (&"payload".into(), &"base".into())
    );
    let load = &found["candidates"][0];
    let truth = truth("load_30s")["load"].clone();
    for (n, near) in [0.06, 0.01, 0.01, 0.01].into_iter().enumerate() {
        let parameter = &load["parameters"][n];
        let (value, std) = (number(&parameter["value"]), number(&parameter["std"]));
        let error = (value - number(&truth[n])).abs();
        assert!(
            error < near && error < 2.0 * std && std < near,
            "{parameter} {}",
            truth[n]
        );
    }
    let screen = done(
        folder.path(),
        &[&["diagnose", "--free-base", "--apply", &with], &file[..]].concat(),
    );
    assert!(screen.contains("Missing: payload (base)"), "{screen}");
    assert!(
        screen.contains("Next: proprio compare --free-base"),
        "{screen}"
    );
    let after = compared("go2.toml");
    println!("{before} → {after} N m");
    assert!(after < 0.2 * before && after < 0.04);
}

/// Coulomb friction that one calf has and the model does not: named alone, its value within two standard deviations.
#[test]
fn friction_that_is_hidden_in_one_calf_is_named() {
    let folder = empty_folder();
    all_but(folder.path(), Some("coulomb:RL_calf"));
    let found = diagnosed(folder.path(), "trot");
    let path = &steps(&found);
    assert_eq!(path.len(), 1, "{path:?}");
    let best = &found["candidates"][0];
    assert_eq!(
        (&best["effect"], &best["joints"][0]),
        (&"coulomb".into(), &"RL_calf".into())
    );
    let error = number(&best["value"]) - number(&truth("trot")["effects"]["coulomb:RL_calf"]);
    assert!(error.abs() < 2.0 * number(&best["std"]), "{best}");
    assert!(number(&path[0]["error"]) < 0.75 * number(&found["held_out_rms"]));
}

/// Whatever their masses, of robots with four effects everywhere nothing is missing.
#[test]
fn of_a_complete_walking_robot_nothing_is_missing() {
    let folder = empty_folder();
    all_but(folder.path(), None);
    for name in ["trot", "flying", "sway"] {
        let found = diagnosed(folder.path(), name);
        assert_eq!(found["verdict"], "complete", "{name}: {found}");
        assert_eq!(found["outside_catalogue"].as_array().unwrap().len(), 0);
        // The error that is told is the one that `compare` fits and predicts, of rows that have other columns beside the model's.
        let log = log(name).display().to_string();
        let of = ["compare", "--free-base", "--json", &log, "-m", "go2.toml"];
        let compared = json(&done(folder.path(), &of));
        let [told, fitted] = [&found["held_out_rms"], &compared["rms"]].map(number);
        assert!((told / fitted - 1.0).abs() < 1e-9, "{told} {fitted}");
        assert_eq!(compared["fitted"], true);
    }
}

/// A log of 100 Hz, and one whose IMU is turned by 90° about the vertical: the mass within 1 %, turned within three standard deviations too, what is so is
/// said, and no load is missing.
#[test]
fn a_slow_log_and_an_imu_that_is_turned_carry_no_load() {
    let folder = empty_folder();
    all_but(folder.path(), None);
    let log = text("trot_30s");
    let (head, rows) = log.split_once('\n').unwrap();
    let at = |name: &str| head.split(',').position(|own| own == name).unwrap();
    let pairs = ["gyro", "acc"].map(|of| ["x", "y"].map(|axis| at(&format!("{of}/{axis}"))));
    let turned = |row: &str| {
        let mut cells: Vec<f64> = row.split(',').map(|x| x.parse().unwrap()).collect();
        for [x, y] in pairs {
            (cells[x], cells[y]) = (cells[y], -cells[x]);
        }
        cells
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(",")
    };
    let slow: Vec<String> = rows.lines().step_by(5).map(str::to_owned).collect();
    let logs = [
        ("slow", slow, "100 samples a second", f64::INFINITY),
        (
            "turned",
            rows.lines().map(turned).collect(),
            "the IMU's turn",
            3.0,
        ),
    ];
    let mass = number(&truth("trot_30s")["mass"]);
    for (name, rows, said, most) in logs {
        let path = folder.path().join(format!("{name}.csv"));
        fs::write(&path, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
        let log = path.display().to_string();
        let of = ["identify", "--free-base", "--physical", &log, "--json"];
        let found = json(&done(folder.path(), &of));
        let total = &found["quantities"][0];
        let off = number(&total["value"]) - mass;
        println!("{name}: {total}, off by {off:.3} kg");
        assert!(off.abs() < 0.01 * mass && off.abs() < most * number(&total["std"]));
        assert!(found["warnings"].to_string().contains(said), "{found}");
        let of = ["diagnose", "--free-base", &log, "-m", "go2.toml", "--json"];
        let found = json(&done(folder.path(), &of));
        assert_eq!(found["verdict"], "complete", "{name}: {}", found["path"]);
    }
}

/// What has moved since the file was written is named with both values, whatever the fit makes of the rest.
#[test]
fn a_value_that_has_changed_is_named() {
    let folder = empty_folder();
    let run = |arguments: &str| done(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    let walk = "simulate --walk trot --typical --inertia-error 0.03 --seed 7";
    run(&format!("{walk} -o monday.csv"));
    run("identify --free-base --physical monday.csv -o monday.toml");
    run(&format!(
        "{walk} --hide coulomb:RR_thigh=0.62 -o tuesday.csv"
    ));
    let screen = run("diagnose --free-base tuesday.csv -m monday.toml");
    assert!(
        screen.starts_with("Missing: nothing. Changed: 1 value of the file."),
        "{screen}"
    );
    let said = json(&run(
        "diagnose --free-base tuesday.csv -m monday.toml --json",
    ));
    let changed = said["moved"].as_array().unwrap();
    assert_eq!(changed.len(), 1, "{changed:?}");
    assert_eq!(changed[0]["name"], "coulomb:RR_thigh");
    let error = number(&changed[0]["now"]) - 0.62;
    assert!(
        error.abs() < 3.0 * number(&changed[0]["std"]),
        "{changed:?}"
    );
    assert!(
        number(&said["given_rms"]) > 5.0 * number(&said["held_out_rms"]),
        "{said}"
    );
}

/// Effects beyond the four of every drive, hidden one at a time from a robot whose drives are known: each is named first, alone, with its value.
#[test]
fn effects_of_the_whole_catalogue_are_named() {
    let folder = empty_folder();
    all_but(folder.path(), None);
    let walks = |hidden: &str| {
        let of = [
            "simulate",
            "--walk",
            "trot",
            "--typical",
            "--inertia-error",
            "0.03",
        ];
        done(
            folder.path(),
            &[&of[..], &["--hide", hidden, "-o", "walk.csv"]].concat(),
        );
    };
    let found = || {
        let of = [
            "diagnose",
            "--free-base",
            "walk.csv",
            "-m",
            "go2.toml",
            "--json",
        ];
        json(&done(folder.path(), &of))
    };
    for (effect, joint, value) in [
        ("torque_gain", "RR_calf", 1.08),
        ("spring", "FL_thigh", 4.0),
        ("quadratic_drag", "FR_calf", 0.03),
        ("encoder_offset", "FL_calf", 0.03),
    ] {
        walks(&format!("{effect}:{joint}={value}"));
        let found = found();
        let path = &steps(&found);
        let steps: Vec<_> = path
            .iter()
            .map(|step| (&step["effect"], &step["joints"]))
            .collect();
        assert_eq!(path.len(), 1, "{effect}: {steps:?}");
        let best = &found["candidates"][0];
        assert_eq!(
            (&best["effect"], &best["joints"][0]),
            (&effect.into(), &joint.into())
        );
        let off = (number(&best["value"]) - value) / number(&best["std"]);
        println!("{effect}: {} ± {}", best["value"], best["std"]);
        assert!(off.abs() < 3.0, "{best}");
    }
}

/// From the CAD alone: what every drive has is completed before one joint's effect is sought, so that offsets of all joints are no springs of all
/// joints; and a load that the CAD's uncertainty half covers is a body that is not the CAD's.
#[test]
fn what_one_joint_hides_is_found_from_the_cad_alone() {
    let folder = empty_folder();
    let found = |hidden: &str| {
        let walk = "simulate --walk trot --typical --inertia-error 0.03 --duration 20 --seed 41 -o walk.csv --hide";
        let words: Vec<&str> = walk.split(' ').chain([hidden]).collect();
        done(folder.path(), &words);
        let said = json(&done(
            folder.path(),
            &["diagnose", "--free-base", "walk.csv", "--json"],
        ));
        let drive = ["viscous", "coulomb", "armature", "bias"];
        let named = steps(&said).into_iter().filter(|step| {
            let effect = step["effect"].as_str().unwrap();
            !drive.contains(&effect)
        });
        let named: Vec<String> = named
            .map(|step| format!("{} {}", step["effect"], step["joints"]))
            .collect();
        let bodies = said["bodies"].as_array().into_iter().flatten();
        let bodies: Vec<String> = bodies
            .map(|body| body.as_str().unwrap().to_owned())
            .collect();
        (named, bodies)
    };
    let (named, bodies) = found("spring:FR_calf=4");
    assert_eq!(named, [r#""spring" ["FR_calf"]"#], "{bodies:?}");
    assert!(bodies.is_empty(), "{bodies:?}");
    let (named, bodies) = found("payload:FL_thigh=0.4");
    assert!(named.is_empty(), "{named:?}");
    assert!(
        matches!(&bodies[..], [one] if one.starts_with("FL_thigh: mass 1.")),
        "{bodies:?}"
    );
}

/// The page shows when each foot was taken to carry a force and why, in as many seconds as the shares say, and each joint's torque.
#[test]
fn a_page_shows_the_feet_and_the_torques() {
    let folder = empty_folder();
    let log = log("trot").display().to_string();
    done(
        folder.path(),
        &["compare", "--free-base", &log, "--html", "walk.html"],
    );
    let page = fs::read_to_string(folder.path().join("walk.html")).unwrap();
    for words in [
        "Feet on the ground",
        "close in time to one of these",
        "RL_calf",
    ] {
        assert!(page.contains(words), "{words}");
    }
    let told = compare_free_base(
        &[log.into()],
        &Model::default(),
        ValuesFrom::Given,
        |_, _| (),
    );
    let told = told.unwrap();
    let end = told.feet.iter().map(|own| own.time[1]).fold(0.0, f64::max);
    let seconds = |leg: usize, reason: Reason| {
        let own = told
            .feet
            .iter()
            .filter(|own| own.leg == leg && own.reason == reason);
        own.map(|own| own.time[1] - own.time[0]).sum::<f64>()
    };
    for leg in 0..4 {
        for (reason, share) in [
            (Reason::Torque, told.stance[0].torque[leg]),
            (Reason::Air, told.stance[0].air[leg]),
        ] {
            assert!(
                (seconds(leg, reason) / end - share).abs() < 0.03,
                "{leg} {reason:?}"
            );
        }
    }
    // Every window has an equation of the base, and at least one joint's.
    let series = &told.comparison.series;
    assert!(series.iter().map(|own| own.t.len()).sum::<usize>() > told.windows.used as usize);
    for own in series {
        assert_eq!([own.tau.len(), own.predicted.len()], [own.t.len(); 2]);
    }
}

/// What was identified and what is missing have pages too: values, the way down, and the feet.
#[test]
fn identify_and_diagnose_write_pages_of_a_walk() {
    let folder = empty_folder();
    let log = log("load").display().to_string();
    let page = |command: &[&str]| {
        let of = [command, &["--free-base", &log, "--html", "walk.html"]].concat();
        done(folder.path(), &of);
        fs::read_to_string(folder.path().join("walk.html")).unwrap()
    };
    let identified = page(&["identify", "--physical"]);
    for words in [
        "total_mass: 18.",
        "(CAD 16.",
        "acc_scale:imu",
        "Feet on the ground",
    ] {
        assert!(identified.contains(words), "{words}");
    }
    let diagnosed = page(&["diagnose"]);
    for words in ["payload, base", "the model as given", "Feet on the ground"] {
        assert!(diagnosed.contains(words), "{words}");
    }
}

/// From the CAD alone: armature, Coulomb and viscous friction at all joints, and the load where there is one, down to the noise.
#[test]
fn the_way_from_the_cad_ends_at_the_noise() {
    for (name, loaded) in [("trot", false), ("load", true)] {
        let folder = empty_folder();
        let log = log(name).display().to_string();
        let found = json(&done(
            folder.path(),
            &["diagnose", "--free-base", "--json", &log],
        ));
        let path = &steps(&found);
        let last = number(&path[path.len() - 1]["error"]);
        assert!(
            last < 0.06 * number(&found["held_out_rms"]) && last < 0.04,
            "{path:?}"
        );
        let has = |effect: &str| path.iter().any(|step| step["effect"] == effect);
        assert!(
            has("armature") && has("coulomb") && has("viscous"),
            "{path:?}"
        );
        assert_eq!(has("payload"), loaded, "{path:?}");
        // Offsets may come with the rest of a drive, where they neither help nor harm by more than a hundredth of the error.
        if let Some(n) = path.iter().position(|step| step["effect"] == "bias") {
            let [before, after] = [n - 1, n].map(|n| number(&path[n]["error"]));
            assert!((after / before - 1.0).abs() < 0.01, "{path:?}");
        }
    }
}

/// A real walk at 50 Hz: friction and rotors of the calves take error away on time that the fit has not seen, and what is left is
/// not said to be noise.
#[test]
fn of_a_real_walk_what_is_missing_is_told_and_that_it_is_not_all() {
    let Some(logs) = recorded_logs() else { return };
    let log = logs
        .join("go2_walk_imu_standard-replay-position.csv")
        .display()
        .to_string();
    let found = json(&done(
        empty_folder().path(),
        &["diagnose", "--free-base", "--json", &log],
    ));
    let path = &steps(&found);
    assert!(
        path[0]["effect"] == "armature" && path[1]["effect"] == "coulomb",
        "{path:?}"
    );
    let last = number(&path[path.len() - 1]["error"]);
    assert!(last < 0.85 * number(&found["held_out_rms"]));
    let told = done(empty_folder().path(), &["diagnose", "--free-base", &log]);
    let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
    let is_all = "without a noise floor more may be missing";
    let is_outside = !found["outside_catalogue"].as_array().unwrap().is_empty();
    assert!(is_outside || told.contains(is_all), "{told}");
}

#[test]
fn a_model_that_walks_are_not_judged_with_is_refused() {
    let folder = empty_folder();
    let log = log("trot").display().to_string();
    done(
        folder.path(),
        &["add", "backlash:FR_calf", "-m", "go2.toml"],
    );
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/arm.urdf");
    let urdf = urdf.display().to_string();
    done(
        folder.path(),
        &["add", "coulomb", "-m", "arm.toml", "--urdf", &urdf],
    );
    for command in ["diagnose", "compare"] {
        for (model, words) in [
            ("go2.toml", "`proprio remove backlash:FR_calf`"),
            ("arm.toml", "no foot of arm is known"),
        ] {
            let output = proprio(folder.path(), &[command, "--free-base", &log, "-m", model]);
            assert_eq!(output.status.code(), Some(1));
            assert!(stderr(&output).contains(words), "{}", stderr(&output));
        }
    }
}

/// On ground where feet slide for most of the time that they carry a force, the masses and friction hold and nothing is said to be missing or
/// unseen: a force at the contact point is projected out whatever the foot's velocity.
#[test]
fn feet_that_slide_move_no_mass_and_are_taken_for_nothing_else() {
    let (folder, truth) = (empty_folder(), truth("slip"));
    assert!(number(&truth["slip"]["share"]) > 0.5, "{}", truth["slip"]);
    let slides = log("slip").display().to_string();
    let of = ["identify", "--free-base", "--physical", "--json", &slides];
    let found = json(&done(folder.path(), &of));
    let named = |list: &str, name: &str| -> Value {
        let all = found[list].as_array().unwrap();
        all.iter().find(|one| one["name"] == name).unwrap().clone()
    };
    let off = |told: &Value, truth: f64| (number(&told["value"]) - truth) / number(&told["std"]);
    let (total, mass) = (named("quantities", "total_mass"), number(&truth["mass"]));
    let error = number(&total["value"]) / mass - 1.0;
    assert!(
        error.abs() < 0.01 && off(&total, mass).abs() < 3.0,
        "{total} {mass}"
    );
    for (axis, truth) in com(&truth).into_iter().enumerate() {
        let told = named(
            "quantities",
            ["trunk_com_x", "trunk_com_y", "trunk_com_z"][axis],
        );
        let error = number(&told["value"]) - truth;
        assert!(
            error.abs() < 8e-3 && off(&told, truth).abs() < 3.0,
            "{told} {truth}"
        );
    }
    let mut worst: f64 = 0.0;
    for (name, truth) in truth["effects"].as_object().unwrap() {
        worst = worst.max(off(&named("parameters", name), number(truth)).abs());
    }
    println!(
        "mass off by {:.2} %, a friction by {worst:.1} std at most",
        100.0 * error
    );
    // Of 36 the largest is beyond 4 standard deviations once in four hundred robots.
    assert!(worst < 4.0, "{worst}");
    assert_eq!(found["unseen_feet"].as_array().unwrap().len(), 0, "{found}");

    all_but(folder.path(), None);
    let found = diagnosed(folder.path(), "slip");
    assert_eq!(found["verdict"], "complete", "{found}");
    assert_eq!(found["outside_catalogue"].as_array().unwrap().len(), 0);
}
