//! Schedules of other programs, or written by hand: JSON, TOML, CSV, MAT.
//!
//! A file may be one of our own exports, or hold any part of one: the gains of
//! a few speeds, say. What it leaves out is taken from a base schedule; without
//! a base everything must be there. With a base the file is an edit: the base's
//! breakpoints stay. [`Breakpoints`] says otherwise. Speeds are in m/s,
//! or texts with a unit such as `"40 kt"`. Nothing that comes from outside
//! counts as verified.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::csv::Line;
use super::description::{self, DERIVED, Description, DescriptionError, FIXED, FORMS};
use crate::control::axis::Channel;
use crate::control::law::LawTable;
use crate::linear::mat::{self, MatError, Variable};
use crate::problem::{LONGEST_LINE, visible};
use crate::schedule::{self, Provenance, Schedule, ScheduleError};
use crate::units::{Kind, parse_quantity};

/// Why a file cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Not of this form.
    #[error("{0}")]
    Form(String),
    /// A MAT file that cannot be read.
    #[error(transparent)]
    Mat(#[from] MatError),
    /// A name that does not exist.
    #[error("there is no {what} '{name}'{}", near.as_ref().map_or(String::new(), |n| format!("; did you mean '{n}'?")))]
    Unknown {
        /// Table, row, constant, ...
        what: String,
        /// What the file says.
        name: String,
        /// The nearest name that exists.
        near: Option<String>,
    },
    /// A speed that cannot be read.
    #[error("the speed {text} cannot be read: {reason}")]
    Speed {
        /// What the file says.
        text: String,
        /// Why.
        reason: String,
    },
    /// A whole law at other speeds than the base's.
    #[error(
        "the file holds a whole law at {file} speeds, and the base has breakpoints at {base} \
         others: it may replace the base's law or be put into it"
    )]
    Breakpoints {
        /// Speeds of the file.
        file: usize,
        /// Breakpoints of the base that the file does not have.
        base: usize,
    },
    /// A value that is given twice.
    #[error("{0} is given twice")]
    Twice(String),
    /// Nothing to fill what is left out from.
    #[error("{} left out, and no base schedule is given: {}", if names.len() == 1 { "a quantity is" } else { "quantities are" }, names.join(", "))]
    Missing {
        /// Tables and constants, with the first speed where one is missing.
        names: Vec<String>,
    },
    /// Unit of a quantity, or a law that is none.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The law.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
}

/// Forms that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// `schedule.json`, our JSON export, or a part of either.
    Json,
    /// The same in TOML.
    Toml,
    /// Our CSV export, or some of its lines.
    Csv,
    /// MAT level 5 with the variables of our export, or some of them.
    Mat,
}

/// Which breakpoints the schedule gets where there is a base.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Breakpoints {
    /// The base's, with the file's values put in; a file that holds a whole law
    /// at other speeds than the base's is refused, because it may mean either.
    #[default]
    Unsaid,
    /// The base's and the file's.
    Base,
    /// The file's only.
    File,
}

/// What a file says.
#[derive(Debug, Clone, PartialEq, Default)]
struct Partial {
    name: Option<String>,
    provenance: Option<Provenance>,
    constants: BTreeMap<String, f64>,
    /// Speeds in m/s, in the file's order.
    speeds: Vec<f64>,
    /// `(form, speed's place, row, column)`.
    entries: BTreeMap<(usize, usize, usize, usize), f64>,
}

/// A schedule that was read, and what had to be taken from the base.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The schedule; its requirements count as not met.
    pub schedule: Schedule,
    /// Names of tables and constants that the file left out, in part or whole.
    pub from_base: Vec<String>,
    /// Breakpoints of the base at which the file says nothing and that stay, m/s.
    pub kept: Vec<f64>,
    /// Breakpoints of the base that are left out, m/s.
    pub dropped: Vec<f64>,
}

/// The nearest of some names.
fn near<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    known
        .map(|k| (strsim::damerau_levenshtein(name, k), k))
        .filter(|(d, k)| *d <= 1 + k.len() / 3)
        .min()
        .map(|(_, k)| k.to_string())
}

fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str>) -> ImportError {
    ImportError::Unknown { what: what.into(), name: name.into(), near: near(name, known) }
}

impl Partial {
    fn speed(&mut self, speed: f64) -> usize {
        if let Some(k) = self.speeds.iter().position(|s| *s == speed) {
            return k;
        }
        self.speeds.push(speed);
        self.speeds.len() - 1
    }

