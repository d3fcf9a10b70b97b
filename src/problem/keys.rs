//! The one description of the problem format.
//!
//! Reading, the reference page and the JSON Schema are all driven by
//! [`ROOT`], so that they cannot disagree. To add a key, add it here and use
//! it in `build.rs`.

use crate::units::Kind;

/// A table of the format.
#[derive(Debug)]
pub struct Table {
    /// What the table is, as full sentences.
    pub doc: &'static str,
    /// Its keys, in the order of the reference page.
    pub keys: &'static [Key],
    /// Groups of keys that exclude one another. Exactly one group must be
    /// used; the required keys of the others are then not required.
    pub alternatives: &'static [&'static [&'static str]],
}

/// A key of a table.
#[derive(Debug)]
pub struct Key {
    /// Spelling in the file.
    pub name: &'static str,
    /// What may stand there.
    pub value: Value,
    /// Whether it must stand there.
    pub need: Need,
    /// Meaning, sign and source, as full sentences.
    pub doc: &'static str,
}

/// Whether a key must be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// It must.
    Required,
    /// It need not: this TOML value stands for it.
    Default(&'static str),
    /// It need not; what its absence means.
    Optional(&'static str),
}

/// Bounds of a number, each written as in a file, unit included.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// Lower bound, and whether the bound itself is allowed.
    pub low: Option<(&'static str, bool)>,
    /// Upper bound, and whether the bound itself is allowed.
    pub high: Option<(&'static str, bool)>,
}

/// What may stand at a key.
#[derive(Debug)]
pub enum Value {
    /// A line of text: see [`check_line`](super::check_line).
    Text,
    /// A name that every export can hold: see [`check_name`](super::check_name).
    Name,
    /// Path of a file, relative to the file that names it.
    Path,
    /// `true` or `false`.
    Bool,
    /// A whole number within bounds, both included.
    Count(usize, usize),
    /// A number without a unit.
    Number(Bounds),
    /// A number with its unit.
    Quantity(Kind, Bounds),
    /// As many numbers without units; 0 stands for one or more.
    Numbers(usize, Bounds),
    /// As many numbers with their units; 0 stands for one or more.
    Quantities(usize, Kind, Bounds),
    /// A lower and an upper limit, with their units.
    Limits(Kind, Bounds),
    /// One of some words, each with its meaning.
    Choice(&'static [(&'static str, &'static str)]),
    /// Constant along the span, or `{ station = [..], value = [..] }`.
    Spanwise(Kind, Bounds),
    /// As [`Value::Spanwise`], but a single quantity is the value at the tip
    /// of a straight line from zero at the shaft axis.
    SpanwiseFromZero(Kind, Bounds),
    /// A table.
    Table(&'static Table),
    /// Tables of the same form under names of the user's choice; what one of
    /// them is called.
    Named(&'static Table, &'static str),
}

/// Where a merge of two files stands in the format.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Level {
    /// In a table with known keys.
    Keys(&'static Table),
    /// Among tables with names of the user's choice.
    Names(&'static Table),
}

impl Level {
    pub fn below(self, name: &str) -> Option<Level> {
        match self {
            Level::Keys(table) => match table.key(name)?.value {
                Value::Table(table) => Some(Level::Keys(table)),
                Value::Named(table, _) => Some(Level::Names(table)),
                _ => None,
            },
            Level::Names(table) => Some(Level::Keys(table)),
        }
    }
}

impl Table {
    /// The key of a name.
    pub fn key(&self, name: &str) -> Option<&'static Key> {
        self.keys.iter().find(|key| key.name == name)
    }
}

pub(crate) const fn required(name: &'static str, value: Value, doc: &'static str) -> Key {
    Key { name, value, need: Need::Required, doc }
}

pub(crate) const fn default(
    name: &'static str,
    value: Value,
    default: &'static str,
    doc: &'static str,
) -> Key {
    Key { name, value, need: Need::Default(default), doc }
}

pub(crate) const fn optional(
    name: &'static str,
    value: Value,
    without: &'static str,
    doc: &'static str,
) -> Key {
    Key { name, value, need: Need::Optional(without), doc }
}

/// Both bounds allowed.
pub(crate) const fn from_to(low: &'static str, high: &'static str) -> Bounds {
    Bounds { low: Some((low, true)), high: Some((high, true)) }
}

/// The lower bound itself is not allowed.
pub(crate) const fn above_to(low: &'static str, high: &'static str) -> Bounds {
    Bounds { low: Some((low, false)), high: Some((high, true)) }
}

/// The upper bound itself is not allowed.
pub(crate) const fn from_below(low: &'static str, high: &'static str) -> Bounds {
    Bounds { low: Some((low, true)), high: Some((high, false)) }
}

/// Neither bound is allowed.
pub(crate) const fn above_below(low: &'static str, high: &'static str) -> Bounds {
    Bounds { low: Some((low, false)), high: Some((high, false)) }
}

/// A place on the drawing: no aircraft of interest is larger.
const DRAWING: Bounds = from_to("-300 ft", "300 ft");

/// Any angle within a turn either way.
const TURN: Bounds = from_to("-360 deg", "360 deg");

/// A point in drawing coordinates.
pub static STATION: Table = Table {
    doc: "A point in the drawing coordinates of the aircraft. The origin is free: only \
          differences between points matter.",
    keys: &[
        required(
            "fuselage_station",
            Value::Quantity(Kind::Length, DRAWING),
            "Distance along the fuselage, positive aft.",
        ),
        default(
            "butt_line",
            Value::Quantity(Kind::Length, DRAWING),
            "\"0 ft\"",
            "Distance from the plane of symmetry, positive to starboard.",
        ),
        required("water_line", Value::Quantity(Kind::Length, DRAWING), "Height, positive up."),
    ],
    alternatives: &[],
};

static MASS: Table = Table {
    doc: "Mass, centre of gravity and inertia of the whole aircraft. The blades of each rotor \
          count as a point mass at its hub.",
    keys: &[
        required(
            "mass",
            Value::Quantity(Kind::Mass, from_to("0.001 kg", "500000 kg")),
            "Gross mass. A gross weight in `lb` or `lbf` is read as the mass that weighs it \
             under standard gravity.",
        ),
        required("center_of_gravity", Value::Table(&STATION), "Centre of gravity."),
        required(
            "i_xx",
            Value::Quantity(Kind::Inertia, INERTIA),
            "Roll moment of inertia about the centre of gravity, body axes.",
        ),
        required("i_yy", Value::Quantity(Kind::Inertia, INERTIA), "Pitch moment of inertia."),
        required("i_zz", Value::Quantity(Kind::Inertia, INERTIA), "Yaw moment of inertia."),
        default(
            "i_xz",
            Value::Quantity(Kind::Inertia, PRODUCT),
            "\"0 slug ft^2\"",
            "Product of inertia ∫xz dm; it enters the tensor as -I_xz.",
        ),
        default(
            "i_xy",
            Value::Quantity(Kind::Inertia, PRODUCT),
            "\"0 slug ft^2\"",
            "Product of inertia ∫xy dm.",
        ),
        default(
            "i_yz",
            Value::Quantity(Kind::Inertia, PRODUCT),
            "\"0 slug ft^2\"",
            "Product of inertia ∫yz dm.",
        ),
    ],
    alternatives: &[],
};

const INERTIA: Bounds = from_to("0.000000001 slug ft^2", "100000000 slug ft^2");
const PRODUCT: Bounds = from_to("-100000000 slug ft^2", "100000000 slug ft^2");

static ATMOSPHERE: Table = Table {
    doc: "The air that the aircraft flies in: US Standard Atmosphere 1976.",
    keys: &[
        default(
            "altitude",
            Value::Quantity(Kind::Length, from_to("-2000 ft", "36000 ft")),
            "\"0 ft\"",
            "Geopotential pressure altitude.",
        ),
        default(
            "temperature_offset",
            Value::Quantity(Kind::TemperatureDifference, from_to("-60 K", "60 K")),
            "\"0 K\"",
            "Temperature above the standard day at the same pressure.",
        ),
    ],
    alternatives: &[],
};

const WASH: Value = Value::Choice(&[
    ("none", "the rotors' wakes do nothing to it"),
    ("full", "the induced velocity is added to the local velocity"),
    (
        "angle_only",
        "the induced velocity turns the local flow, but the dynamic pressure stays that of the \
         free stream",
    ),
]);

static FLAT_PLATE: Table = Table {
    doc: "Equivalent flat plates: on each body axis the force is -½ρ S C |u| u, with u the \
          velocity along that axis.",
    keys: &[
        required(
            "area",
            Value::Quantities(3, Kind::Area, from_to("0 ft^2", "10000 ft^2")),
            "Areas normal to the x, y and z body axes.",
        ),
        default(
            "drag_coefficient",
            Value::Numbers(3, from_to("0", "10")),
            "[1.0, 1.0, 1.0]",
            "Factors C on the three areas.",
        ),
    ],
    alternatives: &[],
};

static FUSELAGE: Table = Table {
    doc: "A fuselage body: `[fuselages.NAME]`, with a name of your choice.",
    keys: &[
        required("position", Value::Table(&STATION), "Where its forces act."),
        optional(
            "flat_plate",
            Value::Table(&FLAT_PLATE),
            "`table` is given instead",
            "Forces of equivalent flat plates.",
        ),
        optional(
            "table",
            Value::Path,
            "`flat_plate` is given instead",
            "Comma-separated file of loads per dynamic pressure on a grid of angle of attack and \
             sideslip. Its header is `alpha_deg,beta_deg,x_ft2,y_ft2,z_ft2,l_ft3,m_ft3,n_ft3`, or \
             `_m2` and `_m3` for metres; forces and moments are in body axes, about `position`. \
             Every pair of angles appears once.",
        ),
        default("wash", WASH, "\"none\"", "What the rotors' wakes do to it."),
    ],
    alternatives: &[&["flat_plate"], &["table"]],
};

static AIRFOIL: Table = Table {
    doc: "Section aerodynamics: a C81 table, or a straight lift line up to stall with a drag polar.",
    keys: &[
        optional(
            "table",
            Value::Path,
            "the keys below are given instead",
            "C81 table of lift, drag and moment over angle of attack (-180° to 180°) and Mach \
             number.",
        ),
        required(
            "lift_slope",
            Value::Quantity(Kind::PerAngle, from_to("0.01 1/rad", "20 1/rad")),
            "Lift-curve slope a0.",
        ),
        default(
            "zero_lift_angle",
            Value::Quantity(Kind::Angle, from_to("-20 deg", "20 deg")),
            "\"0 deg\"",
            "Angle of attack without lift.",
        ),
        required(
            "drag",
            Value::Number(from_to("0", "2")),
            "Drag coefficient δ_0 at zero lift: δ = δ_0 + δ_1 α + δ_2 α², α from zero lift. Bailey's \
             polar of a good rough blade is 0.0087, -0.0216 1/rad and 0.400 1/rad^2.",
        ),
        default(
            "drag_linear",
            Value::Quantity(Kind::PerAngle, from_to("-1 1/rad", "1 1/rad")),
            "\"0 1/rad\"",
            "δ_1 of the drag polar.",
        ),
        default(
            "drag_quadratic",
            Value::Quantity(Kind::PerAngleSquared, from_to("0 1/rad^2", "10 1/rad^2")),
            "\"0 1/rad^2\"",
            "δ_2 of the drag polar.",
        ),
        optional(
            "stall",
            Value::Quantity(Kind::Angle, from_to("4 deg", "25 deg")),
            "no stall: lift is linear to 23 deg",
            "Angle from zero lift at which the section stalls, both ways. Around it lift and drag \
             turn into those of a plate.",
        ),
        default(
            "small_angles",
            Value::Bool,
            "false",
            "Blade loads for flow along the chord: section speed u_T and inflow angle u_P/u_T \
             (the paper's Eqs. 35) instead of the exact ones. No effect on wings.",
        ),
    ],
    alternatives: &[
        &["table"],
        &[
            "lift_slope",
            "zero_lift_angle",
            "drag",
            "drag_linear",
            "drag_quadratic",
            "stall",
            "small_angles",
        ],
    ],
};

static GOVERNOR: Table = Table {
    doc: "First-order rotor-speed governor: Ω' = (Ω_cmd - Ω)/τ.",
    keys: &[required(
        "time_constant",
        Value::Quantity(Kind::Time, from_to("0.001 s", "1000 s")),
        "Time constant τ.",
    )],
    alternatives: &[],
};

static MOTOR: Table = Table {
    doc: "A motor whose speed the sticks command: Ω' = (Ω_cmd - Ω)/τ, with Ω_cmd from \
          `[controls.mix.NAME]`. Such a rotor is averaged over its azimuth.",
    keys: &[required(
        "time_constant",
        Value::Quantity(Kind::Time, from_to("0.001 s", "1000 s")),
        "Time constant τ.",
    )],
    alternatives: &[],
};

static COEFFICIENTS: Table = Table {
    doc: "A rigid rotor by coefficients in place of blades, as small multicopters are given: \
          thrust T = k Ω², torque Q = κ T, and a force against its motion across the shaft of \
          k_d Ω v. It has no inflow, and no wash on others.",
    keys: &[
        required(
            "thrust",
            Value::Quantity(Kind::ThrustFactor, above_to("0 N s^2/rad^2", "1000000 N s^2/rad^2")),
            "Thrust factor k.",
        ),
        required(
            "torque",
            Value::Quantity(Kind::Length, from_to("0 m", "100 m")),
            "Torque over thrust κ.",
        ),
        default(
            "drag",
            Value::Quantity(Kind::DragFactor, from_to("0 N s^2/m/rad", "1000000 N s^2/m/rad")),
            "\"0 N s^2/m/rad\"",
            "Drag factor k_d.",
        ),
        default(
            "inertia",
            Value::Quantity(Kind::Inertia, from_to("0 kg m^2", "1000000 kg m^2")),
            "\"0 kg m^2\"",
            "Moment of inertia of what turns, about the shaft: gyroscopic moments, and the reaction \
             of a rotor that speeds up.",
        ),
    ],
    alternatives: &[],
};

static ROTOR: Table = Table {
    doc: "A rotor: `[rotors.NAME]`, with a name of your choice. At least one is needed. The \
          order in the file is the order in every result.",
    keys: &[
        required(
            "position",
            Value::Table(&STATION),
            "Hub: the teeter hinge or gimbal, or the point of the shaft at the height of the flap hinges or \
             of rigid blades.",
        ),
        default(
            "cant",
            Value::Quantity(Kind::Angle, from_to("-180 deg", "180 deg")),
            "\"0 deg\"",
            "Shaft cant φ_m, positive right side down.",
        ),
        default(
            "tilt",
            Value::Quantity(Kind::Angle, from_to("-180 deg", "180 deg")),
            "\"0 deg\"",
            "Shaft tilt β_m, positive aft.",
        ),
        required(
            "direction",
            Value::Choice(&[
                ("counter-clockwise", "the frame of the theory"),
                ("clockwise", "the mirrored frame"),
            ]),
            "Direction of rotation, seen from above.",
        ),
        required("blades", Value::Count(1, 12), "Number of blades N_b."),
        required(
            "radius",
            Value::Quantity(Kind::Length, from_to("0.001 ft", "200 ft")),
            "Radius R.",
        ),
        required(
            "chord",
            Value::Spanwise(Kind::Length, from_to("0.0001 ft", "20 ft")),
            "Blade chord.",
        ),
        default(
            "twist",
            Value::SpanwiseFromZero(Kind::Angle, from_to("-90 deg", "90 deg")),
            "\"0 deg\"",
            "Built-in twist, positive leading edge up.",
        ),
        default(
            "root_cutout",
            Value::Number(from_below("0", "1")),
            "0.0",
            "Where the lifting blade begins, as a fraction of R.",
        ),
        default(
            "tip_loss",
            Value::Number(above_to("0", "1")),
            "1.0",
            "Tip-loss factor B: no lift beyond B R, and the momentum theory of a disk of that \
             radius, so that induced power in hover grows by 1/B. 1 for none.",
        ),
        default(
            "induced_power_factor",
            Value::Number(from_to("1", "2")),
            "1.0",
            "Factor κ on the inflow that the rotor induces in itself, as its blades meet it. Uniform \
             inflow needs the least power; the inflow of real rotors is uneven and swirls, \
             which costs 10 to 20 % in hover: 1.1 for a well twisted rotor, 1.15 in the usual \
             case, 1.2 without twist.",
        ),
        default("elements", Value::Count(3, 1000), "20", "Blade elements a blade, equal in width."),
        required("airfoil", Value::Table(&AIRFOIL), "Section aerodynamics."),
        default(
            "precone",
            Value::Quantity(Kind::Angle, above_below("-45 deg", "45 deg")),
            "\"0 deg\"",
            "Precone β_p, positive up.",
        ),
        required(
            "blade_mass",
            Value::Quantity(Kind::Mass, from_to("0.000001 lb", "10000 lb")),
            "Mass of one blade m_b.",
        ),
        required(
            "blade_first_moment",
            Value::Quantity(Kind::FirstMoment, from_to("0.000000001 slug ft", "1000000 slug ft")),
            "First mass moment of one blade about its attachment, M_β.",
        ),
        required(
            "blade_second_moment",
            Value::Quantity(
                Kind::Inertia,
                from_to("0.000000000001 slug ft^2", "100000000 slug ft^2"),
            ),
            "Second mass moment of one blade about its attachment, I_β.",
        ),
        required(
            "hub",
            Value::Choice(&[
                ("teetering", "two blades on one teeter hinge"),
                ("rigid", "blades that neither flap nor teeter"),
                ("gimballed", "blades that tilt together on a gimbal"),
                ("articulated", "blades that flap each about a hinge of its own"),
                ("hingeless", "the same with the spring that gives a flap frequency"),
            ]),
            "How the blades are joined to the shaft.",
        ),
        default(
            "hinge_offset",
            Value::Quantity(Kind::Length, from_to("0 ft", "50 ft")),
            "\"0 ft\"",
            "Distance e of the flap hinge from the shaft; of a hingeless rotor that of the hinge \
             that stands for its bending. First and second moment of the blade are about it. \
             Articulated and hingeless hubs only.",
        ),
        default(
            "flap_spring",
            Value::Quantity(Kind::AngularStiffness, from_to("0 lbf ft/rad", "10000000 lbf ft/rad")),
            "\"0 lbf ft/rad\"",
            "Spring about the flap hinge of each blade. Articulated hubs only.",
        ),
        optional(
            "flap_frequency",
            Value::Number(from_to("1", "5")),
            "the hub is not hingeless",
            "Flap frequency in vacuo at nominal speed, per revolution: gives the spring \
             K = I_β Ω² (ν² − 1 − e M_β/I_β). Hingeless hubs only, which need it.",
        ),
        default(
            "flap_damping",
            Value::Quantity(
                Kind::AngularDamping,
                from_to("0 lbf ft s/rad", "10000000 lbf ft s/rad"),
            ),
            "\"0 lbf ft s/rad\"",
            "Damper about the flap hinge of each blade. Articulated and hingeless hubs only.",
        ),
        default(
            "gimbal_spring",
            Value::Quantity(Kind::AngularStiffness, from_to("0 lbf ft/rad", "10000000 lbf ft/rad")),
            "\"0 lbf ft/rad\"",
            "Spring of the gimbal against tilt about any axis. Gimballed hubs only.",
        ),
        default(
            "gimbal_damping",
            Value::Quantity(
                Kind::AngularDamping,
                from_to("0 lbf ft s/rad", "10000000 lbf ft s/rad"),
            ),
            "\"0 lbf ft s/rad\"",
            "Damping of the gimbal's tilt in the turning frame. Gimballed hubs only.",
        ),
        default(
            "undersling",
            Value::Quantity(Kind::Length, from_to("-10 ft", "10 ft")),
            "\"0 ft\"",
            "Distance of the blade attachment below the teeter hinge or gimbal. Teetering and gimballed \
             hubs only.",
        ),
        default(
            "teeter_spring",
            Value::Quantity(Kind::AngularStiffness, from_to("0 lbf ft/rad", "10000000 lbf ft/rad")),
            "\"0 lbf ft/rad\"",
            "Teeter spring. Teetering hubs only.",
        ),
        optional(
            "drive_train",
            Value::Choice(&[
                (
                    "soft",
                    "soft at twice a revolution: the Coriolis moment of flapping blades goes into \
                     their speed",
                ),
                ("held", "the shaft holds its speed and carries that moment"),
            ]),
            "soft; held in files with `reference = \"coax2d-paper\"`, whose equations hold the speed",
            "Drive train of a teetering rotor that is resolved. Teetering hubs only.",
        ),
        default(
            "delta_3",
            Value::Quantity(Kind::Angle, above_below("-80 deg", "80 deg")),
            "\"0 deg\"",
            "Pitch-flap coupling δ3: the pitch changes by β tan δ3 with the flap angle β, precone left \
             out. Any hub but a rigid one.",
        ),
        default(
            "swashplate_phase",
            Value::Quantity(Kind::Angle, TURN),
            "\"0 deg\"",
            "Swashplate phase Δ_sp.",
        ),
        required(
            "speed",
            Value::Quantity(Kind::AngularRateRad, from_to("0.01 rad/s", "5000 rad/s")),
            "Speed of rotation Ω, positive for either direction.",
        ),
        default(
            "azimuth_offset",
            Value::Quantity(Kind::Angle, TURN),
            "\"0 deg\"",
            "Azimuth of blade 1 when the reference azimuth is zero.",
        ),
        optional(
            "governor",
            Value::Table(&GOVERNOR),
            "the speed is held exactly",
            "Rotor-speed governor; makes the speed a state.",
        ),
        optional(
            "motor",
            Value::Table(&MOTOR),
            "the sticks do not command the speed",
            "Motor with a commanded speed; makes the speed a state. Not beside `governor`.",
        ),
        optional(
            "coefficients",
            Value::Table(&COEFFICIENTS),
            "the rotor has blades",
            "Thrust and torque by coefficients in place of blades.",
        ),
        optional(
            "azimuth",
            Value::Choice(&[
                (
                    "resolved",
                    "its blades stand where they stand, and the flight repeats itself \
                              with their passages",
                ),
                (
                    "averaged",
                    "its loads are their means over all azimuths at each instant, as if \
                              its blades were many, at any speed",
                ),
            ]),
            "resolved where the flight then repeats itself within four blade passages of the \
             slowest rotor, else averaged",
            "How the turn of the rotor enters the dynamics.",
        ),
    ],
    alternatives: &[
        &[
            "blades",
            "chord",
            "twist",
            "root_cutout",
            "tip_loss",
            "induced_power_factor",
            "elements",
            "airfoil",
            "precone",
            "blade_mass",
            "blade_first_moment",
            "blade_second_moment",
            "hub",
            "hinge_offset",
            "flap_spring",
            "flap_frequency",
            "flap_damping",
            "gimbal_spring",
            "gimbal_damping",
            "undersling",
            "teeter_spring",
            "drive_train",
            "delta_3",
            "swashplate_phase",
        ],
        &["coefficients"],
    ],
};

static STRIPS: Table = Table {
    doc: "Strip theory over the span.",
    keys: &[
        default(
            "count",
            Value::Count(1, 1000),
            "6",
            "Strips over the span, at the points of Gauss and Legendre in each half; an odd number \
             is raised to the next even one.",
        ),
        required("airfoil", Value::Table(&AIRFOIL), "Section aerodynamics."),
        default(
            "induced_angle",
            Value::Bool,
            "true",
            "Whether the induced angle of the finite span is taken off, with the slope \
             a/(1 + a/(π AR)) of elliptic loading.",
        ),
    ],
    alternatives: &[],
};

static FINITE: Table = Table {
    doc: "A whole finite wing at its aerodynamic centre. Its dihedral is left out.",
    keys: &[
        required(
            "lift_slope",
            Value::Quantity(Kind::PerAngle, from_to("0.01 1/rad", "20 1/rad")),
            "Lift-curve slope a0 of the section.",
        ),
        default(
            "zero_lift_angle",
            Value::Quantity(Kind::Angle, from_to("-20 deg", "20 deg")),
            "\"0 deg\"",
            "Angle of attack without lift.",
        ),
        required(
            "parasite_drag",
            Value::Number(from_to("0", "2")),
            "Drag coefficient without lift.",
        ),
        default("oswald", Value::Number(from_to("0.01", "1")), "0.8", "Oswald efficiency e."),
        default(
            "stall_angle",
            Value::Quantity(Kind::Angle, from_to("0.1 deg", "45 deg")),
            "\"15 deg\"",
            "Angle of attack at which the lift stalls.",
        ),
    ],
    alternatives: &[],
};

static INCIDENCE_SCHEDULE: Table = Table {
    doc: "Incidence over true airspeed: a smooth curve through the points, held beyond the ends.",
    keys: &[
        required(
            "airspeed",
            Value::Quantities(0, Kind::Airspeed, from_to("0 kt", "1000 kt")),
            "Airspeeds, strictly increasing, two or more.",
        ),
        required(
            "incidence",
            Value::Quantities(0, Kind::Angle, from_to("-90 deg", "90 deg")),
            "Incidence at each of them, positive leading edge up.",
        ),
    ],
    alternatives: &[],
};

static DYNAMIC_PRESSURE: Table = Table {
    doc: "Dynamic pressure at a surface in the wake of a body, over that of the free air: a smooth \
          curve through the points, held beyond the ends. It fades out below some 10 kt.",
    keys: &[
        optional(
            "angle_of_attack",
            Value::Quantities(0, Kind::Angle, from_to("-180 deg", "180 deg")),
            "`sideslip` is given instead",
            "Angles of attack of the aircraft, strictly increasing, two or more.",
        ),
        optional(
            "sideslip",
            Value::Quantities(0, Kind::Angle, from_to("-180 deg", "180 deg")),
            "`angle_of_attack` is given instead",
            "Angles of sideslip of the aircraft, positive with wind from starboard.",
        ),
        required("ratio", Value::Numbers(0, from_to("0", "2")), "Ratio at each of them."),
    ],
    alternatives: &[&["angle_of_attack"], &["sideslip"]],
};

static EFFECTIVENESS_TABLE: Table = Table {
    doc: "What a control surface does, point by point, as measured or where it loses its grip at \
          large deflections: a smooth curve through the points, held beyond the ends.",
    keys: &[
        required(
            "deflection",
            Value::Quantities(0, Kind::Angle, PITCH),
            "Deflections, strictly increasing, two or more, positive with the trailing edge down.",
        ),
        required(
            "shift",
            Value::Quantities(0, Kind::Angle, PITCH),
            "Change of the angle of attack from zero lift at each of them.",
        ),
    ],
    alternatives: &[],
};

static CONTROL_SURFACE: Table = Table {
    doc: "A control surface over the whole span of the wing: a plain flap, an elevator, a rudder, \
          or with `effectiveness = 1` the wing itself as it turns. Its deflection δ is an effector, \
          `NAME.deflection`: lift and drag become those of the angle of attack α + τ δ. For a \
          surface over a part of the span make a wing of that part.",
    keys: &[
        optional(
            "chord_fraction",
            Value::Number(above_to("0", "1")),
            "`effectiveness` or `table` is given instead",
            "Chord of the surface behind its hinge over that of the wing. It gives τ by \
             thin-airfoil theory: 0.609 for a quarter.",
        ),
        optional(
            "effectiveness",
            Value::Number(above_to("0", "1")),
            "`chord_fraction` or `table` is given instead",
            "Effectiveness τ: change of the angle of attack from zero lift over the deflection.",
        ),
        optional(
            "table",
            Value::Table(&EFFECTIVENESS_TABLE),
            "`chord_fraction` or `effectiveness` is given instead",
            "Change of the angle of attack over the deflection by points.",
        ),
        default("lat", GEARING, "\"0 rad/100%\"", "Deflection from the lateral stick."),
        default("lon", GEARING, "\"0 rad/100%\"", "Deflection from the longitudinal stick."),
        default("col", GEARING, "\"0 rad/100%\"", "Deflection from the collective lever."),
        default("ped", GEARING, "\"0 rad/100%\"", "Deflection from the pedals."),
        default(
            "rigging",
            Value::Quantity(Kind::Angle, PITCH),
            "\"0 deg\"",
            "Deflection with every stick at zero, positive with the trailing edge down.",
        ),
        default(
            "limits",
            Value::Limits(Kind::Angle, PITCH),
            "[\"-20 deg\", \"20 deg\"]",
            "Limits on the deflection.",
        ),
    ],
    alternatives: &[&["chord_fraction"], &["effectiveness"], &["table"]],
};

static WING: Table = Table {
    doc: "A wing or tail surface: `[wings.NAME]`, with a name of your choice. The wing axes come \
          from the body axes by a rotation about x by `cant`; the span runs along the turned y \
          axis. A vertical tail has `cant = \"90 deg\"`: its span then points down, its \
          first station is the upper tip, and positive lift is to starboard.",
    keys: &[
        required("aerodynamic_center", Value::Table(&STATION), "Aerodynamic centre at mid-span."),
        required(
            "span",
            Value::Quantity(Kind::Length, from_to("0.001 ft", "300 ft")),
            "Span b, tip to tip.",
        ),
        required(
            "chord",
            Value::Spanwise(Kind::Length, from_to("0.0001 ft", "50 ft")),
            "Chord. Station 0 is the tip at negative y of the wing axes (port when level), \
             station 1 the other.",
        ),
        default(
            "incidence",
            Value::Quantity(Kind::Angle, from_to("-90 deg", "90 deg")),
            "\"0 deg\"",
            "Incidence, positive leading edge up.",
        ),
        optional(
            "incidence_schedule",
            Value::Table(&INCIDENCE_SCHEDULE),
            "the incidence is fixed",
            "Incidence that follows the airspeed, as of a stabilator. It adds to `incidence`.",
        ),
        optional(
            "surface",
            Value::Table(&CONTROL_SURFACE),
            "no stick moves it",
            "Control surface that the sticks move.",
        ),
        default(
            "cant",
            Value::Quantity(Kind::Angle, from_to("-180 deg", "180 deg")),
            "\"0 deg\"",
            "Rotation about the x axis: 0 is horizontal, 90° a vertical surface.",
        ),
        default(
            "dihedral",
            Value::Quantity(Kind::Angle, above_below("-90 deg", "90 deg")),
            "\"0 deg\"",
            "Dihedral of each half, positive tips up.",
        ),
        optional(
            "strips",
            Value::Table(&STRIPS),
            "`finite` is given instead",
            "Loads by strip theory.",
        ),
        optional(
            "finite",
            Value::Table(&FINITE),
            "`strips` is given instead",
            "Loads of a simple finite wing.",
        ),
        default("wash", WASH, "\"none\"", "What the rotors' wakes do to it."),
        optional(
            "dynamic_pressure",
            Value::Table(&DYNAMIC_PRESSURE),
            "that of the free air",
            "Dynamic pressure in the wake of the fuselage.",
        ),
    ],
    alternatives: &[&["strips"], &["finite"]],
};

static INFLOW: Table = Table {
    doc: "Inflow and rotor-on-rotor interference.",
    keys: &[
        default("interactions", Value::Bool, "true", "Whether rotors interfere at all."),
        default(
            "mass_flow",
            Value::Choice(&[
                ("self", "the rotor's own induced inflow, as in the paper"),
                ("total", "own and interference inflow together"),
            ]),
            "\"self\"",
            "Which inflow carries the mass flow of momentum theory.",
        ),
        default(
            "total_inflow",
            Value::Choice(&[
                ("algebraic", "at once"),
                ("lowpass", "three states a rotor behind a first-order low-pass"),
            ]),
            "\"algebraic\"",
            "How the total inflow follows self-induced inflow and interference.",
        ),
        default(
            "lowpass_bandwidth",
            Value::Quantity(Kind::Frequency, from_to("0.01 rad/s", "100000 rad/s")),
            "\"200 rad/s\"",
            "Bandwidth of the low-pass. Used with `total_inflow = \"lowpass\"`.",
        ),
        default(
            "wash_core",
            Value::Number(above_to("0", "1")),
            "0.05",
            "Core radius of the wake that washes bodies and wings, as a fraction of the radius \
             of the rotor it comes from.",
        ),
        default(
            "reach",
            Value::Number(above_to("0", "1000")),
            "1000",
            "Rotors whose hubs are further apart than this, seen along the shaft of the one whose \
             wake it is, in radii of that rotor, do not act on one another.",
        ),
        default(
            "wash_edge",
            Value::Number(from_to("0", "1")),
            "0.15",
            "Half-width of the edge of the wake that washes bodies and wings, as a fraction of the \
             radius of the rotor it comes from. The wash is averaged over it, and over the span of \
             finite wings. The default is about the distance between turns of tip vortices, \
             2πλ/N_b. 0 takes the wash at one point, with a sharp edge.",
        ),
    ],
    alternatives: &[],
};

static FORMULATION: Table = Table {
    doc: "Formulas of a publication in place of exact ones, for reproducing published numbers. \
          Leave the table out to fly an aircraft: everything is then exact.",
    keys: &[
        default(
            "teeter_torque_tilt",
            Value::Bool,
            "true",
            "Whether in-plane moments tilt with the teetering frame, which is exact, or act about \
             the shaft. Teetering hubs only.",
        ),
        default(
            "teeter_equation",
            Value::Choice(&[
                ("exact", "Euler's law for the blades as a rigid body"),
                (
                    "small_angles",
                    "the published equation for small angles, in which the restoring moment does \
                     not depend on the airframe's yaw rate",
                ),
            ]),
            "\"exact\"",
            "Equation of the teeter motion. Teetering hubs only.",
        ),
        default(
            "interference_rule",
            Value::Choice(&[
                ("converged", "converged integrals"),
                (
                    "trapezoid",
                    "the trapezoid rule over circles from the shaft to the rim, tabulated over \
                     the skew of the wake",
                ),
            ]),
            "\"converged\"",
            "Quadrature of the interference coefficients.",
        ),
        default(
            "interference_radii",
            Value::Count(4, 1000),
            "11",
            "Circles of the trapezoid rule, the shaft and the rim among them. Used with \
             `interference_rule = \"trapezoid\"`.",
        ),
        default(
            "interference_skews",
            Value::Count(3, 1000),
            "10",
            "Skew angles, evenly from 0 to 90 deg, between which the trapezoid rule is \
             interpolated. Used with `interference_rule = \"trapezoid\"`.",
        ),
        default(
            "mirrored_interference",
            Value::Bool,
            "true",
            "Whether the lateral gradient of interference changes sign between rotors of opposite \
             rotation, whose frames are mirror images. This is exact; `false` keeps the sign.",
        ),
    ],
    alternatives: &[],
};

/// Keys that earlier versions had elsewhere: table, key, and what to do now.
static MOVED: [(&Table, &str, &str); 7] = [
    (&ROTOR, "teeter_torque_tilt", TO_FORMULATION),
    (&ROTOR, "teeter_equation", TO_FORMULATION),
    (&INFLOW, "interference_rule", TO_FORMULATION),
    (&INFLOW, "interference_radii", TO_FORMULATION),
    (&INFLOW, "interference_skews", TO_FORMULATION),
    (&INFLOW, "mirrored_interference", TO_FORMULATION),
    (
        &INFLOW,
        "harmonic_mass_flow",
        "remove `harmonic_mass_flow`: the first harmonics of inflow always have the mass flow of \
         momentum theory",
    ),
];

const TO_FORMULATION: &str = "move it to the table [formulation], which holds for all rotors";

impl Table {
    /// What to do with a key that earlier versions had in this table.
    pub(crate) fn moved(&self, name: &str) -> Option<&'static str> {
        MOVED
            .iter()
            .find(|(table, key, _)| std::ptr::eq(*table, self) && *key == name)
            .map(|(_, _, advice)| *advice)
    }
}

/// Full travel of a stick, and more: percent are nominal.
const STICK: Bounds = from_to("-1000 %", "1000 %");

static STICK_CYCLIC: Table = Table {
    doc: "A stick or the pedals, centred at 0 %.",
    keys: &[default(
        "limits",
        Value::Limits(Kind::Percent, STICK),
        "[\"-100 %\", \"100 %\"]",
        "Travel.",
    )],
    alternatives: &[],
};

static STICK_COLLECTIVE: Table = Table {
    doc: "The collective lever, down at 0 %.",
    keys: &[default(
        "limits",
        Value::Limits(Kind::Percent, STICK),
        "[\"0 %\", \"100 %\"]",
        "Travel.",
    )],
    alternatives: &[],
};

const GEARING: Value =
    Value::Quantity(Kind::AnglePerPercent, from_to("-100 rad/100%", "100 rad/100%"));

static GEARINGS: Table = Table {
    doc: "Blade pitch per stick travel.",
    keys: &[
        default("lat", GEARING, "\"0 rad/100%\"", "From the lateral stick."),
        default("lon", GEARING, "\"0 rad/100%\"", "From the longitudinal stick."),
        default("col", GEARING, "\"0 rad/100%\"", "From the collective lever."),
        default("ped", GEARING, "\"0 rad/100%\"", "From the pedals."),
    ],
    alternatives: &[],
};

const SPEED_GEARING: Value =
    Value::Quantity(Kind::AngularRatePerPercent, from_to("-10000 rad/s/100%", "10000 rad/s/100%"));

static SPEED_GEARINGS: Table = Table {
    doc: "Commanded speed per stick travel.",
    keys: &[
        default("lat", SPEED_GEARING, "\"0 rad/s/100%\"", "From the lateral stick."),
        default("lon", SPEED_GEARING, "\"0 rad/s/100%\"", "From the longitudinal stick."),
        default("col", SPEED_GEARING, "\"0 rad/s/100%\"", "From the collective lever."),
        default("ped", SPEED_GEARING, "\"0 rad/s/100%\"", "From the pedals."),
        optional(
            "rigging",
            Value::Quantity(Kind::AngularRateRad, from_to("-10000 rad/s", "10000 rad/s")),
            "the nominal speed of the rotor",
            "With every stick at zero.",
        ),
    ],
    alternatives: &[],
};

const PITCH: Bounds = from_to("-90 deg", "90 deg");

static RIGGING: Table = Table {
    doc: "Blade pitch with every stick at zero.",
    keys: &[
        default("theta_0", Value::Quantity(Kind::Angle, PITCH), "\"0 deg\"", "Collective."),
        default("theta_1c", Value::Quantity(Kind::Angle, PITCH), "\"0 deg\"", "Lateral cyclic."),
        default(
            "theta_1s",
            Value::Quantity(Kind::Angle, PITCH),
            "\"0 deg\"",
            "Longitudinal cyclic.",
        ),
    ],
    alternatives: &[],
};

static ROTOR_MIX: Table = Table {
    doc: "From the sticks to one rotor: `[controls.mix.NAME]`, with the name of a rotor. Every \
          rotor needs one. The angles are those of the rotor's own frame, which is mirrored for \
          a clockwise rotor: the same lateral cyclic tilts rotors of opposite rotation opposite \
          ways.",
    keys: &[
        default("theta_0", Value::Table(&GEARINGS), "{}", "Collective pitch θ_0."),
        default(
            "theta_1c",
            Value::Table(&GEARINGS),
            "{}",
            "Lateral cyclic θ_1c, which multiplies cos ψ.",
        ),
        default(
            "theta_1s",
            Value::Table(&GEARINGS),
            "{}",
            "Longitudinal cyclic θ_1s, which multiplies sin ψ.",
        ),
        default("rigging", Value::Table(&RIGGING), "{}", "Blade pitch with every stick at zero."),
        default(
            "speed",
            Value::Table(&SPEED_GEARINGS),
            "{}",
            "Commanded speed of a rotor with a motor.",
        ),
        default(
            "speed_limits",
            Value::Limits(Kind::AngularRateRad, from_to("0 rad/s", "10000 rad/s")),
            "[\"0 rad/s\", \"10000 rad/s\"]",
            "Limits on the commanded speed.",
        ),
        default(
            "collective_limits",
            Value::Limits(Kind::Angle, PITCH),
            "[\"-5 deg\", \"25 deg\"]",
            "Limits on θ_0.",
        ),
        default(
            "cyclic_limits",
            Value::Limits(Kind::Angle, PITCH),
            "[\"-15 deg\", \"15 deg\"]",
            "Limits on θ_1c and on θ_1s, each.",
        ),
    ],
    alternatives: &[],
};

static CONTROLS: Table = Table {
    doc: "From the pilot's sticks to the blades.",
    keys: &[
        default("lat", Value::Table(&STICK_CYCLIC), "{}", "Lateral stick, positive to the right."),
        default(
            "lon",
            Value::Table(&STICK_CYCLIC),
            "{}",
            "Longitudinal stick. Its sign is that of the mix.",
        ),
        default("col", Value::Table(&STICK_COLLECTIVE), "{}", "Collective lever, positive up."),
        default("ped", Value::Table(&STICK_CYCLIC), "{}", "Pedals, positive right foot forward."),
        required("mix", Value::Named(&ROTOR_MIX, "rotor"), "From the sticks to each rotor."),
    ],
    alternatives: &[],
};

/// A problem file.
pub static ROOT: Table = Table {
    doc: "A rotorcraft and the modelling choices to fly it with.",
    keys: &[
        optional(
            "extends",
            Value::Path,
            "the file stands alone",
            "Another problem file to start from. Tables merge key by key; everything else \
             replaces. Where keys exclude one another, choosing one drops the other of the base.",
        ),
        required(
            "name",
            Value::Name,
            "Short name, for titles and file names: letters, digits, blanks and `-_.`, at most 64 \
             of them.",
        ),
        default("description", Value::Text, "\"a rotorcraft\"", "One line for reports."),
        default(
            "reference",
            Value::Choice(&[
                ("none", "results stand alone"),
                (
                    "coax2d-paper",
                    "Kreienkamp, Saetti, Özkurt and Fichter's paper on the CoAX 2D: its Table 2 \
                     and the matrices of its appendix",
                ),
            ]),
            "\"none\"",
            "Publication whose numbers are shown beside the results.",
        ),
        default(
            "units",
            Value::Choice(&[
                ("none", "US customary units"),
                ("us", "US customary units: ft, lb, slug, hp, kt"),
                ("si", "SI units: m, kg, N, kW, m/s"),
            ]),
            "\"none\"",
            "Units that results are shown in where `--units` does not say otherwise. Values in the \
             file carry their own.",
        ),
        required("mass", Value::Table(&MASS), "Mass properties."),
        default("atmosphere", Value::Table(&ATMOSPHERE), "{}", "The air to fly in."),
        default("fuselages", Value::Named(&FUSELAGE, "fuselage"), "{}", "Fuselage bodies."),
        required("rotors", Value::Named(&ROTOR, "rotor"), "Rotors."),
        default("wings", Value::Named(&WING, "wing"), "{}", "Wings and tail surfaces."),
        default("inflow", Value::Table(&INFLOW), "{}", "Inflow and interference."),
        default(
            "formulation",
            Value::Table(&FORMULATION),
            "{}",
            "Published formulas in place of exact ones.",
        ),
        required("controls", Value::Table(&CONTROLS), "From the sticks to the blades."),
    ],
    alternatives: &[],
};
