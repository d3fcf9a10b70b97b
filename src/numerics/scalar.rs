//! Real numbers and forward-mode duals behind one trait.
//!
//! Physics is written once over [`Scalar`]. With `f64` it is evaluated; with
//! [`Dual`] it is evaluated together with `N` exact directional derivatives.
//!
//! Wide duals are dear: each product carries `N` tangents along. Where a piece
//! of physics has few inputs, [`Scalar::compose`] evaluates it over a dual just
//! wide enough for those inputs and applies the chain rule once on the way
//! out; where derivatives are known by hand, [`Scalar::chain`] applies them.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A function of `K` inputs and `M` outputs, written over any scalar.
pub trait Local<const K: usize, const M: usize> {
    /// Evaluates the function.
    fn evaluate<T: Scalar>(&self, input: &[T; K]) -> [T; M];
}

/// A real number, perhaps with tangents.
pub trait Scalar:
    Copy
    + Debug
    + Default
    + Send
    + Sync
    + 'static
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    /// Number of tangents carried; 0 for `f64`.
    const TANGENTS: usize;

    /// A constant: all tangents zero.
    fn constant(value: f64) -> Self;
    /// The number itself.
    fn value(self) -> f64;
    /// The derivative along direction `index`; zero where there is none.
    fn tangent(self, index: usize) -> f64;
    /// Square root; the derivative at zero is taken as zero.
    fn sqrt(self) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// Angle of the point (`x`, `self`), rad, in −π…π.
    fn atan2(self, x: Self) -> Self;
    /// Inverse sine, rad.
    fn asin(self) -> Self;
    /// `|x|`; the derivative at zero is taken as zero.
    fn abs(self) -> Self;
    /// `value` with derivative `Σ partials[k] · input[k]'`.
    fn chain<const K: usize>(value: f64, partials: &[f64; K], input: &[Self; K]) -> Self;
    /// `function(input)`, with the derivatives taken over a dual of width `K`.
    fn compose<const K: usize, const M: usize, F: Local<K, M>>(
        function: &F,
        input: &[Self; K],
    ) -> [Self; M];
}

impl Scalar for f64 {
    const TANGENTS: usize = 0;
    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn tangent(self, _index: usize) -> f64 {
        0.0
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    #[inline(always)]
    fn asin(self) -> Self {
        f64::asin(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn chain<const K: usize>(value: f64, _partials: &[f64; K], _input: &[Self; K]) -> Self {
        value
    }
    #[inline(always)]
    fn compose<const K: usize, const M: usize, F: Local<K, M>>(
        function: &F,
        input: &[Self; K],
    ) -> [Self; M] {
        function.evaluate(input)
    }
}

/// Tangents that one pass over a large model carries; systems with more unknowns
/// take several passes. All callers share one width, because the compiler makes
/// the whole model again for each.
pub const WIDTH: usize = 28;

/// A number and its derivatives along `N` directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<const N: usize> {
    /// The number.
    pub v: f64,
    /// Its derivatives.
    pub d: [f64; N],
}

impl<const N: usize> Default for Dual<N> {
    #[inline(always)]
    fn default() -> Self {
        Self { v: 0.0, d: [0.0; N] }
    }
}

impl<const N: usize> Dual<N> {
    /// The variable number `index`: its derivative along that direction is 1.
    #[inline(always)]
    pub fn variable(value: f64, index: usize) -> Self {
        let mut dual = Self { v: value, d: [0.0; N] };
        dual.d[index] = 1.0;
        dual
    }

    #[inline(always)]
    fn scaled(self, value: f64, factor: f64) -> Self {
        let mut d = self.d;
        for t in &mut d {
            *t *= factor;
        }
        Self { v: value, d }
    }

    // Indexed loops over arrays of known length become vector instructions;
    // the iterator forms of these two do not.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    fn combined(value: f64, a: &Self, wa: f64, b: &Self, wb: f64) -> Self {
        let mut d = [0.0; N];
        for k in 0..N {
            d[k] = wa * a.d[k] + wb * b.d[k];
        }
        Self { v: value, d }
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.scaled(-self.v, -1.0)
    }
}
impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}
impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}
impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::combined(self.v * other.v, &self, other.v, &other, self.v)
    }
}
impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let r = 1.0 / other.v;
        let q = self.v * r;
        Self::combined(q, &self, r, &other, -q * r)
    }
}
impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: f64) -> Self {
        self.v += other;
        self
    }
}
impl<const N: usize> Sub<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: f64) -> Self {
        self.v -= other;
        self
    }
}
impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self.scaled(self.v * other, other)
    }
}
impl<const N: usize> AddAssign for Dual<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.v += other.v;
        for k in 0..N {
            self.d[k] += other.d[k];
        }
    }
}
impl<const N: usize> SubAssign for Dual<N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        self.v -= other.v;
        for k in 0..N {
            self.d[k] -= other.d[k];
        }
    }
}

