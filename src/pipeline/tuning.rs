//! From a problem and a specification to a verified schedule.

use rayon::prelude::*;
use serde_json::{Value as Json, json};

use super::observer::Running;
use super::requirements::{models_hash, problem_hash};
use super::{Observer, PipelineError, Requirements, Task};
use crate::control::axis::Channel;
use crate::control::design::{Design, design};
use crate::control::explain::{Explanation, Site};
use crate::control::law::LawTable;
use crate::control::misses::misses;
use crate::control::models::{Built, LeftOut, build_until, from_set};
use crate::control::plant::{Hardware, ModelSet, Plant};
use crate::control::spec::{ChannelRequirement, Specification};
use crate::control::tuning::Price;
use crate::control::verify::{Authority, BladeControl, Row, Verification, authority};
use crate::lti::LtiSet;
use crate::problem::{LONGEST_NAME, Loaded, Problem, check_name};
use crate::schedule::{Provenance, Schedule};

/// Two speeds nearer than this are the same, m/s.
const SAME_SPEED: f64 = 1e-6;

/// What is tuned and what is explained.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TuneOptions {
    /// Outer loops to tune; all of the specification where none is named. The
    /// inner axes are always tuned.
    pub channels: Vec<Channel>,
    /// Explain the hardest breakpoint of every axis, not only where it misses.
    pub explain_all: bool,
}

/// A verification with all that belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    /// Every metric, and closed-loop stability.
    pub verification: Verification,
    /// What step commands ask of the blades.
    pub authority: Vec<Authority>,
    /// Models and speeds without a trim.
    pub left_out: Vec<LeftOut>,
}

impl Verified {
    /// Whether every row and loop passed and no model was left out.
    #[must_use]
    pub fn met(&self) -> bool {
        self.verification.passed && self.left_out.is_empty()
    }
}

/// A tuned, verified law.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// What flies, with its provenance.
    pub schedule: Schedule,
    /// The law and how it came about: prices, lag laws, work.
    pub design: Design,
    /// Plants at the breakpoints, the nominal model first.
    pub nodes: ModelSet,
    /// The verification at the breakpoints and between them.
    pub verified: Verified,
    /// Why targets are missed; on request also what met ones cost.
    pub explanations: Vec<Explanation>,
}

impl Tuned {
    /// `verification.json`.
    ///
    /// # Errors
    /// None in practice: all values can be written as JSON.
    pub fn verification_document(&self) -> Result<Json, serde_json::Error> {
        verification_document(&self.verified, &self.explanations, &self.design.tuning.prices)
    }
}

/// Speeds at which a law is verified, m/s: its breakpoints, their middles, and
/// further ones; in order, none twice.
#[must_use]
pub fn verification_speeds(breakpoints: &[f64], more: &[f64]) -> Vec<f64> {
    let mut speeds = breakpoints.to_vec();
    speeds.extend(breakpoints.windows(2).map(|w| 0.5 * (w[0] + w[1])));
    speeds.extend_from_slice(more);
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|a, b| (*a - *b).abs() < SAME_SPEED);
    speeds
}

/// Plants of every model of a specification at these speeds, m/s.
///
/// # Errors
/// A model that makes no vehicle or cannot be linearised, no speed at which
/// all models trim, or an observer that stops.
pub fn plants(
    problem: &Problem,
    specification: &Specification,
    speeds: &[f64],
    observer: &dyn Observer,
) -> Result<Built, PipelineError> {
    let models = &specification.models;
    let _running = Running::begin(observer, Task::Models, speeds.len() * models.len())?;
    let stop = || observer.cancelled();
    Ok(build_until(problem, models, speeds, &|| observer.advance(), &stop)?)
}

/// Blade controls, commanded rotor speeds and control surfaces of a problem, for the authority check.
#[must_use]
pub fn blade_controls(problem: &Problem) -> Vec<BladeControl> {
    let c = &problem.controls;
    let mut out = Vec::new();
    for (k, (rotor, mix)) in problem.rotors.iter().zip(&c.mix).enumerate() {
        let parts = [
            ("collective", mix.theta_0, c.collective_limits[k]),
            ("theta_1c", mix.theta_1c, c.cyclic_limits[k]),
            ("theta_1s", mix.theta_1s, c.cyclic_limits[k]),
        ];
        for (i, (name, gain, limits)) in parts.into_iter().enumerate() {
            // A propeller whose speed is its control has a pitch that nothing moves.
            if rotor.motor.is_some() && gain == [0.0; 4] {
                continue;
            }
            out.push(BladeControl {
                name: format!("{} {name}", rotor.name),
                gain,
                offset: mix.rigging[i],
                limits,
                pitch: true,
            });
        }
        if rotor.motor.is_some() {
            out.push(BladeControl {
                name: format!("{} speed", rotor.name),
                gain: mix.speed,
                offset: mix.speed_rigging,
                limits: c.speed_limits[k],
                pitch: false,
            });
        }
    }
    for (wing, surface) in
        problem.wings.iter().filter_map(|wing| Some((wing, wing.surface.as_ref()?)))
    {
        out.push(BladeControl {
            name: format!("{} deflection", wing.name),
            gain: surface.gearing,
            offset: surface.rigging,
            limits: surface.limits,
            pitch: false,
        });
    }
    out
}

