//! `coaxdesign bode`.

use std::path::PathBuf;

use clap::Args;
use rayon::prelude::*;
use serde_json::{Value as Json, json};

use super::args::{Format, FormatArgs, ModelsArgs, OutputArgs, ProblemArgs, RunArgs, UnitsArgs};
use super::models::{Choice, Flown, Inputs, PointArgs, Reduced, choice_among, fly, on_axis};
use super::quantity::beyond;
use super::trim::{Interactions, on_off};
use super::{CliError, Outcome, output};
use coaxdesign::linear::frequency::{ChannelComparison, compare, log_grid};
use coaxdesign::linear::linearize::linearize;
use coaxdesign::linear::model::{index_of, shown_per_si};
use coaxdesign::linear::reduction::{Method, RIGID_BODY};
use coaxdesign::linear::{LinearError, StateSpace};
use coaxdesign::report::figures::{BodeChannel, FrequencyResponse, bode_figure};
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Table};
use coaxdesign::units::{Kind, System};

/// Most pairs of input and output in one plot.
const MOST_PLOTTED: usize = 6;
/// About this many frequencies are shown in a table.
const TABLE_ROWS: usize = 25;

/// Frequency responses of the linear models of trims
#[derive(Debug, Args)]
pub struct Bode {
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
    #[arg(long, value_enum, default_value = "on")]
    interactions: Interactions,
    /// averaged or harmonic:N
    #[arg(long, value_name = "MODEL", default_value = "averaged", value_parser = model)]
    model: Choice,
    /// Inputs, such as lat,lon [default: with no output either, the one for each of p, q, w and r;
    /// otherwise all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    input: Vec<String>,
    /// Outputs of the model, such as p,q [default: p,q,w,r]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    response: Vec<String>,
    /// Frequencies, FROM:TO in rad/s
    #[arg(long, value_name = "FROM:TO", default_value = "0.1:30", value_parser = range)]
    omega: (f64, f64),
    /// Number of frequencies, equally spaced in their logarithm
    #[arg(long, value_name = "N", default_value = "200",
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    points: u32,
    /// Show the model residualised to u v w p q r phi theta beside the full one
    #[arg(long)]
    reduced: bool,
    /// What moves the model
    #[arg(long, value_enum, default_value = "sticks")]
    inputs: Inputs,
    #[command(flatten)]
    format: FormatArgs,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Plot the responses
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

fn model(text: &str) -> Result<Choice, String> {
    choice_among(
        text,
        |choice| matches!(choice, Choice::Averaged | Choice::Harmonic(_)),
        "averaged, harmonic:N",
    )
}

fn range(text: &str) -> Result<(f64, f64), String> {
    let numbers = text.trim().trim_end_matches("rad/s");
    let bounds = numbers
        .split_once(':')
        .and_then(|(from, to)| Some((from.trim().parse().ok()?, to.trim().parse().ok()?)));
    match bounds {
        Some((from, to)) if from > 0.0 && to > from && f64::is_finite(to) => {
            let beyond = |w| beyond("omega", w, Kind::AngularRate);
            beyond(from).or_else(|| beyond(to)).map_or(Ok((from, to)), Err)
        }
        _ => Err("write two increasing, positive frequencies in rad/s, such as 0.1:30".into()),
    }
}

/// A model and what tells it from the others.
struct Entry {
    /// True airspeed, m/s.
    speed: f64,
    interactions: bool,
    reduced: bool,
    label: String,
    model: StateSpace,
}

/// A pair of input and output in every model.
struct Pair {
    comparison: ChannelComparison,
    /// Shown units of the output per shown unit of the input.
    unit: String,
    /// Shown value of an SI value of 1.
    factor: f64,
}

impl Bode {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        self.output.check()?;
        self.format.of(&self.output)?;
        if let Some(path) = &self.plot {
            self.output.check_plot(path)?;
        }
        self.run.start()?;
        if let Some((set, points)) =
            self.models.points(&self.problem, self.spec.as_deref(), &self.point, self.run.quiet)?
        {
            let entries: Vec<Entry> = points
                .iter()
                .map(|point| {
                    let m = &point.model;
                    // Every state may be looked at.
                    let model = StateSpace::with_state_outputs(
                        m.states().to_vec(),
                        m.inputs().to_vec(),
                        m.a().clone(),
                        m.b().clone(),
                    )?;
                    Ok(Entry {
                        speed: point.speed,
                        interactions: false,
                        reduced: false,
                        label: point.label.clone(),
                        model,
                    })
                })
                .collect::<Result<_, LinearError>>()?;
            return self.show(&set.name, &entries, self.units.of(None));
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
        let options = self.inputs.options();
        let cases: Vec<(usize, &Flown)> =
            (0..conditions.len()).flat_map(|k| flown.iter().map(move |flown| (k, flown))).collect();
        let full: Vec<StateSpace> = cases
            .par_iter()
            .map(|(k, flown)| {
                let periodic = linearize(&flown.vehicle, &flown.sweeps[0][*k], &options)?.model;
                self.model.of(&periodic)
            })
            .collect::<Result<_, LinearError>>()?;
        let mut entries = Vec::new();
        for (model, (k, flown)) in full.into_iter().zip(cases) {
            let speed = conditions[k].horizontal_speed();
            let mut word = format!("interactions {}", on_off(flown.interactions));
            if conditions.len() > 1 {
                word = format!("{}, {word}", speed_text(speed, system));
            }
            let reduced = if self.reduced {
                let keep = RIGID_BODY.map(str::to_owned);
                Some(Reduced::new(&model, Method::Residualise, &keep)?)
            } else {
                None
            };
            if let (Some(reduced), false) = (&reduced, self.run.quiet) {
                output::note(&format!("{word}: {}", reduced.summary(&model)));
            }
            let entry = |reduced: bool, model| Entry {
                speed,
                interactions: flown.interactions,
                reduced,
                label: if reduced { format!("{word}, reduced") } else { word.clone() },
                model,
            };
            entries.push(entry(false, model));
            if let Some(reduced) = reduced {
                entries.push(entry(true, reduced.model));
            }
        }
        self.show(&problem.name, &entries, system)
    }

