//! Periodic experiments for frequency responses: what `frf` wants to be recorded, within the robot's limits.
//!
//! At each of some points the robot is held by a soft controller while multisines are added to its torques. They have odd lines with random
//! phases; in the n experiments of a block the phases of the n joints differ by the Fourier matrix, so that the excitations are orthogonal
//! (Dobrowiecki, Schoukens & Guillaume 2006), and further blocks have other phases. Fewer experiments are the first columns of that matrix. A slow sine on
//! the position, the carrier, keeps dry friction from holding the joints.
//!
//! What the motors do is the carrier and the response to the excitation, by the model with its springs; position, velocity, torque and power of both
//! together are proved to be within the limits between the samples too, on the ways between points as well (`super::proof`).
//!
//! Files beside:
//!
//! - `course`: where the joints are asked to be: carrier, and the ways between points
//! - `file`: a plan as rows to play, and read again
//! - `lines`: which lines are excited, and multisines of them
//! - `points`: where the robot is held
//! - `swing`: what the excitation makes the motors do

mod course;
mod file;
mod lines;
mod points;
mod swing;
#[cfg(test)]
mod tests;

use std::rc::Rc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::problem::Problem;
use super::setup::bare_problem;
use super::shapes::Shapes;
use super::{Command, ExciteError, Feedforward, Margins, Settings, Violation};
use crate::catalogue;
use crate::model::{Limb, Model};
use crate::spectrum::{ExpectedSpring, Foreseen, HIGHEST, LEAST_LINES};
use course::{Carrier, Way};
pub use file::{FrfPlan, write_frf_csv};
use lines::{Signals, chosen_lines};
use swing::Swing;

/// Bandwidth of the controller that holds a point, Hz, and its damping ratio: far below the resonances, so that the responses there are those of the
/// open loop, and stiff enough that gravity and friction do not move the point.
const BANDWIDTH: f64 = 2.0;
const CONTROL_DAMPING: f64 = 0.7;
/// The excitation's rms: this share of the friction, so that the joint keeps moving where the carrier turns back, and this share of the greatest effort,
/// so that a joint without friction is excited too; together no more than the last share of the effort.
const OF_FRICTION: f64 = 0.5;
const OF_EFFORT: f64 = 0.06;
const MOST_EFFORT: f64 = 0.4;
/// Coulomb friction of a joint whose model states none, as a share of its effort: geared drives have 2 to 8 %.
const USUAL_FRICTION: f64 = 0.05;
/// Effort of a joint whose description does not state one, N m.
pub(crate) const USUAL_EFFORT: f64 = 100.0;
/// Highest line unless another is asked for, Hz, and as a share of the sampling rate; lowest, Hz.
const BAND: [f64; 2] = [1.0, 55.0];
const HIGHEST_OF_RATE: f64 = 0.35;
/// Noise of a motor's encoder, rad, with which the expected errors are computed: 20 bits a turn.
const ENCODER_NOISE: f64 = 2e-6;
/// Scatter of a block's response by what is not linear, as a share of it, with which they are computed: what `frf` prints of simulated arms with dry
/// friction as noise and distortion of two blocks, 0.06 to 0.07, times √2.
const DISTORTION: f64 = 0.09;
/// Random phases of a block that are tried, the ones with the lowest peak being kept.
const DRAWS: usize = 20;

/// What is asked of periodic experiments.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfSettings {
    /// How many points.
    pub points: usize,
    /// Blocks of random phases at each.
    pub blocks: usize,
    /// Experiments of each block; none: as many as joints. Fewer give no matrix of responses, and springs by the fit alone.
    pub experiments: Option<usize>,
    /// Periods of each experiment, the first of them transient.
    pub periods: usize,
    /// A period, s.
    pub period: f64,
    /// Lowest and highest line, Hz; none: what suits the sampling rate.
    pub band: Option<[f64; 2]>,
    /// Excitation as a multiple of what friction and effort suggest.
    pub excitation: f64,
    /// Samples per second.
    pub rate: f64,
    /// Chooses points and phases.
    pub seed: u64,
    /// What is kept back from the limits.
    pub margins: Margins,
    /// What stands around the robot.
    pub shapes: Option<Shapes>,
}

