//! Bounded nonlinear least squares: Levenberg–Marquardt as an argmin solver.
//!
//! [`solve`] minimises ½‖r(x)‖² on a box. Each iteration solves
//!
//! ```text
//! min ‖J s + r‖² + λ ‖D s‖²   with   low ≤ x + s ≤ high
//! ```
//!
//! with the column scales D of Moré and the damping λ that keeps ‖D s‖
//! within a trust radius (J. J. Moré, The Levenberg–Marquardt algorithm:
//! implementation and theory, 1978). Inside the radius λ is zero: near a
//! solution the steps are full Gauss–Newton steps and converge quadratically.
//! The linear systems go through a singular value decomposition, so that a
//! rank-deficient Jacobian gives the shortest step, and the unknowns that the
//! residuals do not determine are named.
//!
//! A Jacobian costs as much as many residuals. So the residual is tested
//! before a Jacobian is asked for, and while the residual falls fast the last
//! Jacobian serves again (chord steps), corrected to agree with the change of
//! the residuals over the last step (C. G. Broyden, A class of methods for
//! solving nonlinear simultaneous equations, 1965).
//!
//! The outcome is data, not an error: see [`Status`].

use argmin::core::{
    Error, Executor, IterState, KV, Problem, Solver, TerminationReason, TerminationStatus,
};
use nalgebra::{DMatrix, DVector, SVD};
use thiserror::Error as ThisError;

/// Why residuals or their Jacobian could not be evaluated.
#[derive(Debug, Clone, PartialEq, Eq, ThisError)]
#[error("{message}")]
pub struct EvaluationError {
    /// What went wrong, in the user's terms.
    pub message: String,
}

/// A system of residuals r(x), scaled so that 1 is a large residual in each.
pub trait Residuals {
    /// Residuals at `x`. An error or a value that is not finite makes the
    /// solver try a shorter step.
    ///
    /// # Errors
    /// When the residuals do not exist at `x`.
    fn evaluate(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError>;

    /// Jacobian ∂r/∂x at `x`: one row a residual, one column an unknown.
    ///
    /// # Errors
    /// When the Jacobian does not exist at `x`.
    fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError>;
}

/// How to solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Lower and upper bound of each unknown, possibly infinite; none for a
    /// problem without bounds.
    pub bounds: Option<Vec<[f64; 2]>>,
    /// Converged when no residual is larger than this in magnitude.
    pub residual_tolerance: f64,
    /// Stationary when the cosine between the residual vector and every
    /// column of the Jacobian that may still move is below this.
    pub gradient_tolerance: f64,
    /// Smallest step worth trying, relative to the scaled unknowns:
    /// ‖D s‖ against ‖D x‖.
    pub step_tolerance: f64,
    /// Most trial steps.
    pub max_iterations: usize,
    /// First trust radius, relative to the larger of ‖D x‖ and ‖r‖ at the
    /// start.
    pub initial_radius: f64,
    /// Singular values of the column-scaled Jacobian below this fraction of
    /// the largest count as zero.
    pub rank_tolerance: f64,
    /// Use the last Jacobian again, with Broyden's correction, after a full
    /// step that cut ‖r‖ at least to this fraction; none always asks for a new
    /// one.
    pub chord_reduction: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            bounds: None,
            residual_tolerance: 1e-10,
            gradient_tolerance: 1e-8,
            step_tolerance: 1e-13,
            max_iterations: 60,
            initial_radius: 100.0,
            rank_tolerance: 1e-9,
            chord_reduction: Some(0.02),
        }
    }
}

/// Bad input to [`solve`].
#[derive(Debug, Clone, PartialEq, ThisError)]
pub enum OptionsError {
    /// A number is out of its range.
    #[error("{name} is {value}; it must be {requirement}")]
    OutOfRange {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// Not one pair of bounds an unknown.
    #[error("{found} pairs of bounds were given for {needed} unknowns")]
    BoundsLength {
        /// Pairs given.
        found: usize,
        /// Unknowns.
        needed: usize,
    },
    /// A pair of bounds leaves no room.
    #[error("the bounds of unknown {index} are {low} and {high}: no value lies between")]
    EmptyBounds {
        /// Index of the unknown, from 0.
        index: usize,
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// The start is not finite.
    #[error("the start of unknown {index} is {value}; it must be finite")]
    StartNotFinite {
        /// Index of the unknown, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// There is nothing to solve for.
    #[error("there are no unknowns")]
    NoUnknowns,
    /// The executor refused to run.
    #[error("the iteration could not be run: {0}")]
    Executor(String),
}

/// How a solve ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Status {
    /// Every residual is within tolerance.
    Converged,
    /// A least-squares point inside the bounds: no direction reduces the
    /// residuals further, and they are not zero. For an overdetermined fit
    /// this is success; for a system to be solved there is no solution here.
    Stationary,
    /// A least-squares point on the boundary: the residuals could be reduced
    /// only by going beyond the bounds of these unknowns.
    StalledAtBounds {
        /// Indices of the unknowns.
        unknowns: Vec<usize>,
    },
    /// A least-squares point with residuals left where the Jacobian has lost
    /// rank.
    RankDeficient {
        /// Rank of the Jacobian in the unknowns free to move.
        rank: usize,
        /// Unknowns that the residuals do not determine.
        unknowns: Vec<usize>,
    },
    /// No trial step down to the step tolerance reduced the residuals, though
    /// the Jacobian promises that one should: the tolerance is below the
    /// noise of the residuals, or the Jacobian is wrong.
    NoDescent,
    /// The iteration limit was reached.
    MaxIterations,
    /// Residuals or Jacobian were not finite, at the start or wherever the
    /// iteration wanted to go.
    NonFinite {
        /// What was not finite, and where.
        message: String,
    },
    /// Residuals or Jacobian could not be evaluated, at the start or wherever
    /// the iteration wanted to go.
    EvaluationFailed {
        /// The evaluation's own message.
        message: String,
    },
}

/// One trial step.
#[derive(Debug, Clone, PartialEq)]
pub struct IterationReport {
    /// Number of the trial, from 1.
    pub iteration: usize,
    /// Whether the step was taken.
    pub accepted: bool,
    /// Largest residual magnitude after the trial (before it, if the step was
    /// not taken).
    pub residual_max: f64,
    /// Index of that residual.
    pub worst_residual: usize,
    /// ½‖r‖² after the trial.
    pub cost: f64,
    /// Damping λ; zero for a Gauss–Newton step.
    pub damping: f64,
    /// Scaled length ‖D s‖ of the trial step.
    pub step: f64,
    /// Actual over predicted reduction of the cost.
    pub gain: f64,
    /// Whether the Jacobian was evaluated for this step (else a chord step or
    /// a shorter step from the same point).
    pub fresh_jacobian: bool,
    /// Unknowns held at a bound during the step.
    pub held: usize,
    /// Rank of the Jacobian in the unknowns free to move.
    pub rank: usize,
}

/// Where and how a solve ended.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Unknowns, within the bounds.
    pub x: DVector<f64>,
    /// Residuals at `x`; empty if they could not be evaluated at the start.
    pub residuals: DVector<f64>,
    /// The last Jacobian evaluated, if any was, with the corrections since.
    pub jacobian: Option<DMatrix<f64>>,
    /// Whether that Jacobian belongs to `x`.
    pub jacobian_at_solution: bool,
    /// How the solve ended.
    pub status: Status,
    /// Trial steps.
    pub iterations: usize,
    /// Residual evaluations.
    pub evaluations: usize,
    /// Jacobian evaluations.
    pub jacobian_evaluations: usize,
    /// One report a trial step.
    pub history: Vec<IterationReport>,
    /// Unknowns that sit on a bound.
    pub active_bounds: Vec<usize>,
    /// Rank of the last Jacobian decomposed, in the unknowns free to move.
    pub rank: Option<usize>,
    /// Unknowns that the last Jacobian decomposed leaves undetermined.
    pub undetermined: Vec<usize>,
    /// Condition number of the last Jacobian decomposed, columns scaled to D;
    /// infinite when rank is lost.
    pub condition: Option<f64>,
}

impl Solution {
    /// Whether every residual is within tolerance.
    pub fn converged(&self) -> bool {
        self.status == Status::Converged
    }

