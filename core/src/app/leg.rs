//! One leg's line: bus bytes, frames, samples, windows, factors.

use super::assembly::Assembler;
use crate::Real;
use crate::bus::{Decoder, Reply};
use crate::estimator::{EFFECTS, LegFactors, LegPrior, LegSolver, LegWindow, plausible};
use crate::go2::{ACTUATORS, JOINTS_PER_LEG, Leg, leg};
use crate::scalar::real;
use crate::spatial::Transform;
use crate::window::{Push, Sample, Settings, Window};
use crate::wire::LegCounters;

/// One leg, from its bus to its factors.
pub(super) struct LegLine<T: Real> {
    decoder: Decoder,
    assembler: Assembler,
    window: LegWindow<T>,
    /// The window has closed and its rows are not in the factors yet.
    closed: bool,
    factors: LegFactors<T>,
    prior: LegPrior<T>,
    counters: LegCounters,
}

impl<T: Real> LegLine<T> {
    pub(super) fn new(which: Leg) -> Self {
        let upright = Transform::identity();
        let settings = Settings::default();
        Self {
            decoder: Decoder::new(),
            assembler: Assembler::default(),
            window: Window::new(leg(which), upright, EFFECTS, plausible(which), settings),
            closed: false,
            factors: LegFactors::default(),
            prior: LegPrior::of(which),
            counters: LegCounters::default(),
        }
    }

    pub(super) fn counters(&self) -> LegCounters {
        let bus = self.decoder.counters();
        LegCounters {
            commands: bus.commands,
            replies: bus.replies,
            bad_crc: bus.bad_crc,
            short: bus.short,
            skipped_bytes: bus.skipped_bytes,
            unused_replies: self.assembler.unused(),
            ..self.counters
        }
    }

    pub(super) fn count_unsolved(&mut self) {
        increment(&mut self.counters.unsolved);
    }

    /// Takes the bytes of one step. Of several samples in them the newest is used, so that a step's work is bounded.
    pub(super) fn listen(&mut self, now_us: u64, cycle_us: u64, bytes: &[u8]) {
        let mut newest = None;
        let mut bytes = bytes;
        while let Some(frame) = self.decoder.next(&mut bytes) {
            if let Some(replies) = self.assembler.push(&frame, now_us, cycle_us)
                && newest.replace(replies).is_some()
            {
                self.assembler.discard(JOINTS_PER_LEG as u32);
            }
        }
        if let Some(replies) = newest {
            self.push(&sample(now_us, &replies));
        }
    }

    fn push(&mut self, sample: &Sample<T, JOINTS_PER_LEG>) {
        // Steps so long that the turn to fold did not come: fold now, before the next window's rows take the place.
        let next_close =
            self.window.rows().span_us[1].saturating_add(Settings::default().window_us);
        if sample.time_us >= next_close {
            self.fold();
        }
        let counters = &mut self.counters;
        increment(&mut counters.samples);
        match self.window.push(sample) {
            Push::Used => increment(&mut counters.used),
            Push::Closed => {
                increment(&mut counters.used);
                self.closed = true;
            }
            Push::Gap => {
                increment(&mut counters.used);
                increment(&mut counters.gaps);
            }
            Push::Repeated => increment(&mut counters.repeated),
            Push::Late => increment(&mut counters.late),
            Push::Rejected(_) => increment(&mut counters.rejected),
        }
    }

    /// Folds a closed window into the factors; whether there was one.
    pub(super) fn fold(&mut self) -> bool {
        if !self.closed {
            return false;
        }
        self.closed = false;
        match self.factors.fold_window(self.window.rows()) {
            Ok(()) => increment(&mut self.counters.windows),
            Err(_) => increment(&mut self.counters.unfolded),
        }
        true
    }

    /// Begins the solution for the windows folded so far.
    pub(super) fn start(&self, solver: &mut LegSolver<T>) {
        solver.start(&self.prior, &self.factors);
    }
}

/// What three motors say, joint side.
fn sample<T: Real>(time_us: u64, replies: &[Reply; JOINTS_PER_LEG]) -> Sample<T, JOINTS_PER_LEG> {
    let joint = |quantity: fn(&Reply, f64) -> f64| {
        core::array::from_fn(|j| real(quantity(&replies[j], ACTUATORS[j].gear)))
    };
    Sample {
        time_us,
        q: joint(Reply::joint_position),
        dq: joint(Reply::joint_velocity),
        tau: joint(Reply::joint_torque),
    }
}

fn increment(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
