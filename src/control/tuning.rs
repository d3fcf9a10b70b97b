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

use super::axis::{Axis, Channel, ChannelGains, Gain, GainSet, inner_only};
use super::kite::{Kite, Separation, magnitude};
use super::loops::{
    Affine, ChannelLoops, Cut, Dependence, FrequencyModel, LawSettings, LoopModel, affine_value,
    real_row, without_hold,
};
use super::metrics;
use super::plant::{Hardware, Inversion, ModelClass, ModelSet, Plant, PlantError};
use super::stability;
use crate::numerics::conic::{AffineRow, ConicError, Program, Solution, Status};
use nalgebra::DMatrix;
use num_complex::Complex64 as C;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// What one class of models must meet in one channel; factors, rad, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Targets {
    /// Gain margin upward, factor.
    pub gain_up: f64,
    /// Gain margin downward, factor.
    pub gain_down: f64,
    /// Phase margin, rad.
    pub phase: f64,
    /// Least disturbance rejection bandwidth, rad/s.
    pub drb: Option<f64>,
    /// Largest disturbance rejection peak, factor.
    pub drp: Option<f64>,
    /// Least crossover, rad/s.
    pub crossover_min: Option<f64>,
    /// Largest crossover, rad/s.
    pub crossover_max: Option<f64>,
}

/// Specification of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelSpec {
    /// For nominal models.
    pub nominal: Targets,
    /// For off-nominal models.
    pub off_nominal: Targets,
    /// Least and largest K_I/K_P, 1/s.
    pub integral_ratio: [f64; 2],
    /// Factor on this channel's prices: above one, its specs give way last.
    pub priority: f64,
    /// Lowest and highest speed at which the channel is closed, m/s.
    pub speeds: [f64; 2],
    /// Phase margin that the tuning adds in an inner axis while the outer
    /// loops are open, for what they take, rad.
    pub phase_reserve: f64,
}

impl Targets {
    /// The margins alone.
    fn margins_only(&self) -> Self {
        Self { drb: None, drp: None, crossover_min: None, crossover_max: None, ..*self }
    }
}

impl ChannelSpec {
    /// Whether the channel is closed at a speed, m/s.
    pub fn applies(&self, speed: f64) -> bool {
        let slack = 1e-6;
        speed >= self.speeds[0] - slack && speed <= self.speeds[1] + slack
    }

    /// Targets of a class.
    pub fn targets(&self, class: ModelClass) -> &Targets {
        match class {
            ModelClass::Nominal => &self.nominal,
            ModelClass::OffNominal => &self.off_nominal,
        }
    }
}

/// Kinds of elastic requirements, in the order of the slacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Requirement {
    /// The kite of gain and phase margins.
    Margin,
    /// Disturbance rejection bandwidth.
    RejectionBandwidth,
    /// Disturbance rejection peak.
    RejectionPeak,
    /// Least crossover.
    CrossoverMin,
    /// Largest crossover.
    CrossoverMax,
}

impl Requirement {
    /// All kinds.
    pub const ALL: [Requirement; 5] = [
        Requirement::Margin,
        Requirement::RejectionBandwidth,
        Requirement::RejectionPeak,
        Requirement::CrossoverMin,
        Requirement::CrossoverMax,
    ];
    /// Price of a unit of violation, relative to the activity at the start.
    fn price(self) -> f64 {
        match self {
            Requirement::Margin => 300.0,
            _ => 100.0,
        }
    }
}

/// Number of requirement kinds.
const KINDS: usize = Requirement::ALL.len();

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
    fn add(&mut self, other: &Self) {
        self.programs += other.programs;
        self.solves += other.solves;
        self.largest_rows = self.largest_rows.max(other.largest_rows);
        self.interior_iterations += other.interior_iterations;
        self.refused += other.refused;
        self.solver_time += other.solver_time;
        self.assembly_time += other.assembly_time;
    }
}

/// Whether det(I + Λ) turns as often about zero at both gain sets, for every
/// speed and model, with the outer loops open and closed.
fn same_winding(models: &[Vec<LoopModel>], a: &[GainSet], b: &[GainSet]) -> bool {
    let same = |m: &LoopModel, a: &GainSet, b: &GainSet| {
        let (da, db) = (m.determinant(a), m.determinant(b));
        let ratio: Vec<C> = da.iter().zip(&db).map(|(a, b)| b / a).collect();
        let turned: f64 = ratio.windows(2).map(|r| (r[1] / r[0]).arg()).sum();
        turned.abs() < WINDING_TOLERANCE
    };
    models.iter().zip(a.iter().zip(b)).all(|(models, (a, b))| {
        let (inner_a, inner_b) = (inner_only(a), inner_only(b));
        models.par_iter().all(|m| {
            same(m, a, b) && ((inner_a, inner_b) == (*a, *b) || same(m, &inner_a, &inner_b))
        })
    })
}

/// Loops of every speed and model, and of the nominal model between speeds.
#[derive(Debug, Clone)]
pub struct LoopSet {
    /// `nodes[speed][model]`.
    pub nodes: Vec<Vec<LoopModel>>,
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

/// One speed and model within a channel's problem.
#[derive(Clone)]
struct Site {
    speed: usize,
    /// Share of that speed's gains here.
    weight: f64,
    /// For a site between breakpoints: the upper one, and its share.
    next: Option<(usize, f64)>,
    /// Whether its activity is counted: the inverted model at a breakpoint.
    nominal: bool,
    targets: Targets,
    loops: ChannelLoops,
    kites: Vec<Kite>,
    /// Grid points at which the rejection bandwidth is required.
    rejection_points: Vec<usize>,
    /// Trapezoid weights of the activity.
    weights: Vec<f64>,
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

/// One channel over all speeds and models, other channels fixed.
#[derive(Clone)]
pub struct ChannelProblem<'a> {
    channel: Channel,
    spec: &'a ChannelSpec,
    options: &'a TuningOptions,
    /// Places of this channel's speeds among all.
    places: Vec<usize>,
    speeds: Vec<f64>,
    sites: Vec<Site>,
    /// Activity² at the start of this run, by speed.
    reference_activity: Vec<f64>,
    /// Programs solved so far.
    pub stats: TuningStats,
}

/// Exact requirements at a point.
#[derive(Debug, Clone)]
pub struct Merit {
    /// Objective with all penalties.
    pub total: f64,
    /// Mean over speeds of activity² over its value at the start.
    pub activity: f64,
    /// Violation by speed and requirement, in the units of the slacks.
    pub violation: Vec<[f64; KINDS]>,
}

impl Merit {
    /// Largest violation of all.
    pub fn worst(&self) -> f64 {
        self.violation.iter().flatten().copied().fold(0.0, f64::max)
    }
}

/// Trust region at most and at least, in scaled gains.
const TRUST: [f64; 2] = [0.6, 1e-3];
/// Largest trust region at the start of the second and of later sweeps: what
/// the others changed needs only small answers, and a small region leaves out
/// most rows.
const LATER_TRUST: [f64; 2] = [0.12, 0.05];
/// A step smaller than this in scaled gains ends the sequence.
const STEP_TOLERANCE: f64 = 3e-3;
/// So does a relative fall of the merit below this.
const MERIT_TOLERANCE: f64 = 2e-5;
/// Least Re D/D̄₀ along the separating normal: keeps the winding.
const STABILITY_FLOOR: f64 = 0.05;
/// A change of phase of D_new/D_old over the grid beyond this is a change of
/// the number of unstable poles, rad.
const WINDING_TOLERANCE: f64 = 1.5;
/// |L| above this needs no margin rows.
const MARGIN_REACH: f64 = 20.0;
/// Distance from the kite beyond which a segment gets no margin rows.
const MARGIN_DISTANCE: f64 = 0.5;
/// Least |L| of a hump that counts for the least crossover.
const HUMP: f64 = 1.1;
/// |L| falls at a grid point if it is larger by this factor so many points below.
const FALL: f64 = 1.02;
/// Those points.
const FALL_STEPS: usize = 3;
/// Highest frequency at which the rejection peak is required, rad/s.
const PEAK_BAND: f64 = 25.0;
/// Factor on the prices in the last sweeps.
const LAST_PRICES: f64 = 10.0;
/// Searches over pairs of channels for every part of a tuning.
const PAIR_SEARCHES: usize = 2;
/// Sweeps that follow one that has found something, at least.
const PAIR_SWEEPS: usize = 3;
/// Speeds looked at in one of them.
const PAIR_SPEEDS: usize = 4;
/// Density of the lattice of the first channel of a pair.
const PAIR_DENSITY: f64 = 0.5;
/// Fall of the sum of the merits, relative, that is worth moving for.
const SCAN_PAIR_GAIN: f64 = 1e-3;
/// A violation beyond this, in slack units, is worth a search over pairs.
const MISSED: f64 = 5e-3;
/// Number of the last sweeps at most.
const LAST_SWEEPS: usize = 4;
/// Longest chord of a Nyquist curve near its kite; the sag of an arc of
/// radius 0.5 over it is 0.0009, a twentieth of a degree.
const LONGEST_CHORD: f64 = 0.06;
/// Sweeps after which other answers are searched for.
const SEARCH_SWEEPS: usize = 3;
/// Relative fall of the joint merit that is worth moving for.
const SEARCH_TOLERANCE: f64 = 1e-4;
/// Trust region of the program whose duals are the prices, in scaled gains:
/// small against a step that matters, wide against the answer's accuracy.
const PRICE_REGION: f64 = 0.05;
/// Merit, relative to that of the present gains, that makes gains of the
/// lattice worth starting from.
const SCAN_GAIN: f64 = 0.995;
/// Price of a unit of K_I/K_P ratio violation.
const RATIO_PRICE: f64 = 300.0;

impl<'a> ChannelProblem<'a> {
    /// Assembles the problem over the shared loops, `gains` one set a speed,
    /// `growth` the size of the kite (1: full).
    pub fn new(
        channel: Channel,
        spec: &'a ChannelSpec,
        shared: Shared<'_>,
        gains: &[GainSet],
        growth: f64,
        options: &'a TuningOptions,
    ) -> Self {
        let speeds = shared.speeds;
        let places = (0..speeds.len()).filter(|&v| spec.applies(speeds[v])).collect();
        Self::at_places(channel, spec, shared, gains, growth, options, places)
    }

