//! What sensors are found to get wrong beyond what is believed of them: a finding of its own.
//!
//! A fit of sensors takes up what the model lacks. Where a sensor's parameter is more than [`FAR`] of its prior's deviations off, either the prior is wrong, and
//! the model file should state the sensor as it is, or the log is of another robot, or something beyond its feet carries this one: a leash of 15 N made the
//! mass of a Go2 9.7 % too low and its accelerometer's scale 0.043 too small.

use nalgebra::DVector;

use super::columns::WalkColumns;
use super::sensors::{ACC_SCALE, GYRO_BIAS, GYRO_SCALE, MOUNTING, NAMES, PLACE, RADIUS};

/// So many of its prior's deviations a sensor's parameter may be off.
const FAR: f64 = 3.0;

/// What is believed to be behind it.
struct Kind {
    /// Which parameters, by their numbers in [`NAMES`].
    parameters: std::ops::Range<usize>,
    what: &'static str,
    why: &'static str,
    /// What is told is so many times the parameter.
    times: f64,
    unit: &'static str,
}

const KINDS: [Kind; 8] = [
    Kind {
        parameters: 0..MOUNTING,
        what: "the accelerometer's bias",
        why: "something carries the robot, or this is another robot",
        times: 1.0,
        unit: "m/s²",
    },
    Kind {
        parameters: MOUNTING..MOUNTING + 3,
        what: "the IMU's turn",
        why: "state how it is mounted under [imu] in the model file; or this is another robot",
        times: 1e3,
        unit: "mrad",
    },
    Kind {
        parameters: MOUNTING + 3..RADIUS,
        what: "a delay",
        why: "the log's signals are of different times",
        times: 1e3,
        unit: "ms",
    },
    Kind {
        parameters: RADIUS..GYRO_BIAS,
        what: "the feet's radius",
        why: "the feet or the ground give way, the feet are others than the model's [[foot]], or this is another robot",
        times: 1e3,
        unit: "mm",
    },
    Kind {
        parameters: GYRO_BIAS..GYRO_SCALE,
        what: "the gyro's bias",
        why: "the gyro is not at rest where it was set to zero, or this is another robot",
        times: 1.0,
        unit: "rad/s",
    },
    Kind {
        parameters: GYRO_SCALE..ACC_SCALE,
        what: "the gyro's scale",
        why: "the unit is not rad/s, or this is another robot",
        times: 100.0,
        unit: "%",
    },
    Kind {
        parameters: ACC_SCALE..PLACE,
        what: "the accelerometer's scale",
        why: "something carries the robot, or this is another robot",
        times: 100.0,
        unit: "%",
    },
    Kind {
        parameters: PLACE..NAMES.len(),
        what: "the IMU's place",
        why: "state where it is under [imu] in the model file; or this is another robot",
        times: 1e3,
        unit: "mm",
    },
];

/// In words, what these parameters of a fit say of the sensors that is hardly believed.
pub(crate) fn sensors(columns: &WalkColumns, theta: &DVector<f64>) -> Vec<String> {
    let std = &columns.robot.sensor_std;
    let value = |k: usize| theta[columns.acc() + k];
    let off = |k: usize| value(k).abs() / std[k];
    let told = KINDS.iter().filter_map(|kind| {
        let far = kind.parameters.clone().map(off).fold(0.0, f64::max);
        let values: Vec<String> = (kind.parameters.clone())
            .map(|k| format!("{:+.3}", kind.times * value(k)))
            .collect();
        (far > FAR).then(|| {
            format!(
                "{} is {far:.1} of its deviations off ({} {}): {}",
                kind.what,
                values.join(", "),
                kind.unit,
                kind.why
            )
        })
    });
    told.collect()
}
