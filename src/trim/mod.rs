//! Periodic trim: the orbit that a rotorcraft settles into at a flight
//! condition.
//!
//! A two-bladed rotor shakes its airframe, so a trimmed rotorcraft is never at
//! rest: it flies a periodic orbit. Single shooting finds it: the unknowns are
//! the state at azimuth zero and the four sticks; the residuals are the change
//! of every state over one period and the mean flight condition. Both go to a
//! bounded Levenberg–Marquardt solver ([`crate::numerics::least_squares`])
//! with the exact Jacobian, carried along the integration by dual numbers.
//!
//! * [`condition`]: what is asked for.
//! * [`shooting`]: one period of flight and its derivatives.
//! * [`solve`]: one trim point, from a guess, with its report.
//! * [`path`]: which of several solutions is the trim of a condition.
//! * [`power`]: the rate of climb from the power.
//! * [`stand`]: a rotor alone, on a hub that does not move.
//! * [`mod@sweep`]: many points.

pub mod condition;
pub mod path;
pub mod power;
pub mod shooting;
pub mod solve;
pub mod stand;
pub mod sweep;

pub use condition::{FlightCondition, Lateral};
pub use power::trim_at_power;
pub use solve::{Branch, ConvergedTrim, Guess, Options, RotorMean, Status, TrimPoint, trim};
pub use sweep::{Sweep, sweep, trim_at};
