//! Many flights of one manoeuvre with the aircraft and the air varied.
//!
//! Variations are drawn by a Latin hypercube: each parameter's range is cut
//! into as many equal parts as there are runs, and every part is used once.
//! Run k of n with a seed is the same whichever other runs are flown, by
//! whichever machine.

use super::maneuver::Maneuver;
use super::metrics::Metrics;
use super::wind::{Gust, GustShape, Turbulence};
use crate::lti::stitch::{StitchError, Stitched};
use crate::problem::{Governor, Problem};
use crate::units::{FOOT, KNOT};
use crate::vehicle::{Vehicle, VehicleError};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

/// How the flown model differs from the problem's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variation {
    /// Rotor-on-rotor interactions, if not the problem's.
    pub interactions: Option<bool>,
    /// Factor on the mass.
    pub mass: f64,
    /// Factor on the moments and products of inertia.
    pub inertia: f64,
    /// Shift of the centre of gravity aft, m.
    pub center_of_gravity: f64,
    /// Delay on top, s.
    pub delay: f64,
    /// Wind at 20 ft that sets the turbulence, m/s, if not the manoeuvre's.
    pub turbulence: Option<f64>,
    /// Factor on the inflow that rotors induce in one another.
    pub inflow: f64,
    /// A discrete gust on top of the manoeuvre's own, velocity of the air
    /// forward, to starboard and up, m/s; none where all are zero.
    pub gust: [f64; 3],
    /// Time constant of a governor given to every rotor, s; none keeps the
    /// problem's.
    pub governor: Option<f64>,
}

/// When the gust of a variation is met, as a share of the manoeuvre.
pub const GUST_TIME: f64 = 0.5;
/// Length of its rise, m: 100 ft.
pub const GUST_LENGTH: f64 = 30.48;

impl Default for Variation {
    fn default() -> Self {
        Self {
            interactions: None,
            mass: 1.0,
            inertia: 1.0,
            center_of_gravity: 0.0,
            delay: 0.0,
            turbulence: None,
            inflow: 1.0,
            gust: [0.0; 3],
            governor: None,
        }
    }
}

impl Variation {
    /// Another variation on top of this one: factors multiply, shifts, delays
    /// and gusts add, what is drawn of the air takes the place of this one's.
    #[must_use]
    pub fn with(&self, drawn: &Self) -> Self {
        Self {
            interactions: drawn.interactions.or(self.interactions),
            mass: self.mass * drawn.mass,
            inertia: self.inertia * drawn.inertia,
            center_of_gravity: self.center_of_gravity + drawn.center_of_gravity,
            delay: self.delay + drawn.delay,
            turbulence: drawn.turbulence.or(self.turbulence),
            inflow: self.inflow * drawn.inflow,
            gust: std::array::from_fn(|k| self.gust[k] + drawn.gust[k]),
            governor: drawn.governor.or(self.governor),
        }
    }

    /// The problem, varied.
    #[must_use]
    pub fn apply(&self, problem: &Problem) -> Problem {
        let mut problem = problem.clone();
        let m = &mut problem.mass;
        m.mass *= self.mass;
        for value in [&mut m.i_xx, &mut m.i_yy, &mut m.i_zz, &mut m.i_xz, &mut m.i_xy, &mut m.i_yz]
        {
            *value *= self.inertia;
        }
        m.center_of_gravity.fuselage_station += self.center_of_gravity;
        if let Some(on) = self.interactions {
            problem.inflow.interactions = on;
        }
        if let Some(time_constant) = self.governor {
            for rotor in &mut problem.rotors {
                rotor.governor = Some(Governor { time_constant });
            }
        }
        problem
    }

    /// The vehicle of the problem, varied.
    ///
    /// # Errors
    /// A problem of which no vehicle can be built.
    pub fn vehicle(&self, problem: &Problem) -> Result<Vehicle, VehicleError> {
        let mut vehicle = Vehicle::new(&self.apply(problem))?;
        vehicle.interference_gain = self.inflow;
        Ok(vehicle)
    }

