//! From a set as its files have it to models in our names and units.

use super::mapping::{KINDS, Mapping, MissingTrim, NAMES, factor, is_alias, line_for_name};
use super::read::{RawChannel, RawModel, RawSet};
use super::{LtiSet, PointModel, SAME_SPEED, Trim, finding};
use crate::linear::model::{Channel, StateSpace};
use crate::linear::reduction::RIGID_BODY;
use crate::linear::{LinearError, structure};
use crate::problem::{Diagnostic, Report, STICKS};
use crate::units::{KNOT, Kind, STANDARD_GRAVITY as GRAVITY, parse_quantity};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// States of every model that the law measures.
const RIGID: usize = RIGID_BODY.len();
const P: usize = 3;
const Q: usize = 4;
const R: usize = 5;
const PHI: usize = 6;
const THETA: usize = 7;

/// A gravity or kinematic entry may differ from its formula by this factor:
/// what is left of it in models with a residualised rotor is a few per cent.
const PLAUSIBLE: f64 = 1.25;
/// The trim's own speed may differ from the set's by this fraction, or by
/// [`SLOW`] m/s.
const SPEED_DIFFERENCE: f64 = 0.03;
const SLOW: f64 = 0.7;
/// Growth from which a mode counts as unstable, 1/s.
const UNSTABLE: f64 = 1e-3;
/// Controllability below this: the mode cannot be moved.
const CANCELLED: f64 = 1e-9;
/// Limits of a stick that the set gives none of, %.
const WHOLE_TRAVEL: [f64; 2] = [0.0, 100.0];
/// Highest frequency at which a delay is to be right, rad/s.
const DELAY_FREQUENCY: f64 = 60.0;
/// Largest delay that is read, s.
const LONGEST_DELAY: f64 = 0.5;

/// Brings a set to our names and units.
///
/// # Errors
/// Everything that is wrong, by file, model and row.
pub(super) fn resolve(raw: RawSet, mapping: &Mapping) -> Result<LtiSet, Report> {
    let mut findings = Vec::new();
    for pair in raw.models.windows(2) {
        if pair[1].speed < pair[0].speed + SAME_SPEED {
            let same = (pair[1].speed - pair[0].speed).abs() < SAME_SPEED;
            let message = format!(
                "the speed {:.4} kt {} that of {}",
                pair[1].speed / KNOT,
                if same { "equals" } else { "is below" },
                if pair[0].file == pair[1].file { &pair[0].place } else { &pair[0].file },
            );
            let help = "give one model a speed, slowest first";
            findings.push(finding(&pair[1].file, &pair[1].place, message, help.into()));
        }
    }
    let stated = raw
        .models
        .iter()
        .filter_map(|m| m.hardware_included)
        .fold(raw.hardware_included, |_, own| Some(own));
    let mut notes = Vec::new();
    let mut models = Vec::new();
    let mut kept: Option<Vec<String>> = None;
    let mut limits: Option<[[f64; 2]; 4]> = None;
    for model in &raw.models {
        let mut work = Work { raw: model, mapping, findings: Vec::new(), notes: &mut notes };
        match work.point(kept.as_deref()) {
            Some(point) if work.findings.is_empty() => {
                if kept.is_none() {
                    let names = point.0.model.states()[RIGID..].iter().map(|c| c.name.clone());
                    kept = Some(names.collect());
                }
                match limits {
                    None => limits = Some(point.1),
                    Some(before) if before == point.1 => {}
                    Some(before) => {
                        let stick = (0..4).find(|k| before[*k] != point.1[*k]).unwrap_or(0);
                        let ([a, b], [c, d]) = (before[stick], point.1[stick]);
                        let message = format!(
                            "{} reaches from {c} to {d} %, in the first model from {a} to {b} %",
                            STICKS[stick]
                        );
                        let help = "a stick has the same limits in all models";
                        findings.push(finding(&model.file, &model.place, message, help.into()));
                    }
                }
                models.push(point.0);
            }
            _ => findings.append(&mut work.findings),
        }
    }
    if !findings.is_empty() {
        return Err(Report::new(findings, false));
    }
    notes.dedup();
    Ok(LtiSet {
        name: raw.name,
        models,
        hardware_included: mapping.hardware_included.or(stated).unwrap_or(false),
        notes,
        stick_limits: limits.unwrap_or([WHOLE_TRAVEL; 4]),
        texts: raw.texts,
        files: raw.files,
        is_directory: raw.is_directory,
    })
}

/// Where one of the eight rigid-body quantities is found.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    State(usize, f64),
    Output(usize, f64),
    /// Not there: an attitude that follows from the rates.
    Constructed,
}

struct Work<'a> {
    raw: &'a RawModel,
    mapping: &'a Mapping,
    findings: Vec<Diagnostic>,
    notes: &'a mut Vec<String>,
}

/// Matrices in SI, still with the states of the file.
struct Scaled {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    states: Vec<Channel>,
    outputs: Vec<Channel>,
    /// Trim of the states, where it is given.
    x0: Vec<Option<f64>>,
    /// Trim of the sticks, %.
    u0: [Option<f64>; 4],
    /// Limits of the sticks, %.
    limits: [[f64; 2]; 4],
}

