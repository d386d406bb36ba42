//! Nonparametric responses: torque to position at each point, with the scatter over periods and over blocks.
//!
//! Of n joints n experiments with independent excitations give the matrix of responses of a block, G = Q U⁻¹, where the columns of Q and U
//! are the mean spectra of the experiments. The controller closes a loop around the joints, so that noise of the position reaches the torque;
//! both are averaged over whole periods of one excitation before the quotient, which a periodic reference makes unbiased as periods grow
//! (Pintelon & Schoukens, *System Identification*, 2nd ed., section 2.5). Blocks with other phases are averaged as logarithms: their scatter
//! is noise and nonlinear distortion together, that of periods noise alone.

use std::borrow::Cow;

use nalgebra::DMatrix;
use realfft::num_complex::Complex64;

use super::error::FrfError;
use super::experiments::{Experiment, Experiments, Spectra, averaged};

/// Experiments whose mean positions differ by less than this share of their swing are at one point.
const SAME_POINT: f64 = 0.3;
/// The greatest condition number of the torques of a block's experiments.
const CONDITION: f64 = 1e3;
/// Neighbouring lines to each side over which a variance is averaged: one of few blocks is worth little alone.
const SMOOTHED: usize = 2;

/// A matrix of responses at each line.
pub(super) type Response = Vec<DMatrix<Complex64>>;

/// A point: where the robot stands, and its responses.
#[derive(Clone)]
pub(super) struct Point {
    /// Mean position of each joint, rad or m.
    pub(super) q: Vec<f64>,
    /// Positions at some instants of a period.
    pub(super) path: Vec<Vec<f64>>,
    /// The responses of each block.
    pub(super) blocks: Vec<Response>,
    /// Their mean. Of fewer experiments than joints, which give no responses, the positions of all experiments of all blocks, a column each.
    pub(super) mean: Response,
    /// Of fewer experiments than joints, the torques of all experiments; else empty.
    pub(super) torque: Response,
    /// Variance of each element of the mean by the scatter over periods: noise.
    pub(super) noise: Vec<DMatrix<f64>>,
    /// Variance by the scatter over blocks: noise and distortion. Of one block that of the noise.
    pub(super) variance: Vec<DMatrix<f64>>,
    /// The larger of the two over the squared mean, averaged over neighbouring lines.
    pub(super) relative: Vec<DMatrix<f64>>,
    /// Degrees of freedom of the variance.
    pub(super) dof: usize,
    /// Response of the link's encoder, and its noise; empty if there is none.
    pub(super) link: (Response, Vec<DMatrix<f64>>),
    /// Periods used of each experiment.
    pub(super) periods: usize,
    /// Periods left out of each, at most.
    pub(super) transient: usize,
    /// Power at even and odd lines that nothing excites, as a share of that at excited lines, if there are such lines.
    pub(super) distortion: [Option<f64>; 2],
}

/// Groups experiments into points and blocks, of as many experiments as joints or of `few`, and forms the responses.
///
/// # Errors
/// [`FrfError::FewExperiments`], [`FrfError::NotIndependent`].
pub(super) fn points(
    experiments: &Experiments,
    few: Option<usize>,
) -> Result<Vec<Point>, FrfError> {
    let joints = experiments.joints.len();
    let needed = few.map_or(joints, |few| few.min(joints));
    let mut groups: Vec<Vec<&Experiment>> = Vec::new();
    for experiment in &experiments.all {
        let near = |group: &&mut Vec<&Experiment>| is_same(group[0], experiment);
        match groups.iter_mut().find(near) {
            Some(group) => group.push(experiment),
            None => groups.push(vec![experiment]),
        }
    }
    let frequencies = experiments.frequencies();
    let of = |(index, group): (usize, &Vec<&Experiment>)| {
        if group.len() % needed != 0 {
            return Err(FrfError::FewExperiments {
                point: index + 1,
                experiments: group.len(),
                joints,
                needed,
            });
        }
        if needed < joints {
            return Ok(few_experiments(group, needed));
        }
        point(index, group, joints, &frequencies)
    };
    groups.iter().enumerate().map(of).collect()
}