    /// Largest residual magnitude; NaN without residuals.
    pub fn residual_max(&self) -> f64 {
        worst(&self.residuals).1
    }
}

/// Minimises ½‖r(x)‖² from `start` (brought inside the bounds) as told by
/// `options`; `observer` sees every trial step.
///
/// # Errors
/// Only for bad options; a solve that fails says so in [`Solution::status`].
pub fn solve<P: Residuals>(
    problem: &P,
    start: &DVector<f64>,
    options: &Options,
    observer: Option<&mut dyn FnMut(&IterationReport)>,
) -> Result<Solution, OptionsError> {
    solve_with(problem, start, None, options, observer)
}

/// As [`solve`], with the Jacobian of a similar system near `start`: the first
/// steps use it, and a new one is asked for where they gain too little.
///
/// # Errors
/// Only for bad options; a solve that fails says so in [`Solution::status`].
pub fn solve_with<P: Residuals>(
    problem: &P,
    start: &DVector<f64>,
    jacobian: Option<&DMatrix<f64>>,
    options: &Options,
    observer: Option<&mut dyn FnMut(&IterationReport)>,
) -> Result<Solution, OptionsError> {
    options.check(start)?;
    let mut solver = LevenbergMarquardt::new(options, start.len(), observer);
    let start = solver.bounded(start);
    let usable = jacobian.filter(|j| j.ncols() == start.len() && j.iter().all(|v| v.is_finite()));
    if let Some(jacobian) = usable {
        solver.rescale(jacobian);
        solver.chord = true;
    }
    let result = Executor::new(problem, solver)
        .configure(|state: Iterate| {
            let state = state.param(start);
            match usable {
                Some(jacobian) => state.jacobian(jacobian.clone()),
                None => state,
            }
        })
        .ctrlc(false)
        .run()
        .map_err(|e| OptionsError::Executor(e.to_string()))?;

    let count = |what| result.problem.counts.get(what).copied().unwrap_or(0) as usize;
    let (evaluations, jacobian_evaluations) = (count(RESIDUALS), count(JACOBIAN));
    let (solver, mut state) = (result.solver, result.state);
    let x =
        state.take_param().ok_or_else(|| OptionsError::Executor("no iterate is left".into()))?;
    let linear = solver.linear.as_ref();
    Ok(Solution {
        active_bounds: (0..x.len())
            .filter(|&i| x[i] <= solver.low[i] || x[i] >= solver.high[i])
            .collect(),
        x,
        residuals: state.take_residuals().unwrap_or_else(|| DVector::zeros(0)),
        jacobian: state.take_jacobian(),
        jacobian_at_solution: solver.jacobian_is_fresh,
        status: solver.status.unwrap_or(Status::MaxIterations),
        iterations: solver.history.len(),
        evaluations,
        jacobian_evaluations,
        history: solver.history,
        rank: linear.map(|l| l.rank),
        undetermined: linear.map(|l| l.undetermined()).unwrap_or_default(),
        condition: linear.map(|l| l.condition()),
    })
}

impl Options {
    fn check(&self, start: &DVector<f64>) -> Result<(), OptionsError> {
        let positive = [
            ("residual_tolerance", self.residual_tolerance),
            ("initial_radius", self.initial_radius),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(OptionsError::OutOfRange {
                    name,
                    value,
                    requirement: "positive and finite",
                });
            }
        }
        let fractions = [
            ("gradient_tolerance", self.gradient_tolerance),
            ("step_tolerance", self.step_tolerance),
            ("rank_tolerance", self.rank_tolerance),
            ("chord_reduction", self.chord_reduction.unwrap_or(0.0)),
        ];
        for (name, value) in fractions {
            if !(0.0..1.0).contains(&value) {
                return Err(OptionsError::OutOfRange {
                    name,
                    value,
                    requirement: "at least 0 and less than 1",
                });
            }
        }
        if start.is_empty() {
            return Err(OptionsError::NoUnknowns);
        }
        if let Some(index) = start.iter().position(|v| !v.is_finite()) {
            return Err(OptionsError::StartNotFinite { index, value: start[index] });
        }
        let Some(bounds) = &self.bounds else {
            return Ok(());
        };
        if bounds.len() != start.len() {
            return Err(OptionsError::BoundsLength { found: bounds.len(), needed: start.len() });
        }
        for (index, &[low, high]) in bounds.iter().enumerate() {
            let room = low <= high && low < f64::INFINITY && high > f64::NEG_INFINITY;
            if !room {
                return Err(OptionsError::EmptyBounds { index, low, high });
            }
        }
        Ok(())
    }
}

/// argmin's bookkeeping: unknowns, no gradient, Jacobian, no Hessian,
/// residuals.
type Iterate = IterState<DVector<f64>, (), DMatrix<f64>, (), DVector<f64>, f64>;

const RESIDUALS: &str = "residuals";
const JACOBIAN: &str = "jacobian";

