//! What the user can do about each error.

mod model;

pub use model::{of_asked, of_model, of_name, of_robot};

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr};

use crate::capture::CaptureError;
use crate::detect::mismatch::MismatchKind;
use crate::device::DeviceError;
use crate::device::replay::ReplayError;
use crate::excite::ExciteError;
use crate::excite::earlier::EarlierError;
use crate::factors::FactorsError;
use crate::fleet::TableError;
use crate::free_base::FreeBaseError;
use crate::kinematics::CalibrateError;
use crate::live::{LiveError, RestError};
use crate::log::{LogError, Problem};
use crate::monitor::web::WebError;
use crate::monitor::{FeedError, JournalError};
use crate::recording::RecordingError;
use crate::spectrum::FrfError;
use crate::validate::ValidateError;
use proprio_simulator::FollowError;
use proprio_simulator::walk::WalkError;

use super::Error;

/// The hint for an error, if there is anything to do.
pub(super) fn of(error: &Error) -> Option<String> {
    match error {
        Error::Log(error) | Error::Feed(FeedError::Log(error)) => Some(of_log(error)),
        Error::OverTime { effect, .. } => Some(format!(
            "take it out (`proprio remove {effect} -m MODEL`), or write the model without it: --with-time"
        )),
        Error::Recording(error) => Some(of_recording(error)),
        Error::FreeBase(FreeBaseError::Log(error)) => Some(of_log(error)),
        Error::FreeBase(FreeBaseError::Missing { .. }) => Some(
            "record /lowstate, which has all motors and the IMU; of a suspended robot, leave out --free-base".to_owned(),
        ),
        Error::FreeBase(FreeBaseError::NoWindows(_)) => {
            Some("record moving joints at 500 Hz, without losing messages".to_owned())
        }
        Error::FreeBase(FreeBaseError::NoFeet { .. }) => Some(
            "state in the model file which link touches the ground: [[foot]] link = \"FL_FOOT\", radius = 0.02; points = [[…], …] of a flat foot"
                .to_owned(),
        ),
        Error::FreeBase(FreeBaseError::Facts(unknown)) => unknown.nearest().map(|name| format!("did you mean `{name}`?")),
        Error::FreeBase(_) => None,
        Error::Mismatch { logs, wrong, is_go2, has_imu } => Some(match (wrong.first().map(|wrong| &wrong.kind), has_imu) {
            (Some(MismatchKind::Elastic(_)), _) => format!(
                "proprio frf {logs} -m MODEL finds its springs, with friction and masses of a slow log in the model file; or go on with --anyway"
            ),
            (Some(MismatchKind::NoBetterThanNothing(_)), _) if !is_go2 => {
                "check that the URDF is this robot's, and that `[base]` in the model file states how it is mounted; or go on with --anyway".to_owned()
            }
            (Some(MismatchKind::NoBetterThanNothing(_)), true) => {
                "of a Go2 that walks or stands: proprio diagnose --free-base; --anyway goes on as if it were suspended".to_owned()
            }
            (Some(MismatchKind::NoBetterThanNothing(_)), false) => {
                "of a Go2 that walks: proprio identify --free-base judges its legs in swing, for the log has no IMU; --anyway goes on as if it were suspended"
                    .to_owned()
            }
            _ => format!("{CORRECT_THE_LOG}, or go on with --anyway"),
        }),
        Error::Replay(ReplayError::Device(error)) | Error::Device(error) => of_device(error),
        Error::Capture(error) => of_capture(error),
        Error::Factors(error) => of_factors(error),
        Error::Blocks { fault, .. } | Error::BlockTable(fault) => Some(fault.fix().to_owned()),
        Error::Table(TableError::Write(error)) => of_writing(&error.source).map(str::to_owned),
        Error::Table(TableError::Format { .. }) => None,
        Error::AnotherRobot { robot, .. } => Some(format!(
            "identify one robot at a time; if it is the same one, make its blocks again: proprio factors LOG --robot {robot} -o FILE"
        )),
        Error::Feed(FeedError::Device(error) | FeedError::Replay(ReplayError::Device(error))) => of_device(error),
        Error::Feed(FeedError::Journal(error)) => Some(of_journal(error).to_owned()),
        Error::Feed(FeedError::NoWalk { .. }) => {
            Some("leave out --free-base for a suspended robot; of rows, name columns gyro/x to acc/z and all joints".to_owned())
        }
        Error::Feed(FeedError::Replay(_)) => None,
        Error::Feed(FeedError::Diverged(_)) => {
            Some("an effect is too strong to simulate: give --hide a smaller value".to_owned())
        }
        Error::Live(error) | Error::Feed(FeedError::Live(error)) => of_live(error),
        Error::Journal(error) => Some(of_journal(error).to_owned()),
        Error::Web(WebError::Taken { option, address }) => Some(format!(
            "take another port: {option}={0}:{1}, or {option}={0}:0 for any that is free",
            host(address),
            address.port().wrapping_add(1).max(1024)
        )),
        Error::Web(WebError::Bind { option, .. }) => Some(format!(
            "take an address of this machine and a port from 1024 on: {option}=127.0.0.1:7700"
        )),
        Error::Frf(error) => match error {
            FrfError::Log(error) => Some(of_log(error)),
            FrfError::Name(unknown) => of_name(unknown),
            error => error.hint(),
        },
        Error::Calibrate(error) => match error {
            CalibrateError::Log(error) => Some(of_log(error)),
            CalibrateError::Name(unknown) => of_name(unknown),
            other => other.hint(),
        },
        Error::Terminal(_) => Some("print lines instead: --lines".to_owned()),
        Error::Replay(ReplayError::Encode { .. }) => {
            Some("no motor reports such a value: check the units, or delete the line".to_owned())
        }
        Error::NoEstimate { samples: 0, .. } => {
            Some("check that the adapter is wired to this leg's bus input of the board".to_owned())
        }
        Error::NoEstimate { .. } => Some("play a log of at least some seconds".to_owned()),
        Error::Write(error) => of_writing(&error.source).map(str::to_owned),
        Error::Model(error) => of_model(error),
        Error::Robot(error) => of_robot(error),
        Error::UnknownName(unknown) => of_name(unknown),
        Error::Asked(error) => of_asked(error),
        Error::Earlier(EarlierError::Log(error)) | Error::Validate(ValidateError::Log(error)) => Some(of_log(error)),
        Error::Earlier(EarlierError::Excite(error)) => of_excite(error),
        Error::Earlier(EarlierError::NotRecorded(_)) => Some("name logs of these legs, or other --legs".to_owned()),
        Error::Validate(_) => None,
        Error::Shapes(_) => Some(
            "a file of shapes has `[[capsule]]` with name, body, ends, radius and `[[plane]]` with name, normal, offset"
                .to_owned(),
        ),
        Error::Follow(FollowError::Joint { .. }) => Some(
            "only a Go2 is simulated: play the motion on its robot, or in MuJoCo by examples/play_in_mujoco.py, record it, then: proprio validate LOG -m MODEL"
                .to_owned(),
        ),
        Error::Follow(_) => Some("`proprio excite -o motion.csv` makes a motion to follow".to_owned()),
        Error::Excite(error) => of_excite(error),
        Error::NotWithinLimits(_) => Some(NOT_WITHIN_LIMITS.to_owned()),
        Error::Export(error) => model::of_export(error),
        Error::NotReproduced(_) => Some("please report it, with the model file and the logs".to_owned()),
        Error::NotAModel(_) => Some(
            "leave out --free, or name a .json file".to_owned(),
        ),
        Error::Unreadable(..) => Some("the log was there a moment ago: keep it in place".to_owned()),
        Error::WouldReplace { .. } => {
            Some("name another file; or to replace this one, add --force".to_owned())
        }
        Error::WouldReplaceLog(_) => Some("name another file".to_owned()),
        Error::NotADemo(_) => Some("name another directory: `proprio demo -o DIR`".to_owned()),
        Error::RobotIsSet(_) => Some("leave out --urdf, or name a new model file".to_owned()),
        Error::NotOnDevice { .. } => {
            Some("`proprio diagnose` tries the whole catalogue on the desktop".to_owned())
        }
        Error::NotPlaced { .. } => Some(
            "the robot must be on and its bus received, the joint at rest at the stated angle: proprio monitor PORT".to_owned(),
        ),
        Error::Rest(error) => of_rest(error),
        Error::NotReported { .. } => Some("name other --legs, or a source that has all joints of this one".to_owned()),
        Error::NoZeros => Some("set the joints' angles: proprio zero PORT --help".to_owned()),
        Error::NoTrial => Some("see what it has found: proprio monitor PORT".to_owned()),
        Error::Unanswered { .. } => Some("ask for fewer changes at once".to_owned()),
        Error::Diverged(_) | Error::Walk(WalkError::Diverged(_)) => {
            Some("an effect is too strong to simulate: give --hide a smaller value".to_owned())
        }
        Error::Walk(WalkError::Fell(_)) => Some(
            "its controller does not balance: hide a smaller load or bias, begin with --typical, whose rotors bear larger gains, or take another --seed".to_owned(),
        ),
        Error::Walk(WalkError::Gait { .. }) => Some("--walk sway keeps all feet on the ground".to_owned()),
        Error::Walk(WalkError::Stance { .. }) => Some(
            "state the robot's feet in the model file ([[foot]]: link, place or points, radius)".to_owned(),
        ),
        Error::Walk(WalkError::Robot(_)) => None,
    }
}

