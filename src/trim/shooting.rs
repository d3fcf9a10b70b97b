//! One period of flight from a start, with exact derivatives.

use crate::numerics::integration::{Integrator, Method};
use crate::numerics::least_squares::{EvaluationError, Residuals};
use crate::numerics::scalar::{Dual, Scalar, WIDTH};
use crate::problem::STICKS;
use crate::trim::condition::{FlightCondition, Lateral};
use crate::units::Kind;
use crate::vehicle::layout::Quantity;
use crate::vehicle::{Layout, Vehicle};
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;

/// Most steps a blade passage of the Jacobian. It steers the solver and is no result:
/// with this many steps it is right to about 1e-4, and every iteration still
/// gains that factor.
const JACOBIAN_STEPS: usize = 24;
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
    /// The period flown last: a solver ends at the unknowns that it flew
    /// last, and what is reported of them needs that period again.
    last: RefCell<Option<Flown>>,
}

/// A period that was flown.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// Scaled unknowns that it was flown with.
    pub unknowns: DVector<f64>,
    /// States at the start of every step.
    pub orbit: Vec<Vec<f64>>,
    /// Its end and means.
    pub period: Period<f64>,
}

/// The end of a period and the means over it.
#[derive(Debug, Clone, PartialEq)]
pub struct Period<S> {
    /// State at the end.
    pub end: Vec<S>,
    /// Mean heading rate, and forward, starboard and down velocity over the
    /// ground in heading axes.
    pub navigation: [S; 4],
    /// Mean of every state.
    pub mean: Vec<S>,
    /// By how much the end should move for a finer step, where the method can
    /// tell.
    pub correction: Option<Vec<S>>,
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
            if let Some(start) = places.speed
                && !rotor.commanded
            {
                fixed[start] = rotor.speed;
                held[start] = true;
            }
            if let Some(place) = places.azimuth {
                held[place] = true;
            }
        }
        let free: Vec<usize> = (0..vehicle.state_count()).filter(|&k| !held[k]).collect();
        let mut scales: Vec<f64> = free.iter().map(|&k| vehicle.layout.states[k].scale).collect();
        scales.extend(stick_scales(vehicle));
        let jacobian_steps = steps.min(JACOBIAN_STEPS * vehicle.passages);
        let last = RefCell::new(None);
        Self { vehicle, condition, method, steps, jacobian_steps, free, fixed, scales, last }
    }

    /// The same problem with half the step.
    #[must_use]
    pub fn halved(&self) -> Self {
        Self { steps: 2 * self.steps, last: RefCell::new(None), ..self.clone() }
    }

    /// The same problem at another condition.
    #[must_use]
    pub fn towards(&self, condition: FlightCondition) -> Self {
        Self { condition, last: RefCell::new(None), ..self.clone() }
    }

    /// The condition.
    #[must_use]
    pub fn condition(&self) -> &FlightCondition {
        &self.condition
    }

    /// Integration method.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method
    }

    /// Steps a period.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
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
            Lateral::WindAzimuth(_) => flight("sideward speed", Kind::Velocity, 1.0),
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
        visit: impl FnMut(usize, f64, &[S], &[S]),
    ) -> Period<S> {
        let integrator = Integrator::estimating(self.method, self.vehicle.state_count());
        self.fly_in(integrator, self.steps, start, sticks, visit)
    }

    /// The period of these unknowns: that flown last, or a new one.
    #[must_use]
    pub fn flown(&self, x: &DVector<f64>) -> Flown {
        if let Some(last) = self.last.take()
            && last.unknowns == *x
        {
            return last;
        }
        let (state, sticks) = self.unpack(x);
        let mut orbit = Vec::with_capacity(self.steps);
        let period = self.fly(&state, &sticks, |_, _, state, _| orbit.push(state.to_vec()));
        Flown { unknowns: x.clone(), orbit, period }
    }

    /// Keeps a period, for when it is asked for again.
    pub(super) fn keep(&self, flown: Flown) {
        self.last.replace(Some(flown));
    }

    /// By how much the scaled residuals of a period should change with a finer
    /// step, as far as the method can tell from this flight; `None` if it
    /// cannot.
    #[must_use]
    pub fn estimated_change(&self, flown: &Flown) -> Option<DVector<f64>> {
        let (start, _) = self.unpack(&flown.unknowns);
        let mut finer = flown.period.clone();
        for (end, correction) in finer.end.iter_mut().zip(flown.period.correction.as_ref()?) {
            *end += correction;
        }
        Some(self.residuals_of(&start, &finer) - self.residuals_of(&start, &flown.period))
    }

    /// By how much they do change with half the step, which takes two flights
    /// more.
    ///
    /// # Errors
    /// As for the residuals.
    pub fn halving_change(&self, flown: &Flown) -> Result<DVector<f64>, EvaluationError> {
        let (start, _) = self.unpack(&flown.unknowns);
        Ok(self.halved().evaluate(&flown.unknowns)? - self.residuals_of(&start, &flown.period))
    }

    fn fly_in<S: Scalar>(
        &self,
        mut integrator: Integrator<S>,
        steps: usize,
        start: &[S],
        sticks: &[S; 4],
        mut visit: impl FnMut(usize, f64, &[S], &[S]),
    ) -> Period<S> {
        let vehicle = self.vehicle;
        let n = vehicle.state_count();
        let mut work = vehicle.workspace::<S>();
        let mut effectors = vec![S::default(); vehicle.effector_count()];
        vehicle.mix(sticks, &mut effectors);
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
            visit(index, time, &state, &effectors);
            integrator.step(time, step, &mut state, |time, x, rates| {
                let azimuth = time * vehicle.reference_speed;
                vehicle.rates(azimuth, x, &effectors, [0.0; 3], &mut work, rates);
            });
        }
        let correction = integrator.estimate().map(<[S]>::to_vec);
        Period { end: state, navigation, mean, correction }
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
        put(n + 3, down + c.climb_rate);
        let level = c.horizontal_speed();
        let sideslip = match c.lateral {
            Lateral::Sideslip(angle) => angle,
            Lateral::Bank(_) => 0.0,
            Lateral::WindAzimuth(azimuth) => {
                // Both components, so that no direction is singular.
                put(n + 1, forward - level * azimuth.cos());
                put(n + 2, right - level * azimuth.sin());
                return;
            }
        };
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
                // Along the vertical there is no side to slip to.
                let across = if level > HOVER_SPEED { c.airspeed * angle.sin() } else { 0.0 };
                put(n + 2, period.mean[body.velocity + 1] - across);
            }
            Lateral::Bank(angle) => put(n + 2, (period.mean[body.roll] - angle) * 10.0),
            Lateral::WindAzimuth(_) => {}
        }
    }
}

