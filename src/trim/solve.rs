//! One trim point: from a guess to a converged orbit, or to a report of why
//! there is none.

use crate::numerics::integration::{KUTTA_3_8, Method};
use crate::numerics::least_squares::{self, IterationReport, Residuals};
use crate::problem::{MassFlow, STICKS};
use crate::trim::condition::FlightCondition;
use crate::trim::shooting::{Flown, Shooting};
use crate::units::{Kind, STANDARD_GRAVITY};
use crate::vehicle::Vehicle;
use crate::vehicle::census::Census;
use crate::vehicle::inflow::FlowState;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{PI, SQRT_2};

/// Speed of a hub over the tip speed up to which a rotor has a figure of merit.
const STILL: f64 = 0.01;

/// How to trim.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Converged when the norm of the scaled residuals is below this, 1.
    /// Scales: 1 m/s, 0.1 rad and rad/s, 0.02 rad of flapping, 0.01 of inflow.
    pub residual_tolerance: f64,
    /// Largest error of any unknown (state at azimuth zero or stick) from the
    /// length of the step, relative to the unknown or, where that is small, to
    /// its scale: the error test that chooses the step.
    pub step_tolerance: f64,
    /// Steps to begin with, for each blade passage of the slowest resolved rotor
    /// in a period; where no rotor is resolved fewer serve.
    pub steps: usize,
    /// Most steps, likewise.
    pub most_steps: usize,
    /// Most iterations of one solve.
    pub max_iterations: usize,
    /// Integration method.
    pub method: Method,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            residual_tolerance: 1e-10,
            step_tolerance: 4e-7,
            steps: 36,
            most_steps: 1152,
            max_iterations: 40,
            method: KUTTA_3_8,
        }
    }
}

/// Steps over a period at least, enough where the dynamics do not vary with it
/// and no blade flaps.
const STEADY_STEPS: usize = 4;
/// Fastest flap mode of averaged blades over the speed of their rotor: the
/// progressive one, at Ω + ω_β, with ω_β up to some 1.2 Ω.
const PROGRESSIVE: f64 = 2.2;
/// Most of that mode's phase in a step, rad. An explicit Runge–Kutta method of
/// fourth order is stable to about 2.8.
const MOST_PHASE: f64 = 1.5;
/// Steps a blade passage of the solve that comes before a finer one.
const COARSE_STEPS: usize = 24;
/// How near a coarse solution must be before a finer step takes over: about
/// what the coarse step is right to.
pub(super) const COARSE_TOLERANCE: f64 = 1e-5;
/// A Jacobian serves again after a step that cut the residuals to this part:
/// a new one costs as much as several residuals.
const CHORD_REDUCTION: f64 = 0.1;
/// A Jacobian goes on to a finer system if its last step cut the residuals to
/// this part; else a new one there costs less than the steps that it saves.
const CARRIED_REDUCTION: f64 = 0.01;
/// Steps a period are a multiple of this, so that every second can be left
/// out, and every fourth.
const EVEN: usize = 4;
/// Part of the tolerance that the error of a new step is to have.
const AIM: f64 = 0.5;
/// Most that the number of steps changes at once, either way.
const LARGEST_CHANGE: f64 = 2.0;

/// Steps a period that would have about the error wanted, from the error that
/// this many have.
fn advised_steps(steps: usize, error: f64, wanted: f64, method: Method) -> usize {
    let ratio = (error / wanted).powf(1.0 / f64::from(method.order));
    // No number counts as much too large.
    let ratio =
        if ratio < LARGEST_CHANGE { ratio.max(1.0 / LARGEST_CHANGE) } else { LARGEST_CHANGE };
    ((steps as f64 * ratio).ceil() as usize).next_multiple_of(EVEN)
}

/// Where to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// State at azimuth zero.
    pub state: Vec<f64>,
    /// Sticks, %.
    pub sticks: [f64; 4],
    /// Steps a period that its orbit needed, if known.
    pub steps: Option<usize>,
    /// Jacobian of the scaled residuals with the scaled unknowns at a
    /// neighbour, if known.
    pub jacobian: Option<DMatrix<f64>>,
}

/// How a trim ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Status {
    /// On a periodic orbit at the flight condition, controls within limits.
    Converged,
    /// On a periodic orbit, but these controls are beyond their limits.
    BeyondLimits {
        /// Names of the controls.
        controls: Vec<String>,
    },
    /// No orbit was found: these equations are not met, and these stick
    /// limits bind.
    Failed {
        /// Names of the worst equations, worst first.
        equations: Vec<String>,
        /// Sticks at their limits, and blade controls beyond theirs.
        binding: Vec<String>,
        /// What the solver ran into.
        reason: String,
    },
}

impl Status {
    /// One word for tables and files.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::BeyondLimits { .. } => "beyond_limits",
            Self::Failed { .. } => "failed",
        }
    }
}

