//! A black box finds what is there to be found, and nothing where there is nothing.

use std::fs::File;

use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;

use super::*;
use crate::equation::values::places;
use crate::estimate::fit::{How, LimbFit};
use crate::log::LogWriter;
use crate::model::{Model, Robot};
use crate::recording::Recording;
use proprio_simulator::{Hide, Simulation, hidden};

/// What is left of a front right leg of typical friction, with what is hidden in it besides, under the four effects of every drive.
fn of(hide: &str) -> BlackBox {
    with(hide, |data, predicted| {
        BlackBox::of(std::slice::from_ref(data), &[&predicted]).unwrap()
    })
}

/// What is said of that leg, and of what the model predicts of it.
fn with<T>(hide: &str, say: impl FnOnce(&LimbData, Vec<f64>) -> T) -> T {
    let legs = [Leg::FR];
    let mut effects = hidden::typical(&legs);
    if !hide.is_empty() {
        effects.extend(hide.parse::<Hide>().unwrap().on(&legs).unwrap());
    }
    let simulation = Simulation {
        duration: 20.0,
        effects,
        ..Simulation::new(&legs)
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut log = LogWriter::new(File::create(&path).unwrap(), &legs).unwrap();
    for sample in simulation.samples() {
        let sample = sample.unwrap();
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
            .unwrap();
    }
    log.finish().unwrap();
    let mut model = Model::new(Robot::go2());
    for effect in [
        EffectKind::Viscous,
        EffectKind::Coulomb,
        EffectKind::Armature,
        EffectKind::Bias,
    ] {
        for place in model.robot().place(effect, None).unwrap() {
            model.add_effect(effect, place);
        }
    }
    let recording = Recording::read(&[path], &model, |_, _| ()).unwrap();
    let (limb, data) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, data).unwrap();
    let own: Vec<_> = places(&model, limb).map(|(place, _)| place).collect();
    let fit = LimbFit::of(&data, &own, &How::default()).unwrap();
    let predicted = fit.predicted_held_out().unwrap();
    say(&data, predicted)
}

/// What windows in doubt have in common with the motion is no structure; what the others have is.
#[test]
fn what_is_in_doubt_says_little() {
    const JOINT: usize = 1;
    let shares = with("", |data, mut predicted| {
        let n = data.joints();
        let speed = |w: usize| {
            let of = |k: usize| data.motion.joint[JOINT].state[k][1];
            data.motion.mean(&data.motion.windows[w], of)
        };
        let counting = || (0..data.left_out.len()).filter(|&w| data.counts(w, JOINT));
        let is_off = |w: usize| speed(w).abs() < 1.0;
        // A friction of 0.1 N m that the model lacks at low speeds.
        for w in counting().filter(|w| is_off(*w)) {
            predicted[w * n + JOINT] -= 0.1 * speed(w).signum();
        }
        let doubt = |times: f64, of: &dyn Fn(usize) -> bool| -> Vec<f64> {
            counting()
                .map(|w| if of(w) { times } else { 0.0 })
                .collect()
        };
        let share = |doubt: &[f64]| Explained::of(data, &predicted, JOINT, doubt).unwrap().share;
        [
            share(&doubt(0.0, &is_off)),
            share(&doubt(30.0, &is_off)),
            share(&doubt(30.0, &|w| !is_off(w))),
        ]
    });
    let [all, without, with] = shares;
    assert!(all > 0.5 && with > 0.5 && without < 0.1, "{shares:?}");
}

#[test]
fn nothing_is_taken_from_noise() {
    let boxes = of("");
    let past = boxes.rungs[2].rms;
    assert!(past > 0.95 * boxes.rms, "{boxes:?}");
}

/// Drag that grows with the square of the velocity is told by the joint's own motion at that moment.
#[test]
fn a_joints_own_friction_needs_no_more_than_the_joint() {
    let boxes = of("quadratic_drag:FR_thigh=0.1");
    let [joint, _, past] = [0, 1, 2].map(|n| boxes.rungs[n].rms);
    assert!(joint < 0.5 * boxes.rms, "{boxes:?}");
    assert!(joint.powi(2) - past.powi(2) < 0.2 * (boxes.rms.powi(2) - joint.powi(2)));
}

/// Friction that depends on how far the joint has gone since it turned round needs the past.
#[test]
fn presliding_friction_is_a_matter_of_what_came_before() {
    let boxes = of("presliding:FR_calf=1,zs=0.2");
    let [joint, limb, past] = [0, 1, 2].map(|n| boxes.rungs[n].rms);
    assert!(past < 0.8 * limb && past < 0.8 * joint, "{boxes:?}");
}
