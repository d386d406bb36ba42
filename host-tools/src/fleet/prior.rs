//! What a new robot is taken to be before any data: the fleet. It is a model file, whose effects have the fleet's median as mean and the spread between robots as
//! standard deviation: `proprio identify LOG -m prior.toml`.

use proprio_core::effect::Prior;

use super::answers::{Answers, Population};
use super::columns::place_in_model;
use crate::model::Model;

/// Least standard deviation, relative to the value: a fleet of one make says no more of the next robot.
const LEAST: f64 = 0.01;
/// An effect beyond a plain drive belongs to the fleet's model if its median is so many of its standard deviations from none.
const PRESENT: f64 = 4.0;

/// `robot` with the effects that the fleet has, and their priors. Its own effects, values and priors go.
pub fn prior_model(robot: &Model, answers: &Answers) -> Model {
    let mut model = Model::new(robot.robot().clone());
    for own in &answers.population {
        // A prior in a file is of an effect's first parameter.
        if let Some((effect, joint, 0)) = place_in_model(&own.name, robot.robot()) {
            let parameter = &effect.description().parameters[0];
            let is_there = effect.description().is_plain() || own.value.abs() > PRESENT * own.std;
            let mean = own.value.clamp(parameter.lower, parameter.upper);
            let prior = Prior {
                mean,
                std: std_of(own, mean),
            };
            if is_there {
                // Within the bounds, and positive.
                let _ = model.set_effect_prior(effect, joint, prior);
            }
        }
    }
    model
}

/// Of a new robot: between robots, with the error of the median.
fn std_of(own: &Population, mean: f64) -> f64 {
    let least = (LEAST * mean.abs()).max(f64::MIN_POSITIVE);
    own.spread.hypot(own.std).max(least)
}

#[cfg(test)]
mod tests {
    use super::super::study::few_blocks;
    use super::super::{final_answers, partial};
    use super::*;

    #[test]
    fn a_fleets_prior_is_a_model_file_that_reads_back() {
        let answers = final_answers(partial(few_blocks(6, 8)));
        let model = prior_model(&Model::default(), &answers);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("prior.toml");
        model.save(&path).unwrap();
        let read = Model::load(&path).unwrap();
        let name = "coulomb:FR_calf";
        let (effect, joint, _) = place_in_model(name, read.robot()).unwrap();
        let prior = read.effect_prior(effect, joint).prior;
        let own = answers
            .population
            .iter()
            .find(|own| own.name == name)
            .unwrap();
        assert!(
            (prior.mean - own.value).abs() < 1e-6 && prior.std < 0.2,
            "{prior:?}"
        );
        // The fleet of the study has 0.45 there, and drag; no joint has a spring but one robot's.
        assert!((prior.mean - 0.45).abs() < 0.1, "{prior:?}");
        let names: Vec<&str> = read.effects().iter().map(|e| e.effect.name()).collect();
        assert!(
            names.contains(&"quadratic_drag") && !names.contains(&"spring"),
            "{names:?}"
        );
    }
}