/// Which of several solutions of a condition a trim is: see
/// [`path`](super::path).
#[derive(Debug, Clone, PartialEq)]
pub enum Branch {
    /// It continues level flight: the trim of its condition.
    LevelFlight,
    /// It continues level flight round this many folds.
    Folded {
        /// Number of folds on the way.
        folds: usize,
    },
    /// No way leads from level flight to the condition, but a solution was
    /// found from an estimate.
    Separate {
        /// The last condition that could be reached from level flight.
        last: Option<FlightCondition>,
    },
    /// No way leads from level flight to the condition, and there is no trim.
    Ended {
        /// The last condition that could be reached from level flight.
        last: Option<FlightCondition>,
    },
    /// The solution that a given guess leads to.
    OfGuess,
}

impl Branch {
    /// One word for tables and files.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::LevelFlight => "level_flight",
            Self::Folded { .. } => "folded",
            Self::Separate { .. } => "separate",
            Self::Ended { .. } => "ended",
            Self::OfGuess => "of_guess",
        }
    }

    /// Where the way from level flight ended, if it did.
    #[must_use]
    pub fn last(&self) -> Option<FlightCondition> {
        match self {
            Self::Separate { last } | Self::Ended { last } => *last,
            _ => None,
        }
    }
}

/// A residual at the end of a trim.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualReport {
    /// Equation.
    pub equation: String,
    /// What it measures.
    pub kind: Kind,
    /// Residual, SI.
    pub value: f64,
    /// Residual over its scale, 1.
    pub scaled: f64,
}

/// Room between a control and its limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// Control: a stick, or a blade pitch such as `upper.theta_0`.
    pub control: String,
    /// What it measures.
    pub kind: Kind,
    /// Value, SI or %.
    pub value: f64,
    /// Limits.
    pub limits: [f64; 2],
}

impl Margin {
    /// Distance to the nearer limit as a fraction of the travel; negative
    /// beyond the limit.
    #[must_use]
    pub fn fraction(&self) -> f64 {
        let [low, high] = self.limits;
        (self.value - low).min(high - self.value) / (high - low)
    }
}

/// Means of a rotor over one period.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RotorMean {
    /// Force along the shaft, N.
    pub thrust: f64,
    /// Shaft torque, N m.
    pub torque: f64,
    /// Shaft power, W.
    pub power: f64,
    /// C_T = T/(ρπR²(ΩR)²).
    pub thrust_coefficient: f64,
    /// C_P = P/(ρπR²(ΩR)³).
    pub power_coefficient: f64,
    /// Total inflow λ_0, λ_1c, λ_1s.
    pub inflow: [f64; 3],
    /// Self-induced inflow λ_s0, λ_s1c, λ_s1s.
    pub self_inflow: [f64; 3],
    /// Velocity of the hub over the tip speed: forward, sideways and down the
    /// shaft, own hub frame.
    pub advance: [f64; 3],
    /// State of the flow through the rotor.
    pub flow: FlowState,
    /// β_1c, β_1s, rad.
    pub flapping: [f64; 2],
    /// θ_0, θ_1c, θ_1s, rad.
    pub pitch: [f64; 3],
    /// Mean force and moment on the hub, rotor's own hub frame, N and N m.
    pub force_hub: [f64; 3],
    /// Moment on the hub, N m.
    pub moment_hub: [f64; 3],
    /// Half of the peak-to-peak force on the hub, N.
    pub force_vibration: [f64; 3],
    /// Section-drag power, W.
    pub profile_power: f64,
    /// Induced power, W.
    pub induced_power: f64,
    /// Figure of merit T v_h/P with v_h = √(T/(2ρA)); none with an edgewise or
    /// axial speed of more than a hundredth of the tip speed, or without thrust
    /// and power.
    pub figure_of_merit: Option<f64>,
    /// Blade loading C_T/σ; zero for a rotor without blades.
    pub blade_loading: f64,
    /// What the sections of its blades meet over the orbit.
    pub census: Census,
}

/// Mean powers, W.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PowerBalance {
    /// Shaft power of all rotors.
    pub shaft: f64,
    /// Section drag of all blades.
    pub profile: f64,
    /// Induced power of all blades.
    pub induced: f64,
    /// Fuselages and wings.
    pub parasite: f64,
    /// Weight times rate of climb.
    pub climb: f64,
    /// What a switch that leaves exact mechanics takes and no blade delivers:
    /// zero but for `teeter_torque_tilt = false` and `teeter_equation =
    /// "small_angles"`.
    pub inexact: f64,
}

impl PowerBalance {
    /// Shaft power that the parts do not account for, over the shaft power.
    #[must_use]
    pub fn imbalance(&self) -> f64 {
        let parts = self.profile + self.induced + self.parasite + self.climb + self.inexact;
        (self.shaft - parts) / self.shaft
    }
}

