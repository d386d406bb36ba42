//! Files of one recording, one after the other.

use std::path::{Path, PathBuf};

use super::{Fault, Source, Wanted};
use crate::log::error::{LogError, Problem, Unit};
use crate::log::warning::Warning;

/// Several sources with the same cells, as one.
struct Chain {
    sources: Vec<Box<dyn Source>>,
    now: usize,
    /// Rows of the sources before this one.
    before: u64,
    last: u64,
    /// The cell of the time.
    time: Option<usize>,
    /// Time of the last row, s.
    end: f64,
    /// What is added to the times of the present source, s.
    shift: f64,
}

/// Silence between two files whose clocks both start at zero, s: no window reaches across it.
const BETWEEN: f64 = 1.0;

impl Chain {
    /// Lets time run on where the present file's clock starts again.
    fn run_on(&mut self, wanted: &[Wanted], values: &mut [f64], is_first: bool) {
        let time = wanted.iter().find(|w| Some(w.cell) == self.time);
        let Some(t) = time.and_then(|time| values.get_mut(time.slot)) else {
            return;
        };
        if is_first {
            let shift = self.end + BETWEEN - *t;
            self.shift = if *t < self.end { shift } else { 0.0 };
        }
        *t += self.shift;
        self.end = *t;
    }
}

/// One source of all; `path` is the folder they lie in.
pub(super) fn of(
    path: &Path,
    mut sources: Vec<Box<dyn Source>>,
) -> Result<Box<dyn Source>, LogError> {
    if sources.len() == 1
        && let Some(only) = sources.pop()
    {
        return Ok(only);
    }
    let Some(first) = sources.first() else {
        return Err(LogError::new(path, Problem::Empty));
    };
    if let Some(n) = sources.iter().position(|s| s.names() != first.names()) {
        let part = n + 1;
        let parts = sources.len();
        return Err(LogError::new(
            &PathBuf::from(path),
            Problem::OtherCells { part, parts },
        ));
    }
    // Of one clock, so that time runs on from file to file.
    if let Some(origin) = first.origin() {
        sources
            .iter_mut()
            .for_each(|source| source.count_from(origin));
    }
    let time = sources[0].names().iter().position(|name| name == "t");
    Ok(Box::new(Chain {
        sources,
        now: 0,
        before: 0,
        last: 0,
        time,
        end: f64::NEG_INFINITY,
        shift: 0.0,
    }))
}

impl Source for Chain {
    fn names(&self) -> &[String] {
        self.sources[0].names()
    }

    fn unit(&self) -> Unit {
        self.sources[0].unit()
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        while let Some(source) = self.sources.get_mut(self.now) {
            match source.next(wanted, values) {
                Ok(Some(number)) => {
                    self.run_on(wanted, values, self.last == self.before);
                    self.last = self.before + number;
                    return Ok(Some(self.last));
                }
                Ok(None) => {
                    self.before = self.last;
                    self.now += 1;
                }
                Err(mut fault) => {
                    fault.number = fault.number.map(|number| self.before + number);
                    return Err(fault);
                }
            }
        }
        Ok(None)
    }

    fn progress(&self) -> (u64, u64) {
        let each = self.sources.iter().map(|source| source.progress());
        each.fold((0, 0), |(done, all), (d, a)| (done + d, all + a))
    }

    fn warnings(&self) -> Vec<Warning> {
        self.sources.iter().flat_map(|s| s.warnings()).collect()
    }
}
