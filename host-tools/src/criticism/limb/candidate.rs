//! What an effect would add to the limb's model.

use proprio_core::effect::{EffectKind, Form, Parameter};

use super::super::blocks::HeapFactor;
use super::super::column::BASE;
use super::super::diagnosis::ParameterReport;
use super::super::triangle::{Triangle, misfit};
use super::{LimbCriticism, Place};

/// No load is farther from its body's centre of mass, m: a Go2's longest link is 0.21 m.
const REACH: f64 = 0.3;

/// Share of the limited torque's sum of squares that may stay unexplained.
const MOST_LEFT: f64 = 0.1;
/// A smaller delay is none, sampling periods.
const LEAST_DELAY: f64 = 0.1;

/// What an effect would add.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) place: Place,
    /// Its parameters' entries.
    pub(crate) entries: Vec<usize>,
    /// How much the held-out sum of squares, in units of the joints' noise, falls in each fold.
    pub(crate) gains: Vec<f64>,
    /// Sum of squared residuals \[fold\] \[joint\] with it, (N m)².
    pub(crate) rss: Vec<Vec<f64>>,
    /// Its linear parameters (beyond neutral and correction) by all data.
    pub(crate) value: Vec<f64>,
    /// Their standard deviations: the larger of what independent residuals give and of the spread over folds.
    pub(crate) std: Vec<f64>,
    /// How much the weighted sum of squares of all data falls, the CAD's prior included, as far as windows are independent.
    pub(crate) fall: f64,
    /// Size in units of its standard deviation, all parameters together.
    pub(crate) z: f64,
}

impl Candidate {
    /// The gain over all folds, and its error from their spread.
    pub(crate) fn gain(&self) -> (f64, f64) {
        sum_and_error(&self.gains)
    }
}

