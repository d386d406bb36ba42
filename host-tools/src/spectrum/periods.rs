//! The period of a log, and the stretches of it that are periodic.

use realfft::RealFftPlanner;

use super::error::FrfError;
use super::record::Record;
use crate::parallel::by_number;

/// The least autocorrelation at a shift of one period. Of P equal periods in a row that differ from what follows it is (P − 1)/P: two are
/// 0.5, three 0.67.
const LEAST_CORRELATION: f64 = 0.5;
/// Shifts that are tried, the shortest first: peaks within a period that lines at nearly equal distances have are fewer.
const MOST_TRIED: usize = 200;
/// By how much of its energy a reference may differ from itself one period later: rounding in a text file alone.
const REFERENCE_TOLERANCE: f64 = 1e-6;
/// The same of what was measured: noise at a tenth of the signal's power.
const MEASURED_TOLERANCE: f64 = 0.1;
/// What is below this share of the loudest period's energy is a pause.
const PAUSE: f64 = 1e-3;

/// Equal periods in a row: one experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stretch {
    /// Its first sample.
    pub(super) first: usize,
    /// How many whole periods.
    pub(super) periods: usize,
}

/// The period of a record in samples, and its periodic stretches of three periods or more.
///
/// # Errors
/// [`FrfError::NoPeriod`], [`FrfError::FewPeriods`].
pub(super) fn stretches(record: &Record) -> Result<(usize, Vec<Stretch>), FrfError> {
    let (signals, name, tolerance) = if record.reference.is_empty() {
        (&record.torque, "the torque", MEASURED_TOLERANCE)
    } else {
        (&record.reference, "the reference", REFERENCE_TOLERANCE)
    };
    let centred: Vec<Vec<f64>> = signals.iter().map(|x| centred(x)).collect();
    let candidates = periods(&centred).map_err(|correlation| FrfError::NoPeriod {
        path: record.path.clone(),
        signal: name,
        correlation,
    })?;
    // Lines at equal distances resemble themselves after the inverse of that, nearly: a period is what repeats itself.
    let (mut longest, mut first) = (0, None);
    for &period in candidates.iter().take(MOST_TRIED) {
        let all = repeated(&centred, period, tolerance);
        longest = longest.max(all.iter().map(|s| s.periods).max().unwrap_or(0));
        let long: Vec<Stretch> = all.into_iter().filter(|s| s.periods >= 3).collect();
        if !long.is_empty() {
            return Ok((period, long));
        }
        first = first.or(Some(period));
    }
    Err(FrfError::FewPeriods {
        path: record.path.clone(),
        periods: longest,
        seconds: first.unwrap_or(0) as f64 * record.dt,
    })
}

fn centred(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter().map(|x| x - mean).collect()
}

/// Shifts at which signals resemble themselves, in samples, the shortest first; or the best correlation, if none is good enough.
fn periods(signals: &[Vec<f64>]) -> Result<Vec<usize>, f64> {
    let correlation = autocorrelation(signals);
    // Beyond the main lobe, whose width says nothing of a period.
    let Some(lobe) = correlation.iter().position(|c| *c < 0.0) else {
        return Err(0.0);
    };
    let best = correlation[lobe..].iter().copied().fold(0.0, f64::max);
    if best < LEAST_CORRELATION {
        return Err(best);
    }
    let is_peak = |lag: &usize| {
        let beside = |other: Option<&f64>| other.is_none_or(|c| *c <= correlation[*lag]);
        correlation[*lag] >= LEAST_CORRELATION
            && beside(correlation.get(lag + 1))
            && beside(correlation.get(lag - 1))
    };
    Ok((lobe.max(1)..correlation.len()).filter(is_peak).collect())
}

