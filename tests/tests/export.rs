//! `proprio export`: Pinocchio and MuJoCo get our torques from what it writes, and a user's file changes nowhere else.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use nalgebra::SVector;
use proprio_core::effect::EffectKind;
use proprio_host::log::sha256;
use proprio_host::model::{BASE, Model, Robot};
use proprio_tests::command::{proprio, stderr, stdout};
use serde::Deserialize;
use tempfile::TempDir;

fn oracle(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("oracle")
        .join(name)
}

fn model() -> Model {
    Model::load(&oracle("model.toml")).unwrap()
}

/// A folder with the model and the user's files.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["model.toml", "go2.urdf", "user.xml"] {
        fs::copy(oracle(name), folder.path().join(name)).unwrap();
    }
    folder
}

/// A model in which nothing is identified but what `change` says.
fn model_with(folder: &Path, change: impl FnOnce(&mut Model)) {
    let mut model = Model::default();
    change(&mut model);
    model.save(&folder.join("model.toml")).unwrap();
}

/// What stands where it writes may be replaced.
fn export(folder: &Path, arguments: &[&str]) -> Output {
    let mut all = vec!["export", "-m", "model.toml", "--force"];
    all.extend(arguments);
    proprio(folder, &all)
}

fn exported(folder: &Path, arguments: &[&str]) -> String {
    let output = export(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    stdout(&output)
}

/// The files that Pinocchio and MuJoCo loaded are those that are written today.
#[test]
fn the_oracle_knows_the_files_that_are_written() {
    #[derive(Deserialize)]
    struct Manifest {
        sha256: std::collections::BTreeMap<String, String>,
    }
    let text = fs::read(oracle("export.json")).unwrap();
    let known: Manifest = serde_json::from_slice(&text).unwrap();
    let folder = folder();
    let commands: [(&str, &[&str]); 4] = [
        ("whole.urdf", &["--urdf"]),
        ("user.urdf", &["--urdf", "go2.urdf"]),
        ("whole.xml", &["--mjcf"]),
        ("user.xml", &["--mjcf", "user.xml"]),
    ];
    assert_eq!(known.sha256.len(), commands.len());
    for (name, arguments) in commands {
        let file = folder.path().join("written");
        exported(folder.path(), &[arguments, &["-o", "written"]].concat());
        let hash = sha256(&file).unwrap();
        assert_eq!(
            hash, known.sha256[name],
            "{name} has changed: see tests/oracle/README.md"
        );
    }
}

#[test]
fn pinocchio_and_mujoco_give_our_torques() {
    let model = model();
    let bytes = fs::read(oracle("export.f64")).unwrap();
    let numbers: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()))
        .collect();
    let (mut rigid, mut whole): (f64, f64) = (0.0, 0.0);
    let states: Vec<_> = numbers.chunks_exact(60).collect();
    assert_eq!(states.len(), 50);
    for state in states {
        for limb in model.robot().limbs() {
            let tree = model.limb_tree::<3>(&limb).unwrap();
            let first = limb.bodies.start;
            let part =
                |n: usize| SVector::<f64, 3>::from_column_slice(&state[12 * n + first..][..3]);
            let [q, v, a, pinocchio, mujoco] = [0, 1, 2, 3, 4].map(part);
            let k = tree.kinematics(&model.base(), &q, &v);
            let tau = tree.inverse_dynamics(&k, &v, &a);
            rigid = rigid.max((tau - pinocchio).amax());
            let effects = SVector::<f64, 3>::from_fn(|n, _| {
                let value = |effect| {
                    let of_joint = model.effect(effect, first + n).unwrap();
                    of_joint.estimate().unwrap().value
                };
                value(EffectKind::Viscous) * v[n]
                    + value(EffectKind::Coulomb) * v[n].signum()
                    + value(EffectKind::Armature) * a[n]
            });
            whole = whole.max((tau + effects - mujoco).amax());
        }
    }
    println!("largest difference of a torque: Pinocchio {rigid:.1e} N m, MuJoCo {whole:.1e} N m");
    assert!(rigid <= 1e-9, "{rigid}");
    assert!(whole <= 1e-8, "{whole}");
}

#[test]
fn what_is_not_identified_stays_byte_for_byte() {
    let folder = folder();
    model_with(folder.path(), |_| {});
    for (format, name) in [("--urdf", "go2.urdf"), ("--mjcf", "user.xml")] {
        let text = fs::read_to_string(oracle(name)).unwrap();
        let mangled = text.replace('\n', "\r\n").replace("  ", "\t");
        for text in [text, mangled] {
            fs::write(folder.path().join(name), &text).unwrap();
            assert_eq!(exported(folder.path(), &[format, name]), text);
        }
    }
}

