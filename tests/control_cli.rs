//! `tune-gains` and `verify`, as people and scripts meet them. The aircraft is
//! flown at speeds at which it needs no pilot, so that one axis at a time can
//! be tuned.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use coaxdesign::schedule::Schedule;
use program::{code, command as program, err, out};
use serde_json::Value;

/// A specification at these speeds with these tables behind the margins.
fn specification(directory: &Path, speeds: &str, rest: &str) {
    let text = format!(
        "[schedule]\nspeeds = [{speeds}]\n[margins.nominal]\ngain_margin_db = 6.0\n\
         phase_margin = \"45 deg\"\n{rest}"
    );
    std::fs::write(directory.join("spec.toml"), text).unwrap();
}

const ROLL: &str =
    "[axis.roll]\ndrb = \"0.6 rad/s\"\ndrp_db = 5.0\ncrossover_min = \"1.5 rad/s\"\n";

/// Two speeds, given in the wrong order, one axis: files, tables, exit codes,
/// and what is said of files that exist.
#[test]
fn an_axis_is_tuned_written_and_verified() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    specification(d, "\"64 kt\", \"60 kt\"", ROLL);
    let tune = program(d, "tune-gains --spec spec.toml -o made --explain");
    assert_eq!(code(&tune), 0, "{}{}", out(&tune), err(&tune));
    let text = out(&tune);
    for expected in [
        "Lag law",
        "roll K_D",
        "3 of 3 nominal rows met",
        "Authority",
        "Prices of the targets",
        "binding",
    ] {
        assert!(text.contains(expected), "no '{expected}' in\n{text}");
    }
    assert!(err(&tune).contains("programs solved"), "{}", err(&tune));

    let schedule =
        Schedule::from_json(&std::fs::read_to_string(d.join("made/schedule.json")).unwrap())
            .unwrap();
    assert!(schedule.requirements_met);
    let speeds: Vec<f64> = schedule.points.iter().map(|p| p.speed).collect();
    assert!(speeds.len() == 2 && speeds[0] < speeds[1], "{speeds:?}");
    assert_eq!(schedule.points[0].gains.keys().collect::<Vec<_>>(), ["roll"]);

    let file = std::fs::read_to_string(d.join("made/verification.json")).unwrap();
    let value: Value = serde_json::from_str(&file).unwrap();
    assert_eq!(value["schema"], "coaxdesign.verification/1");
    assert_eq!(value["passed"], true);
    let row = &value["rows"][0];
    for key in [
        "drb_rad_s",
        "drp_db",
        "crossover_rad_s",
        "gm_up_db",
        "pm_deg",
        "disk_margin",
        "design_margin_percent",
    ] {
        assert!(row[key].is_number(), "{key}: {row}");
    }
    assert!(row["binding"].is_string());
    assert!(row["pm_deg"].as_f64().unwrap() >= 45.0);
    assert!(value["prices"].as_array().unwrap().iter().any(|p| p["axis"] == "roll"));

    // An existing design is left alone unless told otherwise.
    let again = program(d, "tune-gains --spec spec.toml -o made --quiet");
    assert_ne!(code(&again), 0);
    assert!(err(&again).contains("schedule.json"), "{}", err(&again));
    assert_eq!(std::fs::read_to_string(d.join("made/verification.json")).unwrap(), file);

    // The same check on the schedule as a file, with the same answer.
    let check = program(d, "verify made --spec spec.toml --format json --quiet");
    assert_eq!(code(&check), 0, "{}", err(&check));
    let checked: Value = serde_json::from_str(out(&check)).unwrap();
    assert_eq!(checked["rows"], value["rows"]);
    assert_eq!(checked["stability"], value["stability"]);
    // Harder than what it was tuned to: the goal is missed, the input is not bad.
    specification(d, "\"60 kt\"", &ROLL.replace("0.6", "2.5"));
    let hard = program(d, "verify made --spec spec.toml --other-spec --quiet");
    assert_eq!(code(&hard), 1, "{}", err(&hard));
    assert!(out(&hard).contains("MISSED") && out(&hard).contains("drb_rad_s"), "{}", out(&hard));
}

/// One model alone, as CSV and with plots: the map says whose margins it shows.
#[test]
fn plots_of_one_model_name_it() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    let models = "[models.plain]\nclass = \"nominal\"\n[models.heavy]\nclass = \"off_nominal\"\n\
                  mass_scale = 1.1\n";
    specification(d, "\"60 kt\"", &format!("{ROLL}{models}"));
    let o = program(
        d,
        "tune-gains --spec spec.toml --nominal-only --axis roll -o made --plots --format csv --quiet",
    );
    assert_eq!(code(&o), 0, "{}{}", out(&o), err(&o));
    let lines: Vec<&str> = out(&o).lines().collect();
    assert!(lines[0].contains("drb_rad_s") && lines.len() == 2, "{}", out(&o));
    let map = std::fs::read_to_string(d.join("made/margins.svg")).unwrap();
    assert!(map.contains("model plain") && !map.contains("all models"));
    for name in ["gains", "sensitivity", "nyquist-roll"] {
        assert!(d.join(format!("made/{name}.svg")).exists(), "{name}");
    }
}

