//! Report, design and comparison as people and scripts meet them.

#[path = "common/program.rs"]
mod program;

use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use coaxdesign::schedule::Schedule;
use program::{code, err, out, program};
use serde_json::Value;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The design in the repository with its first two breakpoints only: enough to
/// draw everything.
fn small_design(directory: &Path) -> PathBuf {
    let kept = root().join("designs/coax2d");
    let design = directory.join("small");
    std::fs::create_dir_all(&design).unwrap();
    let text = std::fs::read_to_string(kept.join("schedule.json")).unwrap();
    let mut schedule = Schedule::from_json(&text).unwrap();
    schedule.points.truncate(2);
    std::fs::write(design.join("schedule.json"), schedule.to_json().unwrap()).unwrap();
    let last = schedule.points[1].speed + 1e-6;
    let text = std::fs::read_to_string(kept.join("verification.json")).unwrap();
    let mut value: Value = serde_json::from_str(&text).unwrap();
    for list in ["rows", "stability", "authority"] {
        let all = value[list].as_array_mut().unwrap();
        all.retain(|row| row["speed_m_s"].as_f64().unwrap() <= last);
        assert!(!all.is_empty(), "{list}");
    }
    std::fs::write(design.join("verification.json"), value.to_string()).unwrap();
    design
}

/// One file, whole, self-contained, the same for any number of threads.
#[test]
fn a_report_is_one_file_and_repeatable() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    small_design(here);
    let report = |more: &[&str]| {
        let mut arguments = vec!["report", "small", "--speeds", "0,20 kt", "--quiet"];
        arguments.extend(more);
        program(here, &arguments)
    };
    let first = report(&[]);
    assert_eq!(code(&first), 0, "{}", err(&first));
    assert!(first.stdout.is_empty() && first.stderr.is_empty());
    let html = std::fs::read_to_string(here.join("small/report.html")).unwrap();
    let other = report(&["-o", "other.html", "--threads", "1"]);
    assert_eq!(code(&other), 0, "{}", err(&other));
    assert!(html == std::fs::read_to_string(here.join("other.html")).unwrap());
    // Not replaced unasked.
    assert_eq!(code(&report(&[])), 3);
    // Nothing from elsewhere: the only address names the vocabulary of SVG.
    assert!(html.contains("default-src 'none'"));
    assert_eq!(html.matches("://").count(), html.matches("http://www.w3.org/2000/svg").count());
    for heading in [
        "Summary",
        "Vehicle",
        "Trim",
        "One revolution",
        "Modes in hover",
        "Frequency responses in hover",
        "Control law",
        "Gain schedule",
        "Margins and verification",
        "Provenance",
    ] {
        assert!(html.contains(&format!(">{heading}</h2>")), "{heading}");
    }
    // What the paper prints of the hover is beside ours.
    assert!(html.contains("567.6") && html.contains("37.44"));
    // Every axis of every plot names what it shows.
    for name in ["data-x-name=\"\"", "data-y-name=\"\""] {
        assert!(!html.contains(name), "{name}");
    }
    // Interactions on and off look the same in every figure.
    assert!(html.contains("data-label=\"interactions on\""));
    for part in html.split("data-label=\"interactions on\"").skip(1) {
        assert!(part.split("stroke=\"").nth(1).unwrap().starts_with("#0072b2"));
    }
    for part in html.split("data-label=\"interactions off\"").skip(1) {
        assert!(part.split("stroke=\"").nth(1).unwrap().starts_with("#d55e00"));
    }
}

