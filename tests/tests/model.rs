//! Model files and robots as their user meets them: `proprio add`, and every way in which a model or a URDF can be bad.

use std::fs;
use std::path::Path;

use proprio_core::go2;
use proprio_host::model::{Model, Robot};
use proprio_tests::command::{folder, proprio, refusal, stderr, stdout};

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = proprio(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    stdout(&output)
}

/// The message of a command that must refuse and leave the folder as it was.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let files = || {
        let entries = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        let files = entries.filter(|path| path.is_file());
        let mut contents: Vec<_> = files.map(|path| (fs::read(&path).ok(), path)).collect();
        contents.sort();
        contents
    };
    let before = files();
    let message = refusal(folder, arguments);
    assert_eq!(files(), before, "a file has changed");
    assert!(message.contains("\nhint: "), "{message}");
    message
}

#[test]
fn the_urdf_of_the_go2_is_the_go2() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/go2.urdf");
    let (theirs, ours) = (Robot::from_urdf(&path).unwrap(), Robot::go2());
    assert_eq!(theirs.limbs().len(), 4);
    assert_eq!(theirs.limbs()[0].name, "FL");
    for name in go2::JOINT_NAMES {
        let of = |robot: &Robot| robot.bodies()[robot.joint(name).unwrap()].clone();
        let (theirs, mut ours) = (of(&theirs), of(&ours));
        assert!((theirs.inertia.0 - ours.inertia.0).amax() < 1e-15, "{name}");
        assert!((theirs.placement.translation - ours.placement.translation).amax() < 1e-15);
        ours.inertia = theirs.inertia;
        ours.placement = theirs.placement;
        ours.parent = theirs.parent;
        assert_eq!(theirs, ours);
    }
    assert!((theirs.base_inertia().mass() - ours.base_inertia().mass()).abs() < 1e-12);
}

#[test]
fn adding_makes_a_model_and_twice_changes_nothing() {
    let folder = folder();
    let text = || fs::read_to_string(folder.path().join("m.toml")).unwrap();
    let first = done(
        folder.path(),
        &["add", "coulomb:FR_calf", "viscous", "-m", "m.toml"],
    );
    assert_eq!(
        first,
        "m.toml is new.\nAdded to m.toml: coulomb:FR_calf, viscous (all joints)\n"
    );
    let model = Model::load(&folder.path().join("m.toml")).unwrap();
    assert_eq!(model.effects().len(), 13);
    let before = text();
    let again = done(folder.path(), &["add", "coulomb:FR_calf", "-m", "m.toml"]);
    assert_eq!(again, "Already in m.toml, unchanged: coulomb:FR_calf\n");
    assert_eq!(text(), before);
    let report = done(folder.path(), &["add", "coulomb", "--json", "-m", "m.toml"]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["added"].as_array().unwrap().len(), 11);
    assert_eq!(report["present"], serde_json::json!(["coulomb:FR_calf"]));
    assert_eq!(report["created"], false);
}

/// A model of a URDF finds it from wherever the two lie.
#[test]
fn a_model_of_a_urdf_names_it_from_its_own_folder() {
    let folder = folder();
    fs::create_dir_all(folder.path().join("robots/arm")).unwrap();
    fs::create_dir_all(folder.path().join("models")).unwrap();
    fs::write(folder.path().join("robots/arm/arm.urdf"), ARM).unwrap();
    let urdf = "robots/arm/arm.urdf";
    done(
        folder.path(),
        &[
            "add",
            "coulomb:lift",
            "-m",
            "models/arm.toml",
            "--urdf",
            urdf,
        ],
    );
    let text = fs::read_to_string(folder.path().join("models/arm.toml")).unwrap();
    assert!(text.contains("urdf = \"../robots/arm/arm.urdf\""), "{text}");
    let away = folder.path().join("robots");
    done(&away, &["add", "armature", "-m", "../models/arm.toml"]);
    let model = Model::load(&folder.path().join("models/arm.toml")).unwrap();
    assert_eq!(model.effects().len(), 4);
    let limbs = model.robot().limbs();
    assert_eq!((limbs.len(), limbs[0].bodies.clone()), (1, 0..3));
    // The tool, fixed to the slide half a turn about z, is lumped.
    let slide = &model.robot().bodies()[1];
    assert_eq!(slide.inertia.mass(), 3.0);
    assert!((slide.inertia.first_moment().x - (2.0 * 0.1 - 1.0 * 0.2)).abs() < 1e-12);
    assert_eq!(slide.limits, [0.0, 0.5]);
    // Without a motor the rotor may be as heavy as what the joint moves, or as much as leaves the drive a second to reach
    // its greatest velocity.
    let armature = model.effect_prior(proprio_core::effect::EffectKind::Armature, 1);
    assert_eq!((armature.prior.mean, armature.prior.std), (0.0, 10.0));
    // Written where the URDF is found, and nowhere else.
    let output = done(&away, &["export", "-m", "../models/arm.toml", "--urdf"]);
    assert_eq!(output, ARM);
    refused(
        &away,
        &[
            "add",
            "bias",
            "-m",
            "../models/arm.toml",
            "--urdf",
            "arm/arm.urdf",
        ],
    );
}

