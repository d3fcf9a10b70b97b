//! The law as plain tables, for every format.
//!
//! A [`Description`] says all that another program needs: breakpoints, tables
//! over them with the name and unit of every row and column, constants, and
//! the rules to read and run them. It is complete: a schedule can be made of
//! it again, bit for bit. Formats write it; they compute nothing.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::control::axis::{Channel, ChannelGains};
use crate::control::law::{
    ACCELERATION_LIMIT, ATTITUDE_LIMIT, FORGETTING, OUTER_SLOWNESS, OffTrim, PEDAL_POWER_RANGE,
    SCHEDULE_LEAD, SLOW, YAW_LEAD,
};
use crate::control::loops::LawSettings;
use crate::control::plant::{Hardware, TrimPoint};
use crate::law::mdi::{Notch, Notches};
use crate::law::tables::{Label, STICKS};
use crate::problem::visible;
use crate::schedule::{self, Matrices, Point, Provenance, Schedule, ScheduleError};
use crate::units::STANDARD_GRAVITY;

pub use crate::law::tables::{FORMS, Form};

/// Schema of a description.
pub const SCHEMA: &str = "coaxdesign.law/1";

/// The law over speed, ready to be written in any form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// [`SCHEMA`].
    pub schema: String,
    /// Name of the aircraft.
    pub name: String,
    /// Whether every requirement was met when it was tuned.
    pub requirements_met: bool,
    /// What whoever flies it must know: empty for a sound schedule.
    pub warnings: Vec<String>,
    /// Where it came from.
    pub provenance: Provenance,
    /// How to read and run it, by topic.
    pub rules: BTreeMap<String, String>,
    /// Breakpoints.
    pub speed: Speed,
    /// Numbers that do not depend on speed.
    pub constants: Vec<Constant>,
    /// Numbers that do.
    pub tables: Vec<Table>,
}

/// Breakpoints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speed {
    /// m/s.
    pub unit: String,
    /// Which speed.
    pub meaning: String,
    /// True airspeeds, strictly increasing.
    pub values: Vec<f64>,
}

/// A number that does not depend on speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constant {
    /// Name.
    pub name: String,
    /// Unit; `1` for none.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// What it is.
    pub meaning: String,
}

/// A matrix at every breakpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Name.
    pub name: String,
    /// What it is.
    pub meaning: String,
    /// Whether the discrete-time law needs it; the others serve analysis.
    pub needed_by_law: bool,
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Unit of every entry, by rows.
    pub units: Vec<Vec<String>>,
    /// `values[breakpoint][row][column]`.
    pub values: Vec<Vec<Vec<f64>>>,
}

/// A table of this form with these values, `values[breakpoint][row][column]`.
pub(super) fn table_of(form: &Form, values: Vec<Vec<Vec<f64>>>) -> Table {
    let names = |list: &[Label]| list.iter().map(|l| l.0.to_string()).collect();
    let (rows, columns) = form.size();
    Table {
        name: form.name.into(),
        meaning: form.meaning().into(),
        needed_by_law: form.needed_by_law,
        rows: names(form.rows),
        columns: names(form.columns),
        units: (0..rows).map(|i| (0..columns).map(|j| form.unit(i, j)).collect()).collect(),
        values,
    }
}

