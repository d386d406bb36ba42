//! The ladder of calibration: mount and targets, zeros of the joints, whole frames, then each effect that gains.
//!
//! Every rung is judged by the error of each pose that a fit without it makes. A step needs a mean gain over poses of [`LEAST_Z`] of its own
//! standard errors and [`LEAST_GAIN`] of the error: in 400 arms as described, with some forty candidates each, nothing was added.

use super::chain::{Chain, State};
use super::columns::{Column, Unknown};
use super::error::CalibrateError;
use super::facts::{EFFECTS, Fact, LINK_GEOMETRY, OFFSETS, Per};
use super::fit::{Fit, Problem};
use super::held_out;
use super::identifiable::OPEN;
use super::poses::Poses;
use super::{outliers, start};
use crate::model::JointQuantity as Q;
use crate::robust::gain;

/// Standard errors that a step's mean gain needs.
pub(super) const LEAST_Z: f64 = 3.0;
/// Share of the error that it needs.
pub(super) const LEAST_GAIN: f64 = 0.02;
/// Most effects that are added.
const MOST_STEPS: usize = 6;
/// Scales of the priors of geometry that are tried.
const SCALES: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
/// Share by which a held-out error may be larger and count as the same.
const AS_GOOD: f64 = 0.02;
/// Candidates whose gain differs from the best one's by fewer standard errors are its look-alikes.
const ALIKE: f64 = 2.0;

/// A rung of the ladder.
#[derive(Debug, Clone)]
pub(super) struct Rung {
    /// `mount`, `joint_offset`, `link_geometry` or an effect.
    pub(super) step: &'static str,
    /// The joints of an effect; empty for all.
    pub(super) joints: Vec<usize>,
    /// Held-out error, mm.
    pub(super) error: f64,
}

