//! A KUKA KR300 (Weigand 2022): a robot a hundred times a Go2's size, of which nothing but the URDF is known.

use std::path::Path;

use proprio_tests::command::{done, folder, json, recorded_logs, steps};
use serde_json::Value;

/// What `identify` writes of these logs, as JSON.
fn identified(folder: &Path, logs: &[&str]) -> Value {
    let options = ["-m", "m.toml", "-o", "fitted.toml", "--force", "--json"];
    json(&done(folder, &[&["identify"], logs, &options].concat()))
}

/// A parameter's value, its standard deviation, and how much of that is not a difference between stretches of the log.
fn parameter(told: &Value, name: &str) -> [f64; 3] {
    let all = told["parameters"].as_array().unwrap();
    let own = all.iter().find(|p| p["name"] == name).unwrap();
    let [value, std, between] =
        ["value", "std", "std_between"].map(|key| own[key].as_f64().unwrap());
    [value, std, (std * std - between * between).sqrt()]
}

/// The hydraulic counterbalance of the second axis, which the URDF does not know, is named from the defaults, and more than half of the
/// error goes with it. The rotors of the wrist, several times what it carries, are told alike by each log.
#[test]
fn a_counterbalance_is_named_and_a_wrists_rotors_are_told() {
    let Some(logs) = recorded_logs() else { return };
    let file = |name: &str| logs.join("kuka_kr300").join(name).display().to_string();
    let [urdf, a, b] = ["kr300.urdf", "kuka_A.csv", "kuka_B.csv"].map(file);
    let folder = folder();
    let folder = folder.path();
    let plain = ["viscous", "coulomb", "armature", "bias"];
    done(
        folder,
        &[&["add", "-m", "m.toml", "--urdf", &urdf][..], &plain].concat(),
    );
    let told = json(&done(
        folder,
        &["diagnose", &a, &b, "-m", "m.toml", "--json"],
    ));
    let first = &steps(&told)[0];
    assert_eq!(
        (&first["effect"], &first["joints"][0]),
        (&"spring".into(), &"A2".into())
    );
    let [before, after] = [&told["held_out_rms"], &first["error"]].map(|x| x.as_f64().unwrap());
    assert!(after < 0.45 * before, "{before} N m, {after} N m with it");

    let [a, b] = [a, b].map(|log| identified(folder, &[&log]));
    for joint in ["A4", "A6"] {
        let name = format!("armature:{joint}");
        let [[a, a_std, a_noise], [b, b_std, b_noise]] =
            [&a, &b].map(|told| parameter(told, &name));
        assert!(
            (a - b).abs() < 3.0 * a_noise.hypot(b_noise),
            "{name}: {a} ±{a_std}, {b} ±{b_std}"
        );
        // Of A4 one log, of A6 the other has values that differ from stretch to stretch, and says so in its ±; the other log knows it well.
        assert!((a / a_std).max(b / b_std) > 5.0, "{name}");
        assert!(a > 4.0 * a_noise && b > 4.0 * b_noise, "{name}");
    }
}
