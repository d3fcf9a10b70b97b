//! Structure of a model: transmission zeros, controllability, relative gains.

use nalgebra::{Complex, DMatrix};

use super::LinearError;
use super::dense::{self, balance, eigen, eigenvalues, singular_values, spectral_order};
use super::frequency::frequency_response;
use super::model::StateSpace;

type C64 = Complex<f64>;

/// Directions of the system pencil below this ratio, times its size, count as
/// dependent when infinite zeros are split off.
const RANK_TOLERANCE: f64 = 1e-12;
/// A generalised eigenvalue α/β with |β| below this times its pair's size is
/// infinite.
const INFINITE: f64 = 1e-12;

/// Invariant zeros of a model, smallest first, rad/s.
///
/// The values s at which [A − s I, B; C, D] loses rank. Infinite zeros are
/// first split off by orthogonal compressions (Emami-Naeini and Van Dooren,
/// Automatica 18, 1982), also for models with unequal numbers of inputs and
/// outputs; the rest are the eigenvalues of a square pencil.
///
/// # Errors
/// A model whose transfer matrix is nowhere of full rank has every s as a
/// zero; that is said, not listed.
pub fn zeros(model: &StateSpace) -> Result<Vec<C64>, LinearError> {
    let (n, m, p) = (model.states().len(), model.inputs().len(), model.outputs().len());
    if m == 0 || p == 0 {
        return Err(LinearError::Domain("zeros need at least one input and one output".into()));
    }
    // Balance the states, then scale inputs and outputs to like size: zeros do
    // not depend on either.
    let (a, scale) = balance(model.a())?;
    let mut b = model.b().clone();
    let mut c = model.c().clone();
    for i in 0..n {
        b.row_mut(i).unscale_mut(scale[i]);
        c.column_mut(i).scale_mut(scale[i]);
    }
    let mut d = model.d().clone();
    let size = a.amax().max(f64::MIN_POSITIVE);
    for j in 0..m {
        let s = b.column(j).amax().max(d.column(j).amax() * size);
        if s > 0.0 {
            b.column_mut(j).scale_mut(size / s);
            d.column_mut(j).scale_mut(size / s);
        }
    }
    for i in 0..p {
        let s = c.row(i).amax().max(d.row(i).amax());
        if s > 0.0 {
            c.row_mut(i).unscale_mut(s);
            d.row_mut(i).unscale_mut(s);
        }
    }
    let tolerance = RANK_TOLERANCE * size.max(1.0) * (n + m + p) as f64;
    let rows = Pencil { a, b, c, d }.without_infinite_zeros(tolerance)?;
    let both = rows.transposed().without_infinite_zeros(tolerance)?.transposed();
    if both.d.nrows() != both.d.ncols() {
        return Err(LinearError::Domain(
            "the transfer matrix has no inverse at any frequency: every number is a zero".into(),
        ));
    }
    let k = both.a.nrows();
    if k == 0 {
        return Ok(Vec::new());
    }
    let mut values = both.finite_zeros()?;
    values.sort_by(spectral_order);
    Ok(values)
}

struct Pencil {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

impl Pencil {
    fn transposed(self) -> Self {
        Self {
            a: self.a.transpose(),
            b: self.c.transpose(),
            c: self.b.transpose(),
            d: self.d.transpose(),
        }
    }

