//! `coaxdesign compare`.

use std::path::{Path, PathBuf};

use clap::Args;
use num_complex::Complex64;
use rayon::prelude::*;
use serde_json::{Map, Value as Json, json};

use super::args::{Format, FormatArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs, builtin_name};
use super::designs::SourceArgs;
use super::modes::plane;
use super::report::Inputs;
use super::report::gather::Checked;
use super::trim::{attitude, curves, least_margin, on_off, parse_speeds};
use super::tune::usage;
use super::{CliError, Outcome, output};
use coaxdesign::control::axis::Channel;
use coaxdesign::control::models::from_state_space;
use coaxdesign::control::plant::{Inversion, ModelClass, TrimPoint as Equilibrium};
use coaxdesign::control::verify::{BladeControl, Row};
use coaxdesign::linear::linearize::{Options as LinearOptions, averaged};
use coaxdesign::linear::modes::{Mode, modes};
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::pipeline::blade_controls;
use coaxdesign::problem::Problem;
use coaxdesign::report::figures::{EigenvalueSet, trim_figure};
use coaxdesign::report::html::{Page, Section};
use coaxdesign::report::plot::Figure;
use coaxdesign::report::progress::Progress;
use coaxdesign::report::table::{Cell, Coloring, Column, Table, decimals};
use coaxdesign::trim::{FlightCondition, Options, TrimPoint, sweep};
use coaxdesign::units::{Kind, System};
use coaxdesign::vehicle::Vehicle;

/// Most speeds of which the table shows the trim.
const SPEEDS_SHOWN: usize = 4;
/// What ν is, in the order of the law.
const COMMANDS: [&str; 4] = ["roll", "pitch", "yaw", "heave"];

/// Problem files or designs side by side: trim, modes in hover, margins, effort
///
/// Each may be a problem file, the name of a built-in problem, or the directory of a design.
#[derive(Debug, Args)]
pub struct Compare {
    /// Problem files, built-in names or designs, at least two
    #[arg(value_name = "WHAT", required = true, num_args = 2..)]
    entries: Vec<PathBuf>,
    /// True airspeeds: FIRST:LAST:STEP with a unit, or a list
    #[arg(long, value_name = "SPEEDS", default_value = "0:90:10kt")]
    speeds: String,
    /// Rotor-on-rotor interactions [default: as in each problem]
    #[arg(long, value_enum)]
    interactions: Option<super::trim::Interactions>,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Plot the trim curves to an SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write table and figures as an HTML page
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

/// One of those compared, before anything is computed.
struct Entry {
    name: String,
    problem: Problem,
    interactions: bool,
    checked: Option<Checked>,
}

/// What is compared.
struct Subject {
    name: String,
    problem: Problem,
    interactions: bool,
    points: Vec<TrimPoint>,
    modes: Vec<Mode>,
    /// Blade pitch that a unit of each command of ν asks for in hover, rad per
    /// rad/s² and, in heave, per m/s²; none where hover does not trim.
    effort: Option<[f64; 4]>,
    checked: Option<Checked>,
}

impl Compare {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.output.check()?;
        self.format.of(&self.output)?;
        if let Some(plot) = &self.plot {
            self.output.check_plot(plot)?;
        }
        if let Some(html) = &self.html {
            self.output.check_path(html)?;
            if self.plot.as_ref().is_some_and(|plot| output::same_file(plot, html)) {
                return Err(usage(
                    format!("{}: two results cannot go to one file", html.display()),
                    "give --plot and --html different names",
                ));
            }
        }
        self.run.start()?;
        let conditions: Vec<FlightCondition> =
            parse_speeds(&self.speeds)?.into_iter().map(FlightCondition::level).collect();
        let entries = self.entries()?;
        let progress =
            Progress::new("trimming", (entries.len() * conditions.len()) as u64, self.run.quiet);
        let subjects: Vec<Subject> = entries
            .into_par_iter()
            .map(|entry| Subject::new(entry, &conditions, &progress))
            .collect::<Result<_, _>>()?;
        progress.finish();
        // Results of several aircraft are in the units that all of them state.
        let stated = |s: &Subject| self.units.of(Some(&s.problem));
        let system = match subjects.split_first() {
            Some((first, rest)) if rest.iter().all(|s| stated(s) == stated(first)) => stated(first),
            _ => self.units.of(None),
        };
        let table = table(&subjects, &conditions, system);
        let text = match self.format.of(&self.output)? {
            Format::Table => table.to_text(Coloring::for_stdout()),
            Format::Csv => table.to_csv(),
            Format::Json => json_text(&subjects)?,
        };
        if let Some(path) = &self.plot {
            let svg = trim(&subjects, system).to_svg();
            self.output.write_plot(path, &svg)?;
        }
        if let Some(path) = &self.html {
            let html = page(&subjects, table, system).to_html();
            output::write_whole(path, html.as_bytes(), self.output.force)?;
        }
        self.output.write(&text)?;
        let flown = subjects.iter().flat_map(|s| &s.points).all(TrimPoint::on_orbit);
        Ok(if flown { Outcome::Done } else { Outcome::GoalMissed })
    }

