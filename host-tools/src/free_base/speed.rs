//! Velocities with less noise: what multiplies a parameter is made of them, and noise there pulls the parameter to zero.
//!
//! Joint velocities are the reported ones, or the slope of the position where that is the quieter of the two.
//! A Go2's position has a quantum of 3e-5 rad and hardly any noise: its slope over 8 ms is ten times quieter than the reported
//! velocity, whose noise makes Coulomb friction near standstill, and all that is multiplied with momentum, uncertain. Time stamps
//! that jitter spoil the slope, so each joint of each log is asked. The gyro has no second channel: it is smoothed by the parabola
//! that fits the samples within 6 ms best (Savitzky & Golay 1964), which passes motion of up to 65 Hz. Less, and the gyro's noise moves the trunk's
//! centre of mass; more, and a touch-down, which turns the base within some 8 ms, reaches into windows that are long over: of MuJoCo's walks
//! 10 ms spoilt the viscous friction of front calves by 15 %, no smoothing the height of the trunk's centre of mass by 1 to 3 mm. Chosen on four of
//! the twenty robots of `studies/walks.md`.

use nalgebra::{Matrix3, Vector3};

use super::stiction::LEAST_RATE;
use super::walk::Walk;

/// A slope's samples are at least this far apart, s: as those of a Go2's 500 Hz.
const SPAN: f64 = 2e-3;
/// Steps that differ by more than this share of their mean are not even.
const UNEVEN: f64 = 0.02;

/// The gyro's parabola reaches this far to both sides, s.
const REACH: f64 = 0.0061;
/// … and this far where no foot strikes or leaves the ground meanwhile, s: motion of up to 20 Hz passes.
const FAR_REACH: f64 = 0.0201;
/// A trunk on its legs' controllers rings at 10 to 20 Hz after a foot strikes or leaves the ground: for two periods, s.
const QUIET: f64 = 0.1;

/// Smooths the gyro, and replaces the joints' velocities where the slope of the position is quieter. What is sampled slowly
/// stays as it is.
pub(super) fn quieten(walk: &mut Walk) {
    if walk.period > 1.0 / LEAST_RATE {
        return;
    }
    walk.gyro_read.clone_from(&walk.gyro);
    walk.gyro = (0..walk.len()).map(|n| smoothed(walk, n, REACH)).collect();
    for j in 0..walk.dq.width() {
        let reported: Vec<f64> = walk.dq.of(j).collect();
        let slope: Vec<f64> = (0..walk.len())
            .map(|n| slope(walk, j, n).unwrap_or(reported[n]))
            .collect();
        if noise(&slope) < noise(&reported) {
            let own = slope.into_iter().enumerate();
            own.for_each(|(n, slope)| walk.dq[n][j] = slope);
        }
    }
}

/// Smooths the gyro for longer where no foot strikes or leaves the ground, which happens at these times, s in order. Noise of a momentum at a
/// window's ends pulls what multiplies it to zero: of a robot that sways a gyro smoothed over 6 ms made 0.4 % of the mass and 1 mm of the centre of
/// mass's height.
pub(super) fn quieten_turning(walk: &mut Walk, strikes: &[f64]) {
    if walk.period > 1.0 / LEAST_RATE || walk.gyro_read.is_empty() {
        return;
    }
    let reach = |n: usize| {
        let [first, last] = [-QUIET, QUIET].map(|s| walk.seconds(n) + s);
        let next = strikes.partition_point(|strike| *strike < first);
        match strikes.get(next) {
            Some(strike) if *strike <= last => REACH,
            _ => FAR_REACH,
        }
    };
    walk.gyro = (0..walk.len())
        .map(|n| smoothed(walk, n, reach(n)))
        .collect();
}

/// The value at sample n of the parabola through the gyro's samples, as they were read, within reach (s).
fn smoothed(walk: &Walk, n: usize, reach: f64) -> Vector3<f64> {
    let (mut moments, mut sums) = (Matrix3::zeros(), Matrix3::zeros());
    let t = walk.seconds(n);
    let [first, last] = [t - reach, t + reach].map(|t| walk.index_at(t));
    for m in first..last {
        let x = (walk.seconds(m) - t) / reach;
        let powers = Vector3::new(1.0, x, x * x);
        moments += powers * powers.transpose();
        sums += powers * walk.gyro_read[m].transpose();
    }
    // Too few samples for a parabola: the sample itself.
    match moments.lu().solve(&sums) {
        Some(parabola) if last - first > 3 => parabola.row(0).transpose(),
        _ => walk.gyro_read[n],
    }
}

/// The derivative of the parabola through three samples, or through five even ones of the polynomial of fourth order; samples that
/// are taken faster than [`SPAN`] are passed over, for a quantum is the louder the shorter the time.
fn slope(walk: &Walk, j: usize, n: usize) -> Option<f64> {
    let at = |m: usize| {
        Some((
            walk.time_us.get(m).map(|us| *us as f64 * 1e-6)?,
            walk.q[m][j],
        ))
    };
    let stride = ((SPAN / walk.period).round() as usize).max(1);
    let span = stride as f64 * walk.period;
    let [(t0, q0), (t1, q1), (t2, q2)] = [at(n.checked_sub(stride)?)?, at(n)?, at(n + stride)?];
    let (before, after) = (t1 - t0, t2 - t1);
    if before.max(after) > 2.5 * span {
        return None;
    }
    let even = |step: f64| (step / span - 1.0).abs() < UNEVEN;
    if let (Some(first), Some((t4, q4))) =
        (n.checked_sub(2 * stride).and_then(at), at(n + 2 * stride))
    {
        let (t3, q3) = first;
        if [t0 - t3, before, after, t4 - t2].into_iter().all(even) {
            return Some((8.0 * (q2 - q0) - (q4 - q3)) / (12.0 * span));
        }
    }
    let (left, right) = ((q1 - q0) / before, (q2 - q1) / after);
    Some((left * after + right * before) / (before + after))
}

/// What of a series no motion explains: the root mean square of its third differences.
fn noise(series: &[f64]) -> f64 {
    let third = series
        .windows(4)
        .map(|x| x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0]);
    third.map(|x| x * x).sum::<f64>().sqrt()
}
