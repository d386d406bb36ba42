//! Neighbouring windows share an edge, and with it the noise of one momentum.
//!
//! What a window ends with, the next begins with: the velocity's noise enters both with opposite signs, so that neighbours
//! are correlated by up to −½ and sums over many windows are far more exact than windows are. Least squares that takes
//! windows as independent throws this away: slow effects (a constant torque, a load, an offset of an encoder) are then seen
//! three times less well than the data allow. Generalised least squares with the tridiagonal covariance
//!
//! ```text
//! cov(e_k, e_k) = σ²,   cov(e_k, e_{k+1}) = ρ σ²,   −½ < ρ ≤ 0
//! ```
//!
//! gives what the Cramér-Rao bound promises (Ljung 1999, §7.3 on prediction errors; Golub & Van Loan §4.3 for the band
//! Cholesky factor). Rows are whitened by that factor as they come, one row of memory per joint:
//!
//! ```text
//! r_1 = 1,  u_1 = x_1;   r_k = 1 − ρ²/r_{k−1},  u_k = x_k − (ρ/r_{k−1}) u_{k−1};   row_k = u_k / √r_k
//! ```
//!
//! whose noise is again σ² and white.

/// The largest θ of the moving average that is tried: at one a sum over windows would be a perfect measurement.
const STRONGEST: f64 = 0.85;
/// Values of θ that are tried.
const STEPS: u32 = 17;
/// Fewer windows say nothing of their correlation.
const LEAST_WINDOWS: usize = 50;

/// Whitens the rows of one joint.
#[derive(Debug, Clone)]
pub(crate) struct Whitening {
    correlation: f64,
    /// Where the row before ended.
    end: Option<usize>,
    ratio: f64,
    row: Vec<f64>,
}

impl Whitening {
    /// For neighbours with this correlation.
    pub(crate) fn new(correlation: f64) -> Self {
        Self {
            correlation,
            end: None,
            ratio: 1.0,
            row: Vec::new(),
        }
    }

    /// Makes of the row of a window from sample `first` to `last` one whose noise is independent of those before.
    pub(crate) fn whiten(&mut self, [first, last]: [usize; 2], row: &mut [f64]) {
        if self.correlation == 0.0 {
            // The ratio stays one.
            return;
        }
        if self.end == Some(first) {
            let share = self.correlation / self.ratio;
            self.ratio = 1.0 - self.correlation * share;
            row.iter_mut()
                .zip(&self.row)
                .for_each(|(x, before)| *x -= share * before);
        } else {
            self.ratio = 1.0;
        }
        self.end = Some(last);
        self.row.clear();
        self.row.extend_from_slice(row);
        let scale = self.ratio.sqrt().recip();
        row.iter_mut().for_each(|x| *x *= scale);
    }

    /// Weighs a row that is in doubt by so many times its noise more: it is independent of its neighbours.
    pub(crate) fn alone(&mut self, doubt: f64, row: &mut [f64]) {
        self.end = None;
        let scale = doubt.hypot(1.0).recip();
        row.iter_mut().for_each(|x| *x *= scale);
    }
}

/// The most likely correlation of neighbouring residuals, each given by the samples \[first, last\] of its window.
///
/// Residuals are a moving average of first order, e_k = ε_k − θ ε_{k−1}, ρ = −θ/(1 + θ²); θ is the one under which the
/// innovations ε are least likely to be smaller (Brockwell & Davis 1991, §8.7). Never positive: that would be no noise of
/// edges but something the model lacks.
pub(crate) fn neighbour_correlation(windows: &[([usize; 2], f64)]) -> f64 {
    if windows.len() < LEAST_WINDOWS {
        return 0.0;
    }
    let follows = |pair: &[([usize; 2], f64)]| pair[0].0[1] == pair[1].0[0];
    let begins = std::iter::once(true).chain(windows.windows(2).map(|pair| !follows(pair)));
    let residuals: Vec<(bool, f64)> = begins.zip(windows.iter().map(|(_, x)| *x)).collect();
    let candidates = (0..=STEPS).map(|k| {
        let theta = STRONGEST * f64::from(k) / f64::from(STEPS);
        -theta / (1.0 + theta * theta)
    });
    let judged = candidates.map(|rho| (rho, unlikelihood(&residuals, rho)));
    let best = judged.min_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(0.0, |(rho, _)| rho)
}

