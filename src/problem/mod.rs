//! From a TOML problem file to checked data.
//!
//! [`load`] reads a file and everything it names; [`builtin`] is the CoAX 2D.
//! All errors of a file come at once, as a [`Report`] that names file, line,
//! column and key, and says what to write instead. What is merely odd is a
//! warning of the [`Loaded`] problem.
//!
//! The format is described in one place, [`keys`]; reading, the reference
//! page ([`page`]) and the JSON Schema ([`schema`]) follow it.

mod build;
pub mod c81;
pub mod fuselage_table;
pub mod keys;
pub mod model;
pub mod page;
pub(crate) mod read;
mod report;
pub mod schema;
mod source;
mod text;
pub(crate) mod tree;

pub use model::*;
pub use read::nearest_help;
pub use report::{Diagnostic, Report, Severity};
pub use source::{Place, Source, Sources};
pub use text::{LONGEST_LINE, LONGEST_NAME, TextFault, check_line, check_name, visible};

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// A problem, with all that is worth knowing about how it was read.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The checked problem.
    pub problem: Problem,
    /// What is odd about it.
    pub warnings: Vec<Diagnostic>,
    /// Every file that took part, with its text: the problem file first, then
    /// its bases and tables. Their hash is the provenance of all results.
    pub sources: Sources,
}

/// Names of the built-in problems, the default first.
pub const BUILTIN: [&str; 8] = [
    "coax2d",
    "coax2d-appendix",
    "coax2d-physics",
    "uh60a",
    "xv15",
    "hummingbird",
    "firefly",
    "octo-x8",
];

/// Files that are built in.
const EMBEDDED: [(&str, &str); 17] = [
    ("coax2d.toml", include_str!("../../problems/coax2d.toml")),
    ("coax2d-appendix.toml", include_str!("../../problems/coax2d-appendix.toml")),
    ("coax2d-physics.toml", include_str!("../../problems/coax2d-physics.toml")),
    ("uh60a.toml", include_str!("../../problems/uh60a.toml")),
    ("xv15.toml", include_str!("../../problems/xv15.toml")),
    ("hummingbird.toml", include_str!("../../problems/hummingbird.toml")),
    ("firefly.toml", include_str!("../../problems/firefly.toml")),
    ("octo-x8.toml", include_str!("../../problems/octo-x8.toml")),
    ("airfoils/naca23012.c81", include_str!("../../problems/airfoils/naca23012.c81")),
    ("airfoils/sc1095.c81", include_str!("../../problems/airfoils/sc1095.c81")),
    ("airfoils/uh60a-tail.c81", include_str!("../../problems/airfoils/uh60a-tail.c81")),
    ("airfoils/uh60a-fin.c81", include_str!("../../problems/airfoils/uh60a-fin.c81")),
    ("airfoils/uh60a-stabilator.c81", include_str!("../../problems/airfoils/uh60a-stabilator.c81")),
    ("airfoils/xv15-tail.c81", include_str!("../../problems/airfoils/xv15-tail.c81")),
    ("airfoils/xv15-wing-flap40.c81", include_str!("../../problems/airfoils/xv15-wing-flap40.c81")),
    ("fuselages/xv15.csv", include_str!("../../problems/fuselages/xv15.csv")),
    ("fuselages/uh60a.csv", include_str!("../../problems/fuselages/uh60a.csv")),
];

/// Reads a problem file, its bases and its tables.
///
/// # Errors
/// Every error of the file and of those it names, at once.
pub fn load(path: impl AsRef<Path>) -> Result<Loaded, Report> {
    load_from(path.as_ref(), None)
}

fn load_from(path: &Path, moved: Option<(PathBuf, PathBuf)>) -> Result<Loaded, Report> {
    let loader = Loader { moved, ..Loader::new(Library::Disk) };
    let directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
    match loader.library.read(path) {
        Ok(text) => loader.run(&path.display().to_string(), text, directory, Some(path)),
        Err(fault) => Err(Report::new(
            vec![Diagnostic::whole_file(
                &path.display().to_string(),
                fault.message,
                fault
                    .help
                    .unwrap_or("name a problem file, or start one with `coaxdesign new FILE`")
                    .into(),
            )],
            fault.unreadable,
        )),
    }
}

/// Reads a problem file that has been copied, with all files that it names,
/// from one folder to another: a path in it that leads into `from` is read in
/// `to`. `from` may be empty: then paths are taken as they stand.
///
/// # Errors
/// As [`load`].
pub fn load_copy(path: &Path, from: &Path, to: &Path) -> Result<Loaded, Report> {
    let moved = (!from.as_os_str().is_empty()).then(|| (from.into(), to.into()));
    load_from(path, moved)
}