/// The hint for a motion that is not proved to be within the limits.
pub const NOT_WITHIN_LIMITS: &str = "keep back more of that limit, or begin in another --pose";

/// The hint for a log that is not what the model says.
pub const CORRECT_THE_LOG: &str = "correct the log";

/// The hint for logs that are too short.
pub const TOO_SHORT: &str = "better 20 s of motion; several logs may be given at once";

/// The hint for logs in which no joint moves.
pub const AT_REST: &str = "record the joints moving, slowly and fast, and leave out a log at rest; if the positions move, the velocity columns are at rest: write the derivative of the position as `dq/`";

/// The hint for logs that cannot be used.
pub fn of_recording(error: &RecordingError) -> String {
    let hint = match error {
        RecordingError::Log(error) => return of_log(error),
        RecordingError::Impossible { .. } => {
            "positions must be in rad, velocities in rad/s, torques in N m, all on the joint side of the gear"
        }
        RecordingError::TooShort { .. } => TOO_SHORT,
        RecordingError::Condition { .. } => {
            "docs/diagnose.md, \"Only a part of a log\": --only 'FR_calf: q > -1.5' or --only 't < 31.4'"
        }
        RecordingError::AtRest { .. } => AT_REST,
        RecordingError::NoCommand { .. } => {
            "log what the drives are asked to do: q_des/JOINT, with --kp and --kd, or tau_des/JOINT; --rollout alone takes the measured torque"
        }
        RecordingError::NoGains { .. } => {
            "give the drives' gains, N m/rad and N m s/rad: --kp 25 --kd 0.5, of one joint --kp FR_calf=40; or log kp/JOINT and kd/JOINT"
        }
        RecordingError::LimbTooLarge { .. } => {
            "make the joints that can be held still fixed in the URDF, hold them, and leave them out of the log"
        }
    };
    hint.to_owned()
}

