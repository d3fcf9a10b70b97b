//! A rotor stand: one rotor alone, on a hub that does not move, trimmed to a
//! thrust or torque.
//!
//! Hover, climb, and edgewise flow as in a wind tunnel are one problem: states
//! of the rotor (flapping and inflow) that are periodic, a collective that
//! gives the load asked for, and the cyclic that holds the disk across the
//! shaft: no mean flapping, or, where the blades do not flap, no mean moment on
//! the hub.
//!
//! The rotor is that of a problem, with all that its file says of it, without
//! airframe, other rotors and sticks. Blades have no weight on the stand.

use crate::numerics::integration::{Integrator, KUTTA_3_8};
use crate::numerics::least_squares::{self, EvaluationError, Residuals};
use crate::numerics::scalar::{Dual, Scalar, WIDTH};
use crate::problem::{Problem, RotorMix};
use crate::vehicle::inflow::FlowState;
use crate::vehicle::{Layout, Vehicle, VehicleError};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::SQRT_2;

/// Mass of the stand, in masses of the aircraft: it does not move.
const HEAVY: f64 = 1e12;
/// Steps a period.
const STEPS: usize = 72;
/// Scale of C_T, and of C_Q.
const SCALES: [f64; 2] = [1e-3, 1e-4];
/// Residuals at which a point has converged.
const TOLERANCE: f64 = 1e-10;
/// Most iterations.
const ITERATIONS: usize = 60;

/// What the collective is trimmed to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Load {
    /// C_T = T/(ρπR²(ΩR)²).
    ThrustCoefficient(f64),
    /// Thrust, N.
    Thrust(f64),
    /// Torque, N m.
    Torque(f64),
}

/// Flow about the stand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flow {
    /// Speed across the shaft, from ahead, m/s.
    pub edgewise: f64,
    /// Speed along the shaft, m/s, positive as in a climb.
    pub axial: f64,
}

/// A rotor on the stand.
#[derive(Debug, Clone)]
pub struct Stand {
    vehicle: Vehicle,
    /// Place of θ_0 among the effectors.
    pitch: usize,
}

/// Why a rotor makes no stand.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StandError {
    /// The vehicle cannot be built.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// The rotor has no blades whose pitch could be trimmed.
    #[error(
        "rotor `{rotor}` is given by thrust and torque coefficients: its thrust follows from its \
         speed, and there are no blades to trim"
    )]
    NoBlades {
        /// Rotor.
        rotor: String,
    },
}

/// A rotor trimmed on the stand: means over a period.
#[derive(Debug, Clone, PartialEq)]
pub struct StandPoint {
    /// Flow.
    pub flow: Flow,
    /// Whether it is trimmed; else what the solver ran into.
    pub failure: Option<String>,
    /// Norm of the scaled residuals.
    pub residual_norm: f64,
    /// θ_0, θ_1c, θ_1s, rad.
    pub pitch: [f64; 3],
    /// β_1c, β_1s, rad.
    pub flapping: [f64; 2],
    /// Inflow λ_0, λ_1c, λ_1s.
    pub inflow: [f64; 3],
    /// Thrust along the shaft, N.
    pub thrust: f64,
    /// Shaft torque, N m.
    pub torque: f64,
    /// Shaft power, W.
    pub power: f64,
    /// C_T = T/(ρπR²(ΩR)²).
    pub thrust_coefficient: f64,
    /// C_P = P/(ρπR²(ΩR)³).
    pub power_coefficient: f64,
    /// C_T/σ.
    pub blade_loading: f64,
    /// Figure of merit C_T^{3/2}/(√2 C_P), in hover and with thrust.
    pub figure_of_merit: Option<f64>,
    /// Power of section drag, W.
    pub profile_power: f64,
    /// Power of the induced flow, W.
    pub induced_power: f64,
    /// State of the flow through the rotor.
    pub flow_state: FlowState,
}

