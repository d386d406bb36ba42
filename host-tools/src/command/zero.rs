//! `proprio zero`: where a robot's joints are, told to the device that listens to its buses.

use std::fmt;
use std::time::{Duration, Instant};

use crate::device::names::words_of_zero;
use crate::device::poses::{POSES, Pose, can_be};
use crate::device::power_up::PowerUp;
use crate::device::replay::resting;
use crate::device::serial::SerialDevice;
use crate::device::{BusStep, Desktop, Device, DeviceError, Qemu, Requests, image};
use crate::live::{Address, BusFacts, Counts, REST, Source, Until, resting_at};
use crate::name::leg_named;
use crate::table::Table;
use clap::Args;
use clap::builder::PossibleValuesParser;
use clap::error::ErrorKind;
use proprio_core::go2::{JointId, Leg, position_limits};
use proprio_core::wire::{
    Action, Answer, DeviceMessage, Hello, HostMessage, Outcome, Positions, SetZero,
};
use serde::Serialize;

use super::Error;
use super::dds_arguments::DdsArguments;
use super::result::result;

/// Set where a device's joints are, so that it knows their zeros
///
/// A motor counts its rotor's turns from its power-up on, from another place each time. A device therefore identifies nothing
/// until each joint's position is set: while the robot rests in a named pose, with joints against their stops, at measured
/// angles, or where the robot itself reports them to be. Joints may be set one after the other. A zero holds until a motor is silent for 0.1 s or its
/// position jumps; `monitor` then reports it.
///
/// A robot at rest does not show which way its motors turn: the device's own trial, while the joints move, finds a reversed one, and --reversed states
/// it. Without --pose, --at and --from it prints what the device knows. `sim` and `qemu` are devices with a simulated robot after a
/// power-up, at rest where the options say: to try what a real one will be asked.
#[derive(Debug, Args)]
#[command(after_help = poses_help())]
#[command(mut_arg("domain", |domain| domain.requires("from")), mut_arg("qos", |qos| qos.requires("from")))]
pub(crate) struct Zero {
    /// The device: a board's serial port; or one with a simulated robot
    #[arg(value_name = "PORT|sim|qemu")]
    device: String,
    /// The robot rests in this pose; several may hold at once
    #[arg(long, value_name = "POSE", value_parser = PossibleValuesParser::new(POSES.map(|pose| pose.name)))]
    pose: Vec<String>,
    /// Of these legs, separated by commas [default: all]
    #[arg(long, value_name = "LEG", value_delimiter = ',', value_parser = leg_named)]
    legs: Vec<Leg>,
    /// A joint rests at this angle, rad, or at its `lower` or `upper` stop
    #[arg(long, value_name = "JOINT=ANGLE", value_parser = parse_at)]
    at: Vec<(JointId, f64)>,
    /// Each joint rests where the robot itself reports it: the median of a second of its network's messages (`dds`, as `record` takes it), or of
    /// rows of CSV on standard input (-). Keep it at rest until the device has answered
    #[arg(long, value_name = "dds[:IFACE][/TOPIC]|-", value_parser = parse_from)]
    from: Option<Reporter>,
    #[command(flatten)]
    dds: DdsArguments,
    /// These joints' motors turn against them, separated by commas
    #[arg(long, value_name = "JOINT", value_delimiter = ',', value_parser = parse_joint)]
    reversed: Vec<JointId>,
    /// The board was restarted, and the motors were not switched off since the zeros were set: have it trust the zeros that it
    /// has kept
    #[arg(long, conflicts_with_all = ["pose", "at", "from", "reversed"])]
    same_power_up: bool,
    /// The wiring is right, whatever the device has not made out yet: have it identify the legs on trial. It keeps to a fault that it
    /// has found
    #[arg(long, conflicts_with_all = ["pose", "at", "from", "reversed", "same_power_up"])]
    trust_wiring: bool,
    /// Print what would be set, and set nothing
    #[arg(long)]
    dry_run: bool,
    /// Seed of the power-up of `sim` and `qemu`
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

fn poses_help() -> String {
    let poses = POSES.map(|pose| format!("  {:<15} {}\n", pose.name, pose.words));
    format!(
        "Poses:\n{}
Examples:
  proprio zero /dev/ttyACM0 --pose calves-folded --pose hips-out
  proprio zero /dev/ttyACM0 --legs FR --at FR_thigh=0.72
  proprio zero sim --pose calves-folded --at FR_hip=0.1 --at FR_thigh=0.8
  proprio zero /dev/ttyACM0 --from dds:eth0
  proprio zero /dev/ttyACM0 --same-power-up
  proprio zero /dev/ttyACM0 --pose thighs-back --dry-run",
        poses.concat()
    )
}

pub(super) fn parse_joint(text: &str) -> Result<JointId, String> {
    JointId::from_name(text)
        .ok_or_else(|| format!("no joint is called {text}; joints are FR_hip to RL_calf"))
}

pub(super) fn parse_at(text: &str) -> Result<(JointId, f64), String> {
    let (joint, angle) = text
        .split_once('=')
        .ok_or("expected JOINT=ANGLE, such as FR_thigh=0.72")?;
    let joint = parse_joint(joint)?;
    let [lower, upper] = position_limits(joint.leg())[joint.place()];
    let angle = match angle {
        "lower" => lower,
        "upper" => upper,
        number => number
            .parse()
            .ok()
            .filter(|angle: &f64| angle.is_finite())
            .ok_or_else(|| format!("{number} is no angle in rad"))?,
    };
    match can_be(joint, angle) {
        true => Ok((joint, angle)),
        false => Err(format!(
            "{} is between {lower} and {upper} rad",
            joint.name()
        )),
    }
}

/// A live source that knows where joints are.
#[derive(Debug, Clone)]
struct Reporter {
    name: String,
    address: Address,
}

fn parse_from(text: &str) -> Result<Reporter, String> {
    match Address::parse(&[text.to_owned()]) {
        Some(address @ (Address::Text | Address::Dds(_))) => Ok(Reporter {
            name: text.to_owned(),
            address,
        }),
        Some(_) => {
            Err("a motor bus does not give the joints' angles: dds[:IFACE][/TOPIC] or -".to_owned())
        }
        None => Err("expected dds[:IFACE][/TOPIC] or -".to_owned()),
    }
}

/// What is known of a joint.
#[derive(Debug, Serialize)]
struct JointReport {
    joint: &'static str,
    /// What the device was told, or with --dry-run would be, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    angle: Option<f64>,
    /// Whether its motor turns against it, where it was told.
    #[serde(skip_serializing_if = "Option::is_none")]
    reversed: Option<bool>,
    /// Whether the device took it; the reason if it did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    answer: Option<&'static str>,
    /// What the device knows of its zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    zero: Option<&'static str>,
    /// Whether it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    known: Option<bool>,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    joints: Vec<JointReport>,
    /// Whether the device was told.
    told: bool,
}

/// How long a device may take to answer.
const PATIENCE: Duration = Duration::from_secs(6);
/// Time between two looks, µs.
const LOOK_US: u64 = 2_000;

impl Zero {
    pub(crate) fn run(self) -> Result<String, Error> {
        let reported = self.reported()?;
        let wanted = self.wanted(&reported);
        let mut report = Report {
            joints: wanted.iter().map(|asked| self.joint(asked)).collect(),
            told: !self.dry_run,
        };
        if !self.dry_run {
            self.tell(&wanted, &mut report)?;
        }
        let refused = report.joints.iter().find(|joint| {
            let answer = joint.answer;
            answer.is_some_and(|answer| answer != ACCEPTED)
        });
        if let Some(refused) = refused {
            let (joint, why) = (refused.joint, refused.answer.unwrap_or_default());
            return Err(Error::NotPlaced { joint, why });
        }
        Ok(match self.json {
            true => result("zero", &report),
            false => report.to_string(),
        })
    }

