//! Manoeuvre files: what is flown, in what weather, from what start.
//!
//! Read with the same machinery as problem files and specifications.

use super::equipment::SensorNoise;
use super::wind::{Gust, GustShape, Turbulence, Weather};
use crate::control::law::{Demand, Horizontal};
use crate::problem::keys::{
    Bounds, Key, Table, Value, above_below, above_to, default, from_to, optional, required,
};
use crate::problem::read::{CheckedTable, Reader, read_text};
use crate::problem::{Diagnostic, Report, STICKS};
use crate::trim::{FlightCondition, Lateral};
use crate::units::Kind;
use std::f64::consts::TAU;
use std::path::Path;

/// Built-in manoeuvres, by name.
pub const BUILTIN: [(&str, &str); 11] = [
    ("accel-climb-turn", include_str!("../../problems/maneuvers/accel-climb-turn.toml")),
    ("dash-climb-turn", include_str!("../../problems/maneuvers/dash-climb-turn.toml")),
    ("hover-turbulence", include_str!("../../problems/maneuvers/hover-turbulence.toml")),
    ("hover-turn", include_str!("../../problems/maneuvers/hover-turn.toml")),
    ("pirouette", include_str!("../../problems/maneuvers/pirouette.toml")),
    ("slalom", include_str!("../../problems/maneuvers/slalom.toml")),
    ("accel-decel", include_str!("../../problems/maneuvers/accel-decel.toml")),
    ("sidestep", include_str!("../../problems/maneuvers/sidestep.toml")),
    ("vertical", include_str!("../../problems/maneuvers/vertical.toml")),
    ("engine-out", include_str!("../../problems/maneuvers/engine-out.toml")),
    ("lateral-doublet", include_str!("../../problems/maneuvers/lateral-doublet.toml")),
];

/// What closes the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The law holds and follows ground velocities in heading axes.
    Velocity,
    /// The law holds and follows attitudes.
    Attitude,
    /// Nothing: the sticks stay at their trim but for the inputs.
    OpenLoop,
}

/// A command over time: values at times, joined by straight lines with rounded
/// corners, constant before the first and after the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Times, s, not decreasing; two equal ones make a step.
    pub times: Vec<f64>,
    /// One a time, SI.
    pub values: Vec<f64>,
    /// Time over which the rate builds up at each end of a line, s; at most
    /// half of the line.
    pub rounding: f64,
}

impl Profile {
    /// The value at a time.
    #[must_use]
    pub fn at(&self, time: f64) -> f64 {
        let after = self.times.partition_point(|t| *t <= time);
        let last = self.times.len() - 1;
        if after == 0 {
            return self.values[0];
        }
        if after > last {
            return self.values[last];
        }
        let (t0, t1) = (self.times[after - 1], self.times[after]);
        let (a, b) = (self.values[after - 1], self.values[after]);
        let (span, passed) = (t1 - t0, time - t0);
        let round = self.rounding.min(0.5 * span);
        let rate = (b - a) / (span - round);
        if passed < round {
            a + rate * passed * passed / (2.0 * round)
        } else if passed <= span - round {
            a + rate * (passed - 0.5 * round)
        } else {
            let left = span - passed;
            b - rate * left * left / (2.0 * round)
        }
    }
}

/// A pilot's input on one stick, on top of everything else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Place in the control vector lat, lon, col, ped.
    pub stick: usize,
    /// Its form.
    pub shape: InputShape,
    /// When it begins, s.
    pub start: f64,
    /// Its size, %.
    pub amplitude: f64,
}

/// Forms of inputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InputShape {
    /// It stays.
    Step,
    /// One way, for a time, s.
    Pulse(f64),
    /// One way and the other, each for a time, s.
    Doublet(f64),
    /// 3, 2, 1 and 1 units of time, s, in turn one way and the other.
    ThreeTwoOneOne(f64),
    /// A sine whose frequency rises from the first to the second, rad/s, over
    /// a time, s. It rises exponentially, so that every octave takes as long,
    /// and fades in and out over its first and last tenth.
    Sweep(f64, f64, f64),
}

