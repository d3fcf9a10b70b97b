//! `coaxdesign new`.

use std::path::PathBuf;

use clap::Args;

use super::{CliError, Outcome, output};

/// The file to start from; a test holds it to the checks.
const STARTER: &str = include_str!("starter.toml");

/// Write a commented problem file to start from
#[derive(Debug, Args)]
pub struct New {
    /// File to write
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Replace the file if it is already there
    #[arg(long)]
    force: bool,
}

impl New {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        output::write_whole(&self.file, STARTER.as_bytes(), self.force)?;
        Ok(Outcome::Done)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    #[test]
    fn starter_file_is_sound() {
        let loaded = coaxdesign::problem::parse_str("starter.toml", super::STARTER, Path::new(""));
        let loaded = loaded.unwrap_or_else(|report| panic!("{report}"));
        assert!(loaded.warnings.is_empty());
    }
}
