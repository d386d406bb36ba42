//! How a series remembers, and how many independent blocks it is worth.
//!
//! What persists from log to log (warmth, wear, a floor) is a first-order autoregression under white noise: correlation s ρᵏ at a lag of k blocks. One
//! robot's series is too short to tell ρ, and its own mean takes part of the memory away: the sample autocovariance is too small by the
//! variance of the mean (Priestley 1981, *Spectral Analysis and Time Series*, §5.3.3). So s and ρ are those of all robots' series of one kind, with that put back.

use std::collections::BTreeMap;

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::parallel::side_by_side;
use crate::robust;

/// Greatest ρ: a memory as long as 50 blocks cannot be told from a drift.
const MOST_RHO: f64 = 0.98;
/// Lag at which the fall of the correlation is read, blocks; shorter in short series.
const FAR: usize = 4;
/// Times that what a series' own mean takes away is put back: it converges by a factor of two each, slower where ρ is near one.
const ROUNDS: usize = 200;
/// Fewest blocks of a series that says anything of memory: three lags.
const LEAST_BLOCKS: usize = 4;
/// As many robots' series of a parameter tell its own memory: of 40 of 50 blocks the variance of a mean comes out within 20 %.
const LEAST_SERIES: usize = 20;
/// Correlation at lag one below so many of its standard errors is none.
const SEEN: f64 = 2.0;
/// Least variation of a series, relative to its size: below it is rounding.
const ROUNDING: f64 = 1e-9;

/// How series of one kind remember: correlation `share` ρᵏ at a lag of k blocks.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Memory {
    /// Part of the variance that persists.
    pub share: f64,
    /// Correlation of that part from block to block.
    pub rho: f64,
}

impl Memory {
    /// Of series of one kind, each with its parameter's name and in the order of time: like ones are scaled alike, for a series' own variance is
    /// the smaller the less it has moved.
    pub fn of_kind(series: &[(&str, Vec<f64>)]) -> Self {
        let mut like: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
        for (name, x) in series {
            if let Some(centred) = centred(x) {
                like.entry(name).or_default().push(centred);
            }
        }
        let mut all = Vec::new();
        for mut own in like.into_values() {
            let numbers = || own.iter().flatten();
            let square = numbers().map(|x| x * x).sum::<f64>() / numbers().count().max(1) as f64;
            own.iter_mut().flatten().for_each(|x| *x /= square.sqrt());
            all.extend(own);
        }
        Self::of(&all)
    }

    /// Of each parameter by its name: its own where so many robots tell it (20), else that of its kind (the name up to the colon).
    pub fn by_name(series: &[(&str, Vec<f64>)]) -> BTreeMap<String, Self> {
        let kind = |name: &str| {
            name.split_once(':')
                .map_or(name, |(kind, _)| kind)
                .to_owned()
        };
        let mut kinds: BTreeMap<String, Vec<(&str, Vec<f64>)>> = BTreeMap::new();
        let mut names: BTreeMap<&str, Vec<(&str, Vec<f64>)>> = BTreeMap::new();
        for own in series {
            kinds.entry(kind(own.0)).or_default().push(own.clone());
            names.entry(own.0).or_default().push(own.clone());
        }
        let kinds: Vec<_> = kinds.into_iter().collect();
        let kinds = side_by_side(&kinds, |(kind, own)| (kind.clone(), Self::of_kind(own)));
        let kinds: BTreeMap<String, Self> = kinds.into_iter().collect();
        let names: Vec<_> = names.into_iter().collect();
        let of = |(name, own): &(&str, Vec<(&str, Vec<f64>)>)| {
            let memory = match own.len() >= LEAST_SERIES {
                true => Self::of_kind(own),
                false => kinds.get(&kind(name)).copied().unwrap_or_default(),
            };
            ((*name).to_owned(), memory)
        };
        side_by_side(&names, of).into_iter().collect()
    }

