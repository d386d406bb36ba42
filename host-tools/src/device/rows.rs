//! Rows of a log, whole or still growing, as steps of motor buses.

use proprio_core::go2::{LEGS, Leg};

use super::BusStep;
use super::replay::{ReplayError, bus_step};
use crate::log::Row;

/// What was played of a log's rows to one leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Played {
    /// Samples that were on the leg's bus.
    pub samples: u32,
    /// Rows that repeat the one before and were left out.
    pub repeated: u32,
}

/// Makes steps of rows, one after the other.
#[derive(Debug, Clone)]
pub struct RowSteps {
    legs: Vec<Leg>,
    last_us: Option<u64>,
    /// What each leg's bus carried last.
    last: [Vec<u8>; LEGS],
    played: [Played; LEGS],
}

impl RowSteps {
    /// Of these legs alone.
    pub fn new(legs: &[Leg]) -> Self {
        Self {
            legs: legs.to_vec(),
            last_us: None,
            last: Default::default(),
            played: Default::default(),
        }
    }

    /// What was played to each leg so far.
    pub fn played(&self) -> &[Played; LEGS] {
        &self.played
    }

    /// A row's step; none of a row without a time of its own, which every estimator leaves out.
    ///
    /// # Errors
    /// [`ReplayError::Encode`].
    pub fn step(&mut self, row: &Row) -> Result<Option<BusStep>, ReplayError> {
        if self.last_us.is_some_and(|last| row.time_us <= last) {
            return Ok(None);
        }
        self.last_us = Some(row.time_us);
        let instant = Leg::ALL.map(|leg| self.legs.contains(&leg).then(|| row.sample(leg)));
        let mut step = bus_step(row.time_us, &instant)?;
        self.leave_out_repeats(&mut step);
        Ok(Some(step))
    }

    /// A host reads the latest message twice; a bus measures anew whenever it is asked. So what a leg said already, to the last
    /// count, was not on its bus a second time.
    fn leave_out_repeats(&mut self, step: &mut BusStep) {
        let legs = step
            .buses
            .iter_mut()
            .zip(&mut self.last)
            .zip(&mut self.played);
        for ((bytes, last), played) in legs {
            if bytes.is_empty() {
                continue;
            }
            if bytes == last {
                bytes.clear();
                played.repeated += 1;
            } else {
                last.clone_from(bytes);
                played.samples += 1;
            }
        }
    }
}
