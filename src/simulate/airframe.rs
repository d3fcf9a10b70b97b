//! What flies: the blade-element vehicle, or the model stitched from linear
//! ones.
//!
//! The simulator asks an [`Airframe`] for its rates, its names, its effectors
//! and its bounds, and knows nothing else of it. The effectors of a vehicle
//! are its blade controls; those of a stitched model are the four sticks
//! behind their actuators, %. Both have u v w p q r φ θ for their first eight
//! states ([`Layout::BODY`]).

use super::simulator::Options;
use crate::control::plant::Hardware;
use crate::lti::stitch::{Lookup, Stitched, StitchedTrim};
use crate::problem::STICKS;
use crate::trim::{ConvergedTrim, FlightCondition};
use crate::units::Kind;
use crate::vehicle::{AirMotion, Layout, Vehicle, Workspace};
use std::f64::consts::TAU;

/// Attitude near which Euler angles end, rad.
const ATTITUDE_BOUND: f64 = 80.0 * std::f64::consts::PI / 180.0;
/// Body rates far beyond those of flight, rad/s.
const RATE_BOUND: f64 = 6.0;
/// Velocities at which no helicopter flies, m/s.
const VELOCITY_BOUND: f64 = 150.0;
/// Flapping beyond any stop, rad.
const FLAPPING_BOUND: f64 = 0.6;
/// Inflow ratio beyond any, 1.
const INFLOW_BOUND: f64 = 1.0;
/// Rotor speed off nominal, as a fraction of it.
const SPEED_BOUND: f64 = 0.5;

/// Largest product of a stitched model's fastest eigenvalue and the step: the
/// Runge–Kutta method of order 4 errs by 10⁻⁵ of that mode in its own time.
const STEP_OF_FASTEST: f64 = 0.25;
/// Fewest steps of a stitched model in a control period: delays are a whole
/// number of half steps.
const LEAST_STEPS: usize = 5;
/// Most steps of a stitched model in a control period.
const MOST_STEPS: f64 = 1000.0;

/// What flies.
#[derive(Debug, Clone, Copy)]
pub enum Airframe<'a> {
    /// The blade-element vehicle.
    Vehicle(&'a Vehicle),
    /// A model stitched from linear ones.
    Stitched(&'a Stitched),
}

impl<'a> From<&'a Vehicle> for Airframe<'a> {
    fn from(vehicle: &'a Vehicle) -> Self {
        Self::Vehicle(vehicle)
    }
}

impl<'a> From<&'a Stitched> for Airframe<'a> {
    fn from(model: &'a Stitched) -> Self {
        Self::Stitched(model)
    }
}

/// Room for evaluations of an airframe.
#[derive(Debug, Clone)]
pub enum Work {
    /// Of a vehicle.
    Vehicle(Box<Workspace<f64>>),
    /// Of a stitched model.
    Stitched(Box<Lookup>),
}

/// Trimmed flight to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// State at azimuth zero.
    pub state: Vec<f64>,
    /// Mean state over the orbit.
    pub mean_state: Vec<f64>,
    /// Sticks lat, lon, col, ped, %.
    pub sticks: [f64; 4],
    /// Flight condition.
    pub condition: FlightCondition,
}

impl From<&ConvergedTrim> for Start {
    fn from(trim: &ConvergedTrim) -> Self {
        let point = trim.point();
        Self {
            state: point.state.clone(),
            mean_state: point.mean_state.clone(),
            sticks: point.sticks,
            condition: point.condition,
        }
    }
}

impl From<&StitchedTrim> for Start {
    fn from(trim: &StitchedTrim) -> Self {
        Self {
            state: trim.state.clone(),
            mean_state: trim.state.clone(),
            sticks: trim.sticks,
            condition: FlightCondition {
                climb_rate: trim.climb,
                turn_rate: trim.turn,
                ..FlightCondition::level(trim.speed)
            },
        }
    }
}

