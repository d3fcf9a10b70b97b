//! Linear models of the real aircraft against its nonlinear dynamics, against
//! each other, and against what theory says about their structure.

use std::sync::LazyLock;

use coaxdesign::linear::dense::eigenvalues;
use coaxdesign::linear::floquet::{FloquetOptions, analyse, averaging_error};
use coaxdesign::linear::frequency::{ErrorOptions, log_grid};
use coaxdesign::linear::linearize::{Inputs, Linearization, Options, linearize};
use coaxdesign::linear::model::PeriodicSample;
use coaxdesign::linear::modes::modes;
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::linear::{Channel, PeriodicModel, StateSpace};
use coaxdesign::problem::builtin;
use coaxdesign::trim::shooting::Shooting;
use coaxdesign::trim::{self, ConvergedTrim, FlightCondition, sweep};
use coaxdesign::units::{KNOT, Kind};
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
    /// Times and states at the samples of the periodic model.
    fn orbit(&self) -> Vec<(f64, Vec<f64>)> {
        let point = self.trim.point();
        let count = self.linear.model.samples().len();
        let steps = count * point.steps.div_ceil(count);
        let shooting = Shooting::new(&self.vehicle, point.condition, point.method, steps);
        let mut orbit = Vec::new();
        shooting.fly(&point.state, &point.sticks, |index, time, state, _| {
            if index % (steps / count) == 0 {
                orbit.push((time, state.to_vec()));
            }
        });
        orbit
    }

    fn rates(&self, time: f64, state: &[f64], sticks: &[f64; 4]) -> DVector<f64> {
        let vehicle = &self.vehicle;
        let mut effectors = vec![0.0; vehicle.effector_count()];
        vehicle.mix(sticks, &mut effectors);
        let mut rates = vec![0.0; vehicle.state_count()];
        let mut work = vehicle.workspace::<f64>();
        let azimuth = time * vehicle.reference_speed;
        vehicle.rates(azimuth, state, &effectors, [0.0; 3], &mut work, &mut rates);
        DVector::from_vec(rates)
    }

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
fn averaged_matrices_are_the_differences_of_the_averaged_rates() {
    // Central differences err by the square of the change, here 1e-4 of the
    // scale of each state, and by rounding over the change.
    const CHANGE: f64 = 1e-4;
    const TOLERANCE: f64 = 1e-7;
    for flight in [&*HOVER, &*HOVER_OFF, &*FORWARD] {
        let scales = flight.scales();
        let n = scales.len();
        let sticks = flight.trim.point().sticks;
        let orbit = flight.orbit();
        let weight = 1.0 / orbit.len() as f64;
        let (mut a, mut b) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 4));
        for (time, state) in &orbit {
            for j in 0..n {
                let h = CHANGE * scales[j];
                let at = |sign: f64| {
                    let mut moved = state.clone();
                    moved[j] += sign * h;
                    flight.rates(*time, &moved, &sticks)
                };
                let slope = (at(1.0) - at(-1.0)) * (weight / (2.0 * h));
                a.set_column(j, &(a.column(j) + slope));
            }
            for j in 0..4 {
                let at = |sign: f64| {
                    let mut moved = sticks;
                    moved[j] += sign * CHANGE;
                    flight.rates(*time, state, &moved)
                };
                let slope = (at(1.0) - at(-1.0)) * (weight / (2.0 * CHANGE));
                b.set_column(j, &(b.column(j) + slope));
            }
        }
        let model = flight.linear.model.averaged();
        let worst_a = scaled_difference(model.a(), &a, &scales, &scales);
        let worst_b = scaled_difference(model.b(), &b, &scales, &[1.0; 4]);
        println!("A off by {worst_a:.1e}, B by {worst_b:.1e} of the largest entry");
        assert!(worst_a < TOLERANCE, "A: {worst_a:.2e}");
        assert!(worst_b < TOLERANCE, "B: {worst_b:.2e}");
    }
}

