//! The scalar product of slices, on which most of a diagnosis's time is spent.

/// Running sums side by side: one sum would have each addition wait for the last one.
const LANES: usize = 8;

/// Σ a b, as far as both reach.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (a[..n].chunks_exact(LANES), b[..n].chunks_exact(LANES));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    let mut sums = [0.0; LANES];
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_is_summed_whole() {
        let x: Vec<f64> = (1..40).map(f64::from).collect();
        for n in 0..x.len() {
            let expected: f64 = x[..n].iter().map(|x| x * x).sum();
            assert_eq!(dot(&x[..n], &x), expected);
        }
    }
}
