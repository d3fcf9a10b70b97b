//! Smooth interpolation in tables of one and two variables.
//!
//! * [`CubicHermite`]: one variable, C¹, never outside its data.
//! * [`Bicubic`]: several functions of two variables on one grid, found in
//!   constant time: C¹ and never outside their data, or C² splines.
//! * [`UniformTable`]: several functions of one variable, C¹ and of fourth
//!   order.
//!
//! The tables use cubic Hermite pieces. The slope at a node is that of the
//! parabola through it and its neighbours, which is exact for quadratics; it
//! is cut back only where it would make the curve leave the data (F. N.
//! Fritsch and R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J.
//! Numer. Anal. 17, 1980). The slopes of a spline are instead those that make
//! the curvature continuous (C. de Boor, A Practical Guide to Splines, 1978,
//! chapter IV).

use thiserror::Error;

/// Why a table cannot be interpolated.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// An axis has too few breakpoints.
    #[error("the {axis} axis has {found} breakpoints; it needs at least {needed}")]
    TooFewBreakpoints {
        /// Which axis.
        axis: &'static str,
        /// Breakpoints given.
        found: usize,
        /// Breakpoints needed.
        needed: usize,
    },
    /// An axis is not finite and strictly increasing.
    #[error(
        "the {axis} axis must be finite and strictly increasing; breakpoint {index} is {value}"
    )]
    NotIncreasing {
        /// Which axis.
        axis: &'static str,
        /// Index of the offending breakpoint, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The number of values is not that of the grid.
    #[error("a table has {found} values where its axes need {needed}")]
    WrongSize {
        /// Values given.
        found: usize,
        /// Product of the axis lengths.
        needed: usize,
    },
    /// A value is NaN or infinite.
    #[error("table value {index} is {value}; every value must be finite")]
    NotFinite {
        /// Index of the offending value, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A periodic axis does not span its period.
    #[error("the {axis} axis runs from {first} to {last}; it must span exactly {period}")]
    NotOnePeriod {
        /// Which axis.
        axis: &'static str,
        /// First breakpoint.
        first: f64,
        /// Last breakpoint.
        last: f64,
        /// Period asked for.
        period: f64,
    },
}

/// What the slope at the two ends of an axis is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// That of the parabola through the last three points.
    Parabolic,
    /// Zero, so that a constant beyond the ends joins smoothly.
    Flat,
    /// The last point is the first one again.
    Periodic,
}

/// Checks that `axis` is finite and strictly increasing with at least
/// `needed` breakpoints.
pub(crate) fn check_axis(name: &'static str, axis: &[f64], needed: usize) -> Result<(), GridError> {
    if axis.len() < needed {
        return Err(GridError::TooFewBreakpoints { axis: name, found: axis.len(), needed });
    }
    for (index, &value) in axis.iter().enumerate() {
        if !value.is_finite() || (index > 0 && value <= axis[index - 1]) {
            return Err(GridError::NotIncreasing { axis: name, index, value });
        }
    }
    Ok(())
}

fn check_values(values: &[f64], needed: usize) -> Result<(), GridError> {
    if values.len() != needed {
        return Err(GridError::WrongSize { found: values.len(), needed });
    }
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err(GridError::NotFinite { index, value: values[index] }),
    }
}

/// Slopes at the points (x, y) of the parabolas through neighbouring points.
///
/// `x` is strictly increasing with at least two points. With
/// [`Ends::Periodic`] the last value is taken to repeat the first.
pub fn parabolic_slopes(x: &[f64], y: &[f64], ends: Ends) -> Vec<f64> {
    let n = x.len();
    let width: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let secant: Vec<f64> = (0..n - 1).map(|i| (y[i + 1] - y[i]) / width[i]).collect();
    // The parabola's slope weighs the nearer secant more.
    let between = |left: usize, right: usize| {
        (width[right] * secant[left] + width[left] * secant[right]) / (width[left] + width[right])
    };
    let mut slopes = vec![0.0; n];
    for (i, slope) in slopes.iter_mut().enumerate().take(n - 1).skip(1) {
        *slope = between(i - 1, i);
    }
    match ends {
        Ends::Flat => {}
        Ends::Periodic => {
            slopes[0] = between(n - 2, 0);
            slopes[n - 1] = slopes[0];
        }
        Ends::Parabolic if n == 2 => slopes.fill(secant[0]),
        Ends::Parabolic => {
            slopes[0] = 2.0 * secant[0] - slopes[1];
            slopes[n - 1] = 2.0 * secant[n - 2] - slopes[n - 2];
        }
    }
    slopes
}

