//! Where a model fails, as `compare` alone says it on its first screen: at which joint, against what, since when.

use std::path::Path;

use proprio_tests::command::{done, folder, simulated};
use proprio_tests::rows::{Rows, with_noisy_encoders};

/// The first screen of `compare` of a log with a model of what every drive has, in one line.
fn compared(folder: &Path, log: &str) -> String {
    let add = "add viscous coulomb armature bias -m drive.toml --force";
    done(folder, &add.split(' ').collect::<Vec<_>>());
    let screen = done(folder, &["compare", log, "-m", "drive.toml"]);
    screen.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Dry friction of the calf that grows by 0.3 N m half way through a log.
fn with_more_friction_half_way(folder: &Path) {
    let path = folder.join("log.csv");
    let mut log = Rows::read(&path);
    let [dq, tau] = ["dq/FR_calf", "tau/FR_calf"].map(|name| log.place(name));
    let half = 0.5 * log.rows.last().unwrap()[0];
    for row in &mut log.rows {
        let later = f64::from(u8::from(row[0] > half));
        row[tau] += later * 0.3 * (row[dq] / 0.05).tanh();
    }
    log.write(&path);
}

/// Friction that falls with speed, of one joint of one leg: no other joint tells what is usual.
#[test]
fn a_joint_above_its_noise_stands_out_alone() {
    for seed in [1, 2, 3] {
        let folder = simulated(&format!(
            "--legs FR --typical --seed {seed} --hide stribeck:FR_thigh=0.4,vs=0.15"
        ));
        let screen = compared(folder.path(), "log.csv");
        let (_, points) = screen.split_once("• ").unwrap();
        let (share, _) = points
            .split_once(" % of the square error: FR_thigh")
            .unwrap();
        assert!(share.parse::<f64>().unwrap() > 60.0, "{screen}");
    }
}

/// With a motion that stays the same, and with one whose speed grows with time.
#[test]
fn a_change_is_told_with_its_moment_and_a_size_that_can_be() {
    for motion in ["multisine", "chirp"] {
        let folder = simulated(&format!("--typical --seed 2 --motion {motion}"));
        with_more_friction_half_way(folder.path());
        let screen = compared(folder.path(), "log.csv");
        let (_, told) = screen
            .split_once("FR_calf: predicted torque is another from t = ")
            .unwrap();
        let (at, told) = told.split_once(" s on: ").unwrap();
        assert!((at.parse::<f64>().unwrap() - 10.0).abs() < 0.5, "{screen}");
        let size: f64 = told.split_whitespace().next().unwrap().parse().unwrap();
        assert!(size.abs() < 1.0, "{screen}");
    }
}

/// A robot without anything missing: nothing is told of any joint.
#[test]
fn of_a_complete_robot_nothing_is_told() {
    let folder = simulated("--typical --seed 4");
    let screen = compared(folder.path(), "log.csv");
    assert!(screen.contains("no structure above the noise"), "{screen}");
}

/// The hydraulic counterbalance of a KUKA KR300's second axis.
#[test]
fn a_counterbalance_is_at_its_axis() {
    let Some(logs) = proprio_tests::command::recorded_logs() else {
        return;
    };
    let file = |name: &str| logs.join("kuka_kr300").join(name).display().to_string();
    let folder = folder();
    let add = [
        "add", "viscous", "coulomb", "armature", "bias", "-m", "m.toml",
    ];
    done(
        folder.path(),
        &[&add[..], &["--urdf", &file("kr300.urdf")]].concat(),
    );
    let screen = done(
        folder.path(),
        &["compare", &file("kuka_A.csv"), "-m", "m.toml"],
    );
    let screen = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    let (_, points) = screen.split_once("• ").unwrap();
    assert!(points.contains("% of the square error: A2"), "{screen}");
}

/// A complete leg with noisy encoders: after a turn the joint moves faster than they show, and the bound has no more to explain.
#[test]
fn of_noisy_encoders_nothing_is_told() {
    for seed in [3, 11, 18] {
        let folder = with_noisy_encoders(seed);
        let screen = compared(folder.path(), "log.csv");
        // Smoothing takes a little of the acceleration: a hundredth of the square error.
        for (before, _) in screen.match_indices(" % of the square error") {
            let share = screen[..before].rsplit(' ').next().unwrap();
            assert!(share.parse::<f64>().unwrap() <= 3.0, "{screen}");
        }
        assert!(screen.contains("explains no more than"), "{screen}");
    }
}
