//! The `proprio` command.

mod command;
mod hint;
mod progress;

use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    if let Err(error) = proprio::output::remove_on_interrupt() {
        eprintln!("warning: Ctrl-C may leave unfinished files behind: {error}");
    }
    match command::run() {
        Ok(text) => match std::io::stdout().write_all(text.as_bytes()) {
            // A reader that has seen enough (`| head`) is no failure.
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
                eprintln!("error: cannot write the result: {error}");
                ExitCode::FAILURE
            }
            _ => ExitCode::SUCCESS,
        },
        Err(error) => {
            eprintln!("error: {error}");
            if let Some(hint) = hint::of(&error) {
                eprintln!("hint: {hint}");
            }
            ExitCode::FAILURE
        }
    }
}
