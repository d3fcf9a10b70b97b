//! Flights under a schedule, as `coaxdesign simulate -o FILE.json` leaves them
//! in the `simulation` directory of a design.

use std::path::Path;

use serde::Deserialize;

use super::sections::printed;
use crate::cli::CliError;
use crate::cli::tune::usage;
use coaxdesign::problem::Problem;
use coaxdesign::report::figures::{Curve, CurvePanel, Marks, time_history_figure};
use coaxdesign::report::html::Section;
use coaxdesign::report::plot::{Figure, Legend};
use coaxdesign::report::table::{Cell, Column, Digits, Highlight, Table};
use coaxdesign::schedule::Schedule;
use coaxdesign::units::{Kind, System};

/// Directory of the flights in a design.
pub(in crate::cli) const DIRECTORY: &str = "simulation";
/// Schema of a flight.
const SCHEMA: &str = "coaxdesign.simulation/1";
/// Most points of a curve.
const PLOTTED: usize = 600;

/// Styles of what was flown, what the law followed, and what was asked for.
const FLOWN: usize = 0;
const REFERENCE: usize = 2;
const COMMAND: usize = 7;

/// A flight.
pub(in crate::cli) struct Flown {
    file: String,
    record: Record,
    /// Whether it was flown under this very design.
    own: bool,
}

#[derive(Deserialize)]
struct Record {
    schema: String,
    maneuver: String,
    schedule: Option<Origin>,
    metrics: Metrics,
    history: Option<History>,
}

#[derive(Deserialize)]
struct Origin {
    problem_hash: String,
    specification_hash: String,
}

#[derive(Deserialize)]
struct Metrics {
    end: End,
    #[serde(default)]
    tracking: Vec<Tracking>,
    #[serde(default)]
    saturated_s: f64,
}

#[derive(Deserialize)]
struct End {
    status: String,
    state: Option<String>,
    time_s: f64,
}

#[derive(Deserialize)]
struct Tracking {
    channel: String,
    commanded: bool,
    rms: f64,
    peak: f64,
    peak_time_s: f64,
}

#[derive(Deserialize)]
struct History {
    columns: Vec<Quantity>,
    rows: Vec<Vec<Option<f64>>>,
}

#[derive(Deserialize)]
struct Quantity {
    name: String,
    unit: String,
}

/// Reads the flights of a design, in the order of their names.
///
/// # Errors
/// A file that cannot be read, or is no flight.
pub(super) fn read(directory: &Path, schedule: &Schedule) -> Result<Vec<Flown>, CliError> {
    let folder = directory.join(DIRECTORY);
    let listing = match std::fs::read_dir(&folder) {
        Ok(listing) => listing,
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(source) => return Err(CliError::Io { path: folder, source }),
    };
    let mut paths = Vec::new();
    for entry in listing {
        let path = entry.map_err(|source| CliError::Io { path: folder.clone(), source })?.path();
        if path.extension().is_some_and(|e| e == "json") {
            paths.push(path);
        }
    }
    paths.sort();
    paths
        .into_iter()
        .map(|path| {
            let text = std::fs::read_to_string(&path)
                .map_err(|source| CliError::Io { path: path.clone(), source })?;
            let wrong = |what: String| {
                usage(
                    format!("{}: {what}", path.display()),
                    "write it anew with `coaxdesign simulate DESIGN -m MANEUVER -o FILE.json`",
                )
            };
            let record: Record = serde_json::from_str(&text)
                .map_err(|error| wrong(format!("not a flight: {error}")))?;
            if record.schema != SCHEMA {
                return Err(wrong(format!(
                    "the schema is '{}', expected '{SCHEMA}'",
                    record.schema
                )));
            }
            let provenance = &schedule.provenance;
            let own = record.schedule.as_ref().is_some_and(|s| {
                s.problem_hash == provenance.problem_hash
                    && s.specification_hash == provenance.specification_hash
            });
            let file = path.file_name().map(|n| n.to_string_lossy().into_owned());
            Ok(Flown { file: file.unwrap_or_default(), record, own })
        })
        .collect()
}

/// Begin of the file of the manoeuvre that the paper on the CoAX 2D shows.
const PUBLISHED: &str = "accel-climb-turn";

/// A section of time histories and errors.
pub(super) fn section(problem: &Problem, flights: &[Flown], system: System) -> Section {
    let mut section = Section::new("Manoeuvres").paragraph(
        "Flown with the full nonlinear vehicle under the schedule, sensors and actuators \
         included.",
    );
    for flight in flights {
        let record = &flight.record;
        let end = &record.metrics.end;
        let completed = end.status == "completed";
        let (highlight, headline) = if completed && flight.own {
            (Highlight::Good, format!("{}: flown to its end.", record.maneuver))
        } else if completed {
            (Highlight::Warning, format!("{}: flown under another schedule.", record.maneuver))
        } else {
            (Highlight::Bad, format!("{}: not flown to its end.", record.maneuver))
        };
        let mut text = format!("It ended after {:.1} s ({}).", end.time_s, end.status);
        if let Some(state) = &end.state {
            text += &format!(" {state} left its bounds.");
        }
        if record.metrics.saturated_s > 0.0 {
            text +=
                &format!(" Some actuator was at a limit for {:.2} s.", record.metrics.saturated_s);
        }
        section = section.heading(&record.maneuver).verdict(highlight, &headline, &text);
        if let Some(history) = &record.history {
            section = section.figure(
                figure(&record.maneuver, history, system),
                &format!(
                    "{} ({}): what was flown, the reference that the law followed, and the \
                     command.{}",
                    record.maneuver,
                    flight.file,
                    if flight.file.starts_with(PUBLISHED) {
                        printed(problem, "Fig. 17")
                    } else {
                        String::new()
                    }
                ),
            );
        }
        if !record.metrics.tracking.is_empty() {
            section = section.table(errors(&record.metrics.tracking, system));
        }
    }
    section
}

