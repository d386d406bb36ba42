//! The loop on logs of a real Go2 hung in the air: what is added for some logs must hold for the others.

use std::fs;

use proprio_tests::command::{done, folder, json, recorded_logs};
use serde_json::Value;

/// The errors of each log, N m.
fn errors(of: &Value) -> Vec<f64> {
    let logs = of["log_rms"].as_array().unwrap();
    logs.iter().map(|rms| rms.as_f64().unwrap()).collect()
}

/// Every step predicts each log better from the others, or as well, and calves have Coulomb friction and rotors.
#[test]
fn no_step_raises_the_error_on_another_log() {
    let Some(logs) = recorded_logs() else { return };
    let mut chirps: Vec<String> = fs::read_dir(&logs)
        .unwrap()
        .map(|entry| entry.unwrap().path().display().to_string())
        .filter(|path| path.contains("go2_air_chirp_"))
        .collect();
    chirps.sort();
    assert_eq!(chirps.len(), 5);
    let chirps: Vec<&str> = chirps.iter().map(String::as_str).collect();
    let told = json(&done(
        folder().path(),
        &[&["diagnose", "--json"], &chirps[..]].concat(),
    ));
    let path = told["path"].as_array().unwrap();
    let mut before = errors(&told);
    assert_eq!(before.len(), 5);
    for step in path {
        let after = errors(step);
        for (after, before) in after.iter().zip(&before) {
            // The squares of a limb may rise by a thousandth.
            assert!(*after <= 1.0005 * before, "{before}: {step}");
        }
        before = after;
    }
    let first = errors(&told);
    assert!(
        before
            .iter()
            .zip(&first)
            .all(|(last, first)| last < &(0.4 * first)),
        "{before:?}"
    );
    let added = |effects: &[&str], joint: &str| {
        path.iter().any(|step| {
            let joints = step["joints"].as_array().unwrap();
            effects.contains(&step["effect"].as_str().unwrap()) && joints.iter().any(|j| j == joint)
        })
    };
    for calf in ["FR_calf", "FL_calf", "RR_calf", "RL_calf"] {
        assert!(added(&["armature"], calf), "{calf}");
        assert!(added(&["coulomb", "asymmetric_coulomb"], calf), "{calf}");
    }
    for joint in ["FR_hip", "FR_thigh"] {
        assert!(added(&["velocity_gain"], joint), "{joint}");
    }
}

/// The hardest chirp alone: loads on the calves would swing as their rotors turn, and gain more here; rotors come first.
#[test]
fn one_log_asks_for_rotors_and_friction_before_loads() {
    let Some(logs) = recorded_logs() else { return };
    let chirp = logs.join("go2_air_chirp_9.0hz_p25d1.2.csv");
    let told = json(&done(
        folder().path(),
        &["diagnose", "--json", chirp.to_str().unwrap()],
    ));
    let path = told["path"].as_array().unwrap();
    let effects: Vec<&str> = path
        .iter()
        .map(|step| step["effect"].as_str().unwrap())
        .collect();
    assert_eq!(effects[..2], ["velocity_gain", "armature"]);
    let mut friction = effects[2..4].to_vec();
    friction.sort_unstable();
    assert_eq!(friction, ["coulomb", "viscous"]);
    assert_eq!(
        path[1]["joints"].as_array().unwrap().len(),
        4,
        "{}",
        path[1]
    );
    let rms = |of: &Value| of["held_out_rms"].as_f64().unwrap();
    assert!(rms(&path[1]) < 0.4 * rms(&told), "{}", path[1]);
}