/// A step is taken when it gains at least this part of the predicted
/// reduction.
const LEAST_GAIN: f64 = 1e-4;
/// Predicted reductions below this part of the cost are rounding.
const LEAST_REDUCTION: f64 = 1e-14;
/// Columns of the Jacobian shorter than this part of the longest are scaled
/// as if they were as long as that. Times the rank tolerance it is rounding:
/// a column of nothing else then counts as zero.
const SHORTEST_COLUMN: f64 = 1e-6;
/// An unknown counts as undetermined when more than this part of its unit
/// vector lies in the null space.
const PARTICIPATION: f64 = 0.1;

/// Trials back from the last that count as recent.
const RECENT: usize = 8;

/// Index and value of the largest magnitude.
fn worst(residuals: &DVector<f64>) -> (usize, f64) {
    let mut out = (0, f64::NAN);
    for (i, r) in residuals.iter().enumerate() {
        if out.1.is_nan() || r.abs() > out.1 {
            out = (i, r.abs());
        }
    }
    out
}

/// Why an evaluation gave nothing to work with.
enum Failure {
    NonFinite(String),
    Evaluation(String),
}

impl From<Failure> for Status {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::NonFinite(message) => Status::NonFinite { message },
            Failure::Evaluation(message) => Status::EvaluationFailed { message },
        }
    }
}

/// The Jacobian in the free unknowns, columns scaled, decomposed: U Σ Vᵀ.
struct Decomposition {
    free: Vec<usize>,
    u: DMatrix<f64>,
    sigma: DVector<f64>,
    v_t: DMatrix<f64>,
    rank: usize,
}

impl Decomposition {
    fn new(
        jacobian: &DMatrix<f64>,
        scale: &DVector<f64>,
        free: Vec<usize>,
        rank_tolerance: f64,
    ) -> Option<Self> {
        // Zero rows for an underdetermined system, so that Vᵀ is complete.
        let rows = jacobian.nrows().max(free.len());
        let mut scaled = DMatrix::zeros(rows, free.len());
        for (k, &i) in free.iter().enumerate() {
            let mut column = scaled.view_mut((0, k), (jacobian.nrows(), 1));
            column.copy_from(&jacobian.column(i));
            column /= scale[i];
        }
        let svd = SVD::try_new(scaled, true, true, f64::EPSILON, 10_000)?;
        let (u, v_t, sigma) = (svd.u?, svd.v_t?, svd.singular_values);
        let largest = sigma.iter().copied().fold(0.0, f64::max);
        let rank = sigma.iter().filter(|&&s| s > rank_tolerance * largest).count();
        Some(Self { free, u, sigma, v_t, rank })
    }

    /// Coordinates Uᵀr of a residual vector, as many as the rank.
    fn coordinates(&self, residuals: &DVector<f64>) -> DVector<f64> {
        let rows = residuals.len();
        DVector::from_fn(self.rank, |k, _| self.u.view((0, k), (rows, 1)).dot(residuals))
    }

    /// Length ‖D s‖ of the step with damping λ.
    fn length(&self, coordinates: &DVector<f64>, damping: f64) -> f64 {
        (0..self.rank)
            .map(|k| (self.sigma[k] * coordinates[k] / (self.sigma[k].powi(2) + damping)).powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// Least damping λ that keeps the step within the radius, to a tenth.
    fn damping(&self, coordinates: &DVector<f64>, radius: f64) -> f64 {
        if self.length(coordinates, 0.0) <= 1.1 * radius {
            return 0.0;
        }
        // ‖D s‖ falls with λ, and 1/‖D s‖ is nearly linear in it.
        let gradient =
            (0..self.rank).map(|k| (self.sigma[k] * coordinates[k]).powi(2)).sum::<f64>().sqrt();
        let (mut low, mut high) = (0.0, gradient / radius);
        let mut damping = 1e-3 * high;
        for _ in 0..60 {
            let length = self.length(coordinates, damping);
            if (length - radius).abs() <= 0.1 * radius {
                break;
            }
            if length > radius {
                low = damping;
            } else {
                high = damping;
            }
            let slope = -(0..self.rank)
                .map(|k| {
                    let s2 = self.sigma[k].powi(2);
                    s2 * coordinates[k].powi(2) / (s2 + damping).powi(3)
                })
                .sum::<f64>()
                / length;
            let newton = damping + (length - radius) / radius * length / -slope;
            damping = if newton > low && newton < high {
                newton
            } else {
                (low * high).sqrt().max(0.001 * high)
            };
        }
        damping
    }

    /// Step in all unknowns, zero in those held.
    fn step(&self, coordinates: &DVector<f64>, damping: f64, scale: &DVector<f64>) -> DVector<f64> {
        let mut step = DVector::zeros(scale.len());
        for k in 0..self.rank {
            let weight = self.sigma[k] * coordinates[k] / (self.sigma[k].powi(2) + damping);
            for (j, &i) in self.free.iter().enumerate() {
                step[i] -= weight * self.v_t[(k, j)] / scale[i];
            }
        }
        step
    }

    fn condition(&self) -> f64 {
        let largest = self.sigma.iter().copied().fold(0.0, f64::max);
        let least = self.sigma.iter().copied().fold(f64::INFINITY, f64::min);
        if self.rank < self.free.len() { f64::INFINITY } else { largest / least }
    }

    fn undetermined(&self) -> Vec<usize> {
        if self.rank == self.free.len() {
            return Vec::new();
        }
        let participation = |j: usize| {
            let seen: f64 = (0..self.rank).map(|k| self.v_t[(k, j)].powi(2)).sum();
            (1.0 - seen).max(0.0).sqrt()
        };
        (0..self.free.len())
            .filter(|&j| participation(j) > PARTICIPATION)
            .map(|j| self.free[j])
            .collect()
    }
}

/// The solver that argmin's executor runs; one trial step an iteration.
struct LevenbergMarquardt<'a, 'o> {
    options: &'a Options,
    observer: Option<&'a mut (dyn FnMut(&IterationReport) + 'o)>,
    low: DVector<f64>,
    high: DVector<f64>,
    /// Column scales D, never falling.
    scale: DVector<f64>,
    /// Trust radius on ‖D s‖; none before the first Jacobian.
    radius: Option<f64>,
    linear: Option<Decomposition>,
    /// Whether the Jacobian was corrected after that.
    corrected: bool,
    /// Whether the Jacobian belongs to the current unknowns.
    jacobian_is_fresh: bool,
    /// Whether the next step may use a Jacobian of an earlier point.
    chord: bool,
    history: Vec<IterationReport>,
    /// The last trial that could not be evaluated, and its number.
    failure: Option<(usize, Failure)>,
    status: Option<Status>,
}

impl<'a, 'o> LevenbergMarquardt<'a, 'o> {
    fn new(
        options: &'a Options,
        unknowns: usize,
        observer: Option<&'a mut (dyn FnMut(&IterationReport) + 'o)>,
    ) -> Self {
        let bound = |side: usize, none: f64| {
            DVector::from_fn(unknowns, |i, _| options.bounds.as_ref().map_or(none, |b| b[i][side]))
        };
        Self {
            options,
            observer,
            low: bound(0, f64::NEG_INFINITY),
            high: bound(1, f64::INFINITY),
            scale: DVector::zeros(unknowns),
            radius: None,
            linear: None,
            corrected: false,
            jacobian_is_fresh: false,
            chord: false,
            history: Vec::new(),
            failure: None,
            status: None,
        }
    }

