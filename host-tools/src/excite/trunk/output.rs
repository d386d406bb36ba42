//! A motion of the trunk as files: samples to play, coefficients to compute with.

use std::io::{self, Write};

use proprio_core::go2::JOINT_NAMES;
use serde::Serialize;

use super::super::output::{CHANNELS, Gains, RATE};
use super::super::{Motion, Series};
use super::{TRUNK_COORDINATES, TrunkCommand};

/// Writes a motion of all twelve joints of a Go2, in SDK order, as [`write_csv`](super::super::output::write_csv) does: `command` at each sample from 0 to `duration`, s.
///
/// # Errors
/// Those of `out`, and of a sample without a command.
pub fn write_trunk_csv(
    out: &mut impl Write,
    duration: f64,
    command: impl Fn(f64) -> Option<TrunkCommand>,
    gains: Gains,
) -> io::Result<()> {
    write!(out, "t")?;
    for channel in CHANNELS {
        for joint in JOINT_NAMES {
            write!(out, ",{channel}/{joint}")?;
        }
    }
    writeln!(out)?;
    for k in 0..=(duration * RATE).round() as u64 {
        let t = k as f64 / RATE;
        let at = command(t).ok_or_else(|| io::Error::other("a leg does not reach"))?;
        write!(out, "{t:.3}")?;
        for value in [at.q, at.dq, at.ddq, at.tau].as_flattened() {
            write!(out, ",{value:.7}")?;
        }
        for gain in [gains.p, gains.d] {
            for _ in JOINT_NAMES {
                write!(out, ",{gain}")?;
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A motion of the trunk as coefficients.
#[derive(Debug, Clone, Serialize)]
pub struct TrunkCoefficients {
    /// What the numbers mean.
    pub formula: &'static str,
    /// Period, s: the motion is repeated.
    pub period: f64,
    /// How often.
    pub repeats: u32,
    /// Height of the base's origin above the floor where the series are zero, m.
    pub height: f64,
    /// Seed of the search.
    pub seed: u64,
    /// Coordinate by coordinate.
    pub coordinates: Vec<CoordinateSeries>,
}

/// A coordinate's series.
#[derive(Debug, Clone, Serialize)]
pub struct CoordinateSeries {
    /// `x`, `y`, `z`, `roll`, `pitch` or `yaw`.
    pub coordinate: &'static str,
    /// `m` or `rad`.
    pub unit: &'static str,
    /// The series.
    #[serde(flatten)]
    pub series: Series,
}

impl TrunkCoefficients {
    /// Those of a motion over planted feet.
    pub fn of(motion: &Motion, height: f64, seed: u64) -> Self {
        let coordinates = TRUNK_COORDINATES.iter().zip(&motion.joints);
        let coordinates = coordinates.map(|(&(coordinate, unit), series)| CoordinateSeries {
            coordinate,
            unit,
            series: series.clone(),
        });
        Self {
            formula: "second derivative = sum_j cosines[j] cos(j w t) + sines[j] sin(j w t), j from 1, w = 2 pi / period; at rest at 0; \
                      rotation = Rz(yaw) Ry(pitch) Rx(roll); m, rad, s",
            period: motion.period,
            repeats: motion.repeats,
            height,
            seed,
            coordinates: coordinates.collect(),
        }
    }
}
