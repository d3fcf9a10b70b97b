//! Arguments that several subcommands share.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::error::color;
use super::models::PointArgs;
use super::output;
use super::{CliError, Outcome};
use coaxdesign::lti::mapping::Mapping;
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::lti::{self, LtiSet, PointModel};
use coaxdesign::pipeline::PipelineError;
use coaxdesign::problem::{self, Loaded};
use coaxdesign::units::{KNOT, Kind, System, parse_quantity};

/// Environment variable that a design sets for its stages.
pub(super) const STAGE: &str = "COAXDESIGN_STAGE";

/// The problem to work on.
#[derive(Debug, Clone, Args)]
pub struct ProblemArgs {
    /// Problem file, or the name of a built-in one: coax2d (the default), coax2d-appendix,
    /// coax2d-physics
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
}

impl ProblemArgs {
    /// Reads the problem. A built-in name is taken where no file has it; a
    /// directory, such as that of a design, is no problem file.
    ///
    /// # Errors
    /// Every error of the file at once.
    pub fn load(&self) -> Result<Loaded, CliError> {
        let Some(path) = &self.file else {
            return Ok(problem::builtin()?);
        };
        match builtin_name(path) {
            Some(name) => Ok(problem::builtin_named(name)?),
            None => Ok(problem::load(path)?),
        }
    }

    /// Reads the problem and shows its warnings on standard error, unless
    /// quiet.
    ///
    /// # Errors
    /// As [`ProblemArgs::load`].
    pub fn load_with_warnings(&self, quiet: bool) -> Result<Loaded, CliError> {
        let loaded = self.load()?;
        // A design has shown them once for all its stages.
        if !quiet && std::env::var_os(STAGE).is_none() {
            for warning in &loaded.warnings {
                output::note(&(warning.render(color()) + "\n"));
            }
        }
        Ok(loaded)
    }
}

/// `--models SET`.
#[derive(Debug, Clone, Args)]
pub struct ModelsArgs {
    /// Linear models from elsewhere instead of a problem: a directory of CSV tables, or a JSON,
    /// MAT or CSV file
    #[arg(long, value_name = "SET")]
    pub models: Option<PathBuf>,
}

impl ModelsArgs {
    /// Reads the set, if there is one: that of `--models`, or the one that the
    /// specification names, whose path is relative to it. What was done to the
    /// models is shown on standard error, unless quiet.
    ///
    /// # Errors
    /// Everything that is wrong with the set, and a problem file beside it.
    pub fn load(
        &self,
        problem: &ProblemArgs,
        mapping: &Mapping,
        specification: &str,
        quiet: bool,
    ) -> Result<Option<LtiSet>, CliError> {
        let beside = |path: &PathBuf| match Path::new(specification).parent() {
            Some(directory) if path.is_relative() => directory.join(path),
            _ => path.clone(),
        };
        let path = match (&self.models, &mapping.path) {
            (Some(path), _) => path.clone(),
            // A problem that is named goes before a set that the
            // specification names.
            (None, Some(path)) if problem.file.is_none() => beside(path),
            _ => return Ok(None),
        };
        if let Some(file) = &problem.file {
            return Err(CliError::Usage {
                message: format!(
                    "a problem file, {}, and a set of models, {}, are given",
                    file.display(),
                    path.display()
                ),
                help: "give one of them".into(),
            });
        }
        let set = lti::load(&path, mapping)?;
        if !quiet && std::env::var_os(STAGE).is_none() {
            for text in &set.notes {
                output::note(&format!("note: {text}\n"));
            }
        }
        Ok(Some(set))
    }

