//! `coaxdesign identify`.

use std::path::PathBuf;

use clap::Args;
use num_complex::Complex64;
use serde_json::{Value as Json, json};

use super::args::{Format, FormatArgs, ModelsArgs, OutputArgs, RunArgs, UnitsArgs};
use super::bode::speed_text;
use super::designs::{SourceArgs, Subject, load_schedule};
use super::trim::parse_speeds;
use super::{CliError, Outcome};
use coaxdesign::control::axis::{Axis, Channel};
use coaxdesign::control::closed_loop::{LawLoop, PlantLoop};
use coaxdesign::control::loops::{Cut, FrequencyModel};
use coaxdesign::control::metrics::decibels;
use coaxdesign::control::models::{airframe, from_point, from_state_space};
use coaxdesign::control::plant::{Plant, rigid};
use coaxdesign::linear::linearize::{self, averaged};
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::pipeline::PipelineError;
use coaxdesign::report::figures::{
    BodeChannel, Curve, CurvePanel, FrequencyResponse, Marks, bode_figure, time_history_figure,
};
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Table};
use coaxdesign::simulate::flight::Autopilot;
use coaxdesign::simulate::identify::{
    self, Measured, PlantResponse, Record, Response, SLOWEST_REJECTION, Sweep, measure_axes,
};
use coaxdesign::simulate::steps::{self, SmallStep};
use coaxdesign::simulate::{Airframe, Options, Start};
use coaxdesign::trim::{FlightCondition, Options as TrimOptions, sweep};
use coaxdesign::units::{Kind, System};
use coaxdesign::vehicle::Vehicle;

/// Measure margins and bandwidths of a schedule in simulated flight, beside the linear predictions
///
/// The full nonlinear vehicle flies frequency sweeps at attitude hold; ratios of spectra give the
/// loop at each stick, the sensitivity, the command response, and the aircraft alone. The
/// predictions are those that `verify` works with, outer loops open. With --steps it flies small
/// steps in every channel instead, beside the linear closed loop in time, outer loops closed.
#[derive(Debug, Args)]
pub struct Identify {
    /// Directory of a design, or a schedule file
    #[arg(value_name = "DESIGN")]
    design: PathBuf,
    #[command(flatten)]
    sources: SourceArgs,
    #[command(flatten)]
    models: ModelsArgs,
    /// True airspeed, such as "40 kt"
    #[arg(long, alias = "speed", value_name = "SPEED", default_value = "0 kt")]
    speeds: String,
    /// Fly small steps, and compare them in time
    #[arg(long)]
    steps: bool,
    /// Factor on the amplitudes of all sweeps, to see how much is nonlinear
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, conflicts_with = "steps")]
    amplitude: f64,
    /// Length of each sweep; longer ones resolve more lines
    #[arg(long, value_name = "TIME", default_value = "320 s", conflicts_with = "steps")]
    sweep: String,
    /// Plot measured and predicted loops, or steps, to an SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    run: RunArgs,
}

/// Shortest and longest sweep, s.
const SWEEP_TIMES: [f64; 2] = [40.0, 3600.0];
/// Frequencies at which the aircraft alone is measured, rad/s. Slower than this
/// the law keeps its unstable modes so small that little of them is seen.
const PLANT_FREQUENCIES: [f64; 2] = [1.0, 12.0];
/// Its responses that are shown: axis, state, name of it.
const PLANT_RESPONSES: [(Axis, usize, &str); 4] = [
    (Axis::Roll, rigid::P, "p per lat, mismatch"),
    (Axis::Pitch, rigid::Q, "q per lon, mismatch"),
    (Axis::Yaw, rigid::R, "r per ped, mismatch"),
    (Axis::Heave, rigid::W, "w per col, mismatch"),
];

/// Mismatch cost of the aircraft's own responses, which is zero at best.
fn plant_pairs(alone: &PlantResponse, exact: &FrequencyModel) -> Vec<Pair> {
    PLANT_RESPONSES
        .iter()
        .map(|&(axis, state, quantity)| {
            let stick = axis.effector().index();
            let measured = alone.element(state, stick).coherent();
            let cost = identify::mismatch(&measured, |w| exact.states(w)[state][stick]);
            Pair { axis, quantity, unit: "J", measured: cost, interval: None, predicted: None }
        })
        .collect()
}