impl<const N: usize> Scalar for Dual<N> {
    const TANGENTS: usize = N;
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self { v: value, d: [0.0; N] }
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.v
    }
    #[inline(always)]
    fn tangent(self, index: usize) -> f64 {
        self.d[index]
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.v.sqrt();
        let slope = if root > 0.0 { 0.5 / root } else { 0.0 };
        self.scaled(root, slope)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.v.sin_cos();
        (self.scaled(s, c), self.scaled(c, -s))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let r2 = self.v * self.v + x.v * x.v;
        let inverse = if r2 > 0.0 { 1.0 / r2 } else { 0.0 };
        Self::combined(self.v.atan2(x.v), &self, x.v * inverse, &x, -self.v * inverse)
    }
    #[inline(always)]
    fn asin(self) -> Self {
        let c2 = 1.0 - self.v * self.v;
        let slope = if c2 > 0.0 { 1.0 / c2.sqrt() } else { 0.0 };
        self.scaled(self.v.asin(), slope)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let sign = if self.v > 0.0 {
            1.0
        } else if self.v < 0.0 {
            -1.0
        } else {
            0.0
        };
        self.scaled(self.v.abs(), sign)
    }
    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    fn chain<const K: usize>(value: f64, partials: &[f64; K], input: &[Self; K]) -> Self {
        let mut d = [0.0; N];
        for k in 0..K {
            let (weight, term) = (partials[k], &input[k]);
            for i in 0..N {
                d[i] += weight * term.d[i];
            }
        }
        Self { v: value, d }
    }
    #[inline(always)]
    fn compose<const K: usize, const M: usize, F: Local<K, M>>(
        function: &F,
        input: &[Self; K],
    ) -> [Self; M] {
        let mut local = [Dual::<K>::default(); K];
        for (k, variable) in local.iter_mut().enumerate() {
            *variable = Dual::<K>::variable(input[k].v, k);
        }
        let output = function.evaluate(&local);
        let mut result = [Self::default(); M];
        for (m, out) in output.iter().enumerate() {
            result[m] = Self::chain(out.v, &out.d, input);
        }
        result
    }
}

/// Largest ratio for which the series of the arc tangent is summed.
const SHALLOW: f64 = 0.25;

/// Angle of the point (`x`, `y`), rad, in −π…π, to rounding. Several times
/// faster than the library's function, above all where x is positive and y
/// small beside it, as for the flow that nearly every blade section meets.
#[inline(always)]
#[must_use]
pub fn arc_tangent(y: f64, x: f64) -> f64 {
    if is_shallow(y, x) { arc_tangent_series(y / x) } else { steep(y, x) }
}

/// [`arc_tangent`] of several points. One that is steep takes all of them out
/// of the fast path; the bits are the same.
#[inline(always)]
pub(crate) fn arc_tangents<const K: usize>(y: &[f64; K], x: &[f64; K]) -> [f64; K] {
    let mut steep = false;
    for k in 0..K {
        steep |= !is_shallow(y[k], x[k]);
    }
    if steep {
        std::array::from_fn(|k| arc_tangent(y[k], x[k]))
    } else {
        std::array::from_fn(|k| arc_tangent_series(y[k] / x[k]))
    }
}

