//! What the subcommands that fly share: the schedule, the manoeuvre, the
//! varied model, and the trim to start from.

use std::path::{Path, PathBuf};

use clap::Args;

use super::CliError;
use super::args::ProblemArgs;
use coaxdesign::control::plant::Hardware;
use coaxdesign::control::spec;
use coaxdesign::problem::Loaded;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::flight::{Autopilot, FlightError};
use coaxdesign::simulate::maneuver::{self, Maneuver, Mode};
use coaxdesign::simulate::montecarlo::Variation;
use coaxdesign::simulate::{Options, SimulationError};
use coaxdesign::units::{Kind, parse_quantity};

/// The manoeuvre and how it is flown.
#[derive(Debug, Clone, Args)]
pub struct FlyArgs {
    /// Schedule file, or a directory with a schedule.json; open-loop manoeuvres need none
    #[arg(value_name = "DESIGN")]
    pub design: Option<PathBuf>,
    /// Manoeuvre file, or the name of a built-in one: accel-climb-turn, hover-turbulence,
    /// hover-turn, pirouette, slalom, accel-decel, sidestep, vertical, engine-out, lateral-doublet
    #[arg(short, long, value_name = "FILE")]
    pub maneuver: PathBuf,
    /// Problem file, or the name of a built-in one
    #[arg(long, value_name = "FILE", default_value = "coax2d")]
    pub problem: PathBuf,
    /// Vary the model: interactions=on|off, mass=FACTOR, inertia=FACTOR, cg=LENGTH (aft),
    /// delay=TIME (extra), turbulence=SPEED (wind at 20 ft), inflow=FACTOR (of rotors on one
    /// another), gust-forward|gust-right|gust-up=SPEED (met half way), governor=TIME (constant)
    #[arg(long = "model", value_name = "KEY=VALUE")]
    pub model: Vec<String>,
    /// Seed of sensor noise and turbulence
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Rate of the control computer, Hz
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    pub control_rate: f64,
    /// Fewest integration steps in a revolution of the reference rotor
    #[arg(long, value_name = "N", default_value_t = 36)]
    pub steps: u16,
    /// Largest rate of blade pitch [default: that of the built-in specification]
    #[arg(long, value_name = "RATE")]
    pub pitch_rate_limit: Option<String>,
}

/// Reads `--model` arguments.
///
/// # Errors
/// Keys that are not known and values that make no sense.
pub fn variation(texts: &[String]) -> Result<Variation, CliError> {
    let mut variation = Variation::default();
    for text in texts {
        let usage = |message: String| {
            CliError::Usage {
            message: format!("--model {text:?}: {message}"),
            help: "write --model interactions=off, --model mass=1.1, --model inertia=0.9, \
                   --model \"cg=2 in\", --model \"delay=10 ms\", --model \"turbulence=15 kt\", --model \
                   inflow=1.2, --model \"gust-up=5 ft/s\" or --model \"governor=1 s\""
                .into(),
        }
        };
        let (key, value) = text.split_once('=').ok_or_else(|| usage("no value".into()))?;
        let factor = || match value.trim().parse::<f64>() {
            Ok(factor) if factor > 0.1 && factor < 10.0 => Ok(factor),
            _ => Err(usage(format!("{value:?} is no factor between 0.1 and 10"))),
        };
        let quantity =
            |kind| parse_quantity(value.trim(), kind).map_err(|error| usage(error.to_string()));
        match key.trim() {
            "interactions" => {
                variation.interactions = Some(match value.trim() {
                    "on" => true,
                    "off" => false,
                    other => return Err(usage(format!("{other:?} is neither on nor off"))),
                });
            }
            "mass" => variation.mass = factor()?,
            "inertia" => variation.inertia = factor()?,
            "cg" => variation.center_of_gravity = quantity(Kind::Length)?,
            "delay" => variation.delay = quantity(Kind::Time)?,
            "turbulence" => variation.turbulence = Some(quantity(Kind::Airspeed)?),
            "inflow" => variation.inflow = factor()?,
            "gust-forward" => variation.gust[0] = quantity(Kind::Velocity)?,
            "gust-right" => variation.gust[1] = quantity(Kind::Velocity)?,
            "gust-up" => variation.gust[2] = quantity(Kind::Velocity)?,
            "governor" => variation.governor = Some(quantity(Kind::Time)?),
            other => return Err(usage(format!("there is no {other:?} to vary"))),
        }
    }
    if variation.governor.is_some_and(|time| time <= 0.0) {
        return Err(CliError::Usage {
            message: "--model: the time constant of a governor must be positive".into(),
            help: "write --model \"governor=1 s\"".into(),
        });
    }
    if variation.delay < 0.0 || variation.turbulence.is_some_and(|wind| wind < 0.0) {
        return Err(CliError::Usage {
            message: "--model: an extra delay and a wind cannot be negative".into(),
            help: "give zero or more".into(),
        });
    }
    Ok(variation)
}

