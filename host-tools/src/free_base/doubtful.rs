//! What sensors and bodies are found to be beyond what is believed of them: a finding of its own.
//!
//! A fit of sensors takes up what the model lacks. Where a sensor's parameter is more than [`FAR`] of its prior's deviations off, either the prior is wrong, and
//! the model file should state the sensor as it is, or the log is of another robot, or something beyond its feet carries this one: a leash of 15 N made the
//! mass of a Go2 9.7 % too low and its accelerometer's scale 0.043 too small.

use std::sync::Arc;

use nalgebra::DVector;
use proprio_core::inertia::{INERTIAL, InertialParameters};

use super::columns::WalkColumns;
use super::sensors::{ACC_SCALE, GYRO_BIAS, GYRO_SCALE, MOUNTING, NAMES, PLACE, RADIUS};
use super::structure::ModelStructure;

/// So many of its prior's deviations a sensor's parameter may be off.
const FAR: f64 = 3.0;

/// Root mean square over the legs' bodies of how far each is from the model's, in deviations of its prior per parameter, beyond which they are another
/// robot's. Bodies 3 % off the CAD, whose prior is 10 %, leave 0.3.
const OTHER_BODIES: f64 = 1.0;
/// A robot that carries more than it weighs is another robot.
const HEAVIEST: f64 = 2.0;

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
        why: "the feet or the ground are soft, the feet are others than the model's [[foot]], or this is another robot",
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
        why: "something carries the robot, or a payload explains the same in part: weigh it; else gravity is not 9.81 m/s², or this is another robot",
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
    let std = &columns.robot.stated_std;
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

/// The same structure, where the IMU is as open as the data put it, if these parameters of a fit are far from where it is stated to be. A prior that
/// is refuted pulls: of 10 cm on a Go2, whose place was taken to be known to 2 mm, nine tenths were found and the mass was 1.6 % too large, 0.1 % without.
pub(super) fn refuted(
    structure: &ModelStructure,
    columns: &WalkColumns,
    theta: &DVector<f64>,
) -> Option<ModelStructure> {
    let mut robot = (*structure.robot).clone();
    for k in (MOUNTING..MOUNTING + 3).chain(PLACE..NAMES.len()) {
        let value = theta[columns.acc() + k].abs();
        if value > FAR * robot.stated_std[k] {
            robot.sensor_std[k] = value;
        }
    }
    let refuted = robot.sensor_std != structure.robot.sensor_std;
    refuted.then(|| ModelStructure {
        robot: Arc::new(robot),
        ..structure.clone()
    })
}

/// In words, what these parameters of a fit say of the robot if they are of another one than the structure's.
pub(crate) fn robot(structure: &ModelStructure, theta: &DVector<f64>) -> Vec<String> {
    let priors = structure.body_priors();
    let mass = |b: usize| theta[INERTIAL * b];
    let [found, known] = [
        (0..priors.len()).map(mass).sum::<f64>(),
        priors
            .iter()
            .map(|(inertia, _)| inertia.mass())
            .sum::<f64>(),
    ];
    let off = |(b, (inertia, relative)): (usize, &(InertialParameters<f64>, f64))| {
        let own = theta.rows(INERTIAL * b, INERTIAL);
        let squares = inertia.prior(*relative)?.sum_of_squares(own.as_slice());
        Some(squares / INERTIAL as f64)
    };
    // The trunk carries what its owner put on it.
    let legs: Vec<f64> = priors.iter().enumerate().skip(1).filter_map(off).collect();
    let far = (legs.iter().sum::<f64>() / legs.len().max(1) as f64).sqrt();
    let mut told = Vec::new();
    if found > HEAVIEST * known || HEAVIEST * found < known {
        told.push(format!(
            "{found:.1} kg are {:.1} times the model's {known:.1}: is this the model's robot?",
            found / known
        ));
    }
    if far > OTHER_BODIES {
        told.push(format!(
            "the legs' bodies are {far:.1} of their deviations from the model's, which no robot of its kind is: is this the model's robot?"
        ));
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_of_the_sensors_has_a_cause_and_the_scale_a_payload() {
        let parameters: Vec<usize> = KINDS
            .iter()
            .flat_map(|kind| kind.parameters.clone())
            .collect();
        assert_eq!(parameters, (0..NAMES.len()).collect::<Vec<_>>());
        let scale = |kind: &&Kind| kind.parameters.contains(&ACC_SCALE);
        let why = KINDS.iter().find(scale).map(|kind| kind.why);
        assert!(why.is_some_and(|why| why.contains("payload")), "{why:?}");
    }
}
