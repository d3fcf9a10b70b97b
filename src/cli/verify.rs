//! `coaxdesign verify`.

use clap::Args;
use std::path::PathBuf;

use super::args::{Format, FormatArgs, ModelsArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::tune::{SpecArgs, authority_text, report_text, rows_table, usage, verification_text};
use super::watch::Watch;
use super::{CliError, Outcome};
use coaxdesign::pipeline::{verify, verify_models};
use coaxdesign::report::table::Coloring;
use coaxdesign::schedule::Schedule;

/// Verify a gain schedule, tuned here or elsewhere, against a specification
///
/// The hardware is that of the specification, not of the schedule.
#[derive(Debug, Args)]
pub struct Verify {
    /// Schedule file, or a directory with a schedule.json
    #[arg(value_name = "SCHEDULE")]
    schedule: PathBuf,
    #[command(flatten)]
    problem: ProblemArgs,
    #[command(flatten)]
    models: ModelsArgs,
    #[command(flatten)]
    spec: SpecArgs,
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
        let path = if self.schedule.is_dir() {
            self.schedule.join("schedule.json")
        } else {
            self.schedule.clone()
        };
        let text = std::fs::read_to_string(&path)
            .map_err(|source| CliError::Io { path: path.clone(), source })?;
        let not_usable = |error: coaxdesign::schedule::ScheduleError| {
            usage(
                format!("{}: {error}", path.display()),
                "a schedule is written by `coaxdesign tune-gains -o DIR`",
            )
        };
        let schedule = Schedule::from_json(&text).map_err(not_usable)?;
        let requirements = self.spec.load()?;
        let spec = &requirements.specification;
        let quiet = self.run.quiet;
        let set = self.models.load(&self.problem, &spec.models_from, &requirements.name, quiet)?;
        let system = self.units.system();
        let watch = Watch::new(self.run.quiet);
        let verified = match &set {
            Some(set) => verify_models(&schedule, set, spec, &watch)?,
            None => {
                let loaded = self.problem.load_with_warnings(quiet)?;
                verify(&schedule, &loaded.problem, spec, &watch)?
            }
        };
        let text = match self.format.format {
            Format::Json => verification_text(&verified, &[], &[])?,
            Format::Csv => rows_table(&verified.verification, system, true).to_csv(),
            Format::Table => {
                report_text(&verified.verification, system, Coloring::for_stdout())
                    + &authority_text(&verified.authority, system)
            }
        };
        self.output.write(&text)?;
        Ok(if verified.met() { Outcome::Done } else { Outcome::GoalMissed })
    }
}
