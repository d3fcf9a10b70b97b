//! Trims, linear models and flights.

use rayon::prelude::*;

use super::observer::Running;
use super::{Observer, PipelineError, Task};
use crate::control::plant::Hardware;
use crate::control::spec;
use crate::linear::linearize::{Options as LinearOptions, averaged, trim_values};
use crate::linear::reduction::{RIGID_BODY, residualise};
use crate::linear::set::ModelSet;
use crate::linear::{LinearError, StateSpace};
use crate::lti::stitch::Stitched;
use crate::problem::Problem;
use crate::schedule::Schedule;
use crate::simulate::flight::Autopilot;
use crate::simulate::metrics::Meter;
use crate::simulate::montecarlo::Variation;
use crate::simulate::record::Column;
use crate::simulate::{Airframe, Flight, Maneuver, Metrics, Options, Recorder, Start, Status};
use crate::trim::{FlightCondition, Options as TrimOptions, TrimPoint, sweep};
use crate::vehicle::Vehicle;

/// Trims at every condition, in this order; one list for every entry of
/// `interactions`, which says whether rotors act on one another.
///
/// A condition without a trim is a [`TrimPoint`] that says why.
///
/// # Errors
/// A problem that makes no vehicle, or an observer that stops.
pub fn trim(
    problem: &Problem,
    conditions: &[FlightCondition],
    interactions: &[bool],
    observer: &dyn Observer,
) -> Result<Vec<Vec<TrimPoint>>, PipelineError> {
    let running = Running::begin(observer, Task::Trim, conditions.len() * interactions.len())?;
    interactions
        .par_iter()
        .map(|&on| {
            let vehicle = with_interactions(problem, on)?;
            let done = |_: &TrimPoint| observer.advance();
            let points = sweep(&vehicle, conditions, &TrimOptions::default(), done).points;
            running.check()?;
            Ok(points)
        })
        .collect()
}

/// Models of the rigid body over speed (m/s, increasing), averaged along the
/// orbit and residualised, with their trims; one set for every entry of `interactions`. States
/// u v w p q r φ θ, inputs the sticks, SI and radians.
///
/// # Errors
/// [`PipelineError::NoTrim`] where a speed does not trim, and models that
/// cannot be reduced.
pub fn models(
    problem: &Problem,
    speeds: &[f64],
    interactions: &[bool],
    observer: &dyn Observer,
) -> Result<Vec<ModelSet>, PipelineError> {
    let conditions: Vec<FlightCondition> =
        speeds.iter().map(|&v| FlightCondition::level(v)).collect();
    let running = Running::begin(observer, Task::Models, speeds.len() * interactions.len())?;
    interactions
        .par_iter()
        .map(|&on| {
            let vehicle = with_interactions(problem, on)?;
            let done = |_: &TrimPoint| observer.advance();
            let points = sweep(&vehicle, &conditions, &TrimOptions::default(), done).points;
            let reduced = points
                .into_par_iter()
                .map(|point| {
                    running.check()?;
                    let trim = point.into_converged().map_err(PipelineError::NoTrim)?;
                    let model = || -> Result<StateSpace, LinearError> {
                        let full = averaged(&vehicle, &trim, &LinearOptions::default())?;
                        Ok(residualise(&full, &RIGID_BODY)?.model)
                    };
                    let model = model()?;
                    Ok((trim_values(&vehicle, &trim, &model), model))
                })
                .collect::<Result<Vec<_>, PipelineError>>()?;
            let (trims, models): (Vec<_>, Vec<_>) = reduced.into_iter().unzip();
            let set = ModelSet::new(Some(on), speeds.to_vec(), models)?;
            Ok(match trims.into_iter().collect() {
                Some(trims) => set.with_trims(trims)?,
                None => set,
            })
        })
        .collect()
}

fn with_interactions(problem: &Problem, on: bool) -> Result<Vehicle, PipelineError> {
    let mut problem = problem.clone();
    problem.inflow.interactions = on;
    Ok(Vehicle::new(&problem)?)
}

/// What is flown and how.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightPlan {
    /// The manoeuvre as its file has it.
    pub maneuver: Maneuver,
    /// How aircraft and air differ from problem and manoeuvre.
    pub variation: Variation,
    /// Control rate, integration steps, hardware, seed. Weather, noise, height
    /// and heading are the manoeuvre's, and the extra delay the variation's,
    /// whatever stands here.
    pub options: Options,
    /// Control periods from one row to the next, at least 1.
    pub every: u64,
}

impl FlightPlan {
    /// A manoeuvre under a schedule: its hardware, 100 Hz, every row.
    ///
    /// # Errors
    /// None in practice: a test holds the built-in specification, which gives
    /// the limit of the blades' pitch rate, to the checks.
    pub fn new(maneuver: Maneuver, schedule: Option<&Schedule>) -> Result<Self, PipelineError> {
        let specification = spec::builtin()?;
        let hardware: Hardware = schedule.map_or(specification.hardware, |s| s.hardware);
        Ok(Self {
            maneuver,
            variation: Variation::default(),
            options: Options::new(hardware, specification.pitch_rate_limit),
            every: 1,
        })
    }
}

