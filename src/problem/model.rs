//! The checked problem: what a problem file means, in SI units and radians.
//!
//! Everything here is plain data that has passed every check of
//! [`crate::problem`]: finite, dimensioned, within physical bounds, and with
//! every name resolved. The vehicle model is built from it and never sees a
//! file, a unit string or a raw table.

use std::sync::Arc;

use crate::units::System;

/// A rotorcraft and the modelling choices to fly it with.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Short name, used in titles and file names.
    pub name: String,
    /// One-line description for reports.
    pub description: String,
    /// Publication whose numbers are shown beside the results.
    pub reference: Option<Reference>,
    /// Units that results are shown in, if the file states them.
    pub units: Option<System>,
    /// Mass, centre of gravity and inertia of the whole aircraft.
    pub mass: MassProperties,
    /// Air that the aircraft flies in.
    pub atmosphere: AtmosphereConditions,
    /// Fuselage bodies, possibly none.
    pub fuselages: Vec<Fuselage>,
    /// Rotors, at least one, in the order of the file.
    pub rotors: Vec<Rotor>,
    /// Wings and tail surfaces, possibly none.
    pub wings: Vec<Wing>,
    /// Inflow and rotor-on-rotor interference choices.
    pub inflow: InflowOptions,
    /// Published formulas in place of exact ones.
    pub formulation: Formulation,
    /// From the pilot's sticks to the blades.
    pub controls: Controls,
}

/// A publication that results can be compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reference {
    /// Kreienkamp, Saetti, Özkurt and Fichter, *Flight Dynamics and Control of a
    /// Coaxial-Teetering Rotor Ultralight Helicopter with Rotor-on-Rotor
    /// Interactions*.
    Coax2dPaper,
}

/// A point in the aircraft's drawing coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Fuselage station, m, positive aft.
    pub fuselage_station: f64,
    /// Butt line, m, positive to starboard.
    pub butt_line: f64,
    /// Water line, m, positive up.
    pub water_line: f64,
}

/// Mass, centre of gravity and inertia of the whole aircraft, with the blades
/// of each rotor counted as a point mass at its hub.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// Gross mass, kg.
    pub mass: f64,
    /// Centre of gravity.
    pub center_of_gravity: Station,
    /// Moments of inertia about the centre of gravity, body axes, kg m².
    pub i_xx: f64,
    /// Pitch moment of inertia, kg m².
    pub i_yy: f64,
    /// Yaw moment of inertia, kg m².
    pub i_zz: f64,
    /// Product of inertia ∫xz dm, kg m² (enters the tensor as −I_xz).
    pub i_xz: f64,
    /// Product of inertia ∫xy dm, kg m².
    pub i_xy: f64,
    /// Product of inertia ∫yz dm, kg m².
    pub i_yz: f64,
}

/// Air that the aircraft flies in: US Standard Atmosphere 1976.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtmosphereConditions {
    /// Geopotential pressure altitude, m.
    pub altitude: f64,
    /// Temperature above the standard day, K.
    pub temperature_offset: f64,
}

/// What the wakes of the rotors do to a body or wing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wash {
    /// Nothing.
    #[default]
    None,
    /// The induced velocity is added to the local velocity.
    Full,
    /// The induced velocity turns the local flow, but the dynamic pressure
    /// stays that of the free stream.
    AngleOnly,
}

/// A fuselage body.
#[derive(Debug, Clone)]
pub struct Fuselage {
    /// Name in the file.
    pub name: String,
    /// Where its forces act.
    pub position: Station,
    /// Its forces.
    pub aerodynamics: FuselageAerodynamics,
    /// Rotor wash on it.
    pub wash: Wash,
}

/// Forces and moments of a fuselage.
#[derive(Debug, Clone)]
pub enum FuselageAerodynamics {
    /// Equivalent flat plates: force −½ρ S C |u| u on each body axis.
    FlatPlate {
        /// Areas normal to the x, y and z body axes, m².
        area: [f64; 3],
        /// Drag coefficient that multiplies each area, 1.
        drag_coefficient: [f64; 3],
    },
    /// Loads per dynamic pressure over angles of attack and sideslip.
    Table(Arc<FuselageTable>),
}