/// The hint for a file that cannot be written, if there is anything to do.
pub fn of_writing(error: &std::io::Error) -> Option<&'static str> {
    match error.kind() {
        ErrorKind::NotFound => Some("create the directory first"),
        ErrorKind::IsADirectory => Some("name a file, not a directory"),
        ErrorKind::PermissionDenied => Some("name a file you may write"),
        ErrorKind::StorageFull => Some("free some space on the disk"),
        _ => None,
    }
}

/// The hint for a motion that cannot be designed.
pub fn of_excite(error: &ExciteError) -> Option<String> {
    let hint = match error {
        ExciteError::Setting { .. } => "`proprio excite --help` explains each number",
        ExciteError::Pose { .. } => {
            "begin elsewhere: `--pose JOINT=RAD,…` (`--height` of a robot that stands), or keep back less of that limit"
        }
        ExciteError::NoRoom { .. } => {
            "keep back less of the robot's limits, or correct them in the URDF"
        }
        ExciteError::NoMotion { .. } => {
            "keep back less of that limit, begin in another --pose, or take more --starts"
        }
        ExciteError::TooLarge(..) => "make the joints that can be held still fixed in the URDF",
        ExciteError::Unknown(unknown) => return of_name(unknown),
        ExciteError::NotDesignable(_) => "`proprio diagnose` names the motion that separates it",
        ExciteError::NotAGo2 => {
            "`proprio excite` without them designs motions of a limb on a fixed base"
        }
        ExciteError::BeyondNyquist { .. } => "sample faster with --rate, or end the --band lower",
        ExciteError::FewLines { .. } => "take a longer --period or a wider --band",
        ExciteError::BelowFriction { .. } => {
            "excite harder with --excitation; or if the friction is wrong, identify `coulomb` from a slow log"
        }
        ExciteError::NoPoints { .. } => {
            "excite less with --excitation, keep back less of that limit, or ask for fewer --points"
        }
        ExciteError::Singular => "give the links' masses in the URDF or the model file",
        ExciteError::Responses(error) => return error.hint(),
        ExciteError::Shape { .. } => {
            "lengths are in m, in the frame of the joint that moves the shape"
        }
        ExciteError::Unphysical(_) => "correct the bodies of the URDF or of the model file",
    };
    Some(hint.to_owned())
}

