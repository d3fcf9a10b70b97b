//! Fixed-step explicit Runge–Kutta integration of known order.
//!
//! Written over [`Scalar`], so that tangents of the solution with respect to
//! its start and parameters come from the same steps: they are the exact
//! derivatives of the discrete solution, not an approximation beside it.

use crate::numerics::scalar::Scalar;

/// An explicit Runge–Kutta method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// Name for reports.
    pub name: &'static str,
    /// Order of convergence on smooth problems.
    pub order: u32,
    /// Nodes c.
    pub nodes: &'static [f64],
    /// Rows of the strictly lower triangle of A.
    pub stages: &'static [&'static [f64]],
    /// Weights b.
    pub weights: &'static [f64],
    /// Weights b̂ of a second sum of the same stages that is nearer the truth
    /// over a whole period of a periodic solution, if there are any. There the
    /// end of a step is the start of another, so that what belongs to the end
    /// may stand with the first stage. The sum of h(b̂ − b)k over a period
    /// estimates the error of that period.
    pub periodic_weights: Option<&'static [f64]>,
}

/// The classical method of order 4.
pub const RUNGE_KUTTA_4: Method = Method {
    name: "classical Runge–Kutta of order 4",
    order: 4,
    nodes: &[0.0, 0.5, 0.5, 1.0],
    stages: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    periodic_weights: None,
};

/// Kutta's 3/8 rule, of order 4. Along a periodic orbit most of the error is
/// that of a quadrature, and this rule's nodes lie evenly: with equal weights
/// on them it would be the trapezoid rule, which over a period is right to all
/// harmonics that the nodes resolve. The 3/8 weights are nearer to equal than
/// those of the classical method, so that the error is two to three times
/// less for the same work.
///
/// The second weights are those of the trapezoid rule, 1/6, 1/3, 1/3, 1/6. The
/// last belongs to the end of the step, which the fourth stage sees but
/// roughly; a third of it is taken from the first stage of the next step, with
/// which what is left of order 3 becomes a total derivative, h³x‴/108, and
/// vanishes over a period. What both sums share, an error of order 4 of the
/// stages themselves, their difference does not see.
pub const KUTTA_3_8: Method = Method {
    name: "Kutta's 3/8 rule of order 4",
    order: 4,
    nodes: &[0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0],
    stages: &[&[], &[1.0 / 3.0], &[-1.0 / 3.0, 1.0], &[1.0, -1.0, 1.0]],
    weights: &[0.125, 0.375, 0.375, 0.125],
    periodic_weights: Some(&[1.0 / 6.0 + NEXT_STEP, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0 - NEXT_STEP]),
};

/// Part of the trapezoid rule's last weight that [`KUTTA_3_8`] takes from the
/// next step.
const NEXT_STEP: f64 = 1.0 / 18.0;

const S: f64 = 4.582_575_694_955_840_006_588_047_193_728;

/// Cooper and Verner's method of order 8 with 11 stages (SIAM J. Numer. Anal.
/// 9, 1972).
pub const COOPER_VERNER_8: Method = Method {
    name: "Cooper–Verner of order 8",
    order: 8,
    nodes: &[
        0.0,
        0.5,
        0.5,
        (7.0 + S) / 14.0,
        (7.0 + S) / 14.0,
        0.5,
        (7.0 - S) / 14.0,
        (7.0 - S) / 14.0,
        0.5,
        (7.0 + S) / 14.0,
        1.0,
    ],
    stages: &[
        &[],
        &[0.5],
        &[0.25, 0.25],
        &[1.0 / 7.0, (-7.0 - 3.0 * S) / 98.0, (21.0 + 5.0 * S) / 49.0],
        &[(11.0 + S) / 84.0, 0.0, (18.0 + 4.0 * S) / 63.0, (21.0 - S) / 252.0],
        &[
            (5.0 + S) / 48.0,
            0.0,
            (9.0 + S) / 36.0,
            (-231.0 + 14.0 * S) / 360.0,
            (63.0 - 7.0 * S) / 80.0,
        ],
        &[
            (10.0 - S) / 42.0,
            0.0,
            (-432.0 + 92.0 * S) / 315.0,
            (633.0 - 145.0 * S) / 90.0,
            (-504.0 + 115.0 * S) / 70.0,
            (63.0 - 13.0 * S) / 35.0,
        ],
        &[1.0 / 14.0, 0.0, 0.0, 0.0, (14.0 - 3.0 * S) / 126.0, (13.0 - 3.0 * S) / 63.0, 1.0 / 9.0],
        &[
            1.0 / 32.0,
            0.0,
            0.0,
            0.0,
            (91.0 - 21.0 * S) / 576.0,
            11.0 / 72.0,
            (-385.0 - 75.0 * S) / 1152.0,
            (63.0 + 13.0 * S) / 128.0,
        ],
        &[
            1.0 / 14.0,
            0.0,
            0.0,
            0.0,
            1.0 / 9.0,
            (-733.0 - 147.0 * S) / 2205.0,
            (515.0 + 111.0 * S) / 504.0,
            (-51.0 - 11.0 * S) / 56.0,
            (132.0 + 28.0 * S) / 245.0,
        ],
        &[
            0.0,
            0.0,
            0.0,
            0.0,
            (-42.0 + 7.0 * S) / 18.0,
            (-18.0 + 28.0 * S) / 45.0,
            (-273.0 - 53.0 * S) / 72.0,
            (301.0 + 53.0 * S) / 72.0,
            (28.0 - 28.0 * S) / 45.0,
            (49.0 - 7.0 * S) / 18.0,
        ],
    ],
    weights: &[0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 49.0 / 180.0, 16.0 / 45.0, 49.0 / 180.0, 0.05],
    periodic_weights: None,
};