    /// What to compare, each with its positions of the interactions.
    fn entries(&self) -> Result<Vec<Entry>, CliError> {
        let mut entries = Vec::new();
        for path in &self.entries {
            let (problem, checked) = read(path, self.run.quiet)?;
            let own = problem.inflow.interactions;
            let positions = self.interactions.map_or(vec![own], |i| i.positions().to_vec());
            let name = path
                .file_stem()
                .map_or_else(|| path.display().to_string(), |s| s.to_string_lossy().into_owned());
            let mut checked = checked;
            for &on in &positions {
                let name = if self.interactions.is_some() {
                    format!("{name}, interactions {}", on_off(on))
                } else {
                    name.clone()
                };
                entries.push(Entry {
                    name,
                    problem: problem.clone(),
                    interactions: on,
                    // A verification is of the problem as it is.
                    checked: if on == own { checked.take() } else { None },
                });
            }
        }
        tell_apart(&mut entries);
        Ok(entries)
    }
}

/// Numbers those that have the same name.
fn tell_apart(entries: &mut [Entry]) {
    let names: Vec<String> = entries.iter().map(|e| e.name.clone()).collect();
    for (k, entry) in entries.iter_mut().enumerate() {
        if names.iter().filter(|n| **n == names[k]).count() > 1 {
            let place = names[..=k].iter().filter(|n| **n == names[k]).count();
            entry.name = format!("{} ({place})", names[k]);
        }
    }
}

/// A problem, and the verification of its design where it is one.
fn read(path: &Path, quiet: bool) -> Result<(Problem, Option<Checked>), CliError> {
    let schedule = path.file_name().is_some_and(|name| name == "schedule.json");
    let builtin = builtin_name(path);
    if let Some(name) = builtin.filter(|_| path.is_dir() && !quiet) {
        output::note(&format!(
            "note: '{name}' is taken as the built-in problem; ./{name} is the directory\n"
        ));
    }
    if (path.is_dir() && builtin.is_none()) || schedule {
        let inputs = Inputs::find(path, &SourceArgs::default(), quiet)?;
        return Ok((inputs.loaded.problem, inputs.checked));
    }
    let loaded = ProblemArgs { file: Some(path.to_path_buf()) }.load_with_warnings(quiet)?;
    Ok((loaded.problem, None))
}

impl Subject {
    fn new(
        entry: Entry,
        conditions: &[FlightCondition],
        progress: &Progress,
    ) -> Result<Self, CliError> {
        let mut problem = entry.problem;
        problem.inflow.interactions = entry.interactions;
        let vehicle = Vehicle::new(&problem)?;
        let points =
            sweep(&vehicle, conditions, &Options::default(), |_| progress.advance()).points;
        let hover = points.iter().find(|p| p.condition.horizontal_speed() == 0.0 && p.on_orbit());
        let (mut found, mut effort) = (Vec::new(), None);
        if let Some(Ok(trim)) = hover.map(|p| p.clone().into_converged()) {
            let full = averaged(&vehicle, &trim, &LinearOptions::default())?;
            found = modes(&residualise(&full, &RIGID_BODY)?.model)?;
            let plant = from_state_space(&full, 0.0, equilibrium(trim.point()))?;
            let inversion = Inversion::new(&plant).map_err(|error| {
                usage(
                    format!("{}: {error}", entry.name),
                    "look at the models with `coaxdesign linearize`",
                )
            })?;
            effort = Some(blade_pitch(&inversion, &blade_controls(&problem)));
        }
        Ok(Self {
            name: entry.name,
            problem,
            interactions: entry.interactions,
            points,
            modes: found,
            effort,
            checked: entry.checked,
        })
    }

    fn rows(&self, axis: &str) -> impl Iterator<Item = &Row> {
        let rows = self.checked.as_ref().map_or(&[][..], |c| &c.verification.rows);
        rows.iter().filter(move |r| r.axis == axis)
    }

    /// Least design margin of an axis, %, of the nominal model or of all.
    fn margin(&self, axis: &str, nominal: bool) -> Option<f64> {
        self.rows(axis)
            .filter(|r| !nominal || r.class == ModelClass::Nominal)
            .filter_map(|r| r.design_margin_percent)
            .min_by(f64::total_cmp)
    }

