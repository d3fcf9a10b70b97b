//! `simulate` and `montecarlo` as scripts meet them.

#[path = "common/program.rs"]
mod program;

use program::{code, program};
use serde_json::Value;

const DESIGN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d");

/// A history is whole, has a unit in every header, and is the same again; a
/// file is not replaced unasked, and forms that are not written are refused
/// before anything is flown.
#[test]
fn histories_are_whole_and_repeat() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let fly = |file: &str| {
        program(here, &["simulate", "-q", "-m", "lateral-doublet", "-o", file, "--format", "json"])
    };
    let flown = fly("a.csv");
    assert_eq!(code(&flown), 0, "{}", String::from_utf8_lossy(&flown.stderr));
    let summary: Value = serde_json::from_slice(&flown.stdout).unwrap();
    assert_eq!(summary["schema"], "coaxdesign.simulation/1");
    assert_eq!(summary["metrics"]["end"]["status"], "completed");
    let text = std::fs::read_to_string(here.join("a.csv")).unwrap();
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let headers = reader.headers().unwrap().clone();
    assert_eq!(&headers[0], "time_s");
    assert!(headers.iter().any(|name| name == "theta_deg"));
    let rows: Vec<Vec<f64>> = reader
        .records()
        .map(|row| row.unwrap().iter().map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 801);
    assert!(rows.iter().flatten().all(|x| x.is_finite()));
    assert_eq!(code(&fly("b.csv")), 0);
    assert_eq!(text, std::fs::read_to_string(here.join("b.csv")).unwrap());
    assert_eq!(code(&fly("a.csv")), 3);
    let refused = fly("a.parquet");
    assert_eq!(code(&refused), 2);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("CSV"));
    assert!(!here.join("a.parquet").exists());
}

#[test]
fn bad_arguments_say_what_to_write() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let message = |arguments: &[&str]| {
        let output = program(here, arguments);
        assert_eq!(code(&output), 2, "{arguments:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(message(&["simulate", "-m", "slalom"]).contains("tune-gains"));
    assert!(
        message(&["simulate", "-m", "lateral-doublet", "--model", "colour=red"])
            .contains("interactions=off")
    );
    assert!(
        message(&["simulate", "-m", "lateral-doublet", "--control-rate", "5"])
            .contains("half a control period")
    );
    std::fs::write(here.join("bad.toml"), "title = \"x\"\nmode = \"velocity\"\n").unwrap();
    assert!(message(&["simulate", "-m", "bad.toml"]).contains("duration"));
}

/// Shards put together, and a study that was interrupted within a line, give
/// the bytes of the study flown in one go.
#[test]
fn shards_and_interruptions_leave_no_trace() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    std::fs::write(
        here.join("hold.toml"),
        "title = \"hold\"\nduration = \"1 s\"\nmode = \"velocity\"\n",
    )
    .unwrap();
    let study = |more: &[&str]| {
        let mut arguments = vec!["montecarlo", DESIGN, "-q", "-m", "hold.toml", "--runs", "4"];
        arguments.extend(["--seed", "3", "--model", "interactions=off", "--format", "json"]);
        arguments.extend(more);
        let output = program(here, &arguments);
        assert!(code(&output) <= 1, "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let read = |file: &str| std::fs::read_to_string(here.join(file)).unwrap();
    let whole = study(&["-o", "whole.jsonl"]);
    assert_eq!(whole["flown"], 4);
    study(&["-o", "0.jsonl", "--shard", "0/2"]);
    study(&["-o", "1.jsonl", "--shard", "1/2"]);
    let joined = study(&["-o", "joined.jsonl", "--merge", "0.jsonl", "1.jsonl"]);
    assert_eq!(joined, whole);
    assert_eq!(read("joined.jsonl"), read("whole.jsonl"));
    let text = read("whole.jsonl");
    std::fs::write(here.join("cut.jsonl"), &text[..text.len() - 40]).unwrap();
    study(&["-o", "cut.jsonl"]);
    assert_eq!(read("cut.jsonl"), text);
    // Another study's file is not added to.
    let mut arguments = vec!["montecarlo", DESIGN, "-q", "-m", "hold.toml", "--runs", "5"];
    arguments.extend(["--model", "interactions=off", "-o", "whole.jsonl"]);
    assert_eq!(code(&program(here, &arguments)), 2);
    assert_eq!(read("whole.jsonl"), text);
}
