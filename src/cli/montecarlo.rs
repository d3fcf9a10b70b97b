//! `coaxdesign montecarlo`.

use std::collections::BTreeMap;

use clap::Args;
use serde_json::json;

use super::args::{Format, FormatArgs, RunArgs, UnitsArgs};
use super::designs::Craft;
use super::fly::{FlyArgs, Ready};
use super::quantity::quantity;
use super::rows::{Job, Row, RowArgs, to_csv};
use super::{CliError, Outcome, output};
use coaxdesign::pipeline::{FlightPlan, STUDY_SCHEMA, Silent, Study, StudyHead};
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
    /// Fly only this run of the study, from 0
    #[arg(long, value_name = "K", conflicts_with = "shard")]
    run_only: Option<u32>,
    #[command(flatten)]
    rows: RowArgs,
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
        let job = Job {
            head,
            hash: head.hash(),
            columns: COLUMNS.map(|(name, unit)| (name.to_string(), unit.to_string())).to_vec(),
            count: head.runs,
            noun: "runs",
            doing: "flights",
        };
        let only = self.run_only.map(|run| run as usize);
        let known =
            self.rows.rows(&job, only, self.run.quiet, |index| Ok(study.run(index, &Silent)?))?;
        output::print(&self.summary(&ready, head, &known)?)?;
        let missed = known.values().any(|run| !run.success);
        Ok(self.rows.outcome(head.runs, "runs", known.len(), missed))
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

    fn summary(
        &self,
        ready: &Ready,
        head: &StudyHead,
        runs: &BTreeMap<usize, Run>,
    ) -> Result<String, CliError> {
        if self.format.shown() == Format::Csv {
            return to_csv(&COLUMNS.map(|(name, _)| name.to_string()), runs);
        }
        let list: Vec<&Run> = runs.values().collect();
        let count = |word: &str| list.iter().filter(|run| run.status == word).count();
        let successes = list.iter().filter(|run| run.success).count();
        let [low, high] = wilson(successes, list.len(), 1.96);
        let mut worst = list.clone();
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

impl Row for Run {
    fn index(&self) -> usize {
        self.run
    }
}