#[test]
fn a_report_says_what_does_not_belong_together() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let missing = program(here, &["report", "nowhere"]);
    assert_eq!(code(&missing), 2);
    assert!(err(&missing).contains("tune-gains"), "{}", err(&missing));
    let design = small_design(here);
    std::fs::remove_file(design.join("verification.json")).unwrap();
    let other = program(
        here,
        &[
            "report",
            "small",
            "--problem",
            "coax2d-physics",
            "--other-aircraft",
            "--speeds",
            "0 kt",
            "--quiet",
        ],
    );
    assert_eq!(code(&other), 0, "{}", err(&other));
    let html = std::fs::read_to_string(design.join("report.html")).unwrap();
    assert!(html.contains("Not verified."));
    assert!(html.contains("is not the one that the schedule was tuned for"));
    // A broken verification is not passed over.
    std::fs::write(design.join("verification.json"), "{}").unwrap();
    let broken = program(here, &["report", "small", "--force"]);
    assert_eq!(code(&broken), 2);
    assert!(err(&broken).contains("not a verification"), "{}", err(&broken));
}

/// A flight in the design gets its section.
#[test]
fn a_report_shows_the_flights_of_a_design() {
    let directory = tempfile::tempdir().unwrap();
    let design = small_design(directory.path());
    std::fs::create_dir(design.join("simulation")).unwrap();
    let flight = r#"{"schema": "coaxdesign.simulation/1", "maneuver": "A <climb>", "schedule": null,
        "metrics": {"end": {"status": "limit", "state": "phi", "time_s": 2.0},
            "tracking": [{"channel": "climb_rate", "commanded": true, "unit": "m/s",
                "rms": 0.1, "peak": 0.508, "peak_time_s": 1.0}]},
        "history": {"columns": [{"name": "time", "unit": "s"}, {"name": "climb_rate", "unit": "m/s"}],
            "rows": [[0.0, 0.0], [1.0, 0.508], [2.0, null]]}}"#;
    std::fs::write(design.join("simulation/climb.json"), flight).unwrap();
    let run = |force: &str| {
        program(
            directory.path(),
            &["report", "small", "--speeds", "0 kt", "--quiet", "-o", "a.html", force],
        )
    };
    let output = run("--force");
    assert_eq!(code(&output), 0, "{}", err(&output));
    let html = std::fs::read_to_string(directory.path().join("a.html")).unwrap();
    assert!(html.contains(">Manoeuvres</h2>") && html.contains("A &lt;climb&gt;"));
    assert!(html.contains("phi left its bounds"));
    // 0.508 m/s are 100 ft/min.
    assert!(html.contains("<td class=\"number\">100"), "the peak error");
    std::fs::write(design.join("simulation/climb.json"), "{}").unwrap();
    assert_eq!(code(&run("--force")), 2);
}

/// A specification that is tuned in seconds: two speeds, one model, two axes.
const SMALL_SPEC: &str = r#"
[schedule]
speeds = ["0 kt", "10 kt"]

[models.nominal]
class = "nominal"

[margins.nominal]
gain_margin_db = 4.0
phase_margin = "30 deg"

[margins.off_nominal]
gain_margin_db = 3.0
phase_margin = "25 deg"

[axis.roll]
drb = "0.3 rad/s"
drp_db = 6.0

[axis.pitch]
drb = "0.3 rad/s"
drp_db = 6.0

[axis.yaw]
drb = "0.3 rad/s"
drp_db = 6.0

[axis.heave]
drb = "0.3 rad/s"
drp_db = 6.0
"#;

