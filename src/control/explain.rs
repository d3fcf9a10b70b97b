//! Why rows of a verification are missed, what could be had instead, and the
//! key to change.
//!
//! An axis at one speed, with all models of the specification at that speed,
//! under the law as it is flown there, the other axes as they are. What can be
//! had is found by solving the axis again with one requirement moved, and is
//! verified. What the requirements cost where they are met is told by the prices
//! of the tuning, of which there is one set.

use super::axis::{Channel, GainSet};
use super::law::{LawPoint, LawTable};
use super::loops::{GainGrid, LoopModel};
use super::metrics::{self, decibels, from_decibels};
use super::misses::key;
use super::plant::{Inversion, ModelClass, ModelInfo, ModelSet, Plant};
use super::spec::{ChannelRequirement, Scales, Specification};
pub use super::tuning::Target;
use super::tuning::{
    ChannelProblem, ChannelSpec, LoopSet, Price, Shared, Targets, TuningError, TuningOptions,
    equivalent_delay, start_gains,
};
use super::verify::{Row, Verification, VerifyError, verify};
use crate::units::KNOT;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

impl Target {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Target::PhaseMargin => "phase margin",
            Target::GainMargin => "gain margin",
            Target::Drb => "DRB",
            Target::Drp => "DRP",
            Target::CrossoverMin => "least crossover",
            Target::CrossoverMax => "largest crossover",
        }
    }

    /// Unit for people.
    pub fn unit(self) -> &'static str {
        match self {
            Target::PhaseMargin => "deg",
            Target::GainMargin | Target::Drp => "dB",
            Target::Drb | Target::CrossoverMin | Target::CrossoverMax => "rad/s",
        }
    }

    /// Names of the requirement in the rows of a verification.
    fn requirements(self) -> &'static [&'static str] {
        match self {
            Target::PhaseMargin => &["pm_deg"],
            Target::GainMargin => &["gm_up_db", "gm_down_db"],
            Target::Drb => &["drb_rad_s"],
            Target::Drp => &["drp_db"],
            Target::CrossoverMin => &["crossover_min_rad_s"],
            Target::CrossoverMax => &["crossover_max_rad_s"],
        }
    }

    /// Whether a larger value is the harder one.
    fn rises(self) -> bool {
        !matches!(self, Target::Drp | Target::CrossoverMax)
    }

    /// Value in a specification, in [`Target::unit`]; `None`: not required.
    pub fn get(self, spec: &ChannelSpec, class: ModelClass) -> Option<f64> {
        let t = spec.targets(class);
        match self {
            Target::PhaseMargin => Some(t.phase.to_degrees()),
            Target::GainMargin => Some(decibels(t.gain_up.min(t.gain_down))),
            Target::Drb => t.drb,
            Target::Drp => t.drp.map(decibels),
            Target::CrossoverMin => t.crossover_min,
            Target::CrossoverMax => t.crossover_max,
        }
    }

    fn put(self, t: &mut Targets, value: f64) {
        match self {
            Target::PhaseMargin => t.phase = value.to_radians(),
            Target::GainMargin => {
                t.gain_up = from_decibels(value);
                t.gain_down = t.gain_up;
            }
            Target::Drb => t.drb = Some(value),
            Target::Drp => t.drp = Some(from_decibels(value)),
            Target::CrossoverMin => t.crossover_min = Some(value),
            Target::CrossoverMax => t.crossover_max = Some(value),
        }
    }

    /// What the worst of some rows reach, in the target's unit; `None`: no row
    /// has a limit.
    fn reached(self, rows: &[&Row]) -> Option<f64> {
        let least = |values: Vec<Option<f64>>| values.into_iter().flatten().reduce(f64::min);
        let of = |value: &dyn Fn(&Row) -> Option<f64>| rows.iter().map(|r| value(r)).collect();
        match self {
            Target::PhaseMargin => least(of(&|r| r.pm_deg)),
            Target::GainMargin => least(of(&|r| match (r.gm_up_db, r.gm_down_db) {
                (Some(up), Some(down)) => Some(up.min(down)),
                (up, down) => up.or(down),
            })),
            Target::Drb => least(of(&|r| r.drb_rad_s)),
            Target::Drp => rows.iter().map(|r| r.drp_db).reduce(f64::max),
            Target::CrossoverMin => least(of(&|r| Some(r.crossover_rad_s.unwrap_or(0.0)))),
            Target::CrossoverMax => rows.iter().filter_map(|r| r.crossover_rad_s).reduce(f64::max),
        }
    }
}