/// A number measured in flight beside its prediction.
struct Pair {
    axis: Axis,
    quantity: &'static str,
    unit: &'static str,
    measured: Option<f64>,
    /// Between which values it lies as the measurement is uncertain, where that
    /// matters.
    interval: Option<[Option<f64>; 2]>,
    predicted: Option<f64>,
}

/// What is flown in steady flight at a speed, and its linear model there.
struct Flown {
    craft: Flying,
    start: Start,
    plant: Plant,
}

/// An airframe that is owned.
enum Flying {
    Vehicle(Box<Vehicle>),
    Stitched(Box<Stitched>),
}

impl Flying {
    fn airframe(&self) -> Airframe<'_> {
        match self {
            Self::Vehicle(vehicle) => Airframe::from(&**vehicle),
            Self::Stitched(model) => Airframe::from(&**model),
        }
    }
}

impl Flown {
    fn new(subject: &Subject, speed: f64) -> Result<Self, CliError> {
        let condition = FlightCondition::level(speed);
        match subject {
            Subject::Problem(opened) => {
                let vehicle = Vehicle::new(&opened.loaded.problem)?;
                let mut found = sweep(&vehicle, &[condition], &TrimOptions::default(), |_| {});
                let Some(Ok(start)) = found.points.pop().map(|point| point.into_converged()) else {
                    return Err(CliError::Missed("no trim to start from".into()));
                };
                let full = averaged(&vehicle, &start, &linearize::Options::default())?;
                let plant = from_state_space(&full, speed, airframe(start.point()))?;
                let start = Start::from(&start);
                Ok(Self { craft: Flying::Vehicle(Box::new(vehicle)), start, plant })
            }
            Subject::Models(of_models) => {
                let mapping = &of_models.requirements.specification.models_from;
                let model =
                    Stitched::new(&of_models.set, mapping.inertia).map_err(PipelineError::from)?;
                let start = model.steady(&condition).map_err(PipelineError::from)?;
                let point = model.at(speed).map_err(PipelineError::from)?;
                let plant = from_point(&point, speed)?;
                let start = Start::from(&start);
                Ok(Self { craft: Flying::Stitched(Box::new(model)), start, plant })
            }
        }
    }
}

impl Identify {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        self.output.check()?;
        self.format.of(&self.output)?;
        if let Some(plot) = &self.plot {
            self.output.check_plot(plot)?;
        }
        let speeds = parse_speeds(&self.speeds)?;
        let [speed] = speeds[..] else {
            return Err(CliError::Usage {
                message: format!("--speeds {:?}: it is more than one speed", self.speeds),
                help: "write one speed with its unit, such as --speeds \"40 kt\"".into(),
            });
        };
        let settings = self.settings()?;
        let quiet = self.run.quiet;
        let opened = Subject::read(&self.design, &self.sources, &self.models, quiet)?;
        let system = opened.system(self.units);
        let schedule = load_schedule(&self.design)?;
        let table = schedule.law().map_err(|error| CliError::Usage {
            message: error.to_string(),
            help: "a schedule is written by `coaxdesign tune-gains -o DIR`".into(),
        })?;
        let flown = Flown::new(&opened, speed)?;
        let (airframe, start, plant) = (flown.craft.airframe(), &flown.start, &flown.plant);
        let options = Options::new(schedule.hardware, opened.specification().pitch_rate_limit);
        let frequency = FrequencyModel::new(plant, airframe.hardware(&options), 0.0)
            .map_err(|error| CliError::Missed(error.to_string()))?;
        // Measured with the outer loops open.
        let linear = LawLoop::new(&table, speed, false);
        let model = PlantLoop::new(&frequency, &linear);
        let law = Autopilot { table, stick_limits: schedule.stick_limits };
        if self.steps {
            let channels = steps::channels(&law.table, speed);
            let list = steps::compare(airframe, start, plant, &law, &options, &channels)
                .map_err(|error| CliError::Missed(error.to_string()))?;
            return self.show_steps(&opened, &list, speed);
        }
        let measured = measure_axes(airframe, start, &law, &options, &settings, &Axis::ALL)
            .map_err(|error| CliError::Missed(error.to_string()))?;
        let mut pairs: Vec<Pair> = measured.iter().flat_map(|m| pairs(m, &model)).collect();
        let records: Vec<Record> = measured.iter().map(|m| m.record.clone()).collect();
        let period = 1.0 / options.control_rate;
        let alone = identify::plant(&records, period, PLANT_FREQUENCIES, settings.points);
        pairs.extend(plant_pairs(&alone, &frequency));
        if let Some(path) = &self.plot {
            let svg = figure(&measured, &model, speed, system);
            self.output.write_plot(path, &svg)?;
        }
        let text = match self.format.of(&self.output)? {
            Format::Json => {
                let value = as_json(&pairs, &measured, &model, speed);
                let text = serde_json::to_string_pretty(&opened.with_head(&value))
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                text + "\n"
            }
            Format::Csv => opened.with_columns(as_table(&pairs, speed, system)).to_csv(),
            Format::Table => {
                format!("{}\n", opened.head())
                    + &as_table(&pairs, speed, system).to_text(Coloring::for_stdout())
            }
        };
        self.output.write(&text)
    }
}

