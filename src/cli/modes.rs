//! `coaxdesign modes`.

use std::path::PathBuf;

use clap::Args;
use num_complex::Complex64;
use rayon::prelude::*;
use serde_json::{Value as Json, json};

use super::args::{Format, FormatArgs, ModelsArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::bode::{speed_key, speed_text};
use super::models::{Choice, Flown, PointArgs, ReduceArgs, choice_among, fly};
use super::trim::{Interactions, on_off};
use super::{CliError, Outcome};
use coaxdesign::linear::floquet::{Floquet, FloquetOptions, analyse, pair_exponents};
use coaxdesign::linear::linearize::{Options, linearize};
use coaxdesign::linear::modes::{Mode, modes};
use coaxdesign::linear::{LinearError, PeriodicModel, StateSpace};
use coaxdesign::lti::{LtiSet, PointModel};
use coaxdesign::problem::{Problem, Reference};
use coaxdesign::report::figures::{EigenvalueSet, PlaneView, eigenvalue_figure};
use coaxdesign::report::plot::Legend;
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::trim::ConvergedTrim;
use coaxdesign::units::{Kind, System};

/// Modes slower than this, rad/s, are shown larger in a second panel of the
/// plot: those of the airframe.
const SLOW: f64 = 6.0;
/// Modes slower than this, rad/s, stand so close to one another that texts
/// beside them would overlap.
const CROWDED: f64 = 0.35;

/// Eigenvalues of the linear models of trims, or their Floquet exponents
#[derive(Debug, Args)]
pub struct Modes {
    #[command(flatten)]
    problem: ProblemArgs,
    #[command(flatten)]
    models: ModelsArgs,
    /// Specification whose [models_from] maps the names and units of the set
    #[arg(long, value_name = "SPEC", requires = "models")]
    spec: Option<PathBuf>,
    #[command(flatten)]
    point: PointArgs,
    /// Rotor-on-rotor interactions
    #[arg(long, value_enum, default_value = "both")]
    interactions: Interactions,
    /// averaged, harmonic:N or floquet
    #[arg(long, value_name = "MODEL", default_value = "averaged", value_parser = model)]
    model: Choice,
    #[command(flatten)]
    reduce: ReduceArgs,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Plot the eigenvalues; at several speeds their loci
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

fn model(text: &str) -> Result<Choice, String> {
    choice_among(text, |choice| choice != Choice::Full, "averaged, harmonic:N, floquet")
}

/// A mode as it is shown.
struct Row {
    /// Eigenvalue or exponent with Im ≥ 0, rad/s.
    value: Complex64,
    /// The mode that it is, or that stands for it in the averaged model.
    mode: Mode,
    floquet: Option<Exponent>,
}

/// What only Floquet's theory knows of a mode.
struct Exponent {
    averaged: Complex64,
    difference: f64,
    branch: i32,
    ambiguous: bool,
    uncertainty: f64,
}

/// The modes of one model.
struct Listing {
    label: String,
    style: usize,
    interactions: bool,
    /// Whether it is the paper's.
    published: bool,
    /// How far a reduced model may be trusted.
    note: String,
    rows: Vec<Row>,
}

/// The modes at one speed.
struct At {
    /// True airspeed, m/s.
    speed: f64,
    listings: Vec<Listing>,
}

impl Modes {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.output.check()?;
        self.format.of(&self.output)?;
        if let Some(path) = &self.plot {
            self.output.check_plot(path)?;
        }
        if self.model == Choice::Floquet && self.reduce.reduce.is_some() {
            return Err(CliError::Usage {
                message: "--model floquet works on the periodic model, which is not reduced".into(),
                help: "leave --reduce out, or choose --model averaged".into(),
            });
        }
        self.run.start()?;
        if let Some((set, points)) =
            self.models.points(&self.problem, self.spec.as_deref(), &self.point, self.run.quiet)?
        {
            return self.of_models(&set, &points);
        }
        let mut loaded = self.problem.load_with_warnings(self.run.quiet)?;
        let conditions = self.point.conditions(&mut loaded.problem)?;
        let problem = &loaded.problem;
        let positions = self.interactions.positions();
        let system = self.units.of(Some(problem));
        let Some(flown) =
            fly(problem, std::slice::from_ref(&conditions), positions, system, self.run.quiet)?
        else {
            return Ok(Outcome::GoalMissed);
        };
        let points: Vec<At> = conditions
            .par_iter()
            .enumerate()
            .map(|(k, condition)| {
                let speed = condition.horizontal_speed();
                let mut listings: Vec<Listing> = flown
                    .iter()
                    .map(|flown| self.listing(flown, &flown.sweeps[0][k]))
                    .collect::<Result<_, _>>()?;
                listings.extend(published(problem, Kind::Airspeed.from_si(speed, System::Us))?);
                Ok(At { speed, listings })
            })
            .collect::<Result<_, CliError>>()?;
        self.show(&problem.name, &self.title(), &points, system)
    }

    /// The modes of linear models from elsewhere.
    fn of_models(&self, set: &LtiSet, points: &[PointModel]) -> Result<Outcome, CliError> {
        let what = match self.reduce.reduce {
            None => "modes of the model",
            Some(_) => "modes of the reduced model",
        };
        let points: Vec<At> = points
            .iter()
            .map(|point| {
                let mut note = String::new();
                let rows = match self.reduce.apply(&point.model)? {
                    None => plain(modes(&point.model)?),
                    Some(reduced) => {
                        note = reduced.summary(&point.model);
                        plain(modes(&reduced.model)?)
                    }
                };
                let listing = Listing {
                    label: point.label.clone(),
                    style: 0,
                    interactions: false,
                    published: false,
                    note,
                    rows,
                };
                Ok(At { speed: point.speed, listings: vec![listing] })
            })
            .collect::<Result<_, CliError>>()?;
        self.show(&set.name, what, &points, self.units.of(None))
    }

    fn show(
        &self,
        name: &str,
        what: &str,
        points: &[At],
        system: System,
    ) -> Result<Outcome, CliError> {
        let title = |at: &At| format!("{name}: {what} at {}", speed_text(at.speed, system));
        if let Some(path) = &self.plot {
            let svg = match points {
                [one] => figure(&title(one), points, system).to_svg(),
                _ => figure(&format!("{name}: {what} over speed"), points, system).to_svg(),
            };
            self.output.write_plot(path, &svg)?;
        }
        let text = match self.format.of(&self.output)? {
            Format::Table => {
                let texts: Vec<String> =
                    points.iter().map(|at| tables(&title(at), &at.listings)).collect();
                texts.join("\n")
            }
            Format::Csv => csv(points, system),
            Format::Json => json_text(name, what, points, system)?,
        };
        self.output.write(&text)
    }

    fn title(&self) -> String {
        match self.reduce.reduce {
            Some(_) => format!("modes of the reduced {}", self.model.label()),
            None if self.model == Choice::Floquet => "Floquet exponents".into(),
            None => format!("modes of the {}", self.model.label()),
        }
    }

    fn listing(&self, flown: &Flown, trim: &ConvergedTrim) -> Result<Listing, CliError> {
        let periodic = linearize(&flown.vehicle, trim, &Options::default())?.model;
        let full = self.model.of(&periodic)?;
        let mut note = String::new();
        let rows = match (self.model, self.reduce.apply(&full)?) {
            (Choice::Floquet, _) => {
                let floquet = analyse(&periodic, &FloquetOptions::default())?;
                exponents(&floquet, &full)?
            }
            (Choice::Harmonic(_), None) => without_copies(&periodic, modes(&full)?),
            (_, None) => plain(modes(&full)?),
            (_, Some(reduced)) => {
                note = reduced.summary(&full);
                plain(modes(&reduced.model)?)
            }
        };
        Ok(Listing {
            label: format!("interactions {}", on_off(flown.interactions)),
            style: usize::from(!flown.interactions),
            interactions: flown.interactions,
            published: false,
            note,
            rows,
        })
    }
}

fn plain(modes: Vec<Mode>) -> Vec<Row> {
    modes.into_iter().map(|mode| Row { value: mode.eigenvalue, mode, floquet: None }).collect()
}

/// Leaves out the copies of each mode, shifted by multiples of jΩ, that a
/// harmonic model has: keeps as many eigenvalues as there are states, those
/// in which the slowly varying coefficients take part most.
fn without_copies(periodic: &PeriodicModel, modes: Vec<Mode>) -> Vec<Row> {
    let count = periodic.states().len();
    let share = |mode: &Mode| -> f64 {
        // The coefficients of harmonic zero come first.
        mode.participation.as_ref().map_or(0.0, |p| p[..count].iter().sum())
    };
    let mut order: Vec<usize> = (0..modes.len()).collect();
    order.sort_by(|&i, &j| share(&modes[j]).total_cmp(&share(&modes[i])).then(i.cmp(&j)));
    let mut kept = vec![false; modes.len()];
    let mut eigenvalues = 0;
    for index in order {
        if eigenvalues >= count {
            break;
        }
        kept[index] = true;
        eigenvalues += if modes[index].oscillates() { 2 } else { 1 };
    }
    plain(modes.into_iter().zip(kept).filter(|(_, kept)| *kept).map(|(mode, _)| mode).collect())
}

/// Exponents beside the averaged model's modes that stand for them.
fn exponents(floquet: &Floquet, averaged: &StateSpace) -> Result<Vec<Row>, LinearError> {
    let known = modes(averaged)?;
    let mut values = Vec::new();
    let mut owner = Vec::new();
    for (index, mode) in known.iter().enumerate() {
        values.push(mode.eigenvalue);
        owner.push(index);
        if mode.oscillates() {
            values.push(mode.eigenvalue.conj());
            owner.push(index);
        }
    }
    let pairs = pair_exponents(floquet, &values);
    let mut rows = Vec::new();
    for (pair, mode) in pairs.iter().zip(&floquet.modes) {
        if mode.exponent.im < 0.0 && mode.multiplier.im != 0.0 {
            // Its conjugate is listed.
            continue;
        }
        let Some(place) = values.iter().position(|value| *value == pair.approximate) else {
            continue;
        };
        rows.push(Row {
            value: mode.exponent,
            mode: known[owner[place]].clone(),
            floquet: Some(Exponent {
                averaged: pair.approximate,
                difference: pair.difference,
                branch: mode.branch,
                ambiguous: mode.ambiguous,
                uncertainty: mode.uncertainty,
            }),
        });
    }
    Ok(rows)
}

/// The modes of the published model of the speed, if the problem names the
/// publication and it has one. Its forward speed is the one that its matrices imply.
fn published(problem: &Problem, knots: f64) -> Result<Option<Listing>, CliError> {
    if problem.reference != Some(Reference::Coax2dPaper) {
        return Ok(None);
    }
    let near = |condition: Condition| (condition.implied_speed_kt() - knots).abs() < 1.0;
    let Some(condition) = [Condition::Hover, Condition::Forward].into_iter().find(|c| near(*c))
    else {
        return Ok(None);
    };
    Ok(Some(Listing {
        label: "paper's appendix, interactions on".into(),
        style: 2,
        interactions: true,
        published: true,
        note: String::new(),
        rows: plain(modes(&appendix(condition)?)?),
    }))
}

impl Row {
    fn damping(&self) -> Option<f64> {
        let size = self.value.norm();
        (size > 0.0).then(|| -self.value.re / size)
    }

    fn time_constant(&self) -> Option<f64> {
        (self.value.re != 0.0).then(|| -1.0 / self.value.re)
    }

    /// Time to half (of a decaying mode) or to double (of a growing one), s.
    fn half_or_double(&self) -> Option<f64> {
        (self.value.re != 0.0).then(|| std::f64::consts::LN_2 / self.value.re.abs())
    }

    fn grows(&self) -> bool {
        self.value.re > 0.0
    }

    fn dominant(&self) -> String {
        let parts: Vec<String> = self
            .mode
            .dominant
            .iter()
            .take(4)
            .map(|(name, share)| format!("{name} {:.0}%", 100.0 * share))
            .collect();
        parts.join(", ")
    }

    fn name(&self) -> &'static str {
        self.mode.name.map_or("", |name| name.label())
    }
}