    /// The same over some of the speeds.
    fn at_places(
        channel: Channel,
        spec: &'a ChannelSpec,
        Shared { classes, models, speeds }: Shared<'_>,
        gains: &[GainSet],
        growth: f64,
        options: &'a TuningOptions,
        places: Vec<usize>,
    ) -> Self {
        // The effector cut comes first: activity is counted there. An outer
        // loop also has margins of its own.
        let cuts: &[Cut] =
            if channel.is_outer() { &[Cut::Effector, Cut::Channel] } else { &[Cut::Effector] };
        let site = |model: &LoopModel, gains: &GainSet, cuts: &[Cut], targets: Targets| {
            let loops = model.channel(gains, channel, cuts);
            let back = metrics::from_decibels(options.gain_back_off);
            let kite = Kite::new(
                targets.gain_up.powf(growth) * back,
                targets.gain_down.powf(growth) * back,
                (targets.phase + spec.phase_reserve) * growth + options.phase_back_off,
            );
            let rejection_points =
                targets.drb.map_or(Vec::new(), |drb| rejection_points(&loops.omega, drb));
            Site {
                speed: 0,
                weight: 1.0,
                next: None,
                nominal: false,
                targets,
                kites: vec![kite; cuts.len()],
                rejection_points,
                weights: metrics::activity_weights(&loops.omega, metrics::ACTIVITY_BAND),
                loops,
            }
        };
        // Rejection and crossover of an inner axis are those with the outer
        // loops open; its margins must hold with them closed, too.
        let variants = |gains: &GainSet| -> Vec<(GainSet, bool)> {
            let inner = inner_only(gains);
            match channel.is_outer() {
                true => vec![(*gains, false)],
                false if inner == *gains => vec![(inner, false)],
                false => vec![(inner, false), (*gains, true)],
            }
        };
        let nodes: Vec<(usize, usize, GainSet, bool)> = (0..places.len())
            .flat_map(|v| (0..classes.len()).map(move |m| (v, m)))
            .flat_map(|(v, m)| {
                variants(&gains[places[v]]).into_iter().map(move |(g, closed)| (v, m, g, closed))
            })
            .collect();
        let mut sites: Vec<Site> = nodes
            .par_iter()
            .map(|(v, m, gains, closed)| {
                let targets = *spec.targets(classes[*m]);
                let targets = if *closed { targets.margins_only() } else { targets };
                let site = site(&models.nodes[places[*v]][*m], gains, cuts, targets);
                Site { speed: *v, nominal: *m == 0 && !closed, ..site }
            })
            .collect();
        let between: Vec<Vec<Site>> = models
            .between
            .par_iter()
            .map(|b| {
                let lower = places.iter().position(|&p| p == b.lower);
                let upper = places.iter().position(|&p| p == b.lower + 1);
                let (speed, weight, next) = match (lower, upper) {
                    (Some(l), Some(u)) => (l, 1.0 - b.weight, Some((u, b.weight))),
                    // An outer loop that fades out here.
                    (Some(l), None) => (l, 1.0 - b.weight, None),
                    (None, Some(u)) => (u, b.weight, None),
                    (None, None) => return Vec::new(),
                };
                let blended: GainSet = std::array::from_fn(|c| {
                    gains[b.lower][c].blend(&gains[b.lower + 1][c], b.weight)
                });
                let fading = next.is_none();
                let cuts = if fading { &cuts[..1] } else { cuts };
                variants(&blended)
                    .into_iter()
                    .map(|(gains, closed)| {
                        let targets = spec.nominal;
                        let margins = closed || fading;
                        let targets = if margins { targets.margins_only() } else { targets };
                        Site { speed, weight, next, ..site(&b.model, &gains, cuts, targets) }
                    })
                    .collect()
            })
            .collect();
        sites.extend(between.into_iter().flatten());
        let mut problem = Self {
            channel,
            spec,
            options,
            speeds: places.iter().map(|&v| speeds[v]).collect(),
            reference_activity: vec![1.0; places.len()],
            places,
            sites,
            stats: TuningStats::default(),
        };
        let x = problem.values(gains);
        for site in &problem.sites {
            if site.nominal {
                problem.reference_activity[site.speed] =
                    site.activity_squared(&site.gains(&x)).max(1e-12);
            }
        }
        problem
    }

    /// This channel's gains by its speeds.
    pub fn values(&self, gains: &[GainSet]) -> Vec<Vec<f64>> {
        let channel = self.channel;
        self.places.iter().map(|&v| gains[v][channel.index()].values(channel)).collect()
    }

    fn write(&self, x: &[Vec<f64>], gains: &mut [GainSet]) {
        for (&v, x) in self.places.iter().zip(x) {
            gains[v][self.channel.index()] = ChannelGains::from_values(self.channel, x);
        }
    }

    fn gain_count(&self) -> usize {
        self.channel.gains().len()
    }

    /// Exact merit at `x[speed]`; `None` if the winding differs from that at
    /// `reference` or a value is not finite.
    pub fn merit(&self, x: &[Vec<f64>], reference: Option<&[Vec<f64>]>) -> Option<Merit> {
        let n = self.speeds.len() as f64;
        let parts: Option<Vec<(usize, [f64; KINDS], f64)>> = self
            .sites
            .par_iter()
            .map(|site| {
                let own = site.gains(x);
                let old = reference.map(|r| site.gains(r));
                site.violations(&own, old.as_deref(), self.options).map(|v| {
                    let activity = if site.nominal {
                        site.activity_squared(&own) / self.reference_activity[site.speed]
                    } else {
                        0.0
                    };
                    (site.speed, v, activity)
                })
            })
            .collect();
        let mut violation = vec![[0.0f64; KINDS]; self.speeds.len()];
        let mut activity = 0.0;
        for (speed, v, a) in parts? {
            for (worst, v) in violation[speed].iter_mut().zip(v) {
                *worst = worst.max(v);
            }
            activity += a / n;
        }
        let mut total = activity + self.smoothness(x);
        for v in &violation {
            for (kind, v) in Requirement::ALL.iter().zip(v) {
                total += self.price(*kind) * v / n;
            }
        }
        for x in x {
            total += RATIO_PRICE * self.ratio_excess(x) / n;
        }
        total.is_finite().then_some(Merit { total, activity, violation })
    }

    fn price(&self, kind: Requirement) -> f64 {
        kind.price() * self.spec.priority * self.options.price_scale
    }

    /// Places of K_P and K_I among the channel's gains.
    fn ratio_places(&self) -> [usize; 2] {
        let place = |gain: Gain| self.channel.gains().iter().position(|&g| g == gain).unwrap_or(0);
        [place(Gain::Proportional), place(Gain::Integral)]
    }

    /// Weights and scales of the smoothness terms.
    fn smoothness_scales(&self, x: &[Vec<f64>]) -> Vec<f64> {
        (0..self.gain_count())
            .map(|g| (x.iter().map(|x| x[g].abs()).sum::<f64>() / x.len() as f64).max(1e-3))
            .collect()
    }

    fn smoothness(&self, x: &[Vec<f64>]) -> f64 {
        let scale = self.smoothness_scales(x);
        let mut sum = 0.0;
        for k in 0..x.len().saturating_sub(1) {
            let gap = self.speed_gap(k);
            for g in 0..scale.len() {
                sum += ((x[k + 1][g] - x[k][g]) / scale[g]).powi(2) / gap;
            }
        }
        self.options.smoothing * sum
    }

    /// Gap between neighbouring speeds in units of about 10 kt.
    fn speed_gap(&self, k: usize) -> f64 {
        ((self.speeds[k + 1] - self.speeds[k]) / 5.0).max(1e-3)
    }

    /// Merit of gains at one speed by itself: without smoothness and without
    /// the sites between breakpoints. `None` as soon as it cannot be below
    /// `bound`, and where the winding differs from that at `reference`.
    fn merit_at(&self, speed: usize, x: &[f64], reference: &[f64], bound: f64) -> Option<f64> {
        let own = || self.sites.iter().filter(move |s| s.speed == speed && s.at_breakpoint());
        let mut activity = 0.0;
        for site in own().filter(|s| s.nominal) {
            activity += site.activity_squared(x) / self.reference_activity[speed];
        }
        activity += RATIO_PRICE * self.ratio_excess(x);
        if activity.is_nan() || activity >= bound {
            return None;
        }
        let mut worst = [0.0f64; KINDS];
        let total = |worst: &[f64; KINDS]| {
            Requirement::ALL
                .iter()
                .zip(worst)
                .fold(activity, |sum, (kind, v)| sum + self.price(*kind) * v)
        };
        // The few points of the rejection bandwidth tell most slow gains.
        for site in own() {
            worst[1] = worst[1].max(site.rejection_violation(x, self.options));
            if total(&worst) >= bound {
                return None;
            }
        }
        for site in own() {
            let found = site.violations(x, Some(reference), self.options)?;
            for (worst, v) in worst.iter_mut().zip(found) {
                *worst = worst.max(v);
            }
            if total(&worst) >= bound {
                return None;
            }
        }
        Some(total(&worst))
    }