impl Residuals for Shooting<'_> {
    fn evaluate(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
        let flown = self.flown(x);
        let (start, _) = self.unpack(x);
        let residuals = self.residuals_of(&start, &flown.period);
        self.last.replace(Some(flown));
        Ok(residuals)
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
            let integrator = Integrator::new(self.method, start.len());
            let steps = self.jacobian_steps;
            let period = self.fly_in(integrator, steps, &start, &sticks, |_, _, _, _| {});
            self.residuals(&start, &period, |row, value| {
                for column in first..count.min(first + WIDTH) {
                    jacobian[(row, column)] = value.d[column - first];
                }
            });
        }
        Ok(jacobian)
    }
}

/// Stick travel, %, that moves a blade or a control surface by one hundredth of a
/// radian, or changes
/// a commanded speed by two hundredths of nominal.
pub(crate) fn stick_scales(vehicle: &Vehicle) -> [f64; 4] {
    let surfaces = vehicle.wings.iter().filter_map(|wing| wing.surface.as_ref());
    [0, 1, 2, 3].map(|stick| {
        let most = vehicle
            .controls
            .mix
            .iter()
            .zip(&vehicle.rotors)
            .flat_map(|(mix, rotor)| {
                let speed =
                    if rotor.commanded { 0.5 * mix.speed[stick] / rotor.speed } else { 0.0 };
                [mix.theta_0[stick], mix.theta_1c[stick], mix.theta_1s[stick], speed]
            })
            .chain(surfaces.clone().map(|surface| surface.gearing[stick]))
            .map(f64::abs)
            .fold(0.0, f64::max);
        if most > 0.0 { 0.01 / most } else { 1.0 }
    })
}
