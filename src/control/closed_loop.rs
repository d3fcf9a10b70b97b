//! The closed loop of a plant under the law as it is flown.
//!
//! The law enters as [`LawTable::linear`]: its block diagram, differentiated
//! about trimmed flight, in the limit of a short step. So everything that the
//! law does to small deviations is in the loops: blends, the lead of the
//! schedule, the slope of the tables over airspeed under an attitude demand,
//! and what a velocity demand puts in the place of the reference model's
//! velocities. The tuning's own algebra ([`super::loops`]) knows less; nothing
//! of it is used here.
//!
//! A sampled law adds the delay of its hold, half a step, to what is computed
//! here: it counts as part of the hardware's delay.
//!
//! With the plant's response X from sticks to measured states, hardware
//! included, and the law's response K from measured states and ports to
//! sticks, sticks are δ = K X δ + K_p p for what enters at the ports. The loop
//! cut at an effector with everything else closed is 1 + L = det M / det M̄,
//! with M = I − K X and M̄ without that effector; what a port's own signal
//! becomes is 1 + h/p, h being the quantity that the port is added to.

use super::axis::{Axis, Channel};
use super::law::LawTable;
use super::loops::{Cut, FrequencyModel, Matrix4c, Row4, determinant};
use super::plant::{Hardware, Plant, PlantError, rigid};
use super::stability::{Builder, Signal, add};
use crate::law::{LinearLaw, mdi};
use nalgebra::{DMatrix, Matrix4, SMatrix, Vector4};
use num_complex::Complex64 as C;

const ZERO: C = C::new(0.0, 0.0);
const ONE: C = C::new(1.0, 0.0);

/// Sticks, as the diagram names them.
pub(super) const STICKS: [&str; 4] = ["lat_held", "lon_held", "col_held", "ped_held"];
/// Sticks and what is held.
const SEEN: [&str; 8] =
    [STICKS[0], STICKS[1], STICKS[2], STICKS[3], "held_heading", "v_z", "v_x", "v_y"];
/// Measured states.
pub(super) const STATES: usize = 8;
/// Where the airspeed stands among the law's inputs.
const AIRSPEED: usize = STATES;
/// Inputs of the diagram before the ports; the mode is no input of a linear
/// law.
const BEFORE_PORTS: usize = mdi::MEASUREMENTS.len() + mdi::DEMANDS.len() - 1;
const PORTS: usize = mdi::PORTS.len();

/// Places among the ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Port {
    Phi,
    Theta,
    Heading,
    Vz,
    PhiRate,
    ThetaRate,
    R,
    Vx,
    Vy,
    PhiCommand,
    ThetaCommand,
}

/// How white noise on what a channel measures enters, at s: on the rate of an
/// attitude (the attitude is its integral), on the yaw rate, on a velocity. By
/// places among [`mdi::PORTS`].
pub(super) fn noise_ports(channel: Channel, s: C) -> Vec<(Port, C)> {
    match channel {
        Channel::Roll => vec![(Port::PhiRate, ONE), (Port::Phi, s.inv())],
        Channel::Pitch => vec![(Port::ThetaRate, ONE), (Port::Theta, s.inv())],
        Channel::Yaw => vec![(Port::R, ONE)],
        Channel::Heave => vec![(Port::Vz, ONE)],
        Channel::Vx => vec![(Port::Vx, ONE)],
        Channel::Vy => vec![(Port::Vy, ONE)],
    }
}

/// The law in still air: its airspeed moves as the velocity over the ground
/// forward.
pub(super) fn still_air(law: &LinearLaw) -> LinearLaw {
    let forward: Vec<f64> = law.output("v_x").map_or_else(Vec::new, |row| {
        // No memory stands between.
        law.d.row(row).columns(0, STATES).iter().copied().collect()
    });
    law.with_input_from(AIRSPEED, &forward)
}

/// The law at a speed and in a mode, ready for any frequency.
#[derive(Debug, Clone)]
pub struct LawLoop {
    law: LinearLaw,
    delay: f64,
}

