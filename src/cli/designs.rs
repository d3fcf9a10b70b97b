//! The design that a subcommand works on, with its aircraft and its
//! specification.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value as Json, json};

use super::args::{ModelsArgs, ProblemArgs, UnitsArgs};
use super::tune::{SpecArgs, usage};
use super::{CliError, output};
use coaxdesign::control::spec::Specification;
use coaxdesign::lti::LtiSet;
use coaxdesign::lti::mapping::Mapping;
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::pipeline::directory::{DesignInputs, DirectoryError, ModelInputs, NOTE, Note};
use coaxdesign::pipeline::{DirectoryLock, PipelineError, Requirements, models_hash, problem_hash};
use coaxdesign::problem::{self, Loaded};
use coaxdesign::report::table::Table;
use coaxdesign::schedule::Schedule;
use coaxdesign::units::System;

/// `--problem`, `--spec` and what lets them be others than the design's.
#[derive(Debug, Clone, Default, Args)]
pub struct SourceArgs {
    /// Problem file, or the name of a built-in one [default: that of the design]
    #[arg(long, value_name = "FILE")]
    pub problem: Option<PathBuf>,
    /// Specification file [default: that of the design]
    #[arg(long, value_name = "SPEC")]
    pub spec: Option<PathBuf>,
    /// Go on where --problem is another aircraft than the design was made for
    #[arg(long)]
    pub other_aircraft: bool,
    /// Go on where --spec is another specification than the design was made for
    #[arg(long)]
    pub other_spec: bool,
}

/// A design with its aircraft and its specification.
#[derive(Debug)]
pub struct Opened {
    /// The design as it was named.
    pub name: String,
    /// Its directory.
    pub directory: PathBuf,
    /// The schedule.
    pub schedule: Schedule,
    /// The aircraft.
    pub loaded: Loaded,
    /// Name or path of the problem, as it is shown.
    pub problem_name: String,
    /// The specification.
    pub requirements: Requirements,
    /// The units that the design was asked for in.
    units: Option<System>,
}

/// What is flown or verified: an aircraft, or linear models from elsewhere.
#[derive(Debug)]
pub enum Craft {
    /// A problem.
    Problem(Box<Loaded>),
    /// A set of linear models, and the stitched model of it.
    Models(Box<LtiSet>, Box<Stitched>),
}

impl Craft {
    /// A set of models, stitched.
    ///
    /// # Errors
    /// A set that cannot be stitched.
    pub fn of_models(set: LtiSet, mapping: &Mapping) -> Result<Self, CliError> {
        let model = Stitched::new(&set, mapping.inertia).map_err(PipelineError::from)?;
        Ok(Self::Models(Box::new(set), Box::new(model)))
    }

    /// Name of the aircraft.
    pub fn name(&self) -> &str {
        match self {
            Self::Problem(loaded) => &loaded.problem.name,
            Self::Models(set, _) => &set.name,
        }
    }

    /// Names of the rotors; none of models.
    pub fn rotors(&self) -> Vec<&str> {
        match self {
            Self::Problem(loaded) => {
                loaded.problem.rotors.iter().map(|rotor| rotor.name.as_str()).collect()
            }
            Self::Models(..) => Vec::new(),
        }
    }
}

/// Refuses models that a design was not made for.
///
/// # Errors
/// Another set than the schedule's, unless `other` says that it is meant.
pub fn check_models(
    design: &Path,
    schedule: &Schedule,
    set: &LtiSet,
    other: bool,
) -> Result<(), CliError> {
    let (wanted, found) = (&schedule.provenance.problem_hash, models_hash(set));
    if !known(wanted) || found == *wanted || other {
        return Ok(());
    }
    Err(usage(
        format!(
            "{} was made for '{}' (hash {wanted}), but the models are '{}' (hash {found})",
            design.display(),
            schedule.name,
            set.name
        ),
        "name the set that the design was tuned on, tune anew with `coaxdesign tune-gains --models \
         SET -o DIR`, or add --other-aircraft to go on all the same",
    ))
}

/// A design that was made from linear models, or is looked at with some.
#[derive(Debug)]
pub struct OpenedModels {
    /// The design as it was named; empty without one.
    pub name: String,
    /// The schedule, if a design is named.
    pub schedule: Option<Schedule>,
    /// The set.
    pub set: LtiSet,
    /// The specification.
    pub requirements: Requirements,
}

