//! The whole law in C99: a header and a source, no allocation, no globals but
//! constants, no more of the library than `sin`, `cos`, `atan`, `isfinite`.

use super::code::{self, Form, Language};
use super::text::{Flat, comment, fill, list, number};
use super::{File, Input, Precision, delay_steps};
use crate::law::diagram::Function;
use crate::law::{Diagram, Kind};

const HEADER: &str = include_str!("templates/law.h");
const SOURCE: &str = include_str!("templates/law.c");

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

struct C<'a> {
    precision: Precision,
    upper: &'a str,
}

impl Language for C<'_> {
    fn number(&self, value: f64) -> String {
        literal(value, self.precision)
    }
    fn constant(&self, name: &str) -> String {
        name.to_uppercase()
    }
    fn entry(&self, place: usize) -> String {
        let (table, _, _, k) = code::cell(place);
        format!("table[{}_{} + {k}u]", self.upper, table.to_uppercase())
    }
    fn input(&self, name: &str) -> String {
        let member = |at: &str| format!("m->{at}");
        match name {
            "u" => member("velocity_body[0]"),
            "v" => member("velocity_body[1]"),
            "w" => member("velocity_body[2]"),
            "p" => member("rates[0]"),
            "q" => member("rates[1]"),
            "r" => member("rates[2]"),
            "phi" => member("roll"),
            "theta" => member("pitch"),
            "airspeed" => member("airspeed"),
            "velocity_mode" => format!("(demand->mode == {}_VELOCITY) ? 1u : 0u", self.upper),
            "command_1" => "demand->horizontal[0]".into(),
            "command_2" => "demand->horizontal[1]".into(),
            "heading_rate" => "demand->heading_rate".into(),
            "v_z_command" => "demand->vertical_velocity".into(),
            "engaging" => "(given != NULL) ? 1u : 0u".into(),
            given => {
                let k = ["lat", "lon", "col", "ped"].iter().position(|s| given.ends_with(s));
                let k = k.unwrap_or(0);
                format!("(given != NULL) ? given[{k}] : {}", self.number(0.0))
            }
        }
    }
    fn function(&self, f: Function, x: &str) -> String {
        let suffix = if self.precision == Precision::Float { "f" } else { "" };
        match f {
            Function::Sine => format!("sin{suffix}({x})"),
            Function::Cosine => format!("cos{suffix}({x})"),
            Function::ArcTangent => format!("atan{suffix}({x})"),
            Function::Absolute => format!("({x} < {}) ? -{x} : {x}", self.number(0.0)),
        }
    }
    fn select(&self, condition: &str, yes: &str, no: &str) -> String {
        // A comparison stands in brackets; a logical number does not.
        if condition.starts_with('(') {
            format!("{condition} ? {yes} : {no}")
        } else {
            format!("({condition} != 0u) ? {yes} : {no}")
        }
    }
    fn limit(&self, x: &str, low: &str, high: &str) -> String {
        format!("held({x}, {low}, {high})")
    }
    fn above(&self, a: &str, b: &str) -> String {
        format!("{a} > {b}")
    }
    fn join(&self, all: bool, list: &[String]) -> String {
        let list: Vec<String> = list.iter().map(|x| format!("({x} != 0u)")).collect();
        list.join(if all { " && " } else { " || " })
    }
    fn not(&self, x: &str) -> String {
        format!("{x} == 0u")
    }
    fn logical(&self, comparison: &str) -> String {
        format!("({comparison}) ? 1u : 0u")
    }
    fn stored(&self, name: &str) -> String {
        format!("state->{name}")
    }
    fn delayed(&self, name: &str) -> String {
        format!("state->{name}[state->oldest]")
    }
    fn before(&self, block: &str, kind: &Kind, operands: &[String]) -> Option<String> {
        match kind {
            Kind::Delay { .. } => Some(format!(
                "if ({} != 0u) {{\n    fill(state->{block}, {});\n}}",
                operands[0], operands[1]
            )),
            Kind::Solve { .. } => {
                let (matrix, right) = operands.split_at(16);
                let rows: Vec<String> =
                    matrix.chunks(4).map(|row| format!("    {{ {} }},", row.join(", "))).collect();
                Some(format!(
                    "real {block}_matrix[4][4] = {{\n{}\n}};\nreal {block}[4] = {{ {} }};\n\
                     if (solve({block}_matrix, {block}) == 0u) {{\n    for (unsigned int i = 0u; i \
                     < 4u; i++) {{\n        {block}[i] = {};\n    }}\n}}",
                    rows.join("\n"),
                    right.join(", "),
                    self.number(0.0)
                ))
            }
            _ => None,
        }
    }
    fn part(&self, name: &str, index: usize) -> String {
        format!("{name}[{index}]")
    }
}

