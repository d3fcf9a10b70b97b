//! The whole law as a `no_std` module.

use super::code::{self, Form, Language};
use super::text::{Flat, comment, fill, list, number};
use super::{File, Input, Precision, c, delay_steps};
use crate::law::diagram::Function;
use crate::law::{Kind, Wire};

const SOURCE: &str = include_str!("templates/law.rs.in");

struct Rust {
    precision: Precision,
}

impl Language for Rust {
    fn number(&self, value: f64) -> String {
        number(value, self.precision)
    }
    fn constant(&self, name: &str) -> String {
        name.to_uppercase()
    }
    fn entry(&self, place: usize) -> String {
        let (table, _, _, k) = code::cell(place);
        format!("table[{} + {k}]", table.to_uppercase())
    }
    fn input(&self, name: &str) -> String {
        match name {
            "u" => "m.velocity_body[0]".into(),
            "v" => "m.velocity_body[1]".into(),
            "w" => "m.velocity_body[2]".into(),
            "p" => "m.rates[0]".into(),
            "q" => "m.rates[1]".into(),
            "r" => "m.rates[2]".into(),
            "phi" => "m.roll".into(),
            "theta" => "m.pitch".into(),
            "airspeed" => "m.airspeed".into(),
            "velocity_mode" => "mode".into(),
            "command_1" => "horizontal[0]".into(),
            "command_2" => "horizontal[1]".into(),
            "heading_rate" => "demand.heading_rate".into(),
            "v_z_command" => "demand.vertical_velocity".into(),
            "engaging" => "given.is_some()".into(),
            given => {
                let k = ["lat", "lon", "col", "ped"].iter().position(|s| given.ends_with(s));
                format!("given.unwrap_or([0.0; 4])[{}]", k.unwrap_or(0))
            }
        }
    }
    fn function(&self, f: Function, x: &str) -> String {
        match f {
            Function::Sine => format!("M::sin_cos({x}).0"),
            Function::Cosine => format!("M::sin_cos({x}).1"),
            Function::ArcTangent => format!("M::atan({x})"),
            Function::Absolute => format!("if {x} < 0.0 {{ -{x} }} else {{ {x} }}"),
        }
    }
    fn select(&self, condition: &str, yes: &str, no: &str) -> String {
        let bare = condition.strip_prefix('(').and_then(|c| c.strip_suffix(')'));
        format!("if {} {{ {yes} }} else {{ {no} }}", bare.unwrap_or(condition))
    }
    fn limit(&self, x: &str, low: &str, high: &str) -> String {
        format!("held({x}, {low}, {high})")
    }
    fn above(&self, a: &str, b: &str) -> String {
        format!("{a} > {b}")
    }
    fn join(&self, all: bool, list: &[String]) -> String {
        list.join(if all { " && " } else { " || " })
    }
    fn not(&self, x: &str) -> String {
        format!("!{x}")
    }
    fn stored(&self, name: &str) -> String {
        format!("state.{name}")
    }
    fn delayed(&self, name: &str) -> String {
        format!("state.{name}[state.oldest]")
    }
    fn before(&self, block: &str, kind: &Kind, operands: &[String]) -> Option<String> {
        match kind {
            Kind::Delay { .. } => Some(format!(
                "if {} {{\n    state.{block} = [{}; LINE];\n}}",
                operands[0], operands[1]
            )),
            Kind::Solve { .. } => {
                let (matrix, right) = operands.split_at(16);
                let rows: Vec<String> =
                    matrix.chunks(4).map(|row| format!("        [{}],", row.join(", "))).collect();
                Some(format!(
                    "let {block} = solve(\n    [\n{}\n    ],\n    [{}],\n);",
                    rows.join("\n"),
                    right.join(", ")
                ))
            }
            _ => None,
        }
    }
    fn part(&self, name: &str, index: usize) -> String {
        format!("{name}[{index}]")
    }
}

/// The module.
pub(super) fn files(input: &Input) -> Vec<File> {
    let (d, o) = (input.description, input.options);
    let real = |x: f64| number(x, o.precision);
    let reals = |x: &[f64]| x.iter().map(|v| real(*v)).collect::<Vec<_>>();
    let flat = Flat::new(input);
    let diagram = super::diagram(input, true);
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
    for (name, unit, meaning, value) in code::constants(&diagram) {
        constants += &format!(
            "/// {meaning}, {unit}.\npub const {}: Real = {};\n",
            name.to_uppercase(),
            real(value)
        );
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
    let language = Rust { precision: o.precision };
    let define = |name: &str, logical: bool| {
        format!("let {name}: {} = ", if logical { "bool" } else { "Real" })
    };
    let form = |indent| Form { indent, comment: ["// ", ""], define: &define, end: ";" };
    let only_engaging = diagram.only_engaging();
    let chosen = |w: Wire| !only_engaging[w.0];
    let blocks = code::lines(&diagram, &language, &form("        "), &chosen);
    let blocks =
        c::after_line(&blocks, "let schedule: Real = ", "        let table = at(schedule);\n");
    let engaging = code::lines(&diagram, &language, &form("            "), &|w| only_engaging[w.0]);
    let (mut reset, mut members, mut hold, mut store) =
        (String::new(), String::new(), String::new(), String::new());
    let mut member = |name: &str, kind: &str| {
        let block = diagram.find(name).map(|w| diagram.block(w));
        let (unit, meaning) = block.map_or(("", ""), |b| (b.unit, b.comment.as_str()));
        members += &format!("    /// {meaning}, {unit}\n    {name}: {kind},\n");
    };
    for [name, next, engaged] in code::stores(&diagram, &language) {
        reset += &format!("            {name}: 0.0,\n");
        hold += &format!("            state.{name} = {engaged};\n");
        store += &format!("            state.{name} = {next};\n");
        member(&name, "Real");
    }
    for [name, entering] in code::feeds(&diagram, &language) {
        reset += &format!("            {name}: [0.0; LINE],\n");
        store += &format!("            state.{name}[state.oldest] = {entering};\n");
        member(&name, "[Real; LINE]");
    }
    store += "            state.oldest = (state.oldest + 1) % LINE;\n";
    let sticks: Vec<String> =
        diagram.outputs.iter().map(|w| code::operand(&diagram, &language, *w)).collect();
    let blend = diagram.only(&["turn_blend"]);
    let computed = |w: Wire| !matches!(blend.block(w).kind, Kind::Input);
    let turn_blend = code::lines(&blend, &language, &form("    "), &computed);
    let values: Vec<(&str, String)> = vec![
        ("BLOCKS", blocks),
        ("ENGAGING", engaging),
        ("HOLD", hold),
        ("STORE", store),
        ("STICKS", format!("        state.sticks = [{}];\n", sticks.join(", "))),
        ("RESET", reset),
        ("MEMBERS", members),
        ("TURN_BLEND", turn_blend),
        ("BANNER", comment(&d.banner(), "//! ", 96)),
        ("PLACES", places),
        ("CONSTANTS", constants),
        ("LIMITS", limits),
        ("SPEEDS", list(&reals(&d.speed.values), "    ", 96)),
        ("TABLE", table),
        ("REAL", if o.precision == Precision::Float { "f32" } else { "f64" }.into()),
        ("NB", d.speed.values.len().to_string()),
        ("NV", flat.count().to_string()),
        ("ND", delay_steps(input).to_string()),
        ("NL", code::line_steps(&diagram).to_string()),
    ];
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    vec![File::text(format!("{}_law.rs", o.name), fill(SOURCE, &values))]
}
