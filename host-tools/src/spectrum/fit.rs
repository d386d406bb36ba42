//! A fit of the flexible joint model: the logarithms of measured and modelled responses, weighted by their scatter, over all points.
//!
//! The error of an element is ln(G/Ĝ), complex: the same at an antiresonance as at a resonance, where a difference G − Ĝ would see the
//! resonance alone (Wernholt & Moberg 2011). Its variance is that of G over |G|², plus a share that the model lacks: the same at all lines,
//! as large as the residuals show (median), so that lines without noise do not rule.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};
use proprio_solve::bounded::inverse;
use realfft::num_complex::Complex64;

use super::flexible::{At, Derived, Plant};
use super::layout::{Layout, Unknown};
use super::linear::{
    by_owner, damped, fold, jackknife, larger, moved_by_priors, prior_factor, prior_rows, stacked,
    without_each,
};
use super::response::{Point, Response};
use crate::estimate::factor::{BATCH, HeapFactor};
use crate::parallel::by_number;
use crate::robust::{median, scale};

/// Elements whose relative variance is greater are left out: the logarithm of what is mostly noise is biased.
pub(super) const LEAST_KNOWN: f64 = 0.25;
/// No response is better known than this share: rounding of encoders and of the model's aliases.
const LEAST_ERROR: f64 = 1e-3;
/// The error share before residuals have shown one.
pub(super) const FIRST_ERROR: f64 = 0.05;
/// Parts of the lines that are left out in turn.
const TENTHS: usize = 10;
/// A fit stands when a step promises or gains less than this of its weighted squares: such a step moves no entry by more than a hundredth of its standard
/// deviation.
const SETTLED: f64 = 1e-4;

/// What is fitted.
pub(super) struct Problem<'a> {
    pub(super) points: Vec<&'a Point>,
    /// One for each point.
    pub(super) plants: Vec<Plant>,
    /// Of each point and line, by how much the mean of the responses along its path differs from the response of its plant; empty: by nothing.
    pub(super) along: Vec<Response>,
    /// Angular frequencies of the lines, rad/s.
    pub(super) omega: Vec<f64>,
    /// How many of them are used, from the lowest.
    pub(super) used: usize,
    /// Sampling period, s.
    pub(super) dt: f64,
}

/// A fit.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) layout: Layout,
    /// The entries of the layout's unknowns.
    pub(super) x: Vec<f64>,
    /// Covariance of the entries.
    pub(super) covariance: DMatrix<f64>,
    /// What the model lacks, as a share of a response.
    pub(super) lacking: f64,
    /// Mean square of the residuals in units of the measured scatter alone.
    pub(super) chi_squared: f64,
    /// Held-out error of each element that is used, by what was left out at once.
    pub(super) held_out: Vec<Vec<HeldOut>>,
}

/// An element's error by a fit that has not used it.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeldOut {
    /// Of the log magnitude.
    pub(super) magnitude: f64,
    /// Of magnitude and phase, squared, in units of the scatter.
    pub(super) square: f64,
}

/// A fit on its way.
pub(super) struct State {
    pub(super) x: Vec<f64>,
    pub(super) cost: f64,
}

