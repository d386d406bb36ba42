//! `proprio factors`: from logs to blocks of a fleet's table.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::error::ErrorKind;
use serde::Serialize;

use super::result::result;
use super::{Error, model_or_default, usage_error};
use crate::clock::unix_time;
use crate::fleet::make::BLOCK;
use crate::fleet::{Block, Gate, Origin, blocks_of_log, table};
use crate::progress::Progress;

/// The greatest `--begin`, s since 1970: the year 2286. The same time in ms or ns lies far beyond.
const MOST_UNIX_TIME: f64 = 1e10;

/// Reduce logs to factors: a table of one robot's blocks of time
///
/// A block is a few kilobytes and says of every model of plain effects what its part of the log says, without the data. Questions of many logs and
/// robots are answered from such tables: `identify --blocks`. The base is fixed; the robot is that of -m, else a Go2.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio factors chirp.csv --robot go2-07 -o chirp.parquet
  proprio factors monday.mcap tuesday.mcap --robot go2-07 --site hall --block 300 -o week.parquet
  proprio factors arm.csv --robot arm-2 -m arm.toml --begin 1790000000 -o arm.parquet")]
pub(crate) struct MakeBlocks {
    /// Logs of the robot, of any length
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The robot's name: what its blocks are known by
    #[arg(long, value_name = "ID")]
    robot: String,
    /// Where it stands
    #[arg(long, value_name = "SITE")]
    site: Option<String>,
    /// Its firmware
    #[arg(long, value_name = "VERSION")]
    firmware: Option<String>,
    /// Unix time of the log's first row, s, if the log's own clock does not have it
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = super::simulate::within(0.0, MOST_UNIX_TIME))]
    begin: Option<f64>,
    /// Length of a block, s
    #[arg(long, value_name = "SECONDS", default_value_t = BLOCK, value_parser = super::simulate::within(10.0, 86_400.0))]
    block: f64,
    /// The robot, if it is no Go2: frames, bodies and priors of this model file
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// The table to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    output: PathBuf,
    robot: String,
    /// Blocks of time.
    blocks: usize,
    /// Rows of the table: blocks × joints.
    rows: usize,
    /// Size of the table.
    bytes: u64,
    /// Windows of data.
    windows: f64,
    logs: Vec<OfLog>,
}

#[derive(Serialize)]
struct OfLog {
    log: PathBuf,
    sha256: String,
    blocks: usize,
    t0: f64,
    t1: f64,
}

impl MakeBlocks {
    pub(crate) fn run(self) -> Result<String, Error> {
        if self.begin.is_some() && self.logs.len() > 1 {
            let message = "--begin is of one log; give the others in commands of their own";
            usage_error("factors", ErrorKind::ArgumentConflict, message.to_owned());
        }
        if self.robot.trim().is_empty() {
            let message = "--robot needs a name";
            usage_error("factors", ErrorKind::ValueValidation, message.to_owned());
        }
        let model = model_or_default(self.model.as_deref(), false)?;
        let origin = Origin {
            robot: self.robot.clone(),
            site: self.site.clone(),
            firmware: self.firmware.clone(),
            begin: self.begin,
            received: unix_time().as_secs_f64().floor(),
        };
        let (mut gate, mut all, mut logs) = (Gate::default(), Vec::new(), Vec::new());
        for log in &self.logs {
            let mut progress = Progress::new("Reducing");
            let made = blocks_of_log(log, &model, (&origin, self.block), |done, total| {
                progress.set(done, total);
            })?;
            drop(progress);
            for warning in &made.warnings {
                eprintln!("warning: {warning}");
            }
            logs.push(of_log(log, &made.blocks));
            for block in made.blocks {
                all.push(gate.admit(block).map_err(|fault| Error::Blocks {
                    file: log.clone(),
                    fault: Box::new(fault),
                })?);
            }
        }
        table::write(&self.output, &all)?;
        let bytes = std::fs::metadata(&self.output).map_or(0, |file| file.len());
        let report = Report {
            output: self.output,
            robot: self.robot,
            blocks: logs.iter().map(|log| log.blocks).sum(),
            rows: all.len(),
            bytes,
            windows: all.iter().map(|block| block.windows).sum(),
            logs,
        };
        Ok(match self.json {
            true => result("factors", &report),
            false => report.to_string(),
        })
    }
}

fn of_log(log: &Path, blocks: &[Block]) -> OfLog {
    let mut starts: Vec<u64> = blocks.iter().map(|block| block.t0.to_bits()).collect();
    starts.sort_unstable();
    starts.dedup();
    let first = blocks.iter().map(|block| block.t0);
    let last = blocks.iter().map(|block| block.t1);
    OfLog {
        log: log.to_owned(),
        sha256: blocks
            .first()
            .map_or_else(String::new, |block| block.log.clone()),
        blocks: starts.len(),
        t0: first.fold(f64::INFINITY, f64::min),
        t1: last.fold(f64::NEG_INFINITY, f64::max),
    }
}

/// The blocks of a table, each let in by the gate.
///
/// # Errors
/// The first fault: who asks for one robot wants all of it or nothing.
pub(super) fn admitted(file: &Path, gate: &mut Gate) -> Result<Vec<Block>, Error> {
    let table = table::read(file);
    if let Some(fault) = table.faults.into_iter().next() {
        return Err(Error::BlockTable(Box::new(fault)));
    }
    let admitted = table.blocks.into_iter().map(|block| gate.admit(block));
    let admitted: Result<Vec<Block>, _> = admitted.collect();
    admitted.map_err(|fault| Error::Blocks {
        file: file.to_owned(),
        fault: Box::new(fault),
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            output,
            robot,
            blocks,
            rows,
            bytes,
            ..
        } = self;
        writeln!(
            f,
            "{}: {blocks} blocks of {robot}, {rows} factors, {:.1} kB",
            output.display(),
            1e-3 * *bytes as f64
        )
    }
}
