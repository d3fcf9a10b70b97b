//! Floquet analysis: the exact stability of a periodic model.
//!
//! Over one period T the state transition matrix Φ(T) (monodromy matrix) maps
//! x(0) to x(T). Its eigenvalues μ are the multipliers; exponents λ with
//! μ = exp(λT) play the part of eigenvalues. λ is known only up to multiples
//! of jΩ: exp(λt) p(t) with periodic p is the same motion as
//! exp((λ + jkΩ)t) (p(t) exp(−jkΩt)). The branch chosen here makes the constant
//! part the largest harmonic of p, which is how an averaged model sees the
//! mode; the choice and its strength are reported.

use nalgebra::{Complex, DMatrix, DVector};

use super::LinearError;
use super::dense::{balance, eigen, eigenvalues, ensure_finite, spectral_order};
use super::frequency::{ErrorOptions, ResponseError, response_error};
use super::harmonic::mean_and_harmonics;
use super::model::{FourierMatrix, PeriodicModel};

type C64 = Complex<f64>;

/// How to integrate and analyse.
#[derive(Debug, Clone, PartialEq)]
pub struct FloquetOptions {
    /// Wanted relative accuracy of the monodromy matrix, 1, in balanced
    /// coordinates: the change when the number of steps is doubled.
    pub tolerance: f64,
    /// Most steps a period.
    pub max_steps: usize,
    /// Harmonics of the modes to report, −harmonics…harmonics.
    pub harmonics: usize,
}

impl Default for FloquetOptions {
    fn default() -> Self {
        Self { tolerance: 1e-9, max_steps: 4096, harmonics: 8 }
    }
}

/// Monodromy matrix and modes of a periodic model.
#[derive(Debug, Clone)]
pub struct Floquet {
    /// Φ(T), states × states.
    pub monodromy: DMatrix<f64>,
    /// Steps that the integration took.
    pub steps: usize,
    /// Estimated relative error of Φ(T) in balanced coordinates.
    pub integration_error: f64,
    /// Fundamental frequency Ω, rad/s.
    pub frequency: f64,
    /// Modes, those with the smallest exponent first, conjugates adjacent.
    pub modes: Vec<FloquetMode>,
}

/// One mode exp(λt) p(t).
#[derive(Debug, Clone)]
pub struct FloquetMode {
    /// Multiplier μ = exp(λT).
    pub multiplier: C64,
    /// Exponent λ on the chosen branch, rad/s.
    pub exponent: C64,
    /// Multiple of Ω added to the principal branch |Im λ| ≤ Ω/2.
    pub branch: i32,
    /// Share of the constant part in the squared size of p(t) on this branch,
    /// 0…1, in balanced coordinates.
    pub dominance: f64,
    /// Another harmonic is nearly as large, so that the branch is a convention.
    pub ambiguous: bool,
    /// Rounding error to expect in λ, rad/s: modes that die out within a
    /// period leave little of themselves in Φ(T).
    pub uncertainty: f64,
    /// Harmonics of p(t) on the chosen branch, states × (2K + 1), column
    /// K + k for exp(jkΩt); scaled so that the constant part has unit length.
    pub shape: DMatrix<C64>,
}

impl FloquetMode {
    /// Constant part of p(t): the vector to compare with an eigenvector of the
    /// averaged model.
    pub fn constant_part(&self) -> DVector<C64> {
        self.shape.column(self.shape.ncols() / 2).into_owned()
    }
}

/// State transition matrices Φ(ψ) at equal steps over the period.
struct Transition {
    at_steps: Vec<DMatrix<f64>>,
}

/// Sixth-order Magnus integrator on three Gauss points (Blanes, Casas and Ros,
/// BIT 40, 2000): exact for constant matrices, and with the right determinant
/// to the accuracy of the quadrature of the trace.
fn integrate(a: &FourierMatrix, period: f64, steps: usize) -> Result<Transition, LinearError> {
    let n = a.cosine[0].nrows();
    let h = period / steps as f64;
    let root = 15f64.sqrt();
    let mut phi = DMatrix::identity(n, n);
    let mut at_steps = Vec::with_capacity(steps + 1);
    at_steps.push(phi.clone());
    for k in 0..steps {
        let psi = |node: f64| std::f64::consts::TAU * (k as f64 + node) / steps as f64;
        let a1 = a.at(psi(0.5 - root / 10.0));
        let a2 = a.at(psi(0.5));
        let a3 = a.at(psi(0.5 + root / 10.0));
        let alpha1 = &a2 * h;
        let alpha2 = (&a3 - &a1) * (h * root / 3.0);
        let alpha3 = (&a3 - &a2 * 2.0 + &a1) * (h * 10.0 / 3.0);
        let c1 = commutator(&alpha1, &alpha2);
        let c2 = commutator(&alpha1, &(&alpha3 * 2.0 + &c1)) * (-1.0 / 60.0);
        let omega = &alpha1
            + &alpha3 / 12.0
            + commutator(&(&alpha1 * -20.0 - &alpha3 + &c1), &(&alpha2 + &c2)) / 240.0;
        ensure_finite("the Magnus exponent", &omega)?;
        phi = omega.exp() * phi;
        ensure_finite("the state transition matrix", &phi)?;
        at_steps.push(phi.clone());
    }
    Ok(Transition { at_steps })
}