impl Problem<'_> {
    /// The model's response and derivatives at all lines of a point.
    pub(super) fn model(&self, point: usize, layout: &Layout, x: &[f64]) -> Option<Vec<Derived>> {
        let at = At::new(&self.plants[point], layout, x);
        let of = |line: usize| {
            let mut own = at.derived(self.omega[line], self.dt)?;
            self.add_along(point, line, &mut own.response);
            Some(own)
        };
        (0..self.used).map(of).collect()
    }

    /// The model's response at a line of a point.
    pub(super) fn response(
        &self,
        point: usize,
        at: &At<'_>,
        line: usize,
    ) -> Option<DMatrix<Complex64>> {
        let mut own = at.response(self.omega[line], self.dt)?;
        self.add_along(point, line, &mut own);
        Some(own)
    }

    fn add_along(&self, point: usize, line: usize, response: &mut DMatrix<Complex64>) {
        if let Some(along) = self.along.get(point) {
            *response += &along[line];
        }
    }

    /// What [`along`](Self::along) is at x.
    pub(super) fn mean_along(
        &self,
        layout: &Layout,
        x: &[f64],
        along: &[Vec<[DMatrix<f64>; 2]>],
    ) -> Option<Vec<Response>> {
        let of_point = |point: usize| {
            let middle = At::new(&self.plants[point], layout, x);
            let all = middle.along(&along[point]);
            let lines = self.omega.iter();
            let of_line = |&omega: &f64| middle.mean_along(&all, omega, self.dt);
            lines.map(of_line).collect::<Option<Response>>()
        };
        by_number(0..self.points.len(), of_point)
            .into_iter()
            .collect()
    }

    /// The model's response at all lines of a point.
    fn responses(&self, point: usize, layout: &Layout, x: &[f64]) -> Option<Response> {
        let at = At::new(&self.plants[point], layout, x);
        (0..self.used)
            .map(|line| self.response(point, &at, line))
            .collect()
    }

    /// Weighted rows of a point's mean, or of one of its blocks, at some lines, as a factor over a layout's unknowns.
    pub(super) fn factor(
        &self,
        (point, block): (usize, Option<usize>),
        lines: impl Iterator<Item = usize>,
        layout: &Layout,
        model: &[Derived],
        lacking: f64,
    ) -> HeapFactor {
        let own = self.points[point];
        let is_few = !own.torque.is_empty();
        let averaged = block.filter(|_| !is_few);
        let response = averaged.map_or(&own.mean, |b| &own.blocks[b]);
        // A block weighs as much as its share of a mean.
        let share = averaged.map_or(1.0, |_| own.blocks.len() as f64).sqrt();
        let columns = own.columns(block);
        let unknowns = model.first().map_or(0, Derived::unknowns);
        let mut factor = HeapFactor::new(unknowns);
        let mut rows = Vec::new();
        for line in lines {
            let modelled = own.predicted(line, &model[line].response);
            let elements = (0..own.q.len()).flat_map(|i| columns.clone().map(move |j| (i, j)));
            for (i, j) in elements.filter(|(i, j)| is_few || i <= j) {
                // Responses are symmetric in the model, so that two of them ask the same of the unknowns: their weighted mean says all of it.
                let twins = if is_few || i == j { 1 } else { 2 };
                let elements = [(i, j), (j, i)].into_iter().take(twins);
                let (mut information, mut sum) = (0.0, Complex64::default());
                for element in elements {
                    let measured = &response[line];
                    if let Some((error, std)) = residual(own, line, measured, &modelled, element) {
                        let weight = weight(std, lacking) / share;
                        information += weight * weight;
                        sum += error * (weight * weight);
                    }
                }
                if information == 0.0 {
                    continue;
                }
                let weight = information.sqrt();
                let by = weight / modelled[(i, j)];
                let slopes = match own.torque.get(line) {
                    Some(torque) => Cow::Owned(model[line].slopes_of_output(i, torque.column(j))),
                    None => Cow::Borrowed(model[line].slopes(i, j)),
                };
                let row = slopes.iter().map(|slope| slope * by);
                let row = row.chain([sum / weight]);
                rows.extend(row.clone().map(|x| x.re));
                rows.extend(row.map(|x| x.im));
            }
            if rows.len() >= BATCH * (unknowns + 1) {
                fold(&mut factor, &mut rows);
                rows.clear();
            }
        }
        fold(&mut factor, &mut rows);
        self.plants[point].over_bodies(layout, factor)
    }

    /// Factors of all points' means.
    fn factors(&self, layout: &Layout, x: &[f64], lacking: f64) -> Option<Vec<HeapFactor>> {
        let of_point = |point: usize| {
            let model = self.model(point, layout, x)?;
            Some(self.factor((point, None), 0..self.used, layout, &model, lacking))
        };
        by_number(0..self.points.len(), of_point)
            .into_iter()
            .collect()
    }

    /// The model's responses and derivatives at all points.
    fn models(&self, layout: &Layout, x: &[f64]) -> Option<Vec<Vec<Derived>>> {
        by_number(0..self.points.len(), |point| self.model(point, layout, x))
            .into_iter()
            .collect()
    }

    /// The factors of what is left out in turn, each with its point: blocks of points, or where there is one alone stretches of lines.
    fn leave_out(
        &self,
        layout: &Layout,
        models: &[Vec<Derived>],
        lacking: f64,
    ) -> Vec<(usize, HeapFactor)> {
        let blocks: usize = self.points.iter().map(|p| p.blocks.len()).sum();
        let of_point = |point: usize| -> Vec<(usize, HeapFactor)> {
            let factor = |block, lines| {
                let own = self.factor((point, block), lines, layout, &models[point], lacking);
                (point, own)
            };
            if blocks > 2 {
                let blocks = 0..self.points[point].blocks.len();
                blocks.map(|b| factor(Some(b), 0..self.used)).collect()
            } else {
                (0..TENTHS).map(|k| factor(None, self.tenth(k))).collect()
            }
        };
        by_number(0..self.points.len(), of_point).concat()
    }

    /// The lines of a tenth.
    fn tenth(&self, k: usize) -> std::ops::Range<usize> {
        k * self.used / TENTHS..(k + 1) * self.used / TENTHS
    }

    /// Factors of a tenth of the lines each, at all points together.
    fn tenths(&self, layout: &Layout, models: &[Vec<Derived>], lacking: f64) -> Vec<HeapFactor> {
        let of_point = |p: usize| {
            let model = &models[p];
            let tenth = |k: usize| self.factor((p, None), self.tenth(k), layout, model, lacking);
            (0..TENTHS).map(tenth).collect::<Vec<_>>()
        };
        let all = by_number(0..self.points.len(), of_point);
        let tenth = |k: usize| stacked(all.iter().map(|parts| &parts[k]));
        (0..TENTHS).map(tenth).collect()
    }

    /// Weighted squares at x.
    fn cost(&self, layout: &Layout, x: &[f64], lacking: f64) -> f64 {
        let of_point = |point: usize| {
            let Some(model) = self.responses(point, layout, x) else {
                return f64::INFINITY;
            };
            let all = residuals(self.points[point], &model);
            let square =
                |(error, std): (Complex64, f64)| error.norm_sqr() * weight(std, lacking).powi(2);
            all.map(square).sum::<f64>()
        };
        // In the order of the points, so that the sum is the same every time.
        let costs = by_number(0..self.points.len(), of_point);
        costs.iter().sum::<f64>() + prior_rows(layout, x).column(x.len()).norm_squared()
    }

    /// Levenberg–Marquardt steps from x.
    pub(super) fn descend(&self, layout: &Layout, x: &[f64], lacking: f64, steps: usize) -> State {
        let mut state = State {
            x: x.to_vec(),
            cost: self.cost(layout, x, lacking),
        };
        let mut damping = 1e-3;
        for _ in 0..steps {
            let Some(factors) = self.factors(layout, &state.x, lacking) else {
                break;
            };
            let prior = prior_factor(layout, &state.x);
            let factor = stacked([&prior].into_iter().chain(&factors));
            let promised: f64 = (0..x.len())
                .filter_map(|k| factor.row(k).last())
                .map(|z| z * z)
                .sum();
            if promised.is_nan() || promised < SETTLED {
                break;
            }
            let before = state.cost;
            // Ten times the damping up to ten times: then no direction falls.
            for _ in 0..10 {
                let step = damped(&factor, damping);
                let next: Vec<f64> = state
                    .x
                    .iter()
                    .zip(step.iter())
                    .map(|(x, s)| x + s)
                    .collect();
                let cost = self.cost(layout, &next, lacking);
                if cost < state.cost {
                    state = State { x: next, cost };
                    damping = (damping / 10.0).max(1e-9);
                    break;
                }
                damping *= 10.0;
            }
            let gained = before - state.cost;
            if gained.is_nan() || gained < SETTLED {
                break;
            }
        }
        state
    }

    /// Fits, beginning at each of these and going on from the best.
    pub(super) fn fit(&self, layout: &Layout, starts: &[Vec<f64>]) -> Option<Fit> {
        let (state, lacking) = self.settle(layout, starts, None)?;
        self.judged(layout, state, lacking)
    }

    /// Held-out error of a fit that begins at each of these; not a number where there is none.
    pub(super) fn error(&self, layout: &Layout, starts: &[Vec<f64>]) -> f64 {
        let settled = self.settle(layout, starts, None);
        let unused = settled.and_then(|(state, lacking)| self.unused(layout, &state.x, lacking));
        unused.map_or(f64::NAN, |unused| magnitude(&unused))
    }

    /// Where a fit ends that begins at each of these and goes on from the best, and what the model lacks there; steps are bounded. It begins with what
    /// another fit of nearly the same found that it lacks, or where that is not known with [`FIRST_ERROR`].
    pub(super) fn settle(
        &self,
        layout: &Layout,
        starts: &[Vec<f64>],
        lacking: Option<f64>,
    ) -> Option<(State, f64)> {
        /// Steps from each start, and of the best one.
        const FIRST_STEPS: usize = 6;
        const LAST_STEPS: usize = 25;
        let first = lacking.unwrap_or(FIRST_ERROR);
        // Bodies are most of the unknowns and nearly right: they are held until the springs are.
        let springs = |x: &Vec<f64>, steps: usize| {
            let (own, kept) = layout.holding(x, Unknown::is_body);
            let mut state = self.descend(&own, &kept, first, steps);
            state.x = layout.released(x, &state.x, Unknown::is_body);
            state
        };
        let start = match starts {
            [only] => only.clone(),
            _ => {
                let all = starts.iter().map(|x| springs(x, FIRST_STEPS));
                all.min_by(|a, b| a.cost.total_cmp(&b.cost))?.x
            }
        };
        let (mut x, mut now) = (springs(&start, LAST_STEPS).x, first);
        let rounds = if lacking.is_some() { 1 } else { 2 };
        for _ in 0..rounds {
            x = self.descend(layout, &x, now, LAST_STEPS).x;
            now = self.lacking(layout, &x)?;
        }
        let state = self.descend(layout, &x, now, LAST_STEPS);
        state.cost.is_finite().then_some((state, now))
    }

    /// Adds to a fit's covariance a share of how far these data, measured or modelled with something else assumed, would move it: one step.
    pub(super) fn doubted(&self, fit: &mut Fit, share: f64) {
        let Some(factors) = self.factors(&fit.layout, &fit.x, fit.lacking) else {
            return;
        };
        let prior = prior_factor(&fit.layout, &fit.x);
        let step = damped(&stacked([&prior].into_iter().chain(&factors)), 0.0) * share;
        fit.covariance += &step * step.transpose();
    }

    /// All residuals of the means, with their standard deviations by scatter.
    fn all_residuals(&self, layout: &Layout, x: &[f64]) -> Option<Vec<(Complex64, f64)>> {
        let mut all = Vec::new();
        for point in 0..self.points.len() {
            let responses = self.responses(point, layout, x)?;
            all.extend(residuals(self.points[point], &responses));
        }
        Some(all)
    }

    /// What residuals show beyond the scatter.
    fn lacking(&self, layout: &Layout, x: &[f64]) -> Option<f64> {
        let all = self.all_residuals(layout, x)?;
        let components = all.iter().flat_map(|(e, _)| [e.re, e.im]);
        let shown = scale(components).unwrap_or_default();
        let scatter = median(all.iter().map(|(_, std)| *std)).unwrap_or_default();
        Some((shown * shown - scatter * scatter).max(0.0).sqrt())
    }

    /// Held-out errors of what was reached.
    pub(super) fn unused(
        &self,
        layout: &Layout,
        x: &[f64],
        lacking: f64,
    ) -> Option<Vec<Vec<HeldOut>>> {
        let models = self.models(layout, x)?;
        let groups = self.leave_out(layout, &models, lacking);
        let prior = prior_factor(layout, x);
        let without_points = without_each(&by_owner(&groups), &prior);
        self.held_out(layout, (x, &models), &without_points, &prior)
    }

    /// Covariance and held-out errors of what was reached.
    pub(super) fn judged(&self, layout: &Layout, state: State, lacking: f64) -> Option<Fit> {
        let n = layout.unknowns.len();
        let models = self.models(layout, &state.x)?;
        let groups = self.leave_out(layout, &models, lacking);
        let prior = prior_factor(layout, &state.x);
        let points = by_owner(&groups);
        let whole = stacked([&prior].into_iter().chain(&points)).dense();
        let r_inverse = inverse(&whole.view((0, 0), (n, n)).into_owned());
        let posterior = &r_inverse * r_inverse.transpose();
        let factors: Vec<HeapFactor> = groups.into_iter().map(|(_, factor)| factor).collect();
        // What the model lacks at a point is the same in all its blocks, and what it lacks about a frequency at all points.
        let mut spread = jackknife(&without_each(&factors, &prior));
        let without_points = without_each(&points, &prior);
        if self.points.len() > 2 {
            spread = larger(spread, &jackknife(&without_points));
        }
        let tenths = self.tenths(layout, &models, lacking);
        spread = larger(spread, &jackknife(&without_each(&tenths, &prior)));
        let moved = moved_by_priors(layout, &posterior, &prior_rows(layout, &state.x));
        let covariance = spread + &moved * moved.transpose();
        let held_out = self.held_out(layout, (&state.x, &models), &without_points, &prior)?;
        let all = self.all_residuals(layout, &state.x)?;
        let square = |(e, std): &(Complex64, f64)| e.norm_sqr() / (2.0 * std * std).max(1e-12);
        let chi_squared = all.iter().map(square).sum::<f64>() / all.len().max(1) as f64;
        Some(Fit {
            layout: layout.clone(),
            x: state.x,
            covariance,
            lacking,
            chi_squared,
            held_out,
        })
    }

    /// Standard deviation of a log magnitude by scatter alone, root mean square over what is used.
    pub(super) fn floor(&self) -> f64 {
        let mut squares = Vec::new();
        for own in &self.points {
            for line in 0..self.used {
                for &variance in own.relative[line].iter() {
                    if variance < LEAST_KNOWN {
                        squares.push(0.5 * variance);
                    }
                }
            }
        }
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }
}

