//! From a model and settings to the function that a search makes small.

use nalgebra::DMatrix;
use proprio_core::effect::EffectKind;
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::Leg;
use proprio_core::inertia::{INERTIAL, InertialParameters, NAMES};

use super::clearance::Clearance;
use super::columns::{Column, is_known};
use super::cost::Cost;
use super::fourier::Basis;
use super::limb::{self, Limb};
use super::problem::{JointLimits, Known, Limits, Problem};
use super::settings::{Goal, Settings};
use super::space::{Space, by_kind, whole_prior};
use super::{ExciteError, Measured, go2};
use crate::log::leg_named;
use crate::model::{self, BASE, Model, Source, UnknownName};

/// Samples per period of the highest wave. A wave's peak lies at most 1.2 % above its highest sample then, which the search
/// keeps back (`search::SHARE`).
const SAMPLES_PER_WAVE: usize = 20;
/// Noise of a torque's mean over a window of 20 ms, as a share of the motor's greatest torque: what is left on a real Go2 when
/// every effect is in the model, 0.2 N m beside motors of 24 and 45 N m.
const NOISE: f64 = 0.005;
/// That window, s.
const WINDOW: f64 = 0.02;
/// How much wider than its prior the size of a wrong effect may be.
const WRONG_SIZE: f64 = 3.0;
/// Shapes at which a wrong effect is tried, as multiples of the shape that the prior expects.
const WRONG_SHAPES: [f64; 3] = [0.5, 1.0, 2.0];

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
        let pose = of.pose()?;
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

        let samples = SAMPLES_PER_WAVE * settings.harmonics;
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
            Goal::Condition => (
                part(Vec::new(), kind.scale.clone(), vec![1.0; bodies])?,
                Cost::Condition {
                    power: f64::INFINITY,
                },
            ),
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
            Goal::Separation { .. } | Goal::Condition => None,
        };
        of.feasible(&problem)?;
        let measured = Measured {
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
            Source::Go2 => leg_named(&self.limb.name).ok(),
            Source::Urdf(_) => None,
        }
    }

    /// A bent leg, hips a little outwards; other robots in the middle of their range.
    fn pose(&self) -> Result<Vec<f64>, ExciteError> {
        let bodies = self.model.robot().bodies();
        let usual = |b: usize| match self.leg() {
            Some(leg) => {
                let outwards = if matches!(leg, Leg::FL | Leg::RL) {
                    0.1
                } else {
                    -0.1
                };
                [outwards, 0.9, -1.7][b - self.limb.bodies.start]
            }
            None => {
                let [lower, upper] = bodies[b].limits;
                if lower.is_finite() && upper.is_finite() {
                    (lower + upper) / 2.0
                } else {
                    0.0
                }
            }
        };
        let mut pose: Vec<f64> = self.limb.bodies.clone().map(usual).collect();
        for (name, value) in &self.settings.pose {
            let joint = self.model.robot().joint(name)?;
            if self.limb.bodies.contains(&joint) {
                pose[joint - self.limb.bodies.start] = *value;
            }
        }
        Ok(pose)
    }

    fn limits(&self, alone: bool) -> Result<Limits, ExciteError> {
        let m = &self.settings.margins;
        let limits = |b: usize| {
            let body = &self.model.robot().bodies()[b];
            let [lower, upper] = body.limits;
            let joint = JointLimits {
                // Without stops a joint still has cables.
                position: [
                    (lower + m.position).max(-WHOLE_TURNS),
                    (upper - m.position).min(WHOLE_TURNS),
                ],
                velocity: body.velocity * m.velocity,
                acceleration: m.acceleration,
                torque: body.effort * m.torque,
                power: 0.25 * body.effort * body.velocity * m.power,
            };
            let no_room = |what| ExciteError::NoRoom {
                joint: body.name.clone(),
                what,
            };
            let exceeds =
                |x: f64, least: f64| x.partial_cmp(&least) == Some(std::cmp::Ordering::Greater);
            if !exceeds(joint.position[1] - joint.position[0], 1e-3) {
                return Err(no_room("position"));
            }
            if !exceeds(joint.velocity, 0.0) {
                return Err(no_room("velocity"));
            }
            if !exceeds(joint.torque, 0.0) {
                return Err(no_room("torque"));
            }
            Ok(joint)
        };
        Ok(Limits {
            joints: self
                .limb
                .bodies
                .clone()
                .map(limits)
                .collect::<Result<_, _>>()?,
            uncertainty: m.uncertainty,
            clearance: self.leg().map_or_else(Clearance::default, |leg| {
                go2::clearance(leg, alone, m.ground)
            }),
            margin: m.distance,
        })
    }

    /// The effects that a design is to tell: those that are identified by default, joint by joint.
    fn effect_columns(&self) -> Vec<Column> {
        let joints = 0..self.limb.bodies.len();
        joints
            .flat_map(|j| EFFECTS.map(|effect| column(effect, j, 0, 1.0)))
            .collect()
    }

    fn effect_std(&self, column: &Column) -> f64 {
        let joint = self.limb.bodies.start + column.joint;
        self.model.effect_prior(column.effect, joint).prior.std
    }

    fn prior(&self, effects: &[Column]) -> Result<DMatrix<f64>, ExciteError> {
        let bodies: Vec<(InertialParameters<f64>, f64)> = self
            .limb
            .bodies
            .clone()
            .map(|b| {
                (
                    self.model.robot().bodies()[b].inertia,
                    self.model.cad_uncertainty(b),
                )
            })
            .collect();
        let stds: Vec<f64> = effects
            .iter()
            .map(|column| self.effect_std(column))
            .collect();
        whole_prior(&bodies, &stds).ok_or_else(|| ExciteError::Unphysical(self.limb.name.clone()))
    }

    /// The effects that the model has a value of, and where it has none of friction or rotor inertia what is expected of them.
    fn known(&self) -> Vec<Known> {
        let mut known = stated(self.model, self.limb);
        for (j, joint) in self.limb.bodies.clone().enumerate() {
            if self.model.robot().bodies()[joint].motor.is_none() {
                continue;
            }
            for effect in EXPECTED
                .into_iter()
                .filter(|effect| self.model.effect(*effect, joint).is_none())
            {
                let mean = self.model.effect_prior(effect, joint).prior.mean;
                known.push((column(effect, j, 0, 1.0), mean));
            }
        }
        known
    }

    /// One over the noise of a row that stands for `step` seconds.
    fn weights(&self, step: f64) -> Vec<f64> {
        let windows = window_weights(self.model, self.limb).into_iter();
        windows
            .map(|weight| weight * (step / WINDOW).sqrt())
            .collect()
    }

    fn earlier(&self, scale: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let own = self
            .settings
            .earlier
            .iter()
            .filter(|e| e.limb == self.limb.name);
        own.map(|earlier| (&earlier.triangle * scale).qr().unpack_r())
            .reduce(|sum, next| super::cost::triangle(&next, Some(&sum)))
    }

    /// Names of all parameters.
    fn names(&self, effects: &[Column]) -> Vec<String> {
        let bodies = self.limb.bodies.clone();
        let joint = |j: usize| self.model.joint_name(self.limb.bodies.start + j);
        let inertial =
            bodies.flat_map(|b| NAMES.map(|k| format!("{k}:{}", self.model.joint_name(b))));
        let effects = effects
            .iter()
            .map(|e| format!("{}:{}", e.effect.name(), joint(e.joint)));
        inertial.chain(effects).collect()
    }

    /// Rows that pick named parameters, each in units of its prior's standard deviation, out of the scaled ones.
    fn named(
        &self,
        names: &[String],
        effects: &[Column],
        scale: &DMatrix<f64>,
        root: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, ExciteError> {
        let all = self.names(effects);
        let mut rows = Vec::new();
        for name in names {
            let at = all.iter().position(|known| known == name);
            let at = at.ok_or_else(|| {
                UnknownName::new("parameter", name, all.iter().map(String::as_str))
            })?;
            rows.push(scale.row(at) / root.row(at).norm());
        }
        Ok(DMatrix::from_rows(&rows))
    }

    /// Columns, scale and cost of a design that tells two effects apart.
    fn separation(
        &self,
        pair: [EffectKind; 2],
        joint: Option<&str>,
        body: &dyn Limb,
        theta: &[f64],
    ) -> Result<(Vec<Column>, DMatrix<f64>, Cost), ExciteError> {
        for effect in pair {
            if !is_known(effect) && effect != EffectKind::Payload {
                return Err(ExciteError::NotDesignable(effect.name()));
            }
        }
        let joints: Vec<usize> = match joint {
            Some(name) => vec![self.model.robot().joint(name)?],
            None => self.limb.bodies.clone().collect(),
        };
        let joints: Vec<usize> = joints
            .into_iter()
            .filter(|joint| *joint != BASE && self.limb.bodies.contains(joint))
            .map(|joint| joint - self.limb.bodies.start)
            .collect();
        let mut columns = self.effect_columns();
        columns.retain(|c| !(joints.contains(&c.joint) && pair.contains(&c.effect)));
        let root = self.prior(&columns)?;
        let nuisance = Space::new(body, theta, &columns, &root);
        // Each effect of each pair as one true version and the wrong ones that are to be told from it.
        let mut added: Vec<Direction> = Vec::new();
        let mut pairs = Vec::new();
        for &j in &joints {
            let own: [(usize, Vec<usize>); 2] = pair.map(|effect| {
                let first = nuisance.rank() + added.len();
                let directions = self.directions(effect, j, &mut columns, theta);
                let wrong = (first + 1..first + directions.len()).collect();
                added.extend(directions);
                (first, wrong)
            });
            pairs.push((own[0].0, own[1].1.clone()));
            pairs.push((own[1].0, own[0].1.clone()));
        }
        let (p, r) = (INERTIAL * body.joints(), nuisance.rank());
        let mut scale = DMatrix::zeros(p + columns.len(), r + added.len());
        scale
            .view_mut((0, 0), (nuisance.scale.nrows(), r))
            .copy_from(&nuisance.scale);
        for (n, direction) in added.iter().enumerate() {
            for &(entry, value) in direction {
                scale[(entry, r + n)] = value;
            }
        }
        Ok((columns, scale, Cost::Separation { nuisance: r, pairs }))
    }

    /// Combinations of parameters, the true version first.
    fn directions(
        &self,
        effect: EffectKind,
        j: usize,
        columns: &mut Vec<Column>,
        theta: &[f64],
    ) -> Vec<Direction> {
        let joint = self.limb.bodies.start + j;
        let p = INERTIAL * self.limb.bodies.len();
        let prior = self.model.effect_prior(effect, joint).prior;
        if effect == EffectKind::Payload {
            return payload(j, theta, prior.std);
        }
        let shape = effect.description().shape();
        let usual = shape.map_or(1.0, |n| {
            self.model.robot().parameter_prior(effect, joint, n).mean
        });
        let shapes: &[f64] = if shape.is_some() {
            &WRONG_SHAPES
        } else {
            &[1.0]
        };
        let parts = effect.columns().max(1);
        let mut directions = Vec::new();
        let mut add = |column: Column, size: f64| {
            columns.push(column);
            directions.push(vec![(p + columns.len() - 1, size)]);
        };
        add(column(effect, j, 0, usual), prior.std);
        for part in 0..parts {
            for shape in shapes {
                add(
                    column(effect, j, part, usual * shape),
                    WRONG_SIZE * prior.std,
                );
            }
        }
        directions
    }

    /// The pose itself must be within the limits.
    fn feasible(&self, problem: &Problem) -> Result<(), ExciteError> {
        let x = vec![0.0; problem.unknowns()];
        let constraints = problem.evaluate(&x, 1.0).constraints;
        let most = |a: &usize, b: &usize| constraints[*a].total_cmp(&constraints[*b]);
        let beyond =
            || (0..constraints.len()).filter(|n| constraints[*n] > 0.0 || constraints[*n].is_nan());
        // A joint's own limit says more than what its link then comes near.
        let of_joint = beyond()
            .filter(|n| problem.constraint(*n).1.is_some())
            .max_by(most);
        let Some(worst) = of_joint.or_else(|| beyond().max_by(most)) else {
            return Ok(());
        };
        let (what, joint) = problem.constraint(worst);
        let name = |j: usize| self.model.joint_name(self.limb.bodies.start + j);
        let poses = problem.pose.iter().enumerate();
        let poses: Vec<String> = poses.map(|(j, q)| format!("{}={q:.3}", name(j))).collect();
        Err(ExciteError::Pose {
            pose: poses.join(","),
            what: joint.map_or_else(|| what.clone(), |j| format!("{what} of {}", name(j))),
            percent: 100.0 * constraints[worst],
        })
    }
}

