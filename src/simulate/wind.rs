//! The air that moves: steady wind, Dryden turbulence, discrete gusts.
//!
//! Velocities are those of the air over the ground, earth axes (north, east,
//! down), m/s.

use super::equipment::Noise;
use crate::units::FOOT;

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

    /// Moves `step` s on; velocities along, across and down, m/s.
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

/// Weather on its way through time.
#[derive(Debug, Clone)]
pub struct Air {
    weather: Weather,
    dryden: Option<Dryden>,
    /// Direction of the mean wind (where the air goes), rad from north; the
    /// first heading in calm air.
    direction: f64,
    /// Distance flown into each gust, m, and the heading when it was met.
    flown: Vec<Option<(f64, f64)>>,
    velocity: [f64; 3],
}

impl Air {
    /// Weather that begins at time zero with the aircraft on a heading, rad.
    #[must_use]
    pub fn new(weather: Weather, seed: u64, heading: f64) -> Self {
        let [north, east, _] = weather.wind;
        let direction = if north.hypot(east) > 0.0 { east.atan2(north) } else { heading };
        let dryden = weather.turbulence.map(|_| Dryden::new(seed));
        let flown = vec![None; weather.gusts.len()];
        let velocity = weather.wind;
        Self { weather, dryden, direction, flown, velocity }
    }

    /// Velocity of the air, north, east, down, m/s.
    #[must_use]
    pub fn velocity(&self) -> [f64; 3] {
        self.velocity
    }

    /// Moves `step` s on from `time` with the aircraft at an airspeed (m/s), a
    /// height (m) and a heading (rad).
    pub fn advance(&mut self, time: f64, step: f64, airspeed: f64, height: f64, heading: f64) {
        let mut total = self.weather.wind;
        let mut add = |[forward, right, down]: [f64; 3], direction: f64| {
            let (s, c) = direction.sin_cos();
            total[0] += forward * c - right * s;
            total[1] += forward * s + right * c;
            total[2] += down;
        };
        if let (Some(dryden), Some(turbulence)) = (&mut self.dryden, self.weather.turbulence) {
            let (scale, sigma) = low_altitude(height, turbulence.wind_at_20_ft);
            let speed = airspeed.max(LEAST_CONVECTION);
            add(dryden.advance(step, speed, scale, sigma), self.direction);
        }
        for (gust, flown) in self.weather.gusts.iter().zip(&mut self.flown) {
            if time + step < gust.time {
                continue;
            }
            let (distance, met) = flown.get_or_insert((0.0, heading));
            let within = (time + step - gust.time).min(step);
            *distance += airspeed.max(LEAST_CONVECTION) * within;
            let x = *distance / gust.length;
            let strength = match gust.shape {
                GustShape::Hold if x >= 1.0 => 1.0,
                GustShape::Pulse if x >= 2.0 => 0.0,
                _ => 0.5 * (1.0 - (std::f64::consts::PI * x).cos()),
            };
            add(gust.velocity.map(|v| v * strength), *met);
        }
        self.velocity = total;
    }
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
            let mut air = Air::new(weather, 0, 0.0);
            let (mut time, step) = (0.0, 0.01);
            while time < 1.0 + distance / 10.0 - 1e-9 {
                air.advance(time, step, 10.0, 100.0, 0.0);
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
        let mut air = Air::new(weather, 0, 0.0);
        let east = std::f64::consts::FRAC_PI_2;
        air.advance(0.0, 1.0, 10.0, 100.0, east);
        let [north, e, _] = air.velocity();
        assert_relative_eq!(north, -4.0, epsilon = 1e-12);
        assert_relative_eq!(e, 0.0, epsilon = 1e-12);
    }
}