impl OpenedModels {
    /// The models that the arguments name, else those that the design holds.
    /// `None` where there are none: the design is then one of a problem.
    ///
    /// # Errors
    /// A set or a specification that is wrong, or that the design was not made
    /// for.
    pub fn read(
        design: Option<&Path>,
        sources: &SourceArgs,
        models: &ModelsArgs,
        quiet: bool,
    ) -> Result<Option<Self>, CliError> {
        let problem = ProblemArgs { file: sources.problem.clone() };
        let kept = match design {
            // What a problem that is named makes of it is for the caller.
            Some(design) if problem.file.is_none() => ModelInputs::read(directory_of(design))?,
            _ => None,
        };
        let (kept_set, kept_spec) = match kept {
            Some(kept) => {
                let name = kept.note.specification.origin.clone();
                (Some(kept.set), Some(Requirements { name, ..kept.requirements }))
            }
            None => (None, None),
        };
        let requirements = match (&sources.spec, kept_spec) {
            (None, Some(kept)) => kept,
            _ => SpecArgs::of(sources.spec.clone()).load()?,
        };
        let mapping = &requirements.specification.models_from;
        let named = models.models.is_some() || (sources.spec.is_some() && kept_set.is_none());
        let set = match kept_set {
            Some(set) if !named => set,
            _ if named => match models.load(&problem, mapping, &requirements.name, quiet)? {
                Some(set) => set,
                None => return Ok(None),
            },
            _ => return Ok(None),
        };
        let schedule = design.map(load_schedule).transpose()?;
        if let (Some(design), Some(schedule)) = (design, &schedule) {
            check_models(design, schedule, &set, sources.other_aircraft)?;
            let wanted = &schedule.provenance.specification_hash;
            let found = requirements.hash();
            if sources.spec.is_some() && known(wanted) && found != *wanted && !sources.other_spec {
                return Err(other_specification(
                    design,
                    wanted,
                    "another specification",
                    &requirements.name,
                    &found,
                ));
            }
        }
        let name = design.map(|design| design.display().to_string()).unwrap_or_default();
        Ok(Some(Self { name, schedule, set, requirements }))
    }

    /// What a result is of, in a line.
    pub fn head(&self) -> String {
        let of = if self.name.is_empty() { "no design" } else { &self.name };
        format!("{of}: linear models {}, specification {}\n", self.set.name, self.requirements.name)
    }

    /// A table with columns before its own that say what it is of.
    pub fn with_columns(&self, table: Table) -> Table {
        table.with_texts_before(&[
            ("design", &self.name),
            ("aircraft", &self.set.name),
            ("specification", &self.requirements.name),
        ])
    }

    /// A JSON result with what it is of before it.
    pub fn with_head(&self, value: &Json) -> Json {
        let parts = [
            ("design", &self.name),
            ("aircraft", &self.set.name),
            ("specification", &self.requirements.name),
        ];
        headed(value, &parts)
    }
}

/// A design of a problem, or of linear models.
#[derive(Debug)]
pub enum Subject {
    /// Of a problem.
    Problem(Box<Opened>),
    /// Of linear models.
    Models(Box<OpenedModels>),
}

impl Subject {
    /// Reads a design with what it is of.
    ///
    /// # Errors
    /// As [`Opened::read`] and [`OpenedModels::read`].
    pub fn read(
        design: &Path,
        sources: &SourceArgs,
        models: &ModelsArgs,
        quiet: bool,
    ) -> Result<Self, CliError> {
        Ok(match OpenedModels::read(Some(design), sources, models, quiet)? {
            Some(of_models) => Self::Models(Box::new(of_models)),
            None => Self::Problem(Box::new(Opened::read(design, sources, quiet)?)),
        })
    }

    /// The specification.
    pub fn specification(&self) -> &Specification {
        match self {
            Self::Problem(opened) => &opened.requirements.specification,
            Self::Models(of_models) => &of_models.requirements.specification,
        }
    }

    /// The units of the results.
    pub fn system(&self, asked: UnitsArgs) -> System {
        match self {
            Self::Problem(opened) => opened.system(asked),
            Self::Models(_) => asked.of(None),
        }
    }

