//! A value that is made when it is first asked for, where many threads may ask at once.

use std::sync::OnceLock;

/// What a cell holds, or else what `make` makes; of several threads that make it at once the first one's is kept.
///
/// The cell is not locked meanwhile, as [`OnceLock::get_or_init`] has it: while a thread of the pool waits for parts of its work that others
/// have taken, it takes up other work, and if that asks for the same value it would wait for itself.
pub(crate) fn made_once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    match cell.get() {
        Some(known) => known,
        None => {
            let made = make();
            cell.get_or_init(|| made)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    /// Many ask at once for what is made side by side: with [`OnceLock::get_or_init`] this waits for ever.
    #[test]
    fn what_is_made_side_by_side_may_be_asked_for_side_by_side() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build();
        let all: u64 = pool.unwrap().install(|| {
            let ask = |_| {
                let cell = OnceLock::new();
                let sum = |_| {
                    let parts = (0..64_u64).into_par_iter();
                    *made_once(&cell, || parts.map(std::hint::black_box).sum::<u64>())
                };
                (0..64).into_par_iter().map(sum).sum::<u64>()
            };
            (0..200).into_par_iter().map(ask).sum()
        });
        assert_eq!(all, 200 * 64 * 2016);
    }
}
