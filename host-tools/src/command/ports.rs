//! `proprio ports`: serial ports, and what is likely behind them.

use crate::device::DeviceError;
use crate::device::ports::{Port, Use, available};
use crate::table::Table;
use clap::Args;
use serde::Serialize;

use super::Error;
use super::result::result;

/// List serial ports, and what is likely behind them
///
/// By the chip on the cable: an ST-LINK is a board's host link, for `monitor` and `flash`; an adapter that is fast enough for the
/// motor bus is for `capture` and `replay --leg`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio ports
  proprio ports --json")]
pub(crate) struct Ports {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    ports: Vec<Port>,
}

impl Ports {
    pub(crate) fn run(self) -> Result<String, Error> {
        let ports = available().map_err(|source| DeviceError::Port {
            port: "the list of ports".to_owned(),
            source,
        })?;
        Ok(match (self.json, ports.is_empty()) {
            (true, _) => result("ports", &Report { ports }),
            (false, true) => "There is no serial port. Plug in the board or the adapter; \
                              without either: proprio monitor sim\n"
                .to_owned(),
            (false, false) => words(&ports),
        })
    }
}

fn words(ports: &[Port]) -> String {
    let mut table = Table::default();
    for port in ports {
        let command = match port.likely {
            Use::Board => format!("proprio monitor {}", port.port),
            Use::Bus => format!("proprio capture {} -o FR.cap", port.port),
            Use::TooSlow | Use::Unknown => "-".to_owned(),
        };
        table.row([port.port.clone(), command, port.why.clone()]);
    }
    table.to_string()
}