    /// What a result is of, in a line.
    pub fn head(&self) -> String {
        match self {
            Self::Problem(opened) => opened.head(),
            Self::Models(of_models) => of_models.head(),
        }
    }

    /// A table with columns before its own that say what it is of.
    pub fn with_columns(&self, table: Table) -> Table {
        match self {
            Self::Problem(opened) => opened.with_columns(table),
            Self::Models(of_models) => of_models.with_columns(table),
        }
    }

    /// A JSON result with what it is of before it.
    pub fn with_head(&self, value: &Json) -> Json {
        match self {
            Self::Problem(opened) => opened.with_head(value),
            Self::Models(of_models) => of_models.with_head(value),
        }
    }
}

/// Writes a design of linear models: the set, the specification, the note and
/// further files, all or none.
///
/// # Errors
/// [`CliError::Exists`] for a file that is there and another, unless
/// `overwrite` or the directory is a design already; [`CliError::Io`].
pub fn write_models(
    directory: &Path,
    set: &LtiSet,
    origin: &Path,
    requirements: &Requirements,
    options: BTreeMap<String, String>,
    more: Vec<(String, Vec<u8>)>,
    overwrite: bool,
) -> Result<(), CliError> {
    let before = Note::read(directory)?;
    let mut note = Note::of_models(set, origin, requirements);
    note.options = options;
    if let Some(before) = &before
        && before.aircraft.problem.hash == note.aircraft.problem.hash
    {
        note.aircraft.problem.origin.clone_from(&before.aircraft.problem.origin);
        note.aircraft.problem.file.clone_from(&before.aircraft.problem.file);
    }
    write_design(
        directory,
        before.as_ref(),
        &note,
        note.files_of_models(set, requirements),
        more,
        overwrite,
    )
}

/// Writes the inputs of a design with its note and further files, all or none;
/// what is there and the same is left alone. Files of an aircraft that was
/// there before are removed.
fn write_design(
    directory: &Path,
    before: Option<&Note>,
    note: &Note,
    mut inputs: Vec<(String, Vec<u8>)>,
    more: Vec<(String, Vec<u8>)>,
    overwrite: bool,
) -> Result<(), CliError> {
    let text = note.to_json().map_err(|error| CliError::Internal(error.to_string()))?;
    inputs.push((NOTE.into(), text.into_bytes()));
    let is_ours = |name: &str| before.is_some() && !more.iter().any(|m| m.0 == *name);
    let mut files = Vec::new();
    for (name, bytes) in inputs.into_iter().chain(more.iter().cloned()) {
        let path = directory.join(&name);
        if std::fs::read(&path).is_ok_and(|there| there == bytes) {
            continue;
        }
        if path.symlink_metadata().is_ok() && !overwrite && !is_ours(&name) {
            return Err(CliError::Exists { path });
        }
        files.push((name, bytes));
    }
    output::write_set(directory, &files, true)?;
    let gone = before.into_iter().flat_map(|before| &before.aircraft.files);
    for file in gone.filter(|file| !note.aircraft.files.contains(file)) {
        // Nothing depends on it any more.
        let _ = std::fs::remove_file(directory.join(file));
    }
    Ok(())
}

/// A JSON result with what it is of before it, its schema first.
fn headed(value: &Json, parts: &[(&str, &String)]) -> Json {
    let mut whole = Map::new();
    if let Some(schema) = value.get("schema") {
        whole.insert("schema".into(), schema.clone());
    }
    for (key, text) in parts {
        whole.insert((*key).into(), json!(text));
    }
    for (key, entry) in value.as_object().into_iter().flatten() {
        whole.entry(key.clone()).or_insert_with(|| entry.clone());
    }
    Json::Object(whole)
}

fn other_specification(
    design: &Path,
    wanted: &str,
    tuned_to: &str,
    name: &str,
    found: &str,
) -> CliError {
    usage(
        format!(
            "{} was tuned to {tuned_to} (hash {wanted}), but {name} is another (hash {found})",
            design.display()
        ),
        "leave out --spec to take the design's own, tune anew with `coaxdesign tune-gains --spec \
         SPEC -o DIR`, or add --other-spec to go on all the same",
    )
}

