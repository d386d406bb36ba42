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
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    /// A thread that takes up other work while it makes a value is asked for that value: with [`OnceLock::get_or_init`] it waits for ever.
    #[test]
    fn what_is_being_made_may_be_asked_for_by_its_maker() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let (cell, makings) = (OnceLock::new(), AtomicU32::new(0));
        let make = || {
            rayon::yield_local();
            makings.fetch_add(1, Ordering::Relaxed)
        };
        let ask = || *made_once(&cell, make);
        let told = pool.unwrap().install(|| rayon::join(ask, ask));
        assert_eq!(told, (0, 0));
        assert_eq!(makings.into_inner(), 2);
    }
}
