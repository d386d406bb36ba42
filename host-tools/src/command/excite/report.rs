//! What `excite` says of a design.

use std::path::PathBuf;

use crate::excite::{self, LimbDesign};
use crate::model::Model;
use crate::output;
use serde::Serialize;

use super::Excite;

/// What `excite` reports.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    motion: PathBuf,
    /// None where the motion is a stream, unless --coefficients names one.
    coefficients: Option<PathBuf>,
    condition_number: f64,
    condition_number_si: f64,
    rank: usize,
    log_det: f64,
    pub(super) violations: usize,
    seconds: f64,
    duration: f64,
    seed: u64,
    interrupted: bool,
    pub(super) limbs: Vec<LimbReport>,
}

#[derive(Debug, Serialize)]
pub(super) struct LimbReport {
    limb: String,
    #[serde(flatten)]
    measures: excite::Measures,
    pub(super) violations: Vec<String>,
}

impl Report {
    pub(super) fn new(
        asked: &Excite,
        model: &Model,
        designs: &[LimbDesign],
        coefficients: Option<PathBuf>,
        seconds: f64,
    ) -> Self {
        let most = |of: fn(&excite::Measures) -> f64| {
            designs
                .iter()
                .map(|design| of(&design.measures))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let limbs = designs.iter().map(|design| LimbReport {
            limb: design.limb.clone(),
            measures: design.measures,
            violations: design.violation_sentences(model),
        });
        Self {
            motion: asked.output.clone(),
            coefficients,
            condition_number: most(|m| m.condition_number),
            condition_number_si: most(|m| m.condition_number_si),
            rank: designs.iter().map(|design| design.measures.rank).sum(),
            log_det: designs.iter().map(|design| design.measures.log_det).sum(),
            violations: designs.iter().map(|design| design.violations.len()).sum(),
            seconds,
            duration: asked.duration,
            seed: asked.seed,
            interrupted: output::asked_to_finish(),
            limbs: limbs.collect(),
        }
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "limb       condition number     in SI   rank   log det")?;
        for limb in &self.limbs {
            let m = &limb.measures;
            writeln!(
                f,
                "{:<10} {:>16.2} {:>9.2} {:>6} {:>9.1}",
                limb.limb, m.condition_number, m.condition_number_si, m.rank, m.log_det
            )?;
        }
        writeln!(
            f,
            "\nCondition number of the identifiable inertias, each scaled by its prior; in SI,\n\
             columns are per kg, kg m and kg m^2. Within all limits at every instant, for\n\
             parameters off by the stated uncertainty."
        )?;
        if self.interrupted {
            writeln!(f, "Interrupted: the best motion until then.")?;
        }
        writeln!(
            f,
            "{}: {} s at 500 Hz, seed {}, found in {:.1} s",
            self.motion.display(),
            self.duration,
            self.seed,
            self.seconds,
        )?;
        match &self.coefficients {
            Some(path) => writeln!(f, "{}: its coefficients", path.display()),
            None => Ok(()),
        }
    }
}
