//! Logs that MuJoCo made (`tests/oracle/mujoco_logs.py`), judged as those of the simulator are.

use std::path::Path;

use proprio_core::effect::EffectKind;
use proprio_host::compare::{ValuesFrom, compare};
use proprio_host::diagnose::diagnose;
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use serde::Deserialize;

use proprio_tests::battery::case::Group;
use proprio_tests::battery::outcome::{Outcome, judge};

/// `truth.json`.
#[derive(Deserialize)]
struct Truth {
    logs: std::collections::BTreeMap<String, Log>,
}

/// What one log has.
#[derive(Deserialize)]
struct Log {
    hidden: Vec<String>,
    parameters: std::collections::BTreeMap<String, f64>,
}

/// Diagnoses all of them: the model has what the leg has, without values, but for what is hidden.
pub fn run() -> Vec<Outcome> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/oracle/mujoco");
    let truth = std::fs::read_to_string(folder.join("truth.json")).expect("truth.json is there");
    let truth: Truth = serde_json::from_str(&truth).expect("truth.json can be read");
    let judged = truth.logs.into_iter().map(|(name, log)| {
        let mut model = Model::default();
        let places = log.parameters.keys().filter(|p| p.split(':').count() == 2);
        let (hidden, known): (Vec<_>, Vec<_>) = places.partition(|p| log.hidden.contains(p));
        known.into_iter().for_each(|place| add(&mut model, place));
        let path = folder.join(format!("{name}.csv.gz"));
        let recording = Recording::read(&[path], &model, |_, _| ()).expect("the log is good");
        let diagnosis = diagnose(&recording, &model).expect("10 s are long enough");
        hidden.into_iter().for_each(|place| add(&mut model, place));
        let mut outcome = judge(&diagnosis, log.hidden);
        outcome.case = format!("mujoco:{name}");
        if outcome.hidden.is_empty() {
            outcome.group = Group::Complete;
            outcome.floor = Some(diagnosis.held_out_rms);
        } else {
            outcome.floor = compare(&recording, &model, ValuesFrom::Fitted)
                .ok()
                .map(|c| c.rms);
        }
        outcome
    });
    judged.collect()
}

/// Adds `EFFECT:JOINT` to a model.
fn add(model: &mut Model, place: &str) {
    let (effect, joint) = place.split_once(':').expect("EFFECT:JOINT");
    let effect = EffectKind::from_name(effect).expect("an effect of the catalogue");
    let joint = model.robot().joint(joint).expect("a joint of the robot");
    model.add_effect(effect, joint);
}
