//! Blocks of the law as text of a programming language.
//!
//! Every block is one named line under its comment, in the order of the
//! diagram. What differs between languages is a [`Language`]; what a block
//! computes is written here once for all of them.

use super::text::comment;
use crate::law::diagram::{Function, Store, Term};
use crate::law::{Diagram, Kind, Wire, tables};

/// How a language writes what blocks compute.
pub trait Language {
    /// A number.
    fn number(&self, value: f64) -> String;
    /// A constant by its name.
    fn constant(&self, name: &str) -> String;
    /// An entry of the tables at the speed of the schedule.
    fn entry(&self, place: usize) -> String;
    /// An input by its name; `None` where it is a line of its own.
    fn input(&self, name: &str) -> String;
    /// A function of a number.
    fn function(&self, f: Function, x: &str) -> String;
    /// One of two numbers.
    fn select(&self, condition: &str, yes: &str, no: &str) -> String;
    /// A number held between limits.
    fn limit(&self, x: &str, low: &str, high: &str) -> String;
    /// Whether the first is larger.
    fn above(&self, a: &str, b: &str) -> String;
    /// Whether all hold, or any.
    fn join(&self, all: bool, list: &[String]) -> String;
    /// Whether it does not hold.
    fn not(&self, x: &str) -> String;
    /// A comparison as a logical number.
    fn logical(&self, comparison: &str) -> String {
        comparison.into()
    }
    /// What a memory stores.
    fn stored(&self, name: &str) -> String;
    /// What a delay line gives, after filling it where it starts anew.
    fn delayed(&self, name: &str) -> String;
    /// A line before the block, where one is needed.
    fn before(&self, _block: &str, _kind: &Kind, _operands: &[String]) -> Option<String> {
        None
    }
    /// A number of a solution.
    fn part(&self, name: &str, index: usize) -> String;
}

/// Written widest line.
const WIDTH: usize = 96;

/// The operand that a wire is to others.
pub fn operand(d: &Diagram, language: &dyn Language, wire: Wire) -> String {
    let block = d.block(wire);
    match block.kind {
        Kind::Constant(value) if block.name.is_empty() => language.number(value),
        Kind::Constant(_) => language.constant(&block.name),
        Kind::Entry(place) => language.entry(place),
        _ => block.name.clone(),
    }
}

fn product(d: &Diagram, language: &dyn Language, term: &Term) -> String {
    let factors: Vec<String> = term.factors.iter().map(|w| operand(d, language, *w)).collect();
    if factors.len() == 1 { factors[0].clone() } else { format!("({})", factors.join(" * ")) }
}

/// What a block computes, as an expression.
pub fn expression(d: &Diagram, language: &dyn Language, wire: Wire) -> String {
    let block = d.block(wire);
    let name = &block.name;
    let o = |w: &Wire| operand(d, language, *w);
    match &block.kind {
        Kind::Input | Kind::Switch => language.input(name),
        Kind::Constant(_) | Kind::Entry(_) => operand(d, language, wire),
        // One product alone needs no brackets.
        Kind::Sum(terms) if terms.len() == 1 && !terms[0].negative => {
            terms[0].factors.iter().map(o).collect::<Vec<_>>().join(" * ")
        }
        Kind::Sum(terms) => {
            let mut text = String::new();
            for (k, t) in terms.iter().enumerate() {
                let sign = match (k, t.negative) {
                    (0, false) => "",
                    (0, true) => "-",
                    (_, false) => " + ",
                    (_, true) => " - ",
                };
                text += sign;
                text += &product(d, language, t);
            }
            text
        }
        Kind::Quotient(a, b) => format!("{} / {}", o(a), o(b)),
        Kind::Function(f, x) => language.function(*f, &o(x)),
        Kind::Maximum(a, b) => {
            let (a, b) = (o(a), o(b));
            language.select(&format!("({})", language.above(&a, &b)), &a, &b)
        }
        Kind::Limit { input, low, high } => language.limit(&o(input), &o(low), &o(high)),
        Kind::Above(a, b) => language.logical(&language.above(&o(a), &o(b))),
        Kind::All(list) | Kind::Any(list) => {
            let all = matches!(block.kind, Kind::All(_));
            language.logical(&language.join(all, &list.iter().map(o).collect::<Vec<_>>()))
        }
        Kind::Not(x) => language.logical(&language.not(&o(x))),
        Kind::Select { condition, yes, no } => language.select(&o(condition), &o(yes), &o(no)),
        Kind::Blend { weight, off, on } => {
            let w = o(weight);
            format!("(({} - {w}) * {}) + ({w} * {})", language.number(1.0), o(off), o(on))
        }
        Kind::Memory { restart } => {
            let stored = language.stored(name);
            match restart {
                Some((when, at)) => language.select(&o(when), &o(at), &stored),
                None => stored,
            }
        }
        Kind::Delay { .. } => language.delayed(name),
        Kind::Solve { .. } => String::new(),
        Kind::Part { of, index } => language.part(&d.block(*of).name, *index),
    }
}