#[test]
fn one_effect_is_one_attribute() {
    let folder = folder();
    model_with(folder.path(), |model| {
        model
            .set_effect(EffectKind::Coulomb, 4, 0.25, None)
            .unwrap();
    });
    let urdf = fs::read_to_string(oracle("go2.urdf")).unwrap();
    // FL_thigh's joint, the fifth in SDK order.
    let limit =
        "    <limit lower=\"-1.5708\" upper=\"3.4907\" effort=\"23.7\" velocity=\"30.1\"/>\n";
    let dynamics = "    <dynamics friction=\"0.25\"/>\n";
    let expected = urdf.replacen(limit, &format!("{limit}{dynamics}"), 1);
    let written = exported(folder.path(), &["--urdf", "go2.urdf"]);
    assert_eq!(written, expected);
    // Once more, into the element that is there now, and in place.
    fs::write(folder.path().join("go2.urdf"), &written).unwrap();
    model_with(folder.path(), |model| {
        model
            .set_effect(EffectKind::Viscous, 4, 0.03, None)
            .unwrap();
        model.set_effect(EffectKind::Coulomb, 4, 0.5, None).unwrap();
    });
    exported(folder.path(), &["--urdf", "go2.urdf", "-o", "go2.urdf"]);
    let again = fs::read_to_string(folder.path().join("go2.urdf")).unwrap();
    let both = "    <dynamics friction=\"0.5\" damping=\"0.03\"/>\n";
    assert_eq!(again, expected.replace(dynamics, both));

    model_with(folder.path(), |model| {
        model
            .set_effect(EffectKind::Armature, 3, 0.005, None)
            .unwrap();
    });
    let xml = fs::read_to_string(oracle("user.xml")).unwrap();
    let expected = xml.replace("armature = '0.01'", "armature = '0.005'");
    assert_ne!(expected, xml);
    assert_eq!(exported(folder.path(), &["--mjcf", "user.xml"]), expected);
}

/// What a drive gives at most is the limit of effort that simulators hold it to; without velocity's URDF has none.
#[test]
fn a_saturation_is_a_limit_of_effort() {
    let folder = folder();
    model_with(folder.path(), |model| {
        model
            .set_effect(EffectKind::Saturation, 4, 17.5, Some(0.2))
            .unwrap();
        model
            .set_effect(EffectKind::Viscous, 4, 0.03, None)
            .unwrap();
    });
    let urdf = fs::read_to_string(oracle("go2.urdf")).unwrap();
    let limit =
        "    <limit lower=\"-1.5708\" upper=\"3.4907\" effort=\"23.7\" velocity=\"30.1\"/>\n";
    let ours = limit.replace("23.7", "17.5") + "    <dynamics damping=\"0.03\"/>\n";
    assert!(urdf.contains(limit));
    let written = exported(folder.path(), &["--urdf", "go2.urdf"]);
    assert_eq!(written, urdf.replacen(limit, &ours, 1));
    let whole = exported(folder.path(), &["--urdf"]);
    let whole_limit = "upper=\"3.4907\" effort=\"17.5\" velocity=\"30.1\"/>";
    assert_eq!(whole.matches("effort=\"17.5\"").count(), 1);
    assert!(whole.contains(whole_limit), "{whole}");
    let path = folder.path().join("limited.urdf");
    fs::write(&path, &written).unwrap();
    let limited = Robot::from_urdf(&path).unwrap();
    let mut bodies = limited.bodies().iter();
    let thigh = bodies.find(|body| body.joint_name == "FL_thigh_joint");
    assert_eq!(thigh.unwrap().effort, 17.5);

    let unlimited = urdf.replacen(limit, "", 1);
    assert_ne!(unlimited, urdf);
    let unlimited = unlimited.replacen(
        "<joint name=\"FL_thigh_joint\" type=\"revolute\">",
        "<joint name=\"FL_thigh_joint\" type=\"continuous\">",
        1,
    );
    fs::write(folder.path().join("go2.urdf"), unlimited).unwrap();
    let output = export(folder.path(), &["--urdf", "go2.urdf", "-o", "out.urdf"]);
    assert_eq!(
        stderr(&output),
        "note: left out: saturation (FL_thigh): the joint has no <limit>, which needs a\n  velocity too\n"
    );
    assert_eq!(stdout(&output), "Wrote out.urdf: 1 effect.\n");
}

