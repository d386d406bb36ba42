//! Two looks for a force: one that shows in each window, and one that shows in runs of them.

use super::{Contact, LEAST_EPISODES, Phase, Search};
use crate::estimate::fit::LimbFit;
use crate::robust::quantile;

/// Share of the windows that a second start leaves out of the fit to swing: a trimmed fit resists so much.
const LIKELY: f64 = 0.4;

/// Where a force is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Look {
    /// In each window.
    Windows,
    /// Also in the medians over runs of windows.
    Runs,
}

impl Look {
    /// How often swing and the fit to it are found anew at most: MuJoCo's weak forces settle in eight.
    pub(super) fn rounds(self) -> usize {
        match self {
            Self::Windows => 6,
            Self::Runs => 12,
        }
    }
}

impl Contact {
    /// What a limb's residuals say; `None` if no contact is significant, or the limb is too short to tell.
    ///
    /// First a force that shows in each window, as that of a leg that stands; then a weak one, of a leg that hangs but for some episodes.
    pub(crate) fn of(fit: &LimbFit) -> Option<Self> {
        let mut looks = [Look::Windows, Look::Runs].into_iter();
        looks.find_map(|look| Self::by(fit, look).filter(Self::is_significant))
    }

    fn by(fit: &LimbFit, look: Look) -> Option<Self> {
        // With the effects of the model alone first, without the columns of a catalogue that it does not have. A force that is no larger
        // than what these have wrong in swing is overlooked.
        let mut own = Search::new(fit, look, false)?;
        let mut has_swing = own.run(None);
        let none = |own: &Search| own.episodes(Phase::Contact).len() < LEAST_EPISODES;
        if look == Look::Runs && has_swing && none(&own) {
            // The fit may have taken the force for swing: once more from the windows that it likes best.
            let likeliest = own.likeliest();
            has_swing = own.run(Some(likeliest));
        }
        if has_swing && none(&own) {
            return None;
        }
        let begin = match look {
            // Little swing is what a leg on the ground has.
            Look::Windows => None,
            Look::Runs if !has_swing => return None,
            Look::Runs => Some(own.phases),
        };
        let mut search = Search::new(fit, look, true)?;
        search.run(begin).then(|| search.judge())?
    }
}

impl Search<'_> {
    /// As if in contact: the windows that the present fit to swing explains worst, as many as a leg that walks may have in stance.
    fn likeliest(&self) -> Vec<Phase> {
        let deviations: Vec<f64> = (0..self.windows.len())
            .map(|w| self.runs.deviation(w))
            .collect();
        let least = quantile(deviations.iter().copied(), 1.0 - LIKELY).unwrap_or(f64::INFINITY);
        let phase = |d: f64| match d >= least {
            true => Phase::Contact,
            false => Phase::Swing,
        };
        deviations.into_iter().map(phase).collect()
    }
}
