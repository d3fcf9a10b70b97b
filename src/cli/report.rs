//! `coaxdesign report`.

pub(super) mod gather;
mod maneuvers;
mod sections;

use std::path::{Path, PathBuf};

use clap::Args;

use super::args::{ProblemArgs, RunArgs, UnitsArgs};
use super::{CliError, Outcome, output};
use coaxdesign::control::law::LawTable;
use coaxdesign::pipeline::{Requirements, problem_hash};
use coaxdesign::problem::{self, Loaded};
use coaxdesign::report::html::Page;
use coaxdesign::schedule::Schedule;
use gather::{Checked, Study};
pub(super) use maneuvers::DIRECTORY as FLIGHTS;
use maneuvers::Flown;

/// Write a design as one HTML page: trim, models, law, margins, gains, provenance
///
/// The page needs no network. It has vector plots with values under the cursor, follows a light
/// or dark screen, prints, and fits a phone.
#[derive(Debug, Args)]
pub struct Report {
    /// Directory of a design, with the schedule.json of `tune-gains`
    #[arg(value_name = "DESIGN")]
    design: PathBuf,
    /// Problem file of the design [default: the one noted in the design, or a built-in one]
    #[arg(long, value_name = "FILE")]
    problem: Option<PathBuf>,
    /// Specification of the design [default: the one noted in the design, or the built-in one]
    #[arg(long, value_name = "SPEC")]
    spec: Option<PathBuf>,
    /// Page to write [default: report.html in the design's directory]
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Replace a page that is already there
    #[arg(long)]
    force: bool,
    /// True airspeeds of the trim curves: FIRST:LAST:STEP with a unit, or a list
    #[arg(long, value_name = "SPEEDS", default_value = "0:90:5kt")]
    speeds: String,
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
        let inputs = Inputs::find(directory, self.problem.as_deref(), self.spec.as_deref())?;
        let html = page(&inputs, &self.speeds, self.units, self.run.quiet)?;
        output::write_whole(&path, html.as_bytes(), self.force)?;
        if !self.run.quiet {
            output::note(&format!("Wrote {}.\n", path.display()));
        }
        Ok(Outcome::Done)
    }
}

/// The directory of a design that is named by it or by its schedule.
pub(super) fn directory_of(design: &Path) -> &Path {
    if design.is_dir() {
        return design;
    }
    match design.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
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
}

impl Inputs {
    /// Reads a design and finds the problem and the specification that it was
    /// tuned for.
    ///
    /// # Errors
    /// No schedule, or no problem with the hash that the schedule carries.
    pub fn find(
        directory: &Path,
        problem: Option<&Path>,
        spec: Option<&Path>,
    ) -> Result<Self, CliError> {
        let schedule = gather::schedule(directory)?;
        let checked = gather::verification(directory)?;
        let noted = super::design::Noted::read(directory)?;
        let wanted = &schedule.provenance.problem_hash;
        let problem = problem.map(Path::to_path_buf).or(noted.problem);
        let (loaded, problem_name) = match problem {
            Some(path) => {
                let name = path.display().to_string();
                (ProblemArgs { file: Some(path) }.load()?, name)
            }
            None => builtin_with(wanted)?.ok_or_else(|| CliError::Usage {
                message: format!(
                    "{}: the schedule was tuned for another problem than the built-in ones",
                    directory.display()
                ),
                help: "name its problem file with --problem FILE".into(),
            })?,
        };
        let spec_path = spec.map(Path::to_path_buf).or(noted.specification);
        let requirements = super::tune::SpecArgs::of(spec_path).load()?;
        let flights = maneuvers::read(directory, &schedule)?;
        Ok(Self { schedule, checked, flights, loaded, problem_name, requirements })
    }
}

impl Inputs {
    /// The law of the schedule.
    pub fn law(&self) -> Result<LawTable, CliError> {
        self.schedule.law().map_err(|error| CliError::Internal(error.to_string()))
    }
}

/// The built-in problem with a hash.
fn builtin_with(wanted: &str) -> Result<Option<(Loaded, String)>, CliError> {
    for name in problem::BUILTIN {
        let loaded = problem::builtin_named(name)?;
        if problem_hash(&loaded) == wanted {
            return Ok(Some((loaded, format!("{name} (built in)"))));
        }
    }
    Ok(None)
}

/// The report as HTML.
///
/// # Errors
/// A problem that makes no vehicle, or models that cannot be made.
pub(super) fn page(
    inputs: &Inputs,
    speeds: &str,
    units: UnitsArgs,
    quiet: bool,
) -> Result<String, CliError> {
    let study = Study::new(inputs, speeds, quiet)?;
    let system = units.system();
    let name = &inputs.loaded.problem.name;
    let mut page = Page::new(&format!("{name}: flight-control design"))
        .summary(&inputs.loaded.problem.description)
        .section(sections::summary(inputs, &study, system))
        .section(sections::vehicle(inputs, system))
        .section(sections::trim(inputs, &study, system))
        .section(sections::revolution(&study, system))
        .section(sections::modes(inputs, &study)?)
        .section(sections::responses(&study, system)?)
        .section(sections::law(inputs, system))
        .section(sections::gains(inputs, &study, system)?);
    if let Some(section) = sections::verification(inputs, &study, system)? {
        page = page.section(section);
    }
    if !inputs.flights.is_empty() {
        page = page.section(maneuvers::section(&inputs.flights, system));
    }
    Ok(page.section(sections::provenance(inputs)).to_html())
}