impl Work<'_> {
    fn wrong(&mut self, row: &str, message: String, help: String) {
        let place = if row.is_empty() {
            self.raw.place.clone()
        } else {
            format!("{}, row {row}", self.raw.place)
        };
        self.findings.push(finding(&self.raw.file, &place, message, help));
    }

    /// The model in our terms, and the limits of the sticks; `None` with findings.
    fn point(&mut self, kept: Option<&[String]>) -> Option<(PointModel, [[f64; 2]; 4])> {
        self.finite();
        let sources: Vec<Option<Source>> = (0..RIGID).map(|k| self.source(k)).collect();
        let inputs: Vec<Option<(usize, f64)>> = (0..STICKS.len()).map(|k| self.stick(k)).collect();
        if !self.findings.is_empty() {
            return None;
        }
        let sources: Vec<Source> = sources.into_iter().flatten().collect();
        let inputs: Vec<(usize, f64)> = inputs.into_iter().flatten().collect();
        let mut scaled = self.scaled(&sources, &inputs)?;
        let limits = scaled.limits;
        self.fill_kinematics(&sources, &mut scaled);
        let (model, inner_trim, rigid_trim) = self.rigid_first(&sources, scaled, kept)?;
        let trim = self.trim(&model, &rigid_trim.0, &rigid_trim.1, &limits)?;
        let model = self.constructed(&sources, model, &trim)?;
        self.plausible(&sources, &model, &trim);
        let model = self.without_integrators(model)?;
        let inner_trim = model.states()[RIGID..]
            .iter()
            .map(|c| inner_trim.iter().find(|(name, _)| *name == c.name).and_then(|(_, x)| *x))
            .collect();
        self.reachable(&model);
        let (model, measured, inner_trim) =
            self.delayed(model, &sources, &inputs, inner_trim, &trim)?;
        let point = PointModel {
            label: format!("{}, {}", self.raw.file, self.raw.place),
            speed: self.raw.speed,
            model,
            measured,
            trim,
            inner_trim,
        };
        self.findings.is_empty().then_some((point, limits))
    }

    /// Every entry of every matrix is a number.
    fn finite(&mut self) {
        let raw = self.raw;
        let parts = [
            ("A", &raw.a, &raw.states, &raw.states),
            ("B", &raw.b, &raw.states, &raw.inputs),
            ("C", &raw.c, &raw.outputs, &raw.states),
            ("D", &raw.d, &raw.outputs, &raw.inputs),
        ];
        for (label, matrix, rows, columns) in parts {
            for (i, row) in rows.iter().enumerate() {
                if let Some(j) = (0..columns.len()).find(|j| !matrix[(i, *j)].is_finite()) {
                    let message = format!(
                        "{label} is not a finite number in column {}: {}",
                        columns[j].name,
                        matrix[(i, j)]
                    );
                    self.wrong(&row.name, message, "write a finite number".into());
                }
            }
        }
        for channel in raw.states.iter().chain(&raw.inputs) {
            if channel.trim.is_some_and(|x| !x.is_finite()) {
                let message = "the trim value is not a finite number".into();
                self.wrong(&channel.name, message, "write a finite number".into());
            }
        }
        for channel in raw.states.iter().chain(&raw.inputs).chain(&raw.outputs) {
            if !(0.0..=LONGEST_DELAY).contains(&channel.delay) {
                let message =
                    format!("a delay of {} s is not from 0 to {LONGEST_DELAY} s", channel.delay);
                self.wrong(&channel.name, message, "delays are in seconds".into());
            }
        }
        if !raw.speed.is_finite() || raw.speed < 0.0 {
            self.wrong("", format!("the speed is {} m/s", raw.speed), "give true airspeed".into());
        }
    }

    /// Place and sign of one of our names in a list.
    fn find(
        &mut self,
        ours: usize,
        list: &[RawChannel],
        role: &str,
    ) -> Result<Option<(usize, f64)>, ()> {
        if let Some(mapped) = &self.mapping.names[ours] {
            return Ok(list
                .iter()
                .position(|c| c.name == mapped.name)
                .map(|place| (place, mapped.sign)));
        }
        if let Some(place) = list.iter().position(|c| c.name == NAMES[ours]) {
            return Ok(Some((place, 1.0)));
        }
        let found: Vec<usize> =
            (0..list.len()).filter(|k| is_alias(&list[*k].name, ours)).collect();
        match found.as_slice() {
            [] => Ok(None),
            [only] => Ok(Some((*only, 1.0))),
            [one, other, ..] => {
                let (one, other) = (list[*one].name.clone(), list[*other].name.clone());
                let message =
                    format!("both {role}s \"{one}\" and \"{other}\" could be {}", NAMES[ours]);
                let help = format!("add {}, or the other", line_for_name(ours, &one));
                self.wrong(&one, message, help);
                Err(())
            }
        }
    }

    /// Where one of the rigid-body quantities is.
    fn source(&mut self, ours: usize) -> Option<Source> {
        let raw = self.raw;
        if let Some((k, sign)) = self.find(ours, &raw.states, "state").ok()? {
            return Some(Source::State(k, sign));
        }
        if let Some((k, sign)) = self.find(ours, &raw.outputs, "output").ok()? {
            if raw.d.row(k).iter().any(|d| *d != 0.0) {
                let name = raw.outputs[k].name.clone();
                let message = format!(
                    "the output has a direct path from the sticks, so that {} \
                                       is no state of the motion",
                    NAMES[ours]
                );
                let help = format!("name another state or output: {}", line_for_name(ours, "..."));
                self.wrong(&name, message, help);
                return None;
            }
            return Some(Source::Output(k, sign));
        }
        let all: Vec<&str> =
            raw.states.iter().chain(&raw.outputs).map(|c| c.name.as_str()).collect();
        if let Some(mapped) = &self.mapping.names[ours] {
            let message = format!("there is no state or output \"{}\"", mapped.name);
            let help = format!("the set has {}", all.join(", "));
            self.wrong(NAMES[ours], message, help);
            return None;
        }
        if ours == PHI || ours == THETA {
            return Some(Source::Constructed);
        }
        let message = format!("no state or output is known to be {}", NAMES[ours]);
        let help = format!(
            "add {} of the specification with one of its names: {}",
            line_for_name(ours, "NAME"),
            all.join(", ")
        );
        self.wrong(NAMES[ours], message, help);
        None
    }

    fn stick(&mut self, stick: usize) -> Option<(usize, f64)> {
        let (raw, ours) = (self.raw, RIGID + stick);
        if let Some(found) = self.find(ours, &raw.inputs, "input").ok()? {
            return Some(found);
        }
        let all: Vec<&str> = raw.inputs.iter().map(|c| c.name.as_str()).collect();
        let message = match &self.mapping.names[ours] {
            Some(mapped) => format!("there is no input \"{}\"", mapped.name),
            None => format!("no input is known to be {}", NAMES[ours]),
        };
        let help = format!(
            "add {} of the specification with one of its names: {}",
            line_for_name(ours, "NAME"),
            all.join(", ")
        );
        self.wrong(NAMES[ours], message, help);
        None
    }

    /// Sizes of the units, SI per unit of the file, and kinds of all channels;
    /// then the matrices in SI with the four sticks as inputs.
    fn scaled(&mut self, sources: &[Source], inputs: &[(usize, f64)]) -> Option<Scaled> {
        let raw = self.raw;
        let mut states: Vec<(Channel, f64)> = raw.states.iter().map(own_unit).collect();
        let mut outputs: Vec<(Channel, f64)> = raw.outputs.iter().map(own_unit).collect();
        for (k, source) in sources.iter().enumerate() {
            let (channel, sign, slot) = match source {
                Source::State(i, sign) => (&raw.states[*i], *sign, &mut states[*i]),
                Source::Output(i, sign) => (&raw.outputs[*i], *sign, &mut outputs[*i]),
                Source::Constructed => continue,
            };
            let unit = self.mapping.units[k].as_deref().or(channel.unit.as_deref());
            match factor(k, unit, None) {
                Ok(size) => *slot = (Channel::new(NAMES[k], KINDS[k]), size * sign),
                Err((message, help)) => {
                    let name = channel.name.clone();
                    self.wrong(&name, message, help);
                }
            }
        }
        let mut sizes = Vec::new();
        let mut u0 = [None; 4];
        let mut limits = [WHOLE_TRAVEL; 4];
        for (k, (i, sign)) in inputs.iter().enumerate() {
            let channel = &raw.inputs[*i];
            let ours = RIGID + k;
            let unit = self.mapping.units[ours].as_deref().or(channel.unit.as_deref());
            match factor(ours, unit, self.mapping.travel[k].as_deref()) {
                Ok(size) => {
                    let percent = unit
                        .is_some_and(|u| parse_quantity(&format!("1 {u}"), Kind::Percent).is_ok());
                    // Other units count from the middle, the collective's from
                    // full down.
                    let zero = if percent || STICKS[k] == "col" { 0.0 } else { 50.0 };
                    let percent = |x: f64| zero + x * size * sign;
                    u0[k] = channel.trim.map(percent);
                    let ends = channel.limits.map(|end| end.map(percent));
                    let [low, high] = if *sign < 0.0 { [ends[1], ends[0]] } else { ends };
                    for (limit, end) in limits[k].iter_mut().zip([low, high]) {
                        *limit = end.unwrap_or(*limit);
                    }
                    let [low, high] = limits[k];
                    // Written so that what is no number fails too.
                    if !(low < high && low.is_finite() && high.is_finite()) {
                        let name = channel.name.clone();
                        let message = format!("its limits are {low} and {high} %");
                        let help = "give a least position below the greatest";
                        self.wrong(&name, message, help.into());
                    }
                    sizes.push(size * sign);
                }
                Err((message, help)) => {
                    let name = channel.name.clone();
                    self.wrong(&name, message, help);
                }
            }
        }
        if !self.findings.is_empty() {
            return None;
        }
        for (k, channel) in raw.inputs.iter().enumerate() {
            if inputs.iter().all(|(i, _)| *i != k) {
                self.notes.push(format!("input \"{}\" is no stick and is left out", channel.name));
            }
        }
        let f: Vec<f64> = states.iter().map(|s| s.1).collect();
        let h: Vec<f64> = outputs.iter().map(|s| s.1).collect();
        let columns: Vec<usize> = inputs.iter().map(|(i, _)| *i).collect();
        let pick = |m: &DMatrix<f64>, rows: &[f64]| {
            DMatrix::from_fn(m.nrows(), columns.len(), |i, j| {
                m[(i, columns[j])] * rows[i] / sizes[j]
            })
        };
        let scale = |m: &DMatrix<f64>, rows: &[f64]| {
            DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * rows[i] / f[j])
        };
        Some(Scaled {
            a: scale(&raw.a, &f),
            b: pick(&raw.b, &f),
            c: scale(&raw.c, &h),
            d: pick(&raw.d, &h),
            x0: raw.states.iter().zip(&f).map(|(c, size)| c.trim.map(|x| x * size)).collect(),
            u0,
            limits,
            states: states.into_iter().map(|s| s.0).collect(),
            outputs: outputs.into_iter().map(|s| s.0).collect(),
        })
    }

    /// Rows of attitudes that the file has as columns only: φ' and θ' in the
    /// trim, straight flight.
    fn fill_kinematics(&mut self, sources: &[Source], s: &mut Scaled) {
        let place = |k: usize| match sources[k] {
            Source::State(i, _) => Some(i),
            _ => None,
        };
        let attitude = |k: usize| place(k).and_then(|i| s.x0[i]).unwrap_or(0.0);
        let (roll, pitch) = (attitude(PHI), attitude(THETA));
        for k in [PHI, THETA] {
            let Some(row) = place(k).filter(|i| self.raw.kinematic.contains(i)) else { continue };
            let row_of = kinematic_row(k, roll, pitch);
            for (rate, value) in [P, Q, R].into_iter().zip(row_of) {
                match place(rate) {
                    Some(column) => s.a[(row, column)] = value,
                    None if value == 0.0 => {}
                    None => {
                        let message =
                            format!("the row is missing, and {} is no state", NAMES[rate]);
                        self.wrong(NAMES[k], message, "give the row of the attitude".into());
                    }
                }
            }
        }
    }

    /// The eight quantities as the first states, by a change of state where
    /// they are outputs. Constructed attitudes are left to
    /// [`Work::constructed`]. Also trims: of the states kept, by name; of the
    /// eight, and of the sticks.
    #[allow(clippy::type_complexity)]
    fn rigid_first(
        &mut self,
        sources: &[Source],
        s: Scaled,
        kept: Option<&[String]>,
    ) -> Option<(StateSpace, Vec<(String, Option<f64>)>, ([Option<f64>; 8], [Option<f64>; 4]))>
    {
        let n = s.states.len();
        let given: Vec<usize> = (0..RIGID).filter(|k| sources[*k] != Source::Constructed).collect();
        // Rows of the eight in the file's states.
        let mut rows = DMatrix::zeros(given.len(), n);
        let mut used = vec![false; n];
        for (row, k) in given.iter().enumerate() {
            match sources[*k] {
                Source::State(i, _) => {
                    rows[(row, i)] = 1.0;
                    if used[i] {
                        let message = format!("the state stands for two of {}", NAMES.join(", "));
                        let name = self.raw.states[i].name.clone();
                        self.wrong(&name, message, "name each state once".into());
                        return None;
                    }
                    used[i] = true;
                }
                Source::Output(i, _) => rows.set_row(row, &s.c.row(i)),
                Source::Constructed => {}
            }
        }
        // Where an output becomes a state, the state that it depends on most
        // gives way.
        let mut rest = rows.clone();
        for (row, k) in given.iter().enumerate() {
            if !matches!(sources[*k], Source::Output(..)) {
                continue;
            }
            for (other, j) in given.iter().enumerate() {
                if let Source::State(i, _) = sources[*j] {
                    let by = rest[(row, i)];
                    let line = rest.row(other) * by;
                    let reduced = rest.row(row) - line;
                    rest.set_row(row, &reduced);
                }
            }
            let free = |i: &usize| {
                !used[*i] && kept.is_none_or(|names| !names.contains(&s.states[*i].name))
            };
            let pivot = (0..n)
                .filter(free)
                .max_by(|a, b| rest[(row, *a)].abs().total_cmp(&rest[(row, *b)].abs()))
                .filter(|i| rest[(row, *i)].abs() > 1e-12 * rows.row(row).amax());
            let Some(pivot) = pivot else {
                let Source::Output(i, _) = sources[*k] else { continue };
                let name = self.raw.outputs[i].name.clone();
                let message =
                    format!("the output for {} says nothing that the others do not say", NAMES[*k]);
                self.wrong(&name, message, "name another output or state".into());
                return None;
            };
            used[pivot] = true;
            let line = rest.row(row) / rest[(row, pivot)];
            for other in row + 1..given.len() {
                let reduced = rest.row(other) - &line * rest[(other, pivot)];
                rest.set_row(other, &reduced);
            }
        }
        let inner: Vec<usize> = (0..n).filter(|i| !used[*i]).collect();
        let mut t = DMatrix::zeros(n, n);
        t.rows_mut(0, given.len()).copy_from(&rows);
        for (row, i) in inner.iter().enumerate() {
            t[(given.len() + row, *i)] = 1.0;
        }
        let inverse = t.clone().try_inverse().filter(|m| m.iter().all(|x| x.is_finite()));
        let Some(inverse) = inverse else {
            let message = "the eight measured quantities do not say different things".into();
            self.wrong("", message, "name other states or outputs".into());
            return None;
        };
        let mut channels: Vec<Channel> =
            given.iter().map(|k| Channel::new(NAMES[*k], KINDS[*k])).collect();
        channels.extend(inner.iter().map(|i| s.states[*i].clone()));
        let sticks = STICKS.map(|name| Channel::new(name, Kind::Percent)).to_vec();
        let model = StateSpace::new(
            channels,
            sticks,
            s.outputs,
            &t * &s.a * &inverse,
            &t * &s.b,
            &s.c * &inverse,
            s.d,
        );
        let model = self.linear(model)?;
        let inner_trim = inner.iter().map(|i| (s.states[*i].name.clone(), s.x0[*i])).collect();
        let all: Option<Vec<f64>> = s.x0.iter().copied().collect();
        let mut eight = [None; 8];
        for (row, k) in given.iter().enumerate() {
            eight[*k] = match sources[*k] {
                Source::State(i, _) => s.x0[i],
                _ => all.as_ref().map(|x| (rows.row(row) * DVector::from_column_slice(x))[(0, 0)]),
            };
        }
        Some((model, inner_trim, (eight, s.u0)))
    }

    fn linear<T>(&mut self, result: Result<T, LinearError>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(error) => {
                self.wrong("", error.to_string(), String::new());
                None
            }
        }
    }

    /// The trim, or what stands for it.
    fn trim(
        &mut self,
        model: &StateSpace,
        x0: &[Option<f64>; 8],
        u0: &[Option<f64>; 4],
        limits: &[[f64; 2]; 4],
    ) -> Option<Trim> {
        let speed = self.raw.speed;
        let missing: Vec<&str> = [0, 1, 2, PHI, THETA]
            .into_iter()
            .filter(|k| x0[*k].is_none() && model.state(NAMES[*k]).is_ok())
            .map(|k| NAMES[k])
            .chain(u0.iter().zip(STICKS).filter(|(x, _)| x.is_none()).map(|(_, name)| name))
            .collect();
        let middle = |k: usize| 0.5 * (limits[k][0] + limits[k][1]);
        let sticks = std::array::from_fn(|k| u0[k].unwrap_or_else(|| middle(k)));
        let trim = if missing.is_empty() {
            let of = |k: usize| x0[k].unwrap_or(0.0);
            Trim {
                velocity_body: [of(0), of(1), of(2)],
                rates: [of(P), of(Q), of(R)],
                roll: of(PHI),
                pitch: of(THETA),
                sticks,
            }
        } else if self.mapping.missing_trim == MissingTrim::LevelFlight {
            let entry = |row: &str, column: &str| model.derivative(row, column).unwrap_or(0.0);
            let pitch = x0[THETA].unwrap_or_else(|| {
                (-entry("w", "theta")).atan2((-entry("u", "theta")).max(f64::MIN_POSITIVE))
            });
            let roll = x0[PHI].unwrap_or_else(|| {
                (-entry("w", "phi")).atan2(entry("v", "phi").max(f64::MIN_POSITIVE))
            });
            // Attitudes that no entry speaks of.
            let (pitch, roll) = (within_quarter(pitch), within_quarter(roll));
            self.notes.push(format!(
                "the trim does not say {}: attitudes are taken from the gravity terms of A, \
                 velocities are those of level flight without sideslip, sticks are in the middle",
                missing.join(", ")
            ));
            let level = level_velocity(speed, roll, pitch);
            Trim {
                velocity_body: std::array::from_fn(|k| x0[k].unwrap_or(level[k])),
                rates: [P, Q, R].map(|k| x0[k].unwrap_or(0.0)),
                roll,
                pitch,
                sticks,
            }
        } else {
            let message = format!("the trim does not say {}", missing.join(", "));
            let help = "give the trim values x0 and u0 of the model, or add missing_trim = \
                        \"level_flight\" under [models_from] of the specification";
            self.wrong("trim", message, help.into());
            return None;
        };
        let own = trim.velocity_body.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (own - speed).abs() > SLOW.max(SPEED_DIFFERENCE * speed) {
            let message = format!(
                "u, v and w of the trim make {:.1} kt, but the model is for {:.1} kt",
                own / KNOT,
                speed / KNOT
            );
            let help = "trim values are totals, in the units of their columns; the speed is true \
                        airspeed";
            self.wrong("trim", message, help.into());
        }
        for (k, percent) in trim.sticks.iter().enumerate() {
            let [low, high] = limits[k];
            if !(low - 1e-9..=high + 1e-9).contains(percent) {
                let message = format!(
                    "{} is at {percent:.1} %, but it reaches from {low} to {high} %",
                    STICKS[k]
                );
                let help = "trim values are totals, in % of the travel or in the stick's unit; a \
                            stick that does not reach from 0 to 100 % needs its limits (u_min and \
                            u_max, or rows least and greatest)";
                self.wrong("trim", message, help.into());
            }
        }
        for (name, angle) in [("phi", trim.roll), ("theta", trim.pitch)] {
            if angle.abs() > 0.4 * PI {
                let message = format!("{name} is {:.1} deg in the trim", angle.to_degrees());
                self.wrong("trim", message, "is its unit right?".into());
            }
        }
        Some(trim)
    }

    /// Attitudes that the model does not have, from its rates.
    fn constructed(
        &mut self,
        sources: &[Source],
        model: StateSpace,
        trim: &Trim,
    ) -> Option<StateSpace> {
        let missing: Vec<usize> =
            [PHI, THETA].into_iter().filter(|k| sources[*k] == Source::Constructed).collect();
        if missing.is_empty() {
            return Some(model);
        }
        let (n, extra) = (model.states().len(), missing.len());
        let mut a = DMatrix::zeros(n + extra, n + extra);
        a.view_mut((0, 0), (n, n)).copy_from(model.a());
        let mut b = DMatrix::zeros(n + extra, model.inputs().len());
        b.rows_mut(0, n).copy_from(model.b());
        let mut c = DMatrix::zeros(model.outputs().len(), n + extra);
        c.columns_mut(0, n).copy_from(model.c());
        let mut states = model.states().to_vec();
        for (i, k) in missing.iter().enumerate() {
            for (rate, value) in [P, Q, R].into_iter().zip(kinematic_row(*k, trim.roll, trim.pitch))
            {
                let column = self.linear(model.state(NAMES[rate]))?;
                a[(n + i, column)] = value;
            }
            states.push(Channel::new(NAMES[*k], KINDS[*k]));
            self.notes.push(format!(
                "{} is not in the models: it is integrated from the rates, and nothing depends \
                 on it",
                NAMES[*k]
            ));
        }
        let (inputs, outputs, d) =
            (model.inputs().to_vec(), model.outputs().to_vec(), model.d().clone());
        let model = self.linear(StateSpace::new(states, inputs, outputs, a, b, c, d))?;
        let mut order: Vec<String> = RIGID_BODY.map(str::to_owned).to_vec();
        let inner = model.states().iter().map(|c| c.name.clone());
        order.extend(inner.filter(|name| !RIGID_BODY.contains(&name.as_str())));
        self.linear(model.reorder_states(&order))
    }

    /// Gravity and kinematics give away a wrong unit or sign.
    fn plausible(&mut self, sources: &[Source], model: &StateSpace, trim: &Trim) {
        let has = |k: usize| sources[k] != Source::Constructed;
        let (cr, cp) = (trim.roll.cos(), trim.pitch.cos());
        let mut checks: Vec<(&str, &str, f64, &str)> = Vec::new();
        if has(THETA) {
            checks.push(("u", "theta", -GRAVITY * cp, "-g cos(theta)"));
            checks.push(("theta", "q", cr, "cos(phi)"));
        }
        if has(PHI) {
            checks.push(("v", "phi", GRAVITY * cr * cp, "g cos(phi) cos(theta)"));
            checks.push(("phi", "p", 1.0, "1"));
        }
        for (row, column, expected, formula) in checks {
            let Ok(found) = model.derivative(row, column) else { continue };
            let ratio = found / expected;
            if (1.0 / PLAUSIBLE..=PLAUSIBLE).contains(&ratio) {
                continue;
            }
            let mut help = format!(
                "check units and signs of {row} and {column}, in the set or under \
                 [models_from.units] of the specification"
            );
            let size = ratio.abs();
            for (name, of) in
                [("ft and m are mixed up", 1.0 / 0.3048), ("deg and rad are mixed up", 180.0 / PI)]
            {
                if [of, 1.0 / of].iter().any(|f| (size / f - 1.0).abs() < 0.1) {
                    help = format!("{name}: {help}");
                }
            }
            if (ratio + 1.0).abs() < PLAUSIBLE - 1.0 {
                help = format!(
                    "the sign of {column} is the other way round; a minus sign reverses it: {}",
                    line_for_name(
                        NAMES.iter().position(|n| *n == column).unwrap_or(0),
                        &format!("-{column}")
                    )
                );
            }
            let message = format!(
                "A({row}, {column}) is {found:.4} in SI units, but gravity and kinematics give \
                 {formula} = {expected:.4}"
            );
            self.wrong(row, message, help);
        }
    }

    /// Without states such as heading or position, on which nothing depends
    /// and which never settle.
    fn without_integrators(&mut self, model: StateSpace) -> Option<StateSpace> {
        let mut model = model;
        loop {
            let n = model.states().len();
            let idle = (RIGID..n).find(|&j| {
                model.a()[(j, j)].abs() < 1e-9 && (0..n).all(|i| i == j || model.a()[(i, j)] == 0.0)
            });
            let Some(j) = idle else { return Some(model) };
            let name = model.states()[j].name.clone();
            let outputs: Vec<String> = model
                .outputs()
                .iter()
                .enumerate()
                .filter(|(i, _)| model.c()[(*i, j)] == 0.0)
                .map(|(_, c)| c.name.clone())
                .collect();
            let fewer = model.select_outputs(&outputs).and_then(|m| m.remove_unused(&[&name]));
            model = self.linear(fewer)?;
            self.notes.push(format!("state \"{name}\" is left out: nothing depends on it"));
        }
    }

    /// Every unstable mode can be moved by the sticks and seen by the law.
    fn reachable(&mut self, model: &StateSpace) {
        let dual = StateSpace::new(
            model.states().to_vec(),
            RIGID_BODY.map(|name| Channel::new(name, Kind::Dimensionless)).to_vec(),
            Vec::new(),
            model.a().transpose(),
            DMatrix::from_fn(model.states().len(), RIGID, |i, j| f64::from(u8::from(i == j))),
            DMatrix::zeros(0, model.states().len()),
            DMatrix::zeros(0, RIGID),
        );
        let Some(dual) = self.linear(dual) else { return };
        for (what, system) in
            [("the sticks cannot move", model), ("the measured quantities do not show", &dual)]
        {
            let Some(list) = self.linear(structure::controllability(system)) else { return };
            for mode in list {
                let value = mode.eigenvalue;
                if value.re > UNSTABLE && value.im >= 0.0 && mode.measure < CANCELLED {
                    let message = format!(
                        "{what} the unstable mode at {:.4} {:+.4}i rad/s: a pole and a zero \
                         cancel",
                        value.re, value.im
                    );
                    let help = "no feedback can stabilise it; leave the mode out of the model, or \
                                give its inputs and outputs";
                    self.wrong("", message, help.into());
                }
            }
        }
    }

    /// Delays of sticks and of measured quantities as further states.
    #[allow(clippy::type_complexity)]
    fn delayed(
        &mut self,
        model: StateSpace,
        sources: &[Source],
        inputs: &[(usize, f64)],
        inner_trim: Vec<Option<f64>>,
        trim: &Trim,
    ) -> Option<(StateSpace, [usize; 8], Vec<Option<f64>>)> {
        let raw = self.raw;
        let mut lines: Vec<(bool, usize, f64)> = Vec::new();
        for (k, (i, _)) in inputs.iter().enumerate() {
            lines.push((true, k, raw.inputs[*i].delay));
        }
        for (k, source) in sources.iter().enumerate() {
            let delay = match source {
                // An output of the state's name may carry the delay.
                Source::State(i, _) => raw
                    .outputs
                    .iter()
                    .find(|o| o.name == raw.states[*i].name)
                    .map_or(raw.states[*i].delay, |o| o.delay),
                Source::Output(i, _) => raw.outputs[*i].delay,
                Source::Constructed => 0.0,
            };
            lines.push((false, k, delay));
        }
        lines.retain(|(_, _, delay)| *delay > 0.0);
        let mut measured: [usize; 8] = std::array::from_fn(|k| k);
        if lines.is_empty() {
            return Some((model, measured, inner_trim));
        }
        let n = model.states().len();
        let parts: Vec<_> = lines.iter().map(|(_, _, delay)| delay_line(*delay)).collect();
        let total = n + parts.iter().map(|(a, _)| a.nrows()).sum::<usize>();
        let mut a = DMatrix::zeros(total, total);
        a.view_mut((0, 0), (n, n)).copy_from(model.a());
        let mut b = DMatrix::zeros(total, 4);
        b.rows_mut(0, n).copy_from(model.b());
        let mut c = DMatrix::zeros(model.outputs().len(), total);
        c.columns_mut(0, n).copy_from(model.c());
        let mut d = model.d().clone();
        let mut states = model.states().to_vec();
        let mut at = n;
        for ((input, k, _), (line_a, line_b)) in lines.iter().zip(&parts) {
            let size = line_a.nrows();
            a.view_mut((at, at), (size, size)).copy_from(line_a);
            let name = if *input { STICKS[*k] } else { NAMES[*k] };
            if *input {
                // The first state of the line is what comes out of it.
                for i in 0..n {
                    a[(i, at)] += model.b()[(i, *k)];
                    b[(i, *k)] = 0.0;
                }
                for i in 0..c.nrows() {
                    c[(i, at)] += d[(i, *k)];
                    d[(i, *k)] = 0.0;
                }
                for i in 0..size {
                    b[(at + i, *k)] = line_b[i];
                }
            } else {
                for i in 0..size {
                    a[(at + i, *k)] += line_b[i];
                }
                measured[*k] = at;
            }
            for i in 0..size {
                states.push(Channel::new(format!("{name}.delay_{i}"), Kind::Dimensionless));
            }
            at += size;
        }
        let (sticks, outputs) = (model.inputs().to_vec(), model.outputs().to_vec());
        let model = self.linear(StateSpace::new(states, sticks, outputs, a, b, c, d))?;
        // At rest the first state of a line is what goes into it, and the others
        // are nil.
        let [u, v, w] = trim.velocity_body;
        let [p, q, r] = trim.rates;
        let rigid = [u, v, w, p, q, r, trim.roll, trim.pitch];
        let mut trims = inner_trim;
        for ((input, k, _), (line, _)) in lines.iter().zip(&parts) {
            trims.push(Some(if *input { trim.sticks[*k] } else { rigid[*k] }));
            trims.extend(std::iter::repeat_n(Some(0.0), line.nrows() - 1));
        }
        Some((model, measured, trims))
    }
}

