//! Drives at their limits, told by the windows below them ([`crate::estimate::limit`]).

use std::sync::{Arc, Weak};

use super::candidate::Member;
use super::criteria::step::is_less;
use super::state::State;
use crate::catalogue;
use crate::estimate::fit::LimbFit;
use crate::estimate::limb_data::LimbData;
use crate::estimate::limit::Limit;
use crate::parallel::{by_number, side_by_side};

/// Fits of which it is known what limits they tell.
#[derive(Default)]
pub(super) struct Sought<'a> {
    fits: Vec<Weak<LimbFit<'a>>>,
}

impl<'a> Sought<'a> {
    /// The limits that a model's fits tell which were not asked before: where nothing has changed since, nothing is found.
    pub(super) fn limits(&mut self, model: &State<'a>) -> Vec<(Member, Limit)> {
        let is_known = |fit: &Arc<LimbFit>| {
            let mut known = self.fits.iter();
            known.any(|known| known.ptr_eq(&Arc::downgrade(fit)))
        };
        let mut all = catalogue::effects();
        let effect = all.find(|effect| effect.description().is_limit());
        let fits = model.fits.iter().enumerate();
        let sought: Vec<_> = fits.filter(|(_, fit)| !is_known(fit)).collect();
        let found = side_by_side(&sought, |(limb, fit)| {
            let predicted = fit.predicted();
            let limit = |joint: usize| {
                let place = (effect?, joint);
                let sought = !fit.values.has(place);
                let limit = sought.then(|| fit.limit(&predicted, joint)).flatten()?;
                Some(((*limb, place), limit))
            };
            by_number(0..fit.data.joints(), limit)
        });
        self.fits
            .extend(sought.iter().map(|(_, fit)| Arc::downgrade(fit)));
        found.into_iter().flatten().flatten().collect()
    }
}

/// The model with a limit, if it is worth a step. Of what is asked for beyond a limit the motion shows nothing: no fold's error falls by much
/// for knowing it, but that of all windows below it does.
pub(super) fn with_limit<'a>(
    data: &'a [LimbData<'a>],
    model: &State<'a>,
    (limb, place): Member,
    limit: &Limit,
) -> Option<State<'a>> {
    let places = model.places_with(&[(limb, place)]);
    let mut start = model.values();
    start[limb].clone_from(&limit.values);
    let after = model.with(data, &places, &start, &[])?;
    let below = |state: &State| state.weighted_below(model, limb, &after.fits[limb]);
    let is_worth = is_less(below(&after), below(model));
    is_worth.then_some(after)
}
