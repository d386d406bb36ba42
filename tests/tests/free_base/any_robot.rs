//! Walks that `proprio simulate --walk -m` makes of robots that are no Go2: six legs that end in points; a biped would have to balance.

use std::fs;
use std::path::{Path, PathBuf};

use proprio_core::effect::EffectKind;
use proprio_host::model::Model;
use proprio_tests::command::{done, folder, json, proprio, stderr};
use serde_json::Value;

use super::number;

fn robot(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// What a command prints; its arguments are parted by spaces.
fn run(folder: &Path, arguments: &str) -> String {
    done(folder, &arguments.split(' ').collect::<Vec<_>>())
}

/// The quantity of this name.
fn quantity(file: &Value, name: &str) -> Value {
    let all = file["quantities"].as_array().unwrap();
    all.iter().find(|q| q["name"] == name).unwrap().clone()
}

/// A hexapod trots on three feet at a time, hops and sways: the total mass within 1 % and three of its standard deviations, the
/// whole robot's centre of mass within 3 mm.
#[test]
fn other_robots_walk_and_weigh_what_was_simulated() {
    for (model, gait) in [
        ("oracle/legged/hexapod.toml", "trot"),
        ("oracle/legged/hexapod.toml", "hop"),
        ("oracle/legged/hexapod.toml", "sway"),
    ] {
        let (folder, model) = (folder(), robot(model).display().to_string());
        let walk = format!("simulate --walk {gait} -m {model} --typical --inertia-error 0.03");
        run(folder.path(), &format!("{walk} --duration 10 -o walk.csv"));
        let truth = fs::read_to_string(folder.path().join("walk.truth.json")).unwrap();
        let truth = json(&truth);
        let identify = format!("identify --free-base walk.csv -m {model} --physical --json");
        let found = json(&run(folder.path(), &identify));
        let [own, known] = [&found, &truth].map(|file| quantity(file, "total_mass"));
        let [mass, std, known] = [&own["value"], &own["std"], &known["value"]].map(number);
        println!("{model} {gait}: {mass:.3} ± {std:.3} kg, truth {known:.3}");
        assert!((mass / known - 1.0).abs() < 0.01, "{model} {gait}");
        assert!((mass - known).abs() < 3.0 * std, "{model} {gait}");
        for axis in ["robot_com_x", "robot_com_y", "robot_com_z"] {
            let [own, known] = [&found, &truth].map(|file| number(&quantity(file, axis)["value"]));
            println!("{axis}: {own:.4} m, truth {known:.4}");
            assert!((own - known).abs() < 3e-3, "{model} {gait} {axis}");
        }
    }
}

/// A smaller robot whose joints have a Go2's names, as an A1's: its walk, given as a Go2's, is weighed wrong, and that it may be another robot's is said.
#[test]
fn another_robots_walk_under_a_go2s_names_is_doubted() {
    let folder = folder();
    let mut urdf = fs::read_to_string(robot("oracle/go2.urdf")).unwrap();
    // Hips, thighs' offset and links, m, and masses, kg, of an A1 (`example-robot-data`).
    for (go2s, a1s) in [
        ("0.1934", "0.1805"),
        ("0.0955", "0.0838"),
        ("0.213", "0.2"),
        (r#"value="6.921""#, r#"value="4.713""#),
        (r#"value="1.152""#, r#"value="1.013""#),
    ] {
        assert!(urdf.contains(go2s));
        urdf = urdf.replace(go2s, a1s);
    }
    fs::write(folder.path().join("a1.urdf"), urdf).unwrap();
    let file = "format = 1\n\n[robot]\nurdf = \"a1.urdf\"\n";
    fs::write(folder.path().join("a1.toml"), file).unwrap();
    let walk = "simulate --walk trot -m a1.toml --typical --inertia-error 0.03 -o walk.csv";
    run(folder.path(), walk);
    let doubts = |model: &str| {
        let identify = format!("identify --free-base walk.csv{model} --physical --json");
        let found = json(&run(folder.path(), &identify));
        let warnings = found["warnings"].as_array().unwrap().iter();
        let warnings: Vec<String> = warnings.map(Value::to_string).collect();
        println!("{warnings:?}");
        warnings.iter().any(|told| told.contains("another robot"))
    };
    assert!(doubts("") && !doubts(" -m a1.toml"));
}

/// What is hidden at one joint of a hexapod is named, alone and with its value.
#[test]
fn what_another_robot_hides_is_named() {
    let (folder, path) = (folder(), robot("oracle/legged/hexapod.toml"));
    let mut model = Model::load(&path).unwrap();
    for joint in 0..model.robot().bodies().len() {
        for effect in EffectKind::PLAIN {
            model.add_effect(effect, joint);
        }
    }
    model.save(&folder.path().join("hexapod.toml")).unwrap();
    let walk = "simulate --walk trot -m hexapod.toml --typical --inertia-error 0.03 -o walk.csv";
    run(
        folder.path(),
        &format!("{walk} --hide spring:front_left_knee=2"),
    );
    let diagnose = "diagnose --free-base walk.csv -m hexapod.toml --json";
    let found = json(&run(folder.path(), diagnose));
    let path = found["path"].as_array().unwrap();
    let added: Vec<&Value> = path.iter().filter(|step| step["step"] == "add").collect();
    assert_eq!(added.len(), 1, "{path:?}");
    assert_eq!(added[0]["effect"], "spring");
    assert_eq!(added[0]["joints"], serde_json::json!(["front_left_knee"]));
    let best = &found["candidates"][0];
    let off = (number(&best["value"]) - 2.0) / number(&best["std"]);
    println!("{} ± {}", best["value"], best["std"]);
    assert!(off.abs() < 3.0, "{best}");
}

/// A robot that cannot do what is asked is refused with the cause, and leaves no log.
#[test]
fn a_robot_that_cannot_walk_so_is_refused_with_the_cause() {
    let refused = |arguments: &str| {
        let folder = folder();
        let output = proprio(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
        assert!(fs::read_dir(folder.path()).unwrap().next().is_none());
        (output.status.code(), stderr(&output))
    };
    let biped = robot("robots/biped.toml").display().to_string();
    let (status, said) = refused(&format!("simulate --walk sway -m {biped}"));
    assert!(
        status == Some(1) && said.contains("has to balance"),
        "{said}"
    );
    let hexapod = robot("oracle/legged/hexapod.toml").display().to_string();
    let (status, said) = refused(&format!(
        "simulate --walk sway -m {hexapod} --hide coulomb:front_left_kne=1"
    ));
    assert!(
        status == Some(2) && said.contains("did you mean `front_left_knee`"),
        "{said}"
    );
}
