//! Leaving a contact out.

use super::Contact;
use crate::equation::values::{Place, places};
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::parallel::side_by_side;

/// Windows of swing that the other effects need at least: 4 s.
const LEAST_WINDOWS: f64 = 200.0;

/// A limb in contact, whose windows in contact are left out.
#[derive(Debug, Clone)]
pub(crate) struct LeftOut {
    pub(crate) contact: Contact,
    /// Whether the model has the contact already.
    pub(crate) known: bool,
    /// Whether too few windows remain to judge any other effect.
    pub(crate) too_little_swing: bool,
}

/// Limbs without the windows in which the ground carries their feet, and what was found at each foot.
pub(crate) fn leave_out_contact(data: Vec<LimbData>) -> (Vec<LimbData>, Vec<Option<LeftOut>>) {
    let swings = side_by_side(&data, |limb| swing(limb.clone()));
    swings.into_iter().unzip()
}

/// Looks for a contact under a limb's own effects; where there is one, the data without its windows, and what was found.
fn swing<'a>(data: LimbData<'a>) -> (LimbData<'a>, Option<LeftOut>) {
    let own: Vec<Place> = places(data.model, data.limb)
        .map(|(place, _)| place)
        .collect();
    let fitted: Vec<Place> = own
        .iter()
        .copied()
        .filter(|place| data.can_tell(*place))
        .collect();
    let contact = LimbFit::of(&data, &fitted, &How::default()).and_then(|fit| Contact::of(&fit));
    let Some(contact) = contact else {
        return (data, None);
    };
    let data = data.without(&contact.samples);
    let left = data.windows();
    let folds = data.blocks.folds;
    let bare = |fold: usize| {
        let count = |j: usize| {
            let windows = 0..data.motion.windows.len();
            windows
                .filter(|&w| data.fold(w) == fold && data.counts(w, j))
                .count()
        };
        (0..data.joints()).any(|j| (count(j) as f64) < LEAST_WINDOWS / folds as f64 / 2.0)
    };
    let last = data.joints() - 1;
    let left_out = LeftOut {
        known: own.contains(&(Contact::EFFECT, last)),
        too_little_swing: left.iter().any(|n| *n < LEAST_WINDOWS) || (0..folds).any(bare),
        contact,
    };
    (data, Some(left_out))
}
