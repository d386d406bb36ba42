//! Motions that tell: Fourier series that excite what can be identified, within the robot's limits at every instant.
//!
//! A design is a point in a space of periodic motions that begin and end at rest in one pose ([`fourier`]). What a motion tells
//! are the rows of the torque regressor along it, scaled by the prior to the parameters that can be told at all (`space`); a
//! cost of their triangle is made small (`cost`), its slopes by the unknowns being exact (`limb`, `problem`), by an augmented
//! Lagrangian from many starts (`optimise`, `search`). What is found is proved to be within the limits between the samples
//! too (`proof`): position, velocity, acceleration, torque and power for all parameters of a stated uncertainty, and what
//! capsules come near ([`clearance`]).
//!
//! The trunk of a robot that stands has a room of its own ([`trunk`]), periodic experiments for frequency responses too ([`frf`]).
//!
//! Limbs of a pinned base do not feel each other, and each is designed on its own; they share period and length.
//!
//! Literature: Swevers et al. 1997 (Fourier series), Gautier & Khalil 1992 (condition number), Park 2006 (slopes),
//! Atkinson & Fedorov 1975 (T-optimality).
//!
//! Files beside:
//!
//! - `columns`: torques of physical effects per unit of their parameter, with slopes by the motion
//! - `earlier`: what logs know already: their rows of the momentum equation, folded into one triangle per limb
//! - `error`: why there is no design
//! - `feedforward`: the torque that a model foresees for a motion: what it states, and nothing that is only expected
//! - `go2`: the Go2's shapes, as capsules: what a leg must stay clear of
//! - `interval`: numbers known to lie between two others (Moore 1966), and vectors of them: what a proof over a stretch of time needs
//! - `output`: a design as files: samples to play, coefficients to compute with
//! - `random`: random motions within the limits: what a design is compared with
//! - `settings`: what is asked of a design
//! - `setup`: from a model and settings to the function that a search makes small
//! - `shapes`: a file of shapes that a robot must stay clear of: its own, and what stands around it
//! - `spectrum`: singular values and right singular vectors of a triangle

pub mod clearance;
mod columns;
mod cost;
pub mod earlier;
mod error;
mod feedforward;
pub mod fourier;
pub mod frf;
mod go2;
mod identifiability;
mod interval;
mod limb;
mod optimise;
pub mod output;
mod problem;
mod proof;
mod random;
mod search;
mod settings;
mod setup;
pub mod shapes;
mod space;
mod spectrum;
#[cfg(test)]
mod tests;
pub mod trunk;

use serde::Serialize;

use crate::model::{self, Model};
use cost::{Cost, triangle};
pub use error::ExciteError;
pub use feedforward::Feedforward;
pub use fourier::{Ends, Motion, Series};
pub use identifiability::{Identifiability, LimbIdentifiability, told};
use limb::Instant;
pub use problem::JointLimits;
use problem::Problem;
pub use proof::Violation;
pub use random::RandomMotions;
pub use search::{Progress, Supervisor};
pub use settings::{Earlier, Goal, Margins, Settings};
use setup::Setup;
use spectrum::spectrum;

/// The motion of a limb and what it tells.
#[derive(Debug, Clone)]
pub struct LimbDesign {
    /// The limb's name.
    pub limb: String,
    /// Its joints in the model.
    pub joints: Vec<usize>,
    /// The motion.
    pub motion: Motion,
    /// The measures of what it tells.
    pub measures: Measures,
    /// What each parameter's standard deviation becomes.
    pub expected: Vec<Expected>,
    /// Limits that are not kept: none, or the motion must not be played.
    pub violations: Vec<Violation>,
    /// The best cost over the time of the search.
    pub history: Vec<Progress>,
    problem: std::sync::Arc<Problem>,
}

/// A parameter's standard deviation before a motion and after it, in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// `m:FR_calf`, `coulomb:FR_hip`.
    pub parameter: String,
    /// The prior's.
    pub prior_std: f64,
    /// With the motion recorded once, and the earlier logs that were given.
    pub std: f64,
}