    /// Largest actuator activity of an axis, % per unit noise, nominal model.
    fn activity(&self, axis: &str) -> Option<f64> {
        self.rows(axis)
            .filter(|r| r.class == ModelClass::Nominal)
            .map(|r| r.activity)
            .max_by(f64::total_cmp)
    }
}

/// The trim as the control law knows it.
fn equilibrium(point: &TrimPoint) -> Equilibrium {
    let velocity = coaxdesign::vehicle::Layout::BODY.velocity;
    let [roll, pitch] = attitude(point);
    Equilibrium {
        velocity_body: std::array::from_fn(|k| point.mean_state[velocity + k]),
        roll,
        pitch,
        sticks: point.sticks,
    }
}

/// Largest blade pitch of any rotor for a unit of each command of ν, rad.
fn blade_pitch(inversion: &Inversion, blades: &[BladeControl]) -> [f64; 4] {
    std::array::from_fn(|command| {
        blades
            .iter()
            .filter(|blade| blade.pitch)
            .map(|blade| {
                let sticks = inversion.decoupling.column(command);
                blade.gain.iter().zip(sticks.iter()).map(|(g, s)| g * s).sum::<f64>().abs()
            })
            .fold(0.0, f64::max)
    })
}

/// At most `most` of the places, evenly spread.
fn spread(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most).map(|i| i * (count - 1) / (most - 1)).collect()
}

fn table(subjects: &[Subject], conditions: &[FlightCondition], system: System) -> Table {
    let mut columns = vec![Column::text("quantity"), Column::text("unit")];
    columns.extend(subjects.iter().map(|s| Column::text(&s.name)));
    let mut table = Table::new("Side by side", columns);
    let mut row = |quantity: &str, unit: &str, values: Vec<String>| {
        if values.iter().any(|v| !v.is_empty()) {
            table.row(
                [Cell::from(quantity), Cell::from(unit)]
                    .into_iter()
                    .chain(values.into_iter().map(Cell::from)),
            );
        }
    };
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(String::new, |v| output::significant(v, digits))
    };
    let each = |pick: &dyn Fn(&Subject) -> String| subjects.iter().map(pick).collect::<Vec<_>>();
    row("interactions", "", each(&|s| on_off(s.interactions).into()));
    for k in spread(conditions.len(), SPEEDS_SHOWN) {
        let speed = conditions[k].airspeed;
        let at = format!(
            "at {} {}",
            decimals(Kind::Airspeed.from_si(speed, system), 0),
            Kind::Airspeed.symbol(system)
        );
        let point = |pick: &dyn Fn(&TrimPoint) -> f64, digits: usize| {
            each(&|s| {
                let p = &s.points[k];
                if p.on_orbit() { number(Some(pick(p)), digits) } else { "no trim".into() }
            })
        };
        row(
            &format!("power {at}"),
            Kind::Power.symbol(system),
            point(&|p| Kind::Power.from_si(p.power.shaft, system), 4),
        );
        row(&format!("pitch attitude {at}"), "deg", point(&|p| attitude(p)[1].to_degrees(), 3));
        row(&format!("collective stick {at}"), "%", point(&|p| p.sticks[2], 3));
        row(&format!("least control margin {at}"), "%", {
            each(&|s| {
                let p = &s.points[k];
                match least_margin(p).filter(|_| p.on_orbit()) {
                    Some((control, fraction)) => {
                        format!("{} ({control})", decimals(100.0 * fraction, 0))
                    }
                    None => String::new(),
                }
            })
        });
        if subjects.iter().all(|s| s.problem.rotors.len() > 1) {
            row(&format!("thrust of the first rotor {at}"), "%", {
                point(
                    &|p| {
                        100.0 * p.rotors[0].thrust / p.rotors.iter().map(|r| r.thrust).sum::<f64>()
                    },
                    3,
                )
            });
        }
    }
    let most = subjects.iter().map(|s| s.modes.len()).max().unwrap_or(0);
    for k in 0..most {
        row(
            &format!("mode {} in hover", k + 1),
            "rad/s",
            each(&|s| fastest_growth_first(&s.modes).get(k).map_or_else(String::new, |m| mode(m))),
        );
    }
    for (k, command) in COMMANDS.iter().enumerate() {
        let (unit, factor) = if k < 3 {
            ("deg per rad/s^2".to_string(), 1.0)
        } else {
            let symbol = Kind::Acceleration.symbol(system);
            (format!("deg per {symbol}"), 1.0 / Kind::Acceleration.from_si(1.0, system))
        };
        row(&format!("blade pitch for {command} in hover"), &unit, {
            each(&|s| number(s.effort.map(|e| e[k].to_degrees() * factor), 3))
        });
    }
    for channel in Channel::ALL {
        let axis = channel.name();
        let percent = |v: Option<f64>| v.map_or_else(String::new, |v| decimals(v, 0));
        row(&format!("least margin, {axis}, nominal"), "%", {
            each(&|s| percent(s.margin(axis, true)))
        });
        row(&format!("least margin, {axis}, all models"), "%", {
            each(&|s| percent(s.margin(axis, false)))
        });
        row(&format!("largest activity, {axis}"), "%", each(&|s| number(s.activity(axis), 3)));
    }
    table
}

