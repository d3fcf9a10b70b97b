//! `coaxdesign design`.
//!
//! The stages are the subcommands, run one after the other as a user would run
//! them by hand, each in a process of its own. What a stage was made from is
//! noted as hashes in `design.json`, so that it is not run again while nothing
//! it depends on has changed.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::process::{Command as Process, Stdio};
use std::time::Instant;

use clap::Args;
use serde::{Deserialize, Serialize};

use super::args::{ProblemArgs, STAGE, Units, UnitsArgs, builtin_name};
use super::export::FormatName;
use super::tune::{SpecArgs, usage};
use super::{CliError, Outcome, output, version};
use coaxdesign::pipeline::problem_hash;
use coaxdesign::problem::BUILTIN;
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::schedule::hash;
use coaxdesign::units::{Kind, System};

/// Schema of `design.json`.
const SCHEMA: &str = "coaxdesign.design/1";
/// The manoeuvre that every design flies: that of the reference paper's Fig. 17.
const MANEUVER: &str = "accel-climb-turn";
/// The note of a design.
const NOTE: &str = "design.json";

/// Run the whole pipeline: trim, linear models, tuning and verification, a flight, exports, report
///
/// Each stage is a subcommand that can also be run by itself, and leaves its files in the
/// directory. A stage whose inputs have not changed since is skipped; after an interruption the
/// same command goes on where it stopped.
#[derive(Debug, Args)]
pub struct Design {
    #[command(flatten)]
    problem: ProblemArgs,
    /// Specification file [default: the built-in Level 1 targets]
    #[arg(long, value_name = "SPEC")]
    spec: Option<PathBuf>,
    /// Directory of the design
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// True airspeeds of the trim curves: FIRST:LAST:STEP with a unit, or a list
    #[arg(long, value_name = "SPEEDS", default_value = "0:90:5kt")]
    speeds: String,
    /// Forms of the schedule to export
    #[arg(
        long,
        value_enum,
        value_name = "FORMATS",
        value_delimiter = ',',
        default_value = "json,csv,c,matlab,python,jsbsim"
    )]
    exports: Vec<FormatName>,
    /// Run every stage, changed or not
    #[arg(long)]
    again: bool,
    /// Show the commands of the stages, and run none
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    units: UnitsArgs,
    /// Show no progress and no warnings
    #[arg(short, long)]
    quiet: bool,
    /// Threads to compute with; results do not depend on it [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// A file that a design refers to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Reference {
    /// A built-in one, by name.
    Builtin(String),
    /// A path, relative to the design's directory where both are on one disk.
    File(String),
}

/// How a stage ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Ended {
    /// The goal is reached.
    Done,
    /// There is a result, short of the goal.
    GoalMissed,
}

/// What is known of a stage that has run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    /// Hash of all that it was made from.
    inputs: String,
    /// Hash of every file it made.
    outputs: BTreeMap<String, String>,
    /// How it ended.
    ended: Ended,
}

/// `design.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Note {
    /// [`SCHEMA`].
    schema: String,
    /// The problem.
    problem: Reference,
    /// The specification; `null` for the built-in one.
    specification: Option<Reference>,
    /// Stages by name.
    stages: BTreeMap<String, Record>,
}

/// A stage: a subcommand with its arguments, and files.
#[derive(Default)]
struct Stage {
    name: String,
    /// Arguments but for files, which vary from place to place.
    arguments: Vec<String>,
    /// Further arguments: files.
    files: Vec<String>,
    /// Whether the specification matters to it.
    specified: bool,
    /// Files of the design that it reads.
    reads: Vec<String>,
    /// Files of the design that it writes.
    writes: Vec<String>,
    /// Directory of the design that it fills, where it chooses the names.
    fills: Option<String>,
    /// Whether it knows `--quiet` and `--threads`.
    computes: bool,
}

/// What a design notes of its inputs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Noted {
    /// Problem file or built-in name; none where nothing is noted.
    pub problem: Option<PathBuf>,
    /// Specification file; none for the built-in one.
    pub specification: Option<PathBuf>,
}

impl Noted {
    /// Reads the note of a design, if there is one.
    ///
    /// # Errors
    /// A note that is none.
    pub fn read(directory: &Path) -> Result<Self, CliError> {
        let Some(note) = Note::read(directory)? else { return Ok(Self::default()) };
        let path = |reference: &Reference| match reference {
            Reference::Builtin(name) => PathBuf::from(name),
            Reference::File(path) => tidy(&directory.join(path)),
        };
        Ok(Self {
            problem: Some(path(&note.problem)),
            specification: note.specification.as_ref().map(path),
        })
    }
}

