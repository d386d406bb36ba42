//! Logs of an arm that are another's by how they are read: each is named with its number, and what looks like it is not.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fs;
use std::path::Path;

use nalgebra::Rotation3;
use proprio_core::spatial::Transform;
use proprio_host::detect::mismatch::{Mismatch, MismatchKind, mismatches};
use proprio_host::model::{Limb, Model, Robot};
use proprio_host::recording::Recording;
use proprio_tests::command::{done, folder, proprio, simulated, stderr};
use proprio_tests::recorder::Recorder;
use proprio_tests::rows::Rows;

/// Waist, shoulder, elbow and a wrist that rolls.
pub(crate) const ARM: &str = r#"<robot name="arm">
<link name="base"/>
<link name="turn"><inertial><origin xyz="0.01 0 0.05"/><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.008"/></inertial></link>
<link name="upper"><inertial><origin xyz="0.01 0 0.15"/><mass value="1.5"/><inertia ixx="0.012" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.002"/></inertial></link>
<link name="fore"><inertial><origin xyz="0 0.01 0.12"/><mass value="0.9"/><inertia ixx="0.006" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.001"/></inertial></link>
<link name="hand"><inertial><origin xyz="0.05 0.02 0.06"/><mass value="0.6"/><inertia ixx="0.003" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.002"/></inertial></link>
<joint name="waist" type="revolute"><parent link="base"/><child link="turn"/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" effort="40" velocity="8"/></joint>
<joint name="shoulder" type="revolute"><parent link="turn"/><child link="upper"/><origin xyz="0 0.05 0.1"/><axis xyz="0 1 0"/><limit lower="-2.1" upper="2.5" effort="40" velocity="8"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2.5" upper="1.9" effort="40" velocity="8"/></joint>
<joint name="wrist" type="revolute"><parent link="fore"/><child link="hand"/><origin xyz="0 0 0.25"/><axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" effort="20" velocity="8"/></joint>
</robot>"#;

fn robot(folder: &Path) -> Robot {
    fs::write(folder.join("arm.urdf"), ARM).unwrap();
    Robot::from_urdf(&folder.join("arm.urdf")).unwrap()
}

/// A log of what a recorder makes, its cells changed: column by name, and what its numbers become.
pub(crate) fn write(
    folder: &Path,
    recorder: &Recorder,
    name: impl Fn(&str) -> String,
    cell: impl Fn(&str, f64) -> f64,
) {
    let limbs = recorder.model.robot().limbs();
    let limbs: Vec<&Limb> = limbs.iter().collect();
    let text = recorder.log::<4>(&limbs);
    let mut lines = text.lines();
    let heads: Vec<&str> = lines.next().unwrap().split(',').collect();
    let renamed: Vec<String> = heads.iter().map(|head| name(head)).collect();
    let mut all = renamed.join(",");
    for line in lines {
        let cells = line.split(',').zip(&heads).map(|(text, head)| {
            let number: Result<f64, _> = text.parse();
            number.map_or(text.to_owned(), |x| format!("{:.6}", cell(head, x)))
        });
        all += "\n";
        all += &cells.collect::<Vec<_>>().join(",");
    }
    fs::write(folder.join("log.csv"), all + "\n").unwrap();
}

pub(crate) fn as_is(head: &str) -> String {
    head.to_owned()
}

pub(crate) fn same(_: &str, x: f64) -> f64 {
    x
}

/// What is read of `log.csv` with the arm's bare bodies.
fn readings(folder: &Path, robot: Robot) -> Vec<Mismatch> {
    let model = Model::new(robot);
    let recording = Recording::read(&[folder.join("log.csv")], &model, |_, _| ()).unwrap();
    mismatches(&recording, &model)
}

/// The only reading of a log.
fn reading(
    change: impl Fn(&mut Recorder),
    name: impl Fn(&str) -> String,
    cell: impl Fn(&str, f64) -> f64,
) -> Option<MismatchKind> {
    let folder = folder();
    let arm = robot(folder.path());
    let mut recorder = Recorder::new(arm.clone());
    change(&mut recorder);
    write(folder.path(), &recorder, name, cell);
    let mut all = readings(folder.path(), arm);
    assert!(all.len() < 2, "{all:?}");
    all.pop().map(|found| found.kind)
}