/// Storage of an integration, allocated once.
#[derive(Debug, Clone)]
pub struct Integrator<T> {
    method: Method,
    rates: Vec<Vec<T>>,
    stage: Vec<T>,
    /// Sum of h(b̂ − b)k over the steps taken, where it is asked for.
    estimate: Option<Vec<T>>,
}

impl<T: Scalar> Integrator<T> {
    /// Storage for states of the given dimension.
    #[must_use]
    pub fn new(method: Method, dimension: usize) -> Self {
        Self {
            method,
            rates: vec![vec![T::default(); dimension]; method.stages.len()],
            stage: vec![T::default(); dimension],
            estimate: None,
        }
    }

    /// As [`Integrator::new`], and sums up the estimate of the error that the
    /// method's second weights give, where it has them.
    #[must_use]
    pub fn estimating(method: Method, dimension: usize) -> Self {
        let estimate = method.periodic_weights.map(|_| vec![T::default(); dimension]);
        Self { estimate, ..Self::new(method, dimension) }
    }

    /// What the end state would gain from the second weights over all steps
    /// taken so far: an estimate of minus its error where that was one period.
    #[must_use]
    pub fn estimate(&self) -> Option<&[T]> {
        self.estimate.as_deref()
    }

    /// Moves `state` one step of length `step` on from `time`. `rates` writes
    /// the rates of a time and a state.
    #[inline(always)]
    pub fn step(
        &mut self,
        time: f64,
        step: f64,
        state: &mut [T],
        mut rates: impl FnMut(f64, &[T], &mut [T]),
    ) {
        for (index, row) in self.method.stages.iter().enumerate() {
            let (done, rest) = self.rates.split_at_mut(index);
            let at = time + self.method.nodes[index] * step;
            if index == 0 {
                rates(at, state, &mut rest[0]);
                continue;
            }
            self.stage.copy_from_slice(state);
            for (weight, rate) in row.iter().zip(done.iter()) {
                if *weight != 0.0 {
                    for (x, k) in self.stage.iter_mut().zip(rate) {
                        *x += *k * (*weight * step);
                    }
                }
            }
            rates(at, &self.stage, &mut rest[0]);
        }
        for (weight, rate) in self.method.weights.iter().zip(&self.rates) {
            if *weight != 0.0 {
                for (x, k) in state.iter_mut().zip(rate) {
                    *x += *k * (*weight * step);
                }
            }
        }
        if let (Some(sum), Some(second)) = (&mut self.estimate, self.method.periodic_weights) {
            for ((b, second), rate) in self.method.weights.iter().zip(second).zip(&self.rates) {
                for (sum, k) in sum.iter_mut().zip(rate) {
                    *sum += *k * ((second - b) * step);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::scalar::Dual;
    use approx::assert_relative_eq;

    /// A pendulum with a varying length: smooth, nonlinear, time-periodic.
    fn swing<T: Scalar>(time: f64, x: &[T], out: &mut [T]) {
        let (s, c) = x[0].sin_cos();
        out[0] = x[1];
        out[1] = -(s * (1.0 + 0.3 * (2.0 * time).cos())) - x[1] * 0.1 + c * 0.2;
    }

    fn end(method: Method, steps: usize) -> [f64; 2] {
        let mut x = [0.4, -0.1];
        let mut integrator = Integrator::new(method, 2);
        let h = 3.0 / steps as f64;
        for k in 0..steps {
            integrator.step(k as f64 * h, h, &mut x, swing);
        }
        x
    }

    /// The error falls as the stated order says.
    #[test]
    fn order_of_convergence() {
        let reference = end(COOPER_VERNER_8, 400);
        for (method, steps) in [(RUNGE_KUTTA_4, 20), (KUTTA_3_8, 20), (COOPER_VERNER_8, 5)] {
            let error = |n: usize| (end(method, n)[0] - reference[0]).abs();
            let observed = (error(steps) / error(2 * steps)).log2();
            // Leading terms may cancel here; a lower order may not be seen.
            assert!(
                observed > f64::from(method.order) - 0.5,
                "{}: observed order {observed}",
                method.name
            );
        }
    }

    /// Row sums of A are the nodes, weights sum to one.
    #[test]
    fn tableaux_are_consistent() {
        for method in [RUNGE_KUTTA_4, KUTTA_3_8, COOPER_VERNER_8] {
            for (node, row) in method.nodes.iter().zip(method.stages) {
                assert_relative_eq!(*node, row.iter().sum::<f64>(), epsilon = 1e-14);
            }
            assert_relative_eq!(method.weights.iter().sum::<f64>(), 1.0, epsilon = 1e-15);
        }
    }

    /// With what they take from the next step, the second weights are of order
    /// 2, and both conditions of order 3 are missed by the same derivative.
    #[test]
    fn second_weights_miss_order_three_by_a_total_derivative() {
        let method = KUTTA_3_8;
        let mut weights = method.periodic_weights.unwrap().to_vec();
        weights[0] -= NEXT_STEP;
        weights.push(NEXT_STEP);
        // The end of the step is a fifth stage, right to order 4.
        let nodes: Vec<f64> = method.nodes.iter().copied().chain([1.0]).collect();
        let inner: Vec<f64> = method
            .stages
            .iter()
            .map(|row| row.iter().zip(&nodes).map(|(a, c)| a * c).sum())
            .chain([0.5])
            .collect();
        let sum = |values: &[f64]| -> f64 { weights.iter().zip(values).map(|(b, v)| b * v).sum() };
        assert_relative_eq!(sum(&[1.0; 5]), 1.0, epsilon = 1e-15);
        assert_relative_eq!(sum(&nodes), 0.5, epsilon = 1e-15);
        let squares: Vec<f64> = nodes.iter().map(|c| c * c).collect();
        let miss = [0.5 * (sum(&squares) - 1.0 / 3.0), sum(&inner) - 1.0 / 6.0];
        assert_relative_eq!(miss[0], 1.0 / 108.0, epsilon = 1e-15);
        assert_relative_eq!(miss[0], miss[1], epsilon = 1e-15);
    }

    /// Over a period of a periodic force with a kink in its curvature, as an
    /// airfoil table has, the second weights tell the error of the first.
    #[test]
    fn second_weights_tell_the_error_of_a_period() {
        // |sin|³ has jumps in its third derivative. The state hardly forgets
        // within a period, as the slow states of a trim.
        let force = |time: f64| (time - 0.4).sin().abs().powi(3) + 0.1 * (4.0 * time).cos();
        let period = std::f64::consts::PI;
        let run = |method: Method, steps: usize, start: f64| {
            let mut x = [start];
            let mut integrator = Integrator::estimating(method, 1);
            let h = period / steps as f64;
            for k in 0..steps {
                let rates = |time: f64, x: &[f64], out: &mut [f64]| {
                    out[0] = force(time) - 0.03 * x[0];
                };
                integrator.step(k as f64 * h, h, &mut x, rates);
            }
            (x[0], integrator.estimate().map(|e| e[0]))
        };
        // The periodic start: the end is linear in it.
        let (zero, one) = (run(COOPER_VERNER_8, 2000, 0.0).0, run(COOPER_VERNER_8, 2000, 1.0).0);
        let start = zero / (1.0 - (one - zero));
        for steps in 8..=20 {
            let (end, estimate) = run(KUTTA_3_8, steps, start);
            let (error, estimate) = (end - start, -estimate.unwrap());
            assert!(error.abs() > 1e-7, "{steps} steps are too good a test: {error:e}");
            let ratio = estimate / error;
            assert!((0.7..1.3).contains(&ratio), "{steps} steps: {estimate:e} for {error:e}");
        }
        assert_eq!(run(RUNGE_KUTTA_4, 9, start).1, None);
    }

    /// Tangents of the end with the start against differences.
    #[test]
    fn tangents_are_derivatives_of_the_discrete_solution() {
        let run = |a: f64| {
            let mut x = [a, -0.1];
            let mut integrator = Integrator::new(RUNGE_KUTTA_4, 2);
            for k in 0..10 {
                integrator.step(0.3 * f64::from(k), 0.3, &mut x, swing);
            }
            x[1]
        };
        let mut x = [Dual::<1>::variable(0.4, 0), Dual::<1>::constant(-0.1)];
        let mut integrator = Integrator::new(RUNGE_KUTTA_4, 2);
        for k in 0..10 {
            integrator.step(0.3 * f64::from(k), 0.3, &mut x, swing);
        }
        let difference = (run(0.4 + 1e-5) - run(0.4 - 1e-5)) / 2e-5;
        assert_relative_eq!(x[1].d[0], difference, max_relative = 1e-8);
    }
}