    /// By how much K_I lies outside its bounds.
    fn ratio_excess(&self, x: &[f64]) -> f64 {
        let [p, i] = self.ratio_places();
        let [low, high] = self.spec.integral_ratio;
        (low * x[p] - x[i]).max(0.0) + (x[i] - high * x[p]).max(0.0)
    }

    /// Looks at each speed by itself for gains that are better than those of
    /// `x` by the exact merit, on a lattice that spans all that is reasonable.
    /// Gains and the fall of the merit there; `None` where there are none.
    fn scan(&self, x: &[Vec<f64>]) -> Vec<Option<(Vec<f64>, f64)>> {
        (0..x.len())
            .into_par_iter()
            .map(|v| {
                let now = self.merit_at(v, &x[v], &x[v], f64::INFINITY)?;
                let (gains, merit) = self.best_of_lattice(v, &x[v], SCAN_GAIN * now)?;
                Some((gains, now - merit))
            })
            .collect()
    }

    /// The best gains of the lattice around `x` at one speed, and their merit;
    /// `None` if that is not below `bound`.
    fn best_of_lattice(&self, speed: usize, x: &[f64], bound: f64) -> Option<(Vec<f64>, f64)> {
        let mut best: Option<(Vec<f64>, f64)> = None;
        for candidate in self.lattice(x, 1.0) {
            let bound = best.as_ref().map_or(bound, |b| b.1);
            if let Some(merit) = self.merit_at(speed, &candidate, x, bound) {
                best = Some((candidate, merit));
            }
        }
        best
    }

    /// Lattice of gains around `x`. `density` is relative to that of
    /// [`Self::scan`].
    fn lattice(&self, x: &[f64], density: f64) -> Vec<Vec<f64>> {
        let [p, i] = self.ratio_places();
        let [low, high] = self.spec.integral_ratio;
        let span = |low: f64, high: f64, n: usize| {
            let n = (density * n as f64).round().max(2.0) as usize;
            (0..n).map(move |k| low * (high / low).powf(k as f64 / (n - 1) as f64))
        };
        let mut out = Vec::new();
        if x.len() == 3 {
            for d in span(0.45 * x[0], 2.2 * x[0], 9) {
                for ratio in span(0.25, 4.0, 9) {
                    for share in span(low.max(0.02), high.min(4.0), 7) {
                        let k_p = ratio * x[p] / x[0].max(1e-9) * d;
                        out.push(vec![d, k_p, share * k_p]);
                    }
                }
            }
        } else {
            for k_p in span(0.4 * x[p], 2.5 * x[p], 21) {
                for share in span(low.max(0.02), high.min(12.0), 21) {
                    let mut g = vec![0.0; 2];
                    g[p] = k_p;
                    g[i] = share * k_p;
                    out.push(g);
                }
            }
        }
        out
    }

    /// Runs the sequence from `gains` and writes the result back.
    pub fn run(&mut self, gains: &mut [GainSet]) -> Result<Merit, TuningError> {
        let mut x = self.values(gains);
        let clock = Instant::now();
        let Some(mut best) = self.merit(&x, None) else {
            return Err(TuningError::Empty("the starting gains give a non-finite loop"));
        };
        self.stats.assembly_time += clock.elapsed().as_secs_f64();
        let mut trust = self.options.trust;
        for _ in 0..self.options.iterations {
            let clock = Instant::now();
            let step = self.program(&x, trust);
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            let solution = self.solve(&step)?.solution;
            if !solution.status.usable() {
                // Elastic rows make every program feasible and bounded but for
                // the hard ones, which hold at the centre: a smaller region is
                // better conditioned.
                self.stats.refused += 1;
                trust *= 0.4;
                if trust < TRUST[1] {
                    break;
                }
                continue;
            }
            let n = self.gain_count();
            let mut size = 0.0f64;
            let next: Vec<Vec<f64>> = x
                .iter()
                .enumerate()
                .map(|(v, x)| {
                    (0..n)
                        .map(|g| {
                            let d = solution.x[v * n + g];
                            size = size.max(d.abs());
                            (x[g] + step.scale[v][g] * d).max(0.0)
                        })
                        .collect()
                })
                .collect();
            let clock = Instant::now();
            let merit = self.merit(&next, Some(&x));
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            match merit {
                Some(m) if m.total <= best.total + 1e-9 => {
                    let gain = (best.total - m.total) / best.total.abs().max(1.0);
                    x = next;
                    best = m;
                    trust = (trust * 1.5).min(TRUST[0]);
                    if size < STEP_TOLERANCE || gain < MERIT_TOLERANCE {
                        break;
                    }
                }
                _ => {
                    trust = trust.min(size) * 0.4;
                    if trust < TRUST[1] {
                        break;
                    }
                }
            }
        }
        self.write(&x, gains);
        Ok(best)
    }

    /// Prices of the targets at these gains, which should be a converged
    /// answer: from the duals of the program there.
    ///
    /// # Errors
    /// A program that cannot be posed.
    pub fn prices(&mut self, gains: &[GainSet]) -> Result<Vec<Price>, TuningError> {
        let x = self.values(gains);
        let step = self.program(&x, PRICE_REGION);
        let solved = self.solve(&step)?;
        if !solved.solution.status.usable() {
            return Ok(Vec::new());
        }
        let mut totals = vec![[0.0f64; Target::ALL.len()]; self.speeds.len()];
        // A row's dual is the fall of the optimum for a unit rise of the row.
        for &(k, place) in &solved.half_spaces {
            let row = &step.half_spaces[k];
            for (target, slope) in &row.tightening {
                totals[row.speed][*target as usize] -=
                    solved.solution.half_space_duals[place] * slope;
            }
        }
        for &(k, place) in &solved.cones {
            let cone = &step.cones[k];
            for (target, slope) in &cone.tightening {
                totals[cone.speed][*target as usize] -=
                    solved.solution.cone_duals[place][0] * slope;
            }
        }
        let n = self.speeds.len() as f64;
        let mut own = vec![1.0; self.speeds.len()];
        for site in self.sites.iter().filter(|s| s.nominal) {
            own[site.speed] =
                site.activity_squared(&site.gains(&x)) / self.reference_activity[site.speed];
        }
        let mut out = Vec::new();
        for (v, totals) in totals.iter().enumerate() {
            for target in Target::ALL {
                let by = target.unit_tightening().0;
                // The objective is the mean over speeds of activity².
                let percent = 100.0 * by * totals[target as usize] * n / (2.0 * own[v]);
                let (channel, speed) = (self.channel, self.speeds[v]);
                out.push(Price { channel, speed, target, percent });
            }
        }
        Ok(out)
    }

    /// Solves a program by a growing set of its rows: first those that bind
    /// most easily, then also those that the answer violates, until it
    /// violates none. The last answer is that of the whole program.
    fn solve(&mut self, step: &Step) -> Result<Solved, TuningError> {
        let mut half_spaces: Vec<bool> =
            step.half_spaces.iter().map(|r| r.ease < FIRST_ROWS).collect();
        let mut cones: Vec<bool> = step.cones.iter().map(|r| r.ease < FIRST_ROWS).collect();
        self.stats.programs += 1;
        for round in 1.. {
            let clock = Instant::now();
            let mut program = step.base.clone();
            let chosen = |flags: &[bool]| -> Vec<usize> {
                flags.iter().enumerate().filter(|f| *f.1).map(|f| f.0).collect()
            };
            let places = chosen(&half_spaces)
                .into_iter()
                .map(|k| (k, program.require_nonnegative(step.half_spaces[k].row.clone())))
                .collect();
            let cone_places = chosen(&cones)
                .into_iter()
                .map(|k| (k, program.require_cone(step.cones[k].rows.clone())))
                .collect();
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            let solution = program
                .solve()
                .map_err(|source| TuningError::Program { channel: self.channel, source })?;
            self.stats.solves += 1;
            self.stats.largest_rows = self.stats.largest_rows.max(program.row_count());
            self.stats.interior_iterations += solution.iterations;
            self.stats.solver_time += solution.solve_time;
            tracing::trace!(
                axis = self.channel.name(),
                round,
                rows = program.row_count(),
                status = ?solution.status,
                iterations = solution.iterations,
                objective = solution.objective,
                "conic program"
            );
            let clock = Instant::now();
            let mut complete = true;
            if solution.status.usable() {
                let all = round + 1 == MAX_ROUNDS;
                for (row, used) in step.half_spaces.iter().zip(&mut half_spaces) {
                    if !*used && (all || row.row.value(&solution.x) < -ROW_TOLERANCE) {
                        *used = true;
                        complete = false;
                    }
                }
                for (cone, used) in step.cones.iter().zip(&mut cones) {
                    let [bound, re, im] = &cone.rows;
                    let excess = || {
                        magnitude(C::new(re.value(&solution.x), im.value(&solution.x)))
                            - bound.value(&solution.x)
                    };
                    if !*used && (all || excess() > ROW_TOLERANCE) {
                        *used = true;
                        complete = false;
                    }
                }
            }
            self.stats.assembly_time += clock.elapsed().as_secs_f64();
            if complete || round == MAX_ROUNDS {
                return Ok(Solved { solution, half_spaces: places, cones: cone_places });
            }
        }
        unreachable!("the rounds end by themselves")
    }

