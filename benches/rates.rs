//! One right-hand side of the CoAX 2D: two rotors of two blades of twenty
//! elements with a table airfoil, in plain numbers and with all tangents of a
//! trim.

use coaxdesign::numerics::scalar::{Dual, Scalar};
use coaxdesign::problem::builtin_named;
use coaxdesign::trim::{FlightCondition, Guess, Options, trim};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

/// Tangents that a trim of the CoAX 2D carries: 24 states and 4 sticks.
const TANGENTS: usize = 28;

fn rates<S: Scalar>(criterion: &mut Criterion, label: &str, seed: impl Fn(f64, usize) -> S) {
    let problem = builtin_named("coax2d").expect("a built-in problem").problem;
    let vehicle = Vehicle::new(&problem).expect("a built-in vehicle");
    let condition = FlightCondition::level(40.0 * KNOT);
    let guess = Guess::estimate(&vehicle, &condition);
    let point = trim(&vehicle, condition, &guess, &Options::default());
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
    rates(criterion, "rates, plain", |value, _| value);
}

fn tangents(criterion: &mut Criterion) {
    rates(criterion, "rates, 28 tangents", |value, index| {
        if index < TANGENTS {
            Dual::<TANGENTS>::variable(value, index)
        } else {
            Dual::constant(value)
        }
    });
}

criterion_group!(benches, plain, tangents);
criterion_main!(benches);
