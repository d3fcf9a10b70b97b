//! Section aerodynamics from tables or analytic pairs.
//!
//! A [`Section`] gives lift and drag coefficients and their partial
//! derivatives at an angle of attack and a Mach number. It is continuous with
//! its first derivatives everywhere, the seam at ±180° included, so that the
//! Jacobians of trim have no kinks.
//!
//! Tables are bicubic ([`crate::numerics::interpolation::Bicubic`]): splines,
//! whose curvature is continuous too, so that integration along an orbit
//! converges fast. A coefficient whose spline would ring (leave its data by
//! more than a smooth extremum needs, or give a drag below zero) is
//! interpolated by a surface with limited slopes instead, which stays within
//! the data.
//!
//! Beyond the Mach numbers of a table its coefficients stay constant; the
//! surface meets the first and the last Mach number with zero slope so that
//! this leaves no kink. At Mach 0 that is also right: compressibility enters
//! with the square of the Mach number.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use crate::numerics::interpolation::{Bicubic, Ends, GridError};
use crate::problem::{Airfoil, CoefficientGrid, Polar};

/// Coefficients of a section and their partial derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Lift coefficient c_l.
    pub lift: f64,
    /// ∂c_l/∂α, 1/rad.
    pub lift_alpha: f64,
    /// ∂c_l/∂M.
    pub lift_mach: f64,
    /// Drag coefficient c_d.
    pub drag: f64,
    /// ∂c_d/∂α, 1/rad.
    pub drag_alpha: f64,
    /// ∂c_d/∂M.
    pub drag_mach: f64,
}

/// An airfoil section, ready for evaluation.
#[derive(Debug, Clone)]
pub struct Section {
    kind: Kind,
    limits: Arc<Limits>,
}

#[derive(Debug, Clone)]
enum Kind {
    /// Lift and drag side by side on one grid.
    Table(Bicubic<2>),
    /// Linear lift up to stall, a drag polar.
    Analytic(Line),
}

/// Linear lift, the drag polar δ_0 + δ_1 α + δ_2 α², and stall, over the angle
/// from zero lift.
#[derive(Debug, Clone, Copy)]
struct Line {
    lift_slope: f64,
    zero_lift_angle: f64,
    drag: f64,
    polar: Polar,
}

/// Half-width, rad, over which an analytic section goes from attached to
/// stalled.
const STALL_WIDTH: f64 = 0.05;
/// Normal force of a stalled section: a plate's lift is half of it times
/// sin 2α, as wind tunnels find at 45° on NACA 0012 (C. C. Critzos, NACA TN 3361).
const STALLED_NORMAL: f64 = 2.1;

impl Line {
    /// Lift, its slope, drag and its slope.
    #[inline(always)]
    fn coefficients(&self, alpha: f64) -> [f64; 4] {
        let off = alpha - self.zero_lift_angle;
        let (angle, slope) = plate_angle(off);
        let Polar { linear, quadratic, stall } = self.polar;
        let lift = self.lift_slope * angle;
        let lift_alpha = self.lift_slope * slope;
        let drag = self.drag + angle * (linear + quadratic * angle);
        let drag_alpha = (linear + 2.0 * quadratic * angle) * slope;
        let Some(stall) = stall else { return [lift, lift_alpha, drag, drag_alpha] };
        let folded = off - PI * (off / PI).round();
        let t = ((folded.abs() - stall) / STALL_WIDTH * 0.5 + 0.5).clamp(0.0, 1.0);
        let share = t * t * (3.0 - 2.0 * t);
        let share_alpha = (3.0 * t * (1.0 - t) / STALL_WIDTH).copysign(folded);
        let (s, c) = off.sin_cos();
        let plate_lift = STALLED_NORMAL * s * c;
        let plate_lift_alpha = STALLED_NORMAL * (c * c - s * s);
        let plate_drag = self.drag + STALLED_NORMAL * s * s;
        let plate_drag_alpha = 2.0 * STALLED_NORMAL * s * c;
        [
            lift + share * (plate_lift - lift),
            lift_alpha
                + share * (plate_lift_alpha - lift_alpha)
                + share_alpha * (plate_lift - lift),
            drag + share * (plate_drag - drag),
            drag_alpha
                + share * (plate_drag_alpha - drag_alpha)
                + share_alpha * (plate_drag - drag),
        ]
    }
}