fn kind_of(name: &str, unit: &str) -> Kind {
    match unit {
        "m/s" if name.starts_with("climb_rate") => Kind::ClimbRate,
        "m/s" => Kind::Airspeed,
        "rad" => Kind::Angle,
        "rad/s" => Kind::AngularRate,
        "m" => Kind::Length,
        "%" => Kind::Percent,
        "W" => Kind::Power,
        "s" => Kind::Time,
        _ => Kind::Dimensionless,
    }
}

fn figure(title: &str, history: &History, system: System) -> Figure {
    let stride = history.rows.len().div_ceil(PLOTTED).max(1);
    let values = |name: &str| -> Option<(Kind, Vec<f64>)> {
        let k = history.columns.iter().position(|c| c.name == name)?;
        let kind = kind_of(name, &history.columns[k].unit);
        let list = history
            .rows
            .iter()
            .step_by(stride)
            .map(|row| row.get(k).copied().flatten().map_or(f64::NAN, |v| kind.from_si(v, system)))
            .collect();
        Some((kind, list))
    };
    let time = values("time").map_or_else(Vec::new, |t| t.1);
    let panel = |quantity: &str, span: f64, list: &[(&str, usize, &str)]| -> Option<CurvePanel> {
        let mut unit = "";
        let curves: Vec<Curve> = list
            .iter()
            .filter_map(|(name, style, column)| {
                let (kind, y) = values(column)?;
                unit = kind.symbol(system);
                Some(Curve {
                    name: (*name).into(),
                    style: *style,
                    x: time.clone(),
                    y,
                    marks: Marks::Without,
                })
            })
            .collect();
        (!curves.is_empty()).then(|| CurvePanel {
            title: String::new(),
            quantity: quantity.into(),
            unit: unit.into(),
            minimum_span: span,
            curves,
        })
    };
    let tracked = |quantity: &str, span: f64, flown: &str, reference: &str, command: &str| {
        panel(
            quantity,
            span,
            &[
                ("command", COMMAND, command),
                ("reference", REFERENCE, reference),
                ("flown", FLOWN, flown),
            ],
        )
    };
    let panels: Vec<CurvePanel> = [
        tracked(
            "forward velocity",
            2.0,
            "forward_velocity",
            "forward_velocity_reference",
            "forward_velocity_command",
        ),
        tracked(
            "sideward velocity",
            2.0,
            "right_velocity",
            "right_velocity_reference",
            "right_velocity_command",
        ),
        tracked("rate of climb", 60.0, "climb_rate", "climb_rate_reference", "climb_rate_command"),
        tracked("heading rate", 1.0, "heading_rate", "yaw_rate_reference", "turn_rate_command"),
        tracked("bank", 1.0, "phi", "phi_reference", ""),
        tracked("pitch attitude", 1.0, "theta", "theta_reference", ""),
        tracked("heading", 1.0, "heading", "", ""),
        tracked("height", 5.0, "height", "", ""),
        panel(
            "sticks",
            5.0,
            &[
                ("lat", 3, "lat_stick"),
                ("lon", 4, "lon_stick"),
                ("col", 5, "col_stick"),
                ("ped", 6, "ped_stick"),
            ],
        ),
    ]
    .into_iter()
    .flatten()
    .collect();
    time_history_figure(title, 2, &panels).legend(Legend::Above)
}

fn errors(tracking: &[Tracking], system: System) -> Table {
    let digits = Digits::Significant(3);
    let mut table = Table::new(
        "Errors against the references of the law",
        vec![
            Column::text("channel"),
            Column::text("unit"),
            Column::number("RMS", "", digits),
            Column::number("peak", "", digits),
            Column::number("at", "s", Digits::Decimals(1)),
            Column::text("in this manoeuvre"),
        ],
    );
    for t in tracking {
        let kind = match t.channel.as_str() {
            "climb_rate" => Kind::ClimbRate,
            "phi" | "theta" => Kind::Angle,
            "yaw_rate" => Kind::AngularRate,
            _ => Kind::Airspeed,
        };
        table.row([
            Cell::from(t.channel.replace('_', " ")),
            kind.symbol(system).into(),
            kind.from_si(t.rms, system).into(),
            kind.from_si(t.peak, system).into(),
            t.peak_time_s.into(),
            if t.commanded { "commanded" } else { "held" }.into(),
        ]);
    }
    table
}
