//! Descriptions as CAD exports and makers' repositories have them: mimic joints, links without mass, joints that are held, any
//! number of bodies.

use std::fs;
use std::path::Path;

use proprio_host::model::{Model, Robot};
use proprio_tests::command::{done, folder, json, proprio, stderr};

const INERTIA: &str =
    "<inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/>";

fn link(name: &str, inertial: &str) -> String {
    format!("<link name=\"{name}\">{inertial}</link>")
}

fn solid(name: &str, mass: f64) -> String {
    link(
        name,
        &format!("<inertial><mass value=\"{mass}\"/>{INERTIA}</inertial>"),
    )
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, more: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><origin xyz=\"0 0 0.3\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
         <axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\" effort=\"10\" velocity=\"3\"/>{more}</joint>"
    )
}

/// No moments of inertia at all.
const NONE: &str = "<inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>";

fn robot(parts: &[String]) -> String {
    format!(
        "<robot name=\"arm\"><link name=\"base\"/>{}</robot>",
        parts.concat()
    )
}

/// The robot of a URDF, some joints held.
fn read(text: &str, held: &[(&str, f64)]) -> Robot {
    let folder = folder();
    let file = folder.path().join("arm.urdf");
    fs::write(&file, text).unwrap();
    let held: Vec<(String, f64)> = held.iter().map(|(j, q)| ((*j).to_owned(), *q)).collect();
    Robot::from_urdf_held(&file, &held).unwrap()
}

fn names(robot: &Robot) -> Vec<&str> {
    robot
        .bodies()
        .iter()
        .map(|body| body.name.as_str())
        .collect()
}

/// An arm with two fingers, of which one mimics the other.
fn gripper() -> String {
    robot(&[
        solid("upper", 2.0),
        joint("shoulder", "revolute", "base", "upper", ""),
        solid("left", 0.1),
        joint("left_finger", "prismatic", "upper", "left", ""),
        solid("right", 0.2),
        joint(
            "right_finger",
            "prismatic",
            "upper",
            "right",
            "<mimic joint=\"left_finger\" multiplier=\"-2\" offset=\"0.01\"/>",
        ),
    ])
}

#[test]
fn what_mimics_another_is_held_where_the_other_says() {
    let free = read(&gripper(), &[]);
    assert_eq!(names(&free), ["shoulder", "left_finger"]);
    assert_eq!(free.held(), [("right_finger".to_owned(), 0.01)]);
    assert_eq!(
        free.notes(),
        ["right_finger mimics left_finger: it is held at 0.01"]
    );

    let held = read(&gripper(), &[("left_finger", 0.1)]);
    assert_eq!(names(&held), ["shoulder"]);
    let shoulder = &held.bodies()[0].inertia;
    assert!((shoulder.mass() - 2.3).abs() < 1e-12);
    // Along y: 0.1 kg at 0.1 m, 0.2 kg at −2 · 0.1 + 0.01 m.
    let y = 0.1 * 0.1 + 0.2 * -0.19;
    assert!((shoulder.first_moment().y - y).abs() < 1e-12);
}

/// A revolute joint that is held turns what it carries.
#[test]
fn a_held_joint_is_part_of_what_carries_it() {
    let elbow = |q: f64| {
        let text = robot(&[
            solid("upper", 2.0),
            joint("shoulder", "revolute", "base", "upper", ""),
            solid("lower", 1.0),
            joint("elbow", "revolute", "upper", "lower", ""),
            link(
                "tip",
                &format!(
                    "<inertial><origin xyz=\"0 0 0.5\"/><mass value=\"0.5\"/>{NONE}</inertial>"
                ),
            ),
            joint("tip_fixed", "fixed", "lower", "tip", ""),
        ]);
        read(&text, &[("elbow", q)])
    };
    for q in [0.0, 0.7, -1.3] {
        let robot = elbow(q);
        assert_eq!(names(&robot), ["shoulder"]);
        let h = robot.bodies()[0].inertia.first_moment();
        // The tip is 0.3 + 0.5 m from the elbow, whose z axis is turned about y.
        let (x, z) = (0.5 * 0.8 * q.sin(), 1.5 * 0.3 + 0.5 * 0.8 * q.cos());
        assert!((h.x - x).abs() < 1e-12 && (h.z - z).abs() < 1e-12, "{h:?}");
    }
}