    /// The pencil with the same finite zeros and D of full row rank.
    fn without_infinite_zeros(mut self, tolerance: f64) -> Result<Self, LinearError> {
        loop {
            let n = self.a.nrows();
            // Rows: D = U [D₁; 0].
            let rows = dense::svd(&self.d)?;
            let rank = rows.s.iter().filter(|s| **s > tolerance).count();
            let d = rows.u.transpose() * &self.d;
            let c = rows.u.transpose() * &self.c;
            let tau = c.nrows() - rank;
            let d1 = d.rows(0, rank).into_owned();
            let c1 = c.rows(0, rank).into_owned();
            if tau == 0 {
                self.c = c;
                self.d = d;
                return Ok(self);
            }
            // Columns: C₂ V = [S 0] with S of full column rank.
            let c2 = c.rows(rank, tau).into_owned();
            let columns = dense::svd(&c2)?;
            let nu = columns.s.iter().filter(|s| **s > tolerance).count();
            if nu == 0 {
                self.c = c1;
                self.d = d1;
                return Ok(self);
            }
            // The last ν directions are fixed by C₂ x = 0.
            let mut v = DMatrix::zeros(n, n);
            v.columns_mut(0, n - nu).copy_from(&columns.v.columns(nu, n - nu));
            v.columns_mut(n - nu, nu).copy_from(&columns.v.columns(0, nu));
            let a = v.transpose() * &self.a * &v;
            let b = v.transpose() * &self.b;
            let c1 = c1 * &v;
            let left = n - nu;
            let m = self.b.ncols();
            let mut new_c = DMatrix::zeros(nu + rank, left);
            new_c.rows_mut(0, nu).copy_from(&a.view((left, 0), (nu, left)));
            new_c.rows_mut(nu, rank).copy_from(&c1.columns(0, left));
            let mut new_d = DMatrix::zeros(nu + rank, m);
            new_d.rows_mut(0, nu).copy_from(&b.rows(left, nu));
            new_d.rows_mut(nu, rank).copy_from(&d1);
            self = Self {
                a: a.view((0, 0), (left, left)).into_owned(),
                b: b.rows(0, left).into_owned(),
                c: new_c,
                d: new_d,
            };
        }
    }

    /// Zeros of a pencil with square, invertible D.
    fn finite_zeros(&self) -> Result<Vec<C64>, LinearError> {
        let n = self.a.nrows();
        let m = self.d.nrows();
        if m == 0 {
            return eigenvalues(&self.a);
        }
        let size = n + m;
        let left = faer::Mat::from_fn(size, size, |i, j| match (i < n, j < n) {
            (true, true) => self.a[(i, j)],
            (true, false) => self.b[(i, j - n)],
            (false, true) => self.c[(i - n, j)],
            (false, false) => self.d[(i - n, j - n)],
        });
        let right = faer::Mat::from_fn(size, size, |i, j| if i == j && i < n { 1.0 } else { 0.0 });
        let pencil = left.generalized_eigen(&right).map_err(|_| LinearError::NotConverged {
            what: "the iteration for the zeros".into(),
            achieved: f64::NAN,
            wanted: f64::EPSILON,
            limit: "its iteration limit".into(),
        })?;
        let (alpha, beta) = (pencil.S_a().column_vector(), pencil.S_b().column_vector());
        // Exactly n of the n + m are finite: the m with the smallest |β|
        // relative to |α| belong to D.
        let mut order: Vec<usize> = (0..size).collect();
        let ratio = |k: usize| {
            let (x, y) = (alpha[k].norm(), beta[k].norm());
            y / (x + y).max(f64::MIN_POSITIVE)
        };
        order.sort_by(|&i, &j| ratio(j).total_cmp(&ratio(i)));
        let mut values = Vec::with_capacity(n);
        for &k in &order[..n] {
            if ratio(k) <= INFINITE {
                return Err(LinearError::Singular { what: "the pencil of the zeros".into() });
            }
            let z = alpha[k] / beta[k];
            values.push(Complex::new(z.re, z.im));
        }
        Ok(values)
    }
}

/// Controllability of one mode.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeControllability {
    /// Eigenvalue with Im λ ≥ 0, rad/s.
    pub eigenvalue: C64,
    /// Popov–Belevitch–Hautus measure: the smallest singular value of
    /// [A − λI, B] in balanced coordinates with unit input columns, over the
    /// largest singular value of A there. Zero: the mode cannot be moved.
    pub measure: f64,
    /// |wᴴ bⱼ|/(‖w‖ ‖bⱼ‖) for each input j, in the same coordinates; `None`
    /// for a defective eigenvalue.
    pub by_input: Option<Vec<f64>>,
}