/// A channel with its own name; its unit where it is a known one.
fn own_unit(channel: &RawChannel) -> (Channel, f64) {
    const KNOWN: [Kind; 12] = [
        Kind::Dimensionless,
        Kind::Velocity,
        Kind::AngularRateRad,
        Kind::AngleRad,
        Kind::Percent,
        Kind::Length,
        Kind::Acceleration,
        Kind::AngularAcceleration,
        Kind::Force,
        Kind::Moment,
        Kind::Power,
        Kind::Time,
    ];
    let unit = channel.unit.as_deref().unwrap_or("").trim();
    if !unit.is_empty() && unit != "-" {
        for kind in KNOWN {
            if let Ok(size) = parse_quantity(&format!("1 {unit}"), kind) {
                return (Channel::new(&channel.name, kind), size);
            }
        }
    }
    (Channel::new(&channel.name, Kind::Dimensionless), 1.0)
}

/// φ' or θ' per p, q, r at attitudes, rad, in straight flight.
fn kinematic_row(k: usize, roll: f64, pitch: f64) -> [f64; 3] {
    if k == PHI {
        [1.0, roll.sin() * pitch.tan(), roll.cos() * pitch.tan()]
    } else {
        [0.0, roll.cos(), -roll.sin()]
    }
}

/// Zero where an angle is not between −90° and 90°.
fn within_quarter(angle: f64) -> f64 {
    if angle.abs() < 0.5 * PI - 1e-6 { angle } else { 0.0 }
}