fn is_same(a: &Experiment, b: &Experiment) -> bool {
    let all = a
        .point
        .iter()
        .zip(&b.point)
        .zip(a.swing.iter().zip(&b.swing));
    all.into_iter()
        .all(|((a, b), (x, y))| (a - b).abs() <= SAME_POINT * x.max(*y))
}

fn point(
    index: usize,
    group: &[&Experiment],
    joints: usize,
    frequencies: &[f64],
) -> Result<Point, FrfError> {
    let (mut blocks, mut noises, mut links) = (Vec::new(), Vec::new(), Vec::new());
    for (number, block) in group.chunks(joints).enumerate() {
        let inverse =
            inverse_torques(block, joints, frequencies.len()).map_err(|(line, condition)| {
                FrfError::NotIndependent {
                    point: index + 1,
                    block: number + 1,
                    joints,
                    condition,
                    f: frequencies[line],
                }
            })?;
        let (response, noise) = quotient(block, &inverse, |e| &e.q);
        blocks.push(response);
        noises.push(noise);
        if block
            .iter()
            .all(|e| !e.link.is_empty() && !e.link[0].is_empty())
        {
            links.push(quotient(block, &inverse, |e| &e.link));
        }
    }
    let count = blocks.len() as f64;
    let mean = log_mean(&blocks);
    let over_blocks = |of: &[Vec<DMatrix<f64>>]| -> Vec<DMatrix<f64>> {
        let line = |line: usize| {
            let sum = of
                .iter()
                .fold(DMatrix::zeros(joints, joints), |s: DMatrix<f64>, b| {
                    s + &b[line]
                });
            sum / (count * count)
        };
        (0..frequencies.len()).map(line).collect()
    };
    let noise = over_blocks(&noises);
    let variance = if blocks.len() > 1 {
        scatter(&blocks, &mean)
    } else {
        noise.clone()
    };
    let link = if links.len() == blocks.len() {
        let (responses, noises): (Vec<Response>, Vec<_>) = links.into_iter().unzip();
        (log_mean(&responses), over_blocks(&noises))
    } else {
        (Vec::new(), Vec::new())
    };
    let periods = periods(group);
    let dof = if blocks.len() > 1 {
        2 * (blocks.len() - 1)
    } else {
        2 * periods.saturating_sub(1)
    };
    Ok(Point {
        q: middle(group),
        path: group[0].path.clone(),
        torque: Vec::new(),
        blocks,
        relative: relative(&mean, &variance, &noise),
        mean,
        noise,
        variance,
        dof,
        link,
        periods,
        transient: transient(group),
        distortion: [0, 1].map(|parity| distortion(group, parity)),
    })
}

/// The mean position of each joint.
fn middle(group: &[&Experiment]) -> Vec<f64> {
    let joints = 0..group[0].point.len();
    let mean = |j: usize| group.iter().map(|e| e.point[j]).sum::<f64>() / group.len() as f64;
    joints.map(mean).collect()
}

/// Periods of the shortest experiment.
fn periods(group: &[&Experiment]) -> usize {
    group.iter().map(|e| e.q.len()).min().unwrap_or(0)
}

/// Periods left out of each experiment, at most.
fn transient(group: &[&Experiment]) -> usize {
    group.iter().map(|e| e.transient).max().unwrap_or(0)
}

