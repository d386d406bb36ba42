//! From logs to parameters: what `proprio identify` does.
//!
//! Rows of a log go through the core's windows into one factor per leg and fold, and are forgotten: memory does not grow
//! with the log. Time is cut into blocks that fall into two folds by turns, with a guard between blocks that belongs to
//! neither; the fit uses everything, and the held-out error is that of each fold under the fit to the other.

mod base_rows;
mod bus;
mod free_base;
mod leg;
pub(crate) mod model_fit;
mod result;
mod runs;
mod to_model;

use std::path::{Path, PathBuf};

use proprio_core::factor::FactorError;
use proprio_core::go2::{LEGS, Leg};

use crate::estimate::Constraint;
pub use crate::estimate::Method;
pub use crate::estimate::stages::{Stage, StageParameter};
use crate::log::{LogError, LogReader, Samples, Selection, Warning};
pub(crate) use free_base::walk_parameters;
pub use free_base::{FreeBaseIdentification, Quantity, identify_free_base};
use leg::LegIdentifier;
pub use model_fit::{
    FitOptions, Fitted, FittedJoint, FittedParameter, NotReproduced, Where, check_reproduced,
    fit_model, fit_runs,
};
pub use result::{Identification, JointFit};
pub use runs::{Consistency, Run, RunValue};
pub(crate) use to_model::set_joint;
pub use to_model::{NotAModel, set_possible};

/// How to identify.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Round every sample to what the motor bus can carry, so that the result is that of a device which hears the log
    /// over its bus.
    pub bus: bool,
    /// Whether values may be unphysical.
    pub constraint: Constraint,
}

/// Why no parameters come out.
#[derive(Debug, thiserror::Error)]
pub enum IdentificationError {
    /// A log is bad.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Most of a leg's samples are beyond what the robot can do.
    #[error(
        "{}, line {line}: the {what} of leg {} is more than the robot can do; so are {percent:.0} % of its samples",
        .path.display(), .leg.name()
    )]
    Impossible {
        /// The log.
        path: PathBuf,
        /// The first such line.
        line: u64,
        /// The leg.
        leg: Leg,
        /// Which quantity.
        what: &'static str,
        /// Share of the samples, %.
        percent: f64,
    },
    /// A leg's samples do not make a single window.
    #[error(
        "{}: leg {} has no {window_ms} ms of samples without a gap or a fault: of {} samples, {} repeat the one before, {} \
         are late, {} impossible, and {} gaps lie between them",
        .path.display(), .leg.name(), .samples.total, .samples.repeated, .samples.late, .samples.rejected, .samples.gaps
    )]
    NoWindows {
        /// The last log.
        path: PathBuf,
        /// The leg.
        leg: Leg,
        /// What became of its samples.
        samples: Samples,
        /// Length of a window, ms.
        window_ms: u64,
    },
    /// The linear algebra refused; the data passed every check before it.
    #[error("the parameters of leg {} cannot be solved for: {source}", .leg.name())]
    Solve {
        /// The leg.
        leg: Leg,
        /// Why.
        source: FactorError,
    },
}

/// Identifies the robot from its `logs`, taken together. `progress` hears of bytes read, and of how many in all.
///
/// # Errors
/// [`IdentificationError`]; the first bad log stops the work.
pub fn identify(
    logs: &[PathBuf],
    options: Options,
    mut progress: impl FnMut(u64, u64),
) -> Result<Identification, IdentificationError> {
    let mut legs: [Option<LegIdentifier>; LEGS] = [const { None }; LEGS];
    let mut warnings = Vec::new();
    for path in logs {
        let told = read(path, options, &mut legs, &mut progress)?;
        warnings.extend(
            told.iter()
                .map(|warning| format!("{}: {warning}", path.display())),
        );
        for identifier in legs.iter_mut().flatten() {
            warnings.extend(identifier.end_log(path)?);
        }
    }
    let mut fits = Vec::new();
    for identifier in legs.iter().flatten() {
        let (leg, samples) = (identifier.leg(), identifier.samples());
        if identifier.windows() == 0 {
            let path = logs.last().cloned().unwrap_or_default();
            let window_ms = leg::SETTINGS.window_us / 1000;
            return Err(IdentificationError::NoWindows {
                path,
                leg,
                samples,
                window_ms,
            });
        }
        let fit = identifier.fit(options.constraint);
        fits.push(fit.map_err(|source| IdentificationError::Solve { leg, source })?);
    }
    Ok(Identification::new(logs, &fits, warnings))
}

/// Feeds one log to the identifiers of its legs.
fn read(
    path: &Path,
    options: Options,
    legs: &mut [Option<LegIdentifier>; LEGS],
    progress: &mut impl FnMut(u64, u64),
) -> Result<Vec<Warning>, LogError> {
    /// Rows between two reports of progress.
    const STRIDE: u64 = 1024;
    let mut reader = LogReader::open(path, Selection::Motion)?;
    let recorded: Vec<Leg> = reader.columns().legs().collect();
    for &leg in &recorded {
        legs[leg.index()].get_or_insert_with(|| LegIdentifier::new(leg));
    }
    while let Some(row) = reader.next_row()? {
        for &leg in &recorded {
            if let Some(identifier) = &mut legs[leg.index()] {
                let sample = row.sample(leg);
                // What fits no frame is also more than the robot can do: the window rejects it.
                let heard = options.bus.then(|| bus::heard(&sample).ok()).flatten();
                identifier.push(&heard.unwrap_or(sample), row.line);
            }
        }
        if reader.checks().rows().is_multiple_of(STRIDE) {
            let (done, total) = reader.progress();
            progress(done, total);
        }
    }
    reader.finish()
}

#[cfg(test)]
mod tests;
