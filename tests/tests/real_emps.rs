//! A one-axis drive (EMPS, Janot, Gautier & Brunot 2019): what is published of its friction is found from its URDF and one log.

use proprio_tests::command::{done, folder, json, recorded_logs, steps};
use tempfile::TempDir;

/// A folder with `m.toml`, the drive with the four plain effects, and the two logs; none where there are no recorded logs.
fn with_plain_friction() -> Option<(TempDir, [String; 2])> {
    let logs = recorded_logs()?;
    let file = |name: &str| logs.join("emps").join(name).display().to_string();
    let folder = folder();
    let (urdf, plain) = (
        file("emps.urdf"),
        ["viscous", "coulomb", "armature", "bias"],
    );
    let add = ["add", "-m", "m.toml", "--urdf", &urdf];
    done(folder.path(), &[&add[..], &plain].concat());
    Some((folder, ["emps_train.csv", "emps_pulses.csv"].map(file)))
}

/// Its viscous friction differs with the direction; the effect is named first, and a log that no fit has seen is predicted better with it.
#[test]
fn friction_that_differs_with_direction_is_named() {
    let Some((folder, [train, pulses])) = with_plain_friction() else {
        return;
    };
    let folder = folder.path();
    let told = json(&done(
        folder,
        &["diagnose", &train, "-m", "m.toml", "--json"],
    ));
    let first = &steps(&told)[0];
    assert_eq!(first["effect"], "asymmetric_viscous", "{first}");

    let held_out = || {
        done(
            folder,
            &[
                "identify",
                &train,
                "-m",
                "m.toml",
                "-o",
                "fitted.toml",
                "--force",
            ],
        );
        let given = ["compare", &pulses, "-m", "fitted.toml", "--given", "--json"];
        json(&done(folder, &given))["rms"].as_f64().unwrap()
    };
    let before = held_out();
    done(folder, &["add", "asymmetric_viscous", "-m", "m.toml"]);
    let after = held_out();
    assert!(after < 0.9 * before, "{before} N m, {after} N m with it");
}

/// The whole path, from plain friction: the file that `diagnose --apply` writes holds values that may be, and predicts the other log better than
/// plain friction does.
#[test]
fn what_a_diagnosis_writes_predicts_the_other_log() {
    let Some((folder, [train, pulses])) = with_plain_friction() else {
        return;
    };
    let folder = folder.path();
    let held_out = |model: &str| {
        let given = ["compare", &pulses, "-m", model, "--given", "--json"];
        json(&done(folder, &given))["rms"].as_f64().unwrap()
    };
    done(
        folder,
        &["identify", &train, "-m", "m.toml", "-o", "plain.toml"],
    );
    done(folder, &["diagnose", &train, "-m", "m.toml", "--apply"]);
    let (before, after) = (held_out("plain.toml"), held_out("m.toml"));
    println!("{before} N m, {after} N m");
    assert!(after < before, "{before} N m, {after} N m");
}
