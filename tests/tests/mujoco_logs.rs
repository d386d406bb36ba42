//! Logs that MuJoCo made (`tests/oracle/mujoco_logs.py`) through the identification: where the model can say what the leg
//! has, it says so; where it cannot, the error stays.

use std::path::{Path, PathBuf};

use proprio_host::identify::{FitOptions, Fitted, identify};
use proprio_tests::command::json;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/mujoco")
}

fn identified(name: &str) -> Fitted {
    let log = folder().join(format!("{name}.csv.gz"));
    let options = FitOptions::default();
    identify(&[log], None, options, |_, _| ()).unwrap().fitted
}

fn truth() -> serde_json::Value {
    json(&std::fs::read_to_string(folder().join("truth.json")).unwrap())
}

#[test]
fn friction_and_rotors_are_mujocos() {
    let truth = truth();
    for name in ["rigid", "coulomb", "armature", "viscous", "typical"] {
        let result = identified(name);
        for effect in ["viscous", "coulomb", "armature", "bias"] {
            for joint in ["FR_hip", "FR_thigh", "FR_calf"] {
                let parameter = format!("{effect}:{joint}");
                let estimate = result.parameter(&parameter).unwrap();
                let expected = truth["logs"][name]["parameters"][&parameter].as_f64();
                let error = estimate.value - expected.unwrap_or(0.0);
                let std = estimate.std;
                assert!(
                    error.abs() < 3.5 * std,
                    "{name}, {parameter}: off by {error}, std {std}"
                );
            }
        }
    }
}

#[test]
fn what_the_model_lacks_shows() {
    let truth = truth();
    let rms = identified("typical").rms;
    assert!(identified("spring").rms > 1.5 * rms);
    assert!(identified("payload").rms > 1.1 * rms);
    // A gain of the torque hides in the other parameters, every one of which is then wrong by it.
    let gain = truth["logs"]["torque_gain"]["parameters"]["torque_gain:FR_calf"]
        .as_f64()
        .unwrap();
    let armature = identified("torque_gain")
        .parameter("armature:FR_calf")
        .unwrap()
        .value;
    assert!((armature * gain / 0.018 - 1.0).abs() < 0.05, "{armature}");
}
