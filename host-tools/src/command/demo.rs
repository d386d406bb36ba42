//! `proprio demo`: the whole line on a robot whose truth is known.

use std::fmt;

use clap::Args;
use proprio::identification::{Identification, Options, identify};
use proprio::output::WriteError;
use proprio::parameter::Parameter;
use proprio::simulator::Simulation;
use proprio::simulator::hidden::typical;
use proprio::table::{Table, with_std};
use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;
use serde::Serialize;

use super::simulate::record;
use super::{Error, json};

/// Simulate a leg, identify it, and compare with the truth
///
/// A pinned leg with the friction, rotor inertia and torque offsets of a real Go2 moves for 20 s; its noisy, quantised log
/// is identified with a model that knows none of these values. Takes seconds and leaves no file behind.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio demo
  proprio demo --seed 7 --json")]
pub(crate) struct Demo {
    /// Seed of the motion and of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// An estimate this many standard deviations from the truth still passes.
const TOLERANCE: f64 = 3.0;

#[derive(Debug, Serialize)]
struct Report {
    parameters: Vec<Comparison>,
    urdf_rms: f64,
    rms: f64,
    held_out_rms: Option<f64>,
    passed: bool,
}

#[derive(Debug, Serialize)]
struct Comparison {
    name: String,
    unit: &'static str,
    truth: f64,
    value: f64,
    std: f64,
    passed: bool,
}

impl Demo {
    pub(crate) fn run(self) -> Result<String, Error> {
        let leg = Leg::FR;
        let simulation = Simulation {
            effects: typical(&[leg]),
            seed: self.seed,
            ..Simulation::new(&[leg])
        };

        let place = std::env::temp_dir();
        let unwritable = |source| WriteError {
            path: place.clone(),
            source,
        };
        let directory = tempfile::tempdir().map_err(unwritable)?;
        let log = directory.path().join("demo.csv");
        record(&simulation, &log)?;
        let result = identify(&[log], Options::default(), |_, _| ())?;

        let report = Report::new(&simulation.truth(), &result);
        Ok(if self.json {
            json(&report)
        } else {
            report.to_string()
        })
    }
}

impl Report {
    fn new(truth: &[Parameter], result: &Identification) -> Self {
        let effect = |parameter: &&Parameter| {
            EffectKind::ALL
                .iter()
                .any(|e| parameter.name.starts_with(&format!("{}:", e.name())))
        };
        let compare = |truth: &Parameter| {
            let estimate = result.parameter(&truth.name)?;
            Some(Comparison {
                name: truth.name.clone(),
                unit: truth.unit,
                truth: truth.value,
                value: estimate.value,
                std: estimate.std,
                passed: (estimate.value - truth.value).abs() <= TOLERANCE * estimate.std,
            })
        };
        let parameters: Vec<_> = truth.iter().filter(effect).filter_map(compare).collect();
        let passed = parameters.iter().all(|parameter| parameter.passed);
        let (urdf_rms, rms, held_out_rms) = (result.urdf_rms, result.rms, result.held_out_rms);
        Self {
            parameters,
            urdf_rms,
            rms,
            held_out_rms,
            passed,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "A simulated leg has friction, rotor inertia and torque offsets that its URDF does not know."
        )?;
        writeln!(f, "From 20 s of its motor bus, noisy and quantised:\n")?;
        let mut table = Table::default();
        table.row(["parameter", "unit", "true", "estimated"].map(str::to_owned));
        for parameter in &self.parameters {
            let error = (parameter.value - parameter.truth) / parameter.std;
            let mark = if parameter.passed { "✓" } else { "✗" };
            table.row([
                parameter.name.clone(),
                parameter.unit.to_owned(),
                format!("{:.5}", parameter.truth),
                with_std(parameter.value, parameter.std),
                format!("{error:+.1} std {mark}"),
            ]);
        }
        write!(f, "{table}")?;
        let verdict = if self.passed { "Every" } else { "Not every" };
        writeln!(
            f,
            "\n{verdict} estimate lies within {TOLERANCE} standard deviations of the truth."
        )?;
        writeln!(
            f,
            "Torque error, mean over 20 ms: {:.3} N m rms with the URDF, {:.3} with what was identified.",
            self.urdf_rms, self.rms
        )
    }
}
