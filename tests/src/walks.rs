//! The committed walks (`oracle/walk/`) as a device hears them: motor-bus bytes and an IMU's readings.

use std::path::{Path, PathBuf};

use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use proprio_core::walk::WalkSample;
use proprio_core::window::Sample;
use proprio_host::device::WalkStep;
use proprio_host::device::replay::walk_step;
use proprio_host::log::Log;

/// Where a walk's log is.
pub fn log(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/walk");
    folder.join(format!("{name}.csv.gz"))
}

/// The mass of its robot, kg.
pub fn mass(name: &str) -> f64 {
    let truth = std::fs::read_to_string(log(name).with_file_name("truth.json"));
    let truth: serde_json::Value =
        serde_json::from_str(&truth.expect("it is committed")).expect("JSON");
    truth["logs"][name]["mass"].as_f64().expect("a mass")
}

/// All samples of a walk.
pub fn samples(name: &str) -> Vec<WalkSample<f64>> {
    let log = Log::read(&log(name)).expect("it is committed");
    let legs = Leg::ALL.map(|leg| log.leg(leg).expect("all legs"));
    let gyro = log.imu.gyro.as_ref().expect("a gyro");
    let acc = log.imu.acc.as_ref().expect("an accelerometer");
    let sample = |(n, t): (usize, &f64)| {
        let channel = |j: usize| &legs[j / JOINTS_PER_LEG][j % JOINTS_PER_LEG];
        WalkSample {
            joints: Sample {
                time_us: (t * 1e6).round() as u64,
                q: std::array::from_fn(|j| channel(j).q[n]),
                dq: std::array::from_fn(|j| channel(j).dq[n]),
                tau: std::array::from_fn(|j| channel(j).tau[n]),
            },
            gyro: gyro[n].into(),
            acc: acc[n].into(),
            count: log.foot.as_ref().map_or([f64::NAN; 4], |feet| feet[n]),
        }
    };
    log.t.iter().enumerate().map(sample).collect()
}

/// What a device hears of a sample; the foot's count is told by its calf's reply.
pub fn step(sample: &WalkSample<f64>) -> WalkStep {
    walk_step(sample).expect("a robot's joints fit a frame")
}
