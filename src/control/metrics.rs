//! Stability and disturbance-rejection metrics, each defined once.
//!
//! A metric reads a response sampled on a frequency grid. Where the exact
//! response can be evaluated between the samples, crossings are refined with
//! it; else they are interpolated, linearly over log ω.
//!
//! | metric | definition |
//! |---|---|
//! | crossover | last frequency at which \|L\| crosses 1 |
//! | phase margin | smallest angle between L and −1 over all crossings of \|L\| = 1 |
//! | gain margin up (down) | smallest gain increase (decrease) that puts L on −1, over all crossings of the negative real axis |
//! | disk margin | α = min 2\|1 + L\|/\|1 − L\| (balanced disk, skew 0) |
//! | DRB | first frequency at which \|S\| rises through −3.01 dB (1/√2) |
//! | DRP | largest \|S\| |
//! | bandwidth, phase delay | ADS-33E: see [`bandwidth`] |
//! | actuator activity | rms of the stick command per unit white noise |

use num_complex::Complex64 as C;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// |S| at the disturbance rejection bandwidth, 1/√2: −3.01 dB.
pub const DRB_LEVEL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Lowest frequency at which disturbance rejection is judged, rad/s: below
/// it lie the integrators' slow tails and wind, not attitude hold.
pub const LOWEST_REJECTION_FREQUENCY: f64 = 0.08;

/// A response on a grid, and between its points if it can be evaluated.
#[derive(Clone, Copy)]
pub struct Sampled<'a> {
    /// Frequencies, rad/s, strictly increasing.
    pub omega: &'a [f64],
    /// Response at each.
    pub value: &'a [C],
    /// The exact response, for refinement.
    pub exact: Option<&'a dyn Fn(f64) -> C>,
}

/// Margins of a loop. `None` where there is no crossing: an infinite margin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Margins {
    /// Last 0 dB crossing, rad/s.
    pub crossover: Option<f64>,
    /// Phase margin, rad.
    pub phase: Option<f64>,
    /// Gain margin upward, factor > 1.
    pub gain_up: Option<f64>,
    /// Gain margin downward, factor > 1 by which the gain may be divided.
    pub gain_down: Option<f64>,
    /// Disk margin α.
    pub disk: f64,
}

/// Disturbance rejection of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rejection {
    /// Disturbance rejection bandwidth, rad/s; zero if the disturbance is not
    /// rejected at [`LOWEST_REJECTION_FREQUENCY`], `None` if it is rejected
    /// over the whole grid.
    pub bandwidth: Option<f64>,
    /// Disturbance rejection peak, factor.
    pub peak: f64,
    /// Frequency of the peak, rad/s.
    pub peak_frequency: f64,
}

/// Relative frequency tolerance of a refined crossing.
const CROSSING_TOLERANCE: f64 = 1e-10;
/// Iterations of a bracketed refinement; bisection alone needs 34.
const CROSSING_ITERATIONS: usize = 60;

impl<'a> Sampled<'a> {
    /// A response known on its grid only.
    pub fn new(omega: &'a [f64], value: &'a [C]) -> Self {
        Self { omega, value, exact: None }
    }

    /// Response interpolated within interval `k` at fraction `t` of log ω,
    /// in log magnitude and phase.
    fn interpolated(&self, k: usize, t: f64) -> C {
        let (a, b) = (self.value[k], self.value[k + 1]);
        if a.norm_sqr() == 0.0 || b.norm_sqr() == 0.0 {
            return a * (1.0 - t) + b * t;
        }
        a * (t * (b / a).ln()).exp()
    }

    fn frequency(&self, k: usize, t: f64) -> f64 {
        let (a, b) = (self.omega[k], self.omega[k + 1]);
        a * (t * (b / a).ln()).exp()
    }

    /// Response in interval `k` at fraction `t`.
    fn at(&self, k: usize, t: f64) -> C {
        match self.exact {
            Some(f) => f(self.frequency(k, t)),
            None => self.interpolated(k, t),
        }
    }

