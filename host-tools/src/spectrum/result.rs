//! What `frf` reports.

use std::path::{Path, PathBuf};

use realfft::num_complex::Complex64;
use serde::Serialize;

use super::error::FrfError;
use super::experiments::Experiments;
use super::fit::{Fit, Problem, rms};
use super::flexible::At;
use super::layout::Unknown;
use super::record::{Record, TorqueUnit};
use super::response::{self, Point};
use super::rigid::Bend;
use super::springs::{self, FRICTION_DOUBT, Fitted, bench, mode, with_model};
use crate::catalogue;
use crate::model::{JointQuantity, LINK_ELASTICITY, Model, Witness, Witnessed};
use crate::robust::median;
use crate::summary::ErrorRange;

/// A joint is silent if the noise of more than this share of its own lines exceeds half the response.
const SILENT: f64 = 0.5;
/// Held-out errors beyond the scatter, log magnitude, from which on causes are tested: a quarter of a response. A bench that fits has
/// 0.07, with the sign turned 0.32; an arm of four joints 0.28.
const DOUBTED: f64 = 0.25;
/// The same from which on nothing is learnt. Of arms in studies/frf/bends.md one missing bend left 0.41 and springs 1 to 4 % off, two left 0.77 and
/// springs 27 % off; scatter at lines that are used reaches 0.35. Of 36 such arms, seeds 1 to 6, none is refused.
const UNEXPLAINED: f64 = 0.5;
/// A cause is named if the error without it is below this share.
const EXPLAINED: f64 = 0.5;
/// Lines at which the link's encoder is compared: its noise is below this share.
const LINK_NOISE: f64 = 0.1;
/// A value is identified from so many standard deviations on.
const IDENTIFIED: f64 = 2.0;

/// A value that was estimated.
#[derive(Debug, Clone, Serialize)]
pub struct FrfValue {
    /// `1/k:elasticity:JOINT`, `d:elasticity:JOINT`, `viscous:JOINT`, …
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation: jackknife over blocks (or stretches of lines) and points, and that of the priors.
    pub std: f64,
    /// `identified` or `prior`.
    pub status: &'static str,
}

/// A bend of a link or bearing that was judged.
#[derive(Debug, Clone, Serialize)]
pub struct BendCandidate {
    /// `link_elasticity`.
    pub effect: &'static str,
    /// The joint in front of which it bends.
    pub joint: String,
    /// `bend_1` or `bend_2`: about which axis across the joint's.
    pub axis: &'static str,
    /// Held-out error with it, log magnitude.
    pub error: f64,
    /// Mean gain over points in its standard errors.
    pub z: f64,
    /// Whether the fit has it.
    pub taken: bool,
}

impl FrfValue {
    fn new(name: String, unit: String, value: f64, std: f64) -> Self {
        let is_known = value.abs() > IDENTIFIED * std;
        Self {
            name,
            unit,
            value,
            std,
            status: if is_known { "identified" } else { "prior" },
        }
    }
}

/// A number ± its standard deviation.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Estimated {
    /// Estimate.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

/// What a spring does to a joint on its own.
#[derive(Debug, Clone, Serialize)]
pub struct Mode {
    /// The joint.
    pub joint: String,
    /// √(k/H)/2π, Hz: the link swings against a motor that is held.
    pub antiresonance: Estimated,
    /// √(k (1/H + 1/J))/2π, Hz: motor and link against each other.
    pub resonance: Estimated,
    /// Link's inertia over the motor's.
    pub inertia_ratio: Estimated,
}

/// The link's own encoder, which no fit has seen, against what the fit predicts.
#[derive(Debug, Clone, Serialize)]
pub struct LinkCheck {
    /// The joint.
    pub joint: String,
    /// Measured over predicted: the median over lines.
    pub gain: f64,
    /// Root mean square of the log magnitude error.
    pub rms: f64,
    /// Whether the encoder counts the other way.
    pub reversed: bool,
    /// Lines compared.
    pub lines: usize,
}

/// A point that was measured.
#[derive(Debug, Clone, Serialize)]
pub struct MeasuredPoint {
    /// Mean position of each joint, rad or m.
    pub q: Vec<f64>,
    /// Blocks of other phases.
    pub blocks: usize,
    /// Periods used of each experiment.
    pub periods: usize,
    /// Periods left out at the beginning of each.
    pub transient: usize,
    /// Median standard deviation of a response by periods, as a share of it.
    pub noise: f64,
    /// The same by blocks: noise and distortion; null with one block.
    pub scatter: Option<f64>,
    /// Amplitude at even lines that nothing excites over that at excited ones; null without such lines.
    pub even_distortion: Option<f64>,
    /// The same at odd lines.
    pub odd_distortion: Option<f64>,
}

