//! `proprio monitor`: live estimates of a device.

mod foxglove;
mod lines;
mod session;
mod settings;
mod terminal;
mod web;

use std::io::{IsTerminal, stdin, stdout};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use crate::device::power_up::PowerUp;
use crate::device::serial::SerialDevice;
use crate::device::{Desktop, Device, Qemu, Robot, WalkingDesktop, image};
use crate::live::{self, Address, Counts, Until};
use crate::log::{LogReader, Selection};
use crate::monitor::web::Server;
use crate::monitor::{Feed, JournalError, JournalReader, JournalWriter, Live, Source};
use crate::name::leg_named;
use crate::output::WriteError;
use clap::Args;
use clap::error::ErrorKind;
use proprio_core::go2::Leg;
use proprio_core::wire::{Action, Hello, Positions};
use proprio_simulator::Hide;
use proprio_simulator::hidden::typical;

use foxglove::Viewers;
use session::Session;
use settings::{Known, KnownBody, SetupArguments};

use super::Error;
use super::bus_arguments::BusArguments;
use super::dds_arguments::DdsArguments;
use super::result::result;

/// What the simulated robot has beside a Go2's usual friction, unless --hide says otherwise: something to be found.
const HIDDEN: &str = "quadratic_drag:FR_calf=0.05";

/// Watch a device's estimates live
///
/// Shows each joint's friction with errors and its residual against the band of the seconds before, which effects the device finds
/// missing, what happened, and how bus and link are. A page per leg has all its parameters against the CAD. Keys: a and d add the
/// chosen effect to the device's model and drop it, r resets, p pauses, q quits. s saves a model file, f the device's factors for
/// `identify --factor`; w has the device write what it knows to its flash. Without a terminal, or with --lines, lines are printed
/// instead; --web serves the same as a page with live plots.
///
/// `qemu` builds the firmware and boots it on an emulated board with a simulated robot; `sim` runs its code in this process,
/// which needs no emulator. `dds` gives that code a robot's own network, as `record` does; LEG=PORT the motor buses that adapters listen to; `-` rows
/// of CSV on standard input; a log of any format is played to it. Anything else is a board's serial port, or a file that --record made.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio monitor sim
  proprio monitor qemu --hide stribeck:FL_thigh=0.3
  proprio monitor dds:eth0
  proprio monitor dds:eth0 --free-base
  proprio monitor FR=/dev/ttyUSB0 --at FR_hip=0.1 --at FR_thigh=0.8 --at FR_calf=lower
  proprio monitor /dev/ttyACM0 --record monday.messages
  proprio monitor monday.messages --speed 10
  proprio monitor FR.cap --speed 10
  proprio monitor sim --memory 600
  proprio monitor sim --power-up 1 --speed 0 --seconds 5 --lines
  proprio monitor /dev/ttyACM0 --legs FR,FL --prior viscous:FR_hip=0.04,0.01 --body FR_calf=0.5
  proprio monitor /dev/ttyACM0 --imu-at 0,0,0.07 --imu-turned 3.1416,0,0
  proprio monitor qemu --web
  proprio monitor dds:eth0 --foxglove
  proprio monitor sim --speed 0 --seconds 30 --json")]