fn columns(floquet: bool) -> Vec<Column> {
    let mut columns = vec![
        Column::number("real part", "rad/s", Digits::Decimals(4)),
        Column::number("imaginary part", "rad/s", Digits::Decimals(4)),
        Column::number("damping ratio", "", Digits::Decimals(3)),
        Column::number("frequency", "rad/s", Digits::Decimals(3)),
        Column::number("time constant", "s", Digits::Decimals(3)),
        Column::number("to half", "s", Digits::Decimals(3)),
        Column::number("to double", "s", Digits::Decimals(3)),
    ];
    if floquet {
        columns.push(Column::number("averaged, real", "rad/s", Digits::Decimals(4)));
        columns.push(Column::number("imaginary", "rad/s", Digits::Decimals(4)));
        columns.push(Column::number("difference", "rad/s", Digits::Significant(2)));
        columns.push(Column::text("branch"));
        columns.push(Column::number("rounding", "rad/s", Digits::Significant(1)));
    }
    columns.push(Column::text("states"));
    columns.push(Column::text("mode"));
    columns
}

fn cells(row: &Row) -> Vec<Cell> {
    let half = row.half_or_double();
    let mark = |cell: Cell| if row.grows() { cell.highlight(Highlight::Bad) } else { cell };
    let mut cells = vec![
        mark(Cell::from(row.value.re)),
        Cell::from(row.value.im),
        Cell::from(row.damping()),
        Cell::from(row.value.norm()),
        Cell::from(row.time_constant()),
        Cell::from(half.filter(|_| !row.grows())),
        mark(Cell::from(half.filter(|_| row.grows()))),
    ];
    if let Some(exponent) = &row.floquet {
        cells.push(Cell::from(exponent.averaged.re));
        cells.push(Cell::from(exponent.averaged.im));
        cells.push(Cell::from(exponent.difference));
        cells.push(Cell::from(format!(
            "{:+}Ω{}",
            exponent.branch,
            if exponent.ambiguous { " or another" } else { "" }
        )));
        cells.push(Cell::from(exponent.uncertainty));
    }
    cells.push(Cell::from(row.dominant()));
    cells.push(Cell::from(row.name()));
    cells
}