/// Reads a problem from a text. `name` stands for the file in messages;
/// paths in the text are relative to `base_directory`.
///
/// # Errors
/// As [`load`].
pub fn parse_str(name: &str, text: &str, base_directory: &Path) -> Result<Loaded, Report> {
    Loader::new(Library::Disk).run(name, text.into(), base_directory.into(), None)
}

/// The CoAX 2D, as the paper prints it.
///
/// # Errors
/// None in practice: a test holds the built-in files to the checks.
pub fn builtin() -> Result<Loaded, Report> {
    builtin_named(BUILTIN[0])
}

/// A built-in problem by one of the names of [`BUILTIN`].
///
/// # Errors
/// On another name, with the nearest one as help.
pub fn builtin_named(name: &str) -> Result<Loaded, Report> {
    let path = PathBuf::from(format!("{name}.toml"));
    let loader = Loader::new(Library::Embedded);
    match loader.library.read(&path) {
        Ok(text) if BUILTIN.contains(&name) => {
            loader.run(&path.display().to_string(), text, PathBuf::new(), Some(&path))
        }
        _ => Err(Report::new(
            vec![Diagnostic::whole_file(
                name,
                "no built-in problem has this name".into(),
                read::nearest_help(name, BUILTIN.into_iter(), "built-in problems"),
            )],
            false,
        )),
    }
}

/// Reads a problem from a text that builds on the built-in files: `path` is
/// where it would stand in the source tree, whose folder `problems` holds them,
/// such as `"problems/variants/mine.toml"`.
///
/// # Errors
/// As [`load`].
pub fn parse_beside_builtin(path: &str, text: &str) -> Result<Loaded, Report> {
    let directory = Path::new(path).parent().unwrap_or(Path::new("")).to_path_buf();
    Loader::new(Library::Embedded).run(path, text.into(), directory, None)
}

/// Reads a problem again from the files that it was read from, as pairs of
/// name and text in the order of [`Loaded::sources`]: nothing is looked up
/// elsewhere, so that a problem can travel to another machine.
///
/// # Errors
/// As [`load`]; a file that is not among those given counts as missing.
pub fn reload(files: &[(String, String)]) -> Result<Loaded, Report> {
    let Some((name, text)) = files.first() else {
        return Err(Report::new(
            vec![Diagnostic::whole_file(
                "problem",
                "there is no text".into(),
                "give the problem's own text first, then those of its bases and tables".into(),
            )],
            false,
        ));
    };
    let held = files.iter().map(|(name, text)| (PathBuf::from(name), text.clone())).collect();
    let path = Path::new(name);
    let directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
    Loader::new(Library::Held(Arc::new(held))).run(name, text.clone(), directory, Some(path))
}

/// Where files come from.
#[derive(Debug, Clone)]
enum Library {
    Disk,
    Embedded,
    /// These texts by name, and no others.
    Held(Arc<HashMap<PathBuf, String>>),
}

struct ReadFault {
    message: String,
    /// What to do, where that depends on the fault.
    help: Option<&'static str>,
    /// Whether the system could not read the file, rather than its content
    /// being no text.
    unreadable: bool,
}

impl Library {
    fn read(&self, path: &Path) -> Result<String, ReadFault> {
        let fault = |message: &str, unreadable: bool| ReadFault {
            message: message.into(),
            help: (!unreadable).then_some("save it as UTF-8 text, as most editors do by default"),
            unreadable,
        };
        match self {
            Library::Held(texts) => {
                texts.get(path).cloned().ok_or_else(|| fault("there is no such file", true))
            }
            Library::Embedded => {
                let plain = without_parents(path);
                let name = plain.strip_prefix("problems").unwrap_or(&plain);
                EMBEDDED
                    .iter()
                    .find(|(embedded, _)| Path::new(embedded) == name)
                    .map(|(_, text)| (*text).to_string())
                    .ok_or_else(|| fault("there is no such file", true))
            }
            Library::Disk => {
                if path.is_dir() {
                    return Err(fault("this is a directory, not a file", true));
                }
                let bytes = read_bounded(path).map_err(|error| match error.kind() {
                    std::io::ErrorKind::FileTooLarge => {
                        fault(&format!("the file is larger than {} MiB", LARGEST_FILE >> 20), true)
                    }
                    std::io::ErrorKind::NotFound => fault("there is no such file", true),
                    std::io::ErrorKind::PermissionDenied => {
                        fault("there is no permission to read the file", true)
                    }
                    _ => fault(&format!("the file cannot be read: {error}"), true),
                })?;
                String::from_utf8(bytes).map_err(|error| {
                    let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
                    let line = valid.iter().filter(|byte| **byte == b'\n').count() + 1;
                    fault(&format!("the file is not UTF-8 text (line {line})"), false)
                })
            }
        }
    }