/// The periodic model with every stick as a state that stays put, so that its
/// transition matrix holds the response to steps of the sticks too.
fn with_sticks_as_states(model: &PeriodicModel) -> PeriodicModel {
    let (n, m) = (model.states().len(), model.inputs().len());
    let mut states = model.states().to_vec();
    states.extend(model.inputs().iter().cloned());
    let samples = model
        .samples()
        .iter()
        .map(|sample| {
            let mut a = DMatrix::zeros(n + m, n + m);
            a.view_mut((0, 0), (n, n)).copy_from(&sample.a);
            a.view_mut((0, n), (n, m)).copy_from(&sample.b);
            PeriodicSample {
                a,
                b: DMatrix::zeros(n + m, 1),
                c: DMatrix::zeros(1, n + m),
                d: DMatrix::zeros(1, 1),
            }
        })
        .collect();
    let one = |name: &str| vec![Channel::new(name, Kind::Dimensionless)];
    PeriodicModel::new(states, one("none"), one("nothing"), model.frequency(), samples).unwrap()
}

#[test]
fn periodic_model_is_the_nonlinear_response_to_second_order() {
    for flight in [&*HOVER, &*FORWARD] {
        let point = flight.trim.point();
        let scales = flight.scales();
        let n = scales.len();
        // Every state and stick moves, by unlike amounts.
        let lively = |k: usize| (1.0 + 0.7 * k as f64).sin();
        let direction =
            DVector::from_fn(n + 4, |k, _| lively(k) * if k < n { scales[k] } else { 1.0 });
        let shooting = Shooting::new(&flight.vehicle, point.condition, point.method, point.steps);
        let after_two_periods = |size: f64| -> DVector<f64> {
            let mut state: Vec<f64> =
                (0..n).map(|k| point.state[k] + size * direction[k]).collect();
            let sticks = [0, 1, 2, 3].map(|k| point.sticks[k] + size * direction[n + k]);
            for _ in 0..2 {
                state = shooting.fly(&state, &sticks, |_, _, _, _| {}).end;
            }
            DVector::from_vec(state)
        };
        let augmented = with_sticks_as_states(&flight.linear.model);
        let once = analyse(&augmented, &FloquetOptions::default()).unwrap().monodromy;
        let linear = (&once * &once * &direction).rows(0, n).into_owned();
        let trimmed = after_two_periods(0.0);
        let error = |size: f64| -> f64 {
            let difference = after_two_periods(size) - &trimmed - &linear * size;
            (0..n).map(|k| (difference[k] / scales[k]).abs()).fold(0.0, f64::max)
        };
        let errors = [0.02, 0.04, 0.08].map(error);
        let ratios = [errors[1] / errors[0], errors[2] / errors[1]];
        println!("errors {errors:?}, ratios {ratios:?}");
        // Second order: doubling the disturbance makes four times the error.
        for ratio in ratios {
            assert!((3.6..4.4).contains(&ratio), "errors {errors:?}, ratios {ratios:?}");
        }
    }
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
    // Liouville: exponents sum to the mean trace of A.
    let sum: f64 = floquet.modes.iter().map(|mode| mode.exponent.re).sum();
    let trace = model.averaged().a().trace();
    assert!((sum / trace - 1.0).abs() < 1e-7, "{sum} {trace}");
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

#[test]
fn residualisation_keeps_the_steady_gain_of_the_aircraft() {
    for flight in [&*HOVER, &*HOVER_OFF, &*FORWARD] {
        let full = flight.linear.model.averaged();
        let reduced = flight.reduced();
        let (exact, approximate) = (full.dc_gain().unwrap(), reduced.dc_gain().unwrap());
        for (i, output) in full.outputs().iter().enumerate() {
            let size = exact.row(i).amax();
            let error = (exact.row(i) - approximate.row(i)).amax();
            // In a steady turn-free flight some outputs have no steady part at
            // all; what rounding leaves of them is judged against one SI unit.
            assert!(error <= 1e-8 * size.max(1e-4), "{}: {error:.1e} of {size:.1e}", output.name);
        }
    }
}