    /// Where the robot itself reports the joints to rest, of the legs that are asked for.
    fn reported(&self) -> Result<Vec<(JointId, f64)>, Error> {
        let Some(Reporter { name, address }) = &self.from else {
            return Ok(Vec::new());
        };
        // Of a sender that goes silent, what came by then is too short.
        let until = Until::after(Some(Duration::from_secs_f64(3.0 * REST)));
        let (facts, counts) = (BusFacts::default(), Counts::default());
        let source = Source::open(address, self.dds.network(), &facts, &until, &counts)?;
        let at = resting_at(name, source)?;
        until.stop();
        let lacks = |leg: &&Leg| at.iter().all(|(joint, _)| joint.leg() != **leg);
        if let Some(leg) = self.legs.iter().find(lacks) {
            let source = name.clone();
            let leg = leg.name();
            return Err(Error::NotReported {
                source_name: source,
                leg,
            });
        }
        let asked = |leg| self.legs.is_empty() || self.legs.contains(&leg);
        Ok(at
            .into_iter()
            .filter(|(joint, _)| asked(joint.leg()))
            .collect())
    }

    /// Each joint that is told, and its angle: of a joint told twice, what --at says, else --pose, else the robot.
    fn wanted(&self, reported: &[(JointId, f64)]) -> Vec<(JointId, f64)> {
        let legs = match self.legs.is_empty() {
            true => &Leg::ALL,
            false => &self.legs[..],
        };
        let poses = self.pose.iter().filter_map(|name| Pose::from_name(name));
        let posed = poses.flat_map(|pose| pose.angles(legs));
        let mut wanted: Vec<(JointId, f64)> = Vec::new();
        let reported = reported.iter().copied();
        for (joint, angle) in reported.chain(posed).chain(self.at.iter().copied()) {
            match wanted.iter_mut().find(|(known, _)| *known == joint) {
                Some(known) => known.1 = angle,
                None => wanted.push((joint, angle)),
            }
        }
        if let Some(joint) = self
            .reversed
            .iter()
            .find(|j| wanted.iter().all(|(known, _)| known != *j))
        {
            let message = format!(
                "{} is stated as reversed, but without its angle",
                joint.name()
            );
            super::usage_error("zero", ErrorKind::ArgumentConflict, message);
        }
        wanted.sort_by_key(|(joint, _)| *joint);
        wanted
    }

