//! Fuselage loads: equivalent flat plates, or tables of angle of attack and
//! sideslip.

use crate::numerics::scalar::{Scalar, Vec3};
use crate::problem::{self, FuselageAerodynamics, FuselageTable, Wash};
use crate::vehicle::atmosphere::Air;
use crate::vehicle::frames::position_body;
use crate::vehicle::wing::washed;
use std::sync::Arc;

/// A fuselage of the vehicle model.
#[derive(Debug, Clone)]
pub struct Fuselage {
    /// Name in the problem file.
    pub name: String,
    /// Where its forces act, from the centre of gravity, body frame, m.
    pub position_body: [f64; 3],
    /// Rotor wash on it.
    pub wash: Wash,
    drag: Drag,
}

#[derive(Debug, Clone)]
enum Drag {
    /// ½ρ S C_D on each body axis, kg/m.
    Plates([f64; 3]),
    /// Loads per dynamic pressure, and ½ρ.
    Table(Arc<FuselageTable>, f64),
}

impl Fuselage {
    /// The fuselage of a problem in the given air.
    #[must_use]
    pub fn new(
        fuselage: &problem::Fuselage,
        center_of_gravity: &problem::Station,
        air: &Air,
    ) -> Self {
        let drag = match &fuselage.aerodynamics {
            FuselageAerodynamics::FlatPlate { area, drag_coefficient } => Drag::Plates(
                [0, 1, 2].map(|axis| 0.5 * air.density * area[axis] * drag_coefficient[axis]),
            ),
            FuselageAerodynamics::Table(table) => Drag::Table(Arc::clone(table), 0.5 * air.density),
        };
        Self {
            name: fuselage.name.clone(),
            position_body: position_body(&fuselage.position, center_of_gravity),
            wash: fuselage.wash,
            drag,
        }
    }

    /// Force and moment about the centre of gravity, body frame, N and N m.
    #[inline(always)]
    pub fn loads<S: Scalar>(
        &self,
        velocity_body: Vec3<S>,
        rate_body: Vec3<S>,
        wash: Option<Vec3<S>>,
    ) -> (Vec3<S>, Vec3<S>) {
        let free = velocity_body + rate_body.cross_constant(self.position_body);
        let local = match wash {
            Some(air) => washed(free, air, self.wash),
            None => free,
        };
        let (force, moment) = match &self.drag {
            Drag::Plates(k) => {
                let plate = |axis: usize| local.0[axis] * local.0[axis].abs() * -k[axis];
                (Vec3([plate(0), plate(1), plate(2)]), Vec3::default())
            }
            Drag::Table(table, half_density) => tabulated(table, *half_density, local),
        };
        (force, moment - force.cross_constant(self.position_body))
    }
}

/// Loads from the tables; still air makes none.
fn tabulated<S: Scalar>(
    table: &FuselageTable,
    half_density: f64,
    velocity: Vec3<S>,
) -> (Vec3<S>, Vec3<S>) {
    let [u, v, w] = velocity.0;
    let speed2 = velocity.dot(velocity);
    if speed2.value() == 0.0 {
        return (Vec3::default(), Vec3::default());
    }
    let alpha = w.atan2(u);
    let sideslip = (v / speed2.sqrt()).asin();
    let pressure = speed2 * half_density;
    let mut load = [S::default(); 6];
    for (index, grid) in table.loads.iter().enumerate() {
        let (value, by_alpha, by_sideslip) =
            bicubic(&table.angle_of_attack, &table.sideslip, grid, alpha.value(), sideslip.value());
        load[index] = S::chain(value, &[by_alpha, by_sideslip], &[alpha, sideslip]) * pressure;
    }
    let [fx, fy, fz, mx, my, mz] = load;
    (Vec3([fx, fy, fz]), Vec3([mx, my, mz]))
}

/// Value and partials of a cubic-Hermite surface through a grid `[a][b]`,
/// constant beyond its edges. Few points, seldom asked: built on the fly.
fn bicubic(a_grid: &[f64], b_grid: &[f64], values: &[f64], a: f64, b: f64) -> (f64, f64, f64) {
    let (n, m) = (a_grid.len(), b_grid.len());
    let row = |i: usize| hermite(b_grid, |j| values[i * m + j], b);
    let (value, by_a) = hermite(a_grid, |i| row(i).0, a);
    let (by_b, _) = hermite(a_grid, |i| row(i).1, a);
    debug_assert!(n > 0 && m > 0);
    (value, by_a, by_b)
}

/// Value and slope of a C1 cubic through `(grid[i], value(i))` with parabolic
/// slopes, constant beyond the ends.
fn hermite(grid: &[f64], value: impl Fn(usize) -> f64, x: f64) -> (f64, f64) {
    let n = grid.len();
    if n == 1 {
        return (value(0), 0.0);
    }
    if x <= grid[0] {
        return (value(0), 0.0);
    }
    if x >= grid[n - 1] {
        return (value(n - 1), 0.0);
    }
    // Not a number stands before all points, and stays not a number.
    let i = grid.partition_point(|&g| g <= x).max(1) - 1;
    let h = grid[i + 1] - grid[i];
    let secant = |k: usize| (value(k + 1) - value(k)) / (grid[k + 1] - grid[k]);
    // Flat at the ends, so that the clamped continuation is smooth.
    let slope = |k: usize| {
        if k == 0 || k == n - 1 {
            0.0
        } else {
            let (h0, h1) = (grid[k] - grid[k - 1], grid[k + 1] - grid[k]);
            (h1 * secant(k - 1) + h0 * secant(k)) / (h0 + h1)
        }
    };
    let t = (x - grid[i]) / h;
    let (v0, v1, s0, s1) = (value(i), value(i + 1), slope(i) * h, slope(i + 1) * h);
    let (t2, t3) = (t * t, t * t * t);
    (
        v0 * (2.0 * t3 - 3.0 * t2 + 1.0)
            + s0 * (t3 - 2.0 * t2 + t)
            + v1 * (3.0 * t2 - 2.0 * t3)
            + s1 * (t3 - t2),
        (v0 * (6.0 * t2 - 6.0 * t)
            + s0 * (3.0 * t2 - 4.0 * t + 1.0)
            + v1 * (6.0 * t - 6.0 * t2)
            + s1 * (3.0 * t2 - 2.0 * t))
            / h,
    )
}
