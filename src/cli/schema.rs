//! `coaxdesign schema`.

use clap::{Args, ValueEnum};

use super::args::OutputArgs;
use super::{CliError, Outcome};
use coaxdesign::control::spec;
use coaxdesign::export::schema::{law_schema, schedule_schema};
use coaxdesign::lti::schema::set_schema;
use coaxdesign::problem::schema::{json_schema, json_schema_of};
use coaxdesign::simulate::maneuver;

/// Write the JSON Schema of input files or of results, for editors and other programs
#[derive(Debug, Args)]
pub struct Schema {
    /// Files that the schema is of
    #[arg(long = "of", value_enum, default_value = "problem")]
    kind: Kind,
    #[command(flatten)]
    output: OutputArgs,
}

/// Files that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Problem files
    Problem,
    /// Specifications
    Specification,
    /// Manoeuvres
    Maneuver,
    /// schedule.json
    Schedule,
    /// The JSON export of a schedule
    Law,
    /// Linear models over speed, as JSON
    LtiSet,
}

impl Schema {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        let schema = match self.kind {
            Kind::Problem => json_schema(),
            Kind::Specification => json_schema_of("coaxdesign specification", &spec::ROOT),
            Kind::Maneuver => json_schema_of("coaxdesign manoeuvre", &maneuver::ROOT),
            Kind::Schedule => schedule_schema(),
            Kind::Law => law_schema(),
            Kind::LtiSet => set_schema(),
        };
        let text = serde_json::to_string_pretty(&schema)
            .map_err(|error| CliError::Internal(error.to_string()))?;
        self.output.write(&(text + "\n"))
    }
}
