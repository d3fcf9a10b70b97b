//! Frequency responses of the closed loop, measured in flight.
//!
//! The full nonlinear vehicle flies under the law at attitude hold while a
//! frequency sweep is added at one place. The ratio of two signals' spectra is
//! a response that the tuning predicts from linear models:
//!
//! * sweep on a stick: the loop cut there, L = −(what the law gives)/(what
//!   goes to the actuators);
//! * sweep on a held quantity (φ, θ, heading, V_z) as the gains that hold it see
//!   it: the sensitivity S, (that quantity, disturbance included)/(what was
//!   added);
//! * sweep on an attitude command: attitude per command.
//!
//! The flights with sweeps on the sticks also give the aircraft alone, without
//! the law, as if the loop were broken: in each of them all sticks move, one by
//! the sweep and the others by the law, and four such flights tell the effects
//! of the four sticks apart (the joint input–output method).
//!
//! Nothing of the tuning chain is used: no linear model, no Padé
//! approximation, no continuous-time law.

use super::airframe::{Airframe, Start};
use super::flight::{Autopilot, Excitation, Flight, FlightError, Status};
use super::maneuver::{Input, InputShape, Maneuver, Mode};
use super::simulator::Options;
use crate::control::axis::Axis;
use crate::control::metrics::{self, Bandwidth, Margins, Rejection, Sampled};
use nalgebra::{Matrix4, Vector4};
use num_complex::Complex64;
use rayon::prelude::*;
use rustfft::FftPlanner;
use std::f64::consts::TAU;

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Probe {
    /// The loop cut at the axis's stick.
    Loop,
    /// The sensitivity of the held quantity.
    Sensitivity,
    /// Attitude per command; roll and pitch only.
    Command,
}

/// How to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// First and last frequency of the sweep, rad/s.
    pub frequencies: [f64; 2],
    /// How long it takes, s. Lines of the spectra are one over it apart, and
    /// where |S| runs along −3 dB the crossing needs many: half of the default
    /// leaves 0.05 dB of ripple, twice as much 0.01 dB.
    pub duration: f64,
    /// Time for all to settle afterwards, s.
    pub settling: f64,
    /// Amplitudes of sweeps on held quantities and commands: φ, θ, heading,
    /// rad; V_z, m/s.
    pub held: [f64; 4],
    /// Acceleration amplitudes of sweeps on sticks: rad/s² in roll, pitch and
    /// yaw, m/s² in heave; the inversion turns them into stick travel.
    pub acceleration: [f64; 4],
    /// Number of frequencies, evenly spaced in the logarithm.
    pub points: usize,
}

impl Sweep {
    /// The same with all amplitudes multiplied by a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            held: self.held.map(|x| x * factor),
            acceleration: self.acceleration.map(|x| x * factor),
            ..self
        }
    }
}

impl Default for Sweep {
    fn default() -> Self {
        Self {
            frequencies: [0.2, 20.0],
            duration: 320.0,
            settling: 40.0,
            held: [1.5f64.to_radians(), 1.5f64.to_radians(), 1.5f64.to_radians(), 0.3],
            acceleration: [0.06, 0.06, 0.04, 0.25],
            points: 120,
        }
    }
}

/// Fraction of a frequency over which spectra are averaged, either way.
const BAND: f64 = 0.03;
/// Fewest lines of the spectrum in an average, either way of the middle one.
const LINES: usize = 1;
/// Frequency from which sensitivities are compared, rad/s: slower than this
/// |S| is deep, and a sweep has few periods.
pub const SLOWEST_REJECTION: f64 = 0.4;
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
    /// Lines of the spectra that were averaged at each.
    pub lines: Vec<usize>,
}

