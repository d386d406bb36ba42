//! What rows tell of the trunk, beside what was known and with all else unknown.
//!
//! The trunk is one of thirteen bodies, and a joint's friction is in its torque. So the trunk's ten columns T count as far as the others
//! N leave them: with both in units of the prior and rows in units of their noise,
//!
//! ```text
//! S = 1 + N Nᵀ,   1 + Tᵀ S⁻¹ T = (prior covariance) / (covariance after the motion)
//! ```
//!
//! which is the Schur complement of the information matrix, written for fewer rows than columns. The prior makes S well conditioned.

use nalgebra::{DMatrix, DVector, SMatrix};
use proprio_core::inertia::INERTIAL;

use super::super::ExciteError;
use super::super::spectrum::spectrum;
use super::state::{BODIES, COLUMNS, COORDINATES, SCALE};
use crate::estimate::Constraint;
use crate::free_base::FreeBaseError;
use crate::free_base::legged::FIRST_NOISE;
use crate::free_base::sensors::STD;
use crate::free_base::structure::ModelStructure;
use crate::model::{BASE, Model};

/// A window of the free base's equations, s: rows of unit noise are so far apart.
const WINDOW: f64 = 0.04;
/// Share of the largest singular value below which a combination is not there at all.
const ABSENT: f64 = 1e-5;

/// What is known before the motion.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    /// Square roots of the bodies' covariances, the trunk's first.
    bodies: Vec<DMatrix<f64>>,
    /// Standard deviations of effects and of the accelerometer's bias.
    others: Vec<f64>,
    /// The trunk's standard deviation of its mass, the largest of its first moments and of its inertias, ten numbers.
    kind: DVector<f64>,
}

/// What a motion tells of the trunk.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seen {
    /// log det of the prior's covariance over that after the motion, nats, twice counted.
    pub(super) log_det: f64,
    /// Standard deviations of the ten parameters: before and after.
    pub(super) std: [[f64; INERTIAL]; 2],
}

impl Prior {
    /// Of a Go2 with this model's bodies, the trunk with what its owner put on it, as `identify --free-base` takes them.
    pub(super) fn of(model: &Model) -> Result<Self, ExciteError> {
        let unphysical = || ExciteError::Unphysical("of the Go2".to_owned());
        let structure = structure(model).map_err(|_| unphysical())?;
        let body = |b: usize| {
            let own = &structure.bodies[b];
            super::super::space::whole_prior(&[(own.inertia, own.relative)], &[])
        };
        let bodies: Option<Vec<_>> = (0..BODIES).map(body).collect();
        let bodies = bodies.ok_or_else(unphysical)?;
        let effects = structure.effects(&structure.columns());
        let effects = effects.iter().map(|effect| effect.std);
        let trunk = &bodies[0];
        let most =
            |kind: std::ops::Range<usize>| kind.map(|k| trunk.row(k).norm()).fold(0.0, f64::max);
        let kinds = [most(0..1), most(1..4), most(4..10)];
        Ok(Self {
            others: effects.chain(STD[..3].iter().copied()).collect(),
            kind: DVector::from_fn(INERTIAL, |k, _| {
                kinds[usize::from(k > 0) + usize::from(k > 3)]
            }),
            bodies,
        })
    }

    /// The rows in units of the prior: the trunk's columns, and all others.
    fn scaled(&self, rows: &DMatrix<f64>) -> [DMatrix<f64>; 2] {
        let mut all = DMatrix::zeros(rows.nrows(), COLUMNS);
        for (b, root) in self.bodies.iter().enumerate() {
            let own = rows.columns(INERTIAL * b, INERTIAL) * root;
            all.columns_mut(INERTIAL * b, INERTIAL).copy_from(&own);
        }
        for (n, std) in self.others.iter().enumerate() {
            let c = INERTIAL * BODIES + n;
            all.set_column(c, &(rows.column(c) * *std));
        }
        [
            all.columns(0, INERTIAL).into_owned(),
            all.columns(INERTIAL, COLUMNS - INERTIAL).into_owned(),
        ]
    }

