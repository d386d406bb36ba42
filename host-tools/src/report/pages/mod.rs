//! The page of each command: what it found, turned into sections.
//!
//! Files beside:
//!
//! - `calibrate`: the page of `calibrate`
//! - `compare`: the page of `compare`
//! - `diagnose`: the page of `diagnose`
//! - `excite`: the page of `excite`
//! - `fleet`: the page of a fleet
//! - `frf`: the page of `frf`
//! - `identify`: the page of `identify`
//! - `models`: the page of `compare` with several models
//! - `rollout`: the page of `compare --rollout`
//! - `validate`: the page of `validate`
//! - `walk`: the pages of a walk: `compare`, `identify` and `diagnose` with `--free-base`

mod calibrate;
mod compare;
mod diagnose;
pub mod excite;
mod fleet;
mod frf;
mod identify;
mod models;
mod rollout;
pub mod validate;
mod walk;

use std::io;
use std::path::PathBuf;

use super::correlation::Correlation;
use super::residual::ResidualSeries;
use super::robot::{self, DrawnJoint};
use super::torque::TorqueSeries;
use super::{Drawing, Finding, Header, LogFile, Moment, Section, correlation, residual, torque};
use crate::compare::{Comparison, JointSeries, RankedEpisode};
use crate::detect::residual::{Correlation as Lagged, Criticism, Input};
use crate::model::{Model, Provenance};
use crate::recording::LogGates;

pub use calibrate::calibration;
pub use compare::comparison;
pub use diagnose::DiagnosisPage;
pub use fleet::fleet;
pub use frf::responses;
pub use identify::fit;
pub use models::models;
pub use rollout::rollout;
pub use walk::{walk, walk_diagnosis, walk_identification};

/// Stands before the joint's name where a finding is of its error.
const OF_THE_ERROR: &str = " of the square error: ";
/// Moments that a page names.
const MOMENTS: usize = 3;

/// A log that cannot be read any more: its path, and why.
pub type Unreadable = (String, io::Error);

/// The robot as it stands on average, in the colours of its joints' errors.
fn drawing(model: &Model, series: &[JointSeries]) -> Drawing {
    let joint = |own: &JointSeries| DrawnJoint {
        name: own.joint.clone(),
        q: own.q.iter().sum::<f64>() / own.q.len().max(1) as f64,
        rms: own.rms(),
    };
    // A walk has the trunk's coordinates as well.
    let bodies = model.robot().bodies();
    let series = series.iter();
    let joints = series.filter(|own| bodies.iter().any(|body| body.name == own.joint));
    Drawing(robot::drawing(
        model,
        &joints.map(joint).collect::<Vec<_>>(),
    ))
}

/// The header: this command line, this version, these logs as they are now.
fn header(title: &str, findings: Vec<String>, logs: &[PathBuf]) -> Result<Header, Unreadable> {
    let Provenance { command, logs, .. } = Provenance::of(logs)?;
    let log = |log: crate::model::LogRecord| LogFile {
        path: log.path,
        sha256: log.sha256,
    };
    Ok(Header {
        title: title.to_owned(),
        findings: findings.into_iter().map(Finding::from).collect(),
        command,
        logs: logs.into_iter().map(log).collect(),
        ..Header::default()
    })
}

/// Links each finding of a joint's error with the joint's worst moment, and names the worst moments of all.
fn add_moments(findings: &mut Vec<Finding>, comparison: &Comparison) {
    let moment = |worst: &RankedEpisode| {
        Some(Moment {
            joint: worst.joint.clone(),
            time: worst.episode.t,
        })
    };
    for finding in findings.iter_mut() {
        let about = finding.text.split_once(OF_THE_ERROR);
        let worst = about.and_then(|(_, joint)| {
            let name = joint.split([':', ',']).next();
            let mut all = comparison.episodes.iter();
            all.find(|episode| Some(episode.joint.as_str()) == name)
        });
        finding.moment = worst.and_then(moment);
    }
    let worst = comparison.episodes.iter().take(MOMENTS);
    findings.extend(worst.map(|episode| Finding {
        text: format!("Worst moment: {episode}"),
        moment: moment(episode),
    }));
}

/// What is wrong with the samples, a sentence each.
fn of_data(data: &[LogGates]) -> impl Iterator<Item = String> + '_ {
    let findings = data.iter().flat_map(|log| &log.report.findings);
    findings.map(|finding| format!("Data: {finding}"))
}

/// Measured torque, and what the baselines and then `model` predict.
fn torques(
    series: &[JointSeries],
    baselines: &[(impl AsRef<str>, Vec<JointSeries>)],
    model: &str,
) -> Section {
    let joint = |own: &JointSeries| {
        let of_baseline = |(name, joints): &(_, Vec<JointSeries>)| {
            let other = joints.iter().find(|other| other.joint == own.joint)?;
            let name: &str = AsRef::as_ref(name);
            Some((name.to_owned(), other.predicted_at(&own.t)))
        };
        TorqueSeries {
            joint: own.joint.clone(),
            t: own.t.clone(),
            measured: own.tau.clone(),
            predicted: baselines
                .iter()
                .filter_map(of_baseline)
                .chain([(model.to_owned(), own.predicted.clone())])
                .collect(),
        }
    };
    torque::section(&series.iter().map(joint).collect::<Vec<_>>())
}

/// What `model` leaves, against position and velocity.
fn residuals(series: &[JointSeries], model: &str) -> Section {
    let joint = |own: &JointSeries| ResidualSeries {
        joint: own.joint.clone(),
        q: own.q.clone(),
        dq: own.dq.clone(),
        residual: own.residual.clone(),
    };
    residual::section(&series.iter().map(joint).collect::<Vec<_>>(), model)
}

/// What is left, against its own past and the velocity's.
fn correlations(criticism: &[Criticism], model: &str) -> Section {
    let joint = |c: &Criticism| {
        let own = c
            .whiteness
            .iter()
            .map(|w| function(&c.joint, None, &w.autocorrelation));
        let velocity = c.independence.iter().filter(|i| i.input == Input::Velocity);
        let crossed = velocity.map(|i| function(&c.joint, Some(i.input), &i.correlation));
        own.chain(crossed).collect::<Vec<_>>()
    };
    correlation::section(&criticism.iter().flat_map(joint).collect::<Vec<_>>(), model)
}

/// A correlation function; of bands that differ from lag to lag, the widest.
fn function(joint: &str, input: Option<Input>, lags: &[Lagged]) -> Correlation {
    Correlation {
        joint: joint.to_owned(),
        input: input.map(|input| input.symbol().to_owned()),
        lag: lags.iter().map(|c| c.lag).collect(),
        value: lags.iter().map(|c| c.value).collect(),
        band: lags.iter().map(|c| c.band).fold(0.0, f64::max),
    }
}