impl Identify {
    /// The sweeps asked for.
    fn settings(&self) -> Result<Sweep, CliError> {
        if !(self.amplitude.is_finite() && self.amplitude > 0.0) {
            return Err(CliError::Usage {
                message: format!("--amplitude {}: it is no positive number", self.amplitude),
                help: "write a factor, such as --amplitude 0.5".into(),
            });
        }
        let usage = |message: String| CliError::Usage {
            message,
            help: "write a time with its unit, such as --sweep \"320 s\"".into(),
        };
        let duration = coaxdesign::units::parse_quantity(&self.sweep, Kind::Time)
            .map_err(|error| usage(format!("--sweep {:?}: {error}", self.sweep)))?;
        if !(SWEEP_TIMES[0]..=SWEEP_TIMES[1]).contains(&duration) {
            let [least, most] = SWEEP_TIMES;
            return Err(usage(format!("--sweep {:?}: not within {least} to {most} s", self.sweep)));
        }
        Ok(Sweep { duration, ..Sweep::default().scaled(self.amplitude) })
    }

    fn show_steps(
        &self,
        opened: &Subject,
        list: &[SmallStep],
        speed: f64,
    ) -> Result<Outcome, CliError> {
        let system = opened.system(self.units);
        if let Some(path) = &self.plot {
            let svg = steps_figure(list, speed, system);
            self.output.write_plot(path, &svg)?;
        }
        let text = match self.format.of(&self.output)? {
            Format::Json => {
                let steps: Vec<Json> = list
                    .iter()
                    .map(|s| {
                        json!({
                            "channel": s.channel.name(),
                            "size_si": steps::size(s.channel),
                            "rms_difference_percent": 100.0 * s.difference(),
                            "peak_difference_percent": 100.0 * s.largest_difference(),
                            "time_s": s.time,
                            "flown_si": s.flown,
                            "linear_si": s.linear,
                        })
                    })
                    .collect();
                let value = json!({
                    "schema": "coaxdesign.steps/1",
                    "speed_m_s": speed,
                    "steps": steps,
                });
                let text = serde_json::to_string_pretty(&opened.with_head(&value))
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                text + "\n"
            }
            Format::Csv => opened.with_columns(steps_table(list, speed, system)).to_csv(),
            Format::Table => {
                format!("{}\n", opened.head())
                    + &steps_table(list, speed, system).to_text(Coloring::for_stdout())
            }
        };
        self.output.write(&text)
    }
}

/// Kind in which a channel is shown.
fn step_kind(channel: Channel) -> Kind {
    match channel {
        Channel::Roll | Channel::Pitch => Kind::Angle,
        Channel::Yaw => Kind::AngularRate,
        Channel::Heave | Channel::Vx | Channel::Vy => Kind::Velocity,
    }
}

