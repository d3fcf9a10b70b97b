//! One right-hand side of the CoAX 2D: two rotors of two blades of twenty
//! elements with a table airfoil, in plain numbers and with all tangents of a
//! trim; of the UH-60A, at most 1.6 us for each 20 blade elements; and of an X8, whose
//! eight rotors in one another's wakes cost at most three times what they cost
//! alone, built in at most half a second.

use coaxdesign::numerics::scalar::{Dual, Scalar};
use coaxdesign::problem::builtin_named;
use coaxdesign::trim::{FlightCondition, Guess, Options, trim};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

/// A built-in problem, its rotors in one another's wakes or not.
fn built(name: &str, interactions: bool) -> Vehicle {
    let mut problem = builtin_named(name).expect("a built-in problem").problem;
    problem.inflow.interactions &= interactions;
    problem.inflow.reach = 1000.0;
    Vehicle::new(&problem).expect("a built-in vehicle")
}

/// Tangents that a trim of the CoAX 2D carries: 24 states and 4 sticks.
const TANGENTS: usize = 28;

fn rates<S: Scalar>(
    criterion: &mut Criterion,
    label: &str,
    vehicle: &Vehicle,
    speed: f64,
    seed: impl Fn(f64, usize) -> S,
) {
    let condition = FlightCondition::level(speed);
    let guess = Guess::estimate(vehicle, &condition);
    let point = trim(vehicle, condition, &guess, &Options::default());
    assert!(point.on_orbit(), "{:?}", point.status);
    let state: Vec<S> = point.state.iter().enumerate().map(|(k, &x)| seed(x, k)).collect();
    let sticks = [0, 1, 2, 3].map(|k| seed(point.sticks[k], state.len() + k));
    let mut effectors = vec![S::default(); vehicle.effector_count()];
    vehicle.mix(&sticks, &mut effectors);
    let mut work = vehicle.workspace::<S>();
    let mut out = vec![S::default(); state.len()];
    let mut azimuth = 0.0;
    criterion.bench_function(label, |bencher| {
        bencher.iter(|| {
            azimuth += 0.1;
            let (state, effectors) = (black_box(&state), black_box(&effectors));
            vehicle.rates(azimuth, state, effectors, [0.0; 3], &mut work, &mut out);
            black_box(&out);
        });
    });
}

fn plain(criterion: &mut Criterion) {
    rates(criterion, "rates, plain", &built("coax2d", true), 40.0 * KNOT, |value, _| value);
}

fn other_aircraft(criterion: &mut Criterion) {
    let uh60a = built("uh60a", true);
    rates(
        criterion,
        "rates, UH-60A, 80 blade elements and a tail rotor",
        &uh60a,
        40.0 * KNOT,
        |value, _| value,
    );
    for (label, interactions) in [("in one another's wakes", true), ("alone", false)] {
        let x8 = built("octo-x8", interactions);
        let label = format!("rates, eight rotors {label}");
        rates(criterion, &label, &x8, 5.0, |value, _| value);
    }
    criterion.bench_function("vehicle, eight rotors in one another's wakes", |bencher| {
        bencher.iter(|| built("octo-x8", true));
    });
}

fn tangents(criterion: &mut Criterion) {
    let vehicle = built("coax2d", true);
    rates(criterion, "rates, 28 tangents", &vehicle, 40.0 * KNOT, |value, index| {
        if index < TANGENTS {
            Dual::<TANGENTS>::variable(value, index)
        } else {
            Dual::constant(value)
        }
    });
}

criterion_group!(benches, plain, tangents, other_aircraft);
criterion_main!(benches);
