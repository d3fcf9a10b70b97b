//! `coaxdesign identify`.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use num_complex::Complex64;
use serde_json::{Value as Json, json};

use super::args::{Format, FormatArgs, OutputArgs, ProblemArgs, RunArgs};
use super::fly::load_schedule;
use super::trim::parse_speeds;
use super::{CliError, Outcome, output};
use crate::control::axis::{Axis, Channel, GainSet};
use crate::control::loops::{Cut, LoopModel};
use crate::control::metrics::{self, Sampled, decibels};
use crate::control::models::{airframe, from_state_space};
use crate::control::spec;
use crate::control::tuning::default_grid;
use crate::control::verify::inner_only;
use crate::linear::linearize::{self, averaged};
use crate::report::figures::{BodeChannel, FrequencyResponse, bode_figure};
use crate::report::table::{Cell, Coloring, Column, Digits, Table};
use crate::simulate::Options;
use crate::simulate::flight::Autopilot;
use crate::simulate::identify::{Measured, Response, Sweep, measure_axes};
use crate::trim::{FlightCondition, Options as TrimOptions, sweep};
use crate::units::{Kind, System};
use crate::vehicle::Vehicle;

/// Measure margins and bandwidths of a schedule in simulated flight, beside the linear predictions
///
/// The full nonlinear vehicle flies frequency sweeps at attitude hold; ratios of spectra give the
/// loop at each stick, the sensitivity and the command response. The predictions are those that
/// `verify` works with, outer loops open.
#[derive(Debug, Args)]
pub struct Identify {
    /// Schedule file, or a directory with a schedule.json
    #[arg(value_name = "DESIGN")]
    design: PathBuf,
    #[command(flatten)]
    problem: ProblemArgs,
    /// True airspeed, such as "40 kt"
    #[arg(long, value_name = "SPEED", default_value = "0 kt")]
    speed: String,
    /// Plot measured and predicted loops to an SVG file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    run: RunArgs,
}

/// A number measured in flight beside its prediction.
struct Pair {
    axis: Axis,
    quantity: &'static str,
    unit: &'static str,
    measured: Option<f64>,
    predicted: Option<f64>,
}

impl Identify {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.run.start()?;
        self.output.check()?;
        if let Some(plot) = &self.plot {
            self.output.check_path(plot)?;
        }
        let speeds = parse_speeds(&self.speed)?;
        let [speed] = speeds[..] else {
            return Err(CliError::Usage {
                message: format!("--speed {:?}: it is more than one speed", self.speed),
                help: "write one speed with its unit, such as --speed \"40 kt\"".into(),
            });
        };
        let loaded = self.problem.load_with_warnings(self.run.quiet)?;
        let schedule = load_schedule(&self.design)?;
        let table = schedule.law().map_err(|error| CliError::Usage {
            message: error.to_string(),
            help: "a schedule is written by `coaxdesign tune-gains -o DIR`".into(),
        })?;
        let vehicle = Vehicle::new(&loaded.problem)?;
        let condition = FlightCondition::level(speed);
        let mut found = sweep(&vehicle, &[condition], &TrimOptions::default(), |_| {});
        let Some(Ok(start)) = found.points.pop().map(|point| point.into_converged()) else {
            return Err(CliError::Missed("no trim to start from".into()));
        };
        let full = averaged(&vehicle, &start, &linearize::Options::default())?;
        let plant = from_state_space(&full, speed, airframe(start.point()))?;
        let grid: Arc<[f64]> = default_grid(0.01, 100.0, 900).into();
        let point = table.at(speed);
        let model =
            LoopModel::new(&plant, &point.inversion, &table.settings, schedule.hardware, 0.0, grid)
                .map_err(|error| CliError::Missed(error.to_string()))?;
        let gains = inner_only(&point.gains);
        let law = Autopilot { table, stick_limits: schedule.stick_limits };
        let options = Options::new(schedule.hardware, spec::builtin()?.pitch_rate_limit);
        let measured =
            measure_axes(&vehicle, &start, &law, &options, &Sweep::default(), &Axis::ALL)
                .map_err(|error| CliError::Missed(error.to_string()))?;
        let pairs: Vec<Pair> = measured.iter().flat_map(|m| pairs(m, &model, &gains)).collect();
        if let Some(path) = &self.plot {
            let svg = figure(&measured, &model, &gains, speed);
            output::write_whole(path, svg.as_bytes(), self.output.force)?;
        }
        let text = match self.format.format {
            Format::Json => {
                let text = serde_json::to_string_pretty(&as_json(&pairs, &measured, speed))
                    .map_err(|error| CliError::Internal(error.to_string()))?;
                text + "\n"
            }
            Format::Csv => as_table(&pairs, speed).to_csv(),
            Format::Table => as_table(&pairs, speed).to_text(Coloring::for_stdout()),
        };
        self.output.write(&text)
    }
}

