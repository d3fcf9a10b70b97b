//! `coaxdesign montecarlo`.

use std::collections::BTreeMap;
use std::fs::TryLockError;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use clap::Args;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use super::args::{Format, FormatArgs, RunArgs, UnitsArgs};
use super::designs::Craft;
use super::fly::{FlyArgs, Ready};
use super::quantity::quantity;
use super::{CliError, Outcome, output};
use coaxdesign::pipeline::{FlightPlan, STUDY_SCHEMA, Silent, Study, StudyHead};
use coaxdesign::report::progress::Progress;
use coaxdesign::simulate::montecarlo::{COLUMNS, Criterion, Ranges, Run, wilson};
use coaxdesign::units::Kind;

/// Fly a manoeuvre many times with the aircraft and the air varied
///
/// Variations form a Latin hypercube over mass, inertia, centre of gravity, delay, turbulence,
/// the inflow of the rotors on one another, and a discrete gust half way.
/// The file of -o holds one line of JSON a run, SI, and is added to as runs end: started again with
/// the same arguments, the command flies only what is missing. FILE.study.json beside it says what
/// the study is; runs of another study are refused by what differs. Shards of one study are flown
/// into files of their own, on any machines, and joined with --merge. The exit code is 0 once all
/// that was asked for is flown.
#[derive(Debug, Args)]
pub struct MonteCarlo {
    #[command(flatten)]
    fly: FlyArgs,
    /// Number of runs of the whole study
    #[arg(long, value_name = "N", default_value_t = 200,
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    runs: u32,
    /// Fly only this part of the study, such as 0/4 to 3/4
    #[arg(long, value_name = "I/N")]
    shard: Option<String>,
    /// Fly only this run of the study, from 0
    #[arg(long, value_name = "K", conflicts_with = "shard")]
    run_only: Option<u32>,
    /// File of runs, JSON lines
    #[arg(short, long, value_name = "FILE.jsonl")]
    output: Option<PathBuf>,
    /// Add the runs of these files (of the same study) to the summary, and to -o
    #[arg(long, value_name = "FILE.jsonl", num_args = 1..)]
    merge: Vec<PathBuf>,
    /// End with exit code 1 if a run is no success
    #[arg(long)]
    fail_on_miss: bool,
    /// End a merge with exit code 1 if runs of the study are missing
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    require_complete: bool,
    /// Range of the mass either way, as a fraction
    #[arg(long, value_name = "FRACTION", default_value_t = 0.1)]
    mass: f64,
    /// Range of the inertia either way, as a fraction
    #[arg(long, value_name = "FRACTION", default_value_t = 0.1)]
    inertia: f64,
    /// Range of the centre of gravity either way [default: 1 in; 0 in for models without mass
    /// properties]
    #[arg(long, value_name = "LENGTH")]
    cg: Option<String>,
    /// Largest extra delay
    #[arg(long, value_name = "TIME", default_value = "10 ms")]
    delay: String,
    /// Largest wind at 20 ft for turbulence; "0 kt" keeps the manoeuvre's own air
    #[arg(long, value_name = "SPEED", default_value = "15 kt")]
    turbulence: String,
    /// Range of the inflow that rotors induce in one another, either way, as a fraction [default:
    /// 0.2; 0 for models]
    #[arg(long, value_name = "FRACTION")]
    inflow: Option<f64>,
    /// Largest component of the gust, either way
    #[arg(long, value_name = "SPEED", default_value = "5 ft/s")]
    gust: String,
    /// A run succeeds if no velocity is farther from its reference than this
    #[arg(long, value_name = "SPEED", default_value = "10 kt")]
    peak: String,
    /// and no actuator is at a limit for longer than this
    #[arg(long, value_name = "TIME", default_value = "0.5 s")]
    saturated: String,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    run: RunArgs,
}

