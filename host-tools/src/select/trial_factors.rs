//! The factors that a score test reads effects off: of all data, of all folds but each, and of each fold.
//!
//! Of each fold two triangles suffice: one of the data of all other folds, active columns first, from which any few candidates are solved for by a
//! small problem in the trailing rows; and the fold's own, in which the solution is scored.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use super::candidate::{Felt, Finding, Scores, Trial};
use crate::equation::column::Columns;
use crate::equation::values::Place;
use crate::estimate::factor::HeapFactor;
use crate::estimate::r_factor::{RFactor, Trial as TriangleTrial, misfit};

/// The factors of a source of rows, over the columns of its model and of all that the model might lack.
pub(crate) struct TrialFactors {
    pub(crate) columns: Columns,
    /// How many of its entries are the model's, which come first.
    active: usize,
    /// The noise of each kind of rows: of a limb's joints, or of all equations of a moving base.
    noise: Vec<f64>,
    /// Each fold's own data, kind by kind.
    tests: Vec<Vec<HeapFactor>>,
    /// Of all data, and of all folds but one.
    all: RFactor,
    trains: Vec<RFactor>,
    /// θ of the model fitted to all folds but one, and the sums of squares of that one's own data under it, kind by kind, (N m)².
    pub(crate) theta: Vec<Vec<f64>>,
    pub(crate) base: Vec<Vec<f64>>,
    /// What was asked for already: a step at one limb leaves the others' as they are.
    trials: Mutex<HashMap<Vec<Place>, Option<Trial>>>,
}

impl TrialFactors {
    /// Of which the first `active` entries of the columns are the model's.
    pub(crate) fn new(
        (columns, active): (Columns, usize),
        noise: Vec<f64>,
        all: RFactor,
        trains: Vec<RFactor>,
        tests: Vec<Vec<HeapFactor>>,
    ) -> Self {
        let theta: Vec<Vec<f64>> = trains.iter().map(|train| train.solve(&[])).collect();
        let score =
            |(test, theta): (&Vec<HeapFactor>, &Vec<f64>)| squares((&columns, active), test, theta);
        Self {
            base: tests.iter().zip(&theta).map(score).collect(),
            trials: Mutex::default(),
            columns,
            active,
            noise,
            tests,
            all,
            trains,
            theta,
        }
    }

    /// What θ leaves of one kind of rows in a fold, (N m)².
    pub(crate) fn left_of(&self, (kind, fold): (usize, usize), theta: &[f64]) -> f64 {
        let test = &self.tests[fold][kind];
        misfit(&self.columns, (kind, test), theta, self.active)
    }

    /// What the data without each fold tell of entries.
    fn by_fold(&self, entries: &[usize]) -> Option<Vec<TriangleTrial>> {
        let trains = self.trains.iter();
        trains.map(|train| train.trial(entries)).collect()
    }

    /// How much each fold's held-out sum of squares falls, in units of the noise and in (N m)², by the `values` that the others tell.
    fn gains(&self, entries: &[usize], values: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
        let folds = self.trains.iter().enumerate().zip(values);
        let gains = folds.map(|((fold, train), value)| {
            let with = entries.iter().copied().zip(value.iter().copied());
            let theta = train.solve(&with.collect::<Vec<_>>());
            let after = squares((&self.columns, self.active), &self.tests[fold], &theta);
            let kinds = self.base[fold].iter().zip(&after).zip(&self.noise);
            kinds.fold((0.0, 0.0), |(gain, fall), ((before, after), noise)| {
                let own = before - after;
                (gain + own / (noise * noise), fall + own)
            })
        });
        gains.unzip()
    }
}

/// Each kind's sum of squares under θ, of which few entries beyond the first `active` are not zero, (N m)².
fn squares((columns, active): (&Columns, usize), test: &[HeapFactor], theta: &[f64]) -> Vec<f64> {
    let kinds = test.iter().enumerate();
    kinds
        .map(|kind| misfit(columns, kind, theta, active))
        .collect()
}

/// What every effect would add to a model, of one source of rows.
pub(crate) trait ScoreTest {
    fn factors(&self) -> &TrialFactors;

    /// The equations that effects at `places`, whose parameters are these entries of θ, enter.
    fn felt(&self, places: &[Place], entries: &[usize]) -> Felt;

    /// What a trial says of the parameters at each of its places, as the catalogue means them.
    fn findings(&self, trial: &Trial) -> Vec<Finding>;

    /// The held-out sum of squares of the model, in units of the noise.
    fn error(&self) -> f64 {
        let factors = self.factors();
        let of = |fold: &Vec<f64>| -> f64 {
            let kinds = fold.iter().zip(&factors.noise);
            kinds.map(|(square, noise)| square / (noise * noise)).sum()
        };
        factors.base.iter().map(of).sum()
    }

    /// What the effects at `places` would add together; `None` if nothing determines them.
    fn trial(&self, places: &[Place]) -> Option<Trial> {
        let trials = &self.factors().trials;
        let known = || trials.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(trial) = known().get(places) {
            return trial.clone();
        }
        let trial = self.new_trial(places);
        known().insert(places.to_vec(), trial.clone());
        trial
    }

    /// The same where nobody has asked before.
    fn new_trial(&self, places: &[Place]) -> Option<Trial> {
        let (factors, entries) = (self.factors(), self.entries(places));
        let by_fold = factors.by_fold(&entries)?;
        let values: Vec<Vec<f64>> = by_fold.iter().map(|trial| trial.value.clone()).collect();
        Some(self.scored(places, factors.all.trial(&entries)?, &values, &by_fold))
    }

    /// The same where the value is another one's to say: that by all data, and for each fold that by the others.
    fn trial_of(&self, places: &[Place], value: &[f64], by_fold: &[Vec<f64>]) -> Option<Trial> {
        let (factors, entries) = (self.factors(), self.entries(places));
        let own = factors.all.trial(&entries)?;
        let away = own.value.iter().zip(value).map(|(own, value)| own - value);
        let lost: f64 = away
            .zip(&own.std)
            .map(|(away, std)| (away / std).powi(2))
            .sum();
        let trial = TriangleTrial {
            value: value.to_vec(),
            fall: (own.fall - lost).max(0.0),
            std: own.std,
        };
        Some(self.scored(places, trial, by_fold, &factors.by_fold(&entries)?))
    }

    /// What the effects at `places` would add to the model with the candidates `others` in it.
    fn trial_beside(&self, places: &[Place], others: &[Place]) -> Option<Trial> {
        let before = self.trial(others)?;
        Some(self.trial(&[others, places].concat())?.beside(&before))
    }

    fn entries(&self, places: &[Place]) -> Vec<usize> {
        let columns = &self.factors().columns;
        let own = places.iter();
        own.flat_map(|&(effect, joint)| columns.of_effect(effect, joint))
            .collect()
    }

    /// Scores a trial by the `values` that each fold is told by the others, which know them as well as their `own` trials do.
    fn scored(
        &self,
        places: &[Place],
        all: TriangleTrial,
        values: &[Vec<f64>],
        own: &[TriangleTrial],
    ) -> Trial {
        let entries = self.entries(places);
        let (gains, falls) = self.factors().gains(&entries, values);
        let felt = self.felt(places, &entries);
        let scores = Scores { gains, falls, felt };
        let mut trial = Trial::of((places, entries), all, values, own, scores);
        trial.findings = self.findings(&trial);
        trial
    }
}