pub(crate) struct Monitor {
    /// Whose messages
    #[arg(
        value_name = "PORT|LEG=PORT...|dds[:IFACE][/TOPIC]|-|qemu|sim|LOG|FILE",
        required = true
    )]
    source: Vec<String>,
    /// Keep all that comes in this file, to be watched again
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    dds: DdsArguments,
    /// Of `dds`, - or a log: the robot stands or walks. Its mass, trunk, legs and friction are estimated from its joints, IMU and feet
    #[arg(long, visible_alias = "floating-base", conflicts_with_all = ["memory", "prior", "body", "legs", "hide", "power_up"])]
    free_base: bool,
    #[command(flatten)]
    buses: BusArguments,
    /// End after so much of the device's time
    #[arg(long, value_name = "S", value_parser = super::simulate::within(0.1, 1e9))]
    seconds: Option<f64>,
    /// How fast a simulated robot, a log or a recording runs; 0: as fast as it goes
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = super::simulate::within(0.0, 1000.0))]
    speed: f64,
    /// What the simulated robot has beside usual friction [default: quadratic_drag:FR_calf=0.05]
    #[arg(long, value_name = "EFFECT[:JOINT]=VALUE[,NAME=VALUE...]", value_parser = super::simulate::parse_hide)]
    hide: Vec<Hide>,
    /// Have the device forget: data of so many seconds ago weigh 1/e; 0: nothing is forgotten
    #[arg(long, value_name = "S")]
    memory: Option<u32>,
    /// Have the device take this for what is known of an effect's parameter before any data: its value and standard deviation, SI
    #[arg(long, value_name = "EFFECT[:JOINT]=VALUE,STD")]
    prior: Vec<Known>,
    /// Have the device take the CAD's body behind a joint to be known so well: relative standard deviation of its mass, 0.001 to 100
    #[arg(long, value_name = "JOINT=STD")]
    body: Vec<KnownBody>,
    /// Have the device listen to these legs alone, separated by commas
    #[arg(long, value_name = "LEG", value_delimiter = ',', value_parser = leg_named)]
    legs: Vec<Leg>,
    #[command(flatten)]
    setup: SetupArguments,
    /// Have the simulated robot's motors count from where this power-up has them, as a real robot's do, so that the device knows no zero
    /// [default: positions on its buses are angles]
    #[arg(long, value_name = "SEED")]
    power_up: Option<u64>,
    /// Seed of the simulated robot's motion and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Serve a page instead of a screen; whoever reaches ADDRESS can look and ask [default of ADDRESS: 127.0.0.1:7700, for this
    /// machine alone; port 0: any that is free]
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:7700", conflicts_with = "lines")]
    web: Option<SocketAddr>,
    /// Also serve viewers that speak Foxglove's WebSocket protocol; whoever reaches ADDRESS can look, and ask nothing [default of ADDRESS:
    /// 127.0.0.1:8765, for this machine alone; port 0: any that is free]
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:8765")]
    foxglove: Option<SocketAddr>,
    /// Print lines instead of a screen
    #[arg(long)]
    lines: bool,
    /// Print one JSON object at the end instead
    #[arg(long)]
    json: bool,
}

impl Monitor {
    pub(crate) fn run(self) -> Result<String, Error> {
        // A port that is taken is said before anything is built or recorded.
        let server = self.web.map(Server::start).transpose()?;
        let viewers = self.foxglove.map(Viewers::start).transpose()?;
        let source = self.open()?;
        let settings = self.settings(source.hello())?;
        let journal = self.record.as_deref().map(journal).transpose()?;
        let mut session = Session {
            is_live: matches!(source, Source::Live(..)),
            feed: Feed::start(source, self.speed, settings),
            journal: journal.zip(self.record.clone()),
            view: Default::default(),
            viewers,
            limit_us: self.seconds.map(|seconds| (seconds * 1e6) as u64),
            ended: false,
        };
        let name = self.source.join(" ");
        let on_terminal = stdout().is_terminal() && stdin().is_terminal();
        match (server, on_terminal && !self.lines && !self.json) {
            (Some(server), _) => web::watch(&mut session, &server, &name)?,
            (None, true) => terminal::watch(&mut session, name)?,
            (None, false) => lines::watch(&mut session, self.json)?,
        }
        session.viewers.take().into_iter().for_each(Viewers::end);
        Ok(match self.json {
            true => result("monitor", &lines::Report::new(&session.view)),
            false => String::new(),
        })
    }

    /// What the device is to be told at the beginning.
    fn settings(&self, hello: Option<&Hello>) -> Result<Vec<Action>, Error> {
        let mut actions: Vec<Action> = self.memory.map(Action::SetMemory).into_iter().collect();
        if [["sim"], ["qemu"]].iter().any(|name| self.source == *name) {
            actions.push(Action::SetPositions(match self.power_up {
                Some(_) => Positions::FromPowerUp,
                None => Positions::Absolute,
            }));
        }
        if let Some(mask) = settings::mask(&self.legs) {
            actions.push(Action::SetLegs(mask));
        }
        actions.extend(self.body.iter().map(KnownBody::action));
        let Some(hello) = hello else {
            let asked = [
                (!self.prior.is_empty(), "--prior"),
                (self.setup.is_asked(), "what a board is set up for"),
            ];
            if let Some((_, what)) = asked.iter().find(|(asked, _)| *asked) {
                let why = format!("{what} needs a device: a recording can be asked nothing");
                super::usage_error("monitor", ErrorKind::ArgumentConflict, why);
            }
            return Ok(actions);
        };
        if self.setup.is_asked() {
            actions.push(self.setup.action(hello));
        }
        for known in &self.prior {
            actions.extend(known.actions(hello)?);
        }
        Ok(actions)
    }

