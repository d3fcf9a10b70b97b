//! Linear models from elsewhere.

use std::path::PathBuf;

use coaxdesign::lti::{self, LtiSet};
use coaxdesign::pipeline::{self, TuneOptions};
use pyo3::prelude::*;

use crate::design::{Specification, channels_of, json};
use crate::errors;
use crate::run::run;
use crate::schedule::Schedule;

/// A set of linear models, brought to our names and units.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Models {
    set: LtiSet,
}

#[pymethods]
impl Models {
    /// A file, or a directory of CSV tables; names and units are as the
    /// specification's `[models_from]` says.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, specification: &Specification) -> PyResult<Self> {
        let mapping = &specification.requirements.specification.models_from;
        Self::of(py, lti::load(&path, mapping))
    }

    /// A text of `coaxdesign.lti-set/1`; `name` stands for the file in messages.
    #[staticmethod]
    fn parse(
        py: Python<'_>,
        name: &str,
        text: &str,
        specification: &Specification,
    ) -> PyResult<Self> {
        let mapping = &specification.requirements.specification.models_from;
        Self::of(py, lti::parse_json(name, text, mapping))
    }

    /// Name of the aircraft.
    #[getter]
    fn name(&self) -> String {
        self.set.name.clone()
    }

    /// True airspeeds, m/s.
    #[getter]
    fn speeds(&self) -> Vec<f64> {
        self.set.speeds()
    }

    /// What was done to the models that their owner should know.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.set.notes.clone()
    }

    /// Whether actuators, delays and sensors are in the models.
    #[getter]
    fn hardware_included(&self) -> bool {
        self.set.hardware_included
    }
}

impl Models {
    fn of(py: Python<'_>, read: Result<LtiSet, coaxdesign::problem::Report>) -> PyResult<Self> {
        read.map(|set| Self { set }).map_err(|report| errors::report(py, "ModelsError", &report))
    }
}

/// As `tune`, on linear models.
#[pyfunction]
#[pyo3(signature = (models, specification, channels, explain_all=false, progress=None))]
pub fn tune_models(
    py: Python<'_>,
    models: &Models,
    specification: &Specification,
    channels: Vec<String>,
    explain_all: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Schedule, String)> {
    let options = TuneOptions { channels: channels_of(py, &channels)?, explain_all };
    let tuned = run(py, progress.as_ref(), |ticker| {
        pipeline::tune_models(&models.set, &specification.requirements, &options, ticker)
    })?
    .map_err(|error| errors::pipeline(py, &error, "SpecificationError"))?;
    let document = json(tuned.verification_document())?;
    Ok((Schedule::of(py, tuned.schedule)?, document))
}

/// As `verify`, on linear models.
#[pyfunction]
#[pyo3(signature = (schedule, models, specification, progress=None))]
pub fn verify_models(
    py: Python<'_>,
    schedule: &Schedule,
    models: &Models,
    specification: &Specification,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let verified = run(py, progress.as_ref(), |ticker| {
        let specification = &specification.requirements.specification;
        pipeline::verify_models(&schedule.schedule, &models.set, specification, ticker)
    })?
    .map_err(|error| errors::pipeline(py, &error, "SpecificationError"))?;
    json(pipeline::verification_document(&verified, &[], &[]))
}
