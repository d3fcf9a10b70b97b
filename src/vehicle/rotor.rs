//! Teetering and rigid rotors by blade elements.
//!
//! Everything here lives in the rotor's own hub frame (mirrored for a
//! clockwise rotor), where the rotor turns counter-clockwise seen from above.
//! Azimuth 0 is aft; the rotating frame F has x along blade 1, z along the
//! shaft, down (Eq. 5).
//!
//! **Kinematics** (Eqs. 15–19). Blade `k` attaches at `e k_T` below the teeter
//! hinge (undersling `e`) and flaps by β = β_T + β_p about j. With the hub
//! velocity and the rate ω of F, both against the air and resolved in F, the section at radius r meets
//!
//! * u_T = −v_F + e(ω_x cos β_T − ω_z sin β_T) − r(ω_x sin β + ω_z cos β),
//! * u_P = u_F sin β + w_F cos β + (e sin β_p − r)(β' + ω_y) − v_i cos β,
//! * u_R = u_F cos β − w_F sin β + e cos β_p (β' + ω_y) + v_i sin β,
//!
//! each a constant and a slope in r. Seven numbers, these six and the root
//! pitch, make the loads of a blade; their partial derivatives are taken by
//! hand in the element loop.
//!
//! **Inertia.** Two teetering blades are one rigid body that turns with the
//! teetering frame T. Its first moment about the hinge lies along k_T, and its
//! inertia tensor is diagonal in T. Newton's and Euler's laws for it replace
//! the printed expansions (Eqs. 22–23, 44, 47), which neglect some terms and
//! misprint others, and hold exactly. The blade mass itself, as a point at the
//! hub, belongs to the airframe (see `MassProperties`). A
//! [`Formulation`] can put single inexact relations of a publication in their
//! place: `teeter_torque_tilt` and `teeter_equation`.

use crate::numerics::scalar::{Dual, Local, Scalar, Vec3, arc_tangent, arc_tangents};
use crate::problem::{
    self, DriveTrain, Formulation, HubKind, RotorCoefficients, Spanwise, TeeterEquation,
};
use crate::vehicle::VehicleError;
use crate::vehicle::airfoil::Section;
use crate::vehicle::atmosphere::Air;
use crate::vehicle::blades::{BladeBody, BladeSet, Mode};
use crate::vehicle::census::{Census, SectionFlow};
use crate::vehicle::frames::{HubFrame, position_body};
use std::f64::consts::{PI, TAU};

/// One blade element, ready for the inner loop.
#[derive(Debug, Clone, Copy)]
struct Element {
    /// Radius, m.
    radius: f64,
    /// ½ρ c dr, kg/m.
    half_density_area: f64,
    /// Built-in twist, rad.
    twist: f64,
    /// Fraction of the element inside the tip-loss radius.
    lifting: f64,
}

/// Numbers of azimuths to try for the mean of a rotor.
const AZIMUTHS: [usize; 7] = [8, 12, 16, 24, 32, 48, 64];
/// Azimuths whose mean counts as exact.
const MOST_AZIMUTHS: usize = 192;
/// Error of a mean, of forces and of moments over the radius, relative to the
/// thrust.
const AVERAGING_TOLERANCE: f64 = 1e-5;
/// Elements that are taken side by side.
const LANES: usize = 4;

impl Element {
    /// f_T, f_P, r f_T, r f_P: N and N m, from the flow along and across, its
    /// speed, and the section's coefficients.
    #[inline(always)]
    fn loads(&self, ut: f64, up: f64, u: f64, lift: f64, drag: f64) -> [f64; 4] {
        let lift = lift * self.lifting;
        let k = self.half_density_area * u;
        let f_t = k * (lift * up - drag * ut);
        let f_p = -k * (lift * ut + drag * up);
        [f_t, f_p, self.radius * f_t, self.radius * f_p]
    }
}

/// Blade loads and the moments in r, of orders 0, 1, 2, of the slopes of f_T
/// and f_P.
#[derive(Debug, Clone, Copy, Default)]
struct PartialSums {
    /// ∫f_T, ∫f_P, ∫r f_T, ∫r f_P.
    sum: [f64; 4],
    by_t: [[f64; 3]; 2],
    by_p: [[f64; 3]; 2],
    by_r: [[f64; 3]; 2],
    by_pitch: [[f64; 2]; 2],
}

/// Linear lift and constant drag for flow along the chord (Eqs. 35).
#[derive(Debug, Clone, Copy)]
struct SmallAngles {
    lift_slope: f64,
    zero_lift_angle: f64,
    drag: f64,
}

/// A rotor of the vehicle model.
#[derive(Debug, Clone)]
pub struct Rotor {
    /// Name in the problem file.
    pub name: String,
    /// Hub position from the centre of gravity, body frame, m.
    pub position_body: [f64; 3],
    /// From the body frame to the rotor's own hub frame.
    pub frame: HubFrame,
    /// Radius R, m.
    pub radius: f64,
    /// Nominal speed Ω, rad/s.
    pub speed: f64,
    /// Number of blades.
    pub blades: usize,
    /// Azimuth of blade 1 at reference azimuth zero, rad.
    pub azimuth_offset: f64,
    /// Time constant of a governor or a motor, s; none holds the speed.
    pub governor_time_constant: Option<f64>,
    /// Whether the sticks command the speed.
    pub commanded: bool,
    /// Thrust and torque by coefficients in place of blades.
    pub coefficients: Option<RotorCoefficients>,
    /// Tip-loss factor B: momentum theory sees a disk of radius B R.
    pub tip_loss: f64,
    /// Factor κ on self-induced inflow as the blades meet it.
    pub induced_power_factor: f64,
    /// Teetering, or rigid.
    pub teetering: bool,
    /// Azimuths, evenly over the turn, whose mean stands for the blades of a
    /// rotor that is averaged; as many as blades where it is resolved.
    evaluated: usize,
    averaged: bool,
    teeter_torque_tilt: bool,
    teeter_equation: TeeterEquation,
    drive_train: DriveTrain,
    undersling: f64,
    spring: f64,
    tan_delta_3: f64,
    precone: f64,
    /// Sine and cosine of the precone.
    precone_turn: [f64; 2],
    swashplate_phase: f64,
    /// Sine and cosine of the swashplate phase.
    phase_turn: [f64; 2],
    /// Distance from the shaft to the point from which radii of elements count,
    /// m: the flap hinge where there is one.
    offset: f64,
    /// Its blades one by one, where these flap each for themselves, on a gimbal,
    /// or averaged over the azimuth; else they are one rigid body.
    pub(crate) set: Option<BladeSet>,
    /// Mass of all blades, kg.
    pub blade_mass_total: f64,
    /// First moment of all blades about the hinge along k_T, kg m.
    first_moment: f64,
    /// Principal moments of all blades about the hinge in T, kg m².
    pub(crate) inertia: [f64; 3],
    elements: Vec<Element>,
    section: Section,
    /// Eqs. 35 in place of the section, if the problem asks for them.
    small_angles: Option<SmallAngles>,
    sound_speed: f64,
    density: f64,
}

