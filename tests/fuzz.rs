//! Every reader on damaged, random and absurd input: it answers with a value
//! whose numbers are finite, or with an error in the user's terms, and never
//! panics.
//!
//! `cargo test` tries a few inputs of each; `COAXDESIGN_FUZZ_SECONDS=600 cargo
//! test --test fuzz -- --nocapture` tries new ones for ten minutes each and says
//! how many.

#[path = "common/sets.rs"]
mod sets;

use std::time::Instant;

use coaxdesign::control::spec;
use coaxdesign::export::import::{Breakpoints, Source, import};
use coaxdesign::export::{Description, Format, Options, Precision, export};
use coaxdesign::linear::io::{set_to_json, set_to_mat};
use coaxdesign::lti;
use coaxdesign::lti::mapping::Mapping;
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::pipeline::Requirements;
use coaxdesign::pipeline::directory::{DesignInputs, NOTE, Note};
use coaxdesign::problem::{self, Report, c81, fuselage_table};
use coaxdesign::schedule::Schedule;
use coaxdesign::schedule::sample;
use coaxdesign::simulate::maneuver;
use coaxdesign::units::{Kind, System, parse_quantity};
use coaxdesign::vehicle::Vehicle;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestCaseResult, TestRunner};

/// Inputs of each reader in a plain run.
const CASES: u32 = 48;

/// Tries inputs until the time is up, a few of them without one.
fn fuzz<S: Strategy>(name: &str, inputs: &S, answer: impl Fn(S::Value) -> TestCaseResult) {
    let seconds: Option<f64> =
        std::env::var("COAXDESIGN_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    let config = |cases| Config { cases, failure_persistence: None, ..Config::default() };
    let Some(seconds) = seconds else {
        if let Err(error) = TestRunner::new(config(CASES)).run(inputs, answer) {
            panic!("{name}: {error}");
        }
        return;
    };
    let begun = Instant::now();
    let mut count = 0u64;
    while begun.elapsed().as_secs_f64() < seconds {
        // Each runner draws seeds of its own.
        if let Err(error) = TestRunner::new(config(256)).run(inputs, &answer) {
            panic!("{name}: after {count} inputs: {error}");
        }
        count += 256;
    }
    eprintln!("{name}: {count} inputs without a finding");
}

/// Numbers that readers meet in anger.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "-1",
    "1",
    "1e9",
    "-1e9",
    "1e300",
    "-1e300",
    "1e308",
    "1e999",
    "5e-324",
    "1e-12",
    "nan",
    "inf",
    "-inf",
    "NaN",
    "null",
    "99999999999999999999",
    "0x10",
    "1_000",
    ".5",
    "-.5",
    "",
    "true",
];
/// Texts that readers meet in anger.
const TEXTS: [&str; 20] = [
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    ",",
    "\n",
    "\r\n",
    "\t",
    "\0",
    "\u{1b}[2J",
    "\u{feff}",
    "@PLACES@",
    "*/",
    "\u{202e}",
    "ü",
    "[[",
    "\"\"\"",
];

/// One damage to a text.
#[derive(Debug, Clone)]
enum Damage {
    /// The how manieth number is replaced.
    Number(usize, usize),
    /// A text goes in somewhere.
    Insert(usize, usize),
    /// Anything goes in somewhere.
    Junk(usize, String),
    /// A line is gone, stands twice, or changes its place.
    Drop(usize),
    Twice(usize),
    Swap(usize, usize),
    /// The text ends.
    Cut(usize),
    /// A quoted text is replaced.
    Quoted(usize, String),
}

