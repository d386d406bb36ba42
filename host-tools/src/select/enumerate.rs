//! Every effect that the limbs' models may lack, at one joint, at like joints, and as one cause that all joints share.

use proprio_core::effect::{EffectKind, Reach};

use super::candidate::{Candidate, Trial};
use super::criteria::statistics::Squared;
use super::score_test::Screen;
use super::trial_factors::ScoreTest;
use crate::catalogue;
use crate::equation::values::{Place, is_shared};
use crate::model::BASE;
use crate::parallel::side_by_side;

/// All that the limbs' models may lack: every effect at every joint, families, and shared causes.
pub(crate) fn candidates(screens: &[Screen], possible: &[Vec<Place>]) -> Vec<Candidate> {
    let own: Vec<Vec<Place>> = (possible.iter())
        .map(|places| {
            let own = places.iter().filter(|place| !is_shared(place.1));
            own.copied().collect()
        })
        .collect();
    let trial = |limb: usize, places: &[Place]| screens[limb].trial(places);
    let (mut all, tried) = of_joints(&trial, &own, &|joint| joint);
    for effect in effects_of(possible) {
        all.extend(shared(screens, possible, effect, tried));
    }
    all
}

/// Every effect at every joint, and families of joints whose `kind` is the same; and how many sets of joints were tried. `trial` tells of a limb what
/// effects would add.
pub(crate) fn of_joints(
    trial: &(dyn Fn(usize, &[Place]) -> Option<Trial> + Sync),
    possible: &[Vec<Place>],
    kind: &dyn Fn(usize) -> usize,
) -> (Vec<Candidate>, usize) {
    let mut sets: Vec<Joints> = Vec::new();
    for (limb, places) in possible.iter().enumerate() {
        for &place in places {
            sets.push((place.0, vec![(limb, vec![place])]));
        }
    }
    sets.extend(families(possible, kind));
    let tried = sets.len();
    let all = side_by_side(&sets, |(effect, set)| {
        let trial = |(limb, places): &(usize, Vec<Place>)| Some((*limb, trial(*limb, places)?));
        Candidate::of(
            *effect,
            set.iter().map(trial).collect::<Option<_>>()?,
            tried,
        )
    });
    (all.into_iter().flatten().collect(), tried)
}

/// The effects that are possible anywhere, each once, in the catalogue's order.
fn effects_of(possible: &[Vec<Place>]) -> Vec<EffectKind> {
    let mut effects: Vec<EffectKind> = Vec::new();
    for (effect, _) in possible.iter().flatten() {
        if !effects.contains(effect) {
            effects.push(*effect);
        }
    }
    effects.sort_by_cached_key(|effect| catalogue::order(*effect));
    effects
}

/// An effect at a set of joints, limb by limb.
type Joints = (EffectKind, Vec<(usize, Vec<Place>)>);

/// The sets of joints that are alike: all, and those at the same place of limbs of the same length.
fn families(possible: &[Vec<Place>], kind: &dyn Fn(usize) -> usize) -> Vec<Joints> {
    let mut found = Vec::new();
    for effect in effects_of(possible) {
        if effect.description().reach != Reach::Family {
            continue;
        }
        let own = |places: &Vec<Place>| -> Vec<Place> {
            places
                .iter()
                .copied()
                .filter(|p| p.0 == effect && !is_shared(p.1))
                .collect()
        };
        let all: Vec<(usize, Vec<Place>)> = (possible.iter().enumerate())
            .map(|(limb, places)| (limb, own(places)))
            .filter(|(_, places)| !places.is_empty())
            .collect();
        let members: usize = all.iter().map(|(_, places)| places.len()).sum();
        let kinds = all
            .iter()
            .flat_map(|(_, p)| p.iter().map(|p| kind(p.1) + 1))
            .max()
            .unwrap_or(0);
        if kinds > 1 && members > 1 {
            found.push((effect, all.clone()));
        }
        for own_kind in 0..kinds {
            let alike = |places: &Vec<Place>| -> Vec<Place> {
                let own = places.iter().filter(|place| kind(place.1) == own_kind);
                own.copied().collect()
            };
            let like: Vec<(usize, Vec<Place>)> = (all.iter())
                .map(|(limb, places)| (*limb, alike(places)))
                .filter(|(_, places)| !places.is_empty())
                .collect();
            if like.iter().map(|(_, places)| places.len()).sum::<usize>() > 1 {
                found.push((effect, like));
            }
        }
    }
    found
}

/// One value for all limbs: the mean weighted by their errors, of all data and of each fold.
fn shared(
    screens: &[Screen],
    possible: &[Vec<Place>],
    effect: EffectKind,
    tried: usize,
) -> Option<Candidate> {
    let place = (effect, BASE);
    // Only what all joints may share is possible at the base.
    if !possible.iter().all(|places| places.contains(&place)) || screens.is_empty() {
        return None;
    }
    let trials: Vec<Trial> = screens
        .iter()
        .map(|screen| screen.trial(&[place]))
        .collect::<Option<_>>()?;
    let (parameters, folds) = (trials[0].value.len(), trials[0].by_fold.len());
    if trials.iter().any(|trial| trial.by_fold.len() != folds) {
        return None;
    }
    let mean = |of: &dyn Fn(&Trial) -> &Vec<f64>| -> Vec<f64> {
        let number = |n: usize| {
            let weight = |trial: &Trial| trial.std[n].powi(-2);
            let sum: f64 = trials
                .iter()
                .map(|trial| weight(trial) * of(trial)[n])
                .sum();
            sum / trials.iter().map(weight).sum::<f64>()
        };
        (0..parameters).map(number).collect()
    };
    let value = mean(&|trial| &trial.value);
    let by_fold: Vec<Vec<f64>> = (0..folds)
        .map(|f| mean(&|trial| &trial.by_fold[f]))
        .collect();
    let std: Vec<f64> = (0..parameters)
        .map(|n| {
            trials
                .iter()
                .map(|trial| trial.std[n].powi(-2))
                .sum::<f64>()
                .powf(-0.5)
        })
        .collect();
    let of = |(limb, screen): (usize, &Screen)| {
        Some((limb, screen.trial_of(&[place], &value, &by_fold)?))
    };
    let own: Vec<(usize, Trial)> = screens.iter().enumerate().map(of).collect::<Option<_>>()?;
    let mut candidate = Candidate::of(effect, own, tried)?;
    candidate.sure = Squared {
        size: value
            .iter()
            .zip(&std)
            .map(|(value, std)| (value / std).powi(2))
            .sum(),
        freedom: parameters as f64,
        tried: 1.0,
    };
    for (limb, trial) in &mut candidate.trials {
        trial.std.clone_from(&std);
        trial.findings = screens[*limb].findings(trial);
    }
    Some(candidate)
}
