//! The specification file: what the tuned law must meet.
//!
//! Read with the same machinery as problem files: one description drives the
//! checks, every error of a file is reported at once with line and column,
//! unknown keys are refused with the nearest valid one, and every dimensional
//! value carries its unit.

use super::axis::Channel;
use super::metrics::from_decibels;
use super::plant::{Hardware, ModelClass, ModelInfo};
use super::tuning::{ChannelSpec, Targets, TuningOptions, default_grid};
pub use crate::law::mdi::{LawSettings, Notch, Notches, TurnCoordination};
use crate::lti::mapping::{MODELS_FROM, Mapping};
use crate::problem::keys::{Key, Table, Value, above_below, default, from_to, optional, required};
use crate::problem::read::{CheckedTable, Reader, read_text};
use crate::problem::{Diagnostic, Report};
use crate::units::Kind;
use std::path::Path;

/// The built-in specification, `problems/hq.toml`.
pub const BUILTIN: &str = include_str!("../../problems/hq.toml");

/// Name of the built-in specification.
pub const BUILTIN_NAME: &str = "hq.toml (built in)";

/// A checked specification; SI units and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Specification {
    /// Speeds of the schedule, m/s, increasing.
    pub speeds: Vec<f64>,
    /// Speeds of the verification besides the schedule's own and the middles
    /// between them, m/s.
    pub verify_speeds: Vec<f64>,
    /// The law's choices. The reference delay is zero until it is known.
    pub law: LawSettings,
    /// Whether the reference delay is to be taken from the plant.
    pub automatic_reference_delay: bool,
    /// Actuators, delay, sensors.
    pub hardware: Hardware,
    /// Largest rate of blade pitch, rad/s.
    pub pitch_rate_limit: f64,
    /// How linear models from elsewhere are brought to our names and units, and
    /// where they are; the default where the file does not say.
    pub models_from: Mapping,
    /// The models; the first is nominal and the one that is inverted.
    pub models: Vec<ModelSpec>,
    /// Requirements of each channel.
    pub channels: Vec<ChannelRequirement>,
    /// What the margins of nominal models make of an axis's keys; it is in
    /// `channels` already.
    pub nominal_scales: Scales,
    /// Steps of the authority check.
    pub steps: Steps,
    /// Where turn coordination takes over.
    pub turn: TurnCoordination,
    /// What counts as comfortable.
    pub comfort: Comfort,
    /// Solver settings.
    pub solver: TuningOptions,
}

/// One model of the set, as a variation of the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    /// Name, class and extra delay.
    pub info: ModelInfo,
    /// Whether the rotors' wakes interfere; `None`: as in the problem file.
    pub interactions: Option<bool>,
    /// Factor on mass and inertia.
    pub mass_scale: f64,
    /// Shift of the centre of gravity, aft positive, m.
    pub center_of_gravity_shift: f64,
    /// Pressure altitude, m; `None`: as in the problem file.
    pub altitude: Option<f64>,
}

/// Factor by which the tuning exceeds a crossover bound: a curve that just
/// touches 0 dB there has no crossing.
const CROSSOVER_BACK_OFF: f64 = 1.003;
/// The same for off-nominal models, which are tuned at the breakpoints only
/// and verified between them too.
const OFF_NOMINAL_CROSSOVER_BACK_OFF: f64 = 1.015;

/// Requirements of one channel, as verified; the tuning may ask for more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelRequirement {
    /// The channel.
    pub channel: Channel,
    /// What is verified.
    pub spec: ChannelSpec,
}

impl ChannelRequirement {
    /// What the tuning asks for.
    pub fn tuned(&self) -> ChannelSpec {
        let mut spec = self.spec;
        for (t, back_off) in [
            (&mut spec.nominal, CROSSOVER_BACK_OFF),
            (&mut spec.off_nominal, OFF_NOMINAL_CROSSOVER_BACK_OFF),
        ] {
            t.crossover_min = t.crossover_min.map(|w| w * back_off);
            t.crossover_max = t.crossover_max.map(|w| w / back_off);
        }
        spec
    }
}

/// Step commands of the authority check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    /// Bank angle, rad.
    pub roll: f64,
    /// Pitch angle, rad.
    pub pitch: f64,
    /// Yaw rate, rad/s.
    pub yaw: f64,
    /// Vertical velocity, m/s.
    pub heave: f64,
}

