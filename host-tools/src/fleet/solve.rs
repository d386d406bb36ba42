//! A limb over all its blocks: bodies are the same in all of them; what a joint has of its own may be another in each.
//!
//! In a block the joint's own columns come first, all that are kept. An orthogonal reduction then leaves rows without them, which say of bodies what no value of the
//! block's own effects can; those of all blocks together give the bodies (partially linear least squares: Golub & Pereyra, SIAM J. Numer. Anal. 10, 1973). So a
//! friction that warms from log to log, or an effect that no model has, is no error of a mass. The rows before them give, for these bodies, the block's own
//! values in any model of own effects. Couplings of joints are in the factors; they are taken to be none here.

use nalgebra::{DMatrix, DVector};
use proprio_core::effect::Form;
use proprio_solve::factor::{HeapFactor, numbers_of};

use super::columns::{BlockColumns, KeptColumn};
use super::partial::Kept;
use crate::robust;

/// Noise below which residuals are rounding, N m.
const LEAST_NOISE: f64 = 1e-6;
/// A block tells a value if its standard deviation is at most so many times the median block's: others, cut short or hardly moved, would
/// weigh as much as they do.
const MOST_STD: f64 = 3.0;

/// A limb's solution.
#[derive(Debug, Clone)]
pub struct LimbSolution {
    /// Values of the bodies' columns, with their ±, in the columns' units; by place among the columns.
    pub bodies: Vec<(usize, f64, f64)>,
    /// Each joint's own.
    pub joints: Vec<JointSolution>,
}

/// A joint's own effects, block by block.
#[derive(Debug, Clone, Default)]
pub struct JointSolution {
    /// Its own columns, by place among the limb's.
    pub columns: Vec<usize>,
    /// Which of the robot's blocks it has, in their order.
    pub blocks: Vec<u32>,
    /// Of each of them R θ = d of the own columns, \[R d; 0 ρ\] row by row, each from its diagonal on: rows in units of the noise, θ in the columns' units; ρ is
    /// what no value of the kept columns explains. `f32`, as a file has factors: those of all robots stay in memory until the fleet's model is known.
    numbers: Vec<f32>,
    /// Σ RᵀR and Σ RᵀS over blocks: how an error of the bodies moves own values; S is R's part of the bodies times the root of their covariance.
    normal: [DMatrix<f64>; 2],
}

/// A model's values in each block of a joint.
#[derive(Debug, Clone, Default)]
pub struct ModelValues {
    /// The model's columns, by place among the joint's own.
    pub columns: Vec<usize>,
    /// Of each block that tells them: which block, values, standard deviations by the noise within it.
    pub blocks: Vec<(usize, Vec<f64>, Vec<f64>)>,
    /// Of each column the part of its mean's ± that the bodies' errors make, in the column's unit.
    pub std_of_bodies: Vec<f64>,
}

/// Which columns are a joint's own: torques of its own motion.
fn own_columns(columns: &BlockColumns, joint: usize) -> Vec<usize> {
    let is_own = |k: &usize| {
        let column = &columns.columns[*k];
        let form = column.effect().map(|effect| effect.description().form);
        !column.is_inertial() && form == Some(Form::Columns)
    };
    columns.of_joint(joint).into_iter().filter(is_own).collect()
}

/// A block's triangle of a joint, own columns first, then shared ones, in units of priors and noise: the rows of its own columns.
struct Reduced {
    block: u32,
    joint: usize,
    rows: DMatrix<f64>,
    /// What no value of the kept columns explains, in units of the noise.
    unexplained: f64,
}

/// Solves a robot's limb; `None` without data.
pub fn solve(kept: &Kept) -> Option<LimbSolution> {
    let columns = &*kept.columns;
    let joints = columns.joints.len();
    let own: Vec<Vec<usize>> = (0..joints).map(|j| own_columns(columns, j)).collect();
    let is_body = |k: &usize| columns.columns[*k].is_inertial();
    let shared: Vec<usize> = (0..columns.columns.len()).filter(is_body).collect();
    let noise: Vec<f64> = (0..joints).map(|j| noise(kept, j)).collect();
    let places: Vec<Vec<usize>> = (0..joints)
        .map(|j| shared_places(columns, j, &shared))
        .collect();
    let orders: Vec<Order> = (0..joints)
        .map(|j| Order::of(columns, j, &own[j]))
        .collect();
    let mut sum = HeapFactor::new(shared.len());
    sum.fold(&mut identity(shared.len()));
    let mut reduced = Vec::new();
    for (b, block) in kept.blocks.iter().enumerate() {
        for (j, noise) in noise.iter().enumerate() {
            let Some(factor) = block.joint(j) else {
                continue;
            };
            let triangle = reduce(&orders[j], &factor, *noise);
            let (n, places) = (own[j].len(), &places[j]);
            let mut rows = trailing(&triangle, n, places, shared.len());
            sum.reflect(&mut rows, &|k| places.partition_point(|place| *place <= k));
            let number = |r: usize, c: usize| c.checked_sub(r).map_or(0.0, |c| triangle.row(r)[c]);
            reduced.push(Reduced {
                block: b as u32,
                joint: j,
                unexplained: factor.row(factor.columns())[0] / noise,
                rows: DMatrix::from_fn(n, triangle.columns() + 1, number),
            });
        }
    }
    if reduced.is_empty() {
        return None;
    }
    let mut bodies = vec![0.0; shared.len()];
    sum.solve_before(shared.len(), &mut bodies);
    let root = inverse(&sum);
    let told = shared.iter().enumerate().map(|(n, &k)| {
        let column = &columns.columns[k];
        let std = root.row(n).norm();
        (k, column.mean + column.std * bodies[n], column.std * std)
    });
    Some(LimbSolution {
        bodies: told.collect(),
        joints: (0..joints)
            .map(|j| {
                let blocks = reduced.iter().filter(|one| one.joint == j);
                joint_solution(columns, &own[j], blocks, (&places[j], &bodies, &root))
            })
            .collect(),
    })
}

