//! Sweeps: their heads, and batches of their cases.

use coaxdesign::pipeline::{self, SweepError, SweepHead, SweepPlan, TuneOptions};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde_json::Value as Json;

use crate::design::{Specification, channels_of};
use crate::errors;
use crate::problem::Problem;
use crate::run::run;
use crate::schedule::Schedule;

/// A case as rows of JSON: its row, and its schedule and verification where
/// there are such.
type Case = (String, Option<String>, Option<String>);

/// A sweep that is ready to be worked on.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Sweep {
    sweep: pipeline::Sweep,
}

fn raised(py: Python<'_>, error: &SweepError) -> PyErr {
    match error {
        SweepError::Case { report, .. } => errors::report(py, "ProblemError", report),
        other => errors::raise(py, "StudyError", &other.to_string()),
    }
}

fn read<T: serde::de::DeserializeOwned>(py: Python<'_>, text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|error| errors::raise(py, "StudyError", &error.to_string()))
}

/// Every combination of values: pairs of a key and its values, as JSON; gives
/// the plan as JSON.
#[pyfunction]
pub fn sweep_grid(py: Python<'_>, factors: &str) -> PyResult<String> {
    let factors: Vec<(String, Vec<Json>)> = read(py, factors)?;
    let plan = SweepPlan::grid(&factors).map_err(|error| raised(py, &error))?;
    serde_json::to_string(&plan).map_err(|error| errors::internal(&error.to_string()))
}

#[pymethods]
impl Sweep {
    /// A sweep; `plan` is JSON.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // Python's lists come as vectors
    fn new(
        py: Python<'_>,
        problems: Vec<(String, PyRef<'_, Problem>)>,
        specifications: Vec<(String, PyRef<'_, Specification>)>,
        schedule: Option<&Schedule>,
        channels: Vec<String>,
        plan: &str,
    ) -> PyResult<Self> {
        let problems =
            problems.iter().map(|(name, p)| (name.clone(), p.loaded.as_ref().clone())).collect();
        let specifications =
            specifications.iter().map(|(name, s)| (name.clone(), s.requirements.clone())).collect();
        let schedule = schedule.map(|schedule| schedule.schedule.clone());
        let options = TuneOptions { channels: channels_of(py, &channels)?, explain_all: false };
        let plan: SweepPlan = read(py, plan)?;
        pipeline::Sweep::new(problems, specifications, schedule, options, plan)
            .map(|sweep| Self { sweep })
            .map_err(|error| raised(py, &error))
    }

    /// What the sweep is, as JSON.
    fn head(&self) -> PyResult<String> {
        serde_json::to_string(self.sweep.head())
            .map_err(|error| errors::internal(&error.to_string()))
    }

    /// Hash of the head.
    fn hash(&self) -> String {
        self.sweep.head().hash()
    }

    /// Where another head, JSON, differs from this sweep's.
    fn differences(&self, py: Python<'_>, head: &str) -> PyResult<Vec<String>> {
        let other: SweepHead = read(py, head)?;
        Ok(self.sweep.head().differences(&other))
    }

    /// Names of the rows' columns, and their units.
    fn columns(&self) -> Vec<(String, String)> {
        self.sweep.columns()
    }

    /// Works on these cases on so many threads: each as a row of JSON, with its
    /// schedule and its verification where there are such.
    #[pyo3(signature = (indices, threads=1, progress=None))]
    fn design(
        &self,
        py: Python<'_>,
        indices: Vec<usize>,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Case>> {
        let cases = self.sweep.head().plan.cases.len();
        if let Some(beyond) = indices.iter().find(|index| **index >= cases) {
            let message =
                format!("there is no case {beyond}; the sweep's cases are 0 to {}", cases - 1);
            return Err(errors::raise(py, "StudyError", &message));
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| errors::internal(&error.to_string()))?;
        let done = run(py, progress.as_ref(), |ticker| {
            ticker.start("cases", indices.len());
            pool.install(|| {
                indices
                    .par_iter()
                    .map(|&index| {
                        let case = self.sweep.run(index, ticker);
                        ticker.tick();
                        case
                    })
                    .collect::<Result<Vec<_>, _>>()
            })
        })?
        .map_err(|error| errors::pipeline(py, &error, "ProblemError"))?;
        let broken = |error: &dyn std::fmt::Display| errors::internal(&error.to_string());
        done.into_iter()
            .map(|case| {
                let row = Json::Object(case.row).to_string();
                match case.files {
                    None => Ok((row, None, None)),
                    Some(files) => {
                        let schedule = files.schedule.to_json().map_err(|error| broken(&error))?;
                        let verification = serde_json::to_string_pretty(&files.verification)
                            .map_err(|error| broken(&error))?;
                        Ok((row, Some(schedule), Some(verification + "\n")))
                    }
                }
            })
            .collect()
    }
}
