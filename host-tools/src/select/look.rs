//! A look at a model: score tests of each limb, made anew where its fit is another, and all candidates that they show.

use std::sync::Arc;

use super::candidate::Candidate;
use super::enumerate::candidates;
use super::score_test::{Screen, possible};
use super::state::State;
use crate::equation::values::Place;
use crate::parallel::side_by_side;

/// The score tests of the limbs, beside the fits of the last model that was looked at.
#[derive(Default)]
pub(super) struct Screens<'a> {
    pub(super) of_limbs: Vec<Screen<'a>>,
    /// Of each limb what its model may lack.
    possible: Vec<Vec<Place>>,
}

impl<'a> Screens<'a> {
    /// Looks at all that a model may lack and was not `given`.
    pub(super) fn look(&mut self, model: &State<'a>, given: &[Vec<Place>]) -> Vec<Candidate> {
        let limbs: Vec<usize> = (0..model.fits.len()).collect();
        let old = &self.of_limbs;
        let made = side_by_side(&limbs, |&n| {
            let fit = &model.fits[n];
            let old = old.get(n);
            // A limb whose fit stays has nothing new to show.
            if old.is_some_and(|screen| Arc::ptr_eq(&screen.fit, fit)) {
                return None;
            }
            let possible = possible(fit, &given[n]);
            let screen = Screen::of(fit.clone(), fit.predicted(), &possible);
            Some((screen.after(old), possible))
        });
        let mut old = std::mem::take(&mut self.of_limbs).into_iter();
        let mut old_possible = std::mem::take(&mut self.possible).into_iter();
        for made in made {
            let known = old.next().zip(old_possible.next());
            if let Some((screen, possible)) = made.or(known) {
                self.of_limbs.push(screen);
                self.possible.push(possible);
            }
        }
        candidates(&self.of_limbs, &self.possible)
    }

    /// How many windows the candidates are judged by.
    pub(super) fn windows(&self) -> f64 {
        let limbs = self.of_limbs.iter();
        limbs.flat_map(|screen| screen.fit.data.windows()).sum()
    }
}
