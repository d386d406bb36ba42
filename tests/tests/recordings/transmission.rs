//! What is recorded before the gear.

use std::fs;

use proprio_tests::command::{done, folder, proprio, stderr};

use super::{recordings, table, unpacked};

/// What is recorded before the gear becomes what the joints do: positions through the inverse of the transmission, torque
/// through its transpose, so that power is the same.
#[test]
fn motors_are_seen_through_their_transmission() {
    let text = unpacked(&recordings().join("joint_state.csv.gz"));
    let expected = table(&text);
    // The calf's motor sits at the hip's side of the thigh: it turns with both.
    let ratios = [[6.0, 0.0, 0.0], [0.0, 6.0, 0.0], [0.0, -3.0, 12.0]];
    let leg = ["FR_hip", "FR_thigh", "FR_calf"];
    let number = |channel: &str, joint: usize, row: usize| {
        f64::from_bits(expected[&format!("{channel}/{}", leg[joint])][row])
    };
    let mut log = "t".to_owned();
    for channel in ["q", "dq", "tau"] {
        log += &leg
            .iter()
            .map(|joint| format!(",{channel}_motor/{joint}"))
            .collect::<String>();
    }
    for row in 0..expected["t"].len() {
        log += &format!("\n{}", f64::from_bits(expected["t"][row]));
        for channel in ["q", "dq"] {
            for motor in ratios {
                let turns: f64 = (0..3).map(|j| motor[j] * number(channel, j, row)).sum();
                log += &format!(",{turns}");
            }
        }
        // τ = Gᵀ τ_m, from the last joint to the first.
        let tau = |joint| number("tau", joint, row);
        let calf = tau(2) / 12.0;
        log += &format!(",{},{},{calf}", tau(0) / 6.0, (tau(1) + 3.0 * calf) / 6.0);
    }
    let folder = folder();
    fs::write(folder.path().join("motors.csv"), log + "\n").unwrap();
    let model = "format = 1\n[robot]\nbuiltin = \"go2\"\n[log.transmission]\nFR_hip = { FR_hip = 6.0 }\nFR_thigh = { \
                 FR_thigh = 6.0 }\nFR_calf = { FR_thigh = -3.0, FR_calf = 12.0 }\n";
    fs::write(folder.path().join("go2.toml"), model).unwrap();
    done(
        folder.path(),
        &["import", "motors.csv", "-m", "go2.toml", "-o", "joints.csv"],
    );
    let found = table(&fs::read_to_string(folder.path().join("joints.csv")).unwrap());
    for (name, numbers) in &found {
        for (a, b) in numbers.iter().zip(&expected[name]) {
            let (a, b) = (f64::from_bits(*a), f64::from_bits(*b));
            assert!(
                (a - b).abs() < 1e-12 * (1.0 + b.abs()),
                "{name}: {a} instead of {b}"
            );
        }
    }
    assert_eq!(found.len(), 10);
    // One of two coupled motors alone says nothing of either joint; a singular transmission, nothing at all.
    let text = fs::read_to_string(folder.path().join("motors.csv")).unwrap();
    fs::write(
        folder.path().join("motors.csv"),
        text.replace("q_motor/FR_thigh", "q/FR_thigh"),
    )
    .unwrap();
    let import = [
        "import",
        "motors.csv",
        "-m",
        "go2.toml",
        "-o",
        "joints.csv",
        "--force",
    ];
    let half = proprio(folder.path(), &import);
    assert!(stderr(&half).contains("are coupled"), "{}", stderr(&half));
    fs::write(folder.path().join("motors.csv"), text).unwrap();
    fs::write(
        folder.path().join("go2.toml"),
        model.replace("FR_hip = 6.0", "FR_thigh = 6.0"),
    )
    .unwrap();
    let singular = proprio(folder.path(), &import);
    assert!(
        stderr(&singular).contains("cannot be inverted"),
        "{}",
        stderr(&singular)
    );
}
