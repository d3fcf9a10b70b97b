//! Hypotheses about why a number of ours is not the printed one, each tried by
//! one change to `coax2d-appendix` and the figures that it moves.
//!
//! A hypothesis is a problem file of the folder `hypotheses`; its first comment
//! says what is changed. Whoever doubts a figure runs the file:
//!
//! ```sh
//! coaxdesign linearize src/studies/coax2d/hypotheses/changed-sign.toml --speeds "0 kt" --reduce residualize
//! ```

use super::appendix::{Condition, appendix};
use super::entries::{self, Entries, judged_entries};
use super::table2::HOVER_ON;
use crate::linear::harmonic::mean_and_harmonics;
use crate::linear::reduction::{RIGID_BODY, residualise};
use crate::linear::{LinearError, StateSpace};
use crate::problem::{self, Problem};
use crate::trim::TrimPoint;
use crate::units::{HORSEPOWER, POUND_FORCE, System};
use crate::validation::{LevelFlight, ValidationError};
use crate::vehicle::Layout;
use rayon::prelude::*;

/// Name of the problem that every hypothesis changes.
pub const BASE: &str = "coax2d-appendix";
/// Folder of the hypotheses in the source tree.
pub const FOLDER: &str = "src/studies/coax2d/hypotheses";
/// Name of the hypothesis that the printed reduction took out the part of the
/// states that goes twice a revolution as well, where the mean leaves it out.
pub const HARMONICS: &str = "harmonics";

/// A hypothesis as a problem file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hypothesis {
    /// Name, and that of its file without `.toml`.
    pub name: &'static str,
    /// The file.
    pub text: &'static str,
}

macro_rules! hypotheses {
    ($($name:literal),+ $(,)?) => {
        &[$(Hypothesis {
            name: $name,
            text: include_str!(concat!("hypotheses/", $name, ".toml")),
        }),+]
    };
}

/// Every hypothesis that a problem file can express.
pub const HYPOTHESES: &[Hypothesis] = hypotheses![
    "changed-sign",
    "circles-21",
    "circles-9",
    "converged-rule",
    "exact-teeter",
    "linear-section",
    "no-blade-drag",
    "no-i-xz",
    "no-root-cutout",
    "no-tail-wash",
    "no-tail-wash-drag",
    "printed-drag-areas",
    "printed-fin",
    "printed-hubs",
    "printed-inertia",
    "skews-19",
    "torque-tilt",
    "total-mass-flow",
];

impl Hypothesis {
    /// One by its name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        HYPOTHESES.iter().find(|hypothesis| hypothesis.name == name).copied()
    }

    /// What it changes: the first comment of its file.
    #[must_use]
    pub fn change(&self) -> String {
        let lines = self.text.lines().map_while(|line| line.strip_prefix("# "));
        lines.collect::<Vec<_>>().join(" ")
    }

    /// The problem with the change.
    ///
    /// # Errors
    /// None in practice: a test holds the files to the checks.
    pub fn problem(&self) -> Result<Problem, ValidationError> {
        let path = format!("{FOLDER}/{}.toml", self.name);
        Ok(problem::parse_beside_builtin(&path, self.text)?.problem)
    }
}

/// A figure that a hypothesis may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// An entry of the residualised A or B: row and column.
    Entry(&'static str, &'static str),
    /// Half the sum of two entries.
    HalfSum([(&'static str, &'static str); 2]),
    /// Half the difference of two entries, the first less the second.
    HalfDifference([(&'static str, &'static str); 2]),
    /// Mean thrust of a rotor, lbf.
    Thrust(usize),
    /// Mean power of a rotor, hp.
    Power(usize),
    /// Mean total inflow λ_0 of a rotor.
    Inflow(usize),
    /// Pitch attitude of the trim, deg.
    PitchAttitude,
}