/// One response for the page: measured and modelled by frequency.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Which point, counted from 1.
    pub point: usize,
    /// Joint that moves.
    pub output: String,
    /// Joint that is driven.
    pub input: String,
    /// Frequencies, Hz.
    pub f: Vec<f64>,
    /// Measured: real and imaginary part, rad per unit of torque.
    pub measured: Vec<[f64; 2]>,
    /// Standard deviation by blocks, and by periods alone.
    pub std: Vec<[f64; 2]>,
    /// Modelled; empty without a fit.
    pub modelled: Vec<[f64; 2]>,
}

/// Frequency responses, and the springs behind them.
#[derive(Serialize)]
pub struct Frf {
    /// Joints.
    pub joints: Vec<String>,
    /// Unit of the torque: N m or A.
    pub torque_unit: &'static str,
    /// Whether the excitation is recorded.
    pub reference: bool,
    /// The period, s.
    pub period: f64,
    /// Excited lines.
    pub lines: usize,
    /// The lowest and the highest, Hz.
    pub band: [f64; 2],
    /// The highest line that the fit uses, Hz; null without a fit.
    pub fitted_to: Option<f64>,
    /// Points.
    pub points: Vec<MeasuredPoint>,
    /// Estimates.
    pub parameters: Vec<FrfValue>,
    /// With springs at the joints alone, the held-out error, log magnitude; null without a model.
    pub springs_alone: Option<f64>,
    /// Bends that were judged, the best first: those of the fit, then those of the last search.
    pub candidates: Vec<BendCandidate>,
    /// What springs do to each joint.
    pub modes: Vec<Mode>,
    /// Links' own encoders.
    pub links: Vec<LinkCheck>,
    /// What the model lacks at the fitted lines, as a share of a response.
    pub lacking: Option<f64>,
    /// Mean square error in units of the scatter.
    pub chi_squared: Option<f64>,
    /// Springs that others than these responses have measured too.
    pub witnesses: Vec<Witnessed>,
    /// What a user should know.
    pub warnings: Vec<String>,
    /// Held out: rigid, with springs, scatter alone.
    #[serde(skip)]
    error: ErrorRange,
    #[serde(skip)]
    pub(super) measured: Vec<Point>,
    #[serde(skip)]
    pub(super) frequencies: Vec<f64>,
    #[serde(skip)]
    curves: Vec<Curve>,
    #[serde(skip)]
    springs: Vec<(usize, Estimated)>,
    /// Bends of the fit, and their stiffness.
    #[serde(skip)]
    bends: Vec<(Bend, Estimated)>,
    /// What damps springs and bends: number of the robot's joint, spring, N m s/rad.
    #[serde(skip)]
    dampers: Vec<(Bend, Estimated)>,
    /// The logs.
    #[serde(skip)]
    pub(super) logs: Vec<PathBuf>,
    /// Experiments of a block, where they were said to be fewer than joints.
    #[serde(skip)]
    pub(super) few: Option<usize>,
}

