//! What an experiment will see before it is made: responses by the model, and the standard deviations of its springs.
//!
//! Springs are the model's, or where it states none what a gear often has. The errors are those of a fit of the planned lines: by noise and distortion of
//! the responses, and by what the model's masses and armature may be off ([`super::rigid::LEAST_DOUBT`]).

use nalgebra::DMatrix;
use proprio_solve::bounded::inverse;
use realfft::num_complex::Complex64;

use super::error::FrfError;
use super::flexible::{At, Plant};
use super::layout::{Layout, Unknown};
use super::linear::{fold, moved_by_priors, prior_factor, prior_rows, stacked};
use super::rigid::{Links, Motors};
use super::springs::{STANDSTILL_DOUBT, known_at};
use super::start::{Drives, around, mean_inertia, spring_at};
use crate::estimate::factor::HeapFactor;
use crate::model::Model;

/// Where a link swings against its held motor if the model states no spring, Hz: geared arms of 5 to 100 kg have it between 5 and 25 Hz.
const ANTIRESONANCE: f64 = 12.0;

/// Responses by a model at some points.
pub(crate) struct Foreseen {
    layout: Layout,
    x: Vec<f64>,
    /// One for each point, or means along a path about it.
    plants: Vec<Plant>,
    /// Inertia and stiffness of gravity at instants of such a path; empty without one.
    instants: Vec<Vec<[DMatrix<f64>; 2]>>,
    omega: Vec<f64>,
    dt: f64,
    links: Links,
    /// Of each joint, 1/k as the model states it, rad/(N m); else 0.
    compliance: Vec<f64>,
    /// Of each joint, whether the model states its spring.
    stated: Vec<bool>,
}

/// What is expected of a joint's spring, standard deviations as shares of the value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ExpectedSpring {
    /// N m/rad.
    pub(crate) stiffness: f64,
    /// By noise and distortion.
    pub(crate) stiffness_std: f64,
    /// By the model's masses and armature, and by what the carrier changes of them.
    pub(crate) stiffness_model: f64,
    /// N m s/rad.
    pub(crate) damping: f64,
    /// By noise and distortion.
    pub(crate) damping_std: f64,
    /// By the model.
    pub(crate) damping_model: f64,
    /// Whether the model states the spring; else it is assumed.
    pub(crate) is_stated: bool,
}

impl Foreseen {
    /// With motors of `joints` at `points`, at `frequencies` (Hz), held and sampled every `dt`.
    ///
    /// # Errors
    /// If the dynamics cannot be computed.
    pub(crate) fn new(
        model: &Model,
        joints: &[String],
        points: &[Vec<f64>],
        frequencies: &[f64],
        dt: f64,
    ) -> Result<Self, FrfError> {
        let motors = points.iter().map(|q| Motors {
            middle: q,
            path: std::slice::from_ref(q),
        });
        let motors: Vec<Motors<'_>> = motors.collect();
        let links = Links::new(model, joints, &[], &motors)?;
        let elasticity = known_at(model, "elasticity", joints);
        let stated = |c: &Option<(f64, f64)>| c.map(|(c, _)| c).filter(|c| *c > 0.0);
        let compliance: Vec<f64> = elasticity
            .iter()
            .map(|c| stated(c).unwrap_or(0.0))
            .collect();
        let plants = links.plants(&motors, &compliance)?.means;
        let springs: Vec<[f64; 2]> = elasticity
            .iter()
            .enumerate()
            .map(|(i, own)| {
                let inertia = mean_inertia(&plants, i);
                let place = stated(own).map_or(std::f64::consts::TAU * ANTIRESONANCE, |c| {
                    (1.0 / (c * inertia)).sqrt()
                });
                spring_at(inertia, place)
            })
            .collect();
        let [armature, viscous] = ["armature", "viscous"].map(|of| known_at(model, of, joints));
        let omega: Vec<f64> = (frequencies.iter())
            .map(|f| std::f64::consts::TAU * f)
            .collect();
        let drives = Drives {
            armature: &armature,
            viscous: &viscous,
            doubts: links.doubts(),
        };
        let (layout, x) = around(&springs, &plants, &omega, &drives);
        Ok(Self {
            links,
            compliance,
            layout,
            x,
            plants,
            instants: Vec::new(),
            omega,
            dt,
            stated: elasticity.iter().map(|own| stated(own).is_some()).collect(),
        })
    }

