//! `coaxdesign linearize`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::args::{FileForm, OutputArgs, ProblemArgs, RunArgs, UnitsArgs, form_of};
use super::bode::speed_text;
use super::models::{
    Choice, Flown, Inputs, PointArgs, ReduceArgs, Reduced, bands, choice_among,
    compared_frequencies, fly, on_axis, trust,
};
use super::trim::{Interactions, on_off};
use super::{CliError, Outcome, output};
use coaxdesign::linear::dense::balance;
use coaxdesign::linear::floquet::{
    AveragingError, Floquet, FloquetOptions, analyse, averaging_error,
};
use coaxdesign::linear::frequency::{ErrorOptions, compare};
use coaxdesign::linear::io::{
    ModelRecord, periodic_to_json, periodic_to_mat, set_to_json, set_to_mat, to_csv, to_json,
    to_mat,
};
use coaxdesign::linear::linearize::{Linearization, linearize, trim_values};
use coaxdesign::linear::model::FourierMatrix;
use coaxdesign::linear::reduction::RIGID_BODY;
use coaxdesign::linear::set::{
    Interpolation, MidpointCheck, ModelSet, TrimValues, check_interpolation,
};
use coaxdesign::linear::{Channel, LinearError, PeriodicModel, StateSpace};
use coaxdesign::problem::Problem;
use coaxdesign::report::figures::{
    BodeChannel, Curve, CurvePanel, FrequencyResponse, Marks, bode_figure, gain_schedule_figure,
};
use coaxdesign::report::plot::Figure;
use coaxdesign::report::table::{Cell, Coloring, Column, Digits, Highlight, Table};
use coaxdesign::trim::{ConvergedTrim, FlightCondition};
use coaxdesign::units::{Kind, System};

/// Columns of a matrix side by side in a table.
const TABLE_COLUMNS: usize = 8;
/// Harmonics of the periodic model shown in a table.
const HARMONICS_SHOWN: usize = 8;
/// Harmonics that the averaged model is compared with by `--floquet`.
const HARMONICS_COMPARED: usize = 4;
/// Exponents shown by `--floquet`: the slowest.
const EXPONENTS_SHOWN: usize = 8;
/// Frequencies at which the error of a reduction is shown, rad/s.
const ERROR_SHOWN: [f64; 7] = [0.1, 0.3, 1.0, 3.0, 5.0, 10.0, 20.0];

/// Entries shown over speed: name, row, column.
const DERIVATIVES: [(&str, &str, &str); 15] = [
    ("X_u", "u", "u"),
    ("Z_u", "w", "u"),
    ("M_u", "q", "u"),
    ("Z_w", "w", "w"),
    ("M_w", "q", "w"),
    ("M_q", "q", "q"),
    ("Y_v", "v", "v"),
    ("L_v", "p", "v"),
    ("N_v", "r", "v"),
    ("L_p", "p", "p"),
    ("N_r", "r", "r"),
    ("L_lat", "p", "lat"),
    ("M_lon", "q", "lon"),
    ("Z_col", "w", "col"),
    ("N_ped", "r", "ped"),
];

/// Forms of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModelFormat {
    /// Matrices for people
    Table,
    /// JSON with names and units
    Json,
    /// One entry a line
    Csv,
    /// MATLAB file of level 5; needs -o
    Mat,
}

impl FileForm for ModelFormat {
    const ENDINGS: &'static [(&'static str, Self)] = &[
        ("txt", ModelFormat::Table),
        ("md", ModelFormat::Table),
        ("csv", ModelFormat::Csv),
        ("json", ModelFormat::Json),
        ("mat", ModelFormat::Mat),
    ];
    const USUAL: Self = ModelFormat::Table;
}

