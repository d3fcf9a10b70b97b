//! Identities and known answers for the linear-model stage.

use coaxdesign::linear::dense::{eigenvalues, singular_values};
use coaxdesign::linear::floquet::{FloquetOptions, analyse, averaging_error, pair_exponents};
use coaxdesign::linear::frequency::{
    ErrorOptions, compare, frequency_response, log_grid, response_error, unwrapped_phase,
};
use coaxdesign::linear::harmonic::{Harmonics, decompose, mean_channels};
use coaxdesign::linear::model::PeriodicSample;
use coaxdesign::linear::reduction::{
    BalancedOptions, Method, balance_model, balanced, outputs_as_states, residualise, truncate,
};
use coaxdesign::linear::structure::{controllability, relative_gain_array, zeros};
use coaxdesign::linear::{Channel, LinearError, PeriodicModel, StateSpace};
use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::units::Kind;
use nalgebra::{Complex, DMatrix};
use std::f64::consts::{PI, TAU};

/// Reproducible numbers in −1…1 (xorshift).
struct Numbers(u64);
impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    }
    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.next())
    }
}

fn channels(prefix: &str, n: usize) -> Vec<Channel> {
    (0..n).map(|i| Channel::new(format!("{prefix}{i}"), Kind::Dimensionless)).collect()
}

fn plain(a: DMatrix<f64>, b: DMatrix<f64>, c: DMatrix<f64>, d: DMatrix<f64>) -> StateSpace {
    StateSpace::new(
        channels("x", a.nrows()),
        channels("u", b.ncols()),
        channels("y", c.nrows()),
        a,
        b,
        c,
        d,
    )
    .unwrap()
}

fn stable(n: usize, seed: u64) -> StateSpace {
    let mut numbers = Numbers(seed);
    let a = numbers.matrix(n, n);
    let worst = eigenvalues(&a).unwrap().iter().map(|z| z.re).fold(f64::MIN, f64::max);
    let a = a - DMatrix::identity(n, n) * (worst + 0.1);
    plain(a, numbers.matrix(n, 2), numbers.matrix(3, n), numbers.matrix(3, 2) * 0.1)
}

/// Mathieu's equation with damping, ẍ + 2cẋ + (δ + 2ε cos ψ) x = u, Ω = 1.
fn mathieu(delta: f64, epsilon: f64, c: f64) -> PeriodicModel {
    let samples = 8;
    PeriodicModel::new(
        channels("x", 2),
        channels("u", 1),
        channels("y", 1),
        1.0,
        (0..samples)
            .map(|k| {
                let psi = TAU * f64::from(k) / f64::from(samples);
                PeriodicSample {
                    a: DMatrix::from_row_slice(
                        2,
                        2,
                        &[0.0, 1.0, -delta - 2.0 * epsilon * psi.cos(), -2.0 * c],
                    ),
                    b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
                    c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
                    d: DMatrix::zeros(1, 1),
                }
            })
            .collect(),
    )
    .unwrap()
}

/// cosh(λT) of the undamped Mathieu equation by Hill's determinant (Whittaker
/// and Watson, section 19.42): 1 − cos(2πν) = 2 Δ(0) sin²(π√δ), where Δ(0) is
/// the infinite determinant with unit diagonal and off-diagonal entries
/// ε/(δ − k²). An independent route: no integration at all.
fn hill_cosine(delta: f64, epsilon: f64) -> f64 {
    let reach = 60_i32;
    // Determinant of a tridiagonal matrix by its continuant.
    let off = |k: i32| epsilon / (delta - f64::from(k * k));
    let (mut before, mut now) = (1.0, 1.0);
    for k in -reach + 1..=reach {
        let next = now - off(k) * off(k - 1) * before;
        (before, now) = (now, next);
    }
    1.0 - 2.0 * now * (PI * delta.sqrt()).sin().powi(2)
}