/// A requirement of one class of models that a key of the specification sets.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lever {
    target: Target,
    class: ModelClass,
}

impl Lever {
    /// Moves what the key moves: an axis's own requirements, which nominal
    /// models must meet, move those of off-nominal models along.
    fn set(self, spec: &mut ChannelSpec, value: f64) {
        let asked = self.target.get(spec, ModelClass::Nominal);
        let off = self.target.get(spec, ModelClass::OffNominal);
        let own = match self.class {
            ModelClass::Nominal => &mut spec.nominal,
            ModelClass::OffNominal => &mut spec.off_nominal,
        };
        self.target.put(own, value);
        if let (ModelClass::Nominal, Some(asked), Some(off)) = (self.class, asked, off) {
            match self.target {
                Target::PhaseMargin | Target::GainMargin => {}
                Target::Drp => self.target.put(&mut spec.off_nominal, off + value - asked),
                _ => self.target.put(&mut spec.off_nominal, off * value / asked),
            }
        }
    }

    /// A value easier than another by a share of it.
    fn eased(self, value: f64, share: f64) -> f64 {
        match self.target {
            Target::Drp => value + 20.0 * share,
            Target::CrossoverMax => value * (1.0 + 4.0 * share),
            _ => value * (1.0 - share),
        }
    }

    /// The easier of two values.
    fn easier(self, a: f64, b: f64) -> f64 {
        if self.target.rises() { a.min(b) } else { a.max(b) }
    }

    /// A value harder than another by the tightening that prices are of.
    fn tightened(self, value: f64) -> f64 {
        let by = self.target.unit_tightening().0;
        match self.target {
            Target::PhaseMargin => value + by.to_degrees(),
            Target::GainMargin => value + decibels(by.exp()),
            Target::Drp => value - decibels(by.exp()),
            Target::Drb | Target::CrossoverMin => value * by.exp(),
            Target::CrossoverMax => value / by.exp(),
        }
    }

    /// The key that asks for it.
    fn key(self, axis: &str) -> String {
        key(axis, self.target.requirements()[0], self.class).0
    }

    /// What to write at the key for a value, rounded to the side that can be had.
    fn text(self, spec: &ChannelSpec, scales: &Scales, value: f64) -> String {
        let round = |value: f64, up: bool| {
            let scale = 10f64.powf(3.0 - value.abs().max(1e-9).log10().ceil());
            let digits = value * scale;
            (if up { digits.ceil() } else { digits.floor() }) / scale
        };
        let nominal = self.class == ModelClass::Nominal;
        let own = self.target.get(spec, ModelClass::Nominal).unwrap_or(value);
        match self.target {
            Target::PhaseMargin => format!("\"{} deg\"", round(value, false)),
            Target::GainMargin => round(value, false).to_string(),
            Target::Drp if nominal => round(value - scales.drp_extra, true).to_string(),
            Target::Drp => round(value - (own - scales.drp_extra), true).to_string(),
            Target::Drb if nominal => format!("\"{} rad/s\"", round(value / scales.drb, false)),
            Target::Drb => round(value / own * scales.drb, false).to_string(),
            Target::CrossoverMin if nominal => {
                format!("\"{} rad/s\"", round(value / scales.crossover, false))
            }
            Target::CrossoverMin => round(value / own * scales.crossover, false).to_string(),
            Target::CrossoverMax if nominal => {
                format!("\"{} rad/s\"", round(value * scales.crossover, true))
            }
            // The key's inverse is the factor.
            Target::CrossoverMax => round(own / value * scales.crossover, false).to_string(),
        }
    }
}

