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
//!
//! # Descent
//! Momentum theory has no answer where the air that the rotor moves meets the
//! flow: in axial descent between hover and twice the induced velocity. There
//! V_T grows by a measured amount. With q = μ_z/λ, the rate of descent over the
//! induced velocity, V_T² = μ² + n² + λ² e(q) w(μ²/λ²). In axial flight that
//! makes of C_T = 2 λ V_T any relation of induced velocity and rate of descent:
//! e follows the fit v_i/v_h = 1 − 1.125x − 1.372x² − 1.718x³ − 0.655x⁴,
//! x = −V_d/v_h, of J. G. Leishman (Principles of Helicopter Aerodynamics) to
//! the measurements of W. Castles and R. B. Gray (NACA TN 2474, 1951), scaled
//! level flight, and falls to nearly nothing at the end of the fit, x = −2, where the
//! windmill-brake state begins, and to zero at q = 2.31. Every thrust has but one
//! induced velocity. w fades it out up to μ = λ: with that much
//! edgewise flow momentum theory holds.
//!
//! V_m is ∂(λV_T)/∂λ, as it is in level flight.

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

/// Where e(q) begins, and the distance of its knots.
const DESCENT: [f64; 2] = [0.03, 0.12];
/// Coefficients of e(q): uniform cubic B-splines, the first from the first knot
/// on. Least squares to the fit up to x = −1.99, little bending and zero from
/// q = 2.05 on.
const EXCESS: [f64; 16] = [
    -0.2603, -0.1014, -0.132, -0.0837, -0.0045, 0.0568, 0.101, 0.1254, 0.1358, 0.1311, 0.1154,
    0.0914, 0.0614, 0.0295, 0.0068, -0.0014,
];
/// From this q on a descent is in the vortex-ring state: x ≈ −0.4.
const VORTEX_RING_FROM: f64 = 0.3;

/// State of the flow through a rotor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FlowState {
    /// The wake leaves downward: hover, climb, slow descent, forward flight.
    #[default]
    Normal,
    /// The flow meets the wake at the disk: thrust and inflow are unsteady, and
    /// what is computed is a measured mean.
    VortexRing,
    /// The flow passes upward, slower than the wake would: as above.
    TurbulentWake,
    /// The flow passes upward and drives the rotor.
    Windmill,
}

impl FlowState {
    /// From mean ratios to the tip speed: edgewise and axial speed of the hub
    /// (positive in descent), and uniform inflow λ. The limits are those of the
    /// textbook, V + v = 0 and V + 2v = 0, and hold up to an edgewise speed of
    /// the hover value of the induced velocity.
    #[must_use]
    pub fn of(edgewise: f64, descent: f64, inflow: f64) -> Self {
        let q = descent / inflow;
        if !q.is_finite() || q < VORTEX_RING_FROM {
            return Self::Normal;
        }
        let (e, _) = excess(q);
        let v_t = (edgewise * edgewise + (inflow - descent).powi(2) + inflow * inflow * e.max(0.0))
            .sqrt();
        let steep = edgewise < (inflow.abs() * v_t).sqrt();
        match (steep, q) {
            (true, q) if q < 1.0 => Self::VortexRing,
            (true, q) if q < 2.0 => Self::TurbulentWake,
            (_, q) if q < 1.0 => Self::Normal,
            _ => Self::Windmill,
        }
    }

    /// One word for tables and files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::VortexRing => "vortex_ring",
            Self::TurbulentWake => "turbulent_wake",
            Self::Windmill => "windmill",
        }
    }
}

/// e(q) and its derivative.
#[inline(always)]
fn excess<T: Scalar>(q: T) -> (T, T) {
    let [first, distance] = DESCENT;
    let place = (q - first) * (1.0 / distance);
    let interval = place.value().floor();
    let t = place + -interval;
    let u = t * -1.0 + 1.0;
    let (t2, u2) = (t * t, u * u);
    // The four splines on an interval, that which began first first, and their
    // derivatives.
    let values = [
        u2 * u * (1.0 / 6.0),
        (t2 * t * 3.0 - t2 * 6.0 + 4.0) * (1.0 / 6.0),
        (u2 * u * 3.0 - u2 * 6.0 + 4.0) * (1.0 / 6.0),
        t2 * t * (1.0 / 6.0),
    ];
    let slopes = [u2 * -0.5, t2 * 1.5 - t * 2.0, u * 2.0 - u2 * 1.5, t2 * 0.5];
    let [mut e, mut slope] = [T::default(); 2];
    for k in 0..4 {
        let index = interval as isize - 3 + k as isize;
        if let Some(&c) = usize::try_from(index).ok().and_then(|index| EXCESS.get(index)) {
            e += values[k] * c;
            slope += slopes[k] * (c / distance);
        }
    }
    (e, slope)
}