/// Slopes at the points (x, y) that give the cubic pieces through them a
/// continuous curvature. At ends that are not periodic the slopes are those
/// of [`parabolic_slopes`].
///
/// `x` is strictly increasing with at least two points. With
/// [`Ends::Periodic`] the last value is taken to repeat the first.
pub fn spline_slopes(x: &[f64], y: &[f64], ends: Ends) -> Vec<f64> {
    let mut slopes = parabolic_slopes(x, y, ends);
    let n = x.len();
    if n < 3 {
        return slopes;
    }
    let width = |i: usize| x[i + 1] - x[i];
    let secant = |i: usize| (y[i + 1] - y[i]) / width(i);
    // Equal curvature on both sides of node i, between cells `left` and
    // `right`: coefficients of the slopes before, at and after it, and the
    // right side. The matrix is strictly diagonally dominant, so that
    // elimination needs no pivots.
    let row = |left: usize, right: usize| {
        let (a, c) = (1.0 / width(left), 1.0 / width(right));
        ([a, 2.0 * (a + c), c], 3.0 * (a * secant(left) + c * secant(right)))
    };
    let rows: Vec<([f64; 3], f64)> = if ends == Ends::Periodic {
        // Node 0 last: the unknowns 1 … n − 2 are a chain, and close over 0.
        (1..n - 1).map(|i| row(i - 1, i)).chain([row(n - 2, 0)]).collect()
    } else {
        (1..n - 1).map(|i| row(i - 1, i)).collect()
    };
    // A chain with both neighbours given, for two right sides at once: the
    // data's, and what a unit slope at both ends adds.
    let chain = |ends: [[f64; 2]; 2]| -> Vec<[f64; 2]> {
        let m = n - 2;
        let (mut factor, mut value) = (vec![0.0; m], vec![[0.0; 2]; m]);
        for i in 0..m {
            let ([a, b, c], right) = rows[i];
            let mut d = [right, 0.0];
            if i == 0 {
                d = [0, 1].map(|k| d[k] - a * ends[0][k]);
            }
            if i == m - 1 {
                d = [0, 1].map(|k| d[k] - c * ends[1][k]);
            }
            let (before, sub) =
                if i == 0 { (0.0, [0.0; 2]) } else { (factor[i - 1], value[i - 1]) };
            let a = if i == 0 { 0.0 } else { a };
            let pivot = b - a * before;
            factor[i] = c / pivot;
            value[i] = [0, 1].map(|k| (d[k] - a * sub[k]) / pivot);
        }
        for i in (0..m - 1).rev() {
            let after = value[i + 1];
            for (v, next) in value[i].iter_mut().zip(after) {
                *v -= factor[i] * next;
            }
        }
        value
    };
    if ends == Ends::Periodic {
        // slope = particular + s₀ · unit, and the row of node 0 gives s₀.
        let value = chain([[0.0, 1.0]; 2]);
        let ([a, b, c], right) = rows[n - 2];
        let (before, after) = (value[n - 3], value[0]);
        let closing = (right - a * before[0] - c * after[0]) / (b + a * before[1] + c * after[1]);
        for (slope, v) in slopes[1..n - 1].iter_mut().zip(&value) {
            *slope = v[0] + closing * v[1];
        }
        slopes[0] = closing;
        slopes[n - 1] = closing;
    } else {
        let value = chain([[slopes[0], 0.0], [slopes[n - 1], 0.0]]);
        for (slope, v) in slopes[1..n - 1].iter_mut().zip(&value) {
            *slope = v[0];
        }
    }
    slopes
}

/// Cuts slopes back until no cubic piece leaves the range of its two points:
/// zero at a local extremum of the data, and elsewhere no more than three
/// times the smaller neighbouring secant (Fritsch and Carlson).
pub fn limit_slopes(x: &[f64], y: &[f64], ends: Ends, slopes: &mut [f64]) {
    let n = x.len();
    let secant = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    for (i, slope) in slopes.iter_mut().enumerate() {
        let (left, right) = match (i, ends) {
            (0, Ends::Periodic) => (secant(n - 2), secant(0)),
            (0, _) => (secant(0), secant(0)),
            _ if i == n - 1 && ends == Ends::Periodic => (secant(n - 2), secant(0)),
            _ if i == n - 1 => (secant(n - 2), secant(n - 2)),
            _ => (secant(i - 1), secant(i)),
        };
        *slope = if left * right <= 0.0 || *slope * left <= 0.0 {
            0.0
        } else {
            let bound = 3.0 * left.abs().min(right.abs());
            slope.clamp(-bound, bound)
        };
    }
}

/// Finds the cell of an axis that holds a value in constant time: a uniform
/// map over the axis gives the first candidate, and a fixed number of
/// comparisons (one, unless the spacing is very uneven) the cell. There is no
/// branch to guess wrong.
#[derive(Debug, Clone)]
struct CellIndex {
    breakpoints: Vec<f64>,
    /// Right edge of each cell; infinite for the last.
    right_edge: Vec<f64>,
    first_cell: Vec<u16>,
    /// Most cells that a bin's candidate can lie too far left.
    comparisons: u16,
    bins_per_unit: f64,
}

impl CellIndex {
    /// Most bins of the uniform map; a bin holds more than one breakpoint
    /// only on axes whose spacing varies by more than this.
    const MOST_BINS: f64 = 4096.0;

    fn new(breakpoints: Vec<f64>) -> Self {
        let first = breakpoints[0];
        let last_cell = breakpoints.len() - 2;
        let length = breakpoints[breakpoints.len() - 1] - first;
        let narrowest = breakpoints.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let bins = (length / narrowest).ceil().clamp(1.0, Self::MOST_BINS);
        let bins_per_unit = bins / length;
        let cell_at = |bin: f64| {
            let cell = breakpoints.partition_point(|&x| x <= first + bin / bins_per_unit);
            cell.saturating_sub(1).min(last_cell) as u16
        };
        // A hair to the left, so that rounding can never put the candidate
        // beyond the cell; and to the right for the last one that may be meant.
        let hair = 1e-6;
        let first_cell: Vec<u16> =
            (0..=bins as usize).map(|bin| cell_at(bin as f64 - hair)).collect();
        let comparisons = first_cell
            .iter()
            .enumerate()
            .map(|(bin, &cell)| cell_at(bin as f64 + 1.0 + hair) - cell)
            .max()
            .unwrap_or(0);
        let mut right_edge = breakpoints[1..].to_vec();
        right_edge[last_cell] = f64::INFINITY;
        Self { breakpoints, right_edge, first_cell, comparisons, bins_per_unit }
    }

    /// Cell of `value` and the distance from its left edge. `value` must lie
    /// within the axis; NaN comes back as a NaN distance.
    #[inline(always)]
    fn locate(&self, value: f64) -> (usize, f64) {
        let bin = ((value - self.breakpoints[0]) * self.bins_per_unit) as i32 as usize;
        let mut cell = self.first_cell[bin.min(self.first_cell.len() - 1)] as usize;
        for _ in 0..self.comparisons {
            cell += usize::from(value >= self.right_edge[cell]);
        }
        (cell, value - self.breakpoints[cell])
    }