    /// Of series about their means.
    fn of(centred: &[Vec<f64>]) -> Self {
        let pairs: usize = centred.iter().map(|x| x.len() - 1).sum();
        let Some(length) = robust::median(centred.iter().map(|x| x.len() as f64)) else {
            return Self::default();
        };
        let length = length as usize;
        let far = FAR.min(length / 3).max(2);
        let covariance = |lag: usize| {
            let of = |x: &Vec<f64>| -> (f64, f64) {
                let products = x.iter().zip(x.iter().skip(lag)).map(|(a, b)| a * b);
                (products.sum(), x.len().saturating_sub(lag) as f64)
            };
            let (sum, count) = centred
                .iter()
                .map(of)
                .fold((0.0, 0.0), |(a, n), (b, m)| (a + b, n + m));
            sum / f64::max(count, 1.0)
        };
        let seen = [0, 1, far].map(covariance);
        let least = SEEN / (pairs as f64).sqrt();
        let mut memory = Self::default();
        for _ in 0..ROUNDS {
            let asked = memory.about_own_means(length, far);
            let missed = |k: usize| seen[k] / seen[0] - asked[k] / asked[0];
            let [near, away] =
                [(1, 1), (2, far)].map(|(k, lag)| memory.correlation(lag) + missed(k));
            if near < least {
                return Self::default();
            }
            let near = near.min(MOST_RHO);
            // Where nothing is left farther away, it is a memory of few blocks.
            let rho = match away > least {
                true => (away / near)
                    .powf(1.0 / (far - 1) as f64)
                    .clamp(near, MOST_RHO),
                false => near,
            };
            memory = Self {
                share: near / rho,
                rho,
            };
        }
        memory
    }

    /// Expected covariances, at the lags 0, 1 and `far`, of n blocks about their own mean, where the variance about the true one is 1: c_k less the means'
    /// covariances with both blocks, plus the variance of the mean.
    fn about_own_means(&self, n: usize, far: usize) -> [f64; 3] {
        let mut sums = vec![0.0];
        for k in 1..n {
            sums.push(sums[k - 1] + self.correlation(k));
        }
        let with_mean: Vec<f64> = (0..n)
            .map(|t| (1.0 + sums[t] + sums[n - 1 - t]) / n as f64)
            .collect();
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
        let of = |lag: usize| {
            let (first, last) = (&with_mean[..n - lag], &with_mean[lag..]);
            self.correlation(lag) - mean(first) - mean(last) + mean(&with_mean)
        };
        [0, 1, far].map(of)
    }

    /// Correlation of two blocks so many apart.
    pub fn correlation(&self, lag: usize) -> f64 {
        match lag {
            0 => 1.0,
            lag => self.share * self.rho.powi(lag as i32),
        }
    }

    /// By how many times more than of independent blocks the variance of the mean of n is: 1 + 2 Σ (1 − k/n) c_k.
    pub fn inflation(&self, n: usize) -> f64 {
        let of = |k: usize| (1.0 - k as f64 / n as f64) * self.correlation(k);
        1.0 + 2.0 * (1..n).map(of).sum::<f64>()
    }

    /// The same of infinitely many: the long-run variance over the variance.
    pub fn long_run(&self) -> f64 {
        1.0 + 2.0 * self.share * self.rho / (1.0 - self.rho)
    }

    /// How many independent blocks n are worth.
    pub fn effective(&self, n: usize) -> f64 {
        n as f64 / self.inflation(n)
    }

    /// Degrees of freedom of the variance of n blocks about their mean: n over 1 + 2 Σ c_k² (Bartlett 1946), less one for the mean.
    pub fn freedom(&self, n: usize) -> f64 {
        let squares = (1..n).map(|k| (1.0 - k as f64 / n as f64) * self.correlation(k).powi(2));
        (n as f64 / (1.0 + 2.0 * squares.sum::<f64>()) - 1.0).max(1.0)
    }

    /// A variance of blocks about their own mean as that about the true one: their own mean follows what persists.
    pub fn about_truth(&self, variance: f64, n: usize) -> f64 {
        let lost = (self.inflation(n) / n as f64).min(0.9);
        variance * (1.0 - 1.0 / n as f64) / (1.0 - lost)
    }
}

/// A series about its mean; `None` if it is too short or does not vary.
fn centred(x: &[f64]) -> Option<Vec<f64>> {
    let (mean, variance) = mean_and_variance(x);
    let varies = variance.sqrt() > ROUNDING * mean.abs() && variance > 0.0;
    (x.len() >= LEAST_BLOCKS && varies).then(|| x.iter().map(|x| x - mean).collect())
}

