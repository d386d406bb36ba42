//! The tables of the labelled battery, whose cases and judgement the tests share ([`proprio_tests::battery`]).
//!
//! 1. [`table`]: the figures of all cases, `battery/table.md`.
//! 2. [`mujoco`]: the same judgement on logs that MuJoCo made.
//! 3. [`logged_table`]: counts of judgements of logs in files by effect, by size and by noise, with their targets: `battery/mujoco_table.md`.

pub mod logged_table;
pub mod mujoco;
pub mod table;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Where the tables are.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("battery")
}

/// The `proprio` of the profile of this program, built by cargo.
///
/// # Errors
/// What cargo says.
pub fn built() -> Result<PathBuf, String> {
    let status = Command::new(env!("CARGO"))
        .args([
            "build",
            "--quiet",
            "--release",
            "--package",
            "proprio",
            "--bin",
            "proprio",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()
        .map_err(|e| format!("cargo: {e}"))?;
    if !status.success() {
        return Err("the command does not build".to_owned());
    }
    Ok(Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/release/proprio"))
}

/// The command to be judged, the repository's own unless it is `named`, and the folder that its logs are made in.
///
/// # Errors
/// What cargo says, or why there can be no such folder.
pub fn ready(named: Option<&Path>, folder: &Path) -> Result<PathBuf, String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    named.map_or_else(built, |program| Ok(program.to_owned()))
}

/// How a study ends.
pub fn ended(name: &str, result: Result<(), String>) -> ExitCode {
    result.map_or_else(
        |error| {
            eprintln!("{name}: {error}");
            ExitCode::FAILURE
        },
        |()| ExitCode::SUCCESS,
    )
}

/// What a command prints on standard output.
///
/// # Errors
/// What it prints on standard error where it fails.
pub fn run(program: &Path, arguments: &[&str]) -> Result<String, String> {
    let done = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|e| format!("{}: {e}", program.display()))?;
    if !done.status.success() {
        return Err(String::from_utf8_lossy(&done.stderr).into_owned());
    }
    String::from_utf8(done.stdout).map_err(|e| e.to_string())
}
