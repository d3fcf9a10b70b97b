//! Flow that a rotor's wake induces at a point: for wings and bodies.

use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::Arc;

use super::GeometryError;
use super::kernel::{Leaning, cored_flow, cored_rim, own_axes, skew_axis};
use crate::numerics::interpolation::{Bicubic, Ends};
use crate::numerics::quadrature::gauss_legendre;

/// Flow that a rotor's wake induces at a point, along the rotor's shaft,
/// tabulated over the skew: for wings and bodies.
///
/// The same circulation that G maps to a disk's inflow ratio is mapped to the
/// inflow ratio at the point; over a disk its average is the first row of G.
#[derive(Debug, Clone)]
pub struct PointWash(Arc<Bicubic<3>>);

/// A point as a source sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenPoint {
    /// Radius of the source, m.
    pub source_radius: f64,
    /// The point from the source's hub in the source's hub axes (x forward, y
    /// right, z down), m.
    pub point: Vector3<f64>,
    /// Half of the span over which the wash is averaged, from the point to a tip,
    /// same axes, m; zero for a point.
    pub half_span: Vector3<f64>,
    /// Whether the source turns clockwise seen from above.
    pub source_mirrored: bool,
}

/// How a wake rounds off: lengths in source radii.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WashWidth {
    /// Core radius of the rim: ρ² grows by its square.
    pub core: f64,
    /// Half-width of the wake's edge, over which the wash is averaged in the
    /// plane of the source's disk, together with the span; zero for the wash at
    /// the point itself.
    pub edge: f64,
}

/// A place of [`SeenPoint`] and its half-span in the source's own axes, in
/// source radii.
type Place = [[f64; 3]; 2];

/// Points along a span at which the wash is averaged.
const SPAN_POINTS: usize = 4;

/// Offsets (aft, right) over the edge's width and their weights: a hexagon of
/// 19 points that a bell weighs.
fn spread(edge: f64) -> Vec<([f64; 2], f64)> {
    let step = 0.5 * edge;
    let mut points = Vec::new();
    let mut total = 0.0;
    for row in -2_i32..=2 {
        for column in -2_i32..=2 {
            if (row + column).abs() > 2 {
                continue;
            }
            let (x, y) =
                (f64::from(column) + 0.5 * f64::from(row), f64::from(row) * 0.75_f64.sqrt());
            let weight = 1.0 - (x * x + y * y) / 9.0;
            total += weight;
            points.push(([x * step, y * step], weight));
        }
    }
    for (_, weight) in &mut points {
        *weight /= total;
    }
    points
}

impl SeenPoint {
    /// Aft, right and up in the source's own axes, in source radii.
    fn place(&self) -> Result<Place, GeometryError> {
        if !(self.source_radius > 0.0 && self.source_radius.is_finite()) {
            return Err(GeometryError::Radius { which: "source", value: self.source_radius });
        }
        if !self.point.iter().chain(&self.half_span).all(|v| v.is_finite()) {
            return Err(GeometryError::Placement { what: "position" });
        }
        Ok([&self.point, &self.half_span]
            .map(|vector| own_axes(vector, self.source_radius, self.source_mirrored)))
    }
}

impl PointWash {
    /// Cells along each component of the skew.
    const CELLS: usize = 32;

    /// Tabulates the wash at a point.
    ///
    /// # Errors
    /// When radius, point or core make no sense: see [`GeometryError`].
    pub fn new(seen: &SeenPoint, width: WashWidth) -> Result<Self, GeometryError> {
        Self::of_all(std::slice::from_ref(seen), width)
            .map(|mut all| all.remove(0))
            .map_err(|(_, error)| error)
    }

    /// Tabulates the wash at many points, in parallel; points that their sources
    /// see at the same place share a table.
    ///
    /// # Errors
    /// The place of the first point that cannot be treated, and why.
    pub fn of_all(
        points: &[SeenPoint],
        width: WashWidth,
    ) -> Result<Vec<Self>, (usize, GeometryError)> {
        let core = width.core;
        if !(0.01..=1.0).contains(&core) {
            return Err((0, GeometryError::Core { value: core }));
        }
        let mut distinct: Vec<Place> = Vec::new();
        let mut shared = Vec::with_capacity(points.len());
        for (index, seen) in points.iter().enumerate() {
            let place = seen.place().map_err(|error| (index, error))?;
            shared.push(distinct.iter().position(|other| *other == place).unwrap_or_else(|| {
                distinct.push(place);
                distinct.len() - 1
            }));
        }
        let built: Vec<_> = distinct.par_iter().map(|&place| Self::at(place, width)).collect();
        let tables =
            built.into_iter().collect::<Result<Vec<_>, _>>().map_err(|error| (0, error))?;
        Ok(shared.into_iter().map(|table| tables[table].clone()).collect())
    }

    fn at([middle, half]: Place, width: WashWidth) -> Result<Self, GeometryError> {
        let WashWidth { core, edge } = width;
        let rim = cored_rim(core);
        let spread = spread(edge);
        let stations: Vec<([f64; 3], f64)> = if half == [0.0; 3] {
            vec![(middle, 1.0)]
        } else {
            gauss_legendre(-1.0, 1.0, SPAN_POINTS)
                .into_iter()
                .map(|(t, dt)| ([0, 1, 2].map(|k| middle[k] + t * half[k]), 0.5 * dt))
                .collect()
        };
        let flow = |skew: [f64; 2]| {
            if edge == 0.0 {
                return cored_flow(middle, skew, core, &rim);
            }
            let leaning = Leaning::new(skew);
            let mut total = [0.0; 3];
            let mut add = |flow: [f64; 3], weight: f64| {
                for (total, flow) in total.iter_mut().zip(flow) {
                    *total += weight * flow;
                }
            };
            for &(point, share) in &stations {
                add(leaning.rim_part(point, core, &rim), share);
                for &([aft, right], weight) in &spread {
                    let near = [point[0] + aft, point[1] + right, point[2]];
                    // Fades that meet leave no steps between the points.
                    add(leaning.sheet_part(near, core.max(0.5 * edge)), share * weight);
                }
            }
            total
        };
        let axis = skew_axis(Self::CELLS);
        let mut values = [const { Vec::new() }; 3];
        for &x in &axis {
            for &y in &axis {
                let w = flow([-x, y]);
                for (table, w) in values.iter_mut().zip(w) {
                    table.push(w);
                }
            }
        }
        let [a, b, c] = &values;
        let ends = [Ends::Parabolic; 2];
        // What has a width bears splines, whose derivatives have no kinks; a sharp
        // edge would make them ring.
        let table = if edge > 0.0 {
            Bicubic::spline(&axis, &axis, [a, b, c], ends)?
        } else {
            Bicubic::new(&axis, &axis, [a, b, c], ends)?
        };
        Ok(Self(Arc::new(table)))
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
