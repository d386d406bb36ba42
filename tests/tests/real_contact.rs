//! Contact in logs of real Go2s: found where the robot walks, not where it hangs in the air.

use std::path::Path;

use proprio_host::compare::ValuesFrom;
use proprio_host::compare::{Comparison, compare};
use proprio_host::diagnose::{Diagnosis, diagnose};
use proprio_host::model::{Model, Robot};
use proprio_host::recording::Recording;
use proprio_tests::command::recorded_logs;

fn diagnosis(log: &Path) -> Diagnosis {
    let model = Model::new(Robot::go2());
    let recording = Recording::read(&[log.to_owned()], &model, |_, _| ()).unwrap();
    diagnose(&recording, &model).unwrap()
}

fn comparison(log: &Path, values: ValuesFrom) -> Comparison {
    let model = Model::new(Robot::go2());
    let recording = Recording::read(&[log.to_owned()], &model, |_, _| ()).unwrap();
    compare(&recording, &model, values).unwrap()
}

/// The feet that carry a force, as a diagnosis and as a comparison find them.
fn feet(diagnosis: &Diagnosis, comparison: &Comparison) -> [Vec<String>; 2] {
    let found = diagnosis
        .candidates
        .iter()
        .filter(|c| c.effect == "contact");
    let mut feet = [
        found.flat_map(|c| c.joints.clone()).collect::<Vec<_>>(),
        comparison.contact.iter().map(|f| f.joint.clone()).collect(),
    ];
    feet.iter_mut().for_each(|feet| feet.sort());
    feet
}

#[test]
fn a_walking_robot_is_in_contact() {
    let Some(logs) = recorded_logs() else { return };
    let diagnosis = diagnosis(&logs.join("go2_walk_1.csv"));
    let first = &diagnosis.candidates[0];
    assert_eq!(first.effect, "contact", "{diagnosis}");
    assert!(first.joints[0].ends_with("_calf"), "{diagnosis}");
    // 15 kg on two to four legs.
    assert!((20.0..110.0).contains(&first.value), "{diagnosis}");
    assert_eq!(diagnosis.path[0].effect, "contact");
    assert!(diagnosis.reason.contains("contact"), "{diagnosis}");
}

#[test]
fn a_robot_in_the_air_is_not() {
    let Some(logs) = recorded_logs() else { return };
    for name in ["2.0hz_p25d3.0", "9.0hz_p25d1.2"] {
        let diagnosis = diagnosis(&logs.join(format!("go2_air_chirp_{name}.csv")));
        let contact = diagnosis.candidates.iter().find(|c| c.effect == "contact");
        assert!(contact.is_none(), "{name}: {diagnosis}");
    }
}

/// The force of the ground is not taken for friction, whether values are fitted or the model's own.
#[test]
fn a_comparison_blames_no_friction_of_a_walking_robot() {
    let Some(logs) = recorded_logs() else { return };
    for name in ["go2_walk_1.csv", "go2_walk_gaps.csv"] {
        let log = logs.join(name);
        let diagnosis = diagnosis(&log);
        for values in [ValuesFrom::Fitted, ValuesFrom::Given] {
            let comparison = comparison(&log, values);
            let text = comparison.text(true);
            let [diagnosed, compared] = feet(&diagnosis, &comparison);
            assert!(compared.len() > 1, "{text}");
            assert_eq!(diagnosed, compared, "{text}");
            for foot in &comparison.contact {
                // 15 kg on two to four legs.
                assert!((20.0..110.0).contains(&foot.force), "{text}");
                assert!((30.0..70.0).contains(&foot.time_percent), "{text}");
                let told = text
                    .lines()
                    .find(|line| line.starts_with(&format!("Contact: {}", foot.joint)));
                assert!(
                    told.is_some_and(|line| line.contains("which the model does not have")),
                    "{text}"
                );
            }
            assert!(!text.contains("friction"), "{text}");
            assert!(!comparison.warnings.is_empty());
            // All are scored on the same windows: what the model file gives is the CAD here.
            if values == ValuesFrom::Given {
                // Sums over windows and over folds differ in the last digit; a window more would differ in the fourth.
                let cad = comparison.yardsticks.cad_rms;
                assert!((comparison.rms / cad - 1.0).abs() < 1e-12, "{cad}");
            }
        }
    }
}

#[test]
fn a_comparison_finds_no_foot_in_the_air() {
    let Some(logs) = recorded_logs() else { return };
    for name in ["2.0hz_p25d3.0", "9.0hz_p25d1.2"] {
        let log = logs.join(format!("go2_air_chirp_{name}.csv"));
        let comparison = comparison(&log, ValuesFrom::Auto);
        assert!(comparison.contact.is_empty(), "{name}");
        assert!(!comparison.text(true).contains("Contact"), "{name}");
    }
}
