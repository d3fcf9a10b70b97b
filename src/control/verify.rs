//! Verification of a law, separate from its tuning.
//!
//! Every metric by its exact definition on dense frequency grids with refined
//! crossings, at the breakpoints and between them, for every model, and the
//! eigenvalues of the full-order closed loop. The loop is that of the law as it
//! is flown, [`super::closed_loop`]: inner loops under an attitude demand, outer
//! loops under a velocity demand. Nothing of the conic programs nor of the
//! tuning's affine loops is used.

pub use super::axis::inner_only;
use super::axis::{Axis, Channel, ChannelGains};
use super::closed_loop::{Closed, LawLoop, LawResponse, PlantLoop, closed_loop_matrix};
use super::law::{LawPoint, LawTable, YAW_LEAD};
use super::loops::{Cut, FrequencyModel};
use super::metrics::{self, Margins, Sampled, decibels};
use super::plant::{Hardware, ModelClass, ModelSet, PlantError, RIGID_STATES};
use super::spec::{ChannelRequirement, Comfort, Specification};
use super::stability::{self, PADE_ORDER};
use super::tuning::{DRIFT_GROWTH, START_GROWTH, Targets, WHOLE_SHARE, default_grid};
use crate::linear::{LinearError, dense};
use crate::units::STANDARD_GRAVITY as GRAVITY;
use num_complex::Complex64 as C;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Schema of the verification file.
pub const SCHEMA: &str = "coaxdesign.verification/1";

/// Points of the dense grid above 0.03 rad/s.
const GRID_POINTS: usize = 900;
/// Highest frequency of the dense grid, rad/s.
const HIGHEST: f64 = 100.0;
/// How far below a requirement, relative to the comfortable excess, still
/// counts as met: refinement error, not leniency.
const MET_TOLERANCE: f64 = 1e-6;
/// Closed-loop modes above this frequency are not judged for damping, rad/s.
const DAMPING_BAND: f64 = 12.0;
/// Largest change of the fastest-growing mode from one Padé order to the next
/// but one that counts as agreement, 1/s.
const PADE_TOLERANCE: f64 = 1e-3;

/// Why a verification could not be carried out.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// A plant is unusable.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// Eigenvalues could not be found.
    #[error(transparent)]
    Linear(#[from] LinearError),
}

/// Verification of a law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// [`SCHEMA`].
    pub schema: String,
    /// Whether every row and stability check passed.
    pub passed: bool,
    /// Whether every nominal row passed.
    pub nominal_passed: bool,
    /// Unit and meaning of every column.
    pub columns: Vec<[String; 2]>,
    /// One a channel, speed and model.
    pub rows: Vec<Row>,
    /// One a speed and model.
    pub stability: Vec<Stability>,
    /// Where a closed outer loop is held to no requirement, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_required: Vec<NotRequired>,
}

/// A speed within the range of an outer loop at which it is held to no
/// requirement. Where it fades by design, what is left of it cannot reject what
/// the whole loop does; its share in the margins at the effectors is judged with
/// the inner axes. Where it is open, there is nothing to hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NotRequired {
    /// Channel.
    pub axis: String,
    /// True airspeed, m/s.
    pub speed_m_s: f64,
    /// Why.
    pub reason: Fading,
    /// Share of its attitude that the loop commands there.
    pub share: f64,
}

/// Why an outer loop is held to no requirement at a speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Fading {
    /// Its gains go to zero between two breakpoints.
    Gains,
    /// Turn coordination takes over its attitude (Eq. 75).
    TurnCoordination,
    /// The schedule has no gains for it there.
    Open,
    /// No speed that is looked at lies in its range.
    NoSpeed,
}

impl Fading {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Gains => "its gains fade to the next breakpoint",
            Self::TurnCoordination => "turn coordination takes over its attitude",
            Self::Open => "the schedule has no gains for it there",
            Self::NoSpeed => "no speed that is looked at lies in its range",
        }
    }
}

