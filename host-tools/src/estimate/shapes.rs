//! Shape parameters, in which a torque is far from linear: Stribeck's speed, that at which viscous friction levels off, presliding's displacement, cogging's frequency,
//! saturation's limit, the width of a play.
//!
//! What a fit leaves is regressed on the effect's columns for a grid of shapes, beside what friction, a rotor and a constant torque
//! explain, or for a grid of pairs where an effect has two; the best shape is refined between its neighbours. A play's columns are what its links'
//! motion changes of the whole prediction. No shape sees the torque that it explains but as the right-hand side.

use std::ops::Range;
use std::slice::from_ref;
use std::sync::{Arc, OnceLock};

use proprio_core::effect::{EffectKind, Grid, Input, JointState, MAX_COLUMNS, MAX_SHAPES, Shapes};

use super::directions::{Kept, Key, Span, Vectors};
use super::grid::{MULTIPLES, gear, grids, is_harmonic, is_narrow, pairs, size_of};
use super::limb_data::LimbData;
use crate::equation::column::{Columns, sees_other_joints};
use crate::equation::dot::dot;
use crate::equation::joint_states::States;
use crate::equation::presliding::Way;
use crate::equation::values::{NO_SHAPES, Place, Values};
use crate::once::made_once;
use crate::parallel::side_by_side;

/// Windows that a scan looks at, spread over the recording.
const MOST_WINDOWS: usize = 1500;
/// Rounds of refinement, each a third as wide as the last.
const ROUNDS: usize = 3;
/// A shape that differs by less than this share is the same.
const SAME: f64 = 1e-3;
/// The best of a grid is not refined that explains less than this share of what is left of its joint: half of what the slowest effect has to
/// (`select::criteria::LEAST_GAIN_OF_SLOW`).
const LEAST_FALL: f64 = 0.0025;
/// Fewer windows tell no shape.
const LEAST_WINDOWS: usize = 50;

/// What a search for shapes has found.
pub(crate) enum Searched {
    /// They are as good as they get.
    Same,
    /// A fit's values with better ones.
    Better(Values),
    /// They stay, and a play or a spring among them leaves as much with no value as with the best.
    Nothing,
}

/// Looks for better shapes of these effects on what a fit leaves, plays and springs `again` near those that an earlier pass has found.
pub(crate) fn better<'a>(
    places: Vec<Place>,
    scan: impl FnOnce() -> Scan<'a>,
    again: bool,
) -> Searched {
    let is_sought = |place: &Place| place.0.description().searched().is_some();
    let places: Vec<Place> = places.into_iter().filter(is_sought).collect();
    if places.is_empty() {
        return Searched::Same;
    }
    let mut scan = scan();
    scan.is_near = again;
    let best: Vec<Option<Shapes>> = side_by_side(&places, |&place| scan.closest(place));
    let (mut values, mut moved, mut nothing) = (scan.values.clone(), false, false);
    for (place, best) in places.into_iter().zip(best) {
        let Some(best) = best else {
            nothing |= place.0.description().is_compliant();
            continue;
        };
        let is_other = |((n, _), best): ((usize, Grid), f64)| {
            let before = scan.at.get(place, n);
            (best - before).abs() > SAME * size_of(scan.data, (place, n), before)
        };
        let mut searched = place.0.description().all_searched().zip(best);
        if searched.any(is_other) {
            values.set_searched(place, best);
            moved = true;
        }
    }
    match (moved, nothing) {
        (true, _) => Searched::Better(values),
        (false, true) => Searched::Nothing,
        (false, false) => Searched::Same,
    }
}

/// The residuals of a limb's model, ready to be searched for shapes.
pub(crate) struct Scan<'a> {
    pub(super) data: &'a LimbData<'a>,
    pub(super) values: &'a Values,
    /// Where the columns were made: what a play's column says of the gap there is true near it only.
    pub(super) at: &'a Values,
    columns: &'a Columns,
    /// What effects see under the model, if a scan asks.
    states: OnceLock<States>,
    /// Of each joint and its windows the sample with the greatest torque.
    greatest: OnceLock<Vec<Vec<usize>>>,
    /// Of each joint the windows that count, and what the model leaves in them, N m.
    windows: Vec<Vec<usize>>,
    residuals: Vec<Vec<f64>>,
    /// Of each joint the samples of these windows, one window's after the other's, if a scan asks.
    samples: Vec<OnceLock<Vec<WindowSample>>>,
    /// Of each joint its way, if a scan asks.
    ways: Vec<OnceLock<Vec<Way>>>,
    /// The columns of an effect of some shape over all of its joint's windows.
    made: Kept<(Place, [u64; MAX_SHAPES])>,
    /// Whether plays and springs are sought near the present ones only.
    pub(super) is_near: bool,
}

