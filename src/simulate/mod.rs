//! Time-domain flight of the full nonlinear vehicle, or of a model stitched from
//! linear ones, with and without the control law.
//!
//! * [`airframe`]: what flies.
//! * [`equipment`]: sensors, noise, delay, actuators.
//! * [`wind`]: steady wind, Dryden turbulence, discrete gusts.
//! * [`simulator`]: the stepper, one control period at a time.
//! * [`maneuver`]: manoeuvre files.
//! * [`flight`]: simulator, law and manoeuvre together.
//! * [`record`]: what a flight leaves behind, row by row.
//! * [`metrics`]: what a flight amounts to.
//! * [`identify`]: frequency responses measured in flight.
//! * [`steps`]: small steps, flown and predicted.
//! * [`montecarlo`]: many flights with the aircraft and the air varied.

pub mod airframe;
pub mod equipment;
pub mod flight;
pub mod identify;
pub mod maneuver;
pub mod metrics;
pub mod montecarlo;
pub mod record;
pub mod simulator;
pub mod steps;
pub mod wind;

pub use airframe::{Airframe, Start};
pub use flight::{Flight, Status};
pub use maneuver::Maneuver;
pub use metrics::Metrics;
pub use record::Recorder;
pub use simulator::{Departure, Options, SimulationError, Simulator};