/// Metrics of a channel at one speed and model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Channel.
    pub axis: String,
    /// True airspeed, m/s.
    pub speed_m_s: f64,
    /// Whether the speed is a breakpoint of the schedule.
    pub breakpoint: bool,
    /// Model.
    pub model: String,
    /// Its class.
    pub class: ModelClass,
    /// Disturbance rejection bandwidth, rad/s; null: beyond the grid.
    pub drb_rad_s: Option<f64>,
    /// Disturbance rejection peak, dB.
    pub drp_db: f64,
    /// Crossover, rad/s; null: none.
    pub crossover_rad_s: Option<f64>,
    /// Gain margin upward, dB; null: infinite.
    pub gm_up_db: Option<f64>,
    /// Gain margin downward, dB; null: infinite.
    pub gm_down_db: Option<f64>,
    /// Phase margin, deg; null: infinite.
    pub pm_deg: Option<f64>,
    /// Balanced disk margin.
    pub disk_margin: f64,
    /// Actuator activity, % per unit noise.
    pub activity: f64,
    /// ADS-33 bandwidth of the attitude response, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bandwidth_rad_s: Option<f64>,
    /// ADS-33 phase delay, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase_delay_s: Option<f64>,
    /// Least design margin of all requirements, %; null: no requirement.
    pub design_margin_percent: Option<f64>,
    /// The requirement with that margin.
    pub binding: Option<String>,
    /// Whether every requirement is met.
    pub passed: bool,
    /// Requirements that are missed: name, value, bound.
    pub missed: Vec<Missed>,
}

/// A missed requirement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Missed {
    /// Requirement.
    pub requirement: String,
    /// What was found.
    pub value: f64,
    /// What was asked for.
    pub bound: f64,
}

/// Closed-loop eigenvalues at one speed and model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stability {
    /// True airspeed, m/s.
    pub speed_m_s: f64,
    /// Model.
    pub model: String,
    /// Whether the outer loops are closed.
    pub outer_loops: bool,
    /// Largest real part, 1/s.
    pub growth_per_s: f64,
    /// Least damping ratio of modes within the pilot's range.
    pub least_damping: Option<f64>,
    /// Change of the largest real part when the delay's Padé approximation is
    /// refined, 1/s.
    pub pade_change_per_s: f64,
    /// What the eigenvalues say.
    #[serde(default)]
    pub verdict: Verdict,
    /// Every growing mode, the fastest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub growing_modes: Vec<GrowingMode>,
    /// Whether it passes: stable, or a drift that the outer loops hold, and the
    /// approximation of the delay does not matter.
    pub passed: bool,
}

/// What closed-loop eigenvalues say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No mode grows.
    #[default]
    Stable,
    /// With the outer loops open, velocities drift apart slower than
    /// [`DRIFT_GROWTH`]; closing the outer loops holds them.
    Drifts,
    /// A mode grows.
    Unstable,
    /// The eigenvalues still move when the delay's approximation is refined.
    Unsure,
}

/// A mode that grows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GrowingMode {
    /// The measured state with the largest share in it, a velocity of 9.8 m/s
    /// counted like an angle of 1 rad.
    pub state: String,
    /// Real part, 1/s.
    pub growth_per_s: f64,
    /// Imaginary part, rad/s.
    pub frequency_rad_s: f64,
    /// Time to double, s.
    pub time_to_double_s: f64,
}

