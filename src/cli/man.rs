//! `coaxdesign man`.

use clap::{Args, CommandFactory};

use super::{Cli, CliError, Outcome, output};
use coaxdesign::problem::nearest_help;

/// Print a manual page
#[derive(Debug, Args)]
pub struct Man {
    /// Subcommand to describe; the program as a whole without one
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

impl Man {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        let mut program = Cli::command();
        program.build();
        let command = match &self.command {
            None => program,
            Some(name) => {
                let Some(command) = program.find_subcommand(name) else {
                    let names = program.get_subcommands().map(clap::Command::get_name);
                    return Err(CliError::Usage {
                        message: format!("there is no subcommand `{name}`"),
                        help: nearest_help(name, names, "subcommands"),
                    });
                };
                let title: &'static str = command.get_display_name().map_or("coaxdesign", |name| {
                    // The page keeps its title for the rest of the program.
                    Box::leak(name.to_string().into_boxed_str())
                });
                command.clone().name(title)
            }
        };
        let mut page = Vec::new();
        clap_mangen::Man::new(command)
            .render(&mut page)
            .map_err(|error| CliError::Internal(error.to_string()))?;
        output::print(&String::from_utf8_lossy(&page))?;
        Ok(Outcome::Done)
    }
}
