//! Checked dense linear algebra for models of a few tens of states.
//!
//! The eigenvalue and Schur routines underneath do not end on a NaN and lose
//! digits on badly scaled matrices, so that everything here first checks that
//! the entries are finite and then balances.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{self, ComputeEigenvectors};
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{Complex, DMatrix, DVector};

use super::LinearError;

type C64 = Complex<f64>;

/// Iterations allowed for one Schur decomposition, per row.
const SCHUR_ITERATIONS_PER_ROW: usize = 300;
/// Entries beyond this overflow when squared during balancing.
const LARGEST_ENTRY: f64 = 1e150;

/// Checks that every entry is finite; the error gives row and column from 1.
pub fn ensure_finite(what: &str, m: &DMatrix<f64>) -> Result<(), LinearError> {
    for (index, value) in m.iter().enumerate() {
        if !value.is_finite() || value.abs() > LARGEST_ENTRY {
            return Err(LinearError::NotFinite {
                what: what.to_owned(),
                row: (index % m.nrows() + 1).to_string(),
                column: (index / m.nrows() + 1).to_string(),
            });
        }
    }
    Ok(())
}

fn ensure_square(what: &str, m: &DMatrix<f64>) -> Result<(), LinearError> {
    if m.is_square() {
        Ok(())
    } else {
        Err(LinearError::Domain(format!(
            "{what} must be square, not {} by {}",
            m.nrows(),
            m.ncols()
        )))
    }
}

/// D⁻¹ A D with rows and columns of like size, and the diagonal of D, whose
/// entries are powers of two.
pub fn balance(a: &DMatrix<f64>) -> Result<(DMatrix<f64>, DVector<f64>), LinearError> {
    ensure_square("a matrix to be balanced", a)?;
    ensure_finite("a matrix to be balanced", a)?;
    let mut balanced = a.clone();
    if a.nrows() == 0 {
        return Ok((balanced, DVector::zeros(0)));
    }
    let scale = balance_parlett_reinsch(&mut balanced);
    ensure_finite("a balanced matrix", &balanced)?;
    Ok((balanced, scale))
}

/// Orders eigenvalues by size, then real part, then the upper half plane first.
pub fn spectral_order(x: &C64, y: &C64) -> std::cmp::Ordering {
    x.norm().total_cmp(&y.norm()).then(x.re.total_cmp(&y.re)).then(y.im.total_cmp(&x.im))
}

fn faer_view(m: &DMatrix<f64>) -> faer::MatRef<'_, f64> {
    faer::MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols())
}

/// The double-shift iteration at every size. The blocked one, which the library
/// takes from 75 rows on, was seen to deflate without end on the closed loop of
/// a helicopter; this one has an iteration limit.
fn eigenvalue_settings() -> faer::Spec<evd::EvdParams, f64> {
    let mut params: evd::EvdParams = <evd::EvdParams as faer::Auto<f64>>::auto();
    params.schur.blocking_threshold = usize::MAX;
    params.into()
}

/// Eigenvalues of a real matrix, smallest first, conjugates adjacent.
pub fn eigenvalues(a: &DMatrix<f64>) -> Result<Vec<C64>, LinearError> {
    if a.nrows() == 0 {
        return Ok(Vec::new());
    }
    let (balanced, _) = balance(a)?;
    let n = a.nrows();
    let params = eigenvalue_settings();
    let (mut re, mut im) = (vec![0.0; n], vec![0.0; n]);
    let none = ComputeEigenvectors::No;
    let scratch = evd::evd_scratch::<f64>(n, none, none, faer::Par::Seq, params);
    let mut iterate = |matrix: &DMatrix<f64>| {
        evd::evd_real(
            faer_view(matrix),
            faer::diag::DiagMut::from_slice_mut(&mut re),
            faer::diag::DiagMut::from_slice_mut(&mut im),
            None,
            None,
            faer::Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            params,
        )
    };
    if iterate(&balanced).is_err() {
        let mirror = reflection(n);
        iterate(&(&mirror * &balanced * &mirror)).map_err(|_| no_eigenvalues())?;
    }
    let mut values: Vec<C64> =
        re.into_iter().zip(im).map(|(re, im)| Complex::new(re, im)).collect();
    values.sort_by(spectral_order);
    Ok(values)
}

