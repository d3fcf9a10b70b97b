//! `[models_from]` of a specification: how the names and units of a set of
//! models become ours.

use crate::linear::reduction::RIGID_BODY;
use crate::problem::STICKS;
use crate::problem::keys::{Table, Value, above_to, from_to, optional};
use crate::problem::read::CheckedTable;
use crate::units::{Kind, parse_quantity};
use nalgebra::Matrix3;
use std::path::PathBuf;

/// Our names: eight states, then four sticks.
pub const NAMES: [&str; 12] =
    ["u", "v", "w", "p", "q", "r", "phi", "theta", "lat", "lon", "col", "ped"];

/// What each of [`NAMES`] measures.
pub const KINDS: [Kind; 12] = [
    Kind::Velocity,
    Kind::Velocity,
    Kind::Velocity,
    Kind::AngularRateRad,
    Kind::AngularRateRad,
    Kind::AngularRateRad,
    Kind::AngleRad,
    Kind::AngleRad,
    Kind::Percent,
    Kind::Percent,
    Kind::Percent,
    Kind::Percent,
];

/// Spellings that are taken for a name without being told: letters and digits
/// only, lower case.
const ALIASES: [&[&str]; 12] = [
    &["u", "ub", "ubody"],
    &["v", "vb", "vbody"],
    &["w", "wb", "wbody"],
    &["p", "pb", "pbody", "rollrate"],
    &["q", "qb", "qbody", "pitchrate"],
    &["r", "rb", "rbody", "yawrate"],
    &["phi", "φ", "roll", "bank", "rollattitude", "rollangle", "bankangle"],
    &["theta", "θ", "tht", "pitch", "pitchattitude", "pitchangle"],
    &["lat", "dlat", "δlat", "deltalat", "lateral", "lateralcyclic", "xlat"],
    &[
        "lon",
        "long",
        "dlon",
        "dlong",
        "δlon",
        "deltalon",
        "deltalong",
        "longitudinal",
        "longitudinalcyclic",
        "xlon",
    ],
    &["col", "coll", "dcol", "δcol", "deltacol", "collective", "xcol"],
    &["ped", "dped", "δped", "deltaped", "pedal", "pedals", "xped"],
];

/// Whether a spelling is taken for one of [`NAMES`].
pub(crate) fn is_alias(name: &str, ours: usize) -> bool {
    let plain: String =
        name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    ALIASES[ours].contains(&plain.as_str())
}

const NAME: Value = Value::Text;
const WITHOUT_NAME: &str = "found by its usual spellings";

static STATES: Table = Table {
    doc: "Names of the rigid-body states or outputs in the set. A minus sign in front reverses \
          the sign, as in `w = \"-w_up\"`.",
    keys: &[
        optional("u", NAME, WITHOUT_NAME, "Forward body velocity."),
        optional("v", NAME, WITHOUT_NAME, "Body velocity to starboard."),
        optional("w", NAME, WITHOUT_NAME, "Downward body velocity."),
        optional("p", NAME, WITHOUT_NAME, "Roll rate, right wing down."),
        optional("q", NAME, WITHOUT_NAME, "Pitch rate, nose up."),
        optional("r", NAME, WITHOUT_NAME, "Yaw rate, nose right."),
        optional("phi", NAME, WITHOUT_NAME, "Bank angle."),
        optional("theta", NAME, WITHOUT_NAME, "Pitch angle."),
    ],
    alternatives: &[],
};

static INPUTS: Table = Table {
    doc: "Names of the sticks in the set. A minus sign in front reverses the sign.",
    keys: &[
        optional("lat", NAME, WITHOUT_NAME, "Lateral stick, positive right."),
        optional("lon", NAME, WITHOUT_NAME, "Longitudinal stick."),
        optional("col", NAME, WITHOUT_NAME, "Collective, positive up."),
        optional("ped", NAME, WITHOUT_NAME, "Pedals, positive right."),
    ],
    alternatives: &[],
};

const UNIT: Value = Value::Text;
const WITHOUT_UNIT: &str = "as the set says";

