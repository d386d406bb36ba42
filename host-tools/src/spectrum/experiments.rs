//! Experiments: the spectra of a stretch's periods, transients left out.

use realfft::num_complex::Complex64;
use realfft::{RealFftPlanner, RealToComplex};

use super::error::FrfError;
use super::friction::{Drive, dry_friction};
use super::periods::{Stretch, stretches};
use super::record::{Record, TorqueUnit};
use crate::parallel::by_number;
use crate::robust::{median, quantile};

/// A line counts as excited from this share of the largest amplitude.
const EXCITED: f64 = 0.05;
/// Excited lines that a fit needs: twice the parameters of one elastic joint.
pub(crate) const LEAST_LINES: usize = 12;
/// An alias is recognised by its velocity, which is that of the line itself: it exceeds what the position's line has by this factor. A line beyond half the
/// sampling rate whose alias is below [`HIGHEST`] of that is 1.5 times as high as the alias or more; velocities read too high by 11 % at most on real drives.
const ALIAS: f64 = 1.3;
/// Lines beyond this share of the Nyquist frequency are refused: the hold's own zero and aliases rule there.
pub(crate) const HIGHEST: f64 = 0.8;
/// A period whose distance from the later ones exceeds theirs by this factor is transient still.
const TRANSIENT: f64 = 4.0;
/// By how much of its swing a mean may drift during an experiment.
const DRIFT: f64 = 0.25;
/// A joint is at rest below this share of its greatest speed; a sum of many sines is so for 3 % of the time.
const REST: f64 = 0.01;
/// A step between two samples that is so many times what 99 of 100 steps are below is no motion: a sum of many sines has three times at most,
/// Gaussian noise of the position twice.
const LEAP: f64 = 10.0;
/// The share of time at rest from which on a joint is said to stick.
const STUCK: f64 = 0.5;

/// Instants of a period at which the model's matrices are averaged: the slow motion has one or two cycles.
const PATH: usize = 16;

/// By period, joint and line.
pub(super) type Spectra = Vec<Vec<Vec<Complex64>>>;

/// One experiment: equal periods at one point.
pub(super) struct Experiment {
    /// Mean position of each joint, rad or m.
    pub(super) point: Vec<f64>,
    /// Positions of all joints at some instants of a period, evenly spaced.
    pub(super) path: Vec<Vec<f64>>,
    /// The motion within it, peak to peak, of each joint.
    pub(super) swing: Vec<f64>,
    /// Position at the excited lines.
    pub(super) q: Spectra,
    /// Torque there, without dry friction.
    pub(super) torque: Spectra,
    /// The dry friction.
    friction: Spectra,
    /// The link's encoder there, or empty.
    pub(super) link: Spectra,
    /// Position at lines within the band that nothing excites: even and odd ones, mean over periods, of each joint.
    pub(super) detection: [Vec<Vec<Complex64>>; 2],
    /// Periods left out at its beginning.
    pub(super) transient: usize,
}

/// All experiments of some logs.
pub(super) struct Experiments {
    /// The joints' names.
    pub(super) joints: Vec<String>,
    /// What the torque is in.
    pub(super) unit: TorqueUnit,
    /// Sampling period, s.
    pub(super) dt: f64,
    /// Samples of a period.
    pub(super) period: usize,
    /// The excited lines: multiples of 1/period.
    pub(super) lines: Vec<usize>,
    /// Whether the excitation is recorded.
    pub(super) has_reference: bool,
    /// In the order of the logs.
    pub(super) all: Vec<Experiment>,
}

