//! Convex quadratic programs over half-spaces and second-order cones.
//!
//! ```text
//! minimise   ½ x'Px + q'x
//! subject to c₀ + c'x ≥ 0                          (half-spaces)
//!            |(c₁ + C₁'x, c₂ + C₂'x)| ≤ c₀ + C₀'x   (cones of three rows)
//! ```
//!
//! A [`Program`] collects rows and objective terms in any order, [`Program::solve`]
//! hands them to Clarabel as sparse matrices and turns its outcome into a
//! [`Status`] that says whether the point may be used. Duals come back in the
//! order in which the rows were added.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use std::collections::BTreeMap;

/// What the solver's answer is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Optimal to the full tolerance.
    Solved,
    /// Optimal to the reduced tolerance (5e-5 relative gap): usable where the
    /// caller checks the point again by itself.
    AlmostSolved,
    /// No point meets the rows; the duals are a certificate.
    Infeasible,
    /// The objective falls without bound.
    Unbounded,
    /// Stopped at the iteration limit.
    IterationLimit,
    /// The linear algebra broke down, or progress stopped early.
    NumericalFailure,
}

impl Status {
    /// Whether [`Solution::x`] may be used.
    pub fn usable(self) -> bool {
        matches!(self, Status::Solved | Status::AlmostSolved)
    }
}

/// Why a program could not be handed to the solver.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConicError {
    /// A coefficient is not finite.
    #[error("the conic program has a non-finite coefficient in {place}")]
    NotFinite {
        /// `row N`, `cone N` or `objective`.
        place: String,
    },
    /// A variable index is out of range.
    #[error("the conic program names variable {index} of {count}")]
    NoSuchVariable {
        /// Index asked for.
        index: usize,
        /// Number of variables.
        count: usize,
    },
    /// The solver refused the data.
    #[error("the conic solver refused the program: {0}")]
    Refused(String),
}

/// An affine function `constant + Σ coefficient·x[index]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AffineRow {
    /// Value at x = 0.
    pub constant: f64,
    /// (index, coefficient), each index at most once.
    pub terms: Vec<(usize, f64)>,
}

impl AffineRow {
    /// Row from its parts.
    pub fn new(constant: f64, terms: Vec<(usize, f64)>) -> Self {
        Self { constant, terms }
    }

    /// Value at a point.
    pub fn value(&self, x: &[f64]) -> f64 {
        self.constant + self.terms.iter().map(|&(i, c)| c * x[i]).sum::<f64>()
    }
}

/// A conic program under construction.
#[derive(Debug, Clone, Default)]
pub struct Program {
    count: usize,
    quadratic: BTreeMap<(usize, usize), f64>,
    linear: Vec<f64>,
    half_spaces: Vec<AffineRow>,
    cones: Vec<[AffineRow; 3]>,
}

/// Iteration limit of one solve.
const MAX_ITERATIONS: u32 = 100;
/// Relative and absolute duality gap and feasibility asked for.
const TOLERANCE: f64 = 1e-7;

/// Solution of a [`Program`].
#[derive(Debug, Clone)]
pub struct Solution {
    /// Whether the point may be used, and why not.
    pub status: Status,
    /// Variables.
    pub x: Vec<f64>,
    /// Objective value.
    pub objective: f64,
    /// Dual of each half-space, ≥ 0: the fall of the optimum for a unit rise
    /// of the row's constant.
    pub half_space_duals: Vec<f64>,
    /// Duals of each cone's rows, in the dual cone.
    pub cone_duals: Vec<[f64; 3]>,
    /// Interior-point iterations.
    pub iterations: u32,
    /// Time inside the solver, s.
    pub solve_time: f64,
}

impl Program {
    /// An empty program of `count` variables.
    pub fn new(count: usize) -> Self {
        Self { count, linear: vec![0.0; count], ..Self::default() }
    }

    /// Number of rows: half-spaces plus three for each cone.
    pub fn row_count(&self) -> usize {
        self.half_spaces.len() + 3 * self.cones.len()
    }

    /// Adds `value·x[i]·x[j]` to the objective.
    pub fn add_quadratic(&mut self, i: usize, j: usize, value: f64) {
        let key = (i.min(j), i.max(j));
        // The solver's objective has a half before P; only the upper triangle is kept.
        let scale = if i == j { 2.0 } else { 1.0 };
        *self.quadratic.entry(key).or_insert(0.0) += scale * value;
    }