/// What a motion tells of a limb.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measures {
    /// σ₁ / σ_r of the identifiable inertial columns, each kind of parameter scaled by the prior's largest standard deviation.
    pub condition_number: f64,
    /// The same for columns in kg, kg m and kg m², as in most of the literature.
    pub condition_number_si: f64,
    /// r, how many combinations of inertial parameters can be told at all.
    pub rank: usize,
    /// log det(1 + Rᵀ R) of bodies, friction, rotor inertia and bias, scaled by the whole prior: what the motion tells beyond it,
    /// in nats, twice counted.
    pub log_det: f64,
}

/// The reference and the torque that goes with it, at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Position, rad.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Acceleration, rad/s².
    pub ddq: Vec<f64>,
    /// Feed-forward torque, N m: the model's, with friction.
    pub tau: Vec<f64>,
}

impl LimbDesign {
    /// What to command at `t` seconds; before the start and after the end, what holds the pose.
    pub fn command(&self, t: f64) -> Command {
        command(&self.problem, &self.motion, t)
    }

    /// The limits that are not kept, a sentence each.
    pub fn violation_sentences(&self, model: &Model) -> Vec<String> {
        let sentence = |v: &Violation| {
            let joint = |j: usize| format!(" of {}", model.joint_name(self.joints[j]));
            let joint = v.joint.map_or(String::new(), joint);
            let percent = 100.0 * v.beyond;
            format!("{}{joint} at {:.3} s, by {percent:.2} %", v.what, v.t)
        };
        self.violations.iter().map(sentence).collect()
    }

    /// What the joints may do, margins kept back.
    pub fn limits(&self) -> &[JointLimits] {
        &self.problem.limits.joints
    }

    /// Origins of the joints in the base's frame at `t` seconds, m, root first, and of the foot if it is given in the last
    /// body's frame.
    pub fn points(&self, t: f64, foot: Option<&nalgebra::Vector3<f64>>) -> Vec<[f64; 3]> {
        let q: Vec<f64> = (0..self.joints.len())
            .map(|j| self.motion.at(j, t)[0])
            .collect();
        let placements = self.problem.limb.placements(&q);
        let mut points: Vec<[f64; 3]> = placements.iter().map(|p| p.translation.into()).collect();
        if let (Some(foot), Some(last)) = (foot, placements.last()) {
            points.push((last.rotation * foot + last.translation).into());
        }
        points
    }

    /// The largest constraint of a check at `rate` instants a second; within the limits where it is not positive.
    pub fn dense_check(&self, rate: f64) -> f64 {
        proof::densest(&self.problem, &self.motion, rate)
    }
}

fn command(problem: &Problem, motion: &Motion, t: f64) -> Command {
    let n = problem.joints();
    let mut at = Instant::zero(n);
    for j in 0..n {
        [at.q[j], at.dq[j], at.ddq[j], _] = motion.at(j, t);
    }
    let tau = problem.foreseen(&at);
    Command {
        q: at.q,
        dq: at.dq,
        ddq: at.ddq,
        tau,
    }
}

/// Designs a motion for each of `limbs`.
///
/// # Errors
/// [`ExciteError`]: limits or a pose that leave no motion, an unknown name, a limb that is too large.
pub fn design(
    model: &Model,
    limbs: &[model::Limb],
    settings: &Settings,
    supervisor: &dyn Supervisor,
) -> Result<Vec<LimbDesign>, ExciteError> {
    settings.check()?;
    let setups: Vec<Setup> = limbs
        .iter()
        .map(|limb| Setup::new(model, limb, settings, limbs.len() == 1))
        .collect::<Result<_, _>>()?;
    let mut designs = Vec::new();
    for (n, setup) in setups.into_iter().enumerate() {
        let part = Part {
            supervisor,
            before: n,
            limbs: limbs.len(),
        };
        designs.push(design_limb(&limbs[n], setup, settings, &part)?);
    }
    Ok(designs)
}

/// A limb's part of the progress.
struct Part<'a> {
    supervisor: &'a dyn Supervisor,
    before: usize,
    limbs: usize,
}

impl Supervisor for Part<'_> {
    fn stop(&self) -> bool {
        self.supervisor.stop()
    }

    fn progress(&self, done: usize, of: usize, best: Option<f64>) {
        self.supervisor
            .progress(self.before * of + done, self.limbs * of, best);
    }
}

