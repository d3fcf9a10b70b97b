//! From a specification and a model set to a tuned law.

use super::axis::{Axis, Channel};
use super::law::{LawError, LawPoint, LawTable};
use super::loops::LawSettings;
use super::plant::{Inversion, ModelSet, Plant};
use super::spec::Specification;
use super::tuning::{Tuning, TuningError, TuningProblem, equivalent_delay};
use super::verify::LagLaw;

/// A tuned law and how it came about.
#[derive(Debug, Clone)]
pub struct Design {
    /// The law.
    pub table: LawTable,
    /// The tuning.
    pub tuning: Tuning,
    /// What the hardware allows in roll and pitch, by speed.
    pub lag: Vec<(Axis, f64, LagLaw)>,
}

/// Why there is no design.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// The tuning could not be carried out.
    #[error(transparent)]
    Tuning(#[from] TuningError),
    /// The result is no table.
    #[error(transparent)]
    Law(#[from] LawError),
    /// No channel of the specification is among those asked for.
    #[error("none of the axes asked for is in the specification")]
    NoChannel,
}

/// Equivalent delay of roll and pitch at every speed of the nominal model.
///
/// # Errors
/// A plant that cannot be inverted.
pub fn lag_laws(
    spec: &Specification,
    set: &ModelSet,
) -> Result<Vec<(Axis, f64, LagLaw)>, TuningError> {
    let mut out = Vec::new();
    for axis in [Axis::Roll, Axis::Pitch] {
        for plants in &set.plants {
            let inversion = Inversion::new(&plants[0])?;
            let delay = equivalent_delay(&plants[0], &inversion, axis, &spec.hardware)?;
            out.push((axis, plants[0].speed, LagLaw::new(delay)));
        }
    }
    Ok(out)
}

/// The law's settings with the reference delay filled in.
pub fn settings(spec: &Specification, lag: &[(Axis, f64, LagLaw)]) -> LawSettings {
    let mut law = spec.law;
    if spec.automatic_reference_delay
        && let Some((_, _, first)) = lag.iter().find(|l| l.0 == Axis::Roll)
    {
        // To whole milliseconds: it becomes a number of control frames.
        law.reference_delay = (first.equivalent_delay_s * 1e3).round() / 1e3;
    }
    law
}

/// `between` holds plants of the first model between the breakpoints, at which
/// the interpolated law is tuned too.
///
/// Tunes the channels asked for (all if none is named; inner axes that are
/// not asked for are tuned too, since every loop is cut with the others
/// closed).
///
/// # Errors
/// Plants that cannot be inverted or stabilised, and programs that cannot be
/// posed. Requirements that cannot be met are not an error: the least-violating
/// design comes back, and the verification says so.
pub fn design(
    spec: &Specification,
    set: &ModelSet,
    between: &[Plant],
    only: &[Channel],
) -> Result<Design, DesignError> {
    let lag = lag_laws(spec, set)?;
    let law = settings(spec, &lag);
    let channels: Vec<_> = spec
        .channels
        .iter()
        .filter(|c| only.is_empty() || only.contains(&c.channel) || !c.channel.is_outer())
        .map(|c| (c.channel, c.tuned()))
        .collect();
    if channels.is_empty() || only.iter().any(|o| !spec.channels.iter().any(|c| c.channel == *o)) {
        return Err(DesignError::NoChannel);
    }
    let problem = TuningProblem {
        set,
        between: between.to_vec(),
        hardware: spec.hardware,
        settings: law,
        turn: spec.turn,
        channels,
        options: spec.solver.clone(),
    };
    let tuning = problem.tune(None)?;
    tracing::info!(
        speeds = tuning.speeds.len(),
        programs = tuning.stats.programs,
        solver_s = tuning.stats.solver_time,
        assembly_s = tuning.stats.assembly_time,
        "tuned"
    );
    let points = tuning
        .speeds
        .iter()
        .zip(&tuning.gains)
        .zip(&tuning.inversions)
        .map(|((&speed, &gains), inversion)| LawPoint {
            speed,
            gains,
            inversion: inversion.clone(),
        })
        .collect();
    Ok(Design { table: LawTable::new(points, law, spec.turn)?, tuning, lag })
}
