//! `coaxdesign sweep`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json, json};

use super::args::{Format, FormatArgs, ProblemArgs, RunArgs};
use super::designs::{load_schedule, lock};
use super::rows::{Job, Row, RowArgs, to_csv};
use super::{CliError, Outcome, output};
use coaxdesign::control::axis::Channel;
use coaxdesign::pipeline::directory::{NOTE, Note};
use coaxdesign::pipeline::{
    CaseFiles, Requirements, SWEEP_SCHEMA, Silent, Sweep as Cases, SweepError, SweepPlan,
    TuneOptions,
};
use coaxdesign::problem::Loaded;
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};

/// Tune a schedule for each of many problems or specifications, or verify one on all of them
///
/// `--vary KEY=V1,V2,...` gives a key of the problem file, such as "mass.mass=250 kg,300 kg", or,
/// after `spec.`, one of the specification, such as "spec.hardware.delay=20 ms,35 ms"; several make
/// every combination. `--vary problem=A.toml,B.toml` and `--vary specification=A.toml,B.toml` vary
/// the files themselves. A plan (--plan FILE.toml) has the same in its table [vary], or lists its
/// cases one by one. Cases that have been worked on are not worked on again, and shards of one sweep
/// are joined with --merge, as with montecarlo. The exit code is 0 once all that was asked for is
/// done, whatever came of it.
#[derive(Debug, Args)]
pub struct Sweep {
    #[command(flatten)]
    problem: ProblemArgs,
    /// Specification file [default: the built-in Level 1 targets]
    #[arg(long, value_name = "SPEC")]
    spec: Option<PathBuf>,
    /// Verify this schedule in every case instead of tuning: a directory of a design, or a file
    #[arg(long, value_name = "DESIGN")]
    schedule: Option<PathBuf>,
    /// Outer loops to tune [default: all of the specification]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    channels: Vec<String>,
    /// A key and the values it takes: KEY=V1,V2,...
    #[arg(long, value_name = "KEY=VALUES", required_unless_present = "plan")]
    vary: Vec<String>,
    /// A file that says what is varied
    #[arg(long, value_name = "FILE.toml", conflicts_with = "vary")]
    plan: Option<PathBuf>,
    /// Keep the design of every case in DIR/case-NNNN
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    #[command(flatten)]
    rows: RowArgs,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    run: RunArgs,
}

/// A plan as a file has it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    /// Values by key; every combination is a case.
    #[serde(default)]
    vary: Map<String, Json>,
    /// Cases one by one: values by key.
    #[serde(default)]
    case: Vec<Map<String, Json>>,
}

/// A row as it is kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "Map<String, Json>")]
struct CaseRow {
    #[serde(skip)]
    index: usize,
    #[serde(flatten)]
    row: Map<String, Json>,
}

impl TryFrom<Map<String, Json>> for CaseRow {
    type Error = String;

    fn try_from(row: Map<String, Json>) -> Result<Self, String> {
        let index = row.get("case").and_then(Json::as_u64).ok_or("there is no case")?;
        Ok(Self { index: index as usize, row })
    }
}

impl Row for CaseRow {
    fn index(&self) -> usize {
        self.index
    }
}

impl CaseRow {
    fn status(&self) -> &str {
        self.row.get("status").and_then(Json::as_str).unwrap_or_default()
    }
}

