//! URDFs whose bodies are not the robot's: a body is told, and no effect in its place.

use std::fs;

use proprio_tests::command::{done, json, simulated};
use serde_json::Value;

use crate::other_robot::TYPICAL;

/// The oracle's Go2.
const URDF: &str = include_str!("../oracle/go2.urdf");

/// The URDF with an attribute of a link's tag times so many.
fn times(link: &str, tag: &str, attributes: &[&str], factor: f64) -> String {
    let (before, rest) = URDF
        .split_once(&format!("<link name=\"{link}\">"))
        .unwrap_or_else(|| panic!("{link}"));
    let (head, rest) = rest.split_once(&format!("<{tag} ")).unwrap();
    let (own, rest) = rest.split_once('>').unwrap();
    let mut own = own.to_owned();
    for name in attributes {
        let (left, right) = own.split_once(&format!("{name}=\"")).unwrap();
        let (value, right) = right.split_once('"').unwrap();
        let value: f64 = value.parse().unwrap();
        own = format!("{left}{name}=\"{}\"{right}", factor * value);
    }
    format!("{before}<link name=\"{link}\">{head}<{tag} {own}>{rest}")
}

#[test]
fn a_wrong_body_is_told_and_no_effect() {
    let inertia = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
    let folder = simulated("--legs FR --typical --inertia-error 0.03 --seed 7");
    let folder = folder.path();
    for (what, link, urdf) in [
        (
            "ten times the inertia",
            "FR_thigh",
            times("FR_thigh", "inertia", &inertia, 10.0),
        ),
        (
            "a tenth of the inertia",
            "FR_thigh",
            times("FR_thigh", "inertia", &inertia, 0.1),
        ),
        (
            "ten times the calf's",
            "FR_calf",
            times("FR_calf", "inertia", &inertia, 10.0),
        ),
        (
            "grams for kilograms",
            "FR_thigh",
            times("FR_thigh", "mass", &["value"], 0.01),
        ),
        (
            "three times the mass",
            "FR_thigh",
            times("FR_thigh", "mass", &["value"], 3.0),
        ),
    ] {
        fs::write(folder.join("wrong.urdf"), urdf).unwrap();
        let _ = fs::remove_file(folder.join("wrong.toml"));
        let add = ["add", "-m", "wrong.toml", "--urdf", "wrong.urdf"];
        done(folder, &[&add[..], &TYPICAL].concat());
        let say = |command: &str| {
            json(&done(
                folder,
                &[command, "log.csv", "-m", "wrong.toml", "--json"],
            ))
        };
        let [found, fitted] = [say("diagnose"), say("identify")];
        let told = |of: &Value| of.to_string().contains(&format!("{link}: "));
        assert!(told(&found["bodies"]), "{what}: {}", found["bodies"]);
        assert!(told(&fitted["warnings"]), "{what}: {}", fitted["warnings"]);
        let steps = found["path"].as_array().unwrap().iter();
        let added: Vec<&str> = steps
            .filter(|step| step["step"] == "add")
            .map(|step| step["effect"].as_str().unwrap())
            .collect();
        // Where mass is missing, a load is the same.
        let is_load = |effect: &&str| *effect == "payload" && what == "grams for kilograms";
        assert!(added.iter().all(is_load), "{what}: {added:?}");
        let [after, floor] = ["after", "floor"].map(|key| found["error"][key].as_f64().unwrap());
        assert!(after < 1.1 * floor, "{what}: {after} {floor}");
    }
}
