//! JSON Schema of `coaxdesign.lti-set/1`.

use crate::linear::io::{LTI_SCHEMA, LTI_SET_SCHEMA};
use serde_json::{Value, json};

/// The schema of a set of linear models as JSON: what `linearize --speeds`
/// writes and [`super::load`] reads.
#[must_use]
pub fn set_schema() -> Value {
    let channels = |what: &str| {
        json!({
            "type": "array",
            "description": what,
            "items": {
                "type": "object",
                "properties": {
                    "name": { "type": "string" },
                    "unit": { "type": "string", "description": "such as ft/s, rad/s, deg, %, in" },
                    "delay_s": {
                        "type": "number",
                        "minimum": 0,
                        "maximum": 0.5,
                        "description": "transport delay, s",
                    },
                },
                "required": ["name"],
                "additionalProperties": false,
            },
        })
    };
    let matrix = |what: &str| {
        json!({
            "type": "array",
            "description": what,
            "items": { "type": "array", "items": { "type": "number" } },
        })
    };
    let values =
        |what: &str| json!({ "type": "array", "description": what, "items": { "type": "number" } });
    let text = |what: &str| json!({ "type": "string", "description": what });
    let hardware = json!({
        "enum": ["separate", "included"],
        "description": "whether actuators, delays and sensors are in the models",
    });
    let interactions = json!({
        "type": ["boolean", "null"],
        "description": "whether rotors act on one another, if it is known",
    });
    let model = json!({
        "type": "object",
        "properties": {
            "schema": { "const": LTI_SCHEMA },
            "name": text("name of the model"),
            "source": text("where the numbers come from"),
            "interactions": interactions.clone(),
            "hardware": hardware.clone(),
            "speed_kt": { "type": "number", "minimum": 0, "description": "true airspeed, kt" },
            "speed": text("true airspeed with its unit, such as 20 kt, instead of speed_kt"),
            "states": channels("states, in the order of the rows of a"),
            "inputs": channels("inputs, in the order of the columns of b"),
            "outputs": channels("outputs, in the order of the rows of c"),
            "a": matrix("state matrix by rows, in the units of the channels"),
            "b": matrix("input matrix by rows"),
            "c": matrix("output matrix by rows"),
            "d": matrix("feed-through matrix by rows; zero where it is left out"),
            "x0": values("trim values of the states, totals"),
            "u0": values("trim values of the inputs, totals"),
            "u_min": values("least values of the inputs; 0 % for sticks where it is left out"),
            "u_max": values("greatest values of the inputs; 100 % for sticks where it is left out"),
        },
        "required": ["a", "b"],
        "oneOf": [{ "required": ["speed_kt"] }, { "required": ["speed"] }],
        "additionalProperties": false,
    });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": LTI_SET_SCHEMA,
        "description": "Linear models at increasing true airspeeds",
        "type": "object",
        "properties": {
            "schema": { "const": LTI_SET_SCHEMA },
            "name": text("name of the aircraft"),
            "source": text("where the numbers come from"),
            "interactions": interactions,
            "hardware": hardware,
            "states": channels("states of all models that do not say their own"),
            "inputs": channels("inputs of all models that do not say their own"),
            "outputs": channels("outputs of all models that do not say their own"),
            "models": { "type": "array", "minItems": 1, "items": model },
        },
        "required": ["schema", "models"],
        "additionalProperties": false,
    })
}