/// By how much a requirement must be exceeded for a design margin of 100 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comfort {
    /// Gain margin, dB.
    pub gain_margin: f64,
    /// Phase margin, rad.
    pub phase_margin: f64,
    /// Disturbance rejection bandwidth, as a fraction of the requirement.
    pub drb: f64,
    /// Disturbance rejection peak, dB.
    pub drp: f64,
    /// Crossover, as a fraction of the bound.
    pub crossover: f64,
}

const fn frequency(low: &'static str, high: &'static str) -> Value {
    Value::Quantity(Kind::Frequency, from_to(low, high))
}

const DECIBEL: Value = Value::Number(from_to("0", "40"));
const PHASE: Value = Value::Quantity(Kind::Angle, from_to("0 deg", "90 deg"));
const RATIO: Value = Value::Limits(Kind::Frequency, from_to("0 rad/s", "100 rad/s"));
const SECONDS: Value = Value::Quantity(Kind::Time, from_to("0 s", "1 s"));
const AIRSPEED: Value = Value::Quantity(Kind::Airspeed, from_to("0 kt", "500 kt"));

static SCHEDULE: Table = Table {
    doc: "Where the gains are scheduled and checked.",
    keys: &[
        required(
            "speeds",
            Value::Quantities(0, Kind::Airspeed, from_to("0 kt", "500 kt")),
            "True airspeeds of the schedule's breakpoints, in any order.",
        ),
        optional(
            "verify_speeds",
            Value::Quantities(0, Kind::Airspeed, from_to("0 kt", "500 kt")),
            "only the breakpoints and the middles between them",
            "Further true airspeeds at which the interpolated law is verified. The breakpoints \
             and the middles between them always are.",
        ),
        default(
            "smoothing",
            Value::Number(from_to("0", "100")),
            "0.02",
            "Weight of the squared relative differences between gains at neighbouring speeds.",
        ),
    ],
    alternatives: &[],
};

static INVERSION: Table = Table {
    doc: "How the reduced model is inverted.",
    keys: &[
        default(
            "kappa",
            Value::Number(from_to("0", "1")),
            "0.25",
            "Fraction of the velocity terms that is cancelled by feedback.",
        ),
        default(
            "hybrid_feedforward",
            Value::Bool,
            "true",
            "Whether the rest of the velocity terms is fed forward from the reference model.",
        ),
        optional(
            "reference_delay",
            SECONDS,
            "the equivalent delay of hardware and rotor in roll at the lowest speed",
            "Delay of the reference in the error path.",
        ),
    ],
    alternatives: &[],
};

static HARDWARE: Table = Table {
    doc: "From measurement to blade pitch, the same in every channel.",
    keys: &[
        default(
            "actuator_bandwidth",
            frequency("0.001 rad/s", "1000 rad/s"),
            "\"30 rad/s\"",
            "Natural frequency of the second-order actuators.",
        ),
        default(
            "actuator_damping",
            Value::Number(from_to("0.1", "2")),
            "0.8",
            "Damping ratio of the actuators.",
        ),
        default("delay", SECONDS, "\"35 ms\"", "Transport delay of computer and bus."),
        default(
            "sensor_bandwidth",
            frequency("0.001 rad/s", "10000 rad/s"),
            "\"60 rad/s\"",
            "Bandwidth of the first-order sensor filters.",
        ),
        default(
            "pitch_rate_limit",
            Value::Quantity(Kind::AngularRate, from_to("0.1 deg/s", "1000 deg/s")),
            "\"60 deg/s\"",
            "Largest rate of blade pitch, for the authority check.",
        ),
    ],
    alternatives: &[],
};

static MODEL: Table = Table {
    doc: "One model of the set, as a variation of the problem.",
    keys: &[
        required(
            "class",
            Value::Choice(&[
                ("nominal", "it must meet the nominal margins"),
                ("off_nominal", "it must meet the off-nominal margins"),
            ]),
            "Which margins it must meet. The first nominal model is the one that is inverted.",
        ),
        optional(
            "interactions",
            Value::Bool,
            "as in the problem file",
            "Whether the rotors' wakes interfere with one another.",
        ),
        default(
            "mass_scale",
            Value::Number(from_to("0.001", "10")),
            "1.0",
            "Factor on mass and inertia.",
        ),
        default(
            "center_of_gravity_shift",
            Value::Quantity(Kind::Length, from_to("-30 ft", "30 ft")),
            "\"0 ft\"",
            "Shift of the centre of gravity, positive aft.",
        ),
        optional(
            "altitude",
            Value::Quantity(Kind::Length, from_to("-1000 ft", "40000 ft")),
            "as in the problem file",
            "Pressure altitude.",
        ),
        default("extra_delay", SECONDS, "\"0 ms\"", "Delay on top of the hardware's."),
    ],
    alternatives: &[],
};

