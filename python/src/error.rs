//! Errors as exceptions, with the hint that the command prints.

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    proprio,
    Error,
    PyException,
    "Why a step cannot be done. `hint` is what can be done about it, or None."
);
create_exception!(
    proprio,
    LogError,
    Error,
    "A log cannot be read or used: which, where in it, and why."
);
create_exception!(
    proprio,
    ModelError,
    Error,
    "A model file or a URDF is refused, or values that no body has: which, and why."
);
create_exception!(
    proprio,
    UnknownNameError,
    Error,
    "There is no such joint, limb or effect, or a formula cannot be read."
);
create_exception!(
    proprio,
    MotionError,
    Error,
    "No motion can be designed within these limits."
);
create_exception!(
    proprio,
    DynamicsError,
    Error,
    "Samples that do not fit the robot, or a robot whose dynamics cannot be computed."
);
create_exception!(proprio, WriteError, Error, "A file cannot be written.");

/// The exception of an error of the library.
pub(crate) fn exception(error: &proprio::Error) -> PyErr {
    let hint = error.hint();
    let text = match &hint {
        Some(hint) => format!("{error}\nhint: {hint}"),
        None => error.to_string(),
    };
    let made = match error {
        proprio::Error::Log(_)
        | proprio::Error::TooShort { .. }
        | proprio::Error::AtRest
        | proprio::Error::Mismatch(_) => LogError::new_err(text),
        proprio::Error::Model(_) | proprio::Error::Unphysical(_) => ModelError::new_err(text),
        proprio::Error::UnknownName { .. } | proprio::Error::Effect(_) => {
            UnknownNameError::new_err(text)
        }
        proprio::Error::Motion(_) => MotionError::new_err(text),
        proprio::Error::Dynamics(_) => DynamicsError::new_err(text),
        proprio::Error::Write { .. } => WriteError::new_err(text),
        _ => Error::new_err(text),
    };
    Python::attach(|py| match made.value(py).setattr("hint", hint) {
        Ok(()) => made,
        Err(other) => other,
    })
}
