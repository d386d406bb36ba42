//! The device's estimator on recorded logs: its factors, and whether the physically consistent fit keeps what it promises.

use std::path::Path;

use nalgebra::{Cholesky, Matrix4, Vector4};
use proprio_core::Real;
use proprio_core::consistent::{LegConsistentSolver, body};
use proprio_core::estimator::{
    CAD_UNCERTAINTY, EFFECTS, LEG_INERTIAL, LEG_PARAMETERS, LegFactors, LegPrior, LegSolver,
    LegVector, LegWindow, plausible,
};
use proprio_core::factor::packed_len;
use proprio_core::go2::{self, JOINTS_PER_LEG, Leg};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use proprio_core::window::{Push, Sample, Settings, Window};
use proprio_host::identify;
use proprio_host::log::{LogReader, Selection};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Whatever goes wrong with a log.
pub type Failure = Box<dyn std::error::Error>;

/// Starts from which the consistent fit must find the same answer.
pub const STARTS: usize = 20;

/// The factors of a leg's windows of 20 ms in a log, on a base taken as pinned and level.
///
/// # Errors
/// A log that cannot be read, or numbers that overflow.
pub fn factors<T: Real>(
    log: &Path,
    leg: Leg,
    to: impl Fn(f64) -> T,
) -> Result<LegFactors<T>, Failure> {
    folded(log, leg, |sample| Sample {
        time_us: sample.time_us,
        q: sample.q.map(&to),
        dq: sample.dq.map(&to),
        tau: sample.tau.map(&to),
    })
}

/// The estimate of core's estimator and its standard deviations from a log as the motor bus carries it: all columns, one factor per joint,
/// solved at once. What a device reports of the same log is to be this.
///
/// # Errors
/// As [`factors`].
pub fn estimate_over_bus(log: &Path, leg: Leg) -> Result<[LegVector<f64>; 2], Failure> {
    let data = folded(log, leg, |sample| {
        let mut received = *sample;
        for j in 0..JOINTS_PER_LEG {
            [received.q[j], received.dq[j], received.tau[j]] =
                identify::received(j, [sample.q[j], sample.dq[j], sample.tau[j]]);
        }
        received
    })?;
    let mut solver = LegSolver::default();
    solver.start(&LegPrior::of(leg), &data);
    while !solver.advance().map_err(|e| e.to_string())? {}
    let own = |numbers: &[f64]| std::array::from_fn(|k| numbers[k]);
    Ok([own(solver.values()), own(solver.std())])
}

fn folded<T: Real>(
    log: &Path,
    leg: Leg,
    sample: impl Fn(&Sample<f64, JOINTS_PER_LEG>) -> Sample<T, JOINTS_PER_LEG>,
) -> Result<LegFactors<T>, Failure> {
    let mut reader = LogReader::open(log, Selection::Motion)?;
    let settings = Settings::default();
    let mut window: LegWindow<T> = Window::new(
        go2::leg(leg),
        Transform::identity(),
        EFFECTS,
        plausible(leg),
        settings,
    );
    let mut factors = LegFactors::<T>::default();
    while let Some(row) = reader.next_row()? {
        if window.push(&sample(&row.sample(leg))) == Push::Closed {
            factors
                .fold_window(window.rows())
                .map_err(|e| e.to_string())?;
        }
    }
    Ok(factors)
}

/// What the consistent fit of a leg did.
#[derive(Debug, Clone, Copy)]
pub struct ConsistentFit {
    /// Newton steps from the CAD, and the most from the random starts.
    pub iterations: [usize; 2],
    /// Smallest eigenvalue of a body's pseudo-inertia relative to the CAD's, of P₀⁻¹P: without constraints, and consistent.
    pub smallest: [f64; 2],
    /// Bodies that the fit without constraints makes impossible.
    pub impossible: usize,
    /// Frictions and rotor inertias below zero in the fit without constraints.
    pub negative: usize,
    /// The same of the consistent fit.
    pub negative_left: usize,
    /// Sum of squared residuals in units of each joint's noise, over that of the fit without constraints.
    pub misfit: f64,
    /// The costs, each with its prior, over what they are at the fit without constraints, where that is physical: the one that
    /// this fit minimises, and the one that the fit without constraints minimises, whose prior is a parabola about the CAD.
    pub cost: Option<[f64; 2]>,
    /// Greatest difference between the answers of two starts, in standard deviations.
    pub apart: f64,
}

