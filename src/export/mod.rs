//! The gain schedule in the forms of other programs, and back.
//!
//! Every format starts from one [`Description`], is written by one file of
//! this module, and computes nothing of its own. What each is, and the program
//! that proves it, stands in [`Format::ALL`].
//!
//! * [`description`]: the law as plain tables with names, units and rules.
//! * [`vectors`]: what the law answers, to compare with.
//! * [`import`]: the way back.
//! * [`schema`]: JSON Schemas of `schedule.json` and of the JSON export.

mod ardupilot;
mod c;
mod code;
pub mod csv;
pub mod description;
mod fmu;
pub mod import;
mod jsbsim;
pub mod matlab;
mod python;
mod rust;
pub mod schema;
pub mod text;
mod toml;
pub mod vectors;

pub use description::{Description, DescriptionError};
pub use fmu::Platform;

use crate::control::law::LawTable;
use crate::law::Diagram;
use crate::problem::{LONGEST_NAME, visible};
use crate::schedule::Schedule;

/// A form to export to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Tables, units and rules as JSON.
    Json,
    /// The same, one number a line.
    Csv,
    /// The same as TOML.
    Toml,
    /// The whole law in C99.
    C,
    /// The whole law as a `no_std` module.
    Rust,
    /// Tables as MAT level 5, with a loader.
    Matlab,
    /// Tables as JSON, with a reader that also runs the law.
    Python,
    /// The whole law as a JSBSim system.
    Jsbsim,
    /// Parameters of one speed, and the tables in Lua.
    Ardupilot,
    /// The whole law as an FMI 2.0 unit for co-simulation.
    Fmu,
    /// Test vectors.
    Vectors,
}

/// What there is to say about a format.
#[derive(Debug, Clone, Copy)]
pub struct About {
    /// The format.
    pub format: Format,
    /// Name on the command line.
    pub name: &'static str,
    /// Whether it runs the law, or holds its tables.
    pub content: &'static str,
    /// Files, with NAME for the law's name.
    pub files: &'static str,
    /// The program that reads it in the tests.
    pub proven_in: &'static str,
}

impl Format {
    /// Every format.
    pub const ALL: [About; 11] = [
        About {
            format: Format::Json,
            name: "json",
            content: "tables, units, rules",
            files: "NAME.json",
            proven_in: "jsonschema",
        },
        About {
            format: Format::Csv,
            name: "csv",
            content: "tables, units, rules",
            files: "NAME.csv",
            proven_in: "Python csv",
        },
        About {
            format: Format::Toml,
            name: "toml",
            content: "tables, units, rules",
            files: "NAME.toml",
            proven_in: "Python tomllib",
        },
        About {
            format: Format::C,
            name: "c",
            content: "whole law, C99",
            files: "NAME_law.h, NAME_law.c",
            proven_in: "gcc",
        },
        About {
            format: Format::Rust,
            name: "rust",
            content: "whole law, no_std",
            files: "NAME_law.rs",
            proven_in: "rustc",
        },
        About {
            format: Format::Matlab,
            name: "matlab",
            content: "tables, units, rules",
            files: "NAME.mat, NAME_load.m",
            proven_in: "SciPy, Octave",
        },
        About {
            format: Format::Python,
            name: "python",
            content: "whole law, linear models",
            files: "NAME.json, NAME_law.py",
            proven_in: "CPython, python-control",
        },
        About {
            format: Format::Jsbsim,
            name: "jsbsim",
            content: "whole law",
            files: "NAME_law.xml",
            proven_in: "JSBSim",
        },
        About {
            format: Format::Ardupilot,
            name: "ardupilot",
            content: "feedback at one speed; tables in Lua",
            files: "NAME.param, NAME_schedule.lua",
            proven_in: "pymavlink, Lua",
        },
        About {
            format: Format::Fmu,
            name: "fmu",
            content: "whole law, FMI 2.0 co-simulation",
            files: "NAME.fmu",
            proven_in: "FMPy",
        },
        About {
            format: Format::Vectors,
            name: "vectors",
            content: "inputs and answers of the law, to test a port",
            files: "NAME_steps.csv, NAME_lookup.csv",
            proven_in: "all of the above",
        },
    ];

    /// What there is to say about it.
    pub fn about(self) -> About {
        // Written in the order of the enum; a test holds it.
        Self::ALL[self as usize]
    }
}

/// Width of numbers in generated code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32 bit.
    Float,
    /// 64 bit.
    Double,
}

/// Choices of an export.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Name of files and prefix of identifiers: see [`identifier`].
    pub name: String,
    /// Step of the law in discrete time, s.
    pub step: f64,
    /// Numbers in generated code.
    pub precision: Precision,
    /// Speed of formats that hold one, m/s.
    pub speed: f64,
    /// Shared objects to put into an FMU, built from its sources, one a
    /// platform; without any the FMU holds sources only.
    pub binaries: Vec<(Platform, Vec<u8>)>,
}

/// A file to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    /// Name without a directory.
    pub name: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

impl File {
    fn text(name: String, text: String) -> Self {
        Self { name, bytes: text.into_bytes() }
    }
}

/// What a format writes from.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// The law as plain tables.
    pub description: &'a Description,
    /// The schedule.
    pub schedule: &'a Schedule,
    /// The law itself.
    pub law: &'a LawTable,
    /// Choices.
    pub options: &'a Options,
}

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The schedule holds what no schedule can.
    #[error(transparent)]
    Schedule(#[from] crate::schedule::Findings),
    /// The schedule is no law.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A choice that makes no sense.
    #[error("{0}")]
    Option(String),
    /// The format cannot hold this law.
    #[error("{format}: {reason}")]
    Format {
        /// Which format.
        format: &'static str,
        /// Why.
        reason: String,
    },
}