/// A requirement that holds another back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Binding {
    /// The requirement.
    pub target: Target,
    /// Whose.
    pub class: ModelClass,
    /// The key of the specification that asks for it.
    pub key: String,
}

/// What is known about one target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TargetReport {
    /// The target.
    pub target: Target,
    /// Whose: the nominal or the off-nominal models.
    #[serde(default = "nominal")]
    pub class: ModelClass,
    /// What is asked for, in its unit.
    pub asked: f64,
    /// What the design reaches here with the worst model of the class; null:
    /// nothing limits it.
    #[serde(default)]
    pub reached: Option<f64>,
    /// Whether the design misses it here.
    #[serde(default)]
    pub missed: bool,
    /// Of a missed target: the best value that can be had with the others held,
    /// where those that are missed too are held at what the design reaches.
    /// Of a met one: the value at which, moved alone, it lets everything be
    /// met; null: it stands against nothing, or moving it alone is not enough.
    pub attainable: Option<f64>,
    /// Of a missed target with an attainable value: what holds it there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bound_by: Vec<Binding>,
    /// The key of the specification that asks for it.
    #[serde(default)]
    pub key: String,
    /// What to write there for the attainable value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set_to: Option<String>,
    /// Where everything is met: rise of actuator activity, %, for the
    /// tightening of `price_of` with every model; the price of the tuning at this
    /// speed.
    pub price_percent: Option<f64>,
    /// The tightening that the price is of.
    pub price_of: String,
}

fn nominal() -> ModelClass {
    ModelClass::Nominal
}

/// What is known about an axis at a speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// Axis or outer loop.
    pub axis: String,
    /// True airspeed, m/s.
    pub speed_m_s: f64,
    /// Whether the speed is a breakpoint of the schedule.
    #[serde(default)]
    pub breakpoint: bool,
    /// Whether the design meets every target here, with every model.
    #[serde(default)]
    pub met: bool,
    /// Whether gains for this speed alone meet every target here, with every
    /// model; verified.
    pub attainable: bool,
    /// Where the speed alone could meet everything, but the design does not: the
    /// key that ties it to the others, and what to write there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remedy: Option<[String; 2]>,
    /// Each target.
    pub targets: Vec<TargetReport>,
}

impl Explanation {
    /// Met targets that stand against the missed ones: relaxing any one of them
    /// alone lets everything be met.
    pub fn conflicting(&self) -> Vec<Target> {
        let against = |t: &&TargetReport| !t.missed && t.attainable.is_some();
        self.targets.iter().filter(against).map(|t| t.target).collect()
    }
}

/// Worst violation, in slack units, that counts as met.
const MET: f64 = 1e-3;
/// Width of the interval of an attainable value, as a share of what is asked.
const RESOLUTION: f64 = 4e-3;
/// Halvings of that interval at most.
const HALVINGS: usize = 9;
/// Shares by which a value is eased until it can be had and is verified: the
/// tuning keeps a little distance, its region also forbids combinations, and the
/// verification looks more closely.
const EASINGS: [f64; 6] = [0.0, 0.01, 0.03, 0.08, 0.25, 0.6];
/// The easiest value that is looked at is easier by this share.
const EASIEST: f64 = 0.8;
/// Factor on the prices of violations: high, so that a target that can be met
/// is met.
const PRICE_SCALE: f64 = 10.0;

/// Why there is no explanation.
#[derive(Debug, thiserror::Error)]
pub enum ExplainError {
    /// A program could not be posed.
    #[error(transparent)]
    Tuning(#[from] TuningError),
    /// Gains could not be verified.
    #[error(transparent)]
    Verify(#[from] VerifyError),
}

/// An axis at one speed, and what is asked of it.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// The specification.
    pub spec: &'a Specification,
    /// The law.
    pub table: &'a LawTable,
    /// The models.
    pub infos: &'a [ModelInfo],
    /// Their plants at the speed, the inverted model first.
    pub plants: &'a [Plant],
    /// True airspeed, m/s.
    pub speed: f64,
    /// What is asked of the axis.
    pub requirement: &'a ChannelRequirement,
    /// The rows of the axis at the speed.
    pub rows: &'a [&'a Row],
    /// Prices of the tuning.
    pub prices: &'a [Price],
}