#[test]
fn val_mathieu_multipliers_agree_with_hills_determinant() {
    // δ, ε: stable, stable near resonance, inside the first and second tongue.
    for (delta, epsilon) in [(0.6, 0.1), (2.3, 0.8), (0.25, 0.1), (1.05, 0.6), (5.3, 2.0)] {
        let model = mathieu(delta, epsilon, 0.0);
        let f = analyse(&model, &FloquetOptions::default()).unwrap();
        // Trace of Φ(T) is 2 cosh λT.
        let trace = f.monodromy.trace() / 2.0;
        let exact = hill_cosine(delta, epsilon);
        // The determinant cut at ±60 is known to about ε²/60³.
        let tolerance = 1e-5 * (1.0 + exact.abs());
        assert!((trace - exact).abs() < tolerance, "{delta} {epsilon}: {trace} {exact}");
        // Liouville: no damping, unit determinant.
        assert!((f.monodromy.determinant() - 1.0).abs() < 1e-10);
        let product: Complex<f64> = f.modes.iter().map(|m| m.multiplier).product();
        assert!((product - 1.0).norm() < 1e-10);
    }
}

#[test]
fn damping_shifts_mathieu_exponents_exactly() {
    // x = e^(−ct) z turns δ into δ − c²: exponents move by −c and no more.
    let c = 0.07;
    let f = |m: &PeriodicModel| analyse(m, &FloquetOptions::default()).unwrap();
    let damped = f(&mathieu(0.6 + c * c, 0.2, c));
    let plain = f(&mathieu(0.6, 0.2, 0.0));
    for (x, y) in damped.modes.iter().zip(&plain.modes) {
        assert!((x.exponent - (y.exponent - c)).norm() < 1e-9);
    }
}

#[test]
fn a_parametric_resonance_is_half_a_revolution_and_said_to_be_ambiguous() {
    // δ = 1/4: the first tongue. Multipliers are real and negative.
    let f = analyse(&mathieu(0.25, 0.1, 0.0), &FloquetOptions::default()).unwrap();
    for mode in &f.modes {
        assert!(mode.multiplier.re < 0.0 && mode.multiplier.im == 0.0);
        assert!((mode.exponent.im - 0.5).abs() < 1e-12);
        assert!(mode.ambiguous);
    }
    // First-order theory: growth ±ε/(2√δ) = ±0.1.
    let growth = f.modes.iter().map(|m| m.exponent.re).fold(f64::MIN, f64::max);
    assert!((growth - 0.1).abs() < 2e-3, "{growth}");
}

#[test]
fn harmonic_exponents_converge_to_floquet_exponents() {
    let model = mathieu(0.6, 0.3, 0.05);
    let f = analyse(&model, &FloquetOptions::default()).unwrap();
    let error = |n: usize| {
        let harmonic = decompose(&model, &Harmonics::states_up_to(n)).unwrap();
        pair_exponents(&f, &eigenvalues(harmonic.a()).unwrap())
            .iter()
            .map(|p| p.difference)
            .fold(0.0, f64::max)
    };
    let errors: Vec<f64> = (0..=5).map(error).collect();
    assert!(errors[0] > 0.01, "averaging must miss here: {errors:?}");
    assert!(errors.windows(2).all(|w| w[1] < w[0]), "{errors:?}");
    assert!(errors[5] < 1e-9, "{errors:?}");
    let report =
        averaging_error(&model, &f, 5, &log_grid(0.01, 0.3, 30).unwrap(), &ErrorOptions::default())
            .unwrap();
    assert_eq!(report.harmonic.len(), 6);
    assert!((report.averaged[0].difference - errors[0]).abs() < 1e-12);
    assert!(report.response.worst() > 0.01);
}