/// Loads and rates of a rotor on a hub that does not accelerate.
#[derive(Debug, Clone, Copy, Default)]
pub struct RotorLoads<S> {
    /// Force on the hub, aerodynamic and inertial, hub frame, N.
    pub force_hub: Vec3<S>,
    /// Moment on the hub about the teeter hinge, hub frame, N m.
    pub moment_hub: Vec3<S>,
    /// Teeter acceleration β_T'' on a hub that does not accelerate, rad/s².
    pub teeter_acceleration: S,
    /// Aerodynamic thrust coefficient C_T (Eq. 42a).
    pub thrust_coefficient: S,
    /// Aerodynamic roll-moment coefficient C_L about the hinge, hub frame.
    pub roll_coefficient: S,
    /// Aerodynamic pitch-moment coefficient C_M about the hinge, hub frame.
    pub pitch_coefficient: S,
}

/// Where a rotor's shaft stands: the rotor speed and the azimuth of blade 1.
#[derive(Debug, Clone, Copy)]
pub struct Shaft<S> {
    /// Speed Ω, rad/s.
    pub speed: S,
    /// Acceleration Ω', rad/s².
    pub acceleration: S,
    /// Sine of the azimuth of blade 1.
    pub sine: S,
    /// Cosine of the azimuth of blade 1.
    pub cosine: S,
}

impl<S: Scalar> Shaft<S> {
    /// The shaft without tangents.
    #[inline(always)]
    pub(super) fn value(&self) -> Shaft<f64> {
        Shaft {
            speed: self.speed.value(),
            acceleration: self.acceleration.value(),
            sine: self.sine.value(),
            cosine: self.cosine.value(),
        }
    }
}

/// What a rotor feels and is told, in its own hub frame.
#[derive(Debug, Clone, Copy)]
pub struct RotorInput<S> {
    /// Velocity of the hub through the air, m/s.
    pub velocity_hub: Vec3<S>,
    /// Angular velocity of the hub, rad/s.
    pub rate_hub: Vec3<S>,
    /// Angular velocity of the air about the hub, rad/s: it changes what the
    /// blades meet, not their inertia.
    pub air_rate_hub: [f64; 3],
    /// Multi-blade teeter angles β_1c, β_1s, rad (zero for a rigid rotor).
    pub flapping: [S; 2],
    /// Total inflow λ_0, λ_1c, λ_1s, positive down, on the nominal Ω R.
    pub inflow: [S; 3],
    /// Blade pitch θ_0, θ_1c, θ_1s, rad.
    pub pitch: [S; 3],
}

/// Hinge and mass of one blade of a problem's rotor.
fn blade_body(rotor: &problem::Rotor) -> BladeBody {
    let (m, first, second) =
        (rotor.blade_mass, rotor.blade_first_moment, rotor.blade_second_moment);
    let (sp, cp) = rotor.precone.sin_cos();
    let count = rotor.blades as f64;
    // A spring about a gimbal, as one about the flap hinge of each blade.
    let shares = if rotor.blades == 2 { count } else { 0.5 * count };
    let (under, spring, damping) = match rotor.hub_kind {
        HubKind::Teetering { undersling, spring, .. } => (undersling, spring / count, 0.0),
        HubKind::Gimballed { undersling, spring, damping, .. } => {
            (undersling, spring / shares, damping / shares)
        }
        HubKind::Articulated { spring, damping, .. } => (0.0, spring, damping),
        HubKind::Hingeless { damping, .. } => (0.0, rotor.flap_spring(), damping),
        HubKind::Rigid => (0.0, 0.0, 0.0),
    };
    BladeBody {
        offset: rotor.hub_kind.hinge_offset(),
        spring,
        damping,
        mass: m,
        first: [first * cp, m * under - first * sp],
        second: [
            second * cp * cp,
            m * under * under - 2.0 * under * first * sp + second * sp * sp,
            (under * first - second * sp) * cp,
        ],
    }
}

/// What the blades of a rotor meet at the hub, in its own hub frame.
pub(crate) struct HubFlow<S> {
    /// Velocity of the hub through the air, m/s.
    pub velocity: [S; 3],
    /// Rates p, q against the air, and that of the shaft, r − Ω, rad/s.
    pub slip: [S; 3],
    /// λ_0, λ_1c, λ_1s.
    pub inflow: [S; 3],
    /// θ_0, θ_1c, θ_1s, rad.
    pub pitch: [S; 3],
}

/// Flap of a blade, precone left out.
pub(crate) struct BladeFlap<S> {
    /// Sine and cosine of its angle.
    pub sin: S,
    pub cos: S,
    /// Angle, rad.
    pub angle: S,
    /// Rate, rad/s.
    pub rate: S,
}

/// Power that the air takes from the blades.
#[derive(Debug, Clone, Copy, Default)]
pub struct BladePower {
    /// Section drag times section speed, W.
    pub profile: f64,
    /// Blade force times induced velocity, W.
    pub induced: f64,
    /// What the sections meet.
    pub census: Census,
}

impl Spanwise {
    /// Value at a station, linear between breakpoints, constant beyond.
    #[must_use]
    pub fn at(&self, station: f64) -> f64 {
        let upper = self.station.partition_point(|&s| s < station);
        if upper == 0 {
            return self.value[0];
        }
        if upper == self.station.len() {
            return self.value[upper - 1];
        }
        let (a, b) = (self.station[upper - 1], self.station[upper]);
        let t = (station - a) / (b - a);
        self.value[upper - 1] + t * (self.value[upper] - self.value[upper - 1])
    }
}

