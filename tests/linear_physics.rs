//! Linear models of the real aircraft against each other and against what
//! theory says about their structure. (Against its nonlinear dynamics they
//! stand in `coaxdesign::validation`.)

use std::sync::LazyLock;

use coaxdesign::linear::StateSpace;
use coaxdesign::linear::dense::eigenvalues;
use coaxdesign::linear::floquet::{FloquetOptions, analyse, averaging_error};
use coaxdesign::linear::frequency::{ErrorOptions, log_grid};
use coaxdesign::linear::linearize::{Inputs, Linearization, Options, linearize};
use coaxdesign::linear::modes::modes;
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::problem::builtin;
use coaxdesign::trim::{self, ConvergedTrim, FlightCondition, sweep};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use nalgebra::{Complex, DMatrix, DVector};

/// A vehicle in trim, and its periodic model.
struct Flight {
    vehicle: Vehicle,
    trim: ConvergedTrim,
    linear: Linearization,
}

fn flight(knots: f64, interactions: bool) -> Flight {
    let mut problem = builtin().unwrap_or_else(|report| panic!("{report:?}")).problem;
    problem.inflow.interactions = interactions;
    let vehicle = Vehicle::new(&problem).unwrap();
    let condition = FlightCondition::level(knots * KNOT);
    let point =
        sweep(&vehicle, &[condition], &trim::Options::default(), |_| {}).points.swap_remove(0);
    let trim = point.into_converged().unwrap_or_else(|point| panic!("{:?}", point.status));
    let linear = linearize(&vehicle, &trim, &Options::default()).unwrap();
    Flight { vehicle, trim, linear }
}

static HOVER: LazyLock<Flight> = LazyLock::new(|| flight(0.0, true));
static HOVER_OFF: LazyLock<Flight> = LazyLock::new(|| flight(0.0, false));
static FORWARD: LazyLock<Flight> = LazyLock::new(|| flight(50.0, true));

impl Flight {
    fn scales(&self) -> Vec<f64> {
        self.vehicle.layout.states.iter().map(|state| state.scale).collect()
    }

    fn reduced(&self) -> StateSpace {
        residualise(&self.linear.model.averaged(), &RIGID_BODY).unwrap().model
    }
}

/// Largest difference of two matrices in scaled rows and columns, over the
/// largest scaled entry.
fn scaled_difference(x: &DMatrix<f64>, y: &DMatrix<f64>, rows: &[f64], columns: &[f64]) -> f64 {
    let scaled = |m: &DMatrix<f64>| {
        DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * columns[j] / rows[i])
    };
    (scaled(x) - scaled(y)).amax() / scaled(y).amax()
}

#[test]
fn sticks_act_through_the_blade_controls() {
    let flight = &*FORWARD;
    let options = Options { inputs: Inputs::Rotors, ..Options::default() };
    let rotors = linearize(&flight.vehicle, &flight.trim, &options).unwrap().model.averaged();
    let sticks = flight.linear.model.averaged();
    let count = flight.vehicle.effector_count();
    let blade_controls = |sticks: [f64; 4]| {
        let mut effectors = vec![0.0; count];
        flight.vehicle.mix(&sticks, &mut effectors);
        DVector::from_vec(effectors)
    };
    let rest = blade_controls([0.0; 4]);
    let mix = DMatrix::from_columns(&[0, 1, 2, 3].map(|k| {
        let mut one = [0.0; 4];
        one[k] = 1.0;
        blade_controls(one) - &rest
    }));
    let scales = flight.scales();
    let error = scaled_difference(&(rotors.b() * mix), sticks.b(), &scales, &[1.0; 4]);
    assert!(error < 1e-12, "{error:.1e}");
    assert_eq!(rotors.a(), sticks.a());
}

/// Hover without translation of the axes: u, θ, q and v, φ, p make the two
/// hovering cubics (Padfield, Helicopter Flight Dynamics, chapter 4), each
/// with a growing oscillation and a subsidence; w and r are left to heave and
/// yaw. In a coaxial helicopter they are coupled but keep this pattern.
#[test]
fn hover_has_two_hovering_cubics_heave_and_yaw() {
    for (flight, name) in [(&*HOVER, "on"), (&*HOVER_OFF, "off")] {
        let reduced = flight.reduced();
        let share = |participation: &[f64], wanted: &[&str]| -> f64 {
            reduced
                .state_names()
                .iter()
                .zip(participation)
                .filter(|(state, _)| wanted.contains(state))
                .map(|(_, p)| p)
                .sum()
        };
        let (mut growing, mut decaying, mut heave_and_yaw) = (0, 0, 0);
        for mode in modes(&reduced).unwrap() {
            println!("{name}: {:.4}, {:?}", mode.eigenvalue, mode.name);
            let participation = mode.participation.as_ref().unwrap();
            let eigenvalues = if mode.oscillates() { 2 } else { 1 };
            if share(participation, &["w", "r"]) > 0.8 {
                assert!(!mode.oscillates());
                heave_and_yaw += eigenvalues;
            } else if share(participation, &["u", "q", "theta", "v", "p", "phi"]) > 0.8 {
                if mode.unstable() {
                    assert!(mode.oscillates());
                    assert!((0.2..0.8).contains(&mode.natural_frequency()));
                    growing += eigenvalues;
                } else {
                    decaying += eigenvalues;
                }
            }
        }
        assert_eq!((growing, decaying, heave_and_yaw), (4, 2, 2), "interactions {name}");
        // The trace of both cubics: roots sum to X_u + M_q + Y_v + L_p and
        // what couples them, exactly the trace of A.
        let sum: Complex<f64> = eigenvalues(reduced.a()).unwrap().iter().sum();
        assert!((sum.re - reduced.a().trace()).abs() < 1e-10);
    }
    // A rotor in the other's wash gains inflow as it climbs into it: heave is
    // less damped than that of rotors alone.
    let z_w = |flight: &Flight| flight.reduced().derivative("w", "w").unwrap();
    assert!(z_w(&HOVER) > z_w(&HOVER_OFF) && z_w(&HOVER_OFF) < 0.0);
}

#[test]
fn averaging_is_compared_with_floquet_theory_and_harmonics() {
    let flight = &*HOVER;
    let model = &flight.linear.model;
    let floquet = analyse(model, &FloquetOptions::default()).unwrap();
    let omega = log_grid(0.1, 30.0, 40).unwrap();
    let error = averaging_error(model, &floquet, 3, &omega, &ErrorOptions::default()).unwrap();
    for (harmonics, difference) in &error.harmonic {
        println!("{harmonics} harmonics: exponents off by {difference:.2e} rad/s");
    }
    let difference = |n: usize| error.harmonic[n].1;
    assert!(difference(1) < 0.01 * difference(0));
    assert!(difference(2) < 0.01 * difference(1));
    assert!(difference(3) < 1e-6);
    // The airframe's modes: what averaging costs there.
    let slow: Vec<_> = error.averaged.iter().filter(|pair| pair.exact.norm() < 1.0).collect();
    assert_eq!(slow.len(), 8);
    for pair in slow {
        println!("{:.5} averaged, {:.5} exact", pair.approximate, pair.exact);
        assert!(pair.difference < 0.05 * pair.exact.norm().max(0.1));
    }
}