/// Fuselage loads per dynamic pressure on a grid of angle of attack and
/// sideslip, body axes, about the fuselage position.
#[derive(Debug, Clone)]
pub struct FuselageTable {
    /// Angles of attack atan2(w, u), rad, strictly increasing.
    pub angle_of_attack: Vec<f64>,
    /// Sideslip angles asin(v/V), rad, strictly increasing.
    pub sideslip: Vec<f64>,
    /// X/q, Y/q, Z/q in m² and L/q, M/q, N/q in m³, each
    /// `[angle_of_attack][sideslip]`, row-major.
    pub loads: [Vec<f64>; 6],
}

/// Direction of rotation seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Counter-clockwise seen from above: the frame of the theory.
    CounterClockwise,
    /// Clockwise seen from above: the mirrored frame.
    Clockwise,
}

/// A quantity along the span: breakpoints in r/R, linear between, constant
/// beyond the ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Spanwise {
    /// r/R, strictly increasing, within 0…1, at least one.
    pub station: Vec<f64>,
    /// Value at each station.
    pub value: Vec<f64>,
}

/// How the blades are joined to the shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HubKind {
    /// Two blades on one teeter hinge.
    Teetering {
        /// Distance of the blade attachment below the teeter hinge, m.
        undersling: f64,
        /// Teeter spring, N m/rad.
        spring: f64,
        /// Pitch–flap coupling angle δ3, rad; pitch changes by β_T tan δ3.
        delta_3: f64,
    },
    /// Blades that neither flap nor teeter.
    Rigid,
    /// Blades that flap together on a gimbal: by β_1c cos ψ + β_1s sin ψ, so that
    /// the disk tilts as one. Two blades on a gimbal teeter.
    Gimballed {
        /// Distance of the blade attachments below the gimbal, m.
        undersling: f64,
        /// Spring against tilt about any axis, N m/rad; of two blades about
        /// their hinge.
        spring: f64,
        /// Damping of the tilt in the turning frame, N m s/rad.
        damping: f64,
        /// Pitch–flap coupling angle δ3, rad; pitch changes by β tan δ3.
        delta_3: f64,
    },
    /// Blades that flap each about a hinge of its own.
    Articulated {
        /// Distance of the flap hinge from the shaft, m.
        hinge_offset: f64,
        /// Spring about the hinge, of each blade, N m/rad.
        spring: f64,
        /// Damper about the hinge, of each blade, N m s/rad.
        damping: f64,
        /// Pitch–flap coupling angle δ3, rad; pitch changes by β tan δ3.
        delta_3: f64,
    },
    /// Blades that flap by bending, as if about a hinge with the spring that
    /// gives their flap frequency.
    Hingeless {
        /// Distance of the equivalent hinge from the shaft, m.
        hinge_offset: f64,
        /// Flap frequency in vacuo at nominal speed, per revolution.
        frequency: f64,
        /// Damping about the hinge, of each blade, N m s/rad.
        damping: f64,
        /// Pitch–flap coupling angle δ3, rad; pitch changes by β tan δ3.
        delta_3: f64,
    },
}

impl HubKind {
    /// Distance of the flap hinges from the shaft, m; zero without such hinges.
    #[must_use]
    pub fn hinge_offset(&self) -> f64 {
        match *self {
            Self::Articulated { hinge_offset, .. } | Self::Hingeless { hinge_offset, .. } => {
                hinge_offset
            }
            _ => 0.0,
        }
    }

    /// Its word in a problem file.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Teetering { .. } => "teetering",
            Self::Rigid => "rigid",
            Self::Gimballed { .. } => "gimballed",
            Self::Articulated { .. } => "articulated",
            Self::Hingeless { .. } => "hingeless",
        }
    }
}

impl Rotor {
    /// Spring about the flap hinge of each blade, N m/rad: as given, or that
    /// with which a hingeless blade has its flap frequency,
    /// K = I_β Ω² (ν² − 1 − e M_β/I_β).
    #[must_use]
    pub fn flap_spring(&self) -> f64 {
        match self.hub_kind {
            HubKind::Articulated { spring, .. } => spring,
            HubKind::Hingeless { hinge_offset, frequency, .. } => {
                let hinge = hinge_offset * self.blade_first_moment / self.blade_second_moment;
                let excess = frequency * frequency - 1.0 - hinge;
                self.blade_second_moment * self.speed * self.speed * excess
            }
            _ => 0.0,
        }
    }

