//! Which poses to measure: those that make the predicted error at all other poses least.
//!
//! The error that a calibration leaves at test poses all over the workspace is J_t P J_tᵀ, with P the parameters' covariance after the poses
//! (I-optimality: Atkinson, Donev & Tobias 2007, *Optimum Experimental Designs*, ch. 10; for calibration Carrillo et al. 2013). Poses are
//! taken one by one from a random pool, each the one that lowers the error most, and then exchanged one by one as long as that gains
//! (Fedorov 1972).

use nalgebra::DMatrix;
use proprio_solve::bounded::{inverse, triangle};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

use super::chain::{Chain, State, Target, point};
use super::columns::{Column, Noise, Unknown, rows};
use super::error::CalibrateError;
use super::facts::EFFECTS;
use super::identifiable::{blank_pose, random_poses};
use super::poses::Pose;
use super::reported::owner;
use super::search::frame_columns;
use super::start::FREE;
use crate::model::{JointQuantity as Q, Model};

/// Poses to choose from, for each that is asked for; at least so many. Of 24 simulated arms of 2.5 m, 24 poses that are chosen of 12 for each leave the
/// 0.038 mm of 30 random ones; of 200 for each 0.035 mm, and 23 leave 0.038 mm.
const POOL: usize = 200;
const LEAST_POOL: usize = 1000;
/// Poses at which the error is predicted.
const TESTS: usize = 120;
/// Rounds of exchanges.
const EXCHANGES: usize = 2;
/// Random sets that the choice is compared with.
const RANDOM_SETS: usize = 5;
/// Noise of a laser tracker, m and rad.
const NOISE: Noise = Noise {
    place: 0.03e-3,
    turn: 0.1e-3,
};
/// Where a target is taken to be in the last link if the model does not state it, m: off every axis.
const ASSUMED_TARGET: [f64; 3] = [0.1, 0.1, 0.1];
/// Share of a joint's range that is kept from either stop.
const MARGIN: f64 = 0.05;
/// Lines between joints that are no neighbours come no nearer than this, m.
const CLEARANCE: f64 = 0.1;
/// Points of such a line that are looked at.
const POINTS: usize = 6;
/// Times that a pool is drawn to find poses that are clear.
const DRAWS: usize = 40;

/// What a parameter will be known to.
#[derive(Debug, Clone, Serialize)]
pub struct Expected {
    /// As `calibrate` calls it.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Standard deviation after the poses.
    pub std: f64,
    /// Before.
    pub prior_std: f64,
}

/// Chosen poses.
#[derive(Debug, Clone, Serialize)]
pub struct PoseDesign {
    /// How many.
    pub poses: usize,
    /// Predicted error at other poses, rms distance, mm.
    pub predicted_error: f64,
    /// The same after as many poses at random, mm.
    pub random_error: f64,
    /// How many of the chosen reach what all the random ones do.
    pub enough: usize,
    /// What parameters will be known to.
    pub parameters: Vec<Expected>,
    /// What was not checked.
    pub unchecked: &'static str,
    /// Names of the joints that move.
    pub joints: Vec<String>,
    /// Their positions, rad or m.
    #[serde(skip)]
    pub positions: Vec<Vec<f64>>,
}