/// Periodic experiments of a robot's joints.
pub struct FrfDesign {
    /// The joints in the model.
    pub joints: Vec<usize>,
    /// Their names.
    pub names: Vec<String>,
    /// The points, a position of each joint, rad or m.
    pub points: Vec<Vec<f64>>,
    /// Blocks at each.
    pub blocks: usize,
    /// Experiments of each block.
    pub experiments: usize,
    /// Periods of each experiment.
    pub periods: usize,
    /// A period, s: a whole number of samples.
    pub period: f64,
    /// Samples per second.
    pub rate: f64,
    /// The excited lines, multiples of 1/period.
    pub lines: Vec<usize>,
    /// The carrier, Hz.
    pub carrier: f64,
    /// The excitation's rms, N m.
    pub rms: Vec<f64>,
    /// The controller's gains, N m/rad and N m s/rad.
    pub gains: Vec<[f64; 2]>,
    /// Limits that are not kept, a sentence each: none, or the plan must not be played.
    pub violations: Vec<String>,
    /// What a fit is expected to know of each spring.
    pub(crate) expected: Vec<ExpectedSpring>,
    /// The joints of whose Coulomb friction the model states nothing.
    pub assumed_friction: Vec<String>,
    /// Of each point and block its phases, by joint and line.
    phases: Vec<Vec<Vec<Vec<f64>>>>,
    signals: Signals,
    slow: Carrier,
    feed: Vec<(usize, Feedforward)>,
    ways: Vec<Way>,
}

/// A limb's part of the design: its first joint among all, and what limits it.
struct Part {
    first: usize,
    problem: Problem,
}