fn torque(head: &str) -> Option<&str> {
    head.strip_prefix("tau/")
}

/// Friction that no model has, bodies that are a little heavier or lighter, a spring, three times the friction, half of it: no other reading.
#[test]
fn an_arm_as_it_is_has_no_other_reading() {
    let changes: [&dyn Fn(&mut Recorder); 5] = [
        &|_| (),
        &|r| r.motor("shoulder").spring = [4.0, 0.2],
        &|r| r.motors.iter_mut().for_each(|m| m.coulomb *= 3.0),
        &|r| r.motors.iter_mut().for_each(|m| m.viscous *= 0.5),
        &|r| r.bodies = vec![1.1, 0.9, 1.1, 0.9],
    ];
    for (n, change) in changes.iter().enumerate() {
        let found = reading(change, as_is, same);
        assert_eq!(found, None, "{n}");
    }
}

#[test]
fn torque_without_gravity_or_coriolis_forces_is_named() {
    let of = |parts: [f64; 3]| reading(|r| r.parts = parts, as_is, same);
    assert_eq!(
        of([1.0, 1.0, 0.0]),
        Some(MismatchKind::NoGravity {
            joints: Vec::new(),
            coriolis: false
        })
    );
    assert_eq!(
        of([1.0, 0.0, 0.0]),
        Some(MismatchKind::NoGravity {
            joints: Vec::new(),
            coriolis: true
        })
    );
}

/// A turn of the base about its x or y axis, as far as it may be, and what the model file is to say of it.
#[test]
fn the_mounting_of_the_base_is_named() {
    let mountings = [
        [0.14, 0.0],
        [0.0, 0.14],
        [0.0, -0.07],
        [0.3, -0.2],
        [0.0, 0.5],
        [FRAC_PI_2, 0.0],
        [0.0, FRAC_PI_2],
        [-FRAC_PI_2, 0.0],
        [PI, 0.0],
        [0.9, 0.6],
    ];
    for [roll, pitch] in mountings {
        let turn = *Rotation3::from_euler_angles(roll, pitch, 0.0).matrix();
        let base = Transform {
            rotation: turn,
            ..Transform::identity()
        };
        let down = base.rotation.transpose() * -nalgebra::Vector3::z();
        let found = reading(|r| r.base = base, as_is, same);
        let Some(MismatchKind::Orientation { angle, rpy }) = found else {
            panic!("{roll} {pitch}: {found:?}");
        };
        let told = Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        let told = told.transpose() * -nalgebra::Vector3::z();
        assert!(told.angle(&down) < 0.03, "{roll} {pitch}: {rpy:?}");
        assert!((angle - down.angle(&-nalgebra::Vector3::z())).abs() < 0.03);
        // What the catalogue has is no reason to stop.
        let small = angle < 0.35;
        assert_eq!(MismatchKind::Orientation { angle, rpy }.refuses(), !small);
    }
}

#[test]
fn units_and_signs_of_the_torque_are_named() {
    let scaled = |by: &dyn Fn(&str) -> f64| {
        reading(
            |_| (),
            as_is,
            |head, x| torque(head).map_or(x, |joint| by(joint) * x),
        )
    };
    let constant = |joint: &str| match joint {
        "waist" => 0.08,
        "shoulder" => 0.125,
        "elbow" => 0.25,
        _ => 0.4,
    };
    let Some(MismatchKind::Units(factors)) = scaled(&constant) else {
        panic!("a constant of each joint's own");
    };
    for (joint, factor) in factors {
        let times = factor.map_or(1.0, |factor| factor / constant(&joint));
        assert!((times - 1.0).abs() < 0.15, "{joint} {factor:?}");
    }
    // A torque beyond what the motors give is refused as such before it is read otherwise.
    let folder = folder();
    let arm = robot(folder.path());
    write(
        folder.path(),
        &Recorder::new(arm.clone()),
        as_is,
        |head, x| torque(head).map_or(x, |_| 1e3 * x),
    );
    let read = Recording::read(
        &[folder.path().join("log.csv")],
        &Model::new(arm),
        |_, _| (),
    );
    let refused = read
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(refused.contains("more than the robot can do"), "{refused}");
    for times in [0.5, 2.0, 0.1] {
        let found = scaled(&|_| times);
        let Some(MismatchKind::Unit(factor)) = found else {
            panic!("{times}: {found:?}");
        };
        assert!((factor / times - 1.0).abs() < 0.15, "{times} {factor}");
    }
    let found = scaled(&|joint| if joint == "elbow" { -1.0 } else { 1.0 });
    assert_eq!(found, Some(MismatchKind::Sign(vec!["elbow".to_owned()])));
    // A motor's constant that is off by a tenth is the catalogue's.
    assert_eq!(
        scaled(&|joint| if joint == "elbow" { 1.1 } else { 1.0 }),
        None
    );
}