/// Breaks a long expression before its operators, outside of brackets.
pub fn wrapped(start: &str, text: &str, indent: &str) -> String {
    let whole = format!("{start}{text}");
    if whole.len() <= WIDTH {
        return whole;
    }
    let mut out = start.to_string();
    let mut line = start.len();
    let mut depth = 0usize;
    let mut piece = String::new();
    let mut pieces = Vec::new();
    let characters: Vec<char> = text.chars().collect();
    for (k, c) in characters.iter().enumerate() {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let operator = depth == 0
            && *c == ' '
            && matches!(characters.get(k + 1), Some('+' | '-' | '?' | ':'))
            && characters.get(k + 2) == Some(&' ');
        if operator {
            pieces.push(std::mem::take(&mut piece));
        } else {
            piece.push(*c);
        }
    }
    pieces.push(piece);
    for (k, piece) in pieces.iter().enumerate() {
        if k > 0 && line + 1 + piece.len() > WIDTH - 2 {
            out += &format!("\n{indent}    {piece}");
            line = indent.len() + 4 + piece.len();
        } else {
            if k > 0 {
                out.push(' ');
                line += 1;
            }
            out += piece;
            line += piece.len();
        }
    }
    out
}

/// How lines stand in a language.
pub struct Form<'a> {
    /// What stands before every line.
    pub indent: &'a str,
    /// What opens and closes a comment.
    pub comment: [&'a str; 2],
    /// A line that names a number: from its name and whether it is logical.
    pub define: &'a dyn Fn(&str, bool) -> String,
    /// What ends a line.
    pub end: &'a str,
}

/// The lines of the chosen blocks, with a heading for every group.
pub fn lines(
    d: &Diagram,
    language: &dyn Language,
    form: &Form,
    chosen: &dyn Fn(Wire) -> bool,
) -> String {
    let Form { indent, comment: [open, close], .. } = form;
    let mut out = String::new();
    let mut group = usize::MAX;
    for (k, block) in d.blocks.iter().enumerate() {
        let wire = Wire(k);
        if matches!(block.kind, Kind::Constant(_) | Kind::Entry(_)) || !chosen(wire) {
            continue;
        }
        if block.group != group {
            group = block.group;
            let g = &d.groups[group];
            let text = [format!("{}.", g.title), g.text.clone()];
            out.push('\n');
            if close.is_empty() {
                out += &comment(&text, &format!("{indent}{open}"), WIDTH);
            } else {
                // A comment of several lines.
                out += &format!("{indent}/*\n");
                out += &comment(&text, &format!("{indent} * "), WIDTH);
                out += &format!("{indent} */\n");
            }
        }
        let unit = if block.unit == "1" { String::new() } else { format!(", {}", block.unit) };
        out += &format!("{indent}{open}{}{unit}{close}\n", block.comment);
        let operands: Vec<String> =
            block.kind.reads().iter().map(|w| operand(d, language, *w)).collect();
        if let Some(line) = language.before(&block.name, &block.kind, &operands) {
            for line in line.lines() {
                out += &format!("{indent}{line}\n");
            }
        }
        if matches!(block.kind, Kind::Solve { .. }) {
            continue;
        }
        let start = format!("{indent}{}", (form.define)(&block.name, block.kind.is_logical()));
        out += &wrapped(&start, &expression(d, language, wire), indent);
        out += &format!("{}\n", form.end);
    }
    out
}

/// Table, row and column of a place, as indices.
pub fn cell(place: usize) -> (&'static str, usize, usize, usize) {
    tables::entry(place).map_or(("", 0, 0, 0), |(form, i, j)| {
        let columns = form.size().1;
        (form.name, i, j, i * columns + j)
    })
}

/// What each memory takes at the end of an ordinary step and when the law is
/// engaged: name of the memory and operands.
pub fn stores(d: &Diagram, language: &dyn Language) -> Vec<[String; 3]> {
    d.stores
        .iter()
        .map(|s: &Store| {
            let restarts = matches!(d.block(s.memory).kind, Kind::Memory { restart: Some(_) });
            let otherwise = if restarts { s.memory } else { s.next };
            let o = |w: Wire| operand(d, language, w);
            [d.block(s.memory).name.clone(), o(s.next), o(s.engaged.unwrap_or(otherwise))]
        })
        .collect()
}

/// Delay lines: name, operand that enters, unit and comment.
pub fn feeds(d: &Diagram, language: &dyn Language) -> Vec<[String; 2]> {
    d.feeds.iter().map(|f| [d.block(f.line).name.clone(), operand(d, language, f.input)]).collect()
}

/// Named constants of a diagram: name, unit, comment and value.
pub fn constants(d: &Diagram) -> impl Iterator<Item = (&str, &str, &str, f64)> {
    d.blocks.iter().filter_map(|b| match b.kind {
        Kind::Constant(value) if !b.name.is_empty() => {
            Some((b.name.as_str(), b.unit, b.comment.as_str(), value))
        }
        _ => None,
    })
}

/// Steps of the longest delay line, at least 1.
pub fn line_steps(d: &Diagram) -> usize {
    d.blocks
        .iter()
        .map(|b| if let Kind::Delay { steps, .. } = b.kind { steps } else { 1 })
        .max()
        .unwrap_or(1)
}
