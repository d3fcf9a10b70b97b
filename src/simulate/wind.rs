//! The air that moves: steady wind, Dryden turbulence, discrete gusts.
//!
//! Velocities are those of the air over the ground, earth axes (north, east,
//! down), m/s; angular velocities those of the air about the aircraft, earth
//! axes, rad/s.

use super::equipment::Noise;
use crate::units::FOOT;
use std::f64::consts::{PI, TAU};

/// Sources of moving air.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weather {
    /// Steady wind: velocity of the air, north, east, down, m/s.
    pub wind: [f64; 3],
    /// Turbulence, if any.
    pub turbulence: Option<Turbulence>,
    /// Discrete gusts.
    pub gusts: Vec<Gust>,
}

/// Intensity of low-altitude turbulence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turbulence {
    /// Wind speed at 20 ft, m/s: MIL-F-8785C calls 15, 30 and 45 kt light,
    /// moderate and severe.
    pub wind_at_20_ft: f64,
    /// Whether the air also turns: the angular gusts p_g, q_g, r_g, which the
    /// standard has beside the velocities.
    pub rates: bool,
}

/// What a gust does after its rise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GustShape {
    /// It stays, as in MIL-F-8785C 3.7.2.3.
    Hold,
    /// It falls off as it rose: a full period of the cosine.
    Pulse,
}

/// A discrete gust V = ½ V_m (1 − cos(πx/d_m)), x being the distance flown
/// into it through the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gust {
    /// When it is met, s.
    pub time: f64,
    /// Length d_m of the rise, m.
    pub length: f64,
    /// Change V_m of the air's velocity in heading axes at that time:
    /// forward, to starboard, down, m/s.
    pub velocity: [f64; 3],
    /// What follows the rise.
    pub shape: GustShape,
}

/// Slowest speed at which the aircraft is taken to pass through turbulence
/// and gusts, m/s: frozen turbulence would stand still about a hovering one.
pub const LEAST_CONVECTION: f64 = 3.0;

/// Scale lengths (u and v, w), m, and intensities (u and v, w), m/s, of
/// turbulence below 1000 ft: MIL-F-8785C 3.7.3.1 and Figs. 10 and 11.
///
/// L_w = h, L_u = L_v = h/(0.177 + 0.000823 h)^1.2, σ_w = 0.1 W20,
/// σ_u = σ_v = σ_w/(0.177 + 0.000823 h)^0.4 with h in ft between 10 and 1000.
#[must_use]
pub fn low_altitude(height: f64, wind_at_20_ft: f64) -> ([f64; 2], [f64; 2]) {
    let h = (height / FOOT).clamp(10.0, 1000.0);
    let base = 0.177 + 0.000_823 * h;
    let vertical = 0.1 * wind_at_20_ft;
    ([h / base.powf(1.2) * FOOT, h * FOOT], [vertical / base.powf(0.4), vertical])
}

/// Dryden turbulence as shaping filters driven by white noise:
/// along the wind σ√(2T)/(1 + Ts), across and vertical
/// σ√T (1 + √3 Ts)/(1 + Ts)², T = L/V, each moved by its exact discrete
/// solution.
#[derive(Debug, Clone)]
struct Dryden {
    noise: Noise,
    /// Unit-variance states: along; across, two; vertical, two.
    along: f64,
    across: [f64; 2],
    vertical: [f64; 2],
}

impl Dryden {
    fn new(seed: u64) -> Self {
        let mut noise = Noise::new(seed, 1);
        let along = noise.draw();
        let mut pair = || {
            // Stationary covariance [[1, ½], [½, ½]] of the two states.
            let (a, b) = (noise.draw(), noise.draw());
            [a, 0.5 * a + 0.5 * b]
        };
        let (across, vertical) = (pair(), pair());
        Self { noise, along, across, vertical }
    }