impl<'a> Airframe<'a> {
    /// The vehicle, if it is one.
    #[must_use]
    pub fn vehicle(&self) -> Option<&'a Vehicle> {
        match *self {
            Self::Vehicle(vehicle) => Some(vehicle),
            Self::Stitched(_) => None,
        }
    }

    /// The stitched model, if it is one.
    #[must_use]
    pub fn stitched(&self) -> Option<&'a Stitched> {
        match *self {
            Self::Vehicle(_) => None,
            Self::Stitched(model) => Some(model),
        }
    }

    /// Number of states.
    #[must_use]
    pub fn state_count(&self) -> usize {
        match self {
            Self::Vehicle(vehicle) => vehicle.state_count(),
            Self::Stitched(model) => model.order(),
        }
    }

    /// Number of effectors.
    #[must_use]
    pub fn effector_count(&self) -> usize {
        match self {
            Self::Vehicle(vehicle) => vehicle.effector_count(),
            Self::Stitched(_) => STICKS.len(),
        }
    }

    /// Names and kinds of the states.
    #[must_use]
    pub fn states(&self) -> Vec<(String, Kind)> {
        match self {
            Self::Vehicle(vehicle) => {
                vehicle.layout.states.iter().map(|s| (s.name.clone(), s.kind)).collect()
            }
            Self::Stitched(model) => {
                model.states.iter().map(|s| (s.name.clone(), s.kind)).collect()
            }
        }
    }

    /// Names and kinds of the effectors.
    #[must_use]
    pub fn effectors(&self) -> Vec<(String, Kind)> {
        match self {
            Self::Vehicle(vehicle) => {
                vehicle.layout.effectors.iter().map(|e| (e.name.clone(), e.kind)).collect()
            }
            Self::Stitched(_) => {
                STICKS.iter().map(|name| (format!("{name}_actuator"), Kind::Percent)).collect()
            }
        }
    }

    /// Names of the rotors, whose powers are known.
    #[must_use]
    pub fn rotors(&self) -> Vec<String> {
        self.vehicle()
            .map(|vehicle| vehicle.rotors.iter().map(|rotor| rotor.name.clone()).collect())
            .unwrap_or_default()
    }

    /// Name of a state.
    #[must_use]
    pub fn state_name(&self, place: usize) -> Option<&'a str> {
        match *self {
            Self::Vehicle(vehicle) => vehicle.layout.states.get(place).map(|s| s.name.as_str()),
            Self::Stitched(model) => model.states.get(place).map(|s| s.name.as_str()),
        }
    }

    /// Places of what the sensors see of u v w p q r φ θ: behind the delays of
    /// measured quantities, where a stitched model has such.
    #[must_use]
    pub fn measured(&self) -> [usize; Layout::BODY.count] {
        match self {
            Self::Vehicle(_) => std::array::from_fn(|k| k),
            Self::Stitched(model) => model.measured,
        }
    }

    /// Limits of lat, lon, col, ped, %.
    #[must_use]
    pub fn stick_limits(&self) -> [[f64; 2]; 4] {
        match self {
            Self::Vehicle(vehicle) => vehicle.controls.stick_limits,
            Self::Stitched(model) => model.stick_limits,
        }
    }

    /// Effectors that actuators move, and their limits.
    #[must_use]
    pub fn actuators(&self) -> Vec<(usize, [f64; 2])> {
        match self {
            Self::Vehicle(vehicle) => {
                let mut places = Vec::new();
                for (k, rotor) in vehicle.layout.rotors.iter().enumerate() {
                    let (collective, cyclic) =
                        (vehicle.controls.collective_limits[k], vehicle.controls.cyclic_limits[k]);
                    let Some(pitch) = rotor.pitch else { continue };
                    places.extend(
                        [collective, cyclic, cyclic]
                            .into_iter()
                            .enumerate()
                            .map(|(i, limits)| (pitch + i, limits)),
                    );
                }
                let surfaces = vehicle.wings.iter().zip(&vehicle.layout.deflections);
                places.extend(
                    surfaces.filter_map(|(wing, place)| {
                        Some(((*place)?, wing.surface.as_ref()?.limits))
                    }),
                );
                places
            }
            Self::Stitched(model) if model.hardware_included => Vec::new(),
            Self::Stitched(model) => model.stick_limits.into_iter().enumerate().collect(),
        }
    }

    /// Largest rate of the actuators, in units of the effectors a second: a set
    /// of linear models says none.
    #[must_use]
    pub fn rate_limit(&self, options: &Options) -> f64 {
        match self {
            Self::Vehicle(_) => options.pitch_rate_limit,
            Self::Stitched(_) => f64::INFINITY,
        }
    }

    /// Hardware that is simulated around it.
    #[must_use]
    pub fn hardware(&self, options: &Options) -> Hardware {
        match self {
            Self::Stitched(model) if model.hardware_included => Hardware::INCLUDED,
            _ => options.hardware,
        }
    }

    /// Diameter of the largest rotor, m, over which turbulence is felt as a
    /// rotation; none where it is not known.
    #[must_use]
    pub fn span(&self) -> Option<f64> {
        let vehicle = self.vehicle()?;
        Some(vehicle.rotors.iter().map(|rotor| 2.0 * rotor.radius).fold(0.0, f64::max))
    }

    /// A revolution of the reference rotor, s; zero where nothing turns.
    #[must_use]
    pub fn revolution(&self) -> f64 {
        self.vehicle().map_or(0.0, |vehicle| TAU / vehicle.reference_speed)
    }

    /// Integration steps in a control period of a length, s.
    #[must_use]
    pub fn substeps(&self, period: f64, options: &Options) -> usize {
        match self {
            Self::Vehicle(vehicle) => {
                let turns = period * vehicle.reference_speed / TAU;
                (turns * options.steps_per_revolution as f64).ceil().max(1.0) as usize
            }
            Self::Stitched(model) => {
                let steps = (period * model.fastest() / STEP_OF_FASTEST).ceil();
                // A comparison that is false for what is no number.
                let steps = if steps < MOST_STEPS { steps } else { MOST_STEPS };
                (steps as usize).max(LEAST_STEPS)
            }
        }
    }

    /// Room for evaluations.
    #[must_use]
    pub fn workspace(&self) -> Work {
        match self {
            Self::Vehicle(vehicle) => Work::Vehicle(Box::new(vehicle.workspace())),
            Self::Stitched(model) => Work::Stitched(Box::new(model.lookup())),
        }
    }

    /// Effectors that sticks, %, command.
    pub fn mix(&self, sticks: &[f64; 4], effectors: &mut [f64]) {
        match self {
            Self::Vehicle(vehicle) => vehicle.mix(sticks, effectors),
            Self::Stitched(_) => effectors.copy_from_slice(sticks),
        }
    }

    /// Rates of the states at a time, s. Allocates nothing.
    pub fn rates(
        &self,
        time: f64,
        state: &[f64],
        effectors: &[f64],
        air: AirMotion,
        work: &mut Work,
        rates: &mut [f64],
    ) {
        match (self, work) {
            (Self::Vehicle(vehicle), Work::Vehicle(work)) => {
                let azimuth = time * vehicle.reference_speed;
                vehicle.rates(azimuth, state, effectors, air, work, rates);
            }
            (Self::Stitched(model), Work::Stitched(work)) => {
                let sticks = std::array::from_fn(|k| effectors[k]);
                model.rates(state, &sticks, air.velocity, air.rate, work, rates);
            }
            // The room of another airframe: no rates are right.
            _ => rates.fill(f64::NAN),
        }
    }

    /// Bounds of every state.
    #[must_use]
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let body = Layout::BODY;
        let within = |bound: f64| [-bound, bound];
        let inner = if self.vehicle().is_some() { INFLOW_BOUND } else { f64::MAX };
        let mut bounds = vec![within(inner); self.state_count()];
        for k in 0..3 {
            bounds[body.velocity + k] = within(VELOCITY_BOUND);
            bounds[body.rate + k] = within(RATE_BOUND);
        }
        bounds[body.roll] = within(ATTITUDE_BOUND);
        bounds[body.pitch] = within(ATTITUDE_BOUND);
        let Self::Vehicle(vehicle) = self else { return bounds };
        for (rotor, places) in vehicle.rotors.iter().zip(&vehicle.layout.rotors) {
            let [start, angles, rates] = places.flap;
            bounds[start..start + angles].fill(within(FLAPPING_BOUND));
            bounds[start + angles..start + angles + rates]
                .fill(within(FLAPPING_BOUND * rotor.speed));
            if let Some(start) = places.speed {
                let [low, high] = if rotor.commanded {
                    [0.0, 10.0 * rotor.speed]
                } else {
                    [rotor.speed * (1.0 - SPEED_BOUND), rotor.speed * (1.0 + SPEED_BOUND)]
                };
                bounds[start] = [low, high];
            }
            if let Some(place) = places.azimuth {
                bounds[place] = within(f64::MAX);
            }
        }
        bounds
    }
}
