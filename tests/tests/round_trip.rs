//! The file is the model: what `identify -o` writes predicts what the fit left, effect by effect, at every joint of a leg.

use proprio_tests::command::{done, folder, json};
use serde_json::Value;

/// Values that a simulated leg is given, one for each effect of the catalogue but `contact`, which is not predicted: `compare` leaves out the
/// time in which it finds a foot on the ground.
const HIDDEN: [(&str, &str); 31] = [
    ("viscous", "0.3"),
    ("coulomb", "0.6"),
    ("armature", "0.01"),
    ("bias", "0.5"),
    ("asymmetric_coulomb", "0.5"),
    ("asymmetric_viscous", "0.05"),
    ("stribeck", "0.3"),
    ("presliding", "0.3,zs=0.01"),
    ("load_friction", "0.1"),
    ("quadratic_drag", "0.1"),
    ("saturating_viscous", "0.5,vs=1.5"),
    ("thermal_viscous", "0.01"),
    ("coupled_armature", "0.004"),
    ("coupled_viscous", "0.05"),
    ("coupled_coulomb", "0.2"),
    ("spring", "4"),
    ("cogging", "0.4"),
    ("torque_gain", "1.2"),
    ("velocity_gain", "1.05"),
    ("encoder_offset", "0.05"),
    ("eccentricity", "0.05,c=0.02"),
    ("delay", "0.004"),
    ("current_lag", "0.004"),
    ("base_tilt", "0.05"),
    ("base_recoil", "0.5"),
    ("payload", "0.4"),
    ("elasticity", "300"),
    ("elastic_hysteresis", "100,f=0.3"),
    ("backlash", "0.01"),
    ("saturation", "6"),
    ("dead_band", "0.4"),
];

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key}: {value}"))
}

/// By how much the error of the file as written differs from that of the fit, N m.
fn difference(effect: &str, value: &str) -> f64 {
    let folder = folder();
    let folder = folder.path();
    let place = match effect {
        "base_tilt" | "base_recoil" => String::new(),
        _ => ":FR_thigh".to_owned(),
    };
    // Friction inside a spring is simulated with it, and a second encoder tells both.
    let inside = effect == "elastic_hysteresis";
    let hidden = if inside { "elasticity" } else { effect };
    let hide = format!("{hidden}{place}={value}");
    let simulate = ["simulate", "--legs", "FR", "--typical", "--duration", "8"];
    let encoder: &[&str] = if inside { &["--second-encoder"] } else { &[] };
    done(
        folder,
        &[&simulate[..], &["-o", "log.csv", "--hide", &hide], encoder].concat(),
    );
    let add = [
        "add",
        "-m",
        "model.toml",
        "viscous",
        "coulomb",
        "armature",
        "bias",
    ];
    done(folder, &[&add[..], &[hidden, effect]].concat());
    let fit = [
        "identify",
        "log.csv",
        "-m",
        "model.toml",
        "-o",
        "fit.toml",
        "--json",
    ];
    let fitted = json(&done(folder, &fit));
    let given = ["compare", "log.csv", "-m", "fit.toml", "--given", "--json"];
    let written = json(&done(folder, &given));
    (number(&fitted, "rms") - number(&written, "rms")).abs()
}

#[test]
fn what_is_written_is_what_was_fitted() {
    let catalogue = json(&done(folder().path(), &["effects", "--json"]));
    let names: Vec<&str> = (catalogue["effects"].as_array().unwrap().iter())
        .map(|effect| effect["name"].as_str().unwrap())
        .filter(|name| *name != "contact")
        .collect();
    assert_eq!(names.len(), HIDDEN.len());
    for name in names {
        let (_, value) = HIDDEN.iter().find(|(hidden, _)| *hidden == name).unwrap();
        let difference = difference(name, value);
        assert!(difference <= 1e-9, "{name}: {difference} N m");
    }
}
