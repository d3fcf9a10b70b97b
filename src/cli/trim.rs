//! `coaxdesign trim`.

use clap::{Args, ValueEnum};
use serde_json::{Map, Value as Json, json};
use std::path::PathBuf;

use super::args::{Format, FormatArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::quantity::quantity;
use super::watch::Watch;
use super::{CliError, Outcome, output};
use coaxdesign::pipeline;
use coaxdesign::problem::{Problem, Reference, STICKS};
use coaxdesign::report::figures::{Channel, Marks, TrimSweep, trim_figure};
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::studies::coax2d::table2::{HOVER_OFF, HOVER_ON};
use coaxdesign::trim::{
    Branch, FlightCondition, Lateral, Options, Status, TrimPoint, trim_at_power,
};
use coaxdesign::units::{FOOT, Kind, System};
use coaxdesign::vehicle::Vehicle;
use coaxdesign::vehicle::inflow::FlowState;

/// Trim a rotorcraft over a range of speeds: the periodic orbit at each
#[derive(Debug, Args)]
pub struct Trim {
    #[command(flatten)]
    problem: ProblemArgs,
    #[command(flatten)]
    pub(super) condition: ConditionArgs,
    /// Total shaft power, such as "0 hp" for autorotation: the rate of climb follows
    #[arg(long, value_name = "POWER", conflicts_with = "climb", allow_hyphen_values = true)]
    power: Option<String>,
    /// Rotor-on-rotor interactions
    #[arg(long, value_enum, default_value = "both")]
    interactions: Interactions,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Plot the trim curves to an SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Add a table of induced, profile and parasite power, C_T/σ and figures of merit
    #[arg(long)]
    losses: bool,
    /// Show every iteration on standard error
    #[arg(long)]
    trace: bool,
    #[command(flatten)]
    run: RunArgs,
}

/// Rotor-on-rotor interactions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Interactions {
    /// Rotors wash each other
    On,
    /// Each rotor flies alone
    Off,
    /// One after the other
    Both,
}

impl Interactions {
    /// The switch positions, on first.
    pub fn positions(self) -> &'static [bool] {
        match self {
            Self::On => &[true],
            Self::Off => &[false],
            Self::Both => &[true, false],
        }
    }
}

/// The flight condition.
#[derive(Debug, Clone, Args)]
pub struct ConditionArgs {
    /// Airspeeds, horizontal in a climb: FIRST:LAST:STEP with a unit, a list, or one speed
    #[arg(long, value_name = "SPEEDS", default_value = "0:90:5kt", allow_hyphen_values = true)]
    pub speeds: String,
    #[command(flatten)]
    pub flight: FlightArgs,
}

/// The flight condition but for its speed.
#[derive(Debug, Clone, Args)]
pub struct FlightArgs {
    /// Rate of climb, such as "300 ft/min"
    #[arg(long, value_name = "RATE", allow_hyphen_values = true)]
    pub climb: Option<String>,
    /// Rate of turn, such as "0.15 rad/s", positive to starboard
    #[arg(long, value_name = "RATE", allow_hyphen_values = true)]
    pub turn_rate: Option<String>,
    /// Sideslip to hold, such as "5 deg" (zero by default)
    #[arg(long, value_name = "ANGLE", conflicts_with = "bank", allow_hyphen_values = true)]
    pub sideslip: Option<String>,
    /// Bank to hold instead of sideslip, such as "0 deg"
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    pub bank: Option<String>,
    /// Direction of flight relative to the nose, and so of the wind: "90 deg" is sideward to the
    /// right, "180 deg" rearward
    #[arg(
        long,
        value_name = "ANGLE",
        conflicts_with_all = ["sideslip", "bank"],
        allow_hyphen_values = true
    )]
    pub wind_azimuth: Option<String>,
    /// Pressure altitude in place of the file's, such as "2000 ft"
    #[arg(long, value_name = "HEIGHT", allow_hyphen_values = true)]
    pub altitude: Option<String>,
}

/// Most speeds of one sweep.
const MOST_SPEEDS: usize = 1000;
/// Fastest airspeed that makes sense, m/s: Mach 1 at sea level.
const FASTEST: f64 = 340.0;

/// Speeds of `--speeds`, m/s.
///
/// # Errors
/// A form that is none of `FIRST:LAST:STEP UNIT`, `A,B,C UNIT` and `A UNIT`.
pub fn parse_speeds(text: &str) -> Result<Vec<f64>, CliError> {
    let usage = |message: String| CliError::Usage {
        message: format!("--speeds {text:?}: {message}"),
        help: "write --speeds 0:90:5kt, --speeds \"0,30,60 kt\" or --speeds \"45 kt\"".into(),
    };
    let trimmed = text.trim();
    let split = trimmed.rfind(|c: char| c.is_ascii_digit() || c == '.').map_or(0, |last| last + 1);
    let (numbers, unit) = trimmed.split_at(split);
    if numbers.is_empty() {
        return Err(usage("there is no number in it".into()));
    }
    if unit.trim().is_empty() {
        return Err(usage("it has no unit".into()));
    }
    let value = |number: &str| -> Result<f64, CliError> {
        let speed =
            quantity("speeds", &format!("{} {}", number.trim(), unit.trim()), Kind::Airspeed)?;
        if !(0.0..=FASTEST).contains(&speed) {
            return Err(usage(format!(
                "{} {} is not between 0 and the speed of sound",
                number.trim(),
                unit.trim()
            )));
        }
        Ok(speed)
    };
    let parts: Vec<&str> = numbers.split(':').collect();
    match parts.as_slice() {
        [list] => {
            let count = list.split(',').count();
            if count > MOST_SPEEDS {
                return Err(usage(format!("{count} speeds are too many; {MOST_SPEEDS} at most")));
            }
            list.split(',').map(value).collect()
        }
        [first, last, step] => {
            let (first, last, step) = (value(first)?, value(last)?, value(step)?);
            if step <= 0.0 {
                return Err(usage("the step must be positive".into()));
            }
            if last < first {
                return Err(usage("the last speed is below the first".into()));
            }
            let count = ((last - first) / step + 1e-9).floor() as usize;
            let count = count.saturating_add(1);
            if count > MOST_SPEEDS {
                return Err(usage(format!("{count} speeds are too many; {MOST_SPEEDS} at most")));
            }
            Ok((0..count).map(|k| first + k as f64 * step).collect())
        }
        _ => Err(usage("a range has three parts, FIRST:LAST:STEP".into())),
    }
}

