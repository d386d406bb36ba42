//! What `calibrate` reaches on simulated arms: errors at other poses, what is named first, whether standard deviations hold.
//!
//! `cargo run --release -p proprio-studies --bin calibration -- 24 > studies/calibration.md` (seeds; 24 unless stated).

use std::fmt::Write;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use proprio_host::kinematics::{Poses, calibrate, compare_poses, design_poses};
use proprio_host::model::{Model, Robot};
use proprio_simulator::poses::{PoseHidden, PoseJoint, PoseKind, PoseSimulation, SimulatedPose};

/// Poses at which the error is judged.
const TESTS: usize = 200;
/// Noise of a tracker's coordinate, m.
const NOISE: f64 = 0.03e-3;
/// What frames are off by, m and rad.
const GEOMETRY: [f64; 2] = [0.5e-3, 0.7e-3];
/// What joints yield: stiffness, N m/rad.
const SOFT: [(&str, f64); 6] = [
    ("A1", 3e6),
    ("A2", 2.5e6),
    ("A3", 1.5e6),
    ("A4", 4e5),
    ("A5", 3e5),
    ("A6", 2e5),
];
/// Ripple of gears that no candidate is, rad.
const RIPPLE: f64 = 1e-4;

/// A kind of arm and of poses.
struct Case {
    name: &'static str,
    poses: usize,
    chosen: bool,
    soft: bool,
    ripple: bool,
    geometry: [f64; 2],
}

/// What became of the seeds.
#[derive(Default)]
struct Outcome {
    errors: Vec<f64>,
    named: usize,
    complete: usize,
    within: usize,
    values: usize,
    refused: usize,
}

fn main() {
    let seeds = std::env::args()
        .nth(1)
        .and_then(|n| n.parse().ok())
        .unwrap_or(24_u64);
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/robots/arm_2500.urdf");
    let model = Model::new(Robot::from_urdf(&urdf).expect("the arm of the tests loads"));
    let case = |name, poses, chosen, soft, ripple, geometry| Case {
        name,
        poses,
        chosen,
        soft,
        ripple,
        geometry,
    };
    let cases = [
        case("30 random", 30, false, true, false, GEOMETRY),
        case("30 chosen", 30, true, true, false, GEOMETRY),
        case("24 chosen", 24, true, true, false, GEOMETRY),
        case("21 chosen", 21, true, true, false, GEOMETRY),
        case("60 random", 60, false, true, false, GEOMETRY),
        case(
            "30 random, ripple of 0.1 mrad hidden",
            30,
            false,
            true,
            true,
            GEOMETRY,
        ),
        case(
            "30 random, frames wrong, nothing yields",
            30,
            false,
            false,
            false,
            GEOMETRY,
        ),
        case("30 random, as described", 30, false, false, false, [0.0; 2]),
    ];
    let mut table = String::from(
        "| poses | error, mean | worst | `elasticity` first beyond frames | complete | values within 2σ | refused |\n|---|---|---|---|---|---|---|\n",
    );
    for case in &cases {
        let outcome = run(&model, case, seeds);
        let mean = outcome.errors.iter().sum::<f64>() / outcome.errors.len().max(1) as f64;
        let worst = outcome.errors.iter().copied().fold(0.0, f64::max);
        let share = 100.0 * outcome.within as f64 / outcome.values.max(1) as f64;
        let _ = writeln!(
            table,
            "| {} | {mean:.4} mm | {worst:.4} mm | {} of {seeds} | {} of {seeds} | {} of {} ({share:.1} %) | {} |",
            case.name,
            outcome.named,
            outcome.complete,
            outcome.within,
            outcome.values,
            outcome.refused
        );
    }
    println!(
        "# Calibration of simulated arms\n\nMade by `cargo run --release -p proprio-studies --bin calibration`. The arm of `tests/robots/arm_2500.urdf`, {seeds} seeds a row: frames\noff by 0.5 mm and 0.7 mrad, all six joints yield (2e5 to 3e6 N m/rad), tracker noise 0.03 mm a coordinate. Error: rms distance to where the target truly is, at\n{TESTS} other poses.\n\n{table}"
    );
}

