//! Modal analysis: damping, frequency, participation and names of modes.

use nalgebra::{Complex, DVector};

use super::LinearError;
use super::dense::eigen;
use super::model::StateSpace;

type C64 = Complex<f64>;

/// A real mode, or a conjugate pair represented by its upper half.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Eigenvalue with Im λ ≥ 0, rad/s.
    pub eigenvalue: C64,
    /// Eigenvector of unit length, SI units.
    pub shape: DVector<C64>,
    /// Participation of each state, summing to one; `None` for a defective
    /// eigenvalue, which has no left eigenvector.
    pub participation: Option<Vec<f64>>,
    /// Names of the states that take part most, largest first, with their
    /// shares: those of at least a tenth.
    pub dominant: Vec<(String, f64)>,
    /// Name of the mode, where its shape is clear.
    pub name: Option<ModeName>,
}

impl Mode {
    /// True for a conjugate pair.
    pub fn oscillates(&self) -> bool {
        self.eigenvalue.im != 0.0
    }
    /// True if the motion grows.
    pub fn unstable(&self) -> bool {
        self.eigenvalue.re > 0.0
    }
    /// Natural frequency |λ|, rad/s.
    pub fn natural_frequency(&self) -> f64 {
        self.eigenvalue.norm()
    }
    /// Damping ratio −Re λ/|λ|; `None` at λ = 0.
    pub fn damping_ratio(&self) -> Option<f64> {
        let size = self.eigenvalue.norm();
        (size > 0.0).then(|| -self.eigenvalue.re / size)
    }
    /// Time constant −1/Re λ, s, negative for growth; `None` without decay.
    pub fn time_constant(&self) -> Option<f64> {
        (self.eigenvalue.re != 0.0).then(|| -1.0 / self.eigenvalue.re)
    }
    /// Time to double the amplitude, s, of a growing mode.
    pub fn time_to_double(&self) -> Option<f64> {
        (self.eigenvalue.re > 0.0).then(|| std::f64::consts::LN_2 / self.eigenvalue.re)
    }
    /// Time to halve the amplitude, s, of a decaying mode.
    pub fn time_to_half(&self) -> Option<f64> {
        (self.eigenvalue.re < 0.0).then(|| -std::f64::consts::LN_2 / self.eigenvalue.re)
    }
    /// Period of the oscillation, s.
    pub fn period(&self) -> Option<f64> {
        self.oscillates().then(|| std::f64::consts::TAU / self.eigenvalue.im)
    }
}

/// Names of the modes of a rotorcraft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModeName {
    /// Oscillation of u, θ and q together: the hovering cubic's pair in pitch.
    PitchOscillation,
    /// Real, stable root of the hovering cubic in pitch.
    PitchSubsidence,
    /// Oscillation of v, φ and p together: the hovering cubic's pair in roll.
    RollOscillation,
    /// Real, stable root dominated by p.
    RollSubsidence,
    /// Oscillation of both hovering cubics, coupled: neither pitch nor roll.
    CoupledOscillation,
    /// Well damped motion of both hovering cubics, coupled.
    CoupledSubsidence,
    /// Oscillation of u and θ with little q.
    Phugoid,
    /// Stable oscillation of w and q.
    ShortPeriod,
    /// Oscillation of v and r.
    DutchRoll,
    /// Slow real root of φ.
    Spiral,
    /// Slow oscillation of φ and p with little v: spiral and roll coupled.
    SpiralRoll,
    /// Real root of w.
    HeaveSubsidence,
    /// Real root of r.
    YawSubsidence,
    /// Real root of w and r together.
    HeaveYawSubsidence,
    /// Blade flapping.
    Flap,
    /// Rotor inflow.
    Inflow,
    /// Integration of a position or of the heading.
    Integrator,
}

