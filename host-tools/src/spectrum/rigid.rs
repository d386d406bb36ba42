//! What the model says of the links at each point: inertia matrix, stiffness of gravity, and how far its bodies may be off; of links that bend with
//! their bends as further coordinates.

use nalgebra::{DMatrix, DVector, DVectorView};
use proprio_core::inertia::INERTIAL;

use super::error::FrfError;
use super::flexible::Plant;
use crate::dynamics::Dynamics;
use crate::model::{JointQuantity, Model};

/// Step of the differences of gravity's torque, rad or m.
const STEP: f64 = 1e-5;
/// A direction of the bodies that changes no inertia by more than this share is left out.
const FELT: f64 = 1e-6;
/// Identified masses and armature are off by so much of their value at least, whatever their standard deviations: those come from the scatter of
/// residuals, and know nothing of springs and friction that a rigid fit of a slow log took for inertia. Simulated arms missed by about that.
pub(super) const LEAST_DOUBT: f64 = 0.03;
/// Rounds in which the links' sag and gravity's torque at the sagged links are made to agree: each leaves the share K_g/k, a few per cent, of the
/// error before it.
const SAG_ROUNDS: usize = 3;

/// Where motors are: in the middle of an experiment, and at some instants of a period.
#[derive(Clone, Copy)]
pub(super) struct Motors<'a> {
    pub(super) middle: &'a [f64],
    pub(super) path: &'a [Vec<f64>],
}

/// By how much more than its standard deviation a value may be off, at least 1, so that it is off by [`LEAST_DOUBT`].
pub(super) fn doubt(value: f64, std: f64) -> f64 {
    (LEAST_DOUBT * value.abs() / std.max(1e-300)).max(1.0)
}

/// A bend of a model: the joint's number among the robot's, and which.
pub(super) type Bend = (usize, JointQuantity);

/// The links at some points.
#[derive(Default)]
pub(super) struct Plants {
    /// Means over each path, which a slow motion around a point makes differ from what is in its middle.
    pub(super) means: Vec<Plant>,
    /// Inertia and stiffness of gravity at each instant of each path.
    pub(super) along: Vec<Vec<[DMatrix<f64>; 2]>>,
}

/// The links of some joints of a model.
pub(super) struct Links {
    dynamics: Dynamics,
    /// Of each joint, then of each bend, its place among those of the dynamics.
    places: Vec<usize>,
    /// How many of them are joints with motors.
    motors: usize,
    /// Directions in which bodies may be off by their priors, columns over all parameters: those that are felt.
    directions: DMatrix<f64>,
    /// Which of all directions those are.
    felt: Vec<usize>,
    /// Of each direction by how much more than that it may be off.
    doubts: Vec<f64>,
    /// Of each direction the joint that carries the body.
    owners: Vec<String>,
}

