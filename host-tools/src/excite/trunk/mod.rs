//! Motions that tell the trunk, over four planted feet.
//!
//! 1. `leg`: a leg in closed form. `state`: the whole robot at an instant, the feet's forces, and the rows of its equations that no foot
//!    reaches.
//! 2. `knowledge`: what rows tell of the trunk beside all else that is unknown.
//! 3. `stance_constraints` and `standing`: the trunk's six coordinates over planted feet, and their limits. `evolve`: the search.
//! 4. `table`: each of the trunk's parameters, before and after. [`output`]: the motion as files.
//!
//! On planted feet the legs move as the trunk does, and six equations of eighteen are free of the feet's forces (Aghili 2005): they are
//! what `identify --free-base` takes of such a log.

mod evolve;
mod knowledge;
mod leg;
pub mod output;
mod stance_constraints;
mod standing;
mod state;
mod table;
#[cfg(test)]
mod tests;

use proprio_core::effect::EffectKind;
use proprio_core::go2::{self, JOINT_NAMES, JOINTS, LEGS};

use super::problem::JointLimits;
use super::{ExciteError, Margins, Measures, Motion, Settings, Supervisor};
use crate::model::{BASE, Model};
pub use stance_constraints::TRUNK_COORDINATES;
use standing::Standing;
use state::{Drive, Robot, State};
pub use table::{TrunkParameter, measured};

/// What the feet stand on, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Greatest tangential over normal force of a foot.
    pub friction: f64,
    /// Least normal force of each foot, N.
    pub least_load: f64,
    /// Height of the base's origin above the floor in the middle of the motion, m.
    pub height: f64,
}

impl Default for Ground {
    /// Dry floors have 0.6 and more; a quarter of what a foot carries at rest stays on it; a Go2's own stance.
    fn default() -> Self {
        Self {
            friction: 0.5,
            least_load: 10.0,
            height: 0.29,
        }
    }
}

impl Ground {
    fn check(&self) -> Result<(), ExciteError> {
        let numbers = [
            ("the friction of the floor", self.friction),
            ("the least load of a foot", self.least_load),
            ("the height of the base", self.height),
        ];
        for (what, value) in numbers {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ExciteError::Setting {
                    what: what.to_owned(),
                    must: "a positive number",
                    value,
                });
            }
        }
        Ok(())
    }
}

/// The reference of all twelve joints at one instant, in SDK order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrunkCommand {
    /// Position, rad.
    pub q: [f64; JOINTS],
    /// Velocity, rad/s.
    pub dq: [f64; JOINTS],
    /// Acceleration, rad/s².
    pub ddq: [f64; JOINTS],
    /// Feed-forward torque, N m: of bodies, contact forces and friction.
    pub tau: [f64; JOINTS],
}

/// A motion of the trunk over planted feet and what it tells.
pub struct StandingDesign {
    /// Series of [`TRUNK_COORDINATES`], from the middle of the motion.
    pub motion: Motion,
    /// What it tells: of the trunk's ten parameters alone, but the determinant beside all others.
    pub measures: Measures,
    /// Limits that are exceeded at a sample, in words: none, or the motion must not be played.
    pub violations: Vec<String>,
    /// The trunk's parameters.
    pub trunk: Vec<TrunkParameter>,
    /// How far the feet's balls roll at most, m: by so much a foot is beside where the design has it.
    pub rolling: f64,
    /// The largest share of its friction cone that a foot uses, and the least normal force, N.
    pub cone: [f64; 2],
    standing: Standing,
}

impl std::fmt::Debug for StandingDesign {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StandingDesign")
            .field("motion", &self.motion)
            .field("measures", &self.measures)
            .finish_non_exhaustive()
    }
}

impl StandingDesign {
    /// What to command at `t` seconds; before the start and after the end, what holds the stance. None where a leg does not reach, which
    /// a motion without violations has nowhere.
    pub fn command(&self, t: f64) -> Option<TrunkCommand> {
        self.standing.command(&self.motion, t)
    }
}

