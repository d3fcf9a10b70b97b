//! The flight condition that a trim is asked for.

use serde::{Deserialize, Serialize};

/// What is held of the sideways freedom.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Lateral {
    /// Mean sideslip asin(v/V), rad; the bank angle follows.
    Sideslip(f64),
    /// Mean bank angle, rad; the sideslip follows.
    Bank(f64),
}

/// A steady flight condition in still air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlightCondition {
    /// True airspeed V, m/s, not negative.
    pub airspeed: f64,
    /// Rate of climb, m/s, at most V in magnitude unless V is zero, when it
    /// is the whole speed.
    pub climb_rate: f64,
    /// Rate of turn of the heading, rad/s, positive to starboard.
    pub turn_rate: f64,
    /// Sideslip or bank.
    pub lateral: Lateral,
}

impl FlightCondition {
    /// Level flight straight ahead at a true airspeed, m/s, without sideslip.
    #[must_use]
    pub fn level(airspeed: f64) -> Self {
        Self { airspeed, climb_rate: 0.0, turn_rate: 0.0, lateral: Lateral::Sideslip(0.0) }
    }

    /// Horizontal part of the speed, m/s.
    #[must_use]
    pub fn horizontal_speed(&self) -> f64 {
        (self.airspeed * self.airspeed - self.climb_rate * self.climb_rate).max(0.0).sqrt()
    }
}
