//! What is kept for later fits changes nothing in them.

use std::fs::File;

use proprio_core::effect::{EffectKind, Prior};
use proprio_core::go2::Leg;

use super::*;
use crate::estimate::fit::{How, LimbFit};
use crate::log::LogWriter;
use crate::model::Robot;
use crate::recording::Recording;
use proprio_simulator::{Simulation, hidden};

fn recording(model: &Model) -> Recording {
    let legs = [Leg::FR];
    recording_of(
        model,
        &Simulation {
            duration: 6.0,
            effects: hidden::typical(&legs),
            inertia_error: 0.1,
            ..Simulation::new(&legs)
        },
    )
}

/// What is read of a simulated log.
pub(crate) fn recording_of(model: &Model, simulation: &Simulation) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut log = LogWriter::new(File::create(&path).unwrap(), &simulation.legs).unwrap();
    for sample in simulation.samples() {
        let sample = sample.unwrap();
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
            .unwrap();
    }
    log.finish().unwrap();
    Recording::read(&[path], model, |_, _| ()).unwrap()
}

const OWN: [Place; 5] = [
    (EffectKind::Viscous, 0),
    (EffectKind::Coulomb, 1),
    (EffectKind::Bias, 2),
    (EffectKind::Presliding, 2),
    (EffectKind::Cogging, 1),
];

/// Models that differ in one thing each.
fn models(data: &LimbData) -> Vec<Values> {
    let mut plain = Values::cad(data.model, data.limb);
    for place in OWN {
        plain.insert(place);
        plain.set(place, 0, 0.3);
    }
    plain.set(OWN[3], 1, 0.01);
    plain.set(OWN[4], 2, 12.0);
    let with = |place: Place, parameter: usize, value: f64| {
        let mut values = plain.clone();
        values.insert(place);
        values.set(place, parameter, value);
        values
    };
    let mut heavier = plain.clone();
    heavier.bodies[2][0] *= 1.3;
    vec![
        plain.clone(),
        heavier,
        with(OWN[1], 0, 0.5),
        with(OWN[3], 1, 0.02),
        with((EffectKind::EncoderOffset, 1), 0, 0.02),
        with((EffectKind::Elasticity, 2), 0, 1e-3),
        with((EffectKind::Backlash, 2), 0, 5e-3),
        with((EffectKind::Delay, BASE), 0, 2e-3),
        with((EffectKind::Delay, 1), 0, 2e-3),
        with((EffectKind::BaseTilt, BASE), 1, 0.03),
        with((EffectKind::TorqueGain, 0), 0, 1.1),
        plain,
    ]
}

/// What a file states of the base's tilt is the tilt's, and what it states of a delay at the first joint is not all joints' delay.
#[test]
fn what_limbs_share_has_the_prior_of_the_base() {
    let mut model = Model::new(Robot::go2());
    let prior = |mean: f64, std: f64| Prior { mean, std };
    let recording = recording(&model);
    let (limb, samples) = &recording.limbs[0];
    let catalogue = |model: &Model, place: Place| {
        let data = LimbData::of(model, limb, samples).unwrap();
        data.prior(place, 0)
    };
    let [tilt, delay] = [EffectKind::BaseTilt, EffectKind::Delay].map(|effect| (effect, BASE));
    let unsaid = catalogue(&model, delay);
    (model.set_effect_prior(tilt.0, BASE, prior(0.02, 1e-3))).unwrap();
    (model.set_effect_prior(delay.0, limb.bodies.start, prior(4e-3, 1e-4))).unwrap();
    assert_eq!(catalogue(&model, tilt), (0.02, 1e-3));
    assert_eq!(catalogue(&model, delay), unsaid);
}

#[test]
fn rows_do_not_depend_on_what_was_asked_before() {
    let model = Model::new(Robot::go2());
    let recording = recording(&model);
    let (limb, samples) = &recording.limbs[0];
    let fresh = || LimbData::of(&model, limb, samples).unwrap();
    let warm = fresh();
    let all: Vec<Place> = (EffectKind::ALL.iter())
        .filter(|effect| warm.can_tell((**effect, 0)))
        .flat_map(|&effect| (0..3).map(move |joint| (effect, joint)))
        .chain([(EffectKind::Delay, BASE), (EffectKind::BaseTilt, BASE)])
        .filter(|place| place.0 != EffectKind::BaseTilt || place.1 == BASE)
        .filter(|place| !OWN.contains(place))
        .collect();
    let sets: Vec<Vec<Place>> = [all.clone(), Vec::new()]
        .into_iter()
        .chain(all.iter().map(|place| vec![*place]))
        .collect();
    for (m, values) in models(&warm).iter().enumerate() {
        // All of a catalogue at once, and later each alone.
        let chosen = if m % 4 == 3 { &sets[..] } else { &sets[..2] };
        for candidates in chosen {
            let columns = warm.columns(values, &OWN, candidates);
            let [ours, exact] = [&warm, &fresh()].map(|data| data.rows(values, &columns));
            for w in 0..warm.motion.windows.len() {
                for j in 0..3 {
                    let pairs = ours.row(w, j).iter().zip(exact.row(w, j)).enumerate();
                    for (c, (a, b)) in pairs {
                        let column = columns.of_joint[j][c];
                        let close = (a - b).abs() <= 1e-9 * (1e-3 + b.abs());
                        assert!(close, "model {m}, {column:?}: {a} {b}");
                    }
                }
            }
        }
    }
}

/// A linear model's prediction by its columns is the predictor's.
#[test]
fn what_a_fit_predicts_is_what_the_predictor_says() {
    let model = Model::new(Robot::go2());
    let recording = recording(&model);
    let (limb, samples) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, samples).unwrap();
    let late = (EffectKind::Delay, BASE);
    let mut start = models(&data)[7].clone();
    start.insert(late);
    let how = How {
        start: Some(start),
        held: vec![late],
        ..How::default()
    };
    let fit = LimbFit::of(&data, &[&OWN[..], &[late]].concat(), &how).unwrap();
    let held_out = data.predicted_by_fold(&fit.held_out().unwrap());
    let pairs = [
        (fit.predicted(), data.predicted(&fit.values, &|_| true)),
        (fit.predicted_held_out().unwrap(), held_out),
    ];
    for (ours, exact) in pairs {
        assert!(ours.iter().any(|x| x.abs() > 0.1));
        for (a, b) in ours.iter().zip(&exact) {
            assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a} {b}");
        }
    }
}