/// A joint's noise: the median block's residual, N m.
fn noise(kept: &Kept, joint: usize) -> f64 {
    let blocks = kept
        .blocks
        .iter()
        .filter(|block| !block.joints[joint].is_empty());
    robust::median(blocks.map(|block| block.rms[joint]))
        .unwrap_or(0.0)
        .max(LEAST_NOISE)
}

/// Of a joint's shared columns, in their order in its rows, the places among the limb's shared ones.
fn shared_places(columns: &BlockColumns, joint: usize, shared: &[usize]) -> Vec<usize> {
    let of_joint = columns.of_joint(joint);
    let place = |k: &usize| shared.iter().position(|own| own == k);
    of_joint.iter().filter_map(place).collect()
}

/// Where the columns of a joint's factors stand in reduced ones.
struct Order<'a> {
    /// The joint's.
    of_joint: Vec<&'a KeptColumn>,
    /// Place of each, its own first, then bodies'; none of what is taken to be none.
    places: Vec<Option<usize>>,
    /// How many are its own, and how many have a place.
    own: usize,
    count: usize,
}

impl<'a> Order<'a> {
    fn of(columns: &'a BlockColumns, joint: usize, own: &[usize]) -> Self {
        let of_joint = columns.of_joint(joint);
        let bodies = of_joint
            .iter()
            .filter(|k| columns.columns[**k].is_inertial());
        let order: Vec<usize> = own.iter().chain(bodies).copied().collect();
        let to = |k: &usize| order.iter().position(|at| at == k);
        Self {
            places: of_joint.iter().map(to).collect(),
            of_joint: of_joint.iter().map(|&k| &columns.columns[k]).collect(),
            own: own.len(),
            count: order.len(),
        }
    }
}

/// A factor in units of priors and noise, own columns first and with their priors.
fn reduce(order: &Order<'_>, factor: &HeapFactor, noise: f64) -> HeapFactor {
    let (p, width) = (order.of_joint.len(), order.count + 1);
    // The last row is what nothing explains.
    let mut rows = vec![0.0; (p + order.own) * width];
    for (k, row) in rows.chunks_exact_mut(width).take(p).enumerate() {
        let numbers = factor.row(k);
        let mut right = numbers[p - k];
        for (x, c) in numbers[..p - k].iter().zip(k..) {
            if let Some(place) = order.places[c] {
                let column = order.of_joint[c];
                row[place] = x * column.std / noise;
                right -= x * column.mean;
            }
        }
        row[width - 1] = right / noise;
    }
    // Wide enough that what is told is not moved; what is not told stays finite.
    for (n, row) in rows.chunks_exact_mut(width).skip(p).enumerate() {
        row[n] = 1.0;
    }
    let mut triangle = HeapFactor::new(order.count);
    triangle.fold(&mut rows);
    triangle
}

/// The rows of a triangle after its `own` first columns, over the limb's shared columns.
fn trailing(triangle: &HeapFactor, own: usize, places: &[usize], shared: usize) -> Vec<f64> {
    let p = triangle.columns();
    let width = shared + 1;
    let mut rows = vec![0.0; (p - own) * width];
    for (row, k) in rows.chunks_exact_mut(width).zip(own..p) {
        let numbers = triangle.row(k);
        for (x, c) in numbers[..p - k].iter().zip(k - own..) {
            row[places[c]] = *x;
        }
        row[shared] = numbers[p - k];
    }
    rows
}

fn identity(n: usize) -> Vec<f64> {
    let mut rows = vec![0.0; n * (n + 1)];
    for (k, row) in rows.chunks_exact_mut(n + 1).enumerate() {
        row[k] = 1.0;
    }
    rows
}

/// The inverse of a triangle's first rows and columns; its row k is as long as the standard deviation of column k.
fn inverse(factor: &HeapFactor) -> DMatrix<f64> {
    let p = factor.columns();
    let triangle = factor.dense().view((0, 0), (p, p)).into_owned();
    triangle
        .solve_upper_triangular(&DMatrix::identity(p, p))
        .unwrap_or_else(|| DMatrix::zeros(p, p))
}

