//! From a converged periodic trim to the linear time-periodic model along its
//! orbit, by exact derivatives.

use super::model::{Channel, PeriodicModel, PeriodicSample};
use super::set::TrimValues;
use super::{LinearError, StateSpace};
use crate::numerics::scalar::{Dual, Scalar, WIDTH};
use crate::problem::STICKS;
use crate::trim::ConvergedTrim;
use crate::trim::shooting::{Shooting, stick_scales};
use crate::units::Kind;
use crate::vehicle::{Layout, Vehicle, Workspace};
use nalgebra::DMatrix;

/// What moves the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Inputs {
    /// The pilot's four sticks, %.
    #[default]
    Sticks,
    /// The blade controls of every rotor, rad.
    Rotors,
}

/// How to linearise.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// What moves the model.
    pub inputs: Inputs,
    /// Largest change of an entry of the averaged A and B, in scaled states
    /// and inputs and relative to the largest entry of its row, when every
    /// second sample is left out.
    pub sample_tolerance: f64,
    /// Samples a period to begin with, at least.
    pub samples: usize,
    /// Most samples a period.
    pub most_samples: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { inputs: Inputs::Sticks, sample_tolerance: 1e-3, samples: 24, most_samples: 768 }
    }
}

/// The periodic model of a trim.
#[derive(Debug, Clone)]
pub struct Linearization {
    /// The model, sampled evenly over the period.
    pub model: PeriodicModel,
    /// Largest relative change of the averaged A and B on leaving out every
    /// second sample.
    pub sample_error: f64,
}

/// Trim values of the states and inputs of a model that was made of a trim: the
/// means over the orbit, found by name. `None` where a state is none of the
/// vehicle's, such as a harmonic or a balanced one.
#[must_use]
pub fn trim_values(
    vehicle: &Vehicle,
    trim: &ConvergedTrim,
    model: &StateSpace,
) -> Option<TrimValues> {
    let point = trim.point();
    let layout = &vehicle.layout;
    let mut effectors = vec![0.0; vehicle.effector_count()];
    vehicle.mix(&point.sticks, &mut effectors);
    let state = |c: &Channel| {
        let place = layout.states.iter().position(|s| s.name == c.name)?;
        point.mean_state.get(place).copied()
    };
    let input = |c: &Channel| match STICKS.iter().position(|name| *name == c.name) {
        Some(stick) => Some(point.sticks[stick]),
        None => {
            let place = layout.effectors.iter().position(|e| e.name == c.name)?;
            effectors.get(place).copied()
        }
    };
    // Limits of blade controls are not those of one input each: theirs are left
    // out.
    let limits = |c: &Channel| {
        let stick = STICKS.iter().position(|name| *name == c.name)?;
        Some(vehicle.controls.stick_limits[stick])
    };
    Some(TrimValues {
        states: model.states().iter().map(state).collect::<Option<_>>()?,
        inputs: model.inputs().iter().map(input).collect::<Option<_>>()?,
        limits: model.inputs().iter().map(limits).collect::<Option<_>>().unwrap_or_default(),
    })
}