/// Plans experiments of the joints of `limbs`.
///
/// # Errors
/// [`ExciteError`]: settings that cannot be, lines too high or too few, excitation below the friction, limits that leave no points.
pub fn design(
    model: &Model,
    limbs: &[Limb],
    settings: &FrfSettings,
) -> Result<FrfDesign, ExciteError> {
    let joints: Vec<usize> = limbs.iter().flat_map(|l| l.bodies.clone()).collect();
    settings.check(joints.len())?;
    let experiments = settings.experiments.unwrap_or(joints.len());
    let names: Vec<String> = (joints.iter())
        .map(|&j| model.joint_name(j).to_owned())
        .collect();
    let length = (settings.period * settings.rate).round() as usize;
    let period = length as f64 / settings.rate;
    let lines = settings.lines(period)?;
    let frequencies: Vec<f64> = lines.iter().map(|l| *l as f64 / period).collect();
    let parts = parts(model, limbs, settings)?;
    let slow = Carrier::new(&parts, period, length);
    let friction = frictions(model, &joints);
    let drives: Vec<f64> = (joints.iter().zip(&friction))
        .map(|(&j, (coulomb, _))| settings.rms(effort(model, j), *coulomb))
        .collect();
    let signals = Signals::new(&lines, length, period, &drives);
    // What the proof adds to the model's torque: friction that the model does not state.
    let unstated = friction
        .iter()
        .map(|(coulomb, is_stated)| if *is_stated { 0.0 } else { *coulomb });
    let unstated: Vec<f64> = unstated.collect();

    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let candidates = points::candidates(&parts, &slow, settings.points, &mut rng);
    let dt = 1.0 / settings.rate;
    let seen = Foreseen::new(model, &names, &candidates, &frequencies, dt)?;
    let gains: Vec<[f64; 2]> = seen.inertia().into_iter().map(gains_of).collect();
    let room = points::Room {
        parts: &parts,
        slow: &slow,
        signals: &signals,
        gains: &gains,
        unstated: &unstated,
        model,
        joints: &joints,
    };
    let points = room.choose(&seen, &candidates, settings.points, settings.rate)?;
    let seen = Foreseen::new(model, &names, &points, &frequencies, dt)?;
    let mut phases = Vec::new();
    let mut violations = Vec::new();
    let mut peaks = vec![f64::INFINITY; joints.len()];
    for (p, point) in points.iter().enumerate() {
        let swing = Swing::new(&seen, p, &signals, &gains).ok_or(ExciteError::Singular)?;
        let mut own = Vec::new();
        for _ in 0..settings.blocks {
            let drawn = drawn(&signals, experiments, &mut rng);
            for experiment in 0..experiments {
                let moved = swing.peaks(&signals, &drawn, experiment);
                for (least, signal) in peaks.iter_mut().zip(signals.of(&drawn, experiment)) {
                    *least = least.min(peak(&signal));
                }
                violations.extend(room.held(point, &moved));
            }
            own.push(drawn);
        }
        phases.push(own);
    }
    for (j, name) in names.iter().enumerate() {
        if peaks[j] < friction[j].0 {
            return Err(ExciteError::BelowFriction {
                joint: name.clone(),
                peak: peaks[j],
                friction: friction[j].0,
            });
        }
    }
    let ways = room.ways(&points, settings.rate);
    for way in &ways {
        violations.extend(room.on(way));
    }
    let paths: Vec<Vec<Vec<f64>>> = points.iter().map(|q| Way::held(q).path(&slow)).collect();
    let expected = seen.along(&paths)?.expected(|line, j, size| {
        let amplitude = signals.amplitude(j, line);
        // Of white noise s a line's amplitude has the variance 4 s²/N; experiments of so many periods and blocks share it.
        let averaged = (experiments * settings.blocks * (settings.periods - 1)) as f64;
        // What a block says of each response is shared by as many experiments as joints.
        let blocks = (settings.blocks * experiments) as f64 / joints.len() as f64;
        let noise = 4.0 * ENCODER_NOISE.powi(2) / length as f64 / averaged;
        let noise = noise / (amplitude * size).powi(2);
        (noise + DISTORTION.powi(2) / blocks).sqrt()
    });
    let mut first = 0;
    let mut feed = Vec::new();
    for limb in limbs {
        let too_large = || ExciteError::TooLarge(limb.name.clone(), limb.bodies.len());
        feed.push((first, Feedforward::new(model, limb).ok_or_else(too_large)?));
        first += limb.bodies.len();
    }
    let assumed = names.iter().zip(&friction).filter(|(_, (_, own))| !own);
    let assumed_friction = assumed.map(|(name, _)| name.clone()).collect();
    // The same at every experiment says no more.
    violations.sort();
    violations.dedup();
    Ok(FrfDesign {
        assumed_friction,
        joints,
        names,
        points,
        blocks: settings.blocks,
        experiments,
        periods: settings.periods,
        period,
        rate: settings.rate,
        lines,
        carrier: slow.frequency(),
        rms: drives,
        gains,
        violations,
        expected: expected.ok_or(ExciteError::Singular)?,
        phases,
        signals,
        slow,
        feed,
        ways,
    })
}

impl FrfSettings {
    fn check(&self, joints: usize) -> Result<(), ExciteError> {
        if let Some(experiments) = self.experiments
            && !(1..=joints).contains(&experiments)
        {
            return Err(ExciteError::Setting {
                what: "the number of experiments of a block".to_owned(),
                must: "1 or more, and no more than joints are driven",
                value: experiments as f64,
            });
        }
        let usual = Settings {
            margins: self.margins,
            period: self.period,
            ..Settings::default()
        };
        usual.check()?;
        let least = [
            ("the number of points", self.points, 1),
            ("the number of blocks", self.blocks, 1),
            ("the number of periods", self.periods, 3),
        ];
        for (what, value, least) in least {
            if value < least {
                return Err(ExciteError::Setting {
                    what: what.to_owned(),
                    must: match least {
                        1 => "1 or more",
                        _ => "3 or more: the first is transient, and two show the noise",
                    },
                    value: value as f64,
                });
            }
        }
        Ok(())
    }

