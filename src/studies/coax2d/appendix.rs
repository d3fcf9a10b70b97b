//! The residualised models printed in the paper's appendix.
//!
//! Rotor-on-rotor interactions are on, the states are u, v, w (ft/s), p, q, r
//! (rad/s), φ, θ (rad), the inputs percent of stick. Four decimals are printed,
//! so that an entry is known to ±5·10⁻⁵. The numbers stand once, in
//! `appendix.json`.

use crate::linear::io::set_from_json;
use crate::linear::set::Interpolation;
use crate::linear::{Channel, LinearError, StateSpace};
use crate::units::{KNOT, System};

/// Half a unit of the last printed decimal, in the printed units.
pub const PRINTED_PRECISION: f64 = 5e-5;

/// A flight condition of the appendix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Hover.
    Hover,
    /// Printed as 80 kt. A(w,q) and A(v,r) are u₀ plus small terms and give
    /// u₀ ≈ 118 ft/s, which is 70 kt (or 80 mph).
    Forward,
}

impl Condition {
    /// True airspeed printed in the paper, kt.
    pub fn printed_speed_kt(self) -> f64 {
        match self {
            Condition::Hover => 0.0,
            Condition::Forward => 80.0,
        }
    }

    /// True airspeed that the matrices themselves imply, kt.
    pub fn implied_speed_kt(self) -> f64 {
        match self {
            Condition::Hover => 0.0,
            Condition::Forward => 70.0,
        }
    }
}

/// The printed models as a file of the schema
/// [`LTI_SET_SCHEMA`](crate::linear::io::LTI_SET_SCHEMA), in the printed units:
/// hover, then forward flight at the speed that its own entries imply.
pub const MODELS: &str = include_str!("appendix.json");

/// The printed model as a state-space model, in SI units inside.
///
/// # Errors
/// None in practice: a test reads the file.
pub fn appendix(condition: Condition) -> Result<StateSpace, LinearError> {
    let set = set_from_json(MODELS)?;
    set.at(condition.implied_speed_kt() * KNOT, Interpolation::Linear)
}

/// One entry of A or B, printed and computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// State whose rate is meant.
    pub row: String,
    /// State or input that it is a derivative with respect to.
    pub column: String,
    /// Value in the paper, ft, s, rad, percent.
    pub printed: f64,
    /// Value of the model, same units.
    pub computed: f64,
}

impl Entry {
    /// computed/printed.
    pub fn ratio(&self) -> f64 {
        self.computed / self.printed
    }
}

/// Every printed entry of A and B larger than `threshold` in the printed units
/// (entries below 0.01 have few digits), beside the model's.
///
/// # Errors
/// A model without the eight states and four sticks by name.
pub fn compare_with_appendix(
    model: &StateSpace,
    condition: Condition,
    threshold: f64,
) -> Result<Vec<Entry>, LinearError> {
    let paper = appendix(condition)?;
    let printed = paper.matrices_in(System::Us);
    let computed = model.matrices_in(System::Us);
    let mut entries = Vec::new();
    for (i, row) in paper.states().iter().enumerate() {
        let k = model.state(&row.name)?;
        for (j, column) in paper.states().iter().enumerate() {
            let l = model.state(&column.name)?;
            push(&mut entries, (row, column), printed.a[(i, j)], computed.a[(k, l)], threshold);
        }
        for (j, column) in paper.inputs().iter().enumerate() {
            let l = model.input(&column.name)?;
            push(&mut entries, (row, column), printed.b[(i, j)], computed.b[(k, l)], threshold);
        }
    }
    Ok(entries)
}

fn push(
    entries: &mut Vec<Entry>,
    (row, column): (&Channel, &Channel),
    printed: f64,
    computed: f64,
    threshold: f64,
) {
    if printed.abs() > threshold {
        entries.push(Entry {
            row: row.name.clone(),
            column: column.name.clone(),
            printed,
            computed,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::dense::eigenvalues;
    use crate::linear::modes::{ModeName, modes};

    #[test]
    fn the_model_agrees_with_itself() {
        for condition in [Condition::Hover, Condition::Forward] {
            let model = appendix(condition).unwrap();
            let entries = compare_with_appendix(&model, condition, 0.01).unwrap();
            assert!(entries.len() > 20);
            assert!(entries.iter().all(|e| (e.ratio() - 1.0).abs() < 1e-14));
        }
    }

    #[test]
    fn gravity_terms_are_gravity() {
        // A(v, φ) = g cos θ₀ and A(u, θ) = −g cos θ₀, 32.17 ft/s².
        let hover = appendix(Condition::Hover).unwrap();
        let g = 9.80665;
        assert!((hover.derivative("v", "phi").unwrap() - g).abs() < 2e-3);
        assert!((hover.derivative("u", "theta").unwrap() + g).abs() < 2e-3);
        let forward = appendix(Condition::Forward).unwrap();
        // g (cos θ₀, −sin θ₀): θ₀ = −3.74 deg.
        let theta = -(forward.derivative("w", "theta").unwrap()
            / -forward.derivative("u", "theta").unwrap())
        .atan();
        assert!((theta.to_degrees() + 3.74).abs() < 0.01, "{}", theta.to_degrees());
    }

    #[test]
    fn hover_has_two_unstable_oscillations() {
        // The paper's Figure 15: an unstable oscillation in roll and in pitch.
        let model = appendix(Condition::Hover).unwrap();
        let values = eigenvalues(model.a()).unwrap();
        let unstable = values.iter().filter(|z| z.re > 0.0 && z.im > 0.0).count();
        assert_eq!(unstable, 2);
        assert_eq!(values.len(), 8);
    }

    #[test]
    fn val_appendix_modes_have_the_structure_of_the_text() {
        // Hover: two unstable oscillations, one damped coupled pair, and two
        // slow subsidences (Figure 15 and its discussion).
        let hover: Vec<_> = modes(&appendix(Condition::Hover).unwrap())
            .unwrap()
            .into_iter()
            .map(|m| m.name)
            .collect();
        let count = |name| hover.iter().filter(|n| **n == Some(name)).count();
        assert_eq!(count(ModeName::CoupledOscillation), 2, "{hover:?}");
        assert_eq!(count(ModeName::CoupledSubsidence), 1);
        assert_eq!(count(ModeName::HeaveYawSubsidence), 2);
        // Forward: the classical set.
        let forward: Vec<_> = modes(&appendix(Condition::Forward).unwrap())
            .unwrap()
            .into_iter()
            .map(|m| m.name)
            .collect();
        for name in
            [ModeName::Phugoid, ModeName::ShortPeriod, ModeName::DutchRoll, ModeName::SpiralRoll]
        {
            assert!(forward.contains(&Some(name)), "{name:?} in {forward:?}");
        }
    }
}
