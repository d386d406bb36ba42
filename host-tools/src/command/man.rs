//! `proprio man`: the manual page.

use clap::{Args, CommandFactory};
use clap_mangen::Man;

use super::{Arguments, Error};

/// Print the manual page, of proprio or of one command
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio man | man -l -
  proprio man identify > proprio-identify.1")]
pub(crate) struct Manual {
    /// The command
    #[arg(value_name = "COMMAND")]
    of: Option<String>,
}

impl Manual {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut command = Arguments::command();
        command.build();
        let command = match &self.of {
            None => command,
            Some(name) => {
                let known = command.get_subcommands().map(clap::Command::get_name);
                let unknown = crate::model::UnknownName::new("command", name, known);
                let found = command.find_subcommand(name).ok_or(unknown)?;
                let title = format!("proprio-{name}");
                found.clone().display_name(title)
            }
        };
        let mut text = Vec::new();
        let page = Man::new(command).render(&mut text);
        page.map_err(|error| Error::Unreadable("the manual page".to_owned(), error))?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }
}
