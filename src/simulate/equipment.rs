//! Sensors, transport delay and actuators: the path from what the aircraft
//! does to what its blades do.
//!
//! Sensor filters (order 1) and actuators (order 2) are linear, so they move
//! by their exact discrete solutions, not by the integrator of the flight
//! dynamics.

use crate::control::plant::Hardware;
use nalgebra::Matrix3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::VecDeque;

/// Normal noise of the sensors, standard deviations of each sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorNoise {
    /// Ground velocity u, v, w, m/s.
    pub velocity: f64,
    /// Body rates p, q, r, rad/s.
    pub rate: f64,
    /// Attitudes φ, θ, rad.
    pub attitude: f64,
    /// True airspeed, m/s.
    pub airspeed: f64,
}

/// Quantities that are measured: u v w p q r φ θ and the forward component of
/// the true airspeed in heading axes.
pub const MEASURED: usize = 9;

/// First-order filters of equal bandwidth, exact for inputs that are straight
/// lines within a step.
#[derive(Debug, Clone)]
pub struct SensorFilter {
    value: [f64; MEASURED],
    input: [f64; MEASURED],
    keep: f64,
    from_old: f64,
    from_new: f64,
}

impl SensorFilter {
    /// Filters of a bandwidth, rad/s, that move by `step` s at a time and have
    /// settled at a value.
    #[must_use]
    pub fn new(bandwidth: f64, step: f64, value: [f64; MEASURED]) -> Self {
        let x = bandwidth * step;
        let keep = (-x).exp();
        // y' = b (u − y) with u a straight line: y1 = keep y0 + ∫ …
        let mean = (1.0 - keep) / x;
        Self { value, input: value, keep, from_old: mean - keep, from_new: 1.0 - mean }
    }

    /// Moves one step on, to a new input.
    pub fn advance(&mut self, input: [f64; MEASURED]) {
        for ((value, old), new) in self.value.iter_mut().zip(self.input).zip(input) {
            *value = self.keep * *value + self.from_old * old + self.from_new * new;
        }
        self.input = input;
    }

    /// Filtered values.
    #[must_use]
    pub fn value(&self) -> &[f64; MEASURED] {
        &self.value
    }
}

/// A reproducible source of normal numbers. Every use has its own stream of
/// the same seed, so that switching one source on does not change another.
#[derive(Debug, Clone)]
pub struct Noise {
    generator: ChaCha8Rng,
}

impl Noise {
    /// Stream `stream` of a seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { generator }
    }

    /// The next number of zero mean and unit variance.
    pub fn draw(&mut self) -> f64 {
        StandardNormal.sample(&mut self.generator)
    }
}

/// Sticks on their way to the actuators.
///
/// A command becomes effective a whole number of ticks after it was given.
#[derive(Debug, Clone)]
pub struct Delay {
    /// Ticks between two commands.
    ticks: usize,
    /// Ticks from a command to its effect.
    lag: usize,
    /// Commands, oldest first; the last is the one of the present period.
    line: VecDeque<[f64; 4]>,
}

impl Delay {
    /// A line with `ticks` ticks of `tick` s between commands and a delay, s,
    /// rounded to a tick, filled with a command.
    #[must_use]
    pub fn new(delay: f64, tick: f64, ticks: usize, command: [f64; 4]) -> Self {
        let lag = (delay.max(0.0) / tick).round() as usize;
        let length = lag.div_ceil(ticks) + 1;
        Self { ticks, lag, line: std::iter::repeat_n(command, length).collect() }
    }

    /// Ticks from a command to its effect.
    #[must_use]
    pub fn lag(&self) -> usize {
        self.lag
    }

    /// Takes the command of a new period.
    pub fn push(&mut self, command: [f64; 4]) {
        self.line.pop_front();
        self.line.push_back(command);
    }

    /// The command that is effective `tick` ticks into the present period.
    #[must_use]
    pub fn at(&self, tick: usize) -> [f64; 4] {
        let periods = self.lag.saturating_sub(tick).div_ceil(self.ticks);
        self.line[self.line.len() - 1 - periods]
    }
}

/// One actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuator {
    /// Position.
    pub position: f64,
    /// Rate, 1/s.
    pub rate: f64,
    /// Limits of the position.
    pub limits: [f64; 2],
    /// Time at the limit of position or rate so far, s.
    pub saturated: f64,
}

/// Actuators of the effectors: x'' + 2ζω x' + ω² x = ω² u, within limits
/// of rate and position.
#[derive(Debug, Clone)]
pub struct Actuators {
    /// Places among the effectors.
    places: Vec<usize>,
    /// One a place.
    states: Vec<Actuator>,
    /// Exact solution over a tick: (x, x') from (x, x', u).
    transition: [[f64; 3]; 2],
    tick: f64,
    rate_limit: f64,
}

impl Actuators {
    /// Actuators of effectors, each with its place and its limits, at rest at
    /// the given positions. The limit of their rate is in units of the effectors
    /// a second, the tick in s.
    #[must_use]
    pub fn new(
        effectors: &[(usize, [f64; 2])],
        hardware: &Hardware,
        rate_limit: f64,
        tick: f64,
        positions: &[f64],
    ) -> Self {
        let (mut places, mut states) = (Vec::new(), Vec::new());
        for (place, limits) in effectors {
            places.push(*place);
            let position = positions[*place];
            states.push(Actuator { position, rate: 0.0, limits: *limits, saturated: 0.0 });
        }
        let (w, z) = (hardware.actuator_bandwidth, hardware.actuator_damping);
        let m = Matrix3::new(0.0, 1.0, 0.0, -w * w, -2.0 * z * w, w * w, 0.0, 0.0, 0.0);
        let e = (m * tick).exp();
        let transition = [0, 1].map(|i| [e[(i, 0)], e[(i, 1)], e[(i, 2)]]);
        Self { places, states, transition, tick, rate_limit }
    }

