//! What of a series is a wave of a joint's position, whatever its length: the ripple of teeth and magnets, and friction that comes and goes with
//! position.
//!
//! The least-squares periodogram over unevenly spaced positions (Lomb 1976, *Astrophysics and Space Science* 39:447), of the series and of the series
//! times the direction of motion.

use std::f64::consts::{PI, TAU};

use nalgebra::{Cholesky, Matrix2, U2, Vector2};

use crate::estimate::limb_data::LimbData;

/// Twice the logarithm of the chance that the strongest of one wave number's phases is white noise: with some hundred wave numbers and joints of a robot
/// one in ten thousand robots has one.
const SURE: f64 = 32.0;
/// A wave is sought among so large a share of the windows at least: those that travel least.
const SLOW: f64 = 0.2;
/// Wave numbers that are tried at most.
const MOST: usize = 1024;
/// Steps of the wave number in the width of a peak, which is 2π over the range of motion.
const STEPS: f64 = 4.0;
/// Parts of a step, when a peak is sought.
const PARTS: i32 = 8;

/// What a window is to a wave.
struct Window {
    /// How far the joint travels meanwhile, and where it is on average, from where it came lowest.
    travel: f64,
    q: f64,
    /// Mean sign of its velocity.
    sign: f64,
    /// What is left of its torque.
    left: f64,
}

/// A wave, and how sure it is, in the unit of [`SURE`].
#[derive(Clone, Copy, Default)]
struct Peak {
    wave: f64,
    sure: f64,
}

/// The strongest wave of position in what is left of a joint in these windows, beyond what noise makes of it: its two phases, window by window, of unit
/// size.
pub(super) fn strongest(
    data: &LimbData,
    joint: usize,
    windows: &[usize],
    left: &[f64],
) -> Option<[Vec<f64>; 2]> {
    let motion = &data.motion;
    let q = |k: usize| motion.joint[joint].state[k][0];
    let sign = |k: usize| motion.sign(k, joint);
    let mean = |w: usize, of: &dyn Fn(usize) -> f64| motion.mean(&motion.windows[w], of);
    let mut own: Vec<Window> = (windows.iter().zip(left))
        .map(|(&w, &left)| {
            let [first, last] = motion.windows[w].samples;
            Window {
                travel: (q(last) - q(first)).abs(),
                q: mean(w, &q),
                sign: mean(w, &sign),
                left,
            }
        })
        .collect();
    own.sort_unstable_by(|a, b| a.travel.total_cmp(&b.travel));
    let range = |[low, high]: [f64; 2], w: &Window| [low.min(w.q), high.max(w.q)];
    let [low, high] = own.iter().fold([f64::INFINITY, f64::NEG_INFINITY], range);
    own.iter_mut().for_each(|w| w.q -= low);
    let [plain, turning] = peaks(&own, high - low)?;
    let turns = turning.sure > plain.sure;
    let peak = if turns { turning } else { plain };
    (peak.sure > SURE).then_some(())?;
    let phase = |of: fn(f64) -> f64| {
        let sign = |k: usize| if turns { sign(k) } else { 1.0 };
        let at = |k: usize| sign(k) * of(peak.wave * (q(k) - low));
        windows.iter().map(|&w| mean(w, &at)).collect()
    };
    Some([phase(f64::sin), phase(f64::cos)])
}

/// The strongest wave of windows in the order of their travel, and the strongest that changes its sign with the direction of motion.
fn peaks(windows: &[Window], range: f64) -> Option<[Peak; 2]> {
    let step = TAU / (STEPS * range);
    let least = windows.get((SLOW * windows.len() as f64) as usize)?.travel;
    let count = (PI / (least * step)).min(MOST as f64);
    if !step.is_finite() || count.is_nan() {
        return None;
    }
    // Within a window that travels over half of a wave it is a blur.
    let sharp = |wave: f64| windows.partition_point(|w| w.travel * wave < PI);
    let mut peaks = [Peak::default(); 2];
    let better = |peaks: &mut [Peak; 2], wave: f64, phases: &[[f64; 2]]| {
        for (peak, sure) in peaks
            .iter_mut()
            .zip(explained(&windows[..phases.len()], phases))
        {
            if sure > peak.sure {
                *peak = Peak { wave, sure };
            }
        }
    };
    let phases = |wave: f64| -> Vec<[f64; 2]> {
        let sharp = windows[..sharp(wave)].iter();
        sharp.map(|w| (wave * w.q).sin_cos().into()).collect()
    };
    let turns = phases(step);
    let mut turned = turns.clone();
    for n in 1..=count as usize {
        let wave = n as f64 * step;
        turned.truncate(sharp(wave));
        better(&mut peaks, wave, &turned);
        for ([sin, cos], [by_sin, by_cos]) in turned.iter_mut().zip(&turns) {
            [*sin, *cos] = [*sin * by_cos + *cos * by_sin, *cos * by_cos - *sin * by_sin];
        }
    }
    // Most series have none, and need no closer look.
    for about in peaks.map(|peak| peak.wave) {
        if peaks.iter().any(|peak| peak.sure > SURE) {
            for part in 1 - PARTS..PARTS {
                let wave = about + step * f64::from(part) / f64::from(PARTS);
                better(&mut peaks, wave, &phases(wave));
            }
        }
    }
    Some(peaks)
}

