//! What the model says of the links at each point: inertia matrix, stiffness of gravity, and how far its bodies may be off.

use nalgebra::{DMatrix, DVector};
use proprio_core::inertia::INERTIAL;

use super::error::FrfError;
use super::flexible::Plant;
use super::response::Point;
use crate::dynamics::Dynamics;
use crate::model::Model;

/// Step of the differences of gravity's torque, rad or m.
const STEP: f64 = 1e-5;
/// A direction of the bodies that changes no inertia by more than this share is left out.
const FELT: f64 = 1e-6;

/// The links of some joints of a model.
pub(super) struct Links {
    dynamics: Dynamics,
    /// Of each joint its place among those of the dynamics.
    places: Vec<usize>,
    /// Directions in which bodies may be off by their priors, columns over all parameters.
    directions: DMatrix<f64>,
}

impl Links {
    /// The links behind `joints`, names of the model.
    ///
    /// # Errors
    /// If its dynamics cannot be computed or a joint is not part of it.
    pub(super) fn new(model: &Model, joints: &[String]) -> Result<Self, FrfError> {
        let dynamics = Dynamics::new(model, None)?;
        let mut places = Vec::new();
        for joint in joints {
            let place = dynamics.joints().iter().position(|own| own == joint);
            places.push(place.ok_or_else(|| FrfError::NoDynamics {
                joint: joint.clone(),
            })?);
        }
        let directions = directions(model, dynamics.joints())?;
        Ok(Self {
            dynamics,
            places,
            directions,
        })
    }

    /// The plants at points: means over the path, which a slow motion around a point makes differ from those at its middle, and those at the
    /// middle. The joints that are not recorded stand at 0.
    ///
    /// # Errors
    /// If the dynamics cannot be computed.
    pub(super) fn plants(&self, points: &[Point]) -> Result<[Vec<Plant>; 2], FrfError> {
        let (mut means, mut middles) = (Vec::new(), Vec::new());
        for point in points {
            let mut mean = self.plant(&point.path[0])?;
            for q in &point.path[1..] {
                mean = added(mean, &self.plant(q)?);
            }
            means.push(divided(mean, point.path.len() as f64));
            middles.push(self.plant(&point.q)?);
        }
        // Directions that are felt at some point.
        let is_felt = |m: &usize| {
            let felt = |p: &Plant| p.rigid[*m].norm() > FELT * p.inertia.norm();
            means.iter().any(felt)
        };
        let felt: Vec<usize> = (0..self.directions.ncols()).filter(is_felt).collect();
        for plant in means.iter_mut().chain(&mut middles) {
            plant.rigid = felt.iter().map(|&m| plant.rigid[m].clone()).collect();
        }
        Ok([means, middles])
    }

    fn plant(&self, own: &[f64]) -> Result<Plant, FrfError> {
        let n = self.dynamics.joints().len();
        let mut q = vec![0.0; n];
        for (place, value) in self.places.iter().zip(own) {
            q[*place] = *value;
        }
        // Unit accelerations of each joint after none at all: what differs is H.
        let samples = n + 1;
        let repeated = q.repeat(samples);
        let still = vec![0.0; n * samples];
        let mut accelerations = still.clone();
        for j in 0..n {
            accelerations[(j + 1) * n + j] = 1.0;
        }
        let width = n * INERTIAL;
        let mut rows = vec![0.0; samples * n * width];
        self.dynamics
            .torque_regressor([&repeated, &still, &accelerations], &mut rows)?;
        let regressor = |sample: usize, i: usize, p: usize| rows[(sample * n + i) * width + p];
        let places = &self.places;
        let along = |direction: &[f64]| {
            DMatrix::from_fn(places.len(), places.len(), |a, b| {
                let (i, j) = (places[a], places[b]);
                let of = |p: usize| (regressor(j + 1, i, p) - regressor(0, i, p)) * direction[p];
                (0..width).map(of).sum::<f64>()
            })
        };
        let rigid = (self.directions.column_iter())
            .map(|column| along(column.as_slice()))
            .collect();
        let mut inertia = vec![0.0; n * n];
        self.dynamics.mass_matrix(&q, &mut inertia)?;
        let gravity = |step: f64, joint: usize| -> Result<Vec<f64>, FrfError> {
            let mut moved = q.clone();
            moved[joint] += step;
            let (still, mut torque) = (vec![0.0; n], vec![0.0; n]);
            self.dynamics
                .inverse_dynamics([&moved, &still, &still], &mut torque)?;
            Ok(torque)
        };
        let mut stiffness = DMatrix::zeros(places.len(), places.len());
        for (b, &joint) in places.iter().enumerate() {
            let (up, down) = (gravity(STEP, joint)?, gravity(-STEP, joint)?);
            for (a, &i) in places.iter().enumerate() {
                stiffness[(a, b)] = (up[i] - down[i]) / (2.0 * STEP);
            }
        }
        Ok(Plant {
            inertia: DMatrix::from_fn(places.len(), places.len(), |a, b| {
                inertia[places[a] * n + places[b]]
            }),
            gravity: stiffness,
            rigid,
        })
    }
}

fn added(mut a: Plant, b: &Plant) -> Plant {
    a.inertia += &b.inertia;
    a.gravity += &b.gravity;
    for (a, b) in a.rigid.iter_mut().zip(&b.rigid) {
        *a += b;
    }
    a
}

fn divided(mut plant: Plant, by: f64) -> Plant {
    plant.inertia /= by;
    plant.gravity /= by;
    for direction in &mut plant.rigid {
        *direction /= by;
    }
    plant
}

/// Directions in which each body may be off: its parameters' standard deviations as identified, or the CAD's prior.
fn directions(model: &Model, joints: &[String]) -> Result<DMatrix<f64>, FrfError> {
    let width = joints.len() * INERTIAL;
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for (n, joint) in joints.iter().enumerate() {
        let body = model.robot().joint(joint)?;
        let mut add = |own: &[f64]| {
            let mut column = DVector::zeros(width);
            column.rows_mut(n * INERTIAL, INERTIAL).copy_from_slice(own);
            columns.push(column);
        };
        if let Some(std) = model.inertia_std(body) {
            for (p, std) in std.iter().enumerate() {
                let mut own = [0.0; INERTIAL];
                own[p] = *std;
                add(&own);
            }
            continue;
        }
        let Some(prior) = model.inertia(body).prior(model.cad_uncertainty(body)) else {
            continue;
        };
        let mut r = DMatrix::zeros(INERTIAL, INERTIAL);
        for k in 0..INERTIAL {
            for (p, value) in prior.row(k).iter().take(INERTIAL - k).enumerate() {
                r[(k, k + p)] = *value;
            }
        }
        let inverse = proprio_solve::bounded::inverse(&r);
        if inverse.iter().all(|x| x.is_finite()) {
            for column in inverse.column_iter() {
                add(column.as_slice());
            }
        }
    }
    Ok(if columns.is_empty() {
        DMatrix::zeros(width, 0)
    } else {
        DMatrix::from_columns(&columns)
    })
}
