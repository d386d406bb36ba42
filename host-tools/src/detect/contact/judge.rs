//! From phases to a verdict: how strong, how sure, and how far the joints agree.

use nalgebra::Matrix3;

use super::{Contact, LEAST_EPISODES, Phase, SHORTEST, Search, weak};
use crate::select::criteria::LEAST_VALUE;

/// Windows from which on a longer episode is not more evidence: the force may have been the same all the time.
const ALIKE: f64 = 10.0;
/// Standard deviation of an episode's length, windows: either end lies anywhere in a window, and in all episodes alike, for a force that
/// comes slowly is seen late each time.
const ENDS: f64 = 0.577;
/// Most windows on either side of an episode that may belong to it: as long as the shortest that is told.
const MOST_MORE: usize = SHORTEST;
/// A force in a direction not seen before is expected with this share of the mean square of those seen.
const LEAST_SPREAD: f64 = 0.01;

impl Search<'_> {
    pub(super) fn judge(&self) -> Option<Contact> {
        let episodes = self.episodes(Phase::Contact);
        if episodes.len() < LEAST_EPISODES {
            return None;
        }
        let [force, std, z] = self.mean_force(&episodes);
        let (gain, gain_error) = self.agreement();
        let contact = self.count(Phase::Contact) as f64;
        let other = self.count(Phase::Other) as f64;
        Some(Contact {
            force,
            std,
            z,
            gain,
            gain_error,
            share: contact / self.windows.len() as f64,
            pushing: contact / (contact + other),
            episodes: episodes.len(),
            sensor: self.sensor(),
            samples: self.samples(),
            described: self.described,
        })
    }
}

