//! Model-order reduction, each way with its error over frequency.

use nalgebra::DMatrix;

use super::LinearError;
use super::dense::{self, eigenvalues, lyapunov, solve_checked, split};
use super::frequency::{ErrorOptions, ResponseError, response_error};
use super::model::{Channel, StateSpace, indices_of};
use crate::units::Kind;

/// States that flight-control design usually keeps.
pub const RIGID_BODY: [&str; 8] = ["u", "v", "w", "p", "q", "r", "phi", "theta"];

/// Rows of the balanced fast block count as dependent below this ratio of
/// singular values, times its size.
const SINGULAR: f64 = 1e-12;
/// A state is named as a cause of singularity if its part of the null vector
/// is at least this fraction of the largest.
const NULL_VECTOR_SHARE: f64 = 0.3;

/// A reduced model and what is known about it.
#[derive(Debug, Clone)]
pub struct Reduction {
    /// The reduced model, with the inputs and outputs of the full one.
    pub model: StateSpace,
    /// How it was made.
    pub method: Method,
    /// Eigenvalues of the part taken out, smallest first, rad/s.
    pub removed: Vec<nalgebra::Complex<f64>>,
    /// Hankel singular values of the stable part, largest first; empty for
    /// residualisation and truncation.
    pub hankel: Vec<f64>,
    /// Bound on σ̄(G − Gᵣ) at every frequency, twice the sum of the neglected
    /// Hankel singular values; `None` for the methods that have no bound.
    pub bound: Option<f64>,
    /// What a careful user should know.
    pub warnings: Vec<String>,
}

/// Ways to reduce a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Fast states follow the slow ones at once: exact at zero frequency.
    Residualise,
    /// Fast states held at zero: exact at infinite frequency.
    Truncate,
    /// Truncation in balanced coordinates of the stable part.
    BalancedTruncate,
    /// Residualisation in balanced coordinates of the stable part.
    BalancedResidualise,
}

impl Method {
    /// Name for people and for options.
    pub fn name(self) -> &'static str {
        match self {
            Method::Residualise => "residualize",
            Method::Truncate => "truncate",
            Method::BalancedTruncate => "balanced",
            Method::BalancedResidualise => "balanced-residualize",
        }
    }
}

impl Reduction {
    /// Error of the reduced model against the full one.
    pub fn error(
        &self,
        full: &StateSpace,
        omega: &[f64],
        options: &ErrorOptions,
    ) -> Result<ResponseError, LinearError> {
        response_error(full, &self.model, omega, options)
    }
}

struct Partition {
    keep: Vec<usize>,
    rest: Vec<usize>,
}

fn partition<S: AsRef<str>>(model: &StateSpace, keep: &[S]) -> Result<Partition, LinearError> {
    let keep = indices_of(model.states(), "state", keep)?;
    let rest = (0..model.states().len()).filter(|i| !keep.contains(i)).collect();
    Ok(Partition { keep, rest })
}

/// Residualisation: the states not kept are taken to be at their quasi-steady
/// values, ẋ₂ = 0, so that with x = (x₁, x₂)
///
/// A = A₁₁ − A₁₂ A₂₂⁻¹ A₂₁, B = B₁ − A₁₂ A₂₂⁻¹ B₂,
/// C = C₁ − C₂ A₂₂⁻¹ A₂₁, D = D − C₂ A₂₂⁻¹ B₂
///
/// (Kokotovic, Khalil and O'Reilly, Singular Perturbation Methods in Control,
/// 1986). The steady gain is that of the full model.
///
/// # Errors
/// An unknown name, or a fast block without an inverse: the error names the
/// states that make it so.
pub fn residualise<S: AsRef<str>>(
    model: &StateSpace,
    keep: &[S],
) -> Result<Reduction, LinearError> {
    let parts = partition(model, keep)?;
    let (reduced, removed) = residualise_parts(model, &parts)?;
    let mut warnings = Vec::new();
    if let Some(worst) = removed.iter().map(|z| z.re).reduce(f64::max)
        && worst >= 0.0
    {
        warnings.push(format!(
            "the residualised states are not stable by themselves (eigenvalue with real part \
             {worst:.3} rad/s): they do not settle at their quasi-steady values"
        ));
    }
    if let Some(fast) = removed.iter().map(|z| z.norm()).reduce(f64::min) {
        let slow = eigenvalues(reduced.a())?.last().map_or(0.0, |z| z.norm());
        if slow > 0.5 * fast {
            warnings.push(format!(
                "no clear gap between the kept modes (up to {slow:.2} rad/s) and the \
                 residualised ones (from {fast:.2} rad/s)"
            ));
        }
    }
    Ok(Reduction {
        model: reduced,
        method: Method::Residualise,
        removed,
        hankel: Vec::new(),
        bound: None,
        warnings,
    })
}