/// How far the ends of a table may lie from ±180°, rad: decimal degrees
/// turned to radians, no more.
const SEAM_TOLERANCE: f64 = 1e-6;

/// Most that a spline may leave the range of a cell's corners, relative to the
/// range of the nodes around the cell. A smooth extremum between two nodes
/// needs some; a kink or a mistyped entry makes a spline ring by more.
const MOST_OVERSHOOT: f64 = 0.2;

/// End rules in angle of attack and in Mach number.
const ENDS: [Ends; 2] = [Ends::Periodic, Ends::Flat];

impl Section {
    /// Prepares a section.
    ///
    /// A table must run from −180° to 180°. Its two ends are one angle; where
    /// their values differ, their mean is used. Lift and drag may have
    /// different grids: both surfaces are then divided at the breakpoints of
    /// either, which leaves them as they are.
    ///
    /// # Errors
    /// When a grid is not one: see [`GridError`].
    pub fn new(airfoil: &Airfoil) -> Result<Self, GridError> {
        match airfoil {
            Airfoil::Table(table) => {
                let lift = surface(&periodic(&table.lift)?)?;
                let drag = periodic(&table.drag)?;
                let smooth = surface(&drag)?;
                let drag = if smooth.is_positive() { smooth } else { within_data(&drag)? };
                Ok(Self::limited(Kind::Table(Bicubic::join([&lift, &drag]))))
            }
            &Airfoil::Analytic { lift_slope, zero_lift_angle, drag, polar, .. } => {
                Ok(Self::limited(Kind::Analytic(Line { lift_slope, zero_lift_angle, drag, polar })))
            }
        }
    }

    /// A section with its limits.
    fn limited(kind: Kind) -> Self {
        let mut section = Self { kind, limits: Arc::default() };
        section.limits = Arc::new(match section.kind {
            Kind::Table(_) => Limits::of(&section),
            Kind::Analytic(Line { zero_lift_angle, polar, .. }) => {
                let reach = polar.stall.unwrap_or(ASSUMED_STALL);
                Limits {
                    stall: vec![[zero_lift_angle - reach, zero_lift_angle + reach]; STALL_MACHS],
                    divergence: vec![FASTEST; DIVERGENCE_ANGLES],
                }
            }
        });
        section
    }

    /// How far an angle of attack, rad, is on the way from the middle between
    /// the two angles of stall at a Mach number to the nearer one: 1 is stall.
    /// A section without a table or a stall of its own is taken to stall at 15°
    /// from its angle of zero lift, an assumption of warnings only.
    #[must_use]
    pub fn stall_fraction(&self, angle_of_attack: f64, mach: f64) -> f64 {
        let place = mach / STALL_SPACING;
        let [low, high] =
            [0, 1].map(|end| between(place, STALL_MACHS, |index| self.limits.stall[index][end]));
        ((wrap(angle_of_attack) - 0.5 * (low + high)) / (0.5 * (high - low))).abs()
    }

    /// Mach number at which the drag coefficient grows with 0.1 per Mach number
    /// at an angle of attack, rad; at most 0.9.
    #[must_use]
    pub fn drag_divergence(&self, angle_of_attack: f64) -> f64 {
        let place = (wrap(angle_of_attack) + DIVERGENCE_REACH) / DIVERGENCE_SPACING;
        between(place, DIVERGENCE_ANGLES, |index| self.limits.divergence[index])
    }

    /// Coefficients and partial derivatives at an angle of attack (rad, any
    /// turn) and a Mach number. NaN comes back as NaN.
    #[inline]
    pub fn coefficients(&self, angle_of_attack: f64, mach: f64) -> Coefficients {
        let alpha = wrap(angle_of_attack);
        match &self.kind {
            Kind::Table(table) => {
                let v = table.evaluate(alpha, mach);
                Coefficients {
                    lift: v.value[0],
                    lift_alpha: v.x[0],
                    lift_mach: v.y[0],
                    drag: v.value[1],
                    drag_alpha: v.x[1],
                    drag_mach: v.y[1],
                }
            }
            Kind::Analytic(line) => {
                let [lift, lift_alpha, drag, drag_alpha] = line.coefficients(alpha);
                Coefficients { lift, lift_alpha, lift_mach: 0.0, drag, drag_alpha, drag_mach: 0.0 }
            }
        }
    }