static UNITS: Table = Table {
    doc: "Units of the states and sticks in the set, such as `u = \"ft/s\"`, where the set does \
          not say them.",
    keys: &[
        optional("u", UNIT, WITHOUT_UNIT, "Unit of u."),
        optional("v", UNIT, WITHOUT_UNIT, "Unit of v."),
        optional("w", UNIT, WITHOUT_UNIT, "Unit of w."),
        optional("p", UNIT, WITHOUT_UNIT, "Unit of p."),
        optional("q", UNIT, WITHOUT_UNIT, "Unit of q."),
        optional("r", UNIT, WITHOUT_UNIT, "Unit of r."),
        optional("phi", UNIT, WITHOUT_UNIT, "Unit of phi."),
        optional("theta", UNIT, WITHOUT_UNIT, "Unit of theta."),
        optional("lat", UNIT, WITHOUT_UNIT, "Unit of lat."),
        optional("lon", UNIT, WITHOUT_UNIT, "Unit of lon."),
        optional("col", UNIT, WITHOUT_UNIT, "Unit of col."),
        optional("ped", UNIT, WITHOUT_UNIT, "Unit of ped."),
    ],
    alternatives: &[],
};

const TRAVEL: Value = Value::Text;
const WITHOUT_TRAVEL: &str = "the stick is in % of its travel";

static TRAVELS: Table = Table {
    doc: "Full travel of the sticks, such as `lat = \"10 in\"`, where the set has them in another \
          unit than %. Zero of that unit is then full down for the collective, and the middle of \
          the travel for the others.",
    keys: &[
        optional("lat", TRAVEL, WITHOUT_TRAVEL, "Full travel of lat."),
        optional("lon", TRAVEL, WITHOUT_TRAVEL, "Full travel of lon."),
        optional("col", TRAVEL, WITHOUT_TRAVEL, "Full travel of col."),
        optional("ped", TRAVEL, WITHOUT_TRAVEL, "Full travel of ped."),
    ],
    alternatives: &[],
};

const MOMENT: Value =
    Value::Quantity(Kind::Inertia, above_to("0 slug ft^2", "100000000 slug ft^2"));

static MASS: Table = Table {
    doc: "Mass properties that the models belong to. `mass_scale` needs none of them, \
          `center_of_gravity_shift` all; the gyroscopic moments of a flown stitched model need the \
          inertia.",
    keys: &[
        optional(
            "mass",
            Value::Quantity(Kind::Mass, above_to("0 kg", "500000 kg")),
            "no shift of the centre of gravity",
            "Gross mass.",
        ),
        optional("i_xx", MOMENT, "no gyroscopic moments", "Roll moment of inertia."),
        optional("i_yy", MOMENT, "no gyroscopic moments", "Pitch moment of inertia."),
        optional("i_zz", MOMENT, "no gyroscopic moments", "Yaw moment of inertia."),
        optional(
            "i_xz",
            Value::Quantity(Kind::Inertia, from_to("-100000000 slug ft^2", "100000000 slug ft^2")),
            "zero",
            "Product of inertia ∫xz dm.",
        ),
    ],
    alternatives: &[],
};

/// The table `[models_from]` of a specification.
pub static MODELS_FROM: Table = Table {
    doc: "Linear models from elsewhere, instead of those of a problem file.",
    keys: &[
        optional(
            "path",
            Value::Path,
            "`--models` names the set",
            "The set: a directory of CSV tables, or a JSON, MAT or CSV file. Relative to the \
             specification.",
        ),
        optional(
            "hardware",
            Value::Choice(&[
                ("separate", "the models are of the bare airframe"),
                ("included", "actuators, delays and sensors are in the models already"),
            ]),
            "as the set says, else separate",
            "Where the hardware is.",
        ),
        optional(
            "missing_trim",
            Value::Choice(&[
                ("refuse", "a model without its trim is an error"),
                (
                    "level_flight",
                    "attitudes from the gravity terms of A, velocities of level flight without \
                     sideslip, sticks in the middle",
                ),
            ]),
            "refuse",
            "What to do with a model whose trim is not given.",
        ),
        optional("states", Value::Table(&STATES), "found by their usual spellings", "Names."),
        optional("inputs", Value::Table(&INPUTS), "found by their usual spellings", "Names."),
        optional("units", Value::Table(&UNITS), "as the set says", "Units."),
        optional("travel", Value::Table(&TRAVELS), "sticks are in %", "Travel of the sticks."),
        optional("mass", Value::Table(&MASS), "not known", "Mass properties."),
    ],
    alternatives: &[],
};