    fn bounded(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(x.len(), |i, _| x[i].max(self.low[i]).min(self.high[i]))
    }

    fn residuals<P: Residuals>(
        problem: &mut Problem<&P>,
        x: &DVector<f64>,
    ) -> Result<Result<DVector<f64>, Failure>, Error> {
        let residuals = problem.problem(RESIDUALS, |p| Ok(p.evaluate(x)))?;
        Ok(match residuals {
            Err(e) => Err(Failure::Evaluation(e.message)),
            Ok(r) => match r.iter().position(|v| !v.is_finite()) {
                None => Ok(r),
                Some(i) => Err(Failure::NonFinite(format!("residual {i} is {}", r[i]))),
            },
        })
    }

    fn jacobian<P: Residuals>(
        problem: &mut Problem<&P>,
        x: &DVector<f64>,
        rows: usize,
    ) -> Result<Result<DMatrix<f64>, Failure>, Error> {
        let jacobian = problem.problem(JACOBIAN, |p| Ok(p.jacobian(x)))?;
        Ok(match jacobian {
            Err(e) => Err(Failure::Evaluation(e.message)),
            Ok(j) if j.shape() != (rows, x.len()) => Err(Failure::Evaluation(format!(
                "the Jacobian is {} by {}, with {rows} residuals of {} unknowns",
                j.nrows(),
                j.ncols(),
                x.len()
            ))),
            Ok(j) => match j.iter().position(|v| !v.is_finite()) {
                None => Ok(j),
                Some(k) => Err(Failure::NonFinite(format!(
                    "the derivative of residual {} by unknown {} is {}",
                    k % rows,
                    k / rows,
                    j[k]
                ))),
            },
        })
    }

    /// Column scales of a new Jacobian.
    fn rescale(&mut self, jacobian: &DMatrix<f64>) {
        for i in 0..jacobian.ncols() {
            self.scale[i] = self.scale[i].max(jacobian.column(i).norm());
        }
        let longest = self.scale.amax();
        let floor = if longest > 0.0 { longest } else { 1.0 };
        for i in 0..jacobian.ncols() {
            if self.scale[i] <= SHORTEST_COLUMN * floor {
                self.scale[i] = floor;
            }
        }
    }

    /// Unknowns that may move: all but those on a bound that the gradient
    /// pushes outward.
    fn free(&self, x: &DVector<f64>, gradient: &DVector<f64>) -> Vec<usize> {
        (0..x.len())
            .filter(|&i| {
                let outward = (x[i] <= self.low[i] && gradient[i] >= 0.0)
                    || (x[i] >= self.high[i] && gradient[i] <= 0.0);
                !outward
            })
            .collect()
    }

    /// Decomposes the Jacobian in the free unknowns, unless that is done.
    fn decompose(&mut self, jacobian: &DMatrix<f64>, free: Vec<usize>) -> Option<()> {
        if self.corrected || self.linear.as_ref().is_none_or(|l| l.free != free) {
            self.linear =
                Some(Decomposition::new(jacobian, &self.scale, free, self.options.rank_tolerance)?);
            self.corrected = false;
        }
        Some(())
    }

    /// Newton's step with a corrected Jacobian, where it is all that is needed:
    /// as many residuals as unknowns, none at a bound before or after, length
    /// within the radius. It saves the singular value decomposition.
    fn newton_step(
        &self,
        x: &DVector<f64>,
        residuals: &DVector<f64>,
        jacobian: &DMatrix<f64>,
        radius: f64,
    ) -> Option<DVector<f64>> {
        let full = self.linear.as_ref().is_none_or(|linear| linear.rank == x.len());
        if self.jacobian_is_fresh || !full || jacobian.nrows() != x.len() {
            return None;
        }
        let step = jacobian.clone().lu().solve(&-residuals)?;
        let inside = (0..x.len()).all(|i| {
            let next = x[i] + step[i];
            self.low[i] < x[i].min(next) && x[i].max(next) < self.high[i]
        });
        let length = step.component_mul(&self.scale).norm();
        (inside && length <= radius).then_some(step)
    }

    /// Trial step and its damping. Unknowns that would leave the box are put
    /// on its face and the rest solved again.
    fn trial(
        &mut self,
        x: &DVector<f64>,
        residuals: &DVector<f64>,
        jacobian: &DMatrix<f64>,
        free: Vec<usize>,
        radius: f64,
    ) -> Option<(DVector<f64>, f64, usize)> {
        self.decompose(jacobian, free)?;
        let linear = self.linear.as_ref()?;
        let coordinates = linear.coordinates(residuals);
        let damping = linear.damping(&coordinates, radius);
        let mut step = linear.step(&coordinates, damping, &self.scale);

        let mut free = linear.free.clone();
        let mut fixed = DVector::zeros(x.len());
        loop {
            let hit: Vec<usize> = free
                .iter()
                .copied()
                .filter(|&i| x[i] + step[i] < self.low[i] || x[i] + step[i] > self.high[i])
                .collect();
            if hit.is_empty() {
                let held = x.len() - free.len();
                return Some((step, damping, held));
            }
            for &i in &hit {
                let face = if x[i] + step[i] < self.low[i] { self.low[i] } else { self.high[i] };
                fixed[i] = face - x[i];
            }
            free.retain(|i| !hit.contains(i));
            let mut rest = DVector::zeros(x.len());
            if !free.is_empty() {
                let reduced = Decomposition::new(
                    jacobian,
                    &self.scale,
                    free.clone(),
                    self.options.rank_tolerance,
                )?;
                let shifted = residuals + jacobian * &fixed;
                rest = reduced.step(&reduced.coordinates(&shifted), damping, &self.scale);
            }
            step = &fixed + rest;
        }
    }