    /// The conic program at `x` within a trust region.
    fn program(&self, x: &[Vec<f64>], trust: f64) -> Step {
        let (speeds, gains) = (self.speeds.len(), self.gain_count());
        let slack0 = speeds * gains;
        let mut program = Program::new(slack0 + speeds * KINDS);
        let largest: Vec<f64> =
            (0..gains).map(|g| x.iter().map(|x| x[g].abs()).fold(0.0, f64::max)).collect();
        let scale: Vec<Vec<f64>> = x
            .iter()
            .map(|x| (0..gains).map(|g| x[g].abs().max(0.08 * largest[g] + 1e-3)).collect())
            .collect();
        let n = speeds as f64;
        let rows: Vec<SiteRows> = self
            .sites
            .par_iter()
            .map(|site| {
                site.rows(
                    &site.gains(x),
                    &site.dependence(&scale),
                    slack0 + site.speed * KINDS,
                    trust,
                    self.options,
                    self.reference_activity[site.speed] * n,
                )
            })
            .collect();
        let (mut half_spaces, mut cones) = (Vec::new(), Vec::new());
        for (mut r, site) in rows.into_iter().zip(&self.sites) {
            for row in &mut r.half_spaces {
                row.speed = site.speed;
            }
            for cone in &mut r.cones {
                cone.speed = site.speed;
            }
            half_spaces.append(&mut r.half_spaces);
            cones.append(&mut r.cones);
            for (i, j, v) in r.quadratic {
                program.add_quadratic(i, j, v);
            }
            for (i, v) in r.linear {
                program.add_linear(i, v);
            }
        }
        let [p, i] = self.ratio_places();
        let [low, high] = self.spec.integral_ratio;
        let smooth = self.smoothness_scales(x);
        for v in 0..speeds {
            let first = v * gains;
            // K_I ≥ low K_P and K_I ≤ high K_P, elastic only in the merit.
            for (sign, ratio) in [(1.0, low), (-1.0, high)] {
                if !ratio.is_finite() || ratio <= 0.0 {
                    continue;
                }
                let value = sign * (x[v][i] - ratio * x[v][p]);
                // A start outside must be able to come in within one region.
                let reach = trust * (scale[v][i] + ratio * scale[v][p]);
                let constant = if value < 0.0 { (-0.5 * reach).max(value) } else { value };
                program.require_nonnegative(AffineRow::new(
                    constant,
                    vec![(first + i, sign * scale[v][i]), (first + p, -sign * ratio * scale[v][p])],
                ));
            }
            for g in 0..gains {
                // Gains stay positive.
                let down = trust.min(x[v][g] / scale[v][g]);
                program.require_nonnegative(AffineRow::new(down, vec![(first + g, 1.0)]));
                program.require_nonnegative(AffineRow::new(trust, vec![(first + g, -1.0)]));
                // A little curvature where activity has none.
                program.add_quadratic(first + g, first + g, 1e-6);
            }
            for (k, kind) in Requirement::ALL.into_iter().enumerate() {
                let s = slack0 + v * KINDS + k;
                program.require_nonnegative(AffineRow::new(0.0, vec![(s, 1.0)]));
                program.add_linear(s, self.price(kind) / n);
            }
            if v + 1 < speeds && self.options.smoothing > 0.0 {
                let weight = self.options.smoothing / self.speed_gap(v);
                for g in 0..gains {
                    // ((x₁ + s₁d₁) − (x₀ + s₀d₀))² / scale².
                    let (a, b) = (scale[v][g] / smooth[g], scale[v + 1][g] / smooth[g]);
                    let c = (x[v + 1][g] - x[v][g]) / smooth[g];
                    let (i0, i1) = (v * gains + g, (v + 1) * gains + g);
                    program.add_quadratic(i0, i0, weight * a * a);
                    program.add_quadratic(i1, i1, weight * b * b);
                    program.add_quadratic(i0, i1, -2.0 * weight * a * b);
                    program.add_linear(i0, -2.0 * weight * c * a);
                    program.add_linear(i1, 2.0 * weight * c * b);
                }
            }
        }
        Step { base: program, half_spaces, cones, scale }
    }
}

/// A program in parts: objective, bounds and slacks, and the rows of the
/// sites, of which few bind.
struct Step {
    base: Program,
    half_spaces: Vec<HalfSpace>,
    cones: Vec<Cone>,
    scale: Vec<Vec<f64>>,
}

/// A row of a site.
struct HalfSpace {
    row: AffineRow,
    /// Value at the centre over the most that it can fall within the region:
    /// below zero violated, at one it cannot bind.
    ease: f64,
    /// Place of the speed whose slack it has.
    speed: usize,
    /// Change of the row's value as its targets tighten; zero for a hard row.
    tightening: Vec<(Target, f64)>,
}

/// A cone of a site.
struct Cone {
    rows: [AffineRow; 3],
    ease: f64,
    speed: usize,
    tightening: Vec<(Target, f64)>,
}

/// An answer, and the places of its rows among the duals.
struct Solved {
    solution: Solution,
    half_spaces: Vec<(usize, usize)>,
    cones: Vec<(usize, usize)>,
}

/// Rows with an ease below this are in the first round of a program.
const FIRST_ROWS: f64 = 0.25;
/// Rounds at most; the last has all rows.
const MAX_ROUNDS: usize = 5;
/// Violation of a row that brings it into the next round, in units of the row:
/// far below what the dense verification resolves.
const ROW_TOLERANCE: f64 = 1e-6;

/// Contribution of one site to a program.
#[derive(Default)]
struct SiteRows {
    half_spaces: Vec<HalfSpace>,
    cones: Vec<Cone>,
    quadratic: Vec<(usize, usize, f64)>,
    linear: Vec<(usize, f64)>,
}

/// Grid points at which |S| is held under −3 dB: fourteen from the
/// specification down to a tenth of it, or to where rejection is first judged.
fn rejection_points(omega: &[f64], drb: f64) -> Vec<usize> {
    let lowest = metrics::LOWEST_REJECTION_FREQUENCY.min(drb);
    let mut points: Vec<usize> = (0..14)
        .map(|k| (drb * 10f64.powf(-f64::from(k) / 13.0)).max(lowest))
        .map(|w| nearest(omega, w))
        .collect();
    points.sort_unstable();
    points.dedup();
    points
}

fn nearest(omega: &[f64], w: f64) -> usize {
    let k = omega.partition_point(|&v| v < w);
    if k == 0 {
        0
    } else if k == omega.len() || (w / omega[k - 1] < omega[k] / w) {
        k - 1
    } else {
        k
    }
}

impl Site {
    /// The channel's gains here: those of the breakpoint, or the blend of two.
    fn gains(&self, x: &[Vec<f64>]) -> Vec<f64> {
        let mut out: Vec<f64> = x[self.speed].iter().map(|x| self.weight * x).collect();
        if let Some((other, t)) = self.next {
            for (out, x) in out.iter_mut().zip(&x[other]) {
                *out += t * x;
            }
        }
        out
    }

    /// Whether it belongs to a breakpoint.
    fn at_breakpoint(&self) -> bool {
        self.weight == 1.0 && self.next.is_none()
    }

    /// How these gains depend on the scaled steps of all speeds.
    fn dependence(&self, scale: &[Vec<f64>]) -> Vec<Dependence> {
        let part = |speed: usize, weight: f64| {
            let gains = scale[speed].len();
            scale[speed].iter().enumerate().map(move |(gain, s)| Dependence {
                variable: speed * gains + gain,
                gain,
                slope: weight * s,
            })
        };
        let other = self.next.into_iter().flat_map(|(other, t)| part(other, t));
        part(self.speed, self.weight).chain(other).collect()
    }

    fn activity_squared(&self, x: &[f64]) -> f64 {
        let l = &self.loops;
        (0..l.omega.len())
            .filter(|&k| self.weights[k] > 0.0)
            .map(|k| {
                let u = affine_value(&l.noise[k], x) * affine_value(&l.opened[0][k], x)
                    / affine_value(&l.full[k], x);
                self.weights[k] * u.norm_sqr()
            })
            .sum()
    }

    /// Worst excess of |S| over its level at the rejection points.
    fn rejection_violation(&self, x: &[f64], options: &TuningOptions) -> f64 {
        let free = without_hold(self.loops.channel, x);
        let level = self.rejection_level(options);
        let s = |k: usize| {
            let f = &self.loops.full[k];
            magnitude(affine_value(f, &free) / affine_value(f, x))
        };
        self.rejection_points.iter().map(|&k| s(k) - level).fold(0.0, f64::max)
    }

    /// The cut whose crossover is specified.
    fn main_cut(&self) -> usize {
        self.kites.len() - 1
    }

    fn rejection_level(&self, options: &TuningOptions) -> f64 {
        metrics::DRB_LEVEL * metrics::from_decibels(-options.rejection_back_off)
    }

    fn peak_level(&self, options: &TuningOptions) -> Option<f64> {
        let back = metrics::from_decibels(-options.rejection_back_off);
        self.targets.drp.map(|p| p * back)
    }

    /// Grid points at which |L| ≤ 1 is required for the largest crossover.
    fn above(&self, crossover: f64) -> impl Iterator<Item = usize> + '_ {
        let w = &self.loops.omega;
        (0..w.len()).filter(move |&k| w[k] >= crossover * 0.9999 && w[k] < 3.0 * crossover)
    }

    /// Grid point, and the least |L| there, that keeps the last crossing beyond
    /// `crossover`: that frequency itself if |L| falls there, or where the loop
    /// rises once more up to three times as far, if it rises well above 1. A
    /// hump that just touches 1 would meet the definition, and lose the
    /// crossing at once.
    fn crossing_above(&self, crossover: f64, size: impl Fn(usize) -> f64) -> (usize, f64) {
        let place = nearest(&self.loops.omega, crossover);
        let falls = size(place.saturating_sub(FALL_STEPS)) > FALL * size(place);
        let first = (place, if falls { 1.0 } else { HUMP });
        self.above(crossover).filter(|&k| k > first.0).fold(first, |best, k| {
            if size(k) / HUMP > size(best.0) / best.1 { (k, HUMP) } else { best }
        })
    }

