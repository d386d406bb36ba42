//! What black boxes are shown of a limb's motion, window by window: functions of position, velocity, acceleration and the torque that a
//! model predicts. No measured torque.

use std::ops::Range;

use crate::estimate::limb_data::LimbData;

/// Quantiles at which a function of a joint's own motion may bend, and one of another joint's.
const OWN_BENDS: [f64; 6] = [0.05, 0.2, 0.4, 0.6, 0.8, 0.95];
const OTHER_BENDS: [f64; 2] = [0.25, 0.75];
/// Windows ago that a box with a memory looks at.
const AGO: [usize; 5] = [1, 2, 3, 5, 8];
/// Displacements over which something may have a memory, shares of the root mean square of a joint's position about its mean.
const MEMORIES: [f64; 3] = [0.01, 0.05, 0.2];

/// The probes of a joint.
pub(super) struct Probes {
    /// The windows in which the joint is judged.
    pub(super) windows: Vec<usize>,
    /// Of each, a constant and numbers of mean zero and unit variance.
    pub(super) values: Vec<Vec<f64>>,
    /// How many of them see the joint, the limb, the past too.
    pub(super) seen: [usize; 3],
}

/// What a joint does in all windows: scaled to unit size.
struct Course {
    q: Vec<f64>,
    dq: Vec<f64>,
    ddq: Vec<f64>,
    /// What the model predicts.
    torque: Vec<f64>,
    /// The size of that, of unit mean square.
    load: Vec<f64>,
    /// Mean sign of the velocity, as dry friction has it, −1 to 1.
    direction: Vec<f64>,
}

impl Course {
    fn of(data: &LimbData, predicted: &[f64], joint: usize) -> Self {
        let n = data.joints();
        let state = |order: usize| {
            let mean = |window| {
                let of = |k: usize| data.motion.joint[joint].state[k][order];
                data.motion.mean(window, of)
            };
            scaled(data.motion.windows.iter().map(mean).collect())
        };
        let torque: Vec<f64> = predicted.iter().skip(joint).step_by(n).copied().collect();
        let usual = root_mean_square(&torque).max(f64::MIN_POSITIVE);
        let sign = |window| (data.motion).mean(window, |k| data.motion.sign(k, joint));
        Self {
            q: state(0),
            dq: state(1),
            ddq: state(2),
            load: torque.iter().map(|torque| torque.abs() / usual).collect(),
            torque: scaled(torque),
            direction: data.motion.windows.iter().map(sign).collect(),
        }
    }

    fn all(&self) -> [&Vec<f64>; 4] {
        [&self.q, &self.dq, &self.ddq, &self.torque]
    }
}

/// The probes of a joint under a model that predicts so.
pub(super) fn of(data: &LimbData, predicted: &[f64], joint: usize) -> Probes {
    let courses: Vec<Course> = (0..data.joints())
        .map(|j| Course::of(data, predicted, j))
        .collect();
    let own = &courses[joint];
    let mut columns = own_motion(own, &OWN_BENDS);
    let joint_sees = columns.len();
    for other in (0..courses.len())
        .filter(|j| *j != joint)
        .map(|j| &courses[j])
    {
        for x in other.all() {
            columns.extend(bent(x, &OTHER_BENDS));
        }
        columns.push(other.direction.clone());
        columns.push(product(&other.direction, &own.direction));
        columns.push(product(&other.dq, &own.dq));
        columns.push(product(&other.dq, &other.dq));
        columns.push(product(&other.ddq, &own.q));
        columns.push(product(&other.torque, &own.direction));
    }
    let limb_sees = columns.len();
    let runs = runs(data);
    columns.extend(ago(own, &runs));
    columns.extend(memory(own, &runs));
    let windows: Vec<usize> = (0..data.motion.windows.len())
        .filter(|&w| data.counts(w, joint))
        .collect();
    Probes {
        seen: [joint_sees, limb_sees, columns.len()],
        values: rows(&columns, &windows),
        windows,
    }
}

/// A joint's own motion, its memory and what changes with time, in these windows: a constant first, then numbers of mean zero and unit variance. As many as `fit` windows of
/// this count: functions bend more often or less.
pub(in crate::detect) fn of_joint(
    data: &LimbData,
    predicted: &[f64],
    joint: usize,
    windows: &[usize],
    fit: impl Fn(usize) -> bool,
) -> Option<Vec<Vec<f64>>> {
    let own = Course::of(data, predicted, joint);
    let time: Vec<f64> = (data.motion.windows.iter())
        .map(|window| window.t)
        .collect();
    let of = |bends: &[f64]| -> Vec<_> {
        // Friction that changes jumps where the motion turns, all the time.
        let aging = bent(&scaled(time.clone()), bends);
        let aging = aging.iter().map(|t| product(&own.direction, t));
        let motion = own_motion(&own, bends).into_iter().chain(aging);
        motion.chain(memory(&own, &runs(data))).collect()
    };
    let bends = [&OWN_BENDS[..], &OTHER_BENDS].into_iter();
    let columns = bends.map(of).find(|columns| fit(columns.len()));
    Some(rows(&columns?, windows))
}

