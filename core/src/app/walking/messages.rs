//! What a step of a robot that walks says: at most one message.

use super::{Line, WalkingApp, WalkingMemory};
use crate::Real;
use crate::app::messages::{single, text};
use crate::app::{ALL_LEGS, HELLO_US, REPORT_US};
use crate::go2::{JOINTS_PER_LEG, LEGS};
use crate::walk::{EFFECTS, OWN, WINDOW_US};
use crate::wire::{
    Capacities, Counters, DeviceMessage, HEARS, Hello, Kept, SAYS, SCHEMA, Walk, WalkCounts, Wiring,
};
use heapless::Vec;

impl<T: Real> WalkingApp<T> {
    pub(super) fn message(
        &mut self,
        memory: &WalkingMemory<T>,
        now_us: u64,
    ) -> Option<DeviceMessage> {
        if now_us >= self.hello_at {
            self.hello_at = now_us.saturating_add(HELLO_US);
            return Some(DeviceMessage::Hello(self.hello(memory)));
        }
        if let Some(answer) = self.requests.take() {
            return Some(DeviceMessage::Answer(answer));
        }
        if core::mem::replace(&mut self.solved, false) {
            return Some(DeviceMessage::Walk(self.told(memory)));
        }
        if now_us >= self.counters_at {
            self.counters_at = now_us.saturating_add(REPORT_US);
            return Some(DeviceMessage::Counters(self.counters(memory, now_us)));
        }
        None
    }

    /// The last solution as the wire has it.
    fn told(&self, memory: &WalkingMemory<T>) -> Walk {
        let estimate = self.walker.estimate(&memory.walk);
        let parameters = self.walker.parameters();
        let effect = |joint: usize, e: usize| {
            let place = OWN * (joint / JOINTS_PER_LEG + 1)
                - EFFECTS * (JOINTS_PER_LEG - joint % JOINTS_PER_LEG);
            parameters.get(place + e).map_or(f32::NAN, |x| single(*x))
        };
        Walk {
            time_us: self.solving_us,
            equations: estimate.equations,
            noise: single(estimate.noise),
            mass: estimate.mass.map(single),
            trunk: estimate.trunk.map(single),
            acc_bias: estimate.acc_bias.map(single),
            effects: core::array::from_fn(|joint| core::array::from_fn(|e| effect(joint, e))),
            counts: WalkCounts {
                without_imu: self.without_imu,
                ..*self.walker.counts()
            },
        }
    }

    fn counters(&self, memory: &WalkingMemory<T>, now_us: u64) -> Counters {
        Counters {
            time_us: now_us,
            legs: memory.lines.each_ref().map(Line::counters),
            host_frames_bad: self.losses.host_frames_bad,
            host_frames_missed: self.losses.host_frames_missed,
            frames_dropped: self.losses.frames_dropped,
            buses: self.losses.buses,
            host_line: self.losses.host_line,
            imu: self.losses.imu,
            load: self.load,
            ..Counters::default()
        }
    }

    /// A device without legs that hang: no parameters of theirs, no effects to be asked for.
    fn hello(&self, memory: &WalkingMemory<T>) -> Hello {
        let identity = self.identity();
        Hello {
            schema: SCHEMA,
            firmware: text(identity.firmware),
            says: Vec::from_array(SAYS),
            hears: Vec::from_array(HEARS),
            git: text(identity.start.git),
            board: text(identity.board),
            reset: identity.start.reset,
            brown_out_level: identity.start.brown_out_level,
            clock: identity.start.clock,
            crash: text(identity.start.crash),
            capacities: Capacities {
                legs: 0,
                joints_per_leg: JOINTS_PER_LEG as u8,
                inertial_parameters: 0,
                effect_parameters: 0,
                window_us: WINDOW_US as u32,
                scalar_bits: (8 * size_of::<T>()) as u8,
            },
            load_unit: text(identity.load_unit),
            listens_to: ALL_LEGS,
            carried: false,
            zeros: memory.lines.each_ref().map(Line::zeros),
            // Its legs' torques are not those of legs that hang.
            wiring: [Wiring::Untested; LEGS],
            kept: Kept::NoStorage,
            effects: Vec::new(),
            setup: self.setup.kept(identity.start.setup),
            setup_in_use: self.setup.kept(identity.start.setup) == identity.start.setup,
        }
    }
}