impl Stand {
    /// The stand of one rotor of a problem, by its place in the file.
    ///
    /// # Errors
    /// As for a vehicle, and for a rotor without blades.
    ///
    /// # Panics
    /// Where the problem has no such rotor.
    pub fn new(problem: &Problem, rotor: usize) -> Result<Self, StandError> {
        let mut alone = problem.clone();
        let mut part = problem.rotors[rotor].clone();
        part.hub = alone.mass.center_of_gravity;
        part.cant = 0.0;
        part.tilt = 0.0;
        alone.rotors = vec![part];
        alone.wings.clear();
        alone.fuselages.clear();
        alone.inflow.interactions = false;
        let controls = &mut alone.controls;
        let none = [0.0; 4];
        controls.mix = vec![RotorMix {
            theta_0: none,
            theta_1c: none,
            theta_1s: none,
            rigging: [0.0; 3],
            speed: none,
            speed_rigging: controls.mix[rotor].speed_rigging,
        }];
        controls.collective_limits = vec![controls.collective_limits[rotor]];
        controls.cyclic_limits = vec![controls.cyclic_limits[rotor]];
        let mass = &mut alone.mass;
        mass.mass *= HEAVY;
        for inertia in [&mut mass.i_xx, &mut mass.i_yy, &mut mass.i_zz] {
            *inertia *= HEAVY;
        }
        for product in [&mut mass.i_xy, &mut mass.i_xz, &mut mass.i_yz] {
            *product = 0.0;
        }
        let vehicle = Vehicle::new(&alone)?;
        let pitch = vehicle.layout.rotors[0]
            .pitch
            .ok_or_else(|| StandError::NoBlades { rotor: vehicle.rotors[0].name.clone() })?;
        Ok(Self { vehicle, pitch })
    }

    /// The rotor trimmed to a load in a flow, from momentum theory.
    #[must_use]
    pub fn trim(&self, load: Load, flow: Flow) -> StandPoint {
        let system = System::new(&self.vehicle, self.pitch, load, flow);
        let start = system.estimate();
        let options = least_squares::Options {
            residual_tolerance: TOLERANCE / (start.len() as f64).sqrt(),
            max_iterations: ITERATIONS,
            ..least_squares::Options::default()
        };
        let solved = least_squares::solve(&system, &start, &options, None);
        let (x, failure) = match &solved {
            Err(error) => (start, Some(error.to_string())),
            Ok(solution) if solution.converged() => (solution.x.clone(), None),
            Ok(solution) => {
                let worst = system.worst(&solution.residuals);
                (solution.x.clone(), Some(format!("{worst} could not be met")))
            }
        };
        system.report(&x, failure)
    }
}

/// Unknowns: states of the rotor, then θ_0, θ_1c, θ_1s, scaled.
struct System<'a> {
    vehicle: &'a Vehicle,
    load: Load,
    flow: Flow,
    free: Vec<usize>,
    scales: Vec<f64>,
    /// Place of θ_0 among the effectors.
    pitch: usize,
}

impl<'a> System<'a> {
    fn new(vehicle: &'a Vehicle, pitch: usize, load: Load, flow: Flow) -> Self {
        let places = &vehicle.layout.rotors[0];
        let held = |k: usize| places.speed == Some(k) || places.azimuth == Some(k);
        let free: Vec<usize> =
            (Layout::BODY.count..vehicle.state_count()).filter(|&k| !held(k)).collect();
        let mut scales: Vec<f64> = free.iter().map(|&k| vehicle.layout.states[k].scale).collect();
        scales.extend([0.01; 3]);
        Self { vehicle, load, flow, free, scales, pitch }
    }

    /// Momentum theory and blade-element theory.
    fn estimate(&self) -> DVector<f64> {
        let rotor = &self.vehicle.rotors[0];
        let c_t = match self.load {
            Load::ThrustCoefficient(c_t) => c_t,
            Load::Thrust(thrust) => thrust / rotor.force_scale(),
            // A figure of merit of about 0.6.
            Load::Torque(torque) => {
                let c_q = (torque / (rotor.force_scale() * rotor.radius)).max(0.0);
                (0.6 * SQRT_2 * c_q).powf(2.0 / 3.0)
            }
        };
        let [mu, climb] = [self.flow.edgewise, self.flow.axial].map(|v| v / rotor.tip_speed());
        let mut lambda = (c_t.abs() / 2.0).sqrt();
        for _ in 0..30 {
            let through = lambda + climb.max(0.0);
            lambda = 0.5 * (lambda + c_t.abs() / (2.0 * mu.hypot(through).max(1e-3)));
        }
        let lambda = lambda.copysign(c_t);
        let mut x = DVector::zeros(self.scales.len());
        let places = &self.vehicle.layout.rotors[0];
        for (index, &k) in self.free.iter().enumerate() {
            if places.self_inflow == Some(k) || places.total_inflow == Some(k) {
                x[index] = lambda / self.scales[index];
            }
        }
        let n = self.free.len();
        x[n] = rotor.collective_estimate(c_t, lambda + climb) / self.scales[n];
        x
    }

