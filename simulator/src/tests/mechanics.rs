//! The motion against mechanics: energy, inverse dynamics, statics, the limits of stiff springs and dry friction.

use super::*;
use nalgebra::Vector3;
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;

fn vector(v: &[f64]) -> Vector3<f64> {
    Vector3::from_column_slice(v)
}

fn energy(tree: &Tree<f64, 3, 3>, q: &Vector3<f64>, dq: &Vector3<f64>) -> f64 {
    let base = Transform::identity();
    let (kinetic, potential) = tree.energy(&tree.kinematics(&base, q, dq), &base);
    kinetic + potential
}

/// The motors' work is the change of energy plus what friction turns into heat, dry friction and rotors included.
#[test]
fn work_is_energy_plus_heat() {
    let (viscous, dry, armature) = (0.05, [0.15, 0.12, 1.5], [0.005, 0.0, 0.016]);
    let mut simulation = ideal(&[
        "viscous=0.05",
        "coulomb:FR_hip=0.15",
        "coulomb:FR_thigh=0.12",
    ]);
    simulation.effects.extend(effect("coulomb:FR_calf=1.5"));
    simulation.effects.extend(effect("armature:FR_hip=0.005"));
    simulation.effects.extend(effect("armature:FR_calf=0.016"));
    simulation.inertia_error = 0.06;
    simulation.rate = 4000.0;
    let samples = log(&simulation);
    let tree = go2::leg::<f64>(Leg::FR).with_inertia(&simulation.bodies(Leg::FR));
    let stored = |s: &SimulatedSample| {
        let dq = vector(&s.dq);
        let rotors: f64 = (0..3).map(|j| 0.5 * armature[j] * dq[j] * dq[j]).sum();
        energy(&tree, &vector(&s.q), &dq) + rotors
    };
    let (mut work, mut heat) = (0.0, 0.0);
    for pair in samples.windows(2) {
        let dt = pair[1].t - pair[0].t;
        for j in 0..3 {
            let [v0, v1] = [pair[0].dq[j], pair[1].dq[j]];
            // The samples are the middles of holds: the torque changes half-way between.
            let middle = (pair[1].q[j] - pair[0].q[j]) / dt;
            work += dt / 4.0 * (pair[0].tau[j] * (v0 + middle) + pair[1].tau[j] * (middle + v1));
            heat += dt * (viscous * middle * middle + dry[j] * middle.abs());
        }
    }
    let change = stored(&samples[samples.len() - 1]) - stored(&samples[0]);
    let error = work - heat - change;
    assert!(work.abs() + heat > 5.0, "work {work} J, heat {heat} J");
    assert!(
        error.abs() < 2e-3 * heat,
        "{error} J of work {work} J and heat {heat} J"
    );
}

/// A leg that nobody drives: what energy it loses is heat.
#[test]
fn a_passive_leg_keeps_its_energy() {
    for (dry, most) in [(0.0, 1e-6), (0.05, 2e-4)] {
        let simulation = ideal(&[&format!("coulomb={dry}")]);
        let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
        let tree = go2::leg::<f64>(Leg::FR);
        let start = energy(&tree, &leg.state().q, &leg.state().dq);
        let mut heat = 0.0;
        for _ in 0..8000 {
            let before = leg.state().q;
            leg.step_passively(1.25e-4);
            heat += dry * (leg.state().q - before).abs().sum();
        }
        let state = leg.state();
        assert!(state.q.amax() > 0.1, "it falls");
        let lost = start - energy(&tree, &state.q, &state.dq);
        assert!(
            (lost - heat).abs() < most,
            "friction {dry}: lost {lost} J, heat {heat} J"
        );
    }
}

