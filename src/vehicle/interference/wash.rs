//! Flow that a rotor's wake induces at a point: for wings and bodies.

use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::Arc;

use super::GeometryError;
use super::kernel::{cored_flow, cored_rim, own_axes, skew_axis};
use crate::numerics::interpolation::{Bicubic, Ends};

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
    /// Whether the source turns clockwise seen from above.
    pub source_mirrored: bool,
}

impl SeenPoint {
    /// Aft, right and up in the source's own axes, in source radii.
    fn place(&self) -> Result<[f64; 3], GeometryError> {
        if !(self.source_radius > 0.0 && self.source_radius.is_finite()) {
            return Err(GeometryError::Radius { which: "source", value: self.source_radius });
        }
        if !self.point.iter().all(|v| v.is_finite()) {
            return Err(GeometryError::Placement { what: "position" });
        }
        Ok(own_axes(&self.point, self.source_radius, self.source_mirrored))
    }
}

impl PointWash {
    /// Cells along each component of the skew.
    const CELLS: usize = 32;

    /// Tabulates the wash at a point. `core` is the core radius of the wake in
    /// source radii: ρ² grows by its square.
    ///
    /// # Errors
    /// When radius, point or core make no sense: see [`GeometryError`].
    pub fn new(seen: &SeenPoint, core: f64) -> Result<Self, GeometryError> {
        Self::of_all(std::slice::from_ref(seen), core)
            .map(|mut all| all.remove(0))
            .map_err(|(_, error)| error)
    }

    /// Tabulates the wash at many points, in parallel; points that their sources
    /// see at the same place share a table.
    ///
    /// # Errors
    /// The place of the first point that cannot be treated, and why.
    pub fn of_all(points: &[SeenPoint], core: f64) -> Result<Vec<Self>, (usize, GeometryError)> {
        if !(0.01..=1.0).contains(&core) {
            return Err((0, GeometryError::Core { value: core }));
        }
        let mut distinct: Vec<[f64; 3]> = Vec::new();
        let mut shared = Vec::with_capacity(points.len());
        for (index, seen) in points.iter().enumerate() {
            let place = seen.place().map_err(|error| (index, error))?;
            shared.push(distinct.iter().position(|other| *other == place).unwrap_or_else(|| {
                distinct.push(place);
                distinct.len() - 1
            }));
        }
        let built: Vec<_> = distinct.par_iter().map(|&place| Self::at(place, core)).collect();
        let tables =
            built.into_iter().collect::<Result<Vec<_>, _>>().map_err(|error| (0, error))?;
        Ok(shared.into_iter().map(|table| tables[table].clone()).collect())
    }

    fn at(place: [f64; 3], core: f64) -> Result<Self, GeometryError> {
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
        Ok(Self(Arc::new(Bicubic::new(&axis, &axis, [a, b, c], ends)?)))
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