/// A walk's trunk goes into the user's own file, less what the file fixes to it; a model's base without a body in the file is named.
#[test]
fn a_trunk_is_written_into_the_users_file() {
    let folder = folder();
    let mut trunk = *Robot::go2().base_inertia();
    trunk.0 *= 1.25;
    model_with(folder.path(), |model| {
        model.set_body(BASE, &trunk, None).unwrap();
    });
    let output = export(folder.path(), &["--urdf", "go2.urdf", "-o", "out.urdf"]);
    assert_eq!(stdout(&output), "Wrote out.urdf: 1 body.\n");
    let robot = Robot::from_urdf(&folder.path().join("out.urdf")).unwrap();
    assert!((robot.base_inertia().0 - trunk.0).amax() < 1e-9);

    let own = fs::read_to_string(oracle("user.xml")).unwrap();
    let written = exported(folder.path(), &["--mjcf", "user.xml"]);
    let masses = |text: &str| -> Vec<f64> {
        let all = text.split(" mass=\"").skip(1);
        all.map(|rest| rest.split('"').next().unwrap().parse().unwrap())
            .collect()
    };
    let (own, written) = (masses(&own), masses(&written));
    // The first is the trunk's own; what it carries without joints and all else is as it was.
    assert_eq!(own[1..], written[1..]);
    let carried = Robot::go2().base_inertia().mass() - own[0];
    assert!(
        (written[0] + carried - trunk.mass()).abs() < 1e-9,
        "{written:?}"
    );
}

/// The first body of a file is changed, the rest of the file is not.
#[test]
fn one_body_is_one_inertial() {
    let folder = folder();
    let phi = *model().inertia(3);
    model_with(folder.path(), |model| {
        model.set_body(3, &phi, None).unwrap()
    });
    for (format, name, element) in [
        ("--urdf", "go2.urdf", "<link name=\"FL_hip\">"),
        ("--mjcf", "user.xml", "<body name=\"FL_hip\""),
    ] {
        let text = fs::read_to_string(oracle(name)).unwrap();
        let written = exported(folder.path(), &[format, name]);
        let (start, rest) = text.split_once(element).unwrap();
        let end = match format {
            "--urdf" => &rest[rest.find("</inertial>").unwrap()..],
            _ => &rest[rest.find("/>").unwrap()..],
        };
        assert!(
            written.starts_with(start) && written.ends_with(end),
            "{name}"
        );
        let changed = &written[start.len()..written.len() - end.len()];
        assert!(changed.lines().count() <= 6, "{changed}");
        assert!(!changed.contains("quat"), "{changed}");
    }
}