/// Residual ln(G/Ĝ) of an element of a point's response, and its standard deviation from scatter of each component; none of what is mostly noise.
pub(super) fn residual(
    own: &Point,
    line: usize,
    measured: &DMatrix<Complex64>,
    model: &DMatrix<Complex64>,
    element: (usize, usize),
) -> Option<(Complex64, f64)> {
    let variance = own.relative[line][element];
    if variance >= LEAST_KNOWN {
        return None;
    }
    let ratio = measured[element] / model[element];
    // Half the logarithm of the square: the magnitude itself takes several times as long.
    let error = Complex64::new(0.5 * ratio.norm_sqr().ln(), ratio.arg());
    error.is_finite().then(|| (error, (0.5 * variance).sqrt()))
}

/// All residuals of a point's mean at the lines of a model.
fn residuals<'a>(
    own: &'a Point,
    model: &'a [DMatrix<Complex64>],
) -> impl Iterator<Item = (Complex64, f64)> + 'a {
    (0..model.len()).flat_map(move |line| {
        let modelled = own.predicted(line, &model[line]);
        let found = |element| residual(own, line, &own.mean[line], &modelled, element);
        elements(own).filter_map(found).collect::<Vec<_>>()
    })
}

/// All elements of a point's mean.
pub(super) fn elements(own: &Point) -> impl Iterator<Item = (usize, usize)> + use<> {
    let columns = own.columns(None);
    (0..own.q.len()).flat_map(move |i| columns.clone().map(move |j| (i, j)))
}

