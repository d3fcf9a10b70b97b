//! `coaxdesign rotor`.

use clap::Args;
use serde_json::{Map, Value as Json, json};
use std::path::PathBuf;

use super::args::{Format, FormatArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::quantity::beyond;
use super::{CliError, Outcome, output};
use coaxdesign::problem::Problem;
use coaxdesign::report::plot::{Axis, Figure, Panel, Series};
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::trim::stand::{Flow, Load, Stand, StandError, StandPoint};
use coaxdesign::units::{Kind, System, parse_quantity};

/// Trim one rotor alone on a stand: hover polars, climb, wind tunnel
#[derive(Debug, Args)]
pub struct Rotor {
    #[command(flatten)]
    problem: ProblemArgs,
    /// Rotor to put on the stand [default: the first of the file]
    #[arg(long, value_name = "NAME")]
    rotor: Option<String>,
    #[command(flatten)]
    load: LoadArgs,
    /// Speed of the air across the shaft, such as "60 kt"
    #[arg(long, value_name = "SPEED", allow_hyphen_values = true)]
    edgewise: Option<String>,
    /// Speed of the air down the shaft as in a climb, such as "5 m/s"
    #[arg(long, value_name = "SPEED", allow_hyphen_values = true)]
    axial: Option<String>,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Plot the polars to an SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

/// What the collective is trimmed to: one of the three.
#[derive(Debug, Clone, Args)]
#[group(required = true, multiple = false)]
struct LoadArgs {
    /// Thrust coefficients T/(ρπR²(ΩR)²): FIRST:LAST:STEP, a list, or one
    #[arg(long, value_name = "VALUES", allow_hyphen_values = true)]
    ct: Option<String>,
    /// Thrusts, such as "100:600:100 lbf"
    #[arg(long, value_name = "VALUES", allow_hyphen_values = true)]
    thrust: Option<String>,
    /// Torques, such as "200,300 lbf ft"
    #[arg(long, value_name = "VALUES", allow_hyphen_values = true)]
    torque: Option<String>,
}

/// Most points of one run.
const MOST_POINTS: usize = 1000;

/// Values of a range, a list or one, with the unit behind the last number.
fn values(flag: &str, text: &str, kind: Kind) -> Result<Vec<f64>, CliError> {
    let usage = |message: String| CliError::Usage {
        message: format!("--{flag} {text:?}: {message}"),
        help: match kind {
            Kind::Dimensionless => {
                "write --ct 0.002:0.010:0.001, --ct 0.004,0.006 or --ct 0.005".into()
            }
            _ => format!("write --{flag} \"FIRST:LAST:STEP UNIT\", \"A,B,C UNIT\" or \"A UNIT\""),
        },
    };
    let trimmed = text.trim();
    let split = trimmed.rfind(|c: char| c.is_ascii_digit() || c == '.').map_or(0, |last| last + 1);
    let (numbers, unit) = trimmed.split_at(split);
    let value = |number: &str| -> Result<f64, CliError> {
        let quantity = format!("{} {}", number.trim(), unit.trim());
        let value =
            parse_quantity(quantity.trim(), kind).map_err(|error| usage(error.to_string()))?;
        match beyond(flag, value, kind) {
            None => Ok(value),
            Some(bounds) => Err(usage(bounds)),
        }
    };
    match numbers.split(':').collect::<Vec<_>>().as_slice() {
        [list] => list.split(',').map(value).collect(),
        [first, last, step] => {
            let (first, last, step) = (value(first)?, value(last)?, value(step)?);
            if step <= 0.0 || last < first {
                return Err(usage("a range rises by a positive step".into()));
            }
            let count = ((last - first) / step + 1e-9).floor();
            if count >= MOST_POINTS as f64 {
                return Err(usage(format!("more than {MOST_POINTS} points")));
            }
            Ok((0..=count as usize).map(|k| first + k as f64 * step).collect())
        }
        _ => Err(usage("a range has three parts, FIRST:LAST:STEP".into())),
    }
}

/// A load that is asked for, in words.
fn asked(load: Load, system: System) -> String {
    let shown = |value: f64, kind: Kind| {
        format!("{:.1} {}", kind.from_si(value, system), kind.symbol(system))
    };
    match load {
        Load::ThrustCoefficient(value) => format!("C_T {value:.5}"),
        Load::Thrust(value) => format!("thrust {}", shown(value, Kind::Force)),
        Load::Torque(value) => format!("torque {}", shown(value, Kind::Moment)),
    }
}

impl LoadArgs {
    fn loads(&self) -> Result<Vec<Load>, CliError> {
        let of = |flag: &str, text: &str, kind: Kind, load: fn(f64) -> Load| {
            Ok(values(flag, text, kind)?.into_iter().map(load).collect())
        };
        match (&self.ct, &self.thrust, &self.torque) {
            (Some(text), _, _) => of("ct", text, Kind::Dimensionless, Load::ThrustCoefficient),
            (_, Some(text), _) => of("thrust", text, Kind::Force, Load::Thrust),
            (_, _, Some(text)) => of("torque", text, Kind::Moment, Load::Torque),
            _ => Err(CliError::Usage {
                message: "there is no load to trim to".into(),
                help: "give --ct, --thrust or --torque".into(),
            }),
        }
    }
}

impl Rotor {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        use rayon::prelude::*;
        self.output.check()?;
        if let Some(path) = &self.plot {
            self.output.check_path(path)?;
        }
        self.run.start()?;
        let loaded = self.problem.load_with_warnings(self.run.quiet)?;
        let problem = &loaded.problem;
        let index = self.index(problem)?;
        let loads = self.load.loads()?;
        let speed = |flag: &str, text: &Option<String>| -> Result<f64, CliError> {
            let speeds =
                text.as_deref().map(|text| values(flag, text, Kind::Airspeed)).transpose()?;
            match speeds.as_deref() {
                None => Ok(0.0),
                Some([one]) => Ok(*one),
                Some(_) => Err(CliError::Usage {
                    message: format!("--{flag}: one speed is needed"),
                    help: format!("write --{flag} \"20 kt\""),
                }),
            }
        };
        let flow = Flow {
            edgewise: speed("edgewise", &self.edgewise)?,
            axial: speed("axial", &self.axial)?,
        };
        let stand = Stand::new(problem, index).map_err(|error| match error {
            StandError::Vehicle(error) => CliError::from(error),
            StandError::NoBlades { .. } => CliError::Usage {
                message: error.to_string(),
                help: "choose a rotor with blades by --rotor NAME".into(),
            },
        })?;
        let points: Vec<StandPoint> =
            loads.par_iter().map(|&load| stand.trim(load, flow)).collect();
        let name = &problem.rotors[index].name;
        let system = self.units.of(Some(problem));
        let title = format!("{}: rotor {name} on a stand", problem.name);
        let text = match self.format.of(&self.output)? {
            Format::Table => table(&title, &points, system).to_text(Coloring::for_stdout()),
            Format::Csv => table(&title, &points, system).to_csv(),
            Format::Json => json_text(&problem.name, name, &points)?,
        };
        if let Some(path) = &self.plot {
            let svg = figure(&title, &points).to_svg();
            self.output.write_plot(path, &svg)?;
        }
        self.output.write(&text)?;
        let mut failed = false;
        for (point, load) in points.iter().zip(&loads) {
            if let Some(failure) = &point.failure {
                failed = true;
                output::note(&format!("{}: no trim: {failure}\n", asked(*load, system)));
            }
        }
        Ok(if failed { Outcome::GoalMissed } else { Outcome::Done })
    }

    fn index(&self, problem: &Problem) -> Result<usize, CliError> {
        let Some(name) = &self.rotor else { return Ok(0) };
        problem.rotors.iter().position(|rotor| rotor.name == *name).ok_or_else(|| {
            let names: Vec<&str> = problem.rotors.iter().map(|rotor| rotor.name.as_str()).collect();
            CliError::Usage {
                message: format!("--rotor {name:?}: the problem has no such rotor"),
                help: format!("its rotors are {}", names.join(", ")),
            }
        })
    }
}

fn table(title: &str, points: &[StandPoint], system: System) -> Table {
    let of = |name: &str, kind: Kind, digits| Column::number(name, kind.symbol(system), digits);
    let mut table = Table::new(
        title,
        vec![
            Column::number("C_T", "", Digits::Decimals(5)),
            Column::number("C_T/σ", "", Digits::Decimals(4)),
            Column::number("θ_0", "deg", Digits::Decimals(3)),
            Column::number("θ_1c", "deg", Digits::Decimals(3)),
            Column::number("θ_1s", "deg", Digits::Decimals(3)),
            of("thrust", Kind::Force, Digits::Decimals(1)),
            of("torque", Kind::Moment, Digits::Decimals(1)),
            of("power", Kind::Power, Digits::Decimals(2)),
            Column::number("C_P", "", Digits::Significant(4)),
            Column::number("FM", "", Digits::Decimals(4)),
            Column::number("λ_0", "", Digits::Decimals(5)),
            Column::number("profile", "%", Digits::Decimals(1)),
            Column::number("induced", "%", Digits::Decimals(1)),
            Column::text("flow"),
            Column::text("status"),
        ],
    );
    for p in points {
        let status = if p.failure.is_none() {
            Cell::from("converged")
        } else {
            Cell::from("failed").highlight(Highlight::Bad)
        };
        table.row([
            Cell::from(p.thrust_coefficient),
            Cell::from(p.blade_loading),
            Cell::from(p.pitch[0].to_degrees()),
            Cell::from(p.pitch[1].to_degrees()),
            Cell::from(p.pitch[2].to_degrees()),
            Cell::from(Kind::Force.from_si(p.thrust, system)),
            Cell::from(Kind::Moment.from_si(p.torque, system)),
            Cell::from(Kind::Power.from_si(p.power, system)),
            Cell::from(p.power_coefficient),
            p.figure_of_merit.map_or_else(Cell::empty, Cell::from),
            Cell::from(p.inflow[0]),
            Cell::from(100.0 * p.profile_power / p.power),
            Cell::from(100.0 * p.induced_power / p.power),
            Cell::from(p.flow_state.word()),
            status,
        ]);
    }
    table
}

fn json_text(problem: &str, rotor: &str, points: &[StandPoint]) -> Result<String, CliError> {
    let points: Vec<Json> = points
        .iter()
        .map(|p| {
            let mut object = Map::new();
            let mut put = |key: &str, value: Json| {
                object.insert(key.into(), value);
            };
            put("status", json!(if p.failure.is_none() { "converged" } else { "failed" }));
            if let Some(failure) = &p.failure {
                put("failure", json!(failure));
            }
            put("edgewise_m_s", json!(p.flow.edgewise));
            put("axial_m_s", json!(p.flow.axial));
            put("c_t", json!(p.thrust_coefficient));
            put("c_p", json!(p.power_coefficient));
            put("c_t_over_solidity", json!(p.blade_loading));
            put("figure_of_merit", json!(p.figure_of_merit));
            put("pitch_rad", json!(p.pitch));
            put("flapping_rad", json!(p.flapping));
            put("inflow", json!(p.inflow));
            put("thrust_n", json!(p.thrust));
            put("torque_n_m", json!(p.torque));
            put("power_w", json!(p.power));
            put("profile_power_w", json!(p.profile_power));
            put("induced_power_w", json!(p.induced_power));
            put("flow_state", json!(p.flow_state.word()));
            put("residual_norm", json!(p.residual_norm));
            Json::Object(object)
        })
        .collect();
    let document = json!({
        "schema": "coaxdesign.rotor/1",
        "problem": problem,
        "rotor": rotor,
        "version": env!("CARGO_PKG_VERSION"),
        "points": points,
    });
    serde_json::to_string_pretty(&document)
        .map(|text| text + "\n")
        .map_err(|error| CliError::Internal(error.to_string()))
}

/// The polars: power, figure of merit and collective over the load.
fn figure(title: &str, points: &[StandPoint]) -> Figure {
    let good: Vec<&StandPoint> = points.iter().filter(|p| p.failure.is_none()).collect();
    let list = |pick: &dyn Fn(&StandPoint) -> f64| -> Vec<f64> {
        good.iter().map(|point| pick(point)).collect()
    };
    let loading = list(&|p| p.blade_loading);
    let x = || Axis::linear("C_{T}/σ", "");
    let line = |name: &str, values: Vec<f64>| Series::new(name, &loading, &values).marks();
    // One line in a panel is named by its axis.
    let alone = |values: Vec<f64>| line("", values);
    let mut figure = Figure::new(title)
        .columns(3)
        .panel(
            Panel::new(x(), Axis::linear("C_{P}", ""))
                .line(line("power", list(&|p| p.power_coefficient)))
                .line(
                    line("profile", list(&|p| p.power_coefficient * p.profile_power / p.power))
                        .style(1),
                )
                .line(
                    line("induced", list(&|p| p.power_coefficient * p.induced_power / p.power))
                        .style(2),
                ),
        )
        .panel(
            Panel::new(x(), Axis::linear("collective", "deg"))
                .line(alone(list(&|p| p.pitch[0].to_degrees()))),
        );
    if good.iter().any(|p| p.figure_of_merit.is_some()) {
        figure = figure.panel(
            Panel::new(x(), Axis::linear("figure of merit", ""))
                .line(alone(list(&|p| p.figure_of_merit.unwrap_or(f64::NAN)))),
        );
    }
    figure
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_in_every_form() {
        let loads = values("ct", "0.002:0.010:0.001", Kind::Dimensionless).unwrap();
        assert_eq!(loads.len(), 9);
        assert!((loads[8] - 0.010).abs() < 1e-15);
        assert_eq!(values("ct", "0.004,0.005", Kind::Dimensionless).unwrap(), [0.004, 0.005]);
        let thrusts = values("thrust", "100:300:100 N", Kind::Force).unwrap();
        assert_eq!(thrusts, [100.0, 200.0, 300.0]);
        for bad in ["", "x", "0.01:0.002:0.001", "0.002:0.01", "0:1:1e-9"] {
            assert!(values("ct", bad, Kind::Dimensionless).is_err(), "{bad}");
        }
        assert!(values("thrust", "100", Kind::Force).is_err());
    }
}
