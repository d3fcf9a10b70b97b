//! Files of linear models: JSON, CSV and MATLAB's MAT level 5.
//!
//! Every file gives the unit of every state, input and output. Matrices are in
//! those units: with [`System::Us`] ft/s, rad/s, rad and per percent of stick,
//! as in the source paper's appendix.

use std::fmt::Write as _;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::LinearError;
use super::model::{Channel, Matrices, PeriodicModel, StateSpace, shown_per_si};
use super::set::{ModelSet, TrimValues};
use crate::units::{KNOT, Kind, System};

/// Schema of a state-space model.
pub const LTI_SCHEMA: &str = "coaxdesign.lti/1";
/// Schema of a set of models over speed.
pub const LTI_SET_SCHEMA: &str = "coaxdesign.lti-set/1";

/// Schema of a periodic model.
pub const LTP_SCHEMA: &str = "coaxdesign.ltp/1";

/// A model and the flight condition that it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelRecord {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Whether rotor-on-rotor interactions were on; `None` if unknown.
    pub interactions: Option<bool>,
    /// The model.
    pub model: StateSpace,
    /// Trim that it is linearised about, if it is known.
    pub trim: Option<TrimValues>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ChannelFile {
    name: String,
    unit: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    schema: String,
    speed_kt: f64,
    interactions: Option<bool>,
    states: Vec<ChannelFile>,
    inputs: Vec<ChannelFile>,
    outputs: Vec<ChannelFile>,
    a: Vec<Vec<f64>>,
    b: Vec<Vec<f64>>,
    c: Vec<Vec<f64>>,
    d: Vec<Vec<f64>>,
    x0: Option<Vec<f64>>,
    u0: Option<Vec<f64>>,
    u_min: Option<Vec<f64>>,
    u_max: Option<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SetFile {
    schema: String,
    interactions: Option<bool>,
    models: Vec<ModelFile>,
}

/// Kinds that a unit in a file stands for, the first match taken. Kinds that
/// differ in meaning but not in unit (airspeed and velocity) come back as the
/// more general one.
const READABLE: [Kind; 23] = [
    Kind::Dimensionless,
    Kind::Velocity,
    Kind::AngularRateRad,
    Kind::AngleRad,
    Kind::Percent,
    Kind::Length,
    Kind::Acceleration,
    Kind::AngularAcceleration,
    Kind::Angle,
    Kind::AngularRate,
    Kind::Airspeed,
    Kind::ClimbRate,
    Kind::Force,
    Kind::Moment,
    Kind::Power,
    Kind::Time,
    Kind::Mass,
    Kind::Area,
    Kind::Inertia,
    Kind::Pressure,
    Kind::AnglePerPercent,
    Kind::PerAngle,
    Kind::PerAngleSquared,
];

/// Speed in knots, free of the last digit that a conversion leaves.
fn knots(speed: f64) -> f64 {
    (speed / KNOT * 1e9).round() / 1e9
}

fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn interactions_text(interactions: Option<bool>) -> &'static str {
    match interactions {
        Some(true) => "true",
        Some(false) => "false",
        None => "null",
    }
}

fn number(value: f64) -> String {
    // Finite by construction of the model; −0 and 0 are the same derivative.
    serde_json::Value::from(value + 0.0).to_string()
}

/// A model as JSON of schema [`LTI_SCHEMA`], one matrix row a line.
pub fn to_json(record: &ModelRecord, system: System) -> String {
    let mut out = String::new();
    write_model(&mut out, record, system, "");
    out.push('\n');
    out
}

fn channels_text(list: &[Channel], system: System, indent: &str) -> String {
    list.iter()
        .map(|c| {
            format!(
                "{{\"name\": {}, \"unit\": {}}}",
                quoted(&c.name),
                quoted(c.kind.symbol(system))
            )
        })
        .collect::<Vec<_>>()
        .join(&format!(",\n{indent}    "))
}

