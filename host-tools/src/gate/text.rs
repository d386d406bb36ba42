//! What is wrong, and what to do about it, in words.

use std::fmt;

use serde::Serialize;

use super::velocity::{TOLERATED_GAIN, VelocityGain};
use super::{GateReport, JointReport, SamplingReport};
use crate::robust;
use crate::table::Table;

/// What a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// Time between samples.
    Jitter,
    /// Samples that repeat the one before.
    Repeats,
    /// Samples that are not after the one before.
    Late,
    /// Silences.
    Gaps,
    /// Torque at its limit.
    Saturation,
    /// Torque reported too coarsely.
    Quantum,
    /// Reported velocity against reported position: gain.
    VelocityGain,
    /// Reported velocity against reported position: lag.
    VelocityLag,
    /// Reported velocity against reported position: offset.
    VelocityOffset,
    /// The clock: all velocities are off alike.
    Clock,
    /// Joints that do not move.
    Motion,
}

/// Something wrong with the data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What it is about.
    pub gate: Gate,
    /// Which joints; empty for the log as a whole.
    pub joints: Vec<String>,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub remedy: &'static str,
}

/// From here on, in per cent of a log, repeats and gaps are worth a word; below, windows lose next to nothing by them.
const NOTABLE_PERCENT: f64 = 1.0;

/// Jitter beyond this share of the period is worth a word: trapezia between uneven samples lose accuracy.
const NOTABLE_JITTER: f64 = 0.25;

/// A joint that moves less than this, %, says little of its friction and inertia.
const LEAST_MOTION: f64 = 10.0;

/// A lag beyond this, s, is worth a word: one sample of a Go2.
const TOLERATED_LAG: f64 = 2e-3;

/// A velocity at rest beyond this, rad/s, is worth a word. Every motor of the Go2s whose logs we have reports 0.02 (calf
/// 0.01), which no model notices: friction needs the displacement, not the integral of the velocity.
const TOLERATED_OFFSET: f64 = 0.05;

/// A clock that is off by more than this share is none that drifts or jitters.
const OTHER_UNIT: f64 = 0.5;

/// Saturation beyond this share of samples, %, is worth a word.
const NOTABLE_SATURATION: f64 = 0.1;

/// Steps of torque beyond this share of its range are worth a word.
const COARSE: f64 = 0.05;

pub(super) fn findings(sampling: &SamplingReport, joints: &[JointReport]) -> Vec<Finding> {
    let mut findings = of_sampling(sampling);
    let clock = clock(joints);
    findings.extend(clock.as_ref().map(|(_, finding)| finding.clone()));
    let reference = clock.map_or(1.0, |(gain, _)| gain);
    for joint in joints {
        findings.extend(of_velocity(joint, reference, joints.len()));
        findings.extend(of_saturation(joint));
    }
    findings.extend(
        [1.0, -1.0]
            .into_iter()
            .filter_map(|sign| of_lag(joints, sign)),
    );
    findings.extend(of_motion(joints));
    findings
}

fn finding(gate: Gate, joint: Option<&JointReport>, what: String, remedy: &'static str) -> Finding {
    Finding {
        gate,
        joints: joint.map(|joint| joint.joint.clone()).into_iter().collect(),
        what,
        remedy,
    }
}

fn of_sampling(s: &SamplingReport) -> Vec<Finding> {
    let mut found = Vec::new();
    if s.jitter > NOTABLE_JITTER * s.period {
        let (jitter, period) = (s.jitter * 1e3, s.period * 1e3);
        found.push(finding(
            Gate::Jitter,
            None,
            format!("the time between samples, {period:.2} ms, varies by ±{jitter:.2} ms"),
            "stamp samples where they are measured, not where they are received",
        ));
    }
    if s.repeated_percent >= NOTABLE_PERCENT {
        found.push(finding(
            Gate::Repeats,
            None,
            format!("{:.1} % of the samples repeat the one before", s.repeated_percent),
            "they are skipped; record each message once instead of reading the latest at a fixed rate",
        ));
    }
    if s.late > 0 {
        found.push(finding(
            Gate::Late,
            None,
            format!(
                "{} of {} samples are not later than the one before",
                s.late, s.samples
            ),
            "they are skipped; sort the log by time, or find out which clock went back",
        ));
    }
    if s.gaps > 0 && (s.gap_percent >= NOTABLE_PERCENT || s.longest_gap > 0.1) {
        let plural = if s.gaps == 1 { "" } else { "s" };
        found.push(finding(
            Gate::Gaps,
            None,
            format!(
                "{} gap{plural}, {:.1} % of the time, the longest {:.0} ms",
                s.gaps,
                s.gap_percent,
                1e3 * s.longest_gap
            ),
            "no window bridges them; record on the robot or by cable",
        ));
    }
    found
}

