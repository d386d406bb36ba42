//! What `excite --frf` and `simulate --frf` are asked for alike.

use clap::Args;

use super::simulate::within;
use crate::excite::Margins;
use crate::excite::frf::FrfSettings;

/// Points, blocks, periods and a period, s, unless others are asked for: 43 lines a hertz apart, and in some minutes as many blocks as show the scatter.
const POINTS: u32 = 6;
const BLOCKS: u32 = 2;
const PERIODS: u32 = 3;
const PERIOD: f64 = 4.0;

/// Periodic experiments.
#[derive(Debug, Args)]
pub(super) struct ExperimentArguments {
    /// Points at which the robot is excited, of --frf [default: 6]
    #[arg(long, value_name = "N", requires = "frf", value_parser = clap::value_parser!(u32).range(1..1000))]
    points: Option<u32>,
    /// Blocks of random phases at each point, of --frf: each has as many experiments as joints [default: 2]
    #[arg(long, value_name = "N", requires = "frf", value_parser = clap::value_parser!(u32).range(1..1000))]
    blocks: Option<u32>,
    /// Experiments of a block, of --frf: fewer than joints leave time for more points [default: as many as joints]
    #[arg(long, value_name = "N", requires = "frf", value_parser = clap::value_parser!(u32).range(1..1000))]
    experiments: Option<u32>,
    /// Periods of each experiment, of --frf; the first is transient [default: 3]
    #[arg(long, value_name = "N", requires = "frf", value_parser = clap::value_parser!(u32).range(3..1000))]
    periods: Option<u32>,
    /// Lowest and highest excited line, of --frf [default: 1,55]
    #[arg(long, value_name = "HZ,HZ", requires = "frf", value_parser = parse_band)]
    band: Option<Band>,
    /// Excitation as a multiple of what friction and effort suggest, of --frf [default: 1]
    #[arg(long, value_name = "FACTOR", requires = "frf", value_parser = within(0.0, 100.0))]
    excitation: Option<f64>,
}

/// Hz.
type Band = [f64; 2];

impl ExperimentArguments {
    /// Whether one of them was given.
    pub(super) fn any(&self) -> bool {
        let counts = [self.points, self.blocks, self.experiments, self.periods];
        counts.iter().any(Option::is_some) || self.band.is_some() || self.excitation.is_some()
    }

    /// With the rest of what is asked.
    pub(super) fn settings(&self, period: Option<f64>, rate: f64, seed: u64) -> FrfSettings {
        let count = |asked: Option<u32>, usual| asked.unwrap_or(usual) as usize;
        FrfSettings {
            points: count(self.points, POINTS),
            blocks: count(self.blocks, BLOCKS),
            experiments: self.experiments.map(|count| count as usize),
            periods: count(self.periods, PERIODS),
            period: period.unwrap_or(PERIOD),
            band: self.band,
            excitation: self.excitation.unwrap_or(1.0),
            rate,
            seed,
            margins: Margins::default(),
            shapes: None,
        }
    }
}

/// `LOW,HIGH`.
fn parse_band(text: &str) -> Result<Band, String> {
    let parse = |text: &str| within(0.001, 1e5)(text.trim());
    let (low, high) = text.split_once(',').ok_or("expected LOW,HIGH in Hz")?;
    let band = [parse(low)?, parse(high)?];
    if band[0] < band[1] {
        Ok(band)
    } else {
        Err("the first must be the lower one".to_owned())
    }
}
