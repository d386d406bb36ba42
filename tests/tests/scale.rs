//! A robot of a hundred times the mass with drives of a hundred times the torque moves alike, and its log is the same problem: what is
//! missing must be the same, and every torque a hundred times as large. Nothing of a diagnosis may know how heavy a Go2 is.

use std::fs;
use std::path::Path;

use proprio_tests::command::{done, folder, json, steps};
use serde_json::Value;

const TIMES: f64 = 100.0;

/// A URDF with all masses, moments of inertia and efforts so many times, and no name of a Go2.
fn urdf(times: f64) -> String {
    let oracle = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/go2.urdf");
    let mut text = other_names(&fs::read_to_string(oracle).unwrap());
    for attribute in [
        "mass value",
        "ixx",
        "ixy",
        "ixz",
        "iyy",
        "iyz",
        "izz",
        "effort",
    ] {
        let head = format!("{attribute}=\"");
        let mut parts = text.split(&head);
        let mut scaled = parts.next().unwrap().to_owned();
        for part in parts {
            let (number, rest) = part.split_once('"').unwrap();
            let number: f64 = number.parse().unwrap();
            scaled += &format!("{head}{:e}\"{rest}", number * times);
        }
        text = scaled;
    }
    text
}

fn other_names(text: &str) -> String {
    let names = [
        ("hip", "one"),
        ("thigh", "two"),
        ("calf", "three"),
        ("foot", "tip"),
        ("FR_", "A_"),
        ("FL_", "B_"),
        ("RR_", "C_"),
        ("RL_", "D_"),
        ("go2", "other"),
    ];
    let names = names.into_iter();
    names.fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// A log with all torques so many times.
fn log(text: &str, times: f64) -> String {
    let mut lines = text.lines().skip_while(|line| !line.starts_with("t,"));
    let head = other_names(lines.next().unwrap());
    let torque: Vec<bool> = head.split(',').map(|c| c.starts_with("tau/")).collect();
    let row = |line: &str| {
        let cells = line.split(',').zip(&torque);
        let cells = cells.map(|(cell, torque)| match cell.parse::<f64>() {
            Ok(number) if *torque => format!("{:e}", number * times),
            _ => cell.to_owned(),
        });
        cells.collect::<Vec<_>>().join(",")
    };
    let rows = lines.map(row).collect::<Vec<_>>().join("\n");
    format!("{head}\n{rows}\n")
}

/// Each step with its error on unseen data, as a share of the torque.
fn diagnosed(folder: &Path, text: &str, times: f64) -> Vec<(String, f64)> {
    fs::write(folder.join("robot.urdf"), urdf(times)).unwrap();
    fs::write(folder.join("log.csv"), log(text, times)).unwrap();
    let model = folder.join("m.toml");
    if model.exists() {
        fs::remove_file(&model).unwrap();
    }
    done(
        folder,
        &["add", "delay", "-m", "m.toml", "--urdf", "robot.urdf"],
    );
    done(folder, &["remove", "delay", "-m", "m.toml"]);
    let found = json(&done(
        folder,
        &["diagnose", "log.csv", "-m", "m.toml", "--json"],
    ));
    let step = |step: &Value| {
        let name = format!("{} {} {}", step["effect"], step["joints"], step["step"]);
        (name, step["error"].as_f64().unwrap() / times)
    };
    steps(&found).iter().map(step).collect()
}

#[test]
fn a_heavier_robot_with_stronger_drives_is_the_same_problem() {
    for hidden in [
        "payload:FR_calf=0.3,z=-0.1",
        "stribeck:FR_thigh=0.4,vs=0.05",
    ] {
        let folder = folder();
        done(
            folder.path(),
            &[
                "simulate",
                "--typical",
                "--legs",
                "FR",
                "--duration",
                "20",
                "--inertia-error",
                "0.05",
                "--torque-noise",
                "0.05",
                "--seed",
                "7",
                "--hide",
                hidden,
                "-o",
                "sim.csv",
            ],
        );
        let text = fs::read_to_string(folder.path().join("sim.csv")).unwrap();
        let [own, heavy] = [1.0, TIMES].map(|times| diagnosed(folder.path(), &text, times));
        println!("{hidden}: {own:?}\n{heavy:?}");
        assert!(own.len() >= 3, "{own:?}");
        assert_eq!(own.len(), heavy.len());
        for ((name, error), (of_heavy, error_of_heavy)) in own.iter().zip(&heavy) {
            assert_eq!(name, of_heavy);
            assert!((error_of_heavy / error - 1.0).abs() < 1e-3, "{name}");
        }
    }
}
