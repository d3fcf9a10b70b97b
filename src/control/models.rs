//! From a problem, or from a set of linear models, to the plants of every model
//! and speed.

use super::plant::{
    Inversion, Matrix8, Matrix8x4, ModelSet, Plant, PlantError, RIGID_STATES, TrimPoint,
};
use super::spec::ModelSpec;
use crate::linear::linearize::{self, averaged};
use crate::linear::model::{Channel, StateSpace};
use crate::linear::{LinearError, reduction, structure};
use crate::lti::mapping::Inertia;
use crate::lti::stitch::{StitchError, Stitched};
use crate::lti::{LtiSet, PointModel};
use crate::problem::{Problem, STICKS};
use crate::trim::condition::FlightCondition;
use crate::trim::solve::{Options, TrimPoint as Trim};
use crate::trim::sweep::sweep;
use crate::units::Kind;
use crate::vehicle::{Vehicle, VehicleError};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Why the plants could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    /// The varied problem makes no vehicle.
    #[error("model '{model}': {source}")]
    Vehicle {
        /// Model.
        model: String,
        /// Cause.
        source: VehicleError,
    },
    /// No speed is left.
    #[error(
        "there is no speed at which every model trims: model '{model}' at {speed:.1} m/s: {reason}"
    )]
    Trim {
        /// Model.
        model: String,
        /// Speed, m/s.
        speed: f64,
        /// What the trim says.
        reason: String,
    },
    /// Linearisation or reduction failed.
    #[error("model '{model}' at {speed:.1} m/s: {source}")]
    Linear {
        /// Model.
        model: String,
        /// Speed, m/s.
        speed: f64,
        /// Cause.
        source: LinearError,
    },
    /// The plant is unusable.
    #[error("model '{model}': {source}")]
    Plant {
        /// Model.
        model: String,
        /// Cause.
        source: PlantError,
    },
    /// A set of linear models cannot be varied like a problem.
    #[error(
        "model '{model}' of the specification asks for another {what}, which linear models from \
         elsewhere do not know"
    )]
    Variation {
        /// Model.
        model: String,
        /// `wake interaction` or `altitude`.
        what: &'static str,
    },
    /// A set of linear models makes no continuous model.
    #[error("model '{model}': {source}")]
    Stitch {
        /// Model.
        model: String,
        /// Cause.
        source: StitchError,
    },
    /// The law would cancel a zero that grows.
    #[error(
        "{label}: the law inverts bank, pitch, yaw rate and vertical velocity, and what is left of \
         the motion then grows at {growth:.2} 1/s (a zero at {growth:.2} {frequency:+.2}i rad/s): \
         this model cannot be inverted"
    )]
    NonMinimumPhase {
        /// The model.
        label: String,
        /// Real part of the zero, 1/s.
        growth: f64,
        /// Imaginary part, rad/s.
        frequency: f64,
    },
    /// No speed of the set.
    #[error(
        "none of the speeds asked for, {asked}, is among those of the set of models, {low} to {high}"
    )]
    NoSpeed {
        /// Speeds asked for, in words.
        asked: String,
        /// Least speed of the set, in words.
        low: String,
        /// Greatest speed of the set, in words.
        high: String,
    },
    /// The caller asked to stop.
    #[error("stopped before the end")]
    Stopped,
}

/// A model and speed without a trim.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LeftOut {
    /// Model.
    pub model: String,
    /// Speed, m/s.
    pub speed: f64,
    /// What the trim says.
    pub reason: String,
}

/// Plants, and what is missing among them.
#[derive(Debug, Clone)]
pub struct Built {
    /// Plants at the speeds at which every model trims.
    pub set: ModelSet,
    /// Models and speeds without a trim.
    pub left_out: Vec<LeftOut>,
}

/// A problem varied as a model asks.
pub fn varied(problem: &Problem, model: &ModelSpec) -> Problem {
    let mut p = problem.clone();
    let m = &mut p.mass;
    for v in
        [&mut m.mass, &mut m.i_xx, &mut m.i_yy, &mut m.i_zz, &mut m.i_xz, &mut m.i_xy, &mut m.i_yz]
    {
        *v *= model.mass_scale;
    }
    m.center_of_gravity.fuselage_station += model.center_of_gravity_shift;
    if let Some(altitude) = model.altitude {
        p.atmosphere.altitude = altitude;
    }
    p
}

/// Plants of every model at every speed, m/s. Models are worked on in
/// parallel; the result does not depend on it. `progress` hears of every
/// trim.
///
/// A speed at which a model does not trim is left out for all of them, and
/// named in [`Built::left_out`].
///
/// # Errors
/// A model without a vehicle, a trim that cannot be linearised or reduced, or
/// no speed at which all models trim.
pub fn build(
    problem: &Problem,
    models: &[ModelSpec],
    speeds: &[f64],
    progress: &(dyn Fn() + Sync),
) -> Result<Built, ModelsError> {
    build_until(problem, models, speeds, progress, &|| false)
}

