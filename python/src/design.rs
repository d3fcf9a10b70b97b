//! Tuning and verification.

use std::path::PathBuf;

use coaxdesign::control::axis::Channel;
use coaxdesign::pipeline::directory::{NOTE, Note};
use coaxdesign::pipeline::{self, Requirements, TuneOptions};
use pyo3::prelude::*;

use crate::errors;
use crate::problem::Problem;
use crate::run::run;
use crate::schedule::Schedule;

/// A specification, with the text that it was read from.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Specification {
    pub requirements: Requirements,
}

#[pymethods]
impl Specification {
    /// The built-in specification.
    #[staticmethod]
    fn builtin(py: Python<'_>) -> PyResult<Self> {
        Self::of(py, Requirements::builtin())
    }

    /// A specification file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Self::of(py, Requirements::load(&path))
    }

    /// A text; `name` stands for the file in messages.
    #[staticmethod]
    fn parse(py: Python<'_>, name: &str, text: &str) -> PyResult<Self> {
        Self::of(py, Requirements::parse(name, text))
    }

    /// Keeps the first nominal model only.
    fn nominal_only(&self) -> Self {
        Self { requirements: self.requirements.clone().nominal_only() }
    }

    /// Name and text that it was read from.
    #[getter]
    fn file(&self) -> (String, String) {
        (self.requirements.name.clone(), self.requirements.text.clone())
    }

    /// Breakpoints, true airspeed in m/s.
    #[getter]
    fn speeds(&self) -> Vec<f64> {
        self.requirements.specification.speeds.clone()
    }

    /// Names of the models, the nominal first.
    #[getter]
    fn models(&self) -> Vec<String> {
        self.requirements.specification.models.iter().map(|model| model.info.name.clone()).collect()
    }

    /// Hash of the text, as a schedule carries it.
    #[getter]
    fn hash(&self) -> String {
        self.requirements.hash()
    }
}

impl Specification {
    fn of(
        py: Python<'_>,
        read: Result<Requirements, coaxdesign::problem::Report>,
    ) -> PyResult<Self> {
        read.map(|requirements| Self { requirements })
            .map_err(|report| errors::report(py, "SpecificationError", &report))
    }
}

pub fn json(document: Result<serde_json::Value, serde_json::Error>) -> PyResult<String> {
    document.map(|value| value.to_string()).map_err(|error| errors::internal(&error.to_string()))
}

/// Channels by name.
pub fn channels_of(py: Python<'_>, names: &[String]) -> PyResult<Vec<Channel>> {
    names
        .iter()
        .map(|name| {
            Channel::ALL.into_iter().find(|channel| channel.name() == name).ok_or_else(|| {
                let known: Vec<&str> = Channel::ALL.iter().map(|c| c.name()).collect();
                let message = format!("there is no channel {name:?}; one of {}", known.join(", "));
                errors::raise(py, "DesignError", &message)
            })
        })
        .collect()
}

/// Tunes a schedule: the schedule, and its `verification.json`. `channels` are
/// the outer loops to tune, all of the specification where none is named.
#[pyfunction]
#[pyo3(signature = (problem, specification, channels, explain_all=false, progress=None))]
pub fn tune(
    py: Python<'_>,
    problem: &Problem,
    specification: &Specification,
    channels: Vec<String>,
    explain_all: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Schedule, String)> {
    let options = TuneOptions { channels: channels_of(py, &channels)?, explain_all };
    let tuned = run(py, progress.as_ref(), |ticker| {
        pipeline::tune(&problem.loaded, &specification.requirements, &options, ticker)
    })?
    .map_err(|error| errors::pipeline(py, &error, "SpecificationError"))?;
    let document = json(tuned.verification_document())?;
    Ok((Schedule::of(py, tuned.schedule)?, document))
}

/// Verifies a schedule against a specification, whose hardware it takes: its
/// `verification.json`.
#[pyfunction]
#[pyo3(signature = (schedule, problem, specification, progress=None))]
pub fn verify(
    py: Python<'_>,
    schedule: &Schedule,
    problem: &Problem,
    specification: &Specification,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let verified = run(py, progress.as_ref(), |ticker| {
        let specification = &specification.requirements.specification;
        pipeline::verify(&schedule.schedule, &problem.loaded.problem, specification, ticker)
    })?
    .map_err(|error| errors::pipeline(py, &error, "SpecificationError"))?;
    json(pipeline::verification_document(&verified, &[], &[]))
}

/// Files of a design's directory beside the schedule: its note, the problem
/// and the specification, by their places.
#[pyfunction]
pub fn design_files(
    problem: &Problem,
    specification: &Specification,
) -> PyResult<Vec<(String, Vec<u8>)>> {
    let note = Note::new(&problem.loaded, &specification.requirements);
    let mut files = note.files(&problem.loaded, &specification.requirements);
    let text = note.to_json().map_err(|error| errors::internal(&error.to_string()))?;
    files.push((NOTE.into(), text.into_bytes()));
    Ok(files)
}
