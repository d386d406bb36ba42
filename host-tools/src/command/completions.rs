//! `proprio completions`: what a shell needs to complete commands.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Arguments, Error};

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio completions bash > ~/.local/share/bash-completion/completions/proprio
  proprio completions zsh > ~/.zfunc/_proprio
  proprio completions fish > ~/.config/fish/completions/proprio.fish")]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut Arguments::command(), "proprio", &mut text);
        Ok(String::from_utf8_lossy(&text).into_owned())
    }
}