#[test]
fn harmonic_response_is_the_response_of_the_periodic_system() {
    // Drive the periodic system with cos ωt, integrate it by plain Runge–Kutta
    // until the transient is gone, and pick out the component at ω.
    let model = mathieu(1.7, 0.4, 0.3);
    let omega = 0.25; // four rotor turns a period, so that all is periodic in 8π
    let harmonic = mean_channels(&decompose(&model, &Harmonics::states_up_to(8)).unwrap()).unwrap();
    let g = frequency_response(&harmonic, &[omega]).unwrap().values[0][(0, 0)];
    let rate = |t: f64, x: [f64; 2]| {
        let stiffness = 1.7 + 0.8 * t.cos();
        [x[1], -stiffness * x[0] - 0.6 * x[1] + (omega * t).cos()]
    };
    let period = TAU / omega;
    let steps = 4000_usize;
    let h = period / steps as f64;
    let mut x = [0.0, 0.0];
    let mut component = Complex::new(0.0, 0.0);
    let turns = 12;
    for turn in 0..turns {
        for k in 0..steps {
            let t = k as f64 * h;
            if turn == turns - 1 {
                component += Complex::from_polar(2.0 / steps as f64, -omega * t) * x[0];
            }
            let add = |x: [f64; 2], k: [f64; 2], f: f64| [x[0] + f * k[0], x[1] + f * k[1]];
            let k1 = rate(t, x);
            let k2 = rate(t + h / 2.0, add(x, k1, h / 2.0));
            let k3 = rate(t + h / 2.0, add(x, k2, h / 2.0));
            let k4 = rate(t + h, add(x, k3, h));
            for i in 0..2 {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
    }
    assert!((component - g).norm() < 1e-8 * g.norm(), "{component} {g}");
}

#[test]
fn residualisation_keeps_the_steady_gain() {
    let full = stable(12, 5);
    let keep = ["x0", "x3", "x4", "x7", "x9"];
    let reduced = residualise(&full, &keep).unwrap().model;
    let (g, h) = (full.dc_gain().unwrap(), reduced.dc_gain().unwrap());
    assert!((&g - h).amax() < 1e-10 * g.amax());
    assert_eq!(reduced.state_names(), keep);
    // Truncation does not, and keeps the gain at infinite frequency instead.
    let cut = truncate(&full, &keep).unwrap().model;
    assert!((cut.dc_gain().unwrap() - &g).amax() > 1e-3 * g.amax());
    assert_eq!(cut.d(), full.d());
}

#[test]
fn reduction_to_everything_is_the_model_itself() {
    let full = stable(6, 8);
    let names = full.state_names();
    assert_eq!(residualise(&full, &names).unwrap().model, full);
    assert_eq!(truncate(&full, &names).unwrap().model, full);
}

#[test]
fn a_singular_fast_block_names_its_states() {
    // `position` integrates a kept state and `drift` another: neither moves
    // among the fast states.
    let mut a = DMatrix::zeros(4, 4);
    a[(0, 0)] = -1.0;
    a[(1, 0)] = 1.0;
    a[(2, 2)] = -30.0;
    a[(2, 1)] = 4.0;
    a[(3, 0)] = 0.5;
    let c = |n: &str| Channel::new(n, Kind::Dimensionless);
    let model = StateSpace::with_state_outputs(
        vec![c("speed"), c("position"), c("flap"), c("drift")],
        channels("u", 1),
        a,
        DMatrix::from_element(4, 1, 1.0),
    )
    .unwrap();
    let error = residualise(&model, &["speed", "position"]).unwrap_err();
    match &error {
        LinearError::SingularFastBlock { states, .. } => assert_eq!(states, &["drift"]),
        other => panic!("{other}"),
    }
    assert!(error.to_string().contains("drift"));
    // Attitudes integrate the kept rates: it is they that are named.
    let hover = appendix(Condition::Hover).unwrap();
    match residualise(&hover, &["p", "q"]).unwrap_err() {
        LinearError::SingularFastBlock { states, .. } => assert!(states.contains(&"theta".into())),
        other => panic!("{other}"),
    }
    let unknown = residualise(&model, &["sped"]).unwrap_err().to_string();
    assert!(unknown.contains("did you mean \"speed\""), "{unknown}");
    // Nothing but its own output depends on `drift`.
    let outputs = model.select_outputs(&["speed", "flap"]).unwrap();
    let without = outputs.remove_unused(&["drift"]).unwrap();
    assert!(residualise(&without, &["speed", "position"]).is_ok());
    let refused = outputs.remove_unused(&["position"]).unwrap_err().to_string();
    assert!(refused.contains("state \"flap\" depends on it"), "{refused}");
}

#[test]
fn balanced_truncation_obeys_its_error_bound() {
    let full = stable(20, 77);
    let omega = log_grid(1e-3, 1e3, 200).unwrap();
    let g = frequency_response(&full, &omega).unwrap();
    for order in [2, 5, 9, 14] {
        for method in [Method::BalancedTruncate, Method::BalancedResidualise] {
            let r = balanced(&full, order, method, &BalancedOptions::default()).unwrap();
            let bound = r.bound.unwrap();
            let h = frequency_response(&r.model, &omega).unwrap();
            let worst = g
                .values
                .iter()
                .zip(&h.values)
                .map(|(x, y)| coaxdesign::linear::dense::largest_singular_value(&(x - y)))
                .fold(0.0, f64::max);
            assert!(worst <= bound * (1.0 + 1e-9), "{order} {method:?}: {worst} {bound}");
            // No approximation of this order can beat the next singular value.
            assert!(worst >= 0.9 * r.hankel[order], "{worst} {}", r.hankel[order]);
        }
        let exact =
            balanced(&full, order, Method::BalancedResidualise, &BalancedOptions::default())
                .unwrap()
                .model
                .dc_gain()
                .unwrap();
        assert!((exact - full.dc_gain().unwrap()).amax() < 1e-9);
    }
}

#[test]
fn balanced_coordinates_have_equal_diagonal_gramians() {
    let full = stable(8, 13);
    let b = balance_model(&full, &BalancedOptions::default()).unwrap();
    assert_eq!(b.unstable, 0);
    let m = &b.model;
    let sigma = DMatrix::from_fn(8, 8, |i, j| if i == j { b.hankel[i] } else { 0.0 });
    let p = m.a() * &sigma + &sigma * m.a().transpose() + m.b() * m.b().transpose();
    let q = m.a().transpose() * &sigma + &sigma * m.a() + m.c().transpose() * m.c();
    assert!(p.amax() < 1e-11 && q.amax() < 1e-11, "{} {}", p.amax(), q.amax());
}

#[test]
fn balanced_reduction_keeps_unstable_modes_whole() {
    let full = appendix(Condition::Hover).unwrap();
    let unstable: Vec<_> =
        eigenvalues(full.a()).unwrap().into_iter().filter(|z| z.re > 0.0).collect();
    let options = BalancedOptions::default();
    let r = balanced(&full, 6, Method::BalancedTruncate, &options).unwrap();
    let kept = eigenvalues(r.model.a()).unwrap();
    for z in &unstable {
        assert!(kept.iter().any(|k| (k - z).norm() < 1e-10), "{z} lost");
    }
    let error = balanced(&full, 3, Method::BalancedTruncate, &options).unwrap_err();
    assert!(error.to_string().contains("4 unstable"), "{error}");
    // All eight: the same transfer matrix, and back in the original states.
    let all = balanced(&full, 8, Method::BalancedTruncate, &options).unwrap();
    let omega = log_grid(0.05, 20.0, 40).unwrap();
    let e = response_error(&full, &all.model, &omega, &ErrorOptions::default()).unwrap();
    assert!(e.worst() < 1e-8, "{}", e.worst());
    let names = full.state_names();
    let back = outputs_as_states(&all.model, &names).unwrap();
    assert!((back.a() - full.a()).amax() < 1e-7 * full.a().amax());
}

#[test]
fn trust_ends_where_the_neglected_mode_begins() {
    // 1/((s+1)(s/50+1)): residualising the lag errs by ω/50 to first order,
    // so that 10 % is reached near 5 rad/s.
    let a = DMatrix::from_row_slice(2, 2, &[-1.0, 1.0, 0.0, -50.0]);
    let model = plain(
        a,
        DMatrix::from_row_slice(2, 1, &[0.0, 50.0]),
        DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
        DMatrix::zeros(1, 1),
    );
    let omega = log_grid(0.01, 100.0, 400).unwrap();
    let r = residualise(&model, &["x0"]).unwrap();
    let e = r.error(&model, &omega, &ErrorOptions::default()).unwrap();
    let trusted = e.trusted_up_to.unwrap();
    assert!((trusted / 5.0 - 1.0).abs() < 0.03, "{trusted}");
    assert_eq!(e.channel_trusted_up_to[0][0], Some(trusted));
    assert!(e.sigma_max[0] < 1e-3);
    // A truncation that loses the input is trusted nowhere.
    let lost = truncate(&model, &["x0"]).unwrap();
    let e = lost.error(&model, &omega, &ErrorOptions::default()).unwrap();
    assert_eq!(e.trusted_up_to, None);
}

#[test]
fn frequency_response_is_the_formula() {
    let model = stable(15, 31);
    let omega = [0.0, 0.3, 2.0, 40.0];
    let fast = frequency_response(&model, &omega).unwrap();
    let up = |m: &DMatrix<f64>| m.map(|x| Complex::new(x, 0.0));
    for (&w, g) in omega.iter().zip(&fast.values) {
        let mut pencil = -up(model.a());
        for i in 0..15 {
            pencil[(i, i)] += Complex::new(0.0, w);
        }
        let exact = up(model.c()) * pencil.lu().solve(&up(model.b())).unwrap() + up(model.d());
        assert!((g - &exact).norm() < 1e-11 * exact.norm());
    }
    let steady = model.dc_gain().unwrap();
    assert!((fast.values[0].map(|z| z.re) - &steady).amax() < 1e-10 * steady.amax());
}

#[test]
fn an_undamped_mode_on_the_grid_is_an_error() {
    let model = plain(
        DMatrix::from_row_slice(2, 2, &[0.0, 2.0, -2.0, 0.0]),
        DMatrix::from_element(2, 1, 1.0),
        DMatrix::identity(2, 2),
        DMatrix::zeros(2, 1),
    );
    let error = frequency_response(&model, &[1.0, 2.0]).unwrap_err().to_string();
    assert!(error.contains("undamped mode"), "{error}");
}

#[test]
fn phase_unwraps_to_minus_ninety_a_pole() {
    // Five poles at −1: from 0 to −450 degrees, without a jump.
    let lag = |n: &str| {
        let c = |s: &str| vec![Channel::new(s, Kind::Dimensionless)];
        StateSpace::new(
            c(n),
            c("u"),
            c("y"),
            DMatrix::from_element(1, 1, -1.0),
            DMatrix::from_element(1, 1, 1.0),
            DMatrix::from_element(1, 1, 1.0),
            DMatrix::zeros(1, 1),
        )
        .unwrap()
    };
    let mut chain = lag("a");
    for n in ["b", "c", "d", "e"] {
        chain = chain.series(&lag(n)).unwrap();
    }
    let omega = log_grid(1e-3, 1e3, 300).unwrap();
    let bode = frequency_response(&chain, &omega).unwrap().bode("y", "u").unwrap();
    for (w, phase) in omega.iter().zip(&bode.phase) {
        assert!((phase + 5.0 * w.atan()).abs() < 1e-9);
    }
    assert!(bode.phase.windows(2).all(|w| (w[1] - w[0]).abs() < 0.5));
    let still =
        unwrapped_phase(&[Complex::new(0.0, 1.0), Complex::default(), Complex::new(0.0, 1.0)]);
    assert_eq!(still, vec![PI / 2.0; 3]);
}

#[test]
fn compared_models_share_a_turn() {
    let model = appendix(Condition::Hover).unwrap();
    let c = compare(
        &[("first", &model), ("second", &model)],
        "lat",
        "p",
        &log_grid(0.1, 30.0, 50).unwrap(),
    )
    .unwrap();
    assert_eq!(c.curves[0].1, c.curves[1].1);
}

#[test]
fn zeros_of_known_systems() {
    // (s − 2)(s + 5)/((s + 1)(s + 2)(s + 3)) in controllable form.
    let model = plain(
        DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, -6.0, -11.0, -6.0]),
        DMatrix::from_row_slice(3, 1, &[0.0, 0.0, 1.0]),
        DMatrix::from_row_slice(1, 3, &[-10.0, 3.0, 1.0]),
        DMatrix::zeros(1, 1),
    );
    let z = zeros(&model).unwrap();
    assert_eq!(z.len(), 2);
    assert!((z[0] - 2.0).norm() < 1e-12 && (z[1] + 5.0).norm() < 1e-12, "{z:?}");
    // No zeros at all: a triple integrator.
    let chain = plain(
        DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        DMatrix::from_row_slice(3, 1, &[0.0, 0.0, 1.0]),
        DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 0.0]),
        DMatrix::zeros(1, 1),
    );
    assert!(zeros(&chain).unwrap().is_empty());
    // With invertible D the zeros are the poles of the inverse, A − B D⁻¹ C.
    let mut numbers = Numbers(19);
    let (a, b, c) = (numbers.matrix(6, 6), numbers.matrix(6, 2), numbers.matrix(2, 6));
    let d = DMatrix::from_row_slice(2, 2, &[1.0, 0.3, -0.2, 0.8]);
    let inverse = &a - &b * d.clone().try_inverse().unwrap() * &c;
    let z = zeros(&plain(a.clone(), b.clone(), c.clone(), d)).unwrap();
    let exact = eigenvalues(&inverse).unwrap();
    assert_eq!(z.len(), 6);
    for (x, y) in z.iter().zip(&exact) {
        assert!((x - y).norm() < 1e-11, "{x} {y}");
    }
    // Every zero makes the system matrix lose rank; square, D = 0.
    let square = plain(a.clone(), b.clone(), c.clone(), DMatrix::zeros(2, 2));
    let z = zeros(&square).unwrap();
    assert_eq!(z.len(), 4, "six states, two inputs and outputs, C B invertible");
    for s in z {
        let real = DMatrix::from_fn(16, 16, |i, j| {
            let (r, k) = (i % 8, j % 8);
            let mut v = Complex::new(
                match (r < 6, k < 6) {
                    (true, true) => a[(r, k)],
                    (true, false) => b[(r, k - 6)],
                    (false, true) => c[(r - 6, k)],
                    (false, false) => 0.0,
                },
                0.0,
            );
            if r == k && r < 6 {
                v -= s;
            }
            match (i < 8, j < 8) {
                (true, false) => -v.im,
                (false, true) => v.im,
                _ => v.re,
            }
        });
        assert!(*singular_values(&real).unwrap().last().unwrap() < 1e-12);
    }
}