fn commutator(x: &DMatrix<f64>, y: &DMatrix<f64>) -> DMatrix<f64> {
    x * y - y * x
}

/// Two harmonics of p(t) count as equally large above this ratio of sizes.
const AMBIGUOUS: f64 = 0.8;

/// Floquet analysis of a periodic model.
///
/// # Errors
/// [`LinearError::NotConverged`] if `max_steps` do not reach the tolerance.
pub fn analyse(model: &PeriodicModel, options: &FloquetOptions) -> Result<Floquet, LinearError> {
    if !(options.tolerance > 0.0 && options.tolerance.is_finite()) {
        return Err(LinearError::Domain(
            "the tolerance of the Floquet analysis must be positive".into(),
        ));
    }
    let n = model.states().len();
    let averaged = model.averaged();
    let (_, scale) = balance(averaged.a())?;
    let scaled: Vec<DMatrix<f64>> = model
        .samples()
        .iter()
        .map(|s| DMatrix::from_fn(n, n, |i, j| s.a[(i, j)] * scale[j] / scale[i]))
        .collect();
    let series = FourierMatrix::from_samples(scaled.iter()).without_noise(1e-15);
    let period = model.period();

    let mut steps = (4 * series.highest()).max(8).next_power_of_two();
    let mut current = integrate(&series, period, steps)?;
    let error = loop {
        if 2 * steps > options.max_steps {
            // The last comparison decides; with none made the limit is too low.
            return Err(LinearError::NotConverged {
                what: "the integration of the monodromy matrix".into(),
                achieved: change(&current, None),
                wanted: options.tolerance,
                limit: format!("{steps} steps a period"),
            });
        }
        let finer = integrate(&series, period, 2 * steps)?;
        steps *= 2;
        let difference = change(&finer, Some(&current));
        current = finer;
        if difference <= options.tolerance {
            // Sixth order: the finer result is 63 times closer than the difference.
            break difference / 63.0;
        }
    };

    let phi = current.at_steps.last().cloned().unwrap_or_default();
    let spectrum = eigen(&phi)?;
    let averaged_values = eigenvalues(averaged.a())?;
    let mut modes: Vec<FloquetMode> = Vec::with_capacity(n);
    let mut k = 0;
    while k < n {
        let multiplier = spectrum.values[k];
        let vector = spectrum.right.column(k).into_owned();
        let sensitivity = spectrum.left[k].as_ref().map_or(f64::INFINITY, |w| w.norm());
        let mode = describe(
            &current,
            multiplier,
            &vector,
            sensitivity,
            &averaged_values,
            model.frequency(),
            options,
            &scale,
        )?;
        let pair = multiplier.im != 0.0;
        if pair {
            let mut other = mode.clone();
            other.multiplier = other.multiplier.conj();
            other.exponent = other.exponent.conj();
            other.branch = -other.branch;
            let columns = other.shape.ncols();
            other.shape =
                DMatrix::from_fn(n, columns, |i, j| mode.shape[(i, columns - 1 - j)].conj());
            modes.push(mode);
            modes.push(other);
        } else {
            modes.push(mode);
        }
        k += if pair { 2 } else { 1 };
    }
    modes.sort_by(|x, y| spectral_order(&x.exponent, &y.exponent));
    Ok(Floquet {
        monodromy: DMatrix::from_fn(n, n, |i, j| phi[(i, j)] * scale[i] / scale[j]),
        steps,
        integration_error: error,
        frequency: model.frequency(),
        modes,
    })
}

fn change(finer: &Transition, coarser: Option<&Transition>) -> f64 {
    match (finer.at_steps.last(), coarser.and_then(|c| c.at_steps.last())) {
        (Some(x), Some(y)) => (x - y).norm() / x.norm(),
        _ => f64::INFINITY,
    }
}

