//! What others call what a log records.
//!
//! Recorders name their columns by the message: PlotJuggler writes `/lowstate/motor_state[0]/q` and
//! `/joint_states/shoulder/position`, ROS 1's `rostopic echo -p` writes `field.motor_state0.q`, LeRobot names the elements of
//! `observation.state`. The readers of bags name their cells in the same way, so that one place knows what they mean.

use super::channel::Channel;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Meaning<'a> {
    /// Time, in units of so many seconds.
    Time(f64),
    /// A joint's own signal.
    Joint(Channel, Which<'a>),
    /// An axis of what the IMU measures.
    Imu(Sensor, usize),
    /// A foot's sensor, by the robot's number for it.
    Foot(usize),
}

/// Which joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which<'a> {
    /// By its name.
    Name(&'a str),
    /// By the number of its motor in the message.
    Motor(usize),
}

/// What an IMU measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sensor {
    /// Attitude, w x y z.
    Quaternion,
    /// Angular velocity.
    Gyroscope,
    /// Specific force.
    Accelerometer,
}

/// Names of the time, and its unit in seconds; ROS 1 prints nanoseconds.
const TIMES: [(&str, f64); 5] = [
    ("__time", 1.0),
    ("%time", 1e-9),
    ("time", 1.0),
    ("timestamp", 1.0),
    ("Time", 1.0),
];

/// The signals of `sensor_msgs/JointState`, and what a data set was asked to do.
const STATES: [(&str, Channel); 4] = [
    ("position", Channel::Q),
    ("velocity", Channel::Dq),
    ("effort", Channel::Tau),
    ("command", Channel::QDes),
];

/// What LeRobot says of an element after its joint's name, and the signal of a joint's state that it is: `shoulder_pan.pos`.
pub(super) const SUFFIXES: [(&str, &str); 10] = [
    (".pos", "position"),
    (".position", "position"),
    (".q", "position"),
    (".vel", "velocity"),
    (".velocity", "velocity"),
    (".dq", "velocity"),
    (".effort", "effort"),
    (".torque", "effort"),
    (".tau", "effort"),
    (".current", "current"),
];

/// The signals of Unitree's `MotorCmd`.
const MOTOR_COMMAND: [(&str, Channel); 5] = [
    ("q", Channel::QDes),
    ("dq", Channel::DqDes),
    ("tau", Channel::TauDes),
    ("kp", Channel::Kp),
    ("kd", Channel::Kd),
];

/// The signals of Unitree's `MotorState`, as ROS 2 and ROS 1 spell them.
const MOTOR: [(&str, Channel); 7] = [
    ("q", Channel::Q),
    ("dq", Channel::Dq),
    ("tau_est", Channel::Tau),
    ("tauEst", Channel::Tau),
    ("temperature", Channel::Temp),
    // Of a humanoid's motor the first of two.
    ("temperature[0]", Channel::Temp),
    ("temperature.0", Channel::Temp),
];

const SENSORS: [(&str, Sensor); 3] = [
    ("quaternion", Sensor::Quaternion),
    ("gyroscope", Sensor::Gyroscope),
    ("accelerometer", Sensor::Accelerometer),
];

/// What a column called `name` holds, if a recorder that is known called it so.
pub(super) fn meaning(name: &str) -> Option<Meaning<'_>> {
    if let Some((_, unit)) = TIMES.iter().find(|(time, _)| *time == name) {
        return Some(Meaning::Time(*unit));
    }
    let state = ["motor_state", "motorState"].map(|array| (array, &MOTOR[..]));
    let command = ["motor_cmd", "motorCmd"].map(|array| (array, &MOTOR_COMMAND[..]));
    let mut motors = state.into_iter().chain(command);
    if let Some(meaning) = motors.find_map(|(array, signals)| motor(name, array, signals)) {
        return Some(meaning);
    }
    let imu = ["imu_state", "imu"].iter().find_map(|imu| after(name, imu));
    if let Some(rest) = imu {
        let sensor = |(sensor, which): &(&str, Sensor)| {
            let (axis, "") = element(rest, sensor)? else {
                return None;
            };
            Some(Meaning::Imu(*which, axis))
        };
        return SENSORS.iter().find_map(sensor);
    }
    for foot in ["foot_force", "footForce"] {
        if let Some((foot, "")) = element(name, foot) {
            return Some(Meaning::Foot(foot));
        }
    }
    joint_state(name).or_else(|| element_of_state(name))
}

fn motor<'a>(name: &'a str, array: &str, signals: &[(&str, Channel)]) -> Option<Meaning<'a>> {
    let (motor, signal) = element(name, array)?;
    let (_, channel) = signals.iter().find(|(known, _)| *known == signal)?;
    Some(Meaning::Joint(*channel, Which::Motor(motor)))
}

/// `/joint_states/shoulder/position`, `shoulder/position`.
fn joint_state(name: &str) -> Option<Meaning<'_>> {
    let (path, signal) = name.rsplit_once('/')?;
    let (_, channel) = STATES.iter().find(|(known, _)| *known == signal)?;
    let joint = path.rsplit('/').next()?;
    (!joint.is_empty()).then_some(Meaning::Joint(*channel, Which::Name(joint)))
}