    /// Moves `step` s on; velocities along, to the right and down, m/s.
    fn advance(&mut self, step: f64, speed: f64, scale: [f64; 2], sigma: [f64; 2]) -> [f64; 3] {
        let keep = (-step * speed / scale[0]).exp();
        self.along = keep * self.along + (1.0 - keep * keep).sqrt() * self.noise.draw();
        let mut second = |state: &mut [f64; 2], length: f64| {
            let x = step * speed / length;
            let e = (-x).exp();
            // Φ = e [[1, 0], [x, 1]], Q = P − Φ P Φᵀ with P as above.
            let e2 = e * e;
            let q11 = 1.0 - e2;
            let q12 = 0.5 - e2 * (x + 0.5);
            let q22 = 0.5 - e2 * (x * x + x + 0.5);
            let l11 = q11.max(0.0).sqrt();
            let l21 = if l11 > 0.0 { q12 / l11 } else { 0.0 };
            let l22 = (q22 - l21 * l21).max(0.0).sqrt();
            let (n1, n2) = (self.noise.draw(), self.noise.draw());
            let [a, b] = *state;
            *state = [e * a + l11 * n1, e * (x * a + b) + l21 * n1 + l22 * n2];
            // y = b + √3 T b' with T b' = a − b; its variance is 2.
            let root = 3f64.sqrt();
            (root * state[0] + (1.0 - root) * state[1]) / 2f64.sqrt()
        };
        let across = second(&mut self.across, scale[0]);
        let vertical = second(&mut self.vertical, scale[1]);
        [sigma[0] * self.along, sigma[0] * across, sigma[1] * vertical]
    }
}

/// Angular gusts: how the air turns about an aircraft of a size that flies
/// through frozen turbulence along x (MIL-F-8785C 3.7.1.2, MIL-HDBK-1797).
///
/// p_g is a process of its own, of the spectrum
/// Φ_p = σ_w²/L_w · 0.8 (πL_w/4b)^⅓ / (1 + (4bΩ/π)²) over Ω = ω/V. The others
/// are slopes of the velocities along the path, ∂/∂x = (1/V) d/dt, smoothed over
/// the span: q_g = −(s/V)/(1 + 4bs/πV) w_g and r_g = (s/V)/(1 + 3bs/πV) v_g.
/// These signs are those of air that turns, v = ω × r, in axes to starboard
/// and down: p_g = ∂w/∂y, q_g = −∂w/∂x, r_g = ∂v/∂x.
#[derive(Debug, Clone)]
struct AngularGusts {
    noise: Noise,
    /// Span b, m.
    span: f64,
    /// Unit-variance state of p_g.
    roll: f64,
    /// w_g and v_g at the last step, m/s, and smoothed.
    down: [f64; 2],
    right: [f64; 2],
}

impl AngularGusts {
    fn new(seed: u64, span: f64) -> Self {
        let mut noise = Noise::new(seed, 2);
        let roll = noise.draw();
        Self { noise, span, roll, down: [0.0; 2], right: [0.0; 2] }
    }

    /// Variance of p_g, (rad/s)²: the integral of Φ_p over Ω.
    fn roll_variance(&self, scale: f64, sigma: f64) -> f64 {
        let b = self.span;
        0.1 * PI * PI * sigma * sigma / (b * scale) * (PI * scale / (4.0 * b)).cbrt()
    }

    /// Moves `step` s on, to new velocities to the right and down, m/s; p_g,
    /// q_g, r_g, rad/s. Velocities are taken as straight within a step.
    fn advance(
        &mut self,
        step: f64,
        speed: f64,
        [right, down]: [f64; 2],
        scale_w: f64,
        sigma_w: f64,
    ) -> [f64; 3] {
        // Lengths over which p and q, and r, are smoothed, over V T.
        let (long, short) = (4.0 * self.span / PI, 3.0 * self.span / PI);
        let keep = (-step * speed / long).exp();
        self.roll = keep * self.roll + (1.0 - keep * keep).sqrt() * self.noise.draw();
        let slope = |[last, smooth]: &mut [f64; 2], value: f64, length: f64| {
            let x = step * speed / length;
            let keep = (-x).exp();
            let mean = (1.0 - keep) / x;
            *smooth = keep * *smooth + (mean - keep) * *last + (1.0 - mean) * value;
            *last = value;
            // s/(1 + Ts) w = (w − smoothed w)/T, and V T is the length.
            (value - *smooth) / length
        };
        [
            self.roll_variance(scale_w, sigma_w).sqrt() * self.roll,
            -slope(&mut self.down, down, long),
            slope(&mut self.right, right, short),
        ]
    }
}

/// How the aircraft moves through the weather.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// Velocity over the ground: north, east, down, m/s.
    pub velocity: [f64; 3],
    /// Height above the ground, m.
    pub height: f64,
    /// Heading, rad.
    pub heading: f64,
}

