//! Rotor-on-rotor interference by skewed vortex cylinders.
//!
//! The wake of a rotor is a semi-infinite cylinder of vortex rings that
//! leaves the rim and runs downstream at the skew angle χ from the shaft
//! (0 in hover, 90° edgewise). The circulation varies around the rim as
//! Γ₀ + Γ₁c cos ψ + Γ₁s sin ψ. [`Interference`] maps these three to the
//! inflow λ₀ + λ₁c r cos ψ + λ₁s r sin ψ that the wake induces over another
//! rotor's disk (the matrix G of CMTSVT); [`PointWash`] gives the induced
//! flow at a point.
//!
//! # Frames
//! The source's hub axes: x forward, y right, z down along the shaft.
//! Azimuth is zero aft, so a blade points to (−cos ψ, sin ψ, 0). A rotor that
//! turns clockwise seen from above has its *own* axes with y reversed, in
//! which it turns counter-clockwise. Circulation, skew and inflow are in
//! rotors' own axes; the geometry is given in axes that are not reversed.
//!
//! # Skew
//! Skew enters as the vector **X** = tan(χ/2) × (unit vector downstream, in
//! the plane of the hub), |**X**| ≤ 1: zero in hover, so that nothing is
//! singular there. In forward flight the wake goes aft: **X** = (−tan(χ/2), 0).
//!
//! # Theory
//! Lengths in source radii; in wind axes x points downstream, y sideways, z
//! up; c, s are the cosine and sine of the rim azimuth. The law of Biot and
//! Savart integrated along the wake gives the flow down the shaft
//!
//! ```text
//! w = 1/(4π) ∮ K Γ dψ_v,   K = (A + ρ c sin χ) / (ρ (ρ + b)),
//! A = 1 − x c − y s,   b = (c − x) sin χ + z cos χ,
//! ρ² = 1 + x² + y² + z² − 2 (x c + y s).
//! ```
//!
//! G takes the disk average of w in its first row and 4 times the averages
//! of w r cos ψ and w r sin ψ in the others. The ring elements of unequal
//! strength are not joined by trailing vortices, and only the flow along the
//! source's shaft is modelled: for a receiver tilted against it, its
//! component along the receiver's shaft is used.
//!
//! Above the source w is smooth. Below it the sheet itself passes through the
//! receiver and w jumps. There w is the flow of the cylinder infinite both
//! ways, less that of its upper half. The upper half is the wake of a
//! receiver above with **X** reversed, and smooth. The infinite cylinder has
//! a closed form: with p = x cos χ + z sin χ + i y, α = (1 + cos χ)/2,
//! β = (cos χ − 1)/2, R = √(p² + sin²χ) and u = (p + R)/(2α),
//!
//! ```text
//!            uniform          cos                      sin
//! inside     1                Re p/(2α)                Im p/(2α)
//! outside    Re(1 − p/R)      −½ Re[p/R (1/u + β/αu)]  −½ Im[p/R (β/αu − 1/u)]
//! ```
//!
//! by residues at the roots of α u² − p u + β in the unit circle.
//!
//! For coaxial, parallel disks symmetry fixes how the part above depends on
//! skew: G11 and (G22 + G33)/2 do not, G12 and G21 go with |**X**| and
//! (G22 − G33)/2 with |**X**|². (A harmonic m of the circulation reaches a
//! harmonic n of the flow through the power |m − n| of tan(χ/2), as in the
//! gain matrix of Pitt and Peters.) So four numbers, from one skew, serve
//! all. The part of the infinite cylinder is tabulated over |**X**|.
//!
//! [`InterferenceRule::Trapezoid`] takes circles from the shaft to the rim and
//! puts a rim of the source's own size half inside the wake in hover. However
//! small the skew, the half of that circle that lies upwind then leaves the
//! wake: G12 and G21 would jump. A table of few skew angles makes a slope of
//! the jump, that of its first step, and that slope is part of the rule.
//!
//! Other positions are tabulated over both components of **X**, with a core:
//! ρ² grows by the square of the core radius, which rounds the rim, and the
//! infinite cylinder's edge fades over one core radius outward. See
//! [`GENERAL_CORE`].
//!
//! # Smoothness in hover
//! When the receiver lies below a source of its own size, the smallest skew
//! takes a crescent of the disk out of the wake, whose area grows with |**X**|:
//! G has the tip of a cone at **X** = 0. A real wake has no sharp edge. The
//! tip is rounded by putting s/(s² + ε⁴)^¼ for |**X**| in the infinite
//! cylinder, with s = |**X**|² and ε = [`WAKE_EDGE`]. Hover itself is exact.

use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;
use std::f64::consts::PI;
use thiserror::Error;

use crate::numerics::interpolation::{Bicubic, CubicHermite, Ends, GridError, UniformTable};
use crate::numerics::quadrature::{gauss_legendre, periodic_nodes};
use crate::problem::InterferenceRule;

/// |**X**| within which the effect of the wake's edge is rounded: a skew
/// angle of 6°.
pub const WAKE_EDGE: f64 = 0.05;

/// Core radius of the wake where it meets a disk that is not coaxial, in
/// source radii. The disk's inflow is then good to a few hundredths of the
/// source's own.
pub const GENERAL_CORE: f64 = 0.06;

/// Parallel disks count as coaxial when the receiver's hub is no further from
/// the source's shaft than this, in source radii, and the shafts are no
/// further from parallel than [`COAXIAL_TILT`]. The offset and the tilt are
/// then neglected.
pub const COAXIAL_OFFSET: f64 = 0.02;

/// See [`COAXIAL_OFFSET`], rad.
pub const COAXIAL_TILT: f64 = 0.02;

/// Two coaxial disks nearer than this, in source radii, are refused.
const LEAST_SEPARATION: f64 = 0.02;

/// Why the interference of two rotors cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GeometryError {
    /// A radius is not positive and finite.
    #[error("the {which} radius is {value} m; it must be positive and finite")]
    Radius {
        /// Source or receiver.
        which: &'static str,
        /// Its value, m.
        value: f64,
    },
    /// A position or an axis is not finite, or axes are no rotation.
    #[error("the {what} of the receiver is not finite or not a rotation")]
    Placement {
        /// What is wrong.
        what: &'static str,
    },
    /// Coaxial disks nearly coincide.
    #[error(
        "the disks are {separation} source radii apart; coaxial disks need at least {least}",
        least = LEAST_SEPARATION
    )]
    TooClose {
        /// Distance over source radius.
        separation: f64,
    },
    /// The core radius of a wash is out of range.
    #[error("the core radius is {value} source radii; it must lie between 0.01 and 1")]
    Core {
        /// Its value.
        value: f64,
    },
    /// A table could not be built.
    #[error("the interference table could not be built: {0}")]
    Table(#[from] GridError),
}

/// Where the receiver is seen from the source.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskGeometry {
    /// Radius of the source, m.
    pub source_radius: f64,
    /// Radius of the receiver, m.
    pub receiver_radius: f64,
    /// Receiver's hub from the source's hub in the source's hub axes (x
    /// forward, y right, z down), m.
    pub offset: Vector3<f64>,
    /// The receiver's hub axes in the source's: columns are its x, y and z
    /// axes. Identity for parallel rotors.
    pub receiver_axes: Matrix3<f64>,
    /// Whether the source turns clockwise seen from above.
    pub source_mirrored: bool,
    /// Whether the receiver turns clockwise seen from above.
    pub receiver_mirrored: bool,
}

