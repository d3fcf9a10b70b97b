//! Linear models from elsewhere as scripts meet them: tuned, verified, flown,
//! exported, and kept in the design.

#[path = "common/program.rs"]
mod program;
#[path = "common/sets.rs"]
mod sets;

use program::{code, program};
use serde_json::Value;
use sets::example;
use std::path::Path;
use std::process::Output;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs the program where it must not be wrong about its input.
fn ran(here: &Path, arguments: &[&str]) -> Output {
    let done = program(here, arguments);
    assert!(matches!(code(&done), 0 | 1), "{arguments:?}: {}", text(&done.stderr));
    done
}

fn json_of(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", text(&output.stderr)))
}

/// Names of both files of an example.
fn named(name: &str) -> (String, String) {
    let path = |file: &str| example(file).display().to_string();
    (path(name), path(&format!("{name}.toml")))
}

/// A design of models moves to another place, and is then verified, flown,
/// varied, measured, exported and tuned again from what it holds.
#[test]
fn a_design_of_models_lives_by_itself() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let (set, spec) = named("uh60a");
    let own_spec = std::fs::read_to_string(&spec).unwrap().replace(
        "speeds = [\"1 kt\", \"10 kt\", \"20 kt\", \"30 kt\", \"40 kt\", \"60 kt\", \"80 kt\", \"100 kt\", \"120 kt\"]",
        "speeds = [\"40 kt\", \"60 kt\", \"80 kt\"]",
    );
    std::fs::write(here.join("own.toml"), own_spec).unwrap();
    let tune = ["tune-gains", "-q", "--models", &set, "--spec", "own.toml", "-o", "made"];
    ran(here, &tune);
    std::fs::rename(here.join("made"), here.join("moved")).unwrap();
    std::fs::remove_file(here.join("own.toml")).unwrap();
    let schedule = std::fs::read(here.join("moved/schedule.json")).unwrap();

    let verified = json_of(&ran(here, &["verify", "-q", "moved", "--format", "json"]));
    let kept: Value =
        serde_json::from_slice(&std::fs::read(here.join("moved/verification.json")).unwrap())
            .unwrap();
    assert_eq!(verified["aircraft"], "UH-60A at 16000 lbf");
    assert_eq!(verified["rows"].as_array().unwrap().len(), kept["rows"].as_array().unwrap().len());
    assert_eq!(verified["passed"], kept["passed"]);

    std::fs::write(
        here.join("m.toml"),
        "title = \"Faster\"\nduration = \"12 s\"\nmode = \"velocity\"\n[start]\nairspeed = \"50 kt\"\n\
         [commands.forward_velocity]\ntime = [\"1 s\", \"9 s\"]\nvalue = [\"50 kt\", \"65 kt\"]\n",
    )
    .unwrap();
    let flown = ran(
        here,
        &[
            "simulate", "-q", "moved", "-m", "m.toml", "--format", "json", "-o", "f.json",
            "--plot", "f.svg",
        ],
    );
    let flown = json_of(&flown);
    assert_eq!(flown["metrics"]["end"]["status"], "completed");
    assert_eq!(flown["aircraft"], "UH-60A at 16000 lbf");
    assert_eq!(flown["metrics"]["beyond_models"]["time_s"], 0.0);
    assert_eq!(flown["metrics"]["stick_actuators"].as_array().unwrap().len(), 4);
    assert!(flown["metrics"].get("power").is_none());
    let history: Value =
        serde_json::from_slice(&std::fs::read(here.join("f.json")).unwrap()).unwrap();
    let columns = history["history"]["columns"].as_array().unwrap();
    assert!(columns.iter().any(|c| c["name"] == "lat_actuator" && c["unit"] == "%"));
    let forward = columns.iter().position(|c| c["name"] == "forward_velocity").unwrap();
    let last = history["history"]["rows"].as_array().unwrap().last().unwrap();
    assert!((last[forward].as_f64().unwrap() - 65.0 * 1852.0 / 3600.0).abs() < 1.0);

    let study = ["montecarlo", "-q", "moved", "-m", "m.toml", "--runs", "3", "--format", "json"];
    let study = json_of(&ran(here, &study));
    assert_eq!(study["completed"], 3, "{study}");
    let steps = ["identify", "moved", "--speeds", "60 kt", "--steps", "--format", "json"];
    let steps = json_of(&ran(here, &steps));
    for step in steps["steps"].as_array().unwrap() {
        assert!(step["rms_difference_percent"].as_f64().unwrap() < 4.0, "{step}");
    }
    ran(here, &["export", "moved", "--to", "c", "-o", "law", "--unverified"]);
    assert!(std::fs::read_dir(here.join("law")).unwrap().count() > 0);

    // The same again from what is there.
    ran(here, &["tune-gains", "-q", "-o", "moved", "--force"]);
    assert!(schedule == std::fs::read(here.join("moved/schedule.json")).unwrap());

    // Other models are refused, and what needs a problem says so.
    let (other, _) = named("coax2d-paper");
    let refused = program(here, &["simulate", "moved", "--models", &other, "-m", "m.toml"]);
    assert_eq!(code(&refused), 2);
    let refused = program(here, &["report", "moved"]);
    assert_eq!(code(&refused), 2);
    assert!(text(&refused.stderr).contains("made from linear models"), "{}", text(&refused.stderr));
}

