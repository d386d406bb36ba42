//! The walk against mechanics: flight, stance, contact, friction; convergence and repeatability.

use nalgebra::{UnitQuaternion, Vector3};
use proprio_core::go2::{self, JOINTS, JOINTS_PER_LEG};
use proprio_core::spatial::Force;

use super::mechanics::TRUNK;
use super::plant::{State, generalised};
use super::walker::STEP;
use super::*;
use crate::Hide;

/// A Go2's joints as it stands, rad.
const STANDING: [f64; 3] = [0.0, 0.8, -1.6];

const GRAVITY: f64 = 9.81;

fn ideal(gait: Gait) -> Walk {
    Walk {
        sensors: Sensors::ideal(),
        inertia_error: 0.03,
        ..Walk::new(gait)
    }
}

fn with(walk: Walk, effects: &[&str]) -> Walk {
    let joints = walk.robot.joints();
    let hide = |text: &&str| {
        let hide = Hide::parse(text, &joints).unwrap();
        hide.on_walker(&joints).unwrap()
    };
    Walk {
        effects: effects.iter().flat_map(hide).collect(),
        ..walk
    }
}

/// In the air, turning and with moving legs.
fn thrown(height: f64) -> State {
    let at = |j, _| STANDING[j % JOINTS_PER_LEG] + 0.1 * (j as f64).sin();
    let mut state = State::new(0.0, height, Torques::from_fn(JOINTS, at), LEGS);
    state.orientation = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5);
    state.v.iter_mut().enumerate().for_each(|(n, v)| {
        *v = (1.0 + n as f64).cos() * if n < 6 { 0.8 } else { 2.0 };
    });
    state
}

/// Energy of bodies, rotors, ground and bristles, J; momentum in the world about the whole robot's centre of mass; its velocity, m/s.
fn stored(walk: &Walk, plant: &Plant, state: &State) -> (f64, Vector3<f64>, Vector3<f64>) {
    let mechanics = &plant.mechanics;
    let instant = mechanics.at(&state.base(), &state.q, &state.v);
    let (kinetic, potential) = mechanics.energy(&state.base(), &state.q, &state.v);
    let mut energy = kinetic + potential;
    for leg in 0..LEGS {
        let depth = plant.meeting(&instant, leg).1.depth;
        energy += plant.ground.energy(depth, &state.bent[leg]);
    }
    let dq = state.dq();
    for (j, own) in dq.iter().enumerate() {
        let effects = walk.effects_at(j);
        let armature: f64 = effects.iter().map(|e| e.armature()).sum();
        energy += 0.5 * armature * own * own;
        let coupled: f64 = effects.iter().map(|e| e.coupled_inertia()).sum();
        if coupled > 0.0 {
            energy += 0.5 * coupled * (own + dq[j - 1]).powi(2);
        }
    }
    let (mut momentum, mut whole) = (Force::zero(), InertialParameters::zero());
    let bodies = walk.loaded_bodies();
    for ((inertia, frame), velocity) in bodies.iter().zip(&instant.frames).zip(&instant.velocity) {
        let own = frame.act_force(&inertia.momentum(velocity));
        momentum.angular += own.angular;
        momentum.linear += own.linear;
        whole = whole + inertia.in_parent(frame);
    }
    let com = whole.first_moment() / whole.mass();
    let about_com = momentum.angular - com.cross(&momentum.linear);
    (energy, about_com, momentum.linear / whole.mass())
}

fn step(plant: &mut Plant, state: &mut State, tau: &Torques, h: f64) {
    plant.step(state, tau, h).unwrap();
}

