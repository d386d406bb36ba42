//! The effects that the desktop knows: core's catalogue, those that a program registers, and formulas of model files.
//!
//! Every room looks effects up here, so that a registered one is in model files, `add`, `identify`, `diagnose`, `compare` and pages.
//!
//! ```
//! use proprio_host::catalogue::{self, OwnEffect};
//! use proprio_core::effect::{Description, Parameter, Prior, Term};
//!
//! const GRAVITY_BALANCER: OwnEffect = OwnEffect {
//!     description: Description {
//!         name: "balancer",
//!         torque: "c cos(q)",
//!         parameters: &[Parameter::new("c", "N m", 0.0, f64::INFINITY)],
//!         words: "a counterweight on the joint",
//!         ..Description::TORQUE
//!     },
//!     priors: &[Prior { mean: 0.0, std: 1.0 }],
//!     others: &[],
//!     terms: &|joints, at, _| [Term::rate(joints[at].q.cos()), Term::zero()],
//!     coupled: None,
//! };
//! let effect = catalogue::register(GRAVITY_BALANCER)?;
//! assert_eq!(catalogue::effect_named("balancer"), Some(effect));
//! # Ok::<(), catalogue::RegisterError>(())
//! ```

use std::sync::{PoisonError, RwLock};

use proprio_core::effect::{
    Description, EffectKind, Enters, Form, MAX_COLUMNS, MAX_PARAMETERS, MAX_SHAPES,
};

pub use proprio_core::effect::OwnEffect;

use crate::formula::Formula;

/// One that was registered, and its formula where it came as a text.
type Own = (EffectKind, Option<&'static Formula>);

/// Those that were registered. They are never forgotten: models name them.
static OWN: RwLock<Vec<Own>> = RwLock::new(Vec::new());

/// Why an effect cannot be registered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RegisterError {
    /// Not a name of lowercase letters, digits and `_`.
    #[error("`{0}` is no name: lowercase letters, digits and _, a letter first")]
    Name(&'static str),
    /// Another effect has this name.
    #[error("another effect is called `{0}`")]
    Taken(&'static str),
    /// Something else than a torque at its own joint with columns of its own, or at several with `coupled`.
    #[error(
        "`{0}` is no torque at its own joint (Form::Columns, Enters::Column), nor at several (Form::Coupled, coupled)"
    )]
    Form(&'static str),
    /// One column at least, [`MAX_COLUMNS`] at most, [`MAX_SHAPES`] shapes at most, which have grids, and a prior for each parameter.
    #[error(
        "`{0}` wants 1 to {MAX_COLUMNS} parameters with a column, at most {MAX_SHAPES} shapes, each with a grid, and a prior of each"
    )]
    Parameters(&'static str),
}

/// Makes an effect known to the whole program; again with the same facts, it is the same effect.
///
/// # Errors
/// [`RegisterError`].
pub fn register(effect: OwnEffect) -> Result<EffectKind, RegisterError> {
    let description = &effect.description;
    let name = description.name;
    check(&effect)?;
    if EffectKind::from_name(name).is_some() {
        return Err(RegisterError::Taken(name));
    }
    let mut own = OWN.write().unwrap_or_else(PoisonError::into_inner);
    if let Some((known, _)) = newest(&own, name) {
        let is_same = known.description() == description;
        return is_same.then_some(*known).ok_or(RegisterError::Taken(name));
    }
    let kind = EffectKind::Own(Box::leak(Box::new(effect)));
    own.push((kind, None));
    Ok(kind)
}

/// Makes an effect known that came as a text. From then on its name means this formula, if it meant another one before: files are edited.
/// Models that were read before keep what they have.
///
/// # Errors
/// [`RegisterError`].
pub fn define(effect: OwnEffect, formula: Formula) -> Result<EffectKind, RegisterError> {
    let name = effect.description.name;
    check(&effect)?;
    if EffectKind::from_name(name).is_some() {
        return Err(RegisterError::Taken(name));
    }
    let mut own = OWN.write().unwrap_or_else(PoisonError::into_inner);
    match newest(&own, name) {
        Some((_, None)) => return Err(RegisterError::Taken(name)),
        Some((EffectKind::Own(known), Some(same)))
            if known.description == effect.description
                && known.priors == effect.priors
                && same.kind == formula.kind
                && same.held == formula.held =>
        {
            return Ok(EffectKind::Own(known));
        }
        _ => {}
    }
    let kind = EffectKind::Own(Box::leak(Box::new(effect)));
    own.push((kind, Some(Box::leak(Box::new(formula)))));
    Ok(kind)
}

