//! `coaxdesign design`.

use std::path::{Path, PathBuf};

use super::CliError;

/// What a design notes of its inputs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Noted {
    /// Problem file or built-in name.
    pub problem: Option<PathBuf>,
    /// Specification file; none for the built-in one.
    pub specification: Option<PathBuf>,
}

impl Noted {
    /// Reads the note of a design, if there is one.
    pub fn read(_directory: &Path) -> Result<Self, CliError> {
        Ok(Self::default())
    }
}