fn rows_text(x: &DMatrix<f64>, indent: &str) -> String {
    let lines: Vec<String> = x
        .row_iter()
        .map(|r| {
            let values: Vec<String> = r.iter().map(|v| number(*v)).collect();
            format!("[{}]", values.join(", "))
        })
        .collect();
    lines.join(&format!(",\n{indent}    "))
}

fn write_list(out: &mut String, indent: &str, key: &str, body: &str) {
    let _ = if body.is_empty() {
        write!(out, ",\n{indent}  \"{key}\": []")
    } else {
        write!(out, ",\n{indent}  \"{key}\": [\n{indent}    {body}\n{indent}  ]")
    };
}

fn write_model(out: &mut String, record: &ModelRecord, system: System, indent: &str) {
    let m = &record.model;
    let matrices = m.matrices_in(system);
    // Writing to a String cannot fail.
    let _ = write!(
        out,
        "{{\n{indent}  \"schema\": {},\n{indent}  \"speed_kt\": {},\n{indent}  \"interactions\": {}",
        quoted(LTI_SCHEMA),
        number(knots(record.speed)),
        interactions_text(record.interactions),
    );
    for (key, list) in [("states", m.states()), ("inputs", m.inputs()), ("outputs", m.outputs())] {
        write_list(out, indent, key, &channels_text(list, system, indent));
    }
    for (key, x) in [("a", &matrices.a), ("b", &matrices.b), ("c", &matrices.c), ("d", &matrices.d)]
    {
        write_list(out, indent, key, &rows_text(x, indent));
    }
    if let Some(trim) = &record.trim {
        for (key, values, list) in trim_lists(trim, m) {
            let shown: Vec<String> =
                shown_values(&values, list, system).into_iter().map(number).collect();
            let _ = write!(out, ",\n{indent}  \"{key}\": [{}]", shown.join(", "));
        }
    }
    let _ = write!(out, "\n{indent}}}");
}

/// What is written of a trim: x0, u0, and the limits of the inputs where they
/// are known.
fn trim_lists<'a>(
    trim: &TrimValues,
    model: &'a StateSpace,
) -> Vec<(&'static str, Vec<f64>, &'a [Channel])> {
    let mut lists = vec![
        ("x0", trim.states.clone(), model.states()),
        ("u0", trim.inputs.clone(), model.inputs()),
    ];
    if trim.limits.len() == trim.inputs.len() {
        for (k, name) in ["u_min", "u_max"].into_iter().enumerate() {
            lists.push((name, trim.limits.iter().map(|l| l[k]).collect(), model.inputs()));
        }
    }
    lists
}

/// Values of channels in the units that people read.
fn shown_values(values: &[f64], channels: &[Channel], system: System) -> Vec<f64> {
    values.iter().zip(channels).map(|(v, c)| v * shown_per_si(c.kind, system)).collect()
}

/// Reads a model that [`to_json`] or another program wrote.
///
/// # Errors
/// Text that is not this schema, a unit that is not known, or units of both
/// systems in one file; the message says where.
pub fn from_json(text: &str) -> Result<ModelRecord, LinearError> {
    let file: ModelFile = parse(text, "a model")?;
    record_of(file)
}

fn parse<'a, T: Deserialize<'a>>(text: &'a str, what: &str) -> Result<T, LinearError> {
    serde_json::from_str(text).map_err(|e| LinearError::Format(format!("not {what} in JSON: {e}")))
}

fn check_schema(found: &str, wanted: &str) -> Result<(), LinearError> {
    if found == wanted {
        Ok(())
    } else {
        Err(LinearError::Format(format!("schema is \"{found}\", but \"{wanted}\" is needed")))
    }
}

