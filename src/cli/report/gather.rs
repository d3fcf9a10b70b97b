//! What a report shows, from the files of a design and from its problem.

use std::f64::consts::TAU;
use std::path::Path;

use rayon::prelude::*;

use super::super::trim::{parse_speeds, trim_all};
use super::super::tune::usage;
use super::super::watch::Watch;
use super::Inputs;
use crate::cli::CliError;
use coaxdesign::control::explain::Explanation;
use coaxdesign::control::models::LeftOut;
use coaxdesign::control::plant::ModelSet;
use coaxdesign::control::verify::{Authority, Verification};
use coaxdesign::linear::linearize::{Options as LinearOptions, averaged};
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::linear::{LinearError, StateSpace};
use coaxdesign::pipeline::plants;
use coaxdesign::trim::shooting::Shooting;
use coaxdesign::trim::{FlightCondition, TrimPoint};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use coaxdesign::vehicle::output::Output;

/// Samples of a revolution, at least.
const SAMPLES: usize = 144;
/// Speed at which cruise is shown, m/s, or the trimmed one nearest to it.
const CRUISE: f64 = 60.0 * KNOT;

/// A verification with all that its file holds.
pub(in crate::cli) struct Checked {
    /// Rows and stability.
    pub verification: Verification,
    /// What step commands ask of the blades.
    pub authority: Vec<Authority>,
    /// Why targets are missed, or what they cost.
    pub explanations: Vec<Explanation>,
    /// Models and speeds without a trim.
    pub left_out: Vec<LeftOut>,
}

/// Reads `verification.json`, if it is there.
pub(in crate::cli) fn verification(directory: &Path) -> Result<Option<Checked>, CliError> {
    let path = directory.join("verification.json");
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(CliError::Io { path, source }),
    };
    let wrong = |error: serde_json::Error| {
        usage(
            format!("{}: not a verification: {error}", path.display()),
            "write it anew with `coaxdesign verify DESIGN --format json`",
        )
    };
    let value: serde_json::Value = serde_json::from_str(&text).map_err(wrong)?;
    let list = |key: &str| value.get(key).cloned().unwrap_or_else(|| serde_json::json!([]));
    let left_out = list("left_out")
        .as_array()
        .map(|all| {
            let text =
                |l: &serde_json::Value, key: &str| l[key].as_str().unwrap_or_default().to_string();
            all.iter()
                .map(|l| LeftOut {
                    model: text(l, "model"),
                    speed: l["speed_m_s"].as_f64().unwrap_or(f64::NAN),
                    reason: text(l, "reason"),
                })
                .collect()
        })
        .unwrap_or_default();
    Ok(Some(Checked {
        authority: serde_json::from_value(list("authority")).map_err(wrong)?,
        explanations: serde_json::from_value(list("explanations")).map_err(wrong)?,
        left_out,
        verification: serde_json::from_value(value).map_err(wrong)?,
    }))
}

/// A problem, trimmed and linearised.
pub(super) struct Study {
    /// Trims over speed, interactions on and then off, or on alone where there
    /// is one rotor.
    pub sweeps: Vec<Vec<TrimPoint>>,
    /// Which of them has the interactions of the problem.
    pub own_sweep: usize,
    /// Names of the rotors.
    pub rotors: Vec<String>,
    /// Models in hover, one for each of those that trims there.
    pub hover: Vec<Linear>,
    /// One revolution in hover and in cruise, interactions as in the problem.
    pub revolutions: Vec<Revolution>,
    /// The nominal plants at the breakpoints of the schedule.
    pub nodes: ModelSet,
}

/// Linear models of one trim.
pub(super) struct Linear {
    /// Whether rotors interfere.
    pub interactions: bool,
    /// Averaged over the period, all states.
    pub full: StateSpace,
    /// Residualised to the rigid body.
    pub reduced: StateSpace,
}

/// A vehicle over one revolution of its slowest rotor.
pub(super) struct Revolution {
    /// Airspeed, m/s.
    pub airspeed: f64,
    /// Azimuths of the reference blade, rad.
    pub azimuth: Vec<f64>,
    /// What the vehicle does there.
    pub output: Vec<Output>,
}

