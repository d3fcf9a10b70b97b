//! The directory of a design is the unit of work: it holds its aircraft and its
//! specification, moves, and has one writer at a time.

#[path = "common/program.rs"]
mod program;

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use coaxdesign::pipeline::DirectoryLock;
use program::{code, command, err, out};
use serde_json::Value;

const SPECIFICATION: &str = "[schedule]\nspeeds = [\"60 kt\", \"64 kt\"]\n\
    [margins.nominal]\ngain_margin_db = 4.0\nphase_margin = \"35 deg\"\n\
    [axis.roll]\ndrb = \"0.4 rad/s\"\ndrp_db = 6.0\n";

/// A design of the starter's aircraft, made in `made`.
fn made(here: &Path) -> PathBuf {
    assert_eq!(code(&command(here, "new mine.toml")), 0);
    std::fs::write(here.join("spec.toml"), SPECIFICATION).unwrap();
    let tuned = command(here, "tune-gains mine.toml --spec spec.toml -o made --quiet");
    assert!(code(&tuned) <= 1, "{}", err(&tuned));
    assert!(out(&tuned).contains("aircraft starter, specification spec.toml"), "{}", out(&tuned));
    here.join("made")
}

fn text(path: PathBuf) -> String {
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn a_design_moves_with_all_that_made_it() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let design = made(here);
    let kept = [text(design.join("schedule.json")), text(design.join("design.json"))];
    std::fs::remove_file(here.join("mine.toml")).unwrap();
    std::fs::remove_file(here.join("spec.toml")).unwrap();
    std::fs::create_dir(here.join("elsewhere")).unwrap();
    std::fs::rename(&design, here.join("elsewhere/moved")).unwrap();
    let there = here.join("elsewhere");

    let checked = command(&there, "verify moved --format json --quiet");
    assert!(code(&checked) <= 1, "{}", err(&checked));
    let (checked, known) =
        (json(out(&checked)), json(&text(there.join("moved/verification.json"))));
    assert_eq!(checked["rows"], known["rows"]);
    assert_eq!(checked["stability"], known["stability"]);
    let head = ["design", "aircraft", "problem", "specification"].map(|key| &checked[key]);
    assert_eq!(head, ["moved", "starter", "mine.toml", "spec.toml"]);

    // What takes an aircraft takes that of the design.
    let trim = command(&there, "trim moved --speeds 60kt --interactions on --quiet");
    assert_eq!(code(&trim), 0, "{}", err(&trim));
    assert!(out(&trim).starts_with("starter: periodic trim"), "{}", out(&trim));

    // Tuned again it keeps aircraft and specification, to the byte.
    let again = command(&there, "tune-gains -o moved --quiet");
    assert_eq!(code(&again), 3, "{}", err(&again));
    let again = command(&there, "tune-gains -o moved --force --quiet");
    assert!(code(&again) <= 1, "{}", err(&again));
    let now = ["schedule.json", "design.json"].map(|name| text(there.join("moved").join(name)));
    assert_eq!(now, kept);

    // A file of the design that is edited is noticed, with both hashes.
    let problem = there.join("moved/problem/mine.toml");
    std::fs::write(&problem, text(problem.clone()) + "\n# Another.\n").unwrap();
    let changed = command(&there, "verify moved");
    assert_eq!(code(&changed), 2);
    assert!(err(&changed).contains("has changed since the design was made"), "{}", err(&changed));
}

/// A schedule whose aircraft and specification are gone is not replaced by one for
/// the built-in ones that nobody named.
#[test]
fn a_schedule_without_its_inputs_is_not_replaced_by_another_aircrafts() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let design = made(here);
    let kept = text(design.join("schedule.json"));
    std::fs::remove_file(design.join("design.json")).unwrap();
    let tune = |more: &str| command(here, &format!("tune-gains {more} -o made --force --quiet"));
    for (more, said) in [
        ("", "was made for 'starter'"),
        ("--spec spec.toml", "name its problem file"),
        ("mine.toml", "tuned to a specification"),
    ] {
        let refused = tune(more);
        assert_eq!(code(&refused), 2, "{more}");
        assert!(err(&refused).contains(said), "{more}: {}", err(&refused));
        assert_eq!(text(design.join("schedule.json")), kept);
    }
    assert!(code(&tune("mine.toml --spec spec.toml")) <= 1);
    assert_eq!(text(design.join("schedule.json")), kept);
}