fn design_limb(
    limb: &model::Limb,
    setup: Setup,
    settings: &Settings,
    supervisor: &dyn Supervisor,
) -> Result<LimbDesign, ExciteError> {
    let (repeats, seed, starts) = (settings.repeats(), settings.seed, settings.starts);
    let Setup {
        problem,
        goal,
        measured,
    } = setup;
    let found = search::search(&problem, &goal, repeats, seed, starts, supervisor)
        .ok_or_else(|| no_motion(&problem, limb, settings))?;
    let measures = measured.of(&problem, &found.point.x);
    let expected = measured.expected(&found.point.x);
    Ok(LimbDesign {
        limb: limb.name.clone(),
        joints: limb.bodies.clone().collect(),
        motion: found.motion,
        measures,
        expected,
        violations: found.violations,
        history: found.history,
        problem: std::sync::Arc::new(problem),
    })
}

/// What no start got below: the limit that the calmest of random motions exceeds the most.
fn no_motion(problem: &Problem, limb: &model::Limb, settings: &Settings) -> ExciteError {
    let x: Vec<f64> = search::guess(problem, settings.seed, 0)
        .iter()
        .map(|x| 0.1 * x)
        .collect();
    let of = problem.evaluate(&x, 1.0);
    let worst =
        (0..of.constraints.len()).max_by(|&a, &b| of.constraints[a].total_cmp(&of.constraints[b]));
    let (what, joint) = problem.constraint(worst.unwrap_or_default());
    ExciteError::NoMotion {
        limb: limb.name.clone(),
        what,
        joint: joint.map(|j| limb.bodies.start + j),
    }
}

/// The scales in which [`Measures`] are told.
#[derive(Debug)]
pub(crate) struct Measured {
    kind: space::Space,
    si: space::Space,
    whole: Problem,
    /// The triangle of earlier logs in the scaled parameters of `whole`.
    earlier: Option<nalgebra::DMatrix<f64>>,
    /// Names of all parameters, and their standard deviations before any data.
    priors: Vec<(String, f64)>,
}

impl Measured {
    /// The measures of the motion of unknowns `x` of `problem`.
    fn of(&self, problem: &Problem, x: &[f64]) -> Measures {
        let condition = |space| condition_number(space, problem, x);
        let all = self.whole.evaluate(x, 1.0);
        let told = self.whole.cost(&all, &Cost::Determinant);
        Measures {
            condition_number: condition(&self.kind),
            condition_number_si: condition(&self.si),
            rank: self.kind.rank(),
            log_det: told.map_or(f64::NEG_INFINITY, |value| -2.0 * value.cost),
        }
    }

    /// What the standard deviations become by the motion of unknowns `x`.
    fn expected(&self, x: &[f64]) -> Vec<Expected> {
        let scale = &self.whole.scale;
        let r = scale.ncols();
        let known = triangle(&nalgebra::DMatrix::identity(r, r), self.earlier.as_ref());
        let after = triangle(&self.whole.evaluate(x, 1.0).rows, Some(&known));
        // Their rows' lengths are the standard deviations of what can be identified.
        let spread = after.transpose().solve_lower_triangular(&scale.transpose());
        let own = |(n, (parameter, prior_std)): (usize, &(String, f64))| {
            let open = prior_std * prior_std - scale.row(n).norm_squared();
            let rest = spread.as_ref().map_or_else(
                || scale.row(n).norm_squared(),
                |spread| spread.column(n).norm_squared(),
            );
            Expected {
                parameter: parameter.clone(),
                prior_std: *prior_std,
                std: (open.max(0.0) + rest).sqrt(),
            }
        };
        self.priors.iter().enumerate().map(own).collect()
    }
}

/// σ₁ / σ_r of the inertial columns of the motion of unknowns `x` of `problem`, in the scale of `space`.
fn condition_number(space: &space::Space, problem: &Problem, x: &[f64]) -> f64 {
    let rows = problem.inertial_rows(x, &space.scale);
    let values = spectrum(&triangle(&rows, None)).map(|(values, _)| values);
    values.map_or(f64::INFINITY, |values| values.max() / values.min())
}
