//! Which links or bearings bend: candidates of `link_elasticity`, judged by points that their fits have not used.
//!
//! A link's rotation has three axes at each of its two ends. The one along a joint's axis lies in series with that joint's spring and is part of it; the
//! two across it are the candidates, in front of each joint as `calibrate` has them. Each is tried with resonances over the band, for a bend that is
//! stiff at the beginning moves nothing, however much it would if it were soft.

use super::error::FrfError;
use super::fit::{Fit, log_squares, magnitude};
use super::layout::Unknown;
use super::rigid::Bend;
use super::springs::{Arm, Found};
use super::start::{mean_inertia, spring_at};
use crate::model::{JointKind, JointQuantity, Model};
use crate::parallel::by_number;
use crate::robust::gain;

/// Where a bend's resonance is tried, as shares of the highest line: beyond it a bend adds little but its compliance.
const PLACES: [f64; 4] = [0.15, 0.35, 0.7, 1.4];
/// Steps of a fit from each place: enough to order candidates, of which the best is fitted to the end.
const STEPS: usize = 6;
/// By how much a bend has to make the logarithm of the held-out mean square smaller ([`fall`]): by a fifth of the error. Where the mean square is not so
/// much above that of its scatter, no bend is looked for: of simulated arms without bends it is 1.1 to 1.6 times as large. In series with a spring of about
/// the same axis a bend shows in few bands: it lowers all errors together by 0.75 and 0.85, and the mean over bands by 0.38 and 0.39.
const LEAST_GAIN: f64 = 0.4;
/// In how many of its standard errors: as for `calibrate`'s steps.
const LEAST_Z: f64 = 3.0;
/// Most bends that are added.
const MOST: usize = 4;

/// A bend that was judged.
#[derive(Debug, Clone)]
pub(super) struct Judged {
    pub(super) bend: Bend,
    /// Held-out error with it, log magnitude.
    pub(super) error: f64,
    /// Gain in its standard errors.
    pub(super) z: f64,
    pub(super) taken: bool,
}

/// The springs' fit with the bends that the model file states and those that are missing, and what was judged last.
pub(super) fn search<'p>(
    arm: &Arm<'_, 'p>,
    springs: Found<'p>,
) -> Result<(Found<'p>, Vec<Judged>), FrfError> {
    let mut found = springs;
    let all = candidates(arm)?;
    for &bend in &all {
        if let Some(k) = stated(arm.model, bend)
            && let Some(with) = arm.with_bend(&found, bend, [k, 1e-3 * k])?
        {
            found = with;
        }
    }
    let mut judged: Vec<Judged> = Vec::new();
    for _ in 0..MOST {
        if found.fit.chi_squared.ln() < LEAST_GAIN {
            break;
        }
        let open: Vec<Bend> = (all.iter().copied())
            .filter(|bend| !found.bends.contains(bend))
            .collect();
        let mut tried = Vec::new();
        for bend in open {
            tried.extend(tried_at(arm, &found, bend)?);
        }
        tried.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        judged.retain(|own| own.taken);
        let before = found.fit.log_squares();
        let judge = |bend: Bend, after: &[f64], error: f64, taken| Judged {
            bend,
            error,
            z: gain(&before, after),
            taken,
        };
        let Some(best) = tried.first() else { break };
        let Some(with) = arm.with_bend(&found, best.bend, best.spring)? else {
            break;
        };
        let (error, after) = (with.fit.error(), with.fit.log_squares());
        let mut own = judge(best.bend, &after, error, false);
        own.taken = own.z >= LEAST_Z && fall(&found.fit, &with.fit) >= LEAST_GAIN;
        let taken = own.taken;
        judged.push(own);
        let others = tried.iter().skip(1);
        judged.extend(others.map(|one| judge(one.bend, &one.after, one.error, false)));
        if !taken {
            break;
        }
        found = with;
    }
    Ok((found, judged))
}

/// By how much a fit makes the logarithm of the held-out mean square smaller than another: in the mean over points and bands or, where a bend shows about
/// few frequencies at few points, of all errors together. That this is no single resonance [`LEAST_Z`] asks of the bands.
fn fall(before: &Fit, after: &Fit) -> f64 {
    let mean = |fit: &Fit| {
        let all = fit.log_squares();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    let together = |fit: &Fit| {
        let all = fit.held_out.iter().flatten();
        let squares: f64 = all.clone().map(|e| e.square).sum();
        (squares / all.count().max(1) as f64).max(1e-300).ln()
    };
    (mean(before) - mean(after)).max(together(before) - together(after))
}

/// All bends of the joints that are measured.
fn candidates(arm: &Arm) -> Result<Vec<Bend>, FrfError> {
    let mut all = Vec::new();
    for joint in arm.joints {
        let joint = arm.model.robot().joint(joint)?;
        if arm.model.robot().bodies()[joint].kind != JointKind::Prismatic {
            all.push((joint, JointQuantity::BendFirst));
            all.push((joint, JointQuantity::BendSecond));
        }
    }
    Ok(all)
}

/// The stiffness that the model file states of a bend, N m/rad.
fn stated(model: &Model, (joint, quantity): Bend) -> Option<f64> {
    let known = model.joint_quantity(joint, quantity)?;
    (known.value > 0.0).then(|| 1.0 / known.value)
}

/// A candidate's best fit on the way.
struct Tried {
    bend: Bend,
    /// Weighted squares.
    cost: f64,
    /// Stiffness and damping.
    spring: [f64; 2],
    error: f64,
    /// [`log_squares`] of its held-out errors.
    after: Vec<f64>,
}

/// A candidate beside what was found, bodies held as that has them.
fn tried_at(arm: &Arm, found: &Found, bend: Bend) -> Result<Option<Tried>, FrfError> {
    let number = found.bends.len();
    let bends = [&found.bends[..], &[bend]].concat();
    let links = arm.links(&bends)?;
    let plants = links.plants(&arm.motors(), &found.compliance(number + 1))?;
    let inertia = mean_inertia(&plants.means, arm.joints.len() + number);
    let top = arm.omega.last().copied().unwrap_or(1.0);
    let mut problem = arm.problem(plants.means);
    problem.along = found.problem.along.clone();
    let lacking = found.fit.lacking;
    let from = |n: usize| {
        let spring = spring_at(inertia, PLACES[n] * top);
        let (layout, x) = arm.extended(found, &links, &[spring], &problem.plants);
        let (layout, x) = layout.holding(&x, Unknown::is_body);
        let state = problem.descend(&layout, &x, lacking, STEPS);
        (layout, state)
    };
    let all = by_number(0..PLACES.len(), from);
    let best = (all.into_iter()).min_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost));
    let Some((layout, state)) = best.filter(|(_, state)| state.cost.is_finite()) else {
        return Ok(None);
    };
    let spring = [Unknown::BendStiffness(number), Unknown::BendDamping(number)]
        .map(|of| layout.value(&state.x, of));
    let unused = problem.unused(&layout, &state.x, lacking);
    Ok(unused.map(|unused| Tried {
        bend,
        cost: state.cost,
        spring,
        error: magnitude(&unused),
        after: log_squares(&unused),
    }))
}