/// Names, units and meanings of the constants, in the order of files.
const CONSTANTS: [(&str, &str, &str); 35] = [
    ("kappa", "1", "share of the velocity terms of F that feedback cancels"),
    ("hybrid_feedforward", "1", "1 if the rest of them is fed forward from the reference model"),
    ("reference_delay", "s", "delay of the references in the error path"),
    ("roll_frequency", "rad/s", "natural frequency of the roll command model"),
    ("pitch_frequency", "rad/s", "natural frequency of the pitch command model"),
    ("attitude_damping", "1", "damping ratio of both attitude command models"),
    ("yaw_time_constant", "s", "time constant of the yaw rate command model"),
    ("heave_time_constant", "s", "time constant of the vertical velocity command model"),
    ("turn_coordination_speed", "m/s", "middle of the turn-coordination blend"),
    ("turn_coordination_width", "m/s", "full width of the blend"),
    ("gravity", "m/s^2", "standard gravity"),
    ("attitude_limit", "rad", "largest attitude change that a velocity loop commands"),
    ("outer_slowness", "1", "time constant of a velocity reference times the attitude's frequency"),
    ("acceleration_limit", "m/s^2", "largest horizontal acceleration of a velocity reference"),
    ("schedule_lead", "m/s", "farthest that the speed of the schedule lies from the speed flown"),
    ("forgetting", "s", "time constant of the lateral velocity integral under turn coordination"),
    ("yaw_lead", "1", "the yaw command is led in full at the blend's middle over this"),
    ("slow", "m/s", "forward speed of the trim below which rolling asks for no yaw"),
    (
        "pedal_yaw_growth",
        "rad/s^2 per %^2",
        "growth of the pedals' power over yaw with collective, from the tables",
    ),
    (
        "collective_pitch_growth",
        "1/m^2 per %",
        "growth of the collective's power over pitch with u w, from the tables",
    ),
    (
        "pedal_pitch_growth",
        "1/m^2 per %",
        "growth of the pedals' power over pitch with u w, from the tables",
    ),
    ("pedal_power_min", "1", "least power of the pedals that is reckoned with, over the trim's"),
    ("pedal_power_max", "1", "largest power of the pedals that is reckoned with"),
    ("stick_lat_min", "%", "lower limit of the lateral stick"),
    ("stick_lat_max", "%", "upper limit of the lateral stick"),
    ("stick_lon_min", "%", "lower limit of the longitudinal stick"),
    ("stick_lon_max", "%", "upper limit of the longitudinal stick"),
    ("stick_col_min", "%", "lower limit of the collective"),
    ("stick_col_max", "%", "upper limit of the collective"),
    ("stick_ped_min", "%", "lower limit of the pedals"),
    ("stick_ped_max", "%", "upper limit of the pedals"),
    ("actuator_bandwidth", "rad/s", "hardware it was tuned for: actuators"),
    ("actuator_damping", "1", "hardware it was tuned for: damping ratio of the actuators"),
    ("delay", "s", "hardware it was tuned for: transport delay"),
    ("sensor_bandwidth", "rad/s", "hardware it was tuned for: sensor filters"),
];

/// Names, units and meanings of the constants of notch filters: a law has those
/// of the axes that have one.
const NOTCHES: [(&str, &str, &str); 12] = [
    ("notch_roll_frequency", "rad/s", "frequency that the notch in roll takes out"),
    ("notch_roll_damping", "1", "damping ratio of the notch in roll"),
    ("notch_roll_depth", "1", "factor with which its frequency passes"),
    ("notch_pitch_frequency", "rad/s", "frequency that the notch in pitch takes out"),
    ("notch_pitch_damping", "1", "damping ratio of the notch in pitch"),
    ("notch_pitch_depth", "1", "factor with which its frequency passes"),
    ("notch_yaw_frequency", "rad/s", "frequency that the notch in yaw takes out"),
    ("notch_yaw_damping", "1", "damping ratio of the notch in yaw"),
    ("notch_yaw_depth", "1", "factor with which its frequency passes"),
    ("notch_heave_frequency", "rad/s", "frequency that the notch in heave takes out"),
    ("notch_heave_damping", "1", "damping ratio of the notch in heave"),
    ("notch_heave_depth", "1", "factor with which its frequency passes"),
];

/// The constants of notch filters without their values.
pub(super) fn notch_forms() -> impl Iterator<Item = Constant> {
    NOTCHES.iter().map(|&(name, unit, meaning)| Constant {
        name: name.into(),
        unit: unit.into(),
        value: 0.0,
        meaning: meaning.into(),
    })
}

/// Value of a constant of a notch filter; `None` where the axis has none.
fn notch_constant(notches: &Notches, name: &str) -> Option<f64> {
    let axes = [notches.roll, notches.pitch, notches.yaw, notches.heave];
    let k = NOTCHES.iter().position(|n| n.0 == name)?;
    let notch = axes[k / 3]?;
    Some([notch.frequency, notch.damping, notch.depth][k % 3])
}

/// Names of the constants.
pub(super) fn constant_names() -> impl Iterator<Item = &'static str> {
    CONSTANTS.iter().chain(&NOTCHES).map(|c| c.0)
}

/// Unit of a constant, if there is one of this name.
pub(super) fn constant_unit(name: &str) -> Option<&'static str> {
    CONSTANTS.iter().chain(&NOTCHES).find(|c| c.0 == name).map(|c| c.1)
}