/// The law's response at a frequency.
#[derive(Debug, Clone)]
pub struct LawResponse {
    /// Sticks, then what is held, from measured states: the airspeed is that
    /// of still air.
    states: SMatrix<C, 8, 8>,
    /// The same from the ports.
    ports: SMatrix<C, 8, PORTS>,
}

impl LawLoop {
    /// The law at a speed, m/s: with the outer loops under a velocity demand,
    /// without them under an attitude demand.
    pub fn new(table: &LawTable, speed: f64, velocity_mode: bool) -> Self {
        Self::from_linear(&table.linear(speed, velocity_mode), table.settings.reference_delay)
    }

    /// From a linear law with the inputs and outputs of [`LawTable::linear`]
    /// and the delay of its references, s.
    pub fn from_linear(law: &LinearLaw, delay: f64) -> Self {
        Self { law: still_air(law).seen_by(&SEEN), delay }
    }

    /// The linear law.
    pub fn law(&self) -> &LinearLaw {
        &self.law
    }

    /// The response at ω, rad/s.
    pub fn at(&self, omega: f64) -> LawResponse {
        let late = C::from_polar(1.0, -omega * self.delay);
        // A pole of the law on the imaginary axis is where |K| has no bound;
        // frequencies are beside it.
        let whole = self
            .law
            .response(C::new(0.0, omega), late)
            .unwrap_or_else(|| DMatrix::from_element(SEEN.len(), BEFORE_PORTS + PORTS, ZERO));
        LawResponse {
            states: SMatrix::from_fn(|i, k| whole[(i, k)]),
            ports: SMatrix::from_fn(|i, k| whole[(i, BEFORE_PORTS + k)]),
        }
    }
}

/// The closed loop at a frequency.
#[derive(Debug, Clone)]
pub struct Closed {
    omega: f64,
    /// M = I − K X.
    matrix: Matrix4c,
    /// X.
    x: [Row4; 8],
    law: LawResponse,
}

impl Closed {
    /// The loop of a plant, given by its response, under the law.
    pub fn new(omega: f64, x: [Row4; 8], law: LawResponse) -> Self {
        let mut matrix = [[ZERO; 4]; 4];
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] = ONE;
            for (k, states) in x.iter().enumerate() {
                for (target, value) in row.iter_mut().zip(states) {
                    *target -= law.states[(i, k)] * value;
                }
            }
        }
        Self { omega, matrix, x, law }
    }

    /// Sticks from what enters at the ports.
    fn sticks(&self, ports: &[(Port, C)]) -> Vector4<C> {
        let direct = Vector4::from_fn(|i, _| {
            ports
                .iter()
                .fold(ZERO, |sum, (port, by)| sum + self.law.ports[(i, *port as usize)] * by)
        });
        let matrix = Matrix4::from_fn(|i, j| self.matrix[i][j]);
        // A singular loop has no finite answer.
        matrix.lu().solve(&direct).unwrap_or_else(|| Vector4::repeat(C::new(f64::INFINITY, 0.0)))
    }

    /// A measured state from sticks.
    fn state(&self, k: usize, sticks: &Vector4<C>) -> C {
        (0..4).fold(ZERO, |sum, j| sum + self.x[k][j] * sticks[j])
    }

    /// An output of the law besides the sticks.
    fn held(&self, row: usize, sticks: &Vector4<C>, ports: &[(Port, C)]) -> C {
        let from_states = (0..STATES)
            .fold(ZERO, |sum, k| sum + self.law.states[(row, k)] * self.state(k, sticks));
        ports
            .iter()
            .fold(from_states, |sum, (port, by)| sum + self.law.ports[(row, *port as usize)] * by)
    }

    /// Sensitivity of a channel's held quantity: what the gains that hold it
    /// see of a disturbance that is added to it.
    pub fn sensitivity(&self, channel: Channel) -> C {
        let port = match channel {
            Channel::Roll => Port::Phi,
            Channel::Pitch => Port::Theta,
            Channel::Yaw => Port::Heading,
            Channel::Heave => Port::Vz,
            Channel::Vx => Port::Vx,
            Channel::Vy => Port::Vy,
        };
        let ports = [(port, ONE)];
        let sticks = self.sticks(&ports);
        ONE + match channel {
            Channel::Roll => self.state(rigid::PHI, &sticks),
            Channel::Pitch => self.state(rigid::THETA, &sticks),
            Channel::Yaw => self.held(4, &sticks, &ports),
            Channel::Heave => self.held(5, &sticks, &ports),
            Channel::Vx => self.held(6, &sticks, &ports),
            Channel::Vy => self.held(7, &sticks, &ports),
        }
    }

    /// The loop L of a channel, cut as asked.
    pub fn cut(&self, channel: Channel, cut: Cut) -> C {
        match cut {
            Cut::Channel => self.sensitivity(channel).inv() - 1.0,
            Cut::Effector => {
                let e = channel.axis().effector().index();
                let mut minor = self.matrix;
                minor[e] = [ZERO; 4];
                for row in &mut minor {
                    row[e] = ZERO;
                }
                minor[e][e] = ONE;
                determinant(&self.matrix) / determinant(&minor) - 1.0
            }
        }
    }

    /// Command of the channel's own stick, %, per unit of white noise: on the
    /// rate of an attitude (which is its integral), on the yaw rate, on a
    /// velocity.
    pub fn activity(&self, channel: Channel) -> C {
        let ports = noise_ports(channel, C::new(0.0, self.omega));
        self.sticks(&ports)[channel.axis().effector().index()]
    }

    /// Response of bank or pitch to its command.
    pub fn attitude(&self, axis: Axis) -> C {
        let (port, state) = match axis {
            Axis::Pitch => (Port::ThetaCommand, rigid::THETA),
            _ => (Port::PhiCommand, rigid::PHI),
        };
        let sticks = self.sticks(&[(port, ONE)]);
        self.state(state, &sticks)
    }
}