/// G11, G12, G21, G22 and G33 in wind axes, or the five functions of skew
/// that make up G: G11, G12/|X|, G21/|X|, (G22 + G33)/2 and (G22 − G33)/2
/// over |X| or |X|².
type Wind = [f64; 5];

/// Interference of a source on a receiver, tabulated over the skew.
#[derive(Debug, Clone)]
pub struct Interference(Map);

#[derive(Debug, Clone)]
enum Map {
    Coaxial {
        map: CoaxialMap,
        /// −1 if the receiver's sense of rotation differs from the source's.
        sine_sign: f64,
    },
    General(Box<Bicubic<9>>),
}

/// G and its partial derivatives by the components of **X**.
pub type WithPartials = (Matrix3<f64>, Matrix3<f64>, Matrix3<f64>);

impl Interference {
    /// Tabulates the interference.
    ///
    /// # Errors
    /// When the geometry makes no sense: see [`GeometryError`].
    pub fn new(geometry: &DiskGeometry, rule: InterferenceRule) -> Result<Self, GeometryError> {
        geometry.check()?;
        let axes = &geometry.receiver_axes;
        let scaled = geometry.offset / geometry.source_radius;
        let coaxial = scaled.x.hypot(scaled.y) <= COAXIAL_OFFSET
            && (axes - Matrix3::identity()).amax() <= COAXIAL_TILT;
        if !coaxial {
            return Ok(Self(Map::General(Box::new(general_map(geometry, rule)?))));
        }
        let radius = geometry.receiver_radius / geometry.source_radius;
        Ok(Self(Map::Coaxial {
            map: CoaxialMap::new(-scaled.z, radius, rule)?,
            sine_sign: if geometry.source_mirrored == geometry.receiver_mirrored {
                1.0
            } else {
                -1.0
            },
        }))
    }

    /// G at skew **X** (components x, y in the source's own hub axes): maps
    /// (Γ₀, Γ₁c, Γ₁s) of the source to (λ₀, λ₁c, λ₁s) of the receiver, each
    /// in its own hub azimuth.
    #[inline]
    pub fn evaluate(&self, x: [f64; 2]) -> Matrix3<f64> {
        self.evaluate_with_partials(x).0
    }

    /// G, ∂G/∂X_x and ∂G/∂X_y at skew **X**.
    #[inline]
    pub fn evaluate_with_partials(&self, x: [f64; 2]) -> WithPartials {
        match &self.0 {
            Map::Coaxial { map, sine_sign } => {
                // Aft and right: the directions of azimuth 0 and 90°.
                let (mut g, by_aft, mut by_y) = map.evaluate([-x[0], x[1]]);
                let mut by_x = -by_aft;
                for m in [&mut g, &mut by_x, &mut by_y] {
                    for column in 0..3 {
                        m[(2, column)] *= sine_sign;
                    }
                }
                (g, by_x, by_y)
            }
            Map::General(table) => {
                let v = table.evaluate(x[0], x[1]);
                (
                    Matrix3::from_row_slice(&v.value),
                    Matrix3::from_row_slice(&v.x),
                    Matrix3::from_row_slice(&v.y),
                )
            }
        }
    }
}

impl DiskGeometry {
    fn check(&self) -> Result<(), GeometryError> {
        for (which, value) in [("source", self.source_radius), ("receiver", self.receiver_radius)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(GeometryError::Radius { which, value });
            }
        }
        if !self.offset.iter().all(|v| v.is_finite()) {
            return Err(GeometryError::Placement { what: "position" });
        }
        let axes = &self.receiver_axes;
        let error = (axes.transpose() * axes - Matrix3::identity()).amax();
        // Negated, so that NaN is refused too.
        if !(error < 1e-9 && axes.determinant() > 0.0) {
            return Err(GeometryError::Placement { what: "attitude" });
        }
        Ok(())
    }
}

/// Sine and cosine of the skew angle from |**X**| = tan(χ/2).
#[inline]
fn skew(t: f64) -> (f64, f64) {
    let d = 1.0 + t * t;
    (2.0 * t / d, (1.0 - t * t) / d)
}

/// G of coaxial, parallel disks: rotational symmetry leaves functions of
/// |**X**| only.
#[derive(Debug, Clone)]
struct CoaxialMap {
    /// Semi-infinite wake seen from above, the same at every skew; the last
    /// function over |X|².
    above: Wind,
    /// Infinite cylinder, for a receiver below.
    sheet: Option<Sheet>,
}

/// The part of the infinite cylinder, the last function over |X|.
///
/// The wake crosses the plane of the receiver D = depth tan χ downstream, and
/// leaves its disk within a narrow range of skew. So the table runs over
/// v = D/(1 + D), which is smooth in |X| from 0 to 1.
#[derive(Debug, Clone)]
struct Sheet {
    depth: f64,
    table: UniformTable<5>,
}

impl Sheet {
    /// Cells of the table.
    const CELLS: usize = 192;

    fn new(depth: f64, radius: f64, rule: InterferenceRule) -> Result<Self, GridError> {
        if let InterferenceRule::Trapezoid { skews, .. } = rule {
            return Self::through_skews(depth, radius, rule, skews);
        }
        let at = |t: f64| -> Wind {
            let [g11, g12, g21, g22, g33] = sheet_integrals(t, depth, radius, rule);
            [g11, g12 / t, g21 / t, 0.5 * (g22 + g33), 0.5 * (g22 - g33) / t]
        };
        let table = UniformTable::fit(0.0, 1.0, Self::CELLS, |v| {
            if v <= 0.0 {
                // The ratios at hover are limits, from two small skews.
                let (near, far) = (at(1e-3), at(2e-3));
                let mut hover: Wind = std::array::from_fn(|c| 2.0 * near[c] - far[c]);
                let [g11, _, _, g22, _] = sheet_integrals(0.0, depth, radius, rule);
                (hover[0], hover[3]) = (g11, g22);
                hover
            } else if v >= 1.0 {
                at(1.0)
            } else {
                let tan_chi = v / ((1.0 - v) * depth);
                at(tan_chi / (1.0 + tan_chi.hypot(1.0)))
            }
        })?;
        Ok(Self { depth, table })
    }

    /// Integrals at `skews` angles from 0 to 90°, joined by smooth curves. What
    /// is divided by |X| keeps to hover the value of the first angle beyond it.
    fn through_skews(
        depth: f64,
        radius: f64,
        rule: InterferenceRule,
        skews: usize,
    ) -> Result<Self, GridError> {
        let step = 0.5 * PI / (skews - 1) as f64;
        let mut at: Vec<Wind> = (0..skews)
            .map(|k| {
                let t = (0.5 * k as f64 * step).tan();
                let [g11, g12, g21, g22, g33] = sheet_integrals(t, depth, radius, rule);
                [g11, g12 / t, g21 / t, 0.5 * (g22 + g33), 0.5 * (g22 - g33) / t]
            })
            .collect();
        for ratio in [1, 2, 4] {
            at[0][ratio] = at[1][ratio];
        }
        // Even in the angle, so that nothing has a slope in hover.
        let last = skews as isize - 1;
        let angles: Vec<f64> = (-last..=last).map(|k| k as f64 * step).collect();
        let curve = |function: usize| {
            let values: Vec<f64> = (-last..=last).map(|k| at[k.unsigned_abs()][function]).collect();
            CubicHermite::new(&angles, &values, Ends::Parabolic)
        };
        let curves = (0..5).map(curve).collect::<Result<Vec<_>, _>>()?;
        let table = UniformTable::fit(0.0, 1.0, Self::CELLS, |v| {
            let angle = if v < 1.0 { (v / ((1.0 - v) * depth)).atan() } else { 0.5 * PI };
            std::array::from_fn(|function| curves[function].evaluate(angle).0)
        })?;
        Ok(Self { depth, table })
    }