impl Sweep {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        let cases = self.cases()?;
        let head = cases.head();
        let count = head.plan.cases.len();
        let job = Job {
            head,
            hash: head.hash(),
            columns: cases.columns(),
            count,
            noun: "cases",
            doing: "cases",
        };
        let rows = self.rows.rows(&job, None, self.run.quiet, |index| {
            let case = cases.run(index, &Silent)?;
            if let (Some(folder), Some(files)) = (&self.keep, &case.files) {
                keep(&folder.join(format!("case-{index:04}")), files)?;
            }
            Ok(CaseRow { index, row: case.row })
        })?;
        let text = match self.format.shown() {
            Format::Json => {
                let value = json!({
                    "schema": SWEEP_SCHEMA,
                    "sweep": head,
                    "rows": rows.values().map(|row| &row.row).collect::<Vec<_>>(),
                });
                let text = serde_json::to_string_pretty(&value)
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                text + "\n"
            }
            Format::Csv => {
                let names: Vec<String> =
                    job.columns.iter().map(|column| column.0.clone()).collect();
                to_csv(&names, &rows)?
            }
            Format::Table => {
                let table = table(&head.plan.keys, &rows).to_text(Coloring::for_stdout());
                let met = rows.values().filter(|row| row.status() == "met").count();
                format!("{table}\n{met} of {} cases meet all requirements\n", rows.len())
            }
        };
        output::print(&text)?;
        let missed = rows.values().any(|row| row.status() != "met");
        Ok(self.rows.outcome(count, "cases", rows.len(), missed))
    }

    fn cases(&self) -> Result<Cases, CliError> {
        let plan = match &self.plan {
            Some(path) => plan_of(path)?,
            None => {
                let factors: Result<Vec<_>, _> =
                    self.vary.iter().map(|text| factor(text)).collect();
                SweepPlan::grid(&factors?).map_err(|error| usage(&error))?
            }
        };
        // Paths in a plan are relative to it.
        let beside = self.plan.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        let problems = match values(&plan, "problem") {
            None => {
                let loaded = self.problem.load_with_warnings(self.run.quiet)?;
                vec![(loaded.problem.name.clone(), loaded)]
            }
            Some(_) if self.problem.file.is_some() => {
                return Err(CliError::Usage {
                    message: "a problem is given, and problems are varied".into(),
                    help: "name all problems with --vary problem=...".into(),
                });
            }
            Some(names) => names
                .into_iter()
                .map(|name| {
                    let path = beside.join(&name);
                    let file = Some(if path.exists() { path } else { PathBuf::from(&name) });
                    let loaded = ProblemArgs { file }.load_with_warnings(self.run.quiet)?;
                    Ok((name, loaded))
                })
                .collect::<Result<Vec<(String, Loaded)>, CliError>>()?,
        };
        let read = |path: &Path| -> Result<Requirements, CliError> {
            output::is_input(path);
            Ok(Requirements::load(path)?)
        };
        let specifications = match values(&plan, "specification") {
            None => {
                let one = match &self.spec {
                    Some(path) => read(path)?,
                    None => Requirements::builtin()?,
                };
                vec![(one.name.clone(), one)]
            }
            Some(_) if self.spec.is_some() => {
                return Err(CliError::Usage {
                    message: "a specification is given, and specifications are varied".into(),
                    help: "name all specifications with --vary specification=...".into(),
                });
            }
            Some(names) => names
                .into_iter()
                .map(|name| {
                    let requirements = read(&beside.join(&name))?;
                    Ok((name, requirements))
                })
                .collect::<Result<Vec<_>, CliError>>()?,
        };
        let schedule = self.schedule.as_deref().map(load_schedule).transpose()?;
        let channels = self
            .channels
            .iter()
            .map(|name| {
                Channel::ALL.into_iter().find(|channel| channel.name() == name).ok_or_else(|| {
                    let known: Vec<&str> = Channel::ALL.iter().map(|c| c.name()).collect();
                    CliError::Usage {
                        message: format!("--channels: there is no {name:?}"),
                        help: format!("one of {}", known.join(", ")),
                    }
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let options = TuneOptions { channels, explain_all: false };
        Cases::new(problems, specifications, schedule, options, plan).map_err(|error| match error {
            SweepError::Case { case, varied, report } => {
                output::note(&format!("error: case {case}, {varied}\n"));
                (*report).into()
            }
            other => usage(&other),
        })
    }
}

fn usage(error: &SweepError) -> CliError {
    CliError::Usage {
        message: error.to_string(),
        help: "write --vary \"mass.mass=250 kg,300 kg\", a key of the problem file; or --vary \
               \"spec.hardware.delay=20 ms,35 ms\", one of the specification"
            .into(),
    }
}

/// Values of a key, each once.
fn values(plan: &SweepPlan, key: &str) -> Option<Vec<String>> {
    let place = plan.keys.iter().position(|known| known == key)?;
    let mut names = Vec::new();
    for value in plan.cases.iter().filter_map(|case| case.get(place)?.as_str()) {
        if !names.iter().any(|known| known == value) {
            names.push(value.to_string());
        }
    }
    Some(names)
}

/// `KEY=V1,V2,...`; a value is as in a file, or a text without its quotes.
fn factor(text: &str) -> Result<(String, Vec<Json>), CliError> {
    let wrong = |message: &str| CliError::Usage {
        message: format!("--vary {text:?}: {message}"),
        help:
            "write --vary \"mass.mass=250 kg,300 kg\"; commas within [ ] and \" \" part no values"
                .into(),
    };
    let (key, list) = text.split_once('=').ok_or_else(|| wrong("there is no ="))?;
    let values =
        parted(list).ok_or_else(|| wrong("a bracket or a quotation mark is not closed"))?;
    if values.iter().any(String::is_empty) {
        return Err(wrong("a value is empty"));
    }
    Ok((key.trim().to_string(), values.iter().map(|value| one_value(value)).collect()))
}

fn one_value(text: &str) -> Json {
    let parsed = format!("v = {text}").parse::<toml::Table>().ok();
    parsed
        .and_then(|table| serde_json::to_value(table.get("v")?).ok())
        .unwrap_or_else(|| Json::String(text.to_string()))
}

/// Parts between commas that stand in no brackets and no quotation marks.
fn parted(text: &str) -> Option<Vec<String>> {
    let (mut depth, mut quoted) = (0usize, false);
    let mut parts = vec![String::new()];
    for c in text.chars() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth = depth.checked_sub(1)?,
            _ => {}
        }
        if c == ',' && depth == 0 && !quoted {
            parts.push(String::new());
        } else if let Some(part) = parts.last_mut() {
            part.push(c);
        }
    }
    (depth == 0 && !quoted).then(|| parts.iter().map(|part| part.trim().to_string()).collect())
}

fn plan_of(path: &Path) -> Result<SweepPlan, CliError> {
    output::is_input(path);
    let text = std::fs::read_to_string(path)
        .map_err(|source| CliError::Io { path: path.into(), source })?;
    let wrong = |message: String| CliError::Usage {
        message: format!("{}: {message}", path.display()),
        help: "write [vary] with KEY = [VALUE, ...], or [[case]] with KEY = VALUE; keys with dots \
               stand in quotation marks, such as \"mass.mass\" = [\"250 kg\", \"300 kg\"]"
            .into(),
    };
    let file: PlanFile = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    match (file.vary.is_empty(), file.case.first()) {
        (false, None) => {
            let factors = file.vary.into_iter().map(|(key, values)| match values {
                Json::Array(values) => Ok((key, values)),
                _ => Err(wrong(format!("[vary] {key:?}: not a list of values"))),
            });
            let factors = factors.collect::<Result<Vec<_>, _>>()?;
            SweepPlan::grid(&factors).map_err(|error| wrong(error.to_string()))
        }
        (true, Some(first)) => {
            let keys: Vec<String> = first.keys().cloned().collect();
            let cases = file.case.iter().enumerate().map(|(k, case)| {
                if let Some(other) = case.keys().find(|key| !keys.contains(key)) {
                    return Err(wrong(format!("[[case]] {k}: the first case has no {other:?}")));
                }
                keys.iter()
                    .map(|key| {
                        let missing = || wrong(format!("[[case]] {k}: there is no {key:?}"));
                        case.get(key).cloned().ok_or_else(missing)
                    })
                    .collect()
            });
            let cases = cases.collect::<Result<Vec<Vec<Json>>, _>>()?;
            Ok(SweepPlan { keys, cases })
        }
        (true, None) => Err(wrong("it varies nothing".into())),
        (false, Some(_)) => Err(wrong("it has both [vary] and [[case]]".into())),
    }
}

/// Keeps a case as the directory of a design.
fn keep(directory: &Path, files: &CaseFiles) -> Result<(), CliError> {
    let internal = |error: serde_json::Error| CliError::Internal(error.to_string());
    let _lock = lock(directory)?;
    let note = Note::new(&files.aircraft, &files.requirements);
    let mut all = note.files(&files.aircraft, &files.requirements);
    let schedule = files.schedule.to_json().map_err(|e| CliError::Internal(e.to_string()))?;
    let verification = serde_json::to_string_pretty(&files.verification).map_err(internal)? + "\n";
    all.push((NOTE.into(), note.to_json().map_err(internal)?.into_bytes()));
    all.push(("schedule.json".into(), schedule.into_bytes()));
    all.push(("verification.json".into(), verification.into_bytes()));
    output::write_set(directory, &all, true)
}

fn table(keys: &[String], rows: &BTreeMap<usize, CaseRow>) -> Table {
    let mut columns = vec![Column::text("case")];
    columns.extend(keys.iter().map(|key| Column::text(key)));
    columns.extend([
        Column::text("outcome"),
        Column::number("least margin", "%", Digits::Decimals(1)),
        Column::text("of"),
        Column::number("phase", "deg", Digits::Decimals(1)),
        Column::number("gain", "dB", Digits::Decimals(1)),
    ]);
    let mut table = Table::new("Sweep", columns);
    for row in rows.values() {
        let text = |key: &str| match row.row.get(key) {
            Some(Json::String(text)) => text.clone(),
            Some(Json::Null) | None => String::new(),
            Some(other) => other.to_string(),
        };
        let number = |key: &str| match row.row.get(key).and_then(Json::as_f64) {
            Some(value) => Cell::from(value),
            None => Cell::empty(),
        };
        let (word, highlight) = match row.status() {
            "met" => ("met".to_string(), Highlight::Good),
            "missed" => (format!("missed {}", text("missed")), Highlight::Warning),
            _ => (text("reason"), Highlight::Bad),
        };
        let mut of = text("least_margin_axis");
        if let Some(speed) = row.row.get("least_margin_speed_m_s").and_then(Json::as_f64) {
            of += &format!(" at {speed:.1} m/s, {}", text("least_margin_model"));
        }
        let mut cells = vec![Cell::from(text("case"))];
        cells.extend(keys.iter().map(|key| Cell::from(text(key))));
        cells.extend([
            Cell::from(word).highlight(highlight),
            number("least_margin_percent"),
            Cell::from(of),
            number("least_phase_margin_deg"),
            number("least_gain_margin_db"),
        ]);
        table.row(cells);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_parted_at_their_own_commas() {
        let (key, values) = factor("mass.mass=250 kg, 300 kg").unwrap();
        assert_eq!(key, "mass.mass");
        assert_eq!(values, [json!("250 kg"), json!("300 kg")]);
        let (_, values) = factor("a=1.5,true,[1, 2],\"x,y\"").unwrap();
        assert_eq!(values, [json!(1.5), json!(true), json!([1, 2]), json!("x,y")]);
        for bad in ["mass", "a=", "a=1,,2", "a=[1,2", "a=\"x"] {
            assert!(factor(bad).is_err(), "{bad}");
        }
    }
}