#[test]
fn an_uncontrollable_mode_is_found() {
    let model = plain(
        DMatrix::from_row_slice(3, 3, &[-1.0, 0.5, 0.0, 0.0, -2.0, 0.0, 0.3, 0.0, -4.0]),
        DMatrix::from_row_slice(3, 1, &[1.0, 0.0, 0.7]),
        DMatrix::identity(3, 3),
        DMatrix::zeros(3, 1),
    );
    let measures = controllability(&model).unwrap();
    let at = |value: f64| measures.iter().find(|m| (m.eigenvalue - value).norm() < 1e-12).unwrap();
    assert!(at(-2.0).measure < 1e-15);
    assert!(at(-2.0).by_input.as_ref().unwrap()[0] < 1e-15);
    assert!(at(-1.0).measure > 0.05 && at(-4.0).measure > 0.05);
}

#[test]
fn relative_gains_sum_to_one_and_ignore_units() {
    let square = stable(7, 3).select_outputs(&["y0", "y2"]).unwrap();
    let rga = relative_gain_array(&square, 0.8).unwrap();
    for i in 0..2 {
        assert!((rga.row(i).sum() - 1.0).norm() < 1e-12);
        assert!((rga.column(i).sum() - 1.0).norm() < 1e-12);
    }
    let scaled = plain(
        square.a().clone(),
        square.b() * DMatrix::from_row_slice(2, 2, &[100.0, 0.0, 0.0, 0.01]),
        DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 0.0, 1e4]) * square.c(),
        DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 0.0, 1e4])
            * square.d()
            * DMatrix::from_row_slice(2, 2, &[100.0, 0.0, 0.0, 0.01]),
    );
    let other = relative_gain_array(&scaled, 0.8).unwrap();
    assert!((rga - other).norm() < 1e-10);
}