    /// Lift and drag coefficients alone: the bits of
    /// [`Section::coefficients`] at less cost.
    #[inline(always)]
    pub fn lift_drag(&self, angle_of_attack: f64, mach: f64) -> (f64, f64) {
        let alpha = wrap(angle_of_attack);
        match &self.kind {
            Kind::Table(table) => {
                let [lift, drag] = table.value(alpha, mach);
                (lift, drag)
            }
            Kind::Analytic(line) => {
                let [lift, _, drag, _] = line.coefficients(alpha);
                (lift, drag)
            }
        }
    }
}

/// Where a section stalls and where its drag diverges: for warnings, not for
/// loads.
#[derive(Debug, Default)]
struct Limits {
    /// Angles of least and of largest lift, rad, by Mach number.
    stall: Vec<[f64; 2]>,
    /// Mach number of drag divergence by angle of attack.
    divergence: Vec<f64>,
}

/// Mach numbers from 0 at which the angles of stall are looked for, and how far
/// apart.
const STALL_MACHS: usize = 21;
const STALL_SPACING: f64 = 0.05;
/// Largest angle at which stall is looked for, rad: beyond it lift is that of a
/// plate.
const STALL_REACH: f64 = 30.0 * PI / 180.0;
/// Angle from zero lift at which a section without a table is taken to stall,
/// rad: what the sections of helicopter blades reach.
const ASSUMED_STALL: f64 = 15.0 * PI / 180.0;
/// Angles of attack from −20° to 20° at which drag divergence is looked for.
const DIVERGENCE_ANGLES: usize = 41;
const DIVERGENCE_REACH: f64 = 20.0 * PI / 180.0;
const DIVERGENCE_SPACING: f64 = PI / 180.0;
/// Growth of drag with the Mach number that is called divergence.
const DIVERGENCE: f64 = 0.1;
/// Mach number beyond which no section is trusted.
const FASTEST: f64 = 0.9;

impl Limits {
    fn of(section: &Section) -> Self {
        let steps = 120;
        let stall = (0..STALL_MACHS)
            .map(|index| {
                let mach = index as f64 * STALL_SPACING;
                // The peak nearest to zero that is higher than what is around
                // it by more than rounding; the end where there is none.
                [-1.0, 1.0].map(|sign| {
                    let angle = |k: usize| sign * STALL_REACH * k as f64 / f64::from(steps);
                    let lift = |k: usize| sign * section.lift_drag(angle(k), mach).0;
                    let best = (0..=steps as usize).map(|k| (k, lift(k))).fold(
                        (0, f64::NEG_INFINITY),
                        |best, now| if now.1 > best.1 { now } else { best },
                    );
                    angle(best.0.max(1))
                })
            })
            .collect();
        let divergence = (0..DIVERGENCE_ANGLES)
            .map(|index| {
                let angle = index as f64 * DIVERGENCE_SPACING - DIVERGENCE_REACH;
                let drag = |mach: f64| section.lift_drag(angle, mach).1;
                (15..45)
                    .map(|k| 0.02 * f64::from(k))
                    .find(|mach| drag(mach + 0.02) - drag(mach - 0.02) > 0.04 * DIVERGENCE)
                    .unwrap_or(FASTEST)
            })
            .collect();
        Self { stall, divergence }
    }
}

/// Value between entries of a list at whole places, constant beyond its ends.
fn between(place: f64, count: usize, value: impl Fn(usize) -> f64) -> f64 {
    let place = place.clamp(0.0, (count - 1) as f64);
    let index = (place as usize).min(count - 2);
    let t = place - index as f64;
    value(index) + t * (value(index + 1) - value(index))
}

/// Angle, rad, up to which the lift of an analytic section is linear.
const LINEAR_RANGE: f64 = 0.4;
/// Slope of the plate's angle where it stands across the flow.
const BROADSIDE_SLOPE: f64 = -0.6;

/// The angle that the lift of an analytic section goes with, and its slope.
///
/// Linear from −0.4 to 0.4 rad. Beyond, a cubic brings it to zero where the
/// section stands across the flow, and in reversed flow the section lifts like
/// a plate: odd, with period π, and C1.
#[inline]
fn plate_angle(angle: f64) -> (f64, f64) {
    let folded = angle - PI * (angle / PI).round();
    let size = folded.abs();
    if size <= LINEAR_RANGE {
        return (folded, 1.0);
    }
    let span = 0.5 * PI - LINEAR_RANGE;
    let t = (size - LINEAR_RANGE) / span;
    let (t2, t3) = (t * t, t * t * t);
    let value = LINEAR_RANGE * (2.0 * t3 - 3.0 * t2 + 1.0)
        + span * (t3 - 2.0 * t2 + t)
        + span * BROADSIDE_SLOPE * (t3 - t2);
    let slope = LINEAR_RANGE * (6.0 * t2 - 6.0 * t) / span
        + (3.0 * t2 - 4.0 * t + 1.0)
        + BROADSIDE_SLOPE * (3.0 * t2 - 2.0 * t);
    (value.copysign(folded), slope)
}

