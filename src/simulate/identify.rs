//! Frequency responses of the closed loop, measured in flight.
//!
//! The full nonlinear vehicle flies under the law at attitude hold while a
//! frequency sweep is added at one place. The ratio of two signals' spectra is
//! a response that the tuning predicts from linear models:
//!
//! * sweep on a stick: the loop cut there, L = −(what the law gives)/(what
//!   goes to the actuators);
//! * sweep on a measured attitude: the sensitivity S, (measured attitude)/(what
//!   was added);
//! * sweep on an attitude command: attitude per command.
//!
//! Nothing of the tuning chain is used: no linear model, no Padé
//! approximation, no continuous-time law.

use super::flight::{Autopilot, Excitation, Flight, FlightError, Status};
use super::maneuver::{Input, InputShape, Limits, Maneuver, Mode, Start};
use super::simulator::Options;
use super::wind::Weather;
use crate::control::axis::Axis;
use crate::control::metrics::{self, Bandwidth, Margins, Rejection, Sampled};
use crate::trim::ConvergedTrim;
use crate::vehicle::Vehicle;
use num_complex::Complex64;
use rayon::prelude::*;
use rustfft::FftPlanner;
use std::f64::consts::TAU;

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Probe {
    /// The loop cut at the axis's stick.
    Loop,
    /// The sensitivity of the measured attitude; roll and pitch only.
    Sensitivity,
    /// Attitude per command; roll and pitch only.
    Command,
}

/// How to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// First and last frequency of the sweep, rad/s.
    pub frequencies: [f64; 2],
    /// How long it takes, s.
    pub duration: f64,
    /// Time for all to settle afterwards, s.
    pub settling: f64,
    /// Attitude amplitude, rad, of sweeps on attitudes and commands.
    pub attitude: f64,
    /// Acceleration amplitudes of sweeps on sticks: rad/s² in roll, pitch and
    /// yaw, m/s² in heave; the inversion turns them into stick travel.
    pub acceleration: [f64; 4],
    /// Number of frequencies, evenly spaced in the logarithm.
    pub points: usize,
}

impl Default for Sweep {
    fn default() -> Self {
        Self {
            frequencies: [0.2, 20.0],
            duration: 160.0,
            settling: 40.0,
            attitude: 1.5f64.to_radians(),
            acceleration: [0.06, 0.06, 0.04, 0.25],
            points: 60,
        }
    }
}

/// Fraction of a frequency over which spectra are averaged, either way.
const BAND: f64 = 0.03;
/// Fewest lines of the spectrum in an average, either way of the middle one.
const LINES: usize = 1;
/// Coherence below which a point does not count.
pub const LEAST_COHERENCE: f64 = 0.8;

/// A measured frequency response.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Response at each.
    pub value: Vec<Complex64>,
    /// Coherence γ² at each, 0 to 1: how much of the output the input explains.
    pub coherence: Vec<f64>,
}

impl Response {
    /// The points whose coherence is good enough.
    #[must_use]
    pub fn coherent(&self) -> Self {
        let keep: Vec<usize> =
            (0..self.omega.len()).filter(|&k| self.coherence[k] >= LEAST_COHERENCE).collect();
        Self {
            omega: keep.iter().map(|&k| self.omega[k]).collect(),
            value: keep.iter().map(|&k| self.value[k]).collect(),
            coherence: keep.iter().map(|&k| self.coherence[k]).collect(),
        }
    }

    fn sampled(&self) -> Sampled<'_> {
        Sampled::new(&self.omega, &self.value)
    }

    /// Margins of a loop.
    #[must_use]
    pub fn margins(&self) -> Margins {
        metrics::margins(self.sampled())
    }

    /// Disturbance rejection of a sensitivity.
    #[must_use]
    pub fn rejection(&self) -> Rejection {
        metrics::rejection(self.sampled())
    }

    /// Bandwidth of attitude per command.
    #[must_use]
    pub fn bandwidth(&self) -> Bandwidth {
        metrics::bandwidth(self.sampled())
    }
}

/// Why nothing was measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// The flight could not begin.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The flight did not last.
    #[error(
        "the flight with a sweep in {axis} did not last: {state} left its bounds at {time:.1} s"
    )]
    Ended {
        /// Axis of the sweep.
        axis: Axis,
        /// State that left its bounds.
        state: String,
        /// When, s.
        time: f64,
    },
}