/// A trim point, converged or not.
#[derive(Debug, Clone, PartialEq)]
pub struct TrimPoint {
    /// What was asked for.
    pub condition: FlightCondition,
    /// Whether rotors interfered.
    pub interactions: bool,
    /// How it ended.
    pub status: Status,
    /// Iterations of the least-squares solver, all solves together.
    pub iterations: usize,
    /// Norm of the scaled residuals.
    pub residual_norm: f64,
    /// Every residual.
    pub residuals: Vec<ResidualReport>,
    /// State at azimuth zero.
    pub state: Vec<f64>,
    /// States at the start of every step of the period.
    pub orbit: Vec<Vec<f64>>,
    /// Mean state.
    pub mean_state: Vec<f64>,
    /// Sticks, %.
    pub sticks: [f64; 4],
    /// Steps a period.
    pub steps: usize,
    /// Integration method.
    pub method: Method,
    /// Largest error of any unknown from the length of the step, as estimated
    /// (see [`Options::step_tolerance`]).
    pub step_error: f64,
    /// Rotors.
    pub rotors: Vec<RotorMean>,
    /// Powers.
    pub power: PowerBalance,
    /// Mean sideslip asin(v/V), rad; zero in hover.
    pub sideslip: f64,
    /// Room to the limits: sticks, then blade pitch of each rotor, then control
    /// surfaces.
    pub margins: Vec<Margin>,
    /// How the trim hangs together with level flight.
    pub branch: Branch,
    /// Iterations, for `--trace`.
    pub history: Vec<IterationReport>,
    /// Jacobian of the scaled residuals with the scaled unknowns, about right
    /// near the solution: what a neighbour starts with.
    pub jacobian: Option<DMatrix<f64>>,
}

/// A trim point that has converged: what linearisation asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergedTrim(TrimPoint);

impl ConvergedTrim {
    /// The point.
    #[must_use]
    pub fn point(&self) -> &TrimPoint {
        &self.0
    }
}

impl TrimPoint {
    /// Whether the point lies on a periodic orbit at its condition, controls
    /// within limits or not.
    #[must_use]
    pub fn on_orbit(&self) -> bool {
        !matches!(self.status, Status::Failed { .. })
    }

    /// The point as a converged trim.
    ///
    /// # Errors
    /// Gives the point back where it is not on a periodic orbit. Controls
    /// beyond their limits do not hinder a linear model, and stay reported.
    pub fn into_converged(self) -> Result<ConvergedTrim, Box<Self>> {
        if self.on_orbit() { Ok(ConvergedTrim(self)) } else { Err(Box::new(self)) }
    }

    /// The point as a guess for a neighbour.
    #[must_use]
    pub fn guess(&self) -> Guess {
        Guess {
            state: self.state.clone(),
            sticks: self.sticks,
            steps: Some(self.steps),
            jacobian: self.jacobian.clone(),
        }
    }
}

impl Guess {
    /// A guess from momentum theory and blade-element theory: rotors share
    /// the weight, level attitude, sticks centred but for the collective.
    #[must_use]
    pub fn estimate(vehicle: &Vehicle, condition: &FlightCondition) -> Self {
        let mut state = vec![0.0; vehicle.state_count()];
        state[0] = condition.horizontal_speed();
        state[2] = -condition.climb_rate;
        state[5] = condition.turn_rate;
        let share = vehicle.mass * STANDARD_GRAVITY / vehicle.rotors.len() as f64;
        let mut collective = 0.0;
        for (rotor, places) in vehicle.rotors.iter().zip(&vehicle.layout.rotors) {
            if rotor.coefficients.is_some() {
                if let Some(start) = places.speed {
                    state[start] = rotor.speed;
                }
                continue;
            }
            let c_t = share / rotor.force_scale();
            let mu = condition.horizontal_speed() / rotor.tip_speed();
            let mut lambda = (c_t / 2.0).sqrt();
            for _ in 0..20 {
                lambda = 0.5 * (lambda + c_t / (2.0 * (mu * mu + lambda * lambda).sqrt()));
            }
            if let Some(start) = places.self_inflow {
                state[start] = lambda;
            }
            if let Some(start) = places.total_inflow {
                state[start] = lambda;
            }
            if let Some(start) = places.speed {
                state[start] = rotor.speed;
            }
            collective += rotor.collective_estimate(c_t, lambda) / vehicle.rotors.len() as f64;
        }
        if let Some(stick) = speed_estimate(vehicle, share) {
            return Self { state, sticks: [0.0, 0.0, stick, 0.0], steps: None, jacobian: None };
        }
        let count = vehicle.rotors.len() as f64;
        let gain = vehicle.controls.mix.iter().map(|mix| mix.theta_0[2]).sum::<f64>() / count;
        let rigging = vehicle.controls.mix.iter().map(|mix| mix.rigging[0]).sum::<f64>() / count;
        let stick = if gain.abs() > 0.0 { (collective - rigging) / gain } else { 0.0 };
        let [low, high] = vehicle.controls.stick_limits[2];
        Self { state, sticks: [0.0, 0.0, stick.clamp(low, high), 0.0], steps: None, jacobian: None }
    }
}