impl Rotor {
    /// The rotor of a problem in the given air.
    ///
    /// # Errors
    /// An airfoil table that cannot be interpolated.
    pub fn new(
        rotor: &problem::Rotor,
        formulation: &Formulation,
        center_of_gravity: &problem::Station,
        air: &Air,
    ) -> Result<Self, VehicleError> {
        let offset = rotor.hub_kind.hinge_offset();
        let section = Section::new(&rotor.airfoil)
            .map_err(|source| VehicleError::Airfoil { of: rotor.name.clone(), source })?;
        let count = rotor.elements;
        let width = (1.0 - rotor.root_cutout) / count as f64;
        let elements = (0..count)
            .map(|k| {
                let inner = rotor.root_cutout + k as f64 * width;
                let station = inner + 0.5 * width;
                Element {
                    radius: station * rotor.radius - offset,
                    half_density_area: 0.5
                        * air.density
                        * rotor.chord.at(station)
                        * width
                        * rotor.radius,
                    twist: rotor.twist.at(station),
                    lifting: ((rotor.tip_loss - inner) / width).clamp(0.0, 1.0),
                }
            })
            .collect();
        let (teetering, undersling, spring, delta_3) = match rotor.hub_kind {
            HubKind::Teetering { undersling, spring, delta_3 } => {
                (true, undersling, spring, delta_3)
            }
            HubKind::Gimballed { undersling, delta_3, .. } => (false, undersling, 0.0, delta_3),
            HubKind::Articulated { delta_3, .. } | HubKind::Hingeless { delta_3, .. } => {
                (false, 0.0, 0.0, delta_3)
            }
            HubKind::Rigid => (false, 0.0, 0.0, 0.0),
        };
        let (n, m, first, second) = (
            rotor.blades as f64,
            rotor.blade_mass,
            rotor.blade_first_moment,
            rotor.blade_second_moment,
        );
        let (sp, cp) = rotor.precone.sin_cos();
        // Second moments ∫x², ∫y², ∫z² dm of all blades in the T frame. Two
        // blades lie in one plane; three or more spread evenly.
        let in_plane = n * second * cp * cp;
        let (xx, yy) =
            if rotor.blades == 2 { (in_plane, 0.0) } else { (0.5 * in_plane, 0.5 * in_plane) };
        let zz =
            n * (m * undersling * undersling - 2.0 * undersling * first * sp + second * sp * sp);
        let built = Self {
            name: rotor.name.clone(),
            position_body: position_body(&rotor.hub, center_of_gravity),
            frame: HubFrame::new(rotor.cant, rotor.tilt, rotor.direction),
            radius: rotor.radius,
            speed: rotor.speed,
            blades: rotor.blades,
            azimuth_offset: rotor.azimuth_offset,
            governor_time_constant: rotor
                .governor
                .map(|governor| governor.time_constant)
                .or(rotor.motor.map(|motor| motor.time_constant)),
            commanded: rotor.motor.is_some(),
            coefficients: rotor.coefficients,
            tip_loss: rotor.tip_loss,
            induced_power_factor: rotor.induced_power_factor,
            teetering,
            evaluated: rotor.blades,
            averaged: false,
            teeter_torque_tilt: formulation.teeter_torque_tilt,
            teeter_equation: formulation.teeter_equation,
            drive_train: rotor.drive_train,
            undersling,
            spring,
            tan_delta_3: delta_3.tan(),
            precone: rotor.precone,
            precone_turn: rotor.precone.sin_cos().into(),
            swashplate_phase: rotor.swashplate_phase,
            phase_turn: rotor.swashplate_phase.sin_cos().into(),
            offset,
            set: None,
            blade_mass_total: n * m,
            first_moment: n * (m * undersling - first * sp),
            inertia: [yy + zz, xx + zz, xx + yy],
            elements,
            section,
            small_angles: match rotor.airfoil {
                problem::Airfoil::Analytic {
                    lift_slope,
                    zero_lift_angle,
                    drag,
                    small_angles: true,
                    ..
                } => Some(SmallAngles { lift_slope, zero_lift_angle, drag }),
                _ => None,
            },
            sound_speed: air.sound_speed,
            density: air.density,
        };
        if let Some(RotorCoefficients { inertia, .. }) = rotor.coefficients {
            return Ok(Self {
                inertia: [0.5 * inertia, 0.5 * inertia, inertia],
                evaluated: 0,
                averaged: true,
                azimuth_offset: 0.0,
                ..built
            });
        }
        let one_body = matches!(rotor.hub_kind, HubKind::Teetering { .. } | HubKind::Rigid);
        Ok(if one_body { built } else { built.one_by_one(rotor, rotor.blades) })
    }

    /// The rotor blade by blade: as many blades evenly around, which share what
    /// the real ones have.
    fn one_by_one(mut self, rotor: &problem::Rotor, evaluated: usize) -> Self {
        let resolved = evaluated == self.blades && !self.averaged;
        let cyclic = (1..=(self.blades - 1) / 2).map(Mode::Cyclic);
        let modes: Vec<Mode> = match rotor.hub_kind {
            HubKind::Rigid => Vec::new(),
            HubKind::Teetering { .. } => vec![Mode::Teeter],
            HubKind::Gimballed { .. } if self.blades == 2 => vec![Mode::Teeter],
            HubKind::Gimballed { .. } => vec![Mode::Cyclic(1)],
            _ if !resolved => vec![Mode::Coning, Mode::Cyclic(1)],
            _ if self.blades == 2 => vec![Mode::Coning, Mode::Teeter],
            _ => {
                let alternate = self.blades.is_multiple_of(2).then_some(Mode::Reactionless);
                std::iter::once(Mode::Coning).chain(cyclic).chain(alternate).collect()
            }
        };
        let body = blade_body(rotor);
        let share = self.blades as f64 / evaluated as f64;
        for element in &mut self.elements {
            element.half_density_area *= share;
        }
        let about_shaft = body.second[0]
            + 2.0 * body.offset * body.first[0]
            + body.mass * body.offset * body.offset;
        self.inertia[2] = self.blades as f64 * about_shaft;
        self.evaluated = evaluated;
        self.teetering = false;
        self.set = Some(BladeSet::new(modes, evaluated, share, body));
        self
    }

    /// The rotor of a problem, averaged over its azimuth: its loads are those of
    /// a rotor of so many blades, evenly around, that more would make no
    /// difference, with as much blade area and inertia in all.
    ///
    /// # Errors
    /// As [`Rotor::new`], or a mean that does not converge with the number of
    /// azimuths.
    pub fn averaged(
        rotor: &problem::Rotor,
        formulation: &Formulation,
        center_of_gravity: &problem::Station,
        air: &Air,
    ) -> Result<Self, VehicleError> {
        let plain = Self::new(rotor, formulation, center_of_gravity, air)?;
        if plain.coefficients.is_some() {
            return Ok(plain);
        }
        let exact = plain.spread_evenly(MOST_AZIMUTHS).sample_loads();
        let scale = exact[2].abs();
        let near = |count: &usize| {
            let loads = plain.spread_evenly(*count).sample_loads();
            loads.iter().zip(exact).all(|(a, b)| (a - b).abs() < AVERAGING_TOLERANCE * scale)
        };
        let enough = AZIMUTHS.into_iter().find(near).ok_or_else(|| VehicleError::Averaging {
            rotor: rotor.name.clone(),
            azimuths: AZIMUTHS[AZIMUTHS.len() - 1],
        })?;
        if rotor.hub_kind == HubKind::Rigid {
            return Ok(plain.spread_evenly(enough));
        }
        let mut averaged = Self { averaged: true, azimuth_offset: 0.0, ..plain };
        averaged.set = None;
        // Blades that were shared out one by one already share with one each.
        Ok(averaged.one_by_one(rotor, enough))
    }

    /// The same blade area and inertia over as many azimuths, held rigidly.
    fn spread_evenly(&self, azimuths: usize) -> Self {
        let mut rotor = self.clone();
        let share = self.blades as f64 / azimuths as f64;
        for element in &mut rotor.elements {
            element.half_density_area *= share;
        }
        let [jx, jy, _] = self.inertia;
        let even = 0.5 * (jx + jy);
        rotor.inertia = [even, even, self.inertia[2]];
        rotor.azimuth_offset = 0.0;
        rotor.evaluated = azimuths;
        rotor.averaged = true;
        rotor.teetering = false;
        rotor.set = None;
        rotor
    }

