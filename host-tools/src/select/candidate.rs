//! What a model may lack, over all limbs: an effect at one joint, the same effect at all like joints, or one cause that all joints
//! share.

use proprio_core::effect::{EffectKind, Form};

use super::criteria::{self, Squared};
use super::possible::{is_possible, is_resolved, is_something};
use super::screen::{Screen, Trial};
use crate::equation::motion::is_shared;
use crate::equation::values::Place;
use crate::model::BASE;

/// An effect at a joint of a limb, the limb by its place among those recorded.
pub(crate) type Member = (usize, Place);

/// What an effect would add to the model.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) effect: EffectKind,
    pub(crate) members: Vec<Member>,
    /// How much each fold's held-out sum of squares falls: in units of the joints' noise, and in (N m)².
    pub(crate) gains: Vec<f64>,
    pub(crate) falls: Vec<f64>,
    /// The held-out sum of squares before of the joints that feel it, in units of their noise.
    felt: f64,
    /// Sum of squares of the torque of the joints that feel it, (N m)².
    torque: f64,
    /// How much all data's sum of squares falls, as far as windows are independent.
    pub(crate) fall: f64,
    pub(crate) sure: Squared,
    /// One of so many candidates.
    pub(crate) tried: usize,
    /// Of each limb.
    pub(crate) trials: Vec<(usize, Trial)>,
}

impl Candidate {
    pub(crate) fn of(
        effect: EffectKind,
        trials: Vec<(usize, Trial)>,
        tried: usize,
    ) -> Option<Self> {
        let members = trials
            .iter()
            .flat_map(|(limb, t)| t.places.iter().map(|place| (*limb, *place)));
        let sum = |of: &dyn Fn(&Trial) -> &Vec<f64>| {
            let folds = trials.iter().map(|(_, t)| of(t).len()).max().unwrap_or(0);
            let fold = |f: usize| trials.iter().filter_map(|(_, t)| of(t).get(f)).sum::<f64>();
            (0..folds).map(fold).collect::<Vec<_>>()
        };
        let sure = trials.iter().map(|(_, t)| t.sure).reduce(Squared::and)?;
        Some(Self {
            effect,
            members: members.collect(),
            gains: sum(&|t| &t.gains),
            falls: sum(&|t| &t.falls),
            felt: trials.iter().map(|(_, t)| t.felt).sum(),
            torque: trials.iter().map(|(_, t)| t.torque).sum(),
            fall: trials.iter().map(|(_, t)| t.fall).sum(),
            sure,
            tried,
            trials,
        })
    }

    /// The held-out gain over all folds, in units of the joints' noise, and its error from their spread.
    pub(crate) fn gain(&self) -> (f64, f64) {
        criteria::sum_and_error(&self.gains)
    }

    /// 1 − the held-out sum of squares with it over that without, of the joints that feel it, and its error.
    pub(crate) fn held_out_gain(&self) -> (f64, f64) {
        let (gain, error) = self.gain();
        (gain / self.felt, error / self.felt)
    }

    /// By how much the held-out sum of squares falls, (N m)².
    pub(crate) fn torque_error_taken(&self) -> f64 {
        self.falls.iter().sum()
    }

    /// Size in units of its standard deviation, as a normal variable has it.
    pub(crate) fn z(&self) -> f64 {
        self.sure.z()
    }

    /// How many numbers it adds to a model, scanned ones included.
    pub(crate) fn parameters(&self) -> f64 {
        let own = self.effect.description().parameters.len() as f64;
        if self.is_shared() {
            own
        } else {
            own * self.members.len() as f64
        }
    }

    /// Whether it is one cause of all joints.
    pub(crate) fn is_shared(&self) -> bool {
        self.members.iter().any(|(_, place)| is_shared(place.1))
    }

    /// Whether another one is at some of the same joints.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.members.iter().any(|member| other.is_at(member))
    }

    /// Whether another one is at all of its joints: what a wider one explains elsewhere says nothing of what it does here.
    pub(crate) fn is_within(&self, other: &Self) -> bool {
        self.members.iter().all(|member| other.is_at(member))
    }

    fn is_at(&self, &(limb, place): &Member) -> bool {
        (self.members.iter())
            .any(|(l, p)| *l == limb && (p.1 == place.1 || is_shared(p.1) || is_shared(place.1)))
    }

    /// Whether it is there beyond chance.
    pub(crate) fn is_beyond_chance(&self) -> bool {
        let (gain, error) = self.gain();
        let most =
            gain > criteria::MOST_BY_CHANCE * self.felt && gain > criteria::LEAST_OF_MOST * error;
        most || (self.z() >= criteria::least_z(self.tried) && gain > error)
    }

    /// Whether it is there beyond chance and worth a place in the model, whatever its value.
    pub(crate) fn is_there(&self) -> bool {
        let (gain, _) = self.gain();
        let harm: f64 = self.gains.iter().map(|gain| gain.min(0.0)).sum();
        self.is_beyond_chance()
            && -harm < criteria::MOST_HARM * (gain - harm)
            && self.held_out_gain().0 > least_gain(self.effect)
            && (self.torque_error_taken() > criteria::LEAST_EFFECT.powi(2) * self.torque
                || acts_by_weight(self.effect) && self.held_out_gain().0 > criteria::SURE_GAIN)
    }

    /// Whether it is a delay too small to be told from how the torque runs between two samples.
    pub(crate) fn is_unresolved_delay(&self, screens: &[Screen]) -> bool {
        let small = |(limb, trial): &(usize, Trial)| {
            let screen = &screens[*limb];
            trial.places.iter().all(|&place| {
                let delay = screen.parameter(trial, place, 0);
                delay.is_some_and(|(d, _)| !is_resolved(screen.fit.data.recording.period(), d))
            })
        };
        self.effect == EffectKind::Delay && self.is_there() && self.trials.iter().all(small)
    }

    /// Whether its values are physical within twice their errors, what a robot can have, and not all nothing.
    pub(crate) fn is_possible(&self, screens: &[Screen]) -> bool {
        let mut places = (self.trials.iter())
            .flat_map(|(limb, trial)| trial.places.iter().map(move |place| (*limb, trial, *place)));
        places
            .clone()
            .all(|(limb, trial, place)| is_possible(&screens[limb], trial, place))
            && places.any(|(limb, trial, place)| is_something(&screens[limb], trial, place))
    }
}

