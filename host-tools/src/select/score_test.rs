//! What every effect would add to a limb's model, read off the factors of its data with all candidates' columns.
//!
//! The columns are derivatives of the predictor at the present fit.

use std::sync::Arc;

use proprio_core::effect::{EffectKind, Reach, Shapes};

use super::candidate::{Felt, Finding, Trial};
use super::criteria::presence;
use super::criteria::statistics::{autocorrelation_time, noise_lags, noise_memory};
use super::gain_bound::GainBounds;
use super::trial_factors::{ScoreTest, TrialFactors};
use crate::catalogue;
use crate::equation::column::{Columns, Entry, parent};
use crate::equation::dot::dot;
use crate::equation::rows::Rows;
use crate::equation::values::{Place, Values};
use crate::estimate::accumulate::Folding;
use crate::estimate::factor::HeapFactor;
use crate::estimate::fit::{LimbFit, SAME_CORRELATION};
use crate::estimate::limb_data::LimbData;
use crate::estimate::r_factor::{Prior, RFactor, prior_of_body};
use crate::estimate::shapes::Scan;
use crate::estimate::whitening::{Whitening, neighbour_correlation};
use crate::model::BASE;
use crate::parallel::side_by_side;

/// The factors of a limb's data over the columns of its model and of all that the model might lack.
pub(crate) struct Screen<'a> {
    pub(crate) fit: Arc<LimbFit<'a>>,
    /// Joint by joint, whitened.
    pub(crate) factors: TrialFactors,
    /// Where the columns were made; candidates' shapes among them.
    at: Values,
    /// How many neighbouring windows of each joint say the same thing.
    memory: Vec<f64>,
    /// The same as far as their noise remembers.
    pub(crate) noise_memory: Vec<f64>,
    /// Each joint's sum of squared torques, (N m)².
    torque: Vec<f64>,
    /// What the model predicts, as the limb's data have the torque, N m.
    predicted: Vec<f64>,
    /// What springs and plays can take away at most.
    bounds: GainBounds,
}

/// How often columns of loads are made again: the second trial's place is as near as its error.
const LOAD_ROUNDS: usize = 2;

impl<'a> Screen<'a> {
    /// Candidates are `possible` beside a fit that predicts so; where one has a shape it is the best on the present residuals, and
    /// loads are where they say.
    pub(crate) fn of(fit: Arc<LimbFit<'a>>, predicted: Vec<f64>, possible: &[Place]) -> Self {
        let mut at = with_shapes(&fit, possible, &predicted, &|scan, place| scan.about(place));
        let data = fit.data;
        let columns = data.columns(&at, &fit.places, possible);
        let mut rows = data.rows(&at, &columns);
        let mut screen = Self::made(fit, predicted, (columns, &rows), at.clone());
        for _ in 0..LOAD_ROUNDS {
            if !screen.move_loads(possible, &mut at) {
                break;
            }
            rows.put_loads(&data.body, &at, &screen.factors.columns);
            let made = (screen.factors.columns, &rows);
            screen = Self::made(screen.fit, screen.predicted, made, at.clone());
        }
        screen
    }

    /// Where the columns were made.
    pub(super) fn at(&self) -> &Values {
        &self.at
    }

    fn made(
        fit: Arc<LimbFit<'a>>,
        predicted: Vec<f64>,
        (columns, rows): (Columns, &Rows),
        at: Values,
    ) -> Self {
        let own = fit.clone();
        let fit = &*own;
        let data = fit.data;
        let folding = Folding {
            data,
            columns: &columns,
            rows,
            theta: &columns.theta(&fit.values),
            correlation: &fit.correlation,
            noise: &fit.noise,
        };
        let mut weights = folding.weights();
        let order = Order::of(fit, &columns);
        let triangle = |data: &[HeapFactor]| order.triangle(&columns, data, &fit.noise);
        // Of what kind the noise is, what all effects together leave tells best: what the model lacks is no noise.
        let together = triangle(&weights.together(data, &columns, rows));
        let mut left = Left::of(fit, &columns, rows, &together.solve_all());
        let is_other = left.differs_from(&fit.correlation);
        if is_other {
            weights.correlation.clone_from(&left.correlation);
        }
        let folds = weights.folds(data, &columns, rows, &|_| true);
        let (trains, all) = folds.without_each(&columns);
        let all = triangle(&all);
        if is_other {
            left = Left::of(fit, &columns, rows, &all.solve_all());
        }
        let trains: Vec<RFactor> = side_by_side(&trains, |train| triangle(train));
        let kinds = (columns, order.active);
        Self {
            memory: left.memory,
            noise_memory: left.noise_memory,
            torque: data.squares(&vec![0.0; data.torque.len()]).by_joint(),
            predicted,
            factors: TrialFactors::new(kinds, fit.noise.clone(), all, trains, folds.blocks),
            fit: own.clone(),
            at,
            bounds: GainBounds::default(),
        }
    }