impl Input {
    /// Deflection at a time, %.
    #[must_use]
    pub fn at(&self, time: f64) -> f64 {
        let t = time - self.start;
        if t < 0.0 {
            return 0.0;
        }
        let pattern = |signs: &[f64], unit: f64| {
            // Whole units passed.
            signs.get((t / unit) as usize).copied().unwrap_or(0.0)
        };
        self.amplitude
            * match self.shape {
                InputShape::Step => 1.0,
                InputShape::Pulse(unit) => pattern(&[1.0], unit),
                InputShape::Doublet(unit) => pattern(&[1.0, -1.0], unit),
                InputShape::ThreeTwoOneOne(unit) => {
                    pattern(&[1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0], unit)
                }
                InputShape::Sweep(from, to, length) => {
                    if t >= length {
                        0.0
                    } else {
                        let ratio = (to / from).ln();
                        let phase = if ratio < 1e-6 {
                            // The frequency hardly rises, and the quotient below is rounding.
                            from * t
                        } else {
                            from * length / ratio * ((ratio * t / length).exp() - 1.0)
                        };
                        let edge = (t.min(length - t) / (0.1 * length)).min(1.0);
                        edge * edge * (3.0 - 2.0 * edge) * phase.sin()
                    }
                }
            }
    }
}

/// Where a manoeuvre starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Trimmed flight through the air.
    pub condition: FlightCondition,
    /// Height above the ground, m.
    pub height: f64,
    /// Heading, rad.
    pub heading: f64,
}

/// Limits that end a flight as `limit`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Largest true airspeed, m/s.
    pub airspeed: Option<f64>,
    /// Least height above the ground, m.
    pub height: Option<f64>,
    /// Largest bank angle either way, rad.
    pub roll: Option<f64>,
    /// Largest pitch angle either way, rad.
    pub pitch: Option<f64>,
}

/// A manoeuvre, checked; SI units and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Maneuver {
    /// Its name.
    pub title: String,
    /// How long it takes, s.
    pub duration: f64,
    /// What closes the loop.
    pub mode: Mode,
    /// Where it starts.
    pub start: Start,
    /// Ground velocity in heading axes, forward and to starboard, m/s.
    pub velocity: [Option<Profile>; 2],
    /// Rate of climb, m/s.
    pub climb_rate: Option<Profile>,
    /// Rate of turn, rad/s, positive to starboard.
    pub turn_rate: Option<Profile>,
    /// Change of bank and pitch from the start, rad.
    pub attitude: [Option<Profile>; 2],
    /// When the engine fails, s.
    pub engine_out: Option<f64>,
    /// Pilot's inputs.
    pub inputs: Vec<Input>,
    /// Moving air.
    pub weather: Weather,
    /// Noise of the sensors.
    pub noise: SensorNoise,
    /// Limits.
    pub limits: Limits,
}

/// What is held where nothing is commanded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// Ground velocity in heading axes: forward, to starboard, down, m/s.
    pub velocity: [f64; 3],
    /// Bank and pitch, rad.
    pub attitude: [f64; 2],
    /// Heading rate, rad/s.
    pub turn_rate: f64,
}

impl Maneuver {
    /// Everything held for a time, s, as in trimmed flight, in calm air.
    #[must_use]
    pub fn hold(condition: FlightCondition, mode: Mode, duration: f64) -> Self {
        Self {
            title: "hold".into(),
            duration,
            mode,
            start: Start { condition, height: 100.0, heading: 0.0 },
            velocity: [None, None],
            climb_rate: None,
            turn_rate: None,
            attitude: [None, None],
            engine_out: None,
            inputs: Vec::new(),
            weather: Weather::default(),
            noise: SensorNoise::default(),
            limits: Limits::default(),
        }
    }