    /// Flap frequency of a blade that flaps for itself, in vacuo, per
    /// revolution: √(1 + e M_β/I_β + K/(I_β Ω²)). None on other hubs.
    #[must_use]
    pub fn flap_frequency(&self) -> Option<f64> {
        let hinge_offset = match self.hub_kind {
            HubKind::Articulated { hinge_offset, .. } | HubKind::Hingeless { hinge_offset, .. } => {
                hinge_offset
            }
            _ => return None,
        };
        let (first, second) = (self.blade_first_moment, self.blade_second_moment);
        let spring = self.flap_spring() / (self.speed * self.speed);
        Some((1.0 + (hinge_offset * first + spring) / second).sqrt())
    }
}

/// Section aerodynamics.
#[derive(Debug, Clone)]
pub enum Airfoil {
    /// Lift and drag from a table of angle of attack and Mach number.
    Table(Arc<AirfoilTable>),
    /// Linear lift up to stall, a drag polar.
    Analytic {
        /// Lift-curve slope a0, 1/rad.
        lift_slope: f64,
        /// Zero-lift angle of attack, rad.
        zero_lift_angle: f64,
        /// Drag coefficient δ_0 at zero lift.
        drag: f64,
        /// What drag and lift have beyond.
        polar: Polar,
        /// Whether blade loads are those of Eqs. 35: U = u_T and
        /// arctan(u_P/u_T) = u_P/u_T. Of no effect on wings.
        small_angles: bool,
    },
}

/// Drag over the angle α from zero lift, δ_0 + δ_1 α + δ_2 α², and stall. The
/// default is constant drag without stall.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Polar {
    /// δ_1, 1/rad.
    pub linear: f64,
    /// δ_2, 1/rad².
    pub quadratic: f64,
    /// Angle from zero lift at which the section stalls, rad; none for linear
    /// lift up to where the section stands far across the flow.
    pub stall: Option<f64>,
}

/// One coefficient of a C81 table on its own grid.
#[derive(Debug, Clone, PartialEq)]
pub struct CoefficientGrid {
    /// Angle of attack, rad, strictly increasing from −π to π.
    pub angle_of_attack: Vec<f64>,
    /// Mach number, strictly increasing.
    pub mach: Vec<f64>,
    /// Values `[angle][mach]`, row-major.
    pub value: Vec<f64>,
}

/// A C81 airfoil table.
#[derive(Debug, Clone, PartialEq)]
pub struct AirfoilTable {
    /// Title line of the table.
    pub name: String,
    /// Lift coefficient.
    pub lift: CoefficientGrid,
    /// Drag coefficient.
    pub drag: CoefficientGrid,
    /// Moment coefficient about the quarter chord (kept, not used by the
    /// rotor: no blade torsion is modelled).
    pub moment: CoefficientGrid,
}

