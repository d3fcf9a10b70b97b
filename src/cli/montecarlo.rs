//! `coaxdesign montecarlo`.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use clap::Args;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::args::{Format, FormatArgs, RunArgs, UnitsArgs};
use super::fly::{FlyArgs, Ready, flight_error};
use super::{CliError, Outcome, output};
use coaxdesign::report::progress::Progress;
use coaxdesign::schedule::hash;
use coaxdesign::simulate::metrics::Meter;
use coaxdesign::simulate::montecarlo::{Criterion, Ranges, Run, Variation, draw, wilson};
use coaxdesign::simulate::{Flight, Options};
use coaxdesign::trim::{Options as TrimOptions, sweep};
use coaxdesign::units::{Kind, parse_quantity};

/// Schema of the file of runs.
const SCHEMA: &str = "coaxdesign.montecarlo/1";

/// Fly a manoeuvre many times with the aircraft and the air varied
///
/// Variations form a Latin hypercube over mass, inertia, centre of gravity, delay, turbulence,
/// the inflow of the rotors on one another, and a discrete gust half way.
/// The file of -o holds one line of JSON a run and is added to as runs end: started again with the
/// same arguments, the command flies only what is missing. Shards of one study may be flown on
/// different machines and joined with --merge.
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
    /// Range of the mass either way, as a fraction
    #[arg(long, value_name = "FRACTION", default_value_t = 0.1)]
    mass: f64,
    /// Range of the inertia either way, as a fraction
    #[arg(long, value_name = "FRACTION", default_value_t = 0.1)]
    inertia: f64,
    /// Range of the centre of gravity either way
    #[arg(long, value_name = "LENGTH", default_value = "1 in")]
    cg: String,
    /// Largest extra delay
    #[arg(long, value_name = "TIME", default_value = "10 ms")]
    delay: String,
    /// Largest wind at 20 ft for turbulence; "0 kt" keeps the manoeuvre's own air
    #[arg(long, value_name = "SPEED", default_value = "15 kt")]
    turbulence: String,
    /// Range of the inflow that rotors induce in one another, either way, as a fraction
    #[arg(long, value_name = "FRACTION", default_value_t = 0.2)]
    inflow: f64,
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

/// First line of a file of runs: what the study is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    schema: String,
    maneuver: String,
    runs: usize,
    seed: u64,
    ranges: Ranges,
    criterion: Criterion,
    /// Hash of problem, schedule and manoeuvre.
    study: String,
}