/// What descent adds to V_T², and half the derivative of that with λ; none
/// where momentum theory stands alone.
#[inline(always)]
fn descent_excess<T: Scalar>(mu2: T, descent: T, inflow: T) -> Option<(T, T)> {
    let [first, distance] = DESCENT;
    let last = first + distance * (EXCESS.len() + 3) as f64;
    let (v, l) = (descent.value(), inflow.value());
    let inside = v * l > first * l * l && v * l < last * l * l && mu2.value() < l * l;
    if !inside {
        return None;
    }
    let one = T::constant(1.0);
    let q = descent / inflow;
    let square = inflow * inflow;
    let m = mu2 / square;
    let (e, e_q) = excess(q);
    let rest = one - m;
    let fade = rest * rest * rest;
    let fade_m = rest * rest * -3.0;
    let half = (e * 2.0 - q * e_q) * fade - m * e * fade_m * 2.0;
    Some((square * e * fade, inflow * half * 0.5))
}

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
        let (v_t, v_m) = match descent_excess(mu2, mz, uniform) {
            None => {
                let v_t = (mu2 + n * n + floor).sqrt();
                (v_t, v_t + n * uniform / v_t)
            }
            Some((added, half_slope)) => {
                let v_t = (mu2 + n * n + added + floor).sqrt();
                (v_t, v_t + (n + half_slope) * uniform / v_t)
            }
        };
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
    use crate::numerics::scalar::Dual;
    use approx::assert_relative_eq;

    fn wake(input: [f64; 7]) -> [f64; 8] {
        WakeOf { mass_flow: MassFlow::SelfInduced }.evaluate(&input)
    }

    /// Induced velocity of steady axial flight over that of hover, at a rate of
    /// climb over it, by bisection of the balance C_T = B(λ).
    fn axial(climb: f64) -> f64 {
        let hover = 0.04_f64;
        let thrust = 2.0 * hover * hover;
        let balance = |l: f64| wake([0.0, 0.0, -climb * hover, l, 0.0, 0.0, l])[0] - thrust;
        let (mut low, mut high) = (1e-6, 10.0 * hover);
        assert!(balance(low) < 0.0 && balance(high) > 0.0, "{climb}");
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if balance(middle) < 0.0 { low = middle } else { high = middle }
        }
        low / hover
    }

    /// Leishman's fit to Castles and Gray's measurements, scaled to momentum
    /// theory in hover, within 5 % from hover to its end at x = −2, where the
    /// windmill-brake state begins, and momentum theory beyond and in climb.
    #[test]
    fn val_descent_follows_castles_and_gray() {
        for k in 1..=200 {
            let x = -0.01 * f64::from(k);
            let fit = 1.0 - 1.125 * x - 1.372 * x * x - 1.718 * x.powi(3) - 0.655 * x.powi(4);
            let ours = axial(x);
            let most = if !(-1.985..=-0.25).contains(&x) { 0.05 } else { 0.025 };
            assert!((ours / fit - 1.0).abs() < most, "{x}: {ours} for {fit}");
        }
        for x in [-2.05, -2.3, -3.0, -5.0] {
            let windmill = -0.5 * x - (0.25 * x * x - 1.0_f64).sqrt();
            assert_relative_eq!(axial(x), windmill, max_relative = 2e-3);
        }
        for x in [0.0, 0.5, 2.0] {
            let climb = -0.5 * x + (0.25 * x * x + 1.0_f64).sqrt();
            assert_relative_eq!(axial(x), climb, max_relative = 1e-6);
        }
    }

    /// Every thrust has one induced velocity, whatever the descent: the balance
    /// rises with the inflow wherever the correction acts, up to μ = λ. The
    /// rotor's air has no moment, so that its inflow leans with the skew.
    #[test]
    fn one_inflow_for_every_thrust() {
        for m in 0..=24 {
            let mu = 0.002 * f64::from(m);
            for v in -20..=120 {
                let mz = 0.001 * f64::from(v);
                let mut before = f64::NEG_INFINITY;
                for l in 1..=400 {
                    let lambda = 3e-4 * f64::from(l);
                    // Past the windmill's momentum theory flow no longer turns.
                    if mz > 2.0 * lambda || mu > lambda {
                        continue;
                    }
                    let skew = wake([mu, 0.0, mz, lambda, 0.0, 0.0, lambda])[6];
                    let lean = 2.0 * COUPLING * lambda * skew;
                    let [now, moment, ..] = wake([mu, 0.0, mz, lambda, lean, 0.0, lambda]);
                    assert!(moment.abs() < 1e-12, "{moment}");
                    assert!(now > before, "mu {mu}, descent {mz}, inflow {lambda}");
                    before = now;
                }
            }
        }
    }

    /// V_T and V_m are smooth where the correction begins and ends, and nothing
    /// changes at or above level flight.
    #[test]
    fn descent_joins_smoothly_and_leaves_level_flight_alone() {
        let lambda = 0.03;
        let at = |q: f64, mu: f64| wake([mu, 0.0, q * lambda, lambda, 0.004, 0.0, lambda]);
        for edge in [DESCENT[0], DESCENT[0] + DESCENT[1] * (EXCESS.len() + 3) as f64] {
            for k in [0, 1, 3] {
                let step = 1e-4;
                let slope =
                    |q: f64| (at(q + step, 0.005)[k] - at(q - step, 0.005)[k]) / (2.0 * step);
                let (below, above) = (slope(edge - 2.0 * step), slope(edge + 2.0 * step));
                assert!((below - above).abs() < 1e-2 * above.abs().max(1e-3), "{edge} {k}");
            }
        }
        for q in [-3.0, -0.2, 0.0, 0.03] {
            for mu in [0.0, 0.02, 0.2] {
                assert!(descent_excess(mu * mu, q * lambda, lambda).is_none());
            }
        }
        for mu in [0.0301, 0.2] {
            assert!(descent_excess(mu * mu, lambda, lambda).is_none());
        }
    }

    /// The correction's tangents are its derivatives.
    #[test]
    fn descent_tangents_are_derivatives() {
        let of = WakeOf { mass_flow: MassFlow::SelfInduced };
        // Not at μ_z = λ, where |n| is rounded within a step of a difference.
        for (mu, mz) in [(0.004, 0.012), (0.01, 0.033), (0.0, 0.055)] {
            let at = [mu, 0.3 * mu, mz, 0.03, 0.003, -0.002, 0.03];
            let mut dual = [Dual::<7>::default(); 7];
            for (k, variable) in dual.iter_mut().enumerate() {
                *variable = Dual::variable(at[k], k);
            }
            let exact = of.evaluate(&dual);
            for k in 0..7 {
                let step = 1e-6;
                let side = |by: f64| {
                    let mut moved = at;
                    moved[k] += by;
                    of.evaluate(&moved)
                };
                let (up, down) = (side(step), side(-step));
                for row in 0..8 {
                    let difference = (up[row] - down[row]) / (2.0 * step);
                    let error = (exact[row].d[k] - difference).abs();
                    assert!(error < 1e-4 * difference.abs().max(0.1), "{mu} {mz} {row} {k}");
                }
            }
        }
    }

    /// The states of the textbook.
    #[test]
    fn states_of_the_flow() {
        for (edgewise, descent, state) in [
            (0.0, -0.02, FlowState::Normal),
            (0.0, 0.0, FlowState::Normal),
            (0.0, 0.02, FlowState::VortexRing),
            (0.0, 0.04, FlowState::TurbulentWake),
            (0.0, 0.08, FlowState::Windmill),
            (0.1, 0.02, FlowState::Normal),
            (0.1, 0.04, FlowState::Windmill),
        ] {
            assert_eq!(FlowState::of(edgewise, descent, 0.03), state, "{edgewise} {descent}");
        }
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
