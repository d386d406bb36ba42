//! One limb of a model: its bodies and its effects, fitted. Data in, a fit out; nothing else is touched.
//!
//! The fit is Gauss-Newton over the derivatives of the predictor ([`crate::predict`]): rows are made at a model's values, the
//! bounded least-squares problem of the rows is solved ([`super::bounded`]), rows are made again at the solution, until no parameter
//! moves by much against its error. Shapes, in which the torque is far from linear, are scanned on the residual between passes.
//!
//! Rows are weighed as their noise is ([`super::accumulate`]).

use std::sync::{Arc, OnceLock};

use proprio_core::effect::{EffectKind, Enters};
use proprio_core::inertia::INERTIAL;
use proprio_solve::far::{FARTHEST, ROUNDS};
use proprio_solve::group::noises;
use proprio_solve::nested::NOISE_ROUNDS;

use super::accumulate::{Folding, Weights};
use super::between_blocks::Spread;
use super::bounded::{Bounded, Problem, Solution};
use super::deviation::Deviations;
use super::groups::{Group, Groups, stacked};
use super::limb_data::LimbData;
use super::limit::Limit;
use super::method::{self, Method};
use super::parameter_estimate::Constraint;
use super::shapes::{self, Scan, Searched};
use super::whitening::neighbour_correlation;
use crate::equation::column::Columns;
use crate::equation::dot::dot;
use crate::equation::rows::Rows;
use crate::equation::values::{Place, Values};

/// Most times that rows are made again.
const MOST_PASSES: usize = 8;
/// Passes after which shapes stay as they are: each scan sees what the last one left.
const SHAPE_PASSES: usize = 3;
/// A parameter that moves by less than this many standard deviations stays.
pub(crate) const STEADY: f64 = 0.1;
/// A correlation of neighbours that differs by less is the same.
pub(crate) const SAME_CORRELATION: f64 = 0.03;
/// How a limb is fitted.
#[derive(Debug, Clone, Default)]
pub(crate) struct How {
    pub(crate) constraint: Constraint,
    pub(crate) method: Method,
    /// Where the search for a minimum begins; the CAD's bodies and the effects' priors if nowhere.
    pub(crate) start: Option<Values>,
    /// Effects whose values are known and are not to be fitted: those that all limbs share, once they are combined.
    pub(crate) held: Vec<Place>,
    /// How surely what all limbs share is known where it is held: what has a column leaves that much open of the others.
    pub(crate) known: Vec<Known>,
    /// The effects whose shapes are searched; of none, all.
    pub(crate) shapes: Option<Vec<Place>>,
    /// Whether plays and springs are sought near those of `start` only; where none is near that tells more than nothing there is no fit.
    pub(crate) near: bool,
    /// What is done with bodies that the data would carry far from the CAD.
    pub(crate) far_bodies: FarBodies,
    /// Most times that rows are made again, if fewer than usual: near a known fit two are enough.
    pub(crate) passes: Option<usize>,
    /// How rows are weighed, if not as the fit itself has it: models are compared under the same weights.
    pub(crate) weights: Option<Arc<Weights>>,
}

/// A parameter of an effect that is held, and its standard deviation.
pub(crate) type Known = (Place, usize, f64);

/// What is done with a body that the data would carry beyond [`FARTHEST`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum FarBodies {
    /// Nothing: the prior and the data share it.
    #[default]
    Pulled,
    /// It is held nearer: what a model lacks must show in the residual and not as an absurd mass.
    Held,
    /// It is released ([`Problem::release`]).
    Released,
}

