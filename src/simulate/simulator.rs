//! The stepper: an airframe with its equipment, one period of the control
//! computer at a time.
//!
//! ```text
//! loop {
//!     let measurement = simulator.measure();
//!     let sticks = controller.step(&measurement, &demand)?;
//!     simulator.advance(sticks)?;
//! }
//! ```
//!
//! Every state of the airframe is integrated, a vehicle's azimuth-resolved, with
//! steps of fixed length: a whole number of them makes a control period, so that the
//! control computer samples without jitter. A step allocates nothing.

use super::airframe::{Airframe, Start, Work};
use super::equipment::{Actuators, Delay, MEASURED, Noise, SensorFilter, SensorNoise};
use super::wind::{Air, Passage, Weather};
use crate::control::law::Measurement;
use crate::control::plant::Hardware;
use crate::numerics::integration::{Integrator, RUNGE_KUTTA_4};
use crate::trim::ConvergedTrim;
use crate::vehicle::{AirMotion, Layout, Vehicle, navigation};

/// How to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Rate of the control computer, Hz.
    pub control_rate: f64,
    /// Fewest integration steps in a revolution of the reference rotor; the
    /// step is the longest that makes a whole number in a control period.
    pub steps_per_revolution: usize,
    /// Sensors, delay, actuators. The delay is from a sample to the middle of
    /// the period for which its command holds, as a continuous-time analysis
    /// sees it: half a period of it is the hold itself.
    pub hardware: Hardware,
    /// Delay on top, s.
    pub extra_delay: f64,
    /// Largest rate of blade pitch, rad/s.
    pub pitch_rate_limit: f64,
    /// Noise of the sensors.
    pub noise: SensorNoise,
    /// Moving air.
    pub weather: Weather,
    /// Seed of noise and turbulence.
    pub seed: u64,
    /// Height above the ground at the start, m.
    pub height: f64,
    /// Heading at the start, rad.
    pub heading: f64,
}

impl Options {
    /// 100 Hz, 36 steps a revolution, no noise and still air.
    #[must_use]
    pub fn new(hardware: Hardware, pitch_rate_limit: f64) -> Self {
        Self {
            control_rate: 100.0,
            steps_per_revolution: 36,
            hardware,
            extra_delay: 0.0,
            pitch_rate_limit,
            noise: SensorNoise::default(),
            weather: Weather::default(),
            seed: 0,
            height: 100.0,
            heading: 0.0,
        }
    }
}

/// Why a simulation cannot begin.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// A number that makes no sense.
    #[error("{what} is {value}; it must be {must}")]
    Option {
        /// Which option.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
    /// The control computer is slower than the transport delay allows for.
    #[error(
        "the transport delay of {delay} s is shorter than half a control period of {half_period} \
         s, which holding a command takes alone: give a higher control rate"
    )]
    Hold {
        /// Delay asked for, s.
        delay: f64,
        /// Half a control period, s.
        half_period: f64,
    },
}

/// A state that left the region in which the model means anything.
#[derive(Debug, Clone, PartialEq)]
pub struct Departure {
    /// Name of the state.
    pub state: String,
    /// When, s.
    pub time: f64,
    /// Its last finite value, SI.
    pub value: f64,
    /// The bound, SI; infinite where the value was not finite.
    pub bound: f64,
}

/// Heading, then position north, east and down, behind the vehicle's states.
const NAVIGATION: usize = 4;

/// An airframe in flight.
#[derive(Debug, Clone)]
pub struct Simulator<'a> {
    airframe: Airframe<'a>,
    options: Options,
    /// Control periods flown.
    periods: u64,
    /// Integration steps in a control period.
    substeps: usize,
    /// Length of an integration step, s.
    step: f64,
    /// States of the airframe, then heading, north, east, down.
    state: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    integrator: Integrator<f64>,
    work: Work,
    rates: Vec<f64>,
    /// Commanded effectors.
    command: Vec<f64>,
    /// Effectors at the start, the middle and the end of a step.
    effectors: [Vec<f64>; 3],
    actuators: Actuators,
    delay: Delay,
    filter: SensorFilter,
    noise: Noise,
    air: Air,
    /// Places of what the sensors see.
    seen: [usize; Layout::BODY.count],
    /// Whether the rotors turn without the engine.
    engine_out: bool,
    /// Rotor speeds that are then commanded, rad/s.
    coasting: Vec<f64>,
    departure: Option<Departure>,
}

