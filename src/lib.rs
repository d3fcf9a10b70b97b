//! From a description of a rotorcraft to a flyable gain schedule.
//!
//! Data flows one way down this street; a module uses only those above it.
//!
//! * [`units`]: the only conversion constants, and quantities with units.
//! * [`numerics`]: interpolation, quadrature, derivatives, least squares, conic programs.
//! * [`problem`]: a TOML file becomes checked data, every error of it reported at once.
//! * [`vehicle`]: the time-periodic dynamics `xdot = f(azimuth, x, u)`.
//! * [`trim`]: the periodic orbit of a flight condition.
//! * [`linear`]: linear time-periodic and time-invariant models along that orbit.
//! * [`control`]: the control law, its specifications and metrics, and its tuning.
//! * [`schedule`]: the gain schedule as a file.
//! * [`simulate`]: flight in time of the full nonlinear vehicle under the law.
//! * [`export`]: the schedule in the forms of other programs, and back.
//! * [`report`]: tables and plots of what the stages found.
//! * [`cli`]: the command line around them.

pub mod cli;
pub mod control;
pub mod export;
pub mod linear;
pub mod numerics;
pub mod problem;
pub mod report;
pub mod schedule;
pub mod simulate;
pub mod trim;
pub mod units;
pub mod vehicle;
