//! Contact in logs of real Go2s: found where the robot walks, not where it hangs in the air.

use std::path::Path;

use proprio::criticism::{Diagnosis, Recording, diagnose};
use proprio::model::{Model, Robot};
use proprio_tests::command::recorded_logs;

fn diagnosis(log: &Path) -> Diagnosis {
    let model = Model::new(Robot::go2());
    let recording = Recording::read(&[log.to_owned()], &model, |_, _| ()).unwrap();
    diagnose(&recording, &model).unwrap()
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
