//! The leg in closed form, the stance's derivatives, forces that move the robot so, and what a search finds.

use nalgebra::{SVector, Vector3};
use proprio_core::go2;
use proptest::prelude::*;

use super::leg::LegGeometry;
use super::stance_constraints::StanceConstraints;
use super::standing::coordinates;
use super::state::needed;
use super::*;
use crate::excite::fourier::Series;

struct Quiet;

impl Supervisor for Quiet {
    fn stop(&self) -> bool {
        false
    }

    fn progress(&self, _: usize, _: usize, _: Option<f64>) {}
}

/// Angles that a leg's closed form is for: the foot below its hip, the knee bent backwards.
fn bent() -> impl Strategy<Value = [f64; 3]> {
    (-0.7..0.7f64, -0.2..1.6f64, -2.6..-0.9f64).prop_map(|(hip, thigh, calf)| [hip, thigh, calf])
}

/// The foot's centre by the core's tree, in the base's frame.
fn foot_by_tree(leg: usize, q: &[f64; 3]) -> Vector3<f64> {
    let tree = go2::free::<f64>();
    let all = SVector::from_fn(|k, _| match k.checked_sub(6 + 3 * leg) {
        Some(j) if j < 3 => q[j],
        _ => 0.0,
    });
    let placements = tree.placements(&proprio_core::spatial::Transform::identity(), &all);
    let foot = go2::feet::<f64>()[leg];
    let (mut at, mut body) = (foot.centre, Some(foot.body));
    while let Some(b) = body {
        let placed = &placements.from_parent[b];
        at = placed.translation + placed.rotation * at;
        body = tree.bodies()[b].parent;
    }
    at
}

/// A motion of the trunk of some centimetres and tenths of a radian.
fn swaying() -> Motion {
    let series = |c: usize| Series {
        start: 0.0,
        drift: 0.0,
        constant: 0.0,
        cosines: [0.2, -0.5, 0.3]
            .map(|a| a * if c < 3 { 0.5 } else { 2.0 + c as f64 * 0.3 })
            .into(),
        sines: [0.3, 0.2, -1.2]
            .map(|b| b * if c < 3 { 0.4 } else { 1.5 - c as f64 * 0.2 })
            .into(),
    };
    Motion {
        period: 2.5,
        repeats: 2,
        joints: (0..6).map(series).collect(),
    }
}

proptest! {
    #[test]
    fn a_leg_in_closed_form_is_the_trees(leg in 0..4usize, q in bent()) {
        let own = LegGeometry::of(leg);
        let foot = foot_by_tree(leg, &q);
        prop_assert!((own.foot(&q) - foot).norm() < 1e-12);
        let mut back = own.angles(&foot).expect("the leg is there");
        prop_assume!(own.hip.z - foot.z > 0.05);
        // A foot above the hip's plane is reached with the hip the other way round.
        back.iter_mut().zip(&q).for_each(|(back, q)| *back -= q);
        prop_assert!(back.iter().all(|off| off.abs() < 1e-9), "{back:?}");
    }

    #[test]
    fn a_foots_velocity_and_acceleration_are_slopes(leg in 0..4usize, q in bent(), dq in prop::array::uniform3(-3.0..3.0f64)) {
        let own = LegGeometry::of(leg);
        let at = |t: f64| own.foot(&std::array::from_fn(|j| q[j] + t * dq[j]));
        let h = 1e-4;
        let speed = own.jacobian(&q) * Vector3::from(dq);
        prop_assert!(((at(h) - at(-h)) / (2.0 * h) - speed).norm() < 1e-6);
        let bias = (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h);
        prop_assert!((bias - own.bias(&q, &dq)).norm() < 1e-4);
    }
}

#[test]
fn joints_velocities_and_accelerations_are_slopes_and_feet_stay() {
    let (footing, motion) = (StanceConstraints::new(0.29), swaying());
    let at = |t: f64| {
        footing
            .state(&coordinates(&motion, t))
            .expect("within reach")
    };
    let h = 1e-4;
    for n in 0..40 {
        let t = 0.05 + n as f64 * 0.06;
        let (before, now, after) = (at(t - h), at(t), at(t + h));
        for j in 0..12 {
            let speed = (after.q[j] - before.q[j]) / (2.0 * h);
            let rate = (after.dq[j] - before.dq[j]) / (2.0 * h);
            assert!(
                (speed - now.dq[j]).abs() < 1e-5,
                "{t} {j}: {speed} {}",
                now.dq[j]
            );
            assert!(
                (rate - now.ddq[j]).abs() < 1e-4,
                "{t} {j}: {rate} {}",
                now.ddq[j]
            );
        }
        let turned = now
            .rotation
            .tr_mul(&((after.rotation - before.rotation) / (2.0 * h)));
        let turning = Vector3::new(turned[(2, 1)], turned[(0, 2)], turned[(1, 0)]);
        assert!((turning - now.turning).norm() < 1e-6);
        let rate = (after.turning - before.turning) / (2.0 * h);
        assert!((rate - now.turning_rate).norm() < 1e-5);
        // In the world each foot is where it was.
        let place = coordinates(&motion, t);
        let base = Vector3::new(place[0][0], place[1][0], 0.29 + place[2][0]);
        let rest = at(0.0);
        for leg in 0..LEGS {
            let foot = |state: &State| footing.legs[leg].foot(&State::leg(&state.q, leg));
            let there = now.rotation * foot(&now) + base;
            assert!((there - foot(&rest) - Vector3::z() * 0.29).norm() < 1e-12);
        }
    }
}

