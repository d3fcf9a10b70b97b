//! The identities of a whole problem.

use super::{Identity, mirror_signs, mirror_sticks, mirrored};
use crate::linear::floquet::{FloquetOptions, analyse, averaging_error};
use crate::linear::frequency::{ErrorOptions, log_grid};
use crate::linear::harmonic::{Harmonics, decompose};
use crate::linear::linearize::{Options as LinearOptions, linearize};
use crate::linear::model::PeriodicSample;
use crate::linear::reduction::{RIGID_BODY, residualise};
use crate::linear::{Channel, LinearError, PeriodicModel};
use crate::problem::{InterferenceRule, Problem, Report};
use crate::trim::shooting::Shooting;
use crate::trim::{
    ConvergedTrim, FlightCondition, Guess, Lateral, Options, TrimPoint, sweep, trim,
};
use crate::units::{KNOT, Kind};
use crate::vehicle::{Vehicle, VehicleError};
use nalgebra::{DMatrix, DVector};

/// What kept the identities from being computed.
#[derive(Debug, thiserror::Error)]
pub enum ValidationError {
    /// A problem file is wrong.
    #[error(transparent)]
    Problem(#[from] Report),
    /// A variant of the aircraft cannot be built.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// A linear model could not be made.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// A flight has no trim.
    #[error("{aircraft} has no trim at {condition}: {status}")]
    Trim {
        /// Name of the problem.
        aircraft: String,
        /// The flight.
        condition: String,
        /// How the trim ended.
        status: String,
    },
}

/// Speeds of the trim table, kt.
const SPEEDS: std::ops::RangeInclusive<u32> = 0..=18;
/// Periods in ten revolutions of two-bladed rotors.
const PERIODS: usize = 20;
/// Growth of a disturbance over ten revolutions: the fastest motion of a hover
/// grows by e in about 2 s, and a coupled system may do ten times worse before
/// it settles into its growing motion.
const GROWTH: f64 = 10.0 * std::f64::consts::E;
/// Change of a state for differences, in units of its scale; of a stick, %.
const CHANGE: f64 = 1e-4;
/// Distance at which rotors feel nothing of each other, rotor radii.
const FAR: f64 = 1e5;

/// Every identity of a problem: vehicle, trim, linear models.
///
/// # Errors
/// A variant of the aircraft that cannot be built, trimmed or linearised.
pub fn identities(problem: &Problem) -> Result<Vec<Identity>, ValidationError> {
    let mut list = Vec::new();
    let vehicle = Vehicle::new(problem)?;
    let mirror = Vehicle::new(&mirrored(problem))?;
    vehicle_identities(problem, &vehicle, &mirror, &mut list)?;
    trim_identities(&vehicle, &mirror, &mut list)?;
    for knots in [0.0, 60.0] {
        linear_identities(&vehicle, knots, &mut list)?;
    }
    Ok(list)
}

fn level(knots: f64) -> FlightCondition {
    FlightCondition::level(knots * KNOT)
}

/// A turn with sideslip: nothing in it is symmetric.
fn crooked(sign: f64) -> FlightCondition {
    FlightCondition {
        turn_rate: 0.1 * sign,
        lateral: Lateral::Sideslip(0.05 * sign),
        ..level(60.0)
    }
}

fn trimmed(
    vehicle: &Vehicle,
    condition: FlightCondition,
    options: &Options,
) -> Result<ConvergedTrim, ValidationError> {
    // From the speed alone first: a turn is then a neighbour.
    let straight = FlightCondition::level(condition.airspeed);
    let mut points = sweep(vehicle, &[straight, condition], options, |_| {}).points;
    let point = points.remove(points.len() - 1);
    point.into_converged().map_err(|point| ValidationError::Trim {
        aircraft: vehicle.name.clone(),
        condition: format!("{:.0} kt", condition.airspeed / KNOT),
        status: format!("{:?}", point.status),
    })
}

/// Far tighter than the default, where an identity is exact.
fn tight() -> Options {
    Options { residual_tolerance: 1e-12, ..Options::default() }
}

/// Rates of a state under blade controls.
fn rates(vehicle: &Vehicle, azimuth: f64, state: &[f64], effectors: &[f64]) -> Vec<f64> {
    let mut work = vehicle.workspace::<f64>();
    let mut rates = vec![0.0; vehicle.state_count()];
    vehicle.rates(azimuth, state, effectors, [0.0; 3], &mut work, &mut rates);
    rates
}

fn blade_controls(vehicle: &Vehicle, sticks: &[f64; 4]) -> Vec<f64> {
    let mut effectors = vec![0.0; vehicle.effector_count()];
    vehicle.mix(sticks, &mut effectors);
    effectors
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    // NaN counts as the largest.
    values.into_iter().fold(0.0, |most, value| if value <= most { most } else { value })
}

// --- Vehicle -----------------------------------------------------------------

fn vehicle_identities(
    problem: &Problem,
    vehicle: &Vehicle,
    mirror: &Vehicle,
    list: &mut Vec<Identity>,
) -> Result<(), ValidationError> {
    let trim = trimmed(vehicle, crooked(1.0), &Options::default())?;
    let point = trim.point();
    let signs = mirror_signs(vehicle);
    let flipped: Vec<f64> = point.state.iter().zip(&signs).map(|(x, s)| x * s).collect();
    let here = blade_controls(vehicle, &point.sticks);
    let there = blade_controls(mirror, &mirror_sticks(point.sticks));
    let a = rates(vehicle, 0.3, &point.state, &here);
    let b = rates(mirror, 0.3, &flipped, &there);
    list.push(Identity {
        stage: "vehicle",
        statement: "the mirrored vehicle in the mirrored flight has the mirrored rates",
        case: "60 kt, turning and slipping".into(),
        error: largest(
            a.iter().zip(&b).zip(&signs).map(|((a, b), s)| (a - s * b).abs() / a.abs().max(1.0)),
        ),
        measure: "rates, relative or SI",
        tolerance: 1e-10,
    });

    if vehicle.rotors.len() == 2 && problem.inflow.interactions {
        let mut apart = problem.clone();
        apart.rotors[0].hub.butt_line += FAR * problem.rotors[0].radius;
        for rotor in &mut apart.rotors {
            rotor.tilt = 0.0;
        }
        let apart = Vehicle::new(&apart)?;
        let felt = [(0, 1), (1, 0)].iter().flat_map(|&(receiver, source)| {
            [[0.0, 0.0], [0.4, 0.1], [-0.3, 0.5]].map(|skew| {
                apart.interference(receiver, source).map_or(0.0, |g| g.evaluate(skew).amax())
            })
        });
        list.push(Identity {
            stage: "vehicle",
            statement: "two rotors very far apart are two rotors alone",
            case: "hubs 100 000 radii apart".into(),
            error: largest(felt),
            measure: "interference coefficient G",
            // The theory drops the vortices along the wake: harmonics fall
            // with the distance itself.
            tolerance: 1e-5,
        });
        let upright = problem.rotors.iter().all(|rotor| rotor.tilt == 0.0 && rotor.cant == 0.0);
        let same = problem.rotors[0].radius == problem.rotors[1].radius;
        if upright && same && problem.formulation.interference_rule == InterferenceRule::Converged {
            let g = |receiver, source| {
                vehicle
                    .interference(receiver, source)
                    .map_or(f64::NAN, |g| g.evaluate([0.0, 0.0])[(0, 0)])
            };
            list.push(Identity {
                stage: "vehicle",
                statement: "G₁₁ above and below a vortex cylinder sum to its far wake's",
                case: "hover, no skew".into(),
                error: (g(0, 1) + g(1, 0) - 1.0).abs(),
                measure: "G₁₁(z) + G₁₁(−z) − 1",
                tolerance: 1e-6,
            });
        }
    }
    Ok(())
}

// --- Trim --------------------------------------------------------------------

/// Largest difference of two trims: mean states and sticks relative to
/// themselves or, where they are small, to their scales; thrust, torque and
/// power of each rotor relative to themselves.
fn trim_difference(vehicle: &Vehicle, a: &TrimPoint, b: &TrimPoint) -> f64 {
    let relative = |a: f64, b: f64, scale: f64| (a - b).abs() / a.abs().max(scale);
    let states = vehicle.layout.states.iter().zip(a.mean_state.iter().zip(&b.mean_state));
    let sticks = crate::trim::shooting::stick_scales(vehicle);
    let rotors = a.rotors.iter().zip(&b.rotors).flat_map(|(a, b)| {
        [(a.thrust, b.thrust), (a.torque, b.torque), (a.power, b.power)]
            .map(|(a, b)| relative(a, b, f64::MIN_POSITIVE))
    });
    largest(
        states
            .map(|(quantity, (&a, &b))| relative(a, b, quantity.scale))
            .chain((0..4).map(|k| relative(a.sticks[k], b.sticks[k], sticks[k])))
            .chain(rotors),
    )
}

fn trim_identities(
    vehicle: &Vehicle,
    mirror: &Vehicle,
    list: &mut Vec<Identity>,
) -> Result<(), ValidationError> {
    let options = Options::default();
    let conditions: Vec<FlightCondition> = SPEEDS.map(|k| level(5.0 * f64::from(k))).collect();
    let off = vehicle.with_interactions(false)?;
    let (on, off) = rayon::join(
        || sweep(vehicle, &conditions, &options, |_| {}),
        || sweep(&off, &conditions, &options, |_| {}),
    );
    let points = || on.points.iter().chain(&off.points);
    list.push(Identity {
        stage: "trim",
        statement: "every orbit is periodic and at its flight condition",
        case: "0 to 90 kt by 5 kt, interactions on and off".into(),
        error: largest(points().map(|p| if p.on_orbit() { p.residual_norm } else { f64::NAN })),
        measure: "norm of scaled residuals",
        tolerance: 1e-9,
    });

    for knots in [0.0, 50.0, 80.0] {
        let point = trimmed(vehicle, level(knots), &options)?;
        let point = point.point();
        let guess = Guess { steps: Some(2 * point.steps), ..point.guess() };
        let again = trim(vehicle, point.condition, &guess, &options);
        list.push(Identity {
            stage: "trim",
            statement: "halving the step moves no trim value",
            case: format!("{knots:.0} kt, {} and {} steps", point.steps, again.steps),
            error: if again.on_orbit() {
                trim_difference(vehicle, point, &again)
            } else {
                f64::NAN
            },
            measure: "relative change",
            tolerance: 1e-6,
        });
    }

    for knots in [0.0, 60.0] {
        let trim = trimmed(vehicle, level(knots), &options)?;
        let point = trim.point();
        let shooting = Shooting::new(vehicle, point.condition, point.method, point.steps);
        let mut state = point.state.clone();
        for _ in 0..PERIODS {
            state = shooting.fly(&state, &point.sticks, |_, _, _, _| {}).end;
        }
        let states = state.iter().zip(&point.state).zip(&vehicle.layout.states);
        list.push(Identity {
            stage: "trim",
            statement: "an orbit flown for ten revolutions stays on itself",
            case: format!("{knots:.0} kt"),
            error: largest(states.map(|((now, then), q)| ((now - then) / q.scale).abs())),
            measure: "drift, in scales of the states",
            tolerance: PERIODS as f64 * GROWTH * options.residual_tolerance,
        });
    }

    let a = trimmed(vehicle, crooked(1.0), &tight())?;
    let b = trimmed(mirror, crooked(-1.0), &tight())?;
    let mut reflected = b.point().clone();
    for (value, sign) in reflected.mean_state.iter_mut().zip(mirror_signs(vehicle)) {
        *value *= sign;
    }
    reflected.sticks = mirror_sticks(reflected.sticks);
    list.push(Identity {
        stage: "trim",
        statement: "the mirrored vehicle trims to the mirrored flight",
        case: "60 kt, turning and slipping".into(),
        error: trim_difference(vehicle, a.point(), &reflected),
        measure: "relative difference",
        tolerance: 1e-9,
    });

    let flights = [
        ("hover", level(0.0)),
        ("60 kt, level", level(60.0)),
        ("50 kt, climbing 3 m/s", FlightCondition { climb_rate: 3.0, ..level(50.0) }),
        ("60 kt, turning 0.15 rad/s", FlightCondition { turn_rate: 0.15, ..level(60.0) }),
    ];
    for (case, condition) in flights {
        let trim = trimmed(vehicle, condition, &options)?;
        list.push(Identity {
            stage: "trim",
            statement: "shaft power is induced, profile, parasite and climb power",
            case: case.into(),
            error: trim.point().power.imbalance().abs(),
            measure: "imbalance over shaft power",
            tolerance: 1e-6,
        });
    }
    Ok(())
}

// --- Linear models -----------------------------------------------------------

/// Largest difference of two matrices in scaled rows and columns, over the
/// largest scaled entry.
fn scaled_difference(x: &DMatrix<f64>, y: &DMatrix<f64>, rows: &[f64], columns: &[f64]) -> f64 {
    let scaled = |m: &DMatrix<f64>| {
        DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * columns[j] / rows[i])
    };
    (scaled(x) - scaled(y)).amax() / scaled(y).amax()
}

