//! What is promised is what a prediction and a least-squares solution say.

use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;

use super::*;
use crate::equation::link_response::Responses;
use crate::equation::values::{Place, Values};
use crate::estimate::fit::How;
use crate::estimate::limb_data::LimbData;
use crate::model::{Model, Robot};
use crate::recording::Recording;
use proprio_simulator::{Simulation, hidden};

fn recording(model: &Model) -> Recording {
    let legs = [Leg::FR];
    let simulation = Simulation {
        duration: 6.0,
        effects: hidden::typical(&legs),
        inertia_error: 0.1,
        ..Simulation::new(&legs)
    };
    let samples: Result<Vec<_>, _> = simulation.samples().collect();
    Recording::from_samples(model, &Leg::FR.joint_names(), &samples.unwrap())
}

/// To first order the torques answer as the predictor has them: of a play and of a spring of a usual size within a tenth.
#[test]
fn responses_are_differences_of_predictions() {
    let model = Model::new(Robot::go2());
    let recording = recording(&model);
    let (limb, samples) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, samples).unwrap();
    let plain = Values::cad(&model, limb);
    let windows: Vec<usize> = (0..data.motion.windows.len()).collect();
    let responses = Responses::of(&data.motion, &data.body, &plain, &windows);
    let without = data.predicted(&plain, &|_| true);
    for (effect, size) in EffectKind::COMPLIANT.into_iter().zip([2e-3, 5e-3]) {
        for joint in 0..data.joints() {
            let place: Place = (effect, joint);
            let mut values = plain.clone();
            values.insert(place);
            values.set(place, 0, size);
            let with = data.predicted(&values, &|_| true);
            let told = responses.of_size(place, size);
            let (mut wrong, mut all) = (0.0, 0.0);
            for ((with, without), told) in with.iter().zip(&without).zip(&told) {
                wrong += (with - without - told).powi(2);
                all += (with - without).powi(2);
            }
            assert!(all > 0.0 && wrong < 0.01 * all, "{place:?} {wrong} {all}");
        }
    }
}

/// Loads that are a little other ones make the same of links, much heavier ones do not.
#[test]
fn responses_hold_for_loads_that_are_alike() {
    let model = Model::new(Robot::go2());
    let recording = recording(&model);
    let (limb, samples) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, samples).unwrap();
    let plain = Values::cad(&model, limb);
    let responses = Responses::of(&data.motion, &data.body, &plain, &[0]);
    for (times, alike) in [(1.0, true), (1.02, true), (1.5, false)] {
        let mut values = plain.clone();
        let heavier = values.bodies[2].map(|x| times * x);
        values.bodies[2] = heavier;
        assert_eq!(responses.hold_for(&data.body, &values), alike, "{times}");
    }
}

/// A column of the fit's own explains nothing more, what the fit leaves explains all of it, and half of that is still right.
#[test]
fn what_is_left_falls_by_what_is_not_explained_yet() {
    let model = Model::new(Robot::go2());
    let recording = recording(&model);
    let (limb, samples) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, samples).unwrap();
    let places = [(EffectKind::Viscous, 0), (EffectKind::Bias, 1)];
    let fit = LimbFit::of(&data, &places, &How::default()).unwrap();
    let predicted = fit.predicted();
    let left = LeftOver::of(&fit, &predicted).unwrap();
    let n = data.joints();
    let of = |x: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let windows = left.windows.iter();
        windows
            .flat_map(|&w| (0..n).map(move |j| (w, j)))
            .map(|(w, j)| x(w, j))
            .collect()
    };
    let residual = of(&|w, j| data.torque[w * n + j] - predicted[w * n + j]);
    let rows = data.rows(&fit.at, &fit.columns);
    let own = of(&|w, j| {
        if j == 0 {
            rows.row(w, 0)[fit
                .columns
                .place(0, fit.columns.of_effect(EffectKind::Viscous, 0)[0])
                .unwrap()]
        } else {
            0.0
        }
    });
    let nothing = vec![0.0; residual.len()];
    let square = left.residual.norm_squared();
    let times = |x: &[f64], times: f64| -> Vec<f64> { x.iter().map(|x| times * x).collect() };
    let fall = |x: &[f64]| left.fall_between([&nothing, x], n);
    assert!(fall(&own).0 < 0.01 * square && fall(&times(&own, -1.0)).0 < 0.01 * square);
    let (all, share) = fall(&residual);
    assert!(
        share > 0.95 && all > 0.8 * square && all < 1.0001 * square,
        "{all} {share}"
    );
    let (less, share) = fall(&times(&residual, 0.5));
    assert!(
        share == 1.0 && less > 0.6 * square && less < 0.8 * square,
        "{less} {share}"
    );
    let (same, share) = fall(&times(&residual, 2.0));
    assert!(
        (share - 0.5).abs() < 0.05 && (same - all).abs() < 1e-3 * all,
        "{same} {share}"
    );
    // A number without a response goes back to what its prior says, and that of the residual all the way.
    let step = left
        .coefficients(&[residual, nothing], &[0.0, 2.0], n)
        .unwrap();
    assert!((step.by[0] - 1.0).abs() < 0.05, "{:?}", step.by);
    assert!((step.by[1] + 2.0).abs() < 1e-9, "{:?}", step.by);
    assert!(
        step.std[0] < 0.05 && (step.std[1] - 1.0).abs() < 1e-9,
        "{:?}",
        step.std
    );
    assert!(step.fall > 0.8 * square && step.fall < 1.0001 * square);
    let step = left.coefficients(&[own], &[0.0], n).unwrap();
    assert!(
        step.by[0].abs() < 0.05 && step.fall < 0.01 * square,
        "{:?}",
        step.by
    );
}