fn no_eigenvalues() -> LinearError {
    LinearError::NotConverged {
        what: "the eigenvalue iteration".into(),
        achieved: f64::NAN,
        wanted: f64::EPSILON,
        limit: "its iteration limit".into(),
    }
}

/// Eigenvalues with right and left eigenvectors.
#[derive(Debug, Clone)]
pub struct Eigen {
    /// Eigenvalues, smallest first, conjugates adjacent, rad/s.
    pub values: Vec<C64>,
    /// Right eigenvectors as columns, A v = λ v, of unit length.
    pub right: DMatrix<C64>,
    /// Left eigenvectors as columns, wᴴ A = λ wᴴ, with wᴴ v = 1; `None` where
    /// the eigenvalue is defective, so that no such vector exists.
    pub left: Vec<Option<DVector<C64>>>,
}

/// Eigenvalues whose distance is below this, relative to the largest entry of
/// the balanced matrix, count as one when left vectors are paired with right.
const CLUSTER: f64 = 1e-9;
/// A cluster whose left and right vectors are this close to orthogonal counts
/// as defective.
const DEFECTIVE: f64 = 1e-7;

/// Eigenvalues and both sets of eigenvectors of a real matrix.
pub fn eigen(a: &DMatrix<f64>) -> Result<Eigen, LinearError> {
    let n = a.nrows();
    if n == 0 {
        return Ok(Eigen { values: Vec::new(), right: DMatrix::zeros(0, 0), left: Vec::new() });
    }
    let (balanced, scale) = balance(a)?;
    let (values, right) = sorted_eigenvectors(&balanced)?;
    let (left_values, left) = sorted_eigenvectors(&balanced.transpose())?;
    // Left vectors of A are the conjugates of right vectors of Aᵀ: Aᵀ z = λ z
    // gives zᵀ A = λ zᵀ, so that w = conj(z).
    let left = left.map(|z| z.conj());
    let tolerance = CLUSTER * balanced.amax().max(f64::MIN_POSITIVE);

    // Pair each right vector with the nearest unused left one.
    let mut used = vec![false; n];
    let mut partner = vec![0; n];
    for (k, value) in values.iter().enumerate() {
        let best = (0..n)
            .filter(|&j| !used[j])
            .min_by(|&i, &j| {
                (left_values[i] - value).norm().total_cmp(&(left_values[j] - value).norm())
            })
            .unwrap_or(k);
        used[best] = true;
        partner[k] = best;
    }

    let mut vectors: Vec<Option<DVector<C64>>> = vec![None; n];
    let mut done = vec![false; n];
    for k in 0..n {
        if done[k] {
            continue;
        }
        let cluster: Vec<usize> =
            (k..n).filter(|&j| !done[j] && (values[j] - values[k]).norm() <= tolerance).collect();
        for &j in &cluster {
            done[j] = true;
        }
        let v = right.select_columns(&cluster);
        let w = left.select_columns(cluster.iter().map(|&j| &partner[j]));
        // Wᴴ V = G; the columns of W G⁻ᴴ are biorthonormal to V.
        let gram = w.adjoint() * &v;
        let smallest = gram
            .clone()
            .try_svd(false, false, f64::EPSILON, 1000)
            .map_or(0.0, |s| s.singular_values.min());
        if smallest < DEFECTIVE {
            continue;
        }
        if let Some(inverse) = gram.try_inverse() {
            let paired = &w * inverse.adjoint();
            for (column, &j) in cluster.iter().enumerate() {
                vectors[j] = Some(paired.column(column).into_owned());
            }
        }
    }

    // Back from balanced coordinates, x = D z, and to unit right vectors.
    let mut right = right;
    for k in 0..n {
        for i in 0..n {
            right[(i, k)] *= scale[i];
        }
        let length = right.column(k).norm();
        right.column_mut(k).unscale_mut(length);
        if let Some(w) = &mut vectors[k] {
            for i in 0..n {
                w[i] *= length / scale[i];
            }
        }
    }
    Ok(Eigen { values, right, left: vectors })
}

/// A reflection I − 2 v vᵀ/(vᵀ v) in a direction with no symmetry.
///
/// The matrices of aircraft with many rotors alike have symmetries on which the
/// iteration may turn in circles, or which leave it with vectors of no length.
/// Seen in this mirror they have the same eigenvalues and no symmetry.
fn reflection(n: usize) -> DMatrix<f64> {
    let v = DVector::from_fn(n, |k, _| 1.0 + 0.618_034 * (1.7 * k as f64).sin());
    DMatrix::identity(n, n) - &v * v.transpose() * (2.0 / v.norm_squared())
}

