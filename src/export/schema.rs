//! JSON Schemas of the schedule file and of the JSON export.

use serde_json::{Map, Value, json};

use super::description::{self, FORMS};
use crate::control::axis::Channel;
use crate::schedule;

const DRAFT: &str = "https://json-schema.org/draft/2020-12/schema";

/// An object that has all of these keys and no others.
fn object(description: &str, keys: &[(&str, Value)]) -> Value {
    let properties: Map<String, Value> =
        keys.iter().map(|(k, v)| ((*k).to_string(), v.clone())).collect();
    let required: Vec<&str> = keys.iter().map(|k| k.0).collect();
    json!({
        "type": "object",
        "description": description,
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn number(description: &str) -> Value {
    json!({ "type": "number", "description": description })
}

fn positive(description: &str) -> Value {
    json!({ "type": "number", "exclusiveMinimum": 0, "description": description })
}

fn text(description: &str) -> Value {
    json!({ "type": "string", "description": description })
}

/// A list of exactly so many numbers.
fn numbers(count: usize, description: &str) -> Value {
    json!({
        "type": "array",
        "description": description,
        "items": { "type": "number" },
        "minItems": count,
        "maxItems": count,
    })
}

fn matrix(rows: usize, columns: usize, description: &str) -> Value {
    json!({
        "type": "array",
        "description": description,
        "items": numbers(columns, "a row"),
        "minItems": rows,
        "maxItems": rows,
    })
}

fn provenance() -> Value {
    let hash = json!({ "type": "string", "pattern": "^[0-9a-f]{16}$" });
    object(
        "Where it came from.",
        &[
            ("generator", text("program and version")),
            ("problem_hash", hash.clone()),
            ("specification_hash", hash),
        ],
    )
}

/// The schema of `schedule.json`.
pub fn schedule_schema() -> Value {
    let gains = object(
        "Gains of a channel. Roll, pitch: 1/s, 1/s^2, 1/s^3; others: k_d 0, 1/s, 1/s^2.",
        &[
            ("k_d", number("on the error's rate")),
            ("k_p", number("on the error")),
            ("k_i", number("on the error's integral")),
        ],
    );
    let channels: Map<String, Value> =
        Channel::ALL.iter().map(|c| (c.name().to_string(), gains.clone())).collect();
    let matrix_of = |name: &'static str| {
        let form = FORMS.iter().find(|f| f.name == name);
        let (rows, columns) = form.map_or((0, 0), description::Form::size);
        (name, matrix(rows, columns, form.map_or("", description::Form::meaning)))
    };
    let matrices = object(
        "Matrices, each as a list of rows.",
        &[
            matrix_of("outputs"),
            matrix_of("output_rates"),
            matrix_of("feedback"),
            matrix_of("decoupling"),
            matrix_of("allocation"),
            matrix_of("ground_velocity"),
            matrix_of("reference_state"),
            matrix_of("reference_input"),
            matrix_of("reference_dynamics"),
            matrix_of("reference_drive"),
        ],
    );
    let trim = object(
        "The trim.",
        &[
            ("velocity_body", numbers(3, "u, v, w, m/s")),
            ("roll", number("bank angle, rad")),
            ("pitch", number("pitch angle, rad")),
            ("sticks", numbers(4, "lat, lon, col, ped, %")),
        ],
    );
    let point = object(
        "The law at one breakpoint.",
        &[
            ("speed", number("true airspeed, m/s; strictly increasing from point to point")),
            (
                "gains",
                json!({
                    "type": "object",
                    "description": "Gains by channel; a channel that is open is left out.",
                    "properties": channels,
                    "additionalProperties": false,
                }),
            ),
            ("trim", trim),
            ("matrices", matrices),
        ],
    );
    let law = object(
        "Choices of the law that are not gains.",
        &[
            ("kappa", number("share of the velocity terms of F that feedback cancels")),
            ("hybrid_feedforward", json!({ "type": "boolean" })),
            ("reference_delay", json!({ "type": "number", "minimum": 0, "description": "s" })),
            ("roll_frequency", positive("rad/s")),
            ("pitch_frequency", positive("rad/s")),
            ("attitude_damping", positive("1")),
            ("yaw_time_constant", positive("s")),
            ("heave_time_constant", positive("s")),
        ],
    );
    let notch = object(
        "A notch filter on what feedback asks for.",
        &[
            ("frequency", positive("rad/s")),
            ("damping", positive("1")),
            ("depth", number("factor with which the frequency passes")),
        ],
    );
    let mut law = law;
    // Only where an axis has one.
    law["properties"]["notch"] = json!({
        "type": "object",
        "description": "Notch filters by axis.",
        "properties": { "roll": notch, "pitch": notch, "yaw": notch, "heave": notch },
        "additionalProperties": false,
    });
    let hardware = object(
        "Hardware that it was tuned for.",
        &[
            ("actuator_bandwidth", positive("rad/s")),
            ("actuator_damping", positive("1")),
            ("delay", number("s")),
            ("sensor_bandwidth", positive("rad/s")),
        ],
    );
    let schema = object(
        "Everything that the control law needs. SI units and radians, sticks in percent.",
        &[
            ("schema", json!({ "const": schedule::SCHEMA })),
            ("name", text("name of the aircraft")),
            ("requirements_met", json!({ "type": "boolean" })),
            ("provenance", provenance()),
            ("interpolation", text("how to read the table between and beyond its breakpoints")),
            ("units", json!({ "type": "object", "additionalProperties": { "type": "string" } })),
            ("law", law),
            ("turn_coordination_speed", number("middle of the blend, m/s")),
            ("turn_coordination_width", positive("width of the blend, m/s")),
            ("hardware", hardware),
            (
                "stick_limits",
                json!({
                    "type": "array",
                    "description": "lower and upper limits of lat, lon, col, ped, %",
                    "items": numbers(2, "lower, upper"),
                    "minItems": 4,
                    "maxItems": 4,
                }),
            ),
            ("points", json!({ "type": "array", "items": point, "minItems": 1 })),
        ],
    );
    document("coaxdesign gain schedule", schema)
}

/// A schema as a document of its own: how to read it and its title come first.
fn document(title: &str, schema: Value) -> Value {
    let mut whole = json!({ "$schema": DRAFT, "title": title });
    if let (Some(whole), Value::Object(schema)) = (whole.as_object_mut(), schema) {
        whole.extend(schema);
    }
    whole
}

/// The schema of the JSON export.
pub fn law_schema() -> Value {
    let strings = json!({ "type": "array", "items": { "type": "string" } });
    let constant = object(
        "A number that does not depend on speed.",
        &[
            ("name", text("name")),
            ("unit", text("unit; 1 for none")),
            ("value", number("value")),
            ("meaning", text("what it is")),
        ],
    );
    // One form for each table, so that its size is checked too.
    let tables: Vec<Value> = FORMS
        .iter()
        .map(|form| {
            let (rows, columns) = form.size();
            object(
                form.meaning(),
                &[
                    ("name", json!({ "const": form.name })),
                    ("meaning", text("what it is")),
                    ("needed_by_law", json!({ "type": "boolean" })),
                    ("rows", strings.clone()),
                    ("columns", strings.clone()),
                    (
                        "units",
                        json!({
                            "type": "array",
                            "description": "unit of every entry, by rows",
                            "items": strings,
                            "minItems": rows,
                            "maxItems": rows,
                        }),
                    ),
                    (
                        "values",
                        json!({
                            "type": "array",
                            "description": "a matrix for every breakpoint",
                            "items": matrix(rows, columns, "by rows"),
                            "minItems": 1,
                        }),
                    ),
                ],
            )
        })
        .collect();
    let schema = object(
        "The control law as tables over true airspeed, with units and rules.",
        &[
            ("schema", json!({ "const": description::SCHEMA })),
            ("name", text("name of the aircraft")),
            ("requirements_met", json!({ "type": "boolean" })),
            ("warnings", strings.clone()),
            ("provenance", provenance()),
            ("rules", json!({ "type": "object", "additionalProperties": { "type": "string" } })),
            (
                "speed",
                object(
                    "Breakpoints.",
                    &[
                        ("unit", json!({ "const": "m/s" })),
                        ("meaning", text("which speed")),
                        (
                            "values",
                            json!({
                                "type": "array",
                                "items": { "type": "number" },
                                "minItems": 1,
                            }),
                        ),
                    ],
                ),
            ),
            ("constants", json!({ "type": "array", "items": constant })),
            (
                "tables",
                json!({
                    "type": "array",
                    "items": { "oneOf": tables },
                    "minItems": FORMS.len(),
                    "maxItems": FORMS.len(),
                }),
            ),
        ],
    );
    document("coaxdesign control law", schema)
}
