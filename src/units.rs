//! The only conversion constants of the project, and quantities with units.
//!
//! Inside the library everything is SI and radians. A [`Kind`] says what a
//! number measures and how to write it for people in either [`System`];
//! [`parse_quantity`] reads what people write.
//!
//! Two pseudo-dimensions keep mistakes out: plane angle and percent of stick
//! travel count as dimensions of their own, so that `rad/s` is not `1/s` and
//! a mix in `rad/100%` is not an angle.

use std::f64::consts::PI;

/// Metres in a foot, exact.
pub const FOOT: f64 = 0.3048;
/// Metres in an inch, exact.
pub const INCH: f64 = 0.0254;
/// Metres in a statute mile, exact.
pub const MILE: f64 = 1609.344;
/// Metres in a nautical mile, exact.
pub const NAUTICAL_MILE: f64 = 1852.0;
/// Metres a second in a knot, exact.
pub const KNOT: f64 = NAUTICAL_MILE / 3600.0;
/// Kilograms in a pound, exact.
pub const POUND: f64 = 0.453_592_37;
/// Standard gravity, m/s², exact: joins a weight in pounds to its mass.
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// Newtons in a pound-force, exact.
pub const POUND_FORCE: f64 = POUND * STANDARD_GRAVITY;
/// Kilograms in a slug: one pound-force a foot a second squared.
pub const SLUG: f64 = POUND_FORCE / FOOT;
/// Watts in a mechanical horsepower: 550 ft lbf/s.
pub const HORSEPOWER: f64 = 550.0 * FOOT * POUND_FORCE;
/// Radians in a degree.
pub const DEGREE: f64 = PI / 180.0;
/// Radians in a turn.
pub const TURN: f64 = 2.0 * PI;
/// Kelvins in a degree Fahrenheit or Rankine.
pub const RANKINE: f64 = 5.0 / 9.0;
/// Zero of the Celsius scale, K.
pub const CELSIUS_ZERO: f64 = 273.15;
/// Zero of the Fahrenheit scale, degrees Rankine.
pub const FAHRENHEIT_ZERO: f64 = 459.67;

/// The units that people read results in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum System {
    /// US customary: ft, lb, slug, hp, kt.
    #[default]
    Us,
    /// SI: m, kg, N, kW.
    Si,
}

/// What a number measures.
///
/// The comment of each gives the unit inside the library, then the units for
/// people.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// 1.
    Dimensionless,
    /// m; ft or m.
    Length,
    /// m/s; ft/s or m/s.
    Velocity,
    /// A flight speed. m/s; kt or m/s.
    Airspeed,
    /// m/s; ft/min or m/s.
    ClimbRate,
    /// m/s²; ft/s² or m/s².
    Acceleration,
    /// rad; deg.
    Angle,
    /// rad; rad, for matrices and state vectors.
    AngleRad,
    /// rad/s; deg/s.
    AngularRate,
    /// rad/s; rad/s, for matrices, state vectors and rotor speeds.
    AngularRateRad,
    /// rad/s²; rad/s².
    AngularAcceleration,
    /// kg; lb or kg. A weight in pounds, `lb` or `lbf`, is read as the mass
    /// that weighs it under standard gravity.
    Mass,
    /// N; lbf or N.
    Force,
    /// N m; lbf ft or N m.
    Moment,
    /// W; hp or kW.
    Power,
    /// m²; ft² or m².
    Area,
    /// m³; ft³ or m³.
    Volume,
    /// Moment or product of inertia. kg m²; slug ft² or kg m².
    Inertia,
    /// First mass moment. kg m; slug ft or kg m.
    FirstMoment,
    /// kg/m³; slug/ft³ or kg/m³.
    Density,
    /// Pa; lbf/ft² or Pa.
    Pressure,
    /// K; degF or K.
    Temperature,
    /// K; degF or K, without the offset of the scale.
    TemperatureDifference,
    /// s; s.
    Time,
    /// rad/s; rad/s. Read from Hz too, as cycles a second.
    Frequency,
    /// Percent of stick travel, 0 to 100; %.
    Percent,
    /// rad/%; deg/%.
    AnglePerPercent,
    /// N m/rad; lbf ft/rad or N m/rad.
    AngularStiffness,
    /// N m s/rad; lbf ft s/rad or N m s/rad.
    AngularDamping,
    /// rad/s/%; rad/s/%.
    AngularRatePerPercent,
    /// N s²/rad²; lbf s²/rad² or N s²/rad².
    ThrustFactor,
    /// N s²/(m rad); lbf s²/(ft rad) or N s²/(m rad).
    DragFactor,
    /// 1/rad; 1/rad.
    PerAngle,
    /// 1/rad²; 1/rad².
    PerAngleSquared,
}

/// Exponents of length, mass, time, temperature, plane angle and percent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Dimension([i32; 6]);

impl Dimension {
    const NONE: Self = Self([0; 6]);
    const LENGTH: Self = Self([1, 0, 0, 0, 0, 0]);
    const MASS: Self = Self([0, 1, 0, 0, 0, 0]);
    const TIME: Self = Self([0, 0, 1, 0, 0, 0]);
    const TEMPERATURE: Self = Self([0, 0, 0, 1, 0, 0]);
    const ANGLE: Self = Self([0, 0, 0, 0, 1, 0]);
    const PERCENT: Self = Self([0, 0, 0, 0, 0, 1]);
    const VELOCITY: Self = Self([1, 0, -1, 0, 0, 0]);
    const ANGULAR_RATE: Self = Self([0, 0, -1, 0, 1, 0]);
    const FORCE: Self = Self([1, 1, -2, 0, 0, 0]);
    const ENERGY: Self = Self([2, 1, -2, 0, 0, 0]);
    const POWER: Self = Self([2, 1, -3, 0, 0, 0]);
    const PRESSURE: Self = Self([-1, 1, -2, 0, 0, 0]);