/// The plants at some of the speeds of a set.
fn subset(set: &ModelSet, speeds: &[f64]) -> ModelSet {
    ModelSet {
        models: set.models.clone(),
        plants: set
            .plants
            .iter()
            .filter(|p| speeds.iter().any(|v| (v - p[0].speed).abs() < SAME_SPEED))
            .cloned()
            .collect(),
    }
}

/// Breakpoints that trim, and the outermost speeds that do where these lie
/// beyond: an end breakpoint that is left out would leave the law constant
/// over speeds at which it is verified.
fn with_ends(breakpoints: &[f64], trimmed: &[f64]) -> Vec<f64> {
    let mut speeds: Vec<f64> = breakpoints
        .iter()
        .copied()
        .filter(|b| trimmed.iter().any(|v| (v - b).abs() < SAME_SPEED))
        .collect();
    let inside = |v: &&f64| {
        breakpoints.first().is_some_and(|b| **v > *b)
            && breakpoints.last().is_some_and(|b| **v < *b)
    };
    let ends = [trimmed.iter().find(inside), trimmed.iter().rfind(inside)];
    let (low, high) = (speeds.first().copied(), speeds.last().copied());
    if let (Some(low), Some(high)) = (low, high) {
        speeds.extend(ends.into_iter().flatten().filter(|v| **v < low || **v > high));
    }
    speeds
}

/// Tunes a schedule to a specification, verifies it at the breakpoints and
/// between them, and explains what is missed.
///
/// Requirements that cannot be met are no error: the least-violating design
/// comes back, [`Verified::met`] is false, and so is
/// [`Schedule::requirements_met`].
///
/// # Errors
/// No models to tune on, an axis that the specification does not have, plants
/// that no gains stabilise, or an observer that stops.
pub fn tune(
    aircraft: &Loaded,
    requirements: &Requirements,
    options: &TuneOptions,
    observer: &dyn Observer,
) -> Result<Tuned, PipelineError> {
    let problem = &aircraft.problem;
    let spec = &requirements.specification;
    let speeds = verification_speeds(&spec.speeds, &spec.verify_speeds);
    let built = plants(problem, spec, &speeds, observer)?;
    let subject = Subject::of_problem(problem);
    let provenance = provenance(problem_hash(aircraft), requirements);
    tune_built(&subject, spec, built, provenance, options, observer)
}

/// As [`tune`], for linear models from elsewhere. Where these have the hardware
/// inside, the specification's counts for nothing.
///
/// # Errors
/// As [`tune`], and models that the specification asks for and a set cannot
/// give.
pub fn tune_models(
    set: &LtiSet,
    requirements: &Requirements,
    options: &TuneOptions,
    observer: &dyn Observer,
) -> Result<Tuned, PipelineError> {
    let spec = for_set(&requirements.specification, set);
    let speeds = verification_speeds(&spec.speeds, &spec.verify_speeds);
    let built = plants_of_models(set, &spec, &speeds)?;
    let provenance = provenance(models_hash(set), requirements);
    tune_built(&Subject::of_models(set), &spec, built, provenance, options, observer)
}

/// What a design is made for, its plants aside.
struct Subject {
    name: String,
    stick_limits: [[f64; 2]; 4],
    blades: Vec<BladeControl>,
}

impl Subject {
    fn of_problem(problem: &Problem) -> Self {
        Self {
            name: problem.name.clone(),
            stick_limits: problem.controls.stick_limits,
            blades: blade_controls(problem),
        }
    }

    /// Linear models say nothing of blades: sticks have the travel of the set. Of
    /// the set's name the schedule takes what every export can hold.
    fn of_models(set: &LtiSet) -> Self {
        let held = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { ' ' };
        let words: String = set.name.chars().map(held).collect();
        let words: Vec<&str> = words.split_whitespace().collect();
        let name: String = words.join(" ").chars().take(LONGEST_NAME).collect();
        let name = if check_name(&name).is_ok() { name } else { "models".into() };
        Self { name, stick_limits: set.stick_limits, blades: Vec::new() }
    }
}

