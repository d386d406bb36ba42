//! `proprio flash`: the firmware onto a board.

use std::path::PathBuf;

use crate::device::programmer::{PROGRAMMERS, Programmer, check};
use crate::device::{DeviceError, image};
use clap::Args;
use clap::builder::PossibleValuesParser;
use serde::Serialize;

use super::Error;
use super::result::result;

/// Flash the firmware onto a NUCLEO-H743ZI2
///
/// Builds the firmware of this version and has probe-rs, STM32CubeProgrammer or openocd put it onto the board, whichever is
/// installed. The board is connected by the USB socket of its ST-LINK.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio flash && proprio monitor /dev/ttyACM0
  proprio flash --walking && proprio monitor /dev/ttyACM0 --imu-at 0,0,0.07
  proprio flash --with openocd --dry-run")]
pub(crate) struct Flash {
    /// Flash this ELF file instead of building
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// The firmware of a robot that walks, with an IMU at the board, in place of that of one that hangs
    #[arg(long, conflicts_with = "image")]
    walking: bool,
    /// Which program does it [default: the first that is installed]
    #[arg(long, value_name = "PROGRAM", value_parser = PossibleValuesParser::new(PROGRAMMERS.map(|p| p.name)))]
    with: Option<String>,
    /// Say what would be done, and do nothing: not even build
    #[arg(long)]
    dry_run: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    image: PathBuf,
    commands: Vec<String>,
    flashed: bool,
}

impl Flash {
    pub(crate) fn run(self) -> Result<String, Error> {
        // Before minutes of building.
        let programmer = self.programmer()?;
        let image = match &self.image {
            Some(image) => image.clone(),
            None if self.dry_run => image::nucleo(self.walking)?,
            None => image::build_nucleo(self.walking)?,
        };
        // What is not built yet cannot be looked at.
        if self.image.is_some() || !self.dry_run {
            check(&image)?;
        }
        if !self.dry_run {
            programmer.flash(&image)?;
        }
        let report = Report {
            commands: programmer.words(&image),
            flashed: !self.dry_run,
            image,
        };
        Ok(match self.json {
            true => result("flash", &report),
            false if self.dry_run => report.commands.join("\n") + "\n",
            false => {
                "Flashed. `proprio ports` shows the board's port; then: proprio monitor PORT\n"
                    .to_owned()
            }
        })
    }

    fn programmer(&self) -> Result<Programmer, Error> {
        let path = std::env::var_os("PATH");
        let mut known = PROGRAMMERS.into_iter();
        let found = match &self.with {
            Some(name) => known.find(|programmer| programmer.name == name),
            None => known.find(|programmer| programmer.is_in(path.as_ref())),
        };
        match found {
            Some(programmer) if self.dry_run || programmer.is_in(path.as_ref()) => Ok(programmer),
            None if self.dry_run => Ok(PROGRAMMERS[0]),
            _ => Err(DeviceError::NoProgrammer.into()),
        }
    }
}