fn damage() -> impl Strategy<Value = Vec<Damage>> {
    let place = any::<prop::sample::Index>().prop_map(|index| index.index(1 << 20));
    let one = prop_oneof![
        6 => (place.clone(), 0..NUMBERS.len()).prop_map(|(at, n)| Damage::Number(at, n)),
        2 => (place.clone(), 0..TEXTS.len()).prop_map(|(at, n)| Damage::Insert(at, n)),
        2 => (place.clone(), "\\PC{0,12}").prop_map(|(at, text)| Damage::Junk(at, text)),
        1 => place.clone().prop_map(Damage::Drop),
        1 => place.clone().prop_map(Damage::Twice),
        1 => (place.clone(), place.clone()).prop_map(|(a, b)| Damage::Swap(a, b)),
        1 => place.clone().prop_map(Damage::Cut),
        2 => (place, "[ -~]{0,20}").prop_map(|(at, text)| Damage::Quoted(at, text)),
    ];
    prop::collection::vec(one, 1..5)
}

/// Where numbers stand in a text.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let is = |b: u8| b.is_ascii_digit() || b == b'.';
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        if is(bytes[at]) {
            let end = (at..bytes.len()).find(|&k| !is(bytes[k])).unwrap_or(bytes.len());
            found.push((at, end));
            at = end;
        } else {
            at += 1;
        }
    }
    found
}

fn apply(text: &str, damages: &[Damage]) -> String {
    let mut text = text.to_string();
    for damage in damages {
        let boundary = |at: usize| {
            let mut at = at % (text.len() + 1);
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            at
        };
        let lines = || text.lines().map(String::from).collect::<Vec<_>>();
        match damage {
            Damage::Number(which, number) => {
                let places = numbers(&text);
                if !places.is_empty() {
                    let (from, to) = places[which % places.len()];
                    text.replace_range(from..to, NUMBERS[*number]);
                }
            }
            Damage::Insert(at, which) => {
                let at = boundary(*at);
                text.insert_str(at, TEXTS[*which]);
            }
            Damage::Junk(at, junk) => {
                let at = boundary(*at);
                text.insert_str(at, junk);
            }
            Damage::Cut(at) => {
                let at = boundary(*at);
                text.truncate(at);
            }
            Damage::Quoted(which, with) => {
                let quotes: Vec<usize> = text.match_indices('"').map(|(at, _)| at).collect();
                if let Some(pair) = quotes.chunks_exact(2).nth(which % (quotes.len() / 2).max(1)) {
                    let (from, to) = (pair[0] + 1, pair[1]);
                    text.replace_range(from..to, with);
                }
            }
            Damage::Drop(at) | Damage::Twice(at) => {
                let mut all = lines();
                if !all.is_empty() {
                    let at = at % all.len();
                    if matches!(damage, Damage::Drop(_)) {
                        all.remove(at);
                    } else {
                        all.insert(at, all[at].clone());
                    }
                    text = all.join("\n");
                }
            }
            Damage::Swap(a, b) => {
                let mut all = lines();
                if !all.is_empty() {
                    let count = all.len();
                    all.swap(a % count, b % count);
                    text = all.join("\n");
                }
            }
        }
    }
    text
}

/// One of some texts, damaged; or lines of keys and values that mean nothing.
fn damaged(bases: Vec<String>) -> impl Strategy<Value = String> {
    let keys = "[a-z_]{1,8}( = |=)(\"[ -~]{0,12}\"|-?[0-9]{1,20}(\\.[0-9]{0,6})?(e-?[0-9]{1,3})?|\\{\\}|\\[\\])";
    let random =
        prop::collection::vec(prop_oneof![keys, "\\[[a-z.]{0,16}\\]", "\\PC{0,30}"], 0..20);
    prop_oneof![
        8 => (any::<prop::sample::Index>(), damage())
            .prop_map(move |(which, damages)| apply(&bases[which.index(bases.len())], &damages)),
        1 => random.prop_map(|lines| lines.join("\n")),
    ]
}

/// A report is something to read, and nothing that a terminal obeys.
fn readable(report: &Report) -> TestCaseResult {
    prop_assert!(!report.errors.is_empty());
    let text = report.to_string();
    prop_assert!(!text.contains(|c: char| c.is_control() && c != '\n' && c != '\t'), "{:?}", text);
    Ok(())
}

