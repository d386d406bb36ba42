//! What a step says: at most one message, the most urgent that is due.

use super::diagnosis::Verdict;
use super::leg::{LegLine, SETTINGS};
use super::{App, HELLO_US, Memory, REPORT_US};
use crate::Real;
use crate::estimator::{Active, COLUMNS, DEFAULT_ACTIVE, LEG_INERTIAL, MAX_EFFECTS};
use crate::go2::{JOINTS_PER_LEG, LEGS, Leg};
use crate::wire::{
    self, Capacities, Counters, DeviceMessage, EffectAt, Estimate, HEARS, Hello, LegCounters, SAYS,
    SCHEMA, Solution,
};
use heapless::{String, Vec};

impl<T: Real> App<T> {
    /// The most urgent message that is due.
    pub(super) fn message(&mut self, memory: &mut Memory<T>, now_us: u64) -> Option<DeviceMessage> {
        if now_us >= self.hello_at {
            self.hello_at = now_us.saturating_add(HELLO_US);
            return Some(DeviceMessage::Hello(self.hello()));
        }
        if let Some(answer) = self.requests.take() {
            return Some(DeviceMessage::Answer(answer));
        }
        let mut lines = self.legs.iter_mut().enumerate();
        if let Some(change) = lines.find_map(|(leg, line)| line.take_change(leg)) {
            return Some(DeviceMessage::Change(change));
        }
        if let Some((which, time_us, solution)) = self.solved.take()
            && self.identifies(which.index())
        {
            let estimate = self.estimate(which, time_us, solution);
            return Some(DeviceMessage::Estimate(estimate));
        }
        if now_us >= self.counters_at {
            self.counters_at = now_us.saturating_add(REPORT_US);
            return Some(DeviceMessage::Counters(self.counters(memory, now_us)));
        }
        if let Some(leg) = memory.1.leg_to_copy()
            && let (Some(line), Some(data)) = (self.legs.get_mut(leg), memory.0.get_mut(leg))
        {
            // A copy has all windows that have closed, which are folded in in steps of their own.
            if line.is_forgetting() || line.fold_on(data) {
                return None;
            }
        }
        if let Some(part) = memory.1.take(&memory.0) {
            return Some(DeviceMessage::FactorPart(part));
        }
        let verdict = self.diagnosis.take()?;
        // It was of a leg that is on trial by now.
        let holds = self.identifies(verdict.leg);
        holds.then(|| DeviceMessage::Diagnosis(told(&verdict)))
    }

    fn hello(&self) -> Hello {
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
                legs: LEGS as u8,
                joints_per_leg: JOINTS_PER_LEG as u8,
                inertial_parameters: LEG_INERTIAL as u8,
                effect_parameters: DEFAULT_ACTIVE.effects().count() as u8,
                window_us: SETTINGS.window_us as u32,
                scalar_bits: (8 * size_of::<T>()) as u8,
            },
            load_unit: text(identity.load_unit),
            listens_to: self.listens_to,
            carried: self.was_carried,
            zeros: self.legs.each_ref().map(LegLine::zeros),
            wiring: self.legs.each_ref().map(LegLine::wiring),
            kept: self.snapshots.status(),
            effects: fitting(COLUMNS.iter().map(|effect| text(effect.name()))),
            setup: self.snapshots.setup(identity.start.setup),
            setup_in_use: self.snapshots.setup(identity.start.setup) == identity.start.setup,
        }
    }

    fn estimate(&self, which: Leg, time_us: u64, solution: Solution) -> Estimate {
        const {
            assert!(LEG_INERTIAL + MAX_EFFECTS <= wire::MAX_PARAMETERS);
            assert!(COLUMNS.len() <= wire::MAX_EFFECTS);
        }
        let solver = &self.solver;
        let active: &Active = self.gather.active();
        let values = solver.values().iter().copied().map(single);
        let neutral = active.effects().map(|(_, n)| neutral(n));
        let neutral = core::iter::repeat_n(0.0, LEG_INERTIAL).chain(neutral);
        Estimate {
            leg: which.index() as u8,
            time_us,
            windows: single(solver.windows()) as u32,
            effects: active.0,
            solution,
            values: fitting(values.zip(neutral).map(|(v, n)| v + n)),
            std: fitting(solver.std().iter().copied().map(single)),
            noise: solver.noise().map(single),
        }
    }

    /// Everything counted up to `now_us`.
    pub fn counters(&self, memory: &Memory<T>, now_us: u64) -> Counters {
        let [snapshots, snapshots_failed] = self.snapshots.counts();
        Counters {
            time_us: now_us,
            legs: core::array::from_fn(|leg| match (self.legs.get(leg), memory.0.get(leg)) {
                (Some(line), Some(data)) => line.counters(data),
                _ => LegCounters::ZERO,
            }),
            host_frames_bad: self.losses.host_frames_bad,
            host_frames_missed: self.losses.host_frames_missed,
            frames_dropped: self.losses.frames_dropped,
            buses: self.losses.buses,
            host_line: self.losses.host_line,
            imu: self.losses.imu,
            snapshots,
            snapshots_failed,
            load: self.load,
        }
    }
}

/// The value of effect n's parameter at which it does nothing: columns are of what goes beyond it.
pub(super) fn neutral(n: usize) -> f32 {
    let parameter = COLUMNS.get(n).map(|effect| effect.description().parameters);
    parameter
        .and_then(<[_]>::first)
        .map_or(0.0, |p| p.neutral as f32)
}

/// A verdict as the wire has it.
fn told<T: Real>(verdict: &Verdict<T>) -> wire::Diagnosis {
    wire::Diagnosis {
        at: EffectAt {
            leg: verdict.leg as u8,
            joint: verdict.joint as u8,
            effect: verdict.effect as u8,
        },
        active: verdict.active,
        windows: single(verdict.windows) as u32,
        gain: single(verdict.held_out.gain()),
        gain_error: single(verdict.held_out.gain_error()),
        value: single(verdict.finding.value()) + neutral(verdict.effect),
        std: single(verdict.finding.std()),
    }
}

/// As `f32`, which the wire carries.
pub(super) fn single<T: Real>(value: T) -> f32 {
    nalgebra::try_convert(value).unwrap_or(f64::NAN) as f32
}

/// As many as fit. `collect` would panic where there is no room.
fn fitting<X, const N: usize>(items: impl Iterator<Item = X>) -> Vec<X, N> {
    let mut vec = Vec::new();
    for item in items {
        let _ = vec.push(item);
    }
    vec
}

/// As much of `source` as fits.
pub(super) fn text<const N: usize>(source: &str) -> String<N> {
    let mut text = String::new();
    for character in source.chars().take_while(char::is_ascii) {
        // What finds no room is left out.
        let _ = text.push(character);
    }
    text
}
