//! A few logs that MuJoCo made, through the command line, against their truth; and a torque that nothing may explain.
//! `cargo run --release -p proprio-tests --bin battery_logged` runs all.

use proprio_tests::battery::logged::nonsense::{self, Nonsense};
use proprio_tests::battery::logged::{self, truth};
use proprio_tests::command::binary;

/// What is wrong today and known to be, case by case: an entry that is no longer wrong has to go.
const KNOWN: [&str; 1] = ["sample-elasticity-08"];

#[test]
fn mujocos_logs_are_understood() {
    let cases = truth::cases(&logged::mujoco_sample()).unwrap();
    assert_eq!(cases.len(), 12);
    let judgements = logged::run(binary(), &cases, |_| ());
    let mut wrong = Vec::new();
    for judgement in &judgements {
        let (name, errors) = (&judgement.case.truth.name, judgement.errors());
        if KNOWN.contains(&name.as_str()) == errors.is_empty() {
            wrong.push(format!("{name}: {}", errors.join("; ")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_effect_explains_a_random_torque() {
    let all = nonsense::explained(binary(), Nonsense::SquareWave, 2, 1).unwrap();
    for explained in &all {
        assert!(explained.r2 <= nonsense::MOST, "{explained:?}");
    }
}
