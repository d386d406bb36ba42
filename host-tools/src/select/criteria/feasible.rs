//! What a robot can have: values that are physical, likely and not nothing.

use proprio_core::effect::{EffectKind, Form, Parameter};

use super::presence::is_there;
use super::step::LEAST_VALUE;
use crate::select::candidate::{Candidate, Finding};

/// No load is farther from its body's centre of mass, m: a Go2's longest link is 0.21 m.
pub(crate) const REACH: f64 = 0.3;
/// A load that is nearer to where its columns were made stays there, m: a tenth of a Go2's link.
pub(crate) const NEAR: f64 = 0.02;
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
/// Which parameter of a load is its own inertia.
const INERTIA: usize = 4;
/// Errors of a value within which it may be on the other side of a bound.
const WITHIN: f64 = 2.0;

/// Whether a candidate's values are physical within twice their errors, what a robot can have, and not all nothing.
pub(crate) fn is_feasible(candidate: &Candidate) -> bool {
    candidate.findings().all(can_be) && candidate.findings().any(is_something)
}

/// Whether a candidate is a delay or a lag too small to be told from how the torque runs between two samples.
pub(crate) fn is_unresolved_delay(candidate: &Candidate) -> bool {
    is_there(candidate) && candidate.findings().all(|told| !is_resolved(told))
}

/// Whether a value with its error is what a sensor, a mounting or a gear can be wrong by, beside what is taken for likely.
pub(crate) fn is_likely((value, std): (f64, f64), (mean, likely): (f64, f64)) -> bool {
    (value - mean).abs() - WITHIN * std <= LIKELY * likely
}

/// Whether what a trial says of an effect is physical within twice its error, and likely.
fn can_be(told: &Finding) -> bool {
    let described = told.place.0.description();
    let is_load = described.form == Form::Inertia;
    let mass = told.parameters[0].map_or(0.0, |(mass, _)| mass.abs());
    let within = |(n, p): (usize, &Parameter)| {
        let Some((value, std)) = told.parameters[n] else {
            return true;
        };
        let (mean, likely) = told.prior[n];
        let is_bounded = described.is_derivative() || is_load && n == 0;
        // A load's own inertia is told as well as its place: off by d, m d² is missing.
        let open = match (is_load, n) {
            (true, INERTIA) => mass * NEAR * NEAR,
            _ => 0.0,
        };
        value + WITHIN * std + open >= p.lower
            && value - WITHIN * std <= p.upper
            && (!is_bounded || is_likely((value, std), (mean, likely)))
    };
    (described.parameters.iter().enumerate()).all(within)
        && is_resolved(told)
        && (!is_load || can_be_load(&told.parameters))
        && (told.beyond_limit).is_none_or(|shown| shown < MOST_BEYOND_LIMIT)
}

/// Whether an effect's one value is beyond [`LEAST_VALUE`] errors of nothing; of several parameters each may be unsure where
/// together they are not.
fn is_something(told: &Finding) -> bool {
    let described = told.place.0.description();
    let mut linear = described.linear();
    let (Some(only), None) = (linear.next(), linear.next()) else {
        return true;
    };
    told.parameters[only].is_none_or(|(value, std)| {
        let away = (value - described.parameters[only].neutral).abs();
        away > 0.0 && away >= LEAST_VALUE * std
    })
}

/// Whether what moves a torque in time is more than how it runs between two samples.
fn is_resolved(told: &Finding) -> bool {
    told.parameters[0].is_none_or(|(time, _)| is_resolved_shift(told.place.0, time, told.period))
}

/// Whether an effect with this first parameter, s, moves a torque by more than how it runs between two samples of a log with this sampling
/// period, s; so does every effect that moves none.
pub(crate) fn is_resolved_shift(effect: EffectKind, time: f64, period: f64) -> bool {
    effect.description().shifts().is_none_or(|sign| {
        let periods = sign * time / period;
        !(-LEAST_LEAD..=LEAST_DELAY).contains(&periods)
    })
}