/// The one of that name that was registered last.
fn newest<'a>(own: &'a [Own], name: &str) -> Option<&'a Own> {
    own.iter().rev().find(|(known, _)| known.name() == name)
}

/// The formula that an effect came as.
pub fn formula_of(effect: EffectKind) -> Option<&'static Formula> {
    let own = OWN.read().unwrap_or_else(PoisonError::into_inner);
    let found = own.iter().find(|(known, _)| *known == effect);
    found.and_then(|(_, formula)| *formula)
}

fn check(effect: &OwnEffect) -> Result<(), RegisterError> {
    let Description {
        name,
        form,
        enters,
        parameters,
        ..
    } = effect.description;
    let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(is_word) {
        return Err(RegisterError::Name(name));
    }
    let own_form = match effect.coupled {
        Some(_) => Form::Coupled,
        None => Form::Columns,
    };
    if (form, enters) != (own_form, Enters::Column) {
        return Err(RegisterError::Form(name));
    }
    let columns = effect.description.linear().count();
    let is_usable = (1..=MAX_COLUMNS).contains(&columns)
        && parameters.len() <= MAX_PARAMETERS
        && parameters.len() - columns <= MAX_SHAPES
        && parameters.iter().all(|p| p.shape == p.grid.is_some())
        && effect.priors.len() == parameters.len()
        && effect.priors.iter().all(|prior| prior.std > 0.0);
    is_usable
        .then_some(())
        .ok_or(RegisterError::Parameters(name))
}

/// All effects that any robot may have: the catalogue's first, then those that were registered, in the order of that. A formula is of the model
/// that has it.
pub fn effects() -> impl Iterator<Item = EffectKind> {
    let own = OWN.read().unwrap_or_else(PoisonError::into_inner).clone();
    let own = own.into_iter().filter(|(_, formula)| formula.is_none());
    let own = own.map(|(effect, _)| effect);
    EffectKind::ALL.iter().copied().chain(own)
}

/// Their names.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    effects().map(EffectKind::name)
}

/// The effect of that name; of several formulas the one that was defined last.
pub fn effect_named(name: &str) -> Option<EffectKind> {
    let own = || OWN.read().unwrap_or_else(PoisonError::into_inner);
    EffectKind::from_name(name).or_else(|| newest(&own(), name).map(|(effect, _)| *effect))
}

/// Where an effect stands among all: formulas last.
pub(crate) fn order(effect: EffectKind) -> usize {
    effects()
        .position(|known| known == effect)
        .unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::effect::{Parameter, Prior, Term};

    /// Nothing is registered here: it would be a candidate of every other test of this process.
    #[test]
    fn what_is_no_torque_with_columns_is_refused() {
        const ONE: &[Parameter] = &[Parameter::new("c", "N m", 0.0, 1.0)];
        let refused = |description| {
            register(OwnEffect {
                description,
                priors: &[Prior {
                    mean: 0.0,
                    std: 1.0,
                }],
                others: &[],
                terms: &|_, _, _| [Term::zero(); MAX_COLUMNS],
                coupled: None,
            })
        };
        let of = |name| Description {
            name,
            parameters: ONE,
            ..Description::TORQUE
        };
        assert_eq!(refused(of("coulomb")), Err(RegisterError::Taken("coulomb")));
        assert_eq!(refused(of("Own")), Err(RegisterError::Name("Own")));
        let gravity = Description {
            form: Form::Gravity,
            ..of("a")
        };
        assert_eq!(refused(gravity), Err(RegisterError::Form("a")));
        let nothing = Description {
            parameters: &[],
            ..of("b")
        };
        assert_eq!(refused(nothing), Err(RegisterError::Parameters("b")));
    }
}
