//! `coaxdesign design`.
//!
//! The stages are calls of the library's pipeline, one after the other; the
//! subcommands do the same one by one. What a stage was made from is noted as
//! hashes in `design.json`, so that it is not run again while nothing it
//! depends on has changed.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::args::{ModelsArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::designs::{Chosen, SourceArgs, lock};
use super::export::{Export, FormatName};
use super::fly::{CONTROL_RATE, FlyArgs, STEPS};
use super::linearize::joined;
use super::report::{FLIGHTS, Inputs, page};
use super::simulate::recorded;
use super::trim::{failures, json_text, parse_speeds, trim_all};
use super::tune::{SpecArgs, design_files, explanations_text, left_out_text, misses_text};
use super::watch::Watch;
use super::{CliError, Outcome, output, version};
use coaxdesign::linear::io::set_to_json;
use coaxdesign::pipeline::directory::{Ended, MANEUVERS, Note, Part, Record, file_hash};
use coaxdesign::pipeline::{PipelineError, TuneOptions, models, tune};
use coaxdesign::problem::BUILTIN;
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::schedule::hash;
use coaxdesign::simulate::maneuver;
use coaxdesign::trim::FlightCondition;
use coaxdesign::units::{Kind, System};

/// The manoeuvre that designs fly unless another is asked for: that of the
/// reference paper's Fig. 17.
const MANEUVER: &str = "accel-climb-turn";
/// Time between two rows of its history.
const INTERVAL: &str = "0.05 s";
/// Control periods in that time.
const EVERY: u64 = 5;

/// Run the whole pipeline: trim, linear models, tuning and verification, a flight, exports, report
///
/// Each stage can also be run by itself: --dry-run shows how. The directory holds all that made
/// the design, and can be moved. A stage whose inputs have not changed since is skipped; after an
/// interruption the same command goes on where it stopped. A design that is there keeps its
/// aircraft and its specification unless others are named.
#[derive(Debug, Args)]
pub struct Design {
    #[command(flatten)]
    problem: ProblemArgs,
    /// Specification file [default: that of the design in -o, else the built-in Level 1 targets]
    #[arg(long, value_name = "SPEC")]
    spec: Option<PathBuf>,
    /// Directory of the design
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// True airspeeds of the trim curves: FIRST:LAST:STEP with a unit, or a list [default: from 0
    /// to the highest speed of the specification]
    #[arg(long, value_name = "SPEEDS")]
    speeds: Option<String>,
    /// Manoeuvre to fly: a file, or the name of a built-in one [default: that of the design in -o,
    /// else accel-climb-turn]
    #[arg(short, long, value_name = "MANEUVER")]
    maneuver: Option<PathBuf>,
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
    /// Show the commands that do the same stage by stage, and run none
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    run: RunArgs,
}

/// What the arguments come to, with the aircraft and the specification.
struct Plan {
    speeds: String,
    /// Units of the results.
    units: System,
    /// Name of the manoeuvre, its text, where it came from, and how a command names
    /// it.
    name: String,
    text: String,
    origin: String,
    command: String,
}

impl Plan {
    /// The manoeuvre's file in the design.
    fn maneuver_file(&self) -> String {
        format!("{MANEUVERS}/{}.toml", self.name)
    }

    /// The flight's file in the design.
    fn flight_file(&self) -> String {
        format!("{FLIGHTS}/{}.json", self.name)
    }
}

/// Name of a system of units, as `--units` takes it.
fn unit_name(units: System) -> &'static str {
    match units {
        System::Us => "us",
        System::Si => "si",
    }
}

/// Speeds of trim curves up to the highest of a specification or schedule, m/s, some twelve of
/// them or more.
pub(super) fn default_speeds(highest: f64) -> String {
    let top = Kind::Airspeed.from_si(highest, System::Us);
    let steps = [5.0, 2.0, 1.0, 0.5, 0.2, 0.1];
    let step = steps.into_iter().find(|step| top / step > 12.0 - 1e-9).unwrap_or(0.1);
    // Rounding must not take the last speed away.
    let last = ((top / step + 1e-6).floor() * step * 10.0).round() / 10.0;
    format!("0:{last}:{step}kt")
}