fn record_of(file: ModelFile) -> Result<ModelRecord, LinearError> {
    check_schema(&file.schema, LTI_SCHEMA)?;
    if !file.speed_kt.is_finite() {
        return Err(LinearError::Format("speed_kt is not finite".into()));
    }
    let all = || file.states.iter().chain(&file.inputs).chain(&file.outputs);
    let system = [System::Us, System::Si]
        .into_iter()
        .find(|&system| all().all(|c| kind_of(&c.unit, system).is_some()))
        .ok_or_else(|| {
            let odd = all().find(|c| {
                kind_of(&c.unit, System::Us).is_none() && kind_of(&c.unit, System::Si).is_none()
            });
            LinearError::Format(odd.map_or_else(
                || "the file mixes US and SI units".into(),
                |c| format!("unit \"{}\" of \"{}\" is not known", c.unit, c.name),
            ))
        })?;
    let channels = |list: &[ChannelFile]| -> Vec<Channel> {
        list.iter()
            .filter_map(|c| kind_of(&c.unit, system).map(|kind| Channel::new(&c.name, kind)))
            .collect()
    };
    let (n, m, p) = (file.states.len(), file.inputs.len(), file.outputs.len());
    let matrices = Matrices {
        a: matrix("a", &file.a, n, n)?,
        b: matrix("b", &file.b, n, m)?,
        c: matrix("c", &file.c, p, n)?,
        d: matrix("d", &file.d, p, m)?,
    };
    let values = |key: &str, given: &Option<Vec<f64>>, list: &[ChannelFile]| {
        let Some(given) = given else { return Ok(None) };
        if given.len() != list.len() {
            return Err(LinearError::Format(format!(
                "\"{key}\" has {} values, but its channels ask for {}",
                given.len(),
                list.len()
            )));
        }
        let si = given.iter().zip(channels(list)).map(|(v, c)| v / shown_per_si(c.kind, system));
        Ok(Some(si.collect::<Vec<_>>()))
    };
    let trim = match (values("x0", &file.x0, &file.states)?, values("u0", &file.u0, &file.inputs)?)
    {
        (Some(states), Some(inputs)) => {
            let ends = (
                values("u_min", &file.u_min, &file.inputs)?,
                values("u_max", &file.u_max, &file.inputs)?,
            );
            let limits = match ends {
                (Some(low), Some(high)) => low.into_iter().zip(high).map(|(a, b)| [a, b]).collect(),
                _ => Vec::new(),
            };
            Some(TrimValues { states, inputs, limits })
        }
        _ => None,
    };
    Ok(ModelRecord {
        speed: file.speed_kt * KNOT,
        interactions: file.interactions,
        trim,
        model: StateSpace::from_matrices_in(
            system,
            channels(&file.states),
            channels(&file.inputs),
            channels(&file.outputs),
            matrices,
        )?,
    })
}

fn kind_of(unit: &str, system: System) -> Option<Kind> {
    READABLE.into_iter().find(|kind| kind.symbol(system) == unit)
}

fn matrix(
    key: &str,
    rows: &[Vec<f64>],
    row_count: usize,
    column_count: usize,
) -> Result<DMatrix<f64>, LinearError> {
    if rows.len() != row_count {
        return Err(LinearError::Format(format!(
            "\"{key}\" has {} rows, but its channels ask for {row_count}",
            rows.len()
        )));
    }
    if let Some((i, row)) = rows.iter().enumerate().find(|(_, r)| r.len() != column_count) {
        return Err(LinearError::Format(format!(
            "row {} of \"{key}\" has {} entries, but its channels ask for {column_count}",
            i + 1,
            row.len()
        )));
    }
    Ok(DMatrix::from_fn(row_count, column_count, |i, j| rows[i][j]))
}

/// A set of models as JSON of schema [`LTI_SET_SCHEMA`].
pub fn set_to_json(set: &ModelSet, system: System) -> String {
    let mut out = format!(
        "{{\n  \"schema\": {},\n  \"interactions\": {},\n  \"models\": [",
        quoted(LTI_SET_SCHEMA),
        interactions_text(set.interactions())
    );
    for (k, (speed, model)) in set.speeds().iter().zip(set.models()).enumerate() {
        out.push_str(if k == 0 { "\n    " } else { ",\n    " });
        let record = ModelRecord {
            speed: *speed,
            interactions: set.interactions(),
            model: model.clone(),
            trim: set.trims().map(|trims| trims[k].clone()),
        };
        write_model(&mut out, &record, system, "    ");
    }
    out.push_str("\n  ]\n}\n");
    out
}