/// What a wave of both phases takes away of the squares of what is left in windows, in units of their mean; and the same where it changes its sign with
/// the direction of motion.
fn explained(windows: &[Window], phases: &[[f64; 2]]) -> [f64; 2] {
    let mut products = [Matrix2::zeros(); 2];
    let mut moments = [Vector2::zeros(); 2];
    let mut square = 0.0;
    for (window, phases) in windows.iter().zip(phases) {
        for (n, weight) in [1.0, window.sign].into_iter().enumerate() {
            let phases = Vector2::from(*phases) * weight;
            products[n] += phases * phases.transpose();
            moments[n] += phases * window.left;
        }
        square += window.left * window.left;
    }
    let mean = (square / windows.len().max(1) as f64).max(f64::MIN_POSITIVE);
    std::array::from_fn(|n| {
        // Positions at one place of the wave alone tell one phase.
        let taken = |cholesky: Cholesky<f64, U2>| moments[n].dot(&cholesky.solve(&moments[n]));
        products[n].cholesky().map_or(0.0, taken) / mean
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that swings over a radian, 900 windows, with a little noise (a linear congruential generator's) and what is hidden.
    fn swung(hidden: impl Fn(f64, f64) -> f64) -> [Peak; 2] {
        let mut random = 1u64;
        let mut windows: Vec<Window> = (0..900)
            .map(|n| {
                let t = f64::from(n) * 0.02;
                let q = |t: f64| 0.5 + 0.3 * (4.1 * t).sin() + 0.2 * (7.3 * t + 1.0).cos();
                random = random
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                let noise = (random >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
                let sign = (q(t + 1e-3) - q(t - 1e-3)).signum();
                Window {
                    travel: (q(t + 0.01) - q(t - 0.01)).abs(),
                    q: q(t),
                    sign,
                    left: 0.02 * noise + hidden(q(t), sign),
                }
            })
            .collect();
        windows.sort_unstable_by(|a, b| a.travel.total_cmp(&b.travel));
        peaks(&windows, 1.0).unwrap()
    }

    #[test]
    fn a_wave_is_found_whatever_its_length() {
        for wave in [5.0, 21.0, 60.0, 133.7] {
            let [plain, turning] = swung(|q, _| 0.01 * (wave * q + 0.4).sin());
            assert!(
                plain.sure > 2.0 * SURE && plain.sure > turning.sure,
                "{wave}: {}",
                plain.sure
            );
            assert!((plain.wave - wave).abs() < 0.5, "{wave}: {}", plain.wave);
            let [plain, turning] = swung(|q, sign| 0.01 * sign * (wave * q + 0.4).sin());
            assert!(
                turning.sure > 2.0 * SURE && turning.sure > plain.sure,
                "{wave}: {}",
                turning.sure
            );
            assert!(
                (turning.wave - wave).abs() < 0.5,
                "{wave}: {}",
                turning.wave
            );
        }
    }

    #[test]
    fn noise_has_none() {
        let [plain, turning] = swung(|_, _| 0.0);
        assert!(
            plain.sure.max(turning.sure) < SURE,
            "{} {}",
            plain.sure,
            turning.sure
        );
    }

    #[test]
    fn a_joint_that_rests_has_none() {
        let rest = |_| Window {
            travel: 0.0,
            q: 0.0,
            sign: 0.0,
            left: 1.0,
        };
        let windows: Vec<Window> = (0..9).map(rest).collect();
        assert!(peaks(&windows, 0.0).is_none_or(|peaks| peaks.iter().all(|peak| peak.sure < SURE)));
        assert!(peaks(&[], 1.0).is_none());
    }
}