/// What a stage does.
#[derive(Debug, Clone, Copy)]
enum Work {
    Trim,
    Models,
    Gains,
    Flight,
    Export(FormatName),
    Report,
}

/// A stage: what it does, from what, and the files of the design that it makes.
#[derive(Debug)]
struct Stage {
    name: String,
    work: Work,
    /// The command that does the same.
    command: Vec<String>,
    /// Choices that shape its result.
    choices: Vec<String>,
    /// Whether the specification matters to it.
    specified: bool,
    /// Files of the design that it reads.
    reads: Vec<String>,
    /// Files of the design that it writes.
    writes: Vec<String>,
    /// Directory of the design that it fills, where it chooses the names.
    fills: Option<String>,
}

impl Design {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        let spec = SpecArgs::of(self.spec.clone());
        if let Some(speeds) = &self.speeds {
            parse_speeds(speeds)?;
        }
        let directory = &self.output;
        if self.dry_run {
            let chosen = Chosen::new(&self.problem, &spec, Some(directory), self.run.quiet)?;
            let plan = self.plan(&chosen)?;
            let lines: Vec<String> = self
                .stages(&chosen, &plan)
                .iter()
                .map(|s| output::shell_line(&s.command))
                .collect();
            output::print(&(lines.join("\n") + "\n"))?;
            return Ok(Outcome::Done);
        }
        let _lock = lock(directory)?;
        // A mistake in a file is said at once, not after the first stages, and
        // so is a warning.
        let chosen = Chosen::new(&self.problem, &spec, Some(directory), self.run.quiet)?;
        let plan = self.plan(&chosen)?;
        let stages = self.stages(&chosen, &plan);
        let mut note = self.note(&chosen, &stages, &plan);
        let maneuver = (plan.maneuver_file(), plan.text.as_bytes().to_vec());
        chosen.write(directory, &note, vec![maneuver], chosen.is_design())?;
        let mut table = Table::new(
            &format!("{}: {}", chosen.loaded.problem.name, directory.display()),
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
            let key = stage.key(directory, &note);
            let fresh = note.stages.get(&stage.name).is_some_and(|record| {
                record.is_fresh(directory, &key)
                    && stage.writes.iter().all(|file| record.outputs.contains_key(file))
            });
            let clock = Instant::now();
            if !fresh {
                note.stages.remove(&stage.name);
                if !self.run.quiet {
                    output::note(&format!("{} ...\n", stage.name));
                }
                tracing::info!(stage = stage.name.as_str(), "run");
                let ended = match self.work(stage.work, &chosen, &plan)? {
                    Outcome::Done => Ended::Done,
                    Outcome::GoalMissed => Ended::GoalMissed,
                };
                let record = Record::of(directory, key, &stage.files(directory)?, ended)?;
                note.stages.insert(stage.name.clone(), record);
                chosen.write(directory, &note, Vec::new(), true)?;
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
        if !self.run.quiet {
            let total = start.elapsed().as_secs_f64();
            let text = table.to_text(Coloring::for_stdout());
            output::print(&format!(
                "specification {}\n{text}\n{total:.1} s in all.\n",
                note.specification.origin
            ))?;
        }
        Ok(if missed { Outcome::GoalMissed } else { Outcome::Done })
    }

    fn plan(&self, chosen: &Chosen) -> Result<Plan, CliError> {
        let highest = chosen.requirements.specification.speeds.iter().copied().fold(0.0, f64::max);
        let speeds = self.speeds.clone().unwrap_or_else(|| default_speeds(highest));
        let built_in = |name: &str| {
            let (_, text) = maneuver::BUILTIN.iter().find(|(known, _)| *known == name)?;
            Some(((*text).to_string(), format!("{name} (built in)"), name.to_string()))
        };
        let of_file = |path: &Path| -> Result<_, CliError> {
            output::is_input(path);
            // A mistake in it is said at once.
            maneuver::load(path)?;
            let fault = |source| CliError::Io { path: path.to_path_buf(), source };
            let text = std::fs::read_to_string(path).map_err(fault)?;
            Ok((text, path.display().to_string(), path.display().to_string()))
        };
        let stem = |path: &Path| {
            path.file_stem().map_or_else(|| MANEUVER.into(), |s| s.to_string_lossy().into_owned())
        };
        let kept = chosen.note().maneuvers.first().cloned();
        let (name, (text, origin, command)) = match (&self.maneuver, kept) {
            (Some(path), _) => {
                let found = if path.exists() { None } else { path.to_str().and_then(built_in) };
                (stem(path), found.map_or_else(|| of_file(path), Ok)?)
            }
            (None, Some(part)) => {
                let path = self.output.join(&part.file);
                let (text, _, command) = of_file(&path)?;
                let name = stem(&path);
                let command = built_in(&name).filter(|b| b.0 == text).map_or(command, |b| b.2);
                (name, (text, part.origin, command))
            }
            (None, None) => {
                let none = || CliError::Internal(format!("there is no manoeuvre {MANEUVER}"));
                (MANEUVER.into(), built_in(MANEUVER).ok_or_else(none)?)
            }
        };
        let units = match chosen.note().units() {
            Some(units) if self.units.units.is_none() => units,
            _ => self.units.of(Some(&chosen.loaded.problem)),
        };
        Ok(Plan { speeds, units, name, text, origin, command })
    }

    /// The note to begin with: what is known of stages that still exist.
    fn note(&self, chosen: &Chosen, stages: &[Stage], plan: &Plan) -> Note {
        let mut note = chosen.note();
        if self.again {
            note.stages.clear();
        }
        note.stages.retain(|name, _| stages.iter().any(|s| s.name == *name));
        note.maneuvers = vec![Part {
            file: plan.maneuver_file(),
            origin: plan.origin.clone(),
            hash: hash([plan.text.as_str()]),
        }];
        let exports: Vec<&str> = self.exports.iter().map(|f| f.0.about().name).collect();
        note.options = [
            ("speeds", plan.speeds.clone()),
            ("units", unit_name(plan.units).into()),
            ("exports", exports.join(",")),
        ]
        .map(|(key, value)| (key.to_string(), value))
        .into();
        note
    }

    /// The stages, in order.
    fn stages(&self, chosen: &Chosen, plan: &Plan) -> Vec<Stage> {
        let breakpoints: Vec<String> = chosen
            .requirements
            .specification
            .speeds
            .iter()
            .map(|v| output::significant(Kind::Airspeed.from_si(*v, System::Us), 12))
            .collect();
        let breakpoints = format!("{} kt", breakpoints.join(","));
        let design = self.output.display().to_string();
        let path = |name: &str| self.output.join(name).display().to_string();
        let flight = plan.flight_file();
        let file = match &self.problem.file {
            Some(file) => file.display().to_string(),
            None if chosen.keeps_aircraft() => design.clone(),
            None => BUILTIN[0].to_string(),
        };
        let units = unit_name(plan.units);
        let words = |list: &[&str]| list.iter().map(|w| (*w).to_string()).collect::<Vec<_>>();
        let mut gains = words(&["tune-gains"]);
        if !chosen.keeps_aircraft() {
            gains.push(file.clone());
        }
        gains.extend(words(&["-o", &design]));
        gains.extend(self.spec.iter().flat_map(|s| ["--spec".into(), s.display().to_string()]));
        let stage = |name: &str, work, command: &[String], writes: &[&str]| Stage {
            name: name.into(),
            work,
            command: [&["coaxdesign".to_string()], command].concat(),
            choices: Vec::new(),
            specified: false,
            reads: Vec::new(),
            writes: words(writes),
            fills: None,
        };
        let mut stages = vec![
            Stage {
                choices: words(&[&plan.speeds, units]),
                ..stage(
                    "trim",
                    Work::Trim,
                    &words(&[
                        "trim",
                        &file,
                        "-o",
                        &path("trim.json"),
                        "--speeds",
                        &plan.speeds,
                        "--format",
                        "json",
                        "--units",
                        units,
                    ]),
                    &["trim.json"],
                )
            },
            Stage {
                choices: words(&[&breakpoints]),
                ..stage(
                    "models",
                    Work::Models,
                    &words(&[
                        "linearize",
                        &file,
                        "-o",
                        &path("models.json"),
                        "--speeds",
                        &breakpoints,
                        "--reduce",
                        "residualize",
                        "--format",
                        "json",
                        "--units",
                        "si",
                    ]),
                    &["models.json"],
                )
            },
            Stage {
                specified: true,
                ..stage("gains", Work::Gains, &gains, &["schedule.json", "verification.json"])
            },
            Stage {
                reads: vec!["schedule.json".into(), plan.maneuver_file()],
                ..stage(
                    "simulation",
                    Work::Flight,
                    &words(&[
                        "simulate",
                        &design,
                        "-o",
                        &path(&flight),
                        "-m",
                        &plan.command,
                        "--interval",
                        INTERVAL,
                    ]),
                    &[&flight],
                )
            },
        ];
        for format in &self.exports {
            let name = format.0.about().name;
            let folder = format!("export/{name}");
            let command =
                words(&["export", &design, "-o", &path(&folder), "--to", name, "--unverified"]);
            stages.push(Stage {
                reads: words(&["schedule.json"]),
                fills: Some(folder),
                ..stage(&format!("export {name}"), Work::Export(*format), &command, &[])
            });
        }
        let report = words(&["report", &design, "--speeds", &plan.speeds, "--units", units]);
        stages.push(Stage {
            choices: words(&[&plan.speeds, units]),
            specified: true,
            reads: words(&["schedule.json", "verification.json", &flight]),
            ..stage("report", Work::Report, &report, &["report.html"])
        });
        stages
    }

    /// Runs a stage and writes its files.
    fn work(&self, work: Work, chosen: &Chosen, plan: &Plan) -> Result<Outcome, CliError> {
        let directory = &self.output;
        let watch = Watch::new(self.run.quiet);
        let problem = &chosen.loaded.problem;
        let write = |name: &str, text: &str| -> Result<(), CliError> {
            output::write_set(directory, &[(name.to_string(), text.as_bytes().to_vec())], true)
        };
        match work {
            Work::Trim => {
                let conditions: Vec<FlightCondition> =
                    parse_speeds(&plan.speeds)?.into_iter().map(FlightCondition::level).collect();
                let points = trim_all(problem, &conditions, &[true, false], self.run.quiet)?;
                write("trim.json", &json_text(problem, &points, plan.units)?)?;
                let failures = failures(&points, Some(plan.units));
                output::note(&failures);
                Ok(if failures.is_empty() { Outcome::Done } else { Outcome::GoalMissed })
            }
            Work::Models => {
                let speeds = &chosen.requirements.specification.speeds;
                let sets =
                    models(problem, speeds, &[true], &watch).map_err(|error| match error {
                        PipelineError::NoTrim(point) => CliError::Missed(format!(
                            "no models over speed, since a breakpoint of the specification does \
                             not trim: {}",
                            failures(&[vec![*point]], Some(plan.units))
                        )),
                        other => other.into(),
                    })?;
                let texts: Vec<String> =
                    sets.iter().map(|set| set_to_json(set, System::Si)).collect();
                write("models.json", &joined(&texts))?;
                Ok(Outcome::Done)
            }
            Work::Gains => {
                let options = TuneOptions::default();
                let tuned = tune(&chosen.loaded, &chosen.requirements, &options, &watch)?;
                output::write_set(directory, &design_files(&tuned)?, true)?;
                let met = tuned.verified.met();
                if !met {
                    let system = plan.units;
                    output::note(
                        &(explanations_text(&tuned.explanations, system)
                            + &misses_text(&tuned.verified.verification, system)
                            + &left_out_text(&tuned.verified.left_out, system)),
                    );
                }
                Ok(if met { Outcome::Done } else { Outcome::GoalMissed })
            }
            Work::Flight => {
                let fly = FlyArgs {
                    design: Some(directory.clone()),
                    maneuver: directory.join(plan.maneuver_file()),
                    models: ModelsArgs::default(),
                    sources: SourceArgs::default(),
                    model: Vec::new(),
                    seed: 0,
                    control_rate: CONTROL_RATE,
                    steps: STEPS,
                    pitch_rate_limit: None,
                };
                let (text, outcome) = recorded(&fly.ready(true)?, EVERY, &watch)?;
                write(&plan.flight_file(), &text)?;
                Ok(outcome)
            }
            Work::Export(format) => {
                let folder = directory.join("export").join(format.0.about().name);
                // The first says what there is to say of the schedule.
                let first = self.exports.first().is_some_and(|f| f.0 == format.0);
                let quiet = self.run.quiet || !first;
                Export::of(directory.clone(), format, folder, quiet).run()
            }
            Work::Report => {
                let inputs = Inputs::find(directory, &SourceArgs::default(), true)?;
                write("report.html", &page(&inputs, &plan.speeds, plan.units, self.run.quiet)?)?;
                Ok(Outcome::Done)
            }
        }
    }
}

impl Stage {
    /// Hash of all that the stage is made from: program, choices, problem,
    /// specification, files of earlier stages.
    fn key(&self, directory: &Path, note: &Note) -> String {
        let mut parts = vec![version::LONG.to_string(), self.name.clone()];
        parts.extend(self.choices.iter().cloned());
        parts.push(note.aircraft.problem.hash.clone());
        if self.specified {
            parts.push(note.specification.hash.clone());
        }
        for file in &self.reads {
            parts.push(file.clone());
            parts.push(file_hash(&directory.join(file)).unwrap_or_default());
        }
        hash(parts.iter().map(String::as_str))
    }

