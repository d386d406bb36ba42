//! Nonlinear parameters of effects on a walk: on what a fit leaves, beside what friction, a rotor and a constant torque of the joint explain, as
//! [`crate::estimate::shapes`] of a limb. At the best of them the derivative of the torque in it is one more column, which tells its standard deviation.

use nalgebra::{Matrix4, SMatrix, SVector, Vector4};
use proprio_core::effect::{EffectKind, Grid, Input, MAX_COLUMNS, Shapes, Term};

use super::columns::EffectSite;
use super::data::{Data, LeftOfWindow};
use super::error::FreeBaseError;
use super::fit::Fit;
use super::projection::{Projection, bristles};
use super::structure::ModelStructure;
use super::walk::Walk;
use super::walks::Walks;
use crate::equation::values::NO_SHAPES;
use crate::estimate::grid::{MotionRange, least_displacement, pairs, possible, values};
use crate::model::Model;
use crate::parallel::side_by_side;

/// Windows that a scan looks at, spread over the logs.
const MOST_WINDOWS: usize = 1500;
/// A shape is not another one that explains no more than this share of what is left of its joint: half of what the slowest effect has to
/// ([`crate::select::criteria::LEAST_GAIN_OF_SLOW`]).
const LEAST_FALL: f64 = 0.0025;
/// Shapes tried between the best and its neighbours, as shares of the way to these.
const BETWEEN: [f64; 4] = [-2.0 / 3.0, -1.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0];
/// A shape that differs by less than this share is the same.
const SAME: f64 = 1e-3;

/// A log's windows are summed in so many pieces, however many processors there are: so sums are the same on all.
const PIECES: usize = 16;

/// Less of a column's square than this share is rounding.
const SPANNED: f64 = 1e-8;

/// What friction, a rotor and a constant torque explain anyhow.
const BASIS: [EffectKind; 4] = EffectKind::PLAIN;

/// The data's effects, those with a nonlinear parameter at the one that explains most of what a fit leaves; `None` if they are so already.
pub(crate) fn better(walks: &Walks, data: &Data, fit: &Fit) -> Option<Vec<EffectSite>> {
    let left = data.left(walks, fit.theta());
    let sites = &data.columns().sites;
    let scan = Scan {
        walks,
        data,
        fit,
        stride: (left.iter().map(Vec::len).sum::<usize>() / MOST_WINDOWS).max(1),
        left,
    };
    let shaped = (0..sites.len()).filter(|n| sites[*n].place.0.description().has_shape());
    let grids: Vec<(usize, Vec<Vec<f64>>)> = shaped.map(|n| (n, scan.grids(&sites[n]))).collect();
    let all = grids.iter().map(|(n, grids)| (*n, pairs(grids)));
    let all: Vec<(usize, Vec<Shapes>)> = all.collect();
    let coarse = scan.explained(&all);
    let fine: Vec<(usize, Vec<Shapes>)> = (all.iter().zip(&grids).zip(&coarse))
        .map(|(((n, all), (_, grids)), falls)| (*n, between((all, grids), falls, &sites[*n])))
        .collect();
    let finer = scan.explained(&fine);
    let (mut better, mut moved) = (sites.clone(), false);
    for (((n, grid), falls), ((_, near), finer)) in
        all.iter().zip(&coarse).zip(fine.iter().zip(&finer))
    {
        let all = grid.iter().zip(falls).chain(near.iter().zip(finer));
        let Some((best, fall)) = all.max_by(|a, b| a.1.total_cmp(b.1)) else {
            continue;
        };
        let mut both = best.iter().zip(sites[*n].shapes);
        let is_other = both.any(|(best, now)| (best - now).abs() > SAME * now.abs());
        if is_other && *fall >= LEAST_FALL {
            better[*n] = sites[*n].clone().with_shapes(*best);
            moved = true;
        }
    }
    moved.then_some(better)
}

/// Rounds of a search at most: the fit that one leaves is another one.
const ROUNDS: usize = 3;

