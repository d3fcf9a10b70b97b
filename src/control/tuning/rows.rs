//! The convex rows that imply the requirements of a site near its gains.

use super::super::kite::{Kite, Separation, magnitude};
use super::super::loops::{Affine, Dependence, affine_value, real_row, without_hold};
use super::TuningOptions;
use super::site::{PEAK_BAND, Site};
use super::targets::{Requirement, Target};
use crate::numerics::conic::AffineRow;
use num_complex::Complex64 as C;

/// Least Re D/D̄₀ along the separating normal: keeps the winding.
const STABILITY_FLOOR: f64 = 0.05;
/// |L| above this needs no margin rows.
const MARGIN_REACH: f64 = 20.0;
/// Distance from the kite beyond which a segment gets no margin rows.
const MARGIN_DISTANCE: f64 = 0.5;

/// A row of a site.
pub(super) struct HalfSpace {
    pub(super) row: AffineRow,
    /// Value at the centre over the most that it can fall within the region:
    /// below zero violated, at one it cannot bind.
    pub(super) ease: f64,
    /// Place of the speed whose slack it has.
    pub(super) speed: usize,
    /// Change of the row's value as its targets tighten; zero for a hard row.
    pub(super) tightening: Vec<(Target, f64)>,
}

/// A cone of a site.
pub(super) struct Cone {
    pub(super) rows: [AffineRow; 3],
    pub(super) ease: f64,
    pub(super) speed: usize,
    pub(super) tightening: Vec<(Target, f64)>,
}

/// Contribution of one site to a program.
#[derive(Default)]
pub(super) struct SiteRows {
    pub(super) half_spaces: Vec<HalfSpace>,
    pub(super) cones: Vec<Cone>,
    pub(super) quadratic: Vec<(usize, usize, f64)>,
    pub(super) linear: Vec<(usize, f64)>,
}

impl Site {
    /// Convex rows about the gains of a region.
    pub(super) fn rows(
        &self,
        region: Region<'_>,
        options: &TuningOptions,
        activity_scale: f64,
    ) -> SiteRows {
        let mut rows = RowMaker { site: self, region, out: SiteRows::default() };
        for (cut, kite) in self.kites.iter().enumerate() {
            let points = rows.points(cut);
            rows.margins(kite, &points);
            if cut == self.main_cut() {
                rows.crossover(&points);
            }
        }
        rows.sensitivity(options);
        if self.nominal {
            rows.activity(activity_scale);
        }
        rows.out
    }
}

/// The gains that rows are made about, and how far a step may go.
#[derive(Clone, Copy)]
pub(super) struct Region<'a> {
    /// The site's gains.
    pub(super) x: &'a [f64],
    /// How they depend on the scaled step d.
    pub(super) dependence: &'a [Dependence],
    /// Place of the site's first slack.
    pub(super) slack: usize,
    /// |d| at most.
    pub(super) trust: f64,
}

/// A grid point of a cut, all over the value D̄₀ of the opened determinant at
/// the centre: D and D̄ as functions of the gains, and L.
type Point = (Affine, Affine, C);

struct RowMaker<'a> {
    site: &'a Site,
    region: Region<'a>,
    out: SiteRows,
}