    /// The excited lines of a period.
    fn lines(&self, period: f64) -> Result<Vec<usize>, ExciteError> {
        let usual = [BAND[0], BAND[1].min(HIGHEST_OF_RATE * self.rate)];
        let band = self.band.unwrap_or(usual);
        let limit = HIGHEST * 0.5 * self.rate;
        if band[1] > limit {
            return Err(ExciteError::BeyondNyquist {
                highest: band[1],
                limit,
            });
        }
        let lines = chosen_lines(band, period);
        if lines.len() < LEAST_LINES {
            return Err(ExciteError::FewLines {
                lines: lines.len(),
                needed: LEAST_LINES,
                band,
                period,
            });
        }
        Ok(lines)
    }

    /// The excitation's rms of a joint, N m.
    fn rms(&self, effort: f64, friction: f64) -> f64 {
        let suggested = OF_FRICTION * friction + OF_EFFORT * effort;
        self.excitation * suggested.min(MOST_EFFORT * effort)
    }
}

/// Gains that make a mass follow at the controller's bandwidth.
fn gains_of(inertia: f64) -> [f64; 2] {
    let omega = std::f64::consts::TAU * BANDWIDTH;
    [
        inertia * omega * omega,
        2.0 * CONTROL_DAMPING * omega * inertia,
    ]
}

fn effort(model: &Model, joint: usize) -> f64 {
    let own = model.robot().bodies()[joint].effort;
    if own.is_finite() && own > 0.0 {
        own
    } else {
        USUAL_EFFORT
    }
}

/// Coulomb friction of each joint, N m, and whether the model states it.
fn frictions(model: &Model, joints: &[usize]) -> Vec<(f64, bool)> {
    let coulomb = catalogue::effect_named("coulomb");
    let of = |&joint: &usize| {
        let stated = coulomb.and_then(|effect| model.effect(effect, joint)?.estimate());
        let prior = coulomb.map_or(0.0, |effect| model.effect_prior(effect, joint).prior.mean);
        let usual = USUAL_FRICTION * effort(model, joint);
        match stated {
            Some(estimate) => (estimate.value, true),
            None if prior > 0.0 => (prior, true),
            None => (usual, false),
        }
    };
    joints.iter().map(of).collect()
}

fn parts(model: &Model, limbs: &[Limb], settings: &FrfSettings) -> Result<Vec<Part>, ExciteError> {
    let own = Settings {
        margins: settings.margins,
        shapes: settings.shapes.clone(),
        ..Settings::default()
    };
    let mut parts = Vec::new();
    let mut first = 0;
    for limb in limbs {
        let problem = bare_problem(model, limb, &own, limbs.len() == 1)?;
        let joints = problem.joints();
        parts.push(Part { first, problem });
        first += joints;
    }
    Ok(parts)
}

/// Random phases by joint and line, of some draws those whose torques have the lowest peak in units of their rms.
fn drawn(signals: &Signals, experiments: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let mut draw = || -> Vec<Vec<f64>> {
        let mut phase = || std::f64::consts::TAU * rng.random::<f64>();
        let joints = 0..signals.joints();
        joints
            .map(|_| (0..signals.lines().len()).map(|_| phase()).collect())
            .collect()
    };
    let crest = |phases: &Vec<Vec<f64>>| {
        let all = (0..experiments).flat_map(|e| signals.of(phases, e).into_iter().enumerate());
        all.map(|(j, x)| peak(&x) / signals.rms(j).max(1e-300))
            .fold(0.0, f64::max)
    };
    let mut best = draw();
    let mut least = crest(&best);
    for _ in 1..DRAWS {
        let next = draw();
        let own = crest(&next);
        if own < least {
            (best, least) = (next, own);
        }
    }
    best
}