/// The constants without their values.
pub(super) fn constant_forms() -> impl Iterator<Item = Constant> {
    CONSTANTS.iter().map(|&(name, unit, meaning)| Constant {
        name: name.into(),
        unit: unit.into(),
        value: 0.0,
        meaning: meaning.into(),
    })
}

/// Constants that have a value of their own in every law and are only
/// repeated for other programs.
pub const FIXED: [(&str, f64); 10] = [
    ("gravity", STANDARD_GRAVITY),
    ("attitude_limit", ATTITUDE_LIMIT),
    ("outer_slowness", OUTER_SLOWNESS),
    ("acceleration_limit", ACCELERATION_LIMIT),
    ("schedule_lead", SCHEDULE_LEAD),
    ("forgetting", FORGETTING),
    ("yaw_lead", YAW_LEAD),
    ("slow", SLOW),
    ("pedal_power_min", PEDAL_POWER_RANGE[0]),
    ("pedal_power_max", PEDAL_POWER_RANGE[1]),
];

/// Constants that follow from the tables. Programs that run the law need
/// them; a schedule made of a description reckons them anew.
pub const DERIVED: [&str; 3] =
    ["pedal_yaw_growth", "collective_pitch_growth", "pedal_pitch_growth"];

/// How to read and run the tables.
const RULES: [(&str, &str); 12] = [
    (
        "interpolation",
        "element by element, linear in true airspeed: (1 - t) a + t b with \
         t = (V - V_a) / (V_b - V_a)",
    ),
    ("ends", "constant below the first and above the last breakpoint"),
    (
        "turn_coordination",
        "phi_c becomes (1 - b) phi_c + b (phi_trim + atan(V heading_rate / gravity)), with \
         b = t^2 (3 - 2 t), t = (V - turn_coordination_speed) / turn_coordination_width + 1/2 \
         held to 0..1",
    ),
    (
        "signs",
        "body axes forward, right, down; phi right side down, theta nose up, r nose right, V_z \
         down; sticks in the sense of the aircraft's own control mixing",
    ),
    (
        "inversion",
        "sticks = trim_sticks + decoupling (nu_c - F x_ref) + allocation (nu_e - F_k (x - x_ref)); \
         x is the deviation of u v w p q r phi theta from the trim, F_k is F with its first three \
         columns times kappa; without hybrid_feedforward x_ref is zero here",
    ),
    (
        "nu",
        "nu_c = reference'' (phi, theta), reference' (r, V_z); nu_e = k_d (reference'(t - \
         reference_delay) - measured') + k_p e + k_i int(e), e = reference(t - reference_delay) - \
         measured",
    ),
    (
        "notch",
        "an axis with notch_AXIS_frequency w, notch_AXIS_damping z and notch_AXIS_depth d has what \
         feedback asks of it, nu_e - F_k (x - x_ref), filtered by (s^2 + 2 z d w s + w^2) / (s^2 + \
         2 z w s + w^2)",
    ),
    (
        "velocity_loops",
        "theta_c = theta_trim - a_x / G_theta - (k_p e_x + k_i int(e_x)) / gravity, phi_c = \
         phi_trim + a_y / G_phi + (k_p e_y + k_i int(e_y)) / gravity + atan(v_x heading_rate / \
         gravity), each change held to +-attitude_limit; a is the rate of a first-order lag of the \
         command with time constant outer_slowness over the attitude's frequency, held to \
         +-acceleration_limit; v_x is that lag; e is that lag through the attitude command model, \
         reference_delay late, less the velocity flown in heading axes; G_theta and G_phi are -(0, \
         theta) and (1, phi) of ground_velocity reference_state reference_dynamics reference_input, \
         gravity where not above half of it",
    ),
    (
        "off_trim",
        "pedals, as a change from trim_sticks, are divided by 1 + pedal_yaw_growth times \
         decoupling(ped, r) times the change of collective from trim_sticks, held to \
         pedal_power_min..pedal_power_max; with hybrid_feedforward, decoupling's column theta \
         times L (collective_pitch_growth c / 2 + pedal_pitch_growth d) is taken from the sticks, \
         L being u w of the references less that of the trim, c and d the collective and the \
         pedals of decoupling (nu_c - F x_ref), d divided as above at c",
    ),
    (
        "yaw",
        "the yaw rate's command is the heading rate, led through the roll command model as the \
         airspeed nears turn_coordination_speed / yaw_lead, in body axes, and b w_trim / u_trim \
         times the rate of bank where u_trim is above slow",
    ),
    (
        "airspeed",
        "the forward component of the true airspeed in heading axes; what it is more than the \
         ground speed forward counts as wind in x and x_ref",
    ),
    (
        "schedule",
        "tables are read at the airspeed, and under a velocity demand at the airspeed plus e_x held \
         to +-schedule_lead; never below zero",
    ),
];