impl Fit {
    /// Root mean square of the held-out log magnitude errors.
    pub(super) fn error(&self) -> f64 {
        magnitude(&self.held_out)
    }

    /// [`log_squares`] of its held-out errors.
    pub(super) fn log_squares(&self) -> Vec<f64> {
        log_squares(&self.held_out)
    }

    /// An unknown's value in SI units, and its standard deviation.
    pub(super) fn estimate(&self, of: Unknown) -> Option<(f64, f64)> {
        let index = self.layout.index(of)?;
        let std = self.covariance[(index, index)].max(0.0).sqrt();
        Some((
            self.layout.value(&self.x, of),
            std * self.layout.scale(&self.x, index),
        ))
    }

    /// A function of the entries and its standard deviation to first order.
    pub(super) fn derived(&self, of: impl Fn(&[f64]) -> f64) -> (f64, f64) {
        const STEP: f64 = 1e-5;
        let slope = DVector::from_fn(self.x.len(), |n, _| {
            let (mut up, mut down) = (self.x.clone(), self.x.clone());
            up[n] += STEP;
            down[n] -= STEP;
            (of(&up) - of(&down)) / (2.0 * STEP)
        });
        let variance = (slope.transpose() * &self.covariance * &slope)[(0, 0)];
        (of(&self.x), variance.max(0.0).sqrt())
    }
}

