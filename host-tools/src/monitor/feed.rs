//! Where messages come from: a thread that listens to a device, feeds it if it has no robot, and passes on what it is asked.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use proprio_core::go2::{LEGS, Leg};
use proprio_core::wire::{Action, DeviceMessage, Hello, HostMessage};

use super::error::FeedError;
use super::journal::{Entry, JournalReader};
use super::live::{Live, Step};
use crate::device::pull::Pull;
use crate::device::replay::settle;
use crate::device::serial::SerialDevice;
use crate::device::{BusStep, Device, DeviceError, Requests, Robot};
use crate::factors::Factors;
use crate::live::gathered;

/// Messages that may wait for who reads them. A device is never kept waiting by more: a board drops what its host does not take.
const WAITING: usize = 4096;
/// Time between two looks at a board's port, µs.
const LOOK_US: u64 = 10_000;
/// Time between two looks at what is asked while a recording is silent.
const LOOK: Duration = Duration::from_millis(20);
/// Time between two attempts to open a port that is gone.
const REOPEN: Duration = Duration::from_millis(500);
/// Time between two words of messages that a live source lost, µs.
const LOSSES_US: u64 = 1_000_000;

/// Who speaks.
pub enum Source {
    /// A device that hears a simulated robot.
    Simulated(Box<dyn Device + Send>, Box<Robot>),
    /// A board on this serial port, which is opened again whenever it is lost.
    Board(Box<SerialDevice>, String),
    /// A device in this process that hears a robot live.
    Live(Box<dyn Device + Send>, Live),
    /// A device in this process that hears a log, at the pace of its time.
    Log(Box<dyn Device + Send>, Live),
    /// A recording.
    Recording(JournalReader),
}

impl Source {
    /// What the device says of itself; of a recording, nothing yet.
    pub fn hello(&self) -> Option<&Hello> {
        match self {
            Self::Simulated(device, _) | Self::Live(device, _) | Self::Log(device, _) => {
                Some(device.hello())
            }
            Self::Board(device, _) => Some(device.hello()),
            Self::Recording(_) => None,
        }
    }
}

/// What the thread tells.
#[derive(Debug)]
pub enum Told {
    /// Something came, or was asked, at this time since the beginning.
    Entry(Duration, Box<Entry>),
    /// In words: what happened to the link, or to the factors that were asked for.
    News(String),
    /// Nothing more comes; an error if that was not to be.
    Ended(Option<FeedError>),
}

/// What the thread can be asked.
#[derive(Debug)]
pub enum Ask {
    /// Pass this on to the device.
    Action(Action),
    /// Hold the simulated robot, the log or the recording, or let it go on.
    Pause,
    /// Read the device's factors and write them to this file.
    Factors(PathBuf),
    /// End.
    End,
}

/// The thread's ends.
pub struct Feed {
    told: Receiver<Told>,
    asks: Sender<Ask>,
    thread: Option<JoinHandle<()>>,
}

impl Feed {
    /// Begins, with `first` asked before anything else; a simulated robot, a log or a recording runs `speed` times as fast as real time
    /// at most, 0: as fast as it goes.
    pub fn start(source: Source, speed: f64, first: Vec<Action>) -> Self {
        let (told, heard) = sync_channel(WAITING);
        let (asks, asked) = channel();
        for action in first {
            // A simulated robot makes its first step when the thread runs, whoever is quicker.
            let _ = asks.send(Ask::Action(action));
        }
        let thread = std::thread::spawn(move || {
            let mut listener = Listener::new(told, asked, speed);
            let ended = match source {
                Source::Simulated(device, robot) => listener.feed(device, &robot),
                Source::Board(device, port) => listener.listen(*device, &port),
                Source::Live(device, live) => listener.follow(device, &live, false),
                Source::Log(device, log) => listener.follow(device, &log, true),
                Source::Recording(reader) => listener.play(reader),
            };
            // Nobody hears it if the reader is gone.
            let _ = listener.told.send(Told::Ended(ended.err()));
        });
        Self {
            told: heard,
            asks,
            thread: Some(thread),
        }
    }

    /// Asks for something; nothing happens if the thread has ended.
    pub fn ask(&self, ask: Ask) {
        let _ = self.asks.send(ask);
    }

    /// The next that is told, if it comes within `patience`.
    pub fn next(&self, patience: Duration) -> Option<Told> {
        match gathered(&self.told, patience) {
            Ok(told) => Some(told),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Told::Ended(None)),
        }
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.ask(Ask::End);
        // What is still to be told has no reader; with it gone, the thread sees that it may end.
        let (_, nobody) = sync_channel(0);
        drop(std::mem::replace(&mut self.told, nobody));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Listener {
    told: SyncSender<Told>,
    asked: Receiver<Ask>,
    speed: f64,
    started: Instant,
    /// When the present pause began, and how long those before were.
    pause: (Option<Instant>, Duration),
    requests: Requests,
    pull: Option<(Pull, PathBuf)>,
    losses: (u32, u32),
    ended: bool,
}

impl Listener {
    fn new(told: SyncSender<Told>, asked: Receiver<Ask>, speed: f64) -> Self {
        Self {
            told,
            asked,
            speed,
            started: Instant::now(),
            pause: (None, Duration::ZERO),
            requests: Requests::new(),
            pull: None,
            losses: (0, 0),
            ended: false,
        }
    }