/// The greatest size.
fn peak(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// A violation in words.
fn sentence(model: &Model, joints: &[usize], first: usize, v: &Violation) -> String {
    let joint = |j: usize| format!(" of {}", model.joint_name(joints[first + j]));
    let joint = v.joint.map_or(String::new(), joint);
    format!("{}{joint}, by {:.2} %", v.what, 100.0 * v.beyond)
}

impl FrfDesign {
    /// Length, s.
    pub fn duration(&self) -> f64 {
        self.samples() as f64 / self.rate
    }

    fn samples(&self) -> usize {
        let experiments = self.points.len() * self.blocks * self.experiments;
        let ways: usize = self.ways.iter().map(|way| way.samples).sum();
        ways + experiments * self.periods * self.signals.length()
    }

    /// Excited frequencies, Hz.
    pub fn band(&self) -> [f64; 2] {
        let hertz = |line: Option<&usize>| line.map_or(0.0, |l| *l as f64 / self.period);
        [hertz(self.lines.first()), hertz(self.lines.last())]
    }

    /// The plan, sample by sample: what to command, and the excitation that is part of its torque.
    pub fn commands(&self) -> impl Iterator<Item = (Command, Vec<f64>)> + '_ {
        // A way to each point and its experiments, and the last way, which leads to rest.
        self.ways.iter().enumerate().flat_map(|(p, way)| {
            let on_way = (0..way.samples).map(|k| {
                let still = vec![0.0; self.joints.len()];
                (self.command(&way.at(&self.slow, self.time(k))), still)
            });
            let held = self.points.get(p).map(|point| self.held(p, point));
            on_way.chain(held.into_iter().flatten())
        })
    }

    fn time(&self, sample: usize) -> f64 {
        sample as f64 / self.rate
    }

    /// The experiments at a point.
    fn held<'a>(
        &'a self,
        p: usize,
        point: &[f64],
    ) -> impl Iterator<Item = (Command, Vec<f64>)> + 'a {
        let way = Way::held(point);
        let length = self.signals.length();
        // The carrier has a whole number of cycles in a period.
        let period: Rc<[Command]> = (0..length)
            .map(|k| self.command(&way.at(&self.slow, self.time(k))))
            .collect();
        let all = (0..self.blocks).flat_map(|b| (0..self.experiments).map(move |e| (b, e)));
        all.flat_map(move |(block, experiment)| {
            let drives = self.signals.of(&self.phases[p][block], experiment);
            let period = period.clone();
            (0..self.periods * length).map(move |k| {
                let reference: Vec<f64> = drives.iter().map(|x| x[k % length]).collect();
                let mut command = period[k % length].clone();
                for (tau, drive) in command.tau.iter_mut().zip(&reference) {
                    *tau += drive;
                }
                (command, reference)
            })
        })
    }

    /// A command with the torque that the model foresees.
    fn command(&self, at: &[[f64; 3]]) -> Command {
        let of = |d: usize| -> Vec<f64> { at.iter().map(|x| x[d]).collect() };
        let [q, dq, ddq] = [of(0), of(1), of(2)];
        let mut tau = Vec::new();
        for (n, (first, feed)) in self.feed.iter().enumerate() {
            let last = self.feed.get(n + 1).map_or(q.len(), |(next, _)| *next);
            let own = *first..last;
            tau.extend(feed.torque(&q[own.clone()], &dq[own.clone()], &ddq[own]));
        }
        Command { q, dq, ddq, tau }
    }

    /// Torques at a line in the experiments of a block: a matrix of joints and experiments.
    #[cfg(test)]
    fn torques(
        &self,
        [point, block, line]: [usize; 3],
    ) -> nalgebra::DMatrix<realfft::num_complex::Complex64> {
        nalgebra::DMatrix::from_fn(self.joints.len(), self.experiments, |j, e| {
            self.signals
                .coefficient(&self.phases[point][block], j, e, line)
        })
    }
}
