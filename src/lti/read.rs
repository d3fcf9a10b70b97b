//! The forms in which a set comes: JSON, MAT level 5, CSV.
//!
//! Reading keeps the names and units of the file; [`super::resolve`] brings
//! them to ours.

use super::finding;
use super::mapping::{Mapping, is_alias};
use crate::linear::mat::{self, Variable};
use crate::problem::{Diagnostic, Report};
use crate::units::{FOOT, KNOT, Kind, parse_quantity};
use nalgebra::DMatrix;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A state, input or output as the file has it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct RawChannel {
    pub name: String,
    pub unit: Option<String>,
    /// Trim value in that unit.
    pub trim: Option<f64>,
    /// s.
    pub delay: f64,
    /// Least and greatest value in that unit.
    pub limits: [Option<f64>; 2],
}

/// A model as the file has it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RawModel {
    pub file: String,
    /// Such as `model 2 (20 kt)`.
    pub place: String,
    /// m/s.
    pub speed: f64,
    pub states: Vec<RawChannel>,
    pub inputs: Vec<RawChannel>,
    pub outputs: Vec<RawChannel>,
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub c: DMatrix<f64>,
    pub d: DMatrix<f64>,
    /// States whose equations are kinematics and are not in the file.
    pub kinematic: Vec<usize>,
    pub hardware_included: Option<bool>,
}

/// A set as its files have it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct RawSet {
    pub name: String,
    pub models: Vec<RawModel>,
    pub hardware_included: Option<bool>,
    pub texts: Vec<String>,
    /// Names of the files, without their directory.
    pub files: Vec<String>,
    pub is_directory: bool,
}

/// Most states, inputs or outputs that a file may have.
const MOST_CHANNELS: usize = 1000;

fn report(findings: Vec<Diagnostic>, unreadable: bool) -> Report {
    Report::new(findings, unreadable)
}

