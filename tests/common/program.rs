//! Running the program in a test.

// Each test file uses its own part of this.
#![allow(dead_code)]

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::SystemTime;

use assert_cmd::Command;
use serde_json::Value as Json;

/// Runs the program in a directory. Whatever JSON it leaves must be as its
/// schema says.
pub fn program(directory: &Path, arguments: &[&str]) -> Output {
    let before = results(directory);
    let output = Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap();
    check_results(directory, &before, &output);
    output
}

/// As [`program`], with arguments that hold no blanks in one line.
pub fn command(directory: &Path, line: &str) -> Output {
    program(directory, &line.split_whitespace().collect::<Vec<_>>())
}

/// Exit code.
pub fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

/// Standard output.
pub fn out(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).unwrap()
}

/// Standard error.
pub fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Checks every JSON result that a run of the program left, on standard output
/// and in files, against the schema that it names.
///
/// # Panics
/// A result that names no schema, or that its schema refuses.
fn check_results(directory: &Path, before: &Files, output: &Output) {
    if !matches!(output.status.code(), Some(0 | 1)) {
        return;
    }
    if let Ok(value) = serde_json::from_slice::<Json>(&output.stdout)
        && value.is_object()
    {
        check_result("standard output", &value);
    }
    for (path, about) in results(directory) {
        if before.get(&path) != Some(&about) {
            check_file(&path);
        }
    }
}

/// Files, when they were written, and their lengths.
type Files = HashMap<PathBuf, (Option<SystemTime>, u64)>;

/// Files of results in a directory that a test has of its own.
fn results(directory: &Path) -> Files {
    let mut found = Files::new();
    let mut folders = Vec::new();
    if directory.starts_with(std::env::temp_dir()) {
        folders.push(directory.to_path_buf());
    }
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            // A file may be gone again.
            let Ok(about) = std::fs::symlink_metadata(&path) else { continue };
            if about.is_dir() {
                folders.push(path);
            } else if about.is_file()
                && path.extension().is_some_and(|e| e == "json" || e == "jsonl")
            {
                found.insert(path, (about.modified().ok(), about.len()));
            }
        }
    }
    found
}

fn check_file(path: &Path) {
    // What was hurt on purpose is no JSON.
    let Ok(text) = std::fs::read_to_string(path) else { return };
    let name = path.display().to_string();
    if name.ends_with(".jsonl") {
        for line in text.lines() {
            if let Ok(value) = serde_json::from_str::<Json>(line) {
                let row = if value.get("case").is_some() { "case" } else { "run" };
                check_against(&name, row, &value);
            }
        }
        return;
    }
    let Ok(value) = serde_json::from_str::<Json>(&text) else { return };
    if value.get("$schema").is_some() {
        return;
    }
    match &value {
        // Models with interactions and without.
        Json::Array(entries) => entries.iter().for_each(|entry| check_result(&name, entry)),
        _ => check_result(&name, &value),
    }
}

/// `trim` for `coaxdesign.trim/1`.
fn value_key(value: &Json, key: &str) -> Option<String> {
    let schema = value.get(key)?.as_str()?;
    let (name, _) = schema.strip_prefix("coaxdesign.")?.split_once('/')?;
    Some(name.to_string())
}

fn check_result(place: &str, value: &Json) {
    if value.get("$schema").is_some() {
        return;
    }
    let name = match (value_key(value, "schema"), value.get("head")) {
        (Some(name), _) => name,
        (None, Some(_)) => "study".into(),
        (None, None) => panic!("{place}: a result without a schema: {:.300}", value.to_string()),
    };
    check_against(place, &name, value);
}

thread_local! {
    static KNOWN: RefCell<HashMap<String, (boon::Schemas, boon::SchemaIndex)>> = RefCell::default();
}

/// Checks a value against a schema of the program by its name.
pub fn check_against(place: &str, name: &str, value: &Json) {
    KNOWN.with_borrow_mut(|known| {
        let (schemas, index) = known.entry(name.to_string()).or_insert_with(|| {
            let shown = Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
                .args(["schema", name])
                .output()
                .unwrap();
            let schema: Json = serde_json::from_slice(&shown.stdout)
                .unwrap_or_else(|_| panic!("{place}: there is no schema {name}"));
            let id = schema["$id"].as_str().unwrap().to_string();
            let mut compiler = boon::Compiler::new();
            compiler.add_resource(&id, schema).unwrap();
            let mut schemas = boon::Schemas::new();
            let index = compiler.compile(&id, &mut schemas).unwrap();
            (schemas, index)
        });
        if let Err(error) = schemas.validate(value, *index) {
            panic!("{place}: not as the schema {name} says: {error:#}");
        }
    });
}