    /// Whole state and blade controls from scaled unknowns.
    fn unpack<S: Scalar>(&self, x: &[S]) -> (Vec<S>, Vec<S>) {
        let mut state = vec![S::default(); self.vehicle.state_count()];
        state[0] = S::constant(self.flow.edgewise);
        state[2] = S::constant(-self.flow.axial);
        let rotor = &self.vehicle.rotors[0];
        let places = &self.vehicle.layout.rotors[0];
        if let Some(start) = places.speed {
            state[start] = S::constant(rotor.speed);
        }
        for (index, &k) in self.free.iter().enumerate() {
            state[k] = x[index] * self.scales[index];
        }
        let n = self.free.len();
        let mut effectors = vec![S::default(); self.vehicle.effector_count()];
        for k in 0..3 {
            effectors[self.pitch + k] = x[n + k] * self.scales[n + k];
        }
        if let Some(command) = places.command {
            effectors[command] = S::constant(rotor.speed);
        }
        (state, effectors)
    }

    /// Flies a period: the end, and the mean thrust, torque, flapping and hub
    /// moments. `visit` sees the start of every step.
    fn fly<S: Scalar>(
        &self,
        start: &[S],
        effectors: &[S],
        mut visit: impl FnMut(f64, &[S]),
    ) -> (Vec<S>, [S; 6]) {
        let vehicle = self.vehicle;
        let mut work = vehicle.workspace::<S>();
        let mut integrator = Integrator::<S>::new(KUTTA_3_8, start.len());
        let mut rates = vec![S::default(); start.len()];
        let mut state = start.to_vec();
        let mut mean = [S::default(); 6];
        let step = vehicle.period / STEPS as f64;
        let weight = 1.0 / STEPS as f64;
        for index in 0..STEPS {
            let time = index as f64 * step;
            visit(time * vehicle.reference_speed, &state);
            let azimuth = time * vehicle.reference_speed;
            vehicle.rates(azimuth, &state, effectors, [0.0; 3], &mut work, &mut rates);
            let ([_, _, down], [roll, pitch, torque]) =
                (work.loads[0].force_hub.0, work.loads[0].moment_hub.0);
            let flapping = vehicle.layout.rotors[0]
                .flapping
                .map_or([S::default(); 2], |at| [state[at], state[at + 1]]);
            let now = [-down, torque, flapping[0], flapping[1], roll, pitch];
            for (sum, value) in mean.iter_mut().zip(now) {
                *sum += value * weight;
            }
            integrator.step(time, step, &mut state, |time, x, rates| {
                let azimuth = time * vehicle.reference_speed;
                vehicle.rates(azimuth, x, effectors, [0.0; 3], &mut work, rates);
                // The stand holds the hub.
                for rate in &mut rates[..Layout::BODY.count] {
                    *rate = S::default();
                }
            });
        }
        (state, mean)
    }

    fn residuals<S: Scalar>(&self, x: &[S], mut put: impl FnMut(usize, S)) {
        let (start, effectors) = self.unpack(x);
        let (end, [thrust, torque, b1c, b1s, roll, pitch]) =
            self.fly(&start, &effectors, |_, _| {});
        for (index, &k) in self.free.iter().enumerate() {
            put(index, (end[k] - start[k]) * (1.0 / self.scales[index]));
        }
        let rotor = &self.vehicle.rotors[0];
        let n = self.free.len();
        let force = rotor.force_scale();
        let load = match self.load {
            Load::ThrustCoefficient(c_t) => (thrust * (1.0 / force) - c_t) * (1.0 / SCALES[0]),
            Load::Thrust(needed) => (thrust - needed) * (1.0 / (force * SCALES[0])),
            Load::Torque(needed) => (torque - needed) * (1.0 / (force * rotor.radius * SCALES[1])),
        };
        put(n, load);
        let moment = 1.0 / (force * rotor.radius * SCALES[1]);
        let tilt = if self.vehicle.layout.rotors[0].flapping.is_some() {
            [b1c * 50.0, b1s * 50.0]
        } else {
            [roll * moment, pitch * moment]
        };
        put(n + 1, tilt[0]);
        put(n + 2, tilt[1]);
    }