impl Experiments {
    /// Finds them in logs; dry friction of the `drives` is subtracted from the torque.
    ///
    /// # Errors
    /// If logs have no period, too few of them, lines too high, or joints that stick or drift.
    pub(super) fn find(records: &[Record], drives: &[Drive]) -> Result<Self, FrfError> {
        let first = &records[0];
        let mut found: Vec<(usize, Vec<Stretch>)> = Vec::new();
        for record in records {
            found.push(stretches(record)?);
        }
        let period = found[0].0;
        for (record, (own, _)) in records.iter().zip(&found) {
            let differs = |what: String| FrfError::Differs {
                path: record.path.clone(),
                what,
            };
            if record.joints != first.joints || record.unit != first.unit {
                return Err(differs(
                    "other joints or another unit of torque than in the first log".to_owned(),
                ));
            }
            if *own != period || (record.dt - first.dt).abs() > 1e-3 * first.dt {
                return Err(differs(format!(
                    "a period of {:.4} s where the first log's is {:.4} s",
                    *own as f64 * record.dt,
                    period as f64 * first.dt
                )));
            }
        }
        let plan = &*RealFftPlanner::<f64>::new().plan_fft_forward(period);
        let lines = excited(records, &found, plan)?;
        for (record, (_, stretches)) in records.iter().zip(&found) {
            fits_velocity(record, stretches[0], plan, &lines)?;
        }
        let mut all = Vec::new();
        for (record, (_, stretches)) in records.iter().zip(&found) {
            let friction = dry_friction(record, drives);
            let of = |n: usize| experiment(record, &friction, stretches[n], plan, &lines);
            for own in by_number(0..stretches.len(), of) {
                all.push(own?);
            }
        }
        let mut found = Self {
            joints: first.joints.clone(),
            unit: first.unit,
            dt: first.dt,
            period,
            lines,
            has_reference: records.iter().all(|r| !r.reference.is_empty()),
            all,
        };
        found.give_back(-1.0);
        Ok(found)
    }

    /// Gives a share of the dry friction back to the torque: what would have been measured of drives with less of it.
    pub(super) fn give_back(&mut self, share: f64) {
        for own in &mut self.all {
            let lines = own.torque.iter_mut().zip(&own.friction);
            let lines = lines.flat_map(|(to, from)| to.iter_mut().zip(from));
            for (to, from) in lines.flat_map(|(to, from)| to.iter_mut().zip(from)) {
                *to += share * from;
            }
        }
    }

    /// The excited frequencies, Hz.
    pub(super) fn frequencies(&self) -> Vec<f64> {
        let base = 1.0 / (self.period as f64 * self.dt);
        self.lines.iter().map(|line| *line as f64 * base).collect()
    }
}

/// The lines that are excited, by the reference or else the torque.
fn excited(
    records: &[Record],
    found: &[(usize, Vec<Stretch>)],
    plan: &dyn RealToComplex<f64>,
) -> Result<Vec<usize>, FrfError> {
    let period = plan.len();
    let mut power = vec![0.0; period / 2 + 1];
    for (record, (_, stretches)) in records.iter().zip(found) {
        let signals = if record.reference.is_empty() {
            &record.torque
        } else {
            &record.reference
        };
        for stretch in stretches {
            let last = stretch.first + (stretch.periods - 1) * period;
            for signal in signals {
                let spectrum = transform(plan, &signal[last..last + period], 0.0);
                for (sum, value) in power.iter_mut().zip(&spectrum).skip(1) {
                    *sum += value.norm_sqr();
                }
            }
        }
    }
    let largest = power.iter().copied().fold(0.0, f64::max);
    let is_excited = |line: &usize| power[*line] > EXCITED * EXCITED * largest;
    let lines: Vec<usize> = (1..power.len()).filter(is_excited).collect();
    let path = || records[0].path.clone();
    let seconds = period as f64 * records[0].dt;
    let limit = HIGHEST * 0.5 / records[0].dt;
    let highest = lines.last().map_or(0.0, |line| *line as f64 / seconds);
    if highest > limit {
        return Err(FrfError::BeyondNyquist {
            path: path(),
            highest,
            limit,
        });
    }
    if lines.len() < LEAST_LINES {
        return Err(FrfError::FewLines {
            path: path(),
            lines: lines.len(),
            needed: LEAST_LINES,
        });
    }
    Ok(lines)
}