/// Linearises a vehicle along the orbit of a trim. The number of samples is
/// doubled until the averaged matrices no longer depend on it; samples that
/// there are serve again.
///
/// The states are those of the vehicle's layout; outputs are the rigid-body
/// states, the heading rate, the velocity over the ground in heading axes and
/// the specific force at the centre of gravity.
///
/// # Errors
/// A model that is not finite, or samples that do not converge.
pub fn linearize(
    vehicle: &Vehicle,
    trim: &ConvergedTrim,
    options: &Options,
) -> Result<Linearization, LinearError> {
    let point = trim.point();
    let mut orbit = std::borrow::Cow::Borrowed(&point.orbit);
    // Steps a sample: as many samples as asked for, or a little more.
    let mut every = 1;
    while (orbit.len() / every) % 2 == 0 && orbit.len() / every >= 2 * options.samples.max(2) {
        every *= 2;
    }
    let mut probe = Probe::new(vehicle, options.inputs);
    let mut sample = |orbit: &[Vec<f64>], index: usize| {
        let time = vehicle.period * index as f64 / orbit.len() as f64;
        probe.sample(time, &orbit[index], &point.sticks)
    };
    let mut samples: Vec<PeriodicSample> =
        (0..orbit.len()).step_by(every).map(|index| sample(&orbit, index)).collect();
    loop {
        let sample_error = thinning_error(vehicle, options.inputs, &samples);
        tracing::debug!(
            rotorcraft = vehicle.name,
            airspeed_m_s = point.condition.airspeed,
            samples = samples.len(),
            sample_error,
            "linear model: samples a period"
        );
        if sample_error <= options.sample_tolerance {
            let model = periodic_model(vehicle, options.inputs, samples)?;
            return Ok(Linearization { model, sample_error });
        }
        if 2 * samples.len() > options.most_samples {
            // A model that is not finite says so before one that is coarse.
            let count = samples.len();
            periodic_model(vehicle, options.inputs, samples)?;
            return Err(LinearError::NotConverged {
                what: "the average of A and B over the period".into(),
                achieved: sample_error,
                wanted: options.sample_tolerance,
                limit: format!("{count} samples a period"),
            });
        }
        if every == 1 {
            // Finer than the trim's own steps: fly the orbit again.
            let steps = 2 * orbit.len();
            let shooting = Shooting::new(vehicle, point.condition, point.method, steps);
            let mut finer = Vec::with_capacity(steps);
            shooting.fly(&point.state, &point.sticks, |_, _, state, _| {
                finer.push(state.to_vec());
            });
            orbit = std::borrow::Cow::Owned(finer);
            every = 2;
        }
        every /= 2;
        let between: Vec<PeriodicSample> =
            (every..orbit.len()).step_by(2 * every).map(|index| sample(&orbit, index)).collect();
        samples = samples.into_iter().zip(between).flat_map(|(a, b)| [a, b]).collect();
    }
}

/// The averaged model of a trim: the zeroth harmonic that the paper uses.
///
/// # Errors
/// As for [`linearize`].
pub fn averaged(
    vehicle: &Vehicle,
    trim: &ConvergedTrim,
    options: &Options,
) -> Result<StateSpace, LinearError> {
    Ok(linearize(vehicle, trim, options)?.model.averaged())
}

fn periodic_model(
    vehicle: &Vehicle,
    inputs: Inputs,
    samples: Vec<PeriodicSample>,
) -> Result<PeriodicModel, LinearError> {
    let channel = |q: &crate::vehicle::layout::Quantity| Channel::new(q.name.clone(), q.kind);
    let states = vehicle.layout.states.iter().map(channel).collect();
    let inputs = match inputs {
        Inputs::Sticks => STICKS.iter().map(|s| Channel::new(*s, Kind::Percent)).collect(),
        Inputs::Rotors => vehicle.layout.effectors.iter().map(channel).collect(),
    };
    let frequency = std::f64::consts::TAU / vehicle.period;
    PeriodicModel::new(states, inputs, outputs(), frequency, samples)
}

/// Outputs of every model.
fn outputs() -> Vec<Channel> {
    let mut outputs = Vec::new();
    let mut add = |names: &[&str], kind| {
        outputs.extend(names.iter().map(|name| Channel::new(*name, kind)));
    };
    add(&["u", "v", "w"], Kind::Velocity);
    add(&["p", "q", "r"], Kind::AngularRateRad);
    add(&["phi", "theta"], Kind::AngleRad);
    add(&["heading_rate"], Kind::AngularRateRad);
    add(&["v_forward", "v_right", "v_down"], Kind::Velocity);
    add(&["a_x", "a_y", "a_z"], Kind::Acceleration);
    outputs
}

/// Takes derivatives at a point of the orbit.
struct Probe<'a> {
    vehicle: &'a Vehicle,
    inputs: Inputs,
    work: Workspace<Dual<WIDTH>>,
    state: Vec<Dual<WIDTH>>,
    effectors: Vec<Dual<WIDTH>>,
    rates: Vec<Dual<WIDTH>>,
}

impl<'a> Probe<'a> {
    fn new(vehicle: &'a Vehicle, inputs: Inputs) -> Self {
        let n = vehicle.state_count();
        Self {
            vehicle,
            inputs,
            work: vehicle.workspace(),
            state: vec![Dual::default(); n],
            effectors: vec![Dual::default(); vehicle.effector_count()],
            rates: vec![Dual::default(); n],
        }
    }

