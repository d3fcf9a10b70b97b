//! Trims at a given shaft power: the rate of climb follows from it.
//!
//! With no power that is autorotation at the nominal rotor speed, and the rate
//! of climb is its rate of descent.

use crate::trim::condition::FlightCondition;
use crate::trim::path::LevelFlight;
use crate::trim::solve::{Options, Status, TrimPoint};
use crate::vehicle::Vehicle;

/// Step in rate of climb between level flight and the first rate on the other
/// side of the power, part of the fastest tip speed.
const STEP: f64 = 1.0 / 64.0;
/// Most such steps.
const MOST_STEPS: usize = 32;
/// The power is met within this part of that of level flight.
const TOLERANCE: f64 = 1e-7;
/// Most corrections of the rate of climb.
const MOST_CORRECTIONS: usize = 40;

/// The trim at the horizontal speed, turn rate and sideslip or bank of a
/// condition whose total shaft power (W) is that asked for. Of several rates of
/// climb it is the first on the way from level flight, down or up. Where the
/// way ends before, the trim fails and says so.
#[must_use]
pub fn trim_at_power(
    vehicle: &Vehicle,
    condition: FlightCondition,
    power: f64,
    options: &Options,
) -> TrimPoint {
    let level = LevelFlight::new(vehicle, &[condition], options);
    let speed = condition.horizontal_speed();
    let at = |climb_rate: f64| {
        level.trim(FlightCondition {
            turn_rate: condition.turn_rate,
            lateral: condition.lateral,
            ..FlightCondition::climbing(speed, climb_rate)
        })
    };
    let fastest = vehicle.rotors.iter().map(|rotor| rotor.tip_speed()).fold(0.0, f64::max);
    let first = at(0.0);
    if !first.on_orbit() {
        return failed(first, power);
    }
    let needed = TOLERANCE * first.power.shaft.abs().max(power.abs());
    let surplus = |point: &TrimPoint| point.power.shaft - power;
    if surplus(&first).abs() <= needed {
        return first;
    }
    let step = -surplus(&first).signum() * STEP * fastest;
    let mut near = (0.0, surplus(&first));
    let mut far = None;
    for k in 1..=MOST_STEPS {
        let climb = k as f64 * step;
        let point = at(climb);
        if !point.on_orbit() {
            return failed(point, power);
        }
        let rest = surplus(&point);
        if rest.abs() <= needed {
            return point;
        }
        if rest.signum() != near.1.signum() {
            far = Some((climb, rest));
            break;
        }
        near = (climb, rest);
    }
    let Some(mut far) = far else {
        let last = at(near.0);
        return failed(last, power);
    };
    // False position, with half the weight of an end that stays (Illinois).
    let mut last = 0.0;
    for _ in 0..MOST_CORRECTIONS {
        let climb = (near.0 * far.1 - far.0 * near.1) / (far.1 - near.1);
        let point = at(climb);
        if !point.on_orbit() {
            return failed(point, power);
        }
        let rest = surplus(&point);
        if rest.abs() <= needed {
            return point;
        }
        if rest.signum() == near.1.signum() {
            near = (climb, rest);
            if last > 0.0 {
                far.1 *= 0.5;
            }
            last = 1.0;
        } else {
            far = (climb, rest);
            if last < 0.0 {
                near.1 *= 0.5;
            }
            last = -1.0;
        }
    }
    failed(at(near.0), power)
}

/// A point on the way as a failure to meet the power.
fn failed(mut point: TrimPoint, power: f64) -> TrimPoint {
    let place = point.condition.climb_rate;
    let why = match &point.status {
        Status::Failed { reason, .. } => format!("there is no trim there: {reason}"),
        _ => format!("it takes {:.0} W there", point.power.shaft),
    };
    let (equations, binding) = match point.status {
        Status::Failed { equations, binding, .. } => (equations, binding),
        _ => (Vec::new(), Vec::new()),
    };
    point.status = Status::Failed {
        equations,
        binding,
        reason: format!(
            "no rate of climb was found that takes {power:.0} W: the way from level flight ended at \
             {place:.2} m/s of climb; {why}"
        ),
    };
    point
}
