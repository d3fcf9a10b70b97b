//! What Python sees of the library, as `coaxdesign._core`.
//!
//! This crate turns Python's arguments into calls of the library and results
//! into arrays; it computes nothing. The Python package around it
//! (`python/coaxdesign`) gives the results their shape: tables with units,
//! models of other packages, plots.
//!
//! * [`mod@errors`]: faults as Python exceptions, one class a kind.
//! * [`run`]: long work without the interpreter's lock, with progress and
//!   Ctrl-C.
//! * [`arrays`]: columns and matrices as NumPy arrays.
//! * [`problem`], [`linear`], [`schedule`], [`mod@design`], [`flight`], [`figure`],
//!   [`study`], [`sweep`], [`models`]: one file a stage.

mod arrays;
mod design;
mod errors;
mod figure;
mod flight;
mod linear;
mod models;
mod problem;
mod run;
mod schedule;
mod study;
mod sweep;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::design::{Specification, design_files, tune, verify};
    #[pymodule_export]
    use super::figure::history_svg;
    #[pymodule_export]
    use super::flight::{Maneuver, maneuver_names, simulate};
    #[pymodule_export]
    use super::linear::linearize;
    #[pymodule_export]
    use super::models::{Models, tune_models, verify_models};
    #[pymodule_export]
    use super::problem::{Problem, problem_names, quantity, reload, trim, trim_svg};
    #[pymodule_export]
    use super::schedule::{Schedule, export_formats};
    #[pymodule_export]
    use super::study::{Study, confidence, study_columns};
    #[pymodule_export]
    use super::sweep::{Sweep, sweep_grid};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