impl RowMaker<'_> {
    /// An affine function about the centre: the constant is the value there.
    fn shift(&self, f: &Affine) -> Affine {
        let mut g = *f;
        g[0] = affine_value(f, self.region.x);
        g
    }

    fn points(&self, cut: usize) -> Vec<Point> {
        let l = &self.site.loops;
        (0..l.omega.len())
            .map(|k| {
                let (d, b) = (self.shift(&l.full[k]), self.shift(&l.opened[cut][k]));
                let by = b[0].inv();
                let curve = d[0] * by - 1.0;
                (scaled(&d, by), scaled(&b, by), curve)
            })
            .collect()
    }

    /// A row that must not be negative, elastic by the slack of `kind`. One that
    /// cannot bind within the region is left out: exact, and most rows go that
    /// way.
    fn push(
        &mut self,
        kind: Option<Requirement>,
        mut row: AffineRow,
        tightening: Vec<(Target, f64)>,
    ) {
        let spread = self.region.trust * row.terms.iter().map(|t| t.1.abs()).sum::<f64>();
        if row.constant >= spread {
            return;
        }
        if let Some(k) = kind {
            row.terms.push((self.region.slack + k as usize, 1.0));
        }
        let ease = row.constant / spread;
        self.out.half_spaces.push(HalfSpace { row, ease, speed: 0, tightening });
    }

    /// |f| ≤ bound + slack, unless it cannot bind within the region.
    fn push_cone(
        &mut self,
        kind: Requirement,
        mut bound: AffineRow,
        f: &Affine,
        tightening: Vec<(Target, f64)>,
    ) {
        let dependence = self.region.dependence;
        let room = bound.constant - magnitude(f[0]);
        let spread = self.region.trust
            * (bound.terms.iter().map(|t| t.1.abs()).sum::<f64>()
                + dependence.iter().map(|d| magnitude(f[1 + d.gain]) * d.slope).sum::<f64>());
        if room >= spread {
            return;
        }
        bound.terms.push((self.region.slack + kind as usize, 1.0));
        let re = real_row(C::new(1.0, 0.0), f, dependence);
        let im = real_row(C::new(0.0, 1.0), f, dependence);
        let rows = [bound, re, im];
        self.out.cones.push(Cone { rows, ease: room / spread, speed: 0, tightening });
    }

    /// Half-planes between the Nyquist curve and the kite, piece by piece.
    fn margins(&mut self, kite: &Kite, points: &[Point]) {
        let dependence = self.region.dependence;
        for pair in points.windows(2) {
            let (a, b) = (pair[0].2, pair[1].2);
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
            for (d, _, _) in pair {
                let mut row = real_row(normal, d, dependence);
                row.constant -= STABILITY_FLOOR.min(0.5 * row.constant.abs());
                self.push(None, row, Vec::new());
            }
            if separation.distance > MARGIN_DISTANCE {
                continue;
            }
            // The two vertices nearest to the separating line; the others
            // follow unless D̄ turns far within the region, and then the
            // exact merit refuses the step.
            let mut vertices: Vec<(C, [C; 2])> = kite.vertices_with_slopes().collect();
            vertices.sort_by(|p, q| (normal.conj() * q.0).re.total_cmp(&(normal.conj() * p.0).re));
            for (d, b, _) in pair {
                for (z, slopes) in &vertices[..2] {
                    // Re n*(L − z) D̄/D̄₀, affine in the gains.
                    let f: Affine = std::array::from_fn(|i| d[i] - (1.0 + z) * b[i]);
                    // D̄ = D̄₀ here.
                    let slope = |k: usize| -(normal.conj() * slopes[k]).re;
                    self.push(
                        Some(Requirement::Margin),
                        real_row(normal, &f, dependence),
                        vec![(Target::PhaseMargin, slope(0)), (Target::GainMargin, slope(1))],
                    );
                }
            }
        }
    }

    /// Least and largest crossover.
    fn crossover(&mut self, points: &[Point]) {
        let (site, dependence) = (self.site, self.region.dependence);
        if let Some(w) = site.targets.crossover_min {
            // Re l₀*(L D̄) ≥ least Re D̄ at the frequency, in units of D̄₀.
            let (place, least) = site.crossing_above(w, |k| magnitude(points[k].2));
            let (d, b, curve) = &points[place];
            let f: Affine = std::array::from_fn(|i| d[i] - b[i]);
            let unit = curve / magnitude(*curve);
            let mut row = real_row(unit, &f, dependence);
            let base = real_row(C::new(1.0, 0.0), b, dependence);
            row.constant -= least * base.constant;
            for (t, s) in row.terms.iter_mut().zip(&base.terms) {
                t.1 -= least * s.1;
            }
            // |L| falls as the bound moves up; where it rises, a higher bound
            // costs nothing.
            let fall = log_slope(&site.loops.omega, place, |k| magnitude(points[k].2)).min(0.0);
            let tightening = vec![(Target::CrossoverMin, fall)];
            self.push(Some(Requirement::CrossoverMin), row, tightening);
        }
        if let Some(w) = site.targets.crossover_max {
            for k in site.above(w).take(8).step_by(2) {
                let (d, b, _) = &points[k];
                let f: Affine = std::array::from_fn(|i| d[i] - b[i]);
                let bound = real_row(C::new(1.0, 0.0), b, dependence);
                // It has no price: least activity seldom wants more crossover.
                self.push_cone(Requirement::CrossoverMax, bound, &f, Vec::new());
            }
        }
    }

    /// Bandwidth and peak of disturbance rejection.
    fn sensitivity(&mut self, options: &TuningOptions) {
        let site = self.site;
        let level = site.rejection_level(options);
        for &k in &site.rejection_points {
            // The curve rises with the frequency of a bandwidth; where it falls,
            // more bandwidth costs nothing.
            let l = &site.loops;
            let x = self.region.x;
            let free: Vec<f64> = without_hold(l.channel, x);
            let size =
                |k: usize| (affine_value(&l.full[k], &free) / affine_value(&l.full[k], x)).norm();
            let tightening = vec![(Target::Drb, (-log_slope(&l.omega, k, size)).min(0.0))];
            self.push_sensitivity(Requirement::RejectionBandwidth, k, level, tightening);
        }
        if let Some(level) = site.peak_level(options) {
            let omega = &site.loops.omega;
            for k in (0..omega.len()).filter(|&k| omega[k] < PEAK_BAND).step_by(2) {
                // The bound falls with the level of a peak.
                let tightening = vec![(Target::Drp, -level)];
                self.push_sensitivity(Requirement::RejectionPeak, k, level, tightening);
            }
        }
    }

    /// |S| ≤ level at a grid point: |N| ≤ level Re(d₀* D).
    fn push_sensitivity(
        &mut self,
        kind: Requirement,
        k: usize,
        level: f64,
        tightening: Vec<(Target, f64)>,
    ) {
        let l = &self.site.loops;
        let d = self.shift(&l.full[k]);
        let size = d[0].norm();
        let unit = d[0] / size;
        let d = scaled(&d, C::new(1.0 / size, 0.0));
        let mut f = scaled(&l.full[k], C::new(1.0 / size, 0.0));
        let gains = l.channel.gains().iter().zip(self.region.x).enumerate();
        for (g, (&gain, &x)) in gains {
            if l.channel.holds(gain) {
                f[1 + g] = C::new(0.0, 0.0);
            } else {
                let t = f[1 + g] * x;
                f[0] += t;
            }
        }
        let mut bound = real_row(unit, &d, self.region.dependence);
        bound.constant *= level;
        for t in &mut bound.terms {
            t.1 *= level;
        }
        self.push_cone(kind, bound, &f, tightening);
    }

    /// Activity: Gauss–Newton about the centre.
    fn activity(&mut self, scale: f64) {
        let (site, dependence) = (self.site, self.region.dependence);
        let l = &site.loops;
        let gains = self.region.x.len();
        let mut h = [[0.0; 3]; 3];
        let mut q = [0.0; 3];
        for k in 0..l.omega.len() {
            if site.weights[k] == 0.0 {
                continue;
            }
            let d = self.shift(&l.full[k]);
            let (b, m) = (self.shift(&l.opened[0][k]), self.shift(&l.noise[k]));
            let ratio = b[0] / d[0];
            let u = m[0] * ratio;
            let slope: [C; 3] = std::array::from_fn(|g| {
                (m[1 + g] * ratio + m[0] * (b[1 + g] * d[0] - b[0] * d[1 + g]) / (d[0] * d[0]))
                    * dependence.get(g).map_or(0.0, |d| d.slope)
            });
            let w = site.weights[k] / scale;
            for i in 0..gains {
                q[i] += 2.0 * w * (slope[i].conj() * u).re;
                for j in 0..=i {
                    h[i][j] += w * (slope[i].conj() * slope[j]).re;
                }
            }
        }
        for i in 0..gains {
            self.out.linear.push((dependence[i].variable, q[i]));
            for j in 0..=i {
                let v = if i == j { h[i][j] } else { 2.0 * h[i][j] };
                let place = (dependence[i].variable, dependence[j].variable);
                self.out.quadratic.push((place.0, place.1, v));
            }
        }
    }
}

fn scaled(f: &Affine, by: C) -> Affine {
    f.map(|v| v * by)
}

/// Slope of a quantity over the logarithm of frequency at a grid point.
fn log_slope(omega: &[f64], k: usize, value: impl Fn(usize) -> f64) -> f64 {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(omega.len() - 1));
    if a == b { 0.0 } else { (value(b) - value(a)) / (omega[b] / omega[a]).ln() }
}