fn provenance(problem_hash: String, requirements: &Requirements) -> Provenance {
    Provenance {
        generator: format!("coaxdesign {}", env!("CARGO_PKG_VERSION")),
        problem_hash,
        specification_hash: requirements.hash(),
    }
}

/// A specification for a set of models: without its hardware where the models
/// have theirs.
fn for_set(specification: &Specification, set: &LtiSet) -> Specification {
    let mut spec = specification.clone();
    if set.hardware_included {
        spec.hardware = Hardware::INCLUDED;
    }
    spec
}

/// Plants of linear models from elsewhere at these speeds, m/s.
///
/// # Errors
/// A model of the specification that the set cannot give, models that cannot be
/// reduced, stitched or inverted, or no speed within the set.
pub fn plants_of_models(
    set: &LtiSet,
    specification: &Specification,
    speeds: &[f64],
) -> Result<Built, PipelineError> {
    let inertia = specification.models_from.inertia;
    Ok(from_set(set, inertia, &specification.models, speeds)?)
}

fn tune_built(
    subject: &Subject,
    spec: &Specification,
    built: Built,
    provenance: Provenance,
    options: &TuneOptions,
    observer: &dyn Observer,
) -> Result<Tuned, PipelineError> {
    let nodes = subset(&built.set, &with_ends(&spec.speeds, &built.set.speeds()));
    if nodes.plants.is_empty() {
        return Err(PipelineError::NoBreakpoint);
    }
    let between: Vec<Plant> = built
        .set
        .plants
        .iter()
        .map(|p| p[0].clone())
        .filter(|p| nodes.plants.iter().all(|n| (n[0].speed - p.speed).abs() > SAME_SPEED))
        .collect();
    let design = {
        let _running = Running::begin(observer, Task::Tuning, 1)?;
        design(spec, &nodes, &between, &options.channels)?
    };
    let _running = Running::begin(observer, Task::Verification, 1)?;
    let limits = subject.stick_limits;
    let whole = built.set.clone();
    let verified = judge(&design.table, limits, &subject.blades, spec, built)?;
    let explanations = explanations(spec, &whole, &design, &verified.verification, options)?;
    let met = verified.met();
    let schedule =
        Schedule::new(&subject.name, &design.table, spec.hardware, limits, met, provenance);
    Ok(Tuned { schedule, design, nodes, verified, explanations })
}

/// Verifies a schedule, tuned here or elsewhere, against a specification, whose
/// hardware it takes.
///
/// # Errors
/// A schedule that is no law, no models to verify on, or an observer that
/// stops.
pub fn verify(
    schedule: &Schedule,
    problem: &Problem,
    specification: &Specification,
    observer: &dyn Observer,
) -> Result<Verified, PipelineError> {
    let (table, speeds) = law_and_speeds(schedule, specification)?;
    let built = plants(problem, specification, &speeds, observer)?;
    let _running = Running::begin(observer, Task::Verification, 1)?;
    judge(&table, schedule.stick_limits, &blade_controls(problem), specification, built)
}

/// As [`verify`], on linear models from elsewhere.
///
/// # Errors
/// As [`verify`] and [`tune_models`].
pub fn verify_models(
    schedule: &Schedule,
    set: &LtiSet,
    specification: &Specification,
    observer: &dyn Observer,
) -> Result<Verified, PipelineError> {
    let spec = for_set(specification, set);
    let (table, speeds) = law_and_speeds(schedule, &spec)?;
    let built = plants_of_models(set, &spec, &speeds)?;
    let _running = Running::begin(observer, Task::Verification, 1)?;
    judge(&table, schedule.stick_limits, &[], &spec, built)
}

fn law_and_speeds(
    schedule: &Schedule,
    specification: &Specification,
) -> Result<(LawTable, Vec<f64>), PipelineError> {
    let table = schedule.law()?;
    let breakpoints: Vec<f64> = table.points().iter().map(|p| p.speed).collect();
    let speeds = verification_speeds(&breakpoints, &specification.verify_speeds);
    Ok((table, speeds))
}

fn judge(
    table: &LawTable,
    stick_limits: [[f64; 2]; 4],
    blades: &[BladeControl],
    spec: &Specification,
    built: Built,
) -> Result<Verified, PipelineError> {
    let verification = crate::control::verify::verify(table, &built.set, &spec.hardware, spec)?;
    // Without blades there is nothing to hold against their limits.
    let authority = if blades.is_empty() {
        Vec::new()
    } else {
        authority(table, &spec.hardware, spec, blades, &stick_limits)
    };
    Ok(Verified { verification, authority, left_out: built.left_out })
}

