//! What logs know already: their rows of the momentum equation, folded into one triangle per limb.

use std::path::Path;

use nalgebra::DMatrix;
use proprio_core::inertia::INERTIAL;

use super::ExciteError;
use super::limb::{self, LogSample};
use super::settings::Earlier;
use crate::log::{LogError, LogReader, Selection};
use crate::model::{self, Model};

/// Rows that are gathered before they are folded: memory does not grow with a log's length.
const GATHERED: usize = 2000;

/// Why logs say nothing.
#[derive(Debug, thiserror::Error)]
pub enum EarlierError {
    /// A log that cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A limb that cannot be designed for.
    #[error(transparent)]
    Excite(#[from] ExciteError),
    /// No log has any of the limbs.
    #[error("none of the logs records {0}")]
    NotRecorded(String),
}

/// The triangle of one limb's rows, growing.
struct Folded<'a> {
    limb: &'a model::Limb,
    body: Box<dyn limb::Limb>,
    weights: Vec<f64>,
    rows: Vec<f64>,
    columns: usize,
    triangle: Option<DMatrix<f64>>,
    /// Rows of the inertial columns alone, not weighted, and their triangle.
    inertial_rows: Vec<f64>,
    inertial: Option<DMatrix<f64>>,
}

impl Folded<'_> {
    fn gather(&mut self, joint: usize, row: &[f64]) {
        let weight = self.weights[joint];
        self.rows.extend(row.iter().map(|x| weight * x));
        self.inertial_rows
            .extend_from_slice(&row[..INERTIAL * self.body.joints()]);
        if self.rows.len() >= GATHERED * self.columns {
            self.fold();
        }
    }

    fn fold(&mut self) {
        if self.rows.is_empty() {
            return;
        }
        fold_in(&mut self.triangle, &mut self.rows, self.columns);
        let columns = INERTIAL * self.body.joints();
        fold_in(&mut self.inertial, &mut self.inertial_rows, columns);
    }
}

/// Folds gathered rows into a triangle.
fn fold_in(triangle: &mut Option<DMatrix<f64>>, rows: &mut Vec<f64>, columns: usize) {
    let gathered = DMatrix::from_row_slice(rows.len() / columns, columns, rows);
    *triangle = Some(super::cost::triangle(&gathered, triangle.as_ref()));
    rows.clear();
}

/// What `logs` know of each of `limbs` that any of them records.
///
/// # Errors
/// [`EarlierError`].
pub fn read(
    model: &Model,
    limbs: &[model::Limb],
    logs: &[impl AsRef<Path>],
    mut progress: impl FnMut(u64, u64),
) -> Result<Vec<Earlier>, EarlierError> {
    let mut folded: Vec<Folded<'_>> = Vec::new();
    for limb in limbs {
        let body = limb::of(model, limb)
            .ok_or_else(|| ExciteError::TooLarge(limb.name.clone(), limb.bodies.len()))?;
        let columns = body.log_columns();
        folded.push(Folded {
            limb,
            weights: super::setup::window_weights(model, limb),
            rows: Vec::with_capacity((GATHERED + 8) * columns),
            columns,
            triangle: None,
            inertial_rows: Vec::new(),
            inertial: None,
            body,
        });
    }
    for log in logs {
        let mut reader = LogReader::open_of(log.as_ref(), Selection::Motion, model.robot())?;
        let mut windows: Vec<_> = folded.iter().map(|of| of.body.log_window()).collect();
        while let Some(row) = reader.next_row()? {
            for (of, window) in folded.iter_mut().zip(&mut windows) {
                let own = of.limb.bodies.clone();
                let sample = LogSample {
                    time_us: row.time_us,
                    q: &row.q()[own.clone()],
                    dq: &row.dq()[own.clone()],
                    tau: &row.tau()[own],
                };
                // A limb that the log does not have is not a number, and its window takes none.
                window.push(&sample, &mut |joint, row| of.gather(joint, row));
            }
            let (done, total) = reader.progress();
            progress(done, total);
        }
        reader.finish()?;
        reader.long_enough()?;
    }
    folded.iter_mut().for_each(Folded::fold);
    let known: Vec<Earlier> = folded
        .into_iter()
        .filter_map(|of| {
            Some(Earlier {
                limb: of.limb.name.clone(),
                triangle: of.triangle?,
                inertial: of.inertial?,
            })
        })
        .collect();
    if known.is_empty() {
        let names: Vec<&str> = limbs.iter().map(|limb| limb.name.as_str()).collect();
        return Err(EarlierError::NotRecorded(names.join(", ")));
    }
    Ok(known)
}
