//! `simulate` and `montecarlo` as scripts meet them.

#[path = "common/program.rs"]
mod program;

use program::{code, program};
use serde_json::Value;
use std::path::Path;

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
    let refused = fly("a.xls");
    assert_eq!(code(&refused), 2);
    assert!(String::from_utf8_lossy(&refused.stderr).contains(".parquet"));
    assert!(!here.join("a.xls").exists());

    parquet_holds_the_same(here, &fly, &headers, &rows);
}

/// Parquet holds the same columns and numbers, to the digits of the CSV.
#[cfg(feature = "parquet")]
fn parquet_holds_the_same(
    here: &Path,
    fly: &dyn Fn(&str) -> std::process::Output,
    headers: &csv::StringRecord,
    rows: &[Vec<f64>],
) {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    assert_eq!(code(&fly("a.parquet")), 0);
    let file = std::fs::File::open(here.join("a.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let schema = reader.metadata().file_metadata().schema();
    let names: Vec<&str> = schema.get_fields().iter().map(|field| field.name()).collect();
    assert_eq!(names, headers.iter().collect::<Vec<_>>());
    let mut seen = 0;
    for (row, expected) in reader.get_row_iter(None).unwrap().zip(rows) {
        let row = row.unwrap();
        for (k, want) in expected.iter().enumerate() {
            let got = row.get_double(k).unwrap();
            assert!((got - want).abs() <= 1e-8 * want.abs().max(1e-30), "{got} {want}");
        }
        seen += 1;
    }
    assert_eq!(seen, rows.len());
}

/// A program without Parquet says how to build one with it.
#[cfg(not(feature = "parquet"))]
fn parquet_holds_the_same(
    here: &Path,
    fly: &dyn Fn(&str) -> std::process::Output,
    _: &csv::StringRecord,
    _: &[Vec<f64>],
) {
    let refused = fly("a.parquet");
    assert_eq!(code(&refused), 2);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--features parquet"));
    assert!(!here.join("a.parquet").exists());
}

/// A flight that is killed leaves the file that was there before, whole, or
/// none.
#[test]
fn a_killed_flight_leaves_whole_files() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    // Trimmed flight in open loop for longer than anybody waits.
    let text = "title = \"long\"\nduration = \"36000 s\"\nmode = \"attitude\"\n";
    std::fs::write(here.join("long.toml"), text).unwrap();
    for file in ["old.csv", "new.csv", "new.parquet"] {
        if file.ends_with("parquet") && cfg!(not(feature = "parquet")) {
            continue;
        }
        if file == "old.csv" {
            std::fs::write(here.join(file), "what was there\n").unwrap();
        }
        let mut flight = std::process::Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
            .current_dir(here)
            .args(["simulate", DESIGN, "-q", "-m", "long.toml", "--force", "-o", file])
            .args(["--model", "interactions=off"])
            .spawn()
            .unwrap();
        // Until it is writing: a temporary file has grown.
        let growing = || {
            std::fs::read_dir(here).unwrap().any(|entry| {
                let entry = entry.unwrap();
                entry.file_name().to_string_lossy().starts_with(".coaxdesign-")
                    && entry.metadata().is_ok_and(|m| m.len() > 0)
            })
        };
        while !growing() {
            assert!(flight.try_wait().unwrap().is_none(), "it ended by itself");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        flight.kill().unwrap();
        flight.wait().unwrap();
        if file == "old.csv" {
            assert_eq!(std::fs::read_to_string(here.join(file)).unwrap(), "what was there\n");
        } else {
            assert!(!here.join(file).exists());
        }
        for entry in std::fs::read_dir(here).unwrap() {
            let path = entry.unwrap().path();
            if path.file_name().unwrap().to_string_lossy().starts_with(".coaxdesign-") {
                std::fs::remove_file(path).unwrap();
            }
        }
    }
}

/// A law that drives the aircraft away ends with its status and exit code, and
/// every number that is written is a number.
#[test]
fn a_diverging_flight_writes_numbers_only() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let text = std::fs::read_to_string(Path::new(DESIGN).join("schedule.json")).unwrap();
    let mut schedule: Value = serde_json::from_str(&text).unwrap();
    for point in schedule["points"].as_array_mut().unwrap() {
        for gain in ["k_d", "k_p", "k_i"] {
            let value = point["gains"]["roll"][gain].as_f64().unwrap();
            point["gains"]["roll"][gain] = (-value).into();
        }
    }
    std::fs::write(here.join("bad.json"), schedule.to_string()).unwrap();
    for file in ["run.csv", "run.json"] {
        let arguments = ["simulate", "bad.json", "-q", "-m", "sidestep", "-o", file];
        let flown = program(here, &[&arguments[..], &["--format", "json"]].concat());
        assert_eq!(code(&flown), 1);
        let summary: Value = serde_json::from_slice(&flown.stdout).unwrap();
        assert_eq!(summary["metrics"]["end"]["status"], "diverged");
        assert!(summary["metrics"]["end"]["state"].is_string());
        let text = std::fs::read_to_string(here.join(file)).unwrap();
        if file == "run.csv" {
            let mut reader = csv::Reader::from_reader(text.as_bytes());
            for row in reader.records() {
                for cell in row.unwrap().iter() {
                    assert!(cell.parse::<f64>().unwrap().is_finite(), "{cell}");
                }
            }
        } else {
            let run: Value = serde_json::from_str(&text).unwrap();
            for row in run["history"]["rows"].as_array().unwrap() {
                // JSON has no word for what is not finite but null.
                assert!(row.as_array().unwrap().iter().all(Value::is_number));
            }
        }
    }
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
    std::fs::copy(here.join("whole.study.json"), here.join("cut.study.json")).unwrap();
    study(&["-o", "cut.jsonl"]);
    assert_eq!(read("cut.jsonl"), text);
    // Rows alone, each with a unit in the name of a number; the head is beside.
    for line in text.lines() {
        let row: Value = serde_json::from_str(line).unwrap();
        assert!(row["forward_velocity_peak_m_s"].is_f64(), "{row}");
    }
    let head: Value = serde_json::from_str(&read("whole.study.json")).unwrap();
    assert_eq!(head["head"]["schema"], "coaxdesign.montecarlo/2");
    assert_eq!(head["head"]["model"]["interactions"], false);
    assert_eq!(head["units"]["phi_peak_rad"], "rad");
}

/// Another study's file is not added to, and what differs is named: also where
/// it is the model, which earlier versions did not look at.
#[test]
fn another_study_is_refused_by_what_differs() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let hold = "title = \"hold\"\nduration = \"0.1 s\"\nmode = \"velocity\"\n";
    std::fs::write(here.join("hold.toml"), hold).unwrap();
    let study = |runs: &str, more: &[&str]| {
        let mut arguments = vec!["montecarlo", DESIGN, "-q", "-m", "hold.toml", "--runs", runs];
        arguments.extend(["--model", "interactions=off", "-o", "a.jsonl"]);
        arguments.extend(more);
        program(here, &arguments)
    };
    assert_eq!(code(&study("2", &[])), 0);
    let text = std::fs::read_to_string(here.join("a.jsonl")).unwrap();
    let refused = |runs: &str, more: &[&str], named: &str| {
        let output = study(runs, more);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(code(&output), 2, "{message}");
        assert!(message.contains(named), "{message}");
        assert_eq!(std::fs::read_to_string(here.join("a.jsonl")).unwrap(), text);
    };
    refused("3", &[], "runs: 2 there, 3 here");
    refused("2", &["--model", "mass=1.1"], "model.mass: 1.0 there, 1.1 here");
    refused("2", &["--model", "inflow=0.9"], "model.inflow: 1.0 there, 0.9 here");
    refused("2", &["--seed", "5"], "seed: 0 there, 5 here");
    refused("2", &["--control-rate", "50"], "simulation.name: \"100 Hz\" there");
    std::fs::remove_file(here.join("a.study.json")).unwrap();
    refused("2", &[], "there is no a.study.json");
}