    /// A path by which a file is known again.
    fn identity(&self, path: &Path) -> PathBuf {
        match self {
            Library::Disk => path.canonicalize().unwrap_or_else(|_| path.into()),
            Library::Embedded | Library::Held(_) => without_parents(path),
        }
    }
}

/// Largest file that is read, bytes: problem files and tables have thousands.
const LARGEST_FILE: u64 = 64 << 20;

/// The bytes of a file, or of what stands for one and may never end.
fn read_bounded(path: &Path) -> std::io::Result<Vec<u8>> {
    use std::io::Read as _;
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(std::io::ErrorKind::FileTooLarge.into());
    }
    Ok(bytes)
}

/// A relative path with every `..` taken together with the folder before it.
fn without_parents(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        if part != Component::ParentDir || !plain.pop() {
            plain.push(part);
        }
    }
    plain
}

/// Deepest chain of `extends`.
const DEEPEST_CHAIN: usize = 16;

struct Loader {
    library: Library,
    /// Folder that files were copied from, and the one that they are in.
    moved: Option<(PathBuf, PathBuf)>,
    sources: Sources,
    /// Directory of each source.
    directories: Vec<PathBuf>,
    findings: Vec<Diagnostic>,
    airfoils: HashMap<PathBuf, Option<Arc<AirfoilTable>>>,
    fuselages: HashMap<PathBuf, Option<Arc<FuselageTable>>>,
}

impl Loader {
    fn new(library: Library) -> Self {
        Self {
            library,
            moved: None,
            sources: Sources::default(),
            directories: Vec::new(),
            findings: Vec::new(),
            airfoils: HashMap::new(),
            fuselages: HashMap::new(),
        }
    }

    fn add(&mut self, name: &str, path: &Path, text: String, directory: PathBuf) -> usize {
        self.directories.push(directory);
        self.sources.add_at(name, path, text)
    }

    /// Where a path leads: into the copy, where it led to what was copied.
    fn placed(&self, path: PathBuf) -> PathBuf {
        let inside = self.moved.as_ref().filter(|_| path.is_absolute()).and_then(|(from, to)| {
            let within = without_parents(&path);
            Some(to.join(within.strip_prefix(from).ok()?))
        });
        inside.unwrap_or(path)
    }

    fn run(
        mut self,
        name: &str,
        text: String,
        directory: PathBuf,
        path: Option<&Path>,
    ) -> Result<Loaded, Report> {
        if text.trim().is_empty() {
            let finding = Diagnostic::whole_file(
                name,
                "the file is empty".into(),
                "start one with `coaxdesign new FILE`".into(),
            );
            return Err(Report::new(vec![finding], false));
        }
        let main = self.add(name, path.unwrap_or(Path::new(name)), text, directory);
        let mut chain: Vec<PathBuf> =
            path.map(|path| self.library.identity(path)).into_iter().collect();
        let entries = self.entries(main, &mut chain);
        let broken: Vec<(String, usize)> =
            self.findings.iter().map(|finding| (finding.file.clone(), finding.line)).collect();
        let lenient = !broken.is_empty();
        let mut findings = Vec::new();
        let place = Place { source: main, span: 0..0 };
        let root = read::Reader {
            sources: &self.sources,
            findings: &mut findings,
            defaults: main,
            lenient,
        }
        .table(&keys::ROOT, &entries, "", &place);
        // What stands on a line that is no valid TOML has been read by guess.
        findings.retain(|finding| !broken.contains(&(finding.file.clone(), finding.line)));
        self.findings.append(&mut findings);
        let problem = build::problem(&mut self, &root, lenient);
        let failed = self.findings.iter().any(|finding| finding.severity == Severity::Error);
        match problem {
            Some(problem) if !failed => {
                report::sort(&mut self.findings);
                Ok(Loaded { problem, warnings: self.findings, sources: self.sources })
            }
            _ => Err(Report::new(self.findings, false)),
        }
    }