/// A name of the set, and whether its sign is ours.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// Name in the set.
    pub name: String,
    /// 1 or −1.
    pub sign: f64,
}

/// What is done with a model whose trim is not given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MissingTrim {
    /// An error.
    #[default]
    Refuse,
    /// Attitudes from the gravity terms of A, velocities of level flight
    /// without sideslip, sticks in the middle.
    LevelFlight,
}

/// Mass properties that a set belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia {
    /// Mass, kg.
    pub mass: Option<f64>,
    /// Inertia tensor, body axes, kg m².
    pub tensor: Matrix3<f64>,
    /// Its inverse.
    pub inverse: Matrix3<f64>,
}

impl Inertia {
    /// Mass, kg, and moments of inertia, kg m²; the product is ∫xz dm. `None`
    /// where no body has such moments.
    #[must_use]
    pub fn new(mass: Option<f64>, moments: [f64; 3], i_xz: f64) -> Option<Self> {
        let [x, y, z] = moments;
        let tensor = Matrix3::new(x, 0.0, -i_xz, 0.0, y, 0.0, -i_xz, 0.0, z);
        let inverse = tensor.cholesky()?.inverse();
        Some(Self { mass, tensor, inverse })
    }
}

/// How the names and units of a set become ours. The default maps the usual
/// spellings and takes the units that the set gives.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mapping {
    /// The set.
    pub path: Option<PathBuf>,
    /// Names in the set, by the place in [`NAMES`].
    pub names: [Option<Mapped>; 12],
    /// Units where the set does not say them, by the place in [`NAMES`].
    pub units: [Option<String>; 12],
    /// Full travel of lat, lon, col, ped as written.
    pub travel: [Option<String>; 4],
    /// Whether the hardware is in the models; `None`: as the set says.
    pub hardware_included: Option<bool>,
    /// Models without a trim.
    pub missing_trim: MissingTrim,
    /// Inertia.
    pub inertia: Option<Inertia>,
}

impl Mapping {
    /// The mapping of a checked `[models_from]`.
    pub(crate) fn from_table(table: &CheckedTable) -> Self {
        let mut mapping = Self { path: table.path("path").cloned(), ..Self::default() };
        let text = |group: &str, key: &str| {
            table.table(group).and_then(|t| t.text(key)).map(|t| t.trim().to_owned())
        };
        for (k, name) in NAMES.iter().enumerate() {
            let group = if k < RIGID_BODY.len() { "states" } else { "inputs" };
            mapping.names[k] = text(group, name).map(|given| match given.strip_prefix('-') {
                Some(rest) => Mapped { name: rest.trim().into(), sign: -1.0 },
                None => Mapped { name: given, sign: 1.0 },
            });
            mapping.units[k] = text("units", name);
        }
        mapping.travel = STICKS.map(|stick| text("travel", stick));
        mapping.hardware_included = table.choice("hardware").map(|word| word == "included");
        if table.choice("missing_trim") == Some("level_flight") {
            mapping.missing_trim = MissingTrim::LevelFlight;
        }
        mapping.inertia = table.table("mass").and_then(|t| {
            let moments = [t.number("i_xx")?, t.number("i_yy")?, t.number("i_zz")?];
            Inertia::new(t.number("mass"), moments, t.number("i_xz").unwrap_or(0.0))
        });
        mapping
    }
}

/// The line of a specification that names one of [`NAMES`].
pub(crate) fn line_for_name(ours: usize, theirs: &str) -> String {
    let group = if ours < RIGID_BODY.len() { "states" } else { "inputs" };
    format!("{} = \"{theirs}\" under [models_from.{group}]", NAMES[ours])
}

