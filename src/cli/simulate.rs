//! `coaxdesign simulate`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value as Json, json};

use super::args::{Format, FormatArgs, OutputArgs, RunArgs, UnitsArgs};
use super::fly::{FlyArgs, Ready};
use super::output::{self, WholeFile};
#[cfg(feature = "parquet")]
use super::parquet::Columns;
use super::watch::Watch;
use super::{CliError, Outcome};
use coaxdesign::pipeline::{FlightPlan, Flown};
use coaxdesign::report::figures::{Curve, CurvePanel, Marks, time_history_figure};
use coaxdesign::report::table::{Cell, Coloring, Column as TableColumn, Digits, Highlight, Table};
use coaxdesign::simulate::metrics::{COORDINATED, SCHEMA};
use coaxdesign::simulate::record::Column;
use coaxdesign::simulate::{Metrics, Status};
use coaxdesign::units::{Kind, System};

/// Fly a manoeuvre with the full nonlinear vehicle or with stitched linear models (--models), under
/// a schedule or in open loop
///
/// Writes metrics to standard output, and the time history to the file of -o: CSV or Parquet
/// (streamed, so that memory does not grow with the flight), or JSON (metrics and history).
#[derive(Debug, Args)]
pub struct Simulate {
    #[command(flatten)]
    fly: FlyArgs,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Time between two rows of the history, such as "0.1 s" [default: one control period]
    #[arg(long, value_name = "TIME")]
    interval: Option<String>,
    /// Plot the flight to an SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

/// Forms of the history's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum History {
    Csv,
    Json,
    #[cfg(feature = "parquet")]
    Parquet,
}

fn history_form(path: &Path) -> Result<History, CliError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match extension.as_str() {
        "csv" => Ok(History::Csv),
        "json" => Ok(History::Json),
        #[cfg(feature = "parquet")]
        "parquet" => Ok(History::Parquet),
        #[cfg(not(feature = "parquet"))]
        "parquet" => Err(CliError::Usage {
            message: format!("{}: this program was built without Parquet", path.display()),
            help: "build it with `cargo install --path . --features parquet`, or write .csv".into(),
        }),
        _ => Err(CliError::Usage {
            message: format!("{}: the ending says no form", path.display()),
            help: "end the name in .csv, .json or .parquet".into(),
        }),
    }
}

/// A history that is written as it comes.
enum Stream {
    Csv(WholeFile),
    #[cfg(feature = "parquet")]
    Parquet(Box<Columns>),
}

impl Stream {
    fn create(
        form: History,
        path: &Path,
        force: bool,
        columns: &[Column],
        system: System,
    ) -> Result<Option<Self>, CliError> {
        Ok(match form {
            History::Json => None,
            History::Csv => {
                let mut file = WholeFile::create(path, force)?;
                file.write(csv_head(columns, system).as_bytes())?;
                Some(Self::Csv(file))
            }
            #[cfg(feature = "parquet")]
            History::Parquet => {
                let names: Vec<String> = columns.iter().map(|c| heading(c, system)).collect();
                Some(Self::Parquet(Box::new(Columns::create(path, force, &names)?)))
            }
        })
    }

    fn row(&mut self, columns: &[Column], row: &[f64], system: System) -> Result<(), CliError> {
        match self {
            Self::Csv(file) => {
                let mut line = String::new();
                csv_line(&mut line, columns, row, system);
                file.write(line.as_bytes())
            }
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => {
                file.row(columns.iter().zip(row).map(|(c, value)| c.kind.from_si(*value, system)))
            }
        }
    }

    fn finish(self) -> Result<(), CliError> {
        match self {
            Self::Csv(file) => file.finish(),
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => file.finish(),
        }
    }
}

/// Rows kept for plots and JSON.
struct Kept {
    columns: Vec<Column>,
    rows: Vec<Vec<f64>>,
}