    /// The entries of a file, laid over those of its base.
    fn entries(&mut self, source: usize, chain: &mut Vec<PathBuf>) -> Vec<tree::Entry> {
        let node = tree::parse(&self.sources, source, &mut self.findings);
        let tree::Value::Table(mut entries) = node.value else {
            return Vec::new();
        };
        let Some(index) = entries.iter().position(|entry| entry.name == "extends") else {
            return entries;
        };
        let tree::Value::Text(base) = &entries[index].node.value else {
            // The wrong type is reported with the other keys.
            return entries;
        };
        let path = self.placed(self.directories[source].join(base));
        let place = entries[index].node.place.clone();
        entries.remove(index);
        let identity = self.library.identity(&path);
        let fault = if chain.contains(&identity) {
            Some("the file extends itself, directly or through its bases".to_string())
        } else if chain.len() >= DEEPEST_CHAIN {
            Some(format!("more than {DEEPEST_CHAIN} files extend one another"))
        } else {
            None
        };
        let help = || {
            "name another problem file, relative to this one, such as extends = \"coax2d.toml\""
                .to_string()
        };
        if let Some(message) = fault {
            self.fault(&place, "extends", message, help());
            return entries;
        }
        let text = match self.library.read(&path) {
            Ok(text) => text,
            Err(fault) => {
                self.fault(
                    &place,
                    "extends",
                    format!("{}: {}", path.display(), fault.message),
                    fault.help.map_or_else(help, String::from),
                );
                return entries;
            }
        };
        chain.push(identity);
        let directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let source = self.add(&path.display().to_string(), &path, text, directory);
        let mut merged = self.entries(source, chain);
        tree::merge(&mut merged, entries, Some(keys::Level::Keys(&keys::ROOT)));
        merged
    }

    fn fault(&mut self, place: &Place, key: &str, message: String, help: String) {
        self.findings.push(Diagnostic::at(
            Severity::Error,
            &self.sources,
            place,
            key,
            message,
            help,
        ));
    }

    /// Reads and parses a table file named at `place`, once.
    fn table_file<T>(
        &mut self,
        path: &Path,
        place: &Place,
        key: &str,
        what: &str,
        parse: fn(&str) -> Result<c81::Read<T>, c81::TableError>,
    ) -> Option<Arc<T>> {
        let text = match self.library.read(path) {
            Ok(text) => text,
            Err(fault) => {
                self.fault(
                    place,
                    key,
                    format!("{}: {}", path.display(), fault.message),
                    fault.help.map_or_else(
                        || {
                            format!(
                                "name {what}, relative to the file that names it, such as \
                                 table = \"airfoils/naca23012.c81\""
                            )
                        },
                        String::from,
                    ),
                );
                return None;
            }
        };
        let directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let source = self.add(&path.display().to_string(), path, text, directory);
        let read = parse(&self.sources.files()[source].text);
        let (line, _) = self.sources.line_and_column(place);
        let by = format!("{}:{line}", self.sources.files()[place.source].name);
        let mut finding = |severity, error: c81::TableError| {
            let at = self.sources.line(source, error.line);
            let help = format!("{} (the file is named at {by})", error.help);
            let found = Diagnostic::at(severity, &self.sources, &at, key, error.message, help);
            self.findings.push(found);
        };
        match read {
            Ok(read) => {
                read.remarks.into_iter().for_each(|remark| finding(Severity::Warning, remark));
                Some(Arc::new(read.table))
            }
            Err(error) => {
                finding(Severity::Error, error);
                None
            }
        }
    }
}

impl build::Host for Loader {
    fn finding(
        &mut self,
        severity: Severity,
        place: &Place,
        key: &str,
        message: String,
        help: String,
    ) {
        self.findings.push(Diagnostic::at(severity, &self.sources, place, key, message, help));
    }

    fn airfoil(&mut self, path: &Path, place: &Place, key: &str) -> Option<Arc<AirfoilTable>> {
        let path = self.placed(self.directories[place.source].join(path));
        if let Some(known) = self.airfoils.get(&path) {
            return known.clone();
        }
        let table = self.table_file(&path, place, key, "a C81 table", c81::read);
        self.airfoils.insert(path, table.clone());
        table
    }

    fn fuselage(&mut self, path: &Path, place: &Place, key: &str) -> Option<Arc<FuselageTable>> {
        let path = self.placed(self.directories[place.source].join(path));
        if let Some(known) = self.fuselages.get(&path) {
            return known.clone();
        }
        let table = self.table_file(&path, place, key, "a table of loads", fuselage_table::read);
        self.fuselages.insert(path, table.clone());
        table
    }
}