#[test]
fn what_a_format_cannot_say_is_said() {
    let folder = folder();
    model_with(folder.path(), |model| {
        model.set_effect(EffectKind::Bias, 0, -0.1, None).unwrap();
        model
            .set_effect(EffectKind::Armature, 0, 0.005, None)
            .unwrap();
        model.add_effect(EffectKind::Coulomb, 2);
    });
    let output = export(folder.path(), &["--urdf", "-o", "out.urdf"]);
    assert_eq!(stdout(&output), "Wrote out.urdf: 13 bodies.\n");
    assert_eq!(
        stderr(&output),
        "note: left out: armature (FR_hip), bias (FR_hip): URDF has no word for it\n\
         note: left out: coulomb (FR_calf): no value yet, identify the model first\n"
    );
    let report = exported(folder.path(), &["--mjcf", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["effects"], serde_json::json!(["armature:FR_hip"]));
    assert_eq!(report["notes"].as_array().unwrap().len(), 2);
    assert!(report["text"].as_str().unwrap().starts_with("<mujoco"));
}

/// A fit that ends where an effect is absent has found none: the file keeps its own value. Zero that somebody states is one.
#[test]
fn a_zero_that_is_no_finding_is_not_written() {
    let folder = folder();
    model_with(folder.path(), |model| {
        for (joint, value, std) in [
            (3, 0.0, Some(0.002)),
            (4, 0.0, Some(0.002)),
            (5, 0.004, Some(0.003)),
        ] {
            model
                .set_effect(EffectKind::Armature, joint, value, std)
                .unwrap();
        }
        model.set_effect(EffectKind::Coulomb, 3, 0.0, None).unwrap();
    });
    let output = export(folder.path(), &["--mjcf", "user.xml"]);
    let written = stdout(&output);
    // FL_hip, which the file gives a rotor.
    assert!(written.contains("armature = '0.01'"), "{written}");
    assert!(
        written.contains("frictionloss=\"0\"") && written.contains("armature=\"0.004\""),
        "{written}"
    );
    assert_eq!(
        stderr(&output),
        "note: left out: armature (FL_hip, FL_thigh): the fit found none\n"
    );
    let whole = exported(folder.path(), &["--mjcf", "--json"]);
    let whole: serde_json::Value = serde_json::from_str(&whole).unwrap();
    assert_eq!(
        whole["effects"],
        serde_json::json!(["coulomb:FL_hip", "armature:FL_calf"])
    );
    assert!(!whole["text"].as_str().unwrap().contains("armature=\"0\""));
}

/// What is written into a URDF, whole or the user's with its fixed feet and rotors, is what is read from it.
#[test]
fn an_exported_urdf_reads_back() {
    let folder = folder();
    let model = model();
    for input in [&["--urdf"][..], &["--urdf", "go2.urdf"]] {
        exported(folder.path(), &[input, &["-o", "out.urdf"]].concat());
        let robot = Robot::from_urdf(&folder.path().join("out.urdf")).unwrap();
        assert_eq!(robot.bodies().len(), 12);
        for (b, ours) in model.robot().bodies().iter().enumerate() {
            let theirs = &robot.bodies()[robot.joint(&ours.name).unwrap()];
            assert_eq!(theirs.limits, ours.limits);
            assert!((theirs.inertia.0 - model.inertia(b).0).amax() < 1e-12);
        }
    }
}

/// The message about a file of the user's in which `from` has become `to`, and that nothing was written.
fn refused(format: &str, name: &str, from: &str, to: &str) -> String {
    let folder = folder();
    let path = folder.path().join(name);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    fs::write(folder.path().join("out"), "old").unwrap();
    let entries = || fs::read_dir(folder.path()).unwrap().count();
    let before = entries();
    let output = export(folder.path(), &[format, name, "-o", "out"]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!((stdout(&output).as_str(), entries()), ("", before));
    assert_eq!(
        fs::read_to_string(folder.path().join("out")).unwrap(),
        "old"
    );
    assert!(message.contains("\nhint: "), "{message}");
    message
}

#[test]
fn a_file_that_cannot_hold_the_model_is_refused() {
    let urdf = |from, to| refused("--urdf", "go2.urdf", from, to);
    let mjcf = |from, to| refused("--mjcf", "user.xml", from, to);
    let foot = "<inertial pos=\"0 0 0\" mass=\"0.04\" diaginertia=\"9.6e-06 9.6e-06 9.6e-06\"/>";
    let messages = [
        urdf("name=\"FL_hip_joint\"", "name=\"front_left_joint\""),
        urdf("0.1934 0.0465 0", "0.19 0.0465 0"),
        urdf("<axis xyz=\"1 0 0\"", "<axis xyz=\"-1 0 0\""),
        urdf("<mass value=\"0.04\"", "<mass value=\"4\""),
        urdf("</robot>", ""),
        urdf("type=\"revolute\"", "type=\"revolut\""),
        mjcf("name='FL_hip_joint'", "name='hip'"),
        mjcf("pos=\"0.1934 0.0465 0\"", "pos=\"0.1934 0.04 0\""),
        mjcf("pos=\"0 0.0955 0\"", "pos=\"0 0.0955 0\" quat=\"0 1 0 0\""),
        mjcf("pos=\"0 0.0955 0\"", "pos=\"0 0.0955 0\" euler=\"0 0 1\""),
        mjcf(
            "range=\"-1.0472 1.0472\" actuatorfrcrange=\"-23.7 23.7\" axis=\"1 0 0\"",
            "axis=\"0 0 1\"",
        ),
        mjcf("mass=\"0.04\"", "mass=\"4\""),
        mjcf(foot, "<geom type=\"sphere\" size=\"0.02\"/>"),
        mjcf(
            "angle=\"radian\"",
            "angle=\"radian\" inertiafromgeom=\"true\"",
        ),
        mjcf("angle=\"radian\"", "settotalmass=\"15\""),
        mjcf(
            "<joint name='FL_hip_joint'",
            "<joint name='extra'/><joint name='FL_hip_joint'",
        ),
        mjcf("mass=\"0.04\"", "mass=\"heavy\""),
        mjcf("<body name=\"base\">", ""),
        refused("--mjcf", "go2.urdf", "go2", "go2"),
        refused("--urdf", "user.xml", "go2", "go2"),
    ];
    insta::assert_snapshot!(messages.join("\n"));
}

#[test]
fn exporting_needs_one_format() {
    let folder = folder();
    for arguments in [&[][..], &["--urdf", "--mjcf"]] {
        assert_eq!(export(folder.path(), arguments).status.code(), Some(2));
    }
}
