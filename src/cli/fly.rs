//! What the subcommands that fly share: the schedule, the manoeuvre and the
//! varied model.

use std::path::{Path, PathBuf};

use clap::Args;

use super::args::{ModelsArgs, ProblemArgs, UnitsArgs};
use super::designs::{Craft, Opened, OpenedModels, SourceArgs};
use super::quantity::beyond;
use super::tune::SpecArgs;
use super::watch::Watch;
use super::{CliError, output};
use coaxdesign::control::plant::Hardware;
use coaxdesign::pipeline::{FlightPlan, Flown, fly, fly_models};
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::Options;
use coaxdesign::simulate::maneuver::{self, Maneuver, Mode};
use coaxdesign::simulate::montecarlo::Variation;
use coaxdesign::simulate::record::Column;
use coaxdesign::units::{Kind, System, parse_quantity};

/// Rate of the control computer unless another is named, Hz.
pub const CONTROL_RATE: f64 = 100.0;
/// Steps of a revolution unless others are named.
pub const STEPS: u16 = 36;

/// The manoeuvre and how it is flown.
#[derive(Debug, Clone, Args)]
pub struct FlyArgs {
    /// Directory of a design, or a schedule file; open-loop manoeuvres need none
    #[arg(value_name = "DESIGN")]
    pub design: Option<PathBuf>,
    /// Manoeuvre file, or the name of a built-in one: accel-climb-turn, dash-climb-turn,
    /// hover-turbulence, hover-turn, pirouette, slalom, accel-decel, sidestep, vertical,
    /// engine-out, lateral-doublet
    #[arg(short, long, value_name = "FILE")]
    pub maneuver: PathBuf,
    #[command(flatten)]
    pub sources: SourceArgs,
    #[command(flatten)]
    pub models: ModelsArgs,
    /// Vary the model: interactions=on|off, mass=FACTOR, inertia=FACTOR, cg=LENGTH (aft),
    /// delay=TIME (extra), turbulence=SPEED (wind at 20 ft), inflow=FACTOR (of rotors on one
    /// another), gust-forward|gust-right|gust-up=SPEED (met half way), governor=TIME (constant)
    #[arg(long = "model", value_name = "KEY=VALUE")]
    pub model: Vec<String>,
    /// Seed of sensor noise and turbulence
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Rate of the control computer, Hz
    #[arg(long, value_name = "HZ", default_value_t = CONTROL_RATE)]
    pub control_rate: f64,
    /// Fewest integration steps in a revolution of the reference rotor
    #[arg(long, value_name = "N", default_value_t = STEPS)]
    pub steps: u16,
    /// Largest rate of blade pitch [default: that of the specification]
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
        let quantity = |kind| {
            let quantity =
                parse_quantity(value.trim(), kind).map_err(|error| usage(error.to_string()))?;
            match beyond(&format!("model {}", key.trim()), quantity, kind) {
                None => Ok(quantity),
                Some(bounds) => Err(usage(bounds)),
            }
        };
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
    Ok(variation)
}

/// Everything that a flight needs but its trim.
#[derive(Debug)]
pub struct Ready {
    /// The design, if one is named.
    pub opened: Option<Opened>,
    /// What the flight is of, where there is a design or a set of models.
    head: Option<String>,
    /// The aircraft as read, or the models.
    pub craft: Craft,
    /// How it is varied.
    pub variation: Variation,
    /// The schedule, if there is one.
    pub schedule: Option<Schedule>,
    /// The manoeuvre as its file has it.
    pub as_read: Maneuver,
    /// The manoeuvre in the varied air.
    pub maneuver: Maneuver,
    /// How to simulate.
    pub options: Options,
}

impl Ready {
    /// The units of the results.
    pub fn system(&self, asked: UnitsArgs) -> System {
        match &self.opened {
            Some(opened) => opened.system(asked),
            None => asked.of(match &self.craft {
                Craft::Problem(loaded) => Some(&loaded.problem),
                Craft::Models(..) => None,
            }),
        }
    }

    /// What the flight is of, in a line.
    pub fn head(&self) -> String {
        self.head.clone().unwrap_or_else(|| format!("no design: aircraft {}\n", self.craft.name()))
    }

