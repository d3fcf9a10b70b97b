//! What a flight amounts to, summed up as it goes.

use super::flight::{Flight, Status};
use super::simulator::Simulator;
use crate::control::law::Horizontal;
use crate::problem::STICKS;
use crate::units::{KNOT, STANDARD_GRAVITY};
use crate::vehicle::Layout;
use serde::Serialize;
use std::collections::VecDeque;

/// Schema of the metrics file.
pub const SCHEMA: &str = "coaxdesign.simulation/1";

/// How long a commanded turn rate must have stood for the turn to be steady,
/// s.
const SETTLED: f64 = 2.5;
/// Speed above which bank is compared with that of a coordinated turn, m/s:
/// the paper's turn-coordination speed.
pub const COORDINATED: f64 = 50.0 * KNOT;

/// Airspeeds along x this near to the end of a set are within it, m/s: a model
/// at 1 kt stands for hover.
const AXIAL_ROUNDING: f64 = 1.0;

/// Root mean square and peak of an error.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ErrorSize {
    /// Root mean square.
    pub rms: f64,
    /// Largest magnitude.
    pub peak: f64,
    /// When that was, s.
    pub peak_time_s: f64,
}

/// A sum of squares and a peak on their way.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    squares: f64,
    count: f64,
    peak: f64,
    time: f64,
}

impl Sum {
    fn add(&mut self, time: f64, value: f64) {
        self.squares += value * value;
        self.count += 1.0;
        if value.abs() > self.peak {
            (self.peak, self.time) = (value.abs(), time);
        }
    }

    fn size(&self) -> Option<ErrorSize> {
        (self.count > 0.0).then(|| ErrorSize {
            rms: (self.squares / self.count).sqrt(),
            peak: self.peak,
            peak_time_s: self.time,
        })
    }
}

/// A named error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tracking {
    /// What is tracked.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// Whether the manoeuvre commands it; if not, the error is the off-axis
    /// response.
    pub commanded: bool,
    /// Its size.
    #[serde(flatten)]
    pub size: ErrorSize,
}

/// How an actuator was used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ActuatorUse {
    /// Blade control.
    pub control: String,
    /// Least position, rad.
    pub minimum_rad: f64,
    /// Greatest position, rad.
    pub maximum_rad: f64,
    /// Largest share of the way from the start to the nearer limit that was
    /// used, %.
    pub travel_used_percent: f64,
    /// Largest rate, rad/s.
    pub rate_rad_s: f64,
    /// Largest rate over its limit, %.
    pub rate_used_percent: f64,
    /// Time at a limit of position or rate, s.
    pub saturated_s: f64,
}

/// How the actuator of a stick was used: of a stitched model, whose effectors
/// are the sticks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StickUse {
    /// Stick.
    pub stick: &'static str,
    /// Least position, %.
    pub minimum_percent: f64,
    /// Greatest position, %.
    pub maximum_percent: f64,
    /// Largest share of the way from the start to the nearer limit that was
    /// used, %.
    pub travel_used_percent: f64,
    /// Largest rate, %/s.
    pub rate_percent_s: f64,
    /// Time at a limit of position, s.
    pub saturated_s: f64,
}

/// Flight beyond the speeds of a set of linear models.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Beyond {
    /// Least and largest airspeed along the body's x axis that the set has,
    /// m/s.
    pub range_m_s: [f64; 2],
    /// Time outside it, s.
    pub time_s: f64,
}

/// Range of a state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Range {
    /// State.
    pub state: String,
    /// Unit, SI.
    pub unit: &'static str,
    /// Least value.
    pub minimum: f64,
    /// Greatest value.
    pub maximum: f64,
}

/// Power over a flight, means over a revolution.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Power {
    /// Mean, W.
    pub mean_w: f64,
    /// Largest, W.
    pub peak_w: f64,
}

/// How the flight ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct End {
    /// `completed`, `limit` or `diverged`.
    pub status: &'static str,
    /// The state that left its bounds.
    pub state: Option<String>,
    /// When the flight ended, s.
    pub time_s: f64,
    /// Value of that state, SI.
    pub value: Option<f64>,
    /// The bound it passed, SI; null where the value was not finite.
    pub bound: Option<f64>,
}