fn finite(what: &str, debug: &str) -> TestCaseResult {
    let bad = ["NaN", "inf"].iter().find(|bad| {
        debug.match_indices(**bad).any(|(at, found)| {
            let before = debug[..at].chars().next_back().unwrap_or(' ');
            let after = debug[at + found.len()..].chars().next().unwrap_or(' ');
            !before.is_alphanumeric()
                && !after.is_alphanumeric()
                && before != '_'
                && after != '_'
                && before != '"'
        })
    });
    prop_assert!(bad.is_none(), "{} is not finite: {}", what, debug);
    Ok(())
}

#[test]
fn problem_files() {
    let bases = [
        include_str!("../problems/coax2d.toml"),
        include_str!("../problems/coax2d-physics.toml"),
        include_str!("../examples/light-helicopter.toml"),
    ];
    let long = std::env::var_os("COAXDESIGN_FUZZ_SECONDS").is_some();
    let tried = std::cell::Cell::new(0u32);
    fuzz("problem files", &damaged(bases.map(String::from).to_vec()), |text| {
        match problem::parse_beside_builtin("fuzzed.toml", &text) {
            Err(report) => readable(&report)?,
            Ok(loaded) => {
                // Table data take most of a problem: everything but those.
                finite(
                    "problem",
                    &format!("{:?} {:?}", loaded.problem.mass, loaded.problem.controls),
                )?;
                tried.set(tried.get() + 1);
                if long && tried.get().is_multiple_of(16) {
                    flown(&loaded.problem)?;
                }
            }
        }
        Ok(())
    });
}

/// A problem that reads makes a vehicle or says why not, and trims or says why
/// not.
fn flown(problem: &problem::Problem) -> TestCaseResult {
    use coaxdesign::trim::{FlightCondition, Guess, Options, trim};
    let mut problem = problem.clone();
    problem.inflow.interactions = false;
    let Ok(vehicle) = Vehicle::new(&problem) else { return Ok(()) };
    let condition = FlightCondition::level(20.0);
    let guess = Guess::estimate(&vehicle, &condition);
    let point = trim(&vehicle, condition, &guess, &Options::default());
    if point.on_orbit() {
        prop_assert!(point.power.shaft.is_finite());
        prop_assert!(point.sticks.iter().all(|stick| stick.is_finite()));
    }
    Ok(())
}

#[test]
fn c81_tables() {
    let bases = vec![
        include_str!("../problems/airfoils/naca23012.c81").to_string(),
        include_str!("data/bad/files/sound.c81").to_string(),
    ];
    fuzz("C81 tables", &damaged(bases), |text| {
        match c81::read(&text) {
            Err(error) => prop_assert!(error.line >= 1 && !error.message.is_empty()),
            Ok(read) => {
                let lines = text.lines().count();
                prop_assert!(read.remarks.iter().all(|r| (1..=lines).contains(&r.line)));
                for grid in [&read.table.lift, &read.table.drag, &read.table.moment] {
                    let whole = grid.angle_of_attack.len() * grid.mach.len();
                    prop_assert_eq!(grid.value.len(), whole);
                    prop_assert!(grid.value.iter().all(|value| value.is_finite()));
                }
                let airfoil = problem::Airfoil::Table(std::sync::Arc::new(read.table));
                if let Ok(section) = coaxdesign::vehicle::airfoil::Section::new(&airfoil) {
                    for (angle, mach) in [(0.0, 0.3), (3.0, 0.0), (-3.1, 1.5), (0.2, 0.9)] {
                        let c = section.coefficients(angle, mach);
                        prop_assert!(c.lift.is_finite() && c.drag.is_finite());
                        prop_assert!(!section.stall_fraction(angle, mach).is_nan());
                    }
                }
            }
        }
        Ok(())
    });
}