/// A sample of a window.
struct WindowSample {
    state: JointState<f64>,
    /// The time that it stands for in the integral over the window, s.
    weight: f64,
    /// What its boundary term counts: −1 of the window's first sample, 1 of its last, 0 between.
    edge: f64,
}

impl<'a> Scan<'a> {
    pub(crate) fn new(
        data: &'a LimbData<'a>,
        columns: &'a Columns,
        [values, at]: [&'a Values; 2],
        residual: &dyn Fn(usize, usize) -> f64,
    ) -> Self {
        let windows: Vec<Vec<usize>> = (0..data.joints())
            .map(|j| {
                let all: Vec<usize> = (0..data.motion.windows.len())
                    .filter(|&w| data.counts(w, j))
                    .collect();
                let stride = (all.len() / MOST_WINDOWS).max(1);
                all.into_iter().step_by(stride).collect()
            })
            .collect();
        let residuals = windows.iter().enumerate();
        let residuals = residuals
            .map(|(j, windows)| windows.iter().map(|&w| residual(w, j)).collect())
            .collect();
        Self {
            columns,
            states: OnceLock::new(),
            greatest: OnceLock::new(),
            data,
            values,
            at,
            windows,
            residuals,
            samples: (0..data.joints()).map(|_| OnceLock::new()).collect(),
            ways: vec![OnceLock::new(); data.joints()],
            made: Kept::default(),
            is_near: false,
        }
    }

    pub(super) fn states(&self) -> &States {
        let (data, columns) = (self.data, self.columns);
        let made = || data.motion.seen(&data.body, self.values, columns);
        made_once(&self.states, made)
    }

    /// The best shapes of an effect on the windows of the folds that are chosen, or what else of it is searched; `None` if they are too few.
    pub(crate) fn best(&self, place: Place, chosen: &dyn Fn(usize) -> bool) -> Option<Shapes> {
        self.found(place, chosen, true, None)
    }

    /// The same, or these `known` ones where those windows cannot tell the best from it: the moment of a change, of windows of other times.
    pub(crate) fn best_beside(
        &self,
        place: Place,
        known: Shapes,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<Shapes> {
        self.found(place, chosen, true, Some(known))
    }

    /// The best shapes on all windows.
    pub(crate) fn closest(&self, place: Place) -> Option<Shapes> {
        self.best(place, &|_| true)
    }

    /// The best of the shapes that are tried first, which looks much like the best one; of harmonics, which are narrow, that.
    pub(crate) fn about(&self, place: Place) -> Option<Shapes> {
        self.found(place, &|_| true, is_narrow(place.0), None)
    }

    fn found(
        &self,
        place: Place,
        chosen: &dyn Fn(usize) -> bool,
        closely: bool,
        known: Option<Shapes>,
    ) -> Option<Shapes> {
        let (effect, joint) = place;
        if effect.description().is_compliant() {
            let best = self.best_looseness(place, chosen)?;
            return Some([best, NO_SHAPES[1]]);
        }
        let (windows, mut residual) = self.told(joint, chosen)?;
        if self.values.has(place) {
            // What the effect explains with its present shape is for the new shape to explain.
            let columns = self.columns(&windows, place, self.values.shapes(place));
            for (column, n) in columns.into_iter().zip(effect.description().linear()) {
                let value = self.values.get(place, n);
                residual
                    .iter_mut()
                    .zip(column)
                    .for_each(|(r, x)| *r += value * x);
            }
        }
        // Of some windows only nothing is kept: what all shapes stand beside is made once.
        let basis = OnceLock::new();
        let basis = || -> &Span { made_once(&basis, || self.basis(&windows, joint)) };
        let span = |shapes: Shapes| self.span(&windows, place, shapes, &basis);
        let fall = |shapes: Shapes| explained(&span(shapes), &residual);
        let torque = |k: usize| self.states().joint(k, joint).tau;
        let grids = grids(self.data, self.values, place, &torque);
        // A pair costs the product of both grids: one that is known is looked for about where it is.
        let present =
            || (self.is_near && self.values.has(place)).then(|| self.values.shapes(place));
        let near = known.or_else(present).filter(|_| grids.len() > 1);
        let all = near.map_or_else(|| pairs(&grids), |near| vec![near]);
        let is_known = |shapes: &Shapes| self.known(&windows, place, *shapes).is_some();
        if is_harmonic(effect) && !all.iter().all(is_known) {
            let harmonics = self.harmonics(&windows, place);
            for (shapes, columns) in all.iter().zip(harmonics) {
                let key = self.shape_key(&windows, place, *shapes);
                self.keep(key, beside(columns, basis()));
            }
        }
        let falls: Vec<f64> = all.iter().map(|&shapes| fall(shapes)).collect();
        let searched = effect.description().all_searched().zip(&grids);
        let bounds = searched.map(|((n, grid), values)| {
            let parameter = &effect.description().parameters[n];
            // No finer than a grid that begins at what the samples resolve.
            let lower = match grid {
                Grid::Displacements => values[0],
                _ => parameter.lower,
            };
            [lower, parameter.upper]
        });
        let bounds: Vec<[f64; 2]> = bounds.collect();
        // Harmonics are narrow; of other shapes the next one explains much the same.
        let at = best_of(&falls);
        let most = falls[at];
        let square = dot(&residual, &residual);
        let explains = most >= LEAST_FALL * square;
        let mut best = if !closely || !is_narrow(effect) && !explains {
            all[at]
        } else {
            let steps: Vec<f64> = (grids.iter().zip(all[at]))
                .map(|(grid, value)| step_beside(grid, value))
                .collect();
            let above: Vec<f64> = bounds.iter().map(|[lower, _]| lower.min(0.0)).collect();
            closest((all[at], most), &steps, &above, &fall)
        };
        for (best, [lower, upper]) in best.iter_mut().zip(&bounds) {
            *best = best.clamp(*lower, *upper);
        }
        // As likely but for the noise of one window: half a unit of the log-likelihood.
        let is_as_likely = |known: &Shapes| {
            let most = fall(best);
            most - fall(*known) < (square - most) / windows.len() as f64
        };
        Some(known.filter(is_as_likely).unwrap_or(best))
    }

    /// A joint's windows of the chosen folds and what the model leaves in them; `None` if they are too few.
    pub(super) fn told(
        &self,
        joint: usize,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<(Vec<usize>, Vec<f64>)> {
        let all = self.windows[joint].iter().zip(&self.residuals[joint]);
        let told: (Vec<usize>, Vec<f64>) = all.filter(|(w, _)| chosen(self.data.fold(**w))).unzip();
        (told.0.len() >= LEAST_WINDOWS).then_some(told)
    }

    /// Directions that friction, a rotor and a constant torque of a joint explain.
    pub(super) fn basis(&self, windows: &[usize], joint: usize) -> Span {
        let key = self.key(windows, joint, None);
        if let Some(known) = key.and_then(|key| self.data.directions.get(&key)) {
            return known;
        }
        let mut basis = Vectors::new();
        for effect in EffectKind::PLAIN {
            for column in self.columns(windows, (effect, joint), NO_SHAPES) {
                basis.extend(orthonormal(column, &basis));
            }
        }
        self.keep(key, basis)
    }

    /// Directions that an effect of these shapes adds to the `basis`.
    fn span<'b>(
        &self,
        windows: &[usize],
        place: Place,
        shapes: Shapes,
        basis: &(dyn Fn() -> &'b Span + Sync),
    ) -> Span {
        self.known(windows, place, shapes).unwrap_or_else(|| {
            let columns = self.columns(windows, place, shapes);
            let span = beside(columns, basis());
            self.keep(self.shape_key(windows, place, shapes), span)
        })
    }

    fn known(&self, windows: &[usize], place: Place, shapes: Shapes) -> Option<Span> {
        let key = self.shape_key(windows, place, shapes)?;
        self.data.directions.get(&key)
    }

    /// Keeps directions that can be kept.
    fn keep(&self, key: Option<Key>, span: Vectors) -> Span {
        match key {
            Some(key) => self.data.directions.put(key, span),
            None => Arc::new(span),
        }
    }

    fn shape_key(&self, windows: &[usize], (effect, joint): Place, shapes: Shapes) -> Option<Key> {
        self.key(windows, joint, Some((effect, shapes.map(f64::to_bits))))
    }

    /// What directions are kept under; `None` if they depend on more than the motion, or are of some windows only.
    fn key(
        &self,
        windows: &[usize],
        joint: usize,
        effect: Option<(EffectKind, [u64; MAX_SHAPES])>,
    ) -> Option<Key> {
        let is_kept = effect.is_none_or(|(effect, _)| !effect.description().depends_on_model())
            && windows.len() == self.windows[joint].len();
        is_kept.then_some(Key {
            joint,
            effect,
            encoder: (self.values.encoder(joint).numbers()).map(|x| (x + 0.0).to_bits()),
        })
    }

    /// The columns of an effect over windows, as rows have them.
    fn columns(&self, windows: &[usize], place: Place, shapes: Shapes) -> Vectors {
        let all = &self.windows[place.1];
        if windows.len() == all.len() {
            return self.columns_of_all(place, shapes);
        }
        // Folds ask for the same shapes, each for other windows.
        let key = (place, shapes.map(f64::to_bits));
        let made = (self.made).get_or(key, || self.columns_of_all(place, shapes));
        let at: Vec<usize> = (windows.iter())
            .filter_map(|window| all.binary_search(window).ok())
            .collect();
        let chosen = |column: &Vec<f64>| at.iter().map(|&n| column[n]).collect();
        made.iter().map(chosen).collect()
    }

    fn columns_of_all(&self, (effect, joint): Place, shapes: Shapes) -> Vectors {
        let windows = &self.windows[joint];
        let motion = &self.data.motion;
        if effect.description().input == Input::Bristles {
            // The states have what bristles of one displacement do; all of their term is a boundary.
            let ways = made_once(&self.ways[joint], || motion.ways(&motion.joint[joint]));
            let impulse = ways.iter().flat_map(|way| way.impulse(shapes[0]));
            let impulse: Vec<f64> = impulse.collect();
            let of = |&w: &usize| {
                let window = &motion.windows[w];
                let [first, last] = window.samples;
                (impulse[last] - impulse[first]) / window.length
            };
            return vec![windows.iter().map(of).collect()];
        }
        let is_limit = effect.description().is_limit();
        let greatest = is_limit.then(|| &self.greatest()[joint]);
        let states = self.states();
        let term = |k: usize| states.terms(k, (effect, joint), shapes);
        // What sees no other joint has its state put together once for all shapes.
        let sees_others = sees_other_joints(effect);
        let mut all = self.samples(joint).iter();
        let mut columns = vec![vec![0.0; windows.len()]; effect.columns()];
        for (at, &w) in windows.iter().enumerate() {
            let window = &motion.windows[w];
            let [first, last] = window.samples;
            let samples = all.by_ref().take(last + 1 - first);
            // Below a limit nothing is lost, and most windows are below most limits.
            if greatest.is_some_and(|greatest| term(greatest[at])[0].rate == 0.0) {
                samples.for_each(drop);
                continue;
            }
            let mut sums = [0.0; MAX_COLUMNS];
            for (k, sample) in (first..).zip(samples) {
                let terms = match sees_others {
                    true => term(k),
                    false => effect.terms_among(from_ref(&sample.state), 0, shapes),
                };
                for (sum, term) in sums.iter_mut().zip(terms) {
                    *sum += sample.weight * term.rate + sample.edge * term.boundary;
                }
            }
            for (column, sum) in columns.iter_mut().zip(sums) {
                column[at] = sum / window.length;
            }
        }
        columns
    }

    fn samples(&self, joint: usize) -> &Vec<WindowSample> {
        let states = self.states();
        made_once(&self.samples[joint], || {
            let windows = self.windows[joint].iter();
            let samples = windows.flat_map(|&w| {
                let [first, last] = self.data.motion.windows[w].samples;
                (first..=last).map(move |k| WindowSample {
                    state: states.joint(k, joint),
                    weight: self.weight(first..last, k),
                    edge: f64::from(u8::from(k == last)) - f64::from(u8::from(k == first)),
                })
            });
            samples.collect()
        })
    }

    fn greatest(&self) -> &Vec<Vec<usize>> {
        let of = |joint: usize| -> Vec<usize> {
            let states = self.states();
            let torque = |k: usize| states.joint(k, joint).tau.abs();
            let greatest = |&w: &usize| {
                let [first, last] = self.data.motion.windows[w].samples;
                let samples = first..=last;
                let most = samples.max_by(|&a, &b| torque(a).total_cmp(&torque(b)));
                most.unwrap_or(first)
            };
            self.windows[joint].iter().map(greatest).collect()
        };
        made_once(&self.greatest, || (0..self.data.joints()).map(of).collect())
    }

    /// The columns, sine and cosine, at the multiples of the gear ratio that are in a grid of harmonics. Those of each multiple come
    /// from those of the one before (angle addition), so that a sample costs one evaluation and not one for each multiple.
    fn harmonics(&self, windows: &[usize], (effect, joint): Place) -> Vec<Vectors> {
        let gear = gear(self.data, joint);
        // They are kept: no more room than they take.
        let room = || (0..2).map(|_| Vec::with_capacity(windows.len())).collect();
        let mut columns: Vec<Vectors> = (0..MULTIPLES).map(|_| room()).collect();
        for &w in windows {
            let window = &self.data.motion.windows[w];
            let [first, last] = window.samples;
            let mut sums = [[0.0; 2]; MULTIPLES];
            for k in first..=last {
                let terms = (self.states()).terms(k, (effect, joint), [gear, NO_SHAPES[1]]);
                let [sin, cos] = terms.map(|term| term.rate);
                let weight = self.weight(first..last, k);
                let (mut s, mut c) = (weight * sin, weight * cos);
                for sum in &mut sums {
                    sum[0] += s;
                    sum[1] += c;
                    (s, c) = (s * cos + c * sin, c * cos - s * sin);
                }
            }
            for (columns, sums) in columns.iter_mut().zip(sums) {
                columns[0].push(sums[0] / window.length);
                columns[1].push(sums[1] / window.length);
            }
        }
        columns
    }

    /// The time that sample k stands for in the integral over a window (trapezoidal rule), s.
    fn weight(&self, samples: Range<usize>, k: usize) -> f64 {
        let time = &self.data.motion.time;
        0.5 * (time[(k + 1).min(samples.end)] - time[k.saturating_sub(1).max(samples.start)])
    }
}

/// Half way from the value of a grid that is next to this one to its neighbour.
fn step_beside(grid: &[f64], value: f64) -> f64 {
    let away = |at: usize| (grid[at] - value).abs();
    let at = (0..grid.len())
        .rev()
        .min_by(|a, b| away(*a).total_cmp(&away(*b)));
    let at = at.unwrap_or(0);
    let neighbour = grid.get(at + 1).unwrap_or(&grid[at.saturating_sub(1)]);
    0.5 * (neighbour - grid[at]).abs()
}

/// The value with the largest fall, between the neighbours of the best of a grid; it is `above` this.
pub(super) fn refined(
    grid: &[f64],
    falls: &[f64],
    above: f64,
    fall: &(dyn Fn(f64) -> f64 + Sync),
) -> f64 {
    let best = best_of(falls);
    let begin = ([grid[best], NO_SHAPES[1]], falls[best]);
    let [best, _] = closest(
        begin,
        &[step_beside(grid, grid[best])],
        &[above],
        &|shapes| fall(shapes[0]),
    );
    best
}

/// The shapes with the largest fall about those that an earlier search has found, with the fall of these: each is tried `steps` less and more, which
/// become shorter; each stays `above` this.
fn closest(
    (mut shapes, mut most): (Shapes, f64),
    steps: &[f64],
    above: &[f64],
    fall: &(dyn Fn(Shapes) -> f64 + Sync),
) -> Shapes {
    let mut steps = steps.to_vec();
    for _ in 0..ROUNDS {
        for (n, step) in steps.iter().enumerate() {
            let tried = [-step, *step].map(|by| {
                let mut tried = shapes;
                tried[n] += by;
                tried
            });
            let told = |tried: Shapes| (tried[n] > above[n]).then(|| (tried, fall(tried)));
            let found = side_by_side(&tried, |&tried| told(tried));
            for (other, fall) in found.into_iter().flatten() {
                if fall > most {
                    (shapes, most) = (other, fall);
                }
            }
        }
        steps.iter_mut().for_each(|step| *step /= 3.0);
    }
    shapes
}

/// Where the largest fall of a grid is.
fn best_of(falls: &[f64]) -> usize {
    let best = (0..falls.len()).max_by(|&a, &b| falls[a].total_cmp(&falls[b]));
    best.unwrap_or(0)
}

/// How much the residual's sum of squares falls with what a span explains.
fn explained(span: &[Vec<f64>], residual: &[f64]) -> f64 {
    span.iter().map(|x| dot(x, residual).powi(2)).sum()
}

/// What columns add to the span of a basis: orthonormal directions.
fn beside(columns: Vectors, basis: &[Vec<f64>]) -> Vectors {
    let mut own = Vectors::new();
    for column in columns {
        own.extend(orthonormal(column, basis).and_then(|column| orthonormal(column, &own)));
    }
    own
}

/// What of `x` is not in the span of `basis`, to unit length; `None` if nothing is.
pub(crate) fn orthonormal(mut x: Vec<f64>, basis: &[Vec<f64>]) -> Option<Vec<f64>> {
    let size = dot(&x, &x).sqrt();
    for b in basis {
        let share = dot(b, &x);
        x.iter_mut().zip(b).for_each(|(x, b)| *x -= share * b);
    }
    let length = dot(&x, &x).sqrt();
    if length.is_nan() || length <= 1e-6 * size {
        return None;
    }
    x.iter_mut().for_each(|x| *x /= length);
    Some(x)
}
