//! Gravity's direction, by what the accelerometer feels on average in axes that the gyro keeps from turning.
//!
//! A foot touches the ground at its lowest point along gravity, so an error of a hundredth of a radian moves each of a Go2's forces by 0.2 mm. A
//! filter of past samples, as a microcontroller has it (`proprio_core::contact::GravityDirection`), lags behind what sways: its error goes
//! with the trunk's velocity and looks like encoders that are read 0.7 ms late and like viscous friction. Where later samples
//! are known, the mean is of both sides alike.

use nalgebra::{DMatrix, Matrix2, Matrix2x3, Rotation3, Vector2, Vector3};
use proprio_core::tree::GRAVITY;

use super::columns::WalkColumns;
use super::sensors::ACC_SCALE;
use super::stance::Stance;
use super::walk::Walk;

/// The mean is under Hann's window, so far to both sides, s: of what sways or steps at 0.35 Hz or faster it leaves a hundredth, and a gyro's noise
/// turns its axes by less than a milliradian meanwhile.
const REACH: f64 = 4.0;
/// Samples are first put together over this time, s: the mean changes slowly.
const BIN: f64 = 0.02;
/// How far gravity is from 9.81 m/s² where a robot may be: 9.78 at the equator and 9.83 at the poles (GRS 80), less on mountains.
const LOCAL_GRAVITY: f64 = 0.015;

/// Samples put together: when, s; how many, and the sum of the specific force in axes that do not turn, m/s².
struct Bin {
    t: f64,
    count: f64,
    felt: Vector3<f64>,
}

/// Unit vectors along gravity in the IMU's axes, sample by sample.
pub(super) fn down(walk: &Walk) -> Vec<Vector3<f64>> {
    let mut down = Vec::with_capacity(walk.len());
    for piece in walk.pieces() {
        stretch(walk, piece.start, piece.end - 1, &mut down);
    }
    down
}

/// Adds those of samples without a long pause between them.
fn stretch(walk: &Walk, first: usize, last: usize, down: &mut Vec<Vector3<f64>>) {
    let mut turned = vec![Rotation3::identity()];
    let mut bins: Vec<Bin> = Vec::new();
    for n in first..=last {
        if n > first {
            let half = 0.5 * (walk.seconds(n) - walk.seconds(n - 1));
            let step = Rotation3::from_scaled_axis((walk.gyro[n - 1] + walk.gyro[n]) * half);
            turned.push(turned[n - 1 - first] * step);
        }
        let felt = turned[n - first] * walk.acc[n];
        let t = walk.seconds(n);
        let number = |t: f64| ((t - walk.seconds(first)) / BIN) as usize;
        match bins.last_mut() {
            Some(bin) if number(bin.t) == number(t) => {
                bin.count += 1.0;
                bin.felt += felt;
            }
            _ => bins.push(Bin {
                t,
                count: 1.0,
                felt,
            }),
        }
    }
    let up: Vec<Vector3<f64>> = (0..bins.len()).map(|k| mean(&bins, k)).collect();
    let mut k = 0;
    for n in first..=last {
        let t = walk.seconds(n);
        while k + 2 < bins.len() && bins[k + 1].t <= t {
            k += 1;
        }
        let next = (k + 1).min(bins.len() - 1);
        let time = (bins[next].t - bins[k].t).max(f64::MIN_POSITIVE);
        let felt = up[k].lerp(&up[next], ((t - bins[k].t) / time).clamp(0.0, 1.0));
        down.push(turned[n - first].inverse_transform_vector(&-felt.normalize()));
    }
}

/// The specific force at a bin's time: of the line that fits all within reach best, under Hann's window. A gyro's bias makes a line of what is
/// constant, which counts where the log or a pause cuts off one side; less than the reach of time tells no line.
fn mean(bins: &[Bin], k: usize) -> Vector3<f64> {
    let t = bins[k].t;
    let near = bins.partition_point(|bin| bin.t < t - REACH)
        ..bins.partition_point(|bin| bin.t <= t + REACH);
    let near = &bins[near];
    let (mut moments, mut sums) = (Matrix2::zeros(), Matrix2x3::zeros());
    for bin in near {
        let x = (bin.t - t) / REACH;
        let weight = 0.5 + 0.5 * (std::f64::consts::PI * x).cos();
        let powers = Vector2::new(1.0, x);
        moments += powers * powers.transpose() * (weight * bin.count);
        sums += powers * bin.felt.transpose() * weight;
    }
    let long = near.last().map_or(0.0, |bin| bin.t) - near[0].t >= REACH;
    let line = moments.lu().solve(&sums).filter(|_| long);
    line.map_or_else(|| sums.row(0).transpose(), |line| line.row(0).transpose())
}

/// What gravity's length tells of the accelerometer's bias: a row per walk, of all columns and the right-hand side, in units of its deviation. All walks
/// are taken to be of one place, whose gravity nobody has measured.
pub(super) fn length_rows(walks: &[(Walk, Stance)], of: &WalkColumns) -> DMatrix<f64> {
    let (acc, columns) = (of.acc(), of.len());
    let told = walks.iter();
    let told = told.filter_map(|(walk, stance)| walk.gravity(stance.held.contains(&true)));
    let told: Vec<_> = told.collect();
    let mut rows = DMatrix::zeros(told.len(), columns + 1);
    for (r, gravity) in told.iter().enumerate() {
        for n in 0..3 {
            rows[(r, acc + n)] = gravity.up[n];
        }
        rows[(r, acc + ACC_SCALE)] = GRAVITY;
        rows[(r, columns)] = gravity.excess;
    }
    let covariance = DMatrix::from_fn(told.len(), told.len(), |r, c| {
        let own = if r == c { told[r].std.powi(2) } else { 0.0 };
        own + LOCAL_GRAVITY.powi(2)
    });
    // Each has a deviation of its own, so there is a root.
    let root = covariance.cholesky();
    root.and_then(|root| root.l().solve_lower_triangular(&rows))
        .unwrap_or_else(|| DMatrix::zeros(0, columns + 1))
}