    /// A stitched model, varied.
    ///
    /// # Errors
    /// A change of what only a problem has: interactions, inflow, governors; a
    /// shift of the centre of gravity without mass properties.
    pub fn stitched(&self, model: &Stitched) -> Result<Stitched, StitchError> {
        let refused = [
            (self.interactions.is_some(), "interactions of rotors"),
            (self.inflow != 1.0, "inflow of rotors on one another"),
            (self.governor.is_some(), "governor"),
        ];
        if let Some((_, what)) = refused.into_iter().find(|(asked, _)| *asked) {
            return Err(StitchError::NotVaried { what });
        }
        if self.mass == 1.0 && self.inertia == 1.0 && self.center_of_gravity == 0.0 {
            return Ok(model.clone());
        }
        let varied = model.varied(self.mass, self.center_of_gravity)?;
        Ok(varied.with_inertia(self.inertia / self.mass))
    }

    /// The manoeuvre in the varied air.
    #[must_use]
    pub fn fly_in(&self, maneuver: &Maneuver) -> Maneuver {
        let mut maneuver = maneuver.clone();
        if let Some(wind_at_20_ft) = self.turbulence {
            let rates = maneuver.weather.turbulence.is_none_or(|known| known.rates);
            maneuver.weather.turbulence = Some(Turbulence { wind_at_20_ft, rates });
        }
        if self.gust != [0.0; 3] {
            let [forward, right, up] = self.gust;
            maneuver.weather.gusts.push(Gust {
                time: GUST_TIME * maneuver.duration,
                length: GUST_LENGTH,
                velocity: [forward, right, -up],
                shape: GustShape::Hold,
            });
        }
        maneuver
    }
}

/// Ranges that the parameters are drawn from, evenly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranges {
    /// Mass off nominal, either way, as a fraction.
    pub mass: f64,
    /// Inertia off nominal, either way, as a fraction.
    pub inertia: f64,
    /// Shift of the centre of gravity, either way, m.
    pub center_of_gravity: f64,
    /// Largest extra delay, s.
    pub delay: f64,
    /// Largest wind at 20 ft for turbulence, m/s; zero keeps the manoeuvre's
    /// own.
    pub turbulence: f64,
    /// Inflow that rotors induce in one another off nominal, either way, as a
    /// fraction.
    pub inflow: f64,
    /// Largest component of a discrete gust, either way, m/s.
    pub gust: f64,
}

impl Default for Ranges {
    /// 10 % of mass and inertia, one inch, 10 ms, light turbulence (15 kt), 20 %
    /// of inflow, gusts of up to 5 ft/s in each direction.
    fn default() -> Self {
        Self {
            mass: 0.1,
            inertia: 0.1,
            center_of_gravity: 0.0254,
            delay: 0.01,
            turbulence: 15.0 * KNOT,
            inflow: 0.2,
            gust: 5.0 * FOOT,
        }
    }
}

/// Number of parameters drawn.
const PARAMETERS: u64 = 9;

/// Which part of each parameter's range every run of a study has: a permutation
/// a parameter. It is the same for all runs, and takes as long to make as there
/// are runs.
#[derive(Debug, Clone)]
pub struct Parts {
    seed: u64,
    /// By parameter, then by run.
    parts: Vec<Vec<u32>>,
}

impl Parts {
    /// The parts of a study of `runs` flights.
    #[must_use]
    pub fn new(runs: usize, seed: u64) -> Self {
        let shuffled = |parameter: u64| {
            let mut generator = ChaCha8Rng::seed_from_u64(seed);
            generator.set_stream(2 + parameter);
            // Fisher and Yates's shuffle.
            let mut parts: Vec<u32> = (0..runs as u32).collect();
            for k in (1..runs).rev() {
                let other = (generator.next_u64() % (k as u64 + 1)) as usize;
                parts.swap(k, other);
            }
            parts
        };
        Self { seed, parts: (0..PARAMETERS).map(shuffled).collect() }
    }

