//! One limb's way: effect after effect into its model, those that mislead out again.

use proprio_core::effect::EffectKind;

use super::super::limb::{Candidate, LimbCriticism, Place, Squares, weighted};
use super::refused::Refused;
use super::{Judged, Path, Step, best, first, is_significant, total, unphysical};

/// Most effects that a limb is given.
const MOST_STEPS: usize = 16;
/// Most effects that are tried, those that did not stay included.
const MOST_TRIES: usize = 64;
/// Most times that the data are gone over again.
const MOST_POLISHES: usize = 6;
/// They are gone over once more while that makes the held-out error smaller by this factor.
const WORTH_POLISHING: f64 = 0.98;
/// Going over the data again may make the held-out sum of squares larger by this factor,
const MOST_RISE: f64 = 1.01;
/// unless an effect keeps at least this share of what its derivative promised.
const LEAST_KEPT: f64 = 0.5;
/// No step may make a log's held-out sum of squares larger by this factor: a comparison shows four digits, which stay the same.
const MOST_RISE_OF_LOG: f64 = 1.001;

/// Goes the whole way for one limb.
pub(crate) fn walk(limb: &mut LimbCriticism) -> Path {
    let (mut first, start) = first(limb);
    let significant = first.iter().find(|j| j.significant);
    let mut next = significant.map(|j| j.candidate.place);
    let mut walk = Walk {
        limb,
        steps: Vec::new(),
        refused: Refused::default(),
        polishes: 0,
        start: start.clone(),
    };
    let mut is_settled = false;
    for _ in 0..MOST_TRIES {
        match next {
            Some(place) => {
                if let Some(settled) = walk.step(place, &mut first) {
                    is_settled = settled;
                }
            }
            // Where logs are held out, nothing changes that has not been judged log by log.
            None if !is_settled && !walk.limb.blocks.by_log && walk.settle() => is_settled = true,
            None => break,
        }
        next = walk.next();
    }
    // Where logs are held out, each step is kept for the sake of every one of them.
    if !walk.limb.blocks.by_log {
        walk.prune();
    }
    Path {
        unphysical: unphysical(walk.limb),
        first,
        after_velocity: start.clone(),
        start,
        steps: walk.steps,
    }
}

/// A limb's way so far.
pub(super) struct Walk<'a, 'b> {
    pub(super) limb: &'a mut LimbCriticism<'b>,
    pub(super) steps: Vec<Step>,
    pub(super) refused: Refused,
    polishes: usize,
    /// Held-out sums of squares before the first step, (N m)².
    pub(super) start: Squares,
}

impl Walk<'_, '_> {
    /// The effect to be taken next.
    fn next(&self) -> Option<Place> {
        if self.steps.len() >= MOST_STEPS {
            return None;
        }
        let candidates = self.limb.candidates(None);
        let is_good = |c: &&Candidate| !self.refused.has(c.place) && is_significant(self.limb, c);
        best(
            self.limb,
            &candidates.iter().filter(is_good).collect::<Vec<_>>(),
        )
    }

    /// Takes an effect into the model, what is to be found with it and, if that is worth it, keeps it. Whether the data have been
    /// gone over again then; `None` if the effect did not keep what it promised. `first` names play where it stands for a lag.
    fn step(&mut self, place: Place, first: &mut [Judged]) -> Option<bool> {
        let last = self.steps.last();
        let before = last.map_or(&self.start, |step| &step.squares).clone();
        let noise = self.limb.fit.noise.clone();
        let steps = self.steps.len();
        if !self.take(place) {
            return None;
        }
        // What a wrong shape leaves looks like other effects.
        let is_elastic = place.0 == EffectKind::Elasticity;
        let is_settled = is_elastic || place.0.description().shape().is_some();
        if is_settled {
            self.settle();
        }
        self.judge_lag(place, first);
        // Whitened rows have told already what a column is worth that stays as it is.
        let is_other = self.steps.last().is_some_and(|step| step.place != place);
        let changes = is_settled || is_other || self.limb.is_correction(place);
        if self.steps.len() > steps && (self.limb.blocks.by_log || changes) {
            self.take_back_if_worse(&before, &noise);
        }
        if self.steps.len() > steps {
            self.refused.another_is_kept();
        }
        Some(is_settled)
    }