impl<'a> Simulator<'a> {
    /// A vehicle on the orbit of a trim, actuators and filters settled. In
    /// wind it starts with the trim's velocity through the air.
    ///
    /// # Errors
    /// Options that make no sense.
    pub fn new(
        vehicle: &'a Vehicle,
        start: &ConvergedTrim,
        options: &Options,
    ) -> Result<Self, SimulationError> {
        Self::of(vehicle.into(), &start.into(), options)
    }

    /// As [`Simulator::new`], for any airframe.
    ///
    /// # Errors
    /// Options that make no sense.
    pub fn of(
        airframe: Airframe<'a>,
        start: &Start,
        options: &Options,
    ) -> Result<Self, SimulationError> {
        let hardware = airframe.hardware(options);
        check(options, &hardware)?;
        let period = 1.0 / options.control_rate;
        let substeps = airframe.substeps(period, options);
        let step = period / substeps as f64;
        let n = airframe.state_count();
        let mut state = start.state.clone();
        state.extend([options.heading, 0.0, 0.0, -options.height]);
        let mut weather = options.weather.clone();
        if let (Some(turbulence), None) = (&mut weather.turbulence, airframe.span()) {
            // How turbulence turns an aircraft depends on its span.
            turbulence.rates = false;
        }
        let span = airframe.span().unwrap_or(1.0);
        let air = Air::new(weather, span, options.seed, options.heading);
        let body = Layout::BODY;
        let mean = &start.mean_state;
        let wind = to_body(air.velocity(), options.heading, state[body.roll], state[body.pitch]);
        let wind_mean = to_body(air.velocity(), options.heading, mean[body.roll], mean[body.pitch]);
        let seen = airframe.measured();
        let mut measured = [0.0; MEASURED];
        for (value, place) in measured.iter_mut().zip(seen) {
            *value = mean[place];
        }
        measured[MEASURED - 1] = navigation(mean)[1];
        for (k, wind) in wind.into_iter().enumerate() {
            let place = body.velocity + k;
            state[place] += wind;
            // What is measured late has settled too.
            if seen[place] != place {
                state[seen[place]] += wind;
            }
        }
        for (velocity, wind) in measured.iter_mut().zip(wind_mean) {
            *velocity += wind;
        }
        let mut effectors = vec![0.0; airframe.effector_count()];
        airframe.mix(&start.sticks, &mut effectors);
        let pure = hardware.delay + options.extra_delay - 0.5 * period;
        let tick = 0.5 * step;
        let mut bounds = airframe.bounds();
        bounds.extend([[-f64::MAX, f64::MAX]; NAVIGATION]);
        let coasting = airframe
            .vehicle()
            .map(|vehicle| vehicle.rotors.iter().map(|rotor| rotor.speed).collect())
            .unwrap_or_default();
        Ok(Self {
            airframe,
            options: options.clone(),
            periods: 0,
            substeps,
            step,
            bounds,
            integrator: Integrator::new(RUNGE_KUTTA_4, n + NAVIGATION),
            work: airframe.workspace(),
            rates: vec![0.0; n],
            command: effectors.clone(),
            actuators: Actuators::new(
                &airframe.actuators(),
                &hardware,
                airframe.rate_limit(options),
                tick,
                &effectors,
            ),
            effectors: [effectors.clone(), effectors.clone(), effectors],
            delay: Delay::new(pure, tick, 2 * substeps, start.sticks),
            filter: SensorFilter::new(hardware.sensor_bandwidth, step, measured),
            noise: Noise::new(options.seed, 0),
            air,
            seen,
            engine_out: false,
            coasting,
            departure: None,
            state,
        })
    }