fn tables(title: &str, listings: &[Listing]) -> String {
    let mut text = format!("{title}\n");
    for listing in listings {
        let floquet = listing.rows.iter().any(|row| row.floquet.is_some());
        let mut table = Table::new(&listing.label, columns(floquet));
        for row in &listing.rows {
            table.row(cells(row));
        }
        text += "\n";
        text += &table.to_text(Coloring::for_stdout());
        text += &listing.note;
        if floquet {
            text += "States and mode are those of the averaged model's nearest eigenvalue.\n";
        }
    }
    text
}

fn csv(points: &[At], system: System) -> String {
    let listings = || points.iter().flat_map(|at| at.listings.iter().map(|l| (at.speed, l)));
    let floquet = listings().flat_map(|(_, l)| &l.rows).any(|row| row.floquet.is_some());
    let mut all = vec![
        Column::number("speed", Kind::Airspeed.symbol(system), Digits::Significant(6)),
        Column::text("model"),
    ];
    all.extend(columns(floquet));
    let mut table = Table::new("", all);
    for (speed, listing) in listings() {
        for row in &listing.rows {
            let mut line = vec![
                Cell::from(Kind::Airspeed.from_si(speed, system)),
                Cell::from(listing.label.as_str()),
            ];
            let mut rest = cells(row);
            if floquet && row.floquet.is_none() {
                let tail = rest.split_off(7);
                rest.extend((0..5).map(|_| Cell::empty()));
                rest.extend(tail);
            }
            line.extend(rest);
            table.row(line);
        }
    }
    table.to_csv()
}