/// Response of `output` to `input`, both sampled every `step` s and at rest at
/// both ends, at frequencies between two.
///
/// Spectra of the whole record, so that nothing leaks; cross spectra are
/// averaged over neighbouring lines, H = S_uy/S_uu and γ² = |S_uy|²/(S_uu S_yy).
#[must_use]
pub fn response(
    input: &[f64],
    output: &[f64],
    step: f64,
    frequencies: [f64; 2],
    points: usize,
) -> Response {
    let n = input.len().min(output.len());
    let mut planner = FftPlanner::new();
    let transform = planner.plan_fft_forward(n);
    let spectrum = |signal: &[f64]| {
        // Without the mean and the drift from one end to the other.
        let (first, last) = (signal[0], signal[n - 1]);
        let mut values: Vec<Complex64> = signal[..n]
            .iter()
            .enumerate()
            .map(|(k, x)| {
                let t = k as f64 / (n - 1) as f64;
                Complex64::new(x - (1.0 - t) * first - t * last, 0.0)
            })
            .collect();
        transform.process(&mut values);
        values
    };
    let (u, y) = (spectrum(input), spectrum(output));
    let line = TAU / (n as f64 * step);
    let mut found = Response { omega: Vec::new(), value: Vec::new(), coherence: Vec::new() };
    let ratio = (frequencies[1] / frequencies[0]).ln();
    for k in 0..points {
        let omega = frequencies[0] * (ratio * k as f64 / (points.max(2) - 1) as f64).exp();
        let middle = (omega / line).round() as usize;
        let half = ((BAND * omega / line) as usize).max(LINES);
        if middle <= half || middle + half >= n / 2 {
            continue;
        }
        let (mut uu, mut yy, mut uy) = (0.0, 0.0, Complex64::new(0.0, 0.0));
        for m in middle - half..=middle + half {
            uu += u[m].norm_sqr();
            yy += y[m].norm_sqr();
            uy += u[m].conj() * y[m];
        }
        let at = middle as f64 * line;
        if uu > 0.0 && yy > 0.0 && found.omega.last().is_none_or(|last| at > *last) {
            found.omega.push(at);
            found.value.push(uy / uu);
            found.coherence.push(uy.norm_sqr() / (uu * yy));
        }
    }
    found
}

/// Measures one response in flight from a trim.
///
/// # Errors
/// Options that make no sense, or a flight that leaves its bounds.
pub fn measure(
    vehicle: &Vehicle,
    start: &ConvergedTrim,
    law: &Autopilot,
    options: &Options,
    sweep: &Sweep,
    axis: Axis,
    probe: Probe,
) -> Result<Response, IdentifyError> {
    let maneuver = hold(start, sweep);
    let stick = axis.effector().index();
    let amplitude = match probe {
        Probe::Loop => {
            let point = law.table.at(start.point().condition.airspeed);
            let decoupling = point.inversion.decoupling[(stick, axis.index())];
            decoupling.abs() * sweep.acceleration[axis.index()]
        }
        _ => sweep.attitude,
    };
    let input = Input {
        stick,
        shape: InputShape::Sweep(
            sweep.frequencies[0] * 0.8,
            sweep.frequencies[1] * 1.2,
            sweep.duration,
        ),
        start: 1.0,
        amplitude,
    };
    let mut flight = Flight::new(vehicle, start, Some(law), &maneuver, options)?;
    flight.excitation = Some(match probe {
        Probe::Loop => Excitation::Stick(input),
        Probe::Sensitivity => Excitation::Measurement(axis, input),
        Probe::Command => Excitation::Command(axis, input),
    });
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    let status = flight.fly(|flight| {
        let [input, output] = flight.probe();
        inputs.push(input);
        outputs.push(output);
    });
    if let Status::Diverged(departure) | Status::Limit(departure) = status {
        return Err(IdentifyError::Ended { axis, state: departure.state, time: departure.time });
    }
    let period = flight.simulator.period();
    let mut found = response(&inputs, &outputs, period, sweep.frequencies, sweep.points);
    if probe == Probe::Loop {
        for value in &mut found.value {
            *value = -*value;
        }
    }
    Ok(found)
}

