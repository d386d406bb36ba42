//! The study of designed motions: what they tell beside other motions, of which two look-alikes they decide, and how much
//! feedback the identified model leaves. `cargo run --release -p proprio-studies --bin excitation_study` runs it.

pub mod arms;
pub mod condition;
pub mod errors;
pub mod feedback;
pub mod robots;
pub mod separation;
pub mod table;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use proprio_host::excite::Supervisor;
use proprio_tests::cost::processor_time;

/// Whatever goes wrong.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Time since a moment.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    begun: Instant,
    processor: Option<f64>,
}

impl Stopwatch {
    /// From now on.
    pub fn start() -> Self {
        Self {
            begun: Instant::now(),
            processor: processor_time(),
        }
    }

    /// Time on the wall, s.
    pub fn wall(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Processor time of all threads, s; where the system does not say, not a number.
    pub fn processor(&self) -> f64 {
        match (self.processor, processor_time()) {
            (Some(begun), Some(now)) => now - begun,
            _ => f64::NAN,
        }
    }
}

/// A search that nobody watches, ended after a time of the processor if one is given; it keeps when each motion was found.
#[derive(Debug)]
pub struct Watched {
    clock: Stopwatch,
    most: f64,
    costs: Mutex<Vec<(f64, f64)>>,
}

impl Watched {
    /// Ends after `most` seconds of processor time.
    pub fn for_at_most(most: f64) -> Self {
        Self {
            clock: Stopwatch::start(),
            most,
            costs: Mutex::new(Vec::new()),
        }
    }

    /// To the end.
    pub fn to_the_end() -> Self {
        Self::for_at_most(f64::INFINITY)
    }

    /// Processor time (s) and the best cost then, start by start.
    pub fn costs(&self) -> Vec<(f64, f64)> {
        self.costs
            .lock()
            .map_or_else(|_| Vec::new(), |all| all.clone())
    }
}

impl Supervisor for Watched {
    fn stop(&self) -> bool {
        self.clock.processor() >= self.most
    }

    fn progress(&self, _: usize, _: usize, best: Option<f64>) {
        if let (Some(best), Ok(mut costs)) = (best, self.costs.lock()) {
            costs.push((self.clock.processor(), best));
        }
    }
}

/// `work` for each of 0 … `count` on two threads, with how many are done on stderr; the results in their order.
///
/// # Errors
/// The first failure, in the order of the numbers.
pub fn each<T: Send>(
    what: &str,
    count: usize,
    work: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let n = next.fetch_add(1, Ordering::Relaxed);
                    if n >= count {
                        return;
                    }
                    let result = work(n);
                    if let Ok(mut results) = results.lock() {
                        results.push((n, result));
                    }
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    if done.is_multiple_of(count.div_ceil(20)) || done == count {
                        eprintln!("{what}: {done} of {count}");
                    }
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_default();
    results.sort_by_key(|(n, _)| *n);
    results.into_iter().map(|(_, result)| result).collect()
}