/// A limb fitted to a recording.
pub(crate) struct LimbFit<'a> {
    pub(crate) data: &'a LimbData<'a>,
    /// The effects that are fitted.
    pub(crate) places: Vec<Place>,
    /// The columns and the values at which they were made.
    pub(crate) columns: Columns,
    pub(crate) at: Values,
    /// The estimate.
    pub(crate) values: Values,
    /// The data block by block of time, group by group: a group per joint.
    pub(crate) groups: Groups,
    /// The data of all blocks, group by group.
    pub(crate) all: Vec<Group>,
    /// Each group's noise: root mean square of its residuals, whitened where they are momentum's.
    pub(crate) noise: Vec<f64>,
    /// Of each joint, the correlation of the noise of neighbouring windows.
    pub(crate) correlation: Vec<f64>,
    /// How its rows were weighed.
    pub(crate) weights: Arc<Weights>,
    pub(crate) problem: Problem,
    pub(crate) solution: Solution,
    /// How many times nearer to the CAD each body is held than its uncertainty says.
    pub(crate) tightness: Vec<f64>,
    /// The limits of drives that the data tell, and their standard deviations, N m.
    pub(super) limits: Vec<(Place, f64)>,
    pub(super) method: Method,
    pub(super) deviations: OnceLock<Deviations>,
    pub(super) spread: OnceLock<Spread>,
    pub(super) moved_by_shapes: OnceLock<Vec<f64>>,
}

impl<'a> LimbFit<'a> {
    /// Fits the bodies and the effects `places`.
    ///
    /// `None` if numbers are not finite.
    pub(crate) fn of(data: &'a LimbData<'a>, places: &[Place], how: &How) -> Option<Self> {
        let mut values = start(data, places, how);
        let (limited, limits) = Self::limited(data, places, how);
        if let Some(limited) = limited {
            values = limited;
        }
        let fitted: Vec<Place> = (places.iter().copied())
            .filter(|p| !how.held.contains(p) || has_column(*p))
            .collect();
        let given = how
            .weights
            .as_ref()
            .map(|weights| weights.correlation.clone());
        let mut correlation = given.unwrap_or_else(|| vec![0.0; data.joints()]);
        let mut noise = data.typical_noise();
        let mut rows: Option<(Columns, Rows)> = None;
        let passes = how.passes.unwrap_or(MOST_PASSES);
        for pass in 1..=passes {
            let columns = data.columns(&values, &fitted, &[]);
            // Rows of a linear model do not depend on its values.
            let made = match rows.take() {
                Some((known, made)) if known == columns && !columns.depend_on_values() => made,
                _ => data.rows(&values, &columns),
            };
            let mut fit = Self::at(
                data,
                &fitted,
                values,
                (columns, &made),
                [&correlation, &noise],
                how,
            )?;
            let next = fit.noise_kind(&made);
            let mut pairs = next.iter().zip(&correlation);
            let same =
                how.weights.is_some() || pairs.all(|(a, b)| (a - b).abs() < SAME_CORRELATION);
            let is_told = |place: &Place| limits.iter().any(|(told, _)| told == place);
            let searched = |place: &Place| is_searched(place, how) && !is_told(place);
            let scanned = match pass <= SHAPE_PASSES.min(passes - 1) {
                true => {
                    let places = fit.places.iter().copied().filter(searched).collect();
                    shapes::better(places, || fit.scan(&made), how.near || pass > 1)
                }
                false => Searched::Same,
            };
            let scanned = match scanned {
                Searched::Nothing if how.near => return None,
                Searched::Better(values) => Some(values),
                _ if pass < passes => fit.with_shapes_moved(&made, &how.held),
                _ => None,
            };
            let done = same && scanned.is_none() && fit.is_steady();
            if done || pass == passes {
                if limits
                    .iter()
                    .any(|(place, _)| fit.values.get(*place, 1) <= 0.0)
                {
                    // Nothing is reported beyond a limit: it is none.
                    return Self::of(data, places, &without_limits(places, how));
                }
                fit.limits = limits;
                return match how.method {
                    Method::Momentum => Some(fit),
                    other => fit.by_other_equation(other, how),
                };
            }
            values = scanned.unwrap_or_else(|| fit.values.clone());
            correlation = if same { correlation } else { next };
            noise.clone_from(&fit.noise);
            rows = Some((fit.columns, made));
        }
        None
    }