/// Body velocity of level flight without sideslip of the track, m/s.
pub(super) fn level_velocity(speed: f64, roll: f64, pitch: f64) -> [f64; 3] {
    [speed * pitch.cos(), speed * roll.sin() * pitch.sin(), speed * roll.cos() * pitch.sin()]
}

/// A delay in state form: the Padé approximation of order (m − 1, m) in
/// Legendre coordinates (Voelker and Eliasmith, Neural Computation 30, 2018),
/// which stay of like size whatever the order. The first state is the delayed
/// signal.
///
/// m is chosen so that the phase is right to a thousandth of a radian up to
/// [`DELAY_FREQUENCY`].
fn delay_line(delay: f64) -> (DMatrix<f64>, DVector<f64>) {
    let m = (3 + (0.75 * DELAY_FREQUENCY * delay).ceil() as usize).min(24);
    let mut a = DMatrix::from_fn(m, m, |i, j| {
        let sign = if i < j || (i - j) % 2 == 1 { -1.0 } else { 1.0 };
        // −1 above the diagonal; below (−1)^(i−j+1).
        let entry = if i < j { -1.0 } else { -sign };
        (2 * i + 1) as f64 / delay * entry
    });
    let mut b = DVector::from_fn(m, |i, _| {
        (2 * i + 1) as f64 / delay * if i % 2 == 0 { 1.0 } else { -1.0 }
    });
    // The delayed signal is the sum of the states: it takes the first place.
    for j in 0..m {
        let sum: f64 = a.column(j).sum();
        a[(0, j)] = sum;
    }
    b[0] = b.sum();
    for i in 0..m {
        for j in 1..m {
            let first = a[(i, 0)];
            a[(i, j)] -= first;
        }
    }
    (a, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;

    /// The line is e^(−jωτ) to a thousandth up to 60 rad/s, and one at rest.
    #[test]
    fn val_delay_line_is_the_delay() {
        for delay in [0.002, 0.0074, 0.02, 0.0656, 0.1, 0.2] {
            let (a, b) = delay_line(delay);
            let m = a.nrows();
            for omega in [0.0, 1.0, 10.0, 30.0, 60.0] {
                let matrix = DMatrix::from_fn(m, m, |i, j| {
                    Complex64::new(-a[(i, j)], if i == j { omega } else { 0.0 })
                });
                let input = b.map(|x| Complex64::new(x, 0.0));
                let x = matrix.lu().solve(&input).unwrap();
                let error = (x[0] - Complex64::from_polar(1.0, -omega * delay)).norm();
                assert!(error < 1e-3, "{delay} s, {omega} rad/s: {error:.1e}, order {m}");
            }
        }
    }

    #[test]
    fn level_velocities_are_level() {
        let (roll, pitch) = (0.1f64, -0.2f64);
        let [u, v, w] = level_velocity(30.0, roll, pitch);
        let down = -u * pitch.sin() + (v * roll.sin() + w * roll.cos()) * pitch.cos();
        let side = v * roll.cos() - w * roll.sin();
        assert!(down.abs() < 1e-12 && side.abs() < 1e-12);
        assert!((u.hypot(v).hypot(w) - 30.0).abs() < 1e-12);
    }
}
