//! What the subcommands on linear models share: the flight condition, the
//! choice of model and of reduction, and how a fault of that stage ends a
//! command.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use rayon::prelude::*;

use super::trim::{FlightArgs, failures};
use super::{CliError, output};
use coaxdesign::linear::frequency::{ErrorOptions, ResponseError, log_grid, response_error};
use coaxdesign::linear::harmonic;
use coaxdesign::linear::reduction::{
    BalancedOptions, Method, RIGID_BODY, Reduction, balanced, outputs_as_states, residualise,
    truncate,
};
use coaxdesign::linear::{Channel, LinearError, PeriodicModel, StateSpace, linearize};
use coaxdesign::problem::{Problem, STICKS};
use coaxdesign::report::progress::Progress;
use coaxdesign::trim::{ConvergedTrim, FlightCondition, Options, TrimPoint, sweep};
use coaxdesign::units::{Kind, System};
use coaxdesign::vehicle::Vehicle;

/// Most harmonics of a harmonic model: beyond, it only grows.
const MOST_HARMONICS: usize = 12;
/// Frequencies over which models are compared, rad/s: from slower than any
/// task of a pilot to faster than any actuator.
const COMPARED: (f64, f64, usize) = (0.05, 30.0, 120);

/// The flight condition at a speed, or at several.
#[derive(Debug, Clone, Args)]
pub struct PointArgs {
    /// True airspeeds: one, such as "45 kt", FIRST:LAST:STEP with a unit, or a list
    #[arg(
        long,
        alias = "speed",
        value_name = "SPEEDS",
        default_value = "0 kt",
        allow_hyphen_values = true
    )]
    pub speeds: String,
    #[command(flatten)]
    pub flight: FlightArgs,
}

impl PointArgs {
    /// The conditions, one a speed; the altitude goes into the problem.
    ///
    /// # Errors
    /// As [`FlightArgs::conditions`].
    pub fn conditions(&self, problem: &mut Problem) -> Result<Vec<FlightCondition>, CliError> {
        self.flight.conditions(&self.speeds, problem)
    }
}

/// What moves the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Inputs {
    /// The pilot's sticks, %
    Sticks,
    /// The blade controls of every rotor, rad
    Rotors,
}

impl Inputs {
    /// The options of linearisation.
    pub fn options(self) -> linearize::Options {
        linearize::Options {
            inputs: match self {
                Inputs::Sticks => linearize::Inputs::Sticks,
                Inputs::Rotors => linearize::Inputs::Rotors,
            },
            ..linearize::Options::default()
        }
    }
}

/// Kinds of model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The periodic model itself.
    Full,
    /// The zeroth harmonic, all states.
    Averaged,
    /// The harmonic decomposition with this many harmonics of the state.
    Harmonic(usize),
    /// The periodic model by Floquet's theory.
    Floquet,
}

impl Choice {
    /// In words.
    pub fn label(self) -> String {
        match self {
            Choice::Full => "periodic model".into(),
            Choice::Averaged => "averaged model".into(),
            Choice::Harmonic(1) => "harmonic model with 1 harmonic".into(),
            Choice::Harmonic(n) => format!("harmonic model with {n} harmonics"),
            Choice::Floquet => "Floquet exponents".into(),
        }
    }

    /// The time-invariant model of a periodic one; the averaged model stands
    /// for the periodic choices. Coefficients of harmonic 0 keep their plain
    /// names.
    ///
    /// # Errors
    /// As [`harmonic::mean_and_harmonics`].
    pub fn of(self, periodic: &PeriodicModel) -> Result<StateSpace, LinearError> {
        let Choice::Harmonic(n) = self else {
            return Ok(periodic.averaged());
        };
        harmonic::mean_and_harmonics(periodic, n)
    }
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "full" => Ok(Choice::Full),
            "averaged" => Ok(Choice::Averaged),
            "floquet" => Ok(Choice::Floquet),
            _ => {
                let Some(count) = text.strip_prefix("harmonic:") else {
                    return Err("no such model".into());
                };
                match count.parse() {
                    Ok(n) if n <= MOST_HARMONICS => Ok(Choice::Harmonic(n)),
                    Ok(n) => Err(format!("{n} harmonics are too many; {MOST_HARMONICS} at most")),
                    Err(_) => Err(format!("{count:?} is not a number of harmonics")),
                }
            }
        }
    }
}

