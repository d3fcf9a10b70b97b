//! Level flight of a problem, trimmed and linearised.

use super::ValidationError;
use crate::linear::linearize::{Options as LinearOptions, linearize};
use crate::linear::reduction::{RIGID_BODY, residualise};
use crate::linear::{PeriodicModel, StateSpace};
use crate::problem::Problem;
use crate::trim::{FlightCondition, Options, TrimPoint, sweep};
use crate::units::KNOT;
use crate::vehicle::Vehicle;

/// A level flight and its linear models.
#[derive(Debug, Clone)]
pub struct LevelFlight {
    /// The trim.
    pub point: TrimPoint,
    /// The periodic model, sampled from azimuth zero on.
    pub periodic: PeriodicModel,
    /// Its average over the period, all states.
    pub averaged: StateSpace,
    /// The average, residualised to u v w p q r φ θ.
    pub reduced: StateSpace,
}

impl LevelFlight {
    /// Trims and linearises a problem at a true airspeed in kt, with or without
    /// rotor-on-rotor interactions.
    ///
    /// # Errors
    /// A vehicle that cannot be built, trimmed or linearised.
    pub fn of(problem: &Problem, knots: f64, interactions: bool) -> Result<Self, ValidationError> {
        let mut problem = problem.clone();
        problem.inflow.interactions = interactions;
        let vehicle = Vehicle::new(&problem)?;
        // Halfway first: a fast trim then starts from a neighbour.
        let speeds = if knots > 0.0 { vec![0.5 * knots, knots] } else { vec![0.0] };
        let conditions: Vec<FlightCondition> =
            speeds.into_iter().map(|speed| FlightCondition::level(speed * KNOT)).collect();
        let mut points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
        let last = points.remove(points.len() - 1);
        let trim = last.into_converged().map_err(|point| ValidationError::Trim {
            aircraft: problem.name.clone(),
            condition: format!("{knots:.0} kt"),
            status: format!("{:?}", point.status),
        })?;
        let periodic = linearize(&vehicle, &trim, &LinearOptions::default())?.model;
        let averaged = periodic.averaged();
        let reduced = residualise(&averaged, &RIGID_BODY)?.model;
        Ok(Self { point: trim.point().clone(), periodic, averaged, reduced })
    }
}