fn one(file: &str, place: &str, message: String, help: &str) -> Report {
    report(vec![finding(file, place, message, help.into())], false)
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, Report> {
    std::fs::read(path).map_err(|error| {
        let message = format!("the file cannot be read: {error}");
        let help = "a set of models is a directory of CSV tables, or a JSON, MAT or CSV file";
        report(vec![finding(&path.display().to_string(), "", message, help.into())], true)
    })
}

fn text_of(path: &Path) -> Result<String, Report> {
    String::from_utf8(bytes_of(path)?).map_err(|_| {
        let help = "a JSON or CSV file is text in UTF-8; a MAT file's name ends in .mat";
        one(&path.display().to_string(), "", "the file is not UTF-8 text".into(), help)
    })
}

/// Reads the files of a set.
///
/// # Errors
/// Files that cannot be read, or are not of their form.
pub(super) fn read(path: &Path, mapping: &Mapping) -> Result<RawSet, Report> {
    let file = path.display().to_string();
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut set = if path.is_dir() {
        directory(path, mapping)?
    } else {
        let extension =
            path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match extension.as_str() {
            "json" => json(&file, text_of(path)?)?,
            "mat" => matlab(&file, &bytes_of(path)?)?,
            "csv" => csv_file(&file, text_of(path)?, mapping)?,
            _ => {
                // A file that is not there is said to be that.
                bytes_of(path)?;
                let help = "give a directory of CSV tables, or a .json, .mat or .csv file";
                return Err(one(&file, "", format!("\"{extension}\" is no form of a set"), help));
            }
        }
    };
    if set.name.is_empty() {
        set.name = stem;
    }
    if set.models.is_empty() {
        let help = "docs/models.md shows what each form looks like";
        return Err(one(&file, "", "there is no model in it".into(), help));
    }
    Ok(set)
}

/// All CSV tables of a directory, by speed.
fn directory(path: &Path, mapping: &Mapping) -> Result<RawSet, Report> {
    let name = path.display().to_string();
    let entries = std::fs::read_dir(path).map_err(|error| {
        let message = format!("the directory cannot be read: {error}");
        report(vec![finding(&name, "", message, String::new())], true)
    })?;
    let mut files: Vec<_> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|file| file.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")))
        .collect();
    files.sort();
    let mut set = RawSet { is_directory: true, ..RawSet::default() };
    let mut findings = Vec::new();
    for file in files {
        match text_of(&file).and_then(|text| csv_file(&file.display().to_string(), text, mapping)) {
            Ok(one) => {
                set.models.extend(one.models);
                set.texts.extend(one.texts);
                set.files.extend(one.files);
                if set.name.is_empty() {
                    set.name = one.name;
                }
            }
            Err(wrong) if wrong.unreadable => return Err(wrong),
            Err(wrong) => findings.extend(wrong.errors),
        }
    }
    if !findings.is_empty() {
        return Err(report(findings, false));
    }
    // The order of file names says nothing.
    set.models.sort_by(|a, b| a.speed.total_cmp(&b.speed));
    if set.name.is_empty() {
        set.name = path.file_name().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    }
    Ok(set)
}

fn file_name(file: &str) -> String {
    Path::new(file).file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

fn place_of(index: usize, speed: f64) -> String {
    format!("model {} ({} kt)", index + 1, shown(speed / KNOT))
}

fn shown(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

fn included(word: &str, file: &str) -> Result<bool, Report> {
    match word {
        "separate" => Ok(false),
        "included" => Ok(true),
        other => Err(one(
            file,
            "hardware",
            format!("\"{other}\" is not one of the values"),
            "write \"separate\", or \"included\" where actuators, delays and sensors are in the \
             models",
        )),
    }
}

// JSON

#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
struct ChannelFile {
    name: String,
    unit: Option<String>,
    delay_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)] // what is not needed may stand in the file
struct ModelFile {
    schema: Option<String>,
    name: Option<String>,
    source: Option<String>,
    interactions: Option<bool>,
    hardware: Option<String>,
    speed_kt: Option<f64>,
    speed: Option<String>,
    states: Option<Vec<ChannelFile>>,
    inputs: Option<Vec<ChannelFile>>,
    outputs: Option<Vec<ChannelFile>>,
    a: Vec<Vec<f64>>,
    b: Vec<Vec<f64>>,
    c: Option<Vec<Vec<f64>>>,
    d: Option<Vec<Vec<f64>>>,
    x0: Option<Vec<f64>>,
    u0: Option<Vec<f64>>,
    u_min: Option<Vec<f64>>,
    u_max: Option<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)]
struct SetFile {
    schema: String,
    name: Option<String>,
    source: Option<String>,
    interactions: Option<bool>,
    hardware: Option<String>,
    states: Option<Vec<ChannelFile>>,
    inputs: Option<Vec<ChannelFile>>,
    outputs: Option<Vec<ChannelFile>>,
    models: Vec<ModelFile>,
}

#[derive(Deserialize)]
struct SchemaOnly {
    schema: Option<String>,
}

fn json(file: &str, text: String) -> Result<RawSet, Report> {
    use crate::linear::io::{LTI_SCHEMA, LTI_SET_SCHEMA};
    let wrong = |error: serde_json::Error| {
        let mut d = finding(
            file,
            "",
            error.to_string(),
            "docs/models.md and `coaxdesign schema --of lti-set` tell the keys".into(),
        );
        (d.line, d.column) = (error.line(), error.column());
        report(vec![d], false)
    };
    let schema = serde_json::from_str::<SchemaOnly>(&text).map_err(wrong)?.schema;
    let whole: SetFile = match schema.as_deref() {
        Some(LTI_SET_SCHEMA) => serde_json::from_str(&text).map_err(wrong)?,
        Some(LTI_SCHEMA) => {
            let model: ModelFile = serde_json::from_str(&text).map_err(wrong)?;
            SetFile {
                schema: LTI_SET_SCHEMA.into(),
                name: model.name.clone(),
                source: None,
                interactions: None,
                hardware: model.hardware.clone(),
                states: None,
                inputs: None,
                outputs: None,
                models: vec![model],
            }
        }
        other => {
            let message = match other {
                Some(other) => format!("schema is \"{other}\""),
                None => "there is no schema".into(),
            };
            let help = format!("write \"schema\": \"{LTI_SET_SCHEMA}\"");
            return Err(one(file, "schema", message, &help));
        }
    };
    let hardware_included = whole.hardware.as_deref().map(|w| included(w, file)).transpose()?;
    let mut set = RawSet {
        name: whole.name.clone().unwrap_or_default(),
        hardware_included,
        texts: vec![text],
        files: vec![file_name(file)],
        ..RawSet::default()
    };
    let mut findings = Vec::new();
    for (k, model) in whole.models.iter().enumerate() {
        match json_model(file, k, model, &whole) {
            Ok(model) => set.models.push(model),
            Err(wrong) => findings.extend(wrong.errors),
        }
    }
    if findings.is_empty() { Ok(set) } else { Err(report(findings, false)) }
}

fn json_model(
    file: &str,
    index: usize,
    model: &ModelFile,
    whole: &SetFile,
) -> Result<RawModel, Report> {
    let speed = match (model.speed_kt, &model.speed) {
        (Some(kt), None) => kt * KNOT,
        (None, Some(text)) => speed_text(text)
            .map_err(|message| one(file, &format!("model {}", index + 1), message, SPEED_HELP))?,
        (Some(_), Some(_)) => {
            let message = "speed and speed_kt are both given".into();
            return Err(one(file, &format!("model {}", index + 1), message, SPEED_HELP));
        }
        (None, None) => {
            let message = "the speed is missing".into();
            return Err(one(file, &format!("model {}", index + 1), message, SPEED_HELP));
        }
    };
    let place = place_of(index, speed);
    let channels = |own: &Option<Vec<ChannelFile>>,
                    shared: &Option<Vec<ChannelFile>>,
                    trim: &Option<Vec<f64>>,
                    role: &str| {
        let list = own.clone().or_else(|| shared.clone()).unwrap_or_default();
        if let Some(trim) = trim
            && trim.len() != list.len()
        {
            let message = format!("{} trim values stand beside {} {role}s", trim.len(), list.len());
            return Err(one(file, &place, message, "give x0 and u0 in the order of the channels"));
        }
        Ok(list
            .into_iter()
            .enumerate()
            .map(|(k, c)| RawChannel {
                name: c.name,
                unit: c.unit,
                trim: trim.as_ref().map(|t| t[k]),
                delay: c.delay_s.unwrap_or(0.0),
                limits: [None; 2],
            })
            .collect::<Vec<_>>())
    };
    let states = channels(&model.states, &whole.states, &model.x0, "state")?;
    let mut inputs = channels(&model.inputs, &whole.inputs, &model.u0, "input")?;
    for (k, (key, ends)) in
        [("u_min", &model.u_min), ("u_max", &model.u_max)].into_iter().enumerate()
    {
        let Some(ends) = ends else { continue };
        if ends.len() != inputs.len() {
            let message =
                format!("{} values of {key} stand beside {} inputs", ends.len(), inputs.len());
            return Err(one(file, &place, message, "give it in the order of the inputs"));
        }
        for (input, end) in inputs.iter_mut().zip(ends) {
            input.limits[k] = Some(*end);
        }
    }
    let outputs = channels(&model.outputs, &whole.outputs, &None, "output")?;
    let (n, m, p) = (states.len(), inputs.len(), outputs.len());
    let matrix = |key: &str, rows: &[Vec<f64>], row_count: usize, column_count: usize| {
        let size = |found: String| {
            let message = format!(
                "\"{key}\" has {found}, but the channels ask for {row_count} by {column_count}"
            );
            one(file, &place, message, "rows and columns are in the order of the channels")
        };
        if rows.len() != row_count {
            return Err(size(format!("{} rows", rows.len())));
        }
        if let Some((i, row)) = rows.iter().enumerate().find(|(_, r)| r.len() != column_count) {
            return Err(size(format!("{} entries in row {}", row.len(), i + 1)));
        }
        Ok(DMatrix::from_fn(row_count, column_count, |i, j| rows[i][j]))
    };
    let optional = |key: &str, rows: &Option<Vec<Vec<f64>>>, columns: usize| match rows {
        Some(rows) => matrix(key, rows, p, columns),
        None if p == 0 || key == "d" => Ok(DMatrix::zeros(p, columns)),
        None => {
            Err(one(file, &place, format!("\"{key}\" is missing"), "outputs need their rows of C"))
        }
    };
    Ok(RawModel {
        a: matrix("a", &model.a, n, n)?,
        b: matrix("b", &model.b, n, m)?,
        c: optional("c", &model.c, n)?,
        d: optional("d", &model.d, m)?,
        file: file.into(),
        place,
        speed,
        states,
        inputs,
        outputs,
        kinematic: Vec::new(),
        hardware_included: model.hardware.as_deref().map(|w| included(w, file)).transpose()?,
    })
}

const SPEED_HELP: &str = "give the true airspeed of every model, such as speed = 20 kt";

fn speed_text(text: &str) -> Result<f64, String> {
    parse_quantity(text, Kind::Airspeed).map_err(|error| format!("the speed: {error}"))
}

// MAT

/// A field of a MAT file by any of its spellings.
fn field<'a>(fields: &'a BTreeMap<String, Variable>, names: &[&str]) -> Option<&'a Variable> {
    names.iter().find_map(|name| fields.get(*name))
}