/// A plant under the law at any frequency.
#[derive(Debug, Clone)]
pub struct PlantLoop<'a> {
    frequency: &'a FrequencyModel,
    law: &'a LawLoop,
}

impl<'a> PlantLoop<'a> {
    /// The loop of this plant under this law.
    pub fn new(frequency: &'a FrequencyModel, law: &'a LawLoop) -> Self {
        Self { frequency, law }
    }

    /// The loop at ω, rad/s.
    pub fn at(&self, omega: f64) -> Closed {
        Closed::new(omega, self.frequency.states(omega), self.law.at(omega))
    }
}

/// Order of the Padé approximation of the law's own delay lines: what goes
/// through them moves no faster than the command models.
const LINE_ORDER: usize = 3;

/// System matrix of the closed loop: plant, hardware and law, delays by Padé
/// approximations of this order.
///
/// # Errors
/// An unusable plant.
pub fn closed_loop_matrix(
    plant: &Plant,
    law: &LawLoop,
    hardware: &Hardware,
    extra_delay: f64,
    order: usize,
) -> Result<DMatrix<f64>, PlantError> {
    plant.check()?;
    let linear = &law.law;
    let (np, nl, lines) = (plant.a.nrows(), linear.states.len(), linear.lines);
    let line_order = if law.delay > 0.0 { LINE_ORDER } else { 0 };
    let mut b = Builder::new(np + 4 * (1 + order + 2) + nl + lines * line_order);
    let x0 = b.states(np);
    for i in 0..np {
        for j in 0..np {
            b.a[(x0 + i, x0 + j)] = plant.a[(i, j)];
        }
    }
    let command = b.states(4);
    for j in 0..4 {
        let sensed = b.state(command + j);
        let delayed = b.delay(hardware.delay + extra_delay, order, &sensed);
        let [stick, _, _] =
            b.second_order(hardware.actuator_bandwidth, hardware.actuator_damping, &delayed);
        for i in 0..np {
            b.feed(x0 + i, plant.b[(i, j)], &stick);
        }
    }
    let own = b.states(nl);
    let states: Vec<Signal> = (0..nl).map(|k| b.state(own + k)).collect();
    let measured: Vec<Signal> = plant.measured.iter().map(|&k| b.state(x0 + k)).collect();
    let mut inputs: Vec<Signal> = vec![b.zero(); linear.inputs.len()];
    for (k, m) in measured.iter().enumerate() {
        inputs[k] = m.clone();
    }
    let combine =
        |b: &Builder, a: &DMatrix<f64>, d: &DMatrix<f64>, row: usize, inputs: &[Signal]| {
            let mut s = b.zero();
            for (k, signal) in states.iter().enumerate() {
                add(&mut s, a[(row, k)], signal);
            }
            for (k, signal) in inputs.iter().enumerate() {
                add(&mut s, d[(row, k)], signal);
            }
            s
        };
    // What enters a delay line is a state: a reference.
    let (first_in, first_out) = (linear.inputs.len() - lines, linear.outputs.len() - lines);
    for k in 0..lines {
        let entering = combine(&b, &linear.c, &linear.d, first_out + k, &inputs[..first_in]);
        inputs[first_in + k] = b.delay(law.delay, line_order, &entering);
    }
    for k in 0..nl {
        let rate = combine(&b, &linear.a, &linear.b, k, &inputs);
        b.feed(own + k, 1.0, &rate);
    }
    for j in 0..4 {
        let stick = combine(&b, &linear.c, &linear.d, j, &inputs);
        let state = b.state(command + j);
        b.feed(command + j, -hardware.sensor_bandwidth, &state);
        b.feed(command + j, hardware.sensor_bandwidth, &stick);
    }
    Ok(b.a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::axis::GainSet;
    use crate::control::law::{LawPoint, LawSettings, TurnCoordination};
    use crate::control::loops::{GainGrid, LoopModel};
    use crate::control::plant::Inversion;
    use crate::control::testbed;
    use crate::control::tuning::start_gains;
    use approx::assert_relative_eq;

    /// A table of one breakpoint, whose slopes over speed are zero.
    fn alone(speed: f64, settings: LawSettings) -> (Plant, LawTable) {
        let plant = testbed::plant(speed, &testbed::NOMINAL);
        let inversion = Inversion::new(&plant).unwrap();
        let mut gains = GainSet::default();
        for c in Channel::ALL {
            gains[c.index()] = start_gains(c, 0.152, [0.0, 10.0]);
        }
        let point = LawPoint { speed, gains, inversion };
        // Far from the blend.
        let turn = TurnCoordination { speed: 500.0, width: 1.0 };
        (plant, LawTable::new(vec![point], settings, turn).unwrap())
    }

    fn settings() -> LawSettings {
        LawSettings {
            kappa: 0.25,
            hybrid_feedforward: true,
            reference_delay: 0.1,
            roll_frequency: 2.0,
            pitch_frequency: 1.7,
            attitude_damping: 0.8,
            yaw_time_constant: 0.5,
            heave_time_constant: 2.0,
            notch: Default::default(),
        }
    }

    /// The loops that the tuning moves gains in are those of the law with these
    /// gains: in both modes, at breakpoints and between, in the blend of turn
    /// coordination too; cut at effectors and at what is held, with rejection
    /// and activity.
    #[test]
    fn the_affine_loops_are_those_of_the_flown_law() {
        let hardware = testbed::HARDWARE;
        let omega: Vec<f64> = vec![0.05, 0.3, 1.0, 2.5, 6.0, 20.0];
        let point = |speed: f64| {
            let plant = testbed::plant(speed, &testbed::NOMINAL);
            let mut gains = GainSet::default();
            for c in Channel::ALL {
                gains[c.index()] = start_gains(c, 0.14 + 0.001 * speed, [0.0, 10.0]);
            }
            let mut inversion = Inversion::new(&plant).unwrap();
            // Level: the tables are read at the speed of the trim.
            let trim = &mut inversion.trim;
            trim.velocity_body = [speed * trim.pitch.cos(), 0.0, speed * trim.pitch.sin()];
            LawPoint { speed, gains, inversion }
        };
        let points = [0.0, 12.0, 25.0, 38.0].map(point).to_vec();
        let turn = TurnCoordination { speed: 25.0, width: 8.0 };
        let table = LawTable::new(points, settings(), turn).unwrap();
        for speed in [0.0, 7.0, 23.0, 25.0, 38.0] {
            let plant = testbed::plant(speed, &testbed::NOMINAL);
            let frequency = FrequencyModel::new(&plant, hardware, 0.0).unwrap();
            let grid = GainGrid::new(&table, speed, omega.clone().into());
            let affine = LoopModel::new(&plant, &grid, hardware, 0.0).unwrap();
            let all = table.at(speed).gains;
            for (gains, velocity_mode) in
                [(crate::control::axis::inner_only(&all), false), (all, true)]
            {
                let law = LawLoop::new(&table, speed, velocity_mode);
                let of = PlantLoop::new(&frequency, &law);
                let channels = if velocity_mode { &Channel::ALL[..] } else { &Channel::ALL[..4] };
                for &channel in channels {
                    let x = gains[channel.index()].values(channel);
                    let cuts: &[Cut] = if channel.is_outer() {
                        &[Cut::Effector, Cut::Channel]
                    } else {
                        &[Cut::Effector]
                    };
                    let loops = affine.channel(&gains, channel, cuts);
                    let sensitivity = loops.sensitivity_curve(&x);
                    for (k, &w) in omega.iter().enumerate() {
                        let closed = of.at(w);
                        let near = |what: &str, wanted: C, found: C| {
                            assert!(
                                // Between breakpoints the airspeed of a blended trim
                                // is not quite its speed.
                                (found - wanted).norm() < 1e-3 * (1.0 + wanted.norm()),
                                "{channel} {what} at {speed} m/s, {w} rad/s: {found} {wanted}"
                            );
                        };
                        for (n, cut) in cuts.iter().enumerate() {
                            near("loop", closed.cut(channel, *cut), loops.loop_value(k, n, &x));
                            let exact = affine.loop_at(&gains, channel, *cut, w);
                            near("exact loop", closed.cut(channel, *cut), exact);
                        }
                        // With an outer loop closed, what an inner axis holds is
                        // moved by it, too.
                        if channel.is_outer() == velocity_mode {
                            near("S", closed.sensitivity(channel), sensitivity[k]);
                        }
                    }
                }
            }
        }
    }

    /// det(sI − A) of the closed loop over that of the loop cut at an effector
    /// is 1 + L on the imaginary axis: the matrix and the responses are the same
    /// loop.
    #[test]
    fn matrix_and_response_are_the_same_loop() {
        for (speed, velocity_mode) in [(0.0, false), (25.0, false), (0.0, true), (25.0, true)] {
            let (plant, table) = alone(speed, settings());
            let hardware = testbed::HARDWARE;
            let law = LawLoop::new(&table, speed, velocity_mode);
            let closed = closed_loop_matrix(&plant, &law, &hardware, 0.0, 6).unwrap();
            let frequency = FrequencyModel::new(&plant, hardware, 0.0).unwrap();
            let of = PlantLoop::new(&frequency, &law);
            for channel in [Channel::Roll, Channel::Pitch, Channel::Yaw, Channel::Heave] {
                // Cut where the stick would reach its sensor's filter.
                let row = plant.a.nrows() + channel.axis().effector().index();
                let mut open = closed.clone();
                open.row_mut(row).fill(0.0);
                open[(row, row)] = -hardware.sensor_bandwidth;
                for w in [0.3, 1.0, 2.5, 6.0] {
                    let det = |a: &DMatrix<f64>| {
                        let m = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| {
                            C::new(-a[(i, j)], if i == j { w } else { 0.0 })
                        });
                        m.lu().determinant()
                    };
                    let ratio = det(&closed) / det(&open) - 1.0;
                    let direct = of.at(w).cut(channel, Cut::Effector);
                    assert_relative_eq!(ratio.re, direct.re, max_relative = 1e-3, epsilon = 1e-3);
                    assert_relative_eq!(ratio.im, direct.im, max_relative = 1e-3, epsilon = 1e-3);
                }
            }
        }
    }
}