/// Chooses poses for the limb that ends farthest from the base, or that carries the model's targets.
///
/// # Errors
/// [`CalibrateError::Design`] if no pose is clear of the robot itself.
pub fn design_poses(model: &Model, count: usize, seed: u64) -> Result<PoseDesign, CalibrateError> {
    let chain = Chain::new(model);
    let state = assumed(model)?;
    let path = chain.path(state.targets.first().and_then(|target| target.body));
    let columns = unknowns(&chain, &state, &path);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |n: usize| clear_poses(model, &chain, &state, &path, n, &mut rng);
    let pool = draw((POOL * count).max(LEAST_POOL))?;
    let tests = draw(TESTS)?;
    let random: Vec<Vec<Pose>> = (0..RANDOM_SETS)
        .map(|_| draw(count))
        .collect::<Result<_, _>>()?;
    let blocks = |poses: &[Pose]| -> Vec<DMatrix<f64>> {
        let all: Vec<(usize, &Pose)> = poses.iter().enumerate().collect();
        let rows = rows(&chain, &state, &all, &columns, NOISE);
        let of = |(_, range): &(usize, std::ops::Range<usize>)| {
            rows.w.rows(range.start, range.len()).into_owned()
        };
        rows.poses.iter().map(of).collect()
    };
    let candidates = blocks(&pool);
    let all = candidates.iter().flat_map(DMatrix::row_iter);
    let all: Vec<_> = all.map(|row| row.transpose()).collect();
    let task = Task {
        columns: DMatrix::from_columns(&all),
        candidates,
        weight: weight(&blocks(&tests)),
        tests: tests.len(),
    };
    let (chosen, errors) = task.choose(count);
    let mut random: Vec<f64> = random
        .iter()
        .map(|poses| task.error(&covariance(blocks(poses).iter(), columns.len())))
        .collect();
    random.sort_by(f64::total_cmp);
    let random_error = random[random.len() / 2];
    let enough = errors.iter().position(|e| *e <= random_error);
    let p = covariance(chosen.iter().map(|&n| &task.candidates[n]), columns.len());
    let parameters = columns.iter().enumerate().map(|(k, column)| Expected {
        name: called(model, column.unknown),
        unit: unit(&chain, column.unknown),
        std: p[(k, k)].sqrt() * column.prior,
        prior_std: column.prior,
    });
    let positions = chosen
        .iter()
        .map(|&n| path.iter().map(|&joint| pool[n].q[joint]).collect());
    Ok(PoseDesign {
        poses: chosen.len(),
        predicted_error: task.error(&p),
        random_error,
        enough: enough.map_or(count, |n| n + 1),
        parameters: parameters.collect(),
        unchecked: "shapes of links, floor, cables, lines of sight, and the way between poses",
        joints: path
            .iter()
            .map(|&joint| model.joint_name(joint).to_owned())
            .collect(),
        positions: positions.collect(),
    })
}

/// The description, its targets where the model has them, or one assumed at the end of the longest limb.
fn assumed(model: &Model) -> Result<State, CalibrateError> {
    let robot = model.robot();
    let mut targets = Vec::new();
    for tool in &model.kinematics().tools {
        let frame = robot.frame(&tool.link)?;
        targets.push(Target {
            body: frame.body,
            placement: frame.placement.compose(&tool.fixture.transform()),
        });
    }
    if targets.is_empty() {
        let depth =
            |b: &usize| std::iter::successors(Some(*b), |&b| robot.bodies()[b].parent).count();
        targets.push(Target {
            body: (0..robot.bodies().len()).rev().max_by_key(depth),
            placement: proprio_core::spatial::Transform::from_translation(ASSUMED_TARGET.into()),
        });
    }
    targets.truncate(1);
    Ok(State::nominal(model, targets))
}

/// All that a calibration may find: mount, target, frames, elasticity.
fn unknowns(chain: &Chain, state: &State, path: &[usize]) -> Vec<Column> {
    let free = |unknown| Column::about_zero(unknown, FREE);
    let mut columns: Vec<Column> = (0..6).map(|k| free(Unknown::Mount(k))).collect();
    columns.extend((0..3).map(|k| free(Unknown::Target(0, k))));
    let joints: Vec<usize> = (path.iter().copied())
        .filter(|&j| chain.parent(j).is_some())
        .collect();
    columns.extend(frame_columns(chain, &joints, true, 1.0));
    // What a joint yields by where the arm is stretched out, as the facts have it of manufacture.
    let stretched = blank_pose(chain.joints(), &[false]);
    let load = chain.frames(state, &stretched).load;
    let elastic = path.iter().filter(|&&joint| load[joint].norm() > 1e-3);
    columns.extend(elastic.map(|&joint| {
        let prior = EFFECTS[0].size / load[joint].norm();
        Column::about_zero(Unknown::Joint(joint, Q::Elasticity), prior)
    }));
    columns
}