impl Search<'_> {
    /// Normal force in contact and its standard deviation, from the spread over episodes, each with its length up to 0.2 s as weight, and
    /// from where they end, N;
    /// and how sure it is that all that is no swing pushes rather than pulls, as a normal variable has it.
    fn mean_force(&self, contacts: &[[usize; 2]]) -> [f64; 3] {
        let normal = |run: &[usize; 2]| {
            let sum: f64 = (run[0]..run[1]).map(|w| self.normal(w)).sum();
            let length = (run[1] - run[0]) as f64;
            let weight = length.min(ALIKE);
            (weight, sum * weight / length)
        };
        let whole = self.with_their_ends(contacts);
        let (force, spread) = weighted_mean(&whole.iter().map(normal).collect::<Vec<_>>());
        let windows: usize = whole.iter().map(|run| run[1] - run[0]).sum();
        let std = spread.hypot(force * ENDS * whole.len() as f64 / windows as f64);
        let others = self.episodes(Phase::Other);
        let runs: Vec<(f64, f64)> = contacts.iter().chain(&others).map(normal).collect();
        let (all, error) = weighted_mean(&runs);
        let z = normal_score(all / error, contacts.len() as f64 - 1.0);
        [force, std, z]
    }

    /// A window's most likely force away from the ground, N.
    fn normal(&self, w: usize) -> f64 {
        self.force(&self.residuals, w, None, &weak()).dot(&self.up)
    }

    /// Episodes with the windows on both sides in which the force was too weak to be seen in one: without them their mean is too
    /// large, the more so the weaker the force. As many are taken, of all episodes alike, as push on average by more than
    /// chance does.
    fn with_their_ends(&self, contacts: &[[usize; 2]]) -> Vec<[usize; 2]> {
        let swing = |w: &usize| self.phases.get(*w) == Some(&Phase::Swing);
        let pushes = |at: &dyn Fn(&[usize; 2]) -> Option<usize>| {
            let windows = contacts.iter().filter_map(at).filter(swing);
            let forces: Vec<(f64, f64)> = windows.map(|w| (1.0, self.normal(w))).collect();
            let (mean, error) = weighted_mean(&forces);
            forces.len() >= LEAST_EPISODES && mean > LEAST_VALUE * error
        };
        let more = |at: &dyn Fn(&[usize; 2], usize) -> Option<usize>| {
            let pushing = (1..=MOST_MORE).take_while(|n| pushes(&|run| at(run, *n)));
            pushing.count()
        };
        let before = more(&|run, n| run[0].checked_sub(n));
        let after = more(&|run, n| Some(run[1] + n - 1));
        let mut whole: Vec<[usize; 2]> = Vec::new();
        for &[first, end] in contacts {
            // Of a swing no window belongs to two episodes.
            let known = whole.last().map_or(0, |run| run[1]);
            let begin = (first.saturating_sub(before)..first).rev();
            let begin = begin.take_while(|w| *w >= known && swing(w)).count();
            let over = (end..end + after).take_while(swing).count();
            whole.push([first - begin, end + over]);
        }
        whole
    }

    /// How well the joints predict each other's residuals in contact: 1 − the sum of squares of what is left over that of the
    /// residuals, and its error as that of a ratio (Cochran 1977, §2.11).
    ///
    /// What forces are likely is taken from the other folds: the second moment of theirs. Their mean is not used, or every
    /// torque that comes and goes would seem to be predicted.
    fn agreement(&self) -> (f64, f64) {
        let folds = self.fit.data.blocks.folds;
        let likely: Vec<Matrix3<f64>> = (0..folds).map(|fold| self.likely(fold)).collect();
        let (mut before, mut falls) = (vec![0.0; folds], vec![0.0; folds]);
        for w in (0..self.windows.len()).filter(|&w| self.phases[w] == Phase::Contact) {
            let window = &self.windows[w];
            for (j, r) in self.residuals.own[w].iter().enumerate() {
                let force = self.force(&self.residuals, w, Some(j), &likely[window.fold]);
                let left = r + window.jacobian.column(j).dot(&force);
                before[window.fold] += r * r;
                falls[window.fold] += r * r - left * left;
            }
        }
        weighted_mean(&before.into_iter().zip(falls).collect::<Vec<_>>())
    }

    /// Inverse of the second moment of the forces in contact of all other folds, 1/N².
    fn likely(&self, fold: usize) -> Matrix3<f64> {
        let others = (0..self.windows.len())
            .filter(|&w| self.phases[w] == Phase::Contact && self.windows[w].fold != fold);
        let (mut sum, mut n) = (Matrix3::zeros(), 0.0);
        for w in others {
            let force = self.force(&self.residuals, w, None, &weak());
            sum += force * force.transpose();
            n += 1.0;
        }
        let moment = sum / n;
        let spread = Matrix3::identity() * (moment.trace() * LEAST_SPREAD);
        (moment + spread).try_inverse().unwrap_or_else(weak)
    }

    /// Correlation of contact with the foot's sensor.
    fn sensor(&self) -> Option<f64> {
        let foot = &self.fit.data.recording.foot;
        let mut sums = [0.0; 5];
        for (window, phase) in self.windows.iter().zip(&self.phases) {
            let [first, last] = window.samples;
            let pressed = foot[first..=last].iter().sum::<f64>() / (last - first + 1) as f64;
            let on = f64::from(u8::from(*phase == Phase::Contact));
            let products = [on, pressed, on * on, pressed * pressed, on * pressed];
            sums.iter_mut().zip(products).for_each(|(sum, x)| *sum += x);
        }
        let n = self.windows.len() as f64;
        let [on, pressed, on_on, pressed_pressed, both] = sums.map(|sum| sum / n);
        let spread = ((on_on - on * on) * (pressed_pressed - pressed * pressed)).sqrt();
        let correlation = (both - on * pressed) / spread;
        correlation.is_finite().then_some(correlation)
    }

    /// The samples of the episodes, and of a window on both sides, in which the force may have begun or still be fading.
    fn samples(&self) -> Vec<[usize; 2]> {
        let mut ranges: Vec<[usize; 2]> = Vec::new();
        for [first, end] in self.episodes(Phase::Contact) {
            let last = end.min(self.windows.len() - 1);
            let first = self.windows[first.saturating_sub(1)].samples[0];
            let last = self.windows[last].samples[1];
            match ranges.last_mut() {
                Some(range) if first <= range[1] => range[1] = range[1].max(last),
                _ => ranges.push([first, last]),
            }
        }
        ranges
    }
}

/// The sum of all sums over that of all weights, of pairs (weight, sum), and its standard error from the spread of the pairs' own.
fn weighted_mean(runs: &[(f64, f64)]) -> (f64, f64) {
    let n = runs.len() as f64;
    let (length, sum) = runs
        .iter()
        .fold((0.0, 0.0), |(a, b), run| (a + run.0, b + run.1));
    let mean = sum / length;
    let spread: f64 = runs.iter().map(|run| (run.1 - mean * run.0).powi(2)).sum();
    (mean, (spread * n / (n - 1.0)).sqrt() / length)
}

/// The normal variable that is as improbable as Student's `t` with so many degrees of freedom; at most 37, which is as far as
/// numbers reach.
pub(super) fn normal_score(t: f64, freedom: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
    let (Ok(student), Ok(normal)) = (StudentsT::new(0.0, 1.0, freedom), Normal::new(0.0, 1.0))
    else {
        return 0.0;
    };
    let improbable = student.cdf(-t.abs()).max(1e-300);
    -normal.inverse_cdf(improbable) * t.signum()
}