    /// What flies.
    #[must_use]
    pub fn airframe(&self) -> Airframe<'a> {
        self.airframe
    }

    /// How it simulates.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Time since the start, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.periods as f64 / self.options.control_rate
    }

    /// Control period, s.
    #[must_use]
    pub fn period(&self) -> f64 {
        1.0 / self.options.control_rate
    }

    /// Length of an integration step, s.
    #[must_use]
    pub fn integration_step(&self) -> f64 {
        self.step
    }

    /// Transport delay as it is simulated, s: in whole half steps of the
    /// integration, the half period of the hold included.
    #[must_use]
    pub fn delay(&self) -> f64 {
        0.5 * self.step * self.delay.lag() as f64 + 0.5 * self.period()
    }

    /// States of the airframe, in its order.
    #[must_use]
    pub fn state(&self) -> &[f64] {
        &self.state[..self.airframe.state_count()]
    }

    /// Heading, rad, not wrapped.
    #[must_use]
    pub fn heading(&self) -> f64 {
        self.state[self.airframe.state_count()]
    }

    /// Position north, east and down of the start's point on the ground, m.
    #[must_use]
    pub fn position(&self) -> [f64; 3] {
        let n = self.airframe.state_count();
        [self.state[n + 1], self.state[n + 2], self.state[n + 3]]
    }

    /// Heading rate (rad/s) and ground velocity in heading axes, forward, to
    /// starboard and down (m/s).
    #[must_use]
    pub fn navigation(&self) -> [f64; 4] {
        navigation(self.state())
    }

    /// True airspeed, m/s.
    #[must_use]
    pub fn airspeed(&self) -> f64 {
        let wind = self.wind_body();
        norm(&[0, 1, 2].map(|k| self.state[Layout::BODY.velocity + k] - wind[k]))
    }

    /// Airspeed along the body's x axis, m/s.
    #[must_use]
    pub fn axial_airspeed(&self) -> f64 {
        self.state[Layout::BODY.velocity] - self.wind_body()[0]
    }

    /// Velocity of the air, north, east, down, m/s.
    #[must_use]
    pub fn wind(&self) -> [f64; 3] {
        self.air.velocity()
    }

    /// Angular velocity of the air, about north, east and down, rad/s.
    #[must_use]
    pub fn air_rate(&self) -> [f64; 3] {
        self.air.rate()
    }

    fn wind_body(&self) -> [f64; 3] {
        self.air_motion().velocity
    }

    /// How the air moves now, body axes.
    fn air_motion(&self) -> AirMotion {
        let body = Layout::BODY;
        let angles = [self.heading(), self.state[body.roll], self.state[body.pitch]];
        moving(self.air.velocity(), self.air.rate(), angles)
    }

    /// Effectors as they are.
    #[must_use]
    pub fn effectors(&self) -> &[f64] {
        &self.effectors[2]
    }

    /// Actuators.
    #[must_use]
    pub fn actuators(&self) -> &Actuators {
        &self.actuators
    }

    /// Shaft power of each rotor, W, written into `powers`; nothing where there
    /// are no rotors.
    pub fn powers(&mut self, powers: &mut [f64]) {
        let wind = self.air_motion();
        let time = self.time();
        let n = self.airframe.state_count();
        let (state, effectors) = (&self.state[..n], &self.effectors[2]);
        let (Airframe::Vehicle(vehicle), Work::Vehicle(work)) = (self.airframe, &mut self.work)
        else {
            return;
        };
        let azimuth = time * vehicle.reference_speed;
        vehicle.rates(azimuth, state, effectors, wind, work, &mut self.rates);
        let output = vehicle.output(state, effectors, wind, work);
        for (power, rotor) in powers.iter_mut().zip(&output.rotors) {
            *power = rotor.power;
        }
    }

    /// Where the flight left the region in which the model means anything.
    #[must_use]
    pub fn departure(&self) -> Option<&Departure> {
        self.departure.as_ref()
    }

    /// The engine fails: from now on the rotors, on one shaft, turn by what the
    /// air does to them, J Ω' = −Q. Rotors whose speed is held exactly keep it.
    pub fn fail_engine(&mut self) {
        self.engine_out = self
            .airframe
            .vehicle()
            .is_some_and(|vehicle| vehicle.layout.rotors.iter().all(|rotor| rotor.speed.is_some()));
    }

    /// Rotor speeds to command so that the governors give the rates of rotors
    /// without an engine, by blade control. The torque of a shaft is linear in
    /// its acceleration, so that one step from the present one is exact.
    fn coast(&mut self) {
        let wind = self.air_motion();
        let time = self.time();
        let n = self.airframe.state_count();
        let (state, effectors) = (&self.state[..n], &self.effectors[2]);
        let (Airframe::Vehicle(vehicle), Work::Vehicle(work)) = (self.airframe, &mut self.work)
        else {
            return;
        };
        let azimuth = time * vehicle.reference_speed;
        vehicle.rates(azimuth, state, effectors, wind, work, &mut self.rates);
        let output = vehicle.output(state, effectors, wind, work);
        // Reduced to the speed of the reference rotor by the gear ratios.
        let (mut torque, mut inertia, mut acceleration) = (0.0, 0.0, 0.0);
        for ((rotor, places), loads) in
            vehicle.rotors.iter().zip(&vehicle.layout.rotors).zip(&output.rotors)
        {
            let ratio = rotor.speed / vehicle.reference_speed;
            let Some(speed) = places.speed else { return };
            torque += ratio * loads.torque;
            inertia += ratio * ratio * rotor.inertia[2];
            acceleration = self.rates[speed] / ratio;
        }
        let coasting = acceleration - torque / inertia;
        for (index, (rotor, places)) in
            vehicle.rotors.iter().zip(&vehicle.layout.rotors).enumerate()
        {
            if let (Some(speed), Some(lag)) = (places.speed, rotor.governor_time_constant) {
                let ratio = rotor.speed / vehicle.reference_speed;
                self.coasting[index] = self.state[speed] + lag * coasting * ratio;
            }
        }
    }

    /// What the sensors say now: filtered, with noise. To be asked for once a
    /// period.
    pub fn measure(&mut self) -> Measurement {
        let [u, v, w, p, q, r, roll, pitch, airspeed] = *self.filter.value();
        let SensorNoise { velocity, rate, attitude, airspeed: speed } = self.options.noise;
        let mut noisy = |value: f64, deviation: f64| {
            // Draws always, so that one channel's noise does not shift another's.
            value + deviation * self.noise.draw()
        };
        Measurement {
            velocity_body: [u, v, w].map(|x| noisy(x, velocity)),
            rates: [p, q, r].map(|x| noisy(x, rate)),
            roll: noisy(roll, attitude),
            pitch: noisy(pitch, attitude),
            airspeed: noisy(airspeed, speed),
        }
    }

    /// What the filters hold, without noise: at the start, the mean over the
    /// trim's orbit.
    #[must_use]
    pub fn settled(&self) -> Measurement {
        let [u, v, w, p, q, r, roll, pitch, airspeed] = *self.filter.value();
        Measurement { velocity_body: [u, v, w], rates: [p, q, r], roll, pitch, airspeed }
    }

    /// Flies one control period with new stick positions, %.
    ///
    /// # Errors
    /// The state that left its bounds; the simulator then stays where it is.
    pub fn advance(&mut self, sticks: [f64; 4]) -> Result<(), Departure> {
        if let Some(departure) = &self.departure {
            return Err(departure.clone());
        }
        self.delay.push(sticks);
        for substep in 0..self.substeps {
            self.substep(substep);
            if let Some(departure) = self.outside(substep) {
                self.departure = Some(departure.clone());
                return Err(departure);
            }
        }
        self.periods += 1;
        Ok(())
    }

    fn substep(&mut self, substep: usize) {
        let airframe = self.airframe;
        let n = airframe.state_count();
        let body = Layout::BODY;
        let (wind_earth, turning_earth) = (self.air.velocity(), self.air.rate());
        if self.engine_out {
            self.coast();
        }
        self.effectors.rotate_right(1);
        let [_, middle, end] = &mut self.effectors;
        for (half, positions) in [middle, end].into_iter().enumerate() {
            airframe.mix(&self.delay.at(2 * substep + half), &mut self.command);
            if let (true, Some(vehicle)) = (self.engine_out, airframe.vehicle()) {
                for (places, speed) in vehicle.layout.rotors.iter().zip(&self.coasting) {
                    if let Some(place) = places.command {
                        self.command[place] = *speed;
                    }
                }
            }
            self.actuators.advance(&self.command);
            limit_speeds(airframe, &mut self.command);
            positions.copy_from_slice(&self.command);
            self.actuators.write(positions);
        }
        let [start, middle, end] = &self.effectors;
        let controls: [&[f64]; 4] = [start, middle, middle, end];
        let time = (self.periods * self.substeps as u64 + substep as u64) as f64 * self.step;
        let (work, mut stage) = (&mut self.work, 0);
        self.integrator.step(time, self.step, &mut self.state, |time, x, rates| {
            let (x, place) = x.split_at(n);
            let (rates, position_rates) = rates.split_at_mut(n);
            let angles = [place[0], x[body.roll], x[body.pitch]];
            let wind = moving(wind_earth, turning_earth, angles);
            airframe.rates(time, x, controls[stage], wind, work, rates);
            stage += 1;
            let [heading_rate, forward, right, down] = navigation(x);
            let (s, c) = place[0].sin_cos();
            position_rates.copy_from_slice(&[
                heading_rate,
                forward * c - right * s,
                forward * s + right * c,
                down,
            ]);
        });
        let [_, forward, right, down] = self.navigation();
        let (sine, cosine) = self.heading().sin_cos();
        let passage = Passage {
            velocity: [forward * cosine - right * sine, forward * sine + right * cosine, down],
            height: -self.position()[2],
            heading: self.heading(),
        };
        self.air.advance(time, self.step, &passage);
        let mut measured = [0.0; MEASURED];
        for (value, place) in measured.iter_mut().zip(self.seen) {
            *value = self.state[place];
        }
        let mut air = [0.0; Layout::BODY.count];
        air.copy_from_slice(&measured[..body.count]);
        let wind = self.wind_body();
        for (velocity, wind) in air[body.velocity..].iter_mut().zip(wind) {
            *velocity -= wind;
        }
        measured[MEASURED - 1] = navigation(&air)[1];
        self.filter.advance(measured);
    }

    /// The first state that is out of bounds.
    fn outside(&self, substep: usize) -> Option<Departure> {
        let place = self
            .state
            .iter()
            .zip(&self.bounds)
            .position(|(x, [low, high])| !(low..=high).contains(&x))?;
        let state = self.airframe.state_name(place).unwrap_or("position").to_owned();
        let [low, high] = self.bounds[place];
        let value = self.state[place];
        let (value, bound) = if value.is_finite() {
            (value, if value < low { low } else { high })
        } else {
            (0.0, f64::INFINITY)
        };
        let time = self.time() + (substep + 1) as f64 * self.step;
        Some(Departure { state, time, value, bound })
    }
}

