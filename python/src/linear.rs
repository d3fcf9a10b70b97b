//! Linear models over speed.

use coaxdesign::linear::linearize::{Inputs, Options, linearize as periodic};
use coaxdesign::linear::reduction::{RIGID_BODY, residualise, truncate};
use coaxdesign::linear::{LinearError, StateSpace, harmonic};
use coaxdesign::pipeline::Task;
use coaxdesign::trim::{Options as TrimOptions, TrimPoint, sweep};
use coaxdesign::vehicle::Vehicle;
use nalgebra::DMatrix;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{channels, stacked};
use crate::errors;
use crate::problem::{Path, Problem, columns, conditions, reason};
use crate::run::run;

/// Names and units.
type Channels = Vec<(String, &'static str)>;
/// States, inputs and outputs; A, B, C, D, one matrix a speed; columns of the
/// trims.
type Models<'py> = ([Channels; 3], [Bound<'py, PyArrayDyn<f64>>; 4], Bound<'py, PyDict>);

/// How a model is reduced.
#[derive(Clone, Copy)]
enum Reduce {
    No,
    Residualise,
    Truncate,
}

/// Linear models at these speeds, m/s. `harmonics` of the state are kept
/// beside the mean; `reduce` is `"residualize"` or `"truncate"`, to the states
/// of `keep` or to those of the rigid body.
#[pyfunction]
#[pyo3(signature = (problem, speeds, path, harmonics=0, reduce=None, keep=None, rotor_inputs=false,
                    interactions=None, altitude=None, progress=None))]
#[allow(clippy::too_many_arguments)] // keywords of one Python function
pub fn linearize<'py>(
    py: Python<'py>,
    problem: &Problem,
    speeds: Vec<f64>,
    path: Path,
    harmonics: usize,
    reduce: Option<&str>,
    keep: Option<Vec<String>>,
    rotor_inputs: bool,
    interactions: Option<bool>,
    altitude: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Models<'py>> {
    let reduce = match reduce {
        None => Reduce::No,
        Some("residualize") => Reduce::Residualise,
        Some("truncate") => Reduce::Truncate,
        Some(other) => {
            let message =
                format!("{other:?} is no way to reduce a model; \"residualize\" or \"truncate\"");
            return Err(errors::raise(py, "LinearError", &message));
        }
    };
    let keep = keep.unwrap_or_else(|| RIGID_BODY.map(str::to_owned).to_vec());
    let conditions = conditions(py, &speeds, path)?;
    let changed = problem.changed(interactions, altitude);
    let vehicle = Vehicle::new(&changed).map_err(|error| errors::vehicle(py, &error))?;
    let inputs = if rotor_inputs { Inputs::Rotors } else { Inputs::Sticks };
    let options = Options { inputs, ..Options::default() };
    let model = |point: &TrimPoint| -> Result<StateSpace, LinearError> {
        let trim = point.clone().into_converged().map_err(|_| {
            LinearError::Domain(format!(
                "no trim at {:.3} m/s: {}",
                point.condition.airspeed,
                reason(&point.status)
            ))
        })?;
        let whole = periodic(&vehicle, &trim, &options)?.model;
        let full = if harmonics == 0 {
            whole.averaged()
        } else {
            harmonic::mean_and_harmonics(&whole, harmonics)?
        };
        Ok(match reduce {
            Reduce::No => full,
            Reduce::Residualise => residualise(&full, &keep)?.model,
            Reduce::Truncate => truncate(&full, &keep)?.model,
        })
    };
    let (points, models) = run(py, progress.as_ref(), |ticker| {
        ticker.start(Task::Models.name(), 2 * conditions.len());
        let points =
            sweep(&vehicle, &conditions, &TrimOptions::default(), |_| ticker.tick()).points;
        let models: Result<Vec<StateSpace>, LinearError> = points
            .par_iter()
            .map(|point| {
                let model = model(point);
                ticker.tick();
                model
            })
            .collect();
        (points, models)
    })?;
    if let Some(failed) = points.iter().find(|point| !point.on_orbit()) {
        let message =
            format!("no trim at {:.3} m/s: {}", failed.condition.airspeed, reason(&failed.status));
        return Err(errors::raise(py, "TrimError", &message));
    }
    let models = models.map_err(|error| errors::linear(py, &error))?;
    let Some(first) = models.first() else {
        return Err(errors::raise(py, "LinearError", "there is no speed to linearise at"));
    };
    let count = models.len();
    let (x, u, y) = (first.states().len(), first.inputs().len(), first.outputs().len());
    let stack = |pick: fn(&StateSpace) -> &DMatrix<f64>, size: [usize; 2]| {
        stacked(py, models.iter().map(pick), count, size)
    };
    Ok((
        [channels(first.states()), channels(first.inputs()), channels(first.outputs())],
        [
            stack(StateSpace::a, [x, x])?,
            stack(StateSpace::b, [x, u])?,
            stack(StateSpace::c, [y, x])?,
            stack(StateSpace::d, [y, u])?,
        ],
        columns(py, &vehicle, &points)?,
    ))
}