    /// Where a fit begins whose drives' limits the data tell, and which limits these are, each with its standard deviation.
    fn limited(
        data: &LimbData,
        places: &[Place],
        how: &How,
    ) -> (Option<Values>, Vec<(Place, f64)>) {
        let (mut sought, mut known): (Vec<Place>, Vec<Place>) = places
            .iter()
            .partition(|place| place.0.description().is_limit() && is_searched(place, how));
        let (mut start, mut told) = (how.start.clone(), Vec::new());
        while let Some(place) = sought.pop() {
            let how = How {
                start: start.clone(),
                ..without_limits(&known, how)
            };
            let Some(fit) = LimbFit::of(data, &known, &how) else {
                break;
            };
            let limit = fit.limit(&fit.predicted(), place.1);
            if let Some(limit) = limit {
                known.push(place);
                told.push((place, limit.std));
                start = Some(limit.values);
            }
        }
        (start.filter(|_| !told.is_empty()), told)
    }

    /// The limit of a joint's drive, where these data tell one and the fit predicts so.
    pub(crate) fn limit(&self, predicted: &[f64], joint: usize) -> Option<Limit> {
        let refit = |data: &LimbData, start: &Values| {
            let how = How {
                start: Some(start.clone()),
                shapes: Some(Vec::new()),
                far_bodies: FarBodies::Held,
                passes: Some(2),
                ..How::default()
            };
            Some(LimbFit::of(data, &self.places, &how)?.values)
        };
        Limit::of((self.data, &self.values), predicted, joint, &refit)
    }

    /// The fit over rows that were made at `at`.
    fn at(
        data: &'a LimbData<'a>,
        places: &[Place],
        at: Values,
        (columns, rows): (Columns, &Rows),
        [correlation, noise]: [&[f64]; 2],
        how: &How,
    ) -> Option<Self> {
        let weights = how.weights.clone().unwrap_or_else(|| {
            let folding = Folding {
                data,
                columns: &columns,
                rows,
                theta: &columns.theta(&at),
                correlation,
                noise,
            };
            Arc::new(folding.weights())
        });
        let groups = Groups::of_factors(&columns, weights.blocks(data, &columns, rows));
        Self::solved(data, places, at, columns, groups, &weights, how)
    }

    fn solved(
        data: &'a LimbData<'a>,
        places: &[Place],
        at: Values,
        columns: Columns,
        groups: Groups,
        weights: &Arc<Weights>,
        how: &How,
    ) -> Option<Self> {
        let all = groups.sum(|_| true);
        let sizes: Vec<f64> = all.iter().map(Group::size).collect();
        let mut problem = Problem {
            bodies: data.bodies_before(),
            others: others(&columns, &at, how),
            data: stacked(&all, &sizes),
            free: how.constraint == Constraint::Free,
        };
        let (mut theta, mut noise) = (problem.theta_from(&problem.start())?, sizes.clone());
        for round in 1..=NOISE_ROUNDS {
            noise = noises(&all, &theta, &sizes);
            problem.data = stacked(&all, &noise);
            if round < NOISE_ROUNDS {
                theta = problem.theta_from(&theta)?;
            }
        }
        // How surely all is known is asked of the last one.
        let mut solution = problem.solve_from(&theta)?;
        let mut tightness = vec![1.0; problem.bodies.len()];
        if how.far_bodies != FarBodies::Pulled {
            for _ in 0..ROUNDS {
                let changed = match how.far_bodies {
                    FarBodies::Released => problem.release(&solution),
                    _ => hold(&mut problem, &solution, &mut tightness),
                };
                if !changed {
                    break;
                }
                solution = problem.solve_from(&solution.theta)?;
                noise = noises(&all, &solution.theta, &sizes);
                problem.data = stacked(&all, &noise);
                solution = problem.solve_from(&solution.theta)?;
            }
        }
        Some(Self {
            tightness,
            values: data.moved(&at, &columns, solution.theta.as_slice()),
            data,
            places: places.to_vec(),
            columns,
            at,
            groups,
            all,
            noise,
            correlation: weights.correlation.clone(),
            weights: weights.clone(),
            problem,
            solution,
            limits: Vec::new(),
            method: how.method,
            deviations: OnceLock::new(),
            spread: OnceLock::new(),
            moved_by_shapes: OnceLock::new(),
        })
    }