/// A link that only carries others weighs nothing itself in many a URDF. What moves is the sum, which is all that motion
/// could tell: it must be able to exist, its parts need not weigh anything.
#[test]
fn a_link_without_mass_that_carries_a_load_is_the_load() {
    let folder = folder();
    let slider = "<mass value=\"2\"/>\n    <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/>";
    let nothing = "<mass value=\"0\"/>\n    <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>";
    assert!(ARM.contains(slider));
    let add = ["add", "bias", "-m", "m.toml", "--urdf", "arm.urdf"];
    fs::write(folder.path().join("arm.urdf"), ARM.replace(slider, nothing)).unwrap();
    done(folder.path(), &add);
    let model = Model::load(&folder.path().join("m.toml")).unwrap();
    let slide = &model.robot().bodies()[1];
    // The tool alone, half a turn about z.
    assert_eq!(slide.inertia.mass(), 1.0);
    assert!((slide.inertia.first_moment().x + 0.2).abs() < 1e-12 && slide.inertia.is_physical());
    // With nothing to carry it is no body.
    let empty = ARM
        .replace(slider, nothing)
        .replace("<mass value=\"1\"/>", "<mass value=\"0\"/>");
    fs::write(folder.path().join("arm.urdf"), empty).unwrap();
    let message = refused(
        folder.path(),
        &["add", "bias", "-m", "n.toml", "--urdf", "arm.urdf"],
    );
    assert!(message.contains("link `slider`"), "{message}");
}

#[test]
fn a_name_that_does_not_exist_brings_the_nearest() {
    let folder = folder();
    let add = |what| refused(folder.path(), &["add", what, "-m", "m.toml"]);
    assert!(
        add("coulom").ends_with("hint: did you mean `coulomb`? `proprio effects` lists them all\n")
    );
    assert!(add("coulomb:FR_knee").ends_with("hint: did you mean `FR_calf`?\n"));
    assert!(
        add("friction").starts_with("error: there is no effect `friction`; of 32 the nearest are ")
    );
    // A walk finds a payload of the base; in a model file it is the base's own inertia.
    let base = add("payload:base");
    assert!(base.contains("`[body.base]`"), "{base}");
    assert!(
        base.ends_with(
            "diagnose --free-base LOG -m m.toml --apply` finds it on a walk and adds it there\n"
        ),
        "{base}"
    );
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn each_bad_model_is_refused_with_its_place_and_the_fix() {
    let folder = folder();
    done(folder.path(), &["add", "coulomb:FR_hip", "-m", "m.toml"]);
    let good = fs::read_to_string(folder.path().join("m.toml")).unwrap();
    let body = "[body.FR_hip]\nm = 0.5\nhx = 0\nhy = 0\nhz = 0\nIxx = 1e-3\nIxy = 0\nIxz = 0\nIyy = 1e-3\nIyz = 0\nIzz = 3e-3\n";
    let changed = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1)
    };
    let cases = [
        ("newer", changed("format = 1", "format = 2")),
        ("not a model", "[package]\nname = \"x\"\n".to_owned()),
        ("not TOML", changed("[robot]", "[robot")),
        ("unknown key", changed("joint =", "jiont =")),
        ("unknown table", changed("[base]", "[bas]")),
        ("unknown joint", changed("FR_hip", "FR_knee")),
        ("unknown effect", changed("\"coulomb\"", "\"coulumb\"")),
        ("unknown robot", changed("\"go2\"", "\"go1\"")),
        (
            "absent URDF",
            changed("builtin = \"go2\"", "urdf = \"absent.urdf\""),
        ),
        (
            "no orientation",
            changed("rpy = [0.0, 0.0, 0.0]", "quaternion = [0, 0, 0, 0]"),
        ),
        (
            "twice",
            format!("{good}{}", &good[good.find("[[effect]]").unwrap()..]),
        ),
        ("negative friction", format!("{good}value = -0.1\n")),
        ("std without value", format!("{good}std = 0.1\n")),
        (
            "unphysical prior",
            format!("{good}prior = {{ mean = -0.2, std = 0.1 }}\n"),
        ),
        (
            "certain prior",
            format!("{good}prior = {{ mean = 0.2, std = 0.0 }}\n"),
        ),
        (
            "unphysical uncertainty",
            changed("cad_uncertainty = 0.1", "cad_uncertainty = -0.1"),
        ),
        ("unphysical body", format!("{good}\n{body}")),
        (
            "massless body",
            format!("{good}\n{}", body.replace("m = 0.5", "m = 0")),
        ),
        (
            "incomplete body",
            format!("{good}\n{}", body.replace("Izz", "# Izz")),
        ),
    ];
    let mut texts = String::new();
    for (what, text) in cases {
        fs::write(folder.path().join("m.toml"), text).unwrap();
        let message = refused(folder.path(), &["add", "bias", "-m", "m.toml"]);
        assert!(message.starts_with("error: m.toml"), "{message}");
        texts += &format!("{what}\n{message}\n");
    }
    fs::write(folder.path().join("m.toml"), [0xff, 0xfe]).unwrap();
    texts += &refused(folder.path(), &["add", "bias", "-m", "m.toml"]);
    fs::create_dir(folder.path().join("directory")).unwrap();
    texts += &refused(folder.path(), &["add", "bias", "-m", "directory"]);
    insta::assert_snapshot!(texts);
}