/// The torque of every effect that is one, by its formula, is what inverse dynamics leaves of the motor's torque with the
/// simulator's own accelerations.
#[test]
fn the_effects_torque_is_what_inverse_dynamics_leaves() {
    type Formula = fn(f64, f64, f64, f64) -> f64;
    let sign = |dq: f64| (dq / 5e-4).clamp(-1.0, 1.0);
    // Torque from q, q̇, q̈ and the torque that is handed to the link, with the same `sign` of a velocity.
    let formulas: [(&str, Formula); 13] = [
        ("viscous:FR_thigh=0.3", |_, dq, _, _| 0.3 * dq),
        ("coulomb:FR_thigh=0.6", |_, dq, _, _| 0.6 * dq.signum()),
        ("armature:FR_thigh=0.01", |_, _, ddq, _| 0.01 * ddq),
        ("bias:FR_thigh=-0.2", |_, _, _, _| -0.2),
        (
            "asymmetric_coulomb:FR_thigh=0.5,F_minus=0.2",
            |_, dq, _, _| {
                if dq > 0.0 { 0.5 } else { -0.2 }
            },
        ),
        ("asymmetric_viscous:FR_thigh=-0.07", |_, dq, _, _| {
            -0.07 * dq.abs()
        }),
        ("stribeck:FR_thigh=0.4,vs=0.7", |_, dq, _, _| {
            0.4 * (-dq * dq / 0.49).exp() * dq.signum()
        }),
        ("load_friction:FR_thigh=0.2", |_, dq, _, load| {
            0.2 * load.abs() * dq.signum()
        }),
        ("quadratic_drag:FR_thigh=0.1", |_, dq, _, _| {
            0.1 * dq * dq.abs()
        }),
        ("saturating_viscous:FR_thigh=0.4,vs=1.5", |_, dq, _, _| {
            0.4 * (1.0 - (-dq.abs() / 1.5).exp()) * dq.signum()
        }),
        ("spring:FR_thigh=2,q0=0.3", |q, _, _, _| 2.0 * (q - 0.3)),
        ("cogging:FR_thigh=0.3,psi=0.5,k=2", |q, _, _, _| {
            0.3 * (2.0 * 6.333 * q + 0.5).sin()
        }),
        ("position_coulomb:FR_thigh=0.3", |q, dq, _, _| {
            0.3 * (1.0 + (3.0 * (q - 0.9)).sin()) * dq.signum()
        }),
    ];
    for (text, formula) in formulas {
        let simulation = ideal(&[text]);
        let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
        let tree = go2::leg::<f64>(Leg::FR);
        let mut compared = 0;
        for n in 1..150 {
            leg.advance_to(0.0131 * f64::from(n)).unwrap();
            let state = *leg.state();
            let a = leg.accelerations();
            let k = tree.kinematics(&Transform::identity(), &state.q, &state.dq);
            let rigid = tree.inverse_dynamics(&k, &state.dq, &a.link);
            let left = leg.report().tau - rigid;
            let (q, dq) = (state.q[1], state.dq[1]);
            if sign(dq).abs() < 1.0 {
                continue;
            }
            // A spring acts on the link, beyond the gear; the friction's load is what the gear hands over.
            let expected = formula(q, dq, a.link[1], rigid[1]);
            assert!(
                (left[1] - expected).abs() < 1e-9,
                "{text}: {} {expected}",
                left[1]
            );
            assert!(
                left[0].abs() < 1e-9 && left[2].abs() < 1e-9,
                "{text}: {left}"
            );
            compared += 1;
        }
        assert!(compared > 100, "{text}: {compared}");
    }
}

/// What turns with the sum of two joints acts on both alike, and on no other.
#[test]
fn a_coupling_acts_on_both_joints() {
    // Torque from the sum of the velocities and that of the accelerations.
    type Formula = fn(f64, f64) -> f64;
    let formulas: [(&str, Formula); 3] = [
        ("coupled_armature:FR_calf=0.004", |_, ddq| 0.004 * ddq),
        ("coupled_viscous:FR_calf=0.05", |dq, _| 0.05 * dq),
        ("coupled_coulomb:FR_calf=0.2", |dq, _| {
            0.2 * (dq / 0.03).tanh()
        }),
    ];
    for (text, formula) in formulas {
        let simulation = ideal(&[text]);
        let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
        let tree = go2::leg::<f64>(Leg::FR);
        let mut most: f64 = 0.0;
        for n in 1..150 {
            leg.advance_to(0.0131 * f64::from(n)).unwrap();
            let state = *leg.state();
            let a = leg.accelerations();
            let k = tree.kinematics(&Transform::identity(), &state.q, &state.dq);
            let left = leg.report().tau - tree.inverse_dynamics(&k, &state.dq, &a.link);
            let expected = formula(state.dq[1] + state.dq[2], a.link[1] + a.link[2]);
            assert!(left[0].abs() < 1e-9, "{text}: {left}");
            for j in [1, 2] {
                assert!(
                    (left[j] - expected).abs() < 1e-9,
                    "{text}: {left} {expected}"
                );
            }
            most = most.max(expected.abs());
        }
        assert!(most > 0.01, "{text}: {most}");
    }
}

/// Dahl's friction is a function of the path alone: between two reversals exponential in the displacement, whatever the speed.
#[test]
fn presliding_friction_follows_the_path() {
    const STEP: f64 = 2e-4;
    let (size, displacement) = (0.4, 0.03);
    let simulation = ideal(&["presliding:FR_thigh=0.4,zs=0.03"]);
    let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
    let tree = go2::leg::<f64>(Leg::FR);
    let (mut bent, mut last, mut most) = (0.0f64, leg.state().q[1], 0.0f64);
    for n in 1..10_000 {
        leg.advance_to(STEP * f64::from(n)).unwrap();
        let state = *leg.state();
        let way: f64 = state.q[1] - last;
        bent = way.signum() + (bent - way.signum()) * (-way.abs() / displacement).exp();
        last = state.q[1];
        let a = leg.accelerations();
        let k = tree.kinematics(&Transform::identity(), &state.q, &state.dq);
        let left = leg.report().tau - tree.inverse_dynamics(&k, &state.dq, &a.link);
        // Where it turns round between two looks the path is a little longer.
        let off = (left[1] - size * bent).abs();
        assert!(off < 2e-4, "{n}: {} {}", left[1], size * bent);
        most = most.max(left[1].abs());
    }
    assert!(most > 0.9 * size, "{most}");
}

