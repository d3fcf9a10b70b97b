//! One period of flight from a start, with exact derivatives.

use crate::numerics::integration::{Integrator, Method};
use crate::numerics::least_squares::{EvaluationError, Residuals};
use crate::numerics::scalar::{Dual, Scalar};
use crate::problem::STICKS;
use crate::trim::condition::{FlightCondition, Lateral};
use crate::units::Kind;
use crate::vehicle::layout::Quantity;
use crate::vehicle::{Layout, Vehicle, Workspace};
use nalgebra::{DMatrix, DVector};

/// Tangents carried in one pass of the Jacobian; larger systems take several.
const WIDTH: usize = 28;
/// Most steps a period of the Jacobian. It steers the solver and is no result:
/// with this many steps it is right to about 1e-4, and every iteration still
/// gains that factor.
const JACOBIAN_STEPS: usize = 36;
/// Below this speed, m/s, a flight condition is a hover.
pub(super) const HOVER_SPEED: f64 = 1e-9;

/// One period of flight as a system of residuals in scaled unknowns.
#[derive(Debug, Clone)]
pub struct Shooting<'a> {
    vehicle: &'a Vehicle,
    condition: FlightCondition,
    method: Method,
    steps: usize,
    /// Steps a period of the Jacobian.
    jacobian_steps: usize,
    /// States that must be periodic and may be chosen.
    free: Vec<usize>,
    /// Values of the states that are neither (a governed rotor's speed).
    fixed: Vec<f64>,
    /// Scale of each unknown.
    pub(super) scales: Vec<f64>,
}

/// The end of a period and the means over it.
#[derive(Debug, Clone)]
pub struct Period<S> {
    /// State at the end.
    pub end: Vec<S>,
    /// Mean heading rate, and forward, starboard and down velocity over the
    /// ground in heading axes.
    pub navigation: [S; 4],
    /// Mean of every state.
    pub mean: Vec<S>,
}

/// A residual: what it is, in what unit, how it is scaled.
#[derive(Debug, Clone, PartialEq)]
pub struct Equation {
    /// What must vanish.
    pub quantity: Quantity,
}

impl<'a> Shooting<'a> {
    /// Shooting of a vehicle for a condition with a number of steps a period.
    #[must_use]
    pub fn new(
        vehicle: &'a Vehicle,
        condition: FlightCondition,
        method: Method,
        steps: usize,
    ) -> Self {
        let mut fixed = vec![0.0; vehicle.state_count()];
        let mut held = vec![false; vehicle.state_count()];
        for (rotor, places) in vehicle.rotors.iter().zip(&vehicle.layout.rotors) {
            if let Some(start) = places.speed {
                fixed[start] = rotor.speed;
                held[start] = true;
                held[start + 1] = true;
            }
        }
        let free: Vec<usize> = (0..vehicle.state_count()).filter(|&k| !held[k]).collect();
        let mut scales: Vec<f64> = free.iter().map(|&k| vehicle.layout.states[k].scale).collect();
        scales.extend(stick_scales(vehicle));
        let jacobian_steps = steps.min(JACOBIAN_STEPS);
        Self { vehicle, condition, method, steps, jacobian_steps, free, fixed, scales }
    }

    /// The same problem with half the step.
    #[must_use]
    pub fn halved(&self) -> Self {
        Self { steps: 2 * self.steps, ..self.clone() }
    }