    /// Exact violations on the grid.
    fn violations(
        &self,
        x: &[f64],
        old: Option<&[f64]>,
        options: &TuningOptions,
    ) -> Option<[f64; KINDS]> {
        let l = &self.loops;
        let n = l.omega.len();
        let full: Vec<C> = l.full.iter().map(|f| affine_value(f, x)).collect();
        if full.iter().any(|d| !d.is_finite()) {
            return None;
        }
        if let Some(old) = old {
            let mut last: Option<C> = None;
            let (mut turned, mut extreme) = (0.0f64, 0.0f64);
            for (f, d) in l.full.iter().zip(&full) {
                let ratio = d / affine_value(f, old);
                if let Some(last) = last {
                    turned += (ratio / last).arg();
                    extreme = turned;
                }
                last = Some(ratio);
            }
            if extreme.abs() > WINDING_TOLERANCE || extreme.is_nan() {
                return None;
            }
        }
        let mut out = [0.0f64; KINDS];
        for (cut, kite) in self.kites.iter().enumerate() {
            let curve: Vec<C> =
                (0..n).map(|k| full[k] / affine_value(&l.opened[cut][k], x) - 1.0).collect();
            let mut worst = 0.0f64;
            for k in 0..n - 1 {
                if !kite.is_far(curve[k], curve[k + 1], 0.0) {
                    worst = worst.max(-kite.separation(curve[k], curve[k + 1]));
                }
            }
            out[0] = out[0].max(worst);
            if cut == self.main_cut() {
                if let Some(w) = self.targets.crossover_min {
                    let (place, least) = self.crossing_above(w, |k| magnitude(curve[k]));
                    out[3] = 1.0 - magnitude(curve[place]) / least;
                }
                if let Some(w) = self.targets.crossover_max {
                    out[4] = self.above(w).map(|k| magnitude(curve[k]) - 1.0).fold(0.0, f64::max);
                }
            }
        }
        let free = without_hold(l.channel, x);
        let s = |k: usize| magnitude(affine_value(&l.full[k], &free) / full[k]);
        out[1] = self.rejection_violation(x, options);
        if let Some(level) = self.peak_level(options) {
            out[2] = (0..n)
                .filter(|&k| l.omega[k] < PEAK_BAND)
                .map(|k| s(k) - level)
                .fold(0.0, f64::max);
        }
        Some(out.map(|v| v.max(0.0)))
    }

    /// Convex rows at `x` in the scaled step d, |d| ≤ trust.
    #[allow(clippy::too_many_arguments)]
    fn rows(
        &self,
        x: &[f64],
        dependence: &[Dependence],
        slack: usize,
        trust: f64,
        options: &TuningOptions,
        activity_scale: f64,
    ) -> SiteRows {
        let l = &self.loops;
        let n = l.omega.len();
        let gains = x.len();
        let mut out = SiteRows::default();
        // Affine functions about x: the constant is the value there.
        let shift = |f: &Affine| -> Affine {
            let mut g = *f;
            g[0] = affine_value(f, x);
            g
        };
        let scaled = |f: &Affine, by: C| -> Affine { f.map(|v| v * by) };
        // The least and largest a row can be within the region.
        let spread = |row: &AffineRow| trust * row.terms.iter().map(|t| t.1.abs()).sum::<f64>();
        let push = |out: &mut SiteRows,
                    kind: Option<Requirement>,
                    mut row: AffineRow,
                    tightening: Vec<(Target, f64)>| {
            // A row that cannot bind within the region is left out: exact, and
            // most rows go that way.
            let spread = spread(&row);
            if row.constant >= spread {
                return;
            }
            if let Some(k) = kind {
                row.terms.push((slack + k as usize, 1.0));
            }
            let ease = row.constant / spread;
            out.half_spaces.push(HalfSpace { row, ease, speed: 0, tightening });
        };
        for (cut, kite) in self.kites.iter().enumerate() {
            let points: Vec<(Affine, Affine, C)> = (0..n)
                .map(|k| {
                    let (d, b) = (shift(&l.full[k]), shift(&l.opened[cut][k]));
                    let by = b[0].inv();
                    let curve = d[0] * by - 1.0;
                    (scaled(&d, by), scaled(&b, by), curve)
                })
                .collect();
            for k in 0..n - 1 {
                let (a, b) = (points[k].2, points[k + 1].2);
                if !(magnitude(a) < MARGIN_REACH || magnitude(b) < MARGIN_REACH) {
                    continue;
                }
                let separation = if kite.is_far(a, b, MARGIN_DISTANCE) {
                    let middle = 0.5 * (a + b) + 1.0;
                    Separation { normal: middle / middle.norm(), distance: f64::INFINITY }
                } else {
                    kite.separating_normal(a, b)
                };
                let normal = separation.normal;
                for (d, _, _) in &points[k..=k + 1] {
                    let mut row = real_row(normal, d, dependence);
                    row.constant -= STABILITY_FLOOR.min(0.5 * row.constant.abs());
                    push(&mut out, None, row, Vec::new());
                }
                if separation.distance > MARGIN_DISTANCE {
                    continue;
                }
                // The two vertices nearest to the separating line; the others
                // follow unless D̄ turns far within the region, and then the
                // exact merit refuses the step.
                let mut vertices: Vec<(C, [C; 2])> = kite.vertices_with_slopes().collect();
                vertices
                    .sort_by(|p, q| (normal.conj() * q.0).re.total_cmp(&(normal.conj() * p.0).re));
                for (d, b, _) in &points[k..=k + 1] {
                    for (z, slopes) in &vertices[..2] {
                        // Re n*(L − z) D̄/D̄₀, affine in the gains.
                        let f: Affine = std::array::from_fn(|i| d[i] - (1.0 + z) * b[i]);
                        // D̄ = D̄₀ here.
                        let slope = |k: usize| -(normal.conj() * slopes[k]).re;
                        push(
                            &mut out,
                            Some(Requirement::Margin),
                            real_row(normal, &f, dependence),
                            vec![(Target::PhaseMargin, slope(0)), (Target::GainMargin, slope(1))],
                        );
                    }
                }
            }
            if cut == self.main_cut() {
                if let Some(w) = self.targets.crossover_min {
                    // Re l₀*(L D̄) ≥ least Re D̄ at the frequency, in units of D̄₀.
                    let (place, least) = self.crossing_above(w, |k| magnitude(points[k].2));
                    let (d, b, curve) = &points[place];
                    let f: Affine = std::array::from_fn(|i| d[i] - b[i]);
                    let unit = curve / magnitude(*curve);
                    let mut row = real_row(unit, &f, dependence);
                    let base = real_row(C::new(1.0, 0.0), b, dependence);
                    row.constant -= least * base.constant;
                    for (t, s) in row.terms.iter_mut().zip(&base.terms) {
                        t.1 -= least * s.1;
                    }
                    // |L| falls as the bound moves up; where it rises, a higher
                    // bound costs nothing.
                    let fall = log_slope(&l.omega, place, |k| magnitude(points[k].2)).min(0.0);
                    let tightening = vec![(Target::CrossoverMin, fall)];
                    push(&mut out, Some(Requirement::CrossoverMin), row, tightening);
                }
                if let Some(w) = self.targets.crossover_max {
                    for k in self.above(w).take(8).step_by(2) {
                        let (d, b, _) = &points[k];
                        let f: Affine = std::array::from_fn(|i| d[i] - b[i]);
                        let bound = real_row(C::new(1.0, 0.0), b, dependence);
                        let slack = slack + Requirement::CrossoverMax as usize;
                        push_cone(&mut out, bound, &f, dependence, slack, trust, Vec::new());
                    }
                }
            }
        }
        // Sensitivity: |N| ≤ c Re(d₀* D).
        let holds: Vec<bool> = l.channel.gains().iter().map(|&g| l.channel.holds(g)).collect();
        let sensitivity = |out: &mut SiteRows, kind: Requirement, k: usize, level: f64| {
            let d = shift(&l.full[k]);
            let size = d[0].norm();
            let unit = d[0] / size;
            let d = scaled(&d, C::new(1.0 / size, 0.0));
            let mut f = scaled(&l.full[k], C::new(1.0 / size, 0.0));
            for (g, &x) in x.iter().enumerate() {
                if holds[g] {
                    f[1 + g] = C::new(0.0, 0.0);
                } else {
                    let t = f[1 + g] * x;
                    f[0] += t;
                }
            }
            let mut bound = real_row(unit, &d, dependence);
            bound.constant *= level;
            for t in &mut bound.terms {
                t.1 *= level;
            }
            // The bound falls with the level of a peak, the curve rises with the
            // frequency of a bandwidth.
            let size = |k: usize| {
                let free: Vec<f64> = without_hold(l.channel, x);
                (affine_value(&l.full[k], &free) / affine_value(&l.full[k], x)).norm()
            };
            let tightening = match kind {
                Requirement::RejectionPeak => vec![(Target::Drp, -level)],
                _ => vec![(Target::Drb, -log_slope(&l.omega, k, size))],
            };
            push_cone(out, bound, &f, dependence, slack + kind as usize, trust, tightening);
        };
        let level = self.rejection_level(options);
        for &k in &self.rejection_points {
            sensitivity(&mut out, Requirement::RejectionBandwidth, k, level);
        }
        if let Some(level) = self.peak_level(options) {
            for k in (0..n).filter(|&k| l.omega[k] < PEAK_BAND).step_by(2) {
                sensitivity(&mut out, Requirement::RejectionPeak, k, level);
            }
        }
        // Activity: Gauss–Newton about x.
        if self.nominal {
            let mut h = [[0.0; 3]; 3];
            let mut q = [0.0; 3];
            for k in 0..n {
                if self.weights[k] == 0.0 {
                    continue;
                }
                let (d, b, m) = (shift(&l.full[k]), shift(&l.opened[0][k]), shift(&l.noise[k]));
                let ratio = b[0] / d[0];
                let u = m[0] * ratio;
                let slope: [C; 3] = std::array::from_fn(|g| {
                    (m[1 + g] * ratio + m[0] * (b[1 + g] * d[0] - b[0] * d[1 + g]) / (d[0] * d[0]))
                        * dependence.get(g).map_or(0.0, |d| d.slope)
                });
                let w = self.weights[k] / activity_scale;
                for i in 0..gains {
                    q[i] += 2.0 * w * (slope[i].conj() * u).re;
                    for j in 0..=i {
                        h[i][j] += w * (slope[i].conj() * slope[j]).re;
                    }
                }
            }
            for i in 0..gains {
                out.linear.push((dependence[i].variable, q[i]));
                for j in 0..=i {
                    let v = if i == j { h[i][j] } else { 2.0 * h[i][j] };
                    out.quadratic.push((dependence[i].variable, dependence[j].variable, v));
                }
            }
        }
        out
    }
}