#[allow(clippy::too_many_arguments)]
fn describe(
    transition: &Transition,
    multiplier: C64,
    vector: &DVector<C64>,
    sensitivity: f64,
    averaged: &[C64],
    frequency: f64,
    options: &FloquetOptions,
    scale: &DVector<f64>,
) -> Result<FloquetMode, LinearError> {
    let n = vector.len();
    let period = std::f64::consts::TAU / frequency;
    let principal = multiplier.ln() / period;
    let phi = transition.at_steps.last().map_or(0.0, |m| m.norm());
    let uncertainty = if multiplier.norm() > 0.0 {
        n as f64 * f64::EPSILON * phi * sensitivity / multiplier.norm() / period
    } else {
        f64::INFINITY
    };
    if !(principal.re.is_finite() && principal.im.is_finite()) {
        return Err(LinearError::Singular {
            what: "the monodromy matrix: a mode dies out completely within one period;".into(),
        });
    }
    // Harmonics of p(t) = Φ(t) v exp(−λt) by the discrete Fourier transform.
    let steps = transition.at_steps.len() - 1;
    let reach = (2 * options.harmonics + 2).min(steps / 2 - 1) as i32;
    let periodic: Vec<DVector<C64>> = (0..steps)
        .map(|s| {
            let decay = (-principal * (period * s as f64 / steps as f64)).exp();
            let m = &transition.at_steps[s];
            DVector::from_fn(n, |i, _| {
                let mut sum = C64::default();
                for j in 0..n {
                    sum += vector[j] * m[(i, j)];
                }
                sum * decay
            })
        })
        .collect();
    let coefficient = |k: i32| -> DVector<C64> {
        let mut sum = DVector::zeros(n);
        for (s, p) in periodic.iter().enumerate() {
            let turn = (i64::from(k) * s as i64).rem_euclid(steps as i64);
            let angle = -std::f64::consts::TAU * turn as f64 / steps as f64;
            sum += p * Complex::from_polar(1.0 / steps as f64, angle);
        }
        sum
    };
    let all: Vec<DVector<C64>> = (-reach..=reach).map(coefficient).collect();
    let size = |k: i32| all[(k + reach) as usize].norm();
    let total: f64 = periodic.iter().map(|p| p.norm_squared()).sum::<f64>() / steps as f64;
    let largest = (-reach..=reach).map(size).fold(0.0, f64::max);
    let candidates: Vec<i32> =
        (-reach..=reach).filter(|&k| size(k) >= AMBIGUOUS * largest).collect();
    let exponent = |k: i32| principal + Complex::new(0.0, f64::from(k) * frequency);
    let distance =
        |k: i32| averaged.iter().map(|z| (z - exponent(k)).norm()).fold(f64::INFINITY, f64::min);
    // Between equals, the one that the averaged model shows; then the upper
    // half plane, so that a real multiplier has one answer.
    let branch = candidates
        .iter()
        .copied()
        .min_by(|&x, &y| {
            let (dx, dy) = (distance(x), distance(y));
            if (dx - dy).abs() > 1e-6 * frequency {
                dx.total_cmp(&dy)
            } else {
                exponent(y).im.total_cmp(&exponent(x).im)
            }
        })
        .unwrap_or(0);
    let constant = size(branch);
    let reported = options.harmonics as i32;
    let unscaled: f64 = all[(branch + reach) as usize]
        .iter()
        .zip(scale.iter())
        .map(|(z, d)| (z * *d).norm_sqr())
        .sum::<f64>()
        .sqrt();
    let shape = DMatrix::from_fn(n, 2 * options.harmonics + 1, |i, j| {
        let k = branch + j as i32 - reported;
        if k.abs() <= reach && unscaled > 0.0 {
            all[(k + reach) as usize][i] * (scale[i] / unscaled)
        } else {
            C64::default()
        }
    });
    Ok(FloquetMode {
        multiplier,
        exponent: exponent(branch),
        branch,
        dominance: if total > 0.0 { (constant * constant / total).min(1.0) } else { 0.0 },
        ambiguous: candidates.len() > 1,
        uncertainty,
        shape,
    })
}

/// An eigenvalue of an approximate model beside the exponent that it stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct ExponentPair {
    /// Eigenvalue of the approximate model, rad/s.
    pub approximate: C64,
    /// Floquet exponent, rad/s.
    pub exact: C64,
    /// |approximate − exact|, rad/s.
    pub difference: f64,
}

