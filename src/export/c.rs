//! The whole law in C99: a header and a source, no allocation, no globals but
//! constants, no more of the library than `sin`, `cos`, `atan`, `isfinite`.

use super::text::{Flat, comment, fill, list, number};
use super::{File, Input, Precision, delay_steps};

const HEADER: &str = include_str!("templates/law.h");
const SOURCE: &str = include_str!("templates/law.c");
const HYBRID: &str = include_str!("templates/hybrid.c");
const LIFT: &str = include_str!("templates/lift.c");
/// Sticks of commanded and fed-back accelerations.
const DELTA: &str = "dot(&p[@U@_DECOUPLING + (4u * j)], commanded, 4u)
            + dot(&p[@U@_ALLOCATION + (4u * j)], nu, 4u)";

/// Constants of the description that the code needs, and their names there.
pub(super) const CONSTANTS: [(&str, &str); 21] = [
    ("KAPPA", "kappa"),
    ("ROLL_FREQUENCY", "roll_frequency"),
    ("PITCH_FREQUENCY", "pitch_frequency"),
    ("ATTITUDE_DAMPING", "attitude_damping"),
    ("YAW_TIME_CONSTANT", "yaw_time_constant"),
    ("HEAVE_TIME_CONSTANT", "heave_time_constant"),
    ("TURN_SPEED", "turn_coordination_speed"),
    ("TURN_WIDTH", "turn_coordination_width"),
    ("GRAVITY", "gravity"),
    ("ATTITUDE_LIMIT", "attitude_limit"),
    ("OUTER_SLOWNESS", "outer_slowness"),
    ("ACCELERATION_LIMIT", "acceleration_limit"),
    ("SCHEDULE_LEAD", "schedule_lead"),
    ("FORGETTING", "forgetting"),
    ("YAW_LEAD", "yaw_lead"),
    ("SLOW", "slow"),
    ("PEDAL_YAW_GROWTH", "pedal_yaw_growth"),
    ("COLLECTIVE_PITCH_GROWTH", "collective_pitch_growth"),
    ("PEDAL_PITCH_GROWTH", "pedal_pitch_growth"),
    ("PEDAL_POWER_MIN", "pedal_power_min"),
    ("PEDAL_POWER_MAX", "pedal_power_max"),
];

/// A number as a C constant.
fn literal(value: f64, precision: Precision) -> String {
    let digits = number(value, precision);
    match precision {
        Precision::Float => digits + "f",
        Precision::Double => digits,
    }
}

/// Header and source.
pub(super) fn files(input: &Input) -> Vec<File> {
    let (header, source) = texts(input);
    let name = &input.options.name;
    vec![File::text(format!("{name}_law.h"), header), File::text(format!("{name}_law.c"), source)]
}

/// The texts of both.
pub(super) fn texts(input: &Input) -> (String, String) {
    let (d, o) = (input.description, input.options);
    let real = |x: f64| literal(x, o.precision);
    let reals = |x: &[f64]| x.iter().map(|v| real(*v)).collect::<Vec<_>>();
    let flat = Flat::new(input);
    let upper = o.name.to_uppercase();
    let mut places = String::new();
    for p in &flat.places {
        let size = format!("{} x {}", p.rows, p.columns);
        places += &format!(
            "#define {upper}_{} ({}u) /* {size}: {} */\n",
            p.name.to_uppercase(),
            p.offset,
            p.meaning
        );
    }
    let mut constants = String::new();
    let fed = input.schedule.law.hybrid_feedforward;
    for (name, key) in CONSTANTS.iter().filter(|c| fed || !c.0.ends_with("PITCH_GROWTH")) {
        if let Some(c) = d.constants.iter().find(|c| c.name == *key) {
            constants += &format!(
                "static const real {name} = {}; /* {}, {} */\n",
                real(c.value),
                c.unit,
                c.meaning
            );
        }
    }
    let limits: String = input
        .schedule
        .stick_limits
        .iter()
        .map(|l| format!("    {{ {}, {} }},\n", real(l[0]), real(l[1])))
        .collect();
    let mut table = String::new();
    for (speed, values) in d.speed.values.iter().zip(&flat.values) {
        table += &format!("    {{\n        /* {speed:?} m/s */\n");
        table += &list(&reals(values), "        ", 96);
        table += "    },\n";
    }
    let suffix = if o.precision == Precision::Float { "f" } else { "" };
    // Without the hybrid feed-forward nothing of it is written, so that no
    // compiler finds what is not used.
    let [hybrid, lift, lifting] = if input.schedule.law.hybrid_feedforward {
        [HYBRID, LIFT, "    real lifting = @ZERO@;\n"]
    } else {
        [""; 3]
    };
    let less = if hybrid.is_empty() {
        ""
    } else {
        "\n            - (p[@U@_DECOUPLING + (4u * j) + PITCH] * lifting)"
    };
    let warnings: Vec<String> = d.warnings.iter().map(|w| format!("WARNING: {w}")).collect();
    let mut values: Vec<(&str, String)> = vec![
        ("BANNER", comment(&d.banner(), " * ", 96)),
        ("WARNINGS", comment(&warnings, " * ", 96)),
        ("PLACES", places),
        ("CONSTANTS", constants),
        ("LIMITS", limits),
        ("SPEEDS", list(&reals(&d.speed.values), "    ", 96)),
        ("TABLE", table),
        ("REAL", if o.precision == Precision::Float { "float" } else { "double" }.into()),
        ("STEP", real(o.step)),
        ("NB", d.speed.values.len().to_string()),
        ("NV", flat.count().to_string()),
        ("ND", delay_steps(input).to_string()),
        ("ZERO", real(0.0)),
        ("HALF", real(0.5)),
        ("ONE", real(1.0)),
        ("TWO", real(2.0)),
        ("THREE", real(3.0)),
        ("SIN", format!("sin{suffix}")),
        ("COS", format!("cos{suffix}")),
        ("ATAN", format!("atan{suffix}")),
        ("U", upper.clone()),
        ("P", o.name.clone()),
    ];
    // Parts of the templates, filled first since they hold keys themselves.
    let delta = format!("{DELTA}{less}");
    let parts = [("HYBRID", hybrid), ("LIFT", lift), ("LIFTING", lifting), ("DELTA", &delta)];
    let known: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    let parts = parts.map(|(key, part)| (key, fill(part, &known)));
    values.extend(parts);
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    (fill(HEADER, &values), fill(SOURCE, &values))
}