/// The modes, the one that grows fastest first.
fn fastest_growth_first(modes: &[Mode]) -> Vec<&Mode> {
    let mut sorted: Vec<&Mode> = modes.iter().collect();
    sorted.sort_by(|a, b| b.eigenvalue.re.total_cmp(&a.eigenvalue.re));
    sorted
}

fn mode(mode: &Mode) -> String {
    let value = mode.eigenvalue;
    if mode.oscillates() {
        format!("{:.3} ± {:.3}j", value.re, value.im)
    } else {
        format!("{:.3}", value.re)
    }
}

fn json_text(subjects: &[Subject]) -> Result<String, CliError> {
    let entries: Vec<Json> = subjects
        .iter()
        .map(|s| {
            let points: Vec<Json> = s
                .points
                .iter()
                .map(|p| {
                    let [roll, pitch] = attitude(p);
                    let margin = least_margin(p);
                    json!({
                        "speed_m_s": p.condition.horizontal_speed(),
                        "status": p.status.word(),
                        "power_w": p.power.shaft,
                        "roll_rad": roll,
                        "pitch_rad": pitch,
                        "sticks_percent": p.sticks,
                        "thrust_n": p.rotors.iter().map(|r| r.thrust).collect::<Vec<_>>(),
                        "least_margin_percent": margin.map(|m| 100.0 * m.1),
                        "least_margin_of": margin.map(|m| m.0),
                    })
                })
                .collect();
            let modes: Vec<Json> = fastest_growth_first(&s.modes)
                .iter()
                .map(|m| json!({"real_rad_s": m.eigenvalue.re, "imaginary_rad_s": m.eigenvalue.im}))
                .collect();
            let mut margins = Map::new();
            for channel in Channel::ALL {
                let axis = channel.name();
                if let Some(nominal) = s.margin(axis, true) {
                    margins.insert(
                        axis.into(),
                        json!({
                            "nominal_percent": nominal,
                            "all_models_percent": s.margin(axis, false),
                            "activity_percent": s.activity(axis),
                        }),
                    );
                }
            }
            json!({
                "name": s.name,
                "problem": s.problem.name,
                "interactions": s.interactions,
                "trim": points,
                "modes_in_hover": modes,
                "blade_pitch_rad_per_unit_of_nu": s.effort,
                "design_margins": margins,
            })
        })
        .collect();
    let all = json!({ "schema": "coaxdesign.compare/1", "entries": entries });
    serde_json::to_string_pretty(&all)
        .map(|text| text + "\n")
        .map_err(|error| CliError::Internal(error.to_string()))
}

fn trim(subjects: &[Subject], system: System) -> Figure {
    let data: Vec<_> = subjects
        .iter()
        .enumerate()
        .map(|(style, s)| curves(&s.name, style, &s.problem, &s.points, system))
        .collect();
    trim_figure("Trim side by side", Kind::Airspeed.symbol(system), &data)
}

fn page(subjects: &[Subject], table: Table, system: System) -> Page {
    let names: Vec<&str> = subjects.iter().map(|s| s.name.as_str()).collect();
    let sets: Vec<EigenvalueSet> = subjects
        .iter()
        .enumerate()
        .filter(|(_, s)| !s.modes.is_empty())
        .map(|(style, s)| EigenvalueSet {
            labels: Vec::new(),
            name: s.name.clone(),
            style,
            values: s
                .modes
                .iter()
                .flat_map(|m| {
                    let value: Complex64 = m.eigenvalue;
                    std::iter::once(value).chain(m.oscillates().then(|| value.conj()))
                })
                .collect(),
        })
        .collect();
    let mut page = Page::new(&names.join(" / "))
        .summary("Trim, modes in hover, design margins and effort, side by side.")
        .section(Section::new("Side by side").table(table))
        .section(
            Section::new("Trim")
                .figure(trim(subjects, system), "Trimmed level flight over true airspeed."),
        );
    if !sets.is_empty() {
        page = page.section(Section::new("Modes in hover").figure(
            plane("Eigenvalues of the residualised hover models", &sets),
            "Eigenvalues of the averaged models, residualised to the rigid body. Right of the \
             imaginary axis, motion grows.",
        ));
    }
    page
}
