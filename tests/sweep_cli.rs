//! `coaxdesign sweep`: many designs, resumed and in shards.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use program::{check_against, code, command, err, out, program};
use serde_json::Value as Json;

/// One speed, one model: what is tuned in a second.
fn specification(here: &Path) {
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/hq.toml"))
            .unwrap();
    let mut table: toml::Table = text.parse().unwrap();
    table.remove("models");
    let schedule = table["schedule"].as_table_mut().unwrap();
    schedule.insert("speeds".into(), toml::Value::from(vec!["0 kt"]));
    let text = format!("{table}\n[models.nominal]\nclass = \"nominal\"\n");
    std::fs::write(here.join("small.toml"), text).unwrap();
}

/// Lines of a file of rows.
fn rows(path: &Path) -> Vec<Json> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_sweep_makes_a_design_of_every_case_and_goes_on_where_it_stopped() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    specification(here);
    let arguments = [
        "sweep",
        "--spec",
        "small.toml",
        "--vary",
        "spec.hardware.delay=20 ms,35 ms",
        "--vary",
        "mass.mass=450 kg,470 kg",
        "--quiet",
    ];
    let run = |more: &[&str]| program(here, &[&arguments[..], more].concat());
    let whole = run(&["-o", "whole.jsonl", "--keep", "designs", "--format", "json"]);
    assert_eq!(code(&whole), 0, "{}", err(&whole));
    let result: Json = serde_json::from_str(out(&whole)).unwrap();
    check_against("sweep", "sweep", &result);
    let made = rows(&here.join("whole.jsonl"));
    assert_eq!(result["rows"].as_array().unwrap(), &made);
    assert_eq!(made.len(), 4);
    assert_eq!(made[1]["mass.mass"], "470 kg");
    assert_eq!(made[2]["spec.hardware.delay"], "35 ms");
    // Each is a design that other commands read, with its own aircraft.
    let checked = command(here, "check designs/case-0001 --units si --format json");
    assert_eq!(code(&checked), 0, "{}", err(&checked));
    let checked: Json = serde_json::from_str(out(&checked)).unwrap();
    assert!((checked["aircraft"]["mass_kg"].as_f64().unwrap() - 470.0).abs() < 1e-6);
    let again = command(here, "verify designs/case-0001 --format json");
    let again: Json = serde_json::from_str(out(&again)).unwrap();
    assert_eq!(again["passed"], made[1]["status"] == "met");

    // Interrupted in its third line, it goes on, and the bytes are the same.
    let text = std::fs::read_to_string(here.join("whole.jsonl")).unwrap();
    let end = text.match_indices('\n').nth(1).unwrap().0 + 40;
    std::fs::write(here.join("part.jsonl"), &text[..end]).unwrap();
    std::fs::copy(here.join("whole.study.json"), here.join("part.study.json")).unwrap();
    assert_eq!(code(&run(&["-o", "part.jsonl"])), 0);
    assert_eq!(std::fs::read_to_string(here.join("part.jsonl")).unwrap(), text);

    // Shards, joined.
    for shard in ["0/2", "1/2"] {
        let file = format!("s{}.jsonl", &shard[..1]);
        assert_eq!(code(&run(&["--shard", shard, "-o", &file])), 0);
    }
    let partial = run(&["--merge", "s0.jsonl"]);
    assert_eq!(code(&partial), 1, "{}", err(&partial));
    assert!(err(&partial).contains("2 of 4 cases are missing"), "{}", err(&partial));
    let merged = run(&["--merge", "s0.jsonl", "s1.jsonl", "-o", "merged.jsonl"]);
    assert_eq!(code(&merged), 0, "{}", err(&merged));
    assert_eq!(std::fs::read_to_string(here.join("merged.jsonl")).unwrap(), text);

    // Another sweep is refused by what differs.
    let mut other = arguments;
    other[6] = "mass.mass=450 kg,480 kg";
    let refused = program(here, &[&other[..], &["-o", "whole.jsonl"]].concat());
    assert_eq!(code(&refused), 2);
    assert!(err(&refused).contains("another study"), "{}", err(&refused));
    assert!(err(&refused).contains("480 kg"), "{}", err(&refused));
}

#[test]
fn a_plan_file_lists_cases_and_a_schedule_is_verified_on_them() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    specification(here);
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d");
    let plan = "[[case]]\n\"mass.mass\" = \"450 kg\"\n\"spec.hardware.delay\" = \"20 ms\"\n\n\
                [[case]]\n\"mass.mass\" = \"5000 kg\"\n\"spec.hardware.delay\" = \"60 ms\"\n";
    std::fs::write(here.join("plan.toml"), plan).unwrap();
    let line = [
        "sweep",
        "--spec",
        "small.toml",
        "--plan",
        "plan.toml",
        "--schedule",
        design,
        "--format",
        "csv",
        "--quiet",
    ];
    let done = program(here, &line);
    assert_eq!(code(&done), 0, "{}", err(&done));
    let lines: Vec<&str> = out(&done).lines().collect();
    assert_eq!(lines.len(), 3);
    assert!(lines[0].starts_with("case,mass.mass,spec.hardware.delay,status,reason,"));
    assert!(lines[2].starts_with("1,5000 kg,60 ms,no_design,"), "{}", lines[2]);
    // Asked about, what is missed is said by the exit code.
    assert_eq!(code(&program(here, &[&line[..], &["--fail-on-miss"]].concat())), 1);
}

#[test]
fn mistakes_are_said_before_anything_is_tuned() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let refused = |more: &[&str], expected: &str| {
        let done = program(here, &[&["sweep", "--quiet"], more].concat());
        assert_eq!(code(&done), 2, "{more:?}: {}", err(&done));
        assert!(err(&done).contains(expected), "{more:?}: {}", err(&done));
    };
    refused(&["--vary", "mass.mas=450 kg"], "mass");
    refused(&["--vary", "mass.mass=450 kg,9 ft"], "case 1");
    refused(&["--vary", "mass.mass"], "there is no =");
    refused(&["--vary", "spec.hardware.dely=20 ms"], "delay");
    refused(&["--vary", "mass.mass=450 kg", "--channels", "vz"], "vz");
    let missing = program(here, &["sweep", "--quiet", "--vary", "specification=none.toml"]);
    assert_eq!(code(&missing), 3);
    assert!(err(&missing).contains("none.toml"), "{}", err(&missing));
    std::fs::write(here.join("both.toml"), "[vary]\na = [1]\n[[case]]\na = 1\n").unwrap();
    refused(&["--plan", "both.toml"], "both [vary] and [[case]]");
    std::fs::write(here.join("odd.toml"), "[[case]]\na = 1\n[[case]]\nb = 1\n").unwrap();
    refused(&["--plan", "odd.toml"], "has no \"b\"");
}