/// Refuses lines that are aliases, and degrees: the velocity, where it is recorded, is of another frequency than the position, or 180/π times as large or as
/// small as in rad.
fn fits_velocity(
    record: &Record,
    stretch: Stretch,
    plan: &dyn RealToComplex<f64>,
    lines: &[usize],
) -> Result<(), FrfError> {
    let last = stretch.first + (stretch.periods - 1) * plan.len();
    let seconds = plan.len() as f64 * record.dt;
    for ((q, dq), joint) in record.q.iter().zip(&record.dq).zip(&record.joints) {
        let [q, dq] = [q, dq].map(|x| transform(plan, &x[last..last + plan.len()], 0.0));
        let hertz = |line: usize| dq[line].norm() / q[line].norm() / std::f64::consts::TAU;
        let higher = lines.iter().map(|&l| hertz(l) * seconds / l as f64);
        // Of most lines: noise of the velocity exceeds small positions at some.
        let Some(share) = median(higher) else {
            continue;
        };
        for (column, factor) in [("q", share.recip()), ("dq", share)] {
            if (factor.to_radians().ln()).abs() < ALIAS.ln() {
                return Err(FrfError::Degrees {
                    columns: format!("{}: `{column}/{joint}` is", record.path.display()),
                    cause: format!(
                        "it is {factor:.1} times what the other of position and velocity says at most lines"
                    ),
                });
            }
        }
        if share > ALIAS {
            let line = lines[lines.len() / 2];
            return Err(FrfError::Aliased {
                path: record.path.clone(),
                joint: joint.clone(),
                f: line as f64 / seconds,
                velocity: hertz(line),
            });
        }
    }
    Ok(())
}