/// Weather on its way through time.
#[derive(Debug, Clone)]
pub struct Air {
    weather: Weather,
    dryden: Option<Dryden>,
    angular: Option<AngularGusts>,
    /// Direction of the horizontal motion through the mean wind, rad from
    /// north: the longitudinal axis of turbulence. It follows the motion
    /// within about a scale length of flight, so that it does not jump; the
    /// first heading at rest.
    course: f64,
    /// Distance flown into each gust, m, and the heading when it was met.
    flown: Vec<Option<(f64, f64)>>,
    velocity: [f64; 3],
    rate: [f64; 3],
}

impl Air {
    /// Weather that begins at time zero with an aircraft of a span (m) on a
    /// heading (rad). The span is that of angular gusts: for a rotorcraft the
    /// diameter of its largest rotor.
    #[must_use]
    pub fn new(weather: Weather, span: f64, seed: u64, heading: f64) -> Self {
        let dryden = weather.turbulence.map(|_| Dryden::new(seed));
        let angular = weather
            .turbulence
            .filter(|turbulence| turbulence.rates)
            .map(|_| AngularGusts::new(seed, span));
        let flown = vec![None; weather.gusts.len()];
        let velocity = weather.wind;
        Self { weather, dryden, angular, course: heading, flown, velocity, rate: [0.0; 3] }
    }

    /// Velocity of the air, north, east, down, m/s.
    #[must_use]
    pub fn velocity(&self) -> [f64; 3] {
        self.velocity
    }

    /// Angular velocity of the air about north, east and down, rad/s.
    #[must_use]
    pub fn rate(&self) -> [f64; 3] {
        self.rate
    }

    /// Moves `step` s on from `time`.
    pub fn advance(&mut self, time: f64, step: f64, passage: &Passage) {
        let through: [f64; 3] = std::array::from_fn(|k| passage.velocity[k] - self.velocity[k]);
        let airspeed = through.iter().map(|v| v * v).sum::<f64>().sqrt();
        let speed = airspeed.max(LEAST_CONVECTION);
        let mut total = self.weather.wind;
        if let (Some(dryden), Some(turbulence)) = (&mut self.dryden, self.weather.turbulence) {
            let (scale, sigma) = low_altitude(passage.height, turbulence.wind_at_20_ft);
            let [north, east] = [0, 1].map(|k| passage.velocity[k] - self.weather.wind[k]);
            let motion = north.hypot(east);
            if motion > 0.0 {
                let off = wrapped(east.atan2(north) - self.course);
                self.course += off * (1.0 - (-motion * step / scale[0]).exp());
            }
            let [along, right, down] = dryden.advance(step, speed, scale, sigma);
            turn(&mut total, [along, right, down], self.course);
            self.rate = [0.0; 3];
            if let Some(angular) = &mut self.angular {
                let gusts = angular.advance(step, speed, [right, down], scale[1], sigma[1]);
                turn(&mut self.rate, gusts, self.course);
            }
        }
        for (gust, flown) in self.weather.gusts.iter().zip(&mut self.flown) {
            if time + step < gust.time {
                continue;
            }
            let (distance, met) = flown.get_or_insert((0.0, passage.heading));
            let within = (time + step - gust.time).min(step);
            *distance += speed * within;
            let x = *distance / gust.length;
            let strength = match gust.shape {
                GustShape::Hold if x >= 1.0 => 1.0,
                GustShape::Pulse if x >= 2.0 => 0.0,
                _ => 0.5 * (1.0 - (PI * x).cos()),
            };
            turn(&mut total, gust.velocity.map(|v| v * strength), *met);
        }
        self.velocity = total;
    }
}

/// Adds a vector given forward, to the right and down of a direction (rad from
/// north) to one in earth axes.
fn turn(sum: &mut [f64; 3], [forward, right, down]: [f64; 3], direction: f64) {
    let (s, c) = direction.sin_cos();
    sum[0] += forward * c - right * s;
    sum[1] += forward * s + right * c;
    sum[2] += down;
}

