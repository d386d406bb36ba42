//! What the model leaves of each window's torques, and how large that is in swing.

use crate::robust;

/// Windows to either side that a run's median is over: half of the shortest stance of a trot. A force that is no larger than a window's
/// noise shows in it, and unlike a mean it does not reach over an episode's ends.
const RUN: usize = 2;

/// Measured − predicted torque of each window's joints and what is usual of it, N m.
#[derive(Debug, Clone, Default)]
pub(super) struct Residuals {
    pub(super) own: Vec<Vec<f64>>,
    /// Standard deviation of each joint's in swing.
    pub(super) noise: Vec<f64>,
}

impl Residuals {
    /// Of window w, squared and in units of its noise.
    pub(super) fn deviation(&self, w: usize) -> f64 {
        let sizes = self.own[w].iter().zip(&self.noise);
        sizes.map(|(r, noise)| (r / noise).powi(2)).sum()
    }

    /// Medians over runs of windows, each beside the window in its middle; their noise is not known yet.
    pub(super) fn runs(&self) -> Vec<Vec<f64>> {
        let n = self.own.len();
        let median = |w: usize| {
            let run = &self.own[w.saturating_sub(RUN)..(w + RUN + 1).min(n)];
            let of = |j: usize| robust::median(run.iter().map(|r| r[j])).unwrap_or(0.0);
            (0..self.own[w].len()).map(of).collect()
        };
        (0..n).map(median).collect()
    }
}