    /// The five functions at |X| = t and their derivatives by it.
    #[inline]
    fn evaluate(&self, t: f64) -> (Wind, Wind) {
        let twice = 2.0 * self.depth;
        let per = 1.0 / (1.0 - t * t + twice * t);
        let slope = twice * (1.0 + t * t) * per * per;
        let (h, dh) = self.table.evaluate(twice * t * per);
        (h, dh.map(|d| d * slope))
    }
}

impl CoaxialMap {
    /// Disks `height` apart (receiver above if positive), in source radii.
    fn new(height: f64, radius: f64, rule: InterferenceRule) -> Result<Self, GeometryError> {
        let separation = height.abs();
        if separation < LEAST_SEPARATION {
            return Err(GeometryError::TooClose { separation });
        }
        let above = AboveRule::new(separation, radius, rule).functions(0.5);
        let sheet = if height < 0.0 { Some(Sheet::new(separation, radius, rule)?) } else { None };
        Ok(Self { above, sheet })
    }

    /// The five functions and their derivatives by |X|², all regular at 0;
    /// the last over |X|².
    #[inline]
    fn functions(&self, s: f64) -> (Wind, Wind) {
        let a = &self.above;
        let Some(sheet) = &self.sheet else {
            return (*a, [0.0; 5]);
        };
        const EDGE: f64 = WAKE_EDGE * WAKE_EDGE * WAKE_EDGE * WAKE_EDGE;
        // 1/|X| and |X| with the cone's tip rounded.
        let fourth = s * s + EDGE;
        let per_t = 1.0 / fourth.sqrt().sqrt();
        let per_t_slope = -0.5 * s * per_t / fourth;
        let (t, t_slope) = (s * per_t, per_t + s * per_t_slope);
        let (h, dh) = sheet.evaluate(t);
        // Less the upper half, whose skew is reversed.
        (
            [h[0] - a[0], h[1] + a[1], h[2] + a[2], h[3] - a[3], h[4] * per_t - a[4]],
            [
                dh[0] * t_slope,
                dh[1] * t_slope,
                dh[2] * t_slope,
                dh[3] * t_slope,
                dh[4] * t_slope * per_t + h[4] * per_t_slope,
            ],
        )
    }

    /// G and its partials by the components of the skew aft and right.
    #[inline]
    fn evaluate(&self, [a, r]: [f64; 2]) -> WithPartials {
        let (f, df) = self.functions(a * a + r * r);
        let [f0, f1, f2, f3, f4] = f;
        let (cos2, sin2) = (a * a - r * r, 2.0 * a * r);
        let g = Matrix3::new(
            f0,
            f1 * a,
            f1 * r,
            f2 * a,
            f3 + f4 * cos2,
            f4 * sin2,
            f2 * r,
            f4 * sin2,
            f3 - f4 * cos2,
        );
        // ∂(|X|²)/∂a = 2a, and so on.
        let partial = |ds: f64, da: f64, dr: f64, dcos2: f64, dsin2: f64| {
            let [d0, d1, d2, d3, d4] = df.map(|d| d * ds);
            let (c, s) = (d4 * cos2 + f4 * dcos2, d4 * sin2 + f4 * dsin2);
            Matrix3::new(
                d0,
                d1 * a + f1 * da,
                d1 * r + f1 * dr,
                d2 * a + f2 * da,
                d3 + c,
                s,
                d2 * r + f2 * dr,
                s,
                d3 - c,
            )
        };
        (
            g,
            partial(2.0 * a, 1.0, 0.0, 2.0 * a, 2.0 * r),
            partial(2.0 * r, 0.0, 1.0, -2.0 * r, 2.0 * a),
        )
    }
}

/// Radial nodes with weights dr over the receiver's disk of `radius`.
fn radial_rule(radius: f64, rule: InterferenceRule, count: usize) -> Vec<(f64, f64)> {
    match rule {
        InterferenceRule::Converged => gauss_legendre(0.0, radius, count),
        InterferenceRule::Trapezoid { radii, .. } => {
            // The last is the rim to the bit: the wake's edge may lie on it.
            let steps = (radii - 1) as f64;
            (0..radii)
                .map(|k| {
                    let end = k == 0 || k == radii - 1;
                    let weight = if end { 0.5 } else { 1.0 };
                    (radius * (k as f64 / steps), weight * radius / steps)
                })
                .collect()
        }
    }
}

/// Quadrature over a disk above the source and around its rim.
struct AboveRule {
    height: f64,
    radius: f64,
    radii: Vec<(f64, f64)>,
    /// Disk azimuths over the half plane y ≥ 0; ends weigh half.
    azimuths: Vec<(f64, f64)>,
    rim: Vec<(f64, f64)>,
}

impl AboveRule {
    fn new(height: f64, radius: f64, rule: InterferenceRule) -> Self {
        // The integrand is analytic in a strip about as wide as the disks
        // are apart. The counts leave 1e-9 (tests double them).
        let near = height.min(1.0);
        let around = 2 * ((11.0 / near).ceil() as usize + 8);
        let along = (4.5 / near.sqrt()).ceil() as usize + 10;
        Self::with_counts(height, radius, rule, along, around)
    }

    fn with_counts(
        height: f64,
        radius: f64,
        rule: InterferenceRule,
        along: usize,
        around: usize,
    ) -> Self {
        let rim = periodic_nodes(around);
        Self {
            height,
            radius,
            radii: radial_rule(radius, rule, along),
            azimuths: rim[..=around / 2].to_vec(),
            rim,
        }
    }

    /// The five functions of a [`CoaxialMap`] from |X| = t.
    fn functions(&self, t: f64) -> Wind {
        let [g11, g12, g21, g22, g33] = self.integrate(t);
        [g11, g12 / t, g21 / t, 0.5 * (g22 + g33), 0.5 * (g22 - g33) / (t * t)]
    }

    /// G11, G12, G21, G22, G33 in wind axes at |X| = t.
    fn integrate(&self, t: f64) -> Wind {
        let (sin_chi, cos_chi) = skew(t);
        let mut sum = [0.0; 5];
        let last = self.azimuths.len() - 1;
        for &(r, dr) in &self.radii {
            for (k, &(cos, sin)) in self.azimuths.iter().enumerate() {
                let point = [r * cos, r * sin, self.height];
                let w = rim_average(point, [sin_chi, 0.0], cos_chi, 0.0, &self.rim);
                let weight = if k == 0 || k == last { 0.5 } else { 1.0 } * r * dr;
                add_disk_moments(&mut sum, w, r / self.radius, cos, sin, weight);
            }
        }
        // The half plane counts twice: 2/π ∫∫ … dψ over half the circle.
        let scale = 2.0 / (last as f64) / (self.radius * self.radius);
        finish(sum.map(|v| 0.5 * v * scale))
    }
}

/// Adds a point's part to the moments of the flow over the disk.
#[inline]
fn add_disk_moments(sum: &mut Wind, w: [f64; 3], r: f64, cos: f64, sin: f64, weight: f64) {
    sum[0] += weight * w[0];
    sum[1] += weight * w[1];
    sum[2] += weight * w[0] * r * cos;
    sum[3] += weight * w[1] * r * cos;
    sum[4] += weight * w[2] * r * sin;
}

