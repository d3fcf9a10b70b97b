//! Names, units and places of states and blade controls.

use crate::problem::{InflowOptions, TotalInflow};
use crate::units::Kind;
use crate::vehicle::rotor::Rotor;
use crate::vehicle::wing::Wing;

/// A state or control: what it is called, what it measures, how large it
/// usually is.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Name, for example `u` or `upper.beta_1c`.
    pub name: String,
    /// What it measures; values are SI.
    pub kind: Kind,
    /// Usual size of a change of it, SI: scales of solvers and differences.
    pub scale: f64,
}

/// Where the states of the airframe stand.
#[derive(Debug, Clone, Copy)]
pub struct BodyStates {
    /// u, v, w.
    pub velocity: usize,
    /// p, q, r.
    pub rate: usize,
    /// Roll attitude φ.
    pub roll: usize,
    /// Pitch attitude θ.
    pub pitch: usize,
    /// How many.
    pub count: usize,
}

/// Where the states and controls of a rotor stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RotorStates {
    /// β_1c, β_1s; none for a rigid rotor.
    pub flapping: Option<usize>,
    /// Coning β_0, where it is a state.
    pub coning: Option<usize>,
    /// Where the flap states begin, how many angles they are, and how many
    /// rates, which follow.
    pub flap: [usize; 3],
    /// λ_s0, λ_s1c, λ_s1s; none for a rotor by coefficients.
    pub self_inflow: Option<usize>,
    /// λ_0, λ_1c, λ_1s; none where total inflow is algebraic.
    pub total_inflow: Option<usize>,
    /// Ω; none where speed is held.
    pub speed: Option<usize>,
    /// The azimuth's lead over nominal; none where speed is held, or the rotor
    /// is averaged over its azimuth.
    pub azimuth: Option<usize>,
    /// θ_0, θ_1c, θ_1s; none for a rotor by coefficients.
    pub pitch: Option<usize>,
    /// Ω_cmd, where a governor or a motor takes it.
    pub command: Option<usize>,
}

/// States and effectors of a vehicle, in order: blade controls and commanded
/// speeds of the rotors, then deflections of the wings' control surfaces.
#[derive(Debug, Clone)]
pub struct Layout {
    /// All states.
    pub states: Vec<Quantity>,
    /// All effectors.
    pub effectors: Vec<Quantity>,
    /// Places of each rotor's.
    pub rotors: Vec<RotorStates>,
    /// Place of each wing's deflection among the effectors, where it has a
    /// control surface.
    pub deflections: Vec<Option<usize>>,
}

impl Layout {
    /// Places of the airframe's states: u v w p q r φ θ come first.
    pub const BODY: BodyStates = BodyStates { velocity: 0, rate: 3, roll: 6, pitch: 7, count: 8 };

    pub(super) fn new(rotors: &[Rotor], wings: &[Wing], inflow: &InflowOptions) -> Self {
        let mut states = Vec::new();
        let mut effectors = Vec::new();
        let push = |list: &mut Vec<Quantity>, name: String, kind, scale| {
            list.push(Quantity { name, kind, scale });
        };
        for name in ["u", "v", "w"] {
            push(&mut states, name.to_owned(), Kind::Velocity, 1.0);
        }
        for name in ["p", "q", "r"] {
            push(&mut states, name.to_owned(), Kind::AngularRateRad, 0.1);
        }
        for name in ["phi", "theta"] {
            push(&mut states, name.to_owned(), Kind::AngleRad, 0.1);
        }
        let mut places = Vec::new();
        for rotor in rotors {
            let name = |state: &str| format!("{}.{state}", rotor.name);
            let (angles, rates) = match &rotor.set {
                Some(set) => set.states(),
                None if rotor.teetering => (vec!["beta_1c".into(), "beta_1s".into()], Vec::new()),
                None => (Vec::new(), Vec::new()),
            };
            let flap = [states.len(), angles.len(), rates.len()];
            let place = |state: &str| angles.iter().position(|angle| angle == state);
            let [coning, flapping] =
                ["beta_0", "beta_1c"].map(|state| place(state).map(|at| flap[0] + at));
            for angle in &angles {
                push(&mut states, name(angle), Kind::AngleRad, 0.02);
            }
            for rate in &rates {
                push(&mut states, name(rate), Kind::AngularRateRad, 0.02 * rotor.speed);
            }
            let bladed = rotor.coefficients.is_none();
            let self_inflow = bladed.then(|| {
                let start = states.len();
                for state in ["lambda_s0", "lambda_s1c", "lambda_s1s"] {
                    push(&mut states, name(state), Kind::Dimensionless, 0.01);
                }
                start
            });
            let total_inflow =
                (bladed && matches!(inflow.total_inflow, TotalInflow::LowPass { .. })).then(|| {
                    let start = states.len();
                    for state in ["lambda_0", "lambda_1c", "lambda_1s"] {
                        push(&mut states, name(state), Kind::Dimensionless, 0.01);
                    }
                    start
                });
            let speed = rotor.governor_time_constant.map(|_| {
                let start = states.len();
                push(&mut states, name("omega"), Kind::AngularRateRad, 1.0);
                start
            });
            let azimuth = (speed.is_some() && !rotor.is_averaged()).then(|| {
                let start = states.len();
                push(&mut states, name("azimuth"), Kind::AngleRad, 0.1);
                start
            });
            let pitch = bladed.then(|| {
                let start = effectors.len();
                for control in ["theta_0", "theta_1c", "theta_1s"] {
                    push(&mut effectors, name(control), Kind::AngleRad, 0.01);
                }
                start
            });
            let command = rotor.governor_time_constant.map(|_| {
                let start = effectors.len();
                push(&mut effectors, name("omega_command"), Kind::AngularRateRad, 1.0);
                start
            });
            places.push(RotorStates {
                flapping,
                coning,
                flap,
                self_inflow,
                total_inflow,
                speed,
                azimuth,
                pitch,
                command,
            });
        }
        let deflections = wings
            .iter()
            .map(|wing| {
                wing.surface.is_some().then(|| {
                    let place = effectors.len();
                    push(&mut effectors, format!("{}.deflection", wing.name), Kind::AngleRad, 0.01);
                    place
                })
            })
            .collect();
        Self { states, effectors, rotors: places, deflections }
    }

    /// Place of a state by name.
    #[must_use]
    pub fn state(&self, name: &str) -> Option<usize> {
        self.states.iter().position(|state| state.name == name)
    }
}
