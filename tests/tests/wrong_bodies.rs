//! URDFs whose bodies are not the robot's: a body is told, and no effect in its place.

use std::fs;

use proprio_host::model::Robot;
use proprio_tests::command::{done, folder, json, simulated};
use proprio_tests::recorder::Recorder;
use serde_json::Value;

use crate::other_robot::TYPICAL;
use crate::readings::{ARM, as_is, same, write};

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

/// Six seconds at 100 Hz, too short for a noise floor: a forearm with six times the moments of inertia is named.
#[test]
fn a_short_log_names_a_body_too() {
    const CAD: &str = r#"<inertia ixx="0.006" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.001"/>"#;
    const TRUE: &str = r#"<inertia ixx="0.036" ixy="0" ixz="0" iyy="0.036" iyz="0" izz="0.006"/>"#;
    let folder = folder();
    let folder = folder.path();
    assert!(ARM.contains(CAD));
    fs::write(folder.join("true.urdf"), ARM.replace(CAD, TRUE)).unwrap();
    fs::write(folder.join("arm.urdf"), ARM).unwrap();
    let mut recorder = Recorder::new(Robot::from_urdf(&folder.join("true.urdf")).unwrap());
    (recorder.duration, recorder.bodies) = (6.0, vec![1.0; 4]);
    write(folder, &recorder, as_is, same);
    let log = fs::read_to_string(folder.join("log.csv")).unwrap();
    let few = log.lines().enumerate();
    let few = few.filter(|(n, _)| n % 5 == 1 || *n == 0).map(|(_, l)| l);
    fs::write(
        folder.join("short.csv"),
        few.collect::<Vec<_>>().join("\n") + "\n",
    )
    .unwrap();
    let add = ["add", "-m", "arm.toml", "--urdf", "arm.urdf"];
    done(folder, &[&add[..], &TYPICAL].concat());
    let found = json(&done(
        folder,
        &["diagnose", "short.csv", "-m", "arm.toml", "--json"],
    ));
    assert!(found["bodies"].to_string().contains("fore: "), "{found}");
    assert!(found["error"]["floor"].is_null(), "{}", found["error"]);
    let steps = found["path"].as_array().unwrap().iter();
    let added: Vec<&Value> = steps
        .filter(|step| step["step"] == "add")
        .map(|step| &step["effect"])
        .collect();
    assert!(added.is_empty(), "{added:?}");
}
