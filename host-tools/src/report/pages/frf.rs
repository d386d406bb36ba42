//! The page of `frf`.

use std::path::{Path, PathBuf};

use super::{Unreadable, header};
use crate::report::{Header, Page, responses};
use crate::spectrum::{Did, Frf};

/// Responses measured and modelled, noise against distortion, values.
///
/// # Errors
/// The path of a log that cannot be read any more, and why.
pub fn responses(found: &Frf, logs: &[PathBuf], model: Option<&Path>) -> Result<Page, Unreadable> {
    let summary = found.summary(model, Did::Written);
    let findings = summary
        .points
        .into_iter()
        .chain(found.warnings.iter().cloned());
    let header = header("Frequency responses", findings.collect(), logs)?;
    Ok(Page {
        header: Header {
            headline: summary.headline,
            next: summary.next,
            ..header
        },
        sections: vec![
            responses::bode(found.curves(), found.torque_unit),
            responses::scatter(found.curves()),
            responses::values(&found.parameters),
        ],
    }
    .folded())
}
