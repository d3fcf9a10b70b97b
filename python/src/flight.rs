//! Manoeuvres and flights.

use std::path::PathBuf;

use coaxdesign::pipeline::{FlightPlan, PipelineError, fly};
use coaxdesign::simulate::maneuver;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Columns;
use crate::errors;
use crate::problem::Problem;
use crate::run::run;
use crate::schedule::Schedule;

/// A manoeuvre, with the text that it was read from.
#[pyclass(frozen, module = "coaxdesign._core")]
pub struct Maneuver {
    name: String,
    text: String,
    pub maneuver: maneuver::Maneuver,
}

#[pymethods]
impl Maneuver {
    /// A text; `name` stands for the file in messages.
    #[staticmethod]
    fn parse(py: Python<'_>, name: String, text: String) -> PyResult<Self> {
        match maneuver::parse(&name, &text) {
            Ok(maneuver) => Ok(Self { name, text, maneuver }),
            Err(report) => Err(errors::report(py, "ManeuverError", &report)),
        }
    }

    /// A built-in manoeuvre, or a file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let builtin = maneuver::BUILTIN.iter().find(|(known, _)| path.as_os_str() == *known);
        if let Some((name, text)) = builtin
            && !path.exists()
        {
            return Self::parse(py, format!("{name} (built in)"), (*text).into());
        }
        // The library reads the file for its messages, then gives the text.
        maneuver::load(&path)
            .map_err(|report| errors::report(py, "ManeuverError", &report))
            .and_then(|_| Ok(std::fs::read_to_string(&path)?))
            .and_then(|text| Self::parse(py, path.display().to_string(), text))
    }

    /// Title.
    #[getter]
    fn title(&self) -> String {
        self.maneuver.title.clone()
    }

    /// How long it takes, s.
    #[getter]
    fn duration(&self) -> f64 {
        self.maneuver.duration
    }

    /// Name and text that it was read from.
    #[getter]
    fn file(&self) -> (String, String) {
        (self.name.clone(), self.text.clone())
    }
}

/// Names of the built-in manoeuvres.
#[pyfunction]
pub fn maneuver_names() -> Vec<&'static str> {
    maneuver::BUILTIN.iter().map(|(name, _)| *name).collect()
}

/// How a flight is set up beside problem, law and manoeuvre.
#[derive(FromPyObject)]
pub struct Equipment {
    #[pyo3(item)]
    control_rate: f64,
    #[pyo3(item)]
    steps_per_revolution: usize,
    #[pyo3(item)]
    pitch_rate_limit: Option<f64>,
    #[pyo3(item)]
    seed: u64,
}

/// What is flown and how; `variation` is JSON.
pub fn plan(
    py: Python<'_>,
    schedule: Option<&Schedule>,
    maneuver: &Maneuver,
    variation: &str,
    equipment: &Equipment,
    every: u64,
) -> PyResult<FlightPlan> {
    let schedule = schedule.map(|schedule| &schedule.schedule);
    let mut plan = FlightPlan::new(maneuver.maneuver.clone(), schedule)
        .map_err(|error| errors::pipeline(py, &error, "SpecificationError"))?;
    plan.variation = serde_json::from_str(variation)
        .map_err(|error| errors::raise(py, "SimulationError", &error.to_string()))?;
    plan.every = every.max(1);
    let options = &mut plan.options;
    options.control_rate = equipment.control_rate;
    options.steps_per_revolution = equipment.steps_per_revolution;
    options.seed = equipment.seed;
    if let Some(limit) = equipment.pitch_rate_limit {
        options.pitch_rate_limit = limit;
    }
    Ok(plan)
}

/// Columns of the history, metrics as JSON, and how it ended.
type History<'py> = (Bound<'py, PyDict>, String, &'static str);

/// Flies a manoeuvre; every `every`th control period is a row of the history.
#[pyfunction]
#[pyo3(signature = (problem, schedule, maneuver, variation, equipment, every=1, progress=None))]
#[allow(clippy::too_many_arguments)] // what one flight needs
pub fn simulate<'py>(
    py: Python<'py>,
    problem: &Problem,
    schedule: Option<&Schedule>,
    maneuver: &Maneuver,
    variation: &str,
    equipment: Equipment,
    every: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<History<'py>> {
    let plan = plan(py, schedule, maneuver, variation, &equipment, every)?;
    let law = schedule.map(|schedule| &schedule.schedule);
    let mut values: Vec<Vec<f64>> = Vec::new();
    let flown = run(py, progress.as_ref(), |ticker| {
        fly(
            &problem.loaded.problem,
            law,
            &plan,
            ticker,
            |columns, row| -> Result<(), PipelineError> {
                if row.is_empty() {
                    values = vec![Vec::new(); columns.len()];
                }
                for (column, value) in values.iter_mut().zip(row) {
                    column.push(*value);
                }
                Ok(())
            },
        )
    })?
    .map_err(|error| errors::pipeline(py, &error, "ProblemError"))?;
    let columns = Columns::new(py);
    for (column, values) in flown.columns.iter().zip(values) {
        columns.numbers(&column.name, column.kind.coherent(), values)?;
    }
    let metrics = serde_json::to_string(&flown.metrics)
        .map_err(|error| errors::internal(&error.to_string()))?;
    Ok((columns.finish(), metrics, flown.status.word()))
}