/// A rotor.
#[derive(Debug, Clone)]
pub struct Rotor {
    /// Name in the file, for example `upper`.
    pub name: String,
    /// Hub (teeter hinge) position.
    pub hub: Station,
    /// Shaft cant φ_m, rad, positive right side down.
    pub cant: f64,
    /// Shaft tilt β_m, rad, positive aft.
    pub tilt: f64,
    /// Direction of rotation.
    pub direction: Direction,
    /// Number of blades N_b.
    pub blades: usize,
    /// Radius R, m.
    pub radius: f64,
    /// Chord along the span, m.
    pub chord: Spanwise,
    /// Built-in twist along the span, rad (0 at the root by custom).
    pub twist: Spanwise,
    /// Radius where the lifting blade begins, fraction of R.
    pub root_cutout: f64,
    /// Tip-loss factor B: no lift beyond B R, and the momentum of a disk of that
    /// radius. 1 for none.
    pub tip_loss: f64,
    /// Factor κ on the inflow that the rotor induces in itself, as the blades
    /// meet it: induced power over that of a uniform disk. 1 for none.
    pub induced_power_factor: f64,
    /// Blade elements a blade, equal in width.
    pub elements: usize,
    /// Section aerodynamics.
    pub airfoil: Airfoil,
    /// Precone β_p, rad, positive up.
    pub precone: f64,
    /// Mass of one blade m_b, kg.
    pub blade_mass: f64,
    /// First mass moment of one blade M_β about the attachment, kg m.
    pub blade_first_moment: f64,
    /// Second mass moment of one blade I_β about the attachment, kg m².
    pub blade_second_moment: f64,
    /// How the blades are joined to the shaft.
    pub hub_kind: HubKind,
    /// Swashplate phase Δ_sp, rad.
    pub swashplate_phase: f64,
    /// Speed of rotation Ω, rad/s, positive.
    pub speed: f64,
    /// Azimuth of blade 1 when the reference azimuth is zero, rad.
    pub azimuth_offset: f64,
    /// What becomes of the torque ripple of teetering blades.
    pub drive_train: DriveTrain,
    /// Rotor-speed governor; none holds the speed exactly.
    pub governor: Option<Governor>,
    /// Motor whose speed the sticks command; not beside a governor.
    pub motor: Option<Motor>,
    /// Thrust and torque by coefficients in place of blades, which the rotor
    /// then has none of.
    pub coefficients: Option<RotorCoefficients>,
    /// How its turn enters the dynamics; none leaves the choice to the ratio of
    /// its speed to that of the slowest rotor.
    pub azimuth: Option<AzimuthModel>,
}

/// How the turn of a rotor enters the dynamics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AzimuthModel {
    /// Its blades stand where they stand: the dynamics are periodic with its
    /// blade passages.
    Resolved,
    /// Its loads are their means over all azimuths at each instant, as if its
    /// blades were many: it has no period of its own.
    Averaged,
}

/// What a drive train makes of the Coriolis moment of teetering blades, which goes
/// with twice the rotor speed: −2 I Ω β β' in the plane of the blades.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveTrain {
    /// Softer than that: the blades turn a little faster as they flap, so that
    /// their moment of momentum stays, and the shaft carries no ripple. The limit
    /// of a hub that turns freely at twice a revolution.
    Soft,
    /// Infinitely stiff: the shaft holds its speed and carries the moment.
    Held,
}

/// Equation of the teeter motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TeeterEquation {
    /// Euler's law for both blades as one rigid body.
    Exact,
    /// Eq. 54: small angles, and the shaft's speed alone in the restoring
    /// moment, without the yaw rate of the airframe.
    SmallAngles,
}

/// First-order rotor-speed governor: Ω' = (Ω_cmd − Ω)/τ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Governor {
    /// Time constant τ, s.
    pub time_constant: f64,
}

/// Motor with a commanded speed: Ω' = (Ω_cmd − Ω)/τ, where the sticks set Ω_cmd.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// Time constant τ, s.
    pub time_constant: f64,
}

/// A rigid rotor by coefficients: T = k Ω², Q = κ T, and a force −k_d Ω v against
/// its motion across the shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotorCoefficients {
    /// Thrust factor k, N s²/rad².
    pub thrust: f64,
    /// Torque over thrust κ, m.
    pub torque: f64,
    /// Drag factor k_d, N s²/(m rad).
    pub drag: f64,
    /// Moment of inertia about the shaft, kg m².
    pub inertia: f64,
}

/// A wing or tail surface.
#[derive(Debug, Clone)]
pub struct Wing {
    /// Name in the file.
    pub name: String,
    /// Aerodynamic centre at mid-span.
    pub aerodynamic_center: Station,
    /// Span b, m.
    pub span: f64,
    /// Chord along the span; station 0 at the tip at negative y of the wing
    /// axes (port when level, the upper one at a cant of 90°), 1 at the other, m.
    pub chord: Spanwise,
    /// Incidence, rad, positive leading edge up.
    pub incidence: f64,
    /// Incidence over airspeed in place of a fixed one.
    pub incidence_schedule: Option<IncidenceSchedule>,
    /// Control surface over its whole span, or the wing itself where it turns.
    pub surface: Option<ControlSurface>,
    /// Cant about the x axis, rad. The wing axes come from the body axes by
    /// this rotation, and the span runs along the turned y axis: 0 is
    /// horizontal; at 90° the span points down and lift is to starboard.
    pub cant: f64,
    /// Dihedral of each half, rad.
    pub dihedral: f64,
    /// Lift and drag.
    pub model: WingModel,
    /// Rotor wash on it.
    pub wash: Wash,
    /// Dynamic pressure in the wake of the fuselage, over that of the free air.
    pub dynamic_pressure: Option<DynamicPressure>,
}

