//! `excite --standing`: a motion that tells the trunk.

use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use crate::estimate::Status;
use crate::excite::trunk::output::{TrunkCoefficients, write_trunk_csv};
use crate::excite::trunk::{self, TrunkParameter};
use crate::excite::{Measures, Settings};
use crate::model::{Model, significant};
use crate::output;
use crate::table::{Table, with_std};

use super::{Error, Excite, Shown, json, result, write_motion};

/// Length of a period unless another is asked for, s, and waves in it: from 0.4 to 2 Hz, which a robot on its feet follows.
const PERIOD: f64 = 2.5;
const HARMONICS: usize = 5;

/// What is reported of a motion of the trunk.
#[derive(Debug, Serialize)]
struct TrunkReport {
    motion: PathBuf,
    coefficients: Option<PathBuf>,
    #[serde(flatten)]
    measures: Measures,
    violations: usize,
    seconds: f64,
    duration: f64,
    seed: u64,
    interrupted: bool,
    /// The largest share of its friction cone that a foot uses.
    cone: f64,
    /// The least normal force of a foot, N.
    least_load: f64,
    /// How far the feet's balls roll, m.
    rolling: f64,
    trunk: Vec<TrunkParameter>,
}

/// Designs, writes and reports a motion over planted feet.
pub(super) fn standing(asked: &Excite, model: &Model, begun: Instant) -> Result<String, Error> {
    output::finish_search_on_interrupt();
    let settings = settings(asked);
    let ground = asked.trunk.ground();
    let design = trunk::standing(model, &settings, ground, &Shown::new())?;
    let series = TrunkCoefficients::of(&design.motion, ground.height, asked.seed);
    let [cone, least_load] = design.cone;
    let report = TrunkReport {
        motion: asked.output.clone(),
        coefficients: asked.coefficients(),
        measures: design.measures,
        violations: design.violations.len(),
        seconds: begun.elapsed().as_secs_f64(),
        duration: asked.duration,
        seed: asked.seed,
        interrupted: output::asked_to_finish(),
        cone,
        least_load,
        rolling: design.rolling,
        trunk: design.trunk.clone(),
    };
    // What is not within the limits is not written: it must not be played.
    if let Some(first) = design.violations.first() {
        return Err(Error::NotWithinLimits(first.clone()));
    }
    output::end_on_interrupt();
    write_motion(&asked.output, |file| {
        let command = |t| design.command(t);
        write_trunk_csv(file, asked.duration, command, asked.gains())
    })?;
    if let Some(path) = &report.coefficients {
        output::write(path, &json(&series))?;
    }
    Ok(if asked.json {
        result("excite", &report)
    } else {
        report.to_string()
    })
}

fn settings(asked: &Excite) -> Settings {
    let usual = || asked.duration / (asked.duration / PERIOD).round().max(1.0);
    Settings {
        duration: asked.duration,
        period: asked.period.unwrap_or_else(usual),
        harmonics: asked.harmonics.map_or(HARMONICS, |n| n as usize),
        margins: asked.limits.margins(),
        seed: asked.seed,
        starts: asked.starts as usize,
        ..Settings::default()
    }
}

/// What is said of a parameter, as identifications say it.
fn said(status: Status) -> &'static str {
    match status {
        Status::Identified => "identified",
        Status::Prior => "prior",
        Status::Unexcited => "unexcited",
    }
}

impl fmt::Display for TrunkReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::default();
        table.row(["trunk", "unit", "model", "± before", "± after", ""].map(str::to_owned));
        for own in &self.trunk {
            table.row([
                own.name.clone(),
                own.unit.to_owned(),
                with_std(own.value, own.std),
                significant(own.prior_std, 3).to_string(),
                significant(own.std, 3).to_string(),
                said(own.status).to_owned(),
            ]);
        }
        writeln!(
            f,
            "{table}\nExpected for 0.1 N m of noise in an equation; before any data the trunk is known to 30 %.\n\
             Condition number of the trunk's columns {:.1} (in SI {:.1}), rank {}; log det {:.1} beside all other parameters.",
            self.measures.condition_number,
            self.measures.condition_number_si,
            self.measures.rank,
            self.measures.log_det,
        )?;
        writeln!(
            f,
            "At every sample within the limits; a foot uses {:.0} % of its friction cone at most, and carries {:.1} N at least.\n\
             A foot's ball rolls up to {:.1} mm, which the design takes for standing still.",
            100.0 * self.cone,
            self.least_load,
            1e3 * self.rolling,
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
