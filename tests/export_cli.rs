//! `coaxdesign export` and `import`, as people and scripts meet them.

#[path = "common/program.rs"]
mod program;

use std::path::{Path, PathBuf};

use coaxdesign::export::{Format, schema};
use coaxdesign::schedule::Schedule;
use coaxdesign::schedule::sample;
use coaxdesign::units::KNOT;
use program::{code, command as program, err, out};

/// A directory with the sample as a design; `met` as its requirements.
fn design(met: bool) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let schedule = Schedule { requirements_met: met, ..sample::schedule() };
    std::fs::create_dir(directory.path().join("d")).unwrap();
    std::fs::write(directory.path().join("d/schedule.json"), schedule.to_json().unwrap()).unwrap();
    directory
}

fn names(directory: PathBuf) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(directory)
        .map(|list| list.map(|e| e.unwrap().file_name().into_string().unwrap()).collect())
        .unwrap_or_default();
    names.sort();
    names
}

#[test]
fn the_list_names_every_format_and_its_client() {
    let list = program(Path::new("."), "export --list");
    assert_eq!(code(&list), 0);
    for about in Format::ALL {
        let line = out(&list).lines().find(|l| l.starts_with(&format!("{} ", about.name))).unwrap();
        assert!(line.contains(about.proven_in) && line.contains(about.files), "{line}");
    }
    assert_eq!(code(&program(Path::new("."), "export")), 2);
    let wrong = program(Path::new("."), "export x --to jsbsin");
    assert_eq!(code(&wrong), 2);
    assert!(err(&wrong).contains("jsbsim"), "{}", err(&wrong));
}

/// Every format writes exactly the files that the list names, the same bytes
/// each time, and says inside where it came from.
#[test]
fn every_format_writes_its_files_and_only_those() {
    let home = design(true);
    for about in Format::ALL {
        let form = about.name;
        let run = |to: &str| {
            let done = program(home.path(), &format!("export d --to {form} -o {to}"));
            assert_eq!(code(&done), 0, "{form}: {}", err(&done));
            assert!(done.stderr.is_empty(), "{}", err(&done));
        };
        run(&format!("{form}1"));
        run(&format!("{form}2"));
        let files = names(home.path().join(format!("{form}1")));
        let mut told: Vec<String> =
            about.files.split(", ").map(|f| f.replace("NAME", "sample")).collect();
        told.sort();
        assert_eq!(files, told, "{form}");
        for file in &files {
            let read =
                |n: u8| std::fs::read(home.path().join(format!("{form}{n}")).join(file)).unwrap();
            assert_eq!(read(1), read(2), "{form}: {file}");
            let text = String::from_utf8_lossy(&read(1)).into_owned();
            assert!(!text.contains("WARNING"), "{form}: {file}");
        }
        if form != "vectors" {
            let whole: Vec<u8> = files
                .iter()
                .flat_map(|f| std::fs::read(home.path().join(format!("{form}1")).join(f)).unwrap())
                .collect();
            // Texts in MAT files are of 16 bit.
            let text: String = whole.iter().filter(|b| **b != 0).map(|b| char::from(*b)).collect();
            let hash = &sample::schedule().provenance.problem_hash;
            assert!(text.contains(hash.as_str()), "{form} does not say where it came from");
        }
    }
}

/// What is not known to meet its requirements is refused, unless the user says
/// so; then every artefact says so, too.
#[test]
fn unmet_requirements_are_refused_or_said() {
    let home = design(false);
    for about in Format::ALL {
        let form = about.name;
        let refused = program(home.path(), &format!("export d --to {form} -o {form}"));
        assert_eq!(code(&refused), 2);
        assert!(err(&refused).contains("--unverified"), "{}", err(&refused));
        assert!(!home.path().join(form).exists());
        let done = program(home.path(), &format!("export d --to {form} -o {form} --unverified"));
        assert_eq!(code(&done), 0, "{}", err(&done));
        assert!(err(&done).contains("warning"), "{}", err(&done));
        if form == "vectors" {
            continue;
        }
        for file in names(home.path().join(form)) {
            let bytes = std::fs::read(home.path().join(form).join(&file)).unwrap();
            let text: String = bytes.iter().filter(|b| **b != 0).map(|b| char::from(*b)).collect();
            let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(words.contains("not known to meet its requirements"), "{form}: {file}");
        }
    }
}

#[test]
fn another_schema_is_refused_or_said() {
    let home = design(true);
    let path = home.path().join("d/schedule.json");
    let text = std::fs::read_to_string(&path).unwrap().replace("schedule/1", "schedule/2");
    std::fs::write(&path, text).unwrap();
    let refused = program(home.path(), "export d --to c -o c");
    assert_eq!(code(&refused), 2);
    assert!(err(&refused).contains("schedule/2"), "{}", err(&refused));
    let done = program(home.path(), "export d --to c -o c --unverified");
    assert_eq!(code(&done), 0, "{}", err(&done));
    let header = std::fs::read_to_string(home.path().join("c/sample_law.h")).unwrap();
    assert!(header.contains("WARNING") && header.contains("schedule/2"));
}