/// The effects that a model has a value of, with it.
pub(super) fn stated(model: &Model, limb: &model::Limb) -> Vec<Known> {
    let mut stated = Vec::new();
    for (j, joint) in limb.bodies.clone().enumerate() {
        for own in model
            .effects_of(joint)
            .into_iter()
            .filter(|own| is_known(own.effect))
        {
            let shape = own.effect.description().shape();
            let at = shape
                .and_then(|n| own.estimates[n])
                .map_or(1.0, |estimate| estimate.value);
            let values = own
                .estimates
                .iter()
                .enumerate()
                .filter(|(n, _)| Some(*n) != shape);
            for (part, (_, estimate)) in values.take(own.effect.columns().max(1)).enumerate() {
                if let Some(estimate) = estimate {
                    stated.push((column(own.effect, j, part, at), estimate.value));
                }
            }
        }
    }
    stated
}

/// A limb's parameters and what is known of them before any data.
pub(super) struct Knowledge {
    pub(super) body: Box<dyn Limb>,
    pub(super) theta: Vec<f64>,
    pub(super) columns: Vec<Column>,
    /// A square root of the prior's covariance.
    pub(super) root: DMatrix<f64>,
    pub(super) names: Vec<String>,
}

impl Knowledge {
    pub(super) fn of(model: &Model, limb: &model::Limb) -> Result<Self, ExciteError> {
        let settings = Settings::default();
        let of = Design {
            model,
            limb,
            settings: &settings,
        };
        let columns = of.effect_columns();
        Ok(Self {
            body: of.dynamics()?,
            theta: of.theta(),
            root: of.prior(&columns)?,
            names: of.names(&columns),
            columns,
        })
    }
}