const STATE_NAMES: &[&str] = &["state_names", "StateName", "states"];
const INPUT_NAMES: &[&str] = &["input_names", "InputName", "inputs"];
const OUTPUT_NAMES: &[&str] = &["output_names", "OutputName", "outputs"];
const STATE_UNITS: &[&str] = &["state_units", "StateUnit"];
const INPUT_UNITS: &[&str] = &["input_units", "InputUnit"];
const OUTPUT_UNITS: &[&str] = &["output_units", "OutputUnit"];

fn matlab(file: &str, bytes: &[u8]) -> Result<RawSet, Report> {
    let variables = mat::read(bytes).map_err(|error| {
        one(file, "", error.to_string(), "save with MATLAB's save(..., '-v7'), or SciPy's savemat")
    })?;
    // The matrices stand by themselves, or in one struct.
    let elements: Vec<&BTreeMap<String, Variable>> = if field(&variables, &["A", "a"]).is_some() {
        vec![&variables]
    } else {
        let structs: Vec<&Vec<BTreeMap<String, Variable>>> = variables
            .values()
            .filter_map(|v| match v {
                Variable::Structs(list) if list.iter().any(|f| field(f, &["A", "a"]).is_some()) => {
                    Some(list)
                }
                _ => None,
            })
            .collect();
        match structs.as_slice() {
            [only] => only.iter().collect(),
            [] => {
                return Err(one(
                    file,
                    "",
                    "it holds no matrix A, nor a struct with one".into(),
                    "MATLAB saves an ss object in a form that only it reads: save [A,B,C,D] = \
                     ssdata(sys) as docs/models.md shows",
                ));
            }
            _ => {
                let message = "several structs in it hold a matrix A".into();
                return Err(one(file, "", message, "save one of them"));
            }
        }
    };
    let mut set = RawSet {
        // The matrices as numbers stand for the text of the file.
        texts: vec![bytes.iter().map(|b| char::from(*b)).collect()],
        files: vec![file_name(file)],
        ..RawSet::default()
    };
    if let Some(Variable::Text(name)) = field(&variables, &["name"]) {
        set.name.clone_from(name);
    }
    if let Some(Variable::Text(word)) = field(&variables, &["hardware"]) {
        set.hardware_included = Some(included(word, file)?);
    }
    let mut findings = Vec::new();
    for fields in elements {
        // Names may stand beside the struct, for all of its elements.
        let look = |names: &[&str]| field(fields, names).or_else(|| field(&variables, names));
        match mat_models(file, set.models.len(), &look) {
            Ok(models) => set.models.extend(models),
            Err(wrong) => findings.extend(wrong.errors),
        }
    }
    if findings.is_empty() { Ok(set) } else { Err(report(findings, false)) }
}

