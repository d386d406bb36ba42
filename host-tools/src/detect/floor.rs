//! The noise floor of a log: the error that no model can take away, the same whatever model is held against the log.
//!
//! What a model leaves is noise and what the model lacks. To have the noise alone, each joint's torque is regressed on all that the motion offers: the
//! columns of the rigid body and of a plain drive, and a black box's of the joint's own motion and memory. Neither knows a model's effects or values. Of
//! what that leaves, waves of position are taken away as well (ripple, teeth, friction that comes and goes with position). The rest is noise where it
//! repeats in no period of the motion and no window follows from its neighbours ([`super::residual::NoiseFloor`]).

use nalgebra::{DMatrix, DVector};
use proprio_core::effect::EffectKind;

use super::black_box::probes;
use super::residual::{NoiseFloor, noise_floor};
use super::series::JointSeries;
use super::waves;
use crate::equation::values::{Place, Values};
use crate::estimate::limb_data::LimbData;
use crate::parallel::by_number;
use crate::robust;

/// Shrinkage in units of the number of windows: what has less than a millionth of its column's variance alone is not told from the others.
const SHRINKAGE: f64 = 1e-6;
/// A window that is so many standard deviations off is no noise: a spike. Normal noise is once in two million windows.
const SPIKE: f64 = 5.0;
/// Fewer windows for each column of the regression tell no noise.
const LEAST: usize = 2;
/// Times that spikes are looked for: the first regression follows them in part.
const ROUNDS: usize = 3;

/// Waves of position that are taken away from a joint at most, each with its two phases.
const WAVES: usize = 6;

/// The noise of each of a limb's joints, whose rigid body as the CAD has it predicts so, N m; none for too few windows.
pub(crate) fn of(data: &LimbData, cad: &[f64]) -> Vec<Option<NoiseFloor>> {
    let data = data.as_reported().in_motion();
    let n = data.joints();
    let values = Values::cad(data.model, data.limb);
    let drive: Vec<Place> = (EffectKind::PLAIN.into_iter())
        .flat_map(|effect| (0..n).map(move |joint| (effect, joint)))
        .collect();
    let columns = data.columns(&values, &drive, &[]);
    let rows = data.rows(&values, &columns);
    let series = JointSeries::of(&data, cad);
    let of = |joint: usize| {
        let windows: Vec<usize> = (0..data.motion.windows.len())
            .filter(|&w| data.counts(w, joint))
            .collect();
        let width = rows.row(*windows.first()?, joint).len();
        let fit = |columns: usize| windows.len() >= LEAST * (width + columns);
        let probes = probes::of_joint(&data, cad, joint, &windows, fit)?;
        let count = width + probes.first()?.len();
        let mut x = DMatrix::from_fn(windows.len(), count, |k, c| match c.checked_sub(width) {
            None => rows.row(windows[k], joint)[c],
            Some(c) => probes[k][c],
        });
        for mut column in x.column_iter_mut() {
            let size = column.norm() / (windows.len() as f64).sqrt();
            column /= size.max(f64::MIN_POSITIVE);
        }
        let y = DVector::from_column_slice(&series[joint].tau);
        let mut left = noise(&x, &y)?;
        for n in 1..=WAVES {
            if windows.len() < LEAST * (count + 2 * n) {
                break;
            }
            let Some(wave) = waves::strongest(&data, joint, &windows, &left) else {
                break;
            };
            for phase in wave {
                let last = x.ncols();
                x = x.insert_column(last, 0.0);
                x.set_column(last, &DVector::from_vec(phase));
            }
            left = noise(&x, &y)?;
        }
        let own = JointSeries {
            residual: left,
            ..series[joint].clone()
        };
        noise_floor(&own.view())
    };
    by_number(0..series.len(), of)
}

/// What a regression on `x` leaves of y, of the size of its noise; nothing at spikes, which the others make up for.
fn noise(x: &DMatrix<f64>, y: &DVector<f64>) -> Option<Vec<f64>> {
    let (count, columns) = (y.len(), x.ncols());
    // The product is blocked, that with a transposed view is not.
    let mut products = x.transpose() * x;
    (0..columns).for_each(|k| products[(k, k)] += SHRINKAGE * count as f64);
    let mut moments = x.tr_mul(y);
    let mut spikes: Vec<usize> = Vec::new();
    for round in 1.. {
        let left = y - x * products.clone().cholesky()?.solve(&moments);
        let kept = (0..count).filter(|k| spikes.binary_search(k).is_err());
        let scale = robust::scale(kept.map(|k| left[k]))?;
        let next: Vec<usize> = (0..count)
            .filter(|&k| left[k].abs() > SPIKE * scale)
            .collect();
        if round == ROUNDS || next == spikes {
            let kept = (count - spikes.len()) as f64;
            // A regression follows noise with as many windows as it has columns.
            let size = (count as f64 / (kept - columns as f64)).sqrt();
            let mut left: Vec<f64> = left.iter().map(|x| x * size).collect();
            spikes.iter().for_each(|&k| left[k] = 0.0);
            return Some(left);
        }
        for (rows, sign) in [(&next, -1.0), (&spikes, 1.0)] {
            for &k in rows {
                let row = x.row(k).transpose();
                products.ger(sign, &row, &row, 1.0);
                moments.axpy(sign * y[k], &row, 1.0);
            }
        }
        spikes = next;
    }
    None
}
