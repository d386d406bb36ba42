//! Stance, velocities and gravity's length on made-up walks of which all is known.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use nalgebra::{Rotation3, SVector, Vector3};
use proprio_core::effect::EffectKind;
use proprio_core::estimator::plausible;
use proprio_core::go2::Leg;
use proprio_core::go2::{self, JOINTS};
use proprio_core::spatial::Transform;
use proprio_core::window::{
    FreeBasePush, FreeBaseSample, FreeBaseSetup, FreeBaseWindow, Sample, Settings,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::channels::Channels;
use super::data::{Data, PARTS, Sum};
use super::legged::Legged;
use super::moved_readings::MovedReadings;
use super::residual::{impulses, residuals};
use super::row_setup::RowSetup;
use super::rows::{Linearised, each_row, each_window, windows_of};
use super::speed::quieten;
use super::stance::Stance;
use super::stiction::Rest;
use super::structure::ModelStructure;
use super::walk::Walk;
use super::{Walks, gravity, imu};
use crate::estimate::Constraint;
use crate::model::Model;

/// Bodies and velocity coordinates of a Go2.
const BODIES: usize = JOINTS + 1;
const COORDINATES: usize = JOINTS + 6;

fn go2_legged() -> Arc<Legged> {
    Legged::of(&Model::default()).unwrap()
}

fn stance_of(walk: &Walk) -> Stance {
    Stance::of(walk, &go2_legged())
}

fn whole() -> ModelStructure {
    ModelStructure::whole(&Model::default(), Constraint::Physical).unwrap()
}

/// Samples of a robot that hangs still in the pose of standing, 500 Hz.
fn still(count: usize) -> Walk {
    Walk {
        path: "made up".into(),
        imu: true,
        time_us: (0..count as u64).map(|n| 2_000 * n).collect(),
        q: Channels::from_fn(count, JOINTS, |_, j| [0.0, 0.8, -1.6][j % 3]),
        dq: Channels::from_fn(count, JOINTS, |_, _| 0.0),
        tau: Channels::from_fn(count, JOINTS, |_, _| 0.0),
        gyro: vec![Vector3::zeros(); count],
        gyro_read: Vec::new(),
        acc: vec![Vector3::new(0.0, 0.0, 9.81); count],
        down: vec![-Vector3::z(); count],
        count: None,
        samples: Default::default(),
        period: 2e-3,
        rest: Arc::new(Rest::of(
            &Channels::from_fn(count, JOINTS, |_, _| 0.0),
            2e-3,
        )),
    }
}

/// Torques that hold the legs of sample n with these forces (N, up) at the feet.
fn hold(walk: &mut Walk, n: usize, forces: [f64; 4]) {
    let tree = go2::free::<f64>();
    let q = SVector::from_fn(|k, _| if k < 6 { 0.0 } else { walk.q[n][k - 6] });
    let k = tree.kinematics(&Transform::identity(), &q, &SVector::zeros());
    let mut torque = tree.gravity_torque(&k);
    for (foot, force) in go2::feet().iter().zip(forces) {
        let jacobian = tree.contact_jacobian(&k.placements, foot, &-Vector3::z());
        torque -= jacobian.tr_mul(&(Vector3::z() * force));
    }
    (0..JOINTS).for_each(|j| walk.tau[n][j] = torque[6 + j]);
}

/// MuJoCo's trot.
fn trot() -> Walks {
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/oracle/walk/trot.csv.gz");
    Walks::read(&[path], (&Model::default(), &go2_legged()), |_, _| ()).unwrap()
}

/// FR swings high for 100 ms in the middle; the others carry the robot.
fn step(counts: Option<[f64; 2]>) -> Walk {
    let mut walk = still(300);
    for n in 0..300 {
        let swings = (100..150).contains(&n);
        if swings {
            walk.q[n][1] = 1.2;
            walk.q[n][2] = -2.3;
        }
        hold(
            &mut walk,
            n,
            [if swings { 0.0 } else { 40.0 }, 40.0, 40.0, 40.0],
        );
    }
    walk.count = counts.map(|[air, ground]| {
        let of = |n: usize| if (100..150).contains(&n) { air } else { ground };
        Channels::from_fn(300, 4, |n, f| if f == 0 { of(n) } else { ground })
    });
    walk
}

#[test]
fn a_foot_is_in_the_air_only_where_all_say_so_and_with_a_guard() {
    let stance = stance_of(&step(Some([10.0, 50.0])));
    let air: Vec<usize> = (0..300).filter(|n| !stance.loaded[*n][0]).collect();
    // A guard of 16 ms to both sides (a sample at just 16 ms may be on either side), and a few samples where differences reach
    // across the step.
    let (first, last) = (air[0], air[air.len() - 1]);
    assert!(
        (107..=114).contains(&first) && (135..=142).contains(&last),
        "{first} {last}"
    );
    assert_eq!(air.len(), last - first + 1);
    assert!(stance.loaded.iter().all(|l| l[1] && l[2] && l[3]));
    let shares = stance.shares;
    let sum =
        shares.torque[0] + shares.count[0] + shares.height[0] + shares.guard[0] + shares.air[0];
    assert!((sum - 1.0).abs() < 1e-12 && shares.torque[1] == 1.0);
}

#[test]
fn a_sensor_that_speaks_of_a_force_is_believed_and_a_dead_one_is_not_asked() {
    // Fifty samples of a count in the middle of its range: the foot may drag.
    let mut walk = step(Some([10.0, 50.0]));
    if let Some(count) = &mut walk.count {
        (0..30).for_each(|n| count[n][0] = 10.0);
        (100..150).for_each(|n| count[n][0] = 30.0);
    }
    let stance = stance_of(&walk);
    assert!(stance.loaded.iter().all(|l| l[0]));
    assert!(stance.shares.count[0] > 0.1);
    for counts in [None, Some([17.0, 17.0]), Some([f64::NAN; 2])] {
        let stance = stance_of(&step(counts));
        assert!(stance.loaded.iter().any(|l| !l[0]), "{counts:?}");
    }
}

/// A foot without a force that is as low as those that carry the robot.
#[test]
fn a_foot_at_the_ground_may_carry_a_force_that_torques_do_not_tell() {
    let mut walk = still(200);
    (0..200).for_each(|n| hold(&mut walk, n, [3.0, 50.0, 50.0, 50.0]));
    let stance = stance_of(&walk);
    assert!(stance.loaded.iter().all(|l| l[0]));
    assert_eq!(stance.shares.height[0], 1.0);
}

#[test]
fn a_robot_that_hangs_has_no_foot_on_the_ground() {
    let mut walk = still(200);
    (0..200).for_each(|n| hold(&mut walk, n, [0.0; 4]));
    let stance = stance_of(&walk);
    assert_eq!(stance.shares.air, [1.0; 4]);
}

/// What motion and other joints say of the transmitted torque against what the motors give: exact where nothing is on the ground; in MuJoCo's trot to a
/// quarter at each kind of joint, friction, rotors and blows among it.
#[test]
fn gears_transmit_what_motion_and_the_other_joints_tell() {
    let mut hanging = still(50);
    (0..50).for_each(|n| hold(&mut hanging, n, [0.0; 4]));
    let transmitted = stance_of(&hanging).transmitted;
    for j in 0..JOINTS {
        assert!((transmitted[25][j] - hanging.tau[25][j]).abs() < 1e-9);
    }
    let walks = trot();
    let (walk, stance) = &walks.walks[0];
    for kind in 0..3 {
        let [mut left, mut all] = [0.0; 2];
        for n in 0..walk.len() {
            for j in (kind..JOINTS).step_by(3) {
                left += (walk.tau[n][j] - stance.transmitted[n][j]).powi(2);
                all += walk.tau[n][j].powi(2);
            }
        }
        let share = (left / all).sqrt();
        assert!(share < 0.25, "kind {kind}: {share}");
    }
}

/// The friction of a joint is explained by its load: what the joint's own motor says is not in that, and what others say is.
#[test]
fn no_joint_tells_its_own_load() {
    let standing = step(None);
    let of = |walk: &Walk| stance_of(walk).transmitted;
    let known = of(&standing);
    let mut other = standing.clone();
    (0..300).for_each(|n| other.tau[n][4] += 0.5);
    let moved = of(&other);
    let apart = |j: usize| (known[50][j] - moved[50][j]).abs();
    assert!(apart(4) < 1e-9, "{}", apart(4));
    assert!(apart(3) > 1e-3 && apart(5) > 1e-3);
}

/// A hand's force on the trunk is told by no sensor; in flight, where nothing carries the robot, there is none.
#[test]
fn a_robot_that_hangs_is_held_and_one_that_stands_or_flies_is_not() {
    let mut stands = still(600);
    (0..600).for_each(|n| hold(&mut stands, n, [40.0, 35.0, 40.0, 35.0]));
    assert!(!stance_of(&stands).held.contains(&true));
    let mut flies = still(600);
    flies.acc.fill(Vector3::zeros());
    assert!(!stance_of(&flies).held.contains(&true));
    // Lifted off the ground for the last second.
    for n in 0..600 {
        let lifted = n >= 300;
        hold(
            &mut stands,
            n,
            if lifted {
                [0.0; 4]
            } else {
                [40.0, 35.0, 40.0, 35.0]
            },
        );
    }
    let held = stance_of(&stands).held;
    let first = held.iter().position(|held| *held).unwrap();
    assert!(first < 300 && first > 50, "{first}");
    assert!(held[first..].iter().all(|held| *held));
}

/// An accelerometer whose up is down makes of feet that push such as pull; a robot that hangs has neither.
#[test]
fn an_imu_that_is_upside_down_is_told_from_a_robot_that_hangs() {
    let mut stands = still(600);
    assert!(!stance_of(&stands).overturned);
    (0..600).for_each(|n| hold(&mut stands, n, [40.0, 35.0, 40.0, 35.0]));
    assert!(!stance_of(&stands).overturned);
    stands.acc.fill(Vector3::new(0.0, 0.0, -9.81));
    stands.down.fill(Vector3::z());
    assert!(stance_of(&stands).overturned);
}

/// The position's slope where it is quieter; the reported velocity where time stamps jitter.
#[test]
fn velocities_come_from_the_quieter_channel() {
    for (jitter, noise, best) in [(0.0, 0.035, 0.01), (300.0, 0.01, 0.011)] {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let mut walk = still(2000);
        let motion = |t: f64| (0.3 * (9.0 * t).sin(), 2.7 * (9.0 * t).cos());
        for n in 0..2000 {
            let (q, dq) = motion(walk.seconds(n));
            walk.q[n].fill((q / 3e-5).round() * 3e-5);
            walk.dq[n].fill(dq + noise * normal());
            walk.gyro[n] = Vector3::repeat(0.3 * dq + 0.005 * normal());
        }
        let truth: Vec<f64> = (0..2000).map(|n| motion(walk.seconds(n)).1).collect();
        for us in &mut walk.time_us {
            *us = us.saturating_add_signed((jitter * normal().clamp(-3.0, 3.0)) as i64);
        }
        quieten(&mut walk);
        let rms = |of: &dyn Fn(usize) -> f64| {
            ((20..1980).map(|n| of(n).powi(2)).sum::<f64>() / 1960.0).sqrt()
        };
        let error = rms(&|n| walk.dq[n][4] - truth[n]);
        assert!(error < best, "jitter {jitter} us: {error} rad/s");
        if jitter == 0.0 {
            let gyro = rms(&|n| walk.gyro[n].x - 0.3 * truth[n]);
            // A parabola through seven samples leaves √(7/21) of their noise.
            assert!(gyro < 0.0030, "{gyro} rad/s");
        }
    }
}

/// The trunk sways to and fro, so that what it feels is no gravity for a second: over several swings it is.
#[test]
fn gravitys_direction_is_told_without_lag() {
    let mut walk = still(6000);
    let (rate, roll) = (TAU * 0.5, |t: f64| 0.1 * (TAU * 0.5 * t).sin());
    let up = |t: f64| Vector3::new(0.0, roll(t).sin(), roll(t).cos());
    for n in 0..6000 {
        let t = walk.seconds(n);
        walk.gyro[n] = Vector3::new(0.1 * rate * (rate * t).cos(), 0.0, 0.0);
        let aside = Vector3::new(0.0, roll(t).cos(), -roll(t).sin());
        walk.acc[n] = up(t) * 9.81 + aside * (0.5 * (rate * t).sin());
    }
    let down = gravity::down(&walk);
    for n in (2000..4000).step_by(50) {
        let off = (down[n] + up(walk.seconds(n))).norm();
        assert!(off < 2e-3, "{off} rad at {} s", walk.seconds(n));
    }
}

/// A joint that turns round is left out of the windows in which it does; one that stays where it is of all.
#[test]
fn joints_that_friction_may_hold_are_told() {
    let mut walk = still(2000);
    for n in 0..2000 {
        walk.dq[n][4] = 2.0 * (TAU * walk.seconds(n)).sin();
    }
    walk.rest = Arc::new(Rest::of(&walk.dq, walk.period));
    let left_out = |seconds: f64| {
        walk.rest
            .within(&walk.time_us, walk.index_at(seconds), 40_000)
    };
    for (seconds, turns) in [(0.98, true), (1.25, false), (1.48, true), (1.53, false)] {
        let told = left_out(seconds);
        assert_eq!(told[4], turns, "{seconds}");
        assert!((0..JOINTS).all(|j| j == 4 || told[j]));
    }
}

/// Windows end where a foot does another thing than before: long ones are for robots whose feet stay.
#[test]
fn windows_are_long_where_feet_stay() {
    let mut stands = still(600);
    (0..600).for_each(|n| hold(&mut stands, n, [40.0; 4]));
    assert_eq!(stance_of(&stands).window_us, 80_000);
    assert_eq!(stance_of(&step(None)).window_us, 40_000);
}

/// An accelerometer that reads 0.09 m/s² too much along gravity, on a robot that rolls and bounces.
#[test]
fn gravitys_length_tells_the_accelerometers_bias_along_it() {
    let mut walk = still(5000);
    let roll = |t: f64| 0.1 * (4.0 * t).sin();
    for n in 0..5000 {
        let t = walk.seconds(n);
        walk.gyro[n] = Vector3::new(0.4 * (4.0 * t).cos(), 0.0, 0.0);
        let up = Vector3::new(0.0, roll(t).sin(), roll(t).cos());
        walk.acc[n] = up * (9.81 + 2.0 * (15.0 * t).sin()) + Vector3::new(0.0, 0.0, 0.09);
        walk.down[n] = -up;
    }
    let told = walk.gravity(false).unwrap();
    assert!((told.excess - 0.09).abs() < 0.01, "{}", told.excess);
    assert!(told.up.z > 0.99 && told.std < 0.012);
    assert!(still(100).gravity(false).is_none());
}

/// One foot's labels say that it is in the air for a while in which it carries the robot: it is named, the others are not, and what is left of
/// these windows falls to that of the others.
#[test]
fn a_foot_that_carries_the_robot_while_it_is_said_to_be_in_the_air_is_named() {
    let mut walks = trot();
    let structure = whole();
    let unseen = |walks: &Walks| {
        let data = Data::of(walks, &structure, &[]).unwrap();
        (data.unseen.clone(), data.warnings())
    };
    assert_eq!(unseen(&walks).0, []);
    let (walk, stance) = &mut walks.walks[0];
    let times = (0..walk.len()).map(|n| walk.seconds(n));
    let hidden: Vec<usize> = times
        .enumerate()
        .filter(|(_, t)| (2.0..2.9).contains(t))
        .map(|(n, _)| n)
        .collect();
    hidden.iter().for_each(|n| stance.loaded[*n][1] = false);
    let (feet, warnings) = unseen(&walks);
    println!("{feet:?}");
    assert_eq!(feet.len(), 1);
    let foot = &feet[0];
    assert_eq!(foot.leg, "FL");
    assert!(foot.windows >= 4 && foot.share > 0.05, "{foot:?}");
    assert!(
        foot.rms[1] < 0.05 && foot.rms[0] > 10.0 * foot.rms[1],
        "{foot:?}"
    );
    assert!(warnings.iter().any(|words| words.contains("foot of FL")));
}

/// What the core's window needs of a Go2.
fn core_setup(walk: &Walk, stance: &Stance) -> FreeBaseSetup<f64, COORDINATES, JOINTS, 4> {
    let [moment, force] = super::legged::SCALE_OF_BASE;
    FreeBaseSetup {
        imu: Transform::from_translation(Vector3::from(go2::IMU)),
        feet: go2::feet(),
        scale: std::array::from_fn(|c| match c {
            0..3 => moment,
            3..6 => force,
            _ => 1.0,
        }),
        plausible: std::array::from_fn(|j| plausible(Leg::ALL[j / 3])[j % 3]),
        settings: Settings {
            window_us: stance.window_us,
            ..Settings::default()
        },
        acc_bias: Vector3::zeros(),
        speed_noise: std::array::from_fn(|j| walk.rest.speed_noise[j]),
    }
}

fn core_sample(walk: &Walk, stance: &Stance, n: usize) -> FreeBaseSample<f64, JOINTS, 4> {
    let of = |all: &Channels| std::array::from_fn(|j| all[n][j]);
    let resting = walk.rest.within(&walk.time_us, n, stance.window_us);
    FreeBaseSample {
        joints: Sample {
            time_us: walk.time_us[n],
            q: of(&walk.q),
            dq: of(&walk.dq),
            tau: of(&walk.tau),
        },
        gyro: walk.gyro[n],
        acc: walk.acc[n],
        down: walk.down[n],
        loaded: std::array::from_fn(|f| stance.loaded[n][f]),
        resting: std::array::from_fn(|j| resting[j]),
    }
}

/// Torques of effects that the core knows have its own columns, and all other columns are the core's, whatever feet may carry a force and whichever
/// joints rest: any robot's window is the board's on a Go2.
#[test]
fn projected_torques_are_the_cores() {
    let walks = trot();
    let (walk, stance) = &walks.walks[0];
    let structure = whole();
    let setup = RowSetup::cad(Arc::new(structure.columns()));
    let mut ours = HashMap::new();
    each_window(
        walk,
        stance,
        &setup,
        |_| true,
        |seen| {
            let projection = seen.projection(&setup);
            let effects = setup.columns.effects();
            let columns = effects.map(|(_, n, linear)| projection.column(n, &linear.column));
            let columns: Vec<Vec<f64>> = columns.collect();
            ours.insert(seen.rows.span_us, (columns, seen.rows.clone()));
        },
    );
    let mut window = Box::new(FreeBaseWindow::<
        f64,
        BODIES,
        COORDINATES,
        JOINTS,
        4,
        12,
        4,
        _,
    >::new(
        go2::free(), EffectKind::PLAIN, core_setup(walk, stance)
    ));
    let (mut windows, mut loaded, mut resting) = (0, 0, 0);
    for n in 0..walk.len() {
        if window.push(&core_sample(walk, stance, n)) != FreeBasePush::Closed {
            continue;
        }
        // Touch-downs are no matter of the core's.
        let Some((ours, rows)) = ours.get(&window.rows().span_us) else {
            continue;
        };
        let theirs = window.rows();
        assert_eq!(
            (rows.rank, &rows.resting[..]),
            (theirs.rank, &theirs.resting[..])
        );
        for c in 0..COORDINATES {
            let near = |a: f64, b: f64| (a - b).abs() < 1e-10 * (1.0 + b.abs());
            assert!(near(rows.torque[c], theirs.torque[c]));
            let inertial = rows.inertial(c).as_flattened();
            let mut both = inertial.iter().zip(theirs.inertial[c].as_flattened());
            assert!(both.all(|(a, b)| near(*a, *b)), "{c}");
            assert!((0..3).all(|k| near(rows.acceleration[c][k], theirs.acceleration[c][k])));
        }
        windows += 1;
        loaded += usize::from(window.rows().rank < COORDINATES - JOINTS);
        resting += usize::from(window.rows().resting.contains(&true));
        for (c, own) in window.rows().effects.iter().enumerate() {
            for (k, theirs) in own.as_flattened().iter().enumerate() {
                let size = ours[k].iter().fold(1e-3f64, |most, x| most.max(x.abs()));
                assert!((ours[k][c] - theirs).abs() < 1e-11 * size, "{c} {k}");
            }
        }
    }
    println!("{windows} windows, {loaded} with few equations, {resting} with joints at rest");
    assert!(windows > 20 && loaded > 5 && resting > 10);
}

/// What a window leaves at known parameters is what its rows times these leave: at bodies, effects and sensors that are not the CAD's.
#[test]
fn residuals_are_the_rows_times_their_parameters() {
    let walks = trot();
    let (walk, stance) = &walks.walks[0];
    let model = Model::default();
    let structure = ModelStructure::of(&model).unwrap();
    let sites = structure.candidates(&model);
    let columns = Arc::new(structure.columns_of(sites));
    let mut theta = RowSetup::cad(columns.clone()).theta;
    // As far off as what sensors get wrong may be: thousandths.
    let values = theta.iter_mut().enumerate();
    values.for_each(|(k, x)| *x += 1e-3 * (1.0 + k as f64).sin());
    let loads: Vec<usize> = columns.loads().iter().map(|(k, ..)| *k).collect();
    loads.iter().for_each(|k| theta[*k] = 0.0);
    let setup = RowSetup::at(columns.clone(), theta.clone());
    let windows = windows_of(walk, stance, &setup);
    let effects = impulses(walk, stance, &setup, &setup.sensors, &windows);
    let left = residuals(walk, stance, &setup, &setup.sensors, (&windows, &effects));
    let moved = MovedReadings::default();
    let at = Linearised {
        setup: &setup,
        moved: &moved,
    };
    let (mut own, mut compared) = (0, 0);
    each_row(
        walk,
        stance,
        at,
        &[],
        |_| true,
        |row| {
            let start_us = (row.start * 1e6).round() as u64;
            while windows[own].start_us < start_us {
                own += 1;
            }
            // Sensors are taken off by the readings, and have no columns here but the accelerometer's.
            let right = row.numbers[theta.len()];
            let others = (0..theta.len()).map(|k| row.numbers[k] * theta[k]);
            let expected = others.sum::<f64>() - right;
            let found = left[own][row.coordinate];
            assert!(
                (found - expected).abs() < 1e-9 * (1.0 + right.abs()),
                "{found} {expected}"
            );
            compared += 1;
        },
    );
    assert!(compared > 1000, "{compared}");
}

/// What predicts a part of the time is all blocks but its own and those beside it, however they are put together.
#[test]
fn a_part_is_predicted_by_all_blocks_but_its_neighbours() {
    let walks = trot();
    let data = Data::unjudged(&walks, &whole()).unwrap();
    let (theta, count) = (data.made_at().clone(), data.blocks.len());
    assert!(count >= 2 * PARTS);
    assert_eq!(data.parts.len(), PARTS);
    for (n, part) in data.parts.iter().enumerate() {
        let own = |k: usize| k * PARTS / count == n;
        let near = |k: usize| own(k) || own(k + 1) || k > 0 && own(k - 1);
        let is_all = |sum: &Sum, chosen: &dyn Fn(usize) -> bool| {
            let blocks = data.blocks.iter().enumerate().filter(|(k, _)| chosen(*k));
            let [mut squares, mut equations] = [0.0; 2];
            for (_, block) in blocks {
                squares += block.folded.factor.sum_of_squares(theta.as_slice());
                equations += block.folded.equations;
            }
            assert_eq!(sum.equations, equations);
            assert!((sum.squares(&theta) - squares).abs() < 1e-9 * squares);
        };
        is_all(&part.own, &own);
        is_all(&part.others, &|k| !near(k));
    }
}

/// A log of MuJoCo as it was recorded.
fn recorded(name: &str) -> Walk {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("../tests/oracle/walk/{name}.csv.gz"));
    Walk::read(&path, (Model::default().robot(), &go2_legged()))
        .unwrap()
        .0
}