/// Verifies a law on a model set (which may hold speeds between breakpoints)
/// against a specification.
///
/// # Errors
/// Unusable plants; missed requirements are data.
pub fn verify(
    table: &LawTable,
    set: &ModelSet,
    hardware: &Hardware,
    spec: &Specification,
) -> Result<Verification, VerifyError> {
    let grid: Arc<[f64]> = {
        let mut g = default_grid(0.01, HIGHEST, GRID_POINTS);
        g.push(metrics::LOWEST_REJECTION_FREQUENCY);
        g.sort_by(f64::total_cmp);
        g.into()
    };
    let jobs: Vec<(usize, usize)> =
        (0..set.plants.len()).flat_map(|v| (0..set.models.len()).map(move |m| (v, m))).collect();
    let flown: Vec<Flown> =
        set.plants.par_iter().map(|plants| Flown::new(table, plants[0].speed, &grid)).collect();
    let results: Vec<(Vec<Row>, Vec<Stability>)> = jobs
        .par_iter()
        .map(|&(v, m)| one(table, &flown[v], set, hardware, spec, &grid, (v, m)))
        .collect::<Result<_, _>>()?;
    let (mut rows, mut checks) = (Vec::new(), Vec::new());
    for (r, s) in results {
        rows.extend(r);
        checks.extend(s);
    }
    let speeds = set.speeds();
    let not_required = spec
        .channels
        .iter()
        .filter(|c| c.channel.is_outer())
        .flat_map(|c| not_required(table, c, &speeds))
        .collect();
    let stable = checks.iter().all(|s| s.passed);
    tracing::info!(
        rows = rows.len(),
        passed = rows.iter().filter(|r| r.passed).count(),
        loops = checks.len(),
        stable = checks.iter().filter(|s| s.passed).count(),
        "verified"
    );
    Ok(Verification {
        schema: SCHEMA.into(),
        passed: stable && rows.iter().all(|r| r.passed),
        nominal_passed: stable
            && rows.iter().all(|r| r.passed || r.class == ModelClass::OffNominal),
        columns: COLUMNS.iter().map(|c| c.map(String::from)).collect(),
        rows,
        stability: checks,
        not_required,
    })
}

/// Meaning of the columns of [`Row`].
const COLUMNS: [[&str; 2]; 12] = [
    ["speed_m_s", "true airspeed, m/s"],
    ["drb_rad_s", "first frequency at which |S| rises through -3.01 dB, outer loops open, rad/s"],
    ["drp_db", "largest |S|, outer loops open, dB"],
    ["crossover_rad_s", "last 0 dB crossing of L, rad/s"],
    ["gm_up_db", "smallest gain increase to instability, outer loops open and closed, dB"],
    ["gm_down_db", "smallest gain decrease to instability, outer loops open and closed, dB"],
    ["pm_deg", "smallest phase margin of all crossings, outer loops open and closed, deg"],
    ["disk_margin", "min 2|1+L|/|1-L|"],
    ["activity", "rms stick command per unit white noise, 0.3 to 40 rad/s, %"],
    ["bandwidth_rad_s", "ADS-33 bandwidth of attitude to command, rad/s"],
    ["phase_delay_s", "ADS-33 phase delay of attitude to command, s"],
    ["design_margin_percent", "0: on the bound, 100: comfortable; least of all requirements"],
];

/// Whether a loop is closed at both breakpoints between which a speed lies: else
/// its gains fade there, and what they do is no answer to its requirements.
fn whole(table: &LawTable, channel: Channel, speed: f64) -> bool {
    let points = table.points();
    let slack = 1e-6;
    let below = points.partition_point(|p| p.speed <= speed + slack).checked_sub(1);
    let above = Some(points.partition_point(|p| p.speed < speed - slack));
    // Beyond its ends the table is constant.
    [below, above]
        .iter()
        .flatten()
        .filter_map(|&index| points.get(index))
        .all(|p| p.gains[channel.index()] != ChannelGains::default())
}

/// Why an outer loop is held to no requirement at a speed where it is closed
/// and in its range; `None`: it is held to them.
fn fading(table: &LawTable, channel: Channel, speed: f64) -> Option<Fading> {
    if table.outer_share(channel, speed) < WHOLE_SHARE {
        Some(Fading::TurnCoordination)
    } else if !whole(table, channel, speed) {
        Some(Fading::Gains)
    } else {
        None
    }
}

/// Where an outer loop is held to no requirement within its range.
fn not_required(
    table: &LawTable,
    requirement: &ChannelRequirement,
    speeds: &[f64],
) -> Vec<NotRequired> {
    let (channel, range) = (requirement.channel, requirement.spec.speeds);
    let entry = |speed: f64, reason: Fading, share: f64| NotRequired {
        axis: channel.name().into(),
        speed_m_s: speed,
        reason,
        share,
    };
    let inside: Vec<f64> =
        speeds.iter().copied().filter(|v| requirement.spec.applies(*v)).collect();
    if inside.is_empty() {
        // A range that holds none of the speeds ends somewhere.
        let end = range.into_iter().find(|v| v.is_finite()).unwrap_or(0.0);
        return vec![entry(end, Fading::NoSpeed, 0.0)];
    }
    let at = |speed: &f64| {
        if table.at(*speed).gains[channel.index()] == ChannelGains::default() {
            return Some(entry(*speed, Fading::Open, 0.0));
        }
        let reason = fading(table, channel, *speed)?;
        Some(entry(*speed, reason, table.outer_share(channel, *speed)))
    };
    inside.iter().filter_map(at).collect()
}