/// Models of one set of fields: one, or one for each page of the matrices.
fn mat_models<'a>(
    file: &str,
    first: usize,
    look: &dyn Fn(&[&str]) -> Option<&'a Variable>,
) -> Result<Vec<RawModel>, Report> {
    let wrong = |place: &str, message: String, help: &str| one(file, place, message, help);
    let speeds = match (look(&["speed_kt"]), look(&["speed_m_s"]), look(&["speed_ft_s"])) {
        (Some(Variable::Numbers { values, .. }), None, None) => {
            values.iter().map(|v| v * KNOT).collect::<Vec<_>>()
        }
        (None, Some(Variable::Numbers { values, .. }), None) => values.clone(),
        (None, None, Some(Variable::Numbers { values, .. })) => {
            values.iter().map(|v| v * FOOT).collect()
        }
        _ => {
            return Err(wrong(
                "speed_kt",
                "the speeds are missing".into(),
                "save the true airspeeds as one of speed_kt, speed_m_s, speed_ft_s",
            ));
        }
    };
    let count = speeds.len();
    let pages = |name: &str, other: &str, must: bool| -> Result<Vec<DMatrix<f64>>, Report> {
        let Some(variable) = look(&[name, other]) else {
            return if must {
                Err(wrong(name, format!("the matrix {name} is missing"), "save A, B, C and D"))
            } else {
                Ok(Vec::new())
            };
        };
        let found = mat_pages(variable, count).ok_or_else(|| {
            let message = format!("{name} has no {count} pages, one a speed");
            wrong(name, message, "the third index, or the cell, runs over the speeds")
        })?;
        Ok(found)
    };
    let (a, b) = (pages("A", "a", true)?, pages("B", "b", true)?);
    let (c, d) = (pages("C", "c", false)?, pages("D", "d", false)?);
    let columns = |names: &[&str], size: usize| -> Result<Option<DMatrix<f64>>, Report> {
        match look(names) {
            None => Ok(None),
            Some(Variable::Numbers { values, .. }) if values.len() == size * count => {
                Ok(Some(DMatrix::from_column_slice(size, count, values)))
            }
            Some(_) => Err(wrong(
                names[0],
                format!("{} is not {size} by {count}, one column a speed", names[0]),
                "save the trims as columns, in the order of the speeds",
            )),
        }
    };
    let mut models = Vec::new();
    let x0 = columns(&["x0", "X0"], a[0].nrows())?;
    let u0 = columns(&["u0", "U0"], b[0].ncols())?;
    for k in 0..count {
        let place = place_of(first + k, speeds[k]);
        let channels = |names: &[&str],
                        units: &[&str],
                        delays: &[&str],
                        size: usize,
                        role: &str| {
            let texts = |names: &[&str]| match look(names) {
                Some(Variable::Texts(list)) => Some(list.clone()),
                Some(Variable::Text(one)) => Some(vec![one.clone()]),
                _ => None,
            };
            let Some(list) = texts(names).filter(|list| list.len() == size) else {
                let message = format!("there are no {size} names of the {role}s");
                let help = format!(
                    "save {} as a cell array of {size} texts (in MATLAB: sys.{})",
                    names[0], names[1]
                );
                return Err(wrong(&place, message, &help));
            };
            let units = texts(units);
            let delays = match look(delays) {
                Some(Variable::Numbers { values, .. }) if values.len() == size => values.clone(),
                _ => vec![0.0; size],
            };
            Ok(list
                .into_iter()
                .enumerate()
                .map(|(i, name)| RawChannel {
                    name,
                    unit: units.as_ref().and_then(|u| u.get(i).cloned()).filter(|u| !u.is_empty()),
                    trim: None,
                    delay: delays[i],
                    limits: [None; 2],
                })
                .collect::<Vec<_>>())
        };
        let (n, m) = (a[k].nrows(), b[k].ncols());
        let p = c.get(k).map_or(0, DMatrix::nrows);
        let mut states = channels(STATE_NAMES, STATE_UNITS, &[], n, "state")?;
        let mut inputs =
            channels(INPUT_NAMES, INPUT_UNITS, &["input_delays_s", "InputDelay"], m, "input")?;
        let outputs = if p == 0 {
            Vec::new()
        } else {
            channels(OUTPUT_NAMES, OUTPUT_UNITS, &["output_delays_s", "OutputDelay"], p, "output")?
        };
        for (list, trims) in [(&mut states, &x0), (&mut inputs, &u0)] {
            if let Some(trims) = trims {
                for (i, channel) in list.iter_mut().enumerate() {
                    channel.trim = Some(trims[(i, k)]);
                }
            }
        }
        for (end, name) in ["u_min", "u_max"].into_iter().enumerate() {
            match look(&[name]) {
                None => {}
                Some(Variable::Numbers { values, .. }) if values.len() == m => {
                    for (input, value) in inputs.iter_mut().zip(values) {
                        input.limits[end] = Some(*value);
                    }
                }
                Some(_) => {
                    let message = format!("{name} has not {m} values, one an input");
                    return Err(wrong(name, message, "give it in the order of the inputs"));
                }
            }
        }
        for (what, found, rows, cols) in [
            ("A", Some(&a[k]), n, n),
            ("B", Some(&b[k]), n, m),
            ("C", c.get(k), p, n),
            ("D", d.get(k), p, m),
        ] {
            if let Some(found) = found
                && found.shape() != (rows, cols)
            {
                let (i, j) = found.shape();
                let message = format!("{what} is {i} by {j}, not {rows} by {cols}");
                return Err(wrong(&place, message, "sizes must fit the names"));
            }
        }
        models.push(RawModel {
            file: file.into(),
            place,
            speed: speeds[k],
            c: c.get(k).cloned().unwrap_or_else(|| DMatrix::zeros(p, n)),
            d: d.get(k).cloned().unwrap_or_else(|| DMatrix::zeros(p, m)),
            a: a[k].clone(),
            b: b[k].clone(),
            states,
            inputs,
            outputs,
            kinematic: Vec::new(),
            hardware_included: None,
        });
    }
    Ok(models)
}