    /// The status of a least-squares point with residuals left.
    fn stationary_status(&self, point: &Point, gradient: &DVector<f64>) -> Status {
        let x = &point.x;
        let least = self.options.gradient_tolerance * point.residuals.norm();
        let pushed: Vec<usize> = (0..x.len())
            .filter(|&i| {
                gradient[i].abs() > least * self.scale[i]
                    && ((x[i] <= self.low[i] && gradient[i] > 0.0)
                        || (x[i] >= self.high[i] && gradient[i] < 0.0))
            })
            .collect();
        if !pushed.is_empty() {
            return Status::StalledAtBounds { unknowns: pushed };
        }
        match &self.linear {
            Some(l) if l.rank < l.free.len() => {
                Status::RankDeficient { rank: l.rank, unknowns: l.undetermined() }
            }
            _ => Status::Stationary,
        }
    }

    /// The failure that the iteration keeps running into: one among the last
    /// few trials.
    fn recent_failure(&mut self) -> Option<Failure> {
        let now = self.history.len();
        self.failure.take_if(|(trial, _)| *trial + RECENT > now).map(|(_, failure)| failure)
    }

    fn report(&mut self, report: IterationReport) {
        if let Some(observer) = self.observer.as_mut() {
            observer(&report);
        }
        self.history.push(report);
    }

    /// One trial step. What it returns replaces unknowns, residuals and
    /// Jacobian.
    fn advance<P: Residuals>(
        &mut self,
        problem: &mut Problem<&P>,
        mut point: Point,
    ) -> Result<Point, Error> {
        let fresh_jacobian = !self.jacobian_is_fresh && !self.chord;
        if fresh_jacobian {
            match Self::jacobian(problem, &point.x, point.residuals.len())? {
                Err(failure) => {
                    self.status = Some(failure.into());
                    return Ok(point);
                }
                Ok(jacobian) => {
                    self.rescale(&jacobian);
                    self.linear = None;
                    self.corrected = false;
                    self.jacobian_is_fresh = true;
                    point.jacobian = Some(jacobian);
                }
            }
        }
        let Some(mut jacobian) = point.jacobian.take() else {
            return Err(Error::msg("a step was tried without a Jacobian"));
        };
        let scaled_length = |v: &DVector<f64>| v.component_mul(&self.scale).norm();
        let (length_x, norm_r) = (scaled_length(&point.x), point.residuals.norm());
        let cost = 0.5 * norm_r * norm_r;
        let gradient = jacobian.tr_mul(&point.residuals);
        let free = self.free(&point.x, &gradient);

        if self.jacobian_is_fresh {
            let steepest =
                free.iter().map(|&i| gradient[i].abs() / self.scale[i]).fold(0.0, f64::max);
            if steepest <= self.options.gradient_tolerance * norm_r {
                self.status = Some(if self.decompose(&jacobian, free).is_some() {
                    self.stationary_status(&point, &gradient)
                } else {
                    svd_failed()
                });
                point.jacobian = Some(jacobian);
                return Ok(point);
            }
        }
        let radius = self.radius.unwrap_or(self.options.initial_radius * length_x.max(norm_r));
        let trial = match self.newton_step(&point.x, &point.residuals, &jacobian, radius) {
            Some(step) => Some((step, 0.0, 0)),
            None => self.trial(&point.x, &point.residuals, &jacobian, free, radius),
        };
        let Some((step, damping, held)) = trial else {
            self.status = Some(svd_failed());
            point.jacobian = Some(jacobian);
            return Ok(point);
        };
        let next = self.bounded(&(&point.x + &step));
        let step = &next - &point.x;
        let length = step.component_mul(&self.scale).norm();
        let predicted = cost - 0.5 * (&point.residuals + &jacobian * &step).norm_squared();

        let chord = !self.jacobian_is_fresh;
        let evaluated = Self::residuals(problem, &next)?;
        let next_cost = match &evaluated {
            Ok(r) if r.len() == point.residuals.len() => 0.5 * r.norm_squared(),
            _ => f64::INFINITY,
        };
        let gain =
            if predicted > LEAST_REDUCTION * cost { (cost - next_cost) / predicted } else { 0.0 };
        let accepted = gain > LEAST_GAIN;
        let tiny = length <= self.options.step_tolerance * length_x;
        let rank = self.linear.as_ref().map_or(point.x.len(), |l| l.rank);

        match evaluated {
            Ok(residuals) if accepted => {
                let slow = self
                    .options
                    .chord_reduction
                    .is_none_or(|fraction| residuals.norm() > fraction * norm_r);
                self.chord = !slow && damping == 0.0;
                self.jacobian_is_fresh = false;
                if !chord {
                    self.radius = Some(if gain < 0.25 {
                        0.5 * length
                    } else if gain > 0.75 {
                        radius.max(2.0 * length)
                    } else {
                        radius
                    });
                }
                if self.chord {
                    let surprise = &residuals - &point.residuals - &jacobian * &step;
                    broyden(&mut jacobian, &step, &surprise, &self.scale);
                    self.corrected = true;
                }
                point.x = next;
                point.residuals = residuals;
            }
            other => {
                if let Err(failure) = other {
                    self.failure = Some((self.history.len() + 1, failure));
                }
                if chord {
                    // The old Jacobian is to blame, not the length.
                    self.chord = false;
                } else {
                    let slope = gradient.dot(&step);
                    let fraction = if next_cost.is_finite() {
                        (-slope / (2.0 * (next_cost - cost - slope))).clamp(0.1, 0.5)
                    } else {
                        0.1
                    };
                    self.radius = Some(fraction * length.min(radius));
                }
            }
        }
        point.jacobian = Some(jacobian);
        let (worst_residual, residual_max) = worst(&point.residuals);
        self.report(IterationReport {
            iteration: self.history.len() + 1,
            accepted,
            residual_max,
            worst_residual,
            cost: 0.5 * point.residuals.norm_squared(),
            damping,
            step: length,
            gain,
            fresh_jacobian,
            held,
            rank,
        });

        self.status = if residual_max <= self.options.residual_tolerance {
            Some(Status::Converged)
        } else if !accepted && !chord && predicted <= LEAST_REDUCTION * cost && held == 0 {
            Some(self.stationary_status(&point, &gradient))
        } else if !accepted && !chord && tiny {
            Some(match (self.recent_failure(), self.stationary_status(&point, &gradient)) {
                (Some(failure), _) => failure.into(),
                (None, Status::Stationary) => Status::NoDescent,
                (None, other) => other,
            })
        } else if self.history.len() >= self.options.max_iterations {
            Some(self.recent_failure().map_or(Status::MaxIterations, Status::from))
        } else {
            None
        };
        Ok(point)
    }
}

/// Broyden's rank-one correction of a Jacobian: the least change, in the metric
/// of the column scales, after which it explains the change of the residuals
/// over a step. `surprise` is what it had left unexplained.
fn broyden(
    jacobian: &mut DMatrix<f64>,
    step: &DVector<f64>,
    surprise: &DVector<f64>,
    scale: &DVector<f64>,
) {
    let weighted = step.component_mul(scale).component_mul(scale);
    let length = weighted.dot(step);
    if length > 0.0 {
        jacobian.ger(1.0 / length, surprise, &weighted, 1.0);
    }
}