/// The data and the structure with nonlinear parameters that leave least, and a column of each of their derivatives.
///
/// # Errors
/// [`FreeBaseError`] where numbers overflow.
pub(crate) fn settled(
    (walks, model): (&Walks, &Model),
    mut data: Data,
    mut structure: ModelStructure,
) -> Result<(Data, ModelStructure), FreeBaseError> {
    let fit = |data: &Data, structure: &ModelStructure| {
        data.fit(structure).ok_or(FreeBaseError::Unsolvable)
    };
    if !is_shaped(&structure) {
        return Ok((data, structure));
    }
    for _ in 0..ROUNDS {
        let Some(sites) = better(walks, &data, &fit(&data, &structure)?) else {
            break;
        };
        structure = structure.with_shapes(&sites);
        data = data.with_sites(walks, sites)?;
    }
    let last = fit(&data, &structure)?;
    with_derivatives((walks, model), &data, structure, &last)
}

/// Whether any effect of a structure has a nonlinear parameter.
pub(crate) fn is_shaped(structure: &ModelStructure) -> bool {
    let mut effects = structure.effects.iter();
    effects.any(|site| site.place.0.description().searched().is_some())
}

/// The same with a column of the derivative of each effect's torque in each nonlinear parameter, at a fit: its standard deviation comes from the same
/// equations as all others.
///
/// # Errors
/// [`FreeBaseError`] where numbers overflow.
pub(crate) fn with_derivatives(
    (walks, model): (&Walks, &Model),
    data: &Data,
    mut structure: ModelStructure,
    fit: &Fit,
) -> Result<(Data, ModelStructure), FreeBaseError> {
    let columns = data.columns();
    let mut sites = columns.sites.clone();
    for (n, site) in sites.iter_mut().enumerate() {
        let own = columns.effects().filter(|(_, own, _)| *own == n);
        let own: Vec<f64> = own.map(|(k, ..)| fit.theta()[k]).collect();
        if structure.has(site.place) && own.iter().any(|value| *value != 0.0) {
            site.add_derivatives((model, &walks.robot), &own);
        }
    }
    for own in &mut structure.effects {
        let site = sites.iter().find(|site| site.place == own.place);
        // What was a candidate is known by the structure as it knows its own.
        let derivative = site
            .into_iter()
            .flat_map(|site| site.linear.iter().skip(own.linear.len()));
        let derivative: Vec<_> = derivative.copied().collect();
        own.linear.extend(derivative);
    }
    Ok((data.with_sites(walks, sites)?, structure))
}

/// Shapes about the best of all that were tried, each between its neighbours in its grid, and the present ones.
fn between(
    (all, grids): (&[Shapes], &[Vec<f64>]),
    falls: &[f64],
    site: &EffectSite,
) -> Vec<Shapes> {
    let best = (0..all.len()).max_by(|&a, &b| falls[a].total_cmp(&falls[b]));
    let best = best.map_or(site.shapes, |best| all[best]);
    let mut near = Vec::new();
    for (at, (n, _)) in site.place.0.description().all_searched().enumerate() {
        let grid = &grids[at];
        let own = grid.iter().rposition(|value| *value == best[at]);
        for share in BETWEEN {
            let other = own.and_then(|own| match share < 0.0 {
                true => own.checked_sub(1),
                false => Some(own + 1),
            });
            if let Some(other) = other.and_then(|other| grid.get(other)) {
                let mut shapes = best;
                let between = best[at] + share.abs() * (other - best[at]);
                shapes[at] = possible((site.place.0, n), between);
                near.push(shapes);
            }
        }
    }
    near.push(site.shapes);
    near
}

/// What a joint does in walks; no displacement of its friction is below the `least`, rad.
pub(crate) fn range(walks: &Walks, joint: usize, least: f64) -> MotionRange {
    let logs = || walks.walks.iter().map(|(walk, _)| walk);
    let most = |of: &dyn Fn(&Walk) -> f64| logs().map(of).fold(0.0, f64::max);
    let q = || logs().flat_map(|walk| walk.q.of(joint));
    let acceleration = |walk: &Walk| {
        let own: Vec<f64> = walk.dq.of(joint).collect();
        let steps = own.windows(2).map(|dq| (dq[1] - dq[0]).powi(2));
        let square = steps.sum::<f64>() / walk.len().max(1) as f64;
        square.sqrt() / walk.period.max(f64::MIN_POSITIVE)
    };
    let period = most(&|walk| walk.period);
    MotionRange {
        gear: walks.robot.gears[joint],
        positions: [q().fold(f64::MAX, f64::min), q().fold(f64::MIN, f64::max)],
        times: [0.0, most(&|walk| walk.seconds(walk.len().max(1) - 1))],
        least_displacement: least_displacement(most(&acceleration), period).max(least),
        fastest: most(&|walk| walk.dq.of(joint).map(f64::abs).fold(0.0, f64::max)),
        speed_noise: most(&|walk| walk.rest.speed_noise[joint]),
    }
}