/// |f| ≤ bound + slack, unless it cannot bind within the region.
#[allow(clippy::too_many_arguments)]
fn push_cone(
    out: &mut SiteRows,
    mut bound: AffineRow,
    f: &Affine,
    dependence: &[Dependence],
    slack: usize,
    trust: f64,
    tightening: Vec<(Target, f64)>,
) {
    let room = bound.constant - magnitude(f[0]);
    let spread = trust
        * (bound.terms.iter().map(|t| t.1.abs()).sum::<f64>()
            + dependence.iter().map(|d| magnitude(f[1 + d.gain]) * d.slope).sum::<f64>());
    if room >= spread {
        return;
    }
    bound.terms.push((slack, 1.0));
    let re = real_row(C::new(1.0, 0.0), f, dependence);
    let im = real_row(C::new(0.0, 1.0), f, dependence);
    out.cones.push(Cone { rows: [bound, re, im], ease: room / spread, speed: 0, tightening });
}

/// Slope of a quantity over the logarithm of frequency at a grid point.
fn log_slope(omega: &[f64], k: usize, value: impl Fn(usize) -> f64) -> f64 {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(omega.len() - 1));
    if a == b { 0.0 } else { (value(b) - value(a)) / (omega[b] / omega[a]).ln() }
}

/// A target of a channel that can be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Phase margin, deg.
    PhaseMargin,
    /// Gain margins, dB.
    GainMargin,
    /// Disturbance rejection bandwidth, rad/s.
    Drb,
    /// Disturbance rejection peak, dB.
    Drp,
    /// Least crossover, rad/s.
    CrossoverMin,
}

impl Target {
    /// All targets.
    pub const ALL: [Target; 5] =
        [Target::PhaseMargin, Target::GainMargin, Target::Drb, Target::Drp, Target::CrossoverMin];

    /// The tightening that its price is of: in rad, natural logarithm of a
    /// gain factor, of a level or of a frequency, and in words.
    pub fn unit_tightening(self) -> (f64, &'static str) {
        const NEPER_PER_DECIBEL: f64 = std::f64::consts::LN_10 / 20.0;
        match self {
            Target::PhaseMargin => (std::f64::consts::PI / 180.0, "1 deg more"),
            Target::GainMargin => (0.25 * NEPER_PER_DECIBEL, "0.25 dB more"),
            Target::Drb => (0.02, "2 % more"),
            Target::Drp => (0.1 * NEPER_PER_DECIBEL, "0.1 dB less"),
            Target::CrossoverMin => (0.02, "2 % more"),
        }
    }
}

/// Price of a target at a speed, from the duals of the last program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Price {
    /// The channel.
    pub channel: Channel,
    /// Speed, m/s.
    pub speed: f64,
    /// The target.
    pub target: Target,
    /// Rise of the actuator activity at this speed for
    /// [`Target::unit_tightening`], %; to first order, with the other speeds'
    /// part of the cost counted as if it arose here.
    pub percent: f64,
}

/// What the sweeps over channels share.
struct Run<'a> {
    shared: Shared<'a>,
    options: &'a TuningOptions,
    /// Whether other answers are searched for.
    search: bool,
}

struct Sweeps {
    merits: Vec<(Channel, Merit)>,
    sweeps: usize,
    last_change: f64,
}