    /// The same after another screen of the limb, beside another fit.
    pub(super) fn after(mut self, other: Option<&Self>) -> Self {
        self.bounds = other.map_or_else(GainBounds::default, |other| {
            GainBounds::after(&other.bounds)
        });
        self
    }

    /// How much of the sum of squares, in units of the noise, a spring or a play takes away at most, and of which size it does.
    pub(super) fn most_of_one(&self, place: Place) -> Option<(f64, f64)> {
        self.bounds.most_of_one(&self.fit, &self.predicted, place)
    }

    /// The same of several at once, each of the size that its column tells, or all as much smaller.
    pub(super) fn most_of_several(&self, places: &[Place], sizes: &[f64]) -> Option<f64> {
        self.bounds
            .most_of_several(&self.fit, &self.predicted, places, sizes)
    }

    /// Of each N m that a joint reports beyond a limit how much the motion shows: the slope of the predicted on the reported torque there.
    fn shown_beyond(&self, joint: usize, limit: f64) -> f64 {
        let beyond: Vec<[f64; 2]> = (self.torques(joint))
            .filter(|[reported, _]| reported.abs() > limit)
            .map(|[reported, predicted]| [reported.abs(), predicted * reported.signum()])
            .collect();
        let mean = |n: usize| beyond.iter().map(|x| x[n]).sum::<f64>() / beyond.len() as f64;
        let means = [mean(0), mean(1)];
        let product = |[a, b]: [usize; 2]| {
            beyond
                .iter()
                .map(|x| (x[a] - means[a]) * (x[b] - means[b]))
                .sum::<f64>()
        };
        product([0, 1]) / product([0, 0])
    }

    /// Of each window that counts a joint's torque as reported and as predicted, N m.
    fn torques(&self, joint: usize) -> impl Iterator<Item = [f64; 2]> {
        let (data, n) = (self.fit.data, self.fit.data.joints());
        (0..data.motion.windows.len())
            .filter(move |&w| data.counts(w, joint))
            .map(move |w| [data.torque[w * n + joint], self.predicted[w * n + joint]])
    }

    /// The values of the fit, with the effects of a trial at what it found, and their shapes as close as the data tell them.
    pub(crate) fn with(&self, trial: &Trial) -> Values {
        let mut values = self.fit.values.clone();
        let shapes = with_shapes(&self.fit, &trial.places, &self.predicted, &|scan, place| {
            scan.closest(place)
        });
        for told in &trial.findings {
            let (place, described) = (told.place, told.place.0.description());
            values.insert(place);
            for n in described.shapes() {
                values.set(place, n, shapes.get(place, n));
            }
            for (n, p) in described.parameters.iter().enumerate() {
                if let Some((value, _)) = told.parameters[n] {
                    values.set(place, n, value.clamp(p.lower, p.upper));
                }
            }
        }
        values
    }
}

