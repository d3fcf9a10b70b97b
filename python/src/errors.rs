//! Faults as the exceptions of `coaxdesign.errors`.

use coaxdesign::linear::LinearError;
use coaxdesign::pipeline::PipelineError;
use coaxdesign::problem::{Diagnostic, Report, Severity};
use coaxdesign::schedule::ScheduleError;
use coaxdesign::vehicle::VehicleError;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// An exception of `coaxdesign.errors` by the name of its class.
pub fn raise(py: Python<'_>, class: &str, message: &str) -> PyErr {
    made(py, class, |class| class.call1((message,)))
}

fn made<'py>(
    py: Python<'py>,
    class: &str,
    make: impl FnOnce(Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>>,
) -> PyErr {
    let found = py.import("coaxdesign.errors").and_then(|module| module.getattr(class));
    match found.and_then(make) {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// A finding as `(severity, file, line, column, key, message, help)`.
pub type Finding = (&'static str, String, usize, usize, String, String, String);

pub fn finding(of: &Diagnostic) -> Finding {
    let severity = match of.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    (
        severity,
        of.file.clone(),
        of.line,
        of.column,
        of.key.clone(),
        of.message.clone(),
        of.help.clone(),
    )
}

/// Everything that is wrong with a file, as an exception that lists it.
pub fn report(py: Python<'_>, class: &str, report: &Report) -> PyErr {
    let findings: Vec<Finding> =
        report.errors.iter().chain(&report.warnings).map(finding).collect();
    made(py, class, |class| class.call1((report.render(false), findings)))
}

pub fn vehicle(py: Python<'_>, error: &VehicleError) -> PyErr {
    raise(py, "ProblemError", &format!("the model cannot be built: {error}"))
}

pub fn linear(py: Python<'_>, error: &LinearError) -> PyErr {
    raise(py, "LinearError", &error.to_string())
}

pub fn schedule(py: Python<'_>, error: &ScheduleError) -> PyErr {
    raise(py, "ScheduleError", &error.to_string())
}

/// Why the pipeline could not go on: the class of its kind.
pub fn pipeline(py: Python<'_>, error: &PipelineError, input: &str) -> PyErr {
    let told = |class: &str| {
        let help = error.help();
        let help = if help.is_empty() { String::new() } else { format!("; {help}") };
        raise(py, class, &format!("{error}{help}"))
    };
    match error {
        PipelineError::Input(of) => report(py, input, of),
        PipelineError::Vehicle(error) => vehicle(py, error),
        PipelineError::NoBreakpoint => told("TrimError"),
        PipelineError::NoTrim(point) => {
            let speed = point.condition.airspeed;
            let reason = crate::problem::reason(&point.status);
            raise(py, "TrimError", &format!("no trim at {speed:.3} m/s: {reason}"))
        }
        PipelineError::Models(_) | PipelineError::Linear(_) => told("LinearError"),
        PipelineError::Schedule(error) => schedule(py, error),
        PipelineError::Flight(_) => told("SimulationError"),
        _ => told("DesignError"),
    }
}

/// A mistake of the library, which panicked.
pub fn internal(message: &str) -> PyErr {
    PyRuntimeError::new_err(format!("this is a mistake of coaxdesign; please report it: {message}"))
}