/// Linear models of a trim: periodic, averaged, harmonic, reduced
#[derive(Debug, Args)]
pub struct Linearize {
    #[command(flatten)]
    problem: ProblemArgs,
    #[command(flatten)]
    point: PointArgs,
    /// Rotor-on-rotor interactions
    #[arg(long, value_enum, default_value = "on")]
    interactions: Interactions,
    /// averaged (over azimuth, all states), harmonic:N (with N harmonics of the state), or full
    /// (the periodic model, matrices at every azimuth)
    #[arg(long, value_name = "MODEL", default_value = "averaged", value_parser = model)]
    model: Choice,
    #[command(flatten)]
    reduce: ReduceArgs,
    /// What moves the model
    #[arg(long, value_enum, default_value = "sticks")]
    inputs: Inputs,
    /// Show what averaging does, beside Floquet theory and harmonic models
    #[arg(long)]
    floquet: bool,
    /// Form of the result [default: what the ending of -o says, else table]
    #[arg(long, value_enum)]
    format: Option<ModelFormat>,
    /// The form, once it is known.
    #[arg(skip = ModelFormat::Table)]
    form: ModelFormat,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Plot to an SVG file: on-axis frequency responses, or derivatives over speed where there are several
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

fn model(text: &str) -> Result<Choice, String> {
    choice_among(text, |choice| choice != Choice::Floquet, "averaged, harmonic:N, full")
}

/// The models of one trim.
struct Case {
    interactions: bool,
    condition: FlightCondition,
    linearization: Linearization,
    /// The time-invariant model, all states.
    model: StateSpace,
    reduced: Option<Reduced>,
    averaging: Option<(Floquet, AveragingError)>,
    /// Trim of the model asked for.
    trim: Option<TrimValues>,
}

impl Case {
    /// The model asked for.
    fn result(&self) -> &StateSpace {
        self.reduced.as_ref().map_or(&self.model, |reduced| &reduced.model)
    }

    fn record(&self) -> ModelRecord {
        ModelRecord {
            speed: self.condition.horizontal_speed(),
            interactions: Some(self.interactions),
            model: self.result().clone(),
            trim: self.trim.clone(),
        }
    }
}

impl Linearize {
    pub(super) fn run(mut self) -> Result<Outcome, CliError> {
        self.output.check()?;
        self.form = form_of(self.format, self.output.file())?;
        if let Some(path) = &self.plot {
            self.output.check_plot(path)?;
        }
        self.check_form()?;
        self.run.start()?;
        let mut loaded = self.problem.load_with_warnings(self.run.quiet)?;
        let conditions = self.point.conditions(&mut loaded.problem)?;
        match conditions.as_slice() {
            [one] => self.single(&loaded.problem, *one),
            _ => {
                self.check_set()?;
                self.set(&loaded.problem, conditions)
            }
        }
    }

    /// Refuses what cannot be written before anything is computed.
    fn check_form(&self) -> Result<(), CliError> {
        let refuse = |message: &str, help: &str| {
            Err(CliError::Usage { message: message.into(), help: help.into() })
        };
        let both = self.interactions == Interactions::Both;
        let full = self.model == Choice::Full;
        match self.form {
            ModelFormat::Mat if self.output.file().is_none() => {
                return refuse("--format mat is binary and needs a file", "add -o FILE.mat");
            }
            ModelFormat::Csv | ModelFormat::Mat if both => {
                return refuse(
                    "such a file holds one position of the interactions",
                    "write --interactions on or --interactions off",
                );
            }
            ModelFormat::Csv if full => {
                return refuse(
                    "CSV holds time-invariant models only",
                    "write --format json or --format mat for the periodic model",
                );
            }
            _ => {}
        }
        if full && self.reduce.reduce.is_some() {
            return refuse(
                "the periodic model is not reduced",
                "reduce --model averaged or --model harmonic:N",
            );
        }
        Ok(())
    }

    /// Refuses what a set of models at several speeds cannot hold.
    fn check_set(&self) -> Result<(), CliError> {
        let refuse = |message: &str, help: &str| {
            Err(CliError::Usage { message: message.into(), help: help.into() })
        };
        if self.model == Choice::Full {
            return refuse(
                "a model set holds time-invariant models",
                "write --model averaged or --model harmonic:N, or one speed",
            );
        }
        if self.floquet {
            return refuse(
                "--floquet looks at one speed",
                "write one speed, such as --speeds \"45 kt\"",
            );
        }
        Ok(())
    }