/// Bounds of the step of the law in discrete time, s: the fastest flight
/// computers, and the slowest that hold an attitude.
const LEAST_STEP: f64 = 1e-4;
const LARGEST_STEP: f64 = 1.0;
/// Longest delay line of generated code, steps.
const MAX_DELAY_STEPS: usize = 10_000;

/// Steps of the reference's delay at a step in s.
fn delay_steps(input: &Input) -> usize {
    // As the law itself rounds it.
    (input.schedule.law.reference_delay / input.options.step).round() as usize
}

/// The law's diagram as generated code needs it.
fn diagram(input: &Input, engage: bool) -> Diagram {
    let limits = input.schedule.stick_limits;
    let mut diagram = input.law.diagram(input.options.step, limits, false, engage);
    // What may be looked at belongs to whoever flies, not to the code.
    diagram.monitors.clear();
    diagram.pruned()
}

/// The files of a format.
///
/// # Errors
/// A schedule that is no law, or choices that make no sense.
pub fn export(
    schedule: &Schedule,
    warnings: Vec<String>,
    format: Format,
    options: &Options,
) -> Result<Vec<File>, ExportError> {
    if !(LEAST_STEP..=LARGEST_STEP).contains(&options.step) {
        return Err(ExportError::Option(format!(
            "the step is {} s; it must be from {LEAST_STEP} s to {LARGEST_STEP} s",
            options.step
        )));
    }
    if !options.speed.is_finite() {
        return Err(ExportError::Option("the speed must be a number".into()));
    }
    schedule.check()?;

    if identifier(&options.name).as_deref() != Some(&options.name) {
        return Err(ExportError::Option(format!(
            "the name '{}' is no identifier: lower-case letters, digits and _, a letter first, at \
             most {LONGEST_NAME} of them",
            visible(&options.name, false)
        )));
    }
    let description = Description::new(schedule, warnings)?;
    let law = schedule.law().map_err(DescriptionError::from)?;
    let largest = description
        .tables
        .iter()
        .flat_map(|t| t.values.iter().flatten().flatten())
        .fold(0.0_f64, |m, x| m.max(x.abs()));
    if options.precision == Precision::Float && largest > f64::from(f32::MAX) {
        return Err(ExportError::Option(format!("{largest:e} does not fit a float: use double")));
    }
    let input = Input { description: &description, schedule, law: &law, options };
    if delay_steps(&input) > MAX_DELAY_STEPS {
        return Err(ExportError::Option(format!(
            "the reference's delay of {} s is more than {MAX_DELAY_STEPS} steps of {} s",
            schedule.law.reference_delay, options.step
        )));
    }
    match format {
        Format::Json => Ok(vec![File::text(format!("{}.json", options.name), json(&description))]),
        Format::Csv => csv::files(&input),
        Format::Toml => toml::files(&input),
        Format::C => Ok(c::files(&input)),
        Format::Rust => Ok(rust::files(&input)),
        Format::Matlab => Ok(matlab::files(&input)),
        Format::Python => Ok(python::files(&input)),
        Format::Jsbsim => Ok(jsbsim::files(&input)),
        Format::Ardupilot => ardupilot::files(&input),
        Format::Fmu => fmu::files(&input),
        Format::Vectors => vectors::files(&input),
    }
}

/// Sources from which a format's shared object is built, if it has one.
///
/// # Errors
/// As [`export`].
pub fn binary_sources(
    schedule: &Schedule,
    warnings: Vec<String>,
    options: &Options,
) -> Result<Vec<File>, ExportError> {
    let description = Description::new(schedule, warnings)?;
    let law = schedule.law().map_err(DescriptionError::from)?;
    Ok(fmu::sources(&Input { description: &description, schedule, law: &law, options }))
}

/// A description as JSON.
pub fn json(description: &Description) -> String {
    // A description holds strings and finite numbers only.
    let mut text = serde_json::to_string_pretty(description).unwrap_or_default();
    text.push('\n');
    text
}

/// The name of a law as an identifier of every language: lower-case letters,
/// digits and underscores, a letter first. `None` if nothing is left.
pub fn identifier(name: &str) -> Option<String> {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_ascii_alphanumeric() {
            out.push(c.to_ascii_lowercase());
        } else if !out.ends_with('_') {
            out.push('_');
        }
    }
    out.truncate(LONGEST_NAME);
    let out = out.trim_matches('_');
    out.starts_with(|c: char| c.is_ascii_alphabetic()).then(|| out.to_string())
}

/// Name of an entry where entries have no rows and columns.
fn entry_name(table: &str, row: &str, column: &str) -> String {
    if column == "value" { format!("{table}.{row}") } else { format!("{table}.{row}.{column}") }
}

/// What whoever flies a schedule must know about it.
pub fn warnings(schedule: &Schedule, foreign_schema: Option<&str>) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(found) = foreign_schema {
        out.push(format!(
            "the schedule is of schema '{found}' and was read as '{}'",
            crate::schedule::SCHEMA
        ));
    }
    if !schedule.requirements_met {
        out.push(
            "the schedule is not known to meet its requirements; do not fly it as it is".into(),
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_stand_in_their_order() {
        for about in Format::ALL {
            assert_eq!(about.format.about().name, about.name);
        }
    }

    #[test]
    fn names_become_identifiers() {
        assert_eq!(identifier("CoAX 2D").as_deref(), Some("coax_2d"));
        assert_eq!(identifier("--x--").as_deref(), Some("x"));
        assert_eq!(identifier("2d"), None);
        assert_eq!(identifier("Ж"), None);
        let long = identifier(&"x".repeat(70_000)).unwrap();
        assert_eq!(long.len(), LONGEST_NAME);
        assert_eq!(identifier(&long), Some(long.clone()));
    }
}