struct Scan<'a> {
    walks: &'a Walks,
    data: &'a Data,
    fit: &'a Fit,
    left: Vec<Vec<LeftOfWindow>>,
    /// One of so many windows is looked at.
    stride: usize,
}

impl Scan<'_> {
    /// The values to try of each shape of an effect.
    fn grids(&self, site: &EffectSite) -> Vec<Vec<f64>> {
        let (effect, joint) = site.place;
        let of = |(n, grid): (usize, Grid)| {
            let lower = effect.description().parameters[n].lower;
            let all = values(grid, &range(self.walks, joint, lower))
                .into_iter()
                .flatten();
            all.map(|shape| possible((effect, n), shape)).collect()
        };
        effect.description().all_searched().map(of).collect()
    }

    /// Of each effect and each of its shapes the share of what is left of its joint that it explains.
    fn explained(&self, tried: &[(usize, Vec<Shapes>)]) -> Vec<Vec<f64>> {
        let mut sums: Vec<Vec<Sums>> = (tried.iter())
            .map(|(_, grid)| vec![Sums::default(); grid.len()])
            .collect();
        for log in 0..self.left.len() {
            let of_pieces = self.of_log(log, tried);
            let all = sums.iter_mut().flatten();
            let pieces = of_pieces.iter().map(|piece| piece.iter().flatten());
            let mut pieces: Vec<_> = pieces.collect();
            for sum in all {
                let own = pieces.iter_mut().filter_map(Iterator::next);
                own.for_each(|own| sum.merge(own));
            }
        }
        let sites = &self.data.columns().sites;
        let falls = sums.iter().zip(tried).map(|(sums, (n, _))| {
            let count = sites[*n].linear.len();
            sums.iter().map(|own| own.share(count)).collect()
        });
        falls.collect()
    }

    /// The sums over a log's windows, in pieces.
    fn of_log(&self, log: usize, tried: &[(usize, Vec<Shapes>)]) -> Vec<Vec<Vec<Sums>>> {
        let sites = &self.data.columns().sites;
        let walk = &self.data.corrected(&self.walks.walks[log].0);
        let impulses = side_by_side(tried, |(n, grid)| {
            let (effect, joint) = sites[*n].place;
            match effect.description().input {
                Input::Bristles => {
                    let displacements: Vec<f64> = grid.iter().map(|shapes| shapes[0]).collect();
                    bristles(walk, joint, &displacements)
                }
                _ => Vec::new(),
            }
        });
        let fitted = |n: usize| {
            let mut effects = self.data.columns().effects();
            effects.any(|(k, own, _)| own == n && self.fit.theta()[k] != 0.0)
        };
        let states = self.data.joint_states(self.walks, log, walk, fitted);
        let windows = self.data.windows_of(log);
        let of_start = |left: &LeftOfWindow| {
            let at = windows.binary_search_by_key(&left.start_us, |window| window.start_us);
            at.ok().map(|at| &windows[at])
        };
        let left = self.left[log].iter().step_by(self.stride);
        let wanted: Vec<_> = left
            .filter_map(|left| Some((left, of_start(left)?)))
            .collect();
        let length = wanted.len().div_ceil(PIECES).max(1);
        let pieces: Vec<_> = wanted.chunks(length).collect();
        side_by_side(&pieces, |piece| {
            let mut sums: Vec<Vec<Sums>> = (tried.iter())
                .map(|(_, grid)| vec![Sums::default(); grid.len()])
                .collect();
            for (left, window) in *piece {
                let projection = self.data.projection(self.walks, log, &states, window);
                self.add_window(&mut sums, tried, &impulses, (left, &projection));
            }
            sums
        })
    }

    /// Adds a window's products to the sums of each effect and shape; `impulses` are those of bristles.
    fn add_window(
        &self,
        sums: &mut [Vec<Sums>],
        tried: &[(usize, Vec<Shapes>)],
        impulses: &[Vec<Vec<f64>>],
        (left, projection): (&LeftOfWindow, &Projection<'_>),
    ) {
        let sites = &self.data.columns().sites;
        let zeros = || vec![0.0; left.left.len()];
        let mut basis: Vec<Option<[Vec<f64>; 4]>> = vec![None; self.walks.robot.joints()];
        let mut columns: [_; MAX_COLUMNS] = std::array::from_fn(|_| zeros());
        for (t, (n, grid)) in tried.iter().enumerate() {
            let (effect, joint) = sites[*n].place;
            let basis = basis[joint].get_or_insert_with(|| {
                BASIS.map(|effect| {
                    let mut column = zeros();
                    let terms = projection.terms((effect, joint), NO_SHAPES);
                    projection.add(joint, |k| terms[k][0], &mut column);
                    column
                })
            });
            let residual = self.residual(left, projection, *n);
            let count = sites[*n].linear.len();
            for (s, shapes) in grid.iter().enumerate() {
                let terms: Vec<[Term<f64>; MAX_COLUMNS]> = match impulses[t].get(s) {
                    Some(impulse) => {
                        let of = |n: &usize| Term {
                            boundary: impulse[*n],
                            rate: 0.0,
                        };
                        let samples = projection.samples().iter();
                        samples.map(|n| [of(n); MAX_COLUMNS]).collect()
                    }
                    None => projection.terms((effect, joint), *shapes),
                };
                for (m, column) in columns.iter_mut().enumerate().take(count) {
                    column.fill(0.0);
                    projection.add(joint, |k| terms[k][m], column);
                }
                sums[t][s].add(basis, &columns, &residual);
            }
        }
    }

    /// What the fit leaves, and what effect n explains with its present shape if the fit has it: that is for another shape to explain.
    fn residual(&self, left: &LeftOfWindow, projection: &Projection<'_>, n: usize) -> Vec<f64> {
        let mut residual = left.left.clone();
        for (k, own, linear) in self.data.columns().effects() {
            let value = self.fit.theta()[k];
            if own == n && value != 0.0 {
                let column = projection.column(n, &linear.column);
                let terms = residual.iter_mut().zip(column);
                terms.for_each(|(residual, x)| *residual += value * x);
            }
        }
        residual
    }
}