    /// The set and its model at the speed of a point; between the models of the
    /// set that of the stitched model. `None` without `--models`.
    ///
    /// # Errors
    /// As [`ModelsArgs::load`], a speed outside the set, or flight that is not
    /// level.
    pub fn point(
        &self,
        problem: &ProblemArgs,
        spec: Option<&Path>,
        point: &PointArgs,
        quiet: bool,
    ) -> Result<Option<(LtiSet, PointModel)>, CliError> {
        if self.models.is_none() {
            return Ok(None);
        }
        let mapping = match spec {
            Some(path) => coaxdesign::control::spec::load(path)?.models_from,
            None => Mapping::default(),
        };
        let Some(set) = self.load(problem, &mapping, "", quiet)? else { return Ok(None) };
        let usage = |message: String, help: &str| CliError::Usage { message, help: help.into() };
        let speed = parse_quantity(&point.speed, Kind::Airspeed).map_err(|error| {
            usage(format!("--speed {:?}: {error}", point.speed), "write --speed \"45 kt\"")
        })?;
        if let Some(own) = set.at(speed) {
            let own = own.clone();
            return Ok(Some((set, own)));
        }
        let speeds = set.speeds();
        let (low, high) = (speeds[0], speeds[speeds.len() - 1]);
        if !(low..=high).contains(&speed) {
            let list: Vec<String> = speeds.iter().map(|v| format!("{:.0}", v / KNOT)).collect();
            let message = format!(
                "--speed {:?}: the set has models from {:.0} to {:.0} kt",
                point.speed,
                low / KNOT,
                high / KNOT
            );
            return Err(usage(message, &format!("its speeds are {} kt", list.join(", "))));
        }
        let stitched = Stitched::new(&set, mapping.inertia).map_err(PipelineError::from)?;
        let between = stitched.at(speed).map_err(PipelineError::from)?;
        Ok(Some((set, between)))
    }
}

/// The built-in problem that a path names, where no file has that name.
pub(super) fn builtin_name(path: &Path) -> Option<&'static str> {
    let name = path.to_str()?;
    problem::BUILTIN.into_iter().find(|known| *known == name).filter(|_| !path.is_file())
}

/// Units of what people read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Units {
    /// US customary: ft, lb, slug, hp, kt
    Us,
    /// SI: m, kg, N, kW
    Si,
}

/// `--units`.
#[derive(Debug, Clone, Copy, Args)]
pub struct UnitsArgs {
    /// Units of the results
    #[arg(long, value_enum, default_value = "us")]
    pub units: Units,
}

impl UnitsArgs {
    /// The system of units.
    pub fn system(self) -> System {
        match self.units {
            Units::Us => System::Us,
            Units::Si => System::Si,
        }
    }
}

/// Forms of a result with rows and columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Aligned columns for people
    Table,
    /// Comma-separated values
    Csv,
    /// JSON
    Json,
}

/// `--format table|csv|json`.
#[derive(Debug, Clone, Copy, Args)]
pub struct FormatArgs {
    /// Form of the result
    #[arg(long, value_enum, default_value = "table")]
    pub format: Format,
}

/// `-o FILE` and `--force`.
#[derive(Debug, Clone, Args)]
pub struct OutputArgs {
    /// File to write instead of standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace files that are already there
    #[arg(long)]
    pub force: bool,
}

impl OutputArgs {
    /// Refuses an output file that is already there. To be called before a
    /// long computation, so that its result is not lost.
    ///
    /// # Errors
    /// [`CliError::Exists`].
    pub fn check(&self) -> Result<(), CliError> {
        self.output.as_deref().map_or(Ok(()), |path| self.check_path(path))
    }

    /// As [`OutputArgs::check`], for another file that the same `--force`
    /// governs.
    ///
    /// # Errors
    /// [`CliError::Exists`].
    pub fn check_path(&self, path: &Path) -> Result<(), CliError> {
        if path.exists() && !self.force {
            return Err(CliError::Exists { path: path.into() });
        }
        Ok(())
    }

    /// Writes a result to the file, or to standard output.
    ///
    /// # Errors
    /// [`CliError::Exists`] and [`CliError::Io`].
    pub fn write(&self, text: &str) -> Result<Outcome, CliError> {
        match &self.output {
            Some(path) => output::write_whole(path, text.as_bytes(), self.force)?,
            None => output::print(text)?,
        }
        Ok(Outcome::Done)
    }
}

/// `--quiet` and `--threads`.
#[derive(Debug, Clone, Copy, Args)]
pub struct RunArgs {
    /// Show no progress and no warnings
    #[arg(short, long)]
    pub quiet: bool,
    /// Threads to compute with; results do not depend on it [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

impl RunArgs {
    /// Sets up the pool of threads. To be called once, before any work.
    ///
    /// # Errors
    /// Where the system refuses the threads.
    pub fn start(&self) -> Result<(), CliError> {
        let Some(threads) = self.threads else {
            return Ok(());
        };
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global()
            .map_err(|error| CliError::Internal(format!("cannot start {threads} threads: {error}")))
    }
}