/// The pose is part of the model file, and its joints may be in the log or not.
#[test]
fn a_pose_lives_in_the_model_file() {
    let folder = folder();
    let folder = folder.path();
    fs::write(folder.join("arm.urdf"), gripper()).unwrap();
    let words = done(
        folder,
        &[
            "add",
            "viscous",
            "-m",
            "arm.toml",
            "--urdf",
            "arm.urdf",
            "--hold",
            "left_finger=0.1",
        ],
    );
    assert!(
        words.contains("Note: right_finger mimics left_finger"),
        "{words}"
    );
    let model = Model::load(&folder.join("arm.toml")).unwrap();
    model.save(&folder.join("again.toml")).unwrap();
    assert_eq!(Model::load(&folder.join("again.toml")).unwrap(), model);
    assert_eq!(model.robot().held().len(), 2);

    let rows: String = (0..200)
        .map(|k| {
            format!(
                "{},0.1,0.2,{},7\n",
                0.004 * f64::from(k),
                0.01 * f64::from(k % 9)
            )
        })
        .collect();
    fs::write(
        folder.join("log.csv"),
        format!("t,q/shoulder,dq/shoulder,tau/shoulder,q/left_finger\n{rows}"),
    )
    .unwrap();
    let report = done(
        folder,
        &[
            "import", "log.csv", "-m", "arm.toml", "-o", "out.csv", "--json",
        ],
    );
    assert_eq!(json(&report)["joints"], serde_json::json!(["shoulder"]));

    let unknown = proprio(
        folder,
        &[
            "add",
            "viscous",
            "-m",
            "b.toml",
            "--urdf",
            "arm.urdf",
            "--hold",
            "left_fingr=0",
        ],
    );
    assert_eq!(unknown.status.code(), Some(1));
    assert!(
        stderr(&unknown).contains("did you mean `left_finger`?"),
        "{}",
        stderr(&unknown)
    );
    let builtin = "format = 1\n[robot]\nbuiltin = \"go2\"\n[held]\nFR_hip = 0.0\n";
    fs::write(folder.join("go2.toml"), builtin).unwrap();
    let output = proprio(folder, &["show", "go2.toml"]);
    assert!(
        stderr(&output).contains("[held] needs a robot with a `urdf`"),
        "{}",
        stderr(&output)
    );
}

/// Frames without mass between joints, tips without mass, points of mass: none of them changes what the others weigh.
#[test]
fn links_without_mass_or_extent_are_completed() {
    let text = robot(&[
        link("frame", ""),
        joint("yaw", "revolute", "base", "frame", ""),
        solid("upper", 2.0),
        joint("pitch", "revolute", "frame", "upper", ""),
        link(
            "point",
            &format!("<inertial><mass value=\"0.5\"/>{NONE}</inertial>"),
        ),
        joint("wrist", "continuous", "upper", "point", ""),
        link("flag", ""),
        joint("spin", "continuous", "point", "flag", ""),
        joint("free", "floating", "upper", "camera", ""),
        solid("camera", 0.25),
    ]);
    let robot = read(&text, &[]);
    assert_eq!(names(&robot), ["yaw", "pitch", "wrist"]);
    let mass: Vec<f64> = robot
        .bodies()
        .iter()
        .map(|body| body.inertia.mass())
        .collect();
    assert!(
        mass[0] < 1e-3 && mass[1] == 2.25 && mass[2] == 0.5,
        "{mass:?}"
    );
    assert!(robot.bodies().iter().all(|body| body.inertia.is_physical()));
    let mut notes = robot.notes().to_vec();
    notes.sort();
    assert_eq!(notes.len(), 4, "{notes:?}");
    for (note, expected) in notes.iter().zip([
        "free gives",
        "link frame",
        "link point",
        "spin moves nothing",
    ]) {
        assert!(note.starts_with(expected), "{note}");
    }
}

