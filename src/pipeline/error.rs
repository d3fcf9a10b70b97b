//! Why a pipeline could not go on.

use crate::control::design::DesignError;
use crate::control::explain::ExplainError;
use crate::control::models::ModelsError;
use crate::control::plant::PlantError;
use crate::control::tuning::TuningError;
use crate::control::verify::VerifyError;
use crate::linear::LinearError;
use crate::lti::stitch::StitchError;
use crate::problem::Report;
use crate::schedule::ScheduleError;
use crate::simulate::SimulationError;
use crate::simulate::flight::FlightError;
use crate::trim::TrimPoint;
use crate::vehicle::VehicleError;

/// Why a stage has no result. A design that misses its requirements, or a
/// flight that ends early, is a result and no error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// A problem, specification or manoeuvre is wrong or cannot be read.
    #[error("{0}")]
    Input(#[from] Report),
    /// No model of the aircraft can be built.
    #[error("the model cannot be built: {0}")]
    Vehicle(#[from] VehicleError),
    /// The models to tune on could not be made.
    #[error("{0}")]
    Models(ModelsError),
    /// Linear models could not be made or reduced.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// No model trims at any breakpoint.
    #[error("no model trims at any speed of the schedule")]
    NoBreakpoint,
    /// There is no design.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The design cannot be verified.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// A missed target cannot be explained.
    #[error("a missed target cannot be explained: {0}")]
    Explain(#[from] ExplainError),
    /// The schedule cannot be used.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    /// A condition that must trim does not.
    #[error("no trim at {:.1} m/s: {}", .0.condition.airspeed, .0.status.word())]
    NoTrim(Box<TrimPoint>),
    /// A stitched model cannot be varied or trimmed.
    #[error(transparent)]
    Stitch(#[from] StitchError),
    /// The flight cannot begin.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The observer asked to stop.
    #[error("stopped before the end")]
    Cancelled,
}

impl From<ModelsError> for PipelineError {
    fn from(error: ModelsError) -> Self {
        match error {
            ModelsError::Vehicle { source, .. } => Self::Vehicle(source),
            ModelsError::Stopped => Self::Cancelled,
            other => Self::Models(other),
        }
    }
}

impl From<PlantError> for PipelineError {
    fn from(error: PlantError) -> Self {
        Self::Verify(error.into())
    }
}

impl PipelineError {
    /// What a user can do about it; empty where the message says it all.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match self {
            Self::Input(_) | Self::Vehicle(_) => "",
            Self::Models(
                ModelsError::Variation { .. }
                | ModelsError::Stitch { .. }
                | ModelsError::NonMinimumPhase { .. }
                | ModelsError::NoSpeed { .. },
            ) => "docs/models.md tells what a set of models can give",
            Self::Models(_) => {
                "look at the trim by itself with `coaxdesign trim`, and choose the speeds of the \
                 specification within the aircraft's reach"
            }
            Self::NoBreakpoint | Self::NoTrim(_) => {
                "look at the trim by itself with `coaxdesign trim`"
            }
            Self::Design(DesignError::Tuning(TuningError::Unstabilisable { .. })) => {
                "no gains of this law's structure were found to stabilise it: less delay, or \
                 another speed range"
            }
            Self::Design(DesignError::NoChannel) => {
                "name axes that the specification has a table for"
            }
            Self::Design(_) | Self::Verify(_) | Self::Linear(_) | Self::Explain(_) => {
                "look at the models with `coaxdesign linearize`"
            }
            Self::Schedule(_) => "a schedule is written by `coaxdesign tune-gains -o DIR`",
            Self::Flight(FlightError::NoRotorSpeed) => {
                "write [rotors.NAME.governor] in the problem, or --model \"governor=1 s\""
            }
            Self::Flight(FlightError::NoLaw) => {
                "name a design; `coaxdesign tune-gains -o DIR` makes one"
            }
            Self::Flight(FlightError::Simulation(_)) => {
                "look at --control-rate, --steps, --pitch-rate-limit and the schedule's hardware"
            }
            Self::Flight(_) => "look at the trim of the start and at the manoeuvre's commands",
            Self::Stitch(_) => "docs/models.md tells what a set of models can give",
            Self::Cancelled => "the same command goes on from what is done",
        }
    }
}

impl From<SimulationError> for PipelineError {
    fn from(error: SimulationError) -> Self {
        Self::Flight(error.into())
    }
}