    /// The same parameters by another equation; corrections of sensors and of the base are those of the momentum fit.
    fn by_other_equation(self, method: Method, how: &How) -> Option<Self> {
        let limits = self.limits.clone();
        let groups = method::data(self.data, &self.values, &self.columns, method);
        let held: Vec<Place> = (self.places.iter().copied())
            .filter(|place| place.0.description().is_derivative())
            .collect();
        let how = How {
            held: [how.held.clone(), held].concat(),
            ..how.clone()
        };
        let places: Vec<Place> = self.places.clone();
        let fit = Self::solved(
            self.data,
            &places,
            self.values,
            self.columns,
            groups,
            &self.weights,
            &how,
        )?;
        Some(Self { limits, ..fit })
    }

    /// What is left of a window's torque at a joint, by the rows that the fit was made of, N m.
    fn residual(&self, rows: &Rows) -> impl Fn(usize, usize) -> f64 {
        let (data, own) = (
            self.data,
            self.columns.combined(self.solution.theta.as_slice()),
        );
        move |w, j| data.torque[w * data.joints() + j] - dot(&own[j], rows.row(w, j))
    }

    /// The residuals by those rows, ready to be searched for shapes.
    fn scan(&self, rows: &Rows) -> Scan<'_> {
        let at = [&self.values, &self.at];
        Scan::new(self.data, &self.columns, at, &self.residual(rows))
    }

    /// The correlation of neighbouring residuals of each joint.
    fn noise_kind(&self, rows: &Rows) -> Vec<f64> {
        let (data, residual) = (self.data, self.residual(rows));
        let of = |j: usize| {
            let residual = |w: usize| (data.motion.windows[w].samples, residual(w, j));
            let windows = (0..data.motion.windows.len()).filter(|&w| data.counts(w, j));
            neighbour_correlation(&windows.map(residual).collect::<Vec<_>>())
        };
        (0..data.joints()).map(of).collect()
    }

    /// Whether nothing that columns depend on has moved by much since they were made.
    fn is_steady(&self) -> bool {
        if !self.columns.depend_on_values() {
            return true;
        }
        let std = self.solution.std();
        let before = self.columns.theta(&self.at);
        let moved = |k: usize| (self.solution.theta[k] - before[k]).abs() > STEADY * std[k];
        !(0..before.len()).any(moved)
    }

    /// Whether the data carry a body farther from the CAD than bodies with the stated uncertainty are.
    pub(crate) fn has_far_body(&self) -> bool {
        let held = self.tightness.iter().any(|tightness| *tightness > 1.0);
        held || self.problem.has_far_body(&self.solution)
    }

    /// How many times less certain each body is than the model states: more than once where it was released.
    pub(crate) fn less_certain(&self) -> Vec<f64> {
        let stated = self.data.bodies_stated();
        let both = self.problem.bodies.iter().zip(&stated);
        both.map(|((_, now), (_, stated))| now / stated).collect()
    }

    /// Whether entry k's value is that of a derivative.
    pub(crate) fn is_derivative(&self, entry: usize) -> bool {
        self.columns.entries[entry]
            .effect
            .is_some_and(|effect| effect.description().is_derivative())
    }

    /// Entry k's value as the catalogue means it.
    pub(crate) fn value(&self, entry: usize) -> f64 {
        self.data.value(
            &self.at,
            &self.columns,
            entry,
            self.solution.theta.as_slice(),
        )
    }

    /// What the prior says of entry k, as the catalogue means it.
    pub(crate) fn prior_mean(&self, entry: usize) -> f64 {
        let bodies = INERTIAL * self.problem.bodies.len();
        match entry.checked_sub(bodies) {
            None => self.problem.bodies[entry / INERTIAL].0.0[entry % INERTIAL],
            Some(n) if self.is_derivative(entry) => {
                let e = &self.columns.entries[entry];
                let at = e
                    .effect
                    .map_or(0.0, |effect| self.at.get((effect, e.joint), e.parameter));
                self.problem.others[n].mean + at
            }
            Some(n) => self.problem.others[n].mean,
        }
    }
}