/// Standard errors either way that an interval covers: some 95 %.
const STANDARD_ERRORS: f64 = 2.0;

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
            lines: keep.iter().map(|&k| self.lines[k]).collect(),
        }
    }

    /// Standard error of the magnitude at each frequency, relative to it:
    /// √((1 − γ²)/(2 n γ²)) with n averaged lines (Bendat and Piersol, Random
    /// Data).
    pub fn standard_errors(&self) -> impl Iterator<Item = f64> + '_ {
        self.coherence
            .iter()
            .zip(&self.lines)
            .map(|(c, n)| ((1.0 - c).max(0.0) / (2.0 * *n as f64 * c)).sqrt())
    }

    /// Rejection bandwidths between which that of a sensitivity lies, rad/s,
    /// as its magnitude is uncertain by two standard errors: the first upward
    /// crossing of −3 dB by the largest and by the least that it may be. Where
    /// |S| runs along the level they lie far apart. `None` where nothing crosses.
    #[must_use]
    pub fn rejection_interval(&self) -> [Option<f64>; 2] {
        [1.0, -1.0].map(|side| {
            let value: Vec<Complex64> = self
                .value
                .iter()
                .zip(self.standard_errors())
                .map(|(value, error)| value * (1.0 + side * STANDARD_ERRORS * error))
                .collect();
            metrics::rejection(Sampled::new(&self.omega, &value)).bandwidth
        })
    }

    /// Largest difference of the magnitude from another response at the same
    /// frequencies, from one on, rad/s: dB either way. `None` without a point.
    #[must_use]
    pub fn largest_gap(&self, other: &[Complex64], from: f64) -> Option<f64> {
        self.omega
            .iter()
            .zip(self.value.iter().zip(other))
            .filter(|(omega, _)| **omega >= from)
            .map(|(_, (a, b))| metrics::decibels(a.norm() / b.norm()).abs())
            .reduce(f64::max)
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
    /// A flight without a sweep did not last.
    #[error("the flight with a small step did not last: {state} left its bounds at {time:.1} s")]
    Departed {
        /// State that left its bounds.
        state: String,
        /// When, s.
        time: f64,
    },
    /// The linear model cannot be integrated.
    #[error("the linear model grows beyond all numbers")]
    NotFinite,
}

/// What went in and out of the aircraft during a sweep, one value a control
/// period.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// Sticks lat, lon, col, ped as they go to the actuators, %.
    pub sticks: [Vec<f64>; 4],
    /// u v w p q r φ θ as measured.
    pub states: [Vec<f64>; 8],
}

/// The aircraft's measured responses to its sticks, hardware included.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlantResponse {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Responses of u v w p q r φ θ per stick, at each frequency.
    pub value: Vec<[[Complex64; 4]; 8]>,
    /// Multiple coherence of each state, 0 to 1: how much of it the sticks
    /// explain.
    pub coherence: Vec<[f64; 8]>,
    /// Lines of the spectra that were averaged at each frequency, over all
    /// flights.
    pub lines: Vec<usize>,
}

impl PlantResponse {
    /// One element, with the coherence of its state.
    #[must_use]
    pub fn element(&self, state: usize, stick: usize) -> Response {
        Response {
            omega: self.omega.clone(),
            value: self.value.iter().map(|m| m[state][stick]).collect(),
            coherence: self.coherence.iter().map(|c| c[state]).collect(),
            lines: self.lines.clone(),
        }
    }
}

/// The aircraft's responses from flights in which the sticks moved in
/// independent ways, at least four: G = S_xu S_uu⁻¹ over all flights and
/// neighbouring lines of the spectra.
#[must_use]
pub fn plant(records: &[Record], step: f64, frequencies: [f64; 2], points: usize) -> PlantResponse {
    let of = |signals: &[Vec<f64>]| signals.iter().map(|s| spectrum(s)).collect::<Vec<_>>();
    let spectra: Vec<_> =
        records.iter().map(|record| (of(&record.sticks), of(&record.states))).collect();
    let n = records.iter().map(|r| r.sticks[0].len()).min().unwrap_or(0);
    let mut found = PlantResponse::default();
    for (middle, half) in bands(n, step, frequencies, points) {
        let mut uu = Matrix4::<Complex64>::zeros();
        let mut xu = [Vector4::<Complex64>::zeros(); 8];
        let mut xx = [0.0; 8];
        for (sticks, states) in &spectra {
            for m in middle - half..=middle + half {
                let u = Vector4::from_fn(|j, _| sticks[j][m]);
                uu += u * u.adjoint();
                for (k, state) in states.iter().enumerate() {
                    xu[k] += u.map(|u| u.conj()) * state[m];
                    xx[k] += state[m].norm_sqr();
                }
            }
        }
        // S_uu is Hermitian: its conjugate is its transpose.
        let Some(inverse) = uu.transpose().try_inverse() else { continue };
        let rows = xu.map(|x| inverse * x);
        found.omega.push(TAU * middle as f64 / (n as f64 * step));
        found.lines.push((2 * half + 1) * records.len());
        found.value.push(rows.map(|row| [0, 1, 2, 3].map(|j| row[j])));
        found.coherence.push(std::array::from_fn(|k| {
            let explained: Complex64 = (0..4).map(|j| rows[k][j] * xu[k][j].conj()).sum();
            if xx[k] > 0.0 { (explained.re / xx[k]).clamp(0.0, 1.0) } else { 0.0 }
        }));
    }
    found
}