    fn times(self, other: Self, power: i32) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + power * other.0[i]))
    }
}

/// A unit for people: its symbol, and how much SI one of it is.
struct Display {
    symbol: &'static str,
    /// SI = factor (value + offset).
    factor: f64,
    offset: f64,
}

const fn scaled(symbol: &'static str, factor: f64) -> Display {
    Display { symbol, factor, offset: 0.0 }
}

impl Kind {
    /// Every kind, for tests and documentation.
    pub const ALL: [Kind; 34] = [
        Kind::Dimensionless,
        Kind::Length,
        Kind::Velocity,
        Kind::Airspeed,
        Kind::ClimbRate,
        Kind::Acceleration,
        Kind::Angle,
        Kind::AngleRad,
        Kind::AngularRate,
        Kind::AngularRateRad,
        Kind::AngularAcceleration,
        Kind::Mass,
        Kind::Force,
        Kind::Moment,
        Kind::Power,
        Kind::Area,
        Kind::Volume,
        Kind::Inertia,
        Kind::FirstMoment,
        Kind::Density,
        Kind::Pressure,
        Kind::Temperature,
        Kind::TemperatureDifference,
        Kind::Time,
        Kind::Frequency,
        Kind::Percent,
        Kind::AnglePerPercent,
        Kind::AngularStiffness,
        Kind::AngularDamping,
        Kind::AngularRatePerPercent,
        Kind::ThrustFactor,
        Kind::DragFactor,
        Kind::PerAngle,
        Kind::PerAngleSquared,
    ];

    fn display(self, system: System) -> Display {
        use System::{Si, Us};
        match (self, system) {
            (Kind::Dimensionless, _) => scaled("-", 1.0),
            (Kind::Length, Us) => scaled("ft", FOOT),
            (Kind::Length, Si) => scaled("m", 1.0),
            (Kind::Velocity, Us) => scaled("ft/s", FOOT),
            (Kind::Airspeed, Us) => scaled("kt", KNOT),
            (Kind::ClimbRate, Us) => scaled("ft/min", FOOT / 60.0),
            (Kind::Velocity | Kind::Airspeed | Kind::ClimbRate, Si) => scaled("m/s", 1.0),
            (Kind::Acceleration, Us) => scaled("ft/s^2", FOOT),
            (Kind::Acceleration, Si) => scaled("m/s^2", 1.0),
            (Kind::Angle, _) => scaled("deg", DEGREE),
            (Kind::AngleRad, _) => scaled("rad", 1.0),
            (Kind::AngularRate, _) => scaled("deg/s", DEGREE),
            (Kind::AngularRateRad | Kind::Frequency, _) => scaled("rad/s", 1.0),
            (Kind::AngularAcceleration, _) => scaled("rad/s^2", 1.0),
            (Kind::Mass, Us) => scaled("lb", POUND),
            (Kind::Mass, Si) => scaled("kg", 1.0),
            (Kind::Force, Us) => scaled("lbf", POUND_FORCE),
            (Kind::Force, Si) => scaled("N", 1.0),
            (Kind::Moment, Us) => scaled("lbf ft", POUND_FORCE * FOOT),
            (Kind::Moment, Si) => scaled("N m", 1.0),
            (Kind::Power, Us) => scaled("hp", HORSEPOWER),
            (Kind::Power, Si) => scaled("kW", 1000.0),
            (Kind::Area, Us) => scaled("ft^2", FOOT * FOOT),
            (Kind::Area, Si) => scaled("m^2", 1.0),
            (Kind::Volume, Us) => scaled("ft^3", FOOT * FOOT * FOOT),
            (Kind::Volume, Si) => scaled("m^3", 1.0),
            (Kind::Inertia, Us) => scaled("slug ft^2", SLUG * FOOT * FOOT),
            (Kind::Inertia, Si) => scaled("kg m^2", 1.0),
            (Kind::FirstMoment, Us) => scaled("slug ft", SLUG * FOOT),
            (Kind::FirstMoment, Si) => scaled("kg m", 1.0),
            (Kind::Density, Us) => scaled("slug/ft^3", SLUG / (FOOT * FOOT * FOOT)),
            (Kind::Density, Si) => scaled("kg/m^3", 1.0),
            (Kind::Pressure, Us) => scaled("lbf/ft^2", POUND_FORCE / (FOOT * FOOT)),
            (Kind::Pressure, Si) => scaled("Pa", 1.0),
            (Kind::Temperature, Us) => {
                Display { symbol: "degF", factor: RANKINE, offset: FAHRENHEIT_ZERO }
            }
            (Kind::TemperatureDifference, Us) => scaled("degF", RANKINE),
            (Kind::Temperature | Kind::TemperatureDifference, Si) => scaled("K", 1.0),
            (Kind::Time, _) => scaled("s", 1.0),
            (Kind::Percent, _) => scaled("%", 1.0),
            (Kind::AnglePerPercent, _) => scaled("deg/%", DEGREE),
            (Kind::AngularStiffness, Us) => scaled("lbf ft/rad", POUND_FORCE * FOOT),
            (Kind::AngularStiffness, Si) => scaled("N m/rad", 1.0),
            (Kind::AngularDamping, Us) => scaled("lbf ft s/rad", POUND_FORCE * FOOT),
            (Kind::AngularDamping, Si) => scaled("N m s/rad", 1.0),
            (Kind::AngularRatePerPercent, _) => scaled("rad/s/%", 1.0),
            (Kind::ThrustFactor, Us) => scaled("lbf s^2/rad^2", POUND_FORCE),
            (Kind::ThrustFactor, Si) => scaled("N s^2/rad^2", 1.0),
            (Kind::DragFactor, Us) => scaled("lbf s^2/ft/rad", POUND_FORCE / FOOT),
            (Kind::DragFactor, Si) => scaled("N s^2/m/rad", 1.0),
            (Kind::PerAngle, _) => scaled("1/rad", 1.0),
            (Kind::PerAngleSquared, _) => scaled("1/rad^2", 1.0),
        }
    }

