//! A TOML text as a tree that remembers where everything stands.

use std::collections::HashMap;

use toml::de::{DeTable, DeValue};

use super::keys::Level;
use super::report::{Diagnostic, Severity};
use super::source::{Place, Sources};

/// A value and its place.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    pub value: Value,
    pub place: Place,
}

/// A TOML value. Tables keep the order of the file.
#[derive(Debug, Clone)]
pub(crate) enum Value {
    Text(String),
    Integer(i64),
    Float(f64),
    Bool(bool),
    Datetime,
    Array(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key of a table, with its value.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub name: String,
    pub place: Place,
    pub node: Node,
}

impl Value {
    /// What a person calls a value of this type.
    pub fn noun(&self) -> &'static str {
        match self {
            Value::Text(_) => "a text",
            Value::Integer(_) => "a whole number",
            Value::Float(_) => "a number",
            Value::Bool(_) => "true or false",
            Value::Datetime => "a date or time",
            Value::Array(_) => "a list",
            Value::Table(_) => "a table",
        }
    }
}

/// Reads a source; syntax errors go to `findings`, and the rest is kept.
pub(crate) fn parse(sources: &Sources, source: usize, findings: &mut Vec<Diagnostic>) -> Node {
    let text = &sources.files()[source].text;
    let (table, errors) = DeTable::parse_recoverable(text);
    for error in errors {
        let place = Place { source, span: error.span().unwrap_or(0..0) };
        findings.push(Diagnostic::at(
            Severity::Error,
            sources,
            &place,
            "",
            format!("not valid TOML: {}", error.message().replace('\n', "; ")),
            syntax_help(error.message()).into(),
        ));
    }
    Node {
        place: Place { source, span: 0..0 },
        value: Value::Table(entries(table.get_ref(), source)),
    }
}

/// The right form for the commonest slips.
fn syntax_help(message: &str) -> &'static str {
    if message.contains("duplicate key") {
        "each key and each heading stands once, such as one `radius = \"10.66 ft\"` under one \
         `[rotors.upper]`"
    } else if message.contains("must be quoted") {
        "texts and quantities stand in quotes, such as `radius = \"10.66 ft\"`"
    } else {
        "a line is `key = value`, such as `radius = \"10.66 ft\"`, or a heading, such as \
         `[rotors.upper]`"
    }
}

/// Reads one value, for defaults, which are written as TOML.
pub(crate) fn parse_value(text: &str, source: usize) -> Option<Node> {
    let value = DeValue::parse(text).ok()?;
    Some(node(value.get_ref(), value.span(), source))
}

fn entries(table: &DeTable<'_>, source: usize) -> Vec<Entry> {
    let mut entries: Vec<Entry> = table
        .iter()
        .map(|(key, value)| Entry {
            name: key.get_ref().to_string(),
            place: Place { source, span: key.span() },
            node: node(value.get_ref(), value.span(), source),
        })
        .collect();
    // The parser keeps tables sorted by name; the order of the file says
    // which rotor comes first.
    entries.sort_by_key(|entry| entry.place.span.start);
    entries
}

fn node(value: &DeValue<'_>, span: std::ops::Range<usize>, source: usize) -> Node {
    let value = match value {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(integer) => {
            match i64::from_str_radix(integer.as_str(), integer.radix()) {
                Ok(integer) => Value::Integer(integer),
                // Beyond 64 bits: kept as a number, for the bounds to refuse.
                Err(_) => Value::Float(integer.as_str().parse().unwrap_or(f64::INFINITY)),
            }
        }
        DeValue::Float(float) => Value::Float(float.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(value) => Value::Bool(*value),
        DeValue::Datetime(_) => Value::Datetime,
        DeValue::Array(items) => Value::Array(
            items.iter().map(|item| node(item.get_ref(), item.span(), source)).collect(),
        ),
        DeValue::Table(table) => Value::Table(entries(table, source)),
    };
    Node { value, place: Place { source, span } }
}

/// Lays an extending table over its base: tables merge key by key, everything
/// else replaces. Where the keys offer alternatives, choosing another one
/// drops what the base had chosen.
pub(crate) fn merge(base: &mut Vec<Entry>, over: Vec<Entry>, level: Option<Level>) {
    if let Some(Level::Keys(table)) = level {
        let holds = |group: &&&[&str], name: &str| group.contains(&name);
        let chosen: Vec<_> = table
            .alternatives
            .iter()
            .filter(|group| over.iter().any(|entry| holds(group, &entry.name)))
            .collect();
        if !chosen.is_empty() {
            base.retain(|entry| {
                let offered = table.alternatives.iter().any(|g| holds(&g, &entry.name));
                !offered || chosen.iter().any(|group| holds(group, &entry.name))
            });
        }
    }
    let places: HashMap<String, usize> =
        base.iter().enumerate().map(|(at, entry)| (entry.name.clone(), at)).collect();
    for entry in over {
        // A table holds a key once, so that nothing pushed here is met again.
        let Some(old) = places.get(&entry.name).map(|at| &mut base[*at]) else {
            base.push(entry);
            continue;
        };
        old.place = entry.place;
        match (&mut old.node.value, entry.node.value) {
            (Value::Table(base), Value::Table(over)) => {
                let below = level.and_then(|level| level.below(&entry.name));
                merge(base, over, below);
            }
            (old_value, value) => {
                *old_value = value;
                old.node.place = entry.node.place;
            }
        }
    }
}
