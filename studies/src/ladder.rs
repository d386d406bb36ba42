//! A diagnosis' ladder on logs that it has not seen: does an effect that one log asks for make another one's error larger?

use proprio_core::effect::EffectKind;
use proprio_host::compare::ValuesFrom;
use proprio_host::compare::compare;
use proprio_host::diagnose::diagnose;
use proprio_host::identify::{FitOptions, fit_model};
use proprio_host::model::{Model, Provenance};
use proprio_host::recording::Recording;

use proprio_tests::device_fit::Failure;

/// One step of the ladder.
#[derive(Debug, Clone)]
pub struct Rung {
    /// `+ coulomb FR_calf RL_calf`.
    pub step: String,
    /// Error of the model so far, its values fitted to the diagnosed log, in each of the other logs: root mean square over all
    /// joints, N m.
    pub elsewhere: Vec<f64>,
}

/// Diagnoses `train` from the URDF alone, and says after each step how well the model predicts `others`.
///
/// # Errors
/// Whatever diagnosis, fit and comparison say.
pub fn ladder(train: &Recording, others: &[Recording]) -> Result<Vec<Rung>, Failure> {
    let mut model = Model::default();
    let diagnosis = diagnose(train, &model)?;
    let mut rungs = vec![rung("the URDF alone".to_owned(), &model, train, others)?];
    for step in &diagnosis.path {
        let effect = EffectKind::from_name(step.effect).ok_or("no such effect")?;
        for joint in &step.joints {
            let joint = (joint != "base").then_some(joint.as_str());
            for place in model.robot().place(effect, joint)? {
                if step.removed {
                    model.remove_effect(effect, place);
                } else {
                    model.add_effect(effect, place);
                }
            }
        }
        let sign = if step.removed { '-' } else { '+' };
        let words = format!("{sign} {} {}", step.effect, step.joints.join(" "));
        rungs.push(rung(words, &model, train, others)?);
    }
    Ok(rungs)
}

fn rung(
    step: String,
    model: &Model,
    train: &Recording,
    others: &[Recording],
) -> Result<Rung, Failure> {
    let options = FitOptions::PHYSICAL;
    let fitted = fit_model(train, model, options)?;
    let provenance = Provenance::of(&train.logs).map_err(|(log, e)| format!("{log}: {e}"))?;
    let filled = fitted.to_model(model, provenance)?;
    let elsewhere = others
        .iter()
        .map(|other| Ok(compare(other, &filled, ValuesFrom::Given)?.rms))
        .collect::<Result<_, Failure>>()?;
    Ok(Rung { step, elsewhere })
}