    /// Force and moment over the radius in fast edgewise flight with all
    /// controls on, N, where means need most azimuths.
    fn sample_loads(&self) -> [f64; 6] {
        let tip_speed = self.tip_speed();
        let input = RotorInput {
            velocity_hub: Vec3([0.3 * tip_speed, 0.05 * tip_speed, 0.01 * tip_speed]),
            rate_hub: Vec3([0.0; 3]),
            air_rate_hub: [0.0; 3],
            flapping: [0.0; 2],
            inflow: [0.02, 0.005, 0.002],
            pitch: [0.15 - self.twist_at(0.75), 0.02, -0.05],
        };
        let shaft = Shaft { speed: self.speed, acceleration: 0.0, sine: 0.0, cosine: 1.0 };
        let loads = self.loads(&input, &shaft);
        let ([fx, fy, fz], [mx, my, mz]) = (loads.force_hub.0, loads.moment_hub.0);
        [fx, fy, fz, mx / self.radius, my / self.radius, mz / self.radius]
    }

    /// Whether the rotor acts with its mean over all azimuths.
    #[must_use]
    pub fn is_averaged(&self) -> bool {
        self.averaged
    }

    /// Azimuths at which an averaged rotor is evaluated; none where it is
    /// resolved.
    #[must_use]
    pub fn averaging_azimuths(&self) -> Option<usize> {
        self.averaged.then_some(self.evaluated)
    }

    /// Force scale ρπR²(ΩR)², N.
    #[must_use]
    pub fn force_scale(&self) -> f64 {
        self.density * PI * self.radius.powi(4) * self.speed * self.speed
    }

    /// Area of one blade ∫c dr, m².
    #[must_use]
    pub fn blade_area(&self) -> f64 {
        let share = self.evaluated as f64 / self.blades as f64;
        share * self.elements.iter().map(|e| e.half_density_area).sum::<f64>()
            / (0.5 * self.density)
    }

    /// Built-in twist of the element nearest to a station r/R, rad.
    #[must_use]
    pub fn twist_at(&self, station: f64) -> f64 {
        let off = |e: &Element| ((e.radius + self.offset) / self.radius - station).abs();
        self.elements.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map_or(0.0, |e| e.twist)
    }

    /// Tip speed ΩR at nominal speed, m/s.
    #[must_use]
    pub fn tip_speed(&self) -> f64 {
        self.speed * self.radius
    }

    /// Teeter angle and rate of blade 1 from multi-blade coordinates:
    /// variation of constants, so that β_T' has no rates of β_1c, β_1s.
    #[inline(always)]
    #[must_use]
    pub fn teeter<S: Scalar>(&self, flapping: &[S; 2], shaft: &Shaft<S>) -> [S; 2] {
        let [b1c, b1s] = *flapping;
        [
            b1c * shaft.cosine + b1s * shaft.sine,
            (b1s * shaft.cosine - b1c * shaft.sine) * shaft.speed,
        ]
    }

    /// Rates of β_1c, β_1s from the teeter acceleration of blade 1.
    #[inline(always)]
    #[must_use]
    pub fn flapping_rates<S: Scalar>(
        &self,
        [teeter_angle, teeter_rate]: [S; 2],
        teeter_acceleration: S,
        shaft: &Shaft<S>,
    ) -> [S; 2] {
        let slip = teeter_rate * shaft.acceleration / shaft.speed;
        let drive = teeter_angle * shaft.speed + (teeter_acceleration - slip) / shaft.speed;
        [-(shaft.sine * drive), shaft.cosine * drive]
    }

    /// Loads on a hub that does not accelerate.
    #[inline(always)]
    pub fn loads<S: Scalar>(&self, input: &RotorInput<S>, shaft: &Shaft<S>) -> RotorLoads<S> {
        self.loads_with(input, shaft, self.teeter_torque_tilt, self.teeter_equation)
    }