    fn sample(&mut self, time: f64, state: &[f64], sticks: &[f64; 4]) -> PeriodicSample {
        let vehicle = self.vehicle;
        let n = state.len();
        let input_count = match self.inputs {
            Inputs::Sticks => 4,
            Inputs::Rotors => vehicle.effector_count(),
        };
        let output_count = outputs().len();
        let mut sample = PeriodicSample {
            a: DMatrix::zeros(n, n),
            b: DMatrix::zeros(n, input_count),
            c: DMatrix::zeros(output_count, n),
            d: DMatrix::zeros(output_count, input_count),
        };
        let mut nominal = vec![0.0; vehicle.effector_count()];
        vehicle.mix(sticks, &mut nominal);
        let total = n + input_count;
        for first in (0..total).step_by(WIDTH) {
            let seed = |value: f64, index: usize| {
                let mut dual = Dual::constant(value);
                if (first..first + WIDTH).contains(&index) {
                    dual.d[index - first] = 1.0;
                }
                dual
            };
            for (k, (x, &value)) in self.state.iter_mut().zip(state).enumerate() {
                *x = seed(value, k);
            }
            match self.inputs {
                Inputs::Sticks => {
                    let sticks = [0, 1, 2, 3].map(|k| seed(sticks[k], n + k));
                    vehicle.mix(&sticks, &mut self.effectors);
                }
                Inputs::Rotors => {
                    for (k, (e, &value)) in self.effectors.iter_mut().zip(&nominal).enumerate() {
                        *e = seed(value, n + k);
                    }
                }
            }
            let azimuth = time * vehicle.reference_speed;
            vehicle.rates(
                azimuth,
                &self.state,
                &self.effectors,
                [0.0; 3],
                &mut self.work,
                &mut self.rates,
            );
            let navigation = vehicle.navigation(&self.state);
            let force = self.work.specific_force().0;
            let measured: Vec<Dual<WIDTH>> = self.state[..Layout::BODY.count]
                .iter()
                .copied()
                .chain(navigation)
                .chain(force)
                .collect();
            for column in first..total.min(first + WIDTH) {
                let tangent = column - first;
                let (x, y, place) = if column < n {
                    (&mut sample.a, &mut sample.c, column)
                } else {
                    (&mut sample.b, &mut sample.d, column - n)
                };
                for (row, rate) in self.rates.iter().enumerate() {
                    x[(row, place)] = rate.tangent(tangent);
                }
                for (row, output) in measured.iter().enumerate() {
                    y[(row, place)] = output.tangent(tangent);
                }
            }
        }
        sample
    }
}

/// Largest change of an entry of the averaged A and B when every second sample
/// is left out, in scaled states and inputs, relative to the largest entry of
/// its row at any sample.
fn thinning_error(vehicle: &Vehicle, inputs: Inputs, samples: &[PeriodicSample]) -> f64 {
    let state: Vec<f64> = vehicle.layout.states.iter().map(|state| state.scale).collect();
    let input: Vec<f64> = match inputs {
        Inputs::Sticks => stick_scales(vehicle).to_vec(),
        Inputs::Rotors => vehicle.layout.effectors.iter().map(|effector| effector.scale).collect(),
    };
    let (n, m) = (state.len(), input.len());
    let weight = 1.0 / samples.len() as f64;
    let mut change = DMatrix::<f64>::zeros(n, n + m);
    let mut largest = vec![f64::MIN_POSITIVE; n];
    for (index, sample) in samples.iter().enumerate() {
        // All samples less the even ones: alternating signs.
        let sign = if index % 2 == 0 { -weight } else { weight };
        for column in 0..n + m {
            for row in 0..n {
                let entry = if column < n {
                    sample.a[(row, column)] * state[column]
                } else {
                    sample.b[(row, column - n)] * input[column - n]
                };
                change[(row, column)] += sign * entry;
                largest[row] = largest[row].max(entry.abs());
            }
        }
    }
    let relative = |(row, column): (usize, usize)| (change[(row, column)] / largest[row]).abs();
    let entries = (0..n).flat_map(|row| (0..n + m).map(move |column| (row, column)));
    entries.map(relative).fold(0.0, f64::max)
}