    /// Adds `value·x[i]` to the objective.
    pub fn add_linear(&mut self, i: usize, value: f64) {
        self.linear[i] += value;
    }

    /// Requires `row ≥ 0`; returns the row's place among the half-spaces.
    pub fn require_nonnegative(&mut self, row: AffineRow) -> usize {
        self.half_spaces.push(row);
        self.half_spaces.len() - 1
    }

    /// Requires `|(rows[1], rows[2])| ≤ rows[0]`; returns its place among the cones.
    pub fn require_cone(&mut self, rows: [AffineRow; 3]) -> usize {
        self.cones.push(rows);
        self.cones.len() - 1
    }

    fn check(&self) -> Result<(), ConicError> {
        let check_row = |row: &AffineRow, place: &dyn Fn() -> String| {
            if !row.constant.is_finite() || row.terms.iter().any(|t| !t.1.is_finite()) {
                return Err(ConicError::NotFinite { place: place() });
            }
            match row.terms.iter().find(|t| t.0 >= self.count) {
                Some(&(index, _)) => Err(ConicError::NoSuchVariable { index, count: self.count }),
                None => Ok(()),
            }
        };
        for (k, row) in self.half_spaces.iter().enumerate() {
            check_row(row, &|| format!("row {k}"))?;
        }
        for (k, cone) in self.cones.iter().enumerate() {
            for row in cone {
                check_row(row, &|| format!("cone {k}"))?;
            }
        }
        if self.linear.iter().any(|v| !v.is_finite())
            || self.quadratic.values().any(|v| !v.is_finite())
        {
            return Err(ConicError::NotFinite { place: "objective".into() });
        }
        match self.quadratic.keys().find(|k| k.1 >= self.count) {
            Some(&(_, index)) => Err(ConicError::NoSuchVariable { index, count: self.count }),
            None => Ok(()),
        }
    }

    /// Solves the program. `Err` is for data the solver cannot take;
    /// infeasibility and stalls are a [`Status`].
    pub fn solve(&self) -> Result<Solution, ConicError> {
        self.check()?;
        let n = self.count;
        // Objective: upper triangle by columns.
        let mut by_column: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
        for (&(i, j), &v) in &self.quadratic {
            by_column[j].push((i, v));
        }
        let p = columns_to_csc(n, n, by_column);

        // Constraints A x + s = b with s in the cones: A = -c, b = c0.
        let rows = self.row_count();
        let mut by_column: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
        let mut b = Vec::with_capacity(rows);
        let all = self.half_spaces.iter().chain(self.cones.iter().flat_map(|c| c.iter()));
        for (r, row) in all.enumerate() {
            b.push(row.constant);
            for &(i, c) in &row.terms {
                if c != 0.0 {
                    by_column[i].push((r, -c));
                }
            }
        }
        let a = columns_to_csc(rows, n, by_column);
        let mut kinds = vec![SupportedConeT::NonnegativeConeT(self.half_spaces.len())];
        kinds.extend(self.cones.iter().map(|_| SupportedConeT::SecondOrderConeT(3)));

        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .max_iter(MAX_ITERATIONS)
            .tol_gap_abs(TOLERANCE)
            .tol_gap_rel(TOLERANCE)
            .tol_feas(TOLERANCE)
            .max_threads(1)
            .presolve_enable(false)
            .build()
            .map_err(|e| ConicError::Refused(e.to_string()))?;
        let mut solver = DefaultSolver::new(&p, &self.linear, &a, &b, &kinds, settings)
            .map_err(|e| ConicError::Refused(e.to_string()))?;
        solver.solve();
        let s = &solver.solution;
        let mut status = match s.status {
            SolverStatus::Solved => Status::Solved,
            SolverStatus::AlmostSolved => Status::AlmostSolved,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                Status::Infeasible
            }
            SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => Status::Unbounded,
            SolverStatus::MaxIterations | SolverStatus::MaxTime => Status::IterationLimit,
            SolverStatus::Unsolved
            | SolverStatus::NumericalError
            | SolverStatus::InsufficientProgress
            | SolverStatus::CallbackTerminated => Status::NumericalFailure,
        };
        if status.usable() && s.x.iter().any(|v| !v.is_finite()) {
            status = Status::NumericalFailure;
        }
        let m = self.half_spaces.len();
        Ok(Solution {
            status,
            x: s.x.clone(),
            objective: s.obj_val,
            half_space_duals: s.z[..m].to_vec(),
            cone_duals: s.z[m..].chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
            iterations: s.iterations,
            solve_time: s.solve_time,
        })
    }
}