    /// [`Rotor::loads`], with in-plane moments that tilt with the blades or not
    /// and by either teeter equation.
    #[inline(always)]
    fn loads_with<S: Scalar>(
        &self,
        input: &RotorInput<S>,
        shaft: &Shaft<S>,
        torque_tilts: bool,
        teeter_equation: TeeterEquation,
    ) -> RotorLoads<S> {
        let [l0, l1c, l1s] = input.inflow;
        let [vx, vy, vz] = input.velocity_hub.0;
        // Rates against the air: what makes loads of it.
        let mut slip = input.rate_hub.0;
        for (rate, air) in slip.iter_mut().zip(input.air_rate_hub) {
            *rate = *rate - air;
        }
        let [slip_p, slip_q, slip_r] = slip;
        let omega = shaft.speed;
        let [beta_t1, beta_rate1] = self.teeter(&input.flapping, shaft);
        let (sin_t1, cos_t1) = beta_t1.sin_cos();
        let slip_z = slip_r - omega;
        let flow = HubFlow {
            velocity: [vx, vy, vz],
            slip: [slip_p, slip_q, slip_z],
            inflow: [l0, l1c, l1s],
            pitch: input.pitch,
        };
        let mut force = Vec3::<S>::default();
        let mut moment = Vec3::<S>::default();

        for blade in 0..self.evaluated {
            let (s, c) = if blade == 0 {
                (shaft.sine, shaft.cosine)
            } else if self.evaluated == 2 {
                (-shaft.sine, -shaft.cosine)
            } else {
                let (sk, ck) = (blade as f64 * TAU / self.evaluated as f64).sin_cos();
                (shaft.sine * ck + shaft.cosine * sk, shaft.cosine * ck - shaft.sine * sk)
            };
            let sign = if blade == 0 { 1.0 } else { -1.0 };
            let (beta_t, beta_rate, sin_t) = if self.teetering {
                (beta_t1 * sign, beta_rate1 * sign, sin_t1 * sign)
            } else {
                (S::default(), S::default(), S::default())
            };
            let cos_t = if self.teetering { cos_t1 } else { S::constant(1.0) };
            let flap = BladeFlap { sin: sin_t, cos: cos_t, angle: beta_t, rate: beta_rate };
            let ([fx, fy, fz], [mx, my, mz]) = self.blade_forces(&flow, &flap, s, c);
            force += Vec3([-(c * fx + s * fy), s * fx - c * fy, fz]);
            moment += Vec3([-(c * mx + s * my), s * mx - c * my, mz]);
        }

        if let Some(rotor) = &self.coefficients {
            let thrust = omega * omega * rotor.thrust;
            let drag = omega * -rotor.drag;
            force += Vec3([vx * drag, vy * drag, -thrust]);
            moment += Vec3([S::default(), S::default(), thrust * rotor.torque]);
        }

        // The blades as one rigid body in the T frame of blade 1.
        let (s, c) = (shaft.sine, shaft.cosine);
        let [p, q, r] = input.rate_hub.0;
        let omega_x = q * s - p * c;
        let omega_y = -(p * s + q * c);
        let omega_z = r - omega;
        let (tilt_s, tilt_c) =
            if self.teetering { (sin_t1, cos_t1) } else { (S::default(), S::constant(1.0)) };
        let beta_rate = if self.teetering { beta_rate1 } else { S::default() };
        let rate = Vec3([
            tilt_c * omega_x - tilt_s * omega_z,
            omega_y + beta_rate,
            tilt_s * omega_x + tilt_c * omega_z,
        ]);
        // Acceleration of T less its own teeter acceleration: the shaft turns
        // with the hub, and the hinge with the shaft.
        let alpha_f = [
            -(omega * omega_y) - beta_rate * omega_z,
            omega * omega_x,
            beta_rate * omega_x - shaft.acceleration,
        ];
        let mut alpha = [
            tilt_c * alpha_f[0] - tilt_s * alpha_f[2],
            alpha_f[1],
            tilt_s * alpha_f[0] + tilt_c * alpha_f[2],
        ];
        let [jx, jy, jz] = self.inertia;
        let [wx, wy, wz] = rate.0;
        if self.teetering && self.drive_train == DriveTrain::Soft {
            // The blades' own flapping against the shaft makes the moment
            // −(J_z + J_y − J_x) Ω β' sin β about k_T. A soft shaft lets it go
            // into an acceleration of the blades instead; both have no mean.
            let ripple = tilt_s * beta_rate * omega * (jz + jy - jx);
            let gained = ripple * (1.0 / jz);
            alpha[2] -= gained;
            alpha[0] += tilt_s * gained / tilt_c;
        }
        let (mx_f, my_f) =
            (s * moment.0[1] - c * moment.0[0], -(s * moment.0[0] + c * moment.0[1]));
        let moment_f = [mx_f, my_f, moment.0[2]];
        let aero_t = [
            tilt_c * moment_f[0] - tilt_s * moment_f[2],
            moment_f[1],
            tilt_s * moment_f[0] + tilt_c * moment_f[2],
        ];
        // In-plane moments tilt with the blades. The switch puts them about the
        // shaft, those of the air too, and in-plane forces at the hinge: nothing
        // is left about the line of the blades.
        let untilted = self.teetering && !torque_tilts;
        if untilted {
            moment = Vec3([-(s * aero_t[1]), -(c * aero_t[1]), aero_t[2]]);
        }
        let scale = 1.0 / self.force_scale();
        let thrust_coefficient = force.0[2] * -scale;
        let roll_coefficient = moment.0[0] * (scale / self.radius);
        let pitch_coefficient = moment.0[1] * (scale / self.radius);
        let gyro_y = wx * wz * (jx - jz);
        let (alpha_y, teeter_acceleration, hub_my) = if self.teetering {
            let spring = beta_t1 * self.spring;
            let alpha_y = match teeter_equation {
                TeeterEquation::Exact => (aero_t[1] - spring - gyro_y) * (1.0 / jy),
                // Eq. 54: the shaft's rate in place of ω_z, small angles.
                TeeterEquation::SmallAngles => {
                    let turning = (omega_x * 2.0 + beta_t1 * omega) * omega;
                    (aero_t[1] - spring) * (1.0 / jy) - turning + alpha[1]
                }
            };
            (alpha_y, alpha_y - alpha[1], spring)
        } else {
            (alpha[1], S::default(), aero_t[1] - alpha[1] * jy - gyro_y)
        };
        let hub_t = [
            aero_t[0] - alpha[0] * jx - wy * wz * (jz - jy),
            hub_my,
            aero_t[2] - alpha[2] * jz - wx * wy * (jy - jx),
        ];
        let hub_f = if untilted {
            [S::default(), hub_t[1], hub_t[2]]
        } else {
            [tilt_c * hub_t[0] + tilt_s * hub_t[2], hub_t[1], tilt_c * hub_t[2] - tilt_s * hub_t[0]]
        };
        let moment_hub =
            Vec3([-(c * hub_f[0] + s * hub_f[1]), s * hub_f[0] - c * hub_f[1], hub_f[2]]);
        let sz = -self.first_moment;
        let inertial_t =
            [(alpha_y + wx * wz) * sz, (wy * wz - alpha[0]) * sz, (wx * wx + wy * wy) * -sz];
        let inertial_f = [
            tilt_c * inertial_t[0] + tilt_s * inertial_t[2],
            inertial_t[1],
            tilt_c * inertial_t[2] - tilt_s * inertial_t[0],
        ];
        let force_hub = force
            + Vec3([
                -(c * inertial_f[0] + s * inertial_f[1]),
                s * inertial_f[0] - c * inertial_f[1],
                inertial_f[2],
            ]);
        RotorLoads {
            force_hub,
            moment_hub,
            teeter_acceleration,
            thrust_coefficient,
            roll_coefficient,
            pitch_coefficient,
        }
    }

    /// Force of the air on a blade, and its moment about the flap hinge, in F,
    /// from the sine and cosine of its azimuth.
    #[inline(always)]
    pub(crate) fn blade_forces<S: Scalar>(
        &self,
        hub: &HubFlow<S>,
        flap: &BladeFlap<S>,
        s: S,
        c: S,
    ) -> ([S; 3], [S; 3]) {
        let ([sin_precone, cos_precone], [sin_phase, cos_phase]) =
            (self.precone_turn, self.phase_turn);
        let ([vx, vy, vz], [slip_p, slip_q, slip_z]) = (hub.velocity, hub.slip);
        let [l0, l1c, l1s] = hub.inflow;
        let BladeFlap { sin: sin_t, cos: cos_t, angle: beta_t, rate: beta_rate } = *flap;
        let sin_b = sin_t * cos_precone + cos_t * sin_precone;
        let cos_b = cos_t * cos_precone - sin_t * sin_precone;
        let u_f = vy * s - vx * c;
        let mut v_f = -(vx * s + vy * c);
        let mut w_f = vz;
        // Rates of F against the air.
        let omega_x = slip_q * s - slip_p * c;
        let omega_y = -(slip_p * s + slip_q * c);
        let flapping = beta_rate + omega_y;
        // Inflow is scaled by the nominal tip speed, whatever the governor does.
        let inflow_slope = (l1c * c + l1s * s) * self.speed;
        let mut inflow_root = l0 * self.tip_speed();
        if self.offset != 0.0 {
            v_f += slip_z * self.offset;
            w_f -= omega_y * self.offset;
            inflow_root += inflow_slope * self.offset;
        }
        let e = self.undersling;
        let pitch = hub.pitch[0]
            + hub.pitch[1] * (c * cos_phase + s * sin_phase)
            + hub.pitch[2] * (s * cos_phase - c * sin_phase)
            + beta_t * self.tan_delta_3;
        let flow = [
            (omega_x * cos_t - slip_z * sin_t) * e - v_f,
            -(omega_x * sin_b + slip_z * cos_b),
            u_f * sin_b + w_f * cos_b + flapping * (e * sin_precone) - inflow_root * cos_b,
            -flapping - inflow_slope * cos_b,
            u_f * cos_b - w_f * sin_b + flapping * (e * cos_precone) + inflow_root * sin_b,
            inflow_slope * sin_b,
            pitch,
        ];
        let [f_t, f_p, r_f_t, r_f_p] = self.blade(&flow);
        // Blade frame to F: force (0, −F_T, F_P), moment about the
        // attachment (0, −∫r f_P, −∫r f_T), attachment at e k_T.
        let (fx, fy, fz) = (sin_b * f_p, -f_t, cos_b * f_p);
        let (px, pz) = (sin_t * e, cos_t * e);
        let mx = -(sin_b * r_f_t) - pz * fy;
        let my = pz * fx - px * fz - r_f_p;
        let mz = px * fy - cos_b * r_f_t;
        ([fx, fy, fz], [mx, my, mz])
    }