/// What a flight amounts to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metrics {
    /// How it ended.
    pub end: End,
    /// Errors against the references of the law.
    pub tracking: Vec<Tracking>,
    /// Errors of the velocities against first-order lags of their commands
    /// alone, without what the attitude command model and the delay take:
    /// under velocity commands.
    pub command_lag: Vec<Tracking>,
    /// Error of the heading rate while the commanded one has stood for two
    /// and a half seconds and is not zero, mean over a revolution, rad/s.
    pub steady_turn_rate_error_rad_s: Option<f64>,
    /// Difference of bank from φ_start + atan(V ψ'/g) above 50 kt, means over
    /// a revolution, rad.
    pub coordinated_bank_error_rad: Option<ErrorSize>,
    /// Largest bank either way, rad.
    pub roll_peak_rad: f64,
    /// Largest pitch either way, rad.
    pub pitch_peak_rad: f64,
    /// Largest change of each stick, lat, lon, col, ped, from one control
    /// period to the next, %.
    pub stick_jump_percent: [f64; 4],
    /// Actuators of blade pitch.
    pub actuators: Vec<ActuatorUse>,
    /// Actuators of the sticks, for a stitched model without its hardware.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stick_actuators: Vec<StickUse>,
    /// Flight beyond the set, for a stitched model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_models: Option<Beyond>,
    /// Time during which any actuator was at a limit, no less than, s.
    pub saturated_s: f64,
    /// Power of all rotors; none of a stitched model, which has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power: Option<Power>,
    /// Largest distance over the ground from the start, m.
    pub drift_m: f64,
    /// Greatest loss and gain of height from the start, m.
    pub height_change_m: [f64; 2],
    /// Range of every state.
    pub states: Vec<Range>,
}

/// Mean over the last revolution.
#[derive(Debug, Clone)]
struct Moving {
    values: VecDeque<f64>,
    length: usize,
    sum: f64,
}

impl Moving {
    fn new(length: usize) -> Self {
        Self { values: VecDeque::with_capacity(length + 1), length, sum: 0.0 }
    }

    /// The mean, once a whole revolution has passed.
    fn add(&mut self, value: f64) -> Option<f64> {
        self.values.push_back(value);
        self.sum += value;
        if self.values.len() > self.length {
            self.sum -= self.values.pop_front().unwrap_or_default();
        }
        (self.values.len() == self.length).then(|| self.sum / self.length as f64)
    }
}

/// Channels of tracking: name, unit.
const CHANNELS: [(&str, &str); 6] = [
    ("forward_velocity", "m/s"),
    ("right_velocity", "m/s"),
    ("climb_rate", "m/s"),
    ("phi", "rad"),
    ("theta", "rad"),
    ("yaw_rate", "rad/s"),
];

/// Sums up a flight, in memory that does not grow with it.
#[derive(Debug, Clone)]
pub struct Meter {
    tracking: [Sum; CHANNELS.len()],
    command_lag: [Sum; 2],
    turn: f64,
    turn_seen: bool,
    standing: (f64, f64),
    heading_rate: Moving,
    bank_reference: Moving,
    bank: Sum,
    power: Moving,
    power_sum: f64,
    power_count: f64,
    power_peak: f64,
    powers: Vec<f64>,
    attitude: [f64; 2],
    sticks: Option<[f64; 4]>,
    jumps: [f64; 4],
    actuators: Vec<([f64; 2], f64)>,
    actuator_start: Vec<f64>,
    drift: f64,
    height: [f64; 2],
    states: Vec<[f64; 2]>,
    /// Control periods outside the speeds of a set.
    beyond: u64,
    bank_start: f64,
    turn_start: f64,
}