fn run(model: &Model, case: &Case, seeds: u64) -> Outcome {
    let at = match case.chosen {
        true => {
            design_poses(model, case.poses, 1)
                .expect("the arm has clear poses")
                .positions
        }
        false => Vec::new(),
    };
    let folder = tempfile::tempdir().expect("a folder");
    let mut outcome = Outcome::default();
    for seed in 1..=seeds {
        let simulation = PoseSimulation {
            at: at.clone(),
            ..simulation(model, case, seed)
        };
        let (measured, truth) = simulation.run();
        let path = folder.path().join("poses.csv");
        write(&path, &simulation, &measured, |pose| pose.place);
        let poses = Poses::read(std::slice::from_ref(&path), model).expect("poses are read");
        let Ok(found) = calibrate(&poses, model, false) else {
            outcome.refused += 1;
            continue;
        };
        let effects = || found.path.iter().filter_map(|step| step.effect);
        let beyond = effects().find(|e| !["joint_offset", "link_geometry"].contains(e));
        outcome.named += usize::from(beyond == Some("elasticity"));
        outcome.complete += usize::from(beyond.is_none());
        for value in &found.parameters {
            if let Some(truth) = truth.iter().find(|truth| truth.name == value.name) {
                outcome.values += 1;
                outcome.within += usize::from((value.value - truth.value).abs() <= 2.0 * value.std);
            }
        }
        let fitted = found.to_model(&poses).expect("the poses are still there");
        let others = PoseSimulation {
            poses: case.poses + TESTS,
            at: Vec::new(),
            ..simulation
        };
        let (tests, _) = others.run();
        let path = folder.path().join("tests.csv");
        write(&path, &others, &tests[case.poses..], |pose| pose.truth);
        let poses = Poses::read(&[path], &fitted).expect("poses are read");
        outcome.errors.push(
            compare_poses(&poses, &fitted)
                .expect("poses are compared")
                .rms,
        );
    }
    outcome
}

fn simulation(model: &Model, case: &Case, seed: u64) -> PoseSimulation {
    let bodies = model.robot().bodies().iter().enumerate();
    let joints: Vec<PoseJoint> = bodies
        .map(|(b, body)| {
            let phi = model.inertia(b).0;
            let rotation = Rotation3::from_matrix_unchecked(body.placement.rotation);
            PoseJoint {
                name: body.name.clone(),
                parent: body.parent,
                placement: Isometry3::from_parts(
                    Translation3::from(body.placement.translation),
                    UnitQuaternion::from_rotation_matrix(&rotation),
                ),
                axis: body.axis,
                slides: false,
                limits: body.limits,
                mass: phi[0],
                com: Vector3::new(phi[1], phi[2], phi[3]) / phi[0],
            }
        })
        .collect();
    let mut hidden: Vec<PoseHidden> = SOFT
        .iter()
        .filter(|_| case.soft)
        .map(|(joint, k)| PoseHidden {
            kind: PoseKind::Elasticity,
            joint: Some((*joint).to_owned()),
            value: *k,
        })
        .collect();
    if case.ripple {
        hidden.push(PoseHidden {
            kind: PoseKind::GearRipple,
            joint: None,
            value: RIPPLE,
        });
    }
    PoseSimulation {
        tip: joints.len() - 1,
        joints,
        down: -Vector3::z(),
        poses: case.poses,
        at: Vec::new(),
        geometry: case.geometry,
        hidden,
        noise: [Some(NOISE), None],
        seed,
    }
}

fn write(
    path: &PathBuf,
    simulation: &PoseSimulation,
    poses: &[SimulatedPose],
    place: impl Fn(&SimulatedPose) -> Vector3<f64>,
) {
    let names: Vec<String> = simulation
        .joints
        .iter()
        .map(|joint| format!("q/{}", joint.name))
        .collect();
    let mut text = format!("{},x/target,y/target,z/target\n", names.join(","));
    for pose in poses {
        let place = place(pose);
        let cells = pose.q.iter().chain(place.iter()).map(|x| format!("{x:?}"));
        let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join(","));
    }
    std::fs::write(path, text).expect("the folder is ours");
}