impl Note {
    fn read(directory: &Path) -> Result<Option<Self>, CliError> {
        let path = directory.join(NOTE);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(source) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(CliError::Io { path, source }),
        };
        let wrong = |what: String| {
            usage(format!("{}: {what}", path.display()), "delete it, and the design is made anew")
        };
        let note: Self = serde_json::from_str(&text)
            .map_err(|error| wrong(format!("not the note of a design: {error}")))?;
        if note.schema != SCHEMA {
            return Err(wrong(format!("the schema is '{}', expected '{SCHEMA}'", note.schema)));
        }
        Ok(Some(note))
    }

    fn write(&self, directory: &Path) -> Result<(), CliError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| CliError::Internal(error.to_string()))?;
        output::write_whole(&directory.join(NOTE), (text + "\n").as_bytes(), true)
    }
}

impl Design {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        // A mistake in a file is said at once, not after the first stages.
        let loaded = self.problem.load_with_warnings(self.quiet)?;
        let requirements = SpecArgs::of(self.spec.clone()).load()?;
        let spec = &requirements.specification;
        super::trim::parse_speeds(&self.speeds)?;
        let breakpoints: Vec<String> = spec
            .speeds
            .iter()
            .map(|v| output::significant(Kind::Airspeed.from_si(*v, System::Us), 12))
            .collect();
        let stages = self.stages(&breakpoints.join(","));
        if self.dry_run {
            let lines: Vec<String> = stages.iter().map(Stage::line).collect();
            output::print(&(lines.join("\n") + "\n"))?;
            return Ok(Outcome::Done);
        }
        let directory = &self.output;
        std::fs::create_dir_all(directory)
            .map_err(|source| CliError::Io { path: directory.clone(), source })?;
        let sources = [problem_hash(&loaded), requirements.hash()];
        let before = if self.again { None } else { Note::read(directory)? };
        let mut note = Note {
            schema: SCHEMA.into(),
            problem: self.problem_reference(),
            specification: self.spec.as_ref().map(|p| Reference::File(from_to(directory, p))),
            stages: before.map(|note| note.stages).unwrap_or_default(),
        };
        note.stages.retain(|name, _| stages.iter().any(|s| s.name == *name));
        let mut table = Table::new(
            &format!("{}: {}", loaded.problem.name, directory.display()),
            vec![
                Column::text("stage"),
                Column::text("outcome"),
                Column::number("time", "s", Digits::Decimals(1)),
                Column::text("files"),
            ],
        );
        let start = Instant::now();
        let mut missed = false;
        for stage in &stages {
            let key = stage.key(directory, &sources);
            let fresh = note.stages.get(&stage.name).is_some_and(|record| {
                record.inputs == key
                    && !record.outputs.is_empty()
                    && stage.writes.iter().all(|file| record.outputs.contains_key(file))
                    && record
                        .outputs
                        .iter()
                        .all(|(file, known)| hash_of(&directory.join(file)).as_ref() == Some(known))
            });
            let clock = Instant::now();
            if !fresh {
                note.stages.remove(&stage.name);
                let ended = self.run_stage(stage, directory)?;
                let record = stage.record(directory, key, ended)?;
                note.stages.insert(stage.name.clone(), record);
                note.write(directory)?;
            }
            let ended = note.stages.get(&stage.name).map_or(Ended::Done, |r| r.ended);
            missed |= ended == Ended::GoalMissed;
            let (word, highlight) = match ended {
                Ended::Done => ("done", Highlight::Good),
                Ended::GoalMissed => ("goal missed", Highlight::Bad),
            };
            let word = if fresh { format!("{word}, unchanged") } else { word.into() };
            table.row([
                Cell::from(stage.name.as_str()),
                Cell::from(word).highlight(highlight),
                if fresh { Cell::empty() } else { clock.elapsed().as_secs_f64().into() },
                stage.fills.as_ref().unwrap_or(&stage.writes.join(", ")).as_str().into(),
            ]);
        }
        note.write(directory)?;
        if !self.quiet {
            let total = start.elapsed().as_secs_f64();
            let text = table.to_text(Coloring::for_stdout());
            output::print(&format!("{text}\n{total:.1} s in all.\n"))?;
        }
        Ok(if missed { Outcome::GoalMissed } else { Outcome::Done })
    }

    fn problem_reference(&self) -> Reference {
        match &self.problem.file {
            None => Reference::Builtin(BUILTIN[0].into()),
            Some(path) => match builtin_name(path) {
                Some(name) => Reference::Builtin(name.into()),
                None => Reference::File(from_to(&self.output, path)),
            },
        }
    }

    /// The stages, with the breakpoints of the schedule in kt.
    fn stages(&self, breakpoints: &str) -> Vec<Stage> {
        let text = |words: &[&str]| words.iter().map(|w| (*w).to_string()).collect::<Vec<_>>();
        let path = |name: &str| self.output.join(name).display().to_string();
        let flight = format!("{}/{MANEUVER}.json", super::report::FLIGHTS);
        let problem = self
            .problem
            .file
            .as_ref()
            .map_or_else(|| BUILTIN[0].to_string(), |file| file.display().to_string());
        let spec: Vec<String> = self
            .spec
            .iter()
            .flat_map(|s| ["--spec".to_string(), s.display().to_string()])
            .collect();
        let units = match self.units.units {
            Units::Us => "us",
            Units::Si => "si",
        };
        let mut gains = vec![problem.clone(), "-o".into(), self.output.display().to_string()];
        gains.extend(spec.clone());
        let mut report =
            vec![self.output.display().to_string(), "--problem".into(), problem.clone()];
        report.extend(spec);
        report.extend(["-o".into(), path("report.html")]);
        let mut stages = vec![
            Stage {
                name: "trim".into(),
                computes: true,
                arguments: text(&[
                    "trim",
                    "--speeds",
                    &self.speeds,
                    "--format",
                    "json",
                    "--units",
                    units,
                ]),
                files: vec![problem.clone(), "-o".into(), path("trim.json")],
                writes: vec!["trim.json".into()],
                ..Stage::default()
            },
            Stage {
                name: "models".into(),
                computes: true,
                arguments: text(&[
                    "linearize",
                    "--speeds",
                    &format!("{breakpoints} kt"),
                    "--reduce",
                    "residualize",
                    "--format",
                    "json",
                    "--units",
                    "si",
                ]),
                files: vec![problem.clone(), "-o".into(), path("models.json")],
                writes: vec!["models.json".into()],
                ..Stage::default()
            },
            Stage {
                name: "gains".into(),
                computes: true,
                arguments: text(&["tune-gains"]),
                files: gains,
                specified: true,
                writes: text(&["schedule.json", "verification.json"]),
                ..Stage::default()
            },
            Stage {
                name: "simulation".into(),
                computes: true,
                arguments: text(&["simulate", "-m", MANEUVER, "--interval", "0.05 s"]),
                files: vec![
                    self.output.display().to_string(),
                    "--problem".into(),
                    problem.clone(),
                    "-o".into(),
                    path(&flight),
                ],
                reads: text(&["schedule.json"]),
                writes: vec![flight.clone()],
                ..Stage::default()
            },
            Stage {
                name: "report".into(),
                computes: true,
                arguments: text(&["report", "--speeds", &self.speeds, "--units", units]),
                files: report,
                specified: true,
                reads: text(&["schedule.json", "verification.json", &flight]),
                writes: vec!["report.html".into()],
                ..Stage::default()
            },
        ];
        let names = self.exports.iter().map(|format| format.0.about().name);
        let exports = names.map(|format| Stage {
            name: format!("export {format}"),
            // What misses a requirement is exported too, and says so.
            arguments: text(&["export", "--to", format, "--unverified"]),
            files: text(&[
                &self.output.display().to_string(),
                "-o",
                &path(&format!("export/{format}")),
            ]),
            reads: text(&["schedule.json"]),
            fills: Some(format!("export/{format}")),
            ..Stage::default()
        });
        let last = stages.len() - 1;
        stages.splice(last..last, exports);
        stages
    }

    /// Runs a stage in a process of its own.
    fn run_stage(&self, stage: &Stage, directory: &Path) -> Result<Ended, CliError> {
        if !self.quiet {
            output::note(&format!("{} ...\n", stage.name));
        }
        let parents = stage.writes.iter().filter_map(|f| Path::new(f).parent());
        for folder in parents.chain(stage.fills.as_deref().map(Path::new)) {
            let path = directory.join(folder);
            std::fs::create_dir_all(&path).map_err(|source| CliError::Io { path, source })?;
        }
        let program = std::env::current_exe()
            .map_err(|source| CliError::Io { path: "this program".into(), source })?;
        let mut process = Process::new(&program);
        process.args(stage.command().split_off(1)).arg("--force").env(STAGE, &stage.name);
        if self.quiet && stage.computes {
            process.arg("--quiet");
        }
        if let Some(threads) = self.threads.filter(|_| stage.computes) {
            process.args(["--threads", &threads.to_string()]);
        }
        tracing::info!(stage = stage.name.as_str(), command = stage.line(), "run");
        // Tables are in the report; messages are for whoever waits.
        let status = process
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .status()
            .map_err(|source| CliError::Io { path: program, source })?;
        match status.code() {
            Some(0) => Ok(Ended::Done),
            Some(1) if stage.writes.iter().all(|f| directory.join(f).exists()) => {
                Ok(Ended::GoalMissed)
            }
            Some(1) => Err(CliError::Missed(format!(
                "stage {}: there is no result; run it by itself to see more: {}",
                stage.name,
                stage.line()
            ))),
            Some(2 | 3) => Err(usage(
                format!("stage {} could not run", stage.name),
                "what it says is above; the same command goes on from here",
            )),
            Some(code) => {
                Err(CliError::Internal(format!("stage {} ended with {code}", stage.name)))
            }
            None => Err(CliError::Missed(format!(
                "stage {} was interrupted; the same command goes on from here",
                stage.name
            ))),
        }
    }
}