fn check(options: &Options, h: &Hardware) -> Result<(), SimulationError> {
    let positive = "a positive number";
    for (what, value) in [
        ("the control rate", options.control_rate),
        ("the actuators' bandwidth", h.actuator_bandwidth),
        ("the actuators' damping ratio", h.actuator_damping),
        ("the sensors' bandwidth", h.sensor_bandwidth),
        ("the rate limit of blade pitch", options.pitch_rate_limit),
        ("the number of steps a revolution", options.steps_per_revolution as f64),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(SimulationError::Option { what, value, must: positive });
        }
    }
    for (what, value) in [
        ("the delay", h.delay),
        ("the extra delay", options.extra_delay),
        ("the noise of velocity", options.noise.velocity),
        ("the noise of rates", options.noise.rate),
        ("the noise of attitudes", options.noise.attitude),
        ("the noise of airspeed", options.noise.airspeed),
        ("the height", options.height),
    ] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(SimulationError::Option { what, value, must: "zero or positive" });
        }
    }
    for (what, value, least, most, must) in [
        ("the control rate", options.control_rate, 1.0, 1e4, "from 1 Hz to 10,000 Hz"),
        ("the delay", h.delay + options.extra_delay, 0.0, 10.0, "at most 10 s"),
        ("the actuators' bandwidth", h.actuator_bandwidth, 0.0, 1e6, "at most 1e6 rad/s"),
        ("the sensors' bandwidth", h.sensor_bandwidth, 0.0, 1e6, "at most 1e6 rad/s"),
        (
            "the number of steps a revolution",
            options.steps_per_revolution as f64,
            1.0,
            1e5,
            "at most 100,000",
        ),
    ] {
        if value < least || value > most {
            return Err(SimulationError::Option { what, value, must });
        }
    }
    let half_period = 0.5 / options.control_rate;
    let delay = h.delay + options.extra_delay;
    // Models that have their hardware inside leave no delay that could be the
    // hold's: it comes on top.
    if *h != Hardware::INCLUDED && delay < half_period * (1.0 - 1e-9) {
        return Err(SimulationError::Hold { delay, half_period });
    }
    Ok(())
}