/// What is done to the readings of gyro and accelerometer.
type Spoilt = fn(&mut Vector3<f64>, &mut Vector3<f64>);

/// Each fault of an IMU is named by its columns and its cause, of a trot and of a robot that sways.
#[test]
fn faults_of_an_imu_are_named() {
    let faults: [(&str, Spoilt); 11] = [
        ("acc/x|y|z are in g:", |_, acc| *acc /= 9.81),
        ("acc/x|y|z are in milli-g:", |_, acc| *acc *= 1e3 / 9.81),
        ("acc/x|y|z are not in m/s²", |_, acc| {
            *acc *= 16_384.0 / 9.81
        }),
        ("acc/x|y|z have gravity removed", |_, acc| acc.z -= 9.81),
        ("acc/x|y|z are zero", |_, acc| acc.fill(0.0)),
        ("acc/x|y|z are constant", |_, acc| acc.fill(9.81)),
        ("acc/x|y|z have the opposite sign", |_, acc| acc.neg_mut()),
        ("gyro/x|y|z are zero", |gyro, _| gyro.fill(0.0)),
        ("gyro/x|y|z are constant", |gyro, _| gyro.fill(0.1)),
        ("gyro/x|y|z are in °/s", |gyro, _| *gyro *= 180.0 / PI),
        ("gyro/x|y|z have the opposite sign", |gyro, _| {
            gyro.neg_mut()
        }),
    ];
    let robot = go2_legged();
    for name in ["trot", "sway"] {
        let walk = recorded(name);
        for (cause, spoil) in faults {
            let mut spoilt = walk.clone();
            for (gyro, acc) in spoilt.gyro.iter_mut().zip(&mut spoilt.acc) {
                spoil(gyro, acc);
            }
            let found = imu::judge(&spoilt, &robot).unwrap_err().to_string();
            assert!(found.contains(cause), "{name}, {cause}: {found}");
        }
    }
}

