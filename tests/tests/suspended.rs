//! A Go2 that hangs on a strap (`tests/oracle/mujoco_suspended.py`): its trunk recoils, which looks like less armature at its hips.

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, folder, json};
use serde_json::Value;

const HIPS: [&str; 4] = ["FR_hip", "FL_hip", "RR_hip", "RL_hip"];

fn parameter(identified: &Value, name: &str) -> [f64; 2] {
    let all = identified["parameters"].as_array().unwrap();
    let own = all.iter().find(|p| p["name"] == name);
    let own = own.unwrap_or_else(|| panic!("{name}"));
    ["value", "std"].map(|key| own[key].as_f64().unwrap())
}

/// The state of the base in a model file is the effect, and the effect is that state.
#[test]
fn a_suspended_base_has_the_effect_and_a_fixed_one_has_not() {
    let folder = folder();
    let folder = folder.path();
    let file = |text: &str| fs::write(folder.join("go2.toml"), text).unwrap();
    let mount = || {
        let text = fs::read_to_string(folder.join("go2.toml")).unwrap();
        let line = text.lines().find(|line| line.starts_with("mount = "));
        line.unwrap().to_owned()
    };
    for (given, written) in [
        ("pinned", "fixed"),
        ("fixed", "fixed"),
        ("suspended", "suspended"),
    ] {
        file(&format!(
            "format = 1\n[robot]\nbuiltin = \"go2\"\n[base]\nmount = \"{given}\"\n"
        ));
        done(folder, &["add", "bias:FR_hip", "-m", "go2.toml"]);
        assert_eq!(mount(), format!("mount = \"{written}\""));
    }
    done(folder, &["remove", "base_recoil", "-m", "go2.toml"]);
    assert_eq!(mount(), "mount = \"fixed\"");
}

/// With the effect each hip's armature is within two of its deviations of MuJoCo's, and without it all are too small.
#[test]
fn the_hips_armature_of_a_robot_on_a_strap() {
    let oracle = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/suspended");
    let truth = json(&fs::read_to_string(oracle.join("truth.json")).unwrap());
    let log = oracle.join("strap.csv.gz");
    let log = log.to_str().unwrap();
    let folder = folder();
    let folder = folder.path();
    let plain = ["add", "viscous", "coulomb", "armature", "bias", "-m"];
    done(folder, &[&plain[..], &["plain.toml"]].concat());
    done(
        folder,
        &[&plain[..], &["with.toml", "base_recoil"]].concat(),
    );
    let identified = |model: &str| json(&done(folder, &["identify", log, "-m", model, "--json"]));
    let [without, with] = ["plain.toml", "with.toml"].map(identified);
    let [share, std] = parameter(&with, "base_recoil:base");
    // The strap bounces well below most of the motion: a base that is nearly free.
    assert!((share - 1.0).abs() < 0.1 && std < 0.05, "{share} ±{std}");
    for hip in HIPS {
        let name = format!("armature:{hip}");
        let truth = truth[&name].as_f64().unwrap();
        let [[less, _], [value, std]] = [&without, &with].map(|fit| parameter(fit, &name));
        assert!((value - truth).abs() < 2.0 * std, "{name}: {value} ±{std}");
        assert!(std < 0.2 * truth, "{name}: ±{std}");
        assert!(less < 0.8 * truth, "{name}: {less}");
    }
    let error = |fit: &Value| fit["error"]["after"].as_f64().unwrap();
    assert!(
        error(&with) < 0.5 * error(&without),
        "{} {}",
        error(&with),
        error(&without)
    );
}