/// Everything that can be measured of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Axis.
    pub axis: Axis,
    /// The loop cut at its stick.
    pub cut: Response,
    /// Sensitivity of the attitude, in roll and pitch.
    pub sensitivity: Option<Response>,
    /// Attitude per command, in roll and pitch.
    pub command: Option<Response>,
}

/// Measures axes, the flights side by side; the result does not depend on it.
///
/// # Errors
/// As [`measure`].
pub fn measure_axes(
    vehicle: &Vehicle,
    start: &ConvergedTrim,
    law: &Autopilot,
    options: &Options,
    sweep: &Sweep,
    axes: &[Axis],
) -> Result<Vec<Measured>, IdentifyError> {
    let jobs: Vec<(Axis, Probe)> = axes
        .iter()
        .flat_map(|&axis| {
            let attitude = matches!(axis, Axis::Roll | Axis::Pitch);
            let probes: &[Probe] = if attitude {
                &[Probe::Loop, Probe::Sensitivity, Probe::Command]
            } else {
                &[Probe::Loop]
            };
            probes.iter().map(move |&probe| (axis, probe))
        })
        .collect();
    let found: Vec<Response> = jobs
        .par_iter()
        .map(|&(axis, probe)| measure(vehicle, start, law, options, sweep, axis, probe))
        .collect::<Result<_, _>>()?;
    let mut list: Vec<Measured> = Vec::new();
    for ((axis, probe), response) in jobs.into_iter().zip(found) {
        match (probe, list.last_mut()) {
            (Probe::Sensitivity, Some(last)) => last.sensitivity = Some(response),
            (Probe::Command, Some(last)) => last.command = Some(response),
            _ => list.push(Measured { axis, cut: response, sensitivity: None, command: None }),
        }
    }
    Ok(list)
}

/// Attitude hold from a trim, for as long as a sweep takes.
fn hold(start: &ConvergedTrim, sweep: &Sweep) -> Maneuver {
    Maneuver {
        title: "frequency sweep".into(),
        duration: 1.0 + sweep.duration + sweep.settling,
        mode: Mode::Attitude,
        start: Start { condition: start.point().condition, height: 100.0, heading: 0.0 },
        velocity: [None, None],
        climb_rate: None,
        turn_rate: None,
        attitude: [None, None],
        inputs: Vec::new(),
        weather: Weather::default(),
        noise: Default::default(),
        limits: Limits::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// A sweep through a known second-order system gives its response, with
    /// full coherence; noise that has nothing to do with it lowers that.
    #[test]
    fn response_of_a_known_system() {
        let (w, z, step) = (3.0, 0.5, 0.01);
        let sweep = Input {
            stick: 0,
            shape: InputShape::Sweep(0.2, 15.0, 160.0),
            start: 1.0,
            amplitude: 1.0,
        };
        let (mut x, mut v) = (0.0, 0.0);
        let (mut input, mut output) = (Vec::new(), Vec::new());
        for k in 0..20_000 {
            input.push(sweep.at(step * f64::from(k)));
            output.push(x);
            // Fine steps within a sample, input held: half a sample of delay.
            for _ in 0..20 {
                let h = step / 20.0;
                v += h * (w * w * (input[k as usize] - x) - 2.0 * z * w * v);
                x += h * v;
            }
        }
        let found = response(&input, &output, step, [0.4, 10.0], 30);
        assert!(found.omega.len() > 20);
        for (omega, value) in found.omega.iter().zip(&found.value) {
            let s = Complex64::new(0.0, *omega);
            let exact = w * w / (s * s + 2.0 * z * w * s + w * w)
                * Complex64::from_polar(1.0, -omega * 0.5 * step);
            assert_relative_eq!(value.re, exact.re, epsilon = 0.02);
            assert_relative_eq!(value.im, exact.im, epsilon = 0.02);
        }
        assert!(found.coherence.iter().all(|c| *c > 0.98 && *c <= 1.0 + 1e-9));
        let mut noise = crate::simulate::equipment::Noise::new(1, 2);
        let noisy: Vec<f64> = output.iter().map(|y| y + 0.5 * noise.draw()).collect();
        let worse = response(&input, &noisy, step, [5.0, 10.0], 10);
        assert!(worse.coherence.iter().any(|c| *c < LEAST_COHERENCE));
        assert!(worse.coherent().omega.len() < worse.omega.len());
    }
}
