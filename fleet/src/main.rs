//! `proprio-fleet`: a table of a fleet's blocks in a folder, and the questions that it answers.
//!
//! 1. `folder`: the table: admitted blocks in `blocks/`, what was refused and why in `quarantine/`.
//! 2. `answers`: a robot's files reduced and put together in one order (`fleet::partial`, `fleet::merge`), its limbs solved and their factors forgotten, robots side by side
//!    (`fleet::solved`); answered once (`fleet::answers_of`).
//! 3. `engine`: the same answers by the Python module on an engine that spreads the work.
//! 4. here: the commands.

mod answers;
mod engine;
mod folder;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use proprio_host::fleet::prior_model;
use proprio_host::model::{Model, ModelError};
use proprio_host::output::WriteError;
use proprio_host::report::pages;

use crate::engine::{Engine, EngineError};
use crate::folder::{FolderError, Table};

/// Blocks of many robots' logs in one table, and what they say together.
///
/// `proprio factors` makes blocks of logs; docs/fleet.md says what they are.
#[derive(Debug, Parser)]
#[command(name = "proprio-fleet", version, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Add the tables of blocks in a folder: each block once, what is faulty into quarantine with the reason
    #[command(after_help = "Example:\n  proprio-fleet add uploads --to fleet")]
    Add {
        /// Folder with .parquet files of `proprio factors`, in any depth
        #[arg(value_name = "DIR")]
        from: PathBuf,
        /// The table, a folder; made if it does not exist
        #[arg(long, value_name = "TABLE")]
        to: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// How many robots, blocks and refusals the table has
    #[command(after_help = "Example:\n  proprio-fleet status fleet")]
    Status {
        /// The table
        table: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// All answers: populations, robots that differ, drifts, what the fleet's model lacks
    #[command(after_help = "Example:\n  proprio-fleet report fleet --html fleet.html")]
    Report {
        /// The table
        table: PathBuf,
        /// Also write a page, no network needed
        #[arg(long, value_name = "PAGE")]
        html: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// Compute on an engine, by the Python module of PROPRIO_PYTHON (default python3)
        #[arg(long, requires = "json", conflicts_with = "html")]
        engine: Option<Engine>,
    },
    /// Write a model file of each robot
    #[command(after_help = "Example:\n  proprio-fleet models fleet --to models")]
    Models {
        /// The table
        table: PathBuf,
        /// The folder for them
        #[arg(long, value_name = "DIR")]
        to: PathBuf,
        /// The robots' model file, if they are no Go2s
        #[arg(short, long, value_name = "MODEL")]
        model: Option<PathBuf>,
    },
    /// Write the model file that a new robot begins with: proprio identify LOG -m prior.toml
    #[command(after_help = "Example:\n  proprio-fleet prior fleet -o prior.toml")]
    Prior {
        /// The table
        table: PathBuf,
        /// The file
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
        /// The robots' model file, if they are no Go2s
        #[arg(short, long, value_name = "MODEL")]
        model: Option<PathBuf>,
    },
}

/// Why a command fails.
#[derive(Debug, thiserror::Error)]
enum Error {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error("{path}: {reason}", path = .0.display(), reason = .1)]
    Made(PathBuf, std::io::Error),
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<String, Error> {
    match command {
        Command::Add { from, to, json } => {
            let added = Table::at(&to).add(&from)?;
            Ok(if json {
                as_json("add", &added)
            } else {
                added.to_string()
            })
        }
        Command::Status { table, json } => {
            let status = Table::at(&table).status()?;
            Ok(if json {
                as_json("status", &status)
            } else {
                status.to_string()
            })
        }
        Command::Report {
            table,
            engine: Some(engine),
            ..
        } => Ok(engine.report(&Table::at(&table).files()?)?),
        Command::Report {
            table, html, json, ..
        } => {
            let table = Table::at(&table);
            let answers = answers::of(&table)?;
            if let Some(path) = html {
                pages::fleet(&answers, &table.refused()?).write(&path)?;
            }
            Ok(if json {
                format!("{:#}\n", answers.object())
            } else {
                answers.to_string()
            })
        }
        Command::Models { table, to, model } => {
            let answers = answers::of(&Table::at(&table))?;
            let robot = read_model(model)?;
            std::fs::create_dir_all(&to).map_err(|error| Error::Made(to.clone(), error))?;
            let mut written = String::new();
            for (name, model) in answers::models(&robot, &answers) {
                let path = to.join(format!("{}.toml", folder::file_name(&name)));
                model.save(&path)?;
                written += &format!("{name}: {}\n", path.display());
            }
            Ok(written)
        }
        Command::Prior {
            table,
            output,
            model,
        } => {
            let answers = answers::of(&Table::at(&table))?;
            let prior = prior_model(&read_model(model)?, &answers);
            prior.save(&output)?;
            let effects = prior.effects().len();
            Ok(format!(
                "{}: {effects} effects of {} robots\n",
                output.display(),
                answers.robots
            ))
        }
    }
}

fn read_model(path: Option<PathBuf>) -> Result<Model, ModelError> {
    path.map_or_else(|| Ok(Model::default()), |path| Model::load(&path))
}

/// One JSON object that names its schema.
fn as_json(command: &str, value: &impl serde::Serialize) -> String {
    let mut object = serde_json::to_value(value).unwrap_or_default();
    object["schema"] = format!("proprio-fleet.{command}/1").into();
    format!("{object:#}\n")
}
