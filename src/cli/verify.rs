//! `coaxdesign verify`.

use clap::Args;
use std::path::PathBuf;

use super::args::{Format, FormatArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::tune::{
    SpecArgs, authority_text, blades, plants, report_text, rows_table, usage, verification_json,
    verification_speeds, verify_error,
};
use super::{CliError, Outcome};
use coaxdesign::control::verify::{authority, verify};
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
        let table = schedule.law().map_err(not_usable)?;
        let loaded = self.problem.load_with_warnings(self.run.quiet)?;
        let (spec, _) = self.spec.load()?;
        let system = self.units.system();
        let breakpoints: Vec<f64> = table.points().iter().map(|p| p.speed).collect();
        let speeds = verification_speeds(&breakpoints, &spec.verify_speeds);
        let built = plants(&loaded.problem, &spec, &speeds, self.run.quiet)?;
        let verification = verify(&table, &built.set, &spec.hardware, &spec)
            .map_err(|error| verify_error(&error))?;
        let checks = authority(
            &table,
            &spec.hardware,
            &spec,
            &blades(&loaded.problem),
            &schedule.stick_limits,
        );
        let text = match self.format.format {
            Format::Json => verification_json(&verification, &checks, &[], &[], &built.left_out)?,
            Format::Csv => rows_table(&verification, system, true).to_csv(),
            Format::Table => {
                report_text(&verification, system, Coloring::for_stdout())
                    + &authority_text(&checks, system)
            }
        };
        self.output.write(&text)?;
        let met = verification.passed && built.left_out.is_empty();
        Ok(if met { Outcome::Done } else { Outcome::GoalMissed })
    }
}