    /// The variation of run `index`, and the seed of its noise and turbulence.
    ///
    /// # Panics
    /// Where the study has no such run.
    #[must_use]
    pub fn draw(&self, index: usize, ranges: &Ranges) -> (Variation, u64) {
        let seed = self.seed;
        let share = |parameter: u64| {
            let parts = &self.parts[parameter as usize];
            // Anywhere within the part, drawn by a stream of the run's own.
            let mut within = ChaCha8Rng::seed_from_u64(seed);
            within.set_stream((1 + index as u64) * (2 + PARAMETERS) + parameter + 2);
            let fraction = (within.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
            (f64::from(parts[index]) + fraction) / parts.len() as f64
        };
        let either = |parameter: u64, range: f64| (2.0 * share(parameter) - 1.0) * range;
        let variation = Variation {
            interactions: None,
            mass: 1.0 + either(0, ranges.mass),
            inertia: 1.0 + either(1, ranges.inertia),
            center_of_gravity: either(2, ranges.center_of_gravity),
            delay: share(3) * ranges.delay,
            turbulence: (ranges.turbulence > 0.0).then(|| share(4) * ranges.turbulence),
            inflow: 1.0 + either(5, ranges.inflow),
            gust: [6, 7, 8].map(|parameter| either(parameter, ranges.gust)),
            governor: None,
        };
        let mut own = ChaCha8Rng::seed_from_u64(seed);
        own.set_stream(u64::MAX - index as u64);
        // Within what a JSON number holds exactly.
        (variation, own.next_u64() >> 11)
    }
}

/// What a run amounts to. As JSON it is a flat row, SI and radians, with the
/// unit in the name of each number; [`COLUMNS`] lists them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Row", into = "Row")]
pub struct Run {
    /// Which, from 0.
    pub run: usize,
    /// Seed of its noise and turbulence.
    pub seed: u64,
    /// How its model differs.
    pub variation: Variation,
    /// `completed`, `limit`, `diverged` or `no_trim`.
    pub status: String,
    /// The state that left its bounds.
    pub state: Option<String>,
    /// When it ended, s.
    pub time_s: f64,
    /// Peak errors of forward, starboard and vertical velocity, m/s.
    pub velocity_peak_m_s: [f64; 3],
    /// RMS errors of the same, m/s.
    pub velocity_rms_m_s: [f64; 3],
    /// Largest bank and pitch either way, rad.
    pub attitude_peak_rad: [f64; 2],
    /// Time at actuator limits, s.
    pub saturated_s: f64,
    /// Whether it counts as a success.
    pub success: bool,
}

impl Run {
    /// A run whose aircraft did not trim.
    #[must_use]
    pub fn without_trim(run: usize, seed: u64, variation: Variation) -> Self {
        Self {
            run,
            seed,
            variation,
            status: "no_trim".into(),
            state: None,
            time_s: 0.0,
            velocity_peak_m_s: [0.0; 3],
            velocity_rms_m_s: [0.0; 3],
            attitude_peak_rad: [0.0; 2],
            saturated_s: 0.0,
            success: false,
        }
    }

    /// A run that was flown; whether it is a success is for [`Criterion::met`]
    /// to say.
    #[must_use]
    pub fn flown(run: usize, seed: u64, variation: Variation, metrics: &Metrics) -> Self {
        let size = |channel: &str| metrics.tracked(channel).map(|t| t.size).unwrap_or_default();
        let sizes = ["forward_velocity", "right_velocity", "climb_rate"].map(size);
        Self {
            status: metrics.end.status.into(),
            state: metrics.end.state.clone(),
            time_s: metrics.end.time_s,
            velocity_peak_m_s: sizes.map(|s| s.peak),
            velocity_rms_m_s: sizes.map(|s| s.rms),
            attitude_peak_rad: [metrics.roll_peak_rad, metrics.pitch_peak_rad],
            saturated_s: metrics.saturated_s,
            ..Self::without_trim(run, seed, variation)
        }
    }
}

/// Columns of a row and their units; `1` for none.
pub const COLUMNS: [(&str, &str); 26] = [
    ("run", "1"),
    ("seed", "1"),
    ("mass_factor", "1"),
    ("inertia_factor", "1"),
    ("center_of_gravity_shift_m", "m"),
    ("extra_delay_s", "s"),
    ("turbulence_m_s", "m/s"),
    ("interference_factor", "1"),
    ("gust_forward_m_s", "m/s"),
    ("gust_right_m_s", "m/s"),
    ("gust_up_m_s", "m/s"),
    ("governor_s", "s"),
    ("interactions", "1"),
    ("status", "1"),
    ("state", "1"),
    ("time_s", "s"),
    ("forward_velocity_peak_m_s", "m/s"),
    ("right_velocity_peak_m_s", "m/s"),
    ("climb_rate_peak_m_s", "m/s"),
    ("forward_velocity_rms_m_s", "m/s"),
    ("right_velocity_rms_m_s", "m/s"),
    ("climb_rate_rms_m_s", "m/s"),
    ("phi_peak_rad", "rad"),
    ("theta_peak_rad", "rad"),
    ("saturated_s", "s"),
    ("success", "1"),
];

/// A run as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    run: usize,
    seed: u64,
    mass_factor: f64,
    inertia_factor: f64,
    center_of_gravity_shift_m: f64,
    extra_delay_s: f64,
    turbulence_m_s: Option<f64>,
    interference_factor: f64,
    gust_forward_m_s: f64,
    gust_right_m_s: f64,
    gust_up_m_s: f64,
    governor_s: Option<f64>,
    interactions: Option<bool>,
    status: String,
    state: Option<String>,
    time_s: f64,
    forward_velocity_peak_m_s: f64,
    right_velocity_peak_m_s: f64,
    climb_rate_peak_m_s: f64,
    forward_velocity_rms_m_s: f64,
    right_velocity_rms_m_s: f64,
    climb_rate_rms_m_s: f64,
    phi_peak_rad: f64,
    theta_peak_rad: f64,
    saturated_s: f64,
    success: bool,
}

