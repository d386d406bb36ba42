//! `proprio excite --frf`: periodic experiments for `frf`.

use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::super::Error;
use super::super::result::result;
use super::{Excite, write_motion};
use crate::excite::frf::{FrfDesign, FrfSettings, design, write_frf_csv};
use crate::excite::shapes::Shapes;
use crate::model::Model;
use crate::progress::Underway;
use crate::summary::{Summary, typed};

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    motion: PathBuf,
    points: usize,
    blocks: usize,
    experiments: usize,
    periods: usize,
    period: f64,
    lines: usize,
    band: [f64; 2],
    carrier: f64,
    duration: f64,
    rate: f64,
    joints: Vec<Joint>,
    violations: usize,
    seconds: f64,
    seed: u64,
}

/// What is planned for a joint and expected of its spring; deviations are shares of the value.
#[derive(Debug, Serialize)]
struct Joint {
    joint: String,
    rms: f64,
    stiffness: f64,
    stiffness_std: f64,
    stiffness_model_std: f64,
    damping: f64,
    damping_std: f64,
    damping_model_std: f64,
    spring: &'static str,
    friction: &'static str,
}

const STATED: &str = "stated";
const ASSUMED: &str = "assumed";

/// Plans experiments, writes and reports them.
pub(super) fn plan(asked: &Excite, model: &Model, begun: Instant) -> Result<String, Error> {
    let limbs = model.robot().limbs_named(&asked.legs)?;
    let experiments = &asked.experiments;
    let settings = FrfSettings {
        margins: asked.limits.margins(),
        shapes: asked.shapes.as_deref().map(Shapes::read).transpose()?,
        ..experiments.settings(asked.period, asked.rate, asked.seed)
    };
    let underway = Underway::new("Planning");
    let own = design(model, &limbs, &settings)?;
    // What is not within the limits is not written: it must not be played.
    if let Some(first) = own.violations.first() {
        return Err(Error::NotWithinLimits(first.clone()));
    }
    write_motion(&asked.output, |file| write_frf_csv(file, &own))?;
    drop(underway);
    if asked.json {
        let report = report(asked, &own, begun.elapsed().as_secs_f64());
        return Ok(result("excite", &report));
    }
    Ok(summary(asked, &own).screen(&[], ""))
}

fn report(asked: &Excite, own: &FrfDesign, seconds: f64) -> Report {
    let said = |is_stated| if is_stated { STATED } else { ASSUMED };
    let joint = |j: usize| {
        let spring = own.expected[j];
        Joint {
            joint: own.names[j].clone(),
            rms: own.rms[j],
            stiffness: spring.stiffness,
            stiffness_std: spring.stiffness_std,
            stiffness_model_std: spring.stiffness_model,
            damping: spring.damping,
            damping_std: spring.damping_std,
            damping_model_std: spring.damping_model,
            spring: said(spring.is_stated),
            friction: said(!own.assumed_friction.contains(&own.names[j])),
        }
    };
    Report {
        motion: asked.output.clone(),
        points: own.points.len(),
        blocks: own.blocks,
        experiments: own.experiments,
        periods: own.periods,
        period: own.period,
        lines: own.lines.len(),
        band: own.band(),
        carrier: own.carrier,
        duration: own.duration(),
        rate: own.rate,
        joints: (0..own.names.len()).map(joint).collect(),
        violations: own.violations.len(),
        seconds,
        seed: asked.seed,
    }
}

fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let digits = (1 - percent.max(1e-9).log10().floor() as i32 - 1).clamp(0, 3) as usize;
    format!("{percent:.digits$} %")
}

fn summary(asked: &Excite, own: &FrfDesign) -> Summary {
    let [low, high] = own.band();
    let headline = format!(
        "Planned {} points × {} blocks × {} experiments, {:.1} minutes: {}",
        own.points.len(),
        own.blocks,
        own.experiments,
        own.duration() / 60.0,
        asked.output.display()
    );
    let mut springs = String::from("Expected standard deviations:");
    for (n, (name, spring)) in own.names.iter().zip(&own.expected).enumerate() {
        let _ = write!(
            springs,
            "{} {name} k {}, d {}",
            if n == 0 { "" } else { ";" },
            percent(spring.stiffness_std),
            percent(spring.damping_std)
        );
    }
    let most = |of: fn(&crate::spectrum::ExpectedSpring) -> f64| {
        percent(own.expected.iter().map(of).fold(0.0, f64::max))
    };
    let model = format!(
        ". Errors of the model come on top: about {} of k, {} of d.",
        most(|s| s.stiffness_model),
        most(|s| s.damping_model)
    );
    let of = |names: Vec<&str>| match names.len() == own.names.len() {
        true => "all joints".to_owned(),
        false => names.join(", "),
    };
    let unknown = own.names.iter().zip(&own.expected);
    let unknown: Vec<&str> = unknown
        .filter(|(_, spring)| !spring.is_stated)
        .map(|(name, _)| name.as_str())
        .collect();
    let dry: Vec<&str> = own.assumed_friction.iter().map(String::as_str).collect();
    let mut assumed = Vec::new();
    if !unknown.is_empty() {
        assumed.push(format!("springs of {}", of(unknown)));
    }
    if !dry.is_empty() {
        assumed.push(format!("Coulomb friction of {}", of(dry)));
    }
    let mut lines = format!(
        "{} odd lines, {low:.1}–{high:.1} Hz, on a carrier of {:.2} Hz. Limits hold at every instant, for parameters off by --uncertainty.",
        own.lines.len(),
        own.carrier
    );
    if !assumed.is_empty() {
        let _ = write!(lines, " Assumed: {}.", assumed.join("; "));
    }
    let few = match own.experiments < own.names.len() {
        true => format!(" --experiments {}", own.experiments),
        false => String::new(),
    };
    let model_file = asked.model.as_ref();
    let next = match model_file {
        Some(model) => format!(
            "proprio simulate --frf --follow {} -m {} -o frf.csv",
            asked.output.display(),
            model.display()
        ),
        None => "proprio frf --help".to_owned(),
    };
    Summary {
        headline,
        points: vec![
            springs + &model,
            lines,
            format!(
                "Play it, record q/, dq/, tau/, ref/ of each joint, then: proprio frf {}{few}",
                typed(&["LOG".into()], model_file.map(PathBuf::as_path))
            ),
        ],
        next: vec![next],
        ..Summary::default()
    }
}
