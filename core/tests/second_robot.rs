//! Another robot than the one that the crate has been built for: two legs of two joints, other motors, other ids on a slower bus. From the
//! bytes of its buses to its parameters, by what is public.
#![cfg(feature = "app")]

use nalgebra::{Matrix3, Vector2, Vector3};
use proprio_core::Real;
use proprio_core::app::Alignment;
use proprio_core::base_parameters::BaseParameters;
use proprio_core::bus::{Command, Listener, Mode, Queue, Reply};
use proprio_core::effect::EffectKind;
use proprio_core::estimator::{
    EFFECTS, EffectPrior, JointFactors, Layout, LimbPrior, Solver, plausible, solver_len,
};
use proprio_core::factor::packed_len;
use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::robot::{Actuator, Robot};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Body, Joint, Tree};
use proprio_core::window::{Push, Settings, Window};

const JOINTS: usize = 2;
const PARAMETERS: usize = INERTIAL * JOINTS;
const LEG: Layout<JOINTS> = Layout::chain(EFFECTS.len());

/// What is known of a leg before.
type BirdPrior = LimbPrior<f64, [EffectPrior; JOINTS * EFFECTS.len()], JOINTS>;

/// A bird: left and right leg, each of hip and knee.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bird {
    Left,
    Right,
}

impl Robot<JOINTS> for Bird {
    const LEGS: &'static [Self] = &[Self::Left, Self::Right];
    // The hip's is the higher one: a polling cycle has the knee first.
    const MOTOR_IDS: [u8; JOINTS] = [7, 4];
    const ACTUATORS: [Actuator; JOINTS] = [
        Actuator {
            gear: 9.1,
            rotor_inertia: 8e-5,
            effort: 30.0,
            velocity: 20.0,
        },
        Actuator {
            gear: 5.5,
            rotor_inertia: 4e-5,
            effort: 15.0,
            velocity: 30.0,
        },
    ];
    const BASE_COLUMNS: [usize; JOINTS] = [6, 3];
    const BAUD: u32 = 1_000_000;

    fn tree<T: Real>(self) -> Tree<T, JOINTS, JOINTS> {
        tree(self, [1.0; JOINTS])
    }

    fn position_limits(self) -> [[f64; 2]; JOINTS] {
        [[-1.5, 1.5], [-0.2, 2.2]]
    }
}

/// The leg with its bodies' masses and inertias multiplied.
fn tree<T: Real>(which: Bird, scale: [f64; JOINTS]) -> Tree<T, JOINTS, JOINTS> {
    let side = if which == Bird::Left { 1.0 } else { -1.0 };
    let vector = |x: f64, y: f64, z: f64| Vector3::new(x, y, z).map(nalgebra::convert::<f64, T>);
    let link = |mass: f64, length: f64, scale: f64| {
        let across = mass * length * length / 10.0;
        let about_com = Matrix3::from_diagonal(&Vector3::new(across, across, 4e-4));
        let com = Vector3::new(0.01, 0.015 * side, -0.4 * length);
        let body = InertialParameters::from_com(mass, com, about_com);
        InertialParameters((body.0 * scale).map(nalgebra::convert::<f64, T>))
    };
    let body = |parent, placement, inertia| Body {
        parent,
        placement: Transform::from_translation(placement),
        joint: Joint::Revolute(Vector3::y()),
        inertia,
    };
    let thigh = body(
        None,
        vector(0.0, 0.08 * side, 0.0),
        link(1.4, 0.25, scale[0]),
    );
    let shank = body(
        Some(0),
        vector(0.0, 0.03 * side, -0.25),
        link(0.5, 0.3, scale[1]),
    );
    Tree::new([thigh, shank]).expect("a chain")
}

/// What the bird that is simulated has, and its CAD and catalogue do not know: bodies so much heavier, and its joints' effects.
const SCALE: [f64; JOINTS] = [1.08, 0.93];
const TRUTH: [[f64; EFFECTS.len()]; JOINTS] = [[0.25, 0.5, 0.008, -0.3], [0.08, 0.3, 0.0015, 0.2]];

/// Position, velocity and acceleration of a joint at `t` seconds.
fn motion(joint: usize, t: f64) -> [f64; 3] {
    let (middle, waves) = match joint {
        0 => (0.0, [(0.5, 3.1, 0.0), (0.3, 7.7, 1.0), (0.08, 17.0, 2.0)]),
        _ => (1.0, [(0.5, 4.3, 0.5), (0.3, 9.1, 0.2), (0.06, 21.0, 1.4)]),
    };
    waves
        .iter()
        .fold([middle, 0.0, 0.0], |[q, dq, ddq], (a, w, p)| {
            let (sin, cos) = (w * t + p).sin_cos();
            [q + a * sin, dq + a * w * cos, ddq - a * w * w * sin]
        })
}

/// What a joint's motor says at `t` seconds.
fn reply(leg: &Tree<f64, JOINTS, JOINTS>, joint: usize, t: f64) -> Reply {
    let state = [0, 1].map(|joint| motion(joint, t));
    let [q, dq, ddq] = [0, 1, 2].map(|n| Vector2::new(state[0][n], state[1][n]));
    let at = leg.kinematics(&Transform::identity(), &q, &dq);
    let body = leg.inverse_dynamics(&at, &dq, &ddq)[joint];
    let [viscous, coulomb, armature, bias] = TRUTH[joint];
    let tau =
        body + viscous * dq[joint] + coulomb * dq[joint].signum() + armature * ddq[joint] + bias;
    let mode = Mode::foc(Bird::MOTOR_IDS[joint]);
    let gear = Bird::ACTUATORS[joint].gear;
    Reply::from_joint(mode, gear, q[joint], dq[joint], tau, 30).expect("within the wire's range")
}