impl Site<'_> {
    /// Explains the site: where a row is missed by solving again, else by the
    /// prices of the tuning.
    ///
    /// # Errors
    /// As the tuning's and the verification's.
    pub fn explain(&self) -> Result<Explanation, ExplainError> {
        let met = self.rows.iter().all(|r| r.passed);
        let levers = self.levers();
        let mut out = Explanation {
            axis: self.channel().name().into(),
            speed_m_s: self.speed,
            breakpoint: self.rows.iter().any(|r| r.breakpoint),
            met,
            attainable: met,
            remedy: None,
            targets: levers.iter().map(|(lever, asked)| self.report(*lever, *asked)).collect(),
        };
        if !met {
            self.solve_again(&levers, &mut out)?;
        }
        Ok(out)
    }

    fn channel(&self) -> Channel {
        self.requirement.channel
    }

    /// Every requirement of every class that has a model, with its value.
    fn levers(&self) -> Vec<(Lever, f64)> {
        let mut out = Vec::new();
        for class in [ModelClass::Nominal, ModelClass::OffNominal] {
            if !self.infos.iter().any(|m| m.class == class) {
                continue;
            }
            for target in Target::ALL {
                if let Some(asked) = target.get(&self.requirement.spec, class) {
                    out.push((Lever { target, class }, asked));
                }
            }
        }
        out
    }

    fn report(&self, lever: Lever, asked: f64) -> TargetReport {
        let Lever { target, class } = lever;
        let of: Vec<&Row> = self.rows.iter().filter(|r| r.class == class).copied().collect();
        let names = target.requirements();
        let misses = |r: &Row| r.missed.iter().any(|m| names.contains(&m.requirement.as_str()));
        let price = self.prices.iter().find(|p| {
            p.channel == self.channel() && p.target == target && (p.speed - self.speed).abs() < 1e-6
        });
        TargetReport {
            target,
            class,
            asked,
            reached: target.reached(&of),
            missed: of.iter().any(|r| misses(r)),
            attainable: None,
            bound_by: Vec::new(),
            key: lever.key(self.channel().name()),
            set_to: None,
            price_percent: price.filter(|_| class == ModelClass::Nominal).map(|p| p.percent),
            price_of: target.unit_tightening().1.into(),
        }
    }

    fn solve_again(
        &self,
        levers: &[(Lever, f64)],
        out: &mut Explanation,
    ) -> Result<(), ExplainError> {
        for t in &mut out.targets {
            // The price of what is not had is that of missing it.
            t.price_percent = None;
        }
        let solver = Solver::new(self)?;
        let asked = self.requirement.spec;
        // Between breakpoints: as a breakpoint, which has an inversion of its own.
        let own;
        let alone = if out.breakpoint {
            solver.best(&asked, None)?
        } else {
            let inversion = Inversion::new(&self.plants[0]).map_err(TuningError::from)?;
            own = self.table.with_point(LawPoint { inversion, ..self.table.at(self.speed) });
            let added = Site { table: &own, ..*self };
            Solver::new(&added)?.best(&asked, None)?
        };
        if alone.is_some() {
            out.attainable = true;
            let smoothing = self.spec.solver.smoothing;
            out.remedy = Some(if out.breakpoint && smoothing > 0.0 {
                ["schedule.smoothing".into(), format!("{}", 0.1 * smoothing)]
            } else if out.breakpoint {
                ["schedule.speeds".into(), "breakpoints nearer to it".into()]
            } else {
                let knots = (1e3 * self.speed / KNOT).round() / 1e3;
                ["schedule.speeds".into(), format!("also \"{knots} kt\"")]
            });
            for t in out.targets.iter_mut().filter(|t| t.missed) {
                t.attainable = Some(t.asked);
            }
            return Ok(());
        }
        // What is missed is held at what is reached.
        let mut held = None;
        for share in EASINGS {
            let mut eased = asked;
            for (t, (lever, _)) in out.targets.iter().zip(levers).filter(|(t, _)| t.missed) {
                let reached = t.reached.unwrap_or(t.asked);
                lever.set(&mut eased, lever.eased(lever.easier(reached, t.asked), share));
            }
            if let Some(gains) = solver.best(&eased, None)? {
                held = Some((eased, gains));
                break;
            }
        }
        for (t, (lever, _)) in out.targets.iter_mut().zip(levers) {
            let (base, easy) = match (&held, t.missed) {
                (Some((held, _)), true) => (*held, lever.target.get(held, lever.class)),
                (None, true) => continue,
                (_, false) => (asked, Some(lever.eased(t.asked, EASIEST))),
            };
            let found = solver.hardest(*lever, &base, easy.unwrap_or(t.asked), t.asked)?;
            let Some((value, gains)) = found else { continue };
            t.attainable = Some(value);
            t.set_to = Some(lever.text(&asked, &self.spec.nominal_scales, value));
            if t.missed {
                let mut moved = base;
                lever.set(&mut moved, value);
                t.bound_by = solver.binding(*lever, levers, &moved, &gains)?;
            }
        }
        Ok(())
    }

    /// The verification of the axis at the speed with gains of its own.
    fn verification(
        &self,
        asked: &ChannelSpec,
        gains: &GainSet,
    ) -> Result<Verification, VerifyError> {
        let requirement = ChannelRequirement { spec: *asked, ..*self.requirement };
        let spec = Specification { channels: vec![requirement], ..self.spec.clone() };
        let table = self.table.with_gains_at(self.speed, *gains);
        let set = ModelSet { models: self.infos.to_vec(), plants: vec![self.plants.to_vec()] };
        verify(&table, &set, &spec.hardware, &spec)
    }
}

