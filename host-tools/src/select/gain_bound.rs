//! What a spring or a play can take away at most, told without a fit: a fit with one predicts the whole limb some thirty times.
//!
//! A spring of each resonance and a play of each width that a fit would try moves the link in its own way. What that changes of the
//! torques, to first order, stands beside the model's columns; between two values that are
//! tried, the mean that does best.

use std::sync::{Arc, OnceLock};

use proprio_core::effect::EffectKind;

use crate::equation::link_response::Responses;
use crate::equation::values::Place;
use crate::estimate::added_variables::LeftOver;
use crate::estimate::compliance_scan::values_to_try;
use crate::estimate::fit::LimbFit;
use crate::once::made_once;
use crate::parallel::side_by_side;

/// The responses of a limb's links, worked out when they are asked for and good for all fits whose loads are alike.
pub(crate) struct Links {
    responses: Responses,
    /// Of each joint and each of [`EffectKind::COMPLIANT`], value by value.
    tried: Vec<[OnceLock<Tried>; EffectKind::COMPLIANT.len()]>,
}

/// Sizes of a play or a spring, ascending, and the responses to each.
struct Tried {
    sizes: Vec<f64>,
    responses: Vec<Vec<f64>>,
}

/// What a screen keeps of it.
#[derive(Default)]
pub(crate) struct GainBounds {
    /// Of an earlier fit, if they are good for this one.
    known: Option<Arc<Links>>,
    made: OnceLock<Option<(Arc<Links>, LeftOver)>>,
}

impl GainBounds {
    /// With what another screen of the same limb has worked out.
    pub(super) fn after(other: &Self) -> Self {
        let links = other.made.get().and_then(Option::as_ref);
        Self {
            known: links
                .map(|(links, _)| links.clone())
                .or(other.known.clone()),
            made: OnceLock::new(),
        }
    }

    fn links(&self, fit: &LimbFit, predicted: &[f64]) -> Option<&(Arc<Links>, LeftOver)> {
        let made = || {
            let (data, values) = (fit.data, &fit.values);
            let left = LeftOver::of(fit, predicted)?;
            let known = self.known.clone();
            let known = known.filter(|links| links.responses.hold_for(&data.body, values));
            let links = known.unwrap_or_else(|| {
                Arc::new(Links {
                    responses: Responses::of(&data.motion, &data.body, values, &left.windows),
                    tried: (0..data.joints()).map(|_| Default::default()).collect(),
                })
            });
            Some((links, left))
        };
        made_once(&self.made, made).as_ref()
    }

    /// How much of what a fit that predicts so leaves, a sum of squares in units of the noise, a spring or a play takes away at most, and
    /// of which size it does.
    pub(super) fn most_of_one(
        &self,
        fit: &LimbFit,
        predicted: &[f64],
        place: Place,
    ) -> Option<(f64, f64)> {
        let kind = EffectKind::COMPLIANT
            .iter()
            .position(|effect| *effect == place.0)?;
        let (links, left) = self.links(fit, predicted)?;
        let data = fit.data;
        let Tried { sizes, responses } = made_once(&links.tried[place.1][kind], || {
            let sizes = twice_as_many(&values_to_try(data, &fit.values, place));
            let of = |&size: &f64| links.responses.of_size(place, size);
            let responses = side_by_side(&sizes, of);
            Tried { sizes, responses }
        });
        let nothing = vec![0.0; responses.first()?.len()];
        let ends = |n: usize| match n {
            0 => ((0.0, &nothing), (sizes[0], &responses[0])),
            n => ((sizes[n - 1], &responses[n - 1]), (sizes[n], &responses[n])),
        };
        let between = |n: usize| {
            let ((from, a), (to, b)) = ends(n);
            let (fall, share) = left.fall_between([a, b], data.joints());
            (fall, from + share * (to - from))
        };
        let all = (0..sizes.len()).map(between);
        all.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The same of several at once, each of the size that its column tells, or all as much smaller.
    pub(super) fn most_of_several(
        &self,
        fit: &LimbFit,
        predicted: &[f64],
        places: &[Place],
        sizes: &[f64],
    ) -> Option<f64> {
        let (links, left) = self.links(fit, predicted)?;
        let joints = fit.data.joints();
        let mut together = vec![0.0; links.responses.len()];
        for (place, size) in places.iter().zip(sizes) {
            let own = links.responses.of_size(*place, *size);
            together.iter_mut().zip(own).for_each(|(sum, x)| *sum += x);
        }
        let nothing = vec![0.0; together.len()];
        Some(left.fall_between([&nothing, &together], joints).0)
    }
}

/// Sizes and those between them: springs resonate within a seventh of their frequency, and those that are tried are a quarter apart.
fn twice_as_many(sizes: &[f64]) -> Vec<f64> {
    let between = sizes.windows(2).map(|pair| (pair[0] * pair[1]).sqrt());
    let mut all: Vec<f64> = sizes.iter().copied().chain(between).collect();
    all.sort_unstable_by(f64::total_cmp);
    all
}
