//! Rollouts of simulated logs, whose truth is known.

use std::collections::BTreeMap;

use proprio_core::effect::EffectKind;
use proprio_core::go2::{ACTUATORS, Leg};
use proprio_simulator::{Hide, Sensors, Simulation, hidden};

use super::*;
use crate::estimate::limb_data::tests::recording_of;
use crate::model::{BASE, Model, Robot};
use crate::recording::Recording;

const LEGS: [Leg; 1] = [Leg::FR];
const THIGH: usize = 1;
const CALF: usize = 2;

/// A leg with the typical drive, and these effects beyond; without noise.
fn recording(model: &Model, hide: &[&str], duration: f64) -> Recording {
    let mut effects = hidden::typical(&LEGS);
    for text in hide {
        effects.extend(text.parse::<Hide>().unwrap().on(&LEGS).unwrap());
    }
    let simulation = Simulation {
        duration,
        effects,
        temperature: true,
        sensors: Sensors::ideal(),
        ..Simulation::new(&LEGS)
    };
    recording_of(model, &simulation)
}

/// The CAD's bodies with the drive's true values.
fn drive(data: &LimbData) -> Values {
    let mut values = Values::cad(data.model, data.limb);
    for effect in hidden::typical(&LEGS) {
        let kind = EffectKind::from_name(effect.kind().name()).unwrap();
        let place = (kind, effect.joint().unwrap().place());
        values.insert(place);
        values.set(place, 0, effect.values()[0]);
    }
    values
}

/// Root mean square error of the joints after a time, rad.
fn error(data: &LimbData, values: &Values, seconds: f64) -> f64 {
    let rollouts = Rollouts::of(data, std::slice::from_ref(values), None);
    let spans = spans(data, seconds, false);
    assert!(spans.len() > 4);
    let errors = spans.iter().flat_map(|span| {
        let end = rollouts.run(span, |_, _| ()).unwrap();
        let measured = rollouts.measured(span, span.samples[1]);
        end.into_iter()
            .zip(measured)
            .map(|(a, b)| (a - b).powi(2))
            .collect::<Vec<_>>()
    });
    let errors: Vec<f64> = errors.collect();
    (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
}

/// Each effect, by the simulator's independent one: with its true value the rollout stays with the motion, and without it does not.
#[test]
fn with_the_true_effect_the_rollout_stays_with_the_motion() {
    let model = Model::new(Robot::go2());
    // In motor turns.
    let turns = [0.5, 0.0, 2.0 * ACTUATORS[THIGH].gear];
    // At the joint's origin; first moments are about the body's centre of mass.
    let calf = model.inertia(CALF);
    let from_com = calf.first_moment() / calf.mass() * -0.5;
    let load = [0.5, from_com.x, from_com.y, from_com.z];
    // What the simulator hides; the effect in the catalogue, its joint and its values.
    let table: [(&str, &str, usize, &[f64]); 15] = [
        ("spring:FR_thigh=2,q0=0.5", "spring", THIGH, &[2.0, -1.0]),
        (
            "stribeck:FR_thigh=0.4,vs=0.3",
            "stribeck",
            THIGH,
            &[0.4, 0.3],
        ),
        (
            "presliding:FR_thigh=0.5,zs=0.02",
            "presliding",
            THIGH,
            &[0.5, 0.02],
        ),
        (
            "load_friction:FR_thigh=0.15",
            "load_friction",
            THIGH,
            &[0.15],
        ),
        (
            "quadratic_drag:FR_calf=0.02",
            "quadratic_drag",
            CALF,
            &[0.02],
        ),
        (
            "saturating_viscous:FR_calf=0.5,vs=2",
            "saturating_viscous",
            CALF,
            &[0.5, 2.0],
        ),
        ("cogging:FR_thigh=0.5,k=2", "cogging", THIGH, &turns),
        (
            "coupled_coulomb:FR_calf=0.3",
            "coupled_coulomb",
            CALF,
            &[0.3, 0.0],
        ),
        ("torque_gain:FR_thigh=1.2", "torque_gain", THIGH, &[1.2]),
        ("delay:FR_thigh=0.006", "delay", THIGH, &[0.006]),
        ("current_lag:FR_thigh=0.006", "current_lag", THIGH, &[0.006]),
        ("dead_band:FR_thigh=0.6", "dead_band", THIGH, &[0.6, 1e-3]),
        ("saturation:FR_calf=2.5", "saturation", CALF, &[2.5, 0.1]),
        ("payload:FR_calf=0.5", "payload", CALF, &load),
        ("base_tilt=0.2", "base_tilt", BASE, &[0.2]),
    ];
    let mut errors = BTreeMap::new();
    for (hide, name, joint, numbers) in table {
        let recording = recording(&model, &[hide], 6.0);
        let (limb, samples) = &recording.limbs[0];
        let data = LimbData::of(&model, limb, samples).unwrap();
        let without = drive(&data);
        let mut with = without.clone();
        let place = (EffectKind::from_name(name).unwrap(), joint);
        with.insert(place);
        for (n, number) in numbers.iter().enumerate() {
            with.set(place, n, *number);
        }
        errors.insert(
            hide,
            [&with, &without].map(|values| error(&data, values, 0.1)),
        );
    }
    for (hide, [with, without]) in errors {
        assert!(
            with < 4e-4 && with < 0.05 * without,
            "{hide}: {with} {without}"
        );
    }
}

/// What the constant says of the step's length.
#[test]
fn half_the_step_is_the_same() {
    let model = Model::new(Robot::go2());
    let recording = recording(&model, &["spring:FR_thigh=2"], 6.0);
    let (limb, samples) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, samples).unwrap();
    let rollouts = Rollouts::of(&data, &[drive(&data)], None);
    let mut most = 0.0f64;
    for span in spans(&data, 0.1, false) {
        let [one, half] =
            [STEP, 0.5 * STEP].map(|step| rollouts.run_by(step, &span, |_, _| ()).unwrap());
        most = one
            .iter()
            .zip(half)
            .fold(most, |most, (a, b)| most.max((a - b).abs()));
    }
    assert!(most > 0.0 && most < 5e-5, "{most}");
}