fn residualise_parts(
    model: &StateSpace,
    parts: &Partition,
) -> Result<(StateSpace, Vec<nalgebra::Complex<f64>>), LinearError> {
    let Partition { keep, rest } = parts;
    let block =
        |rows: &[usize], columns: &[usize]| model.a().select_rows(rows).select_columns(columns);
    let (a11, a12) = (block(keep, keep), block(keep, rest));
    let (a21, a22) = (block(rest, keep), block(rest, rest));
    check_fast_block(model, rest, &a22)?;
    let (b1, b2) = (model.b().select_rows(keep), model.b().select_rows(rest));
    let (c1, c2) = (model.c().select_columns(keep), model.c().select_columns(rest));
    let follow_x = solve_checked("the block of the fast states", &a22, &a21)?;
    let follow_u = solve_checked("the block of the fast states", &a22, &b2)?;
    let reduced = StateSpace::new(
        keep.iter().map(|&i| model.states()[i].clone()).collect(),
        model.inputs().to_vec(),
        model.outputs().to_vec(),
        a11 - &a12 * &follow_x,
        b1 - &a12 * &follow_u,
        c1 - &c2 * &follow_x,
        model.d() - &c2 * &follow_u,
    )?;
    Ok((reduced, eigenvalues(&a22)?))
}

fn check_fast_block(
    model: &StateSpace,
    rest: &[usize],
    a22: &DMatrix<f64>,
) -> Result<(), LinearError> {
    if rest.is_empty() {
        return Ok(());
    }
    let (scaled, ..) = dense::equilibrate(a22);
    let parts = dense::svd(&scaled)?;
    let (largest, smallest) = (parts.s[0], parts.s[rest.len() - 1]);
    let ratio = if largest > 0.0 { smallest / largest } else { 0.0 };
    if ratio > SINGULAR * rest.len() as f64 {
        return Ok(());
    }
    // Left null vectors show whose equations carry no information (a state that
    // only integrates kept ones), right null vectors which states those
    // equations leave free. Their entries, unlike those of A₂₂ itself, have no
    // units: rows and columns were scaled.
    let named = |vectors: &DMatrix<f64>| -> Vec<usize> {
        (0..rest.len())
            .filter(|&k| {
                (0..rest.len())
                    .filter(|&j| parts.s[j] <= SINGULAR * rest.len() as f64 * largest)
                    .any(|j| {
                        let null = vectors.column(j);
                        null[k].abs() >= NULL_VECTOR_SHARE * null.amax()
                    })
            })
            .map(|k| rest[k])
            .collect()
    };
    let names = |list: Vec<usize>| -> Vec<String> {
        list.into_iter().map(|i| model.states()[i].name.clone()).collect()
    };
    Err(LinearError::SingularFastBlock {
        states: names(named(&parts.u)),
        free: names(named(&parts.v)),
        reciprocal_condition: ratio,
    })
}

/// Truncation: the states not kept stay at zero.
///
/// # Errors
/// An unknown name.
pub fn truncate<S: AsRef<str>>(model: &StateSpace, keep: &[S]) -> Result<Reduction, LinearError> {
    let parts = partition(model, keep)?;
    let a22 = model.a().select_rows(&parts.rest).select_columns(&parts.rest);
    Ok(Reduction {
        model: model.sub_block(&parts.keep),
        method: Method::Truncate,
        removed: eigenvalues(&a22)?,
        hankel: Vec::new(),
        bound: None,
        warnings: Vec::new(),
    })
}

/// How balanced reduction treats slow and unstable modes.
#[derive(Debug, Clone, PartialEq)]
pub struct BalancedOptions {
    /// Modes with a real part above −`stability_margin`, rad/s, are kept whole
    /// and left out of the balancing: they have no gramian, or one that would
    /// drown the others.
    pub stability_margin: f64,
    /// Sizes of the inputs that count as equally large, SI; empty for ones.
    pub input_scale: Vec<f64>,
    /// Sizes of the outputs that count as equally large, SI; empty for ones.
    pub output_scale: Vec<f64>,
}