impl Figure {
    /// Name for a table, with its unit where it is not that of the matrices.
    #[must_use]
    pub fn label(self) -> String {
        let rotor = |k: usize| if k == 0 { "upper" } else { "lower" };
        match self {
            Figure::Entry(row, column) => format!("({row}, {column})"),
            Figure::HalfSum([a, b]) => format!("½ (({}, {}) + ({}, {}))", a.0, a.1, b.0, b.1),
            Figure::HalfDifference([a, b]) => {
                format!("½ (({}, {}) − ({}, {}))", a.0, a.1, b.0, b.1)
            }
            Figure::Thrust(k) => format!("T {} (lbf)", rotor(k)),
            Figure::Power(k) => format!("P {} (hp)", rotor(k)),
            Figure::Inflow(k) => format!("λ0 {}", rotor(k)),
            Figure::PitchAttitude => "θ (deg)".into(),
        }
    }

    /// The printed value; rotors are printed in hover only.
    fn printed(self, condition: Condition) -> Result<f64, LinearError> {
        let hover = |k: usize| (condition == Condition::Hover).then_some(()).and(HOVER_ON.get(k));
        Ok(match self {
            Figure::Entry(row, column) => entry(&appendix(condition)?, row, column)?,
            Figure::HalfSum(pair) => half(&appendix(condition)?, pair, 1.0)?,
            Figure::HalfDifference(pair) => half(&appendix(condition)?, pair, -1.0)?,
            Figure::Thrust(k) => hover(k).map_or(f64::NAN, |r| r.thrust / POUND_FORCE),
            Figure::Power(k) => hover(k).map_or(f64::NAN, |r| r.power / HORSEPOWER),
            Figure::Inflow(k) => hover(k).map_or(f64::NAN, |r| r.inflow),
            Figure::PitchAttitude => {
                // A(w, θ) = −g sin θ₀ and A(u, θ) = −g cos θ₀.
                let paper = appendix(condition)?;
                let (w, u) = (entry(&paper, "w", "theta")?, entry(&paper, "u", "theta")?);
                -w.atan2(u.abs()).to_degrees()
            }
        })
    }

    /// Ours.
    fn ours(self, point: &TrimPoint, model: &StateSpace) -> Result<f64, LinearError> {
        let rotor = |k: usize| point.rotors.get(k);
        Ok(match self {
            Figure::Entry(row, column) => entry(model, row, column)?,
            Figure::HalfSum(pair) => half(model, pair, 1.0)?,
            Figure::HalfDifference(pair) => half(model, pair, -1.0)?,
            Figure::Thrust(k) => rotor(k).map_or(f64::NAN, |r| r.thrust / POUND_FORCE),
            Figure::Power(k) => rotor(k).map_or(f64::NAN, |r| r.power / HORSEPOWER),
            Figure::Inflow(k) => rotor(k).map_or(f64::NAN, |r| r.inflow[0]),
            Figure::PitchAttitude => point.mean_state[Layout::BODY.pitch].to_degrees(),
        })
    }
}

/// An entry of A or B in the printed units.
fn entry(model: &StateSpace, row: &str, column: &str) -> Result<f64, LinearError> {
    let matrices = model.matrices_in(System::Us);
    let i = model.state(row)?;
    Ok(match model.state(column) {
        Ok(j) => matrices.a[(i, j)],
        Err(_) => matrices.b[(i, model.input(column)?)],
    })
}

/// Half of the first entry and, with its sign, of the second.
fn half(
    model: &StateSpace,
    [first, second]: [(&str, &str); 2],
    sign: f64,
) -> Result<f64, LinearError> {
    Ok(0.5 * (entry(model, first.0, first.1)? + sign * entry(model, second.0, second.1)?))
}

/// Hypotheses about the same misfits, and the figures to watch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Study {
    /// Name, by which a text refers to it.
    pub name: &'static str,
    /// Flight condition of the Appendix.
    pub condition: Condition,
    /// What is watched.
    pub figures: &'static [Figure],
    /// Names of the hypotheses.
    pub hypotheses: &'static [&'static str],
}