/// All that the limbs' models may lack: every effect at every joint, families, and shared causes.
pub(crate) fn candidates(screens: &[Screen], possible: &[Vec<Place>]) -> Vec<Candidate> {
    use rayon::prelude::*;
    let mut sets: Vec<Joints> = Vec::new();
    for (limb, places) in possible.iter().enumerate() {
        for &place in places.iter().filter(|place| !is_shared(place.1)) {
            sets.push((place.0, vec![(limb, vec![place])]));
        }
    }
    sets.extend(families(possible));
    let tried = sets.len();
    let mut all: Vec<Candidate> = sets
        .into_par_iter()
        .filter_map(|(effect, set)| {
            let trial =
                |(limb, places): (usize, Vec<Place>)| Some((limb, screens[limb].trial(&places)?));
            Candidate::of(
                effect,
                set.into_iter().map(trial).collect::<Option<_>>()?,
                tried,
            )
        })
        .collect();
    for effect in [EffectKind::Delay, EffectKind::BaseTilt] {
        all.extend(shared(screens, possible, effect, tried));
    }
    all
}

/// An effect at a set of joints, limb by limb.
type Joints = (EffectKind, Vec<(usize, Vec<Place>)>);

/// The sets of joints that are alike: all, and those at the same place of limbs of the same length.
fn families(possible: &[Vec<Place>]) -> Vec<Joints> {
    let mut found = Vec::new();
    for &effect in EffectKind::ALL {
        // What happens to one body, one sensor or one worn gear is no property of a kind of drive; a delay that many have is one for
        // all.
        let one = [
            EffectKind::EncoderOffset,
            EffectKind::Backlash,
            EffectKind::AsymmetricCoulomb,
            EffectKind::Delay,
        ];
        if effect.description().form == Form::Inertia || one.contains(&effect) {
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
        let joints = all
            .iter()
            .flat_map(|(_, p)| p.iter().map(|p| p.1 + 1))
            .max()
            .unwrap_or(0);
        if joints > 1 && members > 1 {
            found.push((effect, all.clone()));
        }
        for joint in 0..joints {
            let like: Vec<(usize, Vec<Place>)> = (all.iter())
                .filter(|(_, places)| places.contains(&(effect, joint)))
                .map(|(limb, _)| (*limb, vec![(effect, joint)]))
                .collect();
            if like.len() > 1 {
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
    for (_, trial) in &mut candidate.trials {
        trial.std.clone_from(&std);
    }
    Some(candidate)
}

/// Whether a family stands: without its best member it still is beyond chance, and it takes away more than that one alone,
/// beyond the error of that.
pub(crate) fn is_family(candidate: &Candidate, singles: &[Candidate]) -> bool {
    let own: Vec<&Candidate> = (singles.iter())
        .filter(|c| {
            c.effect == candidate.effect
                && c.members.len() == 1
                && candidate.members.contains(&c.members[0])
        })
        .collect();
    let Some(best) = own.iter().max_by(|a, b| a.gain().0.total_cmp(&b.gain().0)) else {
        return true;
    };
    let rest = own.iter().filter(|c| c.members != best.members);
    let sure = rest.clone().map(|c| c.sure).reduce(Squared::and);
    let gain: f64 = rest.clone().map(|c| c.gain().0).sum();
    let helped = own.iter().filter(|c| c.gain().0 > 0.0).count();
    let more: Vec<f64> = (candidate.gains.iter().zip(&best.gains))
        .map(|(all, best)| all - best)
        .collect();
    let (more, error) = criteria::sum_and_error(&more);
    more > error
        && gain > 0.0
        && 2 * helped > own.len()
        && sure.is_some_and(|sure| sure.z() >= criteria::LEAST_Z)
}

/// Smallest share of the held-out error that is worth a parameter.
fn least_gain(effect: EffectKind) -> f64 {
    use EffectKind::{Bias, Saturation, Spring};
    if acts_by_weight(effect) || [Bias, Spring, Saturation].contains(&effect) {
        criteria::LEAST_GAIN_OF_SLOW
    } else {
        criteria::LEAST_GAIN
    }
}

/// Whether an effect acts by the weight of the bodies: what happens between two samples, or where friction turns round, does not look
/// like it.
pub(super) fn acts_by_weight(effect: EffectKind) -> bool {
    use EffectKind::{BaseTilt, EncoderOffset, Payload};
    [BaseTilt, EncoderOffset, Payload].contains(&effect)
}