/// Frequency responses of logs; with a model their springs and dampers, of one joint also without. Blocks have as many experiments as joints, or `few`: then
/// there are springs and no responses.
///
/// # Errors
/// [`FrfError`].
pub fn frf(logs: &[PathBuf], model: Option<&Model>, few: Option<usize>) -> Result<Frf, FrfError> {
    let mut records = Vec::new();
    for path in logs {
        records.push(Record::read(path, model)?);
    }
    let joints = records[0].joints.clone();
    let in_newtons = records[0].unit == TorqueUnit::NewtonMetre;
    // A model's friction and masses are of no use in A.
    let model = model.filter(|_| in_newtons);
    let drives = springs::drives(model, &joints);
    let mut experiments = Experiments::find(&records, &drives)?;
    let points = response::points(&experiments, few)?;
    answering(&experiments, &points)?;
    let frequencies = experiments.frequencies();
    let omega: Vec<f64> = (frequencies.iter())
        .map(|f| std::f64::consts::TAU * f)
        .collect();
    // The same measurement with less dry friction subtracted.
    let doubted = match model {
        Some(_) => {
            experiments.give_back(FRICTION_DOUBT);
            response::points(&experiments, few)?
        }
        None => Vec::new(),
    };
    let dt = experiments.dt;
    let fitted = match model {
        Some(model) => Some(with_model(model, &joints, [&points, &doubted], &omega, dt)?),
        None if joints.len() == 1 => bench(&points, &omega, dt),
        None => None,
    };
    if let Some(own) = &fitted {
        is_explained(own, model, (&joints, &points), (&omega, dt))?;
    }
    let mut warnings = Vec::new();
    if !in_newtons {
        warnings.push("current stands for torque: inertia, stiffness and friction are in A, up to the motor's torque constant".to_owned());
    }
    if !experiments.has_reference {
        warnings.push("no `ref/`: the period and its lines are the torque's own".to_owned());
    }
    if model.is_some() && drives.iter().any(|drive| drive.coulomb == 0.0) {
        warnings.push("the model has no `coulomb` at some joints: their dry friction counts as viscous friction".to_owned());
    }
    if model.is_none() && joints.len() > 1 {
        warnings.push(
            "springs of several joints need the links' masses: give -m MODEL, and torque in N m"
                .to_owned(),
        );
    }
    let mut found = Frf {
        torque_unit: experiments.unit.symbol(),
        reference: experiments.has_reference,
        period: experiments.period as f64 * experiments.dt,
        lines: frequencies.len(),
        band: [frequencies[0], frequencies[frequencies.len() - 1]],
        fitted_to: None,
        points: points.iter().map(measured_point).collect(),
        parameters: Vec::new(),
        springs_alone: None,
        candidates: Vec::new(),
        modes: Vec::new(),
        links: Vec::new(),
        lacking: None,
        chi_squared: None,
        witnesses: Vec::new(),
        warnings,
        error: ErrorRange {
            before: None,
            after: None,
            floor: None,
            floor_unknown: Some("no fit"),
            unit: "log magnitude",
        },
        measured: Vec::new(),
        frequencies: frequencies.clone(),
        curves: Vec::new(),
        springs: Vec::new(),
        bends: Vec::new(),
        dampers: Vec::new(),
        logs: logs.to_vec(),
        few,
        joints,
    };
    if let Some(own) = &fitted {
        let (problem, fit) = (&own.problem, &own.fit);
        found.take(own, model)?;
        if !own.doubtful.is_empty() {
            found.warnings.push(format!(
                "masses are doubtful: the responses contradict the model's bodies behind {} by more than their standard deviations; weigh them, or identify slower motion",
                own.doubtful.join(", ")
            ));
        }
        found.curves = curves(&points, &frequencies, &found.joints, Some((problem, fit)));
        found.links = links(&points, &found.joints, problem, fit);
    } else {
        found.curves = curves(&points, &frequencies, &found.joints, None);
    }
    drop(fitted);
    if let Some(model) = model {
        let own = found.to_model(model)?;
        found.witnesses = own.witnessed();
        found.warnings.extend(own.contradictions());
    }
    found.measured = points;
    Ok(found)
}

/// Refuses responses that springs do not explain; causes that are tested by a fit are the torque's sign, degrees where masses are known, and a delay.
fn is_explained(
    own: &Fitted,
    model: Option<&Model>,
    (joints, points): (&[String], &[Point]),
    (omega, dt): (&[f64], f64),
) -> Result<(), FrfError> {
    let (error, floor) = (own.fit.error(), own.problem.floor());
    let unexplained = (error * error - floor * floor).max(0.0).sqrt();
    if unexplained <= DOUBTED {
        return Ok(());
    }
    let before = own.springs;
    let explains = |position: f64, factor: &dyn Fn(f64) -> Complex64| {
        let after = springs::if_times(model, joints, points, (omega, dt), (position, factor));
        after.filter(|after| *after < EXPLAINED * before)
    };
    // Which of the two is wrong is unknown, and so the point stays.
    if let Some(after) = explains(1.0, &|_| Complex64::from(-1.0)) {
        return Err(FrfError::Sign { before, after });
    }
    // A bench without a model has any inertia.
    let in_rad = 1_f64.to_radians();
    if let Some(after) = model.and_then(|_| explains(in_rad, &|_| Complex64::from(in_rad))) {
        return Err(FrfError::Degrees {
            columns: "positions are".to_owned(),
            cause: format!(
                "in rad the held-out error falls from {before:.2} to {after:.2} (log magnitude)"
            ),
        });
    }
    let late = springs::lateness(points, omega, dt);
    let in_time = |late: f64| explains(1.0, &|omega| Complex64::new(0.0, omega * late).exp());
    if let Some((late, after)) = late.and_then(|late| Some((late, in_time(late)?))) {
        return Err(FrfError::Late {
            late_ms: 1e3 * late,
            before,
            after,
        });
    }
    if unexplained > UNEXPLAINED {
        return Err(FrfError::Misfit { error, floor });
    }
    Ok(())
}

