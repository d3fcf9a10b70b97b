//! The gain schedule: what a tuning leaves behind, and what flies.
//!
//! `schedule.json` (schema `coaxdesign.schedule/1`) holds everything that the
//! control law needs, with units, interpolation and end rules, and where it
//! came from. SI units and radians; sticks in percent.

mod check;
pub mod sample;

pub use check::{Finding, Findings};

use crate::control::axis::{Channel, ChannelGains, GainSet};
use crate::control::law::{LawError, LawPoint, LawTable};
use crate::control::loops::LawSettings;
use crate::control::plant::{Hardware, Inversion, ReferenceModel, TrimPoint};
use crate::control::spec::TurnCoordination;
use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Schema of the schedule file.
pub const SCHEMA: &str = "coaxdesign.schedule/1";

/// A gain schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// [`SCHEMA`].
    pub schema: String,
    /// Name of the aircraft.
    pub name: String,
    /// Whether every requirement was met; if not, this is the least-violating
    /// design that was found.
    pub requirements_met: bool,
    /// Where it came from.
    pub provenance: Provenance,
    /// How to read the table between and beyond its breakpoints.
    pub interpolation: String,
    /// Unit of every quantity.
    pub units: BTreeMap<String, String>,
    /// The law's choices.
    pub law: LawSettings,
    /// Middle of the turn-coordination blend, m/s.
    pub turn_coordination_speed: f64,
    /// Width of the blend, m/s.
    pub turn_coordination_width: f64,
    /// Hardware it was tuned for.
    pub hardware: Hardware,
    /// Limits of lat, lon, col, ped, %.
    pub stick_limits: [[f64; 2]; 4],
    /// Breakpoints, speeds strictly increasing.
    pub points: Vec<Point>,
}

/// Where a schedule came from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Program and version.
    pub generator: String,
    /// FNV-1a hash of the problem's texts, hexadecimal.
    pub problem_hash: String,
    /// FNV-1a hash of the specification's text, hexadecimal.
    pub specification_hash: String,
}

/// The law at one breakpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Gains by channel; a channel that is open is left out.
    pub gains: BTreeMap<String, ChannelGains>,
    /// The trim.
    pub trim: TrimPoint,
    /// Matrices, by rows.
    pub matrices: Matrices,
}

/// Matrices of the law at a breakpoint, each as a list of rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Matrices {
    /// C, 4 × 8: φ, θ, r, V_z from u v w p q r φ θ.
    pub outputs: Vec<Vec<f64>>,
    /// C A, 4 × 8.
    pub output_rates: Vec<Vec<f64>>,
    /// F, 4 × 8.
    pub feedback: Vec<Vec<f64>>,
    /// B_d⁻¹, 4 × 4.
    pub decoupling: Vec<Vec<f64>>,
    /// M, 4 × 4: what feedback goes through.
    pub allocation: Vec<Vec<f64>>,
    /// Ground velocity in heading axes, 2 × 8.
    pub ground_velocity: Vec<Vec<f64>>,
    /// Reference model: x_ref from its states, 8 × 2.
    pub reference_state: Vec<Vec<f64>>,
    /// x_ref from φ, θ, φ', θ', r, V_z, 8 × 6.
    pub reference_input: Vec<Vec<f64>>,
    /// Rate of its states from x_ref, 2 × 8.
    pub reference_dynamics: Vec<Vec<f64>>,
    /// Rate of its states from ν, 2 × 4.
    pub reference_drive: Vec<Vec<f64>>,
}