/// Reads a set of models that [`set_to_json`] wrote.
///
/// # Errors
/// As [`from_json`] and [`ModelSet::new`].
pub fn set_from_json(text: &str) -> Result<ModelSet, LinearError> {
    let file: SetFile = parse(text, "a model set")?;
    check_schema(&file.schema, LTI_SET_SCHEMA)?;
    let mut speeds = Vec::with_capacity(file.models.len());
    let mut models = Vec::with_capacity(file.models.len());
    let mut trims = Vec::with_capacity(file.models.len());
    for model in file.models {
        let record = record_of(model)?;
        speeds.push(record.speed);
        models.push(record.model);
        trims.push(record.trim);
    }
    let set = ModelSet::new(file.interactions, speeds, models)?;
    match trims.into_iter().collect::<Option<Vec<_>>>() {
        Some(trims) => set.with_trims(trims),
        None => Ok(set),
    }
}

/// The matrices of every sample of a periodic model in shown units.
fn sampled_matrices(model: &PeriodicModel, system: System) -> Result<Vec<Matrices>, LinearError> {
    model
        .samples()
        .iter()
        .map(|s| {
            let at_azimuth = StateSpace::new(
                model.states().to_vec(),
                model.inputs().to_vec(),
                model.outputs().to_vec(),
                s.a.clone(),
                s.b.clone(),
                s.c.clone(),
                s.d.clone(),
            )?;
            Ok(at_azimuth.matrices_in(system))
        })
        .collect()
}

fn azimuth_of(sample: usize, count: usize) -> f64 {
    std::f64::consts::TAU * sample as f64 / count as f64
}

/// A periodic model as JSON of schema [`LTP_SCHEMA`]: channels as in a
/// time-invariant model, `frequency_rad_per_s` Ω, and `samples`, each with
/// its `azimuth_rad` and its four matrices. `speed` is in m/s.
///
/// # Errors
/// None that a valid model could cause.
pub fn periodic_to_json(
    speed: f64,
    interactions: Option<bool>,
    model: &PeriodicModel,
    system: System,
) -> Result<String, LinearError> {
    let mut out = format!(
        "{{\n  \"schema\": {},\n  \"speed_kt\": {},\n  \"interactions\": {},\n  \
         \"frequency_rad_per_s\": {}",
        quoted(LTP_SCHEMA),
        number(knots(speed)),
        interactions_text(interactions),
        number(model.frequency()),
    );
    for (key, list) in
        [("states", model.states()), ("inputs", model.inputs()), ("outputs", model.outputs())]
    {
        write_list(&mut out, "", key, &channels_text(list, system, ""));
    }
    out.push_str(",\n  \"samples\": [");
    let samples = sampled_matrices(model, system)?;
    for (k, m) in samples.iter().enumerate() {
        out.push_str(if k == 0 { "\n    {" } else { ",\n    {" });
        let azimuth = number(azimuth_of(k, samples.len()));
        let _ = write!(out, "\n      \"azimuth_rad\": {azimuth}");
        for (key, x) in [("a", &m.a), ("b", &m.b), ("c", &m.c), ("d", &m.d)] {
            write_list(&mut out, "    ", key, &rows_text(x, "    "));
        }
        out.push_str("\n    }");
    }
    out.push_str("\n  ]\n}\n");
    Ok(out)
}

