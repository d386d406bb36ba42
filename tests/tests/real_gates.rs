//! What the data gates say of logs recorded on real Go2s.

use proprio_core::go2::ACTUATORS;
use proprio_host::gate::{DataGates, Gate, GateReport, Joint, Reading};
use proprio_host::log::Log;
use proprio_tests::command::recorded_logs;

/// Passes a log through the gates, sample by sample.
fn gates(log: &Log) -> GateReport {
    let joints = log.joints.iter().map(|channel| Joint {
        name: channel.joint.name().to_owned(),
        effort: ACTUATORS[channel.joint.place()].effort,
    });
    let mut gates = DataGates::new(joints);
    for (k, t) in log.t.iter().enumerate() {
        let readings = log.joints.iter().map(|channel| Reading {
            q: channel.q[k],
            dq: channel.dq[k],
            tau: channel.tau[k],
            temperature: channel.temp.as_ref().map(|temp| temp[k]),
        });
        let time_us = ((t - log.t[0]) * 1e6).round() as u64;
        gates.push(time_us, &readings.collect::<Vec<_>>());
    }
    gates.report()
}

const CHIRPS: [&str; 5] = [
    "2.0hz_p25d3.0",
    "7.0hz_p25d5.0",
    "9.0hz_p25d1.2",
    "9.0hz_p25d2.0",
    "9.0hz_p25d5.0",
];

/// The two motors that report their velocity 9 % too high are found in every chirp, and no other motor ever is.
#[test]
fn two_motors_report_their_velocity_too_high() {
    let Some(folder) = recorded_logs() else {
        return;
    };
    let mut logs: Vec<_> = CHIRPS
        .map(|name| (format!("go2_air_chirp_{name}.csv"), true))
        .to_vec();
    // Another robot, whose motors are all right.
    logs.push(("go2_walk_1.csv".to_owned(), false));
    for (name, faulty) in logs {
        let report = gates(&Log::read(&folder.join(&name)).unwrap());
        let gains = report
            .findings
            .iter()
            .filter(|f| f.gate == Gate::VelocityGain);
        let blamed: Vec<&String> = gains.flat_map(|f| &f.joints).collect();
        let expected: &[&str] = if faulty { &["FR_hip", "FR_thigh"] } else { &[] };
        assert_eq!(blamed, expected, "{name}\n{report}");
        for joint in &report.joints {
            let gain = joint.velocity.unwrap().gain;
            let range = if expected.contains(&joint.joint.as_str()) {
                1.07..1.13
            } else {
                1.0..1.02
            };
            assert!(range.contains(&gain), "{name} {}: {gain}", joint.joint);
        }
    }
}

#[test]
fn the_words_for_a_chirp_and_for_a_log_with_gaps() {
    let Some(folder) = recorded_logs() else {
        return;
    };
    let words = |name: &str| {
        let log = Log::read(&folder.join(name)).unwrap();
        let findings = gates(&log).findings;
        findings
            .iter()
            .map(|finding| format!("{finding}\n"))
            .collect::<String>()
    };
    insta::assert_snapshot!("gates_of_a_chirp", words("go2_air_chirp_9.0hz_p25d2.0.csv"));
    insta::assert_snapshot!("gates_of_a_log_with_gaps", words("go2_walk_gaps.csv"));
}