    fn first(&self) -> f64 {
        self.breakpoints[0]
    }

    fn last(&self) -> f64 {
        self.breakpoints[self.breakpoints.len() - 1]
    }
}

/// Limits `value` to an axis, keeping NaN.
#[inline(always)]
fn clamp(value: f64, low: f64, high: f64) -> f64 {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// a + x p, function by function: one step of Horner's scheme. Written over
/// whole arrays, so that the compiler pairs the functions in vector registers.
#[inline(always)]
fn step<const C: usize>(x: f64, p: [f64; C], a: &[f64; C]) -> [f64; C] {
    let mut out = *a;
    for c in 0..C {
        out[c] += x * p[c];
    }
    out
}

/// A C¹ piecewise cubic through points, which never leaves the range of
/// neighbouring points; constant beyond the ends.
#[derive(Debug, Clone)]
pub struct CubicHermite {
    index: CellIndex,
    /// Power coefficients about the left edge of each cell.
    cells: Vec<[f64; 4]>,
}

impl CubicHermite {
    /// Interpolates the points (x, y), at least two.
    ///
    /// The curve is constant beyond the ends of `x`; with [`Ends::Flat`] that
    /// joins with a continuous slope.
    ///
    /// # Errors
    /// When the points are not finite, not as many, or `x` does not increase.
    pub fn new(x: &[f64], y: &[f64], ends: Ends) -> Result<Self, GridError> {
        check_axis("x", x, 2)?;
        check_values(y, x.len())?;
        let mut slopes = parabolic_slopes(x, y, ends);
        limit_slopes(x, y, ends, &mut slopes);
        let cells = (0..x.len() - 1)
            .map(|i| hermite_to_power(x[i + 1] - x[i], [y[i], y[i + 1], slopes[i], slopes[i + 1]]))
            .collect();
        Ok(Self { index: CellIndex::new(x.to_vec()), cells })
    }

    /// Value and derivative at `x`.
    #[inline]
    pub fn evaluate(&self, x: f64) -> (f64, f64) {
        let inside = clamp(x, self.index.first(), self.index.last());
        let (cell, d) = self.index.locate(inside);
        let c = &self.cells[cell];
        let value = c[0] + d * (c[1] + d * (c[2] + d * c[3]));
        let slope = c[1] + d * (2.0 * c[2] + 3.0 * d * c[3]);
        (value, if inside == x { slope } else { 0.0 * x })
    }
}

/// Power coefficients about the left edge of the cubic with end values and
/// end slopes `[f0, f1, d0, d1]` over a cell of width `h`.
fn hermite_to_power(h: f64, [f0, f1, d0, d1]: [f64; 4]) -> [f64; 4] {
    let secant = (f1 - f0) / h;
    [f0, d0, (3.0 * secant - 2.0 * d0 - d1) / h, (d0 + d1 - 2.0 * secant) / (h * h)]
}

/// Value and derivatives of one function at one node: f, ∂f/∂x, ∂f/∂y,
/// ∂²f/∂x∂y.
type NodeData = [f64; 4];

/// Functions f₁…f_C of (x, y) on one grid, each a bicubic surface: C¹ and
/// never outside the range of the four corners of a cell ([`Bicubic::new`]),
/// or C² ([`Bicubic::spline`]).
///
/// Beyond the ends of either axis the surfaces are constant; with
/// [`Ends::Flat`] they join with a continuous slope. Coefficients of the
/// functions lie interleaved, so that one lookup and one pass of memory serve
/// all of them.
#[derive(Debug, Clone)]
pub struct Bicubic<const C: usize> {
    x: CellIndex,
    y: CellIndex,
    /// Cells row by row in x; coefficient of dxᵖ dy^q at `[q][p]`.
    cells: Vec<[[[f64; C]; 4]; 4]>,
}

/// Values and partial derivatives of the C functions of a [`Bicubic`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BicubicValue<const C: usize> {
    /// f.
    pub value: [f64; C],
    /// ∂f/∂x.
    pub x: [f64; C],
    /// ∂f/∂y.
    pub y: [f64; C],
}

impl<const C: usize> Bicubic<C> {
    /// Interpolates `values[c][i * y.len() + j]` = f_c(x_i, y_j).
    ///
    /// `ends` is the end rule of the x axis and of the y axis. On a periodic
    /// axis the last values are taken to repeat the first.
    ///
    /// # Errors
    /// When an axis has fewer than two breakpoints (four if periodic), does
    /// not increase, or values are not finite or not as many as the grid.
    pub fn new(
        x: &[f64],
        y: &[f64],
        values: [&[f64]; C],
        ends: [Ends; 2],
    ) -> Result<Self, GridError> {
        Self::check(x, y, values, ends)?;
        let nodes = values.map(|f| node_data(x, y, f, ends));
        Ok(Self::from_nodes(x, y, |c, i, j| nodes[c][i * y.len() + j]))
    }

    fn check(x: &[f64], y: &[f64], values: [&[f64]; C], ends: [Ends; 2]) -> Result<(), GridError> {
        check_axis("x", x, if ends[0] == Ends::Periodic { 4 } else { 2 })?;
        check_axis("y", y, if ends[1] == Ends::Periodic { 4 } else { 2 })?;
        for function in values {
            check_values(function, x.len() * y.len())?;
        }
        Ok(())
    }