/// Every study of the validation page.
pub const STUDIES: [Study; 6] = {
    use Figure::{Entry, HalfDifference, HalfSum, Inflow, PitchAttitude, Power, Thrust};
    [
        Study {
            name: "hover",
            condition: Condition::Hover,
            figures: &[
                Thrust(0),
                Thrust(1),
                Power(0),
                Inflow(0),
                Inflow(1),
                PitchAttitude,
                Entry("w", "w"),
                Entry("w", "col"),
                Entry("q", "lon"),
                Entry("q", "col"),
            ],
            hypotheses: &[
                "circles-9",
                "circles-21",
                "converged-rule",
                "total-mass-flow",
                "no-root-cutout",
                "linear-section",
                "torque-tilt",
                "printed-hubs",
            ],
        },
        Study {
            name: "rates",
            condition: Condition::Hover,
            figures: &[
                Entry("u", "p"),
                Entry("u", "q"),
                Entry("v", "p"),
                Entry("v", "q"),
                Entry("p", "p"),
                Entry("p", "q"),
                Entry("q", "p"),
                Entry("q", "q"),
            ],
            hypotheses: &[
                "changed-sign",
                "circles-9",
                "circles-21",
                "skews-19",
                "converged-rule",
                HARMONICS,
                "no-root-cutout",
                "linear-section",
                "torque-tilt",
                "exact-teeter",
                "total-mass-flow",
                "no-i-xz",
            ],
        },
        // What two axes share, and what tells them apart.
        Study {
            name: "symmetry",
            condition: Condition::Hover,
            figures: &[
                HalfDifference([("u", "q"), ("v", "p")]),
                HalfSum([("u", "q"), ("v", "p")]),
                HalfSum([("u", "p"), ("v", "q")]),
                HalfDifference([("u", "p"), ("v", "q")]),
                HalfDifference([("u", "v"), ("v", "u")]),
                HalfSum([("u", "v"), ("v", "u")]),
            ],
            hypotheses: &["changed-sign", "circles-21", "skews-19", "converged-rule", HARMONICS],
        },
        Study {
            name: "speed",
            condition: Condition::Hover,
            figures: &[
                Entry("u", "u"),
                Entry("v", "v"),
                Entry("u", "v"),
                Entry("v", "u"),
                Entry("p", "v"),
                Entry("q", "u"),
            ],
            hypotheses: &[
                "linear-section",
                "no-blade-drag",
                "no-root-cutout",
                "changed-sign",
                "skews-19",
                "converged-rule",
                HARMONICS,
                "total-mass-flow",
                "torque-tilt",
                "printed-hubs",
            ],
        },
        Study {
            name: "yaw",
            condition: Condition::Hover,
            figures: &[
                Entry("u", "r"),
                Entry("v", "r"),
                Entry("p", "r"),
                Entry("r", "r"),
                Entry("r", "p"),
                Entry("r", "q"),
                Entry("r", "lat"),
                Entry("r", "ped"),
                Entry("p", "ped"),
                Entry("q", "lat"),
            ],
            hypotheses: &[
                "exact-teeter",
                "printed-inertia",
                "no-i-xz",
                "torque-tilt",
                "printed-hubs",
                "no-root-cutout",
                "linear-section",
                "no-blade-drag",
            ],
        },
        Study {
            name: "forward",
            condition: Condition::Forward,
            figures: &[
                PitchAttitude,
                Entry("u", "u"),
                Entry("u", "w"),
                Entry("u", "q"),
                Entry("u", "lon"),
                Entry("u", "col"),
                Entry("w", "u"),
                Entry("w", "w"),
                Entry("q", "w"),
                Entry("q", "lon"),
                Entry("q", "col"),
                Entry("r", "r"),
                Entry("r", "v"),
            ],
            hypotheses: &[
                "printed-drag-areas",
                "no-tail-wash",
                "no-tail-wash-drag",
                "linear-section",
                "no-root-cutout",
                "printed-hubs",
                "torque-tilt",
                "printed-inertia",
                "printed-fin",
            ],
        },
    ]
};

