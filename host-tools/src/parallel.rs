//! Work on all processors. The pool of threads is reached from here, by functions that are compiled once: each parallel iterator over a closure of
//! its own is some two thousand lines for the compiler.

use std::ops::Range;
use std::sync::Mutex;

use rayon::prelude::*;

/// Does the same work for all items, on as many processors as there are, and returns the results in the order of the items.
pub(crate) fn side_by_side<'a, T: Sync, R: Send>(
    items: &'a [T],
    work: impl Fn(&'a T) -> R + Sync,
) -> Vec<R> {
    by_number(0..items.len(), |n| work(&items[n]))
}

/// The same for numbers.
pub(crate) fn by_number<R: Send>(
    numbers: Range<usize>,
    work: impl Fn(usize) -> R + Sync,
) -> Vec<R> {
    let first = numbers.start;
    let made: Vec<Mutex<Option<R>>> = numbers.clone().map(|_| Mutex::new(None)).collect();
    each(numbers, &|n| {
        let own = work(n);
        // Only this call has the place, so no lock waits.
        if let Ok(mut place) = made[n - first].lock() {
            *place = Some(own);
        }
    });
    let made = made.into_iter();
    made.filter_map(|place| place.into_inner().ok().flatten())
        .collect()
}

/// Hands each part, with its number, to a call of its own: pieces of an array that calls write side by side.
pub(crate) fn each_part<P: Send>(parts: impl Iterator<Item = P>, work: impl Fn(usize, P) + Sync) {
    let parts: Vec<Mutex<Option<P>>> = parts.map(|part| Mutex::new(Some(part))).collect();
    each(0..parts.len(), &|n| {
        let part = parts[n].lock().ok().and_then(|mut part| part.take());
        if let Some(part) = part {
            work(n, part);
        }
    });
}

/// Calls `work` with each number; a panic of one call is passed on when all others have ended.
fn each(numbers: Range<usize>, work: &(dyn Fn(usize) + Sync)) {
    numbers.into_par_iter().for_each(work);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        let items: Vec<usize> = (0..1000).rev().collect();
        assert_eq!(
            side_by_side(&items, |n| 2 * n),
            by_number(0..1000, |n| 1998 - 2 * n)
        );
        assert_eq!(by_number(3..5, |n| n), [3, 4]);
        assert!(by_number(5..5, |n| n).is_empty());
    }

    #[test]
    fn each_part_is_handed_out_once() {
        let mut numbers = [0; 10];
        each_part(numbers.chunks_mut(3), |n, part| {
            part.iter_mut().for_each(|x| *x += n)
        });
        assert_eq!(numbers, [0, 0, 0, 1, 1, 1, 2, 2, 2, 3]);
    }

    #[test]
    #[should_panic(expected = "of a call")]
    fn a_panic_of_a_call_is_passed_on() {
        by_number(0..10, |n| assert!(n < 7, "of a call"));
    }
}