/// The law at one speed: with the outer loops open, and closed where there are
/// any; and the responses of both over the grid, which every model shares.
struct Flown {
    point: LawPoint,
    /// Outer loops open, and closed.
    modes: Vec<Mode>,
}

struct Mode {
    law: LawLoop,
    responses: Vec<LawResponse>,
}

impl Flown {
    fn new(table: &LawTable, speed: f64, grid: &[f64]) -> Self {
        let point = table.at(speed);
        let outer_closed = inner_only(&point.gains) != point.gains;
        let modes = [false, true]
            .into_iter()
            .filter(|velocity| outer_closed || !velocity)
            .map(|velocity| {
                let law = LawLoop::new(table, speed, velocity);
                let responses = grid.iter().map(|&w| law.at(w)).collect();
                Mode { law, responses }
            })
            .collect();
        Self { point, modes }
    }
}

fn one(
    table: &LawTable,
    flown: &Flown,
    set: &ModelSet,
    hardware: &Hardware,
    spec: &Specification,
    grid: &Arc<[f64]>,
    (v, m): (usize, usize),
) -> Result<(Vec<Row>, Vec<Stability>), VerifyError> {
    let (plant, info) = (&set.plants[v][m], &set.models[m]);
    let point = &flown.point;
    let breakpoint = table.points().iter().any(|p| (p.speed - plant.speed).abs() < 1e-6);
    let frequency = FrequencyModel::new(plant, *hardware, info.extra_delay)?;
    let states: Vec<_> = grid.iter().map(|&w| frequency.states(w)).collect();
    let curves: Vec<Vec<Closed>> = flown
        .modes
        .iter()
        .map(|mode| {
            grid.iter()
                .zip(&states)
                .zip(&mode.responses)
                .map(|((&w, x), law)| Closed::new(w, *x, law.clone()))
                .collect()
        })
        .collect();
    let outer_closed = curves.len() > 1;
    let mut rows = Vec::new();
    for requirement in &spec.channels {
        let channel = requirement.channel;
        if channel.is_outer()
            && !(requirement.spec.applies(plant.speed)
                && fading(table, channel, plant.speed).is_none())
        {
            // Outside its range, or fading: not required here.
            continue;
        }
        if point.gains[channel.index()] == ChannelGains::default() {
            // The loop is open here: fine for an outer loop outside its range,
            // a miss for everything else.
            if !channel.is_outer() {
                rows.push(open_row(requirement, plant.speed, breakpoint, info));
            }
            continue;
        }
        // Inner loops: rejection and crossover with the outer loops open, as
        // the attitude systems that the requirements speak of.
        let own = usize::from(channel.is_outer());
        let own_cut = if channel.is_outer() { Cut::Channel } else { Cut::Effector };
        let of = |mode: usize| PlantLoop::new(&frequency, &flown.modes[mode].law);
        let curve = |mode: usize, value: &dyn Fn(&Closed) -> C| -> Vec<C> {
            curves[mode].iter().map(value).collect()
        };
        let margins = |mode: usize, cut: Cut| {
            let values = curve(mode, &|closed| closed.cut(channel, cut));
            let exact = |w: f64| of(mode).at(w).cut(channel, cut);
            metrics::margins(Sampled { omega: grid, value: &values, exact: Some(&exact) })
        };
        let mut found = margins(own, own_cut);
        if outer_closed {
            // The effector's margins with everything closed.
            found = worse(found, margins(1, Cut::Effector));
        }
        let s = curve(own, &|closed| closed.sensitivity(channel));
        let exact = |w: f64| of(own).at(w).sensitivity(channel);
        let rejection = metrics::rejection(Sampled { omega: grid, value: &s, exact: Some(&exact) });
        let u = curve(own, &|closed| closed.activity(channel));
        let activity = metrics::activity(Sampled::new(grid, &u), metrics::ACTIVITY_BAND);
        let bandwidth = matches!(channel, Channel::Roll | Channel::Pitch).then(|| {
            let response = |w: f64| of(0).at(w).attitude(channel.axis());
            let values = curve(0, &|closed| closed.attitude(channel.axis()));
            metrics::bandwidth(Sampled { omega: grid, value: &values, exact: Some(&response) })
        });
        let targets = requirement.spec.targets(info.class);
        let mut row = Row {
            axis: channel.name().into(),
            speed_m_s: plant.speed,
            breakpoint,
            model: info.name.clone(),
            class: info.class,
            drb_rad_s: rejection.bandwidth,
            drp_db: decibels(rejection.peak),
            crossover_rad_s: found.crossover,
            gm_up_db: found.gain_up.map(decibels),
            gm_down_db: found.gain_down.map(decibels),
            pm_deg: found.phase.map(f64::to_degrees),
            disk_margin: found.disk,
            activity,
            bandwidth_rad_s: bandwidth.and_then(|b| b.phase_limited),
            phase_delay_s: bandwidth.and_then(|b| b.phase_delay),
            design_margin_percent: None,
            binding: None,
            passed: true,
            missed: Vec::new(),
        };
        judge(&mut row, targets, &spec.comfort);
        rows.push(row);
    }
    let mut checks = Vec::new();
    for (mode, outer_loops) in flown.modes.iter().zip([false, true]) {
        let matrix =
            |order: usize| closed_loop_matrix(plant, &mode.law, hardware, info.extra_delay, order);
        let fine = matrix(PADE_ORDER + 2)?;
        let first = dense::eigenvalues(&matrix(PADE_ORDER)?)?;
        let refined = dense::eigenvalues(&fine)?;
        let growth = stability::growth(&refined);
        let change = (growth - stability::growth(&first)).abs();
        let verdict = if change >= PADE_TOLERANCE || !growth.is_finite() {
            Verdict::Unsure
        } else if growth < START_GROWTH {
            Verdict::Stable
        } else if outer_closed && !outer_loops && growth < DRIFT_GROWTH {
            Verdict::Drifts
        } else {
            Verdict::Unstable
        };
        let mut growing: Vec<_> =
            refined.iter().filter(|e| e.re >= START_GROWTH && e.im >= 0.0).copied().collect();
        growing.sort_by(|a, b| b.re.total_cmp(&a.re));
        checks.push(Stability {
            speed_m_s: plant.speed,
            model: info.name.clone(),
            outer_loops,
            growth_per_s: growth,
            least_damping: stability::least_damping(&refined, DAMPING_BAND),
            pade_change_per_s: change,
            verdict,
            growing_modes: growing
                .into_iter()
                .map(|e| GrowingMode {
                    state: stability::leading_state(&fine, &plant.measured, e)
                        .map_or("undetermined", |k| RIGID_STATES[k])
                        .into(),
                    growth_per_s: e.re,
                    frequency_rad_s: e.im,
                    time_to_double_s: std::f64::consts::LN_2 / e.re,
                })
                .collect(),
            passed: matches!(verdict, Verdict::Stable | Verdict::Drifts),
        });
    }
    Ok((rows, checks))
}