impl ConsistentFit {
    /// Fits a leg's factors from the CAD and from [`STARTS`] random bodies.
    ///
    /// # Errors
    /// The linear algebra's, which sound factors do not have.
    pub fn of(leg: Leg, data: &LegFactors<f64>) -> Result<Self, Failure> {
        let prior = LegPrior::of(leg);
        let mut free = LegSolver::default();
        free.start(&prior, data);
        while !free.advance().map_err(|e| e.to_string())? {}
        let mut solver = LegConsistentSolver::new(
            &prior,
            LegSolver::default(),
            [0.0; LEG_PARAMETERS],
            [0.0; packed_len(LEG_INERTIAL)],
        );
        solver.solve(data).map_err(|e| e.to_string())?;
        let theta = solver.values().to_vec();
        let negative = negative(free.values());
        let impossible = (0..JOINTS_PER_LEG)
            .filter(|&b| !body(free.values(), b).is_physical())
            .count();
        let misfit = |theta: &[f64]| -> f64 {
            let of = |joint| data.sum_of_squares(joint, theta) / data.noise(joint).powi(2);
            (0..JOINTS_PER_LEG).map(of).sum()
        };
        let cost = (impossible + negative == 0)
            .then(|| {
                let own = solver.cost(&theta)? / solver.cost(free.values())?;
                let of = |theta: &[f64]| Some(misfit(theta) + distance(&prior, theta)?);
                Some([own, of(&theta)? / of(free.values())?])
            })
            .flatten();
        let smallest = [free.values(), &theta].map(|theta| least(theta, prior.cad()));
        let mut fit = Self {
            iterations: [solver.iterations(), 0],
            smallest,
            impossible,
            negative,
            negative_left: self::negative(&theta),
            misfit: misfit(&theta) / misfit(free.values()),
            cost,
            apart: 0.0,
        };
        let mut random = ChaCha8Rng::seed_from_u64(leg.index() as u64);
        for _ in 0..STARTS {
            let start = prior
                .cad()
                .each_ref()
                .map(|cad| elsewhere(cad, &mut random));
            solver.start_at(data, &start);
            while !solver.advance().map_err(|e| e.to_string())? {}
            fit.iterations[1] = fit.iterations[1].max(solver.iterations());
            let pairs = solver.values().iter().zip(&theta).zip(solver.std());
            fit.apart = pairs.fold(fit.apart, |most, ((a, b), std)| {
                most.max(((a - b) / std).abs())
            });
        }
        Ok(fit)
    }
}

/// The prior of the fit without constraints: squares of θ's distance to what is known before, in standard deviations.
fn distance(prior: &LegPrior<f64>, theta: &[f64]) -> Option<f64> {
    let of_body = |(b, cad): (usize, &InertialParameters<f64>)| {
        let known = cad.prior(CAD_UNCERTAINTY)?;
        Some(known.sum_of_squares(body(theta, b).0.as_slice()))
    };
    let bodies: Option<f64> = prior.cad().iter().enumerate().map(of_body).sum();
    let effects = prior.effects().iter().zip(&theta[LEG_INERTIAL..]);
    let effects = effects.map(|(known, x)| ((x - known.prior.mean) / known.prior.std).powi(2));
    Some(bodies? + effects.sum::<f64>())
}

/// Effects of θ other than the bias that are negative.
fn negative(theta: &[f64]) -> usize {
    let effects = theta[LEG_INERTIAL..].iter().enumerate();
    effects
        .filter(|(n, value)| {
            let lower = EFFECTS[n % EFFECTS.len()].description().parameters[0].lower;
            **value < lower
        })
        .count()
}

/// [`smallest`] of all bodies.
fn least(theta: &[f64], cad: &[InertialParameters<f64>]) -> f64 {
    let bodies = cad.iter().enumerate();
    bodies
        .map(|(b, cad)| smallest(&body(theta, b), cad))
        .fold(f64::INFINITY, f64::min)
}

/// The smallest eigenvalue of P₀⁻¹P; below zero no body is like this.
fn smallest(body: &InertialParameters<f64>, cad: &InertialParameters<f64>) -> f64 {
    let Some(l) = Cholesky::new(cad.pseudo_inertia()) else {
        return f64::NAN;
    };
    let half = l.l().solve_lower_triangular(&body.pseudo_inertia());
    let both = half.and_then(|half| l.l().solve_lower_triangular(&half.transpose()));
    both.map_or(f64::NAN, |p| p.symmetric_eigenvalues().min())
}

/// A body up to ten times as heavy or as light as the CAD's, in each of four random directions of the pseudo-inertia.
fn elsewhere(cad: &InertialParameters<f64>, random: &mut ChaCha8Rng) -> InertialParameters<f64> {
    let Some(l) = Cholesky::new(cad.pseudo_inertia()) else {
        return *cad;
    };
    let directions = Matrix4::from_fn(|_, _| random.sample::<f64, _>(StandardNormal))
        .qr()
        .q();
    let sizes = Vector4::from_fn(|_, _| 10f64.powf(random.random_range(-1.0..1.0)));
    let between = directions * Matrix4::from_diagonal(&sizes) * directions.transpose();
    InertialParameters::from_pseudo_inertia(&(l.l() * between * l.l().transpose()))
}
