//! A few cases of the labelled battery, as the committed table has them; `cargo run --release -p proprio-studies --bin battery`
//! runs them all.

use proprio_tests::battery::case::Case;
use proprio_tests::battery::{record, run};

/// Every so many of the committed cases are run: what takes some seconds.
const STRIDE: usize = 12;
/// And these, for what is said of no other: play for a spring, what changes with time, bursts, values that cannot be, contact in few
/// episodes, a limit of the torque.
const ALWAYS: [&str; 6] = [
    "backlash:RR_calf:0:1",
    "torque_constant_drift:RR_thigh:1:1",
    "cable_snag:FR_hip:1:1",
    "presliding:FR_thigh:1:1",
    "contact:FL_calf:0:2",
    "saturation:RR_hip:2:2",
];

#[test]
fn some_cases_go_as_the_table_says() {
    let committed = std::fs::read_to_string(record::path()).unwrap();
    let names = committed
        .lines()
        .skip(1)
        .filter_map(|row| row.split(',').next());
    let simulated = names.filter(|name| !name.starts_with("mujoco:"));
    let cases: Vec<Case> = simulated
        .step_by(STRIDE)
        .chain(ALWAYS)
        .map(|name| name.parse().unwrap())
        .collect();
    assert!(!cases.is_empty());
    let differences = record::differences(&run(&cases, |_| ()), &committed);
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}

#[test]
fn a_change_shows() {
    let committed = std::fs::read_to_string(record::path()).unwrap();
    let name = committed.lines().nth(1).unwrap().split(',').next().unwrap();
    let case: Case = name.parse().unwrap();
    let mut outcomes = run(&[case], |_| ());
    outcomes[0].named = Some("nonsense:FR_hip".to_owned());
    assert_eq!(record::differences(&outcomes, &committed).len(), 1);
}