/// Averages of ∂rates/∂state and ∂rates/∂stick over the samples of a model, by
/// central differences.
fn differences(
    vehicle: &Vehicle,
    point: &TrimPoint,
    samples: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = vehicle.state_count();
    let steps = samples * point.steps.div_ceil(samples);
    let shooting = Shooting::new(vehicle, point.condition, point.method, steps);
    let (mut a, mut b) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 4));
    let weight = 1.0 / samples as f64;
    let at = |azimuth: f64, state: &[f64], sticks: &[f64; 4]| {
        DVector::from_vec(rates(vehicle, azimuth, state, &blade_controls(vehicle, sticks)))
    };
    let mut see = |azimuth: f64, state: &[f64]| {
        for (j, quantity) in vehicle.layout.states.iter().enumerate() {
            let h = CHANGE * quantity.scale;
            let moved = |change: f64| {
                let mut moved = state.to_vec();
                moved[j] += change;
                at(azimuth, &moved, &point.sticks)
            };
            let slope = (moved(h) - moved(-h)) * (weight / (2.0 * h));
            a.set_column(j, &(a.column(j) + slope));
        }
        for j in 0..4 {
            let moved = |change: f64| {
                let mut moved = point.sticks;
                moved[j] += change;
                at(azimuth, state, &moved)
            };
            let slope = (moved(CHANGE) - moved(-CHANGE)) * (weight / (2.0 * CHANGE));
            b.set_column(j, &(b.column(j) + slope));
        }
    };
    shooting.fly(&point.state, &point.sticks, |index, time, state, _| {
        if index % (steps / samples) == 0 {
            see(time * vehicle.reference_speed, state);
        }
    });
    (a, b)
}