static MARGINS: Table = Table {
    doc: "Requirements that hold for every axis.",
    keys: &[
        required("nominal", Value::Table(&MARGIN_SET), "For nominal models."),
        optional(
            "off_nominal",
            Value::Table(&MARGIN_SET),
            "the nominal ones",
            "For off-nominal models.",
        ),
    ],
    alternatives: &[],
};

static MARGIN_SET: Table = Table {
    doc: "Stability margins, and how far disturbance rejection may fall short of the axis's own \
          requirement.",
    keys: &[
        required("gain_margin_db", DECIBEL, "Gain margin, up and down, dB."),
        required("phase_margin", PHASE, "Phase margin."),
        default(
            "drb_scale",
            Value::Number(from_to("0.01", "2")),
            "1.0",
            "Factor on the axis's disturbance rejection bandwidth.",
        ),
        default(
            "drp_extra_db",
            Value::Number(from_to("0", "20")),
            "0.0",
            "Added to the axis's disturbance rejection peak, dB.",
        ),
        default(
            "crossover_scale",
            Value::Number(from_to("0.01", "1")),
            "1.0",
            "Factor on the axis's least crossover, and its inverse on the largest.",
        ),
    ],
    alternatives: &[],
};

/// Keys of an inner axis.
const AXIS_KEYS: &[Key] = &[
    optional(
        "drb",
        frequency("0.001 rad/s", "100 rad/s"),
        "no requirement",
        "Least disturbance rejection bandwidth.",
    ),
    optional("drp_db", DECIBEL, "no requirement", "Largest disturbance rejection peak, dB."),
    optional(
        "crossover_min",
        frequency("0.001 rad/s", "100 rad/s"),
        "no requirement",
        "Least crossover frequency.",
    ),
    optional(
        "crossover_max",
        frequency("0.001 rad/s", "100 rad/s"),
        "no requirement",
        "Largest crossover frequency.",
    ),
    default(
        "integral_ratio",
        RATIO,
        "[\"0.1 rad/s\", \"10 rad/s\"]",
        "Least and largest K_I/K_P. Without the floor the integral gain goes to zero.",
    ),
    default(
        "phase_reserve",
        PHASE,
        "\"0 deg\"",
        "Phase margin added in the tuning for what the outer loops take; not verified.",
    ),
    default(
        "priority",
        Value::Number(from_to("0.000001", "1000")),
        "1.0",
        "Factor on the price of missing this axis's requirements.",
    ),
];

static AXIS: Table = Table {
    doc: "Requirements of one axis of the inner loop.",
    keys: AXIS_KEYS,
    alternatives: &[],
};

static AXES: Table = Table {
    doc: "The inner loop. An axis that is left out is not tuned, and stays open.",
    keys: &[
        optional("roll", Value::Table(&AXIS), "not tuned", "Bank angle."),
        optional("pitch", Value::Table(&AXIS), "not tuned", "Pitch angle."),
        optional("yaw", Value::Table(&AXIS), "not tuned", "Yaw rate, with heading hold."),
        optional(
            "heave",
            Value::Table(&AXIS),
            "not tuned",
            "Earth-vertical velocity: also the vertical part of the translational rate command.",
        ),
    ],
    alternatives: &[],
};