impl From<Run> for Row {
    fn from(run: Run) -> Self {
        let v = run.variation;
        let [gust_forward_m_s, gust_right_m_s, gust_up_m_s] = v.gust;
        let [forward_velocity_peak_m_s, right_velocity_peak_m_s, climb_rate_peak_m_s] =
            run.velocity_peak_m_s;
        let [forward_velocity_rms_m_s, right_velocity_rms_m_s, climb_rate_rms_m_s] =
            run.velocity_rms_m_s;
        let [phi_peak_rad, theta_peak_rad] = run.attitude_peak_rad;
        Self {
            run: run.run,
            seed: run.seed,
            mass_factor: v.mass,
            inertia_factor: v.inertia,
            center_of_gravity_shift_m: v.center_of_gravity,
            extra_delay_s: v.delay,
            turbulence_m_s: v.turbulence,
            interference_factor: v.inflow,
            gust_forward_m_s,
            gust_right_m_s,
            gust_up_m_s,
            governor_s: v.governor,
            interactions: v.interactions,
            status: run.status,
            state: run.state,
            time_s: run.time_s,
            forward_velocity_peak_m_s,
            right_velocity_peak_m_s,
            climb_rate_peak_m_s,
            forward_velocity_rms_m_s,
            right_velocity_rms_m_s,
            climb_rate_rms_m_s,
            phi_peak_rad,
            theta_peak_rad,
            saturated_s: run.saturated_s,
            success: run.success,
        }
    }
}

impl From<Row> for Run {
    fn from(row: Row) -> Self {
        Self {
            run: row.run,
            seed: row.seed,
            variation: Variation {
                interactions: row.interactions,
                mass: row.mass_factor,
                inertia: row.inertia_factor,
                center_of_gravity: row.center_of_gravity_shift_m,
                delay: row.extra_delay_s,
                turbulence: row.turbulence_m_s,
                inflow: row.interference_factor,
                gust: [row.gust_forward_m_s, row.gust_right_m_s, row.gust_up_m_s],
                governor: row.governor_s,
            },
            status: row.status,
            state: row.state,
            time_s: row.time_s,
            velocity_peak_m_s: [
                row.forward_velocity_peak_m_s,
                row.right_velocity_peak_m_s,
                row.climb_rate_peak_m_s,
            ],
            velocity_rms_m_s: [
                row.forward_velocity_rms_m_s,
                row.right_velocity_rms_m_s,
                row.climb_rate_rms_m_s,
            ],
            attitude_peak_rad: [row.phi_peak_rad, row.theta_peak_rad],
            saturated_s: row.saturated_s,
            success: row.success,
        }
    }
}

/// What makes a run a success.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criterion {
    /// Largest peak error of any velocity, m/s.
    pub velocity_peak: f64,
    /// Longest time at actuator limits, s.
    pub saturated: f64,
}