/// Eigenvalues, smallest first, and unit eigenvectors.
fn sorted_eigenvectors(a: &DMatrix<f64>) -> Result<(Vec<C64>, DMatrix<C64>), LinearError> {
    sorted_vectors(a, None).or_else(|_| {
        let mirror = reflection(a.nrows());
        sorted_vectors(&(&mirror * a * &mirror), Some(&mirror))
    })
}

/// The same of a matrix seen in a mirror, whose vectors are wanted as they are.
fn sorted_vectors(
    a: &DMatrix<f64>,
    mirror: Option<&DMatrix<f64>>,
) -> Result<(Vec<C64>, DMatrix<C64>), LinearError> {
    let n = a.nrows();
    let decomposition = faer_view(a).eigen().map_err(|_| no_eigenvalues())?;
    let s = decomposition.S().column_vector();
    let u = decomposition.U();
    let mut order: Vec<usize> = (0..n).collect();
    let value = |k: usize| Complex::new(s[k].re, s[k].im);
    order.sort_by(|&i, &j| spectral_order(&value(i), &value(j)));
    let mut vectors = DMatrix::from_fn(n, n, |i, k| {
        let z = u[(i, order[k])];
        Complex::new(z.re, z.im)
    });
    if let Some(mirror) = mirror {
        vectors = mirror.map(|entry| Complex::new(entry, 0.0)) * vectors;
    }
    for mut column in vectors.column_iter_mut() {
        let length = column.norm();
        if !(length.is_finite() && length > 0.0) {
            return Err(no_eigenvalues());
        }
        column.unscale_mut(length);
        // The largest entry is made real and positive, so that the vector is unique.
        let largest = column
            .iter()
            .copied()
            .fold(C64::default(), |m, z| if z.norm() > m.norm() * (1.0 + 1e-9) { z } else { m });
        let turn = largest.conj() / largest.norm();
        column.iter_mut().for_each(|z| *z *= turn);
    }
    Ok((order.iter().map(|&k| value(k)).collect(), vectors))
}

/// Singular values, largest first.
pub fn singular_values(m: &DMatrix<f64>) -> Result<Vec<f64>, LinearError> {
    ensure_finite("a matrix", m)?;
    if m.is_empty() {
        return Ok(Vec::new());
    }
    let mut s = faer_view(m).singular_values().map_err(|_| no_svd())?;
    s.sort_by(|x, y| y.total_cmp(x));
    Ok(s)
}

