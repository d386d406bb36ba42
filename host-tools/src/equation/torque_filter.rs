//! The torque that gears transmit, as far as the noise of the motion lets it be known.
//!
//! What a spring gives way by is in proportion to this torque, and what that does to the bodies to its second derivative: to the fourth of the
//! positions. Noise of theirs between the robot's own frequencies and the smoother's cutoff, which a torque hardly shows, is there more than all
//! motion, and a stiffness that is regressed on it comes out many times too large (an error in the variables). So each frequency is passed by the share
//! of it that is motion (Wiener 1949, *Extrapolation, Interpolation, and Smoothing of Stationary Time Series*), with which a regression is consistent
//! (Carroll et al. 2006, *Measurement Error in Nonlinear Models*, ch. 4).
//!
//! The density of the noise is that of the two channels, fused and smoothed, times the square of the inertia and of ω²; the density of torque and noise
//! together is the log's own.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use nalgebra::DMatrix;
use realfft::RealFftPlanner;

use super::body::LimbBody;
use super::local_line::{REACH, local_line};
use super::motion::Motion;
use super::values::Values;
use crate::trajectory::Trajectory;

/// Length of the pieces whose spectra are averaged, s: a Hann window of it tells frequencies 1 Hz apart.
const LENGTH: f64 = 2.0;
/// Shorter pieces have no spectrum, samples.
const LEAST_SAMPLES: usize = 16;
/// What has less than so many times the noise's density may be noise alone, and is left out; what has so many times is passed by its share of motion. A
/// mean of ten pieces exceeds its expectation by a half in one of ten frequencies, twofold in one of a hundred.
const NOISE_ALONE: f64 = 1.5;
const SURE: f64 = 2.5;

/// A burst's length, s, and how far its mean square is above the noise's: ten decibels, as where a channel shows motion. Noise of ten to fifteen hertz has
/// two or three independent values in that time, whose mean square is eight times as large as usual once in some thousand moments; about turns the
/// smoother lets more of it pass.
// From 8 to 40 times the stiffness of arms that are drawn and of MuJoCo's arms with friction is found alike; at 3 noise about turns is taken for bursts
// (1/k of 0.2 to 0.4), and without bursts a fifth more of MuJoCo's is left.
const MOMENT: f64 = 0.1;
const BURST_ALONE: f64 = 10.0;
const SURE_BURST: f64 = 20.0;

impl Motion {
    /// What of a joint's torque is motion, and not its noise, N m, sample by sample; of `torque` sample by sample, joint by joint.
    pub(super) fn filtered_torque(
        &self,
        inertia: &DMatrix<f64>,
        motors: &[Trajectory],
        (torque, joint): (&[f64], usize),
    ) -> Vec<f64> {
        let longest = self
            .stretches
            .iter()
            .map(|s| self.seconds(s))
            .max_by(f64::total_cmp);
        let period = self.period();
        // An even number, so that its last frequency is half the sampling rate.
        let length = (LENGTH.min(longest.unwrap_or(0.0)) / period) as usize & !1;
        let own = torque.iter().skip(joint).step_by(self.joints);
        let mut known: Vec<f64> = own.copied().collect();
        if length < LEAST_SAMPLES {
            return known;
        }
        let density = |frequency: f64| {
            let of =
                |i: usize| inertia[(joint, i)].powi(2) * motors[i].noise_density(frequency, period);
            (TAU * frequency).powi(4) * (0..self.joints).map(of).sum::<f64>()
        };
        let (share, left) = self.share_of_motion((&known, motors[joint].cutoff), length, density);
        if left <= 0.0 {
            return known;
        }
        for stretch in &self.stretches {
            let t = &self.time[stretch.clone()];
            let own = &mut known[stretch.clone()];
            let mut passed = passed(&self.loads.plans, t, own, &share);
            let rest: Vec<f64> = own
                .iter()
                .zip(&passed)
                .map(|(own, passed)| own - passed)
                .collect();
            add_bursts(t, &rest, left, &mut passed);
            own.copy_from_slice(&passed);
        }
        known
    }

    /// The mean time between samples of a motion, s.
    fn period(&self) -> f64 {
        let time: f64 = self.stretches.iter().map(|s| self.seconds(s)).sum();
        let steps: usize = self
            .stretches
            .iter()
            .map(|s| s.len().saturating_sub(1))
            .sum();
        time / steps.max(1) as f64
    }