fn svd_failed() -> Status {
    Status::EvaluationFailed {
        message: "the singular value decomposition of the Jacobian did not converge".into(),
    }
}

/// Unknowns with their residuals and the last Jacobian.
struct Point {
    x: DVector<f64>,
    residuals: DVector<f64>,
    jacobian: Option<DMatrix<f64>>,
}

impl<P: Residuals> Solver<&P, Iterate> for LevenbergMarquardt<'_, '_> {
    fn name(&self) -> &str {
        "Levenberg-Marquardt"
    }

    fn init(
        &mut self,
        problem: &mut Problem<&P>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let x = state.take_param().ok_or_else(|| Error::msg("there is no start"))?;
        match Self::residuals(problem, &x)? {
            Err(failure) => {
                self.status = Some(failure.into());
                Ok((state.param(x), None))
            }
            Ok(residuals) => {
                if residuals.is_empty() || worst(&residuals).1 <= self.options.residual_tolerance {
                    self.status = Some(Status::Converged);
                } else if self.options.max_iterations == 0 {
                    self.status = Some(Status::MaxIterations);
                }
                let cost = 0.5 * residuals.norm_squared();
                Ok((state.param(x).residuals(residuals).cost(cost), None))
            }
        }
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<&P>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let (Some(x), Some(residuals)) = (state.take_param(), state.take_residuals()) else {
            return Err(Error::msg("the iterate is gone"));
        };
        let jacobian = state.take_jacobian();
        let point = self.advance(problem, Point { x, residuals, jacobian })?;
        let cost = 0.5 * point.residuals.norm_squared();
        let mut state = state.param(point.x).residuals(point.residuals).cost(cost);
        if let Some(jacobian) = point.jacobian {
            state = state.jacobian(jacobian);
        }
        Ok((state, None))
    }