    /// The equation that is met worst, in words.
    fn worst(&self, residuals: &DVector<f64>) -> String {
        let worst = residuals.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        match worst {
            Some((k, _)) if k < self.free.len() => {
                format!("periodicity of {}", self.vehicle.layout.states[self.free[k]].name)
            }
            Some((k, _)) if k == self.free.len() => "the load".into(),
            _ => "a level disk".into(),
        }
    }

    fn report(&self, x: &DVector<f64>, failure: Option<String>) -> StandPoint {
        let vehicle = self.vehicle;
        let rotor = &vehicle.rotors[0];
        let (start, effectors) = self.unpack(x.as_slice());
        let mut work = vehicle.workspace::<f64>();
        let mut rates = vec![0.0; start.len()];
        let weight = 1.0 / STEPS as f64;
        let (mut flapping, mut inflow) = ([0.0; 2], [0.0; 3]);
        let [mut thrust, mut torque, mut profile_power, mut induced_power] = [0.0; 4];
        self.fly(&start, &effectors, |azimuth, state| {
            vehicle.rates(azimuth, state, &effectors, [0.0; 3], &mut work, &mut rates);
            let output = vehicle.output(state, &effectors, [0.0; 3], &work);
            let now = &output.rotors[0];
            thrust += weight * now.thrust;
            torque += weight * now.torque;
            profile_power += weight * now.profile_power;
            induced_power += weight * now.induced_power;
            for (mean, now) in inflow.iter_mut().zip(now.inflow) {
                *mean += weight * now;
            }
            for (mean, now) in flapping.iter_mut().zip(now.flapping) {
                *mean += weight * now;
            }
        });
        let residuals = self.evaluate(x).map_or(f64::NAN, |residuals| residuals.norm());
        let power = torque * rotor.speed;
        let thrust_coefficient = thrust / rotor.force_scale();
        let power_coefficient = power / (rotor.force_scale() * rotor.tip_speed());
        let still = self.flow == Flow::default() && thrust > 0.0;
        let [edgewise, axial] =
            [self.flow.edgewise, self.flow.axial].map(|v| v / rotor.tip_speed());
        let at = self.pitch;
        StandPoint {
            flow: self.flow,
            failure,
            residual_norm: residuals,
            pitch: [effectors[at], effectors[at + 1], effectors[at + 2]],
            flapping,
            inflow,
            thrust,
            torque,
            power,
            thrust_coefficient,
            power_coefficient,
            blade_loading: thrust_coefficient / rotor.solidity(),
            figure_of_merit: still
                .then(|| thrust_coefficient.powf(1.5) / (SQRT_2 * power_coefficient)),
            profile_power,
            induced_power,
            flow_state: FlowState::of(edgewise, -axial, inflow[0]),
        }
    }
}

impl Residuals for System<'_> {
    fn evaluate(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
        let mut residuals = DVector::zeros(x.len());
        self.residuals(x.as_slice(), |row, value: f64| residuals[row] = value);
        Ok(residuals)
    }

    fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError> {
        let count = x.len();
        let mut jacobian = DMatrix::zeros(count, count);
        for first in (0..count).step_by(WIDTH) {
            let last = count.min(first + WIDTH);
            let seeded: Vec<Dual<WIDTH>> = x
                .iter()
                .enumerate()
                .map(|(k, &value)| {
                    if (first..last).contains(&k) {
                        Dual::variable(value, k - first)
                    } else {
                        Dual::constant(value)
                    }
                })
                .collect();
            self.residuals(&seeded, |row, value| {
                for column in first..last {
                    jacobian[(row, column)] = value.d[column - first];
                }
            });
        }
        Ok(jacobian)
    }
}