    /// Interpolates like [`Bicubic::new`] by surfaces with continuous second
    /// derivatives. They may leave the range of the data: see
    /// [`Bicubic::overshoot`].
    ///
    /// # Errors
    /// As [`Bicubic::new`].
    pub fn spline(
        x: &[f64],
        y: &[f64],
        values: [&[f64]; C],
        ends: [Ends; 2],
    ) -> Result<Self, GridError> {
        Self::check(x, y, values, ends)?;
        let (n, m) = (x.len(), y.len());
        let along_x = |f: &[f64]| {
            let mut out = vec![0.0; n * m];
            for j in 0..m {
                let line: Vec<f64> = (0..n).map(|i| f[i * m + j]).collect();
                for (i, slope) in spline_slopes(x, &line, ends[0]).into_iter().enumerate() {
                    out[i * m + j] = slope;
                }
            }
            out
        };
        let along_y = |f: &[f64]| -> Vec<f64> {
            f.chunks(m).flat_map(|line| spline_slopes(y, line, ends[1])).collect()
        };
        let nodes = values.map(|f| {
            let (fx, fy) = (along_x(f), along_y(f));
            // Splines along either axis commute.
            let fxy = along_y(&fx);
            (0..n * m).map(|k| [f[k], fx[k], fy[k], fxy[k]]).collect::<Vec<NodeData>>()
        });
        Ok(Self::from_nodes(x, y, |c, i, j| nodes[c][i * m + j]))
    }

    /// The C¹ surfaces with value, slopes and twist `node(c, i, j)` given at
    /// every node of the grid. The axes must have passed [`check_axis`].
    fn from_nodes(x: &[f64], y: &[f64], node: impl Fn(usize, usize, usize) -> NodeData) -> Self {
        let mut cells = Vec::with_capacity((x.len() - 1) * (y.len() - 1));
        for i in 0..x.len() - 1 {
            let h = x[i + 1] - x[i];
            for j in 0..y.len() - 1 {
                let k = y[j + 1] - y[j];
                let powers: [[[f64; 4]; 4]; C] = std::array::from_fn(|c| {
                    let corner = [
                        node(c, i, j),
                        node(c, i + 1, j),
                        node(c, i, j + 1),
                        node(c, i + 1, j + 1),
                    ];
                    // In x first: the powers of dx of f and of ∂f/∂y along
                    // both edges; then in y.
                    let [low, high] = [0, 2].map(|a| {
                        let (p, q) = (corner[a], corner[a + 1]);
                        (
                            hermite_to_power(h, [p[0], q[0], p[1], q[1]]),
                            hermite_to_power(h, [p[2], q[2], p[3], q[3]]),
                        )
                    });
                    std::array::from_fn(|p| {
                        hermite_to_power(k, [low.0[p], high.0[p], low.1[p], high.1[p]])
                    })
                });
                let cell: [[[f64; C]; 4]; 4] = std::array::from_fn(|q| {
                    std::array::from_fn(|p| std::array::from_fn(|c| powers[c][p][q]))
                });
                cells.push(cell);
            }
        }
        Self { x: CellIndex::new(x.to_vec()), y: CellIndex::new(y.to_vec()), cells }
    }

    /// Cell of (x, y), and distances from its corner.
    #[inline(always)]
    fn locate(&self, x: f64, y: f64) -> (&[[[f64; C]; 4]; 4], f64, f64) {
        let (i, dx) = self.x.locate(clamp(x, self.x.first(), self.x.last()));
        let (j, dy) = self.y.locate(clamp(y, self.y.first(), self.y.last()));
        (&self.cells[i * (self.y.breakpoints.len() - 1) + j], dx, dy)
    }

    /// Values at (x, y).
    #[inline(always)]
    pub fn value(&self, x: f64, y: f64) -> [f64; C] {
        let (cell, dx, dy) = self.locate(x, y);
        let row = |q: usize| {
            let [a0, a1, a2, a3] = &cell[q];
            step(dx, step(dx, step(dx, *a3, a2), a1), a0)
        };
        let [r0, r1, r2, r3] = [row(0), row(1), row(2), row(3)];
        step(dy, step(dy, step(dy, r3, &r2), &r1), &r0)
    }

    /// Values and partial derivatives at (x, y). The values have the bits of
    /// [`Bicubic::value`]. Outside an axis the derivatives are those at its
    /// end, which are zero with [`Ends::Flat`].
    #[inline]
    pub fn evaluate(&self, x: f64, y: f64) -> BicubicValue<C> {
        let (cell, dx, dy) = self.locate(x, y);
        // Horner's scheme, and its derivative carried along.
        let row = |q: usize| {
            let [a0, a1, a2, a3] = &cell[q];
            let p1 = step(dx, *a3, a2);
            let p2 = step(dx, p1, a1);
            (step(dx, p2, a0), step(dx, step(dx, *a3, &p1), &p2))
        };
        let [(r0, s0), (r1, s1), (r2, s2), (r3, s3)] = [row(0), row(1), row(2), row(3)];
        let p1 = step(dy, r3, &r2);
        let p2 = step(dy, p1, &r1);
        BicubicValue {
            value: step(dy, p2, &r0),
            x: step(dy, step(dy, step(dy, s3, &s2), &s1), &s0),
            y: step(dy, step(dy, r3, &p1), &p2),
        }
    }

    /// The surfaces of several one-function tables joined on the union of
    /// their grids. Each surface stays what it was: its own cells are only
    /// divided. Beyond its own axes a surface is constant.
    pub fn join(parts: [&Bicubic<1>; C]) -> Self {
        let union = |axis: fn(&Bicubic<1>) -> &CellIndex| {
            let mut all: Vec<f64> =
                parts.iter().flat_map(|p| axis(p).breakpoints.iter().copied()).collect();
            all.sort_by(f64::total_cmp);
            // Breakpoints that differ by rounding only are one.
            let length = all[all.len() - 1] - all[0];
            all.dedup_by(|b, a| *b - *a <= 1e-9 * length);
            all
        };
        let (x, y) = (union(|p| &p.x), union(|p| &p.y));
        Self::from_nodes(&x, &y, |c, i, j| {
            let part = parts[c];
            let beyond = |v: f64, axis: &CellIndex| v < axis.first() || v > axis.last();
            let v = part.evaluate(x[i], y[j]);
            let flat_x = beyond(x[i], &part.x);
            let flat_y = beyond(y[j], &part.y);
            [
                v.value[0],
                if flat_x { 0.0 } else { v.x[0] },
                if flat_y { 0.0 } else { v.y[0] },
                if flat_x || flat_y { 0.0 } else { part.twist(x[i], y[j]) },
            ]
        })
    }
}