/// A range that ends between two breakpoints, and one without a speed: the
/// design is met, and says where the loops are held to nothing.
#[test]
fn ranges_of_outer_loops_are_said() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    let rest = format!(
        "{ROLL}[axis.pitch]\ndrb = \"0.5 rad/s\"\n[outer.vx]\nspeed_range = [\"0 kt\", \"62 kt\"]\n\
         [outer.vy]\nspeed_range = [\"0 kt\", \"20 kt\"]\n"
    );
    specification(d, "\"60 kt\", \"64 kt\"", &rest);
    let tune = program(d, "tune-gains --spec spec.toml --quiet");
    assert_eq!(code(&tune), 0, "{}{}", out(&tune), err(&tune));
    for said in [
        "vx at 62 kt is held to no requirement: its gains fade to the next breakpoint",
        "vy is held to no requirement: no speed that is looked at lies in its range",
    ] {
        assert!(out(&tune).contains(said), "no '{said}' in\n{}", out(&tune));
    }
}

/// A bandwidth beyond the hardware: a design all the same, marked, with what
/// could be had.
#[test]
fn unattainable_targets_are_explained() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    specification(d, "\"60 kt\"", &ROLL.replace("0.6", "3.0"));
    let tune = program(d, "tune-gains --spec spec.toml -o made --quiet");
    assert_eq!(code(&tune), 1, "{}", err(&tune));
    assert!(tune.stderr.is_empty(), "{}", err(&tune));
    let text = out(&tune);
    for said in [
        "the targets cannot all be met here",
        "can be had with the others held, bound by",
        "The key is axis.roll.drb, try \"",
    ] {
        assert!(text.contains(said), "no '{said}' in\n{text}");
    }
    assert!(text.contains("least-violating design"), "{text}");
    let schedule =
        Schedule::from_json(&std::fs::read_to_string(d.join("made/schedule.json")).unwrap())
            .unwrap();
    assert!(!schedule.requirements_met);
    let value: Value =
        serde_json::from_str(&std::fs::read_to_string(d.join("made/verification.json")).unwrap())
            .unwrap();
    let targets = value["explanations"][0]["targets"].as_array().unwrap();
    let drb = targets.iter().find(|t| t["target"] == "drb").unwrap();
    assert_eq!(drb["asked"], 3.0);
    assert_eq!((&drb["missed"], &drb["class"]), (&true.into(), &"nominal".into()));
    assert!(value["prices"].as_array().unwrap().iter().all(|p| p["axis"] != "roll"), "{value}");
    // The lag law: about 0.110 over an equivalent delay near 0.12 s.
    let best = drb["attainable"].as_f64().unwrap();
    assert!((0.6..1.3).contains(&best), "{best}");
    // What it says to write makes a design that is met.
    let written = drb["set_to"].as_str().unwrap().trim_matches('"').to_string();
    specification(d, "\"60 kt\"", &ROLL.replace("0.6 rad/s", &written));
    let again = program(d, "tune-gains --spec spec.toml --quiet");
    assert_eq!(code(&again), 0, "{written}\n{}{}", out(&again), err(&again));
}

/// What is wrong with a specification is said before anything is computed.
#[test]
fn bad_specifications_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    let refused = |rest: &str, expected: &str| {
        specification(d, "\"60 kt\"", rest);
        let o = program(d, "tune-gains --spec spec.toml --quiet");
        assert_eq!(code(&o), 2, "{}", err(&o));
        assert!(o.stdout.is_empty());
        assert!(err(&o).contains(expected), "no '{expected}' in\n{}", err(&o));
    };
    refused("[axis]\n", "nothing to tune");
    refused("[axis.roll]\ndrb = \"0.6 ft\"\n", "rad/s");
    refused("[axis.rol]\ndrb = \"0.6 rad/s\"\n", "roll");
    refused(
        "[axis.roll]\ncrossover_min = \"3 rad/s\"\ncrossover_max = \"2 rad/s\"\n",
        "not below the largest",
    );
    let missing = program(d, "tune-gains --spec nowhere.toml --quiet");
    assert_eq!(code(&missing), 3);
    assert!(err(&missing).contains("problems/hq.toml"), "{}", err(&missing));
    // No gains of an axis that is not in the specification.
    specification(d, "\"60 kt\"", ROLL);
    let other = program(d, "tune-gains --spec spec.toml --axis vx --quiet");
    assert_eq!(code(&other), 2);
    assert!(err(&other).contains("none of the axes asked for"), "{}", err(&other));
    std::fs::write(d.join("schedule.json"), "{}").unwrap();
    let no_schedule = program(d, "verify schedule.json --spec spec.toml --quiet");
    assert_eq!(code(&no_schedule), 2);
    assert!(err(&no_schedule).contains("tune-gains -o"), "{}", err(&no_schedule));
}

/// Sensors and actuators far too slow for hover: no gains stabilise it, and
/// the message says where and how fast it diverges.
#[test]
fn an_unstabilisable_model_is_named() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    let rest = format!(
        "[hardware]\ndelay = \"1 s\"\nactuator_bandwidth = \"0.5 rad/s\"\n{ROLL}\
         [axis.pitch]\n[axis.yaw]\n[axis.heave]\n"
    );
    specification(d, "\"0 kt\"", &rest);
    let o = program(d, "tune-gains --spec spec.toml --quiet");
    assert_eq!(code(&o), 2, "{}{}", out(&o), err(&o));
    assert!(err(&o).contains("no start stabilises model 'nominal'"), "{}", err(&o));
}
