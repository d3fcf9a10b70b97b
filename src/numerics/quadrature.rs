//! Quadrature rules.

use std::f64::consts::PI;

/// Nodes and weights of the Gauss–Legendre rule of `count` points on
/// [low, high], nodes increasing: exact for polynomials of degree
/// 2·count − 1. No points give an empty rule.
pub fn gauss_legendre(low: f64, high: f64, count: usize) -> Vec<(f64, f64)> {
    let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
    (0..count)
        .map(|i| {
            // Zeros of the Legendre polynomial P_n by Newton's method from
            // the usual asymptotic start.
            let n = count as f64;
            let mut x = -((i as f64 + 0.75) / (n + 0.5) * PI).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (value, derivative) = legendre(count, x);
                slope = derivative;
                let step = value / derivative;
                x -= step;
                if step.abs() < 1e-15 {
                    slope = legendre(count, x).1;
                    break;
                }
            }
            let weight = 2.0 / ((1.0 - x * x) * slope * slope);
            (center + half * x, half * weight)
        })
        .collect()
}

/// P_n(x) and P_n'(x) by the three-term recurrence, |x| < 1.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    if n == 0 {
        return (1.0, 0.0);
    }
    for k in 2..=n {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
    }
    (value, n as f64 * (before - x * value) / (1.0 - x * x))
}

/// Cosines and sines of `count` equally spaced azimuths from 0. Equal weights
/// 2π/count on them integrate smooth periodic functions with spectral
/// accuracy.
pub fn periodic_nodes(count: usize) -> Vec<(f64, f64)> {
    (0..count)
        .map(|k| {
            let (sin, cos) = (2.0 * PI * k as f64 / count as f64).sin_cos();
            (cos, sin)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_rules_are_exact_to_their_degree_and_no_further() {
        for count in 1..=40 {
            let rule = gauss_legendre(-1.0, 1.0, count);
            let moment = |degree: usize| -> f64 {
                rule.iter().map(|(x, w)| w * x.powi(degree as i32)).sum()
            };
            for degree in 0..2 * count {
                let exact = if degree % 2 == 0 { 2.0 / (degree as f64 + 1.0) } else { 0.0 };
                assert!((moment(degree) - exact).abs() < 1e-14, "{count} {degree}");
            }
            if count < 12 {
                let degree = 2 * count;
                assert!((moment(degree) - 2.0 / (degree as f64 + 1.0)).abs() > 1e-9);
            }
        }
    }

    #[test]
    fn gauss_rules_move_to_other_intervals() {
        let integral: f64 = gauss_legendre(0.5, 3.0, 20).iter().map(|(x, w)| w * x.ln()).sum();
        let exact = (3.0 * 3.0f64.ln() - 3.0) - (0.5 * 0.5f64.ln() - 0.5);
        assert!((integral - exact).abs() < 1e-14);
        assert!(gauss_legendre(0.0, 1.0, 0).is_empty());
    }

    #[test]
    fn equal_weights_converge_spectrally_on_a_circle() {
        // ∮ dψ/(1 + e²− 2e cos ψ) = 2π/(1 − e²); n points err by eⁿ.
        let e = 0.5f64;
        let rule = periodic_nodes(64);
        let sum: f64 = rule.iter().map(|(c, _)| 1.0 / (1.0 + e * e - 2.0 * e * c)).sum();
        let integral = sum * 2.0 * PI / 64.0;
        assert!((integral - 2.0 * PI / (1.0 - e * e)).abs() < 1e-13);
    }
}