/// Cost of the mismatch of a measured response and a predicted one over the
/// measured points: J = 20/n Σ W_γ (ΔdB² + 0.01745 Δdeg²), W_γ = (1.58 (1 −
/// e^(−γ²)))². Up to 100 is held acceptable and up to 50 nearly perfect
/// (Tischler and Remple, Aircraft and Rotorcraft System Identification). `None`
/// without a point.
#[must_use]
pub fn mismatch(measured: &Response, predicted: impl Fn(f64) -> Complex64) -> Option<f64> {
    let n = measured.omega.len();
    let sum: f64 = measured
        .omega
        .iter()
        .zip(&measured.value)
        .zip(&measured.coherence)
        .map(|((omega, value), coherence)| {
            let ratio = value / predicted(*omega);
            let (db, degrees) = (20.0 * ratio.norm().log10(), ratio.arg().to_degrees());
            let weight = (1.58 * (1.0 - (-coherence * coherence).exp())).powi(2);
            weight * (db * db + 0.01745 * degrees * degrees)
        })
        .sum();
    (n > 0).then(|| 20.0 * sum / n as f64)
}

/// Spectrum of a signal without its mean and its drift from one end to the
/// other.
fn spectrum(signal: &[f64]) -> Vec<Complex64> {
    let n = signal.len();
    let (first, last) = (signal[0], signal[n - 1]);
    let mut values: Vec<Complex64> = signal
        .iter()
        .enumerate()
        .map(|(k, x)| {
            let t = k as f64 / (n - 1) as f64;
            Complex64::new(x - (1.0 - t) * first - t * last, 0.0)
        })
        .collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut values);
    values
}

/// Lines of a spectrum of `n` samples to average: the middle one and how many
/// either way, for frequencies evenly spaced in the logarithm.
fn bands(n: usize, step: f64, frequencies: [f64; 2], points: usize) -> Vec<(usize, usize)> {
    let line = TAU / (n as f64 * step);
    let ratio = (frequencies[1] / frequencies[0]).ln();
    let mut found: Vec<(usize, usize)> = Vec::new();
    for k in 0..points {
        let omega = frequencies[0] * (ratio * k as f64 / (points.max(2) - 1) as f64).exp();
        let middle = (omega / line).round() as usize;
        let half = ((BAND * omega / line) as usize).max(LINES);
        let inside = middle > half && middle + half < n / 2;
        if inside && found.last().is_none_or(|last| middle > last.0) {
            found.push((middle, half));
        }
    }
    found
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
    let (u, y) = (spectrum(&input[..n]), spectrum(&output[..n]));
    let line = TAU / (n as f64 * step);
    let mut found =
        Response { omega: Vec::new(), value: Vec::new(), coherence: Vec::new(), lines: Vec::new() };
    for (middle, half) in bands(n, step, frequencies, points) {
        let (mut uu, mut yy, mut uy) = (0.0, 0.0, Complex64::new(0.0, 0.0));
        for m in middle - half..=middle + half {
            uu += u[m].norm_sqr();
            yy += y[m].norm_sqr();
            uy += u[m].conj() * y[m];
        }
        if uu > 0.0 && yy > 0.0 {
            found.omega.push(middle as f64 * line);
            found.value.push(uy / uu);
            found.coherence.push(uy.norm_sqr() / (uu * yy));
            found.lines.push(2 * half + 1);
        }
    }
    found
}

