//! When a model fails worst.

use std::fmt;

use serde::Serialize;

use super::series::Series;
use crate::robust;

/// A moment at which the error is large.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Episode {
    /// When, s.
    pub t: f64,
    /// Measured − predicted torque there, N m.
    pub residual: f64,
    /// The same in units of the typical residual: by the median of its magnitude, the standard deviation of
    /// normal errors that large ones do not inflate.
    pub size: f64,
    /// Position, rad.
    pub q: f64,
    /// Velocity, rad/s.
    pub dq: f64,
    /// Measured torque, N m.
    pub tau: f64,
}

/// Moments closer than this, s, are one episode.
const APART: f64 = 0.5;

/// Episodes told.
const MOST: usize = 5;

/// The worst distinct episodes, worst first.
pub(super) fn worst(series: &Series) -> Vec<Episode> {
    let magnitude: Vec<f64> = series.residual.iter().map(|r| r.abs()).collect();
    if magnitude.is_empty() {
        return Vec::new();
    }
    let typical = robust::scale(magnitude.iter().copied()).unwrap_or(0.0);
    let mut order: Vec<usize> = (0..magnitude.len()).collect();
    order.sort_by(|&a, &b| magnitude[b].total_cmp(&magnitude[a]));
    let mut worst: Vec<usize> = Vec::new();
    for k in order {
        if worst.len() == MOST || magnitude[k] == 0.0 {
            break;
        }
        // Index distance too: logs that follow each other have the same times.
        let near = |&w: &usize| {
            (series.t[w] - series.t[k]).abs() < APART && w.abs_diff(k) < series.t.len().min(1000)
        };
        if !worst.iter().any(near) {
            worst.push(k);
        }
    }
    let episode = |k: usize| Episode {
        t: series.t[k],
        residual: series.residual[k],
        size: magnitude[k] / typical.max(f64::MIN_POSITIVE),
        q: series.q[k],
        dq: series.dq[k],
        tau: series.tau[k],
    };
    worst.into_iter().map(episode).collect()
}

impl fmt::Display for Episode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "t = {:.2} s: {:+.3} N m, {:.1} times the typical error (q = {:.2} rad, q̇ = {:.2} rad/s, τ = {:.2} N m)",
            self.t, self.residual, self.size, self.q, self.dq, self.tau
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_one_episode() {
        let t: Vec<f64> = (0..1000).map(|k| 0.02 * f64::from(k)).collect();
        let mut residual: Vec<f64> = (0..1000)
            .map(|k| if k % 2 == 0 { 0.1 } else { -0.1 })
            .collect();
        // A wide bump and four spikes.
        for (k, value) in [(300, 5.0), (301, 6.0), (302, 5.5), (310, 4.0), (500, -3.0)] {
            residual[k] = value;
        }
        for (k, value) in [(700, 2.0), (800, 1.0), (900, 0.5)] {
            residual[k] = value;
        }
        let series = Series {
            joint: "x",
            t: &t,
            q: &t,
            dq: &t,
            tau: &t,
            residual: &residual,
            temperature: None,
            contact: None,
            slides: false,
            noise: None,
        };
        let worst = worst(&series);
        let values: Vec<f64> = worst.iter().map(|e| e.residual).collect();
        assert_eq!(values, [6.0, -3.0, 2.0, 1.0, 0.5]);
        assert!((worst[0].size - 6.0 * robust::MEDIAN_OF_NORMAL / 0.1).abs() < 1e-9);
    }
}
