//! Gains by a sequence of conic programs.
//!
//! One program tunes one channel at all speeds and for all models at once. At
//! the iterate x₀ every requirement is replaced by a convex one that implies
//! it near x₀ (half-planes between the Nyquist curve and the kite, cones for
//! the sensitivity), the actuator activity by its Gauss–Newton model, and the
//! program is solved within a trust region. The step is judged by the exact
//! requirements on the grid (the merit), and refused if it changes the
//! winding of D, that is the number of unstable poles.
//!
//! Requirements are elastic: each has a slack per speed with a price, so that
//! the program always has a solution and an unattainable specification ends
//! in the least-violating design.
//!
//! What must be met is in [`targets`]; a site is one speed and model with its
//! exact requirements, `rows` what is convex of them, `channel` a channel over
//! all sites, `program` its conic programs, `lattice` and `search` look for
//! other local answers, `sweeps` goes through the channels, `starts` begins.

mod channel;
mod lattice;
mod program;
mod rows;
mod search;
mod site;
mod starts;
mod sweeps;
pub mod targets;

pub use channel::{ChannelProblem, Merit};
pub use starts::{DRIFT_GROWTH, START_GROWTH, equivalent_delay, start_gains};
pub use targets::{ChannelSpec, Price, Requirement, Target, Targets};

use super::axis::{Channel, ChannelGains, GainSet};
use super::law::{LawError, LawPoint, LawTable, TurnCoordination};
use super::loops::{GainGrid, LawSettings, LoopModel};
use super::metrics;
use super::plant::{Hardware, Inversion, ModelClass, ModelSet, Plant, PlantError};
use crate::numerics::conic::ConicError;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;
use sweeps::{LATER_TRUST, Run, Sweeps};

/// Factor on the prices in the last sweeps.
const LAST_PRICES: f64 = 10.0;
/// Least share of an attitude at which an outer loop is held to its
/// requirements; with less, it is fading into turn coordination.
pub const WHOLE_SHARE: f64 = 1.0 - 1e-6;
/// Number of the last sweeps at most.
const LAST_SWEEPS: usize = 4;

/// Settings of the tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct TuningOptions {
    /// Frequency grid, rad/s.
    pub grid: Vec<f64>,
    /// Weight λ of the differences between neighbouring speeds.
    pub smoothing: f64,
    /// Largest number of Gauss–Seidel sweeps over the channels.
    pub sweeps: usize,
    /// Kite sizes gone through before the full one.
    pub growth: Vec<f64>,
    /// Programs per channel and sweep at most.
    pub iterations: usize,
    /// Trust region at the start, in scaled gains.
    pub trust: f64,
    /// Phase margin added so that the dense check is met, rad.
    pub phase_back_off: f64,
    /// Same for gain margins, dB.
    pub gain_back_off: f64,
    /// Same for |S|, dB.
    pub rejection_back_off: f64,
    /// Factor on the prices of violations. High prices make a slow sequence,
    /// low ones let small violations stand: the last sweeps have ten times
    /// those of the first.
    pub price_scale: f64,
}

impl Default for TuningOptions {
    fn default() -> Self {
        Self {
            grid: default_grid(0.002, 60.0, 300),
            smoothing: 0.02,
            sweeps: 6,
            growth: vec![0.4, 0.7],
            iterations: 25,
            trust: 0.35,
            phase_back_off: 0.15f64.to_radians(),
            gain_back_off: 0.03,
            rejection_back_off: 0.04,
            price_scale: 1.0,
        }
    }
}

/// `n` logarithmic points from 0.03 rad/s to `high`, and 30 from `low` up to
/// there: the low end only has to watch integrators and slow modes.
pub fn default_grid(low: f64, high: f64, n: usize) -> Vec<f64> {
    let split = 0.03;
    let log = |a: f64, b: f64, n: usize, k: usize| a * (b / a).powf(k as f64 / (n - 1) as f64);
    let mut grid: Vec<f64> = (0..30).map(|k| log(low, split, 31, k)).collect();
    grid.extend((0..n).map(|k| log(split, high, n, k)));
    grid
}