/// The periodic model with every stick as a state that stays put, so that its
/// transition matrix holds the response to steps of the sticks too.
fn with_sticks_as_states(model: &PeriodicModel) -> Result<PeriodicModel, LinearError> {
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
    PeriodicModel::new(states, one("none"), one("nothing"), model.frequency(), samples)
}

/// How far the error of the linear response is from growing with the square
/// of the disturbance: nonlinear flight of two periods from a disturbed start
/// with moved sticks, less the trimmed flight, less the periodic model's.
fn second_order(
    vehicle: &Vehicle,
    point: &TrimPoint,
    model: &PeriodicModel,
) -> Result<f64, LinearError> {
    let scales: Vec<f64> = vehicle.layout.states.iter().map(|state| state.scale).collect();
    let n = scales.len();
    // Every state and stick moves, by unlike amounts.
    let direction = DVector::from_fn(n + 4, |k, _| {
        (1.0 + 0.7 * k as f64).sin() * scales.get(k).copied().unwrap_or(1.0)
    });
    let shooting = Shooting::new(vehicle, point.condition, point.method, point.steps);
    let after_two_periods = |size: f64| -> DVector<f64> {
        let mut state: Vec<f64> = (0..n).map(|k| point.state[k] + size * direction[k]).collect();
        let sticks = [0, 1, 2, 3].map(|k| point.sticks[k] + size * direction[n + k]);
        for _ in 0..2 {
            state = shooting.fly(&state, &sticks, |_, _, _, _| {}).end;
        }
        DVector::from_vec(state)
    };
    let augmented = with_sticks_as_states(model)?;
    let once = analyse(&augmented, &FloquetOptions::default())?.monodromy;
    let linear = (&once * &once * &direction).rows(0, n).into_owned();
    let trimmed = after_two_periods(0.0);
    let error = |size: f64| -> f64 {
        let difference = after_two_periods(size) - &trimmed - &linear * size;
        largest((0..n).map(|k| (difference[k] / scales[k]).abs()))
    };
    let errors = [0.02, 0.04, 0.08].map(error);
    let off = |ratio: f64| (ratio / 4.0 - 1.0).abs();
    Ok(largest([off(errors[1] / errors[0]), off(errors[2] / errors[1])]))
}