/// Designs a motion of the trunk over four planted feet.
///
/// # Errors
/// [`ExciteError`]: another robot than a Go2, a stance or limits that leave no motion, numbers that cannot be.
pub fn standing(
    model: &Model,
    settings: &Settings,
    ground: Ground,
    supervisor: &dyn Supervisor,
) -> Result<StandingDesign, ExciteError> {
    is_go2(model)?;
    let standing = Standing::new(model, settings, ground)?;
    let motion = standing.design(settings, supervisor)?;
    let violations = standing.violations(&motion).into_iter();
    let violations = violations
        .map(|(t, excess)| {
            let percent = 100.0 * excess.beyond;
            format!("{} at {t:.3} s, by {percent:.2} %", excess.what)
        })
        .collect();
    let moments: Vec<_> = instants(&motion)
        .filter_map(|t| standing.moment(&motion, t))
        .collect();
    let states: Vec<State> = moments.iter().map(|(state, _)| state.clone()).collect();
    let measures = standing
        .rows(&states)
        .and_then(|rows| table::measures(&standing.prior, &rows))
        .unwrap_or(table::NOTHING);
    let forces = || moments.iter().flat_map(|(_, needed)| &needed.feet);
    let used = forces().map(|f| f.x.hypot(f.y) / (ground.friction * f.z));
    let rolled = states
        .iter()
        .flat_map(|now| (0..LEGS).map(|leg| standing.footing.rolling(&states[0], now, leg)));
    Ok(StandingDesign {
        trunk: table::of_standing(model, &standing, &motion)?,
        rolling: rolled.fold(0.0, f64::max),
        cone: [
            used.fold(0.0, f64::max),
            forces().map(|f| f.z).fold(f64::INFINITY, f64::min),
        ],
        measures,
        violations,
        motion,
        standing,
    })
}

/// Instants of a period at which what is told of a motion is measured.
fn instants(motion: &Motion) -> impl Iterator<Item = f64> + use<> {
    const MEASURED: usize = 64;
    let period = motion.period;
    (0..MEASURED).map(move |n| period * n as f64 / MEASURED as f64)
}

fn is_go2(model: &Model) -> Result<(), ExciteError> {
    let names = model.robot().bodies().iter().map(|body| &*body.name);
    if names.eq(JOINT_NAMES) {
        Ok(())
    } else {
        Err(ExciteError::NotAGo2)
    }
}

/// The free Go2 with the model's bodies.
fn robot(model: &Model) -> Robot {
    let bodies = std::array::from_fn(|b: usize| *model.inertia(b.checked_sub(1).unwrap_or(BASE)));
    go2::free().with_inertia(&bodies)
}

/// What the model states of each joint's friction and rotor, or what is expected of it; no torque offset unless stated.
fn drives(model: &Model) -> [Drive; JOINTS] {
    std::array::from_fn(|joint| {
        let of = |effect: EffectKind| {
            let stated = model.effect(effect, joint).and_then(|own| own.estimates[0]);
            let expected = || model.effect_prior(effect, joint).prior.mean;
            stated.map_or_else(expected, |estimate| estimate.value)
        };
        Drive {
            viscous: of(EffectKind::Viscous),
            coulomb: of(EffectKind::Coulomb),
            armature: of(EffectKind::Armature),
            bias: of(EffectKind::Bias),
        }
    })
}

/// What the joints may do, margins kept back, as a design of one leg keeps to them.
fn joint_limits(model: &Model, margins: &Margins) -> Vec<JointLimits> {
    let bodies = model.robot().bodies().iter();
    bodies
        .map(|body| JointLimits {
            position: [
                body.limits[0] + margins.position,
                body.limits[1] - margins.position,
            ],
            velocity: body.velocity * margins.velocity,
            acceleration: margins.acceleration,
            torque: body.effort * margins.torque,
            power: 0.25 * body.effort * body.velocity * margins.power,
        })
        .collect()
}
