//! Trims over many conditions.

use crate::trim::condition::FlightCondition;
use crate::trim::path::LevelFlight;
use crate::trim::solve::{Options, TrimPoint};
use crate::vehicle::Vehicle;
use rayon::prelude::*;
use std::sync::Mutex;

/// The points of a sweep, in the order asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// One a condition.
    pub points: Vec<TrimPoint>,
}

impl Sweep {
    /// Whether every point is on its orbit.
    #[must_use]
    pub fn all_on_orbit(&self) -> bool {
        self.points.iter().all(TrimPoint::on_orbit)
    }
}

/// The trim of every condition: that which continues level flight (see
/// [`path`](super::path)), whatever else is in the list. Points share the way
/// through level flight and are worked on in parallel; none of them depends on
/// another. `progress` hears of every finished point.
pub fn sweep(
    vehicle: &Vehicle,
    conditions: &[FlightCondition],
    options: &Options,
    progress: impl FnMut(&TrimPoint) + Send,
) -> Sweep {
    let level = LevelFlight::new(vehicle, conditions, options);
    let progress = Mutex::new(progress);
    let points: Vec<TrimPoint> = conditions
        .par_iter()
        .map(|&condition| {
            let point = level.trim(condition);
            if let Ok(mut progress) = progress.lock() {
                progress(&point);
            }
            point
        })
        .collect();
    let swept = Sweep { points };
    tracing::info!(
        rotorcraft = vehicle.name,
        points = swept.points.len(),
        on_orbit = swept.points.iter().filter(|point| point.on_orbit()).count(),
        iterations = swept.points.iter().map(|point| point.iterations).sum::<usize>(),
        "trim sweep"
    );
    swept
}

/// The trim of one condition: bit for bit that of [`sweep`].
#[must_use]
pub fn trim_at(vehicle: &Vehicle, condition: FlightCondition, options: &Options) -> TrimPoint {
    LevelFlight::new(vehicle, &[condition], options).trim(condition)
}