fn open_row(
    requirement: &ChannelRequirement,
    speed: f64,
    breakpoint: bool,
    info: &super::plant::ModelInfo,
) -> Row {
    Row {
        axis: requirement.channel.name().into(),
        speed_m_s: speed,
        breakpoint,
        model: info.name.clone(),
        class: info.class,
        drb_rad_s: Some(0.0),
        drp_db: 0.0,
        crossover_rad_s: None,
        gm_up_db: None,
        gm_down_db: None,
        pm_deg: None,
        disk_margin: 2.0,
        activity: 0.0,
        bandwidth_rad_s: None,
        phase_delay_s: None,
        design_margin_percent: None,
        binding: Some("the loop is open".into()),
        passed: false,
        missed: Vec::new(),
    }
}

/// The smaller of each margin; the crossover of the first.
fn worse(a: Margins, b: Margins) -> Margins {
    let least = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    };
    Margins {
        crossover: a.crossover,
        phase: least(a.phase, b.phase),
        gain_up: least(a.gain_up, b.gain_up),
        gain_down: least(a.gain_down, b.gain_down),
        disk: a.disk.min(b.disk),
    }
}

/// Fills in design margin, binding requirement and misses.
fn judge(row: &mut Row, t: &Targets, comfort: &Comfort) {
    let mut list: Vec<(&str, f64, f64, f64)> = Vec::new();
    // (name, value, bound, excess over the bound in units of the comfortable one)
    let at_least = |value: f64, bound: f64, full: f64| (value - bound) / full;
    if let Some(v) = row.gm_up_db {
        let bound = decibels(t.gain_up);
        list.push(("gm_up_db", v, bound, at_least(v, bound, comfort.gain_margin)));
    }
    if let Some(v) = row.gm_down_db {
        let bound = decibels(t.gain_down);
        list.push(("gm_down_db", v, bound, at_least(v, bound, comfort.gain_margin)));
    }
    if let Some(v) = row.pm_deg {
        let bound = t.phase.to_degrees();
        list.push(("pm_deg", v, bound, at_least(v, bound, comfort.phase_margin.to_degrees())));
    }
    if let (Some(v), Some(bound)) = (row.drb_rad_s, t.drb) {
        list.push(("drb_rad_s", v, bound, at_least(v, bound, comfort.drb * bound)));
    }
    if let Some(bound) = t.drp.map(decibels) {
        list.push(("drp_db", row.drp_db, bound, (bound - row.drp_db) / comfort.drp));
    }
    let crossover = row.crossover_rad_s.unwrap_or(0.0);
    if let Some(bound) = t.crossover_min {
        let excess = at_least(crossover, bound, comfort.crossover * bound);
        list.push(("crossover_min_rad_s", crossover, bound, excess));
    }
    if let Some(bound) = t.crossover_max {
        let excess = at_least(bound, crossover, comfort.crossover * bound);
        list.push(("crossover_max_rad_s", crossover, bound, excess));
    }
    if let Some(least) = list.iter().min_by(|a, b| a.3.total_cmp(&b.3)) {
        row.design_margin_percent = Some(100.0 * least.3);
        row.binding = Some(least.0.into());
    }
    row.missed = list
        .iter()
        .filter(|l| l.3 < -MET_TOLERANCE)
        .map(|l| Missed { requirement: l.0.into(), value: l.1, bound: l.2 })
        .collect();
    row.passed = row.missed.is_empty();
}

