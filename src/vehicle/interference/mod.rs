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
//! [`GENERAL_CORE`]. Turning a pair about the source's shaft turns G, a mirror
//! changes signs, and lengths count in source radii: so every pair has a
//! canonical place, and pairs with the same one share a table.
//!
//! # Smoothness in hover
//! When the receiver lies below a source of its own size, the smallest skew
//! takes a crescent of the disk out of the wake, whose area grows with |**X**|:
//! G has the tip of a cone at **X** = 0. A real wake has no sharp edge. The
//! tip is rounded by putting s/(s² + ε⁴)^¼ for |**X**| in the infinite
//! cylinder, with s = |**X**|² and ε = [`WAKE_EDGE`]. Hover itself is exact.

mod canonical;
mod coaxial;
mod general;
mod kernel;
#[cfg(test)]
mod tests;
mod wash;

pub use wash::{PointWash, SeenPoint, WashWidth};

use canonical::{Canonical, Placing};
use coaxial::{CoaxialMap, LEAST_SEPARATION};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::sync::Arc;
use thiserror::Error;

use crate::numerics::interpolation::{Bicubic, GridError};
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

/// Interference of a source on a receiver, tabulated over the skew.
///
/// Pairs that lie alike share one table: see [`Interference::of_all`].
#[derive(Debug, Clone)]
pub struct Interference {
    table: Arc<Map>,
    placing: Placing,
}

/// Tabulated where the pair has its canonical place.
#[derive(Debug)]
enum Map {
    Coaxial(CoaxialMap),
    General(Bicubic<9>),
}

/// G and its partial derivatives by the components of **X**.
pub type WithPartials = (Matrix3<f64>, Matrix3<f64>, Matrix3<f64>);

impl Interference {
    /// Tabulates the interference.
    ///
    /// # Errors
    /// When the geometry makes no sense: see [`GeometryError`].
    pub fn new(geometry: &DiskGeometry, rule: InterferenceRule) -> Result<Self, GeometryError> {
        let (canonical, placing) = Canonical::of(geometry)?;
        Ok(Self { table: Arc::new(canonical.tabulate(rule)?), placing })
    }

    /// Tabulates the interference of many pairs. Pairs that are alike but for a
    /// turn about the source's shaft, a mirror, the size, or the senses of
    /// rotation share one table; tables are built in parallel.
    ///
    /// # Errors
    /// The place of the first pair that cannot be treated, and why.
    pub fn of_all(
        geometries: &[DiskGeometry],
        rule: InterferenceRule,
    ) -> Result<Vec<Self>, (usize, GeometryError)> {
        let mut distinct: Vec<(usize, Canonical)> = Vec::new();
        let mut placed = Vec::with_capacity(geometries.len());
        for (pair, geometry) in geometries.iter().enumerate() {
            let (canonical, placing) = Canonical::of(geometry).map_err(|error| (pair, error))?;
            let place = distinct.iter().position(|(_, other)| other.is_like(&canonical));
            let place = place.unwrap_or_else(|| {
                distinct.push((pair, canonical));
                distinct.len() - 1
            });
            placed.push((place, placing));
        }
        let build = |(pair, canonical): &(usize, Canonical)| {
            canonical.tabulate(rule).map(Arc::new).map_err(|error| (*pair, error))
        };
        // All are built before one is asked, so that the error does not hang on
        // the order of threads.
        let built: Vec<_> = distinct.par_iter().map(build).collect();
        let tables = built.into_iter().collect::<Result<Vec<_>, _>>()?;
        let shared = |(place, placing): (usize, Placing)| Self {
            table: Arc::clone(&tables[place]),
            placing,
        };
        Ok(placed.into_iter().map(shared).collect())
    }

    /// Whether two pairs read one table.
    #[must_use]
    pub fn shares_table(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.table, &other.table)
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
        // Aft and right: the directions of azimuth 0 and 90°.
        let skew = [-x[0], x[1]];
        let placing = &self.placing;
        let (g, by_aft, by_right) = match &*self.table {
            Map::Coaxial(map) => {
                let (mut g, mut by_aft, mut by_right) = map.evaluate(skew);
                for m in [&mut g, &mut by_aft, &mut by_right] {
                    for column in 0..3 {
                        m[(2, column)] *= placing.sine_sign;
                    }
                }
                (g, by_aft, by_right)
            }
            Map::General(table) => {
                let [aft, right] = placing.skew(skew);
                let v = table.evaluate(aft, right);
                let [value, a, r] = [v.value, v.x, v.y].map(|m| placing.matrix(&m));
                let (by_aft, by_right) = placing.gradient(a, r);
                (value, by_aft, by_right)
            }
        };
        (g, -by_aft, by_right)
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