/// A candidate that was judged at the last rung that it was not part of.
#[derive(Debug, Clone)]
pub(super) struct Judged {
    pub(super) fact: &'static Fact,
    pub(super) joints: Vec<usize>,
    /// Held-out error with it, mm.
    pub(super) error: f64,
    /// Mean gain in standard errors.
    pub(super) z: f64,
    pub(super) taken: bool,
    /// Others that cannot be told from it by these poses.
    pub(super) alternatives: Vec<(&'static str, Vec<usize>)>,
}

/// What was found.
pub(super) struct Found {
    pub(super) fit: Fit,
    pub(super) path: Vec<Rung>,
    pub(super) judged: Vec<Judged>,
    pub(super) outliers: Vec<(usize, f64)>,
    pub(super) used: Vec<usize>,
}

/// Climbs the ladder.
pub(super) fn search(
    chain: &Chain,
    poses: &Poses,
    started: &State,
    only_offsets: bool,
) -> Result<Found, CalibrateError> {
    let mut problem = Problem {
        chain,
        poses,
        used: (0..poses.count())
            .filter(|&n| super::columns::numbers(&poses.poses[n]) > 0)
            .collect(),
    };
    let rich = all_columns(&problem, started, only_offsets);
    let outliers = outliers::find(&problem, started, rich)?;
    problem
        .used
        .retain(|used| outliers.iter().all(|(pose, _)| pose != used));
    let found = climb(&problem, started, only_offsets);
    Ok(Found {
        outliers,
        used: problem.used,
        ..found
    })
}

/// Mount, targets and frames (or zeros).
pub(super) fn frames_and_fixtures(
    problem: &Problem,
    state: &State,
    only_offsets: bool,
) -> Vec<Column> {
    let fixtures = start::columns(state, &problem.used());
    let joints = asked_joints(problem, state);
    let frames = frame_columns(problem.chain, &joints, !only_offsets, 1.0);
    [fixtures, frames].concat()
}

/// The same with elasticity: all that is looked for first.
fn all_columns(problem: &Problem, state: &State, only_offsets: bool) -> Vec<Column> {
    let joints = asked_joints(problem, state);
    let elastic = effect_columns(problem, state, &EFFECTS[0], &joints);
    [frames_and_fixtures(problem, state, only_offsets), elastic].concat()
}

/// A way up the ladder.
struct Climb {
    fit: Fit,
    path: Vec<Rung>,
    judged: Vec<Judged>,
}

fn climb(problem: &Problem, started: &State, only_offsets: bool) -> Found {
    let mut fit = problem.fit_fixtures(started);
    let mut path = vec![rung("mount", &fit)];
    let zeros = geometry(problem, &fit, false);
    if gains(&fit, &zeros) {
        fit = zeros;
        path.push(rung(OFFSETS.name, &fit));
    }
    let here = Climb {
        fit,
        path,
        judged: Vec::new(),
    };
    let found = if only_offsets {
        here
    } else {
        beyond_zeros(problem, here)
    };
    Found {
        fit: found.fit,
        path: found.path,
        judged: found.judged,
        outliers: Vec::new(),
        used: Vec::new(),
    }
}

/// Frames, then effects. What is missing otherwise may hide what frames gain: where they do not gain alone, both ways are gone, and the one
/// with frames has to gain over the other as a whole.
fn beyond_zeros(problem: &Problem, here: Climb) -> Climb {
    let frames = geometry(problem, &here.fit, true);
    let alone = gains(&here.fit, &frames);
    let mut path = here.path.clone();
    path.push(rung(LINK_GEOMETRY.name, &frames));
    let with_frames = add_effects(
        problem,
        Climb {
            fit: frames,
            path,
            judged: Vec::new(),
        },
    );
    if alone {
        return with_frames;
    }
    let without = add_effects(problem, here);
    if gains(&without.fit, &with_frames.fit) {
        with_frames
    } else {
        without
    }
}

fn add_effects(problem: &Problem, mut climb: Climb) -> Climb {
    effects(problem, &mut climb.fit, &mut climb.path, &mut climb.judged);
    let fit = rescaled(problem, &climb.fit);
    if let Some(last) = climb.path.last_mut() {
        last.error = fit.error_mm();
    }
    Climb { fit, ..climb }
}

/// The fit with the widest priors of geometry whose held-out error is the least, or within [`AS_GOOD`] of it: they were chosen when the model
/// lacked its effects, and a prior that is too narrow makes standard deviations too small.
fn rescaled(problem: &Problem, fit: &Fit) -> Fit {
    let is_frame = |c: &Column| matches!(c.unknown, Unknown::Shift(..) | Unknown::Turn(..));
    if !fit.columns.iter().any(is_frame) {
        return fit.clone();
    }
    let joints = asked_joints(problem, &fit.state);
    let whole = fit
        .columns
        .iter()
        .any(|c| matches!(c.unknown, Unknown::Turn(_, 1)));
    let tried: Vec<Fit> = SCALES
        .iter()
        .map(|&scale| {
            let priors = frame_columns(problem.chain, &joints, whole, scale);
            let mut columns = fit.columns.clone();
            for column in columns.iter_mut().filter(|c| is_frame(c)) {
                if let Some(own) = priors.iter().find(|own| own.unknown == column.unknown) {
                    column.prior = own.prior;
                }
            }
            problem.fit(columns, &fit.state, fit.noise)
        })
        .collect();
    let tried: Vec<Fit> = tried
        .into_iter()
        .filter(|t| wrong_signs(problem, t) == 0)
        .collect();
    let sums: Vec<f64> = tried.iter().map(|t| sum(&t.by_pose(fit.noise))).collect();
    let least = sums.iter().copied().fold(f64::INFINITY, f64::min);
    let widest = sums
        .iter()
        .rposition(|s| *s <= least * (1.0 + AS_GOOD).powi(2));
    let chosen = widest.and_then(|n| tried.into_iter().nth(n));
    chosen.unwrap_or_else(|| fit.clone())
}

fn rung(step: &'static str, fit: &Fit) -> Rung {
    Rung {
        step,
        joints: Vec::new(),
        error: fit.error_mm(),
    }
}

/// Whether a fit is better on poses that it has not seen, beyond its own error.
fn gains(before: &Fit, after: &Fit) -> bool {
    let [a, b] = [before, after].map(|fit| fit.by_pose(before.noise));
    let [sum_a, sum_b] = [&a, &b].map(|x| x.iter().sum::<f64>());
    gain(&a, &b) >= LEAST_Z && (sum_b / sum_a).sqrt() <= 1.0 - LEAST_GAIN
}

/// Whether the poses move a joint's frame, and so whether it is asked for: the first frame of a path moves everything as the mount does.
fn asked_joints(problem: &Problem, state: &State) -> Vec<usize> {
    let mut joints: Vec<usize> = (state.targets.iter())
        .flat_map(|target| problem.chain.path(target.body))
        .filter(|&joint| problem.chain.parent(joint).is_some())
        .collect();
    joints.sort_unstable();
    joints.dedup();
    joints
}

/// The columns of joint frames: their zeros alone, or all six numbers; priors scaled.
pub(super) fn frame_columns(
    chain: &Chain,
    joints: &[usize],
    whole: bool,
    scale: f64,
) -> Vec<Column> {
    let size = LINK_GEOMETRY.size * scale;
    let zero = |joint: usize| {
        let unknown = if chain.slides(joint) {
            Unknown::Shift(joint, 0)
        } else {
            Unknown::Turn(joint, 0)
        };
        let prior = if whole {
            size.max(OFFSETS.size * scale.min(1.0))
        } else {
            OFFSETS.size * scale
        };
        Column::about_zero(unknown, prior)
    };
    let mut columns: Vec<Column> = joints.iter().map(|&joint| zero(joint)).collect();
    if whole {
        for &joint in joints {
            for n in 0..3 {
                for unknown in [Unknown::Shift(joint, n), Unknown::Turn(joint, n)] {
                    if columns.iter().all(|column| column.unknown != unknown) {
                        columns.push(Column::about_zero(unknown, size));
                    }
                }
            }
        }
    }
    columns
}

/// The best fit of zeros, or of frames, over the scales of their priors.
fn geometry(problem: &Problem, before: &Fit, whole: bool) -> Fit {
    let fixtures: Vec<Column> = (before.columns.iter())
        .filter(|c| matches!(c.unknown, Unknown::Mount(_) | Unknown::Target(..)))
        .copied()
        .collect();
    let joints = asked_joints(problem, &before.state);
    let mut best: Option<(f64, Fit)> = None;
    for scale in SCALES {
        let columns = [
            &fixtures[..],
            &frame_columns(problem.chain, &joints, whole, scale),
        ]
        .concat();
        let from = best.as_ref().map_or(before, |(_, fit)| fit);
        let fit = problem.fit(columns, &from.state, from.noise);
        let sum: f64 = fit.by_pose(before.noise).iter().sum();
        if best.as_ref().is_none_or(|(least, _)| sum < *least) {
            best = Some((sum, fit));
        }
    }
    best.map_or_else(|| before.clone(), |(_, fit)| fit)
}

/// What an effect's numbers are before the data at a joint: its size per what the poses multiply it by.
fn prior(problem: &Problem, state: &State, fact: &Fact, joint: usize) -> Option<f64> {
    let greatest = |of: &dyn Fn(&super::poses::Pose) -> f64| {
        let used = problem.used();
        used.iter()
            .map(|(_, pose)| of(pose).abs())
            .fold(0.0, f64::max)
    };
    let per = match fact.per {
        Per::One => 1.0,
        Per::Travel => greatest(&|pose| pose.q[joint]),
        Per::CarrierTravel => {
            let carrier = problem.chain.parent(joint)?;
            greatest(&|pose| pose.q[carrier])
        }
        Per::Load => greatest(&|pose| problem.chain.frames(state, pose).load[joint].norm()),
    };
    (per > 1e-9).then_some(fact.size / per)
}

/// The columns of an effect at joints.
pub(super) fn effect_columns(
    problem: &Problem,
    state: &State,
    fact: &Fact,
    joints: &[usize],
) -> Vec<Column> {
    let of_joint = |&joint: &usize| {
        let prior = prior(problem, state, fact, joint)?;
        let of = move |&quantity: &Q| Column::about_zero(Unknown::Joint(joint, quantity), prior);
        Some(fact.quantities.iter().map(of))
    };
    joints.iter().filter_map(of_joint).flatten().collect()
}

/// All candidates: each effect at all joints together and at each, but for what is in the fit.
fn candidates(problem: &Problem, fit: &Fit) -> Vec<(&'static Fact, Vec<usize>, Vec<Column>)> {
    let paths = (fit.state.targets.iter()).flat_map(|target| problem.chain.path(target.body));
    let mut joints: Vec<usize> = paths.collect();
    joints.sort_unstable();
    joints.dedup();
    let has = |joint: usize, quantity: Q| {
        let unknown = Unknown::Joint(joint, quantity);
        fit.columns.iter().any(|column| column.unknown == unknown)
    };
    let mut all = Vec::new();
    for fact in &EFFECTS {
        if fact.needs_sides && !problem.poses.has_sides {
            continue;
        }
        let open: Vec<usize> = (joints.iter().copied())
            .filter(|&joint| {
                fact.can_be_at(problem.chain, joint) && !has(joint, fact.quantities[0])
            })
            .collect();
        let single = open.iter().map(|&joint| vec![joint]);
        let family = (open.len() > 1).then(|| open.clone());
        for joints in family.into_iter().chain(single) {
            let columns = effect_columns(problem, &fit.state, fact, &joints);
            if !columns.is_empty() {
                all.push((fact, joints, columns));
            }
        }
    }
    all
}

/// Adds the best effect as long as one gains.
fn effects(problem: &Problem, fit: &mut Fit, path: &mut Vec<Rung>, judged: &mut Vec<Judged>) {
    for _ in 0..MOST_STEPS {
        let candidates = candidates(problem, fit);
        let columns: Vec<Column> = candidates
            .iter()
            .flat_map(|c| c.2.iter().copied())
            .collect();
        let all = fit.more(problem, &columns);
        let before = held_out::by_pose(&fit.rows, &fit.held_out);
        let mut first = 0;
        let mut scored: Vec<(usize, Vec<f64>, f64)> = Vec::with_capacity(candidates.len());
        for (n, (.., own)) in candidates.iter().enumerate() {
            let own = all.columns(first, own.len()).into_owned();
            first += own.ncols();
            let errors = fit.solved.held_out_with(&fit.rows, Some(&own));
            let rms = 1e3 * held_out::place_rms(&fit.rows, &errors);
            scored.push((n, held_out::by_pose(&fit.rows, &errors), rms));
        }
        scored.sort_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)));
        judged.retain(|judged| judged.taken);
        let judge = |(n, by_pose, rms): &(usize, Vec<f64>, f64)| Judged {
            fact: candidates[*n].0,
            joints: candidates[*n].1.clone(),
            error: *rms,
            z: gain(&before, by_pose),
            taken: false,
            alternatives: Vec::new(),
        };
        let Some(best) = scored.first() else { return };
        let mut best_judged = judge(best);
        judged.extend(scored.iter().skip(1).map(judge));
        let worth =
            best_judged.z >= LEAST_Z && (sum(&best.1) / sum(&before)).sqrt() <= 1.0 - LEAST_GAIN;
        let taken = worth
            .then(|| take(problem, fit, &candidates[best.0]))
            .flatten();
        let Some((next, joints)) = taken.filter(|(next, _)| gains(fit, next)) else {
            judged.push(best_judged);
            return;
        };
        let fact = best_judged.fact;
        best_judged.alternatives = (scored.iter().skip(1))
            .filter(|(n, by_pose, _)| {
                candidates[*n].0.name != fact.name
                    && gain(&before, by_pose) >= LEAST_Z
                    && gain(by_pose, &best.1) < ALIKE
            })
            .map(|(n, ..)| (candidates[*n].0.name, candidates[*n].1.clone()))
            .collect();
        best_judged.taken = true;
        best_judged.joints.clone_from(&joints);
        best_judged.error = next.error_mm();
        *fit = next;
        path.push(Rung {
            step: fact.name,
            joints,
            error: fit.error_mm(),
        });
        judged.push(best_judged);
    }
}

