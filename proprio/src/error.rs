//! Why a step of the loop cannot be done.

use std::path::PathBuf;

use proprio_host::command::hint;
use proprio_host::dynamics::DynamicsError;
use proprio_host::excite::ExciteError;
use proprio_host::identify::NotAModel;
use proprio_host::model::{AskedError, ModelError, RobotError, UnknownName};
use proprio_host::output::WriteError;
use proprio_host::recording::RecordingError;

/// Why a step of the loop cannot be done. Its words are those of the command, and so is its [`hint`](Self::hint).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A log cannot be read, or its numbers cannot be a robot's: which file, where in it, and why.
    #[error("{0}")]
    Log(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The logs are too short for what was asked.
    #[error("too short: {samples} samples, {duration:.2} s; at least {least} s are needed")]
    TooShort {
        /// Samples of all logs together.
        samples: u64,
        /// Length of all logs together, s.
        duration: f64,
        /// What is needed, s.
        least: f64,
    },
    /// No joint moves, and one at rest tells nothing.
    #[error("no joint moves")]
    AtRest,
    /// The log is not of what the model says: signs, units, exchanged joints, a base that moves; one sentence each.
    #[error("not what the model says: {}", .0.join("; "))]
    Mismatch(Vec<String>),
    /// A model file, or a robot's URDF, is refused: which file, where in it, and why.
    #[error("{0}")]
    Model(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// There is no such joint or effect.
    #[error("there is no {what} `{name}`")]
    UnknownName {
        /// What was looked for: `joint`, `effect`.
        what: &'static str,
        /// The name as given.
        name: String,
        /// The existing name nearest in spelling.
        nearest: Option<String>,
    },
    /// What was identified cannot be of any body: of which, and why not.
    #[error("{0}")]
    Unphysical(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The effects that were asked for cannot be added: which, and why not.
    #[error("{0}")]
    Effect(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// A motion cannot be designed: which setting or limit leaves none.
    #[error("{0}")]
    Motion(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// Samples whose number does not fit the robot's joints, or a robot whose dynamics cannot be computed.
    #[error("{0}")]
    Dynamics(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// A file cannot be written.
    #[error("{}: {source}", .path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
}

impl Error {
    /// What can be done about it, if there is anything.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Log(error) => error.downcast_ref().map(hint::of_recording),
            Self::TooShort { .. } => Some(hint::TOO_SHORT.to_owned()),
            Self::AtRest => Some(hint::AT_REST.to_owned()),
            Self::Model(error) => match error.downcast_ref() {
                Some(error) => hint::of_model(error),
                None => error.downcast_ref().and_then(hint::of_robot),
            },
            Self::UnknownName { nearest, .. } => {
                let name = nearest.as_ref()?;
                Some(format!("did you mean `{name}`?"))
            }
            Self::Effect(error) => error.downcast_ref().and_then(hint::of_asked),
            Self::Motion(error) => match error.downcast_ref() {
                Some(error) => hint::of_excite(error),
                None => Some(hint::NOT_WITHIN_LIMITS.to_owned()),
            },
            Self::Write { source, .. } => hint::of_writing(source).map(str::to_owned),
            Self::Mismatch(_) => Some(hint::CORRECT_THE_LOG.to_owned()),
            Self::Unphysical(_) | Self::Dynamics(_) => None,
        }
    }
}

// Functions, not `From`: that would make the rooms' own errors a part of this crate's promise.

pub(crate) fn recording(error: RecordingError) -> Error {
    match error {
        RecordingError::TooShort {
            samples,
            duration,
            least,
            ..
        } => Error::TooShort {
            samples,
            duration,
            least,
        },
        RecordingError::AtRest { .. } => Error::AtRest,
        other => Error::Log(Box::new(other)),
    }
}

pub(crate) fn unreadable((log, cause): (String, std::io::Error)) -> Error {
    Error::Log(format!("{log}: {cause}").into())
}

pub(crate) fn model(error: ModelError) -> Error {
    Error::Model(Box::new(error))
}

pub(crate) fn robot(error: RobotError) -> Error {
    Error::Model(Box::new(error))
}

pub(crate) fn name(error: UnknownName) -> Error {
    Error::UnknownName {
        what: error.what,
        nearest: error.nearest().map(str::to_owned),
        name: error.name,
    }
}

pub(crate) fn not_a_model(error: NotAModel) -> Error {
    Error::Unphysical(Box::new(error))
}

pub(crate) fn write(error: WriteError) -> Error {
    Error::Write {
        path: error.path,
        source: error.source,
    }
}

pub(crate) fn asked(error: AskedError) -> Error {
    match error {
        AskedError::Name(unknown) => name(unknown),
        other => Error::Effect(Box::new(other)),
    }
}

pub(crate) fn motion(error: ExciteError) -> Error {
    match error {
        ExciteError::Unknown(unknown) => name(unknown),
        other => Error::Motion(Box::new(other)),
    }
}

pub(crate) fn dynamics(error: DynamicsError) -> Error {
    match error {
        DynamicsError::Limb(unknown) => name(unknown),
        other => Error::Dynamics(Box::new(other)),
    }
}

pub(crate) fn page(error: std::io::Error) -> Error {
    Error::Write {
        path: PathBuf::from("the page"),
        source: error,
    }
}
