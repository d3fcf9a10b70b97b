//! The problem format as a JSON Schema, for editors and other tools.
//!
//! It describes the TOML file as the JSON value of the same shape. Units are
//! checked as far as a pattern can: a number, then something that is not one.

use serde_json::{Map, Value as Json, json};

use super::keys::{Bounds, Key, Need, ROOT, Table, Value};
use super::read::words;
use super::text::{LONGEST_LINE, LONGEST_NAME};
use crate::units::Kind;

/// A number and a unit.
const QUANTITY: &str =
    "^\\s*[+\\-\u{2212}]?(\\d+\\.?\\d*|\\.\\d+)([eE][+\\-]?\\d+)?\\s*([^\\d\\s.].*|1\\s*/.*)$";

/// Writes the JSON Schema (draft 2020-12) of problem files.
///
/// A file that extends another need not be complete by itself, so that the
/// schema holds two forms and `extends` chooses between them.
pub fn json_schema() -> Json {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "coaxdesign problem file",
        "description": ROOT.doc,
        "if": { "required": ["extends"] },
        "then": { "$ref": "#/$defs/extending" },
        "else": { "$ref": "#/$defs/complete" },
        "$defs": {
            "complete": table(&ROOT, true),
            "extending": table(&ROOT, false),
        },
    })
}

/// Writes the JSON Schema (draft 2020-12) of files that are read by a table of
/// keys and stand alone: specifications and manoeuvres.
pub fn json_schema_of(title: &str, root: &Table) -> Json {
    let mut schema = table(root, true);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!(title);
    schema
}

fn table(table: &Table, complete: bool) -> Json {
    let mut properties = Map::new();
    for key in table.keys {
        properties.insert(key.name.into(), key_schema(key, complete));
    }
    let mut schema = json!({
        "type": "object",
        "description": table.doc,
        "properties": properties,
        "additionalProperties": false,
    });
    let required = |keys: &[&Key]| -> Vec<&'static str> {
        keys.iter().filter(|key| key.need == Need::Required).map(|key| key.name).collect()
    };
    if complete {
        let plain: Vec<&Key> = table
            .keys
            .iter()
            .filter(|key| !table.alternatives.iter().any(|group| group.contains(&key.name)))
            .collect();
        schema["required"] = json!(required(&plain));
    }
    if !table.alternatives.is_empty() {
        let any_of = |group: &[&str]| -> Json {
            let each: Vec<Json> = group.iter().map(|name| json!({ "required": [name] })).collect();
            json!({ "anyOf": each })
        };
        let groups: Vec<Json> = table
            .alternatives
            .iter()
            .map(|group| {
                let keys: Vec<&Key> = group.iter().filter_map(|name| table.key(name)).collect();
                let others: Vec<Json> = table
                    .alternatives
                    .iter()
                    .filter(|other| other != &group)
                    .map(|other| any_of(other))
                    .collect();
                let mut schema = any_of(group);
                schema["not"] = json!({ "anyOf": others });
                if complete {
                    schema["required"] = json!(required(&keys));
                }
                schema
            })
            .collect();
        let all: Vec<&str> = table.alternatives.concat();
        if complete {
            schema["oneOf"] = json!(groups);
        } else {
            // An extending table may leave the choice to its base.
            let mut none = groups.clone();
            none.push(json!({ "not": any_of(&all) }));
            schema["oneOf"] = json!(none);
        }
    }
    schema
}

fn key_schema(key: &Key, complete: bool) -> Json {
    let mut schema = value(&key.value, complete);
    let mut text = key.doc.to_string();
    if let Some(note) = note(&key.value) {
        text += &format!(" {note}");
    }
    schema["description"] = json!(text);
    if let Need::Default(default) = key.need
        && let Ok(toml::Value::Table(parsed)) =
            format!("v = {default}").parse::<toml::Table>().map(toml::Value::Table)
        && let Ok(default) = serde_json::to_value(&parsed["v"])
    {
        schema["default"] = default;
    }
    schema
}

