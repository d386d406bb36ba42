//! A few logs that MuJoCo made, through the command line, against their truth; and a torque that nothing may explain.
//! `cargo run --release -p proprio-studies --bin battery_logged` runs all.

use proprio_tests::battery::logged::nonsense::{self, Nonsense};
use proprio_tests::battery::logged::{self, truth};
use proprio_tests::command::binary;

#[test]
fn mujocos_logs_are_understood() {
    let cases = truth::cases(&logged::mujoco_sample()).unwrap();
    assert_eq!(cases.len(), 12);
    let judgements = logged::run(binary(), &cases, |_| ());
    let mut wrong = Vec::new();
    for judgement in &judgements {
        let (name, errors) = (&judgement.case.truth.name, judgement.errors());
        if !errors.is_empty() {
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
