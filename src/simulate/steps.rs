//! Small steps, flown and predicted: the nonlinear closed loop beside the
//! linear one, in time.
//!
//! The linear flight is the full-order averaged model with the same equipment
//! (actuators and the held command by their exact solution, delay, sensor
//! filters) under the same discrete law. What it leaves out is what this
//! measures: everything that is not linear, and everything that is periodic.
//! From either flight the same flight without the step is taken away, so that
//! neither the swing with the azimuth nor an initial error counts.

use super::airframe::{Airframe, Start};
use super::equipment::{Delay, MEASURED, SensorFilter};
use super::flight::{Autopilot, Flight, FlightError, Status};
use super::identify::IdentifyError;
use super::maneuver::{Held, Maneuver, Mode, Profile};
use super::simulator::{Options, Simulator};
use crate::control::axis::Channel;
use crate::control::law::{Controller, LawTable, Measurement, earth_velocity};
use crate::control::plant::Plant;
use crate::vehicle::Layout;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// When a step is commanded, s.
const START: f64 = 1.0;
/// How long the inner loops are watched, s.
const INNER: f64 = 8.0;
/// How long the outer loops are watched, s.
const OUTER: f64 = 16.0;

/// Size of the step in a channel: 1°, 1°/s, 0.5 m/s.
#[must_use]
pub fn size(channel: Channel) -> f64 {
    match channel {
        Channel::Roll | Channel::Pitch | Channel::Yaw => 1f64.to_radians(),
        Channel::Heave | Channel::Vx | Channel::Vy => 0.5,
    }
}

/// A step in one channel: changes of the commanded quantity (φ, θ, r, V_z down,
/// V_x, V_y) that it brings about.
#[derive(Debug, Clone, PartialEq)]
pub struct SmallStep {
    /// Channel.
    pub channel: Channel,
    /// Times from the command on, s.
    pub time: Vec<f64>,
    /// Nonlinear, rad, rad/s or m/s.
    pub flown: Vec<f64>,
    /// Linear.
    pub linear: Vec<f64>,
}

impl SmallStep {
    /// Root mean square of the difference over that of the linear response.
    #[must_use]
    pub fn difference(&self) -> f64 {
        let (mut apart, mut whole) = (0.0, 0.0);
        for (a, b) in self.flown.iter().zip(&self.linear) {
            apart += (a - b) * (a - b);
            whole += b * b;
        }
        (apart / whole).sqrt()
    }

    /// Largest difference over the largest linear response.
    #[must_use]
    pub fn largest_difference(&self) -> f64 {
        let most = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
        let apart = most(&mut self.flown.iter().zip(&self.linear).map(|(a, b)| a - b));
        apart / most(&mut self.linear.iter().copied())
    }
}

/// The channels in which the law takes a step at a speed, m/s: inner ones, but
/// for bank where turn coordination has it, and outer ones that have gains.
#[must_use]
pub fn channels(law: &LawTable, speed: f64) -> Vec<Channel> {
    let gains = law.at(speed).gains;
    Channel::ALL
        .into_iter()
        .filter(|&channel| match channel {
            Channel::Roll => law.turn_blend(speed) < 1.0,
            _ => gains[channel.index()].k_p > 0.0,
        })
        .collect()
}

/// Steps in channels from a trim, flown and predicted. `plant` is the
/// linearisation about that trim.
///
/// # Errors
/// Options that make no sense, or a flight that leaves its bounds.
pub fn compare(
    airframe: Airframe<'_>,
    start: &Start,
    plant: &Plant,
    law: &Autopilot,
    options: &Options,
    channels: &[Channel],
) -> Result<Vec<SmallStep>, IdentifyError> {
    channels
        .par_iter()
        .map(|&channel| {
            let maneuvers = [size(channel), 0.0].map(|size| maneuver(start, channel, size));
            let [stepped, still] = &maneuvers;
            let flown = |maneuver: &Maneuver| nonlinear(airframe, start, law, options, maneuver);
            let predicted =
                |maneuver: &Maneuver| linear(airframe, start, plant, law, options, maneuver);
            let change = |stepped: Vec<Measurement>, still: Vec<Measurement>| -> Vec<f64> {
                let value = |m: &Measurement| commanded(m, channel);
                stepped.iter().zip(&still).map(|(a, b)| value(a) - value(b)).collect()
            };
            let flown = change(flown(stepped)?, flown(still)?);
            let linear = change(predicted(stepped)?, predicted(still)?);
            let period = 1.0 / options.control_rate;
            let first = (START / period).round() as usize;
            let time = (0..flown.len() - first).map(|k| k as f64 * period).collect();
            Ok(SmallStep {
                channel,
                time,
                flown: flown[first..].to_vec(),
                linear: linear[first..].to_vec(),
            })
        })
        .collect()
}

/// The quantity that a channel commands.
fn commanded(m: &Measurement, channel: Channel) -> f64 {
    let (down, [forward, right]) = earth_velocity(m);
    match channel {
        Channel::Roll => m.roll,
        Channel::Pitch => m.pitch,
        Channel::Yaw => m.rates[2],
        Channel::Heave => down,
        Channel::Vx => forward,
        Channel::Vy => right,
    }
}