    /// The unit that people read, for example `lbf ft`; `-` for none.
    pub fn symbol(self, system: System) -> &'static str {
        self.display(system).symbol
    }

    /// The unit of values inside the library: coherent SI and radians, so W
    /// where people read kW; `1` for none.
    pub fn coherent(self) -> &'static str {
        match self {
            Kind::Dimensionless => "1",
            Kind::Angle => "rad",
            Kind::AngularRate => "rad/s",
            Kind::Power => "W",
            Kind::AnglePerPercent => "rad/%",
            other => other.symbol(System::Si),
        }
    }

    /// The unit as a piece of an identifier, for example `lbf_ft`, `deg_per_s`
    /// or `percent`; `1` for none. For JSON keys and CSV headers.
    pub fn identifier(self, system: System) -> String {
        let symbol = self.symbol(system);
        if symbol == "-" {
            return "1".into();
        }
        let spelled = symbol
            .replace("1/", "per_")
            .replace('/', "_per_")
            .replace('%', "percent")
            .replace("^2", "2")
            .replace("^3", "3");
        spelled.replace(' ', "_")
    }

    /// A number in SI and radians, in the unit of [`Kind::symbol`].
    pub fn from_si(self, value: f64, system: System) -> f64 {
        let unit = self.display(system);
        value / unit.factor - unit.offset
    }

    /// A number in SI and radians, in words for a message that does not know
    /// which units its reader asked for: `45 kt (23.15 m/s)`. Two decimals at
    /// most; one unit where both systems have the same.
    #[must_use]
    pub fn in_both(self, value: f64) -> String {
        let words = |system| {
            let rounded = (self.from_si(value, system) * 100.0).round() / 100.0;
            // Not minus zero.
            format!("{} {}", rounded + 0.0, self.symbol(system))
        };
        if self.symbol(System::Us) == self.symbol(System::Si) {
            words(System::Us)
        } else {
            format!("{} ({})", words(System::Us), words(System::Si))
        }
    }

    /// A number in the unit of [`Kind::symbol`], in SI and radians.
    pub fn to_si(self, value: f64, system: System) -> f64 {
        let unit = self.display(system);
        (value + unit.offset) * unit.factor
    }

    /// What the kind is called in a sentence, with its article.
    pub fn noun(self) -> &'static str {
        match self {
            Kind::Dimensionless => "a plain number",
            Kind::Length => "a length",
            Kind::Velocity => "a velocity",
            Kind::Airspeed => "an airspeed",
            Kind::ClimbRate => "a rate of climb",
            Kind::Acceleration => "an acceleration",
            Kind::Angle | Kind::AngleRad => "an angle",
            Kind::AngularRate | Kind::AngularRateRad => "an angular rate",
            Kind::AngularAcceleration => "an angular acceleration",
            Kind::Mass => "a mass",
            Kind::Force => "a force",
            Kind::Moment => "a moment",
            Kind::Power => "a power",
            Kind::Area => "an area",
            Kind::Volume => "a volume",
            Kind::Inertia => "a moment of inertia",
            Kind::FirstMoment => "a first mass moment",
            Kind::Density => "a density",
            Kind::Pressure => "a pressure",
            Kind::Temperature => "a temperature",
            Kind::TemperatureDifference => "a temperature difference",
            Kind::Time => "a time",
            Kind::Frequency => "a frequency",
            Kind::Percent => "a percentage of stick travel",
            Kind::AnglePerPercent => "an angle per stick travel",
            Kind::AngularStiffness => "an angular stiffness",
            Kind::AngularDamping => "an angular damping",
            Kind::AngularRatePerPercent => "an angular rate per stick travel",
            Kind::ThrustFactor => "a force per square of an angular rate",
            Kind::DragFactor => "a force per angular rate and velocity",
            Kind::PerAngle => "a slope per angle",
            Kind::PerAngleSquared => "a coefficient per square of an angle",
        }
    }

    /// Units to write a quantity of this kind in, the usual one first.
    pub fn usual_units(self) -> &'static [&'static str] {
        match self {
            Kind::Dimensionless => &[""],
            Kind::Length => &["ft", "m", "in", "mm"],
            Kind::Velocity => &["ft/s", "m/s", "kt", "km/h"],
            Kind::Airspeed => &["kt", "m/s", "km/h", "mph", "ft/s"],
            Kind::ClimbRate => &["ft/min", "m/s"],
            Kind::Acceleration => &["ft/s^2", "m/s^2"],
            Kind::Angle | Kind::AngleRad => &["deg", "rad"],
            Kind::AngularRate => &["deg/s", "rad/s", "rpm"],
            Kind::AngularRateRad => &["rad/s", "rpm", "deg/s"],
            Kind::AngularAcceleration => &["rad/s^2", "deg/s^2"],
            Kind::Mass => &["lb", "kg", "slug"],
            Kind::Force => &["lbf", "N", "kN"],
            Kind::Moment => &["lbf ft", "N m"],
            Kind::Power => &["hp", "kW", "W"],
            Kind::Area => &["ft^2", "m^2"],
            Kind::Volume => &["ft^3", "m^3"],
            Kind::Inertia => &["slug ft^2", "kg m^2"],
            Kind::FirstMoment => &["slug ft", "kg m"],
            Kind::Density => &["slug/ft^3", "kg/m^3"],
            Kind::Pressure => &["lbf/ft^2", "Pa"],
            Kind::Temperature => &["degC", "K", "degF"],
            Kind::TemperatureDifference => &["K", "degC", "degF"],
            Kind::Time => &["s", "ms", "min"],
            Kind::Frequency => &["rad/s", "Hz"],
            Kind::Percent => &["%"],
            Kind::AnglePerPercent => &["deg/100%", "rad/100%", "deg/%"],
            Kind::AngularStiffness => &["lbf ft/rad", "N m/rad", "N m/deg"],
            Kind::AngularDamping => &["lbf ft s/rad", "N m s/rad"],
            Kind::AngularRatePerPercent => &["rad/s/100%", "rpm/100%"],
            Kind::ThrustFactor => &["N s^2/rad^2", "lbf s^2/rad^2"],
            Kind::DragFactor => &["N s^2/m/rad", "lbf s^2/ft/rad"],
            Kind::PerAngle => &["1/rad", "1/deg"],
            Kind::PerAngleSquared => &["1/rad^2", "1/deg^2"],
        }
    }

    fn dimension(self) -> Dimension {
        let none = Dimension::NONE;
        match self {
            Kind::Dimensionless => none,
            Kind::Length => Dimension::LENGTH,
            Kind::Velocity | Kind::Airspeed | Kind::ClimbRate => Dimension::VELOCITY,
            Kind::Acceleration => Dimension::VELOCITY.times(Dimension::TIME, -1),
            Kind::Angle | Kind::AngleRad => Dimension::ANGLE,
            Kind::AngularRate | Kind::AngularRateRad | Kind::Frequency => Dimension::ANGULAR_RATE,
            Kind::AngularAcceleration => Dimension::ANGULAR_RATE.times(Dimension::TIME, -1),
            Kind::Mass => Dimension::MASS,
            Kind::Force => Dimension::FORCE,
            Kind::Moment => Dimension::ENERGY,
            Kind::Power => Dimension::POWER,
            Kind::Area => none.times(Dimension::LENGTH, 2),
            Kind::Volume => none.times(Dimension::LENGTH, 3),
            Kind::Inertia => Dimension::MASS.times(Dimension::LENGTH, 2),
            Kind::FirstMoment => Dimension::MASS.times(Dimension::LENGTH, 1),
            Kind::Density => Dimension::MASS.times(Dimension::LENGTH, -3),
            Kind::Pressure => Dimension::PRESSURE,
            Kind::Temperature | Kind::TemperatureDifference => Dimension::TEMPERATURE,
            Kind::Time => Dimension::TIME,
            Kind::Percent => Dimension::PERCENT,
            Kind::AnglePerPercent => Dimension::ANGLE.times(Dimension::PERCENT, -1),
            Kind::AngularStiffness => Dimension::ENERGY.times(Dimension::ANGLE, -1),
            Kind::AngularDamping => {
                Dimension::ENERGY.times(Dimension::TIME, 1).times(Dimension::ANGLE, -1)
            }
            Kind::AngularRatePerPercent => {
                Dimension::ANGLE.times(Dimension::TIME, -1).times(Dimension::PERCENT, -1)
            }
            Kind::ThrustFactor => {
                Dimension::FORCE.times(Dimension::TIME, 2).times(Dimension::ANGLE, -2)
            }
            Kind::DragFactor => Dimension::FORCE
                .times(Dimension::TIME, 2)
                .times(Dimension::LENGTH, -1)
                .times(Dimension::ANGLE, -1),
            Kind::PerAngle => none.times(Dimension::ANGLE, -1),
            Kind::PerAngleSquared => none.times(Dimension::ANGLE, -2),
        }
    }
}

