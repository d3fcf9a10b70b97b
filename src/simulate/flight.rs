//! A manoeuvre in flight: simulator, law and commands together.

use super::airframe::{Airframe, Start};
use super::maneuver::{Held, Input, Maneuver, Mode};
use super::simulator::{Departure, Options, SimulationError, Simulator};
use crate::control::axis::Axis;
use crate::control::law::{
    Controller, Demand, Horizontal, LawTable, Measurement, NotFinite, References, earth_velocity,
};
use crate::trim::ConvergedTrim;
use crate::vehicle::{Layout, Vehicle, navigation};

/// How a flight ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Status {
    /// It was flown to its end.
    Completed,
    /// A limit of the manoeuvre was passed.
    Limit(Departure),
    /// A state left the region in which the model means anything.
    Diverged(Departure),
}

impl Status {
    /// One word for tables and files.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Completed => "completed",
            Self::Limit(_) => "limit",
            Self::Diverged(_) => "diverged",
        }
    }

    /// What was passed, if anything.
    #[must_use]
    pub fn departure(&self) -> Option<&Departure> {
        match self {
            Self::Completed => None,
            Self::Limit(departure) | Self::Diverged(departure) => Some(departure),
        }
    }
}

/// Why a flight cannot begin.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FlightError {
    /// The simulator's options make no sense.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A law is needed.
    #[error("the manoeuvre needs a control law: give a schedule, or mode = \"open_loop\"")]
    NoLaw,
    /// Rotor speeds are held exactly.
    #[error(
        "the engine fails in this manoeuvre, but the vehicle's rotor speeds are no states: give \
         every rotor a governor"
    )]
    NoRotorSpeed,
    /// Linear models have no engine.
    #[error("the engine fails in this manoeuvre, but a set of linear models has none")]
    NoEngine,
    /// The trim or the manoeuvre's first demand is no number.
    #[error("the law cannot be switched on: {0}")]
    Law(#[from] NotFinite),
}

/// A law and the sticks that it may use.
#[derive(Debug, Clone, PartialEq)]
pub struct Autopilot {
    /// The law over speed.
    pub table: LawTable,
    /// Limits of lat, lon, col, ped, %.
    pub stick_limits: [[f64; 2]; 4],
}

/// A signal added at one place of the closed loop, for measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excitation {
    /// On a stick, behind the law.
    Stick(Input),
    /// On a held quantity, φ, θ, heading or V_z (down), as the gains that hold it
    /// see it, and nowhere else.
    Output(Axis, Input),
    /// On the commanded bank or pitch, under attitude commands.
    Command(Axis, Input),
}

/// A manoeuvre in flight.
///
/// Each control period has two halves: [`Flight::decide`] measures and gives
/// the sticks, [`Flight::advance`] flies until the next. Between them
/// everything belongs to one instant and may be recorded.
#[derive(Debug, Clone)]
pub struct Flight<'a> {
    /// The airframe and its equipment.
    pub simulator: Simulator<'a>,
    /// A signal to add.
    pub excitation: Option<Excitation>,
    probe: [f64; 2],
    maneuver: &'a Maneuver,
    controller: Option<Controller>,
    stick_limits: [[f64; 2]; 4],
    trim_sticks: [f64; 4],
    held: Held,
    demand: Option<Demand>,
    measurement: Option<Measurement>,
    /// Integral of the measured yaw rate, rad: the heading that the law holds.
    turned: f64,
    sticks: [f64; 4],
}

impl<'a> Flight<'a> {
    /// A manoeuvre from a trim. The options' weather, noise, height and heading
    /// are those of the manoeuvre.
    ///
    /// # Errors
    /// Options that make no sense, or a law that is missing.
    pub fn new(
        vehicle: &'a Vehicle,
        start: &ConvergedTrim,
        law: Option<&Autopilot>,
        maneuver: &'a Maneuver,
        options: &Options,
    ) -> Result<Self, FlightError> {
        Self::of(vehicle.into(), &start.into(), law, maneuver, options)
    }