/// Reads one of the models that a subcommand offers; `offered` says which,
/// for the message.
pub(super) fn choice_among(
    text: &str,
    allowed: fn(Choice) -> bool,
    offered: &str,
) -> Result<Choice, String> {
    let choice =
        Choice::from_str(text).map_err(|reason| format!("{reason}; write one of {offered}"))?;
    if allowed(choice) {
        Ok(choice)
    } else {
        Err(format!("not a model of this subcommand; write one of {offered}"))
    }
}

/// Ways to reduce a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Reduce {
    /// Fast states follow at once: exact at zero frequency
    Residualize,
    /// Fast states held at zero
    Truncate,
    /// Balanced truncation of the stable part
    Balanced,
    /// Residualisation in balanced coordinates
    BalancedResidualize,
}

impl Reduce {
    fn method(self) -> Method {
        match self {
            Reduce::Residualize => Method::Residualise,
            Reduce::Truncate => Method::Truncate,
            Reduce::Balanced => Method::BalancedTruncate,
            Reduce::BalancedResidualize => Method::BalancedResidualise,
        }
    }
}

/// `--reduce` and `--keep`.
#[derive(Debug, Clone, Args)]
pub struct ReduceArgs {
    /// Take the fast states out, this way
    #[arg(long, value_enum)]
    pub reduce: Option<Reduce>,
    /// States to keep; balanced ways keep as many, and name them after the outputs of these names
    /// [default: u,v,w,p,q,r,phi,theta]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "reduce")]
    pub keep: Vec<String>,
}

impl ReduceArgs {
    /// The reduced model, if one is asked for.
    ///
    /// # Errors
    /// Unknown names, or states that cannot be taken out.
    pub fn apply(&self, full: &StateSpace) -> Result<Option<Reduced>, CliError> {
        let Some(reduce) = self.reduce else {
            return Ok(None);
        };
        let rigid_body = || RIGID_BODY.map(str::to_owned).to_vec();
        let keep = if self.keep.is_empty() { rigid_body() } else { self.keep.clone() };
        Reduced::new(full, reduce.method(), &keep).map(Some)
    }
}

/// A reduced model and its error.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// The model, states named where they can be.
    pub model: StateSpace,
    /// How it came about.
    pub reduction: Reduction,
    /// Error of the rigid-body outputs over frequency.
    pub error: ResponseError,
    /// Whether the states have a meaning, and so can be interpolated.
    pub named: bool,
}

impl Reduced {
    /// Reduces a model to the states of these names, or as many of them.
    ///
    /// # Errors
    /// Unknown names, or states that cannot be taken out.
    pub fn new(full: &StateSpace, method: Method, keep: &[String]) -> Result<Self, CliError> {
        for name in keep {
            full.state(name)?;
        }
        let usual = |channels: &[Channel]| channels.iter().map(|c| usual_size(c.kind)).collect();
        let mut named = true;
        let mut reduction = match method {
            Method::Residualise => residualise(full, keep)?,
            Method::Truncate => truncate(full, keep)?,
            Method::BalancedTruncate | Method::BalancedResidualise => {
                let options = BalancedOptions {
                    input_scale: usual(full.inputs()),
                    output_scale: usual(full.outputs()),
                    ..BalancedOptions::default()
                };
                balanced(full, keep.len(), method, &options)?
            }
        };
        let mut model = reduction.model.clone();
        if matches!(method, Method::BalancedTruncate | Method::BalancedResidualise) {
            match outputs_as_states(&model, keep) {
                Ok(renamed) => model = renamed,
                Err(reason) => {
                    named = false;
                    reduction.warnings.push(format!("the balanced states stay unnamed: {reason}"));
                }
            }
        }
        let outputs: Vec<&str> =
            RIGID_BODY.into_iter().filter(|name| full.output(name).is_ok()).collect();
        let (from, to, points) = COMPARED;
        let options = ErrorOptions { input_scale: usual(full.inputs()), ..ErrorOptions::default() };
        let error = response_error(
            &full.select_outputs(&outputs)?,
            &model.select_outputs(&outputs)?,
            &log_grid(from, to, points)?,
            &options,
        )?;
        Ok(Self { model, reduction, error, named })
    }