fn of_live(error: &LiveError) -> Option<String> {
    let hint = match error {
        LiveError::NotBuilt => {
            "in a clone of proprio: cargo install --path proprio --features dds; of the Python package: MATURIN_PEP517_ARGS='--features dds' pip install ./python"
        }
        LiveError::Terminal => "pipe rows of CSV into it: my_driver | proprio record - -o log.csv",
        LiveError::NoInterface { .. } | LiveError::WhichInterface { .. } => {
            "name the interface whose cable or network leads to the robot: dds:eth0"
        }
        LiveError::NoWriter { .. } => {
            "check that the robot is on, that its network and this interface's address are of one subnet (a Go2: 192.168.123.*), and --domain; where multicast does not pass, name its computer with --peer"
        }
        LiveError::Port(error) => return of_device(error),
        LiveError::NoZeros { leg } => {
            let [hip, thigh, calf] = leg.joint_names();
            return Some(format!(
                "let the joints rest where you know, and name their angles (rad, or a stop): --at {hip}=0.1 --at {thigh}=0.8 --at {calf}=lower"
            ));
        }
        LiveError::Thread(_) | LiveError::Dds { .. } => return None,
    };
    Some(hint.to_owned())
}

fn of_rest(error: &RestError) -> Option<String> {
    let hint = match error {
        RestError::Live(error) => return of_live(error),
        RestError::Log(error) => return Some(of_log(error)),
        RestError::Short { .. } => {
            "check that the robot sends all the time, and give a second of it"
        }
        RestError::Moves { .. } => {
            "lay the robot down, or suspend it, until its joints rest; then again"
        }
        RestError::OutOfRange { .. } => {
            "positions are in rad at the joints; if the robot's own zero is wrong, name the angles: --pose, --at"
        }
    };
    Some(hint.to_owned())
}

fn of_device(error: &DeviceError) -> Option<String> {
    let hint = match error {
        DeviceError::NoSources => "or play into this process: --to desktop",
        DeviceError::NoEmulator => "or play into this process: --to desktop",
        DeviceError::Build(_) => "`tests/run` installs what the firmware's build needs",
        DeviceError::Emulator(..) => "`tests/run` checks the emulator and the image",
        DeviceError::Crashed(_) => {
            "it is proprio's fault: please report these words, the version, and what was played"
        }
        DeviceError::Silent(_) => {
            "check the port, that the board is powered, and that it runs proprio's firmware"
        }
        DeviceError::Wire(_) | DeviceError::OtherLayout(_) => {
            "`proprio flash` puts this version's firmware on the board"
        }
        DeviceError::Port { .. } => {
            "check the port's name, and that you may use it: `ls -l /dev/tty*`, group dialout"
        }
        DeviceError::Image { .. } => "check the path; without --image the firmware is built",
        DeviceError::NotAnImage(_) => "without --image the firmware is built",
        DeviceError::NoProgrammer => {
            return Some(crate::device::programmer::how_to_install());
        }
        DeviceError::Programmer(..) => {
            "check that the board's ST-LINK is plugged in: `proprio ports` lists it"
        }
        DeviceError::NoFactor => "`proprio flash` puts this version's firmware on the board",
        DeviceError::Link(_) => return None,
    };
    Some(hint.to_owned())
}