/// The two models printed in the paper, typed into CSV tables, tuned to all of
/// their specification, and flown as one model from hover to 70 kt.
#[test]
fn printed_models_are_tuned_and_flown() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let (set, spec) = named("coax2d-paper");
    let done = program(
        here,
        &["tune-gains", "-q", "--models", &set, "--spec", &spec, "-o", "made", "--format", "json"],
    );
    let tuned = json_of(&done);
    let failed: Vec<&Value> =
        tuned["rows"].as_array().unwrap().iter().filter(|row| row["passed"] != true).collect();
    assert!(failed.is_empty() && code(&done) == 0, "{failed:?}");
    std::fs::write(
        here.join("m.toml"),
        "title = \"To 70 kt\"\nduration = \"45 s\"\nmode = \"velocity\"\n\
         [commands.forward_velocity]\ntime = [\"2 s\", \"37 s\"]\nvalue = [\"0 kt\", \"70 kt\"]\n",
    )
    .unwrap();
    let flown = json_of(&ran(
        here,
        &["simulate", "-q", "made", "-m", "m.toml", "--format", "json", "-o", "f.json"],
    ));
    assert_eq!(flown["metrics"]["end"]["status"], "completed");
    let tracking = flown["metrics"]["tracking"].as_array().unwrap();
    let forward = tracking.iter().find(|t| t["channel"] == "forward_velocity").unwrap();
    assert!(forward["rms"].as_f64().unwrap() < 1.5, "{forward}");
    let history: Value =
        serde_json::from_slice(&std::fs::read(here.join("f.json")).unwrap()).unwrap();
    let columns = history["history"]["columns"].as_array().unwrap();
    let place = columns.iter().position(|c| c["name"] == "forward_velocity").unwrap();
    let rows = history["history"]["rows"].as_array().unwrap();
    let (first, last) = (&rows[0][place], &rows[rows.len() - 1][place]);
    assert!(first.as_f64().unwrap().abs() < 0.1);
    assert!((last.as_f64().unwrap() - 70.0 * 1852.0 / 3600.0).abs() < 1.0, "{last}");
}

/// What `linearize` writes in each form is a set that gives the gains of the
/// problem itself.
#[test]
fn linearised_models_give_the_gains_of_the_problem() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let own = include_str!("../problems/hq.toml");
    let start = own.find("[schedule]").unwrap();
    let at = start + own[start..].find("speeds = [").unwrap();
    let end = at + own[at..].find(']').unwrap();
    let spec = format!("{}speeds = [\"0 kt\", \"20 kt\", \"40 kt\"{}", &own[..at], &own[end..]);
    std::fs::write(here.join("spec.toml"), spec).unwrap();
    let tune = ["tune-gains", "-q", "--spec", "spec.toml", "--nominal-only", "-o", "own"];
    ran(here, &tune);
    let gains = |design: &str| -> Vec<f64> {
        let text = std::fs::read_to_string(here.join(design).join("schedule.json")).unwrap();
        let schedule: Value = serde_json::from_str(&text).unwrap();
        let mut all = Vec::new();
        for point in schedule["points"].as_array().unwrap() {
            numbers(&point["gains"], &mut all);
        }
        all
    };
    let wanted = gains("own");
    assert!(wanted.len() >= 3 * 10, "{}", wanted.len());
    for form in ["json", "mat", "csv"] {
        let file = format!("models.{form}");
        ran(here, &["linearize", "-q", "--speeds", "0:40:10kt", "--format", form, "-o", &file]);
        let design = format!("of-{form}");
        let tune = ["tune-gains", "-q", "--models", &file, "--spec", "spec.toml", "--nominal-only"];
        ran(here, &[&tune[..], &["-o", &design]].concat());
        let found = gains(&design);
        assert_eq!(found.len(), wanted.len());
        for (f, w) in found.iter().zip(&wanted) {
            assert!((f - w).abs() <= 1e-4 * w.abs().max(1e-3), "{form}: {f} beside {w}");
        }
    }
}

fn numbers(value: &Value, out: &mut Vec<f64>) {
    match value {
        Value::Number(x) => out.extend(x.as_f64()),
        Value::Array(list) => list.iter().for_each(|v| numbers(v, out)),
        Value::Object(map) => map.values().for_each(|v| numbers(v, out)),
        _ => {}
    }
}