fn steps_table(list: &[SmallStep], speed: f64, system: System) -> Table {
    let title = format!(
        "Small steps at {:.0} {}, flown beside the linear closed loop",
        Kind::Airspeed.from_si(speed, system),
        Kind::Airspeed.symbol(system)
    );
    let digits = Digits::Decimals(2);
    let mut table = Table::new(
        &title,
        vec![
            Column::text("channel"),
            Column::text("unit"),
            Column::number("step", "", Digits::Significant(3)),
            Column::number("RMS apart", "%", digits),
            Column::number("at most", "%", digits),
        ],
    );
    for step in list {
        let kind = step_kind(step.channel);
        table.row([
            Cell::from(step.channel.name()),
            kind.symbol(system).into(),
            kind.from_si(steps::size(step.channel), system).into(),
            (100.0 * step.difference()).into(),
            (100.0 * step.largest_difference()).into(),
        ]);
    }
    table
}

fn steps_figure(list: &[SmallStep], speed: f64, system: System) -> String {
    let panels: Vec<CurvePanel> = list
        .iter()
        .map(|step| {
            let kind = step_kind(step.channel);
            let curve = |name: &str, style, values: &[f64]| Curve {
                name: name.into(),
                style,
                x: step.time.clone(),
                y: values.iter().map(|y| kind.from_si(*y, system)).collect(),
                marks: Marks::Without,
            };
            CurvePanel {
                title: String::new(),
                quantity: step.channel.name().into(),
                unit: kind.symbol(system).into(),
                minimum_span: 0.0,
                curves: vec![curve("flown", 0, &step.flown), curve("linear", 1, &step.linear)],
            }
        })
        .collect();
    let title = format!("Small steps at {}", speed_text(speed, system));
    time_history_figure(&title, 2, &panels).to_svg()
}

fn pairs(m: &Measured, model: &PlantLoop) -> Vec<Pair> {
    let axis = m.axis;
    let channel = Channel::from(axis);
    let mut list: Vec<Pair> = Vec::new();
    let mut add = |quantity, unit, measured: Option<f64>, predicted: Option<f64>| {
        list.push(Pair { axis, quantity, unit, measured, interval: None, predicted });
    };
    let cut = m.cut.coherent();
    let linear = predicted(&cut, |w| model.at(w).cut(channel, Cut::Effector));
    let (flown, linear) = (cut.margins(), linear.margins());
    add("crossover", "rad/s", flown.crossover, linear.crossover);
    let degrees = |x: Option<f64>| x.map(f64::to_degrees);
    add("phase margin", "deg", degrees(flown.phase), degrees(linear.phase));
    let db = |x: Option<f64>| x.map(decibels);
    add("gain margin up", "dB", db(flown.gain_up), db(linear.gain_up));
    add("gain margin down", "dB", db(flown.gain_down), db(linear.gain_down));
    if let Some(c) = &m.command {
        let c = c.coherent();
        let linear = predicted(&c, |w| model.at(w).attitude(axis));
        let (flown, linear) = (c.bandwidth(), linear.bandwidth());
        add("bandwidth", "rad/s", flown.phase_limited, linear.phase_limited);
        add("phase delay", "s", flown.phase_delay, linear.phase_delay);
    }
    if let Some(s) = &m.sensitivity {
        let s = s.coherent();
        let linear = predicted(&s, |w| model.at(w).sensitivity(channel));
        let apart = s.largest_gap(&linear.value, SLOWEST_REJECTION);
        let (flown, linear) = (s.rejection(), linear.rejection());
        add("DRP", "dB", Some(decibels(flown.peak)), Some(decibels(linear.peak)));
        add("|S|, apart at most", "dB", apart, None);
        list.push(Pair {
            axis,
            quantity: "DRB",
            unit: "rad/s",
            measured: flown.bandwidth,
            interval: Some(s.rejection_interval()),
            predicted: linear.bandwidth,
        });
    }
    list
}

/// A prediction where something was measured, so that both see the same
/// crossings.
fn predicted(measured: &Response, exact: impl Fn(f64) -> Complex64) -> Response {
    Response {
        omega: measured.omega.clone(),
        value: measured.omega.iter().map(|&w| exact(w)).collect(),
        coherence: vec![1.0; measured.omega.len()],
        lines: measured.lines.clone(),
    }
}