impl Run<'_> {
    /// Growth of the kite, then Gauss–Seidel sweeps over a group of channels.
    fn sweeps(
        &self,
        group: &[(Channel, ChannelSpec)],
        gains: &mut [GainSet],
        stats: &mut TuningStats,
    ) -> Result<Sweeps, TuningError> {
        let group: Vec<(Channel, &ChannelSpec)> = group.iter().map(|c| (c.0, &c.1)).collect();
        let mut merits: Vec<(Channel, Merit)> = Vec::new();
        let mut last_change = f64::INFINITY;
        let mut sweeps = 0;
        let mut moved = [false; Channel::ALL.len()];
        let growing = !self.options.growth.is_empty();
        if self.search && growing {
            for &(channel, _) in &group {
                self.search(channel, &group, gains, self.options, false, stats)?;
            }
        }
        // Sizes of the kite, and programs at most.
        let full = (1.0, self.options.iterations);
        let mut stages: VecDeque<(f64, usize)> =
            self.options.growth.iter().map(|&g| (g, 6)).collect();
        stages.extend(std::iter::repeat_n(full, self.options.sweeps));
        let mut pair_searches = if self.search { PAIR_SEARCHES } else { 0 };
        while let Some((growth, iterations)) = stages.pop_front() {
            let trust = match sweeps {
                0 => self.options.trust,
                k => self.options.trust.min(LATER_TRUST[(k - 1).min(1)]),
            };
            let options = TuningOptions { iterations, trust, ..self.options.clone() };
            let before = gains.to_vec();
            merits.clear();
            let solve = |channel: Channel, spec: &ChannelSpec, gains: &mut [GainSet]| {
                let clock = Instant::now();
                let trust = if moved[channel.index()] { self.options.trust } else { trust };
                let options = TuningOptions { trust, ..options.clone() };
                let mut problem =
                    ChannelProblem::new(channel, spec, self.shared, gains, growth, &options);
                problem.stats.assembly_time += clock.elapsed().as_secs_f64();
                let merit = problem.run(gains)?;
                Ok::<_, TuningError>((merit, problem.stats))
            };
            // Two channels at a time from the same point, as long as moving
            // both keeps the number of unstable poles; else one after the other.
            for pair in group.chunks(2) {
                let results: Vec<(Vec<GainSet>, Merit, TuningStats)> = pair
                    .par_iter()
                    .map(|&(channel, spec)| {
                        let mut own = gains.to_vec();
                        let (merit, stats) = solve(channel, spec, &mut own)?;
                        Ok((own, merit, stats))
                    })
                    .collect::<Result<_, TuningError>>()?;
                let mut joint = gains.to_vec();
                for ((channel, _), (own, _, s)) in pair.iter().zip(&results) {
                    let c = channel.index();
                    for (joint, own) in joint.iter_mut().zip(own) {
                        joint[c] = own[c];
                    }
                    stats.add(s);
                }
                if pair.len() == 1 || same_winding(&self.shared.models.nodes, gains, &joint) {
                    gains.copy_from_slice(&joint);
                    merits.extend(pair.iter().zip(results).map(|(c, r)| (c.0, r.1)));
                } else {
                    for &(channel, spec) in pair {
                        let (merit, s) = solve(channel, spec, gains)?;
                        stats.add(&s);
                        merits.push((channel, merit));
                    }
                }
            }
            tracing::debug!(
                "kite {growth}, sweep {sweeps}: change {:.3}, {} programs, solver {:.2} s, assembly {:.2} s: {:?}",
                change(&before, gains),
                stats.programs,
                stats.solver_time,
                stats.assembly_time,
                merits.iter().map(|m| (m.0.name(), m.1.activity, m.1.worst())).collect::<Vec<_>>()
            );
            if growth < 1.0 {
                continue;
            }
            let settled = change(&before, gains) < SWEEP_TOLERANCE;
            moved = [false; Channel::ALL.len()];
            if self.search && (settled || (growing && sweeps < SEARCH_SWEEPS)) {
                for (place, &(channel, _)) in group.iter().enumerate() {
                    let found = self.search(channel, &group, gains, &options, true, stats)?;
                    if let Some(merit) = found {
                        merits[place].1 = merit;
                        moved[channel.index()] = true;
                    }
                }
            }
            sweeps += 1;
            last_change = change(&before, gains);
            let last = last_change < SWEEP_TOLERANCE || stages.is_empty();
            if last && pair_searches > 0 {
                pair_searches -= 1;
                if self.search_pairs(&group, &merits, gains, &options, stats) {
                    moved = [true; Channel::ALL.len()];
                    stages.resize(stages.len().max(PAIR_SWEEPS), full);
                    continue;
                }
            }
            if last_change < SWEEP_TOLERANCE {
                break;
            }
        }
        Ok(Sweeps { merits, sweeps, last_change })
    }

    /// The grid with points added where a Nyquist curve passes close to its
    /// kite and its chord is long: between two points it may bulge inwards.
    fn refined_grid(
        &self,
        grid: &[f64],
        group: &[(Channel, ChannelSpec)],
        gains: &[GainSet],
    ) -> Arc<[f64]> {
        let mut parts = vec![1usize; grid.len()];
        for (channel, spec) in group {
            let problem =
                ChannelProblem::new(*channel, spec, self.shared, gains, 1.0, self.options);
            let x = problem.values(gains);
            for site in &problem.sites {
                for (cut, kite) in site.kites.iter().enumerate() {
                    let curve = site.loops.loop_curve(cut, &site.gains(&x));
                    for k in 0..grid.len() - 1 {
                        let chord = (curve[k + 1] - curve[k]).norm();
                        if chord > LONGEST_CHORD
                            && chord < 2.0
                            && kite.separation(curve[k], curve[k + 1]) < 0.5 * chord
                        {
                            let wanted = (chord / LONGEST_CHORD).ceil() as usize;
                            parts[k] = parts[k].max(wanted.min(8));
                        }
                    }
                }
            }
        }
        let mut out = Vec::with_capacity(grid.len());
        for (k, &n) in parts.iter().enumerate() {
            out.push(grid[k]);
            if k + 1 < grid.len() {
                let ratio = (grid[k + 1] / grid[k]).powf(1.0 / n as f64);
                out.extend((1..n).map(|i| grid[k] * ratio.powi(i as i32)));
            }
        }
        out.into()
    }

    /// Looks for other answers of a channel, speed by speed, and moves to them:
    /// the sequence is local, and a loop with several crossings has several
    /// local answers. With `settled`, a move is made only where the joint merit
    /// falls, and where the other channels of the group do not lose more than
    /// this one wins. Returns the merit if something has changed.
    #[allow(clippy::too_many_arguments)]
    fn search(
        &self,
        channel: Channel,
        group: &[(Channel, &ChannelSpec)],
        gains: &mut [GainSet],
        options: &TuningOptions,
        settled: bool,
        stats: &mut TuningStats,
    ) -> Result<Option<Merit>, TuningError> {
        let Some(&(_, spec)) = group.iter().find(|c| c.0 == channel) else {
            return Ok(None);
        };
        let clock = Instant::now();
        let problem = ChannelProblem::new(channel, spec, self.shared, gains, 1.0, options);
        let x = problem.values(gains);
        let Some(now) = problem.merit(&x, None) else {
            return Ok(None);
        };
        let found = problem.scan(&x);
        let mut candidate = x.clone();
        let mut best: Option<Merit> = None;
        // One speed after the other, since neighbours want to be alike.
        for (v, found) in found.iter().enumerate() {
            let Some((own, won)) = found else { continue };
            let place = problem.places[v];
            let old = std::mem::replace(&mut candidate[v], own.clone());
            let Some(merit) = problem.merit(&candidate, Some(&x)) else {
                candidate[v] = old;
                continue;
            };
            let least = best.as_ref().map_or(now.total, |b| b.total);
            let mut moved = gains[place];
            moved[channel.index()] = ChannelGains::from_values(channel, own);
            let good = !settled
                || (merit.total < least * (1.0 - SEARCH_TOLERANCE)
                    && self.loss_of_others(channel, group, gains, place, &moved, options) < *won);
            if good {
                gains[place] = moved;
                best = Some(merit);
            } else {
                candidate[v] = old;
            }
        }
        stats.assembly_time += clock.elapsed().as_secs_f64();
        tracing::debug!(
            "{channel}: {} of {} speeds have better gains by {:.4}, won {:.4}, {:.3} s",
            found.iter().flatten().count(),
            x.len(),
            found.iter().flatten().map(|f| f.1).sum::<f64>() / x.len() as f64,
            best.as_ref().map_or(0.0, |b| now.total - b.total),
            clock.elapsed().as_secs_f64()
        );
        Ok(best)
    }

    /// Rise of the merits of the other channels of a group at one speed if its
    /// gains become `moved`; infinite if one of them cannot be judged.
    fn loss_of_others(
        &self,
        channel: Channel,
        group: &[(Channel, &ChannelSpec)],
        gains: &[GainSet],
        place: usize,
        moved: &GainSet,
        options: &TuningOptions,
    ) -> f64 {
        let mut after = gains.to_vec();
        after[place] = *moved;
        let others = group
            .par_iter()
            .filter(|c| c.0 != channel && c.1.applies(self.shared.speeds[place]))
            .map(|&(other, spec)| {
                let (before, mut after) = (
                    self.problem_at(other, spec, gains, place, options),
                    self.problem_at(other, spec, &after, place, options),
                );
                after.reference_activity.clone_from(&before.reference_activity);
                let x = gains[place][other.index()].values(other);
                let judge = |p: &ChannelProblem| p.merit_at(0, &x, &x, f64::INFINITY);
                match (judge(&before), judge(&after)) {
                    (Some(a), Some(b)) => b - a,
                    _ => f64::INFINITY,
                }
            })
            .collect::<Vec<_>>();
        others.iter().sum()
    }

    /// The problem of a channel at one speed.
    fn problem_at<'a>(
        &self,
        channel: Channel,
        spec: &'a ChannelSpec,
        gains: &[GainSet],
        place: usize,
        options: &'a TuningOptions,
    ) -> ChannelProblem<'a> {
        ChannelProblem::at_places(channel, spec, self.shared, gains, 1.0, options, vec![place])
    }

    /// Where a requirement is missed: looks for other gains of the channel
    /// that misses it and of its partner at once, since each may have settled
    /// around the other. Returns whether something has changed.
    fn search_pairs(
        &self,
        group: &[(Channel, &ChannelSpec)],
        merits: &[(Channel, Merit)],
        gains: &mut [GainSet],
        options: &TuningOptions,
        stats: &mut TuningStats,
    ) -> bool {
        let clock = Instant::now();
        let spec_of = |c: Channel| group.iter().find(|g| g.0 == c).map(|g| g.1);
        // The speeds with the worst misses, and who misses.
        let mut missed: Vec<(usize, Channel, f64)> = Vec::new();
        for place in 0..self.shared.speeds.len() {
            let at = |channel: Channel, merit: &Merit| {
                let spec = spec_of(channel)?;
                let own = (0..place).filter(|&v| spec.applies(self.shared.speeds[v])).count();
                let worst = merit.violation.get(own)?.iter().copied().fold(0.0, f64::max);
                (spec.applies(self.shared.speeds[place]) && !channel.is_outer())
                    .then_some((place, channel, worst))
            };
            let worst = merits
                .iter()
                .filter_map(|(c, m)| at(*c, m))
                .max_by(|a, b| a.2.total_cmp(&b.2))
                .filter(|w| w.2 > MISSED);
            missed.extend(worst);
        }
        missed.sort_by(|a, b| b.2.total_cmp(&a.2));
        missed.truncate(PAIR_SPEEDS);
        let mut changed = false;
        for (place, second, worst) in missed {
            let first = second.partner();
            let (Some(first_spec), Some(second_spec)) = (spec_of(first), spec_of(second)) else {
                continue;
            };
            let reference: Vec<f64> = group
                .iter()
                .map(|&(c, spec)| {
                    let applies = spec.applies(self.shared.speeds[place]);
                    if applies {
                        self.problem_at(c, spec, gains, place, options).reference_activity[0]
                    } else {
                        1.0
                    }
                })
                .collect();
            // All channels' merits at this speed with some gains there.
            let total = |at: &GainSet| -> Option<f64> {
                let mut all = gains.to_vec();
                all[place] = *at;
                let mut sum = 0.0;
                for (&(c, spec), reference) in group.iter().zip(&reference) {
                    if spec.applies(self.shared.speeds[place]) {
                        let mut problem = self.problem_at(c, spec, &all, place, options);
                        problem.reference_activity[0] = *reference;
                        let x = at[c.index()].values(c);
                        sum += problem.merit_at(0, &x, &x, f64::INFINITY)?;
                    }
                }
                Some(sum)
            };
            let Some(now) = total(&gains[place]) else { continue };
            let x = gains[place][first.index()].values(first);
            let problem = self.problem_at(first, first_spec, gains, place, options);
            let tried: Vec<Option<(GainSet, f64)>> = problem
                .lattice(&x, PAIR_DENSITY)
                .par_iter()
                .map(|candidate| {
                    // The same number of unstable poles.
                    problem.merit_at(0, candidate, &x, f64::INFINITY)?;
                    let mut all = gains.to_vec();
                    all[place][first.index()] = ChannelGains::from_values(first, candidate);
                    let other = self.problem_at(second, second_spec, &all, place, options);
                    let own = gains[place][second.index()].values(second);
                    let (own, _) = other.best_of_lattice(0, &own, now)?;
                    all[place][second.index()] = ChannelGains::from_values(second, &own);
                    Some((all[place], total(&all[place])?))
                })
                .collect();
            let best = tried.into_iter().flatten().reduce(|a, b| if b.1 < a.1 { b } else { a });
            tracing::debug!(
                "{second} misses by {worst:.4} at {:.1} m/s: merit {now:.4}, with {first} {:.4}",
                self.shared.speeds[place],
                best.as_ref().map_or(f64::NAN, |b| b.1)
            );
            if let Some((moved, merit)) = best
                && merit < now * (1.0 - SCAN_PAIR_GAIN)
            {
                gains[place] = moved;
                changed = true;
            }
        }
        stats.assembly_time += clock.elapsed().as_secs_f64();
        changed
    }
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

    /// Loops of every speed and model.
    fn loop_models(
        &self,
        inversions: &[Inversion],
        grid: &Arc<[f64]>,
    ) -> Result<LoopSet, TuningError> {
        let pairs: Vec<(usize, usize)> = (0..self.set.plants.len())
            .flat_map(|v| (0..self.set.models.len()).map(move |m| (v, m)))
            .collect();
        let list: Result<Vec<LoopModel>, PlantError> = pairs
            .par_iter()
            .map(|&(v, m)| {
                LoopModel::new(
                    &self.set.plants[v][m],
                    &inversions[v],
                    &self.settings,
                    self.hardware,
                    self.set.models[m].extra_delay,
                    grid.clone(),
                )
            })
            .collect();
        let mut list = list?.into_iter();
        let nodes = self
            .set
            .plants
            .iter()
            .map(|_| list.by_ref().take(self.set.models.len()).collect())
            .collect();
        let speeds = self.set.speeds();
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
                let inversion = inversions[lower].blend(&inversions[upper], weight);
                let model = LoopModel::new(
                    plant,
                    &inversion,
                    &self.settings,
                    self.hardware,
                    self.set.models[0].extra_delay,
                    grid.clone(),
                )?;
                Ok(Some(Between { lower, weight, model }))
            })
            .collect();
        Ok(LoopSet { nodes, between: between?.into_iter().flatten().collect() })
    }

    /// Starting gains: for each speed the first of a few that stabilises every
    /// model, scaled from the equivalent delay of the nominal plant.
    pub fn starts(&self, inversions: &[Inversion]) -> Result<Vec<GainSet>, TuningError> {
        let speeds = self.set.plants.iter().zip(inversions).collect::<Vec<_>>();
        speeds
            .par_iter()
            .map(|(plants, inversion)| {
                let mut best: Option<(f64, usize, GainSet)> = None;
                for scale in START_SCALES {
                    let mut g = GainSet::default();
                    for (channel, spec) in &self.channels {
                        let delay = equivalent_delay(
                            &plants[0],
                            inversion,
                            channel.axis(),
                            &self.hardware,
                        )?;
                        g[channel.index()] =
                            start_gains(*channel, delay / scale, spec.integral_ratio);
                    }
                    let inner = inner_only(&g);
                    let worst = self
                        .growths(plants, inversion, &inner)
                        .into_iter()
                        .enumerate()
                        .max_by(|a, b| a.1.total_cmp(&b.1));
                    let Some((model, growth)) = worst else { continue };
                    if growth < START_GROWTH {
                        return Ok(g);
                    }
                    if best.is_none_or(|b| growth < b.0) {
                        best = Some((growth, model, g));
                    }
                }
                let (growth, model, gains) = best.unwrap_or((f64::NAN, 0, GainSet::default()));
                // An axis that is left open may be what grows: then the most
                // stable start has to do, and the verification says so.
                let inner = self.channels.iter().filter(|c| !c.0.is_outer()).count();
                if inner < Axis::ALL.len() && growth.is_finite() {
                    return Ok(gains);
                }
                // Attitude holds leave the velocities free, and the outer loops
                // take care of those.
                let outer =
                    self.channels.iter().any(|c| c.0.is_outer() && c.1.applies(plants[0].speed));
                if outer && growth < DRIFT_GROWTH {
                    return Ok(gains);
                }
                Err(TuningError::Unstabilisable {
                    model: self.set.models[model].name.clone(),
                    speed: plants[0].speed,
                    growth,
                })
            })
            .collect()
    }

    /// Largest real part of the closed loop of each model at one speed.
    fn growths(&self, plants: &[Plant], inversion: &Inversion, gains: &GainSet) -> Vec<f64> {
        plants
            .iter()
            .zip(&self.set.models)
            .map(|(plant, model)| {
                stability::closed_loop_eigenvalues(
                    plant,
                    inversion,
                    &self.settings,
                    &self.hardware,
                    model.extra_delay,
                    gains,
                    stability::PADE_ORDER,
                )
                .map_or(f64::NAN, |e| stability::growth(&e))
            })
            .collect()
    }

    /// Halves outer gains at each speed until the loop around the tuned inner
    /// one is stable; failing that, leaves them where it grows least.
    fn slow_down_outer(
        &self,
        run: &Run,
        inversions: &[Inversion],
        group: &[(Channel, ChannelSpec)],
        gains: &mut [GainSet],
    ) {
        gains.par_iter_mut().enumerate().for_each(|(v, g)| {
            let mut best = (f64::INFINITY, *g);
            for _ in 0..8 {
                let worst = self
                    .growths(&self.set.plants[v], &inversions[v], g)
                    .into_iter()
                    .fold(f64::NEG_INFINITY, f64::max);
                if worst < START_GROWTH || !run.shared.speeds[v].is_finite() {
                    return;
                }
                if worst < best.0 {
                    best = (worst, *g);
                }
                for (c, _) in group {
                    let k = &mut g[c.index()];
                    *k = ChannelGains::new(k.k_d, 0.5 * k.k_p, 0.25 * k.k_i);
                }
            }
            *g = best.1;
        });
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
        let mut models = self.loop_models(&inversions, &grid)?;
        let mut stats =
            TuningStats { assembly_time: clock.elapsed().as_secs_f64(), ..TuningStats::default() };
        let mut gains = match start {
            Some(start) => start.to_vec(),
            None => self.starts(&inversions)?,
        };
        for (g, v) in gains.iter_mut().zip(&speeds) {
            for (channel, spec) in &self.channels {
                if !spec.applies(*v) {
                    g[channel.index()] = ChannelGains::default();
                }
            }
        }
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
                self.slow_down_outer(&run, &inversions, group, &mut gains);
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
            models = self.loop_models(&inversions, &grid)?;
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
            let mut problem = ChannelProblem::new(
                *channel,
                spec,
                Shared { classes: &classes, models: &models, speeds: &speeds },
                &gains,
                1.0,
                &self.options,
            );
            prices.extend(problem.prices(&gains)?);
            stats.add(&problem.stats);
        }
        Ok(Tuning { speeds, gains, inversions, merits, prices, sweeps, last_change, stats })
    }
}