/// Pairs Floquet exponents with eigenvalues of an approximate model, nearest
/// pairs first, each used once. A harmonic model has more eigenvalues than
/// there are exponents; the spare ones are copies shifted by multiples of jΩ.
pub fn pair_exponents(floquet: &Floquet, approximate: &[C64]) -> Vec<ExponentPair> {
    let mut distances: Vec<(f64, usize, usize)> = Vec::new();
    for (i, mode) in floquet.modes.iter().enumerate() {
        for (j, z) in approximate.iter().enumerate() {
            distances.push(((mode.exponent - z).norm(), i, j));
        }
    }
    distances.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut taken_exact = vec![false; floquet.modes.len()];
    let mut taken_approximate = vec![false; approximate.len()];
    let mut pairs: Vec<(usize, ExponentPair)> = Vec::new();
    for (difference, i, j) in distances {
        if !taken_exact[i] && !taken_approximate[j] {
            taken_exact[i] = true;
            taken_approximate[j] = true;
            pairs.push((
                i,
                ExponentPair {
                    approximate: approximate[j],
                    exact: floquet.modes[i].exponent,
                    difference,
                },
            ));
        }
    }
    pairs.sort_by_key(|(i, _)| *i);
    pairs.into_iter().map(|(_, pair)| pair).collect()
}

/// What averaging does to a periodic model.
#[derive(Debug, Clone)]
pub struct AveragingError {
    /// Eigenvalues of the averaged model beside the Floquet exponents.
    pub averaged: Vec<ExponentPair>,
    /// Largest difference between eigenvalues of the harmonic model and Floquet
    /// exponents, rad/s, for 0, 1, 2, … harmonics of the state.
    pub harmonic: Vec<(usize, f64)>,
    /// Error of the averaged model's response against that of the harmonic
    /// model with the most harmonics, average input to average output.
    pub response: ResponseError,
}

