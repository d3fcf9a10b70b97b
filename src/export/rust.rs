//! The whole law as a `no_std` module.

use super::text::{Flat, comment, fill, list, number};
use super::{File, Input, Precision, c, delay_steps};

const SOURCE: &str = include_str!("templates/law.rs.in");
const HYBRID: &str = include_str!("templates/hybrid.rs.in");
/// Sticks of commanded and fed-back accelerations.
const DELTA: &str = "dot(&p[DECOUPLING + 4 * j..], &commanded)
                + dot(&p[ALLOCATION + 4 * j..], &nu)";

/// The module.
pub(super) fn files(input: &Input) -> Vec<File> {
    let (d, o) = (input.description, input.options);
    let real = |x: f64| number(x, o.precision);
    let reals = |x: &[f64]| x.iter().map(|v| real(*v)).collect::<Vec<_>>();
    let flat = Flat::new(input);
    let mut places = String::new();
    for p in &flat.places {
        places += &format!(
            "/// Place of the first number of a table of {} x {}, by rows: {}.\n\
             pub const {}: usize = {};\n",
            p.rows,
            p.columns,
            p.meaning,
            p.name.to_uppercase(),
            p.offset
        );
    }
    let mut constants = String::new();
    for (name, key) in c::CONSTANTS {
        if let Some(c) = d.constants.iter().find(|c| c.name == key) {
            constants += &format!(
                "/// {}, {}.\npub const {name}: Real = {};\n",
                c.meaning,
                c.unit,
                real(c.value)
            );
        }
    }
    let limits: String = input
        .schedule
        .stick_limits
        .iter()
        .map(|l| format!("    [{}, {}],\n", real(l[0]), real(l[1])))
        .collect();
    let mut table = String::new();
    for (speed, values) in d.speed.values.iter().zip(&flat.values) {
        table += &format!("    // {speed:?} m/s\n    [\n");
        table += &list(&reals(values), "        ", 96);
        table += "    ],\n";
    }
    // Without it nothing changes the commanded accelerations.
    let fed = input.schedule.law.hybrid_feedforward;
    let (hybrid, commanded) = if fed { (HYBRID, "let mut") } else { ("", "let") };
    let less = if fed { "\n                - p[DECOUPLING + 4 * j + 1] * lifting" } else { "" };
    let values: Vec<(&str, String)> = vec![
        ("HYBRID", hybrid.into()),
        ("LET", commanded.into()),
        ("DELTA", format!("{DELTA}{less}")),
        ("BANNER", comment(&d.banner(), "//! ", 96)),
        ("PLACES", places),
        ("CONSTANTS", constants),
        ("LIMITS", limits),
        ("SPEEDS", list(&reals(&d.speed.values), "    ", 96)),
        ("TABLE", table),
        ("REAL", if o.precision == Precision::Float { "f32" } else { "f64" }.into()),
        ("STEP", real(o.step)),
        ("NB", d.speed.values.len().to_string()),
        ("NV", flat.count().to_string()),
        ("ND", delay_steps(input).to_string()),
    ];
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    vec![File::text(format!("{}_law.rs", o.name), fill(SOURCE, &values))]
}