impl Bicubic<1> {
    /// How far the surface leaves its data: the largest excess over the range
    /// of a cell's corners, relative to the range of the nodes in and around
    /// the cell or, where the data are nearly constant, a hundredth of the
    /// range of all data. Found on a grid of 5 × 5 points a cell.
    pub fn overshoot(&self) -> f64 {
        let (rows, columns) = (self.x.breakpoints.len() - 1, self.y.breakpoints.len() - 1);
        let corner = |i: usize, j: usize| {
            self.value(self.x.breakpoints[i.min(rows)], self.y.breakpoints[j.min(columns)])[0]
        };
        let range = |i: std::ops::RangeInclusive<usize>, j: std::ops::RangeInclusive<usize>| {
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for row in i {
                for column in j.clone() {
                    let v = corner(row, column);
                    range = [range[0].min(v), range[1].max(v)];
                }
            }
            range
        };
        let [bottom, top] = range(0..=rows, 0..=columns);
        let floor = (0.01 * (top - bottom)).max(f64::MIN_POSITIVE);
        let mut worst = 0.0_f64;
        for i in 0..rows {
            for j in 0..columns {
                let [low, high] = range(i..=i + 1, j..=j + 1);
                let [least, most] = range(i.saturating_sub(1)..=i + 2, j.saturating_sub(1)..=j + 2);
                let x = [self.x.breakpoints[i], self.x.breakpoints[i + 1]];
                let y = [self.y.breakpoints[j], self.y.breakpoints[j + 1]];
                for k in 0..Self::PROBES * Self::PROBES {
                    let at = |edge: [f64; 2], k: usize| {
                        edge[0] + (edge[1] - edge[0]) * (k as f64 + 0.5) / Self::PROBES as f64
                    };
                    let [v] = self.value(at(x, k / Self::PROBES), at(y, k % Self::PROBES));
                    let excess = (v - high).max(low - v);
                    if excess > 0.0 {
                        worst = worst.max(excess / (most - least).max(floor));
                    }
                }
            }
        }
        worst
    }

    /// Probes a side of a cell.
    const PROBES: usize = 5;

    /// Whether the surface is above zero at every probe.
    pub fn is_positive(&self) -> bool {
        let probes = |axis: &[f64]| -> Vec<f64> {
            axis.windows(2)
                .flat_map(|w| {
                    (0..Self::PROBES)
                        .map(|k| w[0] + (w[1] - w[0]) * (k as f64 + 0.5) / Self::PROBES as f64)
                        .collect::<Vec<f64>>()
                })
                .chain(axis.iter().copied())
                .collect()
        };
        let y = probes(&self.y.breakpoints);
        probes(&self.x.breakpoints).iter().all(|&x| y.iter().all(|&y| self.value(x, y)[0] > 0.0))
    }

    /// ∂²f/∂x∂y.
    fn twist(&self, x: f64, y: f64) -> f64 {
        let (cell, dx, dy) = self.locate(x, y);
        let row_x = |q: usize| {
            let a = &cell[q];
            a[1][0] + dx * (2.0 * a[2][0] + 3.0 * dx * a[3][0])
        };
        row_x(1) + dy * (2.0 * row_x(2) + 3.0 * dy * row_x(3))
    }
}

