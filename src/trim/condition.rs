//! The flight condition that a trim is asked for.

use serde::{Deserialize, Serialize};

/// What is held of the sideways freedom.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Lateral {
    /// Mean sideslip asin(v/V), rad; the bank angle follows.
    Sideslip(f64),
    /// Mean bank angle, rad; the sideslip follows.
    Bank(f64),
    /// Direction of the horizontal flight path relative to the nose, rad,
    /// positive to starboard: 0 is forward flight, π/2 sideward to starboard, π
    /// rearward. The relative wind comes from there. The bank angle follows.
    WindAzimuth(f64),
}

/// A steady flight condition in still air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlightCondition {
    /// True airspeed V, m/s, not negative.
    pub airspeed: f64,
    /// Rate of climb, m/s, at most V in magnitude: a vertical climb has both
    /// the same (or V zero, which means the same).
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

    /// Straight flight without sideslip at a horizontal speed and a rate of
    /// climb, m/s. A horizontal speed of zero is a vertical climb.
    #[must_use]
    pub fn climbing(horizontal_speed: f64, climb_rate: f64) -> Self {
        let airspeed =
            if climb_rate == 0.0 { horizontal_speed } else { horizontal_speed.hypot(climb_rate) };
        Self { airspeed, climb_rate, ..Self::level(horizontal_speed) }
    }

    /// Level flight at a true airspeed, m/s, in a direction relative to the
    /// nose, rad; see [`Lateral::WindAzimuth`].
    #[must_use]
    pub fn from_azimuth(airspeed: f64, azimuth: f64) -> Self {
        Self { lateral: Lateral::WindAzimuth(azimuth), ..Self::level(airspeed) }
    }

    /// The condition in words, speeds in m/s, angles in degrees.
    #[must_use]
    pub fn in_words(&self) -> String {
        let mut text = format!("{:.2} m/s", self.horizontal_speed());
        if self.climb_rate != 0.0 {
            text += &format!(" climbing {:.2} m/s", self.climb_rate);
        }
        if self.turn_rate != 0.0 {
            text += &format!(" turning {:.3} rad/s", self.turn_rate);
        }
        match self.lateral {
            Lateral::Sideslip(angle) if angle != 0.0 => {
                text += &format!(" at {:.1} deg of sideslip", angle.to_degrees());
            }
            Lateral::Bank(angle) => text += &format!(" at {:.1} deg of bank", angle.to_degrees()),
            Lateral::WindAzimuth(angle) => {
                text += &format!(" with the wind from {:.1} deg", angle.to_degrees());
            }
            Lateral::Sideslip(_) => {}
        }
        text
    }

    /// Horizontal part of the speed, m/s.
    #[must_use]
    pub fn horizontal_speed(&self) -> f64 {
        (self.airspeed * self.airspeed - self.climb_rate * self.climb_rate).max(0.0).sqrt()
    }
}