    /// As [`Flight::new`], for any airframe.
    ///
    /// # Errors
    /// As [`Flight::new`], and an engine that is to fail where none is modelled.
    pub fn of(
        airframe: Airframe<'a>,
        start: &Start,
        law: Option<&Autopilot>,
        maneuver: &'a Maneuver,
        options: &Options,
    ) -> Result<Self, FlightError> {
        let options = Options {
            noise: maneuver.noise,
            weather: maneuver.weather.clone(),
            height: maneuver.start.height,
            heading: maneuver.start.heading,
            ..options.clone()
        };
        if maneuver.engine_out.is_some() {
            let vehicle = airframe.vehicle().ok_or(FlightError::NoEngine)?;
            if vehicle.layout.rotors.iter().any(|rotor| rotor.speed.is_none()) {
                return Err(FlightError::NoRotorSpeed);
            }
        }
        let simulator = Simulator::of(airframe, start, &options)?;
        let mut mean = start.mean_state.clone();
        let body = Layout::BODY;
        let settled = simulator.settled();
        mean[body.velocity..body.velocity + 3].copy_from_slice(&settled.velocity_body);
        let [_, forward, right, down] = navigation(&mean);
        let held = Held {
            velocity: [forward, right, down],
            attitude: [mean[body.roll], mean[body.pitch]],
            turn_rate: start.condition.turn_rate,
        };
        let mut controller = None;
        let mut stick_limits = airframe.stick_limits();
        if maneuver.mode != Mode::OpenLoop {
            let law = law.ok_or(FlightError::NoLaw)?;
            stick_limits = law.stick_limits;
            let mut c = Controller::new(law.table.clone(), simulator.period(), stick_limits);
            if let Some(demand) = maneuver.demand(0.0, &held) {
                c.engage(&settled, &demand, start.sticks)?;
            }
            controller = Some(c);
        }
        Ok(Self {
            simulator,
            excitation: None,
            probe: [0.0; 2],
            maneuver,
            controller,
            stick_limits,
            trim_sticks: start.sticks,
            held,
            demand: None,
            measurement: None,
            turned: 0.0,
            sticks: start.sticks,
        })
    }

    /// Measures, and gives the sticks of this period.
    pub fn decide(&mut self) {
        let time = self.simulator.time();
        let measurement = self.simulator.measure();
        self.measurement = Some(measurement);
        self.turned += measurement.rates[2] * self.simulator.period();
        self.demand = self.maneuver.demand(time, &self.held);
        match self.excitation {
            Some(Excitation::Output(axis, input)) => {
                let added = input.at(time);
                let mut disturbance = [0.0; 4];
                disturbance[axis.index()] = added;
                if let Some(controller) = &mut self.controller {
                    controller.disturb(disturbance);
                }
                self.probe = [added, self.held_quantity(&measurement, axis) + added];
            }
            Some(Excitation::Command(axis, input)) => {
                let added = input.at(time);
                if let Some(Horizontal::Attitude { roll, pitch }) =
                    self.demand.as_mut().map(|demand| &mut demand.horizontal)
                {
                    *(if axis == Axis::Roll { roll } else { pitch }) += added;
                }
                self.probe = [added, self.held_quantity(&measurement, axis)];
            }
            _ => {}
        }
        let base = match (&mut self.controller, &self.demand) {
            // A flight that is not finite keeps its sticks and ends in `advance`.
            (Some(controller), Some(demand)) => {
                controller.step(&measurement, demand).unwrap_or(self.sticks)
            }
            _ => self.trim_sticks,
        };
        let mut inputs = self.maneuver.inputs(time);
        if let Some(Excitation::Stick(input)) = self.excitation {
            inputs[input.stick] += input.at(time);
        }
        for (k, stick) in self.sticks.iter_mut().enumerate() {
            let [low, high] = self.stick_limits[k];
            *stick = (base[k] + inputs[k]).clamp(low, high);
        }
        if let Some(Excitation::Stick(Input { stick, .. })) = self.excitation {
            self.probe = [self.sticks[stick], base[stick]];
        }
    }

