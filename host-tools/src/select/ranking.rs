//! The verdict on each candidate of a look, and their order.

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Finding, Member};
use super::criteria::choice::Look;
use super::criteria::feasible::is_feasible;
use super::criteria::presence::is_there;

/// A candidate and the verdict on it.
#[derive(Debug, Clone)]
pub(crate) struct Judged {
    pub(crate) candidate: Candidate,
    pub(crate) significant: bool,
    pub(crate) possible: bool,
    /// Of each member its parameters as the catalogue means them: value and standard deviation.
    pub(crate) parameters: Vec<Vec<(f64, f64)>>,
    /// What it cannot be told from on these data.
    pub(crate) alternatives: Vec<(EffectKind, Vec<Member>)>,
}

pub(super) fn judged(candidate: &Candidate) -> Judged {
    let possible = is_feasible(candidate);
    Judged {
        significant: possible && is_there(candidate),
        possible,
        parameters: candidate.findings().map(parameters).collect(),
        alternatives: Vec::new(),
        candidate: candidate.clone(),
    }
}

/// An effect's parameters before it is fitted.
fn parameters(told: &Finding) -> Vec<(f64, f64)> {
    let parameter = |(told_of, prior): (&Option<(f64, f64)>, &(f64, f64))| {
        // A score test finds a nonlinear parameter and not how surely: until it is fitted no surer than before.
        let (value, std) = told_of.unwrap_or((told.nonlinear, prior.1));
        // A column says little of what lies between motor and link: until it is fitted it is no surer than before either.
        let open = match told.place.0.description().is_compliant() {
            true => prior.1,
            false => 0.0,
        };
        (value, std.hypot(open))
    };
    (told.parameters.iter().zip(&told.prior))
        .map(parameter)
        .collect()
}

/// Judges all candidates: the `best` first, then by how much torque error they take away.
pub(crate) fn judge(look: &Look, best: Option<&Candidate>) -> Vec<Judged> {
    let mut all: Vec<Judged> = look.all.iter().map(judged).collect();
    all.sort_by(|a, b| {
        b.candidate
            .torque_error_taken()
            .total_cmp(&a.candidate.torque_error_taken())
    });
    let Some(best) = best else {
        return all;
    };
    if let Some(at) = all.iter().position(|j| j.candidate.is_same(best)) {
        all[..=at].rotate_right(1);
        all[0].alternatives = look.alternatives(best);
    }
    all
}