/// The texts of both.
pub(super) fn texts(input: &Input) -> (String, String) {
    let (d, o) = (input.description, input.options);
    let real = |x: f64| literal(x, o.precision);
    let reals = |x: &[f64]| x.iter().map(|v| real(*v)).collect::<Vec<_>>();
    let flat = Flat::new(input);
    let upper = o.name.to_uppercase();
    let diagram = super::diagram(input, true);
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
    for (name, unit, meaning, value) in code::constants(&diagram) {
        constants += &format!(
            "static const real {} = {}; /* {unit}, {meaning} */\n",
            name.to_uppercase(),
            real(value)
        );
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
    let language = C { precision: o.precision, upper: &upper };
    let define = |name: &str, logical: bool| {
        format!("const {} {name} = ", if logical { "unsigned int" } else { "real" })
    };
    let form = |indent| Form { indent, comment: ["/* ", " */"], define: &define, end: ";" };
    let only_engaging = diagram.only_engaging();
    let looked_up = format!("    {}_at(schedule, table);\n", o.name);
    let blocks = code::lines(&diagram, &language, &form("    "), &|w| !only_engaging[w.0]);
    let blocks = after_line(&blocks, "const real schedule = ", &looked_up);
    let engaging = code::lines(&diagram, &language, &form("        "), &|w| only_engaging[w.0]);
    let (mut reset, mut members, mut hold, mut store) =
        (String::new(), String::new(), String::new(), String::new());
    for [name, next, engaged] in code::stores(&diagram, &language) {
        reset += &format!("    state->{name} = {};\n", real(0.0));
        members += &member(&diagram, &o.name, &name, "");
        hold += &format!("        state->{name} = {engaged};\n");
        store += &format!("        state->{name} = {next};\n");
    }
    let mut reset_lines = String::new();
    for [name, entering] in code::feeds(&diagram, &language) {
        reset_lines += &format!("        state->{name}[k] = {};\n", real(0.0));
        members += &member(&diagram, &o.name, &name, &format!("[{upper}_LINE]"));
        store += &format!("        state->{name}[state->oldest] = {entering};\n");
    }
    store += &format!(
        "        state->oldest = ((state->oldest + 1u) == {upper}_LINE) ? 0u : (state->oldest + \
         1u);\n"
    );
    let sticks: String = diagram
        .outputs
        .iter()
        .enumerate()
        .map(|(j, w)| {
            format!("    state->sticks[{j}] = {};\n", code::operand(&diagram, &language, *w))
        })
        .collect();
    let blend = diagram.only(&["turn_blend"]);
    let chosen = |w: crate::law::Wire| !matches!(blend.block(w).kind, Kind::Input);
    let turn_blend = code::lines(&blend, &language, &form("    "), &chosen);
    let warnings: Vec<String> = d.warnings.iter().map(|w| format!("WARNING: {w}")).collect();
    let values: Vec<(&str, String)> = vec![
        ("BLOCKS", blocks),
        ("ENGAGING", engaging),
        ("HOLD", hold),
        ("STORE", store),
        ("STICKS", sticks),
        ("RESET_LINES", reset_lines),
        ("RESET", reset),
        ("MEMBERS", members),
        ("TURN_BLEND", turn_blend),
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
        ("NL", code::line_steps(&diagram).to_string()),
        ("ZERO", real(0.0)),
        ("ONE", real(1.0)),
        ("U", upper.clone()),
        ("P", o.name.clone()),
    ];
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    (fill(HEADER, &values), fill(SOURCE, &values))
}

/// A line put behind the one that begins so.
pub(super) fn after_line(text: &str, begin: &str, more: &str) -> String {
    let mut out = String::new();
    let mut inside = false;
    for line in text.lines() {
        out += line;
        out.push('\n');
        inside |= line.trim_start().starts_with(begin);
        if inside && line.ends_with(';') {
            out += more;
            inside = false;
        }
    }
    out
}

fn member(diagram: &Diagram, prefix: &str, name: &str, size: &str) -> String {
    let block = diagram.find(name).map(|w| diagram.block(w));
    let (unit, meaning) = block.map_or(("", ""), |b| (b.unit, b.comment.as_str()));
    format!("    {prefix}_real {name}{size}; /* {unit}, {meaning} */\n")
}