fn of_capture(error: &CaptureError) -> Option<String> {
    let hint = match error {
        CaptureError::Read { .. } => {
            "check the path; `proprio capture PORT -o FILE` makes a capture"
        }
        CaptureError::NotACapture(_) => "`proprio capture PORT -o FILE` makes one",
        CaptureError::Version { .. } => "read it with the proprio that made it, or capture again",
        CaptureError::Port(_) => {
            "check that the adapter is plugged in, and that no other program uses it"
        }
        CaptureError::Write(_) => return None,
    };
    Some(hint.to_owned())
}

/// An address without its port, as it is written before one.
fn host(address: &SocketAddr) -> String {
    match address.ip() {
        IpAddr::V4(ip) => ip.to_string(),
        IpAddr::V6(ip) => format!("[{ip}]"),
    }
}

fn of_journal(error: &JournalError) -> &'static str {
    match error {
        JournalError::Read { .. } | JournalError::NotMessages(_) => {
            "`proprio monitor PORT --record FILE` makes such a file"
        }
        JournalError::Schema { .. } => "watch it with the proprio that recorded it",
    }
}

fn of_factors(error: &FactorsError) -> Option<String> {
    let hint = match error {
        FactorsError::Read { .. } | FactorsError::NotFactors(_) => {
            "`proprio replay LOG --to desktop --factors FILE` makes such a file"
        }
        FactorsError::Damaged(_) => "read the device's factors again",
        FactorsError::Other(_) => "read it with the proprio that made it, or make it anew",
        FactorsError::Twice { .. } => "leave one of the two files out",
        FactorsError::AnotherRobot { .. } => "identify one robot at a time",
        FactorsError::Solve { .. } => return None,
    };
    Some(hint.to_owned())
}

