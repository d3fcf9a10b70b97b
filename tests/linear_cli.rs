//! The subcommands on linear models, as people and scripts meet them.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use coaxdesign::linear::io::{from_json, set_from_json};
use program::{code, command as program, err, out};
use serde_json::Value;

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn linearize_writes_the_reduced_model_in_the_units_of_the_paper() {
    let run = |more: &str| {
        program(here(), &format!("linearize --speed 70kt --reduce residualize --quiet {more}"))
    };
    let json = run("--format json");
    assert_eq!(code(&json), 0, "{}", err(&json));
    assert!(json.stderr.is_empty());
    let value: Value = serde_json::from_str(out(&json)).unwrap();
    assert_eq!(value["schema"], "coaxdesign.lti/1");
    assert_eq!(value["speed_kt"], 70.0);
    assert_eq!(value["interactions"], true);
    assert_eq!(value["states"][0]["unit"], "ft/s");
    assert_eq!(value["inputs"][0]["unit"], "%");
    // Gravity: X_theta and Z_theta are −g cos θ and −g sin θ, 32.174 ft/s².
    let a = |i: usize, j: usize| value["a"][i][j].as_f64().unwrap();
    assert!((a(0, 7).hypot(a(2, 7)) - 32.174).abs() < 0.01, "{} {}", a(0, 7), a(2, 7));
    // The same model in SI, and for any number of threads the same bytes.
    let record = from_json(out(&json)).unwrap();
    let si = run("--format json --units si --threads 1");
    let other = from_json(out(&si)).unwrap();
    assert!((record.model.a() - other.model.a()).amax() < 1e-12 * other.model.a().amax());
    assert_eq!(run("--format json --threads 1").stdout, json.stdout);
    // Every entry of the four matrices and of the trim, the limits of the sticks,
    // and a head.
    let csv = run("--format csv");
    let trim_and_limits = 8 + 4 + 2 * 4;
    let matrices = 8 * 8 + 8 * 4 + 15 * 8 + 15 * 4;
    assert_eq!(out(&csv).lines().count(), 1 + matrices + trim_and_limits);
    // The trim is that of the flight: its velocity makes 70 kt.
    let trim = record.trim.unwrap();
    let speed = trim.states[0].hypot(trim.states[1]).hypot(trim.states[2]);
    assert!((speed / (70.0 * 1852.0 / 3600.0) - 1.0).abs() < 1e-3, "{speed} m/s");
    assert!((10.0..90.0).contains(&trim.inputs[2]), "{trim:?}");
}

#[test]
fn periodic_model_and_matlab_file() {
    let directory = tempfile::tempdir().unwrap();
    let run = |arguments: &str| program(directory.path(), arguments);
    let json = run("linearize --model full --format json --quiet");
    assert_eq!(code(&json), 0, "{}", err(&json));
    let value: Value = serde_json::from_str(out(&json)).unwrap();
    assert_eq!(value["schema"], "coaxdesign.ltp/1");
    let samples = value["samples"].as_array().unwrap();
    // Azimuths share the revolution evenly, and the matrices do vary.
    let step = samples[1]["azimuth_rad"].as_f64().unwrap();
    assert!((step * samples.len() as f64 - std::f64::consts::TAU).abs() < 1e-12);
    assert_ne!(samples[0]["a"], samples[1]["a"]);
    for model in ["full", "averaged"] {
        let file = format!("{model}.mat");
        let mat = run(&format!("linearize --model {model} --format mat -o {file} --quiet"));
        assert_eq!(code(&mat), 0, "{}", err(&mat));
        let bytes = std::fs::read(directory.path().join(&file)).unwrap();
        assert!(bytes.starts_with(b"MATLAB 5.0 MAT-file"));
        // Not replaced unasked.
        assert_eq!(code(&run(&format!("linearize --format mat -o {file} --quiet"))), 3);
    }
}

#[test]
fn model_set_is_checked_between_its_speeds() {
    let set = program(
        here(),
        "linearize --speeds 50:60:5kt --interactions off --reduce residualize --format json",
    );
    assert_eq!(code(&set), 0, "{}", err(&set));
    let models = set_from_json(out(&set)).unwrap();
    assert_eq!(models.speeds().len(), 3);
    assert_eq!(models.interactions(), Some(false));
    let notes = err(&set);
    assert!(notes.contains("52.5") && notes.contains("57.5"), "{notes}");
}