    /// Zero crossings of a real function of the response: frequency, response
    /// there, and whether the function rises.
    fn crossings(&self, f: impl Fn(C) -> f64) -> Vec<(f64, C, bool)> {
        let mut out = Vec::new();
        for k in 0..self.omega.len().saturating_sub(1) {
            let (fa, fb) = (f(self.value[k]), f(self.value[k + 1]));
            if !(fa * fb < 0.0 || (fa == 0.0 && fb != 0.0)) {
                continue;
            }
            // Regula falsi with the Illinois rule, in the fraction of log ω.
            let (mut a, mut b, mut ga, mut gb) = (0.0, 1.0, fa, fb);
            let width = (self.omega[k + 1] / self.omega[k]).ln();
            let mut t = if fa == 0.0 { 0.0 } else { fa / (fa - fb) };
            let mut last = 0;
            for _ in 0..CROSSING_ITERATIONS {
                if ga == 0.0 || (b - a) * width < CROSSING_TOLERANCE {
                    break;
                }
                t = (a * gb - b * ga) / (gb - ga);
                let g = f(self.at(k, t));
                if g == 0.0 || !g.is_finite() {
                    break;
                }
                let old = if g * ga > 0.0 { a } else { b };
                if g * ga > 0.0 {
                    (a, ga) = (t, g);
                    if last == 1 {
                        gb *= 0.5;
                    }
                    last = 1;
                } else {
                    (b, gb) = (t, g);
                    if last == -1 {
                        ga *= 0.5;
                    }
                    last = -1;
                }
                if (t - old).abs() * width < CROSSING_TOLERANCE {
                    break;
                }
            }
            out.push((self.frequency(k, t), self.at(k, t), fb > fa));
        }
        out
    }

    /// Least value of a real function of the response over the grid, refined
    /// by golden-section search around the smallest sample.
    fn least(&self, f: impl Fn(C) -> f64) -> (f64, f64) {
        let mut best = (f64::INFINITY, 0);
        for (k, &v) in self.value.iter().enumerate() {
            let g = f(v);
            if g < best.0 {
                best = (g, k);
            }
        }
        let k = best.1;
        let mut out = (best.0, self.omega.get(k).copied().unwrap_or(f64::NAN));
        let Some(exact) = self.exact else {
            return out;
        };
        if k == 0 || k + 1 >= self.omega.len() {
            return out;
        }
        let ratio = (5f64.sqrt() - 1.0) / 2.0;
        let (mut a, mut b) = (self.omega[k - 1].ln(), self.omega[k + 1].ln());
        let (mut c, mut d) = (b - ratio * (b - a), a + ratio * (b - a));
        let (mut fc, mut fd) = (f(exact(c.exp())), f(exact(d.exp())));
        // A minimum is flat: sqrt of the working precision is all there is to find.
        while b - a > 1e-7 {
            if fc < fd {
                (b, d, fd) = (d, c, fc);
                c = b - ratio * (b - a);
                fc = f(exact(c.exp()));
            } else {
                (a, c, fc) = (c, d, fd);
                d = a + ratio * (b - a);
                fd = f(exact(d.exp()));
            }
        }
        let (w, v) = if fc < fd { (c.exp(), fc) } else { (d.exp(), fd) };
        if v < out.0 {
            out = (v, w);
        }
        out
    }
}

/// Margins of a loop L.
pub fn margins(l: Sampled) -> Margins {
    let unit = l.crossings(|v| v.norm().ln());
    let phase = unit.iter().map(|(_, v, _)| (-v).arg().abs()).reduce(f64::min);
    let (mut gain_up, mut gain_down): (Option<f64>, Option<f64>) = (None, None);
    // The angle from the negative real axis crosses zero there; it also jumps
    // by 2π on the positive axis, where the product test below sees a sign
    // change too: the real part tells them apart.
    for (_, v, _) in l.crossings(|v| v.im) {
        if v.re >= 0.0 {
            continue;
        }
        let gain = -1.0 / v.re;
        let (side, factor) =
            if gain >= 1.0 { (&mut gain_up, gain) } else { (&mut gain_down, 1.0 / gain) };
        *side = Some(side.map_or(factor, |old| old.min(factor)));
    }
    let (disk, _) = l.least(|v| 2.0 * (1.0 + v).norm() / (1.0 - v).norm().max(f64::MIN_POSITIVE));
    Margins { crossover: unit.last().map(|c| c.0), phase, gain_up, gain_down, disk }
}

/// Disturbance rejection bandwidth and peak of a sensitivity S.
pub fn rejection(s: Sampled) -> Rejection {
    let (peak, peak_frequency) = s.least(|v| -v.norm());
    let start =
        s.omega.iter().position(|&w| w >= LOWEST_REJECTION_FREQUENCY * (1.0 - 1e-9)).unwrap_or(0);
    let bandwidth = if s.value.get(start).is_none_or(|v| v.norm() > DRB_LEVEL) {
        Some(0.0)
    } else {
        s.crossings(|v| (v.norm() / DRB_LEVEL).ln())
            .into_iter()
            .find(|c| c.2 && c.0 >= s.omega[start])
            .map(|c| c.0)
    };
    Rejection { bandwidth, peak: -peak, peak_frequency }
}