#[test]
fn joints_that_are_exchanged_or_count_the_other_way_are_named() {
    let swap = |a: &'static str, b: &'static str| {
        move |head: &str| match head.split_once('/') {
            Some((channel, joint)) if joint == a => format!("{channel}/{b}"),
            Some((channel, joint)) if joint == b => format!("{channel}/{a}"),
            _ => head.to_owned(),
        }
    };
    for [a, b] in [
        ["waist", "elbow"],
        ["shoulder", "wrist"],
        ["shoulder", "elbow"],
    ] {
        let found = reading(|_| (), swap(a, b), same);
        let named = match &found {
            Some(MismatchKind::Exchanged(pairs) | MismatchKind::Joints(pairs)) => {
                let names = |pair: &[String; 2]| {
                    pair.contains(&a.to_owned()) && pair.contains(&b.to_owned())
                };
                pairs.iter().any(names)
            }
            _ => false,
        };
        assert!(named, "{a} {b}: {found:?}");
    }
    for joint in ["shoulder", "elbow"] {
        let other = |head: &str, x: f64| match head.split_once('/') {
            Some((_, name)) if name == joint => -x,
            _ => x,
        };
        let found = reading(|_| (), as_is, other);
        assert_eq!(found, Some(MismatchKind::OtherWay(vec![joint.to_owned()])));
    }
}

/// Tilt and delay of all joints are offered as the catalogue's effects.
#[test]
fn what_the_catalogue_has_is_offered_and_not_refused() {
    let folder = folder();
    let arm = robot(folder.path());
    let plain = ["viscous", "coulomb", "armature", "bias"];
    let add = ["add", "-m", "m.toml", "--urdf", "arm.urdf"];
    done(folder.path(), &[&add[..], &plain].concat());
    for (roll, pitch) in [(0.14, 0.0), (0.0, 0.14), (0.1, -0.1)] {
        let mut recorder = Recorder::new(arm.clone());
        recorder.base.rotation = *Rotation3::from_euler_angles(roll, pitch, 0.0).matrix();
        write(folder.path(), &recorder, as_is, same);
        let said = done(folder.path(), &["diagnose", "log.csv", "-m", "m.toml"]);
        assert!(said.contains("base_tilt (base)"), "{roll} {pitch}: {said}");
    }
}