    fn entry(
        &mut self,
        table: &str,
        row: &str,
        column: &str,
        k: usize,
        value: f64,
    ) -> Result<(), ImportError> {
        let form = form_of(table)?;
        let (i, j) = FORMS[form].place(row, column).ok_or_else(|| {
            let places = FORMS[form].places();
            unknown(
                &format!("row and column of table '{table}'"),
                &format!("{row} {column}"),
                places.iter().map(String::as_str),
            )
        })?;
        self.put(form, k, i, j, value)
    }

    fn put(
        &mut self,
        form: usize,
        k: usize,
        i: usize,
        j: usize,
        value: f64,
    ) -> Result<(), ImportError> {
        if self.entries.insert((form, k, i, j), value).is_some() {
            return Err(ImportError::Twice(format!(
                "row {}, column {} of '{}' at {} m/s",
                i + 1,
                j + 1,
                FORMS[form].name,
                self.speeds[k]
            )));
        }
        Ok(())
    }

    fn constant(&mut self, name: &str, value: f64) -> Result<(), ImportError> {
        if !description::constant_names().any(|n| n == name) {
            return Err(unknown("constant", name, description::constant_names()));
        }
        if self.constants.insert(name.into(), value).is_some() {
            return Err(ImportError::Twice(format!("constant '{name}'")));
        }
        Ok(())
    }
}

impl Partial {
    /// Whether it has every entry of the tables at every one of its speeds.
    fn is_whole(&self) -> bool {
        FORMS.iter().enumerate().all(|(form, f)| {
            let (rows, columns) = f.size();
            (0..rows).all(|i| {
                // A gain that does not exist need not be there.
                let first = match Channel::ALL.get(i) {
                    Some(channel) if f.name == "gains" => columns - channel.gains().len(),
                    _ => 0,
                };
                (first..columns).all(|j| {
                    (0..self.speeds.len()).all(|k| self.entries.contains_key(&(form, k, i, j)))
                })
            })
        })
    }
}

fn form_of(table: &str) -> Result<usize, ImportError> {
    FORMS
        .iter()
        .position(|f| f.name == table)
        .ok_or_else(|| unknown("table", table, FORMS.iter().map(|f| f.name)))
}

/// Reads a file; `origin` is its name, for the provenance.
///
/// # Errors
/// A file that is not of this form, holds names or units that do not exist,
/// leaves something out that the base does not give, or makes no law.
pub fn import(
    bytes: &[u8],
    source: Source,
    origin: &str,
    base: Option<&Schedule>,
    breakpoints: Breakpoints,
) -> Result<Imported, ImportError> {
    let text = || {
        std::str::from_utf8(bytes).map_err(|e| ImportError::Form(format!("this is no text: {e}")))
    };
    let partial = match source {
        Source::Json => {
            let value: Value = serde_json::from_str(text()?)
                .map_err(|e| ImportError::Form(format!("this is no JSON: {e}")))?;
            of_value(&value)?
        }
        Source::Toml => {
            let value: Value = ::toml::from_str(text()?)
                .map_err(|e| ImportError::Form(format!("this is no TOML: {e}")))?;
            of_value(&value)?
        }
        Source::Csv => of_csv(text()?)?,
        Source::Mat => of_mat(&mat::read(bytes)?)?,
    };
    complete(partial, origin, base, breakpoints)
}

fn number(value: &Value, what: &str) -> Result<f64, ImportError> {
    value.as_f64().ok_or_else(|| ImportError::Form(format!("{what} is no number: {value}")))
}

fn speed_of(value: &Value) -> Result<f64, ImportError> {
    match value {
        Value::String(text) => speed_text(text),
        other => number(other, "speed"),
    }
}

fn speed_text(text: &str) -> Result<f64, ImportError> {
    if let Ok(speed) = text.trim().parse::<f64>() {
        return Ok(speed);
    }
    parse_quantity(text, Kind::Airspeed)
        .map_err(|e| ImportError::Speed { text: text.into(), reason: e.to_string() })
}

