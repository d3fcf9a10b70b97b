//! The residualised models printed in the source paper's appendix.
//!
//! Kreienkamp, Saetti, Özkurt and Fichter, "Flight Dynamics and Control of a
//! Coaxial-Teetering Rotor Ultralight Helicopter with Rotor-on-Rotor
//! Interactions": rotor-on-rotor interactions on, states u, v, w (ft/s),
//! p, q, r (rad/s), φ, θ (rad), inputs in percent of stick. Four decimals are
//! printed, so that an entry is known to ±5·10⁻⁵.

use nalgebra::DMatrix;

use super::LinearError;
use super::model::{Channel, Matrices, StateSpace};
use crate::units::{Kind, System};

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

/// System matrix at hover, ft, s, rad.
#[rustfmt::skip]
const A_HOVER: [[f64; 8]; 8] = [
    [-0.0079,  0.0098,  0.0014,  0.2365,  0.6854,  0.0287,  0.0,    -32.17],
    [ 0.0045, -0.0099,  0.0007, -0.3045, -0.0294, -0.0154, 32.17,     0.0],
    [-0.0639,  0.0021, -0.0172, -0.0150,  0.3094,  0.1049,  0.0015,  -0.0084],
    [-0.0014, -0.0013, -0.0008, -0.1126,  0.1021, -0.0225,  0.0,      0.0],
    [ 0.0005, -0.0014, -0.0003, -0.0653, -0.0957, -0.0056,  0.0,      0.0],
    [ 0.0006,  0.0004, -0.0036, -0.0201,  0.0139, -0.0946,  0.0,      0.0],
    [ 0.0,     0.0,     0.0,     1.0,     0.0,     0.0003,  0.0,      0.0],
    [ 0.0,     0.0,     0.0,     0.0,     1.0,     0.0,     0.0,      0.0],
];

/// Control matrix at hover, ft, s, rad, percent.
#[rustfmt::skip]
const B_HOVER: [[f64; 4]; 8] = [
    [ 0.0194, -0.6596, -0.0004, 0.0],
    [ 0.2363,  0.0001, -0.0001, 0.0],
    [-0.0015, -0.0631, -1.6552, 0.3480],
    [ 0.1839,  0.0006, -0.0002, 0.0049],
    [-0.0014,  0.0814,  0.0001, 0.0],
    [ 0.0379,  0.0014, -0.0009, 0.0256],
    [ 0.0,     0.0,     0.0,    0.0],
    [ 0.0,     0.0,     0.0,    0.0],
];

/// System matrix in forward flight, ft, s, rad.
#[rustfmt::skip]
const A_FORWARD: [[f64; 8]; 8] = [
    [-0.0764,  0.0,     0.0569, -0.0032,   8.7042,    0.0041,   0.0,    -32.1016],
    [-0.0003, -0.0983,  0.0008, -8.4619,   0.0021, -117.2804,  32.1016,  -0.0013],
    [ 0.0478, -0.0002, -1.5518,  0.0773, 117.1017,    0.0140,   0.0199,   2.0971],
    [ 0.0002,  0.0107,  0.0009, -0.2150,   0.0491,   -0.1385,   0.0,      0.0],
    [ 0.0031,  0.0002, -0.0322, -0.0308,  -0.3888,   -0.0065,   0.0,      0.0],
    [ 0.0,     0.0357,  0.0005, -0.1600,   0.0065,   -0.4482,   0.0,      0.0],
    [ 0.0,     0.0,     0.0,     1.0,      0.0,      -0.0653,   0.0,      0.0],
    [ 0.0,     0.0,     0.0,     0.0,      1.0,       0.0006,   0.0,      0.0],
];

/// Control matrix in forward flight, ft, s, rad, percent.
#[rustfmt::skip]
const B_FORWARD: [[f64; 4]; 8] = [
    [ 0.0238, -0.3477,  0.1617, -0.0356],
    [ 0.0045,  0.0046,  0.0031, -0.0013],
    [-0.1717, -4.0453, -2.8214,  0.6238],
    [ 0.1343,  0.0018, -0.0006,  0.0039],
    [-0.0021,  0.0412, -0.0190,  0.0060],
    [ 0.0276,  0.0006, -0.0001,  0.0204],
    [ 0.0,     0.0,     0.0,     0.0],
    [ 0.0,     0.0,     0.0,     0.0],
];

/// The printed model as a state-space model, in SI units inside.
pub fn appendix(condition: Condition) -> Result<StateSpace, LinearError> {
    let (a, b) = match condition {
        Condition::Hover => (A_HOVER, B_HOVER),
        Condition::Forward => (A_FORWARD, B_FORWARD),
    };
    let states = state_channels();
    let inputs =
        ["lat", "lon", "col", "ped"].map(|name| Channel::new(name, Kind::Percent)).to_vec();
    StateSpace::from_matrices_in(
        System::Us,
        states.clone(),
        inputs,
        states,
        Matrices {
            a: DMatrix::from_fn(8, 8, |i, j| a[i][j]),
            b: DMatrix::from_fn(8, 4, |i, j| b[i][j]),
            c: DMatrix::identity(8, 8),
            d: DMatrix::zeros(8, 4),
        },
    )
}

/// The eight rigid-body states in the paper's order.
pub fn state_channels() -> Vec<Channel> {
    [
        ("u", Kind::Velocity),
        ("v", Kind::Velocity),
        ("w", Kind::Velocity),
        ("p", Kind::AngularRateRad),
        ("q", Kind::AngularRateRad),
        ("r", Kind::AngularRateRad),
        ("phi", Kind::AngleRad),
        ("theta", Kind::AngleRad),
    ]
    .map(|(name, kind)| Channel::new(name, kind))
    .to_vec()
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
/// (the issue of entries below 0.01 is rounding), beside the model's.
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
}