    /// What is asked of the law at a time; `None` in open loop.
    #[must_use]
    pub fn demand(&self, time: f64, held: &Held) -> Option<Demand> {
        let value = |profile: &Option<Profile>, held: f64| {
            profile.as_ref().map_or(held, |profile| profile.at(time))
        };
        let horizontal = match self.mode {
            Mode::OpenLoop => return None,
            Mode::Velocity => Horizontal::Velocity {
                forward: value(&self.velocity[0], held.velocity[0]),
                right: value(&self.velocity[1], held.velocity[1]),
            },
            Mode::Attitude => Horizontal::Attitude {
                roll: held.attitude[0] + value(&self.attitude[0], 0.0),
                pitch: held.attitude[1] + value(&self.attitude[1], 0.0),
            },
        };
        Some(Demand {
            horizontal,
            heading_rate: value(&self.turn_rate, held.turn_rate),
            vertical_velocity: -value(&self.climb_rate, -held.velocity[2]),
        })
    }

    /// Inputs on the sticks at a time, %.
    #[must_use]
    pub fn inputs(&self, time: f64) -> [f64; 4] {
        let mut sticks = [0.0; 4];
        for input in &self.inputs {
            sticks[input.stick] += input.at(time);
        }
        sticks
    }
}

/// Least time between two points of a profile, s: a tenth of a control period
/// at 100 Hz. Rates over less are those of rounding.
const LEAST_SPAN: f64 = 1e-3 * (1.0 - 1e-9);
const TIMES: Bounds = from_to("0 s", "36000 s");
const SPEEDS: Bounds = from_to("-200 kt", "200 kt");

const fn profile_keys(kind: Kind, bounds: Bounds) -> [Key; 3] {
    [
        required(
            "time",
            Value::Quantities(0, Kind::Time, TIMES),
            "Times, not decreasing; two equal ones make a step.",
        ),
        required("value", Value::Quantities(0, kind, bounds), "One value a time."),
        default(
            "rounding",
            Value::Quantity(Kind::Time, from_to("0 s", "600 s")),
            "\"2 s\"",
            "Time over which the rate of change builds up at the ends of each line; at most half \
             of the line.",
        ),
    ]
}

const PROFILE_DOC: &str = "Values at times, joined by straight lines with rounded corners, \
                           constant before the first and after the last.";

static SPEED_KEYS: [Key; 3] = profile_keys(Kind::Airspeed, SPEEDS);
static SPEED: Table = Table { doc: PROFILE_DOC, keys: &SPEED_KEYS, alternatives: &[] };
static CLIMB_KEYS: [Key; 3] = profile_keys(Kind::ClimbRate, from_to("-6000 ft/min", "6000 ft/min"));
static CLIMB: Table = Table { doc: PROFILE_DOC, keys: &CLIMB_KEYS, alternatives: &[] };
static TURN_KEYS: [Key; 3] = profile_keys(Kind::AngularRate, from_to("-90 deg/s", "90 deg/s"));
static TURN: Table = Table { doc: PROFILE_DOC, keys: &TURN_KEYS, alternatives: &[] };
static ANGLE_KEYS: [Key; 3] = profile_keys(Kind::Angle, from_to("-60 deg", "60 deg"));
static ANGLE: Table = Table { doc: PROFILE_DOC, keys: &ANGLE_KEYS, alternatives: &[] };

static COMMANDS: Table = Table {
    doc: "What the law is asked for. What is not commanded is held as it was at the start.",
    keys: &[
        optional(
            "forward_velocity",
            Value::Table(&SPEED),
            "held",
            "Velocity over the ground along the heading, under `mode = \"velocity\"`.",
        ),
        optional(
            "right_velocity",
            Value::Table(&SPEED),
            "held",
            "Velocity over the ground to starboard, under `mode = \"velocity\"`.",
        ),
        optional(
            "roll",
            Value::Table(&ANGLE),
            "held",
            "Change of bank from the start, right side down positive, under `mode = \
             \"attitude\"`.",
        ),
        optional(
            "pitch",
            Value::Table(&ANGLE),
            "held",
            "Change of pitch from the start, nose up positive, under `mode = \"attitude\"`.",
        ),
        optional("climb_rate", Value::Table(&CLIMB), "held", "Rate of climb."),
        optional(
            "turn_rate",
            Value::Table(&TURN),
            "held",
            "Rate of turn of the heading, positive to starboard.",
        ),
    ],
    alternatives: &[],
};

