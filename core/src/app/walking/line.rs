//! One leg's bus of a robot that walks: of what it brought, the last polling cycle.

use crate::Real;
use crate::app::alignment::Alignment;
use crate::app::counts::heard;
use crate::app::leg::{SETTINGS, STEP_EFFORT};
use crate::bus::{Listener, Queue};
use crate::go2::{Go2, JOINTS_PER_LEG};
use crate::scalar::real;
use crate::slot::Slot;
use crate::window::Sample;
use crate::wire::LegCounters;

/// Polling cycles that are taken off one bus in a step at most.
const CYCLES: usize = 3;

/// One leg's bus.
pub(super) struct Line<T> {
    pub(super) queue: Queue,
    listener: Slot<Listener>,
    alignment: Alignment<T, Go2, JOINTS_PER_LEG>,
    /// The last cycle, the foot's count in it, and whether the robot's sample still waits for it.
    pub(super) latest: Sample<T, JOINTS_PER_LEG>,
    pub(super) count: T,
    pub(super) fresh: bool,
    samples: u32,
    surplus: u32,
}

impl<T: Real> Line<T> {
    pub(super) const fn new() -> Self {
        Self {
            queue: Queue::new(),
            listener: Slot::Empty,
            alignment: Alignment::new(),
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
        }
    }

    /// Begins anew. Not inlined: what a listener takes of the stack is given back.
    #[inline(never)]
    pub(super) fn begin(&mut self) {
        self.queue.clear();
        self.listener = Slot::Full(Listener::new());
        self.alignment = Alignment::new();
        (self.fresh, self.samples, self.surplus) = (false, 0, 0);
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
            self.surplus = self.surplus.wrapping_add(u32::from(self.fresh));
            self.samples = self.samples.wrapping_add(1);
            self.fresh = true;
        }
    }

    pub(super) fn counters(&self) -> LegCounters {
        let own = LegCounters {
            lost_bytes: self.queue.lost(),
            surplus: self.surplus,
            samples: self.samples,
            used: self.samples.wrapping_sub(self.surplus),
            ..LegCounters::ZERO
        };
        heard(&self.listener, own)
    }
}