/// The gain that all velocities share, if it is not 1: then time is wrong, not every sensor alike.
fn clock(joints: &[JointReport]) -> Option<(f64, Finding)> {
    let checked = || joints.iter().filter_map(|joint| joint.velocity);
    let median = |value: fn(VelocityGain) -> f64| robust::median(checked().map(value));
    let (gain, std) = (median(|v| v.gain)?, median(|v| v.gain_std)?);
    let off = |gain: f64| (gain - 1.0).abs() > TOLERATED_GAIN;
    let alike = |v: &VelocityGain| off(v.gain) && (v.gain > 1.0) == (gain > 1.0);
    let (count, shared) = (checked().count(), checked().filter(alike).count());
    // The joints share the stamps' errors, so that their mean would be no surer than one of them.
    let sure = (gain - 1.0).abs() > TOLERATED_GAIN + 3.0 * std;
    if count < 3 || 4 * shared < 3 * count || !sure {
        return None;
    }
    let what = format!(
        "all joints report their velocity alike too {}, by about {:.1} %: ∫q̇ dt against Δq",
        side(gain),
        100.0 * (gain - 1.0).abs()
    );
    let remedy = match (gain - 1.0).abs() < OTHER_UNIT {
        true => "the time stamps are the likely cause: stamp samples where they are measured",
        false => "the velocities are in another unit, or the stamps are not in s",
    };
    Some((gain, finding(Gate::Clock, None, what, remedy)))
}

fn side(gain: f64) -> &'static str {
    if gain > 1.0 { "high" } else { "low" }
}

fn of_velocity(joint: &JointReport, reference: f64, joints: usize) -> Vec<Finding> {
    let Some(v) = joint.velocity else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut add = |gate, what, remedy| found.push(finding(gate, Some(joint), what, remedy));
    if v.differs_from(reference, joints) {
        let gain = v.gain / reference;
        let what = format!(
            "reports its velocity {:.1} ±{:.1} % too {}: ∫q̇ dt against Δq",
            100.0 * (gain - 1.0).abs(),
            100.0 * v.gain_std,
            side(gain)
        );
        add(
            Gate::VelocityGain,
            what,
            "divide its velocity by the gain or let the model have velocity_gain; its friction and inertia are wrong by as much",
        );
    }
    if v.offset.abs() > TOLERATED_OFFSET + 4.0 * v.offset_std {
        let what = format!(
            "reports a velocity of {:.3} ±{:.3} rad/s at rest",
            v.offset, v.offset_std
        );
        add(Gate::VelocityOffset, what, "take it off before use");
    }
    found
}