static START: Table = Table {
    doc: "Trimmed flight without sideslip, through the air.",
    keys: &[
        default(
            "airspeed",
            Value::Quantity(Kind::Airspeed, from_to("0 kt", "200 kt")),
            "\"0 kt\"",
            "True airspeed.",
        ),
        default(
            "climb_rate",
            Value::Quantity(Kind::ClimbRate, from_to("-6000 ft/min", "6000 ft/min")),
            "\"0 ft/min\"",
            "Rate of climb.",
        ),
        default(
            "turn_rate",
            Value::Quantity(Kind::AngularRate, from_to("-60 deg/s", "60 deg/s")),
            "\"0 deg/s\"",
            "Rate of turn.",
        ),
        default(
            "height",
            Value::Quantity(Kind::Length, from_to("0 ft", "20000 ft")),
            "\"300 ft\"",
            "Height above the ground: it sets the turbulence, and nothing else.",
        ),
        default(
            "heading",
            Value::Quantity(Kind::Angle, from_to("-360 deg", "360 deg")),
            "\"0 deg\"",
            "Heading from north.",
        ),
    ],
    alternatives: &[],
};

static INPUT: Table = Table {
    doc: "A pilot's input on one stick, on top of what the law does.",
    keys: &[
        required(
            "stick",
            Value::Choice(&[
                ("lat", "lateral cyclic"),
                ("lon", "longitudinal cyclic"),
                ("col", "collective"),
                ("ped", "pedals"),
            ]),
            "Which stick.",
        ),
        required(
            "shape",
            Value::Choice(&[
                ("step", "it stays"),
                ("pulse", "for a `unit` of time"),
                ("doublet", "one way and the other, a `unit` of time each"),
                ("3-2-1-1", "3, 2, 1 and 1 `unit`s of time, one way and the other in turn"),
                (
                    "sweep",
                    "a sine whose frequency rises exponentially between `frequencies` over a \
                     `unit` of time, faded in and out",
                ),
            ]),
            "Its form.",
        ),
        required("start", Value::Quantity(Kind::Time, TIMES), "When it begins."),
        required(
            "amplitude",
            Value::Quantity(Kind::Percent, from_to("-100 %", "100 %")),
            "Its size, in the first direction.",
        ),
        default(
            "unit",
            Value::Quantity(Kind::Time, from_to("1 ms", "3600 s")),
            "\"1 s\"",
            "Unit of time of the form.",
        ),
        default(
            "frequencies",
            Value::Limits(Kind::Frequency, from_to("0.001 rad/s", "100 rad/s")),
            "[\"0.3 rad/s\", \"12 rad/s\"]",
            "First and last frequency of a sweep.",
        ),
    ],
    alternatives: &[],
};

static WIND: Table = Table {
    doc: "Steady wind.",
    keys: &[
        required(
            "speed",
            Value::Quantity(Kind::Airspeed, from_to("0 kt", "100 kt")),
            "Horizontal speed of the air.",
        ),
        default(
            "from",
            Value::Quantity(Kind::Angle, from_to("-360 deg", "360 deg")),
            "\"0 deg\"",
            "Where it comes from, from north over east.",
        ),
        default(
            "up",
            Value::Quantity(Kind::Velocity, from_to("-60 ft/s", "60 ft/s")),
            "\"0 ft/s\"",
            "Vertical velocity of the air, upward.",
        ),
    ],
    alternatives: &[],
};

static TURBULENCE: Table = Table {
    doc: "Dryden turbulence below 1000 ft after MIL-F-8785C, along the motion through the mean \
          wind.",
    keys: &[
        required(
            "wind_at_20_ft",
            Value::Quantity(Kind::Airspeed, above_to("0 kt", "100 kt")),
            "Wind at 20 ft, which sets the intensity: 15, 30 and 45 kt are light, moderate and \
             severe.",
        ),
        default(
            "rates",
            Value::Bool,
            "true",
            "Whether the air also turns, p_g, q_g, r_g, with the diameter of the largest rotor \
             as span; else its velocity is the same over the whole aircraft.",
        ),
    ],
    alternatives: &[],
};