/// Refuses joints whose own responses are noise.
fn answering(experiments: &Experiments, points: &[Point]) -> Result<(), FrfError> {
    for (i, joint) in experiments.joints.iter().enumerate() {
        let (mut silent, mut all) = (0, 0);
        for point in points {
            // Of a joint's own torque, or of all experiments that drive all joints.
            let own = match point.torque.is_empty() {
                true => i..i + 1,
                false => point.columns(None),
            };
            for (mean, noise) in point.mean.iter().zip(&point.noise) {
                all += own.len();
                let is_silent = |j: &usize| 4.0 * noise[(i, *j)] > mean[(i, *j)].norm_sqr();
                silent += own.clone().filter(is_silent).count();
            }
        }
        let share = silent as f64 / all.max(1) as f64;
        if share > SILENT {
            return Err(FrfError::Silent {
                joint: joint.clone(),
                share: 100.0 * share,
            });
        }
    }
    Ok(())
}

fn measured_point(point: &Point) -> MeasuredPoint {
    let relative = |of: &[nalgebra::DMatrix<f64>]| {
        let all = of.iter().zip(&point.mean).flat_map(|(variance, mean)| {
            variance
                .iter()
                .zip(mean.iter())
                .map(|(v, g)| (v / g.norm_sqr()).sqrt())
        });
        median(all).unwrap_or_default()
    };
    MeasuredPoint {
        q: point.q.clone(),
        blocks: point.blocks.len(),
        periods: point.periods,
        transient: point.transient,
        noise: relative(&point.noise),
        scatter: point
            .scatters_by_blocks()
            .then(|| relative(&point.variance)),
        even_distortion: point.distortion[0].map(f64::sqrt),
        odd_distortion: point.distortion[1].map(f64::sqrt),
    }
}