/// Why a description cannot be made into a schedule, or the reverse.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// The schedule is no law.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    /// Another schema.
    #[error("the schema is '{0}', expected '{SCHEMA}'")]
    Schema(String),
    /// A constant or a table is missing.
    #[error("{0} is missing")]
    Missing(String),
    /// A constant or a table that does not exist.
    #[error("there is no {0}")]
    Unknown(String),
    /// A unit that is not the one of this quantity.
    #[error("{what} is in '{found}', expected '{wanted}'")]
    Unit {
        /// Which quantity.
        what: String,
        /// Its unit.
        found: String,
        /// The unit that it must have.
        wanted: String,
    },
    /// A table whose rows, columns or breakpoints are not as they must be.
    #[error("table {0} has other rows, columns or breakpoints than it should")]
    Size(String),
    /// A value that the law cannot use.
    #[error("{name} is {value}, but must be {must}")]
    Value {
        /// Which.
        name: String,
        /// What it is.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
}

impl Description {
    /// The description of a schedule.
    ///
    /// # Errors
    /// A schedule that is no law, or has a constant that no law can have.
    pub fn new(schedule: &Schedule, warnings: Vec<String>) -> Result<Self, DescriptionError> {
        // Sizes, order and finiteness of the tables.
        let off_trim = *schedule.law()?.off_trim();
        let tables = FORMS
            .iter()
            .map(|form| table_of(form, schedule.points.iter().map(|p| entries(p, form)).collect()))
            .collect();
        let constants = constant_forms()
            .map(|c| Constant { value: constant(schedule, &off_trim, &c.name), ..c })
            .chain(notch_forms().filter_map(|c| {
                let value = notch_constant(&schedule.law.notch, &c.name)?;
                Some(Constant { value, ..c })
            }))
            .collect();
        let description = Self {
            schema: SCHEMA.into(),
            name: schedule.name.clone(),
            requirements_met: schedule.requirements_met,
            // They may quote what a file says.
            warnings: warnings.iter().map(|text| visible(text, false)).collect(),
            provenance: schedule.provenance.clone(),
            rules: RULES.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect(),
            speed: Speed {
                unit: "m/s".into(),
                meaning: "true airspeed".into(),
                values: schedule.points.iter().map(|p| p.speed).collect(),
            },
            constants,
            tables,
        };
        description.check_constants()?;
        Ok(description)
    }