/// A flight that has ended.
#[derive(Debug, Clone)]
pub struct Flown {
    /// How it ended.
    pub status: Status,
    /// What it amounts to.
    pub metrics: Metrics,
    /// Columns of its rows.
    pub columns: Vec<Column>,
    /// Whether rotors acted on one another; not known of a set of models.
    pub interactions: Option<bool>,
    /// Step of the integration, s.
    pub integration_step: f64,
    /// Delay from a measurement to the effectors, s.
    pub delay: f64,
    /// A revolution of the reference rotor, s; zero for a set of models.
    pub revolution: f64,
}

/// Flies a manoeuvre with the full nonlinear vehicle from a trim. `row` is
/// given the columns and every row, SI and radians, as it comes; it is called
/// once with an empty row before the first, so that a file can be begun.
///
/// # Errors
/// No trim to start from, a flight that cannot begin, an observer that stops,
/// or the first error of `row`.
pub fn fly<E: From<PipelineError>>(
    problem: &Problem,
    schedule: Option<&Schedule>,
    plan: &FlightPlan,
    observer: &dyn Observer,
    row: impl FnMut(&[Column], &[f64]) -> Result<(), E>,
) -> Result<Flown, E> {
    let vehicle = plan.variation.vehicle(problem).map_err(PipelineError::from)?;
    let condition = plan.maneuver.start.condition;
    let mut found = sweep(&vehicle, &[condition], &TrimOptions::default(), |_| {}).points;
    let Some(point) = found.pop() else {
        return Err(PipelineError::NoBreakpoint.into());
    };
    let start = point.into_converged().map_err(PipelineError::NoTrim)?;
    fly_from((&vehicle).into(), &(&start).into(), schedule, plan, observer, row)
}

/// As [`fly`], with a model stitched from linear ones.
///
/// # Errors
/// As [`fly`], and a variation that a set of models cannot give.
pub fn fly_models<E: From<PipelineError>>(
    model: &Stitched,
    schedule: Option<&Schedule>,
    plan: &FlightPlan,
    observer: &dyn Observer,
    row: impl FnMut(&[Column], &[f64]) -> Result<(), E>,
) -> Result<Flown, E> {
    let model = plan.variation.stitched(model).map_err(PipelineError::from)?;
    let start = model.steady(&plan.maneuver.start.condition).map_err(PipelineError::from)?;
    fly_from((&model).into(), &(&start).into(), schedule, plan, observer, row)
}

/// Flies a plan with an airframe from a trim.
fn fly_from<E: From<PipelineError>>(
    airframe: Airframe<'_>,
    start: &Start,
    schedule: Option<&Schedule>,
    plan: &FlightPlan,
    observer: &dyn Observer,
    mut row: impl FnMut(&[Column], &[f64]) -> Result<(), E>,
) -> Result<Flown, E> {
    let law = schedule.map(autopilot).transpose()?;
    let maneuver = plan.variation.fly_in(&plan.maneuver);
    let options = Options { extra_delay: plan.variation.delay, ..plan.options.clone() };
    let mut flight = Flight::of(airframe, start, law.as_ref(), &maneuver, &options)
        .map_err(PipelineError::from)?;
    let mut recorder = Recorder::new(&flight);
    let columns = recorder.columns().to_vec();
    row(&columns, &[])?;
    let running = Running::begin(observer, Task::Flight, maneuver.duration.ceil() as usize)?;
    let mut meter = Meter::new(&flight);
    let (mut count, mut seconds) = (0u64, 0u64);
    let mut failure: Option<E> = None;
    let status = flight.fly_while(|flight| {
        meter.see(flight);
        if count.is_multiple_of(plan.every.max(1))
            && let Err(error) = row(&columns, recorder.row(flight))
        {
            failure = Some(error);
            return false;
        }
        count += 1;
        while (seconds as f64) < flight.simulator.time().floor() {
            seconds += 1;
            observer.advance();
        }
        !observer.cancelled()
    });
    drop(running);
    if let Some(error) = failure {
        return Err(error);
    }
    let Some(status) = status else {
        return Err(PipelineError::Cancelled.into());
    };
    Ok(Flown {
        metrics: meter.finish(&flight, &status),
        interactions: airframe.vehicle().map(|vehicle| vehicle.inflow.interactions),
        integration_step: flight.simulator.integration_step(),
        delay: flight.simulator.delay(),
        revolution: airframe.revolution(),
        status,
        columns,
    })
}

/// The law of a schedule and the sticks that it may use.
fn autopilot(schedule: &Schedule) -> Result<Autopilot, PipelineError> {
    Ok(Autopilot { table: schedule.law()?, stick_limits: schedule.stick_limits })
}