/// Random poses within the stops whose links stay clear of each other.
fn clear_poses(
    model: &Model,
    chain: &Chain,
    state: &State,
    path: &[usize],
    count: usize,
    rng: &mut ChaCha8Rng,
) -> Result<Vec<Pose>, CalibrateError> {
    let blank = blank_pose(chain.joints(), &[false]);
    let mut clear = Vec::with_capacity(count);
    for _ in 0..DRAWS {
        let mut drawn = random_poses(model.robot(), path, &blank, count, rng);
        for pose in &mut drawn {
            for &joint in path {
                let [low, high] = [0.0, 1.0]
                    .map(|share| super::identifiable::position(model.robot(), joint, share));
                let middle = 0.5 * (low + high);
                pose.q[joint] = middle + (1.0 - 2.0 * MARGIN) * (pose.q[joint] - middle);
            }
        }
        clear.extend(
            drawn
                .into_iter()
                .filter(|pose| is_clear(chain, state, path, pose)),
        );
        if clear.len() >= count {
            clear.truncate(count);
            return Ok(clear);
        }
    }
    Err(CalibrateError::Design(format!(
        "of {} random poses within the stops fewer than {count} keep lines between joints {CLEARANCE} m apart",
        DRAWS * count
    )))
}

/// Whether lines between joints that are no neighbours stay apart.
fn is_clear(chain: &Chain, state: &State, path: &[usize], pose: &Pose) -> bool {
    let frames = chain.frames(state, pose);
    let mut corners: Vec<nalgebra::Vector3<f64>> = vec![nalgebra::Vector3::zeros()];
    for &joint in path {
        let at = frames.joint[joint].translation;
        if corners
            .last()
            .is_none_or(|last| (at - last).norm() > CLEARANCE)
        {
            corners.push(at);
        }
    }
    if let Some((target, body)) = state.targets.first().and_then(|t| Some((t, t.body?))) {
        let at = point(&frames.link[body], &target.placement.translation);
        if corners
            .last()
            .is_none_or(|last| (at - last).norm() > CLEARANCE)
        {
            corners.push(at);
        }
    }
    let lines: Vec<_> = corners.windows(2).map(|w| (w[0], w[1])).collect();
    let points = |(a, b): (nalgebra::Vector3<f64>, nalgebra::Vector3<f64>)| {
        (0..=POINTS).map(move |k| a + (b - a) * (k as f64 / POINTS as f64))
    };
    (0..lines.len()).all(|a| {
        (a + 2..lines.len())
            .all(|b| points(lines[a]).all(|p| points(lines[b]).all(|q| (p - q).norm() > CLEARANCE)))
    })
}

/// Poses to choose from, and where the error is predicted.
struct Task {
    candidates: Vec<DMatrix<f64>>,
    /// Their rows as columns, one candidate after the other.
    columns: DMatrix<f64>,
    /// J_tᵀ J_t over the tests: not an equation that is solved but the weight of its errors.
    weight: DMatrix<f64>,
    tests: usize,
}

fn weight(tests: &[DMatrix<f64>]) -> DMatrix<f64> {
    let p = tests.first().map_or(0, DMatrix::ncols);
    tests
        .iter()
        .fold(DMatrix::zeros(p, p), |sum, j| sum + j.tr_mul(j))
}

/// Covariance of the parameters after poses, in units of their priors.
fn covariance<'a>(poses: impl Iterator<Item = &'a DMatrix<f64>>, p: usize) -> DMatrix<f64> {
    let poses: Vec<&DMatrix<f64>> = poses.collect();
    let count: usize = poses.iter().map(|w| w.nrows()).sum();
    let mut stacked = DMatrix::zeros(count + p, p);
    let mut row = 0;
    for w in poses {
        stacked.rows_mut(row, w.nrows()).copy_from(w);
        row += w.nrows();
    }
    stacked.view_mut((count, 0), (p, p)).fill_with_identity();
    let inverse = inverse(&triangle(stacked));
    &inverse * inverse.transpose()
}