    /// Integration method.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method
    }

    /// Number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.scales.len()
    }

    /// The unknowns in words.
    #[must_use]
    pub fn unknown_names(&self) -> Vec<String> {
        self.free
            .iter()
            .map(|&k| self.vehicle.layout.states[k].name.clone())
            .chain(STICKS.iter().map(|&stick| stick.to_owned()))
            .collect()
    }

    /// The equations in words, in the order of the residuals.
    #[must_use]
    pub fn equations(&self) -> Vec<Quantity> {
        let mut equations: Vec<Quantity> = self
            .free
            .iter()
            .map(|&k| {
                let state = &self.vehicle.layout.states[k];
                Quantity { name: format!("periodicity of {}", state.name), ..state.clone() }
            })
            .collect();
        let mut flight = |name: &str, kind, scale| {
            equations.push(Quantity { name: name.to_owned(), kind, scale });
        };
        flight("turn rate", Kind::AngularRateRad, 0.1);
        flight("forward speed", Kind::Velocity, 1.0);
        match self.condition.lateral {
            Lateral::Sideslip(_) => flight("sideslip velocity", Kind::Velocity, 1.0),
            Lateral::Bank(_) => flight("bank angle", Kind::AngleRad, 0.1),
        }
        flight("rate of climb", Kind::Velocity, 1.0);
        equations
    }

    /// Scaled unknowns from a state at azimuth zero and stick positions (%).
    #[must_use]
    pub fn pack(&self, state: &[f64], sticks: &[f64; 4]) -> DVector<f64> {
        let raw = self.free.iter().map(|&k| state[k]).chain(sticks.iter().copied());
        DVector::from_iterator(
            self.unknowns(),
            raw.zip(&self.scales).map(|(value, scale)| value / scale),
        )
    }

    /// State at azimuth zero and stick positions (%) from scaled unknowns.
    #[must_use]
    pub fn unpack(&self, x: &DVector<f64>) -> (Vec<f64>, [f64; 4]) {
        let mut state = self.fixed.clone();
        for (index, &k) in self.free.iter().enumerate() {
            state[k] = x[index] * self.scales[index];
        }
        let n = self.free.len();
        (state, [0, 1, 2, 3].map(|k| x[n + k] * self.scales[n + k]))
    }

    /// Flies one period; `visit` sees every step's start: index, time, state
    /// and blade controls.
    pub fn fly<S: Scalar>(
        &self,
        start: &[S],
        sticks: &[S; 4],
        mut visit: impl FnMut(usize, f64, &[S], &[S]),
    ) -> Period<S> {
        self.fly_in(self.steps, start, sticks, |index, time, state, effectors, _| {
            visit(index, time, state, effectors);
        })
    }

    /// As [`Shooting::fly`]; `visit` also sees the workspace of the rates at
    /// every step's start, from which outputs come without another evaluation.
    pub fn fly_watched<S: Scalar>(
        &self,
        start: &[S],
        sticks: &[S; 4],
        visit: impl FnMut(usize, f64, &[S], &[S], &Workspace<S>),
    ) -> Period<S> {
        self.fly_in(self.steps, start, sticks, visit)
    }

    fn fly_in<S: Scalar>(
        &self,
        steps: usize,
        start: &[S],
        sticks: &[S; 4],
        mut visit: impl FnMut(usize, f64, &[S], &[S], &Workspace<S>),
    ) -> Period<S> {
        let vehicle = self.vehicle;
        let n = vehicle.state_count();
        let mut work = vehicle.workspace::<S>();
        let mut effectors = vec![S::default(); vehicle.effector_count()];
        vehicle.mix(sticks, &mut effectors);
        let mut integrator = Integrator::<S>::new(self.method, n);
        let mut state = start.to_vec();
        let mut navigation = [S::default(); 4];
        let mut mean = vec![S::default(); n];
        let step = vehicle.period / steps as f64;
        let weight = 1.0 / steps as f64;
        for index in 0..steps {
            let time = index as f64 * step;
            // The trapezoid rule of a periodic function.
            for (sum, rate) in navigation.iter_mut().zip(vehicle.navigation(&state)) {
                *sum += rate * weight;
            }
            for (sum, value) in mean.iter_mut().zip(&state) {
                *sum += *value * weight;
            }
            let mut at_start = true;
            integrator.step(time, step, &mut state, |time, x, rates| {
                let azimuth = time * vehicle.reference_speed;
                vehicle.rates(azimuth, x, &effectors, [0.0; 3], &mut work, rates);
                if std::mem::take(&mut at_start) {
                    visit(index, time, x, &effectors, &work);
                }
            });
        }
        Period { end: state, navigation, mean }
    }

    /// Scaled residuals of a period that was flown from a start.
    #[must_use]
    pub fn residuals_of(&self, start: &[f64], period: &Period<f64>) -> DVector<f64> {
        let mut residuals = DVector::zeros(self.unknowns());
        self.residuals(start, period, |k, value| residuals[k] = value);
        residuals
    }

    fn residuals<S: Scalar>(&self, start: &[S], period: &Period<S>, mut put: impl FnMut(usize, S)) {
        for (index, &k) in self.free.iter().enumerate() {
            put(index, (period.end[k] - start[k]) * (1.0 / self.scales[index]));
        }
        let n = self.free.len();
        let [turn, forward, right, down] = period.navigation;
        let c = &self.condition;
        put(n, (turn - c.turn_rate) * 10.0);
        let body = Layout::BODY;
        let sideslip = match c.lateral {
            Lateral::Sideslip(angle) => angle,
            Lateral::Bank(_) => 0.0,
        };
        let level = c.horizontal_speed();
        let (s, co) = sideslip.sin_cos();
        let speed = if level > HOVER_SPEED {
            // The track differs from the heading by about the sideslip, and a
            // little by the bank: the exact horizontal speed is asked for.
            let along = forward * co + right * s;
            let across = right * co - forward * s;
            let rest = across * across * -1.0 + level * level;
            if rest.value() > 0.01 * level * level { along - rest.sqrt() } else { along - level }
        } else {
            forward
        };
        put(n + 1, speed);
        match c.lateral {
            Lateral::Sideslip(angle) => {
                put(n + 2, period.mean[body.velocity + 1] - c.airspeed * angle.sin());
            }
            Lateral::Bank(angle) => put(n + 2, (period.mean[body.roll] - angle) * 10.0),
        }
        put(n + 3, down + c.climb_rate);
    }
}