impl Frf {
    /// Values and errors of a fit.
    fn take(&mut self, own: &Fitted, model: Option<&Model>) -> Result<(), FrfError> {
        let Fitted {
            problem,
            fit,
            rigid,
            ..
        } = own;
        let rigid = *rigid;
        self.take_bends(own, model)?;
        let in_newtons = self.torque_unit == TorqueUnit::NewtonMetre.symbol();
        let unit = |of: &str| match of {
            "kg m²" if !in_newtons => format!("{} s²/rad", self.torque_unit),
            "rad/(N m)" if !in_newtons => format!("rad/{}", self.torque_unit),
            of => of.replace("N m", self.torque_unit),
        };
        let is_bench = fit.layout.has(Unknown::LinkInertia);
        for unknown in &fit.layout.unknowns {
            // In a robot they take what dry friction and the slow motion leave in the responses, and their errors do not know of it.
            if !is_bench && matches!(unknown, Unknown::Viscous(_) | Unknown::Armature(_)) {
                continue;
            }
            let Some((value, std)) = fit.estimate(*unknown) else {
                continue;
            };
            let joint = |i: usize| self.joints[i].as_str();
            let (name, of, value, std) = match *unknown {
                Unknown::Stiffness(i) => {
                    self.springs.push((i, Estimated { value, std }));
                    let name = format!("1/k:elasticity:{}", joint(i));
                    (name, "rad/(N m)", 1.0 / value, std / (value * value))
                }
                Unknown::Damping(i) => (
                    format!("d:elasticity:{}", joint(i)),
                    "N m s/rad",
                    value,
                    std,
                ),
                Unknown::Viscous(i) => (format!("viscous:{}", joint(i)), "N m s/rad", value, std),
                Unknown::Armature(i) => (format!("armature:{}", joint(i)), "kg m²", value, std),
                Unknown::LinkViscous(i) => (
                    format!("link_viscous:{}", joint(i)),
                    "N m s/rad",
                    value,
                    std,
                ),
                Unknown::LinkInertia => (format!("link_inertia:{}", joint(0)), "kg m²", value, std),
                Unknown::Delay => ("delay".to_owned(), "s", value, std),
                // They have names by the model.
                Unknown::BendStiffness(_) | Unknown::BendDamping(_) => continue,
                // Directions of bodies have no name of their own.
                Unknown::Rigid(_) => continue,
            };
            self.parameters
                .push(FrfValue::new(name, unit(of), value, std));
        }
        for (i, joint) in self.joints.iter().enumerate() {
            let of = |x: &[f64]| {
                let value = |of: Unknown| fit.layout.value(x, of);
                let plant = &problem.plants[0];
                let link = if fit.layout.has(Unknown::LinkInertia) {
                    value(Unknown::LinkInertia)
                } else {
                    let own = plant.rigid.iter().enumerate();
                    let moved = own.map(|(m, slope)| slope[(i, i)] * value(Unknown::Rigid(m)));
                    plant.inertia[(i, i)] + moved.sum::<f64>()
                };
                mode(
                    value(Unknown::Stiffness(i)),
                    link,
                    value(Unknown::Armature(i)),
                )
            };
            let hertz = 1.0 / std::f64::consts::TAU;
            let estimated = |of: &dyn Fn(&[f64]) -> f64| {
                let (value, std) = fit.derived(of);
                Estimated { value, std }
            };
            self.modes.push(Mode {
                joint: joint.clone(),
                antiresonance: estimated(&|x| hertz * of(x).0),
                resonance: estimated(&|x| hertz * of(x).1),
                inertia_ratio: estimated(&|x| of(x).2),
            });
        }
        self.fitted_to = problem
            .used
            .checked_sub(1)
            .map(|last| self.frequencies[last]);
        self.lacking = Some(fit.lacking);
        self.chi_squared = Some(fit.chi_squared);
        self.error = ErrorRange {
            before: Some(rigid).filter(|x| x.is_finite()),
            after: Some(fit.error()),
            floor: Some(problem.floor()),
            floor_unknown: None,
            unit: "log magnitude",
        };
        if self.error.before.is_some_and(|before| fit.error() > before) {
            return Err(FrfError::NoFit {
                before: rigid,
                after: fit.error(),
            });
        }
        Ok(())
    }

    /// Bends of a fit, and what damps it: what the model's joints name.
    fn take_bends(&mut self, own: &Fitted, model: Option<&Model>) -> Result<(), FrfError> {
        let Some(model) = model else { return Ok(()) };
        self.springs_alone = Some(own.springs);
        let fit = &own.fit;
        for (i, joint) in self.joints.iter().enumerate() {
            let place = (model.robot().joint(joint)?, JointQuantity::Elasticity);
            if let Some((value, std)) = fit.estimate(Unknown::Damping(i)) {
                self.dampers.push((place, Estimated { value, std }));
            }
        }
        for (e, &bend) in own.bends.iter().enumerate() {
            let name = model.bend_parameter(bend);
            if let Some((k, std)) = fit.estimate(Unknown::BendStiffness(e)) {
                self.bends.push((bend, Estimated { value: k, std }));
                let unit = bend.1.unit(false).to_owned();
                let value = FrfValue::new(name.clone(), unit, 1.0 / k, std / (k * k));
                self.parameters.push(value);
            }
            if let (Some((value, std)), Some(key)) =
                (fit.estimate(Unknown::BendDamping(e)), bend.1.damping_key())
            {
                self.dampers.push((bend, Estimated { value, std }));
                let name = name.replacen(bend.1.key(), key, 1);
                let unit = "N m s/rad".to_owned();
                self.parameters.push(FrfValue::new(name, unit, value, std));
            }
        }
        self.candidates = (own.candidates.iter())
            .map(|judged| BendCandidate {
                effect: LINK_ELASTICITY,
                joint: model.joint_name(judged.bend.0).to_owned(),
                axis: judged.bend.1.key(),
                error: judged.error,
                z: judged.z,
                taken: judged.taken,
            })
            .collect();
        Ok(())
    }

    /// Held-out errors in natural logarithms of magnitude: of the rigid model, with springs, of the scatter alone.
    pub fn error(&self) -> ErrorRange {
        self.error
    }

    /// Whether the fit has links that bend.
    pub(super) fn has_bends(&self) -> bool {
        !self.bends.is_empty()
    }

    /// Responses for a page.
    pub fn curves(&self) -> &[Curve] {
        &self.curves
    }

