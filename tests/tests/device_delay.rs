//! What a device calls a delay is the torque's: neither its stamps nor its windows add one.

use proprio_tests::command::{done, json, simulated};

/// Without dry friction, whose sticking looks like one, a robot whose torque is not late has no delay.
#[test]
fn a_robot_that_hides_no_delay_has_none_on_the_device() {
    let folder = simulated("--legs FR,RL --duration 30 --typical --hide coulomb=0");
    let told = json(&done(
        folder.path(),
        &["replay", "log.csv", "--to", "desktop", "--json"],
    ));
    let all = told["diagnoses"].as_array().unwrap();
    let delays: Vec<_> = all.iter().filter(|d| d["effect"] == "delay").collect();
    assert_eq!(delays.len(), 6);
    for delay in delays {
        let of = |key: &str| delay[key].as_f64().unwrap();
        assert!(of("value").abs() < 4.0 * of("std"), "{delay}");
        assert!(
            of("value").abs() < 2e-4 && of("held_out_gain") < 5e-3,
            "{delay}"
        );
    }
}