/// Flown is done, whatever the runs amount to; a miss is asked about, and a
/// merge that lacks runs says so.
#[test]
fn exit_codes_of_studies() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let hold = "title = \"hold\"\nduration = \"0.1 s\"\nmode = \"velocity\"\n";
    std::fs::write(here.join("hold.toml"), hold).unwrap();
    let study = |more: &[&str]| {
        let mut arguments = vec!["montecarlo", DESIGN, "-q", "-m", "hold.toml", "--runs", "4"];
        arguments.extend(["--model", "interactions=off", "--peak", "0 kt"]);
        arguments.extend(more);
        program(here, &arguments)
    };
    assert_eq!(code(&study(&["-o", "0.jsonl", "--shard", "0/2"])), 0);
    assert_eq!(code(&study(&["--run-only", "0", "--fail-on-miss"])), 1);
    let lacking = study(&["--merge", "0.jsonl"]);
    assert_eq!(code(&lacking), 1);
    assert!(String::from_utf8_lossy(&lacking.stderr).contains("2 of 4 runs are missing"));
    assert_eq!(code(&study(&["--merge", "0.jsonl", "--require-complete", "false"])), 0);
    assert_eq!(code(&study(&["-o", "1.jsonl", "--shard", "1/2"])), 0);
    assert_eq!(code(&study(&["--merge", "0.jsonl", "1.jsonl"])), 0);
}

/// A file that another program flies into is left to it.
#[test]
fn a_file_of_runs_has_one_writer() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let hold = "title = \"hold\"\nduration = \"0.1 s\"\nmode = \"velocity\"\n";
    std::fs::write(here.join("hold.toml"), hold).unwrap();
    let other = std::fs::File::create(here.join("a.jsonl")).unwrap();
    other.lock().unwrap();
    let arguments = ["montecarlo", DESIGN, "-q", "-m", "hold.toml", "--runs", "2", "-o", "a.jsonl"];
    let refused = program(here, &arguments);
    assert_eq!(code(&refused), 2);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("another program"));
    drop(other);
    assert_eq!(code(&program(here, &arguments)), 0);
}