impl ModeName {
    /// Name for people.
    pub fn label(self) -> &'static str {
        match self {
            ModeName::PitchOscillation => "pitch oscillation (hovering cubic)",
            ModeName::PitchSubsidence => "pitch subsidence",
            ModeName::RollOscillation => "roll oscillation (hovering cubic)",
            ModeName::RollSubsidence => "roll subsidence",
            ModeName::CoupledOscillation => "coupled roll-pitch oscillation (hovering cubic)",
            ModeName::CoupledSubsidence => "coupled roll-pitch subsidence",
            ModeName::Phugoid => "phugoid",
            ModeName::ShortPeriod => "short period",
            ModeName::DutchRoll => "Dutch roll",
            ModeName::Spiral => "spiral",
            ModeName::SpiralRoll => "spiral-roll oscillation",
            ModeName::HeaveSubsidence => "heave subsidence",
            ModeName::YawSubsidence => "yaw subsidence",
            ModeName::HeaveYawSubsidence => "heave-yaw subsidence",
            ModeName::Flap => "flap",
            ModeName::Inflow => "inflow",
            ModeName::Integrator => "integrator",
        }
    }
}

/// States with at least this participation are listed as dominant.
const DOMINANT: f64 = 0.1;

/// The modes of a model, slowest first, a conjugate pair once.
pub fn modes(model: &StateSpace) -> Result<Vec<Mode>, LinearError> {
    let e = eigen(model.a())?;
    let n = e.values.len();
    let names = model.state_names();
    let mut found = Vec::new();
    for k in 0..n {
        let value = e.values[k];
        if value.im < 0.0 {
            continue;
        }
        let shape = e.right.column(k).into_owned();
        let participation = e.left[k].as_ref().map(|w| {
            let sizes: Vec<f64> = (0..n).map(|i| (w[i].conj() * shape[i]).norm()).collect();
            let total: f64 = sizes.iter().sum();
            sizes.iter().map(|s| s / total).collect::<Vec<f64>>()
        });
        let mut dominant: Vec<(String, f64)> = participation
            .iter()
            .flatten()
            .zip(&names)
            .filter(|(share, _)| **share >= DOMINANT)
            .map(|(share, name)| ((*name).to_owned(), *share))
            .collect();
        dominant.sort_by(|x, y| y.1.total_cmp(&x.1));
        let name = participation.as_ref().and_then(|p| name_of(value, &names, p));
        found.push(Mode { eigenvalue: value, shape, participation, dominant, name });
    }
    Ok(found)
}

/// A group of states must hold this share for the mode to bear its name.
const CLEAR: f64 = 0.6;

