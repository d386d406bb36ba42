//! One leg's bus of a robot that walks: of what it brought, the last polling cycle.

use crate::Real;
use crate::app::counts::heard;
use crate::app::identity::Identity;
use crate::app::leg::{SETTINGS, STEP_EFFORT};
use crate::app::zeros::{LegAlignment, Zeros};
use crate::bus::{Listener, Queue};
use crate::go2::{JOINTS_PER_LEG, Leg};
use crate::scalar::real;
use crate::slot::Slot;
use crate::window::Sample;
use crate::wire::{LegCounters, Outcome, Positions, SetZero, Zero};

/// Polling cycles that are taken off one bus in a step at most.
const CYCLES: usize = 3;

/// One leg's bus.
pub(super) struct Line<T> {
    pub(super) queue: Queue,
    listener: Slot<Listener>,
    alignment: LegAlignment<T>,
    zeros: Zeros,
    /// A zero is void that was not when this was asked last.
    pub(super) voided: bool,
    /// The last cycle, the foot's count in it, and whether the robot's sample still waits for it.
    pub(super) latest: Sample<T, JOINTS_PER_LEG>,
    pub(super) count: T,
    pub(super) fresh: bool,
    samples: u32,
    surplus: u32,
    unplaced: u32,
}

impl<T: Real> Line<T> {
    pub(super) const fn new() -> Self {
        Self {
            queue: Queue::new(),
            listener: Slot::Empty,
            alignment: LegAlignment::new(),
            zeros: Zeros::new(),
            voided: false,
            latest: Sample {
                time_us: 0,
                q: [T::ZERO; JOINTS_PER_LEG],
                dq: [T::ZERO; JOINTS_PER_LEG],
                tau: [T::ZERO; JOINTS_PER_LEG],
            },
            count: T::ZERO,
            fresh: false,
            samples: 0,
            surplus: 0,
            unplaced: 0,
        }
    }

    /// Begins anew. Not inlined: what a listener takes of the stack is given back.
    #[inline(never)]
    pub(super) fn begin(&mut self, identity: &Identity) {
        self.queue.clear();
        self.listener = Slot::Full(Listener::new());
        self.alignment = LegAlignment::new();
        self.zeros.begin(identity, &mut self.alignment);
        (self.fresh, self.samples, self.surplus) = (false, 0, 0);
        (self.voided, self.unplaced) = (false, 0);
    }

    /// Takes what has come; the last of several cycles counts.
    #[inline(never)]
    pub(super) fn listen(&mut self) {
        let mut effort = STEP_EFFORT;
        for _ in 0..CYCLES {
            let Some(listener) = self.listener.get_mut() else {
                return;
            };
            let Some(cycle) = listener.next(&mut self.queue, &mut effort) else {
                return;
            };
            let flags = cycle.last().map_or(0, |heard| heard.reply.flags);
            self.count = real(f64::from(flags >> 3 & 0xFFF));
            self.latest = self.alignment.sample(cycle, SETTINGS.max_gap_us);
            let silent = self.alignment.take_silence();
            if silent || listener.is_broken() {
                self.voided |= self.zeros.void::<T>(listener.take_breaks(), silent);
            }
            self.surplus = self.surplus.wrapping_add(u32::from(self.fresh));
            self.samples = self.samples.wrapping_add(1);
            // A leg that is nowhere makes no sample of the robot.
            self.fresh = self.zeros.are_known();
            self.unplaced = self.unplaced.wrapping_add(u32::from(!self.fresh));
        }
    }

    /// What is told of the zeros.
    pub(super) fn zeros(&self) -> [Zero; JOINTS_PER_LEG] {
        self.zeros.told()
    }

    /// Takes positions to be angles, or counts whose zeros are still to be said.
    pub(super) fn set_positions(&mut self, positions: Positions) {
        self.zeros.set_positions(positions, &mut self.alignment);
    }

    /// Takes a joint's angle to be what the host says.
    pub(super) fn set_zero(&mut self, which: Leg, asked: &SetZero, now_us: u64) -> Outcome {
        let (listener, alignment) = (&self.listener, &mut self.alignment);
        let set = self.zeros.set(which, asked, listener, alignment, now_us);
        set.map_or_else(|refused| refused, |_| Outcome::Accepted)
    }

    pub(super) fn counters(&self) -> LegCounters {
        let own = LegCounters {
            lost_bytes: self.queue.lost(),
            surplus: self.surplus,
            samples: self.samples,
            unplaced: self.unplaced,
            used: (self.samples.wrapping_sub(self.surplus)).wrapping_sub(self.unplaced),
            ..LegCounters::ZERO
        };
        heard(&self.listener, own)
    }
}