/// Compressed columns from (row, value) lists whose rows are increasing.
fn columns_to_csc(rows: usize, columns: usize, lists: Vec<Vec<(usize, f64)>>) -> CscMatrix<f64> {
    let mut start = Vec::with_capacity(columns + 1);
    let (mut index, mut value) = (Vec::new(), Vec::new());
    start.push(0);
    for mut list in lists {
        list.sort_by_key(|e| e.0);
        for (r, v) in list {
            index.push(r);
            value.push(v);
        }
        start.push(index.len());
    }
    CscMatrix::new(rows, columns, start, index, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance from a point to the unit disk: the solution is the point
    /// scaled back to the circle, and the dual is the excess.
    #[test]
    fn projects_on_a_disk_and_meets_the_kkt_conditions() {
        let mut p = Program::new(2);
        for i in 0..2 {
            p.add_quadratic(i, i, 0.5);
        }
        p.add_linear(0, -3.0);
        p.add_linear(1, -4.0);
        p.require_cone([
            AffineRow::new(1.0, vec![]),
            AffineRow::new(0.0, vec![(0, 1.0)]),
            AffineRow::new(0.0, vec![(1, 1.0)]),
        ]);
        let s = p.solve().unwrap();
        assert_eq!(s.status, Status::Solved);
        assert!((s.x[0] - 0.6).abs() < 1e-6 && (s.x[1] - 0.8).abs() < 1e-6);
        // Stationarity: x - c = C'z with z in the cone; |z_vector| = |c| - 1.
        let z = s.cone_duals[0];
        assert!((z[0] - 4.0).abs() < 1e-5, "{z:?}");
        assert!((s.x[0] - 3.0 - z[1]).abs() < 1e-5 && (s.x[1] - 4.0 - z[2]).abs() < 1e-5);
    }

    /// The dual of a half-space is the slope of the optimum in its constant.
    #[test]
    fn half_space_dual_is_the_price_of_the_row() {
        let solve = |c: f64| {
            let mut p = Program::new(2);
            p.add_quadratic(0, 0, 1.0);
            p.add_quadratic(1, 1, 2.0);
            p.add_quadratic(0, 1, 1.0);
            p.require_nonnegative(AffineRow::new(c, vec![(0, 1.0), (1, 1.0)]));
            p.solve().unwrap()
        };
        let s = solve(-1.0);
        let h = 1e-3;
        let slope = (solve(-1.0 + h).objective - solve(-1.0 - h).objective) / (2.0 * h);
        assert!((slope + s.half_space_duals[0]).abs() < 1e-4, "{slope} {:?}", s.half_space_duals);
    }

    #[test]
    fn outcomes_are_told_apart() {
        let mut p = Program::new(1);
        p.add_quadratic(0, 0, 1.0);
        p.require_nonnegative(AffineRow::new(-1.0, vec![(0, 1.0)]));
        p.require_nonnegative(AffineRow::new(-1.0, vec![(0, -1.0)]));
        assert_eq!(p.solve().unwrap().status, Status::Infeasible);

        let mut p = Program::new(1);
        p.add_linear(0, -1.0);
        p.require_nonnegative(AffineRow::new(0.0, vec![(0, 1.0)]));
        assert_eq!(p.solve().unwrap().status, Status::Unbounded);

        let mut p = Program::new(1);
        p.require_nonnegative(AffineRow::new(f64::NAN, vec![(0, 1.0)]));
        assert!(matches!(p.solve(), Err(ConicError::NotFinite { .. })));

        let mut p = Program::new(1);
        p.require_nonnegative(AffineRow::new(0.0, vec![(3, 1.0)]));
        assert!(matches!(p.solve(), Err(ConicError::NoSuchVariable { index: 3, .. })));
    }
}