/// Starting bandwidths tried, relative to what the equivalent delay suggests.
const START_SCALES: [f64; 5] = [1.0, 0.7, 1.3, 0.5, 1.7];
/// Largest real part that still counts as stable, 1/s: a heading or position
/// mode at zero is not a divergence.
pub const START_GROWTH: f64 = 1e-6;
/// Largest real part that counts as a drift of the velocities, 1/s: with the
/// attitudes held, u and v are left with what is nearly neutral in hover. It
/// doubles in 14 s, and is for the outer loops to hold; where there are none,
/// it is not let pass.
pub const DRIFT_GROWTH: f64 = 0.05;

/// Delay that the hardware and the full-order plant add to the reduced model in
/// an axis, s: the phase between the two responses of ν to the output's rate,
/// divided by frequency, at about the frequency where it matters (0.4/τ).
pub fn equivalent_delay(
    plant: &Plant,
    inversion: &Inversion,
    axis: Axis,
    hardware: &Hardware,
) -> Result<f64, TuningError> {
    let full = FrequencyModel::new(plant, *hardware, 0.0)?;
    let mut reduced_plant = plant.clone();
    reduced_plant.a = DMatrix::from_iterator(8, 8, plant.reduced_a.iter().copied());
    reduced_plant.b = DMatrix::from_iterator(8, 4, plant.reduced_b.iter().copied());
    reduced_plant.measured = std::array::from_fn(|k| k);
    let reduced = FrequencyModel::new(&reduced_plant, *hardware, 0.0)?;
    let i = axis.index();
    let response = |model: &FrequencyModel, w: f64| {
        let x = model.states(w);
        (0..8).fold(C::new(0.0, 0.0), |sum, k| {
            let column =
                (0..4).fold(C::new(0.0, 0.0), |s, j| s + x[k][j] * inversion.allocation[(j, i)]);
            sum + column * inversion.outputs[(i, k)]
        })
    };
    let mut delay = hardware.equivalent_delay().max(0.01);
    for _ in 0..4 {
        let w = 0.4 / delay;
        let extra = response(&full, w) / response(&reduced, w);
        let path = hardware.response(w, 0.0);
        // Phase of hardware and of what the reduced model leaves out.
        delay = (-(path.arg() + extra.arg()) / w).clamp(0.01, 1.0);
    }
    if !delay.is_finite() {
        return Err(TuningError::NotFinite { model: "nominal".into(), speed: plant.speed });
    }
    Ok(delay)
}

/// Sweeps end when no gain changes by more than this fraction.
const SWEEP_TOLERANCE: f64 = 0.02;

/// Largest relative change of a gain.
fn change(a: &[GainSet], b: &[GainSet]) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a.iter().zip(b) {
            for (a, b) in a.array().into_iter().zip(b.array()) {
                worst = worst.max((b - a).abs() / (a.abs() + 1e-2));
            }
        }
    }
    worst
}

/// Starting gains from an equivalent delay: K_D = 0.33/τ, K_P = 0.05/τ² and
/// K_I at a fifth of K_P for an attitude; the same K_P, K_I one order lower
/// for a rate or velocity. `ratio` bounds K_I/K_P.
pub fn start_gains(channel: Channel, delay: f64, ratio: [f64; 2]) -> ChannelGains {
    if channel.is_outer() {
        // A quarter of the inner loop's bandwidth.
        let k_p = 0.05 / delay;
        return ChannelGains::new(0.0, k_p, k_p * 0.05f64.clamp(ratio[0], ratio[1]));
    }
    let (first, second) = (0.33 / delay, 0.05 / (delay * delay));
    match channel {
        Channel::Roll | Channel::Pitch => {
            ChannelGains::new(first, second, second * 0.2f64.clamp(ratio[0], ratio[1]))
        }
        _ => ChannelGains::new(0.0, first, first * (second / first).clamp(ratio[0], ratio[1])),
    }
}

/// Whether a status needs telling: kept beside the solver for the report.
pub fn status_note(status: Status) -> Option<&'static str> {
    match status {
        Status::Solved => None,
        Status::AlmostSolved => Some("solved to reduced accuracy"),
        Status::Infeasible => Some("infeasible"),
        Status::Unbounded => Some("unbounded"),
        Status::IterationLimit => Some("stopped at the iteration limit"),
        Status::NumericalFailure => Some("failed numerically"),
    }
}