/// A step of a size in one channel, everything else held.
fn maneuver(start: &Start, channel: Channel, size: f64) -> Maneuver {
    let outer = channel.is_outer();
    // Turning with the bank held would be a skid.
    let mode = if outer || channel == Channel::Yaw { Mode::Velocity } else { Mode::Attitude };
    let duration = START + if outer { OUTER } else { INNER };
    let mut m = Maneuver::hold(start.condition, mode, duration);
    let step = |from: f64, size: f64| {
        Some(Profile { times: vec![START; 2], values: vec![from, from + size], rounding: 0.0 })
    };
    let condition = start.condition;
    match channel {
        Channel::Roll => m.attitude[0] = step(0.0, size),
        Channel::Pitch => m.attitude[1] = step(0.0, size),
        Channel::Yaw => m.turn_rate = step(condition.turn_rate, size),
        // Down is positive in the law, up in a manoeuvre.
        Channel::Heave => m.climb_rate = step(condition.climb_rate, -size),
        Channel::Vx => {
            let level = condition.airspeed * condition.airspeed
                - condition.climb_rate * condition.climb_rate;
            m.velocity[0] = step(level.max(0.0).sqrt(), size);
        }
        Channel::Vy => m.velocity[1] = step(0.0, size),
    }
    m
}

/// What is so at every control period of the nonlinear flight, true values.
fn nonlinear(
    airframe: Airframe<'_>,
    start: &Start,
    law: &Autopilot,
    options: &Options,
    maneuver: &Maneuver,
) -> Result<Vec<Measurement>, IdentifyError> {
    let mut flight = Flight::of(airframe, start, Some(law), maneuver, options)?;
    let mut seen = Vec::new();
    let status = flight.fly(|flight| seen.push(truth(flight.simulator.state())));
    match status {
        Status::Completed => Ok(seen),
        Status::Limit(d) | Status::Diverged(d) => {
            Err(IdentifyError::Departed { state: d.state, time: d.time })
        }
    }
}

/// Airframe states as a measurement in calm air.
fn truth(x: &[f64]) -> Measurement {
    let body = Layout::BODY;
    let mut m = Measurement {
        velocity_body: [0, 1, 2].map(|k| x[body.velocity + k]),
        rates: [0, 1, 2].map(|k| x[body.rate + k]),
        roll: x[body.roll],
        pitch: x[body.pitch],
        airspeed: 0.0,
    };
    m.airspeed = earth_velocity(&m).1[0];
    m
}

fn signals(m: &Measurement) -> [f64; MEASURED] {
    let ([u, v, w], [p, q, r]) = (m.velocity_body, m.rates);
    [u, v, w, p, q, r, m.roll, m.pitch, m.airspeed]
}

/// The same on the linear model.
fn linear(
    airframe: Airframe<'_>,
    start: &Start,
    plant: &Plant,
    law: &Autopilot,
    options: &Options,
    maneuver: &Maneuver,
) -> Result<Vec<Measurement>, IdentifyError> {
    // Its times are the simulator's.
    let simulator = Simulator::of(airframe, start, options).map_err(FlightError::from)?;
    let (period, step) = (simulator.period(), simulator.integration_step());
    let substeps = (period / step).round() as usize;
    let tick = 0.5 * step;
    let mean = truth(&start.mean_state);
    let (vertical, [forward, right]) = earth_velocity(&mean);
    let held = Held {
        velocity: [forward, right, vertical],
        attitude: [mean.roll, mean.pitch],
        turn_rate: start.condition.turn_rate,
    };

    // States of the model, then positions and rates of actuators at the
    // sticks, as deviations; the command is held over a tick.
    let n = plant.a.nrows();
    let (position, rate, input) = (n, n + 4, n + 8);
    let hardware = airframe.hardware(options);
    let (w, z) = (hardware.actuator_bandwidth, hardware.actuator_damping);
    let mut m = DMatrix::zeros(n + 12, n + 12);
    m.view_mut((0, 0), (n, n)).copy_from(&plant.a);
    m.view_mut((0, position), (n, 4)).copy_from(&plant.b);
    for j in 0..4 {
        m[(position + j, rate + j)] = 1.0;
        m[(rate + j, position + j)] = -w * w;
        m[(rate + j, rate + j)] = -2.0 * z * w;
        m[(rate + j, input + j)] = w * w;
    }
    let transition = (m * tick).exp();
    if transition.iter().any(|x| !x.is_finite()) {
        return Err(IdentifyError::NotFinite);
    }
    let mut x = DVector::zeros(n + 12);
    let pure = hardware.delay + options.extra_delay - 0.5 * period;
    let mut delay = Delay::new(pure, tick, 2 * substeps, start.sticks);
    let mut filter = SensorFilter::new(hardware.sensor_bandwidth, step, signals(&mean));
    let mut controller = Controller::new(law.table.clone(), period, law.stick_limits);
    if let Some(demand) = maneuver.demand(0.0, &held) {
        controller.engage(&mean, &demand, start.sticks).map_err(|_| IdentifyError::NotFinite)?;
    }
    let now = |x: &DVector<f64>| {
        let mut state = signals(&mean);
        for (value, place) in state.iter_mut().zip(plant.measured) {
            *value += x[place];
        }
        truth(&state)
    };
    let mut seen = Vec::new();
    for k in 0..=(maneuver.duration / period).round() as usize {
        seen.push(now(&x));
        let [u, v, w, p, q, r, roll, pitch, airspeed] = *filter.value();
        let measured =
            Measurement { velocity_body: [u, v, w], rates: [p, q, r], roll, pitch, airspeed };
        if let Some(demand) = maneuver.demand(k as f64 * period, &held) {
            let sticks = controller.step(&measured, &demand);
            delay.push(sticks.map_err(|_| IdentifyError::NotFinite)?);
        }
        for substep in 0..substeps {
            for half in 0..2 {
                let command = delay.at(2 * substep + half);
                for j in 0..4 {
                    x[input + j] = command[j] - start.sticks[j];
                }
                x = &transition * x;
            }
            filter.advance(signals(&now(&x)));
        }
    }
    Ok(seen)
}