/// Explains every requirement that an axis misses with a class of models, where
/// it is missed most; where `explain_all` asks for it also, for every axis, the
/// breakpoint at which the first model has the least design margin.
fn explanations(
    spec: &Specification,
    whole: &ModelSet,
    design: &Design,
    verification: &Verification,
    options: &TuneOptions,
) -> Result<Vec<Explanation>, PipelineError> {
    let mut places: Vec<(&ChannelRequirement, f64)> = Vec::new();
    let missed = misses(verification);
    for requirement in &spec.channels {
        let name = requirement.channel.name();
        let mut speeds: Vec<f64> =
            missed.iter().filter(|m| m.axis == name).map(|m| m.speed).collect();
        if options.explain_all {
            speeds.extend(hardest(verification, name, &whole.models[0].name));
        }
        speeds.sort_by(f64::total_cmp);
        speeds.dedup_by(|a, b| (*a - *b).abs() < SAME_SPEED);
        places.extend(speeds.into_iter().map(|v| (requirement, v)));
    }
    let explained: Result<Vec<Option<Explanation>>, _> = places
        .par_iter()
        .map(|(requirement, speed)| {
            let same = |v: f64| (v - speed).abs() < SAME_SPEED;
            let Some(plants) = whole.plants.iter().find(|p| same(p[0].speed)) else {
                return Ok(None);
            };
            let own = |r: &&Row| r.axis == requirement.channel.name() && same(r.speed_m_s);
            let rows: Vec<&Row> = verification.rows.iter().filter(own).collect();
            let site = Site {
                spec,
                table: &design.table,
                infos: &whole.models,
                plants,
                speed: *speed,
                requirement,
                rows: &rows,
                prices: &design.tuning.prices,
            };
            site.explain().map(Some)
        })
        .collect();
    Ok(explained?.into_iter().flatten().collect())
}

/// Speed of the breakpoint at which an axis has the least design margin with a
/// model, m/s.
fn hardest(verification: &Verification, axis: &str, model: &str) -> Option<f64> {
    let margin = |row: &Row| row.design_margin_percent.unwrap_or(0.0);
    verification
        .rows
        .iter()
        .filter(|r| r.axis == axis && r.model == model && r.breakpoint)
        .filter(|r| r.design_margin_percent.is_some())
        .min_by(|a, b| margin(a).total_cmp(&margin(b)))
        .map(|row| row.speed_m_s)
}

/// Prices of a smaller size than this, %, are those of targets that do not
/// bind; they are not written.
pub const PRICE_SHOWN: f64 = 5e-3;

/// `verification.json`: schema
/// [`coaxdesign.verification/1`](crate::control::verify::SCHEMA).
///
/// # Errors
/// None in practice: all values can be written as JSON.
pub fn verification_document(
    verified: &Verified,
    explanations: &[Explanation],
    prices: &[Price],
) -> Result<Json, serde_json::Error> {
    let mut value = serde_json::to_value(&verified.verification)?;
    value["authority"] = json!(verified.authority);
    value["explanations"] = json!(explanations);
    value["prices"] = prices
        .iter()
        .filter(|p| p.percent.abs() >= PRICE_SHOWN)
        .map(|p| {
            json!({
                "axis": p.channel.name(),
                "speed_m_s": p.speed,
                "target": p.target,
                "tightening": p.target.unit_tightening().1,
                "activity_percent": p.percent,
            })
        })
        .collect();
    value["left_out"] = verified
        .left_out
        .iter()
        .map(|l| json!({ "model": l.model, "speed_m_s": l.speed, "reason": l.reason }))
        .collect();
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An end that does not trim is replaced by the outermost speed that does;
    /// a breakpoint in the middle is not, nor one beyond the schedule.
    #[test]
    fn ends_that_do_not_trim_are_replaced() {
        let breakpoints = [0.0, 10.0, 20.0];
        assert_eq!(with_ends(&breakpoints, &[0.0, 5.0, 10.0, 15.0, 20.0]), breakpoints);
        assert_eq!(with_ends(&breakpoints, &[0.0, 5.0, 10.0, 15.0]), [0.0, 10.0, 15.0]);
        assert_eq!(with_ends(&breakpoints, &[0.0, 5.0, 15.0, 20.0]), [0.0, 20.0]);
        assert_eq!(with_ends(&breakpoints, &[0.0, 10.0, 30.0]), [0.0, 10.0]);
    }

    #[test]
    fn a_law_is_verified_at_its_breakpoints_and_between_them() {
        assert_eq!(
            verification_speeds(&[0.0, 10.0, 30.0], &[5.0, 25.0]),
            [0.0, 5.0, 10.0, 20.0, 25.0, 30.0]
        );
    }
}