fn pairs(m: &Measured, model: &LoopModel, gains: &GainSet) -> Vec<Pair> {
    let axis = m.axis;
    let channel = Channel::from(axis);
    let mut list = Vec::new();
    let mut add = |quantity, unit, measured: Option<f64>, predicted: Option<f64>| {
        list.push(Pair { axis, quantity, unit, measured, predicted });
    };
    // Predicted where it was measured, so that both see the same crossings.
    let predict = |response: &Response, exact: &dyn Fn(f64) -> Complex64| -> Response {
        Response {
            omega: response.omega.clone(),
            value: response.omega.iter().map(|&w| exact(w)).collect(),
            coherence: vec![1.0; response.omega.len()],
        }
    };
    let cut = m.cut.coherent();
    let loop_at = |w: f64| model.loop_at(gains, channel, Cut::Effector, w);
    let (flown, linear) = (cut.margins(), predict(&cut, &loop_at).margins());
    add("crossover", "rad/s", flown.crossover, linear.crossover);
    let degrees = |x: Option<f64>| x.map(f64::to_degrees);
    add("phase margin", "deg", degrees(flown.phase), degrees(linear.phase));
    let db = |x: Option<f64>| x.map(decibels);
    add("gain margin up", "dB", db(flown.gain_up), db(linear.gain_up));
    add("gain margin down", "dB", db(flown.gain_down), db(linear.gain_down));
    if let Some(s) = &m.sensitivity {
        let s = s.coherent();
        let exact = |w: f64| model.sensitivity_at(gains, channel, w);
        let flown = s.rejection();
        let values = predict(&s, &exact);
        let linear = metrics::rejection(Sampled::new(&values.omega, &values.value));
        // A sweep that begins above the lowest frequency still finds the
        // crossing, if it is rejected there.
        add("DRB", "rad/s", flown.bandwidth, linear.bandwidth);
        add("DRP", "dB", Some(decibels(flown.peak)), Some(decibels(linear.peak)));
    }
    if let Some(c) = &m.command {
        let c = c.coherent();
        let exact = |w: f64| model.attitude_response_at(gains, axis, w);
        let (flown, linear) = (c.bandwidth(), predict(&c, &exact).bandwidth());
        add("bandwidth", "rad/s", flown.phase_limited, linear.phase_limited);
        add("phase delay", "s", flown.phase_delay, linear.phase_delay);
    }
    list
}

fn difference(pair: &Pair) -> Option<f64> {
    Some(100.0 * (pair.measured? / pair.predicted? - 1.0))
}

fn as_table(pairs: &[Pair], speed: f64) -> Table {
    let digits = Digits::Significant(4);
    let title = format!(
        "Measured in flight at {:.0} kt, beside the linear prediction",
        Kind::Airspeed.from_si(speed, System::Us)
    );
    let mut table = Table::new(
        &title,
        vec![
            Column::text("axis"),
            Column::text("quantity"),
            Column::text("unit"),
            Column::number("measured", "", digits),
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
            pair.predicted.into(),
            difference(pair).into(),
        ]);
    }
    table
}

fn as_json(pairs: &[Pair], measured: &[Measured], speed: f64) -> Json {
    let numbers: Vec<Json> = pairs
        .iter()
        .map(|pair| {
            json!({
                "axis": pair.axis.name(),
                "quantity": pair.quantity,
                "unit": pair.unit,
                "measured": pair.measured,
                "predicted": pair.predicted,
                "difference_percent": difference(pair),
            })
        })
        .collect();
    let response = |r: &Response| {
        json!({
            "omega_rad_s": r.omega,
            "real": r.value.iter().map(|v| v.re).collect::<Vec<_>>(),
            "imaginary": r.value.iter().map(|v| v.im).collect::<Vec<_>>(),
            "coherence": r.coherence,
        })
    };
    let responses: Vec<Json> = measured
        .iter()
        .map(|m| {
            json!({
                "axis": m.axis.name(),
                "loop": response(&m.cut),
                "sensitivity": m.sensitivity.as_ref().map(response),
                "command": m.command.as_ref().map(response),
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

fn figure(measured: &[Measured], model: &LoopModel, gains: &GainSet, speed: f64) -> String {
    let channels: Vec<BodeChannel> = measured
        .iter()
        .map(|m| {
            let flown = m.cut.coherent();
            let channel = Channel::from(m.axis);
            let predicted: Vec<Complex64> = flown
                .omega
                .iter()
                .map(|&w| model.loop_at(gains, channel, Cut::Effector, w))
                .collect();
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
    let title =
        format!("Loops cut at the sticks, {:.0} kt", Kind::Airspeed.from_si(speed, System::Us));
    bode_figure(&title, &channels).to_svg()
}