/// An angle in (−π, π].
fn wrapped(angle: f64) -> f64 {
    let turns = (angle / TAU).round();
    angle - turns * TAU
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::KNOT;
    use approx::assert_relative_eq;

    /// MIL-F-8785C: at 1000 ft the scale lengths are all 1000 ft and the
    /// intensities equal.
    #[test]
    fn val_low_altitude_meets_medium_altitude_at_1000_ft() {
        let (scale, sigma) = low_altitude(1000.0 * FOOT, 30.0 * KNOT);
        assert_relative_eq!(scale[0], 1000.0 * FOOT, max_relative = 1e-9);
        assert_relative_eq!(scale[1], 1000.0 * FOOT, max_relative = 1e-9);
        assert_relative_eq!(sigma[0], sigma[1], max_relative = 1e-9);
        assert_relative_eq!(sigma[1], 3.0 * KNOT, max_relative = 1e-12);
    }

    /// Variances of the three components are σ², and the correlation of the
    /// longitudinal one falls off as exp(−V t/L), whatever the step.
    #[test]
    fn dryden_has_its_variance_and_correlation() {
        let (scale, sigma) = ([60.0, 20.0], [2.0, 1.0]);
        let (speed, step, count) = (20.0, 0.05, 400_000);
        let mut dryden = Dryden::new(3);
        let (mut squares, mut lagged) = ([0.0; 3], 0.0);
        let lag = 20;
        let mut past = std::collections::VecDeque::new();
        for _ in 0..count {
            let v = dryden.advance(step, speed, scale, sigma);
            for (sum, v) in squares.iter_mut().zip(v) {
                *sum += v * v;
            }
            past.push_back(v[0]);
            if past.len() > lag {
                lagged += v[0] * past.pop_front().unwrap();
            }
        }
        let n = f64::from(count);
        // 400 000 samples hold some 6700 correlation times: about 2 % of
        // scatter in a variance.
        assert_relative_eq!(squares[0] / n, 4.0, max_relative = 0.06);
        assert_relative_eq!(squares[1] / n, 4.0, max_relative = 0.06);
        assert_relative_eq!(squares[2] / n, 1.0, max_relative = 0.06);
        let expected = (-speed * step * lag as f64 / scale[0]).exp();
        assert_relative_eq!(lagged / squares[0], expected, epsilon = 0.04);
    }

    /// Two half steps add as much variance as one whole: Q of the exact
    /// discretisation is consistent.
    #[test]
    fn dryden_variance_does_not_depend_on_the_step() {
        let variance = |step: f64, count: usize| {
            let mut d = Dryden::new(9);
            let mut sum = 0.0;
            for _ in 0..count {
                sum += d.advance(step, 20.0, [60.0, 20.0], [1.0, 1.0])[2].powi(2);
            }
            sum / count as f64
        };
        assert_relative_eq!(variance(0.5, 60_000), 1.0, max_relative = 0.05);
        assert_relative_eq!(variance(5.0, 30_000), 1.0, max_relative = 0.05);
    }

    /// A gust is half way up at half its length, and stays or goes.
    #[test]
    fn gusts_follow_the_cosine() {
        let gust = |shape| Gust { time: 1.0, length: 20.0, velocity: [0.0, 4.0, 0.0], shape };
        let fly = |shape, distance: f64| {
            let weather = Weather { gusts: vec![gust(shape)], ..Weather::default() };
            let mut air = Air::new(weather, 6.5, 0, 0.0);
            let (mut time, step) = (0.0, 0.01);
            while time < 1.0 + distance / 10.0 - 1e-9 {
                // At 10 m/s through the air, whatever that does.
                let [north, east, down] = air.velocity();
                let velocity = [north + 10.0, east, down];
                air.advance(time, step, &Passage { velocity, height: 100.0, heading: 0.0 });
                time += step;
            }
            air.velocity()[1]
        };
        assert_relative_eq!(fly(GustShape::Hold, 10.0), 2.0, max_relative = 1e-6);
        assert_relative_eq!(fly(GustShape::Hold, 30.0), 4.0, max_relative = 1e-9);
        assert_relative_eq!(fly(GustShape::Pulse, 30.0), 2.0, max_relative = 1e-6);
        assert_eq!(fly(GustShape::Pulse, 50.0), 0.0);
    }

    /// A gust from starboard meets the aircraft from starboard on any heading.
    #[test]
    fn gusts_turn_with_the_heading() {
        let gust =
            Gust { time: 0.0, length: 1.0, velocity: [0.0, 4.0, 0.0], shape: GustShape::Hold };
        let weather = Weather { gusts: vec![gust], ..Weather::default() };
        let mut air = Air::new(weather, 6.5, 0, 0.0);
        let east = std::f64::consts::FRAC_PI_2;
        let velocity = [0.0, 10.0, 0.0];
        air.advance(0.0, 1.0, &Passage { velocity, height: 100.0, heading: east });
        let [north, e, _] = air.velocity();
        assert_relative_eq!(north, -4.0, epsilon = 1e-12);
        assert_relative_eq!(e, 0.0, epsilon = 1e-12);
    }

    /// Span and flight of the tests of angular gusts: b m, V m/s, L m, σ m/s.
    const SPAN: f64 = 6.5;
    const SPEED: f64 = 25.0;
    const SCALE: [f64; 2] = [90.0, 40.0];
    const SIGMA: [f64; 2] = [2.0, 1.5];

    /// A long flight through turbulence: v, w, p, q, r at every step.
    fn flown(seed: u64, step: f64, count: usize) -> [Vec<f64>; 5] {
        let (mut dryden, mut angular) = (Dryden::new(seed), AngularGusts::new(seed, SPAN));
        let mut series: [Vec<f64>; 5] = Default::default();
        for _ in 0..count {
            let [_, v, w] = dryden.advance(step, SPEED, SCALE, SIGMA);
            let [p, q, r] = angular.advance(step, SPEED, [v, w], SCALE[1], SIGMA[1]);
            for (list, value) in series.iter_mut().zip([v, w, p, q, r]) {
                list.push(value);
            }
        }
        series
    }

    /// One-sided spectral density over Ω = ω/V (rad/m), averaged over segments
    /// and bands, at Ω spaced by factors of two, with the standard error.
    fn spectra(series: &[f64], step: f64) -> Vec<(f64, f64, f64)> {
        let n = 1 << 13;
        let fft = rustfft::FftPlanner::new().plan_fft_forward(n);
        let window: Vec<f64> =
            (0..n).map(|k| (PI * (k as f64 + 0.5) / n as f64).sin().powi(2)).collect();
        let norm: f64 = window.iter().map(|w| w * w).sum();
        let mut power = vec![0.0; n / 2];
        let segments = series.len() / n;
        for segment in series.chunks_exact(n) {
            let mut x: Vec<num_complex::Complex64> = segment
                .iter()
                .zip(&window)
                .map(|(x, w)| num_complex::Complex64::new(x * w, 0.0))
                .collect();
            fft.process(&mut x);
            for (sum, x) in power.iter_mut().zip(&x) {
                *sum += x.norm_sqr() * step * SPEED / (PI * norm * segments as f64);
            }
        }
        let line = TAU / (n as f64 * step * SPEED);
        let mut found = Vec::new();
        let mut first = 3;
        while 2 * first < n / 8 {
            let band = first..(5 * first).div_ceil(4);
            let count = band.len();
            let middle = (first as f64 + 0.5 * (count - 1) as f64) * line;
            let mean = power[band].iter().sum::<f64>() / count as f64;
            // A squared sine window correlates neighbours: some half of the
            // lines are independent.
            let error = (2.0 / (segments * count) as f64).sqrt();
            found.push((middle, mean, error));
            first *= 2;
        }
        found
    }

    /// MIL-F-8785C 3.7.1.2: the spectra of v_g, w_g, p_g, q_g and r_g as
    /// generated, against the closed forms, from eddies of 300 m to 2 m.
    #[test]
    fn val_spectra_of_turbulence() {
        let step = 0.01;
        let [v, w, p, q, r] = flown(5, step, 1 << 21);
        let of = |x: f64, l: f64, sigma: f64| {
            let lx2 = l * l * x * x;
            sigma * sigma * l / PI * (1.0 + 3.0 * lx2) / (1.0 + lx2).powi(2)
        };
        let phi_v = |x: f64| of(x, SCALE[0], SIGMA[0]);
        let phi_w = |x: f64| of(x, SCALE[1], SIGMA[1]);
        let lag = |x: f64, spans: f64| x * x / (1.0 + (spans * SPAN * x / PI).powi(2));
        let phi_p = |x: f64| {
            SIGMA[1] * SIGMA[1] / SCALE[1] * 0.8 * (PI * SCALE[1] / (4.0 * SPAN)).cbrt()
                / (1.0 + (4.0 * SPAN * x / PI).powi(2))
        };
        type Closed<'a> = &'a dyn Fn(f64) -> f64;
        let closed: [(&str, &[f64], Closed); 5] = [
            ("v", &v, &phi_v),
            ("w", &w, &phi_w),
            ("p", &p, &phi_p),
            ("q", &q, &|x| lag(x, 4.0) * phi_w(x)),
            ("r", &r, &|x| lag(x, 3.0) * phi_v(x)),
        ];
        for (name, series, exact) in closed {
            let found = spectra(series, step);
            assert!(found.len() >= 7, "{}", found.len());
            for (x, density, error) in found {
                let ratio = density / exact(x);
                // Four standard errors, and 2 % for curvature within a band.
                let close = 4.0 * error + 0.02;
                assert!((ratio - 1.0).abs() < close, "{name} at {x} rad/m: {ratio} ± {error}");
            }
        }
        // Variance of p_g: the integral of its spectrum.
        let n = p.len() as f64;
        let variance = p.iter().map(|x| x * x).sum::<f64>() / n;
        let steps = 200_000;
        let width = 400.0 / f64::from(steps);
        let integral: f64 = (0..steps).map(|k| phi_p((f64::from(k) + 0.5) * width) * width).sum();
        assert_relative_eq!(variance, integral, max_relative = 0.03);
    }

    /// The slopes are those of the field of air that is flown through: w grows
    /// along the path where the air turns nose down, −q, and v where it turns
    /// to starboard, +r. Smoothed over no span they are the differences.
    #[test]
    fn slopes_have_the_signs_of_air_that_turns() {
        let mut angular = AngularGusts::new(0, 0.01);
        let (step, speed) = (0.01, 20.0);
        let mut gusts = [0.0; 3];
        for k in 1..200 {
            // v and w grow by 0.3 and 0.2 m/s a metre.
            let x = speed * step * f64::from(k);
            gusts = angular.advance(step, speed, [0.3 * x, 0.2 * x], 40.0, 1.0);
        }
        assert_relative_eq!(gusts[1], -0.2, max_relative = 1e-9);
        assert_relative_eq!(gusts[2], 0.3, max_relative = 1e-9);
    }

    /// Angular gusts have their own numbers: the velocities are the same with
    /// them and without. The same seed gives the same bits.
    #[test]
    fn rates_leave_the_velocities_alone() {
        let fly = |rates, seed| {
            let turbulence = Some(Turbulence { wind_at_20_ft: 8.0, rates });
            let weather = Weather { turbulence, ..Weather::default() };
            let mut air = Air::new(weather, SPAN, seed, 0.4);
            let passage = Passage { velocity: [9.0, 2.0, 0.0], height: 30.0, heading: 0.4 };
            let mut all = Vec::new();
            for k in 0..400 {
                air.advance(0.01 * f64::from(k), 0.01, &passage);
                all.push((air.velocity(), air.rate()));
            }
            all
        };
        let (with, without) = (fly(true, 3), fly(false, 3));
        assert!(with.iter().zip(&without).all(|(a, b)| a.0 == b.0));
        assert!(without.iter().all(|a| a.1 == [0.0; 3]));
        assert!(with.iter().any(|a| a.1.iter().all(|rate| rate.abs() > 1e-3)));
        assert_eq!(with, fly(true, 3));
        assert_ne!(with, fly(true, 4));
    }

    /// Hovering in wind from the north an aircraft that looks east flies north
    /// through the air, and the long axis of turbulence comes to lie there.
    #[test]
    fn turbulence_lies_along_the_motion_through_the_mean_wind() {
        let turbulence = Some(Turbulence { wind_at_20_ft: 8.0, rates: true });
        let weather = Weather { wind: [-8.0, 0.0, 0.0], turbulence, gusts: Vec::new() };
        let mut air = Air::new(weather, SPAN, 1, 0.5 * PI);
        let passage = Passage { velocity: [0.0; 3], height: 30.0, heading: 0.5 * PI };
        for k in 0..60_000 {
            air.advance(0.01 * f64::from(k), 0.01, &passage);
        }
        assert!(air.course.abs() < 1e-6, "{}", air.course);
    }
}