fn json_text(name: &str, model: &str, points: &[At], system: System) -> Result<String, CliError> {
    let point = |at: &At| {
        let models: Vec<Json> = at
            .listings
            .iter()
            .map(|listing| {
                let rows: Vec<Json> = listing.rows.iter().map(row_json).collect();
                json!({
                    "label": listing.label,
                    "interactions": listing.interactions,
                    "published": listing.published,
                    "modes": rows,
                })
            })
            .collect();
        let (key, speed) = speed_key(at.speed, system);
        json!({key: speed, "models": models})
    };
    let all = json!({
        "schema": "coaxdesign.modes/2",
        "name": name,
        "model": model,
        "points": points.iter().map(point).collect::<Vec<_>>(),
    });
    serde_json::to_string_pretty(&all)
        .map(|text| text + "\n")
        .map_err(|error| CliError::Internal(error.to_string()))
}

fn row_json(row: &Row) -> Json {
    let half = row.half_or_double();
    let dominant: Vec<Json> = row
        .mode
        .dominant
        .iter()
        .map(|(state, share)| json!({"state": state, "share": share}))
        .collect();
    let mut object = json!({
        "real_rad_per_s": row.value.re,
        "imaginary_rad_per_s": row.value.im,
        "damping_ratio": row.damping(),
        "natural_frequency_rad_per_s": row.value.norm(),
        "time_constant_s": row.time_constant(),
        "time_to_half_s": half.filter(|_| !row.grows()),
        "time_to_double_s": half.filter(|_| row.grows()),
        "dominant": dominant,
        "name": row.mode.name.map(|name| name.label()),
    });
    if let (Some(exponent), Some(map)) = (&row.floquet, object.as_object_mut()) {
        map.insert(
            "floquet".into(),
            json!({
                "averaged_real_rad_per_s": exponent.averaged.re,
                "averaged_imaginary_rad_per_s": exponent.averaged.im,
                "difference_rad_per_s": exponent.difference,
                "branch": exponent.branch,
                "branch_ambiguous": exponent.ambiguous,
                // JSON has no infinity: a multiplier of zero leaves no exponent.
                "uncertainty_rad_per_s":
                    Some(exponent.uncertainty).filter(|value| value.is_finite()),
            }),
        );
    }
    object
}