/// The joints whose velocity is later than their position (`sign` 1) or earlier (−1), in one word: a driver's filter is all joints'.
fn of_lag(joints: &[JointReport], sign: f64) -> Option<Finding> {
    let off = |joint: &&JointReport| {
        let lag = joint
            .velocity
            .map_or((0.0, 0.0), |v| (sign * v.lag, v.lag_std));
        lag.0 > TOLERATED_LAG + 4.0 * lag.1
    };
    let off: Vec<&JointReport> = joints.iter().filter(off).collect();
    let lags = || off.iter().filter_map(|joint| joint.velocity);
    let range = |of: fn(f64, f64) -> f64| lags().map(|v| 1e3 * v.lag.abs()).reduce(of);
    let (least, most) = (range(f64::min)?, range(f64::max)?);
    let std = 1e3 * lags().map(|v| v.lag_std).fold(0.0, f64::max);
    let side = if sign > 0.0 { "later" } else { "earlier" };
    let [least, most] = [least, most].map(|lag| format!("{lag:.1}"));
    let range = if least == most {
        most
    } else {
        format!("{least} to {most}")
    };
    let what = if off.len() == 1 {
        format!("reports its velocity {range} ±{std:.1} ms {side} than its position")
    } else {
        format!("report their velocities {range} ±{std:.1} ms {side} than their positions")
    };
    Some(Finding {
        joints: off.iter().map(|joint| joint.joint.clone()).collect(),
        ..finding(
            Gate::VelocityLag,
            None,
            what,
            "shift the velocity in time before use; else inertia and friction mix",
        )
    })
}

fn of_saturation(joint: &JointReport) -> Vec<Finding> {
    let mut found = Vec::new();
    let saturation = &joint.saturation;
    let remedy =
        "move less hard, or leave these stretches out: a limit hides the torque that was asked for";
    if saturation.at_limit_percent >= NOTABLE_SATURATION {
        let percent = saturation.at_limit_percent;
        let what = format!("its torque is at the effort limit in {percent:.1} % of the samples");
        found.push(finding(Gate::Saturation, Some(joint), what, remedy));
    } else if let Some(plateau) = saturation.plateau {
        let what = format!(
            "its torque stops at {:.2} N m in {:.1} % of the samples in motion, as if something limited it",
            plateau.torque, plateau.percent
        );
        found.push(finding(Gate::Saturation, Some(joint), what, remedy));
    }
    let largest = joint.largest_torque;
    let coarse = |step: &f64| largest > 0.0 && *step > COARSE * largest;
    if let Some(step) = joint.quantum[2].filter(coarse) {
        let what = format!(
            "its torque is reported in steps of {step:.3} N m and never exceeds {largest:.2} N m"
        );
        let remedy = "move harder, or expect errors of a third of a step per sample";
        found.push(finding(Gate::Quantum, Some(joint), what, remedy));
    }
    found
}

/// One finding for all joints that hardly move.
fn of_motion(joints: &[JointReport]) -> Option<Finding> {
    let still = joints
        .iter()
        .filter(|joint| joint.moving_percent < LEAST_MOTION);
    let names: Vec<String> = still.map(|joint| joint.joint.clone()).collect();
    (!names.is_empty()).then(|| Finding {
        gate: Gate::Motion,
        what: format!("hardly moves: less than {LEAST_MOTION:.0} % of the time"),
        joints: names,
        remedy: "nothing can be said of its friction and inertia; record it moving",
    })
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.joints.is_empty() {
            write!(f, "{}: ", self.joints.join(", "))?;
        }
        write!(f, "{} → {}", self.what, self.remedy)
    }
}

/// The findings, one a line, and a table of the joints.
impl fmt::Display for GateReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.sampling;
        writeln!(
            f,
            "{} samples in {:.1} s, every {:.2} ms ±{:.2}; {:.1} % repeats, {} gaps",
            s.samples,
            s.duration,
            s.period * 1e3,
            s.jitter * 1e3,
            s.repeated_percent,
            s.gaps
        )?;
        let mut table = Table::default();
        table.row(["joint", "moves %", "velocity gain", "lag ms"].map(str::to_owned));
        for joint in &self.joints {
            let (gain, lag) = match joint.velocity {
                Some(v) => (
                    format!("{:.3} ±{:.3}", v.gain, v.gain_std),
                    format!("{:.2} ±{:.2}", 1e3 * v.lag, 1e3 * v.lag_std),
                ),
                None => ("–".to_owned(), "–".to_owned()),
            };
            let moving = format!("{:.0}", joint.moving_percent);
            table.row([joint.joint.clone(), moving, gain, lag]);
        }
        write!(f, "{table}")?;
        self.findings
            .iter()
            .try_for_each(|finding| writeln!(f, "{finding}"))
    }
}
