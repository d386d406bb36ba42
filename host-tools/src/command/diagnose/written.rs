//! What `--apply` makes of the model file: effects, and what the logs give them.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::command::{Error, save_with_other_witnesses};
use crate::identify::model_fit::{FitOptions, check_reproduced, fit_model};
use crate::model::{Model, Provenance};
use crate::recording::Recording;

/// Where the values of a written model come from.
pub(super) enum Values {
    /// From the logs that were diagnosed.
    OfTheseLogs(Provenance),
    /// The file has values of other logs, which these would replace: they stay, and effects that are new have none.
    OfOtherLogs,
    /// From none: part of the logs is not what the model says.
    Untold,
}

/// The model file as it was written.
#[derive(Debug, Serialize)]
pub(in crate::command) struct Written {
    /// The file.
    file: PathBuf,
    /// How many effects it has, how many of them a value, and how many bodies that are not the CAD's.
    effects: usize,
    values: usize,
    bodies: usize,
    /// What the file, read back, leaves of these logs, N m; none where it has no values of theirs.
    rms: Option<f64>,
    #[serde(skip)]
    of_other_logs: bool,
}

impl Written {
    /// Writes `model`, with what the logs give every parameter if they may, and reads it back.
    ///
    /// # Errors
    /// If the file cannot be written, or predicts otherwise than the fit that its values are from.
    pub(super) fn to(
        path: &Path,
        recording: &Recording,
        mut model: Model,
        values: Values,
    ) -> Result<Self, Error> {
        let of_other_logs = matches!(values, Values::OfOtherLogs);
        let mut rms = None;
        match values {
            Values::OfTheseLogs(provenance) => {
                let options = FitOptions::PHYSICAL;
                for said in model.take_out_repeated() {
                    eprintln!("note: {said}");
                }
                let fitted = fit_model(recording, &model, options)?;
                model = fitted.to_model(&model, provenance)?;
                model.save(path)?;
                check_reproduced(recording, &model.read_back(path)?, &fitted)?;
                save_with_other_witnesses(&mut model, path)?;
                rms = Some(fitted.rms);
            }
            Values::OfOtherLogs | Values::Untold => model.save(path)?,
        }
        let valued = model.effects().iter().filter(|e| e.estimate().is_some());
        Ok(Self {
            file: path.to_owned(),
            effects: model.effects().len(),
            values: valued.count(),
            bodies: (0..model.robot().bodies().len())
                .filter(|&body| model.is_identified(body))
                .count(),
            rms,
            of_other_logs,
        })
    }
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (file, effects) = (self.file.display(), self.effects);
        let (values, bodies) = (self.values, self.bodies);
        match (self.rms, self.of_other_logs) {
            (Some(rms), _) => write!(
                f,
                "Wrote {file}: {values} of {effects} effects with values, {bodies} bodies; error of the file {rms:.4} N m on these logs (fitted data)"
            ),
            (None, true) => write!(
                f,
                "Wrote {file}: {effects} effects. Its values are of other logs and stay; effects that are new have none: \
                 `proprio identify` with all logs gives them"
            ),
            (None, false) => write!(
                f,
                "Wrote {file}: {effects} effects, without values: part of the logs was not judged"
            ),
        }
    }
}
