//! The directory of a design: everything that made it, in a form that can be
//! moved, and the note that says so.
//!
//! ```text
//! DIR/
//!   design.json          this note: what made the design, stages, hashes
//!   problem/...          problem file with its bases and tables, as they were; or
//!   models/...           the set of linear models, as it was
//!   specification.toml   the specification, as it was
//!   maneuvers/...        manoeuvres flown by the pipeline
//!   schedule.json        what flies
//!   verification.json    how it was judged
//! ```
//!
//! Files of the problem keep their places relative to one another, so that
//! their texts, and the hash of these, stay the same. An absolute path in a
//! text is looked up in the copy.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::requirements::{Requirements, models_hash, problem_hash};
use crate::lti::{self, LtiSet};
use crate::problem::{self, Loaded, Report};
use crate::schedule::hash;
use crate::units::System;

/// Schema of `design.json`.
pub const SCHEMA: &str = "coaxdesign.design/2";
/// The note of a design.
pub const NOTE: &str = "design.json";
/// Folder of the problem's files.
const PROBLEM: &str = "problem";
/// Folder of the set of linear models.
const MODELS: &str = "models";
/// The specification.
const SPECIFICATION: &str = "specification.toml";
/// Folder of the manoeuvres.
pub const MANEUVERS: &str = "maneuvers";

/// A file that a design holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Where it lies in the directory, with forward slashes.
    pub file: String,
    /// Name that it was given by: a path, or a built-in name.
    pub origin: String,
    /// Hash of its text; for the problem, of the texts of all its files.
    pub hash: String,
}

/// In which form the aircraft of a design is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// As a problem.
    #[default]
    Problem,
    /// As a set of linear models.
    Models,
}

impl Form {
    fn is_problem(&self) -> bool {
        *self == Self::Problem
    }
}

/// The aircraft of a design.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Aircraft {
    /// Its name in the problem file or the set.
    pub name: String,
    /// Whether it is a problem or a set of models.
    #[serde(default, skip_serializing_if = "Form::is_problem")]
    pub form: Form,
    /// The problem file; or the set, a file or a folder.
    pub problem: Part,
    /// Folder that the files were copied from, where they name one another by
    /// absolute paths; else empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub copied_from: String,
    /// All files of it, the problem file first.
    pub files: Vec<String>,
}

/// How a stage ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The goal is reached.
    Done,
    /// There is a result, short of the goal.
    GoalMissed,
}

/// What is known of a stage that has run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Hash of all that it was made from.
    pub inputs: String,
    /// Hash of every file it made, by its place in the directory.
    pub outputs: BTreeMap<String, String>,
    /// How it ended.
    pub ended: Ended,
}

impl Record {
    /// A record of files that are in the directory now.
    ///
    /// # Errors
    /// The first file that is not.
    pub fn of(
        directory: &Path,
        inputs: String,
        files: &[String],
        ended: Ended,
    ) -> Result<Self, DirectoryError> {
        let mut outputs = BTreeMap::new();
        for file in files {
            let path = directory.join(file);
            let known = file_hash(&path)
                .map_err(|source| DirectoryError::Io { path: path.clone(), source })?;
            outputs.insert(file.clone(), known);
        }
        Ok(Self { inputs, outputs, ended })
    }

    /// Whether the stage need not run: its inputs are the same, and its files
    /// are as it left them.
    #[must_use]
    pub fn is_fresh(&self, directory: &Path, inputs: &str) -> bool {
        self.inputs == inputs
            && !self.outputs.is_empty()
            && self
                .outputs
                .iter()
                .all(|(file, known)| file_hash(&directory.join(file)).is_ok_and(|h| h == *known))
    }
}

/// `design.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Note {
    /// [`SCHEMA`].
    pub schema: String,
    /// Program and version.
    pub generator: String,
    /// The aircraft.
    pub aircraft: Aircraft,
    /// The specification.
    pub specification: Part,
    /// Manoeuvres that the pipeline flies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub maneuvers: Vec<Part>,
    /// Choices on the command line that shape results, such as units.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, String>,
    /// Stages by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub stages: BTreeMap<String, Record>,
}

/// Why a directory is no design that can be worked with.
#[derive(Debug, thiserror::Error)]
pub enum DirectoryError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The note is no note.
    #[error("{}: not the note of a design: {message}", path.display())]
    Note {
        /// The note.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A file of the design is wrong.
    #[error("{0}")]
    Input(#[from] Report),
    /// There is no problem in the design.
    #[error(
        "{}: the design was made from linear models, not from a problem", path.display()
    )]
    OfModels {
        /// The directory.
        path: PathBuf,
    },
    /// A file of the design is not what the design was made from.
    #[error(
        "{}: the file has changed since the design was made: its hash is {found}, the design's \
         is {expected}", path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Hash of the text as it is.
        found: String,
        /// Hash that the note has.
        expected: String,
    },
}