    /// Rows of the rotation from the rotor's hub frame to the frame in which
    /// its inertia is diagonal (T for a teetering rotor, F for a rigid one).
    #[inline(always)]
    pub fn hub_to_blades<S: Scalar>(&self, teeter_angle: S, shaft: &Shaft<S>) -> [Vec3<S>; 3] {
        let (s, c) = (shaft.sine, shaft.cosine);
        let (st, ct) =
            if self.teetering { teeter_angle.sin_cos() } else { (S::default(), S::constant(1.0)) };
        [
            Vec3([-(c * ct), s * ct, -st]),
            Vec3([-s, -c, S::default()]),
            Vec3([-(c * st), s * st, ct]),
        ]
    }

    /// What acceleration of the hub adds: force and moment on the hub (hub
    /// frame) and teeter acceleration, linear in the acceleration of the hub
    /// less gravity and in its angular acceleration (both hub frame). The
    /// blade mass at the hub itself is the airframe's.
    #[inline(always)]
    pub fn acceleration_loads<S: Scalar>(
        &self,
        blades: &[Vec3<S>; 3],
        acceleration_hub: Vec3<S>,
        angular_acceleration_hub: Vec3<S>,
    ) -> (Vec3<S>, Vec3<S>, S) {
        self.acceleration_loads_tilting(
            blades,
            acceleration_hub,
            angular_acceleration_hub,
            self.teeter_torque_tilt,
        )
    }

    #[inline(always)]
    fn acceleration_loads_tilting<S: Scalar>(
        &self,
        blades: &[Vec3<S>; 3],
        acceleration_hub: Vec3<S>,
        angular_acceleration_hub: Vec3<S>,
        torque_tilts: bool,
    ) -> (Vec3<S>, Vec3<S>, S) {
        let a = blades.map(|row| row.dot(acceleration_hub));
        let w = blades.map(|row| row.dot(angular_acceleration_hub));
        let sz = self.first_moment;
        let [jx, jy, jz] = self.inertia;
        let (alpha_y, my, teeter) = if self.teetering {
            let alpha_y = a[0] * (-sz / jy);
            (alpha_y, S::default(), alpha_y - w[1])
        } else {
            (w[1], w[1] * -jy - a[0] * sz, S::default())
        };
        let force = [alpha_y * -sz, w[0] * sz, S::default()];
        let moment = [w[0] * -jx + a[1] * sz, my, w[2] * -jz];
        let moment_hub = if torque_tilts || !self.teetering {
            unresolved(blades, moment)
        } else {
            // In-plane moments about the shaft; the hinge carries none.
            Vec3([S::default(), S::default(), moment[2]])
        };
        (unresolved(blades, force), moment_hub, teeter)
    }

    /// ∫f_T, ∫f_P, ∫r f_T, ∫r f_P over a blade (Eqs. 34, 38): N and N m, f_T
    /// forward along the motion, f_P down, from the flow `[u_T0, u_T1, u_P0,
    /// u_P1, u_R0, u_R1, root pitch]`, speeds `u_0 + u_1 r`.
    #[inline(always)]
    fn blade<S: Scalar>(&self, flow: &[S; 7]) -> [S; 4] {
        let value = flow.map(S::value);
        if S::TANGENTS == 0 {
            self.blade_loads(&value).map(S::constant)
        } else {
            let (loads, partials) = self.blade_loads_with_partials(&value);
            let mut result = [S::default(); 4];
            for k in 0..4 {
                result[k] = S::chain(loads[k], &partials[k], flow);
            }
            result
        }
    }

    /// Blade loads by Eqs. 35, the sums of the other two in their exact form:
    /// f_T = ½ρc [a (u_T θ + u_P) u_P − δ u_T²], f_P = −½ρc a (u_T² θ + u_P u_T),
    /// θ from zero lift.
    #[inline(always)]
    fn small_angle_loads<S: Scalar>(&self, section: SmallAngles, flow: &[S; 7]) -> [S; 4] {
        let [t0, t1, p0, p1, _, _, pitch] = *flow;
        let mut sum = [S::default(); 4];
        for element in &self.elements {
            let r = element.radius;
            let (ut, up) = (t1 * r + t0, p1 * r + p0);
            let angle = pitch + (element.twist - section.zero_lift_angle);
            let lift = (ut * angle + up) * (section.lift_slope * element.lifting);
            let f_t = (lift * up - ut * ut * section.drag) * element.half_density_area;
            let f_p = lift * ut * -element.half_density_area;
            sum[0] += f_t;
            sum[1] += f_p;
            sum[2] += f_t * r;
            sum[3] += f_p * r;
        }
        sum
    }

    #[inline(never)]
    fn blade_loads(&self, flow: &[f64; 7]) -> [f64; 4] {
        if let Some(section) = self.small_angles {
            return self.small_angle_loads(section, flow);
        }
        let [t0, t1, p0, p1, r0, r1, pitch] = *flow;
        let inverse_sound = 1.0 / self.sound_speed;
        let mut sum = [0.0; 4];
        // A few elements side by side, which all but the table can be in
        // vector instructions.
        let (blocks, rest) = self.elements.as_chunks::<LANES>();
        for block in blocks {
            let [mut ut, mut up, mut u, mut mach] = [[0.0; LANES]; 4];
            for k in 0..LANES {
                let r = block[k].radius;
                let ur = r0 + r1 * r;
                (ut[k], up[k]) = (t0 + t1 * r, p0 + p1 * r);
                let u2 = ut[k] * ut[k] + up[k] * up[k];
                u[k] = u2.sqrt();
                mach[k] = (u2 + ur * ur).sqrt() * inverse_sound;
            }
            let angle = arc_tangents(&up, &ut);
            let [mut lift, mut drag] = [[0.0; LANES]; 2];
            for k in 0..LANES {
                let alpha = pitch + block[k].twist + angle[k];
                (lift[k], drag[k]) = self.section.lift_drag(alpha, mach[k]);
            }
            for k in 0..LANES {
                let loads = block[k].loads(ut[k], up[k], u[k], lift[k], drag[k]);
                for (sum, load) in sum.iter_mut().zip(loads) {
                    *sum += load;
                }
            }
        }
        for element in rest {
            let r = element.radius;
            let (ut, up, ur) = (t0 + t1 * r, p0 + p1 * r, r0 + r1 * r);
            let u2 = ut * ut + up * up;
            let mach = (u2 + ur * ur).sqrt() * inverse_sound;
            let alpha = pitch + element.twist + arc_tangent(up, ut);
            let (lift, drag) = self.section.lift_drag(alpha, mach);
            let loads = element.loads(ut, up, u2.sqrt(), lift, drag);
            for (sum, load) in sum.iter_mut().zip(loads) {
                *sum += load;
            }
        }
        sum
    }