impl MonteCarlo {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        let ready = self.fly.ready(self.run.quiet)?;
        let study = self.study(&ready)?;
        let head = study.head();
        let runs = head.runs;
        let mut known = BTreeMap::new();
        let file = self.output.as_deref().map(|path| RunFile::open(path, head, &mut known));
        let file = file.transpose()?;
        for path in &self.merge {
            read_runs(path, head, &mut known)?;
        }
        let wanted = self.wanted(runs)?;
        let missing: Vec<usize> = wanted.into_iter().filter(|k| !known.contains_key(k)).collect();
        let file = Mutex::new(file);
        let progress = Progress::new("flights", missing.len() as u64, self.run.quiet);
        let flown: Vec<Run> = missing
            .par_iter()
            .map(|&index| {
                let run = study.run(index, &Silent)?;
                if let Some(file) =
                    file.lock().unwrap_or_else(std::sync::PoisonError::into_inner).as_mut()
                {
                    file.add(&run)?;
                }
                progress.advance();
                Ok(run)
            })
            .collect::<Result<_, CliError>>()?;
        progress.finish();
        known.extend(flown.into_iter().map(|run| (run.run, run)));
        if let Some(file) = file.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            file.finish(&known)?;
        }
        let list: Vec<&Run> = known.values().collect();
        output::print(&self.summary(&ready, head, &list)?)?;
        self.outcome(runs, &list)
    }

    /// Runs that this command is to fly, if they are not there yet.
    fn wanted(&self, runs: usize) -> Result<Vec<usize>, CliError> {
        let wanted: Vec<usize> = match (&self.shard, self.run_only) {
            (_, Some(only)) => vec![only as usize],
            (Some(shard), None) => {
                let (index, count) = shard_of(shard)?;
                (0..runs).filter(|k| k % count == index).collect()
            }
            // Merging alone flies nothing.
            (None, None) if !self.merge.is_empty() => Vec::new(),
            (None, None) => (0..runs).collect(),
        };
        match wanted.iter().find(|k| **k >= runs) {
            Some(beyond) => Err(CliError::Usage {
                message: format!("there is no run {beyond}"),
                help: format!("the study's runs are 0 to {}", runs - 1),
            }),
            None => Ok(wanted),
        }
    }

    /// Flown is done; a merge that lacks runs, and a miss where that was asked
    /// about, is not.
    fn outcome(&self, runs: usize, list: &[&Run]) -> Result<Outcome, CliError> {
        if !self.merge.is_empty() && self.require_complete && list.len() < runs {
            output::note(&format!(
                "error: {} of {runs} runs are missing\n  help: fly the shards that are not there; \
                 --require-complete false takes what is\n",
                runs - list.len()
            ));
            return Ok(Outcome::GoalMissed);
        }
        let missed = list.iter().any(|run| !run.success);
        Ok(if self.fail_on_miss && missed { Outcome::GoalMissed } else { Outcome::Done })
    }

    fn study(&self, ready: &Ready) -> Result<Study, CliError> {
        let fraction = |flag: &str, value: f64| {
            if (0.0..=0.8).contains(&value) {
                Ok(value)
            } else {
                Err(CliError::Usage {
                    message: format!("--{flag} {value}: not between 0 and 0.8"),
                    help: "write a fraction such as 0.1 for 10 %".into(),
                })
            }
        };
        let of_models = match &ready.craft {
            Craft::Problem(_) => None,
            Craft::Models(_, model) => Some(model.inertia().is_some_and(|i| i.mass.is_some())),
        };
        let usual_cg = if of_models == Some(false) { "0 in" } else { "1 in" };
        let usual_inflow = if of_models.is_some() { 0.0 } else { 0.2 };
        let ranges = Ranges {
            mass: fraction("mass", self.mass)?,
            inertia: fraction("inertia", self.inertia)?,
            center_of_gravity: quantity(
                "cg",
                self.cg.as_deref().unwrap_or(usual_cg),
                Kind::Length,
            )?,
            delay: quantity("delay", &self.delay, Kind::Time)?,
            turbulence: quantity("turbulence", &self.turbulence, Kind::Airspeed)?,
            inflow: fraction("inflow", self.inflow.unwrap_or(usual_inflow))?,
            gust: quantity("gust", &self.gust, Kind::Velocity)?,
        };
        let criterion = Criterion {
            velocity_peak: quantity("peak", &self.peak, Kind::Airspeed)?,
            saturated: quantity("saturated", &self.saturated, Kind::Time)?,
        };
        let plan = FlightPlan {
            maneuver: ready.as_read.clone(),
            variation: ready.variation,
            options: ready.options.clone(),
            every: 1,
        };
        let runs = self.runs as usize;
        let schedule = ready.schedule.as_ref();
        Ok(match &ready.craft {
            Craft::Problem(loaded) => Study::new(loaded, schedule, plan, runs, ranges, criterion)?,
            Craft::Models(set, model) => {
                Study::of_models(set, model, schedule, plan, runs, ranges, criterion)?
            }
        })
    }

    fn summary(&self, ready: &Ready, head: &StudyHead, list: &[&Run]) -> Result<String, CliError> {
        let count = |word: &str| list.iter().filter(|run| run.status == word).count();
        let successes = list.iter().filter(|run| run.success).count();
        let [low, high] = wilson(successes, list.len(), 1.96);
        let mut worst: Vec<&&Run> = list.iter().collect();
        let badness = |run: &Run| {
            // Ended early before flown badly.
            let ended = if run.status == "completed" { 0.0 } else { 1e6 };
            ended + run.velocity_peak_m_s.iter().copied().fold(0.0, f64::max)
        };
        worst.sort_by(|a, b| badness(b).total_cmp(&badness(a)));
        worst.truncate(5);
        if self.format.shown() == Format::Json {
            let value = json!({
                "schema": STUDY_SCHEMA,
                "design": ready.opened.as_ref().map(|o| &o.name),
                "aircraft": ready.craft.name(),
                "specification": ready.opened.as_ref().map(|o| &o.requirements.name),
                "study": head,
                "flown": list.len(),
                "completed": count("completed"),
                "limit": count("limit"),
                "diverged": count("diverged"),
                "no_trim": count("no_trim"),
                "successes": successes,
                "success_rate": if list.is_empty() { None } else {
                    Some(successes as f64 / list.len() as f64)
                },
                "confidence_95": [low, high],
                "worst": worst,
            });
            let text = serde_json::to_string_pretty(&value)
                .map_err(|error| CliError::Internal(error.to_string()))?;
            return Ok(text + "\n");
        }
        if self.format.shown() == Format::Csv {
            let mut text = COLUMNS.map(|(name, _)| name).join(",") + "\n";
            for run in list {
                let row = serde_json::to_value(run)
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                let cells: Vec<String> = row
                    .as_object()
                    .into_iter()
                    .flat_map(|row| row.values())
                    .map(|value| match value {
                        Json::Null => String::new(),
                        Json::String(text) => text.clone(),
                        other => other.to_string(),
                    })
                    .collect();
                text += &(cells.join(",") + "\n");
            }
            return Ok(text);
        }
        let system = ready.system(self.units);
        let unit = Kind::Airspeed.symbol(system);
        let mut text = ready.head();
        text += &format!(
            "\n{}: {} of {} runs flown: {} completed, {} ended at a limit, {} diverged, {} did not \
             trim\nSuccess: {} of {} ({:.1} %, 95 % confidence {:.1} to {:.1} %)\n\nWorst:\n",
            head.maneuver.name,
            list.len(),
            head.runs,
            count("completed"),
            count("limit"),
            count("diverged"),
            count("no_trim"),
            successes,
            list.len(),
            100.0 * successes as f64 / list.len().max(1) as f64,
            100.0 * low,
            100.0 * high,
        );
        for run in worst {
            let v = &run.variation;
            let peak = run.velocity_peak_m_s.iter().copied().fold(0.0, f64::max);
            let peak = Kind::Airspeed.from_si(peak, system);
            text += &format!(
                "  run {}: {} at {:.1} s, velocity error up to {peak:.1} {unit}\n    replay: {} \
                 --seed {} --model mass={} --model inertia={} --model \"cg={} m\" --model \
                 \"delay={} s\"",
                run.run,
                run.status,
                run.time_s,
                self.fly.replay(),
                run.seed,
                v.mass,
                v.inertia,
                v.center_of_gravity,
                v.delay
            );
            if let Some(wind) = v.turbulence {
                text += &format!(" --model \"turbulence={wind} m/s\"");
            }
            text += &format!(" --model inflow={}", v.inflow);
            for (name, value) in ["forward", "right", "up"].iter().zip(v.gust) {
                text += &format!(" --model \"gust-{name}={value} m/s\"");
            }
            if let Some(time) = v.governor {
                text += &format!(" --model \"governor={time} s\"");
            }
            if let Some(on) = v.interactions {
                text += &format!(" --model interactions={}", if on { "on" } else { "off" });
            }
            text.push('\n');
        }
        Ok(text)
    }
}

