//! The tables as JSON, with a reader in pure Python that also runs the law and
//! makes linear models of it for python-control.

use super::code::{self, Form, Language};
use super::text::{Flat, comment, fill, number};
use super::{File, Input, Precision, delay_steps, json};
use crate::law::diagram::Function;
use crate::law::{Kind, Wire};

const READER: &str = include_str!("templates/law.py.in");

struct Python;

impl Language for Python {
    fn number(&self, value: f64) -> String {
        number(value, Precision::Double)
    }
    fn constant(&self, name: &str) -> String {
        if name == "step" { "self.interval".into() } else { format!("c[\"{name}\"]") }
    }
    fn entry(&self, place: usize) -> String {
        let (table, _, _, k) = code::cell(place);
        format!("p_[{} + {k}]", table.to_uppercase())
    }
    fn input(&self, name: &str) -> String {
        match name {
            "u" => "m[\"velocity_body\"][0]".into(),
            "v" => "m[\"velocity_body\"][1]".into(),
            "w" => "m[\"velocity_body\"][2]".into(),
            "p" => "m[\"rates\"][0]".into(),
            "q" => "m[\"rates\"][1]".into(),
            "r" => "m[\"rates\"][2]".into(),
            "phi" => "m[\"roll\"]".into(),
            "theta" => "m[\"pitch\"]".into(),
            "airspeed" => "m[\"airspeed\"]".into(),
            "velocity_mode" => "demand[\"mode\"] == VELOCITY".into(),
            "command_1" => "demand[\"horizontal\"][0]".into(),
            "command_2" => "demand[\"horizontal\"][1]".into(),
            "v_z_command" => "demand[\"vertical_velocity\"]".into(),
            other => format!("demand[\"{other}\"]"),
        }
    }
    fn function(&self, f: Function, x: &str) -> String {
        match f {
            Function::Sine => format!("math.sin({x})"),
            Function::Cosine => format!("math.cos({x})"),
            Function::ArcTangent => format!("math.atan({x})"),
            Function::Absolute => format!("abs({x})"),
        }
    }
    fn select(&self, condition: &str, yes: &str, no: &str) -> String {
        format!("{yes} if {condition} else {no}")
    }
    fn limit(&self, x: &str, low: &str, high: &str) -> String {
        format!("_held({x}, {low}, {high})")
    }
    fn above(&self, a: &str, b: &str) -> String {
        format!("{a} > {b}")
    }
    fn join(&self, all: bool, list: &[String]) -> String {
        list.join(if all { " and " } else { " or " })
    }
    fn not(&self, x: &str) -> String {
        format!("not {x}")
    }
    fn stored(&self, name: &str) -> String {
        format!("memory[\"{name}\"]")
    }
    fn delayed(&self, name: &str) -> String {
        format!("lines[\"{name}\"][0]")
    }
    fn before(&self, block: &str, kind: &Kind, operands: &[String]) -> Option<String> {
        matches!(kind, Kind::Delay { .. }).then(|| {
            format!(
                "if {}:\n    lines[\"{block}\"] = [{}] * max(self.delay, 1)",
                operands[0], operands[1]
            )
        })
    }
    fn part(&self, name: &str, index: usize) -> String {
        format!("{name}[{index}]")
    }
}

/// Takes off brackets that only a line that goes on needs.
fn without_brackets(text: &str) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let plain = line
            .split_once(" = (")
            .and_then(|(name, rest)| Some((name, rest.strip_suffix(')')?)))
            .filter(|(_, rest)| {
                // Still balanced without them.
                let mut depth = 0i32;
                rest.chars().all(|c| {
                    depth += match c {
                        '(' => 1,
                        ')' => -1,
                        _ => 0,
                    };
                    depth >= 0
                }) && depth == 0
            });
        match plain {
            Some((name, rest)) => out += &format!("{name} = {rest}\n"),
            None => out += &format!("{line}\n"),
        }
    }
    out
}

/// Tables and reader.
pub(super) fn files(input: &Input) -> Vec<File> {
    let name = &input.options.name;
    // The banner stands in a docstring.
    let banner = comment(&input.description.banner(), "", 96);
    let diagram = super::diagram(input, false);
    let define = |name: &str, _: bool| format!("{name} = (");
    let form = Form { indent: "        ", comment: ["# ", ""], define: &define, end: ")" };
    let blocks = without_brackets(&code::lines(&diagram, &Python, &form, &|_| true));
    let looked_up = "        p_ = self.law.row_at(schedule)\n";
    let mut with_tables = String::new();
    for line in blocks.lines() {
        with_tables += &format!("{line}\n");
        if line.trim_start().starts_with("schedule = ") {
            with_tables += looked_up;
        }
    }
    let blend = diagram.only(&["turn_blend"]);
    let computed = |w: Wire| !matches!(blend.block(w).kind, Kind::Input);
    let turn_blend = without_brackets(&code::lines(&blend, &Python, &form, &computed));
    let quoted = |list: Vec<String>| {
        list.iter().map(|n| format!("\n            \"{n}\",")).collect::<String>() + "\n        "
    };
    let stores = code::stores(&diagram, &Python);
    let feeds = code::feeds(&diagram, &Python);
    let pairs = |list: Vec<(&String, &String)>| -> String {
        list.iter().map(|(k, v)| format!("            \"{k}\": {v},\n")).collect()
    };
    let sticks: Vec<String> =
        diagram.outputs.iter().map(|w| code::operand(&diagram, &Python, *w)).collect();
    let truth = |yes: bool| if yes { "True" } else { "False" };
    let flat = Flat::new(input);
    let places: String =
        flat.places.iter().map(|p| format!("{} = {}\n", p.name.to_uppercase(), p.offset)).collect();
    let shapes: String = flat
        .places
        .iter()
        .map(|p| format!("    \"{}\": ({}, {}),\n", p.name, p.rows, p.columns))
        .collect();
    let reader = fill(
        READER,
        &[
            ("PLACES", &places),
            ("SHAPES", &shapes),
            ("BLOCKS", &with_tables),
            ("TURN_BLEND", &turn_blend),
            ("STICKS", &sticks.join(", ")),
            ("AFTER", &pairs(stores.iter().map(|s| (&s[0], &s[1])).collect())),
            ("HELD", &pairs(stores.iter().map(|s| (&s[0], &s[2])).collect())),
            ("ENTERING", &pairs(feeds.iter().map(|f| (&f[0], &f[1])).collect())),
            ("MEMORIES", &quoted(stores.iter().map(|s| s[0].clone()).collect())),
            ("LINES", &quoted(feeds.iter().map(|f| f[0].clone()).collect())),
            ("HYBRID", truth(input.schedule.law.hybrid_feedforward)),
            ("DELAYED", truth(delay_steps(input) > 0)),
            ("BANNER", &banner),
            ("P", name),
        ],
    );
    vec![
        File::text(format!("{name}.json"), json(input.description)),
        File::text(format!("{name}_law.py"), reader),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_go_where_a_line_does_not_go_on() {
        let text = "a = ((b * c) + d)\ne = (f(\ng))\nh = ((x) + (y))\nk = (f(x))\n";
        let plain = "a = (b * c) + d\ne = (f(\ng))\nh = (x) + (y)\nk = f(x)\n";
        assert_eq!(without_brackets(text), plain);
    }
}
