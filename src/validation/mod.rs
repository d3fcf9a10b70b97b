//! Identities: what must hold of a right implementation whatever the numbers
//! of the aircraft, with our error beside the tolerance.
//!
//! A model can agree with print and be wrong, or miss it and be right. These
//! do not depend on print: symmetry, conservation, agreement of two routes to
//! the same figure. [`identities`] looks at a whole problem; the validation
//! page shows the list and the tests hold every line of it.
//!
//! A [`Claim`] is a statement of a publication that a figure of ours meets or
//! misses.

mod claims;
mod identities;
mod level;
mod mirror;

pub use claims::{Bound, Claim};
pub use identities::{ValidationError, identities};
pub use level::LevelFlight;
pub use mirror::{mirror_signs, mirror_sticks, mirrored};

/// A statement that holds exactly, and how nearly it does.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// Stage of the street that it looks at.
    pub stage: &'static str,
    /// What must hold.
    pub statement: &'static str,
    /// Where it was looked at.
    pub case: String,
    /// How far it is from holding; not negative, NaN where it could not be
    /// computed.
    pub error: f64,
    /// What the error measures, with its unit.
    pub measure: &'static str,
    /// Largest error that still counts as holding: what rounding and the
    /// tolerances of trim and integration explain.
    pub tolerance: f64,
}

impl Identity {
    /// Whether it holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.error <= self.tolerance
    }
}
