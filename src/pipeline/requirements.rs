//! A specification with the text that it was read from.

use std::path::Path;

use crate::control::spec::{self, Specification};
use crate::lti::LtiSet;
use crate::problem::{Loaded, Report};
use crate::schedule::hash;

/// A specification, its text and its name: what a schedule is tuned to, with
/// its provenance.
#[derive(Debug, Clone)]
pub struct Requirements {
    /// The specification as read.
    pub specification: Specification,
    /// Name as it is shown: the path as given, or that of the built-in one.
    pub name: String,
    /// The whole text of the file.
    pub text: String,
}

impl Requirements {
    /// The built-in specification.
    ///
    /// # Errors
    /// None in practice: a test holds it to the checks.
    pub fn builtin() -> Result<Self, Report> {
        Self::parse(spec::BUILTIN_NAME, spec::BUILTIN)
    }

    /// Reads a specification file.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn load(path: &Path) -> Result<Self, Report> {
        let (specification, text) = spec::load_with_text(path)?;
        Ok(Self { specification, name: path.display().to_string(), text })
    }

    /// Reads a specification from a text; `name` stands for the file in
    /// messages.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn parse(name: &str, text: &str) -> Result<Self, Report> {
        Ok(Self { specification: spec::parse(name, text)?, name: name.into(), text: text.into() })
    }

    /// Keeps only the first nominal model.
    #[must_use]
    pub fn nominal_only(mut self) -> Self {
        self.specification.models.truncate(1);
        self
    }

    /// Hash of the text, as a schedule carries it.
    #[must_use]
    pub fn hash(&self) -> String {
        hash([self.text.as_str()])
    }
}

/// Hash of all files of a problem, as a schedule carries it.
#[must_use]
pub fn problem_hash(loaded: &Loaded) -> String {
    hash(loaded.sources.files().iter().map(|file| file.text.as_str()))
}

/// Hash of all files of a set of linear models, as a schedule carries it.
#[must_use]
pub fn models_hash(set: &LtiSet) -> String {
    hash(set.texts.iter().map(String::as_str))
}