    /// Responses of the models asked for.
    fn show(&self, name: &str, entries: &[Entry], system: System) -> Result<Outcome, CliError> {
        let (from, to) = self.omega;
        let omega = log_grid(from, to, self.points as usize)?;
        let named = self.pairs(&entries[0].model)?;
        if self.plot.is_some() && named.len() > MOST_PLOTTED {
            return Err(CliError::Usage {
                message: format!("{} pairs of input and output do not fit a plot", named.len()),
                help: format!("choose at most {MOST_PLOTTED} by --input and --response"),
            });
        }
        let labelled: Vec<(&str, &StateSpace)> =
            entries.iter().map(|e| (e.label.as_str(), &e.model)).collect();
        let pairs: Vec<Pair> = named
            .par_iter()
            .map(|(input, output)| {
                let comparison = compare(&labelled, input, output, &omega)?;
                let first = &entries[0].model;
                let kind_in = first.inputs()[index_of(first.inputs(), "input", input)?].kind;
                let kind_out = first.outputs()[index_of(first.outputs(), "output", output)?].kind;
                Ok(Pair {
                    comparison,
                    unit: quotient(kind_out, kind_in, system),
                    factor: shown_per_si(kind_out, system) / shown_per_si(kind_in, system),
                })
            })
            .collect::<Result<_, LinearError>>()?;
        let first = entries[0].speed;
        let title = if entries.iter().all(|entry| entry.speed == first) {
            format!("{name}: {} at {}", self.model.label(), speed_text(first, system))
        } else {
            format!("{name}: {} over speed", self.model.label())
        };
        if let Some(path) = &self.plot {
            let svg = figure(&title, entries, &pairs).to_svg();
            self.output.write_plot(path, &svg)?;
        }
        let text = match self.format.of(&self.output)? {
            Format::Table => tables(&title, &pairs),
            Format::Csv => csv(entries, &pairs, system),
            Format::Json => json_text(name, system, self.model, entries, &pairs)?,
        };
        self.output.write(&text)
    }