/// Mean and variance about it.
pub fn mean_and_variance(x: &[f64]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let square: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, square / (n - 1.0).max(1.0))
}

/// Variances of one kind, each of so many degrees of freedom, drawn towards what they have in common as far as they do not differ by more than
/// chance: each with its degrees of freedom after that (Smyth 2004, Stat. Appl. Genet. Mol. Biol. 3, 3; with ψ'(x) ≈ 1/x + 1/(2x²)).
pub fn moderated(variances: &[f64], freedom: f64) -> Vec<(f64, f64)> {
    let told: Vec<f64> = variances.iter().copied().filter(|v| *v > 0.0).collect();
    // Of fewer a common one is as uncertain as they are.
    if told.len() < 5 {
        return variances.iter().map(|v| (*v, freedom)).collect();
    }
    let middle = robust::median(told.iter().copied()).unwrap_or(0.0);
    // Median of χ² over its degrees of freedom (Wilson & Hilferty 1931).
    let common = middle / (1.0 - 2.0 / (9.0 * freedom)).powi(3).max(0.1);
    let logs: Vec<f64> = told.iter().map(|v| v.ln()).collect();
    let centre = robust::median(logs.iter().copied()).unwrap_or(0.0);
    let spread = robust::scale(logs.iter().map(|x| x - centre))
        .unwrap_or(0.0)
        .powi(2);
    let half = 0.5 * freedom;
    let excess = spread - (1.0 / half + 0.5 / (half * half));
    // As many degrees of freedom as all of them have together, at most.
    let most = freedom * told.len() as f64;
    let prior = match excess > 0.0 {
        true => (2.0 / excess).min(most),
        false => most,
    };
    let of = |v: &f64| {
        let sum = prior + freedom;
        ((prior * common + freedom * v) / sum, sum)
    };
    variances.iter().map(of).collect()
}

/// By how much a standard deviation of so many degrees of freedom is widened so that two of it hold 95.4 %, as two of a known one do.
pub fn widened(freedom: f64) -> f64 {
    let two = 0.977_249_868;
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(1.0, |t| t.inverse_cdf(two) / 2.0)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn memory_is_that_of_the_series() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        for (rho, share) in [(0.0f64, 0.0f64), (0.9, 1.0), (0.9, 0.5), (0.5, 1.0)] {
            let mut series = Vec::new();
            for _ in 0..400 {
                let mut state = normal();
                let own = (0..50).map(|_| {
                    state = rho * state + f64::sqrt(1.0 - rho * rho) * normal();
                    share.sqrt() * state + f64::sqrt(1.0 - share) * normal()
                });
                series.push(("like", own.collect::<Vec<f64>>()));
            }
            let memory = Memory::of_kind(&series);
            let truth = Memory { share, rho };
            let (found, asked) = (memory.inflation(50), truth.inflation(50));
            assert!(
                (found / asked - 1.0).abs() < 0.15,
                "{memory:?} {rho} {share}: {found} {asked}"
            );
        }
        assert_eq!(Memory::of_kind(&[]), Memory::default());
        assert_eq!(
            Memory::of_kind(&[("still", vec![1.0; 9])]),
            Memory::default()
        );
        assert!((Memory::default().effective(50) - 50.0).abs() < 1e-12);
    }

    #[test]
    fn like_variances_become_one_and_unlike_ones_stay() {
        let like = moderated(&[1.0, 1.1, 0.9, 1.05, 0.95, 1.0], 10.0);
        assert!(
            like.iter()
                .all(|(v, df)| (v - 1.0).abs() < 0.1 && *df > 60.0),
            "{like:?}"
        );
        let unlike = moderated(&[1e-4, 1.0, 1e4, 1e-2, 1e2, 1e3], 10.0);
        assert!((unlike[2].0 / 1e4 - 1.0).abs() < 0.1, "{unlike:?}");
        assert!((widened(1e6) - 1.0).abs() < 1e-3 && widened(4.0) > 1.3);
    }
}