    fn case(&self, flown: &Flown, trim: &ConvergedTrim) -> Result<Case, CliError> {
        let linearization = linearize(&flown.vehicle, trim, &self.inputs.options())?;
        let model = self.model.of(&linearization.model)?;
        let reduced = self.reduce.apply(&model)?;
        let averaging = if self.floquet {
            let floquet = analyse(&linearization.model, &FloquetOptions::default())?;
            let rigid = only_rigid_body(&linearization.model)?;
            let error = averaging_error(
                &rigid,
                &floquet,
                HARMONICS_COMPARED,
                &compared_frequencies()?,
                &ErrorOptions::default(),
            )?;
            Some((floquet, error))
        } else {
            None
        };
        let asked = reduced.as_ref().map_or(&model, |reduced| &reduced.model);
        Ok(Case {
            trim: trim_values(&flown.vehicle, trim, asked),
            interactions: flown.interactions,
            condition: trim.point().condition,
            linearization,
            model,
            reduced,
            averaging,
        })
    }

    fn single(&self, problem: &Problem, condition: FlightCondition) -> Result<Outcome, CliError> {
        let positions = self.interactions.positions();
        let system = self.units.of(Some(problem));
        let Some(flown) = fly(problem, &[vec![condition]], positions, system, self.run.quiet)?
        else {
            return Ok(Outcome::GoalMissed);
        };
        let cases: Vec<Case> = flown
            .par_iter()
            .map(|flown| self.case(flown, &flown.sweeps[0][0]))
            .collect::<Result<_, _>>()?;
        if let Some(path) = &self.plot {
            let svg = response_figure(problem, self.model, &cases, system)?.to_svg();
            self.output.write_plot(path, &svg)?;
        }
        if self.form != ModelFormat::Table && !self.run.quiet {
            for case in &cases {
                output::note(&summary(case));
                if let Some((floquet, error)) = &case.averaging {
                    output::note(&averaging_tables(floquet, error));
                }
            }
        }
        let first = &cases[0];
        match self.form {
            ModelFormat::Table => {
                let mut text = String::new();
                for case in &cases {
                    text += &self.tables(problem, case, system)?;
                }
                self.output.write(&text)
            }
            ModelFormat::Csv => self.output.write(&to_csv(&first.record(), system)?),
            ModelFormat::Json => {
                let texts: Vec<String> = cases
                    .iter()
                    .map(|case| {
                        if self.model == Choice::Full {
                            periodic_to_json(
                                case.condition.horizontal_speed(),
                                Some(case.interactions),
                                &case.linearization.model,
                                system,
                            )
                        } else {
                            Ok(to_json(&case.record(), system))
                        }
                    })
                    .collect::<Result<_, LinearError>>()?;
                self.output.write(&joined(&texts))
            }
            ModelFormat::Mat if self.model == Choice::Full => self.write_bytes(&periodic_to_mat(
                first.condition.horizontal_speed(),
                Some(first.interactions),
                &first.linearization.model,
                system,
            )?),
            ModelFormat::Mat => self.write_bytes(&to_mat(&first.record(), system)),
        }
    }

    fn write_bytes(&self, bytes: &[u8]) -> Result<Outcome, CliError> {
        let Some(path) = self.output.file() else {
            return Err(CliError::Internal("a MAT file without a name".into()));
        };
        output::write_whole(path, bytes, self.output.force)?;
        Ok(Outcome::Done)
    }

