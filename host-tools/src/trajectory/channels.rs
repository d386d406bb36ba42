//! How far a joint's encoder and its velocity channel can be believed, told by the two alone.
//!
//! What a controller makes a robot do ends at some frequency; what the channels report beyond it is noise, and in closed loop the
//! controller has put that noise into the torque. Each channel's spectrum (Welch 1967) shows where: white noise of the velocity is a
//! plateau, white noise of the position rises with the frequency in its slope,
//!
//! ```text
//! S_v(f) = motion + N_v,      S_d(f) = motion + N_q (2π f)²
//! ```
//!
//! with N_v and N_q from the upper half of the band, where no robot moves. Between the two there may be noise of other colours; but
//! none falls with the frequency in a velocity, so that a channel shows motion only where it is well above what comes after.
//!
//! Many drives make the velocity of the encoder's positions. Its noise is then the position's, which the coherence of the two beyond the motion
//! shows (Bendat & Piersol 2010, *Random Data*, §5.2), and it says nothing that the positions do not.

use super::Stretch;
use crate::gate::quantum::Differences;
use crate::robust;

/// Length of a stretch of time, s: its Hann window tells frequencies 2 Hz apart.
const LENGTH: f64 = 1.0;
/// Fewer samples tell no frequencies.
const LEAST_SAMPLES: usize = 16;
/// Where no stretch has as many: what a robot does usually ends there, Hz, and its velocity is as sure as this share of its greatest.
const USUAL: f64 = 15.0;
const SURE: f64 = 0.01;
/// Frequencies looked at, each so many times the one before; the lowest, Hz.
const LOWEST: f64 = 3.0;
const STEP: f64 = 1.12;
/// The highest as a share of the sampling rate: beyond, a slope between three samples says little.
const HIGHEST: f64 = 0.35;
/// From here on, as a share of the highest, there is noise alone.
const UPPER: f64 = 0.5;
/// Frequencies worked out side by side.
const LANES: usize = 8;
/// Neighbouring frequencies over which densities are averaged.
const AVERAGED: usize = 3;
/// A velocity is made of the positions where so much of its noise follows theirs: more than not. Of fewer stretches that is not told, for one
/// alone is always coherent.
const MADE_OF: f64 = 0.5;
const LEAST_STRETCHES: usize = 8;
/// And where what lies beyond the motion is noise of the position, which is as large in the upper half of that band as in the lower: of a motion that
/// shows through, both channels tell the same too, but it falls.
const EVEN: f64 = 0.5;
/// How many frequencies higher the comparison begins: half as high again; and how many it takes: a decade, whatever the sampling rate. The position's
/// noise makes the more of a slope the higher the frequency: at kilohertz more than any motion, which then shows at no frequency.
const BEYOND: usize = 4;
const COMPARED: usize = 20;
/// A velocity's scale is off by what is beyond so many of its standard deviations.
const SURE_OF_SCALE: f64 = 2.0;
/// A channel shows motion where its density is so many times that of its noise: ten decibels. What is nearer to the noise would add
/// more of it than of motion to an acceleration.
// Chosen among 4 and 10 on five chirps of one Go2: to be confirmed on robots that it has not seen.
const SHOWS: f64 = 10.0;
/// The smoother's cutoff is so many times the highest frequency of the motion, of which it then passes all but 1.4 ‰.
// Chosen among 1.5 and 1.8 on the same chirps (0.258 and 0.271 N m), where simulated legs are as well predicted with either.
const MARGIN: f64 = 1.5;

/// Of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Channels {
    /// Up to where the channels show motion above noise, Hz.
    pub(super) cutoff: f64,
    /// Standard deviation of a velocity (rad/s), and of a position (rad) on average over the motion.
    pub(super) velocity: f64,
    pub(super) position: f64,
    /// Standard deviation of the position of a joint that stands, rad, and of the times of samples, s: at a speed v a position is
    /// uncertain by timing v as well.
    pub(super) standing: f64,
    pub(super) timing: f64,
    /// Time between samples, s.
    pub(super) period: f64,
    /// Standard deviations of white noise of position, rad, and velocity, rad/s; zero where no spectrum tells them.
    white: [f64; 2],
    /// Whether the velocity is made of the positions, and is not looked at.
    pub(super) positions_alone: bool,
}

/// Σ |V|², Σ |D|² and Σ V D* at one frequency.
#[derive(Clone, Copy, Default)]
struct Density {
    velocity: f64,
    slope: f64,
    both: [f64; 2],
}