/// Any gait, also of a robot that is swung by hand, at any place on Earth, with scale errors, at 100 Hz and with the IMU turned: none has a fault.
#[test]
fn an_imu_without_faults_has_none_named() {
    let turns = [
        Vector3::zeros(),
        Vector3::z() * FRAC_PI_2,
        Vector3::z() * PI,
        Vector3::x() * FRAC_PI_2,
        Vector3::x() * PI,
        Vector3::y() * PI,
    ];
    let robot = go2_legged();
    for name in [
        "trot", "load", "leash", "slip", "flying", "hop", "sway", "swung",
    ] {
        let walk = recorded(name);
        for (turn, scale) in turns.iter().zip([1.0, 0.95, 1.05, 1.0, 0.97, 1.03]) {
            let turn = Rotation3::from_scaled_axis(*turn);
            let mut turned = walk.clone();
            turned.gyro.iter_mut().for_each(|gyro| *gyro = turn * *gyro);
            for acc in &mut turned.acc {
                *acc = turn * *acc * scale;
            }
            let judged = imu::judge(&turned, &robot);
            assert!(judged.is_ok(), "{name}, {turn}: {judged:?}");
        }
        let every = (100.0 * walk.period).recip().round() as usize;
        let slow = Walk {
            time_us: walk.time_us.iter().copied().step_by(every).collect(),
            q: Channels::from_fn(walk.len().div_ceil(every), JOINTS, |n, j| {
                walk.q[every * n][j]
            }),
            gyro: walk.gyro.iter().copied().step_by(every).collect(),
            acc: walk.acc.iter().copied().step_by(every).collect(),
            period: walk.period * every as f64,
            ..walk.clone()
        };
        let judged = imu::judge(&slow, &robot);
        assert!(judged.is_ok(), "{name} at 100 Hz: {judged:?}");
    }
}