    /// What was done and how far to trust it, one line each.
    pub fn summary(&self, full: &StateSpace) -> String {
        let mut text = format!(
            "{} states reduced to {} ({}): {}\n",
            full.states().len(),
            self.model.states().len(),
            self.reduction.method.name(),
            trust(&self.error)
        );
        for warning in &self.reduction.warnings {
            text += &format!("warning: {warning}\n");
        }
        text
    }
}

/// Intervals of the grid, rad/s, in which an error stays within a tolerance.
pub(super) fn bands(
    omega: &[f64],
    tolerance: f64,
    error: impl Fn(usize) -> f64,
) -> Vec<(f64, f64)> {
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut inside = false;
    for (k, &w) in omega.iter().enumerate() {
        let good = error(k) <= tolerance;
        match found.last_mut() {
            Some(band) if good && inside => band.1 = w,
            _ if good => found.push((w, w)),
            _ => {}
        }
        inside = good;
    }
    found
}

/// How far an approximation may be trusted, in words.
pub(super) fn trust(error: &ResponseError) -> String {
    let percent = 100.0 * error.tolerance;
    let first = error.omega.first().copied().unwrap_or(0.0);
    let last = error.omega.last().copied().unwrap_or(0.0);
    let mut good = bands(&error.omega, error.tolerance, |k| error.sigma_max[k]);
    // Two curves that cross agree at one frequency without being alike.
    good.retain(|(from, to)| to > from);
    let parts: Vec<String> = good
        .iter()
        .map(|&(from, to)| {
            if from == first {
                format!("up to {to:.3} rad/s")
            } else {
                format!("from {from:.3} to {to:.3} rad/s")
            }
        })
        .collect();
    match good.as_slice() {
        [] => format!("off by more than {percent:.0} % everywhere from {first} to {last} rad/s"),
        [(from, to)] if *from == first && *to == last => {
            format!("within {percent:.0} % over the whole range, {first} to {last} rad/s")
        }
        _ => format!("within {percent:.0} % {}", parts.join(" and ")),
    }
}

/// Sizes that count as equally large, SI: 1 m/s, 1 m/s², 0.1 rad and rad/s of
/// motion, 1 % of stick.
fn usual_size(kind: Kind) -> f64 {
    match kind {
        Kind::AngleRad | Kind::AngularRateRad => 0.1,
        _ => 1.0,
    }
}

/// Frequencies on which models are compared, rad/s.
pub(super) fn compared_frequencies() -> Result<Vec<f64>, LinearError> {
    let (from, to, points) = COMPARED;
    log_grid(from, to, points)
}

/// A vehicle with its interactions on or off, and its trims.
pub(super) struct Flown {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// Whether rotors interfere.
    pub interactions: bool,
    /// The trims of each sweep asked for.
    pub sweeps: Vec<Vec<ConvergedTrim>>,
}

/// Trims along every sweep, for each position of the interactions. What did
/// not trim is said on standard error; then there is no result.
///
/// # Errors
/// A vehicle that cannot be built.
pub(super) fn fly(
    problem: &Problem,
    sweeps: &[Vec<FlightCondition>],
    positions: &[bool],
    system: System,
    quiet: bool,
) -> Result<Option<Vec<Flown>>, CliError> {
    let vehicles: Vec<Vehicle> = positions
        .par_iter()
        .map(|&on| {
            let mut problem = problem.clone();
            problem.inflow.interactions = on;
            Vehicle::new(&problem)
        })
        .collect::<Result<_, _>>()?;
    let count = sweeps.iter().map(Vec::len).sum::<usize>() * positions.len();
    let progress = Progress::new("trimming", count as u64, quiet);
    let tasks: Vec<(&Vehicle, &Vec<FlightCondition>)> =
        vehicles.iter().flat_map(|v| sweeps.iter().map(move |s| (v, s))).collect();
    let points: Vec<Vec<TrimPoint>> = tasks
        .par_iter()
        .map(|(vehicle, conditions)| {
            sweep(vehicle, conditions, &Options::default(), |_| progress.advance()).points
        })
        .collect();
    progress.finish();
    output::note(&failures(&points, Some(system)));
    let mut lists = Vec::with_capacity(points.len());
    for list in points {
        let trims: Result<Vec<ConvergedTrim>, _> =
            list.into_iter().map(TrimPoint::into_converged).collect();
        let Ok(trims) = trims else {
            return Ok(None);
        };
        lists.push(trims);
    }
    let mut lists = lists.into_iter();
    Ok(Some(
        vehicles
            .into_iter()
            .zip(positions)
            .map(|(vehicle, &interactions)| Flown {
                vehicle,
                interactions,
                sweeps: lists.by_ref().take(sweeps.len()).collect(),
            })
            .collect(),
    ))
}

