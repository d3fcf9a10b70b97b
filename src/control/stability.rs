//! Closed-loop eigenvalues of the full order.
//!
//! The whole loop as one matrix ([`super::closed_loop::closed_loop_matrix`]) is
//! put together here, delays by Padé approximations, and its eigenvalues are
//! judged. It shares no code with the frequency responses, so that each checks
//! the other.

use super::plant::rigid;
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
    use crate::linear::dense;
    use approx::assert_relative_eq;

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