    fn set(&self, problem: &Problem, grid: Vec<FlightCondition>) -> Result<Outcome, CliError> {
        if grid.windows(2).any(|w| w[1].horizontal_speed() <= w[0].horizontal_speed()) {
            return Err(CliError::Usage {
                message: "the speeds of a model set must increase".into(),
                help: "write --speeds 0:90:5kt".into(),
            });
        }
        let halfway: Vec<FlightCondition> = grid
            .windows(2)
            .map(|w| FlightCondition {
                turn_rate: w[0].turn_rate,
                lateral: w[0].lateral,
                ..FlightCondition::climbing(
                    0.5 * (w[0].horizontal_speed() + w[1].horizontal_speed()),
                    w[0].climb_rate,
                )
            })
            .collect();
        let positions = self.interactions.positions();
        let system = self.units.of(Some(problem));
        let Some(flown) = fly(problem, &[grid, halfway], positions, system, self.run.quiet)? else {
            return Ok(Outcome::GoalMissed);
        };
        let omega = compared_frequencies()?;
        let mut sets = Vec::with_capacity(flown.len());
        let mut checks = Vec::with_capacity(flown.len());
        for flown in &flown {
            let cases = |trims: &[ConvergedTrim]| -> Result<Vec<Case>, CliError> {
                trims.par_iter().map(|trim| self.case(flown, trim)).collect()
            };
            let at_grid = cases(&flown.sweeps[0])?;
            let between = cases(&flown.sweeps[1])?;
            if at_grid.iter().filter_map(|case| case.reduced.as_ref()).any(|r| !r.named) {
                return Err(CliError::Usage {
                    message: "the balanced states have no names, and so cannot be interpolated \
                              over speed"
                        .into(),
                    help: "keep states that are outputs too, such as u,v,w,p,q,r,phi,theta".into(),
                });
            }
            let set = ModelSet::new(
                Some(flown.interactions),
                at_grid.iter().map(|case| case.condition.horizontal_speed()).collect(),
                at_grid.iter().map(|case| case.result().clone()).collect(),
            )?;
            let trims: Option<Vec<TrimValues>> =
                at_grid.iter().map(|case| case.trim.clone()).collect();
            let set = match trims {
                Some(trims) => set.with_trims(trims)?,
                None => set,
            };
            let checked: Vec<MidpointCheck> = between
                .par_iter()
                .map(|case| {
                    check_interpolation(
                        &set,
                        Interpolation::default(),
                        case.condition.horizontal_speed(),
                        case.result(),
                        &omega,
                        &ErrorOptions::default(),
                    )
                })
                .collect::<Result<_, LinearError>>()?;
            sets.push(set);
            checks.push(checked);
        }
        if let Some(path) = &self.plot {
            let svg = derivative_figure(problem, &sets, system).to_svg();
            self.output.write_plot(path, &svg)?;
        }
        let midpoints: String = sets
            .iter()
            .zip(&checks)
            .map(|(set, checks)| midpoint_table(set, checks, system))
            .collect();
        if self.form != ModelFormat::Table && !self.run.quiet {
            output::note(&midpoints);
        }
        match self.form {
            ModelFormat::Table => {
                let mut text = format!(
                    "{}: {}{} over speed\n",
                    problem.name,
                    if self.reduce.reduce.is_some() { "reduced " } else { "" },
                    self.model.label()
                );
                for set in &sets {
                    text += &derivative_table(set, system);
                }
                self.output.write(&(text + &midpoints))
            }
            ModelFormat::Json => {
                let texts: Vec<String> = sets.iter().map(|set| set_to_json(set, system)).collect();
                self.output.write(&joined(&texts))
            }
            ModelFormat::Csv => {
                let mut text = String::new();
                for (k, (speed, model)) in sets[0].speeds().iter().zip(sets[0].models()).enumerate()
                {
                    let record = ModelRecord {
                        trim: sets[0].trims().map(|trims| trims[k].clone()),
                        speed: *speed,
                        interactions: sets[0].interactions(),
                        model: model.clone(),
                    };
                    let one = to_csv(&record, system)?;
                    // One header for all.
                    let body = one.split_once('\n').map_or("", |(_, body)| body);
                    text += if text.is_empty() { &one } else { body };
                }
                self.output.write(&text)
            }
            ModelFormat::Mat => self.write_bytes(&set_to_mat(&sets[0], system)),
        }
    }