/// Disk averages to rows of G: twice for 1/π ∫ r dr dψ = ∫ 2r dr/(2π) dψ, and
/// four times that average in the harmonic rows.
fn finish(sum: Wind) -> Wind {
    [2.0 * sum[0], 2.0 * sum[1], 8.0 * sum[2], 8.0 * sum[3], 8.0 * sum[4]]
}

/// Flow down the shaft at a point (x, y, z up) for unit circulation uniform,
/// cos and sin around the rim, with a core of squared radius `core2`:
/// ¹⁄₄π ∮ K (1, c, s) dψ_v. The wake runs along (`lean`, −`cos_chi`), where
/// `lean` is sin χ downstream; azimuth is from x towards y.
#[inline]
fn rim_average(
    [x, y, z]: [f64; 3],
    lean: [f64; 2],
    cos_chi: f64,
    core2: f64,
    rim: &[(f64, f64)],
) -> [f64; 3] {
    let square = 1.0 + x * x + y * y + z * z + core2;
    let lift = z * cos_chi - x * lean[0] - y * lean[1];
    let mut sum = [0.0; 3];
    for &(c, s) in rim {
        let dot = x * c + y * s;
        let along = c * lean[0] + s * lean[1];
        let distance = (square - 2.0 * dot).sqrt();
        let k = (1.0 - dot + distance * along) / (distance * (distance + lift + along));
        sum[0] += k;
        sum[1] += k * c;
        sum[2] += k * s;
    }
    let scale = 0.5 / rim.len() as f64;
    sum.map(|v| v * scale)
}

/// Flow down the shaft at a point (aft, right, up), at the skew with
/// components aft and right. The core rounds the rim, and the edge of the
/// sheet below it fades over one core radius outward.
fn cored_flow(point: [f64; 3], skew: [f64; 2], core: f64, rim: &[(f64, f64)]) -> [f64; 3] {
    // Beyond edgewise the wake stays edgewise.
    let t = skew[0].hypot(skew[1]).min(1.0);
    let (sin_chi, cos_chi) = self::skew(t);
    let direction = if t > 0.0 {
        let length = skew[0].hypot(skew[1]);
        skew.map(|v| v / length)
    } else {
        [1.0, 0.0]
    };
    let lean = direction.map(|v| v * sin_chi);
    let [a, r, up] = point;
    if up >= 0.0 {
        return rim_average(point, lean, cos_chi, core * core, rim);
    }
    // Below: the infinite cylinder less its upper half.
    let upper = rim_average([a, r, -up], lean.map(|v| -v), cos_chi, core * core, rim);
    let [x, y] = [a * direction[0] + r * direction[1], r * direction[0] - a * direction[1]];
    let p = Complex64::new(cos_chi * x + up * sin_chi, y);
    // Distance from the cylinder's axis in the plane of the point.
    let from_axis = if cos_chi > 0.0 { (p.re / cos_chi).hypot(y) } else { f64::INFINITY };
    let beyond = ((from_axis - 1.0) / core).clamp(0.0, 1.0);
    let outside = beyond * beyond * (3.0 - 2.0 * beyond);
    let mut sheet = [0.0; 3];
    for (share, inside) in [(1.0 - outside, true), (outside, false)] {
        if share > 0.0 {
            let flow = sheet_flow(p, sin_chi, cos_chi, inside);
            for (total, flow) in sheet.iter_mut().zip(flow) {
                *total += share * flow;
            }
        }
    }
    // Harmonics of wind azimuth to those of the source's own azimuth.
    [
        sheet[0] - upper[0],
        sheet[1] * direction[0] - sheet[2] * direction[1] - upper[1],
        sheet[1] * direction[1] + sheet[2] * direction[0] - upper[2],
    ]
}

/// Rim azimuths enough for a core of this radius: they leave about 1e-5.
fn cored_rim(core: f64) -> Vec<(f64, f64)> {
    periodic_nodes((12.0 / core).ceil() as usize + 16)
}

/// Equally spaced skew components from −1 to 1.
fn skew_axis(cells: usize) -> Vec<f64> {
    (0..=cells).map(|k| -1.0 + 2.0 * k as f64 / cells as f64).collect()
}

/// A point in source axes (x forward, y right, z down) as aft, right and up
/// in the source's own axes, in source radii.
fn own_axes(point: &Vector3<f64>, radius: f64, mirrored: bool) -> [f64; 3] {
    let side = if mirrored { -1.0 } else { 1.0 };
    [-point.x / radius, side * point.y / radius, -point.z / radius]
}

/// Cells of the general table along each component of the skew.
const GENERAL_CELLS: usize = 32;
/// Radii and azimuths over a disk that is not coaxial.
const GENERAL_POINTS: [usize; 2] = [8, 24];

/// G over both components of the skew, row by row.
fn general_map(
    geometry: &DiskGeometry,
    rule: InterferenceRule,
) -> Result<Bicubic<9>, GeometryError> {
    let points = disk_points(geometry, rule);
    let rim = cored_rim(GENERAL_CORE);
    let axis = skew_axis(GENERAL_CELLS);
    let mut values = [const { Vec::new() }; 9];
    for &x in &axis {
        for &y in &axis {
            let g = general_matrix(&points, [-x, y], &rim);
            for (k, table) in values.iter_mut().enumerate() {
                table.push(g[k]);
            }
        }
    }
    let ends = [Ends::Parabolic; 2];
    let values: [&[f64]; 9] = std::array::from_fn(|k| &values[k][..]);
    Ok(Bicubic::new(&axis, &axis, values, ends)?)
}

/// A quadrature point on the receiver: place (aft, right, up) in the source's
/// own axes, and its weights in the three rows of G.
struct DiskPoint {
    place: [f64; 3],
    weight: [f64; 3],
}

fn disk_points(geometry: &DiskGeometry, rule: InterferenceRule) -> Vec<DiskPoint> {
    let [along, around] = GENERAL_POINTS;
    let axes = &geometry.receiver_axes;
    // Only the component along the receiver's shaft passes its disk.
    let cosine = axes[(2, 2)];
    let side = if geometry.receiver_mirrored { -1.0 } else { 1.0 };
    let mut points = Vec::new();
    for (r, dr) in radial_rule(1.0, rule, along) {
        for (cos, sin) in periodic_nodes(around) {
            let arm = axes * Vector3::new(-cos, side * sin, 0.0) * (r * geometry.receiver_radius);
            let weight = cosine * 2.0 * r * dr / around as f64;
            points.push(DiskPoint {
                place: own_axes(
                    &(geometry.offset + arm),
                    geometry.source_radius,
                    geometry.source_mirrored,
                ),
                weight: [weight, 4.0 * weight * r * cos, 4.0 * weight * r * sin],
            });
        }
    }
    points
}

/// G, row by row, at a skew with components aft and right.
fn general_matrix(points: &[DiskPoint], skew: [f64; 2], rim: &[(f64, f64)]) -> [f64; 9] {
    let mut g = [0.0; 9];
    for point in points {
        let w = cored_flow(point.place, skew, GENERAL_CORE, rim);
        for row in 0..3 {
            for column in 0..3 {
                g[3 * row + column] += point.weight[row] * w[column];
            }
        }
    }
    g
}

/// Flow that a rotor's wake induces at a point, along the rotor's shaft,
/// tabulated over the skew: for wings and bodies.
///
/// The same circulation that G maps to a disk's inflow ratio is mapped to the
/// inflow ratio at the point; over a disk its average is the first row of G.
#[derive(Debug, Clone)]
pub struct PointWash(Bicubic<3>);

impl PointWash {
    /// Cells along each component of the skew.
    const CELLS: usize = 32;