impl Default for BalancedOptions {
    fn default() -> Self {
        Self { stability_margin: 1e-6, input_scale: Vec::new(), output_scale: Vec::new() }
    }
}

/// The stable part of a model in balanced coordinates, beside the rest.
#[derive(Debug, Clone)]
pub struct Balanced {
    /// The whole model in coordinates (`unstable.i`, `balanced.i`), in which A
    /// is block diagonal. Directions beyond the numerical rank of the
    /// gramians are left out.
    pub model: StateSpace,
    /// Number of `unstable` states, which come first.
    pub unstable: usize,
    /// Hankel singular values of the stable part, largest first, with the
    /// inputs and outputs scaled.
    pub hankel: Vec<f64>,
}

/// Splits off the unstable and marginal modes and balances the rest by the
/// square-root method (Tombs and Postlethwaite 1987).
pub fn balance_model(
    model: &StateSpace,
    options: &BalancedOptions,
) -> Result<Balanced, LinearError> {
    let (n, m, p) = (model.states().len(), model.inputs().len(), model.outputs().len());
    let input_scale = scales("input", &options.input_scale, m)?;
    let output_scale = scales("output", &options.output_scale, p)?;
    let margin = options.stability_margin;
    if !(margin.is_finite() && margin >= 0.0) {
        return Err(LinearError::Domain(format!(
            "the stability margin must be zero or more, not {margin} rad/s"
        )));
    }
    let parts = split(model.a(), |z| z.re > -margin || z.re >= 0.0)?;
    let k = parts.first;
    let stable = n - k;
    let a = &parts.t_inverse * model.a() * &parts.t;
    let b = &parts.t_inverse * model.b();
    let c = model.c() * &parts.t;
    let a_s = a.view((k, k), (stable, stable)).into_owned();
    let mut b_s = b.rows(k, stable).into_owned();
    let mut c_s = c.columns(k, stable).into_owned();
    for (j, size) in input_scale.iter().enumerate() {
        b_s.column_mut(j).scale_mut(*size);
    }
    for (i, size) in output_scale.iter().enumerate() {
        c_s.row_mut(i).unscale_mut(*size);
    }
    let controllability = lyapunov(&a_s, &(&b_s * b_s.transpose()))?;
    let observability = lyapunov(&a_s.transpose(), &(c_s.transpose() * &c_s))?;
    let l = gramian_factor(&controllability);
    let r = gramian_factor(&observability);
    let svd = dense::svd(&(r.transpose() * &l))?;
    let largest = svd.s.first().copied().unwrap_or(0.0);
    let rank = svd
        .s
        .iter()
        .take_while(|&&s| s > stable as f64 * f64::EPSILON * largest && s > 0.0)
        .count();
    // T = L V Σ^(−1/2), T⁻¹ = Σ^(−1/2) Uᵀ Rᵀ.
    let mut into = &l * svd.v.columns(0, rank);
    let mut from = svd.u.columns(0, rank).transpose() * r.transpose();
    for i in 0..rank {
        let root = svd.s[i].sqrt();
        into.column_mut(i).unscale_mut(root);
        from.row_mut(i).unscale_mut(root);
    }
    let size = k + rank;
    let mut whole_into = DMatrix::zeros(n, size);
    whole_into.columns_mut(0, k).copy_from(&parts.t.columns(0, k));
    whole_into.columns_mut(k, rank).copy_from(&(parts.t.columns(k, stable) * into));
    let mut whole_from = DMatrix::zeros(size, n);
    whole_from.rows_mut(0, k).copy_from(&parts.t_inverse.rows(0, k));
    whole_from.rows_mut(k, rank).copy_from(&(from * parts.t_inverse.rows(k, stable)));
    let mut new_a = &whole_from * model.a() * &whole_into;
    // The split makes these blocks zero; what rounding left would only blur it.
    new_a.view_mut((0, k), (k, rank)).fill(0.0);
    new_a.view_mut((k, 0), (rank, k)).fill(0.0);
    let states = (0..size)
        .map(|i| {
            let name = if i < k {
                format!("unstable.{}", i + 1)
            } else {
                format!("balanced.{}", i - k + 1)
            };
            Channel::new(name, Kind::Dimensionless)
        })
        .collect();
    Ok(Balanced {
        model: StateSpace::new(
            states,
            model.inputs().to_vec(),
            model.outputs().to_vec(),
            new_a,
            &whole_from * model.b(),
            model.c() * &whole_into,
            model.d().clone(),
        )?,
        unstable: k,
        hankel: svd.s,
    })
}

