//! The committed walks (`oracle/walk/`) as a device hears them: motor-bus bytes and an IMU's readings.

use std::path::{Path, PathBuf};

use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE};
use proprio_core::bus::{Command, Mode, Reply};
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG, Leg};
use proprio_core::walk::WalkSample;
use proprio_core::window::Sample;
use proprio_core::wire::Imu;
use proprio_host::device::BusStep;
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

/// A step of a device that listens to a walking robot: what its IMU says, then what its buses bring.
pub struct WalkStep {
    /// The reading.
    pub imu: Imu,
    /// A polling cycle of each leg.
    pub bus: BusStep,
}

/// What a device hears of a sample; the foot's count is told by its calf's reply.
pub fn step(sample: &WalkSample<f64>) -> WalkStep {
    let single = |x: [f64; 3]| x.map(|x| x as f32);
    WalkStep {
        imu: Imu {
            gyro: single(sample.gyro.into()),
            acc: single(sample.acc.into()),
        },
        bus: BusStep {
            time_us: sample.joints.time_us,
            buses: std::array::from_fn(|leg| cycle(sample, leg)),
        },
    }
}

/// One polling cycle of a leg.
fn cycle(sample: &WalkSample<f64>, leg: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (j, actuator) in ACTUATORS.iter().enumerate() {
        let (mode, n) = (Mode::foc(j as u8), JOINTS_PER_LEG * leg + j);
        let joints = &sample.joints;
        let (q, dq, tau) = (joints.q[n], joints.dq[n], joints.tau[n]);
        let reply = Reply::from_joint(mode, actuator.gear, q, dq, tau, 25);
        let count = sample.count[leg].clamp(0.0, 4095.0) as u16;
        let reply = Reply {
            flags: if j == 2 { count << 3 } else { 0 },
            ..reply.expect("a robot's joints fit a frame")
        };
        let command = Command {
            mode,
            ..Command::default()
        };
        bytes.extend(command.encode(SEED_GO2));
        bytes.extend(reply.encode(SEED_STANDALONE));
    }
    bytes
}