static OUTER_AXIS: Table = Table {
    doc: "Requirements of one outer velocity loop. Its effector cut must meet the margins of the \
          axis that it commands.",
    keys: &[
        optional(
            "drb",
            frequency("0.001 rad/s", "10 rad/s"),
            "no requirement",
            "Least disturbance rejection bandwidth.",
        ),
        optional("drp_db", DECIBEL, "no requirement", "Largest disturbance rejection peak, dB."),
        default(
            "integral_ratio",
            RATIO,
            "[\"0.02 rad/s\", \"0.5 rad/s\"]",
            "Least and largest K_I/K_P.",
        ),
        default(
            "speed_range",
            Value::Limits(Kind::Airspeed, from_to("0 kt", "500 kt")),
            "[\"0 kt\", \"500 kt\"]",
            "Speeds at which the loop is closed.",
        ),
        default(
            "priority",
            Value::Number(from_to("0.000001", "1000")),
            "1.0",
            "Factor on the price of missing this loop's requirements.",
        ),
    ],
    alternatives: &[],
};

static OUTER: Table = Table {
    doc: "The outer loop: translational rate command in heading axes.",
    keys: &[
        optional("vx", Value::Table(&OUTER_AXIS), "not tuned", "Forward, through pitch."),
        optional("vy", Value::Table(&OUTER_AXIS), "not tuned", "To the right, through roll."),
    ],
    alternatives: &[],
};

static COMMAND: Table = Table {
    doc: "Command models, and the steps of the authority check.",
    keys: &[
        default(
            "roll_frequency",
            frequency("0.001 rad/s", "20 rad/s"),
            "\"2 rad/s\"",
            "Natural frequency of the roll command model.",
        ),
        default(
            "pitch_frequency",
            frequency("0.001 rad/s", "20 rad/s"),
            "\"2 rad/s\"",
            "Natural frequency of the pitch command model.",
        ),
        default(
            "attitude_damping",
            Value::Number(from_to("0.35", "2")),
            "0.8",
            "Damping ratio of both: at least 0.35, as ADS-33E asks of attitude oscillations.",
        ),
        default(
            "yaw_time_constant",
            Value::Quantity(Kind::Time, from_to("0.001 s", "20 s")),
            "\"0.5 s\"",
            "Time constant of the yaw rate command model.",
        ),
        default(
            "heave_time_constant",
            Value::Quantity(Kind::Time, from_to("0.001 s", "20 s")),
            "\"2 s\"",
            "Time constant of the vertical velocity command model.",
        ),
        default(
            "roll_step",
            Value::Quantity(Kind::Angle, above_below("0 deg", "60 deg")),
            "\"10 deg\"",
            "Bank step of the authority check.",
        ),
        default(
            "pitch_step",
            Value::Quantity(Kind::Angle, above_below("0 deg", "60 deg")),
            "\"5 deg\"",
            "Pitch step of the authority check.",
        ),
        default(
            "yaw_step",
            Value::Quantity(Kind::AngularRate, from_to("0.001 deg/s", "90 deg/s")),
            "\"15 deg/s\"",
            "Yaw rate step of the authority check.",
        ),
        default(
            "heave_step",
            Value::Quantity(Kind::ClimbRate, from_to("0.001 ft/min", "3000 ft/min")),
            "\"300 ft/min\"",
            "Vertical velocity step of the authority check.",
        ),
        default(
            "turn_coordination_speed",
            AIRSPEED,
            "\"50 kt\"",
            "Above it a yaw rate command banks the aircraft into a coordinated turn (Eq. 75 of \
             the reference paper).",
        ),
        default(
            "turn_coordination_width",
            Value::Quantity(Kind::Airspeed, from_to("0.01 kt", "100 kt")),
            "\"10 kt\"",
            "Width of the smooth blend around that speed.",
        ),
    ],
    alternatives: &[],
};

static COMFORT: Table = Table {
    doc: "By how much a requirement must be exceeded for a design margin of 100 %.",
    keys: &[
        default("gain_margin_db", DECIBEL, "3.0", "Gain margin, dB."),
        default("phase_margin", PHASE, "\"15 deg\"", "Phase margin."),
        default(
            "drb",
            Value::Number(from_to("0.001", "10")),
            "0.25",
            "Disturbance rejection bandwidth, as a fraction of the requirement.",
        ),
        default("drp_db", DECIBEL, "2.0", "Disturbance rejection peak, dB."),
        default(
            "crossover",
            Value::Number(from_to("0.001", "10")),
            "0.25",
            "Crossover, as a fraction of the bound.",
        ),
    ],
    alternatives: &[],
};