impl Task {
    /// Predicted error, rms distance, mm.
    fn error(&self, covariance: &DMatrix<f64>) -> f64 {
        let variance = self.weight.component_mul(covariance).sum();
        1e3 * NOISE.place * (variance / self.tests.max(1) as f64).sqrt()
    }

    /// The candidate that lowers the error most (squared, in units of the noise).
    fn best(&self, covariance: &DMatrix<f64>, taken: &[usize]) -> Option<usize> {
        // Products with all candidates at once: one by one most of the time is spent on calls.
        let innovations = covariance * &self.columns;
        let lowered = covariance * (&self.weight * &innovations);
        let mut first = 0;
        let gain = |w: &DMatrix<f64>| {
            let [own, known, lowered] =
                [&self.columns, &innovations, &lowered].map(|all| all.columns(first, w.nrows()));
            first += w.nrows();
            let innovation = own.tr_mul(&known) + DMatrix::identity(w.nrows(), w.nrows());
            innovation
                .cholesky()
                .map_or(0.0, |c| c.solve(&own.tr_mul(&lowered)).trace())
        };
        let gains: Vec<f64> = self.candidates.iter().map(gain).collect();
        (0..gains.len())
            .filter(|n| !taken.contains(n))
            .max_by(|a, b| gains[*a].total_cmp(&gains[*b]))
    }

    /// Poses one by one, then exchanged; and the error after each of them in the order in which they stand at the end.
    fn choose(&self, count: usize) -> (Vec<usize>, Vec<f64>) {
        let p = self.weight.nrows();
        let mut chosen: Vec<usize> = Vec::with_capacity(count);
        let after = |chosen: &[usize]| covariance(chosen.iter().map(|&n| &self.candidates[n]), p);
        for _ in 0..count {
            let Some(best) = self.best(&after(&chosen), &chosen) else {
                break;
            };
            chosen.push(best);
        }
        for _ in 0..EXCHANGES {
            let before = chosen.clone();
            for k in 0..chosen.len() {
                let mut others = chosen.clone();
                others.remove(k);
                if let Some(best) = self.best(&after(&others), &others) {
                    chosen[k] = best;
                }
            }
            if chosen == before {
                break;
            }
        }
        let errors = (1..=chosen.len()).map(|n| self.error(&after(&chosen[..n])));
        let errors = errors.collect();
        (chosen, errors)
    }
}

/// As `calibrate` calls it; directions across an axis by number.
fn called(model: &Model, unknown: Unknown) -> String {
    const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];
    match unknown {
        Unknown::Mount(k) => format!("{}:mount", AXES[k]),
        Unknown::Target(_, k) => format!("{}:tool", AXES[k]),
        Unknown::Turn(j, 0) => format!("joint_offset:{}", model.joint_name(j)),
        Unknown::Shift(j, n) => format!("shift_{n}:link_geometry:{}", model.joint_name(j)),
        Unknown::Turn(j, n) => format!("turn_{n}:link_geometry:{}", model.joint_name(j)),
        Unknown::Joint(j, q) => format!("{}:{}:{}", q.key(), owner(q), model.joint_name(j)),
    }
}

fn unit(chain: &Chain, unknown: Unknown) -> &'static str {
    match unknown {
        Unknown::Mount(k) | Unknown::Target(_, k) if k < 3 => "m",
        Unknown::Shift(..) => "m",
        Unknown::Mount(_) | Unknown::Target(..) | Unknown::Turn(..) => "rad",
        Unknown::Joint(joint, quantity) => quantity.unit(chain.slides(joint)),
    }
}