fn scales(role: &str, given: &[f64], count: usize) -> Result<Vec<f64>, LinearError> {
    if given.is_empty() {
        return Ok(vec![1.0; count]);
    }
    if given.len() != count || given.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(LinearError::Domain(format!("{count} positive {role} scales are needed")));
    }
    Ok(given.to_vec())
}

/// L with L Lᵀ = W for a positive semidefinite W that rounding may have made
/// slightly indefinite.
fn gramian_factor(w: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = w.clone().symmetric_eigen();
    let mut l = eigen.eigenvectors;
    for (i, value) in eigen.eigenvalues.iter().enumerate() {
        l.column_mut(i).scale_mut(value.max(0.0).sqrt());
    }
    l
}

/// Hankel singular values of the stable part of a model, largest first.
pub fn hankel_singular_values(
    model: &StateSpace,
    options: &BalancedOptions,
) -> Result<Vec<f64>, LinearError> {
    Ok(balance_model(model, options)?.hankel)
}

/// Balanced reduction to `order` states, of which the unstable and marginal
/// modes take their share.
///
/// # Errors
/// An order below the number of unstable and marginal modes, or
/// `method` not a balanced one.
pub fn balanced(
    model: &StateSpace,
    order: usize,
    method: Method,
    options: &BalancedOptions,
) -> Result<Reduction, LinearError> {
    let full = balance_model(model, options)?;
    if order < full.unstable {
        return Err(LinearError::Domain(format!(
            "{} unstable or marginal modes must be kept; an order of {order} is too low",
            full.unstable
        )));
    }
    let size = full.model.states().len();
    let order = order.min(size);
    let parts = Partition { keep: (0..order).collect(), rest: (order..size).collect() };
    let mut warnings = Vec::new();
    let neglected = &full.hankel[(order - full.unstable).min(full.hankel.len())..];
    if let (Some(last), Some(first)) =
        ((order - full.unstable).checked_sub(1).and_then(|i| full.hankel.get(i)), neglected.first())
        && *first > 0.99 * last
    {
        warnings.push(
            "the order cuts between two equal Hankel singular values: one state more or less \
             is as good"
                .into(),
        );
    }
    let (reduced, removed) = match method {
        Method::BalancedTruncate => {
            let a22 = full.model.a().select_rows(&parts.rest).select_columns(&parts.rest);
            (full.model.sub_block(&parts.keep), eigenvalues(&a22)?)
        }
        Method::BalancedResidualise => residualise_parts(&full.model, &parts)?,
        Method::Residualise | Method::Truncate => {
            return Err(LinearError::Domain(format!(
                "{} keeps states by name, not an order",
                method.name()
            )));
        }
    };
    Ok(Reduction {
        model: reduced,
        method,
        removed,
        bound: Some(2.0 * neglected.iter().sum::<f64>()),
        hankel: full.hankel,
        warnings,
    })
}

/// A model in which chosen outputs are the states.
///
/// Balanced states have no names. If as many outputs are chosen as there are
/// states, y = C x + D u can be solved for x: the new states are y − D u, named
/// after the outputs. A and B are then comparable with those of
/// residualisation; D stays.
///
/// # Errors
/// Another number of outputs than states, or outputs that do not determine
/// the state.
pub fn outputs_as_states<S: AsRef<str>>(
    model: &StateSpace,
    outputs: &[S],
) -> Result<StateSpace, LinearError> {
    let chosen = indices_of(model.outputs(), "output", outputs)?;
    if chosen.len() != model.states().len() {
        return Err(LinearError::Domain(format!(
            "{} outputs cannot stand for {} states",
            chosen.len(),
            model.states().len()
        )));
    }
    let c = model.c().select_rows(&chosen);
    let n = c.nrows();
    let t =
        solve_checked("the map from states to the chosen outputs", &c, &DMatrix::identity(n, n))?;
    model.transform(&t, chosen.iter().map(|&i| model.outputs()[i].clone()).collect())
}
