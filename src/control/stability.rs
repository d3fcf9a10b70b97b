//! Closed-loop eigenvalues of the full-order system as the tuning knows it.
//!
//! The whole loop as one matrix: plant, actuators, delay (Padé), sensor
//! filters, integrators, and for the outer loops command models, delayed
//! references and the reference model of the hybrid feed-forward. It shares
//! no code with the frequency responses, so that each checks the other.

use super::axis::{Axis, Channel, GainSet};
use super::loops::LawSettings;
use super::plant::{Hardware, Inversion, Plant, rigid};
use crate::linear::LinearError;
use crate::linear::dense;
use crate::units::STANDARD_GRAVITY as GRAVITY;
use nalgebra::DMatrix;
use num_complex::Complex64 as C;

/// Order of the Padé approximation of the delay by default. At order 4 the
/// phase is right to 0.01 rad up to ω T = 5.
pub const PADE_ORDER: usize = 4;

/// A signal as a linear combination of all states.
pub(super) type Signal = Vec<f64>;

/// Closed-loop system matrix under construction.
pub(super) struct Builder {
    n: usize,
    next: usize,
    /// The matrix so far.
    pub(super) a: DMatrix<f64>,
}

impl Builder {
    /// Room for so many states.
    pub(super) fn new(n: usize) -> Self {
        Self { n, next: 0, a: DMatrix::zeros(n, n) }
    }
    pub(super) fn states(&mut self, count: usize) -> usize {
        let first = self.next;
        self.next += count;
        first
    }
    pub(super) fn state(&self, k: usize) -> Signal {
        let mut s = vec![0.0; self.n];
        s[k] = 1.0;
        s
    }
    pub(super) fn zero(&self) -> Signal {
        vec![0.0; self.n]
    }
    /// Adds `by`·signal to the derivative of a state.
    pub(super) fn feed(&mut self, state: usize, by: f64, signal: &Signal) {
        for (j, v) in signal.iter().enumerate() {
            self.a[(state, j)] += by * v;
        }
    }
    fn integral(&mut self, input: &Signal) -> Signal {
        let k = self.states(1);
        self.feed(k, 1.0, input);
        self.state(k)
    }
    /// A second-order lag; also its rate and acceleration.
    pub(super) fn second_order(
        &mut self,
        frequency: f64,
        damping: f64,
        input: &Signal,
    ) -> [Signal; 3] {
        let k = self.states(2);
        let (x, v) = (self.state(k), self.state(k + 1));
        let mut acceleration = self.zero();
        add(&mut acceleration, frequency * frequency, input);
        add(&mut acceleration, -frequency * frequency, &x);
        add(&mut acceleration, -2.0 * damping * frequency, &v);
        self.feed(k, 1.0, &v);
        self.feed(k + 1, 1.0, &acceleration);
        [x, v, acceleration]
    }
    /// Padé approximation of order (m, m) of a delay.
    pub(super) fn delay(&mut self, time: f64, order: usize, input: &Signal) -> Signal {
        if time == 0.0 || order == 0 {
            return input.clone();
        }
        // e^-x ≈ p(-x)/p(x), p = Σ c_k x^k, as first- and second-order
        // sections would lose the balance; a companion form in x = sT, scaled
        // by its own coefficients, keeps it.
        let m = order;
        let mut c = vec![1.0; m + 1];
        for k in 1..=m {
            c[k] = c[k - 1] * (m - k + 1) as f64 / ((2 * m - k + 1) as f64 * k as f64);
        }
        // Denominator q(s) = Σ c_k (sT)^k; output = (±1) input + rest.
        // States ξ_k = scaled derivatives: ξ_k' = ξ_{k+1}/T, and the last row
        // closes with c.
        let first = self.states(m);
        for k in 0..m - 1 {
            let next = self.state(first + k + 1);
            self.feed(first + k, 1.0 / time, &next);
        }
        let last = first + m - 1;
        self.feed(last, 1.0 / (time * c[m]), input);
        for (k, ck) in c.iter().take(m).enumerate() {
            let own = self.state(first + k);
            self.feed(last, -ck / (time * c[m]), &own);
        }
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut out = self.zero();
        add(&mut out, sign(m), input);
        for (k, ck) in c.iter().take(m).enumerate() {
            let own = self.state(first + k);
            add(&mut out, ck * (sign(k) - sign(m)), &own);
        }
        out
    }
}