#[test]
fn fuselage_tables() {
    let mut base = String::from("alpha_deg,beta_deg,x_ft2,y_ft2,z_ft2,l_ft3,m_ft3,n_ft3\n");
    for alpha in [-90, 0, 90] {
        for beta in [-90, 0, 90] {
            base += &format!("{alpha},{beta},-14.5,0.5,-2,0,1e1,0\n");
        }
    }
    fuzz("fuselage tables", &damaged(vec![base]), |text| {
        match fuselage_table::read(&text) {
            Err(error) => prop_assert!(error.line >= 1 && !error.help.is_empty()),
            Ok(read) => {
                let whole = read.table.angle_of_attack.len() * read.table.sideslip.len();
                for load in &read.table.loads {
                    prop_assert_eq!(load.len(), whole);
                    prop_assert!(load.iter().all(|value| value.abs() < 1e6));
                }
            }
        }
        Ok(())
    });
}

#[test]
fn specifications() {
    fuzz("specifications", &damaged(vec![spec::BUILTIN.to_string()]), |text| {
        match spec::parse("fuzzed.toml", &text) {
            Err(report) => readable(&report)?,
            Ok(spec) => {
                prop_assert!(!spec.speeds.is_empty());
                prop_assert!(spec.solver.grid.iter().all(|w| w.is_finite() && *w > 0.0));
                finite("specification", &format!("{:?} {:?}", spec.law, spec.hardware))?;
            }
        }
        Ok(())
    });
}

#[test]
fn maneuvers() {
    let bases = maneuver::BUILTIN.iter().map(|(_, text)| (*text).to_string()).collect();
    fuzz("manoeuvres", &damaged(bases), |text| {
        match maneuver::parse("fuzzed.toml", &text) {
            Err(report) => readable(&report)?,
            Ok(flown) => {
                // Of texts only the title is free.
                let numbers = maneuver::Maneuver { title: "title".into(), ..flown.clone() };
                finite("manoeuvre", &format!("{numbers:?}"))?;
                let held =
                    maneuver::Held { velocity: [1.0; 3], attitude: [0.1; 2], turn_rate: 0.0 };
                for k in 0..200 {
                    let time = flown.duration * f64::from(k) / 199.0;
                    prop_assert!(flown.inputs(time).iter().all(|stick| stick.is_finite()));
                    finite("demand", &format!("{:?}", flown.demand(time, &held)))?;
                }
            }
        }
        Ok(())
    });
}

/// Whatever a schedule's text holds: it is refused, or every export of it is
/// finite.
#[test]
fn schedules() {
    let base = sample::schedule().to_json().unwrap();
    let options = Options {
        name: "law".into(),
        step: 0.05,
        precision: Precision::Double,
        speed: 0.0,
        binaries: Vec::new(),
    };
    fuzz("schedules", &damaged(vec![base]), |text| {
        match Schedule::from_json(&text) {
            Err(error) => {
                let error = error.to_string();
                let obeyed = error.contains('\x1b');
                prop_assert!(!error.is_empty() && !obeyed);
            }
            Ok(mut schedule) => {
                // Texts may say what they like.
                schedule.name = "x".into();
                schedule.provenance.generator = "x".into();
                for format in [Format::Vectors, Format::Csv, Format::Json] {
                    let Ok(files) = export(&schedule, Vec::new(), format, &options) else {
                        continue;
                    };
                    for file in files {
                        let text = String::from_utf8_lossy(&file.bytes).into_owned();
                        let odd = text
                            .split([',', '\n', ' ', '[', ']'])
                            .find(|word| matches!(*word, "NaN" | "inf" | "-inf" | "null"));
                        prop_assert!(odd.is_none(), "{} in {}", odd.unwrap_or(""), file.name);
                    }
                }
            }
        }
        Ok(())
    });
}

