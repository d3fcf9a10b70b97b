//! The whole law in C99: a header and a source, no allocation, no globals but
//! constants, no more of the library than `sin`, `cos`, `atan`, `isfinite`.

use super::text::{Flat, comment, fill, list, number};
use super::{File, Input, Precision, delay_steps};

const HEADER: &str = include_str!("templates/law.h");
const SOURCE: &str = include_str!("templates/law.c");
const HYBRID: &str = include_str!("templates/hybrid.c");

/// Constants of the description that the code needs, and their names there.
pub(super) const CONSTANTS: [(&str, &str); 16] = [
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
    for (name, key) in CONSTANTS {
        if let Some(c) = d.constants.iter().find(|c| c.name == key) {
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
    let hybrid = if input.schedule.law.hybrid_feedforward { HYBRID } else { "" };
    let warnings: Vec<String> = d.warnings.iter().map(|w| format!("WARNING: {w}")).collect();
    let values: Vec<(&str, String)> = vec![
        // First, since it holds keys itself.
        ("HYBRID", hybrid.into()),
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
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    (fill(HEADER, &values), fill(SOURCE, &values))
}
