//! `coaxdesign export`.

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};

use super::quantity::quantity;
use super::tune::usage;
use super::{CliError, Outcome, output};
use coaxdesign::export::{self, ExportError, Format, Options, Platform, Precision};
use coaxdesign::schedule::{self, Schedule};
use coaxdesign::units::Kind;

/// Interval at which an exported law is stepped, unless another is named.
const STEP: &str = "0.01 s";
/// Speed of the one condition of ArduPilot, unless another is named.
const SPEED: &str = "0 kt";

/// Write a gain schedule in the form of another program
///
/// Every form carries gains, model inversion, trims, units, signs and rules, or runs the law
/// itself. A schedule that is not known to meet its requirements, or is of another schema, is
/// refused.
#[derive(Debug, Args)]
pub struct Export {
    /// Directory of a design, or a schedule file
    #[arg(value_name = "DESIGN", required_unless_present = "list")]
    schedule: Option<PathBuf>,
    /// Form to write
    #[arg(long, value_enum, value_name = "FORMAT", required_unless_present = "list")]
    to: Option<FormatName>,
    /// List the forms
    #[arg(long, exclusive = true)]
    list: bool,
    /// Directory to write to; a single text goes to standard output without it
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace files that are already there
    #[arg(long)]
    force: bool,
    /// Export even if the schedule is not known to meet its requirements, or is of another
    /// schema; what is written says so
    #[arg(long)]
    unverified: bool,
    /// Name of files and prefix of identifiers [default: the aircraft's]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Interval at which the law is stepped: for c, rust, jsbsim, fmu, vectors
    #[arg(long, value_name = "TIME", default_value = STEP)]
    step: String,
    /// Width of numbers: for c, rust
    #[arg(long, value_enum, default_value = "double")]
    precision: PrecisionName,
    /// True airspeed of the one condition: for ardupilot
    #[arg(long, value_name = "SPEED", default_value = SPEED)]
    speed: String,
    /// C compiler that builds a shared object into the FMU, for the platform that the compiler
    /// is for; may be given several times, for several platforms. Without it the FMU holds its C
    /// sources only
    #[arg(long, value_name = "CC")]
    cc: Vec<String>,
    /// Platform of the shared object, where the compiler does not say it: one for each --cc, in
    /// the same order
    #[arg(long, value_enum, value_name = "PLATFORM", requires = "cc")]
    platform: Vec<PlatformName>,
    /// Leave out warnings: a design has shown them once for all its exports.
    #[arg(skip)]
    quiet: bool,
}

/// Widths by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PrecisionName {
    /// 32 bit
    Float,
    /// 64 bit
    Double,
}

/// Platforms by name.
#[derive(Debug, Clone, Copy)]
struct PlatformName(Platform);

impl ValueEnum for PlatformName {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [PlatformName; Platform::ALL.len()] = {
            let mut all = [PlatformName(Platform::Linux64); Platform::ALL.len()];
            let mut k = 0;
            while k < all.len() {
                all[k] = PlatformName(Platform::ALL[k]);
                k += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.folder()))
    }
}

/// A form by its name.
#[derive(Debug, Clone, Copy)]
pub(super) struct FormatName(pub(super) Format);

impl ValueEnum for FormatName {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [FormatName; Format::ALL.len()] = {
            let mut all = [FormatName(Format::Json); Format::ALL.len()];
            let mut k = 0;
            while k < all.len() {
                all[k] = FormatName(Format::ALL[k].format);
                k += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let about = self.0.about();
        Some(PossibleValue::new(about.name).help(about.content))
    }
}

impl Export {
    /// An export of a design into a directory, as `design` makes them: also of
    /// what misses a requirement, which what is written says.
    pub(super) fn of(design: PathBuf, format: FormatName, output: PathBuf, quiet: bool) -> Self {
        Self {
            schedule: Some(design),
            to: Some(format),
            list: false,
            output: Some(output),
            force: true,
            unverified: true,
            name: None,
            step: STEP.into(),
            precision: PrecisionName::Double,
            speed: SPEED.into(),
            cc: Vec::new(),
            platform: Vec::new(),
            quiet,
        }
    }

