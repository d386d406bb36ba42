//! A copy of one triangle, that its parts are told from.

use heapless::Vec;

use super::leg::LegData;
use crate::Real;
use crate::estimator::LONGEST_TRIANGLE;
use crate::wire::{FactorPart, MAX_PART, ReadFactor};

/// The copy, and which part of it the host waits for. All zeros at first.
pub(super) struct FactorCopy<T> {
    /// What the copy is of; `first` means nothing.
    of: Option<ReadFactor>,
    asked: Option<ReadFactor>,
    windows: T,
    length: usize,
    numbers: [T; LONGEST_TRIANGLE],
}

impl<T: Real> FactorCopy<T> {
    pub(super) const fn new() -> Self {
        Self {
            of: None,
            asked: None,
            windows: T::ZERO,
            length: 0,
            numbers: [T::ZERO; LONGEST_TRIANGLE],
        }
    }

    /// Takes note of what the host asks for; of several the last counts.
    pub(super) fn ask(&mut self, read: ReadFactor) {
        self.asked = Some(read);
    }

    /// The leg that is to be copied before a part can be told.
    pub(super) fn leg_to_copy(&self) -> Option<usize> {
        let read = self.asked.filter(|read| read.first == 0)?;
        let held = self.of == Some(read);
        (!held).then_some(usize::from(read.leg))
    }

    /// The part that the host waits for. Where the copy has to be made first, the part comes with the next call.
    pub(super) fn take(&mut self, legs: &[LegData<T>]) -> Option<FactorPart> {
        let read = self.asked?;
        let held = self.of == Some(ReadFactor { first: 0, ..read });
        if !held && read.first == 0 {
            self.copy(read, legs.get(usize::from(read.leg)));
            return None;
        }
        self.asked = None;
        let length = if held { self.length } else { 0 };
        let rest = self.numbers.get(..length)?.get(usize::from(read.first)..);
        let part = rest.unwrap_or(&[]).iter().take(MAX_PART);
        let mut numbers = Vec::<f64, MAX_PART>::new();
        for number in part {
            // No more than fit.
            let _ = numbers.push(double(*number));
        }
        Some(FactorPart {
            read,
            windows: if held { double(self.windows) } else { 0.0 },
            length: length as u16,
            numbers,
        })
    }

    fn copy(&mut self, read: ReadFactor, leg: Option<&LegData<T>>) {
        self.of = Some(read);
        (self.windows, self.length) = (T::zero(), 0);
        let Some(leg) = leg else { return };
        let factor = leg.factor(usize::from(read.fold), usize::from(read.joint));
        // A joint that there is not has a factor of no parameters, which is one number: no triangle.
        if factor.columns() == 0 {
            return;
        }
        self.windows = factor.rows();
        self.length = factor.packed().len().min(LONGEST_TRIANGLE);
        for (to, from) in self.numbers.iter_mut().zip(factor.packed()) {
            *to = *from;
        }
    }
}

/// As `f64`, which the wire carries: all that either scalar holds.
fn double<T: Real>(value: T) -> f64 {
    nalgebra::try_convert(value).unwrap_or(f64::NAN)
}