/// Everything that a flight needs but its trim.
#[derive(Debug)]
pub struct Ready {
    /// The problem as read.
    pub loaded: Loaded,
    /// How it is varied.
    pub variation: Variation,
    /// The schedule, if there is one.
    pub schedule: Option<Schedule>,
    /// Its law.
    pub autopilot: Option<Autopilot>,
    /// The manoeuvre as its file has it.
    pub as_read: Maneuver,
    /// The manoeuvre in the varied air.
    pub maneuver: Maneuver,
    /// How to simulate.
    pub options: Options,
}

impl FlyArgs {
    /// Reads and checks everything.
    ///
    /// # Errors
    /// Files that cannot be read, and arguments that make no sense.
    pub fn ready(&self, quiet: bool) -> Result<Ready, CliError> {
        let variation = variation(&self.model)?;
        let as_read = load_maneuver(&self.maneuver)?;
        let maneuver = variation.fly_in(&as_read);
        let problem = ProblemArgs { file: Some(self.problem.clone()) };
        let loaded = problem.load_with_warnings(quiet)?;
        let schedule = self.design.as_deref().map(load_schedule).transpose()?;
        if maneuver.mode != Mode::OpenLoop && schedule.is_none() {
            return Err(CliError::Usage {
                message: "the manoeuvre is flown by a control law, but no design is given".into(),
                help: "name a design, such as `coaxdesign simulate designs/coax2d --maneuver \
                       ...`; `coaxdesign tune-gains -o DIR` makes one"
                    .into(),
            });
        }
        let autopilot = match &schedule {
            Some(schedule) => Some(Autopilot {
                table: schedule.law().map_err(|error| CliError::Usage {
                    message: error.to_string(),
                    help: "a schedule is written by `coaxdesign tune-gains -o DIR`".into(),
                })?,
                stick_limits: schedule.stick_limits,
            }),
            None => None,
        };
        let specification = spec::builtin()?;
        let hardware: Hardware =
            schedule.as_ref().map_or(specification.hardware, |schedule| schedule.hardware);
        let rate_limit = match &self.pitch_rate_limit {
            None => specification.pitch_rate_limit,
            Some(text) => {
                parse_quantity(text, Kind::AngularRate).map_err(|error| CliError::Usage {
                    message: format!("--pitch-rate-limit {text:?}: {error}"),
                    help: error.help(),
                })?
            }
        };
        let options = Options {
            control_rate: self.control_rate,
            steps_per_revolution: self.steps.into(),
            extra_delay: variation.delay,
            seed: self.seed,
            ..Options::new(hardware, rate_limit)
        };
        Ok(Ready { loaded, variation, schedule, autopilot, as_read, maneuver, options })
    }
}

/// Why a flight cannot begin, in the user's terms.
pub fn flight_error(error: &FlightError) -> CliError {
    match error {
        FlightError::Simulation(error) => simulation_error(error),
        FlightError::NoRotorSpeed => CliError::Usage {
            message: error.to_string(),
            help: "write [rotors.NAME.governor] in the problem, or --model \"governor=1 s\"".into(),
        },
        FlightError::NoLaw | FlightError::Law(_) => CliError::Internal(error.to_string()),
    }
}

/// Arguments that no simulation can use.
pub fn simulation_error(error: &SimulationError) -> CliError {
    CliError::Usage {
        message: error.to_string(),
        help: "look at --control-rate, --steps, --pitch-rate-limit and the schedule's hardware"
            .into(),
    }
}

/// A manoeuvre file, or a built-in one where no file has the name.
fn load_maneuver(path: &Path) -> Result<Maneuver, CliError> {
    if !path.exists()
        && let Some(found) = path.to_str().and_then(maneuver::builtin)
    {
        return Ok(found?);
    }
    Ok(maneuver::load(path)?)
}

/// A schedule file, or the one in a directory.
pub fn load_schedule(path: &Path) -> Result<Schedule, CliError> {
    let path = if path.is_dir() { path.join("schedule.json") } else { path.to_path_buf() };
    let text = std::fs::read_to_string(&path)
        .map_err(|source| CliError::Io { path: path.clone(), source })?;
    Schedule::from_json(&text).map_err(|error| CliError::Usage {
        message: format!("{}: {error}", path.display()),
        help: "a schedule is written by `coaxdesign tune-gains -o DIR`".into(),
    })
}