impl Study {
    /// Trims, linearises and samples.
    pub fn new(inputs: &Inputs, speeds: &str, quiet: bool) -> Result<Self, CliError> {
        let problem = &inputs.loaded.problem;
        let conditions: Vec<FlightCondition> =
            parse_speeds(speeds)?.into_iter().map(FlightCondition::level).collect();
        let positions: &[bool] = if problem.rotors.len() > 1 { &[true, false] } else { &[true] };
        let sweeps = trim_all(problem, &conditions, positions, quiet)?;
        let base = Vehicle::new(problem)?;
        let hover = positions
            .par_iter()
            .zip(&sweeps)
            .filter_map(|(&on, points)| {
                let slowest =
                    points.iter().find(|p| p.condition.airspeed == 0.0 && p.on_orbit())?;
                Some(linear(&base, on, slowest))
            })
            .collect::<Result<_, CliError>>()?;
        let own_sweep =
            positions.iter().position(|on| *on == problem.inflow.interactions).unwrap_or(0);
        let flown = || sweeps[own_sweep].iter().filter(|p| p.on_orbit());
        let slow = flown().min_by(|a, b| a.condition.airspeed.total_cmp(&b.condition.airspeed));
        let off = |p: &TrimPoint| (p.condition.airspeed - CRUISE).abs();
        let cruise = flown().min_by(|a, b| off(a).total_cmp(&off(b)));
        let mut chosen: Vec<&TrimPoint> = slow.into_iter().chain(cruise).collect();
        chosen.dedup_by(|a, b| a.condition == b.condition);
        let revolutions = chosen.into_iter().map(|point| revolution(&base, point)).collect();
        let mut nominal = inputs.requirements.specification.clone();
        nominal.models.truncate(1);
        let breakpoints: Vec<f64> = inputs.schedule.points.iter().map(|p| p.speed).collect();
        let nodes = plants(problem, &nominal, &breakpoints, &Watch::new(quiet))?.set;
        let rotors = problem.rotors.iter().map(|r| r.name.clone()).collect();
        Ok(Self { sweeps, own_sweep, rotors, hover, revolutions, nodes })
    }
}

fn linear(base: &Vehicle, on: bool, point: &TrimPoint) -> Result<Linear, CliError> {
    let vehicle = base.with_interactions(on)?;
    let trim = point.clone().into_converged().map_err(|point| {
        CliError::Internal(format!("a trim on its orbit is {}", point.status.word()))
    })?;
    let models = || -> Result<Linear, LinearError> {
        let full = averaged(&vehicle, &trim, &LinearOptions::default())?;
        let reduced = residualise(&full, &RIGID_BODY)?.model;
        Ok(Linear { interactions: on, full, reduced })
    };
    Ok(models()?)
}

/// Flies the period of a trim once more and looks at it at every azimuth of a
/// revolution: with equal blades a revolution has several periods.
fn revolution(vehicle: &Vehicle, point: &TrimPoint) -> Revolution {
    let advance = vehicle.period * vehicle.reference_speed;
    let periods = (TAU / advance).round().max(1.0) as usize;
    let steps = point.steps * SAMPLES.div_ceil(periods * point.steps.max(1)).max(1);
    let shooting = Shooting::new(vehicle, point.condition, point.method, steps);
    let mut flown: Vec<(f64, Vec<f64>, Vec<f64>)> = Vec::new();
    shooting.fly(&point.state, &point.sticks, |_, time, state, effectors| {
        flown.push((time * vehicle.reference_speed, state.to_vec(), effectors.to_vec()));
    });
    let mut work = vehicle.workspace::<f64>();
    let mut rates = vec![0.0; vehicle.state_count()];
    let (mut azimuth, mut output) = (Vec::new(), Vec::new());
    for period in 0..periods {
        for (angle, state, effectors) in &flown {
            let angle = angle + period as f64 * advance;
            vehicle.rates(angle, state, effectors, [0.0; 3], &mut work, &mut rates);
            azimuth.push(angle);
            output.push(vehicle.output(state, effectors, [0.0; 3], &work));
        }
    }
    // The revolution closes on itself.
    if let Some(first) = output.first().cloned() {
        azimuth.push(periods as f64 * advance);
        output.push(first);
    }
    Revolution { airspeed: point.condition.airspeed, azimuth, output }
}