/// Mean-square integral ∫|u|² dω / π over a band, square-rooted: the rms of a
/// signal whose response to unit white noise is `u`. Trapezoid rule.
pub fn activity(u: Sampled, band: [f64; 2]) -> f64 {
    activity_weights(u.omega, band)
        .iter()
        .zip(u.value)
        .map(|(w, v)| w * v.norm_sqr())
        .sum::<f64>()
        .sqrt()
}

/// Weights of the trapezoid rule of [`activity`], 1/π included; the band is
/// cut at the nearest grid points within.
pub fn activity_weights(omega: &[f64], band: [f64; 2]) -> Vec<f64> {
    let mut weights = vec![0.0; omega.len()];
    for k in 0..omega.len().saturating_sub(1) {
        if omega[k] >= band[0] * (1.0 - 1e-12) && omega[k + 1] <= band[1] * (1.0 + 1e-12) {
            let half = 0.5 * (omega[k + 1] - omega[k]) / PI;
            weights[k] += half;
            weights[k + 1] += half;
        }
    }
    weights
}

/// Band in which actuator activity is counted, rad/s.
pub const ACTIVITY_BAND: [f64; 2] = [0.3, 40.0];

/// ADS-33E bandwidth and phase delay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bandwidth {
    /// Frequency of 45° phase margin, rad/s.
    pub phase_limited: Option<f64>,
    /// Frequency of 6 dB gain margin below ω₁₈₀, rad/s.
    pub gain_limited: Option<f64>,
    /// Phase delay τ_p, s.
    pub phase_delay: Option<f64>,
}

/// ADS-33E-PRF bandwidth of an attitude response to stick or command.
///
/// ω₁₈₀ is where the phase first falls through −180°. The phase-limited
/// bandwidth is where it falls through −135°, the gain-limited one where the
/// gain is last 6 dB above that at ω₁₈₀ below it. An attitude command system
/// uses the phase-limited one, a rate system the lesser of both. Phase delay:
/// τ_p = −(∠G(2ω₁₈₀) + 180°)/(57.3·2ω₁₈₀), magnitudes in degrees.
pub fn bandwidth(g: Sampled) -> Bandwidth {
    let n = g.omega.len();
    let mut out = Bandwidth { phase_limited: None, gain_limited: None, phase_delay: None };
    if n < 2 {
        return out;
    }
    // Unwrapped phase at the samples.
    let mut phase = vec![g.value[0].arg(); n];
    for k in 1..n {
        phase[k] = phase[k - 1] + (g.value[k] / g.value[k - 1]).arg();
    }
    let falls_through = |level: f64| -> Option<(f64, C)> {
        let k = (0..n - 1).find(|&k| phase[k] > level && phase[k + 1] <= level)?;
        let (mut a, mut b) = (0.0, 1.0);
        let mut v = g.value[k];
        while (b - a) > CROSSING_TOLERANCE {
            let t = 0.5 * (a + b);
            v = g.at(k, t);
            if phase[k] + (v / g.value[k]).arg() > level {
                a = t;
            } else {
                b = t;
            }
        }
        Some((g.frequency(k, 0.5 * (a + b)), v))
    };
    out.phase_limited = falls_through(-0.75 * PI).map(|c| c.0);
    let Some((w180, v180)) = falls_through(-PI) else {
        return out;
    };
    let level = v180.norm() * 10f64.powf(6.0 / 20.0);
    out.gain_limited = g
        .crossings(|v| (v.norm() / level).ln())
        .into_iter()
        .filter(|c| c.0 < w180)
        .map(|c| c.0)
        .next_back();
    if let Some(k) = (0..n - 1).find(|&k| g.omega[k] <= 2.0 * w180 && g.omega[k + 1] >= 2.0 * w180)
    {
        let t = (2.0 * w180 / g.omega[k]).ln() / (g.omega[k + 1] / g.omega[k]).ln();
        let angle = phase[k] + (g.at(k, t) / g.value[k]).arg();
        out.phase_delay = Some(-(angle + PI) / (2.0 * w180));
    }
    out
}

/// 20 log₁₀.
pub fn decibels(factor: f64) -> f64 {
    20.0 * factor.log10()
}