/// How many SI units, or % of stick, one unit of the set makes.
///
/// # Errors
/// What is wrong, and what to write.
pub(crate) fn factor(
    ours: usize,
    unit: Option<&str>,
    travel: Option<&str>,
) -> Result<f64, (String, String)> {
    let name = NAMES[ours];
    let Some(unit) = unit.filter(|u| !u.is_empty()) else {
        let usual = KINDS[ours].usual_units()[0];
        let help =
            format!("add {name} = \"{usual}\" under [models_from.units] of the specification");
        return Err((format!("{name} has no unit"), help));
    };
    match parse_quantity(&format!("1 {unit}"), KINDS[ours]) {
        Ok(factor) => return Ok(factor),
        Err(error) if KINDS[ours] != Kind::Percent => {
            let usual = KINDS[ours].usual_units().join("\", \"");
            let help = format!(
                "correct the unit, or add {name} under [models_from.units] of the specification with \
                 one of \"{usual}\""
            );
            return Err((format!("unit of {name}: {error}"), help));
        }
        Err(_) => {}
    }
    // Another unit of a stick needs the travel in it.
    let example = if unit == "-" || unit == "1" { String::from("2") } else { format!("10 {unit}") };
    let help = format!(
        "add {name} = \"{example}\" under [models_from.travel] of the specification: the full travel \
         of the stick"
    );
    let Some(travel) = travel else {
        return Err((format!("{name} is in \"{unit}\", not in % of its travel"), help));
    };
    let one = if unit == "-" || unit == "1" { String::from("1") } else { format!("1 {unit}") };
    for kind in [Kind::Length, Kind::Angle, Kind::Dimensionless] {
        if let (Ok(one), Ok(travel)) = (parse_quantity(&one, kind), parse_quantity(travel, kind)) {
            if travel == 0.0 {
                return Err((format!("the travel of {name} is zero"), help));
            }
            return Ok(100.0 * one / travel);
        }
    }
    Err((format!("the travel of {name}, \"{travel}\", is not in its unit \"{unit}\""), help))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_spellings_are_known_and_others_are_not() {
        assert!(is_alias("Delta_Lat", 8) && is_alias("φ", 6) && is_alias("u_b", 0));
        assert!(!is_alias("alpha", 2) && !is_alias("latitude", 8));
        // No spelling stands for two names.
        let all: Vec<&&str> = ALIASES.iter().flat_map(|list| list.iter()).collect();
        for (k, one) in all.iter().enumerate() {
            assert!(!all[..k].contains(one), "{one}");
        }
    }

    #[test]
    fn val_factors() {
        assert_eq!(factor(0, Some("ft/s"), None), Ok(0.3048));
        assert_eq!(factor(3, Some("deg/s"), None), Ok(1f64.to_radians()));
        assert_eq!(factor(8, Some("%"), None), Ok(1.0));
        // Ten inches of travel: an inch is 10 %.
        let inch = factor(8, Some("in"), Some("10 in")).unwrap();
        assert!((inch - 10.0).abs() < 1e-12);
        // −1 to 1 is a travel of two.
        assert_eq!(factor(9, Some("-"), Some("2")), Ok(50.0));
    }

    #[test]
    fn what_is_missing_names_the_line_to_add() {
        let (message, help) = factor(0, None, None).unwrap_err();
        assert!(
            message.contains("u has no unit")
                && help.contains("u = \"ft/s\" under [models_from.units]")
        );
        let (message, help) = factor(8, Some("in"), None).unwrap_err();
        assert!(
            message.contains("\"in\"")
                && help.contains("lat = \"10 in\" under [models_from.travel]")
        );
        let (message, _) = factor(6, Some("ft"), None).unwrap_err();
        assert!(message.contains("a length"), "{message}");
        let (message, _) = factor(8, Some("in"), Some("10 deg")).unwrap_err();
        assert!(message.contains("is not in its unit"), "{message}");
    }
}