/// A point of fewer experiments than joints in a block: what a matrix of responses would be made of. The model's responses times the torques are fitted to
/// the positions (Zimmermann & Moberg 2023).
fn few_experiments(group: &[&Experiment], per_block: usize) -> Point {
    // By line a matrix of joints and experiments.
    let columns = |of: &dyn Fn(&Experiment) -> &Spectra, group: &[&Experiment]| -> Response {
        let means: Vec<_> = group.iter().map(|e| averaged(of(e))).collect();
        let lines = 0..means[0].first().map_or(0, Vec::len);
        let line = |l: usize| DMatrix::from_fn(means[0].len(), means.len(), |i, e| means[e][i][l]);
        lines.map(line).collect()
    };
    let mean = columns(&|e| &e.q, group);
    let noise: Vec<DMatrix<f64>> = (mean.iter().enumerate())
        .map(|(line, mean)| {
            DMatrix::from_fn(mean.nrows(), mean.ncols(), |i, e| {
                let own = &group[e].q;
                let square = |q: &Vec<Vec<Complex64>>| (q[i][line] - mean[(i, e)]).norm_sqr();
                own.iter().map(square).sum::<f64>()
                    / (own.len().saturating_sub(1).max(1) * own.len()) as f64
            })
        })
        .collect();
    Point {
        q: middle(group),
        path: group[0].path.clone(),
        blocks: group
            .chunks(per_block)
            .map(|block| columns(&|e| &e.q, block))
            .collect(),
        torque: columns(&|e| &e.torque, group),
        relative: relative(&mean, &noise, &noise),
        mean,
        variance: noise.clone(),
        noise,
        dof: 2 * periods(group).saturating_sub(1),
        link: (Vec::new(), Vec::new()),
        periods: periods(group),
        transient: transient(group),
        distortion: [0, 1].map(|parity| distortion(group, parity)),
    }
}

impl Point {
    /// What a model's responses say of a line of [`mean`](Self::mean).
    pub(super) fn predicted<'m>(
        &self,
        line: usize,
        model: &'m DMatrix<Complex64>,
    ) -> Cow<'m, DMatrix<Complex64>> {
        match self.torque.get(line) {
            Some(torque) => Cow::Owned(model * torque),
            None => Cow::Borrowed(model),
        }
    }

    /// Whether its variance is that of blocks.
    pub(super) fn scatters_by_blocks(&self) -> bool {
        self.blocks.len() > 1 && self.torque.is_empty()
    }

    /// Columns of the mean, and of a block of it.
    pub(super) fn columns(&self, block: Option<usize>) -> std::ops::Range<usize> {
        let all = 0..self.mean.first().map_or(0, |m| m.ncols());
        match block {
            Some(block) if !self.torque.is_empty() => {
                let count = all.end / self.blocks.len().max(1);
                block * count..(block + 1) * count
            }
            _ => all,
        }
    }
}

/// U⁻¹ at each line; or the line at which it is worst, and its condition number.
fn inverse_torques(
    block: &[&Experiment],
    joints: usize,
    lines: usize,
) -> Result<Vec<DMatrix<Complex64>>, (usize, f64)> {
    let mean: Vec<Vec<Vec<Complex64>>> = block.iter().map(|e| averaged(&e.torque)).collect();
    (0..lines)
        .map(|line| {
            let torques = DMatrix::from_fn(joints, joints, |i, e| mean[e][i][line]);
            // Joints differ in size: rows are scaled before the condition is judged.
            let mut scaled = torques.clone();
            for mut row in scaled.row_iter_mut() {
                let size = row.norm();
                row /= Complex64::from(size.max(1e-300));
            }
            // An iteration for singular values need not end on what is not finite.
            if !scaled.iter().all(|x| x.is_finite()) {
                return Err((line, f64::INFINITY));
            }
            let values = scaled.singular_values();
            let condition = values.max() / values.min().max(1e-300);
            match torques.try_inverse() {
                Some(inverse) if condition <= CONDITION => Ok(inverse),
                _ => Err((line, condition)),
            }
        })
        .collect()
}

