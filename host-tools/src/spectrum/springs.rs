//! Springs of a bench, from nothing, and of a model's joints.

use super::error::FrfError;
use super::fit::{Fit, Problem};
use super::friction::Drive;
use super::layout::Unknown;
use super::response::Point;
use super::rigid::{Links, Motors};
use super::start::{self, Drives, Known};
use crate::catalogue;
use crate::model::Model;

/// One spring is fitted up to so many times its resonance: beyond it are further modes that a bench's model does not have. On the two-mass bench
/// anything between 1.8 and 2.9 moves the antiresonance by less than 0.02 Hz and the load's gain by less than 1 %.
const ONE_SPRING: f64 = 2.5;
/// Friction of fast motion is that of slow motion to this share: what differs (sticking between samples, presliding) is in no model here.
pub(super) const FRICTION_DOUBT: f64 = 0.05;

/// Fits, each with the links where the springs of the fit before let them sag: the sag of the second is off by what the first one's springs are off,
/// some per cent, and a sag of 0.01 rad moves inertias by less than 1 %.
const SAG_FITS: usize = 2;

/// The joints' drives by a model, dry friction times a factor; without a model nothing is known.
pub(super) fn drives(model: Option<&Model>, joints: &[String], factor: f64) -> Vec<Drive> {
    let value =
        |effect, joint: &String| known(model, effect, joint).map_or(0.0, |(value, _)| value);
    let drive = |joint| Drive {
        coulomb: factor * value("coulomb", joint),
        armature: value("armature", joint),
    };
    joints.iter().map(drive).collect()
}

/// The value of a plain effect in the model, if it has one, with its standard deviation; without one a tenth of it.
fn known(model: Option<&Model>, effect: &str, joint: &str) -> Known {
    let model = model?;
    let joint = model.robot().joint(joint).ok()?;
    let estimate = model
        .effect(catalogue::effect_named(effect)?, joint)?
        .estimate()?;
    Some((
        estimate.value,
        estimate.std.unwrap_or(0.1 * estimate.value.abs()),
    ))
}

/// What was fitted, the held-out error of the rigid model, and the fit.
pub(super) type Fitted<'a> = (Problem<'a>, f64, Fit);

/// What the model knows of an effect at each joint.
pub(super) fn known_at(model: &Model, effect: &str, joints: &[String]) -> Vec<Known> {
    let of = |joint: &String| known(Some(model), effect, joint);
    joints.iter().map(of).collect()
}

/// Springs of a model's joints; `doubted` are the points with less dry friction, which moves the estimates by what it may be wrong.
pub(super) fn with_model<'a>(
    model: &Model,
    joints: &[String],
    [points, doubted]: [&'a [Point]; 2],
    omega: &[f64],
    dt: f64,
) -> Result<Fitted<'a>, FrfError> {
    let motors = points.iter().map(|point| Motors {
        middle: &point.q,
        path: &point.path,
    });
    let motors: Vec<Motors<'_>> = motors.collect();
    let links = Links::new(model, joints, &motors)?;
    // Springs yield under gravity, so that the links are not where the motors are. How far is not known before there are springs.
    let stiff = vec![0.0; joints.len()];
    let [plants, _] = links.plants(&motors, &stiff)?;
    let own: Vec<&Point> = points.iter().collect();
    let [armature, viscous] = ["armature", "viscous"].map(|of| known_at(model, of, joints));
    let drives = Drives {
        armature: &armature,
        viscous: &viscous,
        doubts: links.doubts(),
    };
    let (layout, mut starts) = start::joints(&own, &plants, omega, &drives);
    let mut problem = Problem {
        points: own,
        plants,
        omega: omega.to_vec(),
        used: omega.len(),
        dt,
    };
    let (stiff, x) = start::rigid(&layout, &starts[0], &problem.plants, omega);
    let rigid = problem
        .fit(&stiff, &[x])
        .map_or(f64::NAN, |fit| fit.error());
    let mut found = None;
    let mut middles = Vec::new();
    for _ in 0..SAG_FITS {
        let fit = problem
            .fit(&layout, &starts)
            .filter(|fit| fit.error().is_finite());
        let fit = fit.ok_or(FrfError::NoFit {
            before: rigid,
            after: f64::INFINITY,
        })?;
        let compliance = |i| 1.0 / fit.layout.value(&fit.x, Unknown::Stiffness(i));
        let compliance: Vec<f64> = (0..joints.len()).map(compliance).collect();
        [problem.plants, middles] = links.plants(&motors, &compliance)?;
        starts = vec![fit.x.clone()];
        found = Some(fit);
    }
    let mut fit = found.ok_or(FrfError::NoFit {
        before: rigid,
        after: f64::INFINITY,
    })?;
    // Two things that no scatter shows: friction that differs from slow motion's, and matrices that change along the slow motion.
    let problem = Problem {
        points: doubted.iter().collect(),
        ..problem
    };
    if doubted.len() == points.len() {
        problem.doubted(&mut fit);
    }
    let plants = problem.plants;
    let problem = Problem {
        points: points.iter().collect(),
        plants: middles,
        ..problem
    };
    problem.doubted(&mut fit);
    let problem = Problem { plants, ..problem };
    Ok((problem, rigid, fit))
}

/// Motor, spring and load of a bench, from nothing.
pub(super) fn bench<'a>(points: &'a [Point], omega: &[f64], dt: f64) -> Option<Fitted<'a>> {
    let own: Vec<&Point> = points.iter().collect();
    let (layout, starts) = start::bench(&own, omega);
    let mut problem = Problem {
        plants: own.iter().map(|_| start::bench_plant()).collect(),
        points: own,
        omega: omega.to_vec(),
        used: omega.len(),
        dt,
    };
    let first = problem.fit(&layout, &starts)?;
    let (_, resonance, _) = mode_of_bench(&first, &first.x);
    let used = omega
        .iter()
        .filter(|w| **w <= ONE_SPRING * resonance)
        .count();
    // Fewer lines than both sides of a resonance need would be another problem.
    problem.used = if used >= 12 { used } else { omega.len() };
    let fit = problem.fit(&layout, &[first.x])?;
    let (stiff, x) = start::rigid(&layout, &fit.x, &problem.plants, omega);
    let rigid = problem
        .fit(&stiff, &[x])
        .map_or(f64::NAN, |fit| fit.error());
    Some((problem, rigid, fit))
}

/// Antiresonance and resonance, rad/s, and the inertia ratio of a bench.
fn mode_of_bench(fit: &Fit, x: &[f64]) -> (f64, f64, f64) {
    let value = |of: Unknown| fit.layout.value(x, of);
    mode(
        value(Unknown::Stiffness(0)),
        value(Unknown::LinkInertia),
        value(Unknown::Armature(0)),
    )
}

/// Antiresonance and resonance, rad/s, and the ratio of link and motor.
pub(super) fn mode(stiffness: f64, link: f64, motor: f64) -> (f64, f64, f64) {
    let antiresonance = (stiffness / link).sqrt();
    let resonance = (stiffness * (1.0 / link + 1.0 / motor)).sqrt();
    (antiresonance, resonance, link / motor)
}