static GUST: Table = Table {
    doc: "A discrete gust, ½ V (1 - cos(π x/d)), after MIL-F-8785C; x is the distance flown \
          through the air since it was met.",
    keys: &[
        required("time", Value::Quantity(Kind::Time, TIMES), "When it is met."),
        required(
            "length",
            Value::Quantity(Kind::Length, from_to("0.1 ft", "10000 ft")),
            "Length d of its rise.",
        ),
        default(
            "forward",
            Value::Quantity(Kind::Velocity, from_to("-100 ft/s", "100 ft/s")),
            "\"0 ft/s\"",
            "Velocity of the air along the heading at that time: a tail gust.",
        ),
        default(
            "right",
            Value::Quantity(Kind::Velocity, from_to("-100 ft/s", "100 ft/s")),
            "\"0 ft/s\"",
            "Velocity of the air to starboard.",
        ),
        default(
            "up",
            Value::Quantity(Kind::Velocity, from_to("-100 ft/s", "100 ft/s")),
            "\"0 ft/s\"",
            "Velocity of the air upward.",
        ),
        default(
            "shape",
            Value::Choice(&[
                ("hold", "it stays, as in the standard"),
                ("pulse", "it falls off as it rose"),
            ]),
            "\"hold\"",
            "What follows the rise.",
        ),
    ],
    alternatives: &[],
};

static NOISE: Table = Table {
    doc: "Normal noise of the sensors, standard deviations of each sample.",
    keys: &[
        default(
            "velocity",
            Value::Quantity(Kind::Velocity, from_to("0 ft/s", "30 ft/s")),
            "\"0 ft/s\"",
            "Ground velocity u, v, w.",
        ),
        default(
            "rate",
            Value::Quantity(Kind::AngularRate, from_to("0 deg/s", "30 deg/s")),
            "\"0 deg/s\"",
            "Body rates p, q, r.",
        ),
        default(
            "attitude",
            Value::Quantity(Kind::Angle, from_to("0 deg", "10 deg")),
            "\"0 deg\"",
            "Bank and pitch.",
        ),
        default(
            "airspeed",
            Value::Quantity(Kind::Velocity, from_to("0 ft/s", "30 ft/s")),
            "\"0 ft/s\"",
            "True airspeed.",
        ),
    ],
    alternatives: &[],
};

static LIMITS: Table = Table {
    doc: "Bounds that end a flight with the status `limit`.",
    keys: &[
        optional(
            "airspeed",
            Value::Quantity(Kind::Airspeed, above_to("0 kt", "300 kt")),
            "none",
            "Largest true airspeed.",
        ),
        optional(
            "height",
            Value::Quantity(Kind::Length, from_to("-1000 ft", "20000 ft")),
            "none",
            "Least height above the ground.",
        ),
        optional(
            "roll",
            Value::Quantity(Kind::Angle, above_below("0 deg", "80 deg")),
            "none",
            "Largest bank either way.",
        ),
        optional(
            "pitch",
            Value::Quantity(Kind::Angle, above_below("0 deg", "80 deg")),
            "none",
            "Largest pitch either way.",
        ),
    ],
    alternatives: &[],
};

/// The whole manoeuvre format.
pub static ROOT: Table = Table {
    doc: "A manoeuvre: what is flown, from what start, in what weather.",
    keys: &[
        required("title", Value::Text, "Its name, for reports."),
        required(
            "duration",
            Value::Quantity(Kind::Time, from_to("10 ms", "36000 s")),
            "How long it takes.",
        ),
        required(
            "mode",
            Value::Choice(&[
                ("velocity", "the law follows velocities over the ground in heading axes"),
                ("attitude", "the law follows attitudes"),
                ("open_loop", "the sticks stay at their trim but for the inputs"),
            ]),
            "What closes the loop.",
        ),
        default("start", Value::Table(&START), "{}", "Where it starts."),
        optional("commands", Value::Table(&COMMANDS), "everything is held", "Commands."),
        optional(
            "engine_out",
            Value::Quantity(Kind::Time, TIMES),
            "it runs",
            "When the engine fails: from then on the rotors turn by what the air does to them. \
             Their speeds must be states, as with a governor.",
        ),
        optional("inputs", Value::Named(&INPUT, "input"), "none", "Pilot's inputs."),
        optional("wind", Value::Table(&WIND), "still air", "Steady wind."),
        optional("turbulence", Value::Table(&TURBULENCE), "none", "Turbulence."),
        optional("gusts", Value::Named(&GUST, "gust"), "none", "Discrete gusts."),
        default("noise", Value::Table(&NOISE), "{}", "Noise of the sensors."),
        default("limits", Value::Table(&LIMITS), "{}", "Bounds that end the flight."),
    ],
    alternatives: &[],
};