impl Simulate {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        self.output.check()?;
        if let Some(plot) = &self.plot {
            self.output.check_plot(plot)?;
        }
        let form = self.output.file().map(history_form).transpose()?;
        let ready = self.fly.ready(self.run.quiet)?;
        let system = ready.system(self.units);
        let every = self.every()?;
        let keep = self.plot.is_some() || form == Some(History::Json);
        let mut kept = Vec::new();
        let mut stream = None;
        let watch = Watch::new(self.run.quiet);
        let plan = FlightPlan {
            maneuver: ready.as_read.clone(),
            variation: ready.variation,
            options: ready.options.clone(),
            every,
        };
        let flown = ready.fly(&plan, &watch, |columns, row| {
            if row.is_empty() {
                if let (Some(form), Some(path)) = (form, self.output.file()) {
                    stream = Stream::create(form, path, self.output.force, columns, system)?;
                }
                return Ok(());
            }
            if keep {
                kept.push(row.to_vec());
            }
            stream.as_mut().map_or(Ok(()), |stream| stream.row(columns, row, system))
        })?;
        if let Some(stream) = stream {
            stream.finish()?;
        }
        let kept = Kept { columns: flown.columns.clone(), rows: kept };
        let (status, metrics) = (&flown.status, &flown.metrics);
        let summary = summary(&ready, &flown)?;
        if let (Some(History::Json), Some(path)) = (form, self.output.file()) {
            let mut whole = summary.clone();
            whole["history"] = history(&kept);
            let text = pretty(&whole)?;
            output::write_whole(path, text.as_bytes(), self.output.force)?;
        }
        if let Some(path) = &self.plot {
            let rows = flown.revolution * self.fly.control_rate / every as f64;
            let svg = figure(&ready, status, &kept, rows.round() as usize, system);
            self.output.write_plot(path, &svg)?;
        }
        match self.format.shown() {
            Format::Json => output::print(&pretty(&summary)?)?,
            Format::Csv => output::print(&tracking_table(metrics, system).to_csv())?,
            Format::Table => {
                output::print(&report(&ready, metrics, system, Coloring::for_stdout()))?;
            }
        }
        Ok(if *status == Status::Completed { Outcome::Done } else { Outcome::GoalMissed })
    }

    /// Control periods between two rows.
    fn every(&self) -> Result<u64, CliError> {
        let Some(text) = &self.interval else {
            return Ok(1);
        };
        let usage = |message: String| CliError::Usage {
            message: format!("--interval {text:?}: {message}"),
            help: "write a time such as --interval \"0.1 s\"".into(),
        };
        let interval = coaxdesign::units::parse_quantity(text, Kind::Time)
            .map_err(|error| usage(error.to_string()))?;
        if interval <= 0.0 {
            return Err(usage("it must be positive".into()));
        }
        Ok((interval * self.fly.control_rate).round().max(1.0) as u64)
    }
}

/// The file of a flight, metrics and history, and how it ended: what `design`
/// keeps of its manoeuvre.
pub(super) fn recorded(
    ready: &Ready,
    every: u64,
    watch: &Watch,
) -> Result<(String, Outcome), CliError> {
    let plan = FlightPlan {
        maneuver: ready.as_read.clone(),
        variation: ready.variation,
        options: ready.options.clone(),
        every,
    };
    let mut rows = Vec::new();
    let flown = ready.fly(&plan, watch, |_, row| {
        if !row.is_empty() {
            rows.push(row.to_vec());
        }
        Ok(())
    })?;
    let mut whole = summary(ready, &flown)?;
    whole["history"] = history(&Kept { columns: flown.columns.clone(), rows });
    let completed = flown.status == Status::Completed;
    Ok((pretty(&whole)?, if completed { Outcome::Done } else { Outcome::GoalMissed }))
}

fn pretty(value: &Json) -> Result<String, CliError> {
    let text =
        serde_json::to_string_pretty(value).map_err(|e| CliError::Internal(e.to_string()))?;
    Ok(text + "\n")
}

/// Header of a column: its name and its unit.
fn heading(column: &Column, system: System) -> String {
    let unit = column.kind.identifier(system);
    let name = column.name.replace('.', "_");
    if unit == "1" { name } else { format!("{name}_{unit}") }
}

fn csv_head(columns: &[Column], system: System) -> String {
    let names: Vec<String> = columns.iter().map(|column| heading(column, system)).collect();
    names.join(",") + "\n"
}

/// One line; nine significant digits are more than any step deserves.
fn csv_line(line: &mut String, columns: &[Column], row: &[f64], system: System) {
    use std::fmt::Write as _;
    line.clear();
    for (k, (column, value)) in columns.iter().zip(row).enumerate() {
        if k > 0 {
            line.push(',');
        }
        let shown = column.kind.from_si(*value, system);
        // Writing to a text cannot fail.
        let _ = if shown == 0.0 { write!(line, "0") } else { write!(line, "{shown:.8e}") };
    }
    line.push('\n');
}