fn of_log(error: &LogError) -> String {
    match &*error.problem {
        Problem::Open(cause) => match cause.kind() {
            ErrorKind::NotFound => "check the path; `proprio simulate` makes a log to try".to_owned(),
            ErrorKind::PermissionDenied => "make the file readable: `chmod +r FILE`".to_owned(),
            ErrorKind::IsADirectory => {
                "the directory is no bag (with .mcap or .db3) and no LeRobot data set; name the log files in it, such as \
                 `DIRECTORY/*.csv`"
                    .to_owned()
            }
            _ => "check that the path is a readable file".to_owned(),
        },
        Problem::Read(_) => {
            "the file is damaged or cut short; copy it again, or unpack it with `gunzip` and delete the last line".to_owned()
        }
        Problem::Damaged(_) => "copy the file again; a bag that was cut short gives its whole messages".to_owned(),
        Problem::NotALog { way, .. } => (*way).to_owned(),
        Problem::NotBuilt { feature, .. } => format!("build it with `--features {feature}`"),
        Problem::NoTopic { .. } => {
            "record the joints: `ros2 bag record -s mcap /lowstate` (Unitree) or `/joint_states`".to_owned()
        }
        Problem::NoMessages { .. } => "record again while the robot sends, or name another bag".to_owned(),
        Problem::Encoding("compressed one by one") => {
            "decompress the bag: `ros2 bag convert`, or record with `--compression-mode file`".to_owned()
        }
        Problem::Encoding(_) => "record the topic with `ros2 bag record`".to_owned(),
        Problem::MessageLength { .. } | Problem::MessageShort { .. } => {
            "the bag's types and messages disagree: record it with the maker's present message definitions".to_owned()
        }
        Problem::MotorOrder { .. } => {
            "state it in the model file, as the maker documents it: `[log]`, `motors = [\"JOINT\", …]`".to_owned()
        }
        Problem::NoGear { joint } => format!(
            "state it in the model file: `[motor.{joint}]`, `gear = …`, `rotor_inertia = …`"
        ),
        Problem::CoupledInPart { .. } => "record both at the motor, or both at the joint".to_owned(),
        Problem::Transmission => "correct `[log.transmission]` in the model file: rows must be independent".to_owned(),
        Problem::NoJointNames { .. } => {
            "name them in the same file: numpy.savez('log.npz', t=t, q=q, dq=dq, tau=tau, joint_names=['…', …])".to_owned()
        }
        Problem::OtherLength { .. } => "save arrays of one recording, a row per sample".to_owned(),
        Problem::OtherCells { .. } => "name the files one by one".to_owned(),
        Problem::Empty => "record again: the recorder wrote nothing, not even a header".to_owned(),
        Problem::NoHeader => {
            "put the columns' names on the first line: `t,q/FR_hip,dq/FR_hip,tau/FR_hip,…`".to_owned()
        }
        Problem::EchoedCsv => {
            "record the topic with its type: ros2 bag record /joint_states, or proprio record dds:IFACE/joint_states -o log.mcap".to_owned()
        }
        Problem::Separator(separator) => {
            format!("write the log with commas instead of `{}`, decimals with a point", separator.escape_default())
        }
        Problem::MissingColumn { name } if name == "t" => {
            "name the column of the time in seconds `t`".to_owned()
        }
        Problem::MissingColumn { .. } => {
            "a vector is recorded whole or not at all: add the column or drop its siblings".to_owned()
        }
        Problem::DuplicateColumn { .. } => "rename or delete one of the two".to_owned(),
        Problem::UnknownName { nearest, .. } => format!("did you mean `{nearest}`?"),
        Problem::OtherRobot { joints, .. } => format!(
            "its joints are {}; for another robot name its model: `-m ROBOT.toml`, made by `proprio add EFFECT -m ROBOT.toml --urdf FILE`",
            joints.join(", ")
        ),
        Problem::NoJoints { joints } => {
            let first = joints.first().map_or("", String::as_str);
            format!(
                "a joint needs position, velocity and torque: `q/{first}`, `dq/{first}`, `tau/{first}`; joints are {}",
                joints.join(", ")
            )
        }
        Problem::MissingChannel { joint, missing } => {
            format!("record `{missing}` too, or delete the columns of {joint}'s limb")
        }
        Problem::IncompleteLimb { limb, missing, .. } => format!(
            "record {missing} too, or say where it was held: `[held]`, `{missing} = 0.0` in the model file; or leave out \
             limb {limb}"
        ),
        Problem::Ragged { found, expected } if found < expected => {
            "if it is the last line, the recording was cut short: delete it".to_owned()
        }
        Problem::Ragged { .. } => "decimals need a point, not a comma; otherwise delete the line".to_owned(),
        Problem::NotANumber(text) if text.trim().is_empty() => {
            "delete the line: every recorded channel needs a value in every row".to_owned()
        }
        Problem::NotANumber(_) => "correct the cell, or delete the line".to_owned(),
        Problem::NoNumbers { .. } => {
            "the driver does not fill it: record position, velocity and torque (effort) of the motors".to_owned()
        }
        Problem::NotFinite(_) => "leave the row out; a gap does no harm, a made-up value would".to_owned(),
        Problem::TimeBackwards { .. } => {
            "sort the rows by `t`; if two recordings were joined, split the file here".to_owned()
        }
        Problem::TimeJump { .. } => {
            "if two recordings were joined or the clock was set, split the file here and pass both parts; `t` must \
             be in seconds"
                .to_owned()
        }
        Problem::TimeUnit { per_second, .. } => {
            format!("write `t` in seconds: divide it by {per_second}")
        }
        Problem::TwoPublishers { .. } => {
            "`ros2 topic info -v TOPIC` names the publishers: stop the one that is not the robot, and record again".to_owned()
        }
        Problem::OneStamp { .. } => {
            "write `t` with the digits of the recorder's clock: in s, to 0.1 ms or better".to_owned()
        }
        Problem::TooShort { .. } => "record at least some seconds of motion".to_owned(),
        Problem::TooSlow { .. } => {
            "record at the robot's own rate; a Go2's is 500 Hz (topic `rt/lowstate`, not `rt/lf/lowstate`)".to_owned()
        }
        Problem::OutsideLimits { degrees: true, .. } => {
            "convert positions to rad and velocities to rad/s: multiply both by π/180 = 0.0174533".to_owned()
        }
        Problem::OutsideLimits { other_way: true, joint, .. } => {
            format!("multiply q/{joint}, dq/{joint} and tau/{joint} by -1, or turn the joint's axis in the URDF")
        }
        Problem::OutsideLimits { .. } => {
            "check the joint's zero and sign: positions are the URDF's, in rad or m; a Go2's are 0 with the leg straight down".to_owned()
        }
    }
}