/// Factor of a number of decibels.
pub fn from_decibels(db: f64) -> f64 {
    10f64.powf(db / 20.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn grid() -> Vec<f64> {
        (0..1200).map(|k| 0.01 * 10f64.powf(k as f64 / 300.0)).collect()
    }

    fn on_grid<T>(f: impl Fn(f64) -> C, test: impl Fn(Sampled) -> T) -> T {
        let omega = grid();
        let value: Vec<C> = omega.iter().map(|&w| f(w)).collect();
        test(Sampled { omega: &omega, value: &value, exact: Some(&f) })
    }

    /// k e^(-sT)/s: crossover k, phase margin π/2 − kT, gain margin π/(2kT).
    #[test]
    fn val_integrator_with_delay_closed_form() {
        let (k, t) = (2.0, 0.2);
        let m = on_grid(|w| k * C::from_polar(1.0, -w * t) / C::new(0.0, w), margins);
        assert_relative_eq!(m.crossover.unwrap(), k, max_relative = 1e-9);
        assert_relative_eq!(m.phase.unwrap(), PI / 2.0 - k * t, max_relative = 1e-9);
        assert_relative_eq!(m.gain_up.unwrap(), PI / (2.0 * k * t), max_relative = 1e-9);
        assert_eq!(m.gain_down, None);
    }

    /// L = k(s + b)/(s(s − a)): s² + (k − a)s + kb is undamped at k = a, so
    /// the gain may fall by k/a and rise without limit.
    #[test]
    fn val_unstable_plant_has_a_downward_margin() {
        let (k, a, b) = (3.0, 1.0, 0.4);
        let m = on_grid(
            |w| {
                let s = C::new(0.0, w);
                k * (s + b) / (s * (s - a))
            },
            margins,
        );
        assert_relative_eq!(m.gain_down.unwrap(), k / a, max_relative = 1e-9);
        assert_eq!(m.gain_up, None);
    }

    /// S = s/(s + k): |S| = 1/√2 at ω = k, peak at the top of the grid below one.
    #[test]
    fn val_first_order_rejection_closed_form() {
        let k = 0.7;
        let r = on_grid(|w| C::new(0.0, w) / C::new(k, w), rejection);
        assert_relative_eq!(r.bandwidth.unwrap(), k, max_relative = 1e-9);
        assert!(r.peak < 1.0);
        // Second order: S = s²+2ζω s over (…): peak from a refined search.
        let (wn, z) = (1.5, 0.5);
        let s2 = |w: f64| {
            let s = C::new(0.0, w);
            (s * s + 2.0 * z * wn * s) / (s * s + 2.0 * z * wn * s + wn * wn)
        };
        let r = on_grid(s2, rejection);
        let fine = (1..2_000_000).map(|k| s2(k as f64 * 5e-6 * 2.0).norm()).fold(0.0, f64::max);
        assert_relative_eq!(r.peak, fine, max_relative = 1e-9);
    }

    /// L = −1 + ε on a constant: α = 2|1+L|/|1−L|.
    #[test]
    fn val_disk_margin_of_a_constant() {
        let m = on_grid(|_| C::new(-0.5, 0.0), margins);
        assert_relative_eq!(m.disk, 2.0 * 0.5 / 1.5, max_relative = 1e-12);
    }

    /// wn² e^(-sT)/(s² + 2ζ wn s + wn²): phase closed form.
    #[test]
    fn val_bandwidth_of_second_order_with_delay() {
        let (wn, z, t) = (2.0, 0.7, 0.1);
        let f = |w: f64| {
            let s = C::new(0.0, w);
            wn * wn * C::from_polar(1.0, -w * t) / (s * s + 2.0 * z * wn * s + wn * wn)
        };
        let phase = |w: f64| -(2.0 * z * wn * w).atan2(wn * wn - w * w) - w * t;
        let b = on_grid(f, bandwidth);
        assert_relative_eq!(phase(b.phase_limited.unwrap()), -0.75 * PI, max_relative = 1e-8);
        // Bisect ω₁₈₀ by the closed form.
        let (mut lo, mut hi) = (wn, 20.0);
        while hi - lo > 1e-12 {
            let m = 0.5 * (lo + hi);
            if phase(m) > -PI { lo = m } else { hi = m }
        }
        let expected = -(phase(2.0 * lo) + PI) / (2.0 * lo);
        assert_relative_eq!(b.phase_delay.unwrap(), expected, max_relative = 1e-6);
        let gain = f(b.gain_limited.unwrap()).norm() / f(lo).norm();
        assert_relative_eq!(decibels(gain), 6.0, max_relative = 1e-8);
    }

    /// First-order lag a/(s+a): rms per unit noise over a band is closed form.
    #[test]
    fn val_activity_of_a_first_order_lag() {
        let a = 3.0;
        let u = on_grid(
            |w| a / C::new(a, w),
            |s| {
                let b = [s.omega[0], *s.omega.last().unwrap()];
                activity(s, b).powi(2) - a * ((b[1] / a).atan() - (b[0] / a).atan()) / PI
            },
        );
        assert!(u.abs() < 1e-4, "{u}");
    }
}
