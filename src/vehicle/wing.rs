//! Wings and tail surfaces.
//!
//! A wing's frame follows from the body frame by its cant about x and its
//! incidence about the span axis y; at cant 0 the span runs to starboard and
//! positive lift is up, at cant 90° the span runs down and positive lift is to
//! starboard. Dihedral raises both halves from that plane. Forces act in the
//! plane of each section; the spanwise component of the flow does nothing
//! (simple sweep theory).

use crate::numerics::interpolation::{CubicHermite, Ends};
use crate::numerics::quadrature::gauss_legendre;
use crate::numerics::scalar::{Local, Scalar, Vec3, arc_tangent};
use crate::problem::{self, ControlSurface, Effectiveness, FlowAngle, Wash, WingModel};
use crate::vehicle::VehicleError;
use crate::vehicle::airfoil::Section;
use crate::vehicle::atmosphere::Air;
use crate::vehicle::frames::{Matrix3, about_x, about_y, position_body, product};
use std::f64::consts::PI;

/// Speed at which half of a fuselage's wake is there, m/s: some 10 kt.
const SHADE_SPEED: f64 = 5.0;

/// Angle of attack, rad, up to which the induced-angle correction is whole,
/// and beyond which, with the flow separated, it is gone.
const INDUCED_FADE: [f64; 2] = [0.25, 0.60];
/// Half-width, rad, over which a finite wing goes from attached to stalled.
const STALL_WIDTH: f64 = 0.05;
/// Normal-force coefficient of a stalled finite wing (flat plate broadside).
const STALLED_NORMAL_FORCE: f64 = 1.1;

/// A strip of a wing, or a whole finite wing.
#[derive(Debug, Clone)]
struct Strip {
    /// Aerodynamic centre from the centre of gravity, body frame, m.
    position_body: [f64; 3],
    /// From there to a tip of the part over which wash is averaged, body frame,
    /// m: half of a finite wing, nothing of a strip.
    half_span: [f64; 3],
    /// From the body frame to the section frame (x forward, z down).
    rotation: Matrix3,
    /// ½ρS, kg/m.
    half_density_area: f64,
}

/// A wing of the vehicle model.
#[derive(Debug, Clone)]
pub struct Wing {
    /// Name in the problem file.
    pub name: String,
    /// Rotor wash on it.
    pub wash: Wash,
    /// Control surface that the sticks move.
    pub surface: Option<ControlSurface>,
    /// What its deflection does to the angle of attack.
    shift: Option<Shift>,
    /// Incidence over airspeed, beside the fixed one.
    schedule: Option<CubicHermite>,
    /// Dynamic pressure in the wake of the fuselage over an angle of the flow.
    shade: Option<(FlowAngle, CubicHermite)>,
    strips: Vec<Strip>,
    lift: Lift,
    sound_speed: f64,
}

/// Change of the angle of attack from zero lift over the deflection.
#[derive(Debug, Clone)]
enum Shift {
    Linear(f64),
    Curve(CubicHermite),
}

#[derive(Debug, Clone)]
enum Lift {
    Strips {
        section: Section,
        /// Factor on the angle from zero lift, 1 without the correction.
        slope_factor: f64,
        zero_lift_angle: f64,
    },
    Finite {
        slope: f64,
        zero_lift_angle: f64,
        parasite_drag: f64,
        induced: f64,
        stall_angle: f64,
    },
}

