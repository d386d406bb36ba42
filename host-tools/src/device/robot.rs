//! A simulated robot on four motor buses, for devices that have none.

use proprio_core::go2::Leg;
use proprio_core::window::Sample;

use super::BusStep;
use super::power_up::PowerUp;
use super::replay::{Instant, ReplayError, bus_step_after};
use proprio_simulator::{Diverged, HiddenEffect, SimulatedSample, Simulation};

/// Why there are no more bytes.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// A value that does not fit a frame.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The motion.
    #[error(transparent)]
    Diverged(#[from] Diverged),
}

/// How long it moves, s: longer than anybody looks.
const DURATION: f64 = 1e7;

/// A hung Go2 whose legs swing for months.
#[derive(Debug, Clone)]
pub struct Robot(Simulation, PowerUp);

impl Robot {
    /// A robot of these legs with these effects, as the simulator has them.
    pub fn new(legs: &[Leg], effects: Vec<HiddenEffect>, seed: u64) -> Self {
        let simulation = Simulation {
            duration: DURATION,
            effects,
            seed,
            ..Simulation::new(legs)
        };
        Self(simulation, PowerUp::NONE)
    }

    /// The same robot, whose motors count as this power-up has them.
    pub fn after(self, power_up: PowerUp) -> Self {
        Self(self.0, power_up)
    }

    /// Its legs.
    pub fn legs(&self) -> &[Leg] {
        &self.0.legs
    }

    /// What its buses carry, sample by sample.
    ///
    /// # Errors
    /// An item is an error, and the last, if the motion leaves the real numbers or what a frame can hold.
    pub fn steps(&self) -> impl Iterator<Item = Result<BusStep, RobotError>> + '_ {
        self.0.samples().map(|sample| {
            let sample = sample?;
            let time_us = (sample.t * 1e6).round() as u64 + FIRST_US;
            let instant = instant(&self.0.legs, time_us, &sample);
            Ok(bus_step_after(time_us, &instant, &self.1)?)
        })
    }
}

/// Time of the first sample, µs: after a device's first step.
const FIRST_US: u64 = 2_000;

fn instant(legs: &[Leg], time_us: u64, sample: &SimulatedSample) -> Instant {
    let mut instant = Instant::default();
    for (n, leg) in legs.iter().enumerate() {
        let of_leg = |values: &[f64]| std::array::from_fn(|j| values[3 * n + j]);
        instant[leg.index()] = Some(Sample {
            time_us,
            q: of_leg(&sample.q),
            dq: of_leg(&sample.dq),
            tau: of_leg(&sample.tau),
        });
    }
    instant
}