    fn seconds(&self, stretch: &Range<usize>) -> f64 {
        match (
            self.time[stretch.clone()].first(),
            self.time[stretch.clone()].last(),
        ) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// The share of each frequency of a joint's torque that is motion, from 0 to half the sampling rate, where its noise has this density,
    /// (N m)²/Hz; and the variance of the noise that is left out, (N m)². Beyond where the joint's own motion is followed, Hz, all is noise.
    fn share_of_motion(
        &self,
        (torque, followed): (&[f64], f64),
        length: usize,
        noise: impl Fn(f64) -> f64,
    ) -> (Vec<f64>, f64) {
        let fft = plans(&self.loads.plans).plan_fft_forward(length);
        let (mut piece, mut spectrum) = (fft.make_input_vec(), fft.make_output_vec());
        let hann = |k: usize| 0.5 * (1.0 - (TAU * k as f64 / length as f64).cos());
        let window: Vec<f64> = (0..length).map(hann).collect();
        let (mut density, mut count) = (vec![0.0; spectrum.len()], 0);
        for stretch in &self.stretches {
            for first in
                (stretch.start..(stretch.end + 1).saturating_sub(length)).step_by(length / 2)
            {
                let own = &torque[first..first + length];
                let mean = own.iter().sum::<f64>() / length as f64;
                for ((piece, window), own) in piece.iter_mut().zip(&window).zip(own) {
                    *piece = window * (own - mean);
                }
                if fft.process(&mut piece, &mut spectrum).is_ok() {
                    count += 1;
                    (density.iter_mut().zip(&spectrum)).for_each(|(sum, x)| *sum += x.norm_sqr());
                }
            }
        }
        let period = self.period();
        let squares: f64 = window.iter().map(|w| w * w).sum();
        let scale = 2.0 * period / (squares * f64::from(count.max(1)));
        let near = |n: usize| {
            let own = &density[n.saturating_sub(1)..(n + 2).min(density.len())];
            scale * own.iter().sum::<f64>() / own.len() as f64
        };
        let step = 1.0 / (length as f64 * period);
        let mut left = 0.0;
        let share = |n: usize| {
            let frequency = n as f64 * step;
            let noise = noise(frequency);
            let share = if noise <= 0.0 {
                1.0
            } else if frequency > followed {
                0.0
            } else {
                passes(near(n) / noise, NOISE_ALONE, SURE)
            };
            left += (1.0 - share).powi(2) * noise * step;
            share
        };
        ((0..density.len()).map(share).collect(), left)
    }

    /// The inertia matrix, the mean over some poses, kg m².
    pub(crate) fn usual_inertia(&self, body: &LimbBody, values: &Values) -> DMatrix<f64> {
        let n = self.joints;
        let (rigid, base) = (body.loaded(values), body.base(values));
        let mut matrix = vec![0.0; n * n];
        let mut at = |pose: usize| {
            let k = pose * self.time.len() / POSES;
            let q: Vec<f64> = self.joint.iter().map(|joint| joint.state[k][0]).collect();
            rigid.inertia_matrix(&base, &q, &mut matrix);
            DMatrix::from_row_slice(n, n, &matrix)
        };
        let sum = (0..POSES).fold(DMatrix::zeros(n, n), |sum, pose| sum + at(pose));
        sum / POSES as f64
    }
}

/// The share that is passed of what is so many `times` the noise that is in it: none where that may be noise alone, then what is more than the noise.
fn passes(times: f64, alone: f64, sure: f64) -> f64 {
    let surely = ((times - alone) / (sure - alone)).clamp(0.0, 1.0);
    surely * (1.0 - 1.0 / times.max(1.0))
}

/// Adds bursts of what was left out, whose noise has this variance: after a turn under friction, or a knock, a motor moves for a moment at frequencies
/// that in the mean are noise.
fn add_bursts(t: &[f64], rest: &[f64], noise: f64, passed: &mut [f64]) {
    let mut sums = vec![0.0; rest.len() + 1];
    for (k, x) in rest.iter().enumerate() {
        sums[k + 1] = sums[k] + x * x;
    }
    let (mut first, mut last) = (0, 0);
    for (k, (passed, rest)) in passed.iter_mut().zip(rest).enumerate() {
        while t[k] - t[first] > 0.5 * MOMENT {
            first += 1;
        }
        while last < t.len() && t[last] - t[k] <= 0.5 * MOMENT {
            last += 1;
        }
        let mean = (sums[last] - sums[first]) / (last - first) as f64;
        *passed += passes(mean / noise, BURST_ALONE, SURE_BURST) * rest;
    }
}

/// Poses that the inertia is the mean of.
const POSES: usize = 16;

/// A stretch of a signal with each frequency's share of it passed; at its ends it goes on as its mirror image through the point there.
fn passed(known: &Mutex<RealFftPlanner<f64>>, t: &[f64], x: &[f64], share: &[f64]) -> Vec<f64> {
    let n = x.len();
    // As long as the spectrum's window: no filter made of that remembers longer.
    let beside = (2 * share.len()).min(n.saturating_sub(1));
    if n < 4 {
        return x.to_vec();
    }
    let half = t
        .partition_point(|time| *time - t[0] <= REACH)
        .clamp(1, (n - 1) / 2);
    let end = |k: usize, end: usize| {
        let [value, slope] = local_line(t, x, k, half);
        value + slope * (t[end] - t[k])
    };
    let (first, last) = (end(half, 0), end(n - 1 - half, n - 1));
    let before = (1..=beside).rev().map(|k| 2.0 * first - x[k]);
    let after = (1..=beside).map(|k| 2.0 * last - x[n - 1 - k]);
    let mut long: Vec<f64> = before.chain(x.iter().copied()).chain(after).collect();
    // Back to where it begins, in as many samples as make the transform a fast one.
    let (end, missing) = (long[long.len() - 1], fast_length(long.len()) - long.len());
    let back = (long[0] - end) / (missing + 1) as f64;
    long.extend((1..=missing).map(|k| end + back * k as f64));
    let length = long.len();
    let (forward, inverse) = {
        let mut plans = plans(known);
        (
            plans.plan_fft_forward(length),
            plans.plan_fft_inverse(length),
        )
    };
    let mut spectrum = forward.make_output_vec();
    if forward.process(&mut long, &mut spectrum).is_err() {
        return x.to_vec();
    }
    let last = share.len() - 1;
    let scale = 2.0 * last as f64 / length as f64;
    for (n, x) in spectrum.iter_mut().enumerate() {
        let at = (n as f64 * scale).min(last as f64);
        let (below, part) = (at as usize, at.fract());
        let above = (below + 1).min(last);
        *x *= (share[below] * (1.0 - part) + share[above] * part) / length as f64;
    }
    if inverse.process(&mut spectrum, &mut long).is_err() {
        return x.to_vec();
    }
    long[beside..beside + n].to_vec()
}

/// The plans of transforms that are known, to be asked for one.
fn plans(known: &Mutex<RealFftPlanner<f64>>) -> MutexGuard<'_, RealFftPlanner<f64>> {
    known.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The least length from this one on that is a power of two, or one and a half times that.
fn fast_length(least: usize) -> usize {
    let power = least.next_power_of_two();
    if least <= power / 4 * 3 {
        power / 4 * 3
    } else {
        power
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is passed as a whole stays as it is, to its ends; what lies above the frequencies that are passed goes.
    #[test]
    fn a_share_of_each_frequency_is_passed() {
        let t: Vec<f64> = (0..3001).map(|k| 2e-3 * f64::from(k)).collect();
        let slow: Vec<f64> = t.iter().map(|t| 3.0 + (4.0 * t).sin()).collect();
        let both: Vec<f64> = (t.iter().zip(&slow))
            .map(|(t, slow)| slow + (300.0 * t).cos())
            .collect();
        let planner = Mutex::default();
        let whole = passed(&planner, &t, &both, &[1.0; 501]);
        let off = |a: &[f64], b: &[f64], from: usize| {
            let inner = from..a.len() - from;
            inner.map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max)
        };
        assert!(off(&whole, &both, 0) < 1e-12);
        // 501 shares reach to 250 Hz: the first 30 Hz of them.
        let low: Vec<f64> = (0..501).map(|n| if n < 60 { 1.0 } else { 0.0 }).collect();
        let low = passed(&planner, &t, &both, &low);
        assert!(off(&low, &slow, 200) < 0.02, "{}", off(&low, &slow, 200));
        assert!(off(&low, &slow, 0) < 0.5, "{}", off(&low, &slow, 0));
    }
}