/// A design that is read: its note, its aircraft, its specification.
#[derive(Debug, Clone)]
pub struct DesignInputs {
    /// The note.
    pub note: Note,
    /// The problem.
    pub aircraft: Loaded,
    /// The specification.
    pub requirements: Requirements,
}

impl Note {
    /// The units that the design was asked for in, if the note says them.
    #[must_use]
    pub fn units(&self) -> Option<System> {
        match self.options.get("units").map(String::as_str) {
            Some("us") => Some(System::Us),
            Some("si") => Some(System::Si),
            _ => None,
        }
    }

    /// A note of these inputs, without stages.
    #[must_use]
    pub fn new(aircraft: &Loaded, requirements: &Requirements) -> Self {
        let (root, places) = placed(aircraft);
        let files: Vec<String> =
            places.iter().map(|place| format!("{PROBLEM}/{}", slashed(place))).collect();
        let origin =
            aircraft.sources.files().first().map(|file| file.name.clone()).unwrap_or_default();
        Self {
            schema: SCHEMA.into(),
            generator: format!("coaxdesign {}", env!("CARGO_PKG_VERSION")),
            aircraft: Aircraft {
                name: aircraft.problem.name.clone(),
                form: Form::Problem,
                problem: Part {
                    file: files.first().cloned().unwrap_or_default(),
                    origin,
                    hash: problem_hash(aircraft),
                },
                copied_from: if has_absolute_paths(aircraft) {
                    root.to_string_lossy().into_owned()
                } else {
                    String::new()
                },
                files,
            },
            specification: Part {
                file: SPECIFICATION.into(),
                origin: requirements.name.clone(),
                hash: requirements.hash(),
            },
            maneuvers: Vec::new(),
            options: BTreeMap::new(),
            stages: BTreeMap::new(),
        }
    }

    /// A note of a design that was made from linear models, without stages.
    /// `origin` is the path that named the set.
    #[must_use]
    pub fn of_models(set: &LtiSet, origin: &Path, requirements: &Requirements) -> Self {
        let files: Vec<String> = set.files.iter().map(|name| format!("{MODELS}/{name}")).collect();
        let file = match files.first() {
            Some(first) if !set.is_directory => first.clone(),
            _ => MODELS.into(),
        };
        Self {
            schema: SCHEMA.into(),
            generator: format!("coaxdesign {}", env!("CARGO_PKG_VERSION")),
            aircraft: Aircraft {
                name: set.name.clone(),
                form: Form::Models,
                problem: Part {
                    file,
                    origin: origin.display().to_string(),
                    hash: models_hash(set),
                },
                copied_from: String::new(),
                files,
            },
            specification: Part {
                file: SPECIFICATION.into(),
                origin: requirements.name.clone(),
                hash: requirements.hash(),
            },
            maneuvers: Vec::new(),
            options: BTreeMap::new(),
            stages: BTreeMap::new(),
        }
    }

    /// Files of a set of models and its specification, by their places in the
    /// directory.
    #[must_use]
    pub fn files_of_models(
        &self,
        set: &LtiSet,
        requirements: &Requirements,
    ) -> Vec<(String, Vec<u8>)> {
        let mut files: Vec<(String, Vec<u8>)> = set
            .contents()
            .into_iter()
            .map(|(name, bytes)| (format!("{MODELS}/{name}"), bytes))
            .collect();
        files.push((self.specification.file.clone(), requirements.text.clone().into_bytes()));
        files
    }

    /// The note of a directory; `None` where there is none, or one of an
    /// earlier version, which does not hold its inputs.
    ///
    /// # Errors
    /// A note that cannot be read, or is none.
    pub fn read(directory: &Path) -> Result<Option<Self>, DirectoryError> {
        #[derive(Deserialize)]
        struct Head {
            schema: String,
        }
        let path = directory.join(NOTE);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(source)
                if matches!(
                    source.kind(),
                    std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory
                ) =>
            {
                return Ok(None);
            }
            Err(source) => return Err(DirectoryError::Io { path, source }),
        };
        let wrong = |message: String| DirectoryError::Note { path: path.clone(), message };
        let head: Head = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        match head.schema.as_str() {
            SCHEMA => {
                serde_json::from_str(&text).map(Some).map_err(|error| wrong(error.to_string()))
            }
            "coaxdesign.design/1" => Ok(None),
            other => Err(wrong(format!("the schema is '{other}', expected '{SCHEMA}'"))),
        }
    }

    /// The note as JSON text.
    ///
    /// # Errors
    /// None in practice: all of it can be written as JSON.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Files of problem and specification, by their places in the directory.
    #[must_use]
    pub fn files(&self, aircraft: &Loaded, requirements: &Requirements) -> Vec<(String, Vec<u8>)> {
        let texts = aircraft.sources.files().iter().map(|file| file.text.clone().into_bytes());
        let mut files: BTreeMap<String, Vec<u8>> =
            self.aircraft.files.iter().cloned().zip(texts).collect();
        files.insert(self.specification.file.clone(), requirements.text.clone().into_bytes());
        files.into_iter().collect()
    }
}