    fn terminate(&mut self, _state: &Iterate) -> TerminationStatus {
        match &self.status {
            None => TerminationStatus::NotTerminated,
            Some(Status::Converged) => {
                TerminationStatus::Terminated(TerminationReason::SolverConverged)
            }
            Some(other) => {
                TerminationStatus::Terminated(TerminationReason::SolverExit(format!("{other:?}")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A test problem: residuals and Jacobian as closures.
    struct Bed<R, J>(R, J);

    impl<R, J> Residuals for Bed<R, J>
    where
        R: Fn(&[f64]) -> Vec<f64>,
        J: Fn(&[f64]) -> Vec<Vec<f64>>,
    {
        fn evaluate(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
            Ok(DVector::from_vec((self.0)(x.as_slice())))
        }

        fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError> {
            let rows = (self.1)(x.as_slice());
            let n = x.len();
            Ok(DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j]))
        }
    }

    fn rosenbrock() -> impl Residuals {
        Bed(
            |x: &[f64]| vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]],
            |x: &[f64]| vec![vec![-20.0 * x[0], 10.0], vec![-1.0, 0.0]],
        )
    }

    fn powell_singular() -> impl Residuals {
        let (s5, s10) = (5.0f64.sqrt(), 10.0f64.sqrt());
        Bed(
            move |x: &[f64]| {
                vec![
                    x[0] + 10.0 * x[1],
                    s5 * (x[2] - x[3]),
                    (x[1] - 2.0 * x[2]).powi(2),
                    s10 * (x[0] - x[3]).powi(2),
                ]
            },
            move |x: &[f64]| {
                let (a, b) = (2.0 * (x[1] - 2.0 * x[2]), 2.0 * s10 * (x[0] - x[3]));
                vec![
                    vec![1.0, 10.0, 0.0, 0.0],
                    vec![0.0, 0.0, s5, -s5],
                    vec![0.0, a, -2.0 * a, 0.0],
                    vec![b, 0.0, 0.0, -b],
                ]
            },
        )
    }

    fn freudenstein_roth() -> impl Residuals {
        Bed(
            |x: &[f64]| {
                let y = x[1];
                vec![
                    -13.0 + x[0] + ((5.0 - y) * y - 2.0) * y,
                    -29.0 + x[0] + ((y + 1.0) * y - 14.0) * y,
                ]
            },
            |x: &[f64]| {
                let y = x[1];
                vec![vec![1.0, (10.0 - 3.0 * y) * y - 2.0], vec![1.0, (3.0 * y + 2.0) * y - 14.0]]
            },
        )
    }

    /// A square, consistent, mildly coupled system of `n` unknowns with the
    /// solution x_i = 0.3 sin(0.7 i), of the size of a trim.
    fn coupled(n: usize) -> impl Residuals {
        let raw = move |x: &[f64]| -> Vec<f64> {
            (0..n)
                .map(|i| {
                    let (j, k) = ((i * 7 + 3) % n, (i * 5 + 1) % n);
                    3.0 * x[i] + (2.0 * x[i]).sin() + 0.5 * x[i] * x[j] + (0.3 * x[k]).exp()
                })
                .collect()
        };
        let target = raw(&(0..n).map(solution).collect::<Vec<_>>());
        Bed(
            move |x: &[f64]| {
                let r = raw(x);
                (0..n).map(|i| r[i] - target[i]).collect()
            },
            move |x: &[f64]| {
                (0..n)
                    .map(|i| {
                        let (j, k) = ((i * 7 + 3) % n, (i * 5 + 1) % n);
                        let mut row = vec![0.0; n];
                        row[i] += 3.0 + 2.0 * (2.0 * x[i]).cos() + 0.5 * x[j];
                        row[j] += 0.5 * x[i];
                        row[k] += 0.3 * (0.3 * x[k]).exp();
                        row
                    })
                    .collect()
            },
        )
    }

    fn solution(i: usize) -> f64 {
        0.3 * (0.7 * i as f64).sin()
    }

    fn run(problem: &impl Residuals, start: &[f64], options: &Options) -> Solution {
        solve(problem, &DVector::from_row_slice(start), options, None).unwrap()
    }

    /// Iterations, residual evaluations, Jacobian evaluations.
    fn counts(s: &Solution) -> [usize; 3] {
        [s.iterations, s.evaluations, s.jacobian_evaluations]
    }

    #[test]
    fn rosenbrock_from_the_classic_start() {
        let s = run(&rosenbrock(), &[-1.2, 1.0], &Options::default());
        assert!(s.converged());
        assert!((s.x[0] - 1.0).abs() < 1e-10 && (s.x[1] - 1.0).abs() < 1e-10);
        assert!(s.condition.unwrap() > 1.0 && s.condition.unwrap() < 100.0);
        assert_eq!(counts(&s), [13, 14, 11]);
    }

    #[test]
    fn powell_singular_converges_though_rank_is_lost_at_the_solution() {
        let s = run(&powell_singular(), &[3.0, -1.0, 0.0, 1.0], &Options::default());
        assert!(s.converged());
        assert!(s.x.amax() < 1e-4);
        assert_eq!(counts(&s), [19, 20, 19]);
    }

    #[test]
    fn freudenstein_roth_finds_the_zero_or_the_trap_and_says_which() {
        let s = run(&freudenstein_roth(), &[5.0, 3.5], &Options::default());
        assert!(s.converged());
        assert!((s.x[0] - 5.0).abs() < 1e-9 && (s.x[1] - 4.0).abs() < 1e-9);
        // The local minimum (11.41…, −0.8968…) with ‖r‖² = 48.9842…, from
        // Moré, Garbow and Hillstrom, Testing unconstrained optimization
        // software, 1981. The Jacobian is singular there.
        let s = run(&freudenstein_roth(), &[0.5, -2.0], &Options::default());
        assert!((s.residuals.norm_squared() - 48.9842).abs() < 1e-4);
        assert!((s.x[0] - 11.4128).abs() < 1e-3 && (s.x[1] + 0.89681).abs() < 1e-4);
        assert!(!s.converged());
        assert!(
            matches!(s.status, Status::Stationary | Status::RankDeficient { .. }),
            "{:?}",
            s.status
        );
    }

    #[test]
    fn a_square_system_from_a_neighbour_takes_few_jacobians() {
        let n = 28;
        let start: Vec<f64> = (0..n).map(|i| solution(i) + 0.03 * (i as f64).cos()).collect();
        let options = Options { residual_tolerance: 1e-12, ..Options::default() };
        let s = run(&coupled(n), &start, &options);
        assert!(s.converged());
        for i in 0..n {
            assert!((s.x[i] - solution(i)).abs() < 1e-11);
        }
        assert!(s.history.iter().all(|h| h.damping == 0.0 && h.accepted));
        // Seven chord steps without Broyden's correction.
        assert_eq!(counts(&s), [6, 7, 1]);
        // Without chord steps: quadratic convergence.
        let s = run(&coupled(n), &start, &Options { chord_reduction: None, ..options });
        assert_eq!(counts(&s), [3, 4, 3]);
        for pair in s.history.windows(2) {
            let bound = 3.0 * pair[0].residual_max.powi(2) + 1e-14;
            assert!(pair[1].residual_max < bound, "not quadratic: {pair:?}");
        }
    }

    #[test]
    fn a_converged_start_costs_one_evaluation() {
        let s = run(&rosenbrock(), &[1.0, 1.0], &Options::default());
        assert!(s.converged() && s.jacobian.is_none());
        assert_eq!(counts(&s), [0, 1, 0]);
    }

    #[test]
    fn an_unknown_without_effect_is_named_and_stays() {
        let problem = Bed(
            |x: &[f64]| {
                vec![x[0] + 2.0 * x[2] - 1.0, x[0] - x[2].powi(3), x[2] * x[0] * 3.0 - 1.0 / 3.0]
            },
            |x: &[f64]| {
                vec![
                    vec![1.0, 0.0, 2.0],
                    vec![1.0, 0.0, -3.0 * x[2].powi(2)],
                    vec![3.0 * x[2], 0.0, 3.0 * x[0]],
                ]
            },
        );
        let s = run(&problem, &[0.5, 0.25, 0.5], &Options::default());
        // Three residuals of two effective unknowns cannot all vanish.
        match &s.status {
            Status::RankDeficient { rank, unknowns } => {
                assert_eq!((*rank, &unknowns[..]), (2, &[1][..]));
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(s.x[1], 0.25);
        assert_eq!(s.condition, Some(f64::INFINITY));
        let j = problem.jacobian(&s.x).unwrap();
        assert!(j.tr_mul(&s.residuals).amax() < 1e-7);
    }

    #[test]
    fn two_unknowns_that_act_alike_share_the_shortest_step() {
        // r = a + b − 2 and (a + b)² − 4 vanish on a line.
        let problem = Bed(
            |x: &[f64]| vec![x[0] + x[1] - 2.0, (x[0] + x[1]).powi(2) - 4.0],
            |x: &[f64]| {
                let d = 2.0 * (x[0] + x[1]);
                vec![vec![1.0, 1.0], vec![d, d]]
            },
        );
        let s = run(&problem, &[0.5, 0.0], &Options::default());
        assert!(s.converged());
        assert!((s.x[0] - s.x[1] - 0.5).abs() < 1e-9);
        assert_eq!((s.rank, &s.undetermined[..]), (Some(1), &[0, 1][..]));
    }

    #[test]
    fn a_solution_on_a_bound_converges() {
        let options =
            Options { bounds: Some(vec![[-5.0, 1.0], [-5.0, 5.0]]), ..Options::default() };
        let s = run(&rosenbrock(), &[-1.2, 1.0], &options);
        assert!(s.converged());
        assert_eq!(s.active_bounds, [0]);
    }

    #[test]
    fn a_solution_beyond_a_bound_is_reported_with_the_unknown_in_the_way() {
        let options =
            Options { bounds: Some(vec![[-5.0, 0.5], [-5.0, 5.0]]), ..Options::default() };
        let s = run(&rosenbrock(), &[-1.2, 1.0], &options);
        assert_eq!(s.status, Status::StalledAtBounds { unknowns: vec![0] });
        // The minimum on the face x₀ = ½ is x₁ = ¼, r = (0, ½).
        assert!((s.x[0] - 0.5).abs() < 1e-15 && (s.x[1] - 0.25).abs() < 1e-9);
        assert!((s.residual_max() - 0.5).abs() < 1e-12);
        assert_eq!(s.active_bounds, [0]);
        // Karush–Kuhn–Tucker: no gradient along the free unknown, and the
        // descent direction of the held one points out of the box.
        let g = rosenbrock().jacobian(&s.x).unwrap().tr_mul(&s.residuals);
        assert!(g[1].abs() < 1e-7 && g[0] < 0.0);
    }

    #[test]
    fn many_bounds_at_once_end_at_the_projected_point() {
        // Linear, orthogonal: the bounded minimum is the clipped solution.
        let n = 12;
        let wanted = move |i: usize| (i as f64 * 1.3).sin() * 2.0;
        let problem = Bed(
            move |x: &[f64]| (0..n).map(|i| (1.0 + i as f64) * (x[i] - wanted(i))).collect(),
            move |_: &[f64]| {
                (0..n)
                    .map(|i| {
                        let mut row = vec![0.0; n];
                        row[i] = 1.0 + i as f64;
                        row
                    })
                    .collect()
            },
        );
        let options = Options { bounds: Some(vec![[-1.0, 1.0]; n]), ..Options::default() };
        let s = run(&problem, &vec![0.1; n], &options);
        for i in 0..n {
            assert!((s.x[i] - wanted(i).clamp(-1.0, 1.0)).abs() < 1e-12);
        }
        let beyond: Vec<usize> = (0..n).filter(|&i| wanted(i).abs() > 1.0).collect();
        assert_eq!(s.status, Status::StalledAtBounds { unknowns: beyond });
    }

    #[test]
    fn a_system_without_solution_ends_at_its_least_squares_point() {
        // x = 1 and x = 3 at once: x = 2, residuals ±1.
        let problem =
            Bed(|x: &[f64]| vec![x[0] - 1.0, x[0] - 3.0], |_: &[f64]| vec![vec![1.0], vec![1.0]]);
        let s = run(&problem, &[10.0], &Options::default());
        assert_eq!(s.status, Status::Stationary);
        assert!((s.x[0] - 2.0).abs() < 1e-12 && (s.residual_max() - 1.0).abs() < 1e-12);
        assert!(s.jacobian_at_solution);
    }

    #[test]
    fn a_region_of_nan_only_shortens_steps() {
        // ln x = 1 with a first Gauss–Newton step into negative x.
        let problem = Bed(|x: &[f64]| vec![x[0].ln() - 1.0], |x: &[f64]| vec![vec![1.0 / x[0]]]);
        let s = run(&problem, &[30.0], &Options::default());
        assert!(s.history.iter().any(|h| !h.accepted));
        assert!(s.converged());
        assert!((s.x[0] - std::f64::consts::E).abs() < 1e-9);
    }

    #[test]
    fn nan_at_the_start_and_beyond_a_cliff_is_said() {
        let nan =
            Bed(|x: &[f64]| vec![x[0], x[0].ln()], |x: &[f64]| vec![vec![1.0], vec![1.0 / x[0]]]);
        let s = run(&nan, &[-1.0], &Options::default());
        assert_eq!(s.status, Status::NonFinite { message: "residual 1 is NaN".into() });
        // Downhill all the way to a cliff at 1.
        let cliff = Bed(
            |x: &[f64]| vec![if x[0] < 1.0 { f64::NAN } else { x[0] }],
            |_: &[f64]| vec![vec![1.0]],
        );
        let s = run(&cliff, &[2.0], &Options::default());
        assert!(matches!(s.status, Status::NonFinite { .. }), "{:?}", s.status);
        assert!((s.x[0] - 1.0).abs() < 1e-6);
        let bad =
            Bed(|x: &[f64]| vec![x[0], 1.0], |_: &[f64]| vec![vec![1.0], vec![f64::INFINITY]]);
        let s = run(&bad, &[2.0], &Options::default());
        assert_eq!(
            s.status,
            Status::NonFinite {
                message: "the derivative of residual 1 by unknown 0 is inf".into()
            }
        );
    }

    #[test]
    fn a_failing_evaluation_keeps_its_message() {
        struct Failing(Cell<usize>);
        impl Residuals for Failing {
            fn evaluate(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
                self.0.set(self.0.get() + 1);
                if x[0] < 1.0 {
                    return Err(EvaluationError { message: "the rotor stalls".into() });
                }
                Ok(x.clone())
            }
            fn jacobian(&self, _: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError> {
                Ok(DMatrix::identity(1, 1))
            }
        }
        let problem = Failing(Cell::new(0));
        let s = run(&problem, &[2.0], &Options::default());
        assert_eq!(s.status, Status::EvaluationFailed { message: "the rotor stalls".into() });
        assert_eq!(s.evaluations, problem.0.get());
    }

    #[test]
    fn a_wrong_jacobian_is_not_called_a_solution() {
        let problem = Bed(
            |x: &[f64]| vec![x[0] - 1.0, x[1] + 2.0],
            |_: &[f64]| vec![vec![-1.0, 0.0], vec![0.0, -1.0]],
        );
        let s = run(&problem, &[5.0, 5.0], &Options::default());
        assert_eq!(s.status, Status::NoDescent);
        assert_eq!(&s.x.as_slice(), &[5.0, 5.0]);
    }

    #[test]
    fn the_iteration_limit_is_reported_and_every_step_observed() {
        let options = Options { max_iterations: 3, ..Options::default() };
        let mut seen = Vec::new();
        let s = solve(
            &rosenbrock(),
            &DVector::from_row_slice(&[-1.2, 1.0]),
            &options,
            Some(&mut |report: &IterationReport| seen.push(report.clone())),
        )
        .unwrap();
        assert_eq!((s.status, s.iterations), (Status::MaxIterations, 3));
        assert_eq!(seen, s.history);
        assert!(seen.windows(2).all(|w| w[1].cost <= w[0].cost));
    }

    #[test]
    fn scaling_of_unknowns_does_not_change_the_path() {
        // x₀ in units a thousand times smaller.
        let scaled = Bed(
            |x: &[f64]| vec![10.0 * (x[1] - x[0] * x[0] * 1e-6), 1.0 - x[0] * 1e-3],
            |x: &[f64]| vec![vec![-20.0 * x[0] * 1e-6, 10.0], vec![-1e-3, 0.0]],
        );
        let (a, b) = (
            run(&rosenbrock(), &[-1.2, 1.0], &Options::default()),
            run(&scaled, &[-1200.0, 1.0], &Options::default()),
        );
        assert_eq!(counts(&a), counts(&b));
        assert!((a.x[0] - b.x[0] * 1e-3).abs() < 1e-12);
    }

    #[test]
    fn bad_options_are_refused_by_name() {
        let refuse = |options: Options, start: &[f64]| {
            solve(&rosenbrock(), &DVector::from_row_slice(start), &options, None)
                .unwrap_err()
                .to_string()
        };
        let options = Options { residual_tolerance: -1.0, ..Options::default() };
        assert_eq!(
            refuse(options, &[0.0, 0.0]),
            "residual_tolerance is -1; it must be positive and finite"
        );
        let options = Options { bounds: Some(vec![[0.0, 1.0], [2.0, 1.0]]), ..Options::default() };
        assert_eq!(
            refuse(options.clone(), &[0.0, 0.0]),
            "the bounds of unknown 1 are 2 and 1: no value lies between"
        );
        assert_eq!(refuse(options, &[0.0]), "2 pairs of bounds were given for 1 unknowns");
        assert_eq!(
            refuse(Options::default(), &[0.0, f64::NAN]),
            "the start of unknown 1 is NaN; it must be finite"
        );
    }
}