impl Density {
    /// Share of the velocity's power that follows the positions.
    fn coherence(&self) -> f64 {
        let [real, imaginary] = self.both;
        (real * real + imaginary * imaginary) / (self.velocity * self.slope).max(f64::MIN_POSITIVE)
    }
}

impl Channels {
    /// Measures a joint whose greatest speeds are `fast`, rad/s.
    pub(super) fn of(stretches: &[Stretch], period: f64, fast: f64) -> Self {
        let highest = HIGHEST / period;
        let mut frequencies = vec![LOWEST.min(highest)];
        while let Some(next) = frequencies
            .last()
            .map(|f| f * STEP)
            .filter(|f| *f <= highest)
        {
            frequencies.push(next);
        }
        let (densities, looks, weight) = densities(stretches, &frequencies, period);
        let smooth = averaged(&densities);
        if looks == 0 {
            return Self::untold(stretches, period, fast, highest);
        }
        let omega = |f: f64| std::f64::consts::TAU * f;
        let upper = |of: &dyn Fn(&Density, f64) -> f64| {
            let band = smooth
                .iter()
                .zip(&frequencies)
                .filter(|(_, f)| **f >= UPPER * highest);
            robust::median(band.map(|(d, f)| of(d, *f))).unwrap_or(0.0)
        };
        let velocity = upper(&|d, _| d.velocity);
        let position = upper(&|d, f| d.slope / omega(f).powi(2));
        let wrong = scale_error(stretches, period);
        // White noise of variance σ² has the density σ² Σ window² in each stretch.
        let std = |density: f64| (density / weight.max(f64::MIN_POSITIVE)).sqrt();
        // Where its scale is wrong by more than its noise, the encoder's slope is followed, and says how far.
        let slope = last_shown(&smooth, |d| d.slope);
        let beyond = (slope + BEYOND).min(smooth.len());
        let positions_alone = looks >= LEAST_STRETCHES
            && made_of_positions(&smooth[beyond..], &frequencies[beyond..]);
        let followed = wrong.abs() * fast <= std(velocity);
        let last = slope.max(if followed && !positions_alone {
            last_shown(&smooth, |d| d.velocity)
        } else {
            0
        });
        let least = 1e-7 * fast.max(1e-9);
        let position_of_all = std(position).max(least * period);
        let standing = (standing(stretches, fast).max(rounding(stretches)))
            .clamp(least * period, position_of_all);
        // Mean squares: a joint's mean square speed is about a third of the greatest one's square.
        let timing = (3.0 * (position_of_all.powi(2) - standing.powi(2))).sqrt()
            / fast.max(f64::MIN_POSITIVE);
        let even = timing * fast < standing;
        let cutoff = (MARGIN * frequencies[last]).min(highest);
        // A velocity in the wrong scale errs by a share of itself, which does not average out over the samples of 1/ω_c as white
        // noise does.
        let together = (1.0 / (omega(cutoff) * period)).max(1.0);
        let scaled = wrong * fast * together.sqrt();
        Self {
            standing: if even { position_of_all } else { standing },
            timing: if even { 0.0 } else { timing },
            cutoff,
            velocity: std(velocity).hypot(scaled).max(least),
            position: position_of_all,
            period,
            white: [std(position), std(velocity)],
            positions_alone,
        }
    }
}

impl Channels {
    /// See [`super::Trajectory::noise`].
    pub(super) fn noise(&self) -> [f64; 2] {
        let [position, velocity] = self.white;
        [
            position,
            if self.positions_alone {
                f64::INFINITY
            } else {
                velocity
            },
        ]
    }

    /// Of a joint whose stretches between gaps are too short for a spectrum.
    fn untold(stretches: &[Stretch], period: f64, fast: f64, highest: f64) -> Self {
        let cutoff = (MARGIN * USUAL).min(highest);
        let velocity = SURE * fast.max(1e-9);
        // As good as the velocity at the cutoff.
        let position = velocity / (std::f64::consts::TAU * cutoff);
        Self {
            cutoff,
            velocity: velocity.hypot(scale_error(stretches, period) * fast),
            position,
            standing: position,
            timing: 0.0,
            period,
            white: [0.0; 2],
            positions_alone: false,
        }
    }
}