/// A blade pitch, rad, or a commanded rotor speed, rad/s, as a function of the
/// sticks.
#[derive(Debug, Clone, PartialEq)]
pub struct BladeControl {
    /// Name, such as `upper collective`.
    pub name: String,
    /// Per % of lat, lon, col, ped.
    pub gain: [f64; 4],
    /// At zero sticks.
    pub offset: f64,
    /// Limits.
    pub limits: [f64; 2],
    /// Whether it is a blade pitch, for which the rate limit holds.
    pub pitch: bool,
}

/// What a step command asks of sticks and blades.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Authority {
    /// Axis of the step.
    pub axis: String,
    /// True airspeed, m/s.
    pub speed_m_s: f64,
    /// The control that comes closest to its limit, or goes furthest beyond.
    pub control: String,
    /// Its largest excursion from trim, % of the room between trim and limit.
    pub used_percent: f64,
    /// Largest blade pitch rate of any control, deg/s.
    pub rate_deg_s: f64,
    /// Its limit, deg/s.
    #[serde(default)]
    pub rate_limit_deg_s: f64,
    /// Size of the step: rad, rad/s in yaw, m/s in heave.
    #[serde(default)]
    pub step: f64,
    /// Largest step, in the same unit, that stays within limits and rates. The
    /// demand is linear in the step.
    #[serde(default)]
    pub largest_step: f64,
    /// Whether all controls stay within limits and rates.
    pub passed: bool,
}

/// Time and longest step of the authority check, s.
const AUTHORITY_TIME: [f64; 2] = [5.0, 0.005];
/// Most of an actuator's own time in a step of the authority check: its
/// integration is stable up to about 1.
const AUTHORITY_STEP: f64 = 0.2;

