//! A KUKA KR300 (Weigand 2022): a robot a hundred times a Go2's size, of which nothing but the URDF is known.

use std::path::Path;

use proprio_tests::command::{done, folder, json, recorded_logs};
use serde_json::Value;

/// What `identify` writes of these logs, as JSON.
fn identified(folder: &Path, logs: &[&str]) -> Value {
    let options = ["-m", "m.toml", "-o", "fitted.toml", "--force", "--json"];
    json(&done(folder, &[&["identify"], logs, &options].concat()))
}

/// A parameter's value and its standard deviation.
fn parameter(told: &Value, name: &str) -> [f64; 2] {
    let all = told["parameters"].as_array().unwrap();
    let own = all.iter().find(|p| p["name"] == name).unwrap();
    ["value", "std"].map(|key| own[key].as_f64().unwrap())
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
    let first = &told["path"][0];
    assert_eq!(
        (&first["effect"], &first["joints"][0]),
        (&"spring".into(), &"A2".into())
    );
    let [before, after] = [&told, first].map(|of| of["held_out_rms"].as_f64().unwrap());
    assert!(after < 0.45 * before, "{before} N m, {after} N m with it");

    let [a, b] = [a, b].map(|log| identified(folder, &[&log]));
    for joint in ["A4", "A6"] {
        let name = format!("armature:{joint}");
        let [[a, a_std], [b, b_std]] = [&a, &b].map(|told| parameter(told, &name));
        assert!(
            (a - b).abs() < 3.0 * a_std.hypot(b_std),
            "{name}: {a} ±{a_std}, {b} ±{b_std}"
        );
        // Both logs together know it to more than seven standard deviations, each alone to more than four.
        assert!((a / a_std).hypot(b / b_std) > 7.0, "{name}");
        assert!(a > 4.0 * a_std && b > 4.0 * b_std, "{name}");
    }
}
