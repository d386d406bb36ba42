//! Order statistics: quantiles, and the scale that outliers do not move (Huber & Ronchetti 2009, §5.1); gains in their own errors.

/// The median of |x| where x is normal, in standard deviations: Φ⁻¹(3/4).
pub(crate) const MEDIAN_OF_NORMAL: f64 = 0.6745;
/// The size that a quarter of |x| is below where x is normal, in standard deviations: Φ⁻¹(5/8).
pub(crate) const QUARTER_OF_NORMAL: f64 = 0.3186;

/// The number that a `share` (0 to 1) of the numbers is below; none of none.
pub(crate) fn quantile(x: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut x: Vec<f64> = x.into_iter().collect();
    let at = (share * x.len() as f64) as usize;
    (at < x.len()).then(|| *x.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// The middle one, of an even count the upper of the two in the middle; none of none.
pub(crate) fn median(x: impl IntoIterator<Item = f64>) -> Option<f64> {
    quantile(x, 0.5)
}

/// Standard deviation of normal numbers about zero, by the median of their size; none of none.
pub(crate) fn scale(x: impl IntoIterator<Item = f64>) -> Option<f64> {
    Some(median(x.into_iter().map(f64::abs))? / MEDIAN_OF_NORMAL)
}

/// Mean gain of one set of held-out squares over another, group by group, in its own standard errors.
pub(crate) fn gain(before: &[f64], after: &[f64]) -> f64 {
    let n = before.len() as f64;
    let differences: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
    let mean = differences.iter().sum::<f64>() / n;
    let spread: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
    let error = (spread / (n * (n - 1.0)).max(1.0)).sqrt();
    if error > 0.0 { mean / error } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn constants_are_a_normal_variables() {
        let normal = Normal::new(0.0, 1.0).unwrap();
        for (constant, share) in [(MEDIAN_OF_NORMAL, 0.5), (QUARTER_OF_NORMAL, 0.25)] {
            let size = normal.inverse_cdf(0.5 + 0.5 * share);
            assert!((constant - size).abs() < 5e-5, "{constant} {size}");
        }
    }

    #[test]
    fn outliers_do_not_move_them() {
        assert_eq!(median([3.0, -1.0, 1e9, 2.0, 0.0]), Some(2.0));
        assert_eq!(quantile([4.0, 1.0, 3.0, 2.0], 0.25), Some(2.0));
        assert_eq!(scale([-0.6745, 0.6745, 1e9]), Some(1.0));
        assert_eq!((median([]), quantile([1.0], 1.0)), (None, None));
    }
}