/// `I/N`.
fn shard_of(text: &str) -> Result<(usize, usize), CliError> {
    let parts = text.split_once('/').and_then(|(index, count)| {
        Some((index.trim().parse::<usize>().ok()?, count.trim().parse::<usize>().ok()?))
    });
    match parts {
        Some((index, count)) if index < count => Ok((index, count)),
        _ => Err(CliError::Usage {
            message: format!("--shard {text:?}: not a part of a whole"),
            help: "write --shard 0/4 to --shard 3/4".into(),
        }),
    }
}

/// The file beside a file of runs that says what their study is:
/// `runs.study.json` for `runs.jsonl`.
fn head_path(path: &Path) -> PathBuf {
    path.with_extension("study.json")
}

/// What the head file holds: the head, the study's hash, and the rows' units.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadFile {
    study: String,
    head: StudyHead,
    /// Units of the columns.
    units: BTreeMap<String, String>,
}

/// A file of runs that this program alone adds to.
struct RunFile {
    path: PathBuf,
    /// Locked for as long as it is open.
    file: std::fs::File,
}

impl RunFile {
    /// Opens a file and locks it; what it holds of the study goes to `known`.
    /// A last line without an end was interrupted, and is cut off.
    ///
    /// # Errors
    /// Another program that flies into it, or a file of another study.
    fn open(
        path: &Path,
        head: &StudyHead,
        known: &mut BTreeMap<usize, Run>,
    ) -> Result<Self, CliError> {
        let io = |source| CliError::Io { path: path.into(), source };
        let mut options = std::fs::OpenOptions::new();
        let file = options.read(true).append(true).create(true).open(path).map_err(io)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(CliError::Usage {
                    message: format!("{}: another program is flying into it", path.display()),
                    help: "give each shard a file of its own, and join them with --merge".into(),
                });
            }
            Err(TryLockError::Error(source)) => return Err(io(source)),
        }
        if file.metadata().map_err(io)?.len() == 0 {
            let mut units = BTreeMap::new();
            for (name, unit) in COLUMNS {
                units.insert(name.to_owned(), unit.to_owned());
            }
            let beside = HeadFile { study: head.hash(), head: head.clone(), units };
            let text = serde_json::to_string_pretty(&beside)
                .map_err(|error| CliError::Internal(error.to_string()))?;
            output::write_whole(&head_path(path), (text + "\n").as_bytes(), true)?;
        } else {
            let whole = read_runs(path, head, known)?;
            file.set_len(whole).map_err(io)?;
        }
        Ok(Self { path: path.into(), file })
    }

    fn add(&mut self, run: &Run) -> Result<(), CliError> {
        let line =
            serde_json::to_string(run).map_err(|error| CliError::Internal(error.to_string()))?;
        self.file
            .write_all((line + "\n").as_bytes())
            .map_err(|source| CliError::Io { path: self.path.clone(), source })
    }

    /// Puts the runs in order, so that the bytes do not depend on the threads.
    fn finish(self, runs: &BTreeMap<usize, Run>) -> Result<(), CliError> {
        let mut text = String::new();
        for run in runs.values() {
            text += &serde_json::to_string(run)
                .map_err(|error| CliError::Internal(error.to_string()))?;
            text.push('\n');
        }
        output::write_whole(&self.path, text.as_bytes(), true)
    }
}