    /// Flies a plan with the aircraft or the models.
    ///
    /// # Errors
    /// As [`fly`] and [`fly_models`].
    pub fn fly(
        &self,
        plan: &FlightPlan,
        watch: &Watch,
        row: impl FnMut(&[Column], &[f64]) -> Result<(), CliError>,
    ) -> Result<Flown, CliError> {
        let schedule = self.schedule.as_ref();
        match &self.craft {
            Craft::Problem(loaded) => fly(&loaded.problem, schedule, plan, watch, row),
            Craft::Models(_, model) => fly_models(model, schedule, plan, watch, row),
        }
    }
}

impl FlyArgs {
    /// The command that flies the same, but for seed and variation, as it is
    /// typed in a shell.
    pub fn replay(&self) -> String {
        let mut words = vec!["coaxdesign".to_string(), "simulate".into()];
        let path = |path: &Path| path.display().to_string();
        words.extend(self.design.as_deref().map(path));
        words.extend(["--maneuver".into(), path(&self.maneuver)]);
        for (flag, value) in [
            ("--problem", &self.sources.problem),
            ("--models", &self.models.models),
            ("--spec", &self.sources.spec),
        ] {
            if let Some(value) = value {
                words.extend([flag.to_string(), path(value)]);
            }
        }
        words.extend(self.sources.other_aircraft.then(|| "--other-aircraft".to_string()));
        words.extend(self.sources.other_spec.then(|| "--other-spec".to_string()));
        if self.control_rate != CONTROL_RATE {
            words.extend(["--control-rate".into(), self.control_rate.to_string()]);
        }
        if self.steps != STEPS {
            words.extend(["--steps".into(), self.steps.to_string()]);
        }
        if let Some(rate) = &self.pitch_rate_limit {
            words.extend(["--pitch-rate-limit".into(), rate.clone()]);
        }
        output::shell_line(&words)
    }

    /// Reads and checks everything.
    ///
    /// # Errors
    /// Files that cannot be read, and arguments that make no sense.
    pub fn ready(&self, quiet: bool) -> Result<Ready, CliError> {
        let variation = variation(&self.model)?;
        let as_read = load_maneuver(&self.maneuver)?;
        let maneuver = variation.fly_in(&as_read);
        let of_models =
            OpenedModels::read(self.design.as_deref(), &self.sources, &self.models, quiet)?;
        let opened = match &self.design {
            Some(design) if of_models.is_none() => {
                Some(Opened::read(design, &self.sources, quiet)?)
            }
            _ => None,
        };
        let schedule = match (&opened, &of_models) {
            (Some(opened), _) => Some(opened.schedule.clone()),
            (None, Some(of_models)) => of_models.schedule.clone(),
            (None, None) => None,
        };
        if maneuver.mode != Mode::OpenLoop && schedule.is_none() {
            return Err(CliError::Usage {
                message: "the manoeuvre is flown by a control law, but no design is given".into(),
                help: "name a design, such as `coaxdesign simulate designs/coax2d --maneuver \
                       ...`; `coaxdesign tune-gains -o DIR` makes one"
                    .into(),
            });
        }
        let specification = match (&opened, &of_models) {
            (Some(opened), _) => opened.requirements.specification.clone(),
            (None, Some(of_models)) => of_models.requirements.specification.clone(),
            (None, None) => SpecArgs::of(self.sources.spec.clone()).load()?.specification,
        };
        let head = match (&opened, &of_models) {
            (Some(opened), _) => Some(opened.head()),
            (None, Some(of_models)) => Some(of_models.head()),
            (None, None) => None,
        };
        let craft = match (of_models, &opened) {
            (Some(of_models), _) => Craft::of_models(of_models.set, &specification.models_from)?,
            (None, Some(opened)) => Craft::Problem(Box::new(opened.loaded.clone())),
            (None, None) => {
                let given = ProblemArgs { file: self.sources.problem.clone() };
                Craft::Problem(Box::new(given.load_with_warnings(quiet)?))
            }
        };
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
        Ok(Ready { opened, head, craft, variation, schedule, as_read, maneuver, options })
    }
}

/// A manoeuvre file, or a built-in one where no file has the name.
fn load_maneuver(path: &Path) -> Result<Maneuver, CliError> {
    if !path.exists()
        && let Some(found) = path.to_str().and_then(maneuver::builtin)
    {
        return Ok(found?);
    }
    output::is_input(path);
    Ok(maneuver::load(path)?)
}