/// A robot that is thrown: its centre of mass falls as a stone, its momentum about that stays, and so does its energy.
#[test]
fn what_nothing_touches_keeps_momentum_and_energy() {
    let walk = with(ideal(Gait::Trot), &["coupled_armature=0.004"]);
    let mut plant = walk.plant().unwrap();
    let mut state = thrown(5.0);
    let (energy, angular, velocity) = stored(&walk, &plant, &state);
    let count = 4000;
    for _ in 0..count {
        step(&mut plant, &mut state, &Torques::zeros(JOINTS), STEP);
    }
    let after = stored(&walk, &plant, &state);
    let fall = velocity + plant.mechanics.gravity() * (f64::from(count) * STEP);
    assert!((after.0 - energy).abs() < 1e-4, "{energy} {after:?}");
    assert!((after.1 - angular).norm() < 1e-5 * angular.norm());
    assert!((after.2 - fall).norm() < 1e-6, "{fall} {after:?}");
}

/// In the air the gears' friction takes μ |transmitted torque| |q̇|, and nothing else takes any; what turns with two joints brakes both.
#[test]
fn friction_takes_the_power_that_it_says() {
    let walk = with(
        ideal(Gait::Trot),
        &["load_friction=0.1", "coupled_viscous=0.02"],
    );
    let mut plant = walk.plant().unwrap();
    let mut state = thrown(5.0);
    let (energy, ..) = stored(&walk, &plant, &state);
    let mut lost = 0.0;
    for _ in 0..4000 {
        let before = state.dq();
        step(&mut plant, &mut state, &Torques::zeros(JOINTS), STEP);
        let dq = (before + state.dq()) / 2.0;
        for j in 0..JOINTS {
            lost += 0.1 * (plant.transmitted()[j] * dq[j]).abs() * STEP;
            if !j.is_multiple_of(JOINTS_PER_LEG) {
                lost += 0.02 * (dq[j] + dq[j - 1]).powi(2) * STEP;
            }
        }
    }
    let (after, ..) = stored(&walk, &plant, &state);
    assert!(lost > 0.05, "{lost}");
    assert!(
        (energy - after - lost).abs() < 0.01 * lost,
        "{} {lost}",
        energy - after
    );
}

/// A bristle is bent by no more than its force, and gives back less than it took.
#[test]
fn bent_bristles_hold_a_joint_and_make_no_energy() {
    let walk = with(ideal(Gait::Trot), &["presliding=0.4,zs=0.05"]);
    let mut plant = walk.plant().unwrap();
    let mut state = thrown(5.0);
    let (start, ..) = stored(&walk, &plant, &state);
    // Half of F zs: what a bristle that is bent all the way has taken up reversibly, at most.
    let bent = JOINTS as f64 * 0.4 * 0.05;
    let mut energy = start;
    for _ in 0..4000 {
        step(&mut plant, &mut state, &Torques::zeros(JOINTS), STEP);
        let (after, ..) = stored(&walk, &plant, &state);
        assert!(after < energy + bent, "{energy} J, then {after} J");
        energy = energy.min(after);
    }
    assert!(start - energy > 0.1, "{start} {energy}");
}

/// The controllers do not feel that a torque is reported late: the log has the same torque, so much later.
#[test]
fn a_late_torque_is_that_of_before() {
    let log = |effects: &[&str]| -> Vec<WalkSample> {
        let walk = Walk {
            duration: 0.5,
            rate: 1000.0,
            ..with(ideal(Gait::Trot), effects)
        };
        walk.samples().map(Result::unwrap).collect()
    };
    let (now, late) = (log(&[]), log(&["delay:FL_calf=0.003"]));
    for n in 3..now.len() {
        assert_eq!(late[n].joints.q, now[n].joints.q);
        let [own, before] = [&late[n], &now[n - 3]].map(|sample| sample.joints.tau[5]);
        assert!((own - before).abs() < 1e-9, "{n}: {own} {before}");
        assert_eq!(late[n].joints.tau[4], now[n].joints.tau[4]);
    }
}