/// Amplitudes of a period's lines, a trend of so much per sample taken out first.
fn transform(plan: &dyn RealToComplex<f64>, period: &[f64], slope: f64) -> Vec<Complex64> {
    let mut input: Vec<f64> = (period.iter().enumerate())
        .map(|(k, x)| x - slope * k as f64)
        .collect();
    let mut output = plan.make_output_vec();
    // Fails for lengths that differ from the plan's alone.
    if plan.process(&mut input, &mut output).is_err() {
        return output;
    }
    let scale = 2.0 / period.len() as f64;
    output.iter().map(|x| x * scale).collect()
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// The spectra of a stretch.
fn experiment(
    record: &Record,
    friction: &[Vec<f64>],
    stretch: Stretch,
    plan: &dyn RealToComplex<f64>,
    lines: &[usize],
) -> Result<Experiment, FrfError> {
    let period = plan.len();
    let starts: Vec<usize> = (0..stretch.periods)
        .map(|p| stretch.first + p * period)
        .collect();
    let of = |signal: &[f64], removes_trend: bool| -> Vec<Vec<Complex64>> {
        let means: Vec<f64> = starts
            .iter()
            .map(|&s| mean(&signal[s..s + period]))
            .collect();
        let one = |(p, &start): (usize, &usize)| {
            // The trend through the means of the periods beside: a position that creeps leaks into all lines.
            let (before, after) = (p.saturating_sub(1), (p + 1).min(means.len() - 1));
            let slope = (means[after] - means[before]) / ((after - before).max(1) * period) as f64;
            let slope = if removes_trend { slope } else { 0.0 };
            transform(plan, &signal[start..start + period], slope)
        };
        starts.iter().enumerate().map(one).collect()
    };
    let whole = |signals: &[Vec<f64>], trend| -> Vec<Vec<Vec<Complex64>>> {
        signals.iter().map(|signal| of(signal, trend)).collect()
    };
    let (q, link) = (whole(&record.q, true), whole(&record.link, true));
    let [torque, friction] = [&record.torque, friction].map(|of| whole(of, false));
    let transient = transient(&q, lines);
    let pick = |of: &[Vec<Vec<Complex64>>], lines: &[usize]| -> Spectra {
        (transient..stretch.periods)
            .map(|p| {
                let joint =
                    |joint: &Vec<Vec<Complex64>>| lines.iter().map(|&l| joint[p][l]).collect();
                of.iter().map(joint).collect()
            })
            .collect()
    };
    let used = stretch.first + transient * period..stretch.first + stretch.periods * period;
    let instants = (0..PATH).map(|k| used.start + k * period / PATH);
    let path = instants
        .map(|k| record.q.iter().map(|q| q[k]).collect())
        .collect();
    let (point, swing) = positions(record, used, period)?;
    let band = lines[0]..*lines.last().unwrap_or(&lines[0]);
    let detection = [0, 1].map(|parity| {
        let silent = |line: &usize| line % 2 == parity && !lines.contains(line);
        let chosen: Vec<usize> = band.clone().filter(silent).collect();
        averaged(&pick(&q, &chosen))
    });
    Ok(Experiment {
        point,
        path,
        swing,
        q: pick(&q, lines),
        torque: pick(&torque, lines),
        friction: pick(&friction, lines),
        link: pick(&link, lines),
        detection,
        transient,
    })
}

/// How many periods at the beginning are transient: the first one, and others as long as they are farther from the last half's mean than
/// that half itself.
fn transient(q: &[Vec<Vec<Complex64>>], lines: &[usize]) -> usize {
    let periods = q.first().map_or(0, Vec::len);
    let later = periods / 2..periods;
    let mut distance = vec![0.0; periods];
    for joint in q {
        for &line in lines {
            let sum: Complex64 = later.clone().map(|p| joint[p][line]).sum();
            let mean = sum / later.len().max(1) as f64;
            for (p, distance) in distance.iter_mut().enumerate() {
                *distance += (joint[p][line] - mean).norm_sqr() / mean.norm_sqr().max(1e-300);
            }
        }
    }
    let mut usual: Vec<f64> = distance[later].to_vec();
    usual.sort_by(f64::total_cmp);
    let usual = usual.get(usual.len() / 2).copied().unwrap_or(0.0);
    let settled = (1..periods).find(|&p| distance[p] <= TRANSIENT * usual);
    // Two are left for the scatter.
    settled.unwrap_or(1).min(periods.saturating_sub(2))
}

/// Mean position and swing of each joint, which neither drifts nor sticks.
fn positions(
    record: &Record,
    used: std::ops::Range<usize>,
    period: usize,
) -> Result<(Vec<f64>, Vec<f64>), FrfError> {
    let (mut point, mut swings) = (Vec::new(), Vec::new());
    for (signal, joint) in record.q.iter().zip(&record.joints) {
        let own = &signal[used.clone()];
        let (low, high) =
            (own[..period].iter()).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        let swing = high - low;
        let speed = || own.windows(2).map(|two| (two[1] - two[0]).abs());
        let fastest = speed().fold(0.0, f64::max);
        // Of a joint that rests there is no usual step.
        let usual = quantile(speed(), 0.99).unwrap_or(0.0);
        if usual > 0.0
            && fastest > LEAP * usual
            && let Some(step) = speed().position(|v| v == fastest)
            && let Some(place) = record.place(used.start + step + 1)
        {
            return Err(FrfError::Leaps {
                path: record.path.clone(),
                place,
                joint: joint.clone(),
                by: fastest,
                usual,
            });
        }
        let resting = speed().filter(|v| *v <= REST * fastest).count();
        let share = resting as f64 / own.len() as f64;
        if share > STUCK {
            return Err(FrfError::Sticks {
                joint: joint.clone(),
                share: 100.0 * share,
            });
        }
        let drift = (mean(&own[own.len() - period..]) - mean(&own[..period])).abs();
        if drift > DRIFT * swing && swing > 0.0 {
            return Err(FrfError::PointMoves {
                path: record.path.clone(),
                joint: joint.clone(),
                drift,
                swing,
            });
        }
        point.push(mean(own));
        swings.push(swing);
    }
    Ok((point, swings))
}

/// The mean over periods.
pub(super) fn averaged(spectra: &Spectra) -> Vec<Vec<Complex64>> {
    let Some(first) = spectra.first() else {
        return Vec::new();
    };
    let at = |joint: usize, line: usize| {
        let sum: Complex64 = spectra.iter().map(|period| period[joint][line]).sum();
        sum / spectra.len() as f64
    };
    (0..first.len())
        .map(|joint| {
            (0..first[joint].len())
                .map(|line| at(joint, line))
                .collect()
        })
        .collect()
}