fn imports(name: &str, source: Source, format: Format) {
    let base = sample::schedule();
    let options = Options {
        name: "law".into(),
        step: 0.01,
        precision: Precision::Double,
        speed: 0.0,
        binaries: Vec::new(),
    };
    let file = export(&base, Vec::new(), format, &options).unwrap().remove(0);
    let answer = |bytes: &[u8]| -> TestCaseResult {
        if let Ok(back) = import(bytes, source, "fuzzed", Some(&base), Breakpoints::Unsaid) {
            prop_assert_eq!(back.schedule.check(), Ok(()));
        }
        Ok(())
    };
    if source == Source::Mat {
        fuzz_bytes(name, &file.bytes, answer);
        return;
    }
    let text = String::from_utf8(file.bytes).unwrap();
    let by_hand = match source {
        Source::Csv => "quantity,row,column,speed,unit,value\ngains,roll,k_p,40 kt,1/s^2,9.5\n",
        Source::Toml => "[[points]]\nspeed = \"40 kt\"\ngains.roll = { k_p = 9.5 }\n",
        _ => r#"{"points": [{"speed": "40 kt", "gains": {"roll": {"k_p": 9.5}}}]}"#,
    };
    fuzz(name, &damaged(vec![text, by_hand.into()]), |text| answer(text.as_bytes()));
}

#[test]
fn imports_of_csv() {
    imports("imports of CSV", Source::Csv, Format::Csv);
}

#[test]
fn imports_of_toml() {
    imports("imports of TOML", Source::Toml, Format::Toml);
}

#[test]
fn imports_of_json() {
    imports("imports of JSON", Source::Json, Format::Json);
}

#[test]
fn imports_of_mat() {
    imports("imports of MAT", Source::Mat, Format::Matlab);
}

/// A binary file with some bytes changed, and one in eight cut short.
fn fuzz_bytes(name: &str, bytes: &[u8], answer: impl Fn(&[u8]) -> TestCaseResult) {
    let length = bytes.len();
    let changes = prop::collection::vec((0..length, any::<u8>()), 1..12);
    fuzz(name, &(changes, 0..length), |(changes, cut)| {
        let mut damaged = bytes.to_vec();
        for (at, with) in changes {
            damaged[at] = with;
        }
        if cut % 8 == 0 {
            damaged.truncate(cut);
        }
        answer(&damaged)
    });
}

/// Sets of linear models: what reads makes a set of finite models, with which
/// a continuous one is made or refused.
fn sets_of(name: &str, ending: &str, bytes: Vec<u8>) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join(format!("set.{ending}"));
    let mapping = Mapping::default();
    let answer = |bytes: &[u8]| -> TestCaseResult {
        std::fs::write(&path, bytes).unwrap();
        match lti::load(&path, &mapping) {
            Err(report) => readable(&report)?,
            Ok(set) => {
                for point in &set.models {
                    let m = &point.model;
                    for matrix in [m.a(), m.b(), m.c(), m.d()] {
                        prop_assert!(matrix.iter().all(|value| value.is_finite()));
                    }
                    prop_assert!(point.speed.is_finite());
                }
                if let Ok(whole) = Stitched::new(&set, mapping.inertia) {
                    let [low, high] = whole.speed_range();
                    if let Ok(between) = whole.at(0.5 * (low + high)) {
                        prop_assert!(between.model.a().iter().all(|value| value.is_finite()));
                    }
                }
            }
        }
        Ok(())
    };
    if ending == "mat" {
        fuzz_bytes(name, &bytes, answer);
    } else {
        let text = String::from_utf8(bytes).unwrap();
        fuzz(name, &damaged(vec![text]), |text| answer(text.as_bytes()));
    }
}

#[test]
fn sets_in_json() {
    sets_of(
        "sets of models in JSON",
        "json",
        set_to_json(&sets::own_set(), System::Us).into_bytes(),
    );
}

#[test]
fn sets_in_csv() {
    let text = include_bytes!("../examples/models/uh60a/040kt.csv");
    sets_of("sets of models in CSV", "csv", text.to_vec());
}

