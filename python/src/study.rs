//! Monte Carlo studies: their heads, and batches of their runs.

use coaxdesign::pipeline::{self, StudyHead};
use coaxdesign::simulate::montecarlo::{COLUMNS, Criterion, Ranges, wilson};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::errors;
use crate::flight::{Equipment, Maneuver, plan};
use crate::problem::Problem;
use crate::run::run;
use crate::schedule::Schedule;

/// A study that is ready to be flown.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Study {
    study: pipeline::Study,
}

fn read<T: serde::de::DeserializeOwned>(py: Python<'_>, text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|error| errors::raise(py, "StudyError", &error.to_string()))
}

#[pymethods]
impl Study {
    /// A study of `runs` flights; `variation`, `ranges` and `criterion` are
    /// JSON.
    #[new]
    #[allow(clippy::too_many_arguments)] // what one study needs
    fn new(
        py: Python<'_>,
        problem: &Problem,
        schedule: Option<&Schedule>,
        maneuver: &Maneuver,
        variation: &str,
        equipment: Equipment,
        runs: usize,
        ranges: &str,
        criterion: &str,
    ) -> PyResult<Self> {
        let ranges: Ranges = read(py, ranges)?;
        let criterion: Criterion = read(py, criterion)?;
        let plan = plan(py, schedule, maneuver, variation, &equipment, 1)?;
        let law = schedule.map(|schedule| &schedule.schedule);
        pipeline::Study::new(&problem.loaded, law, plan, runs, ranges, criterion)
            .map(|study| Self { study })
            .map_err(|error| errors::pipeline(py, &error, "ProblemError"))
    }

    /// What the study is, as JSON.
    fn head(&self) -> PyResult<String> {
        serde_json::to_string(self.study.head())
            .map_err(|error| errors::internal(&error.to_string()))
    }

    /// Hash of the head.
    fn hash(&self) -> String {
        self.study.head().hash()
    }

    /// Where another head, JSON, differs from this study's.
    fn differences(&self, py: Python<'_>, head: &str) -> PyResult<Vec<String>> {
        let other: StudyHead = read(py, head)?;
        Ok(self.study.head().differences(&other))
    }

    /// Flies these runs on so many threads, and gives each as a row of JSON.
    #[pyo3(signature = (indices, threads=1, progress=None))]
    fn fly(
        &self,
        py: Python<'_>,
        indices: Vec<usize>,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<String>> {
        let runs = self.study.head().runs;
        if let Some(beyond) = indices.iter().find(|index| **index >= runs) {
            let message =
                format!("there is no run {beyond}; the study's runs are 0 to {}", runs - 1);
            return Err(errors::raise(py, "StudyError", &message));
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| errors::internal(&error.to_string()))?;
        let flown = run(py, progress.as_ref(), |ticker| {
            ticker.start("flights", indices.len());
            pool.install(|| {
                indices
                    .par_iter()
                    .map(|&index| {
                        let flown = self.study.run(index, ticker);
                        ticker.tick();
                        flown
                    })
                    .collect::<Result<Vec<_>, _>>()
            })
        })?
        .map_err(|error| errors::pipeline(py, &error, "ProblemError"))?;
        flown
            .iter()
            .map(|run| {
                serde_json::to_string(run).map_err(|error| errors::internal(&error.to_string()))
            })
            .collect()
    }
}

/// Columns of the rows, and their units.
#[pyfunction]
pub fn study_columns() -> Vec<(&'static str, &'static str)> {
    COLUMNS.to_vec()
}

/// Wilson's interval of a success rate at 95 %.
#[pyfunction]
pub fn confidence(successes: usize, runs: usize) -> [f64; 2] {
    wilson(successes, runs, 1.96)
}