/// Eigenvalues of all speeds, one set a model. Where there are several speeds,
/// the slow modes of the first model carry the first and the last of them.
fn figure(title: &str, points: &[At], system: System) -> coaxdesign::report::plot::Figure {
    let mut sets: Vec<EigenvalueSet> = Vec::new();
    let ends = [0, points.len() - 1];
    for (k, at) in points.iter().enumerate() {
        for listing in &at.listings {
            // Models from elsewhere are labelled by their speeds.
            let place = sets.iter().position(|set| set.style == listing.style);
            let place = place.unwrap_or_else(|| {
                sets.push(EigenvalueSet {
                    name: listing.label.clone(),
                    style: listing.style,
                    values: Vec::new(),
                    labels: Vec::new(),
                });
                sets.len() - 1
            });
            for row in &listing.rows {
                // Conjugates lie in the other half of the plane.
                let pair = row.value.im != 0.0;
                sets[place].values.push(row.value);
                sets[place].values.extend(pair.then(|| row.value.conj()));
                let apart = (CROWDED..SLOW).contains(&row.value.norm());
                if points.len() > 1 && place == 0 && ends.contains(&k) && apart {
                    sets[place].labels.push((row.value, speed_text(at.speed, system)));
                }
            }
        }
    }
    plane(title, &sets)
}

/// Eigenvalues in the plane: all of them, and the slow ones larger.
pub(super) fn plane(title: &str, sets: &[EigenvalueSet]) -> coaxdesign::report::plot::Figure {
    let values = || sets.iter().flat_map(|set| &set.values);
    let slow = || values().filter(|value| value.norm() < SLOW);
    let mut views = Vec::new();
    if values().any(|value| value.norm() >= SLOW) {
        views.push(PlaneView { title: "all modes".into(), real: None, imaginary: None });
    }
    let low = slow().map(|v| v.re).fold(-0.5, f64::min);
    let high = slow().map(|v| v.re).fold(0.2, f64::max);
    let top = slow().map(|v| v.im).fold(0.5, f64::max);
    let margin = 0.07 * (high - low);
    views.push(PlaneView {
        title: format!("slower than {SLOW} rad/s"),
        real: Some((low - margin, high + margin)),
        imaginary: Some((-0.04 * top, 1.1 * top)),
    });
    // Inside, the legend would hide eigenvalues.
    eigenvalue_figure(title, sets, &views).legend(Legend::Above)
}