/// Pages of a three-dimensional array, or the matrices of a cell.
fn mat_pages(variable: &Variable, count: usize) -> Option<Vec<DMatrix<f64>>> {
    match variable {
        Variable::Numbers { dimensions, values } => {
            let (rows, columns) = (*dimensions.first()?, *dimensions.get(1)?);
            let size = rows * columns;
            (values.len() == size * count && count > 0).then(|| {
                (0..count)
                    .map(|k| {
                        DMatrix::from_column_slice(rows, columns, &values[k * size..(k + 1) * size])
                    })
                    .collect()
            })
        }
        Variable::Cells(cells) if cells.len() == count && count > 0 => cells
            .iter()
            .map(|cell| mat_pages(cell.as_ref()?, 1).and_then(|mut one| one.pop()))
            .collect(),
        _ => None,
    }
}

// CSV

/// A CSV file: a table of one model, or the long form that `linearize` writes.
fn csv_file(file: &str, text: String, mapping: &Mapping) -> Result<RawSet, Report> {
    let mut set = RawSet::default();
    let mut meta: BTreeMap<String, (usize, String)> = BTreeMap::new();
    let mut lines: Vec<(usize, Vec<String>)> = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let trimmed = line.trim().trim_start_matches('\u{feff}');
        if let Some(comment) = trimmed.strip_prefix('#') {
            if let Some((key, value)) = comment.split_once(':') {
                let key = key.trim().to_lowercase();
                meta.entry(key).or_insert((k + 1, value.trim().to_owned()));
            }
            continue;
        }
        if trimmed.is_empty() {
            continue;
        }
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(trimmed.as_bytes());
        let record = reader.records().next().transpose().map_err(|error| {
            at_line(file, k + 1, "", error.to_string(), "write comma-separated values".into())
        })?;
        let Some(record) = record else { continue };
        lines.push((k + 1, record.iter().map(str::to_owned).collect()));
    }
    let get = |key: &str| meta.get(key).map(|(_, value)| value.clone());
    set.name = get("name").unwrap_or_default();
    let hardware_included = get("hardware").map(|w| included(&w, file)).transpose()?;
    set.hardware_included = hardware_included;
    let long = lines.first().is_some_and(|(_, head)| {
        head.len() == 7 && head[0] == "speed_kt" && head[1] == "matrix" && head[6] == "value"
    });
    if long {
        set.models = long_form(file, &lines[1..])?;
    } else if !lines.is_empty() {
        let (line, text) = meta.get("speed").ok_or_else(|| {
            let help = "add a line such as # speed: 20 kt at the top";
            one(file, "", "the speed is missing".into(), help)
        })?;
        let speed = speed_text(text)
            .map_err(|message| at_line(file, *line, "", message, SPEED_HELP.into()))?;
        set.models.push(table_form(file, speed, &lines, mapping)?);
    }
    for model in &mut set.models {
        model.hardware_included = hardware_included;
    }
    set.texts.push(text);
    set.files.push(file_name(file));
    Ok(set)
}