/// Reads a manoeuvre file.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub fn load(path: &Path) -> Result<Maneuver, Report> {
    let whole = |message: String, unreadable| {
        let names: Vec<&str> = BUILTIN.iter().map(|(name, _)| *name).collect();
        Report::new(
            vec![Diagnostic::whole_file(
                &path.display().to_string(),
                message,
                format!("give a manoeuvre file, or a built-in one: {}", names.join(", ")),
            )],
            unreadable,
        )
    };
    if path.is_dir() {
        return Err(whole("this is a directory, not a manoeuvre".into(), true));
    }
    let bytes =
        std::fs::read(path).map_err(|e| whole(format!("the file cannot be read: {e}"), true))?;
    let text =
        String::from_utf8(bytes).map_err(|_| whole("the file is not UTF-8 text".into(), false))?;
    parse(&path.display().to_string(), &text)
}

/// A built-in manoeuvre; `None` where there is none of that name.
#[must_use]
pub fn builtin(name: &str) -> Option<Result<Maneuver, Report>> {
    let (name, text) = BUILTIN.iter().find(|(known, _)| *known == name)?;
    Some(parse(&format!("{name} (built in)"), text))
}

/// Reads a manoeuvre from a text; `name` stands for the file in messages.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub fn parse(name: &str, text: &str) -> Result<Maneuver, Report> {
    read_text(name, text, &ROOT, |root, reader, _| build(root, reader))
}

fn profile(commands: Option<&CheckedTable>, key: &str, reader: &mut Reader) -> Option<Profile> {
    let table = commands?.table(key)?;
    let (times, values) = (table.number_list("time")?, table.number_list("value")?);
    if times.is_empty() || times.len() != values.len() {
        reader.error(
            table.place("value"),
            &table.key_path("value"),
            format!("{} values for {} times", values.len(), times.len()),
            "give as many values as times, and at least one".into(),
        );
        return None;
    }
    if times.windows(2).any(|pair| pair[1] < pair[0]) {
        reader.error(
            table.place("time"),
            &table.key_path("time"),
            "the times are not in order".into(),
            "write them from the earliest to the latest; two equal ones make a step".into(),
        );
        return None;
    }
    let near = |pair: &[f64]| pair[1] > pair[0] && pair[1] - pair[0] < LEAST_SPAN;
    if let Some(pair) = times.windows(2).find(|pair| near(pair)) {
        reader.error(
            table.place("time"),
            &table.key_path("time"),
            format!("the times {:e} s and {:e} s are too close to tell apart", pair[0], pair[1]),
            "leave at least 1 ms between two times; two equal ones make a step".into(),
        );
        return None;
    }
    Some(Profile { times, values, rounding: table.number("rounding")? })
}