static SOLVER: Table = Table {
    doc: "Settings of the tuning. The defaults suit a helicopter.",
    keys: &[
        default(
            "grid_points",
            Value::Count(100, 5000),
            "300",
            "Frequencies of the tuning grid above 0.03 rad/s.",
        ),
        default(
            "highest_frequency",
            frequency("0.001 rad/s", "1000 rad/s"),
            "\"60 rad/s\"",
            "Highest frequency of the tuning grid.",
        ),
        default("sweeps", Value::Count(1, 50), "6", "Largest number of sweeps over the axes."),
        default("iterations", Value::Count(1, 500), "25", "Largest number of programs a sweep."),
        default(
            "phase_back_off",
            PHASE,
            "\"0.15 deg\"",
            "Phase margin added so that the dense verification is met.",
        ),
        default("gain_back_off_db", DECIBEL, "0.03", "The same for gain margins, dB."),
        default("rejection_back_off_db", DECIBEL, "0.04", "The same for |S|, dB."),
    ],
    alternatives: &[],
};

static NOTCH: Table = Table {
    doc: "A notch filter on what feedback asks of the axis.",
    keys: &[
        required(
            "frequency",
            frequency("0 rad/s", "1000 rad/s"),
            "Frequency that is taken out, such as that of a structural mode.",
        ),
        default(
            "damping",
            Value::Number(from_to("0.01", "2")),
            "0.5",
            "Damping ratio: half the relative width.",
        ),
        default(
            "depth",
            Value::Number(from_to("0", "1")),
            "0.1",
            "Factor with which the frequency passes.",
        ),
    ],
    alternatives: &[],
};

static NOTCHES: Table = Table {
    doc: "Notch filters of the inner axes.",
    keys: &[
        optional("roll", Value::Table(&NOTCH), "no filter", "In roll."),
        optional("pitch", Value::Table(&NOTCH), "no filter", "In pitch."),
        optional("yaw", Value::Table(&NOTCH), "no filter", "In yaw."),
        optional("heave", Value::Table(&NOTCH), "no filter", "In heave."),
    ],
    alternatives: &[],
};

/// The whole specification format.
pub static ROOT: Table = Table {
    doc: "What the tuned control law must meet.",
    keys: &[
        required("schedule", Value::Table(&SCHEDULE), "Where the gains are scheduled."),
        default("inversion", Value::Table(&INVERSION), "{}", "How the model is inverted."),
        optional("notch", Value::Table(&NOTCHES), "no filters", "Notch filters."),
        default("hardware", Value::Table(&HARDWARE), "{}", "From measurement to blade pitch."),
        optional(
            "models_from",
            Value::Table(&MODELS_FROM),
            "the models are those of a problem file",
            "Linear models from elsewhere.",
        ),
        optional(
            "models",
            Value::Named(&MODEL, "model"),
            "the problem as it is, nominal",
            "The models that the law must suit.",
        ),
        required("margins", Value::Table(&MARGINS), "Requirements of every axis."),
        required("axis", Value::Table(&AXES), "The inner loop."),
        optional("outer", Value::Table(&OUTER), "no outer loop", "The outer loop."),
        default("command", Value::Table(&COMMAND), "{}", "Command models."),
        default("comfort", Value::Table(&COMFORT), "{}", "The scale of design margins."),
        default("solver", Value::Table(&SOLVER), "{}", "Settings of the tuning."),
    ],
    alternatives: &[],
};

/// Reads a specification file.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub fn load(path: &Path) -> Result<Specification, Report> {
    load_with_text(path).map(|(specification, _)| specification)
}

/// Reads a specification file; also its text, for its hash.
///
/// # Errors
/// As [`load`].
pub fn load_with_text(path: &Path) -> Result<(Specification, String), Report> {
    let whole = |message: String, unreadable| {
        Report::new(
            vec![Diagnostic::whole_file(
                &path.display().to_string(),
                message,
                "specifications lie beside problem files, such as problems/hq.toml; without \
                 --spec the built-in one is used"
                    .into(),
            )],
            unreadable,
        )
    };
    if path.is_dir() {
        return Err(whole("this is a directory, not a specification".into(), true));
    }
    let bytes =
        std::fs::read(path).map_err(|e| whole(format!("the file cannot be read: {e}"), true))?;
    let text =
        String::from_utf8(bytes).map_err(|_| whole("the file is not UTF-8 text".into(), false))?;
    Ok((parse(&path.display().to_string(), &text)?, text))
}

