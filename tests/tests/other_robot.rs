//! Robots that are no Go2: from a URDF and a log to parameters and to what is missing, by the command line.
//!
//! The logs are [`Recorder`]'s: not made with the identification's columns.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use proprio_host::model::{Limb, Robot};
use proprio_tests::command::{
    done, folder, json, parameter, proprio, refusal, stderr, stdout, steps,
};
use proprio_tests::recorder::{Recorder, TORQUE_STEP};
use serde_json::Value;

pub(crate) const ARM: &str = include_str!("../robots/arm.urdf");
const BIPED: &str = include_str!("../robots/biped.urdf");
pub(crate) const TYPICAL: [&str; 4] = ["viscous", "coulomb", "armature", "bias"];

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key}: {value}"))
}

/// A folder with the robot's URDF and a model file with `effects` at every joint.
pub(crate) fn with_model(urdf: &str, effects: &[&str]) -> tempfile::TempDir {
    let folder = folder();
    fs::write(folder.path().join("robot.urdf"), urdf).unwrap();
    let fixed = ["add", "-m", "model.toml", "--urdf", "robot.urdf"];
    done(folder.path(), &[&fixed[..], effects].concat());
    folder
}

pub(crate) fn robot(folder: &Path) -> Robot {
    Robot::from_urdf(&folder.join("robot.urdf")).unwrap()
}

/// The estimate of each effect lies within its error of the truth, and the error is small enough to say something.
fn assert_identified(told: &Value, recorder: &Recorder, limbs: &[&Limb]) {
    let bodies = recorder.model.robot().bodies();
    for joint in limbs.iter().flat_map(|limb| limb.bodies.clone()) {
        for effect in TYPICAL {
            let truth = recorder.motors[joint].value(effect);
            let estimate = parameter(told, &format!("{effect}:{}", bodies[joint].name));
            let (value, std) = (number(estimate, "value"), number(estimate, "std"));
            // Of 216 estimates with six seeds 3 were beyond 2 σ and none beyond 3.
            let off = (value - truth).abs();
            assert!(off < 4.0 * std, "{truth}: {estimate}");
            if ["viscous", "coulomb"].contains(&effect) {
                assert!(std < 0.1 * truth, "{truth}: {estimate}");
            }
        }
    }
}

/// An arm with a turntable and a sliding rod is identified, and the model that comes out predicts its log.
#[test]
fn an_arm_is_identified_from_its_urdf_and_a_log() {
    let folder = with_model(ARM, &TYPICAL);
    let folder = folder.path();
    let recorder = Recorder::new(robot(folder));
    let limbs = recorder.model.robot().limbs();
    let limbs: Vec<&Limb> = limbs.iter().collect();
    fs::write(folder.join("log.csv"), recorder.log::<4>(&limbs)).unwrap();

    let fit = [
        "identify",
        "log.csv",
        "-m",
        "model.toml",
        "-o",
        "fitted.toml",
        "--json",
    ];
    let told = json(&done(folder, &fit));
    assert_identified(&told, &recorder, &limbs);

    let compare = [
        "compare",
        "log.csv",
        "-m",
        "fitted.toml",
        "--json",
        "--html",
        "report.html",
    ];
    let compared = json(&done(folder, &compare));
    let [rms, cad, above] = ["rms", "cad_rms", "above_noise_percent"].map(|k| number(&compared, k));
    assert!(rms < 0.1 * cad && above < 5.0, "{rms} {cad} {above}");
    let gates = &compared["data"][0];
    assert_eq!(gates["findings"], serde_json::json!([]));
    for joint in gates["joints"].as_array().unwrap() {
        let step = joint["quantum"][2].as_f64().unwrap();
        assert!((step / TORQUE_STEP - 1.0).abs() < 0.01, "{joint}");
    }
    let joints: Vec<&str> = compared["joints"]
        .as_array()
        .unwrap()
        .iter()
        .map(|joint| joint["joint"].as_str().unwrap())
        .collect();
    assert_eq!(joints, ["yaw", "shoulder", "elbow", "slide"]);
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(joints.iter().all(|joint| page.contains(joint)));

    let text = done(
        folder,
        &[
            "identify",
            "log.csv",
            "-m",
            "model.toml",
            "--base",
            "--verbose",
        ],
    );
    for joint in joints {
        assert!(text.lines().any(|line| line.starts_with(joint)), "{text}");
    }
}

