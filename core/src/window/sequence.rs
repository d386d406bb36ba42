//! Samples in the order of time: which of them are used, and which follow one another.

use super::{Implausible, Plausible, Push, Sample, Settings, microseconds};
use crate::{Real, scalar::real};

/// What is known of the samples so far.
#[derive(Clone, Debug)]
pub(crate) struct Sequence<T, const B: usize> {
    plausible: [Plausible<T>; B],
    settings: Settings,
    /// When the last sample that was used came, if any since the last [`clear`](Self::clear).
    last_us: Option<u64>,
    /// Its readings, kept where they are asked for: positions, velocities, torques.
    last: [[T; B]; 3],
    /// When the sample that was skipped last came, if it was late and none was used since.
    late_us: Option<u64>,
    /// When the open window began.
    start_us: u64,
}

/// How a sample that is used follows the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Link<T> {
    /// There is none before, or the time since is not bridged: a window begins.
    Broken(Push),
    /// So long after it (s, halved), and whether it closes the window.
    Bridged { half_step: T, closes: bool },
}

impl<T: Real, const B: usize> Sequence<T, B> {
    pub(crate) fn new(plausible: [Plausible<T>; B], settings: Settings) -> Self {
        Self {
            plausible,
            settings,
            last_us: None,
            last: [[T::ZERO; B]; 3],
            late_us: None,
            start_us: 0,
        }
    }

    /// Forgets the open window and the last sample.
    pub(crate) fn clear(&mut self) {
        self.last_us = None;
        self.late_us = None;
    }

    /// Takes the next sample; what becomes of it where it is not used.
    #[inline(always)]
    pub(crate) fn admit(&mut self, sample: &Sample<T, B>) -> Result<Link<T>, Push> {
        if let Some(reason) = implausible(&self.plausible, sample) {
            return Err(Push::Rejected(reason));
        }
        let step_us = match self.last_us {
            None => None,
            Some(last_us) if sample.time_us <= last_us => {
                let before = self.late_us.replace(sample.time_us);
                if before.is_none_or(|before| sample.time_us <= before) {
                    return Err(Push::Late);
                }
                Some(u64::MAX)
            }
            Some(_) if self.settings.skip_repeated && self.last == readings(sample) => {
                return Err(Push::Repeated);
            }
            Some(last_us) => Some(sample.time_us - last_us),
        };
        self.late_us = None;
        self.last_us = Some(sample.time_us);
        if self.settings.skip_repeated {
            self.last = readings(sample);
        }
        let link = match step_us {
            None => Link::Broken(Push::Used),
            Some(step_us) if step_us > self.settings.max_gap_us => Link::Broken(Push::Gap),
            // A sample's share of the trapezia on both of its sides: half the time from the one before to the next.
            Some(step_us) => Link::Bridged {
                half_step: microseconds::<T>(step_us) * real(0.5),
                closes: sample.time_us - self.start_us >= self.settings.window_us,
            },
        };
        let goes_on = matches!(link, Link::Bridged { closes: false, .. });
        if !goes_on {
            self.start_us = sample.time_us;
        }
        Ok(link)
    }
}

/// Why a sample cannot be true, if it cannot.
#[inline(always)]
pub(crate) fn implausible<T: Real, const B: usize>(
    plausible: &[Plausible<T>; B],
    sample: &Sample<T, B>,
) -> Option<Implausible> {
    let (mut within, mut probe) = (true, T::zero());
    for (b, limit) in plausible.iter().enumerate() {
        let (q, dq, tau) = (sample.q[b], sample.dq[b], sample.tau[b]);
        // x·0 is NaN for what is not finite; limits may be infinite.
        probe += q * T::zero() + dq * T::zero() + tau * T::zero();
        within &= (q >= limit.position[0]) & (q <= limit.position[1]);
        within &= (dq.abs() <= limit.speed) & (tau.abs() <= limit.torque);
    }
    if within && probe == T::zero() {
        None
    } else {
        Some(reason(plausible, sample))
    }
}

/// Why an implausible sample cannot be true.
#[cold]
fn reason<T: Real, const B: usize>(
    plausible: &[Plausible<T>; B],
    sample: &Sample<T, B>,
) -> Implausible {
    let finite = |x: &[T; B]| x.iter().all(|x| x.is_finite());
    if !(finite(&sample.q) && finite(&sample.dq) && finite(&sample.tau)) {
        return Implausible::NotFinite;
    }
    for (b, limit) in plausible.iter().enumerate() {
        if sample.q[b] < limit.position[0] || sample.q[b] > limit.position[1] {
            return Implausible::Position;
        }
        if sample.dq[b].abs() > limit.speed {
            return Implausible::Speed;
        }
        if sample.tau[b].abs() > limit.torque {
            return Implausible::Torque;
        }
    }
    Implausible::Torque
}

/// What was measured.
fn readings<T: Real, const B: usize>(sample: &Sample<T, B>) -> [[T; B]; 3] {
    [sample.q, sample.dq, sample.tau]
}
