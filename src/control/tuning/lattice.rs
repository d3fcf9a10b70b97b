//! Gains of a lattice around those of a channel: the sequence of programs is
//! local, and a loop with several crossings has several local answers.

use super::channel::{ChannelProblem, RATIO_PRICE};
use super::targets::{KINDS, Requirement};
use rayon::prelude::*;

/// Merit, relative to that of the present gains, that makes gains of the
/// lattice worth starting from.
const SCAN_GAIN: f64 = 0.995;

impl ChannelProblem<'_> {
    /// Merit of gains at one speed by itself: without smoothness and without
    /// the sites between breakpoints. `None` as soon as it cannot be below
    /// `bound`, and where the winding differs from that at `reference`.
    pub(super) fn merit_at(
        &self,
        speed: usize,
        x: &[f64],
        reference: &[f64],
        bound: f64,
    ) -> Option<f64> {
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
            let kind = Requirement::RejectionBandwidth as usize;
            worst[kind] = worst[kind].max(site.rejection_violation(x, self.options));
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

    /// Looks at each speed by itself for gains that are better than those of
    /// `x` by the exact merit, on a lattice that spans all that is reasonable.
    /// Gains and the fall of the merit there; `None` where there are none.
    pub(super) fn scan(&self, x: &[Vec<f64>]) -> Vec<Option<(Vec<f64>, f64)>> {
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
    pub(super) fn best_of_lattice(
        &self,
        speed: usize,
        x: &[f64],
        bound: f64,
    ) -> Option<(Vec<f64>, f64)> {
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
    pub(super) fn lattice(&self, x: &[f64], density: f64) -> Vec<Vec<f64>> {
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
}