    /// Moves all actuators one tick towards the commanded blade controls.
    pub fn advance(&mut self, command: &[f64]) {
        for (place, a) in self.places.iter().zip(&mut self.states) {
            let input = command[*place];
            let [x, v] =
                self.transition.map(|row| row[0] * a.position + row[1] * a.rate + row[2] * input);
            let most = self.rate_limit * self.tick;
            let moved = (x - a.position).clamp(-most, most);
            let rate = v.clamp(-self.rate_limit, self.rate_limit);
            let free = a.position + moved;
            let position = free.clamp(a.limits[0], a.limits[1]);
            if moved != x - a.position || rate != v || position != free {
                a.saturated += self.tick;
            }
            a.rate = if position == free { rate } else { 0.0 };
            a.position = position;
        }
    }

    /// Writes the positions into blade controls.
    pub fn write(&self, effectors: &mut [f64]) {
        for (place, a) in self.places.iter().zip(&self.states) {
            effectors[*place] = a.position;
        }
    }

    /// Places among the effectors, and the actuators there.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &Actuator)> {
        self.places.iter().copied().zip(&self.states)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::airframe::Airframe;
    use crate::vehicle::Vehicle;
    use approx::assert_relative_eq;

    /// A ramp passes a first-order filter late by its time constant, whatever
    /// the step.
    #[test]
    fn filtered_ramp_lags_by_the_time_constant() {
        let (bandwidth, step) = (60.0, 0.004);
        let mut filter = SensorFilter::new(bandwidth, step, [0.0; MEASURED]);
        let mut time = 0.0;
        for _ in 0..200 {
            time += step;
            filter.advance([time; MEASURED]);
        }
        assert_relative_eq!(filter.value()[3], time - 1.0 / bandwidth, epsilon = 1e-12);
    }

    /// A command given at the start of a period takes effect exactly `lag`
    /// ticks later.
    #[test]
    fn delay_counts_ticks() {
        for lag in 0..20 {
            let ticks = 6;
            let mut delay = Delay::new(lag as f64 * 0.5, 0.5, ticks, [0.0; 4]);
            let mut seen = None;
            for period in 0..6 {
                delay.push([if period >= 1 { 1.0 } else { 0.0 }; 4]);
                for tick in 0..ticks {
                    if delay.at(tick)[0] == 1.0 && seen.is_none() {
                        seen = Some(period * ticks + tick);
                    }
                }
            }
            assert_eq!(seen, Some(ticks + lag));
        }
    }

    fn vehicle() -> Vehicle {
        let problem = crate::problem::builtin_named("coax2d").unwrap().problem;
        Vehicle::new(&problem).unwrap().with_interactions(false).unwrap()
    }

    const HARDWARE: Hardware = Hardware {
        actuator_bandwidth: 30.0,
        actuator_damping: 0.8,
        delay: 0.035,
        sensor_bandwidth: 60.0,
    };

    /// Step of a second-order system: x = 1 − e^(−ζωt)(cos ω_d t + ζ/√(1−ζ²) sin ω_d t).
    #[test]
    fn actuator_step_is_the_analytic_one() {
        let v = vehicle();
        let mut effectors = vec![0.1; v.effector_count()];
        let mut a =
            Actuators::new(&Airframe::from(&v).actuators(), &HARDWARE, 1e9, 0.002, &effectors);
        let step = 0.02;
        let command = vec![0.1 + step; effectors.len()];
        for k in 1..100 {
            a.advance(&command);
            let t = 0.002 * f64::from(k);
            let (w, z) = (30.0, 0.8);
            let d = w * f64::sqrt(1.0 - z * z);
            let x = 1.0 - (-z * w * t).exp() * ((d * t).cos() + z * w / d * (d * t).sin());
            a.write(&mut effectors);
            assert_relative_eq!(effectors[0], 0.1 + step * x, epsilon = 1e-12);
        }
        assert!(a.iter().all(|(_, a)| a.saturated == 0.0));
    }

    /// Rate and position never leave their limits, and time at them is counted.
    #[test]
    fn actuator_limits_hold() {
        let v = vehicle();
        let effectors = vec![0.05; v.effector_count()];
        let rate = 60f64.to_radians();
        let mut a =
            Actuators::new(&Airframe::from(&v).actuators(), &HARDWARE, rate, 0.002, &effectors);
        let command = vec![3.0; effectors.len()];
        let mut before = 0.05;
        for _ in 0..300 {
            a.advance(&command);
            let first = a.iter().next().unwrap().1;
            assert!(first.position - before <= rate * 0.002 * (1.0 + 1e-12));
            assert!(first.position <= first.limits[1]);
            before = first.position;
        }
        let first = a.iter().next().unwrap().1;
        assert_eq!(first.position, first.limits[1]);
        assert!(first.saturated > 0.5);
        // It comes back off the limit.
        let home = vec![0.05; effectors.len()];
        for _ in 0..500 {
            a.advance(&home);
        }
        assert_relative_eq!(a.iter().next().unwrap().1.position, 0.05, epsilon = 1e-6);
    }

    /// Streams of one seed differ, the same stream repeats.
    #[test]
    fn noise_repeats_by_seed_and_stream() {
        let draw = |seed, stream| {
            let mut n = Noise::new(seed, stream);
            [n.draw(), n.draw(), n.draw()]
        };
        assert_eq!(draw(1, 0), draw(1, 0));
        assert_ne!(draw(1, 0), draw(1, 1));
        assert_ne!(draw(1, 0), draw(2, 0));
    }
}