    pub(super) fn run(self) -> Result<Outcome, CliError> {
        let (Some(path), Some(FormatName(format)), false) = (&self.schedule, self.to, self.list)
        else {
            output::print(&list())?;
            return Ok(Outcome::Done);
        };
        let (schedule, foreign) = load(path, self.unverified)?;
        let warnings = export::warnings(&schedule, foreign.as_deref());
        if !warnings.is_empty() && !self.unverified {
            return Err(usage(
                format!("{}: {}", path.display(), warnings.join("; ")),
                "--unverified exports it all the same, and what is written says so",
            ));
        }
        for warning in warnings.iter().filter(|_| !self.quiet) {
            output::note(&format!("warning: {warning}\n"));
        }
        let name = match &self.name {
            Some(name) => name.clone(),
            None => export::identifier(&schedule.name).ok_or_else(|| {
                usage(
                    format!("no identifier can be made of the aircraft's name '{}'", schedule.name),
                    "--name gives one",
                )
            })?,
        };
        let mut options = Options {
            name,
            step: quantity("step", &self.step, Kind::Time)?,
            precision: match self.precision {
                PrecisionName::Float => Precision::Float,
                PrecisionName::Double => Precision::Double,
            },
            speed: quantity("speed", &self.speed, Kind::Airspeed)?,
            binaries: Vec::new(),
        };
        if format == Format::Fmu && !self.cc.is_empty() {
            let platforms = self.platforms()?;
            let sources = export::binary_sources(&schedule, warnings.clone(), &options)
                .map_err(|e| export_error(&e))?;
            for (cc, platform) in self.cc.iter().zip(platforms) {
                options.binaries.push((platform, build(cc, platform, &sources)?));
            }
        }
        let files =
            export::export(&schedule, warnings, format, &options).map_err(|e| export_error(&e))?;
        let files: Vec<(String, Vec<u8>)> = files.into_iter().map(|f| (f.name, f.bytes)).collect();
        match (&self.output, files.as_slice()) {
            (Some(directory), _) => {
                let _lock = super::designs::lock(directory)?;
                output::write_set(directory, &files, self.force)?;
            }
            (None, [(_, bytes)]) if std::str::from_utf8(bytes).is_ok() => {
                output::print(&String::from_utf8_lossy(bytes))?;
            }
            (None, _) => {
                let names: Vec<&str> = files.iter().map(|f| f.0.as_str()).collect();
                return Err(usage(
                    format!("'{}' is {}", format.about().name, names.join(" and ")),
                    "-o DIR says where to write",
                ));
            }
        }
        Ok(Outcome::Done)
    }
}

impl Export {
    /// What each compiler builds for, each platform once.
    fn platforms(&self) -> Result<Vec<Platform>, CliError> {
        if !self.platform.is_empty() && self.platform.len() != self.cc.len() {
            return Err(usage(
                format!("{} --platform for {} --cc", self.platform.len(), self.cc.len()),
                "give one --platform for each --cc, in the same order, or none",
            ));
        }
        let mut platforms = Vec::new();
        for (k, cc) in self.cc.iter().enumerate() {
            let platform = match self.platform.get(k) {
                Some(PlatformName(platform)) => *platform,
                None => target(cc)?,
            };
            if platforms.contains(&platform) {
                return Err(usage(
                    format!("two compilers are for {}", platform.folder()),
                    "give one --cc a platform; --platform says which where a compiler does not",
                ));
            }
            platforms.push(platform);
        }
        Ok(platforms)
    }
}

/// The platform that a compiler is for, as it says.
fn target(cc: &str) -> Result<Platform, CliError> {
    let asked = Command::new(cc)
        .arg("-dumpmachine")
        .output()
        .map_err(|source| CliError::Io { path: PathBuf::from(cc), source })?;
    let said = String::from_utf8_lossy(&asked.stdout);
    Platform::of_target(said.trim()).ok_or_else(|| {
        let names: Vec<&str> = Platform::ALL.iter().map(|p| p.folder()).collect();
        CliError::Usage {
            message: format!(
                "{cc}: its target is '{}', for which FMI 2.0 has no platform",
                coaxdesign::problem::visible(said.trim(), false)
            ),
            help: format!("--platform says which it is: {}", names.join(", ")),
        }
    })
}

/// The forms, a line each.
fn list() -> String {
    let mut lines = vec![["FORMAT", "CONTENT", "FILES", "PROVEN IN"].map(String::from).to_vec()];
    lines.extend(
        Format::ALL
            .iter()
            .map(|a| [a.name, a.content, a.files, a.proven_in].map(String::from).to_vec()),
    );
    let width = |c: usize| lines.iter().map(|l| l[c].len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..4).map(width).collect();
    lines
        .iter()
        .map(|l| {
            let cells: Vec<String> =
                l.iter().zip(&widths).map(|(cell, w)| format!("{cell:<w$}")).collect();
            cells.join("  ").trim_end().to_string() + "\n"
        })
        .collect()
}

fn export_error(error: &ExportError) -> CliError {
    usage(error.to_string(), "look at the schedule with `coaxdesign verify`, and at the options")
}

/// Reads a schedule, or the one in a directory. With `any_schema` another
/// schema is read as far as it fits ours; its name is then given too.
///
/// # Errors
/// A file that cannot be read, or holds no schedule.
pub(super) fn load(path: &Path, any_schema: bool) -> Result<(Schedule, Option<String>), CliError> {
    let path = if path.is_dir() { path.join("schedule.json") } else { path.to_path_buf() };
    let text = std::fs::read_to_string(&path)
        .map_err(|source| CliError::Io { path: path.clone(), source })?;
    let refused = |error: schedule::ScheduleError| {
        let help = match &error {
            schedule::ScheduleError::Schema { .. } => {
                "--unverified reads it all the same, as far as it fits"
            }
            _ => "a schedule is written by `coaxdesign tune-gains -o DIR`",
        };
        usage(format!("{}: {error}", path.display()), help)
    };
    match Schedule::from_json(&text) {
        Err(schedule::ScheduleError::Schema { found }) if any_schema => {
            let mut value: serde_json::Value =
                serde_json::from_str(&text).map_err(|e| refused(e.into()))?;
            value["schema"] = schedule::SCHEMA.into();
            let schedule = Schedule::from_json(&value.to_string()).map_err(refused)?;
            Ok((schedule, Some(found)))
        }
        other => Ok((other.map_err(refused)?, None)),
    }
}

/// A shared object of C sources.
fn build(cc: &str, platform: Platform, sources: &[export::File]) -> Result<Vec<u8>, CliError> {
    let io = |path: &Path| {
        let path = path.to_path_buf();
        move |source| CliError::Io { path, source }
    };
    let directory = tempfile::tempdir().map_err(io(Path::new("temporary directory")))?;
    let mut command = Command::new(cc);
    command.current_dir(directory.path());
    command.args(["-std=c99", "-O2", "-shared", "-o", "law.so"]);
    match platform {
        // All code is position independent there; no library of the compiler's is asked for.
        Platform::Win32 | Platform::Win64 => command.arg("-static-libgcc"),
        _ => command.arg("-fPIC"),
    };
    for file in sources {
        let path = directory.path().join(&file.name);
        std::fs::write(&path, &file.bytes).map_err(io(&path))?;
        if file.name.ends_with(".c") {
            command.arg(&file.name);
        }
    }
    let result = command.arg("-lm").output().map_err(io(Path::new(cc)))?;
    if !result.status.success() {
        return Err(usage(
            format!("{cc} failed: {}", String::from_utf8_lossy(&result.stderr).trim()),
            "--cc names a C99 compiler",
        ));
    }
    let path = directory.path().join("law.so");
    std::fs::read(&path).map_err(io(&path))
}