    fn tables(&self, problem: &Problem, case: &Case, system: System) -> Result<String, CliError> {
        let mut text = format!(
            "{}: {}{} at {}, interactions {}\n",
            problem.name,
            if case.reduced.is_some() { "reduced " } else { "" },
            self.model.label(),
            speed_text(case.condition.horizontal_speed(), system),
            on_off(case.interactions)
        );
        text += &summary(case);
        if self.model == Choice::Full {
            text += &harmonic_table(&case.linearization.model)?;
        } else {
            let model = case.result();
            let m = model.matrices_in(system);
            let (x, u) = (model.states(), model.inputs());
            text += &matrix_table("A: rates of the states per state", &m.a, (x, x), true, system);
            text += &matrix_table("B: rates of the states per input", &m.b, (x, u), true, system);
            let own: Vec<usize> =
                (0..model.outputs().len()).filter(|&i| !is_a_state(model, i)).collect();
            let same: Vec<&str> = (0..model.outputs().len())
                .filter(|i| !own.contains(i))
                .map(|i| model.outputs()[i].name.as_str())
                .collect();
            let y: Vec<Channel> = own.iter().map(|&i| model.outputs()[i].clone()).collect();
            if !y.is_empty() {
                let (c, d) = (m.c.select_rows(&own), m.d.select_rows(&own));
                text += &matrix_table("C: outputs per state", &c, (&y, x), false, system);
                text += &matrix_table("D: outputs per input", &d, (&y, u), false, system);
            }
            if !same.is_empty() {
                text += &format!("Outputs that are states: {}\n", same.join(", "));
            }
        }
        if let Some(reduced) = &case.reduced {
            text += &reduction_tables(reduced);
        }
        if let Some((floquet, error)) = &case.averaging {
            text += &averaging_tables(floquet, error);
        }
        text.push('\n');
        Ok(text)
    }
}

/// The periodic model with the rigid-body outputs only, for comparisons.
fn only_rigid_body(model: &PeriodicModel) -> Result<PeriodicModel, LinearError> {
    let rows: Vec<usize> = (0..model.outputs().len())
        .filter(|&i| RIGID_BODY.contains(&model.outputs()[i].name.as_str()))
        .collect();
    let mut samples = model.samples().to_vec();
    for sample in &mut samples {
        sample.c = sample.c.select_rows(&rows);
        sample.d = sample.d.select_rows(&rows);
    }
    PeriodicModel::new(
        model.states().to_vec(),
        model.inputs().to_vec(),
        rows.iter().map(|&i| model.outputs()[i].clone()).collect(),
        model.frequency(),
        samples,
    )
}

/// Several JSON texts as one: a list if there is more than one.
pub(super) fn joined(texts: &[String]) -> String {
    match texts {
        [one] => one.clone(),
        _ => {
            let trimmed: Vec<&str> = texts.iter().map(|text| text.trim_end()).collect();
            format!("[\n{}\n]\n", trimmed.join(",\n"))
        }
    }
}

/// Where the model comes from and how far it goes, for people.
fn summary(case: &Case) -> String {
    let mut text = format!(
        "{} states, {} inputs, {} outputs, from {} azimuths; averages change by {:.1e} with half \
         of them\n",
        case.model.states().len(),
        case.model.inputs().len(),
        case.model.outputs().len(),
        case.linearization.model.samples().len(),
        case.linearization.sample_error
    );
    if let Some(reduced) = &case.reduced {
        text += &reduced.summary(&case.model);
    }
    text
}

/// Whether an output is just the state of its name.
fn is_a_state(model: &StateSpace, output: usize) -> bool {
    let Ok(state) = model.state(&model.outputs()[output].name) else {
        return false;
    };
    let c = model.c().row(output);
    model.d().row(output).iter().all(|d| *d == 0.0)
        && c.iter().enumerate().all(|(j, c)| (*c - f64::from(j == state)).abs() < 1e-12)
}

fn unit_of_row(kind: Kind, rate: bool, system: System) -> String {
    match (kind.symbol(system), rate) {
        ("-", true) => "1/s".into(),
        ("-", false) => String::new(),
        (symbol, true) => format!("{symbol}/s"),
        (symbol, false) => symbol.into(),
    }
}

fn unit_of_column(kind: Kind, system: System) -> String {
    match kind.symbol(system) {
        "-" => String::new(),
        symbol => format!("per {symbol}"),
    }
}

fn matrix_table(
    title: &str,
    matrix: &DMatrix<f64>,
    (rows, columns): (&[Channel], &[Channel]),
    rate: bool,
    system: System,
) -> String {
    let mut text = String::new();
    for (part, chunk) in columns.chunks(TABLE_COLUMNS).enumerate() {
        let mut heads = vec![Column::text(if rate { "rate of" } else { "of" }), Column::text("in")];
        heads.extend(chunk.iter().map(|c| {
            Column::number(&c.name, &unit_of_column(c.kind, system), Digits::Decimals(4))
        }));
        let mut table = Table::new(if part == 0 { title } else { "" }, heads);
        for (i, row) in rows.iter().enumerate() {
            let mut cells = vec![
                Cell::from(row.name.as_str()),
                Cell::from(unit_of_row(row.kind, rate, system)),
            ];
            let first = part * TABLE_COLUMNS;
            cells.extend((first..first + chunk.len()).map(|j| Cell::from(matrix[(i, j)])));
            table.row(cells);
        }
        text += "\n";
        text += &table.to_text(Coloring::for_stdout());
    }
    text
}

/// Size of the harmonics of A and B, states brought to like size by balancing.
fn harmonic_table(model: &PeriodicModel) -> Result<String, LinearError> {
    let (_, scale) = balance(model.averaged().a())?;
    let series = |pick: fn(&coaxdesign::linear::model::PeriodicSample) -> &DMatrix<f64>,
                  square: bool| {
        let scaled: Vec<DMatrix<f64>> = model
            .samples()
            .iter()
            .map(|sample| {
                let m = pick(sample);
                DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
                    m[(i, j)] * if square { scale[j] } else { 1.0 } / scale[i]
                })
            })
            .collect();
        FourierMatrix::from_samples(scaled.iter())
    };
    let (a, b) = (series(|s| &s.a, true), series(|s| &s.b, false));
    let size = |m: &FourierMatrix, k: usize| {
        m.cosine[k].norm_squared() + m.sine.get(k).map_or(0.0, DMatrix::norm_squared)
    };
    let mut table = Table::new(
        "Harmonics of A and B beside their averages, states balanced",
        vec![
            Column::number("harmonic", "", Digits::Decimals(0)),
            Column::number("frequency", "rad/s", Digits::Decimals(2)),
            Column::number("A", "", Digits::Significant(3)),
            Column::number("B", "", Digits::Significant(3)),
        ],
    );
    for k in 0..=HARMONICS_SHOWN.min(a.highest()).min(b.highest()) {
        table.row([
            Cell::from(k as f64),
            Cell::from(k as f64 * model.frequency()),
            Cell::from((size(&a, k) / size(&a, 0)).sqrt()),
            Cell::from((size(&b, k) / size(&b, 0)).sqrt()),
        ]);
    }
    Ok(format!(
        "\n{}The matrices themselves are in --format json and --format mat.\n",
        table.to_text(Coloring::for_stdout())
    ))
}

