//! `coaxdesign import`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::export::load;
use super::tune::usage;
use super::{CliError, Outcome, output};
use coaxdesign::export::import::{Breakpoints, ImportError, Source, import};
use coaxdesign::units::KNOT;

/// Read a gain schedule of another program, or written by hand
///
/// Reads JSON, TOML, CSV and MAT files (MATLAB's -v6 and -v7) that hold a whole schedule or a
/// part of one, such as gains over speed. What is imported counts as not verified: `coaxdesign
/// verify` checks it like any other.
#[derive(Debug, Args)]
pub struct Import {
    /// File to read; its ending says the form: .json, .toml, .csv, .mat
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Schedule, or directory of one, that gives what the file leaves out; its breakpoints stay
    #[arg(long, value_name = "SCHEDULE")]
    base: Option<PathBuf>,
    /// Breakpoints of the schedule: the base's and the file's, or the file's only
    #[arg(long, value_enum, value_name = "WHOSE", requires = "base")]
    breakpoints: Option<Whose>,
    /// Directory for schedule.json; without it, the schedule goes to standard output
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace a schedule that is already there
    #[arg(long)]
    force: bool,
}

/// Whose breakpoints a schedule gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Whose {
    /// The base's, with the file's values put in, and the file's
    Base,
    /// The file's only; the base's others are left out
    File,
}

/// Speeds for people.
fn knots(speeds: &[f64]) -> String {
    let texts: Vec<String> = speeds.iter().map(|v| format!("{:.1}", v / KNOT)).collect();
    format!("{} kt", texts.join(", "))
}

impl Import {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        if let Some(directory) = &self.output
            && directory.extension().is_some_and(|ending| ending == "json")
        {
            return Err(CliError::Usage {
                message: format!("-o {}: it names a file", directory.display()),
                help: "give the directory into which schedule.json is to go".into(),
            });
        }
        let ending = self.file.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let source = match ending.to_ascii_lowercase().as_str() {
            "json" => Source::Json,
            "toml" => Source::Toml,
            "csv" => Source::Csv,
            "mat" => Source::Mat,
            _ => {
                return Err(usage(
                    format!("{}: the ending says no form that can be read", self.file.display()),
                    ".json, .toml, .csv and .mat are read",
                ));
            }
        };
        let bytes = std::fs::read(&self.file)
            .map_err(|source| CliError::Io { path: self.file.clone(), source })?;
        let base = match &self.base {
            Some(path) => Some(load(path, false)?.0),
            None => None,
        };
        let origin = self.file.file_name().map_or_else(String::new, |n| n.display().to_string());
        let breakpoints = match self.breakpoints {
            None => Breakpoints::Unsaid,
            Some(Whose::Base) => Breakpoints::Base,
            Some(Whose::File) => Breakpoints::File,
        };
        let imported =
            import(&bytes, source, &origin, base.as_ref(), breakpoints).map_err(|error| {
                let help = match error {
                    ImportError::Breakpoints { .. } => {
                        "--breakpoints file takes the file's speeds only, --breakpoints base keeps \
                         the base's and puts the file's values in"
                    }
                    _ => {
                        "docs/exports.md shows the forms; --base SCHEDULE fills what a file leaves \
                         out"
                    }
                };
                usage(format!("{}: {error}", self.file.display()), help)
            })?;
        let text =
            imported.schedule.to_json().map_err(|error| CliError::Internal(error.to_string()))?;
        match &self.output {
            Some(directory) => {
                let files = [("schedule.json".to_string(), text.into_bytes())];
                output::write_set(directory, &files, self.force)?;
            }
            None => output::print(&text)?,
        }
        if !imported.kept.is_empty() {
            output::note(&format!("kept from the base: {}\n", knots(&imported.kept)));
        }
        if !imported.dropped.is_empty() {
            output::note(&format!("left out of the base: {}\n", knots(&imported.dropped)));
        }
        if !imported.from_base.is_empty() {
            output::note(&format!("from the base: {}\n", imported.from_base.join(", ")));
        }
        Ok(Outcome::Done)
    }
}
