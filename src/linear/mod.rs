//! Linear models of the periodic dynamics.
//!
//! A rotorcraft in trimmed flight repeats itself once a rotor revolution, so
//! its exact linear model is periodic. This module holds that model and what
//! is made of it:
//!
//! * [`model`]: the periodic model (LTP) and the state-space model (LTI), both
//!   with named channels.
//! * [`linearize`]: the periodic model of a converged trim.
//! * [`dense`]: checked dense linear algebra: eigenvalues, Lyapunov equations,
//!   stable and unstable subspaces.
//! * [`harmonic`]: the averaged model and the harmonic decomposition.
//! * [`floquet`]: monodromy, multipliers, exponents with their branch, modes.
//! * [`reduction`]: fewer states, each way with its error over frequency.
//! * [`modes`]: eigenvalues, damping, participation, names of modes.
//! * [`frequency`]: frequency responses and comparisons of models.
//! * [`structure`]: transmission zeros, controllability, relative gains.
//! * [`time_response`]: exact responses to steps and doublets.
//! * [`set`]: models over speed, interpolated and checked at midpoints.
//! * [`io`]: JSON, CSV and MAT files.
//! * [`mat`]: reads MAT files.
//!
//! Inside, everything is SI and radians; see [`crate::units`] for the shown
//! units.

pub mod dense;
pub mod floquet;
pub mod frequency;
pub mod harmonic;
pub mod io;
pub mod linearize;
pub mod mat;
pub mod model;
pub mod modes;
pub mod reduction;
pub mod set;
pub mod structure;
pub mod time_response;

pub use model::{Channel, PeriodicModel, StateSpace};

/// What can go wrong with a linear model, in the user's terms.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinearError {
    /// A matrix holds a NaN or an infinity.
    #[error("{what} is not finite at row {row}, column {column}")]
    NotFinite {
        /// The matrix.
        what: String,
        /// Row name or number.
        row: String,
        /// Column name or number.
        column: String,
    },
    /// A matrix does not fit the channels.
    #[error(
        "{what} is {found_rows} by {found_columns}, but the channels ask for {rows} by {columns}"
    )]
    Shape {
        /// The matrix.
        what: String,
        /// Rows found.
        found_rows: usize,
        /// Columns found.
        found_columns: usize,
        /// Rows wanted.
        rows: usize,
        /// Columns wanted.
        columns: usize,
    },
    /// A name that the model does not have.
    #[error("no {role} named \"{name}\"{}", suggestion(.nearest))]
    UnknownName {
        /// `state`, `input` or `output`.
        role: &'static str,
        /// The name asked for.
        name: String,
        /// The nearest name that exists.
        nearest: Option<String>,
    },
    /// Two channels with one name.
    #[error("two {role}s are named \"{name}\"")]
    DuplicateName {
        /// `state`, `input` or `output`.
        role: &'static str,
        /// The name.
        name: String,
    },
    /// The block of the states to be residualised has no inverse.
    #[error(
        "the fast states cannot be residualised: their block of A is singular \
         (reciprocal condition {reciprocal_condition:.1e}). The rates of {} say \
         nothing new about the fast states and leave {} undetermined. Keep the \
         former, or remove them first if nothing depends on them",
        .states.join(", "),
        .free.join(", ")
    )]
    SingularFastBlock {
        /// States whose equations are dependent: integrators of kept states,
        /// as a rule.
        states: Vec<String>,
        /// States that the block leaves undetermined.
        free: Vec<String>,
        /// Smallest over largest singular value of the balanced block.
        reciprocal_condition: f64,
    },
    /// A state that others depend on cannot just be removed.
    #[error("state \"{state}\" cannot be removed: {dependent} depends on it")]
    StillUsed {
        /// The state.
        state: String,
        /// A state or output that depends on it.
        dependent: String,
    },
    /// A system of equations without a unique solution.
    #[error("{what} is singular to working precision")]
    Singular {
        /// The equations.
        what: String,
    },
    /// An iteration that did not reach its tolerance.
    #[error("{what} did not converge: {achieved:.1e} after {limit}, wanted {wanted:.1e}")]
    NotConverged {
        /// The iteration.
        what: String,
        /// Error reached.
        achieved: f64,
        /// Error wanted.
        wanted: f64,
        /// Where it was stopped.
        limit: String,
    },
    /// A method for stable systems met an unstable one.
    #[error("{what} needs a stable system, but an eigenvalue has real part {real_part:.3e} rad/s")]
    Unstable {
        /// The method.
        what: String,
        /// Largest real part, rad/s.
        real_part: f64,
    },
    /// A request outside what the method is defined for.
    #[error("{0}")]
    Domain(String),
    /// A file that could not be understood.
    #[error("{0}")]
    Format(String),
}

fn suggestion(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |n| format!("; did you mean \"{n}\"?"))
}
