//! The program as people and scripts meet it: output, files and exit codes.

#[path = "common/program.rs"]
mod program;

use std::path::Path;
use std::process::{Command as Process, Output, Stdio};

use coaxdesign::problem;
use program::{code, out, program};
use serde_json::Value;

fn json(output: &Output) -> Value {
    serde_json::from_str(out(output)).unwrap()
}

#[test]
fn new_file_passes_the_check_and_is_not_replaced_unasked() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    assert_eq!(code(&program(here, &["new", "mine.toml"])), 0);
    let checked = program(here, &["check", "mine.toml"]);
    assert_eq!(code(&checked), 0);
    assert!(checked.stderr.is_empty());
    std::fs::write(here.join("mine.toml"), "name = \"mine\"").unwrap();
    let refused = program(here, &["new", "mine.toml"]);
    assert_eq!(code(&refused), 3);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--force"));
    assert_eq!(std::fs::read_to_string(here.join("mine.toml")).unwrap(), "name = \"mine\"");
    assert_eq!(code(&program(here, &["new", "mine.toml", "--force"])), 0);
    assert_eq!(code(&program(here, &["check", "mine.toml"])), 0);
    assert_eq!(code(&program(here, &["new", "none/mine.toml"])), 3);
}

/// Table 1 of the paper, in both systems.
#[test]
fn val_check_shows_what_the_file_says() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let us = json(&program(here, &["check", "--format", "json"]));
    let si = json(&program(here, &["check", "--format", "json", "--units", "si"]));
    for (pointer_us, value, pointer_si, factor) in [
        ("/aircraft/mass_lb", 992.0, "/aircraft/mass_kg", 0.453_592_37),
        ("/aircraft/i_yy_slug_ft2", 848.0, "/aircraft/i_yy_kg_m2", 1.355_817_948_329),
        ("/rotors/upper/radius_ft", 10.66, "/rotors/upper/radius_m", 0.3048),
        ("/rotors/lower/tilt_deg", -4.0, "/rotors/lower/tilt_deg", 1.0),
        ("/rotors/lower/speed_rad_per_s", 47.65, "/rotors/lower/speed_rad_per_s", 1.0),
        ("/wings/vertical_stabilizer/span_ft", 4.0, "/wings/vertical_stabilizer/span_m", 0.3048),
    ] {
        let us = us.pointer(pointer_us).and_then(Value::as_f64).unwrap();
        let si = si.pointer(pointer_si).and_then(Value::as_f64).unwrap();
        assert!((us - value).abs() < 1e-9 * value.abs(), "{pointer_us}: {us}");
        assert!((si - value * factor).abs() < 1e-9 * si.abs(), "{pointer_si}: {si}");
    }
    assert_eq!(us["warnings"].as_array().unwrap().len(), 2);
    // Built-in names and files of the same content say the same.
    let named = program(here, &["check", "coax2d-physics"]);
    let file = program(here, &["check", "problems/coax2d-physics.toml"]);
    assert_eq!(code(&named), 0);
    assert_eq!(out(&named), out(&file));
}

/// A design may bear the name of the problem that it is of.
#[test]
fn a_directory_does_not_hide_a_builtin_problem() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    std::fs::create_dir(here.join("coax2d")).unwrap();
    let checked = program(here, &["check", "coax2d"]);
    assert_eq!(code(&checked), 0);
    assert_eq!(out(&checked), out(&program(here, &["check"])));
    let planned = program(here, &["design", "coax2d", "-o", "coax2d", "--dry-run"]);
    assert_eq!(code(&planned), 0, "{}", String::from_utf8_lossy(&planned.stderr));
    let line = ["compare", "coax2d", "coax2d-physics", "--speeds", "0 kt"];
    let compared = program(here, &line);
    assert_eq!(code(&compared), 0);
    let said = String::from_utf8_lossy(&compared.stderr).into_owned();
    assert!(said.contains("./coax2d is the directory"), "{said}");
    // A file of that name is what was meant.
    std::fs::remove_dir(here.join("coax2d")).unwrap();
    std::fs::write(here.join("coax2d"), "name = \"mine\"").unwrap();
    assert_eq!(code(&program(here, &["check", "coax2d"])), 2);
}

#[test]
fn usage_errors_exit_with_2() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    for arguments in [
        &["check", "--units", "imperial"][..],
        &["chekc"],
        &["man", "chekc"],
        &["completions", "dos"],
        &[],
    ] {
        assert_eq!(code(&program(here, arguments)), 2, "{arguments:?}");
    }
    assert_eq!(code(&program(here, &["--help"])), 0);
    assert!(out(&program(here, &["--help"])).contains("Exit codes"));
}