    fn joint(&self, (joint, angle): &(JointId, f64)) -> JointReport {
        JointReport {
            joint: joint.name(),
            angle: Some(*angle),
            reversed: Some(self.is_reversed(*joint)),
            answer: None,
            zero: None,
            known: None,
        }
    }

    fn is_reversed(&self, joint: JointId) -> bool {
        self.reversed.contains(&joint)
    }

    /// Tells the device, and adds what it answers and what it knows then.
    fn tell(&self, wanted: &[(JointId, f64)], report: &mut Report) -> Result<(), Error> {
        let mut talk = self.open(wanted)?;
        let mut actions: Vec<Action> = wanted.iter().map(|asked| self.action(asked)).collect();
        if self.same_power_up {
            actions.push(Action::TrustZeros);
        }
        if self.trust_wiring {
            actions.push(Action::TrustWiring);
        }
        let outcomes = talk.ask(&actions)?;
        if self.trust_wiring && outcomes != [Outcome::Accepted] {
            return Err(Error::NoTrial);
        }
        if self.same_power_up && outcomes != [Outcome::Accepted] {
            return Err(Error::NoZeros);
        }
        for (joint, outcome) in report.joints.iter_mut().zip(&outcomes) {
            joint.answer = Some(words_of(*outcome));
        }
        let hello = talk.hello.as_ref();
        let known = hello.map(|hello| hello.zeros).unwrap_or_default();
        if report.joints.is_empty() {
            let all = JointId::all().map(|joint| JointReport {
                joint: joint.name(),
                angle: None,
                reversed: None,
                answer: None,
                zero: None,
                known: None,
            });
            report.joints = all.collect();
        }
        for told in &mut report.joints {
            if let Some(joint) = JointId::from_name(told.joint) {
                let zero = known[joint.leg().index()][joint.place()];
                told.zero = Some(words_of_zero(zero));
                told.known = Some(zero.is_known());
            }
        }
        Ok(())
    }

    fn action(&self, (joint, angle): &(JointId, f64)) -> Action {
        Action::SetZero(SetZero {
            leg: joint.leg().index() as u8,
            joint: joint.place() as u8,
            angle: *angle as f32,
            reversed: self.is_reversed(*joint),
        })
    }

    /// The device, and what it hears while it is told.
    fn open(&self, wanted: &[(JointId, f64)]) -> Result<Talk, Error> {
        let simulated = |device: Box<dyn Device>| -> Result<Talk, Error> {
            let mut talk = Talk::new(device, Some(self.robot(wanted)));
            talk.ask(&[Action::SetPositions(Positions::FromPowerUp)])?;
            Ok(talk)
        };
        match self.device.as_str() {
            "sim" => simulated(Box::<Desktop<f64>>::default()),
            "qemu" => simulated(Box::new(Qemu::boot(&image::build(image::Scalar::F64)?)?)),
            port => Ok(Talk::new(
                Box::new(SerialDevice::open(port, [None; 4])?),
                None,
            )),
        }
    }