pub(super) fn add(target: &mut Signal, by: f64, signal: &Signal) {
    for (t, v) in target.iter_mut().zip(signal) {
        *t += by * v;
    }
}

/// System matrix of the closed loop of `plant` under the law.
pub fn closed_loop_matrix(
    plant: &Plant,
    inversion: &Inversion,
    settings: &LawSettings,
    hardware: &Hardware,
    extra_delay: f64,
    gains: &GainSet,
    order: usize,
) -> DMatrix<f64> {
    let np = plant.a.nrows();
    let outer = [Channel::Vy, Channel::Vx].iter().any(|c| gains[c.index()].array() != [0.0; 3]);
    let notches = settings.notch.axes();
    let filters = 2 * notches.iter().flatten().count();
    let total =
        filters + np + 4 * (2 + order + 1) + 4 + if outer { 2 + 4 + 2 * order + 4 + 2 } else { 0 };
    let mut b = Builder::new(total);
    let x0 = b.states(np);
    for i in 0..np {
        for j in 0..np {
            b.a[(x0 + i, x0 + j)] = plant.a[(i, j)];
        }
    }
    // The sticks' hardware comes first in the state vector, fed later.
    let command = b.states(4);
    let mut sticks = Vec::with_capacity(4);
    for j in 0..4 {
        let sensed = b.state(command + j);
        let delayed = b.delay(hardware.delay + extra_delay, order, &sensed);
        let [stick, _, _] =
            b.second_order(hardware.actuator_bandwidth, hardware.actuator_damping, &delayed);
        sticks.push(stick);
    }
    for i in 0..np {
        for (j, stick) in sticks.iter().enumerate() {
            b.feed(x0 + i, plant.b[(i, j)], stick);
        }
    }
    let measured: Vec<Signal> = plant.measured.iter().map(|&k| b.state(x0 + k)).collect();
    let combine = |b: &Builder, row: &dyn Fn(usize) -> f64| {
        let mut s = b.zero();
        for (k, m) in measured.iter().enumerate() {
            add(&mut s, row(k), m);
        }
        s
    };
    let (velocity, attitude) = inversion.split_feedback();
    let f_kappa = attitude + velocity * settings.kappa;
    // What commands ask for goes through B_d⁻¹, what feedback asks for through M.
    let mut commanded: Vec<Signal> = vec![b.zero(); 4];
    let mut nu: Vec<Signal> = Vec::with_capacity(4);
    for axis in Axis::ALL {
        let i = axis.index();
        let k = gains[Channel::from(axis).index()];
        let output = combine(&b, &|j| inversion.outputs[(i, j)]);
        let rate = combine(&b, &|j| inversion.rates[(i, j)]);
        let mut error_integral_rate = b.zero();
        add(&mut error_integral_rate, -1.0, &output);
        let integral = b.integral(&error_integral_rate);
        let mut s = b.zero();
        add(&mut s, -k.k_p, &output);
        add(&mut s, -k.k_d, &rate);
        add(&mut s, k.k_i, &integral);
        nu.push(s);
    }
    let integrals = b.next - 4;
    if outer {
        let mut references: Vec<[Signal; 3]> = Vec::new();
        for (i, (axis, channel, row, sign)) in
            [(Axis::Roll, Channel::Vy, 1, -1.0), (Axis::Pitch, Channel::Vx, 0, 1.0)]
                .into_iter()
                .enumerate()
        {
            let k = gains[channel.index()];
            let v = combine(&b, &|j| inversion.ground_velocity[(row, j)]);
            let integral = b.integral(&v);
            let mut attitude_command = b.zero();
            add(&mut attitude_command, sign * k.k_p / GRAVITY, &v);
            add(&mut attitude_command, sign * k.k_i / GRAVITY, &integral);
            let wn =
                if axis == Axis::Roll { settings.roll_frequency } else { settings.pitch_frequency };
            let reference = b.second_order(wn, settings.attitude_damping, &attitude_command);
            let late = b.delay(settings.reference_delay, order, &attitude_command);
            let delayed = b.second_order(wn, settings.attitude_damping, &late);
            let inner = gains[Channel::from(axis).index()];
            add(&mut commanded[i], 1.0, &reference[2]);
            add(&mut nu[i], inner.k_d, &delayed[1]);
            add(&mut nu[i], inner.k_p, &delayed[0]);
            b.feed(integrals + i, 1.0, &delayed[0]);
            references.push(reference);
        }
        // Reference model: horizontal velocities under these commands.
        let z = b.states(2);
        let r = &inversion.reference;
        let mut ideal: Vec<Signal> = Vec::with_capacity(8);
        for k in 0..8 {
            let mut s = b.zero();
            for (j, reference) in references.iter().enumerate().take(2) {
                let own = b.state(z + j);
                add(&mut s, r.state[(k, j)], &own);
                add(&mut s, r.input[(k, j)], &reference[0]);
                add(&mut s, r.input[(k, 2 + j)], &reference[1]);
            }
            ideal.push(s);
        }
        for j in 0..2 {
            for (k, s) in ideal.iter().enumerate() {
                b.feed(z + j, r.dynamics[(j, k)], s);
            }
            for (i, reference) in references.iter().enumerate() {
                b.feed(z + j, r.drive[(j, i)], &reference[2]);
            }
        }
        if settings.hybrid_feedforward {
            for (i, (command, error)) in commanded.iter_mut().zip(&mut nu).enumerate() {
                for (k, s) in ideal.iter().enumerate() {
                    add(command, -inversion.feedback[(i, k)], s);
                    add(error, f_kappa[(i, k)], s);
                }
            }
        }
    }
    // δ = B_d⁻¹ (ν_c − F x_ref) + M (ν_e − F_κ (x − x_ref)), then the sensor filter.
    for (i, signal) in nu.iter_mut().enumerate() {
        let f = combine(&b, &|j| f_kappa[(i, j)]);
        add(signal, -1.0, &f);
        if let Some(notch) = notches[i] {
            let [_, rate, _] = b.second_order(notch.frequency, notch.damping, signal);
            let blocked = 2.0 * notch.damping * (1.0 - notch.depth) / notch.frequency;
            add(signal, -blocked, &rate);
        }
    }
    for j in 0..4 {
        let own = b.state(command + j);
        b.feed(command + j, -hardware.sensor_bandwidth, &own);
        let by = hardware.sensor_bandwidth;
        for (i, (asked, error)) in commanded.iter().zip(&nu).enumerate() {
            b.feed(command + j, by * inversion.allocation[(j, i)], error);
            b.feed(command + j, by * inversion.decoupling[(j, i)], asked);
        }
    }
    debug_assert_eq!(b.next, total);
    b.a
}

