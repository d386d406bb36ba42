//! The state of friction inside a gear that gives way.
//!
//! ```text
//! dz/dx = (1 − z sgn ẋ)/w,   |z| ≤ 1
//! ```
//!
//! (Dahl 1968, *A Solid Friction Model*, eq. 1 with exponent 1): how fast x changes does not matter, only how far.

/// z at each of the twists `x` (rad), by a displacement w (rad); it begins at zero. Exact where x runs straight between samples.
pub(crate) fn hysteresis(x: impl IntoIterator<Item = f64>, displacement: f64) -> Vec<f64> {
    let (mut before, mut z) = (None, 0.0);
    let step = |x: f64| {
        let gone = x - before.replace(x).unwrap_or(x);
        if gone != 0.0 {
            z = gone.signum() - (gone.signum() - z) * (-gone.abs() / displacement).exp();
        }
        z
    };
    x.into_iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However fast, and in however many steps, the same displacement leads to the same state; it ends at one.
    #[test]
    fn only_the_displacement_matters() {
        let end = |steps: u32| {
            let up = (0..=steps).map(|k| 0.01 * f64::from(k) / f64::from(steps));
            let down = (0..=steps).map(|k| 0.01 - 0.004 * f64::from(k) / f64::from(steps));
            *hysteresis(up.chain(down), 0.002).last().unwrap()
        };
        assert!((end(3) - end(3000)).abs() < 1e-12);
        let expected = -1.0 + (2.0 - (-5.0f64).exp()) * (-2.0f64).exp();
        assert!((end(10) - expected).abs() < 1e-12);
        let far = hysteresis([0.0, 1.0], 0.002);
        assert!((far[1] - 1.0).abs() < 1e-12);
        assert_eq!(hysteresis([0.3; 4], 0.002), [0.0; 4]);
    }
}