/// Bands of what was left out at once, which are judged apart: what a model lacks shows about some frequencies at some points, so that its mean over six
/// points is known three times worse than over their bands.
const BANDS: usize = 5;

/// Logarithm of the mean square error in units of the scatter, by bands of what was left out at once: a sharp resonance at one point does not outweigh all
/// others.
pub(super) fn log_squares(of: &[Vec<HeldOut>]) -> Vec<f64> {
    let mean = |errors: &[HeldOut]| {
        let sum: f64 = errors.iter().map(|e| e.square).sum();
        (sum / errors.len().max(1) as f64).max(1e-300).ln()
    };
    let bands = |errors: &'_ Vec<HeldOut>| {
        let size = errors.len().div_ceil(BANDS).max(1);
        errors.chunks(size).map(mean).collect::<Vec<f64>>()
    };
    of.iter().flat_map(bands).collect()
}

/// Root mean square of log magnitudes.
pub(super) fn magnitude(of: &[Vec<HeldOut>]) -> f64 {
    let all = of.iter().flatten();
    rms(&all.map(|e| e.magnitude).collect::<Vec<f64>>())
}

/// One over the standard deviation of a component of an error.
pub(super) fn weight(std: f64, lacking: f64) -> f64 {
    1.0 / (std * std + lacking * lacking + LEAST_ERROR * LEAST_ERROR).sqrt()
}

/// Root mean square.
pub(super) fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt()
}