/// A spring at the elbow, which the model lacks, is named with its stiffness.
#[test]
fn a_spring_at_an_arms_elbow_is_named() {
    let folder = with_model(ARM, &TYPICAL);
    let folder = folder.path();
    let mut recorder = Recorder::new(robot(folder));
    recorder.motor("elbow").spring = [1.2, 0.3];
    let limbs = recorder.model.robot().limbs();
    let limbs: Vec<&Limb> = limbs.iter().collect();
    fs::write(folder.join("log.csv"), recorder.log::<4>(&limbs)).unwrap();
    assert_named(folder, "spring", "elbow", 1.2);
}

/// Of a biped whose left leg was not recorded, the right one is judged: Coulomb friction at its knee is named.
#[test]
fn dry_friction_at_a_bipeds_knee_is_named() {
    let folder = with_model(BIPED, &["viscous", "armature", "bias"]);
    let folder = folder.path();
    let mut recorder = Recorder::new(robot(folder));
    recorder
        .motors
        .iter_mut()
        .for_each(|motor| motor.coulomb = 0.0);
    recorder.motor("right_knee").coulomb = 0.5;
    let limbs = recorder.model.robot().limbs();
    let right = limbs.iter().find(|limb| limb.name == "right").unwrap();
    fs::write(folder.join("log.csv"), recorder.log::<4>(&[right])).unwrap();
    assert_named(folder, "coulomb", "right_knee", 0.5);
}

/// `diagnose` names the effect at the joint first, and its value within its error; added and fitted, nothing more is missing.
fn assert_named(folder: &Path, effect: &str, joint: &str, truth: f64) {
    let told = json(&done(
        folder,
        &["diagnose", "log.csv", "-m", "model.toml", "--json"],
    ));
    assert_eq!(told["verdict"], "missing", "{told}");
    let first = &steps(&told)[0];
    assert_eq!(
        (&first["effect"], &first["joints"]),
        (&effect.into(), &[joint].as_slice().into())
    );
    let best = &told["candidates"][0];
    assert_eq!(
        (&best["effect"], &best["joints"]),
        (&effect.into(), &[joint].as_slice().into())
    );
    let off = number(best, "value") - truth;
    assert!(off.abs() < 5.0 * number(best, "std"), "{best}");

    done(
        folder,
        &["add", &format!("{effect}:{joint}"), "-m", "model.toml"],
    );
    let compared = json(&done(
        folder,
        &["compare", "log.csv", "-m", "model.toml", "--json"],
    ));
    assert!(
        number(&compared, "rms") < 0.5 * number(&compared, "before_rms"),
        "{compared}"
    );
    let told = json(&done(
        folder,
        &["identify", "log.csv", "-m", "model.toml", "--json"],
    ));
    let estimate = parameter(&told, &format!("{effect}:{joint}"));
    let off = number(estimate, "value") - truth;
    assert!(off.abs() < 5.0 * number(estimate, "std"), "{estimate}");
}

/// A trunk that carries two arms is one limb, a tree.
#[test]
fn a_limb_that_branches_is_identified() {
    let folder = with_model(BIPED, &TYPICAL);
    let folder = folder.path();
    let recorder = Recorder::new(robot(folder));
    let limbs = recorder.model.robot().limbs();
    let trunk = limbs.iter().find(|limb| limb.bodies.len() == 5).unwrap();
    fs::write(folder.join("log.csv"), recorder.log::<5>(&[trunk])).unwrap();
    let told = json(&done(
        folder,
        &["identify", "log.csv", "-m", "model.toml", "--json"],
    ));
    assert_identified(&told, &recorder, &[trunk]);
}

/// A chain of `count` joints, `PREFIX1` and on, as the links and joints of a URDF.
fn chain(prefix: &str, count: usize) -> String {
    let mut text = String::new();
    for n in 1..=count {
        let parent = match n {
            1 => "base".to_owned(),
            n => format!("{prefix}_link{}", n - 1),
        };
        let axis = ["0 0 1", "0 1 0"][n % 2];
        write!(
            text,
            r#"<link name="{prefix}_link{n}"><inertial><origin xyz="0.05 0 0"/><mass value="1"/>
            <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
            <joint name="{prefix}{n}" type="revolute"><parent link="{parent}"/><child link="{prefix}_link{n}"/>
            <origin xyz="0.1 0 0"/><axis xyz="{axis}"/>
            <limit lower="-1" upper="1" effort="10000" velocity="10"/></joint>"#
        )
        .unwrap();
    }
    text
}