impl ConditionArgs {
    /// Flight conditions, one a speed; the altitude goes into the problem.
    ///
    /// # Errors
    /// Quantities that cannot be read or make no sense together.
    pub fn conditions(&self, problem: &mut Problem) -> Result<Vec<FlightCondition>, CliError> {
        self.flight.conditions(&self.speeds, problem)
    }
}

impl FlightArgs {
    /// Flight conditions at the speeds of a `--speeds` argument; the altitude
    /// goes into the problem.
    ///
    /// # Errors
    /// Quantities that cannot be read or make no sense together.
    pub fn conditions(
        &self,
        speeds: &str,
        problem: &mut Problem,
    ) -> Result<Vec<FlightCondition>, CliError> {
        let optional = |flag: &str, text: &Option<String>, kind| {
            text.as_deref().map(|text| quantity(flag, text, kind)).transpose()
        };
        if let Some(altitude) = optional("altitude", &self.altitude, Kind::Length)? {
            problem.atmosphere.altitude = altitude;
        }
        let climb = optional("climb", &self.climb, Kind::Velocity)?.unwrap_or(0.0);
        let turn_rate = optional("turn-rate", &self.turn_rate, Kind::AngularRate)?.unwrap_or(0.0);
        let lateral = match (
            optional("sideslip", &self.sideslip, Kind::Angle)?,
            optional("bank", &self.bank, Kind::Angle)?,
            optional("wind-azimuth", &self.wind_azimuth, Kind::Angle)?,
        ) {
            (_, _, Some(azimuth)) => Lateral::WindAzimuth(azimuth),
            (_, Some(bank), None) => Lateral::Bank(bank),
            (sideslip, None, None) => Lateral::Sideslip(sideslip.unwrap_or(0.0)),
        };
        let speeds = parse_speeds(speeds)?;
        Ok(speeds
            .into_iter()
            .map(|speed| FlightCondition {
                turn_rate,
                lateral,
                ..FlightCondition::climbing(speed, climb)
            })
            .collect())
    }
}

impl Trim {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.output.check()?;
        self.format.of(&self.output)?;
        if let Some(path) = &self.plot {
            self.output.check_plot(path)?;
        }
        self.run.start()?;
        let mut loaded = self.problem.load_with_warnings(self.run.quiet)?;
        let conditions = self.condition.conditions(&mut loaded.problem)?;
        let problem = &loaded.problem;
        let power =
            self.power.as_deref().map(|text| quantity("power", text, Kind::Power)).transpose()?;
        let positions = self.interactions.positions();
        let points = match power {
            None => trim_all(problem, &conditions, positions, self.run.quiet)?,
            Some(power) => trim_all_at_power(problem, &conditions, power, positions)?,
        };
        let system = self.units.of(Some(problem));
        if self.trace {
            for point in points.iter().flatten() {
                output::note(&trace(point, system));
            }
        }
        let text = match self.format.of(&self.output)? {
            Format::Table => table(problem, &points, system, self.losses),
            Format::Csv => csv(problem, &points, system),
            Format::Json => json_text(problem, &points, system)?,
        };
        if let Some(path) = &self.plot {
            let figure = figure(problem, &points, system).to_svg();
            self.output.write_plot(path, &figure)?;
        }
        self.output.write(&text)?;
        let remarks = remarks(problem, &points, system);
        if !remarks.is_empty() {
            output::note(&remarks);
        }
        let failures = failures(&points, Some(system));
        if failures.is_empty() {
            Ok(Outcome::Done)
        } else {
            output::note(&failures);
            Ok(Outcome::GoalMissed)
        }
    }
}

/// Trims a problem at every condition, interactions on and off side by side.
pub(super) fn trim_all(
    problem: &Problem,
    conditions: &[FlightCondition],
    positions: &[bool],
    quiet: bool,
) -> Result<Vec<Vec<TrimPoint>>, CliError> {
    Ok(pipeline::trim(problem, conditions, positions, &Watch::new(quiet))?)
}

/// Trims a problem at every condition, the rates of climb from the power.
fn trim_all_at_power(
    problem: &Problem,
    conditions: &[FlightCondition],
    power: f64,
    positions: &[bool],
) -> Result<Vec<Vec<TrimPoint>>, CliError> {
    use rayon::prelude::*;
    positions
        .iter()
        .map(|&on| {
            let mut problem = problem.clone();
            problem.inflow.interactions = on;
            let vehicle = Vehicle::new(&problem)?;
            Ok(conditions
                .par_iter()
                .map(|&condition| trim_at_power(&vehicle, condition, power, &Options::default()))
                .collect())
        })
        .collect()
}