/// The estimates of one leg and their standard deviations, after so many polling cycles of 2 ms.
fn identified(which: Bird, cycles: u64) -> (Vec<f64>, Vec<f64>) {
    let truth = tree(which, SCALE);
    let (mut queue, mut listener) = (Queue::new(), Listener::<JOINTS>::new());
    let mut alignment = Alignment::<f64, Bird, JOINTS>::new();
    let settings = Settings {
        skip_repeated: false,
        ..Settings::DEFAULT
    };
    let mut window = Window::<f64, JOINTS, PARAMETERS, { EFFECTS.len() }>::new(
        which.tree(),
        Transform::identity(),
        EFFECTS,
        plausible(which),
        settings,
    );
    let mut data = JointFactors::new(LEG, [0.0; LEG.packed_len()]);
    let byte_us = u64::from(Bird::BYTE_NS) / 1000;
    for cycle in 0..cycles {
        let mut time_us = 2_000 * cycle;
        for (joint, id) in Bird::MOTOR_IDS.into_iter().enumerate() {
            let command = Command {
                mode: Mode::foc(id),
                ..Command::default()
            };
            time_us += Command::LEN as u64 * byte_us;
            queue.push(&command.encode(0), time_us, Bird::BYTE_NS);
            time_us += 20 + Reply::LEN as u64 * byte_us;
            let reply = reply(&truth, joint, time_us as f64 * 1e-6);
            queue.push(&reply.encode(0), time_us, Bird::BYTE_NS);
        }
        while let Some(replies) = listener.next(&mut queue, &mut { usize::MAX }) {
            let sample = alignment.sample(replies, settings.max_gap_us);
            if window.push(&sample) == Push::Closed {
                for joint in 0..JOINTS {
                    let mut row = [0.0; LEG.columns(0) + 1];
                    let row = &mut row[..=LEG.columns(joint)];
                    window.rows().write_row(joint, LEG.subtree(joint), row);
                    data.fold(joint, row).expect("the row is finite");
                }
            }
        }
    }
    // The ids are learnt within some cycles; from then on none is lost.
    assert_eq!(listener.schedule().ids, [4, 7]);
    assert!(data.windows() > 0.99 * (cycles / 10) as f64);
    let prior = BirdPrior::of(which);
    let mut solver = Solver::new(data, [0.0; solver_len(LEG.parameters())]);
    solver.restart(&prior);
    while !solver.advance().expect("the prior leaves nothing open") {}
    (solver.values().to_vec(), solver.std().to_vec())
}

#[test]
fn bytes_of_its_bus_become_its_parameters_within_their_errors() {
    for which in Bird::LEGS.iter().copied() {
        let (values, std) = identified(which, 15_000);
        let parameters = |scale| tree::<f64>(which, scale).parameters::<PARAMETERS>();
        let (truth, cad) = (parameters(SCALE), parameters([1.0; JOINTS]));
        for n in 0..PARAMETERS {
            let error = (values[n] - truth[n]).abs();
            assert!(error < 3.0 * std[n], "{which:?} θ{n}: {error} ± {}", std[n]);
        }
        // The moments along the links are seen by gravity alone: the data have moved them from the CAD's to the truth.
        for hz in [3, 13] {
            let (before, after) = (cad[hz] - truth[hz], values[hz] - truth[hz]);
            assert!(after.abs() < 0.5 * before.abs(), "{which:?} θ{hz}: {after}");
        }
        for (joint, truth) in TRUTH.iter().enumerate() {
            for (n, truth) in truth.iter().enumerate() {
                let place = LEG.effect_index(joint, n);
                let (value, std) = (values[place], std[place]);
                let prior = EffectPrior::of(EFFECTS[n], &Bird::ACTUATORS[joint])
                    .prior
                    .std;
                let name = EFFECTS[n].name();
                println!("{which:?} {joint} {name}: {value:.5} ± {std:.5}, truth {truth}");
                assert!(
                    (value - truth).abs() < 3.0 * std,
                    "{which:?} {joint} {name}: {value} ± {std}"
                );
                // A rotor turns with its link about the same axis: how much of the sum is whose, the prior alone says.
                let told = if EFFECTS[n] == EffectKind::Armature {
                    1.0
                } else {
                    0.3
                };
                assert!(
                    std < told * prior,
                    "{which:?} {joint} {name}: ± {std}, before ± {prior}"
                );
            }
        }
    }
}

#[test]
fn it_has_as_many_base_columns_as_it_says() {
    for which in Bird::LEGS.iter().copied() {
        for joint in 0..JOINTS {
            let columns = INERTIAL * (JOINTS - joint);
            let (mut storage, mut row) = (vec![0.0; packed_len(columns)], vec![0.0; columns + 1]);
            let base = BaseParameters::of_joint::<JOINTS, JOINTS, PARAMETERS>(
                &which.tree::<f64>(),
                joint,
                &mut storage[..],
                &mut row,
            )
            .expect("the slices fit");
            assert_eq!(base.rank(), Bird::BASE_COLUMNS[joint], "{which:?} {joint}");
        }
    }
}