/// Measures one response in flight from a trim; also what went in and out of
/// the aircraft.
///
/// # Errors
/// Options that make no sense, or a flight that leaves its bounds.
pub fn measure(
    airframe: Airframe<'_>,
    start: &Start,
    law: &Autopilot,
    options: &Options,
    sweep: &Sweep,
    axis: Axis,
    probe: Probe,
) -> Result<(Response, Record), IdentifyError> {
    let maneuver = hold(start, sweep);
    let stick = axis.effector().index();
    let amplitude = match probe {
        Probe::Loop => {
            let point = law.table.at(start.condition.airspeed);
            let decoupling = point.inversion.decoupling[(stick, axis.index())];
            decoupling.abs() * sweep.acceleration[axis.index()]
        }
        _ => sweep.held[axis.index()],
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
    let mut flight = Flight::of(airframe, start, Some(law), &maneuver, options)?;
    flight.excitation = Some(match probe {
        Probe::Loop => Excitation::Stick(input),
        Probe::Sensitivity => Excitation::Output(axis, input),
        Probe::Command => Excitation::Command(axis, input),
    });
    let (mut inputs, mut outputs, mut record) = (Vec::new(), Vec::new(), Record::default());
    let status = flight.fly(|flight| {
        let [input, output] = flight.probe();
        inputs.push(input);
        outputs.push(output);
        if let (Probe::Loop, Some(m)) = (probe, flight.measurement()) {
            for (signal, value) in record.sticks.iter_mut().zip(flight.sticks()) {
                signal.push(value);
            }
            let ([u, v, w], [p, q, r]) = (m.velocity_body, m.rates);
            for (signal, value) in record.states.iter_mut().zip([u, v, w, p, q, r, m.roll, m.pitch])
            {
                signal.push(value);
            }
        }
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
    Ok((found, record))
}

/// Everything that can be measured of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Axis.
    pub axis: Axis,
    /// The loop cut at its stick.
    pub cut: Response,
    /// What went in and out of the aircraft meanwhile.
    pub record: Record,
    /// Sensitivity of the held quantity.
    pub sensitivity: Option<Response>,
    /// Attitude per command, in roll and pitch.
    pub command: Option<Response>,
}

/// Measures axes, the flights side by side; the result does not depend on it.
///
/// # Errors
/// As [`measure`].
pub fn measure_axes(
    airframe: Airframe<'_>,
    start: &Start,
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
                &[Probe::Loop, Probe::Sensitivity]
            };
            probes.iter().map(move |&probe| (axis, probe))
        })
        .collect();
    let found: Vec<(Response, Record)> = jobs
        .par_iter()
        .map(|&(axis, probe)| measure(airframe, start, law, options, sweep, axis, probe))
        .collect::<Result<_, _>>()?;
    let mut list: Vec<Measured> = Vec::new();
    for ((axis, probe), (response, record)) in jobs.into_iter().zip(found) {
        match (probe, list.last_mut()) {
            (Probe::Sensitivity, Some(last)) => last.sensitivity = Some(response),
            (Probe::Command, Some(last)) => last.command = Some(response),
            _ => list.push(Measured {
                axis,
                cut: response,
                record,
                sensitivity: None,
                command: None,
            }),
        }
    }
    Ok(list)
}

/// Attitude hold from a trim, for as long as a sweep takes.
fn hold(start: &Start, sweep: &Sweep) -> Maneuver {
    let duration = 1.0 + sweep.duration + sweep.settling;
    Maneuver::hold(start.condition, Mode::Attitude, duration)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Four flights in which all sticks move together still tell their effects
    /// apart, as long as they move in different ways.
    #[test]
    fn plant_of_a_known_static_system() {
        let gain = |k: usize, j: usize| 0.3 + k as f64 - 0.7 * j as f64;
        let step = 0.02;
        let records: Vec<Record> = (0..4)
            .map(|flight| {
                let mut record = Record::default();
                for t in 0..8000 {
                    let sweep = |stick: usize, start: f64| {
                        let shape = InputShape::Sweep(0.3, 12.0, 120.0);
                        Input { stick, shape, start, amplitude: 1.0 }.at(step * f64::from(t))
                    };
                    // The law moves the others as well, late.
                    let sticks: [f64; 4] = std::array::from_fn(|j| {
                        if j == flight { sweep(j, 1.0) } else { 0.4 * sweep(j, 1.3) }
                    });
                    for (signal, value) in record.sticks.iter_mut().zip(sticks) {
                        signal.push(value);
                    }
                    for (k, signal) in record.states.iter_mut().enumerate() {
                        signal.push((0..4).map(|j| gain(k, j) * sticks[j]).sum());
                    }
                }
                record
            })
            .collect();
        let found = plant(&records, step, [0.5, 10.0], 20);
        assert!(found.omega.len() > 15);
        for (k, j) in (0..8).flat_map(|k| (0..4).map(move |j| (k, j))) {
            let element = found.element(k, j);
            for (value, coherence) in element.value.iter().zip(&element.coherence) {
                assert_relative_eq!(value.re, gain(k, j), epsilon = 1e-6);
                assert_relative_eq!(value.im, 0.0, epsilon = 1e-6);
                assert!(*coherence > 0.999_999);
            }
            let exact = |_| Complex64::new(gain(k, j), 0.0);
            assert!(mismatch(&element, exact).unwrap() < 1e-6);
        }
        // Two decibels everywhere cost 20 · 0.9975 · 4 at full coherence.
        let off = |_| Complex64::new(gain(1, 0) * 10f64.powf(0.1), 0.0);
        let cost = mismatch(&found.element(1, 0), off).unwrap();
        assert_relative_eq!(cost, 80.0, max_relative = 0.01);
    }

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
