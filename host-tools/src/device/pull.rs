//! Whole factors read from a device, part by part.

use std::time::{Duration, Instant};

use proprio_core::estimator::FOLDS;
use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use proprio_core::wire::{DeviceMessage, FactorPart, HostMessage, ReadFactor};

use super::requests::random;
use super::{BusStep, Device, DeviceError};
use crate::factors::{Factors, RFactor};

/// How long a part may take before it is asked for again.
const PATIENCE: Duration = Duration::from_millis(500);

/// Reads the factors of some legs: says what to send, takes what comes.
#[derive(Debug)]
pub struct Pull {
    factors: Factors,
    /// Triangles still to be read, the present one last.
    places: Vec<(Leg, usize, usize)>,
    copy: u32,
    numbers: Vec<f64>,
    asked: Option<Instant>,
}

impl Pull {
    /// Nothing read yet of `legs`, of a device that said `hello`.
    pub fn new(legs: &[Leg], factors: Factors) -> Self {
        let triangles = (0..FOLDS).flat_map(|fold| (0..JOINTS_PER_LEG).map(move |j| (fold, j)));
        let of_leg = |&leg| {
            triangles
                .clone()
                .map(move |(fold, joint)| (leg, fold, joint))
        };
        let mut places: Vec<_> = legs.iter().flat_map(of_leg).collect();
        places.reverse();
        Self {
            factors,
            places,
            copy: random(),
            numbers: Vec::new(),
            asked: None,
        }
    }

    /// What to send at `now`: the next part, or the last one again; `None` while its answer may still come, and at the end.
    pub fn ask(&mut self, now: Instant) -> Option<HostMessage> {
        let read = self.wanted()?;
        if self
            .asked
            .is_some_and(|asked| now.duration_since(asked) < PATIENCE)
        {
            return None;
        }
        self.asked = Some(now);
        Some(HostMessage::ReadFactor(read))
    }

    fn wanted(&self) -> Option<ReadFactor> {
        let &(leg, fold, joint) = self.places.last()?;
        Some(ReadFactor {
            copy: self.copy,
            leg: leg.index() as u8,
            fold: fold as u8,
            joint: joint as u8,
            first: self.numbers.len() as u16,
        })
    }

    /// Takes a part; those that were not asked for are left.
    ///
    /// # Errors
    /// [`DeviceError::NoFactor`] if the device has no such factor, or one of another shape.
    pub fn hear(&mut self, part: &FactorPart) -> Result<(), DeviceError> {
        if Some(part.read) != self.wanted() {
            return Ok(());
        }
        self.asked = None;
        if part.length == 0 && part.read.first > 0 {
            // Another host has made the device copy something else: once more from the beginning.
            self.copy = self.copy.wrapping_add(1);
            self.numbers.clear();
            return Ok(());
        }
        self.numbers.extend(&part.numbers);
        if part.numbers.is_empty() || self.numbers.len() > usize::from(part.length) {
            return Err(DeviceError::NoFactor);
        }
        if self.numbers.len() == usize::from(part.length) {
            let triangle = RFactor {
                windows: part.windows,
                numbers: std::mem::take(&mut self.numbers),
            };
            self.copy = self.copy.wrapping_add(1);
            if let Some((leg, fold, joint)) = self.places.pop() {
                let added = self.factors.add(leg, fold, joint, triangle);
                added.map_err(|_| DeviceError::NoFactor)?;
            }
        }
        Ok(())
    }

    /// The factors, when all have come.
    pub fn finished(&self) -> Option<&Factors> {
        self.places.is_empty().then_some(&self.factors)
    }
}

/// Time between the silent steps that a device is given while its factors are read, µs.
const STEP_US: u64 = 2_000;

/// Reads the factors of `legs` from a device that has heard its last sample before `time_us`. What it says beside goes to `told`.
///
/// # Errors
/// [`DeviceError`].
pub fn pull(
    device: &mut dyn Device,
    legs: &[Leg],
    mut time_us: u64,
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<Factors, DeviceError> {
    let mut pull = Pull::new(legs, Factors::of_device(device.hello()));
    let started = Instant::now();
    while pull.finished().is_none() {
        if let Some(message) = pull.ask(Instant::now()) {
            device.command(&message)?;
        }
        time_us += STEP_US;
        let step = BusStep {
            time_us,
            ..BusStep::default()
        };
        let mut failed = Ok(());
        let mut hear = |message| match &message {
            DeviceMessage::FactorPart(part) if failed.is_ok() => failed = pull.hear(part),
            _ => told(message),
        };
        device.play(&step, &mut hear)?;
        failed?;
        if started.elapsed() > super::link::PATIENCE {
            return Err(DeviceError::Silent(super::link::PATIENCE.as_secs()));
        }
    }
    Ok(pull.factors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{Desktop, Robot};
    use proprio_simulator::hidden::typical;

    /// Two hosts that read at the same time take each other's copy away; both get whole factors, and lost answers are asked again.
    #[test]
    fn two_hosts_and_lost_answers_only_cost_time() {
        let legs = &Leg::ALL[..1];
        let mut device = Desktop::<f64>::new();
        let robot = Robot::new(legs, typical(legs), 1);
        let mut time_us = 0;
        for step in robot.steps().take(2_000) {
            let step = step.unwrap();
            time_us = step.time_us;
            device.play(&step, &mut |_| ()).unwrap();
        }
        let new = || Pull::new(legs, Factors::of_device(device.hello()));
        let (mut one, mut other) = (new(), new());
        let (mut now, mut heard) = (Instant::now(), 0);
        for n in 0..20_000 {
            if one.finished().is_some() && other.finished().is_some() {
                break;
            }
            now += Duration::from_millis(2);
            // The second host comes in the middle and is slower.
            let asking = match n > 40 && n % 50 == 0 {
                true => &mut other,
                false => &mut one,
            };
            if let Some(message) = asking.ask(now) {
                device.command(&message).unwrap();
            }
            time_us += 2_000;
            let silent = BusStep {
                time_us,
                ..BusStep::default()
            };
            let mut parts = Vec::new();
            let mut hear = |message| {
                if let DeviceMessage::FactorPart(part) = message {
                    parts.push(part);
                }
            };
            device.play(&silent, &mut hear).unwrap();
            for part in parts {
                heard += 1;
                if heard % 5 == 0 {
                    continue;
                }
                one.hear(&part).unwrap();
                other.hear(&part).unwrap();
            }
        }
        assert!(one.finished().is_some() && one.finished() == other.finished());
    }
}
