//! A design as files: samples to play, coefficients to compute with.

use std::io::{self, Write};

use serde::Serialize;

use super::{LimbDesign, Measures, Progress, Series, Settings};
use crate::model::Model;

/// Samples per second of a motion file: the Go2's low-level interface.
pub const RATE: f64 = 500.0;

/// Feedback gains that go into the file with the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// N m/rad.
    pub p: f64,
    /// N m s/rad.
    pub d: f64,
}

/// Columns of a motion file, each per joint: position (rad), velocity (rad/s), acceleration (rad/s²), feed-forward torque
/// (N m), gains (N m/rad, N m s/rad).
pub const CHANNELS: [&str; 6] = ["q", "dq", "ddq", "tau", "kp", "kd"];

/// The samples of a motion file: time, s, and each limb's command.
pub fn samples(designs: &[LimbDesign]) -> impl Iterator<Item = (f64, Vec<super::Command>)> + '_ {
    let durations = designs.iter().map(|d| d.motion.duration());
    let last = (durations.fold(0.0, f64::max) * RATE).round() as u64;
    (0..=last).map(|k| {
        let t = k as f64 / RATE;
        let command = |design: &LimbDesign| design.command(t);
        (t, designs.iter().map(command).collect())
    })
}

/// Writes `t` and, joint by joint, [`CHANNELS`] as CSV.
///
/// # Errors
/// Those of `out`.
pub fn write_csv(
    out: &mut impl Write,
    model: &Model,
    designs: &[LimbDesign],
    gains: Gains,
) -> io::Result<()> {
    let joints: Vec<usize> = designs
        .iter()
        .flat_map(|d| d.joints.iter().copied())
        .collect();
    write!(out, "t")?;
    for channel in CHANNELS {
        for &joint in &joints {
            write!(out, ",{channel}/{}", model.joint_name(joint))?;
        }
    }
    writeln!(out)?;
    for (t, commands) in samples(designs) {
        write!(out, "{t:.3}")?;
        for values in [
            |c: &super::Command| c.q.clone(),
            |c: &super::Command| c.dq.clone(),
            |c: &super::Command| c.ddq.clone(),
            |c: &super::Command| c.tau.clone(),
        ] {
            for value in commands.iter().flat_map(values) {
                write!(out, ",{value:.7}")?;
            }
        }
        for gain in [gains.p, gains.d] {
            for _ in &joints {
                write!(out, ",{gain}")?;
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A design as coefficients.
#[derive(Debug, Clone, Serialize)]
pub struct Coefficients {
    /// What the numbers mean.
    pub formula: &'static str,
    /// Length, s.
    pub duration: f64,
    /// Period, s: the motion is repeated.
    pub period: f64,
    /// Seed of the search.
    pub seed: u64,
    /// Joint by joint.
    pub joints: Vec<JointSeries>,
    /// Limb by limb, what the motion tells.
    pub limbs: Vec<LimbMeasures>,
}

/// A joint's series.
#[derive(Debug, Clone, Serialize)]
pub struct JointSeries {
    /// Its name.
    pub joint: String,
    /// The series.
    #[serde(flatten)]
    pub series: Series,
}

/// What a limb's motion tells and how the search went.
#[derive(Debug, Clone, Serialize)]
pub struct LimbMeasures {
    /// The limb.
    pub limb: String,
    /// The measures.
    #[serde(flatten)]
    pub measures: Measures,
    /// The best cost over the time of the search.
    pub history: Vec<Progress>,
}

impl Coefficients {
    /// Those of designs made with `settings`.
    pub fn of(model: &Model, designs: &[LimbDesign], settings: &Settings) -> Self {
        let joints = designs.iter().flat_map(|design| {
            design
                .joints
                .iter()
                .zip(&design.motion.joints)
                .map(|(&joint, series)| JointSeries {
                    joint: model.joint_name(joint).to_owned(),
                    series: series.clone(),
                })
        });
        let limbs = designs.iter().map(|design| LimbMeasures {
            limb: design.limb.clone(),
            measures: design.measures,
            history: design.history.clone(),
        });
        Self {
            formula: "ddq(t) = constant + sum_j cosines[j] cos(j w t) + sines[j] sin(j w t), j from 1, w = 2 pi / period; \
                      q(0) = start, dq(0) = drift; rad, s",
            duration: settings.duration,
            period: designs.first().map_or(0.0, |design| design.motion.period),
            seed: settings.seed,
            joints: joints.collect(),
            limbs: limbs.collect(),
        }
    }
}
