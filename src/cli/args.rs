//! Arguments that several subcommands share.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::error::color;
use super::models::PointArgs;
use super::output;
use super::trim::parse_speeds;
use super::{CliError, Outcome};
use coaxdesign::lti::mapping::Mapping;
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::lti::{self, LtiSet, PointModel};
use coaxdesign::pipeline::PipelineError;
use coaxdesign::pipeline::directory::DesignInputs;
use coaxdesign::problem::{self, Loaded, Problem};
use coaxdesign::units::{Kind, System};

/// The problem to work on.
#[derive(Debug, Clone, Args)]
pub struct ProblemArgs {
    /// Problem file, or the name of a built-in one: coax2d (the default), coax2d-appendix,
    /// coax2d-physics; or the directory of a design, whose aircraft it is
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
}

impl ProblemArgs {
    /// Reads the problem. A built-in name is taken where no file has it; of
    /// the directory of a design it is the aircraft.
    ///
    /// # Errors
    /// Every error of the file at once.
    pub fn load(&self) -> Result<Loaded, CliError> {
        let Some(path) = &self.file else {
            return Ok(problem::builtin()?);
        };
        let loaded = match builtin_name(path) {
            Some(name) => return Ok(problem::builtin_named(name)?),
            None if path.is_dir() => match DesignInputs::read(path)? {
                Some(design) => design.aircraft,
                None => problem::load(path)?,
            },
            None => problem::load(path)?,
        };
        for file in loaded.sources.files() {
            output::is_input(&file.path);
        }
        Ok(loaded)
    }

    /// Reads the problem and shows its warnings on standard error, unless
    /// quiet.
    ///
    /// # Errors
    /// As [`ProblemArgs::load`].
    pub fn load_with_warnings(&self, quiet: bool) -> Result<Loaded, CliError> {
        let loaded = self.load()?;
        if !quiet {
            show_warnings(&loaded);
        }
        Ok(loaded)
    }
}

/// Shows the warnings of a problem on standard error.
pub(super) fn show_warnings(loaded: &Loaded) {
    for warning in &loaded.warnings {
        output::note(&(warning.render(color()) + "\n"));
    }
}

/// `--models SET`.
#[derive(Debug, Clone, Default, Args)]
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
        if !quiet {
            for text in &set.notes {
                output::note(&format!("note: {text}\n"));
            }
        }
        Ok(Some(set))
    }

    /// The set and its models at the speeds asked for; between the models of
    /// the set those of the stitched model. `None` without `--models`.
    ///
    /// # Errors
    /// As [`ModelsArgs::load`], or a speed outside the set.
    pub fn points(
        &self,
        problem: &ProblemArgs,
        spec: Option<&Path>,
        point: &PointArgs,
        quiet: bool,
    ) -> Result<Option<(LtiSet, Vec<PointModel>)>, CliError> {
        if self.models.is_none() {
            return Ok(None);
        }
        let mapping = match spec {
            Some(path) => coaxdesign::control::spec::load(path)?.models_from,
            None => Mapping::default(),
        };
        let Some(set) = self.load(problem, &mapping, "", quiet)? else { return Ok(None) };
        let speeds = parse_speeds(&point.speeds)?;
        let known = set.speeds();
        let (low, high) = (known[0], known[known.len() - 1]);
        if let Some(outside) = speeds.iter().find(|v| !(low..=high).contains(*v)) {
            let words = |v: &f64| Kind::Airspeed.in_both(*v);
            return Err(CliError::Usage {
                message: format!(
                    "--speeds {:?}: {} is outside the set, whose models go from {} to {}",
                    point.speeds,
                    words(outside),
                    words(&low),
                    words(&high)
                ),
                help: format!(
                    "its speeds are {}",
                    known.iter().map(words).collect::<Vec<_>>().join(", ")
                ),
            });
        }
        let mut stitched = None;
        let mut points = Vec::with_capacity(speeds.len());
        for speed in speeds {
            if let Some(own) = set.at(speed) {
                points.push(own.clone());
                continue;
            }
            let between = match &stitched {
                Some(between) => between,
                None => stitched
                    .insert(Stitched::new(&set, mapping.inertia).map_err(PipelineError::from)?),
            };
            points.push(between.at(speed).map_err(PipelineError::from)?);
        }
        Ok(Some((set, points)))
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
    /// Units of the results [default: those of the design, else those that the problem file
    /// states, else us]
    #[arg(long, value_enum)]
    pub units: Option<Units>,
}

impl UnitsArgs {
    /// The system of units that is asked for, else the one that the aircraft
    /// states, else US customary units.
    pub fn of(self, problem: Option<&Problem>) -> System {
        match self.units {
            Some(Units::Us) => System::Us,
            Some(Units::Si) => System::Si,
            None => problem.and_then(|problem| problem.units).unwrap_or_default(),
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

impl FileForm for Format {
    const ENDINGS: &'static [(&'static str, Self)] = &[
        ("txt", Format::Table),
        ("md", Format::Table),
        ("csv", Format::Csv),
        ("json", Format::Json),
    ];
    const USUAL: Self = Format::Table;
}

/// Forms that the ending of a file's name chooses.
pub trait FileForm: Copy + PartialEq + ValueEnum + 'static {
    /// Endings without the dot, in lower case, and what they mean.
    const ENDINGS: &'static [(&'static str, Self)];
    /// The form where nothing says one.
    const USUAL: Self;
}