/// Columns of all windows as rows of some, scaled there.
fn rows(columns: &[Vec<f64>], windows: &[usize]) -> Vec<Vec<f64>> {
    let scaled: Vec<Vec<f64>> = (columns.iter().enumerate())
        .map(|(k, column)| {
            let chosen: Vec<f64> = windows.iter().map(|&w| column[w]).collect();
            if k == 0 { chosen } else { scaled(chosen) }
        })
        .collect();
    let row = |n: usize| scaled.iter().map(|column| column[n]).collect();
    (0..windows.len()).map(row).collect()
}

/// A constant, and what a joint does at the moment.
fn own_motion(own: &Course, bends: &[f64]) -> Vec<Vec<f64>> {
    let mut columns = vec![vec![1.0; own.q.len()]];
    for x in own.all() {
        columns.extend(bent(x, bends));
    }
    columns.push(own.direction.clone());
    // Friction that depends on position jumps where the motion turns: left in, it is taken for noise.
    for x in bent(&own.q, bends).iter().chain([&own.dq, &own.ddq]) {
        columns.push(product(&own.direction, x));
    }
    columns.push(product(&own.direction, &own.load));
    columns.push(product(&own.q, &own.dq));
    columns.push(product(&own.q, &own.torque));
    columns.push(product(&own.dq, &own.torque));
    columns
}

/// The joint some windows ago.
fn ago(own: &Course, runs: &[Range<usize>]) -> Vec<Vec<f64>> {
    let mut columns = Vec::new();
    for ago in AGO {
        for x in [&own.dq, &own.ddq, &own.torque, &own.direction] {
            let mut column = vec![0.0; own.q.len()];
            for run in runs {
                run.clone()
                    .for_each(|w| column[w] = x[w.saturating_sub(ago).max(run.start)]);
            }
            columns.push(column);
        }
    }
    columns
}

/// How fast and how much more the parts of a torque change that may be late (the model's torque, the rotor's, dry friction), and where the joint's
/// displacement was held by bristles of several lengths (Dahl's, in the limit of a sharp bend).
fn memory(own: &Course, runs: &[Range<usize>]) -> Vec<Vec<f64>> {
    let changes = [&own.torque, &own.ddq, &own.direction]
        .into_iter()
        .flat_map(|x| {
            let slope = change(x, runs);
            [change(&slope, runs), slope]
        });
    let bends = MEMORIES.map(|length| {
        let mut column = vec![0.0; own.q.len()];
        for run in runs {
            for w in run.clone().skip(1) {
                column[w] = (column[w - 1] + (own.q[w] - own.q[w - 1]) / length).clamp(-1.0, 1.0);
            }
        }
        column
    });
    changes.chain(bends).collect()
}

/// Windows that follow each other without a gap.
fn runs(data: &LimbData) -> Vec<Range<usize>> {
    let windows = &data.motion.windows;
    let mut runs: Vec<Range<usize>> = Vec::new();
    for w in 0..windows.len() {
        match runs.last_mut() {
            Some(run) if windows[w - 1].samples[1] == windows[w].samples[0] => run.end = w + 1,
            _ => runs.push(w..w + 1),
        }
    }
    runs
}

/// Half the difference of a window's neighbours.
fn change(x: &[f64], runs: &[Range<usize>]) -> Vec<f64> {
    let mut column = vec![0.0; x.len()];
    for run in runs {
        for w in run.clone() {
            let [before, after] = [w.saturating_sub(1).max(run.start), (w + 1).min(run.end - 1)];
            column[w] = 0.5 * (x[after] - x[before]);
        }
    }
    column
}

/// The straight line, and lines that bend at quantiles.
fn bent(x: &[f64], bends: &[f64]) -> Vec<Vec<f64>> {
    let mut sorted = x.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let at = |share: &f64| sorted.get((share * sorted.len() as f64) as usize).copied();
    let bend = |knot: f64| x.iter().map(|x| (x - knot).max(0.0)).collect();
    let lines = bends.iter().filter_map(at).map(bend);
    [x.to_vec()].into_iter().chain(lines).collect()
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

fn root_mean_square(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// To mean zero and unit variance; what does not vary to nothing.
fn scaled(mut x: Vec<f64>) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter_mut().for_each(|x| *x -= mean);
    let size = root_mean_square(&x);
    let scale = if size > 1e-9 * mean.abs() && size > 0.0 {
        size.recip()
    } else {
        0.0
    };
    x.iter_mut().for_each(|x| *x *= scale);
    x
}
