//! Parts that schemas are made of.

use serde_json::{Map, Value as Json, json};

/// A key and the schema of its value.
pub(super) type Entry<'a> = (&'a str, Json);

/// An object with all of `required`, perhaps some of `optional`, and no other
/// key.
pub(super) fn object(doc: &str, required: &[Entry<'_>], optional: &[Entry<'_>]) -> Json {
    let properties: Map<String, Json> =
        required.iter().chain(optional).map(|(k, v)| ((*k).to_string(), v.clone())).collect();
    let names: Vec<&str> = required.iter().map(|entry| entry.0).collect();
    json!({
        "type": "object",
        "description": doc,
        "properties": properties,
        "required": names,
        "additionalProperties": false,
    })
}

/// An object whose keys are names, such as those of rotors.
pub(super) fn named(doc: &str, value: Json) -> Json {
    json!({ "type": "object", "description": doc, "additionalProperties": value })
}

/// A document of schema `coaxdesign.NAME/VERSION`.
pub(super) fn document(
    schema: &str,
    doc: &str,
    required: &[Entry<'_>],
    optional: &[Entry<'_>],
) -> Json {
    let all: Vec<Entry<'_>> =
        std::iter::once(("schema", constant(schema))).chain(required.iter().cloned()).collect();
    object(doc, &all, optional)
}

pub(super) fn constant(value: &str) -> Json {
    json!({ "const": value })
}

pub(super) fn words(doc: &str, words: &[&str]) -> Json {
    json!({ "enum": words, "description": doc })
}

pub(super) fn number(doc: &str) -> Json {
    json!({ "type": "number", "description": doc })
}

pub(super) fn positive(doc: &str) -> Json {
    json!({ "type": "number", "minimum": 0, "description": doc })
}

pub(super) fn count(doc: &str) -> Json {
    json!({ "type": "integer", "minimum": 0, "description": doc })
}

pub(super) fn text(doc: &str) -> Json {
    json!({ "type": "string", "description": doc })
}

pub(super) fn truth(doc: &str) -> Json {
    json!({ "type": "boolean", "description": doc })
}

/// An FNV-1a hash.
pub(super) fn hash(doc: &str) -> Json {
    json!({ "type": "string", "pattern": "^[0-9a-f]{16}$", "description": doc })
}

/// The same, or null.
pub(super) fn or_null(schema: Json) -> Json {
    let mut schema = schema;
    match schema.get("type").and_then(Json::as_str).map(str::to_string) {
        Some(kind) => {
            schema["type"] = json!([kind, "null"]);
            schema
        }
        None => json!({ "anyOf": [schema, { "type": "null" }] }),
    }
}

pub(super) fn list(doc: &str, items: Json) -> Json {
    json!({ "type": "array", "description": doc, "items": items })
}

pub(super) fn numbers(doc: &str) -> Json {
    list(doc, json!({ "type": "number" }))
}

/// A list of so many numbers.
pub(super) fn vector(length: usize, doc: &str) -> Json {
    let mut schema = numbers(doc);
    schema["minItems"] = json!(length);
    schema["maxItems"] = json!(length);
    schema
}

pub(super) fn texts(doc: &str) -> Json {
    list(doc, json!({ "type": "string" }))
}
