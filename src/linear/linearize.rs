//! From a converged periodic trim to the linear time-periodic model along its
//! orbit, by exact derivatives.

use super::model::{Channel, PeriodicModel, PeriodicSample};
use super::{LinearError, StateSpace};
use crate::numerics::scalar::{Dual, Scalar};
use crate::problem::STICKS;
use crate::trim::ConvergedTrim;
use crate::trim::shooting::Shooting;
use crate::units::Kind;
use crate::vehicle::{Layout, Vehicle, Workspace};
use nalgebra::DMatrix;

/// Tangents carried in one pass.
const WIDTH: usize = 28;

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
    /// Largest change of the averaged A and B, relative to their largest
    /// entries in scaled states, when every second sample is left out.
    pub sample_tolerance: f64,
    /// Samples a period to begin with.
    pub samples: usize,
    /// Most samples a period.
    pub most_samples: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { inputs: Inputs::Sticks, sample_tolerance: 1e-6, samples: 24, most_samples: 768 }
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

/// Linearises a vehicle along the orbit of a trim. The number of samples is
/// doubled until the averaged matrices no longer depend on it.
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
    let mut samples = options.samples.max(2) & !1;
    loop {
        let model = sampled(vehicle, trim, options.inputs, samples)?;
        let sample_error = thinning_error(vehicle, &model);
        if sample_error <= options.sample_tolerance {
            return Ok(Linearization { model, sample_error });
        }
        if 2 * samples > options.most_samples {
            return Err(LinearError::NotConverged {
                what: "the average of A and B over the period".into(),
                achieved: sample_error,
                wanted: options.sample_tolerance,
                limit: format!("{samples} samples a period"),
            });
        }
        samples *= 2;
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

fn sampled(
    vehicle: &Vehicle,
    trim: &ConvergedTrim,
    inputs: Inputs,
    count: usize,
) -> Result<PeriodicModel, LinearError> {
    let point = trim.point();
    // Fly the orbit again with steps that meet the samples.
    let steps = count * point.steps.div_ceil(count);
    let every = steps / count;
    let shooting = Shooting::new(vehicle, point.condition, point.method, steps);
    let mut states = Vec::with_capacity(count);
    shooting.fly(&point.state, &point.sticks, |index, time, state, _| {
        if index % every == 0 {
            states.push((time, state.to_vec()));
        }
    });
    let mut probe = Probe::new(vehicle, inputs);
    let samples =
        states.iter().map(|(time, state)| probe.sample(*time, state, &point.sticks)).collect();
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

/// Largest change of the averaged A and B, in scaled states and relative to
/// the largest scaled entry, when every second sample is left out.
fn thinning_error(vehicle: &Vehicle, model: &PeriodicModel) -> f64 {
    let scale: Vec<f64> = vehicle.layout.states.iter().map(|state| state.scale).collect();
    let samples = model.samples();
    let mut worst = 0.0_f64;
    let mut largest = 0.0_f64;
    let weight = 1.0 / samples.len() as f64;
    let mut a = DMatrix::zeros(scale.len(), scale.len());
    for (index, sample) in samples.iter().enumerate() {
        // All samples less the even ones: alternating signs.
        let sign = if index % 2 == 0 { -weight } else { weight };
        a += &sample.a * sign;
        for row in 0..scale.len() {
            for column in 0..scale.len() {
                let scaled = sample.a[(row, column)] * scale[column] / scale[row];
                largest = largest.max(scaled.abs());
            }
        }
    }
    for row in 0..scale.len() {
        for column in 0..scale.len() {
            worst = worst.max((a[(row, column)] * scale[column] / scale[row]).abs());
        }
    }
    worst / largest
}