/// A periodic model as a MAT file: A, B, C, D are three-dimensional, the last
/// index running over `azimuth_rad`; `frequency_rad_per_s` is Ω. `speed` is
/// in m/s.
///
/// # Errors
/// None that a valid model could cause.
pub fn periodic_to_mat(
    speed: f64,
    interactions: Option<bool>,
    model: &PeriodicModel,
    system: System,
) -> Result<Vec<u8>, LinearError> {
    let all = sampled_matrices(model, system)?;
    let (n, m, p, k) =
        (model.states().len(), model.inputs().len(), model.outputs().len(), all.len());
    let mut file = MatFile::new();
    file.stack(&all, [n, m, p, k]);
    let azimuth: Vec<f64> = (0..k).map(|i| azimuth_of(i, k)).collect();
    file.array("azimuth_rad", &[k, 1], &azimuth);
    file.array("frequency_rad_per_s", &[1, 1], &[model.frequency()]);
    file.array("speed_kt", &[1, 1], &[knots(speed)]);
    file.array("interactions", &[1, 1], &[interactions.map_or(f64::NAN, f64::from)]);
    file.channels([model.states(), model.inputs(), model.outputs()], system);
    Ok(file.bytes)
}

/// A model as CSV, one entry a line: matrix, row and column with their units,
/// value. An entry has the row's unit per column's unit; rows of A and B are
/// rates and have a further 1/s. The trim follows as matrices `x0`, `u0`, `u_min` and `u_max`
/// without a column.
///
/// # Errors
/// None that a valid model could cause; the writer's own are passed on.
pub fn to_csv(record: &ModelRecord, system: System) -> Result<String, LinearError> {
    let failed = |e: &dyn std::fmt::Display| LinearError::Format(format!("CSV: {e}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(["speed_kt", "matrix", "row", "row_unit", "column", "column_unit", "value"])
        .map_err(|e| failed(&e))?;
    let m = &record.model;
    let matrices = m.matrices_in(system);
    let speed = number(knots(record.speed));
    for (label, values, rows, columns) in [
        ("A", &matrices.a, m.states(), m.states()),
        ("B", &matrices.b, m.states(), m.inputs()),
        ("C", &matrices.c, m.outputs(), m.states()),
        ("D", &matrices.d, m.outputs(), m.inputs()),
    ] {
        for (i, row) in rows.iter().enumerate() {
            for (j, column) in columns.iter().enumerate() {
                writer
                    .write_record([
                        speed.as_str(),
                        label,
                        &row.name,
                        row.kind.symbol(system),
                        &column.name,
                        column.kind.symbol(system),
                        &number(values[(i, j)]),
                    ])
                    .map_err(|e| failed(&e))?;
            }
        }
    }
    if let Some(trim) = &record.trim {
        for (label, values, list) in trim_lists(trim, m) {
            for (value, channel) in shown_values(&values, list, system).into_iter().zip(list) {
                writer
                    .write_record([
                        speed.as_str(),
                        label,
                        &channel.name,
                        channel.kind.symbol(system),
                        "",
                        "",
                        &number(value),
                    ])
                    .map_err(|e| failed(&e))?;
            }
        }
    }
    let bytes = writer.into_inner().map_err(|e| failed(&e))?;
    String::from_utf8(bytes).map_err(|e| failed(&e))
}

/// A model as a MAT file of level 5, uncompressed, little-endian.
///
/// Variables: A, B, C, D, `speed_kt`, `interactions` (1, 0, or NaN if
/// unknown), cell columns `state_names`, `state_units`, and so on for inputs
/// and outputs, and the trim as columns `x0` and `u0`, if it is known.
pub fn to_mat(record: &ModelRecord, system: System) -> Vec<u8> {
    let m = &record.model;
    let matrices = m.matrices_in(system);
    let mut file = MatFile::new();
    file.array("A", &[m.states().len(), m.states().len()], matrices.a.as_slice());
    file.array("B", &[m.states().len(), m.inputs().len()], matrices.b.as_slice());
    file.array("C", &[m.outputs().len(), m.states().len()], matrices.c.as_slice());
    file.array("D", &[m.outputs().len(), m.inputs().len()], matrices.d.as_slice());
    file.array("speed_kt", &[1, 1], &[knots(record.speed)]);
    file.array("interactions", &[1, 1], &[record.interactions.map_or(f64::NAN, f64::from)]);
    file.channels([m.states(), m.inputs(), m.outputs()], system);
    file.trims(record.trim.as_slice(), m, system);
    file.bytes
}

/// A set of models as a MAT file: A, B, C, D are three-dimensional, the last
/// index running over `speed_kt`, as do the columns of the trims `x0` and `u0`.
pub fn set_to_mat(set: &ModelSet, system: System) -> Vec<u8> {
    let first = &set.models()[0];
    let all: Vec<Matrices> = set.models().iter().map(|m| m.matrices_in(system)).collect();
    let (n, m, p, k) =
        (first.states().len(), first.inputs().len(), first.outputs().len(), all.len());
    let mut file = MatFile::new();
    file.stack(&all, [n, m, p, k]);
    let speeds: Vec<f64> = set.speeds().iter().map(|v| knots(*v)).collect();
    file.array("speed_kt", &[k, 1], &speeds);
    file.array("interactions", &[1, 1], &[set.interactions().map_or(f64::NAN, f64::from)]);
    file.channels([first.states(), first.inputs(), first.outputs()], system);
    file.trims(set.trims().unwrap_or_default(), first, system);
    file.bytes
}

/// Writer of MAT level 5 files (MathWorks, "MAT-File Format", chapter 1),
/// uncompressed and little-endian.
#[derive(Debug, Clone)]
pub struct MatFile {
    bytes: Vec<u8>,
}

impl Default for MatFile {
    fn default() -> Self {
        Self::new()
    }
}

mod mat {
    pub const INT8: u32 = 1;
    pub const UINT16: u32 = 4;
    pub const INT32: u32 = 5;
    pub const UINT32: u32 = 6;
    pub const DOUBLE: u32 = 9;
    pub const MATRIX: u32 = 14;
    pub const CELL_CLASS: u32 = 1;
    pub const CHAR_CLASS: u32 = 4;
    pub const DOUBLE_CLASS: u32 = 6;
}

impl MatFile {
    /// A file without variables.
    pub fn new() -> Self {
        // 116 bytes of text, 8 of subsystem offset, version, byte order.
        let mut bytes = b"MATLAB 5.0 MAT-file, written by coaxdesign".to_vec();
        bytes.resize(124, b' ');
        bytes[116..124].fill(0);
        bytes.extend_from_slice(&0x0100_u16.to_le_bytes());
        bytes.extend_from_slice(b"IM");
        Self { bytes }
    }

    /// The file as it is.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Adds an array of doubles, the first index running fastest.
    pub fn array(&mut self, name: &str, dimensions: &[usize], values: &[f64]) {
        let body = numeric(name, dimensions, values);
        element(&mut self.bytes, mat::MATRIX, &body);
    }

    /// Adds a text.
    pub fn text(&mut self, name: &str, text: &str) {
        let body = characters(name, text);
        element(&mut self.bytes, mat::MATRIX, &body);
    }

    /// Adds a cell column of texts.
    pub fn cell_of_text(&mut self, name: &str, texts: &[&str]) {
        let mut body = header(mat::CELL_CLASS, name, &[texts.len(), 1]);
        for text in texts {
            element(&mut body, mat::MATRIX, &characters("", text));
        }
        element(&mut self.bytes, mat::MATRIX, &body);
    }

    /// A, B, C, D of several models, one behind the other; `sizes` are the
    /// numbers of states, inputs, outputs and models.
    fn stack(&mut self, all: &[Matrices], sizes: [usize; 4]) {
        let [n, m, p, k] = sizes;
        let joined = |pick: fn(&Matrices) -> &DMatrix<f64>| -> Vec<f64> {
            all.iter().flat_map(|x| pick(x).as_slice().iter().copied()).collect()
        };
        self.array("A", &[n, n, k], &joined(|x| &x.a));
        self.array("B", &[n, m, k], &joined(|x| &x.b));
        self.array("C", &[p, n, k], &joined(|x| &x.c));
        self.array("D", &[p, m, k], &joined(|x| &x.d));
    }

    /// Trims of states and inputs, a column a model.
    fn trims(&mut self, trims: &[TrimValues], model: &StateSpace, system: System) {
        if trims.is_empty() {
            return;
        }
        let columns = |pick: fn(&TrimValues) -> &[f64], list: &[Channel]| -> Vec<f64> {
            trims.iter().flat_map(|t| shown_values(pick(t), list, system)).collect()
        };
        let x0 = columns(|t| &t.states, model.states());
        self.array("x0", &[model.states().len(), trims.len()], &x0);
        let u0 = columns(|t| &t.inputs, model.inputs());
        self.array("u0", &[model.inputs().len(), trims.len()], &u0);
        if trims[0].limits.len() == model.inputs().len() {
            for (k, name) in ["u_min", "u_max"].into_iter().enumerate() {
                let ends: Vec<f64> = trims[0].limits.iter().map(|l| l[k]).collect();
                let shown = shown_values(&ends, model.inputs(), system);
                self.array(name, &[shown.len(), 1], &shown);
            }
        }
    }

    /// Names and units of states, inputs and outputs.
    fn channels(&mut self, lists: [&[Channel]; 3], system: System) {
        for (role, list) in ["state", "input", "output"].into_iter().zip(lists) {
            let names: Vec<&str> = list.iter().map(|c| c.name.as_str()).collect();
            let units: Vec<&str> = list.iter().map(|c| c.kind.symbol(system)).collect();
            self.cell_of_text(&format!("{role}_names"), &names);
            self.cell_of_text(&format!("{role}_units"), &units);
        }
    }
}

/// Tag, data and padding to eight bytes.
fn element(out: &mut Vec<u8>, kind: u32, data: &[u8]) {
    // A model would have to hold gigabytes to exceed the format's 32 bits.
    let size = u32::try_from(data.len()).unwrap_or(u32::MAX);
    out.extend_from_slice(&kind.to_le_bytes());
    out.extend_from_slice(&size.to_le_bytes());
    out.extend_from_slice(data);
    out.resize(out.len().next_multiple_of(8), 0);
}

/// Flags, dimensions and name of an array.
fn header(class: u32, name: &str, dimensions: &[usize]) -> Vec<u8> {
    let mut out = Vec::new();
    let flags: Vec<u8> = [class, 0].into_iter().flat_map(u32::to_le_bytes).collect();
    element(&mut out, mat::UINT32, &flags);
    let sizes: Vec<u8> = dimensions
        .iter()
        .flat_map(|d| i32::try_from(*d).unwrap_or(i32::MAX).to_le_bytes())
        .collect();
    element(&mut out, mat::INT32, &sizes);
    element(&mut out, mat::INT8, name.as_bytes());
    out
}

fn characters(name: &str, text: &str) -> Vec<u8> {
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let length = units.len() / 2;
    let mut out = header(mat::CHAR_CLASS, name, &[usize::from(length > 0), length]);
    element(&mut out, mat::UINT16, &units);
    out
}

fn numeric(name: &str, dimensions: &[usize], values: &[f64]) -> Vec<u8> {
    let mut out = header(mat::DOUBLE_CLASS, name, dimensions);
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    element(&mut out, mat::DOUBLE, &data);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The models printed for the CoAX 2D: hover and 70 kt.
    fn printed() -> ModelSet {
        set_from_json(include_str!("../studies/coax2d/appendix.json")).unwrap()
    }

    fn record() -> ModelRecord {
        ModelRecord {
            speed: 70.0 * KNOT,
            interactions: Some(true),
            model: printed().models()[1].clone(),
            trim: None,
        }
    }

    #[test]
    fn json_has_the_schema_of_the_issue_and_the_printed_numbers() {
        let text = to_json(&record(), System::Us);
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        let keys: Vec<&String> = value.as_object().unwrap().keys().collect();
        assert_eq!(keys.len(), 10);
        assert_eq!(value["schema"], "coaxdesign.lti/1");
        assert_eq!(value["speed_kt"], 70.0);
        assert_eq!(value["interactions"], true);
        assert_eq!(value["states"][0]["unit"], "ft/s");
        assert_eq!(value["states"][3]["unit"], "rad/s");
        assert_eq!(value["inputs"][1]["name"], "lon");
        // The paper's Z_lon, ft/s² per percent.
        let z_lon = value["b"][2][1].as_f64().unwrap();
        assert!((z_lon + 4.0453).abs() < 1e-12);
    }

    #[test]
    fn json_round_trip_keeps_every_number() {
        let before = record();
        assert_eq!(from_json(&to_json(&before, System::Si)).unwrap(), before);
        // Through feet, rounding may move the last digit once.
        let after = from_json(&to_json(&before, System::Us)).unwrap();
        for (x, y) in [(after.model.a(), before.model.a()), (after.model.b(), before.model.b())] {
            for (u, v) in x.iter().zip(y.iter()) {
                assert!((u - v).abs() <= 4.0 * f64::EPSILON * v.abs());
            }
        }
        assert_eq!(after.model.states(), before.model.states());
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        let good = to_json(&record(), System::Us);
        for (from, to, message) in [
            ("coaxdesign.lti/1", "coaxdesign.lti/2", "is needed"),
            ("\"ft/s\"", "\"furlong/s\"", "furlong/s"),
            ("\"speed_kt\": 70.0", "\"speed_kt\": \"70\"", "line 3"),
            ("\"interactions\"", "\"interaction\"", "interaction"),
        ] {
            let bad = good.replacen(from, to, 1);
            assert_ne!(bad, good);
            let error = from_json(&bad).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
        let short = good.replacen(", 0.0]", "]", 1);
        let error = from_json(&short).unwrap_err().to_string();
        assert!(error.contains("has 7 entries"), "{error}");
    }

    #[test]
    fn sets_survive_the_round_trip() {
        let set = printed();
        assert_eq!(set_from_json(&set_to_json(&set, System::Si)).unwrap(), set);
    }

    /// Trims are in the units of their channels, and come back.
    #[test]
    fn trims_go_along() {
        let trim = TrimValues {
            states: vec![36.0, 0.0, -2.35, 0.0, 0.0, 0.0, 0.01, -0.0653],
            inputs: vec![50.0, 55.0, 40.0, 48.0],
            limits: vec![[0.0, 100.0], [-50.0, 50.0], [0.0, 100.0], [-30.0, 40.0]],
        };
        let with = ModelRecord { trim: Some(trim.clone()), ..record() };
        assert_eq!(from_json(&to_json(&with, System::Si)).unwrap(), with);
        let text = to_json(&with, System::Us);
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!((value["x0"][0].as_f64().unwrap() - 36.0 / 0.3048).abs() < 1e-12);
        assert!(to_csv(&with, System::Us).unwrap().contains("70.0,u0,lon,%,,,55.0"));
        let set = ModelSet::new(None, vec![with.speed], vec![with.model.clone()])
            .and_then(|set| set.with_trims(vec![trim]))
            .unwrap();
        assert_eq!(set_from_json(&set_to_json(&set, System::Si)).unwrap(), set);
        let short = text.replacen("\"u0\": [50.0, ", "\"u0\": [", 1);
        assert!(from_json(&short).unwrap_err().to_string().contains("\"u0\" has 3 values"));
    }

    #[test]
    fn csv_has_every_entry_once() {
        let text = to_csv(&record(), System::Us).unwrap();
        assert_eq!(text.lines().count(), 1 + 64 + 32 + 64 + 32);
        assert!(text.contains("70.0,B,w,ft/s,lon,%,-4.0453"), "{text}");
    }

    #[test]
    fn mat_elements_are_aligned_and_complete() {
        // Walk the tags: sizes must lead exactly to the end of the file.
        let bytes = to_mat(&record(), System::Us);
        assert_eq!(&bytes[126..128], b"IM");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (mut at, mut count) = (128, 0);
        while at < bytes.len() {
            assert_eq!(word(at), mat::MATRIX as usize);
            at += 8 + word(at + 4);
            assert_eq!(at % 8, 0);
            count += 1;
        }
        assert_eq!((at, count), (bytes.len(), 12));
    }
}