/// Error of a reduction over frequency and over the channels.
fn reduction_tables(reduced: &Reduced) -> String {
    let error = &reduced.error;
    let mut over = Table::new(
        "Error of the reduced model, all rigid-body outputs together",
        vec![
            Column::number("frequency", "rad/s", Digits::Decimals(1)),
            Column::number("relative error", "%", Digits::Significant(3)),
        ],
    );
    for wanted in ERROR_SHOWN {
        let nearest = (0..error.omega.len()).min_by(|&i, &j| {
            let off = |k: usize| (error.omega[k] / wanted).ln().abs();
            off(i).total_cmp(&off(j))
        });
        if let Some(k) = nearest {
            over.row([Cell::from(error.omega[k]), Cell::from(100.0 * error.sigma_max[k])]);
        }
    }
    let mut columns = vec![Column::text("output")];
    columns.extend(error.inputs.iter().map(|name| Column::text(name)));
    let mut channels = Table::new(
        &format!(
            "Frequencies, rad/s, between which each channel is within {:.0} %",
            100.0 * error.tolerance
        ),
        columns,
    );
    for (i, output) in error.outputs.iter().enumerate() {
        let mut cells = vec![Cell::from(output.as_str())];
        cells.extend((0..error.inputs.len()).map(|j| {
            let widest = bands(&error.omega, error.tolerance, |k| error.channels[k][(i, j)])
                .into_iter()
                .reduce(|x, y| if y.1 / y.0 > x.1 / x.0 { y } else { x });
            Cell::from(widest.map_or_else(|| "-".into(), |(a, b)| format!("{a:.2} to {b:.2}")))
        }));
        channels.row(cells);
    }
    let mut text = String::new();
    for table in [over, channels] {
        text += "\n";
        text += &table.to_text(Coloring::for_stdout());
    }
    if let Some(bound) = reduced.reduction.bound {
        text += &format!("Bound on the error by the Hankel singular values: {bound:.3e}\n");
    }
    text
}