#[test]
fn another_aircraft_or_specification_is_refused_unless_asked_for() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let design = made(here);
    let note = json(&text(design.join("design.json")));
    let hash = note["aircraft"]["problem"]["hash"].as_str().unwrap().to_string();
    for line in [
        "verify made --problem coax2d",
        "simulate made --problem coax2d -m hover-turn",
        "identify made --problem coax2d --speed 60kt",
        "report made --problem coax2d -o a.html",
        "montecarlo made --problem coax2d -m hover-turn --runs 1",
    ] {
        let refused = command(here, line);
        assert_eq!(code(&refused), 2, "{line}\n{}", err(&refused));
        for told in ["starter", "coax2d", &hash, "--other-aircraft", "tune-gains"] {
            assert!(err(&refused).contains(told), "{line}: no {told} in\n{}", err(&refused));
        }
    }
    let other = command(here, "verify made --problem coax2d --other-aircraft --quiet");
    assert!(code(&other) <= 1 && out(&other).contains("aircraft coax2d"), "{}", out(&other));

    let harder = SPECIFICATION.replace("0.4", "2.5");
    std::fs::write(here.join("harder.toml"), harder).unwrap();
    let refused = command(here, "verify made --spec harder.toml");
    assert_eq!(code(&refused), 2);
    assert!(err(&refused).contains("--other-spec"), "{}", err(&refused));
    let missed = command(here, "verify made --spec harder.toml --other-spec --quiet");
    assert_eq!(code(&missed), 1, "{}", err(&missed));
    assert!(out(&missed).contains("specification harder.toml"), "{}", out(&missed));

    // A schedule that does not hold its aircraft gets none by default.
    std::fs::create_dir(here.join("old")).unwrap();
    std::fs::copy(design.join("schedule.json"), here.join("old/schedule.json")).unwrap();
    let old = command(here, "verify old");
    assert_eq!(code(&old), 2);
    assert!(err(&old).contains("does not hold its aircraft"), "{}", err(&old));
    let named = command(here, "verify old --problem mine.toml --spec spec.toml --quiet");
    assert!(code(&named) <= 1, "{}", err(&named));
}

#[test]
fn a_directory_has_one_writer() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    std::fs::create_dir(here.join("made")).unwrap();
    std::fs::write(here.join("spec.toml"), SPECIFICATION).unwrap();
    let lock = DirectoryLock::acquire(&here.join("made"), "coaxdesign first").unwrap();
    for line in ["tune-gains --spec spec.toml -o made", "design --spec spec.toml -o made"] {
        let second = command(here, line);
        assert_eq!(code(&second), 2, "{}", err(&second));
        let told = err(&second);
        assert!(told.contains("`coaxdesign first`, since 2"), "{told}");
        assert!(told.contains(&format!("process {}", std::process::id())), "{told}");
    }
    drop(lock);
    assert_eq!(std::fs::read_dir(here.join("made")).unwrap().count(), 0);
}

#[test]
fn what_a_killed_command_left_is_cleaned_at_the_next_run() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let left = [here.join(".coaxdesign-left"), here.join(".coaxdesign-busy")];
    let files = left.clone().map(|path| {
        let file = std::fs::File::create(path).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(60)).unwrap();
        file
    });
    // The second belongs to a command at work.
    files[1].lock().unwrap();
    assert_eq!(code(&command(here, "new mine.toml")), 0);
    assert!(!left[0].exists() && left[1].exists());
}