/// Collective stick, %, at which rotors by coefficients carry a share of the
/// weight each, where it commands their speeds.
fn speed_estimate(vehicle: &Vehicle, share: f64) -> Option<f64> {
    let sticks = vehicle.rotors.iter().zip(&vehicle.controls.mix).filter_map(|(rotor, mix)| {
        let speed = (share / rotor.coefficients?.thrust).sqrt();
        (rotor.commanded && mix.speed[2] != 0.0).then(|| (speed - mix.speed_rigging) / mix.speed[2])
    });
    let sticks: Vec<f64> = sticks.collect();
    let [low, high] = vehicle.controls.stick_limits[2];
    let mean = sticks.iter().sum::<f64>() / sticks.len() as f64;
    (!sticks.is_empty()).then(|| mean.clamp(low, high))
}

/// Trims a vehicle at a condition from a guess: the solution that the guess
/// leads to. [`trim_at`](super::trim_at) takes no guess and gives the trim
/// that sweeps give.
///
/// The step is chosen by its error test: the solution is found again with a
/// shorter step until its estimated error no longer matters. A guess is first
/// brought near the solution with a coarse step; finer systems start from the
/// coarser one's solution, as far as its estimated error corrects it, and with
/// its Jacobian.
#[must_use]
pub fn trim(
    vehicle: &Vehicle,
    condition: FlightCondition,
    guess: &Guess,
    options: &Options,
) -> TrimPoint {
    let options = &whole_period(vehicle, options);
    let coarse_steps = COARSE_STEPS * vehicle.passages;
    let steps = guess.steps.unwrap_or(options.steps).max(steady_steps(vehicle));
    let jacobian = guess.jacobian.clone();
    let mut start = Start { steps, jacobian, ..Start::at(guess.state.clone(), guess.sticks) };
    if steps > coarse_steps {
        let shooting = Shooting::new(vehicle, condition, options.method, coarse_steps);
        let x = shooting.pack(&guess.state, &guess.sticks);
        let limits = bounds(vehicle, &shooting);
        let tolerance = options.residual_tolerance.max(COARSE_TOLERANCE);
        if let Ok(solution) =
            solve(&shooting, &x, guess.jacobian.as_ref(), limits, tolerance, options)
            && solution.converged()
        {
            start = Start { steps, ..Start::from_coarse(&shooting, &solution, options) };
        }
    }
    refine(vehicle, condition, start, options)
}

/// Options with the steps of a whole period: as many passages as it has, or
/// few where the dynamics do not vary with azimuth.
pub(super) fn whole_period(vehicle: &Vehicle, options: &Options) -> Options {
    Options {
        steps: if vehicle.is_steady() {
            steady_steps(vehicle)
        } else {
            options.steps * vehicle.passages
        },
        most_steps: options.most_steps * vehicle.passages,
        ..options.clone()
    }
}

/// Steps over the period of a vehicle whose rotors are all averaged.
fn steady_steps(vehicle: &Vehicle) -> usize {
    let flapping = vehicle.rotors.iter().zip(&vehicle.layout.rotors).filter(|(_, s)| s.flap[1] > 0);
    let fastest = flapping.map(|(rotor, _)| rotor.speed.abs()).fold(0.0, f64::max);
    let phase = PROGRESSIVE * fastest * vehicle.period;
    STEADY_STEPS.max((phase / MOST_PHASE).ceil() as usize)
}

/// Steps a period of a coarse solution.
pub(super) fn coarse_steps(vehicle: &Vehicle) -> usize {
    if vehicle.is_steady() { steady_steps(vehicle) } else { COARSE_STEPS * vehicle.passages }
}

/// Where the finer systems start.
pub(super) struct Start {
    state: Vec<f64>,
    sticks: [f64; 4],
    jacobian: Option<DMatrix<f64>>,
    /// The last coarser solution with its steps, corrected as far as it knew.
    coarser: Option<(usize, DVector<f64>)>,
    steps: usize,
    iterations: usize,
    history: Vec<IterationReport>,
}

impl Start {
    fn at(state: Vec<f64>, sticks: [f64; 4]) -> Self {
        Self {
            state,
            sticks,
            jacobian: None,
            coarser: None,
            steps: 0,
            iterations: 0,
            history: Vec::new(),
        }
    }

    /// From the solution of a coarse system, corrected as far as its error is
    /// known, with the steps that this error advises.
    pub(super) fn from_coarse(
        shooting: &Shooting<'_>,
        solution: &least_squares::Solution,
        options: &Options,
    ) -> Self {
        let flown = shooting.flown(&solution.x);
        let shift = shooting
            .estimated_change(&flown)
            .and_then(|change| newton_step(shooting, solution, &change));
        let (x, coarser) = match shift {
            Some(shift) => {
                let corrected = &solution.x + shift;
                // The same number of steps would tell nothing of their error.
                let coarser = shooting.steps() < options.steps;
                (corrected.clone(), coarser.then_some((shooting.steps(), corrected)))
            }
            None => (solution.x.clone(), None),
        };
        let (state, sticks) = shooting.unpack(&x);
        Self {
            jacobian: carried(solution),
            coarser,
            steps: options.steps,
            iterations: solution.iterations,
            history: solution.history.clone(),
            ..Self::at(state, sticks)
        }
    }
}