    /// Which springs can be written into a model: joint and stiffness, N m/rad.
    pub(super) fn identified_springs(&self) -> impl Iterator<Item = (usize, Estimated)> {
        let own = self.springs.iter().copied();
        own.filter(|(_, k)| k.value > IDENTIFIED * k.std)
    }

    /// The model with the springs that were identified: 1/k of `elasticity` at each joint and of each bend, combined with what other witnesses say, and
    /// what damps them.
    ///
    /// # Errors
    /// If the file cannot hold a value.
    pub fn to_model(&self, model: &Model) -> Result<Model, FrfError> {
        let mut own = model.clone();
        let Some(elasticity) = catalogue::effect_named("elasticity") else {
            return Ok(own);
        };
        for (i, k) in self.identified_springs() {
            let joint = own.robot().joint(&self.joints[i])?;
            let std = k.std / (k.value * k.value);
            own.set_measured(elasticity, joint, Witness::Responses, 1.0 / k.value, std)?;
        }
        let is_identified = |of: &Estimated| of.value > IDENTIFIED * of.std;
        for &((joint, bend), k) in self.bends.iter().filter(|(_, k)| is_identified(k)) {
            let std = k.std / (k.value * k.value);
            own.set_joint_quantity(joint, bend, Witness::Responses, 1.0 / k.value, std)?;
        }
        for &((joint, spring), d) in self.dampers.iter().filter(|(_, d)| is_identified(d)) {
            own.set_spring_damping(joint, spring, d.value, d.std)?;
        }
        Ok(own)
    }
}

/// The links' encoders against what the fit predicts of them.
fn links(points: &[Point], joints: &[String], problem: &Problem, fit: &Fit) -> Vec<LinkCheck> {
    let mut checks = Vec::new();
    for (i, joint) in joints.iter().enumerate() {
        let mut ratios = Vec::new();
        for (p, point) in points.iter().enumerate() {
            let (measured, noise) = &point.link;
            let at = At::new(&problem.plants[p], &fit.layout, &fit.x);
            for line in 0..problem.used.min(measured.len()) {
                let own = measured[line][(i, i)];
                let omega = problem.omega[line];
                let predicted = at.link_response(omega, problem.dt);
                if let Some(predicted) = predicted
                    && noise[line][(i, i)].sqrt() < LINK_NOISE * own.norm()
                {
                    ratios.push(own / predicted[(i, i)]);
                }
            }
        }
        if ratios.is_empty() {
            continue;
        }
        let direction: f64 = ratios.iter().map(|r| r.re / r.norm()).sum();
        let errors: Vec<f64> = ratios.iter().map(|r| r.norm().ln()).collect();
        checks.push(LinkCheck {
            joint: joint.clone(),
            gain: median(errors.iter().copied()).unwrap_or_default().exp(),
            rms: rms(&errors),
            reversed: direction < 0.0,
            lines: errors.len(),
        });
    }
    checks
}

fn curves(
    points: &[Point],
    f: &[f64],
    joints: &[String],
    fitted: Option<(&Problem, &Fit)>,
) -> Vec<Curve> {
    let pair = |x: Complex64| [x.re, x.im];
    let mut all = Vec::new();
    for (p, point) in points.iter().enumerate() {
        // Without a matrix of responses there is nothing to draw.
        if !point.torque.is_empty() {
            continue;
        }
        let model: Vec<_> = match fitted {
            Some((problem, fit)) => {
                let at = At::new(&problem.plants[p], &fit.layout, &fit.x);
                let lines = 0..problem.omega.len();
                lines
                    .filter_map(|line| problem.response(p, &at, line))
                    .collect()
            }
            None => Vec::new(),
        };
        for (i, output) in joints.iter().enumerate() {
            for (j, input) in joints.iter().enumerate() {
                let std = point.variance.iter().zip(&point.noise);
                all.push(Curve {
                    point: p + 1,
                    output: output.clone(),
                    input: input.clone(),
                    f: f.to_vec(),
                    measured: point.mean.iter().map(|g| pair(g[(i, j)])).collect(),
                    std: std
                        .map(|(v, n)| [v[(i, j)].sqrt(), n[(i, j)].sqrt()])
                        .collect(),
                    modelled: model.iter().map(|m| pair(m[(i, j)])).collect(),
                });
            }
        }
    }
    all
}

/// Where a page or a command says a log's name.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