/// Angle of the flow that a table runs over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlowAngle {
    /// Angle of attack of the aircraft.
    Attack,
    /// Sideslip of the aircraft, positive with wind from starboard.
    Sideslip,
}

/// Ratio of dynamic pressures over an angle of the flow.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicPressure {
    /// Which angle.
    pub over: FlowAngle,
    /// Angles, rad, strictly increasing; the ends hold beyond them.
    pub angle: Vec<f64>,
    /// Ratio at each.
    pub ratio: Vec<f64>,
}

/// A hinged control surface that the sticks move, its deflection an effector.
///
/// A deflection δ shifts the angle from zero lift by τ δ, so that lift and drag
/// are those of the angle of attack α + τ δ; positive with the trailing edge
/// down, which adds lift along the lift axis of the wing. The moment of the
/// section about its aerodynamic centre is left out, as for every wing.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlSurface {
    /// What a deflection does.
    pub effectiveness: Effectiveness,
    /// Deflection for lat, lon, col, ped, rad/%.
    pub gearing: [f64; 4],
    /// Deflection with every stick at zero, rad.
    pub rigging: f64,
    /// Limits on the deflection, rad.
    pub limits: [f64; 2],
}

/// What the deflection of a control surface does to the angle from zero lift.
#[derive(Debug, Clone, PartialEq)]
pub enum Effectiveness {
    /// Effectiveness τ = −∂α_0/∂δ, 0 to 1; 1 where the whole surface turns.
    Constant(f64),
    /// A smooth curve through points, such as a flap that loses its grip.
    Table {
        /// Deflections, rad, strictly increasing; the ends hold beyond them.
        deflection: Vec<f64>,
        /// Change of the angle of attack from zero lift at each, rad.
        shift: Vec<f64>,
    },
}

impl ControlSurface {
    /// Effectiveness of a plain flap by thin-airfoil theory, from its chord over
    /// that of the section: τ = 1 − (θ_h − sin θ_h)/π with cos θ_h = 2 E − 1 for
    /// a hinge at θ_h (Glauert).
    #[must_use]
    pub fn thin_airfoil(chord_fraction: f64) -> f64 {
        let hinge = (2.0 * chord_fraction - 1.0).clamp(-1.0, 1.0).acos();
        1.0 - (hinge - hinge.sin()) / std::f64::consts::PI
    }

    /// Deflection at stick positions (%), rad, limits left out.
    #[must_use]
    pub fn deflection(&self, sticks: &[f64; 4]) -> f64 {
        self.rigging
            + self.gearing.iter().zip(sticks).map(|(gain, stick)| gain * stick).sum::<f64>()
    }
}

/// Incidence of a surface that follows the airspeed.
#[derive(Debug, Clone, PartialEq)]
pub struct IncidenceSchedule {
    /// True airspeeds, m/s, strictly increasing; the ends hold beyond them.
    pub airspeed: Vec<f64>,
    /// Incidence at each, rad, positive leading edge up.
    pub incidence: Vec<f64>,
}

/// How a wing makes its loads.
#[derive(Debug, Clone)]
pub enum WingModel {
    /// Strip theory with an airfoil table or analytic section.
    Elements {
        /// Strips over the span.
        elements: usize,
        /// Section aerodynamics.
        airfoil: Airfoil,
        /// Whether the finite span's induced angle is taken off, with the
        /// elliptic-loading slope a/(1 + a/(π AR)).
        induced_angle: bool,
    },
    /// A whole finite wing at its aerodynamic centre.
    Finite {
        /// Section lift-curve slope a0, 1/rad.
        lift_slope: f64,
        /// Zero-lift angle, rad.
        zero_lift_angle: f64,
        /// Parasite drag coefficient.
        parasite_drag: f64,
        /// Oswald efficiency e.
        oswald: f64,
        /// Angle of attack at which the lift stalls, rad.
        stall_angle: f64,
    },
}