/// Solves the axis at the speed for requirements.
struct Solver<'a> {
    site: &'a Site<'a>,
    options: TuningOptions,
    classes: Vec<ModelClass>,
    starts: Vec<GainSet>,
    /// Whether the loops of the design are stable here: if they are not, another
    /// axis may be why, and stability is not asked of this one.
    stable: bool,
}

impl<'a> Solver<'a> {
    fn new(site: &'a Site<'a>) -> Result<Self, ExplainError> {
        let channel = site.channel();
        let point = site.table.at(site.speed);
        // Gains that strain for what cannot be had are a bad start for what can.
        let hardware = &site.spec.hardware;
        let delay = equivalent_delay(&site.plants[0], &point.inversion, channel.axis(), hardware)?;
        let mut starts = vec![point.gains];
        for factor in [1.0, 2.0] {
            let mut other = point.gains;
            let ratio = site.requirement.spec.integral_ratio;
            other[channel.index()] = start_gains(channel, factor * delay, ratio);
            starts.push(other);
        }
        let own = site.verification(&site.requirement.spec, &point.gains)?;
        Ok(Self {
            site,
            stable: own.stability.iter().all(|s| s.passed),
            options: TuningOptions {
                price_scale: PRICE_SCALE * site.spec.solver.price_scale,
                ..site.spec.solver.clone()
            },
            classes: site.infos.iter().map(|m| m.class).collect(),
            starts,
        })
    }

    /// The loops of the law as it is flown, on a grid that has the frequencies of
    /// the requirements.
    fn models(&self, spec: &ChannelSpec) -> Result<LoopSet, TuningError> {
        let mut grid = self.options.grid.clone();
        grid.push(metrics::LOWEST_REJECTION_FREQUENCY);
        for t in [&spec.nominal, &spec.off_nominal] {
            grid.extend([t.drb, t.crossover_min, t.crossover_max].into_iter().flatten());
        }
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
        let grid: Arc<[f64]> = grid.into();
        let Site { table, speed, plants, infos, spec, .. } = *self.site;
        let law = GainGrid::new(table, speed, grid);
        let nodes: Result<Vec<LoopModel>, _> = plants
            .iter()
            .zip(infos)
            .map(|(plant, info)| LoopModel::new(plant, &law, spec.hardware, info.extra_delay))
            .collect();
        // A channel has rows only where its loop is undivided.
        Ok(LoopSet { nodes: vec![nodes?], undivided: vec![None], between: Vec::new() })
    }