/// Products of the basis, an effect's columns and the residual.
#[derive(Clone)]
struct Sums {
    basis: Matrix4<f64>,
    mixed: SMatrix<f64, 4, MAX_COLUMNS>,
    own: SMatrix<f64, MAX_COLUMNS, MAX_COLUMNS>,
    basis_right: Vector4<f64>,
    own_right: SVector<f64, MAX_COLUMNS>,
    right: f64,
}

impl Default for Sums {
    fn default() -> Self {
        Self {
            basis: Matrix4::zeros(),
            mixed: SMatrix::zeros(),
            own: SMatrix::zeros(),
            basis_right: Vector4::zeros(),
            own_right: SVector::zeros(),
            right: 0.0,
        }
    }
}

impl Sums {
    fn add(&mut self, basis: &[Vec<f64>; 4], own: &[Vec<f64>; MAX_COLUMNS], right: &[f64]) {
        for c in (0..right.len()).filter(|c| right[*c].is_finite()) {
            let b = Vector4::from_fn(|n, _| basis[n][c]);
            let x = SVector::<f64, MAX_COLUMNS>::from_fn(|n, _| own[n][c]);
            self.basis += b * b.transpose();
            self.mixed += b * x.transpose();
            self.own += x * x.transpose();
            self.basis_right += b * right[c];
            self.own_right += x * right[c];
            self.right += right[c] * right[c];
        }
    }

    fn merge(&mut self, other: &Self) {
        self.basis += other.basis;
        self.mixed += other.mixed;
        self.own += other.own;
        self.basis_right += other.basis_right;
        self.own_right += other.own_right;
        self.right += other.right;
    }

    /// The share of the residual's square that the first `count` columns explain beyond the basis.
    fn share(&self, count: usize) -> f64 {
        let Some(root) = self.basis.cholesky() else {
            return 0.0;
        };
        let own = self.own - self.mixed.tr_mul(&root.solve(&self.mixed));
        let right = self.own_right - self.mixed.tr_mul(&root.solve(&self.basis_right));
        // Of what the basis explains as well as rounding lets it nothing is left.
        let is_new = |n: usize| own[(n, n)] > SPANNED * self.own[(n, n)];
        if !(0..count).all(is_new) {
            return 0.0;
        }
        let own = own.view((0, 0), (count, count)).into_owned();
        let right = right.rows(0, count).into_owned();
        let solved = own.cholesky().map(|root| root.solve(&right));
        solved.map_or(0.0, |x| x.dot(&right)) / self.right.max(f64::MIN_POSITIVE)
    }
}