    /// Files that it has made.
    fn files(&self, directory: &Path) -> Result<Vec<String>, CliError> {
        let mut files = self.writes.clone();
        if let Some(folder) = &self.fills {
            let place = directory.join(folder);
            let fault = |source| CliError::Io { path: place.clone(), source };
            for entry in std::fs::read_dir(&place).map_err(fault)? {
                let name = entry.map_err(fault)?.file_name();
                let name = name.to_string_lossy();
                // The lock of the folder may be there, which is no result.
                if !name.starts_with('.') {
                    files.push(format!("{folder}/{name}"));
                }
            }
        }
        Ok(files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use coaxdesign::pipeline::Requirements;

    #[test]
    fn a_stage_is_another_when_anything_it_reads_changes() {
        let directory = tempfile::tempdir().unwrap();
        let stage = |choice: &str| Stage {
            name: "report".into(),
            work: Work::Report,
            command: Vec::new(),
            choices: vec![choice.into()],
            specified: choice != "unspecified",
            reads: vec!["schedule.json".into()],
            writes: vec!["report.html".into()],
            fills: None,
        };
        let problem = coaxdesign::problem::builtin().unwrap();
        let note = Note::new(&problem, &Requirements::builtin().unwrap());
        let key = |choice: &str, note: &Note| stage(choice).key(directory.path(), note);
        let first = key("x", &note);
        assert_eq!(first, key("x", &note));
        assert_ne!(first, key("y", &note));
        let mut other = note.clone();
        other.specification.hash = "c".into();
        assert_ne!(first, key("x", &other));
        assert_eq!(key("unspecified", &note), key("unspecified", &other));
        std::fs::write(directory.path().join("schedule.json"), "{}").unwrap();
        assert_ne!(first, key("x", &note));
    }

    /// Trim curves run to the highest speed of the specification, in round steps.
    #[test]
    fn trim_curves_end_where_the_specification_does() {
        let knots = |speed: f64| default_speeds(speed * coaxdesign::units::KNOT);
        assert_eq!(knots(90.0), "0:90:5kt");
        assert_eq!(knots(120.0), "0:120:5kt");
        assert_eq!(knots(64.0), "0:60:5kt");
        assert_eq!(default_speeds(10.0), "0:19:1kt");
        assert_eq!(knots(0.0), "0:0:0.1kt");
        assert!(parse_speeds(&knots(2.0)).unwrap().len() > 10);
    }

    /// The interval that the command shows is the one that is flown.
    #[test]
    fn the_flight_has_a_row_every_interval() {
        let interval = coaxdesign::units::parse_quantity(INTERVAL, Kind::Time).unwrap();
        assert!((interval * CONTROL_RATE - EVERY as f64).abs() < 1e-9);
    }
}
