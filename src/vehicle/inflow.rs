//! Dynamic inflow of one rotor: Pitt–Peters states with the mass flow and
//! wake strengths of the combined momentum and simple vortex theory (CMTSVT).
//!
//! In the rotor's own hub frame, inflow harmonics go with azimuth, so their
//! plane has axes (aft, starboard). There the skew of the wake is the vector
//! **X** = tan(χ/2) · (downstream direction), at most 1 long, and every matrix
//! of the theory is a polynomial in it: hover, **X** = 0, is no special case,
//! and no wind frame with its undefined heading is needed.
//!
//! With n = λ − μ_z the flow through the disk (λ the rotor's own uniform
//! inflow, or the total one), V_T = √(μ² + n²) and V_m = V_T + nλ/V_T:
//!
//! * **X** = **μ**/(V_T + |n|), since tan(χ/2) = sin χ/(1 + cos χ);
//! * static gain L = L̂ diag(1/V_T, 1/V_m, 1/V_m),
//!   L̂ = [[1/2, −k **X**ᵀ], [k **X**, 2(1 + X²) I − 4 **X** **X**ᵀ]], k = 15π/64;
//! * λ_s' = Ω M⁻¹(C − L⁻¹ λ_s), M = diag(8/3π, 16/45π, 16/45π),
//!   C = (C_T, −C_M, −C_L), aerodynamic loads only;
//! * circulation of the wake, from ℓ = L⁻¹ λ_s and μ⊥ the advance ratio turned
//!   a quarter to the advancing side: Γ_0 = (ℓ_0 − 3 μ⊥·**ℓ**)/(V_T(1 − 1.5 μ²)),
//!   **Γ** = 3**ℓ**/V_T − 1.5 μ⊥ Γ_0.

use crate::numerics::scalar::{Local, Scalar};
use crate::problem::MassFlow;
use std::f64::consts::PI;

/// Coupling k of uniform and fore-and-aft inflow.
const COUPLING: f64 = 15.0 * PI / 64.0;
/// Apparent mass of uniform inflow.
pub const APPARENT_MASS_UNIFORM: f64 = 8.0 / (3.0 * PI);
/// Apparent mass of the first harmonics.
pub const APPARENT_MASS_HARMONIC: f64 = 16.0 / (45.0 * PI);
/// |n| is rounded off within this inflow ratio, so that the skew stays smooth
/// where the flow through the disk changes sign.
const FLOW_ROUNDING: f64 = 1e-6;
/// Smallest V_T: below it there is no momentum theory (a rotor without thrust
/// in still air).
const SMALLEST_MASS_FLOW: f64 = 1e-6;

/// What the inflow of a rotor does: the load that balances it, the wake's
/// circulation, and the skew of the wake.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wake<S> {
    /// L⁻¹ λ_s: the loads (C_T, −C_M, −C_L) that would hold λ_s.
    pub balance: [S; 3],
    /// Circulation Γ_0, Γ_1c, Γ_1s around the rim of the wake, on ΩR.
    pub circulation: [S; 3],
    /// Skew vector **X** = tan(χ/2) × downstream, axes (aft, starboard).
    pub skew: [S; 2],
}

/// Wake of a rotor as a local function of (μ_aft, μ_starboard, μ_z, λ_s0,
/// λ_s1c, λ_s1s, λ_0), the advance ratios downstream.
pub(super) struct WakeOf {
    pub mass_flow: MassFlow,
}

