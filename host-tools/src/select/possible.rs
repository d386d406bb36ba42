//! What a robot can have: values that are physical, likely and not nothing.

use proprio_core::effect::EffectKind;

use super::criteria;
use super::screen::{Screen, Trial};
use crate::equation::motion::is_derivative;
use crate::equation::values::Place;

/// A smaller delay is none, sampling periods: how the torque runs between two samples is not known.
const LEAST_DELAY: f64 = 0.1;
/// The same of a torque ahead of its motion: one that a drive holds from sample to sample is on average half a period later than it is
/// reported.
const LEAST_LEAD: f64 = 0.5;
/// χ² of a mass and its first moment below which a load weighs nothing that is told (99 % of four degrees of freedom): what is only
/// inertia is a rotor's.
const LEAST_WEIGHT: f64 = 13.3;
/// What a sensor, a mounting, a gear or a load can be wrong by, in standard deviations of what the catalogue takes for likely.
const LIKELY: f64 = 3.0;
/// Of each N m that is reported beyond a limit the motion shows at most this share; of a drive that nothing limits, all.
const MOST_BEYOND_LIMIT: f64 = 0.5;

/// Whether what a trial says of an effect is physical within twice its error, and likely.
pub(super) fn is_possible(screen: &Screen, trial: &Trial, place: Place) -> bool {
    let (effect, data) = (place.0, screen.fit.data);
    let parameters = effect.description().parameters;
    let told: Vec<Option<(f64, f64)>> = (0..parameters.len())
        .map(|n| screen.parameter(trial, place, n))
        .collect();
    let mass = told[0].map_or(0.0, |(mass, _)| mass.abs());
    let within = |(n, told): (usize, &Option<(f64, f64)>)| {
        let Some((value, std)) = *told else {
            return true;
        };
        let p = &parameters[n];
        let (mean, likely) = data.prior(place, n);
        let is_sensor = is_derivative(effect) || effect == EffectKind::Payload && n == 0;
        // A load's own inertia is told as well as its place: off by d, m d² is missing.
        let open = match (effect, n) {
            (EffectKind::Payload, 4) => mass * criteria::NEAR * criteria::NEAR,
            _ => 0.0,
        };
        value + 2.0 * std + open >= p.lower
            && value - 2.0 * std <= p.upper
            && (!is_sensor || (value - mean).abs() - 2.0 * std <= LIKELY * likely)
    };
    let resolved = effect != EffectKind::Delay
        || told[0].is_none_or(|(d, _)| is_resolved(data.recording.period(), d));
    let load = effect != EffectKind::Payload || is_load(&told);
    told.iter().enumerate().all(within)
        && resolved
        && load
        && (effect != EffectKind::Saturation || is_limited(screen, place))
}

/// Whether an effect's one value is beyond [`criteria::LEAST_VALUE`] errors of nothing; of several parameters each may be unsure where
/// together they are not.
pub(super) fn is_something(screen: &Screen, trial: &Trial, place: Place) -> bool {
    let parameters = place.0.description().parameters;
    let linear: Vec<usize> = (0..parameters.len())
        .filter(|&n| !parameters[n].shape)
        .collect();
    let [only] = linear[..] else { return true };
    screen
        .parameter(trial, place, only)
        .is_none_or(|(value, std)| {
            let away = (value - parameters[only].neutral).abs();
            away > 0.0 && away >= criteria::LEAST_VALUE * std
        })
}

/// Whether the torque that the motion takes stays at a limit while what is reported goes on: the slope of the one on the other, beyond
/// the limit.
fn is_limited(screen: &Screen, place: Place) -> bool {
    let limit = screen.shape(place);
    let beyond: Vec<[f64; 2]> = (screen.torques(place.1))
        .filter(|[reported, _]| reported.abs() > limit)
        .map(|[reported, predicted]| [reported.abs(), predicted * reported.signum()])
        .collect();
    let mean = |n: usize| beyond.iter().map(|x| x[n]).sum::<f64>() / beyond.len() as f64;
    let means = [mean(0), mean(1)];
    let product = |[a, b]: [usize; 2]| {
        beyond
            .iter()
            .map(|x| (x[a] - means[a]) * (x[b] - means[b]))
            .sum::<f64>()
    };
    product([0, 1]) < MOST_BEYOND_LIMIT * product([0, 0])
}

/// Whether a delay (s) is more than how the torque runs between two samples, a period (s) apart.
pub(super) fn is_resolved(period: f64, delay: f64) -> bool {
    let periods = delay / period;
    !(-LEAST_LEAD..=LEAST_DELAY).contains(&periods)
}

/// Whether a mass and its first moment about the body's centre may be a load, within twice their errors: a first moment without
/// a mass is none, nor is an inertia without weight. At most [`criteria::REACH`] away.
fn is_load(told: &[Option<(f64, f64)>]) -> bool {
    let [Some((mass, std)), moments @ ..] = told else {
        return true;
    };
    let weighs: f64 = (told.iter().take(4).flatten())
        .map(|(value, std)| (value / std).powi(2))
        .sum();
    if weighs < LEAST_WEIGHT {
        return false;
    }
    let heaviest = mass + 2.0 * std;
    let smallest = moments.iter().take(3).flatten();
    let smallest: f64 = smallest
        .map(|(h, std)| (h.abs() - 2.0 * std).max(0.0).powi(2))
        .sum();
    heaviest > 0.0 && smallest.sqrt() <= criteria::REACH * heaviest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples are 2 ms apart. A drive that holds its torque leads by a millisecond; none is late by holding it.
    #[test]
    fn how_a_torque_runs_between_two_samples_is_no_delay() {
        let is_resolved = |delay: f64| is_resolved(2e-3, delay);
        assert!(!is_resolved(0.0) && !is_resolved(0.1e-3) && !is_resolved(-0.9e-3));
        assert!(is_resolved(0.3e-3) && is_resolved(-1.2e-3));
    }
}