fn linear_identities(
    vehicle: &Vehicle,
    knots: f64,
    list: &mut Vec<Identity>,
) -> Result<(), ValidationError> {
    const HARMONICS: usize = 3;
    let trim = trimmed(vehicle, level(knots), &Options::default())?;
    let point = trim.point();
    let model = linearize(vehicle, &trim, &LinearOptions::default())?.model;
    let averaged = model.averaged();
    let scales: Vec<f64> = vehicle.layout.states.iter().map(|state| state.scale).collect();
    let mut put = |statement, error, measure, tolerance| {
        let case = if knots > 0.0 { format!("{knots:.0} kt") } else { "hover".into() };
        list.push(Identity { stage: "linear", statement, case, error, measure, tolerance });
    };

    let (a, b) = differences(vehicle, point, model.samples().len());
    put(
        "A and B are the differences of the averaged rates",
        largest([
            scaled_difference(averaged.a(), &a, &scales, &scales),
            scaled_difference(averaged.b(), &b, &scales, &[1.0; 4]),
        ]),
        "over the largest entry",
        1e-7,
    );
    put(
        "the periodic model is the nonlinear response to second order",
        second_order(vehicle, point, &model)?,
        "error ratio on doubling, off 4 by",
        0.1,
    );
    let floquet = analyse(&model, &FloquetOptions::default())?;
    let sum: f64 = floquet.modes.iter().map(|mode| mode.exponent.re).sum();
    put(
        "Liouville: Floquet exponents sum to the mean trace of A",
        (sum / averaged.a().trace() - 1.0).abs(),
        "relative",
        1e-7,
    );
    let omega = log_grid(0.1, 30.0, 40)?;
    let error = averaging_error(&model, &floquet, HARMONICS, &omega, &ErrorOptions::default())?;
    let none = decompose(&model, &Harmonics::states_up_to(0))?;
    put(
        "the harmonic model without harmonics is the averaged model",
        scaled_difference(none.a(), averaged.a(), &scales, &scales),
        "over the largest entry",
        1e-13,
    );
    put(
        "with harmonics its eigenvalues become the Floquet exponents",
        error.harmonic.last().map_or(f64::NAN, |last| last.1),
        "3 harmonics, rad/s",
        1e-6,
    );
    let reduced = residualise(&averaged, &RIGID_BODY)?.model;
    let (exact, approximate) = (averaged.dc_gain()?, reduced.dc_gain()?);
    let rows = (0..exact.nrows()).map(|i| {
        // An output without a steady part is judged against one SI unit.
        (exact.row(i) - approximate.row(i)).amax() / exact.row(i).amax().max(1e-4)
    });
    put("residualisation keeps the steady gain", largest(rows), "relative", 1e-8);
    Ok(())
}