impl Local<7, 8> for WakeOf {
    #[inline(always)]
    fn evaluate<T: Scalar>(&self, input: &[T; 7]) -> [T; 8] {
        let [mc, ms, mz, a, bc, bs, total] = *input;
        let uniform = match self.mass_flow {
            MassFlow::SelfInduced => a,
            MassFlow::Total => total,
        };
        let n = uniform - mz;
        let mu2 = mc * mc + ms * ms;
        let floor = SMALLEST_MASS_FLOW * SMALLEST_MASS_FLOW;
        let v_t = (mu2 + n * n + floor).sqrt();
        let v_m = v_t + n * uniform / v_t;
        let reach = v_t + (n * n + FLOW_ROUNDING * FLOW_ROUNDING).sqrt();
        let (xc, xs) = (mc / reach, ms / reach);
        let x2 = xc * xc + xs * xs;
        let one = T::constant(1.0);

        // L̂ g = (a, b) solved in closed form through h = X·g.
        let h = (xc * bc + xs * bs - x2 * a * (2.0 * COUPLING))
            / ((one - x2) * 2.0 + x2 * (2.0 * COUPLING * COUPLING));
        let g0 = a * 2.0 + h * (2.0 * COUPLING);
        let along = h * 4.0 - g0 * COUPLING;
        let spread = one / ((x2 + 1.0) * 2.0);
        let (gc, gs) = ((bc + xc * along) * spread, (bs + xs * along) * spread);
        let balance = [g0 * v_t, gc * v_m, gs * v_m];

        // The advancing side lies a quarter turn on from downstream.
        let (pc, ps) = (-ms, mc);
        let inverse = one / v_t;
        let gamma_0 =
            (balance[0] - (pc * balance[1] + ps * balance[2]) * 3.0) * inverse / (one - mu2 * 1.5);
        let gamma_c = balance[1] * inverse * 3.0 - pc * gamma_0 * 1.5;
        let gamma_s = balance[2] * inverse * 3.0 - ps * gamma_0 * 1.5;
        [balance[0], balance[1], balance[2], gamma_0, gamma_c, gamma_s, xc, xs]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn wake(input: [f64; 7]) -> [f64; 8] {
        WakeOf { mass_flow: MassFlow::SelfInduced }.evaluate(&input)
    }

    /// Momentum theory in hover: λ = √(C_T/2), Γ_0 = 2λ.
    #[test]
    fn hover_balance_is_momentum_theory() {
        let lambda = 0.036;
        let w = wake([0.0, 0.0, 0.0, lambda, 0.0, 0.0, lambda]);
        assert_relative_eq!(w[0], 2.0 * lambda * lambda, max_relative = 1e-6);
        assert_relative_eq!(w[3], 2.0 * lambda, max_relative = 1e-6);
        assert_eq!((w[6], w[7]), (0.0, 0.0));
    }

    /// Glauert's high-speed limit: λ = C_T/(2μ), and the wake's skew of a
    /// quarter turn, |X| → 1.
    #[test]
    fn fast_flight_is_glauert() {
        let (mu, lambda) = (0.3, 0.004);
        let w = wake([mu, 0.0, 0.0, lambda, 15.0 * PI / 32.0 * lambda, 0.0, lambda]);
        assert_relative_eq!(w[0], 2.0 * mu * lambda, max_relative = 0.03);
        assert_relative_eq!(w[6], 1.0, max_relative = 0.02);
        // The fore-and-aft gradient 15π/32 X λ of Pitt and Peters needs no moment.
        assert!(w[1].abs() < 0.03 * w[0]);
    }

    /// The closed-form inverse against L assembled in wind axes.
    #[test]
    fn inverse_is_the_inverse_of_pitt_peters() {
        let (mu, heading, mz, lambda) = (0.08_f64, 0.7_f64, -0.01, [0.03, 0.012, -0.02]);
        let (ch, sh) = (heading.cos(), heading.sin());
        let w = wake([mu * ch, mu * sh, mz, lambda[0], lambda[1], lambda[2], lambda[0]]);
        let n = lambda[0] - mz;
        let v_t = (mu * mu + n * n).sqrt();
        let v_m = (mu * mu + n * (2.0 * lambda[0] - mz)) / v_t;
        let chi = mu.atan2(n);
        let x = (chi / 2.0).tan();
        // Loads in wind axes, times the static gain, turned back.
        let (lw, ls) = (w[1] * ch + w[2] * sh, -w[1] * sh + w[2] * ch);
        let c = chi.cos();
        let l0 = 0.5 * w[0] / v_t - COUPLING * x * lw / v_m;
        let lc = COUPLING * x * w[0] / v_t + 4.0 * c / (1.0 + c) * lw / v_m;
        let lp = 4.0 / (1.0 + c) * ls / v_m;
        assert_relative_eq!(l0, lambda[0], max_relative = 1e-6);
        assert_relative_eq!(lc * ch - lp * sh, lambda[1], max_relative = 1e-6);
        assert_relative_eq!(lc * sh + lp * ch, lambda[2], max_relative = 1e-6);
        // Circulation by the printed matrix in wind axes.
        let d = 1.0 - 1.5 * mu * mu;
        let g0 = (w[0] - 3.0 * mu * ls) / (v_t * d);
        let gp = (-1.5 * mu * w[0] + 3.0 * ls) / (v_t * d);
        let gw = 3.0 * lw / v_t;
        assert_relative_eq!(w[3], g0, max_relative = 1e-6);
        assert_relative_eq!(w[4], gw * ch - gp * sh, max_relative = 1e-6);
        assert_relative_eq!(w[5], gw * sh + gp * ch, max_relative = 1e-6);
    }
}
