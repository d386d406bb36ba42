//! An effect that lives here alone, in `detent`, and its twin in the simulator, `twin`: the desktop knows it as it knows the catalogue's,
//! and finds it where it is hidden.
//!
//! A program of its own: what is registered is registered for all of a process, and no other test is to find it.

mod detent;
mod twin;

use detent::DETENT;
use proprio_core::effect::EffectKind;
use proprio_core::go2::{JointId, Leg};
use proprio_host::catalogue::{self, RegisterError};
use proprio_host::compare::{ValuesFrom, choices, compare};
use proprio_host::diagnose::{Verdict, diagnose};
use proprio_host::identify::fit_model;
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_simulator::{HiddenEffect, HiddenKind, SimulatedSample, Simulation, hidden};
use twin::TWIN;

const JOINT: &str = "FR_thigh";
/// Greatest torque, N m, and how far from the place it is, rad.
const TRUTH: [f64; 2] = [1.2, 0.12];

fn registered() -> EffectKind {
    catalogue::register(DETENT).expect("a torque at its own joint")
}

/// A leg that has what every drive has, and the detent.
fn recording() -> Recording {
    let joint = JointId::from_name(JOINT);
    let detent = HiddenEffect::new(HiddenKind::Own(&TWIN), joint, TRUTH[0]);
    let detent = detent.and_then(|effect| effect.with("s", TRUTH[1]));
    let mut effects = hidden::typical(&[Leg::FR]);
    effects.push(detent.expect("within its bounds"));
    let simulation = Simulation {
        effects,
        inertia_error: 0.03,
        ..Simulation::new(&[Leg::FR])
    };
    let truth = simulation.truth();
    let stated = truth.iter().find(|value| value.name == "detent:FR_thigh");
    assert_eq!(stated.map(|value| value.value), Some(TRUTH[0]));
    let samples: Vec<SimulatedSample> = simulation.samples().map(Result::unwrap).collect();
    Recording::from_samples(&Model::default(), &Leg::FR.joint_names(), &samples)
}

/// A model that has what every drive has.
fn plain() -> Model {
    let mut model = Model::default();
    for joint in 0..3 {
        for effect in EffectKind::PLAIN {
            model.add_effect(effect, joint);
        }
    }
    model
}

/// The same with the detent.
fn with_detent() -> Model {
    let mut model = plain();
    let effect = catalogue::effect_named("detent").expect("it is registered");
    let places = model.robot().place(effect, Some(JOINT)).expect("a joint");
    model.add_last(&[(effect, places[0])]);
    model
}

#[test]
fn it_is_in_the_list_of_effects() {
    let effect = registered();
    assert_eq!(catalogue::effects().last(), Some(effect));
    assert_eq!(catalogue::register(DETENT), Ok(effect));
    let mut other = DETENT;
    other.description.words = "something else";
    let taken = RegisterError::Taken("detent");
    assert_eq!(catalogue::register(other), Err(taken));
    assert_eq!(effect.name(), "detent");
}

#[test]
fn it_is_found_where_it_is_hidden() {
    registered();
    let diagnosis = diagnose(&recording(), &plain()).unwrap();
    assert_eq!(diagnosis.verdict, Verdict::Missing);
    let first = &diagnosis.candidates[0];
    println!("{first:?}\n{:?}", diagnosis.path);
    assert_eq!(
        (first.effect, &*first.joints),
        ("detent", &[JOINT.to_owned()][..])
    );
    assert_eq!(diagnosis.path[0].effect, "detent");
    assert!(diagnosis.path[0].held_out_rms < 1.1 * diagnosis.yardsticks.noise_floor_rms.unwrap());
}

#[test]
fn it_is_identified_with_its_shape() {
    registered();
    let fitted = fit_model(&recording(), &with_detent(), Default::default()).unwrap();
    for (name, truth) in [
        ("detent:FR_thigh", TRUTH[0]),
        ("detent.s:FR_thigh", TRUTH[1]),
    ] {
        let found = fitted.parameter(name).unwrap();
        println!("{name}: {} ± {}, truth {truth}", found.value, found.std);
        assert!((found.value - truth).abs() < 3.0 * found.std, "{name}");
        assert!(found.std < 0.1 * truth, "{name}");
    }
}

#[test]
fn compare_and_its_page_know_it() {
    registered();
    let (recording, plain, more) = (recording(), plain(), with_detent());
    let before = compare(&recording, &plain, ValuesFrom::Fitted).unwrap();
    let added = compare(&recording, &more, ValuesFrom::Auto).unwrap();
    println!("{} → {}", before.rms, added.rms);
    assert_eq!(added.added, ["detent:FR_thigh"]);
    assert!(added.rms < 0.5 * before.rms);
    let choices = choices(&recording, &more).unwrap();
    let mut listed = choices.limbs[0].effects.iter();
    assert!(
        listed.any(|choice| choice.effect == "detent" && choice.joint == JOINT && choice.there)
    );
}

#[test]
fn a_model_file_comes_back_with_it() {
    let effect = registered();
    let mut model = with_detent();
    let joint = model.robot().joint(JOINT).unwrap();
    model
        .set_effect(effect, joint, TRUTH[0], Some(0.02))
        .unwrap();
    model
        .set_parameter(effect, joint, 1, TRUTH[1], Some(0.003))
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    model.save(&path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("name = \"detent\""), "{text}");
    assert_eq!(Model::load(&path).unwrap().effects(), model.effects());
}