impl ScoreTest for Screen<'_> {
    fn factors(&self) -> &TrialFactors {
        &self.factors
    }

    fn felt(&self, _: &[Place], entries: &[usize]) -> Felt {
        let factors = &self.factors;
        let feels = |j: usize| {
            let mut entries = entries.iter();
            entries.any(|&e| factors.columns.place(j, e).is_some())
        };
        let felt: Vec<usize> = (0..self.fit.data.joints()).filter(|&j| feels(j)).collect();
        let squares = factors.base.iter().flat_map(|fold| {
            let own = felt.iter();
            own.map(|&j| fold[j] / (self.fit.noise[j] * self.fit.noise[j]))
        });
        Felt {
            squares: squares.sum(),
            torque: felt.iter().map(|&j| self.torque[j]).sum(),
            memory: felt.iter().map(|&j| self.memory[j]).fold(1.0, f64::max),
        }
    }

    fn findings(&self, trial: &Trial) -> Vec<Finding> {
        let (data, columns) = (self.fit.data, &self.factors.columns);
        let mut theta = columns.theta(&self.at);
        for (&e, value) in trial.entries.iter().zip(&trial.value) {
            theta[e] = *value;
        }
        let told = |place: Place, parameter: usize| {
            let at = trial.entries.iter().position(|&e| {
                let entry = &columns.entries[e];
                (entry.effect, entry.joint, entry.parameter) == (Some(place.0), place.1, parameter)
            })?;
            let value = data.value(&self.at, columns, trial.entries[at], &theta);
            Some((value, trial.std[at]))
        };
        let of = |&place: &Place| {
            let parameters = 0..place.0.description().parameters.len();
            Finding {
                place,
                parameters: parameters.clone().map(|n| told(place, n)).collect(),
                prior: parameters.map(|n| data.prior(place, n)).collect(),
                nonlinear: self.at.shapes(place)[0],
                period: data.recording.period(),
                beyond_limit: (place.0.description().is_limit())
                    .then(|| self.shown_beyond(place.1, self.at.shapes(place)[0])),
            }
        };
        trial.places.iter().map(of).collect()
    }
}

/// Every effect that a limb's model does not have, where it could be.
pub(crate) fn possible(fit: &LimbFit, given: &[Place]) -> Vec<Place> {
    let joints = fit.data.joints();
    let has = |place: &Place| fit.places.contains(place) || given.contains(place);
    // A formula of the model at one joint may be missing at another.
    let own = fit.data.model.formulas();
    let places = catalogue::effects().chain(own).flat_map(|effect| {
        let described = effect.description();
        let shared = described.may_be_shared().then_some(BASE);
        let own = (described.reach != Reach::Robot).then_some(0..joints);
        let own = own.into_iter().flatten().filter(move |&joint| {
            let sees = |after: &isize| joint.checked_add_signed(*after).is_some_and(|n| n < joints);
            (!effect.couples_with_parent() || parent(&fit.columns.subtree_end, joint).is_some())
                && effect.others().iter().all(sees)
        });
        shared
            .into_iter()
            .chain(own)
            .map(move |joint| (effect, joint))
    });
    let moves = |joint: usize| joint == BASE || moves(fit.data, joint);
    places
        .filter(|place| fit.data.can_tell(*place) && !has(place) && moves(place.1))
        .filter(|&place| {
            let parent = (place.1 != BASE).then(|| parent(&fit.columns.subtree_end, place.1));
            is_beyond_its_parts(place, parent.flatten(), &has)
        })
        .collect()
}

/// Whether a model has the plain effects, at all joints concerned, of which a rich one is what they lack: friction that levels off looks like
/// Coulomb friction to fast motion and like viscous friction to slow motion, a rotor that turns with two joints like one of each. And
/// what a soft spring or a play is not right in looks like such a rotor: no coupling is sought where a link moves against its motor.
/// `parent` is the joint that carries the one at which the effect is.
pub(crate) fn is_beyond_its_parts(
    (effect, joint): Place,
    parent: Option<usize>,
    has: &dyn Fn(&Place) -> bool,
) -> bool {
    let facts = effect.description();
    // Beside one of the effects that it is the sum of it is the others, with one parameter more.
    if facts.sum_of.iter().any(|part| has(&(*part, joint))) {
        return false;
    }
    let couples = effect.couples_with_parent();
    let parent = parent.filter(|_| couples);
    [Some(joint), parent].into_iter().flatten().all(|joint| {
        let gives_way = EffectKind::COMPLIANT
            .iter()
            .any(|compliant| has(&(*compliant, joint)));
        facts.beside.iter().all(|part| has(&(*part, joint))) && !(couples && gives_way)
    })
}

/// Whether a joint moves for long enough to claim anything of it.
fn moves(data: &LimbData, joint: usize) -> bool {
    let limit = data.model.robot().bodies()[data.limb.bodies.start + joint].velocity;
    let states = &data.motion.joint[joint].state;
    presence::moves(states.iter().map(|state| state[1]), limit)
}

