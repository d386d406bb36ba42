//! `compare --free-base` with other effects than the model file has.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use proprio_core::effect::EffectKind;
use proprio_core::inertia::InertialParameters;
use proprio_host::compare::{ValuesFrom, compare_free_base};
use proprio_host::model::Model;
use proprio_tests::command::{done, folder as empty_folder, json, steps};
use serde_json::Value;

use super::{log, number};

fn compared(folder: &Path, log: &str, arguments: &[&str]) -> Value {
    let of = ["compare", "--free-base", "--json", log];
    json(&done(folder, &[&of[..], arguments].concat()))
}

/// `--with X` is the model that `add X` makes, held against the one that is in the file; `--without X` the one that `remove X` makes.
#[test]
fn a_flag_compares_the_model_that_add_or_remove_makes() {
    let (folder, log) = (empty_folder(), log("trot").display().to_string());
    let folder = folder.path();
    let names = ["viscous", "coulomb", "armature", "bias"];
    done(
        folder,
        &[&["add"], &names[..], &["-m", "whole.toml"]].concat(),
    );
    std::fs::copy(folder.join("whole.toml"), folder.join("less.toml")).unwrap();
    done(folder, &["remove", "coulomb:RL_calf", "-m", "less.toml"]);
    let whole = compared(folder, &log, &["-m", "whole.toml"]);
    let less = compared(folder, &log, &["-m", "less.toml"]);
    let with = ["-m", "less.toml", "--with", "coulomb:RL_calf"];
    let with = compared(folder, &log, &with);
    let without = ["-m", "whole.toml", "--without", "coulomb:RL_calf"];
    let without = compared(folder, &log, &without);
    for (flag, file) in [(&with, &whole), (&without, &less)] {
        let [told, of_file] = [flag, file].map(|own| number(&own["rms"]));
        assert!((told - of_file).abs() < 1e-8, "{told} {of_file}");
    }
    // The rows are those of the model that is compared.
    let [before, of_file] = [&with["before_rms"], &less["rms"]].map(number);
    assert!((before / of_file - 1.0).abs() < 0.02, "{before} {of_file}");
    assert!(number(&with["rms"]) < 0.9 * number(&with["before_rms"]));
    assert_eq!(with["added"], serde_json::json!(["coulomb:RL_calf"]));
    assert_eq!(without["left_out"], with["added"]);
}

/// A payload in the file predicts as a body that has its mass.
#[test]
fn a_payload_of_the_file_is_the_mass_of_its_body() {
    let (calf, mass) = (8, 0.25);
    let payload = EffectKind::from_name("payload").unwrap();
    let (mut loaded, mut heavy) = (Model::default(), Model::default());
    loaded.add_effect(payload, calf);
    let moment = Vector3::new(0.01, -0.02, 0.03);
    for (n, value) in [mass, moment.x, moment.y, moment.z, 0.0]
        .into_iter()
        .enumerate()
    {
        loaded
            .set_parameter(payload, calf, n, value, Some(0.01))
            .unwrap();
    }
    let body = *heavy.inertia(calf);
    let at = body.first_moment() / body.mass() + moment / mass;
    let load = InertialParameters::from_com(mass, at, Matrix3::zeros());
    heavy.set_body(calf, &(body + load), None).unwrap();
    let rms = |model: &Model| {
        let of = compare_free_base(&[log("trot")], model, ValuesFrom::Given, |_, _| ());
        of.unwrap().comparison.rms
    };
    let [of_load, of_body, bare] = [&loaded, &heavy, &Model::default()].map(rms);
    // Which windows are left out is judged by a fit that may carry the load anywhere, or not.
    assert!(
        (of_load / of_body - 1.0).abs() < 1e-3,
        "{of_load} {of_body}"
    );
    assert!((of_load / bare - 1.0).abs() > 1e-2, "{of_load} {bare}");
}

/// Of a robot with a payload that its model file has nothing is missing; where the file does not have it, it is.
#[test]
fn a_payload_that_the_file_has_is_not_missing() {
    let folder = empty_folder();
    let folder = folder.path();
    let hide = "payload:RR_calf=0.4,z=-0.1";
    let walk = ["simulate", "--walk", "trot", "--typical", "--hide", hide];
    done(folder, &[&walk[..], &["-o", "walk.csv"]].concat());
    let names = ["viscous", "coulomb", "armature", "bias"];
    let mut found = Vec::new();
    for (file, more) in [
        ("without.toml", &[][..]),
        ("with.toml", &["payload:RR_calf"]),
    ] {
        done(
            folder,
            &[&["add"], &names[..], more, &["-m", file]].concat(),
        );
        let of = ["diagnose", "--free-base", "--json", "walk.csv", "-m", file];
        found.push(json(&done(folder, &of)));
    }
    let step = &steps(&found[0])[0];
    assert_eq!(
        (&step["effect"], &step["joints"][0]),
        (&"payload".into(), &"RR_calf".into()),
        "{step}"
    );
    assert_eq!(found[1]["verdict"], "complete", "{}", found[1]["path"]);
    let [after, with] = [&step["error"], &found[1]["held_out_rms"]].map(number);
    assert!((with / after - 1.0).abs() < 0.02, "{with} {after}");
}