    fn tell(&mut self, told: Told) {
        self.ended |= self.told.send(told).is_err();
    }

    fn news(&mut self, text: String) {
        self.tell(Told::News(text));
    }

    fn entry(&mut self, entry: Entry) {
        self.tell(Told::Entry(self.started.elapsed(), Box::new(entry)));
    }

    /// Whether to go on; waits while there is a pause.
    fn goes_on(&mut self) -> bool {
        while !self.ended
            && let Some(since) = self.pause.0
        {
            self.take_asks(None, &[]);
            if self.pause.0.is_none() {
                self.pause.1 += since.elapsed();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        !self.ended
    }

    /// How long it is until `time` of the robot or the recording comes; for ever, where that is beyond all numbers.
    fn until(&self, time: Duration) -> Duration {
        if self.speed <= 0.0 {
            return Duration::ZERO;
        }
        let due = Duration::try_from_secs_f64(time.as_secs_f64() / self.speed);
        let due = due.unwrap_or(Duration::MAX).saturating_add(self.pause.1);
        due.saturating_sub(self.started.elapsed())
    }

    /// Does what is asked; without a device, only what needs none.
    fn take_asks(&mut self, device: Option<&dyn Device>, legs: &[Leg]) -> Vec<HostMessage> {
        let mut messages = Vec::new();
        while let Ok(ask) = self.asked.try_recv() {
            match (ask, device) {
                (Ask::End, _) => self.ended = true,
                (Ask::Pause, _) => {
                    self.pause.0 = match self.pause.0 {
                        None => Some(Instant::now()),
                        Some(_) => None,
                    }
                }
                (Ask::Action(action), Some(_)) => {
                    let request = self.requests.ask(action, Instant::now());
                    self.entry(Entry::Request(request));
                    messages.push(HostMessage::Request(request));
                }
                (Ask::Factors(path), Some(device)) => {
                    let factors = Factors::of_device(device.hello());
                    self.pull = Some((Pull::new(legs, factors), path));
                }
                (Ask::Action(_) | Ask::Factors(_), None) => {
                    self.news("there is no device to ask".to_owned());
                }
            }
        }
        let now = Instant::now();
        let again = self.requests.again(now).into_iter();
        messages.extend(again.map(HostMessage::Request));
        messages.extend(self.pull.as_mut().and_then(|(pull, _)| pull.ask(now)));
        messages
    }

    /// Passes on what is asked, does a step, tells what comes.
    fn step(
        &mut self,
        device: &mut dyn Device,
        legs: &[Leg],
        step: &BusStep,
    ) -> Result<(), FeedError> {
        self.pass_on(device, legs)?;
        self.play_step(device, step)
    }

    /// Passes on what is asked; whether anything was.
    fn pass_on(&mut self, device: &mut dyn Device, legs: &[Leg]) -> Result<bool, FeedError> {
        let messages = self.take_asks(Some(device), legs);
        for message in &messages {
            match device.command(message) {
                // What an older firmware does not take is no reason to stop watching it.
                Err(error @ DeviceError::OtherLayout(_)) => {
                    self.news(error.to_string());
                    match message {
                        HostMessage::ReadFactor(_) => self.pull = None,
                        _ => self.requests.give_up(),
                    }
                }
                done => done?,
            }
        }
        Ok(!messages.is_empty())
    }

    /// Does a step, tells what comes.
    fn play_step(&mut self, device: &mut dyn Device, step: &BusStep) -> Result<(), FeedError> {
        let mut heard = Vec::new();
        device.play(step, &mut |message| heard.push(message))?;
        for message in heard {
            self.hear(message)?;
        }
        let losses = device.losses();
        if losses != self.losses {
            self.losses = losses;
            self.entry(Entry::Losses(losses.0, losses.1));
        }
        Ok(())
    }

    fn hear(&mut self, message: DeviceMessage) -> Result<(), FeedError> {
        if let DeviceMessage::Answer(answer) = &message {
            self.requests.answered(answer);
        }
        if let (DeviceMessage::FactorPart(part), Some((pull, path))) = (&message, &mut self.pull) {
            pull.hear(part)?;
            if let Some(factors) = pull.finished() {
                let done = match factors.write(path) {
                    Ok(()) => format!("factors are in {}", path.display()),
                    Err(error) => error.to_string(),
                };
                self.pull = None;
                self.news(done);
            }
        }
        self.entry(Entry::Message(message));
        Ok(())
    }

    /// Has a device hear a simulated robot.
    fn feed(&mut self, mut device: Box<dyn Device + Send>, robot: &Robot) -> Result<(), FeedError> {
        let hello = device.hello().clone();
        self.entry(Entry::Message(DeviceMessage::Hello(hello)));
        for step in robot.steps() {
            if !self.goes_on() {
                break;
            }
            let step = step?;
            std::thread::sleep(self.until(Duration::from_micros(step.time_us)));
            self.step(&mut *device, robot.legs(), &step)?;
        }
        Ok(())
    }

    /// Listens to a board, whatever becomes of its port. A pause is the reader's affair.
    fn listen(&mut self, device: SerialDevice, port: &str) -> Result<(), FeedError> {
        let mut device = Some(device);
        while !self.ended {
            let Some(board) = &mut device else {
                self.take_asks(None, &[]);
                std::thread::sleep(REOPEN);
                match SerialDevice::open(port, [None; 4]) {
                    Ok(opened) => {
                        self.news(format!("{port} is back"));
                        self.losses = (0, 0);
                        device = Some(opened);
                    }
                    Err(error @ DeviceError::Wire(_)) => return Err(error.into()),
                    Err(_) => {}
                }
                continue;
            };
            let hello = board.hello().clone();
            self.entry(Entry::Message(DeviceMessage::Hello(hello)));
            let mut time_us = 0;
            let lost = loop {
                if self.ended {
                    return Ok(());
                }
                time_us += LOOK_US;
                let silent = BusStep {
                    time_us,
                    ..BusStep::default()
                };
                match self.step(board, &Leg::ALL, &silent) {
                    Ok(()) => {}
                    Err(FeedError::Device(DeviceError::Link(error))) => break error,
                    Err(error) => return Err(error),
                }
            };
            self.news(format!("{port} is gone: {lost}"));
            device = None;
        }
        Ok(())
    }

    /// Has a device hear a robot live, or a log if it `is_log`, whose rows wait for their time. While the robot is silent the device's time
    /// stands still, so that what comes late is not before it.
    fn follow(
        &mut self,
        mut device: Box<dyn Device + Send>,
        live: &Live,
        is_log: bool,
    ) -> Result<(), FeedError> {
        let hello = device.hello().clone();
        self.entry(Entry::Message(DeviceMessage::Hello(hello)));
        let mut silent = BusStep::default();
        let (mut losses, mut said_us) = ((0, 0), 0);
        let mut played = [false; LEGS];
        while !self.ended {
            match live.next(LOOK)? {
                Step::Row(imu, step) => {
                    if is_log && !self.wait(&mut *device, Duration::from_micros(step.time_us))? {
                        break;
                    }
                    if let Some(imu) = imu {
                        device.command(&HostMessage::Imu(imu))?;
                    }
                    silent.time_us = step.time_us;
                    let legs = played.iter_mut().zip(&step.buses);
                    legs.for_each(|(played, bytes)| *played |= !bytes.is_empty());
                    self.step(&mut *device, &Leg::ALL, &step)?;
                }
                // Its time stands still: a step would only have it work ahead, and what it estimates next depend on this machine's pauses.
                Step::Silence => {
                    if self.pass_on(&mut *device, &Leg::ALL)? {
                        self.play_step(&mut *device, &silent)?;
                    }
                }
                Step::End(warnings) => {
                    warnings.into_iter().for_each(|warning| self.news(warning));
                    return self.settle(&mut *device, silent.time_us, &played);
                }
            }
            let now = live.losses();
            if now.1 > 0 && losses.1 == 0 {
                self.news(
                    "a second writer sends on the topic: its messages are left out".to_owned(),
                );
            }
            if now.0 != losses.0 && silent.time_us >= said_us {
                said_us = silent.time_us + LOSSES_US;
                self.news(format!("{} messages never came so far", now.0));
                losses.0 = now.0;
            }
            losses.1 = now.1;
        }
        Ok(())
    }

    /// Waits until `time` of a log comes, passing on what is asked meanwhile: a log may be silent for minutes. False if it is to end.
    fn wait(&mut self, device: &mut dyn Device, time: Duration) -> Result<bool, FeedError> {
        loop {
            self.pass_on(device, &Leg::ALL)?;
            if !self.goes_on() {
                return Ok(false);
            }
            let left = self.until(time);
            if left.is_zero() {
                return Ok(true);
            }
            std::thread::sleep(left.min(LOOK));
        }
    }

    /// Has the device estimate all that it has heard.
    fn settle(
        &mut self,
        device: &mut dyn Device,
        time_us: u64,
        played: &[bool; LEGS],
    ) -> Result<(), FeedError> {
        let mut heard = Vec::new();
        settle(device, time_us, played, &mut |message| heard.push(message))?;
        heard.into_iter().try_for_each(|message| self.hear(message))
    }

    /// Plays a recording.
    fn play(&mut self, mut reader: JournalReader) -> Result<(), FeedError> {
        while let Some((at, entry)) = reader.next_entry()? {
            // A recording may be silent for hours: whoever waits for its end is heard meanwhile.
            loop {
                self.take_asks(None, &[]);
                let left = self.until(at);
                if !self.goes_on() || left.is_zero() {
                    break;
                }
                std::thread::sleep(left.min(LOOK));
            }
            if self.ended {
                break;
            }
            self.tell(Told::Entry(at, Box::new(entry)));
        }
        Ok(())
    }
}