impl LimbCriticism<'_> {
    /// What every effect that the model does not have would add, best first; `with` is taken to be in the model already.
    pub(crate) fn candidates(&self, with: Option<Place>) -> Vec<Candidate> {
        let mut active_places = self.active.clone();
        active_places.extend(with);
        let active = self.entries_with(&active_places);
        let places: Vec<Place> = self
            .possible()
            .into_iter()
            .filter(|p| Some(*p) != with)
            .collect();
        let groups: Vec<Vec<usize>> = places
            .iter()
            .map(|&(effect, joint)| self.columns.of_effect(effect, joint))
            .collect();
        let rest: Vec<usize> = groups.iter().flatten().copied().collect();
        let triangle = |data: &[HeapFactor]| {
            Triangle::new(
                &self.columns,
                &self.prior,
                data,
                &self.fit.noise,
                &active,
                &rest,
            )
        };
        let all = triangle(&self.all);
        let trains: Vec<Triangle> = self.trains.iter().map(|train| triangle(train)).collect();
        let base: Vec<Vec<f64>> = match with {
            None => self.fit.rss.clone(),
            Some(_) => {
                let theta: Vec<_> = trains
                    .iter()
                    .map(|t| t.solve(self.columns.entries.len(), &[]))
                    .collect();
                self.score(&theta)
            }
        };
        let mut candidates: Vec<Candidate> = places
            .iter()
            .zip(&groups)
            .filter_map(|(&place, group)| self.candidate(place, group, &all, &trains, &base))
            .collect();
        candidates.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
        candidates
    }

    fn candidate(
        &self,
        place: Place,
        group: &[usize],
        all: &Triangle,
        trains: &[Triangle],
        base: &[Vec<f64>],
    ) -> Option<Candidate> {
        let trial = all.trial(group)?;
        let (mut gains, mut rss, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for (fold, train) in trains.iter().enumerate() {
            let value = train.trial(group)?.value;
            let pairs: Vec<(usize, f64)> =
                group.iter().copied().zip(value.iter().copied()).collect();
            let theta = train.solve(self.columns.entries.len(), &pairs);
            let with = self.score_fold(&self.tests[fold], &theta);
            gains.push(self.weighted_fall(&base[fold], &with));
            rss.push(with);
            values.push(value);
        }
        let felt = (0..self.recording.joints)
            .filter(|&joint| self.columns.place(joint, group[0]).is_some());
        let memory = match place.1 {
            BASE => felt.map(|joint| self.memory[joint]).fold(1.0, f64::max),
            joint => self.memory[joint],
        };
        let (mut std, mut inflation) = (Vec::new(), 1.0f64);
        for (n, (value, independent)) in trial.value.iter().zip(&trial.std).enumerate() {
            let spread = jackknife(values.iter().map(|v| v[n]), *value);
            let independent = independent * memory.sqrt();
            inflation = inflation.max(spread / independent);
            std.push(independent.max(spread));
        }
        let freedom = group.len() as f64;
        let chance = freedom - 1.0 + 2.0 * self.shapes_tried(place).ln();
        let z = (trial.fall / memory - chance).max(0.0).sqrt() / inflation;
        Some(Candidate {
            place,
            entries: group.to_vec(),
            gains,
            rss,
            value: trial.value,
            std,
            fall: trial.fall / memory,
            z,
        })
    }

    /// The value of an effect's parameter, as the catalogue means it, where its entry has this value.
    pub(crate) fn value(&self, entry: usize, value: f64) -> f64 {
        let entry = &self.columns.entries[entry];
        let Some(effect) = entry.effect else {
            return value;
        };
        let neutral = effect.description().parameters[entry.parameter].neutral;
        let correction = self.corrections.get(effect, entry.joint, entry.parameter);
        match effect {
            // Corrections that start at their own neutral value; the second stands for its inverse.
            EffectKind::VelocityGain => correction + value,
            EffectKind::TorqueGain => 1.0 / (correction + value),
            // The first moment about the body's centre of mass of a load that is taken to be elsewhere.
            EffectKind::Payload if (1..=3).contains(&entry.parameter) => {
                let mass = self.columns.of_effect(effect, entry.joint)[0];
                let away = self.loads[entry.joint] - self.coms[entry.joint];
                value + self.fit.theta[mass] * away[entry.parameter - 1]
            }
            _ => neutral + correction + value,
        }
    }

    /// A candidate's parameters as the catalogue means them, shapes included.
    pub(crate) fn parameters(&self, candidate: &Candidate) -> Vec<ParameterReport> {
        let report = |(n, parameter): (usize, &'static Parameter)| {
            let entry = candidate
                .entries
                .iter()
                .position(|&k| self.columns.entries[k].parameter == n);
            let (value, std) = match entry {
                None => (self.shape(candidate.place), 0.0),
                Some(k) => {
                    let (entry, value) = (candidate.entries[k], candidate.value[k]);
                    let span = self.value(entry, value + 1e-6) - self.value(entry, value - 1e-6);
                    (
                        self.value(entry, value),
                        candidate.std[k] * (span / 2e-6).abs(),
                    )
                }
            };
            ParameterReport {
                symbol: parameter.symbol,
                unit: parameter.unit,
                value,
                std,
            }
        };
        candidate
            .place
            .0
            .description()
            .parameters
            .iter()
            .enumerate()
            .map(report)
            .collect()
    }

    /// 1 − the held-out sum of squares with a candidate over that without, of the joints that feel it, and its error from
    /// the spread over folds.
    pub(crate) fn held_out_gain(&self, candidate: &Candidate) -> (f64, f64) {
        let feels = |joint: usize| self.columns.place(joint, candidate.entries[0]).is_some();
        let weighted = |rss: &[f64]| -> f64 {
            let felt = rss
                .iter()
                .zip(&self.fit.noise)
                .enumerate()
                .filter(|(joint, _)| feels(*joint));
            felt.map(|(_, (square, noise))| square / (noise * noise))
                .sum()
        };
        let without: f64 = self.fit.rss.iter().map(|rss| weighted(rss)).sum();
        let falls: Vec<f64> = self
            .fit
            .rss
            .iter()
            .zip(&candidate.rss)
            .map(|(a, b)| weighted(a) - weighted(b))
            .collect();
        let (fall, error) = sum_and_error(&falls);
        (fall / without, error / without)
    }

    /// Whether samples can tell a candidate's value from none at all, whatever their number: how the torque runs between two
    /// samples is not known.
    pub(crate) fn is_resolved(&self, candidate: &Candidate) -> bool {
        candidate.place.0 != EffectKind::Delay
            || candidate.value[0].abs() > LEAST_DELAY * self.recording.period()
    }

    /// Whether a candidate's value is physical within twice its error.
    pub(crate) fn in_bounds(&self, candidate: &Candidate) -> bool {
        self.within(
            candidate.place,
            &candidate.entries,
            &candidate.value,
            &candidate.std,
        ) && (candidate.place.0 != EffectKind::Saturation || self.leaves_less(candidate))
    }

    /// Whether a limit of the torque explains more than it takes away: what is beyond the limit is no longer measured, and a
    /// limit of nothing would leave nothing to explain. A limit is told only where the model is right but for it.
    fn leaves_less(&self, candidate: &Candidate) -> bool {
        let joint = candidate.place.1;
        let mut excess = vec![0.0; self.columns.entries.len()];
        let torque = misfit(&self.columns, joint, &self.all[joint], &excess);
        excess[candidate.entries[0]] = 1.0;
        let limited = misfit(&self.columns, joint, &self.all[joint], &excess);
        let sum = |rss: &[Vec<f64>]| -> f64 { rss.iter().map(|fold| fold[joint]).sum() };
        let left = sum(&candidate.rss);
        left * torque < sum(&self.fit.rss) * limited && left < MOST_LEFT * limited
    }

    fn within(&self, place: Place, entries: &[usize], value: &[f64], std: &[f64]) -> bool {
        let parameters = place.0.description().parameters;
        if place.0.description().form == Form::Inertia && !is_load(value, std) {
            return false;
        }
        entries
            .iter()
            .zip(value.iter().zip(std))
            .all(|(&entry, (value, std))| {
                let parameter = &parameters[self.columns.entries[entry].parameter];
                let (lower, upper) = (
                    self.value(entry, value - 2.0 * std),
                    self.value(entry, value + 2.0 * std),
                );
                // One of them may be an inverse.
                lower.max(upper) >= parameter.lower && lower.min(upper) <= parameter.upper
            })
    }

    /// Whether the fitted value of an effect of the model is physical within twice its error; a load's value itself, for a mass of
    /// about nothing, well away, is what other effects look like.
    pub(crate) fn is_physical(&self, place: Place) -> bool {
        let entries = self.columns.of_effect(place.0, place.1);
        let value = entries
            .iter()
            .map(|&k| self.fit.theta[k])
            .collect::<Vec<_>>();
        let std = entries.iter().map(|&k| self.fit.std[k]).collect::<Vec<_>>();
        let is_load =
            place.0.description().form != Form::Inertia || is_load(&value, &vec![0.0; value.len()]);
        is_load && self.within(place, &entries, &value, &std)
    }
}

/// Whether a mass and its first moment about the body's centre may be a load, within twice their errors: a first moment without
/// a mass is none. At most [`REACH`] away.
fn is_load(value: &[f64], std: &[f64]) -> bool {
    let heaviest = value[0] + 2.0 * std[0];
    let moments = value.iter().zip(std).skip(1).take(3);
    let smallest = moments.map(|(h, std)| (h.abs() - 2.0 * std).max(0.0).powi(2));
    heaviest > 0.0 && smallest.sum::<f64>().sqrt() <= REACH * heaviest
}

/// Standard deviation of an estimate from its values without each fold in turn (Efron & Tibshirani 1993, ch. 11).
pub(super) fn jackknife(values: impl ExactSizeIterator<Item = f64>, centre: f64) -> f64 {
    let n = values.len() as f64;
    let squares: f64 = values.map(|value| (value - centre).powi(2)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

/// A sum over folds, and its standard error from their spread.
pub(crate) fn sum_and_error(folds: &[f64]) -> (f64, f64) {
    let n = folds.len() as f64;
    let sum: f64 = folds.iter().sum();
    let spread: f64 = folds.iter().map(|x| (x - sum / n).powi(2)).sum();
    (sum, (spread * n / (n - 1.0)).sqrt())
}
