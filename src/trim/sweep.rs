//! Many trim points, each from its neighbour.

use crate::trim::condition::FlightCondition;
use crate::trim::solve::{Guess, Options, Status, TrimPoint, trim};
use crate::vehicle::Vehicle;

/// Smallest fraction of the way between two conditions that homotopy tries.
const SMALLEST_FRACTION: f64 = 1.0 / 64.0;

/// Largest weight of a point in an extrapolation that is still trusted.
const LARGEST_WEIGHT: f64 = 5.0;

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

/// Trims at every condition in turn. Each point starts from a parabola through
/// the three before it, a straight line through two, or from the one before it;
/// where that fails,
/// from an estimate; where that fails too, the way from the last good point is
/// walked in smaller parts (homotopy in the condition). `progress` hears of
/// every finished point.
pub fn sweep(
    vehicle: &Vehicle,
    conditions: &[FlightCondition],
    options: &Options,
    mut progress: impl FnMut(&TrimPoint),
) -> Sweep {
    let mut points: Vec<TrimPoint> = Vec::with_capacity(conditions.len());
    for condition in conditions {
        let good: Vec<&TrimPoint> =
            points.iter().rev().filter(|point| point.on_orbit()).take(3).collect();
        let guess =
            predicted(&good, condition).unwrap_or_else(|| Guess::estimate(vehicle, condition));
        let mut point = trim(vehicle, *condition, &guess, options);
        // A condition can have several orbits. One beyond the limits may be a
        // neighbour's continuation while a better one exists.
        if point.status != Status::Converged && !good.is_empty() {
            let again = trim(vehicle, *condition, &Guess::estimate(vehicle, condition), options);
            if again.status == Status::Converged || (again.on_orbit() && !point.on_orbit()) {
                point = again;
            }
        }
        if !point.on_orbit() {
            tracing::debug!(airspeed_m_s = condition.airspeed, "trim: on by homotopy");
            let last = good.first().map(|last| (*last).clone());
            if let Some(found) = homotopy(vehicle, condition, last, options) {
                point = found;
            }
        }
        progress(&point);
        points.push(point);
    }
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

/// A guess on the curve through the given points, last first: through all of
/// them if they lie apart and the condition is near, else the last one.
fn predicted(good: &[&TrimPoint], condition: &FlightCondition) -> Option<Guess> {
    let last = *good.first()?;
    let distance = |a: &FlightCondition, b: &FlightCondition| {
        (a.airspeed - b.airspeed) + (a.climb_rate - b.climb_rate) + (a.turn_rate - b.turn_rate)
    };
    let places: Vec<f64> =
        good.iter().map(|point| distance(&point.condition, &last.condition)).collect();
    let here = distance(condition, &last.condition);
    let mut guess = last.guess();
    // Lagrange weights; a far extrapolation shows in large ones.
    let weights: Vec<f64> = (0..places.len())
        .map(|k| {
            let others = places.iter().enumerate().filter(|(other, _)| *other != k);
            others.map(|(_, place)| (here - place) / (places[k] - place)).product()
        })
        .collect();
    if weights.iter().all(|weight: &f64| weight.abs() <= LARGEST_WEIGHT) {
        let curve = |value: &dyn Fn(&TrimPoint) -> f64| -> f64 {
            good.iter().zip(&weights).map(|(point, weight)| weight * value(point)).sum()
        };
        for (k, value) in guess.state.iter_mut().enumerate() {
            *value = curve(&|point| point.state[k]);
        }
        for (k, value) in guess.sticks.iter_mut().enumerate() {
            *value = curve(&|point| point.sticks[k]);
        }
    }
    Some(guess)
}

/// Walks from a good point (or from hover) to a condition in parts as small as
/// they must be.
fn homotopy(
    vehicle: &Vehicle,
    goal: &FlightCondition,
    from: Option<TrimPoint>,
    options: &Options,
) -> Option<TrimPoint> {
    let mut here = match from {
        Some(point) => point,
        None => {
            let hover = FlightCondition { airspeed: 0.0, climb_rate: 0.0, turn_rate: 0.0, ..*goal };
            let point = trim(vehicle, hover, &Guess::estimate(vehicle, &hover), options);
            if !point.on_orbit() {
                return None;
            }
            point
        }
    };
    let start = here.condition;
    let mix = |a: f64, b: f64, t: f64| a + t * (b - a);
    let (mut done, mut part) = (0.0, 0.5);
    while done < 1.0 {
        let t = f64::min(done + part, 1.0);
        let condition = if t >= 1.0 {
            *goal
        } else {
            FlightCondition {
                airspeed: mix(start.airspeed, goal.airspeed, t),
                climb_rate: mix(start.climb_rate, goal.climb_rate, t),
                turn_rate: mix(start.turn_rate, goal.turn_rate, t),
                lateral: goal.lateral,
            }
        };
        let point = trim(vehicle, condition, &here.guess(), options);
        if point.on_orbit() {
            here = point;
            done = t;
            part = (2.0 * part).min(0.5);
        } else {
            part *= 0.5;
            tracing::debug!(done, part, "trim: a smaller part of the way");
            if part < SMALLEST_FRACTION {
                return None;
            }
        }
    }
    Some(here)
}
