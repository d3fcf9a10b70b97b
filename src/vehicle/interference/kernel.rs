//! Flow of skewed vortex cylinders at a point (see the theory of
//! [`interference`](super)).

use nalgebra::Vector3;
use num_complex::Complex64;

use crate::numerics::quadrature::periodic_nodes;

/// Sine and cosine of the skew angle from |**X**| = tan(χ/2).
#[inline]
pub(super) fn skew(t: f64) -> (f64, f64) {
    let d = 1.0 + t * t;
    (2.0 * t / d, (1.0 - t * t) / d)
}

/// Flow down the shaft at a point (x, y, z up) for unit circulation uniform,
/// cos and sin around the rim, with a core of squared radius `core2`:
/// ¹⁄₄π ∮ K (1, c, s) dψ_v. The wake runs along (`lean`, −`cos_chi`), where
/// `lean` is sin χ downstream; azimuth is from x towards y.
#[inline]
pub(super) fn rim_average(
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

/// Flow of the infinite cylinder at p (see the module's text).
pub(super) fn sheet_flow(p: Complex64, sin_chi: f64, cos_chi: f64, inside: bool) -> [f64; 3] {
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

/// Flow down the shaft at a point (aft, right, up), at the skew with
/// components aft and right. The core rounds the rim, and the edge of the
/// sheet below it fades over one core radius outward.
pub(super) fn cored_flow(
    point: [f64; 3],
    skew: [f64; 2],
    core: f64,
    rim: &[(f64, f64)],
) -> [f64; 3] {
    let leaning = Leaning::new(skew);
    let near = leaning.rim_part(point, core, rim);
    let sheet = leaning.sheet_part(point, core);
    [0, 1, 2].map(|k| sheet[k] + near[k])
}

/// A wake that leans.
pub(super) struct Leaning {
    /// Downstream, aft and right.
    direction: [f64; 2],
    sin_chi: f64,
    cos_chi: f64,
}

impl Leaning {
    /// At the skew with components aft and right.
    pub(super) fn new(skew: [f64; 2]) -> Self {
        // Beyond edgewise the wake stays edgewise.
        let t = skew[0].hypot(skew[1]).min(1.0);
        let (sin_chi, cos_chi) = self::skew(t);
        let direction = if t > 0.0 {
            let length = skew[0].hypot(skew[1]);
            skew.map(|v| v / length)
        } else {
            [1.0, 0.0]
        };
        Self { direction, sin_chi, cos_chi }
    }

    /// What is smooth away from the rim: all of the flow above the disk, and
    /// below it that of the upper half that the infinite cylinder has too many.
    pub(super) fn rim_part(&self, point: [f64; 3], core: f64, rim: &[(f64, f64)]) -> [f64; 3] {
        let lean = self.direction.map(|v| v * self.sin_chi);
        let [a, r, up] = point;
        if up >= 0.0 {
            return rim_average(point, lean, self.cos_chi, core * core, rim);
        }
        let upper = lean.map(|v| -v);
        rim_average([a, r, -up], upper, self.cos_chi, core * core, rim).map(|flow| -flow)
    }

    /// Flow of the infinite cylinder below the disk, whose sheet fades over
    /// `edge` outward; none above.
    pub(super) fn sheet_part(&self, [a, r, up]: [f64; 3], edge: f64) -> [f64; 3] {
        let Self { direction, sin_chi, cos_chi } = *self;
        if up >= 0.0 {
            return [0.0; 3];
        }
        let [x, y] = [a * direction[0] + r * direction[1], r * direction[0] - a * direction[1]];
        let p = Complex64::new(cos_chi * x + up * sin_chi, y);
        // Distance from the cylinder's axis in the plane of the point.
        let from_axis = if cos_chi > 0.0 { (p.re / cos_chi).hypot(y) } else { f64::INFINITY };
        let beyond = ((from_axis - 1.0) / edge).clamp(0.0, 1.0);
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
            sheet[0],
            sheet[1] * direction[0] - sheet[2] * direction[1],
            sheet[1] * direction[1] + sheet[2] * direction[0],
        ]
    }
}

/// Rim azimuths enough for a core of this radius: they leave about 1e-5.
pub(super) fn cored_rim(core: f64) -> Vec<(f64, f64)> {
    periodic_nodes((12.0 / core).ceil() as usize + 16)
}

/// Equally spaced skew components from −1 to 1.
pub(super) fn skew_axis(cells: usize) -> Vec<f64> {
    (0..=cells).map(|k| -1.0 + 2.0 * k as f64 / cells as f64).collect()
}

/// A point in source axes (x forward, y right, z down) as aft, right and up
/// in the source's own axes, in source radii.
pub(super) fn own_axes(point: &Vector3<f64>, radius: f64, mirrored: bool) -> [f64; 3] {
    let side = if mirrored { -1.0 } else { 1.0 };
    [-point.x / radius, side * point.y / radius, -point.z / radius]
}