/// The metrics with what they belong to.
fn summary(ready: &Ready, flown: &Flown) -> Result<Json, CliError> {
    let variation = &ready.variation;
    let options = &ready.options;
    Ok(json!({
        "schema": SCHEMA,
        "maneuver": ready.maneuver.title,
        "aircraft": ready.craft.name(),
        "design": ready.opened.as_ref().map(|o| &o.name),
        "problem": ready.opened.as_ref().map(|o| &o.problem_name),
        "specification": ready.opened.as_ref().map(|o| &o.requirements.name),
        "schedule": ready.schedule.as_ref().map(|s| json!({
            "name": s.name,
            "requirements_met": s.requirements_met,
            "problem_hash": s.provenance.problem_hash,
            "specification_hash": s.provenance.specification_hash,
        })),
        "model": {
            "interactions": flown.interactions,
            "mass_factor": variation.mass,
            "inertia_factor": variation.inertia,
            "center_of_gravity_shift_m": variation.center_of_gravity,
            "extra_delay_s": variation.delay,
            "interference_gain": variation.inflow,
            "gust_m_s": variation.gust,
            "governor_s": variation.governor,
        },
        "simulation": {
            "duration_s": ready.maneuver.duration,
            "control_rate_hz": options.control_rate,
            "integration_step_s": flown.integration_step,
            "delay_s": flown.delay,
            "seed": options.seed,
        },
        "metrics": serde_json::to_value(&flown.metrics)
            .map_err(|error| CliError::Internal(error.to_string()))?,
    }))
}

fn history(kept: &Kept) -> Json {
    let columns: Vec<Json> =
        kept.columns.iter().map(|c| json!({ "name": c.name, "unit": si_unit(c.kind) })).collect();
    json!({ "columns": columns, "rows": kept.rows })
}

/// Rows of the JSON history are SI and radians throughout.
fn si_unit(kind: Kind) -> &'static str {
    match kind {
        Kind::Angle => "rad",
        Kind::AngularRate => "rad/s",
        Kind::Power => "W",
        other => other.symbol(System::Si),
    }
}

/// Kinds in which tracking errors are shown.
fn shown_kind(channel: &str) -> Kind {
    match channel {
        "climb_rate" => Kind::ClimbRate,
        "phi" | "theta" => Kind::Angle,
        "yaw_rate" => Kind::AngularRate,
        _ => Kind::Airspeed,
    }
}

fn tracking_table(metrics: &Metrics, system: System) -> Table {
    let digits = Digits::Significant(3);
    let columns = vec![
        TableColumn::text("channel"),
        TableColumn::text("unit"),
        TableColumn::number("RMS", "", digits),
        TableColumn::number("peak", "", digits),
        TableColumn::number("at", "s", Digits::Decimals(1)),
        TableColumn::text(""),
    ];
    let mut table = Table::new("Errors against the law's references", columns);
    for t in &metrics.tracking {
        let kind = shown_kind(&t.channel);
        table.row([
            Cell::from(t.channel.as_str()),
            kind.symbol(system).into(),
            kind.from_si(t.size.rms, system).into(),
            kind.from_si(t.size.peak, system).into(),
            t.size.peak_time_s.into(),
            Cell::from(if t.commanded { "commanded" } else { "held" }),
        ]);
    }
    table
}

fn actuator_table(metrics: &Metrics) -> Table {
    let one = Digits::Decimals(1);
    let columns = vec![
        TableColumn::text("blade control"),
        TableColumn::number("least", "deg", Digits::Decimals(2)),
        TableColumn::number("greatest", "deg", Digits::Decimals(2)),
        TableColumn::number("travel used", "%", one),
        TableColumn::number("rate", "deg/s", one),
        TableColumn::number("at a limit", "s", Digits::Decimals(2)),
    ];
    let mut table = Table::new("Actuators", columns);
    for a in &metrics.actuators {
        let highlight = if a.saturated_s > 0.0 { Highlight::Warning } else { Highlight::Plain };
        table.row([
            Cell::from(a.control.as_str()),
            a.minimum_rad.to_degrees().into(),
            a.maximum_rad.to_degrees().into(),
            a.travel_used_percent.into(),
            a.rate_rad_s.to_degrees().into(),
            Cell::from(a.saturated_s).highlight(highlight),
        ]);
    }
    table
}