/// Autocorrelation of all signals together at shifts of up to half their length, 1 at none; by the spectrum, padded.
fn autocorrelation(signals: &[Vec<f64>]) -> Vec<f64> {
    let length = signals.first().map_or(0, Vec::len);
    if length < 4 {
        return Vec::new();
    }
    // Shifts of up to half the length do not meet what wraps around; a length of small factors is transformed several times faster than one of large.
    let wanted = length + length / 2;
    let padded_length = [1, 3, 5, 9, 15]
        .map(|odd| odd * wanted.div_ceil(odd).next_power_of_two())
        .into_iter()
        .fold(usize::MAX, usize::min);
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = &*planner.plan_fft_forward(padded_length);
    let back = planner.plan_fft_inverse(padded_length);
    let spectrum = |n: usize| {
        let mut padded = signals[n].clone();
        padded.resize(padded_length, 0.0);
        let mut spectrum = forward.make_output_vec();
        forward.process(&mut padded, &mut spectrum).ok()?;
        Some(spectrum)
    };
    let mut power = back.make_input_vec();
    for spectrum in by_number(0..signals.len(), spectrum) {
        let Some(spectrum) = spectrum else {
            return Vec::new();
        };
        for (sum, value) in power.iter_mut().zip(&spectrum) {
            *sum += value.norm_sqr();
        }
    }
    let mut out = back.make_output_vec();
    if back.process(&mut power, &mut out).is_err() {
        return Vec::new();
    }
    let all = out[0];
    let share = |(lag, c): (usize, &f64)| c / all * length as f64 / (length - lag) as f64;
    let half = out[..length / 2].iter().enumerate();
    half.map(share).collect()
}

/// Where signals repeat themselves after `period` samples.
fn repeated(signals: &[Vec<f64>], period: usize, tolerance: f64) -> Vec<Stretch> {
    let length = signals.first().map_or(0, Vec::len);
    if length < 2 * period || period == 0 {
        return Vec::new();
    }
    // Running sums of squares of the difference and of the signal.
    let sums = |of: &dyn Fn(usize) -> f64, count: usize| {
        let mut total = 0.0;
        let mut sums = vec![0.0];
        sums.extend((0..count).map(|k| {
            total += of(k);
            total
        }));
        sums
    };
    let over = |of: &dyn Fn(&[f64]) -> f64| signals.iter().map(|x| of(x)).sum::<f64>();
    let apart = |k: usize| over(&|x| (x[k + period] - x[k]).powi(2));
    let differences = sums(&apart, length - period);
    let energies = sums(&|k| over(&|x| x[k] * x[k]), length);
    let count = length - 2 * period + 1;
    let energy = |k: usize| energies[k + period] - energies[k];
    let loudest = (0..count).map(energy).fold(0.0, f64::max);
    let same = |k: usize| {
        let difference = differences[k + period] - differences[k];
        energy(k) > PAUSE * loudest && difference <= tolerance * energy(k)
    };
    let mut found = Vec::new();
    let mut k = 0;
    while k < count {
        if !same(k) {
            k += 1;
            continue;
        }
        let first = k;
        while k < count && same(k) {
            k += 1;
        }
        found.push(Stretch {
            first,
            periods: (k - 1 - first) / period + 2,
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines 3, 5 and 8 of a period, with phases of their own.
    fn multisine(length: usize, period: usize, seed: f64) -> Vec<f64> {
        let at = |k: usize, line: f64| {
            (std::f64::consts::TAU * line * k as f64 / period as f64 + seed * line * line).sin()
        };
        let sum = |k: usize| at(k, 3.0) + at(k, 5.0) + at(k, 8.0);
        (0..length).map(sum).collect()
    }

    #[test]
    fn the_shortest_period_is_found_whatever_its_length() {
        let found = |signal: &[Vec<f64>]| {
            let repeats = |period: &usize| {
                let all = repeated(signal, *period, REFERENCE_TOLERANCE);
                all.iter().any(|s| s.periods >= 3)
            };
            periods(signal).unwrap().into_iter().find(repeats)
        };
        for length in [64, 97, 250] {
            let signal = centred(&multisine(7 * length + 13, length, 0.7));
            assert_eq!(found(&[signal]), Some(length));
        }
    }

    #[test]
    fn experiments_in_one_log_are_separated() {
        let mut signal = multisine(400, 100, 0.7);
        signal.extend([0.0; 57]);
        signal.extend(multisine(500, 100, 2.3));
        let signal = vec![signal];
        let of = |length: &usize| (*length, repeated(&signal, *length, REFERENCE_TOLERANCE));
        let all = periods(&signal).unwrap();
        let (length, found) = all.iter().map(of).find(|(_, own)| !own.is_empty()).unwrap();
        let expected = [(0, 4), (457, 5)].map(|(first, periods)| Stretch { first, periods });
        assert_eq!((length, &found[..]), (100, &expected[..]));
    }

    #[test]
    fn noise_has_no_period() {
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let signal: Vec<f64> = (0..1000).map(|_| noise()).collect();
        assert!(periods(&[signal]).is_err());
    }
}
