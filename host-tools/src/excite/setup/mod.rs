//! From a model and settings to the function that a search makes small.
//!
//! Files beside:
//!
//! - `knowledge`: what a model knows of a limb before any data: priors, names, and the effects that it states
//! - `limits`: where a motion begins and ends, and what it must keep to
//! - `separation`: two effects as columns that a motion is to tell apart

mod knowledge;
mod limits;
mod separation;

use nalgebra::DMatrix;
use proprio_core::go2::Leg;
use proprio_core::inertia::INERTIAL;

use super::columns::Column;
use super::cost::Cost;
use super::fourier::Basis;
use super::limb::{self, Limb};
use super::problem::Problem;
use super::settings::{Goal, Settings};
use super::space::{Space, by_kind};
use super::{ExciteError, Measured};
use crate::model::{self, Model, Source};
pub(super) use knowledge::{Information, stated, window_weights};

/// Samples per period of the highest wave. A wave's peak lies at most 1.2 % above its highest sample then, which the search
/// keeps back (`search::SHARE`).
const SAMPLES_PER_WAVE: usize = 20;
/// Fewest samples of a period.
const LEAST_SAMPLES: usize = 128;

/// A limb's design, ready to be searched.
pub(super) struct Setup {
    pub(super) problem: Problem,
    pub(super) goal: Cost,
    pub(super) measured: Measured,
}

/// A limb of a model as a design sees it.
struct Design<'a> {
    model: &'a Model,
    limb: &'a model::Limb,
    settings: &'a Settings,
}

impl Setup {
    pub(super) fn new(
        model: &Model,
        limb: &model::Limb,
        settings: &Settings,
        alone: bool,
    ) -> Result<Self, ExciteError> {
        let of = Design {
            model,
            limb,
            settings,
        };
        let pose = of.pose(alone)?;
        let limits = of.limits(alone)?;
        let theta = of.theta();
        let effects = of.effect_columns();
        let body = of.dynamics()?;
        let bodies = body.joints();
        let all_root = of.prior(&effects)?;
        let inertial_root = all_root
            .view((0, 0), (INERTIAL * bodies, INERTIAL * bodies))
            .into_owned();
        let kind_root = by_kind(&inertial_root, bodies);
        let kind = Space::new(body.as_ref(), &theta, &[], &kind_root);
        let si_root = DMatrix::identity(INERTIAL * bodies, INERTIAL * bodies);
        let si = Space::new(body.as_ref(), &theta, &[], &si_root);
        let whole = Space::new(body.as_ref(), &theta, &effects, &all_root);

        let samples = (SAMPLES_PER_WAVE * settings.harmonics).max(LEAST_SAMPLES);
        let period = settings.duration / f64::from(settings.repeats());
        let basis = Basis::new(period, settings.harmonics, settings.ends, samples);
        let part = |columns: Vec<Column>, scale: DMatrix<f64>, weights: Vec<f64>| {
            Ok::<_, ExciteError>(Problem {
                limb: of.dynamics()?,
                theta: theta.clone(),
                known: of.known(),
                columns,
                scale,
                weights,
                repeats: f64::from(settings.repeats()),
                earlier: None,
                basis: basis.clone(),
                pose: pose.clone(),
                limits: limits.clone(),
            })
        };
        let noise = of.weights(period / samples as f64);
        let earlier = of.earlier(&whole.scale);
        let (mut problem, goal) = match &settings.goal {
            Goal::Condition | Goal::ConditionSi => {
                let units = match settings.goal {
                    Goal::ConditionSi => &si,
                    _ => &kind,
                };
                let power = f64::INFINITY;
                (
                    part(Vec::new(), units.scale.clone(), vec![1.0; bodies])?,
                    Cost::Condition { power },
                )
            }
            Goal::Determinant => (
                part(effects.clone(), whole.scale.clone(), noise.clone())?,
                Cost::Determinant,
            ),
            Goal::Variance(names) => (
                part(effects.clone(), whole.scale.clone(), noise.clone())?,
                Cost::Variance(of.named(names, &effects, &whole.scale, &all_root)?),
            ),
            Goal::Separation {
                effects: pair,
                joint,
            } => {
                let (columns, scale, goal) =
                    of.separation(*pair, joint.as_deref(), body.as_ref(), &theta)?;
                (part(columns, scale, noise.clone())?, goal)
            }
        };
        problem.earlier = match settings.goal {
            Goal::Determinant | Goal::Variance(_) => earlier,
            Goal::Separation { .. } | Goal::Condition | Goal::ConditionSi => None,
        };
        of.feasible(&problem)?;
        let names = of.names(&effects).into_iter().enumerate();
        let priors = names.map(|(n, name)| (name, all_root.row(n).norm()));
        let priors = priors.collect();
        let earlier = of.earlier(&whole.scale);
        let measured = Measured {
            priors,
            earlier,
            whole: part(effects, whole.scale, noise)?,
            kind,
            si,
        };
        Ok(Self {
            problem,
            goal,
            measured,
        })
    }
}

/// A limb's bodies, what is known of its joints, and what limits them: without anything to search for.
pub(super) fn bare_problem(
    model: &Model,
    limb: &model::Limb,
    settings: &Settings,
    alone: bool,
) -> Result<Problem, ExciteError> {
    let of = Design {
        model,
        limb,
        settings,
    };
    let body = of.dynamics()?;
    let joints = body.joints();
    Ok(Problem {
        theta: of.theta(),
        known: of.known(),
        columns: Vec::new(),
        scale: DMatrix::zeros(INERTIAL * joints, 0),
        weights: vec![1.0; joints],
        repeats: 1.0,
        earlier: None,
        basis: Basis::new(
            settings.period,
            settings.harmonics,
            settings.ends,
            LEAST_SAMPLES,
        ),
        pose: of.pose(alone)?,
        limits: of.limits(alone)?,
        limb: body,
    })
}

impl Design<'_> {
    fn dynamics(&self) -> Result<Box<dyn Limb>, ExciteError> {
        limb::of(self.model, self.limb)
            .ok_or_else(|| ExciteError::TooLarge(self.limb.name.clone(), self.limb.bodies.len()))
    }

    fn theta(&self) -> Vec<f64> {
        let bodies = self.limb.bodies.clone();
        bodies
            .flat_map(|b| self.model.inertia(b).0.iter().copied().collect::<Vec<_>>())
            .collect()
    }

    fn leg(&self) -> Option<Leg> {
        match self.model.robot().source() {
            Source::Go2 => Leg::from_name(&self.limb.name),
            Source::Urdf(_) => None,
        }
    }
}
