//! From a problem to the plants of every model and speed.

use super::plant::{Matrix8, Matrix8x4, ModelSet, Plant, PlantError, RIGID_STATES, TrimPoint};
use super::spec::ModelSpec;
use crate::linear::linearize::{self, averaged};
use crate::linear::model::StateSpace;
use crate::linear::{LinearError, reduction};
use crate::problem::{Problem, STICKS};
use crate::trim::condition::FlightCondition;
use crate::trim::solve::{Options, TrimPoint as Trim};
use crate::trim::sweep::sweep;
use crate::vehicle::{Vehicle, VehicleError};
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