#[test]
fn files_that_are_there_stay_as_they_are() {
    let home = design(true);
    let there = home.path().join("o/sample_law.c");
    std::fs::create_dir(home.path().join("o")).unwrap();
    std::fs::write(&there, "mine").unwrap();
    let refused = program(home.path(), "export d --to c -o o");
    assert_eq!(code(&refused), 3);
    assert!(err(&refused).contains("--force"), "{}", err(&refused));
    assert_eq!(names(home.path().join("o")), ["sample_law.c"]);
    assert_eq!(std::fs::read_to_string(&there).unwrap(), "mine");
    let done = program(home.path(), "export d --to c -o o --force");
    assert_eq!(code(&done), 0, "{}", err(&done));
    assert_eq!(names(home.path().join("o")), ["sample_law.c", "sample_law.h"]);
    assert_ne!(std::fs::read_to_string(&there).unwrap(), "mine");
}

#[test]
fn bad_arguments_are_said_in_the_users_terms() {
    let home = design(true);
    std::fs::write(home.path().join("broken.json"), "{").unwrap();
    for (arguments, exit, needle) in [
        ("export none --to c -o o", 3, "none"),
        ("export broken.json --to c -o o", 2, "broken.json"),
        ("export d --to c", 2, "-o DIR"),
        ("export d --to c -o o --step 0s", 2, "step"),
        ("export d --to c -o o --step 1e-6s", 2, "it must be from 0.0001 s"),
        ("export d --to c -o o --step 1kt", 2, "--step"),
        ("export d --to c -o o --name 2x", 2, "2x"),
        ("export d --to fmu -o o --cc no-such-compiler", 3, "no-such-compiler"),
        ("import d/schedule.xml", 2, ".csv"),
        ("import none.csv", 3, "none.csv"),
        ("import broken.json", 2, "broken.json"),
    ] {
        let done = program(home.path(), arguments);
        assert_eq!(code(&done), exit, "{arguments}: {}", err(&done));
        assert!(err(&done).contains(needle), "{arguments}: {}", err(&done));
        assert!(!home.path().join("o").exists());
    }
    // A single text goes to standard output.
    let done = program(home.path(), "export d/schedule.json --to json");
    assert_eq!(code(&done), 0);
    assert!(out(&done).starts_with('{'));
}

/// Out and back through every form that can be read, then out again: the same
/// bytes but for what says where it came from.
#[test]
fn exports_are_imported_and_used_like_our_own() {
    let home = design(true);
    let original = program(home.path(), "export d --to vectors -o v");
    assert_eq!(code(&original), 0);
    let steps = std::fs::read(home.path().join("v/sample_steps.csv")).unwrap();
    for (form, file) in [
        ("json", "sample.json"),
        ("csv", "sample.csv"),
        ("toml", "sample.toml"),
        ("matlab", "sample.mat"),
    ] {
        let done = program(home.path(), &format!("export d --to {form} -o {form}"));
        assert_eq!(code(&done), 0, "{}", err(&done));
        let done = program(home.path(), &format!("import {form}/{file} -o {form}_back"));
        assert_eq!(code(&done), 0, "{form}: {}", err(&done));
        // What was imported is not verified.
        let refused = program(home.path(), &format!("export {form}_back --to c -o c"));
        assert_eq!(code(&refused), 2);
        let done = program(
            home.path(),
            &format!("export {form}_back --to vectors -o {form}_v --unverified"),
        );
        assert_eq!(code(&done), 0, "{}", err(&done));
        let again = std::fs::read(home.path().join(format!("{form}_v/sample_steps.csv"))).unwrap();
        assert_eq!(again, steps, "{form}");
    }
    let csv = "quantity,row,column,speed,unit,value\ngains,roll,k_p,20 kt,1/s^2,2.5\n";
    std::fs::write(home.path().join("hand.csv"), csv).unwrap();
    let done = program(home.path(), "import hand.csv --base d -o hand");
    assert_eq!(code(&done), 0, "{}", err(&done));
    assert!(err(&done).contains("decoupling"), "{}", err(&done));
    let text = std::fs::read_to_string(home.path().join("hand/schedule.json")).unwrap();
    let schedule = Schedule::from_json(&text).unwrap();
    // The base's breakpoints stay, and the one that is new joins them.
    let base = std::fs::read_to_string(home.path().join("d/schedule.json")).unwrap();
    let base = Schedule::from_json(&base).unwrap();
    assert!(err(&done).contains("kept from the base: "), "{}", err(&done));
    let edited: Vec<f64> =
        schedule.points.iter().filter(|p| p.gains["roll"].k_p == 2.5).map(|p| p.speed).collect();
    assert_eq!(edited.len(), 1);
    assert!((edited[0] - 20.0 * KNOT).abs() < 1e-3);
    for point in &base.points {
        assert!(schedule.points.iter().any(|p| p.speed == point.speed));
    }
    // Nothing is replaced unasked.
    let again = program(home.path(), "import hand.csv --base d -o hand");
    assert_eq!(code(&again), 3);
}

/// The published schemas are those that the program writes.
#[test]
fn published_schemas_are_up_to_date() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schemas");
    for (name, text) in schema::files() {
        let published = std::fs::read_to_string(folder.join(name)).unwrap_or_default();
        assert!(published == text, "write docs/schemas/{name} anew with `coaxdesign schema --of`");
    }
    let done = program(Path::new("."), "schema --of schedule");
    assert_eq!(out(&done), schema::files()[0].1);
}