/// What the step commands of a specification ask of the blades at each
/// breakpoint: the feed-forward of the law on its own reference model, through
/// the actuators. Feedback adds to this only what disturbances cost.
///
/// A step of yaw rate is a turn: as in the law under a velocity command, bank
/// goes with it, and yaw is led through the roll command model as speed grows.
/// The turn is at most that of a bank as large as the roll step.
pub fn authority(
    table: &LawTable,
    hardware: &Hardware,
    spec: &Specification,
    blades: &[BladeControl],
    stick_limits: &[[f64; 2]; 4],
) -> Vec<Authority> {
    let mut out = Vec::new();
    let steps = [spec.steps.roll, spec.steps.pitch, spec.steps.yaw, spec.steps.heave];
    for point in table.points() {
        for axis in Axis::ALL {
            let mut size = steps[axis.index()];
            if axis == Axis::Yaw {
                size =
                    size.min(GRAVITY * spec.steps.roll.tan() / point.speed.max(f64::MIN_POSITIVE));
            }
            // Both directions: trim is seldom in the middle.
            let worst = [1.0, -1.0]
                .map(|sign| {
                    step_demand(
                        table,
                        point,
                        hardware,
                        axis,
                        sign * size,
                        spec,
                        blades,
                        stick_limits,
                    )
                })
                .into_iter()
                .min_by(|a, b| a.largest_step.total_cmp(&b.largest_step));
            out.extend(worst);
        }
    }
    out
}

#[allow(clippy::too_many_arguments)]
fn step_demand(
    table: &LawTable,
    point: &super::law::LawPoint,
    hardware: &Hardware,
    axis: Axis,
    step: f64,
    spec: &Specification,
    blades: &[BladeControl],
    stick_limits: &[[f64; 2]; 4],
) -> Authority {
    use nalgebra::{SVector, Vector4};
    let inv = &point.inversion;
    let settings = &table.settings;
    let (end, longest) = (AUTHORITY_TIME[0], AUTHORITY_TIME[1]);
    let dt = longest.min(AUTHORITY_STEP / hardware.actuator_bandwidth);
    let i = axis.index();
    // Commands of bank, pitch, yaw rate and vertical velocity, and references.
    let mut command = [0.0; 4];
    command[i] = step;
    let (mut value, mut rate) = ([0.0; 4], [0.0; 2]);
    let (mut turn, mut turn_rate) = (0.0, 0.0);
    let mut together = 0.0;
    if axis == Axis::Yaw {
        command[0] = (point.speed * step / GRAVITY).atan();
        together = (YAW_LEAD * point.speed / table.turn.speed).clamp(0.0, 1.0);
    }
    let frequencies = [settings.roll_frequency, settings.pitch_frequency];
    let constants = [settings.yaw_time_constant, settings.heave_time_constant];
    let mut z = SVector::<f64, 2>::zeros();
    let trim = Vector4::from_column_slice(&inv.trim.sticks);
    let (mut stick, mut stick_rate) = (Vector4::zeros(), Vector4::<f64>::zeros());
    let mut worst = (f64::NEG_INFINITY, String::new());
    let mut fastest = 0.0f64;
    let wa = hardware.actuator_bandwidth;
    for _ in 0..(end / dt) as usize {
        let mut nu = Vector4::zeros();
        let mut rho = SVector::<f64, 6>::zeros();
        let second_order = |wn: f64, command: f64, value: f64, rate: f64| {
            wn * wn * (command - value) - 2.0 * settings.attitude_damping * wn * rate
        };
        if axis == Axis::Yaw {
            let wn = settings.roll_frequency;
            turn_rate += dt * second_order(wn, step, turn, turn_rate);
            turn += dt * turn_rate;
            let led = turn + settings.yaw_time_constant * turn_rate;
            command[2] = (1.0 - together) * step + together * led;
        }
        for k in 0..2 {
            nu[k] = second_order(frequencies[k], command[k], value[k], rate[k]);
            rho[k] = value[k];
            rho[2 + k] = rate[k];
            rate[k] += dt * nu[k];
            value[k] += dt * rate[k];
        }
        for k in 2..4 {
            nu[k] = (command[k] - value[k]) / constants[k - 2];
            rho[2 + k] = value[k];
            value[k] += dt * nu[k];
        }
        let x = inv.reference.state * z + inv.reference.input * rho;
        let wanted = inv.decoupling * (nu - inv.feedback * x);
        z += (inv.reference.dynamics * x + inv.reference.drive * nu) * dt;
        stick_rate +=
            ((wanted - stick) * wa * wa - stick_rate * (2.0 * hardware.actuator_damping * wa)) * dt;
        stick += stick_rate * dt;
        let total = trim + stick;
        let mut look = |name: &str, at_trim: f64, now: f64, [low, high]: [f64; 2]| {
            let room = if now >= at_trim { high - at_trim } else { at_trim - low };
            let used = 100.0 * (now - at_trim).abs() / room.max(1e-12);
            if used > worst.0 {
                worst = (used, name.into());
            }
        };
        for (j, limits) in stick_limits.iter().enumerate() {
            look(&format!("{} stick", crate::problem::STICKS[j]), trim[j], total[j], *limits);
        }
        for b in blades {
            let at = |s: &Vector4<f64>| b.offset + (0..4).map(|j| b.gain[j] * s[j]).sum::<f64>();
            look(&b.name, at(&trim), at(&total), b.limits);
            if !b.pitch {
                continue;
            }
            let r: f64 = (0..4).map(|j| b.gain[j] * stick_rate[j]).sum();
            fastest = fastest.max(r.abs());
        }
    }
    let share = (0.01 * worst.0).max(fastest / spec.pitch_rate_limit).max(f64::MIN_POSITIVE);
    Authority {
        axis: axis.name().into(),
        speed_m_s: point.speed,
        control: worst.1,
        used_percent: worst.0,
        rate_deg_s: fastest.to_degrees(),
        rate_limit_deg_s: spec.pitch_rate_limit.to_degrees(),
        step: step.abs(),
        largest_step: step.abs() / share,
        passed: worst.0 <= 100.0 && fastest <= spec.pitch_rate_limit,
    }
}

