//! `proprio identify --factor`: what the data of logs and devices say together.

use std::fmt;
use std::path::PathBuf;

use crate::estimate::{LEGEND, ParameterEstimate, effect_table, find};
use crate::factors::{Factors, LegSolution};
use proprio_core::go2::{JointId, Leg};
use serde::Serialize;

use super::result;
use crate::command::Error;

/// What is printed.
#[derive(Serialize)]
struct Report {
    factors: Vec<PathBuf>,
    parameters: Vec<ParameterEstimate>,
    legs: Vec<LegReport>,
}

#[derive(Serialize)]
struct LegReport {
    #[serde(serialize_with = "name")]
    leg: Leg,
    /// Windows of data.
    windows: f64,
    /// Each joint's noise: standard deviation of a window's mean torque, N m.
    noise: [f64; 3],
}

fn name<S: serde::Serializer>(leg: &Leg, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(leg.name())
}

/// Merges the files and solves each leg.
pub(super) fn run(files: &[PathBuf], as_json: bool) -> Result<String, Error> {
    let mut merged: Option<Factors> = None;
    let mut read: Vec<(&PathBuf, Factors)> = Vec::new();
    for file in files {
        let factors = Factors::read(file)?;
        for (other, known) in &read {
            factors.belongs_to(file, (other, known))?;
        }
        read.push((file, factors));
    }
    for (_, factors) in read {
        match &mut merged {
            Some(merged) => merged.merge(&factors)?,
            None => merged = Some(factors),
        }
    }
    let mut report = Report {
        factors: files.to_vec(),
        parameters: Vec::new(),
        legs: Vec::new(),
    };
    if let Some(factors) = &merged {
        for leg in factors.legs() {
            let LegSolution {
                leg,
                windows,
                noise,
                parameters,
            } = factors.solve(leg)?;
            report.parameters.extend(parameters);
            report.legs.push(LegReport {
                leg,
                windows,
                noise,
            });
        }
    }
    Ok(match as_json {
        true => result("identify", &report),
        false => report.to_string(),
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = self.legs.iter().flat_map(|report| {
            let noise = report.noise.map(|noise| [format!("{noise:.4}")]);
            JointId::of(report.leg)
                .map(|joint| joint.name().to_owned())
                .into_iter()
                .zip(noise)
        });
        let (rows, find) = (rows.collect::<Vec<_>>(), |name: &str| {
            find(&self.parameters, name)
        });
        let table = effect_table(find, [["noise", "N m"]], &rows);
        writeln!(f, "{table}{LEGEND}")?;
        let files = self.factors.len();
        for LegReport { leg, windows, .. } in &self.legs {
            let name = leg.name();
            let files = match files {
                1 => "1 file".to_owned(),
                more => format!("{more} files"),
            };
            writeln!(f, "{name}: {windows:.0} windows of {files}.")?;
        }
        Ok(())
    }
}
