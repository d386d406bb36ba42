//! Whether an effect is there: beyond chance, worth a place in the model, at one joint or at all like joints.

use proprio_core::effect::{EffectKind, Varies};

use super::statistics::{LEAST_Z, Squared, least_z, sum_and_error};
use crate::gate::AT_REST;
use crate::select::candidate::Candidate;

/// What an effect adds in some stretches of time it may take back in others up to this share.
const MOST_HARM: f64 = 0.2;
/// Smallest share of the held-out error of the joints that feel an effect: less is not worth a parameter.
const LEAST_GAIN: f64 = 0.02;
/// The same of effects that change as slowly as the position, or act at few moments: in one window they are small, and sure over
/// many.
const LEAST_GAIN_OF_SLOW: f64 = 0.005;
/// What sampling does not look like is there if it takes away this share of its joints' error, however small it is; from this share on a soft spring or
/// a wide play may be what another effect resembles.
pub(crate) const SURE_GAIN: f64 = 0.05;
/// Share of a joint's mean square error that is no noise, or that a value explains which cannot be, from which something is missing that
/// the catalogue does not have: a fifth, for a log's sampling, its reversals and lost messages leave shares of less.
pub(crate) const STRUCTURE: f64 = 0.2;
/// A sampled log resolves no more of a joint's torque than this share, rms: of complete legs simulated at 500 and 1000 Hz, kinks where
/// friction turns round and integrals over samples leave about half of it; at 100 Hz a third more than it. What is left below it tells of
/// nothing missing.
pub(crate) const RESOLUTION: f64 = 0.01;
/// An effect takes away at least this share of the torque of the joints that feel it, rms: a fifth of the resolution, for effects are
/// told by all windows together.
pub(crate) const LEAST_EFFECT: f64 = 0.002;
/// What takes away so much of the held-out error, and more than so many of its errors from fold to fold, is no chance however its value
/// scatters: what grows with time, as heat does, gains most in the last folds.
const MOST_BY_CHANCE: f64 = 0.5;
const LEAST_OF_MOST: f64 = 2.0;

/// χ² of eight folds' degrees of freedom that chance reaches once in 10⁸ times, and a little for what θ itself is wrong by.
const LEAST_CHANGE: f64 = 60.0;
/// Smallest share of a joint's held-out sum of squares that a change in time explains.
const LEAST_CHANGE_GAIN: f64 = 0.05;
/// Of a joint that moves less than this share of the time nothing is claimed: the gate says that it hardly moves.
const LEAST_MOVING: f64 = 0.1;
/// It moves where it is faster than a joint at rest, or than this share of its limit.
const SLOW: f64 = 0.01;

/// Whether a parameter that differs from fold to fold changes with time: by how much a joint's sum of squares falls if it may, what one window
/// is wrong by, and what is left of the joint, (N m)².
pub(crate) fn is_change(fall: f64, noise: f64, left: f64) -> bool {
    fall / noise > LEAST_CHANGE && fall > LEAST_CHANGE_GAIN * left
}

/// Whether a joint moves for long enough to claim anything of it: its speeds and the limit of its speed, rad/s, none if zero.
pub(crate) fn moves(speeds: impl ExactSizeIterator<Item = f64>, limit: f64) -> bool {
    let least = if limit > 0.0 {
        AT_REST.min(SLOW * limit)
    } else {
        AT_REST
    };
    let all = speeds.len() as f64;
    let moving = speeds.filter(|speed| speed.abs() > least).count();
    moving as f64 >= LEAST_MOVING * all
}

/// Whether a candidate is there beyond chance.
pub(crate) fn is_beyond_chance(candidate: &Candidate) -> bool {
    let (gain, error) = candidate.gain();
    let share = gain / candidate.felt;
    let most = share >= MOST_BY_CHANCE && gain > LEAST_OF_MOST * error;
    // Both tests are needed: z is of the data that the value is fitted to, the gain of data that it has not seen.
    most || (candidate.z() >= least_z(candidate.tried) && gain > error)
}

/// Whether a candidate is there beyond chance and worth a place in the model, whatever its value.
pub(crate) fn is_there(candidate: &Candidate) -> bool {
    let (gain, _) = candidate.gain();
    let harm: f64 = candidate.gains.iter().map(|gain| gain.min(0.0)).sum();
    let held_out_gain = candidate.held_out_gain().0;
    is_beyond_chance(candidate)
        // A cause that is there is there all the time.
        && -harm < MOST_HARM * (gain - harm)
        && held_out_gain > least_gain(candidate.effect)
        && (candidate.torque_error_taken() > LEAST_EFFECT.powi(2) * candidate.torque
            || !is_like_sampling(candidate.effect) && held_out_gain > SURE_GAIN)
}

/// Whether what sampling alone leaves of a torque looks like an effect: like friction and like delays, but not like a weight, nor like a spring or a play
/// that more than the motion between two samples shows (`feasible::is_resolved_spring`), which a fit of one asks for.
fn is_like_sampling(effect: EffectKind) -> bool {
    !acts_by_weight(effect) && !effect.description().is_compliant()
}

/// Whether a spring or a play is tried where no column shows it: what is `left` of its joint, (N m)², is more than sampling leaves of its torque, or
/// what it promises, where that is known, is a sure part of the error `now` of all joints.
pub(crate) fn is_worth_trying(left: f64, torque: f64, promise: Option<f64>, now: f64) -> bool {
    left >= RESOLUTION.powi(2) * torque || promise.is_some_and(|promise| promise > SURE_GAIN * now)
}

/// Whether a candidate is a sure part of the error of one joint: then a soft spring or a wide play there may be what it resembles.
pub(crate) fn is_sure_of_one_joint(candidate: &Candidate) -> bool {
    candidate.members.len() == 1
        && !candidate.is_shared()
        && candidate.held_out_gain().0 > SURE_GAIN
}

/// Whether a value that cannot be explains so much that something is missing which the catalogue does not have.
pub(crate) fn is_structure(candidate: &Candidate) -> bool {
    is_there(candidate) && candidate.held_out_gain().0 > STRUCTURE
}

/// Whether a family stands: without its best member it still is beyond chance, and it takes away more than that one alone,
/// beyond the error of that.
pub(crate) fn is_family(candidate: &Candidate, all: &[Candidate]) -> bool {
    let own: Vec<&Candidate> = (all.iter())
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
    let (more, error) = sum_and_error(&more);
    // One joint that has it and many that do not are one joint's effect, though all together gain as well.
    more > error
        && gain > 0.0
        && 2 * helped > own.len()
        && sure.is_some_and(|sure| sure.z() >= LEAST_Z)
}

/// Smallest share of the held-out error that is worth a parameter.
fn least_gain(effect: EffectKind) -> f64 {
    match effect.description().varies {
        Varies::Fast => LEAST_GAIN,
        Varies::Slowly | Varies::LikeWeight => LEAST_GAIN_OF_SLOW,
    }
}

/// Whether an effect acts by the weight of the bodies: what happens between two samples, or where friction turns round, does not look
/// like it.
pub(super) fn acts_by_weight(effect: EffectKind) -> bool {
    effect.description().varies == Varies::LikeWeight
}