/// One link of a chain of correlated residuals, however many there are: ρ/r of the one before, 1/r and ln r.
#[derive(Clone, Copy)]
struct Link {
    share: f64,
    precision: f64,
    logarithm: f64,
}

/// The links of a chain up to where they do not change any more.
fn links(correlation: f64, most: usize) -> Vec<Link> {
    let (mut links, mut ratio, mut share): (Vec<Link>, f64, f64) = (Vec::new(), 1.0, 0.0);
    while links.len() < most {
        links.push(Link {
            share,
            precision: ratio.recip(),
            logarithm: ratio.ln(),
        });
        let before = ratio;
        share = correlation / ratio;
        ratio = 1.0 - correlation * share;
        if ratio == before {
            break;
        }
    }
    links
}

/// −2/n times the logarithm of the likelihood of Gaussian residuals, the variance at its best, but for a constant; each residual with
/// whether a chain begins with it. The whitened residuals are those of [`Whitening`].
fn unlikelihood(residuals: &[(bool, f64)], correlation: f64) -> f64 {
    let links = links(correlation, residuals.len());
    let (mut squares, mut determinant) = (0.0, 0.0);
    let (mut at, mut before) = (0, 0.0);
    for &(begins, residual) in residuals {
        at = if begins {
            0
        } else {
            (at + 1).min(links.len() - 1)
        };
        let link = links[at];
        before = residual - link.share * before;
        squares += before * before * link.precision;
        determinant += link.logarithm;
    }
    let n = residuals.len() as f64;
    (squares / n).ln() + determinant / n
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    /// Σ (row of the whitened matrix)ᵀ(…) must be Xᵀ C⁻¹ X with the tridiagonal C.
    #[test]
    fn whitened_rows_have_the_information_of_generalised_least_squares() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let rho = -0.43;
        let x = DMatrix::from_fn(30, 3, |_, _| f64::from(rng.next_u32()) / 4e9 - 0.5);
        let in_doubt = |k: usize| k % 7 == 3;
        let covariance = DMatrix::from_fn(30, 30, |i: usize, j: usize| match i.abs_diff(j) {
            0 if in_doubt(i) => 1.0 + 1.5 * 1.5,
            0 => 1.0,
            // Two stretches of time.
            1 if i.max(j) != 17 && !in_doubt(i) && !in_doubt(j) => rho,
            _ => 0.0,
        });
        let wanted = x.transpose() * covariance.try_inverse().unwrap() * &x;
        let mut whitening = Whitening::new(rho);
        let mut sum = DMatrix::zeros(3, 3);
        for k in 0..30 {
            let gap = usize::from(k >= 17);
            let mut row: Vec<f64> = x.row(k).iter().copied().collect();
            if in_doubt(k) {
                whitening.alone(1.5, &mut row);
            } else {
                whitening.whiten([10 * k + gap, 10 * (k + 1) + gap], &mut row);
            }
            let row = DVector::from_vec(row);
            sum += &row * row.transpose();
        }
        assert!((sum - wanted).amax() < 1e-10);
    }

    #[test]
    fn the_correlation_of_differences_is_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut number = || f64::from(rng.next_u32()) / 4e9 - 0.5;
        let edges: Vec<f64> = (0..4001).map(|_| number()).collect();
        let windows: Vec<_> = (0..4000)
            .map(|k| ([k, k + 1], edges[k + 1] - edges[k] + number()))
            .collect();
        // Edges and windows have the same variance: −1 of 3.
        assert!((neighbour_correlation(&windows) + 1.0 / 3.0).abs() < 0.03);
        let slow: Vec<_> = (0..4000)
            .map(|k| ([k, k + 1], (1e-2 * k as f64).sin()))
            .collect();
        assert_eq!(neighbour_correlation(&slow), 0.0);
    }
}