/// A bounded solve of one system down to a norm of its residuals.
pub(super) fn solve(
    shooting: &Shooting<'_>,
    x: &DVector<f64>,
    jacobian: Option<&DMatrix<f64>>,
    bounds: Vec<[f64; 2]>,
    tolerance: f64,
    options: &Options,
) -> Result<least_squares::Solution, least_squares::OptionsError> {
    let solver = least_squares::Options {
        bounds: Some(bounds),
        // The tolerance is on the norm; the solver looks at the largest.
        residual_tolerance: tolerance / (shooting.unknowns() as f64).sqrt(),
        max_iterations: options.max_iterations,
        chord_reduction: Some(CHORD_REDUCTION),
        ..least_squares::Options::default()
    };
    least_squares::solve_with(shooting, x, jacobian, &solver, None)
}

/// Solves with shorter and shorter steps, from a start, until the error of the
/// step no longer matters.
pub(super) fn refine(
    vehicle: &Vehicle,
    condition: FlightCondition,
    from: Start,
    options: &Options,
) -> TrimPoint {
    let Start { state, sticks, mut jacobian, mut coarser, mut steps, mut iterations, mut history } =
        from;
    let mut start = (state, sticks);
    let refined = |steps: usize, error: f64, finer: usize| {
        tracing::debug!(
            rotorcraft = vehicle.name,
            airspeed_m_s = condition.airspeed,
            steps,
            error,
            finer,
            "trim: the step is refined"
        );
    };
    loop {
        let shooting = Shooting::new(vehicle, condition, options.method, steps);
        if let Some((error, corrected)) = foreseen(&shooting, &start, &mut jacobian)
            && error > options.step_tolerance
            && let finer = finer_steps(steps, error, options)
            && finer <= options.most_steps
        {
            refined(steps, error, finer);
            start = shooting.unpack(&corrected);
            coarser = Some((steps, corrected));
            steps = finer;
            continue;
        }
        let x = shooting.pack(&start.0, &start.1);
        let limits = bounds(vehicle, &shooting);
        let tolerance = options.residual_tolerance;
        let solution = match solve(&shooting, &x, jacobian.as_ref(), limits, tolerance, options) {
            Ok(solution) => solution,
            Err(error) => {
                let failed = Status::Failed {
                    equations: Vec::new(),
                    binding: Vec::new(),
                    reason: error.to_string(),
                };
                let flown = shooting.flown(&x);
                return report(&shooting, flown, vehicle, condition, failed, steps, f64::NAN);
            }
        };
        iterations += solution.iterations;
        history.extend(solution.history.iter().cloned());
        let converged = solution.converged();
        let flown = shooting.flown(&solution.x);
        let (shift, error) = if converged {
            step_error(&shooting, &solution, &flown, coarser.as_ref(), options.method)
        } else {
            (None, f64::NAN)
        };
        let fine = error <= options.step_tolerance;
        let finer = finer_steps(steps, error, options);
        if converged && !fine && finer <= options.most_steps {
            refined(steps, error, finer);
            steps = finer;
            let corrected = shift.map_or_else(|| solution.x.clone(), |shift| &solution.x + shift);
            start = shooting.unpack(&corrected);
            coarser = Some((shooting.steps(), corrected));
            jacobian = carried(&solution);
            continue;
        }
        let status = if converged && fine {
            Status::Converged
        } else if converged {
            Status::Failed {
                equations: Vec::new(),
                binding: Vec::new(),
                reason: format!(
                    "the step could not be made fine enough: with {steps} steps a period the trim \
                     is still wrong by {error:.1e}"
                ),
            }
        } else {
            failure(&shooting, vehicle, &solution)
        };
        let mut point = report(&shooting, flown, vehicle, condition, status, steps, error);
        point.iterations = iterations;
        point.history = history;
        point.jacobian = solution.jacobian;
        tracing::debug!(
            rotorcraft = vehicle.name,
            airspeed_m_s = condition.airspeed,
            climb_rate_m_s = condition.climb_rate,
            turn_rate_rad_s = condition.turn_rate,
            status = point.status.word(),
            iterations,
            steps,
            step_error = error,
            residual = point.residual_norm,
            "trim"
        );
        for step in &point.history {
            tracing::trace!(
                iteration = step.iteration,
                residual_max = step.residual_max,
                fresh_jacobian = step.fresh_jacobian,
                "trim: iteration"
            );
        }
        return point;
    }
}

/// Steps a period where this many have too large an error.
fn finer_steps(steps: usize, error: f64, options: &Options) -> usize {
    let advised = advised_steps(steps, error, AIM * options.step_tolerance, options.method);
    advised.max((steps + steps / 4).next_multiple_of(EVEN))
}

