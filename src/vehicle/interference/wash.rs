//! Flow that a rotor's wake induces at a point: for wings and bodies.

use nalgebra::Vector3;

use super::GeometryError;
use super::kernel::{cored_flow, cored_rim, own_axes, skew_axis};
use crate::numerics::interpolation::{Bicubic, Ends};

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
