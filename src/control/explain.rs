//! Why a requirement is missed, what could be had instead, and what each costs.
//!
//! One channel at one speed for the nominal model, the other channels as they
//! are. Prices are the duals of the conic program at the answer; attainable
//! values are found by solving again with one target moved.

use super::axis::{Channel, GainSet};
use super::law::LawTable;
use super::loops::{GainGrid, LoopModel};
use super::metrics::{decibels, from_decibels};
use super::plant::{ModelClass, Plant};
use super::spec::{ChannelRequirement, Specification};
pub use super::tuning::Target;
use super::tuning::{
    ChannelProblem, ChannelSpec, LoopSet, Merit, Price, Shared, TuningError, equivalent_delay,
    start_gains,
};
use serde::{Deserialize, Serialize};

impl Target {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Target::PhaseMargin => "phase margin",
            Target::GainMargin => "gain margin",
            Target::Drb => "DRB",
            Target::Drp => "DRP",
            Target::CrossoverMin => "least crossover",
        }
    }

    /// Unit for people.
    pub fn unit(self) -> &'static str {
        match self {
            Target::PhaseMargin => "deg",
            Target::GainMargin | Target::Drp => "dB",
            Target::Drb | Target::CrossoverMin => "rad/s",
        }
    }

    /// Value in a specification, in [`Target::unit`]; `None`: not required.
    pub fn get(self, spec: &ChannelSpec) -> Option<f64> {
        let t = &spec.nominal;
        match self {
            Target::PhaseMargin => Some(t.phase.to_degrees()),
            Target::GainMargin => Some(decibels(t.gain_up.min(t.gain_down))),
            Target::Drb => t.drb,
            Target::Drp => t.drp.map(decibels),
            Target::CrossoverMin => t.crossover_min,
        }
    }

    fn set(self, spec: &mut ChannelSpec, value: f64) {
        let t = &mut spec.nominal;
        match self {
            Target::PhaseMargin => t.phase = value.to_radians(),
            Target::GainMargin => {
                t.gain_up = from_decibels(value);
                t.gain_down = t.gain_up;
            }
            Target::Drb => t.drb = Some(value),
            Target::Drp => t.drp = Some(from_decibels(value)),
            Target::CrossoverMin => t.crossover_min = Some(value),
        }
    }

    /// The easiest value that is looked at.
    fn easiest(self, asked: f64) -> f64 {
        match self {
            Target::PhaseMargin | Target::GainMargin | Target::Drb | Target::CrossoverMin => {
                0.2 * asked
            }
            Target::Drp => asked + 10.0,
        }
    }
}

/// What is known about one target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TargetReport {
    /// The target.
    pub target: Target,
    /// What is asked for, in its unit.
    pub asked: f64,
    /// Best attainable value with the other targets held, if the
    /// specification cannot be met; `None`: moving this target alone does not
    /// help.
    pub attainable: Option<f64>,
    /// Change of actuator activity, %, for the tightening of `price_of`, if
    /// the specification can be met: from the duals, so to first order.
    pub price_percent: Option<f64>,
    /// The tightening that the price is of.
    pub price_of: String,
}

/// What is known about a channel at a speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// Channel.
    pub axis: String,
    /// True airspeed, m/s.
    pub speed_m_s: f64,
    /// Whether the nominal model can meet all targets at once here.
    pub attainable: bool,
    /// Each target.
    pub targets: Vec<TargetReport>,
}

impl Explanation {
    /// Targets that conflict: relaxing any one of them alone lets the others
    /// be met.
    pub fn conflicting(&self) -> Vec<Target> {
        self.targets.iter().filter(|t| t.attainable.is_some()).map(|t| t.target).collect()
    }
}

/// Worst violation, in slack units, that counts as met.
const MET: f64 = 2e-3;
/// Halvings of the interval of a target.
const HALVINGS: usize = 7;

/// Explains a channel at one speed for the nominal model, around a law.
///
/// # Errors
/// As the tuning's.
pub fn explain(
    spec: &Specification,
    table: &LawTable,
    plant: &Plant,
    requirement: &ChannelRequirement,
) -> Result<Explanation, TuningError> {
    let channel = requirement.channel;
    let mut grid = spec.solver.grid.clone();
    // Targets move: more points where they may lie.
    grid.extend((0..80).map(|k| 0.1 * 60f64.powf(f64::from(k) / 79.0)));
    grid.sort_by(f64::total_cmp);
    grid.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
    let point = table.at(plant.speed);
    let law = GainGrid::new(table, plant.speed, grid.into());
    let model = LoopModel::new(plant, &law, spec.hardware, 0.0)?;
    let models = LoopSet { nodes: vec![vec![model]], undivided: vec![None], between: Vec::new() };
    let start =
        if channel.is_outer() { point.gains } else { super::verify::inner_only(&point.gains) };
    // Gains that strain for what cannot be had are a bad start for what can.
    let delay = equivalent_delay(plant, &point.inversion, channel.axis(), &spec.hardware)?;
    let mut fresh = start;
    fresh[channel.index()] = start_gains(channel, delay, requirement.spec.integral_ratio);
    let mut slow = start;
    slow[channel.index()] = start_gains(channel, 2.0 * delay, requirement.spec.integral_ratio);
    let solve = |channel_spec: &ChannelSpec, priced: bool| {
        let mut best: Option<(Merit, Vec<Price>)> = None;
        for first in [start, fresh, slow] {
            let mut gains: Vec<GainSet> = vec![first];
            let shared =
                Shared { classes: &[ModelClass::Nominal], models: &models, speeds: &[plant.speed] };
            let mut problem =
                ChannelProblem::new(channel, channel_spec, shared, &gains, 1.0, &spec.solver);
            // As many unstable poles as the design, or not at all.
            let (x, reference) = (problem.values(&gains), problem.values(&[start]));
            if problem.merit(&x, Some(&reference)).is_none() {
                continue;
            }
            let merit = problem.run(&mut gains)?;
            let prices = if priced { problem.prices(&gains)? } else { Vec::new() };
            let worst = merit.worst();
            if best.as_ref().is_none_or(|b| worst < b.0.worst()) {
                best = Some((merit, prices));
            }
            if worst < MET {
                break;
            }
        }
        best.ok_or(TuningError::Empty("no start was tried"))
    };
    let tuned = requirement.tuned();
    let (base, prices) = solve(&tuned, true)?;
    let attainable = base.worst() < MET;
    let mut targets = Vec::new();
    for target in Target::ALL {
        let Some(asked) = target.get(&tuned) else { continue };
        let price_of = target.unit_tightening().1;
        let mut report = TargetReport {
            target,
            asked,
            attainable: None,
            price_percent: None,
            price_of: price_of.into(),
        };
        let with = |value: f64| {
            let mut moved = tuned;
            target.set(&mut moved, value);
            solve(&moved, false)
        };
        if attainable {
            report.price_percent = prices.iter().find(|p| p.target == target).map(|p| p.percent);
        } else {
            let (mut easy, mut hard) = (target.easiest(asked), asked);
            if with(easy)?.0.worst() < MET {
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (easy + hard);
                    if with(middle)?.0.worst() < MET {
                        easy = middle;
                    } else {
                        hard = middle;
                    }
                }
                report.attainable = Some(easy);
            }
        }
        targets.push(report);
    }
    Ok(Explanation {
        axis: Channel::name(channel).into(),
        speed_m_s: plant.speed,
        attainable,
        targets,
    })
}