impl Wing {
    /// The wing of a problem in the given air.
    ///
    /// # Errors
    /// An airfoil table that cannot be interpolated.
    pub fn new(
        wing: &problem::Wing,
        center_of_gravity: &problem::Station,
        air: &Air,
    ) -> Result<Self, VehicleError> {
        let center = position_body(&wing.aerodynamic_center, center_of_gravity);
        // Stations along the span, 0 port to 1 starboard, and parts of the span.
        // Each half has its own plane, and its own points.
        let (stations, half_dihedral) = match wing.model {
            WingModel::Elements { elements, .. } => {
                let half = elements.div_ceil(2);
                let mut points = gauss_legendre(0.0, 0.5, half);
                points.extend(gauss_legendre(0.5, 1.0, half));
                (points, wing.dihedral)
            }
            WingModel::Finite { .. } => (vec![(0.5, 1.0)], 0.0),
        };
        let whole = stations.len() == 1;
        let plane = about_x(wing.cant);
        let mut area_total = 0.0;
        let strips: Vec<Strip> = stations
            .into_iter()
            .map(|(station, part)| {
                let offset = (station - 0.5) * wing.span;
                let dihedral = if whole { 0.0 } else { half_dihedral * offset.signum() };
                // Starboard half: span axis turned up by the dihedral.
                let rotation =
                    product(&about_y(wing.incidence), &product(&about_x(-dihedral), &plane));
                let span_axis = product(&about_x(-dihedral), &plane)[1];
                let chord = if whole { mean(&wing.chord) } else { wing.chord.at(station) };
                let area = chord * wing.span * part;
                area_total += area;
                Strip {
                    position_body: [0, 1, 2].map(|i| center[i] + offset * span_axis[i]),
                    half_span: if whole {
                        span_axis.map(|axis| 0.5 * wing.span * axis)
                    } else {
                        [0.0; 3]
                    },
                    rotation,
                    half_density_area: 0.5 * air.density * area,
                }
            })
            .collect();
        let aspect_ratio = wing.span * wing.span / area_total;
        let lift = match &wing.model {
            WingModel::Elements { airfoil, induced_angle, .. } => {
                let section = Section::new(airfoil)
                    .map_err(|source| VehicleError::Airfoil { of: wing.name.clone(), source })?;
                let (slope, zero_lift_angle) = attached_line(&section);
                let slope_factor =
                    if *induced_angle { 1.0 / (1.0 + slope / (PI * aspect_ratio)) } else { 1.0 };
                Lift::Strips { section, slope_factor, zero_lift_angle }
            }
            WingModel::Finite {
                lift_slope,
                zero_lift_angle,
                parasite_drag,
                oswald,
                stall_angle,
            } => Lift::Finite {
                slope: lift_slope / (1.0 + lift_slope / (PI * aspect_ratio * oswald)),
                zero_lift_angle: *zero_lift_angle,
                parasite_drag: *parasite_drag,
                induced: 1.0 / (PI * aspect_ratio * oswald),
                stall_angle: *stall_angle,
            },
        };
        let schedule = match &wing.incidence_schedule {
            Some(curve) => Some(
                CubicHermite::new(&curve.airspeed, &curve.incidence, Ends::Flat)
                    .map_err(|source| VehicleError::Airfoil { of: wing.name.clone(), source })?,
            ),
            None => None,
        };
        let shade = match &wing.dynamic_pressure {
            Some(behind) => Some((
                behind.over,
                CubicHermite::new(&behind.angle, &behind.ratio, Ends::Flat)
                    .map_err(|source| VehicleError::Airfoil { of: wing.name.clone(), source })?,
            )),
            None => None,
        };
        let shift = match wing.surface.as_ref().map(|surface| &surface.effectiveness) {
            Some(Effectiveness::Constant(tau)) => Some(Shift::Linear(*tau)),
            // Flat ends would leave a surface without effect near its limits.
            Some(Effectiveness::Table { deflection, shift }) => Some(Shift::Curve(
                CubicHermite::new(deflection, shift, Ends::Parabolic)
                    .map_err(|source| VehicleError::Airfoil { of: wing.name.clone(), source })?,
            )),
            None => None,
        };
        Ok(Self {
            name: wing.name.clone(),
            wash: wing.wash,
            surface: wing.surface.clone(),
            shift,
            schedule,
            shade,
            strips,
            lift,
            sound_speed: air.sound_speed,
        })
    }

