//! Values that a model may hold.

use proprio_core::effect::{EffectKind, Prior};

use super::physical::Unphysical;

/// A value that no body, no friction and no prior can have.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Impossible {
    /// A parameter is outside its bounds or not finite.
    #[error("{symbol} = {value} is not between {lower} and {upper}")]
    Bounds {
        /// The parameter's symbol.
        symbol: &'static str,
        /// The value.
        value: f64,
        /// Least physical value.
        lower: f64,
        /// Greatest physical value.
        upper: f64,
    },
    /// A standard deviation of a prior is not positive, or not finite.
    #[error("a standard deviation of {0} is not positive")]
    Deviation(f64),
    /// A body that cannot exist.
    #[error(transparent)]
    Body(#[from] Unphysical),
}

pub(super) fn in_bounds(
    effect: EffectKind,
    parameter: usize,
    value: f64,
) -> Result<f64, Impossible> {
    let parameter = &effect.description().parameters[parameter];
    if value.is_finite() && (parameter.lower..=parameter.upper).contains(&value) {
        return Ok(value);
    }
    Err(Impossible::Bounds {
        symbol: parameter.symbol,
        value,
        lower: parameter.lower,
        upper: parameter.upper,
    })
}

/// A number of any sign and size.
pub(super) fn finite(symbol: &'static str, value: f64) -> Result<f64, Impossible> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(Impossible::Bounds {
        symbol,
        value,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
    })
}

/// A number that dissipates or is nothing.
pub(super) fn not_negative(symbol: &'static str, value: f64) -> Result<f64, Impossible> {
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(Impossible::Bounds {
        symbol,
        value,
        lower: 0.0,
        upper: f64::INFINITY,
    })
}

/// A standard deviation of an estimate, which may be zero.
pub(super) fn deviation(std: f64) -> Result<f64, Impossible> {
    if std.is_finite() && std >= 0.0 {
        Ok(std)
    } else {
        Err(Impossible::Deviation(std))
    }
}

/// A standard deviation of a prior, which may not.
pub(super) fn positive(std: f64) -> Result<f64, Impossible> {
    if std.is_finite() && std > 0.0 {
        Ok(std)
    } else {
        Err(Impossible::Deviation(std))
    }
}

pub(super) fn possible(effect: EffectKind, prior: Prior) -> Result<Prior, Impossible> {
    in_bounds(effect, 0, prior.mean)?;
    positive(prior.std)?;
    Ok(prior)
}
