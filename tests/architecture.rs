//! Data flows one way down the street: a module uses only those above it.
//!
//! The order is written here once and compared with `src/lib.rs` and with the
//! folder, so that a new module must find its place.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Modules from the top of the street to its end. Those that do not exist yet
/// keep their place.
const STREET: [&str; 16] = [
    "units",
    "numerics",
    "law",
    "problem",
    "vehicle",
    "trim",
    "linear",
    "lti",
    "control",
    "schedule",
    "simulate",
    "export",
    "validation",
    "pipeline",
    "studies",
    "report",
];

/// What a module may use of those above it, where that is less than all.
const NARROWER: [(&str, &[&str]); 5] = [
    ("units", &[]),
    ("numerics", &[]),
    ("law", &["units"]),
    ("problem", &["units"]),
    ("report", &["units"]),
];

/// Rooms that a module does not enter, though they stand above it: an export
/// says what flies, not how it came about.
const CLOSED: [(&str, [&str; 5]); 1] = [(
    "export",
    ["control::design", "control::explain", "control::spec", "control::testbed", "control::tuning"],
)];

/// Words that have no place in the code of `numerics`.
const AIRCRAFT_WORDS: [&str; 9] = [
    "aircraft",
    "airframe",
    "blade",
    "fuselage",
    "helicopter",
    "inflow",
    "rotor",
    "vehicle",
    "wing",
];

/// Most lines of the program outside the library.
const MAIN_LINES: usize = 60;

/// A source file of the library.
struct Source {
    /// Path below `src`.
    path: PathBuf,
    /// Module of the street that it belongs to.
    module: String,
    /// Depth of its own module: 1 for `crate::units`.
    depth: usize,
    /// Its text as written.
    text: String,
    /// Its code without comments, contents of strings, and test modules.
    code: String,
}

#[test]
fn the_street_is_the_one_that_the_library_declares() {
    let library = fs::read_to_string(source_root().join("lib.rs")).unwrap();
    let told: Vec<&str> = library
        .lines()
        .filter_map(|line| line.strip_prefix("//! * [`")?.split('`').next())
        .collect();
    let there: Vec<&str> = STREET.into_iter().filter(|module| told.contains(module)).collect();
    assert_eq!(told, there, "src/lib.rs lists the modules in another order than the street");
    let declared: BTreeSet<&str> = library
        .lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'))
        .collect();
    assert_eq!(declared, told.into_iter().collect(), "src/lib.rs declares what it does not list");
    let found: BTreeSet<String> = sources().into_iter().map(|source| source.module).collect();
    let found: BTreeSet<&str> = found.iter().map(String::as_str).collect();
    assert_eq!(declared, found, "the folder holds other modules than src/lib.rs declares");
}