    /// Tabulates the wash at `point` (from the source's hub in the source's
    /// hub axes, m) of a source of radius `source_radius`, m, that turns
    /// clockwise if `source_mirrored`. `core` is the core radius of the wake
    /// in source radii: ρ² grows by its square.
    ///
    /// # Errors
    /// When radius, point or core make no sense: see [`GeometryError`].
    pub fn new(
        source_radius: f64,
        point: &Vector3<f64>,
        core: f64,
        source_mirrored: bool,
    ) -> Result<Self, GeometryError> {
        if !(source_radius > 0.0 && source_radius.is_finite()) {
            return Err(GeometryError::Radius { which: "source", value: source_radius });
        }
        if !point.iter().all(|v| v.is_finite()) {
            return Err(GeometryError::Placement { what: "position" });
        }
        if !(0.01..=1.0).contains(&core) {
            return Err(GeometryError::Core { value: core });
        }
        let place = own_axes(point, source_radius, source_mirrored);
        let rim = cored_rim(core);
        let axis = skew_axis(Self::CELLS);
        let mut values = [const { Vec::new() }; 3];
        for &x in &axis {
            for &y in &axis {
                let w = cored_flow(place, [-x, y], core, &rim);
                for (table, w) in values.iter_mut().zip(w) {
                    table.push(w);
                }
            }
        }
        let [a, b, c] = &values;
        let ends = [Ends::Parabolic; 2];
        Ok(Self(Bicubic::new(&axis, &axis, [a, b, c], ends)?))
    }

    /// Inflow ratio at the point, positive down the source's shaft, for each
    /// of Γ₀, Γ₁c, Γ₁s at skew **X** (components x, y in the source's own hub
    /// axes).
    #[inline]
    pub fn evaluate(&self, x: [f64; 2]) -> [f64; 3] {
        self.0.value(x[0], x[1])
    }

    /// The same with its partial derivatives by X_x and X_y.
    #[inline]
    pub fn evaluate_with_partials(&self, x: [f64; 2]) -> [[f64; 3]; 3] {
        let v = self.0.evaluate(x[0], x[1]);
        [v.value, v.x, v.y]
    }
}

/// Flow of the infinite cylinder at p (see the module's text).
fn sheet_flow(p: Complex64, sin_chi: f64, cos_chi: f64, inside: bool) -> [f64; 3] {
    let alpha = 0.5 * (1.0 + cos_chi);
    if inside {
        return [1.0, p.re / (2.0 * alpha), p.im / (2.0 * alpha)];
    }
    let beta = 0.5 * (cos_chi - 1.0);
    let mut root = (p * p + sin_chi * sin_chi).sqrt();
    // The branch that goes with p at infinity.
    if root.re * p.re + root.im * p.im < 0.0 {
        root = -root;
    }
    let ratio = p / root;
    let per_u = 2.0 * alpha / (p + root);
    let (plus, minus) = (ratio * per_u * (beta / alpha), ratio * per_u);
    [1.0 - ratio.re, -0.5 * (plus + minus).re, -0.5 * (plus - minus).im]
}

/// Radii over the receiver's disk with weights dr, for the infinite cylinder
/// that cuts its plane in the unit circle moved downstream by `shift`.
///
/// Converged integrals divide the radius where the disk's circles enter and
/// leave that circle.
fn sheet_radii(
    shift: f64,
    radius: f64,
    rule: InterferenceRule,
    unit: &[(f64, f64)],
) -> Vec<(f64, f64)> {
    match rule {
        InterferenceRule::Converged => {}
        InterferenceRule::Trapezoid { .. } => return radial_rule(radius, rule, 0),
    }
    let mut edges = vec![0.0];
    for edge in [(1.0 - shift).abs(), 1.0 + shift] {
        if edge > 0.0 && edge < radius {
            edges.push(edge);
        }
    }
    edges.push(radius);
    let mut nodes = Vec::new();
    for piece in edges.windows(2) {
        let (low, high) = (piece[0], piece[1]);
        if high <= low {
            continue;
        }
        for &(v, dv) in unit {
            // Square roots at both ends of the piece become smooth in v.
            let (sin, cos) = (PI * v).sin_cos();
            nodes
                .push((low + (high - low) * 0.5 * (1.0 - cos), (high - low) * 0.5 * PI * sin * dv));
        }
    }
    nodes
}