impl DesignInputs {
    /// Reads a design directory; `None` where it holds no problem.
    ///
    /// # Errors
    /// A note or a file of the design that cannot be read, is wrong, or has
    /// changed since the design was made.
    pub fn read(directory: &Path) -> Result<Option<Self>, DirectoryError> {
        let Some(note) = Note::read(directory)? else { return Ok(None) };
        if note.aircraft.form == Form::Models {
            return Err(DirectoryError::OfModels { path: directory.into() });
        }
        let copy = directory.join(PROBLEM);
        let path = directory.join(&note.aircraft.problem.file);
        let aircraft = problem::load_copy(&path, Path::new(&note.aircraft.copied_from), &copy)?;
        same(&path, problem_hash(&aircraft), &note.aircraft.problem.hash)?;
        let path = directory.join(&note.specification.file);
        let requirements = Requirements::load(&path)?;
        same(&path, requirements.hash(), &note.specification.hash)?;
        Ok(Some(Self { note, aircraft, requirements }))
    }
}

/// A design that was made from linear models: its note, its set, its
/// specification.
#[derive(Debug, Clone)]
pub struct ModelInputs {
    /// The note.
    pub note: Note,
    /// The set.
    pub set: LtiSet,
    /// The specification.
    pub requirements: Requirements,
}

impl ModelInputs {
    /// Reads a design directory; `None` where it holds no set of models.
    ///
    /// # Errors
    /// As [`DesignInputs::read`].
    pub fn read(directory: &Path) -> Result<Option<Self>, DirectoryError> {
        let Some(note) = Note::read(directory)? else { return Ok(None) };
        if note.aircraft.form != Form::Models {
            return Ok(None);
        }
        let path = directory.join(&note.specification.file);
        let requirements = Requirements::load(&path)?;
        same(&path, requirements.hash(), &note.specification.hash)?;
        let path = directory.join(&note.aircraft.problem.file);
        let mut set = lti::load(&path, &requirements.specification.models_from)?;
        same(&path, models_hash(&set), &note.aircraft.problem.hash)?;
        // A set without a name has that of its folder or file, which is another
        // here.
        set.name.clone_from(&note.aircraft.name);
        Ok(Some(Self { note, set, requirements }))
    }
}

fn same(path: &Path, found: String, expected: &str) -> Result<(), DirectoryError> {
    if found == expected {
        return Ok(());
    }
    Err(DirectoryError::Changed { path: path.into(), found, expected: expected.into() })
}

/// Hash of a file's text.
///
/// # Errors
/// A file that cannot be read.
pub fn file_hash(path: &Path) -> std::io::Result<String> {
    let bytes = std::fs::read(path)?;
    Ok(hash([String::from_utf8_lossy(&bytes).as_ref()]))
}

/// The folder that holds all files of a problem, and their places in it.
fn placed(aircraft: &Loaded) -> (PathBuf, Vec<PathBuf>) {
    let whole: Vec<PathBuf> = aircraft
        .sources
        .files()
        .iter()
        .map(|file| tidy(&std::path::absolute(&file.path).unwrap_or_else(|_| file.path.clone())))
        .collect();
    let mut root = whole.first().and_then(|path| path.parent()).unwrap_or(Path::new("")).to_owned();
    while !whole.iter().all(|path| path.starts_with(&root)) && root.pop() {}
    let places =
        whole.iter().map(|path| path.strip_prefix(&root).unwrap_or(path).to_owned()).collect();
    (root, places)
}

/// Whether a text may hold an absolute path.
fn has_absolute_paths(aircraft: &Loaded) -> bool {
    let marks = ["\"/", "'/", ":\\", ":/"];
    let texts = aircraft.sources.files().iter().map(|file| &file.text);
    texts.into_iter().any(|text| marks.iter().any(|mark| text.contains(mark)))
}

