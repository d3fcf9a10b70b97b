//! How a subcommand ends.

use std::io::IsTerminal;
use std::path::PathBuf;

use super::output;
use coaxdesign::pipeline::{LockError, PipelineError};
use coaxdesign::problem::{Report, visible};
use coaxdesign::vehicle::VehicleError;

/// Exit code of an internal error.
pub(super) const INTERNAL: u8 = 70;

/// How a subcommand ended that could do its work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The goal is reached.
    Done,
    /// The computation ran, its result has been shown, but it falls short of
    /// the goal.
    GoalMissed,
}

impl Outcome {
    pub(super) fn exit_code(self) -> u8 {
        match self {
            Outcome::Done => 0,
            Outcome::GoalMissed => 1,
        }
    }
}

/// Why a subcommand could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// A problem file is wrong, or cannot be read.
    #[error("{0}")]
    Problem(#[from] Report),
    /// The problem is sound as a file, but no model of it can be built.
    #[error("the model cannot be built: {0}")]
    Vehicle(#[from] VehicleError),
    /// Arguments that cannot be used together, or mean nothing here.
    #[error("{message}")]
    Usage {
        /// What is wrong.
        message: String,
        /// What to write instead.
        help: String,
    },
    /// A file to be written is already there.
    #[error("{}: the file is already there", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file could not be written or read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file; `standard output` for that.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The computation ran, but could not give what was asked for.
    #[error("{0}")]
    Missed(String),
    /// A result that should have been there is not.
    #[error("internal error: {0}")]
    Internal(String),
}

impl From<LockError> for CliError {
    fn from(error: LockError) -> Self {
        let message = error.to_string();
        match error {
            LockError::Io { path, source } => Self::Io { path, source },
            LockError::Held { .. } => {
                Self::Usage { message, help: "wait until it has ended, or stop it".into() }
            }
        }
    }
}

impl From<PipelineError> for CliError {
    fn from(error: PipelineError) -> Self {
        let help = error.help();
        match error {
            PipelineError::Input(report) => Self::Problem(report),
            PipelineError::Vehicle(error) => Self::Vehicle(error),
            PipelineError::NoTrim(point) => Self::Missed(format!(
                "no trim to start from: {}",
                super::trim::failures(&[vec![*point]], None)
            )),
            PipelineError::Explain(error) => Self::Internal(error.to_string()),
            error => Self::Usage { message: error.to_string(), help: help.into() },
        }
    }
}

impl CliError {
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            CliError::Problem(report) if report.unreadable => 3,
            CliError::Missed(_) => 1,
            CliError::Problem(_) | CliError::Vehicle(_) | CliError::Usage { .. } => 2,
            CliError::Exists { .. } | CliError::Io { .. } => 3,
            CliError::Internal(_) => INTERNAL,
        }
    }

    pub(super) fn print(&self) {
        match self {
            CliError::Problem(report) => output::note(&report.render(color())),
            CliError::Usage { message, help } => {
                output::note(&shown(&format!("error: {message}\n  help: {help}\n")));
            }
            CliError::Exists { .. } => {
                output::note(&shown(&format!("error: {self}\n  help: --force replaces it\n")));
            }
            _ => output::note(&shown(&format!("error: {self}\n"))),
        }
    }
}

/// A message as a terminal can show it: names of files and arguments may hold
/// anything.
fn shown(text: &str) -> String {
    text.split('\n').map(|line| visible(line, true)).collect::<Vec<_>>().join("\n")
}

/// Whether messages to people may be coloured.
pub(super) fn color() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}