/// Bounds in words, where a value has some.
pub(super) fn note(value: &Value) -> Option<String> {
    let bounds = match value {
        Value::Number(bounds)
        | Value::Quantity(_, bounds)
        | Value::Numbers(_, bounds)
        | Value::Quantities(_, _, bounds)
        | Value::Limits(_, bounds)
        | Value::Spanwise(_, bounds)
        | Value::SpanwiseFromZero(_, bounds) => bounds,
        _ => return None,
    };
    let words = words(bounds);
    let mut chars = words.chars();
    let first = chars.next()?.to_uppercase();
    Some(format!("{first}{}.", chars.as_str()))
}

fn quantity(kind: Kind) -> Json {
    let examples: Vec<String> =
        kind.usual_units().iter().map(|unit| format!("10 {unit}")).collect();
    json!({ "type": "string", "pattern": QUANTITY, "examples": examples })
}

fn number(bounds: &Bounds) -> Json {
    let mut schema = json!({ "type": "number" });
    let mut bound = |bound: Option<(&str, bool)>, inclusive: &str, exclusive: &str| {
        if let Some((text, included)) = bound
            && let Ok(limit) = text.parse::<f64>()
        {
            schema[if included { inclusive } else { exclusive }] = json!(limit);
        }
    };
    bound(bounds.low, "minimum", "exclusiveMinimum");
    bound(bounds.high, "maximum", "exclusiveMaximum");
    schema
}

fn list(item: Json, count: usize) -> Json {
    json!({ "type": "array", "items": item, "minItems": count, "maxItems": count })
}

fn value(value: &Value, complete: bool) -> Json {
    match value {
        Value::Text => json!({ "type": "string", "minLength": 1, "maxLength": LONGEST_LINE }),
        Value::Name => json!({
            "type": "string",
            "pattern": "^[A-Za-z0-9 ._-]*[A-Za-z0-9][A-Za-z0-9 ._-]*$",
            "maxLength": LONGEST_NAME
        }),
        Value::Path => json!({ "type": "string", "minLength": 1 }),
        Value::Bool => json!({ "type": "boolean" }),
        Value::Count(low, high) => {
            json!({ "type": "integer", "minimum": low, "maximum": high })
        }
        Value::Number(bounds) => number(bounds),
        Value::Quantity(kind, _) => quantity(*kind),
        Value::Numbers(0, bounds) => {
            json!({ "type": "array", "items": number(bounds), "minItems": 1 })
        }
        Value::Numbers(count, bounds) => list(number(bounds), *count),
        Value::Quantities(0, kind, _) => {
            json!({ "type": "array", "items": quantity(*kind), "minItems": 1 })
        }
        Value::Quantities(count, kind, _) => list(quantity(*kind), *count),
        Value::Limits(kind, _) => list(quantity(*kind), 2),
        Value::Choice(choices) => {
            let each: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            json!({ "enum": each })
        }
        Value::Spanwise(kind, _) | Value::SpanwiseFromZero(kind, _) => {
            let mut along = json!({
                "type": "object",
                "properties": {
                    "station": {
                        "type": "array",
                        "items": { "type": "number", "minimum": 0, "maximum": 1 },
                        "minItems": 1,
                        "description": "Stations as fractions of the span, strictly increasing.",
                    },
                    "value": {
                        "type": "array",
                        "items": quantity(*kind),
                        "minItems": 1,
                        "description": "One value a station.",
                    },
                },
                "additionalProperties": false,
            });
            if complete {
                along["required"] = json!(["station", "value"]);
            }
            json!({ "anyOf": [quantity(*kind), along] })
        }
        Value::Table(inner) => table(inner, complete),
        Value::Named(inner, _) => {
            json!({
                "type": "object",
                "propertyNames": { "pattern": "^[A-Za-z][A-Za-z0-9_]*$" },
                "additionalProperties": table(inner, complete),
            })
        }
    }
}