/// The interactions in a word.
pub(super) fn on_off(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

fn table(problem: &Problem, sweeps: &[Vec<TrimPoint>], system: System, losses: bool) -> String {
    let mut text = format!("{}: periodic trim\n", problem.name);
    for points in sweeps {
        let Some(first) = points.first() else { continue };
        let climbs = points.iter().any(|point| point.condition.climb_rate != 0.0);
        let mut columns =
            vec![Column::number("speed", Kind::Airspeed.symbol(system), Digits::Decimals(1))];
        if climbs {
            columns.push(match system {
                System::Us => Column::number("climb", "ft/min", Digits::Decimals(0)),
                System::Si => Column::number("climb", "m/s", Digits::Decimals(2)),
            });
        }
        columns.extend([
            Column::number("roll", "deg", Digits::Decimals(2)),
            Column::number("pitch", "deg", Digits::Decimals(2)),
        ]);
        for stick in STICKS {
            columns.push(Column::number(stick, "%", Digits::Decimals(2)));
        }
        for rotor in &problem.rotors {
            let short = &rotor.name;
            columns.push(Column::number(
                &format!("T {short}"),
                Kind::Force.symbol(system),
                Digits::Decimals(1),
            ));
            columns.push(Column::number(
                &format!("P {short}"),
                Kind::Power.symbol(system),
                Digits::Decimals(2),
            ));
            columns.push(Column::number(&format!("λ0 {short}"), "", Digits::Decimals(4)));
        }
        columns.push(Column::number("power", Kind::Power.symbol(system), Digits::Decimals(2)));
        columns.push(Column::number("margin", "%", Digits::Decimals(0)));
        columns.push(Column::text("of"));
        columns.push(Column::number("residual", "", Digits::Significant(2)));
        columns.push(Column::text("status"));
        let mut table = Table::new(
            &format!("rotor-on-rotor interactions {}", on_off(first.interactions)),
            columns,
        );
        for point in points {
            let [roll, pitch] = attitude(point);
            let mut cells = vec![Cell::from(
                Kind::Airspeed.from_si(point.condition.horizontal_speed(), system),
            )];
            if climbs {
                let rate = point.condition.climb_rate;
                cells.push(Cell::from(match system {
                    System::Us => rate / (FOOT / 60.0),
                    System::Si => rate,
                }));
            }
            cells.extend([Cell::from(roll.to_degrees()), Cell::from(pitch.to_degrees())]);
            cells.extend(point.sticks.iter().map(|&stick| Cell::from(stick)));
            for rotor in &point.rotors {
                cells.push(Cell::from(Kind::Force.from_si(rotor.thrust, system)));
                cells.push(Cell::from(Kind::Power.from_si(rotor.power, system)));
                cells.push(Cell::from(rotor.inflow[0]));
            }
            cells.push(Cell::from(Kind::Power.from_si(point.power.shaft, system)));
            match least_margin(point) {
                Some((control, fraction)) => {
                    cells.push(Cell::from(100.0 * fraction));
                    cells.push(Cell::from(control));
                }
                None => cells.extend([Cell::empty(), Cell::empty()]),
            }
            cells.push(Cell::from(point.residual_norm));
            let status = Cell::from(point.status.word());
            cells.push(match point.status {
                Status::Converged => status,
                _ => status.highlight(Highlight::Bad),
            });
            table.row(cells);
        }
        text.push('\n');
        text += &table.to_text(Coloring::for_stdout());
    }
    if let Some(found) = published(problem, sweeps) {
        text.push('\n');
        text += &published_table(&found, system).to_text(Coloring::for_stdout());
    }
    if losses {
        text.push('\n');
        text += &losses_table(problem, sweeps, system).to_text(Coloring::for_stdout());
    }
    if let Some(found) = blades_table(problem, sweeps, system) {
        text.push('\n');
        text += &found.to_text(Coloring::for_stdout());
        text.push_str(
            "\nShares are of the disk. A section counts as stalled beyond the angle of largest \
             lift at its Mach\nnumber (15 deg from zero lift without a table), and as too fast \
             beyond drag divergence or Mach 0.9;\nazimuth is in the rotor's own direction from \
             over the tail.\n",
        );
    }
    text.push_str(
        "\nThrust is along the shaft, mean over the orbit; margin is the least distance to a \
         control limit, in percent of its travel.\n",
    );
    text
}

/// Share of the disk from which sections that are stalled or too fast are
/// shown, and in reversed flow; blade loading C_T/σ from which it is.
const SHOWN: [f64; 4] = [0.005, 0.005, 0.05, 0.12];

/// What the blades meet where it is more than usual; `None` where it nowhere
/// is.
fn blades_table(problem: &Problem, sweeps: &[Vec<TrimPoint>], system: System) -> Option<Table> {
    let mut table = Table::new(
        "warning: blades stalled, too fast, in reversed flow or highly loaded",
        vec![
            Column::number("speed", Kind::Airspeed.symbol(system), Digits::Decimals(1)),
            Column::text("interactions"),
            Column::text("rotor"),
            Column::number("stalled", "%", Digits::Decimals(1)),
            Column::number("too fast", "%", Digits::Decimals(1)),
            Column::number("reversed", "%", Digits::Decimals(1)),
            Column::number("C_T/σ", "", Digits::Decimals(3)),
            Column::number("worst r/R", "", Digits::Decimals(2)),
            Column::number("azimuth", "deg", Digits::Decimals(0)),
            Column::number("α", "deg", Digits::Decimals(1)),
            Column::number("Mach", "", Digits::Decimals(2)),
        ],
    );
    let mut any = false;
    for point in sweeps.iter().flatten().filter(|point| point.on_orbit()) {
        for (rotor, mean) in problem.rotors.iter().zip(&point.rotors) {
            let census = &mean.census;
            let shares =
                [census.stalled(), census.diverging(), census.reversed(), mean.blade_loading];
            if census.is_empty() || shares.iter().zip(SHOWN).all(|(share, shown)| *share < shown) {
                continue;
            }
            any = true;
            let worst = &census.worst;
            table.row([
                Cell::from(Kind::Airspeed.from_si(point.condition.horizontal_speed(), system)),
                Cell::from(on_off(point.interactions)),
                Cell::from(rotor.name.as_str()),
                Cell::from(100.0 * shares[0]),
                Cell::from(100.0 * shares[1]),
                Cell::from(100.0 * shares[2]),
                Cell::from(shares[3]),
                Cell::from(worst.station),
                Cell::from(worst.azimuth.rem_euclid(std::f64::consts::TAU).to_degrees()),
                Cell::from(worst.angle_of_attack.to_degrees()),
                Cell::from(worst.mach),
            ]);
        }
    }
    any.then_some(table)
}

/// A hover value of a rotor beside the published one, SI.
pub(super) struct Published {
    /// Whether rotors interfere.
    pub interactions: bool,
    /// Rotor.
    pub rotor: String,
    /// Symbol.
    pub quantity: &'static str,
    /// What it measures.
    pub kind: Kind,
    /// Here.
    pub ours: f64,
    /// In the paper's Table 2.
    pub printed: f64,
}

/// Hover beside the published values, for a problem that names the publication.
pub(super) fn published(problem: &Problem, sweeps: &[Vec<TrimPoint>]) -> Option<Vec<Published>> {
    if problem.reference != Some(Reference::Coax2dPaper) {
        return None;
    }
    let mut found = Vec::new();
    for point in sweeps.iter().filter_map(|points| {
        points
            .iter()
            .find(|point| point.condition == FlightCondition::level(0.0) && point.on_orbit())
    }) {
        let reference = if point.interactions { &HOVER_ON } else { &HOVER_OFF };
        for (rotor, mean) in problem.rotors.iter().zip(&point.rotors) {
            let Some(theirs) = reference.iter().find(|r| r.name == rotor.name) else { continue };
            for (quantity, kind, ours, printed) in [
                ("T", Kind::Force, mean.thrust, theirs.thrust),
                ("P", Kind::Power, mean.power, theirs.power),
                ("λ0", Kind::Dimensionless, mean.inflow[0], theirs.inflow),
                ("λs0", Kind::Dimensionless, mean.self_inflow[0], theirs.self_inflow),
                ("CT", Kind::Dimensionless, mean.thrust_coefficient, theirs.thrust_coefficient),
            ] {
                found.push(Published {
                    interactions: point.interactions,
                    rotor: rotor.name.clone(),
                    quantity,
                    kind,
                    ours,
                    printed,
                });
            }
        }
    }
    (!found.is_empty()).then_some(found)
}

/// The published values as a table, a line each.
fn published_table(found: &[Published], system: System) -> Table {
    let mut table = Table::new(
        "hover beside the published Table 2",
        vec![
            Column::text("interactions"),
            Column::text("rotor"),
            Column::text("quantity"),
            Column::text("unit"),
            Column::number("here", "", Digits::Significant(4)),
            Column::number("published", "", Digits::Significant(4)),
            Column::number("ratio", "", Digits::Decimals(3)),
        ],
    );
    for p in found {
        table.row([
            Cell::from(on_off(p.interactions)),
            Cell::from(p.rotor.as_str()),
            Cell::from(p.quantity),
            Cell::from(p.kind.symbol(system)),
            Cell::from(p.kind.from_si(p.ours, system)),
            Cell::from(p.kind.from_si(p.printed, system)),
            Cell::from(p.ours / p.printed),
        ]);
    }
    table
}

/// Mean roll and pitch attitude, rad.
pub(super) fn attitude(point: &TrimPoint) -> [f64; 2] {
    let body = coaxdesign::vehicle::Layout::BODY;
    [point.mean_state[body.roll], point.mean_state[body.pitch]]
}

/// The control nearest to a limit, and its distance as a fraction of travel.
pub(super) fn least_margin(point: &TrimPoint) -> Option<(&str, f64)> {
    point
        .margins
        .iter()
        .map(|margin| (margin.control.as_str(), margin.fraction()))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// A number without the noise of unit conversions in its last digits.
fn clean(value: f64) -> Json {
    let digits = format!("{value:.12e}").parse::<f64>().unwrap_or(value);
    json!(digits)
}

pub(super) fn json_text(
    problem: &Problem,
    sweeps: &[Vec<TrimPoint>],
    system: System,
) -> Result<String, CliError> {
    let points: Vec<Json> =
        sweeps.iter().flatten().map(|point| json_point(problem, point, system)).collect();
    let document = json!({
        "schema": "coaxdesign.trim/1",
        "problem": problem.name,
        "version": env!("CARGO_PKG_VERSION"),
        "units": if system == System::Us { "us" } else { "si" },
        "points": points,
    });
    serde_json::to_string_pretty(&document)
        .map(|text| text + "\n")
        .map_err(|error| CliError::Internal(error.to_string()))
}

fn json_point(problem: &Problem, point: &TrimPoint, system: System) -> Json {
    let us = system == System::Us;
    let show = |kind: Kind, value: f64| clean(kind.from_si(value, system));
    let angle = |value: f64| if us { clean(value.to_degrees()) } else { clean(value) };
    let angle_unit = if us { "deg" } else { "rad" };
    let [roll, pitch] = attitude(point);
    let mut rotors = Map::new();
    for (rotor, mean) in problem.rotors.iter().zip(&point.rotors) {
        let mut entry = Map::new();
        let mut put = |key: String, value: Json| {
            entry.insert(key, value);
        };
        put(if us { "thrust_lbf" } else { "thrust_n" }.into(), show(Kind::Force, mean.thrust));
        put(
            if us { "torque_lbf_ft" } else { "torque_n_m" }.into(),
            show(Kind::Moment, mean.torque),
        );
        put(if us { "power_hp" } else { "power_w" }.into(), {
            if us { show(Kind::Power, mean.power) } else { clean(mean.power) }
        });
        put("flow_state".into(), json!(mean.flow.word()));
        put("c_t".into(), clean(mean.thrust_coefficient));
        put("c_p".into(), clean(mean.power_coefficient));
        put("c_t_over_sigma".into(), clean(mean.blade_loading));
        put("figure_of_merit".into(), mean.figure_of_merit.map_or(Json::Null, clean));
        put("profile_power_w".into(), clean(mean.profile_power));
        put("induced_power_w".into(), clean(mean.induced_power));
        for (names, values) in [
            (["lambda_0", "lambda_1c", "lambda_1s"], mean.inflow),
            (["lambda_s0", "lambda_s1c", "lambda_s1s"], mean.self_inflow),
        ] {
            for (name, value) in names.iter().zip(values) {
                put((*name).into(), clean(value));
            }
        }
        for (name, value) in ["beta_1c", "beta_1s"].iter().zip(mean.flapping) {
            put(format!("{name}_{angle_unit}"), angle(value));
        }
        for (name, value) in ["theta_0", "theta_1c", "theta_1s"].iter().zip(mean.pitch) {
            put(format!("{name}_{angle_unit}"), angle(value));
        }
        let census = &mean.census;
        if !census.is_empty() && point.on_orbit() {
            let worst = &census.worst;
            let azimuth = worst.azimuth.rem_euclid(std::f64::consts::TAU);
            entry.insert(
                "blades".into(),
                json!({
                    "c_t_over_sigma": clean(mean.blade_loading),
                    "stalled_share": clean(census.stalled()),
                    "drag_divergence_share": clean(census.diverging()),
                    "reversed_share": clean(census.reversed()),
                    "worst": {
                        "severity": clean(census.severity),
                        "station": clean(worst.station),
                        format!("azimuth_{angle_unit}"): angle(azimuth),
                        format!("angle_of_attack_{angle_unit}"): angle(worst.angle_of_attack),
                        "mach": clean(worst.mach),
                    },
                }),
            );
        }
        rotors.insert(rotor.name.clone(), Json::Object(entry));
    }
    let controls: Map<String, Json> =
        STICKS.iter().zip(point.sticks).map(|(name, v)| ((*name).into(), clean(v))).collect();
    let margins: Map<String, Json> = point
        .margins
        .iter()
        .map(|margin| (margin.control.clone(), clean(100.0 * margin.fraction())))
        .collect();
    let residuals: Vec<Json> = point
        .residuals
        .iter()
        .map(|r| {
            json!({
                "equation": r.equation,
                "unit": r.kind.symbol(System::Si),
                "value": r.value,
            })
        })
        .collect();
    let mut object = Map::new();
    object.insert(
        if us { "speed_kt" } else { "speed_m_s" }.into(),
        if us {
            show(Kind::Airspeed, point.condition.horizontal_speed())
        } else {
            clean(point.condition.horizontal_speed())
        },
    );
    object.insert("interactions".into(), json!(point.interactions));
    object.insert("status".into(), json!(point.status.word()));
    if let Status::Failed { equations, binding, reason } = &point.status {
        object.insert(
            "failure".into(),
            json!({"equations": equations, "binding_limits": binding, "reason": reason}),
        );
    }
    if let Status::BeyondLimits { controls } = &point.status {
        object.insert("beyond_limits".into(), json!(controls));
    }
    object.insert("branch".into(), json!(point.branch.word()));
    if let Some(last) = point.branch.last() {
        object.insert(
            "last_from_level_flight".into(),
            json!({
                "speed_m_s": clean(last.horizontal_speed()),
                "climb_rate_m_s": clean(last.climb_rate),
                "turn_rate_rad_s": clean(last.turn_rate),
            }),
        );
    }
    object.insert("iterations".into(), json!(point.iterations));
    object.insert("residual_norm".into(), json!(point.residual_norm));
    object.insert("climb_rate_m_s".into(), clean(point.condition.climb_rate));
    object.insert("turn_rate_rad_s".into(), clean(point.condition.turn_rate));
    if let Lateral::WindAzimuth(azimuth) = point.condition.lateral {
        object.insert(format!("wind_azimuth_{angle_unit}"), angle(azimuth));
    }
    object.insert(
        format!("attitude_{angle_unit}"),
        json!({"roll": angle(roll), "pitch": angle(pitch)}),
    );
    object.insert(format!("sideslip_{angle_unit}"), angle(point.sideslip));
    object.insert("controls_percent".into(), Json::Object(controls));
    object.insert("rotors".into(), Json::Object(rotors));
    object.insert(
        if us { "total_power_hp" } else { "total_power_w" }.into(),
        if us { show(Kind::Power, point.power.shaft) } else { clean(point.power.shaft) },
    );
    object.insert(
        "power_w".into(),
        json!({
            "shaft": clean(point.power.shaft),
            "profile": clean(point.power.profile),
            "induced": clean(point.power.induced),
            "parasite": clean(point.power.parasite),
            "climb": clean(point.power.climb),
        }),
    );
    object.insert("margins_percent".into(), Json::Object(margins));
    object.insert("steps_per_period".into(), json!(point.steps));
    object.insert("step_error".into(), json!(point.step_error));
    object.insert("residuals".into(), Json::Array(residuals));
    Json::Object(object)
}

/// Names of the parts of the shaft power, in the order of [`parts`].
const PARTS: [&str; 4] = ["induced", "profile", "parasite", "climb"];

fn parts(point: &TrimPoint) -> [f64; 4] {
    let power = &point.power;
    [power.induced, power.profile, power.parasite, power.climb]
}

/// Where the power goes, and what the rotors reach: `--losses`.
fn losses_table(problem: &Problem, sweeps: &[Vec<TrimPoint>], system: System) -> Table {
    let mut columns = vec![
        Column::number("speed", Kind::Airspeed.symbol(system), Digits::Decimals(1)),
        Column::text("interactions"),
        Column::number("power", Kind::Power.symbol(system), Digits::Decimals(2)),
    ];
    columns.extend(PARTS.iter().map(|part| Column::number(part, "%", Digits::Decimals(1))));
    for rotor in &problem.rotors {
        let name = &rotor.name;
        columns.push(Column::number(&format!("C_T/σ {name}"), "", Digits::Decimals(4)));
        columns.push(Column::number(&format!("FM {name}"), "", Digits::Decimals(4)));
    }
    let mut table = Table::new("losses: shares of the shaft power", columns);
    for point in sweeps.iter().flatten().filter(|point| point.on_orbit()) {
        let mut cells = vec![
            Cell::from(Kind::Airspeed.from_si(point.condition.horizontal_speed(), system)),
            Cell::from(on_off(point.interactions)),
            Cell::from(Kind::Power.from_si(point.power.shaft, system)),
        ];
        // Of an autorotation there is nothing to take shares of.
        let shaft = point.power.shaft;
        let whole = shaft.abs() > 1e-6 * parts(point).iter().map(|part| part.abs()).sum::<f64>();
        cells.extend(
            parts(point).map(
                |part| {
                    if whole { Cell::from(100.0 * part / shaft) } else { Cell::empty() }
                },
            ),
        );
        for mean in &point.rotors {
            cells.push(Cell::from(mean.blade_loading));
            cells.push(mean.figure_of_merit.map_or_else(Cell::empty, Cell::from));
        }
        table.row(cells);
    }
    table
}

fn csv(problem: &Problem, sweeps: &[Vec<TrimPoint>], system: System) -> String {
    let us = system == System::Us;
    let angle = |value: f64| if us { value.to_degrees() } else { value };
    let angle_unit = if us { "deg" } else { "rad" };
    let (speed, force, moment, power) =
        if us { ("kt", "lbf", "lbf_ft", "hp") } else { ("m_s", "n", "n_m", "w") };
    let watt = |value: f64| if us { Kind::Power.from_si(value, system) } else { value };
    let mut head: Vec<String> = vec![
        format!("speed_{speed}"),
        "interactions".into(),
        "status".into(),
        format!("roll_{angle_unit}"),
        format!("pitch_{angle_unit}"),
        format!("sideslip_{angle_unit}"),
    ];
    head.extend(STICKS.iter().map(|stick| format!("{stick}_percent")));
    for rotor in &problem.rotors {
        for column in [
            format!("thrust_{force}"),
            format!("torque_{moment}"),
            format!("power_{power}"),
            "c_t".into(),
            "lambda_0".into(),
            "lambda_s0".into(),
            format!("beta_1c_{angle_unit}"),
            format!("beta_1s_{angle_unit}"),
            format!("theta_0_{angle_unit}"),
            format!("theta_1c_{angle_unit}"),
            format!("theta_1s_{angle_unit}"),
            "flow_state".into(),
            "c_t_over_sigma".into(),
            "figure_of_merit".into(),
            format!("profile_power_{power}"),
            format!("induced_power_{power}"),
            "stalled_share".into(),
            "drag_divergence_share".into(),
            "reversed_share".into(),
        ] {
            head.push(format!("{}.{column}", rotor.name));
        }
    }
    head.push(format!("total_power_{power}"));
    head.extend(PARTS.iter().map(|part| format!("{part}_power_{power}")));
    head.extend(["climb_rate_m_s", "turn_rate_rad_s"].map(String::from));
    head.extend(["branch", "residual_norm", "iterations"].map(String::from));
    let mut text = head.join(",") + "\n";
    for point in sweeps.iter().flatten() {
        let [roll, pitch] = attitude(point);
        let airspeed = point.condition.horizontal_speed();
        let mut row = vec![
            number(if us { Kind::Airspeed.from_si(airspeed, system) } else { airspeed }),
            on_off(point.interactions).into(),
            point.status.word().into(),
        ];
        row.extend([roll, pitch, point.sideslip].map(|value| number(angle(value))));
        row.extend(point.sticks.map(number));
        for mean in &point.rotors {
            row.extend([
                number(Kind::Force.from_si(mean.thrust, system)),
                number(Kind::Moment.from_si(mean.torque, system)),
                number(watt(mean.power)),
                number(mean.thrust_coefficient),
                number(mean.inflow[0]),
                number(mean.self_inflow[0]),
            ]);
            row.extend(mean.flapping.iter().chain(&mean.pitch).map(|&v| number(angle(v))));
            row.push(mean.flow.word().into());
            row.push(number(mean.blade_loading));
            row.push(mean.figure_of_merit.map_or_else(String::new, number));
            row.push(number(watt(mean.profile_power)));
            row.push(number(watt(mean.induced_power)));
            let census = &mean.census;
            row.extend(if census.is_empty() {
                [const { String::new() }; 3]
            } else {
                [census.stalled(), census.diverging(), census.reversed()].map(number)
            });
        }
        row.push(number(watt(point.power.shaft)));
        row.extend(parts(point).map(|part| number(watt(part))));
        row.push(number(point.condition.climb_rate));
        row.push(number(point.condition.turn_rate));
        row.push(point.branch.word().into());
        row.push(number(point.residual_norm));
        row.push(point.iterations.to_string());
        text += &(row.join(",") + "\n");
    }
    text
}

fn number(value: f64) -> String {
    output::significant(value, 12)
}

/// The trim curves.
pub(super) fn figure(
    problem: &Problem,
    sweeps: &[Vec<TrimPoint>],
    system: System,
) -> coaxdesign::report::plot::Figure {
    let data: Vec<TrimSweep> = sweeps
        .iter()
        .filter(|points| !points.is_empty())
        .map(|points| {
            let on = points[0].interactions;
            let name = format!("interactions {}", on_off(on));
            curves(&name, usize::from(!on), problem, points, system)
        })
        .collect();
    trim_figure(&format!("{}: trim", problem.name), Kind::Airspeed.symbol(system), &data)
}

/// The curves of one sweep, of the points that are on their orbits.
pub(super) fn curves(
    name: &str,
    style: usize,
    problem: &Problem,
    points: &[TrimPoint],
    system: System,
) -> TrimSweep {
    let good: Vec<&TrimPoint> = points.iter().filter(|p| p.on_orbit()).collect();
    let channel = |name: &str, unit: &str, pick: &dyn Fn(&TrimPoint) -> f64| Channel {
        name: name.into(),
        unit: unit.into(),
        values: good.iter().map(|point| pick(point)).collect(),
    };
    TrimSweep {
        name: name.into(),
        style,
        marks: Marks::With,
        speed: good
            .iter()
            .map(|p| Kind::Airspeed.from_si(p.condition.horizontal_speed(), system))
            .collect(),
        pitch_attitude_deg: good.iter().map(|p| attitude(p)[1].to_degrees()).collect(),
        roll_attitude_deg: good.iter().map(|p| attitude(p)[0].to_degrees()).collect(),
        controls: (0..4).map(|k| channel(STICKS[k], "%", &|p| p.sticks[k])).collect(),
        power: channel("power", Kind::Power.symbol(system), &|p| {
            Kind::Power.from_si(p.power.shaft, system)
        }),
        thrust_share: problem
            .rotors
            .iter()
            .enumerate()
            .map(|(k, rotor)| {
                channel(&rotor.name, "%", &|p| {
                    let total: f64 = p.rotors.iter().map(|r| r.thrust).sum();
                    100.0 * p.rotors[k].thrust / total
                })
            })
            .collect(),
    }
}

/// Iterations of a point, for `--trace`.
fn trace(point: &TrimPoint, system: System) -> String {
    let mut text = format!(
        "{:.1} {}, interactions {}: {} steps a period\n",
        Kind::Airspeed.from_si(point.condition.horizontal_speed(), system),
        Kind::Airspeed.symbol(system),
        on_off(point.interactions),
        point.steps
    );
    for step in &point.history {
        let equation = point
            .residuals
            .get(step.worst_residual)
            .map_or("", |residual| residual.equation.as_str());
        text += &format!(
            "  {:3}  {}  worst residual {:.2e} ({equation}), step {:.1e}, damping {:.1e}, gain {:.3}{}\n",
            step.iteration,
            if step.accepted { "taken   " } else { "rejected" },
            step.residual_max,
            step.step,
            step.damping,
            step.gain,
            if step.fresh_jacobian { ", new Jacobian" } else { "" },
        );
    }
    text
}

/// A condition in a few words; in both systems of units where none is asked for.
fn place(condition: &FlightCondition, system: Option<System>) -> String {
    let Some(system) = system else {
        let [us, si] = [System::Us, System::Si].map(|system| place(condition, Some(system)));
        return format!("{us} ({si})");
    };
    let shown = |kind: Kind, value: f64, digits: usize| {
        format!("{:.digits$} {}", kind.from_si(value, system), kind.symbol(system))
    };
    let mut text = shown(Kind::Airspeed, condition.horizontal_speed(), 1);
    if condition.climb_rate != 0.0 {
        let rate = match system {
            System::Us => format!("{:.0} ft/min", condition.climb_rate.abs() / (FOOT / 60.0)),
            System::Si => shown(Kind::Velocity, condition.climb_rate.abs(), 2),
        };
        text += &format!(
            ", {} {rate}",
            if condition.climb_rate > 0.0 { "climbing" } else { "sinking" }
        );
    }
    if let Lateral::WindAzimuth(azimuth) = condition.lateral {
        text += &format!(", wind from {:.1} deg", azimuth.to_degrees());
    }
    if condition.turn_rate != 0.0 {
        text += &format!(", turning {:.1} deg/s", condition.turn_rate.to_degrees());
    }
    text
}

/// What did not trim and why, and trims that do not continue level flight.
/// Speeds are in the units asked for, or in both.
pub(super) fn failures(sweeps: &[Vec<TrimPoint>], system: Option<System>) -> String {
    let mut text = String::new();
    for point in sweeps.iter().flatten() {
        let place_of = format!(
            "{}, interactions {}",
            place(&point.condition, system),
            on_off(point.interactions)
        );
        match &point.status {
            Status::Converged => {}
            Status::BeyondLimits { controls } => {
                text += &format!(
                    "{place_of}: trimmed, but beyond the limits of {}\n",
                    controls.join(", ")
                );
            }
            Status::Failed { equations, binding, reason } => {
                text += &format!("{place_of}: no trim: {reason}\n");
                if !equations.is_empty() {
                    text += &format!("  equations not met: {}\n", equations.join(", "));
                }
                if !binding.is_empty() {
                    text += &format!("  limits that bind: {}\n", binding.join(", "));
                }
                text += &match point.branch.last() {
                    Some(last) => {
                        format!(
                            "  the last trim on the way from level flight: {}\n",
                            place(&last, system)
                        )
                    }
                    None => String::new(),
                };
            }
        }
    }
    text
}

/// Trims that are not what the name promises at first sight.
pub(super) fn remarks(problem: &Problem, sweeps: &[Vec<TrimPoint>], system: System) -> String {
    let system = Some(system);
    let mut text = String::new();
    for point in sweeps.iter().flatten().filter(|point| point.on_orbit()) {
        let place_of = format!(
            "{}, interactions {}",
            place(&point.condition, system),
            on_off(point.interactions)
        );
        for (rotor, mean) in problem.rotors.iter().zip(&point.rotors) {
            let remark = match mean.flow {
                FlowState::VortexRing => {
                    "in the vortex-ring state: its inflow is a mean by measurement, and thrust is \
                     unsteady in flight"
                }
                FlowState::TurbulentWake => {
                    "in the turbulent-wake state of descent: its inflow is a mean by measurement"
                }
                FlowState::Windmill | FlowState::Normal => continue,
            };
            text += &format!("{place_of}: {} is {remark}\n", rotor.name);
        }
        match &point.branch {
            Branch::Folded { folds } => {
                text += &format!(
                    "{place_of}: the way from level flight folds {folds} times before it arrives; \
                     conditions between the folds have more than one trim\n"
                );
            }
            Branch::Separate { last } => {
                text += &format!(
                    "{place_of}: this trim does not continue level flight{}\n",
                    last.map_or(String::new(), |last| format!(
                        ", which ends at {}",
                        place(&last, system)
                    ))
                );
            }
            _ => {}
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use coaxdesign::units::KNOT;

    #[test]
    fn absurd_ranges_are_refused() {
        for text in ["0:100:5e-324 kt", "0:1e-300:1e-320 kt", "0:600:1e-9kt"] {
            let error = parse_speeds(text).unwrap_err().to_string();
            assert!(error.contains("too many") || error.contains("positive"), "{text}: {error}");
        }
        let list = format!("{}1 kt", "1,".repeat(100_000));
        assert!(parse_speeds(&list).unwrap_err().to_string().contains("too many"));
    }

    proptest::proptest! {
        /// Any text is answered, with speeds that can be flown or with an error.
        #[test]
        fn any_text_is_answered(text in "[0-9:,. ekmtnaif/s-]{0,24}|\\PC{0,16}") {
            if let Ok(speeds) = parse_speeds(&text) {
                proptest::prop_assert!(speeds.iter().all(|v| v.is_finite() && *v >= 0.0));
                proptest::prop_assert!(speeds.len() <= MOST_SPEEDS);
            }
        }
    }

    #[test]
    fn speeds_in_every_form() {
        let knots = |text: &str| -> Vec<f64> {
            parse_speeds(text).unwrap().iter().map(|v| (v / KNOT * 1e6).round() / 1e6).collect()
        };
        assert_eq!(knots("0:90:5kt").len(), 19);
        assert_eq!(knots("0:90:5kt")[18], 90.0);
        assert_eq!(knots("10,20.5, 30 kt"), [10.0, 20.5, 30.0]);
        assert_eq!(knots("45 kt"), [45.0]);
        for bad in
            ["", "kt", "0:90:5", "0:90 kt", "90:0:5kt", "0:90:0kt", "10 ft", "1e9 kt", "-5 kt"]
        {
            assert!(parse_speeds(bad).is_err(), "{bad}");
        }
    }
}