/// Near the solution the first flight with a step already tells its error: the
/// least that it will be, and Newton's step on from the start towards the
/// solution with a finer step. `None` where the start is not near, or the
/// method cannot tell. A Jacobian that is missing is worked out: a solve would
/// begin with it too.
fn foreseen(
    shooting: &Shooting<'_>,
    start: &(Vec<f64>, [f64; 4]),
    jacobian: &mut Option<DMatrix<f64>>,
) -> Option<(f64, DVector<f64>)> {
    let x = shooting.pack(&start.0, &start.1);
    let residuals = shooting.evaluate(&x).ok()?;
    // What is not a number is not near either.
    let near = residuals.amax() < COARSE_TOLERANCE;
    if !near {
        return None;
    }
    let flown = shooting.flown(&x);
    let change = shooting.estimated_change(&flown);
    shooting.keep(flown);
    let change = change?;
    if jacobian.is_none() {
        *jacobian = Some(shooting.jacobian(&x).ok()?);
    }
    let jacobian = jacobian.as_ref()?;
    let error = relative_size(&newton(jacobian, &change)?, &x);
    let corrected = &x + newton(jacobian, &(residuals + change))?;
    Some((error, corrected))
}

/// The Jacobian of a solve that is good enough for a similar system.
pub(super) fn carried(solution: &least_squares::Solution) -> Option<DMatrix<f64>> {
    let reduction = match solution.history.as_slice() {
        [.., before, last] if !last.fresh_jacobian => last.residual_max / before.residual_max,
        _ => 0.0,
    };
    solution.jacobian.clone().filter(|_| reduction < CARRIED_REDUCTION)
}

/// Newton's step from the solution towards that with a finer step, scaled, as
/// far as it is known, and the estimated error of the solution. It has two
/// parts: what the method's second weights tell, and what they do not see,
/// which is what they left of the error of a coarser solution, less by the
/// order of the method. Without a coarser solution, or second weights, the
/// step is halved instead.
fn step_error(
    shooting: &Shooting<'_>,
    solution: &least_squares::Solution,
    flown: &Flown,
    coarser: Option<&(usize, DVector<f64>)>,
    method: Method,
) -> (Option<DVector<f64>>, f64) {
    let x = &solution.x;
    let estimated = coarser.and_then(|coarser| Some((coarser, shooting.estimated_change(flown)?)));
    let (change, unseen) = match estimated {
        Some(((steps, corrected), change)) => {
            let reduction = (*steps as f64 / shooting.steps() as f64).powi(method.order as i32);
            (change, relative_size(&(x - corrected), x) * reduction)
        }
        None => match shooting.halving_change(flown) {
            Ok(change) => (change, 0.0),
            Err(_) => return (None, f64::NAN),
        },
    };
    match newton_step(shooting, solution, &change) {
        Some(shift) => {
            let error = relative_size(&shift, x) + unseen;
            (Some(shift), error)
        }
        None => (None, f64::NAN),
    }
}

/// Newton's step that answers a change of the residuals, scaled.
fn newton_step(
    shooting: &Shooting<'_>,
    solution: &least_squares::Solution,
    change: &DVector<f64>,
) -> Option<DVector<f64>> {
    match &solution.jacobian {
        Some(jacobian) => newton(jacobian, change),
        None => newton(&shooting.jacobian(&solution.x).ok()?, change),
    }
}

/// The same with a Jacobian; `None` where that is singular.
pub(super) fn newton(jacobian: &DMatrix<f64>, change: &DVector<f64>) -> Option<DVector<f64>> {
    let shift = jacobian.clone().lu().solve(&-change)?;
    shift.iter().all(|value| value.is_finite()).then_some(shift)
}

/// Largest change of an unknown, relative to itself or, where it is small, to
/// its scale.
fn relative_size(change: &DVector<f64>, x: &DVector<f64>) -> f64 {
    change.iter().zip(x.iter()).map(|(c, x)| (c / x.abs().max(1.0)).abs()).fold(0.0, f64::max)
}

/// Bounds of the scaled unknowns: stick limits, and attitudes short of the
/// Euler angles' singularity.
pub(super) fn bounds(vehicle: &Vehicle, shooting: &Shooting<'_>) -> Vec<[f64; 2]> {
    let body = crate::vehicle::Layout::BODY;
    let count = shooting.unknowns();
    let mut bounds = vec![[f64::NEG_INFINITY, f64::INFINITY]; count];
    for angle in [body.roll, body.pitch] {
        let most = 1.4 / shooting.scales[angle];
        bounds[angle] = [-most, most];
    }
    for (k, limits) in vehicle.controls.stick_limits.iter().enumerate() {
        let index = count - 4 + k;
        bounds[index] = limits.map(|limit| limit / shooting.scales[index]);
    }
    bounds
}