impl From<LinearError> for CliError {
    fn from(error: LinearError) -> Self {
        let message = error.to_string();
        let help = match &error {
            LinearError::UnknownName { role: "input", .. } => format!(
                "the sticks are {}; with --inputs rotors the inputs are blade controls such as \
                 upper.theta_0",
                STICKS.join(", ")
            ),
            LinearError::UnknownName { role: "output", .. } => format!(
                "outputs are {}, heading_rate, v_forward, v_right, v_down, a_x, a_y, a_z",
                RIGID_BODY.join(", ")
            ),
            LinearError::UnknownName { .. } => format!(
                "states are {}, and those of the rotors, such as upper.beta_1c",
                RIGID_BODY.join(", ")
            ),
            LinearError::DuplicateName { .. } => "name it once".into(),
            LinearError::SingularFastBlock { .. } | LinearError::StillUsed { .. } => {
                "add these states to --keep".into()
            }
            LinearError::Domain(_) | LinearError::Format(_) => {
                "see coaxdesign help for what is possible".into()
            }
            LinearError::NotFinite { .. }
            | LinearError::Shape { .. }
            | LinearError::Singular { .. }
            | LinearError::NotConverged { .. }
            | LinearError::Unstable { .. } => return CliError::Missed(message),
        };
        CliError::Usage { message, help }
    }
}

/// The pairs that a pilot looks at: the sticks with the motion that each is
/// for, or else for each of p, q, w and r the input that moves it most at
/// 1 rad/s.
///
/// # Errors
/// A model without these outputs, or with an undamped mode at 1 rad/s.
pub(super) fn on_axis(model: &StateSpace) -> Result<Vec<(String, String)>, LinearError> {
    let outputs = ["p", "q", "w", "r"];
    if STICKS.iter().all(|stick| model.input(stick).is_ok()) {
        return Ok(STICKS
            .iter()
            .zip(outputs)
            .map(|(stick, output)| ((*stick).to_owned(), output.to_owned()))
            .collect());
    }
    let response = coaxdesign::linear::frequency::frequency_response(model, &[1.0])?;
    outputs
        .into_iter()
        .map(|output| {
            let row = model.output(output)?;
            let gain = |j: usize| response.values[0][(row, j)].norm() * size_of_input(model, j);
            let best = (0..model.inputs().len())
                .reduce(|x, y| if gain(y) > gain(x) { y } else { x })
                .map_or_else(String::new, |j| model.inputs()[j].name.clone());
            Ok((best, output.to_owned()))
        })
        .collect()
}

fn size_of_input(model: &StateSpace, j: usize) -> f64 {
    usual_size(model.inputs()[j].kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_of_a_grid() {
        let omega = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let error = [0.2, 0.1, 0.0, 0.3, 0.05, 0.05];
        assert_eq!(bands(&omega, 0.1, |k| error[k]), [(2.0, 3.0), (5.0, 6.0)]);
        assert_eq!(bands(&omega, 0.01, |k| error[k]), [(3.0, 3.0)]);
        assert!(bands(&omega, -1.0, |k| error[k]).is_empty());
    }

    #[test]
    fn models_by_name() {
        assert_eq!(Choice::from_str("averaged"), Ok(Choice::Averaged));
        assert_eq!(Choice::from_str("harmonic:4"), Ok(Choice::Harmonic(4)));
        for bad in ["harmonic", "harmonic:", "harmonic:-1", "harmonic:99", "average", ""] {
            assert!(Choice::from_str(bad).is_err(), "{bad}");
        }
        let only_averaged = |choice| choice == Choice::Averaged;
        let refused = choice_among("full", only_averaged, "averaged").unwrap_err();
        assert!(refused.contains("averaged"), "{refused}");
    }
}
