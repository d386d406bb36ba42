//! An arm with an elastic gear at one joint (`tests/oracle/elastic_arm.py`): the joint is named, and its stiffness with an error that holds.

use std::path::{Path, PathBuf};

use proprio_tests::command::{done, folder, json, proprio, stdout};
use serde_json::Value;

fn cases() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/elastic_arm")
}

/// What `diagnose` says of a case whose model has the drive's plain effects.
fn diagnosed(name: &str) -> Value {
    let folder = folder();
    let urdf = cases().join("../../robots/arm.urdf");
    let urdf = urdf.to_str().unwrap();
    let plain = [
        "add", "viscous", "coulomb", "armature", "bias", "-m", "arm.toml",
    ];
    done(folder.path(), &[&plain[..], &["--urdf", urdf]].concat());
    let log = cases().join(format!("{name}.csv.gz"));
    let log = log.to_str().unwrap();
    let output = proprio(
        folder.path(),
        &["diagnose", log, "-m", "arm.toml", "--json"],
    );
    json(&stdout(&output))
}

/// Effects that are in the model at the end and were not in the file.
fn added(diagnosis: &Value) -> Vec<(String, String)> {
    let mut there: Vec<(String, String)> = Vec::new();
    for step in diagnosis["path"].as_array().unwrap() {
        let effect = step["effect"].as_str().unwrap_or_default();
        for joint in step["joints"].as_array().into_iter().flatten() {
            let own = (effect.to_owned(), joint.as_str().unwrap().to_owned());
            match step["step"].as_str().unwrap() {
                "add" => there.push(own),
                "remove" => there.retain(|known| *known != own),
                _ => {}
            }
        }
    }
    there
}

#[test]
fn the_elastic_joint_of_an_arm_is_named() {
    let truth = json(&std::fs::read_to_string(cases().join("truth.json")).unwrap());
    for (name, of) in truth.as_object().unwrap() {
        let diagnosis = diagnosed(name);
        let added = added(&diagnosis);
        let Some(joint) = of["joint"].as_str() else {
            assert!(added.is_empty(), "{name}: {added:?}");
            continue;
        };
        let own = ("elasticity".to_owned(), joint.to_owned());
        assert_eq!(added, [own], "{name}");
        let path = diagnosis["path"].as_array().unwrap();
        let error = |step: &Value| step["error"].as_f64().unwrap();
        let refitted = path.iter().find(|step| step["step"] == "refitted").unwrap();
        let after = diagnosis["error"]["after"].as_f64().unwrap();
        assert!(after < 0.6 * error(refitted), "{name}: {after}");
    }
}

#[test]
fn the_stiffness_of_an_arm_is_within_its_error() {
    let truth = json(&std::fs::read_to_string(cases().join("truth.json")).unwrap());
    for (name, of) in truth.as_object().unwrap() {
        let Some(joint) = of["joint"].as_str() else {
            continue;
        };
        let folder = folder();
        let urdf = cases().join("../../robots/arm.urdf");
        let elasticity = format!("elasticity:{joint}");
        let effects = [
            "add",
            "viscous",
            "coulomb",
            "armature",
            "bias",
            &elasticity,
            "-m",
            "arm.toml",
        ];
        let urdf = ["--urdf", urdf.to_str().unwrap()];
        done(folder.path(), &[&effects[..], &urdf].concat());
        let log = cases().join(format!("{name}.csv.gz"));
        let log = log.to_str().unwrap();
        let fitted = done(
            folder.path(),
            &["identify", log, "-m", "arm.toml", "--json"],
        );
        let fitted = json(&fitted);
        let own = fitted["parameters"].as_array().unwrap().iter();
        let own = own
            .clone()
            .find(|p| p["name"] == elasticity.as_str())
            .unwrap();
        let [value, std] = ["value", "std"].map(|key| own[key].as_f64().unwrap());
        let compliance = of["stiffness"].as_f64().unwrap().recip();
        assert!(
            (value - compliance).abs() < 2.5 * std && std < 0.2 * compliance,
            "{name}: 1/k {value} ± {std}, truth {compliance}"
        );
    }
}