/// The directory of a design that is named by it or by its schedule.
pub fn directory_of(design: &Path) -> &Path {
    if design.is_dir() {
        return design;
    }
    match design.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// A schedule file, or the one in a directory.
pub fn load_schedule(path: &Path) -> Result<Schedule, CliError> {
    let file = if path.is_dir() { path.join("schedule.json") } else { path.to_path_buf() };
    let text = std::fs::read_to_string(&file).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => usage(
            format!("{}: there is no schedule here", path.display()),
            "make one with `coaxdesign tune-gains -o DIR` or `coaxdesign design -o DIR`",
        ),
        _ => CliError::Io { path: file.clone(), source },
    })?;
    output::is_input(&file);
    Schedule::from_json(&text).map_err(|error| {
        usage(
            format!("{}: {error}", file.display()),
            "a schedule is written by `coaxdesign tune-gains -o DIR`",
        )
    })
}

/// Whether a hash is one: an imported schedule may not know what it is for.
fn known(hash: &str) -> bool {
    hash.len() == 16 && hash.bytes().all(|b| b.is_ascii_hexdigit())
}

impl Opened {
    /// Reads a design, and takes aircraft and specification from it unless the
    /// arguments name others.
    ///
    /// # Errors
    /// No schedule, no aircraft, or one that the design was not made for.
    pub fn read(design: &Path, sources: &SourceArgs, quiet: bool) -> Result<Self, CliError> {
        let schedule = load_schedule(design)?;
        let directory = directory_of(design);
        let inside = DesignInputs::read(directory)?;
        let wanted = &schedule.provenance.problem_hash;
        let made_for =
            inside.as_ref().map_or_else(|| schedule.name.clone(), |i| i.note.aircraft.name.clone());
        let units = inside.as_ref().and_then(|inside| inside.note.units());
        let (kept, kept_spec) = match inside {
            Some(inside) => {
                let origin = inside.note.specification.origin.clone();
                let requirements = Requirements { name: origin, ..inside.requirements };
                (Some((inside.aircraft, inside.note.aircraft.problem.origin)), Some(requirements))
            }
            None => (None, None),
        };
        let (loaded, problem_name) = match (&sources.problem, kept) {
            (Some(path), _) => {
                let name = path.display().to_string();
                (ProblemArgs { file: Some(path.clone()) }.load()?, name)
            }
            (None, Some(kept)) => kept,
            (None, None) => builtin_with(wanted)?.ok_or_else(|| {
                usage(
                    format!(
                        "{}: the design does not hold its aircraft, '{}' (hash {wanted}), and no \
                         built-in problem is it",
                        design.display(),
                        schedule.name
                    ),
                    "name its problem file with --problem FILE, or make the design again with \
                     `coaxdesign tune-gains FILE -o DIR`",
                )
            })?,
        };
        let found = problem_hash(&loaded);
        if known(wanted) && found != *wanted && !sources.other_aircraft {
            return Err(usage(
                format!(
                    "{} was made for the aircraft '{made_for}' (hash {wanted}), but {problem_name} \
                     is '{}' (hash {found})",
                    design.display(),
                    loaded.problem.name
                ),
                "leave out --problem to take the design's own, tune anew with `coaxdesign \
                 tune-gains FILE -o DIR`, or add --other-aircraft to go on all the same",
            ));
        }
        if !quiet {
            super::args::show_warnings(&loaded);
        }
        let requirements = Self::requirements(design, &schedule, sources, kept_spec, quiet)?;
        Ok(Self {
            name: design.display().to_string(),
            directory: directory.into(),
            schedule,
            loaded,
            problem_name,
            requirements,
            units,
        })
    }

