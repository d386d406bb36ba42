//! The labelled battery: logs whose truth is known, through `diagnose`, and how often it names what was hidden.
//!
//! 1. [`case`]: what is hidden where, in which size, and what the model knows of it.
//! 2. [`bound`]: whether the log can tell it at all: the Cramér-Rao bound, by inverse dynamics that share nothing with the
//!    criticism's columns.
//! 3. [`outcome`]: one case simulated, diagnosed and judged.
//! 4. [`record`]: every case as a row of `tests/battery/cases.csv`, so that a change of behaviour shows.
//! 5. [`logged`]: logs in files with their truth, through the command line.
//!
//! `studies/` runs all cases and makes the tables of them.

pub mod bound;
pub mod case;
pub mod logged;
pub mod outcome;
pub mod record;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use case::Case;
use outcome::{Bench, Outcome};

/// Cases run at once.
const THREADS: usize = 2;

/// `tests/battery`.
pub fn folder() -> PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("battery")
}

/// Runs cases, in their order. `progress` hears how many are done.
pub fn run(cases: &[Case], progress: impl Fn(usize) + Sync) -> Vec<Outcome> {
    let bench = Bench::default();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let outcomes = Mutex::new(vec![None; cases.len()]);
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while let Some((n, case)) = {
                    let n = next.fetch_add(1, Ordering::Relaxed);
                    cases.get(n).map(|case| (n, case))
                } {
                    let outcome = bench.run(case);
                    outcomes.lock().expect("no thread panics")[n] = Some(outcome);
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                }
            });
        }
    });
    let outcomes = outcomes.into_inner().expect("no thread panics");
    outcomes.into_iter().flatten().collect()
}