impl Stage {
    /// The command that a user would write.
    fn command(&self) -> Vec<String> {
        let (first, rest) = self.arguments.split_at(1.min(self.arguments.len()));
        let words = first.iter().chain(&self.files).chain(rest).cloned();
        std::iter::once("coaxdesign".to_string()).chain(words).collect()
    }

    /// That command as it is typed.
    fn line(&self) -> String {
        let quoted = |word: &String| {
            if word.contains(' ') { format!("\"{word}\"") } else { word.clone() }
        };
        self.command().iter().map(quoted).collect::<Vec<_>>().join(" ")
    }

    /// Hash of all that the stage is made from: program, choices, problem,
    /// specification, files of earlier stages.
    fn key(&self, directory: &Path, sources: &[String; 2]) -> String {
        let mut parts = vec![version::LONG.to_string()];
        parts.extend(self.arguments.iter().cloned());
        let [problem, specification] = sources;
        parts.push(problem.clone());
        if self.specified {
            parts.push(specification.clone());
        }
        for file in &self.reads {
            parts.push(file.clone());
            parts.push(hash_of(&directory.join(file)).unwrap_or_default());
        }
        hash(parts.iter().map(String::as_str))
    }

    fn record(&self, directory: &Path, inputs: String, ended: Ended) -> Result<Record, CliError> {
        let mut outputs = BTreeMap::new();
        let mut files = self.writes.clone();
        if let Some(folder) = &self.fills {
            let place = directory.join(folder);
            let fault = |source| CliError::Io { path: place.clone(), source };
            for entry in std::fs::read_dir(&place).map_err(fault)? {
                let name = entry.map_err(fault)?.file_name();
                files.push(format!("{folder}/{}", name.to_string_lossy()));
            }
        }
        for file in &files {
            let known = hash_of(&directory.join(file)).ok_or_else(|| {
                CliError::Internal(format!("stage {} wrote no {file}", self.name))
            })?;
            outputs.insert(file.clone(), known);
        }
        Ok(Record { inputs, outputs, ended })
    }
}