/// `shoulder_pan.pos`, `observation.state.shoulder_pan.pos`, as LeRobot calls them.
fn element_of_state(name: &str) -> Option<Meaning<'_>> {
    let (joint, signal) = SUFFIXES
        .iter()
        .find_map(|(suffix, signal)| Some((name.strip_suffix(suffix)?, *signal)))?;
    let (_, channel) = STATES.iter().find(|(known, _)| *known == signal)?;
    let (channel, joint) = match joint.strip_prefix("action.") {
        Some(joint) => (Channel::QDes, joint),
        None => (*channel, joint),
    };
    let joint = joint.rsplit(['/', '.']).next()?;
    (!joint.is_empty()).then_some(Meaning::Joint(channel, Which::Name(joint)))
}

/// A joint's name without what LeRobot says after it.
pub(super) fn without_suffix(joint: &str) -> &str {
    let bare = SUFFIXES
        .iter()
        .find_map(|(suffix, _)| joint.strip_suffix(suffix));
    bare.filter(|bare| !bare.is_empty()).unwrap_or(joint)
}

/// What follows a part of a path.
fn after<'a>(name: &'a str, part: &str) -> Option<&'a str> {
    let (before, rest) = name.split_once(part)?;
    let begins = before.is_empty() || before.ends_with(['/', '.']);
    let rest = rest.strip_prefix(['/', '.'])?;
    begins.then_some(rest)
}

/// Number and rest of `array[3]/rest`, `array.3.rest`, `array3.rest`, wherever in a path.
fn element<'a>(name: &'a str, array: &str) -> Option<(usize, &'a str)> {
    let (before, rest) = name.split_once(array)?;
    if !(before.is_empty() || before.ends_with(['/', '.'])) {
        return None;
    }
    let rest = rest.strip_prefix(['[', '.', '/']).unwrap_or(rest);
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    let number = rest[..digits].parse().ok()?;
    let rest = rest[digits..].strip_prefix(']').unwrap_or(&rest[digits..]);
    Some((number, rest.strip_prefix(['/', '.']).unwrap_or(rest)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// Any name means something or nothing.
        #[test]
        fn no_name_makes_it_panic(parts in proptest::collection::vec(
            prop_oneof!["motor_state", "imu_state", "foot_force", "quaternion", "[\\[\\]/.0-9]{0,4}", "\\PC{0,3}", "position", "q"],
            0..6,
        )) {
            meaning(&parts.concat());
        }
    }

    #[test]
    fn every_recorder_is_understood() {
        let motor = |channel, n| Some(Meaning::Joint(channel, Which::Motor(n)));
        for name in [
            "/lowstate/motor_state[7]/tau_est",
            "/lowstate/motor_state.7.tau_est",
            "lowstate.motor_state[7].tau_est",
            "field.motorState7.tauEst",
            "motor_state[7]/tau_est",
        ] {
            assert_eq!(meaning(name), motor(Channel::Tau, 7), "{name}");
        }
        assert_eq!(meaning("/lowcmd/motor_cmd[0]/q"), motor(Channel::QDes, 0));
        assert_eq!(meaning("/lowcmd/motor_cmd[3]/kp"), motor(Channel::Kp, 3));
        assert_eq!(
            meaning("/lowcmd/motor_cmd[3]/tau"),
            motor(Channel::TauDes, 3)
        );
        let name = |channel, joint| Some(Meaning::Joint(channel, Which::Name(joint)));
        let arm = meaning("/joint_states/shoulder.pan/effort");
        assert_eq!(arm, name(Channel::Tau, "shoulder.pan"));
        assert_eq!(meaning("elbow/position"), name(Channel::Q, "elbow"));
        for lerobot in ["elbow.pos", "observation.state.elbow.pos"] {
            assert_eq!(meaning(lerobot), name(Channel::Q, "elbow"), "{lerobot}");
        }
        assert_eq!(meaning("action.elbow.pos"), name(Channel::QDes, "elbow"));
        assert_eq!(meaning("elbow.current"), None);
        assert_eq!(without_suffix("elbow.pos"), "elbow");
        assert_eq!(without_suffix("elbow"), "elbow");
        assert_eq!(meaning("%time"), Some(Meaning::Time(1e-9)));
        let gyro = Meaning::Imu(Sensor::Gyroscope, 2);
        assert_eq!(meaning("/lowstate/imu_state/gyroscope[2]"), Some(gyro));
        assert_eq!(meaning("/lowstate/foot_force[3]"), Some(Meaning::Foot(3)));
        for other in [
            "/lowstate/foot_force_est[3]",
            "/lowstate/motor_state[0]/q_raw",
            "/lowstate/motor_state[0]/mode",
            "/lowstate/imu_state/rpy[0]",
            "/tf/x",
            "motor_state",
            "",
        ] {
            assert_eq!(meaning(other), None, "{other}");
        }
    }
}