/// The built-in specification.
///
/// # Errors
/// None in practice: a test holds it to the checks.
pub fn builtin() -> Result<Specification, Report> {
    parse(BUILTIN_NAME, BUILTIN)
}

/// Reads a specification from a text; `name` stands for the file in messages.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub fn parse(name: &str, text: &str) -> Result<Specification, Report> {
    read_text(name, text, &ROOT, build)
}

/// Margins of one class, dB and rad.
#[derive(Clone, Copy)]
struct MarginSet {
    gain: f64,
    phase: f64,
    scales: Scales,
}

/// What a class of models makes of the requirements of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Factor on the least disturbance rejection bandwidth.
    pub drb: f64,
    /// Added to the largest disturbance rejection peak, dB.
    pub drp_extra: f64,
    /// Factor on the least crossover; the largest is divided by it.
    pub crossover: f64,
}

impl Default for Scales {
    fn default() -> Self {
        Self { drb: 1.0, drp_extra: 0.0, crossover: 1.0 }
    }
}

fn margin_set(t: &CheckedTable) -> Option<MarginSet> {
    Some(MarginSet {
        gain: from_decibels(t.number("gain_margin_db")?),
        phase: t.number("phase_margin")?,
        scales: Scales {
            drb: t.number("drb_scale")?,
            drp_extra: t.number("drp_extra_db")?,
            crossover: t.number("crossover_scale")?,
        },
    })
}

fn targets(t: &CheckedTable, m: &MarginSet, outer: bool) -> Targets {
    let crossover = |key: &str| if outer { None } else { t.number(key) };
    Targets {
        gain_up: m.gain,
        gain_down: m.gain,
        phase: m.phase,
        drb: t.number("drb").map(|w| w * m.scales.drb),
        drp: t.number("drp_db").map(|db| from_decibels(db + m.scales.drp_extra)),
        crossover_min: crossover("crossover_min").map(|w| w * m.scales.crossover),
        crossover_max: crossover("crossover_max").map(|w| w / m.scales.crossover),
    }
}

/// Speeds sorted, with repeated ones reported.
fn sorted_speeds(t: &CheckedTable, key: &str, reader: &mut Reader) -> Vec<f64> {
    let mut speeds = t.number_list(key).unwrap_or_default();
    speeds.sort_by(f64::total_cmp);
    if speeds.windows(2).any(|w| w[1] - w[0] < 1e-6) {
        reader.error(
            t.place(key),
            &t.key_path(key),
            "a speed is given twice".into(),
            "give each speed once".into(),
        );
    }
    speeds
}