/// Refusals by the words that name their cause, each with a log or a URDF that causes it, and one that looks like it and must not.
#[test]
fn a_refusal_names_what_is_the_case() {
    let folder = folder();
    let path = folder.path();
    let arm = robot(path);
    let log =
        |cell: &dyn Fn(&str, f64) -> f64| write(path, &Recorder::new(arm.clone()), as_is, cell);
    let with = |urdf: &str| {
        fs::write(path.join("other.urdf"), urdf).unwrap();
        let _ = fs::remove_file(path.join("other.toml"));
        proprio(
            path,
            &["add", "viscous", "-m", "other.toml", "--urdf", "other.urdf"],
        )
    };
    let inertials = |text: &str| {
        let parts = text.split("<inertial>").enumerate();
        parts
            .map(|(n, part)| match n {
                0 => part.to_owned(),
                _ => part.split_once("</inertial>").unwrap().1.to_owned(),
            })
            .collect::<String>()
    };
    let call = "<xacro:hand parent=\"fore\"/></robot>";
    let declared = "<robot name=\"arm\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">";
    let head = "<robot name=\"arm\">";
    let urdfs = [
        (inertials(ARM), Some("no link has a mass")),
        (
            ARM.replace(head, declared).replace("</robot>", call),
            Some("xacro"),
        ),
        (
            ARM.replace("lower=\"-2.1\"", "lower=\"${-pi/2}\""),
            Some("xacro"),
        ),
        // Declared and not used, as xacro itself leaves it; a link without a mass among others.
        (ARM.replace(head, declared), None),
        (
            ARM.replace(
                "<link name=\"base\"/>",
                "<link name=\"base\"/><!-- ${not} run -->",
            ),
            None,
        ),
    ];
    for (urdf, words) in urdfs {
        let output = with(&urdf);
        let said = stderr(&output);
        match words {
            Some(words) => assert!(
                !output.status.success() && said.contains(words),
                "{words}: {said}"
            ),
            None => assert!(output.status.success(), "{said}"),
        }
    }
    fs::write(
        path.join("latin1.urdf"),
        [&b"<!-- 170\xb0 -->"[..], ARM.as_bytes()].concat(),
    )
    .unwrap();
    done(
        path,
        &[
            "add",
            "viscous",
            "-m",
            "latin1.toml",
            "--urdf",
            "latin1.urdf",
        ],
    );

    // A URDF in g and mm: its units are named, not a torque that is none.
    let other_units = ARM
        .replace("ixx=\"0.006\"", "ixx=\"6000\"")
        .replace("iyy=\"0.006\"", "iyy=\"6000\"");
    assert!(with(&other_units).status.success());
    log(&same);
    let refused = |model: &str| stderr(&proprio(path, &["diagnose", "log.csv", "-m", model]));
    let said = refused("other.toml");
    assert!(
        said.contains("units") && said.contains("fore") && !said.contains("is zero"),
        "{said}"
    );
    assert!(with(ARM).status.success());
    log(&|head, x| if torque(head).is_some() { 0.0 } else { x });
    let said = refused("other.toml");
    assert!(said.contains("the torque of all joints is zero"), "{said}");
    // Torque of another robot: nothing is said of a Go2.
    log(&|head, x| torque(head).map_or(x, |joint| 5.0 * (x + joint.len() as f64).cos()));
    let said = refused("other.toml");
    assert!(
        said.contains("another robot") && !said.contains("Go2"),
        "{said}"
    );
    // Torque that the driver does not fill; the same names with numbers are read.
    let named = |names: [&'static str; 3]| {
        move |head: &str| match head.split_once('/') {
            Some(("q", joint)) => names[0].replace('J', joint),
            Some(("dq", joint)) => names[1].replace('J', joint),
            Some(("tau", joint)) => names[2].replace('J', joint),
            _ if head == "t" => "__time".to_owned(),
            _ => head.to_owned(),
        }
    };
    let plotjuggler = named([
        "/joint_states/J/position",
        "/joint_states/J/velocity",
        "/joint_states/J/effort",
    ]);
    let lerobot = named(["J.pos", "J.vel", "J.effort"]);
    let recorder = Recorder::new(arm.clone());
    write(path, &recorder, plotjuggler, |head, x| match torque(head) {
        Some(_) => f64::NAN,
        None => x,
    });
    let said = refused("other.toml");
    assert!(
        said.contains("effort") && said.contains("holds no number"),
        "{said}"
    );
    for names in [&plotjuggler as &dyn Fn(&str) -> String, &lerobot] {
        write(path, &recorder, names, same);
        done(path, &["identify", "log.csv", "-m", "other.toml"]);
    }
    // °/s; a sensor's error of a tenth is the catalogue's.
    for (times, is_unit) in [(57.29578, true), (1.1, false)] {
        log(&|head, x| {
            if head.starts_with("dq/") {
                times * x
            } else {
                x
            }
        });
        let said = refused("other.toml");
        assert_eq!(said.contains("°/s"), is_unit, "{said}");
    }
    // Equal stamps, and few rows, by every command.
    let text = |rows: usize, stamp: bool| {
        log(&same);
        let all = fs::read_to_string(path.join("log.csv")).unwrap();
        let lines: Vec<String> = (all.lines().take(rows + 1).enumerate())
            .map(|(n, line)| match (n, stamp) {
                (0, _) | (_, false) => line.to_owned(),
                _ => format!("x,1.0,{}", line.splitn(3, ',').nth(2).unwrap()),
            })
            .collect();
        fs::write(path.join("log.csv"), lines.join("\n") + "\n").unwrap();
    };
    for command in ["identify", "diagnose", "compare", "advise"] {
        for rows in [1, 2, 3, 5, 10, 20, 40] {
            text(rows, false);
            let said = stderr(&proprio(path, &[command, "log.csv", "-m", "other.toml"]));
            assert!(
                said.contains("too short") && said.contains("needed"),
                "{command} {rows}: {said}"
            );
        }
        text(600, true);
        let said = stderr(&proprio(path, &[command, "log.csv", "-m", "other.toml"]));
        assert!(said.contains("the same time stamp"), "{command}: {said}");
    }
}