    #[inline(never)]
    fn blade_loads_with_partials(&self, flow: &[f64; 7]) -> ([f64; 4], [[f64; 7]; 4]) {
        if let Some(section) = self.small_angles {
            let mut local = [Dual::<7>::default(); 7];
            for (k, variable) in local.iter_mut().enumerate() {
                *variable = Dual::variable(flow[k], k);
            }
            let loads = self.small_angle_loads(section, &local);
            return (loads.map(|load| load.v), loads.map(|load| load.d));
        }
        let mut sums = PartialSums::default();
        let (blocks, rest) = self.elements.as_chunks::<LANES>();
        for block in blocks {
            self.add_partials(block, flow, &mut sums);
        }
        for element in rest {
            self.add_partials(std::array::from_ref(element), flow, &mut sums);
        }
        let PartialSums { sum, by_t, by_p, by_r, by_pitch } = sums;
        let mut partials = [[0.0; 7]; 4];
        for load in 0..2 {
            for order in 0..2 {
                partials[load + 2 * order] = [
                    by_t[load][order],
                    by_t[load][order + 1],
                    by_p[load][order],
                    by_p[load][order + 1],
                    by_r[load][order],
                    by_r[load][order + 1],
                    by_pitch[load][order],
                ];
            }
        }
        (sum, partials)
    }

    /// Loads of elements side by side and their slopes, added one element after
    /// the other: the bits do not depend on how many are taken at a time.
    #[inline(always)]
    fn add_partials<const L: usize>(
        &self,
        elements: &[Element; L],
        flow: &[f64; 7],
        sums: &mut PartialSums,
    ) {
        let [t0, t1, p0, p1, r0, r1, pitch] = *flow;
        let inverse_sound = 1.0 / self.sound_speed;
        let [mut ut, mut up, mut ur, mut u2, mut total] = [[0.0; L]; 5];
        for k in 0..L {
            let r = elements[k].radius;
            (ut[k], up[k], ur[k]) = (t0 + t1 * r, p0 + p1 * r, r0 + r1 * r);
            u2[k] = ut[k] * ut[k] + up[k] * up[k];
            total[k] = (u2[k] + ur[k] * ur[k]).sqrt();
        }
        let angle = arc_tangents(&up, &ut);
        // Lift and drag, and their slopes with angle of attack and Mach.
        let mut section = [[0.0; L]; 6];
        for k in 0..L {
            let alpha = pitch + elements[k].twist + angle[k];
            let s = self.section.coefficients(alpha, total[k] * inverse_sound);
            let lifting = elements[k].lifting;
            let row = [
                s.lift * lifting,
                s.drag,
                s.lift_alpha * lifting,
                s.drag_alpha,
                s.lift_mach * lifting,
                s.drag_mach,
            ];
            for (all, value) in section.iter_mut().zip(row) {
                all[k] = value;
            }
        }
        let [lift, drag, lift_a, drag_a, lift_m, drag_m] = section;
        let mut force = [[0.0; L]; 2];
        // By u_T, u_P, u_R, pitch.
        let mut partial = [[[0.0; L]; 4]; 2];
        for k in 0..L {
            let (ut, up, ur, u2, total) = (ut[k], up[k], ur[k], u2[k], total[k]);
            let (lift, drag) = (lift[k], drag[k]);
            let q = elements[k].half_density_area * u2.sqrt();
            let (f_t, f_p) = (q * (lift * up - drag * ut), q * -(lift * ut + drag * up));
            (force[0][k], force[1][k]) = (f_t, f_p);
            let inverse_u2 = if u2 > 0.0 { 1.0 / u2 } else { 0.0 };
            let inverse_total = if total > 0.0 { inverse_sound / total } else { 0.0 };
            // Slopes of f with angle of attack and Mach.
            let t_a = q * (lift_a[k] * up - drag_a[k] * ut);
            let p_a = -q * (lift_a[k] * ut + drag_a[k] * up);
            let t_m = q * (lift_m[k] * up - drag_m[k] * ut);
            let p_m = -q * (lift_m[k] * ut + drag_m[k] * up);
            let (a_t, a_p) = (-up * inverse_u2, ut * inverse_u2);
            let (m_t, m_p, m_r) = (ut * inverse_total, up * inverse_total, ur * inverse_total);
            let (s_t, s_p) = (ut * inverse_u2, up * inverse_u2);
            partial[0][0][k] = f_t * s_t - q * drag + t_a * a_t + t_m * m_t;
            partial[0][1][k] = f_t * s_p + q * lift + t_a * a_p + t_m * m_p;
            partial[0][2][k] = t_m * m_r;
            partial[0][3][k] = t_a;
            partial[1][0][k] = f_p * s_t - q * lift + p_a * a_t + p_m * m_t;
            partial[1][1][k] = f_p * s_p - q * drag + p_a * a_p + p_m * m_p;
            partial[1][2][k] = p_m * m_r;
            partial[1][3][k] = p_a;
        }
        for k in 0..L {
            let r = elements[k].radius;
            for load in 0..2 {
                sums.sum[load] += force[load][k];
                sums.sum[2 + load] += r * force[load][k];
                for (order, power) in [1.0, r, r * r].into_iter().enumerate() {
                    sums.by_t[load][order] += partial[load][0][k] * power;
                    sums.by_p[load][order] += partial[load][1][k] * power;
                    sums.by_r[load][order] += partial[load][2][k] * power;
                }
                sums.by_pitch[load][0] += partial[load][3][k];
                sums.by_pitch[load][1] += partial[load][3][k] * r;
            }
        }
    }

    /// Power that the air takes from all blades, section by section.
    #[must_use]
    pub fn blade_power(&self, input: &RotorInput<f64>, shaft: &Shaft<f64>) -> BladePower {
        let [angle, rate] = self.teeter(&input.flapping, shaft);
        let flap = |blade: usize| {
            if !self.teetering {
                [0.0; 2]
            } else if blade == 0 {
                [angle, rate]
            } else {
                [-angle, -rate]
            }
        };
        self.power_of(input, shaft, flap)
    }

    /// The same for blades with these flap angles and rates.
    pub(crate) fn power_of(
        &self,
        input: &RotorInput<f64>,
        shaft: &Shaft<f64>,
        flap: impl Fn(usize) -> [f64; 2],
    ) -> BladePower {
        let mut probe = PowerProbe { rotor: self, power: BladePower::default() };
        probe.run(input, shaft, flap);
        probe.power
    }

    /// Shaft power, W, that goes into no work of the blades, because a switch
    /// leaves exact mechanics: in-plane moments about the shaft while the
    /// blades teeter (the work of the moment on the hub less that of the exact
    /// one), or the small-angle teeter equation (less the work of the moment
    /// that it lacks). Zero without either. `acceleration` holds the hub's
    /// acceleration less gravity and its angular acceleration, hub frame.
    #[must_use]
    pub fn inexact_power(
        &self,
        input: &RotorInput<f64>,
        shaft: &Shaft<f64>,
        blades: &[Vec3<f64>; 3],
        acceleration: (Vec3<f64>, Vec3<f64>),
    ) -> f64 {
        if !self.teetering {
            return 0.0;
        }
        let mut power = 0.0;
        if !self.teeter_torque_tilt {
            let moment = |tilts: bool| {
                self.loads_with(input, shaft, tilts, self.teeter_equation).moment_hub
                    + self
                        .acceleration_loads_tilting(blades, acceleration.0, acceleration.1, tilts)
                        .1
            };
            let surplus = moment(false) - moment(true);
            power += surplus.0[2] * shaft.speed - surplus.dot(input.rate_hub);
        }
        if self.teeter_equation != TeeterEquation::Exact {
            let teeter = |equation: TeeterEquation| {
                self.loads_with(input, shaft, true, equation).teeter_acceleration
            };
            let lacking =
                self.inertia[1] * (teeter(self.teeter_equation) - teeter(TeeterEquation::Exact));
            let [_, teeter_rate] = self.teeter(&input.flapping, shaft);
            let [p, q, _] = input.rate_hub.0;
            power -= lacking * (teeter_rate - p * shaft.sine - q * shaft.cosine);
        }
        power
    }
}

