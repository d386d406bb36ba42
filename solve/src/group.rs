//! Rows that share a noise, folded into a triangle over those parameters that they have.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::factor::HeapFactor;

/// Rows folded into a triangle over those parameters that they have.
#[derive(Debug, Clone)]
pub struct Group {
    factor: HeapFactor,
    /// Where each entry of θ stands among the columns.
    places: Arc<Vec<Option<usize>>>,
}

impl Group {
    /// A factor's rows; `places` tells where each entry of θ stands among its columns. Entries may share a column.
    pub fn new(factor: HeapFactor, places: Arc<Vec<Option<usize>>>) -> Self {
        Self { factor, places }
    }

    /// The rows of all parts, which are of the same columns; none if there is none.
    pub fn sum<'a>(mut parts: impl Iterator<Item = &'a Self>) -> Option<Self> {
        let mut sum = parts.next()?.clone();
        parts.for_each(|part| sum.factor.merge(&part.factor));
        Some(sum)
    }

    /// The same columns without any row.
    pub fn without_rows(&self) -> Self {
        Self::new(HeapFactor::new(self.factor.columns()), self.places.clone())
    }

    /// Root mean square of the right-hand side.
    pub fn size(&self) -> f64 {
        let square = self.sum_of_squares(&DVector::zeros(self.entries()));
        (square / self.count().max(1.0)).sqrt().max(1e-9)
    }

    /// Rows over θ and the right-hand side.
    pub fn of_rows(rows: &[Vec<f64>], columns: usize) -> Self {
        let mut factor = HeapFactor::new(columns);
        factor.fold(&mut rows.concat());
        Self {
            factor,
            places: Arc::new((0..columns).map(Some).collect()),
        }
    }

    /// How many rows.
    pub fn count(&self) -> f64 {
        self.factor.rows()
    }

    /// How many entries θ has.
    pub fn entries(&self) -> usize {
        self.places.len()
    }

    /// Each entry of θ and where it stands among the columns.
    fn told(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let places = self.places.iter().enumerate();
        places.filter_map(|(entry, place)| Some((entry, (*place)?)))
    }

    /// What the columns are times under θ.
    fn combined(&self, theta: &DVector<f64>) -> Vec<f64> {
        let mut own = vec![0.0; self.factor.columns()];
        for (entry, place) in self.told() {
            own[place] += theta[entry];
        }
        own
    }

    /// Sum of squared residuals under θ.
    pub fn sum_of_squares(&self, theta: &DVector<f64>) -> f64 {
        self.factor.sum_of_squares(&self.combined(theta))
    }
}

/// A factor's rows over θ and the right-hand side, each times `weight` and with its first entry; `places` tells where each entry of θ
/// stands among the factor's columns.
pub fn weighed(
    factor: &HeapFactor,
    places: &[Option<usize>],
    weight: f64,
) -> Vec<(usize, Vec<f64>)> {
    let (n, p) = (places.len(), factor.columns());
    let of = |k: usize| {
        let row = factor.row(k);
        let mut whole = vec![0.0; n + 1];
        let mut first = n;
        for (entry, place) in places.iter().enumerate() {
            if let Some(at) = place.and_then(|place| place.checked_sub(k)) {
                whole[entry] = weight * row[at];
                first = first.min(entry);
            }
        }
        whole[n] = weight * row[p - k];
        (first, whole)
    };
    (0..=p).map(of).collect()
}

/// All groups, each divided by its noise, as one triangle.
pub fn stacked(groups: &[Group], noise: &[f64]) -> DMatrix<f64> {
    let n = groups.first().map_or(0, Group::entries);
    let rows = groups.iter().zip(noise);
    let rows = rows.flat_map(|(group, noise)| weighed(&group.factor, &group.places, 1.0 / noise));
    let mut factor = HeapFactor::new(n);
    factor.fold_sorted(rows.collect());
    factor.dense()
}

/// Root mean square of each group's residuals under θ; `sizes` are the groups' own ([`Group::size`]).
pub fn noises(groups: &[Group], theta: &DVector<f64>, sizes: &[f64]) -> Vec<f64> {
    let fitted = theta.len() as f64 / groups.len() as f64;
    let of = |(rows, size): (&Group, &f64)| {
        let square = rows.sum_of_squares(theta) / (rows.count() - fitted).max(1.0);
        square.sqrt().max(1e-3 * size)
    };
    groups.iter().zip(sizes).map(of).collect()
}