/// Why a quantity cannot be read. `Display` says what is wrong;
/// [`QuantityError::help`] says what to write.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum QuantityError {
    /// There is no number at the start.
    #[error("`{text}` does not begin with a number")]
    NoNumber {
        /// As given.
        text: String,
        /// What was expected.
        kind: Kind,
    },
    /// Not a number, or infinite.
    #[error("`{text}` is not a finite number")]
    NotFinite {
        /// As given.
        text: String,
        /// What was expected.
        kind: Kind,
    },
    /// A number without a unit.
    #[error("`{text}` has no unit, but {noun} needs one", noun = kind.noun())]
    Bare {
        /// The number as given.
        text: String,
        /// What was expected.
        kind: Kind,
    },
    /// A word that is no unit.
    #[error("`{unit}` is not a known unit")]
    UnknownUnit {
        /// The word.
        unit: String,
        /// The nearest known unit.
        nearest: Option<&'static str>,
        /// What was expected.
        kind: Kind,
        /// The number as given.
        number: String,
    },
    /// A unit expression that cannot be read, or could be read in two ways.
    #[error("the unit `{unit}` cannot be read: {reason}")]
    Syntax {
        /// The unit expression.
        unit: String,
        /// What is wrong with it.
        reason: &'static str,
        /// What was expected.
        kind: Kind,
        /// The number as given.
        number: String,
    },
    /// A unit of another dimension.
    #[error("`{unit}` measures {given}, but {noun} is expected", noun = kind.noun())]
    WrongDimension {
        /// The unit expression.
        unit: String,
        /// What it measures, in words.
        given: String,
        /// What was expected.
        kind: Kind,
        /// The number as given.
        number: String,
    },
}

impl QuantityError {
    /// What to write instead, by example.
    pub fn help(&self) -> String {
        match self {
            Self::NoNumber { kind, .. } | Self::NotFinite { kind, .. } => right_forms("10", *kind),
            Self::Bare { text, kind } => right_forms(text, *kind),
            Self::UnknownUnit { nearest: Some(nearest), kind, number, .. } => {
                format!("did you mean `{nearest}`? Then {}", right_forms(number, *kind))
            }
            Self::UnknownUnit { kind, number, .. }
            | Self::Syntax { kind, number, .. }
            | Self::WrongDimension { kind, number, .. } => right_forms(number, *kind),
        }
    }
}

/// `write "10.66 ft" or "10.66 m"`, or a bare number for a dimensionless one.
fn right_forms(number: &str, kind: Kind) -> String {
    match kind.usual_units() {
        [""] => format!("write a number without a unit, such as {number}"),
        [only] => format!("write a number and its unit, such as \"{number} {only}\""),
        [first, second, ..] => {
            format!(
                "write a number and its unit, such as \"{number} {first}\" or \"{number} {second}\""
            )
        }
        [] => unreachable!("every kind has a usual unit"),
    }
}