    fn requirements(
        design: &Path,
        schedule: &Schedule,
        sources: &SourceArgs,
        kept: Option<Requirements>,
        quiet: bool,
    ) -> Result<Requirements, CliError> {
        let wanted = &schedule.provenance.specification_hash;
        let builtin = Requirements::builtin()?;
        let tuned_to = kept.as_ref().map_or_else(
            || "another specification".into(),
            |kept| format!("the specification {}", kept.name),
        );
        let requirements = match (&sources.spec, kept) {
            (Some(path), _) => SpecArgs::of(Some(path.clone())).load()?,
            (None, Some(kept)) => kept,
            (None, None) if builtin.hash() == *wanted => builtin,
            (None, None) => {
                if !quiet {
                    output::note(&format!(
                        "warning: {}: the design does not hold its specification; the built-in \
                         one is taken\n",
                        design.display()
                    ));
                }
                return Ok(builtin);
            }
        };
        let found = requirements.hash();
        if known(wanted) && found != *wanted && !sources.other_spec {
            return Err(other_specification(design, wanted, &tuned_to, &requirements.name, &found));
        }
        Ok(requirements)
    }

    /// The units of the results: those asked for, else those of the design.
    pub fn system(&self, asked: UnitsArgs) -> System {
        match self.units {
            Some(units) if asked.units.is_none() => units,
            _ => asked.of(Some(&self.loaded.problem)),
        }
    }

    /// What a result is of, in a line.
    pub fn head(&self) -> String {
        format!(
            "{}: aircraft {} ({}), specification {}\n",
            self.name, self.loaded.problem.name, self.problem_name, self.requirements.name
        )
    }

    /// A table with columns before its own that say what it is of.
    pub fn with_columns(&self, table: Table) -> Table {
        table.with_texts_before(&[
            ("design", &self.name),
            ("aircraft", &self.loaded.problem.name),
            ("specification", &self.requirements.name),
        ])
    }

    /// A JSON result with what it is of before it.
    pub fn with_head(&self, value: &Json) -> Json {
        let parts = [
            ("design", &self.name),
            ("aircraft", &self.loaded.problem.name),
            ("problem", &self.problem_name),
            ("specification", &self.requirements.name),
        ];
        headed(value, &parts)
    }
}

/// The schedule in a directory, if there is one that can be read.
fn left_schedule(directory: &Path) -> Option<Schedule> {
    let text = std::fs::read_to_string(directory.join("schedule.json")).ok()?;
    Schedule::from_json(&text).ok()
}

/// The built-in aircraft that a schedule was made for, which a design without its
/// inputs may be tuned for again; another must be named.
fn made_for(schedule: &Schedule) -> Result<Loaded, CliError> {
    let wanted = &schedule.provenance.problem_hash;
    let found = builtin_with(wanted)?.map(|found| found.0);
    found.ok_or_else(|| {
        usage(
            format!(
                "the schedule in this directory was made for '{}' (hash {wanted}), which is not \
                 here, and no built-in problem is it",
                schedule.name
            ),
            "name its problem file, or choose another directory with -o",
        )
    })
}

/// Refuses to replace a schedule by one for the built-in specification where it
/// was tuned to another, that is not there.
fn tuned_to(schedule: &Schedule, chosen: &Requirements) -> Result<(), CliError> {
    let wanted = &schedule.provenance.specification_hash;
    if !known(wanted) || chosen.hash() == *wanted {
        return Ok(());
    }
    Err(usage(
        format!(
            "the schedule in this directory was tuned to a specification (hash {wanted}) that is \
             not here"
        ),
        "name one with --spec SPEC, or choose another directory with -o",
    ))
}

/// What a new design is made from.
#[derive(Debug)]
pub struct Chosen {
    /// The aircraft.
    pub loaded: Loaded,
    /// The specification.
    pub requirements: Requirements,
    /// The note that the directory has, if any.
    before: Option<Note>,
    /// Whether aircraft and specification are those of the directory.
    kept: [bool; 2],
}