/// What averaging does, beside harmonic models and Floquet's theory.
fn averaging_tables(floquet: &Floquet, error: &AveragingError) -> String {
    let mut harmonics = Table::new(
        "Eigenvalues of harmonic models beside the Floquet exponents",
        vec![
            Column::number("harmonics", "", Digits::Decimals(0)),
            Column::number("largest difference", "rad/s", Digits::Significant(3)),
        ],
    );
    for (count, difference) in &error.harmonic {
        harmonics.row([*count as f64, *difference]);
    }
    let mut exponents = Table::new(
        "Slowest Floquet exponents beside the averaged model's eigenvalues",
        vec![
            Column::number("exact, real", "rad/s", Digits::Decimals(4)),
            Column::number("imaginary", "rad/s", Digits::Decimals(4)),
            Column::number("averaged, real", "rad/s", Digits::Decimals(4)),
            Column::number("imaginary", "rad/s", Digits::Decimals(4)),
            Column::number("difference", "rad/s", Digits::Significant(2)),
        ],
    );
    for pair in error.averaged.iter().filter(|pair| pair.exact.im >= 0.0).take(EXPONENTS_SHOWN) {
        exponents.row([
            pair.exact.re,
            pair.exact.im,
            pair.approximate.re,
            pair.approximate.im,
            pair.difference,
        ]);
    }
    format!(
        "\n{}\n{}\nThe averaged model beside that of {HARMONICS_COMPARED} harmonics, rigid-body \
         outputs: {}.\nFloquet: {} steps a revolution, error {:.1e}.\n",
        harmonics.to_text(Coloring::for_stdout()),
        exponents.to_text(Coloring::for_stdout()),
        trust(&error.response),
        floquet.steps,
        floquet.integration_error
    )
}

/// The entries of a model that are shown over speed, in shown units.
fn derivatives(model: &StateSpace, system: System) -> Vec<(&'static str, String, f64)> {
    let m = model.matrices_in(system);
    DERIVATIVES
        .iter()
        .filter_map(|&(name, row, column)| {
            let i = model.state(row).ok()?;
            let rate = unit_of_row(model.states()[i].kind, true, system);
            let (kind, value) = match (model.state(column), model.input(column)) {
                (Ok(j), _) => (model.states()[j].kind, m.a[(i, j)]),
                (_, Ok(j)) => (model.inputs()[j].kind, m.b[(i, j)]),
                _ => return None,
            };
            Some((name, format!("{rate} {}", unit_of_column(kind, system)), value))
        })
        .collect()
}

fn derivative_table(set: &ModelSet, system: System) -> String {
    let names = derivatives(&set.models()[0], system);
    let mut text = String::new();
    for (part, chunk) in names.chunks(TABLE_COLUMNS).enumerate() {
        let mut columns =
            vec![Column::number("speed", Kind::Airspeed.symbol(system), Digits::Decimals(1))];
        columns.extend(
            chunk.iter().map(|(name, unit, _)| Column::number(name, unit, Digits::Decimals(4))),
        );
        let title = format!("Entries of A and B, {}", set_name(set));
        let mut table = Table::new(if part == 0 { &title } else { "" }, columns);
        for (speed, model) in set.speeds().iter().zip(set.models()) {
            let mut cells = vec![Cell::from(Kind::Airspeed.from_si(*speed, system))];
            let values = derivatives(model, system);
            let first = part * TABLE_COLUMNS;
            cells.extend(values[first..first + chunk.len()].iter().map(|v| Cell::from(v.2)));
            table.row(cells);
        }
        text += "\n";
        text += &table.to_text(Coloring::for_stdout());
    }
    text
}

fn set_name(set: &ModelSet) -> String {
    set.interactions()
        .map_or_else(|| "interactions unknown".into(), |on| format!("interactions {}", on_off(on)))
}

