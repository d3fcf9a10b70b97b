//! `coaxdesign schema`.

mod build;
mod design;
mod flight;
mod models;

use clap::{Args, ValueEnum};
use serde_json::{Map, Value as Json, json};

use super::args::OutputArgs;
use super::{CliError, Outcome};
use coaxdesign::control::spec;
use coaxdesign::export::schema::{law_schema, schedule_schema};
use coaxdesign::lti::schema::set_schema;
use coaxdesign::problem::schema::{json_schema, json_schema_of};
use coaxdesign::simulate::maneuver;

/// Write the JSON Schema of input files or of results, for editors and other programs
///
/// Every JSON result names its schema in its key `schema`: `coaxdesign.trim/1` is the schema trim.
#[derive(Debug, Args)]
pub struct Schema {
    /// What the schema is of
    #[arg(value_enum, value_name = "NAME", default_value = "problem")]
    name: Name,
    /// The same, as older versions had it
    #[arg(long = "of", value_enum, value_name = "NAME", hide = true, conflicts_with = "name")]
    of: Option<Name>,
    #[command(flatten)]
    output: OutputArgs,
}

/// Files and results that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Name {
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
    /// Linear models over speed, of linearize --speeds or from elsewhere
    LtiSet,
    /// A linear model, of linearize
    Lti,
    /// A periodic linear model, of linearize --model full
    Ltp,
    /// trim --format json
    Trim,
    /// rotor --format json
    Rotor,
    /// compare --format json
    Compare,
    /// check --format json
    Check,
    /// modes --format json
    Modes,
    /// bode --format json
    FrequencyResponse,
    /// verification.json, and verify and tune-gains --format json
    Verification,
    /// design.json, what a design was made from
    Design,
    /// simulate --format json, and flights as JSON
    Simulation,
    /// identify --format json
    Identification,
    /// identify --steps --format json
    Steps,
    /// montecarlo --format json
    Montecarlo,
    /// What a Monte Carlo study or a sweep is: study.json, FILE.study.json
    Study,
    /// A line of a file of runs
    Run,
    /// sweep --format json
    Sweep,
    /// A line of a file of cases
    Case,
}

impl Name {
    /// The version that results name.
    fn version(self) -> u32 {
        match self {
            Name::Montecarlo
            | Name::Study
            | Name::Run
            | Name::Design
            | Name::Modes
            | Name::FrequencyResponse => 2,
            _ => 1,
        }
    }

    fn schema(self) -> Json {
        match self {
            Name::Problem => json_schema(),
            Name::Specification => json_schema_of("coaxdesign specification", &spec::ROOT),
            Name::Maneuver => json_schema_of("coaxdesign manoeuvre", &maneuver::ROOT),
            Name::Schedule => schedule_schema(),
            Name::Law => law_schema(),
            Name::LtiSet => set_schema(),
            Name::Lti => models::lti(),
            Name::Ltp => models::ltp(),
            Name::Trim => models::trim(),
            Name::Rotor => models::rotor(),
            Name::Compare => models::compare(),
            Name::Check => models::check(),
            Name::Modes => models::modes(),
            Name::FrequencyResponse => models::frequency_response(),
            Name::Verification => design::verification(),
            Name::Design => design::note(),
            Name::Simulation => flight::simulation(),
            Name::Identification => flight::identification(),
            Name::Steps => flight::steps(),
            Name::Montecarlo => flight::montecarlo(),
            Name::Study => flight::study(),
            Name::Run => flight::run(),
            Name::Sweep => design::sweep(),
            Name::Case => design::case(),
        }
    }

    /// The schema as a document: how to read it, its name, its title, the rest.
    fn document(self) -> Json {
        let possible = self.to_possible_value();
        let name = possible.as_ref().map_or("", |value| value.get_name());
        let mut document = Map::new();
        let draft = "https://json-schema.org/draft/2020-12/schema";
        document.insert("$schema".into(), json!(draft));
        document.insert("$id".into(), json!(format!("urn:coaxdesign:{name}:{}", self.version())));
        document.insert("title".into(), json!(format!("coaxdesign {name}")));
        if let Json::Object(schema) = self.schema() {
            for (key, value) in schema {
                if key != "$schema" {
                    document.insert(key, value);
                }
            }
        }
        Json::Object(document)
    }
}

impl Schema {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        let name = self.of.unwrap_or(self.name);
        let text = serde_json::to_string_pretty(&name.document())
            .map_err(|error| CliError::Internal(error.to_string()))?;
        self.output.write(&(text + "\n"))
    }
}