/// Whether beyond the motion the velocity's noise is the position's: of densities there, and their frequencies, Hz.
fn made_of_positions(densities: &[Density], frequencies: &[f64]) -> bool {
    let Some(last) = frequencies.last() else {
        return false;
    };
    let noise = |upper: bool| {
        let own = (densities.iter().zip(frequencies))
            .filter(|(_, f)| (**f >= UPPER * last) == upper)
            .map(|(d, f)| d.slope / (f * f));
        robust::median(own)
    };
    let coherent = robust::median(densities.iter().map(Density::coherence));
    matches!((noise(false), noise(true)), (Some(lower), Some(upper)) if upper > EVEN * lower)
        && coherent.is_some_and(|share| share > MADE_OF)
}

/// The last frequency at which a channel shows motion: noise does not fall with the frequency, so that it is no more than what
/// usually comes next.
fn last_shown(densities: &[Density], of: impl Fn(&Density) -> f64) -> usize {
    let densities: Vec<f64> = densities.iter().map(of).collect();
    let shows = |&n: &usize| {
        let first = (n + BEYOND).min(densities.len().saturating_sub(BEYOND));
        let next = densities[first..].iter().take(COMPARED).copied();
        densities[n] > SHOWS * robust::median(next).unwrap_or(0.0)
    };
    (0..densities.len()).rev().find(shows).unwrap_or(0)
}

/// Noise of the position of a joint that hardly moves, rad, from third differences of evenly timed samples, whose variance is
/// twenty times a sample's.
fn standing(stretches: &[Stretch], fast: f64) -> f64 {
    const SLOW: f64 = 0.1;
    let mut differences = Vec::new();
    // Where messages are lost the usual time between samples is less than the mean.
    let steps = stretches.iter().flat_map(|s| s.t.windows(2));
    let period = robust::median(steps.map(|pair| pair[1] - pair[0])).unwrap_or(0.0);
    for s in stretches {
        for k in 3..s.t.len() {
            let even = (k - 2..=k).all(|i| ((s.t[i] - s.t[i - 1]) - period).abs() < 0.1 * period);
            let speed = (s.q[k] - s.q[k - 3]).abs() / (s.t[k] - s.t[k - 3]);
            if even && speed < SLOW * fast {
                differences.push(s.q[k] - 3.0 * s.q[k - 1] + 3.0 * s.q[k - 2] - s.q[k - 3]);
            }
        }
    }
    // Third differences of noise have 20 times its variance.
    robust::scale(differences).unwrap_or(0.0) / 20f64.sqrt()
}

/// What rounding leaves of a position that is reported in steps, rad: a step over √12; zero where there are no steps. The encoder of
/// a joint that friction holds repeats one number, and is no surer of it.
fn rounding(stretches: &[Stretch]) -> f64 {
    let mut steps = Differences::new();
    for s in stretches {
        s.q.windows(2).for_each(|q| steps.push(q[1] - q[0]));
    }
    steps.quantum().unwrap_or(0.0) / 12f64.sqrt()
}

/// By how much the reported velocity is off the true one, as a share of it, as far as that is sure: its integral over spans of time that jitter of their
/// ends hardly matters to, against what the positions changed by.
///
/// Noise of either channel in both factors of a product would be taken for a scale: a step of an encoder is most of what a joint moves by in a few
/// samples at kilohertz. So the integral's square is the product of two integrals, of every second sample each, and the positions enter once (method of
/// instrumental variables; Söderström & Stoica 1983).
fn scale_error(stretches: &[Stretch], period: f64) -> f64 {
    /// Samples, and s, of a span at least.
    const SAMPLES: f64 = 10.0;
    const SPAN: f64 = 0.02;
    let span = SPAN.max(SAMPLES * period);
    let mut spans: Vec<[f64; 3]> = Vec::new();
    for s in stretches {
        let (mut first, mut even, mut odd) = (0, 0.0, 0.0);
        for k in (2..s.t.len()).step_by(2) {
            let step = s.t[k] - s.t[k - 2];
            even += 0.5 * (s.dq[k - 2] + s.dq[k]) * step;
            odd += s.dq[k - 1] * step;
            if s.t[k] - s.t[first] >= span {
                spans.push([even, odd, s.q[k] - s.q[first]]);
                (first, even, odd) = (k, 0.0, 0.0);
            }
        }
    }
    let mean = |[even, odd, _]: &[f64; 3]| 0.5 * (even + odd);
    let square: f64 = spans.iter().map(|[even, odd, _]| even * odd).sum();
    let both: f64 = spans.iter().map(|span| mean(span) * span[2]).sum();
    if both <= 0.0 {
        return 0.0;
    }
    let scale = square / both;
    let left = |span: &[f64; 3]| mean(span) * (mean(span) - scale * span[2]);
    let error = spans
        .iter()
        .map(|span| left(span).powi(2))
        .sum::<f64>()
        .sqrt()
        / both;
    (scale - 1.0).signum() * ((scale - 1.0).abs() - SURE_OF_SCALE * error).max(0.0)
}