    pub(super) fn push(&mut self, place: Place, removed: bool) {
        self.steps.push(Step {
            place,
            squares: self.limb.fit.held_out_squares.clone(),
            removed,
        });
    }

    /// Takes an effect into the model, if it keeps what it promised.
    fn take(&mut self, place: Place) -> bool {
        let noise = self.limb.fit.noise.clone();
        let before = weighted(&total(&self.limb.fit.rss), &noise);
        self.limb.add(place);
        let keeps =
            self.limb.is_physical(place) && weighted(&total(&self.limb.fit.rss), &noise) < before;
        if keeps {
            self.push(place, false);
        } else {
            self.limb.remove(place);
            self.refused.until_another_is_kept(place);
        }
        keeps
    }

    /// Takes the last effect out again if what has come of it predicts worse than `before`: the whole of a single log, in units of
    /// the joints' noise (N m), or any of several, each by the others. Then it is none of the robot's, or its value is that of one.
    fn take_back_if_worse(&mut self, before: &Squares, noise: &[f64]) {
        let after = &self.limb.fit.held_out_squares;
        let is_worse = |after: f64, before: f64| after > MOST_RISE_OF_LOG * before;
        let worse = if self.limb.blocks.by_log {
            let mut logs = after.by_fold.iter().zip(&before.by_fold);
            logs.any(|(after, before)| is_worse(*after, *before))
        } else {
            is_worse(after.weighted(noise), before.weighted(noise))
        };
        if worse && let Some(step) = self.steps.pop() {
            self.limb.remove(step.place);
            self.refused.until_another_is_kept(step.place);
        }
    }

    /// Goes over the data again while it helps. False if there was no reason to.
    pub(super) fn settle(&mut self) -> bool {
        let mut did = false;
        while self.polishes < MOST_POLISHES {
            self.polishes += 1;
            match self.polish() {
                None => break,
                Some(change) => {
                    did = true;
                    if change > WORTH_POLISHING {
                        break;
                    }
                }
            }
        }
        did
    }

    /// Goes over the data again: what is left may tell a shape that was hidden before, and derivatives hold better near where
    /// they are used. The factor by which the held-out sum of squares changes; `None` if there is no reason to. An effect whose
    /// derivative misled is taken out again.
    fn polish(&mut self) -> Option<f64> {
        let limb = &mut *self.limb;
        if !limb.scan_shapes() && !limb.is_linearised() {
            return None;
        }
        let values = limb.values();
        limb.relinearise();
        // Not the whitened rows' sums: they may have been whitened for another noise.
        let after = &limb.fit.held_out_squares;
        let mut change = mean_ratio(after, &values.fit.held_out_squares);
        let misled = self
            .steps
            .iter()
            .rposition(|step| limb.is_correction(step.place));
        if let Some(misled) = misled
            && change > MOST_RISE
        {
            let step = &self.steps[misled];
            let without = misled
                .checked_sub(1)
                .map_or(&self.start, |before| &self.steps[before].squares);
            let promised = 1.0 - mean_ratio(&step.squares, without);
            if 1.0 - mean_ratio(after, without) < LEAST_KEPT * promised {
                let place = self.steps.remove(misled).place;
                limb.set_values(values);
                limb.remove(place);
                self.refused.for_good(place);
                // All else is to be judged again without it.
                change = 0.0;
            }
        }
        if let Some(step) = self.steps.last_mut() {
            step.squares = self.limb.fit.held_out_squares.clone();
        }
        Some(change)
    }

    /// Takes out again what has become superfluous.
    fn prune(&mut self) {
        let added: Vec<Place> = self.steps.iter().map(|step| step.place).collect();
        for place in added {
            if self.limb.is_superfluous(place)
                && self.limb.remove_unless_worse(place, MOST_RISE_OF_LOG)
            {
                self.push(place, true);
            }
        }
    }
}

/// The factor by which sums of squares differ, mean over joints.
fn mean_ratio(a: &Squares, b: &Squares) -> f64 {
    let [a, b] = [a, b].map(|squares| &squares.by_joint);
    let ratios = a.iter().zip(b).map(|(a, b)| a / b.max(f64::MIN_POSITIVE));
    ratios.sum::<f64>() / a.len().max(1) as f64
}