    /// Places at which the rotors' wash is wanted, body frame from the centre
    /// of gravity, and half of the span over which it is averaged there, m.
    pub fn wash_points(&self) -> impl Iterator<Item = [[f64; 3]; 2]> + '_ {
        self.strips.iter().map(|strip| [strip.position_body, strip.half_span])
    }

    /// Force and moment about the centre of gravity, body frame, N and N m,
    /// from the velocity of the centre of gravity through the air and the
    /// angular velocity, body frame, and the deflection of its control surface,
    /// rad, which has no effect on a wing without one; `wash` gives the velocity
    /// of the air at each strip due to the rotors.
    #[inline(always)]
    pub fn loads<S: Scalar>(
        &self,
        velocity_body: Vec3<S>,
        rate_body: Vec3<S>,
        deflection: Option<S>,
        wash: impl Fn(usize) -> Option<Vec3<S>>,
    ) -> (Vec3<S>, Vec3<S>) {
        let mut force = Vec3::<S>::default();
        let mut moment = Vec3::<S>::default();
        let turn = self.turn(velocity_body, deflection);
        for (index, strip) in self.strips.iter().enumerate() {
            let free = velocity_body + rate_body.cross_constant(strip.position_body);
            let local = match wash(index) {
                Some(air) => washed(free, air, self.wash),
                None => free,
            };
            let [mut x, _, mut z] = local.rotated(&strip.rotation).0;
            if let Some([s, c]) = turn {
                (x, z) = (x * c - z * s, z * c + x * s);
            }
            let (value, partial) = if S::TANGENTS == 0 {
                self.section_force::<false>(strip, x.value(), z.value())
            } else {
                self.section_force::<true>(strip, x.value(), z.value())
            };
            let mut along = S::chain(value[0], &partial[0], &[x, z]);
            let mut down = S::chain(value[1], &partial[1], &[x, z]);
            if let Some([s, c]) = turn {
                (along, down) = (along * c + down * s, down * c - along * s);
            }
            let section = Vec3([along, S::default(), down]);
            let strip_force = section.rotated_back(&strip.rotation);
            force += strip_force;
            moment += -strip_force.cross_constant(strip.position_body);
        }
        if let Some(share) = self.shaded(velocity_body) {
            (force, moment) = (Vec3(force.0.map(|f| f * share)), Vec3(moment.0.map(|m| m * share)));
        }
        (force, moment)
    }

    /// What the wake of the fuselage leaves of the loads: the ratio of dynamic
    /// pressures, and all of it in hover, where there is no such wake and no angle
    /// of the flow.
    #[inline(always)]
    fn shaded<S: Scalar>(&self, velocity_body: Vec3<S>) -> Option<S> {
        let (over, table) = self.shade.as_ref()?;
        let [u, v, w] = velocity_body.0;
        let small = 1e-6;
        let angle = match over {
            FlowAngle::Attack => w.atan2(u + small),
            FlowAngle::Sideslip => v.atan2((u * u + w * w + small * small).sqrt()),
        };
        let (ratio, slope) = table.evaluate(angle.value());
        let ratio = S::chain(ratio, &[slope], &[angle]);
        let square = u * u + v * v + w * w;
        let there = square / (square + SHADE_SPEED * SHADE_SPEED);
        Some((ratio + -1.0) * there + 1.0)
    }

    /// Sine and cosine of the incidence that schedule and control surface add.
    /// A surface turns the section by τ δ against the flow; since lift and drag
    /// stay across and along the flow, only their angle of attack changes.
    #[inline(always)]
    fn turn<S: Scalar>(&self, velocity_body: Vec3<S>, deflection: Option<S>) -> Option<[S; 2]> {
        let scheduled = self.schedule.as_ref().map(|schedule| {
            // The small term keeps the slope of the airspeed at rest finite.
            let airspeed = (velocity_body.dot(velocity_body) + 1e-12).sqrt();
            let (value, slope) = schedule.evaluate(airspeed.value());
            S::chain(value, &[slope], &[airspeed])
        });
        let deflected = match (&self.shift, deflection) {
            (Some(Shift::Linear(tau)), Some(angle)) => Some(angle * *tau),
            (Some(Shift::Curve(curve)), Some(angle)) => {
                let (value, slope) = curve.evaluate(angle.value());
                Some(S::chain(value, &[slope], &[angle]))
            }
            _ => None,
        };
        let angle = match (scheduled, deflected) {
            (Some(scheduled), Some(deflected)) => scheduled + deflected,
            (scheduled, deflected) => scheduled.or(deflected)?,
        };
        let (s, c) = angle.sin_cos();
        Some([s, c])
    }

    /// Incidence that the schedule adds at an airspeed, rad.
    #[must_use]
    pub fn scheduled_incidence(&self, airspeed: f64) -> f64 {
        self.schedule.as_ref().map_or(0.0, |schedule| schedule.evaluate(airspeed).0)
    }

    /// Force along section x and z from the section's velocity through the
    /// air, and, if `PARTIALS` (else zero), its partial derivatives with both
    /// components.
    fn section_force<const PARTIALS: bool>(
        &self,
        strip: &Strip,
        x: f64,
        z: f64,
    ) -> ([f64; 2], [[f64; 2]; 2]) {
        let u2 = x * x + z * z;
        if u2 == 0.0 {
            return ([0.0; 2], [[0.0; 2]; 2]);
        }
        let u = u2.sqrt();
        let alpha = arc_tangent(z, x);
        let (lift, lift_a, lift_m, drag, drag_a, drag_m) = match &self.lift {
            Lift::Strips { section, slope_factor, zero_lift_angle } => {
                let (fade, fade_a) = smooth_step(alpha.abs(), INDUCED_FADE[0], INDUCED_FADE[1]);
                let fade_a = fade_a * alpha.signum();
                let factor = slope_factor + (1.0 - slope_factor) * fade;
                let off = alpha - zero_lift_angle;
                let effective = zero_lift_angle + factor * off;
                let effective_a = factor + (1.0 - slope_factor) * fade_a * off;
                let mach = u / self.sound_speed;
                // Lift leans back by the induced angle.
                let induced = alpha - effective;
                if !PARTIALS {
                    let (lift, drag) = section.lift_drag(effective, mach);
                    let drag = drag + lift * induced;
                    let k = strip.half_density_area * u;
                    let force = [k * (lift * z - drag * x), k * (-lift * x - drag * z)];
                    return (force, [[0.0; 2]; 2]);
                }
                let c = section.coefficients(effective, mach);
                let induced_a = 1.0 - effective_a;
                (
                    c.lift,
                    c.lift_alpha * effective_a,
                    c.lift_mach,
                    c.drag + c.lift * induced,
                    c.drag_alpha * effective_a
                        + c.lift_alpha * effective_a * induced
                        + c.lift * induced_a,
                    c.drag_mach + c.lift_mach * induced,
                )
            }
            Lift::Finite { slope, zero_lift_angle, parasite_drag, induced, stall_angle } => {
                let (s, c) = alpha.sin_cos();
                let off = alpha - zero_lift_angle;
                let attached = slope * off;
                let (stalled, stalled_a) =
                    smooth_step(alpha.abs(), stall_angle - STALL_WIDTH, stall_angle + STALL_WIDTH);
                let stalled_a = stalled_a * alpha.signum();
                let plate_lift = STALLED_NORMAL_FORCE * s * c;
                let plate_lift_a = STALLED_NORMAL_FORCE * (c * c - s * s);
                let plate_drag = parasite_drag + STALLED_NORMAL_FORCE * s * s;
                let plate_drag_a = STALLED_NORMAL_FORCE * 2.0 * s * c;
                let polar = parasite_drag + induced * attached * attached;
                let polar_a = 2.0 * induced * attached * slope;
                (
                    attached + stalled * (plate_lift - attached),
                    slope + stalled * (plate_lift_a - slope) + stalled_a * (plate_lift - attached),
                    0.0,
                    polar + stalled * (plate_drag - polar),
                    polar_a + stalled * (plate_drag_a - polar_a) + stalled_a * (plate_drag - polar),
                    0.0,
                )
            }
        };
        let k = strip.half_density_area * u;
        // Drag opposes the motion (x, z); lift is a quarter turn up from it.
        let (gx, gz) = (lift * z - drag * x, -lift * x - drag * z);
        let by_alpha = [k * (lift_a * z - drag_a * x), -k * (lift_a * x + drag_a * z)];
        let by_mach = [k * (lift_m * z - drag_m * x), -k * (lift_m * x + drag_m * z)];
        let (ax, az) = (-z / u2, x / u2);
        let (mx, mz) = (x / (u * self.sound_speed), z / (u * self.sound_speed));
        (
            [k * gx, k * gz],
            [
                [
                    k * gx * x / u2 - k * drag + by_alpha[0] * ax + by_mach[0] * mx,
                    k * gx * z / u2 + k * lift + by_alpha[0] * az + by_mach[0] * mz,
                ],
                [
                    k * gz * x / u2 - k * lift + by_alpha[1] * ax + by_mach[1] * mx,
                    k * gz * z / u2 - k * drag + by_alpha[1] * az + by_mach[1] * mz,
                ],
            ],
        )
    }
}