/// Densities at the frequencies over all stretches of [`LENGTH`], how many these are, and the sum of their squared windows.
fn densities(
    stretches: &[Stretch],
    frequencies: &[f64],
    period: f64,
) -> (Vec<Density>, usize, f64) {
    let mut sums = vec![Density::default(); frequencies.len()];
    let mut looks = 0;
    let per = ((LENGTH.min(usual_length(stretches)) / period) as usize)
        .saturating_sub(4)
        .max(LEAST_SAMPLES);
    let hann = |k: usize| 0.5 * (1.0 - (std::f64::consts::TAU * k as f64 / per as f64).cos());
    let window: Vec<f64> = (0..per).map(hann).collect();
    for s in stretches.iter().filter(|s| s.t.len() > 4) {
        let velocity = even(s.t, s.dq, period);
        let position = even(s.t, s.q, period);
        let slope: Vec<f64> =
            (position.windows(3).map(|q| (q[2] - q[0]) / (2.0 * period))).collect();
        // A slope stands for the sample in the middle.
        for begin in (0..(slope.len() + 1).saturating_sub(per)).step_by(per / 2) {
            let channels = [&velocity[begin + 1..][..per], &slope[begin..][..per]];
            add(&mut sums, frequencies, channels, &window, period);
            looks += 1;
        }
    }
    let weight: f64 = window.iter().map(|w| w.powi(2)).sum();
    (sums, looks, looks as f64 * weight)
}

/// The length that half of the time's stretches have at least, s: where gaps leave none as long as [`LENGTH`], frequencies are told
/// less apart, but by what the joint did most of the time.
fn usual_length(stretches: &[Stretch]) -> f64 {
    let mut lengths: Vec<f64> = (stretches.iter())
        .filter_map(|s| Some(s.t.last()? - s.t.first()?))
        .collect();
    lengths.sort_unstable_by(|a, b| b.total_cmp(a));
    let half = 0.5 * lengths.iter().sum::<f64>();
    let mut sum = 0.0;
    let usual = lengths.into_iter().find(|length| {
        sum += length;
        sum >= half
    });
    usual.unwrap_or(0.0)
}

/// A channel at even times by cubics through its samples: of uneven samples taken as even, a strong motion would leave noise at all
/// frequencies.
fn even(t: &[f64], x: &[f64], period: f64) -> Vec<f64> {
    let last = t.len() - 1;
    let slope = |k: usize| match k {
        0 => (x[1] - x[0]) / (t[1] - t[0]),
        k if k == last => (x[k] - x[k - 1]) / (t[k] - t[k - 1]),
        k => {
            let (before, after) = (t[k] - t[k - 1], t[k + 1] - t[k]);
            let (came, goes) = ((x[k] - x[k - 1]) / before, (x[k + 1] - x[k]) / after);
            (after * came + before * goes) / (before + after)
        }
    };
    let count = ((t[last] - t[0]) / period) as usize + 1;
    let mut k = 0;
    let mut at = |n: usize| {
        let now = t[0] + n as f64 * period;
        while k + 1 < last && t[k + 1] <= now {
            k += 1;
        }
        let h = t[k + 1] - t[k];
        let s = ((now - t[k]) / h).clamp(0.0, 1.0);
        let (rise, fall) = (s * s * (3.0 - 2.0 * s), (1.0 - s) * (1.0 - s));
        x[k] * (1.0 - rise)
            + x[k + 1] * rise
            + h * s * (fall * slope(k) - s * (1.0 - s) * slope(k + 1))
    };
    (0..count).map(&mut at).collect()
}

