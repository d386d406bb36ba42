//! The answers on an engine that spreads the work: the Python module's functions, which run the same code.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::ValueEnum;

/// Reads paths, prints the answers: Python writes numbers so that they read back to the bit, and this program passes the text on as it is.
const RAY: &str = "import json, sys
from proprio import fleet
print(json.dumps(fleet.on_ray(json.load(sys.stdin)), indent=2, ensure_ascii=False))";

/// An engine.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Engine {
    /// Ray, one that runs (RAY_ADDRESS) or one of its own
    Ray,
}

/// Why an engine gives no answers.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EngineError {
    /// The interpreter does not start, or does not take the paths.
    #[error("{python}: {source}; set PROPRIO_PYTHON to an interpreter with the wheel and Ray")]
    Interpreter {
        /// Which.
        python: String,
        /// Why.
        source: io::Error,
    },
    /// It fails; standard error says why.
    #[error("{0} fails on the engine; PROPRIO_PYTHON names an interpreter with the wheel and Ray")]
    Failed(String),
}

impl Engine {
    /// The answers of files as JSON.
    ///
    /// # Errors
    /// [`EngineError`].
    pub(crate) fn report(self, files: &[PathBuf]) -> Result<String, EngineError> {
        let Self::Ray = self;
        let python = std::env::var("PROPRIO_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let run = || -> io::Result<_> {
            let mut child = Command::new(&python)
                .args(["-c", RAY])
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                .spawn()?;
            if let Some(mut input) = child.stdin.take() {
                input.write_all(&serde_json::to_vec(files)?)?;
            }
            child.wait_with_output()
        };
        let output = run().map_err(|source| EngineError::Interpreter {
            python: python.clone(),
            source,
        })?;
        match String::from_utf8(output.stdout) {
            Ok(text) if output.status.success() => Ok(text),
            _ => Err(EngineError::Failed(python)),
        }
    }
}
