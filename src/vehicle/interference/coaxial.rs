//! Interference of coaxial, parallel disks: five functions of the size of the
//! skew.

use nalgebra::Matrix3;
use num_complex::Complex64;
use std::f64::consts::PI;

use super::kernel::{rim_average, sheet_flow, skew};
use super::{GeometryError, WAKE_EDGE, WithPartials};
use crate::numerics::interpolation::{CubicHermite, Ends, GridError, UniformTable};
use crate::numerics::quadrature::{gauss_legendre, periodic_nodes};
use crate::problem::InterferenceRule;

/// Two coaxial disks nearer than this, in source radii, are refused.
pub(super) const LEAST_SEPARATION: f64 = 0.02;

/// G11, G12, G21, G22 and G33 in wind axes, or the five functions of skew
/// that make up G: G11, G12/|X|, G21/|X|, (G22 + G33)/2 and (G22 − G33)/2
/// over |X| or |X|².
pub(super) type Wind = [f64; 5];

/// G of coaxial, parallel disks: rotational symmetry leaves functions of
/// |**X**| only.
#[derive(Debug, Clone)]
pub(super) struct CoaxialMap {
    /// Semi-infinite wake seen from above, the same at every skew; the last
    /// function over |X|².
    pub(super) above: Wind,
    /// Infinite cylinder, for a receiver below.
    pub(super) sheet: Option<Sheet>,
}

impl CoaxialMap {
    /// Disks `height` apart (receiver above if positive), in source radii.
    pub(super) fn new(
        height: f64,
        radius: f64,
        rule: InterferenceRule,
    ) -> Result<Self, GeometryError> {
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
    pub(super) fn evaluate(&self, [a, r]: [f64; 2]) -> WithPartials {
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

/// The part of the infinite cylinder, the last function over |X|.
///
/// The wake crosses the plane of the receiver D = depth tan χ downstream, and
/// leaves its disk within a narrow range of skew. So the table runs over
/// v = D/(1 + D), which is smooth in |X| from 0 to 1.
#[derive(Debug, Clone)]
pub(super) struct Sheet {
    pub(super) depth: f64,
    pub(super) table: UniformTable<5>,
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
    pub(super) fn evaluate(&self, t: f64) -> (Wind, Wind) {
        let twice = 2.0 * self.depth;
        let per = 1.0 / (1.0 - t * t + twice * t);
        let slope = twice * (1.0 + t * t) * per * per;
        let (h, dh) = self.table.evaluate(twice * t * per);
        (h, dh.map(|d| d * slope))
    }
}

/// Radial nodes with weights dr over the receiver's disk of `radius`.
pub(super) fn radial_rule(radius: f64, rule: InterferenceRule, count: usize) -> Vec<(f64, f64)> {
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
pub(super) struct AboveRule {
    pub(super) height: f64,
    pub(super) radius: f64,
    pub(super) radii: Vec<(f64, f64)>,
    /// Disk azimuths over the half plane y ≥ 0; ends weigh half.
    pub(super) azimuths: Vec<(f64, f64)>,
    pub(super) rim: Vec<(f64, f64)>,
}

impl AboveRule {
    pub(super) fn new(height: f64, radius: f64, rule: InterferenceRule) -> Self {
        // The integrand is analytic in a strip about as wide as the disks
        // are apart. The counts leave 1e-9 (tests double them).
        let near = height.min(1.0);
        let around = 2 * ((11.0 / near).ceil() as usize + 8);
        let along = (4.5 / near.sqrt()).ceil() as usize + 10;
        Self::with_counts(height, radius, rule, along, around)
    }

    pub(super) fn with_counts(
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
    pub(super) fn functions(&self, t: f64) -> Wind {
        let [g11, g12, g21, g22, g33] = self.integrate(t);
        [g11, g12 / t, g21 / t, 0.5 * (g22 + g33), 0.5 * (g22 - g33) / (t * t)]
    }

    /// G11, G12, G21, G22, G33 in wind axes at |X| = t.
    pub(super) fn integrate(&self, t: f64) -> Wind {
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
pub(super) fn add_disk_moments(
    sum: &mut Wind,
    w: [f64; 3],
    r: f64,
    cos: f64,
    sin: f64,
    weight: f64,
) {
    sum[0] += weight * w[0];
    sum[1] += weight * w[1];
    sum[2] += weight * w[0] * r * cos;
    sum[3] += weight * w[1] * r * cos;
    sum[4] += weight * w[2] * r * sin;
}

/// Disk averages to rows of G: twice for 1/π ∫ r dr dψ = ∫ 2r dr/(2π) dψ, and
/// four times that average in the harmonic rows.
pub(super) fn finish(sum: Wind) -> Wind {
    [2.0 * sum[0], 2.0 * sum[1], 8.0 * sum[2], 8.0 * sum[3], 8.0 * sum[4]]
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
pub(super) fn sheet_integrals(t: f64, depth: f64, radius: f64, rule: InterferenceRule) -> Wind {
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