fn at_line(file: &str, line: usize, place: &str, message: String, help: String) -> Report {
    let mut d = finding(file, place, message, help);
    (d.line, d.column) = (line, 1);
    report(vec![d], false)
}

fn csv_number(file: &str, line: usize, place: &str, text: &str) -> Result<f64, Report> {
    let text = text.replace('\u{2212}', "-");
    if text.is_empty() {
        return Ok(0.0);
    }
    text.parse().map_err(|_| {
        at_line(
            file,
            line,
            place,
            format!("\"{text}\" is not a number"),
            "write numbers with a decimal point; an empty cell is zero".into(),
        )
    })
}

/// Rows of a table that are no equations.
const SPECIAL: [&str; 5] = ["unit", "trim", "delay", "least", "greatest"];

/// A derivative table as papers print it: a column a state and an input, a row
/// an equation. Rows named `unit`, `trim`, `delay`, `least` and `greatest` say
/// these of the columns.
/// A row whose name is that of a column is the equation of that state, any
/// other row an output.
fn table_form(
    file: &str,
    speed: f64,
    lines: &[(usize, Vec<String>)],
    mapping: &Mapping,
) -> Result<RawModel, Report> {
    let place = place_of(0, speed);
    let (head_line, head) = &lines[0];
    // A second column may say the unit of the rows.
    let unit_column = head.get(1).is_some_and(|c| c == "unit");
    let first = if unit_column { 2 } else { 1 };
    let names: Vec<&String> = head.iter().skip(first).collect();
    if names.is_empty() || names.len() > MOST_CHANNELS {
        let help = "the first row names the columns: states, then inputs".into();
        return Err(at_line(file, *head_line, &place, "the table has no columns".into(), help));
    }
    if let Some(twice) = names.iter().enumerate().find(|(k, n)| names[..*k].contains(n)) {
        let message = format!("two columns are named \"{}\"", twice.1);
        return Err(at_line(file, *head_line, &place, message, "name each column once".into()));
    }
    let mut special: BTreeMap<&str, &(usize, Vec<String>)> = BTreeMap::new();
    let mut rows: BTreeMap<&str, &(usize, Vec<String>)> = BTreeMap::new();
    let mut output_rows: Vec<&(usize, Vec<String>)> = Vec::new();
    for entry in &lines[1..] {
        let (line, cells) = entry;
        let name = cells[0].as_str();
        if cells.len() != head.len() {
            let message = format!("row {name} has {} cells, the first {}", cells.len(), head.len());
            let help = "every row has a cell for every column".into();
            return Err(at_line(file, *line, &place, message, help));
        }
        let before = if SPECIAL.contains(&name) {
            special.insert(SPECIAL[SPECIAL.iter().position(|s| *s == name).unwrap_or(0)], entry)
        } else if names.iter().any(|n| *n == name) {
            rows.insert(name, entry)
        } else {
            output_rows.push(entry);
            None
        };
        if before.is_some() {
            let message = format!("there are two rows {name}");
            return Err(at_line(file, *line, &place, message, "give each row once".into()));
        }
    }
    let stands_for = |name: &str, ours: &[usize]| {
        ours.iter().any(|k| match &mapping.names[*k] {
            Some(mapped) => mapped.name == name,
            None => is_alias(name, *k),
        })
    };
    // An attitude without a row follows from the rates; other states need one.
    let attitude = |name: &str| stands_for(name, &[6, 7]);
    if let Some(name) =
        names.iter().find(|n| !rows.contains_key(n.as_str()) && stands_for(n, &[0, 1, 2, 3, 4, 5]))
    {
        let message = format!("the state {name} is a column, but its row is missing");
        let help = format!("add the row {name}: its rate per state and input");
        return Err(at_line(file, *head_line, &format!("{place}, row {name}"), message, help));
    }
    let columns: Vec<usize> = (0..names.len()).collect();
    let (state_columns, input_columns): (Vec<usize>, Vec<usize>) = columns
        .into_iter()
        .partition(|k| rows.contains_key(names[*k].as_str()) || attitude(names[*k]));
    let channel = |k: usize| -> Result<RawChannel, Report> {
        let cell = |kind: &str| special.get(kind).map(|(line, cells)| (*line, &cells[first + k]));
        let name = names[k].clone();
        let number = |kind: &str| match cell(kind) {
            Some((line, text)) if !text.is_empty() => {
                csv_number(file, line, &format!("{place}, {kind} of {name}"), text).map(Some)
            }
            _ => Ok(None),
        };
        let delay = match cell("delay") {
            Some((line, text)) if !text.is_empty() => {
                let text = if text.parse::<f64>() == Ok(0.0) { "0 s" } else { text.as_str() };
                parse_quantity(text, Kind::Time).map_err(|error| {
                    let place = format!("{place}, delay of {name}");
                    at_line(file, line, &place, error.to_string(), error.help())
                })?
            }
            _ => 0.0,
        };
        let unit = cell("unit").map(|(_, u)| u.clone()).filter(|u| !u.is_empty());
        let limits = [number("least")?, number("greatest")?];
        Ok(RawChannel { unit, trim: number("trim")?, delay, name, limits })
    };
    let states = state_columns.iter().map(|k| channel(*k)).collect::<Result<Vec<_>, _>>()?;
    let inputs = input_columns.iter().map(|k| channel(*k)).collect::<Result<Vec<_>, _>>()?;
    let values = |entry: &(usize, Vec<String>), which: &[usize]| -> Result<Vec<f64>, Report> {
        let (line, cells) = entry;
        which
            .iter()
            .map(|k| {
                let place = format!("{place}, row {}, column {}", cells[0], names[*k]);
                csv_number(file, *line, &place, &cells[first + *k])
            })
            .collect()
    };
    let (n, m, p) = (states.len(), inputs.len(), output_rows.len());
    let (mut a, mut b) = (DMatrix::zeros(n, n), DMatrix::zeros(n, m));
    let (mut c, mut d) = (DMatrix::zeros(p, n), DMatrix::zeros(p, m));
    let mut kinematic = Vec::new();
    for (i, state) in states.iter().enumerate() {
        let Some(entry) = rows.get(state.name.as_str()) else {
            kinematic.push(i);
            continue;
        };
        if unit_column && !entry.1[1].is_empty() && Some(&entry.1[1]) != state.unit.as_ref() {
            let message = format!(
                "row {} is in {} a second, but its column in {}",
                state.name,
                entry.1[1],
                state.unit.as_deref().unwrap_or("no unit")
            );
            let help = "write the unit of the state in both, or in the unit row alone".into();
            return Err(at_line(file, entry.0, &place, message, help));
        }
        for (j, value) in values(entry, &state_columns)?.into_iter().enumerate() {
            a[(i, j)] = value;
        }
        for (j, value) in values(entry, &input_columns)?.into_iter().enumerate() {
            b[(i, j)] = value;
        }
    }
    let mut outputs = Vec::new();
    for (i, entry) in output_rows.iter().enumerate() {
        outputs.push(RawChannel {
            name: entry.1[0].clone(),
            unit: unit_column.then(|| entry.1[1].clone()).filter(|u| !u.is_empty()),
            ..RawChannel::default()
        });
        for (j, value) in values(entry, &state_columns)?.into_iter().enumerate() {
            c[(i, j)] = value;
        }
        for (j, value) in values(entry, &input_columns)?.into_iter().enumerate() {
            d[(i, j)] = value;
        }
    }
    Ok(RawModel {
        file: file.into(),
        place,
        speed,
        states,
        inputs,
        outputs,
        a,
        b,
        c,
        d,
        kinematic,
        hardware_included: None,
    })
}