impl Chosen {
    /// What the arguments name; else what the design in `directory` was made
    /// from; else the built-in ones.
    ///
    /// # Errors
    /// Files that are wrong, or have changed in the design since.
    pub fn new(
        problem: &ProblemArgs,
        spec: &SpecArgs,
        directory: Option<&Path>,
        quiet: bool,
    ) -> Result<Self, CliError> {
        let asked = [problem.file.is_some(), spec.is_given()];
        let before = directory.map(Note::read).transpose()?.flatten();
        let inside = match directory {
            Some(directory) if asked != [true, true] => DesignInputs::read(directory)?,
            _ => None,
        };
        let kept = asked.map(|given| !given && inside.is_some());
        let (aircraft, requirements) = match inside {
            Some(inside) => {
                let name = inside.note.specification.origin.clone();
                (Some(inside.aircraft), Some(Requirements { name, ..inside.requirements }))
            }
            None => (None, None),
        };
        // What a schedule was made for that is there without its inputs.
        let left = match directory {
            Some(directory) if aircraft.is_none() => left_schedule(directory),
            _ => None,
        };
        let loaded = match (aircraft.filter(|_| kept[0]), &left) {
            (Some(aircraft), _) => aircraft,
            (None, Some(schedule)) if !asked[0] => made_for(schedule)?,
            (None, _) => problem.load()?,
        };
        if !quiet {
            super::args::show_warnings(&loaded);
        }
        let requirements = match requirements.filter(|_| kept[1]) {
            Some(requirements) => spec.reduced(requirements),
            None => spec.load()?,
        };
        if let (Some(schedule), false) = (&left, asked[1]) {
            tuned_to(schedule, &requirements)?;
        }
        Ok(Self { loaded, requirements, before, kept })
    }

    /// Whether the directory holds a design already.
    pub fn is_design(&self) -> bool {
        self.before.is_some()
    }

    /// Whether the aircraft is that of the design in the directory.
    pub fn keeps_aircraft(&self) -> bool {
        self.kept[0]
    }

    /// The note of the new design, with the stages of the one before.
    pub fn note(&self) -> Note {
        let mut note = Note::new(&self.loaded, &self.requirements);
        if let Some(before) = &self.before {
            if self.kept[0] {
                note.aircraft = before.aircraft.clone();
            }
            if self.kept[1] {
                note.specification = before.specification.clone();
            }
            note.stages.clone_from(&before.stages);
            note.maneuvers.clone_from(&before.maneuvers);
            note.options.clone_from(&before.options);
        }
        note
    }

    /// Writes files of the design, with problem and specification and the note,
    /// all or none; what is there and the same is left alone. Files of an
    /// aircraft that was there before are removed.
    ///
    /// # Errors
    /// [`CliError::Exists`] for a file that is there and another, unless
    /// `overwrite` or the directory is a design already; [`CliError::Io`].
    pub fn write(
        &self,
        directory: &Path,
        note: &Note,
        more: Vec<(String, Vec<u8>)>,
        overwrite: bool,
    ) -> Result<(), CliError> {
        let inputs = note.files(&self.loaded, &self.requirements);
        write_design(directory, self.before.as_ref(), note, inputs, more, overwrite)
    }
}

/// Makes a directory if it is not there, and keeps other writers out of it.
///
/// # Errors
/// A directory that cannot be made, or that another command writes into.
pub fn lock(directory: &Path) -> Result<DirectoryLock, CliError> {
    std::fs::create_dir_all(directory)
        .map_err(|source| CliError::Io { path: directory.into(), source })?;
    let words = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let words: Vec<String> = std::iter::once("coaxdesign".to_string()).chain(words).collect();
    Ok(DirectoryLock::acquire(directory, &output::shell_line(&words))?)
}

/// The built-in problem with a hash.
fn builtin_with(wanted: &str) -> Result<Option<(Loaded, String)>, CliError> {
    for name in problem::BUILTIN {
        let loaded = problem::builtin_named(name)?;
        if problem_hash(&loaded) == wanted {
            return Ok(Some((loaded, format!("{name} (built in)"))));
        }
    }
    Ok(None)
}

impl From<DirectoryError> for CliError {
    fn from(error: DirectoryError) -> Self {
        let message = error.to_string();
        match error {
            DirectoryError::Input(report) => Self::Problem(report),
            DirectoryError::Io { path, source } => Self::Io { path, source },
            DirectoryError::Note { .. } => usage(
                message,
                "delete it, and make the design again with `coaxdesign design FILE -o DIR`",
            ),
            DirectoryError::OfModels { .. } => usage(
                message,
                "this command needs a problem; `simulate`, `montecarlo`, `identify`, `verify` and \
                 `export` work with a design of models",
            ),
            DirectoryError::Changed { .. } => usage(
                message,
                "undo the change; or copy the file elsewhere and make another design of it with \
                 `coaxdesign tune-gains FILE -o OTHER`",
            ),
        }
    }
}