/// A named unit: SI = factor × value.
struct Unit {
    name: &'static str,
    factor: f64,
    dimension: Dimension,
}

const fn unit(name: &'static str, factor: f64, dimension: Dimension) -> Unit {
    Unit { name, factor, dimension }
}

/// Every unit name that is understood. `lb` stands here as a mass; where a
/// force is expected it is read as `lbf`.
const UNITS: &[Unit] = &[
    unit("ft", FOOT, Dimension::LENGTH),
    unit("in", INCH, Dimension::LENGTH),
    unit("m", 1.0, Dimension::LENGTH),
    unit("cm", 0.01, Dimension::LENGTH),
    unit("mm", 0.001, Dimension::LENGTH),
    unit("km", 1000.0, Dimension::LENGTH),
    unit("nmi", NAUTICAL_MILE, Dimension::LENGTH),
    unit("mi", MILE, Dimension::LENGTH),
    unit("kt", KNOT, Dimension::VELOCITY),
    unit("kts", KNOT, Dimension::VELOCITY),
    unit("kn", KNOT, Dimension::VELOCITY),
    unit("mph", MILE / 3600.0, Dimension::VELOCITY),
    unit("fpm", FOOT / 60.0, Dimension::VELOCITY),
    unit("s", 1.0, Dimension::TIME),
    unit("ms", 0.001, Dimension::TIME),
    unit("min", 60.0, Dimension::TIME),
    unit("h", 3600.0, Dimension::TIME),
    unit("rad", 1.0, Dimension::ANGLE),
    unit("deg", DEGREE, Dimension::ANGLE),
    unit("rev", TURN, Dimension::ANGLE),
    unit("rpm", TURN / 60.0, Dimension::ANGULAR_RATE),
    unit("Hz", TURN, Dimension::ANGULAR_RATE),
    unit("kg", 1.0, Dimension::MASS),
    unit("g", 0.001, Dimension::MASS),
    unit("lb", POUND, Dimension::MASS),
    unit("lbm", POUND, Dimension::MASS),
    unit("slug", SLUG, Dimension::MASS),
    unit("sl", SLUG, Dimension::MASS),
    unit("lbf", POUND_FORCE, Dimension::FORCE),
    unit("N", 1.0, Dimension::FORCE),
    unit("kN", 1000.0, Dimension::FORCE),
    unit("J", 1.0, Dimension::ENERGY),
    unit("W", 1.0, Dimension::POWER),
    unit("kW", 1000.0, Dimension::POWER),
    unit("hp", HORSEPOWER, Dimension::POWER),
    unit("Pa", 1.0, Dimension::PRESSURE),
    unit("kPa", 1000.0, Dimension::PRESSURE),
    unit("hPa", 100.0, Dimension::PRESSURE),
    unit("psi", POUND_FORCE / (INCH * INCH), Dimension::PRESSURE),
    unit("psf", POUND_FORCE / (FOOT * FOOT), Dimension::PRESSURE),
    unit("K", 1.0, Dimension::TEMPERATURE),
    unit("degC", 1.0, Dimension::TEMPERATURE),
    unit("degF", RANKINE, Dimension::TEMPERATURE),
    unit("degR", RANKINE, Dimension::TEMPERATURE),
    unit("%", 1.0, Dimension::PERCENT),
];

/// Names of all units that are understood.
pub fn unit_names() -> impl Iterator<Item = &'static str> {
    UNITS.iter().map(|unit| unit.name)
}

/// A unit expression worked out. Numerator and denominator stay apart, so
/// that `rad/100%` divides by exactly 100.
#[derive(Debug, Clone, Copy)]
struct Compound {
    numerator: f64,
    denominator: f64,
    dimension: Dimension,
}