/// A robot whose motors are off falls on its feet and collapses: in every hundredth of a second energy is lost, none is made.
#[test]
fn the_ground_takes_energy_and_gives_none() {
    let walk = with(ideal(Gait::Trot), &["armature=0.01"]);
    let mut plant = walk.plant().unwrap();
    let mut state = thrown(0.36);
    let (start, ..) = stored(&walk, &plant, &state);
    let mut energy = start;
    let mut touched = 0;
    for _ in 0..32 {
        for _ in 0..80 {
            step(&mut plant, &mut state, &Torques::zeros(JOINTS), STEP);
            for force in plant.forces() {
                assert!(force.z >= 0.0 && force.xy().norm() <= 0.9 * force.z * (1.0 + 1e-9));
                touched += usize::from(force.z > 0.0);
            }
        }
        let (after, ..) = stored(&walk, &plant, &state);
        assert!(after < energy + 1e-3, "{energy} J, then {after} J");
        energy = after;
    }
    assert!(
        touched > 500 && start - energy > 5.0,
        "{touched} {start} {energy}"
    );
}

/// Standing: the feet carry the weight, the accelerometer reads gravity, and nothing creeps.
#[test]
fn a_standing_robot_weighs_what_its_bodies_do() {
    let walk = with(
        ideal(Gait::Sway),
        &[
            "coulomb=0.3",
            "armature=0.01",
            "payload:base=2,x=0.05,z=0.07",
        ],
    );
    let mut walker = walk.walker().unwrap();
    walker.advance_to(0.0).unwrap();
    let truth = walker.truth().unwrap();
    let before = walker.state.clone();
    let weight = walk.quantities()[0].value * GRAVITY;
    let carried: f64 = truth.normal.iter().sum();
    assert!(
        (carried / weight - 1.0).abs() < 1e-3,
        "{carried} N of {weight} N"
    );
    assert!(truth.normal.iter().all(|force| *force > 0.1 * weight));
    assert!((truth.acc.norm() - GRAVITY).abs() < 5e-3, "{}", truth.acc);
    let up = before.orientation.inverse() * Vector3::z() * GRAVITY;
    assert!((truth.acc - up).norm() < 1e-2);
    // A tenth of a second on, feet and joints are where they were: no motor of a sway moves yet.
    walker.advance_to(0.01).unwrap();
    assert!((&walker.state.q - &before.q).amax() < 1e-6);
    assert!((walker.state.position - before.position).norm() < 1e-6);
}

/// A force below the friction of a joint moves it by nothing at all, one above does.
#[test]
fn a_joint_that_friction_holds_stays_where_it_is() {
    let walk = with(ideal(Gait::Trot), &["coulomb=0.5"]);
    let q = Torques::from_fn(JOINTS, |j, _| STANDING[j % 3]);
    let mut state = State::new(0.0, 5.0, q, LEGS);
    let mut plant = walk.plant().unwrap();
    for (torque, moves) in [(0.3, false), (0.8, true)] {
        let mut tau = Torques::zeros(JOINTS);
        tau[2] = torque;
        let before = state.q.clone();
        for _ in 0..800 {
            // It falls: no weight is on its joints.
            step(&mut plant, &mut state, &tau, STEP);
        }
        assert_eq!(state.q[2] != before[2], moves);
        assert_eq!(state.v[TRUNK + 5], 0.0);
    }
}

/// What every sample of every gait is: half the step changes joints, trunk and forces little.
#[test]
fn half_the_step_tells_the_same() {
    for gait in Gait::ALL {
        let walk = with(
            ideal(gait),
            &["coulomb=0.2", "viscous=0.03", "armature=0.01"],
        );
        let mut walker = walk.walker().unwrap();
        walker.advance_to(1.0).unwrap();
        let tau = walker.truth().unwrap().tau;
        let ends = [1, 2, 4].map(|parts| {
            let (mut plant, mut state) = (walk.plant().unwrap(), walker.state.clone());
            for _ in 0..160 * parts {
                step(&mut plant, &mut state, &tau, STEP / f64::from(parts));
            }
            state
        });
        let off = |a: &State, b: &State| {
            let trunk = (a.position - b.position).norm();
            trunk.max((&a.q - &b.q).amax())
        };
        let (whole, half) = (off(&ends[0], &ends[2]), off(&ends[1], &ends[2]));
        assert!(whole < 1e-4, "{gait:?}: {whole}");
        assert!(half < 0.7 * whole + 1e-6, "{gait:?}: {half} {whole}");
    }
}