/// The figures of a hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Name of the hypothesis, or [`BASE`].
    pub name: &'static str,
    /// What is changed.
    pub change: String,
    /// The study's figures.
    pub values: Vec<f64>,
    /// Large printed entries of A and B within [`entries::AGREEMENT`], and how
    /// many there are.
    pub agreeing: (usize, usize),
}

/// The figures of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// What print has.
    pub printed: Vec<f64>,
    /// [`BASE`] first, then the hypotheses.
    pub trials: Vec<Trial>,
}

impl Study {
    /// Tries every hypothesis.
    ///
    /// # Errors
    /// A changed aircraft that cannot be trimmed or linearised.
    pub fn run(&self) -> Result<Findings, ValidationError> {
        let printed = self
            .figures
            .iter()
            .map(|figure| figure.printed(self.condition))
            .collect::<Result<_, _>>()?;
        let names: Vec<&'static str> =
            std::iter::once(BASE).chain(self.hypotheses.iter().copied()).collect();
        let trials =
            names.into_par_iter().map(|name| self.attempt(name)).collect::<Result<_, _>>()?;
        Ok(Findings { printed, trials })
    }

    fn attempt(&self, name: &'static str) -> Result<Trial, ValidationError> {
        let hypothesis = Hypothesis::named(name);
        let problem = match hypothesis {
            Some(hypothesis) => hypothesis.problem()?,
            None => problem::builtin_named(BASE)?.problem,
        };
        let flight = LevelFlight::of(&problem, self.condition.implied_speed_kt(), true)?;
        let (change, model) = match hypothesis {
            Some(hypothesis) => (hypothesis.change(), flight.reduced),
            None if name == HARMONICS => (
                "States that go twice a revolution are residualised too, not left out.".into(),
                with_harmonics(&flight)?,
            ),
            None => ("Nothing.".into(), flight.reduced),
        };
        let values = self
            .figures
            .iter()
            .map(|figure| figure.ours(&flight.point, &model))
            .collect::<Result<_, _>>()?;
        let Entries { large, .. } = judged_entries(&model, self.condition)?;
        let agreeing = large.iter().filter(|entry| entries::agrees(entry)).count();
        Ok(Trial { name, change, values, agreeing: (agreeing, large.len()) })
    }
}

/// The residualised model of the mean and the first harmonic of the period.
fn with_harmonics(flight: &LevelFlight) -> Result<StateSpace, LinearError> {
    Ok(residualise(&mean_and_harmonics(&flight.periodic, 1)?, &RIGID_BODY)?.model)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_hypothesis_is_a_sound_file_that_says_what_it_changes() {
        for hypothesis in HYPOTHESES {
            assert!(hypothesis.change().ends_with('.'), "{}", hypothesis.name);
            let problem = hypothesis.problem().unwrap();
            assert_eq!(problem.name, hypothesis.name);
            assert!(
                hypothesis.text.contains("extends = \"../../../../problems/coax2d-appendix.toml\"")
            );
        }
    }

    #[test]
    fn every_hypothesis_is_tried_and_every_study_names_known_ones() {
        let tried: Vec<&str> =
            STUDIES.iter().flat_map(|study| study.hypotheses.iter().copied()).collect();
        for hypothesis in HYPOTHESES {
            assert!(tried.contains(&hypothesis.name), "{} is not tried", hypothesis.name);
        }
        for name in tried {
            assert!(name == HARMONICS || Hypothesis::named(name).is_some(), "{name}");
        }
    }

    #[test]
    fn val_printed_attitudes() {
        // The hover's is 0.0003 rad; that of the forward matrices −3.74 deg.
        let hover = Figure::PitchAttitude.printed(Condition::Hover).unwrap();
        assert!((hover - 0.0003_f64.to_degrees()).abs() < 0.003, "{hover}");
        let forward = Figure::PitchAttitude.printed(Condition::Forward).unwrap();
        assert!((forward + 3.74).abs() < 0.01, "{forward}");
    }
}