/// Why a schedule cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ScheduleError {
    /// Not JSON of this form.
    #[error("not a schedule: {0}")]
    Format(#[from] serde_json::Error),
    /// Another schema.
    #[error("the schema is '{found}', expected '{SCHEMA}'")]
    Schema {
        /// What the file says.
        found: String,
    },
    /// A matrix of another size.
    #[error("matrix {matrix} at {speed:.3} m/s is not {rows} x {columns}")]
    Size {
        /// Which.
        matrix: &'static str,
        /// Speed, m/s.
        speed: f64,
        /// Rows expected.
        rows: usize,
        /// Columns expected.
        columns: usize,
    },
    /// A channel that does not exist.
    #[error("there is no channel '{0}'")]
    Channel(String),
    /// Values that no schedule can hold.
    #[error(transparent)]
    Findings(Findings),
    /// The table itself.
    #[error(transparent)]
    Law(#[from] LawError),
}

fn rows<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> Vec<Vec<f64>> {
    m.row_iter().map(|r| r.iter().copied().collect()).collect()
}

fn matrix<const R: usize, const C: usize>(
    name: &'static str,
    speed: f64,
    list: &[Vec<f64>],
) -> Result<SMatrix<f64, R, C>, ScheduleError> {
    if list.len() != R || list.iter().any(|r| r.len() != C) {
        return Err(ScheduleError::Size { matrix: name, speed, rows: R, columns: C });
    }
    Ok(SMatrix::from_fn(|i, j| list[i][j]))
}

impl Schedule {
    /// A schedule of a law.
    pub fn new(
        name: &str,
        table: &LawTable,
        hardware: Hardware,
        stick_limits: [[f64; 2]; 4],
        requirements_met: bool,
        provenance: Provenance,
    ) -> Self {
        let points = table
            .points()
            .iter()
            .map(|p| {
                let i = &p.inversion;
                Point {
                    speed: p.speed,
                    gains: Channel::ALL
                        .into_iter()
                        .filter(|c| p.gains[c.index()] != ChannelGains::default())
                        .map(|c| (c.name().to_string(), p.gains[c.index()]))
                        .collect(),
                    trim: i.trim,
                    matrices: Matrices {
                        outputs: rows(&i.outputs),
                        output_rates: rows(&i.rates),
                        feedback: rows(&i.feedback),
                        decoupling: rows(&i.decoupling),
                        allocation: rows(&i.allocation),
                        ground_velocity: rows(&i.ground_velocity),
                        reference_state: rows(&i.reference.state),
                        reference_input: rows(&i.reference.input),
                        reference_dynamics: rows(&i.reference.dynamics),
                        reference_drive: rows(&i.reference.drive),
                    },
                }
            })
            .collect();
        Self {
            schema: SCHEMA.into(),
            name: name.into(),
            requirements_met,
            provenance,
            interpolation: INTERPOLATION.into(),
            units: units(),
            law: table.settings,
            turn_coordination_speed: table.turn.speed,
            turn_coordination_width: table.turn.width,
            hardware,
            stick_limits,
            points,
        }
    }

    /// The law of the schedule.
    ///
    /// # Errors
    /// Matrices of another size, unknown channels, speeds out of order.
    pub fn law(&self) -> Result<LawTable, ScheduleError> {
        let mut points = Vec::with_capacity(self.points.len());
        for p in &self.points {
            let mut gains = GainSet::default();
            for (name, g) in &p.gains {
                let channel = Channel::ALL
                    .into_iter()
                    .find(|c| c.name() == name)
                    .ok_or_else(|| ScheduleError::Channel(name.clone()))?;
                gains[channel.index()] = *g;
            }
            let (m, v) = (&p.matrices, p.speed);
            points.push(LawPoint {
                speed: v,
                gains,
                inversion: Inversion {
                    outputs: matrix("outputs", v, &m.outputs)?,
                    rates: matrix("output_rates", v, &m.output_rates)?,
                    feedback: matrix("feedback", v, &m.feedback)?,
                    decoupling: matrix("decoupling", v, &m.decoupling)?,
                    allocation: matrix("allocation", v, &m.allocation)?,
                    ground_velocity: matrix("ground_velocity", v, &m.ground_velocity)?,
                    reference: ReferenceModel {
                        state: matrix("reference_state", v, &m.reference_state)?,
                        input: matrix("reference_input", v, &m.reference_input)?,
                        dynamics: matrix("reference_dynamics", v, &m.reference_dynamics)?,
                        drive: matrix("reference_drive", v, &m.reference_drive)?,
                    },
                    trim: p.trim,
                },
            });
        }
        let turn = TurnCoordination {
            speed: self.turn_coordination_speed,
            width: self.turn_coordination_width,
        };
        Ok(LawTable::new(points, self.law, turn)?)
    }

    /// Whether every value is one that a schedule can hold.
    ///
    /// # Errors
    /// Everything that is not, with its place.
    pub fn check(&self) -> Result<(), Findings> {
        let findings = check::check(self);
        if findings.is_empty() { Ok(()) } else { Err(Findings(findings)) }
    }

    /// The schedule as JSON text.
    ///
    /// # Errors
    /// Values that no schedule can hold: see [`Schedule::check`].
    pub fn to_json(&self) -> Result<String, ScheduleError> {
        self.check().map_err(ScheduleError::Findings)?;
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Reads a schedule and checks it.
    ///
    /// # Errors
    /// Text that is no schedule, another schema, values that no schedule can
    /// hold (all of them, each with its line), or a table that is no law.
    pub fn from_json(text: &str) -> Result<Self, ScheduleError> {
        #[derive(Deserialize)]
        struct Head {
            schema: String,
        }
        let head: Head = serde_json::from_str(text)?;
        if head.schema != SCHEMA {
            return Err(ScheduleError::Schema { found: head.schema });
        }
        let schedule: Self = serde_json::from_str(text)?;
        schedule.check().map_err(|mut findings| {
            for finding in &mut findings.0 {
                finding.line = check::line_of(text, &finding.pointer);
            }
            ScheduleError::Findings(findings)
        })?;
        schedule.law()?;
        Ok(schedule)
    }
}

/// How to read the table.
pub const INTERPOLATION: &str = "linear in true airspeed between breakpoints, element by element; \
                                 constant beyond the first and the last";

/// Units of the quantities in a schedule, as the file states them.
pub fn units() -> BTreeMap<String, String> {
    UNITS.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect()
}

/// Units of the quantities in a schedule.
const UNITS: [(&str, &str); 10] = [
    ("speed", "m/s, true airspeed"),
    ("x", "u v w in m/s, p q r in rad/s, phi theta in rad; deviations from trim"),
    ("sticks", "lat lon col ped in %"),
    ("roll, pitch gains", "k_d 1/s, k_p 1/s^2, k_i 1/s^3"),
    ("yaw, heave, vx, vy gains", "k_p 1/s, k_i 1/s^2"),
    ("nu", "phi'' theta'' r' in rad/s^2, V_z' in m/s^2, V_z positive down"),
    ("decoupling", "% per unit of commanded nu"),
    ("allocation", "% per unit of the nu that feedback asks for"),
    ("frequencies", "rad/s"),
    ("delays, time constants", "s"),
];

/// FNV-1a hash of texts, as sixteen hexadecimal digits.
pub fn hash<'a>(texts: impl IntoIterator<Item = &'a str>) -> String {
    let mut h: u64 = 0xcbf2_9ce4_8422_2325;
    for text in texts {
        for byte in text.bytes().chain([0]) {
            h = (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    format!("{h:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::testbed;

    pub(super) fn schedule() -> Schedule {
        let points = [0.0, 20.0]
            .map(|speed| {
                let mut gains = GainSet::default();
                gains[0] = ChannelGains::new(2.0, 2.2, 0.22);
                let plant = testbed::plant(speed, &testbed::NOMINAL);
                LawPoint { speed, gains, inversion: Inversion::new(&plant).unwrap() }
            })
            .to_vec();
        let spec = crate::control::spec::builtin().unwrap();
        let table = LawTable::new(points, spec.law, spec.turn).unwrap();
        let provenance = Provenance {
            generator: "test".into(),
            problem_hash: hash(["a"]),
            specification_hash: hash(["b"]),
        };
        Schedule::new("x", &table, spec.hardware, [[-100.0, 100.0]; 4], true, provenance)
    }

    /// Writing and reading gives the same law to the last bit.
    #[test]
    fn round_trip_is_exact() {
        let s = schedule();
        let text = s.to_json().unwrap();
        let back = Schedule::from_json(&text).unwrap();
        assert_eq!(s, back);
        assert_eq!(s.law().unwrap(), back.law().unwrap());
        assert_eq!(text, back.to_json().unwrap());
    }

    #[test]
    fn bad_files_are_refused() {
        let s = schedule();
        let mut other = s.clone();
        other.points.reverse();
        assert!(matches!(other.to_json(), Err(ScheduleError::Findings(_))));
        assert!(matches!(other.law(), Err(ScheduleError::Law(LawError::Order(_)))));
        let mut other = s.clone();
        other.points[0].matrices.decoupling.pop();
        let text = other.to_json().unwrap();
        assert!(matches!(Schedule::from_json(&text), Err(ScheduleError::Size { .. })));
        let mut other = s;
        other.schema = "coaxdesign.schedule/9".into();
        let text = other.to_json().unwrap();
        assert!(matches!(Schedule::from_json(&text), Err(ScheduleError::Schema { .. })));
        assert!(Schedule::from_json("{}").is_err());
    }

    /// Test vector of the published FNV-1a definition: the hash of "a" without
    /// the separator is af63dc4c8601ec8c; ours closes each text with a zero.
    #[test]
    fn val_hash_separates_texts() {
        assert_ne!(hash(["ab", "c"]), hash(["a", "bc"]));
        assert_eq!(hash(["a"]), hash(["a"]));
    }
}