/// The Jacobian of a foot's force is that of its work: force times velocity of the point is torque times joint velocity.
#[test]
fn a_force_works_as_much_at_the_joints_as_at_the_foot() {
    let plant = ideal(Gait::Trot).plant().unwrap();
    let state = thrown(0.3);
    let at = |plant: &Plant, state: &State| plant.mechanics.at(&state.base(), &state.q, &state.v);
    let instant = at(&plant, &state);
    for leg in 0..LEGS {
        let (point, meeting) = plant.meeting(&instant, leg);
        let force = Vector3::new(20.0, -7.0, 50.0);
        let calf = JOINTS_PER_LEG * (leg + 1);
        let works = generalised(&plant.robot, &instant.frames, calf, &point, &force);
        let velocity = meeting.sliding.push(-meeting.rate);
        assert!((works.dot(&state.v) - force.dot(&velocity)).abs() < 1e-9);
        // And that velocity is how the point moves.
        let h = 1e-6;
        let mut later = state.clone();
        let mut falling = ideal(Gait::Trot).plant().unwrap();
        step(&mut falling, &mut later, &Torques::zeros(JOINTS), h);
        let depth = falling.meeting(&at(&falling, &later), leg).1.depth;
        let rate = (depth - meeting.depth) / h;
        assert!(
            (rate - meeting.rate).abs() < 1e-3,
            "{rate} {}",
            meeting.rate
        );
    }
}

/// What the gyro and the accelerometer are to read is how the trunk moves: integrated, they give its velocity.
#[test]
fn the_imu_reads_how_the_trunk_moves() {
    let walk = Walk {
        rate: 4000.0,
        ..ideal(Gait::Flying)
    };
    let mut walker = walk.walker().unwrap();
    let sampled = |n: f64| 1.5 + n / 4000.0;
    walker.advance_to(sampled(-0.5)).unwrap();
    let at = Vector3::from(go2::IMU);
    let velocity = |state: &State| {
        let part = |first| -> Vector3<f64> { state.v.fixed_rows::<3>(first).into() };
        state.orientation * (part(3) + part(0).cross(&at))
    };
    let (before, mut moved) = (walker.state.clone(), Vector3::zeros());
    let mut turned = before.orientation;
    let count = 400;
    for n in 0..count {
        walker
            .advance_to(1.5 + (f64::from(n) + 0.5) / 4000.0)
            .unwrap();
        let truth = walker.truth().unwrap();
        turned *= UnitQuaternion::from_scaled_axis(truth.gyro / 4000.0);
        let acc = walker.state.orientation * truth.acc;
        moved += (acc + walker.plant.mechanics.gravity()) / 4000.0;
    }
    walker.advance_to(sampled(f64::from(count) - 0.5)).unwrap();
    let change = velocity(&walker.state) - velocity(&before);
    assert!(
        change.norm() > 0.1 && (change - moved).norm() < 1e-3,
        "{change} {moved}"
    );
    let off = turned.angle_to(&walker.state.orientation);
    assert!(off < 5e-4, "{off}");
}

#[test]
fn a_seed_gives_one_log_and_another_seed_another() {
    let log = |seed| {
        let usual = Walk::new(Gait::Trot);
        let walk = Walk {
            duration: 0.3,
            inertia_error: 0.03,
            effects: usual.robot.typical(),
            seed,
            ..usual
        };
        walk.samples().collect::<Result<Vec<_>, _>>().unwrap()
    };
    let one = log(1);
    assert_eq!(one.len(), 151);
    assert_eq!(one, log(1));
    assert_ne!(one, log(2));
}