/// Actuators of the sticks, of a stitched model.
fn stick_table(metrics: &Metrics) -> Table {
    let one = Digits::Decimals(1);
    let columns = vec![
        TableColumn::text("stick"),
        TableColumn::number("least", "%", one),
        TableColumn::number("greatest", "%", one),
        TableColumn::number("travel used", "%", one),
        TableColumn::number("rate", "%/s", one),
        TableColumn::number("at a limit", "s", Digits::Decimals(2)),
    ];
    let mut table = Table::new("Actuators of the sticks", columns);
    for a in &metrics.stick_actuators {
        let highlight = if a.saturated_s > 0.0 { Highlight::Warning } else { Highlight::Plain };
        table.row([
            Cell::from(a.stick),
            a.minimum_percent.into(),
            a.maximum_percent.into(),
            a.travel_used_percent.into(),
            a.rate_percent_s.into(),
            Cell::from(a.saturated_s).highlight(highlight),
        ]);
    }
    table
}

fn report(ready: &Ready, metrics: &Metrics, system: System, coloring: Coloring) -> String {
    let end = &metrics.end;
    let mut text = format!("{}\n{}: ", ready.head(), ready.maneuver.title);
    text += &match (&end.state, end.value, end.bound) {
        (Some(state), Some(value), Some(bound)) => format!(
            "{} at {:.2} s: {state} passed {bound:.4} (SI; it was {value:.4})\n",
            end.status, end.time_s
        ),
        (Some(state), ..) => {
            format!("{} at {:.2} s: {state} was no longer a number\n", end.status, end.time_s)
        }
        _ => format!("{} after {:.1} s\n", end.status, end.time_s),
    };
    if !metrics.tracking.is_empty() {
        text += "\n";
        text += &tracking_table(metrics, system).to_text(coloring);
    }
    if !metrics.actuators.is_empty() {
        text += "\n";
        text += &actuator_table(metrics).to_text(coloring);
    }
    if !metrics.stick_actuators.is_empty() {
        text += "\n";
        text += &stick_table(metrics).to_text(coloring);
    }
    let lags: Vec<String> = metrics
        .command_lag
        .iter()
        .map(|t| {
            let shown = |value: f64| Kind::Airspeed.from_si(value, system);
            format!("{} {:.2} / {:.2}", t.channel, shown(t.size.rms), shown(t.size.peak))
        })
        .collect();
    if !lags.is_empty() {
        text += &format!(
            "\nAgainst first-order lags of the commands alone, RMS / peak, {}: {}\n",
            Kind::Airspeed.symbol(system),
            lags.join(", ")
        );
    }
    let kind = |kind: Kind, value: f64| {
        format!("{:.1} {}", kind.from_si(value, system), kind.symbol(system))
    };
    let power = metrics.power.map_or_else(String::new, |power| {
        let (mean, peak) = (kind(Kind::Power, power.mean_w), kind(Kind::Power, power.peak_w));
        format!(" power {mean} on the mean, {peak} at most;")
    });
    text += &format!(
        "\nBank up to {:.1} deg, pitch up to {:.1} deg;{power} {} over the ground from the start at \
         most.\n",
        metrics.roll_peak_rad.to_degrees(),
        metrics.pitch_peak_rad.to_degrees(),
        kind(Kind::Length, metrics.drift_m),
    );
    if let Some(beyond) = metrics.beyond_models.filter(|beyond| beyond.time_s > 0.0) {
        let [low, high] = beyond.range_m_s.map(|u| Kind::Airspeed.from_si(u, system));
        text += &format!(
            "{:.1} s beyond the models, which reach from {low:.1} to {high:.1} {}: derivatives stay \
             there, trims go on straight.\n",
            beyond.time_s,
            Kind::Airspeed.symbol(system),
        );
    }
    if let Some(error) = metrics.steady_turn_rate_error_rad_s {
        text += &format!("Heading rate in the steady turn: within {error:.4} rad/s.\n");
    }
    if let Some(bank) = metrics.coordinated_bank_error_rad {
        text += &format!(
            "Bank against a coordinated turn's above {:.0} {}: RMS {:.2} deg, peak {:.2} deg.\n",
            Kind::Airspeed.from_si(COORDINATED, system),
            Kind::Airspeed.symbol(system),
            bank.rms.to_degrees(),
            bank.peak.to_degrees()
        );
    }
    text += &format!(
        "Largest change of a stick in one control period: {:.2} %.\n",
        metrics.stick_jump_percent.iter().copied().fold(0.0, f64::max)
    );
    text
}