fn failure(
    shooting: &Shooting<'_>,
    vehicle: &Vehicle,
    solution: &least_squares::Solution,
) -> Status {
    let equations = shooting.equations();
    let mut worst: Vec<(usize, f64)> =
        solution.residuals.iter().map(|value| value.abs()).enumerate().collect();
    worst.sort_by(|a, b| b.1.total_cmp(&a.1));
    let first = worst.first().map_or(0.0, |w| w.1);
    let names = shooting.unknown_names();
    let (_, sticks) = shooting.unpack(&solution.x);
    let binding = vehicle
        .controls
        .stick_limits
        .iter()
        .enumerate()
        .filter(|(k, [low, high])| {
            let travel = 1e-6 * (high - low);
            sticks[*k] <= low + travel || sticks[*k] >= high - travel
        })
        .map(|(k, _)| STICKS[k].to_owned())
        .collect();
    use least_squares::Status as S;
    let list = |unknowns: &[usize]| {
        unknowns.iter().map(|&k| names[k].as_str()).collect::<Vec<_>>().join(", ")
    };
    let reason = match &solution.status {
        S::Converged => String::new(),
        S::Stationary => "the residuals have a least point that is not zero".to_owned(),
        S::StalledAtBounds { unknowns } => {
            format!("the residuals could only fall beyond the limits of {}", list(unknowns))
        }
        S::RankDeficient { rank, unknowns } => format!(
            "the equations leave {} undetermined (rank {rank} of {})",
            list(unknowns),
            shooting.unknowns()
        ),
        S::NoDescent => "no step reduces the residuals".to_owned(),
        S::MaxIterations => "the iteration limit was reached".to_owned(),
        S::NonFinite { message } => format!("the flight is not finite: {message}"),
        S::EvaluationFailed { message } => message.clone(),
    };
    Status::Failed {
        equations: worst
            .iter()
            .take_while(|w| w.1 > 0.1 * first)
            .take(5)
            .map(|w| equations[w.0].name.clone())
            .collect(),
        binding,
        reason,
    }
}

/// Means, margins and residuals of an orbit.
fn report(
    shooting: &Shooting<'_>,
    flown: Flown,
    vehicle: &Vehicle,
    condition: FlightCondition,
    status: Status,
    steps: usize,
    step_error: f64,
) -> TrimPoint {
    let Flown { unknowns, orbit, period } = flown;
    let (state, sticks) = shooting.unpack(&unknowns);
    let mut rotors = vec![RotorMean::default(); vehicle.rotors.len()];
    let mut power = PowerBalance::default();
    let mut range = vec![[[f64::INFINITY, f64::NEG_INFINITY]; 3]; vehicle.rotors.len()];
    let weight = 1.0 / steps as f64;
    let mut work = vehicle.workspace::<f64>();
    let mut effectors = vec![0.0; vehicle.effector_count()];
    vehicle.mix(&sticks, &mut effectors);
    let mut rates = vec![0.0; vehicle.state_count()];
    let advance = vehicle.period * vehicle.reference_speed / orbit.len() as f64;
    for (step, state) in orbit.iter().enumerate() {
        let azimuth = step as f64 * advance;
        vehicle.rates(azimuth, state, &effectors, [0.0; 3], &mut work, &mut rates);
        let output = vehicle.output(state, &effectors, [0.0; 3], &work);
        for (index, (mean, now)) in rotors.iter_mut().zip(&output.rotors).enumerate() {
            let add = |sum: &mut f64, value: f64| *sum += weight * value;
            let add3 = |sum: &mut [f64; 3], value: &[f64; 3]| {
                for k in 0..3 {
                    sum[k] += weight * value[k];
                }
            };
            add(&mut mean.thrust, now.thrust);
            add(&mut mean.torque, now.torque);
            add(&mut mean.power, now.power);
            add(&mut mean.profile_power, now.profile_power);
            add(&mut mean.induced_power, now.induced_power);
            mean.census.merge(&now.census);
            add3(&mut mean.inflow, &now.inflow);
            add3(&mut mean.self_inflow, &now.self_inflow);
            add3(&mut mean.advance, &now.advance);
            add3(&mut mean.pitch, &now.pitch);
            add3(&mut mean.force_hub, &now.force_hub);
            add3(&mut mean.moment_hub, &now.moment_hub);
            for k in 0..2 {
                mean.flapping[k] += weight * now.flapping[k];
            }
            for ([low, high], force) in range[index].iter_mut().zip(now.force_hub) {
                *low = low.min(force);
                *high = high.max(force);
            }
            power.shaft += weight * now.power;
            power.profile += weight * now.profile_power;
            power.induced += weight * now.induced_power;
            power.inexact += weight * now.inexact_power;
        }
        power.parasite += weight * output.parasite_power;
        power.climb += weight * output.climb_power;
    }
    for (index, (mean, rotor)) in rotors.iter_mut().zip(&vehicle.rotors).enumerate() {
        mean.thrust_coefficient = mean.thrust / rotor.force_scale();
        mean.power_coefficient = mean.power / (rotor.force_scale() * rotor.tip_speed());
        let [forward, sideways, down] = mean.advance;
        let uniform = match vehicle.inflow.mass_flow {
            MassFlow::SelfInduced => mean.self_inflow[0],
            MassFlow::Total => {
                mean.inflow[0] - (rotor.induced_power_factor - 1.0) * mean.self_inflow[0]
            }
        };
        mean.flow = FlowState::of(forward.hypot(sideways), down, uniform);
        let still = mean.advance.iter().all(|ratio| ratio.abs() < STILL);
        let c_t = mean.thrust_coefficient;
        mean.figure_of_merit = (still && c_t > 0.0 && mean.power_coefficient > 0.0)
            .then(|| c_t.powf(1.5) / (SQRT_2 * mean.power_coefficient));
        let solidity = rotor.solidity();
        if solidity > 0.0 {
            mean.blade_loading = mean.thrust_coefficient / solidity;
        }
        mean.force_vibration = range[index].map(|[low, high]| 0.5 * (high - low));
    }
    let values = shooting.residuals_of(&state, &period);
    let residuals = shooting
        .equations()
        .iter()
        .zip(values.iter())
        .map(|(equation, &scaled)| ResidualReport {
            equation: equation.name.clone(),
            kind: equation.kind,
            value: scaled * equation.scale,
            scaled,
        })
        .collect();
    let margins = margins(vehicle, &sticks, &rotors, &period.mean);
    let beyond: Vec<String> = margins
        .iter()
        .filter(|margin| margin.fraction() < 0.0)
        .map(|margin| margin.control.clone())
        .collect();
    let status = match status {
        Status::Converged if !beyond.is_empty() => Status::BeyondLimits { controls: beyond },
        Status::Failed { equations, mut binding, reason } => {
            binding.extend(beyond);
            Status::Failed { equations, binding, reason }
        }
        other => other,
    };
    let sideslip = if condition.airspeed > super::shooting::HOVER_SPEED {
        (period.mean[1] / condition.airspeed).clamp(-1.0, 1.0).asin()
    } else {
        0.0
    };
    TrimPoint {
        condition,
        interactions: vehicle.inflow.interactions && vehicle.rotors.len() > 1,
        status,
        iterations: 0,
        residual_norm: values.norm(),
        residuals,
        state,
        orbit,
        mean_state: period.mean,
        sticks,
        steps,
        method: shooting.method(),
        step_error,
        rotors,
        power,
        sideslip,
        margins,
        branch: Branch::OfGuess,
        history: Vec::new(),
        jacobian: None,
    }
}