#[test]
fn modes_stand_beside_the_published_ones() {
    let directory = tempfile::tempdir().unwrap();
    let run = program(
        directory.path(),
        "modes --reduce residualize --format json --quiet --plot modes.svg",
    );
    assert_eq!(code(&run), 0, "{}", err(&run));
    let value: Value = serde_json::from_str(out(&run)).unwrap();
    let models = value["points"][0]["models"].as_array().unwrap();
    assert_eq!(models.len(), 3);
    assert_eq!(models[2]["published"], true);
    for model in models {
        // Pairs once: eight eigenvalues.
        let modes = model["modes"].as_array().unwrap();
        let count: usize = modes
            .iter()
            .map(|mode| if mode["imaginary_rad_per_s"].as_f64().unwrap() > 0.0 { 2 } else { 1 })
            .sum();
        assert_eq!(count, 8, "{}", model["label"]);
    }
    let svg = std::fs::read_to_string(directory.path().join("modes.svg")).unwrap();
    assert!(svg.contains("appendix"));
    let floquet = program(here(), "modes --model floquet --interactions on --quiet --format csv");
    assert_eq!(code(&floquet), 0, "{}", err(&floquet));
    assert!(out(&floquet).contains("branch"));
}

#[test]
fn bode_gives_every_pair_in_every_form() {
    let directory = tempfile::tempdir().unwrap();
    let run = |more: &str| {
        let arguments = format!(
            "bode --input lat,lon --response p,q --omega 0.1:10 --points 11 --interactions both \
             --reduced --quiet {more}"
        );
        program(directory.path(), &arguments)
    };
    let json = run("--format json --plot bode.svg");
    assert_eq!(code(&json), 0, "{}", err(&json));
    let value: Value = serde_json::from_str(out(&json)).unwrap();
    assert_eq!(value["omega_rad_per_s"].as_array().unwrap().len(), 11);
    // Two inputs, two outputs, on and off, full and reduced.
    let responses = value["responses"].as_array().unwrap();
    assert_eq!(responses.len(), 16);
    assert_eq!(responses[0]["unit"], "(rad/s)/%");
    assert!(directory.path().join("bode.svg").exists());
    assert_eq!(out(&run("--format csv")).lines().count(), 1 + 16 * 11);
    let table = run("-o table.txt");
    assert_eq!(code(&table), 0);
    let text = std::fs::read_to_string(directory.path().join("table.txt")).unwrap();
    assert!(text.contains("lon to p"));
}

#[test]
fn bad_input_is_named_with_what_to_write_instead() {
    for (arguments, message) in [
        ("bode --input latt --response p", "did you mean \"lat\""),
        ("bode --input lat --response thet", "did you mean \"theta\""),
        ("bode --omega 30:0.1", "0.1:30"),
        ("linearize --reduce residualize --keep u,v,w,p,q,r,phi,thta", "did you mean \"theta\""),
        ("linearize --reduce residualize --keep u,u", "u"),
        ("linearize --keep u", "--reduce"),
        ("linearize --speed 45", "--speed"),
        ("linearize --format mat", "-o FILE.mat"),
        ("linearize --format csv --interactions both", "--interactions on"),
        ("linearize --model full --reduce truncate", "averaged"),
        ("linearize --model harmonic:99", "at most"),
        ("linearize --speeds 0:5:5kt --model full", "one speed"),
        ("linearize --model floquet", "averaged, harmonic:N, full"),
        ("linearize --speeds 0:5:5kt --floquet", "one speed"),
        ("linearize --reduce balanced --keep u", "must be kept"),
        ("modes --model floquet --reduce truncate", "periodic model"),
    ] {
        let output = program(here(), &format!("{arguments} --quiet"));
        assert_eq!(code(&output), 2, "{arguments}: {}", err(&output));
        assert!(err(&output).contains(message), "{arguments}: {}", err(&output));
        assert!(output.stdout.is_empty(), "{arguments}");
    }
}

#[test]
fn no_trim_no_model() {
    // Far beyond what the rotors can carry.
    let output =
        program(here(), "modes --speed 10kt --altitude 60000ft --interactions off --quiet");
    assert_eq!(code(&output), 1, "{}", err(&output));
    assert!(err(&output).contains("no trim"), "{}", err(&output));
    assert!(output.stdout.is_empty());
}