    /// A robot that rests where it is said to be, after a power-up.
    fn robot(&self, wanted: &[(JointId, f64)]) -> (PowerUp, [[f64; 3]; 4]) {
        let mut angles = Leg::ALL.map(|leg| {
            // Anywhere within the limits.
            position_limits(leg).map(|[lower, upper]| 0.5 * (lower + upper))
        });
        for (joint, angle) in wanted {
            angles[joint.leg().index()][joint.place()] = *angle;
        }
        (PowerUp::random(self.seed), angles)
    }
}

const ACCEPTED: &str = "accepted";

/// What a device answers, in words.
fn words_of(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Accepted => ACCEPTED,
        Outcome::NotHeard => "its motor does not answer",
        Outcome::Moves => "it moves",
        Outcome::OutOfRange => "it cannot be there",
        _ => "the device refuses",
    }
}

/// A conversation with a device.
struct Talk {
    device: Box<dyn Device>,
    /// What a simulated robot's buses carry.
    robot: Option<(PowerUp, [[f64; 3]; 4])>,
    requests: Requests,
    time_us: u64,
    hello: Option<Hello>,
}

impl Talk {
    fn new(device: Box<dyn Device>, robot: Option<(PowerUp, [[f64; 3]; 4])>) -> Self {
        Self {
            hello: Some(device.hello().clone()),
            device,
            robot,
            requests: Requests::new(),
            time_us: LOOK_US,
        }
    }

    /// Has the device hear what comes, for a moment.
    fn listen(&mut self, answers: &mut Vec<Answer>) -> Result<(), DeviceError> {
        self.time_us += LOOK_US;
        let step = match &self.robot {
            Some((power_up, angles)) => resting(self.time_us, angles, power_up),
            None => BusStep {
                time_us: self.time_us,
                ..BusStep::default()
            },
        };
        let hello = &mut self.hello;
        self.device.play(&step, &mut |message| match message {
            DeviceMessage::Answer(answer) => answers.push(answer),
            DeviceMessage::Hello(said) => *hello = Some(said),
            _ => {}
        })
    }

    /// Asks, and waits for the answers and for what the device says of itself after them.
    fn ask(&mut self, actions: &[Action]) -> Result<Vec<Outcome>, Error> {
        let mut answers = Vec::new();
        for _ in 0..50 {
            self.listen(&mut answers)?;
        }
        let mut asked = Vec::new();
        for action in actions {
            let request = self.requests.ask(*action, Instant::now());
            self.device.command(&HostMessage::Request(request))?;
            asked.push(request.id);
        }
        let (started, mut heard) = (Instant::now(), answers.len());
        self.hello = None;
        self.device.command(&HostMessage::RequestHello)?;
        while started.elapsed() < PATIENCE && !(self.requests.is_empty() && self.hello.is_some()) {
            self.listen(&mut answers)?;
            for answer in &answers[heard..] {
                self.requests.answered(answer);
                // One that was said before this answer knows nothing of it.
                self.hello = None;
                self.device.command(&HostMessage::RequestHello)?;
            }
            heard = answers.len();
            for again in self.requests.again(Instant::now()) {
                self.device.command(&HostMessage::Request(again))?;
            }
        }
        let outcome = |id: &u32| answers.iter().find(|answer| answer.id == *id);
        let outcomes: Vec<Outcome> = asked
            .iter()
            .filter_map(outcome)
            .map(|a| a.outcome)
            .collect();
        if outcomes.len() < actions.len() {
            return Err(Error::Unanswered {
                answers: outcomes.len(),
                wishes: actions.len(),
            });
        }
        Ok(outcomes)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::default();
        table.row(["joint", "angle rad", "zero"].map(str::to_owned));
        for joint in &self.joints {
            let angle = joint.angle.map_or("-".to_owned(), |angle| {
                let mark = if joint.reversed == Some(true) {
                    " reversed"
                } else {
                    ""
                };
                format!("{angle:.4}{mark}")
            });
            let zero = joint.zero.unwrap_or("would be set");
            table.row([joint.joint.to_owned(), angle, zero.to_owned()]);
        }
        write!(f, "{table}")?;
        let unknown = self
            .joints
            .iter()
            .filter(|joint| joint.known == Some(false));
        if unknown.count() > 0 {
            writeln!(
                f,
                "A leg is identified once all its zeros are known: --pose, --at or --from"
            )?;
        }
        Ok(())
    }
}