/// Hash of a text file; none where it cannot be read.
fn hash_of(path: &Path) -> Option<String> {
    let bytes = std::fs::read(path).ok()?;
    Some(hash([String::from_utf8_lossy(&bytes).as_ref()]))
}

/// A path from a directory to a file, with forward slashes; the path as it is
/// where there is none.
fn from_to(directory: &Path, file: &Path) -> String {
    let whole = |path: &Path| std::path::absolute(path).ok().map(|p| tidy(&p));
    let (Some(from), Some(to)) = (whole(directory), whole(file)) else {
        return file.display().to_string();
    };
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return to.display().to_string();
    }
    let up = from.components().skip(common).map(|_| "..".to_string());
    let down = to.components().skip(common).map(|c| c.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// A path without `.` and, where it can be seen, `..`.
fn tidy(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir
                if matches!(out.components().next_back(), Some(Component::Normal(_))) =>
            {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_from_a_design_to_its_files() {
        assert_eq!(from_to(Path::new("designs/mine"), Path::new("mine.toml")), "../../mine.toml");
        assert_eq!(from_to(Path::new("/a/b"), Path::new("/a/c/d.toml")), "../c/d.toml");
        assert_eq!(tidy(Path::new("designs/mine/../../mine.toml")), Path::new("mine.toml"));
        assert_eq!(tidy(Path::new("../x/./y")), Path::new("../x/y"));
    }

    #[test]
    fn a_stage_is_another_when_anything_it_reads_changes() {
        let directory = tempfile::tempdir().unwrap();
        let stage = |argument: &str| Stage {
            name: "report".into(),
            arguments: vec!["report".into(), argument.into()],
            specified: argument != "unspecified",
            reads: vec!["schedule.json".into()],
            writes: vec!["report.html".into()],
            ..Stage::default()
        };
        let sources = ["a".to_string(), "b".to_string()];
        let key =
            |argument: &str, sources: &[String; 2]| stage(argument).key(directory.path(), sources);
        let first = key("x", &sources);
        assert_eq!(first, key("x", &sources));
        assert_ne!(first, key("y", &sources));
        let respecified = ["a".to_string(), "c".to_string()];
        assert_ne!(first, key("x", &respecified));
        assert_eq!(key("unspecified", &sources), key("unspecified", &respecified));
        std::fs::write(directory.path().join("schedule.json"), "{}").unwrap();
        assert_ne!(first, key("x", &sources));
    }
}
