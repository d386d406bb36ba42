//! All limbs of a recording: limbs on a fixed base share nothing but what acts on all joints (a delay, the base's tilt).

use std::sync::Arc;

use proprio_core::effect::EffectKind;

use super::fit::{How, Known, LimbFit};
use super::limb_data::LimbData;
use crate::equation::recoil::recoils;
use crate::equation::values::{Place, Values, is_shared};
use crate::model::{BASE, Limb, Model};
use crate::parallel::side_by_side;
use crate::recording::{LimbRecording, Recording};

/// A value that all limbs share, and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shared {
    pub(crate) effect: EffectKind,
    pub(crate) parameter: usize,
    pub(crate) value: f64,
    pub(crate) std: f64,
}

impl Shared {
    /// The effect, at all joints.
    pub(crate) fn place(&self) -> Place {
        (self.effect, BASE)
    }

    /// How surely its value is known where it is held.
    pub(crate) fn known(&self) -> Known {
        (self.place(), self.parameter, self.std)
    }

    /// Whether both are of the same parameter.
    fn is_of(&self, other: &Self) -> bool {
        (self.effect, self.parameter) == (other.effect, other.parameter)
    }
}

/// Most times that what limbs share is moved: a step is as good as a fit where a torque is nearly linear in it, as it is in a delay.
const MOST_STEPS: usize = 2;

/// The data of all limbs that were recorded.
pub(crate) fn data<'a>(recording: &'a Recording, model: &'a Model) -> Vec<LimbData<'a>> {
    data_of(&recording.limbs, model)
}

/// The same of `limbs`; with what joints feel of a base that these move, where the model has an effect of it.
pub(crate) fn data_of<'a>(
    limbs: &'a [(Limb, LimbRecording)],
    model: &'a Model,
) -> Vec<LimbData<'a>> {
    let limbs: Vec<_> = limbs.iter().collect();
    let of = |(limb, samples): &&'a (Limb, LimbRecording)| LimbData::of(model, limb, samples);
    let mut data: Vec<LimbData> = side_by_side(&limbs, of).into_iter().flatten().collect();
    if (model.effects().iter()).any(|e| e.effect.description().is_of_base()) {
        let motions: Vec<_> = (data.iter()).map(|d| (d.limb, &*d.motion)).collect();
        let all = recoils(model, &motions);
        (data.iter_mut().zip(all)).for_each(|(data, recoil)| data.feel(recoil));
    }
    data
}

/// Fits each limb's effects; `places` are of the limbs in their order. What limbs share is fitted by each, combined by the errors,
/// and held while the rest is fitted again.
pub(crate) fn fit<'a>(
    data: &'a [LimbData<'a>],
    places: &[Vec<Place>],
    how: &How,
) -> (Vec<LimbFit<'a>>, Vec<Shared>) {
    fit_from(data, places, how, &vec![None; data.len()])
}

/// The same from the limbs' own values, where they have any.
pub(crate) fn fit_from<'a>(
    data: &'a [LimbData<'a>],
    places: &[Vec<Place>],
    how: &How,
    start: &[Option<Values>],
) -> (Vec<LimbFit<'a>>, Vec<Shared>) {
    let work: Vec<_> = data
        .iter()
        .zip(places)
        .zip(start)
        .map(|((d, p), s)| (d, p, s))
        .collect();
    let fits = side_by_side(&work, |(data, places, start)| {
        let start = (*start).clone().or_else(|| how.start.clone());
        LimbFit::of(
            data,
            places,
            &How {
                start,
                ..how.clone()
            },
        )
    });
    let fits: Vec<LimbFit> = fits.into_iter().flatten().collect();
    let shared: Vec<Place> = common(places)
        .into_iter()
        .filter(|p| !how.held.contains(p))
        .collect();
    if shared.is_empty() || fits.len() < data.len() {
        return (fits, Vec::new());
    }
    let values: Vec<Shared> = shared
        .iter()
        .flat_map(|&place| combined(&fits, place))
        .collect();
    let limbs: Vec<_> = data.iter().zip(places).collect();
    let starts: Vec<Values> = fits.iter().map(|fit| fit.values.clone()).collect();
    (held(&limbs, &starts, how, &values), values)
}

/// Each limb's fit with what they share held at these values.
fn held<'a>(
    limbs: &[(&'a LimbData<'a>, &Vec<Place>)],
    starts: &[Values],
    how: &How,
    shared: &[Shared],
) -> Vec<LimbFit<'a>> {
    let work: Vec<_> = limbs.iter().zip(starts).collect();
    let fits = side_by_side(&work, |((data, places), start)| {
        let mut start = (*start).clone();
        for one in shared {
            start.set((one.effect, BASE), one.parameter, one.value);
        }
        let places_held = shared.iter().map(Shared::place);
        let how = How {
            start: Some(start),
            held: places_held.chain(how.held.iter().copied()).collect(),
            known: shared.iter().map(Shared::known).collect(),
            ..how.clone()
        };
        LimbFit::of(data, places, &how)
    });
    fits.into_iter().flatten().collect()
}

