//! `coaxdesign verify`.

use clap::Args;
use std::path::PathBuf;

use super::args::{Format, FormatArgs, ModelsArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::designs::{Opened, SourceArgs, load_schedule};
use super::tune::{SpecArgs, authority_text, left_out_text, misses_text, report_text, rows_table};
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
        let own = SpecArgs::of(self.sources.spec.clone()).load()?;
        let problem = ProblemArgs { file: self.sources.problem.clone() };
        let set = self.models.load(&problem, &own.specification.models_from, &own.name, quiet)?;
        let opened = match &set {
            Some(_) => None,
            None => Some(Opened::read(&self.design, &self.sources, quiet)?),
        };
        let requirements = opened.as_ref().map_or(&own, |opened| &opened.requirements);
        let mut spec = requirements.specification.clone();
        if self.nominal_only {
            spec.models.truncate(1);
        }
        let system =
            opened.as_ref().map_or(self.units.of(None), |opened| opened.system(self.units));
        let watch = Watch::new(quiet);
        let verified = match (&set, &opened) {
            (Some(set), _) => verify_models(&load_schedule(&self.design)?, set, &spec, &watch)?,
            (None, Some(opened)) => {
                verify(&opened.schedule, &opened.loaded.problem, &spec, &watch)?
            }
            (None, None) => {
                return Err(CliError::Internal("there is neither aircraft nor model".into()));
            }
        };
        let head = opened.as_ref().map_or_else(
            || {
                format!(
                    "{}: models from elsewhere, specification {}\n",
                    self.design.display(),
                    own.name
                )
            },
            Opened::head,
        );
        let text = match self.format.of(&self.output)? {
            Format::Json => {
                let internal = |e: serde_json::Error| CliError::Internal(e.to_string());
                let value = verification_document(&verified, &[], &[]).map_err(internal)?;
                let value =
                    opened.as_ref().map_or(value.clone(), |opened| opened.with_head(&value));
                serde_json::to_string_pretty(&value).map_err(internal)? + "\n"
            }
            Format::Csv => {
                let table = rows_table(&verified.verification, system, true);
                opened.as_ref().map_or(table.clone(), |opened| opened.with_columns(table)).to_csv()
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
