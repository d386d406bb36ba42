//! The torque that a limb's motors gave, by the one that they reported.
//!
//! Under a model the reported torque is (τ + f(τ) + d/dt b(τ)) / gain of a delay ago, with f and b the model's effects of the motor's torque
//! (a dead band, a lag). Both never fall with τ, so that there is one τ at each instant, found by halving an interval; d/dt b is taken over
//! parts of the time between samples ([`PARTS`]). Beyond a limit the motor gives the limit.

use proprio_core::effect::{Input, JointState};

use crate::equation::contribution::Contribution;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;

/// Halvings of the interval of a torque: to 2⁻⁵⁰ of it, which is a rounding error.
const HALVINGS: usize = 50;
/// Parts of the time between two samples over each of which a torque that lags is followed by Euler's implicit rule, which no lag makes ring.
/// Under a lag of 6 ms at 500 Hz a thigh is then off by 2e-4 rad after 0.1 s; in one part, by 1e-3.
const PARTS: usize = 8;

/// Whether an effect stands between the reported torque and the motor's.
pub(super) fn is_of_drive(effect: &Contribution) -> bool {
    effect.effect.description().input == Input::MotorTorque
}

/// The motors' torque at each sample, joint by joint, N m.
pub(super) fn torque(data: &LimbData, values: &Values, effects: &[Vec<Contribution>]) -> Vec<f64> {
    let (n, motion) = (data.joints(), &data.motion);
    let reported = &data.recording.tau;
    let mut torque = vec![0.0; reported.len()];
    for (j, effects) in effects.iter().enumerate() {
        let (delay, gain) = (values.delay(j), values.torque_gain(j));
        let own: Vec<&Contribution> = (effects.iter())
            .filter(|own| is_of_drive(own) && !own.effect.description().is_limit())
            .collect();
        // A limit that nothing was beyond has no contribution.
        let limits = (effects.iter()).filter(|own| own.effect.description().is_limit());
        let limit = limits.fold(f64::INFINITY, |least, own| least.min(own.shapes[0]));
        for stretch in &motion.stretches {
            let (mut given, mut last) = (None, 0.0);
            for k in stretch.clone() {
                let asked = gain * later(&motion.time, stretch, k, delay, &|k| reported[k * n + j]);
                let now = match (own.is_empty(), given) {
                    (true, _) => asked,
                    // Before the first sample the torque was as it is there.
                    (false, None) => behind(&own, (j, n), asked, None),
                    (false, Some(given)) => {
                        let time = (motion.time[k] - motion.time[k - 1]) / PARTS as f64;
                        (1..=PARTS).fold(given, |given, part| {
                            let along = part as f64 / PARTS as f64;
                            behind(
                                &own,
                                (j, n),
                                last + along * (asked - last),
                                Some((given, time)),
                            )
                        })
                    }
                };
                (given, last) = (Some(now), asked);
                torque[k * n + j] = now.clamp(-limit, limit);
            }
        }
    }
    torque
}

/// What was reported `delay` seconds after sample k, by a line between samples; the last, where the stretch ends before.
fn later(
    time: &[f64],
    stretch: &std::ops::Range<usize>,
    k: usize,
    delay: f64,
    of: &dyn Fn(usize) -> f64,
) -> f64 {
    if delay == 0.0 {
        return of(k);
    }
    let at = time[k] + delay;
    let next = stretch.start + time[stretch.clone()].partition_point(|t| *t < at);
    match next {
        next if next >= stretch.end => of(stretch.end - 1),
        next if next == stretch.start => of(next),
        next => {
            let share = (at - time[next - 1]) / (time[next] - time[next - 1]);
            of(next - 1) + share * (of(next) - of(next - 1))
        }
    }
}

/// The torque τ at a joint, of so many, of which the effects make what is `asked` for, where it was one `before`, so many seconds ago.
fn behind(
    effects: &[&Contribution],
    (at, joints): (usize, usize),
    asked: f64,
    before: Option<(f64, f64)>,
) -> f64 {
    let mut states = vec![JointState::reported(0.0, 0.0, 0.0); joints];
    let mut terms = |torque: f64| {
        states[at].tau = torque;
        let (mut boundary, mut rate) = (0.0, 0.0);
        for effect in effects {
            effect.add(at, &states, [&mut boundary, &mut rate]);
        }
        [boundary, rate]
    };
    let known = before.map(|(torque, time)| (terms(torque)[0], time));
    let mut reported = |torque: f64| {
        let [boundary, rate] = terms(torque);
        let slope = known.map_or(0.0, |(known, time)| (boundary - known) / time);
        torque + rate + slope
    };
    let most = asked
        .abs()
        .max(before.map_or(0.0, |(torque, _)| torque.abs()));
    let (mut low, mut high) = (-most, most);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        match reported(middle) < asked {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}