/// Eigenvalues of the closed loop.
#[allow(clippy::too_many_arguments)]
pub fn closed_loop_eigenvalues(
    plant: &Plant,
    inversion: &Inversion,
    settings: &LawSettings,
    hardware: &Hardware,
    extra_delay: f64,
    gains: &GainSet,
    order: usize,
) -> Result<Vec<C>, LinearError> {
    dense::eigenvalues(&closed_loop_matrix(
        plant,
        inversion,
        settings,
        hardware,
        extra_delay,
        gains,
        order,
    ))
}

/// Largest real part, 1/s.
pub fn growth(eigenvalues: &[C]) -> f64 {
    eigenvalues.iter().map(|e| e.re).fold(f64::NEG_INFINITY, f64::max)
}

/// The measured state with the largest share in a mode of a closed loop, by its
/// place among [`RIGID_STATES`](super::plant::RIGID_STATES); a velocity of
/// 9.8 m/s counts like 1 rad or 1 rad/s. `None` where the eigenvector cannot be
/// found.
pub fn leading_state(a: &DMatrix<f64>, measured: &[usize; 8], eigenvalue: C) -> Option<usize> {
    let n = a.nrows();
    // One step of inverse iteration beside the eigenvalue.
    let beside = eigenvalue + C::new(1e-9 * (1.0 + eigenvalue.norm()), 0.0);
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        let own = if i == j { beside } else { C::new(0.0, 0.0) };
        C::new(a[(i, j)], 0.0) - own
    });
    let start = nalgebra::DVector::from_fn(n, |k, _| C::new(1.0 + k as f64 / n as f64, 0.0));
    let factors = shifted.lu();
    let first = factors.solve(&start)?;
    let first = first.unscale(first.norm());
    let vector = factors.solve(&first)?;
    let share = |k: usize| {
        let unit = if k < rigid::P { GRAVITY } else { 1.0 };
        vector[measured[k]].norm() / unit
    };
    (0..8).filter(|&k| share(k).is_finite()).max_by(|&i, &j| share(i).total_cmp(&share(j)))
}