/// Each gait is what its name says: which feet carry the robot, and how many at a time.
#[test]
fn gaits_are_what_their_names_say() {
    for (gait, flies, most_on_two) in [
        (Gait::Trot, false, true),
        (Gait::Flying, true, true),
        (Gait::Hop, true, false),
        (Gait::Sway, false, false),
    ] {
        let walk = with(
            ideal(gait),
            &["coulomb=0.2", "viscous=0.03", "armature=0.01"],
        );
        let mut walker = walk.walker().unwrap();
        let mut counts = [0; LEGS + 1];
        for n in 0..200 {
            walker.advance_to(1.0 + f64::from(n) / 200.0).unwrap();
            let carrying = walker.plant.forces().iter().filter(|f| f.z > 1.0).count();
            counts[carrying] += 1;
        }
        assert_eq!(counts[0] > 10, flies, "{gait:?}: {counts:?}");
        assert_eq!(counts[2] > 100, most_on_two, "{gait:?}: {counts:?}");
    }
}

/// A robot that asks too much of its legs lies, and says when.
#[test]
fn a_robot_that_falls_says_so() {
    let walk = with(Walk::new(Gait::Trot), &["payload:base=60"]);
    let last = walk.samples().last();
    assert!(matches!(last, Some(Err(WalkError::Fell(_)))), "{last:?}");
}

/// Payloads are in the masses as a whole, and not in the bodies.
#[test]
fn the_truth_tells_bodies_loads_and_sensors() {
    let walk = with(
        Walk {
            inertia_error: 0.03,
            ..Walk::new(Gait::Trot)
        },
        &[
            "payload:base=2,x=0.05",
            "payload:FR_calf=0.1",
            "coulomb:FR_hip=0.2",
        ],
    );
    let truth = walk.truth();
    let of = |name: &str| truth.iter().find(|p| p.name == name).unwrap().value;
    let bodies: f64 = truth
        .iter()
        .filter(|p| p.name.starts_with("m:"))
        .map(|p| p.value)
        .sum();
    let total = walk.quantities()[0];
    assert_eq!(total.name, "total_mass");
    assert!((bodies + 2.1 - total.value).abs() < 1e-9 && (bodies - 16.087).abs() > 1e-3);
    assert_eq!((of("payload:base"), of("x:payload:base")), (2.0, 0.05));
    assert_eq!((of("coulomb:FR_hip"), of("viscous:RL_calf")), (0.2, 0.0));
    assert_eq!(of("friction:ground"), 0.9);
    assert!(of("acc_bias.x:imu") != 0.0 && of("gyro_bias.z:imu").abs() < 0.02);
}

#[test]
fn what_cannot_be_hidden_while_walking_is_refused_with_what_can() {
    let joints = WalkRobot::go2().joints();
    let refused = |text: &str| {
        let hide = Hide::parse(text, &joints).unwrap();
        hide.on_walker(&joints).unwrap_err().to_string()
    };
    let said = refused("backlash=0.002");
    assert!(said.starts_with("backlash cannot be hidden") && said.contains("viscous, coulomb"));
    assert!(refused("base_tilt=0.1").contains("base_tilt"));
    let hide: Hide = "payload:base=2".parse().unwrap();
    assert!(hide.on(&go2::Leg::ALL).is_err());
    assert!("coulomb:base=1".parse::<Hide>().is_err());
}

/// A Go2 of which nothing is known but its tree, on these of its feet.
fn unknown(feet: Vec<WalkFoot>) -> Result<WalkRobot, WalkError> {
    of_bodies(WalkRobot::go2().bodies, feet)
}

/// The same with other bodies.
fn of_bodies(bodies: Vec<Body<f64>>, feet: Vec<WalkFoot>) -> Result<WalkRobot, WalkError> {
    let known = WalkRobot::go2();
    WalkRobot::new(bodies, known.facts().to_vec(), feet, known.imu)
}