fn of_value(value: &Value) -> Result<Partial, ImportError> {
    let schema = value.get("schema").and_then(Value::as_str);
    match schema {
        Some(description::SCHEMA) => {
            let d: Description = serde_json::from_value(value.clone()).map_err(|e| {
                ImportError::Form(format!("not of schema {}: {e}", description::SCHEMA))
            })?;
            of_description(&Description::new(&d.schedule()?, Vec::new())?)
        }
        None | Some(schedule::SCHEMA) => of_points(value),
        Some(other) => Err(ImportError::Form(format!(
            "the schema is '{other}', expected '{}' or '{}'",
            schedule::SCHEMA,
            description::SCHEMA
        ))),
    }
}

fn of_description(d: &Description) -> Result<Partial, ImportError> {
    let mut out = Partial {
        name: Some(d.name.clone()),
        provenance: Some(d.provenance.clone()),
        speeds: d.speed.values.clone(),
        ..Partial::default()
    };
    for c in &d.constants {
        out.constant(&c.name, c.value)?;
    }
    for t in &d.tables {
        let form = form_of(&t.name)?;
        for (k, m) in t.values.iter().enumerate() {
            for (i, row) in m.iter().enumerate() {
                for (j, x) in row.iter().enumerate() {
                    out.put(form, k, i, j, *x)?;
                }
            }
        }
    }
    Ok(out)
}

/// The shape of `schedule.json`, any part of it.
fn of_points(value: &Value) -> Result<Partial, ImportError> {
    let object = |v: &Value, what: &str| {
        v.as_object().cloned().ok_or_else(|| ImportError::Form(format!("{what} is no object")))
    };
    let known = [
        "schema",
        "name",
        "requirements_met",
        "provenance",
        "interpolation",
        "units",
        "law",
        "turn_coordination_speed",
        "turn_coordination_width",
        "hardware",
        "stick_limits",
        "points",
    ];
    let mut out = Partial::default();
    for (key, v) in object(value, "the file")? {
        match key.as_str() {
            "name" => out.name = v.as_str().map(Into::into),
            "provenance" => out.provenance = serde_json::from_value(v).ok(),
            "law" | "hardware" => {
                for (name, v) in object(&v, &key)? {
                    let x = match v {
                        Value::Bool(b) => f64::from(b),
                        other => number(&other, &name)?,
                    };
                    out.constant(&name, x)?;
                }
            }
            "turn_coordination_speed" => {
                let x = speed_of(&v)?;
                out.constant(&key, x)?;
            }
            "turn_coordination_width" => {
                let x = speed_of(&v)?;
                out.constant(&key, x)?;
            }
            "stick_limits" => {
                let limits: [[f64; 2]; 4] = serde_json::from_value(v)
                    .map_err(|e| ImportError::Form(format!("stick_limits: {e}")))?;
                for (stick, [low, high]) in ["lat", "lon", "col", "ped"].iter().zip(limits) {
                    out.constant(&format!("stick_{stick}_min"), low)?;
                    out.constant(&format!("stick_{stick}_max"), high)?;
                }
            }
            "points" => {
                let points =
                    v.as_array().ok_or_else(|| ImportError::Form("points is no list".into()))?;
                for point in points {
                    of_point(&mut out, point)?;
                }
            }
            other if known.contains(&other) => {}
            other => return Err(unknown("key", other, known.into_iter())),
        }
    }
    Ok(out)
}