    /// Torque to motor position at a point and a line; none where the model is singular.
    pub(crate) fn response(&self, point: usize, line: usize) -> Option<DMatrix<Complex64>> {
        let plant = &self.plants[point];
        At::new(plant, &self.layout, &self.x).response(self.omega[line], self.dt)
    }

    /// Angular frequency of a line, rad/s.
    pub(crate) fn omega(&self, line: usize) -> f64 {
        self.omega[line]
    }

    /// Mean inertia of each joint over the points, motor and link together, kg m².
    pub(crate) fn inertia(&self) -> Vec<f64> {
        let own = |i: usize| {
            let armature = self.layout.value(&self.x, Unknown::Armature(i));
            mean_inertia(&self.plants, i) + armature
        };
        (0..self.stated.len()).map(own).collect()
    }

    /// The same robot moving along a path about each point.
    ///
    /// # Errors
    /// If the dynamics cannot be computed.
    pub(crate) fn along(mut self, paths: &[Vec<Vec<f64>>]) -> Result<Self, FrfError> {
        let motors = paths.iter().map(|path| Motors {
            middle: &path[0],
            path,
        });
        let motors: Vec<Motors<'_>> = motors.collect();
        let plants = self.links.plants(&motors, &self.compliance)?;
        (self.plants, self.instants) = (plants.means, plants.along);
        Ok(self)
    }

    /// What a fit of all points will know of the springs, `relative` being the standard deviation of a response (line, joint that is driven, its size)
    /// as a share of it. Along the carrier responses change: what their mean may be off by counts as the model's error, as `frf` counts it. None where the
    /// model is singular.
    pub(crate) fn expected(
        &self,
        relative: impl Fn(usize, usize, f64) -> f64,
    ) -> Option<Vec<ExpectedSpring>> {
        let n = self.layout.unknowns.len();
        let joints = self.stated.len();
        let mut data = HeapFactor::new(n);
        for (point, plant) in self.plants.iter().enumerate() {
            let (mut rows, mut unknowns) = (Vec::new(), 0);
            let at = At::new(plant, &self.layout, &self.x);
            let instants = self.instants.get(point).map(|own| at.along(own));
            for (line, &omega) in self.omega.iter().enumerate() {
                let own = at.derived(omega, self.dt)?;
                unknowns = own.unknowns();
                let along = match &instants {
                    Some(instants) => at.mean_along(instants, omega, self.dt)?,
                    None => DMatrix::zeros(joints, joints),
                };
                for (i, j) in (0..joints).flat_map(|i| (0..joints).map(move |j| (i, j))) {
                    let value = own.response[(i, j)];
                    let std = relative(line, j, value.norm());
                    // Half of the variance in each component.
                    let weight = std::f64::consts::SQRT_2 / std;
                    let slopes = own.slopes(i, j).iter();
                    let row = slopes.map(|slope| slope / value * weight);
                    let row = row.chain([along[(i, j)] / value * (STANDSTILL_DOUBT * weight)]);
                    rows.extend(row.clone().map(|x| x.re));
                    rows.extend(row.map(|x| x.im));
                }
            }
            let mut own = HeapFactor::new(unknowns);
            fold(&mut own, &mut rows);
            data.merge(&plant.over_bodies(&self.layout, own));
        }
        let prior = prior_rows(&self.layout, &self.x);
        let whole = stacked([&data, &prior_factor(&self.layout, &self.x)]).dense();
        let data = data.dense();
        let own = inverse(&whole.view((0, 0), (n, n)).into_owned());
        let posterior = &own * own.transpose();
        let by_noise = &posterior * data.view((0, 0), (n, n)).transpose();
        let by_priors = moved_by_priors(&self.layout, &posterior, &prior);
        let by_path = &by_noise * data.view((0, n), (n, 1));
        let by_model = |row: usize| by_priors.row(row).norm().hypot(by_path[row]);
        let of = |i: usize| {
            let [k, d] = [Unknown::Stiffness(i), Unknown::Damping(i)];
            // The logarithm's deviation is the share of the value.
            let [a, b] = [k, d].map(|of| self.layout.index(of));
            let (a, b) = (a?, b?);
            Some(ExpectedSpring {
                stiffness: self.layout.value(&self.x, k),
                stiffness_std: by_noise.row(a).norm(),
                stiffness_model: by_model(a),
                damping: self.layout.value(&self.x, d),
                damping_std: by_noise.row(b).norm(),
                damping_model: by_model(b),
                is_stated: self.stated[i],
            })
        };
        (0..joints).map(of).collect()
    }
}