/// Why a unit expression cannot be worked out.
enum UnitFault {
    Unknown(String),
    Syntax(&'static str),
}

/// Reads a product of units with powers, such as `slug ft^2` or `N m/rad`.
///
/// Factors are joined by a space, `*`, `·` or `-`; `/` divides by the one
/// factor that follows it, together with a number in front of that factor.
/// With `pound_is_force`, `lb` means `lbf`.
fn parse_unit(text: &str, pound_is_force: bool) -> Result<Compound, UnitFault> {
    let mut compound = Compound { numerator: 1.0, denominator: 1.0, dimension: Dimension::NONE };
    let mut chars = text.chars().peekable();
    // What stands between the previous factor and the next.
    let mut dividing = false;
    let mut glued = false;
    let mut after_divisor = false;
    let mut expecting = true;
    while let Some(&c) = chars.peek() {
        match c {
            ' ' | '\u{a0}' => {
                chars.next();
            }
            '*' | '·' | '⋅' | '-' => {
                if expecting {
                    return Err(UnitFault::Syntax("an operator has nothing before it"));
                }
                expecting = true;
                chars.next();
            }
            '/' => {
                if dividing {
                    return Err(UnitFault::Syntax("two slashes follow one another"));
                }
                dividing = true;
                expecting = true;
                glued = false;
                after_divisor = false;
                chars.next();
            }
            '0'..='9' | '.' => {
                let mut digits = String::new();
                while let Some(&d) = chars.peek() {
                    if !(d.is_ascii_digit() || d == '.') {
                        break;
                    }
                    digits.push(d);
                    chars.next();
                }
                let number: f64 =
                    digits.parse().map_err(|_| UnitFault::Syntax("it holds a malformed number"))?;
                if !(number.is_finite() && number > 0.0) {
                    return Err(UnitFault::Syntax("a number in it must be positive"));
                }
                if dividing {
                    compound.denominator *= number;
                    glued = true;
                } else {
                    compound.numerator *= number;
                }
                expecting = false;
            }
            _ if c.is_alphabetic() || c == '%' || c == '°' => {
                if after_divisor {
                    return Err(UnitFault::Syntax(
                        "what follows a divisor could be above or below the line; \
                         put a slash before each divisor",
                    ));
                }
                let mut word = String::new();
                if c == '%' {
                    word.push(c);
                    chars.next();
                } else {
                    while let Some(&d) = chars.peek() {
                        if !(d.is_alphabetic() || d == '°') {
                            break;
                        }
                        word.push(d);
                        chars.next();
                    }
                }
                let power = parse_power(&mut chars)?;
                let name = match word.as_str() {
                    "lb" if pound_is_force => "lbf",
                    "°" => "deg",
                    "°C" => "degC",
                    "°F" => "degF",
                    other => other,
                };
                let Some(unit) = UNITS.iter().find(|unit| unit.name == name) else {
                    return Err(UnitFault::Unknown(word));
                };
                let magnitude = unit.factor.powi(power.abs());
                if dividing == (power >= 0) {
                    compound.denominator *= magnitude;
                } else {
                    compound.numerator *= magnitude;
                }
                let signed = if dividing { -power } else { power };
                compound.dimension = compound.dimension.times(unit.dimension, signed);
                after_divisor = dividing;
                dividing = false;
                glued = false;
                expecting = false;
            }
            _ => return Err(UnitFault::Syntax("it holds a character that no unit has")),
        }
    }
    if (dividing && !glued) || expecting {
        return Err(UnitFault::Syntax("an operator has nothing after it"));
    }
    Ok(compound)
}

/// A power after a unit: `^2`, `^-1`, `2`, `²`, or none.
fn parse_power(chars: &mut std::iter::Peekable<std::str::Chars<'_>>) -> Result<i32, UnitFault> {
    match chars.peek() {
        Some('²') => {
            chars.next();
            return Ok(2);
        }
        Some('³') => {
            chars.next();
            return Ok(3);
        }
        Some('^') => {
            chars.next();
        }
        Some(d) if d.is_ascii_digit() => {}
        _ => return Ok(1),
    }
    let negative = chars.next_if_eq(&'-').is_some();
    match chars.next().and_then(|d| d.to_digit(10)) {
        Some(digit @ 1..=4) if !chars.peek().is_some_and(char::is_ascii_digit) => {
            let power = digit as i32;
            Ok(if negative { -power } else { power })
        }
        _ => Err(UnitFault::Syntax("a power must be a whole number from 1 to 4")),
    }
}

/// Splits `10.66 ft` into `10.66` and `ft`; the number part is empty where
/// there is none.
fn split_number(text: &str) -> (&str, &str) {
    let bytes = text.as_bytes();
    let mut end = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let whole = digits(end);
    end += whole;
    let mut fraction = 0;
    if bytes.get(end) == Some(&b'.') {
        fraction = digits(end + 1);
        if whole + fraction > 0 {
            end += 1 + fraction;
        }
    }
    if whole + fraction == 0 {
        return ("", text);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let power = digits((end + 1 + sign).min(bytes.len()));
        if power > 0 {
            end += 1 + sign + power;
        }
    }
    (&text[..end], text[end..].trim())
}

/// Reads a quantity such as `"10.66 ft"` and gives it in SI and radians.
///
/// The unit may be any product of known units of the right dimension:
/// `slug ft^2`, `slug-ft^2`, `N*m/rad`, `rad/100%`. `lb` is a mass or a force
/// as the kind demands, and a mass may be given as a weight in `lbf`: it is
/// then the mass that weighs so much under standard gravity. A dimensionless
/// number may be written as a percentage.
///
/// # Errors
/// Says what is wrong and, by [`QuantityError::help`], what to write.
///
/// ```
/// use coaxdesign::units::{Kind, parse_quantity};
/// assert_eq!(parse_quantity("10 ft", Kind::Length), Ok(3.048));
/// assert!(parse_quantity("10 kg", Kind::Length).is_err());
/// assert!(parse_quantity("10", Kind::Length).is_err());
/// ```
pub fn parse_quantity(text: &str, kind: Kind) -> Result<f64, QuantityError> {
    // Typeset minus signs come with text copied from documents.
    let text = text.trim().replace('\u{2212}', "-");
    let (number, unit_text) = split_number(&text);
    if number.is_empty() {
        let word = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        let first = word.split_whitespace().next().unwrap_or_default();
        return Err(if matches!(first, "nan" | "inf" | "infinity") {
            QuantityError::NotFinite { text, kind }
        } else {
            QuantityError::NoNumber { text, kind }
        });
    }
    let value = match number.parse::<f64>() {
        Ok(value) if value.is_finite() => value,
        _ => {
            return Err(QuantityError::NotFinite { text: text.clone(), kind });
        }
    };
    if unit_text.is_empty() {
        return if kind == Kind::Dimensionless {
            Ok(value)
        } else {
            Err(QuantityError::Bare { text: number.into(), kind })
        };
    }
    // Scales with an offset stand alone: a compound of them has no meaning.
    if kind == Kind::Temperature {
        match unit_text {
            "degC" | "°C" => return Ok(value + CELSIUS_ZERO),
            "degF" | "°F" => return Ok((value + FAHRENHEIT_ZERO) * RANKINE),
            _ => {}
        }
    }
    let expected = kind.dimension();
    let mut mismatch = None;
    for pound_is_force in [false, true] {
        let compound = match parse_unit(unit_text, pound_is_force) {
            Ok(compound) => compound,
            Err(UnitFault::Unknown(word)) => {
                return Err(QuantityError::UnknownUnit {
                    nearest: nearest_unit(&word),
                    unit: word,
                    kind,
                    number: number.into(),
                });
            }
            Err(UnitFault::Syntax(reason)) => {
                return Err(QuantityError::Syntax {
                    unit: unit_text.into(),
                    reason,
                    kind,
                    number: number.into(),
                });
            }
        };
        let weight_as_mass =
            kind == Kind::Mass && unit_text == "lbf" && compound.dimension == Dimension::FORCE;
        let percentage = kind == Kind::Dimensionless && compound.dimension == Dimension::PERCENT;
        let divisor = match (weight_as_mass, percentage) {
            (true, _) => STANDARD_GRAVITY,
            (_, true) => 100.0,
            _ => 1.0,
        };
        if compound.dimension == expected || divisor != 1.0 {
            let si = value * compound.numerator / compound.denominator / divisor;
            return if si.is_finite() {
                Ok(si)
            } else {
                Err(QuantityError::NotFinite { text: text.clone(), kind })
            };
        }
        mismatch.get_or_insert(compound.dimension);
    }
    Err(QuantityError::WrongDimension {
        unit: unit_text.into(),
        given: describe(mismatch.unwrap_or(Dimension::NONE)),
        kind,
        number: number.into(),
    })
}

/// What a dimension measures, in words where it has a name.
fn describe(dimension: Dimension) -> String {
    if let Some(kind) = Kind::ALL.iter().find(|kind| kind.dimension() == dimension) {
        return kind.noun().into();
    }
    let mut words = Vec::new();
    for (symbol, power) in ["m", "kg", "s", "K", "rad", "%"].iter().zip(dimension.0.iter()) {
        match power {
            0 => {}
            1 => words.push((*symbol).to_string()),
            _ => words.push(format!("{symbol}^{power}")),
        }
    }
    format!("`{}`", words.join(" "))
}

/// The known unit that is spelled most like a word, if any is close.
fn nearest_unit(word: &str) -> Option<&'static str> {
    // Long forms that people write, and no edit distance finds.
    const LONG: &[(&str, &str)] = &[
        ("feet", "ft"),
        ("foot", "ft"),
        ("inch", "in"),
        ("inches", "in"),
        ("meter", "m"),
        ("meters", "m"),
        ("metre", "m"),
        ("metres", "m"),
        ("degree", "deg"),
        ("degrees", "deg"),
        ("radian", "rad"),
        ("radians", "rad"),
        ("second", "s"),
        ("seconds", "s"),
        ("sec", "s"),
        ("pound", "lb"),
        ("pounds", "lb"),
        ("lbs", "lb"),
        ("knot", "kt"),
        ("knots", "kt"),
        ("percent", "%"),
        ("kilogram", "kg"),
        ("newton", "N"),
    ];
    let lower = word.to_lowercase();
    if let Some((_, short)) = LONG.iter().find(|(long, _)| *long == lower) {
        return Some(short);
    }
    let mut best: Option<(&'static str, f64)> = None;
    for name in unit_names() {
        let likeness = strsim::jaro_winkler(&lower, &name.to_lowercase());
        if best.is_none_or(|(_, most)| likeness > most) {
            best = Some((name, likeness));
        }
    }
    best.filter(|(_, likeness)| *likeness > 0.75).map(|(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 4.0 * f64::EPSILON * b.abs(), "{a} is not {b}");
    }

    /// Where the unit for people is the coherent one, numbers are unchanged.
    #[test]
    fn coherent_units_are_those_of_the_numbers() {
        for kind in Kind::ALL {
            let people = kind.symbol(System::Si);
            let same = kind.from_si(1.5, System::Si) == 1.5;
            let alike = kind.coherent() == people || people == "-";
            assert_eq!(same, alike, "{kind:?}: {} and {people}", kind.coherent());
        }
    }

    #[test]
    fn every_symbol_reads_back_as_its_own_unit() {
        for kind in Kind::ALL {
            for system in [System::Us, System::Si] {
                let symbol = kind.symbol(system).replace('-', "");
                let text = format!("7.25 {symbol}");
                let si = parse_quantity(&text, kind).unwrap();
                close(si, kind.to_si(7.25, system));
                close(kind.from_si(si, system), 7.25);
            }
            for unit in kind.usual_units() {
                let text = format!("1 {unit}");
                assert!(parse_quantity(&text, kind).is_ok(), "{text} as {kind:?}");
            }
        }
    }

    /// Values from NIST SP 811, appendix B.
    #[test]
    fn val_known_conversions() {
        for (text, kind, si, tolerance) in [
            ("1 slug", Kind::Mass, 14.593_90, 5e-6),
            ("1 lbf", Kind::Force, 4.448_222, 5e-7),
            ("1 hp", Kind::Power, 745.699_9, 5e-5),
            ("1 kt", Kind::Velocity, 0.514_444_4, 5e-8),
            ("1 mph", Kind::Velocity, 0.447_04, 1e-12),
            ("1 km/h", Kind::Velocity, 0.277_777_8, 5e-8),
            ("1 ft/min", Kind::ClimbRate, 5.08e-3, 1e-12),
            ("1 psi", Kind::Pressure, 6_894.757, 5e-4),
            ("1 lbf ft", Kind::Moment, 1.355_818, 5e-7),
            ("1 slug/ft^3", Kind::Density, 515.378_8, 5e-5),
            ("1 rpm", Kind::AngularRate, 0.104_719_8, 5e-8),
            ("32 degF", Kind::Temperature, 273.15, 1e-9),
            ("15 degC", Kind::Temperature, 288.15, 1e-12),
            ("9 degF", Kind::TemperatureDifference, 5.0, 1e-12),
            ("20 degC", Kind::TemperatureDifference, 20.0, 1e-12),
            ("2 Hz", Kind::Frequency, 4.0 * PI, 1e-12),
        ] {
            let got = parse_quantity(text, kind).unwrap();
            assert!((got - si).abs() <= tolerance, "{text}: {got} is not {si}");
        }
    }

    #[test]
    fn pounds_are_masses_or_forces_as_the_kind_demands() {
        let mass = 992.0 * POUND;
        for text in ["992 lb", "992 lbf", "992 lbm"] {
            close(parse_quantity(text, Kind::Mass).unwrap(), mass);
        }
        close(parse_quantity("992 lb", Kind::Force).unwrap(), mass * STANDARD_GRAVITY);
        close(parse_quantity("1 ft lb", Kind::Moment).unwrap(), POUND_FORCE * FOOT);
        close(parse_quantity("1 lb ft^2", Kind::Inertia).unwrap(), POUND * FOOT * FOOT);
        // A mass given as a force in newtons is refused: only pounds have the
        // habit of meaning both.
        assert!(parse_quantity("4413 N", Kind::Mass).is_err());
        assert!(parse_quantity("992 lbm", Kind::Force).is_err());
    }

    #[test]
    fn all_ways_to_join_units_mean_the_same() {
        let expected = 446.0 * SLUG * FOOT * FOOT;
        for text in [
            "446 slug ft^2",
            "446 slug-ft^2",
            "446 slug*ft^2",
            "446 slug·ft²",
            "446 sl-ft^2",
            "446 sl ft2",
            "446slug ft ft",
            "446 ft^2 slug",
        ] {
            close(parse_quantity(text, Kind::Inertia).unwrap(), expected);
        }
        close(parse_quantity("1 N m/rad", Kind::AngularStiffness).unwrap(), 1.0);
        close(parse_quantity("1 m s^-2", Kind::Acceleration).unwrap(), 1.0);
        close(parse_quantity("1 m/s/s", Kind::Acceleration).unwrap(), 1.0);
        close(parse_quantity("6.1 1/rad", Kind::PerAngle).unwrap(), 6.1);
        close(parse_quantity("6.1 /rad", Kind::PerAngle).unwrap(), 6.1);
    }

    #[test]
    fn mix_per_hundred_percent_divides_by_exactly_100() {
        for text in ["0.5 rad/100%", "0.5 rad/100 %", "0.5 rad / 100 %"] {
            assert_eq!(parse_quantity(text, Kind::AnglePerPercent), Ok(0.005));
        }
        close(parse_quantity("1 deg/%", Kind::AnglePerPercent).unwrap(), DEGREE);
        assert_eq!(parse_quantity("97 %", Kind::Dimensionless), Ok(0.97));
        assert_eq!(parse_quantity("-100 %", Kind::Percent), Ok(-100.0));
    }

    #[test]
    fn numbers_of_every_form() {
        for (text, metres) in [
            ("-4.5e-1 m", -0.45),
            ("+.5 m", 0.5),
            ("2. m", 2.0),
            ("1E3 m", 1000.0),
            ("\u{2212}7.65 m", -7.65),
            ("  3  m ", 3.0),
        ] {
            assert_eq!(parse_quantity(text, Kind::Length), Ok(metres), "{text}");
        }
    }

    #[test]
    fn errors_name_what_is_wrong_and_what_to_write() {
        let fault = |text: &str, kind| parse_quantity(text, kind).unwrap_err();

        let error = fault("10.66", Kind::Length);
        assert!(matches!(error, QuantityError::Bare { .. }));
        assert!(error.help().contains("\"10.66 ft\""));

        let error = fault("10 slgu ft^2", Kind::Inertia);
        assert!(
            matches!(&error, QuantityError::UnknownUnit { nearest: Some("slug"), .. }),
            "{error:?}"
        );
        let error = fault("10 degrees", Kind::Angle);
        assert!(error.help().contains("`deg`"));

        let error = fault("10 kg", Kind::Length);
        assert_eq!(error.to_string(), "`kg` measures a mass, but a length is expected");
        assert!(error.help().contains("\"10 ft\""));
        assert!(matches!(fault("47 1/s", Kind::AngularRate), QuantityError::WrongDimension { .. }));
        assert!(matches!(
            fault("3 rad", Kind::Dimensionless),
            QuantityError::WrongDimension { .. }
        ));

        for text in ["nan ft", "inf m", "-inf", "1e999 ft", "1e308 km"] {
            assert!(matches!(fault(text, Kind::Length), QuantityError::NotFinite { .. }), "{text}");
        }
        for text in ["", "ft", "ten ft", ".", "-", "e5 m"] {
            assert!(matches!(fault(text, Kind::Length), QuantityError::NoNumber { .. }), "{text}");
        }
        for text in ["1 m/", "1 /", "1 *m", "1 m//s", "1 N/m s", "1 m^0", "1 m^12", "1 m^", "1 m,s"]
        {
            assert!(
                matches!(fault(text, Kind::Length), QuantityError::Syntax { .. }),
                "{text}: {:?}",
                fault(text, Kind::Length)
            );
        }
    }

    #[test]
    fn identifiers_suit_keys() {
        assert_eq!(Kind::Moment.identifier(System::Us), "lbf_ft");
        assert_eq!(Kind::AngularRate.identifier(System::Us), "deg_per_s");
        assert_eq!(Kind::Percent.identifier(System::Us), "percent");
        assert_eq!(Kind::Airspeed.identifier(System::Us), "kt");
        assert_eq!(Kind::Airspeed.identifier(System::Si), "m_per_s");
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_answered_without_panic(text in "\\PC{0,24}") {
            for kind in [Kind::Length, Kind::Mass, Kind::Temperature, Kind::Dimensionless] {
                if let Ok(value) = parse_quantity(&text, kind) {
                    proptest::prop_assert!(value.is_finite());
                }
            }
        }

        #[test]
        fn display_round_trips(value in -1e6..1e6f64) {
            for kind in Kind::ALL {
                for system in [System::Us, System::Si] {
                    let back = kind.from_si(kind.to_si(value, system), system);
                    proptest::prop_assert!((back - value).abs() <= 1e-12 * (1.0 + value.abs() + 460.0));
                }
            }
        }
    }
}