/// Whether a spring with this compliance, rad/(N m), under an inertia, kg m², moves a torque by more than how it runs between two samples of a
/// log with this sampling period, s: by (ω/ω₀)² of it, where the trapezoid rule is wrong by (ω h)²/12 (`equation/quadrature.rs`). That rule's
/// error is corrected, but not where friction kinks the motion between two samples: there it looks like a stiff spring.
pub(crate) fn is_resolved_spring(compliance: f64, inertia: f64, period: f64) -> bool {
    compliance * inertia >= period * period / 12.0
}

/// Whether a mass and its first moment about the body's centre may be a load, within twice their errors: a first moment without
/// a mass is none, nor is an inertia without weight. At most [`REACH`] away.
fn can_be_load(told: &[Option<(f64, f64)>]) -> bool {
    let [Some((mass, std)), moments @ ..] = told else {
        return true;
    };
    let weighs: f64 = (told.iter().take(4).flatten())
        .map(|(value, std)| (value / std).powi(2))
        .sum();
    if weighs < LEAST_WEIGHT {
        return false;
    }
    let heaviest = mass + WITHIN * std;
    let smallest = moments.iter().take(3).flatten();
    let smallest: f64 = smallest
        .map(|(h, std)| (h.abs() - WITHIN * std).max(0.0).powi(2))
        .sum();
    heaviest > 0.0 && smallest.sqrt() <= REACH * heaviest
}

#[cfg(test)]
mod tests {
    use super::{EffectKind, is_likely, is_resolved_shift, is_resolved_spring};

    /// At 500 Hz, ms: a delay of less than a tenth of a period, a lead of less than a half; friction shifts nothing.
    #[test]
    fn a_shift_within_a_sampling_period_is_none() {
        let resolved = |effect, ms: f64| is_resolved_shift(effect, ms * 1e-3, 2e-3);
        for (ms, is_one) in [
            (0.0, false),
            (0.19, false),
            (0.21, true),
            (-0.9, false),
            (-1.1, true),
        ] {
            assert_eq!(resolved(EffectKind::Delay, ms), is_one, "{ms} ms");
        }
        assert!(resolved(EffectKind::Coulomb, 0.0));
    }

    /// Under a Go2's calf, 0.0050 kg m² about its joint (tests/oracle/go2.urdf): the stiffest springs that logs of 100 and 500 Hz resolve are of 600
    /// and 15 000 N m/rad.
    #[test]
    fn a_spring_within_a_sampling_period_is_none() {
        for (stiffness, rate, is_one) in [
            (400.0, 100.0, true),
            (590.0, 100.0, true),
            (610.0, 100.0, false),
            (1_500.0, 100.0, false),
            (1_500.0, 250.0, true),
            (14_900.0, 500.0, true),
            (15_100.0, 500.0, false),
        ] {
            let resolved = is_resolved_spring(1.0 / stiffness, 0.005, 1.0 / rate);
            assert_eq!(resolved, is_one, "{stiffness} N m/rad at {rate} Hz");
        }
        assert!(!is_resolved_spring(0.0, 0.005, 2e-3));
    }

    /// Of a gear's spring, whose prior is 0 ± 0.01 rad/(N m): the softest that the batteries hide, one that a short log tells badly, and what a
    /// chirp of a Go2 made of a calf (k = 13 N m/rad).
    #[test]
    fn a_value_is_likely_within_three_deviations_beside_its_error() {
        for (value, std, likely) in [
            (0.0, 0.001, true),
            (1.0 / 40.0, 0.001, true),
            (0.031, 0.001, true),
            (0.033, 0.001, false),
            (0.05, 0.012, true),
            (0.0787, 0.0075, false),
            (-0.0787, 0.0075, false),
        ] {
            let prior = (0.0, 0.01);
            assert_eq!(is_likely((value, std), prior), likely, "{value} ± {std}");
        }
    }
}