#[test]
fn forces_and_torques_are_those_that_move_the_robot_so() {
    let model = Model::default();
    let (robot, drives) = (robot(&model), drives(&model));
    let state = StanceConstraints::new(0.29)
        .state(&coordinates(&swaying(), 0.7))
        .expect("within reach");
    let needed = needed(&robot, &drives, &state, 0.5).expect("legs push");
    // Forward dynamics under these forces and torques, less friction, gives the accelerations back.
    let k = state.kinematics(&robot);
    let [v, a] = state.rates();
    let mut torque = SVector::<f64, 18>::zeros();
    for j in 0..12 {
        torque[6 + j] = needed.torque[j] - drives[j].torque(state.dq[j], state.ddq[j]);
    }
    for (foot, force) in go2::feet::<f64>().iter().zip(&needed.feet) {
        let own = robot.contact_jacobian(&k.placements, foot, &state.down());
        torque += own.tr_mul(&state.rotation.tr_mul(force));
    }
    let moves = robot
        .forward_dynamics(&k, &v, &torque, &SVector::zeros())
        .expect("a robot");
    assert!((moves - a).norm() < 1e-8 * a.norm().max(1.0), "{moves} {a}");
    let sum: Vector3<f64> = needed.feet.iter().sum();
    assert!(sum.z > 100.0 && sum.z < 220.0);
}

#[test]
fn no_force_at_a_foot_is_in_the_rows() {
    let model = Model::default();
    let robot = robot(&model);
    let state = StanceConstraints::new(0.29)
        .state(&coordinates(&swaying(), 1.1))
        .expect("within reach");
    let scale = state::SCALE;
    let basis = state::beside_feet(&robot, &state, &scale).expect("legs that bend");
    let k = state.kinematics(&robot);
    for foot in go2::feet::<f64>() {
        let own = robot.contact_jacobian(&k.placements, &foot, &state.down());
        let mut force = own.tr_mul(&Vector3::new(30.0, -20.0, 100.0));
        force.iter_mut().zip(&scale).for_each(|(x, s)| *x *= s);
        assert!(basis.tr_mul(&force).norm() < 1e-10);
    }
    assert!((basis.tr_mul(&basis) - nalgebra::DMatrix::identity(6, 6)).norm() < 1e-12);
}

#[test]
fn a_design_keeps_its_limits_tells_more_than_a_sway_and_is_the_same_again() {
    let model = Model::default();
    let settings = Settings {
        duration: 4.5,
        period: 2.25,
        harmonics: 4,
        starts: 1,
        ..Settings::default()
    };
    let design =
        |settings: &Settings| standing(&model, settings, Ground::default(), &Quiet).unwrap();
    let found = design(&settings);
    assert!(found.violations.is_empty());
    assert!(
        found.cone[0] <= 1.0 && found.cone[1] >= 10.0,
        "{:?}",
        found.cone
    );
    assert_eq!(found.measures.rank, 10);
    // Cones at every sample of the file, from the forces themselves.
    for n in 0..=2250 {
        let (_, needed) = found
            .standing
            .moment(&found.motion, n as f64 / 500.0)
            .unwrap();
        for force in needed.feet {
            assert!(
                force.z >= 10.0 && force.x.hypot(force.y) <= 0.5 * force.z,
                "{n}: {force}"
            );
        }
    }
    assert_eq!(design(&settings).motion, found.motion);
    // The committed sway is as long.
    let log =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/oracle/walk/sway.csv.gz");
    let sway = measured(&model, &log).unwrap();
    for (own, sway) in found.trunk.iter().zip(&sway) {
        eprintln!(
            "{} {:.3e} sway {:.3e} prior {:.3e}",
            own.name, own.std, sway.std, own.prior_std
        );
    }
    let shares = found
        .trunk
        .iter()
        .zip(&sway)
        .map(|(own, sway)| own.std / sway.std);
    let log_mean = shares.map(f64::ln).sum::<f64>() / 10.0;
    assert!(log_mean.exp() < 0.8, "{}", log_mean.exp());
    // Instants say what windows do.
    let rows = {
        let states: Vec<State> = instants(&found.motion)
            .map(|t| found.standing.moment(&found.motion, t).unwrap().0)
            .collect();
        found.standing.rows(&states).unwrap()
    };
    let seen = found.standing.prior.seen(&rows).unwrap();
    for (k, own) in found.trunk.iter().enumerate() {
        let ratio = seen.std[1][k] / own.std;
        eprintln!("{} by instants over by windows {ratio:.3}", own.name);
        assert!((0.5..1.5).contains(&ratio), "{} {ratio}", own.name);
    }
}

#[test]
fn a_stance_that_cannot_be_is_refused() {
    let model = Model::default();
    let at = |height: f64| {
        let ground = Ground {
            height,
            ..Ground::default()
        };
        standing(&model, &Settings::default(), ground, &Quiet).unwrap_err()
    };
    assert!(matches!(at(0.6), ExciteError::Pose { .. }));
    assert!(matches!(at(f64::NAN), ExciteError::Setting { .. }));
}