impl Residuals for Shooting<'_> {
    fn evaluate(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
        let (state, sticks) = self.unpack(x);
        let period = self.fly(&state, &sticks, |_, _, _, _| {});
        Ok(self.residuals_of(&state, &period))
    }

    fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError> {
        let (state, sticks) = self.unpack(x);
        let count = self.unknowns();
        let mut jacobian = DMatrix::zeros(count, count);
        for first in (0..count).step_by(WIDTH) {
            let seed = |value: f64, index: usize| {
                if (first..first + WIDTH).contains(&index) {
                    let mut dual = Dual::<WIDTH>::constant(value);
                    dual.d[index - first] = self.scales[index];
                    dual
                } else {
                    Dual::constant(value)
                }
            };
            let mut start: Vec<Dual<WIDTH>> =
                state.iter().map(|&value| Dual::constant(value)).collect();
            for (index, &k) in self.free.iter().enumerate() {
                start[k] = seed(state[k], index);
            }
            let n = self.free.len();
            let sticks = [0, 1, 2, 3].map(|k| seed(sticks[k], n + k));
            let period = self.fly_in(self.jacobian_steps, &start, &sticks, |_, _, _, _, _| {});
            self.residuals(&start, &period, |row, value| {
                for column in first..count.min(first + WIDTH) {
                    jacobian[(row, column)] = value.d[column - first];
                }
            });
        }
        Ok(jacobian)
    }
}

/// Stick travel, %, that moves a blade by one hundredth of a radian.
pub(crate) fn stick_scales(vehicle: &Vehicle) -> [f64; 4] {
    [0, 1, 2, 3].map(|stick| {
        let most = vehicle
            .controls
            .mix
            .iter()
            .flat_map(|mix| [mix.theta_0[stick], mix.theta_1c[stick], mix.theta_1s[stick]])
            .map(f64::abs)
            .fold(0.0, f64::max);
        if most > 0.0 { 0.01 / most } else { 1.0 }
    })
}
