//! Fewer points without losing what a reader looks for.

/// Indices of at most `limit` of the `values`, in order: the least and the greatest of each of equally long stretches, so
/// that every peak stays visible, and one that is not finite, so that a hole stays a hole. All indices if they are few
/// enough.
pub(super) fn extremes(values: &[f64], limit: usize) -> Vec<usize> {
    if values.len() <= limit {
        return (0..values.len()).collect();
    }
    let stretches = (limit / 3).max(1);
    let mut kept = Vec::with_capacity(limit);
    for stretch in 0..stretches {
        let start = stretch * values.len() / stretches;
        let end = (stretch + 1) * values.len() / stretches;
        let finite = (start..end).filter(|&k| values[k].is_finite());
        let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let least = finite.clone().min_by(by_value);
        let greatest = finite.max_by(by_value);
        let hole = (start..end).find(|&k| !values[k].is_finite());
        let mut found: Vec<usize> = [least, greatest, hole].into_iter().flatten().collect();
        found.sort_unstable();
        found.dedup();
        kept.extend(found);
    }
    kept
}

/// Indices of at most `limit` out of `count`, evenly spread.
pub(super) fn spread(count: usize, limit: usize) -> impl Iterator<Item = usize> {
    let shown = count.min(limit);
    (0..shown).map(move |k| k * count / shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn few_points_hold_every_peak(
            values in proptest::collection::vec(-1e3..1e3, 1..2000),
            limit in 3_usize..300,
        ) {
            let kept = extremes(&values, limit);
            prop_assert!(kept.len() <= limit);
            prop_assert!(kept.is_sorted_by(|a, b| a < b));
            let extreme = |pick: fn(f64, f64) -> f64, of: &mut dyn Iterator<Item = f64>| {
                of.reduce(pick).unwrap()
            };
            for pick in [f64::min, f64::max] {
                prop_assert_eq!(
                    extreme(pick, &mut kept.iter().map(|&k| values[k])),
                    extreme(pick, &mut values.iter().copied())
                );
            }
        }

        #[test]
        fn spread_points_are_distinct(count in 0_usize..1000, limit in 1_usize..100) {
            let kept: Vec<usize> = spread(count, limit).collect();
            prop_assert_eq!(kept.len(), count.min(limit));
            prop_assert!(kept.is_sorted_by(|a, b| a < b) && kept.iter().all(|&k| k < count));
        }
    }

    #[test]
    fn a_hole_stays() {
        let mut values = vec![1.0; 1000];
        values[500] = f64::NAN;
        let kept = extremes(&values, 30);
        assert!(kept.contains(&500) && kept.len() <= 30);
    }
}