/// Adds the runs of a file, and gives the length of its whole lines: a last
/// line without an end is one that was interrupted.
fn read_runs(
    path: &Path,
    head: &StudyHead,
    known: &mut BTreeMap<usize, Run>,
) -> Result<u64, CliError> {
    let read = |path: &Path| {
        std::fs::read_to_string(path).map_err(|source| CliError::Io { path: path.into(), source })
    };
    let other = |path: &Path, message: String| CliError::Usage {
        message: format!("{}: {message}", path.display()),
        help: "give another file with -o, or the arguments that the file was made with".into(),
    };
    let text = read(path)?;
    let beside = head_path(path);
    if !beside.exists() {
        let name = beside.display();
        return Err(other(path, format!("there is no {name}, which says what its study is")));
    }
    let found: HeadFile = serde_json::from_str(&read(&beside)?)
        .map_err(|error| other(&beside, format!("it describes no study: {error}")))?;
    let differences = head.differences(&found.head);
    if !differences.is_empty() {
        let list = differences.join("\n  ");
        return Err(other(path, format!("it holds another study:\n  {list}")));
    }
    let mut length = 0;
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    for (number, line) in whole.enumerate() {
        let run: Run = serde_json::from_str(line)
            .map_err(|error| other(path, format!("line {}: {error}", number + 1)))?;
        known.insert(run.run, run);
        length += line.len() as u64;
    }
    Ok(length)
}