    /// The schedule that this describes.
    ///
    /// # Errors
    /// Tables or constants that are missing, unknown, of another size or in
    /// other units, or that make no law.
    pub fn schedule(&self) -> Result<Schedule, DescriptionError> {
        if self.schema != SCHEMA {
            return Err(DescriptionError::Schema(self.schema.clone()));
        }
        unit("speed", &self.speed.unit, "m/s")?;
        for c in &self.constants {
            let Some(known) = CONSTANTS.iter().chain(&NOTCHES).find(|k| k.0 == c.name) else {
                return Err(DescriptionError::Unknown(format!("constant '{}'", c.name)));
            };
            unit(&c.name, &c.unit, known.1)?;
        }
        for table in &self.tables {
            let Some(form) = FORMS.iter().find(|f| f.name == table.name) else {
                return Err(DescriptionError::Unknown(format!("table '{}'", table.name)));
            };
            let sound = table_of(form, Vec::new());
            let (rows, columns) = form.size();
            let full = table.values.len() == self.speed.values.len()
                && table
                    .values
                    .iter()
                    .all(|m| m.len() == rows && m.iter().all(|r| r.len() == columns));
            if !full || table.rows != sound.rows || table.columns != sound.columns {
                return Err(DescriptionError::Size(table.name.clone()));
            }
            for (found, wanted) in table.units.iter().flatten().zip(sound.units.iter().flatten()) {
                unit(&table.name, found, wanted)?;
            }
        }
        self.check_constants()?;
        let points =
            (0..self.speed.values.len()).map(|k| self.point(k)).collect::<Result<_, _>>()?;
        let c = |name: &str| self.constant(name);
        let limits = ["lat", "lon", "col", "ped"].map(|s| -> Result<[f64; 2], DescriptionError> {
            Ok([c(&format!("stick_{s}_min"))?, c(&format!("stick_{s}_max"))?])
        });
        let [lat, lon, col, ped] = limits;
        let law = LawSettings {
            kappa: c("kappa")?,
            hybrid_feedforward: c("hybrid_feedforward")? != 0.0,
            reference_delay: c("reference_delay")?,
            roll_frequency: c("roll_frequency")?,
            pitch_frequency: c("pitch_frequency")?,
            attitude_damping: c("attitude_damping")?,
            yaw_time_constant: c("yaw_time_constant")?,
            heave_time_constant: c("heave_time_constant")?,
            notch: Notches {
                roll: self.notch("roll")?,
                pitch: self.notch("pitch")?,
                yaw: self.notch("yaw")?,
                heave: self.notch("heave")?,
            },
        };
        let schedule = Schedule {
            schema: schedule::SCHEMA.into(),
            name: self.name.clone(),
            requirements_met: self.requirements_met,
            provenance: self.provenance.clone(),
            interpolation: schedule::INTERPOLATION.into(),
            units: schedule::units(),
            law,
            turn_coordination_speed: c("turn_coordination_speed")?,
            turn_coordination_width: c("turn_coordination_width")?,
            hardware: Hardware {
                actuator_bandwidth: c("actuator_bandwidth")?,
                actuator_damping: c("actuator_damping")?,
                delay: c("delay")?,
                sensor_bandwidth: c("sensor_bandwidth")?,
            },
            stick_limits: [lat?, lon?, col?, ped?],
            points,
        };
        schedule.law()?;
        schedule.check().map_err(ScheduleError::Findings)?;
        Ok(schedule)
    }