/// Rotor speeds that the sticks command have no actuator but their motor, which
/// keeps within its limits. A governor's command has none: with it a failed
/// engine's torque is written.
fn limit_speeds(airframe: Airframe<'_>, command: &mut [f64]) {
    let Airframe::Vehicle(vehicle) = airframe else { return };
    for ((rotor, places), limits) in
        vehicle.rotors.iter().zip(&vehicle.layout.rotors).zip(&vehicle.controls.speed_limits)
    {
        if let (true, Some(place)) = (rotor.commanded, places.command) {
            command[place] = command[place].clamp(limits[0], limits[1]);
        }
    }
}

/// A vector from earth axes to body axes.
fn to_body([north, east, down]: [f64; 3], heading: f64, roll: f64, pitch: f64) -> [f64; 3] {
    if north == 0.0 && east == 0.0 && down == 0.0 {
        return [0.0; 3];
    }
    let (sh, ch) = heading.sin_cos();
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    let (forward, right) = (north * ch + east * sh, east * ch - north * sh);
    let lifted = forward * sp + down * cp;
    [forward * cp - down * sp, right * cr + lifted * sr, lifted * cr - right * sr]
}

/// Motion of the air from earth axes to body axes; angles are heading, roll and
/// pitch, rad.
fn moving(velocity: [f64; 3], rate: [f64; 3], [heading, roll, pitch]: [f64; 3]) -> AirMotion {
    AirMotion {
        velocity: to_body(velocity, heading, roll, pitch),
        rate: to_body(rate, heading, roll, pitch),
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