/// The message of `compare`, which must refuse the log and say what to do.
fn refused(folder: &Path, log: &str) -> String {
    fs::write(folder.join("log.csv"), log).unwrap();
    let message = refusal(folder, &["compare", "log.csv", "-m", "model.toml"]);
    assert!(message.starts_with("error: log.csv"), "{message}");
    assert!(message.contains("\nhint: "), "{message}");
    message
}

/// Limbs of more than sixteen joints: refused if there is nothing else, else left out with a warning.
#[test]
fn a_limb_that_is_too_large_is_named() {
    let urdf = format!(
        r#"<robot name="snake"><link name="base"/>{}{}</robot>"#,
        chain("tail", 17),
        chain("neck", 1)
    );
    let folder = with_model(&urdf, &["viscous"]);
    let folder = folder.path();
    let recorder = Recorder::new(robot(folder));
    let limbs = recorder.model.robot().limbs();
    let [tail, neck] = &limbs[..] else {
        panic!("{limbs:?}")
    };
    let alone = recorder.log::<17>(&[tail]);
    let message = refused(folder, &alone);
    let expected = "limb tail has 17 joints; limbs of at most 16 can be judged";
    assert!(message.contains(expected), "{message}");

    let other = recorder.log::<1>(&[neck]);
    let both = alone.lines().zip(other.lines());
    // Without the other's note and time.
    let rest = |line: &str| line.splitn(3, ',').last().unwrap().to_owned();
    let both: String = both.map(|(a, b)| format!("{a},{}\n", rest(b))).collect();
    fs::write(folder.join("log.csv"), both).unwrap();
    let output = proprio(
        folder,
        &["compare", "log.csv", "-m", "model.toml", "--json"],
    );
    let joints = json(&stdout(&output))["joints"].as_array().unwrap().len();
    assert_eq!(joints, 1);
    let warning = "warning: limb tail is left out: it has 17 joints, and at most 16 can be judged";
    assert!(stderr(&output).contains(warning), "{}", stderr(&output));
}

/// What is wrong with another robot's log is told with the place and the fix, as with a Go2's.
#[test]
fn a_bad_log_of_another_robot_is_refused_with_its_place_and_the_fix() {
    let folder = with_model(ARM, &["viscous"]);
    let folder = folder.path();
    let mut recorder = Recorder::new(robot(folder));
    recorder.duration = 1.0;
    let limbs = recorder.model.robot().limbs();
    let good = recorder.log::<4>(&[&limbs[0]]);
    let (header, rows) = good.split_once('\n').unwrap();
    // Elbow and slide are the columns from the third on, three each: slide, elbow, shoulder, yaw.
    let degrees: String = rows
        .lines()
        .map(|row| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            for column in [6, 9, 12] {
                let q: f64 = cells[column].parse().unwrap();
                cells[column] = q.to_degrees().to_string();
            }
            cells.join(",") + "\n"
        })
        .collect();
    let all_other = ["yaw", "shoulder", "elbow", "slide"]
        .into_iter()
        .fold(good.clone(), |log, joint| {
            log.replace(&format!("/{joint}"), &format!("/left_{joint}"))
        });
    for (log, place, fault, fix) in [
        (
            good.replace("dq/elbow", "dq/elbw"),
            "line 1, column 8 (dq/elbw)",
            "the robot `arm` has no joint or limb `elbw`",
            "did you mean `dq/elbow`?",
        ),
        (
            good.replace("tau/elbow", "elbow's torque"),
            "line 1, column 7 (q/elbow)",
            "elbow is recorded without its torque: there is no `tau/elbow`",
            "record `tau/elbow` too",
        ),
        (
            good.replace("/slide", "s slide"),
            "line 1, column 13 (q/yaw)",
            "limb yaw has yaw but not slide",
            "record slide too",
        ),
        (
            all_other,
            "line 1, column 3 (tau/left_slide)",
            "`left_slide` is no joint of the robot `arm`",
            "its joints are yaw, shoulder, elbow, slide; for another robot name its model",
        ),
        (
            format!("{header}\n{degrees}"),
            "(q/shoulder)",
            "shoulder is outside its limits (-2.000 to 1.500 rad)",
            "multiply both by π/180",
        ),
    ] {
        let message = refused(folder, &log);
        for expected in [place, fault, fix] {
            assert!(message.contains(expected), "{expected}: {message}");
        }
    }
}