    /// A constant by name.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn constant(&self, name: &str) -> Result<f64, DescriptionError> {
        self.constants
            .iter()
            .find(|c| c.name == name)
            .map(|c| c.value)
            .ok_or_else(|| DescriptionError::Missing(format!("constant '{name}'")))
    }

    /// The notch filter of an axis, if it has one.
    fn notch(&self, axis: &str) -> Result<Option<Notch>, DescriptionError> {
        let prefix = format!("notch_{axis}_");
        if !self.constants.iter().any(|c| c.name.starts_with(&prefix)) {
            return Ok(None);
        }
        let c = |what: &str| self.constant(&format!("{prefix}{what}"));
        let notch =
            Notch { frequency: c("frequency")?, damping: c("damping")?, depth: c("depth")? };
        for (what, value, sound, must) in [
            ("frequency", notch.frequency, notch.frequency > 0.0, "positive"),
            ("damping", notch.damping, notch.damping > 0.0, "positive"),
            ("depth", notch.depth, (0.0..=1.0).contains(&notch.depth), "from 0 to 1"),
        ] {
            if !sound {
                return Err(DescriptionError::Value {
                    name: format!("{prefix}{what}"),
                    value,
                    must,
                });
            }
        }
        Ok(Some(notch))
    }

    /// A table by name.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn table(&self, name: &str) -> Result<&Table, DescriptionError> {
        self.tables
            .iter()
            .find(|t| t.name == name)
            .ok_or_else(|| DescriptionError::Missing(format!("table '{name}'")))
    }

    /// The tables that the law needs.
    pub fn law_tables(&self) -> impl Iterator<Item = &Table> {
        self.tables.iter().filter(|t| t.needed_by_law)
    }

    /// Name, warnings and origin, as lines for the head of a file.
    pub fn banner(&self) -> Vec<String> {
        let p = &self.provenance;
        let mut lines = vec![
            format!("Control law of {}, over true airspeed in m/s.", self.name),
            format!("Written by coaxdesign {}.", env!("CARGO_PKG_VERSION")),
            format!(
                "Schedule by {}; problem {}, specification {}.",
                p.generator, p.problem_hash, p.specification_hash
            ),
            format!("Requirements met: {}.", if self.requirements_met { "yes" } else { "no" }),
        ];
        lines.extend(self.warnings.iter().map(|w| format!("WARNING: {w}")));
        lines.extend(self.rules.iter().map(|(topic, rule)| format!("{topic}: {rule}.")));
        lines.push("Tables: name (rows; columns), what it is, units row by row:".into());
        for t in self.law_tables() {
            lines.push(format!(
                "{} ({}; {}): {}; {}",
                t.name,
                t.rows.join(" "),
                t.columns.join(" "),
                t.meaning,
                t.units
                    .iter()
                    .map(|r| {
                        let mut short: Vec<&str> = r.iter().map(String::as_str).collect();
                        short.dedup();
                        short.join(", ")
                    })
                    .collect::<Vec<_>>()
                    .join(" | "),
            ));
        }
        lines
    }

    /// Constants that the formulas divide by or that must be in order.
    fn check_constants(&self) -> Result<(), DescriptionError> {
        let bad = |name: &str, value, must| {
            Err(DescriptionError::Value { name: name.into(), value, must })
        };
        for c in &self.constants {
            if !c.value.is_finite() {
                return bad(&c.name, c.value, "finite");
            }
        }
        for name in ["turn_coordination_width", "yaw_time_constant", "heave_time_constant"] {
            let value = self.constant(name)?;
            if value <= 0.0 {
                return bad(name, value, "positive");
            }
        }
        let delay = self.constant("reference_delay")?;
        if delay < 0.0 {
            return bad("reference_delay", delay, "zero or positive");
        }
        for (name, wanted) in FIXED {
            let value = self.constant(name)?;
            if value != wanted {
                return bad(name, value, "the law's own constant");
            }
        }
        for stick in STICKS {
            let name = format!("stick_{}_max", stick.0);
            let (low, high) =
                (self.constant(&format!("stick_{}_min", stick.0))?, self.constant(&name)?);
            if low >= high {
                return bad(&name, high, "above the lower limit");
            }
        }
        Ok(())
    }

    fn point(&self, k: usize) -> Result<Point, DescriptionError> {
        let m = |name: &str| -> Result<Vec<Vec<f64>>, DescriptionError> {
            Ok(self.table(name)?.values[k].clone())
        };
        let gains = m("gains")?;
        let (velocity, attitude, sticks) =
            (m("trim_velocity")?, m("trim_attitude")?, m("trim_sticks")?);
        Ok(Point {
            speed: self.speed.values[k],
            gains: Channel::ALL
                .into_iter()
                .map(|c| {
                    let g = &gains[c.index()];
                    (c.name().to_string(), ChannelGains::new(g[0], g[1], g[2]))
                })
                .filter(|(_, g)| *g != ChannelGains::default())
                .collect(),
            trim: TrimPoint {
                velocity_body: std::array::from_fn(|i| velocity[i][0]),
                roll: attitude[0][0],
                pitch: attitude[1][0],
                sticks: std::array::from_fn(|i| sticks[i][0]),
            },
            matrices: Matrices {
                outputs: m("outputs")?,
                output_rates: m("output_rates")?,
                feedback: m("feedback")?,
                decoupling: m("decoupling")?,
                allocation: m("allocation")?,
                ground_velocity: m("ground_velocity")?,
                reference_state: m("reference_state")?,
                reference_input: m("reference_input")?,
                reference_dynamics: m("reference_dynamics")?,
                reference_drive: m("reference_drive")?,
            },
        })
    }
}

fn unit(what: &str, found: &str, wanted: &str) -> Result<(), DescriptionError> {
    if found == wanted {
        return Ok(());
    }
    Err(DescriptionError::Unit { what: what.into(), found: found.into(), wanted: wanted.into() })
}

fn entries(point: &Point, form: &Form) -> Vec<Vec<f64>> {
    let m = &point.matrices;
    let column = |values: &[f64]| values.iter().map(|v| vec![*v]).collect();
    match form.name {
        "gains" => Channel::ALL
            .iter()
            .map(|c| point.gains.get(c.name()).copied().unwrap_or_default().array().to_vec())
            .collect(),
        "trim_velocity" => column(&point.trim.velocity_body),
        "trim_attitude" => column(&[point.trim.roll, point.trim.pitch]),
        "trim_sticks" => column(&point.trim.sticks),
        "feedback" => m.feedback.clone(),
        "decoupling" => m.decoupling.clone(),
        "allocation" => m.allocation.clone(),
        "reference_state" => m.reference_state.clone(),
        "reference_input" => m.reference_input.clone(),
        "reference_dynamics" => m.reference_dynamics.clone(),
        "reference_drive" => m.reference_drive.clone(),
        "outputs" => m.outputs.clone(),
        "output_rates" => m.output_rates.clone(),
        _ => m.ground_velocity.clone(),
    }
}