#[test]
fn a_design_runs_what_has_changed_and_nothing_else() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    std::fs::write(here.join("small.toml"), SMALL_SPEC).unwrap();
    let design = |more: &[&str]| {
        let mut arguments =
            vec!["design", "--spec", "small.toml", "-o", "mine", "--speeds", "0,10 kt"];
        arguments.extend(more);
        program(here, &arguments)
    };
    let plan = design(&["--dry-run"]);
    assert_eq!(code(&plan), 0, "{}", err(&plan));
    assert!(!here.join("mine").exists());
    let commands: Vec<&str> =
        out(&plan).lines().filter_map(|line| line.split(' ').nth(1)).collect();
    assert_eq!(commands[..4], ["trim", "linearize", "tune-gains", "simulate"]);
    assert!(commands[4..commands.len() - 1].iter().all(|c| *c == "export"));
    assert_eq!(*commands.last().unwrap(), "report");
    let first = design(&[]);
    assert!(code(&first) <= 1, "{}", err(&first));
    assert!(!out(&first).contains("unchanged"), "{}", out(&first));
    let bytes = |name: &str| std::fs::read(here.join("mine").join(name)).unwrap();
    let files = ["design.json", "trim.json", "models.json", "schedule.json", "report.html"];
    let before: Vec<Vec<u8>> = files.iter().map(|f| bytes(f)).collect();
    // Exports are files of their own, and say what they are.
    let c = std::fs::read_dir(here.join("mine/export/c")).unwrap().count();
    assert!(c >= 2, "{c} files");
    let again = design(&[]);
    assert_eq!(code(&again), code(&first), "an unchanged design keeps its verdict");
    let rows = |output: &Output| out(output).matches(".json").count() + 1;
    assert_eq!(out(&again).matches("unchanged").count(), stages(&plan), "{}", out(&again));
    assert!(rows(&again) > 3);
    // After an interruption before the report: only that is made.
    std::fs::remove_file(here.join("mine/report.html")).unwrap();
    let resumed = design(&[]);
    assert_eq!(out(&resumed).matches("unchanged").count(), stages(&plan) - 1, "{}", out(&resumed));
    for (file, old) in files.iter().zip(&before) {
        assert!(bytes(file) == *old, "{file} is another");
    }
    // The directory holds problem and specification, and says what they are.
    let note: Value = serde_json::from_slice(&bytes("design.json")).unwrap();
    assert_eq!(note["aircraft"]["name"], "coax2d");
    assert_eq!(note["aircraft"]["problem"]["file"], "problem/coax2d.toml");
    assert_eq!(note["specification"]["origin"], "small.toml");
    assert_eq!(bytes("specification.toml"), SMALL_SPEC.as_bytes());
    assert_eq!(note["maneuvers"][0]["file"], "maneuvers/accel-climb-turn.toml");
    // A stage of the design is what its command gives.
    let line = "linearize --speeds 0,10kt --reduce residualize --format json --units si --quiet";
    let alone = program(here, &line.split(' ').collect::<Vec<_>>());
    assert_eq!(alone.stdout, bytes("models.json"));
    // A changed specification leaves the trim alone.
    std::fs::write(here.join("small.toml"), format!("{SMALL_SPEC}\n# Another.\n")).unwrap();
    let changed = design(&[]);
    assert!(code(&changed) <= 1, "{}", err(&changed));
    let line = |output: &Output, stage: &str| {
        out(output).lines().find(|l| l.starts_with(stage)).map(str::to_owned).unwrap()
    };
    assert!(line(&changed, "trim").contains("unchanged"), "{}", out(&changed));
    assert!(!line(&changed, "gains").contains("unchanged"), "{}", out(&changed));
}

fn stages(plan: &Output) -> usize {
    out(plan).lines().count()
}

#[test]
fn equal_things_compare_equal() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let compare = |more: &[&str]| {
        let mut arguments = vec!["compare", "--speeds", "0,40 kt", "--quiet"];
        arguments.extend(more);
        program(here, &arguments)
    };
    let json = compare(&["coax2d", "coax2d", "coax2d-physics", "--format", "json"]);
    assert_eq!(code(&json), 0, "{}", err(&json));
    let value: Value = serde_json::from_str(out(&json)).unwrap();
    let entries = value["entries"].as_array().unwrap();
    assert_eq!(entries[0]["name"], "coax2d (1)");
    assert_eq!(entries[1]["name"], "coax2d (2)");
    for key in ["trim", "modes_in_hover", "blade_pitch_rad_per_unit_of_nu"] {
        assert_eq!(entries[0][key], entries[1][key], "{key}");
        assert_ne!(entries[0][key], entries[2][key], "{key}");
    }
    // With the mass flow of both rotors a coaxial pair needs less power.
    let power = |k: usize| entries[k]["trim"][0]["power_w"].as_f64().unwrap();
    assert!(power(2) < 0.95 * power(0), "{} {}", power(2), power(0));
    // In-phase rigging rolls with less cyclic than opposite rigging.
    let roll = |k: usize| entries[k]["blade_pitch_rad_per_unit_of_nu"][0].as_f64().unwrap();
    assert!(roll(2) < roll(0), "{} {}", roll(2), roll(0));
    let both =
        compare(&["coax2d", "coax2d-physics", "--interactions", "both", "--html", "both.html"]);
    assert_eq!(code(&both), 0, "{}", err(&both));
    assert!(out(&both).contains("coax2d-physics, interactions off"));
    let html = std::fs::read_to_string(here.join("both.html")).unwrap();
    assert!(html.contains("Eigenvalues of the residualised hover models"));
    assert_eq!(code(&compare(&["coax2d"])), 2);
    assert_eq!(code(&compare(&["coax2d", "no-such-thing"])), 3);
}