fn joint_solution<'a>(
    columns: &BlockColumns,
    own: &[usize],
    blocks: impl Iterator<Item = &'a Reduced>,
    (places, bodies, root): (&[usize], &[f64], &DMatrix<f64>),
) -> JointSolution {
    let n = own.len();
    let scale = DVector::from_iterator(n, own.iter().map(|&k| columns.columns[k].std));
    let mean = DVector::from_iterator(n, own.iter().map(|&k| columns.columns[k].mean));
    let known = DVector::from_iterator(places.len(), places.iter().map(|&at| bodies[at]));
    // The errors of the bodies, which all blocks share.
    let errors = DMatrix::from_fn(places.len(), root.ncols(), |r, c| root[(places[r], c)]);
    let mut normal = [DMatrix::zeros(n, n), DMatrix::zeros(n, places.len())];
    let (mut of, mut numbers) = (Vec::new(), Vec::new());
    for one in blocks {
        let (dense, p) = (&one.rows, n + places.len());
        let others = dense.view((0, n), (n, p - n)).into_owned();
        let right = dense.view((0, p), (n, 1)).column(0) - &others * &known;
        let rows = DMatrix::from_fn(n, n, |r, c| dense[(r, c)] / scale[c]);
        let right = right + &rows * &mean;
        normal[0] += rows.tr_mul(&rows);
        normal[1] += rows.tr_mul(&others);
        of.push(one.block);
        for r in 0..n {
            numbers.extend((r..n).map(|c| rows[(r, c)] as f32));
            numbers.push(right[r] as f32);
        }
        numbers.push(one.unexplained as f32);
    }
    let [squares, by_bodies] = normal;
    JointSolution {
        columns: own.to_vec(),
        blocks: of,
        numbers,
        normal: [squares, by_bodies * errors],
    }
}

impl JointSolution {
    /// Values of a model with these of its own columns, the others being none, block by block: of those blocks that tell them about as well as most.
    pub fn values(&self, columns: &[usize]) -> ModelValues {
        let told = self.blocks.iter().enumerate().filter_map(|(at, block)| {
            let (values, std) = self.values_in(at, columns)?;
            Some((*block as usize, values, std))
        });
        let mut blocks: Vec<_> = told.collect();
        let most: Vec<f64> = (0..columns.len())
            .map(|n| {
                let median = robust::median(blocks.iter().map(|(_, _, std)| std[n]));
                MOST_STD * median.unwrap_or(f64::INFINITY)
            })
            .collect();
        blocks.retain(|(_, _, std)| std.iter().zip(&most).all(|(std, most)| std <= most));
        ModelValues {
            std_of_bodies: self.std_of_bodies(columns),
            columns: columns.to_vec(),
            blocks,
        }
    }

    fn std_of_bodies(&self, columns: &[usize]) -> Vec<f64> {
        let [squares, by_bodies] = &self.normal;
        let own = squares.select_rows(columns).select_columns(columns);
        let moved = own
            .cholesky()
            .map(|own| own.solve(&by_bodies.select_rows(columns)));
        let of = |n: usize| moved.as_ref().map_or(0.0, |moved| moved.row(n).norm());
        (0..columns.len()).map(of).collect()
    }
}

impl JointSolution {
    /// Least squares of a model of these columns in one of the blocks: values and standard deviations; `None` where a column is not told.
    fn values_in(&self, at: usize, columns: &[usize]) -> Option<(Vec<f64>, Vec<f64>)> {
        let factor = self.factor(at, columns, None);
        let p = columns.len();
        let triangle = factor.dense().view((0, 0), (p, p)).into_owned();
        let inverse = triangle.solve_upper_triangular(&DMatrix::identity(p, p))?;
        let mut values = vec![0.0; p];
        factor.solve_before(p, &mut values);
        Some((values, inverse.row_iter().map(|row| row.norm()).collect()))
    }

    /// What a model of these columns leaves of all blocks, one more column being at a value: in units of the noise, squared.
    pub fn residual(&self, columns: &[usize], with: Option<(usize, f64)>) -> f64 {
        let of = |at: usize| self.factor(at, columns, with).row(columns.len())[0].powi(2);
        (0..self.blocks.len()).map(of).sum()
    }

    /// The factor of these columns in one of the blocks; its ρ has what no value of the kept columns explains.
    fn factor(&self, at: usize, columns: &[usize], with: Option<(usize, f64)>) -> HeapFactor {
        let (n, width) = (self.columns.len(), columns.len() + 1);
        let mut numbers = self.numbers[at * numbers_of(n)..]
            .iter()
            .map(|x| f64::from(*x));
        let mut rows = vec![0.0; (n + 1) * width];
        for (r, row) in rows.chunks_exact_mut(width).enumerate() {
            for (c, x) in (r..n).zip(&mut numbers) {
                if let Some(place) = columns.iter().position(|own| *own == c) {
                    row[place] = x;
                }
                if let Some((_, value)) = with.filter(|(n, _)| *n == c) {
                    row[width - 1] -= x * value;
                }
            }
            row[width - 1] += numbers.next().unwrap_or(0.0);
        }
        let mut factor = HeapFactor::new(columns.len());
        factor.fold(&mut rows);
        factor
    }
}