/// Which inflow carries the mass flow of momentum theory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MassFlow {
    /// The rotor's own induced inflow (the paper).
    SelfInduced,
    /// Own and interference inflow together.
    Total,
}

/// How the total inflow follows self-induced inflow and interference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TotalInflow {
    /// At once.
    Algebraic,
    /// Three states a rotor behind a first-order low-pass.
    LowPass {
        /// Bandwidth, rad/s.
        bandwidth: f64,
    },
}

/// Quadrature of the interference coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InterferenceRule {
    /// Converged integrals.
    Converged,
    /// The trapezoid rule over circles from the shaft to the rim, tabulated
    /// over the skew of the wake.
    Trapezoid {
        /// How many circles, the shaft and the rim among them.
        radii: usize,
        /// How many skew angles, evenly from 0 to 90°.
        skews: usize,
    },
}

/// Inflow and interference choices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InflowOptions {
    /// Whether rotors interfere at all.
    pub interactions: bool,
    /// Mass-flow rule.
    pub mass_flow: MassFlow,
    /// Total-inflow rule.
    pub total_inflow: TotalInflow,
    /// Core radius of the wake that washes bodies and wings, fraction of the
    /// source's radius.
    pub wash_core: f64,
    /// Rotors whose shafts are further apart than this, in radii of the source, do
    /// not act on one another.
    pub reach: f64,
    /// Half-width of the wake's edge over which wash on bodies and wings is
    /// averaged, with the span of finite wings; fraction of the source's radius.
    /// Zero takes the wash at one point.
    pub wash_edge: f64,
}

/// Formulas of a publication in place of exact ones, for reproducing published
/// numbers. The default is exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Formulation {
    /// Whether in-plane moments tilt with the teetering frame (exact) or act
    /// about the shaft.
    pub teeter_torque_tilt: bool,
    /// Equation of the teeter motion.
    pub teeter_equation: TeeterEquation,
    /// Quadrature of the interference coefficients.
    pub interference_rule: InterferenceRule,
    /// Whether the sine harmonics of interference change sign between rotors
    /// of opposite rotation (exact) or keep it.
    pub mirrored_interference: bool,
}

impl Formulation {
    /// Exact mechanics and converged integrals.
    pub const EXACT: Self = Self {
        teeter_torque_tilt: true,
        teeter_equation: TeeterEquation::Exact,
        interference_rule: InterferenceRule::Converged,
        mirrored_interference: true,
    };
}

impl Default for Formulation {
    fn default() -> Self {
        Self::EXACT
    }
}

/// Blade pitch of a rotor due to one percent of each stick, rad/%.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotorMix {
    /// Collective θ_0 for lat, lon, col, ped, rad/%.
    pub theta_0: [f64; 4],
    /// Lateral cyclic θ_1c (of cos ψ) in the rotor's own mirrored frame, rad/%.
    pub theta_1c: [f64; 4],
    /// Longitudinal cyclic θ_1s (of sin ψ), rad/%.
    pub theta_1s: [f64; 4],
    /// Blade pitch θ_0, θ_1c, θ_1s with every stick at zero, rad.
    pub rigging: [f64; 3],
    /// Commanded speed for lat, lon, col, ped, rad/s/%; without effect where no
    /// motor takes commands.
    pub speed: [f64; 4],
    /// Commanded speed with every stick at zero, rad/s.
    pub speed_rigging: f64,
}

/// From sticks to blades.
#[derive(Debug, Clone, PartialEq)]
pub struct Controls {
    /// Limits of lat, lon, col, ped, %.
    pub stick_limits: [[f64; 2]; 4],
    /// One a rotor, in the rotors' order.
    pub mix: Vec<RotorMix>,
    /// Limits on collective pitch, rad, one pair a rotor.
    pub collective_limits: Vec<[f64; 2]>,
    /// Limits on each cyclic component, rad, one pair a rotor.
    pub cyclic_limits: Vec<[f64; 2]>,
    /// Limits on commanded speed, rad/s, one pair a rotor.
    pub speed_limits: Vec<[f64; 2]>,
}

/// Names of the pilot's sticks, in the order of every control vector.
pub const STICKS: [&str; 4] = ["lat", "lon", "col", "ped"];