/// A lift, a slide on it with a tool fixed half a turn about, and a wrist.
const ARM: &str = r#"<robot name="arm">
  <link name="floor"/>
  <link name="column"><inertial><origin xyz="0 0 0.5"/><mass value="5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.05"/></inertial></link>
  <link name="slider"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="tool"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="hand"><inertial><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="lift" type="continuous"><parent link="floor"/><child link="column"/><axis xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic"><parent link="column"/><child link="slider"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" effort="10" velocity="1"/></joint>
  <joint name="grip" type="fixed"><origin rpy="0 0 3.14159265358979"/><parent link="slider"/><child link="tool"/></joint>
  <joint name="wrist" type="revolute"><parent link="tool"/><child link="hand"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
</robot>
"#;

#[test]
fn each_bad_urdf_is_refused_with_its_place_and_the_fix() {
    let folder = folder();
    let changed = |from: &str, to: &str| {
        assert!(ARM.contains(from), "{from}");
        ARM.replacen(from, to, 1)
    };
    let cases = [
        (
            "zero mass",
            changed("<mass value=\"5\"/>", "<mass value=\"0\"/>"),
        ),
        (
            "negative mass",
            changed("<mass value=\"5\"/>", "<mass value=\"-5\"/>"),
        ),
        ("negative inertia", changed("ixx=\"0.1\"", "ixx=\"-0.1\"")),
        (
            "two parents",
            changed("<child link=\"hand\"/>", "<child link=\"slider\"/>"),
        ),
        (
            "circle",
            changed("<parent link=\"floor\"/>", "<parent link=\"hand\"/>")
                .replace("<link name=\"floor\"/>", ""),
        ),
        (
            "circle beside the tree",
            changed("<parent link=\"floor\"/>", "<parent link=\"hand\"/>"),
        ),
        (
            "two bases",
            changed(
                "<link name=\"floor\"/>",
                "<link name=\"floor\"/><link name=\"wall\"/>",
            ),
        ),
        (
            "unknown type",
            changed("type=\"prismatic\"", "type=\"prismatc\""),
        ),
        (
            "long axis",
            changed("<axis xyz=\"1 0 0\"/>", "<axis xyz=\"1 1 0\"/>"),
        ),
        (
            "zero axis",
            changed("<axis xyz=\"1 0 0\"/>", "<axis xyz=\"0 0 0\"/>"),
        ),
        (
            "unknown link",
            changed("<child link=\"hand\"/>", "<child link=\"hnd\"/>"),
        ),
        (
            "two joints of one name",
            changed("name=\"wrist\"", "name=\"slide\""),
        ),
        (
            "nothing moves",
            "<robot name=\"rock\"><link name=\"rock\"/></robot>".to_owned(),
        ),
        ("cut short", ARM[..900].to_owned()),
        ("no number", changed("value=\"5\"", "value=\"five\"")),
        (
            "a vector of words",
            changed("<origin xyz=\"0 0 0.5\"/>", "<origin xyz=\"0 0 up 0.5\"/>"),
        ),
        (
            "a limit of words",
            changed("upper=\"0.5\"", "upper=\"wide\""),
        ),
        ("no mass", changed("<mass value=\"5\"/>", "")),
        ("half an inertia", changed("ixy=\"0\" ", "")),
        ("no child", changed("<child link=\"hand\"/>", "")),
        ("not a URDF", "<mujoco/>".to_owned()),
        ("empty", String::new()),
    ];
    let mut texts = String::new();
    let add = ["add", "bias", "-m", "m.toml", "--urdf", "arm.urdf"];
    for (what, text) in cases {
        fs::write(folder.path().join("arm.urdf"), text).unwrap();
        let message = refused(folder.path(), &add);
        assert!(message.starts_with("error: arm.urdf"), "{message}");
        texts += &format!("{what}\n{message}\n");
    }
    fs::remove_file(folder.path().join("arm.urdf")).unwrap();
    texts += &refused(folder.path(), &add);
    insta::assert_snapshot!(texts);
}
