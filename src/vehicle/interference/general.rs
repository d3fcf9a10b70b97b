//! Interference of disks in any other position: a table over both components
//! of the skew.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::coaxial::radial_rule;
use super::kernel::{cored_flow, cored_rim, own_axes, skew_axis};
use super::{GENERAL_CORE, GeometryError};
use crate::numerics::interpolation::{Bicubic, Ends};
use crate::numerics::quadrature::periodic_nodes;
use crate::problem::InterferenceRule;

/// Cells of the general table along each component of the skew.
const GENERAL_CELLS: usize = 32;
/// Radii and azimuths over a disk that is not coaxial.
const GENERAL_POINTS: [usize; 2] = [8, 24];
/// Heights nearer to the plane of the source than this, in source radii, are in
/// it: rounding must not decide between the ways above and below it.
const LEVEL: f64 = 1e-9;

/// A disk as a source that turns counter-clockwise sees it, lengths in source
/// radii.
pub(super) struct SeenDisk {
    pub(super) radius: f64,
    /// Hub, axes x forward, y right, z down.
    pub(super) offset: Vector3<f64>,
    /// Hub axes as columns.
    pub(super) axes: Matrix3<f64>,
}

/// G over the components of the skew aft and right, row by row. `even`: the
/// disk is its own mirror image in the plane y = 0.
pub(super) fn general_map(
    disk: &SeenDisk,
    even: bool,
    rule: InterferenceRule,
) -> Result<Bicubic<9>, GeometryError> {
    let points = disk_points(disk, rule);
    let rims = Rims::new(&points);
    let axis = skew_axis(GENERAL_CELLS);
    // Mirrored skew makes the mirrored matrix: half of the table is enough.
    let from = if even { GENERAL_CELLS / 2 } else { 0 };
    let nodes: Vec<[f64; 2]> =
        axis.iter().flat_map(|&aft| axis[from..].iter().map(move |&right| [aft, right])).collect();
    let computed: Vec<[f64; 9]> =
        nodes.par_iter().map(|&skew| general_matrix(&points, skew, &rims)).collect();
    let width = axis.len() - from;
    let mut values = [const { Vec::new() }; 9];
    for row in computed.chunks(width) {
        for column in 0..axis.len() {
            let mirrored = column < from;
            let place = if mirrored { 2 * from - column } else { column };
            let g = &row[place - from];
            for (k, table) in values.iter_mut().enumerate() {
                let odd = matches!(k, 2 | 5 | 6 | 7);
                table.push(if mirrored && odd { -g[k] } else { g[k] });
            }
        }
    }
    let ends = [Ends::Parabolic; 2];
    let values: [&[f64]; 9] = std::array::from_fn(|k| &values[k][..]);
    Ok(Bicubic::new(&axis, &axis, values, ends)?)
}

/// A quadrature point on the receiver: place (aft, right, up) in the source's
/// own axes, and its weights in the three rows of G.
pub(super) struct DiskPoint {
    place: [f64; 3],
    weight: [f64; 3],
}

pub(super) fn disk_points(disk: &SeenDisk, rule: InterferenceRule) -> Vec<DiskPoint> {
    let [along, around] = GENERAL_POINTS;
    // Only the component along the receiver's shaft passes its disk.
    let cosine = disk.axes[(2, 2)];
    let mut points = Vec::new();
    for (r, dr) in radial_rule(1.0, rule, along) {
        for (cos, sin) in periodic_nodes(around) {
            let arm = disk.axes * Vector3::new(-cos, sin, 0.0) * (r * disk.radius);
            let weight = cosine * 2.0 * r * dr / around as f64;
            let [aft, right, up] = own_axes(&(disk.offset + arm), 1.0, false);
            let up = if up.abs() < LEVEL { 0.0 } else { up };
            points.push(DiskPoint {
                place: [aft, right, up],
                weight: [weight, 4.0 * weight * r * cos, 4.0 * weight * r * sin],
            });
        }
    }
    points
}

/// Rim azimuths, few where the wake is far from the point and as many as its
/// core asks for where it is near.
pub(super) struct Rims {
    sizes: Vec<Vec<(f64, f64)>>,
}

impl Rims {
    /// Factor from one size to the next.
    const STEP: f64 = 1.25;

    pub(super) fn new(points: &[DiskPoint]) -> Self {
        let farthest = points.iter().map(|point| from_rim(point.place)).fold(0.0, f64::max);
        let mut sizes = Vec::new();
        let mut distance = GENERAL_CORE;
        while distance < Self::STEP * farthest.max(GENERAL_CORE) {
            sizes.push(cored_rim(distance));
            distance *= Self::STEP;
        }
        Self { sizes }
    }

    /// As many azimuths everywhere as beside the wake.
    #[cfg(test)]
    pub(super) fn of_core_only() -> Self {
        Self { sizes: vec![cored_rim(GENERAL_CORE)] }
    }

    /// The rim for a point that is no nearer to the wake's sheet than `distance`.
    /// The integrand is analytic in a strip as wide as the core and that distance
    /// together.
    fn at(&self, distance: f64) -> &[(f64, f64)] {
        let wide = GENERAL_CORE.hypot(distance);
        let size = ((wide / GENERAL_CORE).ln() / Self::STEP.ln()).floor() as usize;
        &self.sizes[size.min(self.sizes.len() - 1)]
    }
}

/// Distance of a point from the rim of the source.
fn from_rim([aft, right, up]: [f64; 3]) -> f64 {
    (aft.hypot(right) - 1.0).hypot(up)
}

/// No less than this is a point (above, or seen above) from every generator of a
/// wake with this skew angle: a generator starts at the rim, no nearer than the
/// rim itself, and slopes down.
fn from_wake([aft, right, up]: [f64; 3], sin_chi: f64, cos_chi: f64) -> f64 {
    let beside = (aft.hypot(right) - 1.0).abs();
    let height = up.abs();
    beside.hypot(height).min(beside * cos_chi + height * sin_chi)
}

/// G, row by row, at a skew with components aft and right.
pub(super) fn general_matrix(points: &[DiskPoint], skew: [f64; 2], rims: &Rims) -> [f64; 9] {
    let (sin_chi, cos_chi) = super::kernel::skew(skew[0].hypot(skew[1]).min(1.0));
    let mut g = [0.0; 9];
    for point in points {
        let rim = rims.at(from_wake(point.place, sin_chi, cos_chi));
        let w = cored_flow(point.place, skew, GENERAL_CORE, rim);
        for row in 0..3 {
            for column in 0..3 {
                g[3 * row + column] += point.weight[row] * w[column];
            }
        }
    }
    g
}