/// A vector in hub axes from its components along the rows of a rotation.
#[inline(always)]
fn unresolved<S: Scalar>(rows: &[Vec3<S>; 3], components: [S; 3]) -> Vec3<S> {
    rows[0].scale(components[0]) + rows[1].scale(components[1]) + rows[2].scale(components[2])
}

/// Walks the blades once more in plain numbers to split their power.
struct PowerProbe<'a> {
    rotor: &'a Rotor,
    power: BladePower,
}

impl PowerProbe<'_> {
    fn run(
        &mut self,
        input: &RotorInput<f64>,
        shaft: &Shaft<f64>,
        flap: impl Fn(usize) -> [f64; 2],
    ) {
        let rotor = self.rotor;
        let [vx, vy, vz] = input.velocity_hub.0;
        let [p, q, r] = [0, 1, 2].map(|k| input.rate_hub.0[k] - input.air_rate_hub[k]);
        for blade in 0..rotor.evaluated {
            let azimuth =
                shaft.sine.atan2(shaft.cosine) + blade as f64 * TAU / rotor.evaluated as f64;
            let (s, c) = azimuth.sin_cos();
            let [beta_t, beta_rate] = flap(blade);
            let beta = beta_t + rotor.precone;
            // Velocities by the cross product, not by the expanded forms.
            let velocity_f = Vec3([vy * s - vx * c, -vx * s - vy * c, vz]);
            let rate_f = Vec3([q * s - p * c, -p * s - q * c, r - shaft.speed]);
            let flap_f = Vec3([0.0, beta_rate, 0.0]);
            let hinge = Vec3([rotor.offset, 0.0, 0.0]);
            let pitch = input.pitch[0]
                + input.pitch[1] * (azimuth - rotor.swashplate_phase).cos()
                + input.pitch[2] * (azimuth - rotor.swashplate_phase).sin()
                + beta_t * rotor.tan_delta_3;
            let ((sin_t, cos_t), (sin_b, cos_b)) = (beta_t.sin_cos(), beta.sin_cos());
            let blade_k = Vec3([sin_b, 0.0, cos_b]);
            let blade_i = Vec3([cos_b, 0.0, -sin_b]);
            for element in &rotor.elements {
                let x = element.radius;
                let e = rotor.undersling;
                let place = Vec3([e * sin_t + x * cos_b, 0.0, e * cos_t - x * sin_b]);
                let inflow = rotor.speed
                    * (rotor.radius * input.inflow[0]
                        + (rotor.offset + x) * (input.inflow[1] * c + input.inflow[2] * s));
                let air_f = velocity_f + rate_f.cross(place + hinge) + flap_f.cross(place)
                    - Vec3([0.0, 0.0, inflow]);
                let (ut, up, ur) = (-air_f.0[1], air_f.dot(blade_k), air_f.dot(blade_i));
                let flow = SectionFlow {
                    station: (rotor.offset + x) / rotor.radius,
                    azimuth,
                    angle_of_attack: pitch + element.twist + arc_tangent(up, ut),
                    mach: (ut * ut + up * up + ur * ur).sqrt() / rotor.sound_speed,
                    along_chord: ut / rotor.tip_speed(),
                };
                self.power.census.add(&rotor.section, flow);
                if let Some(section) = rotor.small_angles {
                    // Lift does no work here; drag works along u_T.
                    let angle = pitch + element.twist - section.zero_lift_angle;
                    let lift = section.lift_slope * element.lifting * (ut * angle + up);
                    let k = element.half_density_area;
                    self.power.profile += k * section.drag * ut * ut * ut;
                    self.power.induced += k * lift * ut * cos_b * inflow;
                    continue;
                }
                let u2 = ut * ut + up * up;
                let (u, mach) = (u2.sqrt(), (u2 + ur * ur).sqrt() / rotor.sound_speed);
                let (lift, drag) =
                    rotor.section.lift_drag(pitch + element.twist + arc_tangent(up, ut), mach);
                let lift = lift * element.lifting;
                let k = element.half_density_area * u;
                let f_p = -k * (lift * ut + drag * up);
                self.power.profile += k * drag * u * u;
                self.power.induced -= f_p * cos_b * inflow;
            }
        }
    }
}

/// Rotor loads as a local function: constant speed, 14 inputs.
pub(super) struct LoadsAtSpeed<'a> {
    pub rotor: &'a Rotor,
    /// Sine and cosine of the azimuth of blade 1.
    pub azimuth: (f64, f64),
    /// Angular velocity of the air, hub frame, rad/s.
    pub air_rate_hub: [f64; 3],
}

impl Local<14, 10> for LoadsAtSpeed<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 14]) -> [T; 10] {
        let shaft = Shaft {
            speed: T::constant(self.rotor.speed),
            acceleration: T::default(),
            sine: T::constant(self.azimuth.0),
            cosine: T::constant(self.azimuth.1),
        };
        pack(self.rotor.loads(&unpack(&x[..14], self.air_rate_hub), &shaft))
    }
}

/// Rotor loads as a local function: governed speed, 17 inputs.
pub(super) struct LoadsGoverned<'a> {
    pub rotor: &'a Rotor,
    /// Angular velocity of the air, hub frame, rad/s.
    pub air_rate_hub: [f64; 3],
}

impl Local<18, 10> for LoadsGoverned<'_> {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, x: &[T; 18]) -> [T; 10] {
        let shaft = Shaft { speed: x[14], acceleration: x[15], sine: x[16], cosine: x[17] };
        pack(self.rotor.loads(&unpack(&x[..14], self.air_rate_hub), &shaft))
    }
}

#[inline(always)]
pub(super) fn unpack<T: Scalar>(x: &[T], air_rate_hub: [f64; 3]) -> RotorInput<T> {
    RotorInput {
        velocity_hub: Vec3([x[0], x[1], x[2]]),
        rate_hub: Vec3([x[3], x[4], x[5]]),
        air_rate_hub,
        flapping: [x[6], x[7]],
        inflow: [x[8], x[9], x[10]],
        pitch: [x[11], x[12], x[13]],
    }
}

#[inline(always)]
fn pack<T: Scalar>(loads: RotorLoads<T>) -> [T; 10] {
    let ([fx, fy, fz], [mx, my, mz]) = (loads.force_hub.0, loads.moment_hub.0);
    [
        fx,
        fy,
        fz,
        mx,
        my,
        mz,
        loads.teeter_acceleration,
        loads.thrust_coefficient,
        loads.roll_coefficient,
        loads.pitch_coefficient,
    ]
}