    /// What the tuning asks for so that requirements are met.
    fn tuned(&self, asked: &ChannelSpec) -> ChannelSpec {
        let requirement = ChannelRequirement { spec: *asked, ..*self.site.requirement };
        // The reserve is no requirement.
        ChannelSpec { phase_reserve: 0.0, ..requirement.tuned() }
    }

    /// Gains that meet requirements, verified; `None` where none were found. The
    /// search begins at `first`, if that is given, and at the usual starts.
    fn best(
        &self,
        asked: &ChannelSpec,
        first: Option<GainSet>,
    ) -> Result<Option<GainSet>, ExplainError> {
        let spec = self.tuned(asked);
        let models = self.models(&spec)?;
        let speeds = [self.site.speed];
        let shared = Shared { classes: &self.classes, models: &models, speeds: &speeds };
        let channel = self.site.channel();
        for start in first.iter().chain(&self.starts) {
            let mut gains = vec![*start];
            let mut problem =
                ChannelProblem::new(channel, &spec, shared, &gains, 1.0, &self.options);
            // As many unstable poles as the design, or not at all.
            let (x, reference) = (problem.values(&gains), problem.values(&self.starts[..1]));
            if problem.merit(&x, Some(&reference)).is_none() {
                continue;
            }
            if problem.run(&mut gains)?.worst() < MET {
                let found = self.site.verification(asked, &gains[0])?;
                let stable = !self.stable || found.stability.iter().all(|s| s.passed);
                if stable && found.rows.iter().all(|r| r.passed) {
                    return Ok(Some(gains[0]));
                }
            }
        }
        Ok(None)
    }

    /// The hardest value between an easy and a hard one that can be had, and
    /// gains for it; `None` where even the easy one cannot.
    fn hardest(
        &self,
        lever: Lever,
        base: &ChannelSpec,
        easy: f64,
        hard: f64,
    ) -> Result<Option<(f64, GainSet)>, ExplainError> {
        let with = |value: f64, first: Option<GainSet>| {
            let mut moved = *base;
            lever.set(&mut moved, value);
            self.best(&moved, first)
        };
        let Some(mut gains) = with(easy, None)? else { return Ok(None) };
        let (mut easy, mut hard) = (easy, hard);
        let width = RESOLUTION * hard.abs().max(1e-3);
        for _ in 0..HALVINGS {
            if (hard - easy).abs() < width {
                break;
            }
            let middle = 0.5 * (easy + hard);
            match with(middle, Some(gains))? {
                Some(found) => (easy, gains) = (middle, found),
                None => hard = middle,
            }
        }
        Ok(Some((easy, gains)))
    }

    /// Requirements besides `own` that gains meet with less room than the
    /// tightening that prices are of.
    fn binding(
        &self,
        own: Lever,
        levers: &[(Lever, f64)],
        asked: &ChannelSpec,
        gains: &GainSet,
    ) -> Result<Vec<Binding>, ExplainError> {
        let mut hard = *asked;
        // Each class by itself: keys that move both would hide which one binds.
        for (lever, _) in levers {
            let Some(value) = lever.target.get(asked, lever.class) else { continue };
            let targets = match lever.class {
                ModelClass::Nominal => &mut hard.nominal,
                ModelClass::OffNominal => &mut hard.off_nominal,
            };
            lever.target.put(targets, lever.tightened(value));
        }
        let found = self.site.verification(&hard, gains)?;
        let misses = |lever: &Lever| {
            found.rows.iter().filter(|r| r.class == lever.class).any(|r| {
                let names = lever.target.requirements();
                r.missed.iter().any(|m| names.contains(&m.requirement.as_str()))
            })
        };
        Ok(levers
            .iter()
            .map(|(lever, _)| *lever)
            .filter(|lever| *lever != own && misses(lever))
            .map(|lever| Binding {
                target: lever.target,
                class: lever.class,
                key: lever.key(self.site.channel().name()),
            })
            .collect())
    }
}