/// A forearm of another mass and one of other moments of inertia are named by both commands; those within the prior are not.
#[test]
fn a_body_that_is_not_the_cads_is_named() {
    let folder = folder();
    let path = folder.path();
    let arm = robot(path);
    let plain = ["viscous", "coulomb", "armature", "bias"];
    let add = ["add", "-m", "m.toml", "--urdf", "arm.urdf"];
    done(path, &[&add[..], &plain].concat());
    for (times, is_other) in [(2.0, true), (1.04, false)] {
        let mut recorder = Recorder::new(arm.clone());
        recorder.bodies[2] = times;
        write(path, &recorder, as_is, same);
        let identified = stderr(&proprio(path, &["identify", "log.csv", "-m", "m.toml"]));
        let diagnosed = done(path, &["diagnose", "log.csv", "-m", "m.toml"]);
        for said in [identified, diagnosed] {
            assert_eq!(said.contains("the URDF says"), is_other, "{times}: {said}");
            assert!(!is_other || said.contains("fore: "), "{said}");
        }
    }
}

/// Two of a Go2's twelve joints whose columns are exchanged or counted the other way hardly show in what all joints leave: they are named by what they
/// leave beside the others. What a leg hides is no other reading.
#[test]
fn one_joint_of_twelve_is_read_otherwise_too() {
    type Change = fn(&mut Rows);
    const CHANNELS: [&str; 3] = ["q", "dq", "tau"];
    fn exchange(log: &mut Rows) {
        for channel in CHANNELS {
            let [a, b] = ["FR_thigh", "FL_thigh"].map(|j| log.place(&format!("{channel}/{j}")));
            log.rows.iter_mut().for_each(|row| row.swap(a, b));
        }
    }
    fn turn(log: &mut Rows, joint: &str) {
        for channel in CHANNELS {
            let place = log.place(&format!("{channel}/{joint}"));
            log.rows.iter_mut().for_each(|row| row[place] = -row[place]);
        }
    }
    let cases: [(u64, &str, Change, &str); 6] = [
        (7, "", exchange, "FR_thigh and FL_thigh exchanged"),
        (8, "", exchange, "FR_thigh and FL_thigh exchanged"),
        (
            7,
            "",
            |log| turn(log, "FL_thigh"),
            "FL_thigh counts the other way",
        ),
        (
            8,
            "",
            |log| turn(log, "RL_hip"),
            "RL_hip counts the other way",
        ),
        (1, "--hide spring:RL_hip=4", |_| (), ""),
        (2, "--hide payload:FR_calf=0.8", |_| (), ""),
    ];
    for (seed, hidden, change, reading) in cases {
        let folder = simulated(&format!(
            "--typical --inertia-error 0.03 --seed {seed} {hidden}"
        ));
        let path = folder.path().join("log.csv");
        let mut log = Rows::read(&path);
        change(&mut log);
        log.write(&path);
        let run = proprio(folder.path(), &["diagnose", "log.csv"]);
        let said = stderr(&run);
        match reading {
            "" => assert!(
                !said.contains("other way") && !said.contains("exchanged"),
                "{said}"
            ),
            reading => assert!(
                run.status.code() != Some(0) && said.contains(reading),
                "{seed} {reading}: {said}"
            ),
        }
    }
}
