//! `coaxdesign verify`.

use clap::Args;
use std::path::PathBuf;

use super::args::{Format, FormatArgs, ModelsArgs, OutputArgs, RunArgs, UnitsArgs};
use super::designs::{SourceArgs, Subject, load_schedule};
use super::tune::{authority_text, left_out_text, misses_text, report_text, rows_table};
use super::watch::Watch;
use super::{CliError, Outcome};
use coaxdesign::pipeline::{verification_document, verify, verify_models};
use coaxdesign::report::table::Coloring;

/// Verify a gain schedule, tuned here or elsewhere, against a specification
///
/// Aircraft and specification are those of the design unless others are named. The hardware is
/// that of the specification, not of the schedule.
#[derive(Debug, Args)]
pub struct Verify {
    /// Directory of a design, or a schedule file
    #[arg(value_name = "DESIGN")]
    design: PathBuf,
    #[command(flatten)]
    sources: SourceArgs,
    #[command(flatten)]
    models: ModelsArgs,
    /// Use only the first nominal model of the specification
    #[arg(long)]
    nominal_only: bool,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    run: RunArgs,
}

impl Verify {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        self.output.check()?;
        self.format.of(&self.output)?;
        let quiet = self.run.quiet;
        let subject = Subject::read(&self.design, &self.sources, &self.models, quiet)?;
        let mut spec = subject.specification().clone();
        if self.nominal_only {
            spec.models.truncate(1);
        }
        let (system, head) = (subject.system(self.units), subject.head());
        let watch = Watch::new(quiet);
        let verified = match &subject {
            Subject::Problem(opened) => {
                verify(&opened.schedule, &opened.loaded.problem, &spec, &watch)?
            }
            Subject::Models(of_models) => {
                verify_models(&load_schedule(&self.design)?, &of_models.set, &spec, &watch)?
            }
        };
        let text = match self.format.of(&self.output)? {
            Format::Json => {
                let internal = |e: serde_json::Error| CliError::Internal(e.to_string());
                let value = verification_document(&verified, &[], &[]).map_err(internal)?;
                serde_json::to_string_pretty(&subject.with_head(&value)).map_err(internal)? + "\n"
            }
            Format::Csv => {
                let table = rows_table(&verified.verification, system, true);
                subject.with_columns(table).to_csv()
            }
            Format::Table => {
                format!("{head}\n")
                    + &report_text(&verified.verification, system, Coloring::for_stdout())
                    + &authority_text(&verified.authority, system)
                    + &misses_text(&verified.verification, system)
                    + &left_out_text(&verified.left_out, system)
            }
        };
        self.output.write(&text)?;
        Ok(if verified.met() { Outcome::Done } else { Outcome::GoalMissed })
    }
}