impl MonteCarlo {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        let ready = self.fly.ready(self.run.quiet)?;
        let head = self.head(&ready)?;
        let runs = head.runs;
        let mut known = BTreeMap::new();
        if let Some(path) = self.output.as_deref().filter(|path| path.exists()) {
            read_runs(path, &head, &mut known)?;
        }
        for path in &self.merge {
            read_runs(path, &head, &mut known)?;
        }
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
        if let Some(beyond) = wanted.iter().find(|k| **k >= runs) {
            return Err(CliError::Usage {
                message: format!("there is no run {beyond}"),
                help: format!("the study's runs are 0 to {}", runs - 1),
            });
        }
        let missing: Vec<usize> = wanted.into_iter().filter(|k| !known.contains_key(k)).collect();
        // What is there is written anew, whole: an interrupted line is gone.
        let file = match &self.output {
            Some(path) => Some(begin(path, &head, &known)?),
            None => None,
        };
        let file = Mutex::new(file);
        let progress = Progress::new("flights", missing.len() as u64, self.run.quiet);
        let flown: Vec<Run> = missing
            .par_iter()
            .map(|&index| {
                let run = self.fly_one(&ready, &head, index)?;
                let line = serde_json::to_string(&run)
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                if let (Ok(mut file), Some(path)) = (file.lock(), &self.output)
                    && let Some(file) = file.as_mut()
                {
                    file.write_all((line + "\n").as_bytes())
                        .map_err(|source| CliError::Io { path: path.clone(), source })?;
                }
                progress.advance();
                Ok(run)
            })
            .collect::<Result<_, CliError>>()?;
        progress.finish();
        known.extend(flown.into_iter().map(|run| (run.run, run)));
        drop(file);
        if let Some(path) = &self.output {
            // In order, so that the bytes do not depend on the threads.
            output::write_whole(path, lines(&head, &known)?.as_bytes(), true)?;
        }
        let list: Vec<&Run> = known.values().collect();
        output::print(&self.summary(&ready, &head, &list)?)?;
        let all = list.iter().all(|run| run.success);
        Ok(if all { Outcome::Done } else { Outcome::GoalMissed })
    }

    fn head(&self, ready: &Ready) -> Result<Head, CliError> {
        let quantity = |flag: &str, text: &str, kind| {
            parse_quantity(text, kind).map_err(|error| CliError::Usage {
                message: format!("--{flag} {text:?}: {error}"),
                help: error.help(),
            })
        };
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
        let ranges = Ranges {
            mass: fraction("mass", self.mass)?,
            inertia: fraction("inertia", self.inertia)?,
            center_of_gravity: quantity("cg", &self.cg, Kind::Length)?.abs(),
            delay: quantity("delay", &self.delay, Kind::Time)?.max(0.0),
            turbulence: quantity("turbulence", &self.turbulence, Kind::Airspeed)?.max(0.0),
            inflow: fraction("inflow", self.inflow)?,
            gust: quantity("gust", &self.gust, Kind::Velocity)?.abs(),
        };
        let criterion = Criterion {
            velocity_peak: quantity("peak", &self.peak, Kind::Airspeed)?,
            saturated: quantity("saturated", &self.saturated, Kind::Time)?,
        };
        let schedule = ready.schedule.as_ref().map_or(Ok(String::new()), |s| {
            s.to_json().map_err(|error| CliError::Internal(error.to_string()))
        })?;
        let texts = ready.loaded.sources.files().iter().map(|file| file.text.as_str());
        // The checked manoeuvre and options stand for their texts.
        let rest = format!("{:?}{:?}", ready.maneuver, ready.options);
        let study = hash(texts.chain([schedule.as_str(), rest.as_str()]));
        Ok(Head {
            schema: SCHEMA.into(),
            maneuver: ready.maneuver.title.clone(),
            runs: self.runs as usize,
            seed: self.fly.seed,
            ranges,
            criterion,
            study,
        })
    }

    /// Flies one run.
    fn fly_one(&self, ready: &Ready, head: &Head, index: usize) -> Result<Run, CliError> {
        let (drawn, seed) = draw(index, head.runs, head.seed, &head.ranges);
        // On top of what --model varies for all.
        let base = &ready.variation;
        let variation = Variation {
            interactions: base.interactions,
            mass: base.mass * drawn.mass,
            inertia: base.inertia * drawn.inertia,
            center_of_gravity: base.center_of_gravity + drawn.center_of_gravity,
            delay: base.delay + drawn.delay,
            turbulence: drawn.turbulence.or(base.turbulence),
            inflow: base.inflow * drawn.inflow,
            gust: std::array::from_fn(|k| base.gust[k] + drawn.gust[k]),
            governor: base.governor,
        };
        let maneuver = variation.fly_in(&ready.as_read);
        let vehicle = variation.vehicle(&ready.loaded.problem)?;
        let mut run = Run {
            run: index,
            seed,
            variation,
            status: "no_trim".into(),
            state: None,
            time_s: 0.0,
            velocity_peak_m_s: [0.0; 3],
            velocity_rms_m_s: [0.0; 3],
            attitude_peak_rad: [0.0; 2],
            saturated_s: 0.0,
            success: false,
        };
        let condition = maneuver.start.condition;
        let mut found = sweep(&vehicle, &[condition], &TrimOptions::default(), |_| {});
        let Some(Ok(start)) = found.points.pop().map(|point| point.into_converged()) else {
            return Ok(run);
        };
        let options = Options { seed, extra_delay: variation.delay, ..ready.options.clone() };
        let mut flight =
            Flight::new(&vehicle, &start, ready.autopilot.as_ref(), &maneuver, &options)
                .map_err(|error| flight_error(&error))?;
        let mut meter = Meter::new(&flight);
        let status = flight.fly(|flight| meter.see(flight));
        let metrics = meter.finish(&flight, &status);
        let size = |channel: &str| metrics.tracked(channel).map(|t| t.size).unwrap_or_default();
        let sizes = ["forward_velocity", "right_velocity", "climb_rate"].map(size);
        run.status = metrics.end.status.into();
        run.state = metrics.end.state;
        run.time_s = metrics.end.time_s;
        run.velocity_peak_m_s = sizes.map(|s| s.peak);
        run.velocity_rms_m_s = sizes.map(|s| s.rms);
        run.attitude_peak_rad = [metrics.roll_peak_rad, metrics.pitch_peak_rad];
        run.saturated_s = metrics.saturated_s;
        run.success = head.criterion.met(&run);
        Ok(run)
    }

    fn summary(&self, ready: &Ready, head: &Head, list: &[&Run]) -> Result<String, CliError> {
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
                "schema": SCHEMA,
                "design": ready.opened.as_ref().map(|o| &o.name),
                "aircraft": ready.loaded.problem.name,
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
            let mut text = String::from(
                "run,seed,mass,inertia,cg_m,delay_s,turbulence_m_s,inflow,gust_forward_m_s,\
                 gust_right_m_s,gust_up_m_s,status,time_s,\
                 forward_peak_m_s,right_peak_m_s,vertical_peak_m_s,saturated_s,success\n",
            );
            for r in list {
                let v = &r.variation;
                let [x, y, z] = r.velocity_peak_m_s;
                let [gx, gy, gz] = v.gust;
                text += &format!(
                    "{},{},{},{},{},{},{},{},{gx},{gy},{gz},{},{},{x},{y},{z},{},{}\n",
                    r.run,
                    r.seed,
                    v.mass,
                    v.inertia,
                    v.center_of_gravity,
                    v.delay,
                    v.turbulence.unwrap_or(0.0),
                    v.inflow,
                    r.status,
                    r.time_s,
                    r.saturated_s,
                    r.success
                );
            }
            return Ok(text);
        }
        let system = self.units.system();
        let unit = Kind::Airspeed.symbol(system);
        let mut text = ready.head();
        text += &format!(
            "\n{}: {} of {} runs flown: {} completed, {} ended at a limit, {} diverged, {} did not \
             trim\nSuccess: {} of {} ({:.1} %, 95 % confidence {:.1} to {:.1} %)\n\nWorst:\n",
            head.maneuver,
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

fn lines(head: &Head, runs: &BTreeMap<usize, Run>) -> Result<String, CliError> {
    let internal = |error: serde_json::Error| CliError::Internal(error.to_string());
    let mut text = serde_json::to_string(head).map_err(internal)? + "\n";
    for run in runs.values() {
        text += &serde_json::to_string(run).map_err(internal)?;
        text.push('\n');
    }
    Ok(text)
}

/// Writes what is known, and opens the file to be added to.
fn begin(
    path: &Path,
    head: &Head,
    known: &BTreeMap<usize, Run>,
) -> Result<std::fs::File, CliError> {
    output::write_whole(path, lines(head, known)?.as_bytes(), true)?;
    std::fs::OpenOptions::new()
        .append(true)
        .open(path)
        .map_err(|source| CliError::Io { path: path.into(), source })
}

/// Adds the runs of a file. A last line without an end is one that was
/// interrupted.
fn read_runs(path: &Path, head: &Head, known: &mut BTreeMap<usize, Run>) -> Result<(), CliError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| CliError::Io { path: path.into(), source })?;
    let other = |message: String| CliError::Usage {
        message: format!("{}: {message}", path.display()),
        help: "give another file with -o, or the arguments that the file was made with".into(),
    };
    let mut whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    let first = whole.next().unwrap_or("");
    let found: Head = serde_json::from_str(first)
        .map_err(|error| other(format!("not a file of runs: {error}")))?;
    if found != *head {
        return Err(other("it holds another study".into()));
    }
    for (number, line) in whole.enumerate() {
        let run: Run = serde_json::from_str(line)
            .map_err(|error| other(format!("line {}: {error}", number + 2)))?;
        known.insert(run.run, run);
    }
    Ok(())
}
