//! One speed and model within the problem of a channel, and its exact
//! requirements on the frequency grid.

use super::super::axis::{Channel, GainSet, inner_only};
use super::super::kite::{Kite, magnitude};
use super::super::loops::{ChannelLoops, Cut, Dependence, LoopModel, affine_value, without_hold};
use super::super::metrics;
use super::targets::{ChannelSpec, KINDS, Targets};
use super::{Between, LoopSet, Shared, TuningOptions, WHOLE_SHARE};
use num_complex::Complex64 as C;
use rayon::prelude::*;

/// A change of phase of D_new/D_old over the grid beyond this is a change of
/// the number of unstable poles, rad.
pub(super) const WINDING_TOLERANCE: f64 = 1.5;

/// Least |L| of a hump that counts for the least crossover.
const HUMP: f64 = 1.1;
/// |L| falls at a grid point if it is larger by this factor so many points below.
const FALL: f64 = 1.02;
/// Those points.
const FALL_STEPS: usize = 3;

/// Highest frequency at which the rejection peak is required, rad/s.
pub(super) const PEAK_BAND: f64 = 25.0;

/// One speed and model within a channel's problem.
#[derive(Clone)]
pub(super) struct Site {
    pub(super) speed: usize,
    /// Share of that speed's gains here.
    pub(super) weight: f64,
    /// For a site between breakpoints: the upper one, and its share.
    pub(super) next: Option<(usize, f64)>,
    /// Whether its activity is counted: the inverted model at a breakpoint.
    pub(super) nominal: bool,
    pub(super) targets: Targets,
    pub(super) loops: ChannelLoops,
    pub(super) kites: Vec<Kite>,
    /// Grid points at which the rejection bandwidth is required.
    pub(super) rejection_points: Vec<usize>,
    /// Trapezoid weights of the activity.
    pub(super) weights: Vec<f64>,
}

/// Makes the sites of a channel.
pub(super) struct SiteMaker<'a> {
    pub(super) channel: Channel,
    pub(super) spec: &'a ChannelSpec,
    /// Size of the kite (1: full).
    pub(super) growth: f64,
    pub(super) options: &'a TuningOptions,
}