/// The accelerations are those of the logged motion: a step integrates what `accelerations` says.
#[test]
fn the_velocity_follows_the_accelerations() {
    let simulation = ideal(&[
        "viscous=0.1",
        "elasticity:FR_calf=300",
        "load_friction:FR_hip=0.2",
    ]);
    let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
    leg.advance_to(1.0).unwrap();
    let (before, h) = (*leg.state(), 1e-5);
    let a = leg.accelerations();
    leg.advance_to(1.0 + h).unwrap();
    let slope = (leg.state().dq - before.dq) / h;
    assert!(
        (slope - a.link).amax() < 2e-3 * (1.0 + a.link.amax()),
        "{slope} {}",
        a.link
    );
    let slope = (leg.state().motor_dq - before.motor_dq) / h;
    assert!(
        (slope - a.motor).amax() < 2e-3 * (1.0 + a.motor.amax()),
        "{slope} {}",
        a.motor
    );
}

/// At rest the motors hold gravity as the tilt, the payload and the foot's force make it.
#[test]
fn statics_are_those_of_tilt_payload_and_contact() {
    let tree = go2::leg::<f64>(Leg::FR);
    let still = |text: &str| {
        let simulation = Simulation {
            motion: Motion::Moves,
            ..ideal(&[text])
        };
        // Moves begin after 0.2 s of rest; without friction the controller has settled by then.
        let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
        leg.advance_to(0.19).unwrap();
        let state = *leg.state();
        let zero = Vector3::zeros();
        let mut base = Transform::identity();
        base.rotation = *nalgebra::Rotation3::from_euler_angles(0.3, -0.2, 0.0).matrix();
        let level = tree.kinematics(&Transform::identity(), &state.q, &zero);
        let tilted = tree.kinematics(&base, &state.q, &zero);
        let left = leg.report().tau - tree.gravity_torque(&level);
        (
            left,
            state.q,
            tree.gravity_torque(&tilted) - tree.gravity_torque(&level),
        )
    };
    let (left, _, expected) = still("base_tilt=0.3,pitch=-0.2");
    assert!(
        (left - expected).amax() < 2e-2 && left.amax() > 0.1,
        "{left} {expected}"
    );

    // The foot is 0.213 m below the knee, the knee as far below the hip's axis: planar geometry of thigh and calf.
    let (left, q, _) = still("contact:FR_calf=5,x=3,start=0,length=10,period=20");
    let reach = |a: f64| [-0.213 * a.sin(), -0.213 * a.cos()];
    let ([x1, z1], [x2, z2]) = (reach(q[1]), reach(q[1] + q[2]));
    let torque = |x: f64, z: f64, fz: f64| -(z * 3.0 - x * fz);
    let fz = 5.0 * q[0].cos();
    let expected = [torque(x1 + x2, z1 + z2, fz), torque(x2, z2, fz)];
    assert!((left[1] - expected[0]).abs() < 2e-2, "{left} {expected:?}");
    assert!((left[2] - expected[1]).abs() < 2e-2, "{left} {expected:?}");

    let (left, q, _) = still("payload:FR_calf=0.2,z=-0.1");
    let weight = -0.2 * 9.81 * q[0].cos();
    let [x2, _] = [-0.1 * (q[1] + q[2]).sin(), 0.0];
    assert!(
        (left[2] - x2 * weight).abs() < 2e-2,
        "{left}, {}",
        x2 * weight
    );
}

#[test]
fn a_stiff_spring_is_a_rigid_gear() {
    let rigid = log(&ideal(&["armature:FR_calf=0.016", "coulomb:FR_calf=0.5"]));
    let mut before = f64::MAX;
    for k in ["1e2", "1e3", "1e4", "1e5"] {
        let spring = format!("elasticity:FR_calf={k},d=1");
        let soft = log(&ideal(&[
            "armature:FR_calf=0.016",
            "coulomb:FR_calf=0.5",
            &spring,
        ]));
        let pairs = rigid.iter().zip(&soft);
        let worst = pairs.fold(0.0f64, |m, (a, b)| m.max((a.q[2] - b.q[2]).abs()));
        assert!(worst < 0.5 * before, "{k}: {worst} rad after {before} rad");
        before = worst;
    }
    assert!(before < 2e-4, "{before} rad");
}

/// A joint with dry friction of any size and no armature stands still where it should, and does not chatter.
#[test]
fn dry_friction_sticks() {
    let simulation = Simulation {
        motion: Motion::Moves,
        duration: 10.0,
        ..ideal(&["coulomb=1.5"])
    };
    let samples = log(&simulation);
    let at_rest = samples.iter().filter(|s| s.dq[2].abs() < 5e-4).count();
    assert!(at_rest > samples.len() / 50, "{at_rest} samples at rest");
    // In a rest, the velocity of neighbouring samples does not alternate.
    let flips = samples.windows(3).filter(|w| {
        let v = [w[0].dq[2], w[1].dq[2], w[2].dq[2]];
        v[0] * v[1] < 0.0 && v[1] * v[2] < 0.0 && v.iter().all(|v| v.abs() > 1e-3)
    });
    assert_eq!(flips.count(), 0);
}