/// Every entry on a line of its own: `speed_kt,matrix,row,row_unit,column,
/// column_unit,value`; trims as matrices `x0` and `u0`, and limits of the inputs
/// as `u_min` and `u_max`, without a column.
fn long_form(file: &str, lines: &[(usize, Vec<String>)]) -> Result<Vec<RawModel>, Report> {
    struct Part {
        speed: f64,
        channels: [Vec<RawChannel>; 3],
        entries: Vec<(usize, usize, usize, f64)>,
    }
    const MATRICES: [&str; 8] = ["A", "B", "C", "D", "x0", "u0", "u_min", "u_max"];
    // Roles of rows and columns: 0 states, 1 inputs, 2 outputs.
    const ROLES: [(usize, Option<usize>); 8] = [
        (0, Some(0)),
        (0, Some(1)),
        (2, Some(0)),
        (2, Some(1)),
        (0, None),
        (1, None),
        (1, None),
        (1, None),
    ];
    let mut parts: Vec<Part> = Vec::new();
    for (line, cells) in lines {
        if cells.len() != 7 {
            let message = format!("a row of {} cells where 7 are needed", cells.len());
            return Err(at_line(file, *line, "", message, String::new()));
        }
        let speed = csv_number(file, *line, "speed_kt", &cells[0])? * KNOT;
        let Some(matrix) = MATRICES.iter().position(|name| *name == cells[1]) else {
            let message = format!("there is no matrix \"{}\"", cells[1]);
            let help = format!("write one of {}", MATRICES.join(", "));
            return Err(at_line(file, *line, "", message, help));
        };
        let value = csv_number(file, *line, &cells[2], &cells[6])?;
        let index = parts.iter().position(|p| p.speed == speed).unwrap_or_else(|| {
            parts.push(Part { speed, channels: Default::default(), entries: Vec::new() });
            parts.len() - 1
        });
        let part = &mut parts[index];
        let mut channel = |role: usize, name: &str, unit: &str| {
            let list = &mut part.channels[role];
            list.iter().position(|c| c.name == name).unwrap_or_else(|| {
                list.push(RawChannel {
                    name: name.into(),
                    unit: Some(unit.to_owned()).filter(|u| !u.is_empty()),
                    ..RawChannel::default()
                });
                list.len() - 1
            })
        };
        let (row_role, column_role) = ROLES[matrix];
        let row = channel(row_role, &cells[2], &cells[3]);
        match column_role {
            Some(role) => {
                let column = channel(role, &cells[4], &cells[5]);
                part.entries.push((matrix, row, column, value));
            }
            None => {
                let channel = &mut part.channels[row_role][row];
                match MATRICES[matrix] {
                    "u_min" => channel.limits[0] = Some(value),
                    "u_max" => channel.limits[1] = Some(value),
                    _ => channel.trim = Some(value),
                }
            }
        }
    }
    Ok(parts
        .into_iter()
        .enumerate()
        .map(|(k, part)| {
            let [states, inputs, outputs] = part.channels;
            let (n, m, p) = (states.len(), inputs.len(), outputs.len());
            let mut all = [
                DMatrix::zeros(n, n),
                DMatrix::zeros(n, m),
                DMatrix::zeros(p, n),
                DMatrix::zeros(p, m),
            ];
            for (matrix, row, column, value) in part.entries {
                all[matrix][(row, column)] = value;
            }
            let [a, b, c, d] = all;
            RawModel {
                file: file.into(),
                place: place_of(k, part.speed),
                speed: part.speed,
                states,
                inputs,
                outputs,
                a,
                b,
                c,
                d,
                kinematic: Vec::new(),
                hardware_included: None,
            }
        })
        .collect())
}