impl Meter {
    /// A meter for a flight that has not begun.
    #[must_use]
    pub fn new(flight: &Flight<'_>) -> Self {
        let simulator = &flight.simulator;
        let airframe = simulator.airframe();
        let samples = (airframe.revolution() / simulator.period()).round().max(1.0) as usize;
        let start: Vec<f64> = simulator.actuators().iter().map(|(_, a)| a.position).collect();
        let held = flight.held();
        // What the trim banks beyond its own turn.
        let turning = (simulator.airspeed() * held.turn_rate / STANDARD_GRAVITY).atan();
        Self {
            tracking: [Sum::default(); CHANNELS.len()],
            command_lag: [Sum::default(); 2],
            turn: 0.0,
            turn_seen: false,
            standing: (f64::NAN, 0.0),
            heading_rate: Moving::new(samples),
            bank_reference: Moving::new(samples),
            bank: Sum::default(),
            power: Moving::new(samples),
            power_sum: 0.0,
            power_count: 0.0,
            power_peak: 0.0,
            powers: vec![0.0; airframe.rotors().len()],
            attitude: [0.0; 2],
            sticks: None,
            jumps: [0.0; 4],
            actuators: start.iter().map(|&p| ([p, p], 0.0)).collect(),
            actuator_start: start,
            drift: 0.0,
            height: [0.0; 2],
            states: vec![[f64::INFINITY, f64::NEG_INFINITY]; airframe.state_count()],
            beyond: 0,
            bank_start: held.attitude[0] - turning,
            turn_start: held.turn_rate,
        }
    }

    /// Takes in an instant.
    pub fn see(&mut self, flight: &mut Flight<'_>) {
        flight.simulator.powers(&mut self.powers);
        let simulator = &flight.simulator;
        let (time, state, body) = (simulator.time(), simulator.state(), Layout::BODY);
        let [heading_rate, forward, right, down] = simulator.navigation();
        let airspeed = simulator.airspeed();
        if let (Some(demand), Some(reference)) = (flight.demand(), flight.references()) {
            let mut add = |k: usize, error: f64| self.tracking[k].add(time, error);
            if let (Some([x, y]), Horizontal::Velocity { .. }) =
                (reference.velocity, demand.horizontal)
            {
                add(0, forward - x);
                add(1, right - y);
            }
            if let Some([x, y]) = reference.velocity_lag {
                self.command_lag[0].add(time, forward - x);
                self.command_lag[1].add(time, right - y);
            }
            add(2, reference.vertical_velocity - down);
            add(3, state[body.roll] - reference.roll);
            add(4, state[body.pitch] - reference.pitch);
            add(5, state[body.rate + 2] - reference.yaw_rate);
            if demand.heading_rate != self.standing.0 {
                self.standing = (demand.heading_rate, time);
            }
            if let Some(mean) = self.heading_rate.add(heading_rate)
                && time - self.standing.1 >= SETTLED
                && demand.heading_rate != 0.0
            {
                self.turn = self.turn.max((mean - demand.heading_rate).abs());
                self.turn_seen = true;
            }
        }
        let coordinated = self.bank_start + (airspeed * heading_rate / STANDARD_GRAVITY).atan();
        if let Some(difference) = self.bank_reference.add(state[body.roll] - coordinated)
            && airspeed > COORDINATED
        {
            self.bank.add(time, difference);
        }
        if let Some(model) = simulator.airframe().stitched() {
            let [low, high] = model.axial_range();
            let u = simulator.axial_airspeed();
            let outside = u < low - AXIAL_ROUNDING || u > high + AXIAL_ROUNDING;
            self.beyond += u64::from(outside);
        }
        if let Some(mean) = self.power.add(self.powers.iter().sum()) {
            self.power_sum += mean;
            self.power_count += 1.0;
            self.power_peak = self.power_peak.max(mean);
        }
        for (peak, place) in self.attitude.iter_mut().zip([body.roll, body.pitch]) {
            *peak = peak.max(state[place].abs());
        }
        let sticks = flight.sticks();
        if let Some(before) = self.sticks {
            for ((jump, now), old) in self.jumps.iter_mut().zip(sticks).zip(before) {
                *jump = jump.max((now - old).abs());
            }
        }
        self.sticks = Some(sticks);
        for (([low, high], rate), (_, a)) in
            self.actuators.iter_mut().zip(simulator.actuators().iter())
        {
            *low = low.min(a.position);
            *high = high.max(a.position);
            *rate = rate.max(a.rate.abs());
        }
        let [north, east, below] = simulator.position();
        self.drift = self.drift.max(north.hypot(east));
        let change = flight.maneuver().start.height + below;
        self.height = [self.height[0].max(change), self.height[1].max(-change)];
        for ([low, high], x) in self.states.iter_mut().zip(state) {
            *low = low.min(*x);
            *high = high.max(*x);
        }
    }