/// A posture that is found from the tree alone puts each foot on the ground within the joints' stops, and their middle below the centre of mass.
#[test]
fn a_robot_stands_of_which_only_the_tree_is_known() {
    let robot = unknown(WalkRobot::go2().feet).unwrap();
    assert!((robot.heavier - 1.0).abs() < 1e-12 && (robot.longer - 1.0).abs() < 1e-12);
    let stance = robot.stance.as_ref().unwrap();
    let (frames, torque) = mechanics(&robot.bodies).unwrap().held(&stance.q);
    for (foot, home) in robot.feet.iter().zip(&stance.home) {
        let place = frames[foot.body].rotation * foot.middle() + frames[foot.body].translation;
        let off = place - home.push(foot.radius - stance.height);
        assert!(off.norm() < 1e-3, "{off}");
    }
    for (q, facts) in stance.q.iter().zip(robot.facts()) {
        assert!(
            *q > facts.limits[0] && *q < facts.limits[1],
            "{q} {facts:?}"
        );
    }
    // Moments of the weight about the feet's middle.
    let middle = stance.home.iter().sum::<nalgebra::Vector2<f64>>() / LEGS as f64;
    let weight = torque[5];
    let (x, y) = (-torque[1] / weight, torque[0] / weight);
    assert!(
        (x - middle.x).abs() < 1e-3 && (y - middle.y).abs() < 1e-3,
        "{x} {y} {middle}"
    );
}

/// Such a robot trots, flies, hops and sways as a Go2 does, and its feet carry its weight on average.
#[test]
fn a_robot_walks_of_which_only_the_tree_is_known() {
    let robot = Arc::new(unknown(WalkRobot::go2().feet).unwrap());
    for gait in Gait::ALL {
        let walk = Walk {
            robot: Arc::clone(&robot),
            ..with(
                ideal(gait),
                &["coulomb=0.2", "viscous=0.03", "armature=0.01"],
            )
        };
        let mut walker = walk.walker().unwrap();
        let weight = walk.quantities()[0].value * GRAVITY;
        // Whole steps of every gait in five seconds.
        let (mut carried, count) = (0.0, 1250);
        for n in 1..=count {
            walker.advance_to(1.0 + f64::from(n) / 250.0).unwrap();
            let forces = walker.plant.on_feet(walker.plant.forces());
            carried += forces.iter().sum::<f64>() / weight / f64::from(count);
        }
        assert!((carried - 1.0).abs() < 0.05, "{gait:?}: {carried}");
    }
}

/// A Go2 whose thighs hang below its hips' axes, not beside them: its feet go apart, or its trot falls.
#[test]
fn a_narrow_robot_puts_its_feet_apart_and_trots() {
    let known = WalkRobot::go2();
    let mut bodies = known.bodies.clone();
    for leg in 0..LEGS {
        bodies[2 + JOINTS_PER_LEG * leg].placement.translation.y = 0.0;
    }
    let robot = of_bodies(bodies, known.feet).unwrap();
    let stance = robot.stance.as_ref().unwrap();
    let aside = stance.home.iter().map(|home| home.y.abs()).sum::<f64>() / LEGS as f64;
    assert!(aside > 0.4 * stance.height, "{aside} {}", stance.height);
    let walk = Walk {
        robot: Arc::new(robot),
        ..with(
            ideal(Gait::Trot),
            &["coulomb=0.2", "viscous=0.03", "armature=0.01"],
        )
    };
    let mut walker = walk.walker().unwrap();
    // With its feet as drawn it falls within two seconds.
    walker.advance_to(4.0).unwrap();
}

/// Points under three joints a leg carry no robot on two of them: it would fall, and that is said.
#[test]
fn a_robot_does_not_stand_on_two_points() {
    let mut feet = WalkRobot::go2().feet;
    feet.truncate(2);
    let refused = unknown(feet.clone()).unwrap_err();
    assert!(matches!(refused, WalkError::Stance { .. }), "{refused}");
}