fn of_point(out: &mut Partial, point: &Value) -> Result<(), ImportError> {
    let list = |v: &Value, what: &str| -> Result<Vec<f64>, ImportError> {
        serde_json::from_value(v.clone()).map_err(|e| ImportError::Form(format!("{what}: {e}")))
    };
    let speed = point
        .get("speed")
        .ok_or_else(|| ImportError::Form("a point has no speed".into()))
        .and_then(speed_of)?;
    if out.speeds.contains(&speed) {
        return Err(ImportError::Twice(format!("the point at {speed} m/s")));
    }
    let k = out.speed(speed);
    let empty = serde_json::Map::new();
    let object = |key: &str| point.get(key).and_then(Value::as_object).unwrap_or(&empty);
    for (channel, gains) in object("gains") {
        if !Channel::ALL.iter().any(|c| c.name() == channel) {
            return Err(unknown("channel", channel, Channel::ALL.iter().map(|c| c.name())));
        }
        let gains = gains
            .as_object()
            .ok_or_else(|| ImportError::Form(format!("gains of {channel} are no object")))?;
        for (gain, x) in gains {
            out.entry("gains", channel, gain, k, number(x, gain)?)?;
        }
    }
    for (key, v) in object("trim") {
        let names: &[&str] = match key.as_str() {
            "velocity_body" => &["u", "v", "w"],
            "sticks" => &["lat", "lon", "col", "ped"],
            "roll" | "pitch" => {
                let row = if key == "roll" { "phi" } else { "theta" };
                out.entry("trim_attitude", row, "value", k, number(v, key)?)?;
                continue;
            }
            other => {
                let known = ["velocity_body", "roll", "pitch", "sticks"];
                return Err(unknown("part of a trim", other, known.into_iter()));
            }
        };
        let table = if key == "sticks" { "trim_sticks" } else { "trim_velocity" };
        let values = list(v, key)?;
        if values.len() != names.len() {
            return Err(DescriptionError::Size(table.into()).into());
        }
        for (name, x) in names.iter().zip(values) {
            out.entry(table, name, "value", k, x)?;
        }
    }
    for (key, v) in object("matrices") {
        let form = form_of(key)?;
        let rows: Vec<Vec<f64>> = serde_json::from_value(v.clone())
            .map_err(|e| ImportError::Form(format!("matrix {key}: {e}")))?;
        let (r, c) = FORMS[form].size();
        if rows.len() != r || rows.iter().any(|row| row.len() != c) {
            return Err(DescriptionError::Size(key.clone()).into());
        }
        for (i, row) in rows.iter().enumerate() {
            for (j, x) in row.iter().enumerate() {
                out.put(form, k, i, j, *x)?;
            }
        }
    }
    Ok(())
}

fn of_csv(text: &str) -> Result<Partial, ImportError> {
    let mut out = Partial::default();
    let mut provenance = BTreeMap::new();
    let mut reader =
        ::csv::ReaderBuilder::new().trim(::csv::Trim::All).from_reader(text.as_bytes());
    for line in reader.deserialize::<Line>() {
        let line =
            line.map_err(|e| ImportError::Form(format!("not CSV of the right columns: {e}")))?;
        let value = || {
            line.value.parse::<f64>().map_err(|_| {
                ImportError::Form(format!("'{}' of {} is no number", line.value, line.quantity))
            })
        };
        let check = |wanted: &str| {
            if line.unit.is_empty() || line.unit == wanted {
                return Ok(());
            }
            Err(DescriptionError::Unit {
                what: line.quantity.clone(),
                found: line.unit.clone(),
                wanted: wanted.into(),
            })
        };
        match line.quantity.as_str() {
            "schema" if line.value != description::SCHEMA => {
                return Err(DescriptionError::Schema(line.value).into());
            }
            "name" => out.name = Some(line.value),
            "provenance" => {
                provenance.insert(line.row, line.value);
            }
            "schema" | "requirements_met" | "warning" | "rule" => {}
            constant if line.speed.is_empty() => {
                let unit = description::constant_unit(constant)
                    .ok_or_else(|| unknown("constant", constant, description::constant_names()))?;
                check(unit)?;
                out.constant(constant, value()?)?;
            }
            table => {
                let form = form_of(table)?;
                let speed = speed_text(&line.speed)?;
                let k = out.speed(speed);
                let column = if line.column.is_empty() { "value" } else { &line.column };
                if let Some((i, j)) = FORMS[form].place(&line.row, column) {
                    check(&FORMS[form].unit(i, j))?;
                }
                out.entry(table, &line.row, column, k, value()?)?;
            }
        }
    }
    out.provenance = provenance_of(|key| provenance.get(key).cloned());
    Ok(out)
}

fn provenance_of(get: impl Fn(&str) -> Option<String>) -> Option<Provenance> {
    Some(Provenance {
        generator: get("generator")?,
        problem_hash: get("problem_hash")?,
        specification_hash: get("specification_hash")?,
    })
}

