//! What a prediction leaves once a model's linear parameters are fitted anew to it.
//!
//! One triangle of the rows and of what is known before serves all predictions: where a prediction changes by d, the parameters follow by
//! H⁻¹ Aᵀ W d, with A the rows, W their weights and H = Rᵀ R what rows and prior tell, and the weighted sum of squares falls by
//! ‖R⁻ᵀ Aᵀ W d‖² (Golub & Pereyra 1973, *SIAM J. Numer. Anal.* 10:413, the reduced functional of separable least squares). Bounds are not
//! looked at: a few parameters that may not follow change little of where the least is.

use nalgebra::DVector;
use proprio_core::effect::EffectKind;

use super::bounded::Problem;
use super::factor::{BATCH, HeapFactor};
use super::fit::{How, others};
use super::limb_data::LimbData;
use crate::equation::column::Columns;
use crate::equation::dot::dot;
use crate::equation::rows::Rows;
use crate::equation::values::{Place, Values};

/// A joint's windows, and what the model that is fitted leaves in them, N m.
pub(super) struct Told {
    pub(super) joint: usize,
    pub(super) windows: Vec<usize>,
    pub(super) now: Vec<f64>,
}

/// A limb's linear parameters, ready to follow a prediction.
pub(super) struct Refit<'a> {
    data: &'a LimbData<'a>,
    columns: Columns,
    rows: Rows,
    told: Vec<Told>,
    /// Of each joint that is told, one over its noise, 1/(N m).
    weight: Vec<f64>,
    factor: HeapFactor,
}

impl<'a> Refit<'a> {
    /// All of a model's parameters but those of the effect at `place`, beside them what every drive has, over the windows that are told;
    /// `None` where the prior is not finite.
    pub(super) fn of(
        (data, values): (&'a LimbData<'a>, &Values),
        place: Place,
        told: Vec<Told>,
        chosen: &(dyn Fn(usize) -> bool + Sync),
    ) -> Option<Self> {
        let own: Vec<Place> = values.places().filter(|own| *own != place).collect();
        let plain = EffectKind::PLAIN.into_iter();
        let plain = plain.flat_map(|effect| (0..data.joints()).map(move |joint| (effect, joint)));
        let plain: Vec<Place> = plain.filter(|place| !own.contains(place)).collect();
        let columns = data.columns(values, &own, &plain);
        let rows = data.rows_of(values, &columns, chosen);
        let noise = |told: &Told| {
            let square = dot(&told.now, &told.now) / told.now.len().max(1) as f64;
            square.sqrt().max(f64::MIN_POSITIVE).recip()
        };
        let weight: Vec<f64> = told.iter().map(noise).collect();
        let count = columns.entries.len();
        let mut factor = HeapFactor::new(count);
        for (told, weight) in told.iter().zip(&weight) {
            for windows in told.windows.chunks(BATCH) {
                let mut batch = vec![0.0; windows.len() * (count + 1)];
                for (w, row) in windows.iter().zip(batch.chunks_exact_mut(count + 1)) {
                    let own = rows.row(*w, told.joint);
                    for (entry, x) in row[..count].iter_mut().enumerate() {
                        *x = (columns.place(told.joint, entry)).map_or(0.0, |at| weight * own[at]);
                    }
                }
                factor.fold(&mut batch);
            }
        }
        let problem = Problem {
            bodies: data.bodies_before(),
            others: others(&columns, values, &How::default()),
            data: nalgebra::DMatrix::zeros(0, count + 1),
            free: false,
        };
        let prior = problem.prior_information(&DVector::from_vec(columns.theta(values)));
        let mut prior = prior.insert_column(count, 0.0).transpose();
        factor.fold(prior.as_mut_slice());
        let is_told = |k: usize| factor.row(k)[0].is_finite() && factor.row(k)[0] != 0.0;
        (0..count).all(is_told).then_some(Self {
            data,
            columns,
            rows,
            told,
            weight,
            factor,
        })
    }

    /// The weighted sum of squares that a prediction leaves once the parameters have followed.
    pub(super) fn left(&self, predicted: &[f64]) -> f64 {
        let mut slope = vec![0.0; self.columns.entries.len()];
        let mut square = 0.0;
        for (told, weight) in self.told.iter().zip(&self.weight) {
            let mut own = vec![0.0; self.columns.of_joint[told.joint].len()];
            for (&w, now) in told.windows.iter().zip(&told.now) {
                let at = w * self.data.joints() + told.joint;
                let left = self.data.torque[at] - predicted[at];
                square += (weight * left).powi(2);
                let change = weight * weight * (left - now);
                let row = self.rows.row(w, told.joint);
                own.iter_mut().zip(row).for_each(|(x, a)| *x += change * a);
            }
            for (entry, x) in slope.iter_mut().enumerate() {
                let at = self.columns.place(told.joint, entry);
                *x += at.map_or(0.0, |at| own[at]);
            }
        }
        // Rᵀ y = slope, from the first row on.
        let mut taken = 0.0;
        for k in 0..slope.len() {
            let row = &self.factor.row(k)[..slope.len() - k];
            let y = slope[k] / row[0];
            taken += y * y;
            slope[k + 1..]
                .iter_mut()
                .zip(&row[1..])
                .for_each(|(x, r)| *x -= y * r);
        }
        square - taken
    }
}
