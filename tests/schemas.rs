//! Schemas of results.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use program::{check_against, code, command, err, out, program};
use serde_json::Value as Json;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Names of all schemas, as the program lists them.
const NAMES: [&str; 24] = [
    "problem",
    "specification",
    "maneuver",
    "schedule",
    "law",
    "lti-set",
    "lti",
    "ltp",
    "trim",
    "rotor",
    "compare",
    "check",
    "modes",
    "frequency-response",
    "verification",
    "design",
    "simulation",
    "identification",
    "steps",
    "montecarlo",
    "study",
    "run",
    "sweep",
    "case",
];

/// Every schema is published as it is written, has an address of its own, and
/// is a schema.
#[test]
fn every_schema_is_published_and_compiles() {
    let help = program(Path::new(ROOT), &["schema", "--help"]);
    let folder = Path::new(ROOT).join("docs/schemas");
    let mut addresses = Vec::new();
    for name in NAMES {
        assert!(out(&help).contains(&format!("- {name}:")), "{name}: {}", out(&help));
        let shown = program(Path::new(ROOT), &["schema", name]);
        let published =
            std::fs::read_to_string(folder.join(format!("{name}.schema.json"))).unwrap_or_default();
        assert!(
            published == out(&shown),
            "write it anew: coaxdesign schema {name} --force -o docs/schemas/{name}.schema.json"
        );
        let schema: Json = serde_json::from_str(&published).unwrap();
        let address = schema["$id"].as_str().unwrap().to_string();
        assert!(address.starts_with(&format!("urn:coaxdesign:{name}:")), "{address}");
        let mut compiler = boon::Compiler::new();
        compiler.add_resource(&address, schema).unwrap();
        compiler.compile(&address, &mut boon::Schemas::new()).unwrap();
        addresses.push(address);
    }
    let listed = out(&help).lines().filter(|line| line.trim_start().starts_with("- ")).count();
    assert_eq!(listed, NAMES.len(), "a schema is not in the list of this test");
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), NAMES.len());
    addresses.sort();
    addresses.dedup();
    assert_eq!(addresses.len(), NAMES.len());
}

/// The runner of all tests checks what the program leaves; here every form is
/// made once.
#[test]
fn results_of_every_form_are_as_their_schemas_say() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let design = format!("{ROOT}/designs/coax2d");
    let uh60a = format!("{ROOT}/problems/uh60a.toml");
    let hold = "title = \"Hold\"\nduration = \"0.5 s\"\nmode = \"velocity\"\n";
    std::fs::write(here.join("hold.toml"), hold).unwrap();
    let lines = [
        ("trim", "trim --speeds 0,40kt --interactions both --format json".to_string()),
        ("trim", format!("trim {uh60a} --speeds 40kt --units si --format json")),
        // Far beyond what it can fly: points that have failed.
        ("trim", "trim --speeds 300kt --format json".into()),
        ("trim", "trim --speeds 10kt --wind-azimuth 90deg --format json".into()),
        ("rotor", format!("rotor {uh60a} --ct 0.002,0.006 --format json")),
        ("compare", format!("compare coax2d-physics {design} --speeds 0,20kt --format json")),
        ("check", format!("check {uh60a} --format json")),
        ("check", "check --units si --format json".into()),
        ("lti", "linearize --speed 20kt --format json".into()),
        ("lti-set", "linearize --speeds 0,20kt --reduce residualize --format json".into()),
        ("ltp", "linearize --model full --format json".into()),
        ("modes", "modes --speed 20kt --interactions both --format json".into()),
        ("modes", "modes --model floquet --units si --format json".into()),
        ("frequency-response", "bode --units si --format json".into()),
        ("simulation", format!("simulate {design} -m hold.toml --format json")),
        (
            "montecarlo",
            format!("montecarlo {design} -m hold.toml --runs 2 --format json -o r.jsonl"),
        ),
    ];
    for (name, line) in lines {
        let done = command(here, &line);
        assert!(code(&done) <= 1, "{line}: {}", err(&done));
        let value: Json = serde_json::from_str(out(&done)).unwrap();
        assert_eq!(
            value["schema"].as_str().map(|s| s.split('/').next().unwrap_or_default()),
            Some(format!("coaxdesign.{name}").as_str()),
            "{line}"
        );
        check_against(&line, name, &value);
    }
    for file in ["r.study.json", "r.jsonl"] {
        assert!(here.join(file).exists(), "{file}");
    }
    let kept = |file: &str| -> Json {
        let path = Path::new(ROOT).join("designs/coax2d").join(file);
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
    };
    check_against("design.json", "design", &kept("design.json"));
    check_against("schedule.json", "schedule", &kept("schedule.json"));
    check_against("verification.json", "verification", &kept("verification.json"));
}

/// A schema refuses what is not of its form: a key too many, one too few, a
/// number of the wrong kind.
#[test]
#[should_panic(expected = "not as the schema trim says")]
fn a_schema_refuses_another_form() {
    let value = serde_json::json!({
        "schema": "coaxdesign.trim/1", "problem": "x", "version": "0", "units": "us",
        "points": [], "more": 1,
    });
    check_against("here", "trim", &value);
}
