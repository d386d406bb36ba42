//! URDFs with a joint that stands elsewhere than the robot's: the kinematics are named, and no effect in their place.

use std::fs;

use proprio_host::model::Robot;
use proprio_tests::command::{done, folder, json};
use proprio_tests::recorder::Recorder;
use serde_json::Value;

use crate::other_robot::TYPICAL;
use crate::readings::{ARM, as_is, same, write};

/// The elbow as the URDF has it, and a robot of another one.
const ELBOW: &str = r#"<child link="fore"/><origin xyz="0 0 0.3"/>"#;

/// A folder with the arm's URDF and model file and a log of the arm with that elbow: 20 s, of which the models see the first twelve.
fn arm_with(elbow: &str) -> tempfile::TempDir {
    let folder = folder();
    let path = folder.path();
    assert!(ARM.contains(ELBOW));
    fs::write(path.join("true.urdf"), ARM.replace(ELBOW, elbow)).unwrap();
    fs::write(path.join("arm.urdf"), ARM).unwrap();
    let mut recorder = Recorder::new(Robot::from_urdf(&path.join("true.urdf")).unwrap());
    recorder.duration = 20.0;
    write(path, &recorder, as_is, same);
    let add = ["add", "-m", "arm.toml", "--urdf", "arm.urdf"];
    done(path, &[&add[..], &TYPICAL].concat());
    folder
}

fn diagnosed(folder: &std::path::Path, more: &[&str]) -> Value {
    let fixed = [
        "diagnose", "log.csv", "-m", "arm.toml", "--json", "--only", "t < 12",
    ];
    json(&done(folder, &[&fixed[..], more].concat()))
}

/// The effects that a diagnosis adds.
fn added(found: &Value) -> Vec<&str> {
    let steps = found["path"].as_array().unwrap().iter();
    let added = steps.filter(|step| step["step"] == "add");
    added.map(|step| step["effect"].as_str().unwrap()).collect()
}

/// A correction of a joint's frame: its value and standard deviation.
fn correction(found: &Value, joint: &str, quantity: &str) -> [f64; 2] {
    let frames = found["kinematics"].as_array().unwrap();
    let frame = frames.iter().find(|frame| frame["joint"] == joint);
    let all = frame.unwrap_or_else(|| panic!("{frames:?}"))["corrections"].as_array();
    let own = all.unwrap().iter().find(|own| own["quantity"] == quantity);
    let own = own.unwrap_or_else(|| panic!("{frames:?}"));
    ["value", "std"].map(|key| own[key].as_f64().unwrap())
}

fn error_of(folder: &std::path::Path) -> f64 {
    let compare = [
        "compare", "log.csv", "-m", "arm.toml", "--json", "--only", "t > 12",
    ];
    let error = &json(&done(folder, &compare))["error"];
    error["after"].as_f64().unwrap()
}

/// An axis that is 4° off: named with its angle, written, and the error falls on what was not seen.
#[test]
fn an_axis_that_is_off_is_named_and_put_right() {
    let folder = arm_with(r#"<child link="fore"/><origin xyz="0 0 0.3" rpy="0.07 0 0"/>"#);
    let found = diagnosed(folder.path(), &["--apply"]);
    assert_eq!(added(&found), ["link_geometry"]);
    assert_eq!(found["verdict"], "missing");
    let [value, std] = correction(&found, "elbow", "rx");
    assert!((value - 0.07).abs() < 0.002 && std < 0.002, "{value} {std}");
    let [before, after, floor] =
        ["before", "after", "floor"].map(|key| found["error"][key].as_f64().unwrap());
    assert!(
        after < 1.1 * floor && before > 2.0 * floor,
        "{before} {after} {floor}"
    );
    let shown = done(folder.path(), &["show", "arm.toml"]);
    assert!(shown.contains("joint frames corrected against the description: elbow"));
    let later = error_of(folder.path());
    assert!(later < 1.2 * floor, "{later} {floor}");
}

/// A link that is 3 cm longer.
#[test]
fn a_longer_link_is_named() {
    let folder = arm_with(r#"<child link="fore"/><origin xyz="0 0 0.33"/>"#);
    let found = diagnosed(folder.path(), &[]);
    assert_eq!(added(&found), ["link_geometry"]);
    let [value, std] = correction(&found, "elbow", "dz");
    assert!(
        (value - 0.03).abs() < 3.0 * std && std < 0.003,
        "{value} {std}"
    );
}

#[test]
fn an_arm_as_its_urdf_has_it_has_no_other_geometry() {
    let folder = arm_with(ELBOW);
    let found = diagnosed(folder.path(), &[]);
    assert_eq!(added(&found), [""; 0]);
    assert!(found.get("kinematics").is_none(), "{found}");
}