/// A design beside a problem: margins where there are some.
/// The files with one change each show what that change does alone.
#[test]
fn variants_isolate_one_choice() {
    let directory = tempfile::tempdir().unwrap();
    let variant = |name: &str| {
        root().join(format!("problems/variants/coax2d-{name}.toml")).display().to_string()
    };
    let files = ["in-phase", "total", "apart"].map(variant);
    let mut arguments =
        vec!["compare", "--speeds", "0 kt", "--quiet", "--format", "json", "coax2d"];
    arguments.extend(files.iter().map(String::as_str));
    let json = program(directory.path(), &arguments);
    assert_eq!(code(&json), 0, "{}", err(&json));
    let value: Value = serde_json::from_str(out(&json)).unwrap();
    let entries = value["entries"].as_array().unwrap();
    let power = |k: usize| entries[k]["trim"][0]["power_w"].as_f64().unwrap();
    let roll = |k: usize| entries[k]["blade_pitch_rad_per_unit_of_nu"][0].as_f64().unwrap();
    // Rigging changes what a stick does, and hardly the power of a hover.
    assert!((power(1) / power(0) - 1.0).abs() < 1e-3, "{} {}", power(1), power(0));
    assert!(roll(1) < 0.9 * roll(0), "{} {}", roll(1), roll(0));
    // Shared mass flow is between the paper's model and lone rotors.
    assert!(power(3) < power(2) && power(2) < power(0), "{} {}", power(2), power(3));
}

#[test]
fn a_design_compares_with_its_margins() {
    let directory = tempfile::tempdir().unwrap();
    small_design(directory.path());
    let table = program(
        directory.path(),
        &["compare", "small", "coax2d", "--speeds", "0 kt", "--format", "csv", "--quiet"],
    );
    assert_eq!(code(&table), 0, "{}", err(&table));
    let row = out(&table).lines().find(|l| l.contains("least margin, roll, nominal")).unwrap();
    let cells: Vec<&str> = row.rsplit(',').collect();
    assert!(cells[0].is_empty() && cells[1].parse::<f64>().is_ok(), "{row}");
}

#[test]
fn traces_go_to_standard_error_and_only_on_request() {
    let run = |filter: &str| {
        Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
            .args(["trim", "--speeds", "0 kt", "--interactions", "off", "--format", "csv", "-q"])
            .env("RUST_LOG", filter)
            .output()
            .unwrap()
    };
    let (silent, told) = (run(""), run("coaxdesign=debug"));
    assert!(silent.stderr.is_empty());
    assert!(err(&told).contains("airspeed_m_s=0"), "{}", err(&told));
    // The library tells by itself, level by level.
    let stages = run("coaxdesign=info");
    assert!(err(&stages).contains("trim sweep") && !err(&stages).contains("airspeed_m_s"));
    let iterations = run("coaxdesign::trim=trace");
    assert!(err(&iterations).contains("residual_max="), "{}", err(&iterations));
    assert!(!err(&told).contains('\u{1b}'), "no colours outside a terminal");
    assert_eq!(silent.stdout, told.stdout);
    let version = program(root(), &["--version"]);
    assert!(out(&version).starts_with(concat!("coaxdesign ", env!("CARGO_PKG_VERSION"))));
}