/// Slopes and twists of a surface through a grid that keep each bicubic cell
/// within the range of its corners.
///
/// A bicubic cell lies in the hull of its sixteen Bézier points. The slope
/// limits along both families of grid lines keep the twelve on its edges in
/// range; the twist at a node is clipped so that the four inner points beside
/// it are, and where no twist does that for all four cells the slopes at that
/// node are cut as well.
fn node_data(x: &[f64], y: &[f64], f: &[f64], ends: [Ends; 2]) -> Vec<NodeData> {
    let (n, m) = (x.len(), y.len());
    let at = |i: usize, j: usize| i * m + j;
    let along_x = |data: &[f64], limited: bool| {
        let mut out = vec![0.0; n * m];
        for j in 0..m {
            let line: Vec<f64> = (0..n).map(|i| data[at(i, j)]).collect();
            let mut slopes = parabolic_slopes(x, &line, ends[0]);
            if limited {
                limit_slopes(x, &line, ends[0], &mut slopes);
            }
            for i in 0..n {
                out[at(i, j)] = slopes[i];
            }
        }
        out
    };
    let along_y = |data: &[f64], limited: bool| {
        let mut out = vec![0.0; n * m];
        for i in 0..n {
            let line = &data[at(i, 0)..at(i, 0) + m];
            let mut slopes = parabolic_slopes(y, line, ends[1]);
            if limited {
                limit_slopes(y, line, ends[1], &mut slopes);
            }
            out[at(i, 0)..at(i, 0) + m].copy_from_slice(&slopes);
        }
        out
    };
    let (fx, fy) = (along_x(f, true), along_y(f, true));
    let (fxy, fyx) = (along_y(&fx, false), along_x(&fy, false));

    // Neighbour of index i one step along an axis of `len` nodes.
    let step = |i: usize, forward: bool, len: usize, ends: Ends| -> Option<usize> {
        match (forward, ends) {
            (true, _) if i + 1 < len => Some(i + 1),
            (true, Ends::Periodic) => Some(1),
            (false, _) if i > 0 => Some(i - 1),
            (false, Ends::Periodic) => Some(len - 2),
            _ => None,
        }
    };
    let gap = |axis: &[f64], i: usize, forward: bool| {
        let last = axis.len() - 1;
        match forward {
            true if i < last => axis[i + 1] - axis[i],
            true => axis[1] - axis[0],
            false if i > 0 => axis[i - 1] - axis[i],
            false => axis[last - 1] - axis[last],
        }
    };
    let mut nodes = Vec::with_capacity(n * m);
    for i in 0..n {
        for j in 0..m {
            let here = f[at(i, j)];
            let mut twist = 0.5 * (fxy[at(i, j)] + fyx[at(i, j)]);
            let flat_end = (ends[0] == Ends::Flat && (i == 0 || i == n - 1))
                || (ends[1] == Ends::Flat && (j == 0 || j == m - 1));
            if flat_end {
                // The slope across the end is zero all along it.
                twist = 0.0;
            }
            let (mut slope_x, mut slope_y) = (fx[at(i, j)], fy[at(i, j)]);
            for attempt in 0..40 {
                if attempt == 39 {
                    (slope_x, slope_y) = (0.0, 0.0);
                }
                let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
                for forward_x in [false, true] {
                    for forward_y in [false, true] {
                        let (Some(i2), Some(j2)) =
                            (step(i, forward_x, n, ends[0]), step(j, forward_y, m, ends[1]))
                        else {
                            continue;
                        };
                        let corners = [here, f[at(i2, j)], f[at(i, j2)], f[at(i2, j2)]];
                        let least = corners.iter().copied().fold(f64::INFINITY, f64::min);
                        let most = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                        let (h, k) = (gap(x, i, forward_x) / 3.0, gap(y, j, forward_y) / 3.0);
                        let without = here + h * slope_x + k * slope_y;
                        let bounds = [(least - without) / (h * k), (most - without) / (h * k)];
                        low = low.max(bounds[0].min(bounds[1]));
                        high = high.min(bounds[0].max(bounds[1]));
                    }
                }
                if low <= high {
                    twist = twist.clamp(low, high);
                    break;
                }
                slope_x *= 0.8;
                slope_y *= 0.8;
            }
            nodes.push([here, slope_x, slope_y, twist]);
        }
    }
    nodes
}

/// Functions f₁…f_C of one variable on an equally spaced grid: C¹ cubic
/// pieces with slopes from five-point differences, of fourth order.
#[derive(Debug, Clone)]
pub struct UniformTable<const C: usize> {
    low: f64,
    per_step: f64,
    /// Power coefficients in the fraction of each cell.
    cells: Vec<[[f64; C]; 4]>,
}

impl<const C: usize> UniformTable<C> {
    /// Tabulates `f` at `cells + 1` points on [low, high].
    ///
    /// # Errors
    /// With fewer than four cells, an empty interval, or a value that is not
    /// finite.
    pub fn fit(
        low: f64,
        high: f64,
        cells: usize,
        mut f: impl FnMut(f64) -> [f64; C],
    ) -> Result<Self, GridError> {
        check_axis("x", &[low, high], 2)?;
        if cells < 4 {
            return Err(GridError::TooFewBreakpoints { axis: "x", found: cells + 1, needed: 5 });
        }
        let values: Vec<[f64; C]> =
            (0..=cells).map(|i| f(low + (high - low) * i as f64 / cells as f64)).collect();
        check_values(values.as_flattened(), (cells + 1) * C)?;
        // Five-point difference formulas, by place in the stencil.
        const STENCIL: [[f64; 5]; 5] = [
            [-25.0, 48.0, -36.0, 16.0, -3.0],
            [-3.0, -10.0, 18.0, -6.0, 1.0],
            [1.0, -8.0, 0.0, 8.0, -1.0],
            [-1.0, 6.0, -18.0, 10.0, 3.0],
            [3.0, -16.0, 36.0, -48.0, 25.0],
        ];
        let slope = |i: usize, c: usize| {
            let first = i.saturating_sub(2).min(cells - 4);
            (0..5).map(|k| STENCIL[i - first][k] * values[first + k][c]).sum::<f64>() / 12.0
        };
        let pieces = (0..cells)
            .map(|i| {
                let mut piece = [[0.0; C]; 4];
                for c in 0..C {
                    let ends = [values[i][c], values[i + 1][c], slope(i, c), slope(i + 1, c)];
                    for (p, a) in hermite_to_power(1.0, ends).into_iter().enumerate() {
                        piece[p][c] = a;
                    }
                }
                piece
            })
            .collect();
        Ok(Self { low, per_step: cells as f64 / (high - low), cells: pieces })
    }