/// Loads of a wing without wash as a local function of the velocity of the
/// centre of gravity through the air and the angular velocity, body frame.
pub(super) struct UnwashedLoads<'a> {
    pub wing: &'a Wing,
}

impl Local<6, 6> for UnwashedLoads<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 6]) -> [T; 6] {
        let (force, moment) =
            self.wing.loads(Vec3([x[0], x[1], x[2]]), Vec3([x[3], x[4], x[5]]), None, |_| None);
        let ([fx, fy, fz], [mx, my, mz]) = (force.0, moment.0);
        [fx, fy, fz, mx, my, mz]
    }
}

/// The same of a wing with a control surface; last among the inputs comes the
/// deflection.
pub(super) struct DeflectedLoads<'a> {
    pub wing: &'a Wing,
}

impl Local<7, 6> for DeflectedLoads<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 7]) -> [T; 6] {
        let (velocity, rate) = (Vec3([x[0], x[1], x[2]]), Vec3([x[3], x[4], x[5]]));
        let (force, moment) = self.wing.loads(velocity, rate, Some(x[6]), |_| None);
        let ([fx, fy, fz], [mx, my, mz]) = (force.0, moment.0);
        [fx, fy, fz, mx, my, mz]
    }
}

/// Velocity of a body through air that the rotors move, by the wash rule.
#[inline(always)]
pub(super) fn washed<S: Scalar>(free: Vec3<S>, air: Vec3<S>, rule: Wash) -> Vec3<S> {
    match rule {
        Wash::None => free,
        Wash::Full => free - air,
        Wash::AngleOnly => {
            // Turned by the wash, but no faster than the free stream; the
            // small term keeps still air (0/0) at rest.
            let turned = free - air;
            let ratio = free.dot(free) / (turned.dot(turned) + 1e-9);
            turned.scale((ratio + 1e-18).sqrt())
        }
    }
}

/// 0 below `low`, 1 above `high`, a smooth cubic between; and its slope.
fn smooth_step(x: f64, low: f64, high: f64) -> (f64, f64) {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (high - low))
}

/// Lift-curve slope near zero lift (1/rad) and zero-lift angle (rad), at low
/// speed, by Newton's method from zero angle of attack.
fn attached_line(section: &Section) -> (f64, f64) {
    let mut alpha = 0.0;
    for _ in 0..20 {
        let c = section.coefficients(alpha, 0.0);
        if c.lift_alpha.abs() < 1e-3 {
            break;
        }
        alpha -= c.lift / c.lift_alpha;
    }
    (section.coefficients(alpha, 0.0).lift_alpha.max(0.0), alpha)
}

/// Mean of a spanwise distribution over the span.
fn mean(distribution: &problem::Spanwise) -> f64 {
    const SAMPLES: usize = 200;
    (0..SAMPLES).map(|k| distribution.at((k as f64 + 0.5) / SAMPLES as f64)).sum::<f64>()
        / SAMPLES as f64
}