impl Criterion {
    /// Whether a run meets it.
    #[must_use]
    pub fn met(&self, run: &Run) -> bool {
        run.status == "completed"
            && run.velocity_peak_m_s.iter().all(|peak| *peak <= self.velocity_peak)
            && run.saturated_s <= self.saturated
    }
}

/// Wilson's score interval of a success rate at a normal quantile (1.96 for
/// 95 %): E. B. Wilson, J. Am. Stat. Assoc. 22, 1927.
#[must_use]
pub fn wilson(successes: usize, runs: usize, quantile: f64) -> [f64; 2] {
    if runs == 0 {
        return [0.0, 1.0];
    }
    let (n, z2) = (runs as f64, quantile * quantile);
    let p = successes as f64 / n;
    let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = quantile / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Every part of every range is used once, and a run does not depend on
    /// which others are drawn.
    #[test]
    fn latin_hypercube_uses_every_part_once() {
        let (runs, ranges) = (40, Ranges::default());
        let parts = Parts::new(runs, 5);
        let draws: Vec<Variation> = (0..runs).map(|k| parts.draw(k, &ranges).0).collect();
        let part = |value: f64, low: f64, high: f64| {
            ((value - low) / (high - low) * runs as f64).floor() as usize
        };
        let mut seen = vec![[false; 5]; runs];
        for v in &draws {
            seen[part(v.mass, 0.9, 1.1)][0] = true;
            seen[part(v.delay, 0.0, 0.01)][1] = true;
            seen[part(v.turbulence.unwrap(), 0.0, ranges.turbulence)][2] = true;
            seen[part(v.inflow, 0.8, 1.2)][3] = true;
            seen[part(v.gust[2], -ranges.gust, ranges.gust)][4] = true;
        }
        assert!(seen.iter().flatten().all(|s| *s));
        // Parameters are not tied to one another.
        let mean = draws.iter().map(|v| (v.mass - 1.0) * (v.inertia - 1.0)).sum::<f64>();
        assert!((mean / runs as f64).abs() < 0.25 * 0.1 * 0.1);
        assert_eq!(parts.draw(7, &ranges), Parts::new(runs, 5).draw(7, &ranges));
        assert_ne!(Parts::new(runs, 6).draw(7, &ranges).0, draws[7]);
        let seeds: std::collections::BTreeSet<u64> =
            (0..runs).map(|k| parts.draw(k, &ranges).1).collect();
        assert_eq!(seeds.len(), runs);
    }

    /// A row has the listed columns, in order, and reads back as the same run.
    #[test]
    fn rows_are_flat_and_read_back() {
        let (variation, seed) = Parts::new(9, 1).draw(3, &Ranges::default());
        let mut run = Run::without_trim(3, seed, variation);
        run.velocity_peak_m_s = [0.1, 0.2, 0.3];
        run.state = Some("theta".into());
        let row = serde_json::to_value(&run).unwrap();
        let names: Vec<&str> = row.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(names, COLUMNS.map(|(name, _)| name));
        assert!(row.as_object().unwrap().values().all(|v| !v.is_object() && !v.is_array()));
        assert_eq!(serde_json::from_value::<Run>(row).unwrap(), run);
        for (name, unit) in COLUMNS {
            let ending = unit.replace('/', "_");
            assert!(unit == "1" || name.ends_with(&format!("_{ending}")), "{name} {unit}");
        }
    }

    /// The interval's ends p solve |p̂ − p| = z √(p(1 − p)/n), Wilson's
    /// definition.
    #[test]
    fn wilson_solves_its_definition() {
        for (successes, runs) in [(0, 10), (3, 10), (95, 100), (200, 200)] {
            let [low, high] = wilson(successes, runs, 1.96);
            let rate = successes as f64 / runs as f64;
            assert!(low <= rate && rate <= high);
            for p in [low, high] {
                if p > 0.0 && p < 1.0 {
                    let spread = 1.96 * (p * (1.0 - p) / runs as f64).sqrt();
                    assert_relative_eq!((rate - p).abs(), spread, max_relative = 1e-9);
                }
            }
        }
        assert_eq!(wilson(0, 0, 1.96), [0.0, 1.0]);
    }
}
