//! What an effect would add to the model, as plain data: the rules ([`super::criteria`]) see nothing else.

use proprio_core::effect::EffectKind;

use super::criteria::statistics::{Squared, jackknife, sum_and_error};
use crate::equation::values::{Place, is_shared};
use crate::estimate::grid;
use crate::estimate::r_factor::Trial as TriangleTrial;

/// An effect at a joint of a limb, the limb by its place among those recorded.
pub(crate) type Member = (usize, Place);

/// What an effect, or one effect at several joints of a limb, would add to the limb's model.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trial {
    pub(crate) places: Vec<Place>,
    /// θ's entries of its parameters.
    pub(crate) entries: Vec<usize>,
    /// How much each fold's held-out sum of squares falls, in units of the joints' noise.
    pub(crate) gains: Vec<f64>,
    /// The same in (N m)².
    pub(crate) falls: Vec<f64>,
    /// Held-out sum of squares without it of the joints that feel it, in units of their noise.
    pub(crate) felt: f64,
    /// Sum of squares of the torque of the joints that feel it, (N m)².
    pub(crate) torque: f64,
    /// Its parameters by all data, as the columns have them.
    pub(crate) value: Vec<f64>,
    /// By the data of all folds but one, fold by fold.
    pub(crate) by_fold: Vec<Vec<f64>>,
    /// Their standard deviations: the larger of what independent residuals give, memory included, and of the spread over folds.
    pub(crate) std: Vec<f64>,
    /// How much the sum of squares of all data falls, the priors included, as far as windows are independent.
    pub(crate) fall: f64,
    /// The same as the spread over folds has it: the smaller where they agree less than chance lets them.
    pub(crate) sure: Squared,
    /// What it says of each of its places, in their order.
    pub(crate) findings: Vec<Finding>,
}

/// What a trial says of an effect's parameters at one place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Finding {
    pub(crate) place: Place,
    /// Each parameter's value, as the catalogue means it, and its standard deviation; none of one that no column tells.
    pub(crate) parameters: Vec<Option<(f64, f64)>>,
    /// Each parameter's mean and standard deviation before any data.
    pub(crate) prior: Vec<(f64, f64)>,
    /// The nonlinear parameter that its columns were made with; zero if it has none.
    pub(crate) nonlinear: f64,
    /// The log's sampling period, s.
    pub(crate) period: f64,
    /// Of a limit of torque: of each N m that is reported beyond it, how much the motion shows.
    pub(crate) beyond_limit: Option<f64>,
}

/// What an effect would add to the model of all limbs: at one joint, at like joints, or as one cause of all.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) effect: EffectKind,
    pub(crate) members: Vec<Member>,
    /// How much each fold's held-out sum of squares falls: in units of the joints' noise, and in (N m)².
    pub(crate) gains: Vec<f64>,
    pub(crate) falls: Vec<f64>,
    /// The held-out sum of squares without it of the joints that feel it, in units of their noise.
    pub(crate) felt: f64,
    /// Sum of squares of the torque of the joints that feel it, (N m)².
    pub(crate) torque: f64,
    /// How much all data's sum of squares falls, as far as windows are independent.
    pub(crate) fall: f64,
    pub(crate) sure: Squared,
    /// One of so many candidates.
    pub(crate) tried: usize,
    /// Of each limb.
    pub(crate) trials: Vec<(usize, Trial)>,
}

/// The equations that effects enter.
pub(crate) struct Felt {
    /// Held-out sum of squares without them, in units of the noise.
    pub(crate) squares: f64,
    /// Sum of squares of the torque, (N m)².
    pub(crate) torque: f64,
    /// How many neighbouring windows say the same thing.
    pub(crate) memory: f64,
}

/// How a trial predicts each fold, and the rows that feel it.
pub(crate) struct Scores {
    /// As [`Trial`] has them.
    pub(crate) gains: Vec<f64>,
    pub(crate) falls: Vec<f64>,
    pub(crate) felt: Felt,
}

impl Trial {
    /// By what all data say, the `values` that each fold is told by the others, and how surely the others know them by their `own` trials; without
    /// findings.
    pub(crate) fn of(
        (places, entries): (&[Place], Vec<usize>),
        all: TriangleTrial,
        values: &[Vec<f64>],
        own: &[TriangleTrial],
        scores: Scores,
    ) -> Self {
        let memory = scores.felt.memory;
        let (mut std, mut inflation) = (Vec::new(), 1.0f64);
        for (n, (value, independent)) in all.value.iter().zip(&all.std).enumerate() {
            let looser = own.iter().map(|trial| trial.std[n] / independent);
            let by_fold = values.iter().map(|v| v[n]).zip(looser);
            let spread = jackknife(by_fold, *value);
            let independent = independent * memory.sqrt();
            inflation = inflation.max(spread / independent);
            std.push(independent.max(spread));
        }
        let tried: f64 = places.iter().map(|place| grid::tried(place.0)).product();
        Self {
            places: places.to_vec(),
            findings: Vec::new(),
            gains: scores.gains,
            falls: scores.falls,
            felt: scores.felt.squares,
            torque: scores.felt.torque,
            value: all.value,
            std,
            by_fold: values.to_vec(),
            fall: all.fall / memory,
            sure: Squared {
                size: all.fall / memory / (inflation * inflation),
                freedom: entries.len() as f64,
                tried,
            },
            entries,
        }
    }

    /// What it adds to a model with another one in it, whose places are the first of its own.
    pub(crate) fn beside(mut self, before: &Self) -> Self {
        let (known, others) = (before.entries.len(), before.places.len());
        self.places.drain(..others);
        self.findings.drain(..others);
        self.entries.drain(..known);
        self.value.drain(..known);
        self.std.drain(..known);
        self.by_fold
            .iter_mut()
            .for_each(|values| drop(values.drain(..known)));
        let fall = (self.fall - before.fall).max(0.0);
        let tried = self.places.iter().map(|place| grid::tried(place.0));
        self.sure = Squared {
            size: self.sure.size * fall / self.fall.max(f64::MIN_POSITIVE),
            freedom: self.entries.len() as f64,
            tried: tried.product(),
        };
        self.fall = fall;
        for (after, before) in [
            (&mut self.gains, &before.gains),
            (&mut self.falls, &before.falls),
        ] {
            after
                .iter_mut()
                .zip(before)
                .for_each(|(after, before)| *after -= before);
        }
        self
    }
}

/// Of a limb, what the first places add to its model with the others in it.
type TrialBeside<'a> = dyn Fn(usize, &[Place], &[Place]) -> Option<Trial> + 'a;

impl Candidate {
    /// What it adds to the limbs' models with another one in them.
    pub(crate) fn beside(&self, other: &Self, trial: &TrialBeside<'_>) -> Option<Self> {
        let of = |(limb, own): &(usize, Trial)| {
            let there = other.trials.iter().find(|(l, _)| l == limb);
            let trial = match there {
                None => own.clone(),
                Some((_, with)) => trial(*limb, &own.places, &with.places)?,
            };
            Some((*limb, trial))
        };
        let trials: Option<Vec<_>> = self.trials.iter().map(of).collect();
        Self::of(self.effect, trials?, self.tried)
    }

    /// The sum of an effect's trials at the limbs, one of `tried` candidates; none of no trial.
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
        sum_and_error(&self.gains)
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

    /// What it says of its members, in their order.
    pub(crate) fn findings(&self) -> impl Iterator<Item = &Finding> {
        self.trials.iter().flat_map(|(_, trial)| &trial.findings)
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

    /// Whether it is the same effect at the same joints.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.effect == other.effect && self.members == other.members
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
}