/// Fits anew those limbs whose effects are not those of `before`, from the values of `start`; all, if what they share changes. What limbs
/// share keeps its value else, so that one limb's trial costs one limb's fit: of a model that is kept, [`fit_from`] gives it the value that
/// suits the whole.
pub(crate) fn refit<'a>(
    data: &'a [LimbData<'a>],
    places: &[Vec<Place>],
    how: &How,
    start: &[Values],
    before: &[Arc<LimbFit<'a>>],
    known: &[Shared],
) -> Option<(Vec<Arc<LimbFit<'a>>>, Vec<Shared>)> {
    let same = |n: usize| {
        let own: Vec<Place> = before[n].values.places().collect();
        own.len() == places[n].len() && own.iter().all(|place| places[n].contains(place))
    };
    let shared = common(places);
    let known_shared = common(
        &before
            .iter()
            .map(|fit| fit.values.places().collect())
            .collect::<Vec<_>>(),
    );
    let starts: Vec<Option<Values>> = start.iter().cloned().map(Some).collect();
    if shared != known_shared {
        let (fits, values) = fit_from(data, places, how, &starts);
        return (fits.len() == data.len())
            .then(|| (fits.into_iter().map(Arc::new).collect(), values));
    }
    let how = How {
        held: shared,
        known: known.iter().map(Shared::known).collect(),
        ..how.clone()
    };
    let limbs: Vec<usize> = (0..data.len()).collect();
    let fits = side_by_side(&limbs, |&n| {
        if same(n) {
            return Some(before[n].clone());
        }
        let how = How {
            start: Some(start[n].clone()),
            ..how.clone()
        };
        LimbFit::of(&data[n], &places[n], &how).map(Arc::new)
    });
    Some((fits.into_iter().collect::<Option<_>>()?, known.to_vec()))
}

/// The fits with what limbs share at the value that suits the whole: where one step from the fits' values, all else free, leaves it, they are as
/// they were. `steady`: a value that moves by fewer standard deviations stays.
pub(crate) fn settle<'a>(
    data: &'a [LimbData<'a>],
    how: &How,
    mut fits: Vec<Arc<LimbFit<'a>>>,
    known: &[Shared],
    steady: f64,
) -> Option<(Vec<Arc<LimbFit<'a>>>, Vec<Shared>)> {
    let mut known = known.to_vec();
    let places: Vec<Vec<Place>> = (fits.iter())
        .map(|fit| fit.values.places().collect())
        .collect();
    let shared = common(&places);
    let own: Vec<_> = data.iter().zip(&places).collect();
    let limbs: Vec<usize> = (0..fits.len()).collect();
    for _ in 0..MOST_STEPS {
        let step = side_by_side(&limbs, |&n| {
            let how = How {
                start: Some(fits[n].values.clone()),
                weights: Some(fits[n].weights.clone()),
                passes: Some(1),
                ..how.clone()
            };
            LimbFit::of(&data[n], &places[n], &how)
        });
        let step: Vec<LimbFit> = step.into_iter().collect::<Option<_>>()?;
        let now: Vec<Shared> = (shared.iter())
            .flat_map(|&place| combined(&step, place))
            .collect();
        let stays = |now: &Shared| {
            let same = known.iter().find(|known| known.is_of(now));
            same.is_some_and(|known| (now.value - known.value).abs() <= steady * now.std)
        };
        if now.iter().all(stays) {
            // Their values stay; how surely they are known is the present model's.
            for known in &mut known {
                let own = now.iter().find(|now| known.is_of(now));
                known.std = own.map_or(known.std, |own| own.std);
            }
            break;
        }
        let starts: Vec<Values> = step.iter().map(|fit| fit.values.clone()).collect();
        let moved = held(&own, &starts, how, &now);
        if moved.len() < fits.len() {
            return None;
        }
        fits = moved.into_iter().map(Arc::new).collect();
        known = now;
    }
    Some((fits, known))
}

/// The effects of limbs that all joints share.
fn common(places: &[Vec<Place>]) -> Vec<Place> {
    let mut shared: Vec<Place> = Vec::new();
    for place in places.iter().flatten().filter(|place| is_shared(place.1)) {
        if !shared.contains(place) {
            shared.push(*place);
        }
    }
    shared
}

/// What the limbs say of an effect that they share: means weighted by their errors, and their errors.
fn combined(fits: &[LimbFit], (effect, joint): Place) -> Vec<Shared> {
    let of = |parameter: usize| {
        let (mut weights, mut sum) = (0.0, 0.0);
        for fit in fits {
            let entries = fit.columns.of_effect(effect, joint);
            let Some(&entry) = entries
                .iter()
                .find(|&&k| fit.columns.entries[k].parameter == parameter)
            else {
                continue;
            };
            let [independent, blocks] = fit.deviations().of_parameter(entry);
            let weight = independent.max(blocks).powi(-2);
            weights += weight;
            sum += weight * fit.value(entry);
        }
        Shared {
            effect,
            parameter,
            value: sum / weights,
            std: weights.powf(-0.5),
        }
    };
    (0..effect.description().parameters.len()).map(of).collect()
}