fn constant(schedule: &Schedule, off_trim: &OffTrim, name: &str) -> f64 {
    let (l, h, s) = (&schedule.law, &schedule.hardware, &schedule.stick_limits);
    match name {
        "kappa" => l.kappa,
        "hybrid_feedforward" => f64::from(l.hybrid_feedforward),
        "reference_delay" => l.reference_delay,
        "roll_frequency" => l.roll_frequency,
        "pitch_frequency" => l.pitch_frequency,
        "attitude_damping" => l.attitude_damping,
        "yaw_time_constant" => l.yaw_time_constant,
        "heave_time_constant" => l.heave_time_constant,
        "turn_coordination_speed" => schedule.turn_coordination_speed,
        "turn_coordination_width" => schedule.turn_coordination_width,
        "gravity" => STANDARD_GRAVITY,
        "attitude_limit" => ATTITUDE_LIMIT,
        "outer_slowness" => OUTER_SLOWNESS,
        "acceleration_limit" => ACCELERATION_LIMIT,
        "schedule_lead" => SCHEDULE_LEAD,
        "forgetting" => FORGETTING,
        "yaw_lead" => YAW_LEAD,
        "slow" => SLOW,
        "pedal_yaw_growth" => off_trim.pedal_yaw,
        "collective_pitch_growth" => off_trim.collective_pitch,
        "pedal_pitch_growth" => off_trim.pedal_pitch,
        "pedal_power_min" => PEDAL_POWER_RANGE[0],
        "pedal_power_max" => PEDAL_POWER_RANGE[1],
        "stick_lat_min" => s[0][0],
        "stick_lat_max" => s[0][1],
        "stick_lon_min" => s[1][0],
        "stick_lon_max" => s[1][1],
        "stick_col_min" => s[2][0],
        "stick_col_max" => s[2][1],
        "stick_ped_min" => s[3][0],
        "stick_ped_max" => s[3][1],
        "actuator_bandwidth" => h.actuator_bandwidth,
        "actuator_damping" => h.actuator_damping,
        "delay" => h.delay,
        _ => h.sensor_bandwidth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::plant::RIGID_STATES;
    use crate::law::tables::{CHANNELS, STATES};
    use crate::schedule::sample;

    /// Names of states are those of the control stage.
    #[test]
    fn labels_are_those_of_the_control_stage() {
        assert_eq!(STATES.map(|s| s.0), RIGID_STATES);
        for c in Channel::ALL {
            assert_eq!(CHANNELS[c.index()].0, c.name());
        }
    }

    /// Every number of the schedule is in the description, and comes back.
    #[test]
    fn a_schedule_survives_its_description() {
        let schedule = sample::schedule();
        let description = Description::new(&schedule, Vec::new()).unwrap();
        assert_eq!(description.schedule().unwrap(), schedule);
        let entries: usize = FORMS.iter().map(|f| f.size().0 * f.size().1).sum();
        assert_eq!(entries, 18 + 3 + 2 + 4 + 32 + 16 + 16 + 16 + 48 + 16 + 8 + 32 + 32 + 16);
    }

    #[test]
    fn wrong_descriptions_are_refused_by_name() {
        let sound = Description::new(&sample::schedule(), Vec::new()).unwrap();
        let refused = |change: &dyn Fn(&mut Description)| {
            let mut d = sound.clone();
            change(&mut d);
            d.schedule().unwrap_err().to_string()
        };
        let message = refused(&|d| d.tables[4].units[0][0] = "deg/s^2 per kt".into());
        assert!(message.contains("feedback") && message.contains("kt"), "{message}");
        let message = refused(&|d| drop(d.tables.remove(5)));
        assert!(message.contains("decoupling"), "{message}");
        let message = refused(&|d| d.tables[0].values[1].truncate(2));
        assert!(message.contains("gains"), "{message}");
        let message = refused(&|d| d.constants[0].name = "capa".into());
        assert!(message.contains("capa"), "{message}");
        let message = refused(&|d| d.constants[6].value = 0.0);
        assert!(message.contains("yaw_time_constant"), "{message}");
        let message = refused(&|d| d.speed.values.reverse());
        assert!(message.contains("increasing"), "{message}");
        let message = refused(&|d| d.schema = "coaxdesign.law/7".into());
        assert!(message.contains("law/7"), "{message}");
    }
}