    /// Flies on to the next period.
    ///
    /// # Errors
    /// How the flight ended, if it ended before its time.
    pub fn advance(&mut self) -> Result<(), Status> {
        if self.maneuver.engine_out.is_some_and(|time| self.simulator.time() >= time) {
            self.simulator.fail_engine();
        }
        self.simulator.advance(self.sticks).map_err(Status::Diverged)?;
        self.limits().map_or(Ok(()), |departure| Err(Status::Limit(departure)))
    }

    fn limits(&self) -> Option<Departure> {
        let limits = &self.maneuver.limits;
        let (body, state) = (Layout::BODY, self.simulator.state());
        let above = |name: &str, value: f64, bound: Option<f64>| {
            let bound = bound?;
            (value.abs() > bound).then(|| Departure {
                state: name.into(),
                time: self.simulator.time(),
                value,
                bound,
            })
        };
        let height = -self.simulator.position()[2];
        let low = limits.height.filter(|bound| height < *bound).map(|bound| Departure {
            state: "height".into(),
            time: self.simulator.time(),
            value: height,
            bound,
        });
        above("airspeed", self.simulator.airspeed(), limits.airspeed)
            .or_else(|| above("phi", state[body.roll], limits.roll))
            .or_else(|| above("theta", state[body.pitch], limits.pitch))
            .or(low)
    }

    /// Flies the manoeuvre to its end. `observe` sees every period after its
    /// decision, the last instant included.
    pub fn fly(&mut self, mut observe: impl FnMut(&mut Self)) -> Status {
        let ended = self.fly_while(|flight| {
            observe(flight);
            true
        });
        ended.unwrap_or(Status::Completed)
    }

    /// As [`Flight::fly`], but for as long as `observe` says to go on; `None`
    /// if it said to stop.
    pub fn fly_while(&mut self, observe: impl FnMut(&mut Self) -> bool) -> Option<Status> {
        let status = self.fly_periods(observe);
        tracing::info!(
            maneuver = self.maneuver.title,
            time_s = self.simulator.time(),
            status = status.as_ref().map_or("stopped", Status::word),
            "flown"
        );
        status
    }

    fn fly_periods(&mut self, mut observe: impl FnMut(&mut Self) -> bool) -> Option<Status> {
        let periods = (self.maneuver.duration / self.simulator.period()).round() as u64;
        for _ in 0..periods {
            self.decide();
            if !observe(self) {
                return None;
            }
            if let Err(status) = self.advance() {
                return Some(status);
            }
        }
        self.decide();
        observe(self).then_some(Status::Completed)
    }

    /// The manoeuvre.
    #[must_use]
    pub fn maneuver(&self) -> &Maneuver {
        self.maneuver
    }

    /// Whether a law flies.
    #[must_use]
    pub fn closed_loop(&self) -> bool {
        self.controller.is_some()
    }

    /// What was asked of the law at the last decision.
    #[must_use]
    pub fn demand(&self) -> Option<Demand> {
        self.demand
    }

    /// What the law steered to at the last decision.
    #[must_use]
    pub fn references(&self) -> Option<References> {
        self.controller.as_ref().map(Controller::references)
    }

    /// What the sensors said at the last decision.
    #[must_use]
    pub fn measurement(&self) -> Option<Measurement> {
        self.measurement
    }

    /// Sticks lat, lon, col, ped of the last decision, %.
    #[must_use]
    pub fn sticks(&self) -> [f64; 4] {
        self.sticks
    }

    /// Input and output of the excitation at the last decision: on a stick, what
    /// goes to the actuators and what the law gave, %; on a held quantity or a
    /// command, what was added and the held quantity, the disturbance
    /// included, rad or m/s.
    #[must_use]
    pub fn probe(&self) -> [f64; 2] {
        self.probe
    }

    /// What an axis holds, as measured: φ, θ, heading or V_z.
    fn held_quantity(&self, m: &Measurement, axis: Axis) -> f64 {
        match axis {
            Axis::Roll => m.roll,
            Axis::Pitch => m.pitch,
            Axis::Yaw => self.turned,
            Axis::Heave => earth_velocity(m).0,
        }
    }

    /// What is held where nothing is commanded.
    #[must_use]
    pub fn held(&self) -> &Held {
        &self.held
    }
}