/// Least damping ratio of the oscillating modes below a frequency, rad/s.
pub fn least_damping(eigenvalues: &[C], below: f64) -> Option<f64> {
    eigenvalues
        .iter()
        .filter(|e| e.im > 0.0 && e.norm() < below)
        .map(|e| -e.re / e.norm())
        .reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::loops::LoopModel;
    use crate::control::testbed;
    use crate::control::tuning::start_gains;
    use approx::assert_relative_eq;

    /// det(sI − A_cl) over det(sI − A_open) is det(I + Λ(s)): the matrix and
    /// the frequency responses describe the same loop. Checked on jω with the
    /// Padé delay of high order, with and without the outer loops.
    #[test]
    fn matrix_and_frequency_response_are_the_same_loop() {
        let settings = LawSettings {
            kappa: 0.25,
            hybrid_feedforward: true,
            reference_delay: 0.1,
            roll_frequency: 2.0,
            pitch_frequency: 1.7,
            attitude_damping: 0.8,
            yaw_time_constant: 0.5,
            heave_time_constant: 2.0,
            notch: Default::default(),
        };
        for speed in [0.0, 25.0] {
            let plant = testbed::plant(speed, &testbed::NOMINAL);
            let inversion = Inversion::new(&plant).unwrap();
            let mut gains = GainSet::default();
            for c in Channel::ALL {
                gains[c.index()] = start_gains(c, 0.152, [0.0, 10.0]);
            }
            for outer in [false, true] {
                let mut on = gains;
                if !outer {
                    on[4] = Default::default();
                    on[5] = Default::default();
                }
                let omega: Vec<f64> = vec![0.3, 1.0, 2.5, 6.0];
                let model = LoopModel::new(
                    &plant,
                    &inversion,
                    &settings,
                    testbed::HARDWARE,
                    0.0,
                    omega.clone().into(),
                )
                .unwrap();
                let direct = model.determinant(&on);
                // The open loop: all feedback removed, the same states.
                let closed = closed_loop_matrix(
                    &plant,
                    &inversion,
                    &settings,
                    &testbed::HARDWARE,
                    0.0,
                    &on,
                    6,
                );
                let mut open = closed.clone();
                let np = plant.a.nrows();
                for j in 0..4 {
                    for k in 0..closed.ncols() {
                        if k != np + j {
                            open[(np + j, k)] = 0.0;
                        }
                    }
                    open[(np + j, np + j)] = -testbed::HARDWARE.sensor_bandwidth;
                }
                for (w, d) in omega.iter().zip(&direct) {
                    let det = |a: &DMatrix<f64>| {
                        let m = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| {
                            C::new(-a[(i, j)], if i == j { *w } else { 0.0 })
                        });
                        m.lu().determinant()
                    };
                    let ratio = det(&closed) / det(&open);
                    assert_relative_eq!(ratio.re, d.re, max_relative = 1e-4, epsilon = 1e-4);
                    assert_relative_eq!(ratio.im, d.im, max_relative = 1e-4, epsilon = 1e-4);
                }
            }
        }
    }

    /// Two blocks: the growing one holds v and a state that is not measured.
    #[test]
    fn a_growing_mode_is_named_by_its_state() {
        let mut a = DMatrix::from_diagonal_element(9, 9, -1.0);
        a[(1, 1)] = 0.03;
        a[(8, 1)] = 5.0;
        a[(6, 1)] = 0.01;
        let measured = std::array::from_fn(|k| k);
        let values = dense::eigenvalues(&a).unwrap();
        let growing = values.iter().find(|e| e.re > 0.0).unwrap();
        assert_relative_eq!(growing.re, 0.03, max_relative = 1e-9);
        assert_eq!(leading_state(&a, &measured, *growing), Some(rigid::V));
    }

    /// Padé of a pure delay in front of an integrator: the critical gain of
    /// k e^(-sT)/s is π/(2T).
    #[test]
    fn val_delay_reaches_the_critical_gain() {
        let t = 0.2;
        let growth_at = |k: f64| {
            let mut b = Builder::new(1 + PADE_ORDER);
            let x = b.states(1);
            let input = b.state(x);
            let late = b.delay(t, PADE_ORDER, &input);
            b.feed(x, -k, &late);
            growth(&dense::eigenvalues(&b.a).unwrap())
        };
        let critical = std::f64::consts::PI / (2.0 * t);
        assert!(growth_at(critical * 0.999) < 0.0);
        assert!(growth_at(critical * 1.001) > 0.0);
    }
}
