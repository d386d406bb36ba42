//! Motions of the trunk: over planted feet, and of a robot that hangs.

use std::fs;

use proprio_tests::command::{done, folder, proprio, stderr};

use super::json;

/// The trunk's motion over planted feet, quick to find and as long as the committed walks.
const STANDING: [&str; 8] = [
    "excite",
    "--standing",
    "--starts",
    "1",
    "--harmonics",
    "4",
    "--duration",
    "4.5",
];

#[test]
fn a_motion_of_the_trunk_over_planted_feet_is_designed_and_told() {
    let folder = folder();
    let here = folder.path();
    let design = json(&done(
        here,
        &[&STANDING[..], &["--json", "-o", "sway.csv"]].concat(),
    ));
    for key in ["condition_number", "log_det", "seconds"] {
        assert!(design[key].is_f64(), "{key}: {design}");
    }
    assert_eq!(
        (design["violations"].as_u64(), design["rank"].as_u64()),
        (Some(0), Some(10))
    );
    assert!(design["cone"].as_f64().unwrap() <= 1.0);
    assert!(design["least_load"].as_f64().unwrap() >= 10.0);
    let trunk = design["trunk"].as_array().unwrap();
    let names: Vec<&str> = trunk.iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names[..4], ["m:base", "hx:base", "hy:base", "hz:base"]);
    assert_eq!(names.len(), 10);
    for parameter in trunk {
        let of = |key: &str| parameter[key].as_f64().unwrap();
        assert!(
            of("std") > 0.0 && of("std") <= of("prior_std"),
            "{parameter}"
        );
    }
    assert_eq!(trunk[0]["status"], "identified");

    // The same columns as of a limb's motion, all twelve joints, at rest at both ends; velocities are the positions' slopes.
    let text = fs::read_to_string(here.join("sway.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows.len(), rows[0].len()), (1 + 2251, 1 + 6 * 12));
    assert_eq!(
        [
            rows[0][1],
            rows[0][13],
            rows[0][25],
            rows[0][37],
            rows[0][49],
            rows[0][61]
        ],
        [
            "q/FR_hip",
            "dq/FR_hip",
            "ddq/FR_hip",
            "tau/FR_hip",
            "kp/FR_hip",
            "kd/FR_hip"
        ]
    );
    let cell = |row: usize, column: usize| rows[row][column].parse::<f64>().unwrap();
    assert!((1..=12).all(|joint| (cell(1, joint) - cell(2251, joint)).abs() < 1e-6));
    for row in (2..2250).step_by(7) {
        for joint in 1..=12 {
            // Simpson's rule: positions move by what velocities add up to.
            let moved = cell(row + 1, joint) - cell(row - 1, joint);
            let dq = |row: usize| cell(row, joint + 12);
            let integral = (dq(row - 1) + 4.0 * dq(row) + dq(row + 1)) * 0.004 / 6.0;
            assert!((moved - integral).abs() < 1e-6, "{row} {joint}");
        }
    }
    let coefficients = json(&fs::read_to_string(here.join("sway.json")).unwrap());
    assert_eq!(coefficients["coordinates"].as_array().unwrap().len(), 6);

    // For humans: a table, and what was assumed. The same seed gives the same motion.
    let told = done(here, &[&STANDING[..], &["-o", "again.csv"]].concat());
    for word in ["m:base", "identified", "friction cone", "0.1 N m", "rolls"] {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert_eq!(fs::read_to_string(here.join("again.csv")).unwrap(), text);
}

#[test]
fn a_stance_that_cannot_be_is_refused_with_the_fix() {
    let folder = folder();
    for (more, status, words) in [
        (&["--height", "0.6"][..], 1, "--height"),
        (&["--friction", "0"], 1, "positive"),
        (&["--legs", "FR"], 2, "--legs"),
    ] {
        let run = proprio(
            folder.path(),
            &[&STANDING[..], &["-o", "sway.csv"], more].concat(),
        );
        assert_eq!(
            run.status.code(),
            Some(status),
            "{more:?}: {}",
            stderr(&run)
        );
        assert!(stderr(&run).contains(words), "{more:?}: {}", stderr(&run));
        assert!(!folder.path().join("sway.csv").exists());
    }
}