/// Controllability of every mode, slowest first.
pub fn controllability(model: &StateSpace) -> Result<Vec<ModeControllability>, LinearError> {
    let n = model.states().len();
    let m = model.inputs().len();
    let (a, scale) = balance(model.a())?;
    let mut b = model.b().clone();
    for i in 0..n {
        b.row_mut(i).unscale_mut(scale[i]);
    }
    for mut column in b.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column.unscale_mut(length);
        }
    }
    let size = singular_values(&a)?.first().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    let e = eigen(&a)?;
    let mut out = Vec::new();
    for (k, &value) in e.values.iter().enumerate() {
        if value.im < 0.0 {
            continue;
        }
        // [A − λI, B/‖·‖·size] as a real matrix of twice the size.
        let wide = n + m;
        let real = DMatrix::from_fn(2 * n, 2 * wide, |i, j| {
            let (row, column) = (i % n, j % wide);
            let z = if column < n {
                Complex::new(a[(row, column)], 0.0)
                    - if row == column { value } else { C64::default() }
            } else {
                Complex::new(b[(row, column - n)] * size, 0.0)
            };
            match (i < n, j < wide) {
                (true, false) => -z.im,
                (false, true) => z.im,
                _ => z.re,
            }
        });
        let s = singular_values(&real)?;
        out.push(ModeControllability {
            eigenvalue: value,
            measure: s.last().copied().unwrap_or(0.0) / size,
            by_input: e.left[k].as_ref().map(|w| {
                let length = w.norm();
                (0..m)
                    .map(|j| {
                        let product: C64 = (0..n).map(|i| w[i].conj() * b[(i, j)]).sum();
                        product.norm() / length
                    })
                    .collect()
            }),
        });
    }
    Ok(out)
}

/// Relative gain array G ∘ (G⁺)ᵀ at a frequency, outputs × inputs.
///
/// Entry (i, j) near one: input j moves output i alike whether the other loops
/// are open or closed, so that they pair well (Bristol 1966; pseudo-inverse
/// for unequal numbers, Skogestad and Postlethwaite).
///
/// # Errors
/// An undamped mode at the frequency, or a transfer matrix without full rank.
pub fn relative_gain_array(model: &StateSpace, omega: f64) -> Result<DMatrix<C64>, LinearError> {
    let g = frequency_response(model, &[omega])?.values.swap_remove(0);
    let (p, m) = g.shape();
    let singular =
        || LinearError::Singular { what: format!("the transfer matrix at {omega} rad/s") };
    // Rows and columns of like size first: the array does not depend on units.
    let (mut rows, mut columns) = (vec![1.0; p], vec![1.0; m]);
    for (i, row) in rows.iter_mut().enumerate() {
        *row = g.row(i).norm();
    }
    if rows.contains(&0.0) {
        return Err(singular());
    }
    let mut scaled = DMatrix::from_fn(p, m, |i, j| g[(i, j)] / rows[i]);
    for (j, column) in columns.iter_mut().enumerate() {
        *column = scaled.column(j).norm();
    }
    if columns.contains(&0.0) {
        return Err(singular());
    }
    for (j, column) in columns.iter().enumerate() {
        scaled.column_mut(j).unscale_mut(*column);
    }
    let wide = m >= p;
    let gram = if wide { &scaled * scaled.adjoint() } else { scaled.adjoint() * &scaled };
    let inverse = gram.clone().try_inverse().ok_or_else(singular)?;
    let norm = |x: &DMatrix<C64>| x.iter().map(|z| z.norm_sqr()).sum::<f64>().sqrt();
    if norm(&inverse) * norm(&gram) > 1e14 {
        return Err(singular());
    }
    let pseudo = if wide { scaled.adjoint() * inverse } else { inverse * scaled.adjoint() };
    Ok(DMatrix::from_fn(p, m, |i, j| scaled[(i, j)] * pseudo[(j, i)]))
}