/// Compares the averaged model with Floquet theory and with harmonic models
/// of up to `harmonics` harmonics.
///
/// Modes whose exponent is uncertain by more than 10⁻⁶ rad/s are left out of
/// the `harmonic` column: there rounding, not truncation, would be compared.
pub fn averaging_error(
    model: &PeriodicModel,
    floquet: &Floquet,
    harmonics: usize,
    omega: &[f64],
    options: &ErrorOptions,
) -> Result<AveragingError, LinearError> {
    const KNOWN: f64 = 1e-6;
    let averaged = model.averaged();
    let certain: Vec<bool> = floquet.modes.iter().map(|m| m.uncertainty <= KNOWN).collect();
    let mut harmonic = Vec::with_capacity(harmonics + 1);
    let mut finest = averaged.clone();
    for n in 0..=harmonics {
        finest = mean_and_harmonics(model, n)?;
        let pairs = pair_exponents(floquet, &eigenvalues(finest.a())?);
        let worst = pairs
            .iter()
            .zip(&certain)
            .filter(|(_, known)| **known)
            .map(|(p, _)| p.difference)
            .fold(0.0, f64::max);
        harmonic.push((n, worst));
    }
    Ok(AveragingError {
        averaged: pair_exponents(floquet, &eigenvalues(averaged.a())?),
        harmonic,
        response: response_error(&finest, &averaged, omega, options)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::dense::tests::Numbers;
    use crate::linear::model::{Channel, PeriodicSample};
    use crate::units::Kind;
    use std::f64::consts::TAU;

    fn channels(n: usize) -> Vec<Channel> {
        (0..n).map(|i| Channel::new(format!("x{i}"), Kind::Dimensionless)).collect()
    }

    fn model(
        n: usize,
        frequency: f64,
        samples: usize,
        a: impl Fn(f64) -> DMatrix<f64>,
    ) -> PeriodicModel {
        PeriodicModel::new(
            channels(n),
            vec![Channel::new("u", Kind::Dimensionless)],
            channels(n),
            frequency,
            (0..samples)
                .map(|k| PeriodicSample {
                    a: a(TAU * k as f64 / samples as f64),
                    b: DMatrix::from_fn(n, 1, |i, _| if i == n - 1 { 1.0 } else { 0.0 }),
                    c: DMatrix::identity(n, n),
                    d: DMatrix::zeros(n, 1),
                })
                .collect(),
        )
        .unwrap()
    }

    #[test]
    fn constant_coefficients_give_their_eigenvalues_on_the_right_branch() {
        // Eigenvalues well beyond Ω/2: the branch has to be found.
        let a = DMatrix::from_row_slice(
            4,
            4,
            &[
                0.0, 1.0, 0.0, 0.0, //
                -30.0, -0.4, 0.0, 0.0, //
                0.0, 0.0, 0.0, 1.0, //
                0.0, 0.0, 0.04, 0.1,
            ],
        );
        let m = model(4, 2.0, 5, |_| a.clone());
        let f = analyse(&m, &FloquetOptions::default()).unwrap();
        for (mode, exact) in f.modes.iter().zip(eigenvalues(&a).unwrap()) {
            assert!((mode.exponent - exact).norm() < 1e-10, "{} {exact}", mode.exponent);
            assert!(mode.dominance > 1.0 - 1e-9);
            assert!(!mode.ambiguous);
        }
        let fast = f.modes.last().unwrap();
        assert_eq!(fast.branch.abs(), 3, "√30 ≈ 5.47 is nearest to 3Ω = 6");
    }

    #[test]
    fn a_rotating_frame_is_seen_through() {
        // z = R(ψ) x with constant ẋ = A₀ x: ż = (R A₀ R⁻¹ + Ω J) z is periodic,
        // and its exponents are those of A₀ up to jΩ.
        let a0 = DMatrix::from_row_slice(2, 2, &[-0.3, 1.0, -0.5, -0.1]);
        let omega = 3.0;
        let m = model(2, omega, 9, |psi| {
            let (s, c) = psi.sin_cos();
            let r = DMatrix::from_row_slice(2, 2, &[c, -s, s, c]);
            let j = DMatrix::from_row_slice(2, 2, &[0.0, -1.0, 1.0, 0.0]);
            &r * &a0 * r.transpose() + j * omega
        });
        let f = analyse(&m, &FloquetOptions::default()).unwrap();
        let exact = eigenvalues(&a0).unwrap();
        for mode in &f.modes {
            let nearest = exact
                .iter()
                .flat_map(|z| (-3..=3).map(move |k| z + Complex::new(0.0, omega * f64::from(k))))
                .map(|z| (z - mode.exponent).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-9);
        }
        // Liouville: both traces agree, and so do the sums of real parts.
        let sum: f64 = f.modes.iter().map(|m| m.exponent.re).sum();
        assert!((sum + 0.4).abs() < 1e-10);
    }

    #[test]
    fn liouville_formula_holds() {
        // det Φ(T) = exp ∫ tr A dt, with A of full harmonic content.
        let mut numbers = Numbers(17);
        let pieces: Vec<DMatrix<f64>> = (0..5).map(|_| numbers.matrix(5, 5)).collect();
        let m = model(5, 4.0, 12, |psi| {
            &pieces[0]
                + &pieces[1] * psi.cos()
                + &pieces[2] * psi.sin()
                + &pieces[3] * (3.0 * psi).cos()
                + &pieces[4] * (2.0 * psi).sin()
        });
        let f = analyse(&m, &FloquetOptions::default()).unwrap();
        let exact = (pieces[0].trace() * m.period()).exp();
        assert!((f.monodromy.determinant() / exact - 1.0).abs() < 1e-11);
        let product: C64 = f.modes.iter().map(|m| m.multiplier).product();
        assert!((product.re / exact - 1.0).abs() < 1e-11 && product.im.abs() < 1e-11 * exact);
    }

    #[test]
    fn modes_solve_the_periodic_equation() {
        // λ p + ṗ = A p, harmonic by harmonic: Σ_m A_{k−m} p_m = (λ + jkΩ) p_k.
        let mut numbers = Numbers(2);
        let (a0, a1) = (numbers.matrix(3, 3), numbers.matrix(3, 3) * 0.5);
        let m = model(3, 5.0, 5, |psi| &a0 + &a1 * psi.cos());
        let options = FloquetOptions { harmonics: 10, ..Default::default() };
        let f = analyse(&m, &options).unwrap();
        let up = |x: &DMatrix<f64>| x.map(|v| Complex::new(v, 0.0));
        for mode in &f.modes {
            for k in -4_i32..=4 {
                let p = |h: i32| mode.shape.column((h + 10) as usize).into_owned();
                let left =
                    up(&a0) * p(k) + up(&a1) * (p(k - 1) + p(k + 1)) * Complex::new(0.5, 0.0);
                let right = p(k) * (mode.exponent + Complex::new(0.0, 5.0 * f64::from(k)));
                assert!((left - right).norm() < 1e-8, "{k} {}", mode.exponent);
            }
        }
    }
}