impl Links {
    /// The links behind `joints`, names of the model, as they are felt at these points, with these bends.
    ///
    /// # Errors
    /// If its dynamics cannot be computed or a joint is not part of it.
    pub(super) fn new(
        model: &Model,
        joints: &[String],
        bends: &[Bend],
        points: &[Motors<'_>],
    ) -> Result<Self, FrfError> {
        let names = bends.iter().map(|bend| model.bend_name(*bend));
        let names: Vec<String> = joints.iter().cloned().chain(names).collect();
        let model = &model.with_bends(bends);
        let dynamics = Dynamics::new(model, None)?;
        let mut places = Vec::new();
        for joint in &names {
            let place = dynamics.joints().iter().position(|own| own == joint);
            places.push(place.ok_or_else(|| FrfError::NoDynamics {
                joint: joint.clone(),
            })?);
        }
        let (directions, doubts, owners) = directions(model, dynamics.joints())?;
        let mut links = Self {
            dynamics,
            places,
            motors: joints.len(),
            felt: Vec::new(),
            directions,
            doubts,
            owners,
        };
        // Directions that are felt at some point.
        let mut is_felt = vec![false; links.directions.ncols()];
        for point in points {
            let at = links.at(point.middle)?;
            let least = FELT * at.inertia.norm();
            for (felt, slope) in is_felt.iter_mut().zip(links.rigid(&at.regressor)) {
                *felt |= slope.norm() > least;
            }
        }
        let felt: Vec<usize> = (0..is_felt.len()).filter(|&m| is_felt[m]).collect();
        links.directions = links.directions.select_columns(&felt);
        links.doubts = felt.iter().map(|&m| links.doubts[m]).collect();
        links.owners = felt.iter().map(|&m| links.owners[m].clone()).collect();
        links.felt = felt;
        Ok(links)
    }

    /// The plants at the links behind these motors. Springs and bends yield by `compliance`, rad/(N m), under gravity. The joints that are not recorded
    /// stand at 0.
    ///
    /// # Errors
    /// If the dynamics cannot be computed.
    pub(super) fn plants(
        &self,
        points: &[Motors<'_>],
        compliance: &[f64],
    ) -> Result<Plants, FrfError> {
        let mut all = Plants::default();
        for point in points {
            let of = |q: &Vec<f64>| self.at(&self.sagged(q, compliance)?);
            let instants: Result<Vec<Matrices>, FrfError> = point.path.iter().map(of).collect();
            let instants = instants?;
            let matrices = |at: &Matrices| [at.inertia.clone(), at.gravity.clone()];
            all.along.push(instants.iter().map(matrices).collect());
            let count = instants.len() as f64;
            let Some(sum) = instants.into_iter().reduce(Matrices::added) else {
                continue;
            };
            all.means.push(Plant {
                inertia: sum.inertia / count,
                gravity: sum.gravity / count,
                rigid: self.rigid(&(sum.regressor / count)),
                motors: self.motors,
            });
        }
        Ok(all)
    }

    /// How many joints have motors.
    pub(super) fn motors(&self) -> usize {
        self.motors
    }

    /// The number that direction `m` of other links of the same bodies has here, if it is felt here.
    pub(super) fn same_direction(&self, other: &Self, m: usize) -> Option<usize> {
        self.felt.iter().position(|own| *own == other.felt[m])
    }

    /// Of each rigid direction by how many of its standard deviations the bodies may be off.
    pub(super) fn doubts(&self) -> &[f64] {
        &self.doubts
    }

    /// Of each rigid direction the joint that carries the body.
    pub(super) fn owners(&self) -> &[String] {
        &self.owners
    }

    /// Where the links are that motors at `own` hold by springs of this compliance: q − c g(q) of the links themselves. Bends have no motor: q is 0.
    fn sagged(&self, own: &[f64], compliance: &[f64]) -> Result<Vec<f64>, FrfError> {
        let n = self.dynamics.joints().len();
        let still = vec![0.0; n];
        let own = |i: usize| own.get(i).copied().unwrap_or(0.0);
        let mut links: Vec<f64> = (0..self.places.len()).map(own).collect();
        for _ in 0..SAG_ROUNDS {
            let (mut q, mut torque) = (still.clone(), still.clone());
            for (place, value) in self.places.iter().zip(&links) {
                q[*place] = *value;
            }
            self.dynamics
                .inverse_dynamics([&q, &still, &still], &mut torque)?;
            for (i, &place) in self.places.iter().enumerate() {
                links[i] = own(i) - compliance[i] * torque[place];
            }
        }
        Ok(links)
    }

    /// The derivatives of H to each direction of the bodies, by H's to their parameters.
    fn rigid(&self, regressor: &DMatrix<f64>) -> Vec<DMatrix<f64>> {
        let n = self.places.len();
        let all = regressor * &self.directions;
        let of =
            |column: DVectorView<'_, f64>| DMatrix::from_iterator(n, n, column.iter().copied());
        all.column_iter().map(of).collect()
    }

    fn at(&self, own: &[f64]) -> Result<Matrices, FrfError> {
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
        let row = |sample: usize, i: usize| &rows[(sample * n + i) * width..][..width];
        let places = &self.places;
        let mut regressor = DMatrix::zeros(places.len() * places.len(), width);
        for (b, &j) in places.iter().enumerate() {
            for (a, &i) in places.iter().enumerate() {
                let mut to = regressor.row_mut(b * places.len() + a);
                let differ = row(j + 1, i).iter().zip(row(0, i)).map(|(x, y)| x - y);
                to.iter_mut().zip(differ).for_each(|(to, x)| *to = x);
            }
        }
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
        Ok(Matrices {
            inertia: DMatrix::from_fn(places.len(), places.len(), |a, b| {
                inertia[places[a] * n + places[b]]
            }),
            gravity: stiffness,
            regressor,
        })
    }
}

/// The links' matrices at one place.
struct Matrices {
    /// H, kg m².
    inertia: DMatrix<f64>,
    /// ∂g/∂q, N m/rad.
    gravity: DMatrix<f64>,
    /// Derivatives of H to all bodies' parameters: a row for each element, column after column.
    regressor: DMatrix<f64>,
}

impl Matrices {
    fn added(mut self, other: Self) -> Self {
        self.inertia += other.inertia;
        self.gravity += other.gravity;
        self.regressor += other.regressor;
        self
    }
}

/// Directions, by how much more bodies may be off in each, and the joint that carries the body.
type Directions = (DMatrix<f64>, Vec<f64>, Vec<String>);

/// Directions in which each body may be off, and by how much more: its parameters' standard deviations as identified, or the CAD's prior.
fn directions(model: &Model, joints: &[String]) -> Result<Directions, FrfError> {
    let width = joints.len() * INERTIAL;
    let mut columns: Vec<DVector<f64>> = Vec::new();
    let (mut doubts, mut owners) = (Vec::new(), Vec::new());
    for (n, joint) in joints.iter().enumerate() {
        let body = model.robot().joint(joint)?;
        let mut add = |own: &[f64], doubt: f64| {
            doubts.push(doubt);
            owners.push(joint.clone());
            let mut column = DVector::zeros(width);
            column.rows_mut(n * INERTIAL, INERTIAL).copy_from_slice(own);
            columns.push(column);
        };
        if let Some(std) = model.inertia_std(body) {
            let values = model.inertia(body);
            for (p, std) in std.iter().enumerate() {
                let mut own = [0.0; INERTIAL];
                own[p] = *std;
                add(&own, doubt(values.0[p], *std));
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
                add(column.as_slice(), 1.0);
            }
        }
    }
    let directions = match columns.is_empty() {
        true => DMatrix::zeros(width, 0),
        false => DMatrix::from_columns(&columns),
    };
    Ok((directions, doubts, owners))
}
