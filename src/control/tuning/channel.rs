//! One channel over all speeds and models, the other channels fixed, and its
//! exact merit.

use super::super::axis::{Channel, ChannelGains, Gain, GainSet};
use super::site::{Site, SiteMaker};
use super::targets::{ChannelSpec, KINDS, Requirement};
use super::{Shared, TuningOptions, TuningStats};
use rayon::prelude::*;

/// Price of a unit of K_I/K_P ratio violation.
pub(super) const RATIO_PRICE: f64 = 300.0;

/// One channel over all speeds and models, other channels fixed.
#[derive(Clone)]
pub struct ChannelProblem<'a> {
    pub(super) channel: Channel,
    pub(super) spec: &'a ChannelSpec,
    pub(super) options: &'a TuningOptions,
    /// Places of this channel's speeds among all.
    pub(super) places: Vec<usize>,
    pub(super) speeds: Vec<f64>,
    pub(super) sites: Vec<Site>,
    /// Activity² at the start of this run, by speed.
    pub(super) reference_activity: Vec<f64>,
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
    pub(super) fn at_places(
        channel: Channel,
        spec: &'a ChannelSpec,
        shared: Shared<'_>,
        gains: &[GainSet],
        growth: f64,
        options: &'a TuningOptions,
        places: Vec<usize>,
    ) -> Self {
        let maker = SiteMaker { channel, spec, growth, options };
        let mut sites = maker.at_breakpoints(shared, gains, &places);
        sites.extend(maker.between(shared.models, gains, &places));
        let mut problem = Self {
            channel,
            spec,
            options,
            speeds: places.iter().map(|&v| shared.speeds[v]).collect(),
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

    pub(super) fn write(&self, x: &[Vec<f64>], gains: &mut [GainSet]) {
        for (&v, x) in self.places.iter().zip(x) {
            gains[v][self.channel.index()] = ChannelGains::from_values(self.channel, x);
        }
    }

    pub(super) fn gain_count(&self) -> usize {
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

    pub(super) fn price(&self, kind: Requirement) -> f64 {
        kind.price() * self.spec.priority * self.options.price_scale
    }

    /// Places of K_P and K_I among the channel's gains.
    pub(super) fn ratio_places(&self) -> [usize; 2] {
        let place = |gain: Gain| self.channel.gains().iter().position(|&g| g == gain).unwrap_or(0);
        [place(Gain::Proportional), place(Gain::Integral)]
    }

    /// Weights and scales of the smoothness terms.
    pub(super) fn smoothness_scales(&self, x: &[Vec<f64>]) -> Vec<f64> {
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
    pub(super) fn speed_gap(&self, k: usize) -> f64 {
        ((self.speeds[k + 1] - self.speeds[k]) / 5.0).max(1e-3)
    }

    /// By how much K_I lies outside its bounds.
    pub(super) fn ratio_excess(&self, x: &[f64]) -> f64 {
        let [p, i] = self.ratio_places();
        let [low, high] = self.spec.integral_ratio;
        (low * x[p] - x[i]).max(0.0) + (x[i] - high * x[p]).max(0.0)
    }
}