/// How many springs and gaps of a fit are negative, which none can be.
fn wrong_signs(problem: &Problem, fit: &Fit) -> usize {
    let is_wrong = |column: &&Column| match column.unknown {
        Unknown::Joint(_, Q::Elasticity | Q::Backlash) => {
            fit.state.value(problem.chain, column.unknown) <= 0.0
        }
        _ => false,
    };
    fit.columns.iter().filter(is_wrong).count()
}

fn sum(x: &[f64]) -> f64 {
    x.iter().sum()
}

/// The fit with a candidate, but for what comes out with a sign that it cannot have or that the poses do not move at all; and the joints that
/// stay. None if none does.
fn take(
    problem: &Problem,
    fit: &Fit,
    (fact, joints, own): &(&'static Fact, Vec<usize>, Vec<Column>),
) -> Option<(Fit, Vec<usize>)> {
    let mut columns = [&fit.columns[..], own].concat();
    // Each round takes at least one column away.
    for _ in 0..=columns.len() {
        let next = problem.fit(columns, &fit.state, fit.noise);
        let stays = |k: usize, column: &Column| match column.unknown {
            Unknown::Joint(_, quantity) => {
                let value = next.state.value(problem.chain, column.unknown);
                let is_open = next.solved.inverse.row(k).norm() > OPEN;
                let is_possible = !matches!(quantity, Q::Elasticity | Q::Backlash) || value > 0.0;
                is_possible && !is_open
            }
            _ => true,
        };
        columns = (next.columns.iter().enumerate())
            .filter(|(k, column)| stays(*k, column))
            .map(|(_, column)| *column)
            .collect();
        if columns.len() == next.columns.len() {
            let has = |&joint: &usize| {
                let unknown = Unknown::Joint(joint, fact.quantities[0]);
                columns.iter().any(|column| column.unknown == unknown)
            };
            let joints: Vec<usize> = joints.iter().copied().filter(has).collect();
            return (!joints.is_empty()).then_some((next, joints));
        }
    }
    None
}
