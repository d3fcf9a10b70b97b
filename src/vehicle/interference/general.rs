//! Interference of disks in any other position: a table over both components
//! of the skew.

use nalgebra::Vector3;

use super::coaxial::radial_rule;
use super::kernel::{cored_flow, cored_rim, own_axes, skew_axis};
use super::{DiskGeometry, GENERAL_CORE, GeometryError};
use crate::numerics::interpolation::{Bicubic, Ends};
use crate::numerics::quadrature::periodic_nodes;
use crate::problem::InterferenceRule;

/// Cells of the general table along each component of the skew.
const GENERAL_CELLS: usize = 32;
/// Radii and azimuths over a disk that is not coaxial.
const GENERAL_POINTS: [usize; 2] = [8, 24];

/// G over both components of the skew, row by row.
pub(super) fn general_map(
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
pub(super) struct DiskPoint {
    place: [f64; 3],
    weight: [f64; 3],
}

pub(super) fn disk_points(geometry: &DiskGeometry, rule: InterferenceRule) -> Vec<DiskPoint> {
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
pub(super) fn general_matrix(points: &[DiskPoint], skew: [f64; 2], rim: &[(f64, f64)]) -> [f64; 9] {
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
