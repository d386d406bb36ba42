//! A second encoder at the link: it moves the bodies, and what lies between it and the motor's is told from the two.

use std::fs;

use proprio_tests::command::{done, json, simulated};

/// Of a gear that gives way the second encoder tells the spring and the friction inside it; the model file predicts a log without one.
#[test]
fn a_gear_that_gives_way_is_measured_and_predicted() {
    let folder = simulated(
        "--typical --legs FR --duration 20 --inertia-error 0.05 --second-encoder --hide elasticity:FR_calf=200,f=0.5,w=0.002",
    );
    let head = fs::read_to_string(folder.path().join("log.csv")).unwrap();
    assert!(head.lines().next().unwrap().contains("q_link/FR_calf"));
    let found = json(&done(folder.path(), &["diagnose", "log.csv", "--json"]));
    let candidates = found["candidates"].as_array().unwrap();
    let of = |effect: &str| {
        let own = candidates.iter().find(|c| c["effect"] == effect).unwrap();
        assert_eq!(own["joints"][0], "FR_calf");
        let parameters = own["parameters"].as_array().unwrap();
        let numbers = parameters.iter().map(|p| {
            let [value, std] = ["value", "std"].map(|key| p[key].as_f64().unwrap());
            (value, std)
        });
        numbers.collect::<Vec<_>>()
    };
    let (compliance, inside) = (of("elasticity"), of("elastic_hysteresis"));
    println!("{compliance:?} {inside:?}");
    // The bodies are 5 % off the CAD.
    assert!((compliance[0].0 * 200.0 - 1.0).abs() < 0.1);
    assert!((inside[0].0 - 0.5).abs() < 0.1);
    assert!((0.001..0.004).contains(&inside[1].0));
    assert!(
        candidates
            .iter()
            .all(|c| c["effect"] != "backlash" || c["significant"] == false)
    );
    let said = done(
        folder.path(),
        &["diagnose", "log.csv", "--apply", "-m", "leg.toml"],
    );
    assert!(said.contains("FR_calf's second encoder"), "{said}");
    // The plain effects are there, and those that no torque shows.
    done(
        folder.path(),
        &["identify", "log.csv", "-m", "leg.toml", "-o", "leg.toml"],
    );
    let file = fs::read_to_string(folder.path().join("leg.toml")).unwrap();
    assert!(file.contains("elastic_hysteresis"), "{file}");
    let again = json(&done(
        folder.path(),
        &["diagnose", "log.csv", "-m", "leg.toml", "--json"],
    ));
    assert_eq!(again["second_encoder"], serde_json::Value::Null);
    // Without the second encoder the file's gear moves the link.
    let other = "simulate --typical --legs FR --duration 20 --inertia-error 0.05 --hide elasticity:FR_calf=200,f=0.5,w=0.002 -o other.csv";
    done(folder.path(), &other.split(' ').collect::<Vec<_>>());
    let rms = |model: &str| {
        let compared = done(
            folder.path(),
            &["compare", "other.csv", "-m", model, "--given", "--json"],
        );
        json(&compared)["rms"].as_f64().unwrap()
    };
    let with = rms("leg.toml");
    // A fit to a log that cannot tell it keeps it.
    done(
        folder.path(),
        &["identify", "other.csv", "-m", "leg.toml", "-o", "kept.toml"],
    );
    let kept = fs::read_to_string(folder.path().join("kept.toml")).unwrap();
    let inside = |file: &str| {
        let own = file
            .lines()
            .skip_while(|line| !line.contains("elastic_hysteresis"));
        own.take(4).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(inside(&kept), inside(&file));
    done(
        folder.path(),
        &[
            "remove",
            "elasticity",
            "elastic_hysteresis",
            "-m",
            "leg.toml",
        ],
    );
    let without = rms("leg.toml");
    println!("{with} {without}");
    assert!(with < 0.8 * without);
}

/// Rigid gears are rigid: nothing is shown of them, and the bodies' motion by the second encoder predicts as well.
#[test]
fn a_rigid_gear_gives_no_way() {
    let folder = simulated("--typical --legs FR --duration 20 --second-encoder");
    let found = json(&done(folder.path(), &["diagnose", "log.csv", "--json"]));
    assert_eq!(found["second_encoder"], serde_json::Value::Null);
    done(
        folder.path(),
        &[
            "add", "viscous", "coulomb", "armature", "bias", "-m", "leg.toml",
        ],
    );
    let complete = json(&done(
        folder.path(),
        &["diagnose", "log.csv", "-m", "leg.toml", "--json"],
    ));
    assert_eq!(complete["verdict"], "complete");
}

/// A play shows as one, with its gap.
#[test]
fn a_play_is_told_from_a_spring() {
    let folder = simulated(
        "--typical --legs FR --duration 20 --second-encoder --hide backlash:FR_calf=0.015",
    );
    let found = json(&done(folder.path(), &["diagnose", "log.csv", "--json"]));
    let candidates = found["candidates"].as_array().unwrap();
    let play = candidates
        .iter()
        .find(|c| c["effect"] == "backlash")
        .unwrap();
    let gap = play["value"].as_f64().unwrap();
    println!("{gap} {}", found["second_encoder"]);
    assert!((gap / 0.015 - 1.0).abs() < 0.2, "{gap}");
}
