//! `coaxdesign schema`.

use clap::Args;

use super::args::OutputArgs;
use super::{CliError, Outcome};
use crate::problem;

/// Write the JSON Schema of problem files, for editors
#[derive(Debug, Args)]
pub struct Schema {
    #[command(flatten)]
    output: OutputArgs,
}

impl Schema {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        let text = serde_json::to_string_pretty(&problem::schema::json_schema())
            .map_err(|error| CliError::Internal(error.to_string()))?;
        self.output.write(&(text + "\n"))
    }
}