fn name_of(value: C64, names: &[&str], participation: &[f64]) -> Option<ModeName> {
    let share = |wanted: &dyn Fn(&str) -> bool| -> f64 {
        names.iter().zip(participation).filter(|(name, _)| wanted(name)).map(|(_, p)| p).sum()
    };
    let of = |list: &[&str]| share(&|name| list.contains(&name));
    if share(&|name| name.contains("beta")) >= CLEAR {
        return Some(ModeName::Flap);
    }
    if share(&|name| name.contains("lambda")) >= CLEAR {
        return Some(ModeName::Inflow);
    }
    if of(&["x", "y", "z", "heading", "north", "east", "down", "altitude"]) >= CLEAR
        && value.im == 0.0
    {
        return Some(ModeName::Integrator);
    }
    let oscillates = value.im != 0.0;
    let stable = value.re < 0.0;
    let pitch = of(&["u", "q", "theta"]);
    let roll = of(&["v", "p", "phi"]);
    let (q, w, r) = (of(&["q"]), of(&["w"]), of(&["r"]));
    if oscillates {
        // In the hovering cubic s³ + a = 0 the three states share alike; in
        // the phugoid q hardly takes part.
        if pitch >= CLEAR {
            return Some(if q >= 0.2 { ModeName::PitchOscillation } else { ModeName::Phugoid });
        }
        if w + q >= CLEAR && w >= 0.2 && q >= 0.2 && stable {
            return Some(ModeName::ShortPeriod);
        }
        if of(&["v", "r"]) >= CLEAR && r >= 0.2 {
            return Some(ModeName::DutchRoll);
        }
        if roll >= CLEAR && of(&["v"]) >= 0.15 {
            return Some(ModeName::RollOscillation);
        }
        if of(&["phi", "p"]) >= CLEAR {
            return Some(ModeName::SpiralRoll);
        }
        if pitch >= 0.3 && roll >= 0.3 && q + of(&["p"]) >= 0.2 {
            // Damped beyond ζ = 0.7 an oscillation is no longer seen as one.
            return Some(if stable && -value.re >= 0.7 * value.norm() {
                ModeName::CoupledSubsidence
            } else {
                ModeName::CoupledOscillation
            });
        }
        return None;
    }
    if w >= CLEAR {
        return Some(ModeName::HeaveSubsidence);
    }
    if r >= CLEAR {
        return Some(ModeName::YawSubsidence);
    }
    if w + r >= CLEAR {
        return Some(ModeName::HeaveYawSubsidence);
    }
    if of(&["phi"]) >= 0.5 && value.norm() < 0.3 {
        return Some(ModeName::Spiral);
    }
    if roll >= CLEAR && stable && of(&["p"]) >= 0.3 {
        return Some(ModeName::RollSubsidence);
    }
    if pitch >= CLEAR && stable && q >= 0.3 {
        return Some(ModeName::PitchSubsidence);
    }
    if pitch >= 0.3 && roll >= 0.3 && q + of(&["p"]) >= 0.3 && stable {
        return Some(ModeName::CoupledSubsidence);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::model::Channel;
    use crate::units::Kind;
    use nalgebra::DMatrix;

    fn model(names: &[&str], a: &[f64]) -> StateSpace {
        let n = names.len();
        let states = names.iter().map(|name| Channel::new(*name, Kind::Dimensionless)).collect();
        StateSpace::with_state_outputs(
            states,
            vec![Channel::new("in", Kind::Percent)],
            DMatrix::from_row_slice(n, n, a),
            DMatrix::from_element(n, 1, 1.0),
        )
        .unwrap()
    }

    #[test]
    fn oscillator_has_textbook_figures() {
        // s² + 2ζω s + ω² with ζ = 0.6, ω = 5.
        let all = modes(&model(&["a", "b"], &[0.0, 1.0, -25.0, -6.0])).unwrap();
        assert_eq!(all.len(), 1);
        let mode = &all[0];
        assert!((mode.damping_ratio().unwrap() - 0.6).abs() < 1e-14);
        assert!((mode.natural_frequency() - 5.0).abs() < 1e-13);
        assert!((mode.period().unwrap() - std::f64::consts::TAU / 4.0).abs() < 1e-13);
        assert!((mode.time_constant().unwrap() - 1.0 / 3.0).abs() < 1e-14);
        assert!((mode.time_to_half().unwrap() - 2f64.ln() / 3.0).abs() < 1e-14);
        assert_eq!(mode.time_to_double(), None);
        assert!((mode.participation.as_ref().unwrap().iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn hovering_cubic_splits_into_oscillation_and_subsidence() {
        // u̇ = −gθ, q̇ = M_u u + M_q q, θ̇ = q: s³ − M_q s² + g M_u = 0.
        let (m_u, m_q) = (0.003, -0.1);
        let cubic = model(&["u", "q", "theta"], &[0.0, 0.0, -9.81, m_u, m_q, 0.0, 0.0, 1.0, 0.0]);
        let all = modes(&cubic).unwrap();
        for mode in &all {
            let s = mode.eigenvalue;
            assert!((s * s * s - s * s * m_q + 9.81 * m_u).norm() < 1e-13);
        }
        let names: Vec<_> = all.iter().map(|m| m.name).collect();
        assert!(names.contains(&Some(ModeName::PitchOscillation)), "{names:?}");
        assert!(names.contains(&Some(ModeName::PitchSubsidence)), "{names:?}");
    }

    #[test]
    fn rotor_states_are_known_by_name() {
        let rotor = model(
            &["q", "upper.beta_1c", "lower.lambda_s0"],
            &[-1.0, 0.1, 0.0, 0.0, -20.0, 0.1, 0.0, 0.1, -8.0],
        );
        let names: Vec<_> = modes(&rotor).unwrap().iter().map(|m| m.name).collect();
        assert_eq!(names[1], Some(ModeName::Inflow));
        assert_eq!(names[2], Some(ModeName::Flap));
    }

    #[test]
    fn a_defective_eigenvalue_has_no_participation() {
        let integrators = model(&["x", "v"], &[0.0, 1.0, 0.0, 0.0]);
        let all = modes(&integrators).unwrap();
        assert!(all.iter().all(|m| m.participation.is_none()));
    }
}
