//! A simulated Go2 that changes as it moves, and what a device says of it.

use nalgebra::Matrix3;
use proprio_core::go2::{JOINTS_PER_LEG, LEGS, Leg, leg};
use proprio_core::inertia::InertialParameters;
use proprio_core::tree::Tree;
use proprio_core::window::Sample;
use proprio_core::wire::{Change, Counters, DeviceMessage, Estimate};
use proprio_host::device::Robot;
use proprio_host::device::replay::cycle;
use proprio_host::device::{BusStep, Desktop, Device, DeviceError};
use proprio_simulator::hidden::typical;
use proprio_simulator::{HiddenEffect, Hide};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::motion;

/// A robot with a real one's friction and what `hide` says beside, as `--hide` does; none if empty.
///
/// # Panics
/// If `hide` makes no sense.
pub fn robot(hide: &str, seed: u64) -> Robot {
    let mut effects: Vec<HiddenEffect> = typical(&Leg::ALL);
    if !hide.is_empty() {
        let hide: Hide = hide.parse().expect("an effect");
        effects.extend(hide.on(&Leg::ALL).expect("a joint"));
    }
    Robot::new(&Leg::ALL, effects, seed)
}

/// A hung robot whose torques obey the model exactly but for noise, which costs little.
///
/// The noise of each joint is white and as much again that remembers 50 ms: 0.1 N m each.
pub struct ExactRobot {
    random: ChaCha8Rng,
    memory: [[f64; JOINTS_PER_LEG]; LEGS],
    legs: [Tree<f64, JOINTS_PER_LEG, JOINTS_PER_LEG>; LEGS],
    step: u64,
}

impl ExactRobot {
    /// One that has not moved yet.
    pub fn new(seed: u64) -> Self {
        Self {
            random: ChaCha8Rng::seed_from_u64(seed),
            memory: Default::default(),
            legs: Leg::ALL.map(leg),
            step: 0,
        }
    }

    /// Puts a mass (kg) on a leg's calf, at a point of its joint's frame.
    pub fn load(&mut self, which: Leg, mass: f64, at: [f64; 3]) {
        let load = InertialParameters::from_com(mass, at.into(), Matrix3::zeros());
        let mut bodies = leg::<f64>(which).bodies().map(|body| body.inertia);
        bodies[JOINTS_PER_LEG - 1] = bodies[JOINTS_PER_LEG - 1] + load;
        self.legs[which.index()] = leg(which).with_inertia(&bodies);
    }

    fn sample(&mut self, leg: Leg) -> Sample<f64, JOINTS_PER_LEG> {
        // What is remembered of a sample ago, so that the deviation is that of the white noise.
        let share = (-(motion::SAMPLE_US as f64) / 50_000.0).exp();
        let new = (1.0 - share * share).sqrt();
        let mut sample = motion::sample_of(&self.legs[leg.index()], leg, self.step);
        for (tau, memory) in sample.tau.iter_mut().zip(&mut self.memory[leg.index()]) {
            let [white, fresh]: [f64; 2] =
                std::array::from_fn(|_| self.random.sample(StandardNormal));
            *memory = share * *memory + new * fresh;
            *tau += 0.1 * (white + *memory);
        }
        sample
    }
}

impl Iterator for ExactRobot {
    type Item = BusStep;

    fn next(&mut self) -> Option<BusStep> {
        self.step += 1;
        let buses = Leg::ALL.map(|leg| cycle(leg, &self.sample(leg)).expect("it fits a frame"));
        let time_us = self.step * motion::SAMPLE_US;
        Some(BusStep { time_us, buses })
    }
}

/// A device, and the last that it said of each leg.
pub struct Listener {
    device: Box<dyn Device>,
    /// The last estimates.
    pub estimates: [Option<Estimate>; LEGS],
    /// The last counters.
    pub counters: Counters,
    /// All changes.
    pub changes: Vec<Change>,
    /// Steps.
    pub steps: u64,
    /// Messages.
    pub messages: u64,
}

impl Listener {
    /// One in this process that has heard nothing.
    pub fn new() -> Self {
        Self::of(Box::new(Desktop::<f64>::new()))
    }

    /// What `device` says, which has heard nothing.
    pub fn of(device: Box<dyn Device>) -> Self {
        Self {
            device,
            estimates: Default::default(),
            counters: Counters::default(),
            changes: Vec::new(),
            steps: 0,
            messages: 0,
        }
    }

    /// Hears one step of a robot's buses.
    ///
    /// # Panics
    /// If the device fails; one in this process does not.
    pub fn hear(&mut self, step: &BusStep) {
        self.steps += 1;
        self.ask(|device, told| device.play(step, told));
    }

    /// Waits until all that was heard is in what the device has said.
    ///
    /// # Panics
    /// As [`Self::hear`].
    pub fn settle(&mut self) {
        self.ask(|device, told| device.settle(told));
    }

    fn ask(
        &mut self,
        what: impl FnOnce(&mut dyn Device, &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError>,
    ) {
        let Self {
            device,
            estimates,
            counters,
            changes,
            messages,
            ..
        } = self;
        let mut told = |message| {
            *messages += 1;
            match message {
                DeviceMessage::Estimate(estimate) => {
                    let leg = usize::from(estimate.leg);
                    estimates[leg] = Some(estimate);
                }
                DeviceMessage::Counters(latest) => *counters = latest,
                DeviceMessage::Change(change) => changes.push(change),
                _ => {}
            }
        };
        what(&mut **device, &mut told).expect("the device answers");
    }

    /// Hears `before` until `seconds` of its time, then `after` for so many more.
    ///
    /// # Panics
    /// If the simulation diverges.
    pub fn hear_change(&mut self, before: &Robot, seconds: u64, after: &Robot, more: u64) {
        let until = |seconds: u64| move |step: &BusStep| step.time_us <= seconds * 1_000_000;
        let steps = |robot: &Robot, to: u64| -> Vec<BusStep> {
            let steps = robot.steps().map(|step| step.expect("it stays finite"));
            steps.take_while(until(to)).collect()
        };
        let first = steps(before, seconds);
        for step in &first {
            self.hear(step);
        }
        for step in &steps(after, seconds + more)[first.len()..] {
            self.hear(step);
        }
    }

    /// The last estimate of a leg.
    ///
    /// # Panics
    /// If there is none.
    pub fn estimate(&self, leg: Leg) -> &Estimate {
        self.estimates[leg.index()].as_ref().expect("an estimate")
    }
}

impl Default for Listener {
    fn default() -> Self {
        Self::new()
    }
}
