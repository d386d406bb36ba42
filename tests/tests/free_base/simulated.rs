//! Walks that `proprio simulate --walk` makes: what went in comes out of `identify --free-base`.

use std::path::Path;

use proprio_tests::command::{done, folder, json, parameter, proprio, stderr};
use serde_json::Value;

/// The log `walk.csv` that these arguments make and its truth, and what `identify --free-base` says of it.
fn identified(arguments: &str) -> (Value, Value) {
    let folder = folder();
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let fixed = ["simulate", "-o", "walk.csv", "--walk"];
    done(folder.path(), &[&fixed[..], &arguments].concat());
    let truth = std::fs::read_to_string(folder.path().join("walk.truth.json")).unwrap();
    (json(&truth), identify(folder.path(), "walk.csv"))
}

fn identify(folder: &Path, log: &str) -> Value {
    json(&done(
        folder,
        &["identify", "--free-base", "--physical", "--json", log],
    ))
}

/// Value and standard deviation of a quantity, and its truth.
fn quantity(name: &str, truth: &Value, found: &Value) -> [f64; 3] {
    let of = |file: &Value| {
        let all = file["quantities"].as_array().unwrap();
        all.iter().find(|q| q["name"] == name).unwrap().clone()
    };
    let (truth, found) = (of(truth), of(found));
    let [value, std, expected] = [&found["value"], &found["std"], &truth["value"]].map(number);
    println!("{name}: {value:.4} ± {std:.4}, truth {expected:.4}");
    [value, std, expected]
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Of every gait the total mass within 1 %, and where the whole robot's centre of mass is within 3 mm.
#[test]
fn masses_are_those_that_were_simulated() {
    for (gait, more) in [
        ("trot", ""),
        ("trot", "--hide payload:base=2,x=0.05,y=-0.02,z=0.07"),
        ("trot", "--ground-friction 0.3"),
        ("flying", ""),
        ("hop", ""),
        ("sway", ""),
    ] {
        let arguments = format!("{gait} --duration 6 --typical --inertia-error 0.03 {more}");
        let (truth, found) = identified(&arguments);
        println!("{arguments}");
        assert_eq!(truth["gait"], gait);
        let [mass, _, expected] = quantity("total_mass", &truth, &found);
        assert!((mass / expected - 1.0).abs() < 0.01, "{gait}");
        for axis in ["robot_com_x", "robot_com_y", "robot_com_z"] {
            let [place, _, expected] = quantity(axis, &truth, &found);
            assert!((place - expected).abs() < 3e-3, "{gait}");
        }
    }
}

/// Nothing is carried across a pause of the log, neither the IMU's axes nor gravity's direction in them: with pauses of any length the mass is that of
/// the whole log, within one of its standard deviations.
#[test]
fn pauses_of_a_log_move_no_mass() {
    let folder = folder();
    let made =
        "simulate -o walk.csv --walk trot --duration 12 --typical --inertia-error 0.03 --seed 990";
    done(folder.path(), &made.split(' ').collect::<Vec<_>>());
    let log = std::fs::read_to_string(folder.path().join("walk.csv")).unwrap();
    let (header, rows) = log.split_once('\n').unwrap();
    let mass = |pauses: &[[f64; 2]]| {
        let is_there = |row: &&str| {
            let t: f64 = row.split(',').next().unwrap().parse().unwrap();
            !pauses
                .iter()
                .any(|[begin, end]| (*begin..*end).contains(&t))
        };
        let kept = rows.lines().filter(is_there).collect::<Vec<_>>().join("\n");
        let name = "paused.csv";
        std::fs::write(folder.path().join(name), format!("{header}\n{kept}\n")).unwrap();
        let found = identify(folder.path(), name);
        let all = found["quantities"].as_array().unwrap();
        let total = all.iter().find(|q| q["name"] == "total_mass").unwrap();
        [number(&total["value"]), number(&total["std"])]
    };
    let [whole, std] = mass(&[]);
    for pauses in [
        &[[6.41, 7.01]][..],
        &[[5.0, 5.09]],
        &[[3.0, 3.3], [5.0, 5.4], [8.0, 8.6]],
        &[[4.0, 7.0]],
    ] {
        let [own, _] = mass(pauses);
        println!("{pauses:?}: {own:.3} kg, whole {whole:.3} ± {std:.3} kg");
        assert!(
            (own - whole).abs() < std,
            "{pauses:?}: {own} of {whole} ± {std} kg"
        );
    }
}

/// Friction, rotors and the accelerometer's bias of a trot, by the same names in both files.
#[test]
fn a_trot_tells_friction_and_bias() {
    let (truth, found) = identified("trot --duration 8 --typical --inertia-error 0.03 --seed 3");
    let mut off = Vec::new();
    for estimate in found["parameters"].as_array().unwrap() {
        let name = estimate["name"].as_str().unwrap();
        let what = name.split([':', '.']).next().unwrap();
        if !["viscous", "coulomb", "armature", "bias", "acc_bias"].contains(&what) {
            continue;
        }
        let expected = number(&parameter(&truth, name)["value"]);
        let (value, std) = (number(&estimate["value"]), number(&estimate["std"]));
        if estimate["status"] == "identified" {
            off.push(((value - expected).abs() / std, name.to_owned()));
        }
    }
    off.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!("{off:?}");
    assert!(off.len() > 30 && off[off.len() * 9 / 10].0 < 3.0, "{off:?}");
}

#[test]
fn what_a_walk_does_not_have_is_refused() {
    let folder = folder();
    let refused = |arguments: &str| {
        let arguments: Vec<&str> = arguments.split_whitespace().collect();
        let output = proprio(folder.path(), &arguments);
        assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
        (output.status.code(), stderr(&output))
    };
    let (status, said) = refused("simulate --walk trot --hide backlash=0.002");
    assert!(
        status == Some(2) && said.contains("backlash cannot be hidden from a robot that walks")
    );
    let (status, said) = refused("simulate --hide payload:base=2");
    assert!(status == Some(2) && said.contains("--walk"), "{said}");
    let (status, said) = refused("simulate --walk trot --legs FR");
    assert!(status == Some(2) && said.contains("--legs"), "{said}");
    let (status, said) = refused("simulate --ground-friction 0.3");
    assert!(status == Some(2) && said.contains("--walk"), "{said}");
    // It cannot carry four times its weight: no log, and no truth.
    let (status, said) = refused("simulate --walk trot --hide payload:base=60");
    assert!(status == Some(1) && said.contains("cannot stand"), "{said}");
}