/// The fit's values, and for candidates that have shapes those that are `found` on what the fit leaves.
fn with_shapes(
    fit: &LimbFit,
    possible: &[Place],
    predicted: &[f64],
    found: &(dyn Fn(&Scan, Place) -> Option<Shapes> + Sync),
) -> Values {
    let data = fit.data;
    let shaped: Vec<Place> = possible
        .iter()
        .copied()
        .filter(|place| place.0.description().has_shape())
        .collect();
    let mut at = fit.values.clone();
    if shaped.is_empty() {
        return at;
    }
    let n = data.joints();
    let columns = data.columns(&fit.values, &fit.places, &shaped);
    let scan = Scan::new(data, &columns, [&fit.values; 2], &|w, j| {
        data.torque[w * n + j] - predicted[w * n + j]
    });
    let best: Vec<Option<Shapes>> = side_by_side(&shaped, |&place| found(&scan, place));
    for (&place, best) in shaped.iter().zip(best) {
        if let Some(best) = best {
            at.insert(place);
            at.set_searched(place, best);
        }
    }
    at
}

/// How many columns are the model's, which come first, and what is known of all before data.
struct Order {
    prior: Prior,
    active: usize,
}

impl Order {
    fn of(fit: &LimbFit, columns: &Columns) -> Self {
        let is_active = |entry: &&Entry| {
            (entry.effect).is_none_or(|effect| fit.places.contains(&(effect, entry.joint)))
        };
        let mut prior = cad_prior(fit.data);
        prior.tightness.clone_from(&fit.tightness);
        Self {
            prior,
            active: columns.entries.iter().take_while(is_active).count(),
        }
    }

    fn triangle(&self, columns: &Columns, data: &[HeapFactor], noise: &[f64]) -> RFactor {
        RFactor::new(columns, &self.prior, data, noise, self.active)
    }
}

/// The CAD's bodies within the model's uncertainty.
pub(crate) fn cad_prior(data: &LimbData) -> Prior {
    let body = |b: usize| {
        let cad = &data.model.robot().bodies()[b].inertia;
        prior_of_body(cad, data.model.cad_uncertainty(b))
    };
    let bodies: Vec<_> = data.limb.bodies.clone().map(body).collect();
    Prior {
        tightness: vec![1.0; bodies.len()],
        bodies,
    }
}

/// The length of a limb's windows, s.
fn window_length(data: &LimbData) -> f64 {
    let windows = &data.motion.windows;
    let sum: f64 = windows.iter().map(|window| window.length).sum();
    sum / windows.len().max(1) as f64
}

/// Of what kind a limb's noise is, joint by joint, as what all effects together leave tells.
struct Left {
    /// Of neighbouring windows.
    correlation: Vec<f64>,
    /// Integrated autocorrelation time once that is taken out, windows.
    memory: Vec<f64>,
    /// The same as far as noise remembers.
    noise_memory: Vec<f64>,
}

impl Left {
    fn of(fit: &LimbFit, columns: &Columns, rows: &Rows, theta: &[f64]) -> Self {
        let data = fit.data;
        let own = columns.combined(theta);
        let mut left = Self {
            correlation: Vec::new(),
            memory: Vec::new(),
            noise_memory: Vec::new(),
        };
        for j in 0..data.joints() {
            let residual = |w: usize| {
                let torque = data.torque[w * data.joints() + j];
                (
                    data.motion.windows[w].samples,
                    torque - dot(&own[j], rows.row(w, j)),
                )
            };
            let windows = (0..data.motion.windows.len()).filter(|&w| data.counts(w, j));
            let residuals: Vec<_> = windows.map(residual).collect();
            let correlation = neighbour_correlation(&residuals);
            let mut chain = Whitening::new(correlation);
            let whitened: Vec<f64> = residuals
                .iter()
                .map(|(samples, residual)| {
                    let mut row = [*residual];
                    chain.whiten(*samples, &mut row);
                    row[0]
                })
                .collect();
            left.correlation.push(correlation);
            left.memory.push(autocorrelation_time(&whitened));
            let lags = noise_lags(window_length(data));
            let unwhitened: Vec<f64> = residuals.iter().map(|(_, r)| *r).collect();
            left.noise_memory.push(noise_memory(&unwhitened, lags));
        }
        left
    }

    fn differs_from(&self, correlation: &[f64]) -> bool {
        (self.correlation.iter().zip(correlation)).any(|(a, b)| (a - b).abs() > SAME_CORRELATION)
    }
}