/// Disk integrals of the infinite cylinder's flow, `depth` below the source,
/// at |X| = t: G11, G12, G21, G22, G33 in wind axes.
///
/// The cylinder cuts the receiver's plane in the unit circle moved
/// downstream by D = depth tan χ. The azimuth is divided where the disk's
/// circles enter and leave it.
fn sheet_integrals(t: f64, depth: f64, radius: f64, rule: InterferenceRule) -> Wind {
    let (sin_chi, cos_chi) = skew(t);
    let shift = if cos_chi > 0.0 { depth * sin_chi / cos_chi } else { f64::INFINITY };
    let unit = gauss_legendre(0.0, 1.0, 20);
    let mut sum = [0.0; 5];
    for (r, dr) in sheet_radii(shift, radius, rule, &unit) {
        // Inside where cos ψ is above this; of a circle on the very edge, half.
        let level = (r * r + shift * shift - 1.0) / (2.0 * r * shift);
        let leave = if shift.is_infinite() {
            0.0
        } else if shift == 0.0 && r == 1.0 {
            0.5 * PI
        } else {
            level.clamp(-1.0, 1.0).acos()
        };
        for (from, to, inside) in [(0.0, leave, true), (leave, PI, false)] {
            if to <= from {
                continue;
            }
            for &(w, dw) in &unit {
                let (sin, cos) = (from + (to - from) * w).sin_cos();
                let p = Complex64::new(cos_chi * r * cos - depth * sin_chi, r * sin);
                let flow = sheet_flow(p, sin_chi, cos_chi, inside);
                let weight = r * dr * (to - from) * dw;
                add_disk_moments(&mut sum, flow, r / radius, cos, sin, weight);
            }
        }
    }
    // Half the circle was covered: 1/(2π) ∫ over all = 1/π ∫ over half.
    finish(sum.map(|v| v / (PI * radius * radius)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// Lower on upper and upper on lower of the CoAX 2D.
    static PAIR: LazyLock<[CoaxialMap; 2]> =
        LazyLock::new(|| [map(H, Converged), map(-H, Converged)]);

    /// Separation of the CoAX 2D's rotors over their radius.
    const H: f64 = 2.14 / 10.66;
    use InterferenceRule::Converged;

    const CIRCLES: InterferenceRule = InterferenceRule::Trapezoid { radii: 11, skews: 10 };

    fn map(height: f64, rule: InterferenceRule) -> CoaxialMap {
        CoaxialMap::new(height, 1.0, rule).unwrap()
    }

    fn coaxial(height: f64) -> DiskGeometry {
        DiskGeometry {
            source_radius: 1.0,
            receiver_radius: 1.0,
            offset: Vector3::new(0.0, 0.0, -height),
            receiver_axes: Matrix3::identity(),
            source_mirrored: false,
            receiver_mirrored: false,
        }
    }

    fn uniform(height: f64, rule: InterferenceRule) -> f64 {
        2.0 * map(height, rule).evaluate([0.0, 0.0]).0[(0, 0)]
    }

    /// Biot and Savart by brute force: straight pieces of vortex rings along
    /// the wake, Gauss points in wake age mapped to the whole half line.
    fn biot_savart(point: [f64; 3], sin_chi: f64, cos_chi: f64) -> [f64; 3] {
        let mut w = [0.0; 3];
        let ages = gauss_legendre(0.0, 1.0, 120);
        for (c, s) in periodic_nodes(400) {
            for &(v, dv) in &ages {
                let age = v / (1.0 - v);
                let d_age = dv / (1.0 - v).powi(2);
                let element = Vector3::new(-s, c, 0.0);
                let place = Vector3::new(c + age * sin_chi, s, -age * cos_chi);
                let arm = Vector3::from(point) - place;
                let velocity = element.cross(&arm) / arm.norm().powi(3) / (4.0 * PI);
                // Rings seen from above turn counter-clockwise and blow up;
                // Γ is positive for flow down.
                let flow = velocity.z * d_age * 2.0 * PI / 400.0;
                w[0] += flow;
                w[1] += flow * c;
                w[2] += flow * s;
            }
        }
        w
    }

    #[test]
    fn the_kernel_is_the_law_of_biot_and_savart_along_the_wake() {
        let rim = periodic_nodes(400);
        for (point, t) in [
            ([0.3, -0.4, 0.5], 0.4),
            ([-0.8, 0.2, 0.4], 0.0),
            ([1.7, 0.5, 0.8], 0.9),
            ([0.1, 0.3, -0.7], 0.2),
            ([-1.5, 0.9, -0.5], 0.7),
        ] {
            let (sin_chi, cos_chi) = skew(t);
            let closed = rim_average(point, [sin_chi, 0.0], cos_chi, 0.0, &rim);
            let brute = biot_savart(point, sin_chi, cos_chi);
            for c in 0..3 {
                assert!((closed[c] - brute[c]).abs() < 1e-8, "{point:?} {closed:?} {brute:?}");
            }
        }
    }

    #[test]
    fn on_the_axis_in_hover_the_flow_is_the_textbook_one() {
        // 1 + d/√(1 + d²) of the flow at the disk, d downstream.
        for d in [-2.0f64, -0.5, -0.1, 0.0, 0.1, 0.3, 1.0, 3.0] {
            let w = cored_flow([0.0, 0.0, -d], [0.0, 0.0], 1e-6, &periodic_nodes(64));
            assert!((2.0 * w[0] - (1.0 + d / (1.0 + d * d).sqrt())).abs() < 1e-9);
        }
    }

    #[test]
    fn above_and_below_share_twice_the_flow_of_the_disk() {
        for height in [0.05, H, 0.7, 2.0] {
            let sum = uniform(height, Converged) + uniform(-height, Converged);
            assert!((sum - 2.0).abs() < 1e-9, "{height} {sum}");
        }
        // Ever nearer to the source's own disk the ratio tends to 1.
        let missing = |height| 1.0 - uniform(height, Converged);
        assert!(missing(0.02) > 0.0 && missing(0.02) < 0.5 * missing(0.05));
    }

    #[test]
    fn val_hover_ratios_of_the_coax_2d() {
        // An independent quadrature of the same integral gave 0.6557 (lower
        // on upper) and 1.3443 (upper on lower).
        assert!((uniform(H, Converged) - 0.6557).abs() < 5e-5);
        assert!((uniform(-H, Converged) - 1.3443).abs() < 5e-5);
    }

    /// Circles a step d apart, the one at the rim half in the wake: twice the
    /// sum of 2 r dr is 2 − d, and so is the sum of both disks' inflow.
    #[test]
    fn val_circles_that_hold_the_rim_lack_one_step_of_two() {
        for radii in [6, 11, 31, 50] {
            let rule = InterferenceRule::Trapezoid { radii, skews: 10 };
            let step = 1.0 / (radii - 1) as f64;
            let sum = uniform(H, rule) + uniform(-H, rule);
            assert!((sum - (2.0 - step)).abs() < 1e-12, "{radii}: {sum}");
        }
        // Table 2 implies 0.63 to 0.66, and 1.21 to 1.23, from which the second
        // is 1.4 % away.
        assert!((uniform(H, CIRCLES) - 0.653).abs() < 1e-3, "{}", uniform(H, CIRCLES));
        assert!((uniform(-H, CIRCLES) - 1.247).abs() < 1e-3, "{}", uniform(-H, CIRCLES));
    }

    /// The table of a few skew angles passes through the rule's own sums, here
    /// by brute force (1440 azimuths across the jump leave 3e-3), and is smooth.
    #[test]
    fn the_table_of_few_skews_holds_the_rule_at_each() {
        let pair = map(-H, CIRCLES);
        let rim = periodic_nodes(720);
        let around = periodic_nodes(1440);
        for degrees in [20.0_f64, 40.0, 60.0] {
            let (sin_chi, cos_chi) = degrees.to_radians().sin_cos();
            let mut brute = [0.0; 3];
            for k in 1..=10 {
                let (r, dr) = (0.1 * f64::from(k), if k == 10 { 0.05 } else { 0.1 });
                for &(cos, sin) in &around {
                    let w =
                        rim_average([r * cos, r * sin, -H], [sin_chi, 0.0], cos_chi, 1e-9, &rim);
                    let weight = 2.0 * r * dr / around.len() as f64;
                    brute[0] += weight * w[0];
                    brute[1] += 4.0 * weight * w[0] * r * cos;
                    brute[2] += 4.0 * weight * w[1] * r * cos;
                }
            }
            let t = (0.5 * degrees.to_radians()).tan();
            let (g, by_aft, _) = pair.evaluate([t, 0.0]);
            for (ours, sum) in [g[(0, 0)], g[(1, 0)], g[(1, 1)]].into_iter().zip(brute) {
                assert!((ours - sum).abs() < 5e-3, "{degrees} deg: {ours} {sum}");
            }
            let h = 1e-5;
            let (next, last) = (pair.evaluate([t + h, 0.0]).0, pair.evaluate([t - h, 0.0]).0);
            assert!(((next - last) / (2.0 * h) - by_aft).amax() < 1e-6);
        }
    }

    /// Many circles and angles come to the converged integrals.
    #[test]
    fn circles_converge() {
        let fine = map(-H, InterferenceRule::Trapezoid { radii: 801, skews: 181 });
        let exact = map(-H, Converged);
        for t in [0.0, 0.15, 0.4, 0.8] {
            let off = (fine.evaluate([t, 0.0]).0 - exact.evaluate([t, 0.0]).0).amax();
            assert!(off < 2e-3, "{t}: {off}");
        }
    }

    #[test]
    fn above_the_source_skew_enters_through_powers_of_its_half_angle() {
        for rule in [Converged, CIRCLES] {
            let above = AboveRule::new(H, 1.0, rule);
            let one = above.functions(0.5);
            for t in [0.05, 0.3, 0.8, 1.0] {
                let other = above.functions(t);
                for c in 0..5 {
                    assert!((one[c] - other[c]).abs() < 1e-9, "{t} {one:?} {other:?}");
                }
            }
        }
    }

    #[test]
    fn quadrature_counts_leave_less_than_a_billionth() {
        for height in [0.03, H, 0.6, 3.0] {
            let rule = AboveRule::new(height, 1.0, Converged);
            let (along, around) = (rule.radii.len(), rule.rim.len());
            let (coarse, fine) = (
                rule.integrate(0.5),
                AboveRule::with_counts(height, 1.0, Converged, 2 * along, 2 * around)
                    .integrate(0.5),
            );
            for c in 0..5 {
                assert!((coarse[c] - fine[c]).abs() < 1e-9, "{height} {coarse:?} {fine:?}");
            }
        }
    }

    #[test]
    fn the_infinite_cylinder_has_its_closed_form() {
        // Against the integral along generators infinite both ways.
        let rim = periodic_nodes(4000);
        for (x, y, t) in [
            (0.2, -0.3, 0.4),
            (-0.7, 0.5, 0.8),
            (0.4, 0.6, 0.0),
            (1.3, 0.2, 0.4),
            (-0.9, -0.9, 0.6),
            (0.1, 1.2, 0.9),
            (-2.5, 0.1, 0.0),
        ] {
            let (sin_chi, cos_chi) = skew(t);
            let (p, q) = (cos_chi * x, cos_chi);
            let mut brute = [0.0; 3];
            for &(c, s) in &rim {
                let k =
                    (q * c * (q * c - p) + s * (s - y)) / ((q * c - p).powi(2) + (s - y).powi(2));
                for (sum, harmonic) in brute.iter_mut().zip([1.0, c, s]) {
                    *sum += k * harmonic / rim.len() as f64;
                }
            }
            let inside = f64::hypot(x, y) < 1.0;
            let closed = sheet_flow(Complex64::new(p, y), sin_chi, cos_chi, inside);
            for c in 0..3 {
                assert!((closed[c] - brute[c]).abs() < 1e-10, "{x} {y} {closed:?} {brute:?}");
            }
        }
    }

    #[test]
    fn below_the_source_the_two_parts_make_the_whole() {
        // Away from the sheet the kernel can be integrated directly there.
        let rim = periodic_nodes(4000);
        for (point, skew_vector) in [
            ([0.2, 0.1, -0.4], [0.1, 0.05]),
            ([0.9, -0.5, -0.6], [0.5, -0.3]),
            ([-0.9, 0.8, -0.3], [0.2, 0.4]),
            ([2.0, 0.3, -0.5], [0.85, 0.1]),
        ] {
            let split = cored_flow(point, skew_vector, 1e-6, &rim);
            let t = f64::hypot(skew_vector[0], skew_vector[1]);
            let (sin_chi, cos_chi) = skew(t);
            let lean = skew_vector.map(|v| v / t * sin_chi);
            let whole = rim_average(point, lean, cos_chi, 0.0, &rim);
            for c in 0..3 {
                assert!((split[c] - whole[c]).abs() < 1e-8, "{split:?} {whole:?}");
            }
        }
    }

    #[test]
    fn the_sheet_is_integrated_over_the_disk_in_its_pieces() {
        for (t, radius) in [(0.05, 1.0), (0.5, 1.0), (0.86, 1.0), (0.97, 1.0), (0.6, 1.6)] {
            let quick = sheet_integrals(t, H, radius, Converged);
            let (sin_chi, cos_chi) = skew(t);
            let shift = H * sin_chi / cos_chi;
            let (n, m) = (1000, 1500);
            let mut sum = [0.0; 5];
            for i in 0..n {
                let r = (i as f64 + 0.5) / n as f64 * radius;
                for k in 0..m {
                    let (sin, cos) = (PI * (k as f64 + 0.5) / m as f64).sin_cos();
                    let inside = (r * cos - shift).hypot(r * sin) < 1.0;
                    let p = Complex64::new(cos_chi * (r * cos - shift), r * sin);
                    let flow = sheet_flow(p, sin_chi, cos_chi, inside);
                    add_disk_moments(&mut sum, flow, r / radius, cos, sin, r);
                }
            }
            let brute = finish(sum.map(|v| v / (n as f64 * m as f64 * radius)));
            for c in 0..5 {
                assert!((quick[c] - brute[c]).abs() < 3e-4, "{t} {quick:?} {brute:?}");
            }
        }
    }

    #[test]
    fn the_table_over_skew_is_that_of_the_integrals() {
        let below = map(-H, Converged);
        let sheet = below.sheet.as_ref().unwrap();
        for k in 1..200 {
            let t = k as f64 / 200.0 + 0.001;
            // The wake leaves the disk at t = 0.905, with a square root in
            // the curvature.
            let tolerance = if (t - 0.905).abs() < 0.03 { 1e-4 } else { 5e-6 };
            let (table, _) = sheet.evaluate(t);
            let [g11, g12, g21, g22, g33] = sheet_integrals(t, H, 1.0, Converged);
            let exact = [g11, g12 / t, g21 / t, 0.5 * (g22 + g33), 0.5 * (g22 - g33) / t];
            for c in 0..5 {
                assert!((table[c] - exact[c]).abs() < tolerance, "{t} {table:?} {exact:?}");
            }
        }
    }

    #[test]
    fn an_edgewise_wake_does_not_tell_above_from_below() {
        let (above, below) = (map(H, Converged), map(-H, Converged));
        let difference = above.evaluate([1.0, 0.0]).0 - below.evaluate([1.0, 0.0]).0;
        assert!(difference.amax() < 1e-5, "{difference}");
    }

    #[test]
    fn far_rotors_do_not_matter() {
        let mut geometry = coaxial(30.0);
        let near = Interference::new(&geometry, Converged).unwrap();
        assert!(near.evaluate([0.0, 0.0]).amax() < 1e-3);
        geometry.offset = Vector3::new(20.0, 15.0, 0.0);
        let aside = Interference::new(&geometry, Converged).unwrap();
        // Upwind, and not in line with the wake. The flow of the open
        // harmonic elements falls off with the distance only, that of closed
        // rings with its square.
        let g = aside.evaluate([-0.6, 0.0]);
        assert!(g.column(0).amax() < 2e-3 && g.amax() < 0.04, "{g}");
    }

    #[test]
    fn another_coaxial_size_keeps_the_flux() {
        // A receiver far larger than the wake catches all of its flux, that
        // is the flow times the area ratio.
        let below = CoaxialMap::new(-0.5, 6.0, Converged).unwrap();
        let above = CoaxialMap::new(0.5, 6.0, Converged).unwrap();
        let sum = below.evaluate([0.0, 0.0]).0[(0, 0)] + above.evaluate([0.0, 0.0]).0[(0, 0)];
        assert!((sum - 1.0 / 36.0).abs() < 1e-9);
    }

    fn rotation(angle: f64) -> Matrix3<f64> {
        let (s, c) = angle.sin_cos();
        Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
    }

    proptest! {
        #[test]
        fn turning_the_wind_turns_g(t in 0.0f64..1.0, at in 0.0f64..6.0, by in 0.0f64..6.0, up in any::<bool>()) {
            let m = &PAIR[if up { 0 } else { 1 }];
            let turned = m.evaluate([t * (at + by).cos(), t * (at + by).sin()]).0;
            let q = rotation(by);
            let expected = q * m.evaluate([t * at.cos(), t * at.sin()]).0 * q.transpose();
            prop_assert!((turned - expected).amax() < 1e-12);
        }

        #[test]
        fn partials_agree_with_differences(x in -0.7f64..0.7, y in -0.7f64..0.7, up in any::<bool>(), mirrored in any::<bool>()) {
            let pair = Interference(Map::Coaxial {
                map: PAIR[if up { 0 } else { 1 }].clone(),
                sine_sign: if mirrored { -1.0 } else { 1.0 },
            });
            let (g, by_x, by_y) = pair.evaluate_with_partials([x, y]);
            prop_assert_eq!(g, pair.evaluate([x, y]));
            let h = 1e-6;
            let dx = (pair.evaluate([x + h, y]) - pair.evaluate([x - h, y])) / (2.0 * h);
            let dy = (pair.evaluate([x, y + h]) - pair.evaluate([x, y - h])) / (2.0 * h);
            // A node of the table within ±h leaves h times a jump of
            // curvature.
            prop_assert!((by_x - dx).amax() < 2e-5, "{}", by_x - dx);
            prop_assert!((by_y - dy).amax() < 2e-5, "{}", by_y - dy);
        }
    }

    #[test]
    fn hover_has_no_kink() {
        let m = map(-H, Converged);
        let (_, by_a, by_r) = m.evaluate([0.0, 0.0]);
        for (i, j) in [(0, 0), (1, 1), (2, 2), (1, 2)] {
            assert!(by_a[(i, j)].abs() < 1e-12 && by_r[(i, j)].abs() < 1e-12);
        }
        let (_, near, _) = m.evaluate([1e-7, 0.0]);
        assert!((near - by_a).amax() < 1e-4);
    }

    #[test]
    fn a_wake_that_leans_aft_loads_the_rear_of_a_disk_above() {
        let pair = Interference::new(&coaxial(H), Converged).unwrap();
        let g = pair.evaluate([-0.5, 0.0]);
        // Azimuth 0 is aft.
        assert!(g[(1, 0)] > 0.1 && g[(2, 0)].abs() < 1e-12);
        let g = pair.evaluate([0.0, 0.5]);
        assert!(g[(2, 0)] > 0.1 && g[(1, 0)].abs() < 1e-12);
    }

    #[test]
    fn opposite_rotation_changes_the_sign_of_the_sine_row() {
        let mut geometry = coaxial(-H);
        let same = Interference::new(&geometry, Converged).unwrap();
        geometry.receiver_mirrored = true;
        let opposite = Interference::new(&geometry, Converged).unwrap();
        geometry.source_mirrored = true;
        let both = Interference::new(&geometry, Converged).unwrap();
        let x = [-0.4, 0.2];
        let flip = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
        assert_eq!(opposite.evaluate(x), flip * same.evaluate(x));
        assert_eq!(both.evaluate(x), same.evaluate(x));
    }

    /// A tandem pair: receiver behind, above and a little to the right.
    fn tandem() -> DiskGeometry {
        DiskGeometry {
            offset: Vector3::new(-1.4, 0.3, -0.25),
            receiver_radius: 0.9,
            receiver_axes: *nalgebra::Rotation3::from_euler_angles(0.05, -0.1, 0.0).matrix(),
            ..coaxial(0.0)
        }
    }

    #[test]
    fn a_mirrored_vehicle_has_the_same_interference() {
        let geometry = tandem();
        let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        let mirrored = DiskGeometry {
            offset: flip * geometry.offset,
            receiver_axes: flip * geometry.receiver_axes * flip,
            source_mirrored: true,
            receiver_mirrored: true,
            ..geometry.clone()
        };
        let (a, b) = (
            Interference::new(&geometry, Converged).unwrap(),
            Interference::new(&mirrored, Converged).unwrap(),
        );
        for x in [[0.0, 0.0], [-0.6, 0.1], [0.2, -0.7]] {
            assert!((a.evaluate(x) - b.evaluate(x)).amax() < 1e-13);
        }
    }

    #[test]
    fn the_general_table_follows_its_integrals() {
        let geometry = tandem();
        let pair = Interference::new(&geometry, Converged).unwrap();
        let points = disk_points(&geometry, Converged);
        let rim = cored_rim(GENERAL_CORE);
        for k in 0..60 {
            // Points of the sunflower on the unit disk.
            let (t, angle) = ((k as f64 / 60.0).sqrt(), 2.399963 * k as f64);
            let x = [t * angle.cos(), t * angle.sin()];
            let direct = general_matrix(&points, [-x[0], x[1]], &rim);
            let direct = Matrix3::from_row_slice(&direct);
            let error = (pair.evaluate(x) - direct).amax();
            assert!(error < 0.02, "{x:?} {error}");
        }
    }

    #[test]
    fn the_general_way_agrees_with_the_coaxial_one() {
        for height in [H, -H, 1.0, -1.0] {
            let geometry = coaxial(height);
            let points = disk_points(&geometry, Converged);
            let exact = map(height, Converged);
            for x in [[0.0, 0.0], [0.2, 0.1], [-0.5, 0.3], [0.3, -0.9]] {
                let direct = general_matrix(&points, x, &cored_rim(GENERAL_CORE));
                let error = (Matrix3::from_row_slice(&direct) - exact.evaluate(x).0).amax();
                assert!(error < 1.5 * GENERAL_CORE, "{height} {x:?} {error}");
            }
        }
    }

    #[test]
    fn the_wash_averages_to_the_first_row_of_g() {
        let geometry = tandem();
        let cosine = geometry.receiver_axes[(2, 2)];
        let x = [-0.55, 0.12];
        let mut average = [0.0; 3];
        for (r, dr) in gauss_legendre(0.0, 1.0, 4) {
            for (cos, sin) in periodic_nodes(12) {
                let arm = geometry.receiver_axes * Vector3::new(-cos, sin, 0.0) * (0.9 * r);
                let wash =
                    PointWash::new(1.0, &(geometry.offset + arm), GENERAL_CORE, false).unwrap();
                let w = wash.evaluate(x);
                for c in 0..3 {
                    average[c] += cosine * w[c] * 2.0 * r * dr / 12.0;
                }
            }
        }
        let g = Interference::new(&geometry, Converged).unwrap().evaluate(x);
        for c in 0..3 {
            assert!((average[c] - g[(0, c)]).abs() < 0.01, "{average:?} {g}");
        }
    }

    #[test]
    fn wash_below_a_hovering_rotor_doubles_downstream() {
        let wash = |down: f64| {
            let point = Vector3::new(-0.2, 0.3, down) * 3.0;
            PointWash::new(3.0, &point, 0.05, false).unwrap()
        };
        // Twice w is the flow over that of the disk.
        assert!((2.0 * wash(6.0).evaluate([0.0, 0.0])[0] - 2.0).abs() < 0.02);
        assert!(2.0 * wash(-6.0).evaluate([0.0, 0.0])[0] < 0.02);
        let near = wash(0.5);
        let [value, by_x, by_y] = near.evaluate_with_partials([-0.31, 0.12]);
        assert_eq!(value, near.evaluate([-0.31, 0.12]));
        let h = 1e-6;
        for c in 0..3 {
            let dx = near.evaluate([-0.31 + h, 0.12])[c] - near.evaluate([-0.31 - h, 0.12])[c];
            let dy = near.evaluate([-0.31, 0.12 + h])[c] - near.evaluate([-0.31, 0.12 - h])[c];
            assert!((by_x[c] - dx / (2.0 * h)).abs() < 1e-7);
            assert!((by_y[c] - dy / (2.0 * h)).abs() < 1e-7);
        }
    }

    #[test]
    fn bad_geometry_is_refused_in_words() {
        let refuse = |geometry: DiskGeometry| {
            Interference::new(&geometry, Converged).unwrap_err().to_string()
        };
        assert_eq!(
            refuse(coaxial(0.001)),
            "the disks are 0.001 source radii apart; coaxial disks need at least 0.02"
        );
        assert_eq!(
            refuse(DiskGeometry { receiver_radius: -1.0, ..coaxial(0.5) }),
            "the receiver radius is -1 m; it must be positive and finite"
        );
        assert_eq!(
            refuse(DiskGeometry { receiver_axes: Matrix3::identity() * 2.0, ..coaxial(0.5) }),
            "the attitude of the receiver is not finite or not a rotation"
        );
        let error = PointWash::new(1.0, &Vector3::zeros(), 0.0, false).unwrap_err();
        assert_eq!(error, GeometryError::Core { value: 0.0 });
    }
}