fn build(root: &CheckedTable, reader: &mut Reader, lenient: bool) -> Option<Specification> {
    let schedule = root.table("schedule");
    let speeds = schedule.map_or(Vec::new(), |t| sorted_speeds(t, "speeds", reader));
    let verify_speeds = schedule.map_or(Vec::new(), |t| sorted_speeds(t, "verify_speeds", reader));
    if let Some(t) = schedule
        && speeds.is_empty()
        && t.given("speeds")
        && !lenient
    {
        reader.error(
            t.place("speeds"),
            "schedule.speeds",
            "an empty list of speeds".into(),
            "give at least one, such as speeds = [\"0 kt\"]".into(),
        );
    }
    let margins = root.table("margins");
    let nominal = margins.and_then(|t| margin_set(t.table("nominal")?));
    let off = margins.and_then(|t| t.table("off_nominal")).and_then(margin_set).or(nominal);

    let mut models: Vec<ModelSpec> = Vec::new();
    for (name, t) in root.named("models") {
        let class = match t.choice("class") {
            Some("nominal") => ModelClass::Nominal,
            Some(_) => ModelClass::OffNominal,
            None => continue,
        };
        models.push(ModelSpec {
            info: ModelInfo {
                name: name.clone(),
                class,
                extra_delay: t.number("extra_delay").unwrap_or(0.0),
            },
            interactions: t.flag("interactions"),
            mass_scale: t.number("mass_scale").unwrap_or(1.0),
            center_of_gravity_shift: t.number("center_of_gravity_shift").unwrap_or(0.0),
            altitude: t.number("altitude"),
        });
    }
    if root.named("models").is_empty() {
        models.push(ModelSpec {
            info: ModelInfo {
                name: "nominal".into(),
                class: ModelClass::Nominal,
                extra_delay: 0.0,
            },
            interactions: None,
            mass_scale: 1.0,
            center_of_gravity_shift: 0.0,
            altitude: None,
        });
    }
    match models.iter().position(|m| m.info.class == ModelClass::Nominal) {
        Some(k) => models[..=k].rotate_right(1),
        None if !models.is_empty() && !lenient => reader.error(
            root.place("models"),
            "models",
            "no model is nominal".into(),
            "give one of them class = \"nominal\": the law inverts it".into(),
        ),
        None => {}
    }

    let mut channels = Vec::new();
    let everywhere = [0.0, f64::INFINITY];
    if let (Some(nominal), Some(off)) = (nominal, off) {
        for channel in Channel::ALL {
            let group = if channel.is_outer() { "outer" } else { "axis" };
            let Some(t) = root.table(group).and_then(|t| t.table(channel.name())) else {
                continue;
            };
            let spec = ChannelSpec {
                nominal: targets(t, &nominal, channel.is_outer()),
                off_nominal: targets(t, &off, channel.is_outer()),
                integral_ratio: t.numbers("integral_ratio").unwrap_or([0.0, f64::INFINITY]),
                priority: t.number("priority").unwrap_or(1.0),
                speeds: if channel.is_outer() {
                    t.numbers("speed_range").unwrap_or(everywhere)
                } else {
                    everywhere
                },
                phase_reserve: if channel.is_outer() {
                    0.0
                } else {
                    t.number("phase_reserve").unwrap_or(0.0)
                },
            };
            if let (Some(low), Some(high)) =
                (spec.nominal.crossover_min, spec.nominal.crossover_max)
                && low >= high
            {
                reader.error(
                    t.place("crossover_min"),
                    &t.key_path("crossover_min"),
                    "the least crossover is not below the largest".into(),
                    "lower it, or raise crossover_max".into(),
                );
            }
            channels.push(ChannelRequirement { channel, spec });
        }
        if let Some(t) = root.table("axis")
            && channels.iter().all(|c| c.channel.is_outer())
            && !lenient
        {
            reader.error(
                &t.place,
                "axis",
                "no axis is specified: there is nothing to tune".into(),
                "add one, such as [axis.roll] with drb = \"0.9 rad/s\"".into(),
            );
        }
        for c in &channels {
            let inner = Channel::from(c.channel.axis());
            if c.channel.is_outer() && !channels.iter().any(|o| o.channel == inner) {
                reader.error(
                    root.table("outer").map_or(&root.place, |t| &t.place),
                    &format!("outer.{}", c.channel),
                    format!("the loop commands {inner}, which is not specified"),
                    format!("add [axis.{inner}], or remove [outer.{}]", c.channel),
                );
            }
        }
    }

    let (law, hardware) = (root.table("inversion")?, root.table("hardware")?);
    let (command, comfort, solver) =
        (root.table("command")?, root.table("comfort")?, root.table("solver")?);
    let reference_delay = law.number("reference_delay");
    Some(Specification {
        law: LawSettings {
            kappa: law.number("kappa")?,
            hybrid_feedforward: law.flag("hybrid_feedforward")?,
            reference_delay: reference_delay.unwrap_or(0.0),
            roll_frequency: command.number("roll_frequency")?,
            pitch_frequency: command.number("pitch_frequency")?,
            attitude_damping: command.number("attitude_damping")?,
            yaw_time_constant: command.number("yaw_time_constant")?,
            heave_time_constant: command.number("heave_time_constant")?,
            notch: root.table("notch").map_or_else(Notches::default, |filters| {
                let of = |axis: &str| {
                    let t = filters.table(axis)?;
                    Some(Notch {
                        frequency: t.number("frequency")?,
                        damping: t.number("damping")?,
                        depth: t.number("depth")?,
                    })
                };
                Notches { roll: of("roll"), pitch: of("pitch"), yaw: of("yaw"), heave: of("heave") }
            }),
        },
        automatic_reference_delay: reference_delay.is_none(),
        hardware: Hardware {
            actuator_bandwidth: hardware.number("actuator_bandwidth")?,
            actuator_damping: hardware.number("actuator_damping")?,
            delay: hardware.number("delay")?,
            sensor_bandwidth: hardware.number("sensor_bandwidth")?,
        },
        pitch_rate_limit: hardware.number("pitch_rate_limit")?,
        models_from: root.table("models_from").map(Mapping::from_table).unwrap_or_default(),
        models,
        channels,
        nominal_scales: nominal.map_or_else(Scales::default, |m| m.scales),
        steps: Steps {
            roll: command.number("roll_step")?,
            pitch: command.number("pitch_step")?,
            yaw: command.number("yaw_step")?,
            heave: command.number("heave_step")?,
        },
        turn: TurnCoordination {
            speed: command.number("turn_coordination_speed")?,
            width: command.number("turn_coordination_width")?,
        },
        comfort: Comfort {
            gain_margin: comfort.number("gain_margin_db")?,
            phase_margin: comfort.number("phase_margin")?,
            drb: comfort.number("drb")?,
            drp: comfort.number("drp_db")?,
            crossover: comfort.number("crossover")?,
        },
        solver: TuningOptions {
            grid: default_grid(
                0.002,
                solver.number("highest_frequency")?,
                solver.count("grid_points")?,
            ),
            smoothing: schedule?.number("smoothing")?,
            sweeps: solver.count("sweeps")?,
            iterations: solver.count("iterations")?,
            phase_back_off: solver.number("phase_back_off")?,
            gain_back_off: solver.number("gain_back_off_db")?,
            rejection_back_off: solver.number("rejection_back_off_db")?,
            ..TuningOptions::default()
        },
        speeds,
        verify_speeds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_specification_is_valid() {
        let s = builtin().unwrap_or_else(|r| panic!("{r}"));
        assert_eq!(s.speeds.len(), 10);
        assert_eq!(s.models[0].info.class, ModelClass::Nominal);
        assert_eq!(s.channels.len(), 6);
        let roll = &s.channels[0].spec.nominal;
        assert!((roll.phase - 45f64.to_radians()).abs() < 1e-12);
        assert!(roll.drb.is_some());
    }

    /// Every error at once, each with its line.
    #[test]
    fn errors_are_collected_with_lines_and_nearest_keys() {
        let text = "[schedule]\nspeeds = [\"0 kt\", \"0 kt\"]\n[margins.nominal]\n\
                    gain_margin_db = 6.0\nphase_margin = 45\n[axis.roll]\ndrbb = \"0.9 rad/s\"\n\
                    crossover_min = \"3 rad/s\"\ncrossover_max = \"2 ft\"\n";
        let report = parse("bad.toml", text).unwrap_err();
        let lines: Vec<usize> = report.errors.iter().map(|e| e.line).collect();
        assert_eq!(lines, [2, 5, 7, 9], "{report}");
        assert!(report.errors[2].help.contains("drb"), "{report}");
    }

    #[test]
    fn empty_and_contradictory_specifications_are_refused() {
        let head = "[schedule]\nspeeds = [\"0 kt\"]\n[margins.nominal]\ngain_margin_db = 6.0\n\
                    phase_margin = \"45 deg\"\n";
        let error = |text: &str| parse("t.toml", text).unwrap_err().to_string();
        assert!(error(&format!("{head}[axis]\n")).contains("nothing to tune"));
        let crossed = format!(
            "{head}[axis.roll]\ncrossover_min = \"3 rad/s\"\ncrossover_max = \"2 rad/s\"\n"
        );
        assert!(error(&crossed).contains("not below the largest"));
        let lone = format!("{head}[axis.roll]\ndrb = \"0.5 rad/s\"\n[outer.vx]\n");
        assert!(error(&lone).contains("which is not specified"));
        assert!(error("").contains("missing key"));
        let none = format!("{head}[axis.roll]\n[models.a]\nclass = \"off_nominal\"\n");
        assert!(error(&none).contains("no model is nominal"));
    }

    /// Speeds may come in any order.
    #[test]
    fn speeds_are_sorted() {
        let text = "[schedule]\nspeeds = [\"40 kt\", \"0 kt\", \"20 kt\"]\n[margins.nominal]\n\
                    gain_margin_db = 6.0\nphase_margin = \"45 deg\"\n[axis.roll]\ndrb = \"0.7 rad/s\"\n";
        let s = parse("t.toml", text).unwrap_or_else(|r| panic!("{r}"));
        assert!(s.speeds.windows(2).all(|w| w[0] < w[1]));
    }
}