/// What the hardware allows in roll or pitch, known before any tuning.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LagLaw {
    /// Equivalent delay, s.
    pub equivalent_delay_s: f64,
    /// Largest disturbance rejection bandwidth at 45° and 6 dB, rad/s.
    pub largest_drb_rad_s: f64,
    /// Crossover there, rad/s.
    pub crossover_rad_s: f64,
}

impl LagLaw {
    /// Largest DRB about 0.110/τ and crossover about 0.40/τ at a phase margin
    /// of 45° and gain margins of 6 dB: found on attitude loops with a
    /// flapping lag, an actuator and a delay of this sum.
    pub fn new(delay: f64) -> Self {
        Self {
            equivalent_delay_s: delay,
            largest_drb_rad_s: 0.110 / delay,
            crossover_rad_s: 0.40 / delay,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::LawPoint;
    use super::super::plant::Inversion;
    use super::super::{spec, testbed};
    use super::*;
    use crate::control::axis::GainSet;

    /// An outer loop to 50 kt over breakpoints every 20 kt is whole to 40 kt, and
    /// fades from there to 60 kt; one that is closed at the ends is whole beyond.
    #[test]
    fn a_fading_loop_is_not_whole() {
        let points = [0.0, 20.0, 40.0, 60.0, 80.0]
            .map(|speed| {
                let mut gains = GainSet::default();
                gains[Channel::Roll.index()] = ChannelGains::new(2.0, 2.2, 0.22);
                if speed <= 40.0 {
                    gains[Channel::Vx.index()] = ChannelGains::new(0.0, 0.1, 0.01);
                }
                let plant = testbed::plant(speed, &testbed::NOMINAL);
                LawPoint { speed, gains, inversion: Inversion::new(&plant).unwrap() }
            })
            .to_vec();
        let spec = spec::builtin().unwrap();
        let table = LawTable::new(points, spec.law, spec.turn).unwrap();
        for (speed, closed) in [
            (-5.0, true),
            (0.0, true),
            (10.0, true),
            (40.0, true),
            (40.0 + 1e-9, true),
            (40.1, false),
            (50.0, false),
            (59.9, false),
            (60.0, false),
            (90.0, false),
        ] {
            assert_eq!(whole(&table, Channel::Vx, speed), closed, "{speed}");
            assert!(whole(&table, Channel::Roll, speed), "{speed}");
        }
    }
}