fn of_mat(variables: &BTreeMap<String, Variable>) -> Result<Partial, ImportError> {
    let text = |key: &str| match variables.get(key) {
        Some(Variable::Text(text)) => Some(text.clone()),
        _ => None,
    };
    if let Some(found) = text("schema").filter(|s| s != description::SCHEMA) {
        return Err(DescriptionError::Schema(found).into());
    }
    let Some(Variable::Numbers { values: speeds, .. }) = variables.get("speed") else {
        return Err(ImportError::Form("the MAT file has no numbers 'speed', m/s".into()));
    };
    if let Some(found) = text("speed_unit").filter(|u| u != "m/s") {
        let (what, wanted) = ("speed".into(), "m/s".into());
        return Err(DescriptionError::Unit { what, found, wanted }.into());
    }
    let mut out = Partial {
        name: text("name"),
        provenance: provenance_of(text),
        speeds: speeds.clone(),
        ..Partial::default()
    };
    if let (Some(Variable::Texts(names)), Some(Variable::Numbers { values, .. })) =
        (variables.get("constant_names"), variables.get("constant_values"))
    {
        let units = match variables.get("constant_units") {
            Some(Variable::Texts(units)) => units.clone(),
            _ => Vec::new(),
        };
        for (k, (name, x)) in names.iter().zip(values).enumerate() {
            let wanted = description::constant_unit(name)
                .ok_or_else(|| unknown("constant", name, description::constant_names()))?;
            if let Some(found) = units.get(k).filter(|u| *u != wanted) {
                return Err(DescriptionError::Unit {
                    what: name.clone(),
                    found: found.clone(),
                    wanted: wanted.into(),
                }
                .into());
            }
            out.constant(name, *x)?;
        }
    }
    for (form, f) in FORMS.iter().enumerate() {
        let Some(variable) = variables.get(f.name) else { continue };
        let (rows, columns) = f.size();
        let count = speeds.len();
        let Variable::Numbers { values, dimensions } = variable else {
            return Err(DescriptionError::Size(f.name.into()).into());
        };
        // MATLAB drops trailing sizes of 1.
        let mut wanted = vec![rows, columns, count];
        while wanted.len() > 2 && wanted.last() == Some(&1) {
            wanted.pop();
        }
        let mut found = dimensions.clone();
        while found.len() > 2 && found.last() == Some(&1) {
            found.pop();
        }
        if found != wanted {
            return Err(DescriptionError::Size(f.name.into()).into());
        }
        if let Some(Variable::Texts(units)) = variables.get(&format!("{}_units", f.name)) {
            for (n, found) in units.iter().enumerate() {
                let wanted = f.unit(n % rows, n / rows);
                if *found != wanted {
                    let (what, found) = (f.name.into(), found.clone());
                    return Err(DescriptionError::Unit { what, found, wanted }.into());
                }
            }
        }
        for (n, x) in values.iter().enumerate() {
            let (i, j, k) = (n % rows, n / rows % columns, n / (rows * columns));
            out.put(form, k, i, j, *x)?;
        }
    }
    Ok(out)
}

/// Puts the base's breakpoints among the file's speeds, as asked for.
///
/// Returns which of the base's breakpoints stay though the file does not have
/// them, and which do not.
fn with_base(
    partial: &mut Partial,
    base: &Schedule,
    breakpoints: Breakpoints,
) -> Result<(Vec<f64>, Vec<f64>), ImportError> {
    let others: Vec<f64> = base
        .points
        .iter()
        .map(|p| p.speed)
        .filter(|v| !partial.speeds.iter().any(|s| same_speed(*s, *v)))
        .collect();
    // A speed that was written with fewer digits is the base's.
    for s in &mut partial.speeds {
        if let Some(p) = base.points.iter().find(|p| same_speed(p.speed, *s)) {
            *s = p.speed;
        }
    }
    if breakpoints == Breakpoints::File {
        return Ok((Vec::new(), others));
    }
    let whole = !partial.speeds.is_empty() && partial.is_whole();
    if breakpoints == Breakpoints::Unsaid && !others.is_empty() && whole {
        return Err(ImportError::Breakpoints { file: partial.speeds.len(), base: others.len() });
    }
    partial.speeds.extend(&others);
    Ok((others, Vec::new()))
}

/// Whether two speeds differ by rounding only: by less than 1 mm/s.
fn same_speed(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-3
}