#[test]
fn a_module_uses_only_those_above_it() {
    let mut wrong = Vec::new();
    for source in sources() {
        let place = place_of(&source.module);
        for used in crate_paths(&source.code) {
            let allowed = match NARROWER.iter().find(|(module, _)| *module == source.module) {
                Some((_, above)) => used == source.module || above.contains(&used.as_str()),
                None => place_of(&used) <= place,
            };
            if !allowed {
                wrong.push(format!("{} uses crate::{used}", source.path.display()));
            }
        }
        // A chain of `super` as long as the module is deep ends at the crate.
        let chain = longest_super_chain(&source.code);
        if chain >= source.depth {
            wrong.push(format!("{} reaches the crate through `super`", source.path.display()));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn an_export_knows_neither_tuning_nor_test_beds() {
    for (module, rooms) in CLOSED {
        let sources = sources();
        // The rooms are there, so that a renamed one is not missed.
        for room in rooms {
            let path = source_root().join(room.replace("::", "/"));
            assert!(
                path.with_extension("rs").exists() || path.join("mod.rs").exists(),
                "there is no module {room}"
            );
        }
        for source in sources.iter().filter(|source| source.module == module) {
            for room in rooms {
                assert!(
                    !source.code.contains(&format!("crate::{room}")),
                    "{} uses crate::{room}",
                    source.path.display()
                );
            }
        }
    }
}

#[test]
fn tests_inside_a_module_use_only_what_it_may() {
    // They may reach further down the street by integration tests only.
    let mut wrong = Vec::new();
    for source in sources() {
        for used in crate_paths(&without_comments(&source.text)) {
            if place_of(&used) > place_of(&source.module) {
                wrong.push(format!("{} uses crate::{used}", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn numerics_knows_nothing_of_aircraft() {
    for source in sources().iter().filter(|source| source.module == "numerics") {
        let lower = source.code.to_lowercase();
        for word in lower.split(|c: char| !c.is_alphanumeric()) {
            let known = AIRCRAFT_WORDS.iter().find(|known| word.starts_with(**known));
            assert!(known.is_none(), "{} says `{word}`", source.path.display());
        }
    }
}

#[test]
fn the_library_does_not_print() {
    for source in sources() {
        for call in ["println!", "print!", "eprintln!", "eprint!", "dbg!"] {
            let calls = source.code.match_indices(call).any(|(at, _)| {
                !source.code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_')
            });
            assert!(!calls, "{} calls {call}", source.path.display());
        }
    }
}

#[test]
fn main_is_short() {
    let main = fs::read_to_string(source_root().join("main.rs")).unwrap();
    assert!(main.lines().count() < MAIN_LINES);
}

#[test]
fn the_reader_of_sources_sees_what_it_should() {
    let text = r##"
use crate::units::Kind; // crate::export
use crate::{problem, vehicle::{Layout, rotor}};
/* crate::trim /* nested */ crate::linear */
const TEXT: &str = "crate::control \" crate::linear";
const RAW: &str = r#"crate::schedule "quoted" crate::export"#;
const QUOTE: char = '"';
fn life<'a>(x: &'a str) -> super::super::Thing { crate::numerics::f(x) }
#[cfg(test)]
mod tests { use crate::report::Page; fn f() { let _ = "}"; } }
fn after() { crate::simulate::run() }
"##;
    let code = without_tests(&without_comments(text));
    let used: Vec<String> = crate_paths(&code).into_iter().collect();
    assert_eq!(used, ["numerics", "problem", "simulate", "units", "vehicle"]);
    assert_eq!(longest_super_chain(&code), 2);
    assert!(crate_paths(&without_comments(text)).contains("report"));
}

fn source_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn place_of(module: &str) -> usize {
    STREET
        .iter()
        .position(|known| *known == module)
        .unwrap_or_else(|| panic!("`{module}` has no place in the street of this test"))
}

/// The folder of the program's own crate, which stands outside the street.
const PROGRAM: &str = "cli";

/// Every source file of the library but `lib.rs`.
fn sources() -> Vec<Source> {
    let root = source_root();
    let mut folders = vec![root.clone()];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                if path != root.join(PROGRAM) {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let below = path.strip_prefix(&root).unwrap().to_owned();
                if below != Path::new("lib.rs") && below != Path::new("main.rs") {
                    found.push(read_source(&path, below));
                }
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    assert!(found.len() > 20, "too few sources: is the folder right?");
    found
}

fn read_source(path: &Path, below: PathBuf) -> Source {
    let text = fs::read_to_string(path).unwrap();
    let mut parts: Vec<String> = below
        .with_extension("")
        .components()
        .map(|part| part.as_os_str().to_str().unwrap().to_owned())
        .collect();
    if parts.last().is_some_and(|last| last == "mod") {
        parts.pop();
    }
    // A file of tests alone is a test module.
    let code = if parts.last().is_some_and(|last| last == "tests") {
        String::new()
    } else {
        without_tests(&without_comments(&text))
    };
    Source { module: parts[0].clone(), depth: parts.len(), path: below, text, code }
}

/// Names after `crate::`, those in braces included.
fn crate_paths(code: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (at, head) in code.match_indices("crate::") {
        // `$crate` and names that end in `crate` are something else.
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$') {
            continue;
        }
        let rest = code[at + head.len()..].trim_start();
        if let Some(list) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut fresh = true;
            for (k, c) in list.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => fresh = true,
                    _ if depth == 0 && fresh && !c.is_whitespace() => {
                        names.insert(identifier(&list[k..]));
                        fresh = false;
                    }
                    _ => {}
                }
            }
        } else {
            names.insert(identifier(rest));
        }
    }
    names
}

fn identifier(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// Most `super`s in a row.
fn longest_super_chain(code: &str) -> usize {
    let mut longest = 0;
    let mut rest = code;
    while let Some(at) = rest.find("super::") {
        let mut chain = 0;
        rest = &rest[at..];
        while let Some(next) = rest.strip_prefix("super::") {
            chain += 1;
            rest = next;
        }
        longest = longest.max(chain);
    }
    longest
}

/// The text with comments and the contents of strings left out.
fn without_comments(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let at = |k: usize| chars.get(k).copied().unwrap_or('\0');
    let mut code = String::new();
    let mut k = 0;
    while k < chars.len() {
        match at(k) {
            '/' if at(k + 1) == '/' => {
                while k < chars.len() && at(k) != '\n' {
                    k += 1;
                }
            }
            '/' if at(k + 1) == '*' => {
                let mut depth = 0;
                loop {
                    match (at(k), at(k + 1)) {
                        ('/', '*') => (depth, k) = (depth + 1, k + 2),
                        ('*', '/') => (depth, k) = (depth - 1, k + 2),
                        _ => k += 1,
                    }
                    if depth == 0 || k >= chars.len() {
                        break;
                    }
                }
            }
            'r' if (at(k + 1) == '#' || at(k + 1) == '"') && !code.ends_with(is_name) => {
                let hashes = (k + 1..).take_while(|&j| at(j) == '#').count();
                if at(k + 1 + hashes) != '"' {
                    // A raw identifier.
                    code.push('r');
                    k += 1;
                    continue;
                }
                k += hashes + 2;
                while k < chars.len() && !(at(k) == '"' && (1..=hashes).all(|j| at(k + j) == '#')) {
                    k += 1;
                }
                k += hashes + 1;
                code.push_str("\"\"");
            }
            '"' => {
                k += 1;
                while k < chars.len() && at(k) != '"' {
                    k += if at(k) == '\\' { 2 } else { 1 };
                }
                k += 1;
                code.push_str("\"\"");
            }
            // A character, not a lifetime.
            '\'' if at(k + 1) == '\\' || at(k + 2) == '\'' => {
                k += if at(k + 1) == '\\' { 3 } else { 2 };
                while k < chars.len() && at(k) != '\'' {
                    k += 1;
                }
                k += 1;
                code.push_str("' '");
            }
            c => {
                code.push(c);
                k += 1;
            }
        }
    }
    code
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Code without the items under `#[cfg(test)]`.
fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut kept = String::new();
    let mut rest = code;
    while let Some(at) = rest.find(MARK) {
        kept.push_str(&rest[..at]);
        rest = &rest[at + MARK.len()..];
        // To the end of the item: a semicolon, or the brace that closes it.
        let mut depth = 0;
        let end = rest.char_indices().find_map(|(k, c)| {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            (depth == 0 && (c == ';' || c == '}')).then_some(k + 1)
        });
        rest = &rest[end.unwrap_or(rest.len())..];
    }
    kept + rest
}