/// As [`build`], but stops between models and speeds once `stop` says so.
///
/// # Errors
/// As [`build`], and [`ModelsError::Stopped`].
pub fn build_until(
    problem: &Problem,
    models: &[ModelSpec],
    speeds: &[f64],
    progress: &(dyn Fn() + Sync),
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Built, ModelsError> {
    let go_on = || if stop() { Err(ModelsError::Stopped) } else { Ok(()) };
    let columns: Vec<Vec<Result<Plant, LeftOut>>> = models
        .par_iter()
        .map(|model| {
            go_on()?;
            let name = || model.info.name.clone();
            let vehicle_error = |source| ModelsError::Vehicle { model: name(), source };
            let mut vehicle = Vehicle::new(&varied(problem, model)).map_err(vehicle_error)?;
            if let Some(on) = model.interactions {
                vehicle = vehicle.with_interactions(on).map_err(vehicle_error)?;
            }
            let conditions: Vec<FlightCondition> =
                speeds.iter().map(|&v| FlightCondition::level(v)).collect();
            let trims = sweep(&vehicle, &conditions, &Options::default(), |_| progress());
            trims
                .points
                .into_par_iter()
                .zip(speeds)
                .map(|(point, &speed)| {
                    go_on()?;
                    let reason = point.status.word().to_string();
                    let trim_point = airframe(&point);
                    let Ok(converged) = point.into_converged() else {
                        return Ok(Err(LeftOut { model: name(), speed, reason }));
                    };
                    let full = averaged(&vehicle, &converged, &linearize::Options::default())
                        .map_err(|source| ModelsError::Linear { model: name(), speed, source })?;
                    from_state_space(&full, speed, trim_point)
                        .map(Ok)
                        .map_err(|source| ModelsError::Linear { model: name(), speed, source })
                })
                .collect::<Result<Vec<_>, _>>()
        })
        .collect::<Result<_, _>>()?;
    let mut left_out = Vec::new();
    let mut plants: Vec<Vec<Plant>> = Vec::new();
    for v in 0..speeds.len() {
        let mut list = Vec::with_capacity(models.len());
        for column in &columns {
            match &column[v] {
                Ok(plant) => list.push(plant.clone()),
                Err(missing) => left_out.push(missing.clone()),
            }
        }
        if list.len() == models.len() {
            plants.push(list);
        }
    }
    if plants.is_empty() {
        let LeftOut { model, speed, reason } = left_out.first().cloned().unwrap_or_default();
        return Err(ModelsError::Trim { model, speed, reason });
    }
    for list in &plants {
        for (plant, model) in list.iter().zip(models) {
            plant
                .check()
                .map_err(|source| ModelsError::Plant { model: model.info.name.clone(), source })?;
        }
    }
    tracing::info!(
        models = models.len(),
        speeds = plants.len(),
        left_out = left_out.len(),
        "models to tune on"
    );
    let set = ModelSet { models: models.iter().map(|m| m.info.clone()).collect(), plants };
    Ok(Built { set, left_out })
}

/// Growth of a zero of the inverted outputs from which a model is refused, 1/s.
/// Slower ones are drifts of the horizontal velocity, which the outer loops or
/// the pilot hold.
pub const FASTEST_ZERO: f64 = 0.5;

/// A schedule may begin or end so far beyond the models of a set, m/s.
const BEYOND: f64 = 1.6;

/// Plants of linear models from elsewhere at these speeds, m/s, for every model
/// of a specification. At the speeds of the set they are its models; between
/// them, and with another mass or centre of gravity, those of the stitched
/// model.
///
/// # Errors
/// A model of the specification that the set cannot give, models that cannot be
/// stitched, reduced or inverted, or no speed within the set.
pub fn from_set(
    set: &LtiSet,
    inertia: Option<Inertia>,
    models: &[ModelSpec],
    speeds: &[f64],
) -> Result<Built, ModelsError> {
    let whole = set.speeds();
    let (low, high) = (whole[0], whole[whole.len() - 1]);
    let mut columns = Vec::with_capacity(models.len());
    let base = Stitched::new(set, inertia).map_err(|source| ModelsError::Stitch {
        model: models.first().map_or_else(String::new, |m| m.info.name.clone()),
        source,
    })?;
    for model in models {
        let name = || model.info.name.clone();
        let cannot = |what| ModelsError::Variation { model: name(), what };
        if model.interactions.is_some() {
            return Err(cannot("wake interaction"));
        }
        if model.altitude.is_some() {
            return Err(cannot("altitude"));
        }
        let stitch = |source| ModelsError::Stitch { model: name(), source };
        let varied =
            base.varied(model.mass_scale, model.center_of_gravity_shift).map_err(stitch)?;
        let inside = |v: &&f64| **v >= low - BEYOND && **v <= high + BEYOND;
        let column: Vec<Plant> = speeds
            .iter()
            .filter(inside)
            .map(|&speed| {
                let own = set.at(speed).filter(|_| varied.as_given()).cloned();
                let point = match own {
                    Some(point) => point,
                    None => varied.at(speed).map_err(stitch)?,
                };
                let failed = |source| ModelsError::Linear { model: name(), speed, source };
                let plant = from_point(&point, speed).map_err(failed)?;
                plant.check().map_err(|source| ModelsError::Plant { model: name(), source })?;
                minimum_phase(&point, &plant)?;
                Ok(plant)
            })
            .collect::<Result<_, ModelsError>>()?;
        columns.push(column);
    }
    let words = |v: &f64| Kind::Airspeed.in_both(*v);
    let inside = |v: f64| v >= low - BEYOND && v <= high + BEYOND;
    let mut left_out = Vec::new();
    for speed in speeds.iter().filter(|v| !inside(**v)) {
        left_out.extend(models.iter().map(|model| LeftOut {
            model: model.info.name.clone(),
            speed: *speed,
            reason: format!("the set of models is for {} to {}", words(&low), words(&high)),
        }));
    }
    let count = columns.first().map_or(0, Vec::len);
    if count == 0 {
        return Err(ModelsError::NoSpeed {
            asked: speeds.iter().map(words).collect::<Vec<_>>().join(", "),
            low: words(&low),
            high: words(&high),
        });
    }
    let plants =
        (0..count).map(|v| columns.iter().map(|column| column[v].clone()).collect()).collect();
    let set = ModelSet { models: models.iter().map(|m| m.info.clone()).collect(), plants };
    Ok(Built { set, left_out })
}

/// A plant of a model from elsewhere.
///
/// # Errors
/// Inner states that cannot be residualised.
pub fn from_point(point: &PointModel, speed: f64) -> Result<Plant, LinearError> {
    let trim = &point.trim;
    let plant = from_state_space(
        &point.model,
        speed,
        TrimPoint {
            velocity_body: trim.velocity_body,
            roll: trim.roll,
            pitch: trim.pitch,
            sticks: trim.sticks,
        },
    )?;
    Ok(Plant { measured: point.measured, ..plant })
}

/// Refuses a model that grows under exact inversion.
fn minimum_phase(point: &PointModel, plant: &Plant) -> Result<(), ModelsError> {
    let failed = |source| ModelsError::Plant { model: point.label.clone(), source };
    let inversion = Inversion::new(plant).map_err(failed)?;
    let linear =
        |source| ModelsError::Linear { model: point.label.clone(), speed: plant.speed, source };
    let channels = |names: &[&str]| -> Vec<Channel> {
        names.iter().map(|n| Channel::new(*n, Kind::Dimensionless)).collect()
    };
    let reduced = StateSpace::new(
        channels(&RIGID_STATES),
        channels(&STICKS),
        channels(&["phi", "theta", "r", "vertical_velocity"]),
        DMatrix::from_fn(8, 8, |i, j| plant.reduced_a[(i, j)]),
        DMatrix::from_fn(8, 4, |i, j| plant.reduced_b[(i, j)]),
        DMatrix::from_fn(4, 8, |i, j| inversion.outputs[(i, j)]),
        DMatrix::zeros(4, 4),
    )
    .map_err(linear)?;
    let zeros = structure::zeros(&reduced).map_err(linear)?;
    match zeros.iter().max_by(|a, b| a.re.total_cmp(&b.re)) {
        Some(zero) if zero.re > FASTEST_ZERO => Err(ModelsError::NonMinimumPhase {
            label: point.label.clone(),
            growth: zero.re,
            frequency: zero.im,
        }),
        _ => Ok(()),
    }
}

/// The part of a trim that the control law needs.
pub fn airframe(point: &Trim) -> TrimPoint {
    let body = crate::vehicle::Layout::BODY;
    let m = &point.mean_state;
    TrimPoint {
        velocity_body: std::array::from_fn(|i| m[body.velocity + i]),
        roll: m[body.roll],
        pitch: m[body.pitch],
        sticks: point.sticks,
    }
}

/// A plant from a full-order model with sticks as inputs.
///
/// # Errors
/// A model without the eight rigid-body states or the four sticks, or whose
/// fast part cannot be residualised.
pub fn from_state_space(
    full: &StateSpace,
    speed: f64,
    trim: TrimPoint,
) -> Result<Plant, LinearError> {
    let full = full.select_inputs(&STICKS)?;
    let reduced =
        reduction::residualise(&full, &RIGID_STATES)?.model.reorder_states(&RIGID_STATES)?;
    let mut measured = [0; 8];
    for (place, name) in measured.iter_mut().zip(RIGID_STATES) {
        *place = full.state(name)?;
    }
    Ok(Plant {
        speed,
        a: full.a().clone(),
        b: full.b().clone(),
        measured,
        reduced_a: Matrix8::from_fn(|i, j| reduced.a()[(i, j)]),
        reduced_b: Matrix8x4::from_fn(|i, j| reduced.b()[(i, j)]),
        trim,
    })
}