/// Most points of a plotted curve.
const PLOTTED: usize = 1500;

fn figure(
    ready: &Ready,
    status: &Status,
    kept: &Kept,
    revolution: usize,
    system: System,
) -> String {
    let stride = kept.rows.len().div_ceil(PLOTTED).max(1);
    let place = |name: &str| kept.columns.iter().position(|column| column.name == name);
    let values = |index: usize| -> Vec<f64> {
        let kind = kept.columns[index].kind;
        // A rotor's power swings with the azimuth: the mean over a revolution
        // is what an engine feels.
        let window = if kind == Kind::Power { revolution.max(1) } else { 1 };
        (0..kept.rows.len())
            .step_by(stride)
            .map(|k| {
                if k + 1 < window {
                    // Not a whole revolution yet: a gap.
                    return f64::NAN;
                }
                let rows = &kept.rows[k + 1 - window..=k];
                let sum: f64 = rows.iter().map(|row| row[index]).sum();
                kind.from_si(sum / rows.len() as f64, system)
            })
            .collect()
    };
    let time = values(0);
    // Names of curves, and the columns that they are.
    let panel = |quantity: &str, minimum_span: f64, list: &[(&str, &str)]| -> Option<CurvePanel> {
        let mut unit = "";
        let curves: Vec<Curve> = list
            .iter()
            .enumerate()
            .filter_map(|(style, (name, column))| {
                let index = place(column)?;
                unit = kept.columns[index].kind.symbol(system);
                Some(Curve {
                    name: (*name).into(),
                    style,
                    x: time.clone(),
                    y: values(index),
                    marks: Marks::Without,
                })
            })
            .collect();
        (!curves.is_empty()).then(|| CurvePanel {
            title: String::new(),
            quantity: quantity.into(),
            unit: unit.into(),
            minimum_span,
            curves,
        })
    };
    let against = |quantity: &str, span: f64, flown: &str, reference: &str, command: &str| {
        let mut list = vec![("flown", flown)];
        if place(reference).is_some() {
            list.push(("reference", reference));
            if !command.is_empty() {
                list.push(("command", command));
            }
        }
        panel(quantity, span, &list)
    };
    let mut panels: Vec<CurvePanel> = [
        against(
            "forward velocity",
            2.0,
            "forward_velocity",
            "forward_velocity_reference",
            "forward_velocity_command",
        ),
        against(
            "velocity to starboard",
            2.0,
            "right_velocity",
            "right_velocity_reference",
            "right_velocity_command",
        ),
        against("climb rate", 100.0, "climb_rate", "climb_rate_reference", "climb_rate_command"),
        against("yaw rate", 2.0, "r", "yaw_rate_reference", "turn_rate_command"),
        against("bank", 2.0, "phi", "phi_reference", ""),
        against("pitch", 2.0, "theta", "theta_reference", ""),
        panel("heading", 2.0, &[("flown", "heading")]),
        panel("height", 10.0, &[("flown", "height")]),
    ]
    .into_iter()
    .flatten()
    .collect();
    for stick in coaxdesign::problem::STICKS {
        panels.extend(panel(
            &format!("{stick} stick"),
            2.0,
            &[("flown", &format!("{stick}_stick"))],
        ));
    }
    for rotor in ready.craft.rotors() {
        let column = format!("{rotor}.power");
        panels.extend(panel(&format!("{rotor} power"), 5.0, &[("flown", &column)]));
    }
    if kept.rows.iter().any(|row| {
        ["wind_north", "wind_east", "wind_down"]
            .iter()
            .filter_map(|name| place(name))
            .any(|k| row[k] != 0.0)
    }) {
        for name in ["wind_north", "wind_east"] {
            panels.extend(panel(&name.replace('_', " "), 2.0, &[("flown", name)]));
        }
    }
    let mut figure = time_history_figure(&ready.maneuver.title, 2, &panels);
    if let Some(departure) = status.departure() {
        figure = figure.subtitle(&format!(
            "{}: {} left its bounds at {:.2} s",
            status.word(),
            departure.state,
            departure.time
        ));
    }
    figure.to_svg()
}
