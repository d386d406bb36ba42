//! Loads as candidates where they are.
//!
//! A load's columns are those of a mass at the body's centre and, to first order, away from it. Far from the centre the inertia that
//! goes with the square of the distance is missing: what a motion shows of that the columns take for another mass, and the load for
//! one that cannot be, or for one beside which there is an encoder's offset. Where a trial says that a load is there, its columns are
//! therefore made again at the place that the trial says, as a fit does at each pass.

use nalgebra::Vector3;
use proprio_core::effect::Form;

use super::candidate::Candidate;
use super::criteria::feasible::{NEAR, REACH};
use super::criteria::presence::is_there;
use super::score_test::Screen;
use super::trial_factors::ScoreTest;
use crate::equation::values::{LEAST_LOAD, Place, Values};

impl Screen<'_> {
    /// Moves the loads that are there, whose columns were made elsewhere, in `at`; whether there is one.
    pub(super) fn move_loads(&self, possible: &[Place], at: &mut Values) -> bool {
        let loads = possible
            .iter()
            .filter(|p| p.0.description().form == Form::Inertia);
        let found: Vec<_> = loads
            .filter_map(|&place| Some((place, self.moved_load(place)?)))
            .collect();
        for (place, away) in &found {
            put(at, *place, away);
        }
        !found.is_empty()
    }

    /// How far from its body's centre a load is, m, that is there and not where its columns were made. A mass that is not told leaves the
    /// place open, too.
    fn moved_load(&self, place: Place) -> Option<Vector3<f64>> {
        let trial = self.trial(&[place])?;
        let told = trial.findings.first()?;
        let number = |n: usize| Some(told.parameters[n]?.0);
        let mass = number(0)?;
        let moment = Vector3::new(number(1)?, number(2)?, number(3)?);
        if mass < LEAST_LOAD || !is_there(&Candidate::of(place.0, vec![(0, trial)], 1)?) {
            return None;
        }
        let away = (moment / mass).cap_magnitude(REACH);
        let known = self.at().load_at(place.1, &Vector3::zeros());
        ((away - known).norm() > NEAR).then_some(away)
    }
}

/// Puts a load `away` from its body's centre. The least mass that is anywhere stands for it: columns of other effects do not feel it.
fn put(at: &mut Values, place: Place, away: &Vector3<f64>) {
    at.insert(place);
    at.set(place, 0, LEAST_LOAD);
    for n in 0..3 {
        at.set(place, 1 + n, LEAST_LOAD * away[n]);
    }
}
