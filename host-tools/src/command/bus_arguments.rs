//! What a user says of motor buses that is not on them: where the joints are as listening begins.

use clap::Args;
use clap::error::ErrorKind;
use proprio_core::go2::{JointId, Leg};

use super::usage_error;
use super::zero::{parse_at, parse_joint};
use crate::capture::Told;
use crate::device::serial::BUS_BAUD;
use crate::live::BusFacts;

/// Of adapters on motor buses.
#[derive(Debug, Args)]
pub(super) struct BusArguments {
    /// Bits per second on a motor bus
    #[arg(long, default_value_t = BUS_BAUD, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) baud: u32,
    /// A joint rests at this angle, rad, or at its `lower` or `upper` stop, as listening to its motor bus begins; of a leg all three
    #[arg(long, value_name = "JOINT=ANGLE", value_parser = parse_at)]
    pub(super) at: Vec<(JointId, f64)>,
    /// These joints' motors turn against them, separated by commas
    #[arg(long, value_name = "JOINT", value_delimiter = ',', value_parser = parse_joint)]
    reversed: Vec<JointId>,
}

impl BusArguments {
    /// What is said of a leg's joints; `command` is refused where only some of them are.
    pub(super) fn told(&self, command: &str, leg: Leg) -> Told {
        let angles = JointId::of(leg).map(|joint| {
            let at = self.at.iter().find(|(told, _)| *told == joint)?;
            Some((at.1, self.reversed.contains(&joint)))
        });
        match angles {
            [Some(hip), Some(thigh), Some(calf)] => Told::At([hip, thigh, calf]),
            [None, None, None] => Told::Nothing,
            _ => {
                let message = "--at states the angles of all three joints of one leg".to_owned();
                usage_error(command, ErrorKind::MissingRequiredArgument, message)
            }
        }
    }

    /// What is said of all legs.
    pub(super) fn facts(&self, command: &str) -> BusFacts {
        BusFacts {
            baud: self.baud,
            told: Leg::ALL.map(|leg| self.told(command, leg)),
        }
    }
}
