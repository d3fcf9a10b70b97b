//! Which rotors are resolved in azimuth, and the period that these share.
//!
//! A *resolved* rotor has its blades where they stand, so the dynamics repeat
//! themselves with its blade passages. An *averaged* rotor acts with the mean of
//! its loads over all azimuths, at each instant; it may turn at any speed and
//! has no period of its own.

use crate::problem::{AzimuthModel, HubKind, Problem, Rotor, TeeterEquation};
use crate::vehicle::VehicleError;
use std::f64::consts::TAU;

/// Most passages of the slowest rotor within which rotors that must be resolved
/// have to come round together.
const LONGEST_PERIOD: usize = 240;
/// Most passages of the slowest rotor for which a rotor is resolved that need
/// not be: a longer period costs more than the ripple of that rotor is worth.
const LONGEST_BY_DEFAULT: usize = 4;
/// How near to a whole number of blade passages counts as whole.
const PERIOD_TOLERANCE: f64 = 1e-9;

/// How the rotors of a problem turn.
#[derive(Debug, Clone, PartialEq)]
pub struct Turning {
    /// One a rotor.
    pub models: Vec<AzimuthModel>,
    /// Speed of the slowest resolved rotor, or of the slowest rotor where none
    /// is resolved, rad/s: the reference azimuth turns with it.
    pub reference_speed: f64,
    /// Shortest time in which every resolved rotor makes a whole number of its
    /// passages, s; one passage of the slowest rotor where none is resolved,
    /// which is then a time like any other.
    pub period: f64,
    /// How many passages of the slowest resolved rotor make the period.
    pub passages: usize,
}

impl Turning {
    /// Chooses for every rotor of a problem.
    ///
    /// # Errors
    /// Rotors that must be resolved, without a common period.
    pub fn of(problem: &Problem) -> Result<Self, VehicleError> {
        let rotors = &problem.rotors;
        let formulation = &problem.formulation;
        let exact =
            formulation.teeter_torque_tilt && formulation.teeter_equation == TeeterEquation::Exact;
        let asked: Vec<Option<AzimuthModel>> = rotors
            .iter()
            .map(|rotor| match rotor.hub_kind {
                // Published formulas are those of blades where they stand.
                HubKind::Teetering { .. } if !exact => Some(AzimuthModel::Resolved),
                _ => rotor.azimuth,
            })
            .collect();
        let mut models: Vec<AzimuthModel> =
            asked.iter().map(|model| model.unwrap_or(AzimuthModel::Averaged)).collect();
        let slowest = |chosen: &[usize]| {
            chosen.iter().copied().min_by(|&a, &b| rotors[a].speed.total_cmp(&rotors[b].speed))
        };
        let resolved = |models: &[AzimuthModel]| -> Vec<usize> {
            (0..rotors.len()).filter(|&k| models[k] == AzimuthModel::Resolved).collect()
        };
        let mut open: Vec<usize> = (0..rotors.len()).filter(|&k| asked[k].is_none()).collect();
        open.sort_by(|&a, &b| rotors[a].speed.total_cmp(&rotors[b].speed));
        let must = resolved(&models);
        let mut common = common_period(rotors, &must).ok_or_else(|| {
            let names = must.iter().map(|&k| rotors[k].name.as_str()).collect::<Vec<_>>();
            VehicleError::NoCommonPeriod { rotors: names.join("`, `"), passages: LONGEST_PERIOD }
        })?;
        for &rotor in &open {
            let mut with = resolved(&models);
            with.push(rotor);
            let most = common.1.max(LONGEST_BY_DEFAULT);
            if let Some(longer) = common_period(rotors, &with).filter(|(_, n)| *n <= most) {
                models[rotor] = AzimuthModel::Resolved;
                common = longer;
            }
        }
        let all: Vec<usize> = (0..rotors.len()).collect();
        let chosen = resolved(&models);
        let (chosen, steady) = if chosen.is_empty() { (all, true) } else { (chosen, false) };
        let reference = slowest(&chosen).map_or(1.0, |k| rotors[k].speed);
        let (period, passages) = if steady {
            (slowest(&chosen).map_or(1.0, |k| passage(&rotors[k])), 1)
        } else {
            common
        };
        Ok(Self { models, reference_speed: reference, period, passages })
    }
}

/// Time after which the rotor repeats itself, s: from one blade to the next, or
/// to the next but one where the reactionless mode of an even number of blades
/// tells neighbours apart.
fn passage(rotor: &Rotor) -> f64 {
    let flapping =
        matches!(rotor.hub_kind, HubKind::Articulated { .. } | HubKind::Hingeless { .. });
    let alternate = flapping && rotor.blades > 2 && rotor.blades.is_multiple_of(2);
    let places = if alternate { rotor.blades / 2 } else { rotor.blades };
    TAU / (places as f64 * rotor.speed)
}

/// Shortest time (s) in which these rotors make a whole number of blade
/// passages, and how many it is of those that take longest; a period of no
/// rotors is none at all, `(0, 0)`.
fn common_period(rotors: &[Rotor], chosen: &[usize]) -> Option<(f64, usize)> {
    let longest = chosen.iter().map(|&k| passage(&rotors[k])).fold(0.0, f64::max);
    if chosen.is_empty() {
        return Some((0.0, 0));
    }
    (1..=LONGEST_PERIOD).map(|count| (count as f64 * longest, count)).find(|(period, _)| {
        chosen.iter().all(|&k| {
            let passages = period / passage(&rotors[k]);
            (passages - passages.round()).abs() < PERIOD_TOLERANCE * passages
        })
    })
}