/// Why a tuning could not be carried out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TuningError {
    /// A plant is unusable.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A conic program could not be posed.
    #[error("tuning {channel}: {source}")]
    Program {
        /// The channel.
        channel: Channel,
        /// What the program lacks.
        source: ConicError,
    },
    /// No start stabilises a model.
    #[error(
        "no start stabilises model '{model}' at {speed:.1} m/s: the fastest-growing mode of the best \
         start has a real part of {growth:.3} 1/s"
    )]
    Unstabilisable {
        /// Model.
        model: String,
        /// Speed, m/s.
        speed: f64,
        /// Largest real part of the closed-loop eigenvalues, 1/s.
        growth: f64,
    },
    /// A response is not finite.
    #[error("the frequency response of model '{model}' at {speed:.1} m/s is not finite")]
    NotFinite {
        /// Model.
        model: String,
        /// Speed, m/s.
        speed: f64,
    },
    /// The breakpoints are no table.
    #[error(transparent)]
    Law(#[from] LawError),
    /// Nothing to tune.
    #[error("there is nothing to tune: {0}")]
    Empty(&'static str),
}

/// Counts and times of a tuning.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TuningStats {
    /// Conic programs posed.
    pub programs: usize,
    /// Solutions of their growing sets of rows.
    pub solves: usize,
    /// Rows of the largest program.
    pub largest_rows: usize,
    /// Interior-point iterations in all.
    pub interior_iterations: u32,
    /// Programs whose answer could not be used, with the trust region cut instead.
    pub refused: usize,
    /// Time inside the conic solver, s.
    pub solver_time: f64,
    /// Time in assembling programs and merits, s.
    pub assembly_time: f64,
}

impl TuningStats {
    pub(super) fn add(&mut self, other: &Self) {
        self.programs += other.programs;
        self.solves += other.solves;
        self.largest_rows = self.largest_rows.max(other.largest_rows);
        self.interior_iterations += other.interior_iterations;
        self.refused += other.refused;
        self.solver_time += other.solver_time;
        self.assembly_time += other.assembly_time;
    }
}

/// Loops of every speed and model, and of the nominal model between speeds.
#[derive(Debug, Clone)]
pub struct LoopSet {
    /// `nodes[speed][model]`.
    pub nodes: Vec<Vec<LoopModel>>,
    /// The same as if the outer loops had the attitudes by themselves, at
    /// speeds where turn coordination has a share of them.
    pub undivided: Vec<Option<Vec<LoopModel>>>,
    /// Between breakpoints, where the interpolated law must do.
    pub between: Vec<Between>,
}

/// The nominal model between two breakpoints, under the interpolated law.
#[derive(Debug, Clone)]
pub struct Between {
    /// Place of the lower breakpoint.
    pub lower: usize,
    /// Weight of the upper one.
    pub weight: f64,
    /// The loops.
    pub model: LoopModel,
}

/// What the problems of all channels share: the loops of every model at every
/// speed.
#[derive(Clone, Copy)]
pub struct Shared<'s> {
    /// Class of each model.
    pub classes: &'s [ModelClass],
    /// The loops.
    pub models: &'s LoopSet,
    /// Speeds, m/s.
    pub speeds: &'s [f64],
}

/// Everything a tuning needs.
pub struct TuningProblem<'a> {
    /// Plants at the breakpoints.
    pub set: &'a ModelSet,
    /// Plants of the first model between breakpoints, at which the
    /// interpolated law must meet the nominal requirements too; those outside
    /// the range of the breakpoints are not used.
    pub between: Vec<Plant>,
    /// Actuators, delay, sensors.
    pub hardware: Hardware,
    /// The law's choices.
    pub settings: LawSettings,
    /// Turn coordination.
    pub turn: TurnCoordination,
    /// Channels to tune, with their specifications, in the order of tuning.
    pub channels: Vec<(Channel, ChannelSpec)>,
    /// Solver settings.
    pub options: TuningOptions,
}

/// A tuned design.
#[derive(Debug, Clone)]
pub struct Tuning {
    /// Speeds, m/s.
    pub speeds: Vec<f64>,
    /// Gains by speed.
    pub gains: Vec<GainSet>,
    /// Inversion by speed.
    pub inversions: Vec<Inversion>,
    /// Exact merit of each channel at the end.
    pub merits: Vec<(Channel, Merit)>,
    /// What each target costs.
    pub prices: Vec<Price>,
    /// Sweeps made.
    pub sweeps: usize,
    /// Largest relative change of a gain in the last sweep.
    pub last_change: f64,
    /// Counts and times.
    pub stats: TuningStats,
}

