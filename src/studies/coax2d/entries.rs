//! Entries of the printed matrices beside those of a model.

use super::appendix::{Condition, Entry, compare_with_appendix};
use crate::linear::{LinearError, StateSpace};

/// Printed entries of A and B above this, in the printed units, are judged by
/// their ratio, the rest by their difference.
pub const SMALLEST: f64 = 0.01;
/// Ratios of ours to print that count as agreement.
pub const AGREEMENT: std::ops::RangeInclusive<f64> = 0.9..=1.1;
/// A difference of a small entry that is not worth a word.
pub const SMALL_DIFFERENCE: f64 = 0.005;

/// Printed entries beside ours; zeros are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Entries {
    /// Those above [`SMALLEST`].
    pub large: Vec<Entry>,
    /// The rest.
    pub small: Vec<Entry>,
}

/// Every printed entry that is not zero, but for the kinematic rows, which are
/// the same by construction.
///
/// # Errors
/// A model without the eight states and four sticks by name.
pub fn judged_entries(model: &StateSpace, condition: Condition) -> Result<Entries, LinearError> {
    let (large, small) = compare_with_appendix(model, condition, 0.0)?
        .into_iter()
        .filter(|entry| entry.row != "phi" && entry.row != "theta")
        .partition(|entry| entry.printed.abs() > SMALLEST);
    Ok(Entries { large, small })
}

/// Whether a large entry agrees with print.
#[must_use]
pub fn agrees(entry: &Entry) -> bool {
    AGREEMENT.contains(&entry.ratio())
}

/// Whether a small one does.
#[must_use]
pub fn is_near(entry: &Entry) -> bool {
    (entry.computed - entry.printed).abs() <= SMALL_DIFFERENCE
}
