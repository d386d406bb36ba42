//! The limbs of a recording side by side, as many at a time as there are processors: each holds its windows in memory.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::recording::Recording;
use crate::model::Limb;

/// What `work` makes of each limb, in the recording's order.
pub(super) fn of_each_limb<'a, T: Send>(
    recording: &'a Recording,
    work: impl Fn(&'a Limb) -> T + Sync,
) -> Vec<T> {
    let limbs = &recording.limbs;
    let next = AtomicUsize::new(0);
    let take = || {
        let n = next.fetch_add(1, Ordering::Relaxed);
        limbs.get(n).map(|(limb, _)| (n, work(limb)))
    };
    let processors = thread::available_parallelism().map_or(1, NonZero::get);
    let mut done: Vec<(usize, T)> = Vec::new();
    thread::scope(|scope| {
        let workers: Vec<_> = (0..processors.min(limbs.len()))
            .map(|_| scope.spawn(|| std::iter::from_fn(take).collect::<Vec<_>>()))
            .collect();
        for worker in workers {
            // A panic goes on.
            let worked = worker.join();
            done.extend(worked.unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
    });
    done.sort_by_key(|(n, _)| *n);
    done.into_iter().map(|(_, of)| of).collect()
}