/// Holds those bodies nearer that are farther from the CAD than bodies are. Whether there is one.
pub(crate) fn hold(problem: &mut Problem, solution: &Solution, tightness: &mut [f64]) -> bool {
    let mut far = false;
    for b in 0..problem.bodies.len() {
        // The distance in units of the uncertainty as it was stated.
        let distance = problem.distance(solution, b) / (tightness[b] * tightness[b]);
        if distance > FARTHEST {
            let closer = (distance / FARTHEST).sqrt();
            tightness[b] *= closer;
            problem.bodies[b].1 /= closer;
            far = true;
        }
    }
    far
}

/// Where a fit begins.
fn start(data: &LimbData, places: &[Place], how: &How) -> Values {
    let mut values = how
        .start
        .clone()
        .unwrap_or_else(|| Values::cad(data.model, data.limb));
    for place in values.places().collect::<Vec<_>>() {
        if !places.contains(&place) {
            values.remove(place);
        }
    }
    let held = |place: &Place| data.can_tell(*place) || data.is_given(*place);
    for &place in places.iter().filter(|place| held(place)) {
        if values.has(place) {
            continue;
        }
        values.insert(place);
        for (n, parameter) in place.0.description().parameters.iter().enumerate() {
            let begin = data.begins_at(place, n);
            values.set(place, n, begin.clamp(parameter.lower, parameter.upper));
        }
    }
    values
}

/// The same, but no limit is sought.
fn without_limits(places: &[Place], how: &How) -> How {
    let shapes = places.iter().filter(|place| is_searched(place, how));
    let shapes = shapes.filter(|place| !place.0.description().is_limit());
    How {
        shapes: Some(shapes.copied().collect()),
        ..how.clone()
    }
}

/// Whether an effect's shape is searched.
fn is_searched(place: &Place, how: &How) -> bool {
    how.shapes.as_ref().is_none_or(|own| own.contains(place))
}

/// Whether an effect is a multiple of its columns, which a fit has also where it is held; what is a derivative is in the motion.
fn has_column((effect, _): Place) -> bool {
    !effect.description().is_derivative()
}

pub(super) fn found_by_trying(effect: EffectKind, joint: usize, at: &Values) -> bool {
    effect.description().enters == Enters::Trial && at.get((effect, joint), 0) > 0.0
}

/// Prior and bounds of the effects' entries.
pub(crate) fn others(columns: &Columns, at: &Values, how: &How) -> Vec<Bounded> {
    let of = |entry: &crate::equation::column::Entry| {
        let effect = entry.effect?;
        let parameter = &effect.description().parameters[entry.parameter];
        let here = if effect.description().is_derivative() {
            at.get((effect, entry.joint), entry.parameter)
        } else {
            0.0
        };
        let held =
            how.held.contains(&(effect, entry.joint)) || found_by_trying(effect, entry.joint, at);
        let place = (effect, entry.joint);
        if how.held.contains(&place) && has_column(place) {
            // Its value stays; how surely the other limbs know it is as good as a prior.
            let value = at.get(place, entry.parameter);
            let known =
                (how.known.iter()).find(|known| (known.0, known.1) == (place, entry.parameter));
            return Some(Bounded {
                mean: value,
                std: known.map_or(entry.std, |known| known.2),
                lower: value,
                upper: value,
            });
        }
        let [lower, upper] = match how.constraint {
            _ if held => [0.0, 0.0],
            Constraint::Free => [f64::NEG_INFINITY, f64::INFINITY],
            Constraint::Physical => [parameter.lower - here, parameter.upper - here],
        };
        Some(Bounded {
            mean: entry.mean,
            std: entry.std,
            lower,
            upper,
        })
    };
    columns.entries.iter().filter_map(of).collect()
}