#[inline(always)]
fn is_shallow(y: f64, x: f64) -> bool {
    (y.abs() <= SHALLOW * x) & (x > 0.0)
}

/// arctan t for |t| ≤ 1/4: the series to t²⁵, whose next term is below 1e-17.
#[inline(always)]
fn arc_tangent_series(t: f64) -> f64 {
    // (−1)^k/(2k + 1): dividing by each where it stands would cost more than
    // all the rest.
    const S: [f64; 13] = {
        let mut series = [0.0; 13];
        let mut k = 0;
        while k < 13 {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            series[k] = sign / (2 * k + 1) as f64;
            k += 1;
        }
        series
    };
    let y = t * t;
    let y2 = y * y;
    let y4 = y2 * y2;
    // Estrin's scheme: short chains of dependent products.
    let a = (S[0] + y * S[1]) + y2 * (S[2] + y * S[3]);
    let b = (S[4] + y * S[5]) + y2 * (S[6] + y * S[7]);
    let c = (S[8] + y * S[9]) + y2 * (S[10] + y * S[11]);
    t * (a + y4 * (b + y4 * (c + y4 * S[12])))
}

/// [`arc_tangent`] anywhere: the first octant by
/// arctan t = arctan c + arctan((t − c)/(1 + c t)), c one of 0, ½, 1.
fn steep(y: f64, x: f64) -> f64 {
    let (across, along) = (y.abs(), x.abs());
    let (small, large) = if across < along { (across, along) } else { (along, across) };
    // Zero, infinite and NaN too.
    if !(large > 1e-100 && large < 1e100) {
        return y.atan2(x);
    }
    const HALF: f64 = 0.463_647_609_000_806_1;
    let (c, known) = if small < 0.236 * large {
        (0.0, 0.0)
    } else if small < 0.72 * large {
        (0.5, HALF)
    } else {
        (1.0, std::f64::consts::FRAC_PI_4)
    };
    let mut angle = known + arc_tangent_series((small - c * large) / (large + c * small));
    if across >= along {
        angle = std::f64::consts::FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = std::f64::consts::PI - angle;
    }
    angle.copysign(y)
}

/// A vector of three components in a frame that the variable's name says.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3<S>(pub [S; 3]);

impl<S: Scalar> Vec3<S> {
    /// A constant vector.
    #[inline(always)]
    pub fn constant(v: [f64; 3]) -> Self {
        Self(v.map(S::constant))
    }
    /// The vector without its tangents.
    #[inline(always)]
    pub fn value(self) -> [f64; 3] {
        self.0.map(S::value)
    }
    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S {
        self.0[0] * other.0[0] + self.0[1] * other.0[1] + self.0[2] * other.0[2]
    }
    /// Vector product `self × other`.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
    /// Vector product with a constant, `self × other`.
    #[inline(always)]
    pub fn cross_constant(self, other: [f64; 3]) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
    /// Every component times a scalar.
    #[inline(always)]
    pub fn scale(self, factor: S) -> Self {
        Self(self.0.map(|c| c * factor))
    }
    /// `matrix · self` for a constant matrix of rows.
    #[inline(always)]
    pub fn rotated(self, matrix: &[[f64; 3]; 3]) -> Self {
        let [x, y, z] = self.0;
        Self([
            x * matrix[0][0] + y * matrix[0][1] + z * matrix[0][2],
            x * matrix[1][0] + y * matrix[1][1] + z * matrix[1][2],
            x * matrix[2][0] + y * matrix[2][1] + z * matrix[2][2],
        ])
    }
    /// `matrixᵀ · self` for a constant matrix of rows.
    #[inline(always)]
    pub fn rotated_back(self, matrix: &[[f64; 3]; 3]) -> Self {
        let [x, y, z] = self.0;
        Self([
            x * matrix[0][0] + y * matrix[1][0] + z * matrix[2][0],
            x * matrix[0][1] + y * matrix[1][1] + z * matrix[2][1],
            x * matrix[0][2] + y * matrix[1][2] + z * matrix[2][2],
        ])
    }
}