/// Of the sticks, of commanded rotor speeds, of blade pitches and of control
/// surfaces; not of pitches
/// that nothing moves on rotors whose speed is commanded.
fn margins(
    vehicle: &Vehicle,
    sticks: &[f64; 4],
    rotors: &[RotorMean],
    mean_state: &[f64],
) -> Vec<Margin> {
    let controls = &vehicle.controls;
    let mut margins: Vec<Margin> = (0..4)
        .map(|k| Margin {
            control: STICKS[k].to_owned(),
            kind: Kind::Percent,
            value: sticks[k],
            limits: controls.stick_limits[k],
        })
        .collect();
    for (index, (rotor, mean)) in vehicle.rotors.iter().zip(rotors).enumerate() {
        if let Some(place) = vehicle.layout.rotors[index].speed.filter(|_| rotor.commanded) {
            margins.push(Margin {
                control: format!("{}.omega", rotor.name),
                kind: Kind::AngularRateRad,
                value: mean_state[place],
                limits: controls.speed_limits[index],
            });
        }
        let mix = &controls.mix[index];
        let rows = [mix.theta_0, mix.theta_1c, mix.theta_1s];
        for (k, name) in ["theta_0", "theta_1c", "theta_1s"].iter().enumerate() {
            if rotor.commanded && rows[k] == [0.0; 4] {
                continue;
            }
            margins.push(Margin {
                control: format!("{}.{name}", rotor.name),
                kind: Kind::Angle,
                value: mean.pitch[k],
                limits: if k == 0 {
                    controls.collective_limits[index]
                } else {
                    controls.cyclic_limits[index]
                },
            });
        }
    }
    for surface in
        vehicle.wings.iter().filter_map(|wing| Some((&wing.name, wing.surface.as_ref()?)))
    {
        let (name, surface) = surface;
        margins.push(Margin {
            control: format!("{name}.deflection"),
            kind: Kind::Angle,
            value: surface.deflection(sticks),
            limits: surface.limits,
        });
    }
    margins
}

impl crate::vehicle::rotor::Rotor {
    /// Collective at the root, rad, for a thrust coefficient and an inflow:
    /// blade-element theory with a lift slope of 2π less losses.
    pub(super) fn collective_estimate(&self, c_t: f64, lambda: f64) -> f64 {
        const LIFT_SLOPE: f64 = 5.73;
        6.0 * c_t / (self.solidity() * LIFT_SLOPE) + 1.5 * lambda - self.twist_at(0.75)
    }

    /// Solidity N_b ∫c dr/(πR²).
    #[must_use]
    pub fn solidity(&self) -> f64 {
        self.blade_area() * self.blades as f64 / (PI * self.radius * self.radius)
    }
}