/// A relative path with forward slashes.
fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.components().map(|c| c.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

/// A path without `.` and, where it can be seen, `..`.
fn tidy(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir
                if matches!(out.components().next_back(), Some(Component::Normal(_))) =>
            {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(directory: &Path, files: &[(String, Vec<u8>)]) {
        for (name, bytes) in files {
            let path = directory.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
    }

    /// A problem that extends a base by an absolute path: the design moves, and
    /// its sources are gone, and it is still the same aircraft.
    #[test]
    fn a_design_moves_without_its_sources() {
        let home = tempfile::tempdir().unwrap();
        let sources = home.path().join("sources");
        let built_in = problem::builtin().unwrap();
        let texts: Vec<(String, Vec<u8>)> = built_in
            .sources
            .files()
            .iter()
            .map(|f| (format!("base/{}", f.name), f.text.clone().into_bytes()))
            .collect();
        write(&sources, &texts);
        let base = sources.join("base/coax2d.toml");
        let own = sources.join("own/mine.toml");
        std::fs::create_dir_all(own.parent().unwrap()).unwrap();
        std::fs::write(&own, format!("extends = {base:?}\nname = \"mine\"\n")).unwrap();
        let aircraft = problem::load(&own).unwrap();
        let requirements = Requirements::builtin().unwrap();
        let note = Note::new(&aircraft, &requirements);
        assert_eq!(note.aircraft.problem.file, "problem/own/mine.toml");
        let mut files = note.files(&aircraft, &requirements);
        files.push((NOTE.into(), note.to_json().unwrap().into_bytes()));
        let made = home.path().join("made");
        write(&made, &files);
        std::fs::remove_dir_all(&sources).unwrap();
        let moved = home.path().join("moved");
        std::fs::rename(&made, &moved).unwrap();
        let read = DesignInputs::read(&moved).unwrap().unwrap();
        assert_eq!(read.note, note);
        assert_eq!(read.aircraft.problem.name, "mine");
        assert_eq!(problem_hash(&read.aircraft), problem_hash(&aircraft));
        // What is changed in it is said, with both hashes.
        std::fs::write(moved.join(SPECIFICATION), requirements.text.clone() + "\n").unwrap();
        let error = DesignInputs::read(&moved).unwrap_err().to_string();
        assert!(error.contains(&requirements.hash()) && error.contains(SPECIFICATION), "{error}");
        assert!(DesignInputs::read(home.path()).unwrap().is_none());
    }

    /// The set of a design goes along with it, in each of its forms.
    #[test]
    fn a_design_of_models_moves_without_its_sources() {
        let home = tempfile::tempdir().unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/models/uh60a");
        let texts: Vec<(String, Vec<u8>)> = std::fs::read_dir(&example)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                (format!("sources/{name}"), std::fs::read(path).unwrap())
            })
            .collect();
        write(home.path(), &texts);
        let origin = home.path().join("sources");
        let requirements = Requirements::builtin().unwrap();
        let set = lti::load(&origin, &requirements.specification.models_from).unwrap();
        let note = Note::of_models(&set, &origin, &requirements);
        let mut files = note.files_of_models(&set, &requirements);
        files.push((NOTE.into(), note.to_json().unwrap().into_bytes()));
        let made = home.path().join("made");
        write(&made, &files);
        std::fs::remove_dir_all(&origin).unwrap();
        let read = ModelInputs::read(&made).unwrap().unwrap();
        assert_eq!(read.note, note);
        assert_eq!((&read.set.name, read.set.speeds()), (&set.name, set.speeds()));
        assert_eq!(read.set.models[2].model, set.models[2].model);
        assert_eq!(models_hash(&read.set), models_hash(&set));
        // It has no problem, and a changed model is said.
        let error = DesignInputs::read(&made).unwrap_err().to_string();
        assert!(error.contains("made from linear models"), "{error}");
        let one = made.join("models/060kt.csv");
        let text = std::fs::read_to_string(&one).unwrap();
        std::fs::write(&one, text.replacen("-0.0144", "-0.0145", 1)).unwrap();
        let error = ModelInputs::read(&made).unwrap_err().to_string();
        assert!(error.contains("has changed"), "{error}");
    }

    #[test]
    fn a_stage_is_fresh_while_its_inputs_and_files_are_the_same() {
        let home = tempfile::tempdir().unwrap();
        let d = home.path();
        std::fs::write(d.join("a"), "1").unwrap();
        let record = Record::of(d, "key".into(), &["a".into()], Ended::Done).unwrap();
        assert!(record.is_fresh(d, "key"));
        assert!(!record.is_fresh(d, "other"));
        std::fs::write(d.join("a"), "2").unwrap();
        assert!(!record.is_fresh(d, "key"));
        assert!(Record::of(d, "key".into(), &["b".into()], Ended::Done).is_err());
    }
}