impl TuningProblem<'_> {
    /// Grid with the specified frequencies added.
    fn grid(&self) -> Arc<[f64]> {
        let mut grid = self.options.grid.clone();
        grid.push(metrics::LOWEST_REJECTION_FREQUENCY);
        for (_, spec) in &self.channels {
            for t in [&spec.nominal, &spec.off_nominal] {
                grid.extend([t.drb, t.crossover_min, t.crossover_max].into_iter().flatten());
            }
        }
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
        grid.into()
    }

    /// The law at the breakpoints, its gains at zero.
    fn table(&self, inversions: &[Inversion]) -> Result<LawTable, LawError> {
        let points = self.set.speeds().into_iter().zip(inversions);
        let points = points.map(|(speed, inversion)| LawPoint {
            speed,
            gains: GainSet::default(),
            inversion: inversion.clone(),
        });
        LawTable::new(points.collect(), self.settings, self.turn)
    }

    /// Loops of every speed and model.
    fn loop_models(&self, table: &LawTable, grid: &Arc<[f64]>) -> Result<LoopSet, TuningError> {
        let all = |table: &LawTable, speeds: &[Option<f64>]| -> Vec<Option<GainGrid>> {
            let at = |v: &Option<f64>| v.map(|v| GainGrid::new(table, v, grid.clone()));
            speeds.par_iter().map(at).collect()
        };
        let speeds = self.set.speeds();
        let loops = |v: usize, law: &GainGrid| -> Result<Vec<LoopModel>, PlantError> {
            let (plants, models) = (&self.set.plants[v], &self.set.models);
            (0..models.len())
                .into_par_iter()
                .map(|m| LoopModel::new(&plants[m], law, self.hardware, models[m].extra_delay))
                .collect()
        };
        let everywhere = |laws: &[Option<GainGrid>]| -> Result<Vec<_>, PlantError> {
            let at = |(v, law): (usize, &Option<GainGrid>)| {
                law.as_ref().map(|law| loops(v, law)).transpose()
            };
            laws.iter().enumerate().map(at).collect()
        };
        let laws = all(table, &speeds.iter().map(|v| Some(*v)).collect::<Vec<_>>());
        let nodes = everywhere(&laws)?.into_iter().flatten().collect();
        // Turn coordination out of reach.
        let mut alone = table.clone();
        alone.turn.speed = f64::MAX.sqrt();
        let divided = |v: f64| {
            let closed = |c: &(Channel, ChannelSpec)| {
                c.1.applies(v) && table.outer_share(c.0, v) < WHOLE_SHARE
            };
            self.channels.iter().any(closed)
        };
        let undivided: Vec<Option<f64>> =
            speeds.iter().map(|v| divided(*v).then_some(*v)).collect();
        let undivided = everywhere(&all(&alone, &undivided))?;
        let between: Result<Vec<Option<Between>>, PlantError> = self
            .between
            .par_iter()
            .map(|plant| {
                let upper = speeds.partition_point(|&v| v <= plant.speed);
                if upper == 0 || upper == speeds.len() {
                    return Ok(None);
                }
                let lower = upper - 1;
                let weight = (plant.speed - speeds[lower]) / (speeds[upper] - speeds[lower]);
                if weight < 1e-9 {
                    return Ok(None);
                }
                let law = GainGrid::new(table, plant.speed, grid.clone());
                let late = self.set.models[0].extra_delay;
                let model = LoopModel::new(plant, &law, self.hardware, late)?;
                Ok(Some(Between { lower, weight, model }))
            })
            .collect();
        Ok(LoopSet { nodes, undivided, between: between?.into_iter().flatten().collect() })
    }

    /// Sets the gains of each channel to zero at the speeds where it is open.
    fn open_where_not_closed(&self, gains: &mut [GainSet], speeds: &[f64]) {
        for (g, v) in gains.iter_mut().zip(speeds) {
            for (channel, spec) in &self.channels {
                if !spec.applies(*v) {
                    g[channel.index()] = ChannelGains::default();
                }
            }
        }
    }

    /// Tunes from `start`, one gain set a speed, or from gains that the
    /// equivalent delay of the plants suggests.
    pub fn tune(&self, start: Option<&[GainSet]>) -> Result<Tuning, TuningError> {
        if self.channels.is_empty() {
            return Err(TuningError::Empty("no axis is named"));
        }
        if self.set.plants.is_empty() || self.set.models.is_empty() {
            return Err(TuningError::Empty("no speed or no model is given"));
        }
        let clock = Instant::now();
        let speeds = self.set.speeds();
        let closed: Vec<(Channel, ChannelSpec)> = self
            .channels
            .iter()
            .filter(|c| speeds.iter().any(|v| c.1.applies(*v)))
            .copied()
            .collect();
        if closed.is_empty() {
            return Err(TuningError::Empty("no axis is closed at any of the speeds"));
        }
        let classes: Vec<ModelClass> = self.set.models.iter().map(|m| m.class).collect();
        let inversions: Vec<Inversion> =
            self.set.plants.iter().map(|p| Inversion::new(&p[0])).collect::<Result<_, _>>()?;
        let mut grid = self.grid();
        let table = self.table(&inversions)?;
        let mut models = self.loop_models(&table, &grid)?;
        let mut stats =
            TuningStats { assembly_time: clock.elapsed().as_secs_f64(), ..TuningStats::default() };
        let mut gains = match start {
            Some(start) => start.to_vec(),
            None => self.starts(&inversions, &table)?,
        };
        self.open_where_not_closed(&mut gains, &speeds);
        // The inner loops by themselves, then the outer ones around them, with
        // the effector cut among their requirements.
        let outer_start = gains.clone();
        for g in &mut gains {
            for c in Channel::ALL.into_iter().filter(|c| c.is_outer()) {
                g[c.index()] = ChannelGains::default();
            }
        }
        let without_reserve = |group: &[(Channel, ChannelSpec)]| -> Vec<(Channel, ChannelSpec)> {
            group.iter().map(|c| (c.0, ChannelSpec { phase_reserve: 0.0, ..c.1 })).collect()
        };
        let all = without_reserve(&closed);
        let (outer, inner): (Vec<_>, Vec<_>) = closed.into_iter().partition(|c| c.0.is_outer());
        let alone = outer.is_empty() || inner.is_empty();
        let parts = if alone { vec![&all] } else { vec![&inner, &outer] };
        let mut sweeps = 0;
        for group in parts {
            let run = Run {
                shared: Shared { classes: &classes, models: &models, speeds: &speeds },
                options: &self.options,
                search: true,
            };
            if group.iter().any(|c| c.0.is_outer()) {
                for (g, s) in gains.iter_mut().zip(&outer_start) {
                    for (c, _) in group.iter().filter(|c| c.0.is_outer()) {
                        g[c.index()] = s[c.index()];
                    }
                }
                self.slow_down_outer(&table, group, &mut gains);
            }
            sweeps += run.sweeps(group, &mut gains, &mut stats)?.sweeps;
        }
        // At the end all together, the margins of the inner axes with the outer
        // loops open and closed, at higher prices. Where a curve passes close
        // to its kite in long strides, the grid is refined first.
        let clock = Instant::now();
        let refined = Run {
            shared: Shared { classes: &classes, models: &models, speeds: &speeds },
            options: &self.options,
            search: false,
        }
        .refined_grid(&grid, &all, &gains);
        if refined.len() > grid.len() {
            grid = refined;
            models = self.loop_models(&table, &grid)?;
        }
        stats.assembly_time += clock.elapsed().as_secs_f64();
        let options = TuningOptions {
            growth: Vec::new(),
            sweeps: self.options.sweeps.min(LAST_SWEEPS),
            trust: LATER_TRUST[0],
            price_scale: LAST_PRICES * self.options.price_scale,
            ..self.options.clone()
        };
        let run = Run {
            shared: Shared { classes: &classes, models: &models, speeds: &speeds },
            options: &options,
            search: true,
        };
        let Sweeps { merits, sweeps: last, last_change } =
            run.sweeps(&all, &mut gains, &mut stats)?;
        sweeps += last;
        let mut prices = Vec::new();
        for (channel, spec) in &all {
            let shared = run.shared;
            let mut problem =
                ChannelProblem::new(*channel, spec, shared, &gains, 1.0, &self.options);
            prices.extend(problem.prices(&gains)?);
            stats.add(&problem.stats);
        }
        Ok(Tuning { speeds, gains, inversions, merits, prices, sweeps, last_change, stats })
    }
}