    /// Opens the source; what takes long or fails is said before there is a screen.
    fn open(&self) -> Result<Source, Error> {
        let address = Address::parse(&self.source);
        let file = match &self.source[..] {
            [name] if address.is_none() => {
                Some(Path::new(name)).filter(|path| path.is_file() || path.is_dir())
            }
            _ => None,
        };
        let messages = file.map(messages).transpose()?.flatten();
        let log = file.filter(|_| messages.is_none());
        let takes_walks = log.is_some() || matches!(address, Some(Address::Dds(_) | Address::Text));
        if self.free_base && !takes_walks {
            let why = "--free-base is of `dds`, - and logs; a board of a robot that walks has the firmware of `proprio flash --walking`".to_owned();
            super::usage_error("monitor", ErrorKind::ArgumentConflict, why);
        }
        match (address, messages, log) {
            (Some(Address::Simulated), ..) => {
                return self.simulated(Box::new(Desktop::<f64>::new()));
            }
            (Some(address), ..) => return self.live(&address),
            (None, Some(messages), _) => return Ok(Source::Recording(messages)),
            (None, None, Some(log)) => return self.log(log),
            (None, None, None) => {}
        }
        let [source] = &self.source[..] else {
            let why = "one source, or one LEG=PORT for each leg".to_owned();
            super::usage_error("monitor", ErrorKind::ValueValidation, why);
        };
        Ok(match source.as_str() {
            "qemu" => {
                let image = image::build(image::Scalar::F64)?;
                self.simulated(Box::new(Qemu::boot(&image)?))?
            }
            port => Source::Board(
                Box::new(SerialDevice::open(port, [None; 4])?),
                port.to_owned(),
            ),
        })
    }

    fn live(&self, address: &Address) -> Result<Source, Error> {
        let (until, counts) = (Until::default(), Counts::default());
        let facts = self.buses.facts("monitor");
        if matches!(address, Address::Dds(_)) {
            eprintln!("Waiting for the robot to be found.");
        }
        let source = live::Source::open(address, self.dds.network(), &facts, &until, &counts)?;
        let name = PathBuf::from(self.source.join(" "));
        let live = Live::follow(name, source, self.free_base, until, counts)?;
        Ok(Source::Live(self.device(), live))
    }

    fn log(&self, path: &Path) -> Result<Source, Error> {
        // What is no log is refused before there is a screen.
        LogReader::open(path, Selection::Motion)?;
        let rows = Live::of_log(path.to_owned(), self.free_base)?;
        Ok(Source::Log(self.device(), rows))
    }

    /// The device in this process.
    fn device(&self) -> Box<dyn Device + Send> {
        match self.free_base {
            true => Box::new(WalkingDesktop::<f64>::new()),
            false => Box::new(Desktop::<f64>::new()),
        }
    }

    fn simulated(&self, device: Box<dyn Device + Send>) -> Result<Source, Error> {
        let legs = Leg::ALL;
        let mut effects = typical(&legs);
        let default: Vec<Hide> = HIDDEN.parse().into_iter().collect();
        let hidden = match self.hide.is_empty() {
            true => &default,
            false => &self.hide,
        };
        for hide in hidden {
            match hide.on(&legs) {
                Ok(hidden) => effects.extend(hidden),
                Err(error) => {
                    super::usage_error("monitor", ErrorKind::ValueValidation, error.to_string())
                }
            }
        }
        let robot = Robot::new(&legs, effects, self.seed);
        let robot = robot.after(self.power_up.map_or(PowerUp::NONE, PowerUp::random));
        Ok(Source::Simulated(device, Box::new(robot)))
    }
}

/// A recording of a device's messages, if that is what the file is.
fn messages(path: &Path) -> Result<Option<JournalReader>, JournalError> {
    if path.is_dir() {
        return Ok(None);
    }
    match JournalReader::open(path) {
        Ok(messages) => Ok(Some(messages)),
        Err(JournalError::NotMessages(_)) => Ok(None),
        Err(error) => Err(error),
    }
}

fn journal(path: &Path) -> Result<JournalWriter, WriteError> {
    JournalWriter::create(path).map_err(|source| WriteError {
        path: path.to_owned(),
        source,
    })
}
