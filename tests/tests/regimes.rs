//! Where an error lives: a range of position, or from a moment on, found and put to use by `--only`.

use std::path::Path;

use proprio_tests::command::{done, folder, json, simulated};
use serde_json::Value;

const DRIVE: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];
/// Length of the logs, s, and about how far the joints move, rad.
const SECONDS: f64 = 15.0;
const TRAVEL: f64 = 1.2;

/// A leg that hides this, diagnosed with effects of the catalogue alone.
fn diagnosed(folder: &Path, seed: &str, hide: &str) -> Value {
    let seconds = SECONDS.to_string();
    let robot = [
        "--legs",
        "FR",
        "--typical",
        "--inertia-error",
        "0.03",
        "--with-time",
    ];
    let log = [
        "--duration",
        &seconds,
        "--seed",
        seed,
        "--hide",
        hide,
        "-o",
        "log.csv",
    ];
    done(folder, &[&["simulate"], &robot[..], &log].concat());
    let diagnose = [
        "diagnose",
        "log.csv",
        "-m",
        "drive.toml",
        "--catalogue-only",
        "--json",
    ];
    json(&done(folder, &diagnose))
}

fn edge(regime: &Value, side: &str) -> [f64; 2] {
    ["value", "std"].map(|key| regime[side][key].as_f64().unwrap())
}

/// The moment of a change to a fiftieth of the log, a place to a tenth of the travel; neither is on any grid. The sentence has it, and the condition judges
/// that part alone, where the error is the larger.
#[test]
fn a_hidden_regime_is_printed_and_of_use() {
    let folder = folder();
    let folder = folder.path();
    done(
        folder,
        &[&["add"], &DRIVE[..], &["-m", "drive.toml"]].concat(),
    );
    let hidden = [
        (
            "3",
            "FR_calf: 0.4*step(t - 5.3171)*sign(dq)",
            "time",
            [Some(5.3171), None],
        ),
        (
            "4",
            "FR_thigh: 1.3*step(t - 9.8713)*dq",
            "time",
            [Some(9.8713), None],
        ),
        (
            "5",
            "FR_thigh: 20*max(q - 0.9731, 0)*sign(dq)",
            "position",
            [Some(0.9731), None],
        ),
        (
            "6",
            "FR_calf: 0.6*step(q + 1.9317)*step(-1.4713 - q)*sign(dq)",
            "position",
            [Some(-1.9317), Some(-1.4713)],
        ),
    ];
    for (seed, hide, variable, truth) in hidden {
        let found = diagnosed(folder, seed, hide);
        let joint = hide.split(':').next().unwrap();
        let regimes = found["regimes"]
            .as_array()
            .unwrap_or_else(|| panic!("{hide}: {found}"));
        let own = regimes.iter().find(|regime| regime["joint"] == joint);
        let own = own.unwrap_or_else(|| panic!("{hide}: {regimes:?}"));
        assert_eq!(own["variable"], variable, "{hide}: {own}");
        for (side, truth) in ["from", "to"].into_iter().zip(truth) {
            let Some(truth) = truth else {
                assert!(own[side].is_null(), "{hide}: {own}");
                continue;
            };
            let most = match variable {
                "time" => 0.02 * SECONDS,
                _ => 0.1 * TRAVEL,
            };
            let [value, std] = edge(own, side);
            println!("{hide}: {side} {value} ±{std}");
            assert!((value - truth).abs() < most && std < most, "{hide}: {own}");
        }
        let conditions: Vec<&str> = own["only"]
            .as_array()
            .unwrap()
            .iter()
            .map(|only| only.as_str().unwrap())
            .collect();
        let sentences = found["outside_catalogue"].as_array().unwrap();
        let said = |text: &str| {
            sentences
                .iter()
                .any(|own| own.as_str().unwrap().contains(text))
        };
        assert!(
            said(&format!("--only '{}'", conditions[0])),
            "{sentences:?}"
        );
        let only: Vec<&str> = conditions
            .iter()
            .flat_map(|only| ["--only", only])
            .collect();
        let error = |only: &[&str]| {
            let compare = [
                "compare",
                "log.csv",
                "-m",
                "drive.toml",
                "--given",
                "--json",
            ];
            let joints = json(&done(folder, &[&compare[..], only].concat()));
            let mut joints = joints["joints"].as_array().unwrap().clone().into_iter();
            let own = joints.find(|own| own["joint"] == joint).unwrap();
            own["rms"].as_f64().unwrap()
        };
        assert!(error(&only) > 1.0e-3, "{hide}");
    }
}

/// A formula that begins at its parameter has that as its regime.
#[test]
fn a_formula_that_is_found_has_its_regime() {
    let folder = simulated(
        "--legs FR --typical --inertia-error 0.03 --with-time --hide FR_calf:0.4*step(t-7.3171)*sign(dq) --seed 8",
    );
    let folder = folder.path();
    done(
        folder,
        &[&["add"], &DRIVE[..], &["-m", "drive.toml"]].concat(),
    );
    let found = done(
        folder,
        &["diagnose", "log.csv", "-m", "drive.toml", "--json"],
    );
    let found = json(&found);
    let formula = &found["formulas"][0];
    assert_eq!(formula["torque"], "c*step(t - p)*sign(dq)", "{found}");
    let [from, std] = edge(&formula["regime"], "from");
    assert!(
        (from - 7.3171).abs() < 0.02 * 20.0 && std < 0.4,
        "{formula}"
    );
    assert_eq!(formula["regime"]["variable"], "time");
    assert!(formula["regime"]["to"].is_null());
}

#[test]
fn a_complete_robot_has_none() {
    for seed in ["1", "2", "3"] {
        let folder = simulated(&format!(
            "--legs FR --typical --inertia-error 0.03 --seed {seed} --duration {SECONDS}"
        ));
        let folder = folder.path();
        done(
            folder,
            &[&["add"], &DRIVE[..], &["-m", "drive.toml"]].concat(),
        );
        let found = json(&done(
            folder,
            &[
                "diagnose",
                "log.csv",
                "-m",
                "drive.toml",
                "--catalogue-only",
                "--json",
            ],
        ));
        assert!(found["regimes"].is_null(), "{}", found["regimes"]);
    }
}