fn build(root: &CheckedTable, reader: &mut Reader) -> Option<Maneuver> {
    let mode = root.choice("mode").map(|word| match word {
        "velocity" => Mode::Velocity,
        "attitude" => Mode::Attitude,
        _ => Mode::OpenLoop,
    });
    let commands = root.table("commands");
    if let (Some(commands), Some(mode)) = (commands, mode) {
        let foreign: &[&str] = match mode {
            Mode::Velocity => &["roll", "pitch"],
            Mode::Attitude => &["forward_velocity", "right_velocity"],
            Mode::OpenLoop => {
                &["forward_velocity", "right_velocity", "roll", "pitch", "climb_rate", "turn_rate"]
            }
        };
        for key in foreign.iter().filter(|key| commands.given(key)) {
            reader.error(
                commands.place(key),
                &commands.key_path(key),
                "nothing follows this command in this mode".into(),
                "change `mode`, or remove the command; sticks are moved by `[inputs.NAME]`".into(),
            );
        }
    }
    let velocity = ["forward_velocity", "right_velocity"].map(|key| profile(commands, key, reader));
    let attitude = ["roll", "pitch"].map(|key| profile(commands, key, reader));
    let climb_rate = profile(commands, "climb_rate", reader);
    let turn_rate = profile(commands, "turn_rate", reader);

    let mut inputs = Vec::new();
    for (_, table) in root.named("inputs") {
        let (Some(stick), Some(shape), Some(unit)) =
            (table.choice("stick"), table.choice("shape"), table.number("unit"))
        else {
            continue;
        };
        let (Some(start), Some(amplitude), Some([from, to])) =
            (table.number("start"), table.number("amplitude"), table.numbers("frequencies"))
        else {
            continue;
        };
        inputs.push(Input {
            stick: STICKS.iter().position(|name| *name == stick)?,
            shape: match shape {
                "step" => InputShape::Step,
                "pulse" => InputShape::Pulse(unit),
                "doublet" => InputShape::Doublet(unit),
                "3-2-1-1" => InputShape::ThreeTwoOneOne(unit),
                _ => InputShape::Sweep(from, to, unit),
            },
            start,
            amplitude,
        });
    }
    let mut gusts = Vec::new();
    for (_, table) in root.named("gusts") {
        let component = |key| table.number(key);
        let (Some(forward), Some(right), Some(up)) =
            (component("forward"), component("right"), component("up"))
        else {
            continue;
        };
        let (Some(time), Some(length), Some(shape)) =
            (component("time"), component("length"), table.choice("shape"))
        else {
            continue;
        };
        gusts.push(Gust {
            time,
            length,
            velocity: [forward, right, -up],
            shape: if shape == "pulse" { GustShape::Pulse } else { GustShape::Hold },
        });
    }
    let wind = match root.table("wind") {
        None => [0.0; 3],
        Some(table) => {
            let (speed, from) = (table.number("speed")?, table.number("from")?);
            // Snap a full turn to zero, so that the wind has no stray part.
            let (s, c) = (from % TAU).sin_cos();
            [-speed * c, -speed * s, -table.number("up")?]
        }
    };
    let start = root.table("start")?;
    let noise = root.table("noise")?;
    let limits = root.table("limits")?;
    let climb = start.number("climb_rate")?;
    let airspeed = start.number("airspeed")?;
    if airspeed > 0.0 && airspeed < climb.abs() {
        reader.error(
            start.place("airspeed"),
            &start.key_path("airspeed"),
            format!("the flight climbs or sinks by {:.3} m/s, faster than it flies", climb.abs()),
            "give a true airspeed above the rate of climb, or 0 for a vertical climb".into(),
        );
        return None;
    }
    Some(Maneuver {
        title: root.text("title")?.to_owned(),
        duration: root.number("duration")?,
        mode: mode?,
        start: Start {
            condition: FlightCondition {
                // Without airspeed a climb is vertical.
                airspeed: if airspeed > 0.0 { airspeed } else { climb.abs() },
                climb_rate: climb,
                turn_rate: start.number("turn_rate")?,
                lateral: Lateral::Sideslip(0.0),
            },
            height: start.number("height")?,
            heading: start.number("heading")?,
        },
        velocity,
        climb_rate,
        turn_rate,
        attitude,
        engine_out: root.number("engine_out"),
        inputs,
        weather: Weather {
            wind,
            turbulence: root.table("turbulence").and_then(|table| {
                let (wind_at_20_ft, rates) = (table.number("wind_at_20_ft")?, table.flag("rates")?);
                Some(Turbulence { wind_at_20_ft, rates })
            }),
            gusts,
        },
        noise: SensorNoise {
            velocity: noise.number("velocity")?,
            rate: noise.number("rate")?,
            attitude: noise.number("attitude")?,
            airspeed: noise.number("airspeed")?,
        },
        limits: Limits {
            airspeed: limits.number("airspeed"),
            height: limits.number("height"),
            roll: limits.number("roll"),
            pitch: limits.number("pitch"),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn built_in_maneuvers_are_valid() {
        for (name, _) in BUILTIN {
            let m = builtin(name).unwrap().unwrap_or_else(|r| panic!("{r}"));
            assert!(m.duration > 0.0, "{name}");
        }
        assert!(builtin("loop-the-loop").is_none());
    }

    /// A profile meets its values at its times, has no corner, and covers the
    /// same ground as its straight line.
    #[test]
    fn profiles_are_smooth_and_meet_their_values() {
        let p =
            Profile { times: vec![4.0, 27.0, 30.0], values: vec![0.0, 40.0, 10.0], rounding: 2.0 };
        for (t, v) in p.times.iter().zip(&p.values) {
            assert_relative_eq!(p.at(*t), *v, epsilon = 1e-12);
        }
        let h = 1e-4;
        let rate = |t: f64| (p.at(t + h) - p.at(t - h)) / (2.0 * h);
        let mut t = 1.0;
        while t < 33.0 {
            assert!((rate(t + h) - rate(t)).abs() < 0.02, "a corner at {t}");
            t += 0.01;
        }
        assert_relative_eq!(p.at(15.5), 20.0, epsilon = 1e-9);
        let step = Profile { times: vec![1.0, 1.0], values: vec![0.0, 5.0], rounding: 2.0 };
        assert_eq!(step.at(0.999), 0.0);
        assert_eq!(step.at(1.0), 5.0);
    }

    /// Doublets and 3-2-1-1s of unit amplitude: what they sum to.
    #[test]
    fn inputs_have_their_forms() {
        let sum = |shape| {
            let input = Input { stick: 0, shape, start: 1.0, amplitude: 2.0 };
            assert_eq!(input.at(0.99), 0.0);
            assert_eq!(input.at(1000.0), if shape == InputShape::Step { 2.0 } else { 0.0 });
            (0..20_000).map(|k| 0.001 * input.at(0.001 * f64::from(k) + 0.0005)).sum::<f64>()
        };
        assert_relative_eq!(sum(InputShape::Pulse(0.5)), 1.0, epsilon = 1e-9);
        assert_relative_eq!(sum(InputShape::Doublet(0.5)), 0.0, epsilon = 1e-9);
        assert_relative_eq!(sum(InputShape::ThreeTwoOneOne(0.5)), 1.0, epsilon = 1e-9);
        let sweep = Input {
            stick: 0,
            shape: InputShape::Sweep(0.5, 8.0, 40.0),
            start: 0.0,
            amplitude: 1.0,
        };
        // Zero crossings of the middle half: phase difference over π.
        let mut crossings = 0;
        for k in 10_000..30_000 {
            let (a, b) = (sweep.at(0.001 * f64::from(k)), sweep.at(0.001 * f64::from(k + 1)));
            crossings += usize::from(a * b < 0.0);
        }
        let ratio = 16f64.ln();
        let phase = 0.5 * 40.0 / ratio * ((0.75 * ratio).exp() - (0.25 * ratio).exp());
        assert!((crossings as f64 - phase / std::f64::consts::PI).abs() <= 1.0, "{crossings}");
    }

    /// Every error at once, each with its line.
    #[test]
    fn errors_are_collected_with_lines() {
        let text = "title = \"x\"\nduration = \"30\"\nmode = \"velocity\"\n\
                    [commands.roll]\ntime = [\"1 s\"]\nvalue = [\"1 deg\"]\n\
                    [commands.climb_rate]\ntime = [\"2 s\", \"1 s\"]\nvalue = [\"0 ft/min\", \"1 ft/min\"]\n\
                    [commands.turn_rate]\ntime = [\"2 s\"]\nvalue = [\"0 rad/s\", \"1 ft\"]\n\
                    [commands.right_velocity]\ntime = [\"2 s\"]\nvalue = [\"0 kt\", \"1 kt\"]\n\
                    [gust.a]\ntime = \"1 s\"\n";
        let report = parse("bad.toml", text).unwrap_err();
        let lines: Vec<usize> = report.errors.iter().map(|e| e.line).collect();
        assert_eq!(lines, [2, 4, 8, 12, 15, 16], "{report}");
        assert!(report.errors[5].help.contains("gusts"), "{report}");
    }
}