    /// Values and derivatives at `x`. Beyond the interval the end pieces go
    /// on.
    #[inline]
    pub fn evaluate(&self, x: f64) -> ([f64; C], [f64; C]) {
        let at = (x - self.low) * self.per_step;
        let cell = (at.max(0.0) as usize).min(self.cells.len() - 1);
        let (d, a) = (at - cell as f64, &self.cells[cell]);
        (
            std::array::from_fn(|c| a[0][c] + d * (a[1][c] + d * (a[2][c] + d * a[3][c]))),
            std::array::from_fn(|c| {
                self.per_step * (a[1][c] + d * (2.0 * a[2][c] + d * (3.0 * a[3][c])))
            }),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn parabolas_are_reproduced_on_uneven_points() {
        let x = [-2.0, -0.5, 0.1, 1.0, 3.0];
        let y = x.map(|x: f64| 3.0 * x * x - x + 2.0);
        let slopes = parabolic_slopes(&x, &y, Ends::Parabolic);
        for i in 0..x.len() {
            assert!((slopes[i] - (6.0 * x[i] - 1.0)).abs() < 1e-13);
        }
    }

    #[test]
    fn a_monotone_parabola_needs_no_limit() {
        let x = [1.0, 1.5, 2.5, 3.0, 4.0];
        let y = x.map(|x: f64| x * x);
        let curve = CubicHermite::new(&x, &y, Ends::Parabolic).unwrap();
        for k in 0..=300 {
            let at = 1.0 + 0.01 * k as f64;
            let (value, slope) = curve.evaluate(at);
            assert!((value - at * at).abs() < 1e-13);
            assert!((slope - 2.0 * at).abs() < 1e-12);
        }
    }

    #[test]
    fn periodic_slopes_agree_at_both_ends() {
        let n = 12;
        let x: Vec<f64> = (0..=n).map(|i| i as f64 * 0.3).collect();
        let y: Vec<f64> =
            (0..=n).map(|i| (i as f64 / n as f64 * std::f64::consts::TAU).sin()).collect();
        let slopes = parabolic_slopes(&x, &y, Ends::Periodic);
        assert_eq!(slopes[0], slopes[n]);
        // Central differences of a sine: 2π/L sin(δ)/δ with δ the step's angle.
        let delta = std::f64::consts::TAU / n as f64;
        assert!((slopes[0] - delta.sin() / 0.3).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn a_curve_stays_between_neighbouring_points(
            steps in prop::collection::vec((0.01f64..3.0, -5.0f64..5.0), 3..12),
        ) {
            let mut x = 0.0;
            let (xs, ys): (Vec<f64>, Vec<f64>) = steps
                .iter()
                .map(|(dx, y)| { x += dx; (x, *y) })
                .unzip();
            let curve = CubicHermite::new(&xs, &ys, Ends::Parabolic).unwrap();
            for i in 0..xs.len() - 1 {
                let (low, high) = (ys[i].min(ys[i + 1]), ys[i].max(ys[i + 1]));
                for k in 0..=20 {
                    let at = xs[i] + (xs[i + 1] - xs[i]) * k as f64 / 20.0;
                    let (value, _) = curve.evaluate(at);
                    prop_assert!(value >= low - 1e-12 && value <= high + 1e-12);
                }
                prop_assert_eq!(curve.evaluate(xs[i]).0, ys[i]);
            }
        }

        #[test]
        fn a_surface_stays_between_the_corners_of_its_cell(
            values in prop::collection::vec(-5.0f64..5.0, 35),
            widths in prop::collection::vec(0.05f64..3.0, 12),
            periodic in any::<bool>(),
        ) {
            let axis = |widths: &[f64]| {
                let mut at = -1.0;
                let mut out = vec![at];
                for w in widths { at += w; out.push(at); }
                out
            };
            let (x, y) = (axis(&widths[..6]), axis(&widths[6..10]));
            let mut values = values;
            if periodic {
                for j in 0..5 { values[30 + j] = values[j]; }
            }
            let ends = [if periodic { Ends::Periodic } else { Ends::Parabolic }, Ends::Flat];
            let surface = Bicubic::new(&x, &y, [&values[..]], ends).unwrap();
            for i in 0..6 {
                for j in 0..4 {
                    let corners = [
                        values[i * 5 + j], values[i * 5 + j + 1],
                        values[i * 5 + j + 5], values[i * 5 + j + 6],
                    ];
                    let low = corners.iter().copied().fold(f64::INFINITY, f64::min);
                    let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    prop_assert_eq!(surface.value(x[i], y[j])[0], corners[0]);
                    for k in 0..49 {
                        let (s, t) = ((k / 7) as f64 / 7.0, (k % 7) as f64 / 7.0);
                        let v = surface.value(
                            x[i] + s * (x[i + 1] - x[i]),
                            y[j] + t * (y[j + 1] - y[j]),
                        )[0];
                        prop_assert!(v >= low - 1e-10 && v <= high + 1e-10, "{v} outside {low}..{high}");
                    }
                }
            }
        }

        #[test]
        fn joined_tables_are_the_tables_they_were(
            a in prop::collection::vec(-5.0f64..5.0, 20),
            b in prop::collection::vec(-5.0f64..5.0, 12),
            at in prop::collection::vec((-1.0f64..4.0, -1.0f64..3.0), 20),
        ) {
            let ends = [Ends::Flat, Ends::Flat];
            let one = Bicubic::new(&[0.0, 0.7, 1.0, 2.0, 3.0], &[0.0, 0.5, 1.0, 2.0], [&a[..]], ends).unwrap();
            let two = Bicubic::new(&[0.0, 0.9, 2.5, 3.0], &[0.2, 0.5, 1.5], [&b[..]], ends).unwrap();
            let both = Bicubic::join([&one, &two]);
            for (x, y) in at {
                let (p, q, r) = (one.evaluate(x, y), two.evaluate(x, y), both.evaluate(x, y));
                prop_assert!((p.value[0] - r.value[0]).abs() < 1e-11);
                prop_assert!((q.value[0] - r.value[1]).abs() < 1e-11);
                prop_assert!((p.x[0] - r.x[0]).abs() < 1e-9);
                prop_assert!((q.y[0] - r.y[1]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_smooth_surface_converges_with_the_cube_of_the_spacing() {
        let error = |n: usize| {
            let axis: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
            let f = |x: f64, y: f64| (1.3 * x).exp() * (2.0 + y).ln();
            let values: Vec<f64> =
                axis.iter().flat_map(|&x| axis.iter().map(move |&y| f(x, y))).collect();
            let ends = [Ends::Parabolic, Ends::Parabolic];
            let surface = Bicubic::new(&axis, &axis, [&values[..]], ends).unwrap();
            let mut worst: f64 = 0.0;
            for k in 0..400 {
                let (x, y) = ((k / 20) as f64 / 19.3, (k % 20) as f64 / 19.3);
                worst = worst.max((surface.value(x, y)[0] - f(x, y)).abs());
            }
            worst
        };
        let (coarse, fine) = (error(10), error(40));
        assert!(coarse / fine > 40.0, "{coarse} {fine}");
    }

    #[test]
    fn a_uniform_table_is_of_fourth_order_and_exact_for_quartic_slopes() {
        let error = |cells: usize| {
            let table =
                UniformTable::fit(-1.0, 2.0, cells, |x| [(2.0 * x).sin(), x * x * x]).unwrap();
            let mut worst: f64 = 0.0;
            for k in 0..=300 {
                let x = -1.0 + 0.01 * k as f64;
                let (value, slope) = table.evaluate(x);
                worst = worst.max((value[0] - (2.0 * x).sin()).abs());
                assert!((value[1] - x.powi(3)).abs() < 1e-12);
                assert!((slope[1] - 3.0 * x * x).abs() < 1e-11);
            }
            worst
        };
        let ratio = error(32) / error(64);
        assert!(ratio > 12.0 && ratio < 20.0, "{ratio}");
    }

    #[test]
    fn bad_grids_are_refused_with_their_place() {
        let error = CubicHermite::new(&[0.0, 1.0, 1.0], &[0.0; 3], Ends::Flat).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the x axis must be finite and strictly increasing; breakpoint 2 is 1"
        );
        let error = CubicHermite::new(&[0.0, 1.0], &[0.0, f64::NAN], Ends::Flat).unwrap_err();
        assert_eq!(error.to_string(), "table value 1 is NaN; every value must be finite");
        let ends = [Ends::Flat; 2];
        let error = Bicubic::new(&[0.0, 1.0], &[0.0], [&[0.0; 2][..]], ends).unwrap_err();
        assert_eq!(error.to_string(), "the y axis has 1 breakpoints; it needs at least 2");
    }

    #[test]
    fn nan_comes_through() {
        let curve = CubicHermite::new(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0], Ends::Flat).unwrap();
        assert!(curve.evaluate(f64::NAN).0.is_nan());
    }

    /// Slopes of cubics are exact with any spacing once the end slopes are,
    /// and a periodic spline's are those of the long row of its copies.
    #[test]
    fn spline_slopes_are_those_of_the_smoothest_curve() {
        let x = [0.0_f64, 0.4, 1.1, 1.5, 2.7, 3.0];
        let y: Vec<f64> = x.iter().map(|t| (2.0 * t).sin()).collect();
        let slopes = spline_slopes(&x, &y, Ends::Flat);
        // Equal curvature from both sides at every inner node.
        let curvature = |i: usize, at_left: bool| {
            let h = x[i + 1] - x[i];
            let secant = (y[i + 1] - y[i]) / h;
            if at_left {
                (6.0 * secant - 4.0 * slopes[i] - 2.0 * slopes[i + 1]) / h
            } else {
                (2.0 * slopes[i] + 4.0 * slopes[i + 1] - 6.0 * secant) / h
            }
        };
        for i in 1..x.len() - 1 {
            assert!((curvature(i - 1, false) - curvature(i, true)).abs() < 1e-12);
        }
        assert_eq!((slopes[0], slopes[5]), (0.0, 0.0));

        let y = [1.0, -0.5, 0.3, 2.0, 0.7, 1.0];
        let once = spline_slopes(&x, &y, Ends::Periodic);
        let copies = 9;
        let (mut long_x, mut long_y) = (Vec::new(), Vec::new());
        for copy in 0..copies {
            for k in 0..5 {
                long_x.push(3.0 * f64::from(copy) + x[k]);
                long_y.push(y[k]);
            }
        }
        long_x.push(3.0 * f64::from(copies));
        long_y.push(1.0);
        let long = spline_slopes(&long_x, &long_y, Ends::Parabolic);
        // The influence of the ends falls by about four a node.
        for k in 0..6 {
            assert!((once[k] - long[20 + k]).abs() < 1e-10, "{k}");
        }
    }

    #[test]
    fn a_spline_surface_has_continuous_curvature_and_says_when_it_rings() {
        let x = [0.0_f64, 0.7, 1.0, 1.6, 2.4, 3.0];
        let y = [0.0_f64, 0.5, 0.8, 1.4, 2.0];
        let mut values: Vec<f64> =
            x.iter().flat_map(|&x| y.iter().map(move |&y| (x * y).cos() + 2.0)).collect();
        let ends = [Ends::Parabolic, Ends::Flat];
        let surface = Bicubic::spline(&x, &y, [&values[..]], ends).unwrap();
        let h = 1e-7;
        for &node in &x[1..5] {
            for at in [0.2, 0.8, 1.7] {
                let slope = |x: f64| surface.evaluate(x, at).x[0];
                let (left, right) =
                    ((slope(node) - slope(node - h)) / h, (slope(node + h) - slope(node)) / h);
                // Third derivatives are below 30, differences good to 1e-8.
                assert!((left - right).abs() < 1e-5, "{left} {right}");
            }
        }
        for &node in &y[1..4] {
            for at in [0.2, 1.2, 2.7] {
                let slope = |y: f64| surface.evaluate(at, y).y[0];
                let (left, right) =
                    ((slope(node) - slope(node - h)) / h, (slope(node + h) - slope(node)) / h);
                assert!((left - right).abs() < 1e-5, "{left} {right}");
            }
        }
        assert!(surface.overshoot() < 0.1 && surface.is_positive());
        // One wrong entry.
        values[12] = -20.0;
        let wrong = Bicubic::spline(&x, &y, [&values[..]], ends).unwrap();
        assert!(wrong.overshoot() > 0.1, "{}", wrong.overshoot());
        assert!(!wrong.is_positive());
    }
}