#[test]
fn manual_and_completions_name_the_subcommands() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    for arguments in [
        &["man"][..],
        &["completions", "bash"],
        &["completions", "zsh"],
        &["completions", "fish"],
        &["completions", "powershell"],
    ] {
        let output = program(here, arguments);
        assert_eq!(code(&output), 0);
        for subcommand in ["check", "schema", "new"] {
            assert!(out(&output).contains(subcommand), "{arguments:?}");
        }
    }
    assert!(out(&program(here, &["man", "check"])).contains("units"));
}

#[test]
fn schema_goes_to_a_file_whole() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    assert_eq!(code(&program(here, &["schema", "-o", "problem.schema.json"])), 0);
    let text = std::fs::read_to_string(here.join("problem.schema.json")).unwrap();
    assert_eq!(text, out(&program(here, &["schema"])));
    assert_eq!(code(&program(here, &["schema", "-o", "problem.schema.json"])), 3);
    assert_eq!(code(&program(here, &["schema", "-o", "."])), 3);
}

/// Every key of the shipped files is known to the schema, at its place, and
/// what the schema requires of a complete file is there.
#[test]
fn schema_knows_the_shipped_files() {
    let schema = problem::schema::json_schema();
    for name in problem::BUILTIN {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("problems/{name}.toml"));
        let table: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
        let form = if table.contains_key("extends") { "extending" } else { "complete" };
        let value = serde_json::to_value(table).unwrap();
        known(&value, &schema["$defs"][form], name);
    }
}

fn known(value: &Value, schema: &Value, path: &str) {
    let Value::Object(table) = value else {
        let kind = match value {
            Value::String(_) => "string",
            Value::Number(_) => "number",
            Value::Bool(_) => "boolean",
            _ => "array",
        };
        let fits = |schema: &Value| {
            schema["type"] == kind
                || (schema["type"] == "integer" && value.is_u64())
                || schema["enum"].as_array().is_some_and(|words| words.contains(value))
        };
        let any = schema["anyOf"].as_array().is_some_and(|forms| forms.iter().any(fits));
        assert!(fits(schema) || any, "{path}: {value} against {schema}");
        return;
    };
    // Of several forms a table takes that of a table.
    let forms = schema["anyOf"].as_array();
    let schema = forms
        .and_then(|forms| forms.iter().find(|form| form["type"] == "object"))
        .unwrap_or(schema);
    if schema["additionalProperties"].is_object() {
        for (name, inner) in table {
            known(inner, &schema["additionalProperties"], &format!("{path}.{name}"));
        }
        return;
    }
    assert_eq!(schema["additionalProperties"], false, "{path}");
    for (name, inner) in table {
        let below = &schema["properties"][name];
        assert!(below.is_object(), "{path}.{name} is not in the schema");
        known(inner, below, &format!("{path}.{name}"));
    }
    for required in schema["required"].as_array().into_iter().flatten() {
        assert!(table.contains_key(required.as_str().unwrap()), "{path} lacks {required}");
    }
}

/// A reader that closes the pipe early is no error.
#[cfg(unix)]
#[test]
fn closed_pipe_is_quiet() {
    let mut child = Process::new(env!("CARGO_BIN_EXE_coaxdesign"))
        .arg("schema")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 0);
    assert!(output.stderr.is_empty());
}

/// In hover the two rotors' shares of one another's wake add up to twice the
/// uniform inflow, whatever their distance (converged rule). For this aircraft
/// with upright shafts an independent model gives 1.3443 and 0.6557; the tilt
/// of the shafts, 4 deg, brings the disks a little closer.
#[test]
fn val_check_shows_the_interference() {
    let directory = tempfile::tempdir().unwrap();
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/coax2d.toml");
    for (tilt, tolerance) in [("0 deg", 1e-4), ("-4 deg", 1e-3)] {
        let text = format!(
            "extends = '{}'\n[rotors.upper]\ntilt = \"{tilt}\"\n[rotors.lower]\ntilt = \"{tilt}\"\n",
            base.display()
        );
        std::fs::write(directory.path().join("tilt.toml"), text).unwrap();
        let answer = json(&program(directory.path(), &["check", "tilt.toml", "--format", "json"]));
        let share = |pair: &str| answer["interference"][pair]["hover_uniform"].as_f64().unwrap();
        let (down, up) = (share("upper_on_lower"), share("lower_on_upper"));
        assert!((down - 1.3443).abs() < tolerance, "{down}");
        assert!((up - 0.6557).abs() < tolerance, "{up}");
        assert!((down + up - 2.0).abs() < 1e-6, "{down} + {up}");
    }
}