/// A shape without mass is a mass that was forgotten.
#[test]
fn a_shape_without_mass_is_refused() {
    let shape = "<visual><geometry><box size=\"1 1 1\"/></geometry></visual>";
    let text = robot(&[
        link("upper", shape),
        joint("shoulder", "revolute", "base", "upper", ""),
        solid("lower", 1.0),
        joint("elbow", "revolute", "upper", "lower", ""),
    ]);
    let folder = folder();
    let file = folder.path().join("arm.urdf");
    fs::write(&file, text).unwrap();
    let message = Robot::from_urdf(&file).unwrap_err().to_string();
    assert!(
        message.contains("link `upper`, moved by joint `shoulder`, has no mass"),
        "{message}"
    );
}

/// Moments that no body has become the nearest possible ones; a negative one stays an error.
#[test]
fn impossible_moments_become_possible() {
    let upper = |ixx: f64| {
        let inertia = format!(
            "<inertia ixx=\"{ixx}\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.01\"/>"
        );
        let inertial = format!("<inertial><mass value=\"1\"/>{inertia}</inertial>");
        robot(&[
            link("upper", &inertial),
            joint("shoulder", "revolute", "base", "upper", ""),
        ])
    };
    let moments = |robot: &Robot| robot.bodies()[0].inertia.rotational_inertia().diagonal();
    let possible = read(&upper(0.025), &[]);
    assert!(possible.notes().is_empty() && (moments(&possible).x - 0.025).abs() < 1e-15);
    let nearest = read(&upper(0.5), &[]);
    assert!(nearest.notes()[0].starts_with("link upper has moments of inertia that no body has"));
    // Second moments along x, y, z: −0.235, 0.245, 0.255; the first becomes a hundredth of the last.
    let expected = [0.5, 0.255 + 0.00255, 0.245 + 0.00255];
    for (moment, expected) in moments(&nearest).iter().zip(expected) {
        assert!(
            (moment - expected).abs() < 1e-12,
            "{moment} instead of {expected}"
        );
    }
    let folder = folder();
    let file = folder.path().join("arm.urdf");
    fs::write(&file, upper(-0.5)).unwrap();
    assert!(Robot::from_urdf(&file).is_err());
}

#[test]
fn any_number_of_bodies_loads() {
    let mut parts = Vec::new();
    for n in 0..200 {
        let parent = if n == 0 {
            "base".to_owned()
        } else {
            format!("l{}", n - 1)
        };
        parts.push(solid(&format!("l{n}"), 1.0));
        parts.push(joint(
            &format!("j{n}"),
            "revolute",
            &parent,
            &format!("l{n}"),
            "",
        ));
    }
    let robot = read(&robot(&parts), &[]);
    assert_eq!(robot.bodies().len(), 200);
    assert_eq!(robot.limbs().len(), 1);
}

/// The robots of PyPI's `example-robot-data`, where they are at hand: `PROPRIO_URDFS` names the folder.
#[test]
fn the_robots_of_others_load() {
    let Some(folder) = std::env::var_os("PROPRIO_URDFS") else {
        println!("skipped: PROPRIO_URDFS names no folder (pip install example-robot-data==6.0.0)");
        return;
    };
    let mut files = Vec::new();
    let mut folders = vec![Path::new(&folder).to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_symlink() {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "urdf") {
                files.push(path);
            }
        }
    }
    files.sort();
    let mut refused = Vec::new();
    for file in &files {
        match Robot::from_urdf(file) {
            Ok(robot) => assert!(robot.bodies().iter().all(|body| body.inertia.is_physical())),
            Err(error) => refused.push(error.to_string()),
        }
    }
    println!(
        "{} of {} load; refused:\n{}",
        files.len() - refused.len(),
        files.len(),
        refused.join("\n")
    );
    assert!(files.len() >= 69 && refused.len() <= 3, "{refused:?}");
}