impl<S: Scalar> Add for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1], self.0[2] + other.0[2]])
    }
}
impl<S: Scalar> Sub for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1], self.0[2] - other.0[2]])
    }
}
impl<S: Scalar> Neg for Vec3<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|c| -c))
    }
}
impl<S: Scalar> AddAssign for Vec3<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        for k in 0..3 {
            self.0[k] += other.0[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn sample<T: Scalar>(x: T, y: T) -> T {
        let (s, c) = (x * y).sin_cos();
        (s + x / (y * y + 1.0)).atan2(c + 2.0) * (x * x + y * y).sqrt() - (x * 0.3).asin().abs()
    }

    /// Duals against an independent library of duals.
    #[test]
    fn derivatives_agree_with_another_library() {
        use num_dual::{DualNum, DualSVec64};
        for (x, y) in [(0.7, -1.3), (-2.1, 0.4), (1.9, 3.1)] {
            let ours = sample(Dual::<2>::variable(x, 0), Dual::<2>::variable(y, 1));
            let a = DualSVec64::<2>::new(
                x,
                num_dual::Derivative::some(nalgebra::SVector::<f64, 2>::new(1.0, 0.0)),
            );
            let b = DualSVec64::<2>::new(
                y,
                num_dual::Derivative::some(nalgebra::SVector::<f64, 2>::new(0.0, 1.0)),
            );
            let s = (a * b).sin() + a / (b * b + 1.0);
            let c = (a * b).cos() + 2.0;
            let theirs = (s / c).atan() * (a * a + b * b).sqrt() - (a * 0.3).asin() * a.re.signum();
            assert_relative_eq!(ours.v, theirs.re, max_relative = 1e-14);
            let eps = theirs.eps.unwrap_generic(nalgebra::Const::<2>, nalgebra::Const::<1>);
            assert_relative_eq!(ours.d[0], eps[0], max_relative = 1e-12);
            assert_relative_eq!(ours.d[1], eps[1], max_relative = 1e-12);
        }
    }

    /// The chain rule over a narrow dual equals carrying the wide one through.
    #[test]
    fn composition_equals_direct_evaluation() {
        struct F;
        impl Local<2, 2> for F {
            fn evaluate<T: Scalar>(&self, x: &[T; 2]) -> [T; 2] {
                [sample(x[0], x[1]), x[0] / x[1]]
            }
        }
        let a = Dual::<5> { v: 0.8, d: [1.0, -2.0, 0.5, 0.0, 3.0] };
        let b = Dual::<5> { v: -0.6, d: [0.2, 0.1, -4.0, 1.0, 0.0] };
        let composed = Dual::compose(&F, &[a, b]);
        let direct = F.evaluate(&[a, b]);
        for m in 0..2 {
            assert_eq!(composed[m].v, direct[m].v);
            for k in 0..5 {
                assert_relative_eq!(composed[m].d[k], direct[m].d[k], max_relative = 1e-13);
            }
        }
    }

    /// Our arc tangent against the library's, over all octants and sizes.
    #[test]
    fn arc_tangent_is_the_librarys_to_rounding() {
        for k in 0..20_000 {
            let angle = -3.2 + 3.2e-4 * f64::from(k);
            for size in [1e-9, 0.3, 7.0, 1e12] {
                let (y, x) = (size * angle.sin(), size * angle.cos());
                let (ours, theirs) = (arc_tangent(y, x), y.atan2(x));
                let error = (ours - theirs).abs();
                assert!(error <= 4.0 * f64::EPSILON * theirs.abs(), "{y} {x}: {ours} {theirs}");
            }
        }
        for y in [0.0, -0.0, 1.0, -2.0, f64::INFINITY] {
            for x in [0.0, -0.0, 3.0, -4.0, f64::NEG_INFINITY] {
                assert_relative_eq!(arc_tangent(y, x), f64::atan2(y, x), max_relative = 1e-15);
            }
        }
        assert!(arc_tangent(f64::NAN, 1.0).is_nan() && arc_tangent(1.0, f64::NAN).is_nan());
    }
}