/// Fills what is missing, and makes a schedule of it.
fn complete(
    mut partial: Partial,
    origin: &str,
    base: Option<&Schedule>,
    breakpoints: Breakpoints,
) -> Result<Imported, ImportError> {
    // An edit of constants alone needs no speed.
    if partial.speeds.is_empty() && (base.is_none() || breakpoints == Breakpoints::File) {
        return Err(ImportError::Form("there is no speed in the file".into()));
    }
    if let Some(speed) = partial.speeds.iter().find(|v| v.is_nan() || **v < 0.0) {
        return Err(ImportError::Speed {
            text: format!("{speed} m/s"),
            reason: "breakpoints are true airspeeds forward, 0 or more".into(),
        });
    }
    let (kept, dropped) = match base {
        Some(base) => with_base(&mut partial, base, breakpoints)?,
        None => (Vec::new(), Vec::new()),
    };
    // By speed, whatever the order of the file.
    let mut order: Vec<usize> = (0..partial.speeds.len()).collect();
    order.sort_by(|a, b| partial.speeds[*a].total_cmp(&partial.speeds[*b]));
    let speeds: Vec<f64> = order.iter().map(|k| partial.speeds[*k]).collect();
    let resampled = match base {
        Some(base) => {
            let law = base.law()?;
            let points = speeds.iter().map(|v| law.at(*v)).collect();
            let table =
                LawTable::new(points, law.settings, law.turn).map_err(ScheduleError::from)?;
            let schedule = Schedule::new(
                &base.name,
                &table,
                base.hardware,
                base.stick_limits,
                false,
                base.provenance.clone(),
            );
            Some(Description::new(&schedule, Vec::new())?)
        }
        None => None,
    };
    // Tables and constants that the file leaves out, each once.
    let mut missing = BTreeSet::new();
    let mut from_base = BTreeSet::new();
    let mut tables = Vec::new();
    for (form, f) in FORMS.iter().enumerate() {
        let (rows, columns) = f.size();
        let mut values = Vec::new();
        for (place, k) in order.iter().enumerate() {
            let mut m = vec![vec![0.0; columns]; rows];
            for (i, row) in m.iter_mut().enumerate() {
                // Without a base, a channel without any gain is open; a gain
                // that does not exist is zero in any case.
                let open = f.name == "gains"
                    && !(0..columns).any(|j| partial.entries.contains_key(&(form, *k, i, j)));
                let gains = Channel::ALL.get(i).map_or(0, |c| c.gains().len());
                for (j, x) in row.iter_mut().enumerate() {
                    let absent = f.name == "gains" && j == 0 && gains == 2;
                    match (partial.entries.get(&(form, *k, i, j)), &resampled) {
                        (Some(given), _) => *x = *given,
                        (None, Some(base)) => {
                            *x = base.table(f.name)?.values[place][i][j];
                            if !absent {
                                from_base.insert(f.name.to_string());
                            }
                        }
                        (None, None) if open || absent => {}
                        (None, None) => {
                            missing.insert(format!("table '{}'", f.name));
                        }
                    }
                }
            }
            values.push(m);
        }
        tables.push(description::table_of(f, values));
    }
    let mut constants = Vec::new();
    for mut c in description::constant_forms() {
        let fixed = FIXED.iter().find(|f| f.0 == c.name).map(|f| f.1);
        match (partial.constants.get(&c.name), fixed, &resampled) {
            (Some(given), _, _) => c.value = *given,
            (None, Some(fixed), _) => c.value = fixed,
            (None, None, _) if DERIVED.contains(&c.name.as_str()) => {}
            (None, None, Some(base)) => {
                c.value = base.constant(&c.name)?;
                from_base.insert(c.name.clone());
            }
            (None, None, None) => {
                missing.insert(format!("constant '{}'", c.name));
            }
        }
        constants.push(c);
    }
    // A law need not have notch filters: what is not there is not missed.
    for mut c in description::notch_forms() {
        let given = partial.constants.get(&c.name).copied();
        let before = resampled.as_ref().and_then(|base| base.constant(&c.name).ok());
        if let Some(value) = given.or(before) {
            c.value = value;
            constants.push(c);
        }
    }
    if !missing.is_empty() {
        return Err(ImportError::Missing { names: missing.into_iter().collect() });
    }
    let before = partial.provenance.as_ref().or(base.map(|b| &b.provenance));
    let nothing = || "0".repeat(16);
    // The name of the file is not ours: it may hold anything.
    let origin = visible(origin, false);
    let earlier =
        partial.provenance.as_ref().map_or(String::new(), |p| format!("{}; ", p.generator));
    let generator =
        format!("{earlier}{origin}, imported by coaxdesign {}", env!("CARGO_PKG_VERSION"));
    let provenance = Provenance {
        // What came last says most, after many imports.
        generator: generator
            .chars()
            .skip(generator.chars().count().saturating_sub(LONGEST_LINE))
            .collect(),
        problem_hash: before.map_or_else(nothing, |p| p.problem_hash.clone()),
        specification_hash: before.map_or_else(nothing, |p| p.specification_hash.clone()),
    };
    let description = Description {
        schema: description::SCHEMA.into(),
        name: partial.name.or(base.map(|b| b.name.clone())).unwrap_or_else(|| "imported".into()),
        requirements_met: false,
        warnings: Vec::new(),
        provenance,
        rules: BTreeMap::new(),
        speed: description::Speed {
            unit: "m/s".into(),
            meaning: "true airspeed".into(),
            values: speeds,
        },
        constants,
        tables,
    };
    Ok(Imported {
        schedule: description.schedule()?,
        from_base: from_base.into_iter().collect(),
        kept,
        dropped,
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Format, Options, Precision, export};
    use super::*;
    use crate::schedule::sample;
    use crate::units::KNOT;

    fn files(format: Format) -> Vec<u8> {
        let options = Options {
            name: "sample".into(),
            step: 0.01,
            precision: Precision::Double,
            speed: 0.0,
            binaries: Vec::new(),
        };
        export(&sample::schedule(), Vec::new(), format, &options).unwrap().remove(0).bytes
    }

    /// What we export comes back bit for bit, in every form.
    #[test]
    fn our_own_exports_come_back() {
        let sample = sample::schedule();
        let native = sample.to_json().unwrap().into_bytes();
        for (bytes, source) in [
            (native, Source::Json),
            (files(Format::Json), Source::Json),
            (files(Format::Toml), Source::Toml),
            (files(Format::Csv), Source::Csv),
            (files(Format::Matlab), Source::Mat),
        ] {
            let back = import(&bytes, source, "x", None, Breakpoints::Unsaid).unwrap();
            assert!(back.from_base.is_empty());
            assert_eq!(back.schedule.law().unwrap(), sample.law().unwrap(), "{source:?}");
            assert_eq!(back.schedule.hardware, sample.hardware);
            assert_eq!(back.schedule.stick_limits, sample.stick_limits);
            assert_eq!(back.schedule.name, sample.name);
            assert!(!back.schedule.requirements_met);
            assert!(back.schedule.provenance.generator.contains("imported"));
            assert_eq!(back.schedule.provenance.problem_hash, sample.provenance.problem_hash);
        }
    }

    /// Gains by hand over the base's inversion, at the file's speeds only.
    #[test]
    fn a_part_is_filled_from_the_base() {
        let base = sample::schedule();
        let csv = "quantity,row,column,speed,unit,value\n\
                   gains,roll,k_p,40 kt,1/s^2,9.5\n\
                   gains,roll,k_p,10 kt,,8.5\n\
                   kappa,,,,1,0.5\n";
        let back = import(csv.as_bytes(), Source::Csv, "hand.csv", Some(&base), Breakpoints::File)
            .unwrap();
        let (law, old) = (back.schedule.law().unwrap(), base.law().unwrap());
        assert_eq!(law.points().len(), 2);
        for (p, (kt, k_p)) in law.points().iter().zip([(10.0, 8.5), (40.0, 9.5)]) {
            let was = old.at(kt * KNOT);
            assert!((p.speed - kt * KNOT).abs() < 1e-3);
            assert_eq!(p.gains[0].k_p, k_p);
            assert_eq!(p.gains[0].k_i, was.gains[0].k_i);
            assert_eq!(p.gains[4], was.gains[4]);
            assert_eq!(p.inversion, was.inversion);
        }
        assert_eq!(law.settings.kappa, 0.5);
        assert!(back.from_base.contains(&"gains".into()));
        assert!(back.from_base.contains(&"feedback".into()));
        assert!(!back.from_base.contains(&"kappa".into()));
        assert!(back.kept.is_empty() && !back.dropped.is_empty());
        let json = r#"{"points": [{"speed": "40 kt", "gains": {"roll": {"k_p": 9.5}}}]}"#;
        let file = Breakpoints::File;
        let back = import(json.as_bytes(), Source::Json, "hand.json", Some(&base), file).unwrap();
        assert_eq!(back.schedule.points[0].gains["roll"].k_p, 9.5);
    }

    /// One edited line of our own CSV changes one number and nothing else.
    #[test]
    fn an_edit_edits() {
        let base = sample::schedule();
        let speed = base.points[1].speed;
        let csv =
            format!("quantity,row,column,speed,unit,value\ngains,roll,k_p,{speed:.4},1/s^2,9.5\n");
        let unsaid = Breakpoints::Unsaid;
        let back = import(csv.as_bytes(), Source::Csv, "hand.csv", Some(&base), unsaid).unwrap();
        let mut wanted = base.law().unwrap().points().to_vec();
        assert_eq!(back.kept.len(), wanted.len() - 1);
        wanted[1].gains[0].k_p = 9.5;
        assert_eq!(back.schedule.law().unwrap().points(), wanted);
        // A constant alone is an edit, too.
        let csv = "quantity,row,column,speed,unit,value\nkappa,,,,1,0.5\n";
        let back = import(csv.as_bytes(), Source::Csv, "hand.csv", Some(&base), unsaid).unwrap();
        assert_eq!(back.schedule.law().unwrap().settings.kappa, 0.5);
        assert_eq!(back.schedule.law().unwrap().points(), base.law().unwrap().points());
    }

    /// A whole law at some of the base's speeds may mean an edit or a new law.
    #[test]
    fn a_whole_law_at_fewer_speeds_asks() {
        let base = sample::schedule();
        let mut value: Value = serde_json::from_str(&base.to_json().unwrap()).unwrap();
        let points = value["points"].as_array_mut().unwrap();
        let count = points.len();
        points.truncate(2);
        let text = value.to_string();
        let ask =
            |breakpoints| import(text.as_bytes(), Source::Json, "x", Some(&base), breakpoints);
        let error = ask(Breakpoints::Unsaid).unwrap_err().to_string();
        assert!(error.contains(&format!("at {} others", count - 2)), "{error}");
        assert_eq!(ask(Breakpoints::File).unwrap().dropped.len(), count - 2);
        let kept = ask(Breakpoints::Base).unwrap();
        assert_eq!(kept.schedule.law().unwrap(), base.law().unwrap());
    }

    #[test]
    fn bad_files_are_refused_in_the_users_terms() {
        let base = sample::schedule();
        let unsaid = Breakpoints::Unsaid;
        let head = "quantity,row,column,speed,unit,value\n";
        for (line, needle) in [
            ("gains,rol,k_p,0,1/s^2,1", "roll k_p"),
            ("gain,roll,k_p,0,1/s^2,1", "did you mean 'gains'"),
            ("gains,roll,k_p,0,1/s,1", "expected '1/s^2'"),
            ("gains,roll,k_p,fast,1/s^2,1", "fast"),
            ("gains,roll,k_p,0,1/s^2,one", "no number"),
            ("gains,roll,k_p,0,1/s^2,1\ngains,roll,k_p,0,1/s^2,2", "twice"),
            ("kapa,,,,1,0.3", "did you mean 'kappa'"),
            ("gains,roll,k_p,-1,1/s^2,1", "0 or more"),
            ("gains,roll,k_p,0,1/s^2,inf", "non-finite"),
            ("yaw_time_constant,,,,s,-1\ngains,roll,k_p,0,1/s^2,1", "must be positive"),
        ] {
            let text = format!("{head}{line}\n");
            let error = import(text.as_bytes(), Source::Csv, "x", Some(&base), unsaid).unwrap_err();
            assert!(error.to_string().contains(needle), "{line}: {error}");
        }
        let text = format!("{head}gains,roll,k_p,0,1/s^2,1\n");
        let error =
            import(text.as_bytes(), Source::Csv, "x", None, unsaid).unwrap_err().to_string();
        assert!(error.contains("'feedback'") && error.contains("'kappa'"), "{error}");
        for (json, needle) in [
            ("[1]", "no object"),
            (r#"{"schema": "other/3"}"#, "other/3"),
            (r#"{"point": []}"#, "did you mean 'points'"),
            (r#"{"points": [{"gains": {}}]}"#, "no speed"),
            (r#"{"points": [{"speed": 1, "gains": {"rol": {}}}]}"#, "did you mean 'roll'"),
            (r#"{"points": [{"speed": 1, "matrices": {"feedback": [[1]]}}]}"#, "feedback"),
            (r#"{"points": [{"speed": 1}, {"speed": 1}]}"#, "twice"),
        ] {
            let error =
                import(json.as_bytes(), Source::Json, "x", Some(&base), unsaid).unwrap_err();
            assert!(error.to_string().contains(needle), "{json}: {error}");
        }
        assert!(import(b"\xff", Source::Json, "x", None, unsaid).is_err());
        assert!(import(b"MATLAB", Source::Mat, "x", None, unsaid).is_err());
    }
}