/// How well the models in between are met by interpolation.
fn midpoint_table(set: &ModelSet, checks: &[MidpointCheck], system: System) -> String {
    let mut table = Table::new(
        &format!("Cubic interpolation halfway between the speeds, {}", set_name(set)),
        vec![
            Column::number("speed", Kind::Airspeed.symbol(system), Digits::Decimals(1)),
            Column::number("worst entry off by", "%", Digits::Significant(2)),
            Column::text("entry"),
            Column::number("eigenvalues off by", "rad/s", Digits::Significant(2)),
            Column::number("response off by", "%", Digits::Significant(2)),
        ],
    );
    let mut coarse = Vec::new();
    for check in checks {
        let response = check.response.sigma_max.iter().copied().fold(0.0, f64::max);
        let good = response <= check.response.tolerance;
        if !good {
            coarse.push(speed_text(check.speed, system));
        }
        table.row([
            Cell::from(Kind::Airspeed.from_si(check.speed, system)),
            Cell::from(100.0 * check.entry_error),
            Cell::from(check.entry.as_str()),
            Cell::from(check.eigenvalue_error),
            Cell::from(100.0 * response).highlight(if good {
                Highlight::Plain
            } else {
                Highlight::Warning
            }),
        ]);
    }
    let mut text = format!("\n{}", table.to_text(Coloring::for_stdout()));
    if !coarse.is_empty() {
        text += &format!("The set is too coarse at {}: add speeds there.\n", coarse.join(", "));
    }
    text
}

/// On-axis responses of the models, full and reduced.
fn response_figure(
    problem: &Problem,
    choice: Choice,
    cases: &[Case],
    system: System,
) -> Result<Figure, CliError> {
    let mut labels: Vec<(String, usize)> = Vec::new();
    let mut models: Vec<&StateSpace> = Vec::new();
    for case in cases {
        let style = usize::from(!case.interactions);
        let name = format!("interactions {}", on_off(case.interactions));
        labels.push((name.clone(), style));
        models.push(&case.model);
        if let Some(reduced) = &case.reduced {
            labels.push((format!("{name}, reduced"), style + 2));
            models.push(&reduced.model);
        }
    }
    let named: Vec<(&str, &StateSpace)> =
        labels.iter().map(|(label, _)| label.as_str()).zip(models.iter().copied()).collect();
    let omega = compared_frequencies()?;
    let mut channels = Vec::new();
    for (input, output) in on_axis(models[0])? {
        let comparison = compare(&named, &input, &output, &omega)?;
        channels.push(BodeChannel {
            title: format!("{input} to {output}"),
            magnitude_unit: "dB, SI".into(),
            valid: None,
            responses: comparison
                .curves
                .iter()
                .zip(&labels)
                .map(|((_, bode), (label, style))| FrequencyResponse {
                    name: label.clone(),
                    style: *style,
                    frequency: bode.omega.clone(),
                    response: bode
                        .gain
                        .iter()
                        .zip(&bode.phase)
                        .map(|(gain, phase)| num_complex::Complex64::from_polar(*gain, *phase))
                        .collect(),
                })
                .collect(),
        });
    }
    let speed = speed_text(cases[0].condition.horizontal_speed(), system);
    // Of the periodic model the average is shown.
    let shown = if choice == Choice::Full { Choice::Averaged } else { choice };
    let title = format!("{}: {} at {}", problem.name, shown.label(), speed);
    Ok(bode_figure(&title, &channels))
}

/// Entries of A and B over speed.
fn derivative_figure(problem: &Problem, sets: &[ModelSet], system: System) -> Figure {
    let first = derivatives(&sets[0].models()[0], system);
    let panels: Vec<CurvePanel> = first
        .iter()
        .enumerate()
        .map(|(k, (name, unit, _))| CurvePanel {
            title: String::new(),
            quantity: (*name).into(),
            unit: unit.clone(),
            minimum_span: 0.0,
            curves: sets
                .iter()
                .map(|set| Curve {
                    name: set_name(set),
                    style: usize::from(set.interactions() == Some(false)),
                    x: set.speeds().iter().map(|v| Kind::Airspeed.from_si(*v, system)).collect(),
                    y: set.models().iter().map(|model| derivatives(model, system)[k].2).collect(),
                    marks: Marks::With,
                })
                .collect(),
        })
        .collect();
    gain_schedule_figure(
        &format!("{}: stability and control derivatives", problem.name),
        Kind::Airspeed.symbol(system),
        &panels,
    )
}