    /// The pairs asked for, by name.
    fn pairs(&self, model: &StateSpace) -> Result<Vec<(String, String)>, CliError> {
        if self.input.is_empty() && self.response.is_empty() {
            return Ok(on_axis(model)?);
        }
        let inputs: Vec<String> = if self.input.is_empty() {
            model.inputs().iter().map(|c| c.name.clone()).collect()
        } else {
            self.input.clone()
        };
        let outputs: Vec<String> = if self.response.is_empty() {
            ["p", "q", "w", "r"].map(str::to_owned).to_vec()
        } else {
            self.response.clone()
        };
        for name in &inputs {
            model.input(name)?;
        }
        for name in &outputs {
            model.output(name)?;
        }
        Ok(inputs
            .iter()
            .flat_map(|input| outputs.iter().map(move |output| (input.clone(), output.clone())))
            .collect())
    }
}

/// A speed in a title, from m/s.
pub(super) fn speed_text(speed: f64, system: System) -> String {
    let shown = Kind::Airspeed.from_si(speed, system);
    let unit = Kind::Airspeed.symbol(system);
    format!("{} {unit}", output::significant((shown * 1e6).round() / 1e6, 6))
}

/// A speed in JSON: its key, which says the unit, and its value, from m/s.
pub(super) fn speed_key(speed: f64, system: System) -> (&'static str, f64) {
    let key = match system {
        System::Us => "speed_kt",
        System::Si => "speed_m_s",
    };
    (key, Kind::Airspeed.from_si(speed, system))
}

/// Unit of `over` per `under`, for people.
pub(super) fn quotient(over: Kind, under: Kind, system: System) -> String {
    let bracketed = |kind: Kind| match kind.symbol(system) {
        "-" => "1".to_owned(),
        symbol if symbol.contains('/') => format!("({symbol})"),
        symbol => symbol.to_owned(),
    };
    format!("{}/{}", bracketed(over), bracketed(under))
}

fn decibel(value: f64) -> f64 {
    20.0 * value.log10()
}

fn figure(title: &str, entries: &[Entry], pairs: &[Pair]) -> coaxdesign::report::plot::Figure {
    let single = entries.iter().all(|entry| entry.speed == entries[0].speed);
    let channels: Vec<BodeChannel> = pairs
        .iter()
        .map(|pair| BodeChannel {
            title: format!("{} to {}", pair.comparison.input, pair.comparison.output),
            magnitude_unit: format!("dB re {}", pair.unit),
            valid: None,
            responses: pair
                .comparison
                .curves
                .iter()
                .zip(entries)
                .enumerate()
                .map(|(k, ((label, bode), entry))| FrequencyResponse {
                    name: label.clone(),
                    // Speeds differ in their hue, then models in hue and dash.
                    style: if single {
                        usize::from(!entry.interactions) + 2 * usize::from(entry.reduced)
                    } else {
                        k
                    },
                    frequency: bode.omega.clone(),
                    response: bode
                        .gain
                        .iter()
                        .zip(&bode.phase)
                        .map(|(gain, phase)| {
                            num_complex::Complex64::from_polar(gain * pair.factor, *phase)
                        })
                        .collect(),
                })
                .collect(),
        })
        .collect();
    bode_figure(title, &channels)
}

fn tables(title: &str, pairs: &[Pair]) -> String {
    let mut text = format!("{title}\n");
    for pair in pairs {
        let curves = &pair.comparison.curves;
        let mut columns = vec![Column::number("frequency", "rad/s", Digits::Significant(4))];
        for (label, _) in curves {
            columns.push(Column::number(
                label,
                &format!("dB re {}", pair.unit),
                Digits::Decimals(2),
            ));
            columns.push(Column::number("phase", "deg", Digits::Decimals(1)));
        }
        let mut table = Table::new(
            &format!("{} to {}", pair.comparison.input, pair.comparison.output),
            columns,
        );
        let count = curves.first().map_or(0, |(_, bode)| bode.omega.len());
        let every = count.div_ceil(TABLE_ROWS).max(1);
        for k in (0..count).filter(|k| k % every == 0 || k + 1 == count) {
            let mut cells = vec![Cell::from(curves[0].1.omega[k])];
            for (_, bode) in curves {
                cells.push(Cell::from(decibel(bode.gain[k] * pair.factor)));
                cells.push(Cell::from(bode.phase[k].to_degrees()));
            }
            table.row(cells);
        }
        text += "\n";
        text += &table.to_text(Coloring::for_stdout());
    }
    text
}

fn csv(entries: &[Entry], pairs: &[Pair], system: System) -> String {
    let mut table = Table::new(
        "",
        vec![
            Column::number("speed", Kind::Airspeed.symbol(system), Digits::Significant(6)),
            Column::text("interactions"),
            Column::text("reduced"),
            Column::text("input"),
            Column::text("output"),
            Column::number("omega", "rad/s", Digits::Significant(6)),
            Column::number("magnitude", "", Digits::Significant(6)),
            Column::text("unit"),
            Column::number("magnitude", "dB", Digits::Significant(6)),
            Column::number("phase", "deg", Digits::Significant(6)),
        ],
    );
    for pair in pairs {
        for ((_, bode), entry) in pair.comparison.curves.iter().zip(entries) {
            for ((omega, gain), phase) in bode.omega.iter().zip(&bode.gain).zip(&bode.phase) {
                let gain = gain * pair.factor;
                table.row([
                    Cell::from(Kind::Airspeed.from_si(entry.speed, system)),
                    Cell::from(on_off(entry.interactions)),
                    Cell::from(if entry.reduced { "yes" } else { "no" }),
                    Cell::from(pair.comparison.input.as_str()),
                    Cell::from(pair.comparison.output.as_str()),
                    Cell::from(*omega),
                    Cell::from(gain),
                    Cell::from(pair.unit.as_str()),
                    Cell::from(decibel(gain)),
                    Cell::from(phase.to_degrees()),
                ]);
            }
        }
    }
    table.to_csv()
}

fn json_text(
    name: &str,
    system: System,
    model: Choice,
    entries: &[Entry],
    pairs: &[Pair],
) -> Result<String, CliError> {
    let omega = pairs
        .first()
        .and_then(|pair| pair.comparison.curves.first())
        .map_or(&[][..], |(_, bode)| bode.omega.as_slice());
    let mut responses: Vec<Json> = Vec::new();
    for pair in pairs {
        for ((_, bode), entry) in pair.comparison.curves.iter().zip(entries) {
            let magnitude: Vec<f64> = bode.gain.iter().map(|gain| gain * pair.factor).collect();
            let phase: Vec<f64> = bode.phase.iter().map(|phase| phase.to_degrees()).collect();
            let (key, speed) = speed_key(entry.speed, system);
            responses.push(json!({
                key: speed,
                "interactions": entry.interactions,
                "reduced": entry.reduced,
                "input": pair.comparison.input,
                "output": pair.comparison.output,
                "unit": pair.unit,
                "magnitude": magnitude,
                "phase_deg": phase,
            }));
        }
    }
    let all = json!({
        "schema": "coaxdesign.frequency-response/2",
        "name": name,
        "model": model.label(),
        "omega_rad_per_s": omega,
        "responses": responses,
    });
    serde_json::to_string_pretty(&all)
        .map(|text| text + "\n")
        .map_err(|error| CliError::Internal(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frequency() {
        assert_eq!(range("0.1:30"), Ok((0.1, 30.0)));
        assert_eq!(range("0.1 : 30 rad/s"), Ok((0.1, 30.0)));
        for bad in ["", "1", "0:3", "3:1", "1:x", "1:inf", "1:2:3"] {
            assert!(range(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn units_of_a_response() {
        let of = |out, input| quotient(out, input, System::Us);
        assert_eq!(of(Kind::AngularRateRad, Kind::Percent), "(rad/s)/%");
        assert_eq!(of(Kind::AngleRad, Kind::AngleRad), "rad/rad");
    }
}