/// An angle brought to [−π, π) by whole turns.
#[inline(always)]
fn wrap(angle: f64) -> f64 {
    // Blade and surface angles lie within two turns; the compiler's general
    // remainder costs more than the table lookup.
    if (-PI..PI).contains(&angle) {
        angle
    } else if angle.abs() <= TAU + PI {
        angle - TAU.copysign(angle)
    } else {
        wrap_far(angle)
    }
}

#[cold]
fn wrap_far(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// A grid made ready for a periodic surface: ends at ±π with one value, and
/// at least two Mach numbers.
fn periodic(grid: &CoefficientGrid) -> Result<CoefficientGrid, GridError> {
    let mut grid = grid.clone();
    let (rows, columns) = (grid.angle_of_attack.len(), grid.mach.len());
    if grid.value.len() != rows * columns {
        return Err(GridError::WrongSize { found: grid.value.len(), needed: rows * columns });
    }
    if let (Some(&first), Some(&last)) = (grid.angle_of_attack.first(), grid.angle_of_attack.last())
    {
        // Negated, so that NaN is refused too.
        if !((first + PI).abs() <= SEAM_TOLERANCE && (last - PI).abs() <= SEAM_TOLERANCE) {
            return Err(GridError::NotOnePeriod {
                axis: "angle of attack",
                first,
                last,
                period: TAU,
            });
        }
        grid.angle_of_attack[0] = -PI;
        grid.angle_of_attack[rows - 1] = PI;
        for column in 0..columns {
            let last = (rows - 1) * columns + column;
            let seam = 0.5 * (grid.value[column] + grid.value[last]);
            grid.value[column] = seam;
            grid.value[last] = seam;
        }
    }
    if let &[only] = &grid.mach[..] {
        // One Mach number serves all: a second column with the same values.
        grid.mach.push(only + 1.0);
        grid.value = grid.value.iter().flat_map(|&v| [v, v]).collect();
    }
    Ok(grid)
}

/// The surface of one coefficient of a [`periodic`] grid: a spline, or, where
/// that would ring, the smoothest surface that stays within the data.
fn surface(grid: &CoefficientGrid) -> Result<Bicubic<1>, GridError> {
    let spline = Bicubic::spline(&grid.angle_of_attack, &grid.mach, [&grid.value], ENDS)?;
    if spline.overshoot() <= MOST_OVERSHOOT { Ok(spline) } else { within_data(grid) }
}

/// The C¹ surface of a [`periodic`] grid that stays within its data.
fn within_data(grid: &CoefficientGrid) -> Result<Bicubic<1>, GridError> {
    Bicubic::new(&grid.angle_of_attack, &grid.mach, [&grid.value], ENDS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::AirfoilTable;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// Reads one coefficient block of a C81 file, just enough for tests.
    fn block<'a>(
        lines: &mut impl Iterator<Item = &'a str>,
        machs: usize,
        alphas: usize,
    ) -> CoefficientGrid {
        let fields = |line: &str| -> Vec<f64> {
            line.as_bytes()
                .chunks(7)
                .filter_map(|f| std::str::from_utf8(f).unwrap().trim().parse().ok())
                .collect()
        };
        let mach = fields(lines.next().unwrap());
        assert_eq!(mach.len(), machs);
        let (mut angle_of_attack, mut value) = (Vec::new(), Vec::new());
        for _ in 0..alphas {
            let row = fields(lines.next().unwrap());
            assert_eq!(row.len(), machs + 1);
            angle_of_attack.push(row[0].to_radians());
            value.extend(&row[1..]);
        }
        CoefficientGrid { angle_of_attack, mach, value }
    }

    static NACA: LazyLock<AirfoilTable> = LazyLock::new(|| {
        let text = include_str!("../../problems/airfoils/naca23012.c81");
        let mut lines = text.lines();
        let title = lines.next().unwrap();
        let counts: Vec<usize> = title.as_bytes()[30..42]
            .chunks(2)
            .map(|c| std::str::from_utf8(c).unwrap().trim().parse().unwrap())
            .collect();
        AirfoilTable {
            name: title[..30].trim().to_string(),
            lift: block(&mut lines, counts[0], counts[1]),
            drag: block(&mut lines, counts[2], counts[3]),
            moment: block(&mut lines, counts[4], counts[5]),
        }
    });

    static SECTION: LazyLock<Section> =
        LazyLock::new(|| Section::new(&Airfoil::Table(Arc::new(NACA.clone()))).unwrap());

    #[test]
    fn table_nodes_are_reproduced() {
        let last = NACA.lift.mach.len() - 1;
        for (i, &alpha) in NACA.lift.angle_of_attack.iter().enumerate() {
            for (j, &mach) in NACA.lift.mach.iter().enumerate() {
                let k = i * NACA.lift.mach.len() + j;
                let c = SECTION.coefficients(alpha, mach);
                // The last column is reached from the left of its cell.
                let tolerance = if j == last { 1e-14 } else { 0.0 };
                assert!((c.lift - NACA.lift.value[k]).abs() <= tolerance);
                assert!((c.drag - NACA.drag.value[k]).abs() <= tolerance);
            }
        }
    }

    /// Stall and drag divergence of the table of the repository, read off its
    /// rows: lift is largest at 14° at Mach 0 to 0.3, and drag grows fast from
    /// about Mach 0.7 at zero lift.
    #[test]
    fn limits_are_those_of_the_table() {
        for (j, mach) in NACA.lift.mach.iter().enumerate() {
            let column = |i: usize| NACA.lift.value[i * NACA.lift.mach.len() + j];
            let best = (0..NACA.lift.angle_of_attack.len())
                .filter(|&i| (0.0..0.53).contains(&NACA.lift.angle_of_attack[i]))
                .max_by(|&a, &b| column(a).total_cmp(&column(b)))
                .unwrap();
            let angle = NACA.lift.angle_of_attack[best];
            let fraction = SECTION.stall_fraction(angle, *mach);
            assert!((fraction - 1.0).abs() < 0.25, "Mach {mach}: {fraction}");
            assert!(SECTION.stall_fraction(angle + 0.15, *mach) > 1.0);
            assert!(SECTION.stall_fraction(0.0, *mach) < 0.6);
        }
        let critical = SECTION.drag_divergence(0.0);
        assert!((0.6..0.85).contains(&critical), "{critical}");
        assert!(SECTION.drag_divergence(8.0_f64.to_radians()) < critical);
        let plain = Section::new(&Airfoil::Analytic {
            lift_slope: 6.0,
            zero_lift_angle: 0.02,
            drag: 0.01,
            polar: Polar::default(),
            small_angles: false,
        })
        .unwrap();
        assert!((plain.stall_fraction(0.02 + ASSUMED_STALL, 0.5) - 1.0).abs() < 1e-12);
        assert_eq!(plain.drag_divergence(0.1), FASTEST);
    }

    #[test]
    fn derivatives_do_not_jump_at_cell_edges() {
        let next = |v: f64| (v + 1e-15).max(v.next_up());
        let mut machs: Vec<f64> = NACA.lift.mach.clone();
        machs.extend([0.17, 0.55, 0.83]);
        for &alpha in &NACA.lift.angle_of_attack {
            for &mach in &machs {
                let (left, right) = (alpha - 1e-15, next(alpha));
                let (a, b) = (SECTION.coefficients(left, mach), SECTION.coefficients(right, mach));
                // Second derivatives are below 2000, so 2e-15 of travel
                // explains 4e-12; the rest is rounding of the cubics.
                assert!((a.lift_alpha - b.lift_alpha).abs() < 1e-11);
                assert!((a.drag_alpha - b.drag_alpha).abs() < 1e-11);
                assert!((a.lift_mach - b.lift_mach).abs() < 1e-11);
                assert!((a.drag_mach - b.drag_mach).abs() < 1e-11);
            }
        }
        for &mach in &NACA.lift.mach {
            for k in -170..170 {
                let alpha = f64::from(k) * 0.018;
                let (a, b) = (
                    SECTION.coefficients(alpha, mach - 1e-15),
                    SECTION.coefficients(alpha, mach + 1e-15),
                );
                assert!((a.lift_alpha - b.lift_alpha).abs() < 1e-11);
                assert!((a.drag_alpha - b.drag_alpha).abs() < 1e-11);
                assert!((a.lift_mach - b.lift_mach).abs() < 1e-11);
                assert!((a.drag_mach - b.drag_mach).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn the_seam_at_180_degrees_is_smooth() {
        for mach in [0.0, 0.35, 0.72] {
            let (a, b) = (SECTION.coefficients(PI, mach), SECTION.coefficients(-PI, mach));
            assert!((a.lift - b.lift).abs() < 1e-13);
            assert!((a.drag - b.drag).abs() < 1e-13);
            assert!((a.lift_alpha - b.lift_alpha).abs() < 1e-12);
            assert!((a.drag_alpha - b.drag_alpha).abs() < 1e-12);
            assert!((a.lift_mach - b.lift_mach).abs() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn whole_turns_change_nothing(alpha in -3.1f64..3.1, mach in 0.0f64..1.0, turns in -5i32..=5) {
            let a = SECTION.coefficients(alpha, mach);
            let b = SECTION.coefficients(alpha + TAU * f64::from(turns), mach);
            prop_assert!((a.lift - b.lift).abs() < 1e-12);
            prop_assert!((a.drag_alpha - b.drag_alpha).abs() < 1e-11);
        }

        #[test]
        fn the_value_twin_has_the_same_bits(alpha in -7.0f64..7.0, mach in -0.1f64..1.1) {
            let c = SECTION.coefficients(alpha, mach);
            let (lift, drag) = SECTION.lift_drag(alpha, mach);
            prop_assert_eq!(c.lift.to_bits(), lift.to_bits());
            prop_assert_eq!(c.drag.to_bits(), drag.to_bits());
        }

        #[test]
        fn partials_agree_with_differences(alpha in -3.2f64..3.2, mach in 0.0f64..0.95) {
            let h = 1e-5;
            let c = SECTION.coefficients(alpha, mach);
            let by_alpha = [SECTION.lift_drag(alpha + h, mach), SECTION.lift_drag(alpha - h, mach)];
            let by_mach = [SECTION.lift_drag(alpha, mach + h), SECTION.lift_drag(alpha, mach - h)];
            // A node between the two points leaves h times the jump of the
            // second derivative, below 2000.
            prop_assert!((c.lift_alpha - (by_alpha[0].0 - by_alpha[1].0) / (2.0 * h)).abs() < 1e-2);
            prop_assert!((c.drag_alpha - (by_alpha[0].1 - by_alpha[1].1) / (2.0 * h)).abs() < 1e-2);
            prop_assert!((c.lift_mach - (by_mach[0].0 - by_mach[1].0) / (2.0 * h)).abs() < 1e-2);
            prop_assert!((c.drag_mach - (by_mach[0].1 - by_mach[1].1) / (2.0 * h)).abs() < 1e-2);
        }
    }

    #[test]
    fn partials_agree_tightly_inside_cells() {
        let h = 1e-6;
        for window in NACA.lift.angle_of_attack.windows(2) {
            for pair in NACA.lift.mach.windows(2) {
                let alpha = 0.6 * window[0] + 0.4 * window[1];
                let mach = 0.3 * pair[0] + 0.7 * pair[1];
                let c = SECTION.coefficients(alpha, mach);
                let slope = |a: (f64, f64), b: (f64, f64)| {
                    ((a.0 - b.0) / (2.0 * h), (a.1 - b.1) / (2.0 * h))
                };
                let by_alpha =
                    slope(SECTION.lift_drag(alpha + h, mach), SECTION.lift_drag(alpha - h, mach));
                let by_mach =
                    slope(SECTION.lift_drag(alpha, mach + h), SECTION.lift_drag(alpha, mach - h));
                assert!((c.lift_alpha - by_alpha.0).abs() < 2e-7);
                assert!((c.drag_alpha - by_alpha.1).abs() < 2e-7);
                assert!((c.lift_mach - by_mach.0).abs() < 2e-7);
                assert!((c.drag_mach - by_mach.1).abs() < 2e-7);
            }
        }
    }

    #[test]
    fn beyond_the_table_coefficients_stay_constant_and_flat() {
        for alpha in [-2.0, -0.1, 0.05, 0.3] {
            for (beyond, end) in [(-0.5, 0.0), (1.4, 0.9)] {
                let (out, edge) =
                    (SECTION.coefficients(alpha, beyond), SECTION.coefficients(alpha, end));
                assert_eq!(out.lift, edge.lift);
                assert_eq!(out.drag, edge.drag);
                assert!(out.lift_mach.abs() < 1e-12 && out.drag_mach.abs() < 1e-12);
            }
        }
    }

    #[test]
    fn different_grids_for_lift_and_drag_serve_as_they_are() {
        let mut thinned = NACA.clone();
        let machs = thinned.drag.mach.len();
        let keep: Vec<usize> = (0..thinned.drag.angle_of_attack.len()).step_by(2).collect();
        thinned.drag.value = keep
            .iter()
            .flat_map(|&i| NACA.drag.value[i * machs + 2..(i + 1) * machs].to_vec())
            .collect();
        thinned.drag.angle_of_attack = keep.iter().map(|&i| NACA.drag.angle_of_attack[i]).collect();
        *thinned.drag.angle_of_attack.last_mut().unwrap() = PI;
        thinned.drag.mach = NACA.drag.mach[2..].to_vec();
        let mixed = Section::new(&Airfoil::Table(Arc::new(thinned.clone()))).unwrap();
        let drag = periodic(&thinned.drag).unwrap();
        let smooth = surface(&drag).unwrap();
        let alone = if smooth.is_positive() { smooth } else { within_data(&drag).unwrap() };
        for k in -31..=31 {
            let alpha = 0.1 * f64::from(k) + 0.003;
            for mach in [0.0, 0.25, 0.3, 0.61, 0.9, 1.0] {
                let c = mixed.coefficients(alpha, mach);
                assert!((c.lift - SECTION.lift_drag(alpha, mach).0).abs() < 1e-12);
                assert!((c.drag - alone.value(alpha, mach)[0]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn one_mach_number_serves_all() {
        let columns = NACA.lift.mach.len();
        let one = |grid: &CoefficientGrid| CoefficientGrid {
            angle_of_attack: grid.angle_of_attack.clone(),
            mach: vec![grid.mach[2]],
            value: grid.value.iter().skip(2).step_by(columns).copied().collect(),
        };
        let table = AirfoilTable { lift: one(&NACA.lift), drag: one(&NACA.drag), ..NACA.clone() };
        let section = Section::new(&Airfoil::Table(Arc::new(table))).unwrap();
        for mach in [0.0, 0.3, 0.8] {
            let c = section.coefficients(NACA.lift.angle_of_attack[40], mach);
            assert!((c.lift - NACA.lift.value[40 * columns + 2]).abs() < 1e-15);
            assert!(c.lift_mach == 0.0 && c.drag_mach == 0.0);
        }
    }

    #[test]
    fn the_analytic_pair_is_linear_lift_and_constant_drag() {
        let section = Section::new(&Airfoil::Analytic {
            lift_slope: 5.73,
            zero_lift_angle: -0.02,
            drag: 0.01,
            polar: Polar::default(),
            small_angles: false,
        })
        .unwrap();
        let c = section.coefficients(0.1, 0.4);
        assert!((c.lift - 5.73 * 0.12).abs() < 1e-15);
        assert_eq!((c.lift_alpha, c.drag, c.drag_alpha), (5.73, 0.01, 0.0));
        assert_eq!(section.lift_drag(0.1, 0.4), (c.lift, c.drag));
    }

    /// A drag polar, and stall into a plate: values, slopes, period π.
    #[test]
    fn the_polar_and_its_stall_are_smooth() {
        let stall = 0.22;
        let of = |stall: Option<f64>| {
            Section::new(&Airfoil::Analytic {
                lift_slope: 5.73,
                zero_lift_angle: -0.03,
                drag: 0.0087,
                polar: Polar { linear: -0.0216, quadratic: 0.4, stall },
                small_angles: false,
            })
            .unwrap()
        };
        let section = of(Some(stall));
        let c = section.coefficients(0.07, 0.3);
        assert!((c.drag - (0.0087 - 0.00216 + 0.004)).abs() < 1e-15, "{}", c.drag);
        assert!((c.lift - 0.573).abs() < 1e-14);
        assert_eq!(c, of(None).coefficients(0.07, 0.3));
        // Stalled: a plate, with less lift and far more drag than before.
        let across = section.coefficients(-0.03 + 0.5 * PI, 0.3);
        assert!(across.lift.abs() < 1e-12 && (across.drag - 2.1087).abs() < 1e-9);
        let beyond = section.coefficients(-0.03 + stall + STALL_WIDTH, 0.3);
        assert!(beyond.lift < section.coefficients(-0.03 + stall - STALL_WIDTH, 0.3).lift);
        assert!((section.stall_fraction(-0.03 + stall, 0.3) - 1.0).abs() < 1e-12);
        for k in -60..=60 {
            let (angle, step) = (0.0517 * f64::from(k), 1e-6);
            let at = |angle: f64| section.coefficients(angle, 0.2);
            let (up, down, here) = (at(angle + step), at(angle - step), at(angle));
            assert!(
                ((up.lift - down.lift) / (2.0 * step) - here.lift_alpha).abs() < 1e-3,
                "{angle}"
            );
            assert!(
                ((up.drag - down.drag) / (2.0 * step) - here.drag_alpha).abs() < 1e-3,
                "{angle}"
            );
            assert!(here.drag > 0.008, "{angle}: {}", here.drag);
            assert!((at(angle + PI).drag - here.drag).abs() < 1e-11);
        }
    }

    #[test]
    fn analytic_lift_is_a_plates_in_reversed_flow_and_smooth() {
        let section = Section::new(&Airfoil::Analytic {
            lift_slope: 5.73,
            zero_lift_angle: 0.0,
            drag: 0.01,
            polar: Polar::default(),
            small_angles: false,
        })
        .unwrap();
        let lift = |angle: f64| section.coefficients(angle, 0.2).lift;
        for k in -40..=40 {
            let angle = 0.07 * f64::from(k);
            assert!((lift(angle) + lift(-angle)).abs() < 1e-13, "odd at {angle}");
            assert!((lift(angle) - lift(angle + PI)).abs() < 1e-12, "period π at {angle}");
            let step = 1e-6;
            let difference = (lift(angle + step) - lift(angle - step)) / (2.0 * step);
            let slope = section.coefficients(angle, 0.2).lift_alpha;
            assert!((difference - slope).abs() < 1e-4, "slope at {angle}");
        }
        assert!(lift(0.5 * PI).abs() < 1e-13);
    }

    #[test]
    fn a_table_short_of_a_full_turn_is_refused() {
        let mut table = NACA.clone();
        table.drag.angle_of_attack[0] = -3.0;
        let error = Section::new(&Airfoil::Table(Arc::new(table))).unwrap_err();
        assert!(matches!(error, GridError::NotOnePeriod { axis: "angle of attack", .. }));
    }

    #[test]
    fn nan_comes_back_as_nan() {
        assert!(SECTION.coefficients(f64::NAN, 0.3).lift.is_nan());
        assert!(SECTION.coefficients(0.1, f64::NAN).drag.is_nan());
        assert!(SECTION.lift_drag(f64::INFINITY, 0.3).0.is_nan());
    }

    /// The table that we ship is smooth enough for splines; one wrong entry
    /// makes them ring, and then no coefficient leaves its neighbours.
    #[test]
    fn a_wrong_entry_does_not_ring_through_the_table() {
        let lift = periodic(&NACA.lift).unwrap();
        let drag = periodic(&NACA.drag).unwrap();
        let spline = |grid: &CoefficientGrid| {
            Bicubic::spline(&grid.angle_of_attack, &grid.mach, [&grid.value], ENDS).unwrap()
        };
        assert!(spline(&lift).overshoot() < MOST_OVERSHOOT, "{}", spline(&lift).overshoot());
        assert!(spline(&drag).overshoot() < MOST_OVERSHOOT, "{}", spline(&drag).overshoot());
        assert!(spline(&drag).is_positive());

        let mut table = NACA.clone();
        let columns = table.lift.mach.len();
        let row = table.lift.angle_of_attack.iter().position(|&a| a > 0.05).unwrap();
        table.lift.value[row * columns + 3] *= 10.0;
        let section = Section::new(&Airfoil::Table(Arc::new(table.clone()))).unwrap();
        let mach = table.lift.mach[3];
        for k in 0..40 {
            // Two cells above the wrong entry.
            let (a, b) = (table.lift.angle_of_attack[row + 2], table.lift.angle_of_attack[row + 3]);
            let (lift, _) = section.lift_drag(a + (b - a) * f64::from(k) / 40.0, mach);
            let ends = [row + 2, row + 3].map(|r| table.lift.value[r * columns + 3]);
            assert!(lift >= ends[0].min(ends[1]) - 1e-12 && lift <= ends[0].max(ends[1]) + 1e-12);
        }
    }
}