    /// How the actuators were used: those of blade pitch, and those of sticks.
    fn actuator_use(&self, simulator: &Simulator<'_>) -> (Vec<ActuatorUse>, Vec<StickUse>) {
        let airframe = simulator.airframe();
        let rate_limit = simulator.options().pitch_rate_limit;
        let names = airframe.effectors();
        let (mut blades, mut sticks) = (Vec::new(), Vec::new());
        for (((place, a), ([low, high], rate)), start) in
            simulator.actuators().iter().zip(&self.actuators).zip(&self.actuator_start)
        {
            let [least, most] = a.limits;
            let used = ((high - start) / (most - start)).max((start - low) / (start - least));
            if airframe.vehicle().is_some() {
                blades.push(ActuatorUse {
                    control: names[place].0.clone(),
                    minimum_rad: *low,
                    maximum_rad: *high,
                    travel_used_percent: 100.0 * used,
                    rate_rad_s: *rate,
                    rate_used_percent: 100.0 * rate / rate_limit,
                    saturated_s: a.saturated,
                });
            } else {
                sticks.push(StickUse {
                    stick: STICKS[place],
                    minimum_percent: *low,
                    maximum_percent: *high,
                    travel_used_percent: 100.0 * used,
                    rate_percent_s: *rate,
                    saturated_s: a.saturated,
                });
            }
        }
        (blades, sticks)
    }

    /// What it all amounts to.
    #[must_use]
    pub fn finish(self, flight: &Flight<'_>, status: &Status) -> Metrics {
        let simulator = &flight.simulator;
        let airframe = simulator.airframe();
        let maneuver = flight.maneuver();
        let commanded = [
            maneuver.velocity[0].is_some(),
            maneuver.velocity[1].is_some(),
            maneuver.climb_rate.is_some(),
            maneuver.attitude[0].is_some(),
            maneuver.attitude[1].is_some(),
            maneuver.turn_rate.is_some() || self.turn_start != 0.0,
        ];
        let listed = |sums: &[Sum]| -> Vec<Tracking> {
            CHANNELS
                .iter()
                .zip(sums)
                .zip(commanded)
                .filter_map(|(((channel, unit), sum), commanded)| {
                    let size = sum.size()?;
                    Some(Tracking { channel: (*channel).into(), unit, commanded, size })
                })
                .collect()
        };
        let (tracking, command_lag) = (listed(&self.tracking), listed(&self.command_lag));
        let (actuators, stick_actuators) = self.actuator_use(simulator);
        let departure = status.departure();
        Metrics {
            end: End {
                status: status.word(),
                state: departure.map(|d| d.state.clone()),
                time_s: departure.map_or_else(|| simulator.time(), |d| d.time),
                value: departure.map(|d| d.value),
                bound: departure.map(|d| d.bound).filter(|b| b.is_finite()),
            },
            tracking,
            command_lag,
            steady_turn_rate_error_rad_s: self.turn_seen.then_some(self.turn),
            coordinated_bank_error_rad: self.bank.size(),
            roll_peak_rad: self.attitude[0],
            pitch_peak_rad: self.attitude[1],
            stick_jump_percent: self.jumps,
            saturated_s: (actuators.iter().map(|a| a.saturated_s))
                .chain(stick_actuators.iter().map(|a| a.saturated_s))
                .fold(0.0, f64::max),
            actuators,
            stick_actuators,
            beyond_models: airframe.stitched().map(|model| Beyond {
                range_m_s: model.axial_range(),
                time_s: self.beyond as f64 * simulator.period(),
            }),
            power: airframe.vehicle().map(|_| Power {
                mean_w: if self.power_count > 0.0 {
                    self.power_sum / self.power_count
                } else {
                    0.0
                },
                peak_w: self.power_peak,
            }),
            drift_m: self.drift,
            height_change_m: self.height,
            states: airframe
                .states()
                .into_iter()
                .zip(&self.states)
                .map(|((state, kind), [low, high])| Range {
                    state,
                    unit: kind.symbol(crate::units::System::Si),
                    minimum: *low,
                    maximum: *high,
                })
                .collect(),
        }
    }
}

impl Metrics {
    /// The tracking of a channel.
    #[must_use]
    pub fn tracked(&self, channel: &str) -> Option<&Tracking> {
        self.tracking.iter().find(|t| t.channel == channel)
    }
}
