//! `coaxdesign report`.

pub(super) mod gather;
mod maneuvers;
mod sections;

use std::path::{Path, PathBuf};

use clap::Args;

use super::args::{RunArgs, UnitsArgs};
use super::design::default_speeds;
use super::designs::{Opened, SourceArgs, directory_of};
use super::{CliError, Outcome, output};
use coaxdesign::control::law::LawTable;
use coaxdesign::pipeline::Requirements;
use coaxdesign::problem::Loaded;
use coaxdesign::report::html::Page;
use coaxdesign::schedule::Schedule;
use coaxdesign::units::System;
use gather::{Checked, Study};
pub(super) use maneuvers::DIRECTORY as FLIGHTS;
use maneuvers::Flown;

/// Write a design as one HTML page: trim, models, law, margins, gains, provenance
///
/// The page needs no network. It has vector plots with values under the cursor, follows a light
/// or dark screen, prints, and fits a phone.
#[derive(Debug, Args)]
pub struct Report {
    /// Directory of a design
    #[arg(value_name = "DESIGN")]
    design: PathBuf,
    #[command(flatten)]
    sources: SourceArgs,
    /// Page to write [default: report.html in the design's directory]
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Replace a page that is already there
    #[arg(long)]
    force: bool,
    /// True airspeeds of the trim curves: FIRST:LAST:STEP with a unit, or a list [default: from 0
    /// to the schedule's highest]
    #[arg(long, value_name = "SPEEDS")]
    speeds: Option<String>,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    run: RunArgs,
}

impl Report {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        let directory = directory_of(&self.design);
        let path = self.output.clone().unwrap_or_else(|| directory.join("report.html"));
        if path.exists() && !self.force {
            return Err(CliError::Exists { path });
        }
        // A page beside the design is one more writer into its directory.
        let _lock = match &self.output {
            None if directory.is_dir() => Some(super::designs::lock(directory)?),
            _ => None,
        };
        let inputs = Inputs::find(&self.design, &self.sources, true)?;
        let system = match self.units.units {
            Some(_) => self.units.of(None),
            None => inputs.units,
        };
        let highest = inputs.schedule.points.iter().map(|p| p.speed).fold(0.0, f64::max);
        let speeds = self.speeds.unwrap_or_else(|| default_speeds(highest));
        let html = page(&inputs, &speeds, system, self.run.quiet)?;
        output::write_whole(&path, html.as_bytes(), self.force)?;
        if !self.run.quiet {
            output::note(&format!("Wrote {}.\n", path.display()));
        }
        Ok(Outcome::Done)
    }
}

/// What a report is made of.
pub(super) struct Inputs {
    /// The tuned schedule.
    pub schedule: Schedule,
    /// Its verification, if one is there.
    pub checked: Option<Checked>,
    /// Flights under it, if any are there.
    pub flights: Vec<Flown>,
    /// The problem.
    pub loaded: Loaded,
    /// Name or path of the problem, as it is shown.
    pub problem_name: String,
    /// The specification.
    pub requirements: Requirements,
    /// Units of the design's results.
    pub units: System,
}

impl Inputs {
    /// Reads a design with its aircraft and its specification.
    ///
    /// # Errors
    /// As [`Opened::read`], and files of the design that are not what they
    /// should be.
    pub fn find(design: &Path, sources: &SourceArgs, quiet: bool) -> Result<Self, CliError> {
        let opened = Opened::read(design, sources, quiet)?;
        let checked = gather::verification(&opened.directory)?;
        let flights = maneuvers::read(&opened.directory, &opened.schedule)?;
        let units = opened.system(UnitsArgs { units: None });
        let Opened { schedule, loaded, problem_name, requirements, .. } = opened;
        Ok(Self { schedule, checked, flights, loaded, problem_name, requirements, units })
    }
}

impl Inputs {
    /// The law of the schedule.
    pub fn law(&self) -> Result<LawTable, CliError> {
        self.schedule.law().map_err(|error| CliError::Internal(error.to_string()))
    }
}

/// The report as HTML.
///
/// # Errors
/// A problem that makes no vehicle, or models that cannot be made.
pub(super) fn page(
    inputs: &Inputs,
    speeds: &str,
    system: System,
    quiet: bool,
) -> Result<String, CliError> {
    let study = Study::new(inputs, speeds, quiet)?;
    let name = &inputs.loaded.problem.name;
    let mut page = Page::new(&format!("{name}: flight-control design"))
        .summary(&inputs.loaded.problem.description)
        .section(sections::summary(inputs, &study, system))
        .section(sections::vehicle(inputs, system))
        .section(sections::trim(inputs, &study, system))
        .section(sections::revolution(&study, system))
        .section(sections::modes(inputs, &study)?)
        .section(sections::responses(inputs, &study, system)?)
        .section(sections::law(inputs, system))
        .section(sections::gains(inputs, &study, system)?);
    if let Some(section) = sections::verification(inputs, &study, system)? {
        page = page.section(section);
    }
    if !inputs.flights.is_empty() {
        page = page.section(maneuvers::section(&inputs.loaded.problem, &inputs.flights, system));
    }
    Ok(page.section(sections::provenance(inputs)).to_html())
}