impl SiteMaker<'_> {
    /// The effector cut comes first: activity is counted there. An outer loop
    /// also has margins of its own.
    fn cuts(&self) -> &'static [Cut] {
        if self.channel.is_outer() { &[Cut::Effector, Cut::Channel] } else { &[Cut::Effector] }
    }

    fn site(&self, model: &LoopModel, gains: &GainSet, cuts: &[Cut], targets: Targets) -> Site {
        let loops = model.channel(gains, self.channel, cuts);
        let back = metrics::from_decibels(self.options.gain_back_off);
        let kite = Kite::new(
            targets.gain_up.powf(self.growth) * back,
            targets.gain_down.powf(self.growth) * back,
            (targets.phase + self.spec.phase_reserve) * self.growth + self.options.phase_back_off,
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
    }

    /// Gains to judge the channel with, and whether only its margins count.
    /// Rejection and crossover of an inner axis are those with the outer loops
    /// open; its margins must hold with them closed, too.
    fn variants(&self, gains: &GainSet) -> Vec<(GainSet, bool)> {
        let inner = inner_only(gains);
        match self.channel.is_outer() {
            true => vec![(*gains, false)],
            false if inner == *gains => vec![(inner, false)],
            false => vec![(inner, false), (*gains, true)],
        }
    }

    /// Sites of every model at the breakpoints `places`.
    pub(super) fn at_breakpoints(
        &self,
        Shared { classes, models, .. }: Shared<'_>,
        gains: &[GainSet],
        places: &[usize],
    ) -> Vec<Site> {
        let nodes: Vec<(usize, usize, GainSet, bool)> = (0..places.len())
            .flat_map(|v| (0..classes.len()).map(move |m| (v, m)))
            .flat_map(|(v, m)| {
                let variants = self.variants(&gains[places[v]]);
                variants.into_iter().map(move |(g, closed)| (v, m, g, closed))
            })
            .collect();
        nodes
            .par_iter()
            .flat_map_iter(|(v, m, gains, closed)| {
                let place = places[*v];
                let targets = *self.spec.targets(classes[*m]);
                let model = &models.nodes[place][*m];
                let divided = model.law().share(self.channel) < WHOLE_SHARE;
                let margins = if *closed || divided { targets.margins_only() } else { targets };
                let cuts = if divided { &self.cuts()[..1] } else { self.cuts() };
                let site = self.site(model, gains, cuts, margins);
                let flown = Site { speed: *v, nominal: *m == 0 && !closed && !divided, ..site };
                // Where turn coordination has a share of the bank, the gains are
                // those of the loop by itself: the law fades what it asks for.
                let alone = models.undivided[place].as_ref().filter(|_| divided).map(|list| {
                    let site = self.site(&list[*m], gains, self.cuts(), targets);
                    Site { speed: *v, nominal: *m == 0, ..site }
                });
                std::iter::once(flown).chain(alone)
            })
            .collect()
    }

    /// Sites of the nominal model between the breakpoints `places`.
    pub(super) fn between(
        &self,
        models: &LoopSet,
        gains: &[GainSet],
        places: &[usize],
    ) -> Vec<Site> {
        let at = |b: &Between| -> Vec<Site> {
            let lower = places.iter().position(|&p| p == b.lower);
            let upper = places.iter().position(|&p| p == b.lower + 1);
            let (speed, weight, next) = match (lower, upper) {
                (Some(l), Some(u)) => (l, 1.0 - b.weight, Some((u, b.weight))),
                // An outer loop that fades out here.
                (Some(l), None) => (l, 1.0 - b.weight, None),
                (None, Some(u)) => (u, b.weight, None),
                (None, None) => return Vec::new(),
            };
            let blended: GainSet =
                std::array::from_fn(|c| gains[b.lower][c].blend(&gains[b.lower + 1][c], b.weight));
            let fading = next.is_none() || b.model.law().share(self.channel) < WHOLE_SHARE;
            let cuts = if fading { &self.cuts()[..1] } else { self.cuts() };
            self.variants(&blended)
                .into_iter()
                .map(|(gains, closed)| {
                    let targets = self.spec.nominal;
                    let margins = closed || fading;
                    let targets = if margins { targets.margins_only() } else { targets };
                    Site { speed, weight, next, ..self.site(&b.model, &gains, cuts, targets) }
                })
                .collect()
        };
        let parts: Vec<Vec<Site>> = models.between.par_iter().map(at).collect();
        parts.into_iter().flatten().collect()
    }
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
    pub(super) fn gains(&self, x: &[Vec<f64>]) -> Vec<f64> {
        let mut out: Vec<f64> = x[self.speed].iter().map(|x| self.weight * x).collect();
        if let Some((other, t)) = self.next {
            for (out, x) in out.iter_mut().zip(&x[other]) {
                *out += t * x;
            }
        }
        out
    }

    /// Whether it belongs to a breakpoint.
    pub(super) fn at_breakpoint(&self) -> bool {
        self.weight == 1.0 && self.next.is_none()
    }

    /// How these gains depend on the scaled steps of all speeds.
    pub(super) fn dependence(&self, scale: &[Vec<f64>]) -> Vec<Dependence> {
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

    pub(super) fn activity_squared(&self, x: &[f64]) -> f64 {
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
    pub(super) fn rejection_violation(&self, x: &[f64], options: &TuningOptions) -> f64 {
        let free = without_hold(self.loops.channel, x);
        let level = self.rejection_level(options);
        let s = |k: usize| {
            let f = &self.loops.full[k];
            magnitude(affine_value(f, &free) / affine_value(f, x))
        };
        self.rejection_points.iter().map(|&k| s(k) - level).fold(0.0, f64::max)
    }

    /// The cut whose crossover is specified.
    pub(super) fn main_cut(&self) -> usize {
        self.kites.len() - 1
    }

    pub(super) fn rejection_level(&self, options: &TuningOptions) -> f64 {
        metrics::DRB_LEVEL * metrics::from_decibels(-options.rejection_back_off)
    }

    pub(super) fn peak_level(&self, options: &TuningOptions) -> Option<f64> {
        let back = metrics::from_decibels(-options.rejection_back_off);
        self.targets.drp.map(|p| p * back)
    }

    /// Grid points at which |L| ≤ 1 is required for the largest crossover.
    pub(super) fn above(&self, crossover: f64) -> impl Iterator<Item = usize> + '_ {
        let w = &self.loops.omega;
        (0..w.len()).filter(move |&k| w[k] >= crossover * 0.9999 && w[k] < 3.0 * crossover)
    }

    /// Grid point, and the least |L| there, that keeps the last crossing beyond
    /// `crossover`: that frequency itself if |L| falls there, or where the loop
    /// rises once more up to three times as far, if it rises well above 1. A
    /// hump that just touches 1 would meet the definition, and lose the
    /// crossing at once.
    pub(super) fn crossing_above(
        &self,
        crossover: f64,
        size: impl Fn(usize) -> f64,
    ) -> (usize, f64) {
        let place = nearest(&self.loops.omega, crossover);
        let falls = size(place.saturating_sub(FALL_STEPS)) > FALL * size(place);
        let first = (place, if falls { 1.0 } else { HUMP });
        self.above(crossover).filter(|&k| k > first.0).fold(first, |best, k| {
            if size(k) / HUMP > size(best.0) / best.1 { (k, HUMP) } else { best }
        })
    }

    /// Exact violations on the grid.
    pub(super) fn violations(
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
}