fn difference(pair: &Pair) -> Option<f64> {
    Some(100.0 * (pair.measured? / pair.predicted? - 1.0))
}

fn as_table(pairs: &[Pair], speed: f64, system: System) -> Table {
    let digits = Digits::Significant(4);
    let title = format!(
        "Measured in flight at {:.0} {}, beside the linear prediction",
        Kind::Airspeed.from_si(speed, system),
        Kind::Airspeed.symbol(system)
    );
    let mut table = Table::new(
        &title,
        vec![
            Column::text("axis"),
            Column::text("quantity"),
            Column::text("unit"),
            Column::number("measured", "", digits),
            Column::number("at least", "", digits),
            Column::number("at most", "", digits),
            Column::number("predicted", "", digits),
            Column::number("difference", "%", Digits::Decimals(1)),
        ],
    );
    for pair in pairs {
        table.row([
            Cell::from(pair.axis.name()),
            pair.quantity.into(),
            pair.unit.into(),
            pair.measured.into(),
            pair.interval.and_then(|[low, _]| low).into(),
            pair.interval.and_then(|[_, high]| high).into(),
            pair.predicted.into(),
            difference(pair).into(),
        ]);
    }
    table
}

fn as_json(pairs: &[Pair], measured: &[Measured], model: &PlantLoop, speed: f64) -> Json {
    let numbers: Vec<Json> = pairs
        .iter()
        .map(|pair| {
            json!({
                "axis": pair.axis.name(),
                "quantity": pair.quantity,
                "unit": pair.unit,
                "measured": pair.measured,
                "measured_interval": pair.interval,
                "predicted": pair.predicted,
                "difference_percent": difference(pair),
            })
        })
        .collect();
    let real = |r: &Response| r.value.iter().map(|v| v.re).collect::<Vec<_>>();
    let imaginary = |r: &Response| r.value.iter().map(|v| v.im).collect::<Vec<_>>();
    let response = |r: &Response, exact: &dyn Fn(f64) -> Complex64| {
        let linear = predicted(r, exact);
        json!({
            "omega_rad_s": r.omega,
            "real": real(r),
            "imaginary": imaginary(r),
            "coherence": r.coherence,
            "standard_error": r.standard_errors().collect::<Vec<_>>(),
            "predicted_real": real(&linear),
            "predicted_imaginary": imaginary(&linear),
        })
    };
    let responses: Vec<Json> = measured
        .iter()
        .map(|m| {
            let channel = Channel::from(m.axis);
            let cut = |w: f64| model.at(w).cut(channel, Cut::Effector);
            let sensitivity = |w: f64| model.at(w).sensitivity(channel);
            let command = |w: f64| model.at(w).attitude(m.axis);
            json!({
                "axis": m.axis.name(),
                "loop": response(&m.cut, &cut),
                "sensitivity": m.sensitivity.as_ref().map(|r| response(r, &sensitivity)),
                "command": m.command.as_ref().map(|r| response(r, &command)),
            })
        })
        .collect();
    json!({
        "schema": "coaxdesign.identification/1",
        "speed_m_s": speed,
        "numbers": numbers,
        "responses": responses,
    })
}

fn figure(measured: &[Measured], model: &PlantLoop, speed: f64, system: System) -> String {
    let channels: Vec<BodeChannel> = measured
        .iter()
        .map(|m| {
            let flown = m.cut.coherent();
            let channel = Channel::from(m.axis);
            let predicted: Vec<Complex64> =
                flown.omega.iter().map(|&w| model.at(w).cut(channel, Cut::Effector)).collect();
            let curve = |name: &str, style, response| FrequencyResponse {
                name: name.into(),
                style,
                frequency: flown.omega.clone(),
                response,
            };
            BodeChannel {
                title: format!("{} loop", m.axis.name()),
                magnitude_unit: "dB".into(),
                valid: None,
                responses: vec![
                    curve("measured in flight", 0, flown.value.clone()),
                    curve("linear prediction", 1, predicted),
                ],
            }
        })
        .collect();
    let title = format!("Loops cut at the sticks, {}", speed_text(speed, system));
    bode_figure(&title, &channels).to_svg()
}
