//! A comparison as a file for other programs: a table, or MCAP for their viewers.

use std::io::{self, Write};
use std::path::Path;

use super::{Comparison, csv};
use crate::model::Model;
use crate::output::{AtomicFile, WriteError};
use crate::recording::Recording;

/// Writes it, whole or not at all: as MCAP at the log's own rate where the file's name ends so, else as CSV, a row per window. `model` is the one
/// that was compared; where its values were fitted, MCAP has those of a fit to all of the recording, and says so in `/events`.
///
/// # Errors
/// [`WriteError`].
pub fn save(
    comparison: &Comparison,
    recording: &Recording,
    model: &Model,
    path: &Path,
) -> Result<(), WriteError> {
    let unwritable = |source| WriteError {
        path: path.to_owned(),
        source,
    };
    let mut file = AtomicFile::create(path)?;
    let is_mcap = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
    if is_mcap {
        let bytes = mcap(comparison, recording, model).map_err(unwritable)?;
        file.write_all(&bytes).map_err(unwritable)?;
    } else {
        csv::write(&mut file, &comparison.series).map_err(unwritable)?;
    }
    file.flush().map_err(unwritable)?;
    file.commit()
}

#[cfg(feature = "mcap")]
fn mcap(comparison: &Comparison, recording: &Recording, model: &Model) -> io::Result<Vec<u8>> {
    use crate::identify::{FitOptions, fit_model};
    use crate::model::Provenance;

    if !comparison.fitted {
        return super::mcap::bytes(comparison, recording, model);
    }
    let options = FitOptions::PHYSICAL;
    let fitted = fit_model(recording, model, options).map_err(io::Error::other)?;
    let provenance = Provenance::of(&recording.logs).map_err(|(_, error)| error)?;
    let fitted = fitted.to_model(model, provenance.under(&recording.only));
    let mut said = comparison.clone();
    let words = "values are fitted to all of these logs: this error is not held out";
    said.warnings.push(words.to_owned());
    super::mcap::bytes(&said, recording, &fitted.map_err(io::Error::other)?)
}

#[cfg(not(feature = "mcap"))]
fn mcap(_: &Comparison, _: &Recording, _: &Model) -> io::Result<Vec<u8>> {
    Err(crate::output::not_built("MCAP", "mcap"))
}