#[test]
fn sets_in_mat() {
    sets_of("sets of models in MAT", "mat", set_to_mat(&sets::own_set(), System::Si));
}

/// The note of a design, which names the files that it is made of: nothing
/// outside its directory is read.
#[test]
fn notes_of_designs() {
    let home = tempfile::tempdir().unwrap();
    let aircraft = problem::builtin().unwrap();
    let requirements = Requirements::builtin().unwrap();
    let note = Note::new(&aircraft, &requirements);
    for (name, bytes) in note.files(&aircraft, &requirements) {
        let path = home.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let path = home.path().join(NOTE);
    fuzz("notes of designs", &damaged(vec![note.to_json().unwrap()]), |text| {
        std::fs::write(&path, &text).unwrap();
        match DesignInputs::read(home.path()) {
            Err(error) => {
                let error = error.to_string();
                prop_assert!(!error.is_empty() && !error.contains('\x1b'), "{:?}", error);
            }
            // Notes of before designs held their inputs.
            Ok(None) => prop_assert!(text.contains("coaxdesign.design/1")),
            Ok(Some(inputs)) => {
                let hash = coaxdesign::pipeline::problem_hash(&inputs.aircraft);
                prop_assert_eq!(hash, inputs.note.aircraft.problem.hash);
            }
        }
        Ok(())
    });
}

#[test]
fn quantities() {
    let unit = prop_oneof![
        Just(String::new()),
        "(ft|m|kt|deg|rad|%|slug|lb|lbf|s|ms|hp|degC|rpm|N|kg)([ */^-](ft|m|s|rad|%|2|3|-1|100%))?",
        "\\PC{0,8}",
    ];
    let number = prop_oneof![
        (0..NUMBERS.len()).prop_map(|n| NUMBERS[n].to_string()),
        "-?[0-9]{0,25}(\\.[0-9]{0,25})?([eE][+-]?[0-9]{0,4})?",
        "\\PC{0,8}",
    ];
    fuzz("quantities", &(number, unit, "[ \t]{0,2}"), |(number, unit, blank)| {
        for kind in Kind::ALL {
            match parse_quantity(&format!("{number}{blank}{unit}"), kind) {
                Ok(value) => prop_assert!(value.is_finite()),
                Err(error) => prop_assert!(!error.help().is_empty()),
            }
        }
        Ok(())
    });
}

/// A description of the law is a form that people write too.
#[test]
fn descriptions() {
    let base = Description::new(&sample::schedule(), Vec::new()).unwrap();
    let base = serde_json::to_string_pretty(&base).unwrap();
    fuzz("descriptions", &damaged(vec![base]), |text| {
        if let Ok(description) = serde_json::from_str::<Description>(&text)
            && let Ok(schedule) = description.schedule()
        {
            prop_assert_eq!(schedule.check(), Ok(()));
        }
        Ok(())
    });
}

/// 200,000 keys are read in one pass over the file, whatever they are.
#[test]
fn many_keys_are_answered() {
    let mut keys = String::from("name = \"x\"\n");
    for k in 0..200_000 {
        keys += &format!("k{k} = {k}\n");
    }
    let report = problem::parse_beside_builtin("keys.toml", &keys).unwrap_err();
    assert!(report.errors.len() > 200_000);
    let text = report.to_string();
    assert!(text.lines().count() < 1000, "{}", text.lines().count());
    assert!(text.contains("more like these"));
    // As tables, as entries of a list, and on one line.
    let mut tables = String::new();
    for k in 0..50_000 {
        tables += &format!("[rotors.r{k}]\nradius = \"1 ft\"\n");
    }
    let report = problem::parse_beside_builtin("tables.toml", &tables).unwrap_err();
    assert!(report.to_string().contains("256 are the most"), "{report}");
    let list = format!("name = \"x\"\nspeeds = [{}]\n", "\"1 kt\", ".repeat(200_000));
    assert!(spec::parse("list.toml", &format!("[schedule]\n{list}")).is_err());
}