/// The form of a result: what `--format` says, else what the ending of the
/// file's name says, else the usual one.
///
/// # Errors
/// An ending that says another form than `--format`, or, without it, one that
/// says none.
pub fn form_of<F: FileForm>(asked: Option<F>, file: Option<&Path>) -> Result<F, CliError> {
    let ending = file.and_then(|path| path.extension()).map(|e| e.to_string_lossy().to_lowercase());
    let (Some(file), Some(ending)) = (file, ending) else {
        return Ok(asked.unwrap_or(F::USUAL));
    };
    let meant = F::ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, form)| *form);
    let name = |form: F| form.to_possible_value().map_or(String::new(), |v| v.get_name().into());
    match (asked, meant) {
        (Some(asked), Some(meant)) if asked != meant => Err(CliError::Usage {
            message: format!(
                "{}: the ending says {}, but --format says {}",
                file.display(),
                name(meant),
                name(asked)
            ),
            help: "leave --format out, or give the file another ending".into(),
        }),
        (Some(asked), _) => Ok(asked),
        (None, Some(meant)) => Ok(meant),
        (None, None) => {
            let known: Vec<String> =
                F::ENDINGS.iter().map(|(ending, _)| format!(".{ending}")).collect();
            Err(CliError::Usage {
                message: format!(
                    "{}: this result has no form that ends in .{ending}",
                    file.display()
                ),
                help: format!("end the name in {}, or say --format", known.join(", ")),
            })
        }
    }
}

/// `--format table|csv|json`.
#[derive(Debug, Clone, Copy, Args)]
pub struct FormatArgs {
    /// Form of the result [default: what the ending of -o says, else table]
    #[arg(long, value_enum)]
    pub format: Option<Format>,
}

impl FormatArgs {
    /// The form of a result that goes to standard output.
    pub fn shown(self) -> Format {
        self.format.unwrap_or(Format::USUAL)
    }

    /// The form of a result.
    ///
    /// # Errors
    /// As [`form_of`].
    pub fn of(self, output: &OutputArgs) -> Result<Format, CliError> {
        form_of(self.format, output.file())
    }
}

/// `-o FILE` and `--force`.
#[derive(Debug, Clone, Args)]
pub struct OutputArgs {
    /// File to write instead of standard output; - is standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace files that are already there
    #[arg(long)]
    pub force: bool,
}

impl OutputArgs {
    /// The file to write; none for standard output.
    pub fn file(&self) -> Option<&Path> {
        self.output.as_deref().filter(|path| *path != Path::new("-"))
    }

    /// Refuses an output file that is already there. To be called before a
    /// long computation, so that its result is not lost.
    ///
    /// # Errors
    /// [`CliError::Exists`].
    pub fn check(&self) -> Result<(), CliError> {
        match self.file() {
            Some(path) if path.exists() && !self.force => {
                Err(CliError::Exists { path: path.into() })
            }
            _ => Ok(()),
        }
    }

    /// As [`OutputArgs::check`], for another file that the same `--force`
    /// governs.
    ///
    /// # Errors
    /// [`CliError::Exists`], and a file that is the one of `-o`.
    pub fn check_path(&self, path: &Path) -> Result<(), CliError> {
        if self.file().is_some_and(|own| output::same_file(own, path)) {
            return Err(CliError::Usage {
                message: format!("{}: two results cannot go to one file", path.display()),
                help: "give -o and the other file different names".into(),
            });
        }
        if path.exists() && !self.force {
            return Err(CliError::Exists { path: path.into() });
        }
        Ok(())
    }

    /// As [`OutputArgs::check_path`], for a plot.
    ///
    /// # Errors
    /// As there, and a name that ends in the form of another kind of picture.
    pub fn check_plot(&self, path: &Path) -> Result<(), CliError> {
        Picture::of(path)?;
        self.check_path(path)
    }

    /// Writes a plot in the form that the ending of its name says.
    ///
    /// # Errors
    /// [`CliError::Exists`] and [`CliError::Io`].
    pub fn write_plot(&self, path: &Path, svg: &str) -> Result<(), CliError> {
        let bytes = match Picture::of(path)? {
            Picture::Svg => svg.as_bytes().to_vec(),
            #[cfg(feature = "png")]
            Picture::Png => super::png::from_svg(svg)?,
        };
        output::write_whole(path, &bytes, self.force)
    }

    /// Writes a result to the file, or to standard output.
    ///
    /// # Errors
    /// [`CliError::Exists`] and [`CliError::Io`].
    pub fn write(&self, text: &str) -> Result<Outcome, CliError> {
        match self.file() {
            Some(path) => output::write_whole(path, text.as_bytes(), self.force)?,
            None => output::print(text)?,
        }
        Ok(Outcome::Done)
    }
}

/// Forms of a plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Picture {
    /// A vector picture.
    Svg,
    /// A raster picture.
    #[cfg(feature = "png")]
    Png,
}

impl Picture {
    /// The form that the ending of a name says; without one, SVG.
    fn of(path: &Path) -> Result<Self, CliError> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let refuse = |message: String, help: &str| CliError::Usage { message, help: help.into() };
        match ending.as_deref() {
            None | Some("svg") => Ok(Picture::Svg),
            #[cfg(feature = "png")]
            Some("png") => Ok(Picture::Png),
            #[cfg(not(feature = "png"))]
            Some("png") => Err(refuse(
                format!("{}: this program was built without PNG", path.display()),
                "build it with `cargo install --path . --features png`, or write .svg, which \
                 browsers, Inkscape and office programs open",
            )),
            Some(other) => Err(refuse(
                format!("{}: plots are not written as .{other}", path.display()),
                "end the name in .svg, a vector picture that browsers, Inkscape and office \
                 programs open, or in .png",
            )),
        }
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