/// Mean output times U⁻¹, and the variance of each element by the scatter of periods about it.
fn quotient(
    block: &[&Experiment],
    inverse: &[DMatrix<Complex64>],
    output: impl Fn(&Experiment) -> &Spectra,
) -> (Response, Vec<DMatrix<f64>>) {
    let joints = inverse.first().map_or(0, |m| m.nrows());
    let mean: Vec<_> = block.iter().map(|e| averaged(output(e))).collect();
    let (mut response, mut noise) = (Vec::new(), Vec::new());
    for (line, inverse) in inverse.iter().enumerate() {
        let outputs = DMatrix::from_fn(joints, joints, |i, e| mean[e][i][line]);
        let g = &outputs * inverse;
        let mut variance = DMatrix::zeros(joints, joints);
        for (e, experiment) in block.iter().enumerate() {
            let periods = experiment.torque.len();
            for i in 0..joints {
                let square = |p: usize| {
                    let explained: Complex64 = (0..joints)
                        .map(|j| g[(i, j)] * experiment.torque[p][j][line])
                        .sum();
                    (output(experiment)[p][i][line] - explained).norm_sqr()
                };
                let sum: f64 = (0..periods).map(square).sum();
                let own = sum / (periods.saturating_sub(1).max(1) * periods) as f64;
                for j in 0..joints {
                    variance[(i, j)] += inverse[(e, j)].norm_sqr() * own;
                }
            }
        }
        response.push(g);
        noise.push(variance);
    }
    (response, noise)
}

/// The mean of blocks as logarithms of each element, relative to the first block.
fn log_mean(blocks: &[Response]) -> Response {
    let Some(first) = blocks.first() else {
        return Vec::new();
    };
    let line = |(line, reference): (usize, &DMatrix<Complex64>)| {
        DMatrix::from_fn(reference.nrows(), reference.ncols(), |i, j| {
            let own = reference[(i, j)];
            let sum: Complex64 = blocks.iter().map(|b| (b[line][(i, j)] / own).ln()).sum();
            let mean = own * (sum / blocks.len() as f64).exp();
            if mean.is_finite() { mean } else { own }
        })
    };
    first.iter().enumerate().map(line).collect()
}

/// Variance of the mean of blocks.
fn scatter(blocks: &[Response], mean: &Response) -> Vec<DMatrix<f64>> {
    let count = blocks.len() as f64;
    let line = |(line, mean): (usize, &DMatrix<Complex64>)| {
        DMatrix::from_fn(mean.nrows(), mean.ncols(), |i, j| {
            let square = |b: &Response| (b[line][(i, j)] - mean[(i, j)]).norm_sqr();
            blocks.iter().map(square).sum::<f64>() / (count * (count - 1.0))
        })
    };
    mean.iter().enumerate().map(line).collect()
}

/// Relative variance of each element, averaged over neighbouring lines.
fn relative(
    mean: &Response,
    variance: &[DMatrix<f64>],
    noise: &[DMatrix<f64>],
) -> Vec<DMatrix<f64>> {
    let own = |line: usize| {
        let larger = variance[line].zip_map(&noise[line], f64::max);
        larger.zip_map(&mean[line], |variance, mean| {
            variance / mean.norm_sqr().max(1e-300)
        })
    };
    let all: Vec<DMatrix<f64>> = (0..mean.len()).map(own).collect();
    let averaged = |line: usize| {
        let near = &all[line.saturating_sub(SMOOTHED)..(line + SMOOTHED + 1).min(all.len())];
        let (rows, columns) = near[0].shape();
        let sum = (near.iter()).fold(DMatrix::zeros(rows, columns), |sum, own| sum + own);
        sum / near.len() as f64
    };
    (0..all.len()).map(averaged).collect()
}

/// Power at silent lines of one parity over that at excited lines, per line.
fn distortion(group: &[&Experiment], parity: usize) -> Option<f64> {
    let power = |of: &[Vec<Complex64>]| {
        let all = || of.iter().flatten();
        all().map(|x| x.norm_sqr()).sum::<f64>() / all().count().max(1) as f64
    };
    let silent: Vec<f64> = (group.iter())
        .filter(|e| e.detection[parity].iter().any(|joint| !joint.is_empty()))
        .map(|e| power(&e.detection[parity]) / power(&averaged(&e.q)).max(1e-300))
        .collect();
    (!silent.is_empty()).then(|| silent.iter().sum::<f64>() / silent.len() as f64)
}