/// Adds one stretch of even samples of a velocity and a slope.
fn add(
    sums: &mut [Density],
    frequencies: &[f64],
    [velocity, slope]: [&[f64]; 2],
    window: &[f64],
    period: f64,
) {
    let weighed: Vec<[f64; 2]> = (0..velocity.len())
        .map(|k| [window[k] * velocity[k], window[k] * slope[k]])
        .collect();
    let groups = sums.chunks_mut(LANES).zip(frequencies.chunks(LANES));
    for (sums, frequencies) in groups {
        let mut steps = [0.0; LANES];
        for (step, frequency) in steps.iter_mut().zip(frequencies) {
            *step = std::f64::consts::TAU * frequency * period;
        }
        let parts = transformed(&weighed, &steps);
        for ((sum, step), [vc, vs, dc, ds]) in sums.iter_mut().zip(steps).zip(parts) {
            // A slope between three samples passes a frequency as a sinc.
            let passed = step.sin() / step;
            sum.velocity += vc * vc + vs * vs;
            sum.slope += (dc * dc + ds * ds) / (passed * passed);
            sum.both[0] += (vc * dc + vs * ds) / passed;
            sum.both[1] += (vs * dc - vc * ds) / passed;
        }
    }
}

/// Σ x cos, Σ x sin of both channels at angles that grow by each of the steps from sample to sample: each angle's sine and cosine come
/// from those of the one before, of all steps side by side, which over a stretch loses no more than three of sixteen digits.
fn transformed(channels: &[[f64; 2]], steps: &[f64; LANES]) -> [[f64; 4]; LANES] {
    let turn = steps.map(f64::sin_cos);
    let (mut sin, mut cos) = ([0.0; LANES], [1.0; LANES]);
    let mut sums = [[0.0; LANES]; 4];
    for &[velocity, slope] in channels {
        for n in 0..LANES {
            sums[0][n] += velocity * cos[n];
            sums[1][n] += velocity * sin[n];
            sums[2][n] += slope * cos[n];
            sums[3][n] += slope * sin[n];
            let (s, c) = turn[n];
            (sin[n], cos[n]) = (sin[n] * c + cos[n] * s, cos[n] * c - sin[n] * s);
        }
    }
    std::array::from_fn(|n| sums.map(|sum| sum[n]))
}

/// Means over neighbouring frequencies.
fn averaged(densities: &[Density]) -> Vec<Density> {
    let half = AVERAGED / 2;
    let mean = |n: usize| {
        let near = &densities[n.saturating_sub(half)..(n + half + 1).min(densities.len())];
        let count = near.len() as f64;
        let sum = |of: &dyn Fn(&Density) -> f64| near.iter().map(of).sum::<f64>() / count;
        Density {
            velocity: sum(&|d| d.velocity),
            slope: sum(&|d| d.slope),
            both: [sum(&|d| d.both[0]), sum(&|d| d.both[1])],
        }
    };
    (0..densities.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::{Stretch, scale_error};

    /// Twenty seconds of a joint with an encoder of 4096 counts a turn, whose velocity reads `scale` times the true one and has noise, rad/s.
    fn told(rate: f64, scale: f64, noise: f64) -> f64 {
        let count = TAU / 4096.0;
        let t: Vec<f64> = (0..(20.0 * rate) as usize)
            .map(|k| k as f64 / rate)
            .collect();
        let q = |t: f64| 0.8 * (1.3 * t).sin() + 0.1 * (7.1 * t).sin();
        let dq = |t: f64| 1.04 * (1.3 * t).cos() + 0.71 * (7.1 * t).cos();
        let mut random = 7u64;
        let mut uniform = || {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let positions: Vec<f64> = t.iter().map(|t| count * (q(*t) / count).round()).collect();
        let velocities: Vec<f64> = (t.iter())
            .map(|t| scale * dq(*t) + 12f64.sqrt() * noise * uniform())
            .collect();
        let stretch = Stretch {
            t: &t,
            q: &positions,
            dq: &velocities,
        };
        scale_error(&[stretch], 1.0 / rate)
    }

    /// A step of the encoder, noise of the velocity and the rate make no scale; one that is there is found.
    #[test]
    fn the_scale_of_a_velocity_is_neither_steps_nor_noise() {
        for rate in [100.0, 250.0, 500.0, 1000.0, 5000.0] {
            for noise in [0.001, 0.1] {
                let [good, high, low] = [1.0, 1.08, 0.97].map(|scale| told(rate, scale, noise));
                assert!(good.abs() < 5e-4, "{rate} Hz, {noise} rad/s: {good}");
                let off = (high - 0.08).abs().max((low + 0.03).abs());
                assert!(off < 0.01, "{rate} Hz, {noise} rad/s: {high} {low}");
            }
        }
    }
}