    /// What `rows` of unit noise tell; none for numbers that are not finite.
    pub(super) fn seen(&self, rows: &DMatrix<f64>) -> Option<Seen> {
        let [trunk, others] = self.scaled(rows);
        let mut spread = &others * others.transpose();
        for n in 0..spread.nrows() {
            spread[(n, n)] += 1.0;
        }
        let told = spread.cholesky()?.l().solve_lower_triangular(&trunk)?;
        let m = told.nrows();
        let with_prior = DMatrix::from_fn(m + INERTIAL, INERTIAL, |r, c| match r.checked_sub(m) {
            None => told[(r, c)],
            Some(own) => f64::from(u8::from(own == c)),
        });
        let triangle = with_prior.qr().r();
        let log_det: f64 = triangle.diagonal().iter().map(|x| 2.0 * x.abs().ln()).sum();
        let after = triangle
            .tr_solve_upper_triangular(&self.bodies[0].transpose())?
            .transpose();
        let norms = |root: &DMatrix<f64>| std::array::from_fn(|k| root.row(k).norm());
        log_det.is_finite().then(|| Seen {
            log_det,
            std: [norms(&self.bodies[0]), norms(&after)],
        })
    }

    /// σ₁ / σ_r and r of the trunk's columns, each kind of parameter in units of the prior's largest standard deviation of its kind, or
    /// in kg, kg m and kg m².
    pub(super) fn condition(&self, rows: &DMatrix<f64>, by_kind: bool) -> (f64, usize) {
        let mut own = rows.columns(0, INERTIAL).into_owned();
        if by_kind {
            for (k, mut column) in own.column_iter_mut().enumerate() {
                column *= self.kind[k];
            }
        }
        let Some((values, _)) = spectrum(&own.qr().r()) else {
            return (f64::INFINITY, 0);
        };
        let there = || values.iter().filter(|s| **s > ABSENT * values.max());
        let least = there().copied().fold(f64::INFINITY, f64::min);
        (values.max() / least, there().count())
    }
}

/// The model's bodies with what is known of them where the trunk is to be told, and every effect.
pub(super) fn structure(model: &Model) -> Result<ModelStructure, FreeBaseError> {
    let mut structure = ModelStructure::whole(&Model::default(), Constraint::Physical)?;
    for (b, body) in structure.bodies.iter_mut().enumerate() {
        body.inertia = *model.inertia(b.checked_sub(1).unwrap_or(BASE));
    }
    Ok(structure)
}

/// Rows of instants, in units of their noise, each standing for `seconds`: growing.
pub(super) struct Gathered {
    rows: Vec<DMatrix<f64>>,
    weight: f64,
}

impl Gathered {
    pub(super) fn new(seconds: f64) -> Self {
        Self {
            rows: Vec::new(),
            weight: (seconds / WINDOW).sqrt() / FIRST_NOISE,
        }
    }

    /// Adds combinations (columns of `basis`) of an instant's equations, scaled as those of a walk are.
    pub(super) fn add(&mut self, basis: &DMatrix<f64>, whole: &SMatrix<f64, COORDINATES, COLUMNS>) {
        let scaled = DMatrix::from_fn(COORDINATES, COLUMNS, |r, c| {
            whole[(r, c)] * SCALE[r] * self.weight
        });
        self.rows.push(basis.tr_mul(&scaled));
    }

    pub(super) fn rows(&self) -> DMatrix<f64> {
        let height = self.rows.iter().map(DMatrix::nrows).sum();
        let mut all = DMatrix::zeros(height, COLUMNS);
        let mut next = 0;
        for own in &self.rows {
            all.rows_mut(next, own.nrows()).copy_from(own);
            next += own.nrows();
        }
        all
    }
}
