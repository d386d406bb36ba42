//! Logs that MuJoCo made (`tests/oracle/mujoco_logs.py`) through the identification: where the model can say what the leg
//! has, it says so; where it cannot, the error stays.

use std::path::{Path, PathBuf};

use proprio_host::estimate::Constraint;
use proprio_host::identify::{FitOptions, Fitted, identify};
use proprio_tests::command::json;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/mujoco")
}

fn identified(name: &str) -> Fitted {
    identified_by(name, FitOptions::default().constraint)
}

fn identified_by(name: &str, constraint: Constraint) -> Fitted {
    let log = folder().join(format!("{name}.csv.gz"));
    let options = FitOptions {
        constraint,
        ..FitOptions::default()
    };
    identify(&[log], None, (options, &[]), |_, _| ())
        .unwrap()
        .fitted
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
    // A load on the calf is the calf's: its mass and its first moment, which the URDF does not have, are found and named.
    let payload = identified_by("payload", Constraint::Physical);
    let of_log = &truth["logs"]["payload"]["parameters"];
    let [load, z] = ["payload:FR_calf", "z:payload:FR_calf"].map(|k| of_log[k].as_f64().unwrap());
    for (parameter, more) in [("m:FR_calf", load), ("hz:FR_calf", load * z)] {
        let own = payload.parameter(parameter).unwrap();
        let error = own.value - (own.prior + more);
        assert!(
            error.abs() < 3.0 * own.std,
            "{parameter}: {error} ± {}",
            own.std
        );
    }
    let named = |of: &Fitted| of.warnings.iter().any(|w| w.starts_with("FR_calf: mass"));
    assert!(named(&payload), "{:?}", payload.warnings);
    assert!(!named(&identified_by("typical", Constraint::Physical)));
    // A gain of the torque hides in the other parameters: of the calf's inertia and its rotor's together only so much is found.
    let gain = truth["logs"]["torque_gain"]["parameters"]["torque_gain:FR_calf"]
        .as_f64()
        .unwrap();
    let found = identified("torque_gain");
    let [rotor, body] = ["armature:FR_calf", "Iyy:FR_calf"].map(|k| found.parameter(k).unwrap());
    let share = (rotor.value + body.value) * gain / (0.018 + body.prior);
    assert!((share - 1.0).abs() < 0.05, "{share}");
}