/// One over the noise of each joint's torque over a window.
pub(super) fn window_weights(model: &Model, limb: &model::Limb) -> Vec<f64> {
    let noise = |b: usize| {
        let effort = model.robot().bodies()[b].effort;
        if effort.is_finite() {
            NOISE * effort
        } else {
            1.0
        }
    };
    limb.bodies.clone().map(|b| 1.0 / noise(b)).collect()
}

/// Entries of a combination of parameters.
type Direction = Vec<(usize, f64)>;

/// A joint without stops moves this far at most, rad: two turns either way.
const WHOLE_TURNS: f64 = 2.0 * std::f64::consts::TAU;

/// What every geared motor has.
const EXPECTED: [EffectKind; 3] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Armature,
];

fn column(effect: EffectKind, joint: usize, part: usize, shape: f64) -> Column {
    Column {
        joint,
        effect,
        part,
        shape,
    }
}

/// A load of `mass` at the body's centre of mass; and as a wrong version any mass and first moment, the inertia being small.
fn payload(j: usize, theta: &[f64], mass: f64) -> Vec<Direction> {
    let own = &theta[INERTIAL * j..INERTIAL * (j + 1)];
    let c = [1, 2, 3].map(|k| own[k] / own[0].max(1e-9));
    let square = c.iter().map(|x| x * x).sum::<f64>();
    let at = |k: usize| INERTIAL * j + k;
    let mut load = vec![(at(0), mass)];
    load.extend((0..3).map(|k| (at(1 + k), mass * c[k])));
    let diagonal = [4, 7, 9];
    load.extend((0..3).map(|k| (at(diagonal[k]), mass * (square - c[k] * c[k]))));
    load.extend([
        (at(5), -mass * c[0] * c[1]),
        (at(6), -mass * c[0] * c[2]),
        (at(8), -mass * c[1] * c[2]),
    ]);
    let far = square.sqrt().max(0.05);
    let mut all = vec![load, vec![(at(0), WRONG_SIZE * mass)]];
    all.extend((0..3).map(|k| vec![(at(1 + k), WRONG_SIZE * mass * far)]));
    all.extend(diagonal.map(|k| vec![(at(k), WRONG_SIZE * mass * far * far)]));
    all
}