/// Largest singular value of a complex matrix.
///
/// Found as the square root of the largest eigenvalue of the smaller Gram
/// matrix: enough for a norm, not for small singular values.
pub fn largest_singular_value(m: &DMatrix<C64>) -> f64 {
    if m.is_empty() {
        return 0.0;
    }
    let scale = m.iter().map(|z| z.norm()).fold(0.0, f64::max);
    if scale == 0.0 || !scale.is_finite() {
        return scale;
    }
    let m = m.unscale(scale);
    let gram = if m.nrows() <= m.ncols() { &m * m.adjoint() } else { m.adjoint() * &m };
    // A Hermitian matrix X + iY has the eigenvalues of the symmetric
    // [X −Y; Y X], each twice; its symmetric solver always ends.
    let k = gram.nrows();
    let real = DMatrix::from_fn(2 * k, 2 * k, |i, j| {
        let z = gram[(i % k, j % k)];
        match (i < k, j < k) {
            (true, false) => -z.im,
            (false, true) => z.im,
            _ => z.re,
        }
    });
    scale * real.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// Singular value decomposition U diag(s) Vᵀ with s largest first.
pub struct Svd {
    /// Left vectors as columns, all of them.
    pub u: DMatrix<f64>,
    /// Singular values, largest first.
    pub s: Vec<f64>,
    /// Right vectors as columns, all of them.
    pub v: DMatrix<f64>,
}

/// Full singular value decomposition.
pub fn svd(m: &DMatrix<f64>) -> Result<Svd, LinearError> {
    ensure_finite("a matrix", m)?;
    if m.is_empty() {
        return Ok(Svd {
            u: DMatrix::identity(m.nrows(), m.nrows()),
            s: Vec::new(),
            v: DMatrix::identity(m.ncols(), m.ncols()),
        });
    }
    let full = faer_view(m).svd().map_err(|_| no_svd())?;
    let copy = |x: faer::MatRef<'_, f64>| DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)]);
    Ok(Svd {
        u: copy(full.U()),
        s: full.S().column_vector().iter().copied().collect(),
        v: copy(full.V()),
    })
}

fn no_svd() -> LinearError {
    LinearError::NotConverged {
        what: "the singular value decomposition".into(),
        achieved: f64::NAN,
        wanted: f64::EPSILON,
        limit: "its iteration limit".into(),
    }
}

/// X with A X = B, refused if A is singular to working precision after its
/// rows and columns are scaled.
pub fn solve_checked(
    what: &str,
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinearError> {
    ensure_square(what, a)?;
    ensure_finite(what, a)?;
    ensure_finite("a right-hand side", b)?;
    let singular = || LinearError::Singular { what: what.to_owned() };
    let n = a.nrows();
    if n == 0 {
        return Ok(b.clone());
    }
    if reciprocal_condition(a)? < n as f64 * f64::EPSILON {
        return Err(singular());
    }
    let mut x = a.clone().full_piv_lu().solve(b).ok_or_else(singular)?;
    // One step of refinement recovers digits lost to bad scaling.
    let residual = b - a * &x;
    if let Some(step) = a.clone().full_piv_lu().solve(&residual) {
        x += step;
    }
    ensure_finite(what, &x).map_err(|_| singular())?;
    Ok(x)
}

/// Smallest over largest singular value after scaling rows and columns to like
/// size, so that the answer does not depend on units.
pub fn reciprocal_condition(a: &DMatrix<f64>) -> Result<f64, LinearError> {
    let s = singular_values(&equilibrate(a).0)?;
    Ok(match (s.first(), s.last()) {
        (Some(&largest), Some(&smallest)) if largest > 0.0 => smallest / largest,
        (None, None) => 1.0,
        _ => 0.0,
    })
}

/// R A S with rows and columns of like size by powers of two, and the
/// diagonals of R and S.
pub fn equilibrate(a: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>, DVector<f64>) {
    let mut m = a.clone();
    let mut rows = DVector::from_element(a.nrows(), 1.0);
    let mut columns = DVector::from_element(a.ncols(), 1.0);
    let power = |size: f64| {
        if size > 0.0 { (-0.5 * size.log2()).round().exp2() } else { 1.0 }
    };
    // Square-root steps on both sides settle within a few sweeps.
    for _ in 0..12 {
        for i in 0..m.nrows() {
            let f = power(m.row(i).amax());
            rows[i] *= f;
            m.row_mut(i).scale_mut(f);
        }
        for j in 0..m.ncols() {
            let f = power(m.column(j).amax());
            columns[j] *= f;
            m.column_mut(j).scale_mut(f);
        }
    }
    (m, rows, columns)
}

/// Complex Schur form A = U T Uᴴ of a real matrix that is already balanced.
pub fn complex_schur(balanced: &DMatrix<f64>) -> Result<(DMatrix<C64>, DMatrix<C64>), LinearError> {
    ensure_finite("a matrix", balanced)?;
    let n = balanced.nrows();
    let complex = balanced.map(|x| Complex::new(x, 0.0));
    if n == 0 {
        return Ok((complex.clone(), complex));
    }
    nalgebra::Schur::try_new(complex, f64::EPSILON, SCHUR_ITERATIONS_PER_ROW * n)
        .map(|s| s.unpack())
        .ok_or_else(no_eigenvalues)
}

/// X = Xᵀ with A X + X Aᵀ + Q = 0 for symmetric Q, by the complex Schur form
/// of A (Bartels and Stewart 1972) with one step of refinement.
///
/// # Errors
/// [`LinearError::Singular`] if two eigenvalues of A add up to zero.
pub fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, LinearError> {
    ensure_finite("the constant term of a Lyapunov equation", q)?;
    let (balanced, scale) = balance(a)?;
    let n = a.nrows();
    // With x = D z: Az Z + Z Azᵀ + D⁻¹ Q D⁻¹ = 0 and X = D Z D.
    let scaled = DMatrix::from_fn(n, n, |i, j| q[(i, j)] / (scale[i] * scale[j]));
    let (u, t) = complex_schur(&balanced)?;
    let mut z = lyapunov_triangular(&u, &t, &scaled)?;
    let residual = &balanced * &z + &z * balanced.transpose() + &scaled;
    z += lyapunov_triangular(&u, &t, &residual)?;
    let symmetric = (&z + z.transpose()) * 0.5;
    let x = DMatrix::from_fn(n, n, |i, j| symmetric[(i, j)] * scale[i] * scale[j]);
    ensure_finite("the solution of a Lyapunov equation", &x)?;
    Ok(x)
}

fn lyapunov_triangular(
    u: &DMatrix<C64>,
    t: &DMatrix<C64>,
    q: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinearError> {
    let n = t.nrows();
    let f = u.adjoint() * q.map(|x| Complex::new(x, 0.0)) * u;
    // T Y + Y Tᴴ = −F, column by column from the last.
    let size = t.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let mut y = DMatrix::<C64>::zeros(n, n);
    for j in (0..n).rev() {
        let mut rhs = -f.column(j).into_owned();
        for k in j + 1..n {
            let factor = t[(j, k)].conj();
            rhs -= y.column(k) * factor;
        }
        back_substitute(t, t[(j, j)].conj(), size, &mut rhs)?;
        y.set_column(j, &rhs);
    }
    Ok((u * y * u.adjoint()).map(|z| z.re))
}

/// Solves (T + shift I) x = b in place for upper triangular T of entry size `size`.
fn back_substitute(
    t: &DMatrix<C64>,
    shift: C64,
    size: f64,
    x: &mut DVector<C64>,
) -> Result<(), LinearError> {
    for i in (0..t.nrows()).rev() {
        let mut sum = x[i];
        for k in i + 1..t.nrows() {
            sum -= t[(i, k)] * x[k];
        }
        let pivot = t[(i, i)] + shift;
        if pivot.norm() <= f64::EPSILON * size {
            return Err(LinearError::Singular {
                what: "a Lyapunov or Sylvester equation (two eigenvalues cancel)".into(),
            });
        }
        x[i] = sum / pivot;
    }
    Ok(())
}

/// A real basis that splits a matrix into two invariant parts.
#[derive(Debug, Clone)]
pub struct Split {
    /// x = T z, with the chosen eigenvalues' subspace in the first columns.
    pub t: DMatrix<f64>,
    /// T⁻¹.
    pub t_inverse: DMatrix<f64>,
    /// Dimension of the first part.
    pub first: usize,
}

/// Splits the state space of A into the invariant subspace of the eigenvalues
/// that satisfy `chosen` and that of the others.
///
/// Ordered complex Schur form, then a Sylvester equation for the spectral
/// projector, then real orthonormal bases (in balanced coordinates) of both
/// ranges. `chosen` must give conjugates the same answer.
pub fn split(a: &DMatrix<f64>, chosen: impl Fn(C64) -> bool) -> Result<Split, LinearError> {
    let n = a.nrows();
    let (balanced, scale) = balance(a)?;
    let (mut u, mut t) = complex_schur(&balanced)?;
    // Bubble the chosen eigenvalues to the top by Givens rotations.
    let mut first = 0;
    for k in 0..n {
        if chosen(t[(k, k)]) {
            for i in (first..k).rev() {
                swap_schur(&mut u, &mut t, i);
            }
            first += 1;
        }
    }
    if first == 0 || first == n {
        // Nothing to split, but still into coordinates of like size.
        return Ok(Split {
            t: DMatrix::from_diagonal(&scale),
            t_inverse: DMatrix::from_diagonal(&scale.map(|d| 1.0 / d)),
            first,
        });
    }
    // T = [T1 T12; 0 T2]. The projector on the first subspace along the second
    // is U [I X; 0 0] Uᴴ with T1 X − X T2 = T12, solved column by column.
    let t1 = t.view((0, 0), (first, first)).into_owned();
    let size = t.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let mut x = DMatrix::<C64>::zeros(first, n - first);
    for j in 0..n - first {
        let mut rhs = t.view((0, first + j), (first, 1)).column(0).into_owned();
        for k in 0..j {
            let factor = t[(first + k, first + j)];
            rhs += x.column(k) * factor;
        }
        back_substitute(&t1, -t[(first + j, first + j)], size, &mut rhs)?;
        x.set_column(j, &rhs);
    }
    let mut compact = DMatrix::<C64>::zeros(n, n);
    for i in 0..first {
        compact[(i, i)] = Complex::new(1.0, 0.0);
    }
    compact.view_mut((0, first), (first, n - first)).copy_from(&x);
    let projector = (&u * compact * u.adjoint()).map(|z| z.re);
    let complement = DMatrix::identity(n, n) - &projector;
    let mut basis = DMatrix::zeros(n, n);
    basis.columns_mut(0, first).copy_from(&svd(&projector)?.u.columns(0, first));
    basis.columns_mut(first, n - first).copy_from(&svd(&complement)?.u.columns(0, n - first));
    let inverse =
        solve_checked("the basis of the spectral split", &basis, &DMatrix::identity(n, n))?;
    Ok(Split {
        t: DMatrix::from_fn(n, n, |i, j| scale[i] * basis[(i, j)]),
        t_inverse: DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / scale[j]),
        first,
    })
}

/// Exchanges the eigenvalues at k and k+1 of a complex Schur form.
fn swap_schur(u: &mut DMatrix<C64>, t: &mut DMatrix<C64>, k: usize) {
    let (p, q, r) = (t[(k, k)], t[(k + 1, k + 1)], t[(k, k + 1)]);
    // The unit eigenvector of [p r; 0 q] for q is (r, q − p), normalised.
    let length = (r.norm_sqr() + (q - p).norm_sqr()).sqrt();
    if length == 0.0 {
        return;
    }
    let (c, s) = (r / length, (q - p) / length);
    // New basis [x y] with x = (c, s), y = (−s̄, c̄).
    let mix = |m: &mut DMatrix<C64>, i: usize| {
        let (v, w) = (m[(i, k)], m[(i, k + 1)]);
        m[(i, k)] = v * c + w * s;
        m[(i, k + 1)] = -v * s.conj() + w * c.conj();
    };
    for i in 0..t.nrows() {
        mix(t, i);
        mix(u, i);
    }
    for j in 0..t.ncols() {
        let (v, w) = (t[(k, j)], t[(k + 1, j)]);
        t[(k, j)] = c.conj() * v + s.conj() * w;
        t[(k + 1, j)] = -s * v + c * w;
    }
    t[(k + 1, k)] = C64::default();
}

/// e^A, by scaling and squaring of a Padé approximant, balanced first.
pub fn exponential(a: &DMatrix<f64>) -> Result<DMatrix<f64>, LinearError> {
    let n = a.nrows();
    if n == 0 {
        return Ok(a.clone());
    }
    let (balanced, scale) = balance(a)?;
    let e = balanced.exp();
    let out = DMatrix::from_fn(n, n, |i, j| e[(i, j)] * scale[i] / scale[j]);
    ensure_finite("a matrix exponential", &out)?;
    Ok(out)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Reproducible numbers in −1…1 (xorshift).
    pub struct Numbers(pub u64);
    impl Numbers {
        pub fn next(&mut self) -> f64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        }
        pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
            DMatrix::from_fn(rows, columns, |_, _| self.next())
        }
    }

    #[test]
    fn eigenvectors_satisfy_their_equations() {
        let mut numbers = Numbers(7);
        for n in [1, 2, 5, 24] {
            let a = numbers.matrix(n, n);
            let e = eigen(&a).unwrap();
            let complex = a.map(|x| Complex::new(x, 0.0));
            for k in 0..n {
                let v = e.right.column(k);
                assert!((&complex * v - v * e.values[k]).norm() < 1e-12 * n as f64);
                let w = e.left[k].as_ref().unwrap();
                let row = w.adjoint();
                assert!((&row * &complex - &row * e.values[k]).norm() < 1e-11 * w.norm());
                for j in 0..n {
                    let product = (&row * e.right.column(j))[(0, 0)];
                    let expected = if j == k { 1.0 } else { 0.0 };
                    assert!((product - expected).norm() < 1e-10, "{n} {k} {j} {product}");
                }
            }
        }
    }

    /// A matrix seen in the mirror has its eigenvalues and its vectors.
    #[test]
    fn a_mirror_leaves_eigenvalues_and_vectors() {
        let mut numbers = Numbers(11);
        for n in [1, 2, 6, 24] {
            let a = numbers.matrix(n, n);
            let mirror = reflection(n);
            assert!((&mirror * &mirror - DMatrix::identity(n, n)).amax() < 1e-14);
            let (values, vectors) = sorted_vectors(&a, None).unwrap();
            let (same, seen) = sorted_vectors(&(&mirror * &a * &mirror), Some(&mirror)).unwrap();
            for k in 0..n {
                assert!((values[k] - same[k]).norm() < 1e-10 * (1.0 + values[k].norm()));
                let product = vectors.column(k).dotc(&seen.column(k)).norm();
                assert!((product - 1.0).abs() < 1e-9, "{n} {k} {product}");
            }
        }
    }

    #[test]
    fn eigenvalues_survive_bad_scaling() {
        // D⁻¹ A D with a spread of 1e10 has the eigenvalues of A.
        let mut numbers = Numbers(3);
        let a = numbers.matrix(6, 6);
        let scaled =
            DMatrix::from_fn(6, 6, |i, j| a[(i, j)] * 10f64.powi(2 * j as i32 - 2 * i as i32));
        let (plain, bad) = (eigenvalues(&a).unwrap(), eigenvalues(&scaled).unwrap());
        for (x, y) in plain.iter().zip(&bad) {
            assert!((x - y).norm() < 1e-12, "{x} {y}");
        }
    }

    #[test]
    fn nan_is_refused_not_iterated() {
        let mut a = DMatrix::identity(3, 3);
        a[(1, 2)] = f64::NAN;
        let error = eigenvalues(&a).unwrap_err().to_string();
        assert!(error.contains("row 2, column 3"), "{error}");
        assert!(svd(&a).is_err());
        assert!(lyapunov(&a, &DMatrix::identity(3, 3)).is_err());
    }

    #[test]
    fn a_jordan_block_has_no_left_vectors_and_says_so() {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2.0]);
        let e = eigen(&a).unwrap();
        assert!(e.left[0].is_none() && e.left[1].is_none());
        assert!(e.left[2].is_some());
    }

    #[test]
    fn lyapunov_residual_is_at_rounding_level() {
        let mut numbers = Numbers(99);
        for n in [1, 3, 10, 30] {
            let a = numbers.matrix(n, n) - DMatrix::identity(n, n) * (n as f64).sqrt();
            let g = numbers.matrix(n, 2);
            let q = &g * g.transpose();
            let x = lyapunov(&a, &q).unwrap();
            let residual = (&a * &x + &x * a.transpose() + &q).norm();
            assert!(residual < 1e-12 * (a.norm() * x.norm() + q.norm()), "{residual:e}");
        }
        // ẋ = −x + w with unit noise: variance 1/2.
        let one = DMatrix::from_element(1, 1, 1.0);
        assert_eq!(lyapunov(&-&one, &one).unwrap()[(0, 0)], 0.5);
    }

    #[test]
    fn split_gives_the_two_invariant_subspaces() {
        let mut numbers = Numbers(11);
        let a = numbers.matrix(12, 12);
        let s = split(&a, |z| z.re >= 0.0).unwrap();
        let unstable = eigenvalues(&a).unwrap().iter().filter(|z| z.re >= 0.0).count();
        assert_eq!(s.first, unstable);
        assert!((&s.t * &s.t_inverse - DMatrix::identity(12, 12)).norm() < 1e-11);
        let blocks = &s.t_inverse * &a * &s.t;
        let k = s.first;
        assert!(blocks.view((0, k), (k, 12 - k)).norm() < 1e-10);
        assert!(blocks.view((k, 0), (12 - k, k)).norm() < 1e-10);
        let first = eigenvalues(&blocks.view((0, 0), (k, k)).into_owned()).unwrap();
        assert!(first.iter().all(|z| z.re >= 0.0));
    }

    #[test]
    fn largest_singular_value_agrees_with_the_decomposition() {
        let mut numbers = Numbers(5);
        let m = numbers.matrix(5, 3);
        let complex = m.map(|x| Complex::new(0.0, x));
        let exact = singular_values(&m).unwrap()[0];
        assert!((largest_singular_value(&complex) - exact).abs() < 1e-13 * exact);
        assert!((largest_singular_value(&complex.transpose()) - exact).abs() < 1e-13 * exact);
    }
}
